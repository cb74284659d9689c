"""Operators against plain scikit-fem forms, against their own definitions, and their orders of convergence."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg as spla
import skfem
from closed_forms.bars import box_frequencies
from meshes import CELLS, QUADRATIC, STEEL, body, brick, pipe, rotation_matrix, shaken
from numpy.polynomial.legendre import Legendre, leggauss
from scipy.spatial import cKDTree
from skfem.helpers import ddot, dot, eye, grad, sym_grad, trace

from microslip.data import Mesh
from microslip.elasticity import isotropic, orthotropic
from microslip.fem.discretise import discretise, face_blocks, free_upper, reference_nodes
from microslip.fem.loads import body_force, centrifugal, pressure, traction
from microslip.fem.operators import (
    displacement_gradient,
    engineering,
    from_tensor,
    green_strain,
    internal_force,
    mass,
    spin_projector,
    stiffness,
    stress_stiffness,
    tangent,
    tangent_tensor,
    to_symmetric,
    to_tensor,
)
from microslip.modal.prepared import inertia_of
from microslip.modal.rigid import rigid_fields

E, NU, RHO = STEEL["young"], STEEL["poisson"], STEEL["density"]
LAME, SHEAR = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
STEEL_C = isotropic(E, NU)
WOOD = (np.array([120e9, 9e9, 14e9]), np.array([0.28, 0.35, 0.31]), np.array([5e9, 3.4e9, 6e9]))
AXES = rotation_matrix((0.4, -0.7, 1.1))
WOOD_C = orthotropic(*WOOD, AXES)
DEGREE = {"tetra": 2, "tetra10": 2, "hexahedron": 3, "hexahedron20": 5, "hexahedron27": 5}

# ---------------------------------------------------------------- the oracle: scikit-fem's own assembly

_SKFEM = {
    "tetra": (skfem.MeshTet1, skfem.ElementTetP1),
    "tetra10": (skfem.MeshTet2, skfem.ElementTetP2),
    "hexahedron": (skfem.MeshHex1, skfem.ElementHex1),
    "hexahedron20": (skfem.MeshHex1, skfem.ElementHexS2),
    "hexahedron27": (skfem.MeshHex2, skfem.ElementHex2),
}


def oracle(mesh: Mesh, cell_type: str) -> tuple[skfem.Basis, np.ndarray]:
    """scikit-fem's basis on the same mesh, and our degree of freedom for each of its."""
    kind, element = _SKFEM[cell_type]
    cells = mesh.cells[cell_type]
    nodes = np.asarray(element.doflocs)
    order = np.abs(nodes[:, None] - reference_nodes(cell_type)[None]).max(axis=2).argmin(axis=1)
    corners = kind.elem.refdom.nnodes
    if kind in (skfem.MeshTet2, skfem.MeshHex2):
        theirs = kind(np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(cells[:, order].T))
    else:
        used, t = np.unique(cells[:, order[:corners]], return_inverse=True)
        theirs = kind(np.ascontiguousarray(mesh.points[used].T), np.ascontiguousarray(t.reshape(-1, corners).T))
    basis = skfem.Basis(theirs, skfem.ElementVector(element()), intorder=DEGREE[cell_type])
    distance, node = cKDTree(mesh.points).query(basis.doflocs.T)
    assert distance.max() < 1e-12
    component = np.zeros(basis.N, dtype=int)
    for local in range(basis.Nbfun):
        component[basis.element_dofs[local]] = local % 3
    return basis, 3 * node + component


def ours(matrix, dofs):
    """scikit-fem's matrix in our numbering."""
    A = matrix.tocoo()
    return sp.csr_matrix((A.data, (dofs[A.row], dofs[A.col])), shape=A.shape)


@skfem.BilinearForm
def elastic_form(u, v, w):
    return 2 * w.mu * ddot(sym_grad(u), sym_grad(v)) + w.lam * trace(grad(u)) * trace(grad(v))


@skfem.BilinearForm
def mass_form(u, v, w):
    return w.rho * dot(u, v)


@skfem.BilinearForm
def stress_form(u, v, w):
    """S_ij u_k,i v_k,j with a stress that varies in space."""
    x, y, z = w.x
    S = [[1e8 * x, 2e7 * y * z, 3e7], [2e7 * y * z, -5e7 * y, 1e7 * x], [3e7, 1e7 * x, 4e7 * z * x]]
    return sum(S[i][j] * grad(u)[k, i] * grad(v)[k, j] for i in range(3) for j in range(3) for k in range(3))


def the_stress(points):
    x, y, z = np.moveaxis(points, -1, 0)
    one = np.ones_like(x)
    return np.stack([1e8 * x, -5e7 * y, 4e7 * z * x, 2e7 * y * z, 1e7 * x, 3e7 * one], axis=-1)


def at_quadrature(d):
    return [np.einsum("qk,eki->eqi", b.N, d.mesh.points[b.cells]) for b in d.blocks]


def full3(d, scalar):
    """Scalar operator times the 3 x 3 identity, (3n, 3n)."""
    return d.pattern.full(scalar[:, None, None] * np.eye(3))


def far(A, B):
    return abs(A - B).max() / abs(B).max()


def test_mesh(cell_type, n=(2, 2, 2)):
    """Bent where scikit-fem can bend it; its serendipity brick has straight sides."""
    straight = cell_type in ("hexahedron20", "tetra", "hexahedron")
    return brick(cell_type, n, (1.0, 0.7, 0.5), to=shaken(0.04), straight=straight)


test_mesh.__test__ = False


@pytest.mark.parametrize("cell_type", CELLS)
def test_stiffness_mass_and_stress_stiffness_are_scikit_fems(cell_type):
    mesh = test_mesh(cell_type)
    d = discretise(mesh)
    basis, dofs = oracle(mesh, cell_type)
    assert (
        far(
            d.pattern.full(stiffness(d, STEEL_C)),
            ours(elastic_form.assemble(basis, lam=LAME, mu=SHEAR), dofs),
        )
        < 1e-12
    )
    assert far(full3(d, mass(d, RHO)), ours(mass_form.assemble(basis, rho=RHO), dofs)) < 1e-12
    S = [the_stress(x) for x in at_quadrature(d)]
    assert far(full3(d, stress_stiffness(d, S)), ours(stress_form.assemble(basis), dofs)) < 1e-12


def test_many_cells_pass_through_several_batches(monkeypatch):
    """More cells than one batch holds: 720 tetrahedra in batches of 125."""
    monkeypatch.setattr("microslip.fem.operators._BATCH", 12_500)
    mesh = test_mesh("tetra10", (6, 5, 4))
    d = discretise(mesh)
    basis, dofs = oracle(mesh, "tetra10")
    K = d.pattern.full(stiffness(d, STEEL_C))
    assert far(K, ours(elastic_form.assemble(basis, lam=LAME, mu=SHEAR), dofs)) < 1e-12
    zero = [np.zeros((*b.dx.shape, 6)) for b in d.blocks]
    A = [tangent_tensor(STEEL_C, None, None, s) for s in zero]
    assert far(d.pattern.full(tangent(d, A)), K) < 1e-12
    S = [the_stress(x) for x in at_quadrature(d)]
    assert far(full3(d, stress_stiffness(d, S)), ours(stress_form.assemble(basis), dofs)) < 1e-12


def test_orthotropic_stiffness_with_a_modulus_that_varies_is_scikit_fems():
    mesh = test_mesh("tetra10")
    d = discretise(mesh)
    basis, dofs = oracle(mesh, "tetra10")
    C = to_tensor(WOOD_C)

    @skfem.BilinearForm
    def form(u, v, w):
        return (1 + 0.5 * w.x[0]) * ddot(np.einsum("ijkl,kl...->ij...", C, sym_grad(u)), sym_grad(v))

    K = stiffness(d, WOOD_C, [1 + 0.5 * x[..., 0] for x in at_quadrature(d)])
    assert far(d.pattern.full(K), ours(form.assemble(basis), dofs)) < 1e-12


def test_tangent_about_a_deformed_state_is_scikit_fems():
    """D P[H] = dH S + F C : sym(F^T dH), written out by hand in scikit-fem."""
    mesh = test_mesh("tetra10")
    d = discretise(mesh)
    basis, dofs = oracle(mesh, "tetra10")
    u = np.random.default_rng(2).normal(size=(mesh.n_points, 3)) * 0.01

    @skfem.BilinearForm
    def form(du, v, w):
        F = eye(1 + 0 * w.x[0], 3) + grad(w["u"])
        Ft = np.einsum("ij...->ji...", F)
        mul = lambda a, b: np.einsum("ij...,jk...->ik...", a, b)  # noqa: E731
        green = 0.5 * (mul(Ft, F) - eye(1 + 0 * w.x[0], 3))
        hooke = lambda e: LAME * eye(trace(e), 3) + 2 * SHEAR * e  # noqa: E731
        change = mul(Ft, grad(du))
        P = mul(grad(du), hooke(green)) + mul(F, hooke(0.5 * (change + np.einsum("ij...->ji...", change))))
        return ddot(P, grad(v))

    theirs = np.zeros(basis.N)
    theirs[:] = u.reshape(-1)[dofs]
    A = ours(form.assemble(basis, u=basis.interpolate(theirs)), dofs)
    H = [displacement_gradient(b, u) for b in d.blocks]
    S = [green_strain(h) @ STEEL_C.T for h in H]
    K = d.pattern.full(tangent(d, [tangent_tensor(STEEL_C, None, h, s) for h, s in zip(H, S, strict=True)]))
    assert far(K, A) < 1e-12


def test_two_blocks_are_the_two_bodies():
    """A mesh with bricks and tetrahedra (not joined): the operator is block diagonal."""
    a = brick("tetra10", (1, 1, 2))
    b = brick("hexahedron27", (2, 1, 1), origin=(3.0, 0, 0))
    both = Mesh(
        np.vstack([a.points, b.points]),
        {"tetra10": a.cells["tetra10"], "hexahedron27": b.cells["hexahedron27"] + a.n_points},
    )
    apart = sp.block_diag([(d := discretise(m)).pattern.full(stiffness(d, WOOD_C)) for m in (a, b)])
    d = discretise(both)
    assert far(d.pattern.full(stiffness(d, WOOD_C)), apart) < 1e-14
    assert mass(d, RHO).sum() > 0 and d.volume == pytest.approx(2, rel=1e-13)
    half = discretise(both).pattern
    upper = free_upper(half, np.array([0, 5, 7]))
    whole = d.pattern.full(stiffness(d, WOOD_C)).toarray()
    keep = np.setdiff1d(np.arange(len(whole)), [0, 5, 7])
    np.testing.assert_allclose(
        upper.matrix(stiffness(d, WOOD_C)).toarray(), np.triu(whole[np.ix_(keep, keep)]), atol=1e-5
    )


# ---------------------------------------------------------------- what the operators mean


@pytest.mark.parametrize("cell_type", CELLS)
@pytest.mark.parametrize("C", [STEEL_C, WOOD_C], ids=["steel", "orthotropic"])
def test_stiffness_kills_rigid_motions_and_nothing_else(cell_type, C):
    mesh = brick(cell_type, (2, 1, 1), (1.0, 0.7, 0.5), to=shaken(0.04))
    d = discretise(mesh)
    K = d.pattern.full(stiffness(d, C)).toarray()
    R = rigid_fields(mesh.points, mesh.points.mean(axis=0)).reshape(-1, 6)
    assert np.abs(K @ R).max() < 1e-13 * np.abs(K).max() * len(K)
    values = np.linalg.eigvalsh(K)
    assert (np.abs(values) < 1e-12 * values[-1]).sum() == 6 or cell_type == "tetra10"
    # the four-point rule of the ten-node tetrahedron has full rank too
    if cell_type == "tetra10":
        assert (values < 1e-10 * values[-1]).sum() == 6


@pytest.mark.parametrize("cell_type", CELLS)
def test_stiffness_gives_the_energy_of_a_uniform_strain(cell_type):
    """u = E x on any mesh: u K u = V e.C.e."""
    mesh = brick(cell_type, (2, 2, 1), (1.0, 0.7, 0.5), to=shaken(0.04), straight=True)
    d = discretise(mesh)
    G = np.random.default_rng(4).normal(size=(3, 3))
    e = engineering(0.5 * (G + G.T))
    u = (mesh.points @ G.T).reshape(-1)
    energy = u @ (d.pattern.full(stiffness(d, WOOD_C)) @ u)
    assert energy == pytest.approx(d.volume * e @ WOOD_C @ e, rel=1e-12)


def test_tangent_at_rest_is_the_stiffness():
    mesh = test_mesh("hexahedron20")
    d = discretise(mesh)
    zero = [np.zeros((*b.dx.shape, 6)) for b in d.blocks]
    H = [np.zeros((*b.dx.shape, 3, 3)) for b in d.blocks]
    A = [tangent_tensor(WOOD_C, None, h, s) for h, s in zip(H, zero, strict=True)]
    K = stiffness(d, WOOD_C)
    assert np.abs(tangent(d, A) - K).max() < 1e-13 * np.abs(K).max()


def test_tangent_under_stress_alone_is_the_geometric_stiffness():
    mesh = test_mesh("tetra10")
    d = discretise(mesh)
    S = [the_stress(x) for x in at_quadrature(d)]
    A = [tangent_tensor(0 * STEEL_C, None, None, s) for s in S]
    whole = stress_stiffness(d, S)[:, None, None] * np.eye(3)
    assert np.abs(tangent(d, A) - whole).max() < 1e-13 * np.abs(whole).max()


def force_of(d, u, C, factor=None):
    H = [displacement_gradient(b, u) for b in d.blocks]
    S = [green_strain(h) @ C.T * (1 if factor is None else factor[i][..., None]) for i, h in enumerate(H)]
    return internal_force(d, S, H), H, S


@pytest.mark.parametrize("cell_type", QUADRATIC)
def test_tangent_is_the_derivative_of_the_internal_force(cell_type):
    """Central differences along random directions at a finite random displacement, orthotropic, modulus varying.

    The force is a cubic polynomial of u, so differences err by h^2 only through its cubic term, and by eps/h.
    """
    mesh = test_mesh(cell_type, (1, 2, 1))
    d = discretise(mesh)
    rng = np.random.default_rng(11)
    u, v = rng.normal(size=(2, mesh.n_points, 3)) * 0.05
    factor = [1 + 0.5 * x[..., 0] for x in at_quadrature(d)]
    _, H, S = force_of(d, u, WOOD_C, factor)
    A = [tangent_tensor(WOOD_C, f, h, s) for f, h, s in zip(factor, H, S, strict=True)]
    Kv = d.pattern.full(tangent(d, A)) @ v.reshape(-1)
    h = 1e-4
    plus, minus = (force_of(d, u + s * v, WOOD_C, factor)[0] for s in (h, -h))
    difference = ((plus - minus) / (2 * h)).reshape(-1)
    assert np.abs(Kv - difference).max() < 1e-8 * np.abs(Kv).max()  # h^2 |v|^2 grad^2 ~ 1e-8 times the cubic term


def test_internal_force_is_the_derivative_of_the_strain_energy():
    mesh = test_mesh("tetra10", (1, 1, 1))
    d = discretise(mesh)
    rng = np.random.default_rng(12)
    u, v = rng.normal(size=(2, mesh.n_points, 3)) * 0.05

    def energy(w):
        e = [green_strain(displacement_gradient(b, w)) for b in d.blocks]
        return sum(0.5 * np.einsum("eq,eqi,ij,eqj->", b.dx, x, WOOD_C, x) for b, x in zip(d.blocks, e, strict=True))

    h = 1e-4
    slope = (energy(u + h * v) - energy(u - h * v)) / (2 * h)
    assert (force_of(d, u, WOOD_C)[0] * v).sum() == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize("cell_type", CELLS)
def test_finite_rigid_rotation_makes_no_force(cell_type):
    mesh = test_mesh(cell_type)
    d = discretise(mesh)
    u = mesh.points @ rotation_matrix((0.5, 1.5, -0.8)).T + [3.0, 2.0, 1.0] - mesh.points
    f, _, _ = force_of(d, u, WOOD_C)
    scale = np.abs(force_of(d, mesh.points * 0.1, WOOD_C)[0]).max()
    assert np.abs(f).max() < 1e-12 * scale


def test_internal_forces_follow_a_rigid_rotation():
    """f(R (x + u) - x) = R f(u): the material does not see the rotation (objectivity)."""
    mesh = test_mesh("tetra10")
    d = discretise(mesh)
    R = rotation_matrix((0.5, 1.5, -0.8))
    u = np.random.default_rng(9).normal(size=(mesh.n_points, 3)) * 0.01
    turned = (mesh.points + u) @ R.T - mesh.points
    f, g = force_of(d, u, WOOD_C)[0], force_of(d, turned, WOOD_C)[0]
    np.testing.assert_allclose(g, f @ R.T, atol=1e-12 * np.abs(f).max())


# ---------------------------------------------------------------- material


def test_isotropic_is_the_orthotropic_case_in_any_axes():
    same = orthotropic(np.full(3, E), np.full(3, NU), np.full(3, SHEAR), AXES)
    np.testing.assert_allclose(same, STEEL_C, atol=1e-12 * E)


def test_orthotropic_constants_are_what_a_tension_test_measures():
    """S = C^-1 in material axes: nu_ij is the strain in j under stress along i."""
    (e1, e2, e3), (n12, n23, n13), (g12, g23, g13) = WOOD
    S = np.linalg.inv(orthotropic(*WOOD))
    np.testing.assert_allclose(np.diag(S), [1 / e1, 1 / e2, 1 / e3, 1 / g12, 1 / g23, 1 / g13], rtol=1e-12)
    np.testing.assert_allclose([-S[1, 0] * e1, -S[2, 1] * e2, -S[2, 0] * e1], [n12, n23, n13], rtol=1e-12)
    # along the first material axis in body axes the modulus is E1
    n = AXES[0]
    voigt = from_tensor_stress(np.outer(n, n))
    strain = np.linalg.solve(WOOD_C, voigt)
    assert n @ strain_tensor(strain) @ n == pytest.approx(1 / e1, rel=1e-12)
    assert AXES[1] @ strain_tensor(strain) @ AXES[1] == pytest.approx(-n12 / e1, rel=1e-12)


def from_tensor_stress(s):
    return np.array([s[0, 0], s[1, 1], s[2, 2], s[0, 1], s[1, 2], s[0, 2]])


def strain_tensor(e):
    return to_symmetric(e * np.array([1, 1, 1, 0.5, 0.5, 0.5]))


def test_turning_the_axes_is_turning_the_body():
    """K(turned body, turned axes) = Q K Q^T."""
    mesh = test_mesh("tetra10")
    R = rotation_matrix((-0.3, 0.8, 0.5))
    turned = Mesh(mesh.points @ R.T, mesh.cells)
    d, t = discretise(mesh), discretise(turned)
    K = stiffness(d, orthotropic(*WOOD, AXES))
    Kt = stiffness(t, orthotropic(*WOOD, AXES @ R.T))
    assert np.abs(Kt - np.einsum("ij,pjk,lk->pil", R, K, R)).max() < 1e-12 * np.abs(K).max()
    np.testing.assert_allclose(from_tensor(to_tensor(WOOD_C)), WOOD_C, rtol=1e-15)


def test_constants_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="positive definite"):
        orthotropic(np.array([10e9, 1e9, 1e9]), np.array([0.3, 1.2, 0.3]), np.full(3, 1e9))


def test_modulus_over_temperature_is_interpolated():
    table = {"temperature": [300.0, 500.0, 900.0], "modulus_factor": [1.0, 0.9, 0.5]}
    material = body({**STEEL, **table}).material.material()
    np.testing.assert_allclose(material.modulus_factor(np.array([200, 400, 700, 1000.0])), [1, 0.95, 0.7, 0.5])


def test_thermal_strain_of_an_orthotropic_material_is_turned():
    """A bar along material axis i lengthens by alpha_i."""
    young, poisson, shear = ([float(x) for x in v] for v in WOOD)
    axes = AXES.tolist()
    settings = body(
        {
            "density": 500.0,
            "young": young,
            "poisson": poisson,
            "shear": shear,
            "axes": axes,
            "expansion": [1e-6, 2e-5, 3e-5],
        }
    )
    strain = strain_tensor(settings.material.material().expansion)
    np.testing.assert_allclose(np.einsum("ai,ij,aj->a", AXES, strain, AXES), [1e-6, 2e-5, 3e-5], rtol=1e-12)


# ---------------------------------------------------------------- loads, mass, inertia


@pytest.mark.parametrize("cell_type", CELLS)
def test_loads_have_the_resultants_of_statics(cell_type):
    mesh = brick(cell_type, (2, 2, 2), (0.4, 0.3, 0.2), (0.1, -0.2, 0.5))
    d = discretise(mesh)
    M = d.pattern.full(mass(d, RHO))
    m, centre = RHO * 0.024, np.array([0.3, -0.05, 0.6])

    def resultant(f, about=(0.0, 0.0, 0.0)):
        return np.concatenate([f.sum(axis=0), np.cross(mesh.points - about, f).sum(axis=0)])

    g = np.array([1.0, -2.0, 9.81])
    np.testing.assert_allclose(
        resultant(body_force(M, g)), np.concatenate([m * g, np.cross(centre, m * g)]), rtol=1e-12, atol=1e-9
    )
    # a pressure on x1 pushes along -x at the middle of the face
    f = pressure(face_blocks(mesh, "x1"), mesh.n_points, 2e5)
    push = np.array([-2e5 * 0.3 * 0.2, 0, 0])
    np.testing.assert_allclose(resultant(f), np.concatenate([push, np.cross([0.5, -0.05, 0.6], push)]), atol=1e-8)
    f = traction(face_blocks(mesh, "y0"), mesh.n_points, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(f.sum(axis=0), np.array([1.0, 2.0, 3.0]) * 0.4 * 0.2, rtol=1e-12)
    # centrifugal force: m times the arm of the mass centre from the axis
    axis, point = np.array([0.0, 0.6, 0.8]), np.array([0.2, 0.1, 0.0])
    arm = (centre - point) - axis * ((centre - point) @ axis)
    np.testing.assert_allclose(centrifugal(M, mesh.points, axis, point).sum(axis=0), m * arm, rtol=1e-12)
    # omega x (omega x r) = -Omega^2 P r
    r = np.array([0.3, -0.8, 0.2])
    np.testing.assert_allclose(np.cross(axis, np.cross(axis, r)), -spin_projector(axis) @ r, atol=1e-15)


def test_pressure_on_a_closed_body_has_no_resultant():
    """Also on curved facets: the discrete normals close."""
    mesh = brick("tetra10", (2, 2, 2), to=shaken(0.08))
    f = sum(pressure(face_blocks(mesh, name), mesh.n_points, 1e5) for name in mesh.faces)
    assert np.abs(f.sum(axis=0)).max() < 1e-9
    assert np.abs(np.cross(mesh.points, f).sum(axis=0)).max() < 1e-2 * 1e5 * 1e-4  # facet rule on bent facets


def test_thermal_forces_hold_a_heated_box():
    """Between rigid rollers, heating makes the hydrostatic stress -3 K alpha dT and the force p A on each wall."""
    mesh = brick("hexahedron20", (1, 1, 1), (0.2, 0.3, 0.5))
    d = discretise(mesh)
    bulk, alpha = E / (3 * (1 - 2 * NU)), 1.2e-5
    strain = np.array([1, 1, 1, 0, 0, 0]) * alpha * 50
    f = internal_force(d, [np.broadcast_to(strain @ STEEL_C, (*d.blocks[0].dx.shape, 6))], None)
    wall = f[mesh.face_points("x1")].sum(axis=0)
    np.testing.assert_allclose(wall, [3 * bulk * alpha * 50 * 0.15, 0, 0], atol=1e-5)


@pytest.mark.parametrize("cell_type", QUADRATIC)
def test_mass_centre_and_inertia_of_a_box(cell_type):
    a, b, c = 0.4, 0.3, 0.2
    mesh = brick(cell_type, (1, 2, 1), (a, b, c), (0.1, -0.2, 0.5))
    m, centre, inertia = inertia_of(discretise(mesh), RHO)
    assert m == pytest.approx(RHO * a * b * c, rel=1e-13)
    np.testing.assert_allclose(centre, [0.3, -0.05, 0.6], rtol=1e-12)
    np.testing.assert_allclose(inertia, m / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b]), atol=1e-12 * m)


@pytest.mark.parametrize("cell_type", QUADRATIC)
def test_mass_centre_and_inertia_of_half_a_pipe(cell_type):
    """Half a pipe: centre 2 (R^3 - r^3) / (3 area) from the axis; polar moment m (R^2 + r^2) / 2."""
    r, R, h = 0.06, 0.1, 0.3
    mesh = pipe(cell_type, (2, 16, 2), r, R, h, np.pi)
    m, centre, inertia = inertia_of(discretise(mesh), RHO)
    area = np.pi * (R**2 - r**2) / 2
    offset = 2 * (R**3 - r**3) / (3 * area)
    # a parabola through an arc of pi/16 misses (pi/16)^4 / 480 = 3.1e-6 of the area
    assert m == pytest.approx(RHO * area * h, rel=4e-6)
    np.testing.assert_allclose(centre, [0, offset, h / 2], rtol=2e-5, atol=1e-7)
    about_axis = inertia[2, 2] + m * offset**2
    assert about_axis == pytest.approx(m * (R**2 + r**2) / 2, rel=2e-5)
    # on bent tetrahedra r^2 times the Jacobian is of degree 4 and more, the rule of degree 2
    tolerance = 1e-4 if cell_type == "tetra10" else 2e-5
    across = m * ((R**2 + r**2) / 4 + h**2 / 12)
    np.testing.assert_allclose([inertia[0, 0], inertia[1, 1]], [across - m * offset**2, across], rtol=tolerance)
    np.testing.assert_allclose(inertia - np.diag(np.diag(inertia)), 0, atol=tolerance * inertia[2, 2])


def test_total_mass_and_inertia_are_those_of_the_mass_matrix():
    """Rigid motions through M give mass, static moment and inertia (Sextro Eqs. (2.3-32) to (2.3-34))."""
    mesh = brick("hexahedron27", (2, 2, 1), (0.4, 0.3, 0.2), to=shaken(0.02))
    d = discretise(mesh)
    m, centre, inertia = inertia_of(d, RHO)
    R = rigid_fields(mesh.points, centre).reshape(-1, 6)
    expected = np.zeros((6, 6))
    expected[:3, :3], expected[3:, 3:] = m * np.eye(3), inertia
    np.testing.assert_allclose(R.T @ full3(d, mass(d, RHO)) @ R, expected, atol=1e-9 * m)


# ---------------------------------------------------------------- orders of convergence, fitted


def slope(sizes, errors):
    """Exponent of the error over the element size, by least squares."""
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


BOX = (1.0, 0.8, 0.6)


def rollers(mesh):
    return np.concatenate([3 * mesh.face_points(f"{c}{e}") + i for i, c in enumerate("xyz") for e in (0, 1)])


def lowest(mesh, count, degree=None, stress=None, mapped=1.0):
    """Eigenvalues of the brick on rollers, (rad/s)^2, by the operators alone."""
    d = discretise(mesh, degree)
    free = np.setdiff1d(np.arange(3 * mesh.n_points), rollers(mesh))
    K = stiffness(d, STEEL_C)
    if stress is not None:
        K = K + stress_stiffness(d, [np.broadcast_to(stress, (*b.dx.shape, 6)) for b in d.blocks])[
            :, None, None
        ] * np.eye(3)
    K = d.pattern.full(K)[free][:, free].tocsc()
    M = full3(d, mass(d, RHO))[free][:, free].tocsc()
    return np.sort(spla.eigsh(K, count, M, sigma=0, return_eigenvectors=False, tol=1e-12))


def inner(amount):
    """A map that moves the inside of the box only, so that its faces stay plane."""

    def to(p):
        s = [np.sin(np.pi * p[:, i] / BOX[i]) for i in range(3)]
        return p + amount * np.column_stack(
            [s[0] * np.cos(3 * p[:, 1]), s[1] * np.sin(2 + 2 * p[:, 2]), s[2] * np.cos(4 * p[:, 0])]
        )

    return to


STEPS = {
    "tetra10": (4, 6, 8),
    "hexahedron20": (3, 4, 6),
    "hexahedron27": (3, 4, 6),
    "tetra": (6, 8, 12),
    "hexahedron": (4, 6, 8),
}
ORDERS = {t: 4 if t in QUADRATIC else 2 for t in CELLS}


def boxes(cell_type, amount=0.03):
    """The box in three finenesses; its inside is bent, its faces stay plane."""
    return [brick(cell_type, (n, n, n), BOX, to=inner(amount)) for n in STEPS[cell_type]]


def sizes(cell_type):
    return [1 / n for n in STEPS[cell_type]]


def flat_slow(cells):
    """Meshes of tetrahedra have five times as many cells."""
    return [pytest.param(c, marks=pytest.mark.slow) if c == "tetra10" else c for c in cells]


@pytest.mark.parametrize("cell_type", flat_slow(CELLS))
def test_order_of_frequencies(cell_type):
    """Eigenvalues of the brick on rollers (smooth shapes, bent cells) converge with order 4, linear cells with 2.

    Tetrahedra come from below: 3.7, 3.8, 3.9 on ever finer meshes.
    """
    exact = box_frequencies(RHO, LAME, SHEAR, BOX, 3) ** 2
    errors = np.array([lowest(mesh, 3) / exact - 1 for mesh in boxes(cell_type)])
    assert (errors > 0).all()  # Rayleigh's principle; the quadrature does not spoil it
    assert slope(sizes(cell_type), errors.mean(axis=1)) == pytest.approx(ORDERS[cell_type], abs=0.3)


@pytest.mark.slow
def test_order_of_the_mass_quadrature():
    """What four points instead of a full rule change in the mass of straight ten-node tetrahedra is of order 4 too."""
    steps = (3, 4, 6)
    meshes = [brick("tetra10", (n, n, n), BOX) for n in steps]
    change = [abs(lowest(m, 1) / lowest(m, 1, {"tetra10": 4}) - 1)[0] for m in meshes]
    assert slope([1 / n for n in steps], change) == pytest.approx(4, abs=0.45)  # 3.6 here, 3.8 between 6 and 8


@pytest.mark.parametrize("cell_type", flat_slow(QUADRATIC))
def test_order_of_the_geometric_stiffness(cell_type):
    """Uniform initial stress along the edges adds (S_i k_i^2) / rho to each eigenvalue, here as much as the shear."""
    S = np.array([1.5, 0.4, 0.8]) * SHEAR
    exact = box_frequencies(RHO, LAME, SHEAR, BOX, 3, tuple(S)) ** 2
    stress = np.concatenate([S, np.zeros(3)])
    errors = [(np.abs(lowest(mesh, 3, stress=stress) / exact - 1)).mean() for mesh in boxes(cell_type)]
    assert slope(sizes(cell_type), errors) == pytest.approx(4, abs=0.3)


def wave(points):
    """A displacement that rollers allow, (.., 3), and its gradient (.., 3, 3): u_i,j."""
    k = np.pi / np.array(BOX)
    s, c = np.sin(points * k), np.cos(points * k)
    a = np.array([0.7, -1.1, 0.4])
    u = a * np.stack([s[..., i] * np.prod(np.delete(c, i, axis=-1), axis=-1) for i in range(3)], axis=-1)
    g = np.empty((*points.shape, 3))
    for i in range(3):
        for j in range(3):
            f = [s[..., m] if m == i else c[..., m] for m in range(3)]
            f[j] = k[j] * (c[..., j] if i == j else -s[..., j])
            g[..., i, j] = a[i] * f[0] * f[1] * f[2]
    return u, g


def source(points):
    """Body force (N/m3) of `wave`: -div sigma = mu |k|^2 u + (lambda + mu) k (k . a) cos cos cos parts."""
    k = np.pi / np.array(BOX)
    u, g = wave(points)
    s, c = np.sin(points * k), np.cos(points * k)
    a = np.array([0.7, -1.1, 0.4])
    gradient = np.stack([-k[i] * s[..., i] * np.prod(np.delete(c, i, axis=-1), axis=-1) for i in range(3)], axis=-1)
    return SHEAR * (k @ k) * u - (LAME + SHEAR) * (a @ k) * gradient


@pytest.mark.parametrize("cell_type", QUADRATIC)
def test_order_of_displacements_and_stresses(cell_type):
    """A manufactured solution: displacement of order 3, stress at the integration points of order 2."""
    errors = []
    for mesh in boxes(cell_type):
        d = discretise(mesh)
        (b,), (x,) = d.blocks, at_quadrature(d)
        f = np.zeros((mesh.n_points, 3))
        np.add.at(f, b.cells, np.einsum("eq,qk,eqi->eki", b.dx, b.N, source(x)))
        free = np.setdiff1d(np.arange(3 * mesh.n_points), rollers(mesh))
        u = np.zeros(3 * mesh.n_points)
        K = d.pattern.full(stiffness(d, STEEL_C))[free][:, free].tocsc()
        u[free] = spla.splu(K, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(f.reshape(-1)[free])
        u = u.reshape(-1, 3)
        exact, gradient = wave(x)
        there = np.einsum("qk,eki->eqi", b.N, u[b.cells])
        stress = green_strain(displacement_gradient(b, u), nonlinear=False) @ STEEL_C.T
        wrong = stress - green_strain(gradient, nonlinear=False) @ STEEL_C.T
        errors.append([np.sqrt(np.einsum("eq,eqi->", b.dx, e**2)) for e in (there - exact, wrong)])
    displacement, stress = np.array(errors).T
    assert slope(sizes(cell_type), displacement) == pytest.approx(3, abs=0.3)
    # tetrahedra from below: 1.72 between 4 and 6, 1.81 between 6 and 8
    assert slope(sizes(cell_type), stress) == pytest.approx(2, abs=0.3)


def test_order_on_the_rotating_string():
    """Shear waves in a bar stiffened by rotation: (G + sigma(x)) w'' ..., sigma = rho Omega^2 (L^2 - x^2) / 2.

    Displacements along y only, so the solid is the string -((G + sigma) w')' = rho omega^2 w, w(0) = 0; the string
    is solved with Legendre polynomials.
    """
    length, speed = 1.0, 6000.0

    def tension(x):
        return 0.5 * RHO * speed**2 * (length**2 - x**2)

    x, weight = leggauss(40)
    x, weight = 0.5 * (x + 1), 0.5 * weight
    basis = [Legendre.basis(j, domain=[0, 1]) for j in range(14)]
    P = np.column_stack([x * b(x) for b in basis])
    dP = np.column_stack([b(x) + x * b.deriv()(x) for b in basis])
    K = (dP * (weight * (SHEAR + tension(x)))[:, None]).T @ dP
    exact = scipy.linalg.eigh(K, RHO * (P * weight[:, None]).T @ P, eigvals_only=True)[:2]
    assert tension(0) > SHEAR  # the geometric part is not a correction
    errors, steps = [], (2, 4, 8)
    for n in steps:
        mesh = brick("hexahedron20", (n, 1, 1), (length, 0.2, 0.2))
        d = discretise(mesh)
        sigma = [tension(p[..., 0])[..., None] * np.eye(6)[0] for p in at_quadrature(d)]
        free = np.setdiff1d(3 * np.arange(mesh.n_points) + 1, 3 * mesh.face_points("x0") + 1)
        K = d.pattern.full(stiffness(d, STEEL_C) + stress_stiffness(d, sigma)[:, None, None] * np.eye(3))
        M = full3(d, mass(d, RHO))
        # the cross-section stays plane here: motion depends on x only
        values = scipy.linalg.eigh(
            *(A[free][:, free].toarray() for A in (K, M)), eigvals_only=True, subset_by_index=(0, 1)
        )
        errors.append(np.abs(values / exact - 1).max())
    assert slope([1 / n for n in steps], errors) == pytest.approx(4, abs=0.3), errors

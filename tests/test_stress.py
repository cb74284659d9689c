"""Strain and stress modes, their smoothing to the nodes, patch tests, and a thick pipe under pressure."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from meshes import CELLS, QUADRATIC, STEEL, body, brick, pipe, shaken

from microslip.data import Mesh
from microslip.elasticity import isotropic, orthotropic
from microslip.fem.discretise import discretise, face_blocks, free_upper
from microslip.fem.loads import traction
from microslip.fem.operators import displacement_gradient, engineering, green_strain, mass, stiffness, to_symmetric
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import StaticState, make_model
from microslip.modal.stress import gauss_set, nodal_set, smoother, von_mises

E, NU, RHO = STEEL["young"], STEEL["poisson"], STEEL["density"]
STEEL_C = isotropic(E, NU)
WOOD_C = orthotropic(np.array([120e9, 9e9, 14e9]), np.array([0.28, 0.35, 0.31]), np.array([5e9, 3.4e9, 6e9]))
CLAMPED = {"supports": [{"face": "x0"}]}
BLOCK = brick("tetra10", (3, 2, 2), (0.1, 0.07, 0.06), to=shaken(0.004))


def the_group(mesh, count=6, temperature=None, **what):
    return modal_basis(mesh, body(**{"modes": {"count": count}, "output": {}, **what}), temperature).groups[0, 0]


def boundary_nodes(mesh):
    return np.unique(np.concatenate([mesh.face_points(name) for name in mesh.faces]))


# ---------------------------------------------------------------- patch tests


@pytest.mark.parametrize("cell_type", CELLS)
@pytest.mark.parametrize("bent", [False, True], ids=["straight", "bent"])
def test_patch(cell_type, bent):
    """A linear displacement on the boundary goes on inside, with uniform stress, whatever the shape of the cells.

    The four-point rule does not integrate the gradients of bent tetrahedra exactly (degree 3): there the patch
    test is only passed to the order of the bend.
    """
    if bent and cell_type in ("tetra", "hexahedron"):
        pytest.skip("has no sides to bend")
    mesh = brick(cell_type, (3, 3, 3), (1.0, 0.8, 0.6), to=shaken(0.05), straight=not bent)
    d = discretise(mesh)
    G = np.array([[1.0, -0.4, 0.3], [0.2, 0.7, -0.5], [-0.6, 0.1, 0.9]]) * 1e-3
    K = d.pattern.full(stiffness(d, WOOD_C))
    exact = mesh.points @ G.T
    held = (3 * boundary_nodes(mesh)[:, None] + np.arange(3)).ravel()
    free = np.setdiff1d(np.arange(3 * mesh.n_points), held)
    u = exact.reshape(-1).copy()
    u[free] = spla.spsolve(K[free][:, free].tocsc(), -K[free][:, held] @ u[held])
    limit = 1e-5 if bent and cell_type == "tetra10" else 1e-11
    assert np.abs(u - exact.reshape(-1)).max() < limit * np.abs(exact).max()
    strain = engineering(0.5 * (G + G.T))
    for b in d.blocks:
        found = green_strain(displacement_gradient(b, u.reshape(-1, 3)), nonlinear=False)
        assert np.abs(found - strain).max() < 20 * limit * 1e-3


# ---------------------------------------------------------------- smoothing


@pytest.mark.parametrize("cell_type", CELLS)
def test_smoothing_reproduces_linear_fields(cell_type):
    """Values of a linear function at the integration points come back at the nodes of straight cells."""
    if cell_type == "tetra":
        field = lambda x: np.stack([3.0 + 0 * x[..., 0], 1.0 + 0 * x[..., 0]], axis=-1)  # noqa: E731 - one rule: constants
    else:
        field = lambda x: np.stack([3 + x @ [1.0, -2.0, 0.5], x @ [0.0, 0.3, 4.0]], axis=-1)  # noqa: E731
    mesh = brick(cell_type, (3, 2, 2), (1.0, 0.8, 0.6), to=shaken(0.05), straight=True)
    (b,) = discretise(mesh).blocks
    x = np.einsum("qk,eki->eqi", b.N, mesh.points[b.cells])
    S, weights = smoother(b, mesh.n_points)
    np.testing.assert_allclose(S @ field(x).reshape(-1, 2) / weights[:, None], field(mesh.points), atol=1e-11)


def test_nodal_stress_of_a_quadratic_displacement_is_exact():
    """Bending-like fields: strain linear in x, on straight tetrahedra, through the whole modal chain."""
    mesh = brick("tetra10", (3, 2, 2), (1.0, 0.8, 0.6), to=shaken(0.05), straight=True)
    group = the_group(mesh, 3, **CLAMPED)
    x, y, z = mesh.points.T
    u = np.column_stack([x * y, -0.5 * x * x - 0.1 * y * z, 0.3 * x * z + z * z])
    strain = engineering(
        np.stack(
            [
                np.column_stack([y, 0 * x, 0.15 * z]),
                np.column_stack([0 * x, -0.1 * z, -0.05 * y]),
                np.column_stack([0.15 * z, -0.05 * y, 0.3 * x + 2 * z]),
            ],
            axis=1,
        )
    )
    d = discretise(mesh)
    material = body(**CLAMPED).material.material()
    nothing = np.zeros(0, dtype=np.int64)
    zero = np.zeros((mesh.n_points, 3))
    model = make_model(
        d, material, free_upper(d.pattern, nothing), nothing, np.eye(3)[1], zero[0], None, 293.0, zero, True
    )
    state = StaticState(zero, None, [np.zeros((*b.dx.shape, 6)) for b in d.blocks], model.K0, "none")
    nodes = nodal_set(model, state, np.repeat(u[:, :, None], 11, axis=2))  # more than one batch
    np.testing.assert_allclose(nodes.strain, np.repeat(strain[:, :, None], 11, axis=2), atol=1e-11)
    np.testing.assert_allclose(nodes.stress[:, :, 10], strain @ STEEL_C.T, atol=1e-11 * E)
    gauss = gauss_set(model, state, u[:, :, None])
    assert gauss.weights.sum() == pytest.approx(d.volume) and nodes.weights.sum() == pytest.approx(d.volume)
    assert group.stresses["nodes"].location == "nodal-averaged"


# ---------------------------------------------------------------- modes against static solutions


def test_stress_of_a_static_solution_in_modes():
    """Load M phi c: u = phi c / omega^2, and T_sigma q is the stress of the direct solution, at points and nodes."""
    group = the_group(BLOCK, 8, **CLAMPED)
    d = discretise(BLOCK)
    c = np.random.default_rng(0).normal(size=group.n_modes) * group.omega**2
    M = d.pattern.full(mass(d, RHO))
    load = M @ np.einsum("nim,m->ni", group.phi, c)
    free = np.setdiff1d(np.arange(3 * BLOCK.n_points), (3 * BLOCK.face_points("x0")[:, None] + np.arange(3)).ravel())
    K = d.pattern.full(stiffness(d, STEEL_C))
    u = np.zeros(3 * BLOCK.n_points)
    u[free] = spla.spsolve(K[free][:, free].tocsc(), load.reshape(-1)[free])
    (b,) = d.blocks
    direct = (green_strain(displacement_gradient(b, u.reshape(-1, 3)), nonlinear=False) @ STEEL_C.T).reshape(-1, 6)
    q = c / group.omega**2
    scale = np.abs(direct).max()
    np.testing.assert_allclose(group.stresses["gauss"].stress @ q, direct, atol=1e-8 * scale)
    strain = group.stresses["gauss"].strain @ q
    np.testing.assert_allclose(strain @ STEEL_C.T, direct, atol=1e-8 * scale)
    S, w = smoother(b, BLOCK.n_points)
    np.testing.assert_allclose(group.stresses["nodes"].stress @ q, S @ direct / w[:, None], atol=1e-8 * scale)
    x = np.einsum("qk,eki->eqi", b.N, BLOCK.points[b.cells]).reshape(-1, 3)
    np.testing.assert_allclose(group.stresses["gauss"].points, x, atol=1e-15)
    assert group.stresses["gauss"].weights.sum() == pytest.approx(d.volume, rel=1e-13)


def test_all_modes_together_hold_any_static_stress():
    """A tip force on a small body: the stress of the modal sum converges to the direct one, whole for all modes."""
    mesh = brick("hexahedron20", (2, 1, 1), (0.1, 0.04, 0.05))
    n = 3 * (mesh.n_points - len(mesh.face_points("x0")))
    group = the_group(mesh, n - 2, **CLAMPED)
    static = the_group(
        mesh, 1, **CLAMPED, loads=[{"kind": "force", "face": "x1", "vector": [30.0, 500.0, -200.0]}],
        rotation={"prestress": "linear"},
    )  # fmt: skip
    tip = mesh.face_points("x1")
    load = traction(face_blocks(mesh, "x1"), mesh.n_points, np.array([30.0, 500.0, -200.0]) / (0.04 * 0.05))
    assert np.abs(np.delete(load, tip, axis=0)).max() == 0
    q = np.einsum("nim,ni->m", group.phi, load) / group.omega**2
    exact = static.stresses["gauss"].static_stress
    errors = [
        np.abs(group.stresses["gauss"].stress[..., :k] @ q[:k] - exact).max() / np.abs(exact).max()
        for k in (6, 30, len(q))
    ]
    assert errors[0] > errors[1] > errors[2] and errors[2] < 0.02
    np.testing.assert_allclose(
        np.einsum("nim,m->ni", group.phi, q), static.u_static, atol=1e-3 * np.abs(static.u_static).max()
    )


def test_stress_modes_at_speed_are_derivatives_of_the_stress():
    """About the deformed state: F (d S(u_static + h phi) / dh) F^T / det F by central differences (exact)."""
    mesh = brick("tetra10", (1, 2, 5), (0.01, 0.04, 0.2), (0.0, 0.0, 0.1), to=shaken(0.002))
    group = the_group(mesh, 4, supports=[{"face": "z0"}], rotation={"speeds_rpm": [20000.0]})
    (b,) = discretise(mesh).blocks

    def second(u):
        return green_strain(displacement_gradient(b, u)) @ STEEL_C.T

    F = np.eye(3) + displacement_gradient(b, group.u_static)
    for j in range(4):
        phi = group.phi[:, :, j]
        h = 1e-4 / np.abs(phi).max()
        slope = to_symmetric((second(group.u_static + h * phi) - second(group.u_static - h * phi)) / (2 * h))
        pushed = F @ slope @ np.swapaxes(F, -1, -2) / np.linalg.det(F)[..., None, None]
        found = to_symmetric(group.stresses["gauss"].stress[:, :, j])
        np.testing.assert_allclose(found, pushed.reshape(-1, 3, 3), atol=1e-9 * np.abs(slope).max())
    # the static stress is Cauchy's, F S F^T / det F
    S = to_symmetric(second(group.u_static))
    sigma = F @ S @ np.swapaxes(F, -1, -2) / np.linalg.det(F)[..., None, None]
    found = to_symmetric(group.stresses["gauss"].static_stress)
    np.testing.assert_allclose(found, sigma.reshape(-1, 3, 3), atol=1e-9 * np.abs(sigma).max())


def test_stress_modes_know_the_modulus_at_temperature():
    """Twice the temperature step, half the modulus: stress modes scale with E, strain modes with the shapes only."""
    hot = {**STEEL, "temperature": [300.0, 600.0], "modulus_factor": [1.0, 0.5]}
    a = the_group(BLOCK, **CLAMPED)
    b = the_group(BLOCK, material=hot, temperature=np.full(BLOCK.n_points, 600.0), **CLAMPED)
    np.testing.assert_allclose(
        b.stresses["gauss"].strain,
        a.stresses["gauss"].strain,
        atol=1e-7 * np.abs(a.stresses["gauss"].strain).max(),
    )
    np.testing.assert_allclose(
        b.stresses["gauss"].stress,
        0.5 * a.stresses["gauss"].stress,
        atol=1e-7 * np.abs(a.stresses["gauss"].stress).max(),
    )


def test_rigid_modes_have_no_stress():
    group = the_group(BLOCK, 8, free=True)
    scale = np.abs(group.stresses["gauss"].stress[:, :, 6:]).max()
    assert np.abs(group.stresses["gauss"].stress[:, :, :6]).max() < 1e-8 * scale


def test_von_mises():
    """Uniaxial: the stress; shear: sqrt(3) of it; hydrostatic: nothing; any: sqrt(3/2 s:s)."""
    assert von_mises(np.array([5.0, 0, 0, 0, 0, 0])) == pytest.approx(5)
    assert von_mises(np.array([0, 0, 0, 0, 2.0, 0])) == pytest.approx(2 * np.sqrt(3))
    assert von_mises(np.array([7.0, 7, 7, 0, 0, 0])) == 0
    s = np.random.default_rng(0).normal(size=(10, 6))
    t = to_symmetric(s)
    deviator = t - np.trace(t, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    np.testing.assert_allclose(von_mises(s), np.sqrt(1.5 * np.einsum("pij,pij->p", deviator, deviator)), rtol=1e-12)


# ---------------------------------------------------------------- Lame's pipe


@pytest.mark.parametrize("cell_type", QUADRATIC)
def test_thick_pipe_under_pressure(cell_type):
    """Lame: sigma_r, sigma_phi = A -+ B / r^2 between smooth ends, on curved cells; stress of order 2."""
    a, b, p = 0.05, 0.1, 1e8
    A, B = p * a**2 / (b**2 - a**2), p * a**2 * b**2 / (b**2 - a**2)
    supports = [{"face": f, "directions": c} for f, c in (("y0", "y"), ("y1", "x"), ("z0", "z"), ("z1", "z"))]
    errors, steps = [], ((2, 4), (3, 6), (4, 8))
    for radial, around in steps:
        mesh = pipe(cell_type, (radial, around, 1), a, b, 0.02, np.pi / 2)
        group = the_group(
            mesh, 1, supports=supports, loads=[{"kind": "pressure", "face": "x0", "value": p}],
            rotation={"prestress": "linear"},
        )  # fmt: skip
        s = group.stresses["gauss"]
        r = np.linalg.norm(s.points[:, :2], axis=1)
        n = np.column_stack([s.points[:, :2] / r[:, None], 0 * r])
        t = np.column_stack([-n[:, 1], n[:, 0], 0 * r])
        T = to_symmetric(s.static_stress)
        radially, hoop = (np.einsum("pi,pij,pj->p", v, T, v) for v in (n, t))
        wrong = np.sqrt(s.weights @ ((radially - A + B / r**2) ** 2 + (hoop - A - B / r**2) ** 2) / s.weights.sum())
        R = np.linalg.norm(mesh.points[:, :2], axis=1)
        u = (1 + NU) / E * ((1 - 2 * NU) * A * R + B / R)
        moved = np.einsum("ni,ni->n", group.u_static[:, :2], mesh.points[:, :2]) / R
        errors.append([np.abs(moved - u).max() / u.max(), wrong / p])
    slopes = [np.polyfit(np.log([1 / n for n, _ in steps]), np.log(e), 1)[0] for e in np.transpose(errors)]
    # at nodes bricks gain an order; the four-point rule on curved tetrahedra costs most of one
    assert slopes[0] > (2.1 if cell_type == "tetra10" else 3.5) and slopes[1] > 1.7, (slopes, errors)
    assert errors[-1][0] < 2e-3 and errors[-1][1] < 0.02


def test_mesh_of_many_types_has_stresses_in_the_meshs_order():
    """Two blocks (not joined, one held by each end): points and stresses run block after block."""
    a, b = brick("tetra10", (1, 1, 1)), brick("hexahedron20", (1, 1, 1), origin=(2.0, 0, 0))
    faces = {"held": {"triangle6": a.faces["x0"]["triangle6"], "quad8": b.faces["x0"]["quad8"] + a.n_points}}
    cells = {"tetra10": a.cells["tetra10"], "hexahedron20": b.cells["hexahedron20"] + a.n_points}
    mesh = Mesh(np.vstack([a.points, b.points]), cells, faces)
    group = the_group(mesh, 4, supports=[{"face": "held"}])
    s = group.stresses["gauss"]
    assert len(s.points) == 6 * 4 + 27 and (s.points[:24, 0] < 1).all() and (s.points[24:, 0] > 2).all()
    for j in range(group.n_modes):  # the parts are not joined: a mode lives in one of them
        left, right = (np.abs(part).max() for part in (s.stress[:24, :, j], s.stress[24:, :, j]))
        assert min(left, right) < 1e-6 * max(left, right)


def test_stress_modes_at_speed_are_the_change_of_the_cauchy_stress_seen_by_the_material():
    """sigma(u + h phi) pulled back by the change of deformation f = F F0^-1 and its volume: Truesdell's rate."""
    from microslip.elasticity import pushed

    rng = np.random.default_rng(5)
    C = isotropic(2.1e11, 0.3)
    F0 = np.eye(3) + 0.2 * rng.standard_normal((1, 1, 3, 3))
    dF = rng.standard_normal((3, 3))
    h = 1e-6

    def cauchy_of(F):
        E = 0.5 * (F.T @ F - np.eye(3))
        e = np.array([E[0, 0], E[1, 1], E[2, 2], 2 * E[0, 1], 2 * E[1, 2], 2 * E[0, 2]])
        S = to_symmetric(C @ e)
        return F @ S @ F.T / np.linalg.det(F)

    def pulled(F):
        f = np.linalg.inv(F @ np.linalg.inv(F0[0, 0]))
        return f @ cauchy_of(F) @ f.T / np.linalg.det(f)

    rate = (pulled(F0[0, 0] + h * dF) - pulled(F0[0, 0] - h * dF)) / (2 * h)
    slope = dF @ np.linalg.inv(F0[0, 0])
    e = 0.5 * (slope + slope.T)
    strain = np.array([e[0, 0], e[1, 1], e[2, 2], 2 * e[0, 1], 2 * e[1, 2], 2 * e[0, 2]])
    stress = to_symmetric(pushed(C, F0)[0, 0] @ strain)
    np.testing.assert_allclose(stress, rate, rtol=1e-6, atol=1e-6 * np.abs(rate).max())

"""Spectra: complete, certified, the same by every backend, numbering, unit and position; pairs and signs definite."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from closed_forms.bars import box_frequencies
from hypothesis import example, given, settings
from hypothesis import strategies as st
from meshes import STEEL, body, brick, moved, renumbered, roller_box, rotation_matrix, shaken
from refusals import refused

from microslip.errors import NotConverged, UserError
from microslip.fem.discretise import discretise, free_upper
from microslip.linalg import eigen
from microslip.linalg.canonical import clusters, signs, turn_clusters
from microslip.linalg.direct import SuperLU
from microslip.mesh import read_mesh
from microslip.modal.boundary import fixed_dofs
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import make_model
from microslip.modal.spectrum import make_pencil

BACKENDS = eigen.available_backends()
E, NU, RHO = STEEL["young"], STEEL["poisson"], STEEL["density"]
LAME, SHEAR = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
CLAMPED = {"supports": [{"face": "x0"}]}


def pencil_of(mesh, what, solver="superlu"):
    """K and M of a body at rest on its free degrees of freedom, and its model."""
    d = discretise(mesh)
    fixed = fixed_dofs(mesh, what)
    zero = np.zeros((mesh.n_points, 3))
    axis = np.array([0.0, 1.0, 0.0])
    material = what.material.material()
    model = make_model(d, material, free_upper(d.pattern, fixed), fixed, axis, zero[0], None, 293.0, zero, True)
    return make_pencil(model, model.K0, eigen.new_solver(solver)), model


def dense(pencil):
    eye = np.eye(pencil.n)
    return pencil.K(eye), pencil.M(eye)


def dense_values(pencil, shift=-1e6):
    """All finite eigenvalues; turned round because the four-point mass of few tetrahedra is singular."""
    K, M = dense(pencil)
    mu = scipy.linalg.eigh(M, K - shift * M, eigvals_only=True)[::-1]
    return shift + 1 / mu[mu > 1e-11 * mu[0]]


def tolerance(pencil, value, factor=10.0):
    """Relative accuracy rounding allows an eigenvalue: c eps |K| / (lambda |M|), never below 1e-9."""
    return max(1e-9, factor * np.finfo(float).eps * pencil.k_norm / (value * pencil.m_norm))


def the_modes(mesh, **what):
    what = {"modes": {"count": 8}, **what}
    return modal_basis(mesh, body(**what)).groups[0, 0]


BEAM = brick("hexahedron20", (5, 2, 2), (0.4, 0.05, 0.05))  # square section: bending pairs
BLOCK = brick("tetra10", (3, 2, 2), (0.1, 0.07, 0.06), to=shaken(0.004))  # stocky, no symmetry


# ---------------------------------------------------------------- against dense algebra


@pytest.mark.parametrize("name", BACKENDS)
def test_lowest_eigenpairs_are_those_of_dense_algebra(name):
    pencil, _ = pencil_of(BLOCK, body(**CLAMPED), name)
    K, M = dense(pencil)
    exact = scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=(0, 11))
    found = eigen.certify(pencil, eigen.search(pencil, 12))
    assert found.certified and found.refound == 0
    np.testing.assert_allclose(found.values, exact, rtol=1e-10)
    assert found.backward_error.max() < 1e-14
    assert found.orthogonality < 1e-12
    residual = K @ found.vectors - M @ found.vectors * found.values
    assert np.abs(residual).max() < 1e-12 * np.abs(K).max() * np.abs(found.vectors).max() * 10
    pencil.solver.close()


@pytest.mark.parametrize("name", BACKENDS)
def test_inertia_counts_are_dense_counts(name):
    """Number of eigenvalues below a shift, at shifts across and beyond the spectrum, and for an indefinite K."""
    pencil, _ = pencil_of(brick("tetra10", (2, 2, 1), to=shaken(0.05)), body(**CLAMPED), name)
    exact = scipy.linalg.eigh(*dense(pencil), eigvals_only=True)
    for at in (
        -1e3,
        0.5 * exact[0],
        *(0.5 * (exact[i] + exact[i + 1]) for i in (0, 3, 9, 30, 80)),
        2 * exact[-1],
    ):
        pencil.solver.factorise(pencil.shifted(at))
        assert pencil.solver.negative() == (exact < at).sum()
        b = np.random.default_rng(0).normal(size=(pencil.n, 3))
        K, M = dense(pencil)
        np.testing.assert_allclose((K - at * M) @ pencil.solver.solve(b), b, atol=1e-6 * np.abs(b).max())
        one = pencil.solver.solve(np.ascontiguousarray(b[:, 0]))
        np.testing.assert_allclose(one, pencil.solver.solve(b)[:, 0], rtol=1e-9, atol=1e-12 * np.abs(one).max())
    pencil.solver.close()


def test_superlu_counts_by_qdldl_when_it_exchanged_rows():
    """A zero on the diagonal makes SuperLU exchange rows; the count must still be right."""
    A = np.array([[0.0, 2.0, 0.0], [2.0, 1e-9, 1.0], [0.0, 1.0, 3.0]])
    solver = SuperLU()
    solver.factorise(sp.csr_matrix(np.triu(A) + 1e-300 * np.triu(np.ones((3, 3)))))
    assert solver.negative() == (np.linalg.eigvalsh(A) < 0).sum()


@pytest.mark.skipif(len(BACKENDS) < 2, reason="only one direct solver here")
def test_the_search_tells_how_far_it_is():
    """A line a block, in the form that moves the bar."""
    pencil, _ = pencil_of(brick("tetra10", (3, 3, 6), (0.01, 0.012, 0.05)), body(**CLAMPED))
    told = []
    pencil.tell = told.append
    eigen.search(pencil, 6)
    steps = [int(text.split(" of ")[0]) for text in told]
    limit = {int(text.split()[2]) for text in told}
    assert len(steps) > 2 and (np.diff(steps[:-1]) == 4).all() and len(limit) <= 2 and steps[-1] <= max(limit)
    assert told[-1].startswith(f"{steps[-1]} of {steps[-1]} ")  # the rest was not needed


def test_backends_agree():
    results = [the_modes(BLOCK, **CLAMPED, modes={"count": 10, "solver": name}) for name in BACKENDS]
    a, b = results
    np.testing.assert_allclose(a.omega, b.omega, rtol=1e-10)
    scale = np.abs(a.phi).max(axis=(0, 1))
    assert (np.abs(a.phi - b.phi).max(axis=(0, 1)) / scale).max() < 1e-6  # 1e-10 over gaps of a per cent, signs equal
    assert a.checks["certified"] == b.checks["certified"] == 1


@pytest.mark.parametrize("cell_type", ["hexahedron20", "tetra10"])
@pytest.mark.parametrize("what", [CLAMPED, {"free": True}], ids=["held", "free"])
def test_a_body_of_few_nodes_is_solved_densely(cell_type, what):
    """Six ten-node tetrahedra have 27 nodes and 24 mass points: a singular M, whose infinite eigenvalues drop out."""
    mesh = brick(cell_type, (1, 1, 1), to=shaken(0.03))
    g = the_modes(mesh, **what, modes={"count": 15})
    pencil, _ = pencil_of(mesh, body(**what))
    zero = 6 if "free" in what else 0
    np.testing.assert_allclose(g.omega[zero:] ** 2, dense_values(pencil)[zero : g.n_modes], rtol=1e-9)
    assert g.checks["certified"] == 1 and g.checks["orthogonality"] < 1e-9
    for backend in (eigen.search(pencil, 60, -1e6), eigen.search(pencil, pencil.n, -1e6)):
        assert len(backend.values) <= len(dense_values(pencil))


# ---------------------------------------------------------------- repeated eigenvalues and the certificate


def test_rows_of_unlike_units_lose_no_mode():
    """Congruence by D keeps eigenvalues; with D = 1e-7 for rotations in N, mm, t none of them is massless."""
    rng = np.random.default_rng(5)
    A = rng.normal(size=(6, 6))
    K, M, D = A @ A.T + np.eye(6), np.diag(rng.uniform(1, 2, 6)), np.diag([1, 1, 1, 1e-7, 1e-7, 1e-7])
    wanted = scipy.linalg.eigvalsh(K, M)
    K, M = sp.csr_matrix(D @ K @ D), sp.csr_matrix(D @ M @ D)

    def shifted(s: float) -> sp.csr_matrix:
        return sp.csr_matrix(sp.triu(K - s * M))

    pencil = eigen.Pencil(shifted, K.dot, M.dot, 6, abs(K).max(), abs(M).max(), eigen.new_solver("superlu"))
    np.testing.assert_allclose(eigen.search(pencil, 6).values, wanted, rtol=1e-10)


def test_a_cube_on_rollers_shows_all_its_repeated_waves():
    """A cube has P and S waves three, six, ... times; none may be missing and none cut off (closed form)."""
    cube = brick("hexahedron27", (3, 3, 3))
    exact = box_frequencies(RHO, LAME, SHEAR, (1.0, 1.0, 1.0), 20)
    group = the_modes(cube, **roller_box(), modes={"count": 10})
    m = group.n_modes
    assert group.checks["certified"] == 1
    np.testing.assert_allclose(group.omega, exact[:m], rtol=0.02)  # mesh error; the gaps are larger
    assert exact[m] > 1.05 * exact[m - 1]  # ends at a gap: the cluster at the end is whole
    runs = [r.stop - r.start for r in clusters(group.omega**2)]
    exact_runs = [r.stop - r.start for r in clusters(exact[:m] ** 2)]
    assert runs == exact_runs and max(runs) >= 3


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6])
def test_pairs_of_a_square_beam_are_kept_whole(count):
    group = the_modes(BEAM, **CLAMPED, modes={"count": count})
    pairs = [r for r in clusters(group.omega**2) if r.stop - r.start == 2]
    assert group.n_modes >= count and pairs[0] == slice(0, 2)
    assert group.checks["certified"] == 1
    more = the_modes(BEAM, **CLAMPED, modes={"count": 9})
    np.testing.assert_allclose(group.omega, more.omega[: group.n_modes], rtol=1e-9)
    assert more.omega[group.n_modes] > group.omega[-1] * (1 + 1e-6)


@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize("lost", [[0], [1], [3], [0, 1], [2, 5, 6]], ids=str)
def test_a_lost_member_is_found_again(name, lost):
    """Vectors are taken out of the spectrum; the inertia count misses them and the search brings them back."""
    pencil, _ = pencil_of(BEAM, body(**CLAMPED), name)
    found = eigen.search(pencil, 8)
    damaged = replace(found, values=np.delete(found.values, lost), vectors=np.delete(found.vectors, lost, axis=1))
    mended = eigen.certify(pencil, damaged)
    assert mended.certified and mended.refound == len(lost)
    np.testing.assert_allclose(mended.values, found.values, rtol=1e-9)
    assert mended.orthogonality < 1e-10
    assert np.linalg.matrix_rank(mended.vectors.T @ pencil.M(found.vectors), tol=1e-6) == len(found.values)
    pencil.solver.close()


def test_a_lost_elastic_mode_of_a_free_body_is_found_again():
    pencil, model = pencil_of(BEAM, body(free=True))
    from microslip.modal import rigid

    R = rigid.mass_orthonormal(rigid.free_motions(BEAM.points, BEAM.points.mean(axis=0), model.fixed), pencil.M)
    shift = -1e6
    found = eigen.search(pencil, 11, shift, rigid=R)
    damaged = replace(found, values=np.delete(found.values, 7), vectors=np.delete(found.vectors, 7, axis=1))
    mended = eigen.certify(pencil, damaged, shift)
    assert mended.refound == 1
    np.testing.assert_allclose(mended.values[6:], found.values[6:], rtol=1e-9)


def test_too_many_values_are_refused():
    """A spurious copy below the shift cannot pass: the count says fewer exist."""
    pencil, _ = pencil_of(BLOCK, body(**CLAMPED))
    found = eigen.search(pencil, 6)
    vector = np.random.default_rng(1).normal(size=(pencil.n, 1))
    spoilt = replace(
        found, values=np.append(found.values, found.values[-1]), vectors=np.hstack([found.vectors, vector])
    )
    with pytest.raises(NotConverged, match="only 6 exist"):
        eigen.certify(pencil, spoilt)


def test_signs_have_magnitude_one_where_the_largest_is_nearly_tied():
    """The lowest row rules, though another one is larger by less than a millionth."""
    np.testing.assert_array_equal(signs(np.array([[-1.0], [1.0 + 5e-7]])), [-1.0])
    assert abs(signs(np.array([[3j], [3.000001 + 0j]]))[0]) == pytest.approx(1.0, abs=1e-15)


# ---------------------------------------------------------------- free bodies


@pytest.mark.parametrize("mesh", [BEAM, BLOCK], ids=["beam", "block"])
def test_a_free_body_has_six_rigid_modes(mesh):
    """Exactly zero, M-orthonormal, in the span of the rigid fields, the elastic ones orthogonal to them."""
    from microslip.modal.rigid import rigid_fields

    basis = modal_basis(mesh, body(free=True, modes={"count": 12}))
    g = basis.groups[0, 0]
    assert g.kind[:6] == ("rigid",) * 6 and "rigid" not in g.kind[6:]
    assert (g.omega[:6] == 0).all() and g.omega[6] > 0 and basis.free
    assert g.checks["certified"] == 1 and g.checks["orthogonality"] < 1e-10
    R = rigid_fields(mesh.points, basis.centre).reshape(-1, 6)
    phi = g.phi.reshape(-1, g.n_modes)
    left = phi[:, :6] - R @ np.linalg.lstsq(R, phi[:, :6], rcond=None)[0]
    assert np.abs(left).max() < 1e-9 * np.abs(phi[:, :6]).max()
    pencil, _ = pencil_of(mesh, body(free=True))
    gram = phi.T @ pencil.M(phi)
    np.testing.assert_allclose(gram, np.eye(g.n_modes), atol=1e-9)
    np.testing.assert_allclose(g.omega[6:] ** 2, dense_values(pencil)[6 : g.n_modes], rtol=1e-8)


def test_fewer_modes_than_rigid_ones_still_gives_all_six():
    g = the_modes(BLOCK, free=True, modes={"count": 2})
    assert g.n_modes == 6 and (g.omega == 0).all()


def test_a_hinged_body_is_refused_and_its_motion_named():
    """Held along one edge: one rotation is left, and the message says about what."""
    mesh = brick("tetra10", (2, 2, 1), (0.2, 0.1, 0.05))
    edge = np.flatnonzero((mesh.points[:, 0] == 0) & (mesh.points[:, 1] == 0))
    from meshes import with_sets

    hinged = with_sets(mesh, hinge=edge)
    supports = [{"face": "hinge"}]
    with pytest.raises(UserError, match=r"rotation about z through \(0, 0, \S+\) m"):
        the_modes(hinged, supports=supports)
    g = the_modes(hinged, supports=supports, free=True)
    assert g.kind[:2] == ("rigid", "normal") and g.omega[0] == 0
    turn = np.cross([0, 0, 1.0], mesh.points)
    shape = g.phi[:, :, 0] / np.abs(g.phi[:, :, 0]).max() * np.abs(turn).max()
    assert min(np.abs(shape - turn).max(), np.abs(shape + turn).max()) < 1e-9
    pencil, _ = pencil_of(hinged, body(supports=supports, free=True))
    np.testing.assert_allclose(g.omega[1:] ** 2, dense_values(pencil)[1 : g.n_modes], rtol=1e-9)


def test_sliding_bodies_and_more_modes_than_degrees_of_freedom_are_refused():
    mesh = brick("tetra10", (1, 1, 1))
    along = [{"face": face, "directions": "yz"} for face in ("x0", "x1")]
    refused("translation along x", the_modes, mesh, supports=along)
    refused("all six rigid motions", the_modes, mesh)
    refused("modes.count", the_modes, mesh, **CLAMPED, modes={"count": 80})


# ---------------------------------------------------------------- one definite form


def test_pairs_and_signs_do_not_depend_on_the_start():
    """Any rotation inside the clusters and any signs end in the same shapes."""
    pencil, _ = pencil_of(BEAM, body(**CLAMPED))
    found = eigen.search(pencil, 8)
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(6, pencil.n))

    def definite(phi):
        phi = turn_clusters(phi, found.values, rows @ phi)
        return phi * signs(rows @ phi)

    reference = definite(found.vectors)
    for _ in range(5):
        other = found.vectors.copy()
        for run in clusters(found.values):
            Q, _ = np.linalg.qr(rng.normal(size=(run.stop - run.start,) * 2))
            other[:, run] = other[:, run] @ Q
        np.testing.assert_allclose(definite(other), reference, atol=1e-9 * np.abs(reference).max())
    pair = rows @ reference[:, :2]
    assert abs(pair[0, 1]) < 1e-10 * abs(pair[0, 0])  # the second of the pair does not move the first row
    assert (pencil.K(reference) - pencil.M(reference) * found.values).max() < 1e-9 * pencil.k_norm


def test_shapes_do_not_depend_on_the_numbering():
    """With an interface to decide, a renumbered square beam has the same shapes, pairs and signs included."""
    what = {**CLAMPED, "interfaces": [{"name": "tip", "face": "x1", "t2": [0, 0.3, 1.0]}]}
    a = the_modes(BEAM, **what)
    mesh, new = renumbered(BEAM, 5)
    b = the_modes(mesh, **what)
    np.testing.assert_allclose(b.omega, a.omega, rtol=1e-9)
    np.testing.assert_allclose(b.phi[new], a.phi, atol=1e-6 * np.abs(a.phi).max())
    np.testing.assert_allclose(
        b.interfaces["tip"].rows, a.interfaces["tip"].rows, atol=1e-6 * np.abs(a.interfaces["tip"].rows).max()
    )


def test_shapes_without_an_interface_do_not_depend_on_the_numbering():
    """A body without symmetry, and a square beam whose pairs only the points themselves can decide."""
    for mesh in (BLOCK, BEAM):
        a = the_modes(mesh, **CLAMPED)
        for seed in (1, 3):
            again, new = renumbered(mesh, seed)
            b = the_modes(again, **CLAMPED)
            np.testing.assert_allclose(b.phi[new], a.phi, atol=1e-6 * np.abs(a.phi).max())


@settings(max_examples=4)
@given(seed=st.integers(0, 10**6))
def test_frequencies_do_not_depend_on_the_numbering(seed):
    mesh, _ = renumbered(BLOCK, seed)
    a, b = the_modes(BLOCK, **CLAMPED), the_modes(mesh, **CLAMPED)
    pencil, _ = pencil_of(BLOCK, body(**CLAMPED))
    np.testing.assert_allclose(b.omega, a.omega, rtol=tolerance(pencil, a.omega[0] ** 2))


ANGLES = st.tuples(*[st.floats(-3, 3)] * 3)
SHIFTS = st.tuples(*[st.floats(-0.5, 0.5)] * 3)
TITANIUM = {
    "density": 4500.0,
    "young": [130e9, 90e9, 110e9],
    "poisson": [0.3, 0.25, 0.28],
    "shear": [40e9, 35e9, 45e9],
}


@settings(max_examples=4)
@given(turn=ANGLES, shift=SHIFTS)
@example(turn=(0.0, 0.0, 0.0), shift=(0.0, 0.0, 1.17e-40))
def test_frequencies_do_not_depend_on_place_and_attitude(turn, shift):
    """An orthotropic body at speed, moved with its material axes and its rotor axis."""
    R = rotation_matrix(turn)
    rotor = {"axis": [0.0, 1.0, 0.0], "point": [-0.2, 0.0, 0.0], "speeds_rpm": [9000.0]}
    a = the_modes(BLOCK, material=TITANIUM, rotation=rotor, **CLAMPED)
    turned = {
        **rotor, "axis": (R @ rotor["axis"]).tolist(), "point": (R @ rotor["point"] + shift).tolist(),
    }  # fmt: skip
    b = the_modes(
        moved(BLOCK, R, np.array(shift)),
        material={**TITANIUM, "axes": R.T.tolist()},
        rotation=turned,
        **CLAMPED,
    )
    np.testing.assert_allclose(b.omega, a.omega, rtol=1e-8)  # Newton ends at 1e-9 of u
    np.testing.assert_allclose(
        np.linalg.norm(b.u_static, axis=1),
        np.linalg.norm(a.u_static, axis=1),
        atol=1e-8 * np.abs(a.u_static).max(),
    )


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1e3), ("cm", 1e2), ("in", 1 / 0.0254)])
def test_frequencies_do_not_depend_on_the_unit_of_the_mesh_file(unit, scale, tmp_path):
    lines = ["*NODE"]
    lines += [f"{i + 1}, " + ", ".join(repr(v * scale) for v in p) for i, p in enumerate(BLOCK.points.tolist())]
    lines += ["*ELEMENT, TYPE=C3D10, ELSET=body"]
    cells = BLOCK.cells["tetra10"] + 1
    lines += [f"{i + 1}, " + ", ".join(map(str, c)) for i, c in enumerate(cells.tolist())]
    lines += ["*NSET, NSET=root", *(f"{k + 1}," for k in BLOCK.face_points("x0")), ""]
    path = tmp_path / "block.inp"
    path.write_text("\n".join(lines))
    g = the_modes(read_mesh(path, unit), supports=[{"face": "root"}])
    np.testing.assert_allclose(g.omega, the_modes(BLOCK, **CLAMPED).omega, rtol=1e-9)


def test_scaling_laws():
    """Twice the size halves the frequencies, four times the modulus doubles them, four times the density halves."""
    a = the_modes(BLOCK, **CLAMPED).omega
    big = moved(BLOCK, 2 * np.eye(3), np.zeros(3))
    np.testing.assert_allclose(the_modes(big, **CLAMPED).omega, a / 2, rtol=1e-9)
    np.testing.assert_allclose(the_modes(BLOCK, material={**STEEL, "young": 4 * E}, **CLAMPED).omega, 2 * a, rtol=1e-9)
    np.testing.assert_allclose(
        the_modes(BLOCK, material={**STEEL, "density": 4 * RHO}, **CLAMPED).omega, a / 2, rtol=1e-9
    )


def test_same_call_gives_the_same_bits():
    a, b = the_modes(BLOCK, **CLAMPED), the_modes(BLOCK, **CLAMPED)
    assert a.omega.tobytes() == b.omega.tobytes() and a.phi.tobytes() == b.phi.tobytes()

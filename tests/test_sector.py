"""The solver of cyclic sectors: pairing of cut faces, condensed solutions and inertia counts against dense algebra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rings
import scipy.linalg
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import body
from refusals import refused
from test_petsc import needed

from microslip.basis import check_basis, read_basis, write_basis
from microslip.data import Mesh
from microslip.fem.cyclic import cyclic_upper, pair_cut_faces, sector_unknowns
from microslip.fem.discretise import discretise
from microslip.frames import rotation
from microslip.linalg import eigen
from microslip.linalg.condensed import negative_eigenvalues, new_condensed
from microslip.modal.boundary import fixed_dofs
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import make_model
from microslip.modal.sector import sector_pencils
from microslip.modal.solution import shared_shifts

AXIS, ORIGIN = np.array([0.0, 1.0, 0.0]), np.zeros(3)
N = 6
BACKENDS = eigen.available_backends()


def sector_body(**more: object):
    return body(
        supports=[{"face": "bore"}], cyclic={"sectors": N}, modes={"count": 6},
        rotation={"axis": [0.0, 1.0, 0.0], "speeds_rpm": [0.0]}, **more,
    )  # fmt: skip


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return rings.bladed_sector("hexahedron20", N)


@pytest.fixture(scope="module")
def sector(mesh: Mesh):
    d = discretise(mesh)
    fixed = fixed_dofs(mesh, sector_body())
    unknowns = sector_unknowns(d.pattern, fixed, pair_cut_faces(mesh, "cyclic_left", "cyclic_right", AXIS, ORIGIN, N))
    static = cyclic_upper(unknowns, d.pattern.size)
    model = make_model(
        d, sector_body().material.material(), static, fixed, AXIS, ORIGIN, None, 293.0, np.zeros((mesh.n_points, 3)),
        True,
    )  # fmt: skip
    return model, unknowns


def whole(upper: sp.csr_matrix) -> np.ndarray:
    return (upper + sp.triu(upper, 1).T).toarray()


def condensed_of(unknowns, backend: str):
    return new_condensed(unknowns.boundary, backend)


# ---------------------------------------------------------------- unknowns


def test_the_static_unknowns_are_the_congruent_transformation(sector) -> None:
    model, unknowns = sector
    T = unknowns.transformation(0).toarray()
    dense = T.T @ whole(unknowns.apart.matrix(model.K0)) @ T
    assert np.abs(np.triu(dense) - model.free.matrix(model.K0).toarray()).max() < 1e-13 * np.abs(dense).max()


def test_a_sector_of_one_row_of_cells_couples_a_node_to_its_own_image() -> None:
    """Both cut faces belong to the same cells, so entries between a node and its image land on the diagonal."""
    mesh = rings.disc_sector("hexahedron20", 8, 0.05, 0.1, 0.01, (1, 1, 2))
    d = discretise(mesh)
    fixed = fixed_dofs(mesh, body(supports=[{"face": "bore"}]))
    unknowns = sector_unknowns(d.pattern, fixed, pair_cut_faces(mesh, "cyclic_left", "cyclic_right", AXIS, ORIGIN, 8))
    upper = cyclic_upper(unknowns, d.pattern.size)
    values = np.random.default_rng(1).standard_normal((d.pattern.size, 3, 3))
    diagonal = d.pattern.row == d.pattern.col
    values[diagonal] += values[diagonal].transpose(0, 2, 1)
    T = unknowns.transformation(0).toarray()
    dense = T.T @ whole(unknowns.apart.matrix(values)) @ T
    assert np.abs(np.triu(dense) - upper.matrix(values).toarray()).max() < 1e-12


def test_displacements_obey_the_phase_rule(sector, mesh: Mesh) -> None:
    _, unknowns = sector
    R = rotation(AXIS, 2 * np.pi / N)
    for k in range(N // 2 + 1):
        T = unknowns.transformation(k)
        u = unknowns.apart.expand(T @ np.random.default_rng(k).standard_normal(T.shape[1]), mesh.n_points)
        u = u.reshape(-1, 3)
        there = u[unknowns.cut.left] @ R.T * np.exp(2j * np.pi * k / N)
        assert np.abs(u[unknowns.cut.right] - there).max() < 1e-14


# ---------------------------------------------------------------- solver


@pytest.mark.parametrize("backend", [*BACKENDS, pytest.param("petsc", marks=[pytest.mark.slow, needed])])
@pytest.mark.parametrize("k", [0, 1, 2, 3])
def test_solutions_and_inertia_against_dense_algebra(sector, backend: str, k: int) -> None:
    model, unknowns = sector
    condensed = condensed_of(unknowns, backend)
    pencil = sector_pencils(model, model.K0, unknowns, condensed, (k,))[k]
    T = unknowns.transformation(k).toarray()
    operators = (model.K0, model.M[:, None, None] * np.eye(3))
    K, M = (T.conj().T @ whole(unknowns.apart.matrix(values)) @ T for values in operators)
    values = scipy.linalg.eigh(K, M, eigvals_only=True)
    b = np.random.default_rng(k).standard_normal((pencil.n, 2)).astype(pencil.dtype)
    for shift in (0.0, 0.5 * (values[3] + values[4]), 0.5 * (values[40] + values[41])):
        pencil.solver.factorise(pencil.shifted(shift))
        x = pencil.solver.solve(b)
        wanted = np.linalg.solve(K - shift * M, b)
        assert np.abs(x - wanted).max() < 1e-8 * np.abs(wanted).max()  # condition of K about 1e7
        assert pencil.solver.solve(b[:, 0]).shape == (pencil.n,)
        assert pencil.solver.negative() == (values < shift).sum()
    found = eigen.certify(pencil, eigen.search(pencil, 6))
    assert found.certified and found.refound == 0
    assert np.abs(found.values / values[: len(found.values)] - 1).max() < 1e-9
    condensed.close()


def test_every_nodal_diameter_shares_one_factorisation(sector) -> None:
    model, unknowns = sector
    condensed = condensed_of(unknowns, BACKENDS[0])
    count = 0
    inner = condensed._factorise

    def counted(upper: sp.csr_matrix) -> None:
        nonlocal count
        count += 1
        inner(upper)

    condensed._factorise = counted  # type: ignore[method-assign]
    for pencil in sector_pencils(model, model.K0, unknowns, condensed, (0, 1, 2, 3)).values():
        eigen.search(pencil, 4)
    assert count == 1
    condensed.close()


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 12), st.booleans(), st.integers(0, 10**6), st.integers(0, 12))
def test_inertia_of_dense_matrices(n: int, is_complex: bool, seed: int, zeros: int) -> None:
    """Also with zeros on the diagonal, where Bunch and Kaufman need pairs."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n)) + (1j * rng.standard_normal((n, n)) if is_complex else 0)
    A = A + A.conj().T
    A[np.arange(min(zeros, n)), np.arange(min(zeros, n))] = 0
    values = np.linalg.eigvalsh(A)
    if np.abs(values).min() > 1e-9:
        assert negative_eigenvalues(A) == (values < 0).sum()


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 100), st.floats(0.01, 20)), min_size=1, max_size=15))
def test_shared_shifts_lie_in_their_gaps_and_are_few(bands: list[tuple[float, float]]) -> None:
    gaps = [(low, low + width) for low, width in bands]
    chosen = shared_shifts(gaps)
    assert all(low < s < high for (low, high), s in zip(gaps, chosen, strict=True))
    # as many gaps that do not overlap with each other as there are shifts prove that fewer would not do
    apart, end = 0, -np.inf
    for low, high in sorted(((a + 0.05 * (b - a), b - 0.05 * (b - a)) for a, b in gaps), key=lambda g: g[1]):
        if low > end:
            apart, end = apart + 1, high
    assert len(set(chosen)) <= apart


# ---------------------------------------------------------------- the whole basis


@pytest.mark.parametrize("reduction", ["eigenmodes", "rubin", "craig-bampton"])
def test_a_cyclic_file_holds_what_it_claims(mesh: Mesh, tmp_path, reduction: str) -> None:
    s = sector_body(
        reduction=reduction,
        monitors=[{"name": "tip", "point": [0.0, 0.0, 0.25]}],
        interfaces=[
            {"name": "right", "face": "contact_right", "role": "right", "partner": "left", "sector_shift": 1},
            {"name": "left", "face": "contact_left", "role": "left", "partner": "right", "sector_shift": -1},
        ],
        output={"stress_nodal_diameters": [1]},
    )  # fmt: skip
    basis = modal_basis(mesh, s)
    write_basis(tmp_path / "basis.h5", basis)
    again = read_basis(tmp_path / "basis.h5")
    assert again.sectors == N and sorted(again.groups) == [(0, k) for k in range(N // 2 + 1)]
    assert [c for c in check_basis(again) if not c.passed] == []
    for (_, k), g in again.groups.items():
        assert g.harmonic == k
        assert np.iscomplexobj(g.phi) == (0 < k < N / 2)
        assert bool(g.stresses) == (k == 1)
        assert g.checks["certified"] == 1
        C = g.compliance
        assert np.abs(C.static - C.static.conj().T).max() < 1e-12 * np.abs(C.static).max()
        if reduction != "eigenmodes":
            rows = [i for i, label in enumerate(C.labels) if label.startswith("interface:")]
            left = C.residual[np.ix_(rows, rows)]
            assert np.abs(left).max() < 1e-8 * np.abs(C.static[np.ix_(rows, rows)]).max()


# ---------------------------------------------------------------- refusals


def refusal(mesh: Mesh, **cyclic: object) -> str:
    changed = sector_body().cyclic.model_copy(update=cyclic)
    return refused((), modal_basis, mesh, sector_body().model_copy(update={"cyclic": changed}))


def test_wrong_number_of_sectors_is_told_with_the_right_one(mesh: Mesh) -> None:
    assert "makes 6 sectors, not 7" in refusal(mesh, sectors=7)


def test_exchanged_faces_are_recognised(mesh: Mesh) -> None:
    assert "exchange left and right" in refusal(mesh, left="cyclic_right", right="cyclic_left")


def test_missing_faces_are_named(mesh: Mesh) -> None:
    assert "cyclic.left" in refusal(mesh, left="nowhere")


def test_faces_that_do_not_match_are_refused_with_the_distance(mesh: Mesh) -> None:
    points = mesh.points.copy()
    node = mesh.face_points("cyclic_right")[5]
    points[node] += 0.1 * np.cross(AXIS, points[node])
    assert "off the other face" in refusal(replace(mesh, points=points))
    fewer = {t: f[:-1] for t, f in mesh.faces["cyclic_right"].items()}
    assert "off the other face" in refusal(
        replace(mesh, faces={**mesh.faces, "cyclic_right": fewer})
    )


def test_a_sector_that_reaches_the_axis_is_refused(mesh: Mesh) -> None:
    """There the two cut faces share the nodes on the axis."""
    both = {t: np.vstack([f, mesh.faces["cyclic_left"][t][:1]]) for t, f in mesh.faces["cyclic_right"].items()}
    touching = replace(mesh, faces={**mesh.faces, "cyclic_right": both})
    faces = ("cyclic_left", "cyclic_right")
    refused("leave a bore", pair_cut_faces, touching, *faces, AXIS, ORIGIN, N)


@pytest.mark.parametrize(
    "held", [{"face": "cyclic_left"}, {"face": "bore", "directions": "x"}, {"face": "bore"}]
)
def test_what_one_cut_face_holds_is_held_on_the_other(mesh: Mesh, held: dict) -> None:
    """A node of both sectors is held by both: along x of the one, and along x of the other, turned."""
    d = discretise(mesh)
    cut = pair_cut_faces(mesh, "cyclic_left", "cyclic_right", AXIS, ORIGIN, N)
    fixed = fixed_dofs(mesh, body(supports=[held]))
    unknowns = sector_unknowns(d.pattern, fixed, cut)
    T = unknowns.apart.expand(unknowns.transformation(2).toarray(), mesh.n_points)
    assert np.abs(T[fixed]).max() < 1e-12
    u = T.reshape(mesh.n_points, 3, -1)
    turned = np.einsum("ij,njm->nim", cut.rotation, u[cut.left]) * cut.phase(2)
    assert np.abs(u[cut.right] - turned).max() < 1e-12

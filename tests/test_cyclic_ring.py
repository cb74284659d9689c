"""One sector at every nodal diameter against the full ring of all sectors, meshed and assembled without symmetry.

The ring's matrices are real; their projection on waves of nodal diameter k (`rings.Ring.fourier`) has the sector's
spectrum. Rounding: relative errors of eigenvalues are bounded by eps |K| / (lambda |M|), here 1e-11.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import rings
import scipy.linalg
import scipy.sparse as sp
import sector as sector_of_tests
from meshes import body, moved, nearest, rotation_matrix, with_sets
from refusals import refused

from microslip.data import Mesh
from microslip.fem.cyclic import pair_cut_faces
from microslip.mesh import boundary_facets
from microslip.modal.compute import modal_basis
from microslip.modal.rows import patch
from microslip.modal.stress import gauss_set, nodal_set
from microslip.settings.body import BodySettings

SPEED = 600.0  # rad/s; the equilibrium moves by 1 mm, frequencies by up to a tenth
RPM = SPEED * 30 / np.pi
PLAIN = {"speeds_rpm": [RPM], "prestress": "nonlinear", "gyroscopic": False}
COUNT = 12
FORCE = (0.6, 0.5, -0.4)


@cache
def sector(cell_type: str = "hexahedron20", sectors: int = 6):
    return rings.bladed_sector(cell_type, sectors)


@cache
def ring(cell_type: str = "hexahedron20", sectors: int = 6):
    return rings.full_ring(sector(cell_type, sectors), sectors)


def settings(sectors: int, mesh, rpm: float = RPM, **more):
    tip = mesh.points[tip_of(mesh)].tolist()
    described = {
        "supports": [{"face": "bore"}],
        "cyclic": {"sectors": sectors},
        "interfaces": [
            {"name": "right", "face": "contact_right", "role": "right", "partner": "left", "sector_shift": 1,
             "t2": [0.0, 0.0, 1.0]},
            {"name": "left", "face": "contact_left", "role": "left", "partner": "right", "sector_shift": -1,
             "t2": [0.0, 0.0, 1.0]},
        ],
        "excitations": [{"name": "gas", "face": "front", "direction": list(FORCE)}],
        "monitors": [{"name": "tip", "point": tip}],
        "rotation": {"speeds_rpm": [rpm], "prestress": "nonlinear"},
        "modes": {"count": COUNT},
    }  # fmt: skip
    return body(**(described | more))


def tip_of(mesh) -> int:
    return nearest(mesh, mesh.points[mesh.face_points("contact_right")].mean(axis=0))


@cache
def basis(cell_type: str = "hexahedron20", sectors: int = 6, rpm: float = RPM, stresses: bool = False, **more):
    mesh = sector(cell_type, sectors)
    if stresses:
        more = {**more, "output": {"gauss": True, "nodal_stress": True}}
    return modal_basis(mesh, settings(sectors, mesh, rpm, **more))


@cache
def whole(cell_type: str = "hexahedron20", sectors: int = 6, speed: float = SPEED):
    """The ring's own matrices at speed."""
    plain = body(supports=[{"face": "bore"}], rotation={"prestress": "nonlinear"})
    return rings.matrices(ring(cell_type, sectors).mesh, plain, speed)


def groups(cell_type: str = "hexahedron20", sectors: int = 6, rpm: float = RPM, **more):
    """(nodal diameter, group), all of them."""
    found = basis(cell_type, sectors, rpm, **more)
    assert found.sectors == sectors
    assert sorted(found.groups) == [(0, k) for k in range(sectors // 2 + 1)]
    return [(k, found.groups[0, k]) for k in range(sectors // 2 + 1)]


def on_ring(shape, k: int, cell_type: str = "hexahedron20", sectors: int = 6):
    """(free degrees of freedom of the ring, m) of a sector's (n, 3, m)."""
    expanded = ring(cell_type, sectors).expand(shape, k)
    return expanded.reshape(-1, shape.shape[2])[whole(cell_type, sectors).free]


CASES = [("hexahedron20", 6, 0.0), ("hexahedron20", 6, RPM), ("tetra10", 5, RPM)]


# ---------------------------------------------------------------- spectra


@pytest.mark.parametrize(("cell_type", "sectors", "rpm"), [pytest.param(*CASES[0], marks=pytest.mark.slow), *CASES[1:]])
def test_frequencies_of_every_nodal_diameter(cell_type, sectors, rpm):
    """Even and odd numbers of sectors, at rest and about the nonlinear equilibrium (measured: 6e-12)."""
    full = whole(cell_type, sectors, rpm * np.pi / 30)
    for k, group in groups(cell_type, sectors, rpm):
        K, M, _, _ = full.fourier(ring(cell_type, sectors), k)
        exact = rings.spectrum(K, M, len(group.omega))
        assert len(group.omega) >= COUNT and group.harmonic == k
        np.testing.assert_allclose(group.omega, exact, rtol=1e-10)
        assert group.checks["certified"] == 1


def test_the_ring_has_each_of_them_once_or_twice():
    """The ring solved as a body without symmetry: simple for k = 0 and N/2, pairs between; none more, none less."""
    mesh = ring().mesh
    described = body(
        supports=[{"face": "bore"}], modes={"count": 24}, rotation={"speeds_rpm": [RPM], "prestress": "nonlinear"}
    )
    alone = modal_basis(mesh, described).groups[0, 0].omega
    union = [w for k, group in groups() for w in np.repeat(group.omega, 1 if k in (0, 3) else 2)]
    assert min(group.omega[-1] for _, group in groups()) > alone[-1]  # all of them were asked for
    np.testing.assert_allclose(np.sort(union)[: len(alone)], alone, rtol=1e-9)


def test_the_direction_of_the_wave():
    """The sector's shape continued by R u exp(+i k 2 pi / N) is an eigenvector of the ring; by -k it is none."""
    full = whole()
    norm = np.abs(full.K).sum(axis=1).max()
    for k, group in groups():
        x = on_ring(group.phi, k)
        error = np.abs(full.K @ x - (full.M @ x) * group.omega**2).max(axis=0) / np.abs(x).max(axis=0) / norm
        assert error.max() < 1e-12
        if 0 < k < 3:
            assert np.iscomplexobj(group.phi)
            wrong = on_ring(group.phi, -k)
            error = np.abs(full.K @ wrong - (full.M @ wrong) * group.omega**2).max(axis=0)
            assert (error / np.abs(wrong).max(axis=0) / norm).max() > 1e-4
        else:
            assert np.isrealobj(group.phi)


def test_expanded_modes_are_orthonormal_on_the_ring():
    """Waves of k and -k (the conjugates) and all nodal diameters together: X^H M X = N, X^H K X = N omega^2."""
    full, waves, omega = whole(), [], []
    for k, group in groups():
        x = on_ring(group.phi, k)
        waves += [x] if k in (0, 3) else [x, x.conj()]
        omega += [group.omega] * (1 if k in (0, 3) else 2)
    X, w = np.hstack(waves), np.concatenate(omega)
    np.testing.assert_allclose(X.conj().T @ (full.M @ X) / 6, np.eye(len(w)), atol=1e-9)
    stiff = X.conj().T @ (full.K @ X) / 6
    np.testing.assert_allclose(stiff, np.diag(w**2), atol=1e-9 * w.max() ** 2)


def test_axis_and_point_of_the_rotation():
    """The same sector turned and moved in space: same frequencies; its cyclic faces are found about that axis."""
    turn, shift = rotation_matrix((0.7, -0.4, 1.1)), np.array([0.3, -0.2, 0.5])
    mesh = moved(sector(), turn, shift)
    rotation = {
        "speeds_rpm": [RPM], "axis": (turn @ rings.AXIS).tolist(), "point": shift.tolist(),
    }  # fmt: skip
    described = settings(6, mesh, rotation=rotation, interfaces=[])
    found = modal_basis(mesh, described)
    for k, group in groups():
        np.testing.assert_allclose(found.groups[0, k].omega, group.omega, rtol=1e-9)
    reverse = replace_axis(rotation, -1.0)  # left and right are named for the positive sense
    refused("cyclic", modal_basis, mesh, settings(6, mesh, rotation=reverse, interfaces=[]))


def replace_axis(rotation: dict, sign: float) -> dict:
    return {**rotation, "axis": [sign * v for v in rotation["axis"]]}


# ---------------------------------------------------------------- static state


def test_static_displacement_and_stress_at_speed():
    """Every sector the same, turned: displacement, and Cauchy stress at the integration points and at the nodes."""
    full = whole()
    for _, group in groups(stresses=True):
        u = full.state.u[ring().nodes[0]]
        np.testing.assert_allclose(group.u_static, u, atol=1e-8 * np.abs(u).max())
    shape = np.zeros((ring().mesh.n_points, 3, 1))
    gauss, nodes = gauss_set(full.model, full.state, shape), nodal_set(full.model, full.state, shape)
    mine = basis(stresses=True).groups[0, 0].stresses
    scale = np.abs(gauss.static_stress).max()
    first = len(mine["gauss"].static_stress)  # the ring's cells begin with sector 0
    np.testing.assert_allclose(mine["gauss"].static_stress, gauss.static_stress[:first], atol=1e-8 * scale)
    np.testing.assert_allclose(mine["nodes"].static_stress, nodes.static_stress[ring().nodes[0]], atol=1e-8 * scale)


def test_stress_modes_are_those_of_the_expanded_shape():
    """At the nodes of the cyclic faces both sectors' cells count, the neighbour's turned and shifted in phase."""
    full = whole()
    for k, group in groups(stresses=True):
        wave = ring().expand(group.phi[:, :, :4].astype(complex), k)
        for location, make in (("gauss", gauss_set), ("nodes", nodal_set)):
            real, imag = (make(full.model, full.state, np.ascontiguousarray(part)) for part in (wave.real, wave.imag))
            mine = group.stresses[location]
            place = slice(len(mine.points)) if location == "gauss" else ring().nodes[0]
            for what in ("strain", "stress"):
                exact = getattr(real, what)[place] + 1j * getattr(imag, what)[place]
                np.testing.assert_allclose(getattr(mine, what)[:, :, :4], exact, atol=1e-9 * np.abs(exact).max())


# ---------------------------------------------------------------- rows, loads, response


def sector_patch(j: int, name: str):
    """The six rows of a contact of sector j, on the ring."""
    hint = ring().turns[j] @ np.array([0.0, 0.0, 1.0])
    return patch(ring().mesh, f"{name}_{j}", hint, name)


def test_interface_rows_of_every_sector():
    """Rows of the contacts of all sectors, fitted on the ring in turned frames: those of the sector times the phase."""
    for k, group in groups():
        wave = ring().expand(group.phi, k).reshape(-1, group.phi.shape[2])
        for name, face in (("right", "contact_right"), ("left", "contact_left")):
            mine = group.interfaces[name].rows
            for j in range(6):
                np.testing.assert_allclose(
                    sector_patch(j, face).B @ wave,
                    mine * np.exp(2j * np.pi * j * k / 6),
                    atol=1e-9 * np.abs(mine).max(),
                )


def engine_order_load(e: int):
    """(free,) load of order e: in sector j the sector's force turned, with the phase e 2 pi j / N (ahead: a pattern
    that stands in space is met by sector j + 1 before sector j when the rotor turns in the + direction)."""
    local = sector_force()
    out = np.zeros((ring().mesh.n_points, 3), dtype=complex)
    for j, nodes in enumerate(ring().nodes):
        np.add.at(out, nodes, (local @ ring().turns[j].T) * np.exp(2j * np.pi * e * j / 6))
    return out.reshape(-1)[whole().free]


def sector_force():
    """(n, 3) N: a unit force spread over the front of the sector."""
    from microslip.fem.discretise import face_blocks
    from microslip.fem.loads import traction

    blocks = face_blocks(sector(), "front")
    area = sum(np.linalg.norm(b.area, axis=2).sum() for b in blocks)
    return traction(blocks, sector().n_points, np.array(FORCE) / np.linalg.norm(FORCE) / area)


@pytest.mark.parametrize("e", range(9))
def test_forced_response_to_engine_orders(e):
    """Amplitude and phase at the tips of all sectors, orders below and above N/2 (k = e mod N, or the conjugate of
    N - e mod N), near a resonance and between; the modes left out are added by their static compliance."""
    k = e % 6
    k, forward = (k, False) if k <= 3 else (6 - k, True)
    group = basis().groups[0, k]
    eta, full = 0.02, whole()
    T, F = group.monitors["tip"].rows, group.excitations["gas"].rows
    C = group.compliance
    labels = list(C.labels)
    tip, gas = [labels.index(f"monitor:tip:u_{c}") for c in "xyz"], labels.index("excitation:gas:force")
    static = C.residual[tip, gas]
    if forward:
        T, F, static = T.conj(), F.conj(), static.conj()
    place = tip_of(sector())
    for Omega in (0.05 * group.omega[0], 0.999 * group.omega[0], 0.5 * (group.omega[0] + group.omega[1])):
        q = (F.conj().T @ np.ones(1)) / ((1 + 1j * eta) * group.omega**2 - Omega**2)
        mine = T @ q + static / (1 + 1j * eta)
        u = np.zeros(3 * ring().mesh.n_points, dtype=complex)
        u[full.free] = rings.response(full, engine_order_load(e), Omega, eta)
        u = u.reshape(-1, 3)
        exact = u[ring().nodes[0][place]]
        left_out = (Omega / group.omega[-1]) ** 2  # dynamic part of the modes left out over their static one
        scale = np.abs(exact).max() * 1e-9 + left_out * np.abs(static).max() * 1.05
        np.testing.assert_allclose(mine, exact, atol=scale)
        for j in range(6):
            phase = np.exp(2j * np.pi * e * j / 6)
            np.testing.assert_allclose(
                u[ring().nodes[j][place]], ring().turns[j] @ exact * phase, atol=1e-8 * np.abs(exact).max()
            )


def test_static_compliance_at_every_nodal_diameter():
    """Unit forces on a row in all sectors, turned and shifted in phase: what all rows of sector 0 read on the ring."""
    from microslip.modal.body_rows import body_rows

    described = settings(6, sector())
    B, labels = body_rows(sector(), described).stacked
    full = whole()
    lu = sp.linalg.splu(full.K.tocsc())
    for k, group in groups():
        load = np.zeros((ring().mesh.n_points, 3, len(labels)), dtype=complex)
        unit = np.asarray(B.todense()).T.reshape(-1, 3, len(labels))
        for j, nodes in enumerate(ring().nodes):
            turned = np.einsum("ab,nbr->nar", ring().turns[j], unit)
            np.add.at(load, nodes, turned * np.exp(2j * np.pi * k * j / 6))
        flat = load.reshape(-1, len(labels))[full.free]
        u = np.zeros((3 * ring().mesh.n_points, len(labels)), dtype=complex)
        u[full.free] = lu.solve(flat.real) + 1j * lu.solve(flat.imag)
        first = u.reshape(-1, 3, len(labels))[ring().nodes[0]].reshape(-1, len(labels))
        exact = B @ first
        assert group.compliance.labels == labels
        size = np.sqrt(np.abs(np.outer(exact.diagonal(), exact.diagonal())))
        assert (np.abs(group.compliance.static - exact) / size).max() < 1e-8
        np.testing.assert_allclose(group.compliance.static, group.compliance.static.conj().T, atol=0, rtol=1e-12)


# ---------------------------------------------------------------- Coriolis


def test_gyroscopic_matrix_of_every_nodal_diameter():
    """G_r is the ring's, on the expanded shapes, per sector: skew-Hermitian."""
    full = whole()
    for k, group in groups():
        x = on_ring(group.phi, k)
        exact = x.conj().T @ (full.G @ x) / 6
        np.testing.assert_allclose(group.G_r, exact, atol=1e-9 * np.abs(exact).max())


@cache
def ring_waves(k: int):
    """(30,) signed frequencies of the ring's quadratic problem (K + i w G - w^2 M) u = 0 at a nodal diameter."""
    K, M, G, _ = whole().fourier(ring(), k)
    return np.sort(rings.whirl(K, M, G, 30)[0])


@pytest.mark.parametrize("k", [1, 2, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 3))])
def test_forward_and_backward_waves_against_the_ring(k):
    """All degrees of freedom of the ring with Coriolis forces against 12 modes of the sector: within the error that is
    stated beside them, which is useful (1e-3 and less for the first ones), and labelled by the sign of w."""
    group = basis().groups[0, k]
    waves, exact = group.gyroscopic, ring_waves(k)
    some = np.argsort(np.abs(waves.omega))[: 12 if 0 < k < 3 else 6]
    for i in some:
        w = waves.omega[i]
        candidates = exact if 0 < k < 3 else exact[exact > 0]
        right = candidates[np.abs(candidates - w).argmin()]
        assert abs(w / right - 1) < waves.error[i] + 1e-9
        if 0 < k < 3:
            assert waves.direction[i] == ("backward" if w > 0 else "forward")
    assert waves.error[some[:3]].max() < 1e-3
    assert waves.stable


def test_coriolis_waves_converge_to_the_rings():
    """200 of 384 modes leave 1e-6 of the frequencies; the split of the first pair is 1e-3 of it at k = 1."""
    cyclic = {"sectors": 6, "nodal_diameters": [1]}
    waves = modal_basis(sector(), settings(6, sector(), modes={"count": 200}, cyclic=cyclic)).groups[0, 1].gyroscopic
    first = np.sort(waves.omega[np.argsort(np.abs(waves.omega))[:10]])
    exact = ring_waves(1)
    exact = np.sort(exact[np.argsort(np.abs(exact))[:10]])
    np.testing.assert_allclose(first, exact, rtol=1e-6)
    backward, forward = exact[exact > 0].min(), -exact[exact < 0].max()
    assert abs(backward / forward - 1) > 5e-4
    np.testing.assert_allclose(first[first > 0].min() - -first[first < 0].max(), backward - forward, rtol=1e-3)


# ---------------------------------------------------------------- neighbours in contact


@cache
def coupled_ring(stiffness: float):
    """K of the ring with springs (N/m, all directions) between the mean motions of facing contacts."""
    full = whole()
    n = 3 * ring().mesh.n_points
    K = sp.csr_matrix((n, n))
    for j in range(6):
        right, left = sector_patch(j, "contact_right"), sector_patch((j + 1) % 6, "contact_left")
        gap = right.rotation.T @ right.B[:3] - left.rotation.T @ left.B[:3]
        K = K + stiffness * (gap.T @ gap)
    return full.K + sp.csr_matrix(K)[full.free][:, full.free]


def coupled_errors(reduction: str, count: int, stiffness: float):
    """(4, 4) relative error of the first four frequencies at each nodal diameter, neighbours joined by springs."""
    K, full, turn = coupled_ring(stiffness), whole(), ring().turns[1]
    described = settings(6, sector(), reduction=reduction, modes={"count": count}, rotation=PLAIN)
    found = modal_basis(sector(), described)
    errors = []
    for k in range(4):
        group = found.groups[0, k]
        right, left = group.interfaces["right"], group.interfaces["left"]
        neighbour = np.exp(2j * np.pi * k / 6) * turn
        gap = right.rotation.T @ right.rows[:3] - neighbour @ left.rotation.T @ left.rows[:3]
        mine = scipy.linalg.eigh(group.K_r + stiffness * gap.conj().T @ gap, group.M_r, eigvals_only=True)
        U, _ = ring().fourier(k, full.free)
        exact = rings.spectrum(*((U.conj().T @ A @ U).toarray() for A in (K, full.M)), 4)
        errors.append(np.sqrt(mine[:4]) / exact - 1)
    return np.array(errors)


@pytest.mark.parametrize(
    ("reduction", "few", "many"),
    [
        pytest.param("eigenmodes", 4e-2, 3e-3, marks=pytest.mark.slow),
        ("rubin", 1e-5, 1e-9),
        pytest.param("craig-bampton", 4e-3, 2e-4, marks=pytest.mark.slow),
    ],
)
def test_neighbours_in_contact_couple_at_every_nodal_diameter(reduction, few, many):
    """Springs (1e9 N/m) between the mean motion of right and of the next sector's left: reduced sectors are Ritz
    bodies of the ring, so they err upwards. They converge with the modes kept, by the frequency ratio to the power 2
    (eigenmodes, Craig-Bampton) or 4 and more (Rubin); measured 2.9e-2, 5.8e-6, 3.0e-3 with 12, 2.0e-3, 5.2e-10, 9.7e-5
    with 48."""
    with_few, with_many = (coupled_errors(reduction, count, 1e9) for count in (12, 48))
    assert min(with_few.min(), with_many.min()) > -1e-10
    assert with_few.max() < few
    assert with_many.max() < many


# ---------------------------------------------------------------- what is asked for


def test_cut_faces_of_any_name():
    """They are in the basis for whoever expands it."""
    mesh = sector()
    faces = {{"cyclic_left": "a", "cyclic_right": "b"}.get(name, name): f for name, f in mesh.faces.items()}
    cyclic = {"sectors": 6, "left": "a", "right": "b", "nodal_diameters": [1]}
    found = modal_basis(replace(mesh, faces=faces), settings(6, mesh, cyclic=cyclic))
    assert found.cyclic_faces == ("a", "b")
    np.testing.assert_allclose(found.groups[0, 1].omega, basis().groups[0, 1].omega, rtol=1e-10)


def test_nodal_diameters_asked_for():
    """Only those are solved, each as among all of them."""
    found = modal_basis(sector(), settings(6, sector(), cyclic={"sectors": 6, "nodal_diameters": [2, 0]}))
    assert sorted(found.groups) == [(0, 0), (0, 2)]
    for k in (0, 2):
        np.testing.assert_allclose(found.groups[0, k].omega, basis().groups[0, k].omega, rtol=1e-10)


def with_line():
    """The sector with the set ``line``: nodes of the bore on one parallel to the axis."""
    mesh, bore = sector(), sector().face_points("bore")
    angle = np.arctan2(mesh.points[bore, 0], mesh.points[bore, 2])
    return with_sets(mesh, line=bore[np.abs(angle - np.median(angle)) < 1e-6])


def test_a_ring_held_where_its_sector_alone_could_turn():
    """A line of nodes in each sector: alone it turns about the line, six of them hold the disc."""
    mesh = with_line()
    whole_ring = rings.full_ring(mesh, 6)
    line = np.unique(whole_ring.nodes[:, mesh.point_sets["line"]])
    held = body(supports=[{"face": "line"}])
    full = rings.matrices(with_sets(whole_ring.mesh, line=line), held)
    found = modal_basis(mesh, settings(6, mesh, rpm=0.0, supports=[{"face": "line"}]))
    for k in range(4):
        K, M, _, _ = full.fourier(whole_ring, k)
        np.testing.assert_allclose(found.groups[0, k].omega[:8], rings.spectrum(K, M, 8), rtol=1e-9)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"loads": [{"kind": "gravity", "vector": [0.0, -9.81, 1.0]}]}, "loads.0.vector: gravity across"),
        ({"loads": [{"kind": "pressure", "face": "cyclic_left", "value": 1.0}]}, "loads.0.face: "),
        ({"interfaces": [{"name": "c", "face": "cyclic_right"}]}, "interfaces.c.face: "),
        ({"excitations": [{"name": "e", "face": "cyclic_left", "pressure": True}]}, "excitations.e.face: "),
    ],
)
def test_what_a_sector_cannot_say_of_its_ring_is_refused(wrong, sentence):
    refused(sentence, modal_basis, sector(), settings(6, sector(), **wrong))


def test_gravity_along_the_axis_bends_all_sectors_alike():
    load = {"kind": "gravity", "vector": [0.0, 9.81e4, 0.0]}
    held = body(supports=[{"face": "bore"}], loads=[load], rotation={"prestress": "nonlinear"})
    u = rings.matrices(ring().mesh, held).state.u[ring().nodes[0]]
    found = modal_basis(sector(), settings(6, sector(), rpm=0.0, loads=[load])).groups[0, 2]
    np.testing.assert_allclose(found.u_static, u, atol=1e-8 * np.abs(u).max())


def test_nearly_all_modes():
    """As many as ARPACK has no room for, at complex nodal diameters."""
    cyclic = {"sectors": 6, "nodal_diameters": [1]}  # 384 unknowns
    described = settings(6, sector(), modes={"count": 380}, cyclic=cyclic, rotation=PLAIN)
    found = modal_basis(sector(), described).groups[0, 1]
    np.testing.assert_allclose(found.omega[:COUNT], basis().groups[0, 1].omega[:COUNT], rtol=1e-9)


def flipped() -> Mesh:
    """A box of five ten-node tetrahedra: over the nodes of its two cut faces lie opposite diagonals."""
    corners = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)], dtype=float)
    tets = np.array([[0, 3, 5, 6], [1, 0, 3, 5], [2, 0, 3, 6], [4, 0, 5, 6], [7, 3, 5, 6]])
    inside_out = np.linalg.det(corners[tets[:, 1:]] - corners[tets[:, :1]]) < 0
    tets[inside_out] = tets[inside_out][:, [0, 2, 1, 3]]
    ends = np.sort(tets[:, [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]].reshape(-1, 2), axis=1)
    edges, middle = np.unique(ends, axis=0, return_inverse=True)
    box = np.vstack([corners, corners[edges].mean(axis=1)])
    angle, r = 2 * np.pi / 12 * (box[:, 0] - 0.5), 0.1 + 0.05 * box[:, 2]
    points = np.column_stack([r * np.sin(angle), 0.03 * box[:, 1], r * np.cos(angle)])
    mesh = Mesh(points, {"tetra10": np.hstack([tets, 8 + middle.reshape(-1, 6)])}, {}, {}, np.arange(1, 27))
    faces = {}
    for name, axis, value in (("cyclic_left", 0, 0), ("cyclic_right", 0, 1), ("bore", 2, 0)):
        on = box[:, axis] == value
        faces[name] = {t: f[on[f].all(axis=1)] for t, f in boundary_facets(mesh).items()}
    return replace(mesh, faces=faces)


def test_faces_that_do_not_match_and_rings_that_nothing_holds_are_refused():
    """Another number of sectors, a point pushed off its face by a cell, other facets over nodes that meet; and supports
    along the axis alone."""
    mesh = sector()
    points = mesh.points.copy()
    points[mesh.face_points("cyclic_right")] += [2e-3, 0.0, -2e-3]
    refused("cyclic", modal_basis, mesh, settings(7, mesh))
    refused("cyclic", modal_basis, replace(mesh, points=points), settings(6, mesh))
    twelve = body(supports=[{"face": "bore"}], cyclic={"sectors": 12}, modes={"count": 4})
    refused(("cyclic: the nodes ", "meet, but not their facets"), modal_basis, flipped(), twelve)
    sliding = settings(6, mesh, supports=[{"face": "bore", "directions": "y"}])
    refused(("nothing holds the body against", "rotation about y"), modal_basis, mesh, sliding)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"axis": np.array([1.0, 0.0, 0.0])}, ("not turned about this axis", "rotation.axis")),
        ({"point": np.array([0.01, 0.0, 0.0])}, ("not turned about this axis", "rotation.point")),
        ({"sectors": 7}, "makes 6 sectors, not 7"),
    ],
)
def test_a_wrong_axis_is_told_from_faces_that_do_not_match(change, words):
    given = {"axis": rings.AXIS, "point": np.zeros(3), "sectors": 6} | change
    refused(words, pair_cut_faces, sector(), "cyclic_left", "cyclic_right", **given)


JOINED = {"speeds_rpm": [3000.0], "prestress": "nonlinear", "gyroscopic": False}


@cache
def joined_ring() -> np.ndarray:
    """Frequencies of a full ring whose shrouds are six contacts of one body, closed in its modes."""
    mesh = rings.full_ring(rings.bladed_sector(gap=0.0), 6).mesh
    closures = [
        {"name": f"c{j}", "face": f"contact_right_{j}", "against": f"contact_left_{(j + 1) % 6}", "modes": "closed",
         "interference": 1e-4}
        for j in range(6)
    ]  # fmt: skip
    described = {"supports": [{"face": "bore"}], "rotation": JOINED, "closures": closures, "modes": {"count": 24}}
    return modal_basis(mesh, body(**described)).groups[0, 0].frequency


def joined(side: str = "right", **more):
    other, shift = ("left", 1) if side == "right" else ("right", -1)
    closure = {"name": "c", "face": f"contact_{side}", "against": f"contact_{other}", "sector_shift": shift}
    described = {
        "supports": [{"face": "bore"}], "rotation": JOINED, "cyclic": {"sectors": 6}, "modes": {"count": 6},
        "closures": [{**closure, "modes": "closed", "interference": 1e-4}],
    }  # fmt: skip
    return modal_basis(rings.bladed_sector(gap=0.0), body(**(described | more)))


@cache
def shut():
    """A sector with closed shrouds; for reading only."""
    return joined()


def of_the_ring(basis) -> np.ndarray:
    every = [np.repeat(g.frequency[:6], 1 if k in (0, 3) else 2) for (_, k), g in basis.groups.items()]
    return np.sort(np.concatenate(every))


@pytest.mark.parametrize("backend", ["auto", pytest.param("superlu", marks=pytest.mark.slow)])
def test_shrouds_that_stay_closed_couple_the_sectors_as_they_do_the_ring(backend):
    """The contact's stiffness between neighbours, with its phase, against six contacts within one body.

    Newton ends at 1e-9 of the displacement in either; the sixth mode of a sector limits what can be compared.
    """
    basis = shut() if backend == "auto" else joined(modes={"count": 6, "solver": backend})
    frequency, exact = of_the_ring(basis), joined_ring()
    np.testing.assert_allclose(frequency[:20], exact[:20], rtol=1e-7)
    opened = of_the_ring(joined(closures=[]))
    assert (exact[:6] > 1.02 * opened[:6]).all()
    assert all(g.checks["certified"] and g.checks["backward_error"] < 1e-12 for g in basis.groups.values())
    assert {g.contacts["c"].modes for g in basis.groups.values()} == {"closed"}


def test_either_side_may_press_on_the_other():
    """Pressing left on right gives the pressures to other nodes: the same ring to what the mesh knows of an edge."""
    one, other = shut(), joined("left")
    for key, g in one.groups.items():
        np.testing.assert_allclose(other.groups[key].frequency[:3], g.frequency[:3], rtol=0.03)


@pytest.mark.parametrize("method", [pytest.param("rubin", marks=pytest.mark.slow), "craig-bampton"])
def test_reductions_keep_the_coupling_of_closed_shrouds(method):
    interface = {"name": "top", "face": "top", "t2": [0.0, 1.0, 0.0]}
    exact = shut()
    reduced = joined(reduction=method, interfaces=[interface], modes={"count": 12})
    for key, g in exact.groups.items():
        static = reduced.groups[key].compliance
        assert abs(static.residual[:3, :3]).max() < 1e-8 * abs(static.static[:3, :3]).max()
        np.testing.assert_allclose(reduced.groups[key].frequency[:2], g.frequency[:2], rtol=1e-3)


def test_what_is_left_is_that_of_all_speeds_and_nodal_diameters() -> None:
    """Whatever is said of a part begins with how much of the whole is done, which never falls."""
    told: list[str] = []
    own = sector_of_tests.settings(6).model_dump(exclude_unset=True)
    own["rotation"] |= {"speeds_rpm": [0.0, 600.0]}
    modal_basis(sector_of_tests.mesh(divisions=(2, 1, 1)), BodySettings.model_validate(own), report=told.append)
    counted = [text for text in told if "nodal diameters at all speeds | " in text]
    done = [int(text.split(" of 8 ")[0]) for text in counted]
    assert done == sorted(done) and {0, 1, 4, 5, 8} <= {*done} and counted[0].endswith("speed 1 of 2: 0 rpm")
    assert not [text for text in told[told.index(counted[0]) :] if text not in counted]
    assert any(text.startswith("5 of 8 ") and text.endswith("eigenmodes: nodal diameter 1") for text in counted)

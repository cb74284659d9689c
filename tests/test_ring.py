"""The whole ring from one sector: against the ring's own dense matrices, roots of unity, and what a person gets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import sector
from hypothesis import given
from hypothesis import strategies as st
from refusals import refused, refused_command

from microslip.basis import check_basis, read_basis, write_basis
from microslip.data import Array, ModalBasis
from microslip.ring.expansion import (
    aliased,
    certify_ring,
    exciting,
    expand,
    multiplicity,
    replicate,
    ring_checks,
    ring_of,
    rotation,
    standing,
    tied_points,
)
from microslip.ring.resonances import families, margins, resonance_csv, resonances, tracks, unanswered, zigzag

# --- engine orders and nodal diameters -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("order", "wanted"),
    [
        (0, (0, "standing")), (1, (1, "backward")), (11, (11, "backward")), (12, (12, "standing")),
        (13, (11, "forward")), (23, (1, "forward")), (24, (0, "standing")), (25, (1, "backward")),
        (35, (11, "backward")), (36, (12, "standing")), (37, (11, "forward")), (48, (0, "standing")),
    ],
)  # fmt: skip
def test_engine_orders_on_24_blades(order: int, wanted: tuple[int, str]) -> None:
    assert aliased(order, 24) == wanted


def test_harmonics_of_an_engine_order_alias_anew() -> None:
    assert [aliased(5, 24, h) for h in (1, 2, 3, 4, 5)] == [
        (5, "backward"), (10, "backward"), (9, "forward"), (4, "forward"), (1, "backward"),
    ]  # fmt: skip


@given(st.integers(0, 500), st.integers(3, 97))
def test_the_sectors_cannot_tell_an_engine_order_from_its_alias(order: int, sectors: int) -> None:
    """cos(e (theta_j + Omega t)) at the sectors is the wave exp(i e Omega t) exp(+-i k theta_j)."""
    k, direction = aliased(order, sectors)
    theta, turned = 2 * np.pi * np.arange(sectors) / sectors, 0.37
    sign = {"backward": 1, "forward": -1, "standing": 1}[direction]
    wave = np.exp(1j * order * turned) * np.exp(1j * sign * k * theta)
    np.testing.assert_allclose(wave.real, np.cos(order * (theta + turned)), rtol=0, atol=1e-10)
    assert 0 <= k <= sectors // 2


@given(st.integers(0, 100), st.integers(3, 97))
def test_an_engine_order_that_excites_a_nodal_diameter_is_found_by_the_inverse(k: int, sectors: int) -> None:
    k = k % (sectors // 2 + 1)
    found = exciting(k, sectors, 3 * sectors)
    assert len(found) == 3 * multiplicity(k, sectors)  # once or twice in each run of N engine orders
    assert all(aliased(e, sectors) == (k, direction) for e, direction in found)


def test_inverse_for_24_blades() -> None:
    assert exciting(6, 24, 60) == [
        (6, "backward"), (18, "forward"), (30, "backward"), (42, "forward"), (54, "backward"),
    ]  # fmt: skip
    assert exciting(12, 24, 40) == [(12, "standing"), (36, "standing")]


# --- expansion -----------------------------------------------------------------------------------------------------


def ring_matrices(basis: ModalBasis) -> tuple[Array, Array, Array]:
    """Dense K and M of the joined ring on its free degrees of freedom, and the numbers of those."""
    ring = ring_of(basis, shared=True)
    K, M = sector.matrices(ring.mesh)
    held = np.unique(ring.numbers[:, basis.mesh.face_points("bore")])
    free = np.setdiff1d(np.arange(3 * ring.mesh.n_points), (3 * held[:, None] + np.arange(3)).ravel())
    return K[np.ix_(free, free)], M[np.ix_(free, free)], free


@pytest.fixture(scope="module", params=[5, 6])
def ring(request: pytest.FixtureRequest) -> tuple[ModalBasis, Array, Array, Array]:
    basis = sector.basis(request.param)
    return basis, *ring_matrices(basis)


def test_the_ring_has_the_frequencies_of_the_sectors_counted_once_and_twice(ring: tuple) -> None:
    basis, K, M, _ = ring
    found = certify_ring(basis)
    exact = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)) / 2 / np.pi
    assert found.certified and not found.missing
    assert found.count == (exact <= found.limit).sum() == sum(found.counts.values())
    every = np.concatenate(
        [np.repeat(g.frequency, multiplicity(k, basis.sectors)) for (_, k), g in basis.groups.items()]
    )
    every = np.sort(every)[: found.count]
    np.testing.assert_allclose(every, exact[: found.count], rtol=1e-9)  # rounding of a dense eigensolver


def whole(basis: ModalBasis, speed: int = 0) -> tuple[Array, Array]:
    """(ring dofs, modes) all real ring modes on the joined ring, and their omega."""
    numbers, columns, omega = ring_of(basis, shared=True), [], []
    for (s, _), g in basis.groups.items():
        if s == speed:
            for member in zip(*(standing(g, basis, j) for j in range(basis.sectors)), strict=True):
                columns.append(numbers.gather(np.array(member)))
                omega.append(g.omega)
    shapes = np.concatenate(columns, axis=2)
    return shapes.reshape(-1, shapes.shape[2]), np.concatenate(omega)


def test_expanded_modes_are_orthonormal_on_the_ring_and_solve_its_eigenproblem(ring: tuple) -> None:
    basis, K, M, free = ring
    psi, omega = whole(basis)
    assert psi.shape[1] == sum(multiplicity(k, basis.sectors) * g.n_modes for (_, k), g in basis.groups.items())
    psi = psi[free]
    np.testing.assert_allclose(psi.T @ M @ psi, np.eye(len(omega)), rtol=0, atol=1e-10)
    error = np.linalg.norm(K @ psi - M @ psi * omega**2, axis=0) / np.linalg.norm(K @ psi, axis=0)
    assert error.max() < 1e-9  # the sector's eigenvectors are exact to rounding times the condition of K


def test_neighbours_agree_on_their_common_face(ring: tuple) -> None:
    """The right face of sector j is the left face of sector j + 1, for every sector and nodal diameter."""
    basis = ring[0]
    left, right = tied_points(basis.mesh, basis.rotation_axis, basis.rotation_point, basis.sectors, basis.cyclic_faces)
    for g in basis.groups.values():
        for j in range(basis.sectors):
            here, there = expand(g, basis, j)[right], expand(g, basis, j + 1)[left]
            np.testing.assert_allclose(here, there, rtol=0, atol=1e-12 * np.abs(g.phi).max())
    np.testing.assert_array_equal(expand(g, basis, basis.sectors), g.phi)


def test_a_joined_ring_shares_points_and_keeps_its_volume_and_its_other_faces() -> None:
    basis = sector.basis()
    apart, joined = ring_of(basis), ring_of(basis, shared=True, named=True)
    n, common = basis.mesh.n_points, len(basis.mesh.face_points("cyclic_left"))
    assert apart.mesh.n_points == 6 * n
    assert joined.mesh.n_points == 6 * (n - common)
    assert apart.mesh.n_cells == joined.mesh.n_cells == 6 * basis.mesh.n_cells
    for kind, cells in apart.mesh.cells.items():
        np.testing.assert_allclose(apart.mesh.points[cells], joined.mesh.points[joined.mesh.cells[kind]], atol=1e-12)
    assert sorted(joined.mesh.faces) == sorted(f"{f}_{s}" for f in ("bore", "rim", "front", "rear") for s in range(6))


def test_a_wedge_that_reaches_the_axis_shares_its_points_there_with_all_sectors() -> None:
    from meshes import brick

    def wedge(p: Array) -> Array:  # a corner of a bar of square section, about x
        return p

    box = brick("hexahedron", (1, 2, 2), (1.0, 1.0, 1.0), to=wedge)
    faces = {"cyclic_left": box.faces["z0"], "cyclic_right": box.faces["y0"]}
    quarter = replace(box, faces=faces)
    ring = replicate(quarter, np.array([-1.0, 0, 0]), np.zeros(3), 4, ("cyclic_right", "cyclic_left"))
    assert ring.mesh.n_points == 2 * 25  # the lattice of a plate of 4 x 4 squares
    assert len(np.unique(np.round(ring.mesh.points, 9), axis=0)) == 50


def test_the_turn_is_right_handed() -> None:
    np.testing.assert_allclose(rotation(np.array([0.0, 1.0, 0.0]), np.pi / 2) @ [0, 0, 1], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(rotation(np.array([0.0, 1.0, 0.0]), 0.3), sector.turn_y(0.3), atol=1e-15)


# --- certificate ---------------------------------------------------------------------------------------------------


def test_a_missing_nodal_diameter_is_told() -> None:
    found = certify_ring(sector.basis(6, harmonics=(0, 2)))
    assert found.missing == (1, 3) and not found.certified
    assert "without the nodal diameters 1, 3" in ring_checks(sector.basis(6, harmonics=(0, 2)))[-1].message


def test_without_certified_groups_nothing_is_proved() -> None:
    basis = sector.basis()
    open_end = {k: replace(g, checks={**g.checks, "certified": 0.0}) for k, g in basis.groups.items()}
    found = certify_ring(replace(basis, groups=open_end))
    assert (found.limit, found.count, found.certified) == (0.0, 0, False)


def test_fewer_kept_modes_than_counted_lower_the_proved_limit() -> None:
    basis = sector.basis()
    g = basis.groups[0, 1]
    cut = replace(g, checks={**g.checks, "count_below_upper_shift": 7.0})
    found = certify_ring(replace(basis, groups={**basis.groups, (0, 1): cut}))
    assert found.limit == min(g.frequency[-1], *(h.checks["upper_shift_hz"] for h in basis.groups.values()))


def test_a_wrong_phase_and_a_wrong_scale_are_found() -> None:
    basis = sector.basis()
    assert all(c.passed for c in [*check_basis(basis), *ring_checks(basis)])
    g = basis.groups[0, 1]
    for spoilt, name in ((g.phi.conj(), "phase rule"), (1.001 * g.phi, "orthonormal")):
        wrong = replace(basis, groups={**basis.groups, (0, 1): replace(g, phi=spoilt)})
        assert [c.name for c in ring_checks(wrong) if not c.passed and name in c.name], name


def test_faces_that_do_not_meet_are_refused() -> None:
    basis = sector.basis()
    mesh, where = basis.mesh, (basis.rotation_axis, basis.rotation_point)
    refused("does not meet 'cyclic_right'", tied_points, mesh, *where, 7, basis.cyclic_faces)
    refused("no face 'nowhere'", tied_points, mesh, *where, 6, ("cyclic_left", "nowhere"))


def test_the_file_keeps_the_names_of_the_cyclic_faces(tmp_path) -> None:
    basis = replace(sector.basis(), cyclic_faces=("front", "rear"))
    write_basis(tmp_path / "b.h5", basis)
    assert read_basis(tmp_path / "b.h5").cyclic_faces == ("front", "rear")
    assert np.isnan(certify_ring(basis).phase_rule)  # these do not match: nothing to hold the shapes against


# --- resonances ----------------------------------------------------------------------------------------------------


def chain(sectors: int, blade: float, coupling: float, mass: float, rpm: tuple[float, ...]) -> ModalBasis:
    """A ring of oscillators: mass on a spring to the ground, coupled to its neighbours; one mode a nodal diameter.

    In closed form omega_k^2 = (k_b + 2 k_c (1 - cos(2 pi k / N))) / m, at every speed.
    """
    template = sector.basis()
    one = template.groups[0, 0]
    groups = {}
    for k in range(sectors // 2 + 1):
        omega = np.sqrt((blade + 2 * coupling * (1 - np.cos(2 * np.pi * k / sectors))) / mass)
        for s, speed in enumerate(rpm):
            groups[s, k] = replace(
                one, speed=speed * np.pi / 30, omega=np.array([omega]), kind=("normal",), damping_ratio=np.zeros(1),
                phi=np.zeros((0, 3, 1)), harmonic=k,
            )  # fmt: skip
    return replace(template, groups=groups, sectors=sectors)


def closed_form(sectors: int, k: int, blade: float, coupling: float, mass: float) -> float:
    return np.sqrt((blade + 2 * coupling * (1 - np.cos(2 * np.pi * k / sectors))) / mass) / (2 * np.pi)


@given(
    st.integers(3, 40), st.floats(1e4, 1e6), st.floats(0.0, 1e6), st.floats(0.1, 10.0),
    st.lists(st.integers(1, 90), min_size=1, max_size=6, unique=True),
)  # fmt: skip
def test_an_engine_order_meets_only_the_nodal_diameter_it_aliases_onto(
    sectors: int, blade: float, coupling: float, mass: float, orders: list[int]
) -> None:
    """On a ring of oscillators the critical speeds are 60 f_k / e with k = aliased(e), and there are no others."""
    wanted = {e: 60 * closed_form(sectors, aliased(e, sectors)[0], blade, coupling, mass) / e for e in orders}
    basis = chain(sectors, blade, coupling, mass, (0.0, 1.01 * max(wanted.values())))
    found = resonances(basis, orders)
    assert sorted(r.order for r in found) == sorted(orders)
    for r in found:
        assert r.speed * 30 / np.pi == pytest.approx(wanted[r.order], rel=1e-9)
        assert r.frequency == pytest.approx(r.order * r.speed / (2 * np.pi), rel=1e-12)
        assert (r.nodal_diameter, r.direction) == aliased(r.order, sectors)
        assert (r.family, r.mode) == (1, 1)
    assert [r.speed for r in found] == sorted(r.speed for r in found)


def test_margins_vanish_at_the_critical_speed_and_change_sign_there() -> None:
    critical = 60 * closed_form(24, 6, 1e5, 3e4, 0.3) / 18
    basis = chain(24, 1e5, 3e4, 0.3, (0.5 * critical, critical, 2 * critical))
    found = [margins(basis, s, [18])[0] for s in range(3)]
    np.testing.assert_allclose([m.relative for m in found], [1.0, 0.0, -0.5], atol=1e-12)
    assert {(m.nodal_diameter, m.direction, m.family) for m in found} == {(6, "forward", 1)}
    assert margins(basis, 0, [18], within=0.9) == [] and len(margins(basis, 0, [18], within=1.1)) == 1


def test_the_excitation_line_passes_every_engine_order_at_its_nodal_diameter() -> None:
    for sectors in (5, 24):
        corners, hertz = zigzag(sectors, 20.0, 1500.0)
        assert hertz[-1] >= 1500.0 and corners[0] == hertz[0] == 0.0
        for e in range(1, int(hertz[-1] / 20.0) + 1):
            assert np.interp(20.0 * e, hertz, corners) == pytest.approx(aliased(e, sectors)[0], abs=1e-9)
    assert len(zigzag(24, 0.0, 1000.0)[0]) == 1


def test_families_follow_the_shapes_where_the_frequencies_cross() -> None:
    """Two families that change places between k = 1 and k = 2 keep their shapes."""
    basis = sector.basis()
    swapped = {}
    for k in range(4):
        g = basis.groups[0, 1]
        order = [1, 0, 2, 3, 4] if k >= 2 else [0, 1, 2, 3, 4]
        swapped[0, k] = replace(g, phi=g.phi[:, :, order] * np.exp(1j * k), harmonic=k)
    found = families(replace(basis, groups=swapped))
    assert found.modes[:2].tolist() == [[0, 0, 1, 1], [1, 1, 0, 0]]
    assert found.of(3, 0) == 1 and found.of(0, 0) == 0
    np.testing.assert_allclose(found.mac, 1.0)


def test_orders_without_their_nodal_diameter_and_the_table() -> None:
    basis = sector.basis(6, rpm=(0.0, 60000.0), harmonics=(0, 1))
    assert unanswered(basis, [1, 2, 3, 5, 6]) == [2, 3]
    found = resonances(basis, [1, 2, 3, 5, 6])
    assert {r.order for r in found} <= {1, 5, 6} and found
    table = resonance_csv(found).splitlines()
    assert table[0].startswith("rpm,Hz,engine order,nodal diameter,wave on the rotor")
    assert len(table) == len(found) + 1
    rpm, hertz, order = (float(v) for v in table[1].split(",")[:3])
    assert hertz == pytest.approx(order * rpm / 60, rel=1e-3)  # both are rounded in the table


def test_a_campbell_diagram_of_one_nodal_diameter_holds_only_its_modes() -> None:
    basis = sector.basis(6, rpm=(0.0, 5000.0))
    curves = tracks(basis)
    assert sorted(curves) == [0, 1, 2, 3]
    for k, t in curves.items():
        np.testing.assert_allclose(np.sort(t.omega, axis=0), np.array([basis.groups[s, k].omega for s in (0, 1)]).T)


# --- pictures ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_every_picture_of_a_cyclic_sector(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The diagrams and the ring are drawn, are not blank and do not run over their edges."""
    pytest.importorskip("matplotlib")
    image = pytest.importorskip("PIL.Image")
    from microslip import pictures

    monkeypatch.setattr(pictures, "WAVES", 1)
    monkeypatch.setattr(pictures, "ANIMATED", 1)
    reason = pictures.can_draw()
    basis = sector.basis(6, 3, rpm=(0.0, 60000.0))
    found = pictures.draw_all(basis, tmp_path, engine_orders=(1, 2, 5, 6), scenes=reason is None)
    wanted = {"nodal_diameters", "safe", "campbell", "compliance"}
    if reason is None:
        wanted |= {"ring_modes_0rpm", "ring_wave_nd01", "mesh", "modes_0rpm", "animation_01"}
    assert wanted <= set(found)
    for name, path in found.items():
        with image.open(path) as opened:
            pixels = np.asarray(opened.convert("RGB"))
        assert min(pixels.shape[:2]) > 100 and max(pixels.shape[:2]) < 4000, name
        assert 0.01 < (pixels.min(axis=2) < 240).mean() < 0.9, f"{name} is empty or has no white"
        border = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
        assert (border > 240).mean() > 0.97, f"{name} runs over its edge"


def test_a_body_that_does_not_turn_has_no_interference_diagram(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from microslip import pictures

    found = pictures.draw_all(sector.basis(6), tmp_path, engine_orders=(1,), scenes=False)
    assert "nodal_diameters" in found and "safe" not in found and "campbell" not in found


def test_the_drawn_wave_is_the_expanded_shape() -> None:
    pytest.importorskip("pyvista")
    from microslip.pictures import ring_views, scene

    basis = sector.basis(6)
    outside = scene.surface(basis.mesh)
    ring = ring_views.RingStudio(basis, None, outside, outside.triangles, np.eye(3), 1.0)  # type: ignore[arg-type]
    for k, g in ((k, g) for (_, k), g in basis.groups.items()):
        moved = ring_views.wave(ring, g, 1).reshape(6, -1, 3)
        for j in range(6):
            np.testing.assert_allclose(moved[j], expand(g, basis, j)[outside.source, :, 1], atol=1e-12, err_msg=str(k))


def test_a_coarse_surface_has_a_quarter_of_the_triangles_of_ten_node_cells() -> None:
    pytest.importorskip("pyvista")
    from meshes import brick

    from microslip.pictures import scene

    mesh = brick("tetra10", (2, 2, 2))
    fine, coarse = scene.surface(mesh), scene.surface(mesh, coarse=True)
    assert len(fine.triangles) == 4 * len(coarse.triangles)
    areas = [
        np.linalg.norm(scene.triangle_normals(mesh.points[s.source], s.triangles), axis=1).sum() for s in (fine, coarse)
    ]
    assert areas[0] == pytest.approx(areas[1], rel=1e-12)


def test_only_eigenmodes_enter_the_diagrams() -> None:
    """Static modes that a reduction adds have a Ritz frequency, which is no frequency of the body."""
    basis = sector.basis(6, rpm=(0.0, 60000.0))
    kind = ("normal",) * 3 + ("attachment",) * 2
    mixed = replace(basis, groups={key: replace(g, kind=kind) for key, g in basis.groups.items()})
    assert families(mixed, 1).modes.max() == 2
    assert all(t.modes.max() == 2 for t in tracks(mixed).values())
    assert len(margins(mixed, 1, [1])) == 3


# --- files, report, command line -----------------------------------------------------------------------------------


def test_matlab_gets_complex_arrays_and_loads_by_the_conjugate_transpose(tmp_path: Path) -> None:
    from scipy.io import loadmat

    from microslip.exchange.mat import write_mat

    basis = sector.basis()
    write_mat(basis, tmp_path / "b.mat")
    read = loadmat(tmp_path / "b.mat")
    for (s, k), g in basis.groups.items():
        found = read[f"speed_{s}" + (f"_nd_{k}" if k else "")]
        for name, value in (("phi", g.phi), ("K", g.K_r), ("G", g.G_r)):
            np.testing.assert_array_equal(found[name][0, 0], value)
            assert found[name][0, 0].dtype == value.dtype
        np.testing.assert_array_equal(found["Fex1"][0, 0], g.excitations["gas"].rows.conj().T)
        np.testing.assert_array_equal(found["interfaces"][0, 0]["rim"][0, 0]["T"][0, 0], g.interfaces["rim"].rows)
        np.testing.assert_array_equal(found["compliance"][0, 0]["static"][0, 0], g.compliance.static)
    assert read["cyclic"]["sectors"][0, 0][0, 0] == 6


def test_the_sector_in_vtu_has_both_parts_of_complex_shapes(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    from microslip.exchange.vtu import mode_label, write_vtu

    basis = sector.basis()
    write_vtu(basis, tmp_path / "b.vtu")
    data = meshio.read(tmp_path / "b.vtu").point_data
    g = basis.groups[0, 1]
    found = data[f"nd1_mode_{mode_label(g, 0)}_real"] + 1j * data[f"nd1_mode_{mode_label(g, 0)}_imag"]
    np.testing.assert_allclose(found, g.phi[:, :, 0], atol=1e-6 * np.abs(g.phi).max())
    assert f"nd0_mode_{mode_label(basis.groups[0, 0], 0)}" in data


def test_the_ring_in_vtu_is_the_expanded_surface(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    import xml.etree.ElementTree as ET

    from microslip.exchange.vtu import write_ring

    basis = sector.basis(6, rpm=(0.0, 60000.0))
    assert write_ring(basis, tmp_path / "ring.pvd", speed=1) == tmp_path / "ring.pvd"
    sets = ET.parse(tmp_path / "ring.pvd").getroot().findall("Collection/DataSet")
    assert [(float(d.get("timestep")), d.get("file")) for d in sets] == [(k, f"ring_nd{k:02d}.vtu") for k in range(4)]
    table = np.genfromtxt(tmp_path / "ring.csv", delimiter=",", skip_header=1)
    assert len(table) == 20 and set(table[:, 0]) == {60000.0}
    assert table[:, 4].sum() == 5 + 10 + 10 + 5
    ring = ring_of(basis)
    where = {tuple(np.round(p, 9)): i for i, p in enumerate(ring.mesh.points[: basis.mesh.n_points])}
    for k in range(4):
        g = basis.groups[1, k]
        read = meshio.read(tmp_path / f"ring_nd{k:02d}.vtu")
        assert {c.type for c in read.cells} == {"quad8"}
        n = len(read.points) // 6
        own = [where[tuple(np.round(p, 9))] for p in read.points[:n]]
        scale = np.sqrt(multiplicity(k, 6) / 6)
        for j in range(6):
            wanted = scale * expand(g, basis, j)[own, :, 2]
            part = slice(j * n, (j + 1) * n)
            found = read.point_data["mode_03_real"][part] + 1j * read.point_data["mode_03_imag"][part]
            np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(g.phi).max())
    cells = sum(len(c.data) for c in read.cells)
    assert cells == 6 * (2 * 3 * 2 + 2 * 2 * 1)  # front and rear, bore and rim; the cuts lie inside


def test_the_ring_of_a_body_that_is_none_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("meshio")
    import small

    from microslip.exchange.vtu import write_ring

    refused("not cyclic", write_ring, small.basis(), tmp_path / "r.pvd")
    refused("count from 0", write_ring, sector.basis(), tmp_path / "r.pvd", speed=1)
    without = {k: replace(g, phi=np.zeros((0, 3, 5))) for k, g in sector.basis().groups.items()}
    refused("no shapes", write_ring, replace(sector.basis(), groups=without), tmp_path / "r.pvd")
    assert not list(tmp_path.iterdir())


def said(page: str) -> str:
    """The words of a page."""
    import html
    import re

    body = re.sub(r"<style>.*?</style>", "", page, flags=re.S)
    return html.unescape(re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", body))).replace("\xa0", " ")


def test_the_report_of_a_cyclic_sector() -> None:
    """Its ring, its waves, its resonances; and engine orders that the file cannot answer."""
    from microslip.report.body import report_html

    basis = sector.basis(6, rpm=(0.0, 60000.0))
    words, found = said(report_html(basis, {})), resonances(basis, [1, 2, 5, 6])
    for part in (
        "one of 6 alike round the axis", "nodal diameters 0 to 3", "5 modes each from 2360.3 Hz at each of 2 speeds",
        "k = 0 k = 1 k = 2 k = 3", "5 1 forward", "6 0 standing",  # engine order, nodal diameter, wave
        f"{basis.groups[0, 2].frequency[1]:#.5g}", "true resonances between", "the cyclic faces obey the phase rule",
        *(f"{r.speed * 30 / np.pi:.1f} {r.frequency:.2f} {r.order}" for r in found),
    ):  # fmt: skip
        assert part in words
    assert found and words.count("modes of the ring up to") >= 2
    words = said(report_html(sector.basis(6, rpm=(0.0, 60000.0), harmonics=(0, 1)), {}))
    assert "of the engine orders 2" in words and "without the nodal diameters 2, 3" in words


def test_diagrams_of_a_sector_name_its_speeds() -> None:
    """Titles and notes have the speed, not its number in the file."""
    from functools import partial

    pytest.importorskip("matplotlib")
    from microslip.pictures import diagrams
    from microslip.pictures.plots import figure_of

    basis = sector.basis(6, rpm=(0.0, 30000.0, 60000.0))
    safe = figure_of(partial(diagrams.safe_plot, basis, [1, 2]))
    assert [axes.get_title() for axes in safe.axes] == ["30000 rpm", "60000 rpm"]
    (axes,) = figure_of(partial(diagrams.nodal_diameter_plot, basis)).axes
    assert any(t.get_text().startswith("filled: at 0 rpm; hollow: at 60000 rpm") for t in axes.texts)


def test_info_check_and_export_of_a_cyclic_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from microslip.cli import main

    file = tmp_path / "basis.h5"
    write_basis(file, sector.basis())
    assert main(["info", str(file)]) == 0
    out = capsys.readouterr().out
    assert "one of 6 cyclic sectors" in out and "all 26 modes of the ring" in out and "k =   3" in out
    assert main(["check", str(file)]) == 0
    assert "ring of 6: the cyclic faces obey the phase rule" in capsys.readouterr().out
    refused_command(["export", str(file), "--to", "mat", "--ring"], capsys, "only vtu can hold the ring")
    pytest.importorskip("meshio")
    assert main(["export", str(file), "--to", "vtu", "--ring"]) == 0
    assert (tmp_path / "basis_ring.pvd").is_file() and (tmp_path / "basis_ring_nd03.vtu").is_file()


def test_a_case_of_a_cyclic_body_is_refused(tmp_path: Path) -> None:
    from microslip.case import run_case
    from microslip.case.settings import case_model

    settings = case_model().model_validate(
        {
            "name": "c", "body": "sector", "excitation": "gas", "monitor": "tip", "direction": "y",
            "contacts": [
                {"interface": "rim", "normal_stiffness": 1e7, "tangential_stiffness": 1e6, "friction": 0.3}
            ],
            "sweep": {"start": 1.0, "stop": 2.0, "points": 3, "normal_forces": [1.0]},
        }
    )  # fmt: skip
    refused("one of 6 cyclic sectors", run_case, settings, sector.basis())


def test_gyroscopic_coupling_splits_the_speeds_of_forward_and_backward_waves() -> None:
    """Oscillators in a ring with Coriolis forces, omega^2 +- 2 c Omega omega = omega_k^2, backward and forward: the
    critical speeds are omega_k / sqrt(e (e +- 2 c)), from two stations, as waves go between these as whirls do."""
    from microslip.data import GyroscopicModes

    c, sectors = 0.2, 12
    basis = chain(sectors, 1e5, 3e4, 0.3, (0.0, 20000.0))
    groups = {}
    for (s, k), g in basis.groups.items():
        mean = np.sqrt(g.omega[0] ** 2 + (c * g.speed) ** 2)
        pair = np.array([mean - c * g.speed, -(mean + c * g.speed)])  # backward, forward
        waves = pair if multiplicity(k, sectors) == 2 else g.omega
        n = len(waves)
        coupled = GyroscopicModes(waves, np.ones((1, n), complex), np.zeros(n), np.zeros(n), ("",) * n, np.zeros(n))
        groups[s, k] = replace(g, gyroscopic=coupled if s else None)
    found = {r.order: r for r in resonances(replace(basis, groups=groups), (3, 9, 6))}
    omega = {k: 2 * np.pi * closed_form(sectors, k, 1e5, 3e4, 0.3) for k in (3, 6)}
    assert (found[3].direction, found[9].direction, found[6].direction) == ("backward", "forward", "standing")
    for e, k, way in ((3, 3, c), (9, 3, -c), (6, 6, 0.0)):
        assert found[e].speed == pytest.approx(omega[k] / np.sqrt(e * (e + 2 * way)), rel=1e-9)
    assert found[3].speed < omega[3] / 3 and found[9].speed > omega[3] / 9


def test_both_waves_are_printed_and_stand_in_the_report() -> None:
    """Every frequency with gyroscopic coupling is shown with its nodal diameter and its direction of travel."""
    from microslip.data import GyroscopicModes
    from microslip.report.page import page
    from microslip.report.ring import whirl
    from microslip.ring.resonances import waves_of
    from microslip.stages.summary import basis_summary

    basis, groups = chain(12, 1e5, 3e4, 0.3, (0.0, 20000.0)), {}
    for (s, k), g in basis.groups.items():
        waves = np.array([0.9, -1.1]) * g.omega[0] if multiplicity(k, 12) == 2 else g.omega
        n = len(waves)
        zero, shapes = np.zeros(n), np.ones((1, n), complex)
        coupled = GyroscopicModes(waves, shapes, zero, zero, ("",) * n, zero + 0.02)
        groups[s, k] = replace(g, gyroscopic=coupled if s else None)
    basis = replace(basis, groups=groups)
    f = basis.groups[1, 3].frequency[0]
    shown = {way: (float(hertz[0]), float(bound[0])) for way, (hertz, bound) in waves_of(basis.groups[1, 3]).items()}
    assert shown == {"backward": (pytest.approx(0.9 * f), 0.02), "forward": (pytest.approx(1.1 * f), 0.02)}
    assert waves_of(basis.groups[0, 3]) == {} and list(waves_of(basis.groups[1, 6])) == ["standing"]
    lines = basis_summary(basis)
    assert f"  k =   3  {0.9 * f:10.5g}  Hz backward" in lines and f"  k =   3  {1.1 * f:10.5g}  Hz forward" in lines
    assert sum(line == "  at most           2  % too high" for line in lines) == 1  # one speed has coupling
    shown = page("ring", whirl([g for (s, _), g in sorted(basis.groups.items()) if s]))
    assert "k = 3\nbackward" in shown and f"{1.1 * f:#.6g}" in shown
    assert "k = 6\nstanding" in shown and "2&nbsp;%" in shown
    growing = replace(groups[1, 3].gyroscopic, growth=np.array([1.0, 0.0]))
    lost = replace(basis, groups=groups | {(1, 3): replace(groups[1, 3], gyroscopic=growing)})
    assert any("nodal diameter 3: The rotating body is UNSTABLE" in line for line in basis_summary(lost))


def test_pictures_find_the_stress_where_the_file_has_it() -> None:
    """The static state is the same at every nodal diameter, its stress may stand at one of them only."""
    from microslip.data import StressSet
    from microslip.pictures import _sector, _stressed, _with_static_stress

    basis = sector.basis(6, 4)
    n, one = basis.mesh.n_points, np.ones((basis.mesh.n_points, 6, basis.groups[0, 2].n_modes))
    held = StressSet("nodal-averaged", basis.mesh.points, one, one * (1 + 2j), np.ones((n, 6)), np.ones(n))
    assert _stressed(basis) == 0 and _with_static_stress(basis, basis.groups[0, 0]) is basis.groups[0, 0]
    basis = replace(basis, groups=basis.groups | {(0, 2): replace(basis.groups[0, 2], stresses={"nodes": held})})
    assert _stressed(basis) == 2
    assert _with_static_stress(basis, basis.groups[0, 0]).stresses["nodes"] is held
    alone = _sector(basis, 2)
    assert list(alone.groups) == [(0, 2)] and alone.name.endswith("nodal diameter 2")
    assert np.isrealobj(alone.groups[0, 2].stresses["nodes"].stress)


def test_each_check_once_shows_the_worst() -> None:
    from microslip.basis import Check
    from microslip.basis.checks import worst_of_each

    def check(where: str, value: float, limit: float = 1.0) -> Check:
        return Check(f"{where}: a", value, limit, value <= limit)

    values = {"speed_0/nd_0": 0.1, "speed_1/nd_12": 0.9, "range/nd_3": 2.0, "range/nd_4": 0.5}
    every = [check(where, value) for where, value in values.items()]
    assert worst_of_each(every) == [every[1], every[2]]
    low = check("speed_0: ring of 24", 3.0, 2.0)
    assert worst_of_each([check("speed_2: ring of 24", 9.0, 10.0), low]) == [low]  # one that failed, whatever its value
    found = check_basis(sector.basis(6, 4, (0.0, 3000.0)))
    assert 10 < len(worst_of_each(found)) < len(found) / 6

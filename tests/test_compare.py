"""Two bodies compared from the command line: other meshes, points only, a sector's complex modes; what is drawn."""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sector
import small
from refusals import refused

from microslip.basis import read_basis, write_basis
from microslip.cli import main
from microslip.data import ModalBasis, Rows
from microslip.modal.compute import modal_basis
from microslip.modal.sampling import at_points, on_common_points
from microslip.pictures import can_draw
from microslip.reduced.correlation import POINT, compare_groups
from microslip.settings.body import BodySettings

pytestmark = pytest.mark.usefixtures("undrawn")


@cache
def finer() -> ModalBasis:
    settings = BodySettings.model_validate(small.table(name="finer"))
    return modal_basis(small.beam((3, 3, 7)), settings, provenance={"settings": "small", "mesh_sha256": "1" * 64})


def measured(basis: ModalBasis, step: int = 7) -> ModalBasis:
    """Every few points, in x and z only, with other signs, in another order."""
    g = basis.groups[0, 0]
    keep, back = np.arange(0, basis.mesh.n_points, step), [1, 0, *range(2, g.n_modes)]
    mesh = replace(basis.mesh, points=basis.mesh.points[keep], cells={}, faces={}, point_sets={}, node_id=keep + 1)
    phi = -3 * g.phi[keep][:, :, back]
    phi[:, 1] = 0
    rows = {
        f"{POINT}{n + 1}": Rows(phi[i, [0, 2]], ("u_x", "u_z"), "m", basis.mesh.points[n], static=np.zeros(2))
        for i, n in enumerate(keep)
    }
    group = replace(g, phi=phi, omega=0.98 * g.omega[back], monitors=rows, interfaces={}, excitations={}, gauges={})
    return replace(basis, name="test", mesh=mesh, groups={(0, 0): group}, source="measured")


def test_modes_of_two_meshes_are_interpolated_where_nodes_differ() -> None:
    """Quadratic elements hold each other's shapes: MAC of the same six modes beyond 0.9995; nearest nodes do not."""
    a, b = small.basis(), finer()
    found = compare_groups(*on_common_points(a, b))
    assert [(p.first, p.second) for p in found.pairs] == [(j, j) for j in range(6)]
    assert min(p.mac for p in found.pairs) > 0.9995
    nearest = compare_groups(a, b, limit=0.01)
    assert min(p.mac for p in nearest.pairs) < 0.98


def test_points_inside_see_the_shape_functions() -> None:
    """A linear field is interpolated exactly."""
    basis = small.basis()
    A = np.array([[0.0, 1.0, 2.0], [3.0, 0.5, -1.0], [0.2, 0.1, 4.0]])
    phi = np.repeat((basis.mesh.points @ A.T)[:, :, None], 6, axis=2)
    linear = replace(basis, groups={(0, 0): replace(basis.groups[0, 0], phi=phi)})
    points = np.random.default_rng(3).uniform(0.01, 0.99, (20, 3)) * small.SIZE
    seen = at_points(linear, points)
    np.testing.assert_allclose(seen.groups[0, 0].phi[:, :, 0], points @ A.T, rtol=0, atol=1e-13)


def test_a_body_elsewhere_is_refused() -> None:
    for points in (finer().mesh.points * 1000, finer().mesh.points + 0.01):
        far = replace(finer(), mesh=replace(finer().mesh, points=points))
        refused("unit of length", on_common_points, small.basis(), far)


def test_the_same_mesh_is_left_as_it_is() -> None:
    assert on_common_points(small.basis(), small.basis())[0] is small.basis()


def test_a_sector_is_compared_with_itself_at_every_nodal_diameter() -> None:
    basis = sector.basis()
    for key, g in basis.groups.items():
        turned = replace(basis, groups={key: replace(g, phi=g.phi * np.exp(0.7j))})
        found = compare_groups(basis, turned, key)
        np.testing.assert_allclose([p.mac for p in found.pairs], 1, rtol=1e-12)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("compare")
    write_basis(folder / "a.h5", small.basis())
    write_basis(folder / "b.h5", finer())
    return folder


def test_the_command_line_says_pairs_and_writes_nothing_unasked(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(files.iterdir())
    assert main(["compare", str(files / "a.h5"), str(files / "b.h5")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 8 and lines[1].split()[0] == "1" and "-0.34%" in lines[1]
    assert sorted(files.iterdir()) == before


def test_pictures_and_table(files: Path, tmp_path: Path) -> None:
    assert main(["compare", str(files / "a.h5"), str(files / "b.h5"), "-o", str(tmp_path / "out"), "-q"]) == 0
    with open(tmp_path / "out" / "pairs.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    g = read_basis(files / "b.h5").groups[0, 0]
    np.testing.assert_allclose([float(r["second Hz"]) for r in rows], g.frequency, rtol=1e-8)
    expected = {"mac.png", "pairs.csv"} | (set() if can_draw() else {"pairs.png"})
    assert {p.name for p in (tmp_path / "out").iterdir()} == expected


@pytest.mark.skipif("can_draw() is not None", reason="PyVista cannot draw here")
def test_a_measured_body_is_drawn_by_its_points_with_the_signs_of_the_other(tmp_path: Path) -> None:
    from microslip.pictures.comparison import _factors, draw_comparison

    a, b = small.basis(), measured(small.basis())
    found = compare_groups(a, b)
    assert [(p.first, p.second) for p in found.pairs] == [(0, 1), (1, 0), (2, 2), (3, 3), (4, 4), (5, 5)]
    assert found.directions == 2 * b.mesh.n_points
    np.testing.assert_allclose([p.deviation for p in found.pairs], -0.02, rtol=1e-9)
    for first, second in _factors([a.groups[0, 0], b.groups[0, 0]], (a, b), found):
        assert first * second == -1  # the test has the other sign
    drawn = draw_comparison((a, b), (a, b), found, (0, 0), tmp_path)
    assert set(drawn) == {"mac", "pairs"}


@pytest.mark.slow
def test_modes_go_out_as_a_universal_file_and_come_back_as_a_test(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Six printed digits: MAC 1 within their square; on another mesh the same pairs, interpolated."""
    pytest.importorskip("pyuff")
    assert main(["export", str(files / "a.h5"), "--to", "uff", "-o", str(tmp_path / "a.uff")]) == 0
    assert main(["import", str(tmp_path / "a.uff"), str(tmp_path / "test")]) == 0
    test = read_basis(tmp_path / "test" / "basis.h5")
    assert test.source == "measured"
    same = compare_groups(*on_common_points(small.basis(), test))
    np.testing.assert_allclose([p.mac for p in same.pairs], 1, rtol=0, atol=1e-9)
    np.testing.assert_allclose([p.deviation for p in same.pairs], 0, atol=6e-6)
    other = compare_groups(*on_common_points(test, finer()))
    assert len(other.pairs) == 6 and min(p.mac for p in other.pairs) > 0.9995


def test_points_beside_the_mesh_go_to_the_nearest_nodes() -> None:
    a, b = small.basis(), measured(small.basis(), 29)
    aside = replace(b, mesh=replace(b.mesh, points=b.mesh.points + [0.0, 0.0, 0.004]))
    assert on_common_points(a, aside)[0] is a
    assert compare_groups(a, aside, limit=0.006).points > 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--speed", "2"], "has no speed 2"),
        pytest.param(["--nodal-diameter", "1"], "nodal diameter 1", marks=pytest.mark.slow),
        (["--least", "2"], "a MAC lies between 0 and 1"),
    ],
)
def test_mistakes_are_one_sentence(
    words: list[str], says: str, files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", str(files / "a.h5"), str(files / "b.h5"), *words]) == 2
    err = capsys.readouterr().err
    assert says in err and len(err.splitlines()) == 1

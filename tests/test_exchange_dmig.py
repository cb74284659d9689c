"""The Nastran superelement read back by columns here and by pyyeti, and held against the body it was made from."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import small
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from test_exchange import body
from test_exchange_peers import ask, needs

from microslip.cli import main
from microslip.data import INTERFACE_ROWS, Array, ModalBasis
from microslip.exchange import writer
from microslip.exchange.dmig import number
from microslip.exchange.matrices import read_matrices
from microslip.modal.compute import modal_basis
from microslip.modal.foreign import foreign_basis
from microslip.settings.body import BodySettings, MatrixFiles

LAST = 5e-11
"""Half of the last figure over the number at worst, with exponents from -9 to 99: 1.0000000000D10. Smaller numbers have
one figure less and do not count."""


@cache
def turned(free: bool = False) -> ModalBasis:
    """The beam in a frame that none of its edges follows."""
    mesh, Q = small.beam(), Rotation.from_rotvec([0.4, -0.9, 0.3]).as_matrix()
    changes = {"supports": [], "free": True, "modes": {"count": 9, "solver": "superlu"}} if free else {}
    table = small.table(reduction="craig-bampton", excitations=[], gauges=[], monitors=[], **changes)
    return modal_basis(replace(mesh, points=mesh.points @ Q.T), BodySettings.model_validate(table), provenance={})


def read_columns(path: Path) -> tuple[dict[int, Array], dict[str, tuple[int, Array]], list[tuple[int, int]]]:
    """Grids, name -> (form, matrix) and the rows' (number, component), by the columns of the cards alone."""
    grids: dict[int, Array] = {}
    scalar: list[int] = []
    entries: dict[str, dict[tuple[tuple[int, int], tuple[int, int]], float]] = {}
    forms: dict[str, int] = {}
    name, column = "", (0, 0)
    lines = [line for line in path.read_text(encoding="ascii").splitlines() if not line.startswith("$")]
    for line, after in zip(lines, [*lines[1:], ""], strict=True):
        wide = [line[8 + 16 * i : 24 + 16 * i] for i in range(4)]
        if line.startswith("GRID*"):
            assert after.startswith("* ") and int(wide[1]) == 0 and int(after[24:40]) == 0, "basic system"
            grids[int(wide[0])] = np.array([float(x) for x in (wide[2], wide[3], after[8:24])])
        elif line.startswith("SPOINT"):
            assert line[16:24].strip() == "THRU"
            scalar = list(range(int(line[8:16]), int(line[24:32]) + 1))
        elif line.startswith("DMIG "):
            name = line[8:16].strip()
            forms[name], entries[name] = int(line[24:32]), {}
            assert line[16:24].strip() == "0" and line[32:40].strip() == "2"
        elif line.startswith("DMIG*"):
            assert line[8:24].strip() == name
            column = (int(wide[1]), int(wide[2]))
        elif entries:
            entries[name][(int(wide[0]), int(wide[1])), column] = float(wide[2].replace("D", "E"))
    rows = [(n, c) for n in grids for c in range(1, 7)] + [(n, 0) for n in scalar]
    tables = {}
    for name, found in entries.items():
        A = np.zeros((len(rows), len(rows)))
        for (i, j), value in found.items():
            A[rows.index(i), rows.index(j)] = value
            if forms[name] == 6:
                assert A[rows.index(j), rows.index(i)] in (0, value), "one half alone"
                A[rows.index(j), rows.index(i)] = value
        tables[name] = (forms[name], A)
    return grids, tables, rows


def expected(basis: ModalBasis, A: Array) -> Array:
    """In the file's frame: u_basic = rotation^T u_interface of the two interfaces, whose rows come first in the tests'
    bodies."""
    g = basis.groups[0, 0]
    T = np.eye(g.n_modes)
    for i, face in enumerate((g.interfaces["right"], g.interfaces["left"])):
        np.testing.assert_allclose(face.rows, np.eye(g.n_modes)[6 * i : 6 * i + 6], atol=1e-6)
        T[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = scipy.linalg.block_diag(face.rotation, face.rotation)
    return T.T @ A @ T


def as_printed(found: Array, wanted: Array) -> None:
    """Entry by entry; what is nothing but rounding against the diagonal of its row and column is let go."""
    scale = np.sqrt(np.abs(np.outer(np.diag(wanted), np.diag(wanted))))
    np.testing.assert_array_less(np.abs(found - wanted), LAST * np.abs(wanted) + 1e-13 * scale + 1e-300)


def same_spectrum(K: Array, M: Array, wanted: Array) -> None:
    """(m,) squares of angular frequencies: |d lambda| <= |x|^T (|dK| + lambda |dM|) |x| to first order, as printed."""
    found, X = scipy.linalg.eigh(K, M)
    X = np.abs(X)
    bound = LAST * np.array([x @ (np.abs(K) + w * np.abs(M)) @ x for x, w in zip(X.T, np.abs(wanted), strict=True)])
    np.testing.assert_array_less(np.abs(found - wanted), bound)
    assert (bound[wanted > 0] < 1e-6 * wanted[wanted > 0]).all(), "a bound that says something"


@pytest.mark.parametrize("free", [False, True])
def test_matrices_and_grids_are_those_of_the_body(free: bool, tmp_path: Path) -> None:
    basis, path = turned(free), tmp_path / "b.pch"
    g = basis.groups[0, 0]
    writer("dmig")(basis, path)
    grids, tables, rows = read_columns(path)
    assert [*tables] == ["KAAX", "MAAX", "BAAX"] and {form for form, _ in tables.values()} == {6}
    for name, A in (("KAAX", g.K_r), ("MAAX", g.M_r), ("BAAX", g.C_r)):
        as_printed(tables[name][1], expected(basis, A))
    for at, face in zip(grids.values(), g.interfaces.values(), strict=True):
        np.testing.assert_allclose(at, face.origin, rtol=1e-9, atol=1e-15)
    bulk = pytest.importorskip("pyyeti.nastran.bulk")
    for name, frame in bulk.rddmig(str(path)).items():
        assert [tuple(i) for i in frame.index] == rows
        np.testing.assert_array_equal(frame.values, tables[name.upper()][1])
    np.testing.assert_array_equal(bulk.rdgrids(str(path))[:, [0, 2, 3, 4]], [[n, *x] for n, x in grids.items()])


@needs("pynastran")
@pytest.mark.slow
def test_pynastran_reads_the_same_matrices(tmp_path: Path) -> None:
    basis = turned(free=True)
    writer("dmig")(basis, tmp_path / "b.pch")
    grids, tables, rows = read_columns(tmp_path / "b.pch")
    ask("pynastran", "pynastran_dmig.py", tmp_path / "b.pch", tmp_path / "out.npz")
    found = np.load(tmp_path / "out.npz")
    for name, (_, table) in tables.items():
        np.testing.assert_array_equal(found[name], table)
        assert [tuple(r) for r in found[f"{name}_rows"].tolist()] == rows
    np.testing.assert_array_equal(found["GRID"], [[n, *x] for n, x in grids.items()])


def test_frequencies_with_free_and_with_fixed_interfaces(tmp_path: Path) -> None:
    basis = turned()
    g = basis.groups[0, 0]
    writer("dmig")(basis, tmp_path / "b.pch")
    _, tables, rows = read_columns(tmp_path / "b.pch")
    K, M = tables["KAAX"][1], tables["MAAX"][1]
    same_spectrum(K, M, g.omega**2)
    inner = [i for i, (_, component) in enumerate(rows) if component == 0]
    some = np.ix_(inner, inner)
    fixed = [i for i, kind in enumerate(g.kind) if kind == "fixed-interface"]
    wanted = scipy.linalg.eigvalsh(g.K_r[np.ix_(fixed, fixed)], g.M_r[np.ix_(fixed, fixed)])
    same_spectrum(K[some], M[some], wanted)
    assert wanted[0] > 4 * g.omega[0] ** 2, "fixing must show"


def test_rigid_motions_of_a_free_body_meet_no_force_and_the_mass_of_the_body(tmp_path: Path) -> None:
    """K R = 0 within the figures printed, and R^T M R is mass, first moment and inertia; R by pyyeti from the grids."""
    n2p = pytest.importorskip("pyyeti.nastran.n2p")
    basis = turned(free=True)
    writer("dmig")(basis, tmp_path / "b.pch")
    grids, tables, rows = read_columns(tmp_path / "b.pch")
    K, M = tables["KAAX"][1], tables["MAAX"][1]
    R = np.zeros((len(rows), 6))
    R[: 6 * len(grids)] = n2p.rbgeom(np.array(list(grids.values())), basis.centre)
    for motion in R.T:
        forces = np.abs(K) @ np.abs(motion)  # what would be there if the parts did not cancel
        assert (np.abs(K @ motion) <= 2 * LAST * forces).all(), "figures of K and of the grids"
    same_spectrum(K, M, basis.groups[0, 0].omega ** 2)
    rigid = R.T @ M @ R
    np.testing.assert_allclose(rigid[:3, :3], basis.mass * np.eye(3), rtol=0, atol=1e-9 * basis.mass)
    np.testing.assert_allclose(rigid[3:, 3:], basis.inertia, rtol=0, atol=1e-8 * np.abs(basis.inertia).max())
    size = np.sqrt(np.trace(basis.inertia) / basis.mass)
    assert np.abs(rigid[:3, 3:]).max() < 1e-9 * basis.mass * size


def test_a_force_on_a_grid_moves_it_as_the_modal_file_says(tmp_path: Path) -> None:
    basis = turned()
    c = basis.groups[0, 0].compliance
    writer("dmig")(basis, tmp_path / "b.pch")
    _, tables, _ = read_columns(tmp_path / "b.pch")
    flexibility = np.linalg.inv(tables["KAAX"][1])[6:9, 0:3]  # forces on the first, displacements of the second
    first, second = basis.groups[0, 0].interfaces
    at = [[c.labels.index(f"interface:{name}:{row}") for row in INTERFACE_ROWS[:3]] for name in (first, second)]
    F = [basis.groups[0, 0].interfaces[name].rotation for name in (first, second)]
    wanted = F[1].T @ c.static[np.ix_(at[1], at[0])] @ F[0]
    np.testing.assert_allclose(flexibility, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())


def test_gyroscopic_and_circulatory_matrices_are_square_and_a_damping_matrix_is_whole(tmp_path: Path) -> None:
    basis = body(reduction="craig-bampton")
    g, rng = basis.groups[0, 0], np.random.default_rng(3)
    A, N, C = rng.normal(size=(3, g.n_modes, g.n_modes))
    g = replace(g, G_r=A - A.T, N_r=N, C_r=C)
    writer("dmig")(replace(basis, groups={(0, 0): g}), tmp_path / "b.pch")
    _, tables, _ = read_columns(tmp_path / "b.pch")
    assert {name: form for name, (form, _) in tables.items()} == dict(KAAX=6, MAAX=6, BAAX=6, GAAX=1, NAAX=1)
    basis = replace(basis, groups={(0, 0): g})
    both = tables["BAAX"][1] + tables["GAAX"][1]
    np.testing.assert_allclose(both, expected(basis, g.C_r + g.G_r), rtol=0, atol=1e-9)
    np.testing.assert_allclose(tables["NAAX"][1], expected(basis, N), rtol=0, atol=1e-9)
    text = (tmp_path / "b.pch").read_text()
    assert "$   B2PP = GAAX" in text and "$   K2PP = NAAX" in text


def test_a_spinning_body_has_its_gyroscopic_matrix(tmp_path: Path) -> None:
    table = small.table(reduction="craig-bampton", rotation={"speeds_rpm": [3000.0], "axis": [1.0, 0.0, 0.0]})
    basis = modal_basis(small.beam((1, 1, 2)), BodySettings.model_validate(table), provenance={})
    writer("dmig")(basis, tmp_path / "b.pch")
    G = read_columns(tmp_path / "b.pch")[1]["GAAX"][1]
    wanted = expected(basis, basis.groups[0, 0].G_r)
    np.testing.assert_allclose(G, wanted, rtol=0, atol=LAST * np.abs(wanted).max())
    assert "at 3000 rpm" in (tmp_path / "b.pch").read_text().splitlines()[0]


def test_cards_keep_to_their_columns_and_sets_wait_as_comments(tmp_path: Path) -> None:
    basis = replace(turned(), name="Prüfling\nmit\tZeilen" * 9)
    writer("dmig")(basis, tmp_path / "b.pch")
    lines = (tmp_path / "b.pch").read_bytes().decode("ascii").splitlines()
    assert max(map(len, lines)) <= 72
    cards = [line for line in lines if not line.startswith("$")]
    assert {line[:8].strip() for line in cards} == {"GRID*", "*", "SPOINT", "DMIG", "DMIG*"}
    assert "$ASET1   123456  90000001THRU    90000002" in lines
    assert "$QSET1   0       91000001THRU    91000006" in lines
    assert "SPOINT  91000001THRU    91000006" in lines


@given(st.floats(-1e300, 1e300), st.sampled_from("DE"))
def test_numbers_fit_and_keep_their_figures(value: float, letter: str) -> None:
    text = number(value, letter)
    assert len(text) <= 16 and text.count(letter) == 1
    back = float(text.replace("D", "E"))
    figures = LAST if 1e-9 <= abs(value) < 1e99 else 100 * LAST if abs(value) > 1e-300 else 1.0  # denormal: fewer bits
    assert abs(back - value) <= 1.01 * figures * abs(value)
    assert float(number(-value, letter).replace("D", "E")) == -back


def test_the_punch_file_is_imported_as_a_superelement(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes and generalised coordinates from the same file; every frequency."""
    pytest.importorskip("pyyeti")
    basis = turned()
    monkeypatch.chdir(tmp_path)
    writer("dmig")(basis, "b.pch")
    assert main(["import", "b.pch", "wing", "--unit", "m"]) == 0
    given = tomllib.loads(Path("wing/body.toml").read_text())["geometry"]["matrices"]
    assert given == dict.fromkeys(("stiffness", "mass", "nodes"), "../b.pch") | {"superelement": True}
    settings = MatrixFiles(**given, damping="../b.pch", grounded=True)
    m = read_matrices(settings, tmp_path / "wing", "m")
    assert m.damping is not None
    assert list(m.component) == [0, 1, 2, 3, 4, 5] * 2 + [-1] * 6 and list(m.node) == [0] * 6 + [1] * 6 + [-1] * 6
    same_spectrum(m.stiffness.toarray(), m.mass.toarray(), basis.groups[0, 0].omega ** 2)


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_a_floating_superelement_of_two_nodes_comes_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unit: str
) -> None:
    """Quadratic displacements of two nodes are rigid, and in mm a rotation of the shaft weighs 1e-13 of a displacement.
    The numbers said to be of another system are those of a body with the same frequencies."""
    pytest.importorskip("pyyeti")
    mesh = small.beam(size=(0.01, 0.008, 0.1))
    table = small.table(
        reduction="craig-bampton", excitations=[], gauges=[], monitors=[], supports=[], free=True, modes={"count": 6}
    )
    basis = modal_basis(mesh, BodySettings.model_validate(table), provenance={})
    monkeypatch.chdir(tmp_path)
    writer("dmig")(basis, "b.pch")
    shared = {"stiffness": "b.pch", "mass": "b.pch", "nodes": "b.pch", "superelement": True}
    given = BodySettings.model_validate(
        {
            "name": "b",
            "length_unit": unit,
            "free": True,
            "geometry": {"matrices": shared},
            "modes": {"count": 30},
        }
    )
    body = read_matrices(MatrixFiles(**shared), tmp_path, unit)
    found, _ = foreign_basis(body, given)
    wanted = basis.groups[0, 0].frequency
    np.testing.assert_allclose(found.groups[0, 0].frequency, wanted, rtol=1e-7, atol=1e-3)


def test_import_knows_that_the_file_is_in_si_and_what_it_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Said to be in mm it would weigh a thousand times as much."""
    pytest.importorskip("pyyeti")
    monkeypatch.chdir(tmp_path)
    writer("dmig")(turned(), "b.pch")
    assert main(["import", "b.pch", "wing"]) == 0
    assert tomllib.loads(Path("wing/body.toml").read_text())["length_unit"] == "m"

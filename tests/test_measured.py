"""Measured modes from Universal Files: against the computed body they were taken from, and files that are wrong."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import small
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused, refused_command
from test_fuzz import user_errors_only
from test_readers import tetrahedra, unv

from microslip.basis import check_basis, read_basis, write_basis
from microslip.cli import main
from microslip.data import ModalBasis
from microslip.exchange.measured import holds_modes, read_measured
from microslip.exchange.uff import write_uff
from microslip.reduced.correlation import compare_groups, measured_directions

pyuff = pytest.importorskip("pyuff")


def chosen(basis: ModalBasis) -> np.ndarray:
    """Positions of the points that were measured: every ninth."""
    return np.arange(4, basis.mesh.n_points, 9)


def measure(path: Path, basis: ModalBasis, acceleration: bool = False, mass: float = 1.0, **more: object) -> Path:
    """A test of the body as a test program would write it: mm, mN; x and z at even points, y at odd ones."""
    g, at = basis.groups[0, 0], chosen(basis)
    nodes = basis.mesh.node_id[at]
    x, y, z = 1000 * basis.mesh.points[at].T
    file = pyuff.UFF(str(path))
    zeros = np.zeros(len(at), dtype=int)
    sets: list[dict] = [
        {"type": 164, "units_code": 5, "units_description": "mm (milli newton)", "temp_mode": 1, "length": 1000.0,
         "force": 1000.0, "temp": 1.0, "temp_offset": 0.0},
        {"type": 15, "node_nums": nodes, "def_cs": zeros, "disp_cs": zeros, "color": zeros, "x": x, "y": y, "z": z},
    ]  # fmt: skip
    for j in np.arange(g.n_modes)[::-1]:  # in any order
        phi = 1000 * g.phi[at, :, j] * np.sqrt(mass)  # mm per coordinate; a modal mass of mass kg is as many mN s2/mm
        phi = np.where((np.arange(len(at)) % 2 == 0)[:, None], phi * [1, 0, 1], phi * [0, 1, 0])
        if acceleration:
            phi = -phi * g.omega[j] ** 2
        sets.append(
            {"type": 55, "model_type": 1, "analysis_type": 2, "data_ch": 2, "spec_data_type": 12 if acceleration else 8,
             "data_type": 2, "load_case": 1, "mode_n": int(j) + 1, "freq": g.frequency[j], "modal_m": mass,
             "modal_damp_vis": g.damping_ratio[j], "modal_damp_his": 0.0, "node_nums": nodes, "r1": phi[:, 0],
             "r2": phi[:, 1], "r3": phi[:, 2], "id1": "test", "id2": "", "id3": "", "id4": "", "id5": ""} | more
        )  # fmt: skip
    file.write_sets(sets, "overwrite")
    return path


@pytest.mark.parametrize(("acceleration", "mass"), [(False, 1.0), (True, 1.0), (False, 7.0)])
def test_a_test_of_the_beam_is_found_again(tmp_path: Path, acceleration: bool, mass: float) -> None:
    """Six digits: frequency, damping, mass-normalised shapes in SI, whatever was measured in whatever unit."""
    basis = small.basis()
    g, at = basis.groups[0, 0], chosen(basis)
    measured, told = read_measured(measure(tmp_path / "t.uff", basis, acceleration, mass))
    h = measured.groups[0, 0]
    np.testing.assert_allclose(measured.mesh.points, basis.mesh.points[at], atol=1e-7)  # six digits of 120 mm
    np.testing.assert_allclose(h.omega, g.omega, rtol=2e-5)
    np.testing.assert_allclose(h.damping_ratio, g.damping_ratio, rtol=2e-5)
    known = measured_directions(measured, h)
    free = basis.mesh.points[at][:, 2] > 0  # a point at the clamp moves in no mode: nobody measures it
    assert known.sum() == 2 * free[::2].sum() + free[1::2].sum()
    likeness = np.abs(np.einsum("nim,nim->m", h.phi, np.where(known[:, :, None], g.phi[at], 0)))
    np.testing.assert_allclose(likeness, (g.phi[at][known] ** 2).sum(axis=0), rtol=1e-4)  # the scale is right too
    assert "modal masses" in " ".join(told) and "0.001 m" in told[0]
    found = compare_groups(measured, basis)
    assert [(p.first, p.second) for p in found.pairs] == [(i, i) for i in range(g.n_modes)]
    assert min(p.mac for p in found.pairs) > 1 - 1e-9 and max(abs(p.deviation) for p in found.pairs) < 2e-5


def test_the_file_says_that_it_was_measured(tmp_path: Path) -> None:
    """Round trip; the checks ask for no mass, no cells, no compliance; nothing says that modes are complete."""
    measured, _ = read_measured(measure(tmp_path / "t.uff", small.basis()))
    write_basis(tmp_path / "t.h5", measured)
    again = read_basis(tmp_path / "t.h5")
    assert again.source == "measured" and "certified" not in again.groups[0, 0].checks
    assert [c.name for c in check_basis(again) if not c.passed] == []
    np.testing.assert_array_equal(
        measured_directions(again, again.groups[0, 0]), measured_directions(measured, measured.groups[0, 0])
    )
    computed = check_basis(replace(again, source="elements"))
    assert {"mesh: points and cells", "body: mass is positive"} <= {c.name for c in computed if not c.passed}


def test_without_modal_masses_shapes_have_no_scale(tmp_path: Path) -> None:
    measured, told = read_measured(measure(tmp_path / "t.uff", small.basis(), modal_m=0.0))
    assert np.abs(measured.groups[0, 0].phi).max(axis=(0, 1)).tolist() == [1.0] * 6
    assert "no modal masses" in " ".join(told) and measured.provenance["scaling"] == "largest displacement 1"


def test_shapes_written_by_the_exporter_come_back(tmp_path: Path) -> None:
    """Real shapes as normal modes, complex ones as complex eigenvalues with modal a: the same to six digits."""
    basis = small.basis()
    g = basis.groups[0, 0]
    write_uff(basis, tmp_path / "a.uff")
    h = read_measured(tmp_path / "a.uff")[0].groups[0, 0]
    np.testing.assert_allclose(np.abs(h.phi), np.abs(g.phi), atol=1e-5 * np.abs(g.phi).max())
    turn = np.exp(1j * np.linspace(0, 1, basis.mesh.n_points))[:, None, None]  # a travelling wave
    wave = replace(basis, groups={(0, 0): replace(g, phi=g.phi * turn)})
    write_uff(wave, tmp_path / "b.uff")
    h = read_measured(tmp_path / "b.uff")[0].groups[0, 0]
    assert np.iscomplexobj(h.phi)
    np.testing.assert_allclose(h.omega, g.omega, rtol=1e-5)
    np.testing.assert_allclose(h.damping_ratio, g.damping_ratio, rtol=1e-5)
    np.testing.assert_allclose(np.abs(h.phi), np.abs(g.phi), atol=1e-5 * np.abs(g.phi).max())


def test_files_that_are_wrong(tmp_path: Path) -> None:
    basis = small.basis()
    whole = measure(tmp_path / "t.uff", basis).read_text()
    parts = re.findall(r" {4}-1 *\n.*?\n {4}-1 *\n", whole, re.S)

    def kind(part: str) -> int:
        return int(part.split()[1])

    assert "".join(parts) == whole and {kind(p) for p in parts} == {164, 15, 55}
    assert holds_modes(tmp_path / "t.uff")
    cases = {
        "no modes": ("".join(p for p in parts if kind(p) != 55), "no mode shapes"),
        "no points": ("".join(p for p in parts if kind(p) != 15), "no points"),
        "not a file": ("hello\n", "Universal File"),
        "empty": ("", "Universal File"),
    }
    for name, (text, words) in cases.items():
        (tmp_path / f"{name}.uff").write_text(text)
        refused(words, read_measured, tmp_path / f"{name}.uff")
    strange = measure(tmp_path / "s.uff", basis, spec_data_type=2)
    refused("specific data type 2", read_measured, strange)
    refused("no such file", read_measured, tmp_path / "none.uff")
    # metres read as millimetres: refused where it is compared
    (tmp_path / "m.uff").write_text("".join(p for p in parts if kind(p) != 164))
    far, told = read_measured(tmp_path / "m.uff", unit="m")
    assert "does not tell its units" in told[0]
    refused("one unit of length", compare_groups, far, basis)


def respond(path: Path, basis: ModalBasis, scale: float = 1.0) -> Path:
    """Add what a hammer and one accelerometer would measure: mm/s2 over mN, from the modes of the body itself."""
    g, at = basis.groups[0, 0], chosen(basis)
    f = np.linspace(0.5 * g.frequency[0], 1.02 * g.frequency[-1], 1500)
    W, w, D = 2 * np.pi * f[:, None], g.omega, g.damping_ratio
    sets = []
    for point, way in ((2, 3), (4, 1), (6, -3), (1, 2)):
        r = np.sign(way) * g.phi[at[point], abs(way) - 1] * g.phi[at[4], 0]
        H = scale * (-(W**2) * r / (w**2 - W**2 + 2j * D * w * W)).sum(axis=1)
        sets.append(
            {"type": 58, "binary": 0, "func_type": 4, "rsp_node": int(basis.mesh.node_id[at[point]]), "rsp_dir": way,
             "ref_node": int(basis.mesh.node_id[at[4]]), "ref_dir": 1, "ord_data_type": 6, "abscissa_spacing": 1,
             "abscissa_min": f[0], "abscissa_inc": f[1] - f[0], "num_pts": len(f), "abscissa_spec_data_type": 18,
             "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13, "z_axis_spec_data_type": 0, "data": H,
             "x": f, "id1": "", "id2": "", "id3": "", "id4": "", "id5": "", "rsp_ent_name": "NONE",
             "ref_ent_name": "NONE", "load_case_id": 0}
        )  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, "add")
    return path


def test_measured_responses_judge_the_modes(tmp_path: Path) -> None:
    """The responses of the body itself: FRAC 1 and level 1 to the six digits of the shapes, in mm and mN."""
    basis = small.basis()
    group = replace(basis.groups[0, 0], damping_ratio=np.full(basis.groups[0, 0].n_modes, 0.01))
    basis = replace(basis, groups={(0, 0): group})
    path = respond(measure(tmp_path / "t.uff", basis), basis)
    told = read_measured(path)[1]
    found = re.search(r"(\d) of 4 .* FRAC (\S+) \(.*\) to (\S+), levels (\S+) to (\S+) times", told[-1])
    assert found is not None and found[1] == "4"
    assert all(abs(float(found[i]) - 1) < 2e-3 for i in (2, 3, 4, 5))
    file = pyuff.UFF(str(path))
    sets = [s | ({"binary": 1} if s["type"] == 58 else {}) for s in file.read_sets()]
    pyuff.UFF(str(tmp_path / "binary.uff")).write_sets(sets, "overwrite")
    assert b"58b" in (tmp_path / "binary.uff").read_bytes()
    assert read_measured(tmp_path / "binary.uff")[1][-1] == told[-1]
    # a modal mass 100 times too large, or a force said to be in N, is told
    wrong = respond(measure(tmp_path / "w.uff", basis, modal_m=100.0), basis)
    assert "0.01 times as strongly" in read_measured(wrong)[1][-1]
    # responses in g instead of mm/s2
    wrong = respond(measure(tmp_path / "g.uff", basis), basis, 1 / 9806.65)
    assert "times as strongly" in read_measured(wrong)[1][-1]
    # without modal masses they say nothing
    blind = respond(measure(tmp_path / "b.uff", basis, modal_m=0.0), basis)
    assert "left aside" in read_measured(blind)[1][-1]


def test_functions_alone_are_refused_with_the_way_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    respond(tmp_path / "t.uff", small.basis())
    refused_command(["import", "t.uff"], capsys, "4 measured functions and no mode shapes", "identify modes")


def test_import_and_compare(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a person types: the test beside the computed body."""
    monkeypatch.chdir(tmp_path)
    measure(tmp_path / "test.uff", small.basis())
    write_basis(tmp_path / "small.h5", small.basis())
    assert main(["import", "test.uff"]) == 0
    assert main(["check", "test/basis.h5", "-q"]) == 0
    assert main(["info", "test/basis.h5"]) == 0
    assert "others may have been missed" in capsys.readouterr().out
    assert main(["compare", "test/basis.h5", "small.h5"]) == 0
    assert "1.0000" in capsys.readouterr().out
    assert main(["import", "test.uff"]) == 2


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("measured")
    respond(measure(path / "whole.uff", small.basis()), small.basis())
    return path


@settings(max_examples=60)
@given(st.lists(st.tuples(st.integers(0, 10**7), st.integers(0, 255)), min_size=1, max_size=30), st.booleans())
def test_changed_bytes(folder: Path, changes: list[tuple[int, int]], cut: bool) -> None:
    data = bytearray((folder / "whole.uff").read_bytes())
    for place, value in changes:
        data[place % len(data)] = value
    (folder / "a.uff").write_bytes(data[: changes[0][0] % len(data)] if cut else data)
    with user_errors_only():
        read_measured(folder / "a.uff")


# modes of another program in a mesh file ------------------------------------------------------------------------------


def as_2414(basis: ModalBasis, complex_: bool = False) -> str:
    """Modes as a solver writes them beside its mesh: data sets 2414 and the stresses of the same modes, left aside."""
    lines = list[str]()
    for j, (f, D) in enumerate(zip(basis.groups[0, 0].frequency, basis.groups[0, 0].damping_ratio, strict=True)):
        for result, count in ((8, 3), (2, 6)):
            lines += ["    -1", "  2414", f"{j + 1:10d}", f"mode {j + 1}", f"{1:10d}", *["NONE"] * 5]
            kind = (1, 3 if complex_ else 2, 2, result, 5 if complex_ else 2, count)
            lines.append("".join(f"{v:10d}" for v in kind))
            lines += [f"{0:10d}" * 5 + f"{j + 1:10d}{0:10d}{0:10d}", f"{0:10d}{0:10d}"]
            w = 2 * np.pi * f
            root = (-D * w, w * np.sqrt(1 - D**2), 0.0, 2 * w * np.sqrt(1 - D**2), 0.0, 0.0)
            lines.append("".join(f"{v:13.5e}" for v in (0, *([0] * 5 if complex_ else [f, 0, 1, D, 0]))))
            lines.append("".join(f"{v:13.5e}" for v in (root if complex_ else [0] * 6)))
            for number, row in zip(basis.mesh.node_id, basis.groups[0, 0].phi[:, :, j], strict=True):
                values = np.resize(row, count)
                values = np.column_stack([values, 0 * values]).ravel() if complex_ else values
                lines.append(f"{number:10d}")
                lines += ["".join(f"{v:13.5e}" for v in part) for part in np.split(values, range(6, len(values), 6))]
            lines.append("    -1")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("complex_", [False, True])
def test_modes_in_a_mesh_file_stand_beside_the_body(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], complex_: bool
) -> None:
    """Another program's frequencies and shapes (data set 2414) beside the computed ones: MAC 1, six digits."""
    monkeypatch.chdir(tmp_path)
    mesh = unv(tetrahedra())
    Path("a.unv").write_text(mesh)
    assert main(["import", "a.unv", "part", "--unit", "m"]) == 0
    assert main(["modes", "part", "-q", "--set", "modes.solver=superlu", "--set", "modes.count=9"]) == 0
    basis = read_basis(Path("build/part/basis.h5"))
    Path("b.unv").write_text(mesh + as_2414(basis, complex_))
    capsys.readouterr()
    assert main(["import", "b.unv", "other", "--unit", "m"]) == 0
    said = capsys.readouterr().out
    assert "microslip compare other/modes_of_file.h5" in said and "MAT" not in said
    assert main(["compare", "other/modes_of_file.h5", "build/part/basis.h5"]) == 0
    foreign = read_basis(Path("other/modes_of_file.h5"))
    likeness = compare_groups(foreign, basis)
    assert [(p.first, p.second) for p in likeness.pairs] == [(0, 6), (1, 7), (2, 8)]
    assert all(p.mac > 1 - 1e-9 for p in likeness.pairs)
    shapes = [np.abs(b.groups[0, 0].phi[:, :, -3:]) for b in (foreign, basis)]
    np.testing.assert_allclose(*shapes, rtol=1e-5, atol=1e-5 * shapes[1].max())


def test_functions_are_laid_beside_a_computed_body(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Functions of the body itself, in mm and mN, with points and no modes: FRAC and level 1."""
    monkeypatch.chdir(tmp_path)
    basis = small.basis()
    group = replace(basis.groups[0, 0], damping_ratio=np.full(basis.groups[0, 0].n_modes, 0.01))
    basis = replace(basis, groups={(0, 0): group})
    write_basis("basis.h5", basis)
    parts = re.findall(r" {4}-1 *\n.*?\n {4}-1 *\n", respond(measure(Path("t.uff"), basis), basis).read_text(), re.S)
    Path("f.uff").write_text("".join(p for p in parts if p.split()[1] != "55"))
    assert main(["compare", "basis.h5", "f.uff"]) == 0
    found = re.search(r"4 of 4 .* FRAC (\S+) \(.*\) to (\S+), levels (\S+) to (\S+) times", capsys.readouterr().out)
    assert found is not None and all(abs(float(v) - 1) < 1e-3 for v in found.groups())
    refused_command(["compare", "t.uff", "f.uff"], capsys, "computed modal file")
    assert main(["compare", "basis.h5", "t.uff"]) == 0
    refused_command(["import", "f.uff"], capsys, "microslip compare")

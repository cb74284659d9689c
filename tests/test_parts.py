"""`microslip import` of parts that touch: where they do, and an assembly that runs as it stands."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tomllib
from pathlib import Path

import decks
import meshes
import numpy as np
import pytest
from refusals import refused_command

from microslip.basis import read_basis
from microslip.case import load_case, run
from microslip.cli import main
from microslip.mesh.touching import touches, touching_facets
from microslip.results import read_response


def plates():
    """100 x 20 x 5 mm each, lying on each other over 30 mm; their lines of nodes do not meet."""
    lower = meshes.brick("hexahedron20", (10, 2, 1), (0.1, 0.02, 0.005))
    upper = meshes.brick("wedge15", (10, 3, 1), (0.1, 0.02, 0.005), (0.07, 0.0, 0.005))
    return {"lower": lower, "upper": upper}


@pytest.fixture
def decks_of_plates(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, mesh in plates().items():
        lines = [*decks.mesh_lines(mesh), *decks.MATERIAL, decks.section()]
        (tmp_path / f"{name}.inp").write_text("\n".join(lines) + "\n")
    return tmp_path


def test_patches_of_meshes_have_their_area_and_normal():
    """A block in the corner of an angle touches its two legs; moved by a hundredth of its size it touches neither."""
    angle = meshes.brick("hexahedron20", (4, 2, 4), (0.04, 0.02, 0.04), keep=lambda n: (n[:, 0] < 1) | (n[:, 2] < 1))
    block = meshes.brick("tetra10", (4, 3, 2), (0.03, 0.02, 0.01), (0.01, 0.0, 0.01))
    large, small = touches(angle, block)
    assert large.area == pytest.approx(0.03 * 0.02) and small.area == pytest.approx(0.01 * 0.02)
    assert large.normal == pytest.approx([0, 0, 1]) and small.normal == pytest.approx([1, 0, 0])
    assert large.low == pytest.approx([0.01, 0, 0.01]) and large.high == pytest.approx([0.04, 0.02, 0.01])
    assert [touch.area for touch in touches(block, angle)] == pytest.approx([6e-4, 2e-4])
    away = meshes.moved(block, np.eye(3), np.array([4e-4, 0, 4e-4]))
    assert not touching_facets(angle, away) and touches(angle, away) == []


def test_a_curved_patch_is_one_and_has_no_normal():
    outer = meshes.pipe("hexahedron20", (2, 16, 2), 0.01, 0.02, 0.03)
    inner = meshes.pipe("hexahedron20", (2, 16, 3), 0.005, 0.01, 0.03)
    (patch,) = touches(outer, inner)
    assert patch.normal is None
    assert patch.area == pytest.approx(2 * 16 * np.sin(np.pi / 16) * 0.01 * 0.03, rel=1e-9)  # chords


@pytest.mark.usefixtures("unjudged")
def test_two_decks_that_touch_are_an_assembly_that_runs(decks_of_plates, capsys):
    assert main(["import", "lower.inp", "upper.inp", "joint"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[-2] == "lower touches upper over 600 mm2: lower:upper against upper:lower"
    assert "move it, and the probe, when you clamp" in (decks_of_plates / "joint" / "lower" / "body.toml").read_text()
    case, _ = load_case("joint/case.toml")
    assert [(c.interface, c.against) for c in case.contacts] == [("lower:upper", "upper:lower")]
    quick = ["--no-stress", "--no-pictures", "--set", "sweep.points=3", "--set", "harmonics=1"]
    quick += ["--set", "amplitude=1e-4", "--set", "contacts.lower:upper.points=[2,2]"]  # which sticks
    assert main(["run", "joint", "-q", *quick]) == 0
    for name, other in (("lower", "upper"), ("upper", "lower")):
        group = read_basis(f"build/joint-{name}/basis.h5").groups[0, 0]
        assert group.interfaces[other].areas.sum() == pytest.approx(6e-4, rel=1e-9)
    assert "shaker" in read_basis("build/joint-lower/basis.h5").groups[0, 0].excitations
    assert all(s.converged.all() for s in read_response("build/joint/response.h5").series)
    assert main(["import", "lower.inp", "upper.inp", "again"]) == 0  # parts of the same names
    assert main(["modes", "again/lower", "-q"]) == 0 and Path("build/again-lower/basis.h5").is_file()
    assert [b.body for b in load_case("again/case.toml")[0].components] == ["again-lower", "again-upper"]


def test_bodies_that_are_there_get_their_lines_at_the_end(decks_of_plates, capsys):
    for name in ("lower", "upper"):
        assert main(["import", f"{name}.inp"]) == 0
    mine = '\n[[monitors]]\nname = "mine"\npoint = [0, 0, 0]\n'
    with open("lower/body.toml", "a") as file:
        file.write(mine)
    before = (decks_of_plates / "lower" / "body.toml").read_text()
    assert main(["import", "lower", "upper", "joint"]) == 0
    text = (decks_of_plates / "lower" / "body.toml").read_text()
    assert text.startswith(before.rstrip("\n")) and tomllib.loads(text)["geometry"]["faces"][0]["name"] == "upper"
    assert load_case("joint/case.toml")[0].monitor == "lower:mine"
    assert main(["modes", "lower", "-q"]) == 0
    refused_command(["import", "lower", "upper", "again"], capsys, "lower/body.toml")
    assert (decks_of_plates / "lower" / "body.toml").read_text() == text


def test_what_does_not_touch_is_told_and_nothing_is_written(decks_of_plates, capsys):
    away = meshes.moved(plates()["upper"], np.eye(3), np.array([0, 0, 0.001]))
    (decks_of_plates / "away.inp").write_text("\n".join(decks.mesh_lines(away)) + "\n")
    for name in ("part.step", "K.mtx", "M.mtx"):
        (decks_of_plates / name).write_text("")
    for words, said in (
        (["lower.inp", "away.inp"], "touch nowhere"),
        (["lower.inp", "part.step"], "all of one kind"),
        (["K.mtx", "M.mtx"], "name that of the stiffness alone"),
        (["lower.inp", "lower.inp"], "name of two"),
        (["lower.inp", "none.inp", "joint"], "none.inp: there is no such file"),
    ):
        refused_command(["import", *words], capsys, said)
    assert not list(decks_of_plates.glob("*/body.toml"))


DRAW = """
import gmsh
gmsh.initialize(readConfigFiles=False, interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
def keep(name):
    occ.synchronize()
    gmsh.write(name)
    gmsh.clear()
occ.addBox(0, 0, 0, 100, 20, 5)
keep("lower.step")
occ.cut([(3, occ.addBox(70, 0, 5, 100, 20, 15))], [(3, occ.addBox(90, -1, 4, 90, 22, 8))])
keep("upper.step")
occ.addBox(0, 0, 0, 100, 20, 5), occ.addBox(70, 0, 5, 100, 20, 5), occ.addCylinder(20, 10, 5, 0, 0, 9, 5)
keep("all.step")
occ.cut([(3, occ.addBox(0, 0, 0, 30, 30, 10))], [(3, occ.addCylinder(15, 15, -1, 0, 0, 12, 5))])
keep("plate.step")
occ.fuse([(3, occ.addCylinder(15, 15, 0, 0, 0, 12, 5))], [(3, occ.addCylinder(15, 15, 10, 0, 0, 4, 8))])
keep("pin.step")
gmsh.finalize()
"""


@pytest.fixture
def drawn(tmp_path, monkeypatch):
    if importlib.util.find_spec("gmsh") is None:
        pytest.skip("gmsh is not installed")
    monkeypatch.chdir(tmp_path)
    subprocess.run([sys.executable, "-c", DRAW], check=True, capture_output=True)
    return tmp_path


def test_where_drawn_parts_touch(drawn):
    """To the digit: a lap of 20 x 20 mm; of a pin in a plate the bore, and the ring below its head."""
    words = [sys.executable, "-m", "microslip.cad", "--touches", "mm"]
    for parts, areas, flat in (
        (["lower.step", "upper.step"], [400.0], [True]),
        (["plate.step", "pin.step"], [100 * np.pi, 39 * np.pi], [False, True]),
    ):
        done = subprocess.run([*words, *parts], capture_output=True, text=True, check=True)
        found = json.loads(done.stdout)["touches"]
        assert [t["area"] for t in found] == pytest.approx(areas, rel=1e-6)
        assert [t["normal"] is not None for t in found] == flat


@pytest.mark.slow
def test_solids_of_one_file_are_set_apart_and_run(drawn, capsys, monkeypatch):
    monkeypatch.setattr(run._Run, "_judge", lambda *_: True)  # no estimate of the error of harmonics
    assert main(["import", "all.step", "three", "--apart"]) == 0
    said = capsys.readouterr().out
    assert "part-1 touches part-2 over 600 mm2" in said and "part-1 touches part-3 over 78.54 mm2" in said
    assert "surface kind" not in said and "surface kind" in (drawn / "three" / "part-1" / "body.toml").read_text()
    sticking = ["--set", "amplitude=1e-4", "--set", "harmonics=1", "--set", "sweep.points=2"]
    assert main(["run", "three", "-q", "--no-stress", "--no-pictures", *sticking]) == 0
    areas = [p.areas.sum() for p in read_basis("build/three-part-1/basis.h5").groups[0, 0].interfaces.values()]
    assert areas == pytest.approx([6e-4, 25e-6 * np.pi], rel=0.03)  # chords
    refused_command(["import", "lower.step", "other", "--apart"], capsys, "nothing to set apart")


@pytest.mark.slow
def test_one_of_two_patches_is_picked_by_its_box(drawn):
    """The pin's head is a contact; its bore stands there as comments and runs once they are uncommented."""
    assert main(["import", "plate.step", "pin.step", "held"]) == 0
    case, _ = load_case("held/case.toml")
    assert [(c.interface, c.against) for c in case.contacts] == [("plate:pin-2", "pin:plate-2")]
    assert main(["modes", "held/plate", "-q"]) == 0
    area = read_basis("build/held-plate/basis.h5").groups[0, 0].interfaces["pin-2"].areas.sum()
    assert area == pytest.approx(39e-6 * np.pi, rel=0.03)

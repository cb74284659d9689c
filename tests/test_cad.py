"""The CAD route: units, picking of faces, refusals, curved elements, complete files. gmsh runs in its own process."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from processes import run

from microslip.basis.integrals import cell_volumes
from microslip.cli import main
from microslip.mesh import mesh_problems, read_mesh
from microslip.stages import importing

pytestmark = pytest.mark.skipif(importlib.util.find_spec("gmsh") is None, reason="gmsh is not installed")

# A bracket of 60 x 40 x 6 mm with a wall of 40 mm height, a hole of 12 mm, a fillet of 4 mm along the inner corner,
# and what damaged or unsuitable files look like.
DRAWINGS = """
import gmsh, math
gmsh.initialize(readConfigFiles=False, interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ

def keep(*names):
    occ.synchronize()
    for name in names:
        gmsh.write(name)
    gmsh.clear()

base, wall = occ.addBox(0, 0, 0, 60, 40, 6), occ.addBox(0, 0, 6, 6, 40, 34)
body = occ.fuse([(3, base)], [(3, wall)])[0]
body = occ.cut(body, [(3, occ.addCylinder(40, 20, -1, 0, 0, 8, 6))])[0]
occ.synchronize()
corner = [t for _, t in gmsh.model.getEntities(1)
          if max(abs(occ.getCenterOfMass(1, t)[i] - 6) for i in (0, 2)) < 1e-6]
occ.fillet([body[0][1]], corner, [4])
keep("bracket.step", "bracket.brep", "bracket.igs")

occ.addBox(0, 0, 0, 10, 10, 10), occ.addCylinder(10, 5, 5, 8, 0, 0, 3)
keep("touching.step")
occ.addBox(0, 0, 0, 10, 10, 10), occ.addBox(5, 0, 0, 10, 10, 10)
keep("overlapping.step")
occ.addBox(0, 0, 0, 10, 10, 10), occ.addBox(10, 10, 0, 10, 10, 10), occ.addBox(40, 0, 0, 10, 10, 10)
keep("apart.step")
occ.addRectangle(0, 0, 0, 10, 10)
keep("sheet.step")

box = occ.addBox(0, 0, 0, 10, 10, 10)
occ.synchronize()
skin = [t for _, t in gmsh.model.getEntities(2)]
occ.remove([(3, box)])
occ.addVolume([occ.addSurfaceLoop(skin[:5])])
keep("open.brep")

ring = occ.cut([(2, occ.addDisk(25, 0, 0, 10, 10))], [(2, occ.addDisk(25, 0, 0, 9, 9))])[0]
occ.remove(occ.revolve(ring, 0, 0, 0, 0, 1, 0, math.pi / 2)[:0] + ring, recursive=True)
keep("elbow.step")

def airfoil(chord, turn, z):
    points = []
    for i in range(12):
        t = math.pi * i / 6
        x = 0.5 * (1 + math.cos(t))
        y = chord * (0.096 * math.sin(t) * (1.1 - x) + 0.25 * x * (1 - x))
        x = chord * (x - 0.4)
        points.append(occ.addPoint(x * math.cos(turn) - y * math.sin(turn),
                                   x * math.sin(turn) + y * math.cos(turn), z))
    return occ.addWire([occ.addSpline([*points, points[0]])])

occ.addThruSections([airfoil(40 - 4 * k, 0.2 * k, 20 * k) for k in range(5)])
keep("airfoil.step")
gmsh.finalize()
"""


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the CAD files; painted.step is the bracket with face names and two coloured faces."""
    folder = tmp_path_factory.mktemp("parts")
    done = python("-c", DRAWINGS, folder=folder)
    assert done.returncode == 0, done.stderr
    paint(folder / "bracket.step", folder / "painted.step", {0: (255, 0, 0), 2: (0, 128, 0)})
    return folder


def python(*arguments: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True, timeout=120)


def paint(source: Path, target: Path, colours: dict[int, tuple[int, int, int]]) -> None:
    """Name the faces of a STEP text face_1, face_2 ... and colour some of them (0-based), as CAD programs do."""
    text = source.read_text()
    faces = re.findall(r"^#(\d+) = ADVANCED_FACE", text, re.M)
    for i, face in enumerate(faces):
        text = text.replace(f"#{face} = ADVANCED_FACE('',", f"#{face} = ADVANCED_FACE('face_{i + 1}',")
    number = max(int(n) for n in re.findall(r"^#(\d+) =", text, re.M))
    lines, styled = [], []
    for i, rgb in colours.items():
        chain = [
            "COLOUR_RGB('',{},{},{})".format(*(c / 255 for c in rgb)),
            "FILL_AREA_STYLE_COLOUR('',#{})",
            "FILL_AREA_STYLE('',(#{}))",
            "SURFACE_STYLE_FILL_AREA(#{})",
            "SURFACE_SIDE_STYLE('',(#{}))",
            "SURFACE_STYLE_USAGE(.BOTH.,#{})",
            "PRESENTATION_STYLE_ASSIGNMENT((#{}))",
            f"STYLED_ITEM('color',(#{{}}),#{faces[i]})",
        ]
        for record in chain:
            lines.append(f"#{number + 1} = {record.format(number)};")
            number += 1
        styled.append(f"#{number}")
    context = re.search(r"ADVANCED_BREP_SHAPE_REPRESENTATION\('',\([^)]*\),(#\d+)\)", text)[1]
    shown = f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',({','.join(styled)}),{context})"
    lines.append(f"#{number + 1} = {shown};")
    end = text.rindex("ENDSEC;")
    target.write_text(text[:end] + "\n".join(lines) + "\n" + text[end:])


def mesh_cad(cad, out, faces=(), unit="mm", folder=".", **mesh):
    settings = {
        "length_unit": unit,
        "folder": str(folder),
        "geometry": {"cad": str(cad), "faces": list(faces)},
        "mesh": mesh,
    }
    note = out.with_suffix(".json")
    note.write_text(json.dumps(settings))
    return run(["microslip.cad", str(note), str(out)], module=True)


def meshed(cad, out, faces=(), unit="mm", **mesh):
    """The mesh, in metres; it must pass the quality gates."""
    done = mesh_cad(cad, out, faces, unit, **mesh)
    assert done.returncode == 0, done.stderr
    body = read_mesh(out, unit)
    errors, _ = mesh_problems(body)
    assert not errors
    return body


def refused(cad, out, *words, **settings):
    done = mesh_cad(cad, out, **settings)
    assert done.returncode == 2, done.stdout
    assert done.stderr.count("\n") == 1 and "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr
    assert not [p for p in out.parent.iterdir() if p.suffix == ".msh"]
    return done.stderr


def volume(body) -> float:
    """Of the straight-sided tetrahedra."""
    x = body.points[body.cells["tetra10"][:, :4]]
    return float(np.abs(np.linalg.det(x[:, 1:] - x[:, :1])).sum() / 6)


def area(body, face) -> float:
    x = body.points[body.faces[face]["triangle6"][:, :3]]
    return float(np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1).sum() / 2)


# ---------------------------------------------------------------- the mesh


BRACKET = 60 * 40 * 6 + 6 * 40 * 34 + 40 * 16 * (1 - np.pi / 4) - np.pi * 36 * 6  # mm3


def test_volume_and_bytes(parts: Path, tmp_path: Path) -> None:
    """The bracket's volume to 1 % (the facets of the hole are straight here), the same bytes at every run."""
    body = meshed(parts / "bracket.step", tmp_path / "a.msh", size=8)
    assert volume(body) == pytest.approx(BRACKET * 1e-9, rel=1e-2)
    meshed(parts / "bracket.step", tmp_path / "b.msh", size=8)
    assert (tmp_path / "a.msh").read_bytes() == (tmp_path / "b.msh").read_bytes()


SLOW = pytest.mark.slow  # every test here starts gmsh in a process: one of a kind is quick


@pytest.mark.parametrize(
    "file, unit, size",
    [
        ("bracket.step", "mm", 10.0),
        ("bracket.igs", "in", 0.4),
        pytest.param("bracket.step", "m", 0.01, marks=SLOW),
        pytest.param("bracket.step", "in", 0.4, marks=SLOW),
        pytest.param("bracket.igs", "m", 0.01, marks=SLOW),
        pytest.param("bracket.igs", "mm", 10.0, marks=SLOW),
    ],
)
def test_unit(parts: Path, tmp_path: Path, file: str, unit: str, size: float) -> None:
    """STEP and IGES state their unit (mm here): whatever the body file's, the bracket is 60 x 40 x 40 mm."""
    body = meshed(parts / file, tmp_path / "a.msh", unit=unit, size=size)
    assert np.ptp(body.points, axis=0) == pytest.approx([0.06, 0.04, 0.04], rel=1e-9)


def test_brep_has_no_unit(parts: Path, tmp_path: Path) -> None:
    """A BREP file's numbers are taken as they are, and 60 m of bracket are worth a warning only above 100 m."""
    assert mesh_cad(parts / "bracket.brep", tmp_path / "a.msh", unit="m", size=10).stderr == ""
    assert np.ptp(read_mesh(tmp_path / "a.msh", "m").points[:, 0]) == pytest.approx(60, rel=1e-9)
    warning = mesh_cad(parts / "bracket.brep", tmp_path / "b.msh", unit="um", size=10)
    assert warning.returncode == 0 and "warning: bracket.brep" in warning.stderr and "unit" in warning.stderr


def test_default_size(parts: Path, tmp_path: Path) -> None:
    assert 500 < meshed(parts / "bracket.step", tmp_path / "a.msh").n_cells < 20_000


def test_local_size(parts: Path, tmp_path: Path) -> None:
    """mesh.local refines at its face and leaves the rest."""
    faces = [{"name": "foot", "box": [59.9, 0, 0, 60.1, 40, 6]}, {"name": "top", "box": [0, 0, 39.9, 6, 40, 40.1]}]
    coarse = meshed(parts / "bracket.step", tmp_path / "a.msh", faces, size=8)
    fine = meshed(parts / "bracket.step", tmp_path / "b.msh", faces, size=8, local={"foot": 2.0})
    count = {name: [len(m.faces[name]["triangle6"]) for m in (coarse, fine)] for name in ("foot", "top")}
    assert count["foot"][1] > 4 * count["foot"][0]
    assert count["top"][1] < 2 * count["top"][0]


def test_first_order(parts: Path, tmp_path: Path) -> None:
    assert set(meshed(parts / "bracket.step", tmp_path / "a.msh", size=10, order=1).cells) == {"tetra"}


def test_curved_elements_are_straightened(parts: Path, tmp_path: Path) -> None:
    """A thin elbow meshed far too coarsely: gmsh's own curved elements turn inside out, ours do not."""
    done = mesh_cad(parts / "elbow.step", tmp_path / "a.msh", size=8)
    assert done.returncode == 0, done.stderr
    script = """
        import gmsh, sys, numpy as np
        gmsh.initialize(readConfigFiles=False)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(sys.argv[1])
        tags, nodes = gmsh.model.mesh.getElementsByType(11)
        print(len(tags), gmsh.model.mesh.getElementQualities(tags, "minDetJac").min())
        x = {t: p for t, p in zip(gmsh.model.mesh.getNodes()[0], gmsh.model.mesh.getNodes()[1].reshape(-1, 3))}
        e = np.array([[x[n] for n in row] for row in nodes.reshape(-1, 10)])
        ends = e[:, [[0, 1], [1, 2], [2, 0], [3, 0], [3, 2], [3, 1]]].mean(axis=2)
        bow = np.linalg.norm(e[:, 4:] - ends, axis=2)
        print((bow > 1e-6).any(axis=1).sum())
    """
    found = python("-c", textwrap.dedent(script), str(tmp_path / "a.msh")).stdout.split()
    elements, smallest, curved = int(found[0]), float(found[1]), int(found[2])
    straightened = int(re.search(r"(\d+) straightened", done.stdout)[1])
    assert smallest > 0
    assert straightened > 0 and curved > 0.3 * elements  # the others still follow the pipe


def test_touching_solids_are_joined(parts: Path, tmp_path: Path) -> None:
    """A pin on a block: one body, the common disc is no boundary."""
    everything = [{"name": "skin", "box": [-1, -1, -1, 20, 11, 11]}]
    body = meshed(parts / "touching.step", tmp_path / "a.msh", everything, size=3)
    assert volume(body) == pytest.approx((1000 + np.pi * 9 * 8) * 1e-9, rel=2e-2)
    assert area(body, "skin") == pytest.approx((600 + 2 * np.pi * 3 * 8) * 1e-6, rel=2e-2)


def test_overlapping_solids(parts: Path, tmp_path: Path) -> None:
    done = mesh_cad(parts / "overlapping.step", tmp_path / "a.msh", size=5)
    assert done.returncode == 0 and "overlap" in done.stderr
    assert volume(read_mesh(tmp_path / "a.msh", "mm")) == pytest.approx(1500e-9, rel=1e-9)


# ---------------------------------------------------------------- picking


def test_picking(parts: Path, tmp_path: Path) -> None:
    """Faces of every kind of rule on one mesh: the areas of the surfaces meant."""
    side = 60 * 6 + 34 * 6 + 16 * (1 - np.pi / 4)
    rules = {
        "colour": ({"colour": [255, 0, 0]}, side),
        "label": ({"label": "face_7"}, 40 * 6),
        "whole": ({"label": "face_1"}, side),  # the whole label wins over face_10
        "box": ({"box": [59, -1, -1, 61, 41, 7]}, 40 * 6),
        "surfaces": ({"surfaces": [4, 7]}, 2 * 40 * 6),
    }
    faces = [{"name": name, **rule} for name, (rule, _) in rules.items()]
    body = meshed(parts / "painted.step", tmp_path / "a.msh", [*faces, {"name": "all", "label": "face"}], size=10)
    assert set(body.faces) == {*rules, "all"}
    for name, (_, expected) in rules.items():
        assert area(body, name) == pytest.approx(expected * 1e-6, rel=5e-3), name
    surface = 2 * side + 40 * 6 * 2 + 40 * (60 + 40 + 50 + 30 + 2 * np.pi) + 12 * np.pi * 6 - 2 * np.pi * 36
    assert area(body, "all") == pytest.approx(surface * 1e-6, rel=1e-2)  # a part of a label


def test_labels_and_colours_survive_joining(parts: Path, tmp_path: Path) -> None:
    paint(parts / "touching.step", tmp_path / "two.step", {1: (10, 20, 30)})
    faces = [{"name": "red", "colour": [10, 20, 30]}, {"name": "pin", "label": "face_7"}]
    body = meshed(tmp_path / "two.step", tmp_path / "a.msh", faces, size=2)
    disc = 0.95 * 9 * np.pi  # mm2, as a polygon of 12 sides
    assert area(body, "red") == pytest.approx((100 - disc) * 1e-6, rel=2e-2)  # what the pin leaves of it
    assert area(body, "pin") == pytest.approx(48 * np.pi * 1e-6, rel=2e-2)


def test_shared_surface_warns(parts: Path, tmp_path: Path) -> None:
    rules = [{"name": "one", "surfaces": [7]}, {"name": "two", "box": [59, -1, -1, 61, 41, 7]}]
    done = mesh_cad(parts / "bracket.step", tmp_path / "a.msh", rules, size=10)
    assert done.returncode == 0
    assert re.search("warning: surface 7 belongs to the faces 'one' and 'two'", done.stderr)


def test_table(parts: Path) -> None:
    """The list from which faces are chosen: outward normals, areas, labels, colours."""
    done = python("-m", "microslip.cad", "--list", str(parts / "painted.step"), "cm")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert lines[0] == "painted.step, lengths in cm: 6 x 4 x 4, from (0 0 0) to (6 4 4)"
    assert sorted(re.findall(r"Cylinder .* radius (\S+)", done.stdout)) == ["0.4", "0.6"]  # the fillet, the hole
    assert float(re.search(r"volume (\S+),", lines[1])[1]) == pytest.approx(BRACKET * 1e-3, rel=1e-5)
    assert lines[9].split() == ["7", "Plane", "2.4", "6", "2", "0.3", "1", "0", "0", "face_7"]
    assert lines[3].split()[-2:] == ["255,0,0", "face_1"] and len(lines) == 13


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    "file, words",
    [
        pytest.param("nothing.step", ["geometry.cad", "no file"], marks=SLOW),
        ("sheet.step", ["geometry.cad", "no solid", "export it as a solid"]),
        ("open.brep", ["geometry.cad", "open along 4 edges"]),
        ("apart.step", ["geometry.cad", "3 parts"]),
    ],
)
def test_unsuitable_file(parts: Path, tmp_path: Path, file: str, words: list[str]) -> None:
    refused(parts / file, tmp_path / "a.msh", file, *words, size=5)


QUICK = ("bracket.step", 0.3), ("bracket.brep", 0.995), ("bracket.igs", 0.7)
CUT = [(f, s) for f in ("bracket.step", "bracket.brep", "bracket.igs") for s in (0.0, 0.3, 0.7, 0.995)]


@pytest.mark.parametrize("file, share", [c if c in QUICK else pytest.param(*c, marks=SLOW) for c in CUT])
def test_truncated_file(parts: Path, tmp_path: Path, file: str, share: float) -> None:
    whole = (parts / file).read_bytes()
    short = tmp_path / file
    short.write_bytes(whole[: int(share * len(whole))])
    refused(short, tmp_path / "a.msh", "geometry.cad", file, size=8)


def test_open_shell(parts: Path, tmp_path: Path) -> None:
    """A solid one of whose faces is missing in the file."""
    text = (parts / "bracket.step").read_text()
    holed = re.sub(r"(CLOSED_SHELL\('',\(#\d+),#\d+", r"\1", text)
    (tmp_path / "holed.step").write_text(holed)
    refused(tmp_path / "holed.step", tmp_path / "a.msh", "geometry.cad", "open", size=8)


@pytest.mark.parametrize(
    "settings, words",
    [
        ({"size": -1}, ["mesh.size = -1"]),
        pytest.param({"size": "big"}, ["mesh.size = 'big'"], marks=SLOW),
        ({"size": 1e-4}, ["mesh.size", "length_unit"]),
        pytest.param({"size": 8, "order": 3}, ["mesh.order = 3"], marks=SLOW),
        ({"size": 8, "local": {"clmp": 2.0}}, ["mesh.local.clmp", "clamp"]),
        pytest.param({"size": 8, "local": {"clamp": 0.0}}, ["mesh.local.clamp"], marks=SLOW),
        pytest.param({"size": 8, "unit": "furlong"}, ["length_unit = 'furlong'", "mm"], marks=SLOW),
    ],
)
def test_bad_settings(parts: Path, tmp_path: Path, settings: dict, words: list[str]) -> None:
    faces = [{"name": "clamp", "box": [-1, -1, -1, 1, 41, 41]}]
    refused(parts / "bracket.step", tmp_path / "a.msh", *words, faces=faces, **settings)


@pytest.mark.parametrize(
    "rule",
    [{"label": "clampp"}]
    + [pytest.param(r, marks=SLOW) for r in ({"colour": [1, 2, 3]}, {"box": [0, 0, 0, 1, 1, 1]}, {"surfaces": [99]})],
)
def test_rule_without_surface(parts: Path, tmp_path: Path, rule: dict) -> None:
    faces = [{"name": "clamp", **rule}]
    words = ["'clamp'", next(iter(rule)), "10 surfaces", "microslip info"]
    refused(parts / "painted.step", tmp_path / "a.msh", *words, faces=faces, size=8)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("def draw(parameters):\n    pass\n\n\nrun(draw)\n", ["build.py, line 5: draw", "draw(parameters, mesh)"]),
        (
            "def draw(parameters, mesh):\n    open('blade.csv')\n\n\nrun(draw)\n",
            ["build.py, line 6: blade.csv: No such file", "Path(__file__).parent / "],
        ),
        ("def draw(parameters, mesh):\n    return 1 / 0\n\n\nrun(draw)\n", ["build.py, line 6: ZeroDivisionError"]),
        ("import numpyy\n", ["build.py, line 5: ModuleNotFoundError: No module named 'numpyy'"]),
        ("def draw(parameters, mesh)\n", ["build.py, line 5: SyntaxError: expected ':'"]),
    ],
)
def test_what_fails_in_a_build_file_is_told_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], lines: str, said: list[str]
) -> None:
    """File, line and what is expected, and no traceback."""
    (tmp_path / "build.py").write_text(f'"""A body."""\n\nfrom microslip.cad import run\n\n{lines}')
    (tmp_path / "body.toml").write_text(
        'name = "box"\nlength_unit = "mm"\n[geometry]\nbuild = "build.py"\n[mesh]\nsize = 20.0\n'
        "[material]\ndensity = 7850.0\nyoung = 2.1e11\npoisson = 0.3\n"
    )
    assert main(["mesh", str(tmp_path), "-q"]) == 2
    told = capsys.readouterr().err
    assert all(one in told for one in ["body.toml", *said]) and "Traceback" not in told, told


def test_unwritable(parts: Path, tmp_path: Path) -> None:
    """A file stands where the folder should be."""
    (tmp_path / "taken").write_text("")
    note = tmp_path / "a.json"
    note.write_text(json.dumps({"length_unit": "mm", "geometry": {"cad": str(parts / "bracket.step")}}))
    done = python("-m", "microslip.cad", str(note), str(tmp_path / "taken" / "a.msh"))
    assert done.returncode == 2 and "Traceback" not in done.stderr


@pytest.mark.skipif(os.name == "nt", reason="signals")
@pytest.mark.parametrize("sign", [signal.SIGINT, pytest.param(signal.SIGKILL, marks=pytest.mark.slow)])
def test_stopped_half_way(parts: Path, tmp_path: Path, sign: int) -> None:
    """Stopped while meshing: the process ends at once and leaves no mesh."""
    note, out = tmp_path / "a.json", tmp_path / "a.msh"
    geometry = {"cad": str(parts / "bracket.step")}
    note.write_text(json.dumps({"length_unit": "mm", "geometry": geometry, "mesh": {"size": 0.5}}))
    process = subprocess.Popen([sys.executable, "-m", "microslip.cad", str(note), str(out)])
    time.sleep(2.0)
    process.send_signal(sign)
    assert process.wait(timeout=60) != 0  # one that goes on ends with 0, and its mesh
    assert not out.exists()


# parts of the surface -------------------------------------------------------------------------------------------------

TWO_PLATES = """
import gmsh
gmsh.initialize(readConfigFiles=False, interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
for name, x, z in (("lower", 0, 0), ("upper", 70, 5)):
    gmsh.model.occ.addBox(x, 0, z, 100, 20, 5)
    gmsh.model.occ.synchronize()
    gmsh.write(f"{name}.step")
    gmsh.clear()
gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 40, 10)
gmsh.model.occ.synchronize()
gmsh.write("pin.step")
"""


@pytest.fixture(scope="module")
def plates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two plates of 100 x 20 x 5 mm that overlap over 30 x 20 mm, and a pin of 20 mm."""
    folder = tmp_path_factory.mktemp("plates")
    assert python("-c", TWO_PLATES, folder=folder).returncode == 0
    return folder


def test_a_face_where_two_bodies_touch(plates: Path, tmp_path: Path) -> None:
    """A lap joint: each plate has the other's part of its surface as a face, to the digit, and the same volume."""
    for own, other in (("lower", "upper"), ("upper", "lower")):
        rule = {"name": "joint", "touching": str(plates / f"{other}.step")}
        body = meshed(plates / f"{own}.step", tmp_path / f"{own}.msh", [rule], size=8)
        assert volume(body) == pytest.approx(1e-5, rel=1e-9) and area(body, "joint") == pytest.approx(6e-4, rel=1e-9)
        z = body.points[np.unique(np.concatenate([f.ravel() for f in body.faces["joint"].values()]))]
        assert np.ptp(z[:, 2]) < 1e-9 and z[:, 0].min() == pytest.approx(0.07) and z[:, 0].max() == pytest.approx(0.1)


def test_a_box_cuts_its_part_out_of_the_surface(plates: Path, tmp_path: Path) -> None:
    """Of a plane and of a cylinder; what is left of a numbered surface stays that surface."""
    top = next(line for line in table_of(plates / "lower.step") if " 0 0 1 " in f" {line} ").split()[0]
    rules = [
        {"name": "pad", "box": [10, 5, 4, 30, 15, 6], "cut": True},
        {"name": "rest", "surfaces": [int(top)]},
    ]
    body = meshed(plates / "lower.step", tmp_path / "lower.msh", rules, size=8)
    assert area(body, "pad") == pytest.approx(2e-4, rel=1e-9) and area(body, "rest") == pytest.approx(1.8e-3, rel=1e-9)
    half = [{"name": "half", "box": [-11, 0, 10, 11, 11, 30], "cut": True}]
    pin = meshed(plates / "pin.step", tmp_path / "pin.msh", half, size=4)
    assert area(pin, "half") == pytest.approx(np.pi * 2e-4, rel=2e-2)  # chords


def table_of(cad: Path) -> list[str]:
    return python("-m", "microslip.cad", "--list", str(cad), "mm").stdout.splitlines()


@pytest.mark.parametrize(
    "rules, words",
    [
        ([{"name": "pad", "box": [200, 0, 0, 210, 5, 5], "cut": True}], ["'pad'", "no part of the surface"]),
        ([{"name": "pad", "touching": "away.step"}], ["'pad'", "there is no file", "away.step"]),
        ([{"name": n, "box": [x, 0, 4, x + 20, 10, 6], "cut": True} for n, x in (("a", 0), ("b", 9))], ["overlap"]),
    ],
)  # fmt: skip
def test_parts_that_cannot_be_cut(plates: Path, tmp_path: Path, rules: list, words: list[str]) -> None:
    refused(plates / "lower.step", tmp_path / "lower.msh", *words, faces=rules)


def test_an_airfoil_of_one_closed_spline(parts: Path, tmp_path: Path) -> None:
    """Its surface meets itself along a seam, which gmsh refines for ever where it mends triangles that overlap: a table
    with triangles for its picture, and a mesh of its volume to 2 %: 0.0908 of a square over its chord (periodic cubic
    spline), that shrinks from 40 to 24 mm, and not what OpenCASCADE integrates."""
    out = tmp_path / "surfaces.npz"
    listed = run(["microslip.cad", "--list", str(parts / "airfoil.step"), "mm", str(out)], module=True)
    assert listed.returncode == 0 and "BSpline surface" in listed.stdout
    assert len(np.load(out)["triangles"]) < 20_000
    done = mesh_cad(parts / "airfoil.step", tmp_path / "a.msh", size=8)
    assert done.returncode == 0, done.stderr
    drawn = 0.0908 * 80 * (40**2 + 40 * 24 + 24**2) / 3 * 1e-9
    assert cell_volumes(read_mesh(tmp_path / "a.msh", "mm")) == pytest.approx(drawn, rel=0.02)


@pytest.mark.parametrize("limit, tries", [(0.05, 3), (60.0, 1)])
def test_a_picture_that_takes_too_long_is_left_out(
    parts: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: float, tries: int
) -> None:
    """Triangles as the surfaces bend, coarse ones, then the table alone, each told before it begins."""
    monkeypatch.setattr(importing, "LONGEST_LOOK", limit)
    monkeypatch.setattr(importing, "_draw", lambda *_: "")
    told: list[str] = []
    text, reason = importing.cad_table(parts / "bracket.step", "mm", tmp_path / "a.png", told.append)
    assert "surface kind" in text and len(told) == tries and bool(reason) == (tries == 3)

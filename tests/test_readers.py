"""Readers of other programs' meshes: gmsh as the producer of every cell type, materials, refusals, changed bytes."""

from __future__ import annotations

import dataclasses
import random
import re
from collections.abc import Callable
from pathlib import Path

import decks
import h5py
import meshes
import numpy as np
import pytest
from processes import run
from refusals import refused, refused_command
from test_bdf import bulk
from test_cdb import archive
from test_fuzz import flipped, user_errors_only
from test_mesh import TET

from microslip.cli import main
from microslip.data import Mesh
from microslip.elasticity import isotropic
from microslip.errors import UserError
from microslip.mesh import mesh_problems, read_mesh
from microslip.mesh.med import vtk_places

DRAW = """
import sys, numpy as np, gmsh
kind, files = sys.argv[1], sys.argv[2:]
gmsh.initialize(interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
occ, mesh = gmsh.model.occ, gmsh.model.mesh
if kind == "wedge":
    occ.extrude([(2, occ.addRectangle(0, 0, 0, 1, 1.2))], 0, 0, 1.5, numElements=[2], recombine=True)
else:
    occ.addBox(0, 0, 0, 1, 1.2, 1.5)
occ.synchronize()
for _, tag in gmsh.model.getEntities(1):
    mesh.setTransfiniteCurve(tag, 3)
for _, tag in gmsh.model.getEntities(2) if kind != "wedge" else ():
    mesh.setTransfiniteSurface(tag)
    if kind != "tetra":
        mesh.setRecombine(2, tag)
for _, tag in gmsh.model.getEntities(3) if kind.startswith("hexahedron") else ():
    mesh.setTransfiniteVolume(tag)
gmsh.model.addPhysicalGroup(3, [1], name="body")
gmsh.model.addPhysicalGroup(2, [1], name="side")
gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 0 if kind == "hexahedron27" else 1)
mesh.generate(3)
mesh.setOrder(2)
tags, x, _ = mesh.getNodes()
x = x.reshape(-1, 3)
bent = x + 0.07 * np.sin(np.column_stack([1.3 * x[:, 1] + x[:, 2], 1.7 * x[:, 0], 2 * x[:, 0] * x[:, 1] + 1]))
for tag, place in zip(tags, bent):
    mesh.setNode(tag, place, [])
gmsh.option.setNumber("Mesh.BdfFieldFormat", 2)
for file in files:
    gmsh.write(file)
"""
WRITTEN = {  # what gmsh writes in the other program's order; no program but gmsh has those it leaves out
    "tetra": (".msh", ".inp", ".med", ".unv", ".bdf", ".vtk"), "hexahedron20": (".msh", ".inp", ".med", ".unv", ".bdf"),
    "hexahedron27": (".msh", ".inp", ".med", ".vtk"), "wedge": (".msh", ".inp", ".med", ".unv", ".bdf"),
    "pyramid": (".msh", ".med"),
}  # fmt: skip


def by_place(mesh: Mesh, kind: str) -> np.ndarray:
    """(e, k, 3) places of the nodes of each cell, cells sorted by their centre."""
    places = mesh.points[mesh.cells[kind]]
    centre = np.round(places.mean(axis=1), 6)
    return places[np.lexsort(centre.T)]


@pytest.mark.parametrize("kind", WRITTEN)
def test_cells_that_gmsh_writes_are_the_same_in_every_format(kind: str, tmp_path: Path) -> None:
    """Bent cells of second order, against gmsh's own format; the bulk data has nine digits."""
    files = [tmp_path / f"a{suffix}" for suffix in WRITTEN[kind]]
    (tmp_path / "draw.py").write_text(DRAW)
    done = run([str(tmp_path / "draw.py"), kind, *map(str, files)])
    assert done.returncode == 0, done.stderr
    first = read_mesh(files[0], "m")
    assert not mesh_problems(first)[0] and any(t.startswith(kind) for t in first.cells)
    for file in files[1:]:
        other = read_mesh(file, "m")
        assert set(other.cells) == set(first.cells), file.suffix
        for cell_type in first.cells:
            np.testing.assert_allclose(by_place(other, cell_type), by_place(first, cell_type), atol=2e-9)
        if file.suffix in (".med", ".unv", ".inp"):
            assert len(other.face_points("side")) == len(first.face_points("side"))
            np.testing.assert_array_equal(np.sort(other.node_id), np.sort(first.node_id))


# MEDCoupling's reference coordinates of a HEXA27, without the corners' signs: MED turns the other way round than VTK
MED27 = [
    (0, 0, 0), (0, 2, 0), (2, 2, 0), (2, 0, 0), (0, 0, 2), (0, 2, 2), (2, 2, 2), (2, 0, 2), (0, 1, 0), (1, 2, 0),
    (2, 1, 0), (1, 0, 0), (0, 1, 2), (1, 2, 2), (2, 1, 2), (1, 0, 2), (0, 0, 1), (0, 2, 1), (2, 2, 1), (2, 0, 1),
    (1, 1, 0), (0, 1, 1), (1, 2, 1), (2, 1, 1), (1, 0, 1), (1, 1, 2), (1, 1, 1),
]  # fmt: skip


def test_the_brick_of_27_nodes_of_med_is_that_of_its_own_library() -> None:
    from microslip.topology import CELL_TYPES

    ours = CELL_TYPES["hexahedron27"].reference * 2
    np.testing.assert_allclose(np.array(MED27)[vtk_places("hexahedron27")], ours)


# universal files ------------------------------------------------------------------------------------------------------


def unv(mesh: Mesh, kind: int = 111) -> str:
    """Tetrahedra, a triangle of the lower face and a group of both kinds."""
    lines = ["    -1", "  2411"]
    for i, x in zip(mesh.node_id, mesh.points, strict=True):
        lines += [f"{i:10d}{1:10d}{1:10d}{11:10d}", "".join(f"{v:25.16E}".replace("E", "D") for v in x)]
    lines += ["    -1", "    -1", "  2412"]
    (face,) = mesh.faces["z0"].values()
    for number, nodes in enumerate(face, 1):
        lines += ["".join(f"{v:10d}" for v in (number, 91, 1, 1, 7, 3)), "".join(f"{v:10d}" for v in nodes[:3] + 1)]
    lines += [f"{90:10d}{21:10d}{1:10d}{1:10d}{7:10d}{2:10d}", f"{0:10d}{1:10d}{1:10d}", f"{1:10d}{2:10d}"]
    for number, nodes in enumerate(mesh.cells["tetra"], 101):
        lines += ["".join(f"{v:10d}" for v in (number, kind, 1, 1, 7, 4)), "".join(f"{v:10d}" for v in nodes + 1)]
    members = [(8, n) for n in range(1, len(face) + 1)] + [(7, 1)]
    lines += ["    -1", "    -1", "  2467", "".join(f"{v:10d}" for v in (1, 0, 0, 0, 0, 0, 0, len(members))), "root"]
    lines += [f"{a:10d}{b:10d}{0:10d}{0:10d}" for a, b in members]
    return "\n".join([*lines, "    -1", ""])


def tetrahedra() -> Mesh:
    return meshes.brick("tetra", (1, 1, 2), (0.01, 0.012, 0.03))


def test_groups_and_numbers_of_a_universal_file(tmp_path: Path) -> None:
    (tmp_path / "a.unv").write_text(unv(tetrahedra()))
    mesh = read_mesh(tmp_path / "a.unv", "m")
    np.testing.assert_array_equal(mesh.cells["tetra"], tetrahedra().cells["tetra"])
    assert sum(map(len, mesh.faces["root"].values())) == 2 and mesh.point_sets["root"].tolist() == [0]
    assert mesh.cell_id["tetra"].tolist() == list(range(101, 113))


AXES = " 1. 0. 0.\n 0. 1. 0.\n 0. 0. 1.\n 0. 0. 0.\n"
SYSTEM = f"    -1\n  2420\n         1\nPart\n         1{{}}         8\nCS1\n{AXES}    -1\n"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("       111", "       117", "element 101 is of the I-deas type 117"),
        ("       111", "       118", "element 101 has 4 nodes, its type 118 (tetra10) 10"),
        ("       102       111", "       101       111", "element 101 is defined twice"),
        ("  2411", "  2410", "no nodes"),
        ("         5        ", "        77        ", "which the file does not define"),
        ("         3\nroot", "         9\nroot", "line 68: the group 'root' is not whole"),
    ],
)
def test_universal_files_that_are_wrong(tmp_path: Path, old: str, new: str, words: str) -> None:
    whole = unv(tetrahedra())
    assert old in whole
    (tmp_path / "a.unv").write_text(whole.replace(old, new, 1))
    refused(words, read_mesh, tmp_path / "a.unv", "m")


SOLVED = """    -1
   164
         5   mm (milli-newton)         2
  1.0D+03  1.0D+03  1.0D+00
  2.73D+02
    -1
{mesh}    -1
    55
temperature
NONE
NONE
NONE
NONE
         1         0         1         5         2         1
         1         1         0
  0.0
         1
  2.0E+01
    -1
    -1
  2414
         1
    -1
"""


def test_results_beside_a_mesh_are_left_aside(tmp_path, monkeypatch, capsys):
    """Fields of a solver (data sets 55 without modes and 2414) and the file's own unit of length.
    """
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.unv").write_text(SOLVED.format(mesh=unv(tetrahedra())))
    assert main(["import", "a.unv", "part"]) == 0
    said = capsys.readouterr().out
    assert "no part of the body: 55 (results at nodes), 2414" in said
    assert 'length_unit = "mm"' in (tmp_path / "part" / "body.toml").read_text()
    (tmp_path / "a.unv").write_text(
        SOLVED.format(mesh=unv(tetrahedra())).replace("1.0D+03", "1.0D+00", 1)
    )
    assert main(["import", "a.unv", "other"]) == 0
    assert 'length_unit = "m"' in (tmp_path / "other" / "body.toml").read_text()


def test_local_systems_of_a_universal_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.unv").write_text(SYSTEM.format("         0") + unv(tetrahedra()))
    assert read_mesh(tmp_path / "a.unv", "m").n_cells == 12
    (tmp_path / "a.unv").write_text(SYSTEM.format("         1") + unv(tetrahedra()))
    refused("node 1 stands in the local coordinate system 1", read_mesh, tmp_path / "a.unv", "m")
    unused = SYSTEM.format("         1").replace("\n         1         1", "\n         7         1")
    (tmp_path / "a.unv").write_text(unused + unv(tetrahedra()))
    assert read_mesh(tmp_path / "a.unv", "m").n_cells == 12


def old(text: str) -> str:
    """The same mesh in the older data sets 15 and 780."""
    parts = [part.split("\n") for part in text.split("    -1\n") if part.strip()]
    nodes, cells, *rest = ([line for line in part if line] for part in parts)
    short = (f"{a}{''.join(f'{float(v):13.5E}' for v in b.replace('D', 'E').split())}"
             for a, b in zip(nodes[1::2], nodes[2::2], strict=True))  # fmt: skip
    wide = (line[:20] + "         1         1" * 2 + line[40:] if len(line) == 60 else line for line in cells[1:])
    sets = (["    15", *short], ["   780", *wide], *rest)
    return "".join("\n".join(["    -1", *part, "    -1", ""]) for part in sets)


def test_old_universal_files_are_the_same(tmp_path: Path) -> None:
    (tmp_path / "a.unv").write_text(old(unv(tetrahedra())))
    mesh = read_mesh(tmp_path / "a.unv", "m")
    np.testing.assert_array_equal(mesh.cells["tetra"], tetrahedra().cells["tetra"])
    assert sum(map(len, mesh.faces["root"].values())) == 2 and not mesh.hanging


LINE, LUMP = (f"{e:10d}{k:10d}{1:10d}{1:10d}{7:10d}{n:10d}\n" for e, k, n in ((90, 21, 2), (92, 161, 1)))
SPRING = f"{91:10d}{136:10d}{1:10d}{1:10d}{7:10d}{2:10d}\n{1:10d}{2:10d}\n"


def test_what_is_no_solid_in_a_universal_file_is_told(tmp_path, monkeypatch, capsys):
    """Lines along edges are the mesher's; a beam across a cell, a lumped mass and a spring change frequencies."""
    monkeypatch.chdir(tmp_path)
    whole = unv(tetrahedra())
    line = whole.index(LINE) + len(LINE)
    across = whole[:line] + whole[line:].replace(f"{1:10d}{2:10d}\n", f"{1:10d}{12:10d}\n", 1)
    Path("a.unv").write_text(across)
    words = "a.unv, line 34: 1 of type 21 (beam) share nodes", "--solids-only"
    refused_command(["import", "a.unv", "part"], capsys, *words)
    lumped = whole.replace(LINE, f"{LUMP}{1:10d}\n{SPRING}{LINE}")
    Path("b.unv").write_text(lumped)
    assert main(["import", "b.unv", "part"]) == 0
    said = capsys.readouterr().out
    assert "b.unv, line 34: 1 lumped mass is not read" in said and "b.unv, line 36: 1 spring is" in said


def test_truncated_universal_files_are_refused(tmp_path: Path) -> None:
    lines = unv(tetrahedra()).splitlines()
    for keep in range(3, len(lines) - 1):
        (tmp_path / "a.unv").write_text("\n".join(lines[:keep]))
        with pytest.raises(UserError):
            assert "root" not in read_mesh(tmp_path / "a.unv", "m").faces
            raise UserError("without its last data set")  # cut between data sets: a mesh without the group


# bulk data -----------------------------------------------------------------------------------------------------------

STEEL = "MAT1           1 2.1+11              .3   7850.  1.2-5\nPSOLID         1       1\n"


def deck(text: str, more: str = STEEL) -> str:
    return text.replace("ENDDATA", more + "ENDDATA")


def test_materials_and_sets_of_bulk_data(tmp_path: Path) -> None:
    """Nastran's short numbers, points held by SPC1, a list over two lines, a shell on a face, weight as density."""
    mesh = meshes.brick("hexahedron", (1, 1, 2), (0.01, 0.012, 0.03))
    root, tip = (mesh.node_id[mesh.face_points(name)] for name in ("z0", "z1"))
    text = bulk(mesh)
    more = f"SPC1,7,123,{','.join(map(str, root))}\nSET1,9,{tip[0]},THRU,{tip[-1]}\n"
    corners = ",".join(str(mesh.node_id[i]) for i in next(iter(mesh.faces["z0"].values()))[0])
    more += f"PARAM,WTMASS,.5\nCQUAD4,900,4,{corners}\n"
    (tmp_path / "a.bdf").write_text(deck(text, STEEL + more))
    read = read_mesh(tmp_path / "a.bdf", "m", "m-kg-s")
    (steel,) = read.materials
    np.testing.assert_allclose(steel.elasticity, isotropic(2.1e11, 0.3), rtol=1e-15)
    assert steel.density == 3925.0 and steel.expansion[0] == 1.2e-5
    np.testing.assert_array_equal(read.node_id[read.point_sets["SPC 7"]], np.sort(root))
    np.testing.assert_array_equal(read.node_id[read.point_sets["SET 9"]], np.arange(tip[0], tip[-1] + 1))
    assert len(read.faces["PSHELL 4"]["quad"]) == 1 and "SPC 7" in read.faces
    shear = STEEL.replace(" 2.1+11              .3", " 2.1+11  8.+10        ")
    (tmp_path / "b.bdf").write_text(deck(text, shear))
    found = read_mesh(tmp_path / "b.bdf", "m", "m-kg-s").materials[0]
    np.testing.assert_allclose(found.elasticity, isotropic(2.1e11, 2.1e11 / 1.6e11 - 1), rtol=1e-14)


def test_bulk_data_runs_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """microslip import takes the material of the deck."""
    monkeypatch.chdir(tmp_path)
    mesh = meshes.brick("wedge15", (1, 1, 2), (0.01, 0.012, 0.03))
    (tmp_path / "part.bdf").write_text(deck(bulk(mesh)))
    assert main(["import", "part.bdf", "--unit", "m"]) == 0
    assert 'from = "mesh"' in (tmp_path / "part" / "body.toml").read_text()
    assert main(["modes", "part", "-q", "--set", "modes.count=8", "--set", "modes.solver=superlu"]) == 0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("CHEXA          1       1", "CHEXA          2       1", "CHEXA 2 is there already"),
        ("CHEXA          1       1       1", "CHEXA          1       1        ", "has 7 nodes; 8 or 20"),
        ("PSOLID         1       1", "PSOLID         1       3", "MAT1 3 (missing)"),
        ("PSOLID         1 ", "PSOLID         2 ", "no PSOLID defines"),
        ("MAT1  ", "MAT9  ", "MAT9 1"),
        ("   7850.", "        ", "no density"),
        ("      .3", "      .5", "which no solid has"),
        ("GRID* ", "GRIDS ", "GRID"),
        (" 2.1+11", " 2.1x11", "where a number belongs"),
        ("ENDDATA", "INCLUDE 'more.bdf'", "INCLUDE names more.bdf, which is not there"),
        ("ENDDATA", "SET1,3,1,THRU", "THRU without its ends"),
    ],
)
def test_bulk_data_that_is_wrong(tmp_path: Path, old: str, new: str, words: str) -> None:
    whole = deck(bulk(meshes.brick("hexahedron", (1, 1, 2), (0.01, 0.012, 0.03))))
    assert old in whole
    (tmp_path / "a.bdf").write_text(whole.replace(old, new, -1 if "GRID" in old else 1))
    refused(words, read_mesh, tmp_path / "a.bdf", "m", "m-kg-s")


def test_grid_points_in_a_system_that_is_missing_are_refused(tmp_path: Path) -> None:
    whole = bulk(meshes.brick("hexahedron", (1, 1, 1)))
    local = re.sub(r"(GRID\* {3} {15}1) {16}", lambda m: f"{m[1]}{5:16d}", whole, count=1)
    assert local != whole
    (tmp_path / "a.bdf").write_text(local)
    refused("GRID 1 uses the coordinate system 5, which no CORD card defines", read_mesh, tmp_path / "a.bdf", "m")


# MED -----------------------------------------------------------------------------------------------------------------


def med(path: Path) -> Path:
    """A tetrahedral mesh with a face and a set of points, in the layout of MED 4."""
    mesh = tetrahedra()
    with h5py.File(path, "w") as file:
        step = file.create_group("ENS_MAA/part/-0000000000000000001-0000000000000000001")
        step["NOE/COO"] = mesh.points.T.ravel()
        step["NOE/COO"].attrs["NBR"] = mesh.n_points
        step["NOE/FAM"] = np.where(np.arange(mesh.n_points) < 3, 2, 0)
        cells = mesh.cells["tetra"][:, [0, 2, 1, 3]] + 1
        (face,) = mesh.faces["z0"].values()
        for name, nodes, family in (("TE4", cells, 0), ("TR3", face[:, [0, 2, 1]] + 1, -1)):
            step[f"MAI/{name}/NOD"] = nodes.T.ravel()
            step[f"MAI/{name}/NOD"].attrs["NBR"] = len(nodes)
            step[f"MAI/{name}/FAM"] = np.full(len(nodes), family)
        for side, label, number in (("ELEME", "root", -1), ("NOEUD", "three", 2)):
            family = file.create_group(f"FAS/part/{side}/{label}")
            family.attrs["NUM"] = number
            text = np.zeros((1, 80), dtype=np.int8)
            text[0, : len(label)] = np.frombuffer(label.encode(), dtype=np.int8)
            kind = np.dtype(("i1", (80,)))
            family.create_dataset("GRO/NOM", shape=(1,), dtype=kind)[0] = text[0]
    return path


@pytest.mark.usefixtures("untried")
def test_groups_of_med(tmp_path: Path) -> None:
    mesh = read_mesh(med(tmp_path / "a.med"), "m")
    np.testing.assert_array_equal(mesh.cells["tetra"], tetrahedra().cells["tetra"])
    assert len(mesh.faces["root"]["triangle"]) == 2 and mesh.point_sets["three"].tolist() == [0, 1, 2]
    assert not mesh_problems(mesh)[0]


def external(file: h5py.File) -> None:
    del file["ENS_MAA"]
    file["ENS_MAA"] = h5py.ExternalLink("/etc/passwd", "/")


def bomb(file: h5py.File) -> None:
    step = next(iter(file["ENS_MAA/part"].values()))
    del step["NOE/COO"]
    step["NOE"].create_dataset("COO", (10**13,), "f8", chunks=(10**6,), compression="gzip")


def twice(file: h5py.File) -> None:
    file.copy("ENS_MAA/part", "ENS_MAA/again")


def outside(file: h5py.File) -> None:
    next(iter(file["ENS_MAA/part"].values()))["MAI/TE4/NOD"][0] = 10**6


def unknown(file: h5py.File) -> None:
    next(iter(file["ENS_MAA/part"].values())).move("MAI/TE4", "MAI/POE")


@pytest.mark.usefixtures("untried")
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (external, "link to another place"), (bomb, "claims more data"), (twice, "holds 2 meshes"),
        (outside, "not in the file"), (unknown, "MED's type POE"),
    ],
)  # fmt: skip
def test_med_files_that_are_wrong(tmp_path: Path, change: Callable[[h5py.File], None], words: str) -> None:
    with h5py.File(med(tmp_path / "a.med"), "r+") as file:
        change(file)
    with user_errors_only(), pytest.raises(UserError, match=words):
        read_mesh(tmp_path / "a.med", "m")


# XML and formats that are not read -----------------------------------------------------------------------------------


def test_entities_of_xml_are_refused(tmp_path: Path) -> None:
    """Ten levels of ten: a thousand bytes that would become ten thousand million."""
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 11))
    (tmp_path / "a.vtu").write_text(
        f'<?xml version="1.0"?><!DOCTYPE VTKFile [<!ENTITY l0 "laugh">{laughs}]><VTKFile>&l10;</VTKFile>'
    )
    with user_errors_only(), pytest.raises(UserError, match="entities of XML"):
        read_mesh(tmp_path / "a.vtu", "m")
    (tmp_path / "b.vtu").write_text('<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><VTKFile>&x;</VTKFile>')
    refused("entities of XML", read_mesh, tmp_path / "b.vtu", "m")


@pytest.mark.parametrize("suffix", [".xdmf", ".h5m", ".e", ".cgns", ".npz", ".pkl", ".yaml", ""])
def test_formats_that_may_lead_elsewhere_are_not_opened(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"a{suffix}").write_text("!!python/object/apply:os.system [exit]\n")
    refused("meshes are not read from a file", read_mesh, tmp_path / f"a{suffix}", "m")


# nodes in any order ----------------------------------------------------------------------------------------------


def shuffled(text: str, first: int, last: int, lines_each: int) -> str:
    """The records of nodes between two lines in another order."""
    lines = text.splitlines()
    records = [lines[i : i + lines_each] for i in range(first, last, lines_each)]
    random.Random(1).shuffle(records)
    return "\n".join([*lines[:first], *(line for r in records for line in r), *lines[last:], ""])


@pytest.mark.parametrize("suffix", [".inp", ".cdb", ".bdf", ".unv"])
def test_nodes_may_stand_in_any_order(tmp_path: Path, suffix: str) -> None:
    """Cells and sets go by number: the same places, the numbers kept."""
    mesh = tetrahedra()
    n = mesh.n_points
    text, first, each = {
        ".inp": ("\n".join(decks.mesh_lines(mesh, 1.0, ("z0",))), 1, 1),
        ".cdb": (archive(mesh, ("z0",), scale=1.0), 5, 1),
        ".bdf": (bulk(mesh), 3, 2),
        ".unv": (unv(mesh), 2, 2),
    }[suffix]
    for name, content in (("sorted", text), ("shuffled", shuffled(text, first, first + each * n, each))):
        (tmp_path / f"{name}{suffix}").write_text(content)
    one, other = (read_mesh(tmp_path / f"{name}{suffix}", "m") for name in ("sorted", "shuffled"))
    assert one.node_id.tolist() != other.node_id.tolist()
    np.testing.assert_array_equal(one.points[one.cells["tetra"]], other.points[other.cells["tetra"]])
    for name in one.point_sets:
        assert set(one.node_id[one.point_sets[name]]) == set(other.node_id[other.point_sets[name]])


# changed bytes -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".unv", ".bdf"])
def test_changed_bytes_of_text_are_read_or_refused(tmp_path: Path, suffix: str) -> None:
    whole = (unv(tetrahedra()) if suffix == ".unv" else deck(bulk(tetrahedra()))).encode()
    refused = 0
    for seed in range(200):
        (tmp_path / f"a{suffix}").write_bytes(flipped(whole, random.Random(seed)))
        with user_errors_only():
            try:
                mesh = read_mesh(tmp_path / f"a{suffix}", "mm", "mm-t-s")
                mesh_problems(mesh)
            except UserError:
                refused += 1
                raise
    assert 20 < refused < 200


def test_changed_bytes_of_med_are_read_or_refused(tmp_path: Path) -> None:
    """Few, because each is tried in a process of its own first."""
    whole = med(tmp_path / "whole.med").read_bytes()
    read_mesh(tmp_path / "whole.med", "m")
    for seed in range(3):
        (tmp_path / f"{seed}.med").write_bytes(flipped(whole, random.Random(seed)))
        with user_errors_only():
            read_mesh(tmp_path / f"{seed}.med", "m")


# files that were cut -------------------------------------------------------------------------------------------------


def samples(folder: Path) -> dict[str, bytes]:
    """Suffix -> a file with cells, sets and materials of each reader."""
    mesh = tetrahedra()
    lines = [*decks.mesh_lines(mesh, 1.0, ("z0",)), *decks.MATERIAL, decks.section()]
    root = f"SPC1,7,123,{','.join(map(str, mesh.node_id[mesh.face_points('z0')]))}\n"
    return {
        ".msh": TET.encode(), ".inp": ("\n".join(lines) + "\n").encode(), ".unv": unv(mesh).encode(),
        ".cdb": archive(mesh, ("z0",), scale=1.0).encode(), ".bdf": deck(bulk(mesh), STEEL + root).encode(),
        ".med": med(folder / "whole.med").read_bytes(),
    }  # fmt: skip


def whole_by_itself(suffix: str, data: bytes) -> bool:
    """Whether what is left is a whole file of its format: cells and sets one by one in lines, or data sets."""
    if suffix == ".inp":
        return data.endswith(b"\n")
    return suffix == ".unv" and data.split().count(b"-1") % 2 == 0 and data.rstrip(b" \n").endswith(b"\n    -1")


TEXTS = [".msh", ".inp", ".cdb", ".bdf", ".unv"]


@pytest.mark.parametrize("suffix", [*TEXTS, pytest.param(".med", marks=pytest.mark.slow)])
def test_a_file_that_was_cut_is_refused_or_doubted(tmp_path: Path, suffix: str) -> None:
    """At thirty places: the same mesh, a refusal, or a warning that it may be cut."""
    data = samples(tmp_path)[suffix]
    path = tmp_path / f"a{suffix}"
    path.write_bytes(data)
    whole = read_mesh(path, "m", "m-kg-s")
    assert not any("cut" in text for text in mesh_problems(whole)[1])
    content = [repr(getattr(whole, f.name)) for f in dataclasses.fields(whole)]
    told = []
    for place in random.Random(suffix).sample(range(len(data)), 30):
        path.write_bytes(data[:place])
        if whole_by_itself(suffix, data[:place]):
            continue
        try:
            mesh = read_mesh(path, "m", "m-kg-s")
        except UserError:
            told.append("refused")
            continue
        same = content == [repr(getattr(mesh, f.name)) for f in dataclasses.fields(mesh)]
        assert same or any("cut" in text for text in mesh_problems(mesh)[1]), (place, data[:place][-80:])
    assert told

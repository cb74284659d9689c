"""Mesh files: node orders, named sets, units, damage, and the gates in front of a solution."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path

import meshes
import numpy as np
import pytest
import small
from refusals import refused

from microslip.data import Mesh
from microslip.errors import UserError
from microslip.mesh import boundary_facets, mesh_problems, read_mesh
from microslip.mesh.msh import to_vtk
from microslip.modal.boundary import require_face
from microslip.topology import CELL_TYPES

pytest.importorskip("meshio")

EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))  # of VTK's mid-side nodes

# One tetrahedron with gmsh's node order (mid-side nodes on 01 12 02 03 23 13), numbers with gaps, a named face
# z = 0 with its facet turned inwards, a named point and a volume of the same name as the face.
TET = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
0 7 "tip point"
2 5 "foot"
3 9 "foot"
$EndPhysicalNames
$Entities
1 0 1 1
4 0 0 2 1 7
1 0 0 0 2 2 0 1 5 0
1 0 0 0 2 2 2 1 9 0
$EndEntities
$Nodes
2 10 11 40
0 4 0 1
40
0 0 2
3 1 0 9
11
12
13
15
16
17
18
19
20
0 0 0
2 0 0
0 2 0
1 0 0
1 1 0
0 1 0
0 0 1
0 1 1
1 0 1
$EndNodes
$Elements
3 3 1 3
0 4 15 1
1 40
2 1 9 1
2 11 12 13 15 16 17
3 1 11 1
3 11 12 13 40 15 16 17 18 19 20
$EndElements
"""

INP = """*HEADING
a cube of two bricks, 1 mm each, one above the other
** a comment
*NODE, NSET=NALL
  11, 0., 0., 0.
  12, 1., 0., 0.
  13, 1., 1., 0.
  14, 0., 1.
  21, 0., 0., 1.0D0
  22, 1., 0., 1.
  23, 1., 1., 1.
  24, 0., 1., 1.
  31, 0., 0., 2.
  32, 1., 0., 2.
  33, 1., 1., 2.
  34, 0., 1., 2.
  99, 5., 5., 5.
*ELEMENT, TYPE=C3D8R,
 ELSET=Eall
  1, 11, 12, 13, 14,
     21, 22, 23, 24
  2, 21, 22, 23, 24, 31, 32, 33, 34
*ELEMENT, TYPE=S4, ELSET=Skin
 101, 11, 14, 24, 21
*ELEMENT, TYPE=B31, ELSET=Beam
 201, 11, 12
*NSET, NSET=Bottom, GENERATE
 11, 14, 1
*NSET, NSET=Both
 bottom, 99
 34
*ELSET, ELSET=Upper
 2,
*SURFACE, NAME=Top, TYPE=ELEMENT
 Upper, S2
*SURFACE, NAME="Side A", TYPE=ELEMENT
 1, S4
 Upper, S4
*SURFACE, NAME=Skin2
 skin, SPOS
*SURFACE, NAME=Free
 Eall,
*SURFACE, NAME=Nodes, TYPE=NODE
 Bottom,
*MATERIAL, NAME=Steel
*ELASTIC
 210000., 0.3
*STEP
*END STEP
"""


def written(tmp_path: Path, text: str | bytes, name: str = "part.msh") -> Path:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def refusal(path: Path, unit: str = "mm") -> str:
    return refused((str(path), ";"), read_mesh, path, unit)  # a remedy follows


def middles_are_right(mesh: Mesh) -> bool:
    """Mid-side nodes of straight ten-node tetrahedra lie in the middle of VTK's edges."""
    p = mesh.points[mesh.cells["tetra10"]]
    return all(np.allclose(p[:, 4 + i], (p[:, a] + p[:, b]) / 2, rtol=0, atol=1e-12) for i, (a, b) in enumerate(EDGES))


def outward(mesh: Mesh, name: str) -> np.ndarray:
    """Unit normals of a face's facets from their corners."""
    found = []
    for facets in mesh.faces[name].values():
        p = mesh.points[facets]
        n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        found.append(n / np.linalg.norm(n, axis=1)[:, None])
    return np.concatenate(found)


# ---------------------------------------------------------------- gmsh


def test_tetrahedra_of_gmsh_are_turned_to_the_order_of_vtk(tmp_path: Path) -> None:
    mesh = read_mesh(written(tmp_path, TET), "mm")
    assert middles_are_right(mesh)
    assert mesh_problems(mesh) == ([], [])


def test_names_numbers_and_units_of_gmsh(tmp_path: Path) -> None:
    mesh = read_mesh(written(tmp_path, TET), "mm")
    assert sorted(mesh.node_id) == [11, 12, 13, 15, 16, 17, 18, 19, 20, 40]
    assert mesh.points[mesh.node_id == 40].tolist() == [[0, 0, 0.002]]
    assert list(mesh.faces) == ["foot"]
    assert outward(mesh, "foot").tolist() == [[0, 0, -1]]
    assert sorted(mesh.node_id[mesh.face_points("foot")]) == [11, 12, 13, 15, 16, 17]
    assert mesh.node_id[mesh.point_sets["tip point"]].tolist() == [40]
    assert np.ptp(read_mesh(written(tmp_path, TET), "in").points) == pytest.approx(2 * 0.0254)


@pytest.mark.parametrize("cell_type", CELL_TYPES)
def test_permutations_from_gmsh_agree_with_those_of_meshio(cell_type: str) -> None:
    from meshio.gmsh.common import _gmsh_to_meshio_order

    count = len(CELL_TYPES[cell_type].reference)
    assert to_vtk(cell_type) == _gmsh_to_meshio_order(cell_type, np.arange(count)[None])[0].tolist()


@pytest.mark.usefixtures("untried")
@pytest.mark.parametrize("version", ["2.2", "4.0", "4.1"])
@pytest.mark.parametrize("binary", [False, True])
def test_other_versions_of_gmsh_files(tmp_path: Path, version: str, binary: bool) -> None:
    import meshio

    beam = small.beam()
    whole = meshio.Mesh(beam.points, [("tetra10", beam.cells["tetra10"])])
    meshio.gmsh.write(tmp_path / "a.msh", whole, version, binary=binary)
    mesh = read_mesh(tmp_path / "a.msh", "m")
    assert middles_are_right(mesh)
    assert np.array_equal(mesh.points, beam.points)
    assert np.array_equal(mesh.cells["tetra10"], beam.cells["tetra10"])


@pytest.mark.parametrize("share", np.linspace(0.02, 0.98, 25).round(2))
def test_truncated_gmsh_files(tmp_path: Path, share: float) -> None:
    refusal(written(tmp_path, TET[: int(share * len(TET))]))


@pytest.mark.parametrize("version", ["2.2", "4.1"])
@pytest.mark.parametrize("binary", [False, True])
def test_truncated_gmsh_files_of_other_kinds(tmp_path: Path, version: str, binary: bool) -> None:
    import meshio

    beam = small.beam()
    meshio.gmsh.write(
        tmp_path / "a.msh", meshio.Mesh(beam.points, [("tetra10", beam.cells["tetra10"])]), version, binary=binary
    )
    data = (tmp_path / "a.msh").read_bytes()
    for share in (0.05, 0.3, 0.6, 0.9, 0.99):
        refusal(written(tmp_path, data[: int(share * len(data))], "b.msh"))


DAMAGED = {
    "a missing section": (r"\$Nodes.*\$EndNodes\n", "", "the section $Nodes is missing"),
    "a section twice": (r"(\$Nodes.*\$EndNodes\n)", r"\1\1", "stands there twice"),
    "more nodes announced": (r"2 10 11 40", "2 11 11 40", "another number of nodes"),
    "more blocks announced": (r"2 10 11 40", "3 10 11 40", "fewer numbers than it announces"),
    "a giant number of blocks": (r"2 10 11 40", "99999999999 10 11 40", "fewer numbers than it announces"),
    "a giant number of nodes": (r"3 1 0 9\n", "3 1 0 999999999999\n", "fewer numbers than it announces"),
    "a negative number of nodes": (r"3 1 0 9\n", "3 1 0 -9\n", "fewer numbers than it announces"),
    "an unknown node": (r"2 11 12 13 15 16 17", "2 11 12 13 15 16 77", "names node 77, which the file does not"),
    "a node twice": (r"\n19\n", "\n18\n", "node 18 is defined twice"),
    "a word": (r"2 0 0\n0 2 0", "2 zero 0\n0 2 0", "something that is no number"),
    "a fraction": (r"\n19\n", "\n19.5\n", "not whole"),
    "an unknown cell type": (r"3 1 11 1", "3 1 29 1", "gmsh's type 29"),
    "more cells announced": (r"3 3 1 3", "3 4 1 3", "another number of cells"),
    "not a number": (r"0 1 1\n1 0 1", "0 nan 1\n1 0 1", "three finite numbers"),
    "infinity": (r"0 1 1\n1 0 1", "0 inf 1\n1 0 1", "three finite numbers"),
    "overflow": (r"0 1 1\n1 0 1", "0 1e999 1\n1 0 1", "three finite numbers"),
    "far away": (r"0 1 1\n1 0 1", "0 1e300 1\n1 0 1", "m from the origin"),
    "a broken name": (r'2 5 "foot"', '2 5 "foot', "$PhysicalNames holds the line"),
    "more names announced": (r"\n3\n0 7", "\n4\n0 7", "another number of names"),
    "a partition": (r"\$Nodes", "$PartitionedEntities\n0\n$EndPartitionedEntities\n$Nodes", "partitioned"),
    "surfaces only": (r"3 3 1 3(.*)3 1 11 1\n[^\n]*\n", r"2 2 1 3\1", "holds no volume cells"),
}


@pytest.mark.parametrize("what", DAMAGED)
def test_damaged_gmsh_files(tmp_path: Path, what: str) -> None:
    pattern, replacement, words = DAMAGED[what]
    text, count = re.subn(pattern, replacement, TET, count=1, flags=re.DOTALL)
    assert count == 1
    assert words in refusal(written(tmp_path, text))


def test_a_set_with_a_facet_inside_the_volume_is_no_face(tmp_path: Path) -> None:
    text = TET.replace("2 11 12 13 15 16 17", "2 11 12 16 15 16 17")
    mesh = read_mesh(written(tmp_path, text), "m")
    assert "foot" not in mesh.faces and mesh.inner["foot"] == (1, 1)
    assert "1 of 1 facets of the set 'foot' are not on the surface" in mesh_problems(mesh)[1][0]
    with pytest.raises(UserError, match="interfaces.a.face: 1 of 1 facets of the set 'foot' are not on the surface"):
        require_face(mesh, "foot", "interfaces.a.face")


# ---------------------------------------------------------------- Abaqus


def test_sets_and_surfaces_of_abaqus(tmp_path: Path) -> None:
    mesh = read_mesh(written(tmp_path, INP, "part.inp"), "mm")
    assert mesh_problems(mesh)[0] == []
    assert mesh.n_points == 12  # node 99 belongs to no cell
    assert mesh.points.max() == pytest.approx(0.002)
    assert mesh.points[mesh.node_id == 14].tolist() == [[0, 0.001, 0]]
    assert sorted(mesh.faces) == ["Both", "Bottom", "Free", "NALL", "Nodes", "Side A", "Skin", "Skin2", "Top"]
    assert outward(mesh, "Bottom").tolist() == [[0, 0, -1]]
    assert outward(mesh, "Top").tolist() == [[0, 0, 1]]
    assert outward(mesh, "Side A").tolist() == [[1, 0, 0], [1, 0, 0]]
    assert outward(mesh, "Skin").tolist() == [[-1, 0, 0]]
    assert outward(mesh, "Skin2").tolist() == [[-1, 0, 0]]
    assert len(mesh.faces["Free"]["quad"]) == 10
    assert sorted(mesh.node_id[mesh.point_sets["Both"]]) == [11, 12, 13, 14, 34]
    assert sorted(mesh.node_id[mesh.point_sets["Nodes"]]) == [11, 12, 13, 14]
    assert "Upper" not in mesh.faces and "Eall" not in mesh.faces  # sets of solid cells are no faces


@pytest.mark.parametrize("cell_type", ["tetra", "tetra10", "hexahedron", "hexahedron20", "wedge", "wedge15"])
def test_faces_of_cells_by_number_are_those_of_the_manual(tmp_path: Path, cell_type: str) -> None:
    """Each face S1 ... of one cell lies on the surface and all of them cover it."""
    kind = CELL_TYPES[cell_type]
    name = {"tetra": "C3D4", "tetra10": "C3D10", "hexahedron": "C3D8", "hexahedron20": "C3D20R"}.get(cell_type)
    name = name or {"wedge": "C3D6", "wedge15": "C3D15"}[cell_type]
    nodes = "\n".join(f"{i + 1}, {x[0]}, {x[1]}, {x[2]}" for i, x in enumerate(kind.reference))
    cell = ", ".join(str(i + 1) for i in range(len(kind.reference)))
    text = f"*NODE\n{nodes}\n*ELEMENT, TYPE={name}\n1, {cell}\n"
    for face in range(1, len(kind.facets) + 1):
        text += f"*SURFACE, NAME=F{face}\n1, S{face}\n"
    mesh = read_mesh(written(tmp_path, text, "a.inp"), "m")
    normals = np.concatenate([outward(mesh, f"F{i + 1}") for i in range(len(kind.facets))])
    expected = {
        4: [[0, 0, -1], [0, -1, 0], [3**-0.5] * 3, [-1, 0, 0]],
        6: [[0, 0, -1], [0, 0, 1], [0, -1, 0], [2**-0.5, 2**-0.5, 0], [-1, 0, 0]],
        8: [[0, 0, -1], [0, 0, 1], [0, -1, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0]],
    }[kind.corners]
    assert np.allclose(normals, expected, rtol=0, atol=1e-12)


def test_included_files_and_files_of_data(tmp_path: Path) -> None:
    head, nodes = INP.split("*NODE, NSET=NALL\n")
    nodes, rest = nodes.split("*ELEMENT", 1)
    written(tmp_path, "*NODE, NSET=NALL\n" + nodes, "nodes.inc")
    written(tmp_path, nodes, "bare.txt")
    plain = read_mesh(written(tmp_path, INP, "part.inp"), "mm")
    for line in ("*INCLUDE, INPUT=nodes.inc", "*NODE, INPUT=bare.txt, NSET=NALL"):
        mesh = read_mesh(written(tmp_path, f"{head}{line}\n*ELEMENT{rest}", "main.inp"), "mm")
        assert np.array_equal(mesh.points, plain.points)
        assert set(mesh.faces) == set(plain.faces)
    assert "cannot be read" in refusal(written(tmp_path, "*INCLUDE, INPUT=none.inp\n", "a.inp"))
    assert "includes itself" in refusal(written(tmp_path, "*INCLUDE, INPUT=a.inp\n", "a.inp"))
    assert "names no file" in refusal(written(tmp_path, "*INCLUDE\n", "a.inp"))


def test_an_included_file_of_another_folder(tmp_path: Path) -> None:
    """Data stand beside the file that names them, or beside the deck; a mistake names its line."""
    head, nodes = INP.split("*NODE, NSET=NALL\n")
    nodes, rest = nodes.split("*ELEMENT", 1)
    (tmp_path / "sub").mkdir()
    main = written(tmp_path, f"{head}*INCLUDE, INPUT=sub/part.inc\n*ELEMENT{rest}", "main.inp")
    part = written(tmp_path, "*NODE, INPUT=bare.txt, NSET=NALL\n", "sub/part.inc")
    for place in ("sub/bare.txt", "bare.txt"):
        bare = written(tmp_path, nodes, place)
        assert len(read_mesh(main, "mm").points) == 12
        bare.unlink()
    written(tmp_path, "*NODE, NSET=NALL\n1, a, 0., 0.\n", "sub/part.inc")
    with pytest.raises(UserError) as error:
        read_mesh(main, "mm")
    assert error.value.file == f"{part}, line 1"


def test_one_instance_is_the_part_itself(tmp_path: Path) -> None:
    body, _ = INP.split("*MATERIAL")
    part = "*PART, NAME=P\n" + body.removeprefix("*HEADING\n") + "*END PART\n*ASSEMBLY, NAME=A\n"
    one = part + (
        "*INSTANCE, NAME=P-1, PART=P\n*END INSTANCE\n*NODE\n1, 9., 9., 9.\n*NSET, NSET=Ref\n1,\n"
        "*NSET, NSET=Clamp, INSTANCE=P-1\n11, 12, 13, 14\n*END ASSEMBLY\n"
    )
    mesh = read_mesh(written(tmp_path, one, "a.inp"), "mm")
    assert "Clamp" in mesh.faces
    assert "Ref" not in mesh.point_sets


DAMAGED_INP = {
    "an unknown node": ("24\n  2,", "77\n  2,", "names node 77"),
    "a node at two places": ("  12, 1.,", "  11, 1.,", "node 11 is there already"),
    "a cell twice": ("  2, 21,", "  1, 21,", "cell 1 is defined twice"),
    "half a cell": ("31, 32, 33, 34\n*ELEMENT", "31, 32, 33\n*ELEMENT", "another number of nodes"),
    "a word in a cell": ("31, 32, 33, 34\n*ELEMENT", "31, 32, x, 34\n*ELEMENT", "no whole number"),
    "a word in a node": ("12, 1., 0., 0.", "12, 1., x, 0.", "no number"),
    "a line without number": ("  12, 1., 0., 0.", "  , 1., 0., 0.", "a line without a number"),
    "not a number": ("12, 1., 0., 0.", "12, 1., nan, 0.", "not finite"),
    "another system": ("*NODE, NSET=NALL", "*NODE, SYSTEM=Q", "SYSTEM=Q is not read"),
    "mapped nodes": ("*ELEMENT, TYPE=C3D8R", "*NMAP\n0., 0., 0.\n*ELEMENT, TYPE=C3D8", "*NMAP"),
    "odd cells": ("*ELEMENT, TYPE=S4", "*ELEMENT, TYPE=C3D5\n9, 11, 12, 13, 14, 21\n*ELEMENT, TYPE=S4", "element 9 is"),
    "an odd solid": ("TYPE=C3D8R", "TYPE=C3D9", "element 1 is of type C3D9"),
    "no nodes": ("*NODE", "*NOTHING", "there is no *NODE"),
    "no solids": ("*ELEMENT, TYPE=C3D8R,", "*ELEMENT, TYPE=T3D2,", "holds no volume cells"),
    "a set without name": ("*NSET, NSET=Both", "*NSET", "a *NSET has no name"),
    "half a range": (" 11, 14, 1", " 11", "needs first, last and step"),
    "a number below one": (" 11, 14, 1", " 0, 14, 1", "a number below 1"),
    "a giant number": ("  2, 21,", "  99999999999999999999, 21,", "no whole number"),
}


@pytest.mark.parametrize("what", DAMAGED_INP)
def test_damaged_abaqus_files(tmp_path: Path, what: str) -> None:
    old, new, words = DAMAGED_INP[what]
    assert old in INP
    assert words in refusal(written(tmp_path, INP.replace(old, new, 1), "part.inp"))


def test_a_giant_range_takes_no_memory(tmp_path: Path) -> None:
    mesh = read_mesh(written(tmp_path, INP.replace(" 11, 14, 1", " 11, 999999999999, 1"), "part.inp"), "mm")
    assert len(mesh.point_sets["Bottom"]) == 12


# ---------------------------------------------------------------- other formats


def test_unknown_missing_and_wrong_files(tmp_path: Path) -> None:
    assert "no such mesh file" in refusal(tmp_path / "none.msh")
    assert "is a folder" in refusal(tmp_path)
    for name in ("a.xyz", "no_suffix", "a.med", "a.vtu", "a.msh"):
        refusal(written(tmp_path, "hello", name))
    for data, name in ((b"", "b.msh"), (b"", "b.inp"), (b"\x00\xff" * 100, "c.inp")):
        refusal(written(tmp_path, data, name))
    assert "choose one of m, cm, mm" in refusal(written(tmp_path, TET), "furlong")


def test_vtu_with_mixed_or_flat_cells(tmp_path: Path) -> None:
    import meshio

    beam = small.beam()
    cells, wedge = ("tetra10", beam.cells["tetra10"]), ("wedge18", np.arange(18)[None])
    for name, blocks in (("a", [cells]), ("b", [cells, wedge]), ("c", [("triangle", [[0, 1, 2]])])):
        meshio.write(tmp_path / f"{name}.vtu", meshio.Mesh(beam.points, blocks))
    assert middles_are_right(read_mesh(tmp_path / "a.vtu", "m"))
    assert "cells of type wedge18 cannot be assembled" in refusal(tmp_path / "b.vtu", "m")
    assert "holds no volume cells" in refusal(tmp_path / "c.vtu")


# ---------------------------------------------------------------- the surface


@pytest.mark.parametrize("cell_type", CELL_TYPES)
def test_surface_normals_point_outwards_and_close(cell_type: str) -> None:
    mesh = meshes.brick(cell_type, (2, 2, 2))
    total, flux = np.zeros(3), 0.0
    for facets in boundary_facets(mesh).values():
        p = mesh.points[facets]
        last = p[:, 3] if p.shape[1] in (4, 8, 9) else p[:, 2]
        n = np.cross(p[:, 1] - p[:, 0], last - p[:, 0]) * (1.0 if p.shape[1] in (4, 8, 9) else 0.5)
        total += n.sum(axis=0)
        flux += np.einsum("fi,fi->", p[:, : 4 if p.shape[1] in (4, 8, 9) else 3].mean(axis=1), n) / 3
    assert np.allclose(total, 0, rtol=0, atol=1e-14)
    assert flux == pytest.approx(1.0, rel=1e-13)  # the volume, by Gauss


# ---------------------------------------------------------------- gates


def replaced(change: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]) -> tuple[list[str], list[str]]:
    beam = small.beam()
    points, cells = change(beam.points.copy(), beam.cells["tetra10"].copy())
    return mesh_problems(Mesh(points, {"tetra10": cells}, node_id=np.arange(1, len(points) + 1)))


def one(errors: list[str]) -> str:
    assert len(errors) == 1, errors
    return errors[0]


def test_a_sound_mesh_passes() -> None:
    assert replaced(lambda p, c: (p, c)) == ([], [])


def inside_out(p: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    c[7, [0, 1]] = c[7, [1, 0]]
    return p, c


def flat(p: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return p * [0, 1, 1], c


def twice_a_point(p: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    c[3, 1] = c[3, 0]
    return p, c


def twice_a_cell(p: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return p, np.vstack([c, c[:1]])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (inside_out, "1 of 144 tetra10 cells are inside out (first: 8)"),
        (flat, "have no volume"),
        (twice_a_point, "1 tetra10 cells name a point twice (first: 4)"),
        (twice_a_cell, "more than two cells"),
    ],
)
def test_cells_that_cannot_be(change: Callable[..., tuple[np.ndarray, np.ndarray]], words: str) -> None:
    assert any(words in error for error in replaced(change)[0])


def test_parts_that_share_no_points_and_points_that_coincide() -> None:
    """Two parts apart, two that touch, perhaps a joint, and a cell of which one corner is torn off."""

    def double(p: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.vstack([p, p + 1.0]), np.vstack([c, c + len(p)])

    def tear(p: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        c[p[c[:, :4]].mean(axis=1)[:, 2] > 0.06] += len(p)
        used, numbers = np.unique(c, return_inverse=True)
        return np.vstack([p, p])[used], numbers.reshape(c.shape)

    def crack(p: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        torn, c[7, 9] = c[7, 9], len(p)
        return np.vstack([p, p[torn]]), c

    for change, words in ((double, "falls into 2 parts"), (tear, "neither welded nor in contact")):
        errors, warnings = replaced(change)
        assert not errors and words in warnings[0]
    text = one(replaced(crack)[0])
    assert "1 pairs of points coincide" in text and "merge duplicate nodes" in text


def test_first_order_cells_are_warned_about() -> None:
    beam = small.beam()
    used, cells = np.unique(beam.cells["tetra10"][:, :4], return_inverse=True)
    errors, warnings = mesh_problems(Mesh(beam.points[used], {"tetra": cells.reshape(-1, 4)}, node_id=used + 1))
    assert errors == []
    assert "first-order cells (tetra) are too stiff" in one(warnings)


def test_inverted_bricks() -> None:
    mesh = meshes.brick("hexahedron20", (2, 1, 1))
    cells = mesh.cells["hexahedron20"].copy()
    cells[1] = cells[1][[3, 2, 1, 0, 7, 6, 5, 4, 10, 9, 8, 11, 14, 13, 12, 15, 19, 18, 17, 16]]
    errors, _ = mesh_problems(dataclasses.replace(mesh, cells={"hexahedron20": cells}))
    assert "1 of 2 hexahedron20 cells are inside out (first: 2)" in one(errors)

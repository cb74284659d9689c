"""Ansys archives: every form of the solid elements, components, materials; mapdl-archive reads the same files."""

from __future__ import annotations

from pathlib import Path

import meshes
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused_command

from microslip.basis import check_basis, read_basis
from microslip.cli import main
from microslip.data import Mesh
from microslip.elasticity import isotropic, orthotropic, turned
from microslip.errors import UserError
from microslip.fem.discretise import discretise
from microslip.mesh import mesh_problems, read_mesh
from microslip.mesh.systems import axes_by_angles
from microslip.modal.compute import modal_basis
from microslip.stages.job import open_job
from microslip.stages.modal import modes_stage

# SOLID186, Element Reference: corners I J K L M N O P, mid-sides Q R S T U V W X Y Z A B on
# IJ JK KL LI MN NO OP PM IM JN KO LP. Degenerate forms repeat corners; a mid-side between equal ones repeats them.
MIDDLES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
CORNERS = {
    "hexahedron": (0, 1, 2, 3, 4, 5, 6, 7), "wedge": (0, 1, 2, 2, 3, 4, 5, 5), "pyramid": (0, 1, 2, 3, 4, 4, 4, 4),
    "tetra": (0, 1, 2, 2, 3, 3, 3, 3),
}  # fmt: skip
EDGES = {
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)), "pyramid": meshes.PYRAMID_EDGES,
    "wedge": meshes.WEDGE_EDGES, "hexahedron": MIDDLES,
}  # fmt: skip
COUNT = {"hexahedron": 8, "wedge": 6, "pyramid": 5, "tetra": 4}


def as_brick(family: str, cell: np.ndarray) -> list[int]:
    """The nodes of a cell in the order of SOLID185 or SOLID186."""
    corners = [int(cell[i]) for i in CORNERS[family]]
    if len(cell) == COUNT[family]:
        return corners
    middle = {
        frozenset((int(cell[a]), int(cell[b]))): int(cell[COUNT[family] + i]) for i, (a, b) in enumerate(EDGES[family])
    }
    return corners + [
        middle[frozenset((corners[a], corners[b]))] if corners[a] != corners[b] else corners[a] for a, b in MIDDLES
    ]


def archive(mesh: Mesh, sets=(), material=("MPDATA,R5.0, 1,EX  ,1, 1, 210000.0", "MPDATA,R5.0, 1,NUXY,1, 1, 0.3",
            "MPDATA,R5.0, 1,DENS,1, 1, 7.85e-9"), scale=1e3) -> str:  # fmt: skip
    """CDWRITE's blocked form, in mm."""
    kind = 186 if any(len(c[0]) > 8 for c in mesh.cells.values()) else 185
    ids = mesh.node_id
    full = ["KEYOPT,1,2,1"] if kind == 186 else []
    lines = ["/PREP7", f"ET,1,{kind}", *full, "ET,2,154"]
    lines += [f"NBLOCK,6,SOLID,{ids.max():10d},{len(ids):10d}", "(3i9,6e21.13e3)"]
    for i, x in zip(ids, mesh.points * scale, strict=True):
        lines.append(f"{i:9d}{0:9d}{0:9d}" + "".join(f"{v:21.13E}" for v in x))
    lines += ["N,R5.3,LOC,       -1,", f"EBLOCK,19,SOLID,{mesh.n_cells:10d},{mesh.n_cells:10d}", "(19i10)"]
    number = 0
    for name, cells in mesh.cells.items():
        family = next(f for f in COUNT if name.startswith(f))
        for cell in cells:
            number += 1
            nodes = [int(ids[n]) for n in as_brick(family, cell)]
            words = [1, 1, 1, 1, 0, 0, 0, 0, len(nodes), 0, number, *nodes]
            lines += ["".join(f"{w:10d}" for w in words[k : k + 19]) for k in range(0, len(words), 19)]
    lines.append(f"{-1:10d}")
    for name in sets:
        members = [int(ids[n]) for n in mesh.face_points(name)]
        lines += [f"CMBLOCK,{name.upper()},NODE,{len(members):8d}  ! nodes", "(8i10)"]
        lines += ["".join(f"{m:10d}" for m in members[k : k + 8]) for k in range(0, len(members), 8)]
    return "\n".join([*lines, "MPTEMP,R5.0, 1, 1,  0.0", *material, "FINISH"]) + "\n"


def written(folder: Path, text: str) -> Path:
    (folder / "part.cdb").write_text(text)
    return folder / "part.cdb"


FORMS = ("hexahedron20", "wedge15", "pyramid13", "tetra10", "hexahedron", "wedge", "pyramid", "tetra")


@pytest.mark.parametrize("cell_type", FORMS)
def test_every_form_of_the_brick_comes_back_as_its_own_cell(tmp_path, cell_type):
    """Bent cells: positions, volume, and mid-side nodes where they were."""
    mesh = meshes.brick(cell_type, (2, 1, 2), (0.02, 0.01, 0.03), to=meshes.shaken(0.0007))
    read = read_mesh(written(tmp_path, archive(mesh, ("z0", "x1"))), "mm")
    assert list(read.cells) == [cell_type]
    np.testing.assert_array_equal(read.cells[cell_type], mesh.cells[cell_type])
    np.testing.assert_allclose(read.points, mesh.points, atol=1e-14)
    assert discretise(read).volume == pytest.approx(discretise(mesh).volume, rel=1e-11)
    np.testing.assert_array_equal(read.point_sets["Z0"], np.sort(mesh.face_points("z0")))
    assert sum(map(len, read.faces["X1"].values())) == sum(map(len, mesh.faces["x1"].values()))
    assert not mesh_problems(read)[0]


def test_mapdl_archive_reads_the_same(tmp_path):
    oracle = pytest.importorskip("mapdl_archive")
    mesh = meshes.brick("wedge15", (1, 1, 2), (0.02, 0.01, 0.03))
    path = written(tmp_path, archive(mesh, ("z0",)))
    theirs, ours = oracle.Archive(path, parse_vtk=False), read_mesh(path, "mm")
    np.testing.assert_allclose(theirs.nodes * 1e-3, ours.points, atol=1e-15)
    np.testing.assert_array_equal(theirs.nnum, ours.node_id)
    np.testing.assert_array_equal(np.sort(theirs.node_components["Z0"]), ours.node_id[ours.point_sets["Z0"]])
    for element, cell in zip(theirs.elem, ours.cells["wedge15"], strict=True):
        np.testing.assert_array_equal(element[10:30], [ours.node_id[n] for n in as_brick("wedge", cell)])


def test_archives_that_ansys_itself_wrote(tmp_path):
    """The examples of mapdl-archive: all nodes and elements, components, and meshes without faults."""
    examples = pytest.importorskip("mapdl_archive.examples")
    oracle = pytest.importorskip("mapdl_archive")
    theirs, ours = oracle.Archive(examples.hexarchivefile, parse_vtk=False), read_mesh(examples.hexarchivefile, "m")
    assert ours.n_cells == theirs.n_elem and ours.n_points == theirs.n_node
    assert not mesh_problems(ours)[0]
    tets = read_mesh(examples.tetarchivefile, "m")
    assert (
        tets.n_cells == oracle.Archive(examples.tetarchivefile, parse_vtk=False).n_elem and not mesh_problems(tets)[0]
    )


BODY = 'name = "part"\nlength_unit = "mm"\n[geometry]\nmesh = "part.cdb"\n[material]\nfrom = "mesh"\n'
BODY += '[[supports]]\nface = "Z0"\n[modes]\ncount = 5\nsolver = "superlu"\n'


def test_archive_with_its_own_material_is_the_body_it_was_written_from(tmp_path):
    mesh = meshes.brick("wedge15", (1, 2, 4), (0.01, 0.015, 0.05))
    written(tmp_path, archive(mesh, ("z0",)))
    (tmp_path / "body.toml").write_text(BODY)
    path, told = modes_stage(open_job(tmp_path, root=tmp_path))
    basis = read_basis(path)
    what = meshes.body(supports=[{"face": "z0"}], modes={"count": 5, "solver": "superlu"})
    np.testing.assert_allclose(basis.groups[0, 0].omega, modal_basis(mesh, what).groups[0, 0].omega, rtol=1e-9)
    assert not told and all(c.passed for c in check_basis(basis))


def test_materials_of_tables_and_minor_ratios(tmp_path):
    """MPTEMP and MPDATA of EX; NUXY = PRXY EY / EX of an orthotropic one."""
    mesh = meshes.brick("hexahedron", (1, 1, 1))
    hot = [
        "MPTEMP",
        "MPTEMP,R5.0, 2, 1, 20., 420.",
        "MPDATA,R5.0, 2,EX,1,1, 2e5, 1.5e5",
        "MP,NUXY,1,0.3",
        "MP,DENS,1,7.85e-9",
    ]
    found = read_mesh(written(tmp_path, archive(mesh, material=hot)), "mm", "mm-t-s", 273.15).materials[0]
    np.testing.assert_allclose(found.elasticity, isotropic(2e11, 0.3), rtol=1e-12)
    np.testing.assert_allclose(found.temperature_table, [[293.15, 1], [693.15, 0.75]])
    wood = [f"MP,{k},1,{v}" for k, v in dict(EX=12e3, EY=900, EZ=500, GXY=700, GYZ=250, GXZ=650, NUXY=0.37 * 900 / 12e3,
            PRYZ=0.47, PRXZ=0.42, DENS=6e-10, ALPX=1e-5, ALPY=2e-5, ALPZ=3e-5).items()]  # fmt: skip
    found = read_mesh(written(tmp_path, archive(mesh, material=wood)), "mm", "mm-t-s").materials[0]
    C = orthotropic(np.array([12e9, 9e8, 5e8]), np.array([0.37, 0.47, 0.42]), np.array([7e8, 2.5e8, 6.5e8]))
    np.testing.assert_allclose(found.elasticity, C, rtol=1e-9, atol=1)
    np.testing.assert_allclose(found.expansion, [1e-5, 2e-5, 3e-5, 0, 0, 0])
    assert found.density == pytest.approx(600)


@pytest.mark.parametrize("inverse", [False, True])
def test_a_matrix_of_elasticity_is_the_material_that_it_was_made_from(tmp_path, inverse):
    """TB,ANEL of a skewed orthotropic material, as stiffness and as compliance, turned back by ESYS."""
    wood = orthotropic(np.array([12e3, 900, 500]), np.array([0.37, 0.47, 0.42]), np.array([700, 250, 650]))
    axes = axes_by_angles(np.array([20.0, 35.0, -50.0]))
    C = turned(wood, axes.T)
    D = np.linalg.inv(C) if inverse else C
    table = [*(D[j:, j] for j in range(6))]
    words = [f"{v:.16g}" for v in np.concatenate(table)]
    rows = [f"TBDATA,{i + 1},{','.join(words[i : i + 6])}" for i in range(0, 21, 6)]
    lines = [f"TB,ANEL,1,1,21,{int(inverse)}", "TBTEMP,0", *rows, "MP,DENS,1,6e-10"]
    text = archive(meshes.brick("hexahedron", (1, 1, 1)), material=lines)
    found = read_mesh(written(tmp_path, text), "mm", "mm-t-s").materials[0]
    np.testing.assert_allclose(found.elasticity, C * 1e6, rtol=1e-9, atol=1)
    system = "LOCAL,11,0,0,0,0,20,35,-50\nEMODIF,1,ESYS,11\nFINISH"
    back = read_mesh(written(tmp_path, text.replace("FINISH", system)), "mm", "mm-t-s").materials[0]
    np.testing.assert_allclose(back.elasticity, turned(C, axes) * 1e6, rtol=1e-9, atol=1)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (("ET,1,185", "ET,1,70"), "element 1 is of the Ansys type 70, which conducts heat"),
        (("ET,1,185", "ET,3,185"), "element 1 is of type 1, which no ET command defines"),
        ((f"{12:10d}\n(3i9", f"{13:10d}\n(3i9"), "NBLOCK holds 12 nodes of 13"),
        ((f"{-1:10d}\nCMBLOCK", "CMBLOCK"), "EBLOCK"),
        (("EBLOCK,19,SOLID", "EBLOCK,19,COMPACT"), "element 1 has 9 different nodes instead of 8"),
        ((f"{-1:10d}\nCMBLOCK", "      \nCMBLOCK"), "EBLOCK"),
        (("         2,         2\n(19i10)", "         3,         3\n(19i10)"), "announces 3 elements and holds 2"),
        ((" 210000.0", ""), "no elastic constants"),
        (("DENS", "KXX"), "no density"),
        (("CMBLOCK,Z0", "CMBLOCK,OTHER"), "Z0"),
    ],
)
def test_damaged_archives_are_refused_in_a_sentence(tmp_path, capsys, change, text):
    whole = archive(meshes.brick("hexahedron", (1, 1, 2), (0.01, 0.01, 0.02)), ("z0",))
    if "999" in change[1]:  # the last node of the first element
        line = whole.splitlines()[whole.splitlines().index("(19i10)") + 1]
        change = (line, line[:-10] + f"{999:10d}")
    assert change[0] in whole
    written(tmp_path, whole.replace(*change))
    (tmp_path / "body.toml").write_text(BODY)
    refused_command(["modes", str(tmp_path)], capsys, text)


def test_cells_in_the_wrong_order_are_refused(tmp_path):
    """The upper corners before the lower ones turn a brick inside out."""
    mesh = meshes.brick("hexahedron", (1, 1, 2), (0.01, 0.01, 0.02))
    wrong = Mesh(
        mesh.points, {"hexahedron": mesh.cells["hexahedron"][:, [4, 5, 6, 7, 0, 1, 2, 3]]}, node_id=mesh.node_id
    )
    errors, _ = mesh_problems(read_mesh(written(tmp_path, archive(wrong)), "mm"))
    assert any("inside out (first: element 1)" in e for e in errors)


def test_flipped_bytes_are_read_or_refused(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flip")
    whole = archive(meshes.brick("wedge", (1, 1, 1), (0.01, 0.01, 0.02)), ("z0",)).encode()

    @settings(max_examples=120, deadline=None)
    @given(
        st.lists(st.tuples(st.integers(0, len(whole) - 1), st.integers(0, 255)), min_size=1, max_size=3), st.booleans()
    )
    def flip(changes, cut):
        data = bytearray(whole)
        for place, value in changes:
            data[place] = value
        (folder / "part.cdb").write_bytes(data[: changes[0][0]] if cut else data)
        try:
            read = read_mesh(folder / "part.cdb", "mm", "mm-t-s")
        except UserError as error:
            assert "part.cdb" in str(error)
        else:
            assert np.isfinite(read.points).all()

    flip()


def test_displacements_that_are_zero_are_supports(tmp_path):
    mesh = meshes.brick("hexahedron", (1, 1, 1), (0.02, 0.01, 0.03))
    low = [int(mesh.node_id[i]) for i in mesh.face_points("z0")]
    held = [f"D,{n:7d},{label:4},  0.000000000    ,  0.000000000" for n in low for label in ("UX", "UY", "UZ")]
    other = next(int(i) for i in mesh.node_id if int(i) not in low)
    held += [f"D,{other},UY, 0.0", f"D,{other},UX, 0.25", f"D,{other},TEMP, 3.0"]
    read = read_mesh(written(tmp_path, archive(mesh, ("z0",)) + "\n".join(held) + "\n"), "mm")
    assert dict(read.supports) == {"Z0": "xyz", "held xy": "xy"}
    assert read.node_id[read.point_sets["held xy"]].tolist() == [other]
    assert "prescribes displacements: they are zero in modes" in read.remarks[0]


BAR = meshes.brick("hexahedron", (1, 1, 2), (0.02, 0.01, 0.03))


def test_one_command_holds_several_directions_and_nodes(tmp_path):
    """D, node, label, value, , last node, step, further labels."""
    text = archive(BAR).replace("FINISH", "D,1,UX,0,,4,,UY,UZ\nD,9,UZ,,,11,2\nFINISH")
    read = read_mesh(written(tmp_path, text), "mm")
    held = {ways: read.node_id[read.point_sets[name]].tolist() for name, ways in dict(read.supports).items()}
    assert held == {"xyz": [1, 2, 3, 4], "z": [9, 11]}


@pytest.mark.parametrize("more", ["E,9\nE,10", "EN,98,9\nEN,99,10", "EBLOCK,10,,,2\n(15i9)\n{0}\n{0}\n       -1"])
def test_elements_outside_the_block_of_solids_are_read(tmp_path, more):
    """Point masses by commands of the type before them, or in a short block, of the second number of a
    line; surface loads there say nothing."""
    line = "".join(f"{w:9d}" for w in (98, 3, 1, 1, 0, 9))
    more = f"R,1,0.002,0.002,0.002\nTYPE,3\n{more.format(line)}\nTYPE,2\nE,1,2,3,4\nEMODIF,2,MAT,3\n"
    text = archive(BAR).replace("ET,2,154", "ET,2,154\nET,3,MASS21").replace("FINISH", f"{more}FINISH")
    read = read_mesh(written(tmp_path, text), "mm")
    assert not read.lost and read.lumps is not None
    assert set(read.node_id[read.lumps.points].tolist()) == ({9, 10} if "E,9" in more or "EN" in more else {9})
    np.testing.assert_allclose(read.lumps.masses.sum(), 4.0)  # kg, of t


def test_coupled_nodes_are_equations(tmp_path):
    """CP as the CE that say the same; one whose nodes are not in its line is refused."""
    text = archive(BAR)
    written(tmp_path, text.replace("FINISH", "CP,1,UY,9,10,12\nCP,2,ALL,9,11\nFINISH"))
    links = read_mesh(tmp_path / "part.cdb", "mm").links
    terms = [(link.nodes.tolist(), link.directions.tolist(), link.factors.tolist()) for link in links.items]
    assert terms[:2] == [([8, 9], [1, 1], [1.0, -1.0]), ([8, 11], [1, 1], [1.0, -1.0])] and len(terms) == 5
    written(tmp_path, text.replace("FINISH", "CP,       1,UY  ,       2\n       9,      10\nFINISH"))
    with pytest.raises(UserError, match=r"part.cdb, line \d+: CP 1 couples"):
        read_mesh(tmp_path / "part.cdb", "mm")


def test_equations_take_the_directions_of_turned_nodes(tmp_path):
    """A node turned by 90 degrees about z: its y is -x. Single directions of CERIG there are refused."""
    lines = archive(BAR).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith(f"{9:9d}"))
    lines[at] += f"{90.0:21.13E}"
    for command in ("CE,1,0,9,UY,1,10,UY,-1", "CP,1,UY,9,10"):
        written(tmp_path, "\n".join(lines).replace("FINISH", f"{command}\nFINISH"))
        (link,) = read_mesh(tmp_path / "part.cdb", "mm").links.items
        assert link.nodes.tolist() == [8, 9] and link.directions.tolist() == [0, 1]
        np.testing.assert_allclose(link.factors, [-1, -1])
    written(tmp_path, "\n".join(lines).replace("FINISH", "CERIG,9,10,UX\nFINISH"))
    with pytest.raises(UserError, match=r"line \d+: .*directions of node 9, which is turned"):
        read_mesh(tmp_path / "part.cdb", "mm")


def test_elements_with_mass_that_are_not_read_are_told(tmp_path):
    """An interface generator is warned of, a surface load element is not."""
    lines = archive(BAR).splitlines()
    lines = [line.replace(f"SOLID,{2:10d},{2:10d}", f"SOLID,{3:10d},{3:10d}") for line in lines]
    at = lines.index(f"{-1:10d}")
    lines.insert(at, "".join(f"{w:10d}" for w in [1, 2, 1, 1, 0, 0, 0, 0, 4, 0, 99, 1, 2, 3, 4]))
    written(tmp_path, "\n".join(lines).replace("FINISH", "CEINTF,0.25\nFINISH"))
    read = read_mesh(tmp_path / "part.cdb", "mm")
    assert [text.split(" and is not read")[0].partition(", ")[2] for text in read.lost] == [
        f"line {len(lines)}: CEINTF constrains nodes",
    ]


def test_the_block_of_types_stands_for_et(tmp_path):
    """ETBLOCK: number, element and 18 KEYOPTs; the integration that is not Ansys's is told."""
    block = f"ETBLOCK,1,1\n(2i9,19a9)\n{1:9d}{186:9d}" + f"{0:9d}" * 18 + f"\n{-1:9d}"
    whole = archive(meshes.brick("hexahedron20", (1, 1, 1)), ("z0",))
    text = whole.replace("ET,1,186\nKEYOPT,1,2,1", block)
    read = read_mesh(written(tmp_path, text), "mm")
    assert read.n_cells == 1 and "1 bricks have no neighbours" in read.remarks[0]
    options = f"{1:9d}{186:9d}{0:9d}{1:9d}"
    full = text.replace(f"{1:9d}{186:9d}{0:9d}{0:9d}", options)
    assert full != text and not read_mesh(written(tmp_path, full), "mm").remarks


WORKBENCH = """/units,MKS
et,2,154
CMBLOCK,ROOT_2,NODE,1
(8i10)
         5
cmsel,s,Z0
d,all,all
nsle,s
d,all,ux,0
D,5,UZ,0,,900,2
acel,0,0,9.81
f,5,fx,%_loadx%
pstres,on
FINISH"""


def test_what_workbench_writes_is_read_or_named(tmp_path, monkeypatch, capsys):
    """Lengths in m by /UNITS, a selected component that is held, a displacement from a table, a
    range over gaps."""
    monkeypatch.chdir(tmp_path)
    text = (
        archive(BAR, ("z0",), scale=1.0)
        .replace("\nFINISH", f"\n{WORKBENCH}")
        .replace("2.1e5", "2.1e11")
    )
    (tmp_path / "ds.dat").write_text(text.replace("210000.0", "2.1e11").replace("7.85e-9", "7850"))
    assert main(["import", "ds.dat", "part"]) == 0
    said = capsys.readouterr().out
    assert 'length_unit = "m"' in (tmp_path / "part" / "body.toml").read_text()
    for words in ("Z0 in xyz, held x in x, held xz in xz", "7850 kg/m3", "%_loadx% hangs on", "1 acceleration field"):
        assert words in said, words
    assert main(["import", "ds.dat", "other", "--unit", "mm"]) == 0
    assert "tells its lengths in m, here they are taken in mm" in capsys.readouterr().out


def test_an_archive_without_materials_is_steel_with_a_warning(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, archive(BAR, material=()))
    assert main(["import", "part.cdb", "there"]) == 0
    assert "warning: no material was taken from the file" in capsys.readouterr().out
    assert "young = 2.1e11" in (tmp_path / "there" / "body.toml").read_text()


def test_a_component_with_nodes_that_are_not_there_is_a_remark(tmp_path):
    """A range over a gap and a leftover number: the rest of the component stays."""
    text = archive(BAR).replace(
        "FINISH", "CMBLOCK,LEFT,NODE,3\n(8i10)\n         2       -40       999\nFINISH"
    )
    read = read_mesh(written(tmp_path, text), "mm")
    assert read.node_id[read.point_sets["LEFT"]].tolist() == list(range(2, BAR.n_points + 1))
    assert "the set 'LEFT' names" in read.remarks[0]


DAMAGED = {
    "ET,1,185": ("ET,1,99999999999999", "type 99999999999999"),
    "NBLOCK,6,SOLID,        12,        12": ("NBLOCK,6,SOLID,        12,        14", "12 nodes of 14"),
    "(3i9,6e21.13e3)": ("(3i9,6e0.13e3)", "format"),
    "(19i10)": ("", "format"),
    "EBLOCK,19,SOLID,         2,         2": ("EBLOCK,19,SOLID,         2,         5", "announces 5"),
    "CMBLOCK,Z0,NODE,       4  ! nodes": ("CMBLOCK,Z0,NODE,       9  ! nodes", "Z0"),
    "CMBLOCK,Z0,NODE,       4  !": ("CMBLOCK,Z0,NODE,       x  !", "whole number"),
    "(8i10)": ("(8f10)", "format"),
    "MPTEMP,R5.0, 1, 1,  0.0": ("MPTEMP,R5.0, 1, 1,  warm", "number belongs"),
    "MPDATA,R5.0, 1,EX  ,1, 1, 210000.0": ("MPDATA,R5.0, 1,EX  ,1, 1, stiff", "number belongs"),
    "MPDATA,R5.0, 1,NUXY,1, 1, 0.3": ("MPDATA,R5.0, 1,NUXY,1, 1, 0.7", "nu = 0.7"),
    "FINISH": ("R,1,heavy\nFINISH", "number belongs"),
    "/PREP7": ("/PREP7\nRLBLOCK,1,1,1\n(2i8,6g16.9)\n(7g16.9)\n       1       9  1.0", "truncated|number"),
    "ET,2,154": ("ETBLOCK,1,1\n(2i9,19a9)\n        2      154", "number|no end"),
    "N,R5.3,LOC,       -1,": ("N,R5.3,LOC,       99, 1, here", "number belongs"),
}
"""What stands in the archive -> what is written instead, and what is said of it."""
MORE = {
    "CE,1,0,1,UX,1,77,UX,-1": "node 77",
    "CE,1,0.5,1,UX,1,2,UX,-1": "constant",
    "CP,1,UX,1": "couples",
    "CERIG,1,NONE": "couples no nodes",
    "RBE3,1,ALL,NONE": "RBE3",
    "CS,11,0,1,2,3000": "fewer than three nodes",
    "CSYS,77\nNROTAT,1": "coordinate system 77",
    "DBLOCK,3\n(i9)\n        1 UX 0.0": "DBLOCK",
    "NSEL,S,LOC,X,left": "number belongs",
    "MSOPT,NEW,B": "multistage",
    "EN,77,1,2,3,4,5,6,7,900": "node 900",
    "VMESH,ALL": "VMESH makes nodes",
    "*DO,I,1,3\nD,I,UX\n*ENDDO": "*DO repeats D",
    "*DO,I,1,3\nA=I": "no *ENDDO",
    "F,1,FX,nan": "no finite number",
    "ET,9,21\nR,1,5\nTYPE,9\nE": "MASS21 names no node",
    "TB,ELASTIC,1\nTBDATA,1,soft": "number belongs",
}


@pytest.mark.parametrize("place", [*DAMAGED, *MORE])
def test_damage_is_told_with_its_line(tmp_path, capsys, monkeypatch, place):
    monkeypatch.chdir(tmp_path)
    whole = archive(meshes.brick("hexahedron", (1, 1, 2), (0.01, 0.01, 0.02)), ("z0",))
    new, words = DAMAGED.get(place, (f"{place}\nFINISH", MORE.get(place, "")))
    old = place if place in DAMAGED else "FINISH"
    assert old in whole
    written(tmp_path, whole.replace(old, new, 1))
    said = refused_command(["import", "part.cdb", "there"], capsys, "part.cdb")
    assert any(word in said for word in words.split("|")), said
    assert "line " in said or "nu = 0.7" in said, said
    assert len(said) < 400 and "\n" not in said
    assert not (tmp_path / "there").exists()

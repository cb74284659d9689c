"""Ansys archives beyond the plain mesh: turned nodes, contact, remote points, cyclic edges, dropped
mid-side nodes; each beside the same body written plainly, or beside CalculiX."""

from __future__ import annotations

import tomllib
from pathlib import Path

import decks
import meshes
import numpy as np
import pytest
import touching
from refusals import refused_command
from test_cdb import archive
from test_public_decks import sector

from microslip.basis import read_basis
from microslip.cli import main
from microslip.data import Mesh
from microslip.mesh import read_mesh
from microslip.mesh.deck_mesh import sides_of
from microslip.mesh.systems import axes_by_angles


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def hertz(capsys, text: str, name: str = "a.cdb", k: int = 0, **more: str) -> np.ndarray:
    """Frequencies of an imported deck; what import said is left in `hertz.said`."""
    body = f"{Path(name).stem}-{abs(hash(text))}"
    Path(f"{body}{Path(name).suffix}").write_text(text)
    if not Path(body).exists():
        assert main(["import", f"{body}{Path(name).suffix}"]) == 0
        hertz.said = capsys.readouterr().out
    sets = [w for key, value in more.items() for w in ("--set", f"{key.replace('_', '.')}={value}")]
    assert main(["modes", body, "-q", "--set", "modes.solver=superlu", *sets]) == 0
    return read_basis(Path("build") / body / "basis.h5").groups[0, k].frequency


def block(cells=(2, 1, 2), size=(0.06, 0.011, 0.007), kind="hexahedron20") -> Mesh:
    return meshes.brick(kind, cells, size)


def ended(text: str, *lines: str) -> str:
    return text.replace("FINISH", "\n".join([*lines, "FINISH"]))


def numbers(mesh: Mesh, face: str) -> list[int]:
    return [int(n) for n in mesh.node_id[mesh.face_points(face)]]


SLIDING = ["CMSEL,S,X0", "D,ALL,UX", "CMSEL,S,Y0", "D,ALL,UY", "CMSEL,S,Z0", "D,ALL,UZ,,,,,UX"]


def test_supports_of_turned_nodes_are_those_of_the_body_before_it_was_turned(capsys):
    """Faces that slide, in a system turned by three angles: by NROTAT, and by angles of NBLOCK."""
    angles = (25.0, -40.0, 65.0)
    straight = hertz(capsys, ended(archive(block(), ("x0", "y0", "z0")), *SLIDING))
    R = axes_by_angles(np.array(angles)).T
    mesh = block()
    moved = Mesh(mesh.points @ R.T, mesh.cells, mesh.faces, {}, mesh.node_id)
    text = archive(moved, ("x0", "y0", "z0"))
    system = ["LOCAL,12,0,0,0,0,25,-40,65", "CMSEL,S,X0", "CMSEL,A,Y0", "ALLSEL", "NROTAT,ALL"]
    turned = hertz(capsys, ended(text, *system, "CSYS,0", *SLIDING))
    np.testing.assert_allclose(turned, straight, rtol=1e-9)
    assert "displacements in skewed directions are zero" in hertz.said
    lines = text.splitlines()
    at = lines.index("(3i9,6e21.13e3)") + 1
    for i in range(at, at + mesh.n_points):
        lines[i] += "".join(f"{a:21.13E}" for a in angles)
    by_node = hertz(capsys, ended("\n".join(lines) + "\n", *SLIDING))
    np.testing.assert_allclose(by_node, straight, rtol=1e-9)


def test_systems_are_written_in_two_ways_and_nodes_chosen_by_place(capsys):
    """A slice of a ring whose flat sides are held along theta: LOCAL in one line and in three, NSEL
    in the cylindrical system and components; CalculiX with a *TRANSFORM of the same nodes."""
    text = archive(sector(), ("y0", "y1"))
    plain = ["LOCAL,11,1,0,0,0,0,0,90"]
    blocked = ["LOCAL,R5.0,LOC,11,1,0,0,0", "LOCAL,R5.0,ANG,11,1,0,0,90", "CSYS,11"]
    named = [w for n in ("Y0", "Y1") for w in (f"CMSEL,S,{n}", "NROTAT,ALL", "D,ALL,UY")]
    placed = [
        *("NSEL,S,LOC,Y,165", "NSEL,A,LOC,Y,-165.01,-164.99", "CM,SIDES,NODE"),
        *("NROTAT,ALL", "CSYS,0", "ALLSEL", "D,SIDES,UY"),
    ]
    found = [
        hertz(capsys, ended(text, *lines)) for lines in ([*plain, *named], [*blocked, *placed])
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9)
    np.testing.assert_allclose(found[0][1:5], THETA, rtol=3e-6)


THETA = [303688.9, 951442.2, 1385611, 2577317]
"""Hz, CalculiX 2.20: the deck of `sector` with *TRANSFORM, TYPE=C about x on both sides, 2 held there."""


def pairs(mesh: Mesh, contact: str, target: str | int, options=(), first: int = 9000) -> list[str]:
    """Contact and target elements of two faces, or of a face and a pilot node, as Workbench writes them."""
    lines = ["*SET,tid,4", "*SET,cid,3", "ET,cid,174", "ET,tid,170", *options]

    def elements(kind: int, face: str) -> list[str]:
        cells = [c for block in mesh.faces[face].values() for c in block]
        rows = [
            [first + 100 * kind + i, kind, 3, 3, 0, *mesh.node_id[c]] for i, c in enumerate(cells)
        ]
        rows = ["".join(f"{w:9d}" for w in row) for row in rows]
        return [f"EBLOCK,10,,,{len(rows)}", "(15i9)", *rows, "       -1"]

    lines += elements(3, contact)
    if isinstance(target, int):
        return [
            *lines,
            "type,tid $ mat,cid $ real,cid",
            "tshape,pilo",
            f"en,9999,{target}",
            "tshape",
        ]
    return [*lines, *elements(4, target)]


def two() -> Mesh:
    a = block((2, 2, 1), (0.03, 0.011, 0.007))
    b = block((3, 1, 1), (0.03, 0.011, 0.007))
    return touching.together(a=a, b=Mesh(b.points + [0.03, 0, 0], b.cells, b.faces, {}, b.node_id))


STEEL = [*("*MATERIAL, NAME=ST", "*ELASTIC", "210000., 0.3", "*DENSITY", "7.85e-9")]


def deck(mesh: Mesh, *more: str, sets=()) -> str:
    lines = [*decks.mesh_lines(mesh, sets=sets), *STEEL, decks.section(material="ST"), *more]
    return "\n".join(lines) + "\n"


def test_bonded_contact_is_a_tie(capsys):
    """KEYOPT(12) = 5: as *TIE of the same faces; without it the parts stay apart and it is a joint."""
    mesh, held = two(), ["CMSEL,S,A_X0", "D,ALL,ALL"]
    text = archive(mesh, ("a_x0",))
    lines = pairs(mesh, "a_x1", "b_x0", ["keyo,cid,12,5"])
    bonded = hertz(capsys, ended(text, *lines, *held))
    assert "is bonded: tied" in hertz.said and "tied to 'target 3'" in hertz.said
    tie = [f"*SURFACE, NAME=S{i}, TYPE=NODE\n{n}" for i, n in enumerate(("a_x1", "b_x0"))]
    tie = deck(
        mesh, *tie, "*TIE, NAME=T", "S0, S1", "*BOUNDARY", "a_x0,1,3", sets=("a_x0", "a_x1", "b_x0")
    )
    np.testing.assert_allclose(bonded, hertz(capsys, tie, "a.inp"), rtol=1e-9)
    Path("c.cdb").write_text(ended(text, *lines[:4], *lines[5:], "MP,MU,3,0.15", *held))
    assert main(["import", "c.cdb"]) == 0
    said = capsys.readouterr().out
    assert "contact of the real constants 3, frictional" in said and "77 mm2, friction 0.15" in said
    case = tomllib.loads(Path("c/case.toml").read_text())
    assert [b["name"] for b in case["bodies"]] == ["part-1", "part-2"]


@pytest.mark.parametrize("mean", [False, True])
def test_a_remote_point_is_a_coupling(capsys, mean):
    """A pilot node that leads a face (KEYOPT(4) = 2), or follows it (1), held but for a rotation."""
    mesh = block()
    text = archive(mesh, ("x0",)).replace(
        "N,R5.3", f"{5000:9d}{0:9d}{0:9d}{80.0:21.13E}{5.0:21.13E}{3.0:21.13E}\nN,R5.3"
    )
    text = text.replace(f"{mesh.n_points:10d}\n(3i9", f"{mesh.n_points + 1:10d}\n(3i9")
    lines = pairs(
        mesh, "x1", 5000, ["keyo,cid,12,5", f"keyo,cid,4,{1 if mean else 2}", "keyo,tid,4,111111"]
    )
    held = ["CMSEL,S,X0", "D,ALL,ALL", "D,5000,UX,,,,,UY,UZ", "D,5000,ROTX,,,,,ROTZ"]
    found = hertz(capsys, ended(text, *lines, *held))
    kind = "*DISTRIBUTING" if mean else "*KINEMATIC"
    more = [
        "*NODE",
        "5000, 80., 5., 3.",
        "*SURFACE, NAME=S",
        "EALL",
        "*COUPLING, REF NODE=5000, SURFACE=S",
    ]
    if mean:
        cells = mesh.cells["hexahedron20"]
        inner = np.isin(cells, mesh.face_points("x1")).sum(axis=1) == 8
        more[3:4] = [f"{i + 1}, S{side_of(mesh, cell)}" for i, cell in enumerate(cells) if inner[i]]
    else:
        more[2:4] = ["*SURFACE, NAME=S, TYPE=NODE", "x1"]
    held = ["*BOUNDARY", "x0,1,3", "5000,1,4", "5000,6,6"]
    text = deck(mesh, *more, kind, *held, sets=("x0", "x1"))
    np.testing.assert_allclose(found, hertz(capsys, text, "a.inp"), rtol=1e-9)


def side_of(mesh: Mesh, cell: np.ndarray) -> int:
    on = set(mesh.face_points("x1").tolist())
    return 1 + next(
        i for i, s in enumerate(sides_of("hexahedron20")) if on.issuperset(cell[list(s)].tolist())
    )


EDGES = ["CMBLOCK,CYCLIC_M01{},NODE,{}", "(8i10)"]


def ring(text: str, mesh: Mesh, low="y1", high="y0", command="CYCLIC,12,30,11") -> str:
    lines = ["LOCAL,11,1,0,0,0,0,0,90", "CSYS,0"]
    for letter, face in (("L", low), ("H", high)):
        members = numbers(mesh, face)
        lines += [EDGES[0].format(letter, len(members)), EDGES[1]]
        lines += [
            "".join(f"{n:10d}" for n in members[i : i + 8]) for i in range(0, len(members), 8)
        ]
    return ended(text, *lines, command, "/SOLU", "ANTYPE,MODAL", "CYCOPT,HINDEX,0,4,2")


@pytest.mark.parametrize("command", ["CYCLIC,12,30,11", "CYCLIC,,,11"])
def test_cyclic_edges_are_a_sector(capsys, command):
    """Numbers of CalculiX, as in test_public_decks; of CYCLIC without a number by the angle."""
    material = ("MP,EX,1,205000", "MP,NUXY,1,0.29", "MP,DENS,1,7.83E-9")
    mesh = sector()
    text = ring(archive(mesh, (), material), mesh, command=command)
    found = hertz(capsys, text, k=2)
    np.testing.assert_allclose(found[:3], [140782, 401182, 888852], rtol=3e-6)
    (body,) = Path(".").glob("a-*/body.toml")
    keys = tomllib.loads(body.read_text())
    assert keys["cyclic"] == {
        "sectors": 12, "left": "CYCLIC_M01L", "right": "CYCLIC_M01H", "nodal_diameters": [0, 2, 4],
    }  # fmt: skip
    assert "one of 12 cyclic sectors" in hertz.said


def test_what_is_no_single_ring_is_refused(capsys):
    mesh = sector()
    text = archive(mesh)
    for command, words in (
        ("CYCLIC,13,,11", "12 sectors, not 13"),
        ("CYCLIC,12,30,11,'A'\nCYCLIC,12,30,11,'B'", "multistage"),
        ("CYCLIC,12,30,11\nMSOPT,NEW,S1", "multistage"),
    ):
        Path("a.cdb").write_text(ring(text, mesh, command=command))
        refused_command(["import", "a.cdb"], capsys, words, "a.cdb, line")
        assert not Path("a").exists()


def test_dropped_mid_side_nodes_make_straight_edges(capsys):
    """A brick without the mid-side nodes of one edge, and of a face: as *EQUATIONs in CalculiX."""
    mesh = block((2, 1, 1))
    corners = mesh.cells["hexahedron20"][0]
    dropped = [int(mesh.node_id[corners[8 + i]]) for i in (4, 8)]
    text = archive(mesh, ("x1",))
    lines, at = text.splitlines(), text.splitlines().index("(19i10)") + 1
    for i in range(at, at + 4):
        words = [int(lines[i][k : k + 10]) for k in range(0, len(lines[i]), 10)]
        head = 11 if (i - at) % 2 == 0 else 0
        lines[i] = "".join(
            f"{0 if n in dropped and j >= head else n:10d}" for j, n in enumerate(words)
        )
    found = hertz(capsys, ended("\n".join(lines) + "\n", "CMSEL,S,X1", "D,ALL,ALL"))
    np.testing.assert_allclose(found[:4], STRAIGHT, rtol=3e-6)
    assert "mid-side nodes that elements drop" in hertz.said


STRAIGHT = [1779.041, 2687.528, 12347.96, 15423.66]
"""Hz, CalculiX 2.20: the same mesh, each dropped node by *EQUATION the mean of its ends."""


def test_import_ends_with_a_page_of_what_it_said(capsys):
    """Every sentence stands there, warnings under what to do; the first frequencies with --modes."""
    mesh = block()
    lines = ["D,1,UX,0.5", "CEINTF,0.1", "CMSEL,S,X0", "D,ALL,ALL"]
    Path("a.cdb").write_text(ended(archive(mesh, ("x0",)), *lines))
    assert main(["import", "a.cdb", "--modes"]) == 0
    said = capsys.readouterr().out.splitlines()
    page = Path("a/import.html").read_text()
    for line in said[:-3]:
        words = line.removeprefix("warning: ").removeprefix("note: ")
        assert words[1:].split("'")[0].split("  ")[0] in page, line
    hertz = read_basis(Path("build/a/basis.h5")).groups[0, 0].frequency
    assert f"{hertz[0]:.5g}" in page and page.count("data:image/") == 1
    assert page.index("To do") < page.index("CEINTF") < page.rindex("What was taken")
    assert sorted(p.name for p in Path("a").iterdir()) == ["body.toml", "import.html"]


def compact(text: str) -> str:
    """The archive with its elements in the COMPACT form: number and ten nodes, then the others."""
    lines = text.splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("EBLOCK"))
    end = lines.index(f"{-1:10d}", at)
    words = [int(w) for line in lines[at + 2 : end] for w in line.split()]
    rows = []
    for k in range(0, len(words), 31):
        rows += ["".join(f"{w:10d}" for w in row) for row in (words[k + 10 : k + 21], words[k + 21 : k + 31])]
    head = ["TYPE,1", "MAT,1", f"EBLOCK,10,COMPACT,{len(rows) // 2},{len(rows) // 2}", "(11i10)"]
    return "\n".join([*lines[:at], *head, *rows, *lines[end:]]) + "\n"


def singly(text: str) -> str:
    """The archive with a command N for each node, in a cylindrical system."""
    lines = text.splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("NBLOCK"))
    end = next(i for i, line in enumerate(lines) if line.startswith("N,R5.3"))
    nodes = []
    for line in lines[at + 2 : end]:
        x, y, z = (float(line[k : k + 21]) for k in (27, 48, 69))
        nodes.append(f"N,{int(line[:9])},{np.hypot(x, y):.17g},{np.degrees(np.arctan2(y, x)):.17g},{z!r}")
    return "\n".join([*lines[:at], "CSYS,1", *nodes, "CSYS,0", *lines[end + 1 :]]) + "\n"


@pytest.mark.parametrize("form", [compact, singly])
def test_nodes_and_elements_are_written_in_several_ways(form):
    whole = archive(block(), ("x0",))
    meshes_read = []
    for text in (whole, form(whole)):
        Path("a.cdb").write_text(text)
        meshes_read.append(read_mesh("a.cdb", "mm", "mm-t-s"))
    first, second = meshes_read
    np.testing.assert_allclose(second.points, first.points, atol=1e-12)
    np.testing.assert_array_equal(second.cells["hexahedron20"], first.cells["hexahedron20"])
    assert not second.lost and not second.remarks


def test_masters_are_an_interface_and_no_support(capsys):
    mesh = block()
    nodes = numbers(mesh, "x1")
    masters = [f"M,{nodes[0]},ALL", *(f"M,{n},UX,,,UY,UZ" for n in nodes[1:])]
    free = hertz(capsys, ended(archive(mesh, ("x0",)), "CMSEL,S,X0", "D,ALL,ALL"))
    kept = hertz(capsys, ended(archive(mesh, ("x0",)), "CMSEL,S,X0", "D,ALL,ALL", "ALLSEL", *masters))
    assert "retained displacements of 'M': an interface" in hertz.said
    np.testing.assert_allclose(kept, free, rtol=1e-9)


@pytest.mark.parametrize(
    ("links", "same"),
    [
        # a chain of beams is one rigid body, as CERIG of all its nodes
        (lambda n: ["KEYOPT,9,1,1", *(f"E,{a},{b}" for a, b in zip(n, n[1:], strict=False))],
         lambda n: [f"CERIG,{n[0]},{b}" for b in n[1:]]),
        # a link keeps the distance of two nodes along z
        (lambda n: [f"E,{n[0]},{n[2]}"], lambda n: [f"CE,1,0,{n[0]},UZ,1,{n[2]},UZ,-1"]),
    ],
)  # fmt: skip
def test_rigid_elements_are_links(capsys, links, same):
    mesh = block()
    at = mesh.face_points("x1")
    edge = at[(abs(mesh.points[at, 1]) < 1e-9) & (mesh.points[at, 2] < 0.0036)]
    nodes = [int(n) for n in mesh.node_id[edge[np.argsort(mesh.points[edge, 2])]]]
    text = ended(archive(mesh, ("x0",)), "CMSEL,S,X0", "D,ALL,ALL", "ALLSEL")
    found = hertz(capsys, ended(text, "ET,9,184", "TYPE,9", *links(nodes)))
    assert "is not read" not in hertz.said
    np.testing.assert_allclose(found, hertz(capsys, ended(text, *same(nodes))), rtol=1e-8)


def test_beams_and_shells_that_hold_the_solids_stop_the_import(capsys):
    """A beam on a node; shells that touch solids by bonded contact alone; both may be left out."""
    mesh = block()
    beam = ["N,900,60,0,50", "ET,9,188", "TYPE,9", f"E,{numbers(mesh, 'x1')[0]},900"]
    far = ["N,901,70,0,0", "N,902,70,11,0", "N,903,70,11,7", "N,904,70,0,7"]
    shells = [*far, "ET,9,181", "TYPE,9", "EN,9500,901,902,903,904"]
    bonded = [*pairs(mesh, "x1", 1, ["KEYOPT,3,12,5"])[:-3], "TYPE,4", "REAL,3", "EN,9600,901,902,903,904"]
    for more, words in ((beam, "1 beams (type 188)"), ([*shells, *bonded], "contact pairs with beams or shells")):
        Path("b.cdb").write_text(ended(archive(mesh, ("x0",)), *more))
        refused_command(["import", "b.cdb", "b"], capsys, words, "--solids-only")
    assert main(["import", "b.cdb", "b", "--solids-only"]) == 0


def test_stress_free_temperatures_of_materials():
    """MP,REFT stands before TREF."""
    Path("a.cdb").write_text(ended(archive(block()), "TREF,20", "MP,REFT,1,35", "TUNIF,90"))
    np.testing.assert_allclose(read_mesh("a.cdb", "mm", "mm-t-s").temperature, [[35, 90]] * block().n_points)


@pytest.mark.parametrize(
    ("density", "young", "unit"),
    [(7850, 2.1e11, "m"), (7.35e-4, 3e7, "in"), (7.85e-9, 2.1e5, "mm"), (7.85e-3, 1, "mm")]
)
def test_lengths_are_those_in_which_the_density_is_a_solid_s(capsys, density, young, unit):
    """An archive without /UNITS: of 7850 t/mm3 there is nothing, of 7850 kg/m3 there is."""
    material = [f"MP,DENS,1,{density}", f"MP,EX,1,{young}", "MP,NUXY,1,0.3"]
    Path("a.cdb").write_text(archive(block(), ("x0",), material))
    assert main(["import", "a.cdb", "part"]) == 0
    said = capsys.readouterr().out
    assert tomllib.loads(Path("part/body.toml").read_text())["length_unit"] == unit
    assert ("--unit" in said) == (unit != "mm") and ("no solid's; SI is" in said) == (density == 7.85e-3)


def test_a_beam_of_bricks_has_the_frequencies_that_ansys_prints(capsys):
    """The free beam of 40 SOLID186 whose modes the documentation of pymapdl-reader lists (nu 0.31, other
    units): by their ratios. Full integration is off by 3.5e-3, reduced mass by 2.6e-4."""
    examples = pytest.importorskip("mapdl_archive.examples")
    text = Path(examples.hexarchivefile).read_text(encoding="latin-1")
    found = hertz(capsys, text.replace("0.350000000 ", "0.310000000 "), modes_count=12)
    elastic = found[found > 1]
    ansys = np.array([7366.49503969, 7366.49503969, 11504.89523664, 17285.70459456, 17285.70459457, 20137.19299035])
    np.testing.assert_allclose(elastic[:6] / elastic[0], ansys / ansys[0], rtol=6e-6)


def test_reduced_integration_is_asked_for_by_the_archive(capsys):
    """KEYOPT(2) = 0 makes a block softer; a bar one brick wide, where this leaves motions without
    stiffness, keeps full integration."""
    text = ended(archive(block((4, 2, 2)), ("x0",)).replace("KEYOPT,1,2,1\n", ""), "CMSEL,S,X0", "D,ALL,ALL")
    soft = hertz(capsys, text)
    assert "have reduced integration" in hertz.said
    body = next(Path().glob("a-*/body.toml"))
    assert tomllib.loads(body.read_text())["mesh"]["integration"] == "reduced"
    stiff = hertz(capsys, text.replace("ET,2,154", "KEYOPT,1,2,1\nET,2,154"))
    assert (soft[:4] < stiff[:4]).all()
    again = hertz(capsys, text, mesh_integration="full")  # the same body.toml, asked for another rule
    np.testing.assert_allclose(again, stiff, rtol=1e-9)
    bar = archive(block((4, 1, 1)), ("x0",)).replace("KEYOPT,1,2,1\n", "")
    Path("bar.cdb").write_text(bar)
    read = read_mesh("bar.cdb", "mm", "mm-t-s")
    assert read.integration == "full" and "4 bricks have no neighbours in two directions" in read.remarks[0]


def test_constraints_go_on_in_later_commands():
    """Nodes of a CP set that is named again join it; CE,NEXT is another equation and CE,HIGH more of the last one;
    CERIG has up to five directions."""
    mesh = block((2, 1, 1))
    a, b, c, d = (mesh.node_id[i] for i in range(4))
    lines = [f"CP,1,UZ,{a},{b}", f"CP,1,UZ,{c},{d}", f"CE,1,0,{a},UX,1,{b},UX,-1", f"CE,NEXT,0,{c},UX,1,{d},UX,-1",
             f"CE,HIGH,0,{a},UX,3"]  # fmt: skip
    Path("a.cdb").write_text(ended(archive(mesh, ("x0",)), *lines))
    links = read_mesh("a.cdb", "mm").links.items
    terms = [[*zip(link.nodes.tolist(), link.factors.tolist(), strict=True)] for link in links]
    pairs = [[(0, 1), (node, -1)] for node in (1, 2, 3, 1)]
    assert terms == [*pairs, [(2, 1), (3, -1), (0, 3)]]
    Path("a.cdb").write_text(ended(archive(mesh, ("x0",)), f"CERIG,{a},{b},UX,UZ,,,ROTY"))
    *_, link = read_mesh("a.cdb", "mm").links.items
    assert {*link.directions} == {*"xzb"}

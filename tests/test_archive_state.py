"""Ansys archives whose modes are about a static solution: the frequencies of CalculiX 2.20, which prints
seven digits, of the same loads in a deck."""

from __future__ import annotations

from pathlib import Path

import meshes
import numpy as np
import pytest
from refusals import refused_command
from test_cdb import FORMS, archive
from test_deck_state import BRICK, hertz

from microslip.cli import main
from microslip.data import FacetLoad, Mesh, NodalLoad
from microslip.mesh import read_mesh

STEEL = ["MP,EX,1,205000", "MP,NUXY,1,0.29", "MP,DENS,1,7.83e-9", "MP,ALPX,1,1.2e-5"]
HELD = ["CMSEL,S,X0", "D,ALL,ALL", "ALLSEL"]
STATIC = ["/SOLU", "ANTYPE,STATIC"]
MODAL = ["FINISH", "/SOLU", "ANTYPE,MODAL", "MODOPT,LANB,6", "PSTRES,ON", "SOLVE", "FINISH"]
PERTURBED = [
    "FINISH", "/SOLU", "ANTYPE,STATIC,RESTART,,,PERTURB", "PERTURB,MODAL,,,ALLKEEP", "SOLVE,ELFORM",
    "MODOPT,LANB,6", "MXPAND,6", "SOLVE", "FINISH",
]  # fmt: skip


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def bar(cell: str = BRICK, cells=(4, 1, 1)) -> Mesh:
    return meshes.brick(cell, cells, (0.06, 0.011, 0.007))


def deck(*commands: str, cell: str = BRICK, material=STEEL, cells=(4, 1, 1)) -> str:
    """60 x 11 x 7 mm, clamped at x = 0."""
    text = archive(bar(cell, cells), ("x0", "x1", "z1"), material)
    return text.replace("\nFINISH", "\n" + "\n".join([*HELD, *commands]))


def solved(*loads: str, modal=MODAL, nonlinear: bool = False, **more) -> str:
    first = [*STATIC, *["NLGEOM,ON"] * nonlinear, "PSTRES,ON", *loads, "SOLVE"]
    return deck(*first, *modal, **more)


def imported(capsys, text: str) -> str:
    Path("a.cdb").write_text(text)
    assert main(["import", "a.cdb", "body"]) == 0
    return capsys.readouterr().out


PULLED = ["F,X1,FX,300", "F,X1,FZ,5"]
PRESSED = ["SFE,ALL,6,PRES,1,20"]
PULLING = ["ACEL,-5.e7"]
TURNING = ["CM,EVERY,ELEM", "CMOMEGA,EVERY,2000,,,0,-50,0,0,-50,1"]
STRETCHED = ["D,X1,UX,0.1"]
HEATED = ["TREF,20", "BFUNIF,TEMP,120", *(
    f"BF,{i},TEMP,{50 + 170 * x[0] / 0.06 + 60 * x[2] / 0.007:.12g}"
    for i, x in zip(bar().node_id, bar().points, strict=True)
)]  # fmt: skip
"""A field that is linear in x and z."""
HOT = ["MPTEMP,1,20,420", "MPDATA,EX,1,1,205000,150000", *STEEL[1:]]


@pytest.mark.parametrize(
    ("loads", "modal", "nonlinear", "wanted"),
    [
        (PULLED, MODAL, False, [1683.764, 2557.63, 9977.832, 12160.75]),
        (PRESSED, PERTURBED, False, [1647.399, 2522.972, 9960.073, 12182.15]),
        (TURNING, MODAL, False, [1680.033, 2536.7, 9965.078, 12163.36]),
        (HEATED, MODAL, False, [1644.754, 2533.4, 9946.339, 12163.1]),
        (STRETCHED, MODAL, False, [2779.31, 4055.717, 12185.65, 13853.02]),
        (PRESSED, PERTURBED, True, [1644.252, 2527.841, 9918.115, 12156.31]),
        (STRETCHED, PERTURBED, True, [2779.453, 4055.814, 12185.68, 13853.24]),
        pytest.param(PULLING, PERTURBED, True, [1654.323, 2538.985, 9942.455, 12159.46], marks=pytest.mark.slow),
    ],
)
def test_the_modes_are_about_the_static_solution(capsys, loads, modal, nonlinear, wanted):
    """Most numbers are those of `test_deck_state`, from CalculiX decks of the same loads."""
    said = imported(capsys, solved(*loads, modal=modal, nonlinear=nonlinear))
    assert "the modes are about its static state" in said and "not known here" not in said
    np.testing.assert_allclose(hertz(), wanted, rtol=1e-6)


def test_moduli_of_a_heated_body_are_those_at_its_temperatures(capsys):
    """Pulled and heated, the modulus falling to 150 GPa at 420 degrees."""
    imported(capsys, solved(*HEATED, "F,X1,FX,300", material=HOT))
    np.testing.assert_allclose(hertz(), [1631.759, 2476.404, 9546.354, 11695.77], rtol=1e-6)


def test_loads_of_a_turned_node_are_along_its_axes(capsys):
    """As CalculiX has it with *TRANSFORM, TYPE=C of x = 60 mm: 300 N along r, 50 N along theta."""
    system = ["LOCAL,11,1,50,-3,-2", "NSEL,S,NODE,,1,999", "CMSEL,S,X1", "NROTAT,ALL", "CSYS,0", "ALLSEL"]
    imported(capsys, solved(*system, "F,X1,FX,300", "F,X1,FY,50"))
    np.testing.assert_allclose(hertz(), [1670.647, 2550.149, 9962.503, 12169.82], rtol=1e-6)


def pulled(text: str) -> float:
    """N along x on all nodes."""
    Path("a.cdb").write_text(text)
    state = read_mesh("a.cdb", "mm", "mm-t-s").state
    forces = [load for load in state.loads if isinstance(load, NodalLoad)] if state else []
    return sum(load.values[load.directions == 0].sum() for load in forces)


FIRST = [*STATIC, "PSTRES,ON", "F,X1,FX,300", "SOLVE"]
RAMP = [
    "*DIM,_loadvari9,TABLE,2,1,1,TIME,", "_loadvari9(1,0,1) = 0.", "_loadvari9(2,0,1) = 2.",
    "_loadvari9(1,1,1) = 0.", "_loadvari9(2,1,1) = 300.",
]  # fmt: skip


@pytest.mark.parametrize(
    ("commands", "each"),
    [
        ([*FIRST, "F,X1,FX,150", "SOLVE", *MODAL], 150),  # a later value takes the place of the first
        ([*FIRST, "FDELE,X1,FX", "SOLVE", *MODAL], 0),
        ([*FIRST, "F,X1,FX,150", "SOLVE", *PERTURBED[:2], "ANTYPE,,REST,1,,PERTURB", *PERTURBED[3:]], 300),
        ([*STATIC, *RAMP, "PSTRES,ON", "F,X1,FX,%_loadvari9%", "TIME,1", "SOLVE", *MODAL], 150),
        ([*STATIC, "A=100", "B=2*A+50*2", "PSTRES,ON", "*IF,A,GT,50,THEN", "F,X1,FX,B", "*ELSE",
          "F,X1,FX,7", "*ENDIF", "SOLVE", *MODAL], 300),
        ([*FIRST, *MODAL[:-3], "PSTRES,OFF", "SOLVE"], 0),  # of an unstressed body
        ([*FIRST, *MODAL, "F,X1,FX,9", "SOLVE"], 300),  # behind the first modes
        (["ANTYPE,MODAL", "PSTRES,1", "F,X1,FX,300", "FINISH"], 300),  # an archive without SOLVE
    ],
)  # fmt: skip
def test_the_loads_are_those_of_the_solution(commands, each):
    np.testing.assert_allclose(pulled(deck(*commands)), each * len(bar().face_points("x1")), rtol=1e-12)


def test_supports_may_change_between_the_loads_and_the_modes():
    """PERTURB with NOKEEP takes all supports away, D behind it gives others; the others keep what is held."""
    first = [*STATIC, "D,X1,UX,0.1", "SOLVE", *PERTURBED[:3]]
    for keep, more, modes in (
        ("NOKEEP", ["CMSEL,S,X1", "D,ALL,UZ"], {"X1": "z"}),
        ("DZEROKEEP", [], {"X0": "xyz", "X1": "x"}),
        ("INERKEEP", [], {"X0": "xyz", "X1": "x"}),
        ("ALLKEEP", [], {"X0": "xyz", "X1": "x"}),
    ):
        Path("a.cdb").write_text(deck(*first, f"PERTURB,MODAL,,,{keep}", *more, "SOLVE"))
        read = read_mesh("a.cdb", "mm", "mm-t-s")
        assert dict(read.supports) == modes
        still = read.supports if read.state.supports is None else read.state.supports
        assert dict(still) == {"X0": "xyz", "X1": "x"} and not read.lost


def test_masses_weigh_under_an_acceleration(capsys):
    """MASS21 of 0.002 t under ACEL is pulled as by its weight."""
    mass = ["ET,9,21", "KEYOPT,9,3,2", "R,9,0.002", "TYPE,9", "REAL,9", "E,50"]
    pull = [*mass, "ACEL,-4.e7,0,-1.e4"]
    imported(capsys, solved(*pull))
    both = hertz()
    Path("body/body.toml").unlink()
    imported(capsys, solved(*pull[:-1], "CM,BAR,ELEM", "CMACEL,BAR,-4.e7,0,-1.e4", "F,50,FX,8.e4", "F,50,FZ,20",
                            "ESEL,ALL"))  # fmt: skip
    np.testing.assert_allclose(hertz(), both, rtol=1e-9)


def surface(mesh: Mesh, face: str, kind: int = 2, turned: bool = False) -> list[str]:
    """SURF154 on a face in a short block, as Workbench writes it."""
    cells = [c for block in mesh.faces[face].values() for c in block]
    corners = [list(c[:4][::-1] if turned else c) for c in cells]
    rows = [[900 + i, kind, 1, 1, 0, *mesh.node_id[c]] for i, c in enumerate(corners)]
    lines = ["".join(f"{w:9d}" for w in row) for row in rows]
    return [f"EBLOCK,10,,,{len(rows)}", "(15i9)", *lines, "-1", "ESEL,S,TYPE,,2"]


@pytest.mark.parametrize("kind", FORMS)
def test_a_pressure_is_said_in_many_ways(kind):
    """By nodes, by faces of elements, by surface elements of either order and in the next line: each
    makes the same force, area times pressure along the inward normal."""
    mesh = bar(kind, (2, 1, 1))
    nodes = ["CMSEL,S,Z1", "SF,ALL,PRES,20", "ALLSEL"]
    select = ["NSLE,S", "SF,ALL,PRES,20"]
    forms = [nodes]
    if "hexahedron" in kind:
        block = ["SFEBLOCK,4,PRES,2,16,0", "(i9,i4,i4,6(pg20.9))"]
        rows = [f"{e:9d}   6{part:4d}" + f"{(2 - part) * 20.0:20.9f}" * 4 for e in (1, 2) for part in (1, 2)]
        forms += [
            [*surface(mesh, "z1"), *select],
            [*surface(mesh, "z1", turned=True), "SFE,ALL,1,PRES,1,-20"],
            [*surface(mesh, "z1"), "ALLSEL", *nodes],  # of both that lie there once
            [*surface(mesh, "z1"), *(line.replace("  90", "  91") for line in surface(mesh, "z1")),
             "SFE,ALL,1,PRES,1,10"],
            ["SFE,1,6,PRES,1,R5.0", " 20. 20. 20. 20.", "SFE,2,6,PRES,,20", "SFE,2,1,PRES,2,9"],
            [*block, *rows, "SFE,end,LOC,       -1,"],
        ]
    for lines in forms:
        Path("a.cdb").write_text(deck("ANTYPE,0", "PSTRES,ON", *lines, "ALLSEL", "FINISH", cell=kind, cells=(2, 1, 1)))
        read = read_mesh("a.cdb", "mm", "mm-t-s")
        assert read.state is not None and not read.lost, read.lost
        total = np.zeros(3)
        for load in read.state.loads:
            assert isinstance(load, FacetLoad)
            for corners, values in zip(load.facets, load.values, strict=True):
                x = read.points[corners]
                n = len(values)
                area = sum(np.cross(x[i] - x[0], x[i + 1] - x[0]) / 2 for i in range(1, n - 1))
                total += -values.mean() * area
        np.testing.assert_allclose(total, [0, 0, -20e6 * 0.06 * 0.011], rtol=1e-9, atol=1e-6)


def test_surface_elements_pull_along_the_axes_of_their_system(capsys):
    """KEYOPT(2) = 1 of SURF154: face 1 along x of the global system; 300 N as on 8 nodes together."""
    mesh = bar()
    area = 11 * 7
    text = solved("KEYOPT,2,2,1", *surface(mesh, "x1"), f"SFE,ALL,1,PRES,1,{300 / area!r}")
    Path("a.cdb").write_text(text)
    (load,) = read_mesh("a.cdb", "mm", "mm-t-s").state.loads
    np.testing.assert_allclose(load.direction, [1, 0, 0])
    np.testing.assert_allclose(load.values, 300e6 / area)


@pytest.mark.parametrize(
    ("material", "factor"),
    [
        (["MP,EX,1,210000,-25"], 205500 / 210000),  # C0 + C1 T at 180
        (["MPTEMP,1,100,200", "MP,EX,1,200000,0,-1"], (0.2 * 190000 + 0.8 * 160000) / 200000),
        (["TB,ELASTIC,1,2", "TBTEMP,80", "TBDATA,1,210000,0.29", "TBTEMP,280", "TBDATA,1,190000,0.29"], 200 / 210),
    ],
)
def test_moduli_over_temperature(material, factor):
    """Polynomials at the points of MPTEMP or, without them, as they are; a table of TB."""
    rest = [line for line in STEEL if ",EX," not in line and not (material[0][:2] == "TB" and "NUXY" in line)]
    Path("a.cdb").write_text(deck("TUNIF,180", "FINISH", material=[*material, *rest]))
    read = read_mesh("a.cdb", "mm", "mm-t-s")
    E0 = float(material[-1].split(",")[3]) if material[0][:2] != "TB" else 210000.0
    made = read.materials[0]
    scale = 1.0 if made.temperature_table is None else np.interp(180, *made.temperature_table.T)
    C = made.elasticity[0, 0] * (1 + 0.29) * (1 - 2 * 0.29) / (1 - 0.29) * scale
    assert C == pytest.approx(factor * E0 * 1e6, rel=1e-12)


def test_temperatures_of_elements_are_those_of_their_nodes():
    """BFE: one value for all of an element, eight for its corners, their mean between them."""
    eight = ["BFE,1,TEMP,1,10,20,30,40", "BFE,1,TEMP,5,50,60,70,80"]
    Path("a.cdb").write_text(deck("TREF,5", *eight, "FINISH", cells=(1, 1, 1)))
    read = read_mesh("a.cdb", "mm", "mm-t-s")
    cell = read.cells[BRICK][0]
    np.testing.assert_allclose(read.temperature[cell, 1][:10], [10, 20, 30, 40, 50, 60, 70, 80, 15, 25])
    np.testing.assert_allclose(read.temperature[:, 0], 5)


@pytest.mark.parametrize(
    ("load", "words"),
    [
        ("DOMEGA,0,0,5", "DOMEGA is not read"),
        ("SFE,1,4,PRES,1,%GONE%", "table %GONE%"),
        ("SLOAD,1,9,LOCK,FORC,100", "SLOAD loads the body"),
        ("FCUM,ADD", "FCUM,ADD"),
        ("SFGRAD,PRES,0,Y,0,3", "SFGRAD"),
    ],
)
def test_a_load_that_is_not_taken_is_told(capsys, load, words):
    assert words in imported(capsys, solved("F,X1,FX,1", load))


@pytest.mark.parametrize(
    ("load", "line", "words"),
    [
        ("F,X1,FX,many", "F,X1", "where a number belongs"),
        ("SFE,99,1,PRES,1,5", "SOLVE", "the element 99, which is not there"),
        ("SFE,ALL,6,PRES,1,1e", "SFE", "where a number belongs"),
        ("F,999,FX,3", "SOLVE", "node 999"),
        ("ACEL,0,0,g", "ACEL", "where a number belongs"),
        ("CMOMEGA,NONE,5", "SOLVE", "NONE"),
        ("*IF,1,IS,2,THEN", "*IF", "IS"),
        ("BFE,77,TEMP,1,5", "", "element 77"),
        ("ANTYPE,STATIC,RESTART,7,,PERTURB", "", "load step 7 of 1"),
        ("SFEBLOCK,4,PRES,1,16,0\n(i9,i4,i4,4(pg20.9))\n        1   6   1    20.0", "SFEBLOCK", "truncated"),
    ],
)
def test_a_damaged_load_is_refused_with_its_line(capsys, load, line, words):
    text = solved(load, modal=[]) if "SFEBLOCK" not in load else deck(*STATIC, load)
    Path("a.cdb").write_text(text)
    number = next((i for i, row in enumerate(text.splitlines(), 1) if line and row.startswith(line)), 0)
    refused_command(["import", "a.cdb", "body"], capsys, words, *([f"line {number}"] if number else []))

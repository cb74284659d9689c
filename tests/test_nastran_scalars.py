"""Nastran's scalar points, scalar masses and rigid bars: each deck is one that says the same by other cards."""

from __future__ import annotations

from pathlib import Path

import meshes
import numpy as np
import pytest
from refusals import refused_command
from test_nastran_systems import block, bulk, card, hertz

from microslip.mesh import mesh_problems, read_mesh
from microslip.topology import CELL_TYPES

MESH = block()
CLAMPED = ",".join(str(n) for n, x in zip(MESH.node_id, MESH.points, strict=True) if x[0] == 0)
TIP = [int(n) for n, x in zip(MESH.node_id, MESH.points, strict=True) if x[0] > 0.0599]
A, B = TIP[0], TIP[-1]
HEAVY = ["CONM2,802,900,,.02", "GRID,900,,.06,0.,0."]
SKEW = card("CORD2R", 6, 0, (0.0, 0.0, 0.0), (0.0, 3.0, 4.0), (1.0, 0.0, 0.0))


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def deck(*cards: str, cd: str = "") -> str:
    return bulk(MESH, f"SPC1,7,123,{CLAMPED}", *cards, control=("SPC=7", "MPC=5"), cd=cd)


SAME = [
    (["SPOINT,901", f"CELAS2,801,3.+5,{A},3,901", "CMASS4,802,.02,901"],
     [*HEAVY, f"CELAS2,801,3.+5,{A},3,900,3", "SPC1,7,12,900"]),
    (["SPOINT,901,THRU,903", f"CELAS1,801,9,{A},3,902,0", "PELAS,9,3.+5", "CELAS4,803,4.+5,902,901", "CMASS3,802,8,901",
      "PMASS,8,.02", "CMASS1,804,8,902,1"],
     [*HEAVY, "CONM2,803,904,,.02", "GRID,904,,.06,0.,0.",
      f"CELAS2,801,3.+5,{A},3,904,3", "CELAS2,803,4.+5,904,3,900,3",
      "SPC1,7,12,900,904"]),
    ([f"CMASS2,80{k},.02,{A},{k}" for k in (1, 2, 3)], [f"CONM2,801,{A},,.02"]),
    ([f"CMASS2,801,.02,{A},3"], [*HEAVY, f"MPC,5,900,3,1.,{A},3,-1.", "SPC1,7,12,900"]),
    ([f"CMASS2,801,.02,{A},3,{B},2"], [*HEAVY, f"MPC,5,900,3,1.,{A},3,-1.", f",,{B},2,1.", "SPC1,7,12,900"]),
    ([*HEAVY, f"RBAR,803,900,{A},123456,,,123"], [*HEAVY, f"RBE2,803,900,123,{A}"]),
    ([*HEAVY, f"RBAR,803,900,{A},456,123"], [*HEAVY, f"RBE2,803,900,123,{A}"]),
    ([*HEAVY, f"RBE1,803,900,123456,,,,,,+\n+,UM,{A},123,{B},123"], [*HEAVY, f"RBE2,803,900,123,{A},{B}"]),
    ([*HEAVY, f"RBAR1,803,900,{A},123"], [*HEAVY, f"RBE2,803,900,123,{A}"]),
    ([f"RROD,803,{A},{TIP[2]}"], [f"MPC,5,{A},3,1.,{TIP[2]},3,-1."]),
    ([*HEAVY, f"RBE3,803,,900,123,1.,123,{A},{B},+\n+,UM,{A},123"], [*HEAVY, f"RBE3,803,,900,123,1.,123,{A},{B}"]),
]  # fmt: skip


@pytest.mark.parametrize(("cards", "others"), SAME)
def test_scalar_and_rigid_elements_are_what_others_say(cards, others):
    assert ",CONM2," not in cards
    np.testing.assert_allclose(hertz(deck(*cards)), hertz(deck(*others), "b"), rtol=1e-8)


def test_scalar_elements_along_the_directions_of_a_turned_node():
    """z of the node is (0, 0.6, 0.8): a mass and a spring to a scalar point along it."""
    cards = [
        "SPOINT,901",
        f"CELAS2,801,3.+5,{A},3,901",
        "CMASS4,802,.02,901",
        f"CMASS2,804,.01,{A},3",
    ]
    others = [
        "SPOINT,901",
        f"MPC,5,902,1,-1.,{A},2,.6,+\n+,,{A},3,.8",
        "CELAS2,801,3.+5,902,1,901",
        "CMASS4,802,.02,901",
    ]
    others += ["GRID,902,,.06,0.,0.", "SPC1,7,23,902", "CONM2,804,902,,.01"]
    np.testing.assert_allclose(
        hertz(deck(*cards, SKEW, cd="6")), hertz(deck(*others), "b"), rtol=1e-8
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"CELAS4,801,1.,{A},{B}", "names no component"),
        (f"CELAS2,801,1.,{A},0", "names no component"),
        ("CELAS2,801,1.", "joins nothing"),
        (f"CMASS2,801,-1.,{A},1", "below 0"),
        (f"CMASS1,801,77,{A},1", "PMASS 77"),
        ("CDAMP3,801,77,999", "PDAMP 77"),
        (f"RBAR,801,{A},{B},12,3", "3 independent components"),
        (f"RBAR,801,{A},{B},123,456,4,1", "no point of which all six"),
        (f"RROD,801,{A},{A}", "at one place"),
        ("SPOINT,901,THRU", "THRU without its ends"),
    ],
)
def test_damaged_scalar_elements_are_refused_with_their_line(capsys, text, words):
    Path("a.bdf").write_text(whole := deck(text))
    line = whole.splitlines().index(text) + 1
    refused_command(
        ["import", "a.bdf", "body", "--unit", "m"], capsys, f"a.bdf, line {line}", words
    )
    assert not Path("body").exists()


@pytest.mark.parametrize(
    "kind", ["hexahedron", "hexahedron20", "wedge15", "pyramid13", "tetra10", "pyramid"]
)
def test_cells_that_are_numbered_left_handed_are_the_same_cells(kind):
    """Mirrored coordinates: every cell is inside out until its nodes are counted the other way."""
    mesh = meshes.brick(kind, (2, 1, 1), (0.03, 0.01, 0.02))
    Path("a.bdf").write_text(
        bulk(meshes.brick(kind, (2, 1, 1), (0.03, 0.01, 0.02), to=lambda x: x * [1, -1, 1]))
    )
    read = read_mesh("a.bdf", "m")
    assert not mesh_problems(read)[0] and "left-handed" in read.remarks[0]
    for number, cell in enumerate(CELL_TYPES[kind].edges):
        a, b = (read.points[read.cells[kind][:, i]] for i in cell[:2])
        middle = (
            read.points[read.cells[kind][:, CELL_TYPES[kind].corners + number]]
            if CELL_TYPES[kind].order > 1
            else (a + b) / 2
        )
        np.testing.assert_allclose(middle, (a + b) / 2, atol=1e-15)
    assert read.n_points == mesh.n_points


def test_scalar_points_need_no_spoint_and_a_mass_that_cannot_move_may_be_impossible():
    cards = [f"CELAS2,801,3.+5,{A},3,901", "CMASS4,802,.02,901", "GRID,950,,0.,0.,0.,,123456"]
    cards += ["CONM2,803,950,,1.,,,,,+\n+,1.,1.,1.,1.,1.,1."]
    others = ["SPOINT,901", f"CELAS2,801,3.+5,{A},3,901", "CMASS4,802,.02,901"]
    np.testing.assert_allclose(hertz(deck(*cards)), hertz(deck(*others), "b"), rtol=1e-9)

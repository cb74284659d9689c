"""Twenty damaged decks of each format: one sentence that names the place, exit code 2, nothing written.

A row is what is replaced, by what, and what the sentence names: line, element or node.
"""

from __future__ import annotations

from pathlib import Path

import meshes
import pytest
from refusals import refused_command
from test_cdb import archive
from test_fuzz import within
from test_lumped import hanging, nastran
from test_readers import tetrahedra, unv

RBE = ("GRID,901,,75.,14.,9.", "RBE2,701,901,123456,31", "CONM2,501,901,,5.-6", "CELAS2,602,3.+5,901,4")
DECKS = {
    "inp": hanging(),
    "bdf": nastran(*RBE),
    "cdb": archive(meshes.brick("hexahedron20", (2, 1, 1), (0.06, 0.011, 0.007)), ("x0",)).replace(
        "FINISH", "MPDATA,R5.0, 2,EX  ,1, 1, 70000.0\nD,1,UX,0.\nD,X0,UY,0.\nFINISH"
    ),
    "unv": unv(tetrahedra()),
}
CUT, HUGE, NAN = "<cut here>", "99999999999999999999", "nan"
BRICK = "1, 1, 13, 18, 6, 3,"
INP = [
    (BRICK, f"1, 1, {HUGE}, 18, 6, 3,", "line 34"),
    (BRICK, "1, 1, 99, 18, 6, 3,", "line 34"),
    (BRICK, "1, 1, 1, 18, 6, 3,", "element 1"),
    (BRICK, "1, 1, 13, 18, 6, x,", "line 34"),
    (BRICK, "2, 1, 13, 18, 6, 3,", "line 34"),
    (BRICK, "-1, 1, 13, 18, 6, 3,", "line 34"),
    ("24, 17, 14, 26, 31, 19", CUT, "line 34"),
    ("24, 17, 14, 26, 31, 19\n", "", "line 34"),
    ("13, 30.0, 0.0, 0.0", "13, 30.0, nan, 0.0", "node 13"),
    ("13, 30.0, 0.0, 0.0", "13, 1e400, 0.0, 0.0", "node 13"),
    ("13, 30.0, 0.0, 0.0", "13, 0.0, 30.0, 0.0", "element 1"),
    ("13, 30.0, 0.0, 0.0", "12, 30.0, 0.0, 0.0", "line 1"),
    ("13, 30.0, 0.0, 0.0", "\x00ü, 30.0, 0.0, 0.0", "line 1"),
    ("TYPE=C3D20", "TYPE=C3D99", "line 34"),
    ("205000., 0.29", "205000., 0.7", "line 57"),
    ("205000., 0.29", "steel", "line 58"),
    ("NAME=ST\n", "NAME=ZT\n", "line 62"),
    ("x0, 1, 3", "gone, 1, 3", "line 90"),
    ("2\n3000.", "9\n3000.", "line 78"),
    ("*BOUNDARY", "*INCLUDE, INPUT=a.inp\n*BOUNDARY", "line 90"),
]
GRID = "GRID*                 32                 6.000000000E+01"
CHEXA = "CHEXA          1       1       1      13"
BDF = [
    (CHEXA, CHEXA.replace(" 13", "993"), "line 69"),
    (CHEXA, CHEXA.replace("13", " 1"), "element 1"),
    (CHEXA, CHEXA.replace("1", "2", 1), "line 72"),
    ("CELAS2,602,3.+5,901,4", "CELAS1,602,8,901,4", "line 88"),
    (CHEXA, CHEXA.replace("13", " x"), "line 69"),
    ("+             20       8       9      16      11       4       2      14+\n", "", "element 1"),
    ("6.000000000E+01 0.000000000E+00\n*        3.500000000E+00", CUT, "no volume cells"),
    (GRID, GRID[:41] + "6.0000000x0E+01", "line 67"),
    (GRID, GRID[:41] + "            NAN", "line 67"),
    (GRID, GRID[:41] + "6.00000000E+400", "node 32"),
    (GRID, GRID.replace("32", "31"), "line 67"),
    ("GRID*                 32                ", "GRID*                 32              77", "line 67"),
    ("MAT1,1,205000.,,.29", "MAT1,1,205000.,,.79", "line 76"),
    ("MAT1,1,205000.,,.29", "MAT1,1,steel,,.29", "line 76"),
    ("CONM2,501,901,,5.-6", "CONM2,501,901,,-5.-6", "line 87"),
    ("SPC1,1,123,8", "SPC1,1,123,THRU,8", "line 84"),
    ("SPC1,1,123,8", "SPC1,1,123,8,THRU", "line 84"),
    ("RBE2,701,901,123456,31", "RBE2,701,901,123456", "line 86"),
    ("RBE2,701,901,123456,31", "RBE2,701,999,123456,31", "line 86"),
    ("BEGIN BULK", "BEGIN BULK\nINCLUDE 'a.bdf'", "line 5"),
]
FIRST = "        20         0         1         1        13"
CDB = [
    ("D,X0,UY,0.", "CE,1,0.,99,UX,1.", "line 56"),
    ("NBLOCK,6,SOLID,        32,        32", "NBLOCK,6,SOLID,999999999,999999999", "line 5"),
    ("(19i10)", "(0i10)", "line 40"),
    ("(3i9,6e21.13e3)\n", "", "line 5"),
    ("       13        0        0  3.0", "       13        0        0  nan", "line 5"),
    ("       13        0        0  3.0000000000000E+01", "       13        0        0 3.0000000000000E+400", "node 13"),
    ("       13        0        0  3.0", "       12        0        0  3.0", "node 13"),
    ("       13        0        0  3.0", "       -1        0        0  3.0", "line 5"),
    ("       13        0        0  3.0", "       xx        0        0  3.0", "line 5"),
    ("N,R5.3,LOC,       -1,", CUT, "line 5"),
    ("EBLOCK,19,SOLID,         2,         2", "EBLOCK,19,SOLID, 999999999, 999999999", "line 40"),
    (FIRST, FIRST.replace(" 13", "993"), "element 1"),
    (FIRST, FIRST.replace("13", " x"), "line 40"),
    (FIRST, FIRST.replace("1", "2", 1), "element 2"),
    (FIRST, FIRST.replace("20", "19"), "line 40"),
    ("ET,1,186", "ET,1,45", "element 1"),
    ("ET,1,186", "ET,7,186", "element 1"),
    ("CMBLOCK,X0,NODE,       8", "CMBLOCK,X0,NODE,99999999", "line 47"),
    ("MPDATA,R5.0, 1,NUXY,1, 1, 0.3", "MPDATA,R5.0, 1,NUXY,1, 1, 0.9", "material 'material 1'"),
    ("MPDATA,R5.0, 1,EX  ,1, 1, 210000.0", "MPDATA,R5.0, 1,EX  ,1, 1, steel", "line 51"),
]
HEAD = "       101       111         1         1         7         4\n"
PLACE = 3 * "   0.0000000000000000D+00" + "\n"
UNV = [
    (HEAD, HEAD.replace("         4\n", "2000000000\n"), "line 39"),
    (HEAD, HEAD.replace("         4\n", "        -4\n"), "line 37"),
    (HEAD, HEAD.replace("         4\n", "         5\n"), "line 39"),
    (HEAD, HEAD.replace("111", "999"), "line 38"),
    (HEAD, HEAD.replace("101", "102"), "line 40"),
    (HEAD, HEAD.replace("101", "1x1"), "line 37"),
    (HEAD, "", "line 59"),
    (HEAD, CUT, "line 28"),
    ("         2         5         6        12\n", "         2         5        99        12\n", "line 56"),
    ("         2         5         6        12\n", "         2         5         6\n", "line 57"),
    ("         2         5         6        12\n", f"         2         5         6{HUGE}\n", "line 57"),
    ("         2         1         1        11\n", "         1         1         1        11\n", "line 6"),
    ("         2         1         1        11\n", "         ü         1         1        11\n", "line 5"),
    (PLACE, "   0. 0.\n", "line 5"),
    (PLACE, "   0. 0. nan\n", "node 1"),
    (PLACE, "   0. 0. 1e400\n", "node 1"),
    ("  2411\n", "  2410\n", "no nodes"),
    ("         3\nroot", "        -3\nroot", "line 65"),
    ("         3\nroot", "  99999999\nroot", "line 68"),
    ("root\n         8", "root\n         x", "line 66"),
]
ROWS = [(kind, *row) for kind, rows in (("inp", INP), ("bdf", BDF), ("cdb", CDB), ("unv", UNV)) for row in rows]


@pytest.mark.parametrize(("kind", "old", "new", "place"), ROWS)
def test_a_damaged_deck_is_refused_where_it_is_wrong(tmp_path, monkeypatch, capsys, kind, old, new, place):
    monkeypatch.chdir(tmp_path)
    text = DECKS[kind]
    assert old in text
    Path(f"a.{kind}").write_text(text[: text.index(old)] if new == CUT else text.replace(old, new, 1))
    with within(10):
        said = refused_command(["import", f"a.{kind}", "body"], capsys, f"a.{kind}", place)
    assert len(said.splitlines()) == 1 and not Path("body").exists()

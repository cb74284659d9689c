"""One model in every spelling of Nastran's bulk data: small, wide and free fields, continuations, copies, includes."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path

import meshes
import numpy as np
import pytest
from refusals import refused_command
from test_bdf import CARD, ORDER

from microslip.data import Mesh
from microslip.errors import UserError
from microslip.mesh import read_mesh
from microslip.mesh.bdf_cards import included

Card = list[str]
HEAD = ["SOL 103", "CEND", "SPC = 7", "METHOD = 1", "SUBCASE 1", "LOAD = 3", "SUBCASE 2", "STATSUB = 1", "BEGIN BULK"]


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def model() -> list[Card]:
    """Two bricks with twenty nodes, supports, links, lumps, a load; fields as words."""
    mesh = meshes.brick("hexahedron20", (2, 1, 1), (4.0, 1.0, 2.0))
    cards = [["GRID", str(n), "", *(f"{v:g}" for v in x)] for n, x in zip(mesh.node_id, mesh.points, strict=True)]
    cards = [[c if "." in c or i < 3 else f"{c}." for i, c in enumerate(card)] for card in cards]
    for number, cell in enumerate(mesh.cells["hexahedron20"], 1):
        cards.append([CARD["hex"], str(number), "1", *(str(mesh.node_id[cell[i]]) for i in ORDER["hexahedron20"])])
    ids = mesh.node_id
    clamped = [str(n) for n in ids[mesh.points[:, 0] == 0]]
    tip = [str(n) for n in ids[mesh.points[:, 0] == 4]]
    return [
        *cards, ["GRID", "900", "", "6.", "0.", "0."], ["PSOLID", "1", "2"],
        ["MAT1", "2", "2.1+11", "", ".3", "7.8+3", "1.2-5"], ["SPC1", "7", "123456", *clamped],
        ["RBE2", "800", "900", "123456", *tip[:7]],
        ["CONM2", "801", "900", "", "3.5", "", "", "", "", ".1", "0.", ".2", "", "", ".3"],
        ["RBE3", "802", "", "900", "123", "1.", "123", *tip[7:]], ["FORCE", "3", "900", "", "1.5+3", "1.", "0.", "-2."],
        ["CELAS2", "803", "1.+5", tip[0], "1"], ["SET1", "9", "1", "THRU", "9"],
    ]  # fmt: skip


def written(card: Card, rng: np.random.Generator, count: list[int]) -> list[str]:
    """Lines of a card; each row of eight fields in a spelling of its own."""
    name, fields = card[0], card[1:]
    rows = [fields[i : i + 8] for i in range(0, len(fields), 8)]
    lines, mark = list[str](), ""
    for number, row in enumerate(rows):
        row = row + [""] * (8 - len(row))
        first = name if number == 0 else mark
        count[0] += 1
        last = number == len(rows) - 1
        mark = "" if last else str(rng.choice(["", "+", f"+A{count[0]}"]))
        style = rng.choice(["small", "wide", "free", "widefree", "tabs"])
        if style == "small":
            lines.append(f"{first:8}{''.join(f'{w:8}' if rng.random() < 0.5 else f'{w:>8}' for w in row)}{mark:8}")
        elif style == "tabs":
            lines.append("\t".join([first, *row, mark]))
        elif style == "free":
            text = f"{first},{','.join(row)},{mark}"
            lines.append(text if mark or not last else text.rstrip(","))
        else:
            begin = f"{name}*" if number == 0 else f"*{mark_of(first)}"
            halves = [row[:4]] if last and not any(row[4:]) and rng.random() < 0.7 else [row[:4], row[4:]]
            for k, half in enumerate(halves):
                head, tail = (begin if k == 0 else "*"), mark if k == len(halves) - 1 else ""
                if style == "wide":
                    lines.append(f"{head:8}{''.join(f'{w:16}' for w in half)}{tail:8}")
                else:
                    text = f"{head},{','.join(half)},{tail}"
                    lines.append(text if tail else text.rstrip(","))
    return [line.lower() if rng.random() < 0.2 else line for line in lines]


def mark_of(text: str) -> str:
    return text.lstrip("+")


def spelled(rng: np.random.Generator) -> None:
    """a.bdf and what it includes."""
    cards, count = model(), [0]
    chunks = [cards[i : i + 9] for i in range(0, len(cards), 9)]
    main = list(HEAD)
    Path("parts").mkdir(exist_ok=True)
    for k, chunk in enumerate(chunks):
        lines = [line for card in chunk for line in written(card, rng, count)]
        lines.insert(0, "$ a comment, with a comma")
        where = rng.random()
        if where < 0.4:
            main += lines
        elif where < 0.7:
            Path(f"parts/p{k}.bdf").write_text("\n".join(lines) + "\n")
            main.append(f"INCLUDE 'parts/p{k}.bdf'" if rng.random() < 0.5 else f"include parts/p{k}.bdf $ here")
        else:
            Path(f"parts/q{k}.bdf").write_text("\n".join(lines) + "\n")
            Path(f"parts/p{k}.bdf").write_text(f'INCLUDE "q{k}\n  .bdf"\n')
            main += ["INCLUDE 'parts/", f"  p{k}.bdf'"]
    Path("a.bdf").write_text("\n".join([*main, "ENDDATA"]) + "\n")


def content(mesh: Mesh) -> list:
    """All that counts, as arrays."""
    assert mesh.links is not None and mesh.lumps is not None and mesh.state is not None
    links = [[v for v in astuple(item)[1:] if v is not None] for item in mesh.links.items]
    return [
        mesh.points, *mesh.cells.values(), mesh.node_id, mesh.supports,
        {n: s.tolist() for n, s in mesh.point_sets.items()},
        links, mesh.links.references, *astuple(mesh.lumps), [astuple(load)[1:] for load in mesh.state.loads],
        [astuple(m)[:3] for m in mesh.materials],
    ]  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
def test_a_model_is_the_same_in_every_spelling(seed):
    rng = np.random.default_rng(seed)
    Path("plain.bdf").write_text("\n".join([*HEAD, *map(free, model()), "ENDDATA"]) + "\n")
    wanted = content(read_mesh("plain.bdf", "m", "m-kg-s"))
    for _ in range(5):
        spelled(rng)
        found = content(read_mesh("a.bdf", "m", "m-kg-s"))
        for a, b in zip(found, wanted, strict=True):
            np.testing.assert_equal(a, b)


def free(card: Card) -> str:
    rows = [card[1:][i : i + 8] for i in range(0, len(card) - 1, 8)]
    return f"{card[0]}," + "\n,".join(",".join(row) for row in rows)


def plain(*cards: str, main: str = "a.bdf") -> Mesh:
    """A brick of nodes 1 to 8 and further lines."""
    mesh = meshes.brick("hexahedron", (1, 1, 1))
    lines = [f"GRID,{n},,{','.join(map(repr, x))}" for n, x in enumerate(mesh.points.tolist(), 1)]
    order = ",".join(str(n + 1) for n in mesh.cells["hexahedron"][0])
    lines.append(f"CHEXA,1,1,{order[:11]},\n,{order[12:]}")
    Path(main).write_text("\n".join(["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", *lines, *cards, "ENDDATA"]) + "\n")
    return read_mesh(main, "m")


@pytest.mark.parametrize(
    ("copies", "wanted"),
    [
        (["SPC1,1,123,1", "=,=,=,*(1)", "=(3)"], [1, 2, 3, 4, 5]),
        (["SPC1    1       123     1", "=       =       =       *2", "=2"], [1, 3, 5, 7]),
        (["SPC1,1,123,1,2,3,4,5,6", ",7", "=,=,=,*1,=="], [1, 2, 3, 4, 5, 6, 7]),
        (["SPC,1,1,123,,2,123", "=,=,*2,==", "=1"], [1, 2, 3, 5]),
    ],
)
def test_cards_that_copy_the_one_before(copies, wanted):
    """=, ==, *(x) and =(n), in free and in fixed fields."""
    read = plain(*copies)
    held = np.unique(np.concatenate([read.point_sets[name] for name in read.supports]))
    assert read.node_id[held].tolist() == wanted


def test_a_first_field_before_the_comma_and_constraints_of_nothing():
    """`NAME 1, 2` as some write it; an RBE2 between grid points of no solid is left out."""
    cards = ["SPC1  1,  123, 1", "GRID,21,,9.,9.,9.", "GRID,22,,9.,9.,8.", "RBE2,31,21,123,22"]
    read = plain(*cards)
    assert read.node_id[read.point_sets["SPC 1"]].tolist() == [1] and read.links is None
    assert any("RBE2 31: it and 0 other constraints join nothing" in text for text in read.remarks)


def test_real_fields_are_copied_with_increments():
    read = plain("GRID,21,,1.-1,5.,0.", "=,*(1),=,*(.25),==", "=(2)", "RBE2,31,21,123456,1,2", "=,*1,*1,==", "=2")
    at = [read.links.references[i].tolist() for i in np.argsort(read.links.reference_id)]
    np.testing.assert_allclose(at, [[0.1 + 0.25 * k, 5, 0] for k in range(4)], rtol=1e-12)


def test_marks_join_lines_that_lie_apart():
    first = "SPC1    1       123     1       2       3       4       5       6       +ABC"
    read = plain(first, "SET1,9,1", "+ABC    7       8")
    assert len(read.point_sets["SPC 1"]) == 8 and len(read.point_sets["SET 9"]) == 1


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["INCLUDE 'gone.bdf'"], ("a.bdf, line 15: INCLUDE names gone.bdf",)),
        (["INCLUDE 'a.bdf'"], ("line 15", "includes itself")),
        (["INCLUDE 'parts/one.bdf'"], ("two.bdf, line 1", "includes itself")),
        (["INCLUDE 'parts/bad.bdf'"], ("bad.bdf, line 2: SPC1 7", "the number of a point")),
        (["INCLUDE 'never ends"], ("line 15", "closing quote")),
        (["=,*1"], ("line 15: CHEXA 2",)),
        (["ASET1,123,1", "=,*(x)"], ("line 16", "no number")),
        (["ASET1,123,1", "=(4)"], ("line 16", "copies a card")),
        (["ASET1,123,1", "=,=,*1", "=(99999999)"], ("line 17", "copies")),
        (["+ABC,3", "ASET1,123,1,2,3,4,5,6,7,+ABC"], ("line 15", "the mark +ABC")),
    ],
)
def test_what_is_wrong_with_lines_is_refused_with_its_file_and_line(capsys, lines, words):
    Path("parts").mkdir()
    Path("parts/one.bdf").write_text("INCLUDE 'two.bdf'\n")
    Path("parts/two.bdf").write_text("INCLUDE 'one.bdf'\n")
    Path("parts/bad.bdf").write_text("$ a comment\nSPC1,7,123,5x\n")
    with pytest.raises(UserError):
        plain(*lines)
    refused_command(["import", "a.bdf", "body", "--unit", "m"], capsys, *words)
    assert not Path("body").exists()


def test_an_included_file_counts_for_what_is_up_to_date():
    Path("more.bdf").write_text("INCLUDE 'deep.bdf'\n")
    Path("deep.bdf").write_text("SPC1,7,123,5\n")
    plain("INCLUDE 'more.bdf'")
    assert [file.name for file in included(Path("a.bdf"))] == ["a.bdf", "more.bdf", "deep.bdf"]


def test_superelements_that_are_left_out_are_told():
    read = plain("BEGIN SUPER=3", "GRID,1,,0.,0.,0.")
    assert "a.bdf, line 15: BEGIN SUPER=3: 1 parts" in read.lost[0]


def test_cards_that_say_the_same_twice_are_one_and_others_are_refused():
    first = plain().points[0]
    again = f"GRID,1,,{','.join(f'{v:.3E}' for v in first)}"
    assert plain(again).n_points == 8
    read = plain("CORD2R,4,,0.,0.,0.,0.,0.,1.", ",1.,0.,0.", "CORD2R,4,,0.0,0.,0.,0.,0.,1.", ",1.,0.,0.")
    assert read.n_points == 8

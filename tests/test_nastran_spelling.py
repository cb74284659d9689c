"""One model in every spelling of Nastran's bulk data: small, wide and free fields, continuations, copies, includes."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path

import meshes
import numpy as np
import pytest
from test_bdf import CARD, ORDER

from microslip.data import Mesh
from microslip.mesh import read_mesh

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
            lines.append(
                f"{first},{','.join(row)},{mark}" if mark or not last else f"{first},{','.join(row)}".rstrip(",")
            )
        else:
            begin = f"{name}*" if number == 0 else f"*{mark_of(first)}"
            halves = [row[:4]] if last and not any(row[4:]) and rng.random() < 0.7 else [row[:4], row[4:]]
            for k, half in enumerate(halves):
                head, tail = (begin if k == 0 else "*"), mark if k == len(halves) - 1 else ""
                if style == "wide":
                    lines.append(f"{head:8}{''.join(f'{w:16}' for w in half)}{tail:8}")
                else:
                    lines.append(
                        f"{head},{','.join(half)},{tail}".rstrip(",")
                        if tail == ""
                        else f"{head},{','.join(half)},{tail}"
                    )
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
        lines.insert(int(rng.integers(len(lines))) if rng.random() < 0.0 else 0, "$ a comment, with a comma")
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
    Path("plain.bdf").write_text(
        "\n".join([*HEAD, *(",".join(c) if len(c) < 10 else free(c) for c in model()), "ENDDATA"]) + "\n"
    )
    wanted = content(read_mesh("plain.bdf", "m", "m-kg-s"))
    for _ in range(5):
        spelled(rng)
        found = content(read_mesh("a.bdf", "m", "m-kg-s"))
        for a, b in zip(found, wanted, strict=True):
            np.testing.assert_equal(a, b)


def free(card: Card) -> str:
    rows = [card[1:][i : i + 8] for i in range(0, len(card) - 1, 8)]
    return f"{card[0]}," + "\n,".join(",".join(row) for row in rows)

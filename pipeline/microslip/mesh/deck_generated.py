"""Nodes and cells that an Abaqus deck generates: *NGEN, *NFILL, *NCOPY, *ELGEN, *ELCOPY."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Array, Indices
from ..frames import rotation
from .cards import Card, numbers
from .deck import Cells, Deck, Readers
from .instances import placement
from .raw import Damaged, is_number, real

_REFLECTED = {
    "hexahedron": (4, 5, 6, 7, 0, 1, 2, 3),
    "hexahedron20": (4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10, 11, 16, 17, 18, 19),
}
"""Nodes of a brick in a mirror, counted so that it is not inside out; tetrahedra and wedges are turned later."""


def _places(deck: Deck) -> dict[int, Array]:
    """Node number -> (3,) place of all nodes so far."""
    return {
        int(n): x
        for ids, points in zip(deck.node_id, deck.points, strict=True)
        for n, x in zip(ids.tolist(), points, strict=True)
    }


def _add_nodes(deck: Deck, card: Card, ids: Indices, points: Array, name: str) -> None:
    deck.node_id.append(ids)
    deck.points.append(points)
    deck.node_where.append(card.place)
    if name:
        deck.add(deck.node_sets, name).append(ids)


def _of(places: dict[int, Array], number: int, what: str) -> Array:
    if number not in places:
        raise Damaged(f"{what} names the node {number}, which is not defined before it")
    return places[number]


def _whole(word: str, what: str, otherwise: int = 0) -> int:
    if not word:
        return otherwise
    if not is_number(word.lstrip("-")):
        raise Damaged(f"{what} holds '{word[:20]}' where a whole number belongs")
    return int(word)


def _read_ngen(deck: Deck, card: Card) -> None:
    """Nodes between two, on a line, a parabola through an extra node or an arc about one."""
    kind, more = card.word("LINE", "L"), deck.spaces[""].nodes
    for line in card.lines:
        words = [*(word.strip() for word in line.split(",")), *10 * [""]]
        first, last, step = (_whole(w, "*NGEN", 1) for w in words[:3])
        count, places = (last - first) // step if step else 0, _places(deck)
        if count < 1 or (last - first) % step:
            raise Damaged(f"*NGEN from {first} to {last} in steps of {step} gives no nodes between")
        a, b = (_of(places, n + more, "*NGEN") for n in (first, last))
        share = np.arange(count + 1)[:, None] / count
        points = a + share * (b - a)
        if kind in "CP":
            at = [real(w or "0", "*NGEN") for w in words[4:7]]
            extra = (
                _of(places, _whole(words[3], "*NGEN") + more, "*NGEN") if words[3] else np.array(at)
            )
            normal = np.array([real(w or "0", "*NGEN") for w in words[7:10]])
            parabola = 2 * (share - 0.5) * (share - 1) * a + 4 * share * (1 - share) * extra
            points = (
                parabola + 2 * share * (share - 0.5) * b
                if kind == "P"
                else _arc(a, b, extra, normal, count)
            )
        ids = first + step * np.arange(count + 1) + more
        _add_nodes(deck, card, ids[1:-1], points[1:-1], "")
        if name := card.text("NSET"):
            deck.add(deck.node_sets, name).append(ids)


def _arc(a: Array, b: Array, centre: Array, normal: Array, count: int) -> Array:
    """(count + 1, 3) points from a to b about a centre: the shorter way, or that about a normal."""
    x, y = a - centre, b - centre
    n = normal if normal.any() else np.cross(x, y)
    if not np.linalg.norm(n) > 1e-9 * np.linalg.norm(x) * np.linalg.norm(y):
        raise Damaged(
            "*NGEN, LINE=C has ends on a line with their centre; give the normal of the arc"
        )
    n = n / np.linalg.norm(n)
    angle = np.arctan2(n @ np.cross(x, y), x @ y) % (2 * np.pi)
    radius = np.linalg.norm(x) + np.arange(count + 1) / count * (
        np.linalg.norm(y) - np.linalg.norm(x)
    )
    turned = [rotation(n, angle * k / count) @ x / np.linalg.norm(x) for k in range(count + 1)]
    return centre + radius[:, None] * np.array(turned)


def _read_nfill(deck: Deck, card: Card) -> None:
    """Nodes between those of two sets, in the order of their numbers."""
    if "SINGULAR" in card.parameters or "TWO STEP" in card.parameters:
        raise Damaged("*NFILL with SINGULAR or TWO STEP is not read; write out every node")
    bias = real(card.text("BIAS") or "1", "*NFILL, BIAS")
    for line in card.lines:
        words = [word.strip() for word in line.split(",")]
        if len(words) < 4 or not bias > 0:
            raise Damaged(
                "*NFILL needs two sets, the number of intervals and the increment of numbers a line"
            )
        ends = [np.unique(deck.nodes_for("*NFILL", word)) for word in words[:2]]
        intervals, step = (_whole(w, "*NFILL") for w in words[2:4])
        if len(ends[0]) != len(ends[1]) or intervals < 1:
            raise Damaged(
                f"*NFILL fills between sets of {len(ends[0])} and {len(ends[1])} nodes; they need equally many"
            )
        places = _places(deck)
        x, y = (np.array([_of(places, int(n), "*NFILL") for n in end]) for end in ends)
        lengths = bias ** -np.arange(intervals, dtype=float)
        share = np.cumsum(lengths)[:-1] / lengths.sum()
        for k, s in enumerate(share, 1):
            _add_nodes(deck, card, ends[0] + k * step, x + s * (y - x), card.text("NSET"))
        if name := card.text("NSET"):
            deck.add(deck.node_sets, name).extend(ends)


def _read_ncopy(deck: Deck, card: Card) -> None:
    """Nodes of a set, shifted and turned, or in a mirror."""
    old, places = deck.nodes_for("*NCOPY", card.text("OLD SET")), _places(deck)
    step = _whole(card.text("CHANGE NUMBER"), "*NCOPY, CHANGE NUMBER")
    x = np.array([_of(places, int(n), "*NCOPY") for n in old]).reshape(-1, 3)
    rows, mirror = numbers(card.lines, "*NCOPY"), card.word("REFLECT")
    for k in range(1, _whole(card.text("MULTIPLE"), "*NCOPY, MULTIPLE", 1) + 1):
        if "SHIFT" in card.parameters:
            at = placement(rows)
            x = x @ at.turn.T + at.shift
        elif mirror in ("POINT", "LINE", "MIRROR"):
            x = _mirrored(x, mirror, [v for row in rows for v in row])
        else:
            raise Damaged("*NCOPY is read with SHIFT or REFLECT=POINT, LINE or MIRROR")
        _add_nodes(deck, card, old + k * step, x, card.text("NEW SET"))


def _mirrored(x: Array, kind: str, values: list[float]) -> Array:
    count = {"POINT": 3, "LINE": 6, "MIRROR": 9}[kind]
    if len(values) < count:
        raise Damaged(f"*NCOPY, REFLECT={kind} needs {count} coordinates")
    a, *others = np.array(values[:count]).reshape(-1, 3)
    r = x - a
    if kind == "POINT":
        return a - r
    along = np.cross(*(p - a for p in others)) if kind == "MIRROR" else others[0] - a
    if not np.linalg.norm(along) > 0:
        raise Damaged(
            f"*NCOPY, REFLECT={kind} has points that give no {'plane' if kind == 'MIRROR' else 'line'}"
        )
    e = along / np.linalg.norm(along)
    part = np.outer(r @ e, e)
    return a + (r - 2 * part if kind == "MIRROR" else 2 * part - r)


def _read_elgen(deck: Deck, card: Card) -> None:
    """Rows, layers and blocks of cells like one."""
    more = deck.spaces[""].cells
    for line in card.lines:
        words = [*(word.strip() for word in line.split(",")), *10 * [""]]
        master = _whole(words[0], "*ELGEN") + more
        parts: list[Indices] = []
        for cells in _with(deck, np.array([master])):
            ids, nodes = cells.ids, cells.nodes
            for k in range(1, 10, 3):
                count, by, step = (_whole(w, "*ELGEN", 1) for w in words[k : k + 3])
                number = np.arange(count)
                ids = (ids[None] + step * number[:, None]).ravel()
                nodes = (nodes[None] + by * number[:, None, None]).reshape(len(ids), -1)
            parts.append(ids)
            _add_cells(deck, card, cells, ids[1:], nodes[1:])
        if name := card.text("ELSET"):
            deck.add(deck.cell_sets, name).extend(parts)


def _read_elcopy(deck: Deck, card: Card) -> None:
    """Cells of a set with shifted numbers; REFLECT counts nodes of bricks as in a mirror."""
    old = deck.cells_for("*ELCOPY", card.text("OLD SET"))
    step, by = (
        _whole(card.text(key), f"*ELCOPY, {key}") for key in ("ELEMENT SHIFT", "SHIFT NODES")
    )
    for cells in _with(deck, old):
        order = _REFLECTED.get(cells.kind) if "REFLECT" in card.parameters else None
        nodes = cells.nodes if order is None else cells.nodes[:, order]
        _add_cells(deck, card, cells, cells.ids + step, nodes + by)
        if name := card.text("NEW SET"):
            deck.add(deck.cell_sets, name).append(cells.ids + step)


def _with(deck: Deck, ids: Indices) -> list[Cells]:
    """Those solids and facets that have these numbers."""
    found = []
    for cells in (*deck.solids, *deck.facets, *deck.lumped):
        if (chosen := np.isin(cells.ids, ids)).any():
            found.append(replace(cells, ids=cells.ids[chosen], nodes=cells.nodes[chosen]))
    if not found and not deck.structures:
        raise Damaged(f"element {ids[0] if len(ids) else ''} is not defined before it is copied")
    return found


def _add_cells(deck: Deck, card: Card, like: Cells, ids: Indices, nodes: Indices) -> None:
    made = replace(like, ids=ids, nodes=nodes, where=card.place)
    into = deck.solids if any(like.kind == c.kind for c in deck.solids) else deck.facets
    (deck.lumped if any(like.kind == c.kind for c in deck.lumped) else into).append(made)


READERS: Readers = {
    "NGEN": _read_ngen,
    "NFILL": _read_nfill,
    "NCOPY": _read_ncopy,
    "ELGEN": _read_elgen,
    "ELCOPY": _read_elcopy,
}

"""Of an Abaqus or CalculiX input file: point masses, rotary inertias, springs and dashpots."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..data import Array, LumpedElement, PointMass
from ..errors import of_file
from .cards import Card, numbers
from .deck import Cells, Deck
from .raw import Damaged, Numbering

NODES = {
    "MASS": 1, "ROTARYI": 1, "SPRING1": 1, "DASHPOT1": 1, "SPRING2": 2, "DASHPOT2": 2, "SPRINGA": 2, "DASHPOTA": 2,
}  # fmt: skip
"""Type of element -> number of its nodes."""
KEYWORDS = ("MASS", "ROTARY INERTIA", "SPRING", "DASHPOT")


def lumps_of(deck: Deck, numbering: Numbering, points: Array) -> Iterator[PointMass | LumpedElement]:
    """The lumped elements of a deck, nodes by their positions in the file.

    Raises:
        Damaged: with the line, what is wrong with one; elements without their property.
    """
    left = {(cells.kind, int(n)) for cells in deck.lumped for n in cells.ids}
    for card in deck.links:
        if card.keyword not in KEYWORDS:
            continue
        if card.keyword == "DASHPOT" and len(card.lines) > 2:
            text = "the value of a *DASHPOT over frequency is not read: it is left out, undamped frequencies stay"
            deck.lost.append(f"{card.where}: {text}")
        with of_file(card.place):
            chosen = deck.cells_for(f"*{card.keyword}", card.text("ELSET"), card.space)
            for cells in deck.lumped:
                if not _MAKERS[cells.kind][0] == card.keyword or not (mine := np.isin(cells.ids, chosen)).any():
                    continue
                left -= {(cells.kind, int(n)) for n in cells.ids[mine]}
                reading = _Reading(deck, card, cells.kind, points)
                at = numbering.positions(cells.nodes[mine], f"*ELEMENT, TYPE={cells.kind} names")
                for number, nodes in zip(cells.ids[mine].tolist(), at, strict=True):
                    made = _MAKERS[cells.kind][1](reading, nodes)
                    if isinstance(made, PointMass) and made.mass:
                        deck.masses[number] = made.node, made.mass
                    yield made
    if left:
        kind, number = sorted(left)[0]
        place = next(c.where for c in deck.lumped if c.kind == kind and number in c.ids)
        raise Damaged(f"element {number} ({kind}) has no *{_MAKERS[kind][0]}; give its set one", file=place)


@dataclass(frozen=True)
class _Reading:
    deck: Deck
    card: Card
    kind: str
    points: Array

    @property
    def where(self) -> str:
        return f"{self.card.where}: *{self.card.keyword}"

    def rows(self) -> list[list[float]]:
        """Data lines with a number.

        Raises:
            Damaged: forms that are not read.
        """
        card = self.card
        for key in ("NONLINEAR", "COMPLEX STIFFNESS", "DEPENDENCIES", "RTOL", "USER"):
            if key in card.parameters:
                raise Damaged(f"*{card.keyword} with {key} is not read; give one linear value in its place")
        if card.word("TYPE", "ISOTROPIC") != "ISOTROPIC":
            raise Damaged(f"*{card.keyword}, TYPE={card.text('TYPE')} is not read; give one mass for all directions")
        return numbers([line for line in card.lines if line.strip(", ")], f"*{card.keyword}")

    def axes(self) -> Array:
        """(3, 3) rows are the directions of its ORIENTATION.

        Raises:
            Damaged: one that is not defined or depends on the place.
        """
        if not (word := self.card.text("ORIENTATION")):
            return np.eye(3)
        key = self.deck.key(self.deck.orientations, word, self.card.space)
        axes = None if key is None else self.deck.orientations[key]
        if axes is None or isinstance(axes, str):
            raise Damaged(f"*{self.card.keyword} names the ORIENTATION '{word}', which is not defined or not constant")
        return axes

    def value(self) -> tuple[list[int], float]:
        """Directions, from 0, and the value of a spring or dashpot."""
        rows = self.rows()
        along = self.kind.endswith("A")
        ways = [] if along else [int(w) for w in (rows[0] if rows else [])]
        rows = rows if along else rows[1:]
        if self.kind.endswith("2") and len(ways) == 1:
            ways = 2 * ways
        if not along and (len(ways) != NODES[self.kind] or not all(1 <= w <= 6 for w in ways)):
            raise Damaged(f"*{self.card.keyword} needs a line with a direction (1 to 6) of each node of {self.kind}")
        if not rows or (len(rows) > 1 and self.card.keyword == "SPRING"):
            raise Damaged(
                f"*{self.card.keyword} has {len(rows)} lines of values; give one, that at the temperature of the model"
            )
        if not np.isfinite(rows[0][0]) or rows[0][0] < 0:
            raise Damaged(f"*{self.card.keyword} has the value {rows[0][0]:g}; give one that is not negative")
        return [w - 1 for w in ways], rows[0][0]


def _mass(reading: _Reading, nodes: Array) -> PointMass:
    rows = reading.rows()
    if len(rows) != 1 or not 0 <= rows[0][0] < np.inf:
        raise Damaged("*MASS needs one line with a mass that is not negative")
    return PointMass(reading.where, int(nodes[0]), rows[0][0])


def _inertia(reading: _Reading, nodes: Array) -> PointMass:
    rows = reading.rows()
    if len(rows) != 1:
        raise Damaged("*ROTARY INERTIA needs one line: I11, I22, I33, I12, I13, I23")
    a, b, c, ab, ac, bc = [*rows[0], *6 * [0.0]][:6]
    Q, J = reading.axes(), np.array([[a, ab, ac], [ab, b, bc], [ac, bc, c]])
    if not np.isfinite(J).all() or np.linalg.eigvalsh(J)[0] < -1e-9 * np.abs(J).max():
        raise Damaged("*ROTARY INERTIA is no inertia: it is negative about some axis; correct it")
    return PointMass(reading.where, int(nodes[0]), 0.0, inertia=Q.T @ J @ Q)


def _element(reading: _Reading, nodes: Array) -> LumpedElement:
    ways, value = reading.value()
    if len(reading.card.lines) > 2 and reading.kind.startswith("DASHPOT"):
        value = 0.0  # over frequency, which is told
    damps, line = reading.kind.startswith("DASHPOT"), reading.kind.endswith("A")
    if line:
        along = reading.points[nodes[1]] - reading.points[nodes[0]]
        if not along.any():
            kind = reading.kind
            raise Damaged(f"a {kind} joins two nodes at one place, so it has no direction; use {kind[:-1]}2")
        axes = [along / np.linalg.norm(along)] * 2
        turns = [0, 0]
    else:
        Q = reading.axes()
        axes, turns = [Q[w % 3] for w in ways], [3 * (w // 3) for w in ways]
    row = elongation(axes, (1.0, -1.0)[: len(nodes)])
    A = value * np.outer(row, row)
    at = np.concatenate([turn + np.arange(3) for turn in turns])
    zero, pulls = np.zeros_like(A), value if line and not damps else 0.0
    return LumpedElement(
        reading.where, np.repeat(nodes, 3), at, zero if damps else A, A if damps else zero, pulls
    )


def elongation(axes: list[Array], signs: tuple[float, ...]) -> Array:
    """(3 t,) elongation of a spring by the displacements of its t nodes."""
    return np.concatenate([sign * axis for axis, sign in zip(axes, signs, strict=True)])


_MAKERS: dict[str, tuple[str, Callable[[_Reading, Array], PointMass | LumpedElement]]] = {
    "MASS": ("MASS", _mass), "ROTARYI": ("ROTARY INERTIA", _inertia),
    **{kind: ("SPRING", _element) for kind in NODES if kind.startswith("SPRING")},
    **{kind: ("DASHPOT", _element) for kind in NODES if kind.startswith("DASHPOT")},
}  # fmt: skip


def read_cells(deck: Deck, card: Card, kind: str, rows: list[list[float]]) -> None:
    """Elements of a lumped type.

    Raises:
        Damaged: another number of nodes.
    """
    count, own = NODES[kind], deck.spaces[""]
    table = [[int(v) for v in row] for row in rows]
    if any(len(row) != count + 1 or min(row) < 1 or max(row) > 10**15 for row in table):
        raise Damaged(f"*ELEMENT, TYPE={kind} needs a number and {count} node{'s' * (count > 1)} a line")
    ids, nodes = np.array(table)[:, 0] + own.cells, np.array(table)[:, 1:] + own.nodes
    deck.lumped.append(Cells(kind, ids, nodes, kind, card.place))
    if "ELSET" in card.parameters:
        deck.add(deck.cell_sets, card.parameters["ELSET"]).append(ids)

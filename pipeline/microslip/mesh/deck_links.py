"""Constraints of an Abaqus or CalculiX deck: ties, equations, multi-point constraints, couplings, rigid bodies."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..data import Array, AverageLink, Equation, FaceTie, Indices, Link, RigidLink
from ..errors import of_file
from .cards import Card, fields
from .deck import Deck
from .raw import Damaged, Numbering, is_number, joined, lost, real

_WAYS = "xyzabc"


@dataclass
class _Reading:
    """A card of a deck whose nodes are known.

    Attributes:
        points: of all nodes. following: the next card of a constraint. left_out: what is not read, in words.
    """

    deck: Deck
    numbering: Numbering
    points: Array
    card: Card = field(default_factory=lambda: Card(""))
    following: Card | None = None
    left_out: list[str] = field(default_factory=list)

    @cached_property
    def numbers(self) -> Indices:
        """(n,) numbers of all nodes by position."""
        found = np.empty(len(self.points), dtype=np.int64)
        found[self.numbering.order] = self.numbering.sorted
        return found

    @property
    def where(self) -> str:
        name = self.card.text("NAME") or self.card.text("CONSTRAINT NAME")
        return f"{self.card.where}: *{self.card.keyword}" + (f" '{name}'" if name else "")

    def nodes(self, word: str) -> Indices:
        """Positions of the nodes that a word names.

        Raises:
            Damaged: there is no such set.
        """
        numbers = self.deck.nodes_for(f"*{self.card.keyword}", word, self.card.space)
        return self.numbering.positions(np.unique(numbers), f"*{self.card.keyword} names")

    def node(self, key: str) -> int:
        """The position of the single node that a parameter names.

        Raises:
            Damaged: none or several.
        """
        if not (word := self.card.text(key)):
            raise Damaged(f"*{self.card.keyword} names no reference node; give REF NODE")
        nodes = self.nodes(word)
        if len(nodes) != 1:
            raise Damaged(
                f"*{self.card.keyword} names '{word}' as one node, but it has {len(nodes)}"
            )
        return int(nodes[0])

    def surface(self, word: str) -> str:
        """The name of a surface in the whole.

        Raises:
            Damaged: there is none.
        """
        if (name := self.deck.surface(word, self.card.space)) is None:
            raise Damaged(f"*{self.card.keyword} names the surface '{word}', which is not defined")
        return name


def links_of(deck: Deck, numbering: Numbering, points: Array) -> tuple[list[Link], list[str]]:
    """The constraints of a deck, nodes by their positions in the file, and what is not read, in words.

    Raises:
        Damaged: with the line, what is wrong with one.
    """
    reading, links = _Reading(deck, numbering, points), list[Link]()
    cards = [card for card in deck.links if card.keyword in _MAKERS]
    for reading.card, reading.following in zip(cards, [*cards[1:], None], strict=False):
        with of_file(reading.card.place):
            links += _MAKERS[reading.card.keyword](reading)
    return links, reading.left_out


def _tie(reading: _Reading) -> Iterator[Link]:
    card = reading.card
    if "CYCLIC SYMMETRY" in card.parameters:
        return  # see deck_joints
    text = card.text("POSITION TOLERANCE")
    tolerance = real(text, "POSITION TOLERANCE") if text else None
    for line in card.lines:
        words = [word.strip() for word in line.split(",")]
        if len(words) < 2 or not words[1]:
            raise Damaged(
                f"*TIE needs the slave and the master surface in a line, not '{line[:60]}'"
            )
        slave, master = map(reading.surface, words[:2])
        yield FaceTie(reading.where, slave, master, tolerance)


def _equations(reading: _Reading) -> Iterator[Link]:
    words = [
        word.strip() for line in reading.card.lines for word in line.rstrip().rstrip(",").split(",")
    ]
    while words:
        if not is_number(words[0]) or int(words[0]) < 1:
            raise Damaged(f"*EQUATION begins with '{words[0][:40]}', which is no number of terms")
        count = int(words[0])
        terms, words = words[1 : 1 + 3 * count], words[1 + 3 * count :]
        if len(terms) < 3 * count:
            raise Damaged(
                f"*EQUATION announces {count} terms of three words and has {len(terms)} words"
            )
        ways = [_direction(word) for word in terms[1::3]]
        factors = np.array([real(word, "a factor of *EQUATION") for word in terms[2::3]])
        members = [reading.nodes(word) for word in terms[::3]]
        length = max(map(len, members))
        if any(len(m) not in (1, length) for m in members):
            raise Damaged(
                f"*EQUATION names sets of {', '.join(str(len(m)) for m in members)} nodes, not equally many"
            )
        for nodes in np.column_stack([np.broadcast_to(m, length) for m in members]):
            yield _in_body_axes(reading, nodes, np.array(ways), factors)


def _in_body_axes(reading: _Reading, nodes: Indices, ways: Indices, factors: Array) -> Equation:
    """An equation whose terms at turned nodes are those of their local directions."""
    axes = [reading.deck.axes.get(int(reading.numbers[node])) for node in nodes]
    if all(a is None or way > 2 for a, way in zip(axes, ways, strict=True)):
        return Equation(reading.where, nodes, ways, factors)
    terms: list[tuple[int, int, float]] = []
    for a, node, way, factor in zip(axes, nodes.tolist(), ways.tolist(), factors.tolist(), strict=True):
        if a is None or way > 2:
            terms.append((node, way, factor))
        else:
            terms += [(node, j, factor * a[way][j]) for j in range(3)]
    at, along, by = map(np.array, zip(*terms, strict=True))
    return Equation(reading.where, at, along, by, first=False)


def _direction(word: str) -> int:
    if word not in {"1", "2", "3", "4", "5", "6"}:
        raise Damaged(f"'{word[:20]}' is no degree of freedom of a node (1 to 6)")
    return int(word) - 1


def _mpc(reading: _Reading) -> Iterator[Link]:
    for line in reading.card.lines:
        kind, *words = [*fields(line), ""]
        words = [word for word in words if word]
        if kind.upper() not in ("PIN", "TIE", "BEAM", "LINK"):
            raise Damaged(f"*MPC of the kind '{kind}' is not read; PIN, TIE, BEAM and LINK are")
        if len(words) < 2:
            raise Damaged(f"*MPC {kind} names fewer than two nodes")
        members, other = reading.nodes(words[0]), reading.nodes(words[1])
        if len(other) not in (1, len(members)):
            raise Damaged(
                f"*MPC {kind} names {len(members)} and {len(other)} nodes; give one to each, or one to all"
            )
        for a, b in zip(members, np.broadcast_to(other, len(members)), strict=True):
            along = reading.points[a] - reading.points[b]
            yield from _pair(
                kind.upper(), f"{reading.card.where}: *MPC {kind.upper()}", int(a), int(b), along
            )


def _pair(kind: str, where: str, a: int, b: int, along: Array) -> Iterator[Link]:
    if kind == "BEAM":
        yield RigidLink(where, b, np.array([a]), _WAYS)
    elif kind == "LINK":
        if not along.any():
            raise Damaged("*MPC LINK between two nodes at one place has no direction; use PIN")
        factors = np.concatenate([along, -along]) / np.linalg.norm(along)
        yield Equation(where, np.repeat([a, b], 3), np.tile(np.arange(3), 2), factors, first=False)
    else:
        for way in range(3):
            yield Equation(where, np.array([a, b]), np.array([way, way]), np.array([1.0, -1.0]))


def _old_coupling(reading: _Reading) -> Iterator[Link]:
    """*KINEMATIC COUPLING: nodes, first and last direction a line."""
    reference = reading.node("REF NODE")
    for line in reading.card.lines:
        words = [word.strip() for word in line.split(",")]
        every = _ways([words[1:]])
        _refuse_turned(reading, every)
        yield RigidLink(reading.where, reference, reading.nodes(words[0]), every)
    if not reading.card.lines:
        raise Damaged("*KINEMATIC COUPLING couples no nodes to its reference node; add them")


def _not_read(reading: _Reading) -> Iterator[Link]:
    reading.left_out.append(
        lost(reading.card.where, "*DISTRIBUTING COUPLING (write *COUPLING with *DISTRIBUTING)")
    )
    return iter(())


def _ways(lines: list[list[str]]) -> str:
    """Directions x, y, z and rotations a, b, c of lines (first, last); all without any."""
    found: set[str] = set()
    for words in lines:
        given = [word for word in words if word]
        if given:
            first = _direction(given[0])
            found |= set(_WAYS[first : _direction(given[-1]) + 1])
    return "".join(w for w in _WAYS if w in found) or _WAYS


def _refuse_turned(reading: _Reading, every: str) -> None:
    if reading.deck.axes and every not in ("xyz", "xyzabc", "abc"):
        raise Damaged(
            "a coupling in single directions beside a *TRANSFORM may mean local ones; write global ones"
        )


def _coupling(reading: _Reading) -> Iterator[Link]:
    card, following = reading.card, reading.following
    if following is None or following.keyword not in ("KINEMATIC", "DISTRIBUTING"):
        raise Damaged(
            "*COUPLING is followed by neither *KINEMATIC nor *DISTRIBUTING; say which it is"
        )
    if "INFLUENCE RADIUS" in card.parameters:
        raise Damaged(
            "*COUPLING with INFLUENCE RADIUS is not read; name a surface of the nodes that it takes in"
        )
    reference = reading.node("REF NODE")
    members, weights = _weighed(reading, reading.surface(card.text("SURFACE")))
    every = _ways([[word.strip() for word in line.split(",")] for line in following.lines])
    if "ORIENTATION" in card.parameters and len(every) < 6:
        raise Damaged(
            "*COUPLING in single directions of an ORIENTATION is not read; write *EQUATIONs"
        )
    _refuse_turned(reading, every)
    if following.keyword == "KINEMATIC":
        yield RigidLink(reading.where, reference, members, every)
        return
    if following.word("WEIGHTING METHOD", "UNIFORM") != "UNIFORM":
        raise Damaged("*DISTRIBUTING is read with WEIGHTING METHOD=UNIFORM alone")
    yield AverageLink(reading.where, reference, members, weights, every)


def _weighed(reading: _Reading, surface: str) -> tuple[Indices | str, Array | None]:
    """By the areas of a surface of facets, by the numbers that a surface of nodes has beside them (1 if none)."""
    found = next(s for s in reading.deck.surfaces if s.name == surface)
    if found.kind != "NODE":
        return surface, None
    weights: dict[int, float] = {}
    for name, weight in ([*row, ""][:2] for row in found.rows):
        number = real(weight, f"a weight of the surface '{surface}'") if weight else 1.0
        weights.update(dict.fromkeys(reading.nodes(name).tolist(), number))
    return np.array(list(weights), dtype=np.int64), np.array(list(weights.values()))


def _nothing(reading: _Reading) -> Iterator[Link]:
    return iter(())  # told with its *COUPLING


def _rigid_body(reading: _Reading) -> Iterator[Link]:
    card, deck = reading.card, reading.deck
    sets = [card.text(k) for k in ("NSET", "PIN NSET", "TIE NSET") if k in card.parameters]
    members = [reading.nodes(word) for word in sets]
    if "ELSET" in card.parameters:
        chosen = deck.cells_for("*RIGID BODY", card.text("ELSET"), card.space)
        for cells in (*deck.solids, *deck.facets):
            members.append(np.unique(cells.nodes[np.isin(cells.ids, chosen)]))
    every = np.unique(joined(members))
    reference = reading.node("REF NODE")
    pinned = set() if "PIN NSET" not in card.parameters else {*reading.nodes(card.text("PIN NSET"))}
    tied = np.array(
        [node for node in every if node != reference and node not in pinned], dtype=np.int64
    )
    if len(tied) or not pinned:
        yield RigidLink(reading.where, reference, tied, _WAYS)
    if pinned:
        yield RigidLink(reading.where, reference, np.array(sorted(pinned), dtype=np.int64))
    if "ROT NODE" in card.parameters:
        turns = reading.node("ROT NODE")
        deck.turning[int(reading.numbers[turns])] = int(reading.numbers[reference])
        for way in range(3):
            pair, ways = np.array([turns, reference]), np.array([way, 3 + way])
            yield Equation(
                f"{reading.where}, ROT NODE", pair, ways, np.array([1.0, -1.0]), first=False
            )


_MAKERS: dict[str, Callable[[_Reading], Iterator[Link]]] = {
    "TIE": _tie, "EQUATION": _equations, "MPC": _mpc, "KINEMATIC COUPLING": _old_coupling,
    "DISTRIBUTING COUPLING": _not_read, "COUPLING": _coupling, "KINEMATIC": _nothing, "DISTRIBUTING": _nothing,
    "RIGID BODY": _rigid_body,
}  # fmt: skip
KEYWORDS = tuple(_MAKERS)

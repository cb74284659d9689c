"""Parts of a deck laid beside each other: instances moved and turned, with numbers and names of their own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from ..data import Array, Indices
from ..frames import rotation
from .cards import Card
from .deck import Cells, Deck, Space
from .raw import Damaged, joined

_MODEL = ("MATERIAL", "ELASTIC", "DENSITY", "EXPANSION")


@dataclass
class Outline:
    """Cards of a deck by where they stand: parts by name in capitals, instances, and the rest in its order."""

    parts: dict[str, list[Card]] = field(default_factory=dict)
    instances: list[tuple[Card, list[Card]]] = field(default_factory=list)
    rest: list[Card] = field(default_factory=list)


def outline(cards: list[Card]) -> Outline:
    """The cards of parts, of instances and of everything else; a deck without parts and instances is all rest.

    Raises:
        Damaged: two parts or instances of one name, an end without a beginning.
    """
    if not any(card.keyword in ("PART", "INSTANCE") for card in cards):
        return Outline(rest=cards)
    found, into = Outline(), None
    names: set[str] = set()
    opened: list[Card] = []
    for card in cards:
        name = card.parameters.get("NAME", "").upper()
        _nested(card, opened)
        if card.keyword == "PART":
            if name in found.parts:
                text = f"the *PART '{card.parameters['NAME']}' is there twice"
                raise Damaged(text, file=card.place)
            into = found.parts.setdefault(name, [])
        elif card.keyword == "INSTANCE":
            if not name:
                raise Damaged("an *INSTANCE has no NAME", file=card.place)
            if name in names:
                text = f"the *INSTANCE '{card.parameters['NAME']}' is there twice; rename one"
                raise Damaged(text, file=card.place)
            names.add(name)
            into = []
            found.instances.append((card, into))
        elif card.keyword in ("END PART", "END INSTANCE"):
            into = None
        elif into is None or card.keyword in _MODEL:
            found.rest.append(card)
        else:
            into.append(card)
    _nested(Card("STEP", where="the end"), opened)
    if not found.instances:
        return Outline(rest=cards)
    return found


_INSIDE = {"PART": "", "ASSEMBLY": "", "STEP": "", "INSTANCE": "ASSEMBLY"}


def _nested(card: Card, opened: list[Card]) -> None:
    """Keep what is open (part, assembly, instance) in mind.

    Raises:
        Damaged: something begins before another one has ended, or ends without a beginning.
    """
    begins, last = card.keyword in _INSIDE, opened[-1] if opened else None
    if card.keyword.startswith("END ") and card.keyword[4:] in _INSIDE and card.keyword != "END STEP":
        if last is None or last.keyword != card.keyword[4:]:
            told = f"; the *{last.keyword} of {last.where} has no *END {last.keyword}" if last else ""
            raise Damaged(f"*{card.keyword} without a beginning{told}", file=card.place)
        opened.pop()
    elif begins and last is not None and last.keyword != _INSIDE[card.keyword]:
        text = f"the *{last.keyword} has no *END {last.keyword} before {card.where}; add it"
        raise Damaged(text, file=last.place)
    elif begins and last is None and _INSIDE[card.keyword]:
        text = f"the *{card.keyword} stands outside of an *{_INSIDE[card.keyword]}"
        raise Damaged(text, file=card.place)
    elif begins and card.keyword != "STEP":
        opened.append(card)


@dataclass(frozen=True)
class Placement:
    """x -> turn @ x + shift; lengths in the file's unit."""

    turn: Array
    shift: Array


def placement(lines: list[list[float]]) -> Placement:
    """Of an instance by its data lines: a translation, then two points of an axis and an angle in degrees.

    Raises:
        Damaged: another number of values, an axis of no length.
    """
    if len(lines) > 2 or (lines and len(lines[0]) > 3) or (len(lines) == 2 and len(lines[1]) != 7):
        raise Damaged("*INSTANCE needs a line of three numbers, then perhaps one of two points and an angle")
    if not np.isfinite([value for line in lines for value in line]).all():
        raise Damaged("*INSTANCE holds a number that is not finite")
    shift = np.array([*lines[0], 0.0, 0.0, 0.0][:3]) if lines else np.zeros(3)
    if len(lines) < 2:
        return Placement(np.eye(3), shift)
    a, b, angle = np.array(lines[1][:3]), np.array(lines[1][3:6]), lines[1][6]
    if not np.linalg.norm(b - a) > 0:
        raise Damaged("the axis of an *INSTANCE has no length: its two points are the same")
    turn = rotation(b - a, np.radians(angle))
    return Placement(turn, turn @ (shift - a) + a)


def local_system(rows: list[list[float]]) -> Array | None:
    """(4, 3) axes x, y, z and origin of a *SYSTEM by its data lines; None: the global one again.

    Raises:
        Damaged: points on a line.
    """
    if not rows or (len(rows[0]) <= 3 and not any(rows[0])):
        return None
    first = [*rows[0], *[0.0] * 6][:6]
    origin, x = np.array(first[:3]), np.array(first[3:])
    if len(rows[0]) <= 3:
        return np.vstack([np.eye(3), origin])
    x = x - origin
    y = np.array([*rows[1], 0.0, 0.0, 0.0][:3]) - origin if len(rows) > 1 else np.cross([0.0, 0.0, 1.0], x)
    z = np.cross(x, y)
    if not np.linalg.norm(z) > 1e-9 * np.linalg.norm(x) * np.linalg.norm(y):
        raise Damaged("the points of *SYSTEM lie on a line")
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    return np.vstack([x, np.cross(z, x), z, origin])


def places(parts: list[tuple[str, Deck]]) -> list[Space]:
    """Of every instance, and last of the assembly's own nodes; a single one keeps its numbers and names."""
    nodes = _power(ids for _, part in parts for ids in part.node_id)
    cells = _power(c.ids for _, part in parts for c in (*part.solids, *part.facets, *part.lumped))
    named = [f"{name}." if len(parts) > 1 else "" for name, _ in parts]
    return [Space(k * nodes, k * cells, prefix) for k, prefix in enumerate([*named, ""])]


def numbered(names: list[str], spaces: list[Space]) -> list[str]:
    """Where the numbers of instances are, in words."""
    moved = [f"{name} + {space.nodes}" for name, space in zip(names, spaces, strict=False) if space.nodes]
    return [f"numbers of nodes: as in the part, those of {', '.join(moved)}"] if moved else []


def _power(numbers: Iterable[Indices]) -> int:
    """The power of ten above all numbers."""
    return int(10 ** len(str(int(joined(numbers).max(initial=0)))))


def place(whole: Deck, part: Deck, name: str, at: Placement, space: Space) -> None:
    """Add a part to the whole as the instance `name`."""
    key = name.upper()
    whole.spaces[key] = space
    whole.instances[name] = joined(part.node_id) + space.nodes
    whole.node_id += [ids + space.nodes for ids in part.node_id]
    whole.node_where += part.node_where
    whole.points += [points @ at.turn.T + at.shift for points in part.points]
    for into, cells in (
        (whole.solids, part.solids),
        (whole.facets, part.facets),
        (whole.lumped, part.lumped),
    ):
        into += [Cells(c.kind, c.ids + space.cells, c.nodes + space.nodes, c.written, c.where) for c in cells]
    for own, sets, more in (
        (part.node_sets, whole.node_sets, space.nodes),
        (part.cell_sets, whole.cell_sets, space.cells),
    ):
        for word, members in own.items():
            whole.add(sets, space.prefix + part.written[word]).extend(ids + more for ids in members)
    for word, axes in part.orientations.items():
        turned = axes if isinstance(axes, str) else axes @ at.turn.T
        whole.orientations[space.prefix.upper() + word] = turned
    whole.sections += [replace(card, space=key) for card in part.sections]
    whole.links += [replace(card, space=key) for card in part.links]
    whole.surfaces += [
        replace(s, name=space.prefix + s.name, card=replace(s.card, space=key)) for s in part.surfaces
    ]
    whole.structures += [
        (where, kind, [[n + space.nodes for n in nodes] for nodes in rows]) for where, kind, rows in part.structures
    ]
    whole.ignored += part.ignored
    whole.kinds += part.kinds
    whole.lost += [text for text in part.lost if text not in whole.lost]
    whole.held += [(f"{name}.{word}", directions, where) for word, directions, where in part.held]
    whole.temperatures += [(column, f"{name}.{word}", value) for column, word, value in part.temperatures]
    whole.not_held += part.not_held
    moved = at.shift.any() or not np.array_equal(at.turn, np.eye(3))
    if part.transforms and moved:
        text = "*TRANSFORM stands in a part that its instance moves; write it behind the instance, in the assembly"
        raise Damaged(text, file=part.transforms[0].place)
    whole.transforms += [replace(card, space=key) for card in part.transforms]

"""Of an Abaqus or CalculiX input file: what holds the body, and its temperatures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..data import Array, Equation, Link
from ..errors import of_file
from .cards import Card, fields, numbers
from .deck import Deck, Readers
from .raw import Damaged, Numbering, RawMesh, joined, lost, real
from .supports import Constraints

_HELD = {
    "ENCASTRE": "xyzabc", "PINNED": "xyz", "XSYMM": "xbc", "YSYMM": "yac", "ZSYMM": "zab", "XASYMM": "yza",
    "YASYMM": "xzb", "ZASYMM": "xyc",
}  # fmt: skip


def _read_boundary(deck: Deck, card: Card) -> None:
    """Displacements that are held. OP=NEW takes the place of all there was before the step."""
    if card.word("OP") == "NEW" and deck.renewed != deck.steps.number:
        deck.held, deck.not_held, deck.renewed = [], [], deck.steps.number
    other = {"SUBMODEL", "USER", "FIXED", "BASE NAME"} & set(card.parameters)
    if other or card.word("TYPE", "DISPLACEMENT") != "DISPLACEMENT":
        deck.not_held.append(f"a *BOUNDARY of the kind {', '.join(other) or card.parameters['TYPE']}")
        return
    moved = Card(card.keyword, card.parameters, [], card.where, card.place, card.space)
    for line in card.lines:
        words = [word.strip() for word in line.split(",")] + 3 * [""]
        try:
            directions = _HELD.get(words[1].upper()) or _directions(words)
            value = real(words[3] or "0", "*BOUNDARY")
            if value or any(before.keyword == "BOUNDARY" for *_, before in deck.steps.acting):
                ways = ("xyzabc".index(way) + 1 for way in directions)
                moved.lines += [f"{words[0]},{way},,{value!r}" for way in ways]
            deck.held.append((words[0].strip('"'), directions, card.place))
        except ValueError:
            deck.not_held.append(f"the line '{line[:60]}' of *BOUNDARY")
    steps = deck.steps
    if not steps.perturbed and (moved.lines or card.word("OP") == "NEW"):
        steps.acting.append((steps.number, steps.factor(card), moved))


def _directions(words: list[str]) -> str:
    """Directions of a data line: set, first, last direction, value.

    Raises:
        ValueError: not such a line, or a last direction below the first.
    """
    first = int(words[1])
    last = int(words[2]) if words[2] else first
    if first < 1 or last < first:
        raise ValueError
    return "xyzabc"[first - 1 : last]


def _read_transform(deck: Deck, card: Card) -> None:
    deck.transforms.append(card)


def local_axes(deck: Deck, numbering: Numbering, points: Array) -> dict[int, Array]:
    """Node number -> (3, 3) its local directions as rows, of *TRANSFORM: rectangular by two points, or cylindrical
    (radial, tangential, along the axis) about an axis through two points.

    Raises:
        Damaged: with the line, points that give no directions.
    """
    axes: dict[int, Array] = {}
    for card in deck.transforms:
        with of_file(card.place):
            ends = [v for row in numbers(card.lines, "*TRANSFORM") for v in row]
            kind, nodes = card.word("TYPE", "R"), deck.nodes_for("*TRANSFORM", card.text("NSET"), card.space)
            if kind not in ("R", "C") or len(ends) != 6:
                raise Damaged("*TRANSFORM is read with TYPE=R or C and the six coordinates of two points")
            a, b = np.array(ends[:3]), np.array(ends[3:])
            x = points[numbering.positions(nodes, "*TRANSFORM names")]
            if kind == "C":
                third = np.broadcast_to(b - a, x.shape)
                first = x - a
                second = np.cross(third, first)
                first = np.cross(second, third)
            else:
                first, third = (np.broadcast_to(v, x.shape) for v in (a, np.cross(a, b)))
                second = np.cross(third, first)
            frame = np.stack([first, second, third], axis=1)
            size = np.linalg.norm(frame, axis=2, keepdims=True)
            if not (size > 1e-12 * max(np.abs(frame).max(initial=0.0), 1e-300)).all():
                raise Damaged("*TRANSFORM has two points, or a node on its axis, that give no three directions")
            axes.update(zip(nodes.tolist(), frame / size, strict=True))
    return axes


def local_supports(deck: Deck, numbering: Numbering) -> list[Link]:
    """Supports along local directions, each as an equation: the displacement along it is zero."""
    links: list[Link] = []
    for word, directions, place in deck.held:
        ways = ["xyz".index(c) for c in directions if c in "xyz"]
        with of_file(place):
            nodes = deck.nodes_for("*BOUNDARY", word)
        turned = [node for node in nodes.tolist() if node in deck.axes]
        for node in turned if len(ways) < 3 else ():
            at = np.repeat(numbering.positions(np.array([node]), "*BOUNDARY names"), 3)
            where = f"{Path(place).name}: *BOUNDARY, local"
            links += [Equation(where, at, np.arange(3), deck.axes[node][way], first=False) for way in ways]
    return links


def _read_temperature(deck: Deck, card: Card, column: int = 1) -> None:
    if "FILE" in card.parameters or "BSTEP" in card.parameters:
        raise Damaged("*TEMPERATURE reads from a results file; write the temperatures out")
    if column and deck.steps.perturbed and deck.steps.static is not None:
        deck.lost.append(lost(card.where, "*TEMPERATURE of a step with PERTURBATION"))
        return
    factor = deck.steps.factor(card)
    for line in card.lines:
        words = fields(line)
        try:
            deck.temperatures.append((column, words[0], factor * float([*words, "0"][1])))
        except (IndexError, ValueError):
            raise Damaged(f"*TEMPERATURE holds the line '{line[:60]}', no node (or set) and temperature") from None


def _read_initial(deck: Deck, card: Card) -> None:
    if card.word("TYPE") == "TEMPERATURE":
        _read_temperature(deck, card, column=0)
    elif card.word("TYPE") in ("STRESS", "PLASTIC STRAIN"):
        deck.lost.append(lost(card.where, f"*INITIAL CONDITIONS, TYPE={card.word('TYPE')}"))
    else:
        deck.ignored.append(f"INITIAL CONDITIONS, TYPE={card.word('TYPE')}")


def assign_temperatures(deck: Deck, raw: RawMesh, numbering: Numbering) -> None:
    """Before the steps and in them, at the points that the deck names."""
    if not deck.temperatures:
        return
    raw.temperature = np.full((len(raw.points), 2), np.nan)
    for column, word, value in deck.temperatures:
        members = deck.nodes_for("*TEMPERATURE", word)
        raw.temperature[numbering.positions(members, "*TEMPERATURE names"), column] = value
    cold = np.isnan(raw.temperature[:, 0])
    raw.temperature[cold, 0] = 0.0
    used = np.unique(joined(nodes.ravel() for _, nodes in raw.blocks))
    if count := int(cold[used].sum()):
        raw.remarks.append(f"{count} nodes have no initial temperature in the file: theirs is 0")


def constraints(deck: Deck, lines: Sequence[tuple[str, str, str]]) -> Constraints:
    """What *BOUNDARY holds by its lines (see `Deck.held`), its sets by the names they were written with."""
    held = Constraints(left_out=list(deck.not_held))
    known = set(joined(deck.node_id).tolist())
    for word, directions, place in lines:
        with of_file(place):
            key, nodes = deck.key(deck.node_sets, word), deck.nodes_for("*BOUNDARY", word)
            if key is None and not known.issuperset(nodes.tolist()):
                raise Damaged(f"*BOUNDARY names the node {word}, which is not defined")
        single = set(directions) & set("xyz") not in (set(), set("xyz"))
        turned = single and not deck.axes.keys().isdisjoint(nodes.tolist())
        turned = turned or not deck.turning.keys().isdisjoint(nodes.tolist())
        for node in nodes.tolist() if turned else ():
            if node in deck.turning:
                held.hold(
                    deck.turning[node], ("abc"["xyz".index(c)] for c in directions if c in "xyz")
                )
            else:
                held.hold(
                    node,
                    set(directions) - set("xyz") if single and node in deck.axes else directions,
                )
        if not turned:
            held.hold(int(nodes[0]) if key is None else deck.written[key], directions)
    return held


def _read_retained(deck: Deck, card: Card) -> None:
    deck.retained += [(fields(line)[0], card.place) for line in card.lines if fields(line)]


READERS: Readers = {
    "RETAINED NODAL DOFS": _read_retained,
    "BOUNDARY": _read_boundary,
    "TRANSFORM": _read_transform,
    "INITIAL CONDITIONS": _read_initial,
    "TEMPERATURE": _read_temperature,
}

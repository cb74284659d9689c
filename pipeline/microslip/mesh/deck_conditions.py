"""Of an Abaqus or CalculiX input file: what holds the body, and its temperatures."""

from __future__ import annotations

import numpy as np

from ..errors import of_file
from .cards import Card, fields
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
            if words[3] and real(words[3], "*BOUNDARY"):
                moved.lines.append(line)
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
    deck.turned = True


def _read_temperature(deck: Deck, card: Card, column: int = 1) -> None:
    if "FILE" in card.parameters or "BSTEP" in card.parameters:
        raise Damaged("*TEMPERATURE reads from a results file; write the temperatures out")
    factor = deck.steps.factor(card)
    for line in card.lines:
        words = fields(line)
        try:
            deck.temperatures.append((column, words[0], factor * float(words[1])))
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


def constraints(deck: Deck) -> Constraints:
    """What *BOUNDARY holds, its sets by the names they were written with."""
    held = Constraints(all_turned=deck.turned, left_out=list(deck.not_held))
    known = set(joined(deck.node_id).tolist())
    for word, directions, place in deck.held:
        with of_file(place):
            key, nodes = deck.key(deck.node_sets, word), deck.nodes_for("*BOUNDARY", word)
            if key is None and not known.issuperset(nodes.tolist()):
                raise Damaged(f"*BOUNDARY names the node {word}, which is not defined")
        held.hold(int(nodes[0]) if key is None else deck.written[key], directions)
    return held


READERS: Readers = {
    "BOUNDARY": _read_boundary,
    "TRANSFORM": _read_transform,
    "INITIAL CONDITIONS": _read_initial,
    "TEMPERATURE": _read_temperature,
}

"""Of an Abaqus or CalculiX input file: what holds the body, and its temperatures."""

from __future__ import annotations

import numpy as np

from .cards import fields
from .deck import Deck, Readers
from .raw import Damaged, Numbering, RawMesh, joined, lost
from .supports import Constraints

_HELD = {
    "ENCASTRE": "xyzabc", "PINNED": "xyz", "XSYMM": "xbc", "YSYMM": "yac", "ZSYMM": "zab", "XASYMM": "yza",
    "YASYMM": "xzb", "ZASYMM": "xyc",
}  # fmt: skip


def _read_boundary(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    """Displacements that are zero. OP=NEW takes the place of all there was before the step."""
    if parameters.get("OP", "").upper() == "NEW" and deck.renewed != deck.step:
        deck.held, deck.not_held, deck.renewed = [], [], deck.step
    other = {"SUBMODEL", "USER", "FIXED", "BASE NAME"} & set(parameters)
    if other or parameters.get("TYPE", "DISPLACEMENT").upper() != "DISPLACEMENT":
        deck.not_held.append(f"a *BOUNDARY of the kind {', '.join(other) or parameters['TYPE']}")
        return
    for line in lines:
        words = [word.strip() for word in line.split(",")] + 3 * [""]
        try:
            directions = _HELD.get(words[1].upper()) or _zeros(words)
            deck.held.append((words[0].strip('"'), directions, deck.card.place))
        except ValueError:
            deck.not_held.append(f"the line '{line[:60]}' of *BOUNDARY")


def _zeros(words: list[str]) -> str:
    """Directions of a data line: set, first, last direction, value.

    Raises:
        ValueError: not such a line, a last direction below the first, or a displacement that is
            prescribed.
    """
    first = int(words[1])
    last = int(words[2]) if words[2] else first
    if first < 1 or last < first or (first <= 3 and words[3] and float(words[3]) != 0):
        raise ValueError
    return "xyzabc"[first - 1 : last]


def _read_step(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    deck.step += 1


def _read_transform(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    deck.turned = True


def _read_temperature(deck: Deck, parameters: dict[str, str], lines: list[str], column: int = 1) -> None:
    if "FILE" in parameters or "BSTEP" in parameters:
        raise Damaged("*TEMPERATURE reads from a results file; write the temperatures out")
    for line in lines:
        words = fields(line)
        try:
            deck.temperatures.append((column, words[0], float(words[1])))
        except (IndexError, ValueError):
            raise Damaged(f"*TEMPERATURE holds the line '{line[:60]}', no node (or set) and temperature") from None


def _read_initial(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    if parameters.get("TYPE", "").upper() == "TEMPERATURE":
        _read_temperature(deck, parameters, lines, column=0)
    elif parameters.get("TYPE", "").upper() in ("STRESS", "PLASTIC STRAIN"):
        deck.lost.append(lost(deck.card.where, f"*INITIAL CONDITIONS, TYPE={parameters['TYPE'].upper()}"))
    else:
        deck.ignored.append(f"INITIAL CONDITIONS, TYPE={parameters.get('TYPE', '').upper()}")


def assign_temperatures(deck: Deck, raw: RawMesh, numbering: Numbering) -> None:
    """Before the steps and in them, at the points that the deck names."""
    if not deck.temperatures:
        return
    raw.temperature = np.full((len(raw.points), 2), np.nan)
    for column, word, value in deck.temperatures:
        members = deck.nodes(word)
        if members is None:
            raise Damaged(f"*TEMPERATURE names the node set '{word}', which is not defined")
        raw.temperature[numbering.positions(members, "*TEMPERATURE names"), column] = value


def constraints(deck: Deck) -> Constraints:
    """What *BOUNDARY holds, its sets by the names they were written with."""
    held = Constraints(all_turned=deck.turned, left_out=list(deck.not_held))
    known = set(joined(deck.node_id).tolist())
    for word, directions, place in deck.held:
        key, found = deck.key(deck.node_sets, word), deck.nodes(word)
        if found is None:
            text = f"*BOUNDARY names the node set '{word}', which is not defined"
            raise Damaged(text, file=place)
        if key is None and not known.issuperset(found.tolist()):
            raise Damaged(f"*BOUNDARY names the node {word}, which is not defined", file=place)
        if key is not None:
            held.hold(deck.written[key], directions)
        else:
            held.hold(int(found[0]), directions)
    return held


READERS: Readers = {
    "BOUNDARY": _read_boundary,
    "STEP": _read_step,
    "TRANSFORM": _read_transform,
    "INITIAL CONDITIONS": _read_initial,
    "TEMPERATURE": _read_temperature,
}

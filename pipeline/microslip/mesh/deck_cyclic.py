"""Cyclic symmetry in an Abaqus or CalculiX deck: the sector that its body is."""

from __future__ import annotations

from ..data import Sector
from ..errors import of_file
from .cards import Card, numbers
from .deck import Deck
from .raw import Damaged, is_number, lost

MODEL, CHOSEN = "CYCLIC SYMMETRY MODEL", "SELECT CYCLIC SYMMETRY MODES"
KEYWORDS = (MODEL, CHOSEN)


def sector_of(deck: Deck) -> tuple[Sector | None, list[str]]:
    """The sector by *CYCLIC SYMMETRY MODEL and its *TIE, and what of them is not read, in words.

    Raises:
        Damaged: with the line, a model that does not say its sectors, its axis or its faces.
    """
    cards = [card for card, _ in deck.links]
    models = [card for card in cards if card.keyword == MODEL]
    ties = [(card, space) for card, space in deck.links if _cuts(card)]
    if len(models) != 1:
        left = [*models, *(card for card, _ in ties)]
        return None, [lost(card.where, f"*{card.keyword} of CYCLIC SYMMETRY") for card in left]
    (model,) = models
    named = model.parameters.get("TIE", "").upper()
    chosen = [tie for tie in ties if named in ("", tie[0].parameters.get("NAME", "").upper())]
    sectors, ends = model.parameters.get("N", ""), [v for row in _points(model) for v in row]
    if not is_number(sectors) or len(ends) != 6 or len(chosen) != 1:
        text = f"*{MODEL} needs N, two points of its axis (six numbers) and the TIE of its faces"
        raise Damaged(text, file=model.place)
    tie, space = chosen[0]
    known = {name.upper(): name for name, *_ in deck.surfaces}
    keys = [deck.key(known, word, space) for line in tie.lines for word in line.split(",")[:2]]
    if len(keys) != 2 or None in keys:
        text = "*TIE, CYCLIC SYMMETRY names no two surfaces of the file"
        raise Damaged(text, file=tie.place)
    one, other = (known[str(key)] for key in keys)
    axis = [b - a for a, b in zip(ends[:3], ends[3:], strict=True)]
    picked = next((card.parameters for card in cards if card.keyword == CHOSEN), {})
    limits = [picked.get(key, "") for key in ("NMIN", "NMAX")]
    first, last = (int(word) if is_number(word) else None for word in limits)
    diameters = () if last is None else tuple(range(first or 0, min(last, int(sectors) // 2) + 1))
    where = f"{model.where}: *{MODEL}"
    return Sector(where, int(sectors), (one, other), tuple(axis), tuple(ends[:3]), diameters), []


def _cuts(card: Card) -> bool:
    return card.keyword == "TIE" and "CYCLIC SYMMETRY" in card.parameters


def _points(model: Card) -> list[list[float]]:
    """Numbers of the data lines of the model."""
    with of_file(model.place):
        return numbers(model.lines, f"*{MODEL}")

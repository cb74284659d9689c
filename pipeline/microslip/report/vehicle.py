"""The page of a small vehicle on unround wheels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..vehicle.study import Studied
from .page import Album, page, say

READ_AS = (
    "Angles count from the mark of the wheel: what stands at 90 degrees rolls over the rail a quarter of a turn after "
    "the mark. Radii are those that the contact sees, means weighted by its pressure. Wear is "
    "the coefficient times the frictional work over each strip (Sextro, 6.8-6), laid over the strips of the tread."
)


def vehicle_html(title: str, found: Studied, pictures: Sequence[Path]) -> str:
    """The page."""
    return recorded_html(title, found.sentences(), pictures, READ_AS)


def recorded_html(title: str, told: Sequence[str], pictures: Sequence[Path], note: str = "") -> str:
    """The page of sentences and pictures, as of wear by given kinematics."""
    lead, warnings = ([s for s in told if s.startswith("warning") is w] for w in (False, True))
    pieces = [say(*lead, tone="lead"), say(*warnings, tone="warn"), *Album({p.name: p for p in pictures}).begun("")]
    return page(title, [piece for piece in [*pieces, say(note, tone="note")] if piece])

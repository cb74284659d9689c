"""The page of a small vehicle on unround wheels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..vehicle.study import Studied
from .page import answer_page, say

READ_AS = (
    "Angles count from the mark of the wheel: what stands at 90 degrees rolls over the rail a quarter of a turn after "
    "the mark. Radii are those that the contact sees, means weighted by its pressure. Wear is "
    "the coefficient times the frictional work over each strip (Sextro, 6.8-6), laid over the strips of the tread."
)


def vehicle_html(title: str, found: Studied, pictures: Sequence[Path]) -> str:
    """The page."""
    return answer_page(title, found.sentences(), pictures, say(READ_AS, tone="note"))

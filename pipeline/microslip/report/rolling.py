"""The page of a rolling contact: the answer, creep curve and tractions, and the patches as a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..rolling.study import Studied
from .page import Piece, answer_page, number, say, table

READ_AS = (
    "Forces act on the wheel, at the middle of the patch: x forward, y to the left, z up. A positive creepage means "
    "that the wheel's surface moves forward (to the left) against the rail, and gives a negative force. Hertz' ellipse "
    "with the mean curvature over the patch; strips of point contacts (Sextro, 6.5)."
)


def rolling_html(title: str, found: Studied, pictures: Sequence[Path], more: Sequence[str] = ()) -> str:
    """The page; `more` sentences are of what was made beside."""
    told = [*found.sentences(), *more]
    return answer_page(title, told, pictures, _patches(found), say(READ_AS, tone="note"))


def _patches(found: Studied) -> Piece:
    head = ["y on the rail in mm", "angle in mrad", "a, b in mm", "normal force in N", "pressure in MPa",
            "creepages", "spin in 1/m"]  # fmt: skip
    rows = [
        [number(1e3 * p.on_rail), number(1e3 * p.angle, 3), f"{1e3 * p.a:.3g}, {1e3 * p.b:.3g}",
         number(p.normal_force, 5), number(p.pressure / 1e6), f"{p.xi:.3g}, {p.eta:.3g}", number(p.phi, 3)]
        for p in found.patches
    ]  # fmt: skip
    return table(head, rows)

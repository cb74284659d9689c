"""The page of a tyre whose slip jumps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..rolling.slip import Studied
from .page import Piece, answer_page, number, say, table

READ_AS = (
    "A row of point contacts along the middle of the patch, each with its share of the static pressure, is passed by "
    "the material (Sextro, 6.10). Time constants are of the exponential that fits the force best; the normal force "
    "follows from the static state, large displacements and contact by Newton's method."
)


def tyre_html(title: str, found: Studied, pictures: Sequence[Path]) -> str:
    """The page."""
    return answer_page(title, found.sentences(), pictures, _loads(found), say(READ_AS, tone="note"))


def _loads(found: Studied) -> Piece:
    columns = found.loads()
    head = ["load jumps to its share", "patch then in mm", "force before in N", "after in N", "1 - 1/e of it after s"]
    columns["patch_length_m"] = 1e3 * columns["patch_length_m"]
    return table(head, [[number(v) for v in row] for row in zip(*columns.values(), strict=True)])

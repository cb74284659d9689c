"""The page of bifurcations: the diagrams first, what happens where, all branches."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..bifurcation.branches import SPECIAL, Branch
from ..bifurcation.diagram import Diagram
from .page import Album, Piece, number, page, say, table

if TYPE_CHECKING:
    from ..case.questions import BifurcationOfCase


def bifurcation_html(
    title: str, asked: Sequence[BifurcationOfCase], found: Sequence[Diagram], sentences: Sequence[str],
    pictures: Sequence[Path],
) -> str:  # fmt: skip
    """The page. sentences: of Hopf points, branches, and what a reader must know."""
    album = Album({p.name: p for p in pictures})
    pieces: list[Piece] = list(album.begun("bifurcation_"))
    pieces.append(say(*sentences, READ_AS, tone="note"))
    for one, drawn in zip(asked, found, strict=True):
        head = ["branch", "what", f"{one.parameter} in {one.unit}".removesuffix(" in "), "period in s", "multiplier"]
        pieces += [table(head, [row for b in drawn.branches for row in _rows(b)])]
    return page(title, [*pieces, *album.begun("")])


READ_AS = (
    "Lines are stable, dashes unstable. The ordinate is half of the way from the smallest to the largest value in a "
    "period, zero for an equilibrium. The multiplier is the largest Floquet multiplier, of an equilibrium the "
    "eigenvalue farthest to the right, in 1/s."
)


def _rows(branch: Branch) -> list[list[str]]:
    return [
        [branch.name, str(branch.kind[i]), number(float(branch.parameter[i]), 6),
         number(float(branch.period[i]), 6) if np.isfinite(branch.period[i]) else "", _multiplier(branch, i)]
        for i in range(len(branch)) if str(branch.kind[i]) in SPECIAL
    ]  # fmt: skip


def _multiplier(branch: Branch, i: int) -> str:
    value = complex(branch.multipliers[i, 0])
    if abs(value.imag) <= 1e-9 * abs(value):
        return number(value.real)
    return f"{number(value.real)} ± {number(abs(value.imag))} i"

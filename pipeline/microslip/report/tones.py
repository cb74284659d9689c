"""The page of two tones: pictures first, then the strongest pairs and all points."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..results.tones import TwoTones
from ..units import Quantity
from .page import Album, Piece, fold, number, page, say, table

STRONGEST = 16
"""Pairs in the table of a point."""

READ_AS = (
    "A pair (k1, k2) stands for the frequency k1 f1 + k2 f2; its amplitude is 0-peak. Powers are means: what the loads "
    "of either tone supply, what the bodies' damping takes, and what the contacts take by their own count."
)


def tones_html(title: str, found: TwoTones, point: int, messages: Sequence[str], pictures: Sequence[Path]) -> str:
    """The page.

    Args:
        point: number of the one that is shown in full. messages: sentences.
    """
    album = Album({p.name: p for p in pictures})
    pieces: list[Piece] = list(album.begun(""))
    pieces.append(say(*messages, READ_AS, tone="note"))
    if found.converged[point]:
        pieces.append(_pairs(found, point))
    if len(found) > 1:
        pieces.append(fold("All points, as in two_tones.csv", _points(found)))
    return page(title, pieces)


def _pairs(found: TwoTones, i: int) -> Piece:
    size, f = np.abs(found.amplitude[i, 0]), found.frequencies(i)
    strongest = np.argsort(-size, kind="stable")[:STRONGEST]
    unit = Quantity(found.units[0]).said
    rows = [
        ["({}, {})".format(*found.pairs[j]), number(abs(float(f[j])), 6), number(float(size[j]), 6)] for j in strongest
    ]
    return table(["pair", "frequency in Hz", f"{found.readouts[0]} in {unit}"], rows)


def _points(found: TwoTones) -> Piece:
    unit = Quantity(found.units[0]).said
    head = ["first in Hz", "second in Hz", f"(1, 0) in {unit}", f"(0, 1) in {unit}", "first supplies, W", "second, W",
            "damped in W", "contacts in W", ""]  # fmt: skip
    numbers = zip(
        found.first, found.second, np.abs(found.of(1, 0)), np.abs(found.of(0, 1)), *found.supplied.T, found.damped,
        found.lost, strict=True,
    )  # fmt: skip
    rows = [[*(number(float(v), 6) for v in row), s] for row, s in zip(numbers, found.status, strict=True)]
    return table(head, rows)

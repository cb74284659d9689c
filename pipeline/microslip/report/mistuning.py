"""The page of a mistuned ring: the answer, its histogram, envelopes, the worst pattern, and the tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..mistuning.ensemble import Ensemble
from ..mistuning.statistics import SHARES, fits
from .page import Piece, answer_page, fold, number, say, table

READ_AS = (
    "Amplification: the highest amplitude of any blade over the frequency, over that of the ring of equal sectors. "
    "Intervals lie between order statistics and hold whatever the distribution is. The distance of a fit is the "
    "largest difference between its distribution function and that of the samples; in the tail, of the highest tenth."
)
WORST = 12
"""Samples in the table of the highest."""


def mistuning_html(title: str, found: Ensemble, messages: Sequence[str], pictures: Sequence[Path]) -> str:
    """The page. messages: sentences."""
    highest = fold("The highest samples, all in samples.csv", _highest(found))
    return answer_page(title, messages, pictures, _quantiles(found), _fits(found), highest, say(READ_AS, tone="note"))


def _quantiles(found: Ensemble) -> Piece:
    told = [found.quantile(share) for share in SHARES]
    rows = [[f"{100 * q.share:g} %", number(q.value), _end(q.low), _end(q.high)] for q in told]
    if found.rare is not None:
        q = found.rare.quantile
        head = f"{100 * q.share:g} %, by {found.rare.samples} chosen samples"
        rows.append([head, number(q.value), _end(q.low), _end(q.high)])
    return table(["of the samples below", "amplification", "at least", "at most"], rows)


def _end(value: float) -> str:
    return number(value) if 0 < value < np.inf else "too few samples"


def _fits(found: Ensemble) -> Piece:
    rows = [
        [f.name, *(number(v) for v in f.quantiles.values()), number(f.distance, 2), number(f.tail, 2)]
        for f in fits(found.amplification[found.solved])
    ]
    return table(["fit", *(f"{100 * s:g} %" for s in SHARES), "distance", "in the tail"], rows)


def _highest(found: Ensemble) -> Piece:
    a = np.where(found.solved, found.amplification, -np.inf)
    rows = [
        [i, number(a[i]), number(found.column("frequency_Hz")[i], 6), int(found.column("sector")[i]),
         number(found.column("localisation")[i], 3)]
        for i in np.argsort(-a, kind="stable")[:WORST] if np.isfinite(a[i])
    ]  # fmt: skip
    return table(["sample", "amplification", "frequency in Hz", "blade", "localisation"], rows)

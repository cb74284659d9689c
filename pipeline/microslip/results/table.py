"""The table of a response: every point of all its series, a row a frequency."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..data import Array
from ..files.tables import columns_csv
from .names import apart, digits
from .series import Series


def response_table(series: Mapping[float, Series]) -> str:
    """CSV text: in order of the frequency every point that a series has, with empty cells for series without it, and
    for what is told of a motion where the point is no solution.

    Args:
        series: normal force (N) -> its sweep, with the points that were added and the peaks that were searched for.

    Returns:
        Columns ``<quantity>_FN_<normal force>_N`` and, last, ``asked``: 1 where a frequency is one of the sweep.
    """
    count = max((digits(s.frequency, 9) for s in series.values()), default=9)
    places = {n: [f"{f:.{count}g}" for f in s.frequency] for n, s in series.items()}
    every = sorted({f for own in places.values() for f in own}, key=float)
    asked = {f for n, s in series.items() for f, of_sweep in zip(places[n], _asked(s), strict=True) if of_sweep}
    columns: dict[str, list[str | float]] = {"frequency_Hz": [*every]}
    for force, (normal, s) in zip(apart(list(series)), series.items(), strict=True):
        for name, values in _columns(s).items():
            cells = ["" if np.isnan(v) else float(v) for v in values.astype(float)]
            held = dict(zip(places[normal], cells, strict=True))
            columns[f"{name}_FN_{force}_N"] = [held.get(f, "") for f in every]
    return columns_csv(columns | {"asked": [float(f in asked) for f in every]}, 9)


def _asked(s: Series) -> Array:
    """(f,) bool, points of the sweep itself; a peak may stand at one of them, see `Series.arrays`."""
    peak, added = (np.asarray(s.arrays[name]) for name in ("peak", "added"))
    return np.asarray((added == 0) & ((peak == 0) | (peak == s.key)))


def _columns(s: Series) -> dict[str, Array]:
    """Heading -> (f,) numbers: those of a series, and how they were found."""
    found = {name: values for name, values in s.columns().items() if name != "frequency_Hz"}
    return found | {
        "slip_dissipated_J": s.by_slip,
        **{name: np.asarray(s.arrays[name]) for name in ("harmonics", "iterations")},
    }

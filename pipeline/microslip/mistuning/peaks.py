"""The highest of many read-outs over frequency: a sweep, then points where parabolas through it say that peaks are.

Near a resonance 1/|y|^2 is a parabola over the frequency, exactly so for one mode, so one through the three highest
points of a read-out says where its peak is and how high. A point is added where the highest is said to be, as long as
that is higher than what is known, or was told wrongly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..data import Array

Respond = Callable[[float], Array | None]
"""(w,) amplitudes of the read-outs at a frequency (Hz); None where there is no solution."""

TOLERANCE = 1e-4
"""Share of the highest amplitude by which it may be missed."""

MOST = 15
"""Points added at most."""


@dataclass(frozen=True)
class Highest:
    """Attributes:
    output: number of the read-out. frequency: Hz. amplitude. missed: share of it by which a parabola says that it may
        be higher yet. frequencies: (f,) Hz of all points with a solution, rising, amplitudes: (f, w). failed: Hz of
        those without. at_end: whether it is at an end of the band.
    """

    output: int
    frequency: float
    amplitude: float
    missed: float
    frequencies: Array
    amplitudes: Array
    failed: tuple[float, ...]
    at_end: bool


def highest(respond: Respond, frequency: Array, tolerance: float = TOLERANCE, most: int = MOST) -> Highest:
    """The highest amplitude of all read-outs in a band.

    Args:
        frequency: (f,) Hz, rising, a sweep that sees every resonance. tolerance, most: see `TOLERANCE`, `MOST`.
    """
    known: dict[float, Array] = {}
    failed: list[float] = []

    def look(f: float) -> bool:
        y = respond(f)
        if y is None:
            failed.append(f)
            return False
        known[f] = y
        return True

    for f in frequency:
        look(float(f))
    for _ in range(most):
        told = told_by(known)
        if told is None or told[0] <= max(y.max() for y in known.values()) * (1 + tolerance):
            break
        if not look(told[1]):
            break
    if not known:
        return Highest(-1, np.nan, np.nan, np.nan, np.zeros(0), np.zeros((0, 0)), tuple(failed), False)
    at = np.array(sorted(known))
    y = np.array([known[f] for f in at])
    i, output = np.unravel_index(int(y.argmax()), y.shape)
    told = told_by(known)
    missed = 0.0 if told is None else max(told[0] / y.max() - 1, 0.0)
    ends = at[i] in (min(frequency), max(frequency))
    return Highest(int(output), float(at[i]), float(y.max()), missed, at, y, tuple(failed), bool(ends))


def told_by(known: dict[float, Array]) -> tuple[float, float] | None:
    """The highest amplitude that parabolas tell, and its frequency (Hz), where no point is yet."""
    at = np.array(sorted(known))
    if len(at) < 3:
        return None
    y = np.array([known[f] for f in at])
    tops = (y[1:-1] >= y[:-2]) & (y[1:-1] >= y[2:])
    middle, which = np.nonzero(tops)
    if not len(middle):
        return None
    x = np.stack([at[middle], at[middle + 1], at[middle + 2]])
    g = np.stack([y[middle, which], y[middle + 1, which], y[middle + 2, which]]) ** -2.0
    left, right = (g[1] - g[0]) / (x[1] - x[0]), (g[2] - g[1]) / (x[2] - x[1])
    bend = (right - left) / (x[2] - x[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        place = 0.5 * (x[0] + x[1] - left / bend)
        lowest = g[0] + left * (place - x[0]) + bend * (place - x[0]) * (place - x[1])
    place = np.clip(np.where(bend > 0, place, x[1]), x[0], x[2])
    narrow = 1e-9 * x[1]
    new = np.min(np.abs(place - x), axis=0) > narrow
    # a parabola whose foot is below zero saw a resonance narrower than its points
    height = np.where(lowest > 0, np.maximum(lowest, 1e-300) ** -0.5, np.inf)
    height = np.where(new & (bend > 0), height, 0.0)
    best = int(height.argmax())
    return (float(height[best]), float(place[best])) if height[best] > 0 else None

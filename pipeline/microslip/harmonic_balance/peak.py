"""Resonance peaks of an assembly followed over a parameter: normal force, mass, angle, whatever makes a problem.

`continuation.extremum` does the work on the squared amplitude of a read-out; here are its starts, which a sweep over
the band finds, and the check by another one that no other resonance is higher where the followed one is lowest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from ..continuation import Lowest, Peak, Ridge, lowest, ridge
from ..continuation import peak as climbed
from ..continuation.extremum import NO_OPTIMUM
from ..data import Array
from .problem import Problem
from .readout import Watched
from .solver import Report, sweep

SAME = 5e-3
"""Relative difference of the frequencies of what counts as one resonance."""

ROUNDING = 1e-9
"""Relative difference of the heights of one peak that is found twice."""

Make = Callable[[float], Problem]
"""The problem at a value of the parameter; its scales must not depend on the value (give `length` to `problem.of`)."""


@dataclass(frozen=True)
class Resonance:
    """A peak. Attributes: Omega: rad/s. amplitude: m. x: see `Problem`. status: "converged", or what went wrong."""

    Omega: float
    amplitude: float
    x: Array
    status: str


@dataclass(frozen=True)
class Optimum:
    """Where the highest resonance of a band is lowest.

    Attributes:
        parameter. resonance: there. status: "converged": a minimum of one peak; "kink": one where its derivative
            jumps; "two peaks": where one takes over from another, of the same height; "followed": one of the values
            followed, which nothing found between them beats; else what went wrong.
        ridges: the peaks followed, from the first value on and from the last one back. other: rad/s and m of the
            highest response of the band besides, on the grid of the check.
    """

    parameter: float
    resonance: Resonance
    status: str
    ridges: tuple[Ridge, ...]
    other: tuple[float, float]

    @property
    def spread(self) -> float:
        """By which share of the lowest the highest resonance changes over all values that were followed; infinite where
        these are fewer than two."""
        heights = [float(np.sqrt(one.value)) for _, one in highest_followed(self.ridges)]
        if len(heights) < 2:
            return float("inf")
        return max(heights) / min(*heights, self.resonance.amplitude) - 1


def highest(problem: Problem, Omega: Array, watch: int = 0, report: Report = lambda _: None) -> Peak:
    """The highest peak of a read-out in a band: a sweep over Omega (f,) in rad/s, then uphill from its highest point.

    A band without any solution gives a peak that says so.
    """
    points = sweep(problem, Omega / (2 * np.pi), report)
    watched = Watched(problem, watch)
    heights = [watched.output(p.x, p.Omega)[0] if p.converged else -np.inf for p in points]
    best = points[int(np.argmax(heights))]
    return climbed(watched, best.x, best.Omega)


def resonance(peak: Peak) -> Resonance:
    """A peak of a squared amplitude in the words of vibrations."""
    return Resonance(peak.lam, float(np.sqrt(peak.value)), peak.x, peak.status)


def follow(make: Make, first: Peak, values: Sequence[float], watch: int = 0) -> Ridge:
    """A peak of the problem at values[0] followed through the others, see `continuation.extremum.ridge`."""
    return ridge(lambda value: Watched(make(value), watch), first, values)


Keep = Callable[[int, float, Peak], None]
"""Is given which of the followed peaks (1 or 2), the value, and the peak there."""


def optimum(
    make: Make, values: Sequence[float], Omega: Array, watch: int = 0, report: Report = lambda _: None,
    keep: Keep = lambda number, value, peak: None,
) -> Optimum:  # fmt: skip
    """The value between the first and the last one at which the highest resonance in a band is lowest.

    The highest peaks at both ends are followed through all values; a few of them do. The lowest place of the higher
    one is found by its derivative, or where the two are of the same height; it is compared with all that was followed.

    Args:
        values: rising or falling. Omega: (f,) rad/s, the band on a grid that sees its resonances. keep: is told every
            peak as it is found.
    """

    def family(value: float) -> Watched:
        return Watched(make(value), watch)

    def followed(number: int, way: Sequence[float]) -> Ridge:
        report(f"highest peak at {way[0]:.5g}")
        first = highest(make(way[0]), Omega, watch, report)

        def told(value: float, found: Peak) -> None:
            one = resonance(found)
            report(f"peak {number} at {value:.5g}: {one.Omega / (2 * np.pi):.6g} Hz, {one.amplitude:.4g} m")
            keep(number, value, found)

        report(f"peak {number} followed from {way[0]:.5g} to {way[-1]:.5g}")
        return ridge(family, first, way, keep=told)

    forward, back = followed(1, values), followed(2, values[::-1])
    last = back.peaks[0]
    report("where the highest peak is lowest")
    same = forward.status == "complete" and abs(forward.lam[-1] / last.lam - 1) <= SAME
    ridges = (forward,) if same else (forward, back)
    found = _crossing(family, forward, back) if not same else None
    if found is None:
        found = lowest(family, forward) if same else _of_the_higher(family, forward, back)
    found = _not_beaten(found, ridges)
    report(f"other peaks at {found.parameter:.5g}")
    return Optimum(
        found.parameter, resonance(found.peak), found.status, ridges,
        _beside(make(found.parameter), Omega, found.peak, watch, report),
    )  # fmt: skip


def highest_followed(ridges: Sequence[Ridge]) -> list[tuple[float, Peak]]:
    """(value, peak) of the higher of the followed peaks, at every value that all of them reach."""
    ways = [_by_value(one) for one in ridges]
    common = [value for value in ways[0] if all(value in way for way in ways)]
    return [(value, max((way[value] for way in ways), key=lambda one: one.value)) for value in common]


def _by_value(one: Ridge) -> dict[float, Peak]:
    """Value -> peak of those that were found."""
    return {v: p for v, p in zip(one.parameter.tolist(), one.peaks, strict=True) if p.converged}


def _of_the_higher(family: Callable[[float], Watched], forward: Ridge, back: Ridge) -> Lowest:
    """Where one of two peaks that do not cross is lowest: the higher one where both are known, the one known at more
    values if they are one; the lower of two places where no value is known of both."""
    known = [one for one in (forward, back) if len(one.peaks) > 1]
    if len(known) == 1:
        return lowest(family, known[0])
    ways = [_by_value(one) for one in (forward, back)]
    gaps = [_gap(ways[0][value], ways[1][value]) for value in ways[0] if value in ways[1]]
    if not gaps:
        return min((lowest(family, one) for one in (forward, back)), key=lambda one: one.peak.value)
    if any(gaps):
        return lowest(family, forward if sum(gaps) > 0 else back)
    return lowest(family, max((forward, back), key=lambda one: len(one.peaks)))


def _not_beaten(found: Lowest, ridges: Sequence[Ridge]) -> Lowest:
    """What was found, or the lowest of the followed peaks where that is lower by more than rounding."""
    followed = highest_followed(ridges)
    if not followed:
        return found
    value, least = min(followed, key=lambda one: one[1].value)
    if not least.value < found.peak.value * (1 - ROUNDING):
        return found
    ends = [end for one in ridges for end in (one.parameter.min(), one.parameter.max())]
    status = NO_OPTIMUM if value in (min(ends), max(ends)) else "followed"
    return Lowest(value, least, status, found.evaluations)


def _crossing(family: Callable[[float], Watched], forward: Ridge, back: Ridge) -> Lowest | None:
    """Where a falling peak meets a rising one, if they do at parameters that both reach.

    Each is followed from where its own ridge came, as between the same two values another peak may lie nearer.
    """
    ways = [dict(zip(one.parameter.tolist(), one.peaks, strict=True)) for one in (forward, back)]
    common = [value for value in ways[0] if value in ways[1]]
    kept = {value: (ways[0][value], ways[1][value]) for value in common}
    gap = np.array([_gap(*kept[value]) for value in common])
    change = np.flatnonzero(gap[:-1] * gap[1:] < 0)
    if not len(change):
        return None
    low, high = common[change[0]], common[change[0] + 1]

    def difference(value: float) -> float:
        if value not in kept:
            pair = ridge(family, kept[low][0], [low, value]), ridge(family, kept[high][1], [high, value])
            if any(one.status != "complete" for one in pair):
                raise _Ended
            kept[value] = (pair[0].peaks[-1], pair[1].peaks[-1])
        return _gap(*kept[value])

    try:
        value = float(scipy.optimize.brentq(difference, low, high, rtol=1e-9))
        difference(value)
    except _Ended:
        return None
    rates = [one.rate for one in kept[value]]
    if min(rates) > 0 or max(rates) < 0:  # both rise or both fall: no lowest place
        return None
    spent = sum(p.evaluations for pair in list(kept.values())[len(common) :] for p in pair)
    return Lowest(value, kept[value][0], "two peaks", spent)


class _Ended(Exception):
    """A peak is not found on the way to where it meets another (never leaves this module)."""


def _gap(one: Peak, other: Peak) -> float:
    """Logarithm of the ratio of two heights; nothing where both are one peak, found twice."""
    gap = float(np.log(one.value / other.value))
    return 0.0 if abs(gap) <= ROUNDING else gap


def _beside(problem: Problem, Omega: Array, peak: Peak, watch: int, report: Report) -> tuple[float, float]:
    """(rad/s, m) of the highest point of a band that is not on the flanks of a peak."""
    points = [p for p in sweep(problem, Omega / (2 * np.pi), report) if p.converged]
    watched = Watched(problem, watch)
    heights = np.array([watched.output(p.x, p.Omega)[0] for p in points])
    at = int(np.argmin([abs(p.Omega - peak.lam) for p in points]))
    while (best := max((at - 1, at, at + 1), key=lambda i: heights[i] if 0 <= i < len(points) else -np.inf)) != at:
        at = best
    low = high = at
    while low > 0 and heights[low - 1] < heights[low]:
        low -= 1
    while high < len(points) - 1 and heights[high + 1] < heights[high]:
        high += 1
    rest = [i for i in range(len(points)) if i < low or i > high]
    if not rest:
        return float("nan"), 0.0
    top = max(rest, key=lambda i: heights[i])
    return points[top].Omega, float(np.sqrt(heights[top]))

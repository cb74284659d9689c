"""The highest resonance of an assembly in a band, and the value of a setting at which it is lowest: normal force, mass,
angle, whatever makes a problem.

It is looked for as a response looks for its resonances; `continuation.extremum` finds the lowest place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..continuation import Lowest, Peak, lowest, placed, rated
from ..data import Array
from .problem import Problem
from .readout import WithOutput, measured
from .response import HarmonicResponse, filled_response, no_resonance, operating, parted, refined_peaks, unsolved
from .solver import Point, Report

Make = Callable[[float], Problem]
"""The problem at a value of the parameter; its scales must not depend on the value (give `length` to `problem.of`)."""


@dataclass(frozen=True)
class HighestPeak:
    """A peak. Attributes: Omega: rad/s. amplitude: m; both NaN where none is known. x: see `Problem`. status:
    "converged", or why none is known, see `response.no_resonance`. open: (c,) share of its points and time at which
    each contact is open. unsolved: folds, and points of the sweep without a solution, in words, beside which one may be
    higher."""

    Omega: float
    amplitude: float
    x: Array
    status: str
    open: Array | None = None
    unsolved: str = ""


@dataclass(frozen=True)
class Optimum:
    """Where the highest resonance of a band is lowest.

    Attributes:
        parameter. resonance: there. status: see `continuation.Lowest`. found: value -> highest resonance in the band,
            rising, of all values that were looked at. rising: value -> rad/s of an end of the band at which the
            response is higher than the highest resonance in it. problem: the balance of `resonance`.
    """

    parameter: float
    resonance: HighestPeak
    status: str
    found: dict[float, HighestPeak]
    rising: dict[float, float]
    problem: Problem | None = None

    @property
    def spread(self) -> float:
        """By which share of the lowest the highest resonance changes over all values; infinite if one is known."""
        heights = [one.amplitude for one in self.found.values() if one.status == "converged"]
        return max(heights) / min(heights) - 1 if len(heights) > 1 else float("inf")


class Top(NamedTuple):
    """The highest peak of a band; rad/s of the end at which the response is higher than that, if one; points of the
    sweep without a solution and folds, in words."""

    peak: Peak
    end: float | None
    unsolved: str


def highest(problem: Problem, Omega: Array, report: Report = lambda _: None) -> Top:
    """The highest peak of the first read-out in a band, Omega (f,) in rad/s, looked for as a response looks for its
    resonances. A band in which none is known gives one that says why."""
    return top_of(problem, filled_response(problem, Omega / (2 * np.pi), report))


def top_of(problem: Problem, response: HarmonicResponse) -> Top:
    """The highest peak of a response; see `highest`."""
    resonances, folds = parted(response, refined_peaks(problem, response))
    best = max(resonances, key=lambda one: one.amplitude, default=None)
    why = no_resonance(response, folds)
    peak = Peak(np.zeros(problem.size), np.nan, np.nan, False, why, np.zeros(0))
    if best is not None:
        peak = placed(WithOutput(problem), best.x, 2 * np.pi * best.frequency)
    solved = np.flatnonzero(response.converged)
    height = np.abs(response.monitor)
    end = max(solved[[0, -1]], key=lambda k: height[k]) if len(solved) else 0
    rises = len(solved) > 0 and height[end] > (0.0 if best is None else best.amplitude)
    return Top(peak, 2 * np.pi * float(response.frequency[end]) if rises else None, unsolved(response, folds))


def opened(problem: Problem, peak: Peak) -> Array | None:
    """(c,) share of its points and time at which each contact is open; nothing of a peak that is not known."""
    if not peak.converged:
        return None
    cycles = operating(problem, Point(peak.lam, peak.x)).cycles.values()
    return np.array([float(cycle.open.mean()) for cycle in cycles])


def resonance(peak: Peak) -> HighestPeak:
    """A peak of a squared amplitude in the words of vibrations."""
    return HighestPeak(peak.lam, float(np.sqrt(peak.value)), peak.x, peak.status)


def optimum(
    make: Make, values: Sequence[float], Omega: Array, report: Report = lambda _: None,
    keep: Callable[[dict[float, HighestPeak]], None] = lambda found: None,
    look: Callable[[float, Problem], Top] | None = None,
) -> Optimum:  # fmt: skip
    """The value between the first and the last one at which the highest resonance in a band is lowest.

    Args:
        values: rising or falling, at all of which it is looked for. Omega: (f,) rad/s, the band on a grid that sees its
            resonances. keep: is given all resonances found so far, by value, whenever there is one more.
            look: finds the highest peak at a value, `highest` if not given.
    """
    rising: dict[float, float] = {}
    found: dict[float, HighestPeak] = {}

    def family(value: float) -> WithOutput:
        return WithOutput(make(value))

    def at(value: float) -> Peak:
        report(f"highest resonance at {value:.5g}")
        problem = make(value)
        top, end, lost = look(value, problem) if look else highest(problem, Omega, report)
        if end is not None:
            rising[value] = end
        one = found[value] = replace(resonance(top), open=opened(problem, top), unsolved=lost)
        size = measured(problem.assembly).sized(one.amplitude)
        said = f"{one.Omega / (2 * np.pi):.6g} Hz, {size}" if top.converged else top.status
        report(f"highest resonance at {value:.5g}: {said}")
        keep(dict(sorted(found.items())))
        return rated(family, value, top)

    best: Lowest = lowest(at, values)
    by_value, ends = dict(sorted(found.items())), dict(sorted(rising.items()))
    value = best.parameter
    return Optimum(value, found[value], best.status, by_value, ends, make(value))

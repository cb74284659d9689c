"""The highest resonance of an assembly in a band, and the value of a setting at which it is lowest: normal force, mass,
angle, whatever makes a problem.

A sweep over the band sees the resonances, `continuation.extremum` climbs to their peaks and finds the lowest place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..continuation import SEARCH, Lowest, Peak, lowest, rated
from ..continuation import peak as climbed
from ..data import Array
from .problem import Problem
from .readout import WithOutput, measured
from .response import operating
from .solver import CONVERGED, Point, Report, sweep
from .sweeps import prominent

SEEN = 0.5
"""Share of the highest peak that a top of the sweep has to have to be climbed: half a step of the sweep beside a
resonance, that much of it is left if the step is less than 1.7 half-power widths."""

Make = Callable[[float], Problem]
"""The problem at a value of the parameter; its scales must not depend on the value (give `length` to `problem.of`)."""


@dataclass(frozen=True)
class HighestPeak:
    """A peak. Attributes: Omega: rad/s. amplitude: m. x: see `Problem`. status: "converged", or what went wrong.
    open: (c,) share of its points and time at which each contact is open."""

    Omega: float
    amplitude: float
    x: Array
    status: str
    open: Array | None = None


@dataclass(frozen=True)
class Optimum:
    """Where the highest resonance of a band is lowest.

    Attributes:
        parameter. resonance: there. status: see `continuation.Lowest`. found: value -> highest resonance in the band,
            rising, of all values that were looked at. rising: value -> rad/s of an end of the band at which the
            response is higher than the highest resonance in it.
    """

    parameter: float
    resonance: HighestPeak
    status: str
    found: dict[float, HighestPeak]
    rising: dict[float, float]

    @property
    def spread(self) -> float:
        """By which share of the lowest the highest resonance changes over all values; infinite if one is known."""
        heights = [one.amplitude for one in self.found.values() if one.status == "converged"]
        return max(heights) / min(heights) - 1 if len(heights) > 1 else float("inf")


def highest(
    problem: Problem, Omega: Array, output: int = 0, report: Report = lambda _: None
) -> tuple[Peak, float | None]:
    """The highest peak of a read-out in a band, and the end (rad/s) at which the response is higher than that, if one.

    A sweep over Omega (f,) in rad/s, then uphill from its tops, along the curve, as far as the band goes. A band
    without any peak gives one that says so.
    """
    points = [p for p in sweep(problem, Omega / (2 * np.pi), report) if p.converged]
    seen = WithOutput(problem, output)
    none = Peak(np.zeros(problem.size), float(Omega[0]), np.nan, False, "no solution in the band", np.zeros(0))
    if not points:
        return none, None
    height = np.array([seen.output(p.x, p.Omega)[0] for p in points])
    walled = np.concatenate([[0.0], height, [0.0]])
    tops = np.flatnonzero((walled[1:-1] > walled[:-2]) & (walled[1:-1] >= walled[2:]))
    tops = prominent(np.sqrt(height), tops)
    best = replace(none, value=0.0, status="no resonance in the band")
    within = replace(SEARCH, low=float(Omega.min()), high=float(Omega.max()))
    for i in sorted(tops, key=lambda k: -height[k]):
        if height[i] < SEEN**2 * best.value:
            break
        found = climbed(seen, points[i].x, points[i].Omega, within)
        if found.converged and within.low < found.lam < within.high and found.value > best.value:
            best = checked(problem, found, output)
    end = max((0, -1), key=lambda k: height[k])
    return best, points[end].Omega if height[end] > best.value else None


def checked(problem: Problem, peak: Peak, output: int = 0) -> Peak:
    """A peak that is not called converged if its solution fails its checks (`results.checks`), or does not move the
    read-out but for rounding."""
    if not peak.converged:
        return peak
    found = operating(problem, Point(peak.lam, peak.x, CONVERGED, 0.0, 0))
    still = "" if found.outputs[output, 1] else STILL
    return replace(peak, status=found.checks.failure or still or peak.status)


def opened(problem: Problem, peak: Peak) -> Array | None:
    """(c,) share of its points and time at which each contact is open; nothing of a peak that is not known."""
    if not peak.converged:
        return None
    cycles = operating(problem, Point(peak.lam, peak.x, CONVERGED, 0.0, 0)).cycles.values()
    return np.array([float(cycle.open.mean()) for cycle in cycles])


STILL = "the read-out does not move"
"""Status of a peak of rounding."""


def resonance(peak: Peak) -> HighestPeak:
    """A peak of a squared amplitude in the words of vibrations."""
    return HighestPeak(peak.lam, float(np.sqrt(peak.value)), peak.x, peak.status)


def optimum(
    make: Make, values: Sequence[float], Omega: Array, output: int = 0, report: Report = lambda _: None,
    keep: Callable[[dict[float, HighestPeak]], None] = lambda found: None,
) -> Optimum:  # fmt: skip
    """The value between the first and the last one at which the highest resonance in a band is lowest.

    Args:
        values: rising or falling, at all of which it is looked for. Omega: (f,) rad/s, the band on a grid that sees its
            resonances. keep: is given all resonances found so far, by value, whenever there is one more.
    """
    rising: dict[float, float] = {}
    found: dict[float, HighestPeak] = {}

    def family(value: float) -> WithOutput:
        return WithOutput(make(value), output)

    def at(value: float) -> Peak:
        report(f"highest resonance at {value:.5g}")
        top, end = highest(make(value), Omega, output, report)
        if end is not None:
            rising[value] = end
        one = found[value] = replace(resonance(top), open=opened(make(value), top))
        size = measured(make(value).assembly, output).sized(one.amplitude)
        said = f"{one.Omega / (2 * np.pi):.6g} Hz, {size}" if top.converged else top.status
        report(f"highest resonance at {value:.5g}: {said}")
        keep(dict(sorted(found.items())))
        return rated(family, value, top)

    best: Lowest = lowest(at, values)
    return Optimum(
        best.parameter, found[best.parameter], best.status, dict(sorted(found.items())), dict(sorted(rising.items()))
    )

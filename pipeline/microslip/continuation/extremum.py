"""Peaks of an output along a curve of solutions, followed over a further parameter, and where they are lowest.

On the curve R(x, lambda) = 0 with unit tangent t an output g(x, lambda) has a peak where grad g . t falls through
zero. That holds where the curve overhangs as well, and where it has a kink: there the sign jumps. With a parameter p
of the problem the peak's height changes by the derivative

    dg/dp = g_p + grad g . dy/dp,    [dR/dy; t^T] dy/dp = [-R_p; 0]

which needs no second derivatives, because the motion of the peak along the curve changes nothing (the envelope
theorem). Two such tangents with a valley between them meet where it is lowest, or below it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from ..data import Array
from .curve import Branch, Lost, Point, Segment, Settings, State, across, advance, root
from .newton import CONVERGED, Equations, Scaled, correct, norm, unit


class Rated(Equations, Protocol):
    """A problem with an output: positive, its logarithm is looked at."""

    def output(self, x: Array, lam: float) -> tuple[float, Array, float]:
        """g, dg/dx (n,) and dg/dlambda."""
        ...


@dataclass(frozen=True)
class Peak:
    """A peak of an output.

    Attributes:
        x: (n,). lam. value: g. kink: the curve bends there, or g does. status: "converged", or what went wrong.
        rate: derivative of ln g with respect to the parameter it is followed over, if it is. tangent: (n + 1,) of the
            curve, scaled.
    """

    x: Array
    lam: float
    value: float
    kink: bool
    status: str
    tangent: Array
    rate: float = math.nan

    @property
    def converged(self) -> bool:
        return self.status == CONVERGED


SEARCH = Settings(folds=False, branch_points=False, step=0.01, resolution=1e-4)
"""How the curve is followed to its peak, if not told otherwise. Contacts of many points have a kink
at every sample of each of them: these are located to 1e-4."""

DIP = 0.02
"""Fall of ln g behind a peak that ends the climb. Contacts that switch sample by sample make many small peaks on the
way up; the highest of those that lie within a smaller dip of each other is taken."""


def peak(problem: Rated, x: Array, lam: float, settings: Settings | None = None) -> Peak:
    """The peak uphill from a guess (n,) at lambda, whichever way that is. One that fails says why."""
    settings, scaled = settings or SEARCH, Scaled(problem)
    border = unit(len(np.atleast_1d(x)) + 1)
    begun = across(scaled, scaled.pack(x, lam), border, settings)
    if begun.status:
        return Peak(x, lam, math.nan, False, begun.status, border)
    slope = _Slope(problem)
    here = slope.at(begun.y, begun.tangent)
    uphill = begun if here.slope >= 0 else _reversed(begun)
    top = _ahead(slope, uphill, settings)
    if not top.converged or math.log(top.value / here.value) > DIP:
        return top
    other = _ahead(slope, _reversed(uphill), settings)  # that peak is hardly higher than the beginning
    return other if other.converged and other.value > top.value else top


def placed(problem: Rated, x: Array, lam: float) -> Peak:
    """The peak at a place of the curve, (n,) and lambda, that is known to be one.

    Its height is flat there and says little about its place, on which `rated` depends: where the slope changes its
    sign within `BESIDE_TOP` uphill, its root is taken.
    """
    slope = _Slope(problem)
    y = slope.scaled.pack(x, lam)
    uphill = np.linalg.svd(slope.scaled(y)[1])[2][-1]  # of a singular derivative it is one of them
    uphill = uphill if slope(y, uphill) >= 0 else -uphill
    here, top = slope.at(y, uphill), None
    ahead = y + BESIDE_TOP * uphill
    corrected = correct(slope.scaled, ahead, uphill, float(uphill @ ahead), SEARCH.newton)
    if corrected.ok and corrected.tangent is not None:
        tangent = corrected.tangent * np.sign(corrected.tangent @ uphill) / norm(corrected.tangent)
        behind = slope.at(corrected.y, tangent)
        top = _pinned(slope, here, behind, False, SEARCH) if behind.slope < 0 else None
    return replace(top or _peak(slope, here), kink=False)


BESIDE_TOP = 1e-3
"""Scaled length of curve within which the top lies of a peak whose height is known to some seven digits."""


def _ahead(slope: _Slope, state: State, settings: Settings) -> Peak:
    """The highest point ahead on the curve, up to where g has fallen by `DIP` behind it.

    A peak lies between two points if g leaves the first one upwards and comes to the second one downwards; the root of
    its slope is the peak. It also does if g is higher at the one that it leaves or reaches the wrong way: kinks lie
    between, as where the root is not found or lower than either end. The step is then halved, down to `NARROW`.
    """
    there = slope.at(state.y, state.tangent)
    best, status, within = _peak(slope, there), "", settings
    while not status:
        after = advance(slope.problem, state, within)
        here = slope.at(after.y, after.tangent)
        leaves_up, comes_down = there.slope > 0, here.slope <= 0
        higher = here.value > there.value
        if after.found and (leaves_up and (comes_down or not higher) or comes_down and higher):
            top = _pinned(slope, there, here, after.found[-1].kink, settings) if leaves_up and comes_down else None
            length = min(norm(after.y - state.y), within.step_max)  # the step across a kink may be longer
            if top is None and length > NARROW:
                within = replace(settings, step_max=0.5 * length)
                continue
            top = top or _peak(slope, max(there, here, key=lambda one: one.value))
            best = top if top.value >= best.value else best
        within = settings
        if here.value > best.value:
            best = _peak(slope, here, "the peak is still ahead")
        if here.value < best.value * math.exp(-DIP):
            return best
        status, state, there = after.status, after, here
    return replace(best, status=best.status if best.converged else f"no peak before the end: {status}")


def with_peaks(problem: Rated, branch: Branch, height: Callable[[Array, float], float]) -> Branch:
    """A branch with the peaks of the output between its points, as points of the kind "peak": where its slope falls
    through zero beside a point that is higher than its neighbours.

    Args:
        height: (n,) and lambda -> any measure that rises with the output; it costs less than its derivative.
    """
    points, scaled, slope = list(branch.points), Scaled(problem), _Slope(problem)
    heights = np.array([height(p.x, p.lam) for p in points])
    tops = np.flatnonzero((heights[1:-1] >= heights[:-2]) & (heights[1:-1] >= heights[2:])) + 1
    added: dict[int, Point] = {}
    for i in tops:
        for at in (int(i) - 1, int(i)):
            first, last = points[at], points[at + 1]
            if last.arclength <= first.arclength or at in added:  # another curve begins here
                continue
            low, high = (slope.at(scaled.pack(p.x, p.lam), p.tangent) for p in (first, last))
            top = _pinned(slope, low, high, last.kink, SEARCH) if low.slope > 0 > high.slope else None
            if top is not None:
                way = norm(scaled.pack(top.x, top.lam) - low.y)
                added[at] = Point(top.x, top.lam, "peak", False, first.arclength + way, top.tangent, 0)
    for at in sorted(added, reverse=True):
        points.insert(at + 1, added[at])
    return replace(branch, points=tuple(points))


NARROW = 1e-6
"""Scaled length of curve between a rise and a fall at which the higher end is the peak."""


def _reversed(state: State) -> State:
    return replace(
        state,
        tangent=-state.tangent,
        orientation=-state.orientation,
        sense=-state.sense,
        origin_tangent=-state.origin_tangent,
    )


class _Place(NamedTuple):
    """A scaled point of the curve with its tangent, g, and d ln g / ds along the curve."""

    y: Array
    tangent: Array
    value: float
    slope: float


class _Slope:
    """d ln g / ds along the curve, at a scaled point and its tangent."""

    def __init__(self, problem: Rated) -> None:
        self.problem, self.scaled = problem, Scaled(problem)

    def __call__(self, y: Array, t: Array) -> float:
        return self.at(y, t).slope

    def at(self, y: Array, t: Array) -> _Place:
        x_scale, lam_scale = self.scaled.x_scale, self.scaled.lam_scale
        value, by_x, by_lam = self.problem.output(y[:-1] * x_scale, float(y[-1]) * lam_scale)
        return _Place(y, t, value, float((by_x * x_scale) @ t[:-1] + by_lam * lam_scale * t[-1]) / value)


def _pinned(slope: _Slope, low: _Place, high: _Place, bends: bool, settings: Settings) -> Peak | None:
    """The root of the slope between two places, if it is found and no lower than both: one of several may be."""
    segment = Segment(low.y, high.y, low.tangent, high.tangent, bends)
    try:
        y, t = root(slope.scaled, segment, settings, slope, 1e-6)  # where g is level
    except Lost:
        return None
    top = _peak(slope, slope.at(y, t))
    return top if top.value >= max(low.value, high.value) else None


def _peak(slope: _Slope, at: _Place, status: str = CONVERGED) -> Peak:
    """The peak at a place; where the slope is not small there, its sign jumps."""
    scaled, y = slope.scaled, at.y
    x, lam = y[:-1] * scaled.x_scale, float(y[-1]) * scaled.lam_scale
    return Peak(x, lam, at.value, abs(at.slope) > 1e-5 * max(1.0, norm(at.tangent)), status, at.tangent)


# over a parameter ----------------------------------------------------------------------------------------------------

Family = Callable[[float], Rated]
"""The problem at a value of the parameter. Unknowns and scales must mean the same at all of them."""


def rated(family: Family, value: float, peak: Peak) -> Peak:
    """The peak with the derivative of its height's logarithm, by differences of R and g at the peak's place."""
    if not peak.converged:
        return peak
    h = 1e-4 * (abs(value) or 1.0)
    problem = family(value)
    slope = _Slope(problem)
    scaled, y = slope.scaled, slope.scaled.pack(peak.x, peak.lam)
    _, D = scaled(y)
    sides = [family(value + way * h) for way in (1.0, -1.0)]
    R_p = (sides[0].evaluate(peak.x, peak.lam)[0] - sides[1].evaluate(peak.x, peak.lam)[0]) / (2 * h)
    g_p = math.log(sides[0].output(peak.x, peak.lam)[0] / sides[1].output(peak.x, peak.lam)[0]) / (2 * h)
    B = np.vstack([D, peak.tangent])
    try:
        moved = np.linalg.solve(B, -np.append(R_p, 0.0))
    except np.linalg.LinAlgError:
        moved = np.linalg.lstsq(B, -np.append(R_p, 0.0), rcond=None)[0]
    return replace(peak, rate=g_p + slope(y, moved))


@dataclass(frozen=True)
class Lowest:
    """Where a peak is lowest over a parameter.

    Attributes:
        parameter. peak: there. found: value -> peak of all that were looked at, rising.
        status: "converged": its derivative vanishes there; "kink": it jumps; "two peaks": one takes over from another;
            `NO_OPTIMUM`; else why no peak is known.
    """

    parameter: float
    peak: Peak
    status: str
    found: dict[float, Peak]


NO_OPTIMUM = "no optimum between the ends: the peak is lowest at one of them"
SAME = 5e-3
"""Relative difference of the places of what counts as one peak."""


def lowest(
    highest: Callable[[float], Peak], values: Sequence[float], tolerance: float = 1e-4, most: int = 12
) -> Lowest:
    """The value of a parameter at which the highest peak is lowest.

    It is found at all values; then between the lowest one and its neighbour on the side to which it falls, in turn
    where the tangents of both ends meet, which finds a kink, and where their rates say that it is level. Nothing is
    said to be lowest that another value which was looked at beats: contacts that switch point by point ripple the
    height, and the derivative with it.

    Args:
        highest: the highest peak at a value, `rated`. values: rising or falling. tolerance: of ln g, by
            which a lower peak would go unseen. most: peaks at most between the values.
    """
    peaks = {float(value): highest(float(value)) for value in values}
    ends = min(peaks), max(peaks)
    known = sorted(value for value, peak in peaks.items() if peak.converged)
    if not known:
        first = float(values[0])
        return Lowest(first, peaks[first], peaks[first].status, peaks)
    i = min(range(len(known)), key=lambda k: peaks[known[k]].value)
    at = i if peaks[known[i]].rate < 0 else i - 1
    status = NO_OPTIMUM
    if 0 <= at < len(known) - 1:
        status = _valley(highest, peaks, known[at], known[at + 1], tolerance, most)
    if status in ("kink", "two peaks"):
        _between(highest, peaks, most)
    peaks = dict(sorted(peaks.items()))
    best = min((value for value, peak in peaks.items() if peak.converged), key=lambda value: peaks[value].value)
    return Lowest(best, peaks[best], NO_OPTIMUM if best in ends else status, peaks)


NEAR = 5e-3
"""Relative distance of two values between which no other one is looked for."""


def _between(highest: Callable[[float], Peak], found: dict[float, Peak], most: int) -> None:
    """Adds peaks half way from the lowest one to its neighbours, until these are `NEAR`: the tangents at the ends of a
    kink know nothing of the ripples beside it."""
    for _ in range(most):
        known = sorted(value for value, peak in found.items() if peak.converged)
        i = min(range(len(known)), key=lambda k: found[known[k]].value)
        gaps = [(known[j] - known[i], j) for j in (i - 1, i + 1) if 0 <= j < len(known)]
        gap, j = max(gaps, key=lambda one: abs(one[0]))
        if abs(gap) <= NEAR * max(abs(known[i]), abs(known[j])):
            return
        middle = 0.5 * (known[i] + known[j])
        found[middle] = highest(middle)
        if not found[middle].converged:
            return


BESIDE = 0.01
"""Share of the way from one value to the other within which a place counts as beside an end."""


def _valley(
    highest: Callable[[float], Peak], found: dict[float, Peak], low: float, high: float, tolerance: float, most: int
) -> str:
    """Adds the peaks between two values until the tangents say that none is lower by more than the tolerance.

    They do where they meet well inside; beside an end they would where one bends the other way, at a kink, so that the
    other side is looked at, or until they are so short that they matter no more.
    """
    steep = min(abs(found[low].rate), abs(found[high].rate))
    if max(abs(found[low].rate), abs(found[high].rate)) * (high - low) <= tolerance:
        return CONVERGED  # level all the way
    for turn in range(most):
        left, right = found[low], found[high]
        width, falls, rises = high - low, left.rate, right.rate
        if low > 0:  # heights are nearly powers of what is positive
            width, falls, rises = math.log(high / low), low * falls, high * rises
        gap, bend = math.log(right.value / left.value), rises - falls
        meet = (rises * width - gap) / (bend * width) if bend > 0 else 0.0
        inside = BESIDE <= meet <= 1 - BESIDE
        if (inside and min(gap, 0.0) - falls * meet * width <= tolerance) or max(-falls, rises) * width <= tolerance:
            break
        share = min(max(meet, BESIDE), 1 - BESIDE) if turn % 2 == 0 else -falls / bend if inside else 0.5
        value = low * math.exp(share * width) if low > 0 else low + share * width
        here = found[value] = highest(value)
        if not here.converged:
            return f"lost between {low:g} and {high:g}: {here.status}"
        low, high = (value, high) if here.rate < 0 else (low, value)
    if min(abs(found[low].rate), abs(found[high].rate)) <= 0.1 * steep:
        return CONVERGED
    return "two peaks" if abs(found[low].lam / found[high].lam - 1) > SAME else "kink"

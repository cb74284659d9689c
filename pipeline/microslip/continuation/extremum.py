"""Peaks of an output along a curve of solutions, followed over a further parameter, and where they are lowest.

On the curve R(x, lambda) = 0 with unit tangent t an output g(x, lambda) has a peak where grad g . t falls through
zero. That holds where the curve overhangs as well, and where it has a kink: there the sign jumps. With a parameter p
of the problem the peak's height changes by the derivative

    dg/dp = g_p + grad g . dy/dp,    [dR/dy; t^T] dy/dp = [-R_p; 0]

which needs no second derivatives, because the motion of the peak along the curve changes nothing (the envelope
theorem). Its root is the optimum of p. At a kink it is no derivative, and the optimum is searched for by the values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy.optimize

from ..data import Array
from .curve import Lost, Segment, Settings, State, advance, root
from .newton import CONVERGED, Problem, Scaled, correct, norm, unit


class Rated(Problem, Protocol):
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
            curve, scaled. evaluations: of R.
    """

    x: Array
    lam: float
    value: float
    kink: bool
    status: str
    tangent: Array
    evaluations: int
    rate: float = math.nan

    @property
    def converged(self) -> bool:
        return self.status == CONVERGED


SEARCH = Settings(folds=False, branch_points=False, step=0.01)
"""How the curve is followed to its peak, if not told otherwise."""

DIP = 0.02
"""Fall of ln g behind a peak that ends the climb. Contacts that switch sample by sample make many small peaks on the
way up; the highest of those that lie within a smaller dip of each other is taken."""


def peak(problem: Rated, x: Array, lam: float, settings: Settings | None = None) -> Peak:
    """The peak uphill from a guess (n,) at lambda, whichever way that is. One that fails says why."""
    settings, scaled = settings or SEARCH, Scaled(problem)
    y = scaled.pack(x, lam)
    return _from(problem, y, unit(len(y)), settings)


def _from(problem: Rated, y: Array, border: Array, settings: Settings) -> Peak:
    """Uphill from a guess that is corrected with a border."""
    scaled = Scaled(problem)
    found = correct(scaled, y, border, float(border @ y), replace(settings.newton, iterations=40, last_resort=True))
    if not found.ok or found.tangent is None:
        x, lam = y[:-1] * scaled.x_scale, float(y[-1]) * scaled.lam_scale
        return Peak(x, lam, math.nan, False, f"no start: {found.status}", border, scaled.count)
    t, y = found.tangent / norm(found.tangent), found.y
    sense = 1 if t[-1] >= 0 else -1
    state = State(y, t, found.sign, settings.step, None, sense, y, t, 1, 0.0, ())
    return _climbed(problem, state, settings, scaled.count)


def _climbed(problem: Rated, state: State, settings: Settings, spent: int) -> Peak:
    """Uphill, and the other way too where that peak is hardly higher than the beginning."""
    slope = _Slope(problem)
    uphill = state if slope(state.y, state.tangent) >= 0 else _reversed(state)
    begun = math.log(slope.output(state.y)[0])
    found = _ahead(slope, uphill, settings, spent)
    if not found.converged or math.log(found.value) - begun > DIP:
        return found
    other = _ahead(slope, _reversed(uphill), settings, found.evaluations)
    return other if other.converged and other.value > found.value else replace(found, evaluations=other.evaluations)


def _ahead(slope: _Slope, state: State, settings: Settings, spent: int) -> Peak:
    """The highest point ahead on the curve, up to where g has fallen by `DIP` behind it.

    Between two points of the curve with a slope that changes from up to down its root is the peak.
    """
    best = _at(slope, state.y, state.tangent, spent)
    status = ""
    while not status:
        after = advance(slope.problem, state, settings)
        spent += after.found[-1].evaluations if after.found else 0
        if after.found and slope(state.y, state.tangent) > 0 >= slope(after.y, after.tangent):
            pinned = _pinned(slope, state, after, settings, spent)
            spent = pinned.evaluations
            best = pinned if pinned.value > best.value else best
        here = slope.output(after.y)[0]
        if here > best.value:
            best = _at(slope, after.y, after.tangent, spent, "the peak is still ahead")
        if here < best.value * math.exp(-DIP):
            return replace(best, evaluations=spent)
        status, state = after.status, after
    return replace(best, status=best.status if best.converged else f"no peak before the end: {status}")


def _reversed(state: State) -> State:
    return replace(
        state, tangent=-state.tangent, orientation=-state.orientation, sense=-state.sense,
        origin_tangent=-state.origin_tangent,
    )  # fmt: skip


class _Slope:
    """d ln g / ds along the curve, at a scaled point and its tangent."""

    def __init__(self, problem: Rated) -> None:
        self.problem, self.scaled = problem, Scaled(problem)

    def __call__(self, y: Array, t: Array) -> float:
        value, by_x, by_lam = self.output(y)
        return float((by_x * self.scaled.x_scale) @ t[:-1] + by_lam * self.scaled.lam_scale * t[-1]) / value

    def output(self, y: Array) -> tuple[float, Array, float]:
        return self.problem.output(y[:-1] * self.scaled.x_scale, float(y[-1]) * self.scaled.lam_scale)


def _pinned(slope: _Slope, state: State, after: State, settings: Settings, spent: int) -> Peak:
    bends = bool(after.found and after.found[-1].kink)
    segment = Segment(state.y, after.y, state.tangent, after.tangent, bends)
    try:
        y, t = root(slope.scaled, segment, settings, slope)
    except Lost:
        best = max(((state.y, state.tangent), (after.y, after.tangent)), key=lambda end: slope.output(end[0])[0])
        return replace(_at(slope, *best, spent), status="the curve was lost between two points about the peak")
    return _at(slope, y, t, spent + slope.scaled.count)


def _at(slope: _Slope, y: Array, t: Array, spent: int, status: str = CONVERGED) -> Peak:
    """The peak at a point; where the slope is not small there, its sign jumps."""
    scaled, steep = slope.scaled, abs(slope(y, t))
    x, lam = y[:-1] * scaled.x_scale, float(y[-1]) * scaled.lam_scale
    return Peak(x, lam, slope.output(y)[0], steep > 1e-5 * max(1.0, norm(t)), status, t, spent)


# over a parameter ----------------------------------------------------------------------------------------------------

Family = Callable[[float], Rated]
"""The problem at a value of the parameter. Unknowns and scales must mean the same at all of them."""


@dataclass(frozen=True)
class Ridge:
    """A peak followed over a parameter. Attributes: parameter: (k,). peaks: k. status: why it ended."""

    parameter: Array
    peaks: tuple[Peak, ...]
    status: str

    @property
    def lam(self) -> Array:
        """(k,) places of the peaks."""
        return np.array([p.lam for p in self.peaks])

    @property
    def value(self) -> Array:
        """(k,) their heights."""
        return np.array([p.value for p in self.peaks])

    @property
    def rate(self) -> Array:
        """(k,) derivative of the logarithm of their heights."""
        return np.array([p.rate for p in self.peaks])


@dataclass(frozen=True)
class Lowest:
    """The parameter at which a peak is lowest. status: "converged": its derivative vanishes there; "kink": it jumps;
    else what went wrong. evaluations: of R, the last search alone."""

    parameter: float
    peak: Peak
    status: str
    evaluations: int


def ridge(
    family: Family, first: Peak, values: Sequence[float], settings: Settings | None = None, jump: float = 0.3,
    halvings: int = 6, keep: Callable[[float, Peak], None] = lambda value, peak: None,
) -> Ridge:  # fmt: skip
    """A peak followed over a parameter, from the value where it is known through all others in turn.

    From each value to the next a step is predicted along the last two peaks, and halved while the search fails or ends
    farther from the prediction than ``jump`` (scaled; or a jump of the height's logarithm): on another peak.

    Args:
        first: the peak at values[0]. keep: is given every value and its peak as they are found.
    """
    settings = settings or SEARCH
    if not first.converged:
        return Ridge(np.array(values[:1], dtype=float), (first,), first.status)
    known = [(float(values[0]), rated(family, float(values[0]), first))]
    asked = [0]
    keep(*known[0])
    for value in values[1:]:
        reached = _reached(family, known, float(value), settings, jump, halvings)
        if not reached:
            last = known[-1][0]
            return _ridge(known, asked, f"ended at {last:g}: the peak was not found again beyond; it may merge there")
        asked.append(len(known) - 1)
        keep(*known[-1])
    return _ridge(known, asked, "complete")


def _ridge(known: list[tuple[float, Peak]], asked: list[int], status: str) -> Ridge:
    kept = [known[i] for i in asked]
    return Ridge(np.array([value for value, _ in kept]), tuple(peak for _, peak in kept), status)


def _reached(
    family: Family, known: list[tuple[float, Peak]], value: float, settings: Settings, jump: float, halvings: int
) -> bool:
    """Adds peaks to the known ones up to a value."""
    shortest = abs(value - known[-1][0]) * 0.5**halvings
    step = value - known[-1][0]
    while known[-1][0] != value:
        last = known[-1][0]
        there = value if abs(value - last) <= abs(step) * (1 + 1e-9) else last + step
        found = _stepped(family, known, there, settings, jump)
        if found is None:
            step *= 0.5
            if abs(step) < shortest:
                return False
        else:
            known.append((there, found))
            step *= 2.0
    return True


def _stepped(
    family: Family, known: list[tuple[float, Peak]], value: float, settings: Settings, jump: float
) -> Peak | None:
    """The peak at another value, if it is the same one."""
    problem = family(value)
    scaled = Scaled(problem)
    last = known[-1][1]
    here = scaled.pack(last.x, last.lam)
    guess = here
    if len(known) > 1:
        (before, other), now = known[-2], known[-1][0]
        guess = here + (value - now) / (now - before) * (here - scaled.pack(other.x, other.lam))
    starts = [guess, here] if len(known) > 1 else [here]
    for y in starts:
        found = _from(problem, y, last.tangent, settings)
        if found.converged:
            moved = norm(scaled.pack(found.x, found.lam) - y) / max(1.0, norm(y))
            if moved <= jump and abs(math.log(found.value / last.value)) <= 1.0:
                return rated(family, value, found)
    return None


def rated(family: Family, value: float, peak: Peak, share: float = 1e-4) -> Peak:
    """The peak with the derivative of its height's logarithm, by differences of R and g at the peak's place."""
    h = share * (abs(value) or 1.0)
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


def lowest(family: Family, ridge: Ridge, settings: Settings | None = None, tolerance: float = 1e-4) -> Lowest:
    """The value at which the followed peak is lowest: where the derivative of its height changes its sign, if no peak
    that is known is lower; else about the lowest of those, by the heights themselves. Never above a followed one.

    Contacts that switch point by point ripple the height, and the derivative changes its sign at every ripple.

    Args:
        tolerance: of the parameter, relative to its bracket. The height there errs by the square of it.
    """
    settings = settings or SEARCH
    falls = (ridge.rate[:-1] < 0) & (ridge.rate[1:] > 0)
    least, spent = int(np.argmin(ridge.value)), 0
    if falls.any():
        i = min(np.flatnonzero(falls), key=lambda k: min(ridge.value[k], ridge.value[k + 1]))
        found = _between_two(family, ridge, int(i), settings, tolerance)
        if found.peak.value <= ridge.value[least]:
            return found
        spent = found.evaluations
    if least in (0, len(ridge.peaks) - 1):
        return Lowest(float(ridge.parameter[least]), ridge.peaks[least], NO_OPTIMUM, spent)
    return _by_heights(_Between(family, ridge, slice(least - 1, least + 2), settings), tolerance, spent)


class _Between:
    """Peaks between some that were followed. Attributes: found: value -> peak. spent: evaluations of R."""

    def __init__(self, family: Family, ridge: Ridge, which: slice, settings: Settings) -> None:
        self.family, self.settings, self.spent = family, settings, 0
        self.found = dict(zip(ridge.parameter[which].tolist(), ridge.peaks[which], strict=True))

    def __call__(self, value: float) -> Peak:
        """The peak at a value, from those next to it.

        Raises:
            Lost: it is not found.
        """
        if value not in self.found:
            near = sorted(self.found.items(), key=lambda item: -abs(item[0] - value))
            here = _stepped(self.family, near[-2:], value, self.settings, 1.0) or _stepped(
                self.family, near[-1:], value, self.settings, 1.0
            )
            if here is None:
                raise Lost
            self.found[value] = here
            self.spent += here.evaluations
        return self.found[value]

    @property
    def least(self) -> float:
        """The value with the lowest of all peaks."""
        return min(self.found, key=lambda value: self.found[value].value)


NO_OPTIMUM = "no optimum between the ends: the peak is lowest at one of them"
LOST = "the peak was lost on the way to its lowest place"


def _between_two(family: Family, ridge: Ridge, i: int, settings: Settings, tolerance: float) -> Lowest:
    low, high = float(ridge.parameter[i]), float(ridge.parameter[i + 1])
    at = _Between(family, ridge, slice(i, i + 2), settings)
    try:
        best = float(
            scipy.optimize.brentq(lambda v: at(v).rate, low, high, xtol=tolerance * abs(high - low), rtol=1e-12)
        )
        at(best)
    except Lost:
        return Lowest(at.least, at.found[at.least], LOST, at.spent)
    steep = min(abs(ridge.rate[i]), abs(ridge.rate[i + 1]))
    status = CONVERGED if abs(at.found[best].rate) <= 1e-3 * steep else "kink"
    return Lowest(best, at.found[best], status, at.spent)


def _by_heights(at: _Between, tolerance: float, spent: int) -> Lowest:
    """Where the peak is lowest beside a followed one that is lower than both its neighbours: a golden section, which
    knows the lowest one from the beginning and keeps the lowest of all that it sees."""
    low, middle, high = sorted(at.found)
    ends = abs(at.found[low].rate), abs(at.found[high].rate)
    status, options = "", {"xtol": tolerance, "maxiter": 20}

    def height(value: float) -> float:
        return at(float(value)).value

    try:
        scipy.optimize.minimize_scalar(height, (low, middle, high), method="golden", options=options)
    except Lost:
        status = LOST
    best = at.found[at.least]
    smooth = abs(best.rate) <= 1e-3 * min(ends)
    return Lowest(at.least, best, status or (CONVERGED if smooth else "kink"), spent + at.spent)



"""Branches of periodic orbits: followed point by point, with the bifurcations passed on the way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..continuation import Lost, Scaled, Segment, Settings, advance, root
from ..continuation.curve import State
from ..data import Array, ComplexArray
from . import floquet
from .shooting import Orbit, Shooting

Kind = Literal["start", "regular", "fold", "period doubling", "torus", "branch point", "target", "bound"]


@dataclass(frozen=True)
class Found:
    """An orbit of a branch, its Floquet multipliers (`floquet.multipliers`), and what happens there."""

    orbit: Orbit
    multipliers: ComplexArray
    kind: Kind

    @property
    def stable(self) -> bool:
        return floquet.is_stable(self.multipliers)


COLLAPSED = "collapsed: the branch is back where it was born, or ends at another point of that kind"


def extremes(y: Array, closed: bool = True) -> tuple[Array, Array]:
    """Largest and smallest values (w,) of a smooth motion by its samples (s, w) at equal times: of the parabola through
    the outermost sample and its neighbours. What it misses falls with the third power of the step where the motion is
    smooth, what the samples miss with the second. closed: the last sample is followed by the first."""
    return _top(y, closed), -_top(-y, closed)


def _top(y: Array, closed: bool) -> Array:
    s, row = len(y), np.arange(y.shape[1])
    i = np.argmax(y, axis=0)
    before, here, after = y[i - 1, row], y[i, row], y[(i + 1) % s, row]
    bend = 2 * here - before - after
    smooth = (bend > 0) & (closed | (i > 0) & (i < s - 1))
    return here + np.where(smooth, (after - before) ** 2 / (8 * np.where(smooth, bend, 1.0)), 0.0)


def follow(problem: Shooting, state: State, settings: Settings) -> Iterator[tuple[list[Found], str]]:
    """What each step along a branch finds, in order, and why the branch ended ("" while it goes on).

    The phase of every step counts from the orbit before it, so that no orbit is too far from the reference.
    """
    previous = None
    here = _found(problem, state.y, "start")
    yield [here] if not state.status else [], state.status
    while not state.status:
        previous, state = state, advance(problem, state, settings)
        if state.status.startswith("stuck"):
            yield [], state.status
            return
        found = [_at(problem, p.x, p.lam, p.kind) for p in state.found]
        last = found[-1] if found else here
        passed = _passed(problem, previous, state, here, last, settings) if found else []
        passed = [one for one in passed if settings.low <= one.orbit.p <= settings.high]
        ended = state.status or _collapsed(problem, here.orbit, last.orbit)
        if ended == COLLAPSED:
            yield [], ended
            return
        yield sorted([*passed, *found], key=lambda one: _ahead(problem, previous, one)), ended
        here = last
        problem = replace(problem, reference=here.orbit)


def _found(problem: Shooting, y: Array, kind: Kind) -> Found:
    scaled = Scaled(problem)
    return _at(problem, y[:-1] * scaled.x_scale, float(y[-1] * scaled.lam_scale), kind)


def _at(problem: Shooting, x: Array, lam: float, kind: Kind) -> Found:
    orbit = problem.orbit(x, lam)
    return Found(orbit, floquet.multipliers(orbit), kind)


def _ahead(problem: Shooting, state: State, one: Found) -> float:
    """How far along the tangent of a state."""
    return float(state.tangent @ (Scaled(problem).pack(problem.unknowns(one.orbit), one.orbit.p) - state.y))


TESTS: dict[Kind, Callable[[ComplexArray], float]] = {
    "period doubling": floquet.doubling,
    "torus": floquet.torus,
}


def _passed(
    problem: Shooting, before: State, after: State, first: Found, last: Found, settings: Settings
) -> list[Found]:  # fmt: skip
    """Period doublings and torus points between two neighbouring states."""
    segment = Segment(before.y, after.y, before.tangent, after.tangent, False)
    found = []
    for kind, test in TESTS.items():
        if test(first.multipliers) * test(last.multipliers) >= 0:
            continue

        def value(y: Array, _: Array, test: Callable[[ComplexArray], float] = test) -> float:
            return test(_found(problem, y, "regular").multipliers)

        try:
            one = _found(problem, root(Scaled(problem), segment, settings, value)[0], kind)
        except Lost:
            continue
        if kind != "torus" or floquet.passing_pair(one.multipliers) is not None:
            found.append(one)
    return found


def _collapsed(problem: Shooting, before: Orbit, after: Orbit) -> str:
    """Whether the branch has passed the point where its orbits are no more than an equilibrium, or one half of them:
    what they are beside that then has the opposite sign."""
    swing = [o.x - o.x.mean(axis=0) for o in (before, after)]
    if problem.free and _opposed(problem, *swing):
        return COLLAPSED
    half = len(before.x) // 2
    if before.turns % 2 == 0 and len(before.x) % 2 == 0:
        other = [o.x[:half] - o.x[half:] for o in (before, after)]
        if _opposed(problem, *other):
            return COLLAPSED
    return ""


def _opposed(problem: Shooting, one: Array, other: Array) -> bool:
    size = np.asarray(problem.system.scale)
    return float(((one / size) * (other / size)).sum()) < 0

"""Branches of periodic orbits: begun at a Hopf point or where a period doubles, followed point by point, with the
bifurcations passed on the way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..continuation import Lost, Scaled, Segment, Settings, advance, branch_off, root
from ..continuation.curve import Kind as CurveKind
from ..continuation.curve import State
from ..data import Array, ComplexArray
from .dynamics import Dynamics
from .equilibria import Hopf
from .shooting import PeriodicOrbit, Shooting

Kind = CurveKind | Literal["torus"]


@dataclass(frozen=True)
class OrbitPoint:
    """An orbit of a branch, and what happens there."""

    orbit: PeriodicOrbit
    kind: Kind

    @property
    def multipliers(self) -> ComplexArray:
        return self.orbit.multipliers

    @property
    def stable(self) -> bool:
        return self.orbit.stable


CENTRE = "centre: orbits of every size are at one value of the parameter"
HOMOCLINIC = "near a homoclinic orbit: the period grows at one value of the parameter"

EVERY = 100
"""Orbits at one value of the parameter that are enough to say so."""

OFF = 2e-3
"""Size of the first step off a branch, in scales of the coordinates."""


def born_at(system: Dynamics, hopf: Hopf, nodes: int, settings: Settings) -> tuple[Shooting, State]:
    """The orbits born at a Hopf point: their equations, and the first of them."""
    turn = np.exp(2j * np.pi * np.arange(nodes) / nodes)
    way = (turn[:, None] * hopf.shape).real
    way = way / np.sqrt(np.mean((way / np.asarray(system.scale)) ** 2) * system.count)
    guess = PeriodicOrbit(system, hopf.x + OFF * way, 2 * np.pi / hopf.omega, hopf.p)
    problem = Shooting(system, guess, guess.period)
    ahead = np.append(way, 0.0), 0.0
    return problem, branch_off(problem, problem.unknowns(guess), hopf.p, ahead, settings)


def doubled_at(orbit: PeriodicOrbit, settings: Settings) -> tuple[Shooting, State]:
    """The orbits of twice the period that are born where a Floquet multiplier passes -1, and the first of them."""
    values, vectors = np.linalg.eig(orbit.monodromy)
    first = vectors[:, np.argmin(np.abs(values + 1))].real
    ways = [first]
    for piece in orbit.derivatives[:-1]:
        ways.append(piece @ ways[-1])
    half = np.array(ways)
    way: Array = np.concatenate([half, -half])
    way = way / np.sqrt(np.mean((way / np.asarray(orbit.system.scale)) ** 2) * orbit.system.count)
    twice = np.concatenate([orbit.x, orbit.x]) + OFF * way
    guess = PeriodicOrbit(orbit.system, twice, 2 * orbit.period, orbit.p, 2 * orbit.turns)
    problem = Shooting(orbit.system, guess, guess.period)
    ahead = np.append(way, 0.0) if problem.free else way.ravel(), 0.0
    return problem, branch_off(problem, problem.unknowns(guess), orbit.p, ahead, settings)


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


def follow(problem: Shooting, state: State, settings: Settings) -> Iterator[tuple[list[OrbitPoint], str]]:
    """What each step along a branch finds, in order, and why the branch ended ("" while it goes on).

    The phase of every step counts from the orbit before it, so that no orbit is too far from the reference.
    """
    previous = None
    here, met = _found(problem, state.y, "start"), list[PeriodicOrbit]()
    yield [here] if not state.status else [], state.status
    while not state.status:
        previous, state = state, advance(problem, state, settings)
        if state.status.startswith("stuck"):
            yield [], state.status
            return
        points = [OrbitPoint(problem.orbit(p.x, p.lam), p.kind) for p in state.found]
        last = points[-1] if points else here
        passed = _passed(problem, previous, state, here, last, settings) if points else []
        passed = [one for one in passed if settings.low <= one.orbit.p <= settings.high]
        ended = state.status or _collapsed(problem, here.orbit, last.orbit)
        met = [*met, last.orbit][-EVERY:]
        still = np.ptp([of.p for of in met]) <= 1e-8 * problem.system.parameter_scale
        if not ended and len(met) == EVERY and still:
            first, size = met[0], [np.ptp(of.x, axis=0).max() for of in met]
            grows = size[-1] > 1.05 * size[0] or last.orbit.period < 1.05 * first.period
            ended = f"{CENTRE if grows else HOMOCLINIC}, {last.orbit.p:.6g}"
        if ended == COLLAPSED:
            yield [], ended
            return
        yield sorted([*passed, *points], key=lambda one: _ahead(problem, previous, one)), ended
        if ended:
            return
        here = last
        problem = replace(problem, reference=here.orbit)


def _found(problem: Shooting, y: Array, kind: Kind) -> OrbitPoint:
    scaled = Scaled(problem)
    return OrbitPoint(problem.orbit(y[:-1] * scaled.x_scale, float(y[-1] * scaled.lam_scale)), kind)


def _ahead(problem: Shooting, state: State, one: OrbitPoint) -> float:
    """How far along the tangent of a state."""
    return float(state.tangent @ (Scaled(problem).pack(problem.unknowns(one.orbit), one.orbit.p) - state.y))


def doubling(multipliers: ComplexArray) -> float:
    """Changes its sign where a multiplier passes -1."""
    return float(np.prod(1 + multipliers).real)


def torus(multipliers: ComplexArray) -> float:
    """Changes its sign where a pair passes the unit circle, or two real ones of the product 1."""
    i, j = np.triu_indices(len(multipliers), 1)
    return float(np.prod(multipliers[i] * multipliers[j] - 1).real)


def _is_torus(multipliers: ComplexArray) -> bool:
    """Whether `torus` is zero by a complex pair on the unit circle, and not by two real multipliers."""
    pairs = multipliers[np.abs(multipliers.imag) > 1e-7 * np.abs(multipliers)]
    return bool(np.abs(np.abs(pairs) - 1).min(initial=np.inf) < 1e-5)


TESTS: dict[Kind, Callable[[ComplexArray], float]] = {"period doubling": doubling, "torus": torus}


def _passed(
    problem: Shooting, before: State, after: State, first: OrbitPoint, last: OrbitPoint, settings: Settings
) -> list[OrbitPoint]:  # fmt: skip
    """Period doublings and torus points between two neighbouring states."""
    segment = Segment(before.y, after.y, before.tangent, after.tangent, False)
    points = []
    for kind, test in TESTS.items():
        if test(first.multipliers) * test(last.multipliers) >= 0:
            continue

        def value(y: Array, _: Array, test: Callable[[ComplexArray], float] = test) -> float:
            return test(_found(problem, y, "regular").multipliers)

        try:
            point = _found(problem, root(Scaled(problem), segment, settings, value)[0], kind)
        except Lost:
            continue
        if kind != "torus" or _is_torus(point.multipliers):
            points.append(point)
    return points


def _collapsed(problem: Shooting, before: PeriodicOrbit, after: PeriodicOrbit) -> str:
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

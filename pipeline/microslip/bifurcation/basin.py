"""Attractors: what motions from many starts come to, found without knowing any branch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..continuation import newton
from ..data import Array
from ..interrupts import look
from . import equilibria, flow
from .dynamics import Dynamics
from .orbits import extremes
from .shooting import PeriodicOrbit, Shooting

SETTLE, WATCH = 60, 10
"""Slow periods of the equilibrium that motions are left alone, and in which they are to come back."""

EACH = 48
"""Times of a slow period at which they are looked at."""

BACK = 0.03
"""Distance over the scales at which a motion has come back."""

ALIKE = 1e-3
"""Difference of periods and extremes, over their sizes, up to which two orbits are the same."""


@dataclass(frozen=True)
class Attractor:
    """A stable orbit. Attributes: orbit. share: of the starts that came to it. swing: (w,) half of the way from the
    smallest to the largest value of the read-outs in the last period of the first motion that did."""

    orbit: PeriodicOrbit
    share: float
    swing: Array


def starts(system: Dynamics, centre: Array, count: int, seed: int, width: float = 3.0) -> Array:
    """(count, n) evenly in a box around a centre, so many scales to either side."""
    random = np.random.default_rng(seed)
    return centre + width * np.asarray(system.scale) * random.uniform(-1, 1, (count, system.count))


def attractors(system: Dynamics, centre: Array, p: float, count: int, seed: int, nodes: int) -> list[Attractor]:
    """The stable periodic orbits that motions from around a centre (n,) come to.

    Of a free system; a motion that does not come back in `WATCH` slow periods, chaos say, is no orbit.
    """
    rates = np.abs(equilibria.eigenvalues(system, centre, p).imag)
    slow = float(2 * np.pi / rates[rates > 1e-6 * rates.max()].min())  # s, the longest period of small vibrations
    run = flow.left_alone(system)
    x = np.asarray(run(starts(system, centre, count, seed), p, SETTLE * slow, 0.0))
    seen = [x]
    for _ in range(WATCH * EACH):
        look()
        seen.append(np.asarray(run(seen[-1], p, slow / EACH, 0.0)))
    ways = np.swapaxes(np.array(seen), 0, 1)
    orbits_found: list[PeriodicOrbit] = []
    counts: list[int] = []
    swings: list[Array] = []
    for way in ways:
        for orbit in _closed(system, way, p, slow / EACH, nodes, orbits_found):
            same = next((i for i, orbit_before in enumerate(orbits_found) if alike(orbit_before, orbit)), None)
            if same is None:
                orbits_found.append(orbit)
                counts.append(1)
                last = way[-int(np.ceil(orbit.period * EACH / slow)) - 1 :]
                largest, smallest = extremes(system.seen(last, p), closed=False)
                swings.append(0.5 * (largest - smallest))
            else:
                counts[same] += 1
    return [Attractor(o, n / count, y) for o, n, y in zip(orbits_found, counts, swings, strict=True)]


def _closed(
    system: Dynamics, way: Array, p: float, step: float, nodes: int, known: list[PeriodicOrbit]
) -> list[PeriodicOrbit]:
    """The orbit that a motion (times, n) has come to, if it is one and stable; one of the known ones where it has its
    extremes."""
    size = np.asarray(system.scale)
    if not np.isfinite(way).all() or np.ptp(way / size, axis=0).max() < 10 * BACK:
        return []
    for orbit_before in known:
        last, sampled = way[-int(np.ceil(orbit_before.period / step)) - 1 :], orbit_before.sampled(2)
        ends = np.abs(_extremes(last) - _extremes(sampled)).max() < 3 * BACK * size.max()
        if ends and np.abs(np.ptp(last, axis=0) - np.ptp(sampled, axis=0)).max() < BACK * size.max():
            return [orbit_before]
    away = np.abs((way - way[0]) / size).max(axis=1)
    back = [i for i in range(2, len(away) - 1)
            if away[i] <= away[i - 1] and away[i] <= away[i + 1] and away[i] < 0.1 * away[:i].max()]  # fmt: skip
    for i in back:
        at = np.linspace(0, i, nodes, endpoint=False)
        x = np.array([np.interp(at, np.arange(len(way)), column) for column in way.T]).T
        guess = PeriodicOrbit(system, x, i * step, p)
        problem = Shooting(system, guess, guess.period)
        solution = newton(problem, problem.unknowns(guess), p)
        if not solution.converged:
            continue
        orbit = problem.orbit(solution.x, p)
        near = np.abs(_extremes(orbit.x) - _extremes(x)).max() < 10 * BACK * size.max()
        if near and orbit.stable:
            return [orbit]
    return []


def _extremes(x: Array) -> Array:
    """(2, n) of samples (s, n)."""
    return np.array([x.max(axis=0), x.min(axis=0)])


def alike(one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    """Whether two orbits are the same, whatever their phases."""
    size = np.asarray(one.system.scale)
    apart = np.abs(_extremes(one.sampled()) - _extremes(other.sampled())) / size
    return abs(one.period / other.period - 1) < ALIKE and float(apart.max()) < 10 * ALIKE

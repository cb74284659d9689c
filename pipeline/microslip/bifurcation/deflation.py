"""Deflation: periodic orbits beside those that are known, stable or not, at one value of the parameter.

With the distances d_k(x) to the known solutions, Newton's method solves

    prod over k of (1 + 1 / d_k(x)^2) F(x) = 0,

F being the equations of shooting: a known solution is none of these (P. E. Farrell, A. Birkisson, S. W. Funke, SIAM J.
Sci. Comput. 37, 2015, A2026-A2045, with the power 2 and the shift 1). What is known is an orbit at any shift in time
and run through any number of times, or an equilibrium, which has every period: d_k is the least distance to all these.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.interpolate

from ..continuation import Equations, NewtonSettings, newton
from ..data import Array
from ..progress import Report
from .dynamics import Dynamics
from .orbits import OrbitPoint
from .shooting import PeriodicOrbit, Shooting

REPEATS = 12
"""Times up to which an orbit that is run through several times is seen to be."""

GUESSES = 200
"""At most: where motions are chaotic, orbits have no end."""

EACH = 16
"""Samples between two nodes, through which a known orbit is a spline."""

NEAR = 1e-3
"""Distance over the scales up to which an orbit is known."""

BETWEEN = (0.25, 0.5, 0.75)
"""Shares of the way from one known solution to another at which guesses are made."""

BEYOND = (1.5, 3.0)
"""Times a known orbit's distance from the equilibrium of further guesses."""

LARGER, LATER = (1.0, 3.0, 10.0), (0.25, 0.5, 0.75)
"""Times a driven orbit's distance from where it begins, and shifts in periods, of further guesses."""

SIZES = (0.1, 0.3, 1.0, 3.0)
"""Of the small vibrations that are guesses, in scales."""

TRIES = NewtonSettings(iterations=25, halvings=4, forced=0, last_resort=False)
"""A guess that leads somewhere does so soon, and most lead nowhere."""


@dataclass(frozen=True, eq=False)
class KnownSolution:
    """A known solution: an orbit, or where an equilibrium is. Attributes: orbit. still: (n,)."""

    system: Dynamics
    orbit: PeriodicOrbit | None = None
    still: Array | None = None

    @cached_property
    def _way(self) -> scipy.interpolate.CubicSpline:
        """The orbit over periods, over the scales."""
        assert self.orbit is not None
        x = self.orbit.sampled(EACH) / np.asarray(self.system.scale)
        return scipy.interpolate.CubicSpline(np.linspace(0, 1, len(x) + 1), np.vstack([x, x[:1]]), bc_type="periodic")

    def at(self, nodes: int, shift: float = 0.0, repeats: int = 1, order: int = 0) -> Array:
        """(m, n) at equal times, over the scales: the orbit or its derivative over periods."""
        return np.asarray(self._way(np.mod(shift + repeats * np.arange(nodes) / nodes, 1.0), order))

    def shift(self, x: Array, repeats: int = 1) -> float:
        """In periods, at which the orbit is nearest to nodes (m, n) over the scales; 0 where something drives."""
        assert self.orbit is not None
        if self.system.frequency is not None:
            return 0.0
        tried = np.arange(8 * len(x)) / (8 * len(x))
        best = tried[int(np.argmin([np.square(x - self.at(len(x), s, repeats)).sum() for s in tried]))]
        for _ in range(5):
            off, moving = self.at(len(x), best, repeats) - x, self.at(len(x), best, repeats, 1)
            bend = float(np.square(moving).sum() + (off * self.at(len(x), best, repeats, 2)).sum())
            most = 0.1 / len(x)
            best -= float(np.clip((off * moving).sum() / bend, -most, most)) if bend > 0 else 0.0
        return float(best)

    def distance(self, nodes: Array, period: float) -> tuple[float, Array, float]:
        """d^2, and its derivatives over nodes (m, n) and the period."""
        size = np.asarray(self.system.scale)
        x, m = nodes / size, len(nodes)
        if self.orbit is None:
            off = x - np.asarray(self.still) / size
            return float(np.square(off).sum() / m), 2 * off / size / m, 0.0
        free = self.system.frequency is None
        repeats = max(round(period / self.orbit.period), 1) if free else 1
        whole = repeats * self.orbit.period
        off = x - self.at(m, self.shift(x, repeats), repeats)
        longer = (period / whole - 1) if free else 0.0
        return float(np.square(off).sum() / m + longer**2), 2 * off / size / m, 2 * longer / whole


@dataclass(frozen=True, eq=False)
class Deflated:
    """The equations of shooting, deflated: `continuation.Equations`."""

    problem: Shooting
    known: Sequence[KnownSolution]

    @property
    def x_scale(self) -> Array:
        return self.problem.x_scale

    @property
    def lam_scale(self) -> float:
        return self.problem.lam_scale

    def evaluate(self, x: Array, lam: float) -> tuple[Array, Array, Array]:
        R, J, slope = self.problem.evaluate(x, lam)
        if not np.isfinite(R).all():
            return R, J, slope
        orbit, factor, change = self.problem.orbit(x, lam), 1.0, np.zeros(len(x))
        for place in self.known:
            d2, over, longer = place.distance(orbit.x, orbit.period)
            d2 = max(d2, 1e-300)
            factor *= 1 + 1 / d2
            change -= (np.append(over, longer) if self.problem.free else over.ravel()) / (d2 * (d2 + 1))
        return factor * R, factor * (J + np.outer(R, change)), factor * slope


def coexisting(
    system: Dynamics, p: float, still: Sequence[Array], orbits: Sequence[PeriodicOrbit], nodes: int,
    report: Report = lambda _: None,
) -> list[OrbitPoint]:  # fmt: skip
    """Periodic orbits at p that are none of the known ones, with their multipliers.

    From guesses between all that is known, and small vibrations; what is found is known for the guesses after it, and
    makes guesses of its own, until none leads to a further one. That there is none besides is no proof.

    Args:
        still: (n,) equilibria, or of a driven system a point from which guesses begin. orbits: known at p.
    """
    known = [
        *(KnownSolution(system, still=x) for x in still),
        *(KnownSolution(system, orbit=orbit) for orbit in orbits),
    ]
    points, left, tried = list[OrbitPoint](), list(_first(system, p, known, nodes)), 0
    while left and tried < GUESSES:
        guess, tried = left.pop(0), tried + 1
        orbit = _another(guess, [k for k in known if k.orbit or system.frequency is None])
        report(f"deflation at {p:.6g}: {len(points)} orbits from {tried} guesses, {len(left)} left")
        if orbit is not None:
            points.append(OrbitPoint(orbit, "target"))
            place = KnownSolution(system, orbit=orbit)
            left += _between(place, known, nodes)
            known.append(place)
    return points


def _another(guess: PeriodicOrbit, known: Sequence[KnownSolution]) -> PeriodicOrbit | None:
    """The orbit to which Newton's method leads from a guess, by the deflated equations and then by those of shooting
    alone; None where it leads nowhere, or to what is known."""
    problem: Shooting = Shooting(guess.system, guess, guess.period)
    equations: Equations = Deflated(problem, known)
    solution = newton(equations, problem.unknowns(guess), guess.p, TRIES)
    if not solution.converged:
        return None
    once = _shortened(problem.orbit(solution.x, guess.p))
    again = Shooting(guess.system, once, guess.period)
    solution = newton(again, again.unknowns(once), guess.p, TRIES)
    orbit = again.orbit(solution.x, guess.p)
    if not solution.converged or orbit.period < 1e-3 * guess.period:
        return None
    swings = np.ptp(orbit.x / np.asarray(orbit.system.scale), axis=0).max() > NEAR
    new = all(place.distance(orbit.x, orbit.period)[0] > NEAR**2 for place in known)
    return orbit if swings and new else None


def _shortened(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """The orbit run through once."""
    if orbit.system.frequency is not None:
        return orbit
    place, m = KnownSolution(orbit.system, orbit=orbit), len(orbit.x)
    x = place.at(m)
    times = [k for k in range(2, REPEATS + 1) if np.abs(place.at(m, 1 / k) - x).max() < NEAR]
    if not times:
        return orbit
    nodes = place.at(m * times[-1])[:m] * np.asarray(orbit.system.scale)
    return replace(orbit, x=nodes, period=orbit.period / times[-1])


def _first(system: Dynamics, p: float, known: Sequence[KnownSolution], nodes: int) -> Iterator[PeriodicOrbit]:
    """Guesses between all that is known, and vibrations of every pair of roots of the equilibria."""
    for i, place in enumerate(known):
        yield from _between(place, known[:i], nodes)
    for place in known:
        if place.still is None:
            continue
        if system.frequency is not None:
            yield PeriodicOrbit(system, np.tile(place.still, (nodes, 1)), 2 * np.pi / float(system.frequency(p)), p)
            continue
        values, vectors = np.linalg.eig(np.asarray(system.still(place.still, p)[1]))
        turn = np.exp(2j * np.pi * np.arange(nodes) / nodes)[:, None]
        for k in np.flatnonzero(values.imag > 1e-6 * np.abs(values).max()):
            way = (turn * vectors[:, k]).real
            way /= np.sqrt(np.mean((way / np.asarray(system.scale)) ** 2) * system.count)
            for size in SIZES:
                yield PeriodicOrbit(system, place.still + size * way, 2 * np.pi / float(values[k].imag), p)


def _between(place: KnownSolution, others: Sequence[KnownSolution], nodes: int) -> Iterator[PeriodicOrbit]:
    """Guesses on the straight way from one known solution to others, and beyond orbits, away from equilibria."""
    if place.orbit is None:
        return
    size, one = np.asarray(place.system.scale), place.orbit
    x = place.at(nodes)
    for other in others:
        if other.orbit is None:
            y, period = np.asarray(other.still) / size, one.period
            if place.system.frequency is not None:  # what resonates is larger and of another phase
                for u, late in itertools.product(LARGER, LATER):
                    later = np.roll(x, round(late * nodes), axis=0)
                    yield PeriodicOrbit(one.system, size * (y + u * (later - y)), period, one.p)
        else:
            y, period = other.at(nodes, other.shift(x)), other.orbit.period
        for u in BETWEEN if other.orbit else (*BETWEEN, *BEYOND):
            yield PeriodicOrbit(one.system, size * (y + u * (x - y)), period + u * (one.period - period), one.p)

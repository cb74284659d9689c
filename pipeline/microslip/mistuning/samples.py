"""One mistuned ring after the other: what of its blades is highest, and all of them on the frequencies of the sweep."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from .. import series
from ..data import Array, ComplexArray, ModalGroup
from ..harmonic_balance import problem as balance
from ..harmonic_balance import reduced
from ..harmonic_balance.forces import Forces
from ..harmonic_balance.problem import AtFrequency, Problem
from ..harmonic_balance.reduced import Seen
from ..harmonic_balance.solver import Point, among, carried, solve, sweep
from ..operating.stress import counted
from ..system.assembly import Assembly
from .peaks import Highest, highest
from .ring import Deviations, Tuned
from .scatter import Scatter


@dataclass(frozen=True, eq=False)
class Asked:
    """What is asked of every sample.

    Attributes:
        tuned. scatter. frequency: (f,) Hz. seed. balance: of `harmonic_balance.problem.of`: harmonics, samples, ...
        stuck: contacts stick, whatever their friction. models: of its contacts, from a ring; None: their laws, marched.
    """

    tuned: Tuned
    scatter: tuple[Scatter, ...]
    frequency: Array
    seed: int = 0
    balance: Mapping[str, Any] = field(default_factory=dict)
    stuck: bool = False
    models: Callable[[Assembly], Mapping[int, Forces]] | None = None

    def problem(self, ring: Assembly) -> Problem:
        """The balance of a whole ring, all in the same units."""
        models = None if self.models is None else dict(self.models(ring))
        return balance.of(ring, form="sides", length=balance.moves_by(self.tuned.whole), models=models, **self.balance)

    @cached_property
    def tuned_points(self) -> list[Point]:
        """Solutions of the ring of equal sectors on the frequencies: what samples start from."""
        return [] if self.stuck else [p for p in sweep(self.problem(self.tuned.whole), self.frequency) if p.converged]

    def deviations(self, sample: int) -> Deviations:
        """Of a sample: the same, whoever asks."""
        N = self.tuned.sectors
        return [(s, s.drawn(N, self.tuned.modes(s), i, self.seed, sample)) for i, s in enumerate(self.scatter)]


@dataclass(frozen=True)
class Sample:
    """Attributes:
    number. top: see `Highest`; its read-outs are those of the sectors, one each. grid: (f, sectors) amplitudes on the
        frequencies asked for, NaN where there is no solution. stress, strain: at the highest peak, see `worst`. alone:
        whether the solver of single rings was needed.
    """

    number: int
    top: Highest
    grid: Array
    stress: float = np.nan
    strain: float = np.nan
    alone: bool = True

    @property
    def localisation(self) -> float:
        """Share of the sum of squares that is the highest blade's, at its peak: 1/N of blades that move alike, 1 of
        one that moves alone."""
        at = int(np.abs(self.top.frequencies - self.top.frequency).argmin())
        y = self.top.amplitudes[at] ** 2
        return float(y.max() / y.sum())


def sample(asked: Asked, number: int) -> Sample:
    """One ring of the ensemble."""
    return of_ring(asked, asked.tuned.mistuned(asked.deviations(number)), number)


def of_ring(asked: Asked, ring: Assembly, number: int = 0) -> Sample:
    """A whole ring: its highest blade over the frequency."""
    top, respond = _searched(asked, ring, asked.frequency)
    strained = worst(ring, respond.coordinates(top.frequency)) if np.isfinite(top.amplitude) else ()
    return Sample(number, top, on_sweep(asked, top), *strained)


def on_sweep(asked: Asked, top: Highest) -> Array:
    """(f, sectors) amplitudes on the frequencies asked for, NaN where there is no solution."""
    nothing = np.full(asked.tuned.sectors, np.nan)
    known = dict(zip(top.frequencies.tolist(), top.amplitudes, strict=True))
    return np.array([known.get(float(f), nothing) for f in asked.frequency])


def _searched(asked: Asked, ring: Assembly, frequency: Array) -> tuple[Highest, SlidingRing | StickingRing]:
    respond = StickingRing(ring) if asked.stuck else SlidingRing(asked.problem(ring), asked.tuned_points)
    top = highest(respond, frequency, follow=respond.follow, at_once=respond.at_once, tells=respond.tells)
    return (ended(top, respond.ended(top.frequency)) if np.isfinite(top.amplitude) else top), respond


def ended(top: Highest, y: Array) -> Highest:
    """With amplitudes (w,) of more digits at the peak."""
    every = np.where((top.frequencies == top.frequency)[:, None], y, top.amplitudes)
    return replace(top, output=int(y.argmax()), amplitude=float(y.max()), amplitudes=every)


FINER, HIGH = 4, 0.5
"""Points in the place of one, and the share of the peak above which they are, where a sample is searched again."""


def again(asked: Asked, one: Sample) -> tuple[Highest, Highest]:
    """The peak of a sample by two searches that know nothing of the first one nor of each other: about it in finer
    steps, one from below, one from above."""
    ring, f = asked.tuned.mistuned(asked.deviations(one.number)), asked.frequency
    high = np.nan_to_num(one.grid).max(axis=1) >= HIGH * one.top.amplitude
    high |= np.abs(f - one.top.frequency) == np.abs(f - one.top.frequency).min()
    low, up = max(int(high.argmax()) - 1, 0), min(len(f) - int(high[::-1].argmax()), len(f) - 1)
    fine = np.interp(np.arange(FINER * low, FINER * up + 1) / FINER, np.arange(len(f)), f)
    return _searched(asked, ring, fine)[0], _searched(asked, ring, fine[::-1])[0]


CLOSE = 1e-3
"""Of R over x, below which Newton's method begins without looking for another start."""

SEARCHED = 1e-7
"""Of R over x, to which the search solves; the highest is solved to the end."""

TELLS = 0.5
"""Share of the way from one solution to another, from there on which it leads where it is carried on."""


class Solutions:
    """Attributes: known: Hz -> solution of a ring."""

    def __init__(self) -> None:
        self.known: dict[float, Point] = {}

    def tells(self, frequency: float, behind: float) -> bool:
        """See `peaks.Tells`: a straight line through two solutions."""
        near, found = self.known[behind].x, self.known[frequency]
        told = carried(self.beyond(frequency, behind)[:2], found.Omega)
        return bool(np.linalg.norm(told - found.x) < TELLS * np.linalg.norm(near - found.x))

    def beyond(self, frequency: float, behind: float) -> list[Point]:
        """What is known from `behind` on away from a frequency, the nearest first."""
        away = [f for f in self.known if (f - behind) * (frequency - behind) <= 0]
        return [self.known[f] for f in sorted(away, key=lambda f: abs(f - frequency))]

    def near(self, Omega: float, most: int) -> list[Point]:
        """The nearest."""
        return sorted(self.known.values(), key=lambda p: abs(p.Omega - Omega))[:most]


class SlidingRing(Solutions):
    """Amplitudes of a ring with friction at any frequency, each started from what is known nearby.

    Attributes: problem. tuned: solutions of the ring of equal sectors, in the same units.
    """

    def __init__(self, problem: Problem, tuned: Sequence[Point] = ()) -> None:
        super().__init__()
        self.problem, self.tuned = problem, tuned
        self.slope: Any = None
        self.balances: dict[float, AtFrequency] = {}

    def __call__(self, frequency: float) -> Array | None:
        """(w,) m."""
        Omega = 2 * np.pi * frequency
        point = solve(self.problem, Omega, self._starts(Omega), self.slope, along_load=False, tolerance=SEARCHED)
        return self._kept(frequency, point)

    def at_once(self, frequency: float) -> Array | None:
        """(w,) m, by Newton's method from what is known nearby or not at all."""
        Omega = 2 * np.pi * frequency
        for x in self._starts(Omega):
            point = among(self._at(Omega), x, self.slope, SEARCHED)
            if point.converged:
                return self._kept(frequency, point)
        return None

    def follow(
        self, frequency: float, behind: float, width: float, arc: bool
    ) -> tuple[list[tuple[float, Array]], bool]:  # fmt: skip
        """Hz and (w,) m of the solution that goes on from the one at another frequency: at this one by Newton's method,
        or on the way there along its arc where asked for, and whether it ends; what is known here stays where that is
        higher. width: Hz, of what is between two points of a sweep."""
        Omega, before = 2 * np.pi * frequency, self.known.get(frequency)
        side = self.beyond(frequency, behind)
        for count in (2, 1):
            point = among(self._at(Omega), carried(side[:count], Omega), tolerance=SEARCHED)
            y = self._kept(frequency, point)
            if y is not None and (before is None or y.max() > self._amplitudes(before).max()):
                return [(frequency, y)], False
        if before is not None:
            self.known[frequency] = before
        if not arc:
            return [], False
        points, ends = Arc(self.problem, self.known[behind], Omega, 2 * np.pi * width).onward()
        return [(f, self._read(f, p)) for p in points if (f := p.Omega / (2 * np.pi)) != frequency], ends

    def ended(self, frequency: float) -> Array:
        """(w,) m at a frequency that was solved for, by Newton's method to its end."""
        known = self.known[frequency]
        y = self._kept(frequency, among(self._at(known.Omega), known.x))
        return self._read(frequency, known) if y is None else y

    def _read(self, frequency: float, point: Point) -> Array:
        self.known[frequency] = point
        return self._amplitudes(point)

    def _amplitudes(self, point: Point) -> Array:
        return np.abs(amplitudes(self._at(point.Omega), point.x))

    def _kept(self, frequency: float, point: Point) -> Array | None:
        self.slope = point.slope
        if not point.converged:
            return None
        return self._read(frequency, replace(point, slope=None))

    def coordinates(self, frequency: float) -> list[ComplexArray]:
        """(m,) first harmonics of the coordinates, part by part, at a frequency that was solved for."""
        point = self.known[frequency]
        at = self._at(point.Omega)
        return at.modal(point.x, at.force(point.x))[1]

    def _starts(self, Omega: float) -> list[Array]:
        """Where Newton's method may begin: what is near carried on, by two points or four. Where that leaves much, of
        all the two that leave least: also carried on from either side, which may be those of a jump, and the tuned
        ring's."""
        near, at = self.near(Omega, 4), self._at(Omega)
        sides = [[p for p in near if (p.Omega > Omega) is above] for above in (False, True)]
        tuned = sorted(self.tuned, key=lambda p: abs(p.Omega - Omega))[:3]
        left = dict[tuple[int, ...], tuple[float, Array]]()
        for told in ((near[:2], near), (*(side[:n] for side in sides for n in (2, 3)), tuned)):
            for points in filter(None, told):
                x = carried(points, Omega)
                left[tuple(map(id, points))] = float(np.linalg.norm(at.residual(x))), x
            if any(size <= CLOSE * np.linalg.norm(x) for size, x in left.values()):
                break
        return [x for _, x in sorted(left.values(), key=lambda one: one[0])[:2]]

    def _at(self, Omega: float) -> AtFrequency:
        """The balance at a frequency, kept: the search comes back to most."""
        if Omega not in self.balances:
            self.balances[Omega] = self.problem.at(Omega)
        return self.balances[Omega]

def amplitudes(at: AtFrequency, x: Array) -> ComplexArray:
    """(w,) complex 0-peak amplitudes of all read-outs at a solution x (size,), m."""
    force = at.force(x)
    return read(at, at.modal(x, force)[1], force, at.problem.share)


def read(at: AtFrequency, q: list[ComplexArray], force: Array, share: float) -> ComplexArray:
    """(w,) read-outs in the first harmonic, from the parts' coordinates, (W, c) forces and a share of the loads."""
    F = series.amplitudes(force)[1]
    return reduced.monitored(at.problem.read[1], np.concatenate(q), F, share)


class StickingRing:
    """Amplitudes of a ring whose contacts stick, from the matrices of the whole of it."""

    def __init__(self, ring: Assembly) -> None:
        self.part, self.k = ring.joined(1), ring.stiffness

    def __call__(self, frequency: float) -> Array:
        """(w,) m."""
        found = self._at(frequency)
        force = self.k @ found.reference
        return np.abs(reduced.monitored(self.part, found.modal, force))

    ended = __call__
    follow = at_once = tells = None  # of linear equations there is one solution, found alike everywhere

    def coordinates(self, frequency: float) -> list[ComplexArray]:
        """See `SlidingRing`."""
        return [self._at(frequency).modal]

    def _at(self, frequency: float) -> Seen:
        return reduced.seen(self.part, self.k, 2 * np.pi * frequency, 1)


# strained blades ------------------------------------------------------------------------------


def worst(ring: Assembly, q: Sequence[ComplexArray]) -> tuple[float, float]:
    """Stress amplitude (von Mises, Pa) at the worst node and strain amplitude at the worst gauge of the bodies that are
    read, 0-peak; NaN of what their modal files do not have, or do not feel.

    Args:
        q: amplitudes of the coordinates, component by component, in pieces of any length.
    """
    read = {w.component for w in ring.outputs}
    every = np.concatenate(q)
    each = zip(ring.components, reduced.own_coordinates(ring, 0), strict=True)
    blades = [(m.groups[0], every[s]) for m, s in each if m.name in read]
    stress = np.array([_stress(g, a) for g, a in blades])
    rows = [(np.abs(row @ a), np.linalg.norm(row) * np.linalg.norm(a))
            for g, a in blades for gauge in g.gauges.values() for row in gauge.rows]  # fmt: skip
    strain = [float(read) for read, most in rows if read > READS * most]
    return float(np.fmax.reduce(stress, initial=np.nan)), max(strain, default=np.nan)


READS = 1e-9
"""Share of what a motion as large could make a gauge read, below which it reads rounding: by symmetry, say."""


def _stress(group: ModalGroup, q: ComplexArray) -> float:
    """Of s = Re(a exp(i t)) the largest s^T Q s over a cycle is (a^H Q a + abs(a^T Q a)) / 2."""
    if "nodes" not in group.stresses:
        return np.nan
    a = group.stresses["nodes"].stress[counted(group)] @ q
    b = a @ MISES
    squares = (a.conj() * b).sum(axis=1).real + np.abs((a * b).sum(axis=1))
    return float(np.sqrt(0.5 * squares.max()))


MISES = np.diag([1.5, 1.5, 1.5, 3.0, 3.0, 3.0])
"""Q of the von Mises stress s^T Q s of (xx, yy, zz, three shears)."""
MISES[:3, :3] -= 0.5


# a solution followed by its arc ------------------------------------------------------------------


STEPS = 100
"""At most, those in vain counted."""

LONGEST, SHORTEST = 0.25, 2e-3
"""Steps, of z."""

BACK = 0.3
"""Widths that the curve may go back before it counts as having ended."""

CORRECTIONS = 6
"""Newton steps at most."""

TOLERANCE = 1e-9
"""Of R over x."""


class Arc:
    """The solution through a point.

    Attributes: problem. begin. to: rad/s, whereto. width: rad/s, of what is between two points of a sweep.
    """

    def __init__(self, problem: Problem, begin: Point, to: float, width: float) -> None:
        self.problem, self.begin = problem, begin
        self.width, self.size = float(np.copysign(width, to - begin.Omega)), float(np.linalg.norm(begin.x))
        self.end = (to - begin.Omega) / self.width

    def onward(self) -> tuple[list[Point], bool]:
        """Points that are nearer to the frequency than all before them, the last one there, behind it, or about where
        the curve ends; whether it ends."""
        z = most = np.append(self.begin.x / self.size, 0.0)
        found, h, t = list[Point](), LONGEST, self._along(self._linear(z)[2], np.append(0 * self.begin.x, 1.0))
        for _ in range(STEPS):
            ahead, b, count = self._corrected(z, t, h)
            if ahead is None and h > SHORTEST:
                h *= 0.25
                continue
            if ahead is None:
                ahead, b, t = self._round(z, t)
                h = 2 * SHORTEST
            if ahead is None or ahead[-1] < most[-1] - BACK:
                return found, True
            z, t, h = ahead, self._along(b, t), min(1.5 * h if count <= 3 else h, LONGEST)
            if z[-1] > most[-1]:
                most = z
                found.append(Point(self._Omega(z), self.size * z[:-1]))
            if z[-1] >= self.end:
                return found, False
        return found, False

    def _Omega(self, z: Array) -> float:
        return self.begin.Omega + self.width * float(z[-1])

    def _linear(self, z: Array) -> tuple[Array, Array, Array]:
        """R, a and b, see above, in units of z."""
        x, at = self.size * z[:-1], self.problem.at(self._Omega(z))
        force, slopes = at.forces(x)
        R, J = at.residual_of(x, force), at.jacobian(slopes)
        return R / self.size, J.solve(-R) / self.size, J.solve(at.rate(x, force)) * (self.width / self.size)

    def _along(self, b: Array, before: Array) -> Array:
        """The curve's direction, on from another one."""
        t = np.append(-b, 1.0)
        return np.asarray(t / np.copysign(np.linalg.norm(t), t @ before))

    def _corrected(self, begin: Array, t: Array, h: float) -> tuple[Array | None, Array, int]:
        """The point a step ahead, or None, its b, and the number of corrections."""
        z, last = begin + h * t, np.inf
        for count in range(CORRECTIONS):
            R, a, b = self._linear(z)
            left = float(np.abs(R).max())
            if left <= TOLERANCE * np.abs(z[:-1]).max():
                return z, b, count
            if not left <= (0.5 * last if count > 1 else np.inf):
                break
            last, step = left, (h - t @ (z - begin) - t[:-1] @ a) / (t[-1] - t[:-1] @ b)
            z = z + np.append(a - b * step, step)
            if np.linalg.norm(z - begin - h * t) > h:
                break
        return None, t, CORRECTIONS

    def _round(self, z: Array, t: Array) -> tuple[Array | None, Array, Array]:
        """A point behind a kink, its b and the direction to it, by the derivative a little beyond: either way that does
        not lead back to where the curve came from."""
        for h in (SHORTEST, 2 * SHORTEST, 4 * SHORTEST):
            beyond = self._along(self._linear(z + h * t)[2], t)
            for way in (beyond, -beyond):
                found, b, _ = self._corrected(z, way, h)
                if found is not None and np.linalg.norm(found - (z - h * t)) > 0.5 * h:
                    return found, b, way
        return None, t, t

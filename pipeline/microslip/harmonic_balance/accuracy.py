"""How many harmonics and samples are enough: what more of them make of a solution.

The solution with H harmonics and S samples is solved for again with 4 S samples, and with twice as many harmonics
besides (see `more`). The two changes of the read-out's amplitude, added up, are what the coarse solution has not
converged to yet: samples err with their second power, harmonics of a contact that slides with about the second power
too, so that about a third of what these change lies beyond the finer solution. There are two answers. The change with
its sign (`Error.likely`) says on which side the solution errs and by how much: of the random systems of
`tests/test_accuracy.py` it has the sign of the error in all and 0.7 to 1.9 times its size. `SAFETY` makes a bound of
the changes (`Error.readout`), which covers what lies beyond and harmonics that meet a resonance of their own: it errs
on the high side, about three times.

Solved for, and not estimated from one step of Newton's method: where every sample steps over the phases in which a
contact sticks, the derivative of its force is zero, and such a step sees no change at all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..data import Array
from ..results.journal import Journal, once
from . import problem as balance
from .forces import AFT
from .problem import Problem
from .readout import amplitude
from .response import HarmonicResponse, Resonance
from .solver import CONVERGED, Point, newton, solve

PER_HARMONIC = 8
"""Samples a harmonic needs at least: two carry it, the kinks of a contact force need more."""

DENSER = 4
"""By which samples are multiplied. What they miss of a motion that turns between two of them goes with the square of
its distance to the nearest one, and where that is less than a quarter of a step, twice as many miss the same: of 116
random systems (`tests/random_systems.py`) they left the errors of 7 uncovered, four times as many those of none."""

SAFETY = 3.0
"""By which the changes are multiplied. The error of 102 solutions of 60 random systems (`tests/test_accuracy.py`) is
covered in all; it is a third of the estimate in the median. With 2 it would be covered in 101."""

FINEST = 2048
"""Samples up to which they are doubled where none lies in the phases in which a contact sticks."""

LOOKED_AT = 24
"""Points of a sweep, evenly spread, at which what the harmonics leave out is looked at; the worst two are judged."""

FLOOR = 0.1
"""Share of a sweep's highest amplitude that errors are measured by where the amplitude is smaller: near a zero of the
read-out the error is a small one."""


@dataclass(frozen=True, repr=False)
class Error:
    """Estimated error of a solution.

    Attributes:
        harmonics, samples: of the solution. amplitude: of the read-out's first harmonic, or what else is read of it.
            by_harmonics, by_samples: what more of them change of it, in its unit; infinite where no such solution was
            found.
        x: (size,) unknowns of the finer solution, a start for it. change: of the amplitude with more of both, with its
            sign; NaN where no such solution was found.
    """

    harmonics: int
    samples: int
    amplitude: float
    by_harmonics: float
    by_samples: float
    x: Array
    change: float = np.nan

    def __repr__(self) -> str:
        side, likely = "high" if self.likely() > 0 else "low", 100 * abs(self.likely())
        share = f"too {side} by about {likely:.2g} %, {100 * self.readout:.2g} % at most,"
        share = share if np.isfinite(self.readout) else "not known: no finer solution was found,"
        return f"<Error: {share} of {self.amplitude:.4g}, with {self.harmonics} harmonics and {self.samples} samples>"

    @property
    def readout(self) -> float:
        """Of the amplitude, relative to it, `SAFETY` included."""
        return self.over(0.0)

    def likely(self, floor: float = 0.0) -> float:
        """What the amplitude is likely to be off by, relative to it or to ``floor``, whichever is larger: above 0 where
        it is too high; NaN where nobody knows."""
        return -self.change / max(self.amplitude, floor, 1e-300)

    def over(self, floor: float) -> float:
        """The same relative to the amplitude or to ``floor``, whichever is larger."""
        return SAFETY * (self.by_harmonics + self.by_samples) / max(self.amplitude, floor, 1e-300)


def more(harmonics: int) -> int:
    """Harmonics of the larger balance: twice as many, and at least four more, because symmetric motions have no even
    ones."""
    return max(2 * harmonics, harmonics + 4)


def samples_of(problem: Problem) -> int:
    """Samples of a cycle of the marched contacts; 0 where none is marched."""
    return max((g.model.samples for g in problem.groups if isinstance(g.model, AFT)), default=0)


def finer(problem: Problem, harmonics: int, samples: int = 0, seldom: bool = False) -> Problem:
    """The same assembly with more harmonics, and samples enough for them, or as many as are given if that is more.

    Args:
        seldom: see `forces.AFT`.
    """
    together, least = len(problem.parts[0]) == 1, max(PER_HARMONIC * harmonics, samples)
    parts = [
        *problem.parts[: harmonics + 1],
        *(balance.eliminated(problem.assembly, h, together) for h in range(len(problem.parts), harmonics + 1)),
    ]
    groups = []
    for g in problem.groups:
        if isinstance(g.model, AFT) and g.model.samples < least:
            g = replace(g, model=replace(g.model, samples=least, seldom=seldom))
        groups.append(g)
    return replace(problem, harmonics=harmonics, parts=tuple(parts), groups=tuple(groups))


def error(problem: Problem, x: Array, Omega: float, output: int = 0) -> Error:
    """Estimated error of the solution x (size,) at Omega (rad/s)."""

    def solved(more: Problem, start: Array) -> Reading:
        point = newton(more.at(Omega), start)
        read = _read(more, point.x, Omega, output) if point.converged else np.nan
        return Reading(point.x, Omega, read)

    return changed(problem, Reading(x, Omega, _read(problem, x, Omega, output)), solved)


class Reading(NamedTuple):
    """A solution x (size,) at Omega (rad/s), and what is read of it; NaN: none was found."""

    x: Array
    Omega: float
    read: float


Solve = Callable[[Problem, Array], Reading]


def changed(problem: Problem, at: Reading, solved: Solve) -> Error:
    """Estimated error of what is read of a solution.

    Args:
        solved: finds the solution of a finer problem from a start x (size,).
    """
    samples = DENSER * samples_of(problem)
    while True:  # until one sample lies where each contact sticks
        sampled = finer(problem, problem.harmonics, samples, seldom=True)
        first = solved(sampled, at.x)
        solved_for = np.isfinite(first.read)
        if not solved_for or not samples or samples > FINEST or not _blind(sampled, first.x, first.Omega):
            break
        samples *= 2
    larger = finer(sampled, more(problem.harmonics), seldom=True)
    second = solved(larger, np.concatenate([first.x, np.zeros(larger.size - problem.size)]))
    by_samples = by_harmonics = np.inf
    change = np.nan
    if np.isfinite(first.read):
        by_samples = abs(first.read - at.read)
        if np.isfinite(second.read):
            by_harmonics, change = abs(second.read - first.read), second.read - at.read
    H, S = problem.harmonics, samples_of(problem)
    return Error(H, S, at.read, by_harmonics, by_samples, second.x, change)


def _read(problem: Problem, x: Array, Omega: float, output: int) -> float:
    at = problem.at(Omega)
    return abs(amplitude(at, x, *at.forces(x), output).value)


def _blind(problem: Problem, x: Array, Omega: float) -> bool:
    """Whether the swinging force of a contact does not depend on its motion, to a twentieth."""
    at, v = problem.at(Omega), problem.displacement(x)
    for g, slope in zip(problem.groups, at.forces(x)[1], strict=True):
        u = g.relative(v)
        swing = np.abs(g.force(u, at.period)[..., 1:]).max(axis=(1, 2), initial=0.0)
        felt = np.einsum("nkwlz,nlz->nkw", np.abs(slope), np.abs(u)).max(axis=(1, 2), initial=0.0)
        if (felt < 0.05 * swing).any():
            return True
    return False


def left_out(problem: Problem, x: Array, Omega: float) -> float:
    """Largest motion that twice the harmonics and samples ask for at once, over the largest there is: cheap, without
    what it does to the others."""
    larger = finer(problem, more(problem.harmonics), 2 * samples_of(problem), seldom=True)
    residual = larger.at(Omega).residual(np.concatenate([x, np.zeros(larger.size - problem.size)]))
    return float(np.abs(residual).max() / max(np.abs(x).max(), 1e-300))


class Judged(NamedTuple):
    """A point, its error, and the bound of that and what is likely of it over its amplitude, at least `FLOOR` of the
    highest of the sweep."""

    point: Point
    error: Error
    bound: float
    likely: float


def judged(
    problem: Problem,
    response: HarmonicResponse,
    peaks: Sequence[Resonance],
    journal: Journal | None = None,
    series: str = "",
) -> list[Judged]:
    """Errors at the resonances of a sweep, at its highest point and where most is left out, see `left_out`.

    A resonance whose solution cannot be found again, but another motion at its frequency, is left out.

    Args:
        journal: keeps each estimate beside the series of the sweep; what it holds is not computed.
    """
    good = np.flatnonzero(response.converged)
    if not len(good):
        return []
    size = np.abs(response.monitor)
    top = int(good[np.argmax(size[good])])
    asked = np.flatnonzero(response.converged & response.asked)  # at a fold the least error is a jump
    some = asked[np.unique(np.linspace(0, len(asked) - 1, min(LOOKED_AT, len(asked))).round().astype(int))]

    def looked(i: int) -> dict[str, Any]:
        f = float(response.frequency[i])
        share = partial(left_out, problem, response.x[i], 2 * np.pi * f)
        return once(journal, f"{series}, left out", f, lambda: {"share": share()})

    missing = [float(looked(i)["share"]) for i in some]
    worst = some[np.argsort(missing)[-2:]]
    places = {float(response.frequency[i]): (float(size[i]), response.x[i]) for i in (top, *worst)}
    places |= {peak.frequency: (peak.amplitude, peak.x) for peak in peaks}
    estimates = []
    for f, (height, x) in sorted(places.items(), key=lambda place: place[0]):
        row = once(journal, f"{series}, errors", f, partial(_estimated, problem, f, x))
        if row and np.isclose(row["amplitude"], height, rtol=1e-3, atol=0):
            point = Point(2 * np.pi * f, row["solution"], CONVERGED, row["residual"], row["steps"])
            e, floor = Error(**{one.name: row[one.name] for one in fields(Error)}), FLOOR * float(size[top])
            estimates.append(Judged(point, e, e.over(floor), e.likely(floor)))
    return estimates


def _estimated(problem: Problem, frequency: float, x: Array) -> dict[str, Any]:
    """The solution at a frequency (Hz), begun at x (size,), and its `Error`, as a journal keeps them; empty where
    there is none."""
    point = solve(problem, 2 * np.pi * frequency, [x])
    if not point.converged:
        return {}
    row = {"solution": point.x, "residual": point.error, "steps": point.iterations}
    return row | vars(error(problem, point.x, point.Omega))


@dataclass(frozen=True)
class Enough:
    """A solution with as many harmonics as a tolerance needs.

    Attributes:
        problem, point: of the last number of harmonics. errors: of every number tried, in order. reached: whether the
            last one is within the tolerance.
    """

    problem: Problem
    point: Point
    errors: tuple[Error, ...]
    reached: bool


def enough(
    problem: Problem, point: Point, tolerance: float = 0.01, most: int = 48, floor: float = 0.0,
    first: Error | None = None,
) -> Enough:  # fmt: skip
    """Harmonics and samples doubled until the read-out's estimated error is within a tolerance (a share of it).

    Args:
        point: a solution of the problem. most: harmonics that are tried. floor: see `Error.over`. first: the point's
            error, if it is known.
    """
    errors = [first or error(problem, point.x, point.Omega)]
    while errors[-1].over(floor) > tolerance:
        larger = finer(problem, more(problem.harmonics), 2 * samples_of(problem))
        following = newton(larger.at(point.Omega), errors[-1].x) if larger.harmonics <= most else None
        if following is None or not following.converged:
            return Enough(problem, point, tuple(errors), False)
        problem, point = larger, following
        errors.append(error(problem, point.x, point.Omega))
    return Enough(problem, point, tuple(errors), True)

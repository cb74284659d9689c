"""Points that a sweep over frequency is not asked for and needs: at modes narrower than a step, on both sides of
folds, and beside points without a solution."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..data import Array
from . import reduced, sweeps
from .problem import Problem
from .response import HarmonicResponse, Operating, of_points, operating
from .solver import Point, Report, newton, solve, sweep

Solved = tuple[Point, Operating]


def filled_response(
    problem: Problem, frequency: Array, limit: Array, report: Report = lambda _: None,
    known: Mapping[float, Solved] | None = None, keep: Callable[[float, Solved, bool], None] = lambda *_: None,
) -> HarmonicResponse:  # fmt: skip
    """`response.harmonic_response`, with points added where the sweep may step over a resonance (`hidden`), past a fold
    or past the last solution beside none (`last_solutions`).

    Args:
        limit: (patches,) friction limits, N, for reports. known: Hz -> what was found before. keep: told of every other
            point as soon as it is found: Hz, what was found, and whether it is added.
    """
    asked, solved = [float(f) for f in frequency], dict(known or {})

    def take(f: float, point: Point, added: bool) -> None:
        point = replace(point, Omega=2 * np.pi * f, slope=None)  # as it comes back from where it is kept
        solved[f] = point, operating(problem, point)
        keep(f, solved[f], added)

    def swept(point: Point) -> None:
        take(min(asked, key=lambda f: abs(2 * np.pi * f - point.Omega)), point, False)

    sweep(problem, frequency, report, known={f: solved[f][0] for f in asked if f in solved}, keep=swept)
    more = hidden(problem, frequency)
    for f in more:
        if f not in solved:
            report(f"a point is added at {f:.6g} Hz, a mode between two of the sweep")
            take(f, between(problem, [solved[g][0] for g in asked], f), True)
    for low, high in pairwise(sorted([*asked, *more])):
        one, other = solved[low][0], solved[high][0]
        before = [f for f in solved if low < f < high]
        if len(before) < one.converged + other.converged:
            told = ""
            for point in last_solutions(problem, one, other):
                words = f"a point is added at {point.Omega / (2 * np.pi):.6g} Hz, where the curve ends"
                if words != told:  # both sides of a fold may read alike
                    report(told := words)
                take(point.Omega / (2 * np.pi), point, True)
    chosen = asked + [f for f in solved if f not in asked]
    points, found = zip(*(solved[f] for f in chosen), strict=True)
    return of_points(problem, points, limit, found, frequency)


def hidden(problem: Problem, frequency: Array) -> list[float]:
    """Hz of resonances that a sweep may step over, see `sweeps.hidden`: of sticking contacts, and of none."""
    a = problem.assembly
    if not a.loads:
        return []
    part = a.joined(1)
    pairs = [(part, a.stiffness), (reduced.untouched(part), np.zeros((0, 0)))]
    modes, damping = (np.concatenate([of(one, k) for one, k in pairs]) for of in (reduced.stuck, reduced.stuck_damping))
    return sweeps.hidden(np.asarray(frequency, dtype=float), modes, damping)


def between(problem: Problem, points: Sequence[Point], frequency: float) -> Point:
    """The solution at a frequency (Hz), begun at the nearest of others."""
    Omega = 2 * np.pi * frequency
    good = sorted((p for p in points if p.converged), key=lambda p: abs(p.Omega - Omega))
    return solve(problem, Omega, [p.x for p in good[:1]])


HALVINGS = 12
"""Times that the distance of two points is halved to find where the curve of solutions ends between them; a resonance
that is narrower than what is left cannot be told from a fold."""

JUMP = 0.2
"""Share of the vibration by which two points may differ and be of one curve."""


def last_solutions(problem: Problem, low: Point, high: Point) -> list[Point]:
    """Where the curve of solutions through a point ends before the next one: the last solutions on either side.

    It ends at a fold, beyond which the vibration is another one, or where no solution is found. None are told if both
    points are of one curve.
    """
    given = (low.Omega, high.Omega)
    for _ in range(HALVINGS):
        both = low.converged and high.converged
        if both and _apart(problem, low.x, high.x) <= JUMP:
            return []
        low, high = (_with_slope(problem, p) for p in (low, high))
        good = [p for p in (low, high) if p.converged]
        if not good or (both and _lead_to_each_other(problem, low, high)):
            return []
        at = problem.at(0.5 * (low.Omega + high.Omega))
        found = next((p for g in good if (p := newton(at, g.x, most=20, slope=g.slope)).converged), None)
        if found is None and both:
            break
        if found is None:  # the end lies on this side of the middle
            nothing = Point(at.Omega, good[0].x, "", np.inf, 0)
            low, high = (low, nothing) if low.converged else (nothing, high)
        elif _apart(problem, low.x, found.x) < _apart(problem, found.x, high.x) if both else low.converged:
            low = found
        else:
            high = found
    return [p for p in (low, high) if p.converged and p.Omega not in given]


def _with_slope(problem: Problem, point: Point) -> Point:
    """A solution with the derivative of its contact forces."""
    if not point.converged or point.slope is not None:
        return point
    return replace(point, slope=problem.at(point.Omega).forces(point.x)[1])


def _lead_to_each_other(problem: Problem, low: Point, high: Point) -> bool:
    """Whether the contacts of each point, linear as they are there, lead to the other one: between them is a resonance
    that is narrow because damping is low."""
    for a, b in ((low, high), (high, low)):
        at = problem.at(b.Omega)
        reached = a.x + at.jacobian(a.slope).solve(-at.residual(a.x))
        if not _apart(problem, reached, b.x) <= JUMP:
            return False
    return True


def _apart(problem: Problem, x: Array, y: Array) -> float:
    """Difference of two vibrations over the larger one; where their means are may be undetermined."""
    x, y = x[problem.count :], y[problem.count :]
    return float(np.abs(x - y).max(initial=0.0) / max(np.abs(x).max(initial=0.0), np.abs(y).max(initial=0.0), 1e-300))

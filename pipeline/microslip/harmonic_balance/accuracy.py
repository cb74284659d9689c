"""How many harmonics are enough: the error of a solution by what it leaves out of twice as many.

The solution with H harmonics is put into the balance of 2 H (of 3 for H = 1), with the contact force of the same
motion. One step of Newton's method there tells, to first order, what the harmonics that were left out would move, the
read-out among it. This is a posteriori: no solution with more harmonics is needed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..data import Array
from . import problem as balance
from .forces import Marched
from .problem import Problem
from .readout import amplitude
from .solver import Point, newton

PER_HARMONIC = 8
"""Samples a harmonic needs at least: two carry it, the kinks of a contact force need more."""


@dataclass(frozen=True)
class Error:
    """Estimated error of a solution.

    Attributes:
        harmonics: H of the solution. motion: largest contact displacement that twice as many harmonics add, over the
            largest there is. readout: change of the read-out's first harmonic, relative to its size.
        x: (size,) unknowns of the larger problem after the step: a start for it.
    """

    harmonics: int
    motion: float
    readout: float
    x: Array


def more(harmonics: int) -> int:
    """Harmonics of the larger balance: twice as many, and at least two more, because symmetric motions have no even
    ones."""
    return max(2 * harmonics, harmonics + 2)


def finer(problem: Problem, harmonics: int) -> Problem:
    """The same assembly with more harmonics, and samples enough for them."""
    together = len(problem.parts[0]) == 1
    parts = [
        *problem.parts[: harmonics + 1],
        *(balance.eliminated(problem.assembly, h, together) for h in range(len(problem.parts), harmonics + 1)),
    ]
    groups = []
    for g in problem.groups:
        if isinstance(g.model, Marched) and g.model.samples < PER_HARMONIC * harmonics:
            g = replace(g, model=replace(g.model, samples=PER_HARMONIC * harmonics))
        groups.append(g)
    return replace(problem, harmonics=harmonics, parts=tuple(parts), groups=tuple(groups))


def error(problem: Problem, x: Array, Omega: float, watch: int = 0) -> Error:
    """Estimated error of the solution x (size,) at Omega (rad/s)."""
    larger = finer(problem, more(problem.harmonics))
    whole = np.concatenate([x, np.zeros(larger.size - problem.size)])
    at = larger.at(Omega)
    force, slopes = at.forces(whole)
    step: Array = at.jacobian(slopes).solve(-at.residual_of(whole, force))
    motion = float(np.abs(step).max() / np.abs(x).max(initial=1e-300))
    y, own = amplitude(at, whole, force, slopes, watch), problem.at(Omega)
    before = abs(amplitude(own, x, *own.forces(x), watch).value)
    after = abs(y.value + complex(y.by_x @ step))
    return Error(problem.harmonics, motion, abs(after - before) / max(before, 1e-300), whole + step)


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
    problem: Problem, point: Point, tolerance: float = 0.01, watch: int = 0, most: int = 48
) -> Enough:  # fmt: skip
    """Harmonics doubled until the read-out's estimated error is within a tolerance (a share of it).

    Args:
        point: a solution of the problem. most: harmonics that are tried.
    """
    found: list[Error] = []
    while True:
        found.append(error(problem, point.x, point.Omega, watch))
        if found[-1].readout <= tolerance:
            return Enough(problem, point, tuple(found), True)
        larger = finer(problem, more(problem.harmonics))
        if larger.harmonics > most:
            return Enough(problem, point, tuple(found), False)
        following = newton(larger.at(point.Omega), found[-1].x)
        if not following.converged:
            return Enough(problem, point, tuple(found), False)
        problem, point = larger, following

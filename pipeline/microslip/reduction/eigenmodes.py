"""The lowest eigenmodes alone (Sextro Eqs. (2.4-9) to (2.4-15))."""

from __future__ import annotations

from .problem import Problem, Reduced, diagonal


def reduce(problem: Problem) -> Reduced:
    """Nothing is added."""
    kind = ("rigid",) * problem.rigid + ("normal",) * (len(problem.values) - problem.rigid)
    return diagonal(problem.vectors, kind, problem.values, problem.rigid)

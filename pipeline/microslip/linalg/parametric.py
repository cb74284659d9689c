"""Quadratic eigenproblems whose matrices are sums of constant ones times powers of parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import scipy.sparse as sp

from ..data import Matrices, MatrixTerm, UserError
from .quadratic import Quadratic

ORDERS = {"mass": 2, "damping": 1, "gyroscopic": 1, "stiffness": 0, "circulatory": 0}
"""Role of a matrix -> the power of s that stands with it."""


def weight(term: MatrixTerm, values: Mapping[str, float]) -> float:
    """factor (value / reference)^power; a parameter that is not among the values has its reference.

    Raises:
        UserError: a value at which the power is no number.
    """
    value = values.get(term.parameter, term.reference)
    if value < 0 and term.power % 1 or value == 0 and term.power < 0:
        raise UserError(
            f"parameters: {term.parameter} = {value:g} to the power {term.power:g} is no number; give a value above 0"
        )
    return float(term.factor * (value / term.reference) ** term.power)


@dataclass(frozen=True)
class Family:
    """Q(s) at any values of the parameters: sum of weight(values) s^k A over terms (k, A, weight).

    Attributes:
        terms: the constant ones have the power 0.
    """

    terms: tuple[MatrixTerm, ...]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of those that a matrix scales with."""
        return tuple(sorted({t.parameter for t in self.terms if t.power}))

    def at(self, values: Mapping[str, float]) -> Quadratic:
        """The matrices at values of the parameters.

        Raises:
            UserError: see `weight`.
        """
        zero: Any = 0.0 * self.terms[0].matrix
        sums = [zero, zero, zero]
        for term in self.terms:
            sums[ORDERS[term.role]] = sums[ORDERS[term.role]] + weight(term, values) * term.matrix
        K, C, M = (A.tocsr() if sp.issparse(A) else A for A in sums)
        return Quadratic(M, C, K)


def family_of(body: Matrices) -> Family:
    """The matrices of a body with what scales with parameters."""
    roles = ("mass", "damping", "gyroscopic", "stiffness", "circulatory")
    constant = [MatrixTerm(role, A) for role in roles if (A := getattr(body, role)) is not None]
    return Family((*constant, *body.terms))


def state(body: Matrices, values: Mapping[str, float]) -> Matrices:
    """A body at values of its parameters, without any left.

    Raises:
        UserError: see `weight`.
    """
    sums: dict[str, Any] = {}
    for term in body.terms:
        held = sums.get(term.role, getattr(body, term.role))
        add = weight(term, values) * term.matrix
        sums[term.role] = add if held is None else held + add
    return replace(body, terms=(), **{role: A.tocsr() for role, A in sums.items()})


def known(parameters: Sequence[str], name: str, where: str) -> None:
    """Refuse a parameter that nothing scales with.

    Raises:
        UserError: with those that there are.
    """
    if name not in parameters:
        has = (
            f"they scale with {', '.join(parameters)}" if parameters else "nothing scales with any; add [[parameters]]"
        )
        raise UserError(f"{where}: no matrix scales with '{name}'; {has}")

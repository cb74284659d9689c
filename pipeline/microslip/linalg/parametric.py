"""Quadratic eigenproblems whose matrices are sums of constant ones times powers of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..data import Array, Matrices, MatrixTerm, ModalGroup
from ..errors import UserError
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

    def values(self, values: Mapping[str, float], over: str) -> Mapping[str, float]:
        """The values, if every matrix is defined at them and the parameter `over` scales one.

        Raises:
            UserError: it scales none; see `weight`.
        """
        if over not in self.parameters:
            known = ", ".join(self.parameters)
            way = f"choose from {known}" if known else "add [[parameters]] with its powers"
            raise UserError(f"stability.over: no matrix scales with the parameter '{over}'; {way}")
        for term in self.terms:
            weight(term, values)
        return values

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

    def merged(self) -> Family:
        """The same with one matrix for each power of s and of a parameter."""
        sums: dict[tuple[Any, ...], Any] = {}
        for t in self.terms:
            key = (ORDERS[t.role], *((t.parameter, t.power, t.reference) if t.power else ("", 0.0, 1.0)))
            sums[key] = sums[key] + t.factor * t.matrix if key in sums else t.factor * t.matrix
        role = {2: "mass", 1: "damping", 0: "stiffness"}
        return Family(tuple(MatrixTerm(role[k], A, name, p, 1.0, at) for (k, name, p, at), A in sums.items()))

    def projected(self, V: Array, W: Array | None = None) -> Family:
        """The same with dense W^T A V for every matrix A; W = V if not given."""
        left = V if W is None else W
        return Family(tuple(replace(t, matrix=np.asarray(left.T @ (t.matrix @ V))) for t in self.terms))


def family_of(body: Matrices) -> Family:
    """The matrices of a body with what scales with parameters."""
    roles = ("mass", "damping", "gyroscopic", "stiffness", "circulatory")
    constant = [MatrixTerm(role, A) for role in roles if (A := getattr(body, role)) is not None]
    return Family((*constant, *body.terms))


def family_of_group(name: str, g: ModalGroup) -> Family:
    """The reduced matrices of a body, N_r and G_r included.

    Args:
        name: of the body, for messages.

    Raises:
        UserError: complex matrices, of a cyclic sector in a wave.
    """
    roles = {"mass": g.M_r, "damping": g.C_r, "gyroscopic": g.G_r, "stiffness": g.K_r, "circulatory": g.N_r}
    if any(np.iscomplexobj(A) for A in roles.values() if A is not None):
        raise UserError(f"{name}: the roots of complex matrices, of a cyclic sector in a wave, are not computed")
    return Family(tuple(MatrixTerm(role, A) for role, A in roles.items() if A is not None))


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

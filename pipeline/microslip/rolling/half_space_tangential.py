"""Tangential tractions of a patch: what sticks, what slips, by Newton's method on all elements at once.

With the slip s = w + B p (rigid slip w; displacements B of a shift, of a moment of rolling or of steady rolling) and
the bound g = mu p_n: |p| <= g, s = 0 where |p| < g, p = -g s/|s| elsewhere (Kalker, Three-Dimensional Elastic Bodies in
Rolling Contact, 1990, 3.2). That is one equation, p = P(p - r s) with P the way back into the circle of radius g and
any r > 0. Newton's method on it is a strategy of active sets that finds the directions as well. It begins where all
elements stick: so it settled in all of 400 random cases; begun from full slip, with r as large as the reciprocal of B's
diagonal, it ran in circles in 18 of 60. Its linear equations are solved by GMRES; the preconditioner solves each row
along x by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import lapack
from scipy.sparse.linalg import LinearOperator, gmres

from ..data import Array, Flags
from ..errors import UserError
from ..interrupts import look
from .half_space_influence import TANGENTIAL, Grid, Influence

TOLERANCE = 1e-7
ITERATIONS = 60
BAND = 3
"""Neighbours on either side that the preconditioner knows."""
COARSEST = 900
"""Elements of a grid that is begun from stick; a finer one begins with the answer of one half as fine."""
PUSH = 0.3
"""r in units of the reciprocal of B's diagonal."""


@dataclass(frozen=True)
class Shear:
    """A tangential problem.

    Attributes:
        operator: B of a grid. grid: this one. rigid: (2, nx, ny) w, in the unit of B p. bound: (nx, ny) g, Pa; 0 where
            nothing touches. wanted: (k, 2, nx, ny) rigid slips that are found so that the sums over the elements of p
            times each of them are: sums (k,), Pa.
    """

    operator: Callable[[Grid], Influence]
    grid: Grid
    rigid: Array
    bound: Array
    wanted: Array
    sums: Array

    @cached_property
    def influence(self) -> Influence:
        """B on this grid."""
        return self.operator(self.grid)

    @cached_property
    def push(self) -> float:
        """r, Pa."""
        return PUSH * 2 / float(np.trace(self.influence.row(0)))


@dataclass(frozen=True)
class TangentProblem:
    """The equations linearised at a traction: stick leaves two unknowns to an element, slip one, along the circle.

    Attributes:
        influence: B. stick, slip: (nx, ny) where. across, along: (2, nx, ny) unit normal and tangent of the circle.
            stiff: (nx, ny) |s|/g, what the turning of the traction adds to B's diagonal. scale: of that diagonal.
    """

    influence: Influence
    stick: Flags
    slip: Flags
    across: Array
    along: Array
    stiff: Array
    scale: float

    def free(self, v: Array) -> Array:
        """The part of v that may change."""
        return v * self.stick + ((v * self.along).sum(axis=0) * self.slip) * self.along

    def solve(self, right: Array, accuracy: float) -> Array:
        """v of the free part with free(B v) + stiff v = free(right), in single precision."""
        right = self.free(right)
        largest = float(np.abs(right).max())
        if not largest:
            return np.zeros_like(right)
        lean, by_rows, B = self._single, self._by_rows, self.influence.single()

        def apply(z: Array) -> Array:
            v = z.reshape(right.shape)
            return (lean.free(B(v, TANGENTIAL, TANGENTIAL)) + lean.stiff * v).ravel()

        def precondition(z: Array) -> Array:
            v = by_rows(z.reshape(right.shape).transpose(2, 1, 0).ravel())
            return lean.free(v.reshape(right.shape[::-1]).transpose(2, 1, 0)).ravel()

        size = (right.size, right.size)
        matrix, inverse = (LinearOperator(size, matvec=f, dtype=np.float32) for f in (apply, precondition))
        free_part, _ = gmres(
            matrix, (right / largest).astype(np.float32).ravel(), M=inverse, rtol=accuracy, restart=60, maxiter=4
        )
        return self.free(largest * free_part.reshape(right.shape).astype(float))

    @cached_property
    def _single(self) -> TangentProblem:
        names = ("stick", "slip", "along", "stiff")
        return replace(self, **{name: getattr(self, name).astype(np.float32) for name in names})

    @cached_property
    def _by_rows(self) -> Callable[[Array], Array]:
        """Solves the equations of each row by itself, as if elements more than BAND apart did not feel each other.

        One band matrix in the order y, x, component; the identity where nothing is free.
        """
        ny, nx = self.slip.T.shape
        free = self.slip * self.along[:, None] * self.along[None, :] + self.stick * _ONE  # (2, 2, nx, ny)
        wide = 2 * min(BAND, nx - 1) + 1
        band = np.zeros((3 * wide + 1, ny, nx, 2), np.float32)
        for k in range(-(wide // 2), wide // 2 + 1):
            here, there = slice(max(k, 0), nx + min(k, 0)), slice(max(-k, 0), nx - max(k, 0))
            block = np.einsum(
                "abxy,bc,cdxy->adyx", free[:, :, here], self.influence.row(k), free[:, :, there], optimize=True
            )
            if k == 0:
                block += ((_ONE - free) * self.scale + self.stiff * free).transpose(0, 1, 3, 2)
            for i, j in np.ndindex(2, 2):
                band[2 * wide + 2 * k + i - j, :, there, j] = block[i, j]
        factors, pivots, _ = lapack.sgbtrf(band.reshape(3 * wide + 1, -1), wide, wide, overwrite_ab=True)
        return lambda right: lapack.sgbtrs(factors, wide, wide, right, pivots)[0]


_ONE = np.eye(2)[:, :, None, None]


def tractions(
    problem: Shear, start: Array | None = None, tolerance: float = TOLERANCE
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Tractions with |p| <= g that oppose the slip.

    Args:
        start: p - r s to begin with. tolerance: of the traction, relative to the largest bound.

    Returns:
        Tractions (2, nx, ny), Pa; slip s, the wanted rigid slips included; how much of each of these (k,).

    Raises:
        UserError: no convergence.
    """
    B, bound = problem.influence, problem.bound
    amounts, trial = (np.zeros(len(problem.wanted)), start) if start is not None else _first(problem)
    p, error = within(trial, bound), 1.0
    largest = max(float(bound.max()), np.finfo(float).tiny)
    for _ in range(ITERATIONS):
        look()
        tangent = _linearised(problem, trial)
        p = tangent.free(p) + tangent.across * bound * tangent.slip
        slip = problem.rigid + np.tensordot(amounts, problem.wanted, 1) + B(p, TANGENTIAL, TANGENTIAL)
        change, more = _newton(problem, tangent, p, slip, min(0.2, max(error, 1e-3)))
        p, amounts = p + change, amounts + more
        slip = slip + np.tensordot(more, problem.wanted, 1) + B(change, TANGENTIAL, TANGENTIAL)
        trial = p - problem.push * slip
        unbalanced = np.abs(_missing(problem, p)).sum() / bound.size
        error = float(np.abs(p - within(trial, bound)).max() + unbalanced) / largest
        if error <= tolerance:
            return within(p, bound), slip, amounts
    raise UserError(f"slip: the tractions have not settled after {ITERATIONS} iterations (change {error:.1e})")


def _linearised(problem: Shear, trial: Array) -> TangentProblem:
    """The tangent at p - r s."""
    size = np.maximum(np.hypot(*trial), np.finfo(float).tiny)
    touching = problem.bound > 0
    stick = touching & (size <= problem.bound)
    slip = touching & ~stick
    stiff = np.where(slip, (size / np.where(slip, problem.bound, 1) - 1) / problem.push, 0)
    across = trial / size
    along = np.stack([-across[1], across[0]])
    return TangentProblem(problem.influence, stick, slip, across, along, stiff, PUSH / problem.push)


def _newton(problem: Shear, tangent: TangentProblem, p: Array, slip: Array, accuracy: float) -> tuple[Array, Array]:
    """Changes of the free tractions and of the wanted rigid slips."""
    change = tangent.solve(-(slip + tangent.stiff * p), accuracy)
    if not len(problem.wanted):
        return change, np.zeros(0)
    answers = np.array([tangent.solve(-w, accuracy) for w in problem.wanted])
    stiffness = np.einsum("kixy,lixy->kl", problem.wanted, answers)
    more = np.linalg.lstsq(stiffness, _missing(problem, p + change))[0]
    if not tangent.stick.any() and not 0 < np.linalg.norm(more) < np.hypot(*slip).max():
        return np.zeros_like(p), _sliding(problem, slip)
    return change + np.tensordot(more, answers, 1), more


def _missing(problem: Shear, p: Array) -> Array:
    return problem.sums - (problem.wanted * p).sum(axis=(1, 2, 3))


def _sliding(problem: Shear, slip: Array) -> Array:
    """Rigid slips that balance the sums while each element feels itself alone: p = -s g/max(|s|, g/r), a fixed point.

    Where all slips one way the linear equations say nothing about them.
    """
    amounts = np.zeros(len(problem.wanted))
    for _ in range(50):
        s = slip + np.tensordot(amounts, problem.wanted, 1)
        weight = problem.bound / np.maximum(np.hypot(*s), np.maximum(problem.bound / problem.push, 1e-300))
        matrix = np.einsum("kixy,xy,lixy->kl", problem.wanted, weight, problem.wanted)
        amounts = amounts + np.linalg.solve(matrix, -_missing(problem, -weight * s))
    return amounts


def within(p: Array, bound: Array) -> Array:
    """P(p): cut back to the bound."""
    size = np.hypot(*p)
    return p * np.where(size > bound, bound / np.where(size > bound, size, 1), 1)


def _first(problem: Shear) -> tuple[Array, Array]:
    """(amounts of the wanted slips, p - r s) where all sticks, or of the answer on a grid half as fine."""
    grid = problem.grid
    if problem.bound.size <= COARSEST or min(problem.bound.shape) < 4:
        return np.zeros(len(problem.wanted)), np.zeros_like(problem.rigid)
    coarse = replace(
        problem,
        grid=Grid((grid.nx + 1) // 2, (grid.ny + 1) // 2, 2 * grid.dx, 2 * grid.dy),
        rigid=_halved(problem.rigid, "edge"),
        bound=_halved(problem.bound, "constant"),
        wanted=_halved(problem.wanted, "edge"),
        sums=problem.sums / 4,
    )
    p, slip, amounts = tractions(coarse, tolerance=0.1)
    trial = p - coarse.push * slip
    return amounts, np.repeat(np.repeat(trial, 2, 1), 2, 2)[:, : grid.nx, : grid.ny]


def _halved(fields: Array, mode: Any) -> Array:
    """Means of two by two elements."""
    *many, nx, ny = fields.shape
    padded = np.pad(fields, [(0, 0)] * len(many) + [(0, nx % 2), (0, ny % 2)], mode=mode)
    return padded.reshape(*many, (nx + 1) // 2, 2, (ny + 1) // 2, 2).mean(axis=(-3, -1))

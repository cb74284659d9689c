"""Hurty's method in Craig and Bampton's form: physical interface coordinates and fixed-interface modes.

W. C. Hurty, AIAA Journal 3 (1965) 678, cited in Sextro 2.4; R. R. Craig, M. C. C. Bampton, AIAA Journal 6 (1968)
1313. The interface coordinates are the six rows of each patch (its area-weighted rigid motion), not every node:
the constraint modes answer unit values of them, the fixed-interface modes keep them at zero. The constraint
B u = 0 is imposed on the factorisation of K by a small matrix, so nothing is factorised twice.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from ..data import Array
from ..errors import UserError
from ..linalg import eigen
from ..linalg.canonical import signs
from .problem import Reduced, Substructure, diagonalised, hermitian, own_modes, without_modes


def reduce(problem: Substructure) -> Reduced:
    """Interface coordinates first (6 a patch, in the order of the rows), then fixed-interface modes, as many
    as modes are asked for.

    A body with rigid motions gets as many inertia-relief shapes between the two: how it yields, held at its
    interfaces, to its own inertia in those motions. With them a force that accelerates the body is answered exactly.

    Raises:
        UserError: a body without interfaces, or whose interfaces leave it a rigid motion.
    """
    chosen = problem.interface("craig-bampton")
    B = problem.rows[chosen]
    R = problem.vectors[:, : problem.rigid]
    constraint_modes, stiffness, relief = static_shapes(R, B, problem.static[:, chosen], '"craig-bampton"')
    fixed = fixed_interface_modes(
        problem.pencil, B, len(problem.values), problem.certify, problem.shift
    )
    values, relief = own_modes(problem.pencil, without_modes(problem.pencil, fixed.vectors, relief))
    vectors = np.hstack([constraint_modes, relief, fixed.vectors])
    r, inner = len(chosen), np.concatenate([values, fixed.values])
    M_r = hermitian(vectors.conj().T @ problem.pencil.M(vectors))
    M_r[r:, r:] = np.eye(len(inner))
    K_r = np.zeros_like(M_r)
    K_r[:r, :r] = stiffness
    K_r[r:, r:] = np.diag(inner)
    kind = ("interface",) * r + ("inertia-relief",) * len(values) + ("fixed-interface",) * len(fixed.values)
    return diagonalised(vectors, kind, M_r, K_r, problem.rigid)


def static_shapes(R: Array, B: sp.csr_matrix, answers: Array, what: str) -> tuple[Array, Array, Array]:
    """Constraint modes (n, b), their stiffness (b, b) and inertia-relief shapes (n, rigid), without solving again.

    With the elastic answers U of forces on the rows (F = B U, the body relieved by its inertia) and the rigid
    motions R, every static state is U f + R a, in balance with R^H B^H f = 0. Constraint modes have B u = 1; the
    inertia-relief shapes answer the loads M R with B u = 0: u = R a - U f with R^H B^H f = 1.

    Args:
        R: (n, rigid) mass-orthonormal. B: (b, n). answers: (n, b). what: needs them, for the message.

    Raises:
        UserError: the rows leave a rigid motion free.
    """
    held = np.asarray(B @ R)
    b, r = held.shape
    if r and np.linalg.matrix_rank(held, 1e-9 * np.abs(held).max(initial=1e-300)) < r:
        raise UserError(
            f"reduction: {what} needs interfaces that hold the body against its rigid motions; add an interface or "
            'use "rubin"'
        )
    F = hermitian(np.asarray(B @ answers))
    f, a = _balanced(F, held, np.eye(b), np.zeros((r, b)))
    g, c = _balanced(F, -held, np.zeros((b, r)), -np.eye(r))
    return answers @ f + R @ a, hermitian(f), R @ c - answers @ g


def _balanced(F: Array, held: Array, motion: Array, resultant: Array) -> tuple[Array, Array]:
    """f, a of F f + held a = motion and held^H f = resultant, scaled so that units do not matter."""
    if not held.shape[1]:
        return np.linalg.solve(F, motion), np.zeros((0, motion.shape[1]))
    row = 1 / np.sqrt(np.diag(F).real)
    scaled = row[:, None] * held
    column = 1 / np.linalg.norm(scaled, axis=0)
    scaled = scaled * column
    whole = np.block([[row[:, None] * F * row, scaled], [scaled.conj().T, np.zeros((len(column), len(column)))]])
    answer = np.linalg.solve(whole, np.vstack([row[:, None] * motion, column[:, None] * resultant]))
    return row[:, None] * answer[: len(F)], column[:, None] * answer[len(F) :]


def fixed_interface_modes(
    pencil: eigen.Pencil, B: sp.csr_matrix, count: int, certify: bool, shift: float = 0.0
) -> eigen.Spectrum:
    """The lowest eigenpairs of K x = lambda M x under B x = 0, certified like the free ones."""
    solver = Constrained(pencil.solver, B)

    def inside(product: eigen.MatVec, outside: float) -> eigen.MatVec:
        """The operator between shapes that keep the constraint; a number on those across it."""

        def times(x: Array) -> Array:
            along = solver.without_reactions(x)
            return solver.without_reactions(product(along)) + outside * (x - along)

        return times

    stiff = 1e3 * pencil.k_norm  # what the constraint forbids lies above every frequency that is asked for
    held = replace(pencil, solver=solver, K=inside(pencil.K, stiff), M=inside(pencil.M, pencil.m_norm), solves=0)
    found = eigen.search(held, count, shift)
    found = replace(found, vectors=found.vectors * signs(found.vectors))
    return eigen.certify(held, found, shift) if certify else found


class Constrained(eigen.DirectSolver):
    """Solutions of A x + B^H f = b, B x = 0 from a direct solver of A.

    The count of negative eigenvalues on {B x = 0} follows from Haynsworth's inertia additivity:
    n(A) + n(-B A^-1 B^H) - rows of B.
    """

    def __init__(self, inner: eigen.DirectSolver, B: sp.csr_matrix) -> None:
        self.inner, self.B, self.name = inner, B, inner.name
        self._gram = scipy.linalg.cho_factor((B @ B.conj().T).toarray())
        self._answers = self._flexibility = np.zeros((0, 0))

    def factorise(self, upper: sp.csr_matrix) -> None:
        self.inner.factorise(upper)
        self._answers = self.inner.solve(self.B.conj().T.toarray())
        self._flexibility = hermitian(np.asarray(self.B @ self._answers))

    def solve(self, b: Array) -> Array:
        x = self.inner.solve(b)
        return x - self._answers @ np.linalg.solve(self._flexibility, self.B @ x)

    def negative(self) -> int:
        of_flexibility = int((np.linalg.eigvalsh(-self._flexibility) < 0).sum())
        return self.inner.negative() + of_flexibility - self.B.shape[0]

    def without_reactions(self, forces: Array) -> Array:
        """Take out of forces the part B^H f that the constraint carries."""
        return forces - self.B.conj().T @ scipy.linalg.cho_solve(self._gram, self.B @ forces)

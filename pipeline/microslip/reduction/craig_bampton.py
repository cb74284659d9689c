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

from .. import eigen
from ..data import Array, UserError
from .problem import Problem, Reduced, diagonalised, hermitian


def reduce(problem: Problem) -> Reduced:
    """Interface coordinates first (6 a patch, in the order of the rows), then fixed-interface modes.

    Raises:
        UserError: a body with rigid motions, or without interfaces.
    """
    chosen = [i for i, label in enumerate(problem.labels) if label.startswith("interface:")]
    if not chosen:
        raise UserError('reduction: "craig-bampton" keeps interface coordinates, but the body has no [[interfaces]]')
    if problem.rigid:
        raise UserError(
            'reduction: "craig-bampton" needs a body that its supports hold; use "rubin" for one with rigid motions'
        )
    B = problem.rows[chosen]
    stiffness = hermitian(np.linalg.inv(hermitian(np.asarray(B @ problem.static[:, chosen]))))
    constraint_modes = problem.static[:, chosen] @ stiffness
    fixed = fixed_interface_modes(problem.pencil, B, len(problem.values), problem.certify)
    vectors = np.hstack([constraint_modes, fixed.vectors])
    r = len(chosen)
    M_r = hermitian(vectors.conj().T @ problem.pencil.M(vectors))
    M_r[r:, r:] = np.eye(len(fixed.values))
    K_r = np.zeros_like(M_r)
    K_r[:r, :r] = stiffness
    K_r[r:, r:] = np.diag(fixed.values)
    kind = ("interface",) * r + ("fixed-interface",) * len(fixed.values)
    return diagonalised(vectors, kind, M_r, K_r)


def fixed_interface_modes(pencil: eigen.Pencil, B: sp.csr_matrix, count: int, certify: bool) -> eigen.Spectrum:
    """The lowest eigenpairs of K x = lambda M x under B x = 0, certified like the free ones."""
    solver = _Constrained(pencil.solver, B)

    def inside(product: eigen.MatVec) -> eigen.MatVec:
        return lambda x: solver.without_reactions(product(x))

    held = replace(pencil, solver=solver, K=inside(pencil.K), M=inside(pencil.M), solves=0)
    found = eigen.search(held, count)
    return eigen.certify(held, found) if certify else found


class _Constrained(eigen.DirectSolver):
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

"""A direct solver with a few dense columns beside its matrix: low-rank changes, constraints."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..data import Array
from .direct import DirectSolver


class Bordered(DirectSolver):
    """Solutions x of A x + U y = b, U^H x + D y = 0, from a direct solver of A; without y, (A - U D^-1 U^H) x = b.

    `negative` counts the eigenvalues of the whole less `of_border`, by Haynsworth's inertia additivity.

    Args:
        U: (n, k). D: (k, k) Hermitian. of_border: eigenvalues that the border itself makes negative: of D, and one
            for each constraint, a column of U whose rows of D are zero.
    """

    def __init__(self, inner: DirectSolver, U: Array, D: Array, of_border: int) -> None:
        self.inner, self.name = inner, inner.name
        self._U, self._D, self._of_border = U, D, of_border
        self._answers, self._middle = U, D

    def factorise(self, upper: sp.csr_matrix) -> None:
        self.inner.factorise(upper)
        self._answers = self.inner.solve(self._U)
        middle = self._D - self._U.conj().T @ self._answers
        self._middle = 0.5 * (middle + middle.conj().T)

    def solve(self, b: Array) -> Array:
        x = self.inner.solve(b)
        return x + self._answers @ np.linalg.solve(self._middle, self._U.conj().T @ x)

    def negative(self) -> int:
        return self.inner.negative() + int((np.linalg.eigvalsh(self._middle) < 0).sum()) - self._of_border

    def close(self) -> None:
        self.inner.close()

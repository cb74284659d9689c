"""Direct solver of a cyclic sector: its interior is factorised once, its cut faces are condensed to a dense matrix.

At a shift s the sector with its cut faces apart has one real symmetric matrix A = K - s M for all nodal diameters.
Its interior is factorised and condensed on the two cut faces, S = A_bb - A_bi A_ii^-1 A_ib. A nodal diameter only adds
u_right = R u_left exp(+i k 2 pi / N), that is u_b = P_k u_left, so its own factorisation is that of the small
Hermitian P_k^H S P_k, and its inertia is n(A_ii) + n(P_k^H S P_k) (Haynsworth). Faces of neighbours that stay in
contact belong to the boundary too; their stiffness, which depends on k, is added to the small matrix.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from ..data import Array, Indices
from ..errors import NotConverged
from .direct import DirectSolver, Pardiso
from .eigen import available_backends, new_solver


class Condensed:
    """The interior of a sector factorised, its boundary condensed. The matrix is given by its upper triangle."""

    name = "none"

    def __init__(self, boundary: Indices) -> None:
        self.boundary = boundary
        self.upper: sp.csr_matrix | None = None
        self.schur: Array = np.zeros((0, 0))
        self.reduced: tuple[HarmonicSolver, _Dense] | None = None

    def factorise(self, upper: sp.csr_matrix) -> None:
        """Factorise, unless it is this matrix that was factorised last."""
        if upper is not self.upper:
            self.upper = self.reduced = None
            self._factorise(upper)
            self.upper = upper

    def _factorise(self, upper: sp.csr_matrix) -> None:
        raise NotImplementedError

    def forward(self, b: Array) -> Array:
        """(n, r) reduced right-hand sides; at the boundary b_b - A_bi A_ii^-1 b_i."""
        raise NotImplementedError

    def backward(self, y: Array, x_boundary: Array) -> Array:
        """(n, r) solution, from what `forward` gave and the (b, r) solution on the boundary."""
        raise NotImplementedError

    def negative(self) -> int:
        """Negative eigenvalues of the interior A_ii."""
        raise NotImplementedError

    def close(self) -> None:
        """Release memory."""


class _PardisoCondensed(Condensed):
    """MKL PARDISO with its Schur complement: one sweep forwards and one backwards a solve."""

    name = "pardiso"

    def __init__(self, boundary: Indices) -> None:
        super().__init__(boundary)
        self._pardiso = Pardiso(boundary)

    def _factorise(self, upper: sp.csr_matrix) -> None:
        self.schur = self._pardiso.factorise_condensed(upper)

    def forward(self, b: Array) -> Array:
        return self._pardiso.sweep(331, b)

    def backward(self, y: Array, x_boundary: Array) -> Array:
        y[self.boundary] = x_boundary
        return self._pardiso.sweep(333, y)

    def negative(self) -> int:
        whole = self._pardiso.negative()  # of A with its boundary
        return whole - negative_eigenvalues(self.schur) if whole else 0

    def close(self) -> None:
        self._pardiso.close()


class _PlainCondensed(Condensed):
    """The same from any direct solver of the interior: two solves where PARDISO sweeps once each way."""

    def __init__(self, boundary: Indices, solver: DirectSolver) -> None:
        super().__init__(boundary)
        self._solver = solver
        self.name = self._solver.name
        self._inner: Indices = boundary
        self._coupling = sp.csr_matrix((0, 0))

    def _factorise(self, upper: sp.csr_matrix) -> None:
        A = (upper + sp.triu(upper, 1).T).tocsr()
        self._inner = np.setdiff1d(np.arange(A.shape[0]), self.boundary)
        self._coupling = A[self._inner][:, self.boundary]
        self._solver.factorise(sp.triu(A[self._inner][:, self._inner]).tocsr())
        S = A[self.boundary][:, self.boundary].toarray()
        for some in np.array_split(np.arange(len(self.boundary)), max(1, len(self.boundary) // 64)):
            S[:, some] -= self._coupling.T @ self._solver.solve(self._coupling[:, some].toarray())
        self.schur = 0.5 * (S + S.T)

    def forward(self, b: Array) -> Array:
        y = b.copy()
        y[self.boundary] -= self._coupling.T @ self._solver.solve(b[self._inner])
        return y

    def backward(self, y: Array, x_boundary: Array) -> Array:
        x = np.empty_like(y)
        x[self.boundary] = x_boundary
        x[self._inner] = self._solver.solve(y[self._inner] - self._coupling @ x_boundary)
        return x

    def negative(self) -> int:
        return self._solver.negative()

    def close(self) -> None:
        self._solver.close()


def new_condensed(boundary: Indices, name: str = "auto", ranks: int = 1) -> Condensed:
    """A fresh solver; ``auto`` takes the fastest backend there is."""
    chosen = available_backends()[0] if name == "auto" else name
    return _PardisoCondensed(boundary) if chosen == "pardiso" else _PlainCondensed(boundary, new_solver(chosen, ranks))


def negative_eigenvalues(A: Array) -> int:
    """Number of negative eigenvalues of a dense Hermitian matrix, from its Bunch-Kaufman factors."""
    if not len(A):
        return 0
    _, D, _ = scipy.linalg.ldl(A, hermitian=True)
    diagonal, beside = np.diag(D).real, np.abs(np.diag(D, -1)) ** 2
    pair = beside > 0
    alone = np.ones(len(A), dtype=bool)
    alone[:-1][pair] = alone[1:][pair] = False
    a, c = diagonal[:-1][pair], diagonal[1:][pair]
    determinant = a * c - beside[pair]
    in_pairs = np.where(determinant < 0, 1, np.where(a < 0, 2, 0)).sum()
    return int((diagonal[alone] < 0).sum() + in_pairs)


class HarmonicSolver(DirectSolver):
    """Solutions of T_k^H A T_k q = T_k^H f for one nodal diameter; many share one `Condensed`.

    Args:
        condensed: of the sector, its boundary the degrees of freedom on the cut faces and those that `between` joins.
        transformation: (f, m) T_k. stay: (m,) position of each unknown among the f free degrees of freedom, ascending.
        between: (f, f) Hermitian, what joins neighbouring sectors besides the cut faces at this nodal diameter
            (contacts), or None.
    """

    def __init__(
        self, condensed: Condensed, transformation: sp.csr_matrix, stay: Indices, between: sp.csr_matrix | None = None
    ) -> None:
        self.condensed, self.name = condensed, condensed.name
        edge = condensed.boundary
        own = np.searchsorted(stay, edge[np.isin(edge, stay)])
        self._P = transformation[edge][:, own].tocsr()
        self._T, self._stay = transformation, stay
        self._between = None if between is None else (self._P.conj().T @ between[edge][:, edge] @ self._P).toarray()

    def factorise(self, upper: sp.csr_matrix) -> None:
        self.condensed.factorise(upper)
        self._reduce()

    def _reduce(self) -> _Dense:
        half = self._P.conj().T @ self.condensed.schur
        S = (self._P.T @ half.T).T  # P^H S P
        dense = _Dense(S if self._between is None else S + self._between)
        self.condensed.reduced = (self, dense)
        return dense

    @property
    def _dense(self) -> _Dense:
        """The small factors; of all nodal diameters only those asked last are kept, each is as large as S."""
        kept = self.condensed.reduced
        return kept[1] if kept is not None and kept[0] is self else self._reduce()

    def solve(self, b: Array) -> Array:
        flat = b.reshape(len(b), -1)
        whole = np.zeros((self._T.shape[0], flat.shape[1]), dtype=flat.dtype)
        whole[self._stay] = flat
        y = as_complex(self.condensed.forward(as_real(whole)), flat.dtype)
        x_left = self._dense.solve(self._P.conj().T @ y[self.condensed.boundary])
        x = self.condensed.backward(as_real(y), as_real(self._P @ x_left))
        return as_complex(x, flat.dtype)[self._stay].reshape(b.shape)

    def negative(self) -> int:
        return self.condensed.negative() + self._dense.negative()


class _Dense:
    """Factors of a dense Hermitian matrix: Cholesky's, or where it is indefinite L U."""

    def __init__(self, A: Array) -> None:
        self._A: Array | None = 0.5 * (A + A.conj().T)
        self._factor: tuple[Array, bool] | None = None
        try:
            self._factor = scipy.linalg.cho_factor(self._A, check_finite=False)
            self._A = None
        except scipy.linalg.LinAlgError:
            pass  # an indefinite one is asked for its inertia, hardly ever solved with

    def solve(self, g: Array) -> Array:
        if self._factor is not None:
            return scipy.linalg.cho_solve(self._factor, g, check_finite=False)
        assert self._A is not None
        try:
            return scipy.linalg.solve(self._A, g, assume_a="her")
        except scipy.linalg.LinAlgError as error:
            raise NotConverged("the condensed matrix of the cut faces is singular; the sector is not held") from error

    def negative(self) -> int:
        return 0 if self._A is None else negative_eigenvalues(self._A)


def as_real(x: Array) -> Array:
    """(n, r) or, of complex numbers, (n, 2 r): real and imaginary parts beside each other."""
    return np.ascontiguousarray(x).view(np.float64) if np.iscomplexobj(x) else x


def as_complex(x: Array, dtype: np.dtype) -> Array:
    """The way back from `as_real`, to the given type."""
    return np.ascontiguousarray(x).view(np.complex128) if np.dtype(dtype).kind == "c" else x

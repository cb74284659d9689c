"""Direct solvers of symmetric sparse matrices in this process: Intel MKL's PARDISO and SciPy's SuperLU."""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from ..data import Array, Indices
from ..errors import NotConverged


class DirectSolver:
    """L D L^T of symmetric matrices that share one sparsity pattern (given by their upper triangles)."""

    name = "none"

    def factorise(self, upper: sp.csr_matrix) -> None:
        """Factorise; the first call also analyses the pattern, later ones must have the same pattern."""
        raise NotImplementedError

    def factorise_definite(self, upper: sp.csr_matrix) -> None:
        """The same for a matrix that is positive definite unless the body is unstable: no pivots need be sought."""
        self.factorise(upper)

    def solve(self, b: Array) -> Array:
        """Solve for one (n,) or several (n, r) right-hand sides."""
        raise NotImplementedError

    def negative(self) -> int:
        """Number of negative eigenvalues of the factorised matrix (Sylvester's law of inertia)."""
        raise NotImplementedError

    def close(self) -> None:
        """Release memory."""


class Pardiso(DirectSolver):
    """MKL PARDISO, real symmetric indefinite (mtype -2), no scaling, no matching, no refinement.

    Args:
        boundary: unknowns to be condensed on (`factorise_condensed`, `sweep`); None for an ordinary solver.
    """

    name = "pardiso"

    def __init__(self, boundary: Indices | None = None) -> None:
        # PyPardiso looks for MKL by asking the compiler and walking the environment; the wheel's place is known.
        found = sorted(Path(sys.prefix, "lib").glob("libmkl_rt.so*"))
        if found:
            os.environ.setdefault("PYPARDISO_MKL_RT", str(found[0]))
        import pypardiso

        self._mkl = pypardiso.PyPardisoSolver(mtype=-2)
        # 1: take these settings; 2: METIS; 8: no refinement; 10: pivot perturbation 1e-8; 11, 13: no scaling and
        # matching; 18: count non-zeros; 21: 1x1 and 2x2 pivots. PyPardiso's default (iparm 1 = 0) refines twice.
        for i, value in {1: 1, 2: 2, 8: 0, 10: 8, 11: 0, 13: 0, 18: -1, 21: 1, 24: 0}.items():
            self._mkl.set_iparm(i, value)
        self._boundary = boundary
        if boundary is not None:
            self._mkl.set_iparm(36, 2)  # Schur complement, and factors for `sweep`
        self._upper: sp.csr_matrix | None = None
        self._ia = self._ja = np.zeros(0, dtype=np.int32)

    def factorise(self, upper: sp.csr_matrix) -> None:
        self._mkl.set_iparm(21, 1)  # stays as it is for the solves
        self._call(self._phase(upper), np.zeros(upper.shape[0]))

    def factorise_definite(self, upper: sp.csr_matrix) -> None:
        self._mkl.set_iparm(21, 0)  # a quarter faster
        self._call(self._phase(upper), np.zeros(upper.shape[0]))

    def _phase(self, upper: sp.csr_matrix) -> int:
        first = self._upper is None
        self._upper = upper
        if first:
            self._ia, self._ja = upper.indptr.astype(np.int32) + 1, upper.indices.astype(np.int32) + 1
            if self._boundary is not None:
                self._mkl.perm = np.zeros(upper.shape[0], dtype=np.int32)
                self._mkl.perm[self._boundary] = 1
        return 12 if first else 22

    def factorise_condensed(self, upper: sp.csr_matrix) -> Array:
        """(b, b) Schur complement on the boundary, in its order; `negative` counts for the whole matrix."""
        assert self._boundary is not None
        order = np.argsort(self._boundary, kind="stable")  # PARDISO keeps the boundary in ascending order
        size = len(order)
        S = self._call(self._phase(upper), np.zeros(upper.shape[0]), out=np.zeros((size, size)))
        back = np.empty_like(order)
        back[order] = np.arange(size)
        return S[np.ix_(back, back)]

    def sweep(self, phase: int, b: Array) -> Array:
        """Forward (331) or backward (333) substitution with the interior's factors, (n, r)."""
        return self._call(phase, np.asfortranarray(b, dtype=float))

    def solve(self, b: Array) -> Array:
        return self._call(33, np.asfortranarray(b, dtype=float))

    def negative(self) -> int:
        return int(self._mkl.get_iparm(23))

    def close(self) -> None:
        if self._upper is not None:
            self._call(-1, np.zeros(self._upper.shape[0]))
            self._upper = None

    def _call(self, phase: int, b: Array, out: Array | None = None) -> Array:
        assert self._upper is not None
        x = np.zeros_like(b) if out is None else out
        error = ctypes.c_int32(0)
        solver = self._mkl

        def number(value: int) -> Any:
            return ctypes.byref(ctypes.c_int32(value))

        def pointer(array: Array, kind: type) -> Any:
            return array.ctypes.data_as(ctypes.POINTER(kind))

        solver._mkl_pardiso(
            pointer(solver.pt, ctypes.c_int64), number(1), number(1), number(solver.mtype), number(phase),
            number(self._upper.shape[0]), pointer(self._upper.data, ctypes.c_double),
            pointer(self._ia, ctypes.c_int32), pointer(self._ja, ctypes.c_int32), pointer(solver.perm, ctypes.c_int32),
            number(1 if b.ndim == 1 else b.shape[1]), pointer(solver.iparm, ctypes.c_int32), number(0),
            pointer(b, ctypes.c_double), pointer(x, ctypes.c_double), ctypes.byref(error),
        )  # fmt: skip
        if error.value == -2:
            raise NotConverged("the sparse solver ran out of memory; use a coarser mesh or a machine with more memory")
        if error.value:
            raise NotConverged(f"the sparse solver PARDISO failed with error {error.value} in phase {phase}")
        return x


class SuperLU(DirectSolver):
    """SciPy's SuperLU in symmetric mode; the inertia count falls back on QDLDL when rows were exchanged."""

    name = "superlu"

    def __init__(self) -> None:
        self._lu: spla.SuperLU | None = None
        self._upper: sp.csr_matrix | None = None

    def factorise(self, upper: sp.csr_matrix) -> None:
        self._upper = upper
        whole = (upper + sp.triu(upper, 1).T).tocsc()
        try:
            self._lu = spla.splu(
                whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )
        except RuntimeError as error:
            raise NotConverged(f"the sparse solver met a singular matrix ({error}); the body is not held") from error
        except MemoryError as error:
            raise NotConverged("the sparse solver ran out of memory; use a coarser mesh") from error

    def solve(self, b: Array) -> Array:
        assert self._lu is not None
        return self._lu.solve(b)

    def negative(self) -> int:
        assert self._lu is not None and self._upper is not None
        if np.array_equal(self._lu.perm_r, self._lu.perm_c):
            return int((self._lu.U.diagonal() < 0).sum())
        import qdldl

        return int((np.asarray(qdldl.Solver(self._upper.tocsc(), upper=True).factors()[1]) < 0).sum())

    def close(self) -> None:
        self._lu = None

"""Rubin's method: eigenmodes and the residual attachment modes of every interface and load row.

S. Rubin, AIAA Journal 13 (1975) 995. The residual attachment modes are what the kept modes leave of the static
answers; they are orthogonal to the modes through M and K, so diagonalising them among themselves keeps the modes
as they are and adds pseudo-modes above the band. The static answer to forces on the rows is exact.
"""

from __future__ import annotations

import numpy as np

from ..data import Array
from .problem import Problem, Reduced, diagonal, hermitian

_SMALLEST = 1e-13  # share of a row's residual compliance below which a direction is taken to be held already


def reduce(problem: Problem) -> Reduced:
    """Eigenmodes and pseudo-modes, all M-orthonormal and K-orthogonal."""
    values, vectors = pseudo_modes(problem)
    kept = len(problem.values)
    kind = ("rigid",) * problem.rigid + ("normal",) * (kept - problem.rigid) + ("attachment",) * len(values)
    return diagonal(
        np.hstack([problem.vectors, vectors]), kind, np.concatenate([problem.values, values]), problem.rigid
    )


def pseudo_modes(problem: Problem) -> tuple[Array, Array]:
    """(p,) eigenvalues and (n, p) shapes of the body within the span of its residual attachment modes."""
    X, M, K = problem.vectors, problem.pencil.M, problem.pencil.K
    residual = problem.static - X @ (M(X).conj().T @ problem.static)
    residual -= X @ (M(X).conj().T @ residual)
    k = hermitian(residual.conj().T @ K(residual))
    scale = np.sqrt(np.maximum(np.diag(k).real, 1e-300))
    w, Q = np.linalg.eigh(k / np.outer(scale, scale))
    keep = w > _SMALLEST * max(w.max(initial=0.0), 1e-300)
    Y = residual @ (Q[:, keep] / scale[:, None] / np.sqrt(w[keep]))  # Y^H K Y = 1
    inverse, V = np.linalg.eigh(hermitian(Y.conj().T @ M(Y)))
    order = np.argsort(-inverse)
    inverse, V = inverse[order], V[:, order]
    Z = Y @ (V / np.sqrt(inverse))
    return np.einsum("ij,ij->j", Z.conj(), K(Z)).real, Z

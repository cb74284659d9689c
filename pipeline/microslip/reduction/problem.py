"""What a reduction method is given and what it returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from ..data import Array
from ..eigen import Pencil


@dataclass(frozen=True)
class Problem:
    """The unreduced body on its free degrees of freedom and the answers that are known of it.

    Real and symmetric, or complex and Hermitian (a sector at a nodal diameter); rows read ``rows @ u`` and load
    ``rows.conj().T @ f``.

    Attributes:
        pencil: K and M with a direct solver. values, vectors: the (m,) lowest eigenvalues and (n, m) shapes, rigid
            ones first. rigid: how many of them are rigid. certify: whether further spectra are to be certified.
        rows: (r, n) interface and load rows that must be statically exact. labels: r texts.
        static: (n, r) elastic displacement under a unit force on each row (inertia relief when free).
    """

    pencil: Pencil
    values: Array
    vectors: Array
    rigid: int
    rows: sp.csr_matrix
    labels: tuple[str, ...]
    static: Array
    certify: bool = True


@dataclass(frozen=True)
class Reduced:
    """Generalised coordinates.

    Attributes:
        vectors: (n, c) shape of each coordinate. kind: c texts (``rigid``, ``normal``, ``attachment``,
            ``interface``, ``fixed-interface``). M_r, K_r: (c, c).
        to_diagonal: (c, c) V with V^H M_r V = 1 and V^H K_r V = diag(omega^2), None if they are diagonal already.
        omega: (c,) rad/s, ascending, of the reduced body.
    """

    vectors: Array
    kind: tuple[str, ...]
    M_r: Array
    K_r: Array
    omega: Array
    to_diagonal: Array | None = None


def hermitian(A: Array) -> Array:
    """The Hermitian part of a square matrix that differs from it by rounding."""
    return 0.5 * (A + A.conj().T)


def diagonal(vectors: Array, kind: tuple[str, ...], values: Array, rigid: int) -> Reduced:
    """`Reduced` for shapes that are M-orthonormal and K-orthogonal."""
    omega = np.sqrt(np.maximum(values, 0.0))
    omega[:rigid] = 0.0
    return Reduced(vectors, kind, np.eye(len(omega)), np.diag(omega**2), omega)


def diagonalised(vectors: Array, kind: tuple[str, ...], M_r: Array, K_r: Array) -> Reduced:
    """`Reduced` in physical coordinates, with the transformation to its own modes beside it."""
    values, V = scipy.linalg.eigh(hermitian(K_r), hermitian(M_r))
    return Reduced(vectors, kind, M_r, K_r, np.sqrt(np.maximum(values, 0.0)), V)

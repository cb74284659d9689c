"""What a reduction method is given and what it returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from ..data import Array, Indices
from ..errors import UserError
from ..linalg.canonical import signs
from ..linalg.eigen import Pencil


@dataclass(frozen=True)
class Substructure:
    """The unreduced body on its free degrees of freedom and the answers that are known of it.

    Real and symmetric, or complex and Hermitian (a sector at a nodal diameter); rows read ``rows @ u`` and load
    ``rows.conj().T @ f``.

    Attributes:
        pencil: K and M with a direct solver. values, vectors: the (m,) lowest eigenvalues and (n, m) shapes, rigid
            ones first. rigid: how many of them are rigid. certify: whether further spectra are to be certified.
        rows: (r, n) interface and load rows that must be statically exact. labels: r texts.
        static: (n, r) elastic displacement under a unit force on each row (inertia relief when free).
        shift: (rad/s)^2 at which K - shift M can be factorised: 0, or negative for a body with rigid motions.
    """

    pencil: Pencil
    values: Array
    vectors: Array
    rigid: int
    rows: sp.csr_matrix
    labels: tuple[str, ...]
    static: Array
    certify: bool = True
    shift: float = 0.0

    @property
    def kind(self) -> tuple[str, ...]:
        """``rigid`` or ``normal`` for each of the shapes."""
        return ("rigid",) * self.rigid + ("normal",) * (len(self.values) - self.rigid)

    def interface(self, method: str) -> Indices:
        """Which of the rows belong to interfaces.

        Raises:
            UserError: there are none, or some of them depend on each other.
        """
        chosen = np.array([i for i, label in enumerate(self.labels) if label.startswith("interface:")], dtype=int)
        if not len(chosen):
            raise UserError(f'reduction: "{method}" keeps interface coordinates, but the body has no [[interfaces]]')
        refuse_dependent(np.asarray(self.rows[chosen] @ self.static[:, chosen]), [self.labels[i] for i in chosen])
        return chosen

    def residual(self, chosen: Indices | slice) -> Array:
        """(n, b) residual attachment modes of some rows: what the kept modes leave of their static answers."""
        return without_modes(self.pencil, self.vectors, self.static[:, chosen])


@dataclass(frozen=True)
class Reduced:
    """Generalised coordinates.

    Attributes:
        vectors: (n, c) shape of each coordinate. kind: c texts (``rigid``, ``normal``, ``attachment``,
            ``interface``, ``fixed-interface``, ``inertia-relief``, ``massless-interface``, ``interface-force``).
            M_r, K_r: (c, c).
        to_diagonal: (c, p) V with V^H M_r V = 1 and V^H K_r V = diag(omega^2), None if they are diagonal already;
            p < c where the method has coordinates without mass or with forces for coordinates.
        omega: (p,) rad/s, ascending, of the reduced body with nothing on its interfaces.
        residual: (n, r) displacement under a unit force on each row of the problem that stands beside the
            coordinates and is added by the solver, or None.
    """

    vectors: Array
    kind: tuple[str, ...]
    M_r: Array
    K_r: Array
    omega: Array
    to_diagonal: Array | None = None
    residual: Array | None = None


def hermitian(A: Array) -> Array:
    """The Hermitian part of a square matrix that differs from it by rounding."""
    return 0.5 * (A + A.conj().T)


def frequencies(values: Array, rigid: int) -> Array:
    """(m,) rad/s from eigenvalues; exactly 0 for the rigid ones."""
    omega = np.sqrt(np.maximum(values, 0.0))
    omega[:rigid] = 0.0
    return omega


def diagonal(vectors: Array, kind: tuple[str, ...], values: Array, rigid: int) -> Reduced:
    """`Reduced` for shapes that are M-orthonormal and K-orthogonal."""
    omega = frequencies(values, rigid)
    return Reduced(vectors, kind, np.eye(len(omega)), np.diag(omega**2), omega)


def diagonalised(vectors: Array, kind: tuple[str, ...], M_r: Array, K_r: Array, rigid: int = 0) -> Reduced:
    """`Reduced` in physical coordinates, with the transformation to its own modes beside it."""
    size = 1 / np.sqrt(np.diag(M_r).real)  # coordinates of different units
    values, V = scipy.linalg.eigh(*(hermitian(size[:, None] * A * size) for A in (K_r, M_r)))
    V = size[:, None] * (V * signs(V))
    return Reduced(vectors, kind, M_r, K_r, frequencies(values, rigid), V)


def without_modes(pencil: Pencil, X: Array, shapes: Array) -> Array:
    """(n, b) shapes with the M-orthonormal modes X taken out; the second pass takes out what rounding left."""
    MX = pencil.M(X)
    for _ in range(2):
        shapes = shapes - X @ (MX.conj().T @ shapes)
    return shapes


def own_modes(pencil: Pencil, shapes: Array, smallest: float = 1e-13) -> tuple[Array, Array]:
    """(p,) eigenvalues and (n, p) M-orthonormal shapes of the body within the span of some elastic shapes.

    Args:
        smallest: share of the stiffest scaled direction below which a direction is taken to be there already.
    """
    K, M = pencil.K, pencil.M
    k = hermitian(shapes.conj().T @ K(shapes))
    scale = np.sqrt(np.maximum(np.diag(k).real, 1e-300))
    w, Q = np.linalg.eigh(k / np.outer(scale, scale))
    keep = w > smallest * max(w.max(initial=0.0), 1e-300)
    Y = shapes @ (Q[:, keep] / scale[:, None] / np.sqrt(w[keep]))  # Y^H K Y = 1
    inverse, V = np.linalg.eigh(hermitian(Y.conj().T @ M(Y)))
    order = np.argsort(-inverse)
    inverse, V = inverse[order], V[:, order]
    Z = Y @ (V / np.sqrt(inverse))
    Z = Z * signs(Z)
    return np.einsum("ij,ij->j", Z.conj(), K(Z)).real, Z


_DEPENDENT = 1e-11  # share of the largest scaled compliance below which a combination of rows cannot be told from zero


def refuse_dependent(compliance: Array, labels: list[str]) -> None:
    """Refuse interface rows that no force moves, or of which one follows from the others.

    Raises:
        UserError: with the row at fault.
    """
    size = np.diag(compliance).real
    alike = [label.split(":")[-1][:3] == "phi" for label in labels]  # rotations are compared with rotations
    top = np.array([max((s for s, a in zip(size, alike, strict=True) if a == b), default=0.0) for b in alike])
    stuck = np.flatnonzero(size <= 1e-13 * top)
    if len(stuck):
        _, name, row = labels[stuck[0]].split(":", 2)
        raise UserError(
            f"interfaces.{name}: {row} cannot move: the supports hold it; choose a face that they leave free"
        )
    scale = np.sqrt(size)
    w, Q = np.linalg.eigh(hermitian(compliance) / np.outer(scale, scale))
    if w[0] > _DEPENDENT * w[-1]:
        return
    found = [labels[i].split(":", 2)[1:] for i in np.argsort(-np.abs(Q[:, 0]))[:2]]
    raise UserError(
        f"interfaces.{found[0][0]}: {found[0][1]} follows from the other interface coordinates (first of all "
        f"{found[1][0]} {found[1][1]}); remove an interface that lies on another one"
    )

"""Factorisation, shift-invert Lanczos and the inertia certificate, with one door for direct solvers.

Backends: ``pardiso`` (Intel MKL through pypardiso; x86-64 Linux and Windows), ``superlu`` (SciPy; installs
everywhere) and ``petsc`` (MUMPS on several ranks, `petsc.Petsc`). The first two analyse a sparsity pattern once, for
every shift and speed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from .. import interrupts
from ..data import Array
from ..errors import NotConverged
from .direct import DirectSolver as DirectSolver
from .direct import Pardiso, SuperLU
from .petsc import Petsc

TOLERANCE = 1e-9
MatVec = Callable[[Array], Array]

BACKENDS: dict[str, type[DirectSolver]] = {"pardiso": Pardiso, "superlu": SuperLU}
"""Those of this process, fastest first."""


@cache
def available_backends() -> tuple[str, ...]:
    """Names of the backends of this process that start on this machine, fastest first."""
    found = []
    for name, backend in BACKENDS.items():
        try:
            backend()
            found.append(name)
        except (ImportError, OSError):
            continue
    return tuple(found)


def new_solver(name: str = "auto", ranks: int = 1) -> DirectSolver:
    """A fresh direct solver: ``auto`` takes the fastest backend there is; ``petsc`` works on `ranks` processes.

    Raises:
        UserError: ``petsc`` is asked for and is not here.
    """
    if name == "petsc":
        return Petsc(ranks)
    return BACKENDS[available_backends()[0] if name == "auto" else name]()


def symmetric_product(upper: sp.csr_matrix) -> MatVec:
    """Products of a symmetric matrix, given by its upper triangle, with an (n,) or (n, r) array."""
    diagonal, lower = upper.diagonal(), upper.T
    return lambda x: upper @ x + lower @ x - (diagonal * x.T).T


class Unstable(NotConverged):
    """K - shift M has negative eigenvalues where it must not: the body diverges. `count`: how many."""

    def __init__(self, count: int) -> None:
        super().__init__(f"the stiffness has {count} negative eigenvalues: the body is unstable")
        self.count = count


@dataclass(frozen=True)
class Spectrum:
    """The lowest eigenpairs of K x = lambda M x.

    Attributes:
        values: (m,) ascending, (rad/s)^2. vectors: (n, m) M-orthonormal.
        certified: True if the inertia count at `upper_shift` found exactly m eigenvalues below it.
        upper_shift: (rad/s)^2, between the last value returned and the next one. gap: those two.
        refound: how many members Lanczos had missed and a second search found.
        backward_error: (m,) |K x - lambda M x| over |K| |x| + |lambda| |M| |x|.
        orthogonality: largest entry of |X^T M X - 1|.
        solves: right-hand sides solved.
    """

    values: Array
    vectors: Array
    certified: bool
    upper_shift: float
    gap: tuple[float, float]
    refound: int
    backward_error: Array
    orthogonality: float
    solves: int


@dataclass
class Pencil:
    """K x = lambda M x on the free degrees of freedom.

    Attributes:
        shifted: s -> upper triangle of K - s M, always with the same pattern.
        K, M: products with an (n,) or (n, r) array.
        n: degrees of freedom. k_norm, m_norm: infinity norms of K and M (for backward errors).
        solver: keeps the analysis between shifts. solves: right-hand sides solved so far.
        dtype: float, or complex for a Hermitian pencil. tell: is told how far the search is: ``24 of 80 Lanczos ...``.
    """

    shifted: Callable[[float], sp.csr_matrix]
    K: MatVec
    M: MatVec
    n: int
    k_norm: float
    m_norm: float
    solver: DirectSolver
    solves: int = 0
    dtype: Any = float
    tell: Callable[[str], None] = lambda _: None

    def solve(self, b: Array) -> Array:
        """Solve with the matrix that was factorised last, counting."""
        self.solves += 1 if b.ndim == 1 else b.shape[1]
        return self.solver.solve(b)


def search(
    pencil: Pencil, count: int, shift: float = 0.0, tolerance: float = TOLERANCE, rigid: Array | None = None
) -> Spectrum:
    """At least the `count` lowest eigenpairs by shift-invert Lanczos, not yet certified.

    A cluster at the upper end is kept whole: the count is enlarged until a gap follows, so that no member of a
    pair is cut off. The solver is left factorised at `shift`, for the static solutions that follow.

    Args:
        pencil: K and M; M positive semidefinite. shift: (rad/s)^2; 0 for a held body, negative for a free one.
        tolerance: residual of (K - shift M)^-1 M over its eigenvalue. rigid: (n, r) M-orthonormal vectors with
            K R = 0, kept as the first r pairs.

    Raises:
        Unstable: eigenvalues below `shift`. NotConverged: Lanczos failed.
    """
    pencil.solver.factorise_definite(pencil.shifted(shift))
    if negative := pencil.solver.negative():
        raise Unstable(negative)
    known = np.zeros((pencil.n, 0), dtype=pencil.dtype) if rigid is None else rigid
    zeros = np.zeros(known.shape[1])
    extra, before = 2, pencil.solves
    while True:
        wanted = min(count + extra, pencil.n) - len(zeros)
        values, vectors = _lanczos(pencil, max(wanted, 1), shift, tolerance, known)
        every = len(values) < max(wanted, 1) or len(zeros) + len(values) >= pencil.n  # no further one exists
        values, vectors = np.concatenate([zeros, values]), np.hstack([known, vectors])
        keep, gap = first_gap(values, count)
        if keep or every:
            break
        extra *= 4
    keep = keep or len(values)
    return _finish(pencil, values[:keep], vectors[:, :keep], False, 0.5 * sum(gap), gap, 0, pencil.solves - before)


def certify(pencil: Pencil, found: Spectrum, shift: float = 0.0, tolerance: float = TOLERANCE) -> Spectrum:
    """Count the eigenvalues below the upper end of the band (Sturm) and search again for any that are missing.

    Args:
        pencil, shift, tolerance: as given to `search`. found: its result.

    Returns:
        The complete spectrum, `certified`, with `refound` members that Lanczos had missed.

    Raises:
        NotConverged: the count cannot be met.
    """
    before = pencil.solves
    values, vectors = found.values, found.vectors
    for _ in range(6):
        pencil.solver.factorise(pencil.shifted(found.upper_shift))
        below = pencil.solver.negative()
        if below == len(values):
            refound, solves = len(values) - len(found.values), found.solves + pencil.solves - before
            if not refound:
                return replace(found, certified=True, solves=solves)
            return _finish(pencil, values, vectors, True, found.upper_shift, found.gap, refound, solves)
        if below < len(values):
            raise NotConverged(
                f"{len(values)} eigenvalues were returned below {np.sqrt(abs(found.upper_shift)) / 2 / np.pi:.6g} Hz "
                f"but only {below} exist; the factorisation is inaccurate (very thin or badly shaped elements?)"
            )
        pencil.solver.factorise(pencil.shifted(shift))
        more, fresh = _lanczos(pencil, below - len(values), shift, tolerance, vectors)
        inside = more < found.upper_shift
        values, vectors = np.concatenate([values, more[inside]]), np.hstack([vectors, fresh[:, inside]])
        order = np.argsort(values, kind="stable")
        values, vectors = values[order], vectors[:, order]
    raise NotConverged("the spectrum could not be certified complete: ask for a few modes more or fewer")


def _finish(
    pencil: Pencil, values: Array, vectors: Array, certified: bool, upper: float, gap: tuple[float, float],
    refound: int, solves: int,
) -> Spectrum:  # fmt: skip
    vectors, MX = _orthonormal(pencil, vectors)
    KX = pencil.K(vectors)
    values = np.einsum("ij,ij->j", vectors.conj(), KX).real
    size = np.abs(vectors).max(axis=0)
    residual = np.abs(KX - MX * values).max(axis=0)
    backward = residual / (size * (pencil.k_norm + np.abs(values) * pencil.m_norm))
    gram = vectors.conj().T @ MX
    worst = float(np.abs(gram - np.eye(len(values))).max()) if len(values) else 0.0
    return Spectrum(values, vectors, certified, upper, gap, refound, backward, worst, solves)


def _orthonormal(pencil: Pencil, X: Array) -> tuple[Array, Array]:
    """X and M X, made M-orthonormal symmetrically (Loewdin), which moves every vector as little as possible."""
    MX = pencil.M(X)
    gram = X.conj().T @ MX
    if np.abs(gram - np.eye(len(gram))).max(initial=0.0) < 1e-13:
        return X, MX
    w, Q = np.linalg.eigh(0.5 * (gram + gram.conj().T))
    root = (Q / np.sqrt(w)) @ Q.conj().T
    return X @ root, MX @ root


def first_gap(values: Array, count: int) -> tuple[int, tuple[float, float]]:
    """How many values to keep, at least `count`, and the gap after them; 0 if no gap was seen."""
    for keep in range(max(count, 1), len(values)):
        low, high = values[keep - 1], values[keep]
        if high - low > 1e-5 * abs(high):
            return keep, (float(low), float(high))
    return 0, (float(values[-1]), float(values[-1] * (1 + 2e-4) + 2.0))


def _lanczos(pencil: Pencil, count: int, shift: float, tolerance: float, known: Array) -> tuple[Array, Array]:
    """The `count` eigenpairs nearest above `shift`, outside the span of `known`, ascending.

    Block Lanczos on (K - shift M)^-1 M with full reorthogonalisation: a direct solver gives several right-hand
    sides for little more than one, a block sees repeated eigenvalues, and the basis stays small because
    shift-invert separates the wanted end. Where the basis would need too much memory ARPACK restarts instead.
    """
    if count >= pencil.n - 2 or pencil.n < 200:  # complex ARPACK has no room for two less
        return _dense(pencil, count, known)
    block = min(4, count)
    limit = int(min(pencil.n - known.shape[1], max(4 * count, count + 60)) // block)
    if 2 * limit * block * pencil.n > 6e8 or limit < 2:
        return _arpack(pencil, count, shift, tolerance, known)
    M_known = pencil.M(known) if known.shape[1] else known
    Q = np.empty((pencil.n, (limit + 1) * block), order="F", dtype=pencil.dtype)
    MQ = np.empty_like(Q)
    T = np.zeros((Q.shape[1], Q.shape[1]), dtype=pencil.dtype)
    start = np.random.default_rng(2007 + known.shape[1]).standard_normal((pencil.n, block)).astype(pencil.dtype)
    W = _away_from(known, M_known, pencil.solve(pencil.M(start)))
    Q[:, :block], MQ[:, :block], _ = _mass_qr(W, pencil.M(W))
    wanted = min(count, limit * block)
    look = wanted + block
    for step in range(limit):
        interrupts.look()
        done = (step + 1) * block
        pencil.tell(f"{done} of {limit * block} Lanczos vectors at most, {wanted} modes wanted")
        last, new = slice(done - block, done), slice(done, done + block)
        W = _away_from(known, M_known, pencil.solve(MQ[:, last]))
        near = slice(max(done - 2 * block, 0), done)
        T[near, last] = _take_out(W, Q[:, near], MQ[:, near])  # all there is in exact arithmetic
        T[:done, last] += _take_out(W, Q[:, :done], MQ[:, :done])  # and what rounding leaves
        Q[:, new], MQ[:, new], R = _mass_qr(W, pencil.M(W))
        T[new, last] = R
        if done < look:
            continue
        look = done + block if done < 160 else int(1.1 * done)  # a large one is not looked at in every step
        theta, S = np.linalg.eigh(0.5 * (T[:done, :done] + T[:done, :done].conj().T))
        theta, S = theta[::-1][:wanted], S[:, ::-1][:, :wanted]
        if (np.linalg.norm(R @ S[last], axis=0) < tolerance * np.abs(theta)).all():
            pencil.tell(f"{done} of {done} Lanczos vectors, the rest was not needed")
            values = shift + 1 / theta
            order = np.argsort(values, kind="stable")
            return values[order], (Q[:, :done] @ S)[:, order]
    return _arpack(pencil, count, shift, tolerance, known)


def _take_out(W: Array, Q: Array, MQ: Array) -> Array:
    """Make W M-orthogonal to Q, in place; returns Q^T M W as it was. Arrays stored by columns."""
    h = (W.conj().T @ MQ).conj().T
    W -= (h.T @ Q.T).T  # a third faster than Q @ h, which would be stored by rows
    return h


def _away_from(known: Array, M_known: Array, X: Array) -> Array:
    return X - known @ (M_known.conj().T @ X) if known.shape[1] else X


_SINGULAR = "the stiffness is singular: a part of the body is held by nothing; support it or join it to the rest"


def _mass_qr(W: Array, MW: Array) -> tuple[Array, Array, Array]:
    """W = Q R with Q^T M Q = 1 from W and M W, by Cholesky twice (the second pass cleans what the first leaves)."""
    total = np.eye(W.shape[1], dtype=W.dtype)
    for _ in range(2):
        gram = W.conj().T @ MW
        scale = np.sqrt(np.maximum(np.diag(gram).real, 1e-300))
        gram = gram / np.outer(scale, scale)
        try:
            R = scipy.linalg.cholesky(0.5 * (gram + gram.conj().T) + 1e-15 * np.eye(len(gram))) * scale
        except scipy.linalg.LinAlgError as error:
            raise NotConverged(_SINGULAR) from error
        inverse = scipy.linalg.solve_triangular(R, np.eye(len(R)))
        W, MW, total = W @ inverse, MW @ inverse, R @ total
    return W, MW, total


def _arpack(pencil: Pencil, count: int, shift: float, tolerance: float, known: Array) -> tuple[Array, Array]:
    """ARPACK in shift-invert mode with a fixed start vector; the columns of `known` are projected out."""
    n = pencil.n
    M_known = pencil.M(known) if known.shape[1] else known

    def inverse(b: Array) -> Array:
        b = b.reshape(-1)
        return _away_from(known, M_known, pencil.solve(b))

    start = inverse(pencil.M(np.random.default_rng(2007 + known.shape[1]).standard_normal(n).astype(pencil.dtype)))
    try:
        values, vectors = spla.eigsh(
            spla.LinearOperator((n, n), matvec=lambda x: pencil.K(x.reshape(-1)), dtype=pencil.dtype),
            k=count,
            M=spla.LinearOperator((n, n), matvec=lambda x: pencil.M(x.reshape(-1)), dtype=pencil.dtype),
            sigma=shift,
            OPinv=spla.LinearOperator((n, n), matvec=inverse, dtype=pencil.dtype),
            ncv=min(n - 1, max(2 * count + 1, 20)),
            v0=start,
            tol=tolerance,
            maxiter=5000,
        )
    except spla.ArpackError as error:
        raise NotConverged(f"Lanczos did not converge ({error}); ask for fewer modes or improve the mesh") from error
    order = np.argsort(values, kind="stable")
    return values[order], vectors[:, order]


def _dense(pencil: Pencil, count: int, known: Array) -> tuple[Array, Array]:
    """Tiny problems, where Lanczos has no room: dense eigenproblem on the M-orthogonal complement of `known`.

    The four-point mass of a few ten-node tetrahedra is singular; what has no mass is condensed (an infinite
    eigenvalue), so that only finite eigenvalues are returned. Rows are brought to one size before anything is called
    massless: a rotation in N, mm and t weighs 1e-13 of a displacement.
    """
    eye = np.eye(pencil.n, dtype=pencil.dtype)
    K, M = pencil.K(eye), pencil.M(eye)
    each = np.diag(M).real
    size = 1 / np.sqrt(np.where(each > 1e-18 * each.max(), each, 1.0))
    K, M = (A * np.outer(size, size) for A in (K, M))
    weight, Q = np.linalg.eigh(0.5 * (M + M.conj().T))
    heavy = weight > 1e-12 * weight[-1]
    X, light = Q[:, heavy] / np.sqrt(weight[heavy]), Q[:, ~heavy]
    if light.shape[1]:
        try:
            X = X - light @ np.linalg.solve(light.conj().T @ K @ light, light.conj().T @ (K @ X))
        except np.linalg.LinAlgError:
            raise NotConverged(
                "a motion has neither mass nor stiffness (a loose node, a dashpot that alone joins one); hold it or "
                "take it out"
            ) from None
    if known.shape[1]:
        away = np.linalg.qr(X.conj().T @ (M @ (known / size[:, None])), mode="complete")[0]
        X = X @ away[:, known.shape[1] :]
    inner = X.conj().T @ K @ X
    values, S = np.linalg.eigh(0.5 * (inner + inner.conj().T))
    return values[:count], size[:, None] * (X @ S[:, :count])

"""Roots of quadratic eigenproblems (s^2 M + s C + K) x = 0 in a window of the complex plane; no symmetry is assumed.

Large sparse matrices: shift-invert block Arnoldi on a linearisation, then inverse iteration on the quadratic problem
itself (Tisseur and Meerbergen, SIAM Review 43, 2001, 235). Small ones: all roots at once. Pure numpy and scipy.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.linalg import lapack

from ..data import Array, ComplexArray, Flags
from ..errors import NotConverged
from ..interrupts import look

DENSE = 300
"""Rows up to which all roots are computed at once."""

RITZ = 1e-9
"""Relative residual at which a value of the search counts as found; refinement does the rest."""

LARGEST_SPACE = 120
"""Vectors of a search space, before the window is divided."""

ROUNDING = 10 * np.finfo(float).eps
"""Relative error of an entry that the computation itself makes."""

ASTRAY = 1e-6
"""Share of the largest frequency within which all roots at once know a root: beyond it a refinement has gone to another
one, below it a root is 0 (a motion that nothing drives back has it twice, and rounding splits it by its square root).
"""


@dataclass(frozen=True)
class Window:
    """A rectangle of the complex plane: growth rates (1/s) and angular frequencies (rad/s), each from, to.

    Roots of real matrices come in conjugate pairs, so frequencies begin at 0 or above it. A window from 0 on holds real
    roots too (divergence), and counts a pair once.
    """

    growth: tuple[float, float]
    omega: tuple[float, float]

    def holds(self, s: ComplexArray) -> Flags:
        """Which roots lie in it, its border included."""
        (a, b), (c, d) = self.growth, self.omega
        return (s.real >= a) & (s.real <= b) & (s.imag >= c) & (s.imag <= d)

    @property
    def middle(self) -> complex:
        return complex(0.5 * sum(self.growth), 0.5 * sum(self.omega))


@dataclass(frozen=True)
class Quadratic:
    """Q(s) = s^2 M + s C + K: real square matrices, all sparse (CSR) or all dense.

    C holds damping and gyroscopic forces, K stiffness and circulatory ones.
    """

    M: Any
    C: Any
    K: Any

    @property
    def n(self) -> int:
        return int(self.M.shape[0])

    def at(self, s: complex) -> Any:
        """Q(s)."""
        return s**2 * self.M + s * self.C + self.K

    def slope(self, s: complex, x: Array) -> Array:
        """Q'(s) x, of one (n,) or several (n, r) vectors."""
        return 2 * s * (self.M @ x) + self.C @ x

    def adjoint_slope(self, s: complex, y: Array) -> Array:
        """Q'(s)^H y."""
        return 2 * np.conj(s) * (self.M.T @ y) + self.C.T @ y

    def projected(self, V: Array, W: Array | None = None) -> Quadratic:
        """W^T Q V, dense; W = V if not given."""
        left = V if W is None else W
        return Quadratic(*(np.asarray(left.T @ (A @ V)) for A in (self.M, self.C, self.K)))

    def size(self, s: complex) -> float:
        """|s|^2 |M| + |s| |C| + |K| in the 1-norm, against which a residual is small or not."""
        return sum(abs(s) ** k * _norm(A) for k, A in ((2, self.M), (1, self.C), (0, self.K)))


def _norm(A: Any) -> float:
    return float(np.max(abs(A).sum(axis=0)))


@dataclass(frozen=True)
class Roots:
    """Roots s of a quadratic eigenproblem, in the order of their frequencies.

    Attributes:
        s: (r,) 1/s. x, y: (n, r) right and left vectors, of length one: Q(s) x = 0, y^H Q(s) = 0.
        residual: (r,) |Q(s) x| over |K x|. backward_error: (r,) over |s|^2 |M| + |s| |C| + |K|.
        rounding: (r,) 1/s, how far the computation's own rounding may move a root. spread: (r,) 1/s, standard deviation
            of the growth rate under independent random changes of all entries, for a relative change of one.
    """

    s: ComplexArray
    x: ComplexArray
    y: ComplexArray
    residual: Array
    backward_error: Array
    rounding: Array
    spread: Array

    def __len__(self) -> int:
        return len(self.s)

    def only(self, which: Any) -> Roots:
        """Some of them."""
        return Roots(
            self.s[which], self.x[:, which], self.y[:, which], self.residual[which], self.backward_error[which],
            self.rounding[which], self.spread[which],
        )  # fmt: skip


# one matrix ---------------------------------------------------------------------------------------------------------


class Factors:
    """L U of one complex matrix, sparse or dense: solutions, and the logarithm of the determinant.

    Raises:
        ZeroDivisionError: the matrix is singular to the last digit.
    """

    def __init__(self, A: Any) -> None:
        self._sparse = sp.issparse(A)
        if self._sparse:
            try:
                self._lu: Any = spla.splu(
                    A.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1, options={"SymmetricMode": True}
                )
            except RuntimeError as error:
                raise ZeroDivisionError(str(error)) from error
            return
        *self._lu, zero = lapack.zgetrf(A)
        if zero:
            raise ZeroDivisionError(f"pivot {zero} is zero")

    def solve(self, b: Array, adjoint: bool = False) -> Array:
        """A^-1 b, or A^-H b, of one or several right-hand sides."""
        b = np.ascontiguousarray(b, dtype=complex)
        if self._sparse:
            return self._lu.solve(b, "H" if adjoint else "N")
        return lapack.zgetrs(*self._lu, b, trans=2 if adjoint else 0)[0]

    def log_determinant(self) -> complex:
        """log det A; its imaginary part, the phase, up to multiples of 2 pi."""
        if self._sparse:
            diagonal, odd = self._lu.U.diagonal(), _odd(self._lu.perm_r) ^ _odd(self._lu.perm_c)
        else:
            diagonal = np.diagonal(self._lu[0])
            odd = bool((self._lu[1] != np.arange(len(diagonal))).sum() % 2)
        phase = float(np.angle(diagonal).sum()) + np.pi * odd
        return complex(float(np.log(np.abs(diagonal)).sum()), phase)


def _odd(permutation: Array) -> bool:
    """Whether a permutation is odd: its length less its number of cycles."""
    graph = sp.csr_matrix((np.ones(len(permutation)), (np.arange(len(permutation)), permutation)))
    cycles = sp.csgraph.connected_components(graph, directed=False, return_labels=False)
    return bool((len(permutation) - cycles) % 2)


def factors_near(Q: Quadratic, s: complex) -> Factors:
    """Factors of Q at s, or so near to it that it is not singular."""
    for step in (0.0, 1e-13, 1e-11):
        try:
            return Factors(Q.at(s + step * (abs(s) or 1.0)))
        except ZeroDivisionError:
            continue
    raise NotConverged(f"the matrices are singular at s = {s:.6g} and around it; do they share a row of zeros?")


# search -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Found:
    """What the search has found: s (r,) and x (n, r), in the window and beside it, not refined.

    Attributes:
        shifts: number of factorisations. solves: number of right-hand sides.
    """

    s: ComplexArray
    x: ComplexArray
    shifts: int
    solves: int


def search(Q: Quadratic, window: Window, block: int = 2) -> Found:
    """All roots in a window, and those beside it that come along, by shift-invert Arnoldi with the shifts it needs.

    The disc about a shift within which every value of the search space has converged covers a part of the window; what
    it leaves is searched with shifts of its own.

    Args:
        block: vectors of a block; a root of higher multiplicity may be missed (`winding.missed` would tell).

    Raises:
        NotConverged: the matrices are singular everywhere.
    """
    todo, s, x, shifts, solves = [window], list[ComplexArray](), list[ComplexArray](), 0, 0
    while todo:
        part = todo.pop()
        values, vectors, radius, count = _disc(Q, part, block)
        shifts, solves = shifts + 1, solves + count
        mine, rest = _covered(part, radius)
        todo += rest
        if mine is not None:
            low, high = mine.omega
            own = (values.imag >= low) & (values.imag < high) if mine is not part else np.ones(len(values), dtype=bool)
            s.append(values[own])
            x.append(vectors[:, own])
    values, vectors = np.concatenate(s), np.hstack(x)
    up = values.imag >= -RITZ * np.abs(values)  # the others are conjugates
    real = np.abs(values.imag) <= RITZ * np.abs(values)
    return Found(*_distinct(np.where(real, values.real, values)[up], vectors[:, up]), shifts, solves)


def _covered(part: Window, radius: float) -> tuple[Window | None, list[Window]]:
    """The strip of a window that a disc about its middle covers, and what remains."""
    half = 0.5 * (part.growth[1] - part.growth[0])
    low, high = part.omega
    middle = part.middle
    if radius >= np.hypot(half, 0.5 * (high - low)):
        return part, []
    reach = np.sqrt(max(radius**2 - half**2, 0.0))
    if reach > 0.1 * (high - low):
        strip = (middle.imag - reach, middle.imag + reach)
        return replace(part, omega=strip), [replace(part, omega=(low, strip[0])), replace(part, omega=(strip[1], high))]
    if 2 * half > high - low:
        cuts = ((part.growth[0], middle.real), (middle.real, part.growth[1]))
        return None, [replace(part, growth=cut) for cut in cuts]
    return None, [replace(part, omega=cut) for cut in ((low, middle.imag), (middle.imag, high))]


def _distinct(s: ComplexArray, x: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Roots without those that two parts of a window have both found: same value, same shape."""
    kept: list[int] = []
    for i in np.argsort(s.imag, kind="stable"):
        near = [j for j in kept if abs(s[i] - s[j]) <= 1e-6 * abs(s[i])]
        if not any(abs(np.vdot(x[:, i], x[:, j])) > 1 - 1e-6 for j in near):
            kept.append(int(i))
    return s[kept], x[:, kept]


def _disc(Q: Quadratic, part: Window, block: int) -> tuple[Array, Array, float, int]:
    """Roots about the middle of a window, their vectors, the radius within which they are all there is, and solves.

    With z = (x, s x / g), g = |shift|, the operator has the eigenvalues 1 / (s - shift).
    """
    shift, n = part.middle, Q.n
    wanted = float(np.hypot(part.growth[1] - part.growth[0], part.omega[1] - part.omega[0]) / 2)
    factors, g = factors_near(Q, shift), abs(shift) or 1.0

    def operator(z: ComplexArray) -> ComplexArray:
        u, v = z[:n], z[n:]
        w = -factors.solve(Q.M @ (g * v) + Q.C @ u + shift * (Q.M @ u))
        return np.vstack([w, (u + shift * w) / g])

    space = min(LARGEST_SPACE, 2 * n)
    V = np.zeros((2 * n, space + block), dtype=complex, order="F")
    H = np.zeros((space + block, space), dtype=complex)
    start = np.random.default_rng(1).standard_normal((2 * n, 2 * block)).view(complex)
    V[:, :block] = np.linalg.qr(start)[0]
    m, radius, theta, Y = 0, 0.0, np.zeros(0, dtype=complex), np.zeros((0, 0), dtype=complex)
    while m + block <= space:
        look()
        _extend(V, H, m, block, operator)
        m += block
        if m % (8 * block) and m + block <= space:
            continue
        theta, Y = np.linalg.eig(H[:m, :m])
        rest = np.linalg.norm(H[m : m + block, m - block : m] @ Y[m - block :], axis=0)
        fine = rest <= RITZ * np.abs(theta)
        worst = np.abs(theta[~fine]).max(initial=0.0)
        radius = 1 / worst if worst > 1e-300 else np.inf
        theta, Y = theta[fine], Y[:, fine]
        if radius > wanted:
            break
    x = V[:n, :m] @ Y
    return shift + 1 / theta, x / np.linalg.norm(x, axis=0), float(radius), m


def _extend(V: ComplexArray, H: ComplexArray, m: int, block: int, operator: Any) -> None:
    """One more block of the space, orthogonalised twice."""
    w = operator(V[:, m : m + block])
    for _ in range(2):
        h = (w.conj().T @ V[:, : m + block]).conj().T  # conjugates the smaller of the two
        w -= V[:, : m + block] @ h
        H[: m + block, m : m + block] += h
    V[:, m + block : m + 2 * block], H[m + block : m + 2 * block, m : m + block] = np.linalg.qr(w)


# refinement ---------------------------------------------------------------------------------------------------------


def refined(Q: Quadratic, s: ComplexArray, x: ComplexArray) -> Roots:
    """Roots to the last digits by inverse iteration on Q itself, from the right and the left.

    Args:
        s: (r,) and x: (n, r) from a search.

    Raises:
        NotConverged: Q is singular around a root.
    """
    with np.errstate(all="ignore"):  # about a root of 0 vectors may become infinite
        found = [_refine(Q, complex(s[i]), x[:, i]) for i in range(len(s))]
    return judged(Q, found)


def _refine(Q: Quadratic, s: complex, x: ComplexArray) -> tuple[complex, ComplexArray, ComplexArray]:
    """One root; as it was found where the iteration leaves it: it has no direction at a double root 0."""
    y, start = x, (s, x, x)
    for _ in range(5):
        factors, begin = factors_near(Q, s), s
        for _ in range(2):
            x = _unit(factors.solve(Q.slope(begin, x)))
            y = _unit(factors.solve(Q.adjoint_slope(begin, y), adjoint=True))
        s = _rayleigh(Q, s, x, y)
        if abs(s - begin) <= 1e-9 * abs(s):
            break
    stays = abs(s - start[0]) <= ASTRAY * max(abs(start[0]), _scale(Q))
    return (s, x, y) if stays and np.isfinite(x).all() and np.isfinite(y).all() else start


def _unit(x: ComplexArray) -> ComplexArray:
    return x / np.linalg.norm(x)


def _rayleigh(Q: Quadratic, s: complex, x: ComplexArray, y: ComplexArray) -> complex:
    """The root near s of y^H Q(s) x = 0; its error is the product of those of both vectors."""
    m, c, k = (complex(np.vdot(y, A @ x)) for A in (Q.M, Q.C, Q.K))
    for _ in range(4):
        slope = 2 * s * m + c
        if not slope:
            break
        s -= (s * (s * m + c) + k) / slope
    return s


def judged(Q: Quadratic, found: Iterable[tuple[complex, ComplexArray, ComplexArray]]) -> Roots:
    """Roots with residuals, backward errors and what moves them, in the order of their frequencies."""
    found = sorted(found, key=lambda one: (one[0].imag, one[0].real))
    s = np.array([one[0] for one in found], dtype=complex)
    x, y = (np.array([one[i] for one in found], dtype=complex).reshape(len(s), Q.n).T for i in (1, 2))
    numbers = np.array([_judge(Q, *one) for one in found]).reshape(len(s), 4)
    zero = (np.sqrt(ROUNDING) if sp.issparse(Q.K) else ASTRAY) * _scale(Q)  # what rounding makes of a double root 0
    numbers[:, 2] = np.where(np.abs(s) <= zero, np.maximum(numbers[:, 2], zero), numbers[:, 2])
    return Roots(s, x, y, *numbers.T)


def _judge(Q: Quadratic, s: complex, x: ComplexArray, y: ComplexArray) -> tuple[float, float, float, float]:
    """Residual, backward error, rounding and spread of one root (see `Roots`).

    A change dA of s^k A moves s by -s^k y^H dA x / (y^H Q'(s) x); entries that change by themselves add up squared.
    """
    rest = float(np.linalg.norm(s**2 * (Q.M @ x) + s * (Q.C @ x) + Q.K @ x))
    force = float(np.linalg.norm(Q.K @ x)) or 1.0
    slope = complex(np.vdot(y, Q.slope(s, x))) or 1e-300
    moved, squared = 0.0, 0.0
    for k, A in ((2, Q.M), (1, Q.C), (0, Q.K)):
        entries = A if sp.issparse(A) else sp.csr_matrix(A)
        entries = entries.tocoo()
        each = s**k / slope * y.conj()[entries.row] * entries.data * x[entries.col]
        moved += float(np.abs(each).sum())
        squared += float((each.real**2).sum())
    return rest / force, rest / (Q.size(s) * float(np.linalg.norm(x))), ROUNDING * moved, float(np.sqrt(squared))


# small matrices -----------------------------------------------------------------------------------------------------


def every_root(Q: Quadratic) -> Roots:
    """All finite roots of dense matrices with frequencies not below 0, from the companion form at once."""
    n, g, (A, B) = Q.n, _scale(Q), _companion(Q)
    (alpha, beta), L, R = scipy.linalg.eig(A, B, left=True, homogeneous_eigvals=True)
    finite = np.abs(beta) > 1e-13 * np.abs(alpha)
    s = g * alpha[finite] / beta[finite]
    up = s.imag >= 0
    s, x, y = s[up], R[:n, finite][:, up], L[n:, finite][:, up]
    return judged(Q, [(complex(v), _unit(a), _unit(b)) for v, a, b in zip(s, x.T, y.T, strict=True)])


WELL_CONDITIONED = 1e8
"""Condition number of a mass matrix up to which it is inverted."""


def every_value(Q: Quadratic) -> ComplexArray:
    """All finite roots of dense matrices with frequencies not below 0, without vectors."""
    A, B = _companion(Q)
    n = Q.n
    if np.linalg.cond(B[n:, n:], 1) < WELL_CONDITIONED:
        A[n:] = np.linalg.solve(B[n:, n:], A[n:])
        s = _scale(Q) * np.linalg.eigvals(A)
    else:
        alpha, beta = scipy.linalg.eig(A, B, right=False, homogeneous_eigvals=True)
        finite = np.abs(beta) > 1e-13 * np.abs(alpha)
        s = _scale(Q) * alpha[finite] / beta[finite]
    return s[s.imag >= 0].astype(complex)


def _scale(Q: Quadratic) -> float:
    """1/s, brings s to the size of one."""
    return float(np.sqrt(_norm(Q.K) / _norm(Q.M))) if _norm(Q.M) and _norm(Q.K) else 1.0


def _companion(Q: Quadratic) -> tuple[Array, Array]:
    """A z = t B z with z = (x, t x), t = s over `_scale`."""
    M, C, K = (A.toarray() if sp.issparse(A) else np.asarray(A, dtype=float) for A in (Q.M, Q.C, Q.K))
    n, eye, g = len(M), np.eye(len(M)), _scale(Q)
    A = np.block([[np.zeros((n, n)), eye], [-K / g**2, -C / g]])
    return A, scipy.linalg.block_diag(eye, M)

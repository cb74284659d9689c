"""Complex modes of a rotating body: M q'' + (C + G) q' + K q = 0 in the frame that turns with it.

Sextro Eqs. (2.3-28), (2.3-29). The matrices may be real or complex (a cyclic sector of one nodal diameter): M and K
Hermitian, G skew-Hermitian. Pure numpy and scipy, no mechanics beyond the pencil.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse.csgraph

from ..data import Array, ComplexArray, GyroscopicModes

CIRCULAR = 0.05
"""A mode whose orbits have less mean sense than this (1: all points on circles) is neither forward nor backward."""

GROWTH = 1e-6
"""Growth rates below this share of the largest eigenvalue are rounding: double zeros split by its square root."""


COUPLED = 1e-13
"""Share of what two coordinates meet below which an entry between them is rounding."""


@dataclass(frozen=True)
class Certified:
    """What is known of the modes that are not among the coordinates.

    Attributes:
        P: (m, m) phi^H M (1 - n n^T) phi. speed: rad/s. next_omega: rad/s, certified lower bound of the first mode
            left out. count: the first so many coordinates are the lowest eigenmodes, mass-normalised (0: none are).
    """

    P: Array
    speed: float
    next_omega: float
    count: int


def gyroscopic_modes(M: Array, G: Array, K: Array, N: Array, certified: Certified | None = None) -> GyroscopicModes:
    """The modes q = x exp(i omega t) of M q'' + G q' + K q = 0.

    With K positive definite the frequencies are the real eigenvalues of a Hermitian pencil (`hermitian_modes`).
    Otherwise coordinates that hang together are taken by themselves, and where K is not positive definite among them
    the general eigenvalue problem is solved, whose modes may grow: the repeated roots of a rigid motion, which rounding
    splits by its square root, then spoil nothing else.

    Args:
        M, K: (m, m) Hermitian. G: (m, m) skew-Hermitian, 1/s for mass-normalised coordinates.
        N: (m, m) phi^H M (axis x phi): decides the sense of the orbits.
        certified: what bounds the error against the unreduced body; None: no bound.

    Returns:
        Real matrices: one entry for each pair of conjugate modes. Complex ones: all, those of negative omega being
        the waves that travel the other way (conjugate shapes at |omega|). Ascending in |omega|.
    """
    try:
        omega, shapes = hermitian_modes(M, G, K)
        growth = np.zeros(len(omega))
    except np.linalg.LinAlgError:
        omega, growth, shapes = _by_parts(M, G, K)
    wave = any(np.iscomplexobj(a) for a in (M, K, G))
    keep = np.ones(len(omega), dtype=bool) if wave else (omega > 0) | ((omega == 0) & (growth >= 0))
    still = np.flatnonzero((omega == 0) & (growth == 0) & keep)
    keep[still[1::2]] = wave  # a motion that nothing drives back has the root 0 twice
    order = np.flatnonzero(keep)[np.argsort(np.abs(omega[keep]), kind="stable")]
    omega, growth, shapes = omega[order], growth[order], definite(shapes[:, order], M)
    sense = orbit_sense(shapes, M, N) * np.sign(omega)
    error = np.full(len(omega), np.nan)
    if certified is not None and not growth.any():
        error = _errors(omega, K, G, N, certified)
    return GyroscopicModes(omega, shapes, growth, sense, directions(omega, sense, wave), error)


def _by_parts(M: Array, G: Array, K: Array) -> tuple[Array, Array, ComplexArray]:
    """(2m,) omega and growth, (m, 2m) shapes, of each set of coordinates that hang together."""
    m = len(M)
    joined = np.zeros((m, m), dtype=bool)
    for A in (M, G, K):
        size = np.sqrt(np.abs(A).max(axis=1, initial=0.0))
        joined |= np.abs(A) > COUPLED * np.outer(size, size)
    count, part = scipy.sparse.csgraph.connected_components(joined, directed=False)
    omega, growth, shapes = np.zeros(2 * m), np.zeros(2 * m), np.zeros((m, 2 * m), dtype=complex)
    done = 0
    for number in range(count):
        at = np.flatnonzero(part == number)
        own, to = np.ix_(at, at), slice(done, done + 2 * len(at))
        try:
            omega[to], shapes[at, to] = hermitian_modes(M[own], G[own], K[own])
        except np.linalg.LinAlgError:
            s, shapes[at, to] = general_modes(M[own], G[own], K[own])
            least = GROWTH * np.abs(s).max(initial=0.0)
            omega[to], growth[to] = (np.where(np.abs(a) <= least, 0.0, a) for a in (s.imag, s.real))
            zero = done + np.flatnonzero((omega[to] == 0) & (growth[to] == 0))
            shapes[np.ix_(at, zero)] = _null_twice(K[own], len(zero))
        done += 2 * len(at)
    return omega, growth, shapes


def _null_twice(K: Array, count: int) -> Array:
    """(m, count) vectors of the roots 0, two for each direction that K does not resist."""
    values, X = np.linalg.eigh(K)
    softest = X[:, np.argsort(np.abs(values), kind="stable")[: (count + 1) // 2]]
    return np.repeat(softest, 2, axis=1)[:, :count]


def _errors(omega: Array, K: Array, G: Array, N: Array, known: Certified) -> Array:
    """(w,) bound for each mode, from the coordinates that are eigenmodes; NaN beyond their number.

    Further coordinates only bring the frequencies nearer (Cauchy's interlacing), order by order on either side of 0.
    """
    error, c = np.full(len(omega), np.nan), slice(known.count)
    if not known.count or not known.next_omega:
        return error
    try:
        lowest = hermitian_modes(np.eye(known.count), G[c, c], K[c, c])[0]
        bound = truncation_bound(lowest, K[c, c], N[c, c], known.P[c, c], known.speed, known.next_omega)
    except np.linalg.LinAlgError:
        return error
    for sign in (1, -1):
        here, there = np.flatnonzero(sign * omega > 0), np.flatnonzero(sign * lowest > 0)
        there = there[np.argsort(np.abs(lowest[there]), kind="stable")][: len(here)]
        error[here[: len(there)]] = bound[there]
    return error


def hermitian_modes(M: Array, G: Array, K: Array) -> tuple[Array, ComplexArray]:
    """All (2m,) real omega of omega^2 M x - i omega G x - K x = 0 and (m, 2m) shapes, K positive definite.

    With z = (x, omega x) and the Hermitian H = i G:

        [-H  M] [  x    ]     1   [K  0] [  x    ]
        [ M  0] [omega x] = ----- [0  M] [omega x]
                            omega

    The matrix on the right is positive definite, so every 1/omega is real (Meirovitch, Computational Methods in
    Structural Dynamics, 1980, 3.7).

    Raises:
        numpy.linalg.LinAlgError: K is not positive definite.
    """
    m = len(M)
    H = 1j * np.asarray(G, dtype=complex)
    zero = np.zeros((m, m))
    left = np.block([[-0.5 * (H + H.conj().T), M], [M, zero]])
    right = np.block([[0.5 * (K + K.conj().T), zero], [zero, M]]).astype(complex)
    inverse, z = scipy.linalg.eigh(left, right)
    return 1 / inverse, z[:m]


def general_modes(M: Array, C: Array, K: Array) -> tuple[ComplexArray, ComplexArray]:
    """All (2m,) eigenvalues s, 1/s, of (s^2 M + s C + K) x = 0 for any C and K, and (m, 2m) shapes."""
    m = len(M)
    A = np.block([[np.zeros((m, m)), np.eye(m)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    s, z = np.linalg.eig(A)
    return s.astype(complex), z[:m].astype(complex)


def definite(x: ComplexArray, M: Array) -> ComplexArray:
    """Shapes with x^H M x = 1 and the largest coordinate real and positive (of near ties the first)."""
    if not x.size:
        return x
    size = np.abs(x)
    first = (size > (1 - 1e-6) * size.max(axis=0)).argmax(axis=0)
    lead = np.take_along_axis(x, first[None], axis=0)[0]
    mass = np.einsum("ij,ij->j", x.conj(), M @ x).real
    return x * (lead.conj() / (np.abs(lead) * np.sqrt(mass)))


def orbit_sense(x: ComplexArray, M: Array, N: Array) -> Array:
    """(w,) mean sense of the orbits about the axis for x exp(+i t), between -1 and 1.

    The mean angular momentum of the vibration about the axis is omega/2 Im(x^H N x), that of points on circles
    omega/2 x^H M x; their ratio is 1 where every point circles with the rotation, 0 where it moves on a line.
    """
    return np.einsum("ij,ij->j", x.conj(), N @ x).imag / np.einsum("ij,ij->j", x.conj(), M @ x).real


def directions(omega: Array, sense: Array, wave: bool) -> tuple[str, ...]:
    """``forward``, ``backward`` or ``mixed`` for every mode, seen in the rotating frame.

    wave: the coordinates are those of a nodal diameter between 0 and N/2. There exp(+i omega t) of the harmonic +k
    travels against the rotation, exp(-i omega t) with it (docs/conventions.md). Otherwise the orbits decide.
    """
    if wave:
        return tuple("backward" if w > 0 else "forward" if w < 0 else "mixed" for w in omega)
    return tuple("mixed" if abs(s) < CIRCULAR else "forward" if s > 0 else "backward" for s in sense)


def truncation_bound(omega: Array, K: Array, N: Array, P: Array, speed: float, next_omega: float) -> Array:
    """(w,) bound of the relative error of omega that the coordinates left out can make; they are the higher modes.

    G acts node by node, M^-1 G u = 2 Omega n x u, so what it does outside the kept modes is known without them: its
    Gram matrix is 4 Omega^2 (P - N^H N). The block E that couples kept and lost coordinates in the Hermitian pencil
    is no larger than the root of the largest eigenvalue of K^-1/2 (P - N^H N) K^-1/2, times 2 Omega / next_omega; the
    lost ones have |omega| >= sqrt(next_omega^2 + Omega^2) - Omega. Then (Li and Li, Linear Algebra Appl. 395, 2005)

        |1/omega - 1/omega_exact| <= 2 |E|^2 / (gap + sqrt(gap^2 + 4 |E|^2)).

    By Cauchy's interlacing the frequencies of the reduced body are too high, never too low, where the gap is open.
    Valid for the lowest eigenmodes; with further coordinates (Rubin) the error is smaller still.
    """
    L = np.linalg.cholesky(K)
    half = scipy.linalg.solve_triangular(L, P - N.conj().T @ N, lower=True)
    coupling = scipy.linalg.solve_triangular(L, half.conj().T, lower=True)
    top = max(float(np.linalg.eigvalsh(0.5 * (coupling + coupling.conj().T)).max(initial=0.0)), 0.0)
    E = 2 * speed * np.sqrt(top) / next_omega
    lost = 1 / (np.sqrt(next_omega**2 + speed**2) - speed)
    gap = np.maximum(1 / np.abs(omega) - lost, 0.0)
    shift = 2 * E**2 / np.maximum(gap + np.sqrt(gap**2 + 4 * E**2), 1e-300)
    return shift * np.abs(omega)


def stability_sentence(modes: GyroscopicModes) -> str:
    """Whether the rotating body is stable, in one sentence."""
    if modes.stable:
        return "The rotating body is stable: no mode grows."
    worst = int(modes.growth.argmax())
    hertz, rate = abs(modes.omega[worst]) / (2 * np.pi), modes.growth[worst]
    count = int((modes.growth > 0).sum())
    kind = f"flutter at {hertz:.6g} Hz" if hertz else "divergence"
    others = f", the fastest of {count} growing modes" if count > 1 else ""
    return f"The rotating body is UNSTABLE: {kind} grows by exp({rate:.4g} t/s){others}; lower the speed."

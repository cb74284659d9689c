"""Periodic orbits by harmonic balance with unknown frequency.

With x(t) = sum of c_k times 1, cos t', sin t', ..., cos H t', sin H t', t' = omega t, and f at N times of a period,

    omega D c - P f(E c) = 0,  sum of c_ref' . (c - c_ref) = 0,

E sums the harmonics, P takes them out again, D differentiates; the last equation chooses among the shifts in time, and
is missing where the frequency is that of what drives. Derivatives are exact: those of f at the times.

Where f(x, p) is linear in all that is orthogonal to z = V^T x, with A any matrix that is its derivative there,

    x' = A x + g(z, t),  g = f(V z) - A V z,

the harmonics of x follow from those of z, X_h = (i h omega - A)^-1 G_h, and Z_h - V^T X_h = 0 is left to solve
(`CondensedBalance`). A multiple of V V^T is taken from A, so that nothing is singular where an orbit is born.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from .. import series
from ..continuation import NewtonSettings, Solution, newton
from ..data import Array, ComplexArray
from ..series import derivative
from .dynamics import Dynamics
from .shooting import PeriodicOrbit

SAMPLES_EACH = 4
"""Times of a period for each harmonic."""


@dataclass(frozen=True, eq=False)
class Harmonics:
    """A periodic orbit by its harmonics. Attributes: c: (2 H + 1, n). omega: rad/s of the first. p."""

    c: Array
    omega: float
    p: float

    @property
    def count(self) -> int:
        """H."""
        return len(self.c) // 2

    def at(self, turns: Array) -> Array:
        """(s, n) at times in periods (s,)."""
        return summed(self.count, turns) @ self.c

    @property
    def slopes(self) -> Array:
        """(2 H + 1, n) of the derivative over t'."""
        return derivative(len(self.c)) @ self.c


def summed(H: int, turns: Array) -> Array:
    """(s, 2 H + 1) E at times in periods (s,)."""
    return series.summed(2 * np.pi * np.outer(turns, np.arange(1, H + 1)))


def of_orbit(orbit: PeriodicOrbit, H: int, each: int = 32) -> Harmonics:
    """The harmonics of an orbit, by its samples."""
    x = orbit.sampled(max(each, -(-SAMPLES_EACH * H // len(orbit.x))))
    E = summed(H, np.arange(len(x)) / len(x))
    c = 2 * E.T @ x / len(x)
    c[0] *= 0.5
    return Harmonics(c, 2 * np.pi / orbit.period, orbit.p)


@dataclass(frozen=True, eq=False)
class Balance:
    """The equations of H harmonics and, of a free orbit, its frequency: `continuation.Equations`.

    Attributes:
        system. reference: an orbit nearby, from which the phase is not to move. turns: k of what drives in a period.
    """

    system: Dynamics
    reference: Harmonics
    turns: int = 1

    @property
    def free(self) -> bool:
        return self.system.frequency is None

    @property
    def x_scale(self) -> Array:
        scale = np.tile(self.system.scale, len(self.reference.c))
        return np.append(scale, self.reference.omega) if self.free else scale

    @property
    def lam_scale(self) -> float:
        return self.system.parameter_scale

    @cached_property
    def _times(self) -> tuple[Array, Array]:
        """(N, 2 H + 1) E, and P transposed."""
        H = self.reference.count
        N = SAMPLES_EACH * max(H, 4)
        E = summed(H, np.arange(N) / N)
        P = 2 * E / N
        P[:, 0] *= 0.5
        return E, P

    @cached_property
    def _rates(self) -> Callable[..., tuple[Any, Any, Any]]:
        """Compiled: f (N, n), df/dx (N, n, n) and df/dp (N, n) at x (N, n), p and angles (N,)."""
        f = self.system.rate

        def one(x: Any, p: Any, angle: Any) -> tuple[Any, Any, Any]:
            return f(x, p, angle), jax.jacfwd(f)(x, p, angle), jax.jacfwd(f, 1)(x, p, angle)

        return jax.jit(jax.vmap(one, (0, None, 0)))

    def unknowns(self, orbit: Harmonics) -> Array:
        return np.append(orbit.c, orbit.omega) if self.free else orbit.c.ravel()

    def way(self, c: Array) -> Array:
        """A direction of orbits, (2 H + 1, n), in the unknowns."""
        return np.append(c, 0.0) if self.free else c.ravel()

    def orbit(self, x: Array, p: float) -> Harmonics:
        """Of unknowns."""
        c = x[: self.reference.c.size].reshape(self.reference.c.shape)
        return Harmonics(c, float(x[-1]) if self.free else self._driven(p)[0], float(p))

    def _driven(self, p: float) -> tuple[float, float]:
        """omega and its derivative over p, of a driven orbit."""
        assert self.system.frequency is not None
        value, slope = jax.jvp(self.system.frequency, (float(p),), (1.0,))
        return float(value) / self.turns, float(slope) / self.turns

    def evaluate(self, x: Array, lam: float) -> tuple[Array, Array, Array]:
        E, P = self._times
        k, n = self.reference.c.shape
        c = x[: k * n].reshape(k, n)
        omega, change = (float(x[-1]), 0.0) if self.free else self._driven(lam)
        angles = 2 * np.pi * self.turns * np.arange(len(E)) / len(E)
        f, J, slope = map(np.asarray, self._rates(E @ c, float(lam), angles))
        D = derivative(k)
        moving = D @ c
        J_c = np.zeros((k, n, k, n))
        J_c[:, range(n), :, range(n)] += omega * D
        mean = J.mean(axis=0)
        J_c[range(k), :, range(k), :] -= mean
        changes = np.ptp(J, axis=0) > 1e-13 * np.abs(J).max()
        for i in np.flatnonzero(changes.any(axis=1)):
            j = np.flatnonzero(changes[i])
            parts = P.T[:, :, None] * (J[:, i, j] - mean[i, j])
            J_c[:, i][:, :, j] -= np.tensordot(parts, E, (1, 0)).swapaxes(1, 2)
        phase = (self.reference.slopes / np.asarray(self.system.scale) ** 2).ravel()
        R, over = (omega * moving - P.T @ f).ravel(), (change * moving - P.T @ slope).ravel()
        return self._with_phase(R, J_c.reshape(k * n, k * n), over, moving.ravel(), phase, c - self.reference.c)

    def _with_phase(
        self, R: Array, A: Array, over: Array, faster: Array, phase: Array, off: Array
    ) -> tuple[Array, Array, Array]:
        """Equations of a free orbit have a further unknown, its frequency, over which they change by `faster`, and the
        condition that orbits which are `off` the reference have its phase."""
        if not self.free:
            return R, A, over
        A = np.block([[A, faster[:, None]], [phase, np.zeros(1)]])
        return np.append(R, phase @ off.ravel()), A, np.append(over, 0.0)


def balanced(orbit: PeriodicOrbit, H: int, settings: NewtonSettings | None = None) -> tuple[Harmonics, Solution]:
    """The orbit of H harmonics near another one, and how Newton's method found it."""
    begin = of_orbit(orbit, H)
    problem = Balance(orbit.system, begin, orbit.turns)
    solution = newton(problem, problem.unknowns(begin), orbit.p, settings)
    return problem.orbit(solution.x, orbit.p), solution


def distance(one: Harmonics, orbit: PeriodicOrbit, each: int = 32) -> float:
    """Largest difference of the two over a period, over the scales of the coordinates, at the shift in time at which it
    is least in the mean."""
    size = np.asarray(orbit.system.scale)
    x = orbit.sampled(each) / size
    turns = np.arange(len(x)) / len(x)
    shift = 0.0
    for _ in range(5):
        y = one.at(turns + shift) / size
        moving = summed(one.count, turns + shift) @ one.slopes * 2 * np.pi / size
        shift -= float(((y - x) * moving).sum() / (moving**2).sum())
    return float(np.abs(one.at(turns + shift) / size - x).max())


FEW = 3
"""Coordinates to each that a system is not linear in, from which on it is condensed."""


def equations(system: Dynamics, reference: Harmonics) -> Balance:
    """Of the orbits near a reference, in the fewest unknowns."""
    V = system.bends
    return Balance(system, reference) if V is None or FEW * V.shape[1] > len(V) else CondensedBalance(system, reference)


@dataclass(frozen=True, eq=False)
class CondensedBalance(Balance):
    """`Balance` with the unknowns z, (2 H + 1, r), and the frequency of a free orbit."""

    @property
    def V(self) -> Array:
        """(n, r), its columns of length 1."""
        assert self.system.bends is not None
        return self.system.bends

    @property
    def x_scale(self) -> Array:
        sizes = np.abs(self.V).T @ np.asarray(self.system.scale) / np.abs(self.V).sum(axis=0)
        scale = np.tile(sizes, len(self.reference.c))
        return np.append(scale, self.reference.omega) if self.free else scale

    @cached_property
    def _bent(self) -> Callable[..., tuple[Any, Any]]:
        """Compiled: f (N, n) and df/dz (N, n, r) at V z (N, r), p and angles (N,)."""
        f, V = self.system.rate, jnp.asarray(self.V)

        def one(z: Any, p: Any, angle: Any) -> tuple[Any, Any]:
            def of(z: Any) -> Any:
                return f(V @ z, p, angle)

            return of(z), jax.jacfwd(of)(z)

        return jax.jit(jax.vmap(one, (0, None, 0)))

    @cached_property
    def _over(self) -> Callable[..., Any]:
        """Compiled: df/dp (N, n) at x (N, n), p and angles (N,)."""
        return jax.jit(jax.vmap(jax.jacfwd(self.system.rate, 1), (0, None, 0)))

    @cached_property
    def _slope(self) -> Callable[..., Any]:
        """Compiled: df/dx (n, n) at the middle of the reference and p."""
        return jax.jit(lambda p: jax.jacfwd(self.system.rate)(jnp.asarray(self.reference.c[0]), p, jnp.zeros(())))

    def unknowns(self, orbit: Harmonics) -> Array:
        return super().unknowns(replace(orbit, c=orbit.c @ self.V))

    def orbit(self, x: Array, p: float) -> Harmonics:
        z, omega, _ = self._split(x, p)
        return Harmonics(_Answer(self, z, omega, p).x, omega, float(p))

    def way(self, c: Array) -> Array:
        """A direction of orbits, (2 H + 1, n), in the unknowns."""
        return super().way(c @ self.V)

    def _split(self, x: Array, p: float) -> tuple[Array, float, float]:
        """z, omega and its derivative over p."""
        shape = len(self.reference.c), self.V.shape[1]
        z = x[: shape[0] * shape[1]].reshape(shape)
        return z, *((float(x[-1]), 0.0) if self.free else self._driven(p))

    def evaluate(self, x: Array, lam: float) -> tuple[Array, Array, Array]:
        E, P = self._times
        z, omega, change = self._split(x, lam)
        k, r = z.shape
        at = _Answer(self, z, omega, lam)
        own = at.x + (z - at.x @ self.V) @ self.V.T  # where f is as linear as said
        slope = np.asarray(self._over(E @ own, float(lam), at.angles))
        faster = at.through(derivative(len(at.x)) @ at.x).ravel()
        R, A = (z - at.x @ self.V).ravel(), np.eye(k * r) - at.derivative.reshape(k * r, k * r)
        over = change * faster - at.through(P.T @ slope).ravel()
        phase = ((self.reference.slopes / np.asarray(self.system.scale) ** 2) @ self.V).ravel()
        return self._with_phase(R, A, over, faster, phase, z - self.reference.c @ self.V)


class _Answer:
    """What follows from harmonics of z. Attributes: x: (k, n) those of all coordinates. angles: (N,) of the times."""

    def __init__(self, problem: CondensedBalance, z: Array, omega: float, p: float) -> None:
        self.V, (self.E, self.P) = problem.V, problem._times
        N, n = len(self.E), len(self.V)
        self.angles = 2 * np.pi * problem.turns * np.arange(N) / N
        f, slopes = map(np.asarray, problem._bent(self.E @ z, float(p), self.angles))
        A = np.asarray(problem._slope(float(p))) - problem.reference.omega * self.V @ self.V.T
        left = A @ self.V
        g, self.slopes = f - (self.E @ z) @ left.T, slopes - left
        self.factors = [scipy.linalg.lu_factor(1j * h * omega * np.eye(n) - A) for h in range(len(z) // 2 + 1)]
        each = zip(self.factors, _complex(self.P.T @ g), strict=True)
        self.x = _real(np.array([scipy.linalg.lu_solve(factors, right) for factors, right in each]))

    @cached_property
    def rows(self) -> ComplexArray:
        """(H + 1, r, n) V^T (i h omega - A)^-1."""
        return np.array([scipy.linalg.lu_solve(factors, self.V.astype(complex), trans=1).T for factors in self.factors])

    def through(self, g: Array) -> Array:
        """(k, r) harmonics of z under those of a right-hand side (k, n)."""
        return _real(np.einsum("hrn,hn->hr", self.rows, _complex(g)))

    @cached_property
    def derivative(self) -> Array:
        """(k, r, k, r) of V^T x over z."""
        k, r, N = self.E.shape[1], self.V.shape[1], len(self.E)
        D = np.zeros((k, r, k, r))
        flat = self.slopes.transpose(1, 0, 2).reshape(len(self.V), N * r)
        for h, rows in enumerate(self.rows):
            each = (rows @ flat).reshape(r, N, r)
            cosine = self.P[:, 2 * h - 1] - 1j * self.P[:, 2 * h] if h else self.P[:, 0]
            part = np.einsum("ajb,jc->acb", each, cosine[:, None] * self.E, optimize=True)
            if h:
                D[2 * h - 1], D[2 * h] = part.real, -part.imag
            else:
                D[0] = part.real
        return D


def _complex(c: Array) -> ComplexArray:
    """(H + 1, n) of harmonics in cosine and sine, c cos + s sin = Re (c - i s) exp(i t')."""
    return np.concatenate([c[:1].astype(complex), c[1::2] - 1j * c[2::2]])


def _real(c: ComplexArray) -> Array:
    harmonics = np.zeros((2 * len(c) - 1, c.shape[1]))
    harmonics[0], harmonics[1::2], harmonics[2::2] = c[0].real, c[1:].real, -c[1:].imag
    return harmonics

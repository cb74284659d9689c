"""Periodic orbits by harmonic balance with unknown frequency.

With x(t) = sum of c_k times 1, cos t', sin t', ..., cos H t', sin H t', t' = omega t, and f at N times of a period,

    omega D c - P f(E c) = 0,  sum of c_ref' . (c - c_ref) = 0,

E sums the harmonics, P takes them out again, D differentiates; the last equation chooses among the shifts in time, and
is missing where the frequency is that of what drives. Derivatives are exact: those of f at the times.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import numpy as np

from .. import series
from ..continuation import NewtonSettings, Solution, newton
from ..data import Array
from ..series import derivative
from .dynamics import Dynamics
from .shooting import Orbit

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


def of_orbit(orbit: Orbit, H: int, each: int = 32) -> Harmonics:
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
        found = np.zeros((k, n, k, n))
        found[:, range(n), :, range(n)] += omega * D
        mean = J.mean(axis=0)
        found[range(k), :, range(k), :] -= mean
        changes = np.ptp(J, axis=0) > 1e-13 * np.abs(J).max()
        for i in np.flatnonzero(changes.any(axis=1)):
            j = np.flatnonzero(changes[i])
            parts = P.T[:, :, None] * (J[:, i, j] - mean[i, j])
            found[:, i][:, :, j] -= np.tensordot(parts, E, (1, 0)).swapaxes(1, 2)
        size = len(x)
        R, A, over = np.zeros(size), np.zeros((size, size)), np.zeros(size)
        R[: k * n], A[: k * n, : k * n] = (omega * moving - P.T @ f).ravel(), found.reshape(k * n, k * n)
        over[: k * n] = (change * moving - P.T @ slope).ravel()
        if self.free:
            phase = (self.reference.slopes / np.asarray(self.system.scale) ** 2).ravel()
            A[: k * n, -1], A[-1, : k * n] = moving.ravel(), phase
            R[-1] = phase @ (c - self.reference.c).ravel()
        return R, A, over


def balanced(orbit: Orbit, H: int, settings: NewtonSettings | None = None) -> tuple[Harmonics, Solution]:
    """The orbit of H harmonics near another one, and how Newton's method found it."""
    begin = of_orbit(orbit, H)
    problem = Balance(orbit.system, begin, orbit.turns)
    found = newton(problem, problem.unknowns(begin), orbit.p, settings)
    return problem.orbit(found.x, orbit.p), found


def distance(one: Harmonics, orbit: Orbit, each: int = 32) -> float:
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

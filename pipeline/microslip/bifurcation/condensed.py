"""Harmonic balance in the few coordinates that a system is not linear in.

Where f(x, p) is linear in all that is orthogonal to z = V^T x, with A any matrix that is its derivative there,

    x' = A x + g(z, t),  g = f(V z) - A V z,

the harmonics of x follow from those of z, X_h = (i h omega - A)^-1 G_h, and Z_h - V^T X_h = 0 is left to solve: the
orbit is that of `balance.Balance`. A multiple of V V^T is taken from A, so that nothing is singular where it is born.
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

from ..data import Array, ComplexArray
from ..series import derivative
from .balance import Balance, Harmonics
from .dynamics import Dynamics

FEW = 3
"""Coordinates to each that a system is not linear in, from which on it is condensed."""


def equations(system: Dynamics, reference: Harmonics) -> Balance:
    """Of the orbits near a reference, in the fewest unknowns."""
    V = system.bends
    return Balance(system, reference) if V is None or FEW * V.shape[1] > len(V) else Condensed(system, reference)


@dataclass(frozen=True, eq=False)
class Condensed(Balance):
    """`Balance` with the unknowns z, (2 H + 1, r), and the frequency of a free orbit."""

    @property
    def V(self) -> Array:
        """(n, r), its columns of length 1."""
        assert self.system.bends is not None
        return self.system.bends

    @property
    def x_scale(self) -> Array:
        own = np.abs(self.V).T @ np.asarray(self.system.scale) / np.abs(self.V).sum(axis=0)
        scale = np.tile(own, len(self.reference.c))
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
        R, A, over = np.zeros(len(x)), np.zeros((len(x), len(x))), np.zeros(len(x))
        R[: k * r] = (z - at.x @ self.V).ravel()
        A[: k * r, : k * r] = np.eye(k * r) - at.derivative.reshape(k * r, k * r)
        faster = at.through(derivative(len(at.x)) @ at.x).ravel()
        over[: k * r] = change * faster - at.through(P.T @ slope).ravel()
        if self.free:
            size = np.asarray(self.system.scale)
            phase = ((self.reference.slopes / size**2) @ self.V).ravel()
            A[: k * r, -1], A[-1, : k * r] = faster, phase
            R[-1] = phase @ (z - self.reference.c @ self.V).ravel()
        return R, A, over


class _Answer:
    """What follows from harmonics of z. Attributes: x: (k, n) those of all coordinates. angles: (N,) of the times."""

    def __init__(self, problem: Condensed, z: Array, omega: float, p: float) -> None:
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
        return np.array([scipy.linalg.lu_solve(one, self.V.astype(complex), trans=1).T for one in self.factors])

    def through(self, g: Array) -> Array:
        """(k, r) harmonics of z under those of a right-hand side (k, n)."""
        return _real(np.einsum("hrn,hn->hr", self.rows, _complex(g)))

    @cached_property
    def derivative(self) -> Array:
        """(k, r, k, r) of V^T x over z."""
        k, r, N = self.E.shape[1], self.V.shape[1], len(self.E)
        found = np.zeros((k, r, k, r))
        flat = self.slopes.transpose(1, 0, 2).reshape(len(self.V), N * r)
        for h, rows in enumerate(self.rows):
            each = (rows @ flat).reshape(r, N, r)
            cosine = self.P[:, 2 * h - 1] - 1j * self.P[:, 2 * h] if h else self.P[:, 0]
            part = np.einsum("ajb,jc->acb", each, cosine[:, None] * self.E, optimize=True)
            if h:
                found[2 * h - 1], found[2 * h] = part.real, -part.imag
            else:
                found[0] = part.real
        return found


def _complex(c: Array) -> ComplexArray:
    """(H + 1, n) of harmonics in cosine and sine, c cos + s sin = Re (c - i s) exp(i t')."""
    return np.concatenate([c[:1].astype(complex), c[1::2] - 1j * c[2::2]])


def _real(c: ComplexArray) -> Array:
    found = np.zeros((2 * len(c) - 1, c.shape[1]))
    found[0], found[1::2], found[2::2] = c[0].real, c[1:].real, -c[1:].imag
    return found

"""Periodic orbits by multiple shooting: pieces of a period that begin where the last one ends.

With the flow phi over the m-th part of the period T from the nodes x_1, ..., x_m,

    phi(x_i) - x_{i+1} = 0,  sum of x_i_ref' . (x_i - x_i_ref) = 0,

where the last equation, which chooses among the shifts in time of a free orbit, is a driven one's T = 2 pi k / Omega
(E. Doedel, H. B. Keller, J. P. Kernevez, Int. J. Bifurcation and Chaos 1, 1991, for the condition of phase).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import jax
import numpy as np
import scipy.linalg

from ..data import Array, ComplexArray
from . import flow
from .dynamics import Dynamics


@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A periodic orbit. Attributes: system. x: (m, n) nodes at equal times, the first at 0. period: s. p. turns: k of
    what drives in a period."""

    system: Dynamics
    x: Array
    period: float
    p: float
    turns: int = 1

    def __repr__(self) -> str:
        return f"<PeriodicOrbit: period {self.period:.6g} s at {self.p:.6g}, {len(self.x)} nodes>"

    def sampled(self, each: int = 8) -> Array:
        """(m each, n) at equal times of one period."""
        x = flow.samples(self.system, self.x, self.p, self.period, self.turns, each)
        return np.asarray(x.reshape(-1, self.system.count))

    @cached_property
    def derivatives(self) -> Array:
        """(m, n, n) of the ends of the pieces over their beginnings."""
        ends = flow.pieces(self.system, self.x, self.p, self.period, self.turns)
        return np.asarray(ends.dx[:, :, : self.system.count])

    @cached_property
    def monodromy(self) -> Array:
        """(n, n) derivative of where a period leads, over the first node."""
        product = np.eye(self.system.count)
        for piece in self.derivatives:
            product = piece @ product
        return product

    @cached_property
    def multipliers(self) -> ComplexArray:
        """Floquet multipliers, the largest first: (n,) of a driven orbit; (n - 1,) of a free one, without the one along
        the orbit, which is 1: those of the map of the plane across the flow onto itself."""
        M, size = self.monodromy, np.asarray(self.system.scale)
        if self.system.frequency is None:
            slope = np.asarray(flow.rates(self.system)(self.x, self.p, 0.0))[0]
            across = scipy.linalg.null_space((slope / size)[None])
            M = across.T @ (M @ (across * size[:, None]) / size[:, None])
        values = np.linalg.eigvals(M).astype(complex)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @property
    def stable(self) -> bool:
        return is_stable(self.multipliers)


STABLE = 1e-7
"""By which a multiplier may stand beyond the unit circle and count as on it."""


def is_stable(multipliers: ComplexArray) -> bool:
    return bool(np.abs(multipliers).max(initial=0.0) < 1 + STABLE)


@dataclass(frozen=True, eq=False)
class Shooting:
    """The equations of m nodes and, of a free orbit, its period: `continuation.Equations`.

    Attributes:
        system. reference: an orbit nearby, from which the phase is not to move. long: s, what a long period is.
    """

    system: Dynamics
    reference: PeriodicOrbit
    long: float

    @property
    def count(self) -> int:
        """m."""
        return len(self.reference.x)

    @property
    def free(self) -> bool:
        return self.system.frequency is None

    @cached_property
    def x_scale(self) -> Array:
        """Such that length along a curve does not depend on the number of nodes."""
        nodes = np.tile(self.system.scale, self.count) * np.sqrt(self.count)
        return np.append(nodes, self.long) if self.free else nodes

    @property
    def lam_scale(self) -> float:
        return self.system.parameter_scale

    @cached_property
    def _moving(self) -> Array:
        """(m n,) x' at the nodes of the reference, scaled."""
        slopes = np.asarray(flow.rates(self.system)(self.reference.x, self.reference.p, 0.0))
        return (slopes / np.asarray(self.system.scale) ** 2).ravel()

    def unknowns(self, orbit: PeriodicOrbit) -> Array:
        return np.append(orbit.x, orbit.period) if self.free else orbit.x.ravel()

    def orbit(self, x: Array, p: float) -> PeriodicOrbit:
        """Of unknowns."""
        nodes = x[: self.count * self.system.count].reshape(self.count, -1)
        period = float(x[-1]) if self.free else self._driven(p)[0]
        return PeriodicOrbit(self.system, nodes.copy(), period, float(p), self.reference.turns)

    def _driven(self, p: float) -> tuple[float, float]:
        """T and its derivative over p of a driven orbit."""
        assert self.system.frequency is not None
        Omega, slope = jax.jvp(self.system.frequency, (float(p),), (1.0,))
        T = 2 * np.pi * self.reference.turns / float(Omega)
        return T, -T * float(slope) / float(Omega)

    def evaluate(self, x: Array, lam: float) -> tuple[Array, Array, Array]:
        m, n = self.reference.x.shape
        nodes = x[: m * n].reshape(m, n)
        T, dT = (float(x[-1]), 0.0) if self.free else self._driven(lam)
        lost = np.full(len(x), np.inf), np.full((len(x), len(x)), np.inf), np.full(len(x), np.inf)
        if not (np.isfinite(x).all() and T > 0):
            return lost
        ends, dx, _, fine = flow.pieces(self.system, nodes, lam, T, self.reference.turns)
        if not fine.all():
            return lost
        R, J, slope = np.zeros(len(x)), np.zeros((len(x), len(x))), np.zeros(len(x))
        following = np.roll(np.arange(m), -1)
        R[: m * n] = (ends - nodes[following]).ravel()
        blocks = J[: m * n, : m * n].reshape(m, n, m, n)
        blocks[np.arange(m), :, following, :] -= np.eye(n)
        blocks[np.arange(m), :, np.arange(m), :] += dx[:, :, :n]
        slope[: m * n] = (dx[:, :, n] + dT * dx[:, :, n + 1]).ravel()
        if self.free:
            J[: m * n, -1] = dx[:, :, n + 1].ravel()
            J[-1, : m * n] = self._moving
            R[-1] = self._moving @ (nodes - self.reference.x).ravel()
        return R, J, slope

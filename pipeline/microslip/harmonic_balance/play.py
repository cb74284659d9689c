"""A spring in series with a slider along one line, by hand: small problems wait for their marching, not for the rest.

A law that is marched as a compiled program costs a tenth of a microsecond a point and sample, but half a millisecond
a call. One point under a constant normal force that moves along a tangent is a play operator (Krejci, Hysteresis,
Convexity and Dissipation in Hyperbolic Equations, 1996): its slider stands where it was dragged to last, and the
derivative of that place is the one of a single sample. Its memory is periodic after the first cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import jax.numpy as jnp
import numpy as np

from ..contact.friction import Coulomb
from ..contact.harmonics import fourier
from ..contact.normal import Preload
from ..contact.patch import Patch
from ..contact.point import PointContact
from ..data import Array, Indices
from .forces import AFT, Forces
from .point_cycles import Cycle, Traced, above_rounding, derivative


@dataclass(frozen=True, eq=False)
class JenkinsPlay(AFT):
    """`AFT` for a patch of one point and one coordinate along its tangents, with a constant normal force."""

    @cached_property
    def spring(self) -> float:
        """Stiffness along the coordinate, N/m."""
        return float(np.asarray(self._law.stiffness_1)) * self._length**2

    @cached_property
    def width(self) -> float:
        """How far the coordinate is from the slider while this is dragged."""
        law, zero = self._law, jnp.zeros(1)
        normal = law.normal.force(zero)
        return float((law.friction.coefficient(zero, normal, zero) * normal)[0]) * self._length / self.spring

    def force(self, u: Array, period: float) -> Array:
        path, places, _ = self._sliders(u)
        return (self.spring * (path - places) @ self._waves(u)[1].T)[:, None]

    def forces(self, u: Array, period: float) -> tuple[Array, Array]:
        values, transform = self._waves(u)
        path, places, dragged = self._sliders(u)
        known = np.vstack([values, np.zeros(values.shape[1])])  # the last row: a slider that was never dragged
        slope = self.spring * (transform @ (values - known[dragged]))
        return (self.spring * (path - places) @ transform.T)[:, None], slope[:, None, :, None]

    def traced(self, u: Array, period: float) -> list[Traced]:
        path, places, _ = self._sliders(u)
        force, none = self.spring * (path - places), np.zeros(1)
        mean = 0.5 * (force + np.roll(force, 1, axis=1))
        moved, slid = (x - np.roll(x, 1, axis=1) for x in (path, places))
        ahead = u[:, 0] @ (self._waves(u)[0] @ derivative(u.shape[2])).T * (2 * np.pi / self.samples)
        slips = np.abs(slid) > 1e-9 * np.abs(moved).max(initial=0.0)
        lost = self.spring * self.width * (np.abs(slid) * slips).sum(axis=1)
        work = above_rounding(force * ahead, 1), (mean * slid * slips).sum(axis=1), lost, slips.mean(axis=1)
        cycles = [Cycle(d, s, f, c, none, 0.0) for d, s, f, c in np.transpose(work)[..., None]]
        return [Traced(f, one) for f, one in zip(self._of_points(force), cycles, strict=True)]

    def _of_points(self, force: Array) -> Array:
        """(c, s, 1, 3) forces of the points, with the constant normal one, from those along the coordinate."""
        out = force[..., None, None] * self.patch.kinematics[:, :, 0] / self._length**2
        out[..., 0] += float(np.asarray(self._law.normal.force(jnp.zeros(1)))[0])
        return out

    @property
    def _law(self) -> PointContact:
        assert isinstance(self.patch.law, PointContact)
        return self.patch.law

    @cached_property
    def _length(self) -> float:
        """How far the point moves per unit of the coordinate."""
        return float(np.linalg.norm(self.patch.kinematics))

    def _waves(self, u: Array) -> tuple[Array, Array]:
        return _waves(u.shape[2] // 2, self.samples)

    def _sliders(self, u: Array) -> tuple[Array, Array, Indices]:
        """(c, s) the coordinate over a cycle, places of its slider, samples that dragged it there (-1: none)."""
        path = u[:, 0] @ self._waves(u)[0].T
        found = [play(one, self.width) for one in path.tolist()]
        dragged, signs = np.array([f[0] for f in found]), np.array([f[1] for f in found])
        at = np.take_along_axis(path, dragged, axis=1) - self.width * signs
        return path, np.where(dragged >= 0, at, 0.0), dragged


@lru_cache(maxsize=8)
def _waves(harmonics: int, samples: int) -> tuple[Array, Array]:
    values, transform = fourier(harmonics, samples)
    return np.asarray(values), np.asarray(transform)


def play(path: list[float], width: float) -> tuple[list[int], list[int]]:
    """Of every sample of the second cycle of a path: the sample that dragged the slider last (-1: none yet),
    and in which direction, +1 or -1. It begins at 0."""
    low, high, last, sign = -width, width, -1, 0
    dragged, signs = [], []
    for keep in (False, True):
        for i, x in enumerate(path):
            if x > high:
                low, high, last, sign = x - 2 * width, x, i, 1
            elif x < low:
                low, high, last, sign = x, x + 2 * width, i, -1
            if keep:
                dragged.append(last)
                signs.append(sign)
    return dragged, signs


def model(patch: Patch, contacts: int, samples: int, cycles: int, periodicity: float) -> Forces:
    """Of the forces of equal contacts: by hand where that is possible, else marched."""
    plain = _plain(patch)
    return (JenkinsPlay if plain and cycles > 1 else AFT)(patch, contacts, samples, cycles, periodicity)


def _plain(patch: Patch) -> bool:
    """One point, one coordinate along its tangents, constant normal force and friction, one stiffness, no damper."""
    law, G = patch.law, patch.kinematics
    if G.shape != (1, 3, 1) or G[0, 0, 0] or not isinstance(law, PointContact):
        return False
    if not isinstance(law.normal, Preload) or not isinstance(law.friction, Coulomb):
        return False
    return law.stiffness_2 is None and law.damping is None and np.size(law.stiffness_1) == 1

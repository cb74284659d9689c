"""Contacts of one point that moves along one line, by hand: small problems wait for their marching, not for the rest.

A law that is marched as a compiled program costs a tenth of a microsecond a point and sample, but half a millisecond
a call. A spring without memory needs no marching. A spring in series with a slider that holds a constant force is a
play operator (Krejci, Hysteresis, Convexity and Dissipation in Hyperbolic Equations, 1996): its slider stands where it
was dragged to last, and the derivative of that place is the one of a single sample. Its memory is periodic after the
first cycle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.elements import Spring, Stop
from ..contact.friction import Coulomb
from ..contact.jenkins import Jenkins
from ..contact.law import Law
from ..contact.normal import Preload
from ..contact.patch import Patch
from ..contact.periodic import Known
from ..contact.point import PointContact
from ..data import Array, ComplexArray, Indices, largest
from ..series import Torus, amplitudes, integrals
from .forces import AFT, Cycle, Forces, Traced, above_rounding


@dataclass(frozen=True, eq=False)
class OneCoordinate(AFT):
    """`AFT` for a patch of one point and one coordinate along its tangents."""

    def _sampled(self, u: Array) -> tuple[Array, Array, Array]:
        """(c, s) the coordinate over a cycle, (s, W) values of the harmonics, (W, s) their transform."""
        values, _, transform = self.waves(u.shape[2])
        return u[:, 0] @ values.T, values, transform

    def near(self, u: Array, period: float, known: Known | None) -> tuple[Array, None]:
        return self.force(u, period), None

    def rate(self, u: Array, period: float) -> None:
        """The force depends on the path alone."""

    def _speed(self, u: Array) -> Array:
        """(c, s) change of the coordinate from sample to sample, by its derivative."""
        ahead = self.waves(u.shape[2])[1]
        return u[:, 0] @ ahead.T / len(ahead)

    @cached_property
    def _length(self) -> float:
        """How far the point moves per unit of the coordinate."""
        return float(np.linalg.norm(self.patch.kinematics))

    def _of_points(self, force: Array, normal: float = 0.0) -> Array:
        """(c, s, 1, 3) forces of the points, with a constant normal one, from those along the coordinate."""
        out = force[..., None, None] * self.patch.kinematics[:, :, 0] / self._length**2
        out[..., 0] += normal
        return out


@dataclass(frozen=True, eq=False)
class ElasticSpring(OneCoordinate):
    """A spring that remembers nothing: `contact.elements.Spring`."""

    def force(self, u: Array, period: float) -> Array:
        values, transform = self._turned(u.shape[2])
        return self._spring.force(u @ values.T) @ transform.T

    def forces(self, u: Array, period: float) -> tuple[Array, Array]:
        values, transform = self._turned(u.shape[2])
        path = u @ values.T
        slope = (transform * self._spring.slope(path)) @ values
        return self._spring.force(path) @ transform.T, slope[:, None, :, None]

    def _turned(self, coefficients: int) -> tuple[Array, Array]:
        """(s, W) how far the spring is stretched, and (W, s) coefficients of its force along the coordinate."""
        if coefficients not in self._known:
            values, _, transform = self.waves(coefficients)
            self._known[coefficients] = self._turn * values, self._turn * transform
        return self._known[coefficients]

    @cached_property
    def _known(self) -> dict[int, tuple[Array, Array]]:
        return {}

    def traced(self, u: Array, period: float) -> list[Traced]:
        force, zero = self._turn * self._spring.force(self._turn * self._sampled(u)[0]), np.zeros(1)
        work = above_rounding(force * self._speed(u), 1)
        cycles = [Cycle(w[None], zero, zero, zero, zero, 0.0) for w in work]
        return [Traced(f, one) for f, one in zip(self._of_points(force), cycles, strict=True)]

    @cached_property
    def _turn(self) -> float:
        """How far the spring is stretched per unit of the coordinate."""
        return float(self.patch.kinematics[0, 1, 0])

    @cached_property
    def _spring(self) -> Spring:
        """The law with numbers of Python, by which arrays are multiplied faster."""
        assert isinstance(self.patch.law, Spring)
        return jax.tree_util.tree_map(lambda number: np.asarray(number).tolist(), self.patch.law)


@dataclass(frozen=True, eq=False)
class ElasticStop(ElasticSpring):
    """`contact.elements.Stop`: its force is linear from the instants at which it closes to those at which it opens.

    With E the harmonics over the angle t and the integrals over the contact alone, its coefficients are

        P F = k w (integral of E^T E dt u - gap integral of E^T dt),    w = 1/(2 pi), 1/pi, 1/pi, ...

    exact for every number of samples, which only tell where the instants are. The force is zero at these, so that
    their own change has no share in the derivative, k w integral of E^T E dt.
    """

    def force(self, u: Array, period: float) -> Array:
        return self.forces(u, period)[0]

    def forces(self, u: Array, period: float) -> tuple[Array, Array]:
        W = u.shape[2]
        force, slope = np.zeros(u.shape), np.zeros((len(u), 1, W, 1, W))
        law = self._spring
        assert isinstance(law, Stop)
        share = np.full(W, self._turn * law.stiffness / np.pi)
        share[0] *= 0.5
        for c, one in enumerate(self._turn * u[:, 0]):
            for sign, gap in law.sides:
                over = sign * one
                over[0] -= gap
                met = integrals(W // 2, *self._instants(over))
                force[c, 0] += sign * share * (met @ over)
                slope[c, 0, :, 0] += self._turn * share[:, None] * met
        return force, slope

    def _instants(self, over: Array) -> tuple[Array, Array]:
        """Angles at which a signal (W,) gets above zero, and those at which it falls below again."""
        values, ahead, _ = self.waves(len(over))
        y, h, c = values @ over, 2 * np.pi / len(values), amplitudes(over)
        t = np.arange(len(y)) * h
        slope = ahead @ over / (2 * np.pi)
        side = np.where(y > 0, -1.0, 1.0)
        turns = (side * slope > 0) & (side * np.roll(slope, -1) < 0) & (np.roll(side, -1) == side)
        near = turns & (side * (y + slope * h) > 0)  # it may pass zero twice between two samples
        if near.any():
            tops = _zeros(1j * np.arange(len(c)) * c, t[near], t[near] + h)
            t = np.insert(t, np.flatnonzero(near) + 1, tops)
            y = np.insert(y, np.flatnonzero(near) + 1, _summed(c, tops))
        closed, end = y > 0, np.append(t[1:], t[0] + 2 * np.pi)
        if closed.all():
            return np.zeros(1), np.full(1, 2 * np.pi)
        changes = np.flatnonzero(closed != np.roll(closed, -1))
        found, opens = _zeros(c, t[changes], end[changes]), closed[changes]
        begin, stop = found[~opens], found[opens]
        if len(stop) and stop[0] < begin[0]:
            stop = np.append(stop[1:], stop[0] + 2 * np.pi)
        return begin, stop


def _summed(c: ComplexArray, angles: Array) -> Array:
    """(k, ...) signals at angles (k,), of complex amplitudes (H + 1, ...), cos - i sin."""
    return (np.exp(1j * np.multiply.outer(angles, np.arange(len(c)))) @ c).real


def _zeros(c: ComplexArray, low: Array, high: Array) -> Array:
    """(k,) angles between low and high, at which a signal of complex amplitudes (H + 1,) changes
    its sign: Newton's steps from the chord's zero, halved where they leave what is left."""
    first, last = _summed(c, np.concatenate([low, high])).reshape(2, -1)
    both = np.stack([c, 1j * np.arange(len(c)) * c], axis=1)
    t = low + (high - low) * np.divide(first, first - last, out=np.zeros_like(low), where=first != last)
    for _ in range(60):
        y, rate = _summed(both, t).T
        above = (y > 0) == (last > 0)
        low, high = np.where(above, low, t), np.where(above, t, high)
        step = t - np.divide(y, rate, out=np.zeros_like(y), where=rate != 0)
        before, t = t, np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
        if (np.abs(t - before) <= 1e-13).all():  # the next step would be its square
            break
    return t


@dataclass(frozen=True, eq=False)
class JenkinsPlay(OneCoordinate):
    """A spring in series with a slider, under a constant normal force."""

    @cached_property
    def numbers(self) -> tuple[float, float, float]:
        """Of the point: its spring, N/m, what its slider holds, N, and its normal force, N."""
        law, zero = self.patch.law, jnp.zeros(1)
        if isinstance(law, Jenkins):
            return float(np.asarray(law.along)), float(np.asarray(law.held)), 0.0
        assert isinstance(law, PointContact)
        normal = law.normal.force(zero)
        holds = law.friction.coefficient(zero, normal, zero) * normal
        return float(np.asarray(law.stiffness_1)), float(holds[0]), float(np.asarray(normal)[0])

    @cached_property
    def spring(self) -> float:
        """Stiffness along the coordinate, N/m."""
        return self.numbers[0] * self._length**2

    @cached_property
    def width(self) -> float:
        """How far the coordinate is from the slider while this is dragged."""
        return self.numbers[1] * self._length / self.spring

    def force(self, u: Array, period: float) -> Array:
        path, places, _ = self._sliders(u)
        return (self.spring * (path - places) @ self._sampled(u)[2].T)[:, None]

    def forces(self, u: Array, period: float) -> tuple[Array, Array]:
        _, values, transform = self._sampled(u)
        path, places, dragged = self._sliders(u)
        known = np.vstack([values, np.zeros(values.shape[1])])  # the last row: a slider that was never dragged
        slope = self.spring * (transform @ (values - known[dragged]))
        return (self.spring * (path - places) @ transform.T)[:, None], slope[:, None, :, None]

    def traced(self, u: Array, period: float) -> list[Traced]:
        path, places, _ = self._sliders(u)
        force, none = self.spring * (path - places), np.zeros(1)
        mean = 0.5 * (force + np.roll(force, 1, axis=1))
        moved, slid = (x - np.roll(x, 1, axis=1) for x in (path, places))
        slips = np.abs(slid) > 1e-9 * largest(moved)
        lost = self.spring * self.width * (np.abs(slid) * slips).sum(axis=1)
        work = above_rounding(force * self._speed(u), 1), (mean * slid * slips).sum(axis=1), lost, slips.mean(axis=1)
        cycles = [Cycle(d, s, f, c, none, 0.0) for d, s, f, c in np.transpose(work)[..., None]]
        return [Traced(f, one) for f, one in zip(self._of_points(force, self.numbers[2]), cycles, strict=True)]

    def _sliders(self, u: Array) -> tuple[Array, Array, Indices]:
        """(c, s) the coordinate over a cycle, places of its slider, samples that dragged it there (-1: none)."""
        path = self._sampled(u)[0]
        found = [play(one, self.width) for one in path.tolist()]
        dragged, signs = np.array([f[0] for f in found]), np.array([f[1] for f in found])
        at = np.take_along_axis(path, dragged, axis=1) - self.width * signs
        return path, np.where(dragged >= 0, at, 0.0), dragged


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


def model(
    patches: Sequence[Patch], samples: int, cycles: int, periodicity: float, torus: Torus | None = None
) -> Forces:
    """Of the forces of contacts that are `alike`: by hand where that is possible, else marched."""
    laws = None if all(p is patches[0] for p in patches) else tuple(p.law for p in patches)
    kind = _kind(patches[0], cycles)
    if torus is None and kind is ElasticSpring and isinstance(patches[0].law, Stop):
        kind = ElasticStop
    return kind(patches[0], len(patches), samples, cycles, periodicity, torus, laws=laws)


def alike(patch: Patch) -> Any:
    """Equal for patches that one model serves: of the same points, with laws that differ in numbers alone. Those whose
    forces are found by hand are not alike, unless they are the same."""
    if issubclass(_kind(patch, 2), OneCoordinate):
        return id(patch)
    leaves, tree = jax.tree_util.tree_flatten(patch.law)
    return id(patch.points), id(patch.shapes), tree, tuple(np.shape(x) for x in leaves)


def _kind(patch: Patch, cycles: int) -> type[AFT]:
    if patch.kinematics.shape != (1, 3, 1):
        return AFT
    return _by_hand(patch.law, patch.kinematics[0, :, 0], cycles)


def _by_hand(law: Law, along: Array, cycles: int) -> type[AFT]:
    """For one point that moves along (3,) n, t1, t2."""
    if isinstance(law, Spring) and not along[[0, 2]].any():
        return ElasticSpring
    if isinstance(law, Jenkins) and np.count_nonzero(along) == 1 and along[law.slider]:
        return JenkinsPlay if cycles > 1 else AFT
    if isinstance(law, PointContact) and not along[0] and _plain(law):
        return JenkinsPlay if cycles > 1 else AFT
    return AFT


def _plain(law: PointContact) -> bool:
    """Constant normal force and friction, one stiffness, no damper."""
    if not isinstance(law.normal, Preload) or not isinstance(law.friction, Coulomb):
        return False
    return law.stiffness_2 is None and law.damping is None and np.size(law.stiffness_1) == 1

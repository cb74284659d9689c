"""Cumulative height distributions of rough surfaces: how much of the nominal area touches (Sextro, section 3.3).

Lengths are divided by the roughness R_Z. `area` is the share of the nominal area in contact at the approach
x* = u_x / R_Z (3.3-14), `volume` its integral from minus infinity, which is the normal force (3.3-21): whatever rises
from 0 to 1 is a contact law. The force is C1 where the area is continuous, and zero at separation where the area is
zero up to some approach: one from minus infinity (`Exponential`, `Gaussian`) never separates, its `Cut` does.
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.stats import norm as normal_distribution
from numpy.typing import ArrayLike

from ..errors import UserError
from .law import Array, Scalar, number, settings, table, values


class Heights:
    """Base of the height distributions."""

    def area(self, x: Array) -> Array:
        """Share of the nominal area in contact at approach x*; rises from 0 to 1."""
        raise NotImplementedError

    def density(self, x: Array) -> Array:
        """Slope of `area` at x*, without its jumps."""
        return jax.jvp(self.area, (x,), (jnp.ones_like(x),))[1]

    def volume(self, x: Array) -> Array:
        """Integral of `area` from minus infinity to x* (3.3-21)."""
        raise NotImplementedError

    def energy(self, x: Array) -> Array:
        """Integral of `volume` from minus infinity to x*."""
        raise NotImplementedError

    def breaks(self) -> Array:
        """(m,) approaches between which `area` is smooth: before the first it is zero, after the last one it is 1."""
        return jnp.array([0.0, 1.0])

    def jumps(self) -> tuple[np.ndarray, np.ndarray]:
        """(j,) approaches at which `area` jumps, and by how much: level parts of the surface."""
        return np.zeros(0), np.zeros(0)


@settings
class Polynomial(Heights):
    """3 x^2 - 2 x^3 between 0 and 1 (Sextro Eqs. (3.3-4), (3.3-24)): the book's surface, whose peaks are finite."""

    def area(self, x: Array) -> Array:
        x = jnp.clip(x, 0.0, 1.0)
        return x * x * (3 - 2 * x)

    def volume(self, x: Array) -> Array:
        inside = jnp.clip(x, 0.0, 1.0)
        return inside**3 * (1 - 0.5 * inside) + jnp.maximum(x - 1, 0.0)

    def energy(self, x: Array) -> Array:
        inside, beyond = jnp.clip(x, 0.0, 1.0), jnp.maximum(x - 1, 0.0)
        return inside**4 * (0.25 - 0.1 * inside) + 0.5 * beyond * (beyond + 1)


@settings
class Smooth(Heights):
    """No roughness: all of the area touches at once (Sextro Eqs. (3.3-32), (3.3-33)), the penalty law."""

    def area(self, x: Array) -> Array:
        return jnp.where(x > 0, 1.0, 0.0)

    def volume(self, x: Array) -> Array:
        return jnp.maximum(x, 0.0)

    def energy(self, x: Array) -> Array:
        return 0.5 * jnp.maximum(x, 0.0) ** 2

    def breaks(self) -> Array:
        return jnp.zeros(1)

    def jumps(self) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.ones(1)


@settings
class Linear(Heights):
    """All heights between 0 and 1 are equally frequent (Sextro Eqs. (3.3-29), (3.3-30)): a parabolic force."""

    def area(self, x: Array) -> Array:
        return jnp.clip(x, 0.0, 1.0)

    def volume(self, x: Array) -> Array:
        return 0.5 * jnp.clip(x, 0.0, 1.0) ** 2 + jnp.maximum(x - 1, 0.0)

    def energy(self, x: Array) -> Array:
        beyond = jnp.maximum(x - 1, 0.0)
        return jnp.clip(x, 0.0, 1.0) ** 3 / 6 + 0.5 * beyond * (beyond + 1)


@settings
class Exponential(Heights):
    """exp(rate (x - 1)) from minus infinity to 1, where all of the area touches (Sextro Eqs. (3.3-34), (3.3-35)).

    As printed, where the rate is 4 = R_Z / sigma_S and the force a quarter of the area. The contact never opens; a
    law that separates takes `Cut(Exponential(rate))`.
    """

    rate: Scalar = number(gt=0, default=4.0)

    def area(self, x: Array) -> Array:
        return jnp.exp(self.rate * (jnp.minimum(x, 1.0) - 1))

    def volume(self, x: Array) -> Array:
        return self.area(x) / self.rate + jnp.maximum(x - 1, 0.0)

    def energy(self, x: Array) -> Array:
        beyond = jnp.maximum(x - 1, 0.0)
        return self.area(x) / self.rate**2 + beyond * (1 / self.rate + 0.5 * beyond)

    def breaks(self) -> Array:
        return jnp.stack([1 - 40 / jnp.asarray(self.rate), jnp.asarray(1.0)])  # exp(-40) is below rounding


@settings
class Gaussian(Heights):
    """Normal distribution of the heights; mean and deviation of the polynomial if not given (Sextro Eq. (3.3-7)).

    It has no highest peak, so the contact never opens; a law that separates takes `Cut(Gaussian(mean, deviation))`.
    """

    mean: Scalar = number(default=0.5)
    deviation: Scalar = number(gt=0, default=20**-0.5)

    def area(self, x: Array) -> Array:
        return normal_distribution.cdf(self._s(x))

    def volume(self, x: Array) -> Array:
        s = self._s(x)
        return self.deviation * jnp.maximum(s * normal_distribution.cdf(s) + normal_distribution.pdf(s), 0.0)

    def energy(self, x: Array) -> Array:
        s = self._s(x)
        twice = (s * s + 1) * normal_distribution.cdf(s) + s * normal_distribution.pdf(s)
        return 0.5 * self.deviation**2 * jnp.maximum(twice, 0.0)

    def breaks(self) -> Array:
        return self.mean + self.deviation * jnp.array([-9.0, -4.0, 0.0, 4.0, 9.0])

    def _s(self, x: Array) -> Array:
        return (x - self.mean) / self.deviation


@settings
class Cut(Heights):
    """A distribution whose peaks beyond x* = 0 are gone: the heights that are left, scaled to the whole area.

    area = (A(x) - A(0)) / (1 - A(0)) for x > 0 and zero before. The area starts from zero, so the force is C1 and zero
    at separation. Leaving A(x) as it is for x > 0 would make the stiffness jump by A(0) there.

    Attributes:
        of: a distribution from minus infinity.
    """

    of: Heights

    def area(self, x: Array) -> Array:
        return self._rest(x, self.of.area(self._inside(x)) - self._area_0())

    def volume(self, x: Array) -> Array:
        inside = self._inside(x)
        return self._rest(x, self.of.volume(inside) - self.of.volume(jnp.zeros(())) - self._area_0() * inside)

    def energy(self, x: Array) -> Array:
        inside, zero = self._inside(x), jnp.zeros(())
        lost = self.of.energy(zero) + inside * (self.of.volume(zero) + 0.5 * self._area_0() * inside)
        return self._rest(x, self.of.energy(inside) - lost)

    def breaks(self) -> Array:
        return jnp.maximum(self.of.breaks(), 0.0)

    @staticmethod
    def _inside(x: Array) -> Array:
        return jnp.maximum(x, 0.0)

    def _area_0(self) -> Array:
        return self.of.area(jnp.zeros(()))

    def _rest(self, x: Array, value: Array) -> Array:
        return jnp.where(x > 0, jnp.maximum(value, 0.0), 0.0) / (1 - self._area_0())  # not the rounding of a difference


@settings
class Tabulated(Heights):
    """A table of the area, linear between its nodes: the force is quadratic and exact, the energy cubic.

    The force is C1 where the area does not jump.

    Attributes:
        x: (k,) approaches x*, or (n, k) one table per point; where one stands twice the area jumps. area_at: the area
            there, from 0 to 1. volume_at, energy_at: its integrals. `tabulated` makes all of them from the first two.
    """

    x: Array = table()
    area_at: Array = table()
    volume_at: Array = table()
    energy_at: Array = table()

    def area(self, x: Array) -> Array:
        start, slope, inside, _ = self._cell(x)
        return start[0] + slope * inside

    def volume(self, x: Array) -> Array:
        start, slope, d, beyond = self._cell(x)
        return start[1] + d * (start[0] + 0.5 * slope * d) + beyond

    def energy(self, x: Array) -> Array:
        start, slope, d, beyond = self._cell(x)
        inside = start[2] + d * (start[1] + d * (0.5 * start[0] + slope * d / 6))
        return inside + beyond * (self.volume_at[..., -1] + 0.5 * beyond)

    def breaks(self) -> Array:
        return self.x

    def jumps(self) -> tuple[np.ndarray, np.ndarray]:
        x, rises = np.asarray(self.x), np.diff(np.asarray(self.area_at))
        twice = np.diff(x) == 0
        return x[1:][twice], rises[twice]

    def _cell(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Values at the beginning of the cell of x* (3, ...), slope of the area, way inside it and beyond the table."""
        columns = jnp.stack([self.area_at, self.volume_at, self.energy_at, self.x], axis=-2)
        if self.x.ndim == 1:
            return _looked_up(columns, x)
        return jax.vmap(_looked_up, in_axes=(0, -1), out_axes=-1)(columns, x)  # points are the last axis


def _looked_up(columns: Array, x: Array) -> tuple[Array, Array, Array, Array]:
    """`Tabulated._cell` of one table (4, k)."""
    nodes = columns[3]
    j = jnp.clip(jnp.searchsorted(nodes, x, side="right") - 1, 0, len(nodes) - 1)
    start, end = columns[:, j], columns[:, jnp.minimum(j + 1, len(nodes) - 1)]
    width = end[3] - start[3]
    slope = jnp.where(width > 0, (end[0] - start[0]) / jnp.where(width > 0, width, 1.0), 0.0)
    return start[:3], slope, jnp.clip(x - start[3], 0.0, width), jnp.maximum(x - nodes[-1], 0.0)


def tabulated(x: ArrayLike, area: ArrayLike, name: str = "height distribution") -> Tabulated:
    """A table of the cumulative height distribution, checked.

    Args:
        x: (k,) approaches x* = depth below the highest peak / R_Z, rising; one that stands twice is a jump, of a level
            part. area: (k,) share of the area that lies higher, from 0 to 1. name: of the table in messages.

    Raises:
        UserError: fewer than two nodes, numbers that are not finite, x that falls, an area that falls or does not go
            from 0 to 1.
    """
    x, area = np.asarray(x, float), np.asarray(area, float)
    if x.ndim != 1 or x.shape != area.shape or len(x) < 2:
        raise UserError(f"{name}: needs two or more nodes, as many x as areas; got {x.shape} and {area.shape}")
    for what, given in (("x", x), ("area", area)):
        if not np.all(np.isfinite(given)):
            raise UserError(f"{name}: {what}[{np.argmin(np.isfinite(given))}] is not a finite number; leave it out")
    if np.any(np.diff(x) < 0):
        i = int(np.argmax(np.diff(x) < 0))
        raise UserError(f"{name}: x[{i + 1}] = {x[i + 1]:g} lies below x[{i}] = {x[i]:g}; sort the nodes")
    if np.any(np.diff(area) < 0):
        i = int(np.argmax(np.diff(area) < 0))
        raise UserError(
            f"{name}: the area falls from {area[i]:g} to {area[i + 1]:g} at x[{i + 1}] = {x[i + 1]:g}; "
            "a cumulative height distribution never falls"
        )
    if abs(area[0]) > 1e-9 or abs(area[-1] - 1) > 1e-9:
        raise UserError(f"{name}: the area goes from {area[0]:g} to {area[-1]:g}; it must go from 0 to 1")
    return summed(x, area)


def summed(x: np.ndarray, area: np.ndarray) -> Tabulated:
    """`Tabulated` with its integrals, of nodes x (..., k) that do not fall and their area (..., k), not checked."""
    d, start, slope = np.diff(x), area[..., :-1], np.diff(area)  # slope times d
    volume = _running(d * (start + 0.5 * slope))
    energy = _running(d * (volume[..., :-1] + d * (start / 2 + slope / 6)))
    return Tabulated(*map(jnp.asarray, (x, area, volume, energy)))


def _running(steps: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros_like(steps[..., :1]), np.cumsum(steps, axis=-1)], axis=-1)


def sampled(
    area: Callable[[np.ndarray], np.ndarray], start: float = 0.0, end: float = 1.0, count: int = 257, cut: bool = False
) -> Tabulated:
    """Any cumulative height distribution as a table (3.3-21).

    Args:
        area: share of the area in contact of an array of approaches x*. start, end: where it is 0 and 1. count: of
            nodes, equally spaced; the error of the force falls with their square. cut: leave out what lies outside
            start..end and scale the rest to the whole, as `Cut` does.

    Raises:
        UserError: as `tabulated`.
    """
    x = np.linspace(start, end, count)
    shares = np.asarray(area(x), float)
    if cut and shares.shape == x.shape:
        shares = (shares - shares[0]) / (shares[-1] - shares[0])
    return tabulated(x, shares, "height distribution given as a function")


def as_table(heights: Heights, count: int = 257) -> Tabulated:
    """A distribution as a table of at most about ``count`` nodes; a table stays as it is."""
    if isinstance(heights, Tabulated):
        return heights
    edges = np.unique(np.asarray(heights.breaks()))
    if len(edges) < 2:
        raise UserError("height distribution: a smooth surface has no table; use Penalty, or a roughness of 0")
    per_panel = max(2, round((count - 1) / (len(edges) - 1)) + 1)
    x = np.unique(np.concatenate([np.linspace(a, b, per_panel) for a, b in zip(edges, edges[1:], strict=False)]))
    area = values(heights, "area", x)
    area[0], area[-1] = 0.0, 1.0  # the tails before the first and after the last break are below rounding
    return tabulated(x, area)


def combined(
    first: Heights, roughness_1: float, second: Heights, roughness_2: float, count: int = 257
) -> tuple[Tabulated, float]:
    """The rough surface that acts against a smooth one as two rough surfaces do on each other (Sextro Eq. (3.3-10)).

    Depths below the highest peak that the same share z of each surface exceeds are added as squares,
    u_R(z) = sqrt(u_R1(z)^2 + u_R2(z)^2). Equal shapes keep their shape (3.3-11, 3.3-12).

    Args:
        first, second: distributions that start at x* = 0. roughness_1, roughness_2: their R_Z, m.

    Returns:
        The combined distribution and its R_Z = sqrt(R_Z1^2 + R_Z2^2), m.
    """
    if min(roughness_1, roughness_2) < 0 or max(roughness_1, roughness_2) <= 0:
        raise UserError(f"roughness: {roughness_1:g} m and {roughness_2:g} m; give lengths of 0 or more, not both 0")
    if min(roughness_1, roughness_2) == 0:
        return as_table(first if roughness_1 else second, count), max(roughness_1, roughness_2)
    tables = [as_table(h, count) for h in (first, second)]
    if any(t.x.ndim != 1 or t.x[0] < 0 for t in tables):
        raise UserError("height distribution: surfaces are combined over depths, one table each with x of 0 or more")
    area = np.unique(np.concatenate([np.asarray(t.area_at) for t in tables]))
    depths = [np.interp(area, np.asarray(t.area_at), np.asarray(t.x)) for t in tables]
    total = float(np.hypot(roughness_1, roughness_2))
    x = np.hypot(roughness_1 * depths[0], roughness_2 * depths[1]) / total
    area[-1] = 1.0
    return tabulated(x, area, "combined height distribution"), total

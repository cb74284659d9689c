"""Normal contact laws: force and share of the tangential stiffness over the approach (Sextro, sections 3.3 and 3.4)."""

from __future__ import annotations

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from ..errors import UserError
from .curves import NormalCurve
from .heights import Heights
from .law import Array, Scalar, number, settings, table


class Normal:
    """Base of the normal laws. ``u`` (n,) is the approach in m, positive where the surfaces overlap."""

    def force(self, u: Array) -> Array:
        """(n,) compressive force, N; zero where the contact is open."""
        raise NotImplementedError

    def stiffness(self, u: Array) -> Array:
        """(n,) its derivative, N/m."""
        raise NotImplementedError

    def share(self, u: Array) -> Array:
        """(n,) share of the nominal tangential stiffness that acts at this approach (3.3-40)."""
        raise NotImplementedError

    def stored(self, u: Array) -> Array:
        """(n,) elastic energy, J: the integral of the force."""
        raise NotImplementedError

    def touches(self) -> Scalar:
        """m: the approach, of each point if they differ, below which there is no force; NaN: there always is one."""
        return 0.0

    def scaled(self, share: Array) -> Normal | None:
        """The law of shares of the area, None where it has no number for that."""
        return None


@settings
class Penalty(Normal):
    """A spring that cannot pull (Sextro Eq. (3.3-33)). stiffness_0: N/m. gap: m, at u = 0."""

    stiffness_0: Array = number(ge=0)
    gap: Scalar = number(default=0.0)

    def force(self, u: Array) -> Array:
        return self.stiffness_0 * jnp.maximum(u - self.gap, 0.0)

    def stiffness(self, u: Array) -> Array:
        return self.stiffness_0 * self.share(u)

    def share(self, u: Array) -> Array:
        return jnp.where(u > self.gap, 1.0, 0.0)

    def stored(self, u: Array) -> Array:
        return 0.5 * self.stiffness_0 * jnp.maximum(u - self.gap, 0.0) ** 2

    def touches(self) -> Scalar:
        return self.gap

    def scaled(self, share: Array) -> Penalty:
        return replace(self, stiffness_0=self.stiffness_0 * share)


@settings
class Preload(Normal):
    """A constant normal force, N, that no motion changes: the book's mode of chapter 5. The contact never opens."""

    constant: Array = number(ge=0)

    def force(self, u: Array) -> Array:
        return jnp.broadcast_to(self.constant, u.shape)

    def stiffness(self, u: Array) -> Array:
        return jnp.zeros_like(u)

    def share(self, u: Array) -> Array:
        return jnp.ones_like(u)

    def touches(self) -> float:
        return np.nan

    def stored(self, u: Array) -> Array:
        return self.constant * u


@settings
class Rough(Normal):
    """An elastic layer under a rough surface (Sextro Eqs. (3.3-21), (3.3-40)).

    Attributes:
        stiffness_0: c_N0 of the full area, N/m. roughness: R_Z, m. heights: the cumulative height distribution.
    """

    stiffness_0: Array = number(ge=0)
    roughness: Array = number(gt=0)
    heights: Heights

    def force(self, u: Array) -> Array:
        return self.stiffness_0 * self.roughness * self.heights.volume(u / self.roughness)

    def stiffness(self, u: Array) -> Array:
        return self.stiffness_0 * self.share(u)

    def share(self, u: Array) -> Array:
        return self.heights.area(u / self.roughness)

    def stored(self, u: Array) -> Array:
        return self.stiffness_0 * self.roughness**2 * self.heights.energy(u / self.roughness)

    def scaled(self, share: Array) -> Rough:
        return replace(self, stiffness_0=self.stiffness_0 * share)


@settings
class Gapped(Normal):
    """Another law that begins to touch later. gap: m, at u = 0; of a curved face one for each point."""

    normal: Normal
    gap: Array = number()

    def force(self, u: Array) -> Array:
        return self.normal.force(u - self.gap)

    def stiffness(self, u: Array) -> Array:
        return self.normal.stiffness(u - self.gap)

    def share(self, u: Array) -> Array:
        return self.normal.share(u - self.gap)

    def touches(self) -> Scalar:
        return self.gap + self.normal.touches()

    def stored(self, u: Array) -> Array:
        return self.normal.stored(u - self.gap)


_GAUSS = np.polynomial.legendre.leggauss(24)  # a length of a tenth: 1e-14 of the energy


@settings
class Hyperbolic(Normal):
    """A rough layer that gets stiffer the shorter it is pressed (Sextro Eqs. (3.4-1) to (3.4-6)).

    `Rough` divided by the length l* = 1 - u / l_0 of the layer: force and tangential stiffness of the whole element,
    not strip by strip, which is a derivation only for R_Z = 0; of a rough surface it is an upper bound. The law is
    singular at u = l_0, where nothing would be left of the layer: where l* falls below ``shortest``, the force goes on
    along its tangent instead, finite and C1, and the tangential stiffness keeps its value.

    Attributes:
        stiffness_0: c_N0 of the full area at small displacements, N/m. roughness: R_Z, m. heights: the cumulative
            height distribution. length: l_0 of the undeformed layer, m. shortest: length l* that the law is used to.
    """

    stiffness_0: Array = number(ge=0)
    roughness: Array = number(gt=0)
    heights: Heights
    length: Array = number(gt=0)
    shortest: Scalar = number(gt=0, le=1, default=0.1)

    def force(self, u: Array) -> Array:
        inside, beyond = self._parts(u)
        return self._force(inside) + self._slope(inside) * beyond

    def stiffness(self, u: Array) -> Array:
        return self._slope(self._parts(u)[0])

    def share(self, u: Array) -> Array:
        inside, _ = self._parts(u)
        return self.heights.area(inside / self.roughness) / self._left(inside)

    def stored(self, u: Array) -> Array:
        """By Gauss' rule between the breaks of the heights: the integral is elementary for few of them."""
        inside, beyond = self._parts(u)
        breaks = jnp.asarray(self.roughness)[..., None] * self.heights.breaks()
        below, inside_1 = jnp.broadcast_to(breaks, (len(u), breaks.shape[-1])), inside[:, None]
        above = jnp.concatenate([below[:, 1:], jnp.full((len(u), 1), jnp.inf)], axis=1)
        half = 0.5 * (jnp.minimum(above, inside_1) - jnp.minimum(below, inside_1))[..., None]
        at = jnp.minimum(below, inside_1)[..., None] + half * (1 + _GAUSS[0])
        forces = jnp.moveaxis(self._force(jnp.moveaxis(at, 0, -1)), -1, 0)  # points last, as the settings have them
        pressed = jnp.sum(half * _GAUSS[1] * forces, axis=(1, 2))
        return pressed + beyond * (self._force(inside) + 0.5 * beyond * self._slope(inside))

    def _parts(self, u: Array) -> tuple[Array, Array]:
        """The approach up to the shortest length, and what lies beyond."""
        last = (1 - self.shortest) * self.length
        return jnp.minimum(u, last), jnp.maximum(u - last, 0.0)

    def _left(self, u: Array) -> Array:
        return 1 - u / self.length

    def _force(self, u: Array) -> Array:
        return self.stiffness_0 * self.roughness * self.heights.volume(u / self.roughness) / self._left(u)

    def _slope(self, u: Array) -> Array:
        area = self.stiffness_0 * self.heights.area(u / self.roughness)
        return (area + self._force(u) / self.length) / self._left(u)


@settings
class Potential(Normal):
    """F_NS (u / u_NS)^k (Sextro Eq. (3.3-3)); measured exponents lie between 2 and 3.3.

    The tangential stiffness follows the normal one (3.3-40) and has its nominal value at u_NS, not a bound.

    Attributes:
        force_s: F_NS, N. depth: u_NS, m. exponent: k, above 1 (1 is `Penalty`). gap: u_N0, m.
    """

    force_s: Array = number(ge=0)
    depth: Array = number(gt=0)
    exponent: Array = number(ge=1)
    gap: Scalar = number(default=0.0)

    def force(self, u: Array) -> Array:
        return self.force_s * self._power(u, self.exponent)

    def stiffness(self, u: Array) -> Array:
        return self.force_s * self.exponent / self.depth * self.share(u)

    def share(self, u: Array) -> Array:
        return self._power(u, self.exponent - 1)

    def stored(self, u: Array) -> Array:
        return self.force_s * self.depth / (self.exponent + 1) * self._power(u, self.exponent + 1)

    def _power(self, u: Array, exponent: Array) -> Array:
        x = (u - self.gap) / self.depth
        return jnp.where(x > 0, jnp.where(x > 0, x, 1.0) ** exponent, 0.0)


@settings
class Greenwood(Normal):
    """F_NS exp((u - u_N0) / sigma_S) (Sextro Eq. (3.3-1)), for comparison: this contact never opens.

    The tangential stiffness follows the force, as for the exponential heights (3.3-37); nominal at u_N0.

    Attributes:
        force_s: F_NS, N. deviation: sigma_S, m. offset: u_N0, m.
    """

    force_s: Array = number(ge=0)
    deviation: Array = number(gt=0)
    offset: Scalar = number(default=0.0)

    def force(self, u: Array) -> Array:
        return self.force_s * self.share(u)

    def stiffness(self, u: Array) -> Array:
        return self.force(u) / self.deviation

    def share(self, u: Array) -> Array:
        return jnp.exp((u - self.offset) / self.deviation)

    def stored(self, u: Array) -> Array:
        return self.force(u) * self.deviation


@settings
class Measured(Normal):
    """A measured force over the approach: cubic between its points, C1, never falling; a line beyond the last one.

    `measured` makes it of a `curves.NormalCurve`.

    Attributes:
        u: (k,) m. force_at: (k,) N, from 0. slope_at: (k,) N/m, from 0. stored_at: (k,) J. nominal: stiffness of the
            full area, N/m, to which the share of the tangential stiffness is related (3.3-40).
    """

    u: Array = table()
    force_at: Array = table(ge=0)
    slope_at: Array = table(ge=0)
    stored_at: Array = table()
    nominal: Array = number(gt=0)

    def force(self, u: Array) -> Array:
        j, h, s, beyond = self._cell(u)
        f = self._bent(j, h)
        inside = f[0] + s * (f[1] + s * (f[2] + s * f[3]))
        return inside + self.slope_at[-1] * beyond

    def stiffness(self, u: Array) -> Array:
        j, h, s, _ = self._cell(u)
        f = self._bent(j, h)
        return jnp.maximum(f[1] + s * (2 * f[2] + s * 3 * f[3]), 0.0) / h

    def share(self, u: Array) -> Array:
        return self.stiffness(u) / self.nominal

    def stored(self, u: Array) -> Array:
        j, h, s, beyond = self._cell(u)
        f = self._bent(j, h)
        inside = self.stored_at[j] + h * s * (f[0] + s * (f[1] / 2 + s * (f[2] / 3 + s * f[3] / 4)))
        return inside + beyond * (self.force_at[-1] + 0.5 * self.slope_at[-1] * beyond)

    def _cell(self, u: Array) -> tuple[Array, Array, Array, Array]:
        """Interval, its length, place in it from 0 to 1, way beyond the last point."""
        j = jnp.clip(jnp.searchsorted(self.u, u, side="right") - 1, 0, len(self.u) - 2)
        h = self.u[j + 1] - self.u[j]
        return j, h, jnp.clip((u - self.u[j]) / h, 0.0, 1.0), jnp.maximum(u - self.u[-1], 0.0)

    def _bent(self, j: Array, h: Array) -> tuple[Array, Array, Array, Array]:
        """Coefficients of Hermite's cubic on the interval."""
        rise, first, last = self.force_at[j + 1] - self.force_at[j], h * self.slope_at[j], h * self.slope_at[j + 1]
        return self.force_at[j], first, 3 * rise - 2 * first - last, first + last - 2 * rise


def measured(curve: NormalCurve, nominal: float | None = None) -> Measured:
    """The law of a measured curve.

    Args:
        nominal: stiffness of the full area, N/m; if not given the largest slope of the curve, so that the share of the
            tangential stiffness does not pass 1.

    Raises:
        UserError: a nominal stiffness that is not positive.
    """
    h, rise = np.diff(curve.knots), np.diff(curve.loads)
    middle = 1.5 * rise / h - 0.25 * (curve.slopes[:-1] + curve.slopes[1:])
    if nominal is None:
        nominal = float(max(curve.slopes.max(), middle.max()))
    if not nominal > 0:
        raise UserError(f"{curve.source}: a nominal stiffness of {nominal:g} N/m; it must be positive")
    parts = (curve.knots, curve.loads, curve.slopes, curve.stored(curve.knots), nominal)
    return Measured(*(jnp.asarray(part, dtype=float) for part in parts))

"""The book's contact: one harmonic, constant mean normal force, elliptic orbits (Sextro, section 5.2).

Every point has complex stiffnesses that depend on the amplitudes of its motion: one of the normal law over a cycle, and
two along the half-axes of the ellipse on which it moves in the contact plane. They come from tables (`orbits`,
`normal_table`). Summed over the points they are the complex 6 x 6 stiffness 5.2-32 of the patch.

What is left out, against the marched laws of `patch`: all harmonics but the first one; the change of friction with the
normal force within a cycle; separation, but for what it does to the first harmonic of the normal force; and the mean
force that a nonlinear normal law rectifies from the motion, so that at small preloads and large amplitudes the normal
stiffness is too large (half of the full one where it should vanish).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.friction import Coulomb
from ..contact.heights import Heights, Smooth
from ..contact.law import Law, settings, static, values
from ..contact.normal import Gapped, Greenwood, Hyperbolic, Measured, Normal, Penalty, Potential, Preload, Rough
from ..contact.patch import Patch
from ..contact.point import PointContact
from ..contact.portion import Portion
from ..contact.sliders import Iwan, Strips
from ..data import Array, ComplexArray
from ..errors import UserError
from ..programs import inner
from .forces import Cycle, Traced, above_rounding
from .orbits import TOLERANCE, Orbits, orbits
from .tables import Spline, Table, in_chunks, kept, law_hash, refined

NORMAL_TOLERANCE = 1e-3
"""Of the normal stiffness over the nominal one, or over the tangent at the deepest approach if that is stiffer."""


# The normal direction ----------------------------------------------------------------------------------------------


def describing_function(normal: Normal, mean: jax.Array, amplitude: jax.Array, count: int = 64) -> jax.Array:
    """Real stiffness of a normal law swinging about a mean approach (Sextro Eq. (5.2-12)), N/m; b of 5.2-13 is zero.

    Partial integration makes a mean of the tangent k over the swing of it,
    c = (2 / pi) integral from -1 to 1 of k(u_G + u_A x) sqrt(1 - x^2) dx, by Gauss' and Chebyshev's rule.

    Args:
        mean, amplitude: u_G and u_A >= 0, m, of one shape. count: of samples; the error falls with its square where
            the tangent has a kink.
    """
    angle = np.pi * np.arange(1, count + 1) / (count + 1)
    weights = jnp.asarray(2 / (count + 1) * np.sin(angle) ** 2)

    def more(summed: jax.Array, sample: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, None]:
        return summed + sample[0] * normal.stiffness(mean + amplitude * sample[1]), None

    return jax.lax.scan(more, jnp.zeros_like(mean), (weights, jnp.asarray(np.cos(angle))))[0]


def lifting(ratio: jax.Array) -> jax.Array:
    """Share of the stiffness of a spring that cannot pull, over u_G / u_A: 0 at -1, 1/2 at 0, 1 at 1.

    The closed form of 5.2-12, 1/2 + (y sqrt(1 - y^2) + arcsin y) / pi.
    """
    y = jnp.clip(ratio, -1.0, 1.0)
    inside = jnp.maximum(1 - y**2, 1e-30)
    return 0.5 + (y * jnp.sqrt(inside) + jnp.arctan2(y, jnp.sqrt(inside))) / np.pi


def _over(mean: jax.Array, amplitude: jax.Array) -> jax.Array:
    """mean / amplitude without a division by zero."""
    return mean / jnp.maximum(amplitude, 1e-9 * jnp.abs(mean) + 1e-300)


REACH = 5
"""Half of the table in units of asinh(1): the approaches from the middle of a rough surface to 41 times its half."""


@settings
class Swings:
    """The table of a normal law without dimensions over the ends of the swing, u_G - u_A and u_G + u_A.

    Along both ends runs asinh((x - middle) / half), so that the surface's own breaks lie on grid lines and what is far
    from them is seen from afar. Beyond the table the integral itself is taken.

    Attributes:
        law: with lengths over the scale and a nominal stiffness of 1. coefficients: (1, 1, p, p). middle, half: of the
            surface. scale: length, m. stiffness: nominal, N/m; one, or one per point.
    """

    law: Normal
    coefficients: jax.Array
    middle: jax.Array
    half: jax.Array
    scale: jax.Array
    stiffness: jax.Array

    def at(self, mean: jax.Array, amplitude: jax.Array) -> jax.Array:
        """Stiffness (N/m) at u_G and u_A (m), both (..., n)."""
        x, a = mean / self.scale, amplitude / self.scale
        low, high = (_from_afar((end - self.middle) / self.half) for end in (x - a, x + a))
        beyond = (low < 0) | (high > 1)
        found = Spline(self.coefficients).at(low.ravel(), high.ravel())[0].reshape(x.shape)

        def outside(_: None) -> jax.Array:
            inside = jnp.where(beyond, x, self.middle), jnp.where(beyond, a, 0.0)
            return jnp.where(beyond, describing_function(self.law, *inside), found)

        return self.stiffness * jax.lax.cond(beyond.any(), outside, lambda _: found, None)


def _from_afar(x: jax.Array) -> jax.Array:
    return 0.5 * (1 + jnp.arcsinh(x) / (REACH * np.arcsinh(1.0)))


def _near(s: Array) -> Array:
    return np.sinh((2 * s - 1) * REACH * np.arcsinh(1.0))


def normal_table(
    law: Normal, middle: float, half: float, tolerance: float = NORMAL_TOLERANCE, where: Path | None = None
) -> Table:
    """The table of a normal law without dimensions, from the folder of tables or made and put there.

    A tangent with kinks (heights that are equally frequent, a measured curve) may keep it from meeting the tolerance:
    small swings about a kink are finer than any grid. The error that is kept with the table says so.
    """
    run = jax.jit(lambda x, a: (describing_function(law, x, a, 512),))

    def tabulated(s: Array, t: Array) -> Array:
        low, high = np.meshgrid(middle + half * _near(s), middle + half * _near(t), indexing="ij")
        (found,) = in_chunks(run, 0.5 * (low + high).ravel(), 0.5 * np.abs(high - low).ravel(), size=4096)
        return found.reshape(1, 1, *low.shape)

    def worth(difference: Array, s: Array, t: Array) -> Array:
        deepest = middle + half * _near(np.maximum(s[:, None], t))
        return np.abs(difference) / np.maximum(values(law, "stiffness", deepest), 1.0)

    def make() -> Table:
        ends = ((False, False), (False, False))
        inside = 0.1, 0.5, 0.9
        parts, left = refined(tabulated, worth, [ends], tolerance, (81, 161), inside)
        errors = float(left.max()), float(np.quantile(left, 0.99))
        return Table("normal", law_hash(law), {"coefficients": parts}, *errors, tolerance, left.size)

    return kept("normal", law_hash(law), tolerance, make, where)


@settings
class ClosedForm:
    """A normal law whose 5.2-12 is elementary: no roughness, none at all, or an exponential."""

    law: Normal

    def at(self, mean: jax.Array, amplitude: jax.Array) -> jax.Array:
        """Stiffness (N/m) at u_G and u_A (m)."""
        if isinstance(self.law, Penalty):
            return self.law.stiffness_0 * lifting(_over(mean - self.law.gap, amplitude))
        if isinstance(self.law, Greenwood):
            z = jnp.maximum(amplitude / self.law.deviation, 1e-8)
            return self.law.stiffness(mean + amplitude) * 2 * jax.scipy.special.i1e(z) / z
        return jnp.zeros_like(mean)


@settings
class StripSwings:
    """Strips of a rough surface, each a spring that cannot pull."""

    strips: Strips

    def at(self, mean: jax.Array, amplitude: jax.Array) -> jax.Array:
        """Stiffness (N/m) at u_G and u_A (m)."""
        if self.strips.held is not None:
            return jnp.zeros_like(mean)
        depth, shares = (_spread(x, mean.ndim) for x in (self.strips.at * self.strips.depth, self.strips.shares))
        return self.strips.stiffness_0 * jnp.sum(shares * lifting(_over(mean - depth, amplitude)), axis=0)


@settings
class Later:
    """Another swing of points that begin to touch later, by a gap (n,), m."""

    swings: Any
    gap: jax.Array

    def at(self, mean: jax.Array, amplitude: jax.Array) -> jax.Array:
        """Stiffness (N/m) at u_G and u_A (m)."""
        return self.swings.at(mean - self.gap, amplitude)


def _spread(x: jax.Array, ndim: int) -> jax.Array:
    """(m, n) settings of strips with axes between for the shape of what they meet."""
    return jnp.reshape(x, (x.shape[0], *[1] * (ndim - 1), x.shape[1]))


def _scaled(law: Normal) -> tuple[Normal, Any, Any, tuple[float, float]]:
    """The law without dimensions, its length, its nominal stiffness, and the middle and half width of its breaks.

    Raises:
        UserError: heights, or a shape, that differ from point to point.
    """
    one = jnp.asarray(1.0)
    if isinstance(law, Rough):
        return Rough(one, one, law.heights), law.roughness, law.stiffness_0, _broken(law.heights)
    if isinstance(law, Hyperbolic):
        ratio = _same(law.length / law.roughness, "length over roughness")
        return (
            Hyperbolic(one, one, law.heights, ratio, law.shortest),
            law.roughness,
            law.stiffness_0,
            _broken(law.heights),
        )
    if isinstance(law, Potential):
        gap = _same(law.gap / law.depth, "gap over depth")
        return (
            Potential(one, one, _same(law.exponent, "exponent"), gap),
            law.depth,
            law.force_s / law.depth,
            (float(gap), 1.0),
        )
    if isinstance(law, Measured):
        d, k = law.u[-1], law.nominal
        unit = Measured(law.u / d, law.force_at / (k * d), law.slope_at / k, law.stored_at / (k * d**2), one)
        return unit, d, k, (0.5, 0.5)
    raise UserError(f"book mode: no table is made of the normal law {type(law).__name__}; it can only be marched")


def _same(value: Any, name: str) -> jax.Array:
    array = np.unique(np.asarray(value, dtype=float))
    if len(array) > 1:
        raise UserError(f"book mode: {name} differs from point to point; one table serves all points of a patch")
    return jnp.asarray(array[0])


def _broken(heights: Heights) -> tuple[float, float]:
    breaks = np.asarray(heights.breaks())
    if breaks.ndim > 1:
        raise UserError("book mode: a height distribution per point; one table serves all points of a patch")
    return float(breaks[0] + breaks[-1]) / 2, max(float(breaks[-1] - breaks[0]) / 2, 1e-3)


def swings(
    law: Normal | Strips, tolerance: float = NORMAL_TOLERANCE, where: Path | None = None
) -> tuple[Any, Table | None]:
    """What finds the normal stiffness of a law from u_G and u_A, and the table behind it if there is one."""
    if isinstance(law, Strips):
        return StripSwings(law), None
    if isinstance(law, Gapped):
        inner, table = swings(law.normal, tolerance, where)
        return Later(inner, law.gap), table
    if isinstance(law, Rough) and isinstance(law.heights, Smooth):
        law = Penalty(law.stiffness_0)
    if isinstance(law, Penalty | Preload | Greenwood):
        return ClosedForm(law), None
    unit, scale, stiffness, (middle, half) = _scaled(law)
    table = normal_table(unit, middle, half, tolerance, where)
    placed = (jnp.asarray(x, dtype=float) for x in (middle, half, scale, stiffness))
    return Swings(unit, jax.device_put(table.arrays["coefficients"]), *placed), table


# The contact plane -------------------------------------------------------------------------------------------------


def orbit_force(table: Orbits, spring: jax.Array, limit: jax.Array, t: jax.Array) -> jax.Array:
    """First harmonic of the tangential force of a massless slider behind a spring (Sextro Eqs. (5.2-15) to (5.2-29)).

    With the complex amplitude u = (u_y, u_z) and K_eta, K_zeta along the half-axes A >= B,

        f = (K_eta + K_zeta) / 2 u + (K_eta - K_zeta) / 2 (u . u) / |u . u| conj(u),    |u . u| = A^2 - B^2,

    which is 5.2-29 in the axes of the ellipse and turns and shifts in time with u: no angle of the axes is needed, and
    on a circle, which has none, the second term vanishes.

    Args:
        spring: N/m, limit: N, any shape. t: (4, ...) cos and sin parts of u_y, then of u_z, m.

    Returns:
        (4, ...) N, ordered as t.
    """
    c, s = t[0::2], t[1::2]
    first, second = jnp.sum(c**2, axis=0), jnp.sum(s**2, axis=0)
    square = first - second, -2 * jnp.sum(c * s, axis=0)  # u . u
    cross = jnp.abs(c[0] * s[1] - c[1] * s[0])  # A B
    size = first + second
    moving = size > 0
    safe = jnp.where(moving, size, 1.0)
    apart = square[0] ** 2 + square[1] ** 2
    oval = apart > 1e-24 * safe**2
    difference = jnp.where(oval, jnp.sqrt(jnp.where(oval, apart, 1.0)), 0.0)  # A^2 - B^2
    longest = 0.5 * (safe + difference)  # A^2
    e = cross / longest
    tried = spring * jnp.sqrt(longest)
    slips = moving & (tried > limit)
    held = jnp.maximum(limit, 1e-300)
    eta, zeta = table.forces(jnp.where(slips, tried / held, 2.0), e, difference / (longest * (1 + e)))
    scale = limit / jnp.where(slips, tried, 1.0)
    alpha = spring * jnp.where(slips, 0.5 * scale * (eta + zeta), 1.0)
    beta = spring * jnp.where(slips & oval, 0.5 * scale * (eta - zeta) / jnp.where(oval, difference, 1.0), 0.0)
    u = c - 1j * s
    force = alpha * u + beta * (square[0] + 1j * square[1]) * jnp.conj(u)
    return jnp.stack([force[0].real, -force[0].imag, force[1].real, -force[1].imag])


class PointSliders(NamedTuple):
    """Normal force (..., n) N of a mean approach, and springs and limits (m, ..., n) of the m sliders of a point."""

    pressed: jax.Array
    springs: jax.Array
    limits: jax.Array


def sliders(law: Law, mean: jax.Array, strips: int) -> PointSliders:
    """The sliders of a law at a mean approach (..., n), m, which both their springs and limits are taken from.

    Args:
        strips: parts into which the touching part of a rough surface is cut (Sextro Eq. (5.2-33)); 0
            presses all of it alike. Springs and normal force are those of the whole, whatever the number.
    """
    if isinstance(law, Strips):
        approach = mean if law.held is None else jnp.broadcast_to(law.held, mean.shape)
        depth, shares = (_spread(x, mean.ndim) for x in (law.at * law.depth, law.shares))
        overlap = jnp.maximum(approach - depth, 0.0)
        pressed = law.stiffness_0 * shares * overlap
        springs = jnp.where(overlap > 0, law.stiffness_t * shares, 0.0)
        return PointSliders(pressed.sum(axis=0), springs, law.mu * pressed)
    if isinstance(law, PointContact | Iwan) and isinstance(law.normal, Gapped):
        return sliders(replace(law, normal=law.normal.normal), mean - law.normal.gap, strips)
    if isinstance(law, Iwan):
        pressed, spring = law.normal.force(mean), law.stiffness * law.normal.share(mean)
        shares, strengths = (_spread(x, mean.ndim) for x in (law.shares, law.strengths))
        return PointSliders(pressed, spring * shares, law.mu * pressed * strengths)
    assert isinstance(law, PointContact) and isinstance(law.friction, Coulomb)
    pressed, spring = law.normal.force(mean), law.stiffness_1 * law.normal.share(mean)
    if not strips:
        return PointSliders(pressed, spring[None], (law.friction.mu * pressed)[None])
    assert isinstance(law.normal, Rough)
    shares, parts = _cut(law.normal, mean, strips)
    return PointSliders(pressed, law.stiffness_1 * shares, law.friction.mu * parts)


def _cut(normal: Rough, mean: jax.Array, count: int) -> tuple[jax.Array, jax.Array]:
    """Shares of the area (m, ..., n) that touch at a mean approach, by depth, and their normal forces."""
    x = mean / normal.roughness
    breaks = normal.heights.breaks()
    first, last = breaks[0], breaks[-1]
    left = _spread(jnp.linspace(1.0, 0.0, count + 1)[:, None], x.ndim) ** 2  # what is pressed least slips first
    edges = first + (jnp.clip(x, first, last) - first) * (1 - left)
    area, volume = normal.heights.area(edges), normal.heights.volume(edges)
    shares = jnp.diff(area, axis=0)
    forces = shares * x - (jnp.diff(edges * area, axis=0) - jnp.diff(volume, axis=0))
    return shares, normal.stiffness_0 * normal.roughness * jnp.maximum(forces, 0.0)


def normal_law(law: Law, strips: int = 0) -> Normal | Strips:
    """The normal law of what the book's contact can be made of.

    Raises:
        UserError: a law that it cannot be, with the reason.
    """
    if isinstance(law, Portion):
        return normal_law(law.whole, strips)
    if isinstance(law, Strips | Iwan):
        if law.stiffness_ratio is not None:
            raise UserError("book mode: different tangential stiffnesses along t1 and t2; the book's orbits have one")
        return law if isinstance(law, Strips) else law.normal
    if not isinstance(law, PointContact):
        raise UserError(f"book mode: {type(law).__name__} is no point contact without mass; it can only be marched")
    if not isinstance(law.friction, Coulomb):
        raise UserError(f"book mode: friction {type(law.friction).__name__}; the book's is Coulomb's, constant")
    if law.stiffness_2 is not None:
        raise UserError("book mode: different tangential stiffnesses along t1 and t2; the book's orbits have one")
    if law.damping is not None:
        raise UserError("book mode: damping of the point; the book leaves it out (beta = 0), leave it out too")
    inner = law.normal.normal if isinstance(law.normal, Gapped) else law.normal
    if strips and not isinstance(inner, Rough):
        raise UserError("book mode: strips are parts of a rough surface; this contact has none, ask for 0")
    return law.normal


SAMPLES = 64
"""Of a cycle in which the points are looked at."""

# The patch ---------------------------------------------------------------------------------------------------------


@settings
class BookPoints:
    """Everything that the points of one contact need.

    Attributes:
        law: of n points. swings: see there. orbits: the table. share: of the law that a point carries. strips: see
            `sliders`.
    """

    law: Law
    swings: Any
    orbits: Orbits
    share: jax.Array
    strips: int = static()

    def along(self, v: jax.Array) -> jax.Array:
        """(3, n) normal force of (3, n) motion: mean, cos, sin; N and m."""
        size = jnp.sum(v[1:] ** 2, axis=0)
        amplitude = jnp.where(size > 0, jnp.sqrt(jnp.where(size > 0, size, 1.0)), 0.0)
        pressed = sliders(self.law, v[0], 0 if isinstance(self.law, PointContact) else self.strips).pressed
        return self.share * jnp.concatenate([pressed[None], self.swings.at(v[0], amplitude) * v[1:]])

    def across(self, mean: jax.Array, t: jax.Array) -> jax.Array:
        """(4, n) tangential force of motion t: cos, sin along t1, cos, sin along t2, at a mean approach (n,)."""
        found = sliders(self.law, mean, self.strips)
        spread = jnp.broadcast_to(t[:, None], (4, *found.springs.shape))
        return self.share * orbit_force(self.orbits, found.springs, found.limits, spread).sum(axis=1)


def _motion(G: jax.Array, u: jax.Array) -> tuple[jax.Array, jax.Array]:
    """(3, n) normal and (4, n) tangential motion of the points of kinematics (n, 3, k) under (k, 3) coordinates."""
    v = jnp.einsum("nik,kh->ihn", G, u)
    return v[0], v[1:, 1:].reshape(4, -1)


@inner
def _resultants(points: BookPoints, G: jax.Array, u: jax.Array) -> jax.Array:
    """(c, k, 3) resultants of (c, k, 3) coordinates."""

    def one(u: jax.Array) -> jax.Array:
        normal, t = _motion(G, u)
        plane = points.across(normal[0], t).reshape(2, 2, -1)
        whole = jnp.einsum("nk,hn->kh", G[:, 0], points.along(normal))
        return whole.at[:, 1:].add(jnp.einsum("nik,ihn->kh", G[:, 1:], plane))

    return jax.lax.map(one, u)


@inner
def _with_slope(points: BookPoints, G: jax.Array, u: jax.Array) -> tuple[jax.Array, jax.Array]:
    """(c, k, 3) resultants and (c, k, 3, k, 3) their derivative; derivatives point by point, then contracted.

    The normal force does not know of the tangential motion, so both are moved at the same time: five directions
    instead of seven.
    """

    def both(normal: jax.Array, t: jax.Array) -> tuple[jax.Array, jax.Array]:
        return points.along(normal), points.across(normal[0], t)

    def one(u: jax.Array) -> tuple[jax.Array, jax.Array]:
        normal, t = _motion(G, u)
        (along, across), push = jax.linearize(both, normal, t)
        ways = np.zeros((5, 7))
        ways[[0, 1, 2], [0, 1, 2]] = 1.0
        ways[[1, 2, 3, 4], [3, 4, 5, 6]] = 1.0
        seeds = jnp.broadcast_to(jnp.asarray(ways)[..., None], (5, 7, len(G)))
        S, T = jax.vmap(push)(seeds[:, :3], seeds[:, 3:])  # (way, 3, n), (way, 4, n)
        force = jnp.einsum("nk,hn->kh", G[:, 0], along)
        force = force.at[:, 1:].add(jnp.einsum("nik,ihn->kh", G[:, 1:], across.reshape(2, 2, -1)))
        slope = jnp.einsum("na,nghb->ahbg", G[:, 0], jnp.einsum("ghn,nb->nghb", S[:3], G[:, 0]))
        plane = T[1:].reshape(2, 2, 2, 2, -1)  # (moved j, g, answering i, h, n)
        inner = jnp.einsum("jgihn,njb->nighb", plane, G[:, 1:])
        slope = slope.at[:, 1:, :, 1:].add(jnp.einsum("nia,nighb->ahbg", G[:, 1:], inner))
        pressed = jnp.einsum("ihn,nb->nihb", T[0].reshape(2, 2, -1), G[:, 0])
        return force, slope.at[:, 1:, :, 0].add(jnp.einsum("nia,nihb->ahb", G[:, 1:], pressed))

    return jax.lax.map(one, u)


@dataclass(frozen=True)
class BookPatch:
    """A patch of points with the book's contact, for any number of equal contacts at once.

    Attributes:
        patch: the points. points: their law and tables. tables: what is known of the tables' errors. diagonal: the
            diagonal stiffness 5.2-35 instead of 5.2-32 as `stiffness`; forces are the same but for coordinates that
            do not move, which then carry none that others cause.
    """

    patch: Patch
    points: BookPoints
    tables: tuple[Table, ...]
    diagonal: bool = False

    @cached_property
    def kinematics(self) -> Any:
        """(n, 3, k) jax array."""
        return jax.device_put(self.patch.kinematics)

    def force(self, u: Array, period: float = 1.0) -> Array:
        """(c, k, 3) mean, cos and sin of the resultants, N and N m, of coordinates u (c, k, 3), m and rad.

        The means are the normal law at the mean approach u_G, without friction, which no vibration changes: what is
        pressed keeps its preload. The period (s) changes nothing.
        """
        self._one_harmonic(u)
        return np.asarray(_resultants(self.points, self.kinematics, u))

    def forces(self, u: Array, period: float = 1.0) -> tuple[Array, Array]:
        """`force` and its exact derivative (c, k, 3, k, 3)."""
        self._one_harmonic(u)
        force, slope = _with_slope(self.points, self.kinematics, u)
        return np.asarray(force), np.asarray(slope)

    def near(self, u: Array, period: float, known: None) -> tuple[Array, None]:
        return self.force(u, period), None

    def rate(self, u: Array, period: float = 1.0) -> None:
        """The forces do not depend on the period."""

    def point_cycles(self, u: Array, period: float = 1.0) -> list[Cycle]:
        """What the points of each contact do in a cycle; a point that slips at all counts as slipping all of it."""
        self._one_harmonic(u)
        parts = [np.asarray(p) for p in _point_cycles(self.points, self.kinematics, u)]
        return [Cycle(lost, lost, lost, slips, open_, 0.0) for lost, slips, open_ in zip(*parts, strict=True)]

    def traced(self, u: Array, period: float = 1.0) -> list[Traced]:
        """`point_cycles` and the points' forces in time: mean and first harmonic, all that the mode knows."""
        angle = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
        values = np.stack([np.ones(SAMPLES), np.cos(angle), np.sin(angle)])
        forces = np.einsum("hs,cnih->csni", values, np.asarray(_of_points(self.points, self.kinematics, u)))
        return [Traced(f, one) for f, one in zip(forces, self.point_cycles(u), strict=True)]

    def stiffness(self, u: Array) -> ComplexArray:
        """(c, k, k) complex stiffness of coordinates u (c, k, 3) (Sextro Eq. (5.2-32), or (5.2-35) if asked for).

        Symmetric; times the complex amplitude of u it is that of the force.
        """
        self._one_harmonic(u)
        K = np.asarray(_stiffness(self.points, self.kinematics, u))
        return diagonal_stiffness(K, u[..., 1] - 1j * u[..., 2]) if self.diagonal else K

    def _one_harmonic(self, u: Array) -> None:
        if u.shape[1:] != (self.patch.count, 3):
            raise ValueError(f"book mode: one harmonic, (contacts, {self.patch.count}, 3); u has the shape {u.shape}")


@inner
def _point_cycles(points: BookPoints, G: jax.Array, u: jax.Array) -> tuple[jax.Array, ...]:
    """(c, n) J dissipated in the plane, and shares of the cycle that are slip and open."""
    wave = jnp.asarray(np.cos(2 * np.pi * (np.arange(SAMPLES) + 0.5) / SAMPLES))

    def one(u: jax.Array) -> tuple[jax.Array, ...]:
        normal, t = _motion(G, u)
        found, force = sliders(points.law, normal[0], points.strips), points.across(normal[0], t)
        works = jnp.stack([force[0] * t[1], -force[1] * t[0], force[2] * t[3], -force[3] * t[2]])
        lost = np.pi * above_rounding(works, 0)
        slips = (found.springs * half_axes(t)[0] > found.limits).any(axis=0)
        swing = normal[0] + jnp.sqrt(jnp.sum(normal[1:] ** 2, axis=0)) * wave[:, None]
        pressed = jax.lax.map(lambda x: sliders(points.law, x, 0).pressed, swing)
        return lost, slips.astype(float), (pressed <= 0).mean(axis=0)

    return jax.lax.map(one, u)


@inner
def _of_points(points: BookPoints, G: jax.Array, u: jax.Array) -> jax.Array:
    """(c, n, 3, 3) mean, cos and sin of the forces of the points along n, t1, t2, N; the sum of them is `_resultants`'.

    No mean of the tangential forces.
    """

    def one(u: jax.Array) -> jax.Array:
        normal, t = _motion(G, u)
        plane = points.across(normal[0], t).reshape(2, 2, -1)
        whole = jnp.zeros((len(G), 3, 3)).at[:, 0].set(points.along(normal).T)
        return whole.at[:, 1:, 1:].set(jnp.moveaxis(plane, -1, 0))

    return jax.lax.map(one, u)


@inner
def _stiffness(points: BookPoints, G: jax.Array, u: jax.Array) -> jax.Array:
    """(c, k, k) the complex stiffness of every point in the axes of the contact, contracted."""

    def one(u: jax.Array) -> jax.Array:
        normal, t = _motion(G, u)
        found = sliders(points.law, normal[0], points.strips)
        spread = jnp.broadcast_to(t[:, None], (4, *found.springs.shape))
        K = points.share * point_stiffness(points.orbits, found.springs, found.limits, spread).sum(axis=2)
        swing = points.share * points.swings.at(normal[0], jnp.sqrt(jnp.sum(normal[1:] ** 2, axis=0)))
        pressed = jnp.einsum("na,n,nb->ab", G[:, 0], swing, G[:, 0])
        return pressed + jnp.einsum("nia,ijn,njb->ab", G[:, 1:], K, G[:, 1:])

    return jax.lax.map(one, u)


def point_stiffness(table: Orbits, spring: jax.Array, limit: jax.Array, t: jax.Array) -> jax.Array:
    """(2, 2, ...) the symmetric stiffness of 5.2-29 in the axes of the contact: A^T diag(K_eta, K_zeta) A.

    Arguments as `orbit_force`'s. delta, the angle of the long half-axis, follows from the difference of the squares
    (5.2-16 prints their sum); on a circle it is arbitrary, and K_eta = K_zeta.
    """
    y, z = t[0] - 1j * t[1], t[2] - 1j * t[3]
    delta = 0.5 * jnp.arctan2(2 * (y * jnp.conj(z)).real, jnp.abs(y) ** 2 - jnp.abs(z) ** 2)
    cosine, sine = jnp.cos(delta), jnp.sin(delta)
    eta, zeta = half_axes(t)
    slips = spring * eta > limit
    e = jnp.where(eta > 0, zeta / jnp.where(eta > 0, eta, 1.0), 0.0)
    tried = jnp.where(slips, spring * eta / jnp.maximum(limit, 1e-300), 2.0)
    K = [spring * jnp.where(slips, f / tried, 1.0) for f in table.forces(tried, e, 1 - e)]
    across = (K[0] - K[1]) * cosine * sine
    first, second = K[0] * cosine**2 + K[1] * sine**2, K[0] * sine**2 + K[1] * cosine**2
    return jnp.stack([jnp.stack([first, across]), jnp.stack([across, second])])


def half_axes(t: jax.Array) -> tuple[jax.Array, jax.Array]:
    """eta_A >= zeta_A >= 0 (...) of orbits t (4, ...), ordered as `orbit_force`'s."""
    c, s = t[0::2], t[1::2]
    size = jnp.sum(c**2 + s**2, axis=0)
    apart = jnp.hypot(jnp.sum(c**2 - s**2, axis=0), 2 * jnp.sum(c * s, axis=0))
    longest = jnp.sqrt(0.5 * (size + apart))
    cross = jnp.abs(c[0] * s[1] - c[1] * s[0])
    return longest, jnp.where(longest > 0, cross / jnp.where(longest > 0, longest, 1.0), 0.0)


def diagonal_stiffness(K: ComplexArray, u: ComplexArray) -> ComplexArray:
    """(c, 6, 6) diagonal stiffness F_j / u_j (Sextro Eqs. (5.2-35), (5.2-36)) of K (c, 6, 6) and amplitudes u (c, 6).

    Its inverse costs nothing. It gives the forces of K, with phases that make it complex even along the normal; where
    a coordinate does not move the ratio says nothing, and the diagonal of K stands in.
    """
    force = np.einsum("cij,cj->ci", K, u)
    own = np.einsum("cii->ci", K)
    still = np.abs(own * u) <= 1e-9 * np.abs(force) + 1e-300
    ratio = np.where(still, own, force / np.where(still, 1.0, u))
    return ratio[:, :, None] * np.eye(6)


def book_patch(
    patch: Patch, strips: int = 0, tolerance: float = TOLERANCE, normal_tolerance: float = NORMAL_TOLERANCE,
    diagonal: bool = False, where: Path | None = None,
) -> BookPatch:  # fmt: skip
    """The book's contact of a patch whose law the contact room has.

    Args:
        strips: into which the touching part of a rough surface is cut, see `sliders`; 0 leaves its microslip out.
        tolerance, normal_tolerance: of the tables. diagonal: see `BookPatch`. where: folder of tables.

    Raises:
        UserError: a law that the book's contact cannot be, a number of strips below 0.
    """
    if strips < 0:
        raise UserError(f"book mode: {strips} strips; give 0 or more")
    law, share = (patch.law.whole, patch.law.share) if isinstance(patch.law, Portion) else (patch.law, jnp.asarray(1.0))
    normal, normal_known = swings(normal_law(law, strips), normal_tolerance, where)
    plane, plane_known = orbits(tolerance, where)
    points = BookPoints(law, normal, plane, share, strips)
    known = tuple(t for t in (plane_known, normal_known) if t is not None)
    return BookPatch(patch, points, known, diagonal)

"""Friction characteristics: the coefficient over the speed of sliding (Sextro, sections 1.2, 3.6, 4.1 and 4.4).

Static friction is the coefficient at zero speed. A coefficient that falls with the speed makes a massless contact
jump (stick-slip in one step); the return map then takes one of the roots, the regularised element resolves the jump.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field
from scipy.interpolate import PchipInterpolator

from ..errors import UserError, of_file
from ..programs import program
from ..settings.mistakes import bounded
from ..settings.numbers import Coefficient, NotNegative, Number, Positive
from .curves import read_table
from .heights import Heights
from .kinds import Columns, FileName, Kind, beside
from .law import Array, Scalar, bisected, number, settings, value, values

if TYPE_CHECKING:
    from .settings import Temperature


class Friction:
    """Base of the characteristics.

    Attributes:
        constant: whether the coefficient depends on nothing but the point; the return map then needs no bisection.
    """

    constant: ClassVar[bool] = False

    def coefficient(self, speed: Array, pressed: Array, time: Scalar = 0.0) -> Array:
        """(n,) friction coefficient.

        Args:
            speed: (n,) of sliding, m/s, not negative. pressed: (n,) normal force, N. time: s.
        """
        raise NotImplementedError

    def highest(self, pressed: Array, time: Scalar = 0.0) -> Array:
        """(n,) largest coefficient at any speed: of a characteristic that falls from the start, that at rest."""
        return self.coefficient(jnp.zeros_like(pressed), pressed, time)

    def without_scatter(self) -> Friction:
        """What is left of it without what is random."""
        return self

    def scale(self, pressed: float) -> float:
        """Inverse of the speed over which it changes, s/m, under a normal force (N); 0: it does not."""
        return 0.0

    def speeds_shown(self, pressed: float) -> np.ndarray:
        """(301,) speeds in m/s that show it, under a normal force (N)."""
        scale = self.scale(pressed)
        return np.linspace(0.0, min(5 / scale, FASTEST) if scale > 0 else 1.0, 301)

    def columns(self, speeds: np.ndarray, pressed: float) -> dict[str, np.ndarray]:
        """Name -> values at speeds (m/s) under a normal force (N), for a table."""
        return {"coefficient": coefficients(self, speeds, pressed)}


@program
def _coefficient(friction: Friction, speed: Array, pressed: Array) -> Array:
    return friction.coefficient(speed, pressed)


def coefficients(friction: Friction, speed: ArrayLike, pressed: ArrayLike) -> np.ndarray:
    """(n,) `Friction.coefficient` of numpy by one program; done operation by operation each would be compiled."""
    speed, pressed = np.broadcast_arrays(np.atleast_1d(np.asarray(speed, float)), np.asarray(pressed, float))
    return np.array(_coefficient(friction, speed, pressed))


FASTEST = 50.0
"""m/s, up to which a characteristic is drawn."""


@settings
class Coulomb(Friction):
    """The same coefficient at every speed (Fig. 1.2-1 I)."""

    mu: Array = number(ge=0)
    constant: ClassVar[bool] = True

    def coefficient(self, speed: Array, pressed: Array, time: Scalar = 0.0) -> Array:
        return jnp.broadcast_to(self.mu, speed.shape)


@settings
class StaticSliding(Friction):
    """One coefficient for sticking and a lower one for sliding (Coulomb and Amontons, Fig. 1.2-1 II)."""

    static: Array = number(ge=0)
    sliding: Array = number(ge=0)

    def coefficient(self, speed: Array, pressed: Array, time: Scalar = 0.0) -> Array:
        return jnp.where(speed > 0, self.sliding, self.static)

    def highest(self, pressed: Array, time: Scalar = 0.0) -> Array:
        return jnp.broadcast_to(jnp.maximum(self.static, self.sliding), pressed.shape)


@settings
class Falling(Friction):
    """mu_0 / (1 + p_v |v|) (Sextro Eq. (3.6-15)): heat softens the asperities. mu_0; p_v: s/m."""

    mu_0: Array = number(ge=0)
    p_v: Array = number(ge=0)

    def coefficient(self, speed: Array, pressed: Array, time: Scalar = 0.0) -> Array:
        return self.mu_0 / (1 + self.p_v * speed)

    def scale(self, pressed: float) -> float:
        return float(self.p_v)


@settings
class Exponential(Friction):
    """(mu_0 - mu_inf) exp(-rate |v|) + mu_inf (Sextro Eq. (4.1-22)).

    Rises if mu_inf is the larger. rate: lambda_e, s/m. `EXPONENTIAL_44` are the numbers of (4.4-9).
    """

    mu_0: Array = number(ge=0)
    mu_inf: Array = number(ge=0)
    rate: Array = number(ge=0)

    def coefficient(self, speed: Array, pressed: Array, time: Scalar = 0.0) -> Array:
        return (self.mu_0 - self.mu_inf) * jnp.exp(-self.rate * speed) + self.mu_inf

    def highest(self, pressed: Array, time: Scalar = 0.0) -> Array:
        return jnp.broadcast_to(jnp.maximum(self.mu_0, self.mu_inf), pressed.shape)

    def scale(self, pressed: float) -> float:
        return float(self.rate)


EXPONENTIAL_44 = Exponential(
    np.asarray(0.14 * 2.14 * np.pi / 2), np.asarray(0.14 * np.pi / 2), np.asarray(2.0)  # type: ignore[arg-type]
)  # a_1 (1 + a_2 exp(-b_1 |v|)) arctan(b_2 v), whose arctan tends to pi/2 (errata to 4.4-9: no factor 2/pi)


@settings
class Heated(Friction):
    """Linear loss with the temperature that sliding itself makes (Sextro Eqs. (3.6-3), (3.6-5), (3.6-14)).

    The temperature rise k_T q_H with the heat flow q_H = mu p_N |v| and mu = mu_0 (1 - dT / dT_E) give 3.6-15 with
    p_v = k_T mu_0 p_N / dT_E, a parameter that grows with the pressure.

    Attributes:
        mu_0: cold. resistance: k_T, K m2/W. limit: dT_E, K, where nothing would be left. area: of a point, m2.
    """

    mu_0: Array = number(ge=0)
    resistance: Array = number(ge=0)
    limit: Array = number(gt=0)
    area: Array = number(gt=0)

    def coefficient(self, speed: Array, pressed: Array, time: Scalar = 0.0) -> Array:
        return self.mu_0 / (1 + self._p_v(pressed) * speed)

    def _p_v(self, pressed: Array) -> Array:
        return self.resistance * self.mu_0 * pressed / (self.area * self.limit)

    def scale(self, pressed: float) -> float:
        return float(self._p_v(jnp.asarray(pressed)))

    def columns(self, speeds: np.ndarray, pressed: float) -> dict[str, np.ndarray]:
        warm = np.array(self.temperature(jax.device_put(speeds), jnp.full(len(speeds), pressed)))
        return super().columns(speeds, pressed) | {"temperature_rise_K": warm}

    def temperature(self, speed: Array, pressed: Array) -> Array:
        """(n,) rise of temperature in K at a speed of sliding (m/s) and a normal force (N)."""
        return self.resistance * self.coefficient(speed, pressed) * pressed * speed / self.area


@settings
class Measured(Friction):
    """A measured table of the coefficient over the speed (Fig. 1.2-1 III, 3.6-2); for rubber shifted by temperature.

    A cubic over the logarithm of the speed between the entries, C1 and without extremes of its own; constant outside
    of them. With a temperature the speed is multiplied by the shift factor of Williams, Landel and Ferry (J. Am. Chem.
    Soc. 77, 1955), log10 a_T = -c_1 (T - T_0) / (c_2 + T - T_0): warmer rubber at a higher speed slides as colder
    rubber at a lower one. Their c_1 = 8.86 and c_2 = 101.6 K are for a reference about 50 K above the glass transition
    (17.44 and 51.6 K for the glass transition itself).

    Attributes:
        speeds: (m, 1) m/s, rising and positive. values: (m, 1). slopes: (m, 1) over the logarithm of the speed.
        temperature, reference: K. c_1, c_2: -, K.
    """

    speeds: Array = number(gt=0)
    values: Array = number(ge=0)
    slopes: Array = number()
    temperature: Scalar = number(gt=0, default=293.15)
    reference: Scalar = number(gt=0, default=293.15)
    c_1: Scalar = number(ge=0, default=8.86)
    c_2: Scalar = number(ge=0, default=101.6)

    def shift(self) -> Array:
        """a_T: factor on the speed."""
        away = jnp.asarray(self.temperature) - self.reference
        return 10.0 ** (-self.c_1 * away / (self.c_2 + away))

    def speeds_shown(self, pressed: float) -> np.ndarray:
        low, high = (float(self.speeds[i, 0] / self.shift()) for i in (0, -1))
        return np.geomspace(low / 3, 3 * high, 301)

    def coefficient(self, speed: Array, pressed: Array, time: Scalar = 0.0) -> Array:
        x, y, d = jnp.log(self.speeds[:, 0]), self.values[:, 0], self.slopes[:, 0]
        at = jnp.log(jnp.clip(speed * self.shift(), self.speeds[0, 0], self.speeds[-1, 0]))
        i = jnp.clip(jnp.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
        h = x[i + 1] - x[i]
        s = (at - x[i]) / h
        rise, first, last = y[i + 1] - y[i], h * d[i], h * d[i + 1]
        return y[i] + s * (first + s * (3 * rise - 2 * first - last + s * (first + last - 2 * rise)))

    def highest(self, pressed: Array, time: Scalar = 0.0) -> Array:
        return jnp.broadcast_to(jnp.max(self.values), pressed.shape)


def characteristic(speeds: ArrayLike, values: ArrayLike, **shift: float) -> Measured:
    """A `Measured` characteristic from columns, checked.

    Args:
        speeds: (m,) m/s. values: (m,) coefficients. shift: temperature,
            reference, c_1, c_2 of `Measured`.

    Raises:
        UserError: fewer than two entries, speeds not positive and rising, coefficients negative, or not numbers; a
            temperature at which the shift has no value.
    """
    v, mu = np.asarray(speeds, dtype=float), np.asarray(values, dtype=float)
    if v.ndim != 1 or v.shape != mu.shape or len(v) < 2:
        raise UserError("a characteristic needs two or more pairs of speed and coefficient")
    for name, column in (("speed", v), ("coefficient", mu)):
        if not np.isfinite(column).all():
            line = int(np.flatnonzero(~np.isfinite(column))[0]) + 1
            raise UserError(f"{name} {line} is not a finite number; correct or remove the pair")
    if v[0] <= 0 or np.any(np.diff(v) <= 0):
        raise UserError(
            "the speeds must be positive and rise; sort them, keep each once, and leave 0 out or give it a "
            "small speed: the table runs over the logarithm of the speed, and below its first one the value stays"
        )
    if np.any(mu < 0):
        raise UserError(f"coefficient {int(np.argmax(mu < 0)) + 1} is negative; a coefficient is not")
    x = np.log(v)
    slopes = PchipInterpolator(x, mu)(x, 1)
    slopes[[0, -1]] = 0.0  # constant outside
    speed, value, slope = (jax.device_put(column)[:, None] for column in (v, mu, slopes))
    for name, given in shift.items():
        bounded(name, given)
    made = Measured(speed, value, slope, **shift)
    if not made.c_2 + made.temperature - made.reference > 0:
        raise UserError(
            f"the shift with the temperature has no value at {made.temperature:g} K; it needs more than "
            f"{made.reference - made.c_2:g} K (reference less c_2), where rubber is glass"
        )
    return made


@settings
class Scattered(Friction):
    """A characteristic that is random in time (section 3.6, Fig. 3.6-3): mean times 1 + deviation xi(t).

    xi is a stationary Gaussian process of variance one with the correlation exp(-|t| / memory), a sum of cosines
    (Shinozuka & Deodatis, Appl. Mech. Rev. 44, 1991), so that the same seed gives the same friction at the same time.
    A coefficient that would be negative is zero.

    Attributes:
        mean: characteristic. deviation: relative standard deviation, a number or itself a characteristic over the
            speed. memory: s. phases: (m, 1) of the cosines, the same for all points, or (m, n); quantiles: likewise, of
            their frequencies in the power spectrum, one in each m-th part of 0 to 1.
    """

    mean: Friction
    deviation: Array | Friction = number(ge=0)
    memory: Array = number(gt=0)
    phases: Array = number()
    quantiles: Array = number(ge=0, le=1)

    def noise(self, time: Array) -> Array:
        """xi at the times (any shape; the points last where phases differ)."""
        # equal shares of the power spectrum 1 / (1 + (omega memory)^2), whose integral is an arctan
        omega = jnp.tan(0.5 * jnp.pi * self.quantiles) / self.memory
        cosines = jnp.cos(omega * jnp.atleast_1d(time) + self.phases)
        return jnp.sqrt(2.0 / self.phases.shape[0]) * jnp.sum(cosines, axis=0)

    def coefficient(self, speed: Array, pressed: Array, time: Scalar = 0.0) -> Array:
        deviation = self.deviation
        share = deviation.coefficient(speed, pressed, time) if isinstance(deviation, Friction) else deviation
        return self.mean.coefficient(speed, pressed, time) * self._factor(share, speed, time)

    def highest(self, pressed: Array, time: Scalar = 0.0) -> Array:
        share = self.deviation.highest(pressed, time) if isinstance(self.deviation, Friction) else self.deviation
        return self.mean.highest(pressed, time) * self._factor(share, pressed, time)

    def without_scatter(self) -> Friction:
        return self.mean

    def speeds_shown(self, pressed: float) -> np.ndarray:
        return self.mean.speeds_shown(pressed)

    def columns(self, speeds: np.ndarray, pressed: float) -> dict[str, np.ndarray]:
        """Of the mean, and one standard deviation below and above it."""
        found = self.mean.columns(speeds, pressed)
        share, mean = float(np.asarray(self.deviation)), found["coefficient"]
        return found | {"mean_less_deviation": (1 - share) * mean, "mean_plus_deviation": (1 + share) * mean}

    def _factor(self, share: Array, like: Array, time: Scalar) -> Array:
        return jnp.maximum(1 + share * self.noise(jnp.broadcast_to(time, like.shape)), 0.0)


def scattered(
    mean: Friction, deviation: float | Friction, memory: float, seed: int = 0, points: int = 1, cosines: int = 64
) -> Scattered:
    """A `Scattered` characteristic of independent points, with phases and frequencies drawn from a seed.

    Over all seeds the correlation is exact; the average over time of a single one is off by about 1/sqrt(cosines).

    Raises:
        UserError: a deviation that is negative or a memory that is not positive.
    """
    if not isinstance(deviation, Friction) and not 0 <= deviation < np.inf:
        raise UserError(f"deviation: {deviation:g}; give a share of the mean, 0 or more")
    if not 0 < memory < np.inf:
        raise UserError(f"memory: {memory:g} s; give a time above 0")
    random = np.random.default_rng(seed)
    phases = random.uniform(0, 2 * np.pi, (cosines, points))
    quantiles = (np.arange(cosines)[:, None] + random.uniform(0, 1, (cosines, points))) / cosines
    share = deviation if isinstance(deviation, Friction) else jnp.asarray(float(deviation))
    return Scattered(mean, share, jnp.asarray(float(memory)), jax.device_put(phases), jax.device_put(quantiles))


# --- dry and fluid parts of a lubricated rough surface -------------------------------------------------------------

FILM = 0.01
"""Smallest film thickness over R_Z. The fluid part of (3.6-21) diverges with the logarithm of a vanishing one."""


def lubricated(
    heights: Heights, approach: ArrayLike, speed: ArrayLike, viscosity: float, film: float = FILM
) -> tuple[np.ndarray, np.ndarray]:
    """Dry and fluid part of the equivalent friction coefficient over mu_0 (Sextro Eq. (3.6-21)).

    The printed fluid integral over p / (x - u) has no value wherever material of the height u itself exists: the gap
    is zero there. A smallest film thickness is introduced and divides instead: p / max(x - u, film).

    Args:
        heights: of the rough surface. approach: (a,) u_x*, in contact. speed: (v,) v_r* (3.6-22). viscosity: eta*
            (3.6-22). film: over R_Z.

    Returns:
        (a, v) dry part, exact, and (a, v) fluid part, which depends on ``film``.

    Raises:
        UserError: an approach without contact, or a film that is not positive.
    """
    u, v = np.atleast_1d(np.asarray(approach, float)), np.abs(np.atleast_1d(np.asarray(speed, float)))
    force = values(heights, "volume", u)
    if not film > 0:
        raise UserError(f"film: {film:g}; a smallest film thickness above 0 is needed, the integral diverges without")
    if not np.all(force > 0):
        raise UserError(f"approach: {u[np.argmin(force)]:g}; the surfaces do not touch there and carry no force")
    parts = [_parts(heights, one, v, film) for one in u]
    dry, fluid = (np.array(part) for part in zip(*parts, strict=True))
    return dry / force[:, None], viscosity * v * fluid[:, None] / force[:, None]


_GAUSS = np.polynomial.legendre.leggauss(48)  # dry part: poles no nearer than 1/v* to the interval; exact to v* = 1e3


def _parts(heights: Heights, u: float, v: np.ndarray, film: float) -> tuple[np.ndarray, float]:
    """(v,) dry and fluid integral of (3.6-21) at the approach u, between the breaks of the heights."""
    breaks = np.unique(np.asarray(heights.breaks(), float))
    x, w = _panels(np.append(breaks[breaks < u], u))
    at, size = heights.jumps()
    x, weight = np.append(x, at[at < u]), np.append(values(heights, "density", x) * w, size[at < u])
    dry = np.sum((u - x) * weight / (1 + v[:, None] * (u - x)), axis=1)
    x, w = _panels(np.clip(np.append(breaks[(breaks > u) & (breaks < u + film)], [u, u + film]), u, breaks[-1]))
    thin = np.sum(values(heights, "density", x) * w) / film
    wide = np.append(breaks[breaks > u + film], u + film)
    x, w = _panels(np.log(wide - u))  # of a constant density the integrand is constant over the logarithm
    level = np.sum(size[at > u] / np.maximum(at[at > u] - u, film))
    return dry, float(thin + np.sum(values(heights, "density", u + np.exp(x)) * w) + level)


def _panels(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of Gauss' rule between the edges."""
    edges = np.unique(edges)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1 + _GAUSS[0])).ravel(), (half * _GAUSS[1]).ravel()


def smoothed(speed: Array, slope: Scalar) -> Array:
    """(2 / pi) arctan(k_S v) (Sextro Eqs. (3.7-43), (4.1-23)): what stands for the sign of a small speed."""
    return 2 / jnp.pi * jnp.arctan(slope * speed)


def creep(speed: Array, slope: Scalar) -> Array:
    """`smoothed` over the speed, and its limit at rest: the smoothed direction is this times the velocity."""
    moves = speed > 0
    some = jnp.where(moves, speed, 1.0)
    return jnp.where(moves, smoothed(some, slope) / some, 2 / jnp.pi * slope)


def halved(excess: Callable[[Array], Array], fastest: Array, powers: float, halvings: int) -> Array:
    """(n,) speed where a function is zero that is negative at rest and not negative at ``fastest``: its logarithm is
    halved so often, over so many powers of e."""
    safe = jnp.where(fastest > 0, fastest, 1.0)
    ends = jnp.full_like(safe, -powers), jnp.zeros_like(safe)
    power = bisected(lambda power: excess(safe * jnp.exp(power)), *ends, halvings)
    return jnp.where(fastest > 0, safe * jnp.exp(power), 0.0)


def peak(friction: Friction, slope: float, fastest: float = 10.0) -> tuple[float, float]:
    """Largest value of a smoothed characteristic and its speed: it never reaches mu_0 (errata to 3.7-42/43)."""
    speeds = jnp.logspace(-12, float(np.log10(fastest)), 40001)
    values = friction.coefficient(speeds, jnp.ones_like(speeds)) * smoothed(speeds, slope)
    top = int(jnp.argmax(values))
    return float(values[top]), float(speeds[top])


# the kinds of [friction] ---------------------------------------------------------------------------------------------


class FrictionKind(Kind):
    """A characteristic, which may scatter in time: mean times 1 + deviation xi(t).

    Attributes:
        heated: whether it needs the heat of sliding, [temperature], and an area.
        characteristic: what `mean` makes, where its numbers are keys of the same names.
    """

    heated: ClassVar[bool] = False
    characteristic: ClassVar[type[Friction] | None] = None
    kind: str
    """friction characteristic"""
    deviation: NotNegative = 0.0
    """relative standard deviation in time"""
    memory: Positive = 1e-3
    """[s] correlation exp(-t/memory)"""
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0
    """of the random numbers"""

    def friction(self, path: Path, heat: Temperature | None, area: float | None) -> Friction:
        """The characteristic.

        Args:
            path: of the contact file. heat: [temperature]. area: nominal, m2.
        """
        mean = self.mean(path, heat, area)
        return scattered(mean, self.deviation, self.memory, self.seed) if self.deviation else mean

    def mean(self, path: Path, heat: Temperature | None, area: float | None) -> Friction:
        """The characteristic without its scatter."""
        if self.characteristic is None:
            raise NotImplementedError
        names = (f.name for f in fields(self.characteristic))  # type: ignore[arg-type]
        return self.characteristic(*(value(getattr(self, name)) for name in names))


class OfCoulomb(FrictionKind):
    """The same coefficient at every speed."""

    kind: Literal["coulomb"]
    characteristic: ClassVar[type[Friction]] = Coulomb
    mu: Coefficient
    """coefficient"""


class OfStaticSliding(FrictionKind):
    """One coefficient for sticking, a lower one for sliding."""

    kind: Literal["static-sliding"]
    characteristic: ClassVar[type[Friction]] = StaticSliding
    static: Coefficient
    """coefficient at rest"""
    sliding: Coefficient
    """coefficient of sliding"""


class OfFalling(FrictionKind):
    """mu_0/(1 + p_v v) (3.6-15)."""

    kind: Literal["falling"]
    characteristic: ClassVar[type[Friction]] = Falling
    mu_0: Coefficient
    """coefficient at zero speed, cold"""
    p_v: NotNegative
    """[s/m] of (3.6-15)"""


class OfExponential(FrictionKind):
    """(mu_0 - mu_inf) exp(-rate v) + mu_inf (4.1-22)."""

    kind: Literal["exponential"]
    characteristic: ClassVar[type[Friction]] = Exponential
    mu_0: Coefficient
    """coefficient at zero speed, cold"""
    mu_inf: Coefficient
    """coefficient at high speed"""
    rate: NotNegative
    """[s/m] lambda_e"""


class OfHeated(FrictionKind):
    """Linear loss with the temperature that sliding makes (3.6-3, 3.6-5); needs [temperature] and an area."""

    kind: Literal["heated"]
    mu_0: Coefficient
    """coefficient at zero speed, cold"""

    heated: ClassVar[bool] = True

    def mean(self, path: Path, heat: Temperature | None, area: float | None) -> Friction:
        assert heat is not None and area is not None
        return Heated(*map(value, (self.mu_0, heat.resistance, heat.limit, area)))


class OfTable(FrictionKind):
    """A measured table of the coefficient over the speed, shifted by the temperature as rubber is (WLF)."""

    kind: Literal["table"]
    file: FileName
    """columns of speed in m/s (above 0, rising) and coefficient"""
    columns: Columns = (1, 2)
    """counted from 1 or by name"""
    temperature: Positive = 293.15
    """[K] at which it slides"""
    reference: Positive = 293.15
    """[K] at which it was measured"""
    c_1: Number = 8.86
    """of Williams, Landel and Ferry"""
    c_2: Positive = 101.6
    """[K] likewise"""

    def mean(self, path: Path, heat: Temperature | None, area: float | None) -> Friction:
        file = beside(path, self.file)
        table = read_table(file, self.columns, ("speed", "coefficient"))
        shift = {key: getattr(self, key) for key in ("temperature", "reference", "c_1", "c_2")}
        with of_file(file):
            return characteristic(table[:, 0], table[:, 1], **shift)


class OfLubricated(OfHeated):
    """Dry and fluid part of a lubricated rough surface (3.6-21): drawn; laws take the dry part (heated)."""

    kind: Literal["lubricated"]  # type: ignore[assignment]
    mu_0: Annotated[Coefficient, Field(gt=0)]
    viscosity: NotNegative
    """[Pa s] of the fluid"""
    film: Annotated[Number, Field(gt=0, lt=1)] = 0.01
    """smallest film over R_Z; the fluid part has no value without"""

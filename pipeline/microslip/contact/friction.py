"""Friction characteristics: the coefficient over the speed of sliding (Sextro, sections 1.2, 3.6, 4.1 and 4.4).

Static friction is the coefficient at zero speed. A coefficient that falls with the speed makes a massless contact
jump (stick-slip in one step); the return map then takes one of the roots, the regularised element resolves the jump.
"""

from __future__ import annotations

from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ..errors import UserError
from .law import Array, settings


class Friction:
    """Base of the characteristics.

    Attributes:
        constant: whether the coefficient depends on nothing but the point; the return map then needs no bisection.
    """

    constant: ClassVar[bool] = False

    def coefficient(self, speed: Array, pressed: Array, time: Array | float = 0.0) -> Array:
        """(n,) friction coefficient.

        Args:
            speed: (n,) of sliding, m/s, not negative. pressed: (n,) normal force, N. time: s.
        """
        raise NotImplementedError


@settings
class Coulomb(Friction):
    """The same coefficient at every speed (Fig. 1.2-1 I)."""

    mu: Array
    constant: ClassVar[bool] = True

    def coefficient(self, speed: Array, pressed: Array, time: Array | float = 0.0) -> Array:
        return jnp.broadcast_to(self.mu, speed.shape)


@settings
class StaticSliding(Friction):
    """One coefficient for sticking and a lower one for sliding (Coulomb and Amontons, Fig. 1.2-1 II)."""

    static: Array
    sliding: Array

    def coefficient(self, speed: Array, pressed: Array, time: Array | float = 0.0) -> Array:
        return jnp.where(speed > 0, self.sliding, self.static)


@settings
class Falling(Friction):
    """mu_0 / (1 + p_v |v|) (Sextro Eq. (3.6-15)): heat softens the asperities. mu_0; p_v: s/m."""

    mu_0: Array
    p_v: Array

    def coefficient(self, speed: Array, pressed: Array, time: Array | float = 0.0) -> Array:
        return self.mu_0 / (1 + self.p_v * speed)


@settings
class Exponential(Friction):
    """(mu_0 - mu_inf) exp(-rate |v|) + mu_inf (Sextro Eq. (4.1-22)).

    Rises if mu_inf is the larger. rate: lambda_e, s/m. `EXPONENTIAL_44` are the numbers of (4.4-9).
    """

    mu_0: Array
    mu_inf: Array
    rate: Array

    def coefficient(self, speed: Array, pressed: Array, time: Array | float = 0.0) -> Array:
        return (self.mu_0 - self.mu_inf) * jnp.exp(-self.rate * speed) + self.mu_inf


EXPONENTIAL_44 = Exponential(
    jnp.asarray(0.14 * 2.14 * np.pi / 2), jnp.asarray(0.14 * np.pi / 2), jnp.asarray(2.0)
)  # a_1 (1 + a_2 exp(-b_1 |v|)) arctan(b_2 v), whose arctan tends to pi/2 (errata to 4.4-9: no factor 2/pi)


@settings
class Heated(Friction):
    """Linear loss with the temperature that sliding itself makes (Sextro Eqs. (3.6-3), (3.6-5), (3.6-14)).

    The temperature rise k_T q_H with the heat flow q_H = mu p_N |v| and mu = mu_0 (1 - dT / dT_E) give 3.6-15 with
    p_v = k_T mu_0 p_N / dT_E, a parameter that grows with the pressure.

    Attributes:
        mu_0: cold. resistance: k_T, K m2/W. limit: dT_E, K, where nothing would be left. area: of a point, m2.
    """

    mu_0: Array
    resistance: Array
    limit: Array
    area: Array

    def coefficient(self, speed: Array, pressed: Array, time: Array | float = 0.0) -> Array:
        p_v = self.resistance * self.mu_0 * pressed / (self.area * self.limit)
        return self.mu_0 / (1 + p_v * speed)

    def temperature(self, speed: Array, pressed: Array) -> Array:
        """(n,) rise of temperature in K at a speed of sliding (m/s) and a normal force (N)."""
        return self.resistance * self.coefficient(speed, pressed) * pressed * speed / self.area


@settings
class Measured(Friction):
    """A measured table of the coefficient over the speed; for rubber shifted by its temperature.

    Linear between the entries over the logarithm of the speed, constant outside. With a temperature the speed is
    multiplied by the shift factor of Williams, Landel and Ferry (J. Am. Chem. Soc. 77, 1955), log10 a_T =
    -c_1 (T - T_0) / (c_2 + T - T_0): warmer rubber at a higher speed slides as colder rubber at a lower one.

    Attributes:
        speeds: (m, 1) m/s, rising and positive. values: (m, 1). temperature, reference: K. c_1, c_2: -, K.
    """

    speeds: Array
    values: Array
    temperature: Array | float = 293.15
    reference: Array | float = 293.15
    c_1: Array | float = 17.44
    c_2: Array | float = 51.6

    def shift(self) -> Array:
        """a_T: factor on the speed."""
        away = jnp.asarray(self.temperature) - self.reference
        return 10.0 ** (-self.c_1 * away / (self.c_2 + away))

    def coefficient(self, speed: Array, pressed: Array, time: Array | float = 0.0) -> Array:
        shifted = jnp.maximum(speed * self.shift(), self.speeds[0, 0])
        return jnp.interp(jnp.log(shifted), jnp.log(self.speeds[:, 0]), self.values[:, 0])


def characteristic(speeds: np.ndarray, values: np.ndarray, where: str = "the table", **shift: float) -> Measured:
    """A `Measured` characteristic from columns, checked.

    Args:
        speeds: (m,) m/s. values: (m,) coefficients. where: file or key, for the sentence. shift: of `Measured`.

    Raises:
        UserError: fewer than two entries, speeds not positive and rising, coefficients negative, or not numbers.
    """
    speeds, values = np.asarray(speeds, dtype=float), np.asarray(values, dtype=float)
    if speeds.ndim != 1 or speeds.shape != values.shape or len(speeds) < 2:
        raise UserError(f"{where}: a characteristic needs two or more pairs of speed and coefficient")
    for name, column in (("speed", speeds), ("coefficient", values)):
        if not np.isfinite(column).all():
            line = int(np.flatnonzero(~np.isfinite(column))[0]) + 1
            raise UserError(f"{where}: {name} {line} is not a finite number; correct or remove the pair")
    if speeds[0] <= 0 or np.any(np.diff(speeds) <= 0):
        raise UserError(f"{where}: the speeds must be positive and rise; sort them and keep each once")
    if np.any(values < 0):
        raise UserError(f"{where}: coefficient {int(np.argmin(values)) + 1} is negative; a coefficient is not")
    return Measured(jnp.asarray(speeds)[:, None], jnp.asarray(values)[:, None], **shift)


@settings
class Scattered(Friction):
    """A characteristic that is random in time (section 3.6, Fig. 3.6-3): mean times 1 + deviation xi(t).

    xi is a stationary Gaussian process of variance one with the correlation exp(-|t| / memory), a sum of cosines
    (Shinozuka & Deodatis, Appl. Mech. Rev. 44, 1991), so that the same seed gives the same friction at the same time.

    Attributes:
        mean: characteristic. deviation: relative standard deviation. memory: s. phases: (m, 1) of the cosines, the
            same for all points, or (m, n).
    """

    mean: Friction
    deviation: Array
    memory: Array
    phases: Array

    def noise(self, time: Array) -> Array:
        """xi at the times (any shape; the points last where phases differ)."""
        m = self.phases.shape[0]
        # equal shares of the power spectrum 1 / (1 + (omega memory)^2): the quantiles of its integral, an arctan
        omega = jnp.tan(0.5 * jnp.pi * (jnp.arange(m) + 0.5) / m)[:, None] / self.memory
        return jnp.sqrt(2.0 / m) * jnp.sum(jnp.cos(omega * jnp.atleast_1d(time) + self.phases), axis=0)

    def coefficient(self, speed: Array, pressed: Array, time: Array | float = 0.0) -> Array:
        factor = 1 + self.deviation * self.noise(jnp.broadcast_to(time, speed.shape))
        return self.mean.coefficient(speed, pressed, time) * jnp.maximum(factor, 0.0)


def scattered(
    mean: Friction, deviation: float, memory: float, seed: int = 0, points: int = 1, cosines: int = 64
) -> Scattered:
    """A `Scattered` characteristic of independent points with phases drawn from a seed."""
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, (cosines, points))
    return Scattered(mean, jnp.asarray(deviation), jnp.asarray(memory), jnp.asarray(phases))


# --- dry and fluid parts of a lubricated rough surface -------------------------------------------------------------

FILM = 0.01
"""Smallest film thickness over R_Z. The fluid part of (3.6-21) diverges with the logarithm of a vanishing one."""


def lubricated(
    density: np.ndarray, x: np.ndarray, approach: np.ndarray, speed: np.ndarray, viscosity: float, film: float = FILM
) -> tuple[np.ndarray, np.ndarray]:
    """Dry and fluid part of the equivalent friction coefficient over mu_0 (Sextro Eq. (3.6-21)).

    The printed fluid integral over p / (x - u) has no value wherever material of the height u itself exists: the gap
    is zero there. A smallest film thickness is introduced and divides instead: p / max(x - u, film).

    Args:
        density: (m,) probability density of the heights at ``x`` (m,), lengths over R_Z, x from 0 to 1.
        approach: (a, 1) u_x*. speed: (1, v) v_r* (3.6-22). viscosity: eta* (3.6-22). film: over R_Z.

    Returns:
        (a, v) dry part, exact, and (a, v) fluid part, which depends on ``film``.
    """
    above = np.maximum(approach[..., None] - x, 0.0)
    force = np.trapezoid(above * density, x, axis=-1)
    dry = np.trapezoid(above * density / (1 + speed[..., None] * above), x, axis=-1) / force
    gap = np.maximum(x - approach[..., None], film)
    fluid = np.trapezoid(np.where(x > approach[..., None], density / gap, 0.0), x, axis=-1)
    return dry, viscosity * speed * fluid / force


def pressure_parameter(mu_0: float, resistance: float, limit: float, pressure: float) -> float:
    """p_v in s/m of `Falling` (Sextro Eq. (3.6-16)): k_T (K m2/W), dT_E (K) and the pressure (Pa)."""
    return resistance * mu_0 * pressure / limit


def smoothed(speed: Array, slope: Array | float) -> Array:
    """(2 / pi) arctan(k_S v) (Sextro Eqs. (3.7-43), (4.1-23)): what stands for the sign of a small speed."""
    return 2 / jnp.pi * jnp.arctan(slope * speed)


def peak(friction: Friction, slope: float, fastest: float = 10.0) -> tuple[float, float]:
    """Largest value of a smoothed characteristic and its speed: it never reaches mu_0 (errata to 3.7-42/43)."""
    speeds = jnp.logspace(-12, float(np.log10(fastest)), 4001)
    values = friction.coefficient(speeds, jnp.ones_like(speeds)) * smoothed(speeds, slope)
    top = int(jnp.argmax(values))
    return float(values[top]), float(speeds[top])


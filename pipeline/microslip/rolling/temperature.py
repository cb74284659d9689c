"""Heating of a contact that slides or creeps: moving sources on half-spaces, Sextro 6.7.

Fields have shape (nx, ny), x along rolling and rising; material enters at the largest x and carries its heat towards
smaller x, so temperatures follow from the sources at larger x in the same strip. That holds for fast sources, L > 5.
Temperatures are rises above that of the material that enters, at the centres of the elements.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import erfc

from ..data import Array
from ..errors import UserError
from ..settings.arguments import Rows, checked, checked_fields
from ..settings.numbers import NotNegative, Positive

ITERATIONS = 200
HISTORY = 6


@checked_fields
@dataclass(frozen=True)
class Conductor:
    """What conducts the heat.

    Attributes:
        conductivity: lambda, W/(m K). density: rho, kg/m^3. heat_capacity: c, J/(kg K).

    Raises:
        UserError: one of them is not positive.
    """

    conductivity: Positive
    density: Positive
    heat_capacity: Positive

    @property
    def diffusivity(self) -> float:
        """kappa = lambda/(rho c), m^2/s, Sextro Eq. (6.7-8)."""
        return self.conductivity / (self.density * self.heat_capacity)

    @property
    def effusivity(self) -> float:
        """sqrt(lambda rho c), J/(m^2 K s^0.5)."""
        return (self.conductivity * self.density * self.heat_capacity) ** 0.5


def speed_parameter(speed: float, half_length: float, body: Conductor) -> float:
    """L = V a/(2 kappa); the equations here hold above 5 (Johnson, Contact Mechanics, 12.1)."""
    return speed * half_length / (2 * body.diffusivity)


@checked
def heat_share(first: Conductor, second: Conductor, speed_first: NotNegative, speed_second: NotNegative) -> float:
    """Part of the heat that flows into the first body, Sextro Eq. (6.7-15): both surfaces are equally hot.

    Args:
        speed_first, speed_second: of the contact over each body's surface, m/s.

    Raises:
        UserError: both are zero, or one is negative.
    """
    if speed_first + speed_second == 0:
        raise UserError("speed: is 0 over both bodies; the contact must move over one of them at least")
    into = [body.effusivity * v**0.5 for body, v in ((first, speed_first), (second, speed_second))]
    return into[0] / sum(into)


def heat_source(traction: Array, slip: Array, speed: float) -> Array:
    """q = -p s V, W/m^2, Sextro Eqs. (6.7-1), (6.7-2), from (2, nx, ny) traction (Pa) and slip over the speed (m/s)."""
    return np.maximum(-(traction * slip).sum(axis=0) * speed, 0)


@checked
def conducted(
    source: Rows, dx: Positive, body: Conductor, share: NotNegative, speed: Positive, depth: NotNegative = 0.0
) -> Array:  # fmt: skip
    """Exact temperatures of a body under sources that are constant on elements, Sextro Eqs. (6.7-11), (6.7-12).

    The integral over one element is elementary (Carslaw and Jaeger, 2.9): a source that has acted for the time t warms
    by 2 share q/lambda (sqrt(kappa t/pi) exp(-z^2/4 kappa t) - z/2 erfc(z/sqrt(4 kappa t))).

    Args:
        source: (nx, ny) q, W/m^2. dx: length of an element, m. share: part of the heat that flows into this body.
            speed: of the contact over its surface, m/s. depth: z below the surface, m.

    Returns:
        (nx, ny) K.
    """
    edges = (np.arange(len(source) + 1) - 0.5) * dx / speed  # times since an edge of an element passed
    t = body.diffusivity * np.maximum(edges, 0)
    root = np.sqrt(np.where(t > 0, t, 1))
    step = np.sqrt(t / np.pi) * np.exp(-((depth / (2 * root)) ** 2)) - depth / 2 * erfc(depth / (2 * root))
    response = 2 * share / body.conductivity * np.diff(np.where(t > 0, step, 0))
    behind = np.arange(len(source))[None, :] - np.arange(len(source))[:, None]
    return np.where(behind >= 0, response[np.maximum(behind, 0)], 0) @ source


@checked
def marched(source: Rows, dx: Positive, body: Conductor, share: NotNegative, speed: Positive) -> Array:
    """The book's marching rule, Sextro Eq. (6.7-20): exact for a constant source, otherwise too hot at the rear.

    T_i^2 = T_(i-1)^2 + (4/pi) (kappa/V) (share q/lambda)^2 dx. Args and result: see `conducted`, at the surface.
    """
    gained = 4 / np.pi * body.diffusivity / speed * (share / body.conductivity * source) ** 2 * dx
    from_front = np.cumsum(gained[::-1], axis=0)[::-1]
    return np.sqrt(from_front - gained / 2)


def falling(temperature: Array, cold: float, vanishing: float) -> Array:
    """mu = mu_0 (1 - T/dT_E), not below 0, Sextro Eqs. (6.7-22), (6.7-23): gamma_mu T* is T/dT_E.

    Args:
        cold: mu_0. vanishing: dT_E, the rise at which friction is gone, K.
    """
    return cold * np.maximum(1 - temperature / vanishing, 0)


def settled(
    source: Callable[[Array], Array], temperature: Callable[[Array], Array], friction: Callable[[Array], Array],
    cold: Array, tolerance: float = 1e-8,
) -> tuple[Array, Array]:  # fmt: skip
    """Friction and temperature that belong together: mu = friction(temperature(source(mu))).

    Args:
        source: mu (nx, ny) -> heat source; any model of the tractions. temperature: source -> K, `conducted` or
            `marched` with their settings. friction: K -> mu. cold: mu to begin with. tolerance: of mu.

    Returns:
        mu and temperature, (nx, ny).

    Raises:
        UserError: they do not settle.
    """
    mu = np.asarray(cold, float)
    tried: list[Array] = []
    answers: list[Array] = []
    for _ in range(ITERATIONS):
        warm = temperature(source(mu))
        answer = friction(warm)
        if np.abs(answer - mu).max() <= tolerance:
            return mu, warm
        tried, answers = [*tried[-HISTORY:], mu], [*answers[-HISTORY:], answer]
        mu = np.clip(_mixed(tried, answers), 0, None)
    raise UserError(f"friction: it has not settled with the temperature after {ITERATIONS} iterations")


def _mixed(tried: list[Array], answers: list[Array]) -> Array:
    """Anderson's mixing: the combination of the answers whose change is smallest."""
    changes = [a - t for a, t in zip(answers, tried, strict=True)]
    if len(tried) == 1:
        return (tried[0] + answers[0]) / 2
    steps = np.array([(c - changes[-1]).ravel() for c in changes[:-1]]).T
    weights = np.linalg.lstsq(steps, -changes[-1].ravel(), rcond=1e-10)[0]
    moves = zip(weights, answers[:-1], strict=True)
    return answers[-1] + sum((w * (a - answers[-1]) for w, a in moves), np.zeros_like(answers[-1]))

"""Springs along one coordinate that remember nothing: what small systems have in the place of surfaces."""

from __future__ import annotations

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from .law import Array, Law, Scalar, Step, number, settings, static, table


class Spring(Law):
    """Base of springs along t1. The three functions of the displacement u (m, any shape) are made of operators alone,
    so that they serve arrays of numpy as well as those of jax."""

    smooth: ClassVar[bool] = True
    viscous: ClassVar[bool] = False

    def force(self, u: Any) -> Any:
        """N."""
        raise NotImplementedError

    def slope(self, u: Any) -> Any:
        """N/m, derivative of the force."""
        raise NotImplementedError

    def energy(self, u: Any) -> Any:
        """J, integral of the force."""
        raise NotImplementedError

    def init(self, n: int) -> Array:
        return jnp.zeros((1, n))

    def step(self, u: Array, v: Array, dt: Scalar, state: Array) -> tuple[Array, Array]:
        force = self.force(u[:, 1])
        return jnp.stack([0 * force, force, 0 * force], axis=1), state

    @property
    def remembers(self) -> int | None:
        return 0

    @property
    def follows(self) -> float:
        return np.inf

    def rates(self, u: Array, v: Array, x: Array, time: Scalar, lag: float) -> tuple[Array, Array]:
        return self.step(u, v, 0.0, x)[0], x

    def limit(self, force: Array, state: Array) -> Array:
        return jnp.full(force.shape[:1], jnp.inf)

    def slip(self, state: Array) -> Array:
        return jnp.zeros((state.shape[-1], 2))

    def stored(self, u: Array, state: Array) -> Array:
        return self.energy(u[:, 1])

    def lost(self, step: Step) -> Array:
        return jnp.zeros(step.u.shape[0])


@settings
class Polynomial(Spring):
    """The force k_1 u + k_2 u^2 + ..., which may pull as well as push. stiffness: (p,) k_1, k_2, ..., N/m^p."""

    stiffness: Array = table()

    def force(self, u: Any) -> Any:
        return _horner([0.0, *self.stiffness], u)

    def slope(self, u: Any) -> Any:
        return _horner([p * k for p, k in enumerate(self.stiffness, 1)], u)

    def energy(self, u: Any) -> Any:
        return _horner([0.0, 0.0, *(k / (p + 1) for p, k in enumerate(self.stiffness, 1))], u)


def _horner(coefficients: list[Any], u: Any) -> Any:
    if len(coefficients) == 1:
        return 0 * u + coefficients[0]
    total = coefficients[-1] * u
    for c in coefficients[-2:0:-1]:
        total = _plus(total, c) * u
    return _plus(total, coefficients[0])


def _plus(total: Any, c: Any) -> Any:
    return total if isinstance(c, float) and c == 0 else total + c


@settings
class Stop(Spring):
    """A spring that is met beyond a gap and cannot pull; both: on the other side too. stiffness: N/m. gap: m."""

    smooth: ClassVar[bool] = False
    stiffness: Array = number(ge=0)
    gap: Array = number()
    both: bool = static(default=False)

    def overlap(self, u: Array) -> Array:
        return (jnp.abs(u[:, 1]) if self.both else u[:, 1]) - self.gap

    @property
    def sides(self) -> list[tuple[float, Any]]:
        """(1 or -1, gap in m) of each: it is met where the displacement times the first is beyond the gap."""
        return [(1.0, self.gap), (-1.0, self.gap)][: 2 if self.both else 1]

    def _pressed(self, u: Any) -> Any:
        over = (u > self.gap) * (u - self.gap)
        return over + (u < -self.gap) * (u + self.gap) if self.both else over

    def force(self, u: Any) -> Any:
        return self.stiffness * self._pressed(u)

    def slope(self, u: Any) -> Any:
        return self.stiffness * (0.0 + ((abs(u) if self.both else u) > self.gap))

    def energy(self, u: Any) -> Any:
        return 0.5 * self.stiffness * self._pressed(u) ** 2

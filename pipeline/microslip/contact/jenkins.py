"""The Jenkins element: linear springs along n, t1 and t2, one of the tangents behind a slider.

The contact of the book's first examples (Sextro Eqs. (5.2-22) to (5.2-28)): it does not open, and friction holds mu F_N
of the normal force that it was pressed by, however this one swings.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from .law import Array, Law, Step, number, ratio, settings, static, value


class JenkinsState(NamedTuple):
    """State of n elements: where the spring with the slider was pulled to (n,) m, its force and a row of nothing (2, n)
    N, slip (n,) m."""

    way: Array
    elastic: Array
    slipped: Array


@settings
class Jenkins(Law):
    """Springs along n, t1 and t2, one of the latter two in series with a slider.

    Attributes:
        normal: N/m. along: of the spring with the slider, N/m. across: along the other tangent, N/m. held: R = mu F_N,
            N. slider: 1 along t1, 2 along t2.
    """

    normal: Array = number(ge=0)
    along: Array = number(ge=0)
    across: Array = number(ge=0)
    held: Array = number(ge=0)
    slider: int = static(default=1)

    def init(self, n: int) -> JenkinsState:
        return JenkinsState(jnp.zeros(n), jnp.zeros((2, n)), jnp.zeros(n))

    def step(self, u: Array, v: Array, dt: Array | float, state: JenkinsState) -> tuple[Array, JenkinsState]:
        way, other = u[:, self.slider], u[:, 3 - self.slider]
        trial = state.elastic[0] + self.along * (way - state.way)
        elastic = jnp.where(jnp.abs(trial) < self.held, trial, self.held * jnp.sign(trial))
        slipped = state.slipped + ratio(trial - elastic, self.along + 0 * trial)
        after = JenkinsState(way, jnp.stack([elastic, jnp.zeros_like(elastic)]), slipped)
        return self._frame(self.normal * u[:, 0], elastic, self.across * other), after

    def _frame(self, normal: Array, along: Array, across: Array) -> Array:
        """(n, 3) along n, t1, t2."""
        return jnp.stack([normal, along, across] if self.slider == 1 else [normal, across, along], axis=1)

    def memory(self, force: Array, state: JenkinsState) -> Array:
        return state.elastic

    def recalled(self, state: JenkinsState, memory: Array) -> JenkinsState:
        return state._replace(elastic=memory)

    def limit(self, force: Array, state: JenkinsState) -> Array:
        return jnp.broadcast_to(self.held, force.shape[:1])

    def slip(self, state: JenkinsState) -> Array:
        nothing = jnp.zeros_like(state.slipped)
        return self._frame(nothing, state.slipped, nothing)[:, 1:]

    def stored(self, u: Array, state: JenkinsState) -> Array:
        springs = self.normal * u[:, 0] ** 2 + self.across * u[:, 3 - self.slider] ** 2
        return 0.5 * (springs + ratio(state.elastic[0] ** 2, self.along + 0 * springs))

    def lost(self, step: Step) -> Array:
        return self.held * jnp.abs(step.after.slipped - step.before.slipped)


def shared(springs: tuple[float, float, float], held: float, slider: int, count: int) -> Jenkins:
    """The law of one of `count` elements of a contact.

    Args:
        springs: of the whole contact along n, t1, t2, N/m. held: by friction, mu F_N of the whole contact, N.
            slider: see `Jenkins`.
    """
    n, along, across, limit = (value(v / count) for v in (springs[0], springs[slider], springs[3 - slider], held))
    return Jenkins(n, along, across, limit, slider)


def four_places(width: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """(4, 2) places and (4,) areas of elements that are as stiff against rotations as springs spread evenly over
    b0 x h0 (m; Sextro Eqs. (5.2-39) to (5.2-41))."""
    corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
    return corners * np.array([width, height]) / np.sqrt(12), np.full(4, 0.25 * width * height)

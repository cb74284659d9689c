"""The Jenkins element: linear springs along n, t1 and t2, one of the tangents behind a slider.

The contact of the book's first examples (Sextro Eqs. (5.2-22) to (5.2-28)): it does not open, and friction holds mu F_N
of the normal force that it was pressed by, however this one swings.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np

from .friction import OfCoulomb
from .kinds import LawKind
from .law import Array, Law, Scalar, Step, number, ratio, settings, static, value
from .stiffness import Given

if TYPE_CHECKING:
    from .composed import ContactModel
    from .settings import ContactLaw


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
    viscous: ClassVar[bool] = False

    def scaled(self, share: Array) -> Jenkins:
        own = {name: getattr(self, name) * share for name in ("normal", "along", "across", "held")}
        return replace(self, **own)

    def init(self, n: int) -> JenkinsState:
        return JenkinsState(jnp.zeros(n), jnp.zeros((2, n)), jnp.zeros(n))

    def step(self, u: Array, v: Array, dt: Scalar, state: JenkinsState) -> tuple[Array, JenkinsState]:
        way, other = u[:, self.slider], u[:, 3 - self.slider]
        trial = state.elastic[0] + self.along * (way - state.way)
        elastic = jnp.where(jnp.abs(trial) < self.held, trial, self.held * jnp.sign(trial))
        slipped = state.slipped + ratio(trial - elastic, self.along + 0 * trial)
        after = JenkinsState(way, jnp.stack([elastic, jnp.zeros_like(elastic)]), slipped)
        return self._frame(self.normal * u[:, 0], elastic, self.across * other), after

    @property
    def remembers(self) -> int | None:
        return 1

    def rates(self, u: Array, v: Array, x: Array, time: Scalar, lag: float) -> tuple[Array, Array]:
        """x: force of the spring with the slider, N, which grows no more where the slider holds it."""
        stretching = self.along * v[:, self.slider]
        slides = (jnp.abs(x[0]) >= self.held) & (stretching * x[0] > 0)
        force = jnp.clip(x[0], -self.held, self.held)
        rate = jnp.where(slides, 0.0, stretching)
        return self._frame(self.normal * u[:, 0], force, self.across * u[:, 3 - self.slider]), rate[None]

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


def four_places(width: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """(4, 2) places and (4,) areas of elements that are as stiff against rotations as springs spread evenly over
    b0 x h0 (m; Sextro Eqs. (5.2-39) to (5.2-41))."""
    corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
    return corners * np.array([width, height]) / np.sqrt(12), np.full(4, 0.25 * width * height)


class OfJenkins(LawKind):
    """Jenkins elements, linear springs that never open: one of the tangents, `slides_along`, behind a slider that holds
    mu F_N of the force that presses the contact, however this one swings."""

    kind: Literal["jenkins"]
    slides_along: Literal["t1", "t2"] = "t1"
    """the tangent with the slider"""

    opens: ClassVar[bool] = False
    of_the_force: ClassVar[bool] = True

    def fits(self, contact: ContactLaw) -> None:
        if contact.roughness is not None or not isinstance(contact.stiffness, Given | None):
            raise ValueError(
                'law: "jenkins" has linear springs; leave out roughness, and give their stiffnesses as numbers'
            )
        if not isinstance(contact.friction, OfCoulomb) or contact.friction.deviation:
            raise ValueError('law: "jenkins" slides by one coefficient; write a number as friction')
        if not contact.can_be_pressed:
            raise ValueError('law: "jenkins" holds mu F_N of a given force; give a normal_force')

    def law(self, contact: ContactModel) -> Law:
        """A contact that nothing presses has no stiffness."""
        t1, t2 = contact.springs
        both = (t1, t1 if t2 is None else t2)
        slider = 1 if self.slides_along == "t1" else 2
        numbers = (value(contact.normal_0), both[slider - 1], both[2 - slider])
        n, along, across = (k if contact.pressed else jnp.zeros_like(k) for k in numbers)
        return Jenkins(n, along, across, value(contact.mu * contact.pressed), slider)

    def places(self, width: float, height: float) -> tuple[np.ndarray, np.ndarray]:
        return four_places(width, height)

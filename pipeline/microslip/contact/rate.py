"""Friction that the velocity alone decides, smoothed by an arctan (Sextro Eqs. (4.1-16) to (4.1-23)).

No tangential spring stands between the body and its neighbour: what the contact yields tangentially is part of the
body. Where a sticking contact would stand still it creeps, the slower the larger the slope.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple

import jax.numpy as jnp

from ..reduced.compliance import BULK_AND_SURFACE
from ..settings.numbers import NotNegative, Positive
from .friction import Friction, Scattered, creep, halved
from .law import Array, Law, Scalar, Step, norm, number, settings, static, value
from .normal import Normal
from .point import OnNormal, OwnNormal

if TYPE_CHECKING:
    from .composed import ContactModel

SLIDES, STICKS = 0.99, 0.9
"""Shares of its largest value at which the smoothing begins to count as sliding, at 64 / k_S, and from which on it is
the creep of a contact that sticks again, 6.3 / k_S. Near its limit a sticking contact creeps as fast as the second."""


class RateState(NamedTuple):
    """State of n points: u_t (2, n) m and its rate (2, n) m/s, path slid (2, n) m, time (n,) s, and 1.0 where they
    slide (n,)."""

    tangential: Array
    rate: Array
    slipped: Array
    time: Array
    slides: Array


@settings
class RateContact(OnNormal):
    """Point contact whose friction is mu(|v|) F_N 2/pi arctan(k_S |v|) along -v.

    Attributes:
        normal: normal law. friction: characteristic. slope: k_S, s/m. damping: beta of the normal spring (4.1-16), s;
            the normal force is cut at zero. includes: whose compliance the stiffness counts, one of `series.INCLUDES`.
    """

    normal: Normal
    friction: Friction
    slope: Array = number(gt=0)
    damping: Array = number(ge=0)
    includes: str = static(default=BULK_AND_SURFACE)
    brakes: ClassVar[bool] = True

    @property
    def smooth(self) -> bool:  # type: ignore[override]
        return not isinstance(self.friction, Scattered)

    @property
    def remembers(self) -> int | None:
        return 0

    def rates(self, u: Array, v: Array, x: Array, time: Scalar, lag: float) -> tuple[Array, Array]:
        pressed, now = self._pressed(u[:, 0], v[:, 0]), jnp.asarray(time)
        return jnp.concatenate([pressed[None], self._drag(norm(v.T[1:]), pressed, now) * v.T[1:]]).T, x

    def init(self, n: int) -> RateState:
        still = jnp.zeros((2, n))
        return RateState(still, still, still, jnp.zeros(n), jnp.zeros(n))

    def step(self, u: Array, v: Array, dt: Scalar, state: RateState) -> tuple[Array, RateState]:
        time, tangential, speed = state.time + dt, u.T[1:], norm(v.T[1:])
        pressed = self._pressed(u[:, 0], v[:, 0])
        force = self._drag(speed, pressed, time) * v.T[1:]
        share = jnp.where(state.slides > 0.5, STICKS, SLIDES)
        passes = 0.5 * norm(state.rate + v.T[1:])  # a stiff creep may swing about it from step to step
        slides = (pressed > 0) & (self.slope * passes > jnp.tan(0.5 * jnp.pi * share))
        slipped = state.slipped + jnp.where(slides, tangential - state.tangential, 0.0)
        after = RateState(tangential, v.T[1:], slipped, time, slides.astype(float))
        return jnp.concatenate([pressed[None], force]).T, after

    def slowed(self, u: Array, v: Array, dt: Scalar, state: RateState, yielding: Array) -> Array:
        pressed, trial, time = self._pressed(u[:, 0], v[:, 0]), v.T[1:], state.time + dt
        fastest = norm(trial)

        def excess(speed: Array) -> Array:
            return speed * (1 + yielding * self._drag(speed, pressed, time)) - fastest

        speed = halved(excess, fastest, 40.0, 50)  # to 1e-13 of it
        share = 1 / (1 + yielding * self._drag(speed, pressed, time))
        return jnp.concatenate([v.T[:1], share * trial]).T

    def stored(self, u: Array, state: RateState) -> Array:
        return self.normal.stored(u[:, 0])

    def overlap(self, u: Array) -> Array:
        return u[:, 0] - self.normal.touches()

    def lost(self, step: Step) -> Array:
        rubbed = 0.5 * jnp.sum((step.force_before + step.force)[:, 1:] * step.moved[:, 1:], axis=1)
        return rubbed + (step.force[:, 0] - self.normal.force(step.u[:, 0])) * step.moved[:, 0]

    def _drag(self, speed: Array, pressed: Array, time: Array) -> Array:
        """(n,) friction over the speed, N s/m."""
        return pressed * self.friction.coefficient(speed, pressed, time) * creep(speed, self.slope)


class OfRate(OwnNormal):
    """Friction by the velocity alone, smoothed (4.1-16 to 4.1-23): no tangential spring, creep where it sticks."""

    kind: Literal["rate"]
    slope: Positive
    """[s/m] k_S of the smoothed friction (3.7-43)"""
    damping: NotNegative = 0.0
    """[s] beta: force per rate of the springs (3.7-18)"""

    def law(self, contact: ContactModel) -> Law:
        return RateContact(contact.normal, contact.sliding, value(self.slope), value(self.damping))

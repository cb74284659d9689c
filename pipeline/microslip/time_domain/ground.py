"""The other side of a contact moves: steadily, and as wavy as it is (Sextro Eqs. (4.1-17) to (4.1-20), (4.3-1)).

With the point of the body at x along the ground's direction e, the ground at V t, and u_r = x - V t, the law meets

    u_n + y_R(u_r),  u_t - V t e,   y_R = sum of y_A sin(2 pi u_r / lambda + phase),

where x is the place of the body itself, not that of its rest. A wave that a body meets under the angle arctan y_R'
pushes it back along e as well, by F_n y_R': with it, what bodies and ground give is what the contact takes; without it
(as the book has it) the wave itself gives and takes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.law import Array, Law, Step, settings, static, value
from ..system.ground import Ground

if TYPE_CHECKING:
    from ..system.assembly import Contact

FINEST = 8
"""Steps at least in which a wave passes, where the ground alone moves."""


class OnGround(NamedTuple):
    """State of a contact on moving ground: of its law; s since the start, negative before it."""

    own: Any
    time: Array


@settings
class Moving(Law):
    """A law on ground that moves: time counts from its first step, which takes none.

    Attributes:
        law: of the contact. velocity: V, m/s. along: (2, 1) e along t1 and t2; of ground that turns (n,) and (2, n).
            place: (n,) of the points along e, m. amplitude, number, phase: (w, 1) y_A in m, 2 pi / lambda in 1/m, and
            rad, of the waves. pushes: whether their slope does.
    """

    law: Law
    velocity: Array
    along: Array
    place: Array
    amplitude: Array
    number: Array
    phase: Array
    pushes: bool = static(default=True)
    wavy: bool = static(default=True)

    @property
    def brakes(self) -> bool:  # type: ignore[override]
        return self.law.brakes

    def init(self, n: int) -> OnGround:
        return OnGround(self.law.init(n), jnp.full(n, -1.0))

    def step(self, u: Array, v: Array, dt: Array | float, state: OnGround) -> tuple[Array, OnGround]:
        time = self._after(state, dt)
        force, own = self.law.step(self._met(u, time), self._meeting(u, v, time), dt, state.own)
        return self._felt(force, u, time), OnGround(own, time)

    def slowed(self, u: Array, v: Array, dt: Array | float, state: OnGround, yielding: Array) -> Array:
        time = self._after(state, dt)
        met, meeting = self._met(u, time), self._meeting(u, v, time)
        push = self._felt(self.law.step(met, meeting, dt, state.own)[0] * jnp.array([1.0, 0.0, 0.0]), u, time)
        trial = meeting - yielding[:, None] * push * jnp.array([0.0, 1.0, 1.0])
        velocity = self.law.slowed(met, trial, dt, state.own, yielding)
        return v.at[:, 1:].set(velocity[:, 1:] + (self.velocity * self.along).T)

    def passed(
        self, before: Array, u: Array, then: Array, force: Array, dt: Array | float, state: OnGround
    ) -> tuple[Array, Array, Array, Array, tuple[Array, Array]]:
        """What set-valued points (n, 3) meet that come from `before` to u in a step and go to `then` in the next: both
        ways over the ground, how deep they are (n,), the force (n, 3) before as the law has it, and (n, 2) the slopes
        under them that turn their way, and their force."""
        time = self._after(state, dt)
        last = jnp.where(state.time < 0, time, state.time)
        ways = self._over(before, u, last, time), self._over(u, then, time, time + dt)
        slope = (self._slope(u, time) * self.along).T
        slopes = slope, slope if self.pushes else 0 * slope
        return *ways, u[:, 0] + self._height(u, time), self._unfelt(force, before, last), slopes

    def slid(self, force: Array, way: Array, u: Array, dt: Array | float, state: OnGround) -> tuple[Array, OnGround]:
        """(n, 3) N on the body by that of a set-valued law, and the state after a way (n, 2) that was slid."""
        time = self._after(state, dt)
        return self._felt(force, u, time), OnGround(state.own + way.T, time)

    def limit(self, force: Array, state: OnGround) -> Array:
        return self.law.limit(force, state.own)

    def slip(self, state: OnGround) -> Array:
        return self.law.slip(state.own)

    def stored(self, u: Array, state: OnGround) -> Array:
        return self.law.stored(self._met(u, state.time), state.own)

    def overlap(self, u: Array) -> Array:
        return super().overlap(u) if self.wavy else self.law.overlap(u)

    def lost(self, step: Step) -> Array:
        return self.law.lost(self._own(step))

    def given(self, step: Step) -> Array:
        own = self._own(step)
        taken = jnp.sum((own.force_before + own.force) * own.moved, axis=1)
        return 0.5 * (taken - jnp.sum((step.force_before + step.force) * step.moved, axis=1))

    def _own(self, step: Step) -> Step:
        """A step as the law met it."""
        start, before, after = step.u - step.moved, step.before.time, step.after.time
        met = self._met(step.u, after)
        first, last = self._unfelt(step.force_before, start, before), self._unfelt(step.force, step.u, after)
        return Step(met, met - self._met(start, before), step.dt, first, last, step.before.own, step.after.own)

    def _after(self, state: OnGround, dt: Array | float) -> Array:
        return jnp.where(state.time < 0, 0.0, state.time + dt)

    def _at(self, u: Array, time: Array) -> Array:
        """(n,) u_r, m."""
        return self.place + jnp.sum(self.along * u.T[1:], axis=0) - self.velocity * time

    def _height(self, u: Array, time: Array) -> Array:
        return jnp.sum(self.amplitude * jnp.sin(self.number * self._at(u, time) + self.phase), axis=0)

    def _slope(self, u: Array, time: Array) -> Array:
        waves = self.amplitude * self.number * jnp.cos(self.number * self._at(u, time) + self.phase)
        return jnp.sum(waves, axis=0)

    def _met(self, u: Array, time: Array) -> Array:
        return jnp.concatenate([(u.T[0] + self._height(u, time))[None], u.T[1:] - self.velocity * time * self.along]).T

    def _over(self, start: Array, end: Array, begin: Array, until: Array) -> Array:
        """(n, 3) way over the ground from start to end; of differences, lest a long way of the ground costs digits."""
        rise = self._height(end, until) - self._height(start, begin)
        along = (self.velocity * (until - begin) * self.along).T
        return end - start + jnp.concatenate([rise[:, None], -along], axis=1)

    def _meeting(self, u: Array, v: Array, time: Array) -> Array:
        passing = jnp.sum(self.along * v.T[1:], axis=0) - self.velocity
        normal = v.T[0] + self._slope(u, time) * passing
        return jnp.concatenate([normal[None], v.T[1:] - self.velocity * self.along]).T

    def _felt(self, force: Array, u: Array, time: Array, sign: float = 1.0) -> Array:
        if not self.pushes:
            return force
        push = force[:, 0] * self._slope(u, time) * self.along
        return force.at[:, 1:].add(sign * push.T)

    def _unfelt(self, force: Array, u: Array, time: Array) -> Array:
        return self._felt(force, u, time, -1.0)


def moving(law: Law, ground: Ground, points: np.ndarray) -> Moving:
    """A law of points (n, 2), m along t1 and t2, on a ground."""
    e = np.array([np.cos(ground.angle), np.sin(ground.angle)])
    amplitude, length, phase = np.array(ground.waves or [(0.0, 1.0, 0.0)]).T[:, :, None]
    waves = jax.device_put(amplitude), jax.device_put(2 * np.pi / length), jax.device_put(phase)
    along, place, speed = jax.device_put(e[:, None]), jax.device_put(points @ e), value(ground.velocity)
    if ground.spin:
        V = ground.velocities(points).T
        fastest = np.linalg.norm(V, axis=0)
        along, speed = jax.device_put(V / np.where(fastest > 0, fastest, 1.0)), jax.device_put(fastest)
    return Moving(law, speed, along, place, *waves, ground.pushes, bool(ground.waves))


def steps_of_waves(contacts: Iterable[Contact], period: float) -> int:
    """Steps in a period (s) by which the shortest wave passes in `FINEST` of them."""
    grounds = [c.ground for c in contacts if c.ground]
    passing = [abs(g.velocity) / length for g in grounds for _, length, _ in g.waves]
    return math.ceil(FINEST * period * max(passing, default=0.0))

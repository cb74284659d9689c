"""Contact laws with the mistakes found in other programs: the contract tests must catch each of them."""

import dataclasses
from typing import Any

import jax.numpy as jnp

from microslip.contact.examples import Example
from microslip.contact.friction import Coulomb
from microslip.contact.heights import Polynomial
from microslip.contact.law import Array, settings, value
from microslip.contact.normal import Penalty, Rough
from microslip.contact.point import PointContact, PointState

COULOMB = Coulomb(value(0.3))
STIFFNESS = jnp.asarray(0.9e8)
ROUGH = Rough(value(2.4e8), value(12e-6), Polynomial())


@settings
class Printed(PointContact):
    """Stiffness times stretch with a stiffness that follows the contact area (Sextro Eqs. (3.3-39), (3.7-21))."""

    def step(self, u: Array, v: Array, dt: Array | float, state: PointState) -> tuple[Array, PointState]:
        grown = jnp.where(state.share > 0, self.normal.share(u[:, 0]) / jnp.where(state.share > 0, state.share, 1.0), 0)
        back = jnp.maximum(grown, 1.0)  # area that comes into contact is stretched at once, as if it had always been
        return super().step(u, v, dt, state._replace(elastic=back * state.elastic))


@settings
class Box(PointContact):
    """The limit of friction is applied to each tangential direction on its own."""

    def step(self, u: Array, v: Array, dt: Array | float, state: PointState) -> tuple[Array, PointState]:
        (first, after_1), (second, after_2) = (
            super(Box, self).step(u.at[:, 3 - i].set(0.0), v, dt, self._only(i, state)) for i in (1, 2)
        )
        force = first.at[:, 2].set(second[:, 2])
        both = {
            key: jnp.stack([getattr(after_1, key)[0], getattr(after_2, key)[1]])
            for key in ("tangential", "elastic", "slipped")
        }
        return force, after_1._replace(**both)

    def _only(self, i: int, state: PointState) -> PointState:
        keep = jnp.eye(2)[i - 1][:, None]
        return state._replace(tangential=keep * state.tangential, elastic=keep * state.elastic)


@settings
class Offset(Penalty):
    """A normal force that is there at once where the surfaces meet, and jumps to zero where they part."""

    def force(self, u: Array) -> Array:
        return jnp.where(u > 0, self.stiffness_0 * (u + 4e-6), 0.0)

    def stored(self, u: Array) -> Array:
        return self.stiffness_0 * jnp.maximum(u, 0.0) * (0.5 * u + 4e-6)


@settings
class Prestressed(PointContact):
    """Friction is limited by the normal force at the beginning, not by that of the moment."""

    preload: Array = dataclasses.field(default_factory=lambda: jnp.asarray(0.0))

    def step(self, u: Array, v: Array, dt: Array | float, state: PointState) -> tuple[Array, PointState]:
        force, after = super().step(u, v, dt, state)
        held = self.friction.mu * self.preload / (self.friction.mu * force[:, 0] + 1e-300)
        kept = jnp.minimum(held, 1.0)
        return force.at[:, 1:].multiply(kept[:, None]), after._replace(elastic=kept * after.elastic)


PRINTED = Example(Printed(ROUGH, COULOMB, STIFFNESS), 1.2e-5, 8e-6)
BOX = Example(Box(ROUGH, COULOMB, STIFFNESS), 1.2e-5, 8e-6)
JUMP = Example(PointContact(Offset(value(2.4e8)), COULOMB, STIFFNESS), 1e-5, 1e-5)
PRESTRESSED = Example(Prestressed(ROUGH, COULOMB, STIFFNESS), 1.2e-5, 8e-6)


@settings
class Lagging(PointContact):
    """Pressed by the mean of many steps: its state holds more than `recalled` says."""

    def init(self, n: int) -> tuple[PointState, Array]:
        return super().init(n), jnp.zeros(n)

    def step(self, u: Array, v: Array, dt: Array | float, state: tuple[PointState, Array]) -> tuple[Array, Any]:
        own, before = state
        mean = 0.9 * before + 0.1 * u[:, 0]
        force, after = super().step(u.at[:, 0].set(mean), v, dt, own)
        return force, (after, mean)

    def memory(self, force: Array, state: tuple[PointState, Array]) -> Array:
        return state[0].elastic

    def recalled(self, state: tuple[PointState, Array], memory: Array) -> Any:
        return state[0]._replace(elastic=memory), state[1]


LAGGING = Example(Lagging(ROUGH, COULOMB, STIFFNESS), 1.2e-5, 8e-6)

"""Unilateral contact and Coulomb friction without a stiffness of their own: inclusions that only motions in time solve.

    gap >= 0,  F_N >= 0,  gap F_N = 0;   F_T in mu F_N Sgn(v_T)

No smoothing parameter stands for what is rigid (the limit k_S -> infinity of Sextro Eq. (4.1-23)).
"""

from __future__ import annotations

import jax.numpy as jnp

from ..errors import UserError
from .friction import Friction
from .law import Array, Law, Step, number, settings
from .normal import Normal

REFUSED = 'law "set-valued" has no stiffness: only a motion in time can take it (`microslip orbit`, `ms.integrate`)'


@settings
class SetValued(Law):
    """Points that are rigid where they touch, and where they stick.

    Attributes:
        friction: characteristic. restitution: e of an impact between masses, 0 to 1; bodies that yield at once meet no
            mass, and what comes back from them is theirs. gap: m, at u = 0. normal: a normal law that presses in
            place of the rigid one, None: rigid.
    """

    friction: Friction
    restitution: Array = number(ge=0, le=1)
    gap: Array = number()
    normal: Normal | None = None

    def init(self, n: int) -> Array:
        return jnp.zeros((2, n))

    def step(self, u: Array, v: Array, dt: Array | float, state: Array) -> tuple[Array, Array]:
        raise UserError(REFUSED)

    def limit(self, force: Array, state: Array) -> Array:
        return self.friction.highest(force[:, 0]) * force[:, 0]

    def slip(self, state: Array) -> Array:
        return state.T

    def stored(self, u: Array, state: Array) -> Array:
        return jnp.zeros(u.shape[0]) if self.normal is None else self.normal.stored(u[:, 0])

    def overlap(self, u: Array) -> Array:
        return u[:, 0] - (self.gap if self.normal is None else self.normal.touches())

    def lost(self, step: Step) -> Array:
        return jnp.sum(step.force[:, 1:] * step.moved[:, 1:], axis=1)

"""Unilateral contact and Coulomb friction without a stiffness of their own: inclusions that only motions in time solve.

    gap >= 0,  F_N >= 0,  gap F_N = 0;   F_T in mu F_N Sgn(v_T)

No smoothing parameter stands for what is rigid (the limit k_S -> infinity of Sextro Eq. (4.1-23)).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import jax.numpy as jnp
import numpy as np
from pydantic import Field

from ..errors import UserError
from ..settings.numbers import Number
from .friction import Friction
from .kinds import LawKind
from .law import Array, Law, Step, number, settings, value
from .normal import Normal

if TYPE_CHECKING:
    from .composed import ContactModel
    from .settings import ContactLaw

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

    def scaled(self, share: Array) -> SetValued | None:
        return self if self.normal is None else None

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


class OfSetValued(LawKind):
    """Rigid where it touches and where it sticks, for motions in time; `restitution` of an impact between masses. Its
    points are the corners of the patch if not given."""

    kind: Literal["set-valued"]
    restitution: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """e of an impact between masses"""

    rigid: ClassVar[bool] = True

    def fits(self, contact: ContactLaw) -> None:
        for key in ("stiffness", "normal_stiffness", "tangential_stiffness", "roughness"):
            if getattr(contact, key) is not None:
                raise ValueError(f'law: "set-valued" is rigid; leave {key} out')
        if contact.heated or (contact.friction is not None and contact.friction.deviation):
            raise ValueError(
                'friction: of law = "set-valued" follows the speed alone, no heat and no chance; write a number'
            )

    def law(self, contact: ContactModel) -> Law:
        return SetValued(contact.sliding, value(self.restitution), value(0.0))

    def places(self, width: float, height: float) -> tuple[np.ndarray, np.ndarray] | None:
        if not width or not height:
            return None
        corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        return 0.5 * corners * np.array([width, height]), np.full(4, 0.25 * width * height)

"""One law of each kind, with numbers of a shroud contact: the contract tests run over all of them."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp

from .friction import Coulomb
from .heights import Polynomial
from .law import Law
from .normal import Penalty, Rough
from .point import PointContact


@dataclass(frozen=True)
class Example:
    """A law with scales for trying it.

    Attributes:
        law: for any number of points. normal, tangential: displacements in m at which it shows what it does.
        period: of a cycle, s. isotropic: whether turning the tangents turns the force. gap: m, beyond u_n = 0, at
            which the contact is open for certain.
    """

    law: Law
    normal: float
    tangential: float
    period: float = 0.01
    isotropic: bool = True
    gap: float = 0.0


def _value(number: float) -> jnp.ndarray:
    return jnp.asarray(number, dtype=float)


_ROUGH = Rough(_value(2.4e8), _value(12e-6), Polynomial())
_COULOMB = Coulomb(_value(0.3))
_C = _value(0.9e8)

EXAMPLES: dict[str, Example] = {
    "smooth point": Example(PointContact(Penalty(_value(2.4e8)), _COULOMB, _C), 1e-5, 1e-5),
    "rough point": Example(PointContact(_ROUGH, _COULOMB, _C), 1.2e-5, 8e-6),
    "rough point, two stiffnesses": Example(
        PointContact(_ROUGH, _COULOMB, _C, _value(0.4e8)), 1.2e-5, 8e-6, isotropic=False
    ),
    "rough point, damped": Example(PointContact(_ROUGH, _COULOMB, _C, None, _value(2e-4)), 1.2e-5, 8e-6),
}

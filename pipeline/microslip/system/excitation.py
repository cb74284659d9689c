"""What drives an assembly: engine orders, gas loads, magnets and other patterns that stand in space, steady loads.

A pattern p(theta) = P_0 + Re sum_e P_e exp(i e theta) that stands in space is met by sector j of a rotor that turns in
the + direction at theta = j 2 pi / N + Omega t. So the engine order e acts with the frequency e Omega / 2 pi and the
phase e j 2 pi / N on sector j (docs/cyclic.md). On a rotor that turns the other way theta = j 2 pi / N - Omega t, the
amplitude becomes conj(P_e) and the phase falls from sector to sector.

Several orders together are multiples of their greatest common divisor, the base order: the order e is the harmonic
e / base of the motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..data import Array, ComplexArray
from ..errors import UserError
from ..ring.expansion import BACKWARD, FORWARD, STANDING
from .assembly import Load
from .component import Ring

Turning = Literal[1, -1]
"""Sense of the rotor's rotation: 1 carries sector j to where sector j + 1 stood, -1 the other way."""


# --- engine orders -------------------------------------------------------------------------------------------------


def base_order(orders: Sequence[int]) -> int:
    """Greatest common divisor of engine orders, whatever their signs; 0 counts for nothing.

    Raises:
        UserError: none that is not 0.
    """
    base = math.gcd(*orders)
    if not base:
        raise UserError("engine orders: none is given but 0, which is steady; name one that vibrates")
    return base


def harmonic_of(order: int, base: int | Ring, turning: Turning = 1) -> int:
    """Which harmonic an engine order is.

    Args:
        base: base order, or the ring that was made of the orders.

    Raises:
        UserError: an order that is no multiple of the base, or runs the other way round than the ring's wave.
    """
    divisor = abs(base.order) if isinstance(base, Ring) else base
    if order % divisor:
        raise UserError(f"engine order {order}: is no multiple of the base order {divisor}; give the ring both of them")
    h = abs(order) // divisor
    if isinstance(base, Ring) and (base.index(h) - turning * order) % base.blades:
        raise UserError(f"engine order {order}: runs the other way round than the base order {base.order} of the ring")
    return h


def direction(index: int, blades: int, turning: Turning = 1) -> tuple[int, str]:
    """Nodal diameter of a wave and how it runs on the rotor: ``backward`` is against the rotation.

    Args:
        index: see `Ring.index`.
    """
    k = index % blades
    if k == 0 or 2 * k == blades:
        return k, STANDING
    backward = (2 * k < blades) == (turning > 0)
    return min(k, blades - k), BACKWARD if backward else FORWARD


def index_of(nodal_diameter: int, sense: str, blades: int, turning: Turning = 1) -> int:
    """Index of the wave of a nodal diameter that runs ``forward`` (with the rotation) or ``backward``.

    Raises:
        UserError: a nodal diameter above N/2.
    """
    if not 0 <= 2 * nodal_diameter <= blades:
        raise UserError(f"nodal diameter {nodal_diameter}: {blades} blades have 0 to {blades // 2}; correct it")
    return nodal_diameter if (sense == BACKWARD) == (turning > 0) else (-nodal_diameter) % blades


# --- patterns that stand in space ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Pattern:
    """A force over the circumference, at rest in space.

    Attributes:
        amplitudes: (E + 1,) P_0 (real), P_1, ... P_E, 0-peak, in the unit of what is applied.
    """

    amplitudes: ComplexArray

    def at(self, theta: Array) -> Array:
        """Force at angles theta (rad), any shape."""
        e = np.arange(len(self.amplitudes))
        return (np.exp(1j * np.multiply.outer(theta, e)) @ self.amplitudes).real

    def orders(self, share: float = 1e-9) -> tuple[int, ...]:
        """Engine orders above 0 whose amplitude is more than a share of the largest one."""
        size = np.abs(self.amplitudes[1:])
        return tuple(int(e) + 1 for e in np.flatnonzero(size > share * size.max(initial=0.0)))


def _rectangular(x: Array, width: float) -> Array:
    return width * np.sinc(x / np.pi)


def _cosine(x: Array, width: float) -> Array:
    s = np.sinc
    return 0.5 * width * (s(x / np.pi) + 0.5 * (s(x / np.pi + 1) + s(x / np.pi - 1)))


PULSES = {"cosine": _cosine, "rectangular": _rectangular}
"""Integral of a pulse of height 1 times exp(-i e theta) over theta, for x = e width / 2: cos^2(pi theta / width), and
a constant, where |theta| < width / 2."""


def magnets(
    angles: Array, forces: Array | float, width: float, highest: int, pulse: Literal["cosine", "rectangular"] = "cosine"
) -> Pattern:
    """Fourier coefficients of n exciters that stand around the rotor.

    P_e = (c(e) / pi) sum_m F_m exp(-i e theta_m), c(e) the integral of the pulse times exp(-i e theta). n equal ones at
    equal distances leave the orders n, 2 n, 3 n, ... only.

    Args:
        angles: (n,) where they stand, rad. forces: (n,) peak of each, or one for all; N. width: over which each is
            felt, rad. highest: engine order.

    Raises:
        UserError: a width that is not between 0 and 2 pi.
    """
    if not 0 < width <= 2 * np.pi:
        raise UserError(f"magnets: width: {width:g} rad must be above 0 and at most a whole turn; correct it")
    e, theta = np.arange(highest + 1), np.asarray(angles, dtype=float)
    F = np.broadcast_to(np.asarray(forces, dtype=float), theta.shape)
    P = PULSES[pulse](0.5 * e * width, width) / np.pi * (np.exp(-1j * np.outer(e, theta)) @ F)
    P[0] *= 0.5
    return Pattern(_cleared(P))


def _cleared(P: ComplexArray) -> ComplexArray:
    """Sums that cancel leave rounding behind: it is no engine order."""
    return np.where(np.abs(P) > 1e-12 * np.abs(P).max(initial=0.0), P, 0.0)


# --- loads ------------------------------------------------------------------------------------------------------------


def pattern_loads(
    component: str, row: str, pattern: Pattern, base: int | Ring, place: float = 0.0, turning: Turning = 1
) -> tuple[Load, ...]:
    """The engine orders of a pattern on a row of a component, its mean as a steady load.

    Args:
        place: angle at which the loaded spot of the first sector stands at t = 0, rad.
    """
    found = []
    for e in pattern.orders():
        P = complex(pattern.amplitudes[e] * np.exp(1j * e * place))
        found.append(Load(component, row, P if turning > 0 else P.conjugate(), harmonic_of(e, base, turning)))
    mean = float(pattern.amplitudes[0].real)
    return (*found, Load(component, row, mean, 0)) if mean else tuple(found)


def unheard(loads: Sequence[Load], harmonics: int) -> list[str]:
    """A sentence for each load whose harmonic is above those that are balanced."""
    return [
        f"The load '{x.row}' on '{x.component}' is harmonic {x.harmonic} of the base frequency, but only {harmonics} "
        f"are balanced: raise harmonics to {x.harmonic} or more, or leave it out."
        for x in loads
        if x.harmonic > harmonics
    ]

"""What a half-space or a layer is made of, and the moduli of two of them in contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..data import Array
from ..errors import UserError


@dataclass(frozen=True)
class Solid:
    """Isotropic linear elasticity.

    Attributes:
        young: E, Pa; ``inf`` for a rigid body. poisson: nu. given_shear: G, Pa, where it is not E / 2 (1 + nu) but a
            handbook's rounded value (Sextro 5.3 uses 8.1e10 Pa beside E = 2.1e11 Pa); None: E / 2 (1 + nu).

    Raises:
        UserError: E not positive, nu outside -1 < nu <= 0.5, G not positive.
    """

    young: float
    poisson: float
    given_shear: float | None = None

    def __post_init__(self) -> None:
        if not self.young > 0:
            raise UserError(f"{self.young:g} Pa is no modulus; it must be greater than 0", "young")
        if not -1 < self.poisson <= 0.5:
            raise UserError(f"{self.poisson:g} is impossible; it lies between -1 and 0.5, 0.3 say", "poisson")
        if self.given_shear is not None and not self.given_shear > 0:
            raise UserError(f"{self.given_shear:g} Pa is no modulus; it must be greater than 0", "shear")

    @property
    def shear(self) -> float:
        """G, Pa."""
        return self.young / (2 * (1 + self.poisson)) if self.given_shear is None else self.given_shear


def pressing(force: ArrayLike) -> Array:
    """Normal forces, N, any shape.

    Raises:
        UserError: a negative one.
    """
    F = np.asarray(force, dtype=float)
    if not (F >= 0).all():
        raise UserError(f"{F.min():g} N; a contact is pressed, so the force must not be negative", "force")
    return F


def bisected(
    below: Callable[[Array], Array], low: ArrayLike, high: ArrayLike, halvings: int
) -> tuple[Array, Array]:
    """Ends of intervals (numbers or arrays) that are halved so often: `below` holds at the lower one alone."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        short = below(middle)
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return low, high


def refuse_not_positive(**given: float) -> None:
    """Raises `UserError` of a number that is 0, negative, infinite or none."""
    for name, value in given.items():
        if not 0 < value < np.inf:
            raise UserError(f"{name}: {value:g}; it must be greater than 0")


def normal_modulus(first: Solid, second: Solid) -> float:
    """E* (Pa) of two half-spaces: 1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2 (Johnson, Contact Mechanics, 4.2).

    Raises:
        UserError: both are rigid.
    """
    compliance = sum((1 - s.poisson**2) / s.young for s in (first, second))
    return 1 / _elastic(compliance)


def tangential_modulus(first: Solid, second: Solid) -> float:
    """G* (Pa): 1/G* = (2 - nu_1)/(4 G_1) + (2 - nu_2)/(4 G_2); k_T = 2 G* a of a circle of radius a (Johnson 7.2).

    Raises:
        UserError: both are rigid.
    """
    compliance = sum((2 - s.poisson) / (4 * s.shear) for s in (first, second))
    return 1 / _elastic(compliance)


def mismatch(first: Solid, second: Solid) -> float:
    """Dundurs' beta: how far pressing makes the two surfaces slide on each other, -0.5 to 0.5; 0 for like bodies.

    beta = ((1 - 2 nu_1)/G_1 - (1 - 2 nu_2)/G_2) / (2 ((1 - nu_1)/G_1 + (1 - nu_2)/G_2)) (Johnson 5.1). Hertz' and
    Mindlin's theories leave this coupling out. How much that is: a flat round stamp that sticks is stiffer than a
    smooth one by ln((1 + beta)/(1 - beta))/(2 beta) - 1, about beta^2/3 (Spence 1968): 1.4 % for beta = 0.2.

    Raises:
        UserError: both are rigid.
    """
    above = (1 - 2 * first.poisson) / first.shear - (1 - 2 * second.poisson) / second.shear
    return 0.5 * above / _elastic((1 - first.poisson) / first.shear + (1 - second.poisson) / second.shear)


def _elastic(compliance: float) -> float:
    if not compliance > 0 or not np.isfinite(compliance):
        raise UserError("both bodies are rigid, so their contact has no stiffness; give one of them a modulus", "young")
    return float(compliance)


def mean_inverse_distance(a: float, b: float) -> float:
    """Mean of 1/|x - y| (1/m) over all pairs of points of a rectangle with sides a and b (m).

    (2/(a b)^2) (a^2 b asinh(b/a) + a b^2 asinh(a/b) + (a^3 + b^3 - (a^2 + b^2)^(3/2))/3).
    """
    ends = (a**3 + b**3 - (a * a + b * b) ** 1.5) / 3
    return float(2 * (a * a * b * np.arcsinh(b / a) + a * b * b * np.arcsinh(a / b) + ends) / (a * b) ** 2)

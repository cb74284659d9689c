"""Hertz' contact of two curved bodies, round or elliptical, with the tangential stiffness of Mindlin and Deresiewicz.

Near the first point of contact the gap is A x^2 + B y^2: A and B are HALF the relative curvatures (Sextro's (6.4-6),
(6.4-7) lack the factor, his (6.4-17) needs it). Exact within the half-space: the integrals are Carlson's, which do not
cancel for nearly round contacts. Johnson, Contact Mechanics, 4.2 and 7.2; Hill, Nowell and Sackfield, 2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.special import elliprd, elliprf

from ..data import Array
from ..errors import UserError
from .solids import Solid, doubles, normal_modulus, pressing

SLENDEREST = 1e-6
"""Smallest ratio of half curvatures: such an ellipse is 20 000 times longer than wide, no longer a point contact."""


def ellipse_integrals(ratio: ArrayLike) -> tuple[Array, Array, Array]:
    """K, D, B of Sextro Eqs. (6.4-11), (6.4-12), (6.4-15) for axis ratios g = b/a <= 1 (e^2 = 1 - g^2).

    K the complete elliptic integral, D = (K - E)/e^2, B = K - D. For g = 1: pi/2, pi/4, pi/4.
    """
    m = doubles(ratio) ** 2
    return elliprf(0, m, 1), elliprd(0, m, 1) / 3, m * elliprd(0, 1, m) / 3


def axis_ratio(curvature_ratio: ArrayLike) -> Array:
    """b/a of contact ellipses from A/B <= 1: the root of g^2 = (A/B) B(e)/D(e), Sextro Eq. (6.4-9).

    The slope of log(A/B) over log(g) lies between 3/2 and 2, so each step leaves a seventh of the error, which a spline
    has brought to 1e-9 before.
    """
    wanted = np.log(doubles(curvature_ratio))
    return (
        _closer(_nearly()(wanted), wanted, 4)
        if np.min(wanted, initial=0) > FLATTEST
        else _closer(wanted / 1.5, wanted, 22)
    )


FLATTEST = -20.0
"""log(A/B) down to which there is a spline."""


@cache
def _nearly() -> CubicSpline:
    """log(g) over log(A/B)."""
    wanted = np.linspace(FLATTEST, 0, 401)
    return CubicSpline(wanted, np.log(_closer(wanted / 1.5, wanted, 22)))


def _closer(log_g: Array, wanted: Array, steps: int) -> Array:
    for _ in range(steps):
        _, D, B = ellipse_integrals(np.exp(log_g))
        log_g = log_g - (2 * log_g + np.log(D / B) - wanted) / 1.75
    return np.exp(log_g)


def half_curvatures(
    first: tuple[float, float], second: tuple[float, float] = (np.inf, np.inf), angle: float = 0.0
) -> tuple[float, float, float]:  # fmt: skip
    """(A, B, direction) of two bodies with principal radii, A <= B (Johnson 4.1).

    Args:
        first, second: principal radii along each body's own axes x and y, m: positive convex, negative hollow,
            ``inf`` flat. angle: of the second body's x axis from the first one's, rad.

    Returns:
        A, B in 1/m; direction of A's axis, the long one of the ellipse, from the first body's x axis, rad, in
        (-pi/2, pi/2].

    Raises:
        UserError: a radius of 0, or bodies that conform, so that they do not touch in a point.
    """
    if not all(abs(r) > 0 for r in (*first, *second)):
        raise UserError("a radius of curvature is 0; give inf for a flat side", "radii")
    H = _curvature(first, 0.0) + _curvature(second, angle)
    values, axes = np.linalg.eigh(H)
    if not values[0] > SLENDEREST * values[1]:
        raise UserError(
            f"radii: the half relative curvatures are {values[0]:.4g} and {values[1]:.4g} 1/m, so the bodies do not "
            "touch in a point; both must be positive (a cylinder along a flat or hollow side is a line contact)"
        )
    x, y = axes[:, 0]
    direction = 0.0 if values[1] - values[0] < 1e-14 * values[1] else float(np.arctan(y / x)) if x else 0.5 * np.pi
    return float(values[0]), float(values[1]), direction


def _curvature(radii: tuple[float, float], angle: float) -> Array:
    """(2, 2) quadratic form of the gap that one body makes."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s], [s, c]])
    return R @ np.diag([0.5 / radii[0], 0.5 / radii[1]]) @ R.T


@dataclass(frozen=True)
class Hertz:
    """Two curved bodies pressed together.

    Attributes:
        first, second: their materials. A, B: half relative curvatures along x and y, 1/m (`half_curvatures`); either
            may be the larger one. ratio: b/a <= 1 of the ellipse, from them.

    Raises:
        UserError: curvatures that are not positive, two rigid bodies.
    """

    first: Solid
    second: Solid
    A: float
    B: float
    ratio: float = field(init=False)
    modulus: float = field(init=False)

    def __post_init__(self) -> None:
        low, high = sorted((self.A, self.B))
        if not SLENDEREST * high < low <= high < np.inf:
            raise UserError(f"A, B: half curvatures of {self.A:g} and {self.B:g} 1/m; both must be positive and finite")
        object.__setattr__(self, "ratio", float(axis_ratio(low / high)))
        object.__setattr__(self, "modulus", normal_modulus(self.first, self.second))

    @staticmethod
    def sphere(first: Solid, second: Solid, radius: float) -> Hertz:
        """A sphere on a flat, or two spheres with 1/R = 1/R_1 + 1/R_2; radius in m."""
        return Hertz(first, second, 0.5 / radius, 0.5 / radius)

    # normal --------------------------------------------------------------------------------------------------------

    @property
    def _coefficient(self) -> float:
        """C of F = C delta^(3/2): (2 pi E*/3 K) sqrt(D/(A K)), from Sextro Eqs. (6.4-17), (6.4-24)."""
        K, D, _ = ellipse_integrals(self.ratio)
        return float(2 * np.pi * self.modulus / (3 * K) * np.sqrt(D / (min(self.A, self.B) * K)))

    def force(self, approach: ArrayLike) -> Array:
        """Normal force (N) at an approach (m, any shape); zero where the bodies are apart."""
        return self._coefficient * np.maximum(doubles(approach), 0.0) ** 1.5

    def approach(self, force: ArrayLike) -> Array:
        """Approach (m) under a normal force (N, not negative)."""
        return (pressing(force) / self._coefficient) ** (2 / 3)

    def semi_axes(self, force: ArrayLike) -> tuple[Array, Array]:
        """(a_x, a_y): half axes along x and y, m, Sextro Eq. (6.4-17)."""
        K, D, _ = ellipse_integrals(self.ratio)
        long = np.sqrt(self.approach(force) * D / (min(self.A, self.B) * K))
        return (long, self.ratio * long) if self.A <= self.B else (self.ratio * long, long)

    def area(self, force: ArrayLike) -> Array:
        """Area of the contact ellipse, m2."""
        x, y = self.semi_axes(force)
        return np.pi * x * y

    def largest_pressure(self, force: ArrayLike) -> Array:
        """3 F/(2 pi a b), Pa, in the middle; zero without force."""
        area, F = self.area(force), pressing(force)
        return np.divide(1.5 * F, area, out=np.zeros_like(area), where=area > 0)

    def pressure(self, force: float, x: ArrayLike, y: ArrayLike) -> Array:
        """Pressure (Pa) at points (m) from the middle; zero outside the ellipse."""
        a, b = self.semi_axes(force)
        if not a > 0:
            return np.zeros(np.broadcast(x, y).shape)
        inside = 1 - (doubles(x) / a) ** 2 - (doubles(y) / b) ** 2
        return self.largest_pressure(force) * np.sqrt(np.maximum(inside, 0.0))

    def normal_stiffness(self, force: ArrayLike) -> Array:
        """dF/d(delta) = pi E* a/K, N/m, a the long half axis; 2 E* a of a circle."""
        a, b = self.semi_axes(force)
        return np.pi * self.modulus * np.maximum(a, b) / ellipse_integrals(self.ratio)[0]

    def stiffness_at(self, approach: ArrayLike) -> Array:
        """dF/d(delta), N/m, at an approach (m, any shape)."""
        return self.normal_stiffness(self.force(approach))

    # tangential ----------------------------------------------------------------------------------------------------

    @property
    def tangential_ratio(self) -> tuple[float, float]:
        """(x, y): tangential over normal stiffness while all of the contact sticks, whatever the force.

        Displacement over force along the long axis is sum of ((1 - nu_i) K + nu_i D)/(2 pi a G_i), along the short
        one with B for D (Mindlin 1949, Deresiewicz 1957, and Johnson 7.2; the coupling of `solids.mismatch` is left
        out). A circle gives 2 (1 - nu)/(2 - nu).
        """
        K, D, B = ellipse_integrals(self.ratio)
        solids = (self.first, self.second)
        along, across = (sum(((1 - s.poisson) * K + s.poisson * J) / s.shear for s in solids) for J in (D, B))
        normal = 2 * K / self.modulus  # of the same form
        long, short = float(normal / along), float(normal / across)
        return (long, short) if self.A <= self.B else (short, long)

    def tangential_stiffness(self, force: ArrayLike) -> tuple[Array, Array]:
        """(x, y): stiffness (N/m) of the sticking contact along both axes of the ellipse under a normal force (N)."""
        normal = self.normal_stiffness(force)
        x, y = self.tangential_ratio
        return x * normal, y * normal

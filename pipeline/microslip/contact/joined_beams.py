"""Two equal cantilevers in line whose tips touch: the rig that tells contact stiffnesses (Sextro 3.5, Treyde 1995).

Clamped at their outer ends, the slender beams meet in the middle. Where both bend alike, the slopes at the contact
are opposite and it works as a hinge with the spring c_phi; where they bend against each other, the slopes are equal
and the contact shears, c_T. Each half is a cantilever with the spring 2 c_phi on its tip's rotation or 2 c_T across
it. With b^4 = omega^2 rho A L^4/(E I), C, S = cosh b, sinh b and c, s = cos b, sin b:

    2 c_phi L/(E I) = -b (1 + C c)/(C s + S c),    2 c_T L^3/(E I) = -b^3 (1 + C c)/(C s - S c).

The normal force on the contact is left out (it must be small against the buckling load).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

FREE, HINGE_LOCKED, SHEAR_LOCKED = 1.8751040687119611, 2.3650203724313523, 3.9266023120479188
"""b without contact, with the slopes at the contact held at zero, and with the tips held in place."""


@dataclass(frozen=True)
class Section:
    """A uniform beam. length: m. young, shear: Pa. density: kg/m3. area: m2. inertia: second moment, m4.

    kappa: shear coefficient (`rectangle_kappa`).
    """

    length: float
    young: float
    shear: float
    density: float
    area: float
    inertia: float
    kappa: float

    @property
    def unit(self) -> float:
        """sqrt(E I / (rho A L^4)), rad/s: the frequency that makes a beam's numbers dimensionless."""
        return float(np.sqrt(self.young * self.inertia / (self.density * self.area * self.length**4)))


def rectangle(length: float, width: float, height: float, young: float, poisson: float, density: float) -> Section:
    """The beam of rectangular section that bends in the direction of `height` (m)."""
    shear = young / (2 * (1 + poisson))
    return Section(length, young, shear, density, width * height, width * height**3 / 12, rectangle_kappa(poisson))


def rectangle_kappa(poisson: float) -> float:
    """Shear coefficient of a vibrating rectangle (Kaneko, J. Phys. D 8 (1975) 1927); Cowper's is 2 % lower."""
    return 5 * (1 + poisson) / (6 + 5 * poisson)


def frequencies(section: Section, hinge: float, shear: float) -> tuple[float, float]:
    """Angular frequencies (rad/s) of the mode with both beams alike and of that against each other.

    Args:
        hinge: c_phi, N m/rad. shear: c_T, N/m.
    """
    stiffness = section.young * section.inertia / section.length
    alike = _root(hinge_number, 2 * hinge / stiffness, HINGE_LOCKED)
    against = _root(shear_number, 2 * shear * section.length**2 / stiffness, SHEAR_LOCKED)
    return section.unit * alike**2, section.unit * against**2


def _root(function: Callable[[float], float], value: float, top: float) -> float:
    below = top * (1 - 1e-15)
    if function(below) < value:
        return top
    return float(brentq(lambda b: function(b) - value, FREE, below, xtol=1e-15, rtol=1e-15)) if value > 0 else FREE


def hinge_number(b: float) -> float:
    """2 c_phi L/(E I)."""
    return float(-b * (1 + np.cosh(b) * np.cos(b)) / (np.cosh(b) * np.sin(b) + np.sinh(b) * np.cos(b)))


def shear_number(b: float) -> float:
    """2 c_T L^3/(E I)."""
    return float(-(b**3) * (1 + np.cosh(b) * np.cos(b)) / (np.cosh(b) * np.sin(b) - np.sinh(b) * np.cos(b)))

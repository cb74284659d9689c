"""A uniform beam and its numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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

"""Tangential load on a pressed contact of any profile: Cattaneo and Mindlin's partial slip by the theorem of Jaeger.

With Coulomb friction and like bodies the tangential traction is mu times the difference of two normal pressures: the
actual one, and that of the smaller contact which is the stick area (Ciavarella 1998, Jaeger 1998). So the normal law
F(delta) holds all of it. Exact for round contacts of any profile but for the small slip across the load; of an
ellipse along its axes (Deresiewicz 1957). The normal force is constant here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad

from ..data import Array
from ..errors import UserError
from .solids import doubles, refuse_not_positive


class NormalContact(Protocol):
    """What is needed of `hertz.Hertz`, `profiles.RoundContact`, or a contact of one's own."""

    @property
    def tangential_ratio(self) -> tuple[float, float]:
        """(x, y): tangential over normal stiffness of the sticking contact, the same at every force."""

    def force(self, approach: ArrayLike) -> Array:
        """Normal force, N, at an approach, m; zero where it is not positive."""

    def approach(self, force: ArrayLike) -> Array:
        """Approach, m, under a normal force, N."""


@dataclass(frozen=True)
class PartialSlip:
    """A contact under a constant normal force that is loaded along one of its axes.

    Attributes:
        contact: its normal law. normal_force: N. friction: mu. axis: 0 along x, 1 along y.

    Raises:
        UserError: no normal force, no friction, another axis.
    """

    contact: NormalContact
    normal_force: float
    friction: float
    axis: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.normal_force < np.inf:
            raise UserError(f"normal_force: {self.normal_force:g} N; partial slip needs a pressed contact")
        refuse_not_positive(friction=self.friction)
        if self.axis not in (0, 1):
            raise UserError(f"axis: {self.axis} is none; 0 is along x, 1 along y")

    @property
    def limit(self) -> float:
        """mu F_N, N."""
        return self.friction * self.normal_force

    @property
    def full_slip(self) -> float:
        """Tangential displacement (m) from which all of the contact slides: mu delta k_N/k_T."""
        return float(self.contact.approach(self.normal_force)) / self._slope

    @property
    def _slope(self) -> float:
        """Approach that the stick area loses per tangential displacement."""
        return self.contact.tangential_ratio[self.axis] / self.friction

    def force(self, displacement: ArrayLike) -> Array:
        """Tangential force (N) of first loading to a displacement (m, any shape); odd.

        T = mu (F(delta) - F(delta - (k_T/k_N) u/mu)).
        """
        u = doubles(displacement)
        delta = float(self.contact.approach(self.normal_force))
        stick = np.maximum(delta - self._slope * np.abs(u), 0.0)
        return np.sign(u) * self.friction * (self.normal_force - self.contact.force(stick))

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement (m) of first loading to a tangential force (N) up to mu F_N; odd.

        Raises:
            UserError: a force beyond mu F_N.
        """
        T = doubles(force)
        if (np.abs(T) > self.limit * (1 + 1e-12)).any():
            raise UserError(f"force: {np.abs(T).max():g} N is more than friction holds, {self.limit:g} N")
        stick = np.maximum(self.normal_force - np.abs(T) / self.friction, 0.0)
        delta = float(self.contact.approach(self.normal_force))
        return np.sign(T) * (delta - self.contact.approach(stick)) / self._slope

    def loop(self, amplitude: float, samples: int = 200) -> tuple[Array, Array]:
        """Displacements (m) and forces (N), (2 samples + 1,), of a closed cycle between +-amplitude (m).

        Both branches are the first loading at twice the scale (Masing).
        """
        fall = amplitude * np.cos(np.linspace(0, np.pi, samples + 1))
        branch = float(self.force(amplitude)) - 2 * self.force(0.5 * (amplitude - fall))
        return np.concatenate([fall, -fall[1:]]), np.concatenate([branch, -branch[1:]])

    def dissipated(self, amplitude: float) -> float:
        """Energy (J) lost in a cycle between +-amplitude (m): 8 integral_0^A T du - 4 T(A) A."""
        top = min(abs(amplitude), self.full_slip)
        area = quad(lambda u: float(self.force(u)), 0.0, top, epsabs=0.0, epsrel=1e-10, limit=200)[0]
        area += self.limit * (abs(amplitude) - top)
        return float(8 * area - 4 * abs(self.force(amplitude) * amplitude))

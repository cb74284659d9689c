"""Pressed and sheared round contacts in closed form: sphere, cone, stamps; Mindlin's and Cattaneo's results.

K. L. Johnson, Contact Mechanics, chapters 3 to 5 and 7; V. L. Popov, Contact Mechanics and Friction, chapters 5 and 8.
``modulus`` is E*, 1/E* = (1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2, in Pa. SI.
"""

from __future__ import annotations

import numpy as np

from microslip.contact.solids import mean_inverse_distance


def sphere_force(modulus: float, radius: float, approach: float) -> float:
    """(4/3) E* sqrt(R) delta^(3/2) (Johnson 4.23)."""
    return 4 / 3 * modulus * np.sqrt(radius) * approach**1.5


def cone_force(modulus: float, slope: float, approach: float) -> float:
    """(2/pi) E* delta^2 / slope of the gap slope * r (Johnson 5.12; Love 1939). The radius is 2 delta/(pi slope)."""
    return 2 / np.pi * modulus * approach**2 / slope


def stamp_force(modulus: float, radius: float, approach: float) -> float:
    """2 E* a delta of a flat round stamp (Johnson 3.36)."""
    return 2 * modulus * radius * approach


def truncated_cone(modulus: float, slope: float, flat: float, radius: float) -> tuple[float, float]:
    """(approach, force) of a cone with a flat of radius `flat` at the contact radius (Ejike 1969; Popov and Hess).

    delta = slope a phi, F = E* slope a^2 (phi + sin phi cos phi) with cos phi = flat/a.
    """
    phi = np.arccos(flat / radius)
    return slope * radius * phi, modulus * slope * radius**2 * (phi + np.sin(phi) * np.cos(phi))


def mindlin_stiffness(shear: float, poisson: float, radius: float) -> float:
    """8 G a / (2 (2 - nu)) of two like bodies sticking over a circle (Johnson 7.44)."""
    return 4 * shear * radius / (2 - poisson)


def cattaneo_displacement(force: float, friction: float, normal_force: float, stiffness: float) -> float:
    """(3 mu F_N/2 k)(1 - (1 - T/mu F_N)^(2/3)) of Hertz' contact; k: sticking stiffness, N/m (Johnson 7.42)."""
    return 1.5 * friction * normal_force / stiffness * (1 - (1 - force / (friction * normal_force)) ** (2 / 3))


def cattaneo_loss(force: float, friction: float, normal_force: float, stiffness: float) -> float:
    """Energy (J) lost in a cycle of +-T (Mindlin and Deresiewicz 1953; Johnson 7.57).

    (36/5)(mu F_N)^2/k (1 - (1 - t)^(5/3) - (5/6) t (1 + (1 - t)^(2/3))) with t = T/(mu F_N).
    """
    limit = friction * normal_force
    t = force / limit
    return 7.2 * limit**2 / stiffness * (1 - (1 - t) ** (5 / 3) - 5 / 6 * t * (1 + (1 - t) ** (2 / 3)))


def rectangle_compliance(a: float, b: float, young: float, poisson: float) -> float:
    """Mean normal displacement (m) of a rectangle (m) on a half-space per newton of uniform pressure on it.

    Boussinesq's w = (1 - nu^2) F/(pi E r) (K. L. Johnson, Contact Mechanics, 3.2), averaged over source and target.
    A rigid stamp of the same outline is stiffer.
    """
    return (1 - poisson**2) / (np.pi * young) * mean_inverse_distance(a, b)

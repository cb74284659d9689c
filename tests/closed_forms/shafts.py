"""Spinning shafts: the mass on two springs, and the simply supported Timoshenko shaft."""

from __future__ import annotations

import numpy as np

from microslip.contact.identification import Section
from microslip.data import Array


def spinning_mass(first: float, second: float, speed: float) -> Array:
    """(2,) angular frequencies, rad/s, of a mass on two perpendicular springs, seen in a frame that turns with them.

    (omega_1^2 - Omega^2 - omega^2) (omega_2^2 - Omega^2 - omega^2) = 4 Omega^2 omega^2; with equal springs
    |omega_0 - Omega| and omega_0 + Omega.

    Args:
        first, second: frequencies at rest, rad/s. speed: Omega, rad/s, below the lower one.
    """
    a, b = first**2 - speed**2, second**2 - speed**2
    total = a + b + 4 * speed**2
    root = np.sqrt(total**2 - 4 * a * b)
    return np.sqrt(np.array([0.5 * (total - root), 0.5 * (total + root)]))


def spinning_shaft(section: Section, wave: int, speed: float) -> Array:
    """(2,) whirl frequencies of bending in an inertial frame, rad/s: backward (negative) and forward.

    Simply supported, equal inertia I in both planes; with w = u_x + i u_y and the slope phi likewise,
    rho A w'' = kappa G A (w_zz - phi_z) and rho I phi'' - 2 i Omega rho I phi' = E I phi_zz + kappa G A (w_z - phi)
    (dots in time). w = W sin(k z) e^{i omega t} leaves a quartic in omega; the two roots next to zero are bending.

    Args:
        wave: number of half waves. speed: rad/s. A turning frame sees omega - Omega.
    """
    s = section
    k = wave * np.pi / s.length
    stiff = s.kappa * s.shear * s.area
    axial = np.polynomial.Polynomial([stiff * k**2, 0.0, -s.density * s.area])
    turn = np.polynomial.Polynomial(
        [s.young * s.inertia * k**2 + stiff, 2 * speed * s.density * s.inertia, -s.density * s.inertia]
    )
    roots = np.sort((axial * turn - (stiff * k) ** 2).roots().real)
    return roots[1:3]

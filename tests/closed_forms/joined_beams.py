"""Springs between two cantilevers in line from one measured frequency: `microslip.contact.identification` inverted."""

from __future__ import annotations

import numpy as np

from microslip.contact.identification import FREE, HINGE_LOCKED, SHEAR_LOCKED, Section, hinge_number, shear_number


def hinge_spring(section: Section, omega: float) -> float:
    """c_phi (N m/rad) that gives the first mode, both beams alike, this angular frequency (rad/s).

    Raises:
        ValueError: no spring does.
    """
    b = _number(section, omega, HINGE_LOCKED)
    return 0.5 * section.young * section.inertia / section.length * hinge_number(b)


def shear_spring(section: Section, omega: float) -> float:
    """c_T (N/m) that gives the second mode, beams against each other, this angular frequency (rad/s).

    Raises:
        ValueError: no spring does.
    """
    b = _number(section, omega, SHEAR_LOCKED)
    return 0.5 * section.young * section.inertia / section.length**3 * shear_number(b)


def _number(section: Section, omega: float, top: float) -> float:
    b = np.sqrt(omega / section.unit)
    if not FREE <= b < top:
        low, high = section.unit * FREE**2, section.unit * top**2
        raise ValueError(f"{omega:g} rad/s is outside the reach of the contact, {low:g} to {high:g} rad/s")
    return float(b)

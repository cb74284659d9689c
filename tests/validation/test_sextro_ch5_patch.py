"""Sextro, Dynamical Contact Problems with Friction, 2nd ed., section 5.2: Fig. 5.2-2 on the patch of 5.3.

Figs. 5.2-4 to 5.2-7 are in tests/test_book_mode.py. The approach of Fig. 5.2-2 is not printed: 0, 0.5 and 1 here.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from microslip.contact.friction import Coulomb
from microslip.contact.heights import Polynomial
from microslip.contact.law import value
from microslip.contact.normal import Rough
from microslip.contact.patch import Patch, grid, pressing
from microslip.contact.point import PointContact

C_N0, C_R0, R_Z, MU, B0, H0 = 840e6, 80e6, 7.5e-6, 0.2, 0.072, 0.005


def patch(n_y: int, n_z: int) -> Patch:
    n = n_y * n_z
    normal = Rough(value(C_N0 / n), value(R_Z), Polynomial())
    law = PointContact(normal, Coulomb(value(MU)), value(C_R0 / n))
    return Patch("right", *grid(B0, H0, (n_y, n_z)), law)


def turned(n_y: int, n_z: int, approach: float, angle: float) -> np.ndarray:
    """F_N* and M_y* of (5.2-6), at u_0x* and an angle phi_0y* of (5.2-8)."""
    u = np.zeros(6)
    u[[0, 4]] = approach * R_Z, angle * R_Z / H0
    return pressing(patch(n_y, n_z), u)[[0, 4]] / (C_N0 * R_Z * np.array([1, H0]))


def whole(approach: float, angle: float) -> np.ndarray:
    """The same of infinitely many elements: integrals over z* of (3.3-24) at (5.2-7)."""

    def force(z: float) -> float:
        u = max(approach + z * angle, 0.0)
        return u**3 - u**4 / 2 if u < 1 else u - 0.5

    kinks = sorted({min(max((k - approach) / angle, -0.5), 0.5) for k in (0, 1)})
    return np.array([quad(f, -0.5, 0.5, points=kinks)[0] for f in (force, lambda z: z * force(z))])


@pytest.mark.parametrize("approach", [0.0, 0.5, 1.0])
def test_fig_5_2_2_eight_elements_are_enough(approach: float) -> None:
    """Printed: the difference between 8 and 1024 elements is "relatively small". It is 2.9 % of the force and 4.9 % of
    the moment at most, of the lightest touch, and falls with the square of their number."""
    for angle in (0.5, 1.0, 2.0, 4.0):
        exact = whole(approach, angle)
        off = {n: np.abs(turned(1, n, approach, angle) / exact - 1) for n in (8, 32, 1024)}
        assert (off[8] < [0.03, 0.05]).all() and (off[1024] < off[8] / 120**2).all()
        assert np.log2(off[8] / off[32]) / 2 == pytest.approx([2, 2], abs=0.2)


def test_fig_5_2_2_counts_elements_along_z() -> None:
    """Printed: n_y elements, and "the results are independent on the number of elements in the z-direction". An angle
    about y lifts along z (5.2-7), so that n_z counts and n_y does not; with one row of elements there is no moment."""
    assert turned(4, 8, 0.5, 2.0) == pytest.approx(turned(1, 8, 0.5, 2.0), rel=1e-12)
    alone = turned(8, 1, 0.5, 2.0)
    assert alone[0] == pytest.approx(0.09375, rel=1e-12) and alone[1] == pytest.approx(0, abs=1e-15)


def test_fig_5_2_2_translations_have_no_error() -> None:
    """Printed: "if only translations are involved, the error due to the discretization is identical to zero"."""
    for counts in ((1, 8), (8, 1), (4, 8)):
        assert turned(*counts, 0.5, 0.0) == pytest.approx([0.09375, 0], rel=1e-12, abs=1e-15)

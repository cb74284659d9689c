"""Laws made of contact stiffnesses: the forces of their sources, and whose compliance they count."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused

from microslip.contact.curves import curve, of_contact
from microslip.contact.friction import Coulomb
from microslip.contact.heights import Polynomial
from microslip.contact.hertz import Hertz
from microslip.contact.law import march, value
from microslip.contact.layer import Layer
from microslip.contact.partial_slip import PartialSlip
from microslip.contact.point_laws import curve_point, hertz_point, rough_point, round_point, smooth_point
from microslip.contact.profiles import Profile, RoundContact
from microslip.contact.series import BULK, ContactStiffness, in_series, of_layer
from microslip.contact.solids import Solid

STEEL, MU = Solid(2.1e11, 0.3), Coulomb(value(0.3))


def forces(law, u: np.ndarray) -> np.ndarray:
    """(s, 3) of one point led along u (s, 3) m."""
    return np.array(march(law, jnp.asarray(u)[:, None], 1e-3, law.init(1))[0][:, 0])


def pressed(law, approach: np.ndarray) -> np.ndarray:
    return forces(law, np.column_stack([approach, 0 * approach, 0 * approach]))[:, 0]


def sheared(law, approach: float, along: int) -> float:
    """Stiffness along a tangent of the contact pressed before, N/m, by a step far below slip."""
    step = np.zeros((2, 3))
    step[:, 0], step[1, along] = approach, 1e-12
    return float(forces(law, step)[1, along] / 1e-12)


def test_hertz_point_has_hertz_force_and_both_of_deresiewicz_stiffnesses():
    h = Hertz(STEEL, STEEL, 5.0, 40.0)
    law, u = hertz_point(h, MU), np.array([-1e-6, 1e-7, 3e-6, 2e-5])
    assert pressed(law, u) == pytest.approx(h.force(u), rel=1e-12)
    for d in (1e-6, 1e-5):
        x, y = h.tangential_stiffness(h.force(d))
        assert [sheared(law, d, 1), sheared(law, d, 2)] == pytest.approx([x, y], rel=1e-9)
    assert law.includes == BULK
    again = hertz_point(h, MU, 500.0)  # the force at which it is noted does not matter
    assert pressed(again, u) == pytest.approx(pressed(law, u), rel=1e-12)
    assert sheared(again, 1e-5, 2) == pytest.approx(sheared(law, 1e-5, 2), rel=1e-9)


def test_one_point_sticks_up_to_two_thirds_of_the_displacement_of_full_slip():
    h, N = Hertz.sphere(STEEL, STEEL, 0.05), 100.0
    law, s = hertz_point(h, MU), PartialSlip(h, N, 0.3)
    d = float(h.approach(N))
    for share, slides in ((0.66, False), (0.67, True)):
        path = np.array([[d, 0, 0], [d, share * s.full_slip, 0]])
        assert (forces(law, path)[1, 1] > s.limit * (1 - 1e-9)) == slides


def test_round_point_follows_its_profile():
    """81 knots with exact slopes: of fourth order but where the contact opens, 1e-5 of the largest force."""
    cone = RoundContact(STEEL, STEEL, Profile.of_function(lambda r: 0.01 * r, 0.01))
    law = round_point(cone, MU, 500.0)
    u = np.linspace(0, float(cone.approach(500.0)), 57)
    assert pressed(law, u) == pytest.approx(cone.force(u), abs=5e-3)
    x, _ = cone.tangential_stiffness(200.0)
    assert sheared(law, float(cone.approach(200.0)), 1) == pytest.approx(float(x), rel=1e-3)
    assert law.stiffness_2 is None and law.includes == BULK
    refused("largest: 0 N", of_contact, cone, 0.0)


def test_curve_of_hertz_converges_to_hertz():
    h, u = Hertz.sphere(STEEL, STEEL, 0.05), np.linspace(0, 1e-5, 333)
    counts, error = np.array([11, 21, 41, 81]), []
    for n in counts:
        error.append(np.abs(of_contact(h, float(h.force(1e-5)), n).force(u) - h.force(u)).max())
    assert np.polyfit(np.log(counts), np.log(error), 1)[0] < -2.5  # u^(3/2) at the quadratic knots is of third order


def test_layer_under_a_rough_surface_and_without_it():
    """The shroud contact of 5.3: 840e6 and 323e6 N/m once all of the area touches, R_Z/2 later than a smooth one."""
    whole = of_layer(Layer(STEEL, 0.09), 0.072 * 0.005)
    rough, smooth = rough_point(whole, 7.5e-6, Polynomial(), MU), smooth_point(whole, MU)
    u = np.array([-1e-6, 2e-6, 1e-5, 2e-5])
    assert pressed(smooth, u) == pytest.approx(840e6 * np.maximum(u, 0))
    assert pressed(rough, u)[2:] == pytest.approx(840e6 * (u[2:] - 3.75e-6))
    assert sheared(rough, 1e-5, 1) == pytest.approx(323.077e6, rel=1e-5)
    assert (rough.includes, smooth.includes) == ("bulk+surface", "bulk")
    assert rough_point(ContactStiffness(1e9, (1e9, 1e9), "surface"), 1e-6, Polynomial(), MU).includes == "surface"
    both = rough_point(in_series(whole, whole), 7.5e-6, Polynomial(), MU)
    assert float(both.normal.stiffness_0) == pytest.approx(420e6)
    refused("roughness: -1 m", rough_point, whole, -1.0, Polynomial(), MU)


def test_measured_curve_as_a_point():
    c = curve(np.arange(9) * 1e-6, [0, 1, 8, 27, 60, 110, 170, 240, 310], includes="surface")
    law = curve_point(c, (0.4, 0.5), MU)
    u = np.linspace(-1e-6, 1e-5, 40)
    assert pressed(law, u) == pytest.approx(c.force(u), rel=1e-9, abs=1e-9)
    assert sheared(law, 6.5e-6, 2) == pytest.approx(0.5 * float(c.stiffness(6.5e-6)), rel=1e-6)
    assert law.includes == "surface"
    refused("ratio", curve_point, c, (0.4, 0.0), MU)

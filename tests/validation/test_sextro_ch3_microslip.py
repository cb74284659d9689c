"""Sextro, Dynamical Contact Problems with Friction, 2nd ed., section 3.8: microslip of rough surfaces.

Figs. 3.8-2 a to d and 3.8-4 with the parameters printed for them, and what the text says about them. The figures'
curves are not printed as numbers; they are held against (3.8-1) to (3.8-29) solved as printed, in another way.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from microslip.contact.heights import Polynomial
from microslip.contact.microslip import MonotoneSlip

W = np.linspace(0, 3, 601)  # w_P*
U = np.arange(0, 1.51, 0.15)  # u_x* = 0 (0.15) 1.5


def figure(heating: float, strength: float) -> MonotoneSlip:
    return MonotoneSlip(Polynomial(), 1.0, 1.0, strength, heating)


A, B, C, D = figure(0, 2), figure(0, 1), figure(1, 2), figure(1, 1)


def volume(x):
    """(3.3-24)."""
    x = np.asarray(x, dtype=float)
    return np.where(x < 1, np.maximum(x, 0) ** 3 * (1 - x / 2), x - 0.5)


def area(x):
    """(3.3-4)."""
    x = np.clip(x, 0, 1)
    return x**2 * (3 - 2 * x)


def printed(w, u, strength, heating, R=1.0, c=1.0):
    """(F_T*, dT*) at one point where (3.8-18) has one root: the equations one after the other, as printed."""

    def parts(warmth):
        tau, mu = min(c * w, strength * (1 - warmth)), 1 - warmth
        u_S = min(max(u - tau / mu, 0.0), u)
        F_x, F_S = R * volume(u / R), R * volume(u_S / R)
        return mu, F_x - F_S, F_x - F_S - area(u_S / R) * (u - u_S)

    def excess(warmth):
        mu, _, sliding = parts(warmth)
        return warmth - heating * mu * sliding / area(u / R)

    warmth = brentq(excess, 0.0, 1 - 1e-12, xtol=1e-14) if excess(0.0) < 0 else 0.0
    mu, all_that_slides, _ = parts(warmth)
    return mu * all_that_slides, warmth


@pytest.mark.parametrize(
    ("heating", "strength"),
    [*(pytest.param(*c, marks=pytest.mark.slow) for c in ((0, 2), (0, 1), (1, 2))), (1, 1)],
    ids=["a", "b", "c", "d"],
)
def test_fig_3_8_2_solves_the_printed_equations(heating, strength):
    """At 1.5 with heating, three roots from w* = 0.69 to 0.72: that stretch is tried below."""
    curve = figure(heating, strength)
    for u in U[1::3]:
        for w in (0.05, 0.3, 0.6, 0.8, 1.4, 3.0):
            force, warmth = printed(w, u, strength, heating)
            assert curve.force(w, u) == pytest.approx(force, rel=1e-9, abs=1e-12)
            assert curve.temperature(w, u) == pytest.approx(warmth, rel=1e-9, abs=1e-12)


def test_fig_3_8_2_a_more_normal_displacement_transmits_more():
    """ "With increasing normal displacement, the maximum possible tangential force increases": it is F_N*(u_x*)."""
    largest = A.force(W[:, None], U).max(axis=0)
    assert np.allclose(largest, volume(U), rtol=1e-12) and np.all(np.diff(largest) > 0)
    assert largest[-1] == pytest.approx(1.0) and largest[6] == pytest.approx(0.9**3 * 0.55)


def test_fig_3_8_2_a_microslip_makes_the_force_rise_smoothly():
    """The slope falls steadily from c h(u) to zero at w* = u*/c*. For u_x* > R_Z* all of the area touches and sticks
    up to w* = u_x* - R_Z*: no microslip there, the curve begins straight, which the text does not say."""
    slope = np.diff(A.force(W[:, None], U), axis=0) / W[1]
    assert np.all(np.diff(slope, axis=0) < 1e-9)
    assert np.allclose(slope[0, 1:], area(U[1:]), atol=0.02)
    assert np.abs(np.diff(slope, axis=0)).max() < 1.51 * W[1]  # h' <= 3/2: no corner anywhere
    assert np.allclose(slope[:99, -1], 1.0) and slope[120, -1] < 1


def test_fig_3_8_2_b_the_shear_strength_limits_the_force():
    """ "The maximum tangential force is limited by the shear strength": above u_x* = tau_S0* = 1 only. Up to there
    friction gives way first at every height, and Figs. a and b are the same."""
    a, b = (curve.force(W[:, None], U) for curve in (A, B))
    assert np.allclose(a[:, U <= 1], b[:, U <= 1], rtol=1e-12)
    high = U > 1
    assert np.allclose(b[-1, high], volume(U[high]) - volume(U[high] - 1), rtol=1e-12)
    assert np.all(b[-1, high] < a[-1, high]) and b[-1, -1] == pytest.approx(1 - 0.5**3 * 0.75)
    assert b.max() <= 1.0  # tau_S0* times all of the area


def test_fig_3_8_2_c_the_force_falls_as_friction_does():
    """ "The decreasing character of the friction factor appears as well with respect to the tangential force": yes,
    down to F/(1 + k F/h), but by less than a thousandth for u_x* <= 0.45, where little heat arises; those curves look
    monotone. At u_x* = 1.5 the force falls from 0.677 to 0.661 and then jumps: (3.8-18) has three roots there."""
    force = C.force(W[:, None], U)
    end = volume(U[1:]) / (1 + volume(U[1:]) / area(U[1:]))
    assert np.allclose(force[-1, 1:], end, rtol=1e-9)
    fall = 1 - end / force[:, 1:].max(axis=0)
    assert np.all(np.diff(fall) > 0) and fall[-1] == pytest.approx(0.262, abs=1e-3)
    steps = -np.diff(force, axis=0).min(axis=0)
    assert steps[-1] > 0.15 and steps[:-1].max() < 0.05


def test_fig_3_8_2_d_both():
    """Yield before full slip leaves less sliding, less heat, and so more force in the end than Fig. c at u_x* > 1."""
    c, d = (curve.force(W[:, None], U)[-1] for curve in (C, D))
    assert np.allclose(c[U <= 1], d[U <= 1], rtol=1e-12)
    assert np.all(d[U > 1.01] > c[U > 1.01]) and (c[-1], d[-1]) == pytest.approx((0.5, 0.6444), abs=1e-4)


def test_fig_3_8_2_c_three_roots_and_the_jump_from_the_branch_of_rest():
    """At u_x* = 1.5 three temperatures solve (3.8-18) between w* = 0.698 and 0.7125. The one that began at w* = 0 ends
    at 0.7125; there the slip depth jumps from 0.947 to 1.392, the force from 0.661 to 0.511."""
    assert [len(C.roots(w, 1.5)) for w in (0.6, 0.69, 0.705, 0.72, 1.0)] == [1, 1, 3, 1, 1]
    s = np.linspace(0, 1.5, 300_001)
    w = C.displacement(s, 1.5)
    fold = int(np.argmax(np.diff(w) < 0))
    assert (s[fold], w[fold]) == pytest.approx((0.94652, 0.712489), abs=2e-5)
    before, after = w[fold] * (1 - 1e-5), w[fold] * (1 + 1e-5)
    assert float(C.slip_depth(before, 1.5)) < s[fold] < 1.39 < float(C.slip_depth(after, 1.5))
    assert [float(C.force(x, 1.5)) for x in (before, after)] == pytest.approx([0.6614, 0.5113], abs=1e-3)


@pytest.mark.parametrize(("heating", "least"), [(0.5, 1.8), (1, 1.45), (2, 1.2), (5, 0.9), (10, 0.7)])
def test_several_roots_need_much_heat_or_a_flat_contact(heating, least):
    """With k_T* = 1 three roots appear for u_x* > R_Z* only (from 1.45); more heat brings them down to below R_Z*."""
    curve = figure(heating, np.inf)

    def folds(u):
        return np.any(np.diff(curve.displacement(np.linspace(0, u, 8001), u)) < -1e-12)

    assert folds(least) and not folds(least - 0.05)


# Fig. 3.8-4: Musiol's brake, constant normal force ------------------------------------------------------------------

ROUGHNESS = np.array([1.5, 3.0, 5.0, 8.0, 11.0, 14.65])
MU_0, F_N = 0.75, 2.0
BRAKE = MonotoneSlip(Polynomial(), 0.00019, ROUGHNESS, 1.9, 0.7)
TIME = np.linspace(0, 15_000, 1501)  # t* = w_P*


def test_fig_3_8_4_equivalent_friction_coefficient():
    """Normal displacement from (3.3-24) under F_N* = 2; every point solves the printed equations."""
    u = BRAKE.approach(F_N)
    assert np.allclose(ROUGHNESS * volume(u / ROUGHNESS), F_N, rtol=1e-9)
    f = BRAKE.coefficient(TIME[:, None], F_N, MU_0)
    for i in (0, 2, 5):
        for j in (100, 400, 1500):
            force = printed(TIME[j], u[i], 1.9, 0.7, ROUGHNESS[i], 0.00019)[0]
            assert f[j, i] == pytest.approx(MU_0 * force / F_N, rel=1e-9)
    assert f[-1] == pytest.approx([0.4616, 0.4354, 0.4134, 0.3716, 0.3372, 0.3049], abs=1e-4)
    assert f.max(axis=0) == pytest.approx([0.5225, 0.4423, 0.4134, 0.3716, 0.3372, 0.3049], abs=2e-4)
    assert f.max() < MU_0


def test_fig_3_8_4_the_decreasing_characteristic_needs_smooth_surfaces():
    """ "The decreasing characteristic due to a decreasing equivalent friction factor is recalculated relatively well":
    for R_Z* = 1.5 (by 12 %) and 3 (by 2 %). From R_Z* = 5 on the printed strength tau_S0* = 1.9 < u_x* lets the peaks
    yield before they heat up enough, and f only rises."""
    f = BRAKE.coefficient(TIME[:, None], F_N, MU_0)
    fall = 1 - f[-1] / f.max(axis=0)
    assert fall == pytest.approx([0.1164, 0.0155, 0, 0, 0, 0], abs=1e-3)


def test_fig_3_8_4_jump_from_stick_to_slip_of_very_smooth_surfaces():
    """ "If the average roughness is very small, the transition from stick to slip coincides with a jump in the
    tangential contact force": at R_Z* = 1.5 by 0.061 of f. But with the printed parameters the jump does not grow to
    the smooth surface: F_N* = 2 presses it by u_x* = 2 > tau_S0* = 1.9, so for R_Z* <= 0.1 all of it yields while it
    sticks, without heat, and f rises to mu_0 tau_S0*/F_N* = 0.7125 without any jump. A strength above u_x* gives the
    jump that the text speaks of, from mu_0 to mu_0/(1 + k F_N*)."""
    w = np.linspace(0, 13_000, 5001)
    jump, end = {}, {}
    for R, strength in [(1.5, 1.9), (0.5, 1.9), (0.1, 1.9), (0.0, 1.9), (0.1, 2.1), (0.0, 2.1)]:
        f = MonotoneSlip(Polynomial(), 0.00019, R, strength, 0.7).coefficient(w, F_N, MU_0)
        jump[R, strength], end[R, strength] = -np.diff(f).min(), f[-1]
    assert jump[1.5, 1.9] == pytest.approx(0.061, abs=1e-3) and jump[0.5, 1.9] == pytest.approx(0.106, abs=1e-3)
    assert jump[0.1, 1.9] <= 0 and jump[0.0, 1.9] <= 0
    assert (end[0.1, 1.9], end[0.0, 1.9]) == pytest.approx((0.7125, 0.7125), rel=1e-9)
    assert jump[0.1, 2.1] == pytest.approx(0.419, abs=1e-3) and jump[0.0, 2.1] == pytest.approx(0.4375, abs=1e-3)
    assert end[0.0, 2.1] == pytest.approx(MU_0 / (1 + 0.7 * F_N), rel=1e-9)


def test_fig_3_8_4_the_rougher_the_less_friction():
    """At every time: the larger the roughness, the less area is in contact and the more of it slides."""
    f = BRAKE.coefficient(TIME[1:, None], F_N, MU_0)
    assert np.all(np.diff(f, axis=1) < 1e-12)  # equal as long as both stick as a whole

"""Microslip: closed forms of sliders in parallel, Mindlin's contact under changing load, and the monotone curve."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from refusals import refused
from scipy.integrate import quad
from scipy.optimize import brentq

from microslip.contact.heights import Cut, Exponential, Gaussian, Linear, Polynomial, tabulated
from microslip.contact.hertz import Hertz
from microslip.contact.law import history, march, value, values
from microslip.contact.microslip import MonotoneSlip, of
from microslip.contact.normal import Penalty, Preload
from microslip.contact.partial_slip import PartialSlip
from microslip.contact.sliders import Iwan, Strips, jenkins, mindlin, rough_strips, segalman, uniform
from microslip.contact.solids import Solid
from microslip.programs import program

MU, K_N, K_T, R_Z = 0.3, 2.4e8, 0.9e8, 12e-6
SPHERE = Hertz(Solid(2.1e11, 0.3), Solid(2.1e11, 0.3), 20.0, 20.0)
RISING = [Polynomial(), Linear(), Cut(Exponential(4.0)), Cut(Gaussian(0.5, 0.22)), tabulated([0, 0.4, 1], [0, 0.1, 1])]
FEW = pytest.mark.parametrize(
    "heights",
    [*RISING[:3], *(pytest.param(h, marks=pytest.mark.slow) for h in RISING[3:])],
    ids=lambda h: type(h).__name__,
)
LOCAL = jax.jit(lambda law, approach: law.local(approach))
MARCHED = program(march)


def MARCH(law, u):
    return MARCHED(law, u, 1e-4, law.init(u.shape[1]))[0]




def along(tangential, approach=0.0):
    """(s, 1, 3) a path along t1 at an approach, one or one per sample."""
    tangential = np.asarray(tangential, dtype=float)
    return np.column_stack([approach + 0 * tangential, tangential, 0 * tangential])[:, None]


def marched(law, u):
    """(s, n, 3) forces along a path that is lengthened, so that one program of a law serves paths of any length."""
    return np.array(MARCH(law, np.pad(u, ((0, -len(u) % 1024), (0, 0), (0, 0)), mode="edge")))[: len(u)]


def forces(law, tangential, approach=0.0):
    """(s,) tangential force along the path."""
    return marched(law, along(tangential, approach))[:, 0, 1]


def there_and_back(amplitude, samples=400):
    """First loading to the amplitude, then a closed cycle."""
    fall = amplitude * np.cos(np.linspace(0, np.pi, samples + 1))
    return np.concatenate([np.linspace(0, amplitude, samples + 1), fall[1:], -fall[1:]])


def loop_work(force, tangential, samples=400):
    """Work of the closed cycle at the end of a path."""
    return np.trapezoid(force[-2 * samples - 1 :], tangential[-2 * samples - 1 :])


# Jenkins, Masing ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("normal", [400.0, Penalty(value(4e8))], ids=["constant", "spring"])
def test_jenkins_loop_dissipates_4_mu_n_times_the_path_slid(normal):
    """Exact but for the trapezoids in which sliding begins: second order of the samples, 1e-5 with 400."""
    law = jenkins(1e8, MU, normal)
    u = there_and_back(5e-6)
    work = loop_work(forces(law, u, 1e-6), u)
    assert work == pytest.approx(4 * MU * 400 * (5e-6 - MU * 400 / 1e8), rel=5e-5)


CONSTANT = {
    "Jenkins": jenkins(K_T, MU, 400.0),
    "rough strips": rough_strips(K_N, R_Z, Polynomial(), K_T, MU, 12).under(400.0),
    "Mindlin": mindlin(SPHERE, MU, 8e-6, 12).under(400.0),
    "Iwan, uniform": Iwan(Preload(value(400.0)), value(MU), value(K_T), *uniform(12)),
    "Iwan, Segalman": Iwan(Preload(value(400.0)), value(MU), value(K_T), *segalman(12, -0.4, 0.5)),
}


@pytest.mark.parametrize("law", CONSTANT.values(), ids=CONSTANT.keys())
@pytest.mark.parametrize("share", [0.2, 0.8, 3.0])
def test_masing_both_branches_are_first_loading_at_twice_the_scale(law, share):
    """Under constant normal force, whatever the normal motion, to rounding."""
    amplitude = share * MU * 400 / K_T
    u = there_and_back(amplitude, 100)
    force = forces(law, u, 1e-6 * np.sin(np.arange(len(u))))
    back = np.array([forces(law, [x])[0] for x in 0.5 * (amplitude - u[100:201:20])])
    assert np.allclose(force[100:201:20], force[100] - 2 * back, rtol=0, atol=1e-9 * MU * 400)
    assert np.allclose(force[200:], -force[100:201], rtol=0, atol=1e-9 * MU * 400)


@pytest.mark.parametrize("law", CONSTANT.values(), ids=CONSTANT.keys())
def test_full_slip_carries_mu_times_the_normal_force(law):
    force = np.array(MARCH(law, along([1e-3])))[0, 0]
    assert force[0] == pytest.approx(400, rel=1e-12)
    assert force[1] == pytest.approx(MU * 400, rel=1e-12)


@pytest.mark.parametrize("law", [CONSTANT["rough strips"], CONSTANT["Iwan, uniform"]], ids=["strips", "Iwan"])
def test_a_circular_orbit_dissipates_its_closed_form(law):
    """A slider of limit L and spring k on a circle of radius A: 2 pi L sqrt(A^2 - (L/k)^2); a sum over all of them.

    The return map is of first order in the step, so two numbers of samples are extrapolated.
    """
    A, work = 1.5e-6, []
    for samples in (1500, 3000):
        t = 2 * np.pi * np.arange(samples) / samples
        u = A * np.stack([0 * t, np.cos(t), np.sin(t)], axis=-1)[:, None]
        f = marched(law, np.tile(u, (18_000 // samples, 1, 1)))[-samples:]
        work.append((0.5 * (f + np.roll(f, 1, axis=0)) * (u - np.roll(u, 1, axis=0))).sum())
    _, k, limit = (np.array(part) for part in LOCAL(law, np.zeros(1)))
    slides = k * A > limit
    exact = np.sum(2 * np.pi * limit * np.sqrt(np.where(slides, A**2 - (limit / np.where(slides, k, 1)) ** 2, 0)))
    assert 0 < slides.sum() < len(k) and 2 * work[1] - work[0] == pytest.approx(exact, rel=1e-4)


def test_the_slip_path_of_a_sliding_contact_is_what_the_springs_do_not_take():
    """All strips slide: the mean slip is the displacement less the mean stretch mu F_N / c_R0 of the full area."""
    law = rough_strips(K_N, R_Z, Polynomial(), K_T, MU, 8)
    way = jax.tree.map(np.asarray, history(law, along(np.linspace(0, 1e-4, 50), 2 * R_Z), 1e-4))
    pressed = float(way.force[-1, 0, 0])
    assert float(way.slip[-1, 0, 0]) == pytest.approx(1e-4 - MU * pressed / K_T, rel=1e-9)


# Iwan --------------------------------------------------------------------------------------------------------------


def iwan(distribution, force=400.0):
    return Iwan(Preload(value(force)), value(MU), value(K_T), *distribution)


def test_iwan_of_equally_frequent_strengths_is_a_parabola():
    """k u (1 - k u / (4 mu N)) up to u = 2 mu N / k, by the second order of the sliders."""
    last, errors = 2 * MU * 400 / K_T, []
    u = np.linspace(0, last, 401)
    for count in (10, 20, 40):
        errors.append(np.abs(forces(iwan(uniform(count)), u) - K_T * u * (1 - K_T * u / (4 * MU * 400))).max())
    assert np.polyfit(np.log([10, 20, 40]), np.log(errors), 1)[0] == pytest.approx(-2, abs=0.05)
    assert errors[-1] < 2e-4 * MU * 400


@pytest.mark.parametrize(("chi", "beta"), [(-0.5, 0.0), (-0.2, 1.0), (0.0, 0.3)])
def test_segalman_s_first_loading_and_power_law_of_dissipation(chi, beta):
    """Force against the integral over the density; loop energy 4 R A^(chi + 3)/((chi + 2)(chi + 3)) and its slope.

    An interval of the width d around phi makes R phi^chi d^2/8 of error, of a force above R phi^(chi + 2)/(chi + 2).
    """
    width = 1 - 1e-4 ** (1 / (59 if beta == 0 else 58))  # of the intervals, over their end
    law = iwan(segalman(60, chi, beta, 1e-4))
    last = (1 + beta) / (beta + (chi + 1) / (chi + 2)) * MU * 400 / K_T
    R = K_T * (chi + 1) / ((1 + beta) * last ** (chi + 1))
    u = last * np.geomspace(1e-3, 1.2, 40)
    inside = np.minimum(u, last)
    exact = R * (inside ** (chi + 2) / (chi + 2) + u * (last ** (chi + 1) - inside ** (chi + 1)) / (chi + 1))
    exact += K_T * beta / (1 + beta) * inside
    excess = forces(law, u) / exact - 1
    assert excess.min() > -1e-12 and excess.max() < (chi + 2) * width**2 / 8
    amplitudes = last * np.geomspace(0.01, 0.9, 8)
    energy = [loop_work(forces(law, there_and_back(a)), there_and_back(a)) for a in amplitudes]
    assert np.allclose(energy, 4 * R * amplitudes ** (chi + 3) / ((chi + 2) * (chi + 3)), rtol=2e-2)
    assert np.polyfit(np.log(amplitudes), np.log(energy), 1)[0] == pytest.approx(chi + 3, abs=5e-3)


def test_iwan_with_one_slider_is_the_point_contact():
    normal = Penalty(value(K_N))
    one = Iwan(normal, jnp.asarray(MU), jnp.asarray(K_T), *uniform(1))
    t = np.linspace(0, 12, 300)
    u = along(4e-6 * np.sin(t), 3e-6 * np.cos(1.7 * t))
    assert np.allclose(marched(one, u), marched(jenkins(K_T, MU, normal), u), rtol=0, atol=1e-9)


def test_iwan_with_one_slider_and_two_stiffnesses_is_that_point_contact():
    normal = Penalty(value(K_N))
    one = Iwan(normal, jnp.asarray(MU), jnp.asarray(K_T), *uniform(1), jnp.asarray(0.4))
    t = np.linspace(0, 12, 300)
    u = np.column_stack([3e-6 * np.cos(1.7 * t), 4e-6 * np.sin(t), 5e-6 * np.cos(t)])[:, None]
    point = replace(jenkins(K_T, MU, normal), stiffness_2=jnp.asarray(0.4 * K_T))
    assert np.allclose(MARCH(one, u), MARCH(point, u), rtol=0, atol=1e-7)
    assert np.allclose(history(one, u, 1e-4).slip, history(point, u, 1e-4).slip, rtol=0, atol=1e-14)


# Strips of a rough surface -----------------------------------------------------------------------------------------


@FEW
def test_strips_carry_the_normal_force_of_the_rough_surface(heights):
    """Second order in their number, from below, exact once all of the area touches."""
    deepest = float(heights.breaks()[-1])
    u, errors = np.linspace(0, 1.2 * deepest, 400) * R_Z, []
    exact = K_N * R_Z * values(heights, "volume", u / R_Z)
    for count in (8, 16, 32):
        law = rough_strips(K_N, R_Z, heights, K_T, MU, count)
        force = np.array(LOCAL(law, u)[0])
        errors.append(np.abs(force - exact).max())
        assert np.allclose(force[u >= deepest * R_Z], exact[u >= deepest * R_Z], rtol=1e-9)
        assert np.all(force <= exact + 1e-9 * exact[-1])
    assert np.polyfit(np.log([8, 16, 32]), np.log(errors), 1)[0] == pytest.approx(-2, abs=0.15)


def test_strips_converge_to_the_monotone_curve():
    """(3.8-26) without yield and heating, by the second order of their number, at every approach.

    The book's numbers with a_0 = R_Z: c* = c_R0/(mu c_N0).
    """
    curve = MonotoneSlip(Polynomial(), K_T / (MU * K_N), 1.0)
    w, level, errors, counts = np.linspace(0, 1.6, 161)[:, None], np.linspace(0.1, 1.5, 15), [], [16, 64]
    exact = MU * K_N * R_Z * curve.force(w, level)
    u = R_Z * np.stack(np.broadcast_arrays(level, w, 0.0), axis=-1)
    for count in counts:
        law = rough_strips(K_N, R_Z, Polynomial(), K_T, MU, count)
        errors.append(np.abs(np.array(MARCH(law, u))[..., 1] - exact).max())
    assert np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(-2, abs=0.15)
    assert errors[-1] < 1e-4 * MU * K_N * R_Z


def test_strips_under_a_constant_force_meet_masing_s_loop_of_the_monotone_curve():
    curve = MonotoneSlip(Polynomial(), K_T / (MU * K_N), 1.0)
    N, A = 800.0, 0.25
    level = float(curve.approach(N / (K_N * R_Z)))
    law = rough_strips(K_N, R_Z, Polynomial(), K_T, MU, 128).under(N)
    u = there_and_back(A)
    force = forces(law, u * R_Z) / (MU * K_N * R_Z)
    exact = curve.force(A, level) - 2 * curve.force(0.5 * (A - u[400:801]), level)
    assert np.abs(force[400:801] - exact).max() < 1e-4 * curve.force(A, level)
    loss = 8 * quad(lambda x: float(curve.force(x, level)), 0, A)[0] - 4 * A * float(curve.force(A, level))
    assert loop_work(force, u) == pytest.approx(loss, rel=1e-3)


def test_strips_that_part_come_back_unloaded():
    """Moved while pressed, lifted off half of the strips, pressed again: those have forgotten, the others have not."""
    law = rough_strips(K_N, R_Z, Linear(), K_T, 10.0, 4)  # equal shares, touching from R_Z/8, 3/8, 5/8, 7/8
    force = forces(law, [0, 1e-9, 1e-9, 1e-9], np.array([1.5, 1.5, 0.5, 1.5]) * R_Z)
    assert np.allclose(force, K_T * 1e-9 * np.array([0, 1, 0.5, 0.5]), rtol=1e-9)


def test_settings_of_strips_may_differ_from_point_to_point():
    laws = [rough_strips(K_N, r, Polynomial(), K_T, m, 5) for r, m in ((8e-6, 0.2), (15e-6, 0.6))]
    fields = ("depth", "mu", "stiffness_0", "stiffness_t")
    columns = {name: np.concatenate([getattr(law, name) for law in laws], axis=1) for name in ("at", "shares")}
    both = replace(laws[0], **columns, **{name: np.stack([getattr(law, name) for law in laws]) for name in fields})
    t = np.linspace(0, 9, 100)
    u = along(5e-6 * np.sin(t), 8e-6 * (1 + np.cos(2 * t)))
    together = MARCH(both, np.concatenate([u, u], axis=1))
    for i, law in enumerate(laws):
        assert np.allclose(together[:, i], MARCH(law, u)[:, 0], rtol=1e-12, atol=1e-12)
    refused("point to point", both.approach, 100.0)


@pytest.mark.parametrize("count", [1, 7])
def test_the_approach_under_a_force_gives_that_force(count):
    force = np.geomspace(1e-3, 1e5, 30)
    for law in (rough_strips(K_N, R_Z, Polynomial(), K_T, MU, count), mindlin(SPHERE, MU, 3e-6, count)):
        assert np.allclose(LOCAL(law, law.approach(force))[0], force, rtol=1e-9, atol=0)


# Mindlin -----------------------------------------------------------------------------------------------------------

DEEPEST, LOAD = 8e-6, 200.0
PARTIAL = PartialSlip(SPHERE, LOAD, MU)


def test_mindlin_s_strips_meet_partial_slip_by_the_second_order_of_their_number():
    """Force of first loading T = mu N (1 - (1 - u/u_full)^(3/2)), and the loop's energy."""
    u, counts = np.linspace(0, 1.3, 131) * PARTIAL.full_slip, [16, 64]
    exact = MU * LOAD * (1 - np.maximum(1 - u / PARTIAL.full_slip, 0) ** 1.5)
    errors = [np.abs(forces(mindlin(SPHERE, MU, DEEPEST, m).under(LOAD), u) - exact).max() for m in counts]
    assert np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(-2, abs=0.25)
    bound, delta = 3 / (8 * np.array(counts) ** 2.0) * SPHERE.force(DEEPEST), np.linspace(0, DEEPEST, 4001)
    assert np.all(np.array(errors) < MU * bound)
    excess = [np.array(LOCAL(mindlin(SPHERE, MU, DEEPEST, m), delta)[0]) - SPHERE.force(delta) for m in counts]
    assert np.all(np.max(excess, axis=1) < bound) and np.min(excess) > -1e-9
    law = mindlin(SPHERE, MU, DEEPEST, 256).under(LOAD)
    way = there_and_back(0.6 * PARTIAL.full_slip)
    assert loop_work(forces(law, way), way) == pytest.approx(PARTIAL.dissipated(way.max()), rel=1e-3)


@pytest.mark.slow
def test_small_cycles_dissipate_the_cube_of_the_force_of_mindlin_and_deresiewicz():
    """(2 - nu) T^3 / (36 a mu N G) for one elastic body on a rigid one (J. Appl. Mech. 20, 1953); twice that for two.

    The next term is of the relative order T/(mu N), 5 % here; halving it twice and extrapolating leaves its square.
    """
    contact, G, nu = PARTIAL, 2.1e11 / 2.6, 0.3
    a = np.cbrt(3 * LOAD * 0.025 * (1 - nu**2) / (2 * 2.1e11))  # half curvatures 20 1/m: R = 0.025 m; both bodies
    ratios = []
    for T in (0.05 * MU * LOAD, 0.025 * MU * LOAD):
        ratios.append(contact.dissipated(float(contact.displacement(T))) * 18 * a * MU * LOAD * G / ((2 - nu) * T**3))
    assert 2 * ratios[1] - ratios[0] == pytest.approx(1, abs=1e-3)
    law = mindlin(SPHERE, MU, DEEPEST, 2000).under(LOAD)
    T = 0.05 * MU * LOAD
    way = there_and_back(float(contact.displacement(T)), 800)
    energy = loop_work(forces(law, way), way, 800)
    assert energy * 18 * a * MU * LOAD * G / ((2 - nu) * T**3) == pytest.approx(ratios[0], rel=0.02)


@pytest.mark.parametrize("steep", [0.5, 0.9, 1.5])
def test_oblique_loading_sticks_below_the_friction_angle_and_slides_above(steep):
    """dT/dN = beta < mu: no slip at all, T = beta N (Mindlin & Deresiewicz 1953); above: T = mu N at once."""
    law = mindlin(SPHERE, MU, DEEPEST, 24)
    approach = np.linspace(0, DEEPEST, 4001)[1:]
    tangential = steep * MU / SPHERE.tangential_ratio[0] * approach
    way = jax.tree.map(np.asarray, history(law, along(tangential, approach), 1e-4))
    force = way.force[:, 0]
    # a strip that closes within a step starts with the whole of it: first order of the step, 1/4000
    assert np.allclose(force[:, 1], min(steep, 1) * MU * force[:, 0], rtol=0, atol=1e-3 * MU * force[-1, 0])
    if steep < 1:
        work = MU * steep * float(np.sum(force[:, 0])) * (tangential[1] - tangential[0])
        assert float(way.dissipated[-1, 0]) < 1e-3 * work


def test_more_normal_force_before_more_tangential_meets_jaeger_s_superposition():
    """T_1 under delta_0, then delta_1 > delta_0 at rest, then on by d: the new rings alone slip at first,

    mu [F(delta_0) - F(delta_0 - s_1)] + mu [F(delta_1) - F(delta_1 - s)], s = (k_T/k_N) d/mu <= delta_1 - delta_0;
    after that all is as if delta_1 had been there from the beginning, with s + s_1 (Jaeger 1993).
    """
    first, second, before = 1.5e-6, 2.0e-6, 0.6e-6
    per = MU / SPHERE.tangential_ratio[0]
    depth = np.array([0.1, 0.3, 0.5, 0.7, 0.9, 1.2]) * 1e-6
    ways = np.concatenate([[0, before, before], before + depth]) * per
    law = mindlin(SPHERE, MU, DEEPEST, 600)
    force = forces(law, ways, np.concatenate([[first, first], np.full(7, second)]))

    def F(delta):
        return SPHERE.force(np.maximum(delta, 0))

    exact = np.where(
        depth <= second - first,
        F(first) - F(first - before) + F(second) - F(second - depth),
        F(second) - F(second - depth - before),
    )
    assert np.allclose(force[3:], MU * exact, rtol=1e-4)


@pytest.mark.parametrize("axis", [0, 1])
def test_an_elliptic_contact_slips_along_both_axes_as_partial_slip_does(axis):
    """t1 lies along the axis asked for; across it the other tangential stiffness acts."""
    contact, N = Hertz(Solid(2.1e11, 0.3), Solid(2.1e11, 0.3), 5.0, 40.0), 100.0
    law = mindlin(contact, MU, 1.2 * float(contact.approach(N)), 200, axis).under(N)
    for column, along_axis in ((1, axis), (2, 1 - axis)):
        closed = PartialSlip(contact, N, MU, along_axis)
        way = np.zeros((40, 1, 3))
        way[:, 0, column] = np.linspace(0, 1.2, 40) * closed.full_slip
        force = np.array(MARCH(law, way))[:, 0, column]
        assert np.abs(force - closed.force(way[:, 0, column])).max() < 1e-4 * MU * N


def test_mindlin_unloads_normally_without_energy():
    """Lifted to nothing while held aside, and pressed again: closed, T follows mu N down and stays at nothing."""
    law = mindlin(SPHERE, MU, DEEPEST, 24)
    approach = np.concatenate([np.full(40, 2e-6), np.linspace(2e-6, 0, 200), np.linspace(0, 2e-6, 200)])
    tangential = np.concatenate([np.linspace(0, 3e-6, 40), np.full(400, 3e-6)])
    force = forces(law, tangential, approach)
    assert force[39] > 0 and np.all(np.diff(force[39:240]) <= 1e-12) and np.all(force[239:] == 0)


# The monotone curve ------------------------------------------------------------------------------------------------


@FEW
def test_without_heat_the_force_is_the_sum_over_the_heights(heights):
    """(3.8-24): traction min(c w, tau_S) while stuck, mu times the pressure else, over the heights (3.3-15)."""
    rng = np.random.default_rng(38)
    u, w, strength = rng.uniform([[0.05], [0.01], [0.2]], [[2.5], [3.0], [2.5]], (3, 40))
    x = np.minimum(u, float(heights.breaks()[-1])) * np.linspace(0, 1, 4001)[:, None]
    traction = np.minimum(np.minimum(0.8 * w, strength), u - 0.5 * (x[1:] + x[:-1]))
    expected = np.sum(np.diff(values(heights, "area", x), axis=0) * traction, axis=0)
    force = MonotoneSlip(heights, 0.8, 1.0, strength).force(w, u)
    assert np.allclose(force, expected, rtol=1e-4, atol=1e-6)  # the midpoint rule


def residual(curve, warmth, w, u):
    """dT* - k_T* q_H* as printed (3.8-5, 3.8-14, 3.8-15, 3.8-18, 3.8-22, 3.8-23), u_S clipped."""
    tau, mu = min(curve.stiffness * w, curve.strength * (1 - warmth)), 1 - warmth
    u_S = min(max(u - tau / mu, 0), u)
    F = curve.normal_force
    sliding = F(u) - F(u_S) - curve.area(u_S) * (u - u_S)
    return warmth - curve.heating * mu * float(sliding) / float(curve.area(u))


@given(
    u=st.floats(0.2, 2.5), w=st.floats(0.01, 3), strength=st.floats(0.3, 3), k=st.floats(0.05, 5), R=st.floats(0.3, 2)
)
@hypothesis_settings(max_examples=8, deadline=None, derandomize=True)
def test_the_temperature_solves_the_printed_implicit_equation(u, w, strength, k, R):
    curve = MonotoneSlip(Polynomial(), 1.0, R, strength, k)
    warmth = float(curve.temperature(w, u))
    assert 0 <= warmth < 1 and abs(residual(curve, warmth, w, u)) < 1e-9
    roots = curve.roots(w, u)
    assert len(roots) % 2 == 1 and float(curve.slip_depth(w, u)) == pytest.approx(roots[0], abs=1e-9)


@pytest.mark.slow
def test_the_branch_from_rest_is_followed_to_its_fold_and_left_there():
    """Against the printed equation, whose root is followed in small steps of w until it is gone."""
    curve, u = MonotoneSlip(Polynomial(), 1.0, 1.0, 2.0, 1.0), 1.5
    warmth, snapped = 0.0, []
    for w in np.linspace(0.55, 0.8, 101):
        ahead = warmth + 1e-9
        while residual(curve, ahead, w, u) < 0 and ahead < 1:
            ahead += 2e-3  # the first change of sign above the last root
        root = brentq(lambda x, w=w: residual(curve, x, w, u), ahead - 2.1e-3, ahead)
        snapped += [w] if root - warmth > 0.05 else []
        warmth = root
        assert float(curve.temperature(w, u)) == pytest.approx(warmth, abs=2e-3 if snapped else 1e-6)
    assert len(snapped) == 1 and snapped[0] == pytest.approx(0.7125, abs=0.0025)


@pytest.mark.slow
def test_the_slip_depth_never_falls_and_the_curve_is_odd():
    w = np.linspace(0, 3, 400)
    curve = MonotoneSlip(Polynomial(), 1.0, np.array([0.0, 0.4, 1.0])[:, None, None], 1.2, np.array([0.0, 3])[:, None])
    depth = curve.slip_depth(w, 0.9)
    assert depth.shape == (3, 2, 400) and np.all(np.diff(depth, axis=-1) >= -1e-12)
    assert np.array_equal(curve.force(-w, 0.9), -curve.force(w, 0.9))
    one = MonotoneSlip(Polynomial(), 1.0, 0.4, 1.2, 3.0)
    assert np.allclose(curve.force(w, 0.9)[1, 1], one.force(w, 0.9), rtol=1e-12)


def test_a_smooth_surface_sticks_and_then_slides_as_a_whole():
    """R_Z* = 0: the force is c w up to friction u, then it is hot at once: u/(1 + k u)."""
    curve = MonotoneSlip(Polynomial(), 2.0, 0.0, np.inf, 0.5)
    w = np.array([0.1, 0.4, 0.4999, 0.5001, 3.0])
    assert np.allclose(curve.force(w, 1.0), [0.2, 0.8, 0.9998, 1 / 1.5, 1 / 1.5], rtol=1e-9)


@FEW
def test_the_approach_under_a_force_solves_3_3_24(heights):
    curve = MonotoneSlip(heights, 1.0, np.array([0.0, 0.5, 3.0, 14.65]))
    loads = np.array([[1e-3], [0.4], [2.0], [30.0]])
    assert np.allclose(curve.normal_force(curve.approach(loads)), loads, rtol=1e-9)


def test_an_open_contact_has_no_friction():
    curve = MonotoneSlip(Polynomial(), 1.0, 1.0, 2.0, 1.0)
    assert np.all(curve.force([0.0, 1.0], [[-1.0], [0.0]]) == 0)
    assert np.all(curve.temperature([0.0, 1.0], [[-1.0], [0.0]]) == 0)


def test_numbers_without_dimension_are_the_book_s():
    """A surface in SI, its force by the local traction: stuck, mu_0 F_N when all slides, hot by k_T q."""
    c_N0, c_R0, A, unit, mu_0, v = 8e8, 3e8, 4e-4, 1e-6, 0.4, 2.0
    curve = of(Polynomial(), c_N0, c_R0, A, 5e-6, mu_0, v, 1.2e9, 800.0, 2e-7, unit)
    friction = mu_0 * c_N0 * unit
    assert float(curve.force(1e-4, 10.0)) * friction == pytest.approx(c_R0 * 1e-4 * unit, rel=1e-9)
    N = float(curve.normal_force(3.0)) * c_N0 * unit
    touching = float(curve.area(3.0)) * A
    warmth = brentq(lambda x: 800 * x - 2e-7 * mu_0 * (1 - x) * N * v / touching, 0, 1)  # (3.8-17), (3.8-20)
    assert float(curve.temperature(1e3, 3.0)) == pytest.approx(warmth, rel=1e-9)
    assert float(curve.force(1e3, 3.0)) * friction == pytest.approx(mu_0 * (1 - warmth) * N, rel=1e-9)
    assert float(curve.coefficient(1e3, N / (c_N0 * unit), mu_0)) == pytest.approx(mu_0 * (1 - warmth), rel=1e-9)
    assert curve.strength * friction / A == pytest.approx(1.2e9)


# Mistakes ----------------------------------------------------------------------------------------------------------

WRONG = [
    (lambda: MonotoneSlip(Polynomial(), 0.0, 1.0), "stiffness: 0"),
    (lambda: MonotoneSlip(Polynomial(), 1.0, -1.0), "roughness: -1"),
    (lambda: MonotoneSlip(Polynomial(), 1.0, 1.0, np.nan), "strength: nan"),
    (lambda: MonotoneSlip(Polynomial(), 1.0, 1.0, 1.0, np.inf), "heating: inf"),
    (lambda: MonotoneSlip(Gaussian(), 1.0, 1.0), "Cut"),
    (lambda: MonotoneSlip(Polynomial(), 1.0, 1.0).approach([1.0, -2.0]), "normal force"),
    (lambda: rough_strips(K_N, R_Z, Exponential(), K_T, MU, 4), "Cut"),
    (lambda: rough_strips(K_N, -R_Z, Polynomial(), K_T, MU, 4), "roughness: -1.2e-05"),
    (lambda: rough_strips(K_N, R_Z, Polynomial(), K_T, np.nan, 4), "friction: nan"),
    (lambda: rough_strips(K_N, R_Z, Polynomial(), K_T, MU, 0), "give 1 or more"),
    (lambda: rough_strips(K_N, R_Z, Polynomial(), K_T, MU, 4).under(0.0), "normal force: 0 N"),
    (lambda: mindlin(SPHERE, MU, -1.0, 4), "deepest: -1"),
    (lambda: uniform(4, 1.0), "weakest: 1"),
    (lambda: segalman(4, -1.0, 0.0), "exponent -1"),
    (lambda: segalman(1, -0.5, 1.0), "2 or more"),
]


@pytest.mark.parametrize(("wrong", "says"), WRONG, ids=[says for _, says in WRONG])
def test_mistakes_are_one_sentence(wrong, says):
    refused(says, wrong)


def test_a_force_that_is_not_convex_has_no_strips():
    class Softening:
        tangential_ratio = (0.8, 0.8)

        def force(self, approach):
            return np.sqrt(np.maximum(approach, 0))

        def approach(self, force):
            return np.square(force)

    refused("does not rise", mindlin, Softening(), MU, 1e-6, 4)


def test_strips_are_a_law_whose_settings_are_leaves():
    law = rough_strips(K_N, R_Z, Polynomial(), K_T, MU, 3)
    assert isinstance(law, Strips) and len(jax.tree_util.tree_leaves(law)) == 6

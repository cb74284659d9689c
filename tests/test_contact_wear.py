"""Wear at constant force: the exact course against balances, closed forms and steps; the loop back into a law."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from refusals import refused

from microslip.contact.friction import Coulomb
from microslip.contact.heights import Linear, Polynomial, as_table, summed, tabulated
from microslip.contact.law import history, value, values
from microslip.contact.normal import Rough
from microslip.contact.point import PointContact
from microslip.contact.wear import (
    approach_under,
    course,
    evolve,
    from_archard,
    from_energy_density,
    run_in,
    stepped,
    worn_law,
)
from microslip.errors import NotConverged

TRIES = hypothesis_settings(max_examples=30, deadline=None, derandomize=True)
FORCE = 0.09375
TABLE = as_table(Polynomial(), 257)


def table_of(seed, count=40):
    rng = np.random.default_rng(seed)
    x = np.concatenate([[0.0], np.cumsum(rng.uniform(0.005, 0.06, size=count - 1))])
    area = np.concatenate([[0.0], np.cumsum(rng.uniform(0, 1, size=count - 1) ** 3)])
    return tabulated(x, area / area[-1])


def slopes(errors):
    return np.log2(np.divide(errors[:-1], errors[1:]))


@TRIES
@given(seed=st.integers(0, 10**6), force=st.floats(0.01, 2.0))
def test_the_approach_is_that_of_the_new_surface_under_a_growing_force(seed, force) -> None:
    """V(u*) = F* (1 + t*), and both sides by themselves: the force stays, the worn volume is Archard's F* t*.

    Between its strips the course is taken as straight: the balances meet with the square of their distance.
    """
    times = np.array([0.0, 0.1, 0.7, 2.0, 9.0])
    found, surface = course(table_of(seed), force, times), table_of(seed)
    assert np.allclose(values(surface, "volume", found.approach), force * (1 + times), rtol=1e-12)
    for i in range(len(times)):
        assert float(values(found.heights(i), "volume", found.approach[i])) == pytest.approx(force, abs=2e-3)
    assert np.allclose(found.worn, force * times, atol=2e-3)


def test_balances_meet_with_the_square_of_the_strips() -> None:
    times, errors, volumes = np.array([0.0, 1.0, 3.0]), [], []
    for count in (65, 129, 257, 513):
        found = course(Polynomial(), FORCE, times, count)
        errors.append(abs(np.trapezoid(found.pressure[1], found.share) - FORCE))
        volumes.append(abs(found.worn[2] - 3 * FORCE))
    assert np.mean(slopes(errors)) > 1.7 and np.mean(slopes(volumes)) > 1.7
    assert errors[-1] < 2e-6


@TRIES
@given(seed=st.integers(0, 10**6), force=st.floats(0.01, 1.0))
def test_strips_stay_in_order_and_the_surface_gets_smoother(seed, force) -> None:
    """Heights keep their order, roughness and largest pressure fall, area and approach grow."""
    found = course(table_of(seed), force, np.linspace(0, 8, 30))
    assert np.all(np.diff(found.depth, axis=1) >= 0) and np.all(np.diff(found.depth, axis=0) >= -1e-14)
    assert np.all(np.diff(found.roughness) <= 1e-14) and np.all(np.diff(found.pressure[:, 0]) <= 1e-14)
    assert np.all(np.diff(found.area) >= -1e-12) and np.all(np.diff(found.approach) >= 0)


def test_in_full_contact_differences_decay_exponentially() -> None:
    """dp/dt = F - p: p = F + (p_0 - F) exp(-t); the surface gets flat and goes down at the speed F."""
    force, times = 0.8, np.array([0.0, 0.5, 1.0, 4.0, 30.0])
    found = course(TABLE, force, times)
    exact = force + (found.pressure[:1] - force) * np.exp(-times)[:, None]
    assert np.abs(found.pressure - exact).max() < 1e-13
    assert np.allclose(found.roughness, np.exp(-times), rtol=1e-9, atol=1e-14)
    assert found.approach[-1] - found.approach[-2] == pytest.approx(force * 26, rel=1e-12)
    assert np.abs(found.depth[-1] - (found.approach[-1] - force)).max() < 1e-12


def test_linear_heights_have_an_elementary_course() -> None:
    """V = u^2/2: u = sqrt(2 F (1 + t)), and the integral of exp(u^2 / 2F) du is Dawson's."""
    from scipy.special import dawsn

    force, t = 0.02, 5.0
    found = course(as_table(Linear(), 401), force, np.array([t]))
    u, r = np.sqrt(2 * force * (1 + t)), np.sqrt(2 * force)
    assert found.approach[0] == pytest.approx(u, rel=1e-14)
    x = np.asarray(as_table(Linear(), 401).x)
    start = np.sqrt(2 * force)
    since = (np.maximum(x, start) / r) ** 2
    p = r * (dawsn(u / r) - np.exp(since - 1 - t) * dawsn(np.maximum(x, start) / r))
    p = np.where(x < u, p + np.maximum(start - x, 0) * np.exp(-t), 0)
    assert np.abs(found.pressure[0] - p).max() < 1e-13


def test_a_worn_surface_goes_on_as_if_it_had_not_been_stopped() -> None:
    """Twice 1.5 is once 3: but for the table in between, whose error falls with the square of its strips."""
    errors = []
    for count in (65, 129, 257):
        half = course(Polynomial(), FORCE, np.array([1.5]), count)
        whole = course(Polynomial(), FORCE, np.array([3.0]), count)
        errors.append(np.abs(course(half.heights(), FORCE, np.array([1.5])).depth - whole.depth).max())
    assert errors[-1] < 1e-5 and np.mean(slopes(errors)) > 1.5


@pytest.mark.parametrize("force", [FORCE, 0.8], ids=["growing contact", "full contact"])
def test_heuns_steps_converge_to_the_exact_course_with_order_two(force) -> None:
    table = as_table(Polynomial(), 1025)  # fine: the steps' error has to stand out
    exact = course(table, force, np.array([3.0])).depth[0]
    errors = [np.abs(evolve(table, force, 3.0, step=h).depth[-1] - exact).max() for h in (0.2, 0.1, 0.05, 0.025)]
    assert np.all(np.abs(slopes(errors) - 2) < 0.2)


def test_printed_steps_converge_with_order_one() -> None:
    x, share = np.asarray(TABLE.x), np.asarray(TABLE.area_at)
    exact, errors = course(TABLE, FORCE, np.array([2.0])).depth[0], []
    for steps in (32, 64, 128, 256):
        worn = x
        for _ in range(steps):
            worn = stepped(worn, share, FORCE, 2.0 / steps)
        errors.append(np.abs(worn - exact).max())
    assert np.all(np.abs(slopes(errors) - 1) < 0.1)


@TRIES
@given(seed=st.integers(0, 10**6), force=st.floats(0.01, 1.0), h=st.floats(0.01, 8.0))
def test_a_printed_step_keeps_the_order_up_to_one(seed, force, h) -> None:
    """And beyond one turns the order of the strips that touch round: the highest becomes the lowest."""
    table = table_of(seed)
    x, share = np.asarray(table.x), np.asarray(table.area_at)
    after = stepped(x, share, force, h)
    inside = x < float(approach_under(table, force))
    if h <= 1:
        assert np.all(np.diff(after) >= -1e-15)
    elif h > 1.001 and inside.sum() > 1:
        assert np.all(np.diff(after[inside]) < 0)


def test_the_chosen_step_holds_the_tolerance_and_the_order() -> None:
    """The error of the whole course stays of the size of the tolerance of a step, with fewer steps for a looser one."""
    exact, counts = course(TABLE, FORCE, np.array([6.0])).depth[0], []
    for tolerance in (1e-3, 1e-4, 1e-5):
        found = evolve(TABLE, FORCE, 6.0, tolerance=tolerance)
        assert np.abs(found.depth[-1] - exact).max() < tolerance + 1e-5  # 1e-5: of the table
        assert np.all(np.diff(found.depth, axis=1) >= 0) and np.diff(found.times).max() <= 1
        counts.append(len(found.times))
    assert counts[0] < counts[1] < counts[2]


def test_a_rate_that_grows_faster_than_the_pressure() -> None:
    """p (1 + 3 p), and thirty times it, too steep for a step of 1; a finer tolerance is the reference."""
    for factor in (1.0, 30.0):

        def rate(p, factor=factor):
            return factor * p * (1 + 3 * p)

        found, fine = (evolve(TABLE, FORCE, 3.0 / factor, rate, tolerance=t) for t in (1e-4, 1e-6))
        assert np.all(np.diff(found.depth, axis=1) >= 0)
        assert np.abs(found.depth[-1] - fine.depth[-1]).max() < 1e-4
    same = evolve(TABLE, FORCE, 3.0, lambda p: p)
    assert np.array_equal(same.depth, evolve(TABLE, FORCE, 3.0).depth)


def test_a_rate_that_jumps_is_refused() -> None:
    with pytest.raises(NotConverged, match="continuous"):
        evolve(TABLE, FORCE, 3.0, lambda p: np.where(p > 0.2, 1e3, 0.0))


def test_coefficients_are_converted() -> None:
    """Archard's volume K F s / H is I_W mu F s; Fleischer's energy density is 1 / I_W."""
    K, hardness, mu, force, way = 1e-4, 2e9, 0.3, 50.0, 1e3
    coefficient = from_archard(K, hardness, mu)
    assert coefficient * mu * force * way == pytest.approx(K * force * way / hardness, rel=1e-15)
    assert from_energy_density(1 / coefficient) == pytest.approx(coefficient, rel=1e-15)


C, R, A = 2.4e8, 12e-6, 1e-5


def test_the_loop_wears_off_what_the_friction_does() -> None:
    """Fig. 3.9-4 in 20 rounds: volume = I_W times work; area and stiffness grow, the peak pressure falls."""
    force = FORCE * C * R
    t = np.linspace(0, 400.0, 21)
    found = run_in(Rough(C, R, Polynomial()), Coulomb(0.3), 2e-14, A, force, 0.5, t)
    assert found.power == pytest.approx(np.full(21, 0.3 * force * 0.5))
    assert found.worn[-1] == pytest.approx(2e-14 * found.power[0] * 400)
    mean_depth = [R * np.trapezoid(np.asarray(law.heights.x), np.asarray(law.heights.area_at)) for law in found.laws]
    assert A * (mean_depth[-1] - mean_depth[0]) == pytest.approx(found.worn[-1], rel=1e-3)
    assert np.all(np.diff(found.area) >= 0) and np.all(np.diff(found.peak) <= 0)
    assert np.all(np.diff(found.stiffness) >= 0)
    assert found.area[0] == pytest.approx(0.5 * A, rel=1e-4)  # of a table of 257 strips
    assert found.peak[0] == pytest.approx(0.5 * C * R / A, rel=1e-4)
    once = run_in(Rough(C, R, Polynomial()), Coulomb(0.3), 2e-14, A, force, 0.5, t[[0, -1]])
    assert once.approach[-1] == pytest.approx(found.approach[-1], rel=1e-4)
    assert float(values(found.laws[-1], "force", found.approach[-1])) == pytest.approx(force, rel=1e-9)


def test_points_wear_each_by_its_own_work() -> None:
    """One without work and one without force stay; the others are the course of their own."""
    force, energy = np.array([50.0, 0.0, 50.0, 200.0]), np.array([0.0, 5.0, 4e4, 4e4])
    law = worn_law(Rough(C, R, TABLE), energy, force, 2e-13, A)
    x = np.asarray(law.heights.x)
    assert x.shape == (4, 257)
    assert np.abs(x[:2] - np.asarray(TABLE.x)).max() < 1e-15
    for i in (2, 3):
        time = 2e-13 * energy[i] * C / (A * force[i])
        assert np.array_equal(x[i], course(TABLE, force[i] / (C * R), np.array([time])).depth[0])
    u = np.full(4, 0.7 * R)
    pressed = np.asarray(jax.jit(lambda law, u: law.force(u))(law, u))
    assert pressed[0] == pressed[1] > pressed[2] and pressed[0] > pressed[3]
    again = worn_law(law, energy, force, 2e-13, A)
    assert np.asarray(again.heights.x).shape == (4, 257) and np.all(np.asarray(again.heights.x)[2:] >= x[2:])


def test_a_vibrating_contact_wears_off_its_own_dissipation() -> None:
    """Three points slide to and fro, wear, slide again: the volume is I_W times the work of `history`, point by point.
    With the approach held, force and work fall from block to block."""
    approach, turns = np.array([0.6, 0.8, 1.1]) * R, 2 * np.pi * np.arange(129) / 64
    u = np.stack(
        [np.tile(approach, (129, 1)), 20e-6 * np.sin(turns)[:, None] * np.ones(3), np.zeros((129, 3))], axis=-1
    )
    law = PointContact(Rough(C, R, TABLE), Coulomb(value(0.3)), value(0.9e8))
    normal, coefficient, blocks = Rough(C, R, TABLE), 2e-14, []
    for _ in range(3):
        done = jax.tree.map(np.asarray, history(replace(law, normal=normal), u, 1e-4))
        energy, force = 5e3 * done.dissipated[-1], done.force[-1, :, 0]
        after = worn_law(normal, energy, force, coefficient, A)
        blocks.append((energy, _mean_depth(after) - _mean_depth(normal)))
        normal = after
    for energy, gone in blocks:
        assert np.all(energy > 0) and np.allclose(A * R * gone, coefficient * energy, rtol=5e-3)
    assert np.all(np.diff([energy for energy, _ in blocks], axis=0) < 0)


def _mean_depth(normal):
    return np.trapezoid(np.asarray(normal.heights.x), np.asarray(normal.heights.area_at), axis=-1)


def test_a_surface_worn_flat_is_still_a_law() -> None:
    """All strips at one depth: a stiffness that jumps, but no NaN."""
    found = course(TABLE, 0.5, np.array([60.0]))
    heights = found.heights()
    assert found.roughness[0] < 1e-14
    u = found.approach[0] + np.array([-0.6, -0.5 - 1e-9, -0.4, 0.0])
    assert np.allclose(values(heights, "volume", u), [0, 0, 0.1, 0.5], atol=1e-12)
    assert np.all(np.isfinite(values(heights, "area", u)))
    assert np.array_equal(summed(found.depth[0], found.share).x, heights.x)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: course(TABLE, 0.0, np.array([1.0])), "normal force of 0; it must be positive"),
        (lambda: course(TABLE, np.nan, np.array([1.0])), "normal force of nan"),
        (lambda: course(TABLE, 1.0, np.array([1.0, 0.5])), "rising numbers from 0"),
        (lambda: course(TABLE, 1.0, np.array([-1.0])), "rising numbers from 0"),
        (lambda: evolve(TABLE, 1.0, 0.0), "both must be positive"),
        (lambda: evolve(TABLE, 1.0, 3.0, step=0.0), "must be positive"),
        (lambda: evolve(TABLE, 1.0, 3.0, step=np.nan), "must be positive"),
        (lambda: evolve(TABLE, 1.0, 9.0, step=1.2), "take one of at most 1, or none"),
        (lambda: from_archard(1e-4, 0.0, 0.3), "hardness of 0"),
        (lambda: from_energy_density(-1.0), "energy density of -1"),
        (lambda: worn_law(Rough(C, R, TABLE), np.array([-1.0]), np.array([1.0]), 1e-14, A), "must be 0 or more"),
        (lambda: run_in(Rough(C, R, TABLE), Coulomb(0.3), 1e-14, A, 1.0, 1.0, np.array([1.0])), "rise from 0"),
    ],
)
def test_wrong_numbers_are_told_in_a_sentence(call, sentence) -> None:
    refused(sentence, call)

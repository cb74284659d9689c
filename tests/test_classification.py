"""What motion it is: Lyapunov exponents that are known, quasi-periodic motion, rebounds that come to rest."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import microslip as ms
from microslip.system.assembly import Assembly
from microslip.time_domain import classification, equations
from microslip.time_domain.classification import Exponent, exponent
from microslip.time_domain.orbit import Orbit
from microslip.time_domain.stepper import Stepper


def of(system: Assembly, Omega: float, settle: int, periods: int, steps: int = 512) -> Exponent:
    """From rest, after a settling."""
    e = equations.of(system, Omega)
    stepper, still = Stepper(e, 2 * np.pi / Omega / steps), np.zeros(len(e.omega2))
    now = stepper.start(still, still)
    for _ in range(settle):
        now = stepper.run(now, np.where(np.arange(64) < 1, steps, 0))[0]
    return exponent(stepper, now, 64, steps // 64, periods)


@pytest.mark.parametrize("damping", [0.1, -0.02])
def test_neighbours_of_a_linear_motion_approach_by_half_its_damping(damping: float) -> None:
    """Every period of the excitation shrinks the separation by the same where it is one of the free vibration; what a
    spring remembers in a slider that holds comes along, else it would pull the neighbours elsewhere."""
    Omega = np.sqrt(4.0 - damping**2 / 4)
    held = ms.structure(1.0, 1.0, damping, force={0: 1.0}, elements=[ms.jenkins(3.0, 1e9)])
    assert of(held, Omega, 0, 40, 2048).value == pytest.approx(-damping / 2, rel=1e-4)


def test_the_exponent_of_an_impact_oscillator_is_that_of_its_multipliers() -> None:
    """The period-one motion against a stop: growth of the variational equation over its period, by SciPy; one
    multiplier leads, so that it is not half the damping."""
    K, gap, damping, Omega, rows = 100.0, 0.5, 0.2, 1.0, [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]

    def alone(t: float, z: np.ndarray) -> tuple[float, float]:
        x, v = z
        return v, math.cos(Omega * t) - x - damping * v - K * max(x - gap, 0.0)

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        A = np.array([[0, 1], [-1 - K * (z[0] > gap), -damping]])
        return np.array([*alone(t, z[:2]), *(A @ z[2:].reshape(2, 2)).ravel()])

    def after(rate: Any, z: Any, periods: int) -> np.ndarray:
        span, within = (0, 2 * np.pi / Omega * periods), {"rtol": 1e-9, "atol": 1e-11}
        return solve_ivp(rate, span, z, max_step=0.02, **within).y[:, -1]

    settled = after(alone, rows[:2], 60)
    again = after(rate, [*settled, *rows[2:]], 1)
    np.testing.assert_allclose(again[:2], settled, atol=1e-6)
    largest = np.abs(np.linalg.eigvals(again[2:].reshape(2, 2))).max()
    hammer = ms.structure(1.0, 1.0, damping, force={0: 1.0}, elements=[ms.stop(K, gap)])
    # both meet the stop in the same step: its slope is missed for half of one
    found = of(hammer, Omega, 40, 20, 2**18)
    known, missed = np.log(largest) / (2 * np.pi / Omega), K * (np.pi / Omega / 2**18) / (2 * np.pi / Omega)
    assert abs(found.value - known) < 2 * missed < 0.01 * abs(known)


def duffing_by_hand(damping: float, push: float, periods: int = 40) -> np.ndarray:
    """(starts,) mean growth 1/s of the variational equation of x'' + damping x' - x + x^3 = push cos t, Runge-Kutta."""
    starts, settle = 320, 30

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        x, v, a, b = z
        return np.array([v, x - x**3 - damping * v + push * np.cos(t), b, (1 - 3 * x * x) * a - damping * b])

    z, h, growth = np.random.default_rng(1).normal(size=(4, starts)), 2 * np.pi / 160, np.zeros(starts)
    for p in range(settle + periods):
        for i in range(160):
            t = i * h
            k1 = rate(t, z)
            k2 = rate(t + h / 2, z + h / 2 * k1)
            k3 = rate(t + h / 2, z + h / 2 * k2)
            z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(t + h, z + h * k3))
        size = np.hypot(z[2], z[3])
        z[2:] /= size
        growth += (p >= settle) * np.log(size)
    return growth / (2 * np.pi * periods)


@pytest.mark.slow
def test_a_chaotic_duffing_oscillator_has_the_exponent_of_its_variational_equation() -> None:
    """And is called chaotic; its interval holds the value, and is not so wide that everything lies in it."""
    duffing = ms.structure(1.0, 1.0, 0.25, force={0: 0.4}, elements=[ms.polynomial({1: -2.0, 3: 1.0})])
    found = ms.integrate(duffing, 1.0, unit="rad/s", settle=100, keep=40, samples=64)
    known = duffing_by_hand(0.25, 0.4).mean()
    assert found.repeats == 0 and found.exponent is not None
    assert abs(found.exponent.value - known) < 1.5 * found.exponent.uncertainty < 0.5 * known
    assert found.said.startswith("chaotic") and "±" in found.said and "impact" not in found.said


def test_free_and_forced_vibration_together_are_quasi_periodic() -> None:
    """Of an undamped oscillator: free vibration at 1 rad/s beside sqrt(2); the same points as 1 - 1 / sqrt(2)."""
    free = ms.structure(1.0, 1.0, 0.0, force={0: 1.0})
    found = ms.integrate(free, np.sqrt(2), unit="rad/s", settle=0, keep=60, samples=64)
    assert classification.second_frequency(found) == pytest.approx(1 - 1 / np.sqrt(2), abs=1e-6)
    assert classification.kind(found) == "quasi-periodic" and found.said.startswith("quasi-periodic")


def test_a_motion_that_settles_is_not_called_chaotic() -> None:
    slow = ms.structure(1.0, 1.0, 0.004, force={0: 1.0})
    found = ms.integrate(slow, 1.4, unit="rad/s", settle=0, keep=40, samples=64)
    assert classification.kind(found) == "settling"


def test_what_goes_away_does_not_come_back() -> None:
    """A free mass under a force, let go with a velocity: it goes on by V T in every period,
    however far it has come; let go at rest it swings in its place. So do many starts."""
    free = ms.structure(1.0, 0.0, force={0: 1.0}, output=0)
    how = {"unit": "rad/s", "keep": 8, "samples": 16}
    for settle in (0, 3000):
        away = ms.integrate(free, 1.0, settle=settle, start={"velocity": {0: 0.1}}, **how)
        assert away.repeats == 0 and away.exponent is None and classification.kind(away) == "away"
        assert away.said == "goes away from where it was, else comes back after 1 period"
    assert ms.integrate(free, 1.0, settle=0, start="rest", **how).repeats == 1
    many = ms.integrate_many(free, 1.0, [[0.0], [0.0]], [[0.1], [0.0]], unit="rad/s", settle=3000, keep=8)
    assert many.repeats.tolist() == [0, 1]


def test_a_large_load_that_is_steady_hides_no_motion() -> None:
    """Two masses apart, one that vibrates at two frequencies and one that a steady load holds ten
    thousand times further away: within a thousandth of that the first had come back. What rests,
    comes back."""
    two = ms.structure(np.eye(2), np.diag([1.0, 2.0]), force={0: 1.0}, steady={1: 2e4}, output=0)
    found = ms.integrate(two, np.sqrt(2), unit="rad/s", settle=0, keep=60, samples=16)
    assert found.repeats == 0 and classification.kind(found) == "quasi-periodic"
    still = ms.structure(1.0, 1.0, 0.1, steady={0: 1.0}, output=0)
    assert ms.integrate(still, 1.0, unit="rad/s", settle=0, keep=8, samples=16).repeats == 1


def test_memory_in_whole_numbers_is_said_to_have_no_exponent() -> None:
    e = equations.of(ms.structure(1.0, 1.0, 0.1, force={0: 1.0}, elements=[ms.jenkins(1.0, 0.2)]), 1.0)
    stepper = Stepper(e, 0.01)
    now = stepper.start(np.zeros(1), np.zeros(1))
    counting = now._replace(held=now.held._replace(states=(jnp.zeros(1, int),)))
    found = exponent(stepper, counting, 16, 4, 20)
    assert np.isnan(found.value) and "whole numbers" in found.message


def bouncing(flights: np.ndarray, contact: float, stays: float) -> Orbit:
    """An orbit whose only contact closes after flights and stays closed after the last."""
    made = ms.integrate(
        ms.structure(1.0, 1.0, 0.1, force={0: 1.0}, elements=[ms.stop(1.0, 9.0)]), 1.0, settle=0, keep=2
    )
    opens = np.cumsum([0.0, *(flights[:-1] + contact)])
    closes = opens + flights
    rows = [[t, 0, 0] for t in closes] + [[t, 0, 1] for t in (*opens, closes[-1] + stays)]
    return replace(made, arrays={**made.arrays, "event": np.array(sorted(rows))})


def test_rebounds_that_come_to_rest_are_found_and_counted() -> None:
    """Flights that shrink by 0.7 and then rest; not where the last contact is as short as the others, or flights grow
    again."""
    shrinking = 0.1 * 0.7 ** np.arange(9)
    (found,) = classification.chatter(bouncing(shrinking, 0.001, 0.05), 0)
    assert found.impacts == 9 and found.flight == pytest.approx(shrinking[-1]) and found.stays == pytest.approx(0.05)
    assert not classification.chatter(bouncing(shrinking, 0.001, 0.0015), 0)
    assert not classification.chatter(bouncing(shrinking[::-1], 0.001, 0.05), 0)


def test_the_area_of_a_hysteresis_loop_is_the_energy_lost_in_the_steps() -> None:
    """And that of a slider under a given swing: 4 F_H (U - F_H / k), its picture's number."""
    k, held = 1.0, 0.2
    slider = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(k, held)])
    found = ms.integrate(slider, 1.0, unit="rad/s", settle=150, keep=4, samples=1024, steps=4096)
    (area,) = classification.loops(found)
    assert area == pytest.approx(classification.lost(found), rel=1e-4)
    assert area == pytest.approx(4 * held * (0.5 * np.ptp(found.y[0]) - held / k), rel=1e-4)
    assert found.slips == 2 and classification.rubs(found, 0) and found.said.endswith("2 slips in it")


def test_what_happens_a_period_is_counted_over_whole_repetitions() -> None:
    """Of an undamped oscillator that comes back after three periods of its excitation, eight kept:
    a loss of 1 J and an impact at 0.6 of every third period are 1/3 of them a period, wherever
    the periods that are kept begin."""
    wall = ms.stop(1.0, 9.0)
    free = ms.structure(1.0, 1.0, 0.0, force={0: 1.0}, elements=[wall], output=0)
    made = ms.integrate(
        free, 3.0, unit="rad/s", settle=0, keep=8, samples=16, start={"displacement": {0: 1.0}}
    )
    assert made.repeats == 3
    for first in range(3):
        at = np.arange(first, 8, 3) + 0.6
        taken = np.searchsorted(at, made.time / made.period).astype(float)
        events = np.array([[t * made.period, 0, 0] for t in at])
        found = replace(made, arrays={**made.arrays, "energy_lost": taken, "event": events})
        assert classification.lost(found) == pytest.approx(1 / 3) == found.impacts


def test_a_motion_that_drifts_has_not_come_to_rest() -> None:
    """At the resonance of a damping ratio of 0.05 %: what is left of the start falls by 0.3 % a period, so that one
    period is like the next within 0.1 % long before the motion is what it will be."""
    slow = ms.structure(1.0, 1.0, 0.001, force={0: 0.001}, output=0)
    early, late = (ms.integrate(slow, 1.0, unit="rad/s", settle=n, keep=20, samples=16) for n in (500, 3000))
    assert early.repeats == late.repeats == 1
    left = np.exp(-0.0005 * 2 * np.pi * np.array([511.0, 520.0]))
    assert early.drifts == pytest.approx((left[0] - left[1]) / (1 - left[1]), rel=0.01) and late.drifts < 1e-5
    assert classification.kind(early) == "settling" and early.said.startswith("still settles, by 0.")
    assert classification.kind(late) == "periodic"

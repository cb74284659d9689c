"""Steps of fourth order, the error of a whole run, and many starts at once."""

from __future__ import annotations

import numpy as np
from refusals import refused
from test_time_domain import BOOK, hitting

import microslip as ms
from microslip.time_domain import equations, orbit
from microslip.time_domain.stepper import Stepper

G, DROP, K = 9.81, 0.1, 4e4
"""m/s2, m, N/m of 1 kg that falls on a linear spring."""


def bounced(t: np.ndarray) -> np.ndarray:
    """m, downwards from where it was let go: parabolas, and arcs of a sine about the static deflection."""
    speed, w = np.sqrt(2 * G * DROP), np.sqrt(K)
    fall, pressed = speed / G, 2 * (np.pi - np.arctan(speed * w / G)) / w
    t = np.mod(t, 2 * fall + pressed)
    inside, up = t - fall, t - 2 * fall - pressed
    arc = DROP + G / K * (1 - np.cos(w * inside)) + speed / w * np.sin(w * inside)
    return np.where(inside < 0, 0.5 * G * t**2, np.where(inside < pressed, arc, 0.5 * G * up**2))


def test_a_ball_bounces_on_a_spring_as_its_closed_form_in_fourth_order() -> None:
    """Force with a kink at either end of each impact, met within a step; second order without its halvings."""
    ball, errors = ms.structure(1.0, 0.0, steady={0: G}, elements=[ms.stop(K, DROP)], output=0), []
    for steps in (256, 512, 1024, 2048, 4096):
        found = ms.integrate(ball, 1.0, settle=0, keep=2, samples=64, steps=steps, start="rest")
        errors.append(np.abs(found.y[0] - bounced(found.time)).max() / DROP)
        assert found.balance < 1e-9
    order = -np.polyfit(np.arange(len(errors)), np.log2(errors), 1)[0]
    assert errors[-1] < 1e-7 and 3.5 < order < 4.6
    closes = found.times("closes")
    fall, pressed = np.sqrt(2 * DROP / G), 2 * (np.pi - np.arctan(np.sqrt(2 * G * DROP * K) / G)) / np.sqrt(K)
    np.testing.assert_allclose(closes, fall + (2 * fall + pressed) * np.arange(len(closes)), atol=1e-7)


def test_laws_that_remember_by_their_steps_alone_are_stepped_in_second_order() -> None:
    slider = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.2)])
    hammer = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.stop(10.0, 0.2)])
    for system, fine in ((slider, False), (hammer, True)):
        assert bool(Stepper(equations.of(system, 1.0), 0.01).options.halvings) == fine


def test_the_estimated_error_is_that_of_the_whole_run() -> None:
    """The impact oscillator of section 4.2 over 200 periods, where errors live for many of them."""
    e = equations.of(hitting(BOOK), 64.32)
    exact = orbit.run(e, 199, 1, 64, 4096, "rest").y[0]
    found = orbit.run(e, 199, 1, 64, 512, "rest")
    true = np.abs(found.y[0] - exact).max() / np.abs(exact).max()
    assert 0.2 * true < found.error < 20 * true


def test_the_error_of_a_chaotic_motion_says_that_it_cannot_be_followed() -> None:
    """A pendulum of a hardening spring with two wells; known to be chaotic (damping 0.25, push 0.4)."""
    duffing = ms.structure(1.0, -1.0, 0.25, force={0: 0.4}, elements=[ms.polynomial({3: 1.0})])
    found = ms.integrate(duffing, 1.0, unit="rad/s", settle=2000, keep=10, steps=512, start="rest")
    assert found.error == 1.0 and any("this motion is one of those possible" in text for text in found.messages)


def between() -> object:
    """A buckled beam's first mode: two wells, whose vibrations remain in them."""
    return ms.structure(1.0, -1.0, 0.3, force={0: 0.05}, elements=[ms.polynomial({3: 1.0})], output=0)


def test_many_starts_reach_what_each_reaches_alone_whatever_its_neighbours() -> None:
    rng = np.random.default_rng(1)
    x, v = rng.uniform(-1.5, 1.5, (2, 12, 1))
    how = {"unit": "rad/s", "settle": 40, "keep": 4, "steps": 512}
    found = ms.integrate_many(between(), 1.0, x, v, **how)
    back = ms.integrate_many(between(), 1.0, x[::-1], v[::-1], **how)
    np.testing.assert_array_equal(found.q, back.q[::-1])
    assert set(found.attractor) == {0, 1} and (found.repeats == 1).all()
    side = np.sign(found.y[:, -1, 0])
    assert len(set(side[found.attractor == 0])) == len(set(side[found.attractor == 1])) == 1
    few = ms.integrate_many(between(), 1.0, x[:1], v[:1], **how)
    np.testing.assert_allclose(few.q[0], found.q[0], atol=1e-12)


def test_starts_that_fit_no_coordinate_are_refused_and_infinite_ones_are_told() -> None:
    refused("must both be (n, 1)", ms.integrate_many, between(), 1.0, *np.zeros((2, 3, 2)))
    growing = ms.structure(1.0, 1.0, -1.0, force={0: 1.0}, output=0)
    found = ms.integrate_many(growing, 1.0, [[1.0]], [[0.0]], unit="rad/s", settle=300, keep=2)
    assert found.attractor[0] < 0 and "diverge" in repr(found)


def test_a_contact_without_friction_remembers_nothing() -> None:
    """Its steps are as long as the motion allows: a force that nobody feels may not grow in them."""
    u, v = np.array([[1e-6, 0.0, 0.0]]), np.array([[0.0, 1.0, 2.0]])
    force, rate = BOOK.law.rates(u, v, np.full((2, 1), 1e-3), 0.0, 0.0)
    assert force[0, 0] > 0 and not np.any(rate) and not np.any(force[0, 1:])

"""Set-valued contacts in time, against closed forms and against their regularised limit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import microslip as ms
from microslip.contact.friction import StaticSliding
from microslip.contact.law import value
from microslip.contact.normal import Preload
from microslip.contact.set_valued import SetValued
from microslip.errors import UserError
from microslip.time_domain import equations
from microslip.time_domain.inclusion import meets, solve
from microslip.time_domain.stepper import Stepper

GRAVITY, HEIGHT, RESTITUTION = 9.81, 0.1, 0.8


def test_a_ball_comes_to_rest_after_infinitely_many_impacts() -> None:
    """Dropped on a rigid floor: impact k is t_0 (1 + 2 (e + ... + e^k)), rest t_0 (1 + e) / (1 - e), each to the step;
    nothing sinks in, and all of its energy is lost in impacts."""
    floor = ms.stop(math.inf, HEIGHT, restitution=RESTITUTION)
    ball = equations.of(ms.structure(1.0, 0.0, steady={0: GRAVITY}, elements=[floor]), 2 * np.pi)
    first = math.sqrt(2 * HEIGHT / GRAVITY)
    impacts = first * (1 + 2 * np.append(0, np.cumsum(RESTITUTION ** np.arange(1, 20))))
    rest, errors = first * (1 + RESTITUTION) / (1 - RESTITUTION), []
    for tau in (1e-4, 2.5e-5):
        s = Stepper(ball, tau)
        _, seen, events, _ = s.run(s.start(np.zeros(1), np.zeros(1)), np.full(100, round(0.02 / tau)))
        found = events[events[:, 2] == 0, 0]
        errors.append(max(np.abs(found[:20] - impacts).max(), abs(found[-1] - rest)))
        assert abs(seen.q[-1, 0] - HEIGHT) < 1e-7 and abs(seen.q_dot[-1, 0]) < 1e-9
        given, damped, done, lost, *_ = seen.energy[-1]
        assert seen.mechanical[-1] == pytest.approx(given - damped - done, abs=1e-9)
        assert lost == pytest.approx(GRAVITY * HEIGHT, rel=1e-6)
    assert errors[1] < 0.4 * errors[0] < 4e-4


def test_dry_friction_takes_the_same_from_every_half_swing() -> None:
    """x'' + x + 0.1 Sgn(x') = 0 from 1.05: turns at -0.85, 0.65, ..., then sticks at -0.05; the energy between is
    what friction took. Where the step does not meet the turn, the error is of second order."""
    swing = equations.of(ms.structure(1.0, 1.0, output=[0], elements=[ms.friction(0.1)]), 1.0)
    s = Stepper(swing, 2 * np.pi / 1000)
    now, seen, events, _ = s.run(s.start(np.array([1.05]), np.zeros(1)), np.full(8, 500))
    np.testing.assert_allclose(seen.q[:, 0], [-0.85, 0.65, -0.45, 0.25, -0.05, -0.05, -0.05, -0.05], atol=5e-6)
    assert events[-1, 2] == 3 and events[-1, 0] == pytest.approx(5 * np.pi, abs=0.01)
    assert seen.energy[-1, 3] == pytest.approx(0.5 * (1.05**2 - 0.05**2), rel=1e-6)
    assert float(now.worst) < 1e-15


def rod(n: int) -> equations.Equations:
    """A rod of length, mass and stiffness one, n elastic modes and the residual flexibility of the others, before a
    rigid wall."""
    k = np.arange(n + 1)
    weights = np.where(k > 0, np.sqrt(2.0), 1.0)
    wall = ms.stop(math.inf, 0.0, at=weights)
    found = equations.of(ms.structure(np.eye(n + 1), np.diag((k * np.pi) ** 2), output=[0], elements=[wall]), np.pi)
    return replace(found, R=np.array([[2 / 6 - 2 * (1 / (k[1:] * np.pi) ** 2).sum()]]))


def test_an_elastic_rod_leaves_a_wall_as_fast_as_it_came() -> None:
    """Saint-Venant's rod with speed one: pressed with EA / c for 2 L / c, then off with speed one and hardly a
    vibration; without a law of impact, and no energy is lost."""
    drift = []
    for steps in (2000, 4000):
        s, rod_ = Stepper(rod(40), 4.0 / steps), rod(40)
        start = np.zeros(41), np.eye(41)[0]
        now, seen, _, _ = s.run(s.start(*start), np.full(steps, 1))
        pressed = seen.time[seen.force[:, 0] > 0.1]
        assert pressed[-1] - pressed[0] == pytest.approx(2.0, abs=0.03)
        assert np.median(seen.force[(seen.time > 0.3) & (seen.time < 1.7), 0]) == pytest.approx(1.0, rel=0.02)
        assert seen.q_dot[-1, 0] == pytest.approx(-1.0, abs=0.02)
        energy = seen.mechanical + 0.5 * rod_.R[0, 0] * seen.force[:, 0] ** 2
        drift.append(np.abs(energy - energy[0]).max() / energy[0])
        assert float(now.worst) < 1e-12
    assert drift[1] < 0.7 * drift[0] < 0.02


@pytest.mark.slow
def test_a_stiffer_and_stiffer_jenkins_element_becomes_set_valued() -> None:
    """The difference of both motions falls as one over the stiffness of the spring."""

    def moved(element: ms.Element) -> np.ndarray:
        swing = ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[element])
        return ms.integrate(swing, 0.5, unit="rad/s", settle=20, keep=1, samples=64, steps=16384).y[0]

    rigid = moved(ms.friction(0.2))
    away = [np.abs(moved(ms.jenkins(k, 0.2)) - rigid).max() for k in (300.0, 3000.0)]
    assert away[1] < 0.2 * away[0] < 2e-3 * np.abs(rigid).max()


def test_points_that_yield_together_stick_slip_and_part_within_their_cones() -> None:
    """Eight points on a random elastic body: the conditions themselves, and slip is along the force."""
    rng = np.random.default_rng(5)
    B = rng.normal(size=(24, 30))
    A, w_0, mu = B @ B.T / 30 + 0.1 * np.eye(24), rng.normal(size=(8, 3)), 0.4
    f, w, missed = (np.asarray(x) for x in solve(
        meets(A), w_0, lambda way: mu + 0 * way, np.full(8, np.nan), np.zeros((8, 3))
    ))  # fmt: skip
    assert missed < 1e-11
    np.testing.assert_allclose(w, w_0 - (A @ f.ravel()).reshape(8, 3), atol=1e-12)
    assert (f[:, 0] >= 0).all() and (w[:, 0] < 1e-10).all() and np.abs(f[:, 0] * w[:, 0]).max() < 1e-10
    held, way = np.linalg.norm(f[:, 1:], axis=1), np.linalg.norm(w[:, 1:], axis=1)
    slides = (way > 1e-9) & (f[:, 0] > 0)
    assert (held <= mu * f[:, 0] + 1e-10).all() and slides.any() and (f[:, 0] == 0).any()
    np.testing.assert_allclose(f[slides, 1:], (mu * f[slides, 0] / way[slides])[:, None] * w[slides, 1:], atol=1e-8)


def test_stick_and_slip_on_a_belt_of_the_massless_return_map() -> None:
    """A mass held at rest by static friction until its spring's force is 0.3 N, and at 0.2 N from there: it swings once
    about the sliding force and sticks again at 0.1 N, half a period later."""
    law = SetValued(StaticSliding(value(1.5), value(1.0)), value(0.0), value(0.0), Preload(value(0.2)))
    swing = equations.of(ms.structure(1.0, 1.0, output=[0], elements=[ms.Element(law, 0)]), 1.0)
    s = Stepper(swing, np.pi / 2000)
    for begin, end in ((0.29, 0.29), (0.31, 0.09)):
        _, seen, _, _ = s.run(s.start(np.array([begin]), np.zeros(1)), np.full(4, 2000))
        np.testing.assert_allclose(seen.q[1:, 0], end, atol=2e-4)


def test_what_cannot_be_is_refused() -> None:
    rigid = ms.structure(1.0, 1.0, force={0: 1.0}, elements=[ms.friction(0.1)])
    with pytest.raises(UserError, match="only a motion in time"):
        ms.harmonic_response(rigid, [0.1])
    ball = ms.structure(1.0, 0.0, steady={0: GRAVITY}, elements=[ms.stop(math.inf, HEIGHT)])
    with pytest.raises(UserError, match='begin from "rest"'):
        ms.integrate(ball, 1.0)
    with pytest.raises(UserError, match="cannot be integrated"):
        ms.integrate(ball, 1.0, start="rest", method="reference")
    with pytest.raises(UserError, match="only a rigid stop"):
        ms.stop(1e5, 0.0, restitution=0.5)
    with pytest.raises(UserError, match="one side"):
        ms.stop(math.inf, 0.1, both=True)
    with pytest.raises(UserError, match="restitution"):
        ms.stop(math.inf, 0.1, restitution=1.5)
    with pytest.raises(UserError, match="stand alone"):
        yields = rod(3)
        more = equations.of(ms.structure(np.eye(4), np.eye(4), elements=[ms.friction(1.0), ms.jenkins(1.0, 1.0)]), 1.0)
        Stepper(replace(more, R=0.1 * np.eye(2)), 0.1).bodies  # noqa: B018
    assert yields.R[0, 0] > 0

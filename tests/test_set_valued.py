"""Set-valued contacts in time, against closed forms and against their regularised limit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from refusals import refused

import microslip as ms
from microslip.contact.friction import Coulomb, StaticSliding
from microslip.contact.law import value
from microslip.contact.normal import Penalty, Preload
from microslip.contact.point import PointContact
from microslip.contact.portion import portion
from microslip.contact.set_valued import SetValued
from microslip.errors import UserError
from microslip.system.ground import Ground
from microslip.time_domain import equations, orbit
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
        _, seen, events, _ = s.run(s.start(np.zeros(1), np.zeros(1)), np.full(64, round(0.032 / tau)))
        found = events[events[:, 2] == 0, 0]
        errors.append(max(np.abs(found[:20] - impacts).max(), abs(found[-1] - rest)))
        assert abs(seen.q[-1, 0] - HEIGHT) < 1e-7 and abs(seen.q_dot[-1, 0]) < 1e-9
        given, damped, done, lost, *_ = seen.energy[-1]
        assert seen.mechanical[-1] == pytest.approx(given - damped - done, abs=1e-9)
        assert lost == pytest.approx(GRAVITY * HEIGHT, rel=1e-6)
    assert errors[1] < 0.4 * errors[0] < 4e-4


@pytest.mark.parametrize("restitution", [0.0, 0.01, 0.5])
def test_what_rests_at_a_rigid_stop_is_where_the_stop_is(restitution: float) -> None:
    """An impact is found behind the stop, by less than the way of a step. Pressed by 1 N from
    there the mass stayed where it was found, 9 % too far; it comes out so slowly that what leaves
    a wall has the speed that restitution leaves it, in first order of the step."""
    errors = []
    for steps in (256, 1024):
        how = {"unit": "rad/s", "settle": 0, "samples": 64, "steps": steps}
        wall = ms.stop(math.inf, 0.1, restitution=restitution)
        pressed = ms.structure(1.0, 0.0, steady={0: 1.0}, output=0, elements=[wall])
        found = ms.integrate(pressed, 1.0, keep=8, start="rest", **how)
        behind = found.y.max() - 0.1
        step = 2 * math.pi / steps
        assert 0 < behind < math.sqrt(0.2) * step and 0 <= found.y[0, -1] - 0.1 < 1.01 * step**2
        assert found.balance < 1e-12 and found.energy["lost"][-1] == pytest.approx(found.y[0, -1], rel=1e-6)
        thrown = ms.structure(1.0, 0.0, output=0, elements=[wall])
        away = ms.integrate(thrown, 1.0, keep=1, start={"velocity": {0: 1.0}}, **how).v[0, -1]
        errors.append(abs(away + restitution))
    assert errors[1] - 1e-12 < 0.4 * errors[0] < 0.02


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


def rod(n: int) -> equations.MotionEquations:
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
    drift, rod_ = [], rod(40)
    for steps in (2000, 4000):
        s = Stepper(rod_, 4.0 / steps)
        now, seen, _, _ = s.run(s.start(np.zeros(41), np.eye(41)[0]), np.full(2000, steps // 2000))
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
    refused("only a motion in time", ms.harmonic_response, rigid, [0.1])
    ball = ms.structure(1.0, 0.0, steady={0: GRAVITY}, elements=[ms.stop(math.inf, HEIGHT)])
    refused('begin from "rest"', ms.integrate, ball, 1.0)
    refused("only a rigid stop", ms.stop, 1e5, 0.0, restitution=0.5)
    refused("one side", ms.stop, math.inf, 0.1, both=True)
    refused("restitution", ms.stop, math.inf, 0.1, restitution=1.5)
    with pytest.raises(UserError, match="stand alone"):
        yields = rod(3)
        more = equations.of(ms.structure(np.eye(4), np.eye(4), elements=[ms.friction(1.0), ms.jenkins(1.0, 1.0)]), 1.0)
        Stepper(replace(more, R=0.1 * np.eye(2)), 0.1).bodies  # noqa: B018
    assert yields.R[0, 0] > 0


def test_nothing_begins_behind_what_is_rigid() -> None:
    """A stop with a negative gap, or bodies that are let go behind one: they stayed there, as if
    it were not."""
    for gap, start in ((-0.1, "rest"), (-0.1, "static"), (0.1, {"displacement": {0: 0.5}})):
        swing = ms.structure(1.0, 1.0, 0.1, force={0: 0.2}, elements=[ms.stop(math.inf, gap, restitution=0.5)])
        behind = f"start: begins {0.1 if gap < 0 else 0.4} m behind stop 1"
        refused(behind, ms.integrate, swing, 0.2, start=start)
    refused("0.4 m behind stop 1", ms.integrate_many, swing, 0.2, [[0.0], [0.5]], [[0.0], [0.0]])
    ms.integrate(swing, 0.2, settle=0, keep=1, samples=64, start={"displacement": {0: 0.1}})  # where it touches


# ground that moves ---------------------------------------------------------------------------------------------------


def test_a_block_on_a_belt_sticks_at_its_velocity_and_slips_as_an_oscillator() -> None:
    """Held by 0.3 N at rest and 0.2 N sliding, on a belt of 0.01 m/s, m = k = 1: it goes with the belt to 0.3 m, swings
    about 0.2 m with the amplitude that this and the belt's velocity give, and sticks at 0.1 m again, pi + 2 arctan(V /
    0.1) later. The belt gives V times the friction, whatever is lost in sliding or stored in the spring."""
    V, static, sliding = 0.01, 0.3, 0.2
    belt = ms.structure(1.0, 1.0, output=0, elements=[ms.friction(sliding, static=static, velocity=V)])
    errors = []
    for steps in (1024, 4096):
        found = ms.integrate(belt, 0.2, unit="rad/s", settle=0, keep=4, samples=512, steps=steps)
        t, y, v, force = found.time, found.y[0], found.v[0], found.force[0]
        slips, sticks = found.times("slips"), found.times("sticks")[1:]
        first = t < slips[0] - 0.1
        np.testing.assert_allclose(np.diff(y[first]), V * np.diff(t[first]), rtol=1e-9)
        np.testing.assert_allclose(force[first], -y[first], rtol=(40 / steps) ** 2)
        size, slipping = math.hypot(static - sliding, V), math.pi + 2 * math.atan(V / (static - sliding))
        swing = (t > slips[0] + 0.1) & (t < sticks[0] - 0.1)
        phase = t[swing] - slips[0] - math.atan(V / (static - sliding))
        bounds = [np.abs(y[swing] - sliding - size * np.cos(phase)).max(), abs(v.min() + size)]
        bounds += [np.abs(sticks[:3] - slips[:3] - slipping).max()]
        bounds += [np.abs(np.diff(slips) - slipping - 2 * (static - sliding) / V).max()]
        errors.append(max(bounds))
        given = -V * np.cumsum(0.5 * (force[1:] + force[:-1])) * (t[1] - t[0])
        moved = found.energy["ground"]
        np.testing.assert_allclose(moved[1:] - moved[0], given, atol=3e-3 * moved[-1])
        assert found.drift < 1e-12 and found.balance < 1e-10
        assert found.energy["mechanical"][-1] == pytest.approx(moved[-1] - found.energy["lost"][-1], rel=1e-9)
    assert errors[1] < 0.5 * errors[0] < 0.05


def test_sliding_that_saws_is_told() -> None:
    """A point without mass that slips to less than it stuck by sticks again at once: over a belt
    its friction hangs on the step, which is said; not of what is set-valued, nor where both values
    are one."""
    for static, told in ((0.3, 1), (0.2, 0)):
        law = PointContact(Preload(value(1.0)), StaticSliding(value(static), value(0.2)), value(100.0))
        shoe = ms.Element(portion(law, value(1.0)), 0, name="shoe", velocity=0.5)
        belt = ms.structure(1.0, 1.0, 0.2, output=0, elements=[shoe])
        found = ms.integrate(belt, 0.2, unit="rad/s", settle=0, keep=1, samples=64)
        assert sum("point without mass" in said and "shoe" in said for said in found.messages) == told
    belt = ms.structure(1.0, 1.0, output=0, elements=[ms.friction(0.2, static=0.3, velocity=0.5)])
    assert not ms.integrate(belt, 0.2, unit="rad/s", settle=0, keep=1, samples=64).messages


def rubbing_block(law: object, ground: Ground | None, force: float = 0.0) -> equations.MotionEquations:
    """A mass on a spring along the ground, free along the normal, pressed on it by 14 N."""
    from test_ground import rubbing

    return equations.of(rubbing(law, ground, force), 20.0)


def test_a_blade_rubs_a_casing_and_is_taken_along() -> None:
    """Pressed on a round casing that passes: it slides under mu F_N, which its spring holds in the mean, and swings
    about that undamped as Coulomb's friction leaves it; the casing gives mu F_N V."""
    from test_ground import NORMAL, OMEGA, STIFFNESS

    mu, V = 0.3, 1.0
    found = orbit.run(rubbing_block(SetValued(Coulomb(value(mu)), value(0.0), value(0.0)), Ground(V)), 0, 2, 64, 4096)
    held = mu * NORMAL / STIFFNESS
    np.testing.assert_allclose(found.y[0], held * (1 - np.cos(OMEGA * found.time)), atol=1e-3 * held)
    np.testing.assert_allclose(found.force[1], -mu * NORMAL, rtol=1e-9)
    given = np.diff(found.energy["ground"]) / np.diff(found.time)
    np.testing.assert_allclose(given, mu * NORMAL * V, rtol=1e-9)
    assert found.drift < 1e-12 and found.balance < 1e-10


@pytest.mark.parametrize("ground", [None, Ground(0.5)])
def test_what_rests_is_pressed_from_the_first_step_on(ground: Ground | None) -> None:
    """By its preload, whatever rounding makes of a place that it does not leave."""
    e = rubbing_block(SetValued(Coulomb(value(0.3)), value(0.0), value(0.0)), ground)
    s = Stepper(e, 2 * np.pi / 20 / 512)
    _, seen, events, _ = s.run(s.start(0 * e.omega2, 0 * e.omega2), np.ones(64, int))
    np.testing.assert_allclose(seen.force[:, 0], 14.0, rtol=1e-9)
    assert not (events[:, 2] < 2).any()


@pytest.mark.slow
@pytest.mark.parametrize("pushes", [True, False])
def test_a_casing_that_is_not_round_is_followed(pushes: bool) -> None:
    """The blade keeps to the waves without a gap, and what it does is the limit of stiffer and stiffer springs in the
    place of the rigid contact; what the casing gives is what is lost, stored and left in the bodies."""
    begins_flat = ((1e-5, 2.5e-3, 0.5 * math.pi), (1e-5, 4e-3, -0.5 * math.pi))
    wave = Ground(0.02, 0.0, begins_flat, pushes)

    def moved(law: object) -> orbit.Orbit:
        return orbit.run(rubbing_block(law, wave, 3.0), 0, 2, 128, 32768, "rest")

    rigid = moved(SetValued(Coulomb(value(0.3)), value(0.0), value(0.0)))
    assert (rigid.force[0] > 0).all() and rigid.drift < 1e-8  # forces to 1e-9 of the largest
    assert rigid.balance < 1e-10
    passed = rigid.y[0] - 0.02 * rigid.time
    height = sum(a * np.sin(2 * np.pi / length * passed + phase) for a, length, phase in wave.waves)
    assert np.ptp(rigid.y[1] + height) < 1e-4 * np.ptp(height)
    away = []
    for k in (1e6, 1e7):
        soft = moved(PointContact(Penalty(value(k)), Coulomb(value(0.3)), value(k)))
        away.append(np.abs(soft.y[0] - rigid.y[0]).max() / np.abs(rigid.y[0]).max())
    assert away[1] < 0.3 * away[0] < 0.05


@pytest.mark.slow
def test_a_rigid_contact_on_a_body_that_yields_is_one_with_springs() -> None:
    """What yields beside the modes, R, is in series with the contact: the rigid one on a body that yields moves as one
    whose springs are 1 / R, on wavy ground that passes; energies too."""
    wave, k = Ground(0.02, 0.0, ((1e-5, 2.5e-3, 0.0),)), 1e6
    rigid = rubbing_block(SetValued(Coulomb(value(0.3)), value(0.0), value(0.0)), wave, 3.0)
    rigid = replace(rigid, R=np.diag([1 / k, 1 / k, 1 / k, 0, 0, 0]))
    sprung = rubbing_block(PointContact(Penalty(value(k)), Coulomb(value(0.3)), value(k)), wave, 3.0)
    one, other = (orbit.run(e, 0, 1, 64, 8192, "rest") for e in (rigid, sprung))
    np.testing.assert_allclose(one.y, other.y, atol=2e-3 * np.abs(other.y).max())
    np.testing.assert_allclose(one.energy["ground"], other.energy["ground"], atol=1e-2 * other.energy["ground"].max())
    assert one.balance < 1e-9 and one.drift < 1e-2

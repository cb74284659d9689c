"""The massless point contact element: closed forms, friction against the slip, separation, damping, and wrong laws."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import test_contact_laws as contract
from ellipses import exact
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from wrong_laws import BOX, JUMP, PRESTRESSED, PRINTED

from microslip.contact.examples import EXAMPLES
from microslip.contact.friction import Coulomb, Exponential, Falling, Heated, StaticSliding, characteristic
from microslip.contact.heights import Polynomial
from microslip.contact.law import history, values
from microslip.contact.normal import Penalty, Preload, Rough
from microslip.contact.periodic import periodic
from microslip.contact.point import PointContact, PointState, dragged

MU, N0, K = 0.4, 100.0, 2e7
LIMIT = MU * N0
TRIES = hypothesis_settings(max_examples=15)
CYCLES = periodic
DRAGGED = jax.jit(dragged)
TURNED = jax.jit(lambda given, moved: jax.jvp(dragged, given, moved)[1])
COEFFICIENT = jax.jit(lambda friction, speed, pressed: friction.coefficient(speed, pressed))


@jax.jit
def STEP(law, u, v, dt, state):
    return law.step(u, v, dt, state)


def marched(law, u, dt):
    """`history` as arrays of numpy, without the state at the end: of jax's each entry that is read
    compiles a program. The path is lengthened, so that one program of a law serves any length."""
    done = history(law, np.pad(u, ((0, -len(u) % 3072), (0, 0), (0, 0)), mode="edge"), dt)
    force, slip, lost = (np.asarray(x)[: len(u)] for x in (done.force, done.slip, done.dissipated))
    return dataclasses.replace(done, force=force, slip=slip, dissipated=lost, state=None)


def third(law, u):
    """(s, n, 3) forces of the third time that a path of one second is gone through."""
    return marched(law, np.tile(u, (3, 1, 1)), 1 / len(u)).force[2 * len(u) :]


def value(number):
    return jnp.asarray(number, dtype=float)


JENKINS = PointContact(Preload(value(N0)), Coulomb(value(MU)), value(K))
ROUGH = Rough(value(2.4e8), value(12e-6), Polynomial())


def tangential(*rows):
    """(s, 1, 3) path of t1 (and t2)."""
    rows = [*rows, *[np.zeros_like(rows[0])] * (2 - len(rows))]
    return np.stack([np.zeros_like(rows[0]), *rows], axis=-1)[:, None]


def polygon(corners, per_edge):
    """Straight lines through the corners, with the corners among the samples."""
    s = np.arange((len(corners) - 1) * per_edge + 1) / per_edge
    return np.interp(s, np.arange(len(corners)), corners)


# closed forms --------------------------------------------------------------------------------------------------------


def test_jenkins_loop_has_its_corners_and_its_energy() -> None:
    """Amplitude 3 slip limits: parallelogram of height 2 mu N and area 4 mu N (A - mu N/k); exact at any step, since
    the samples hold all corners."""
    slip = LIMIT / K
    u = polygon(slip * np.array([0, 3, -3, 3, -3]), 12)
    told = marched(JENKINS, tangential(u), 1e-3)
    force = told.force[:, 0, 1]
    assert np.allclose(force[[0, 4, 8, 12]], [0, LIMIT, LIMIT, LIMIT], rtol=1e-12)
    assert np.allclose(force[[12, 14, 16, 20, 24]], [LIMIT, 0, -LIMIT, -LIMIT, -LIMIT], rtol=1e-12, atol=1e-12 * LIMIT)
    lost = told.dissipated[:, 0]
    assert lost[12] == pytest.approx(LIMIT * 2 * slip, rel=1e-12)
    assert lost[-1] - lost[24] == pytest.approx(4 * LIMIT * (3 - 1) * slip, rel=1e-12)
    assert np.allclose(told.slip[[12, 24, 36], 0, 0], [2 * slip, -2 * slip, 2 * slip], rtol=1e-12)


def test_below_the_limit_it_is_a_spring_that_loses_nothing() -> None:
    u = polygon(0.999 * LIMIT / K * np.array([0, 1, -1, 0.3, -0.8]), 12)
    told = marched(JENKINS, tangential(u), 1e-3)
    assert np.allclose(told.force[:, 0, 1], K * u, rtol=1e-12)
    assert np.abs(told.dissipated).max() < 1e-14 * LIMIT**2 / K * len(u)
    assert np.abs(told.slip).max() < 1e-15 * LIMIT / K


def test_masing_the_way_back_is_the_first_loading_twice_as_large() -> None:
    """F(u) = F_A - 2 f((u_A - u)/2) with f the first loading."""
    slip = LIMIT / K
    u = polygon(slip * np.array([0, 2.5, -2.5]), 24)
    force = marched(JENKINS, tangential(u), 1e-3).force[:, 0, 1]
    first = np.minimum(K * (u[24] - u[24:]) / 2, LIMIT)
    assert np.allclose(force[24:], force[24] - 2 * first, rtol=0, atol=1e-12 * LIMIT)


def test_on_a_circle_the_force_lags_by_a_constant_angle_and_loses_its_sine() -> None:
    """Radius a beyond the limit: lag arccos(mu N/(k a)), 2 pi a mu N sin(lag) a turn. Straight ways between the
    samples meet both with the second power of the step."""
    a = 2 * LIMIT / K
    lag, errors, losses = np.arccos(0.5), [], []
    samples = (64, 256, 1024)
    for s in samples:
        t = 2 * np.pi * np.arange(s) / s
        u = tangential(a * np.cos(t), a * np.sin(t))
        force = third(JENKINS, u)[:, 0, 1:]
        assert np.allclose(np.hypot(*force.T), LIMIT, rtol=1e-12)
        exact = LIMIT * np.exp(1j * (t + lag))
        errors.append(np.abs(force @ [1, 1j] - exact).max() / LIMIT)
        losses.append(abs(contract.work(force[:, None], u[..., 1:])[0][0] / (2 * np.pi * a * LIMIT) - np.sin(lag)))
    orders = [np.polyfit(np.log(samples), np.log(e), 1)[0] for e in (errors, losses)]
    assert errors[0] < 4e-3 and orders == pytest.approx([-2, -2], abs=0.1)


def first_harmonics(law, motion, samples):
    """(n, 3) complex first harmonics of the force of n points on periodic paths, motion(t) of (s, n, 3)."""
    t = 2 * np.pi * np.arange(samples) / samples
    force = np.asarray(CYCLES(law, motion(t[:, None]), 1.0, 60, 1e-12)[0])
    return 2 / samples * np.einsum("snk,s->nk", force, np.exp(-1j * t))


def test_derivatives_of_a_straight_way_are_those_of_differences() -> None:
    """From rest inside the circle and from the circle itself, with a limit that grows or falls, a tenth without a way:
    1e-7 of what it is, but for one in a thousand, next to where it begins to slide."""
    rng, n, h = np.random.default_rng(0), 4000, 1e-6
    before = rng.uniform(0.5, 1.5, n)
    force, way = rng.normal(size=(2, n)), rng.normal(size=(2, n)) * 10 ** rng.uniform(-2, 0.7, n)
    way[:, ::10] = 0
    on_circle = rng.random(n) < 0.5
    force *= before / np.hypot(*force) * np.where(on_circle, 1.0, rng.random(n))
    given = [force, way, before, before * rng.uniform(0.5, 1.5, n)]
    moved = [rng.normal(size=x.shape) for x in given]
    along = force / before * moved[2] + np.stack([-force[1], force[0]]) * rng.normal(size=n)  # the circle's own change
    moved[0] = np.where(on_circle, along, moved[0])
    told = np.asarray(TURNED(tuple(given), tuple(moved)))
    ends = [np.asarray(DRAGGED(*(x + s * h * y for x, y in zip(given, moved, strict=True)))) for s in (1, -1)]
    differences = (ends[0] - ends[1]) / (2 * h)
    wrong = np.abs(told - differences).max(axis=0) / (1 + np.abs(differences).max(axis=0))
    assert np.isfinite(told).all() and np.quantile(wrong, 0.999) < 1e-7


@pytest.mark.parametrize("angle", [0.3, 2.0, -2.9])
def test_the_derivative_by_a_way_of_rounding_is_that_by_a_short_one(angle: float) -> None:
    """On the cone only what is across the force turns it, whatever the size and direction of a short way."""
    force, held, moved = np.array([1.2, -0.5]), np.array(1.3), np.array([1.0, 2.0])
    way = np.array([np.cos(angle), np.sin(angle)]) / 1.3
    for size in (0.0, 1e-170, 1e-40, 1e-20, 1e-17, 1e-15, 1e-12):
        held_after = held * (1 - 1e-3)  # so that it slides whatever the way is
        still = np.zeros(()), np.zeros(())
        told = TURNED((force, size * way, held, held_after), (np.zeros(2), moved, *still))
        across = np.array([0.5, 1.2]) / 1.3
        mean = np.log(held / held_after) / (held - held_after)  # of 1 / R
        right = held_after * mean * (across @ moved) * across
        np.testing.assert_allclose(told, right, rtol=0, atol=1e-9, err_msg=str(size))


def test_a_force_keeps_its_direction_where_the_limit_falls_below_it_without_a_way() -> None:
    force = np.array([[3.0, 0.0], [4.0, 2.0]])
    kept = DRAGGED(force, np.zeros((2, 2)), np.array([5.0, 3.0]), np.array([2.5, 1.0]))
    np.testing.assert_allclose(kept, [[1.5, 0.0], [2.0, 1.0]], rtol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("axes", [(2.0, 1.0), (1.3, 0.9)], ids=["slides", "sticks twice"])
def test_on_an_ellipse_the_force_is_of_second_order_in_the_samples(axes) -> None:
    """Against the orbit's own tables (Sextro 5.2-15 to 5.2-30), made otherwise; 0.3 % of the limit with 64 samples."""
    a, b = axes
    K_eta, K_zeta = exact(np.array([a]), np.array([b]))[:, 0]
    right = np.array([a * K_eta, -1j * b * K_zeta]) * LIMIT
    samples, errors = (16, 64), []
    for s in samples:
        shape = LIMIT / K * np.array([0.0, a, b])
        found = first_harmonics(JENKINS, lambda t, way=shape: np.stack([0 * t, np.cos(t), np.sin(t)], axis=-1) * way, s)
        errors.append(np.abs(found[0, 1:] - right).max() / LIMIT)
    assert errors[1] < 3e-3
    assert np.polyfit(np.log(samples), np.log(errors), 1)[0] == pytest.approx(-2, abs=0.1)


@pytest.mark.parametrize("swing", [0.8, 1.2], ids=["stays closed", "opens"])
def test_a_rough_contact_whose_load_swings_is_of_second_order_in_the_samples(swing) -> None:
    """It slides and comes back, and its area comes and goes: eight phases of the load, root mean square of the error
    against 2048 samples."""
    law, phase = PointContact(ROUGH, Coulomb(value(MU)), value(K)), np.arange(8) * np.pi / 4

    def motion(t):
        way = [1 + swing * np.cos(t + phase), 1.5 * np.cos(t) + 0.3 * np.sin(2 * t), np.sin(t) + 0 * phase]
        return np.stack(np.broadcast_arrays(*way), axis=-1) * [12e-6, 3e-5, 2e-5]

    samples, found = (64, 256, 2048), []
    for s in samples:
        path = motion(2 * np.pi / s * np.arange(4 * s)[:, None])
        longest = np.pad(path, ((0, 4 * 2048 - len(path)), (0, 0), (0, 0)), mode="edge")
        force = marched(law, longest, 1 / s).force
        before, last = force[2 * s : 3 * s], force[3 * s : 4 * s]
        assert np.allclose(last, before, rtol=0, atol=1e-9 * np.abs(last).max())  # it forgets
        found.append(2 / s * np.einsum("snk,s->nk", last, np.exp(-2j * np.pi / s * np.arange(s))))
    samples, right = samples[:2], found[2]
    wrong = [np.abs(few - right)[:, 1:] for few in found[:2]]
    errors = np.sqrt(np.mean(np.square(wrong), axis=(1, 2)) / np.mean(np.abs(right[:, 1:]) ** 2))
    assert errors[0] < 2e-3
    assert np.polyfit(np.log(samples), np.log(errors), 1)[0] == pytest.approx(-2, abs=0.1)


def test_a_varying_normal_load_is_followed_while_sliding() -> None:
    """Slid steadily: F = mu N(t), and what is lost is mu N times the slip."""
    law = PointContact(Penalty(value(2.4e8)), Coulomb(value(MU)), value(K))
    t = np.linspace(0, 2 * np.pi, 2401)
    u = np.stack([1e-6 * (1 + 0.9 * np.sin(7 * t)), 1e-4 * t, 0 * t], axis=-1)[:, None]
    told = marched(law, u, 1e-4)
    late = slice(1000, None)
    assert np.allclose(told.force[late, 0, 1], MU * 2.4e8 * u[late, 0, 0], rtol=1e-12)
    slipped, lost = np.diff(told.slip[late, 0, 0]), np.diff(told.dissipated[late, 0])
    held = 0.5 * (told.force[1000:-1, 0, 1] + told.force[1001:, 0, 1])
    assert slipped.min() > 0 and np.allclose(lost, held * slipped, rtol=1e-6)  # of a sum that grows to a thousand


# friction opposes the slip -------------------------------------------------------------------------------------------


def tried(seed, ratio, n=200):
    """A law with two stiffnesses, states inside the cone, and a step from them."""
    rng = np.random.default_rng(seed)
    pressed = 10 ** rng.uniform(-2, 4, n)
    law = PointContact(Preload(pressed), Coulomb(value(MU)), value(K), value(ratio * K))
    angle, size = rng.uniform(0, 2 * np.pi, n), MU * pressed * rng.uniform(0, 1, n)
    elastic = size * np.stack([np.cos(angle), np.sin(angle)])
    state = law.init(n)._replace(elastic=elastic, share=np.ones(n))
    u = np.column_stack(
        [np.zeros(n), rng.normal(size=(n, 2)) * (10 ** rng.uniform(-2, 6, n) * MU * pressed / K)[:, None]]
    )
    return law, state, u, elastic, pressed


def slid(seed, ratio):
    """Force and slip of that step, (2, n), and what friction holds."""
    law, state, u, elastic, pressed = tried(seed, ratio)
    force, after = jax.tree.map(np.asarray, STEP(law, u, np.zeros(u.shape), 1e-3, state))
    springs = np.array([[K], [ratio * K]])
    trial = elastic + springs * u[:, 1:].T
    assert np.allclose(after.slipped, (trial - force[:, 1:].T) / springs, rtol=1e-9, atol=1e-12 * np.abs(u).max())
    return trial, force[:, 1:].T, (trial - force[:, 1:].T) / springs, MU * pressed


@TRIES
@given(seed=st.integers(0, 10**6), ratio=st.sampled_from([1e-4, 0.03, 0.4, 1.0, 7.0, 1e4]))
def test_slip_is_along_the_force_and_only_at_the_limit(seed, ratio) -> None:
    """Karush-Kuhn-Tucker: |F| <= mu N, slip = lambda F, lambda >= 0, lambda (mu N - |F|) = 0."""
    _, force, slip, held = slid(seed, ratio)
    size, way = np.hypot(*force), np.hypot(*slip)
    assert np.all(size <= held * (1 + 1e-9))
    moving = way > 1e-9 * held / K / min(ratio, 1.0)
    assert np.all(size[moving] >= held[moving] * (1 - 1e-8))
    assert np.all(np.sum(force * slip, axis=0)[moving] >= (1 - 1e-6) * (size * way)[moving])
    assert 20 < moving.sum()


@TRIES
@given(seed=st.integers(0, 10**6), ratio=st.sampled_from([0.03, 0.4, 7.0]))
def test_the_force_is_the_nearest_of_the_cone_in_the_energy_of_the_springs(seed, ratio) -> None:
    """No other force that friction can hold, of 720 around the cone, is nearer to the trial force."""
    trial, force, _, held = slid(seed, ratio)
    compliance = np.array([1 / K, 1 / (ratio * K)])
    angles = np.linspace(0, 2 * np.pi, 720)
    rim = held * np.stack([np.cos(angles), np.sin(angles)])[..., None]
    outside = np.hypot(*trial) > held
    there = np.einsum("i,ian->an", compliance, (rim - trial[:, None]) ** 2).min(axis=0)
    here = compliance @ (force - trial) ** 2
    assert np.all(here[outside] <= there[outside] * (1 + 1e-9)) and np.all(
        here[~outside] <= 1e-20 * held[~outside] ** 2
    )


def test_the_radial_return_would_slip_across_the_force() -> None:
    """Why it is not used: with k2 = k1/10, a step at 45 degrees to the axes would slip 40 degrees away from it."""
    trial, springs = np.array([1.0, 1.0]), np.array([1.0, 0.1])
    radial = trial / np.hypot(*trial) * 0.5
    slip = (trial - radial) / springs
    off = np.degrees(np.arccos(radial @ slip / np.hypot(*radial) / np.hypot(*slip)))
    assert off == pytest.approx(39.3, abs=0.1)
    law = PointContact(Preload(np.ones(200)), Coulomb(value(0.5)), value(1.0), value(0.1))
    start = law.init(200)._replace(share=np.ones(200))
    _, after = STEP(law, np.tile([0.0, 1.0, 10.0], (200, 1)), np.zeros((200, 3)), 1.0, start)
    way = np.asarray(after.slipped)[:, 0]
    left = trial - springs * way
    assert np.hypot(*left) == pytest.approx(0.5, rel=1e-12)
    assert left @ way == pytest.approx(np.hypot(*left) * np.hypot(*way), rel=1e-12)


RATED = {
    "coulomb": Coulomb(value(0.3)),
    "static and sliding": StaticSliding(value(0.4), value(0.3)),
    "falling": Falling(value(0.3), value(5.0)),
    "falling exponentially": Exponential(value(0.4), value(0.2), value(30.0)),
    "rising": Exponential(value(0.2), value(0.4), value(30.0)),
    "heated": Heated(value(0.3), value(1e-6), value(900.0), value(4e-6)),
    "measured": characteristic([1e-4, 1e-3, 1e-2], [0.4, 0.3, 0.25]),
}


QUICK = ("coulomb", 0.2), ("falling", None), ("falling exponentially", 0.2), ("heated", None)
PAIRS = [(name, ratio) for name in RATED for ratio in (None, 0.2)]


@pytest.mark.parametrize("name, ratio", [p if p in QUICK else pytest.param(*p, marks=pytest.mark.slow) for p in PAIRS])
def test_a_rate_dependent_step_solves_its_equation(name, ratio) -> None:
    """Slid: |F| = mu(slip/dt) N with the slip along F; stuck: |F| <= mu(0) N. From rest, 300 random steps."""
    friction = RATED[name]
    rng = np.random.default_rng(3)
    n, dt = 300, 1e-4
    pressed = 10 ** rng.uniform(0, 3, n)
    law = PointContact(Preload(pressed), friction, value(K), None if ratio is None else value(ratio * K))
    state = law.init(n)._replace(share=np.ones(n))
    u = np.column_stack([np.zeros(n), rng.normal(size=(n, 2)) * (10 ** rng.uniform(-2, 2, n))[:, None] * 40.0 / K])
    force, after = jax.tree.map(np.asarray, STEP(law, u, np.zeros((n, 3)), dt, state))
    size, slip = np.hypot(*force[:, 1:].T), after.slipped
    way = np.hypot(*slip)
    moving = way > 1e-12 * np.abs(u).max()
    held = np.asarray(COEFFICIENT(friction, way / dt, pressed)) * pressed
    assert np.allclose(size[moving], held[moving], rtol=1e-7)
    assert np.all(np.sum(slip * force[:, 1:].T, axis=0)[moving] >= (1 - 1e-9) * (size * way)[moving])
    still = np.asarray(COEFFICIENT(friction, np.zeros(n), pressed)) * pressed
    assert np.all(size[~moving] <= still[~moving] * (1 + 1e-12))
    assert 50 < moving.sum() < 290


# normal load ---------------------------------------------------------------------------------------------------------


def test_without_preload_a_closed_contact_has_friction() -> None:
    """Touching but unloaded at the beginning; pressed by the motion alone: F = mu N as soon as it slides."""
    for normal in (Penalty(value(2.4e8)), ROUGH):
        law = PointContact(normal, Coulomb(value(MU)), value(K))
        t = np.linspace(0, 1, 2401)[:, None]
        u = np.stack([1e-5 * t, 1e-3 * t, 0 * t], axis=-1)
        told = marched(law, u, 1e-3)
        assert np.allclose(told.force[1:, 0, 1], MU * told.force[1:, 0, 0], rtol=1e-12)
        assert float(told.force[1, 0, 1]) > 0 and float(told.dissipated[-1, 0]) > 0


def stretched(share, elastic):
    """State of one point that has been loaded."""
    zero = np.zeros((2, 1))
    held = np.array([elastic])
    return PointState(zero, np.array([[elastic], [0.0]]), held, np.array([share]), zero, np.zeros(1))


def test_area_that_is_lost_takes_its_force_with_it_and_area_that_comes_carries_nothing_yet() -> None:
    """Half of the share: half of the force; more share: the same force, but a steeper increment, of the mean share."""
    law = PointContact(ROUGH, Coulomb(value(50.0)), value(K))
    half, whole = 0.5 * 12e-6, 12e-6
    lifted, pressed, moved = (
        np.asarray(STEP(law, np.array([to]), np.zeros((1, 3)), 1.0, stretched(share, 10.0))[0])[0, 1]
        for to, share in (([half, 0, 0], 1.0), ([whole, 0, 0], 0.5), ([whole, 1e-7, 0], 0.5))
    )
    assert np.allclose([lifted, pressed, moved], [5.0, 10.0, 10.0 + 0.75 * K * 1e-7], rtol=1e-12)


def test_the_printed_form_gives_energy_and_this_one_does_not() -> None:
    """Stuck, moved out by d at the share h1, pressed to h2, moved back, released: k h(u_n) u_t does the work
    k d^2 (h1 - h2)/2 < 0. By increments the force comes back to k d (h1 - h2), and losing area leaves h1/h2 of it."""
    h = values(ROUGH, "share", np.array([0.3, 0.9]) * 12e-6)
    d, k = 1e-7, 1e6
    corners = np.array([[0.3, 0], [0.3, 1], [0.9, 1], [0.9, 0], [0.3, 0]]) * [12e-6, d]
    u = np.stack([polygon(corners[:, 0], 600), polygon(corners[:, 1], 600), np.zeros(2401)], axis=-1)
    printed = np.stack([values(ROUGH, "force", u[:, 0]), k * values(ROUGH, "share", u[:, 0]) * u[:, 1]], axis=-1)
    work = np.sum(0.5 * (printed[1:] + printed[:-1]) * np.diff(u[:, :2], axis=0))
    assert work == pytest.approx(0.5 * k * d**2 * (h[0] - h[1]), rel=1e-6) and work < 0
    law = PointContact(ROUGH, Coulomb(value(MU)), value(k))
    told = marched(law, u[:, None], 1e-3)
    assert np.abs(told.slip).max() < 1e-12 * d
    force = told.force[:, 0, 1]
    done = np.append(0, np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(u[:, 1])))
    lost = done - force**2 / (2 * k * values(ROUGH, "share", u[:, 0]))
    cycle = done[-1]
    assert np.diff(lost).min() > -1e-12 * abs(work) and lost[-1] > 0.1 * abs(work)
    assert force[-1] == pytest.approx(k * d * h[0] / h[1] * (h[0] - h[1]), rel=1e-9)  # left over, towards the new rest
    assert cycle == pytest.approx(0.5 * k * d**2 * (h[1] - h[0]), rel=1e-9)  # what the printed form gave


def test_force_goes_to_zero_with_the_approach() -> None:
    """At separation of a rough contact: F_n like u^3, F_t below mu F_n; and back from zero on return."""
    law = PointContact(ROUGH, Coulomb(value(MU)), value(K))
    x = np.concatenate([np.linspace(1, -0.2, 1201), np.linspace(-0.2, 1, 1201)[1:]])
    u = np.stack([12e-6 * x, 4e-6 * np.cos(9 * x), 0 * x], axis=-1)[:, None]
    force = marched(law, u, 1e-5).force[:, 0]
    assert np.abs(np.diff(force, axis=0)).max() < 0.003 * force.max() and np.all(force[x <= 0] == 0)
    near = (x > 0) & (x < 0.1)
    assert np.all(force[near, 0] <= 2.4e8 * 12e-6 * x[near] ** 3)
    assert np.all(np.abs(force[:, 1]) <= MU * force[:, 0] * (1 + 1e-12))


# damping -------------------------------------------------------------------------------------------------------------


def test_normal_damping_is_proportional_to_the_stiffness_and_never_pulls() -> None:
    """(3.7-30): max(0, F + beta k v)."""
    beta = 2e-4
    law = PointContact(ROUGH, Coulomb(value(MU)), value(K), None, value(beta))
    rng = np.random.default_rng(0)
    u, v = rng.uniform(-2e-6, 2e-5, 500), rng.normal(size=500) * 0.05
    rows = np.zeros((500, 3))
    force = np.asarray(STEP(law, rows + [1, 0, 0] * u[:, None], rows + [1, 0, 0] * v[:, None], 1e-5, law.init(500))[0])
    expected = values(ROUGH, "force", u) + beta * values(ROUGH, "stiffness", u) * v
    assert np.allclose(force[:, 0], np.maximum(expected, 0), rtol=1e-12)
    assert (expected < 0).sum() > 50 and force[:, 0].min() == 0


def test_where_the_damper_would_pull_friction_holds_nothing() -> None:
    """Clipped normal force: the tangential spring relaxes through its damper, e' = -e/beta, with no force."""
    beta, dt = 1e-3, 1e-4
    law = PointContact(ROUGH, Coulomb(value(MU)), value(K), None, value(beta))
    force, after = STEP(law, np.array([[6e-6, 0, 0]]), np.array([[-1.0, 0, 0]]), dt, stretched(0.5, 10.0))
    assert np.array_equal(force, np.zeros((1, 3)))
    assert np.asarray(after.elastic)[0, 0] == pytest.approx(10.0 / (1 + dt / beta), rel=1e-12)


def test_tangential_damping_adds_to_the_spring_while_it_sticks_and_not_beyond_the_cone() -> None:
    beta, dt, d = 1e-3, 1e-4, 1e-7
    law = PointContact(Preload(value(N0)), Coulomb(value(MU)), value(K), None, value(beta))
    start = law.init(1)._replace(share=np.ones(1))
    stuck, fast = (
        np.asarray(STEP(law, np.array([[0, way, 0]]), np.array([[0, way / dt, 0]]), dt, start)[0]) for way in (d, 9 * d)
    )
    assert stuck[0, 1] == pytest.approx(K * d + beta * K * d / dt, rel=1e-12)
    assert fast[0, 1] == pytest.approx(LIMIT, rel=1e-12) and 9 * K * d < LIMIT


def test_a_stuck_damped_contact_loses_the_energy_of_a_kelvin_voigt_element() -> None:
    """pi beta k omega a^2 a cycle, by backward differences with the first power of the step."""
    a, beta = 1e-7, 2e-2
    law = PointContact(Preload(value(N0)), Coulomb(value(MU)), value(K), None, value(beta))
    errors = []
    for s in (64, 256, 1024):
        u = tangential(a * np.cos(2 * np.pi * np.arange(s) / s))
        force = third(law, u)
        errors.append(contract.work(force, u)[0][0] / (np.pi * beta * K * 2 * np.pi * a**2) - 1)
    assert abs(errors[-1]) < 1e-4 and all(abs(a) > 3 * abs(b) for a, b in zip(errors, errors[1:], strict=False))


# wrong laws are caught -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("test", "wrong"),
    [
        pytest.param(contract.test_friction_stays_in_its_cone, BOX, marks=pytest.mark.slow),
        (contract.test_the_force_does_not_jump_at_separation, JUMP),
        (contract.test_dissipated_energy_grows, PRESTRESSED),
        pytest.param(contract.test_the_force_does_not_jump_at_separation, PRESTRESSED, marks=pytest.mark.slow),
        (lambda example: contract.test_stuck_and_moved_under_changing_load_gives_no_energy(example, -1), PRINTED),
    ],
    ids=["box", "jump", "no preload: energy", "no preload: force", "printed"],
)
def test_the_contract_catches_a_wrong_law(test, wrong) -> None:
    """A box for a cone, a jump at separation, no friction without preload, the printed stiffness."""
    with pytest.raises(AssertionError):
        test(example=wrong)


@pytest.mark.parametrize("wrong", [BOX, PRESTRESSED, PRINTED], ids=["box", "no preload", "printed"])
def test_wrong_laws_are_wrong_in_one_thing_only(wrong) -> None:
    """Open they carry nothing, as the right one: it is not for some other reason that they are caught."""
    contract.test_an_open_contact_carries_nothing(example=wrong)
    contract.test_every_point_is_on_its_own(example=wrong)


def test_leaving_the_mistake_out_the_same_example_passes() -> None:
    right = dataclasses.replace(BOX, law=EXAMPLES["rough point"].law)
    contract.test_the_force_does_not_jump_at_separation(right)
    contract.test_dissipated_energy_grows(right)

"""What every contact law must satisfy, on random closed paths: `contact.EXAMPLES` decides which laws are tried."""

import dataclasses
import pickle
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import wrong_laws
from refusals import refused

from microslip.contact import EXAMPLES
from microslip.contact.friction import Coulomb, Scattered
from microslip.contact.harmonics import force_harmonics
from microslip.contact.law import Law, Step, history, march
from microslip.contact.periodic import periodic
from microslip.contact.portion import portion

SAMPLES = 256
CYCLE, MARCH = 4 * SAMPLES, 8 * SAMPLES
"""Samples of every cycle that is periodic, and of every path that is marched once: one program of a law serves all
tests."""
TRIES = range(12)
"""Seeds of the random paths that a property is tried on: the same ones whatever else is imported."""
SISTERS = {  # laws that differ from a quick one in their characteristic or heights alone
    "exponential heights, cut", "linear heights", "tabulated heights", "point, rising", "point, heated",
    "point, static and sliding", "point, measured", "Mindlin", "round point", "gapped point",
    "Gaussian heights, cut", "worn heights", "hyperbolic point", "potential point", "measured point",
    "point, scattered", "Mindlin, two stiffnesses", "portion of a rough contact",
}  # fmt: skip
assert SISTERS <= set(EXAMPLES)


def laws(slow):
    """Every law, those named here in the slow tests."""
    each = [pytest.param(e, marks=pytest.mark.slow if name in slow else ()) for name, e in EXAMPLES.items()]
    return pytest.mark.parametrize("example", each, ids=EXAMPLES.keys())


LAWS = laws(SISTERS)
FORCES = periodic


@jax.jit
def MARCHED(law, u, dt):
    """From the unloaded state, along a closed path (s, n, 3): forces, the largest that friction may hold with them, and
    (s, n) J that the law counts as lost in a step and as stored after it."""

    def one(carried, sample):
        state, before, at = carried
        force, after = law.step(*sample, dt, state)
        lost = law.lost(Step(sample[0], sample[0] - at, dt, before, force, state, after))
        return (after, force, sample[0]), (force, law.limit(force, after), lost, law.stored(sample[0], after))

    begin = law.init(u.shape[1]), jnp.zeros_like(u[0]), u[-1]
    return jax.lax.scan(one, begin, (u, (u - jnp.roll(u, 1, axis=0)) / dt))[1]


@jax.jit
def TANGENT(law, u, dt, du):
    """Force from the unloaded state, and its derivative along du."""
    return jax.jvp(lambda x: march(law, x, dt, law.init(x.shape[1]))[0], (u,), (du,))


def path(seed, example, points=3, samples=None, harmonics=3, lift=1.0):
    """(s, n, 3) a smooth closed path of the example's size; ``lift`` is the mean normal displacement."""
    samples = samples or (SAMPLES if example.jumps else CYCLE)  # with shorter steps more roots meet
    rng = np.random.default_rng(seed)
    t = 2 * np.pi * np.arange(samples) / samples
    c = rng.normal(size=(2, harmonics, points, 3)) / np.arange(1, harmonics + 1)[:, None, None]
    turns = np.outer(np.arange(1, harmonics + 1), t)
    u = np.einsum("hs,hnk->snk", np.cos(turns), c[0]) + np.einsum("hs,hnk->snk", np.sin(turns), c[1])
    u[..., 0] += lift
    return u * [example.normal, example.tangential, example.tangential]


def scale(force):
    return float(np.abs(force).max())


def work(force, u):
    """(n,) work of a closed path by the trapezoidal rule, and by how much the last bit of each term could change it."""
    terms = 0.5 * (force + np.roll(force, 1, axis=0)) * (u - np.roll(u, 1, axis=0))
    return terms.sum(axis=(0, 2)), np.abs(terms).sum(axis=(0, 2))


@LAWS
def test_an_open_contact_carries_nothing(example) -> None:
    """After being pressed and slid, and pulled apart."""
    for seed in TRIES:
        u = np.array(path(seed, example, samples=MARCH))
        u[MARCH // 2 :, :, 0] = -np.abs(u[MARCH // 2 :, :, 0]) - example.gap
        force, *_ = MARCHED(example.law, u, example.period / MARCH)
        assert np.all(np.array(force)[MARCH // 2 :] == 0)


@LAWS
def test_friction_stays_in_its_cone(example) -> None:
    """A cone, not a box: the length of the tangential force is limited, not each of its components."""
    for seed in TRIES:
        u = path(seed, example, samples=MARCH)
        force, limits = map(np.asarray, MARCHED(example.law, u, example.period / MARCH)[:2])
        assert np.all(force[..., 0] >= 0)
        excess = np.linalg.norm(force[..., 1:], axis=-1) - limits
        assert excess.max() <= (1e-9 + example.inertia) * scale(force)  # bisection leaves 2^-40


@LAWS
def test_a_closed_cycle_gives_no_energy(example) -> None:
    """Also where the normal load varies while the contact sticks. The sum's own error is of second order in the step:
    (2 pi 3 / 1024)^2 / 12 = 3e-5 for the third harmonic."""
    for seed in TRIES:
        lift = (0.5, 1.0, 3.0)[seed % 3]
        u = path(seed, example, lift=lift, samples=CYCLE)
        given_back, size = work(np.array(FORCES(example.law, u, example.period, 2)[0]), np.array(u))
        error = 1e-3 if example.jumps else 5e-5  # the trapezoidal rule is of first order where the force jumps
        assert np.all(given_back >= -error * size)


@LAWS
def test_the_force_does_not_jump_at_separation(example) -> None:
    """Pressed and slid, then within a thousandth of the approach from opening: next to nothing is left, and at the end
    nothing."""
    near = MARCH // 4
    u = np.array(path(6, example, samples=MARCH))
    u[:-near, :, 0] = np.abs(u[:-near, :, 0]) + example.normal
    u[-near:, :, 0] = np.linspace(1e-3, -1e-3, near)[:, None] * example.normal
    u[-near:, :, 1:] = u[-near, :, 1:]
    force = np.abs(np.array(MARCHED(example.law, u, example.period / MARCH)[0]))
    assert force[-near:].max() <= 0.01 * scale(force) and force[-1].max() == 0
    assert force[:-near, :, 1:].max() > 0


@LAWS
@pytest.mark.parametrize("turn", [1, -1], ids=["out pressed", "out released"])
def test_stuck_and_moved_under_changing_load_gives_no_energy(example, turn) -> None:
    """Moved while pressed and back while released, and the other way round: k(u_n) u_t, as printed, gives energy where
    it is moved out while released, pressed, and moved back."""
    corners = np.array([[2.0, 0, 0], [2.0, 1, 0], [0.2, 1, 0], [0.2, 0, 0], [2.0, 0, 0]])[::turn]
    corners = corners * [example.normal, 0.02 * example.tangential, 0.02 * example.tangential]
    s = np.linspace(0, 4, CYCLE + 1)
    u = np.column_stack([np.interp(s, range(5), c) for c in corners.T])[1:, None] * np.ones((3, 1))
    force = np.array(FORCES(example.law, u, example.period, 2)[0])
    assert np.all(work(force, u)[0] >= -1e-12 * work(force, u)[1])


@LAWS
def test_turning_the_tangents_turns_the_force(example) -> None:
    """Laws with two stiffnesses are tried with the mirrored tangent instead."""
    wrong = []
    for seed in TRIES:
        angle = np.random.default_rng(seed).uniform(0, 2 * np.pi)
        u = path(seed, example)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) if example.isotropic else np.diag([1.0, -1.0, 1.0])
        force, turned = (np.asarray(FORCES(example.law, x, example.period, 2)[0]) for x in (u, u @ turn.T))
        wrong.append(np.abs(force @ turn.T - turned).max(axis=-1) / scale(force))
    if example.jumps:  # where two roots meet rounding decides: of 300 paths 0.9 % of the samples, > 10 % in one of 27
        assert np.mean(np.array(wrong) > 1e-7) < 0.05
    else:
        assert np.max(wrong) <= 1e-9


@pytest.mark.parametrize("name", ["rough point, damped", "portion of a rough contact", "smooth point"])
def test_an_approach_presses_as_a_step_from_nothing_does(name) -> None:
    """Also of laws that say it without one."""
    law, u = EXAMPLES[name].law, np.linspace(-1, 1.5, 3) * EXAMPLES[name].normal
    found, expected = jax.jit(lambda law, u: (law.pressed(u), Law.pressed(law, u)))(law, u)
    np.testing.assert_allclose(found, expected, rtol=1e-14)


@LAWS
def test_the_same_path_gives_the_same_force_twice(example) -> None:
    u = path(1, example)
    first, second = (np.array(FORCES(example.law, u, example.period, 2)[0]) for _ in range(2))
    assert np.array_equal(first, second)


@LAWS
def test_every_point_is_on_its_own(example) -> None:
    """Whatever the others do."""
    u, other = path(2, example), path(5, example)
    beside = np.concatenate([other[:, :2], u[:, 2:]], axis=1)
    together, apart = (np.asarray(FORCES(example.law, x, example.period, 2)[0]) for x in (u, beside))
    assert np.allclose(together[:, 2], apart[:, 2], rtol=0, atol=1e-12 * scale(together))


@LAWS
def test_tangent_matches_differences(example) -> None:
    """Off the transitions: where two differences of different length agree among themselves."""
    dt = example.period / 32
    paths = [path(seed, example, points=1, samples=32) for seed in range(len(TRIES) + 1)]
    u, direction = np.concatenate(paths[:-1], axis=1), np.concatenate(paths[1:], axis=1)
    slope = np.array(TANGENT(example.law, u, dt, direction)[1])
    assert np.all(np.isfinite(slope))
    up, down, above, below = (
        np.array(TANGENT(example.law, u + h * direction, dt, direction)[0]) for h in (1e-6, -1e-6, 1e-5, -1e-5)
    )
    differences = (up - down) / 2e-6, (above - below) / 2e-5
    for tangent, fine, coarse in zip(*(np.swapaxes(x, 0, 1) for x in (slope, *differences)), strict=True):
        smooth = np.abs(fine - coarse).max(axis=1) < 1e-7 * np.abs(tangent).max()
        assert np.abs(tangent - fine)[smooth].max() <= 1e-6 * np.abs(tangent).max()
        assert smooth.sum() > 16


@LAWS
def test_settings_are_leaves(example) -> None:
    """Other numbers do not compile anew."""
    u = path(3, example)
    FORCES(example.law, u, example.period, 2)
    compiled = len(FORCES.made)
    FORCES(jax.tree_util.tree_map(lambda x: 1.1 * x, example.law), u, example.period, 2)
    assert len(FORCES.made) == compiled > 0 and jax.tree_util.tree_leaves(example.law)


def dissipated(example, u):
    """(s, n) J since the first sample: the work by the trapezoidal rule, less what the law stores."""
    force, _, _, stored = map(np.asarray, MARCHED(example.law, u, example.period / MARCH))
    work = np.zeros_like(stored)
    work[1:] = np.cumsum(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(u, axis=0), axis=-1), axis=0)
    return work - stored - (work - stored)[0]


@LAWS
def test_dissipated_energy_grows(example) -> None:
    """What was lost never comes back, but for the error of the trapezoidal rule."""
    lost = dissipated(example, path(4, example, samples=MARCH))
    assert np.diff(lost, axis=0).min() >= -1e-4 * lost[-1].max() and np.all(lost[-1] > 0)


@laws(set(EXAMPLES) - {"rough point"})
def test_a_history_says_what_was_dissipated(example) -> None:
    u = path(4, example, samples=MARCH)
    told = np.array(history(example.law, u, example.period / MARCH).dissipated)
    assert np.diff(told, axis=0).min() >= -1e-4 * told[-1].max() and np.all(told[-1] > 0)
    if example is EXAMPLES["rough point"]:  # of others the speed at a sample is another one
        expected = dissipated(example, u)
        np.testing.assert_allclose(told, expected, rtol=0, atol=1e-12 * expected.max())


def counted(law, u, dt):
    """Forces of the last time that u is gone through, the fourth at least, and (n,) J that the law counts as lost in
    it."""
    force, _, lost, _ = MARCHED(law, np.tile(u, (MARCH // len(u), 1, 1)), dt)
    return force[-len(u) :], lost[-len(u) :].sum(axis=0)


def error_of_periodic_derivative(example) -> float:
    """Of the derivative of a periodic cycle's force, against differences; over the largest."""
    samples = 32
    u, moved = (np.random.default_rng(seed).normal(size=(2, 3, 5)) for seed in (0, 1))
    u = u * np.array([example.normal, example.tangential, example.tangential])[:, None] * 0.3
    u[:, 0, 0] = 2 * example.normal
    given = (example.period, samples, 100, 120, 1e-13)
    slope = np.array(force_harmonics(example.law, u, *given)[1])
    h = 1e-6 * example.tangential
    up, down = (np.array(force_harmonics(example.law, u + x * moved, *given)[0]) for x in (h, -h))
    expected = np.einsum("nkhjl,njl->nkh", slope, moved)
    return float(np.abs(0.5 * (up - down) / h - expected).max() / np.abs(expected).max())


def solved_for(example) -> bool:
    def recalled(law):
        state = law.init(1)
        return law.recalled(state, law.memory(jnp.zeros((1, 3)), state))

    return jax.eval_shape(recalled, example.law) is not None


ALIKE = SISTERS | {"rough point", "Hertz point", "rough strips"}
"""Laws whose memory is that of a point with two stiffnesses, of a smooth point, of Iwan's sliders."""


@jax.jit
def _both_steps(law, u, dt, share):
    """Forces (3, n) and memories of a step from a share of a memory, by `Law.way` and `Law.drag` and by `Law.step`."""
    force, state = law.step(u[0], u[0] / dt, dt, law.init(u.shape[1]))
    memory, v = share * law.memory(force, state), (u[1] - u[0]) / dt
    expected, after = law.step(u[1], v, dt, law.recalled(state, memory))
    return law.drag(law.way(u[1], v, dt, state), memory), (expected.T, law.memory(expected, after))


@LAWS
def test_a_step_is_its_way_and_what_drags_along_it(example) -> None:
    """`Law.way` and `Law.drag` against `Law.step` from random memories, of laws whose sliders are solved for."""
    if not solved_for(example):
        pytest.skip("its cycles are marched")
    rng = np.random.default_rng(3)
    u = rng.normal(size=(2, 7, 3)) * np.array([example.normal, example.tangential, example.tangential])
    for told, expected in zip(*_both_steps(example.law, u, example.period / 32, rng.uniform(0, 1, 7)), strict=True):
        np.testing.assert_allclose(told, expected, rtol=0, atol=1e-14 * scale(expected))


@laws(ALIKE | {"smooth point"})  # of which test_contact_harmonics has the derivatives
def test_the_derivative_of_a_periodic_cycle_matches_differences(example) -> None:
    """Of laws whose sliders are solved for: what `Law.recalled` promises of their state is used for it."""
    if not solved_for(example):
        pytest.skip("its cycles are marched")
    assert error_of_periodic_derivative(example) < 1e-4


def test_a_state_that_holds_more_than_recalled_says_is_seen() -> None:
    assert error_of_periodic_derivative(wrong_laws.LAGGING) > 0.1


@LAWS
def test_points_that_share_a_contact_are_the_contact(example) -> None:
    """Three unequal ones that move alike, along paths that slide."""
    u = path(5, example)
    whole = np.asarray(FORCES(example.law, u, example.period, 2).force)
    laws_of_points = [portion(example.law, jnp.asarray(share)) for share in (0.125, 0.25, 0.625)]
    together = sum(np.asarray(FORCES(law, u, example.period, 2).force) for law in laws_of_points)
    np.testing.assert_allclose(together, whole, rtol=0, atol=1e-9 * scale(whole))


@LAWS
def test_a_law_counts_what_a_cycle_takes(example) -> None:
    """Friction along the path slid, dampers and area that opens make up the work, but for the order of the steps: the
    second one, of the motion of a mass the first."""
    if isinstance(getattr(example.law, "friction", None), Scattered):
        pytest.skip("random in time: no cycle is like the other")
    off = []
    for samples in (64, 512):
        paths = [path(seed, example, samples=samples, harmonics=2) for seed in range(3)]
        found = [counted(example.law, u, 0.01 / samples) for u in paths]
        taken = np.concatenate([work(np.asarray(F), np.asarray(u))[0] for (F, _), u in zip(found, paths, strict=True)])
        off.append(np.abs(np.concatenate([lost for _, lost in found]) - taken).max() / np.abs(taken).max())
    assert off[0] < 0.05 and off[1] < max(off[0] / 4, 1e-12)


@pytest.mark.parametrize("wrong", [wrong_laws.PRINTED, wrong_laws.BOX], ids=["printed", "box"])
def test_a_wrong_law_does_not_count_what_it_takes(wrong) -> None:
    u = path(1, wrong, samples=SAMPLES, harmonics=2) * np.array([1.0, 0.3, 0.3])
    force, lost = counted(wrong.law, u, 1e-5)
    assert np.abs(lost - work(np.asarray(force), np.asarray(u))[0]).max() > 0.05 * np.abs(lost).max()


SIGNED = {"gap", "mean", "x", "area_at", "volume_at", "energy_at", "u", "stored_at", "slopes", "phases", "at"}
"""Numbers of laws that may be negative, or are integrals that rounding leaves below zero."""


def made_again(law):
    """Every number of a law and of what it is made of: (its name, the law made again with what it becomes)."""
    for f in dataclasses.fields(law):
        value = getattr(law, f.name)
        if dataclasses.is_dataclass(value):
            yield from made_again(value)
        elif value is not None and not f.metadata.get("static"):
            yield f.name, lambda change, f=f, value=value: dataclasses.replace(law, **{f.name: change(value)})


@LAWS
def test_nonsense_is_refused_where_a_law_is_made(example) -> None:
    """Not a number and infinite anywhere, negative where that means nothing; also in one of many points."""
    found = dict(made_again(example.law))
    assert found
    for name, again in found.items():
        again(lambda value: value)
        for bad in (np.nan, np.inf, *([] if name in SIGNED else [-0.2])):
            for change in (lambda value, bad=bad: bad, lambda value, bad=bad: jnp.append(value, bad)):
                refused(name, again, change)


def test_laws_come_to_another_process_in_double_precision() -> None:
    """Which has computed nothing yet: jax would make single numbers of them."""
    law = EXAMPLES["smooth point"].law
    there = "import pickle, sys; sys.stdout.buffer.write(pickle.dumps(pickle.load(sys.stdin.buffer)))"
    given = {"input": pickle.dumps(law), "capture_output": True, "check": True}
    came = subprocess.run([sys.executable, "-c", there], **given).stdout
    for left, came_back in zip(*map(jax.tree.leaves, (law, pickle.loads(came))), strict=True):
        assert np.asarray(came_back).dtype == np.float64 and np.array_equal(left, came_back)


def test_derivatives_with_respect_to_a_law_have_any_sign() -> None:
    """They have its form; so has a law that is made of traced numbers."""
    slope = jax.grad(lambda law: -law.stiffness_1 * law.friction.mu)(EXAMPLES["rough point"].law)
    assert slope.stiffness_1 < 0 and slope.friction.mu < 0
    assert jax.jit(jax.grad(lambda mu: -Coulomb(mu).coefficient(jnp.ones(1), jnp.ones(1))[0]))(0.3) == -1

"""The play operator by hand against the same law marched as a compiled program."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import microslip as ms
from microslip.contact.elements import Stop
from microslip.contact.friction import Coulomb
from microslip.contact.normal import Penalty, Preload
from microslip.contact.patch import Patch
from microslip.contact.point import PointContact
from microslip.harmonic_balance.by_hand import ElasticSpring, JenkinsPlay, model
from microslip.harmonic_balance.forces import AFT, Forces
from microslip.system.assembly import Assembly


def patch(along: tuple[float, float, float] = (0.0, 0.6, -1.6), **more: object) -> Patch:
    """A point that slides at 0.6 N behind 2e4 N/m, its coordinate a line across both tangents."""
    value = jnp.asarray
    law = {"normal": Preload(value(2.0)), "friction": Coulomb(value(0.3)), "stiffness_1": value(2e4)} | more
    shape = np.array(along).reshape(1, 3, 1)
    return Patch("face", np.zeros((1, 2)), np.ones(1), PointContact(**law), shape)  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [0.2, 1.0, 5.0])
def test_by_hand_and_marched_are_one(size: float) -> None:
    """Force, derivative, work, path slid and share of slip, of contacts that stick, slide once, or to and fro."""
    width = 0.6 / (2e4 * np.hypot(0.6, 1.6))
    u = size * width * np.random.default_rng(2).normal(size=(7, 1, 9))
    hand, marched = JenkinsPlay(patch(), 7, 96, 3, 1e-12), AFT(patch(), 7, 96, 3, 1e-12)
    assert isinstance(model([patch()] * 7, 96, 3, 1e-12), JenkinsPlay)
    F, J = hand.forces(u, 0.1)
    expected = marched.forces(u, 0.1)
    for a, b in ((F, expected[0]), (J, expected[1]), (hand.force(u, 0.1), F)):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())
    assert hand.rate(u, 0.1) is None
    for one, other in zip(hand.point_cycles(u, 0.1), marched.point_cycles(u, 0.1), strict=True):
        for key in ("dissipated", "by_slip", "lost"):
            np.testing.assert_allclose(getattr(one, key), getattr(other, key), rtol=0, atol=1e-12 * 0.6 * size * width)
        assert one.slipping == pytest.approx(other.slipping, abs=1e-6)  # a mean in single precision
        assert one.open == other.open == one.unsteady == 0.0
    for drawn, other in zip(hand.traced(u, 0.1), marched.traced(u, 0.1), strict=True):
        np.testing.assert_allclose(drawn.force, other.force, rtol=0, atol=1e-12)  # of 2 N


def test_derivative_against_differences() -> None:
    hand = JenkinsPlay(patch(), 1, 64, 2)
    u = 1e-4 * np.random.default_rng(5).normal(size=(1, 1, 7))
    way = np.random.default_rng(6).normal(size=u.shape)
    h = 1e-11
    along = (hand.force(u + h * way, 1.0) - hand.force(u - h * way, 1.0)) / (2 * h)
    found = np.einsum("ckwjv,cjv->ckw", hand.forces(u, 1.0)[1], way)
    np.testing.assert_allclose(found, along, rtol=0, atol=1e-5 * np.abs(along).max())


def test_energy_is_what_the_harmonics_of_the_force_take() -> None:
    """pi h (a_h x b_h) of displacement and force is the work of the samples, and but for the second order of these what
    friction takes along the path slid."""
    u = np.zeros((1, 1, 5))
    u[0, 0, 1:] = 1e-4 * np.array([1.0, 0.5, 0.2, -0.1])
    errors = []
    for samples in (64, 256, 1024):
        hand = JenkinsPlay(patch(), 1, samples, 2)
        F = hand.force(u, 1.0)[0, 0]
        area = sum(np.pi * h * (u[0, 0, 2 * h] * F[2 * h - 1] - u[0, 0, 2 * h - 1] * F[2 * h]) for h in (1, 2))
        cycle = hand.point_cycles(u, 1.0)[0]
        assert cycle.dissipated[0] == pytest.approx(area, rel=1e-12)
        errors.append(abs(area / cycle.lost[0] - 1))
    slopes = np.diff(np.log(errors)) / np.log(4)
    assert errors[-1] < 1e-4 and (slopes < -1.5).all()


def test_other_contacts_are_marched() -> None:
    """A coordinate that presses, a force that depends on it, two stiffnesses, a damper, per cycle alone."""
    value = jnp.asarray
    others = [
        patch((0.1, 1.0, 0.0)), patch(normal=Penalty(value(1e5))), patch(stiffness_2=value(1e4)),
        patch(damping=value(1e-4)),
    ]  # fmt: skip
    assert not any(isinstance(model([one], 64, 2, 0.0), JenkinsPlay) for one in others)
    assert not isinstance(model([patch()], 64, 1, 0.0), JenkinsPlay)


def test_what_never_slides_is_a_spring() -> None:
    """A motion that only sticks is carried by a spring, its mean included."""
    u = 1e-6 * np.array([[[2.0, 1, 0, 0, 1]]])
    np.testing.assert_allclose(JenkinsPlay(patch(), 1, 16, 2).force(u, 1.0), 2e4 * (0.36 + 2.56) * u, atol=1e-13)


def test_a_stop_has_its_closed_form_from_few_samples() -> None:
    """k (A cos t - g) while cos t > g / A = cos a: mean k (A sin a - g a) / pi, first harmonic
    (2 k / pi) (A (a / 2 + sin 2a / 4) - g sin a)."""
    k, A = 7.0, 1.3
    for gap in (0.2, -0.4, 1.2999, -2.0):
        a = np.pi if gap < -A else np.arccos(gap / A)
        u = np.zeros((1, 1, 9))
        u[0, 0, 1] = A
        F = stop_model(Stop(np.array(k), np.array(gap)), 16).force(u, 1.0)[0, 0]
        assert F[0] == pytest.approx(k * (A * np.sin(a) - gap * a) / np.pi, rel=1e-8, abs=1e-12)
        first = 2 * k / np.pi * (A * (0.5 * a + 0.25 * np.sin(2 * a)) - gap * np.sin(a))
        assert F[1] == pytest.approx(first, rel=1e-8, abs=1e-12)


def stop_model(law: Stop, samples: int) -> Forces:
    """Of one point that moves along t1."""
    shape = np.zeros((1, 3, 1))
    shape[0, 1, 0] = 1.0
    return model([Patch("element", np.zeros((1, 2)), np.ones(1), law, shape)], samples, 2, 1e-10)


@pytest.mark.parametrize("both", [False, True])
def test_a_stop_is_the_limit_of_many_samples_and_its_derivative_that_of_differences(
    both: bool,
) -> None:
    law, rng = Stop(np.array(3.0), np.array(0.3), both), np.random.default_rng(4)
    exact = stop_model(law, 32)
    sampled = [ElasticSpring(exact.patch, 1, n, 2) for n in (2048, 8192)]
    for _ in range(5):
        u = rng.normal(size=(1, 1, 9)) / (1 + np.arange(9) // 2)
        F, S = exact.forces(u, 1.0)
        coarse, fine = (np.abs(one.force(u, 1.0) - F).max() for one in sampled)
        assert fine < 1e-6 and fine < 0.3 * coarse + 1e-12  # sampling is of second order, to this
        D = np.stack(
            [(exact.force(u + e, 1.0) - exact.force(u - e, 1.0))[0, 0] / 2e-6
             for e in 1e-6 * np.eye(9)[:, None, None]], axis=1,
        )  # fmt: skip
        assert np.abs(S[0, 0, :, 0] - D).max() < 1e-5


def hammer(damping: float) -> Assembly:
    """A stop a hundred times as stiff as its oscillator."""
    return ms.structure(1.0, 1.0, damping, force={0: 1.0}, elements=[ms.stop(100.0, 0.5)])


@pytest.mark.parametrize("harmonics", [3, pytest.param(7, marks=pytest.mark.slow)])
def test_a_curve_through_lift_off_has_no_folds_of_the_sampling(harmonics: int) -> None:
    """With so few samples that they only tell where the contact is, folds and peak are those of
    many: of the sampled force there are 218 folds with 64 and 366 with 1,024."""
    few, many = (
        ms.follow(hammer(0.2), 0.6, 1.0, harmonics=harmonics, samples=n, unit="rad/s")
        for n in (4 * harmonics + 4, 256)
    )
    assert len(few.folds) == 2
    np.testing.assert_allclose(few.folds, many.folds, rtol=1e-6)
    assert few.frequency.max() == pytest.approx(many.frequency.max(), rel=1e-6)


@pytest.mark.slow
def test_between_two_folds_of_a_stop_both_motions_stay_in_time() -> None:
    """0.775 is between the folds of a superharmonic resonance, 0.749 and 0.803: the first and the
    last of three motions of the curve are those that the motion in time stays on."""
    omega, system = 0.775, hammer(0.1)
    curve = ms.follow(
        system, 0.6, 0.9, harmonics=31, samples=128, unit="rad/s", settings={"targets": (omega,)}
    )
    at = np.flatnonzero(np.abs(curve.parameter - omega) < 1e-9)
    assert len(at) == 3
    for i in at[[0, 2]]:
        a = curve.harmonics()[i]
        speed = -omega * float(np.arange(len(a)) @ a.imag)
        start = {"displacement": {0: float(a.real.sum())}, "velocity": {0: speed}}
        seen = ms.integrate(system, omega, unit="rad/s", settle=300, keep=1, start=start)
        first = 2 * np.mean(seen.y[0, :256] * np.exp(-1j * omega * seen.time[:256]))
        assert abs(first) == pytest.approx(abs(a[1]), rel=2e-3)

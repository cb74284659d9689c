"""Multi-harmonic response with contact laws: limits, closed forms, derivatives, time integration, energy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from closed_forms.one_harmonic import JenkinsContact, frequency_response
from refusals import refused
from test_harmonic_balance_time import body, slider

from microslip import continuation
from microslip.case import CaseResult, CaseSettings, load_case, run_case
from microslip.case.assemble import build
from microslip.case.messages import not_periodic
from microslip.case.problem import problem_of
from microslip.contact.friction import Coulomb, Falling
from microslip.contact.heights import Polynomial
from microslip.contact.law import Law
from microslip.contact.normal import Normal, Penalty, Preload, Rough
from microslip.contact.patch import Patch, equilibrium, grid, stuck_stiffness, thinned
from microslip.contact.point import PointContact
from microslip.data import ModalBasis, ModalGroup
from microslip.errors import NotConverged
from microslip.harmonic_balance import solver
from microslip.harmonic_balance.forces import AFT
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.reduced import stuck
from microslip.harmonic_balance.response import HarmonicResponse, harmonic_response, newton, of_body
from microslip.system import Body, Contact, Force, Monitor, Spring, System


def value(number: float) -> jax.Array:
    return jnp.asarray(number, dtype=float)


def oscillator(ratio: float = 0.02) -> ModalGroup:
    """1 kg on 1e4 N/m that moves along t1."""
    rows = np.zeros((6, 1))
    rows[1] = 1.0
    return body(rows, np.array([100.0]), ratio)


def point(normal: Normal, stiffness: float, mu: float) -> Patch:
    """One point contact in the middle of the patch."""
    return Patch("face", np.zeros((1, 2)), np.ones(1), PointContact(normal, Coulomb(value(mu)), value(stiffness)))


def rough_patch(counts: tuple[int, int], stiffness: float = 8e8, mu: float = 0.2) -> Patch:
    """72 x 5 mm, R_Z = 12 um: numbers of the shroud of section 5.3."""
    places, areas = grid(0.072, 0.005, counts)
    n = len(areas)
    normal = Rough(value(stiffness / n), value(12e-6), Polynomial())
    return Patch("face", places, areas, PointContact(normal, Coulomb(value(mu)), value(0.1 * stiffness / n)))


def three_dof(ratio: float = 0.02) -> ModalGroup:
    """1 kg that moves along n, t1 and t2 with 60, 16 and 20 Hz."""
    rows = np.vstack([np.eye(3), np.zeros((3, 3))])
    return body(rows, 2 * np.pi * np.array([60.0, 16.0, 20.0]), ratio)


# equilibrium -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("counts", [(1, 1), (6, 2), (24, 5)])
def test_equilibrium_of_a_pure_approach_does_not_depend_on_the_mesh(counts: tuple[int, int]) -> None:
    """(5.2-5) with the factor 1/(n_y n_z) of the errata: F_N = c_N0 R_Z (x^3 - x^4/2), x = u_G/R_Z below 1."""
    u = equilibrium(rough_patch(counts), 780.0)
    x = u[0] / 12e-6
    assert 8e8 * 12e-6 * (x**3 - x**4 / 2) == pytest.approx(780.0, rel=1e-11)
    np.testing.assert_allclose(u[1:], 0.0, atol=1e-15)


def test_no_equilibrium_says_what_to_do() -> None:
    """A single point beside the origin holds no moment: nothing carries a centred force."""
    one = replace(rough_patch((1, 1)), points=np.array([[0.003, 0.002]]))
    with pytest.raises(NotConverged, match=r"no equilibrium under 10 N was found with 1 point; raise points"):
        equilibrium(one, 10.0)
    with pytest.raises(NotConverged, match=r"under 10 N and moments of 1 and 0 N m .* the 1 of the mesh: refine"):
        equilibrium(replace(one, shapes=one.kinematics), 10.0, (1.0, 0.0))


def test_equilibrium_under_moments() -> None:
    """The forces found at the equilibrium are those asked for; a linear contact tilts by M / (c h0^2 / 12)."""
    patch = rough_patch((12, 4))
    u = equilibrium(patch, 780.0, (0.4, -6.0))
    approach = patch.kinematics[:, 0] @ u
    force = np.asarray(patch.law.normal.force(jnp.asarray(approach)))
    y, z = patch.points.T
    np.testing.assert_allclose([force.sum(), force @ z, -force @ y], [780.0, 0.4, -6.0], rtol=1e-9)
    linear = replace(patch, law=replace(patch.law, normal=Penalty(value(8e8 / 48))))
    tilted = equilibrium(linear, 780.0, (0.2, 0.0))
    assert tilted[4] == pytest.approx(0.2 / (8e8 * 0.005**2 * (1 - 1 / 4**2) / 12), rel=1e-9)


def test_forces_that_no_contact_has_are_refused() -> None:
    refused("cannot pull", equilibrium, rough_patch((2, 2)), -1.0)
    refused("no approach", equilibrium, point(Preload(value(3.0)), 1e6, 0.2), 5.0)


def test_stiffness_of_a_closed_sticking_patch() -> None:
    """c_N0 h0^2/12 (1 - 1/n^2) about t1 and so on (errata to 5.2-40/41), and no coupling."""
    patch = rough_patch((9, 4))
    closed = replace(patch, law=replace(patch.law, normal=Penalty(value(8e8 / 36))))
    K = stuck_stiffness(closed, np.array([1e-6, 0, 0, 0, 0, 0]))
    b2, h2 = 0.072**2 / 12 * (1 - 1 / 81), 0.005**2 / 12 * (1 - 1 / 16)
    expected = [8e8, 8e7, 8e7, 8e7 * (b2 + h2), 8e8 * h2, 8e8 * b2]
    np.testing.assert_allclose(K, np.diag(expected), rtol=1e-12, atol=1e-7)


# limits ------------------------------------------------------------------------------------------------------------


def modes_with_rows(seed: int = 3) -> tuple[ModalGroup, np.ndarray, np.ndarray]:
    """Five modes that move all six coordinates of the face; a force and a monitor."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(6, 5)) * np.array([1, 1, 1, 10, 10, 10])[:, None]
    omega = 2 * np.pi * np.array([30.0, 55, 90, 170, 260])
    return body(rows, omega, 0.003), rng.normal(size=5), rng.normal(size=5)


def test_linear_limit_is_modal_superposition() -> None:
    """Pressed so hard that nothing opens, held so fast that nothing slides: springs; harmonics 0, 2, 3 vanish."""
    g, force, watched = modes_with_rows()
    places, areas = grid(0.072, 0.005, (3, 2))
    law = PointContact(Penalty(value(3e6 / 6)), Coulomb(value(1e6)), value(1e6 / 6))
    patch = Patch("face", places, areas, law)
    frequency = np.linspace(20, 300, 5)
    problem = of_body(g, (patch,), np.array([1e5]), force, watched, samples=36, cycles=30)  # as rings of tests
    r = harmonic_response(problem, frequency)
    K = g.K_r + g.interfaces["face"].rows.T @ problem.stiffness[0] @ g.interfaces["face"].rows
    Omega = 2 * np.pi * frequency
    exact = [watched @ np.linalg.solve(K - w**2 * g.M_r + 1j * w * g.C_r, force) for w in Omega]
    assert r.converged.all() and r.slipping.max() == r.open.max() == 0
    np.testing.assert_allclose(r.monitor, exact, rtol=1e-9)
    np.testing.assert_allclose(r.harmonics[:, [0, 2, 3]], 0, atol=1e-9 * np.abs(exact).max())
    values = np.sqrt(np.linalg.eigvalsh(K)) / 2 / np.pi
    np.testing.assert_allclose(stuck(problem.parts[0][0], problem.stiffness[0]), values, rtol=1e-9)


@pytest.mark.parametrize("scale", [pytest.param(0.01, marks=pytest.mark.slow), 30.0])
def test_the_reference_stiffness_does_not_matter(scale: float) -> None:
    """Any k on the left side gives the same response, and the same residual up to the factor (1 + D k)."""
    g, force, watched = modes_with_rows()
    problem = of_body(g, (rough_patch((3, 2), 8e6),), np.array([20.0]), 5 * force, watched, harmonics=1, samples=16)
    other = replace(problem, stiffness=(scale * problem.stiffness[0],))
    frequency = np.array([40.0, 60.0])
    a, b = (harmonic_response(p, frequency) for p in (problem, other))
    assert a.converged.all() and b.converged.all() and a.slipping.max() > 0
    np.testing.assert_allclose(a.harmonics, b.harmonics, rtol=0, atol=1e-7 * np.abs(a.monitor).max())


@pytest.mark.slow
def test_one_harmonic_and_a_constant_force_are_the_closed_form() -> None:
    """The sampled force converges to the closed form with the square of the step."""
    g, limit, kt = oscillator(), 0.6, 2e4
    frequency = np.linspace(12, 40, 15)
    one = np.array([1.0])
    exact = frequency_response(g, [JenkinsContact("face", np.zeros(6), 1, kt, limit)], one, one, frequency)
    errors = []
    for samples in (64, 256):
        patch = point(Preload(value(2.0)), kt, 0.3)
        problem = of_body(g, (patch,), np.array([2.0]), one, one, harmonics=1, samples=samples)
        r = harmonic_response(problem, frequency)
        assert r.converged.all()
        errors.append(float(np.abs(r.monitor - exact.monitor).max() / np.abs(exact.monitor).max()))
    assert errors[1] < 2e-4 and errors[0] > 8 * errors[1]


# derivatives -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rates", [False, True])
def test_derivatives_against_differences(rates: bool) -> None:
    """dR/dx and dR/dOmega of a slipping, partly opening patch; with friction that falls with the speed as well."""
    g, force, watched = modes_with_rows()
    patch = rough_patch((3, 2), 8e6)
    if rates:
        patch = replace(patch, law=replace(patch.law, friction=Falling(value(0.2), value(40.0))))
    problem = of_body(g, (patch,), np.array([20.0]), 8 * force, watched, harmonics=1, samples=16, length=1e-5)
    rng = np.random.default_rng(1)
    Omega, x = 2 * np.pi * 47.0, 0.6 * rng.normal(size=problem.size)
    R, J, R_Omega = problem.evaluate(x, Omega)
    direction = rng.normal(size=problem.size)
    h = 1e-6
    along = (problem.evaluate(x + h * direction, Omega)[0] - problem.evaluate(x - h * direction, Omega)[0]) / (2 * h)
    np.testing.assert_allclose(J @ direction, along, rtol=0, atol=2e-6 * np.abs(along).max())
    h = 1e-5 * Omega
    along = (problem.evaluate(x, Omega + h)[0] - problem.evaluate(x, Omega - h)[0]) / (2 * h)
    np.testing.assert_allclose(R_Omega, along, rtol=0, atol=1e-6 * np.abs(along).max())
    np.testing.assert_allclose(R, problem.at(Omega).residual(x), rtol=0, atol=1e-12 * np.abs(R).max())


def test_old_derivatives_tell_what_was_shown_and_nothing_else() -> None:
    """Broyden's update: the change of force from one motion to another, and no change across that way."""
    g, force, watched = modes_with_rows()
    problem = of_body(g, (rough_patch((3, 2), 8e6),), np.array([20.0]), 8 * force, watched, harmonics=1, samples=16)
    at, rng = problem.at(2 * np.pi * 47.0), np.random.default_rng(1)
    x, way, other = rng.normal(size=(3, problem.size))
    before, after, old = at.tried(x)[1], at.tried(x + 0.1 * way)[1], at.forces(x)[1]
    ((u_0, F_0, _),), ((u_1, F_1, _),), (new,) = before, after, at.secant(old, before, after)
    np.testing.assert_allclose(np.einsum("nkwlz,nlz->nkw", new, u_1 - u_0), F_1 - F_0, atol=1e-12 * np.abs(F_1).max())
    across = other - way * (other @ way) / (way @ way)
    (moved,) = [group.relative(problem.displacement(across)) for group in problem.groups]
    moved[:, :, 0] -= problem.groups[0].offset
    kept, was = (np.einsum("nkwlz,nlz->nkw", S, moved) for S in (new, old[0]))
    np.testing.assert_allclose(kept, was, atol=1e-9 * np.abs(was).max())


def test_few_points_tell_how_many_give_way() -> None:
    """Sticking under an even pressure exactly; sliding, tilted and twisted, to some hundredths."""
    patch, width = rough_patch((26, 5)), np.array([1.0, 1.0, 1.0, 0.036, 0.0025, 0.036])
    few, model = thinned(patch), AFT(patch, 1, 16, 100)
    assert few is not None and len(few.chosen) < 50 and few.share.sum() == pytest.approx(130)
    u = np.zeros((1, 6, 3))
    u[0, 0, 0] = 4e-6
    tilted = u + 1e-6 * np.random.default_rng(2).normal(size=u.shape) / width[:, None]
    for motion, apart in ((u, 1e-9), (tilted, 0.05)):
        whole, told = (m.forces(motion, 0.01)[1] / np.einsum("i,j->ij", width, width)[:, None, :, None]
                       for m in (model, model.few))  # fmt: skip
        assert 0 < np.abs(whole - told).max() < apart * np.abs(whole).max()


def test_a_patch_that_few_points_cannot_stand_for_is_left_whole() -> None:
    small, deforms = rough_patch((9, 5)), rough_patch((26, 5))
    shapes = np.concatenate([deforms.kinematics, np.eye(390).reshape(130, 3, 390)], axis=2)
    assert thinned(small) is None and thinned(replace(deforms, shapes=shapes)) is None


def test_a_start_is_told_by_the_polynomial_that_told_the_last_point() -> None:
    """Exact for a parabola and for a line; after a kink the line is taken, which forgets what lies before it."""
    Omega = np.array([1.0, 1.1, 1.3, 1.4, 1.45])
    for told, ahead in ((lambda w: w**2 - w, 1.6**2 - 1.6), (lambda w: 2 * w, 3.2), (lambda w: max(w, 1.3), 1.6)):
        points = [solver.Point(w, np.array([told(w)]), solver.CONVERGED, 0.0, 0) for w in Omega]
        np.testing.assert_allclose(solver._ahead(points, 1.6), ahead, rtol=1e-12)


# time integration --------------------------------------------------------------------------------------------------


def marched(
    g: ModalGroup, law: Law, problem: Problem, force: np.ndarray, f: float, periods: int, steps: int
) -> tuple[np.ndarray, float]:
    """(steps, m) coordinates over the last of many periods by central differences, and the work of the last force.

    The law is marched along with the motion, from rest in the preloaded state: an integrator of its own, second order
    in the step.
    """
    rows = g.interfaces["face"].rows[:3]
    Omega, m = 2 * np.pi * f, g.n_modes
    dt = 2 * np.pi / Omega / steps
    K, C, T = jnp.asarray(g.K_r), jnp.diag(jnp.asarray(g.C_r)), jnp.asarray(rows)
    load, preload = jnp.asarray(force), jnp.asarray(problem.groups[0].preload[0, :3])
    offset = jnp.asarray(problem.groups[0].offset[0, :3])

    def one(carried: Any, i: jax.Array) -> tuple[Any, tuple[jax.Array, jax.Array]]:
        q, before, state = carried
        u, v = offset + T @ q, T @ (q - before) / dt
        F, state = law.step(u[None], v[None], dt, state)
        drive = load * jnp.cos(Omega * i * dt) - K @ q - T.T @ (F[0] - preload)
        after = (dt**2 * drive + 2 * q - before + 0.5 * C * dt * before) / (1 + 0.5 * C * dt)
        return (after, q, state), (q, F[0])

    @jax.jit
    def period(carried: Any, start: jax.Array) -> tuple[Any, tuple[jax.Array, jax.Array]]:
        return jax.lax.scan(one, carried, start + jnp.arange(steps))

    carried = (jnp.zeros(m), jnp.zeros(m), law.init(1))
    for i in range(periods):
        carried, (q, F) = period(carried, jnp.asarray(i * steps))
    u = np.asarray(q) @ rows.T
    closing = np.roll(np.asarray(F), -1, axis=0)
    moved = np.roll(u, -1, axis=0) - u
    return np.asarray(q), float(np.sum(0.5 * (np.asarray(F) + closing) * moved))


def in_time(problem: Problem, r: HarmonicResponse, steps: int) -> np.ndarray:
    """(steps, 6) displacement of the contact from the preloaded state over a period."""
    t = 2 * np.pi * np.arange(steps) / steps
    H = r.contact.shape[2] // 2
    waves = [np.ones(steps)] + [w(h * t) for h in range(1, H + 1) for w in (np.cos, np.sin)]
    return (r.contact[0] @ np.array(waves)).T - problem.groups[0].offset[0]


@pytest.mark.slow
@pytest.mark.parametrize("f", [17.0, 21.0])
def test_jenkins_oscillator_against_time_integration(f: float) -> None:
    """Relative 1e-4 of the amplitude over the whole period (21 harmonics; the force has a kink)."""
    g, one = oscillator(), np.array([1.0])
    patch = point(Preload(value(2.0)), 2e4, 0.3)
    problem = of_body(g, (patch,), np.array([2.0]), one, one, harmonics=21, samples=2048, length=1e-4)
    r = harmonic_response(problem, np.array([f]))
    q, lost = marched(g, patch.law, problem, one, f, 80, 2048)
    u = in_time(problem, r, 2048)[:, 1]
    assert r.converged.all() and r.slipping[0, 0] > 0.05
    np.testing.assert_allclose(u, q[:, 0], rtol=0, atol=1e-4 * np.abs(u).max())
    assert r.dissipated[0] == pytest.approx(lost, rel=1e-4)


def swinging(load: tuple[float, float, float], harmonics: int, samples: int) -> tuple[Problem, HarmonicResponse]:
    """Three directions driven at 22 Hz, 8 N of preload: normal force and both tangential ones vary."""
    law = PointContact(Penalty(value(2e5)), Coulomb(value(0.4)), value(6e4))
    patch = Patch("face", np.zeros((1, 2)), np.ones(1), law)
    problem = of_body(
        three_dof(0.03), (patch,), np.array([8.0]), np.array(load), np.array([0, 1.0, 0]), harmonics=harmonics,
        samples=samples, cycles=3, length=1e-4,
    )  # fmt: skip
    return problem, harmonic_response(problem, np.array([22.0]))


@pytest.mark.slow
@pytest.mark.parametrize(("load", "opens"), [((12.0, 4.0, 2.0), False), ((20.0, 8.0, 4.0), True)])
def test_contact_in_space_under_a_swinging_normal_force_against_time_integration(
    load: tuple[float, float, float], opens: bool
) -> None:
    """Slip in both directions, without and with lift-off: relative 1e-4 of the amplitude over the whole period.

    The slider follows its direction to first order in the step, so both ways take the same step: what is compared
    are the balance and its 21 harmonics, not the step.
    """
    problem, r = swinging(load, 21, 2048)
    q, lost = marched(three_dof(0.03), problem.assembly.contacts[0].patch.law, problem, np.array(load), 22.0, 90, 2048)
    assert r.converged.all() and r.slipping[0, 0] > 0.5 and (r.open[0, 0] > 0.3) == opens
    np.testing.assert_allclose(in_time(problem, r, 2048)[:, :3], q, rtol=0, atol=1e-4 * np.abs(q).max())
    assert r.dissipated[0] == pytest.approx(lost, rel=1e-4)


@pytest.mark.slow
def test_one_harmonic_is_not_enough() -> None:
    """What the others are for: against 21 of them one is off by more than 10 %, three by less than half of that."""
    amplitude = [abs(swinging((20.0, 8.0, 4.0), H, 2048)[1].monitor[0]) for H in (1, 3, 21)]
    error = np.abs(np.array(amplitude[:2]) / amplitude[2] - 1)
    assert error[0] > 0.1 and error[1] < 0.5 * error[0]


@pytest.mark.slow
def test_work_of_the_excitation_is_the_friction_along_the_slip_path() -> None:
    """Supplied less damped, of the harmonics, against force times path slid, in time; the gap closes with the step."""
    gaps = []
    for samples in (512, 2048):
        r = swinging((12.0, 4.0, 2.0), 21, samples)[1]
        gaps.append(float(abs((r.supplied - r.damped - r.by_slip)[0] / r.by_slip[0])))
        assert r.dissipated[0] == pytest.approx((r.supplied - r.damped)[0], rel=1e-9)
    assert gaps[1] < 5e-6 and gaps[0] > 3 * gaps[1]


# robustness --------------------------------------------------------------------------------------------------------


def test_a_point_that_fails_is_recorded_and_the_sweep_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    from microslip.harmonic_balance import solver

    def stubborn(at: Any, x: np.ndarray, *given: Any, **more: Any) -> Any:
        found = newton(at, x, *given, **more)
        bad = abs(at.Omega - 2 * np.pi * 20.0) < 1e-9
        return replace(found, status="no convergence") if bad else found

    newton = solver.newton
    monkeypatch.setattr(solver, "newton", stubborn)
    problem = slider(1, 64)
    told: list[str] = []
    r = harmonic_response(problem, np.array([19.0, 20.0, 21.0]), told.append)
    assert r.converged.tolist() == [True, False, True] and "no convergence" in r.status[1]
    assert told[1:] == [
        "2 of 3 frequencies: 20 Hz",
        "2 of 3 frequencies: 20 Hz; once more from rest",
        "2 of 3 frequencies: 20 Hz; once more along the load",
        "3 of 3 frequencies: 21 Hz, 1 not converged",
        "2 of 3 frequencies: 20 Hz once more, from above",
    ]


def test_a_body_that_only_its_contact_holds() -> None:
    """A mass free along n, pressed on the ground: the mean force is the preload, whatever the contact rectifies."""
    g = body(np.vstack([np.eye(3), np.zeros((3, 3))]), np.array([0.0, 100.0, 100.0]))
    force = np.array([6.0, 0.5, 0.0])
    problem = of_body(g, (rough_patch((3, 2), 8e6),), np.array([8.0]), force, force, harmonics=1, samples=16)
    r = harmonic_response(problem, np.array([20.0, 40.0]))
    assert r.converged.all()
    for x, f in zip(r.x, r.frequency, strict=True):
        assert problem.at(2 * np.pi * f).force(x)[0, 0] == pytest.approx(0.0, abs=8e-8)  # beyond the preload
    assert np.abs(r.harmonics[:, 0]).min() > 1e-9  # the mean approach is not that of the preload


@pytest.mark.slow
def test_a_body_that_walks_away_is_no_solution() -> None:
    """Free along the tangent too: normal load and friction in phase push it on, no mean holds it. No false answer."""
    g = body(np.vstack([np.eye(3), np.zeros((3, 3))]), np.zeros(3))
    force = np.array([6.0, 0.5, 0.0])
    patch = Patch("face", np.zeros((1, 2)), np.ones(1), rough_patch((1, 1), 8e6).law)
    r = harmonic_response(
        of_body(g, (patch,), np.array([8.0]), force, force, samples=128, cycles=10), np.array([20.0])
    )
    assert not r.converged.any() and np.isfinite(r.error).all() and np.isfinite(r.x).all()


@pytest.mark.slow
def test_continuation_follows_a_contact_that_lifts_off_through_its_folds() -> None:
    """A mass pressed on a spring that cannot pull softens where it lifts off: the resonance leans over, with three
    solutions between two folds. On the curve R vanishes; at three frequencies it meets what Newton's method finds.

    4096 samples: the samples that open one after the other make little folds of their own, 22 with 64 of them, six of
    20 mHz with 1024.
    """
    g = body(np.vstack([np.eye(3), np.zeros((3, 3))])[:, :1], 2 * np.pi * np.array([30.0]), 0.03)
    one, low, high = np.array([1.0]), 2 * np.pi * 40.0, 2 * np.pi * 100.0
    problem = of_body(
        g, (point(Penalty(value(2e5)), 1e5, 0.3),), np.array([8.0]), 0.8 * one, one, samples=4096, length=1e-5
    )
    targets = tuple(2 * np.pi * np.array([50.0, 60.0, 90.0]))
    settings = continuation.Settings(low=low, high=high, targets=targets)
    branch = continuation.trace(problem, problem.at(low).reference, low, settings)
    folds = branch.of_kind("fold")
    assert branch.lam[-1] == pytest.approx(high) and len(folds) == 2 and folds[0].lam > folds[1].lam
    assert max(np.abs(problem.at(p.lam).residual(p.x)).max() / np.abs(p.x).max() for p in branch.points) < 1e-7
    for target, count in zip(targets, (1, 3, 1), strict=True):
        hits = [p.x for p in branch.of_kind("target") if p.lam == target]
        found = newton(problem.at(target), problem.at(target).reference)
        assert found.converged and len(hits) == count
        assert min(np.abs(x - found.x).max() for x in hits) < 1e-7 * np.abs(found.x).max()


# case files --------------------------------------------------------------------------------------------------------

CASE = """
name = "sled"
body = "sled"
excitation = "push"
amplitude = 2.0
monitor = "middle"
harmonics = 2
samples = 32

[[contacts]]
interface = "sole"
law = "smooth"
normal_stiffness = 3e6
tangential_stiffness = 1e6
friction = 0.3
points = [4, 2]
width = 0.06
height = 0.03

[sweep]
start = 35.0
stop = 200.0
points = 25
normal_forces = [5.0, 1e5]
"""

SECOND = """
[[contacts]]
interface = "sole"
normal_stiffness = 1.0
tangential_stiffness = 1.0
friction = 0.1
"""


def sled() -> ModalBasis:
    """A block of 2 kg on soft springs that is pushed along its sole."""
    block = Body("block", 2.0, (0.0, 0.0, 0.0), inertia=(0.01, 0.02, 0.015))
    legs = [Spring("ground", "block", (2e5, 2e5, 2e5, 500.0, 500.0, 500.0))]
    sole = Contact("sole", "block", (0, 0, -1), t2=(0, 1, 0), at=(0, 0, -0.02))
    push, middle = Force("push", "block", (1, 0.2, 0), at=(0, 0, 0.01)), Monitor("middle", "block")
    return System("sled", [block], legs, [sole], [push], [middle], ratio=0.01).basis()


def asked(folder: Path, *replaced: tuple[str, str]) -> CaseSettings:
    text = CASE
    for old, new in replaced:
        assert old in text
        text = text.replace(old, new)
    (folder / "case.toml").write_text(text)
    return load_case(folder / "case.toml")[0]


FEW = ("start = 35.0\nstop = 200.0\npoints = 25", "start = 45.0\nstop = 136.0\npoints = 8")
"""A band in which nothing takes long."""


@pytest.fixture(scope="module")
def answered(tmp_path_factory: pytest.TempPathFactory, unjudged_file: None) -> CaseResult:
    return run_case(asked(tmp_path_factory.mktemp("sled"), FEW), sled())


def test_a_case_with_a_law_that_sticks_is_springs(answered: CaseResult, tmp_path: Path) -> None:
    """Pressed by 1e5 N both are the same springs, if the Jenkins elements are given the width and height whose
    rotational stiffness is that of four by two points: (1 - 1/n^2) of a uniform patch (errata to 5.2-40/41)."""
    result = answered
    narrow = f"width = {0.06 * np.sqrt(1 - 1 / 16)}\nheight = {0.03 * np.sqrt(1 - 1 / 4)}"
    law, size = ('"smooth"', '"jenkins"'), ("points = [4, 2]\nwidth = 0.06\nheight = 0.03", narrow)
    pressed = ("normal_forces = [5.0, 1e5]", "normal_forces = [1e5]")
    springs = run_case(asked(tmp_path, FEW, law, size, pressed), sled())
    assert all(r.converged.all() for r in result.responses.values())
    np.testing.assert_allclose(result.responses[1e5].monitor, springs.responses[1e5].monitor, rtol=1e-8)
    np.testing.assert_allclose(result.stuck, springs.stuck, rtol=1e-8)


def test_a_case_with_a_law_slides_and_its_table_says_how(answered: CaseResult) -> None:
    result = answered
    loose = result.responses[5.0]
    assert isinstance(loose, HarmonicResponse) and loose.slipping.max() > 0.3
    assert np.abs(loose.monitor).max() < np.abs(result.responses[1e5].monitor).max()
    table, size = loose.columns(), np.abs(loose.harmonics)
    np.testing.assert_allclose(table["slipping"], loose.slipping[:, 0], rtol=1e-8)
    np.testing.assert_allclose(table["amplitude_m"], size[:, 1], rtol=1e-8)
    assert not table["amplitude_2_m"].any() and size[:, 2].any()  # a symmetric motion has rounding alone
    heard = replace(loose, harmonics=loose.harmonics + np.outer(loose.harmonics[:, 1], [0, 0, 1e-9])).columns()
    np.testing.assert_allclose(heard["amplitude_2_m"], 1e-9 * np.abs(loose.harmonics[:, 1]), rtol=0.02)
    top = int(np.abs(loose.monitor).argmax())
    found = dict(result.resonances[5.0])
    assert max(found.values()) >= np.abs(loose.monitor[top])


def test_a_case_says_when_sliders_are_settled(tmp_path: Path) -> None:
    """None at all marches every cycle and finds the same; a wide share leaves its mark, and a message says so."""
    found = {}
    for periodicity in (0.0, 1e-10, 1e-2):
        settings = asked(tmp_path, ("samples = 32", f"samples = 32\nperiodicity = {periodicity}"))
        built = build(settings, {"sled": sled()})
        problem = problem_of(built, 5.0)
        assert getattr(problem.groups[0].model, "periodicity", None) == periodicity
        found[periodicity] = harmonic_response(problem, np.array([60.0])).monitor[0]
    assert found[1e-10] == pytest.approx(found[0.0], rel=1e-8)
    assert found[1e-2] == pytest.approx(found[0.0], rel=1e-2)
    (message,) = not_periodic(5.0, np.array([4e-3]), settings)
    assert "up to 0.4 % in the next one; lower periodicity." in message


DESCRIBED = 'law = "smooth"\nnormal_stiffness = 3e6\ntangential_stiffness = 1e6\nfriction = 0.3'


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('law = "smooth"', 'law = "rough"', "roughness (R_Z, or a table) belongs to"),
        ('law = "smooth"', 'law = "smooth"\nroughness = 1e-5', "roughness (R_Z, or a table) belongs to"),
        ("samples = 32", "samples = 8\n", "samples: "),
        ("harmonics = 2", "harmonics = 9", "take at least 36"),
        ("points = [4, 2]", "points = [4, 0]", "points"),
        ("samples = 32", "samples = 32\nperiodicity = 0.1", "periodicity: must not be greater than 0.01"),
        ("samples = 32", "samples = 32\nperiodicity = -1e-9", "periodicity: must not be less than 0"),
        ("[sweep]", SECOND + "\n[sweep]", "contacts 1 and 2"),
        ('law = "smooth"', 'file = "sole.toml"', "normal_stiffness: stands in the contact file already"),
        ("friction = 0.3\n", "", "friction: is missing; give it, or a contact file"),
        (DESCRIBED, 'file = "sole.toml"', "sole.toml"),
    ],
)  # fmt: skip
def test_mistakes_in_a_case_with_laws(tmp_path: Path, old: str, new: str, told: str) -> None:
    more = [("harmonics = 2", "harmonics = 3")] if "samples" in old else []

    def run() -> None:
        run_case(asked(tmp_path, (old, new), *more), sled())

    refused(told, run)


CONTACT = """
name = "sole"
length_unit = "m"
[stiffness]
kind = "given"
normal = 3e6
tangential = 1e6
[friction]
kind = "coulomb"
mu = 0.3
"""


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_a_case_with_the_law_of_a_contact_file(tmp_path: Path) -> None:
    """The smooth law written in a file of its own, shared out among eight points: the same response, 1e-10."""
    (tmp_path / "sole.toml").write_text(CONTACT)
    own = (DESCRIBED, 'file = "sole.toml"')
    settings = asked(tmp_path, own, FEW)
    by_file, by_case = (run_case(s, sled()) for s in (settings, asked(tmp_path, FEW)))
    for normal, r in by_case.responses.items():
        np.testing.assert_allclose(by_file.responses[normal].monitor, r.monitor, rtol=1e-9)
    assert by_case.responses[5.0].slipping.max() > 0.3

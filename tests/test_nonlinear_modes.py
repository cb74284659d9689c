"""Frequency and damping over the amplitude: limits, closed forms, and the resonances of forced vibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refused
from scipy.interpolate import PchipInterpolator
from scipy.special import ellipk
from test_assembly import sector
from test_harmonic_balance_laws import body
from test_harmonic_balance_time import slider

import microslip as ms
from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty, Preload
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.contact.rate import RateContact
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.nonlinear_modes import _Curve, backbone, strongest
from microslip.harmonic_balance.peak import highest, resonance
from microslip.harmonic_balance.response import of_body, operating
from microslip.harmonic_balance.solver import solve
from microslip.system.assembly import Output

ONE = np.array([1.0])


def sliding(harmonics=1, samples=1024, ratio=0.02, force=1.0):
    return slider(harmonics, samples, ratio, force)


@pytest.mark.parametrize(
    ("low", "high", "sizes"),
    [(2.5e-5, 5e-5, [1.5]), pytest.param(3e-6, 3e-3, [0.5, 1.5, 3, 10], marks=pytest.mark.slow)],
)
def test_a_jenkins_element_against_its_closed_form(low, high, sizes):
    """One harmonic, A > limit: with theta = acos(1 - 2 / A), c = (theta - sin(2 theta)/2)/pi, b = 4 (A - 1)/(pi A^2)
    (errata to chapter 5): omega^2 = k + kt c and 2 zeta omega = 2 D omega_0 + kt b / omega."""
    asked = 3e-5 * np.array(sizes)
    found = backbone(sliding(), low, high, asked=asked)
    assert found.complete and found.stuck == pytest.approx(np.sqrt(3e4))
    A = np.maximum(found.amplitude / 3e-5, 1.0)
    theta = np.arccos(1 - 2 / A)
    c, b = (theta - 0.5 * np.sin(2 * theta)) / np.pi, 4 * (A - 1) / (np.pi * A * A)
    omega = np.sqrt(1e4 + 2e4 * c)
    np.testing.assert_allclose(found.Omega, omega, rtol=2e-5)  # sampled 1024 times
    np.testing.assert_allclose(found.damping, (4.0 + 2e4 * b / omega) / (2 * omega), rtol=0, atol=1e-5)
    assert all((abs(found.amplitude - a) < 1e-9 * a).any() for a in asked)


def test_a_mode_that_is_nearly_linear_passes_its_checks():
    """Its elements take next to nothing, so that its energies are those of its dampers and of what feeds them: with
    respect to the elements' work alone rounding was a hundredth of a percent, and the mode counted as lost."""
    K = 2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)
    chain = ms.structure(np.eye(3), K, damping_ratio=0.01, elements=[ms.polynomial({3: 0.01}, at=2)], output=[0])
    mode = ms.backbone(chain, 1e-3, 1e-2, harmonics=1)
    np.testing.assert_allclose(mode.damping, 0.01, rtol=1e-5)
    assert mode.complete, mode.status


def test_a_mode_about_a_preload_takes_few_points():
    """k = 1 beside a spring of 10 pressed by 0.3, which stays closed: omega^2 = 11 at every amplitude, however far the
    mean is from zero. Its mean over the amplitude made a curve of more than a thousand points."""
    pressed = ms.structure(1.0, 1.0, 0.02, elements=[ms.stop(10.0, -0.3)], output=[0])
    mode = ms.backbone(pressed, 1e-3, 0.02, harmonics=3)
    assert mode.complete and len(mode.amplitude) < 30
    np.testing.assert_allclose(mode.Omega, np.sqrt(11.0), rtol=1e-9)


def test_a_mode_fed_too_little_fails_its_checks():
    """With a tenth less than its damping the forces of its contacts do not move the bodies as they move."""
    found, curve = backbone(sliding(), 2.0e-5, 2.1e-5), _Curve(replace(sliding(), share=0.0), 0)
    x, omega, xi = found.x[0], found.Omega[0], 2 * found.Omega[0] * found.damping[0]
    assert not curve.motion(x, omega, xi).checks.failure
    assert curve.motion(x, omega, 0.9 * xi).checks.failure.startswith("read-out")


def test_a_free_motion_in_time_decays_as_the_curve_says():
    """log(a / b) / pi of neighbouring half swings a > b is the damping ratio at sqrt(a b), to about 1 % of what changes
    within a swing; here it grows by two thirds while the motion falls to a third."""
    rubbing = ms.structure(1.0, 1.0, 0.004, elements=[ms.jenkins(0.04, 0.02)], output=[0])
    mode = ms.backbone(rubbing, 0.5, 10.0, harmonics=3)
    seen = ms.integrate_many(rubbing, 64.0, [[8.0]], [[0.0]], unit="rad/s", settle=0, keep=40 * 64, steps=4).y.ravel()
    a, b, c = seen[:-2], seen[1:-1], seen[2:]
    turns = (b - a) * (c - b) < 0
    swing = np.abs(np.diff((b - (a - c) ** 2 / (8 * (a - 2 * b + c)))[turns])) / 2
    drawn = np.interp(np.sqrt(swing[:-1] * swing[1:]), mode.amplitude, mode.damping)
    assert len(drawn) > 70 and drawn[-1] > 1.6 * drawn[0]
    np.testing.assert_allclose(np.log(swing[:-1] / swing[1:]) / np.pi, drawn, rtol=6e-3)


def highest_of_cubic(amplitude):
    """rad/s of q'' + q + q^3 = 0: pi sqrt(1 + A^2) / (2 K(m)), m = A^2 / (2 (1 + A^2))."""
    m = amplitude**2 / (2 * (1 + amplitude**2))
    return np.pi * np.sqrt(1 + amplitude**2) / (2 * ellipk(m))


@pytest.mark.parametrize("measure", ["norm", pytest.param("energy", marks=pytest.mark.slow)])
def test_duffing_has_its_closed_form(measure):
    duffing = ms.structure(1.0, 1.0, elements=[ms.polynomial({3: 1.0})], output=[0])
    problem = balance.of(duffing, 15, 240)
    mode = ms.backbone(problem, 1e-2, 10.0, measure=measure)
    cosines = (mode.x.reshape(-1, 31) * problem.scale)[:, 1::2]
    assert mode.complete and mode.stuck == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(mode.Omega, highest_of_cubic(cosines.sum(axis=1)), rtol=1e-8)
    if measure == "energy":
        np.testing.assert_allclose(mode.energy[[0, -1]], [1e-2, 10.0], rtol=1e-8)


def chain(harmonics):
    """Two masses and a cubic spring (G. Kerschen et al., Mechanical Systems and Signal Processing 23, 2009)."""
    K = np.array([[2.0, -1.0], [-1.0, 2.0]])
    system = ms.structure(np.eye(2), K, elements=[ms.polynomial({3: 0.5})], output=[0])
    return balance.of(system, harmonics, 64)


@pytest.mark.slow
def test_an_internal_resonance_is_followed_to_its_end_and_back():
    """The tongue 1:3 of the mode in phase leads to the mode out of phase at a third of its frequency, where its own
    first harmonic vanishes, and back on another branch: the energies there are those of the other mode."""
    first = ms.backbone(chain(7), 1e-2, 100.0)
    second = ms.backbone(chain(2), 1e-2, 100.0, mode=1)  # of 7 harmonics of a third these are there
    assert first.complete and [h for h, *_ in first.resonances] == [3]
    (_, hertz, share), end = first.resonances[0], first.amplitude[20:-20].argmin() + 20
    assert share > 0.98 and first.amplitude[end] < 1e-3 < 0.1 < first.amplitude[end + 20]
    near = np.argsort(second.Omega)
    energy = PchipInterpolator(second.Omega[near], second.energy[near])(3 * first.Omega[end])
    assert first.energy[end] == pytest.approx(float(energy), rel=1e-4)
    assert hertz == pytest.approx(0.22396, rel=1e-4)
    assert first.frequency[-1] < np.sqrt(2) / (2 * np.pi) < 1.02 * first.frequency[-1]  # both springs hold


def test_an_internal_resonance_that_is_passed_over_is_told():
    """Three times the frequency goes through sqrt(10), coupled by a ten thousandth: no step meets it."""
    K = np.array([[1.0, -1e-4], [-1e-4, 10.0]])
    weak = ms.structure(np.eye(2), K, elements=[ms.polynomial({3: 0.5})], output=[0])
    mode = ms.backbone(weak, 0.1, 2.0, harmonics=3)
    assert mode.complete and not mode.resonances
    (said,) = mode.passed
    passed = 2 * np.pi * float(said.split("times ")[1].split(" Hz")[0])
    assert said.startswith("3 times") and "mode 2" in said and 3 * passed == pytest.approx(np.sqrt(10), rel=0.05)
    assert "allow more" in ms.backbone(weak, 0.1, 2.0, harmonics=3, settings={"points": 3}).status


def braked(coefficient=0.3, damping=0.01, at=(1.0,), stiffness=1.0):
    """Friction by the velocity, 10 N times 2/pi arctan(2 v)."""
    law = RateContact(Preload(value(10.0)), Coulomb(value(coefficient)), value(2.0), value(0.0))
    n = len(at)
    return ms.structure(
        np.eye(n), stiffness, damping * np.eye(n), elements=[ms.Element(law, at=np.array(at))], output=[0]
    )


def test_friction_by_the_velocity_has_its_linearisation_and_its_closed_form():
    """One harmonic: omega = 1 and xi = c + mu F_N (4/pi) (sqrt(1 + z^2) - 1) / (z A), z = 2 A: the force
    in phase with the speed. Small motions are overdamped, and their frequency is positive."""
    mode = ms.backbone(braked(), 1e-3, 1e2, harmonics=1, samples=2048)
    z = 2 * mode.amplitude
    assert mode.complete and len(mode.amplitude) < 100
    np.testing.assert_allclose(mode.Omega, 1.0, rtol=1e-9)
    xi = 0.01 + 3 * 4 / np.pi * (np.sqrt(1 + z * z) - 1) / (z * mode.amplitude)
    np.testing.assert_allclose(2 * mode.damping, xi, rtol=1e-6)


def test_both_modes_of_a_braked_chain_begin_where_its_linearisation_has_them():
    """(K + i Omega C - (Omega^2 + i Omega xi) M) q = 0 with C that of the law at rest, 12/pi."""
    K = np.array([[2.0, -1.0], [-1.0, 2.0]])
    system, begun = braked(at=(1.0, 0.0), stiffness=K), []
    for mode in (0, 1):
        found = ms.backbone(system, 1e-6, 2e-6, mode=mode, harmonics=1)
        Omega, xi = found.Omega[0], 2 * found.Omega[0] * found.damping[0]
        A = K + 1j * Omega * np.diag([12 / np.pi + 0.01, 0.01]) - (Omega**2 + 1j * Omega * xi) * np.eye(2)
        assert np.abs(np.linalg.det(A)) < 1e-5 and Omega > 0
        begun.append(xi)
    assert max(begun) > 5 * min(begun)


@pytest.mark.slow
def test_small_motions_stick_and_large_ones_slide():
    """Two modes and eight points: the modes of both linear limits, each with its own damping."""
    problem = two_modes(4.0, harmonics=1)
    for mode in (0, 1):
        found = backbone(problem, 1e-7, 3.0, mode=mode)
        assert found.complete
        part, k = problem.parts[1][0], problem.stiffness[0]
        for i, stuck in ((0, k), (-1, 0.0 * k)):
            A = np.block([[np.zeros((2, 2)), np.eye(2)], [-part.K - part.rows.T @ stuck @ part.rows, -part.C]])
            values = np.linalg.eigvals(A)
            exact = values[np.argmin(abs(abs(values) - found.Omega[i]))]
            assert found.Omega[i] == pytest.approx(abs(exact), rel=2e-4)
            assert found.damping[i] == pytest.approx(-exact.real / abs(exact), abs=2e-4)
        assert found.damping.max() > 0.02


def two_modes(normal, harmonics=3, force=1.0, second=55.0):
    rows = np.zeros((6, 2))
    rows[1] = 1.0, 0.7
    rows[3] = 0.0, 60.0  # turns the patch about its normal: its points slide one after the other
    g = body(rows, 2 * np.pi * np.array([30.0, second]), 0.003)
    places, areas = grid(0.02, 0.01, (8, 1))
    law = PointContact(Penalty(value(4e5)), Coulomb(value(0.3)), value(5e3))
    return of_body(
        g, (Patch("face", places, areas, law),), np.array([normal]), force * np.array([1.0, 0.0]),
        np.array([1.0, -0.5]), harmonics=harmonics, samples=128, length=1e-4,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("harmonics", [1, pytest.param(5, marks=pytest.mark.slow)])
def test_forced_by_what_feeds_the_losses_the_motion_is_the_mode(harmonics):
    """One degree of freedom, i xi Omega M A drives its first harmonic at Omega: with one harmonic the same equations,
    with more of them the same up to what xi does to the others."""
    found = backbone(sliding(harmonics), 3e-5, 3e-4, asked=[6e-5, 1.5e-4])
    for A in (6e-5, 1.5e-4):
        i = int(np.argmin(abs(found.amplitude - A)))
        force = 2 * found.damping[i] * found.Omega[i] ** 2 * A
        problem = sliding(harmonics, force=force)
        start = found.x[i].copy()
        point = solve(problem, found.Omega[i], [start])
        y = operating(problem, point).outputs[0, 1]
        tolerance = 1e-8 if harmonics == 1 else 1e-2
        assert point.converged and abs(y + 1j * A) < tolerance * A  # the force leads by a quarter of a period


def test_a_contact_a_hundred_times_as_stiff_as_its_body_slides_free_in_few_points():
    M, K = np.eye(2), np.array([[200.0, -100.0], [-100.0, 101.0]])
    rubbing = ms.structure(M, K, 1e-4 * K, force={0: 1.0}, elements=[ms.jenkins(1e4, 0.3, at=1)])
    mode = ms.backbone(rubbing, 1e-3, 0.03, harmonics=1)
    assert mode.complete and len(mode.Omega) < 200
    assert mode.Omega[0] ** 2 == pytest.approx(np.linalg.eigvalsh(K + np.diag([0.0, 1e4]))[0], rel=1e-4)
    assert mode.Omega[-1] ** 2 == pytest.approx(np.linalg.eigvalsh(K)[1], rel=1e-3)


@pytest.mark.slow
def test_resonances_at_many_levels_of_load_lie_on_the_backbone():
    """Two ways: peaks of the forced response, each found on its own curve, and the mode. The peak of an amplitude lies
    about zeta^2 beside the mode's frequency; the other mode is far away."""
    found = backbone(two_modes(4.0, 1, second=400.0), 1e-6, 3e-2, mode=0)
    order = np.argsort(found.amplitude)
    for force in (0.3, 1.0, 2.0, 4.0):
        problem = two_modes(4.0, 1, force, 400.0)
        peak = resonance(highest(problem, 2 * np.pi * np.linspace(28, 45, 35))[0])
        assert peak.status == "converged"
        at = np.interp(np.log(peak.amplitude), np.log(found.amplitude[order]), found.Omega[order])
        zeta = np.interp(np.log(peak.amplitude), np.log(found.amplitude[order]), found.damping[order])
        assert abs(peak.Omega / at - 1) < 2 * zeta**2 + 5e-4  # and what is between two points of the curve


@pytest.mark.slow
@pytest.mark.parametrize(("order", "low", "large"), [(1, 1e-6, 8e-6), (3, 1e-7, 1e-5)])
def test_a_nodal_diameter_of_a_ring(order, low, large):
    """One sector for six blades: the mode at a large amplitude, put into all of them, is one of the whole ring; the
    wave that runs the other way has the same frequency and damping."""
    fine = {"harmonics": 3, "samples": 48, "length": 1e-6}
    forward, backward = (replace(sector(6, e), outputs=(Output("blade", "tip", "u_y"),)) for e in (order, 6 - order))
    lone, ring = balance.of(forward, **fine), balance.of(forward.unrolled(), **fine)
    mode = strongest(lone, 0.0, 2 * np.pi * 1000.0)
    ways = [backbone(balance.of(one, **fine), low, 1.01 * large, mode, asked=[large]) for one in (forward, backward)]
    found = ways[0]
    i = int(np.argmin(abs(found.amplitude - large)))
    assert found.complete and found.damping.max() > 2 * found.damping[0]
    v = lone.displacement(found.x[i])
    a = np.array([v[0], *(v[1::2] - 1j * v[2::2])])  # (H + 1, 6) amplitudes, then those of every contact
    turned = a[:, None] * np.exp(2j * np.pi * np.arange(4)[:, None] * order * np.arange(6) / 6)[..., None]
    turned = turned.reshape(4, 36)
    whole = np.zeros((7, 36))
    whole[0], whole[1::2], whole[2::2] = turned[0].real, turned[1:].real, -turned[1:].imag
    x, xi = (whole / ring.scale).ravel() * 1e-6 / large, 2 * found.damping[i] * found.Omega[i]
    held = replace(ring, stiffness=tuple(2 * k for k in ring.stiffness), share=0.0)
    R = _Curve(held, 0).evaluate(np.append(x, [found.Omega[i], xi]), np.log(large))[0]
    assert np.abs(R).max() < 1e-7 * np.abs(x).max()
    j = int(np.argmin(abs(ways[1].amplitude - large)))
    assert ways[1].Omega[j] == pytest.approx(found.Omega[i], rel=1e-9)
    assert ways[1].damping[j] == pytest.approx(found.damping[i], rel=1e-7)


def test_a_body_of_one_mode_without_damping():
    """Its only eigenvalue is its own geometric mean; what the contacts see is finite beside it."""
    problem = sliding(ratio=0.0)
    seen = problem.eliminated[0].at(150.0)
    assert np.isfinite(seen[..., 1:]).all()
    assert seen[0, 1, 0, 1] == pytest.approx(1 / (3e4 - 150.0**2), rel=1e-12)


def test_mistakes():
    refused("there are 1", backbone, sliding(), 1e-6, 1e-5, mode=1)
    beside = ms.structure(np.eye(2), np.diag([1.0, 4.0]), elements=[ms.jenkins(1.0, 1.0, at=0)], output=1)
    refused("does not move", ms.backbone, beside, 1e-6, 1e-5)


@pytest.mark.slow
def test_a_damper_that_hardly_anything_holds_may_drift_while_it_slides():
    """0.1 kg on 1 N/m under a steady 0.5 N: as long as a friction contact sticks it stays, and 0.5 m away when all
    slide, a hundred times the motion that makes them. What is left then is the mass without its damper."""
    friction = [ms.jenkins(1e6, limit, 0, 1) for limit in (2.0, 8.0)]
    K = np.diag([1e5, 1.0])
    both = ms.structure(np.diag([1.0, 0.1]), K, steady={1: 0.5}, damping_ratio=0.001, elements=friction, output=0)
    curve = ms.backbone(
        both, 1e-4, 0.1, mode=0, harmonics=1, samples=24, measure="readout"
    )
    assert curve.complete and len(curve.Omega) < 200, curve.status
    np.testing.assert_allclose(curve.Omega[0], np.sqrt(1e5 / 1.1), rtol=1e-3)
    np.testing.assert_allclose(curve.Omega[-1], np.sqrt(1e5), rtol=1e-4)

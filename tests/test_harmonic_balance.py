"""One harmonic on Jenkins elements in closed form, against limits, energy and time; resonances of a sweep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_forms.one_harmonic import JenkinsContact, frequency_response, jenkins_harmonic, stuck_frequencies

from microslip.data import Compliance, Interface, ModalGroup
from microslip.harmonic_balance import FrequencyResponse, peaks
from microslip.harmonic_balance.sweeps import resonances


def oscillator(mass: float = 1.0, stiffness: float = 1e4, ratio: float = 0.0) -> ModalGroup:
    """One degree of freedom whose displacement is u_t1 of the interface ``face``."""
    omega = np.array([np.sqrt(stiffness / mass)])
    rows = np.zeros((6, 1))
    rows[1] = 1 / np.sqrt(mass)
    face = Interface(
        np.zeros(3), np.eye(3), rows, np.zeros(1), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 1))
    )
    return ModalGroup(
        speed=0.0, omega=omega, kind=("normal",), damping_ratio=np.array([ratio]), M_r=np.eye(1),
        K_r=np.diag(omega**2), C_r=np.diag(2 * ratio * omega), G_r=np.zeros((1, 1)), phi=np.zeros((0, 3, 1)),
        interfaces={"face": face}, excitations={}, monitors={}, gauges={},
        compliance=Compliance((), np.zeros((0, 0)), np.zeros((0, 0)), False), stresses={}, u_static=np.zeros((0, 3)),
        checks={},
    )  # fmt: skip


def contact(stiffness: float, limit: float) -> JenkinsContact:
    return JenkinsContact("face", np.zeros(6), 1, stiffness, limit)


def marched_harmonic(amplitude: float, stiffness: float, limit: float, samples: int = 40000) -> complex:
    """First harmonic of the force over displacement, by marching the return map for two cycles."""
    t = np.arange(2 * samples) * 2 * np.pi / samples
    u = amplitude * np.cos(t)
    force, f, previous = np.empty_like(u), 0.0, 0.0
    for i, x in enumerate(u):
        f = np.clip(f + stiffness * (x - previous), -limit, limit)
        previous, force[i] = x, f
    last = slice(samples, 2 * samples)
    return complex(2 / samples * np.sum(force[last] * np.exp(-1j * t[last])) / amplitude)


@pytest.mark.parametrize("ratio", [0.5, 1.0, 1.05, 1.7, 4.0, 50.0])
def test_closed_form_equals_the_marched_loop(ratio):
    k, limit = 3e6, 12.0
    amplitude = ratio * limit / k
    value = jenkins_harmonic(np.array([amplitude]), k, limit)[0][0]
    assert value == pytest.approx(marched_harmonic(amplitude, k, limit), rel=2e-4)


def test_slope_is_the_derivative():
    k, limit = 3e6, 12.0
    a = np.array([1.01, 1.5, 3.0, 20.0]) * limit / k
    h = 1e-6 * a
    numeric = (jenkins_harmonic(a + h, k, limit)[0] - jenkins_harmonic(a - h, k, limit)[0]) / (2 * h)
    assert jenkins_harmonic(a, k, limit)[1] == pytest.approx(numeric, rel=1e-6)


def test_hysteresis_energy_is_the_area_of_the_loop():
    k, limit, amplitude = 2e6, 5.0, 9e-6
    value = jenkins_harmonic(np.array([amplitude]), k, limit)[0][0]
    assert np.pi * value.imag * amplitude**2 == pytest.approx(4 * limit * (amplitude - limit / k), rel=1e-12)


def test_sticking_and_frictionless_limits():
    g = oscillator(ratio=0.01)
    frequency = np.linspace(5, 40, 71)
    force = np.array([1.0])
    stick = frequency_response(g, [contact(2e4, 1e9)], force, np.array([1.0]), frequency)
    slide = frequency_response(g, [contact(2e4, 1e-12)], force, np.array([1.0]), frequency)
    Omega = 2 * np.pi * frequency
    damping = 2j * 0.01 * 100 * Omega
    assert stick.converged.all() and slide.converged.all()
    np.testing.assert_allclose(stick.monitor, 1 / (3e4 - Omega**2 + damping), rtol=1e-9)
    np.testing.assert_allclose(slide.monitor, 1 / (1e4 - Omega**2 + damping), rtol=1e-8)
    assert stuck_frequencies(g, [contact(2e4, 1.0)])[0] == pytest.approx(np.sqrt(3e4) / 2 / np.pi, rel=1e-12)


def test_external_work_equals_dissipation_and_newton_converges_through_the_peak():
    g = oscillator()
    response = frequency_response(g, [contact(2e4, 0.8)], np.array([1.0]), np.array([1.0]), np.linspace(10, 40, 601))
    assert response.converged.all()
    work = np.pi * np.imag(np.conj(response.monitor) * 1.0)  # pi Im(conj(u) F), F real
    np.testing.assert_allclose(work, response.dissipated, rtol=1e-8, atol=1e-12)
    assert (np.diff(np.sign(np.diff(np.abs(response.monitor)))) < 0).sum() == 1


def test_coordinates_and_contact_forces_balance_the_excitation():
    """K q - Omega^2 M q + i Omega C q = f - T^T F at every frequency, and the monitor reads q."""
    g, frequency = oscillator(ratio=0.01), np.linspace(10, 40, 31)
    r = frequency_response(g, [contact(2e4, 0.8)], np.array([1.0]), np.array([1.0]), frequency)
    Omega = 2 * np.pi * frequency
    left = (1e4 - Omega**2 + 2j * 0.01 * 100 * Omega) * r.modal[:, 0]
    np.testing.assert_allclose(left, 1.0 - r.force[:, 1], rtol=0, atol=1e-10)
    np.testing.assert_allclose(r.modal[:, 0], r.monitor, rtol=1e-12)


@pytest.mark.parametrize("frequency", [[21.0], pytest.param([17.0, 30.0], marks=pytest.mark.slow)])
def test_response_agrees_with_time_integration(frequency):
    """One harmonic against the marched oscillator at three frequencies: within 2 % (the force's third harmonic)."""
    m, k, kt, limit = 1.0, 1e4, 2e4, 0.6
    g = replace(oscillator(m, k, 0.02))
    frequency = np.array(frequency)
    response = frequency_response(g, [contact(kt, limit)], np.array([1.0]), np.array([1.0]), frequency)
    for f, u in zip(frequency, response.monitor, strict=True):
        assert abs(u) == pytest.approx(marched_amplitude(m, k, 2 * 0.02 * 100, kt, limit, f), rel=0.02)


def marched_amplitude(m: float, k: float, c: float, kt: float, limit: float, f: float) -> float:
    """First-harmonic amplitude of a Jenkins oscillator under cos(Omega t), central differences, 60 periods."""
    Omega, steps = 2 * np.pi * f, 4000
    dt = 2 * np.pi / Omega / steps
    u = previous = slider = 0.0
    last = np.empty(steps)
    for i in range(60 * steps):
        friction = np.clip(kt * (u - slider), -limit, limit)
        slider = u - friction / kt
        drive = np.cos(Omega * i * dt) - k * u - friction
        following = (dt**2 * drive + 2 * m * u - m * previous + 0.5 * c * dt * previous) / (m + 0.5 * c * dt)
        previous, u = u, following
        last[i % steps] = previous
    return float(abs(2 / steps * np.sum(last * np.exp(-2j * np.pi * np.arange(steps) / steps))))


def curve(f: np.ndarray, height: np.ndarray) -> FrequencyResponse:
    zero, none = np.zeros(len(f)), np.zeros((len(f), 0))
    return FrequencyResponse(f, height.astype(complex), none, zero, np.ones(len(f), bool))


@pytest.mark.parametrize(("dip", "found"), [(0.003, [2.0]), (0.03, [1.0, 2.0])])
def test_a_plateau_is_one_resonance_and_a_double_top_two(dip: float, found: list[float]) -> None:
    """Tops at 1 (1.001) and 2 (1.002) with a dip between them, and ripples by 0.2 % on the way: 1 % parts them."""
    f = np.linspace(0, 3, 301)
    fall = np.where(f < 1, 1 - f, np.where(f > 2, f - 2, 0.0))
    height = 1 + 0.001 * f - dip * np.sin(np.pi * (f - 1)) ** 2 * ((f > 1) & (f < 2)) - fall
    height += 0.002 * np.cos(2 * np.pi * (f - 1) / 0.2) * ((f > 0.5) & (f < 2.5))
    response = curve(f, height)
    places = [place for place, _ in resonances(response, peaks(response))]
    assert len(peaks(response)) >= 2 and places == pytest.approx(found, abs=0.02)


def test_flat_tops_and_ledges() -> None:
    """A top of equal points is one resonance, a ledge on the way up none."""
    f = np.arange(9.0)
    response = curve(f, np.array([0.0, 1.0, 2.0, 2.0, 3.0, 5.0, 5.0, 5.0, 1.0]))
    assert resonances(response, peaks(response)) == [(5.0, 5.0)]


@pytest.mark.parametrize(("limit", "found"), [(0.6, True), (2.0, True), (1e3, False)])
def test_exactly_at_the_resonance_of_a_stuck_contact_without_damping(limit: float, found: bool) -> None:
    """1 kg on 3e4 N/m beside a slider of 1e4 N/m, at 200 rad/s, where the stuck system is singular to the last bit:
    what slides takes what is supplied; sticking has no answer, and a point without one is refused."""
    g, f = oscillator(1.0, 3e4), 200 / (2 * np.pi)
    r = frequency_response(g, [contact(1e4, limit)], np.array([1.0]), np.array([1.0]), np.array([f - 0.1, f]))
    assert r.converged.tolist() == [True, found]
    supplied = -np.pi * r.monitor.imag
    np.testing.assert_allclose(r.dissipated[r.converged], supplied[r.converged], rtol=1e-8, atol=1e-15)

"""Peaks on curves of solutions, followed over a parameter to their lowest place: closed forms and brute force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
import scipy.optimize
from test_harmonic_balance_laws import body, modes_with_rows, rough_patch

import microslip as ms
from microslip.analyses import balanced
from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.continuation import NO_OPTIMUM, Settings, extremum, lowest, peak, rated
from microslip.harmonic_balance import peak as peaks
from microslip.harmonic_balance.peak import highest, optimum, resonance
from microslip.harmonic_balance.readout import amplitude
from microslip.harmonic_balance.response import filled_response, of_body, operating, refined_peaks
from microslip.harmonic_balance.solver import solve, sweep
from microslip.verbs.optimum import missed, optimum_message


@dataclass(frozen=True)
class Oscillator:
    """(K(|a|) - Omega^2 + i Omega c + i B(|a|)) a = f in real and imaginary parts, |a|^2 watched.

    stiffness, loss: functions of A = |a| and p that give (K, dK/dA) and (B, dB/dA).
    """

    stiffness: object
    loss: object
    p: float
    f: float = 1.0
    x_scale: float = 1.0
    lam_scale: float = 1.0

    def evaluate(self, x, w):
        A = np.hypot(*x)
        (K, K_A), (B, B_A) = self.stiffness(A, w, self.p)[:2], self.loss(A, w, self.p)[:2]
        S = np.array([[K - w * w, -B], [B, K - w * w]])
        radial = x / A if A > 0 else np.zeros(2)
        J = S + np.outer(np.array([[K_A, -B_A], [B_A, K_A]]) @ x, radial)
        h = 1e-6
        rates = [
            (side(A, w + h, self.p)[0] - side(A, w - h, self.p)[0]) / (2 * h) for side in (self.stiffness, self.loss)
        ]
        K_w, B_w = rates[0] - 2 * w, rates[1]
        return S @ x - [self.f, 0], J, np.array([[K_w, -B_w], [B_w, K_w]]) @ x

    def output(self, x, w):
        return float(x @ x), 2 * x, 0.0


def duffing(p=1.0, f=0.3, c=0.1):
    return Oscillator(lambda A, w, p: (1 + 0.75 * p * A * A, 1.5 * p * A), lambda A, w, p: (c * w, 0.0), p, f)


def relaxing(p, N=2.0):
    """A spring 1, beside it a spring N in series with a dashpot p."""

    def parallel(A, w, p):
        return N * 1j * w * p / (N + 1j * w * p)

    def real(A, w, p):
        return 1 + parallel(A, w, p).real, 0.0

    def imaginary(A, w, p):
        return parallel(A, w, p).imag, 0.0

    return Oscillator(real, imaginary, p)


def jenkins(p):
    """A spring 1, beside it a spring 1 whose force friction holds up to p; closed form of one harmonic."""

    def turned(A):
        return np.arccos(1 - 2 * p / A) if A > p else np.pi

    def stiffness(A, w, p):
        t = turned(A)
        slope = 0.0 if A <= p else (1 - np.cos(2 * t)) / np.pi * (-2 * p / A**2 / np.sqrt(1 - (1 - 2 * p / A) ** 2))
        return 1 + (t - 0.5 * np.sin(2 * t)) / np.pi, slope

    def loss(A, w, p):
        return (0.01 * w, 0.0) if A <= p else (
            0.01 * w + 4 * p * (A - p) / (np.pi * A * A), 4 * p * (2 * p - A) / (np.pi * A**3)
        )  # fmt: skip

    return Oscillator(stiffness, loss, p)


# one peak -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lam", [0.4, 1.2, 2.4])
def test_peak_of_an_overhanging_resonance(lam):
    """Highest A of A^2 ((1 - w^2 + 3/4 A^2)^2 + c^2 w^2) = f^2: w^2 = 1 + 3/4 A^2 - c^2/2. From the left, and
    from the right, where uphill leads down to the lower fold and along the unstable branch."""

    def squared(A):
        return 1 + 0.75 * A * A - 0.005

    A = scipy.optimize.brentq(lambda A: A * A * (0.005**2 + 0.01 * squared(A)) - 0.09, 0.5, 3, xtol=1e-15)
    found = peak(duffing(), np.array([0.0, 0.3]), lam)
    assert found.converged and not found.kink
    assert np.sqrt(found.value) == pytest.approx(A, rel=1e-10)
    assert found.lam == pytest.approx(np.sqrt(squared(A)), rel=1e-8)


@dataclass(frozen=True)
class Roof:
    """x = 2 - |lambda - p|."""

    p: float
    x_scale: float = 1.0
    lam_scale: float = 1.0

    def evaluate(self, x, lam):
        side = np.sign(lam - self.p)
        return np.array([x[0] - 2 + abs(lam - self.p)]), np.eye(1), np.array([side])

    def output(self, x, lam):
        return float(np.exp(x[0])), np.exp(x), 0.0


def test_a_peak_at_a_kink_is_found_and_said_to_be_one():
    found = peak(Roof(0.7), np.array([1.5]), 0.1)
    assert found.converged and found.kink
    assert found.lam == pytest.approx(0.7, abs=1e-7) and found.x[0] == pytest.approx(2, abs=1e-7)


def test_a_step_across_a_kink_that_is_longer_than_asked_ends_too(monkeypatch):
    """Neither the root nor a shorter step is had: the higher end is the peak, within the length of the step."""

    def far(problem, state, settings):
        return advance(problem, state, replace(settings, step_max=0.1))

    advance = extremum.advance
    monkeypatch.setattr(extremum, "_pinned", lambda *places: None)
    monkeypatch.setattr(extremum, "advance", far)
    found = peak(Roof(0.7), np.array([1.5]), 0.1)
    assert found.converged and found.lam == pytest.approx(0.7, abs=0.1)


def test_without_a_peak_the_end_is_told():
    found = peak(Roof(50.0), np.array([-48.0]), 0.0, Settings(high=3.0))
    assert not found.converged and found.status.startswith("no peak before the end: bound")


# over a parameter -----------------------------------------------------------------------------------------------------


def climbing(family, x, lam):
    """value -> the peak of the family uphill from a guess, with its rate."""
    return lambda p: rated(family, p, peak(family(p), np.array(x), lam))


def test_a_read_out_that_nothing_moves_has_no_peak():
    """Two masses of their own: where one resonates the other stands still, whatever rounding climbs to."""
    for output in (0, 1):
        parts = np.eye(2), np.diag([1.0, 4.0]), 0.02 * np.eye(2)
        two = ms.structure(*parts, force={0: 1.0}, output=[output])
        top = highest(balanced(two, 1), np.linspace(0.5, 3.0, 6)).peak
        assert top.converged is (output == 0)
        assert output == 0 or top.status == "the read-out does not move"
    assert np.isnan(top.value) and np.isnan(top.lam)


def test_optimal_damping_of_a_relaxing_spring():
    """All curves pass through one point, Omega^2 = 1 + N/2 and |a| = 2/N; the best peak is the one that lies
    there."""
    best = lowest(climbing(relaxing, [1.0, -1.0], 1.0), np.geomspace(0.2, 8.0, 5), tolerance=1e-10)
    assert best.status == "converged"
    assert np.sqrt(best.peak.value) == pytest.approx(1.0, rel=1e-9) and best.peak.lam**2 == pytest.approx(2.0, rel=1e-4)
    assert best.parameter == pytest.approx(2.0 / np.sqrt(1 + 2.0 / 2), rel=1e-4)  # N / sqrt(1 + N/2)
    few = lowest(climbing(relaxing, [1.0, -1.0], 1.0), np.geomspace(0.2, 8.0, 5))
    assert few.status == "converged" and len(few.found) <= 5 + 5 and few.peak.value < 1 + 1e-5


def test_rates_are_the_derivative_of_the_peaks_height():
    for p in (0.9, 1.0, 1.2):
        at = climbing(jenkins, [0.1, -1.0], 1.2)
        sides = [at(p * (1 + s)).value for s in (1e-4, -1e-4)]
        assert at(p).rate == pytest.approx(np.log(sides[0] / sides[1]) / (2e-4 * p), rel=1e-5)


def test_optimal_friction_against_brute_force():
    """The peak of a Jenkins element over its limit: its lowest place, and the largest amplitude at which any frequency
    has a solution, amplitude by amplitude, limit by limit."""
    best = lowest(climbing(jenkins, [0.1, -1.0], 1.2), np.linspace(0.9, 2.2, 4), tolerance=1e-7)

    def highest(p):  # of all frequencies, by a fine sweep of the explicit curve w(A)
        A = np.linspace(p * (1 + 1e-9), 20.0, 100_001)
        t = np.arccos(1 - 2 * p / A)
        K, B = 1 + (t - 0.5 * np.sin(2 * t)) / np.pi, 4 * p * (A - p) / (np.pi * A * A)
        # (K - s)^2 + (B + 0.01 sqrt s)^2 = 1 / A^2 has a solution s = w^2 where the least of its left side is below
        s = K - 0.005 * (B / np.sqrt(K) + 0.01)
        least = (K - s) ** 2 + (B + 0.01 * np.sqrt(s)) ** 2 - 1 / A**2
        i = int(np.flatnonzero(least <= 0).max())
        return A[i] + (A[i + 1] - A[i]) * least[i] / (least[i] - least[i + 1])

    grid = np.linspace(0.9, 2.2, 131)
    i = int(np.argmin([highest(p) for p in grid]))
    exact = scipy.optimize.minimize_scalar(highest, bounds=(grid[i - 1], grid[i + 1]), method="bounded")
    assert best.status == "converged"
    assert np.sqrt(best.peak.value) == pytest.approx(exact.fun, rel=1e-6)
    assert best.parameter == pytest.approx(exact.x, rel=1e-3)  # flat there: 1e-6 of the height is 1e-3 of the place


@dataclass(frozen=True)
class Hill(Roof):
    """x = h(p) - (lambda - 1)^2."""

    height: Callable[[float], float] = abs

    def evaluate(self, x, lam):
        return np.array([x[0] - self.height(self.p) + (lam - 1) ** 2]), np.eye(1), np.array([2 * (lam - 1)])


def hills(height):
    """value -> the top of a hill of a height that depends on it."""

    def family(p):
        return Hill(p, height=height)

    return lambda p: rated(family, p, peak(family(p), np.array([height(p) - 0.09]), 0.7))


VALUES = np.linspace(1.0, 6.0, 6)


def test_a_kink_that_an_end_beats_is_no_optimum():
    """Falling all the way but for a nick between the first two values, where the derivative changes its sign."""
    best = lowest(hills(lambda p: 2 - 0.01 * p + 0.03 * abs(p - 1.4) * (p < 2.2)), VALUES)
    assert best.parameter == 6.0 and best.status == NO_OPTIMUM


def test_a_valley_beside_an_end_is_found():
    """Lowest of the values is the first one, from which the height falls on."""
    best = lowest(hills(lambda p: 2 + 0.1 * (p - 1.2) ** 2), VALUES, tolerance=1e-9)
    assert best.status == "converged" and best.parameter == pytest.approx(1.2, abs=1e-4)


@pytest.mark.parametrize("phase", np.linspace(0, 6, 7))
def test_no_peak_that_was_found_is_lower_than_the_optimum(phase):
    """A shallow valley at 3.4 under ripples of the same size, as contacts that switch point by point make them."""
    best = lowest(hills(lambda p: 2 + 0.01 * (p - 3.4) ** 2 + 0.004 * np.sin(17 * p + phase)), VALUES)
    assert best.status in ("converged", "kink")
    assert best.peak.value == min(one.value for one in best.found.values()) and 2 < best.parameter < 5
    assert set(VALUES) < set(best.found)


def test_a_kink_is_found():
    """Two lines that meet, to a tenth of a per mille of the height."""
    best = lowest(hills(lambda p: 2 + max(0.3 * (2.7 - p), 0.7 * (p - 2.7))), VALUES)
    assert best.status == "kink" and best.parameter == pytest.approx(2.7, abs=2e-4) and len(best.found) <= 6 + 24


def test_a_value_without_a_peak_is_passed_over():
    """The third of the values has none; the valley between its neighbours is found all the same."""
    at = hills(lambda p: 2 + 0.1 * (p - 3.3) ** 2)

    def highest_but_one(p):
        return replace(at(p), status="no resonance in the band") if p == 3.0 else at(p)

    best = lowest(highest_but_one, VALUES, tolerance=1e-9)
    assert best.parameter == pytest.approx(3.3, abs=1e-4) and not best.found[3.0].converged
    nothing = lowest(lambda p: replace(at(p), status="no resonance in the band"), VALUES)
    assert nothing.status == "no resonance in the band"


# with contacts --------------------------------------------------------------------------------------------------------


def test_amplitude_of_a_readout_and_its_derivatives():
    """The value is what the response reports; derivatives against differences, slipping, opening, every form."""
    g, force, watched = modes_with_rows()
    patch = rough_patch((3, 2), 8e6)
    problem = of_body(g, (patch,), np.array([20.0]), 8 * force, watched, harmonics=1, samples=16, length=1e-5)
    Omega, rng = 2 * np.pi * 47.0, np.random.default_rng(1)
    point = solve(problem, Omega, [])
    for harmonic in (0, 1):
        found = amplitude(problem.at(Omega), point.x, *problem.at(Omega).forces(point.x), harmonic=harmonic)
        assert found.value == pytest.approx(operating(problem, point).outputs[0, harmonic], rel=1e-12)
    x = point.x + 0.2 * rng.normal(size=problem.size)
    direction, h = rng.normal(size=problem.size), 1e-6

    def value(x, Omega):
        return amplitude(problem.at(Omega), x, *problem.at(Omega).forces(x), harmonic=1)

    along = (value(x + h * direction, Omega).value - value(x - h * direction, Omega).value) / (2 * h)
    assert abs(value(x, Omega).by_x @ direction - along) < 2e-6 * abs(along)
    h = 1e-5 * Omega
    along = (value(x, Omega + h).value - value(x, Omega - h).value) / (2 * h)
    assert abs(value(x, Omega).rate - along) < 1e-6 * abs(along)


BAND = 2 * np.pi * np.linspace(28, 48, 21)


def pressed(normal, samples=256):
    """Two modes of 30 and 55 Hz that slide along t1 over eight points, pressed by a normal force (N)."""
    g, force, watched = two_modes()
    places, areas = grid(0.02, 0.01, (8, 1))
    law = PointContact(Penalty(value(4e5)), Coulomb(value(0.3)), value(5e3))
    return of_body(
        g, (Patch("face", places, areas, law),), np.array([normal]), force, watched, harmonics=1, samples=samples,
        length=1e-4,
    )  # fmt: skip


def two_modes():
    rows = np.zeros((6, 2))
    rows[1] = 1.0, 0.7
    rows[5] = 0.0, 20.0  # turns the patch: its points slide one after the other
    return body(rows, 2 * np.pi * np.array([30.0, 55.0]), 0.003), np.array([1.0, 0.6]), np.array([1.0, -0.5])


@pytest.mark.slow
def test_the_peak_of_a_contact_with_microslip_is_the_highest():
    """Against a golden-section search over single solutions. Points that change between stick and slip sample by
    sample ripple the top by 3e-5 of its height, which is flat to that within 0.5 %."""
    problem = pressed(4.0)
    found, end, _ = highest(problem, BAND)
    assert found.converged and end is None

    def height(f):
        point = solve(problem, 2 * np.pi * f, [found.x])
        assert point.converged
        return -abs(operating(problem, point).outputs[0, 1])

    f = found.lam / (2 * np.pi)
    bounds = (0.98 * f, 1.02 * f)
    best = scipy.optimize.minimize_scalar(height, bounds=bounds, method="bounded", options={"xatol": 1e-5})
    assert resonance(found).amplitude == pytest.approx(-best.fun, rel=1e-4)
    assert f == pytest.approx(best.x, rel=5e-3)


def test_a_resonance_narrower_than_a_step_is_found_as_a_response_finds_it():
    """Of a stuck contact, whose half-power width is a sixteenth of the step: the peak of the linear system, and to the
    last digit that of the response."""
    g, force, watched = two_modes()
    patch, band = rough_patch((3, 2), 4e5), 2 * np.pi * np.linspace(28, 48, 6)
    problem = of_body(g, (patch,), np.array([1e4]), force, watched, harmonics=2, samples=32, length=1e-5)
    top = highest(problem, band)
    response = filled_response(problem, band / (2 * np.pi))
    best = max(refined_peaks(problem, response), key=lambda one: one.amplitude)
    assert np.sqrt(top.peak.value) == pytest.approx(best.amplitude, rel=1e-12)
    part, k = problem.parts[1][0], problem.stiffness[0]

    def linear(w):
        K = part.K + part.rows.conj().T @ k @ part.rows
        return -abs(part.output[0] @ np.linalg.solve(K - w * w * part.M + 1j * w * part.C, part.load))

    w = 2 * np.pi * best.frequency
    exact = scipy.optimize.minimize_scalar(linear, bounds=(0.99 * w, 1.01 * w), method="bounded")
    assert best.amplitude == pytest.approx(-exact.fun, rel=1e-6) and not top.unsolved


@pytest.mark.slow
def test_optimal_normal_force_against_sweeps():
    """The highest resonance in a band over the normal force: followed to its lowest place, and from sweeps of single
    solutions over 4.5 % around it, force by force; within what sampling ripples."""
    coarse = partial(pressed, samples=128)
    best = optimum(coarse, [3.0, 5.0, 8.0], 2 * np.pi * np.linspace(30, 42, 13))
    assert best.status in ("converged", "kink") and not best.rising
    around = best.resonance.Omega / (2 * np.pi) * np.linspace(0.975, 1.02, 46)

    def swept(normal):
        problem = coarse(normal)
        points = sweep(problem, around, start=best.resonance.x)
        return max(abs(operating(problem, p).outputs[0, 1]) for p in points if p.converged)

    here, beside = swept(best.parameter), [swept(best.parameter * share) for share in (0.9, 0.96, 1.04, 1.1)]
    assert best.resonance.amplitude == pytest.approx(here, rel=2e-4)
    assert min(beside) > here * (1 - 2e-4) and beside[0] > 1.01 * here and beside[3] > 1.002 * here


def test_a_setting_that_hardly_matters_is_said_to():
    """The highest resonance changes by 0.45 % over the range, or by 5 %."""
    for most, word in ((4.23, True), (4.42, False)):
        heights = {1.0: most, 2.0: 4.2133, 3.0: 4.2109}
        tops = {p: peaks.HighestPeak(1.0, a, np.zeros(1), "converged") for p, a in heights.items()}
        found = peaks.Optimum(3.0, tops[3.0], NO_OPTIMUM, tops, {})
        assert found.spread == pytest.approx(most / 4.2109 - 1)
        assert ("hardly matters" in optimum_message(found, "normal_force")) is word
        beyond = "look there with --high above 3" in (said := optimum_message(found, "normal_force"))
        assert beyond is not word and ("is lowest" in said) is not word and not missed(found, "normal_force")
    tops[2.5] = peaks.HighestPeak(np.nan, np.nan, np.zeros(1), "not found: 3 of 9 points did not converge")
    found = peaks.Optimum(2.0, tops[2.0], "converged", tops, {})
    assert "at 2.5 N no resonance was found" in missed(found, "normal_force")
    assert "; at 2.5 N not found: 3 of 9 points" in optimum_message(found, "normal_force")
    one = peaks.Optimum(1.0, tops[1.0], NO_OPTIMUM, {1.0: tops[1.0]}, {})
    assert np.isinf(one.spread)


def masses(normal):
    """Three masses in a chain of which the last one rubs, one harmonic, few samples: ripples and many kinks."""
    K = 1e4 * np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
    squares, modes = np.linalg.eigh(K)
    rows = np.zeros((6, 3))
    rows[1] = modes[2]
    g = body(rows, np.sqrt(squares), 0.004)
    law = PointContact(Penalty(value(1e4)), Coulomb(value(0.3)), value(5e3))
    patch = Patch("face", np.zeros((1, 2)), np.ones(1), law)
    return of_body(
        g, (patch,), np.array([normal]), modes[0], modes[2], harmonics=1, samples=48, length=1e-4
    )  # fmt: skip


@pytest.mark.slow
def test_the_optimum_of_a_slider_against_sweeps():
    """No force beside it has a lower peak, found by sweeps with a fine step; the peak moves by 40 % of its frequency,
    so that it cannot be followed from one force to the next. What the table says of a force is the sweep's peak."""
    band = 2 * np.pi * np.linspace(5, 14, 46)
    best = optimum(masses, [1.0, 3.0, 12.0], band)
    assert best.status in ("converged", "kink") and 1 < best.parameter < 12

    def swept(normal, near):
        """In steps of a fortieth of a hertz within 6 % of a frequency, of a tenth beside it."""
        problem = masses(normal)
        points = sweep(problem, np.union1d(np.linspace(5, 14, 91), np.arange(0.94 * near, 1.06 * near, 0.025)))
        return max(abs(operating(problem, p).outputs[0, 1]) for p in points if p.converged)

    for normal, one in best.found.items():
        assert one.status == "converged" and one.amplitude >= best.resonance.amplitude
        if normal in (1.0, 3.0, 12.0, best.parameter):
            top = swept(normal, one.Omega / (2 * np.pi))
            assert top * (1 - 1e-4) <= one.amplitude < 1.015 * top  # a peak between two points
    near = best.resonance.Omega / (2 * np.pi)
    assert min(swept(best.parameter * share, near) for share in (0.7, 1.4)) > best.resonance.amplitude


@pytest.mark.slow
def test_a_top_at_the_end_of_the_band_is_no_peak():
    """Of a stuck contact the resonance lies beyond the band: there is none in it, and the end is told."""
    problem, beyond = pressed(1e6), 2 * np.pi * np.linspace(20, 28, 9)
    found, end, _ = highest(problem, beyond)
    assert not found.converged and found.status == "no resonance in the band"
    assert end == pytest.approx(beyond[-1])


@pytest.mark.slow
def test_where_one_resonance_takes_over_from_another():
    """Two modes driven by p and 1/p, the contact stuck: peaks p a and b / p are lowest together at p^2 = b / a."""
    g, _, _ = two_modes()
    law = PointContact(Penalty(value(4e5)), Coulomb(value(1e6)), value(5e3))

    def driven(p):
        patch = Patch("face", np.zeros((1, 2)), np.ones(1), law)
        force, watched = np.array([p, 0.4 / p]), np.array([1.0, 1.0])
        return of_body(g, (patch,), np.array([1e4]), force, watched, harmonics=1, samples=16, length=1e-4)

    band = 2 * np.pi * np.linspace(25, 70, 91)
    best = optimum(driven, [0.3, 1.0, 3.0], band)
    heights = [highest(driven(best.parameter), part)[0] for part in (band[:44], band[44:])]
    assert best.status == "two peaks" and all(one.converged for one in heights)
    assert heights[0].value == pytest.approx(heights[1].value, rel=5e-4)

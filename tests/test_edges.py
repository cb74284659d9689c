"""A response that still rises at an end of its band: told, with a range that holds the resonance beyond."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from microslip.case.edges import messages, rising
from microslip.harmonic_balance import FrequencyResponse
from microslip.harmonic_balance.sweeps import brackets, inside, overhanging, resonances


def modes(f: np.ndarray, *resonances: tuple[float, float, float]) -> FrequencyResponse:
    """Sum of single modes (Hz, damping ratio, share)."""
    a = sum(share / (f0**2 - f**2 + 2j * d * f0 * f) for f0, d, share in resonances) * 100.0**2
    zero, none = np.zeros(len(f)), np.zeros((len(f), 0))
    return FrequencyResponse(f, np.asarray(a), none, zero, np.ones(len(f), bool))


def refined_peaks(
    response: FrequencyResponse, respond: Callable[[np.ndarray], FrequencyResponse]
) -> list[tuple[float, float]]:
    """(Hz, height) of the peaks beside the tops of a sweep, searched for by nine points a round."""
    found = []
    for bracket in brackets(response):
        low, high = (float(response.frequency[j]) for j in (bracket[0], bracket[-1]))
        for _ in range(6):
            f = np.linspace(low, high, 9)
            a = np.abs(respond(f).monitor)
            top = int(np.clip(a.argmax(), 1, 7))
            low, high = float(f[top - 1]), float(f[top + 1])
        if inside(response, bracket, float(a.max()), lambda f: float(abs(respond(np.array([f])).monitor[0]))):
            found.append((float(f[a.argmax()]), float(a.max())))
    return resonances(response, found)


@pytest.mark.parametrize("damping", [1e-4, 0.01, 0.1])
@pytest.mark.parametrize("away", [0.2, 2.0, 20.0])
def test_the_range_to_add_holds_the_resonance(damping: float, away: float) -> None:
    """One mode at 100 Hz beyond either end, near and far, with little and with much damping, whose top
    lies at 100 sqrt(1 - 2 D^2) Hz."""
    top = 100 * np.sqrt(1 - 2 * damping**2)
    for f, key in ((np.linspace(50.0, top - away, 81), "stop"), (np.linspace(top + away, 150.0, 81), "start")):
        r = modes(f, (100.0, damping, 1.0))
        (one,) = rising({7.0: r}, {})
        low, high = sorted((one.frequency, one.to))
        assert low < top < high and one.normal_force == 7.0
        assert one.amplitude == np.abs(r.monitor).max()
        (said,) = messages([one])
        assert f"sweep.{key}" in said and one.add in said


def test_ends_that_do_not_rise() -> None:
    """The flanks of a resonance inside, an end 20 dB below it, and a ripple of half a per cent."""
    f = np.linspace(80, 120, 81)
    assert rising({1.0: modes(f, (100.0, 0.01, 1.0))}, {1.0: [(100.0, 50.0)]}) == []
    far = modes(f, (100.0, 0.001, 1.0), (126.0, 0.001, -1.0))
    (one,) = rising({1.0: far}, {})
    assert one.frequency == 120.0
    assert rising({1.0: far}, {1.0: [(100.0, 500.0)]}) == []
    ripple = modes(f, (100.0, 0.01, 1.0))
    wavy = np.full(len(f), 2.0) + 0.005 * np.cos(2 * np.pi * (f - 80) / 8)
    assert rising({1.0: FrequencyResponse(**{**vars(ripple), "monitor": wavy})}, {}) == []


@pytest.mark.parametrize("between", [(0, 1), (-2, -1)])
def test_a_resonance_inside_the_outermost_points_is_no_end_that_rises(between: tuple[int, int]) -> None:
    """It is found there, in closed form; one as far beyond the end is not, and the end rises."""
    f = np.linspace(50.0, 100.0, 11)
    one, other = f[list(between)]
    inside, beyond = 0.7 * f[between[0]] + 0.3 * f[between[1]], f[0 if between[0] == 0 else -1]
    (known,) = refined_peaks(modes(f, (inside, 1e-3, 1.0)), lambda at: modes(at, (inside, 1e-3, 1.0)))
    assert one < inside < other and known[0] == pytest.approx(inside, rel=1e-4)
    assert rising({1.0: modes(f, (inside, 1e-3, 1.0))}, {1.0: [known]}) == []
    away = beyond + (beyond - np.mean(f)) / 20
    assert refined_peaks(modes(f, (away, 1e-3, 1.0)), lambda at: modes(at, (away, 1e-3, 1.0))) == []
    assert len(rising({1.0: modes(f, (away, 1e-3, 1.0))}, {1.0: []})) == 1


@pytest.mark.parametrize("points", [2, 3, 9])
@pytest.mark.parametrize("past", [0.02, -0.02])
def test_a_flat_top_close_by_an_end(points: int, past: float) -> None:
    """The top lies 0.02 Hz inside either end, where the response has fallen by less than `DIP`, or as far outside."""
    damping = 0.05
    top = 100 * np.sqrt(1 - 2 * damping**2)
    for f in (np.linspace(80.0, top + past, points), np.linspace(top - past, 125.0, points)):
        r = modes(f, (100.0, damping, 1.0))
        found = refined_peaks(r, lambda at: modes(at, (100.0, damping, 1.0)))
        ends = [one.frequency for one in rising({1.0: r}, {1.0: found})]
        if past > 0:
            assert found[0][0] == pytest.approx(top, abs=2e-3) and ends == []
        else:
            assert found == [] and ends == [f[-1] if f[0] == 80 else f[0]]


def test_points_that_failed_say_nothing() -> None:
    """The end is the last point that is known."""
    f = np.linspace(50, 99, 50)
    r = modes(f, (100.0, 0.01, 1.0))
    known = f < 90
    (one,) = rising({1.0: FrequencyResponse(**{**vars(r), "converged": known})}, {})
    assert one.frequency == 89.0 and one.to > 100
    assert rising({1.0: FrequencyResponse(**{**vars(r), "converged": f < 0})}, {}) == []


def test_a_resonance_beside_no_top_of_the_sweep_overhangs() -> None:
    """A curve that leans to lower frequencies, swept upwards: its peak stands over the motion that the sweep was on."""
    f = np.linspace(80.0, 120.0, 41)
    swept = modes(f, (104.0, 0.01, 1.0))
    (top,) = refined_peaks(swept, lambda at: modes(at, (104.0, 0.01, 1.0)))
    assert overhanging(swept, [(95.2, 10.0 * top[1]), top]) == [(95.2, 10.0 * top[1])]
    assert overhanging(swept, [(95.2, float(np.abs(swept.monitor[15])))]) == []  # of a plateau

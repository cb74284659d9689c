"""Weibull's distribution of a mistuned ring's amplitudes (Sextro 5.6), its exponent and how well gauges know it."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refused
from scipy.integrate import quad

from microslip.mistuning import weibull


def test_exponent_of_exponential_and_rayleigh_distributions():
    """s = 1 is the exponential distribution, sqrt(4/pi - 1) Rayleigh's; narrow ones tend to k = pi/(sqrt 6 s)."""
    assert np.allclose(weibull.exponent([1.0, np.sqrt(4 / np.pi - 1)]), [1.0, 2.0], rtol=1e-14)
    s = np.array([[1e-9], [1e-6]])
    assert np.allclose(s * weibull.exponent(s), np.pi / np.sqrt(6), rtol=2e-6) and np.isinf(weibull.exponent(0.0))
    refused((), weibull.exponent, -0.1)


def test_exponent_and_spread_are_inverse():
    k = np.geomspace(0.05, 1e7, 2001)
    assert np.abs(weibull.exponent(weibull.spread(k)) / k - 1).max() < 1e-12


@pytest.mark.parametrize("k", [0.7, 1.0, 2.0, 9.0])
def test_median_and_moments_by_quadrature(k):
    """w0 is the median, and the quantile function integrates to the mean and to s (5.6-13 with the minus sign)."""
    w0 = weibull.median(3.0, k)
    mean, second = (quad(lambda p, n=n: weibull.quantile(p, w0, k) ** n, 0, 1)[0] for n in (1, 2))
    assert np.isclose(mean, 3.0, rtol=1e-6) and np.isclose(weibull.quantile(0.5, w0, k), w0)
    assert np.isclose(np.sqrt(second / mean**2 - 1), weibull.spread(k), rtol=1e-5)
    p = np.array([0.0, 1e-12, 0.3, 0.999, 1.0])
    assert np.allclose(weibull.distribution(weibull.quantile(p, w0, k), w0, k), p, rtol=1e-12)


def test_interval_of_k_is_where_the_measured_spread_becomes_unlikely():
    """At its ends samples of as many gauges have the measured s or more, or less, with half of what is left."""
    measured = np.random.default_rng(3).weibull(2.0, 12)
    found = weibull.amplitude_spread(measured, level=0.9)
    s, rng = found.deviation / found.mean, np.random.default_rng(4)
    for k, share in zip(found.interval, (0.05, 0.95), strict=True):
        w = rng.weibull(k, (40000, 12))
        assert np.mean(w.std(axis=1, ddof=1) / w.mean(axis=1) < s) == pytest.approx(share, abs=0.01)


def test_interval_of_k_has_no_unit():
    w = np.random.default_rng(5).weibull(1.3, 24)
    assert np.allclose(weibull.amplitude_spread(w).interval, weibull.amplitude_spread(1e6 * w).interval, rtol=1e-7)


@pytest.mark.parametrize("bad", [[1.0, 2.0], [1.0, -1.0, 2.0], [1.0, np.nan, 2.0], [2.0, 2.0, 2.0]])
def test_amplitudes_that_say_nothing_of_k(bad):
    refused((), weibull.amplitude_spread, bad)


@pytest.mark.slow
@pytest.mark.parametrize("gauges, k", [(6, 1.0), (24, 2.0), (24, 15.0)])
def test_interval_of_k_covers(gauges, k):
    """95 +- 2 % of a thousand repeats."""
    rng = np.random.default_rng(6)
    ends = np.array([weibull.amplitude_spread(rng.weibull(k, gauges), draws=500, seed=i).interval for i in range(1000)])
    assert np.mean((ends[:, 0] < k) & (k < ends[:, 1])) == pytest.approx(0.95, abs=0.02)

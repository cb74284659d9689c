"""The Weibull distribution of the amplitudes of a mistuned ring (Sextro 5.6): its exponent k says how they spread.

    P(w) = 1 - exp(-ln 2 (w/w0)^k)                                  (5.6-10, 5.6-11)
    E[(w/w0)^n] = (ln 2)^(-n/k) Gamma(1 + n/k)                      (5.6-13, its exponent printed with the other sign)

so that w0 is the median, and k follows from s = standard deviation / mean alone (5.6-17).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field
from scipy.special import gammaln, psi, zeta

from ..data import Array
from ..errors import UserError
from ..settings.arguments import Count, Index, Vector, checked

DRAWS = 20000
"""Samples drawn for an interval of k: its ends then lie within 0.3 % of the probabilities asked for."""

_SERIES = np.arange(2, 20)
_TERMS = (-1.0) ** _SERIES * zeta(_SERIES) * (2.0**_SERIES - 2) / _SERIES


def exponent(s: ArrayLike) -> Array:
    """k of s = standard deviation / mean, Eq. (5.6-17), of any shape: s = 1 gives 1, s = 0 infinity.

    Raises:
        UserError: a negative s.
    """
    s = np.asarray(s, dtype=float)
    if (s < 0).any():
        raise UserError("s: standard deviation over mean cannot be negative")
    target = np.log1p(s**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        x = np.maximum(np.sqrt(6 * target) / np.pi, target / np.log(4))  # 1/k where s is small, and where it is large
        for _ in range(30):  # Newton's method on two logarithms, between which the slope is from 1 to 2
            g = _excess(x)
            step = np.log(target / g) * g / (2 * x * (psi(1 + 2 * x) - psi(1 + x)))
            x = np.where(target > 0, x * np.exp(step), x)
            if not (np.abs(step) > 1e-15).any():
                break
        return 1 / x


def spread(k: ArrayLike) -> Array:
    """s = standard deviation / mean of an exponent, of any shape, Eq. (5.6-17)."""
    return np.sqrt(np.expm1(_excess(1 / np.asarray(k, dtype=float))))


def median(mean: ArrayLike, k: ArrayLike) -> Array:
    """w0 of mean and exponent, in the unit of the mean: Eqs. (5.6-15) and (5.6-16) with the sign of (5.6-13) mended."""
    x = 1 / np.asarray(k, dtype=float)
    return np.asarray(mean) * np.exp(x * np.log(np.log(2)) - gammaln(1 + x))


def quantile(p: ArrayLike, median: ArrayLike, k: ArrayLike) -> Array:
    """Amplitude below which a share p of the blades is: the inverse of Eq. (5.6-10)."""
    with np.errstate(divide="ignore"):
        y = -np.log1p(-np.asarray(p, dtype=float)) / np.log(2)
    return np.asarray(median) * y ** (1 / np.asarray(k, dtype=float))


def distribution(w: ArrayLike, median: ArrayLike, k: ArrayLike) -> Array:
    """Share of the blades whose amplitude is below w, Eq. (5.6-10)."""
    return -np.expm1(-np.log(2) * (np.asarray(w, dtype=float) / np.asarray(median)) ** np.asarray(k))


@dataclass(frozen=True)
class Fitted:
    """A Weibull distribution of measured amplitudes.

    Attributes:
        mean, deviation: of them, in their unit. k: exponent by Eq. (5.6-17). median: w0. interval: of k, ends of the
            confidence interval. level: its confidence.
    """

    mean: float
    deviation: float
    k: float
    median: float
    interval: tuple[float, float]
    level: float


@checked
def amplitude_spread(
    amplitudes: Vector,
    level: Annotated[float, Field(gt=0, lt=1)] = 0.95,
    draws: Count = DRAWS,
    seed: Index = 0,
) -> Fitted:
    """Weibull exponent of the amplitudes that gauges measured, with its confidence interval (Sextro 5.6).

    n gauges say s only so well. As s of n amplitudes from such a distribution depends on k alone and falls with it,
    each draw of n random numbers has one k at which it would have the measured s; quantiles of these k are the ends
    of an interval that holds the true one as often as it says, also for few gauges. It takes the gauges to be
    independent; neighbouring blades of a coupled ring are less than that.

    Args:
        amplitudes: (n,) of one gauge on each blade, at one frequency, any unit.

    >>> found = amplitude_spread([0.3, 0.5, 0.7, 0.9, 1.1, 1.4])
    >>> print(f"k = {found.k:.2f}, from {found.interval[0]:.1f} to {found.interval[1]:.1f}")
    k = 2.14, from 0.8 to 3.8

    Raises:
        UserError: fewer than three amplitudes, one that is not positive, or all equal.
    """
    w = np.asarray(amplitudes, dtype=float)
    if w.ndim != 1 or len(w) < 3 or not (np.isfinite(w) & (w > 0)).all():
        raise UserError("amplitudes: k needs those of three gauges or more, positive numbers")
    if np.ptp(w) <= 1e-12 * w.max():
        raise UserError("amplitudes: are all equal, so that no exponent is finite")
    if not 0 < level < 1:
        raise UserError(f"level: {level:g} is no confidence between 0 and 1")
    s = float(w.std(ddof=1) / w.mean())
    k = float(exponent(s))
    drawn = _with_spread(np.random.default_rng(seed).exponential(size=(draws, len(w))), s)
    ends = np.quantile(drawn, [(1 - level) / 2, (1 + level) / 2])
    return Fitted(
        float(w.mean()), float(w.std(ddof=1)), k, float(median(w.mean(), k)), (float(ends[0]), float(ends[1])), level
    )


def _with_spread(E: Array, s: float) -> Array:
    """(b,) k at which (b, n) numbers E^(1/k) have a standard deviation over mean of s."""
    n, logs = E.shape[1], np.log(E)
    logs = logs - logs.max(axis=1, keepdims=True)
    target = np.log1p(s**2 * (n - 1) / n)  # s grows with a = 1/k, as the logarithm of a sum of powers is convex
    a = np.sqrt(target / logs.var(axis=1))
    for _ in range(60):
        once = np.exp(a[:, None] * logs)
        twice = once**2
        g = np.log(n * twice.sum(axis=1)) - 2 * np.log(once.sum(axis=1))
        slope = 2 * a * ((twice * logs).sum(axis=1) / twice.sum(axis=1) - (once * logs).sum(axis=1) / once.sum(axis=1))
        step = np.clip(np.log(target / g) * g / slope, -1.0, 1.0)
        a = a * np.exp(step)
        if np.abs(step).max() < 1e-9:
            break
    return 1 / a


def _excess(x: Array) -> Array:
    """ln Gamma(1 + 2x) - 2 ln Gamma(1 + x) = ln(1 + s^2) of x = 1/k; for small x, where it cancels, by its series."""
    x = np.asarray(x, dtype=float)
    small = np.where(x < 0.05, x, 0.0)[..., None]
    return np.where(x < 0.05, (_TERMS * small**_SERIES).sum(axis=-1), gammaln(1 + 2 * x) - 2 * gammaln(1 + x))

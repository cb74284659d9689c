"""Rare quantiles: samples with friction where a linear ring says that they are high, weighted by how likely they were.

Of M samples the linear ring tells an amplitude Z of each. Sample i is solved with friction with a probability pi_i, and
then counts 1/pi_i times (Horvitz and Thompson, 1952), so that the share above y

    p(y) = 1/M sum over the solved of 1(Y_i > y) / pi_i

is right on average whatever Z is worth. The fewest are needed with pi_i as the root of the probability that Y_i is
above the quantile; that follows from the rank of Z_i and the correlation of both, as if both ranks were normal, which
a few samples tell beforehand. Intervals are those of weighted counts (Fay and Feuer, 1997).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from ..data import Array
from .statistics import CONFIDENCE, Quantile

EACH = 100
"""Samples of the linear ring for one with friction."""

ANY = 0.1
"""Share of the samples with friction that are drawn from all, in case the linear ring misleads."""

MOST = 0.98
"""Correlation taken at most."""


@dataclass(frozen=True)
class Rare:
    """A rare quantile of the amplification by chosen samples.

    Attributes:
        quantile: with its interval. samples: with friction that were chosen. drawn: M. correlation: of the ranks of the
            linear and the friction answer in the samples before them. worth: plain samples that tell the share above
            the quantile as well, by its estimated variance.
    """

    quantile: Quantile
    samples: int
    drawn: int
    correlation: float
    worth: float


def correlation(linear: Array, friction: Array) -> float:
    """Of the ranks of (n,) pairs."""
    from scipy.stats import spearmanr

    return float(spearmanr(linear, friction)[0]) if len(linear) > 2 and np.ptp(linear) > 0 else 0.0


def chances(linear: Array, samples: int, share: float, correlation: float, pairs: int) -> Array:
    """(M,) pi of samples from (M,) answers of the linear ring.

    Args:
        samples: with friction, expected. share: of the samples below the quantile. correlation: of `pairs` ranks; the
            lower end of its interval is taken.
    """
    from scipy.stats import rankdata

    M = len(linear)
    lower = np.tanh(np.arctanh(np.clip(correlation, -MOST, MOST)) - 1.64 / np.sqrt(max(pairs - 3, 1)))
    r = float(np.clip(lower, 0.0, MOST))
    z = ndtri((rankdata(linear) - 0.5) / M)
    likely = np.sqrt(ndtr((r * z - ndtri(share)) / np.sqrt(1 - r * r)))
    return _capped((1 - ANY) * likely / likely.sum() + ANY / M, samples)


def _capped(weight: Array, total: int) -> Array:
    """Probabilities as the weights, none above 1, with a sum of total."""
    pi = np.minimum(1.0, total * weight)
    for _ in range(50):
        free = pi < 1
        left = total - (~free).sum()
        if not free.any() or left <= 0 or abs(pi.sum() - total) < 1e-9 * total:
            break
        pi = np.where(free, np.minimum(1.0, left * weight / weight[free].sum()), 1.0)
    return pi


def chosen(pi: Array, seed: int) -> Array:
    """Numbers of the samples to be solved with friction: each depends on its pi, its number and the seed alone."""
    return np.flatnonzero(np.random.default_rng([seed, 0x5241]).random(len(pi)) < pi)


def estimate(
    friction: Array, pi: Array, drawn: int, share: float, correlation: float, confidence: float = CONFIDENCE
) -> Rare:  # fmt: skip
    """The quantile from (n,) amplifications of chosen samples and their pi, of `drawn` ones."""
    order = np.argsort(-friction)
    y, w = friction[order], 1 / (drawn * pi[order])
    above, rare = np.cumsum(w), 1 - share
    # of each y: the share above it, y itself included, and the variance of that: of the choice, and of what was drawn
    spread = np.cumsum(w * w * (1 - pi[order])) + above / drawn
    at = int(np.searchsorted(above, rare))
    value = float(y[at]) if at < len(y) else np.nan
    low, high = _interval(above, spread, np.maximum.accumulate(w), 1 - confidence)
    below, beyond = np.flatnonzero(low > rare), np.flatnonzero(high < rare)
    ends = (float(y[below[0]]) if below.size else 0.0, float(y[beyond[-1]]) if beyond.size else np.inf)
    worth = rare * share / spread[at] if at < len(y) else np.nan
    return Rare(Quantile(share, value, *ends), len(y), drawn, correlation, float(worth))


def _interval(above: Array, spread: Array, most: Array, alpha: float) -> tuple[Array, Array]:
    """Of weighted counts: gamma distributions of their mean and variance; the upper end with one more of the largest
    weight."""
    from scipy.stats import gamma

    low = gamma.ppf(alpha / 2, above**2 / spread, scale=spread / above)
    mean, more = above + most, spread + most**2
    return low, gamma.ppf(1 - alpha / 2, mean**2 / more, scale=more / mean)

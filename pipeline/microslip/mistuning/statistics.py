"""Statistics over samples: quantiles with intervals, envelopes over frequency that need no memory, fits of tails."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.special import gamma

from ..data import Array
from .weibull import exponent

CONFIDENCE = 0.95


class Quantile(NamedTuple):
    """A quantile with its interval; an end that too few samples tell is infinite, or zero.

    Attributes: share: of the samples below. value, low, high.
    """

    share: float
    value: float
    low: float
    high: float

    @property
    def width(self) -> float:
        """Half of the interval over the value."""
        return 0.5 * (self.high - self.low) / self.value if self.value else np.inf

    def __str__(self) -> str:
        if np.isfinite(self.high) and self.low > 0:
            return f"{self.value:.4g} ({self.low:.4g} to {self.high:.4g})"
        return f"{self.value:.4g} (too few samples for an interval)"


def quantile(values: Array, share: float, confidence: float = CONFIDENCE) -> Quantile:
    """A quantile of (n,) positive samples, whatever their distribution; the interval holds order statistics between
    which it lies with at least the confidence (binomial distribution)."""
    from scipy.stats import binom  # a third of a second, which other runs do not need

    x = np.sort(np.asarray(values, dtype=float))
    if not len(x):
        return Quantile(share, np.nan, 0.0, np.inf)
    low, high = (int(binom.ppf(0.5 + way * confidence / 2, len(x), share)) for way in (-1, 1))
    ends = (float(x[low - 1]) if low else 0.0, float(x[high]) if high < len(x) else np.inf)
    return Quantile(share, float(np.clip(np.quantile(x, share), *ends)), *ends)  # of few, between two it lies outside


LOW, HIGH, WIDTH = -14.0, 4.0, 0.01
"""Bins of the logarithm of amplitudes over the tuned ring's highest, and their width: quantiles are as fine."""


KEPT = 2_000_000
"""Amplitudes of single samples that are kept, 16 MB: 2700 samples of 24 blades at 31 frequencies."""


@dataclass
class Envelope:
    """All blades' amplitudes on f frequencies, sample after sample.

    Attributes:
        unit: the tuned ring's highest amplitude. sums: (5, f) count, sum, sum of squares, least, largest, over the
            unit. bins: (f, b) how many amplitudes fell where. grids: (f, sectors) of the first samples, up to `KEPT`
            numbers.
    """

    unit: float
    sums: Array
    bins: Array = field(repr=False)
    grids: list[Array] = field(default_factory=list, repr=False)

    @classmethod
    def empty(cls, frequencies: int, unit: float) -> Envelope:
        sums = np.zeros((5, frequencies))
        sums[3], sums[4] = np.inf, -np.inf
        return cls(unit, sums, np.zeros((frequencies, round((HIGH - LOW) / WIDTH)), dtype=np.int64))

    def add(self, grid: Array) -> None:
        """Takes in (f, sectors) amplitudes of one sample; NaN are left out."""
        if (len(self.grids) + 1) * grid.size <= KEPT:
            self.grids.append(grid)
        y = grid / self.unit
        known = np.isfinite(y)
        z = np.where(known, y, 0.0)
        self.sums[0] += known.sum(axis=1)
        self.sums[1] += z.sum(axis=1)
        self.sums[2] += (z * z).sum(axis=1)
        self.sums[3] = np.minimum(self.sums[3], np.where(known, y, np.inf).min(axis=1))
        self.sums[4] = np.maximum(self.sums[4], np.where(known, y, -np.inf).max(axis=1))
        place = np.clip((np.log(np.maximum(z, 1e-300)) - LOW) / WIDTH, 0, self.bins.shape[1] - 1).astype(int)
        rows = np.broadcast_to(np.arange(len(y))[:, None], y.shape)
        np.add.at(self.bins, (rows[known], place[known]), 1)

    def first(self, count: int) -> Envelope:
        """That of the first samples alone; of all where that is not known any more."""
        if count > len(self.grids):
            return self
        envelope = Envelope.empty(len(self.bins), self.unit)
        for grid in self.grids[:count]:
            envelope.add(grid)
        return envelope

    def samples(self, sectors: int) -> int:
        """How many were taken in with a solution somewhere."""
        return round(float(self.sums[0].max(initial=0.0)) / sectors)

    @property
    def mean(self) -> Array:
        """(f,) of all blades and samples."""
        return self.unit * self.sums[1] / np.maximum(self.sums[0], 1)

    @property
    def deviation(self) -> Array:
        """(f,) standard deviation."""
        n = np.maximum(self.sums[0], 2)
        square = (self.sums[2] - self.sums[1] ** 2 / n) / (n - 1)
        return self.unit * np.sqrt(np.maximum(square, 0.0))

    def quantile(self, share: float) -> Array:
        """(f,) within a bin, and within all that was taken in."""
        counts = np.cumsum(self.bins, axis=1)
        at = np.array([np.searchsorted(c, share * c[-1]) if c[-1] else 0 for c in counts])
        middle = np.clip(np.exp(LOW + (at + 0.5) * WIDTH), self.sums[3], self.sums[4])
        return np.where(counts[:, -1] > 0, self.unit * middle, np.nan)

    def columns(self) -> dict[str, Array]:
        """Column -> (f,); amplitudes in their unit, k of Sextro Eq. (5.6-17)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            s = self.deviation / self.mean
        counted = self.sums[0] > 0
        return {
            "mean": self.mean,
            "deviation": self.deviation,
            "weibull_exponent": np.where(counted & (s > 0), exponent(np.where(counted & (s > 0), s, 1.0)), np.nan),
            "lowest": np.where(counted, self.unit * self.sums[3], np.nan),
            "quantile_2.5_percent": self.quantile(0.025),
            "quantile_97.5_percent": self.quantile(0.975),
            "highest": np.where(counted, self.unit * self.sums[4], np.nan),
        }


@dataclass(frozen=True)
class FittedTail:
    """A distribution fitted to highest amplitudes.

    Attributes:
        name. parameters: name -> number. distance: the largest difference between its distribution function and the
            samples' (Kolmogorov-Smirnov). tail: the same over the highest tenth alone. quantiles: share -> value.
    """

    name: str
    parameters: Mapping[str, float]
    distance: float
    tail: float
    quantiles: Mapping[float, float]


SHARES = 0.5, 0.95, 0.99, 0.999


def fits(values: Array) -> list[FittedTail]:
    """The extreme-value distribution and Weibull's, fitted to (n,) highest amplitudes by maximum likelihood."""
    from scipy.stats import genextreme, weibull_min

    x = np.sort(np.asarray(values, dtype=float))
    if len(x) < 20 or np.ptp(x) == 0:
        return []
    fitted = []
    shape, location, scale = _by_moments(x)
    for name, kind, start, given, names in (
        ("generalised extreme value", genextreme, (shape,), {"loc": location, "scale": scale},
         ("shape", "location", "scale")),
        ("Weibull", weibull_min, (), {"floc": 0.0}, ("exponent", "location", "scale")),
    ):  # fmt: skip
        made = kind(*(p := kind.fit(x, *start, **given)))
        steps = np.arange(1, len(x) + 1) / len(x)
        off = np.maximum(np.abs(made.cdf(x) - steps), np.abs(made.cdf(x) - steps + 1 / len(x)))
        tail = float(off[int(0.9 * len(x)) :].max())
        told = {share: float(made.ppf(share)) for share in SHARES}
        fitted.append(FittedTail(name, dict(zip(names, map(float, p), strict=True)), float(off.max()), tail, told))
    return fitted


def _by_moments(x: Array) -> tuple[float, float, float]:
    """Shape, location and scale of the extreme-value distribution by L-moments of (n,) rising samples (Hosking, Wallis
    and Wood, Technometrics 27, 1985): near the likelihood's maximum, which is not found from everywhere."""
    n, i = len(x), np.arange(len(x))
    b = x.mean(), (i * x).sum() / (n * (n - 1)), (i * (i - 1) * x).sum() / (n * (n - 1) * (n - 2))
    second, third = 2 * b[1] - b[0], 6 * b[2] - 6 * b[1] + b[0]
    c = 2 / (3 + third / second) - np.log(2) / np.log(3)
    shape = 7.8590 * c + 2.9554 * c**2
    scale = second * shape / ((1 - 2**-shape) * gamma(1 + shape))
    return float(shape), float(b[0] - scale * (1 - gamma(1 + shape)) / shape), float(scale)

"""Fourier series: E sums them up, P takes their coefficients out of samples, D differentiates.

The W coefficients of a signal are its mean, and the cosine and sine of every argument: of t', 2 t',
... H t' where the signal has one frequency (W = 2 H + 1), of sums of two angles where it has two.

A motion u(t) = U(omega_1 t, omega_2 t) of two frequencies lives on a torus with the angles theta_1
and theta_2,

    U = mean + sum of a_k cos(k . theta) + b_k sin(k . theta),   0 < |k_1| + |k_2| <= H,

of every pair k and -k only one. What a contact remembers runs along (omega_1, omega_2), a line that
never closes. It is marched along one that does: q turns of theta_1 and p of theta_2, p/q near
omega_2/omega_1. That is the only thing for which the ratio is taken as rational. The S samples of
the line are a lattice on the torus: sums over them are the Fourier integrals up to pairs k whose
difference has (q, p) . k a multiple of S, or zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from .data import Array, ComplexArray, Indices


def summed(arguments: Array) -> Array:
    """(..., W) E at arguments (..., P): 1, and cosine and sine of each."""
    waves = np.stack([np.cos(arguments), np.sin(arguments)], axis=-1)
    waves = waves.reshape(*arguments.shape[:-1], -1)
    return np.concatenate([np.ones((*waves.shape[:-1], 1)), waves], axis=-1)


def taken_out(values: Array) -> Array:
    """(W, s) P of E (s, W) at evenly spaced samples."""
    weights = np.full(values.shape[1], 2.0 / len(values))
    weights[0] *= 0.5
    return weights[:, None] * values.T


@lru_cache(maxsize=8)
def fourier(harmonics: int, samples: int) -> tuple[Any, Any]:
    """(s, 2 H + 1) E at the samples of a cycle, and P.

    Raises:
        ValueError: fewer than 2 H + 1 samples cannot hold H harmonics.
    """
    if samples < 2 * harmonics + 1:
        least = 2 * harmonics + 1
        raise ValueError(f"{samples} samples cannot hold {harmonics} harmonics; take at least {least}")
    t = 2 * np.pi * np.arange(samples) / samples
    values = summed(np.outer(t, np.arange(1, harmonics + 1)))
    return values, taken_out(values)


def differentiated(factors: Array) -> Array:
    """(W, W) D: the argument of every cosine and sine is multiplied by (P,) factors."""
    out, a = np.zeros((2 * len(factors) + 1,) * 2), np.arange(1, 2 * len(factors), 2)
    out[a, a + 1], out[a + 1, a] = factors, -np.asarray(factors)
    return out


def derivative(coefficients: int) -> Array:
    """(W, W) D over t' of one frequency."""
    return differentiated(np.arange(1.0, coefficients // 2 + 1))


@lru_cache(maxsize=8)
def cycle_waves(harmonics: int, samples: int) -> tuple[Array, Array, Array]:
    """(s, W) E at the samples of a cycle, its derivative over the time in cycles, and (W, s) P."""
    values, transform = fourier(harmonics, samples)
    return values, 2 * np.pi * values @ derivative(2 * harmonics + 1), transform


def integrals(harmonics: int, begin: Array, end: Array) -> Array:
    """(W, W) integrals of E^T E over t', summed over intervals (k,) from `begin` to `end`."""
    n = np.arange(1, 2 * harmonics + 1)
    waves = (np.exp(1j * np.multiply.outer(n, end)) - np.exp(1j * np.multiply.outer(n, begin))).sum(axis=1) / (1j * n)
    every = np.concatenate([waves.conj()[::-1], [(end - begin).sum()], waves])  # of exp(i n t'), n from -2 H to 2 H
    h, middle = np.arange(1, harmonics + 1), 2 * harmonics
    sums, differences = every[middle + h[:, None] + h], every[middle + h[:, None] - h]
    out = np.empty((2 * harmonics + 1,) * 2)
    out[0, 0], first = every[middle].real, waves[:harmonics]
    out[0, 1::2], out[0, 2::2] = first.real, first.imag
    out[1:, 0] = out[0, 1:]
    out[1::2, 1::2] = 0.5 * (sums + differences).real
    out[2::2, 2::2] = 0.5 * (differences - sums).real
    out[2::2, 1::2] = 0.5 * (sums + differences).imag
    out[1::2, 2::2] = out[2::2, 1::2].T
    return out


def amplitudes(v: Array) -> ComplexArray:
    """(H + 1, ...) complex amplitudes, cos - i sin, of (W, ...) coefficients."""
    out = np.empty((len(v) // 2 + 1, *v.shape[1:]), complex)
    out[0], out[1:] = v[0], v[1::2] - 1j * v[2::2]
    return out


# two frequencies ---------------------------------------------------------------------------------


ABOVE = 1e-9
"""Share of a frequency within which a combination of two is told from none at all."""


def pairs_of(order: int) -> Indices:
    """(P, 2) of H, one of k and -k, the pairs of one frequency alone first."""
    H = range(-order, order + 1)
    half = [(a, b) for a in H for b in H if 0 < abs(a) + abs(b) <= order and (a > 0 or (a == 0 and b > 0))]
    return np.array(sorted(half, key=lambda k: (abs(k[0]) + abs(k[1]), k[0] * k[1] != 0, -k[0], -k[1])))


def closed(first: float, second: float, least: int) -> tuple[int, int]:
    """(q, p) turns of the first and the second angle in a line that closes after `least` to 2 `least` turns of the
    faster one: of the lines of coprime turns the one that goes astray least in a turn, for its length."""
    slow, fast = sorted((first, second))
    ratio, found = slow / fast, []
    for q in range(least, 2 * least + 1):
        for p in {math.floor(q * ratio), math.ceil(q * ratio)}:
            if p and math.gcd(p, q) == 1:
                found.append((abs(ratio - p / q) * q**1.5, q, p))
    _, q, p = min(found)
    return (q, p) if first >= second else (p, q)


@dataclass(frozen=True, eq=False)
class Torus:
    """The series of H, and the closed line.

    Attributes:
        order: H. turns: (q, p). count: S, samples of the line, evenly spaced.
    """

    order: int
    turns: tuple[int, int]
    count: int

    @cached_property
    def pairs(self) -> Indices:
        """(P, 2)."""
        return pairs_of(self.order)

    @property
    def coefficients(self) -> int:
        """W = 2 P + 1: mean, cosine and sine of every pair."""
        return 2 * len(self.pairs) + 1

    @cached_property
    def values(self) -> Array:
        """(S, W) of the series at the samples."""
        turned = np.arange(self.count) * (self.pairs @ np.array(self.turns))[:, None] % self.count
        return summed(2 * np.pi * turned.T / self.count)

    @property
    def waves(self) -> tuple[Array, Array, Array]:
        """`values`, `ahead` and `transform`."""
        return self.values, self.ahead, self.transform

    @cached_property
    def ahead(self) -> Array:
        """(S, W) derivative of the series over the time in closed lines, at the samples."""
        return self.values @ differentiated(2 * np.pi * (self.pairs @ np.array(self.turns)))

    @cached_property
    def transform(self) -> Array:
        """(W, S) coefficients of samples."""
        return np.ascontiguousarray(taken_out(self.values))

    def frequencies(self, first: float, second: float) -> Array:
        """(P,) k . omega of every pair; zero where two frequencies cancel."""
        found = self.pairs @ np.array([first, second])
        return np.where(np.abs(found) < ABOVE * max(first, second), 0.0, found)


def commensurate(first: float, second: float, order: int) -> tuple[int, int] | None:
    """(q, p), small whole numbers with p first = q second: two pairs of the series have one frequency; None if all
    differ."""
    k = pairs_of(2 * order)
    together = k[np.abs(k @ np.array([first, second])) < ABOVE * max(first, second)]
    if not len(together):
        return None
    a, b = together[np.abs(together).sum(axis=1).argmin()]
    return abs(int(b)), abs(int(a))

"""Harmonics of a steady vibration over its cycle: what is largest, and when."""

from __future__ import annotations

import numpy as np

from ..data import Array, ComplexArray

SAMPLES = 16
"""Samples of a cycle for each harmonic of a wave whose largest value is sought."""


def longest(vectors: ComplexArray) -> Array:
    """(...,) largest length over the cycle of the vectors Re(a exp(i t)), a (..., d): half the ellipse's long axis.

    |x(t)|^2 = (|a|^2 + Re(a . a exp(2 i t)))/2, so the largest is sqrt((|a|^2 + |a . a|)/2).
    """
    square = (vectors.real**2 + vectors.imag**2).sum(axis=-1)
    return np.sqrt(0.5 * (square + np.abs((vectors * vectors).sum(axis=-1))))


def at_time(harmonics: ComplexArray, angle: float | Array, axis: int = 1) -> Array:
    """Values at Omega t = angle (rad), of one angle, or of several along a new first axis."""
    a = np.moveaxis(harmonics, axis, 0)
    turn = np.exp(1j * np.multiply.outer(np.asarray(angle, dtype=float), np.arange(len(a))))
    return np.tensordot(turn, a, axes=1).real


def farthest_at(harmonics: ComplexArray) -> float:
    """Omega t, rad, to a hundredth of the cycle, when one of the points (H + 1, n, d) is farthest from its mean."""
    a = harmonics.copy()
    a[0] = 0.0
    node = int((longest(a[1]) if len(a) == 2 else np.abs(a).sum(axis=(0, 2))).argmax())
    angles = 2 * np.pi * np.arange(100) / 100
    return float(angles[np.linalg.norm(at_time(a[:, node], angles, axis=0), axis=1).argmax()])


def amplitude(harmonics: ComplexArray, axis: int = 1, samples: int | None = None) -> Array:
    """Largest |x(t) - mean| over the cycle of signals whose harmonics stand along an axis.

    With one harmonic |a_1|; with more the largest of samples, refined; see `largest_of_wave`.
    """
    a = np.moveaxis(harmonics, axis, 0)[1:]
    if len(a) == 1:
        return np.abs(a[0])
    up, down = (largest_of_wave(np.moveaxis(s * a, 0, -1), samples) for s in (1.0, -1.0))
    return np.maximum(up, down)


def largest_of_wave(harmonics: ComplexArray, samples: int | None = None) -> Array:
    """(...,) largest value over the cycle of real waves sum Re(a_h exp(i h t)), a_h (..., H), h = 1 ... H."""
    zero = np.zeros((*harmonics.shape[:-1], 1), dtype=complex)
    return wave_top(np.concatenate([zero, harmonics], axis=-1), SAMPLES if samples is None else samples)


def wave_top(a: ComplexArray, per_harmonic: int) -> Array:
    """Largest of p(t) = Re(sum a_n exp(i n t)), a (..., n + 1): the highest hill, Newton's method to its top.

    Every sample is raised to the top of the parabola through it and its neighbours, so that of two hills the higher is
    taken. What may be wrong is the hill alone, and then by no more than the error of a parabola; without it the
    largest of N samples is still cos(pi n / N) of the largest |p| (Ehlich and Zeller, Math. Z. 86 (1964) 41).
    """
    order = a.shape[-1] - 1
    if order == 0:
        return a[..., 0].real
    count = max(per_harmonic * order, 16)
    n = np.arange(order + 1)
    t = 2 * np.pi * np.arange(count) / count
    turn = np.exp(1j * np.outer(n, t))
    value = a.real @ turn.real
    value -= a.imag @ turn.imag
    top = _hill(value)
    best, at = np.take_along_axis(value, top[..., None], axis=-1)[..., 0], t[top]
    for _ in range(3):
        wave = a * np.exp(1j * at[..., None] * n)
        slope, bend = -(wave.imag @ n), -(wave.real @ n**2)
        step = np.divide(-slope, bend, out=np.zeros_like(slope), where=bend < 0)
        at = at + np.clip(step, -np.pi / count, np.pi / count)
        best = np.maximum(best, (a * np.exp(1j * at[..., None] * n)).real.sum(axis=-1))
    return best


def _hill(value: Array) -> Array:
    """Number of the sample (last axis, periodic) whose parabola through three samples is the highest at its top."""
    before, after = np.roll(value, 1, axis=-1), np.roll(value, -1, axis=-1)
    bend = 2 * value - before - after
    hill = (before <= value) & (value >= after) & (bend > 0)
    rise = np.divide((after - before) ** 2, 8 * bend, out=np.zeros_like(value), where=hill)
    return (value + rise).argmax(axis=-1)

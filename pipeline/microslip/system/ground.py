"""Ground that moves under a contact and is wavy (Sextro, sections 4.1 and 4.3): what it is, in numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Wave = tuple[float, float, float]
"""Amplitude y_A (m), length lambda (m), phase (rad)."""


@dataclass(frozen=True)
class Ground:
    """The other side of a contact, which moves in its plane.

    Attributes:
        velocity: V, m/s. angle: rad of its direction, from t1 towards t2. waves. pushes: whether the slope of a wave
            turns the normal force.
    """

    velocity: float = 0.0
    angle: float = 0.0
    waves: tuple[Wave, ...] = ()
    pushes: bool = True


def spectrum(height: float, longest: float, shortest: float, exponent: float, count: int, seed: int) -> list[Wave]:
    """Waves of a self-affine profile: power spectrum over the wave number k as k^-exponent, in equal steps of log k.

    Args:
        height: m, root of the mean square of y_R. longest, shortest: m. exponent: 2 of roads and random walks. count:
            of waves. seed: of phases and of the place of each wave within its step.
    """
    random = np.random.default_rng(seed)
    edges = np.linspace(-np.log(longest), -np.log(shortest), count + 1)
    k = np.exp(edges[:-1] + np.diff(edges) * random.uniform(0, 1, count))
    power = k ** (1 - exponent)  # times the width of its step, k d log k
    amplitude = height * np.sqrt(2 * power / power.sum())
    return list(zip(amplitude, 1 / k, random.uniform(0, 2 * np.pi, count), strict=True))

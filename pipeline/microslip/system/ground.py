"""Ground that moves under a contact and is wavy (Sextro, sections 4.1 and 4.3): what it is, in numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Array

Wave = tuple[float, float, float]
"""Amplitude y_A (m), length lambda (m), phase (rad)."""


@dataclass(frozen=True)
class Ground:
    """The other side of a contact, which moves in its plane.

    Attributes:
        velocity: V, m/s, at the origin of the contact. angle: rad of its direction, from t1 towards t2. waves. pushes:
            whether the slope of a wave turns the normal force. spin: rad/s about the normal, by which the velocity
            differs from point to point.
    """

    velocity: float = 0.0
    angle: float = 0.0
    waves: tuple[Wave, ...] = ()
    pushes: bool = True
    spin: float = 0.0

    def velocities(self, points: Array) -> Array:
        """(n, 2) m/s along t1 and t2 at points (n, 2), m."""
        straight = self.velocity * np.array([np.cos(self.angle), np.sin(self.angle)])
        return straight + self.spin * np.stack([-points[:, 1], points[:, 0]], axis=1)


def turning(rate: Array, centre: Array, origin: Array, frame: Array) -> Ground:
    """Ground that turns, where it touches a contact.

    Args:
        rate: (3,) rad/s, along the axis. centre: (3,) m, a point of it. origin: (3,) m and frame: (3, 3) rows n, t1, t2
            of the contact, in the same axes.
    """
    n, t1, t2 = frame
    V = np.cross(rate, origin - centre)
    return Ground(float(np.hypot(V @ t1, V @ t2)), float(np.arctan2(V @ t2, V @ t1)), spin=float(rate @ n))


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

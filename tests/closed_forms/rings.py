"""Spinning rings."""

from __future__ import annotations

import numpy as np


def ring_at_rest(wave: int, radius: float, young: float, density: float, thickness: float) -> float:
    """In-plane bending of a thin free ring, rad/s, for n >= 2 waves and the radial thickness h (Hoppe 1871).

    omega^2 = n^2 (n^2 - 1)^2 / (n^2 + 1) E h^2 / (12 rho R^4)
    """
    n = wave
    return float(n * (n**2 - 1) / np.sqrt(n**2 + 1) * thickness / radius**2 * np.sqrt(young / (12 * density)))


def spinning_ring(wave: int, at_rest: float, speed: float) -> tuple[float, float]:
    """In-plane bending waves of a thin free ring that spins about its own axis, seen in the frame that turns with it.

    Inextensional, stretched by its own centrifugal force. A wave exp(i (n theta + omega t)) has

        (n^2 + 1) omega^2 - 4 n Omega omega = (n^2 + 1) omega_0^2 + n^2 (n^2 - 3) Omega^2

    (Bryan 1890 for the split, Carrier 1945 for the tension; Soedel, Vibrations of Shells and Plates, 19.3). Without
    bending stiffness the root n Omega stands still in space: waves on a loop run as fast as the loop turns.

    Args:
        wave: n >= 2. at_rest: omega_0, rad/s. speed: Omega, rad/s.

    Returns:
        omega in rad/s: negative of the forward wave, positive of the backward one.
    """
    n = wave
    a, b, c = n**2 + 1, -4 * n * speed, -((n**2 + 1) * at_rest**2 + n**2 * (n**2 - 3) * speed**2)
    root = np.sqrt(b**2 - 4 * a * c)
    return float((-b - root) / (2 * a)), float((-b + root) / (2 * a))

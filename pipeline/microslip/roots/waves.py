"""A shape as waves that run round an axis: nodal diameters, and what runs forward and backward."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Array, ComplexArray

HIGHEST = 12
"""Nodal diameters that are told apart."""


@dataclass(frozen=True)
class Waves:
    """Displacement along an axis at a rim, Re(u exp(i omega t)), as a sum over nodal diameters n.

    Attributes:
        forward: (n,) complex amplitudes of exp(i (omega t - n phi)), which run towards growing angles phi.
        backward: (n,) of exp(i (omega t + n phi)); both halves of n = 0 are the same.
    """

    forward: ComplexArray
    backward: ComplexArray

    @property
    def shares(self) -> Array:
        """(n, 2) forward and backward share of the sum of all squares."""
        squares = np.abs(np.stack([self.forward, self.backward], axis=1)) ** 2
        return squares / squares.sum()

    @property
    def leading(self) -> int:
        """The nodal diameter with the largest share."""
        return int(np.argmax(self.shares.sum(axis=1)))

    @property
    def sentence(self) -> str:
        """The leading nodal diameter, its share, and how much of it runs forward."""
        n = self.leading
        ahead, behind = self.shares[n]
        if n == 0:
            return f"nodal diameter 0 ({100 * (ahead + behind):.0f} % of the rim's motion)"
        return (
            f"nodal diameter {n} ({100 * (ahead + behind):.0f} % of the rim's motion), of which "
            f"{100 * ahead / (ahead + behind):.0f} % runs forward and {100 * behind / (ahead + behind):.0f} % backward"
        )


def waves(points: Array, u: ComplexArray, axis: Array, centre: Array) -> Waves:
    """The waves of a body's shape at its rim, by least squares.

    Args:
        points: (n, 3) m. u: (n, 3) complex displacement. axis, centre: (3,) of what turns, forward by the right hand.
    """
    n = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    away = points - centre
    flat = away - np.outer(away @ n, n)
    radius = np.linalg.norm(flat, axis=1)
    rim = radius > (1 - 1e-3) * radius.max()
    first = flat[rim][0] / radius[rim][0]
    phi = np.arctan2(flat[rim] @ np.cross(n, first), flat[rim] @ first)
    most = min(HIGHEST, (len(np.unique(np.round(phi, 6))) - 1) // 2)
    k = np.arange(most + 1)
    basis = np.hstack([np.exp(-1j * np.outer(phi, k)), np.exp(1j * np.outer(phi, k[1:]))])
    amplitudes = np.linalg.lstsq(basis, u[rim] @ n, rcond=None)[0]
    forward, backward = amplitudes[: most + 1], np.concatenate([amplitudes[:1], amplitudes[most + 1 :]])
    forward[0], backward[0] = 0.5 * forward[0], 0.5 * backward[0]
    return Waves(forward, backward)

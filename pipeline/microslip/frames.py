"""Cross products and rotations as matrices, for both sides of the modal file."""

from __future__ import annotations

import numpy as np

from .data import Array


def skew(vector: Array) -> Array:
    """(3, 3) matrix of the cross product, the tilde of Sextro Eq. (2.1-5)."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0.0]])


def rotation(axis: Array, angle: float) -> Array:
    """(3, 3) matrix that turns vectors about a direction by an angle (rad), right-handed (Rodrigues)."""
    K = skew(axis / np.linalg.norm(axis))
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)


def rigid_fields(points: Array, centre: Array) -> Array:
    """(n, 3, 6) translations along x, y, z and small rotations about axes through the centre."""
    r = points - centre
    fields = np.zeros((len(points), 3, 6))
    for i in range(3):
        fields[:, i, i] = 1.0
        axis = np.eye(3)[i]
        fields[:, :, 3 + i] = np.cross(axis, r)
    return fields

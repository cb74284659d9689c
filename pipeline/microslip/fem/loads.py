"""Nodal force vectors, (n, 3) in N: body forces, centrifugal, pressure, thermal."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..data import Array
from .discretise import FacetBlock
from .operators import spin_projector


def body_force(mass_full: sp.csr_matrix, acceleration: Array) -> Array:
    """Forces of a uniform acceleration field (3,), m/s2, such as gravity: M (1 x a)."""
    return np.outer(mass_full @ np.ones(mass_full.shape[0]), acceleration)


def centrifugal(mass_full: sp.csr_matrix, position: Array, axis: Array, point: Array) -> Array:
    """Centrifugal forces per (rad/s)^2 at the given positions: -f_zc0 of Sextro Eq. (2.3-29) with x + u.

    Args:
        mass_full: (n, n) scalar mass matrix, kg. position: (n, 3) m. axis: (3,) unit vector of the rotation.
        point: (3,) a point of the axis, m.
    """
    return mass_full @ ((position - point) @ spin_projector(axis))


def pressure(blocks: list[FacetBlock], n_points: int, value: Array | float = 1.0) -> Array:
    """Forces of a pressure (Pa, positive pushes into the body) on facets; direction fixed (dead load)."""
    f = np.zeros((n_points, 3))
    for b in blocks:
        nodal = -value * np.einsum("qk,fqi->fki", b.N, b.area)
        np.add.at(f, b.facets.reshape(-1), nodal.reshape(-1, 3))
    return f


def traction(blocks: list[FacetBlock], n_points: int, direction: Array) -> Array:
    """Forces of a uniform traction (3,), Pa, on facets."""
    f = np.zeros((n_points, 3))
    for b in blocks:
        nodal = np.einsum("qk,fq->fk", b.N, np.linalg.norm(b.area, axis=2))[..., None] * direction
        np.add.at(f, b.facets.reshape(-1), nodal.reshape(-1, 3))
    return f

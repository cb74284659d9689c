"""Nodal force vectors, (n, 3) in N: body forces, centrifugal, pressure; the stiffness of what follows the surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..data import Array, Flags, Indices
from .discretise import Discretisation, FacetBlock, Pattern, quadrature, shape_functions
from .operators import per_block, spin_projector


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


def corner_traction(b: FacetBlock, kind: str, n_points: int, values: Array, direction: Array) -> Array:
    """Forces of a traction along a direction (3,) on facets of a type. values: (f, c) at their corners, Pa."""
    corner, _ = shape_functions("triangle" if values.shape[1] == 3 else "quad", quadrature(kind)[0])
    f = np.zeros((n_points, 3))
    nodal = np.einsum("qk,fq->fk", b.N, np.linalg.norm(b.area, axis=2) * (values @ corner.T))[..., None] * direction
    np.add.at(f, b.facets.reshape(-1), nodal.reshape(-1, 3))
    return f


def cells_force(d: Discretisation, density: Sequence[float], chosen: Flags, acceleration: Array) -> Array:
    """Forces of an acceleration field (3,), m/s2, on chosen cells alone.

    Args:
        density: kg/m3, one per block. chosen: (cells,) whether it acts on each cell of the mesh, type by type.
    """
    kinds, f = list(d.mesh.cells.items()), np.zeros((d.mesh.n_points, 3))
    ends = np.cumsum([len(cells) for _, cells in kinds])
    own = {kind: chosen[end - len(cells) : end] for (kind, cells), end in zip(kinds, ends, strict=True)}
    for b, rho in zip(d.blocks, per_block(d, density), strict=True):
        region = d.mesh.regions.get(b.cell_type)
        mask = own[b.cell_type] if region is None or not len(region) else own[b.cell_type][region == b.region]
        nodal = rho * (b.dx[mask] @ b.N)[..., None] * acceleration
        np.add.at(f, b.cells[mask].reshape(-1), nodal.reshape(-1, 3))
    return f


@dataclass(frozen=True)
class FollowingPressure:
    """A pressure on facets of one type that follows the surface. facets: (f, k) points; values: (f, c) at corners, Pa.

    With x_1, x_2 the tangents of the surface its forces are f_a = - int p N_a x_1 x x_2. Their derivative is
    symmetric but for what acts at the rim of the face; its symmetric part is the stiffness

        K_ab = 1/2 int p [(N_a N_b,1 - N_b N_a,1) S(x_2) - (N_a N_b,2 - N_b N_a,2) S(x_1)],   S(v)_ij = e_ijk v_k

    (K. Schweizerhof and E. Ramm, Comp. Struct. 18, 1984; so does CalculiX).
    """

    kind: str
    facets: Indices
    values: Array

    def _at(self, x: Array, chosen: slice = slice(None)) -> tuple[Array, Array, Array, Array]:
        """(q, k) N, (q, 2, k) its derivatives, (f, q, 2, 3) tangents, (f, q) weights times pressures."""
        at, weights = quadrature(self.kind)
        N, dN = shape_functions(self.kind, at)
        corner, _ = shape_functions("triangle" if self.values.shape[1] == 3 else "quad", at)
        tangents = np.einsum("fki,qjk->fqji", x[self.facets[chosen]], dN, optimize=True)
        return N, dN, tangents, weights * (self.values[chosen] @ corner.T)

    def force(self, x: Array) -> Array:
        """(n, 3) N at positions x (n, 3)."""
        N, _, t, p = self._at(x)
        f = np.zeros_like(x)
        nodal = -np.einsum("qk,fq,fqi->fki", N, p, np.cross(t[:, :, 0], t[:, :, 1]), optimize=True)
        np.add.at(f, self.facets.reshape(-1), nodal.reshape(-1, 3))
        return f

    def stiffness(self, x: Array, pattern: Pattern) -> Array:
        """(p, 3, 3) over the pattern, N/m, at positions x (n, 3)."""
        out = np.zeros((pattern.size, 3, 3))
        keys = pattern.row.astype(np.int64) * pattern.n + pattern.col
        for start in range(0, len(self.facets), 2000):
            chosen = slice(start, start + 2000)
            N, dN, t, p = self._at(x, chosen)
            skew = np.einsum("qa,qjb->qjab", N, dN)
            skew = 0.5 * (skew - skew.transpose(0, 1, 3, 2))
            S = np.cross(t[..., None, :], np.eye(3))  # S[j] = v x e_j: column j of e_ijk ... of minus S(v)
            S = S.swapaxes(-1, -2)
            one, two = (np.einsum("fq,qab,fqij->fabij", p, skew[:, j], S[:, :, 1 - j], optimize=True) for j in (0, 1))
            facets = self.facets[chosen]
            a, b = np.broadcast_arrays(facets[:, :, None], facets[:, None, :])
            upper = a <= b
            place = np.searchsorted(keys, a[upper].astype(np.int64) * pattern.n + b[upper])
            np.add.at(out, place, (two - one)[upper])
        return out

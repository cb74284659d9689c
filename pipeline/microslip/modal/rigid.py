"""Rigid motions that the supports leave free."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import qr

from ..data import Array, Indices
from ..fem.discretise import FreeUpper, Pattern
from ..fem.tied import Tied
from ..frames import rigid_fields as rigid_fields

_NAMES = ("x", "y", "z")


def free_motions(points: Array, centre: Array, fixed: Indices) -> Array:
    """(3n, r) rigid motions that move no fixed degree of freedom, not normalised."""
    fields = rigid_fields(points, centre).reshape(-1, 6)
    size = max(float(np.ptp(points, axis=0).max()), 1e-30)
    scaled = fields / np.array([1, 1, 1, size, size, size])
    return scaled if not len(fixed) else scaled @ null_space(scaled[fixed])


def left_by(free: FreeUpper | Tied, points: Array, centre: Array, fixed: Indices) -> Array:
    """(3n, r) rigid motions that supports and ties leave, not normalised."""
    if not isinstance(free, Tied):
        return free_motions(points, centre, fixed)
    return allowed(free, free_motions(points, centre, fixed[:0]))


def allowed(free: Tied, motions: Array) -> Array:
    """(3n, q) those motions out of (3n, r) that supports and ties let pass."""
    moved = motions / np.maximum(np.abs(motions).max(axis=0), 1e-300)
    barred = np.linalg.qr(moved - free.expand(free.unknowns_of(moved), len(moved) // 3), mode="r")
    _, s, vt = np.linalg.svd(barred, full_matrices=True)
    return moved @ vt[int((s > _BARRED * np.linalg.norm(moved)).sum()) :].T


_BARRED = 1e-6
"""Share of a motion beyond which ties resist it: positions in a file have some seven digits."""


def unresisted(motions: Array, springs: Array | None, pattern: Pattern) -> Array:
    """(3n, q) those motions out of (3n, r) that springs (p, 3, 3) of lumped elements let pass without force."""
    if springs is None or not springs.any() or not motions.shape[1]:
        return motions
    moved = motions / np.maximum(np.abs(motions).max(axis=0), 1e-300)
    K = pattern.full(springs)
    force = np.linalg.qr(K @ moved, mode="r")
    _, s, vt = np.linalg.svd(force, full_matrices=True)
    return moved @ vt[int((s > _BARRED * np.linalg.norm(np.abs(K) @ np.abs(moved))).sum()) :].T


def null_space(rows: Array) -> Array:
    """(6, r) combinations of six motions that no row moves."""
    short = np.linalg.qr(rows, mode="r")  # the singular values and vectors of many rows in six
    _, s, vt = np.linalg.svd(short, full_matrices=True)
    rank = int((s > 1e-8 * max(s.max(), 1e-300)).sum())
    return vt[rank:].T


def free_motions_of_ring(points: Array, point: Array, fixed: Indices, turn: Array, sectors: int) -> Array:
    """(3n, r) rigid motions of a ring, on its first sector, that the supports of no sector hold.

    Args:
        points: (n, 3) of the first sector, m. point: of the rotation axis. fixed: of the first sector; the others'
            turn with them. turn: (3, 3) rotation from a sector to the next.
    """
    size = max(float(np.ptp(points, axis=0).max()), 1e-30)
    nodes, which = np.unique(fixed // 3, return_inverse=True)
    rows, R = [np.zeros((0, 6))], np.eye(3)
    for _ in range(sectors):
        turned = (points[nodes] - point) @ R.T + point
        seen = np.einsum("ab,nak->nbk", R, rigid_fields(turned, point))  # in the sector's own axes
        rows.append(seen[which, fixed % 3] / np.array([1, 1, 1, size, size, size]))
        R = turn @ R
    scaled = rigid_fields(points, point).reshape(-1, 6) / np.array([1, 1, 1, size, size, size])
    return scaled if not len(fixed) else scaled @ null_space(np.concatenate(rows))


def coefficients_of(points: Array, point: Array, motions: Array) -> Array:
    """(6, r) translations and rotations about a point that make rigid motions (3n, r)."""
    fields = rigid_fields(points, point).reshape(-1, 6)
    return np.linalg.lstsq(fields, motions, rcond=None)[0] if motions.shape[1] else np.zeros((6, 0))


def of_nodal_diameter(coefficients: Array, turn: Array, sectors: int, harmonic: int) -> Array:
    """(6, q) of the motions (6, r) of a whole ring about its axis, those that are of a nodal diameter.

    A ring's motion is of the nodal diameter k where t and theta of the sector turned back are those times the phase:
    R^-1 t = t exp(+i k 2 pi / N). Along and about the axis it is 0, across it 1. Real for k = 0 and N/2.

    Args:
        coefficients: of motions that turn into each other by the sector. turn: (3, 3) R from a sector to the next.
    """
    back, whole = np.eye(3), np.zeros((3, 3), dtype=complex)
    for j in range(sectors):
        whole += back * np.exp(-2j * np.pi * j * harmonic / sectors) / sectors
        back = turn.T @ back
    if 2 * harmonic in (0, sectors):
        whole = whole.real
    found = np.vstack([whole @ coefficients[:3], whole @ coefficients[3:]])
    scale = np.linalg.norm(coefficients, axis=0)
    U, s, _ = np.linalg.svd(found / np.where(scale > 0, scale, 1.0), full_matrices=False)
    return U[:, s > 1e-8]


def describe(points: Array, centre: Array, motions: Array, coefficients: Array | None = None) -> list[str]:
    """Name each free rigid motion: a translation, or a rotation with its axis (screws are named as both).

    Args:
        coefficients: (6, r) of the motions in `rigid_fields`, where the displacements alone do not tell them: nodes
            on a line do not move when it turns about itself.
    """
    fields = rigid_fields(points, centre).reshape(-1, 6)
    texts = []
    if coefficients is None:
        coefficients = np.linalg.lstsq(fields, motions, rcond=None)[0] if motions.shape[1] else np.zeros((6, 0))
    if motions.shape[1] == 6:
        return ["all six rigid motions"]
    size = np.ptp(points, axis=0).max()
    for c in _simplest(coefficients, size).T:
        t, w = c[:3], c[3:]
        if np.linalg.norm(w) * size < 1e-6 * np.linalg.norm(t):
            texts.append(f"translation along {_direction(t)}")
        else:
            axis = w / np.linalg.norm(w)
            through = centre + np.cross(w, t) / (w @ w)
            at = ", ".join(f"{v:.4g}" for v in np.where(np.abs(through) < 1e-9 * size, 0.0, through))
            texts.append(f"rotation about {_direction(axis)} through ({at}) m")
    return texts


def _simplest(coefficients: Array, size: float) -> Array:
    """The same motions, combined so that each alone has some component: about x and y, not about two slants."""
    r = coefficients.shape[1]
    if r < 2:
        return coefficients
    _, _, order = qr((coefficients.T * np.array([1, 1, 1, size, size, size])), mode="economic", pivoting=True)
    return coefficients @ np.linalg.inv(coefficients[np.sort(order[:r])])


def _direction(v: Array) -> str:
    v = v / np.linalg.norm(v)
    big = int(np.abs(v).argmax())
    if abs(v[big]) > 0.999:
        return _NAMES[big]
    return "(" + ", ".join(f"{x:.3g}" for x in v) + ")"


def mass_orthonormal(motions: Array, mass_product: Callable[[Array], Array]) -> Array:
    """M-orthonormal basis of the span of the columns; `mass_product` maps (n, r) to M times it.

    Columns are brought to one size first (a rotation of a body of 0.1 mm moves 1e-8 of the mass of a translation), and
    a second pass takes out what rounding leaves of the first.
    """
    for _ in range(2):
        gram = motions.conj().T @ mass_product(motions)
        size = np.sqrt(np.diag(gram).real)
        w, Q = np.linalg.eigh(gram / np.outer(size, size))
        motions = (motions / size) @ (Q / np.sqrt(w))
    return motions

"""Rigid motions that the supports leave free."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..data import Array, Indices

_NAMES = ("x", "y", "z")


def rigid_fields(points: Array, centre: Array) -> Array:
    """(n, 3, 6) translations along x, y, z and small rotations about axes through the centre."""
    r = points - centre
    fields = np.zeros((len(points), 3, 6))
    for i in range(3):
        fields[:, i, i] = 1.0
        axis = np.eye(3)[i]
        fields[:, :, 3 + i] = np.cross(axis, r)
    return fields


def free_motions(points: Array, centre: Array, fixed: Indices) -> Array:
    """(3n, r) rigid motions that move no fixed degree of freedom, not normalised."""
    fields = rigid_fields(points, centre).reshape(-1, 6)
    size = max(float(np.ptp(points, axis=0).max()), 1e-30)
    scaled = fields / np.array([1, 1, 1, size, size, size])
    if not len(fixed):
        return scaled
    short = np.linalg.qr(scaled[fixed], mode="r")  # the singular values and vectors of many rows in six
    _, s, vt = np.linalg.svd(short, full_matrices=True)
    rank = int((s > 1e-8 * max(s.max(), 1e-300)).sum())
    return scaled @ vt[rank:].T


def describe(points: Array, centre: Array, motions: Array) -> list[str]:
    """Name each free rigid motion: a translation, or a rotation with its axis (screws are named as both)."""
    fields = rigid_fields(points, centre).reshape(-1, 6)
    texts = []
    coefficients = np.linalg.lstsq(fields, motions, rcond=None)[0] if motions.shape[1] else np.zeros((6, 0))
    if motions.shape[1] == 6:
        return ["all six rigid motions"]
    for c in coefficients.T:
        t, w = c[:3], c[3:]
        size = np.ptp(points, axis=0).max()
        if np.linalg.norm(w) * size < 1e-6 * np.linalg.norm(t):
            texts.append(f"translation along {_direction(t)}")
        else:
            axis = w / np.linalg.norm(w)
            through = centre + np.cross(w, t) / (w @ w)
            at = ", ".join(f"{v:.4g}" for v in np.where(np.abs(through) < 1e-9 * size, 0.0, through))
            texts.append(f"rotation about {_direction(axis)} through ({at}) m")
    return texts


def _direction(v: Array) -> str:
    v = v / np.linalg.norm(v)
    big = int(np.abs(v).argmax())
    if abs(v[big]) > 0.999:
        return _NAMES[big]
    return "(" + ", ".join(f"{x:.3g}" for x in v) + ")"


def mass_orthonormal(motions: Array, mass_product: Callable[[Array], Array]) -> Array:
    """M-orthonormal basis of the span of the columns; `mass_product` maps (n, r) to M times it."""
    gram = motions.T @ mass_product(motions)
    w, Q = np.linalg.eigh(gram)
    return motions @ (Q / np.sqrt(w))

"""Floquet multipliers of periodic orbits, and which of them leave the unit circle."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from ..data import Array, ComplexArray
from .shooting import Orbit


def monodromy(orbit: Orbit) -> Array:
    """(n, n) derivative of where a period leads, over the first node."""
    found = np.eye(orbit.system.count)
    for piece in orbit.derivatives:
        found = piece @ found
    return found


def multipliers(orbit: Orbit) -> ComplexArray:
    """Floquet multipliers, the largest first: (n,) of a driven orbit; (n - 1,) of a free one, without the one along the
    orbit, which is 1: those of the map of the plane across the flow onto itself."""
    M = monodromy(orbit)
    if orbit.system.frequency is None:
        across = scipy.linalg.null_space((orbit.slope / orbit.system.scale)[None])
        back = across * np.asarray(orbit.system.scale)[:, None]
        M = across.T @ (M @ back / np.asarray(orbit.system.scale)[:, None])
    found = np.linalg.eigvals(M).astype(complex)
    return found[np.argsort(-np.abs(found), kind="stable")]


def doubling(found: ComplexArray) -> float:
    """Changes its sign where a multiplier passes -1."""
    return float(np.prod(1 + found).real)


def torus(found: ComplexArray) -> float:
    """Changes its sign where a pair passes the unit circle, or two real ones of the product 1."""
    i, j = np.triu_indices(len(found), 1)
    return float(np.prod(found[i] * found[j] - 1).real)


def passing_pair(found: ComplexArray) -> complex | None:
    """The complex one that is on the unit circle, if `torus` is zero by it and not by two real ones."""
    pairs = found[np.abs(found.imag) > 1e-7 * np.abs(found)]
    nearest = pairs[np.argsort(np.abs(np.abs(pairs) - 1))]
    return complex(nearest[0]) if len(nearest) and abs(abs(nearest[0]) - 1) < 1e-5 else None


STABLE = 1e-7
"""By which a multiplier may stand beyond the unit circle and count as on it."""


def is_stable(found: ComplexArray) -> bool:
    return bool(np.abs(found).max(initial=0.0) < 1 + STABLE)

"""Stiffnesses of a point on an elliptic orbit, computed and not looked up (Sextro, Eqs. (5.2-15) to (5.2-30))."""

from __future__ import annotations

import numpy as np

from microslip.data import Array, ComplexArray
from microslip.harmonic_balance.orbits import THINNEST, _longest_sticking, _never_sticking, sticking


def exact(eta: Array, zeta: Array) -> ComplexArray:
    """(2, n) K_eta*, K_zeta* of orbits with half-axes eta_A* >= zeta_A* >= 0, computed and not looked up; of lines the
    limit of thin ellipses."""
    A, B = np.asarray(eta, dtype=float), np.asarray(zeta, dtype=float)
    found, slides = np.ones((2, len(A)), dtype=complex), A > 1
    A, B = A[slides], np.maximum(B, THINNEST * A)[slides]
    parts = _harmonics(A, B)
    found[:, slides] = (parts[::2] + 1j * parts[1::2]) / np.stack([A, B])
    return found


def _harmonics(A: Array, B: Array) -> Array:
    """(4, n) harmonics of any orbits beyond A = 1: smooth ones by the smooth method, the others by the return map."""
    found = np.zeros((4, len(A)))
    never = (A < 50) & (A > _longest_sticking(B / A) * (1 - 1e-9))
    if never.any():
        found[:, never] = _never_sticking(A[never], B[never])
    if not never.all():
        found[:, ~never] = sticking(A[~never], B[~never])
    return found

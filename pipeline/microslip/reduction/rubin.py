"""Rubin's method: eigenmodes and the residual attachment modes of every interface and load row.

S. Rubin, AIAA Journal 13 (1975) 995. The residual attachment modes are what the kept modes leave of the static
answers; they are orthogonal to the modes through M and K, so diagonalising them among themselves keeps the modes
as they are and adds pseudo-modes above the band. The static answer to forces on the rows is exact.
"""

from __future__ import annotations

import numpy as np

from .problem import Reduced, Substructure, diagonal, own_modes


def reduce(problem: Substructure) -> Reduced:
    """Eigenmodes and pseudo-modes, all M-orthonormal and K-orthogonal."""
    values, vectors = own_modes(problem.pencil, problem.residual(slice(None)))
    return diagonal(
        np.hstack([problem.vectors, vectors]),
        problem.kind + ("attachment",) * len(values),
        np.concatenate([problem.values, values]),
        problem.rigid,
    )

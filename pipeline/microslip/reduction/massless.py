"""Massless-boundary reduction: MacNeal's method in physical interface coordinates without inertia.

R. H. MacNeal, Computers and Structures 1 (1971) 581; C. D. Monjaraz-Tec, J. Gross, M. Krack, Computers and Structures
260 (2022) 106698 (arXiv 2111.07693). With the kept eigenmodes X, the residual attachment modes W of the interface
rows B and their flexibility F = B W, the displacement is

    u = W F^-1 (u_b - B X eta) + X eta,

so B u = u_b. The inertia of the residual part is left out, which gives

    M_r = diag(0, 1),   K_r = [[F^-1, -F^-1 X_b], [-X_b^H F^-1, omega^2 + X_b^H F^-1 X_b]],   X_b = B X.

A contact that closes meets no mass, so an impact needs no law of its own, and energy is kept in time stepping.
"""

from __future__ import annotations

import numpy as np

from ..errors import UserError
from .problem import Reduced, Substructure, frequencies, hermitian, refuse_dependent


def reduce(problem: Substructure) -> Reduced:
    """Interface coordinates first (without mass), then the kept eigenmodes.

    Raises:
        UserError: no interfaces, or rows whose compliance the kept modes hold wholly.
    """
    chosen = problem.interface("massless-boundary")
    B, X = problem.rows[chosen], problem.vectors
    W = problem.residual(chosen)
    flexibility = hermitian(np.asarray(B @ W))
    try:
        refuse_dependent(flexibility, [problem.labels[i] for i in chosen])
    except UserError as error:
        raise UserError(
            f'reduction: "massless-boundary" finds no compliance left beside {len(problem.values)} modes; keep fewer '
            'modes (modes.count) or use "craig-bampton"'
        ) from error
    stiffness = hermitian(np.linalg.inv(flexibility))
    moved = np.asarray(B @ X)
    boundary = W @ stiffness
    b, m = len(chosen), X.shape[1]
    omega = frequencies(problem.values, problem.rigid)
    M_r = np.zeros((b + m, b + m), dtype=X.dtype)
    M_r[b:, b:] = np.eye(m)
    across = -stiffness @ moved
    K_r = np.block([[stiffness, across], [across.conj().T, np.diag(omega**2) - hermitian(moved.conj().T @ across)]])
    vectors = np.hstack([boundary, X - boundary @ moved])
    own = np.vstack([moved, np.eye(moved.shape[1])])  # nothing on the interface: its coordinates follow the modes
    return Reduced(vectors, ("massless-interface",) * b + problem.kind, M_r, K_r, omega, own)

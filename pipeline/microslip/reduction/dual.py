"""The dual Craig-Bampton method: free-interface modes, and interface forces as coordinates.

D. J. Rixen, Journal of Computational and Applied Mathematics 168 (2004) 383. With the kept eigenmodes X and the
residual attachment modes W of the interface rows B, u = W f + X eta; f are the forces on the interfaces. Then

    M_r = [[W^H M W, 0], [0, 1]],   K_r = [[-F, -X_b], [-X_b^H, omega^2]],   F = B W,   X_b = B X,
    M_r q'' + K_r q = [-u_b, 0] + T^H f_outer,   q = (f, eta),

where u_b is the displacement of the interfaces: the first rows are compatibility, not balance of forces. u_b = 0 is
the body held at its interfaces, f = 0 the free one. K_r has one negative eigenvalue for each interface force; they
belong to no motion and stay out of omega, which are the frequencies of the body with f = 0.
"""

from __future__ import annotations

import numpy as np

from .problem import Reduced, Substructure, frequencies, hermitian


def reduce(problem: Substructure) -> Reduced:
    """Interface forces first, then the kept eigenmodes.

    Raises:
        UserError: no interfaces.
    """
    chosen = problem.interface("dual-craig-bampton")
    B, X = problem.rows[chosen], problem.vectors
    W = problem.residual(chosen)
    moved = np.asarray(B @ X)
    b, m = len(chosen), X.shape[1]
    omega = frequencies(problem.values, problem.rigid)
    M_r = np.zeros((b + m, b + m), dtype=X.dtype)
    M_r[:b, :b] = hermitian(W.conj().T @ problem.pencil.M(W))
    M_r[b:, b:] = np.eye(m)
    K_r = np.block([[-hermitian(np.asarray(B @ W)), -moved], [-moved.conj().T, np.diag(omega**2)]])
    own = np.eye(b + m)[:, b:]
    return Reduced(np.hstack([W, X]), ("interface-force",) * b + problem.kind, M_r, K_r, omega, own)

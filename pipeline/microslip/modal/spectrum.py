"""The eigenproblem of a body model, its static compliance, and the rows that make its shapes definite."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..data import Array, Indices
from ..fem.cyclic import CyclicUpper
from ..fem.discretise import FreeUpper
from ..fem.tied import Tied
from ..linalg import eigen
from .body_rows import BodyRows
from .equilibrium import BodyModel


def make_pencil(model: BodyModel, K: Array, solver: eigen.DirectSolver) -> eigen.Pencil:
    """K x = lambda M x of a body on its free degrees of freedom; K: (p, 3, 3) over the pattern."""
    assert not isinstance(model.free, CyclicUpper)
    parts = pencil_parts(model.free, model.M, K)
    M = _mass_product(model) if isinstance(model.free, FreeUpper) else parts.M
    return eigen.Pencil(parts.shifted, parts.K, M, model.free.size, parts.k_norm, parts.m_norm, solver)


@dataclass(frozen=True)
class PencilParts:
    """K - s M as an upper triangle, products with K and M, and their infinity norms."""

    shifted: Callable[[float], sp.csr_matrix]
    K: Callable[[Array], Array]
    M: Callable[[Array], Array]
    k_norm: float
    m_norm: float


def pencil_parts(free: FreeUpper | Tied, M: Array, K: Array) -> PencilParts:
    """Of the mass (p,) and the stiffness (p, 3, 3) over a pattern, on the free degrees of freedom."""
    K_upper, M_upper = free.matrix(K), free.matrix(M[:, None, None] * np.eye(3))

    def shifted(s: float) -> sp.csr_matrix:
        if s == 0:
            return K_upper
        data = -s * M_upper.data
        data += K_upper.data
        return sp.csr_matrix((data, K_upper.indices, K_upper.indptr), shape=K_upper.shape)

    K_product, M_product = eigen.symmetric_product(K_upper), eigen.symmetric_product(M_upper)
    return PencilParts(shifted, K_product, M_product, _norm(K_upper), _norm(M_upper))


def _mass_product(model: BodyModel) -> Callable[[Array], Array]:
    """Products of the mass matrix on the free degrees of freedom with (n_free,) or (n_free, r) arrays."""
    assert isinstance(model.free, FreeUpper)
    free, n = model.free.free, model.d.mesh.n_points
    M: sp.csr_matrix = model.M_full
    nodes = np.unique(free // 3)
    if len(free) == 3 * len(nodes):  # whole points are held or free: no scattering needed
        M_nodes = M if len(nodes) == n else M[nodes][:, nodes]
        return lambda x: (M_nodes @ x.reshape(len(nodes), -1)).reshape(x.shape)

    def product(x: Array) -> Array:
        whole = np.zeros((3 * n, *x.shape[1:]))
        whole[free] = x
        return (M @ whole.reshape(n, -1)).reshape(whole.shape)[free]

    return product


def _norm(upper: sp.csr_matrix) -> float:
    """Infinity norm of the symmetric matrix with this upper triangle (its diagonal counted twice)."""
    size = np.abs(upper.data)
    columns = np.bincount(upper.indices, size, minlength=upper.shape[0])
    return float((np.add.reduceat(size, upper.indptr[:-1]) + columns).max())


def rigid_shift(model: BodyModel) -> float:
    """Negative shift for bodies with rigid modes: minus the square of a twentieth of wave speed over length."""
    square_of_speed = max(float(np.linalg.eigvalsh(m.elasticity).max()) / m.density for m in model.materials)
    length = np.ptp(model.d.mesh.points, axis=0).max()
    return -float(0.05**2 * square_of_speed / length**2)


def static_answers(pencil: eigen.Pencil, found: eigen.Spectrum, B: sp.csr_matrix, R: Array, shift: float) -> Array:
    """(n, r) displacement under a unit force on each row; inertia relief when rigid motions are free.

    The part in the modes found comes from their eigenvalues: solving for it would carry rounding into what they leave,
    1e-7 of the whole on a slender blade, many times that of a difference between two contacts.

    At a shift, with rigid motions, the part outside the modes found is solved by fixed-point iteration on the shifted
    factorisation, which contracts by |shift| / (lambda_next + |shift|) a step; a body so slender that this would
    hardly contract is factorised again, with a smaller shift.
    """
    F = np.asarray(B.conj().T.todense())
    if not F.shape[1]:
        return np.zeros((pencil.n, 0))
    X = found.vectors
    MX = pencil.M(X)
    elastic = found.values[R.shape[1] :]
    within = X[:, R.shape[1] :] @ (np.asarray(B @ X[:, R.shape[1] :]) / elastic).conj().T
    if not shift:
        beyond = pencil.solve(F)
        return within + beyond - X @ (MX.conj().T @ beyond)
    if -shift > 0.3 * found.upper_shift:
        shift = -0.1 * found.upper_shift
        pencil.solver.factorise(pencil.shifted(shift))
    rest = F - MX @ (X.conj().T @ F)
    u = np.zeros_like(rest)
    previous = np.inf
    for _ in range(60):
        step = pencil.solve(rest)
        step -= X @ (MX.conj().T @ step)
        u += step
        size = np.abs(step).max() / max(np.abs(u).max(), 1e-300)
        if size < 1e-13 or (size < 1e-8 and size > 0.3 * previous):  # no further gain above rounding
            break
        previous = size
        rest = -shift * pencil.M(step)  # what K leaves of the step: K s = rest + shift M s
        rest -= MX @ (X.conj().T @ rest)
    return within + u


def leading_rows(rows: BodyRows, phi: Array, place: Indices) -> Callable[[Array], Array]:
    """Rows that decide signs and the basis of pairs: the first interface's, else the strongest nodes' motion."""
    power = (np.abs(phi[place]) ** 2).sum(axis=1)  # over all modes; of ties the first in `place`
    chosen = place[np.argsort(-np.round(power / power.max(), 6), kind="stable")[:6]]
    if not rows.settings.interfaces:
        return lambda x: x[chosen]
    B = rows.patches[rows.settings.interfaces[0].name].B
    return lambda x: np.vstack([B @ x, x[chosen]])

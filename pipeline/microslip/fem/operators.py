"""Mass, stiffness, geometric stiffness and internal force as arrays over the sparsity pattern.

Every stiffness is the form  integral of dH : A : H  with H the displacement gradient and a tensor A:
A = C for the stress-free body, A = F C F^T + S (times identity) for the tangent at a deformed state.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..data import Array, Indices
from ..elasticity import PAIR, to_tensor
from ..elasticity import from_tensor as from_tensor
from ..interrupts import look
from .discretise import Block, Discretisation

_BATCH = 300_000  # node pairs assembled at a time: temporaries stay below the 32 MB that malloc hands back at once


def to_symmetric(voigt: Array) -> Array:
    """(..., 6) stress -> (..., 3, 3) tensor."""
    return voigt[..., PAIR]


def _batches(block: Block) -> Iterator[slice]:
    size = _BATCH // block.cells.shape[1] ** 2
    for start in range(0, len(block.cells), size):
        look()
        yield slice(start, start + size)


def _scatter(into: Array, positions: Indices, values: Array) -> None:
    """Add (e, k, k, c) values into (p + 1, c) at their positions (the last row collects the lower triangle)."""
    flat = positions.reshape(-1)
    count = len(flat)
    select = sp.csc_matrix(
        (np.ones(count), flat.astype(np.int32), np.arange(count + 1, dtype=np.int32)), shape=(len(into), count)
    )
    into += select @ values.reshape(count, -1)


def per_block(d: Discretisation, value: Any) -> list[Any]:
    """One value for each block: the given list, or the same for all."""
    return list(value) if isinstance(value, list | tuple) else [value] * len(d.blocks)


def mass(d: Discretisation, density: float | Sequence[float]) -> Array:
    """(p,) consistent mass over the pattern, kg; the full matrix is this times the 3 x 3 identity.

    M of Sextro Eq. (2.3-29), with the quadrature of the discretisation.

    Args:
        density: kg/m3, one or one per block.
    """
    out = np.zeros((d.pattern.size + 1, 1))
    for block, positions, rho in zip(d.blocks, d.positions, per_block(d, density), strict=True):
        products = np.einsum("qa,qb->qab", block.N, block.N).reshape(len(block.N), -1)
        _scatter(out, positions, rho * (block.dx @ products))
    return out[:-1, 0]


def stiffness(d: Discretisation, elasticity: Array | Sequence[Array], factor: list[Array] | None = None) -> Array:
    """(p, 3, 3) stiffness of the stress-free body, N/m: K_N of Sextro Eq. (2.3-17).

    Args:
        elasticity: (6, 6) Hooke matrix, Pa, one or one per block. factor: per block (e, q) factor on it
            (temperature), or None.
    """
    own = per_block(d, elasticity)
    alike: dict[bytes, list[int]] = {}
    for i, C in enumerate(own):
        alike.setdefault(np.asarray(C).tobytes(), []).append(i)
    K, *more = (_stiffness_of(d, chosen, own[chosen[0]], factor) for chosen in alike.values())
    for part in more:
        K += part
    return K


def _stiffness_of(d: Discretisation, chosen: list[int], elasticity: Array, factor: list[Array] | None) -> Array:
    """(p, 3, 3) stiffness of some blocks of one material."""
    out = np.zeros((d.pattern.size + 1, 9))
    for i in chosen:
        block, positions = d.blocks[i], d.positions[i]
        weight = block.dx if factor is None else block.dx * factor[i]
        k = block.cells.shape[1]
        for s in _batches(block):
            g = np.ascontiguousarray(block.grad[s].transpose(0, 3, 2, 1)).reshape(-1, 3 * k, block.dx.shape[1])
            H = np.matmul(g * weight[s][:, None, :], g.transpose(0, 2, 1))
            _scatter(out, positions[s], H.reshape(-1, k, 3, k, 3).transpose(0, 1, 3, 2, 4))
    # K_kl = C_kilj H_ij : one 9 x 9 matrix for all pairs
    weave = to_tensor(elasticity).transpose(1, 3, 0, 2).reshape(9, 9)
    return (out[:-1] @ weave).reshape(-1, 3, 3)


def tangent(d: Discretisation, A: list[Array]) -> Array:
    """(p, 3, 3) stiffness for a general tensor A_kIlJ at each quadrature point.

    Args:
        A: per block (e, q, 3, 3, 3, 3), Pa: derivative of the first Piola-Kirchhoff stress with respect to the
            displacement gradient.
    """
    out = np.zeros((d.pattern.size + 1, 9))
    for block, positions, a in zip(d.blocks, d.positions, A, strict=True):
        k, q = block.cells.shape[1], block.dx.shape[1]
        for s in _batches(block):
            g = block.grad[s] * block.dx[s][:, :, None, None]
            first = np.matmul(g.transpose(0, 1, 3, 2), a[s].transpose(0, 1, 3, 2, 4, 5).reshape(-1, q, 3, 27))
            left = first.reshape(-1, q, k, 9, 3).transpose(0, 2, 3, 1, 4).reshape(-1, 9 * k, 3 * q)
            right = block.grad[s].reshape(-1, 3 * q, k)
            K = np.matmul(left, right).reshape(-1, k, 9, k).transpose(0, 1, 3, 2)
            _scatter(out, positions[s], K)
    return out[:-1].reshape(-1, 3, 3)


def stress_stiffness(d: Discretisation, stress: list[Array]) -> Array:
    """(p,) geometric stiffness of a stress state, N/m; the full matrix is this times the 3 x 3 identity.

    K_sigma,ab = integral of grad N_a . S grad N_b (Bathe, Finite Element Procedures, 6.2.3); the book has no
    geometric stiffness, see docs/errata.md.

    Args:
        stress: per block (e, q, 6), Pa.
    """
    out = np.zeros((d.pattern.size + 1, 1))
    for block, positions, sigma in zip(d.blocks, d.positions, stress, strict=True):
        k, q = block.cells.shape[1], block.dx.shape[1]
        for s in _batches(block):
            S = to_symmetric(sigma[s]) * block.dx[s][:, :, None, None]
            left = np.matmul(S, block.grad[s]).reshape(-1, 3 * q, k)
            _scatter(out, positions[s], np.matmul(left.transpose(0, 2, 1), block.grad[s].reshape(-1, 3 * q, k)))
    return out[:-1, 0]


def spin_projector(axis: Array) -> Array:
    """(3, 3) P = 1 - n n^T, so that omega x (omega x r) = -Omega^2 P r. axis: unit vector."""
    return np.eye(3) - np.outer(axis, axis)


def displacement_gradient(block: Block, u: Array) -> Array:
    """(e, q, 3, 3) H_kI = du_k/dX_I for nodal displacements (n, 3) in m."""
    return np.matmul(u[block.cells].transpose(0, 2, 1)[:, None], block.grad.transpose(0, 1, 3, 2))


def green_strain(H: Array, nonlinear: bool = True) -> Array:
    """(..., 6) Green-Lagrange strain of a displacement gradient, engineering shear; linear strain if asked."""
    E = 0.5 * (H + np.swapaxes(H, -1, -2))
    if nonlinear:
        E = E + 0.5 * np.matmul(np.swapaxes(H, -1, -2), H)
    return engineering(E)


def engineering(E: Array) -> Array:
    """(..., 3, 3) symmetric strain tensor -> (..., 6) with engineering shear (Sextro Eq. (2.2-19))."""
    return np.stack(
        [E[..., 0, 0], E[..., 1, 1], E[..., 2, 2], 2 * E[..., 0, 1], 2 * E[..., 1, 2], 2 * E[..., 0, 2]], axis=-1
    )


def internal_force(d: Discretisation, stress: list[Array], H: list[Array] | None) -> Array:
    """(n, 3) nodal forces of a second Piola-Kirchhoff stress (per block (e, q, 6)), N.

    H: displacement gradients per block for F = 1 + H, or None for the undeformed geometry.
    """
    f = np.zeros((d.mesh.n_points, 3))
    for i, block in enumerate(d.blocks):
        P = to_symmetric(stress[i]) * block.dx[..., None, None]
        if H is not None:
            P = np.matmul(np.eye(3) + H[i], P)
        nodal = np.einsum("eqkI,eqIa->eak", P, block.grad, optimize=True)
        np.add.at(f, block.cells.reshape(-1), nodal.reshape(-1, 3))
    return f


def tangent_tensor(elasticity: Array, factor: Array | None, H: Array | None, stress: Array) -> Array:
    """(e, q, 3, 3, 3, 3) A_kIlJ = F_ki C_iIjJ F_lj + delta_kl S_IJ (St Venant-Kirchhoff; Bathe 6.2.3).

    Args:
        elasticity: (6, 6) Hooke matrix, or (e, q, 6, 6).
    """
    C = to_tensor(elasticity)
    shape = stress.shape[:-1]
    if H is None:
        A = np.broadcast_to(C, (*shape, 3, 3, 3, 3)).copy()
    else:
        F = np.eye(3) + H
        A = _between(F, C, F)
    return _stressed(A, factor, stress)


def _stressed(A: Array, factor: Array | None, stress: Array) -> Array:
    """A times the factor of its modulus, and the stress (e, q, 6) in the three directions."""
    if factor is not None:
        A *= factor[..., None, None, None, None]
    S = to_symmetric(stress)
    for k in range(3):
        A[..., k, :, k, :] += S
    return A


def _between(F: Array, C: Array, G: Array) -> Array:
    """(e, q, 3, 3, 3, 3) F_ki C_iIjJ G_lj; C one for all points or one a point."""
    return np.einsum(f"eqki,{'iIjJ' if C.ndim == 4 else 'eqiIjJ'},eqlj->eqkIlJ", F, C, G, optimize=True)


def tangent_tensor_slope(elasticity: Array, factor: Array | None, H: Array, dH: Array, stress_slope: Array) -> Array:
    """(e, q, 3, 3, 3, 3) derivative of `tangent_tensor` along dH: dF C F^T + F C dF^T + dS.

    Args:
        H, dH: (e, q, 3, 3) displacement gradient and its change. stress_slope: (e, q, 6) change of the stress.
    """
    C, F = to_tensor(elasticity), np.eye(3) + H
    half = _between(dH, C, F)
    return _stressed(half + np.transpose(half, (0, 1, 4, 5, 2, 3)), factor, stress_slope)

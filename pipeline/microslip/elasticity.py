"""Hooke matrices: isotropic, orthotropic, turned into other axes."""

from __future__ import annotations

import numpy as np

from .data import Array

VOIGT_AXES = np.array([0, 1, 2, 0, 1, 0]), np.array([0, 1, 2, 1, 2, 2])
PAIR = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Tensor index pair -> Voigt index (xx yy zz xy yz xz)."""


def isotropic(young: float, poisson: float) -> Array:
    """(6, 6) Hooke matrix, Pa, of Sextro Eq. (2.2-18)."""
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    mu = young / (2 * (1 + poisson))
    C = np.diag([2 * mu] * 3 + [mu] * 3)
    C[:3, :3] += lam
    return C


def orthotropic(young: Array, poisson: Array, shear: Array, axes: Array | None = None) -> Array:
    """(6, 6) Hooke matrix of an orthotropic material in body axes.

    Args:
        young: (3,) E1, E2, E3, Pa. poisson: (3,) nu12, nu23, nu13 (strain in the second under stress along the
            first). shear: (3,) G12, G23, G13, Pa. axes: (3, 3) rows = material axes in body axes.

    Raises:
        ValueError: constants that are not thermodynamically admissible (the matrix is not positive definite).
    """
    e1, e2, e3 = young
    n12, n23, n13 = poisson
    S = np.zeros((6, 6))
    S[:3, :3] = [[1 / e1, -n12 / e1, -n13 / e1], [-n12 / e1, 1 / e2, -n23 / e2], [-n13 / e1, -n23 / e2, 1 / e3]]
    S[3:, 3:] = np.diag(1 / np.asarray(shear, dtype=float))
    if np.linalg.eigvalsh(S).min() <= 0:
        raise ValueError("orthotropic constants are not positive definite")
    C = np.linalg.inv(S)
    return C if axes is None else turned(C, axes)


def turned(C: Array, axes: Array) -> Array:
    """(6, 6) Hooke matrix in body axes of one in material axes, the rows of `axes` (3, 3)."""
    R = np.asarray(axes, dtype=float)
    return from_tensor(np.einsum("pi,qj,rk,sl,pqrs->ijkl", R, R, R, R, to_tensor(C), optimize=True))


def strain_tensor(strain: Array) -> Array:
    """(..., 6) strain with engineering shear -> (..., 3, 3) tensor."""
    return (strain * np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5]))[..., PAIR]


def pushed(C: Array, F: Array) -> Array:
    """(..., 6, 6) Hooke matrix in the deformed body: c_ijkl = F_iA F_jB F_kC F_lD C_ABCD / det F.

    Args:
        F: (..., 3, 3) deformation gradient.
    """
    i, j = VOIGT_AXES
    # sigma = L S in Voigt components; L^T takes engineering strain back
    L = F[..., i[:, None], i[None]] * F[..., j[:, None], j[None]]
    L[..., 3:] += F[..., i[:, None], j[None, 3:]] * F[..., j[:, None], i[None, 3:]]
    return np.matmul(np.matmul(L, C), np.swapaxes(L, -1, -2)) / np.linalg.det(F)[..., None, None]


def turned_strain(along: Array, axes: Array | None) -> Array:
    """(6,) strain in body axes with engineering shear, of normal strains (3,) along the rows of `axes`."""
    R = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    strain = R.T @ np.diag(along) @ R
    return np.concatenate([np.diag(strain), 2 * strain[[0, 1, 0], [1, 2, 2]]])


def to_tensor(C: Array) -> Array:
    """(..., 6, 6) Hooke matrix -> (..., 3, 3, 3, 3) elasticity tensor."""
    return C[..., PAIR[:, :, None, None], PAIR[None, None]]


def from_tensor(C: Array) -> Array:
    """(3, 3, 3, 3) elasticity tensor -> (6, 6) Hooke matrix."""
    i, j = VOIGT_AXES
    return C[i[:, None], j[:, None], i[None], j[None]]

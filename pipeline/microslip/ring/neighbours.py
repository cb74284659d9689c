"""Contacts between neighbouring sectors: relative motion of two facing interfaces, and the ring with them stuck.

The right interface of sector j faces the left one of sector j + 1, which moves as R u exp(+i k 2 pi / N). So both
sides are rows on the one sector's coordinates (Sextro Eqs. (5.1-12), (5.1-13), there for real bodies one by one).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from ..data import Array, Interface, ModalBasis, ModalGroup
from ..errors import UserError
from .expansion import phase, sector_rotation


def frame_change(basis: ModalBasis, right: Interface, left: Interface) -> Array:
    """(6, 6) six rows in the left interface's frame, on the next sector, to the right interface's frame."""
    turn = right.rotation @ sector_rotation(basis, 1) @ left.rotation.T
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = turn
    return out


def relative_rows(basis: ModalBasis, group: ModalGroup, name: str) -> Array:
    """(6, m) motion of the facing interface of the next sector less that of interface `name`, in the latter's frame.

    u_n, u_t1, u_t2, phi_n, phi_t1, phi_t2; u_n < 0 presses the two together, because n points out of this sector.

    Args:
        name: an interface with ``sector_shift = 1`` and a partner.

    Raises:
        UserError: no such interface, or it does not face the next sector.
    """
    right = group.interfaces.get(name)
    if right is None:
        raise UserError(f"{basis.name}: has no interface '{name}'; it has {', '.join(group.interfaces) or 'none'}")
    left = group.interfaces.get(right.partner)
    if right.sector_shift != 1 or left is None:
        raise UserError(
            f"{basis.name}: interface '{name}' does not face the next sector; give it sector_shift = 1 and a partner"
        )
    return frame_change(basis, right, left) @ left.rows * phase(group, basis.sectors, 1) - right.rows


def stuck(basis: ModalBasis, group: ModalGroup, name: str, stiffness: Array | None = None) -> tuple[Array, Array]:
    """The sector's modes with neighbours that stick to each other, coupled through disc and contact.

    Args:
        stiffness: (6,) of springs on the six relative motions, N/m and N m/rad; None: no relative motion at all.

    Returns:
        omega (c,) rad/s and modal coordinates (m, c), normalised with M_r.

    Raises:
        UserError: a basis whose coordinates are interface forces.
    """
    if "interface-force" in group.kind:
        raise UserError(
            f"{basis.name}: springs between neighbours need displacements or modes as coordinates, but "
            f'"{basis.reduction}" keeps forces; use "rubin", "craig-bampton" or "massless-boundary"'
        )
    G = relative_rows(basis, group, name)
    if stiffness is None:
        size = np.maximum(np.abs(G).max(axis=1, keepdims=True), 1e-300)
        Z = scipy.linalg.null_space(G / size, rcond=1e-10)
        values, V = _generalised(Z.conj().T @ group.K_r @ Z, Z.conj().T @ group.M_r @ Z)
        return np.sqrt(np.maximum(values, 0.0)), Z @ V
    K = group.K_r + G.conj().T @ (np.asarray(stiffness)[:, None] * G)
    values, V = _generalised(0.5 * (K + K.conj().T), group.M_r)
    return np.sqrt(np.maximum(values, 0.0)), V


def closed_gap(basis: ModalBasis) -> str | None:
    """Name of the first interface that faces the next sector and whose statics the basis holds, so that `stuck` holds.

    Plain eigenmodes cannot follow a contact that sticks: of them none is returned.
    """
    group = basis.groups[min(basis.groups)]
    for name, face in group.interfaces.items():
        if basis.sectors > 1 and face.sector_shift == 1 and face.partner in group.interfaces:
            rows = [i for i, label in enumerate(group.compliance.labels) if label.startswith(f"interface:{name}:")]
            static, left = (np.abs(np.diag(C)[rows]) for C in (group.compliance.static, group.compliance.residual))
            if len(rows) and (left < 1e-3 * static).all():
                return name
    return None


def _generalised(K: Array, M: Array) -> tuple[Array, Array]:
    """Finite eigenpairs of K x = lambda M x with K positive, M perhaps singular (massless boundaries)."""
    inverse, X = scipy.linalg.eigh(M, K)
    finite = inverse > 1e-14 * inverse.max()
    values = 1 / inverse[finite][::-1]
    X = X[:, finite][:, ::-1] * np.sqrt(values)
    return values, X

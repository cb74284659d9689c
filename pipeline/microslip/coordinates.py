"""A reduced body in its own modes, whatever coordinates its file keeps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .data import Array, Interface, ModalBasis, ModalGroup, Rows


def in_modes(g: ModalGroup) -> ModalGroup:
    """The same body in modal coordinates: M_r = 1, K_r = diag(omega^2); itself where it stands so already."""
    V = g.to_diagonal
    if V is None:
        return g

    def face(i: Interface) -> Interface:
        shapes = i.shapes @ V
        return replace(i, rows=i.rows @ V, shapes=shapes, fit_residual=_fit_residual(i, shapes, i.rows @ V))

    def rows(named: Rows) -> Rows:
        return replace(named, rows=named.rows @ V)

    return replace(
        g,
        kind=("reduced",) * g.n_modes,
        M_r=np.eye(g.n_modes),
        K_r=np.diag(g.omega**2),
        C_r=V.conj().T @ g.C_r @ V,
        G_r=V.conj().T @ g.G_r @ V,
        phi=g.phi @ V,
        interfaces={k: face(i) for k, i in g.interfaces.items()},
        excitations={k: rows(r) for k, r in g.excitations.items()},
        monitors={k: rows(r) for k, r in g.monitors.items()},
        gauges={k: rows(r) for k, r in g.gauges.items()},
        stresses={k: replace(s, strain=s.strain @ V, stress=s.stress @ V) for k, s in g.stresses.items()},
        to_diagonal=None,
    )


def basis_in_modes(basis: ModalBasis) -> ModalBasis:
    """`in_modes` of every group."""
    return replace(basis, groups={key: in_modes(g) for key, g in basis.groups.items()})


def _fit_residual(i: Interface, shapes: Array, rows: Array) -> Array:
    """(m,) share of the patch's motion that no rigid motion explains; NaN-free zeros where shapes are not stored."""
    if not shapes.shape[0]:
        return np.zeros(rows.shape[1])
    t, w = i.rotation.T @ rows[:3], i.rotation.T @ rows[3:]
    fit = t[None] + np.cross(w.T[:, None, :], (i.points - i.origin)[None], axis=2).transpose(1, 2, 0)
    left = np.sqrt(np.einsum("p,pim->m", i.areas, np.abs(shapes - fit) ** 2))
    whole = np.sqrt(np.einsum("p,pim->m", i.areas, np.abs(shapes) ** 2))
    return np.divide(left, whole, out=np.zeros_like(left), where=whole > 0)

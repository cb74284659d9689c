"""Bounds of the static compliance of contact patches: uniform traction against a patch that keeps its shape.

The six rows of a patch load it with a uniform (and linear) traction and read its mean motion. Of all tractions with
the same resultant the one under a rigid patch stores the least energy, so the patch that is glued to a rigid stamp
is the stiffest and bounds the compliance from below; a uniform pressure bounds that of any pressure that is spread
no more unevenly. Between both lies what depends on how the pressure spreads over the patch: the local part, which
a law with many points in the patch follows and six rows do not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from microslip.data import INTERFACE_ROWS, Array, Indices, Mesh
from microslip.errors import UserError
from microslip.fem.discretise import Discretisation, discretise, free_upper
from microslip.linalg import eigen
from microslip.modal.body_rows import BodyRows, body_rows
from microslip.modal.boundary import fixed_dofs, materials_of
from microslip.modal.equilibrium import make_model
from microslip.modal.spectrum import make_pencil
from microslip.settings.body import BodySettings


@dataclass(frozen=True)
class PatchBounds:
    """Static compliance of the interfaces of a held body at rest, without prestress.

    Attributes:
        labels: r texts ``right u_n``, six an interface in the order of the settings. uniform, rigid: (r, r) in m/N,
            rad/(N m) and so on: linear traction on the patches, and patches that keep their shape.
    """

    labels: tuple[str, ...]
    uniform: Array
    rigid: Array

    def squeezed(self, a: str, b: str) -> tuple[float, float]:
        """Compliance (m/N), uniform and rigid, of equal forces that press on the contacts a and b from both sides."""
        p = np.array([float(label in (f"{a} u_n", f"{b} u_n")) for label in self.labels])
        return float(p @ self.uniform @ p), float(p @ self.rigid @ p)


def patch_bounds(mesh: Mesh, settings: BodySettings) -> PatchBounds:
    """Both bounds for all interfaces of a body, from two factorisations of the full model.

    Raises:
        UserError: no interface, two that share points, or one that touches a support (a stamp moves all its points).
    """
    if not settings.interfaces:
        raise UserError("interfaces: the body has none, so there is no patch to examine")
    nodes = [mesh.face_points(i.face) for i in settings.interfaces]
    every = np.concatenate(nodes)
    if len(np.unique(every)) < len(every):
        raise UserError("interfaces: two of them share points; patches that keep their shape must lie apart")
    d, rows, fixed = discretise(mesh), body_rows(mesh, settings), fixed_dofs(mesh, settings)
    if np.isin(fixed // 3, every).any():
        raise UserError("interfaces: one of them touches a support; a patch that keeps its shape must lie apart")
    free, pencil = _pencil(d, settings, fixed)
    B = sp.vstack([rows.patches[i.name].B for i in settings.interfaces]).tocsr()[:, free]
    uniform = np.asarray(B @ _static(pencil, B.T.toarray()))
    X = _stamps(mesh, settings, rows, nodes)[free]
    reaction = pencil.K(X)
    rest, inner = _pencil(d, settings, np.union1d(fixed, (3 * every[:, None] + np.arange(3)).ravel()))
    reaction_inside = reaction[np.searchsorted(free, rest)]
    stiffness = X.T @ reaction - reaction_inside.T @ _static(inner, reaction_inside)  # Schur complement onto the stamps
    labels = tuple(f"{i.name} {row}" for i in settings.interfaces for row in INTERFACE_ROWS)
    rigid = np.linalg.inv(0.5 * (stiffness + stiffness.T))
    return PatchBounds(labels, 0.5 * (uniform + uniform.T), 0.5 * (rigid + rigid.T))


def _static(pencil: eigen.Pencil, forces: Array) -> Array:
    try:
        pencil.solver.factorise(pencil.shifted(0.0))
        return pencil.solver.solve(forces)
    finally:
        pencil.solver.close()


def _pencil(d: Discretisation, settings: BodySettings, fixed: Indices) -> tuple[Indices, eigen.Pencil]:
    free = free_upper(d.pattern, fixed)
    rotation, nothing = settings.rotation, np.zeros((d.mesh.n_points, 3))
    model = make_model(
        d, materials_of(d, settings), free, fixed, np.array(rotation.axis), np.array(rotation.point), None,
        settings.temperature.reference, nothing, rotation.spin_softening,
    )  # fmt: skip
    return free.free, make_pencil(model, model.K0, eigen.new_solver(settings.modes.solver))


def _stamps(mesh: Mesh, settings: BodySettings, rows: BodyRows, nodes: list[Indices]) -> Array:
    """(3n, 6c) rigid motions of each patch's own points, unit translations and rotations in its frame."""
    X = np.zeros((mesh.n_points, 3, 6 * len(nodes)))
    for k, (item, at) in enumerate(zip(settings.interfaces, nodes, strict=True)):
        patch = rows.patches[item.name]
        r = mesh.points[at] - patch.origin
        for j, e in enumerate(patch.rotation):
            X[at, :, 6 * k + j] = e
            X[at, :, 6 * k + 3 + j] = np.cross(e, r)
    return X.reshape(3 * mesh.n_points, -1)

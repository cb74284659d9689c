"""Characteristic constraint modes: the softest ways in which a contact patch deforms, as interface coordinates.

M. P. Castanier, Y.-C. Tan, C. Pierre, AIAA Journal 39 (2001) 1182, patch by patch. All displacements of a patch's
nodes are condensed statically (Guyan); the eigenmodes of the condensed matrices that leave the six rigid coordinates
of the patch at zero are its characteristic shapes, softest first. Each becomes a row that reads its amplitude by the
area-weighted least-squares fit, so it is work-conjugate with a smooth traction, and mesh and node numbers drop out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from ..data import Array, Indices, Mesh
from ..errors import UserError
from ..fem.cyclic import CyclicUpper
from ..fem.discretise import FreeUpper
from ..fem.tied import Tied
from ..linalg import canonical, eigen
from ..reduction.craig_bampton import static_shapes
from ..settings.body import InterfaceSettings
from . import rigid
from .body_rows import BodyRows
from .prepared import Prepared
from .rows import Patch
from .spectrum import make_pencil, rigid_shift, static_answers

_MEMORY = 2e9  # bytes of static answers to all forces on one patch beyond which it is refused


def with_characteristic(b: Prepared) -> BodyRows:
    """The rows with the characteristic coordinates that the settings ask for, made at rest and kept at every speed.

    Raises:
        UserError: more shapes than the patch has, a patch of too many nodes.
    """
    model, chosen = b.model, [i for i in b.settings.interfaces if i.coordinates == "characteristic"]
    if not chosen:
        return b.rows
    assert not isinstance(model.free, CyclicUpper)
    pencil = make_pencil(model, model.K0, b.solver)
    R = model.free.unknowns_of(b.motions)
    R = rigid.mass_orthonormal(R, pencil.M) if R.shape[1] else R
    shift = rigid_shift(model) if R.shape[1] else 0.0
    few = eigen.search(pencil, R.shape[1] + 4, shift, rigid=R if R.shape[1] else None)  # factorises; a gap above R
    patches = dict(b.rows.patches)
    for item in chosen:
        mesh, p = model.d.mesh, patches[item.name]
        dofs = _patch_dofs(mesh, item, model.free)
        if item.count > len(dofs) - 6:
            raise UserError(
                f"interfaces.{item.name}.count: the patch has {len(dofs)} free displacements, six of which are its "
                f"rigid motion, so at most {max(len(dofs) - 6, 0)} shapes; lower it or refine the mesh there"
            )
        if 8.0 * len(dofs) * pencil.n > _MEMORY:
            raise UserError(
                f"interfaces.{item.name}.coordinates: the patch has {len(dofs)} displacements, too many to condense "
                '(2 GB of static answers); mesh the patch coarser or keep coordinates = "rigid"'
            )
        select = _selection(dofs, model.free.own)
        answers = static_answers(pencil, few, select, R, shift)
        shapes = _shapes(pencil, select, answers, R, p.B[:, dofs], item.count)
        patches[item.name] = _with_shapes(p, mesh, dofs, shapes)
    return replace(b.rows, patches=patches)


def _patch_dofs(mesh: Mesh, item: InterfaceSettings, free: FreeUpper | Tied) -> Indices:
    """Displacements of the patch that are unknowns.

    Raises:
        UserError: some follow others.
    """
    every = (3 * mesh.face_points(item.face)[:, None] + np.arange(3)).ravel()
    if isinstance(free, Tied) and len(np.setdiff1d(np.intersect1d(every, free.apart.free), free.own)):
        raise UserError(
            f"interfaces.{item.name}.coordinates: nodes of '{item.face}' follow others by ties of the mesh file, so "
            'the patch has no shapes of its own; use "rigid"'
        )
    return np.intersect1d(every, free.own)


def _selection(dofs: Indices, own: Indices) -> sp.csr_matrix:
    at = np.argsort(own, kind="stable")[np.searchsorted(np.sort(own), dofs)]
    return sp.csr_matrix((np.ones(len(at)), (np.arange(len(at)), at)), shape=(len(at), len(own)))


def _shapes(
    pencil: eigen.Pencil, select: sp.csr_matrix, answers: Array, R: Array, B: sp.csr_matrix, count: int
) -> Array:
    """(b, count) softest displacements of the patch's unknowns with its rigid coordinates B u = 0."""
    condensed, K, _ = static_shapes(R, select, answers, "characteristic coordinates")
    M = condensed.T @ pencil.M(condensed)
    N = scipy.linalg.null_space((B.toarray().T / sp.linalg.norm(B, axis=1)).T)
    _, V = scipy.linalg.eigh(N.T @ K @ N, N.T @ (0.5 * (M + M.T)) @ N, subset_by_index=(0, count - 1))
    return N @ V


def _with_shapes(p: Patch, mesh: Mesh, dofs: Indices, shapes: Array) -> Patch:
    """The patch with rows that fit the shapes, scaled to a root-mean-square displacement of 1."""
    whole = np.zeros((3 * mesh.n_points, shapes.shape[1]))
    whole[dofs] = shapes
    place = canonical.by_place(mesh.points)
    moved = p.moved(whole.reshape(mesh.n_points, 3, -1))
    area = p.areas.sum()
    size = np.sqrt(np.einsum("p,pic,pic->c", p.areas, moved, moved) / area) * canonical.signs(whole[place])
    moved, whole = moved / size, whole / size
    gram = np.einsum("p,pic,pid->cd", p.areas, moved, moved)
    weights = np.linalg.solve(gram, (moved * p.areas[:, None, None]).reshape(-1, moved.shape[2]).T)
    rows = [p.N.T @ w.reshape(-1, 3) for w in weights]
    B = sp.csr_matrix(np.array(rows).reshape(len(rows), -1))
    return replace(p, characteristic=B, pattern=moved)

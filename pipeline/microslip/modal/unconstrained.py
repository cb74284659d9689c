"""Parts of a body that nothing holds: refused before a solver takes rounding for stiffness."""

from __future__ import annotations

import numpy as np

from ..data import Array, Indices, Mesh
from ..errors import UserError
from ..fem.tied import Tied
from ..linalg import eigen
from ..mesh import part_numbers
from ..settings.body import BodySettings
from . import rigid
from .equilibrium import BodyModel
from .preload import not_resisted, touching_now

_NOTHING = 1e-9
"""Share of the energy of a part's unjoined degrees of freedom that a contact on a single facet still exceeds."""


def refuse_unlinked_parts(model: BodyModel, settings: BodySettings) -> None:
    """Refuse parts that neither supports nor contacts hold, all contacts closed, and free bodies of several parts.

    Raises:
        UserError: with the part and a motion it is left.
    """
    mesh = model.d.mesh
    part = part_numbers(mesh)
    if not part.max(initial=0) or settings.cyclic:
        return
    motions = _part_motions(model, part)
    if settings.free:
        whole = _part_motions(model, np.zeros_like(part))
        if motions.shape[1] == whole.shape[1]:
            return
        raise UserError(
            f"free: the mesh falls into {part.max() + 1} parts that share no points and are not tied wholly, so each "
            "floats by itself; join them or give each a body of its own"
        )
    if motions.shape[1]:
        closed = [touching_now(model, i, mesh.points) for i in range(len(model.contacts))]
        motions = not_resisted(motions, closed, every=True)
    if motions.shape[1]:
        raise UserError(
            f"supports: nothing holds {_told(mesh, part, motions[:, 0])}; support it, join it to the rest, or give it "
            "a closure (which holds along its normal only)"
        )


def refuse_unconstrained_parts(model: BodyModel, pencil: eigen.Pencil, rigid_motions: int) -> None:
    """Refuse parts that the stiffness about the static state does not hold, since their contacts do not count in it.

    Args:
        rigid_motions: number of those that the whole body is free to make.

    Raises:
        UserError: with the part and a motion it is left.
    """
    mesh = model.d.mesh
    part = part_numbers(mesh)
    if not part.max(initial=0):
        return
    motions = _part_motions(model, part)
    if motions.shape[1] <= rigid_motions:
        return
    X = model.free.unknowns_of(motions)
    energy, scale = X.T @ pencil.K(X), X.T @ (pencil.shifted(0.0).diagonal()[:, None] * X)
    root = np.linalg.inv(np.linalg.cholesky(scale))
    values, V = np.linalg.eigh(root @ (0.5 * (energy + energy.T)) @ root.T)
    if abs(values).min() > _NOTHING:
        return
    left = motions @ (root.T @ V[:, int(abs(values).argmin())])
    raise UserError(
        f"closures: nothing that counts in the modes holds {_told(mesh, part, left)}: a contact counts along its "
        'normal only, and with modes = "closed" only; write that in the closure, or support the part'
    )


def refuse_unresolved(pencil: eigen.Pencil, found: eigen.Spectrum, rigid_motions: int) -> None:
    """Refuse a lowest elastic eigenvalue that rounding alone can bring about.

    Raises:
        UserError: with the frequency and what rounding makes of zero.
    """
    least = np.finfo(float).eps * pencil.k_norm / pencil.m_norm
    if len(found.values) <= rigid_motions or found.values[rigid_motions] > least:
        return
    hz = np.sqrt(abs(np.array([found.values[rigid_motions], least]))) / 2 / np.pi
    raise UserError(
        f"mesh: the lowest mode, at {hz[0]:.2g} Hz, cannot be told from a motion without stiffness (rounding alone "
        f"makes up to {hz[1]:.2g} Hz): a part hangs on the rest by a point or an edge only, or cells are far too small "
        "for the size of the body; join the parts or mesh more coarsely"
    )


def _part_motions(model: BodyModel, part: Indices) -> Array:
    """(3n, r) motions of every part as a rigid one that supports and ties leave, one part after the other."""
    columns, points, fixed = [], model.d.mesh.points, model.fixed
    for number in range(part.max() + 1):
        own = np.flatnonzero(part == number)
        left = rigid.free_motions(points[own], points[own].mean(axis=0), _renumbered(fixed, own))
        whole = np.zeros((len(points), 3, left.shape[1]))
        whole[own] = left.reshape(len(own), 3, -1)
        columns.append(whole.reshape(3 * len(points), -1))
    motions = np.hstack(columns)
    motions = rigid.allowed(model.free, motions) if isinstance(model.free, Tied) else motions
    return rigid.unresisted(motions, model.springs, model.d.pattern)


def _renumbered(fixed: Indices, own: Indices) -> Indices:
    """Fixed degrees of freedom of some points (ascending), counted among these points alone."""
    mine = fixed[np.isin(fixed // 3, own)]
    return 3 * np.searchsorted(own, mine // 3) + mine % 3


def _told(mesh: Mesh, part: Indices, motion: Array) -> str:
    """The part that moves most in a motion (3n,), by its faces and its place, and how it moves."""
    number = int(np.bincount(np.repeat(part, 3), motion**2).argmax())
    own = np.flatnonzero(part == number)
    points = mesh.points[own]
    mine = np.isin(np.arange(mesh.n_points), own)
    faces = [f"'{name}'" for name in sorted(mesh.faces) if mine[mesh.face_points(name)].all()][:4]
    named = f" with face{'s' * (len(faces) > 1)} {', '.join(faces)}" if faces else ""
    at = ", ".join(f"{v:.4g}" for v in points.mean(axis=0))
    how = rigid.describe(points, points.mean(axis=0), motion.reshape(-1, 3)[own].reshape(-1, 1))[0]
    return f"the part{named} ({len(own)} points about ({at}) m) against {how}"

"""A free body that turns: its balance, its static state, and what the rotation does to its rigid motions.

In the frame that turns with the body nothing holds it, so the centrifugal load must have no resultant on a rigid
motion that is free: the centre of mass stands on the axis, and the axis is a principal one. A mesh misses that by a
little; what is left is carried by the inertia of the rigid motions (inertia relief). The static state is the one
without mean rigid motion, R^T M u = 0.

About it the elastic forces turn with the body: a rigid motion t + theta x r meets

    K R = theta x f - Omega^2 M P (t + theta x r),   f = Omega^2 M P r the centrifugal force, node by node.

Along and about the axis that is 0, of a translation across it -Omega^2 M t: with the Coriolis force a whirl at Omega, a
body at rest in space. A tilt has (J_n - J_t) Omega^2 over its moment of inertia, with the Coriolis force Euler's
equations, and shakes the elastic body a little: K R is no rigid motion. So the elastic modes are those of P^T K P
(`preload.without_rigid`), the rigid motions stand beside them as they are, and K_r holds what couples them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from ..data import Array
from ..errors import UserError
from ..fem.operators import internal_force, spin_projector
from ..linalg import eigen
from ..linalg.bordered import Bordered
from ..reduction import Reduced
from ..settings.body import BodySettings
from . import rigid
from .equilibrium import BodyModel, StaticState, Unknowns, centrifugal_force
from .preload import determinate, without_rigid

UNBALANCED = 1e-3
"""Share of the centrifugal load that a mesh may leave unbalanced: it is carried by inertia relief."""

PROJECTED = ("eigenmodes", "macneal", "rubin", "craig-bampton")
"""Reductions whose K_r is the stiffness on their shapes."""


@dataclass(frozen=True)
class Floating:
    """Rigid motions of a pencil about a state at speed.

    Attributes:
        R: (m, r) M-orthonormal. KR: (m, r) forces that they meet, N. values: (r,) of R^H K R, which is diagonal,
            ascending, (rad/s)^2.
    """

    R: Array
    KR: Array
    values: Array


def refuse_floating(settings: BodySettings, turning: bool) -> None:
    """Refuse what a free body cannot have at speed.

    Args:
        turning: whether the rotation speeds are other than 0.

    Raises:
        UserError: with the key.
    """
    r = settings.rotation
    if r.range_rpm is not None:
        raise UserError("rotation.range_rpm: a range is made of held bodies; give a free one its rotation.speeds_rpm")
    if not turning:
        return
    if r.prestress != "nonlinear" or not r.spin_softening:
        key, value = ("prestress", '"nonlinear"') if r.spin_softening else ("spin_softening", "true")
        raise UserError(
            f"rotation.{key}: must be {value} for a free body at speed: its rigid motions are in balance only with all "
            "of the stress that turns with it"
        )
    if settings.bolts:
        raise UserError("bolts: a free body under its bolts is taken at rest only; hold it or use speed 0")
    if settings.reduction not in PROJECTED:
        raise UserError(
            f'reduction: "{settings.reduction}" is not made for a free body at speed; use one of {", ".join(PROJECTED)}'
        )


def refuse_unbalanced(model: BodyModel, R: Array, centre: Array, inertia: Array) -> None:
    """Refuse a body whose centrifugal load drives a rigid motion that is free.

    Args:
        R: (3n, r) rigid motions that are free. centre: of mass. inertia: (3, 3) about it, kg m2.

    Raises:
        UserError: by how much it is off.
    """
    r, n = model.d.mesh.points - model.point, model.axis
    load = centrifugal_force(model, 1.0, np.zeros_like(r)).reshape(-1)
    size = float(np.sqrt(np.sum((r @ spin_projector(n)) * (model.M_full @ r))))  # M-norm of the load
    gram = R.T @ (model.M_full @ R.reshape(len(r), -1)).reshape(R.shape)
    push = R.T @ load
    if push @ np.linalg.solve(gram, push) <= (UNBALANCED * size) ** 2:
        return
    off = float(np.linalg.norm((centre - model.point) @ spin_projector(n)))
    nearest = float(np.abs(n @ np.linalg.eigh(inertia)[1]).max())
    tilt = float(np.degrees(np.arccos(min(nearest, 1.0))))
    raise UserError(
        f"rotation.axis: the free body is not balanced about it (its centre of mass {round(off, 9):.3g} m off the "
        f"axis, its nearest principal axis of inertia {round(tilt, 4):.3g} degrees off), so it would not turn "
        "steadily; correct rotation.point and axis, or hold the body"
    )


class Balanced(Bordered):
    """Solutions of K x + M R f = b with R^T M x = 0: what is out of balance is taken up by f.

    With r degrees of freedom E on springs S the matrix K + E S E^T can be factorised; they are taken out again beside
    the constraint, which is a dense problem of 2 r unknowns. Negative eigenvalues are counted where R^T M x = 0.
    """

    def __init__(self, inner: eigen.DirectSolver, R: Array, MR: Array) -> None:
        m, r = MR.shape
        self._at, U = determinate(R), np.hstack([np.zeros((m, r)), MR / np.linalg.norm(MR, axis=0)])
        super().__init__(inner, U, np.diag(np.repeat([1.0, 0.0], r)), r)

    def factorise(self, upper: sp.csr_matrix) -> None:
        held, first = upper.copy(), upper.indptr[self._at]  # where the diagonal of an upper triangle stands
        spring = np.abs(held.data[first])
        held.data[first] += spring
        r = len(self._at)
        self._U[self._at, np.arange(r)] = -np.sqrt(spring)
        super().factorise(held)


def balanced(model: BodyModel, coefficients: Array, solver: eigen.DirectSolver) -> eigen.DirectSolver:
    """A solver for the static state of a free body; as it is where no motion that the state could have is free.

    Args:
        coefficients: (6, r) rigid motions that are free, of a sector those that move all sectors alike.
    """
    if not coefficients.shape[1]:
        return solver
    fields = rigid.rigid_fields(model.d.mesh.points, model.point).reshape(-1, 6) @ coefficients
    M = eigen.symmetric_product(model.free.matrix(model.M[:, None, None] * np.eye(3)))
    R = rigid.mass_orthonormal(model.free.unknowns_of(fields), M)
    return Balanced(solver, R, M(R))


def floated(
    model: BodyModel, state: StaticState, pencil: eigen.Pencil, unknowns: Unknowns, coefficients: Array
) -> tuple[eigen.Pencil, Array, Floating | None]:
    """The pencil of the elastic modes, the rigid motions (m, r) beside them, and at speed what these meet.

    Args:
        coefficients: (6, r) of `rigid.rigid_fields` about the point of the axis.
    """
    if not coefficients.shape[1]:
        return pencil, np.zeros((pencil.n, 0), dtype=pencil.dtype), None
    if not state.speed:
        fields = rigid.rigid_fields(model.d.mesh.points + state.u, model.point).reshape(-1, 6) @ coefficients
        R = rigid.mass_orthonormal(unknowns.unknowns_of(fields), pencil.M)
        return without_rigid(pencil, R) if model.loaded else pencil, R, None
    found = _turning(model, state, pencil, unknowns, coefficients)
    return without_rigid(pencil, found.R), found.R, found


def _turning(
    model: BodyModel, state: StaticState, pencil: eigen.Pencil, unknowns: Unknowns, coefficients: Array
) -> Floating:
    """The rigid motions about the static state, those along and about the axis apart from the others."""
    x, n = model.d.mesh.points + state.u - model.point, model.axis
    P, f = spin_projector(n), internal_force(model.d, state.stress, state.H)
    along, across = _along(coefficients, n, float(np.ptp(x, axis=0).max()))
    R, others = (unknowns.unknowns_of(rigid.rigid_fields(x, np.zeros(3)).reshape(-1, 6) @ c) for c in (along, across))
    R = rigid.mass_orthonormal(R, pencil.M) if R.shape[1] else R
    MR = pencil.M(R)
    others = others - R @ (MR.conj().T @ others)
    t, theta = P @ across[:3], P @ across[3:]
    motion = t + np.moveaxis(np.cross(theta.T[:, None], x), 0, 2)
    turned = np.moveaxis(np.cross(theta.T[:, None], f), 0, 2)
    across_axis = np.einsum("ab,nbk->nak", P, motion).reshape(len(x), -1)
    spun = state.speed**2 * (model.M_full @ across_axis).reshape(motion.shape)
    met = unknowns.restrict((turned - spun).reshape(3 * len(x), -1))
    met = met - MR @ (R.conj().T @ met)  # what inertia relief leaves
    values, V = _diagonal(others, met, pencil)
    R = np.hstack([R, others @ V])
    KR = np.hstack([np.zeros((len(R), along.shape[1])), met @ V])
    values = np.concatenate([np.zeros(along.shape[1]), values])
    order = np.argsort(values, kind="stable")
    return Floating(R[:, order], KR[:, order], values[order])


def _along(coefficients: Array, axis: Array, size: float) -> tuple[Array, Array]:
    """The motions along and about the axis, exactly so, and (6, q) others that complete them."""
    P = spin_projector(axis)
    scaled = coefficients * np.array([1, 1, 1, size, size, size])[:, None]
    rows = np.vstack([P @ scaled[:3], P @ scaled[3:]])
    _, s, vt = np.linalg.svd(rows, full_matrices=True)
    rank = int((s > 1e-8 * np.linalg.norm(scaled)).sum())
    others, inner = coefficients @ vt[:rank].conj().T, coefficients @ vt[rank:].conj().T
    return np.vstack([np.outer(axis, axis @ inner[:3]), np.outer(axis, axis @ inner[3:])]), others


def _diagonal(R: Array, KR: Array, pencil: eigen.Pencil) -> tuple[Array, Array]:
    """(q,) values and (q, q) V that make motions R M-orthonormal and R^H K R diagonal."""
    gram, stiffness = R.conj().T @ pencil.M(R), R.conj().T @ KR
    return scipy.linalg.eigh(0.5 * (stiffness + stiffness.conj().T), 0.5 * (gram + gram.conj().T))


def with_rotation(reduced: Reduced, floating: Floating, pencil: eigen.Pencil) -> Reduced:
    """The reduced body with what its rigid motions meet at speed in K_r: with S = R^H M Phi, A = R^H K R

    Phi^H (K - P^H K P) Phi = S^H (K R)^H Phi + Phi^H K R S - S^H A S.
    """
    Phi, size = reduced.vectors, np.abs(floating.values).max(initial=0.0)
    S, C = pencil.M(floating.R).conj().T @ Phi, floating.KR.conj().T @ Phi
    if "rigid" in reduced.kind:  # mass-normalised shapes: what is rounding is known
        S, C = (np.where(np.abs(a) > 1e-11 * b, a, 0.0) for a, b in ((S, 1.0), (C, size)))
    more = S.conj().T @ C - 0.5 * S.conj().T @ (floating.values[:, None] * S)
    return replace(reduced, K_r=reduced.K_r + more + more.conj().T)

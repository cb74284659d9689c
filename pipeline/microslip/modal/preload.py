"""A free body that its own bolts press: its static state, and modes that know nothing of where it floats.

Bolts and contacts hold each other in balance, so no support is needed but for the rigid motions that the contacts
leave. Those are held at as many degrees of freedom as there are motions (statically determinate). They carry nothing
where the motions do not turn the forces (pressed on a plane), else a moment of the forces times the strain, by which
their choice turns the body. In the modes nothing is held. There the forces of bolts and contacts turn with the body:
dead ones would topple it, two forces N that press on each other over a distance h having the stiffness -N h in
rotation.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from ..data import Array, Indices
from ..errors import UserError
from ..fem.contact import Grip, cut_pair, grip
from ..fem.cyclic import CyclicUpper
from ..fem.tied import Tied, tied_upper
from ..linalg import eigen
from ..linalg.bordered import Bordered
from ..progress import Report
from ..settings.body import Modes
from . import rigid
from .equilibrium import BodyModel, StaticState, equilibrium


def pressed_state(
    model: BodyModel, motions: Array, centre: Array, prestress: str, modes: Modes, report: Report
) -> StaticState:
    """The static state of a free body at rest under its bolts and contacts.

    Args:
        motions: (3n, r) rigid motions that the supports leave. centre: of mass, for messages.

    Raises:
        UserError: the bolts' forces are not in balance. NotConverged: no state, or the contacts open.
    """
    x = model.d.mesh.points
    left = not_resisted(motions, [touching_now(model, i, x) for i in range(len(model.contacts))], every=True)
    _refuse_drift(model, left, centre)
    assert not isinstance(model.free, CyclicUpper)
    plain = np.zeros((len(left), 1))
    plain[model.free.own[model.free.own >= 0]] = 1.0
    fixed = np.union1d(model.free.fixed if isinstance(model.free, Tied) else model.fixed, determinate(plain * left))
    held = replace(model, free=tied_upper(model.d.pattern, fixed, model.d.mesh.ties))
    solver = eigen.new_solver(modes.solver, modes.ranks)
    try:
        return equilibrium(held, 0.0, prestress, solver, None, report)
    finally:
        solver.close()


def touching_now(model: BodyModel, number: int, x: Array) -> Grip:
    pair = model.contacts[number]
    return grip(pair, cut_pair(pair, x), x, np.zeros(len(pair.nodes)))


def not_resisted(motions: Array, grips: list[Grip], every: bool) -> Array:
    """(3n, q) motions (3n, r) that open or close no contact; every: at all of its points, else at closed nodes."""
    rows = [np.zeros((1, motions.shape[1]))]
    for g in grips:
        gaps = np.asarray((g.on_slave + g.on_master) @ motions)
        if not every:
            gaps = np.asarray(g.hats[g.touching] @ (g.point_weight[:, None] * gaps)) / g.area.max()
        rows.append(gaps)
    stacked = np.concatenate(rows)
    if np.abs(stacked).max(initial=0.0) < 1e-9 * np.abs(motions).max(initial=1.0):  # faces of one body on each other
        return motions
    return motions @ rigid.null_space(stacked)


def determinate(motions: Array) -> Indices:
    """r degrees of freedom that hold r rigid motions (3n, r): by pivoting, so that none hangs on another."""
    return np.sort(scipy.linalg.qr(motions.T, mode="r", pivoting=True)[1][: motions.shape[1]])


def _refuse_drift(model: BodyModel, motions: Array, centre: Array) -> None:
    """Refuse bolts that move or turn the body in a motion that no contact resists."""
    unit = motions / np.maximum(np.abs(motions).max(axis=0), 1e-300)
    push = np.abs(unit.T @ model.dead_load.reshape(-1))
    size = np.abs(model.dead_load).sum()
    if not (push > 1e-6 * size).any():
        return
    worst = rigid.describe(model.d.mesh.points, centre, motions[:, [int(push.argmax())]])[0]
    raise UserError(
        f"bolts: on the free body their forces are not in balance: {push.max():.4g} N act on a {worst}, which no "
        'contact resists; give them a closure to press on (against = "ground" for a plane of symmetry) or hold the body'
    )


def pressed_modes(
    model: BodyModel, state: StaticState, pencil: eigen.Pencil, centre: Array
) -> tuple[eigen.Pencil, Array]:
    """The pencil whose loads turn with the body, and (m, r) mass-orthonormal rigid motions about the static state.

    The potential depends on the displacement without its rigid part alone, P u with P = 1 - R R^T M (R mass-
    orthonormal: the frame in which the body has no mean motion, Sextro 2.1). Its second derivative in equilibrium is
    P^T K P, and P^T K P R = 0 exactly. Motions that a contact kept closed resists are not rigid.
    """
    assert not isinstance(model.free, CyclicUpper)
    motions = rigid.left_by(model.free, model.d.mesh.points + state.u, centre, model.fixed)
    kept = [g for g in state.contacts if g.pair.stays_closed]
    motions = not_resisted(motions, kept, every=False)
    R = model.free.unknowns_of(motions)
    if not R.shape[1]:
        return pencil, R
    R = rigid.mass_orthonormal(R, pencil.M)
    return without_rigid(pencil, R), R


def without_rigid(pencil: eigen.Pencil, R: Array) -> eigen.Pencil:
    """The pencil with P^T K P in place of K, P = 1 - R R^T M; R: (n, r) mass-orthonormal.

    P^T K P = K - Y Z^T - Z Y^T with Y = M R, Z = K R - Y (R^T K R) / 2; of complex numbers T conjugates.
    """
    Y, KR = pencil.M(R), pencil.K(R)
    A = R.conj().T @ KR
    Z = KR - 0.5 * Y @ (A + A.conj().T) / 2

    def stiffness(x: Array) -> Array:
        return pencil.K(x) - Y @ (Z.conj().T @ x) - Z @ (Y.conj().T @ x)

    return replace(pencil, K=stiffness, solver=corrected(pencil.solver, Y, Z))


def corrected(inner: eigen.DirectSolver, Y: Array, Z: Array) -> Bordered:
    """Solutions with A - Y Z^H - Z Y^H from a direct solver of A: with U = (Y, Z) and D = (0 1; 1 0) = D^-1 that is
    A - U D^-1 U^H, and D has as many negative eigenvalues as Y has columns."""
    size = np.linalg.norm(Y, axis=0), np.linalg.norm(Z, axis=0)  # Y s, Z / s: the same product, of one size
    scale = np.sqrt(np.maximum(size[1], 1e-12 * size[1].max(initial=0.0)) / size[0])
    scale = np.where(scale > 0, scale, 1.0)
    one = np.eye(Y.shape[1])
    return Bordered(inner, np.hstack([Y * scale, Z / scale]), np.block([[0 * one, one], [one, 0 * one]]), len(one))

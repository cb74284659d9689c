"""A reduced body in its own modes, whatever coordinates its file keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..data import (
    CENTRIFUGAL,
    Array,
    GyroscopicModes,
    Indices,
    Interface,
    Invariants,
    ModalBasis,
    ModalGroup,
    Rows,
    RunUp,
)
from ..errors import UserError


def in_modes(g: ModalGroup) -> ModalGroup:
    """The same body in modal coordinates: M_r = 1, K_r = `own_stiffness`; itself where it stands so already.

    Coordinates without mass and interface forces are left out: the compliance they hold is then missing in
    `Compliance.modal` and counts as residual.
    """
    V = g.to_diagonal
    if V is None:
        return g
    p = len(g.omega)
    return replace(
        in_coordinates(g, V),
        kind=own_kind(g),
        M_r=np.eye(p),
        K_r=own_stiffness(g.K_r, g.omega, V, g.speed),
        compliance=replace(g.compliance, modal=_modal(g)) if p < g.n_modes else g.compliance,
        gyroscopic=_gyroscopic(g.gyroscopic, V, g.M_r),
        to_diagonal=None,
    )


def own_shapes(g: ModalGroup) -> Array:
    """(c, m) the own modes in the coordinates of the group."""
    return np.eye(len(g.M_r)) if g.to_diagonal is None else g.to_diagonal


def of_modes(g: ModalGroup, numbers: Array) -> Array:
    """(c, c) sum over the own modes v_j of numbers_j (M v_j)(M v_j)^H."""
    P = g.M_r @ own_shapes(g)
    return (P * numbers) @ P.conj().T


def own_stiffness(K_r: Array, omega: Array, V: Array | None, speed: float) -> Array:
    """(p, p) V^H K_r V: diag(omega^2), and of a free body at speed (rad/s) what its rigid motions (omega = 0) meet."""
    A = np.diag(omega**2)
    rigid = (omega == 0) & (speed != 0)
    if not rigid.any():
        return A
    V = np.eye(len(omega)) if V is None else V
    rows = V[:, rigid].conj().T @ (0.5 * (K_r + K_r.conj().T)) @ V
    A = A.astype(rows.dtype)
    A[rigid], A[:, rigid] = rows, rows.conj().T
    return A


def in_coordinates(g: ModalGroup, V: Array) -> ModalGroup:
    """Matrices, shapes, rows and stresses in coordinates p with q = V p; V is (c, m). What is not congruent stays."""

    def face(i: Interface) -> Interface:
        shapes = i.shapes @ V
        more = i.characteristic @ V if len(i.characteristic) else np.zeros((0, V.shape[1]))
        fit = fit_residual(i, shapes, i.rows @ V)
        return replace(i, rows=i.rows @ V, shapes=shapes, fit_residual=fit, characteristic=more)

    def rows(named: Rows) -> Rows:
        return replace(named, rows=named.rows @ V)

    H = V.conj().T
    return replace(
        g,
        M_r=H @ g.M_r @ V,
        K_r=H @ g.K_r @ V,
        C_r=H @ g.C_r @ V,
        G_r=H @ g.G_r @ V,
        N_r=None if g.N_r is None else H @ g.N_r @ V,
        phi=g.phi @ V,
        interfaces={k: face(i) for k, i in g.interfaces.items()},
        excitations={k: rows(r) for k, r in g.excitations.items()},
        monitors={k: rows(r) for k, r in g.monitors.items()},
        gauges={k: rows(r) for k, r in g.gauges.items()},
        stresses={k: replace(s, strain=s.strain @ V, stress=s.stress @ V) for k, s in g.stresses.items()},
        run_up=_run_up(g.run_up, V),
        invariants=_invariants(g.invariants, V),
    )


def first_modes(g: ModalGroup, count: int) -> ModalGroup:
    """The same body in fewer of its normal modes; what the others held of the compliance counts as residual.

    Raises:
        UserError: more modes than there are; coordinates that are not normal modes, of which none can be left out.
    """
    if count > g.n_modes:
        raise UserError(f"{count} modes are asked for, but {g.n_modes} are stored; raise modes.count of the body")
    if g.to_diagonal is not None:
        raise UserError(
            "fewer modes can be taken of normal modes alone, and this reduction keeps others; lower modes.count of the "
            "body instead"
        )
    if count == g.n_modes:
        return g
    T, labels, kind = compliance_rows(g)[:, :count], g.compliance.labels, g.kind[:count]
    modal = held(T, labels, kind, g.K_r[:count, :count], g.omega[:count], None)
    return replace(
        in_coordinates(g, np.eye(g.n_modes)[:, :count]),
        omega=g.omega[:count],
        kind=kind,
        damping_ratio=g.damping_ratio[:count],
        compliance=replace(g.compliance, modal=modal),
        gyroscopic=None,
    )


def of_density(g: ModalGroup, share: float) -> ModalGroup:
    """The same body at rest, of a material `share` times as dense; shape, stiffness, damping ratios, coordinates stay.

    Inertia and centrifugal excitations grow with the density; integrals for large rigid motion are left out.

    Raises:
        UserError: the body rotates, so that its prestress would change too.
    """
    if g.speed:
        raise UserError("the body rotates, and its prestress would change with its mass; make it of another material")
    heavy = {name: replace(r, rows=share * r.rows) if r.unit == CENTRIFUGAL else r for name, r in g.excitations.items()}
    dense = replace(
        g, M_r=share * g.M_r, C_r=np.sqrt(share) * g.C_r, omega=g.omega / np.sqrt(share), excitations=heavy,
        run_up=None, invariants=None, gyroscopic=None,
    )  # fmt: skip
    return replace(dense, to_diagonal=own_shapes(g) / np.sqrt(share))


def own_kind(g: ModalGroup) -> tuple[str, ...]:
    """What each of the frequencies `omega` belongs to."""
    if g.to_diagonal is None:
        return g.kind
    elastic = "reduced" if len(g.omega) == g.n_modes else "normal"
    return tuple(elastic if w > 0 else "rigid" for w in g.omega)


def certified_modes(g: ModalGroup) -> int:
    """How many of the frequencies are those of the body itself, which its inertia count certifies,
    the first ones."""
    return (
        sum(kind in ("rigid", "normal") for kind in own_kind(g))
        if "reduced" not in own_kind(g)
        else 0
    )


def _modal(g: ModalGroup) -> Array:
    """Compliance in the modes alone: what the massless coordinates or the forces add to it is taken out again."""
    rows = compliance_rows(g)
    return g.compliance.modal - static_part(rows, g.compliance.labels, g.kind, g.K_r)


def compliance_rows(g: ModalGroup) -> Array:
    """(r, m) rows in the order of the compliance labels."""
    return np.array([compliance_row(g, label) for label in g.compliance.labels]).reshape(-1, g.n_modes)


def compliance_row(g: ModalGroup, label: str) -> Array:
    """(m,) the row that a label of the compliance names.

    Raises:
        ValueError, KeyError: the group has no such row.
    """
    kind, name, row = label.split(":", 2)
    if kind == "interface":
        return g.interfaces[name].row(row)
    rows = {"excitation": g.excitations, "monitor": g.monitors}[kind][name]
    return rows.rows[rows.labels.index(row)]


def _solved(A: Array, b: Array) -> Array:
    """A^-1 b; not a number where a file's A cannot be inverted."""
    try:
        return np.linalg.solve(A, b)
    except np.linalg.LinAlgError:
        return np.full_like(b, np.nan)


def held(T: Array, labels: Sequence[str], kind: Sequence[str], K_r: Array, omega: Array, V: Array | None) -> Array:
    """(r, r) static compliance that the coordinates hold over rows T (r, m); a free body's elastic part.

    The sum of (T V)_j (T V)_j^H / omega_j^2 over the elastic modes, and what coordinates without mass or interface
    forces add to it.

    Args:
        labels: of the rows. kind: of the coordinates. K_r: (m, m). omega: (p,). V: (m, p) their modes; None: 1.
    """
    elastic = omega > 0
    modes = (T if V is None else T @ V)[:, elastic]
    return (modes / omega[elastic] ** 2) @ modes.conj().T + static_part(T, labels, kind, K_r)


def static_part(T: Array, labels: Sequence[str], kind: Sequence[str], K_r: Array) -> Array:
    """(r, r) static compliance of the coordinates that carry no motion of their own."""
    held = np.zeros((len(T), len(T)), dtype=T.dtype)
    light = np.flatnonzero(np.array(kind) == "massless-interface")
    if len(light):
        held += T[:, light] @ _solved(K_r[np.ix_(light, light)], T[:, light].conj().T)
    force = np.flatnonzero(np.array(kind) == "interface-force")
    if len(force):  # a force on an interface is the coordinate itself
        rows = [i for i, label in enumerate(labels) if label.startswith("interface:")]
        held[:, rows] = T[:, force]
        held[rows, :] = T[:, force].conj().T
    return held


def _run_up(r: RunUp | None, V: Array) -> RunUp | None:
    if r is None:
        return None
    W = V.conj().T
    return RunUp(W @ r.N @ V, W @ r.P @ V, W @ r.euler, W @ r.centrifugal)


def _invariants(i: Invariants | None, V: Array) -> Invariants | None:
    W = V.conj().T
    return i and replace(
        i,
        shape=i.shape @ V,
        position_shape=i.position_shape @ V,
        shape_shape=W @ i.shape_shape @ V,
        stiffening=W @ i.stiffening @ V,
    )


def with_modes(v: Invariants, keep: Indices) -> Invariants:
    """The integrals of some of the modes."""
    return replace(
        v,
        shape=v.shape[:, keep],
        position_shape=v.position_shape[:, :, keep],
        shape_shape=v.shape_shape[:, :, keep][:, :, :, keep],
        stiffening=v.stiffening[:, keep][:, :, keep],
    )


def _gyroscopic(modes: GyroscopicModes | None, V: Array, M_r: Array) -> GyroscopicModes | None:
    """Shapes in the coordinates V^-1 q = V^H M_r q."""
    return modes and replace(modes, shapes=V.conj().T @ (M_r @ modes.shapes))


def basis_in_modes(basis: ModalBasis) -> ModalBasis:
    """`in_modes` of every group."""
    return replace(basis, groups={key: in_modes(g) for key, g in basis.groups.items()})


def fit_residual(i: Interface, shapes: Array, rows: Array) -> Array:
    """(m,) share of the patch's motion that no rigid motion explains; NaN-free zeros where shapes are not stored."""
    if not shapes.shape[0]:
        return np.zeros(rows.shape[1])
    t, w = i.rotation.T @ rows[:3], i.rotation.T @ rows[3:]
    fit = t[None] + np.cross(w.T[:, None, :], (i.points - i.origin)[None], axis=2).transpose(1, 2, 0)
    left = np.sqrt(np.einsum("p,pim->m", i.areas, np.abs(shapes - fit) ** 2))
    whole = np.sqrt(np.einsum("p,pim->m", i.areas, np.abs(shapes) ** 2))
    return np.divide(left, whole, out=np.zeros_like(left), where=whole > 0)

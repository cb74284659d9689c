"""The modal basis of a body that another program has assembled: the same modes, rows, reductions and certificate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.spatial import ConvexHull, QhullError

from .. import plausible
from ..data import Array, Flags, Indices, Matrices, Mesh, ModalBasis, ModalGroup, Residual
from ..errors import UserError
from ..frames import skew
from ..linalg import canonical, eigen
from ..linalg.parametric import state
from ..progress import Report
from ..reduction import Reduced
from ..settings.body import BodySettings
from ..units import from_rpm
from . import rigid
from .body_rows import BodyRows, body_rows
from .boundary import AXES, check_held, require_face
from .group import checks_of, modal_damping, of_solution, ratios_of
from .solution import Searched, Solution, answered, certified, reduced_on

NOT_RIGID = 1e-6
"""Force that a rigid motion may meet, over that of its parts, of a stiffness written with seven digits or more."""


def foreign_basis(
    body: Matrices, settings: BodySettings, report: Report = lambda _: None, provenance: Mapping[str, str] | None = None
) -> tuple[ModalBasis, list[str]]:
    """The modal basis of a body given by its matrices (Sextro section 2.4), and what a person should know of it.

    Raises:
        UserError: matrices that do not belong to the positions, missing sets, unheld bodies.
        NotConverged: the spectrum could not be certified.
    """
    body = state(body, values_of(settings))
    report(f"matrices of {body.count} rows, {body.mesh.n_points} nodes")
    layout = _layout(body)
    motions = _rigid_rows(body)
    messages = [*body.messages, *_refuse_other_positions(body, motions)]
    mass, centre, inertia, told = _inertia(body, motions)
    messages += told + _implausible(body.mesh, mass)
    free = _free(body, settings)
    unknowns = Layout(layout.column[free], layout.width)
    _refuse_missing_nodes(body, settings)
    rows, odd = _padded(body_rows(body.mesh, settings), body, layout)
    messages += odd
    solver = eigen.new_solver(settings.modes.solver, settings.modes.ranks)
    try:
        pencil = _pencil(body.stiffness[free][:, free], body.mass[free][:, free], solver)
        R = _free_motions(body, motions, free)
        _refuse_unheld(body, settings, layout, motions, centre, free, R)
        shift = _shift(body, R, free, pencil) if R.shape[1] else 0.0
        s = _search(settings, pencil, unknowns, R, shift, rows, report)
        place = np.concatenate([canonical.by_place(body.mesh.points), np.arange(3 * body.mesh.n_points, layout.width)])
        solved = reduced_on(place, layout.width // 3, settings, s, rows)
    finally:
        solver.close()
    group = _group(body, settings, solved, rows, layout, free)
    damping = "matrix" if body.damping is not None else settings.damping.source
    axis = np.array(settings.rotation.axis)
    basis = ModalBasis(
        settings.name, body.mesh, {(0, 0): group}, mass, centre, inertia, axis / np.linalg.norm(axis),
        np.array(settings.rotation.point), damping, bool(R.shape[1]), settings.reduction, dict(provenance or {}),
        source="matrices",
    )  # fmt: skip
    return basis, messages


def _refuse_unheld(
    body: Matrices, settings: BodySettings, layout: Layout, motions: Array, centre: Array, free: Indices, R: Array
) -> None:
    """Raise `UserError` of rigid motions R (f, r) over the free rows that the settings do not ask for."""
    spread = np.zeros((3 * body.mesh.n_points, R.shape[1]))
    at = free[_moves(body)[free]]
    spread[layout.column[at]] = R[np.isin(free, at)]
    if (body.component >= 3).any():
        middle, known = body.mesh.points.mean(axis=0), np.linalg.lstsq(motions[free], R, rcond=None)[0]
        check_held(body.mesh, settings, middle, spread, known)
    else:
        check_held(body.mesh, settings, centre, spread)
    if settings.free and any(settings.rotation.speeds_rpm):
        raise UserError("rotation.speeds_rpm: matrices tell no balance of a free body at speed; use speed 0")


def values_of(settings: BodySettings) -> dict[str, float]:
    """The state of a body given by its matrices: speed of rotation (rad/s) and the values of its other parameters."""
    return {"speed": from_rpm(settings.rotation.speeds_rpm[0]), **settings.values}


# what the rows mean ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Layout:
    """Rows of foreign matrices: displacements of the nodes first, three each, then every other row, filled up to a
    multiple of three.

    Attributes:
        column: (m,) place of each row. width: of the whole.
    """

    column: Indices
    width: int

    def expand(self, unknowns: Array, n: int) -> Array:
        """(3n, r) displacements, and whatever else there is behind them."""
        whole = np.zeros((self.width, *unknowns.shape[1:]), dtype=unknowns.dtype)
        whole[self.column] = unknowns
        return whole

    def rows(self, B: sp.csr_matrix) -> sp.csr_matrix:
        """(r, m) rows on the unknowns."""
        return _wide(B, self.width)[:, self.column]


def _layout(body: Matrices) -> Layout:
    n, moves = body.mesh.n_points, _moves(body)
    others = np.cumsum(~moves) - 1
    width = 3 * (n + -(-int((~moves).sum()) // 3))
    return Layout(np.where(moves, 3 * body.node + body.component, 3 * n + others), width)


def _moves(body: Matrices) -> Flags:
    """(m,) which rows are displacements of nodes."""
    return (body.component >= 0) & (body.component < 3)


def _wide(B: sp.csr_matrix, width: int) -> sp.csr_matrix:
    B = sp.csr_matrix(B)
    return sp.csr_matrix((B.data, B.indices, B.indptr), shape=(B.shape[0], width))


def _padded(rows: BodyRows, body: Matrices, layout: Layout) -> tuple[BodyRows, list[str]]:
    """Rows over the whole layout, and what is odd about them; an interface on a single node has that node's own."""

    def named(group):  # noqa: ANN001
        return {k: replace(v, B=_wide(v.B, layout.width)) for k, v in group.items()}

    width, told = layout.width, []
    patches = {k: replace(p, B=_wide(p.B, width), N=_wide(p.N, width // 3)) for k, p in rows.patches.items()}
    for item in rows.settings.interfaces:
        nodes = body.mesh.face_points(item.face)
        if len(nodes) == 1:
            B, missing = _six(body, layout, int(nodes[0]), patches[item.name].rotation)
            patches[item.name] = replace(patches[item.name], B=B)
            if missing:
                told.append(
                    f"interface '{item.name}': node {body.mesh.node_id[nodes[0]]} has no {' '.join(missing)} in the "
                    "matrices, so it stands still there: a contact on it meets no such motion"
                )
    return BodyRows(rows.settings, patches, named(rows.excitations), named(rows.monitors), {}), told


def _six(body: Matrices, layout: Layout, node: int, rotation: Array) -> tuple[sp.csr_matrix, list[str]]:
    """(6, width) displacements and rotations of one node in the interface's frame, zero where the matrices have none,
    and which these are along the body's axes."""
    B, missing = np.zeros((6, layout.width)), []
    for c, word in enumerate(("u_x", "u_y", "u_z", "phi_x", "phi_y", "phi_z")):
        row = np.flatnonzero((body.node == node) & (body.component == c))
        if len(row):
            B[3 * (c // 3) : 3 * (c // 3) + 3, layout.column[row[0]]] = rotation[:, c % 3]
        else:
            missing.append(word)
    return sp.csr_matrix(B), missing


def _refuse_missing_nodes(body: Matrices, settings: BodySettings) -> None:
    """An interface needs every one of its nodes in the matrices: what a superelement has condensed is lost."""
    moves = np.unique(body.node[_moves(body)])
    for item in settings.interfaces:
        require_face(body.mesh, item.face, f"interfaces.{item.name}.face", points_suffice=True)
        missing = np.setdiff1d(body.mesh.face_points(item.face), moves)
        if len(missing):
            raise UserError(
                f"interfaces.{item.name}.face: {len(missing)} nodes of '{item.face}' (first: node "
                f"{body.mesh.node_id[missing[0]]}) have no rows in the matrices, so this interface is not the one that "
                "they keep; name nodes that they keep, or condense again"
            )
    numbered = [("excitations", e.name, e.node) for e in settings.excitations]
    for kind, name, node in [*numbered, *(("monitors", m.name, m.node) for m in settings.monitors)]:
        if node is not None and node not in body.mesh.node_id[moves]:
            raise UserError(f"{kind}.{name}.node: node {node} has no rows in the matrices; choose one that they keep")


# rigid motions and mass --------------------------------------------------------------------------------------------


def _rigid_rows(body: Matrices) -> Array:
    """(m, 6) every row under translations along x, y, z and rotations about the middle of the nodes."""
    points = body.mesh.points
    if not len(points):
        return np.zeros((body.count, 6))
    fields = rigid.rigid_fields(points, points.mean(axis=0))
    R = np.zeros((body.count, 6))
    moves = _moves(body)
    R[moves] = fields[body.node[moves], body.component[moves]]
    turns = body.component >= 3
    R[turns, body.component[turns]] = 1.0
    return R


def _refuse_other_positions(body: Matrices, R: Array) -> list[str]:
    """A free body lets itself be moved rigidly without force: a stiffness that does not was given other positions.

    Raises:
        UserError: with the row that resists most.
    """
    if body.grounded:
        return []
    size = abs(body.stiffness)
    ratio = np.zeros(body.count)
    for r in R.T:
        whole = size @ np.abs(r)
        force = np.abs(body.stiffness @ r)
        ratio = np.maximum(ratio, np.divide(force, whole.max(), out=np.zeros_like(force), where=whole.max() > 0))
    worst = int(ratio.argmax())
    if ratio[worst] <= NOT_RIGID:
        return []
    where = f"node {body.mesh.node_id[body.node[worst]]}" if body.node[worst] >= 0 else "a generalised coordinate"
    raise UserError(
        f"geometry.matrices: the stiffness resists rigid motions (worst in row {worst + 1}, {where}, by "
        f"{ratio[worst]:.2g} of the largest force), so its rows are in another order, the positions are of another "
        "body, or supports are in it already; correct geometry.matrices.dofs and nodes, or write grounded = true"
    )


def _inertia(body: Matrices, R: Array) -> tuple[float, Array, Array, list[str]]:
    """Mass, centre, inertia about the centre as the mass matrix has them, and what is odd about it."""
    if not body.mesh.n_points:  # nothing is known of how its rows move
        return 0.0, np.zeros(3), np.zeros((3, 3)), []
    gram = R.T @ (body.mass @ R)
    each = np.diag(gram)[:3]
    m = float(each[each > 0].mean()) if (each > 0).any() else 0.0  # of the directions that the matrices have
    if not m > 0:
        raise UserError("geometry.matrices.mass: a translation moves no mass; is it the mass matrix?")
    told = []
    if np.ptp(each) > 1e-6 * m and not body.grounded:
        told.append(
            f"the mass is {each[0]:.6g}, {each[1]:.6g}, {each[2]:.6g} kg along x, y, z; a body's own mass is the same "
            "in every direction"
        )
    coupling = gram[:3, 3:] / m  # column i: e_i x d
    d = 0.5 * np.array(
        [coupling[1, 2] - coupling[2, 1], coupling[2, 0] - coupling[0, 2], coupling[0, 1] - coupling[1, 0]]
    )
    J = gram[3:, 3:] + m * skew(d) @ skew(d)
    return m, body.mesh.points.mean(axis=0) + d, 0.5 * (J + J.T), told


def _implausible(mesh: Mesh, mass: float) -> list[str]:
    """Warnings of a mean density that no solid has: a mistake of units."""
    if not mass:
        return []
    try:
        volume = ConvexHull(mesh.points).volume
    except (QhullError, ValueError):  # nodes on a plane or a line
        return []
    told = plausible.density(f"{mass:.4g} kg within {volume:.4g} m3: density", mass / volume, SPARSE)
    return [f"{told}; check length_unit and geometry.matrices.units"] if told else []


SPARSE = 1.0
"""kg/m3 within the convex hull of a frame of beams, at least."""


def _free(body: Matrices, settings: BodySettings) -> Indices:
    """Rows that neither a support holds nor nothing is attached to."""
    held = np.zeros(body.count, dtype=bool)
    for support in settings.supports:
        require_face(body.mesh, support.face, f"supports.{support.face}.face", points_suffice=True)
        on = np.isin(body.node, body.mesh.face_points(support.face)) & (body.node >= 0)
        ways = [AXES[c] for c in support.directions] + support.turns
        chosen = on & np.isin(body.component, ways)
        if not chosen.any():
            raise UserError(
                f"supports.{support.face}.face: no row of the matrices moves a node of '{support.face}' along "
                f"{support.directions}; the support is in them already, or the nodes were condensed: remove it"
            )
        held |= chosen
    weight = np.asarray(abs(body.stiffness).sum(axis=1)).ravel() + np.asarray(abs(body.mass).sum(axis=1)).ravel()
    return np.flatnonzero(~held & (weight > 0))


def _free_motions(body: Matrices, R: Array, free: Indices) -> Array:
    """(f, r) rigid motions of the free rows that move no held row and meet no force."""
    held = np.setdiff1d(np.arange(body.count), free)
    R = R / np.maximum(np.abs(R).max(axis=0), 1e-300)
    parts = [R[held]]
    if body.grounded:
        K = body.stiffness[free][:, free]
        parts.append((K @ R[free]) / max(float(abs(K).sum(axis=1).max()), 1e-300) * 1e4)
    s, vt = np.linalg.svd(np.vstack([*parts, np.zeros((6, 6))]), full_matrices=True)[1:]
    vt = vt[int((s > 1e-8 * max(s.max(), 1.0)).sum()) :]
    motions = R[free] @ vt.T
    Q, T, _ = scipy.linalg.qr(motions, mode="economic", pivoting=True)  # a single line of nodes has fewer than six
    return Q[:, : int((np.abs(np.diag(T)) > 1e-9 * max(abs(T[0, 0]), 1e-300)).sum())] if motions.shape[1] else motions


# the eigenproblem ---------------------------------------------------------------------------------------------------


def _pencil(K: sp.csr_matrix, M: sp.csr_matrix, solver: eigen.DirectSolver) -> eigen.Pencil:
    """K x = lambda M x with one pattern for every shift."""
    pattern = sp.triu(abs(K) + abs(M) + sp.identity(K.shape[0]), format="csr")
    pattern.sort_indices()
    k, m = (_on(sp.triu(A, format="csr"), pattern) for A in (K, M))

    def shifted(s: float) -> sp.csr_matrix:
        return sp.csr_matrix((k - s * m, pattern.indices, pattern.indptr), shape=pattern.shape)

    k_norm, m_norm = (float(abs(A).sum(axis=1).max()) for A in (K, M))
    return eigen.Pencil(shifted, lambda x: K @ x, lambda x: M @ x, K.shape[0], k_norm, m_norm, solver)


def _on(A: sp.csr_matrix, pattern: sp.csr_matrix) -> Array:
    """Entries of a matrix at the places of a larger pattern."""
    n = pattern.shape[0]
    places = np.repeat(np.arange(n, dtype=np.int64), np.diff(pattern.indptr)) * n + pattern.indices
    entries = A.tocoo()
    out = np.zeros(pattern.nnz)
    out[np.searchsorted(places, entries.row.astype(np.int64) * n + entries.col)] = entries.data
    return out


def _shift(body: Matrices, R: Array, free: Indices, pencil: eigen.Pencil) -> float:
    """Negative shift for a free body with rigid motions R: a tenth of its lowest elastic Rayleigh quotient.

    Of quadratic displacements, which of one or two nodes are rigid ones: then of its first rotations and generalised
    coordinates, one by one. At least ten times what the digits of K leave of the stiffness of R.
    """
    R = rigid.mass_orthonormal(R, pencil.M)
    least = 10 * float(np.linalg.norm(R.T @ pencil.K(R), 2))
    others = np.flatnonzero(~_moves(body))[:_SINGLE]
    for shapes in (_quadratic(body), np.eye(body.count)[:, others] if len(others) else np.zeros((body.count, 0))):
        elastic = _quotients(pencil, shapes[free], R)
        if len(elastic):
            return -max(0.1 * float(elastic[0]), least)
    return -max(1e-6 * pencil.k_norm / pencil.m_norm, least)


_SINGLE = 60
"""Of so many rows the lowest quotient is a guess that is good enough."""


def _quadratic(body: Matrices) -> Array:
    """(m, 18) displacements of the rows that are products of two coordinates."""
    x = body.mesh.points - body.mesh.points.mean(axis=0)
    x = x / max(float(np.abs(x).max()), 1e-30)
    F = np.zeros((body.count, 6, 3))
    moves = np.flatnonzero(_moves(body))
    for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))):
        F[moves, k, body.component[moves]] = (x[:, i] * x[:, j])[body.node[moves]]
    return F.reshape(body.count, 18)


def _quotients(pencil: eigen.Pencil, F: Array, R: Array) -> Array:
    """Elastic Rayleigh-Ritz values of shapes F (f, c) beside M-orthonormal rigid motions R, ascending; perhaps none."""
    size = np.sqrt(np.maximum(np.einsum("ij,ij->j", F, pencil.M(F)), 0.0))
    F = F[:, size > 0] / size[size > 0]
    F = F - R @ (R.T @ pencil.M(F))
    gram = F.T @ pencil.M(F)
    w, Q = np.linalg.eigh(0.5 * (gram + gram.T))
    Q = Q[:, w > 1e-10] / np.sqrt(w[w > 1e-10])
    ritz = np.linalg.eigvalsh(Q.T @ (F.T @ pencil.K(F)) @ Q)
    return ritz[ritz > 1e-7 * ritz[-1]] if len(ritz) else ritz


def _search(
    settings: BodySettings, pencil: eigen.Pencil, unknowns: Layout, R: Array, shift: float, rows: BodyRows,
    report: Report,
) -> Searched:  # fmt: skip
    report(f"eigenmodes: {pencil.n} free rows, solver {pencil.solver.name}")
    pencil.tell = report
    if not pencil.n:
        raise UserError("supports: every row of the matrices is held; remove one")
    R = rigid.mass_orthonormal(R, pencil.M) if R.shape[1] else R
    try:
        found = eigen.search(pencil, min(settings.modes.count, pencil.n), shift, rigid=R if R.shape[1] else None)
    except eigen.Unstable as error:
        raise UserError(
            f"geometry.matrices: the stiffness has {error.count} negative directions; is it K, of a stable state?"
        ) from error
    s = answered(pencil, unknowns, R, shift, found, rows, bool(R.shape[1]))
    if not settings.modes.certify:
        return s
    report("certifying the spectrum by the inertia count")
    return certified([s])[0]


def _group(
    body: Matrices, settings: BodySettings, s: Solution, rows: BodyRows, layout: Layout, free: Indices
) -> ModalGroup:
    reduced, n = s.reduced, body.mesh.n_points
    whole, speed = s.unknowns.expand(reduced.vectors, n), from_rpm(settings.rotation.speeds_rpm[0])
    C, ratios = _damping(body, settings, reduced, free)
    G, N = np.zeros_like(C), None
    if body.gyroscopic is not None:
        G = reduced.vectors.T @ (body.gyroscopic[free][:, free] @ reduced.vectors)
        G = 0.5 * (G - G.T)
    if body.circulatory is not None:
        N = reduced.vectors.T @ (body.circulatory[free][:, free] @ reduced.vectors)
    return ModalGroup(
        **of_solution(rows, s, whole, n), speed=speed, damping_ratio=ratios, C_r=C, G_r=G, N_r=N, gauges={},
        stresses={}, u_static=np.zeros((n, 3)), checks={**checks_of(s), **s.indicators},
        prestress="none" if not speed else "foreign", residual=_residual(settings, s, layout.width // 3, n),
    )  # fmt: skip


def _residual(settings: BodySettings, s: Solution, rows: int, n: int) -> Residual | None:
    """Residual shapes at the n points (of `rows` triples of rows); foreign matrices know neither strain nor gauges."""
    if s.reduced.residual is None:
        return None
    shapes = s.unknowns.expand(s.reduced.residual, n).reshape(rows, 3, s.reduced.residual.shape[1])
    return Residual(s.force_labels, shapes[: n if settings.output.shapes else 0], {}, {}, {})


def _damping(body: Matrices, settings: BodySettings, reduced: Reduced, free: Indices) -> tuple[Array, Array]:
    """C_r and the ratios: of the foreign matrix if there is one, whatever it couples, else as the settings say."""
    if body.damping is None:
        ratios = settings.damping.ratios(reduced.omega)
        return modal_damping(reduced, 2 * ratios * reduced.omega), ratios
    d = settings.damping
    if d.ratio is not None or d.table is not None or d.alpha is not None or d.beta is not None:
        raise UserError("damping: geometry.matrices.damping brings the damping already; remove one of the two")
    C = reduced.vectors.T @ (body.damping[free][:, free] @ reduced.vectors)
    C = 0.5 * (C + C.T)
    return C, ratios_of(C, reduced)

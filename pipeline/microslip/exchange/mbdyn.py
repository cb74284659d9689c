"""MBDyn: the .fem file of its modal joint, record groups 1 to 10 and 12 to 18 of the published layout.

Nodes are the attachment points (interfaces by their rigid fit, monitors), six components each in body axes; the body
frame has the axes of the mesh and its origin at the reference point of the inertia integrals. Groups 12 (mass, centre,
inertia about it) and 14 to 18 (invariants 3, 4, 8, 5, 9) hold the integrals of the finite elements, so no lumped masses
(group 11) are needed: with S_j the integral of rho phi_j, invariant 3 is S_j, 4 that of rho r x phi_j, 8 that of
-rho r~ phi~_j, 5 that of rho phi_i x phi_j, 9 that of rho phi~_i phi~_j. The inertia about the origin of the body frame
is then J(q) = J_0 + sum (Inv8_j + Inv8_j^T) q_j - sum Inv9_ij q_i q_j, exactly. Invariants 8 and 9 are printed row by
row, in each row mode after mode (of 9: for each first mode all second ones) with three columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..data import Array, Invariants, ModalBasis, ModalGroup
from .choice import STATEMENT, Format, one_line
from .multibody import Attachment, position_cross_shape, shape_cross_shape, tilde_tilde, write_flexible


def write_mbdyn(basis: ModalBasis, path: Path | str) -> None:
    """Write one group at rest, complete or absent, see `multibody.write_flexible`."""
    write_flexible(basis, path, "mbdyn", _lines)


def _lines(basis: ModalBasis, g: ModalGroup, nodes: Sequence[Attachment]) -> list[str]:
    v = g.invariants
    assert v is not None
    where = np.array([a.position for a in nodes])
    lines = _head(basis, g, nodes)
    lines += ["** RECORD GROUP 2, FINITE ELEMENT NODE LIST", *_integers(range(1, len(nodes) + 1)), "**"]
    for number, what in ((3, "DISPLACEMENTS"), (4, "VELOCITIES")):  # older versions want them
        lines += [f"** RECORD GROUP {number}, INITIAL MODAL {what}", *_rows(np.zeros((1, g.n_modes))), "**"]
    for number, axis in ((5, "X"), (6, "Y"), (7, "Z")):
        lines += [f"** RECORD GROUP {number}, NODAL {axis} COORDINATES", *_rows(where[:, [number - 5]]), "**"]
    lines.append("** RECORD GROUP 8, MODE SHAPES")
    for j in range(g.n_modes):
        shape = np.array([[*a.phi[:, j], *a.psi[:, j]] for a in nodes])
        lines += [f"**    NORMAL MODE SHAPE #{j + 1:4d}", *_rows(shape)]
    lines += ["**", "** RECORD GROUP 9, MODAL MASS MATRIX", *_rows(g.M_r), "**"]
    lines += ["** RECORD GROUP 10, MODAL STIFFNESS MATRIX", *_rows(g.K_r), "**"]
    lines += ["** RECORD GROUP 12, GLOBAL INERTIA", *_inertia(v), "**"]
    lines += ["** RECORD GROUP 13, MODAL DAMPING MATRIX", *_rows(g.C_r), "**"]
    return [*lines, *_invariants(v)]


def _head(basis: ModalBasis, g: ModalGroup, nodes: Sequence[Attachment]) -> list[str]:
    """Comments and record group 1."""
    return [
        "** MBDyn MODAL DATA FILE",
        f"** {one_line(basis.name)}, written by microslip. {STATEMENT}.",
        "** Origin of the body frame in the mesh, m: "
        + " ".join(f"{x:.16e}" for x in g.invariants.point)  # type: ignore[union-attr]
        + "; shapes x y z rx ry rz in body axes, phi^T M phi = 1",
        *(f"** node {i + 1}: {one_line(a.name)}" for i, a in enumerate(nodes)),
        *(f"** check: frequency {j + 1} of groups 9 and 10 is {f:.9g} Hz" for j, f in enumerate(g.frequency)),
        "** RECORD GROUP 1, HEADER",
        "**   REVISION,  NODE,  NORMAL, ATTACHMENT, CONSTRAINT, REJECTED MODES.",
        f"      REV0{len(nodes):10d}{g.n_modes:10d}{0:10d}{0:10d}{0:10d}",
        "**",
    ]


def _integers(values: Sequence[int]) -> list[str]:
    return ["".join(f"{v:10d}" for v in values[i : i + 6]) for i in range(0, len(values), 6)]


def _rows(table: Array) -> list[str]:
    return [" ".join(f"{v:23.16e}" for v in row) for row in np.asarray(table, dtype=float)]


def _inertia(v: Invariants) -> list[str]:
    c = v.first_moment / v.mass
    about_origin = -tilde_tilde(v.second_moment)
    about_centre = about_origin - v.mass * (c @ c * np.eye(3) - np.outer(c, c))
    return _rows(np.array([[v.mass]])) + _rows(c[None]) + _rows(about_centre)


def _invariants(v: Invariants) -> list[str]:
    tables = {
        (14, 3): v.shape,
        (15, 4): position_cross_shape(v),
        (16, 8): np.hstack(list(-tilde_tilde(v.position_shape))),
        (17, 5): shape_cross_shape(v).reshape(3, -1),
        (18, 9): tilde_tilde(v.shape_shape).transpose(2, 0, 1, 3).reshape(3, -1),
    }
    lines: list[str] = []
    for (group, invariant), table in tables.items():
        lines += [f"** RECORD GROUP {group}, INVARIANT {invariant}", *_rows(table), "**"]
    return lines


FORMATS = (Format("mbdyn", ".fem", "MBDyn", write_mbdyn),)

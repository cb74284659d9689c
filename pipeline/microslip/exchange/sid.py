"""SID, the standard input data of an elastic body for multibody programs (.SID_FEM, text).

Wallrapp, Standardization of Flexible Body Modeling in Multibody System Codes, Part I: Definition of Standard Input
Data, Mech. Struct. Mach. 22 (1994); Schwertassek and Wallrapp, Dynamik flexibler Mehrkoerpersysteme (1999), table
6.9. Every quantity is a Taylor series in the modal coordinates, m0 + sum over q of m1_q, written as ``m1( row, q,
column)``. With x = r + phi q from the origin of the body frame, ~ the cross-product matrix and all integrals over the
mass,

    mdCM = int x,  J = -int x~ x~,  Ct = int phi^T,  Cr = int (x~ phi)^T = int phi^T x~^T,  Me = int phi^T phi,
    Gr_l = -2 int x~ phi~_l,  Ge_l = -2 int phi^T phi~_l,  Oe omega_q = int phi^T w~ w~ x,
    omega_q = (w1 w1, w2 w2, w3 w3, w1 w2, w2 w3, w1 w3),

and the equations of motion in body axes (a: acceleration of the origin less gravity) read

    [ m     -mdCM~  Ct^T ] [ a     ]   [ 2 w~ Ct^T q' + w~ w~ mdCM      ]   [ 0                    ]
    [ mdCM~  J      Cr^T ] [ w'    ] + [ sum Gr_l q'_l w + w~ J w       ] + [ 0                    ] = outer forces
    [ Ct     Cr     Me   ] [ q''   ]   [ sum Ge_l q'_l w + Oe omega_q   ]   [ ksigma + Ke q + De q' ]

Where the modal file holds how inertia forces stiffen the body, their geometric stiffness stands in the m1 of Ct, Cr
and Oe (rows of the elastic equations only, so Ct^T and Cr^T above take m0 of Ct, and Cr without it).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..data import Array, ModalBasis, ModalGroup
from ..frames import skew
from .choice import Format, one_line
from .multibody import Attachment, position_cross_shape, shape_cross_shape, tilde_tilde, write_flexible


def write_sid(basis: ModalBasis, path: Path | str) -> None:
    """Write one group at rest, complete or absent, see `multibody.write_flexible`."""
    write_flexible(basis, path, "sid", _lines)


def _lines(basis: ModalBasis, g: ModalGroup, nodes: Sequence[Attachment]) -> list[str]:
    lines = [_first(basis, g, nodes), "part", "new modal"]
    lines += ["refmod", f"mass = {g.invariants.mass:.16e}", f"nelastq = {g.n_modes}"]  # type: ignore[union-attr]
    lines += [f"ielastq ({j + 1:4d}) = Eigen Mode {j + 1:4d} : {f:13.6f} Hz" for j, f in enumerate(g.frequency)]
    lines += ["end refmod", "frame"]
    for number, node in enumerate(nodes):
        lines += _node(number + 1, node)
    lines.append("end frame")
    for name, (m0, m1) in sid_tables(g).items():
        lines += _taylor(name, m0, m1, g.n_modes)
    return [*lines, "end modal", "end part"]


def _first(basis: ModalBasis, g: ModalGroup, nodes: Sequence[Attachment]) -> str:
    """The one line that the format leaves free; readers take its first two integers."""
    names = ", ".join(f"{i + 1} = {a.name}" for i, a in enumerate(nodes))
    origin = " ".join(f"{x:.9g}" for x in g.invariants.point)  # type: ignore[union-attr]
    text = (
        f"{len(nodes)} nodes, {g.n_modes} modes, {basis.name} by microslip; SI; axes of the mesh, origin ({origin}); "
        "forces positive along their displacements; "
        f"m1(row, q, column); omega products xx yy zz xy yz xz; nodes {names}"
    )
    return one_line(text)


def _node(number: int, a: Attachment) -> list[str]:
    m = a.phi.shape[1]
    turned = np.array([skew(p) for p in a.psi.T])
    return [
        f"new node = {number}",
        "rframe = body ref",
        *_taylor("origin", a.position[:, None], a.phi.T[:, :, None], m),
        *_taylor("phi", a.phi, None, m),
        *_taylor("psi", a.psi, None, m),
        *_taylor("AP", np.eye(3), turned, m),
        "end node",
    ]


def sid_tables(g: ModalGroup) -> dict[str, tuple[Array | None, Array | None]]:
    """Name -> m0 (rows, columns) and m1 (m, rows, columns), in the order of the file; None where there is none."""
    v = g.invariants
    assert v is not None
    m, crossed = g.n_modes, shape_cross_shape(v)
    geometric = v.stiffening if len(v.stiffening) else np.zeros((12, m, m))
    stiff = geometric.transpose(2, 1, 0)  # (q, row, motion)
    turning = tilde_tilde(v.position_shape)  # (m, 3, 3) of r~ phi~_l
    return {
        "mdCM": (v.first_moment[:, None], v.shape.T[:, :, None]),
        "J": (-tilde_tilde(v.second_moment), -(turning + turning.transpose(0, 2, 1))),
        "Ct": (v.shape.T, stiff[:, :, 6:9]),
        "Cr": (position_cross_shape(v).T, crossed.transpose(1, 2, 0) + stiff[:, :, 9:12]),
        "Me": (g.M_r, None),
        "Gr": (-2 * np.hstack(list(turning)), -2 * np.array([np.hstack(list(b)) for b in tilde_tilde(v.shape_shape)])),
        "Ge": (-2 * crossed.transpose(1, 2, 0).reshape(m, 3 * m), None),
        "Oe": (
            centrifugal(v.position_shape[..., None])[:, :, 0],
            centrifugal(v.shape_shape.transpose(0, 1, 3, 2)).transpose(2, 0, 1) + stiff[:, :, :6],
        ),
        "ksigma": (np.zeros((m, 0)), None),
        "Ke": (g.K_r, None),
        "De": (g.C_r, None),
    }


def centrifugal(D: Array) -> Array:
    """(m, 6, k) integral of rho phi^T w~ w~ x per product of angular velocities.

    Args:
        D: (3, 3, m, k) integral of rho x_a phi_b for each of k fields x.
    """
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
    dot = np.trace(D)
    found = [D[a, a] - dot if a == b else D[a, b] + D[b, a] for a, b in pairs]
    return np.stack(found, axis=1)


def _taylor(name: str, m0: Array | None, m1: Array | None, modes: int) -> list[str]:
    """One object: order, sizes, structure 3 (full), or 0 for one that vanishes."""
    assert m0 is not None
    rows, columns = m0.shape
    empty = columns == 0
    head = [name, f"order = {int(m1 is not None)}", f"nrow = {rows}", f"ncol = {max(columns, 1)}"]
    head += [f"nq = {modes if m1 is not None else 0}", "nqn = 0", f"structure = {0 if empty else 3}"]
    body = [f"m0({i + 1:4d},{k + 1:4d}) = {m0[i, k]:.16e}" for i in range(rows) for k in range(columns)]
    if m1 is not None:
        body += [
            f"m1({i + 1:4d},{q + 1:4d},{k + 1:4d}) = {m1[q, i, k]:.16e}"
            for i in range(rows)
            for q in range(modes)
            for k in range(columns)
        ]
    return [*head, *body, f"end {name}"]


FORMATS = (Format("sid", ".SID_FEM", "multibody programs: standard input data", write_sid),)

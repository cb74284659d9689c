"""What the multibody formats share: attachment points with shapes, and integrals of cross products.

The body frame of all of them has the axes of the mesh and its origin at the reference point of the inertia integrals
(the modal file's `S/invariants/point`, the point of the rotation axis). Coordinates are elastic modes; the rigid motion
is the frame's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..data import Array, Invariants, ModalBasis, ModalGroup
from ..errors import UserError
from ..files.store import write_text
from ..reduced.floating_frame import rotation_shape
from .choice import body_in_motion

_EYE = np.eye(3)


@dataclass(frozen=True)
class Attachment:
    """A point other bodies act on. position: (3,) m in the body frame. phi, psi: (3, m) displacement and small rotation
    of it in body axes per modal coordinate; psi is zero where only displacements are known."""

    name: str
    position: Array
    phi: Array
    psi: Array


Lines = Callable[[ModalBasis, ModalGroup, Sequence[Attachment]], list[str]]


def write_flexible(basis: ModalBasis, path: Path | str, form: str, lines: Lines) -> None:
    """Write one group at rest as the lines of a text format, complete or absent. Same basis, same bytes.

    Args:
        form: its name, for messages. lines: of the file, from the group and its attachment points.

    Raises:
        UserError: see `choice.body_in_motion` and `attachments`; no permission, no space.
    """
    group = body_in_motion(basis, form)
    write_text(path, "\n".join(lines(basis, group, attachments(basis, group, form))) + "\n")


def attachments(basis: ModalBasis, g: ModalGroup, form: str) -> list[Attachment]:
    """The interfaces by their rigid fit, then the monitors that read a displacement along x, y and z.

    Raises:
        UserError: there are none.
    """
    assert g.invariants is not None
    about, found = g.invariants.point, []
    for name, i in g.interfaces.items():
        back = i.rotation.T
        found.append(Attachment(name, i.origin - about, back @ i.rows[:3], back @ i.rows[3:]))
    for name, r in g.monitors.items():
        if r.labels == ("u_x", "u_y", "u_z"):
            found.append(Attachment(name, r.point - about, r.rows, np.zeros_like(r.rows)))
    if not found:
        raise UserError(
            f"{basis.name}: export --to {form}: there is no point to attach the body by; give it [[interfaces]] or a "
            "[[monitors]] point without direction"
        )
    return found


def tilde_tilde(D: Array) -> Array:
    """(..., 3, 3) integral of rho a~ b~ = b a^T - (a . b) 1 from D (3, 3, ...), the integral of rho a_i b_j."""
    moved = np.moveaxis(D, (0, 1), (-2, -1))
    return np.swapaxes(moved, -1, -2) - np.trace(D)[..., None, None] * _EYE


def position_cross_shape(v: Invariants) -> Array:
    """(3, m) integral of rho r x phi_j."""
    return rotation_shape(v.position_shape)


def shape_cross_shape(v: Invariants) -> Array:
    """(3, m, m) integral of rho phi_i x phi_j."""
    s = v.shape_shape
    return np.array([s[1, 2] - s[2, 1], s[2, 0] - s[0, 2], s[0, 1] - s[1, 0]])

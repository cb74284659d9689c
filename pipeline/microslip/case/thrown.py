"""Normal forces of loose bodies (dampers under platforms) that their centrifugal load presses into their contacts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.optimize

from ..data import Array, ModalBasis
from ..errors import UserError
from .loaded import axis_of, placed
from .settings import BodyOfCase, CaseSettings

UNHELD = 0.05
"""Share of a centrifugal load that the faces of its body may leave without a force against it: their normals are those
of faces as drawn, and a body that leans farther is held by more than they tell."""


def thrown(settings: CaseSettings, bases: Mapping[str, ModalBasis]) -> CaseSettings:
    """The case with the normal forces of contacts into which bodies press themselves (`pressed_at_rpm`).

    Raises:
        UserError: a body that its contacts do not hold, or a contact that something else presses too.
    """
    contacts = list(settings.contacts)
    for b in settings.components:
        if b.pressed_at_rpm is None:
            continue
        faces = {i: face for i, c in enumerate(contacts) for body, face in settings.ends(c) if body == b.name}
        others = [body for i in faces for body, _ in settings.ends(contacts[i]) if body != b.name]
        holder = next((m for m in settings.components if m.name in others[:1]), b)
        about = axis_of(holder, bases[holder.name])
        for i, force in zip(faces, normal_forces(b, bases[b.name], list(faces.values()), about), strict=True):
            if contacts[i].normal_force is not None or contacts[i].interference is not None:
                raise UserError(f"contacts.{contacts[i].interface} is pressed already; leave one of both out", _key(b))
            contacts[i] = contacts[i].model_copy(update={"normal_force": force})
    return settings.model_copy(update={"contacts": tuple(contacts)})


def _key(b: BodyOfCase) -> str:
    return f"bodies.{b.name}.pressed_at_rpm"


def normal_forces(
    b: BodyOfCase, basis: ModalBasis, faces: list[str], about: tuple[Array, Array] | None = None
) -> list[float]:
    """N, of every face: none pulls, and together they balance m r Omega^2 at the centre of mass, without friction.

    Of two flanks under a roof of angle alpha each carries m r Omega^2 / (2 sin(alpha / 2)).

    Args:
        about: direction and a point of the axis, in the axes of the case: of the body that holds it, whose file knows
            where it turns; its own if not given.
    """
    place, (axis, point) = placed(b, basis), about or axis_of(b, basis)
    arm = place.turn @ basis.centre + place.shift - point
    radius = place.turn.T @ (arm - (arm @ axis) * axis)
    load: Array = (b.mass or basis.mass) * radius * ((b.pressed_at_rpm or 0.0) * np.pi / 30) ** 2
    known = next(iter(basis.groups.values())).interfaces
    normals = np.array([known[name].rotation[0] for name in faces if name in known]).reshape(-1, 3)
    found, left = (np.zeros(0), np.inf) if len(normals) == 0 else scipy.optimize.nnls(normals.T, load)
    if not left <= UNHELD * np.linalg.norm(load):
        said = f"{100 * left / np.linalg.norm(load):.3g} % of its centrifugal load" if len(normals) else "it"
        raise UserError(
            f"the contacts of '{b.name}' do not hold {said}; name the faces that it lies against, or give "
            "sweep.normal_forces",
            _key(b),
        )
    return [float(force) for force in found]

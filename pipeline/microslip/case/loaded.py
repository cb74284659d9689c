"""The bodies of a case: modal files at the speed, with the modes, the mass and the damping that it asks for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..data import Array, Interface, ModalBasis, ModalGroup
from ..errors import UserError, at
from ..frames import rotation
from ..modal.speed_range import basis_at
from ..reduced.compliance import has_residual
from ..reduced.coordinates import first_modes, in_modes, of_density
from ..system.damping import with_ratios
from ..system.pairing import Place
from .driving import on_springs
from .settings import BodyOfCase, CaseSettings
from .weak_springs import on_weak_springs


@dataclass(frozen=True)
class Loaded:
    """A body of a case: its settings, its modal file at the speed asked for, groups in the coordinates to be used.

    stored: the groups as the file has them, by nodal diameter. groups: in modes where statics stand beside them.
    viscous: their damping is that of dampers or Rayleigh's, and no ratio of each mode.
    """

    settings: BodyOfCase
    basis: ModalBasis
    stored: Mapping[int, ModalGroup]
    groups: Mapping[int, ModalGroup]
    viscous: bool = False

    @property
    def group(self) -> ModalGroup:
        """The first one: of all of a body that is not cyclic."""
        return self.groups[min(self.groups)]

    @property
    def mass(self) -> float:
        """kg, or 0 where it is not known."""
        return self.basis.mass if self.settings.mass is None else self.settings.mass

    @property
    def extent(self) -> float:
        """m, the longest side of the box round its mesh; 0 of one without cells."""
        mesh = self.basis.mesh
        return float(np.ptp(mesh.points, axis=0).max()) if mesh.n_cells else 0.0

    @property
    def has_residual(self) -> bool:
        return has_residual(self.stored[min(self.stored)], self.basis.reduction)

    def face(self, name: str) -> Interface:
        if name not in self.group.interfaces:
            known = ", ".join(self.group.interfaces) or "none"
            raise UserError(f"the modal file of '{self.basis.name}' has no interface '{name}'; it has {known}")
        return self.group.interfaces[name]


def load_bodies(settings: CaseSettings, bases: Mapping[str, ModalBasis]) -> dict[str, Loaded]:
    """The bodies of a case at their speeds.

    Raises:
        UserError: a speed that a modal file does not have; a cyclic sector without a ring.
    """
    return {b.name: _loaded(settings, b, bases[b.name]) for b in settings.components}


def _loaded(settings: CaseSettings, b: BodyOfCase, basis: ModalBasis) -> Loaded:
    ring = settings.ring
    if basis.sectors > 1 and ring is None:
        raise UserError(
            f"'{basis.name}' is one of {basis.sectors} cyclic sectors, whose contacts join neighbours: "
            f"add [ring] with blades = {basis.sectors} and an engine_order; or leave [cyclic] out of its body.toml to "
            "study a lone sector",
            "body",
        )
    if basis.sectors > 1 and ring is not None and ring.blades != basis.sectors:
        raise UserError(f"{ring.blades}, but '{basis.name}' is one of {basis.sectors} sectors", "ring.blades")
    key = "" if settings.body else f"bodies.{b.name}"
    with at(key):
        stored = _at_speed(b, basis)
    own_modes = has_residual(stored[min(stored)], basis.reduction)
    groups = {k: in_modes(g) for k, g in stored.items()} if own_modes else stored
    if b.mass is not None:
        with at(key), at("mass"):
            groups, stored = (_of_mass(g, b.mass, basis) for g in (groups, stored))
    ratios, whose = (b.damping_ratio, key) if b.damping_ratio is not None else (settings.damping_ratio, "")
    viscous = ratios is None and basis.damping_source.startswith(("rayleigh", "matrix"))
    if ratios is not None:
        with at(whose), at("damping_ratio"):
            groups = {k: with_ratios(g, ratios) for k, g in groups.items()}
    if b.weak_springs is not None:
        with at(key), at("weak_springs"):
            groups = {k: on_weak_springs(g, b.weak_springs) for k, g in groups.items()}
    own = [(row, s) for s in settings.springs for body, row in [settings.address(s.row)] if body == b.name]
    with at("springs"):
        groups = {k: on_springs(g, own) for k, g in groups.items()}
    return Loaded(b, basis, stored, groups, viscous)


def _of_mass(groups: dict[int, ModalGroup], mass: float, basis: ModalBasis) -> dict[int, ModalGroup]:
    """The groups of the body with another mass (kg).

    Raises:
        UserError: its modal file does not know its mass, or it rotates.
    """
    if basis.mass <= 0:
        raise UserError(f"the modal file of '{basis.name}' does not know the body's mass; leave it out")
    return {k: of_density(g, mass / basis.mass) for k, g in groups.items()}


def _at_speed(b: BodyOfCase, basis: ModalBasis) -> dict[int, ModalGroup]:
    """Nodal diameter -> group of a stored speed (a number), or of one in rpm, stored or in the body's range."""
    speed = b.speed
    if b.speed_rpm is not None:
        with at("speed_rpm"):
            basis, speed = basis_at(basis, b.speed_rpm), 0
    found = {k: g for (s, k), g in basis.groups.items() if s == speed}
    if not found:
        count = len({s for s, _ in basis.groups})
        known = "one speed, number 0" if count == 1 else f"{count} speeds, numbers 0 to {count - 1}"
        raise UserError(f"the modal file of '{basis.name}' has {known}; correct it", "speed")
    with at("modes"):
        return found if b.modes is None else {k: first_modes(g, b.modes) for k, g in found.items()}


def body_of(bodies: Mapping[str, Loaded], name: str) -> Loaded:
    if name not in bodies:
        raise UserError(f"there is no body '{name}' in this case; it has {', '.join(bodies)}")
    return bodies[name]


def place_of(b: Loaded) -> Place:
    """Where a body stands in the axes of the case."""
    return placed(b.settings, b.basis)


def placed(b: BodyOfCase, basis: ModalBasis) -> Place:
    """Where a case puts the body of a modal file."""
    R = rotation(basis.rotation_axis, np.radians(b.turn))
    centre = basis.rotation_point
    return Place(R, centre - R @ centre + np.asarray(b.shift))


def axis_of(b: BodyOfCase, basis: ModalBasis) -> tuple[Array, Array]:
    """Direction and a point of the axis of a body, in the axes of the case."""
    place = placed(b, basis)
    return place.turn @ basis.rotation_axis, place.turn @ basis.rotation_point + place.shift

"""A whole ring whose sectors differ, from the one that stands for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..data import Array, ModalGroup
from ..errors import UserError
from ..reduced.coordinates import of_density
from ..system.assembly import Assembly, Contact, ContactFace, preloaded_contact
from ..system.component import Component
from ..system.disc import Flow, at_sector, through
from . import subset
from .scatter import MODAL, OF_BLADES, Scatter

ELSEWHERE = 0.1
"""rad, and share of its size, by which an interface of another modal file may stand off the nominal one's."""

Deviations = Sequence[tuple[Scatter, Array]]
"""What differs, and its (sectors, modes) deviations."""

MADE = ("modal_file", "mass", "frequency", "damping", "added_mass",
        "friction", "stiffness", "normal_force", "gap")  # fmt: skip
"""In this order, whatever that of the scatters is: blades as they are made, then what sits on them; contacts pressed,
then set apart."""

OF_LAWS = {
    "friction": ("mu", "static", "sliding", "held"),
    "stiffness": ("stiffness_0", "stiffness_1", "stiffness_2", "normal", "along", "across"),
    "normal_force": ("constant", "held"),
}
"""What of a contact law's numbers follows each of these."""


@dataclass(frozen=True, eq=False)
class Tuned:
    """A ring of equal sectors, and the whole rings that deviations make of it.

    Attributes:
        sector: one that stands for all, with its ring. pressed_by: body -> its own contacts' names whose normal forces
            follow its mass.
    """

    sector: Assembly
    pressed_by: dict[str, tuple[str, ...]]

    @property
    def sectors(self) -> int:
        assert self.sector.ring is not None
        return self.sector.ring.blades

    @cached_property
    def whole(self) -> Assembly:
        return self.sector.unrolled()

    def modes(self, s: Scatter) -> int:
        """Into how many modes deviations may differ in one sector."""
        if s.of not in MODAL:
            return 1
        body = self.body(s)
        return len(body.groups[0].omega) if body.sectors == 1 else 1

    def check(self, scatter: Sequence[Scatter]) -> None:
        """Raise `UserError` for what is not there, or on which nothing depends."""
        for s in scatter:
            if s.of in OF_BLADES:
                self.body(s)
            else:
                self._contact(s)
            for sector, other in s.others.items():
                self._alike(s, sector, other)
        some = [(s, np.full((self.sectors, self.modes(s)), 1e-3)) for s in scatter if not s.others]
        self.mistuned(some + [(s, s.drawn(self.sectors, 1, 0, 0, 0)) for s in scatter if s.others]).check_names()

    def mistuned(self, deviations: Deviations) -> Assembly:
        """The whole ring.

        Raises:
            UserError: a deviation that leaves nothing of a stiffness, a mass, a normal force or a coefficient.
        """
        components = {m.name: m for m in self.whole.components}
        contacts = {c.name: c for c in self.whole.contacts}
        discs, heavier = dict[str, Array](), list[tuple[str, Scatter, Array]]()
        for s, values in sorted(deviations, key=lambda one: MADE.index(one[0].of)):
            positive(s, values)
            name = self.body(s).name if s.of in OF_BLADES else self._contact(s).name
            if name in components:  # a disc in one piece
                if s.of == "frequency":
                    discs[name] = (1 + discs.get(name, 0.0)) * (1 + values[:, 0]) - 1
                else:
                    heavier.append((name, s, values[:, 0]))
                continue
            for j, own in enumerate(values):
                at = f"{name}_{j}"
                if s.of == "modal_file":
                    components[at] = replace(self._made(s, own), name=at, aerodynamic=components[at].aerodynamic)
                elif s.of in OF_BLADES:
                    components[at] = deviated(components[at], s, own)
                else:
                    contacts[at] = _met(contacts[at], s, float(own[0]))
                for c in self.pressed_by.get(name, ()) if s.of == "mass" else ():
                    contacts[f"{c}_{j}"] = _pressed(contacts[f"{c}_{j}"], float(own[0]))
        for m in self.sector.components:
            if m.name in discs:
                components[m.name] = subset.mistuned(m, discs[m.name])
        for name, s, masses in heavier:
            for j, mass in enumerate(masses):
                there = replace(s, at=at_sector(s.at or "", j))
                components[name] = deviated(components[name], there, np.array([mass]))
        parts, met = tuple(components.values()), tuple(contacts.values())
        return replace(self.whole, components=parts, contacts=met, flow=self._flow(deviations))

    def body(self, s: Scatter) -> Component:
        names = {m.name: m for m in self.sector.components}
        if s.component is None and len(names) > 1:
            raise UserError(f"{s.of}: of which body? give one of {', '.join(names)}")
        if s.component is not None and s.component not in names:
            raise UserError(f"{s.of}: there is no body '{s.component}', but {', '.join(names)}")
        if s.of == "damping" and self.sector.stuck_damping is not None:
            raise UserError(
                'damping: with damping = "stuck" no body has ratios of its own; write "modal" or leave it out'
            )
        body = names[s.component or next(iter(names))]
        if body.sectors > 1 and s.of not in ("frequency", "added_mass"):
            raise UserError(
                f"{s.of}: '{body.name}' is a sector of a disc in one piece, of which the frequency scatters, by the "
                "stiffness of whole sectors, and added_mass; scatter these, or what is in the contacts"
            )
        return body

    def _made(self, s: Scatter, number: Array) -> Component:
        """The body of a modal file: 0 of the nominal one, 1 of the first of the others."""
        return _named([self.sector, *s.others.values()][int(number[0])], self.body(s).name)

    def _flow(self, deviations: Deviations) -> tuple[Flow, ...]:
        """What the flow adds to the tuned ring, or to the one of other modal files; it knows of no deviations."""
        flows = {f.components: f for f in self.whole.flow}
        for s, values in (one for one in deviations if one[0].others):
            body = self.body(s)
            blades = [replace(self._made(s, own), name=f"{body.name}_{j}") for j, own in enumerate(values)]
            if (names := tuple(b.name for b in blades)) in flows:
                flows[names] = through(blades, body.aerodynamic)
        return tuple(flows.values())

    def _alike(self, s: Scatter, sector: int, other: Assembly) -> None:
        """Raise `UserError` where a body of another modal file does not fit into the place of the nominal one."""
        name, where = self.body(s).name, f"others.{sector}"
        if name in self.pressed_by:
            raise UserError(f"{where}: '{name}' is pressed by its centrifugal load; scatter its mass instead")
        a, b = (_named(x, name).groups[0] for x in (self.sector, other))
        if len(a.M_r) != len(b.M_r):
            raise UserError(
                f"{where}: has {len(b.M_r)} coordinates, and the nominal file {len(a.M_r)}; compute both bodies with "
                "the same number of modes, or take as many of both by modes"
            )
        for _, _, side in self.sector.sides(name):
            _in_place(where, side, a, b)

    def _contact(self, s: Scatter) -> Contact:
        names = {c.name: c for c in self.sector.contacts}
        if not names or s.contact is None and len(names) > 1:
            has = ", ".join(names) or "none"
            raise UserError(f"{s.of}: of which contact? the ring has {has}")
        if s.contact is not None and s.contact not in names:
            raise UserError(f"{s.of}: there is no contact '{s.contact}', but {', '.join(names)}")
        return names[s.contact or next(iter(names))]


def _named(assembly: Assembly, name: str) -> Component:
    names = {m.name: m for m in assembly.components}
    if name not in names:
        raise UserError(f"others: an assembly has no body '{name}', but {', '.join(names)}")
    return names[name]


def _in_place(where: str, side: ContactFace, nominal: ModalGroup, other: ModalGroup) -> None:
    """Raise `UserError` for a face that stands elsewhere, or whose patch deforms by the nominal body's shapes."""
    if side.rows is not None:
        raise UserError(f"{where}: the patch at {side.interface} deforms as the nominal body does; take a rigid one")
    if side.interface not in other.interfaces:
        raise UserError(f"{where}: has no interface '{side.interface}', but {', '.join(other.interfaces) or 'none'}")
    a, b = nominal.interfaces[side.interface], other.interfaces[side.interface]
    apart, size = float(np.linalg.norm(b.origin - a.origin)), float(np.sqrt(a.areas.sum()))
    if apart > ELSEWHERE * size + 1e-9 or np.abs(b.rotation - a.rotation).max() > ELSEWHERE:
        raise UserError(
            f"{where}: its interface '{side.interface}' stands {apart:.3g} m off the nominal one's place, or is turned "
            f"by more than {ELSEWHERE:g} rad, and contacts stay where they are: give a body with its faces there"
        )


def positive(s: Scatter, values: Array) -> None:
    """Raise `UserError` for deviations that leave nothing of something."""
    nothing = values.min() < 0 if s.of == "added_mass" else values.min() <= -1
    if s.of != "gap" and nothing:
        sector = int(values.min(axis=1).argmin())
        raise UserError(
            f"{s.of}: a deviation of {values.min():.3g} in sector {sector} leaves nothing of it; take a smaller "
            'deviation, or distribution = "lognormal"'
        )


def deviated(component: Component, s: Scatter, own: Array) -> Component:
    group = component.groups[0]
    if s.of == "mass":
        return replace(component, groups={0: of_density(group, 1 + float(own[0]))})
    if s.of == "added_mass":
        return replace(component, groups={0: _heavier(group, s, float(own[0]))})
    V = np.eye(len(group.M_r)) if group.to_diagonal is None else group.to_diagonal
    damped = bool(component.loss) or bool(group.C_r.any())  # else it is the modes of stuck contacts that are
    P, omega, D = group.M_r @ V, group.omega, damped * group.damping_ratio

    def added(values: Array) -> Array:
        return (P * values) @ P.conj().T

    stiffer = (1 + own) ** 2 - 1
    lossier = own if s.of == "damping" else stiffer
    if component.loss:
        loss, C = {0: component.loss[0] + added(2 * D * omega**2 * lossier)}, group.C_r
    else:
        loss, C = {}, group.C_r + added(2 * D * omega * own)
    if s.of == "damping":
        changed = replace(group, C_r=C, damping_ratio=D * (1 + own))
    else:
        K = group.K_r + added(omega**2 * stiffer)
        changed = replace(group, omega=omega * (1 + own), K_r=K, C_r=C)
    return replace(component, groups={0: changed}, loss=loss)


def _heavier(group: ModalGroup, s: Scatter, mass: float) -> ModalGroup:
    rows = group.monitors.get(s.at or "")
    if rows is None or rows.unit != "m":
        known = dict.fromkeys(name.partition("@")[0] for name in group.monitors)
        raise UserError(f"added_mass: at: give a monitor of displacements, one of {', '.join(known) or 'none'}")
    return replace(group, M_r=group.M_r + mass * rows.rows.conj().T @ rows.rows)


def _met(contact: Contact, s: Scatter, own: float) -> Contact:
    if s.of == "gap":
        away = np.zeros_like(contact.offset)
        away[0] = own
        return replace(contact, offset=contact.offset - away)
    if s.of == "normal_force":
        return _pressed(contact, own)
    changed, count = _changed(contact, s.of, own)
    if not count:
        law = type(contact.patch.law).__name__
        raise UserError(f"{s.of}: no number of contact '{contact.name}' follows it, by its law {law}")
    force = float(contact.preload[0])
    return changed if not force else changed.pressed(force)


def _pressed(contact: Contact, own: float) -> Contact:
    force = float(contact.preload[0])
    changed, count = _changed(contact, "normal_force", own)
    if not force and not count:
        raise UserError(f"normal_force: contact '{contact.name}' has none; give it one, or scatter its gap")
    pressed = preloaded_contact(
        contact.name, changed.patch, contact.first, contact.second, normal=force * (1 + own),
        compliance=contact.compliance,
    )  # fmt: skip
    return replace(pressed, phase=contact.phase, length=contact.length)


def _changed(contact: Contact, of: str, own: float) -> tuple[Contact, int]:
    """The contact with the numbers of its law that follow one of `OF_LAWS`, and how many there are."""
    law, count = _scaled(contact.patch.law, OF_LAWS[of], 1 + own)
    return replace(contact, patch=replace(contact.patch, law=law)), count


def _scaled(law: Any, names: tuple[str, ...], factor: float) -> tuple[Any, int]:
    """The law with its numbers of these names, wherever they stand, times a factor; how many there are."""
    changed: dict[str, Any] = {}
    count = 0
    for f in fields(law):
        value = getattr(law, f.name)
        if is_dataclass(value) and not isinstance(value, type):
            changed[f.name], more = _scaled(value, names, factor)
            count += more
        elif f.name in names and value is not None and not f.metadata.get("static"):
            changed[f.name], count = value * factor, count + 1
    return replace(law, **changed), count

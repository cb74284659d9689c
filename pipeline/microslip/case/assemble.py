"""From a case's settings and modal files to an assembly: bodies, contacts, loads and read-outs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from ..data import CENTRIFUGAL, Array, ModalBasis, ModalGroup
from ..errors import UserError, at, in_its_file
from ..operating.stress import READS_THE_MESH, in_singular_zone
from ..process import prepare
from ..reduced.compliance import SURFACE
from ..system.assembly import Assembly, Contact, Load, Output
from ..system.component import Component, Ring
from ..system.damping import read_aerodynamics
from ..system.spin import Spin, turned
from .compliance import Springs, residual_share
from .contacts import contact_at, described, of_force, sides, springs_of, swept
from .driving import as_asked, loads_of, messages_of, with_field
from .loaded import Loaded, axis_of, body_of, load_bodies, place_of
from .points import (
    fitting_forces,
    follows_the_force,
)
from .settings import GROUND, UNPRESSED, CaseSettings, ContactSettings
from .thrown import thrown


@dataclass(frozen=True, repr=False)
class Built:
    """An assembly made from a case.

    Attributes:
        settings. bodies: by name. contacts: with their sizes, in the assembly's order. springs: of
            each along n, t1, t2, N/m, without what the bodies hold. assembly: its contacts pressed by
            nothing where the sweep presses them. messages: what a reader must know.
        fitted: number of a curved contact that is fitted at the force (N) which presses it -> the contact fitted at a
            force; `springs` and `assembly` have it as fitted at the largest of the sweep.
    """

    settings: CaseSettings
    bodies: Mapping[str, Loaded]
    contacts: tuple[ContactSettings, ...]
    springs: tuple[Springs, ...]
    assembly: Assembly
    messages: tuple[str, ...]
    fitted: Mapping[int, Callable[[float], Contact]] = field(default_factory=dict)
    _pressed: dict[float | None, Assembly] = field(init=False, repr=False, compare=False, default_factory=dict)

    def __repr__(self) -> str:
        return f"<Built {self.settings.name}: {self.assembly!r}>"

    @property
    def speed(self) -> float:
        """rad/s of the first body."""
        return next(iter(self.bodies.values())).group.speed

    def pressed(self, normal: float | None) -> Assembly:
        """The assembly with a normal force (N) in every contact that the sweep presses; all of its ring if asked.

        Raises:
            UserError: a force that a law does not reach.
        """
        if normal not in self._pressed:
            self._pressed[normal] = self._under(normal)
        return self._pressed[normal]

    def _under(self, normal: float | None) -> Assembly:
        one = self.one(normal)
        return one.unrolled() if self.settings.ring and self.settings.ring.model == "full" else one

    def one(self, normal: float | None) -> Assembly:
        """`pressed`, of a ring one sector that stands for all."""
        whole = self.assembly
        if normal is not None:
            own = [self.fitted[i](normal) if i in self.fitted else c for i, c in enumerate(whole.contacts)]
            pairs = zip(own, self.contacts, strict=True)
            whole = replace(whole, contacts=tuple(c.pressed(normal) if swept(s) else c for c, s in pairs))
        return whole


@in_its_file
def build(settings: CaseSettings, bases: Mapping[str, ModalBasis]) -> Built:
    """The assembly of a case.

    Args:
        bases: body of the case -> its modal file.

    Raises:
        UserError: names that no modal file holds, faces that do not face each other, stiffnesses that count the bulk
            twice.
    """
    prepare()
    contacts = list[ContactSettings]()
    for c in settings.contacts:
        with at(f"contacts.{c.interface}"):
            contacts.append(described(c, settings.path))
    settings = settings.model_copy(update={"contacts": tuple(contacts)})
    bodies = load_bodies(settings, bases)
    for c in settings.contacts:  # before any of them is made, which compiles
        with at(f"contacts.{c.interface}"):
            sides(settings, bodies, c)
    settings = thrown(settings, {name: b.basis for name, b in bodies.items()})
    components = _spun({name: _component(settings, b) for name, b in bodies.items()}, settings, bodies)
    contacts, springs, made, messages = [], [], [], list[str]()
    fitted: dict[int, Callable[[float], Contact]] = {}
    for i, c in enumerate(settings.contacts):
        pressed = fitting_forces(settings, c)
        with at(f"contacts.{c.interface}"):
            own, k, said = springs_of(settings, bodies, c, pressed[-1])
            under, more = contact_at(settings, bodies, components, own, k)
        contacts.append(own)
        springs.append(k)
        said += more
        for force in pressed:
            contact, more = under(force)
            said += more
        made.append(contact)
        if follows_the_force(c):
            fitted[i] = partial(of_force, under)
        messages += said
    flowing = tuple(_in_flow(settings, m, bodies[m.name]) for m in components.values())
    flowing, loads, said = _loads(settings, bodies, flowing)
    messages += [*said, *messages_of(flowing, loads, settings.balanced, _blades(settings), settings.turning)]
    ring = Ring(settings.ring.blades, settings.base_order) if settings.ring else None
    outputs = _outputs(settings, bodies)
    messages += _pressing_nothing(settings)
    messages += [_held(w) for w in outputs if _is_still(bodies[w.component], "monitor", w.monitor, w.label)]
    messages += [_in_zone(w) for w in outputs if _reads_singular(bodies[w.component].group, w.monitor)]
    assembly = Assembly(flowing, tuple(made), loads, outputs, ring, settings.stuck_ratios)
    said = list(dict.fromkeys(messages))
    return Built(settings, bodies, tuple(contacts), tuple(springs), assembly, tuple(said), fitted)


def _pressing_nothing(settings: CaseSettings) -> list[str]:
    """What is said of normal forces of a sweep that no contact takes."""
    forces = settings.sweep.normal_forces
    if not settings.contacts or forces in (None, UNPRESSED) or any(swept(c) for c in settings.contacts):
        return []
    return ["sweep.normal_forces presses nothing: every contact has a force or an interference of its own."]


def _component(settings: CaseSettings, b: Loaded) -> Component:
    name, groups = b.settings.name, dict(b.groups) if b.basis.sectors > 1 else {0: b.group}
    component = Component(name, groups, b.basis.sectors, _residual_share(settings, name, b))
    return as_asked(component, settings.damping_as, b.viscous)


def _residual_share(settings: CaseSettings, name: str, b: Loaded) -> Array | None:
    faces = {
        i: SURFACE if c.is_curved else c.includes
        for c in settings.contacts
        for body, i in settings.ends(c)
        if body == name
    }
    first = min(b.groups)
    return residual_share(b.groups[first], b.basis.reduction, b.has_residual, faces)


def _spun(
    components: dict[str, Component], settings: CaseSettings, bodies: Mapping[str, Loaded]
) -> dict[str, Component]:
    """The components, with the inertia of the material that runs through those which ground that turns is of.

    Raises:
        UserError: it turns differently under two contacts; see `spin.turned`.
    """
    spins = dict[str, tuple[Spin, bool]]()
    for c in settings.contacts:
        if c.ground is None or c.ground.rpm is None or c.against == GROUND:
            continue
        name, key = settings.ends(c)[1][0], f"contacts.{c.interface}.ground"
        b = bodies[name]
        spin = c.ground.spin(*axis_of(b.settings, b.basis), place_of(b))
        other, inert = spins.setdefault(name, (spin, c.ground.inertia))
        if not spin.same(other) or inert != c.ground.inertia:
            raise UserError(
                f"turns the material of '{name}' otherwise than another contact does; write the same rpm, "
                "axis, point and inertia in both",
                key,
            )
        if other is not spin or not inert:
            continue
        try:
            components[name] = turned(components[name], spin, b.basis.mesh, b.mass)
        except UserError as error:
            raise UserError(f"'{name}': {error}; or leave its inertia out: inertia = false", key) from error
    return components


def _blades(settings: CaseSettings) -> int:
    return settings.ring.blades if settings.ring else 0


def _in_flow(settings: CaseSettings, component: Component, b: Loaded) -> Component:
    """The component with what the flow adds to its waves."""
    if b.settings.aerodynamics is None:
        return component
    with at(f"bodies.{b.settings.name}.aerodynamics"):
        file = settings.path.parent / b.settings.aerodynamics
        return replace(component, aerodynamic=read_aerodynamics(file, _blades(settings), settings.turning))


def _loads(
    settings: CaseSettings, bodies: Mapping[str, Loaded], components: tuple[Component, ...]
) -> tuple[tuple[Component, ...], tuple[Load, ...], list[str]]:
    """Members with the rows of pressure fields, all loads, and what a reader should know."""
    found: list[Load] = []
    said, named = [], {m.name: m for m in components}
    base, blades, turning = settings.base_order, _blades(settings), settings.turning
    for i, x in enumerate(settings.loads):
        body, row = settings.address(x.row or x.face or "")
        with at("excitation"):
            b = body_of(bodies, body)
        if x.field is not None:
            row, face = f"field {i + 1}", row  # no excitation of a body has a blank in its name
            named[body], sentence = with_field(named[body], x, row, face, settings.path)
            said.append(sentence)
        else:
            _among(b.group.excitations, row, "excitation")
            if x.speed_rpm is not None and b.group.excitations[row].unit != CENTRIFUGAL:
                raise UserError("the excitation is no centrifugal load; write centrifugal = true in the body, or leave "
                                "speed_rpm out", f"excitations.{row}.speed_rpm")  # fmt: skip
            if not x.is_zero and _is_still(b, "excitation", row):
                raise UserError(f"'{x.row}' moves nothing: it acts where '{b.basis.name}' is held; give it another "
                                "point, or direction, in the body.toml", "excitation")  # fmt: skip
        with at(f"excitations.{x.row or x.face}"):
            found += loads_of(x, body, row, base, blades, turning)
    moved = [(*settings.address(s.row), s.stiffness * s.motion) for s in settings.springs if s.motion]
    return tuple(named.values()), (*found, *(Load(*one) for one in moved)), said


def _outputs(settings: CaseSettings, bodies: Mapping[str, Loaded]) -> tuple[Output, ...]:
    found = []
    for m in settings.outputs:
        body, name = settings.address(m.monitor)
        with at("monitor"):
            group = body_of(bodies, body).group
        rows = group.monitors.get(name) or group.gauges.get(name)
        if rows is not None and rows.unit != "m":  # an angle or a strain has one row
            found.append(Output(body, name, rows.labels[0]))
            continue
        known = group.monitors
        _among(known, name, "monitor")
        label = f"u_{m.direction}"
        if label not in known[name].labels:
            labels = ", ".join(known[name].labels)
            raise UserError(f"monitor '{name}' reads {labels}, not {label}; choose one", "direction")
        found.append(Output(body, name, label))
    return tuple(found)


STILL = 1e-12


"""Of the largest motion of a body's rows, by which one has to move to count as free."""


def _is_still(b: Loaded, kind: Literal["excitation", "monitor"], name: str, label: str | None = None) -> bool:
    """Whether a body is held where one of its rows acts or reads: no coordinate moves it, and no force by itself.

    label: of the row; None: of all.
    """
    return all(_is_still_in(g, kind, name, label) for g in b.groups.values())


def _is_still_in(g: ModalGroup, kind: Literal["excitation", "monitor"], name: str, label: str | None) -> bool:
    held = g.excitations if kind == "excitation" else g.monitors
    if name not in held:  # a gauge
        return False
    own, statics = held[name], np.abs(np.diag(g.compliance.static))
    at = [i for i, one in enumerate(own.labels) if label in (one, None)]
    named = [f"{kind}:{name}:{own.labels[i]}" for i in at]
    yields = [statics[i] for i, one in enumerate(g.compliance.labels) if one in named]
    every = [np.abs(r.rows).max(initial=0.0) for rows in (g.interfaces, held) for r in rows.values()]
    moves = np.abs(own.rows[at]).max(initial=0.0) > STILL * max(every)
    return not moves and max(yields, default=0.0) <= STILL * statics.max(initial=0.0)


def _reads_singular(g: ModalGroup, name: str) -> bool:
    return name in g.gauges and in_singular_zone(g, g.gauges[name].point)


def _in_zone(w: Output) -> str:
    return f"Gauge '{w.monitor}' of '{w.component}' {READS_THE_MESH}; move it away, in body.toml."


def _held(w: Output) -> str:
    return (
        f"Monitor '{w.monitor}' reads no {w.label}: '{w.component}' is held there; give it another point in body.toml."
    )


def _among(rows: Mapping[str, Any], name: str, key: str) -> None:
    if name not in rows:
        raise UserError(f"the modal file has no {key} '{name}'; it has {', '.join(rows) or 'none'}", key)

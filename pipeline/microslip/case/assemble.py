"""From a case's settings and modal files to an assembly: names looked up, faces set against each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from ..contact.composed import ContactModel, compose
from ..contact.law import Law
from ..contact.settings import ContactLaw, load_contact
from ..contact.stiffness import Given
from ..data import CENTRIFUGAL, Array, Interface, ModalBasis, ModalGroup, UserError
from ..files.store import ordinary
from ..frames import rotation
from ..harmonic_balance.accuracy import more
from ..harmonic_balance.cost import GIB, aft_bytes, of_this_machine
from ..modal.speed_range import basis_at
from ..reduced.compliance import SURFACE, has_residual
from ..reduced.coordinates import first_modes, in_modes, of_density
from ..system.assembly import Assembly, Contact, ContactFace, Load, Output, preloaded_contact
from ..system.component import Component, Ring
from ..system.ground import Ground
from ..system.nodal import Nodal, nodal, static_compliance
from ..system.pairing import Pairing, Place, facing, in_ring
from ..system.spin import Spin, turned
from .compliance import Face, Springs, counted_once, residual_share, static_answer
from .driving import as_asked, damped, flow_of, loads_of, messages_of, on_springs, with_field
from .points import (
    curved_springs,
    fitting_forces,
    follows_the_force,
    nodal_patch,
    number_of_points,
    patch_of,
    pieces,
    resolved,
    waves,
)
from .settings import GROUND, BodyOfCase, CaseSettings, ContactSettings
from .thrown import thrown

T = TypeVar("T")


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
    def has_residual(self) -> bool:
        return has_residual(self.stored[min(self.stored)], self.basis.reduction)

    def face(self, name: str, path: Path | str, key: str) -> Interface:
        if name not in self.group.interfaces:
            known = ", ".join(self.group.interfaces) or "none"
            raise UserError(
                f"{path}: {key}: the modal file of '{self.basis.name}' has no interface '{name}'; it has {known}"
            )
        return self.group.interfaces[name]


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


def swept(c: ContactSettings) -> bool:
    """Whether the sweep's normal forces press a contact."""
    return c.normal_force is None and c.interference is None


def load_bodies(settings: CaseSettings, bases: Mapping[str, ModalBasis], path: Path | str) -> dict[str, Loaded]:
    """The bodies of a case at their speeds.

    Raises:
        UserError: a speed that a modal file does not have; a cyclic sector without a ring.
    """
    return {b.name: _loaded(settings, b, bases[b.name], path) for b in settings.components}


def _loaded(settings: CaseSettings, b: BodyOfCase, basis: ModalBasis, path: Path | str) -> Loaded:
    ring = settings.ring
    if basis.sectors > 1 and ring is None:
        raise UserError(
            f"{path}: body: '{basis.name}' is one of {basis.sectors} cyclic sectors, whose contacts join neighbours: "
            f"add [ring] with blades = {basis.sectors} and an engine_order; or leave [cyclic] out of its body.toml to "
            "study a lone sector"
        )
    if basis.sectors > 1 and ring is not None and ring.blades != basis.sectors:
        raise UserError(f"{path}: ring.blades: {ring.blades}, but '{basis.name}' is one of {basis.sectors} sectors")
    key = "" if settings.body else f"bodies.{b.name}."
    stored = _at_speed(b, basis, path, key)
    own_modes = has_residual(stored[min(stored)], basis.reduction)
    groups = {k: in_modes(g) for k, g in stored.items()} if own_modes else stored
    if b.mass is not None:
        groups, stored = (_of_mass(g, b.mass, basis, f"{path}: {key}mass") for g in (groups, stored))
    ratios, whose = (b.damping_ratio, key) if b.damping_ratio is not None else (settings.damping_ratio, "")
    viscous = ratios is None and basis.damping_source.startswith(("rayleigh", "matrix"))
    if ratios is not None:
        groups = damped(groups, ratios, f"{path}: {whose}damping_ratio")
    if b.weak_springs is not None:
        groups = {k: on_weak_springs(g, b.weak_springs, f"{path}: {key}weak_springs") for k, g in groups.items()}
    own = [(row, s) for s in settings.springs for body, row in [settings.address(s.row)] if body == b.name]
    groups = {k: on_springs(g, own, f"{path}: springs") for k, g in groups.items()}
    return Loaded(b, basis, stored, groups, viscous)


def _of_mass(groups: dict[int, ModalGroup], mass: float, basis: ModalBasis, key: str) -> dict[int, ModalGroup]:
    """The groups of the body with another mass (kg).

    Raises:
        UserError: its modal file does not know its mass, or it rotates.
    """
    if basis.mass <= 0:
        raise UserError(f"{key}: the modal file of '{basis.name}' does not know the body's mass; leave it out")
    try:
        return {k: of_density(g, mass / basis.mass) for k, g in groups.items()}
    except UserError as error:
        raise UserError(f"{key}: {error}") from error


def on_weak_springs(group: ModalGroup, frequency: float, key: str) -> ModalGroup:
    """The group on springs that give each of its rigid motions a frequency (Hz); elastic modes are left alone.

    Raises:
        UserError: the body has no rigid motion.
    """
    rigid = group.omega == 0
    if not rigid.any():
        raise UserError(
            f"{key}: the body is held already; weak_springs are for bodies with free = true, leave them out"
        )
    V = np.eye(len(group.M_r)) if group.to_diagonal is None else group.to_diagonal
    P = group.M_r @ V[:, rigid]
    return replace(group, K_r=group.K_r + (2 * np.pi * frequency) ** 2 * P @ P.conj().T)


def _at_speed(b: BodyOfCase, basis: ModalBasis, path: Path | str, key: str) -> dict[int, ModalGroup]:
    """Nodal diameter -> group of a stored speed (a number), or of one in rpm, stored or in the body's range."""
    speed = b.speed
    if b.speed_rpm is not None:
        try:
            basis, speed = basis_at(basis, b.speed_rpm), 0
        except UserError as error:
            raise UserError(f"{path}: {key}speed_rpm: {error}") from error
    found = {k: g for (s, k), g in basis.groups.items() if s == speed}
    if not found:
        count = len({s for s, _ in basis.groups})
        known = "one speed, number 0" if count == 1 else f"{count} speeds, numbers 0 to {count - 1}"
        raise UserError(f"{path}: {key}speed: the modal file of '{basis.name}' has {known}; correct it")
    try:
        return found if b.modes is None else {k: first_modes(g, b.modes) for k, g in found.items()}
    except UserError as error:
        raise UserError(f"{path}: {key}modes: {error}") from error


def build(settings: CaseSettings, bases: Mapping[str, ModalBasis], path: Path | str) -> Built:
    """The assembly of a case.

    Args:
        bases: body of the case -> its modal file. path: of the case file, for messages.

    Raises:
        UserError: names that no modal file holds, faces that do not face each other, stiffnesses that count the bulk
            twice.
    """
    settings = settings.model_copy(update={"contacts": tuple(_described(c, path) for c in settings.contacts)})
    bodies = load_bodies(settings, bases, path)
    settings = thrown(settings, {name: b.basis for name, b in bodies.items()}, path)
    components = _spun({name: _component(settings, b) for name, b in bodies.items()}, settings, bodies, path)
    contacts, springs, made, messages = [], [], [], list[str]()
    fitted: dict[int, Callable[[float], Contact]] = {}
    for i, c in enumerate(settings.contacts):
        pressed = fitting_forces(settings, c)
        own, k, said = _stiffness(settings, bodies, c, pressed[-1], path)
        contacts.append(own)
        springs.append(k)
        at, more = _contact(settings, bodies, components, own, k, path)
        said += more
        for force in pressed:
            contact, more = at(force)
            said += more
        made.append(contact)
        if follows_the_force(c):
            fitted[i] = partial(_of_force, at)
        messages += said
    flowing = tuple(_in_flow(settings, m, bodies[m.name], path) for m in components.values())
    flowing, loads, said = _loads(settings, bodies, flowing, path)
    messages += [*said, *messages_of(flowing, loads, settings.balanced, _blades(settings), settings.turning)]
    ring = Ring(settings.ring.blades, settings.base_order) if settings.ring else None
    outputs = _outputs(settings, bodies, path)
    messages += [_held(w) for w in outputs if _is_still(bodies[w.component], "monitor", w.monitor, w.label)]
    assembly = Assembly(flowing, tuple(made), loads, outputs, ring, settings.stuck_ratios)
    said = list(dict.fromkeys(messages))
    return Built(settings, bodies, tuple(contacts), tuple(springs), assembly, tuple(said), fitted)


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


def _body(bodies: Mapping[str, Loaded], name: str, path: Path | str, key: str) -> Loaded:
    if name not in bodies:
        raise UserError(f"{path}: {key}: there is no body '{name}' in this case; it has {', '.join(bodies)}")
    return bodies[name]


def _stiffness(
    settings: CaseSettings, bodies: Mapping[str, Loaded], c: ContactSettings, load: float | None, path: Path | str
) -> tuple[ContactSettings, Springs, list[str]]:
    """A contact's settings with the size of its patch, its springs (of a curved one at a load, N), and messages."""
    loaded, faces = _sides(settings, bodies, c, path)
    own = sized(c, faces[0], path)
    if c.is_curved:
        springs, message = _in_contact(path, c, lambda: curved_springs(own, load))
    elif c.what.rigid:
        springs, message = (0.0, 0.0, 0.0), ""
    else:
        springs, message = counted_once(c, _given(_composed(c, path)), _faces(settings, c, loaded), path)
    said = [message]
    if settings.orbit or c.what.rigid:
        stiffness = math.inf if c.what.rigid else springs[0]
        said.append(static_answer(c, stiffness, _faces(settings, c, loaded)))
    return own, springs, [words for words in said if words]


def _sides(
    settings: CaseSettings, bodies: Mapping[str, Loaded], c: ContactSettings, path: Path | str
) -> tuple[list[Loaded], list[Interface]]:
    """The one or two bodies of a contact and their interfaces."""
    ends = settings.ends(c)
    loaded = [_body(bodies, body, path, f"contacts.{c.interface}") for body, _ in ends]
    return loaded, [b.face(name, path, "contacts") for b, (_, name) in zip(loaded, ends, strict=True)]


At = Callable[[float | None], tuple["Contact", list[str]]]
"""Load (N) that a contact is fitted for, or None -> the contact, and messages."""


def _contact(
    settings: CaseSettings, bodies: Mapping[str, Loaded], components: Mapping[str, Component], c: ContactSettings,
    springs: Springs, path: Path | str,
) -> tuple[At, list[str]]:  # fmt: skip
    """A contact for any load, and messages. springs: of one that is not curved."""
    ends = settings.ends(c)
    loaded, faces = _sides(settings, bodies, c, path)
    first, second, met = ContactFace(*ends[0]), None, None
    if len(ends) == 2:
        met = _in_contact(path, c, lambda: _met(settings, c, loaded, faces))
        second = ContactFace(*ends[1], met.frame, c.against_sector)
    moved = _ground(c, loaded, faces[0])
    said, found, compliance = [f"{c.interface}: {words}" for words in met.messages] if met else [], None, None
    if c.patch == "nodal":
        found, first, second, compliance = _in_contact(
            path, c, lambda: _nodal(settings, components, c, (first, second), met)
        )
        said.append(f"{c.interface}: the patch of {len(found.points)} points moves with {found.count - 6} deformations "
                    "of the bodies besides its six rigid coordinates.")  # fmt: skip

    @lru_cache(maxsize=64)
    def at(load: float | None) -> tuple[Contact, list[str]]:
        _in_contact(path, c, lambda: _refuse_too_many(settings, c, load, found))
        k, words = _in_contact(path, c, lambda: curved_springs(c, load)) if c.is_curved else (springs, "")
        if c.fit == "exact":
            patch = _in_contact(path, c, lambda: pieces(c, load))
        else:
            whole = _in_contact(path, c, lambda: _law(c, path, k, load))
            if found is not None:
                patch = nodal_patch(c, whole, found)
            else:
                patch = _in_contact(path, c, lambda: patch_of(c, whole, c.what, faces[0], load))
        more = [words] * bool(words) + _in_contact(path, c, lambda: resolved(c, patch, load))
        press = partial(preloaded_contact, second=second, normal=c.normal_force, interference=c.interference or 0.0)
        made = _in_contact(path, c, lambda: press(c.interface, patch, first, compliance=compliance))
        return replace(made, ground=moved), more

    return at, said


def _ground(c: ContactSettings, loaded: list[Loaded], face: Interface) -> Ground | None:
    """How the other side of a contact moves; about the axis of its body, where nothing else is said."""
    if c.ground is None:
        return None
    return c.ground.ground(*_axis(loaded[-1]), face, place_of(loaded[0]))


def _axis(b: Loaded) -> tuple[Array, Array]:
    """Direction and a point of the axis of a body, in the axes of the case."""
    place = place_of(b)
    return place.turn @ b.basis.rotation_axis, place.turn @ b.basis.rotation_point + place.shift


def _spun(
    components: dict[str, Component], settings: CaseSettings, bodies: Mapping[str, Loaded], path: Path | str
) -> dict[str, Component]:
    """The components, with the inertia of the material that runs through those which ground that turns is of.

    Raises:
        UserError: it turns differently under two contacts; see `spin.turned`.
    """
    spins = dict[str, tuple[Spin, bool]]()
    for c in settings.contacts:
        if c.ground is None or c.ground.rpm is None or c.against == GROUND:
            continue
        where, name = f"{path}: contacts.{c.interface}.ground", settings.ends(c)[1][0]
        b = _body(bodies, name, path, f"contacts.{c.interface}")
        spin = c.ground.spin(*_axis(b), place_of(b))
        other, inert = spins.setdefault(name, (spin, c.ground.inertia))
        if not spin.same(other) or inert != c.ground.inertia:
            raise UserError(
                f"{where}: turns the material of '{name}' otherwise than another contact does; write the same rpm, "
                "axis, point and inertia in both"
            )
        if other is not spin or not inert:
            continue
        try:
            components[name] = turned(components[name], spin, b.basis.mesh, b.mass)
        except UserError as error:
            raise UserError(f"{where}: '{name}': {error}; or leave its inertia out: inertia = false") from error
    return components


def memory_of(settings: CaseSettings, points: int, coordinates: int) -> float:
    """Bytes that a response with a patch of so many points and coordinates takes, the finer balance that tells its
    error included; none in the book's mode, which has tables."""

    contacts = settings.ring.blades if settings.ring and settings.ring.model == "full" else 1
    finer = more(settings.balanced), 2 * settings.sampled
    return 0.0 if settings.mode == "book" else aft_bytes(points, coordinates, *finer, contacts)


def _refuse_too_many(settings: CaseSettings, c: ContactSettings, load: float | None, found: Nodal | None) -> None:
    """Raise `UserError` for points, harmonics and samples that would not fit into the memory."""
    points, coordinates = (number_of_points(c, load), 6) if found is None else (len(found.points), found.count)
    needed, given = memory_of(settings, points, coordinates) / GIB, settings.memory_limit
    has = of_this_machine() / GIB if given is None else given
    if needed > has:
        raise UserError(
            f"points: {points} with {settings.balanced} harmonics and {settings.sampled} samples need about "
            f"{needed:.3g} GiB, and {'this machine has' if given is None else 'memory_limit is'} {has:.3g}; take fewer "
            f"of them, or write memory_limit = {np.ceil(needed):g} to try it all the same"
        )


def _of_force(at: At, normal: float) -> Contact:
    return at(normal)[0]


def _nodal(
    settings: CaseSettings, components: Mapping[str, Component], c: ContactSettings,
    sides: tuple[ContactFace, ContactFace | None], met: Pairing | None,
) -> tuple[Nodal, ContactFace, ContactFace | None, Array]:  # fmt: skip
    """A patch that deforms, its sides, and the compliance of the bodies along its coordinates."""
    faces = [(components[s.component], s.interface) for s in sides if s]
    for component, name in faces:
        if component.residual_share is not None:
            raise UserError(
                f'patch: "nodal" needs the shapes of all that a body yields, but what {component.name} lacks stands in '
                f'the six rows of {name} alone; reduce it by "rubin" or "craig-bampton", or take a rigid patch'
            )
    found = nodal(faces[0], faces[1] if len(faces) > 1 else None, met, waves(settings))
    first, second = found.sides(*sides)
    ends = [(components[s.component], s, sign) for s, sign in ((first, 1.0), (second, -1.0)) if s]
    return found, first, second, static_compliance(ends, 0, settings.ring.blades if settings.ring else 0)


def _in_contact(path: Path | str, c: ContactSettings, make: Callable[[], T]) -> T:
    """What is made, or its mistake with the contact's place in the case file."""
    try:
        return make()
    except UserError as error:
        raise UserError(f"{path}: contacts.{c.interface}: {error}") from error


def _faces(settings: CaseSettings, c: ContactSettings, loaded: list[Loaded]) -> list[Face]:
    """The sides of a contact, for the compliance that the bodies hold."""
    ends = settings.ends(c)
    if len(ends) == 2 and ends[0][0] == ends[1][0] and loaded[0].basis.sectors > 1:  # the gap to the next sector
        b = loaded[0]
        k = min(b.stored)
        return [Face(b.stored[k], b.basis.reduction, ends[0][1], (), b.basis.sectors, ends[1][1])]
    found = []
    for b, (body, name) in zip(loaded, ends, strict=True):
        among = tuple(i for other in settings.contacts if other.against == GROUND
                      for own, i in settings.ends(other) if own == body)  # fmt: skip
        found.append(Face(b.stored[min(b.stored)], b.basis.reduction, name, among if len(ends) == 1 else ()))
    return found


def _met(settings: CaseSettings, c: ContactSettings, loaded: list[Loaded], faces: list[Interface]) -> Pairing:
    """How the two faces of a contact meet."""
    names, (one, two) = (c.interface, c.against), (place_of(b) for b in loaded)
    seen = two.seen_from(one)
    if not settings.ring or not c.against_sector:
        return facing(faces[0], faces[1], seen, names)
    basis = loaded[0].basis
    axis, point = one.turn.T @ basis.rotation_axis, one.turn.T @ (basis.rotation_point - one.shift)
    return in_ring(faces[0], faces[1], axis, point, settings.ring.blades, names, c.against_sector, seen)


def place_of(b: Loaded) -> Place:
    """Where a body stands in the axes of the case."""

    R = rotation(b.basis.rotation_axis, np.radians(b.settings.turn))
    centre = b.basis.rotation_point
    return Place(R, centre - R @ centre + np.asarray(b.settings.shift))


def _described(c: ContactSettings, path: Path | str) -> ContactSettings:
    """A contact with what its file says it is, where it has one.

    Raises:
        UserError: no such file, a law that cannot stand here.
    """
    where, (said, file) = f"contacts.{c.interface}", _source(c, path)
    if c.file is not None:
        c = c.model_copy(update={key: getattr(said, key) for key in ContactLaw.model_fields})
        try:
            c.what.fits(c)
            c.fits_here()
        except ValueError as error:
            raise UserError(f"{path}: {where}.file: {file}: {error}") from error
    if c.is_curved:
        return c
    found = _composed(c, path)
    if found.law is None:
        told = f"file: {file} needs" if c.file is not None else "stiffness: it needs"
        needed = "friction" if said.what.rigid else "friction and a tangential stiffness"
        raise UserError(f"{path}: {where}.{told} {needed} to make a law; add what is missing")
    if c.includes is None and found.stiffness and found.stiffness.includes == SURFACE:
        c = c.model_copy(update={"includes": SURFACE})
    return c


def _source(c: ContactSettings, path: Path | str) -> tuple[ContactLaw, Path]:
    """Who says what a contact is, and its file: its contact.toml, or the case."""
    file = Path(path).parent / str(c.file)
    if c.file is None:
        return c, Path(path)
    if not ordinary(file).is_file():
        raise UserError(f"{path}: contacts.{c.interface}.file: there is no file {file}; correct the path")
    return load_contact(file), file


def _composed(
    c: ContactSettings, path: Path | str, load: float | None = None, given: Given | None = None
) -> ContactModel:
    """The laws of a whole contact under a load, N. given: stiffnesses instead of its own."""
    said, file = _source(c, path)
    if given is not None:
        said = said.model_copy(update={"stiffness": given, "normal_stiffness": None, "tangential_stiffness": None})
    try:
        return compose(said, file, load or 0.0)
    except UserError as error:
        raise UserError(str(error).replace(f"{path}: ", f"{path}: contacts.{c.interface}.", 1)) from error


def _given(found: ContactModel) -> Springs:
    """Stiffnesses along n, t1, t2, N/m; zeros of a rigid contact."""
    if found.stiffness is None:
        return 0.0, 0.0, 0.0
    return (found.normal_0, *found.stiffness.tangential)


def _law(c: ContactSettings, path: Path | str, springs: Springs, load: float | None) -> Law:
    """The law of a whole contact with these stiffnesses.

    Raises:
        UserError: they are not its own, and its own are more than numbers.
    """
    found = None if c.is_curved else _composed(c, path, load)
    if found is None or _given(found) != springs:
        if not isinstance(c.stiffness, Given | None):
            raise UserError(
                f'includes: bulk cannot be taken out of a stiffness of kind = "{c.stiffness.kind}"; give that of the '
                'surface alone, and includes = "surface" here'
            )
        area = None if c.stiffness is None else c.stiffness.area
        found = _composed(c, path, load, Given(kind="given", normal=springs[0], tangential=springs[1:], area=area))
    assert found.law is not None
    return found.law


def sized(c: ContactSettings, face: Interface, path: Path | str) -> ContactSettings:
    """The contact with the extents of its patch; given ones that differ by more than 5 % are refused."""
    b0, h0 = (float(v) for v in face.extent)
    sizes = {"width": b0, "height": h0}
    for key, own in (("width", b0), ("height", h0)):
        given = getattr(c, key)
        if own == 0:  # a point, of a system by hand: the patch is what the case says
            sizes[key] = given or 0.0
        elif given is not None and abs(given / own - 1) > 0.05:
            raise UserError(
                f"{path}: contacts.{c.interface}.{key}: {given:g} m is not the patch's, which is {own:g} m; "
                "leave it out or correct it (metres)"
            )
    return c.model_copy(update=sizes)


def _blades(settings: CaseSettings) -> int:
    return settings.ring.blades if settings.ring else 0


def _in_flow(settings: CaseSettings, component: Component, b: Loaded, path: Path | str) -> Component:
    """The component with what the flow adds to its waves."""
    if b.settings.aerodynamics is None:
        return component
    file, where = Path(path).parent / b.settings.aerodynamics, f"{path}: bodies.{b.settings.name}.aerodynamics"
    return replace(component, aerodynamic=flow_of(file, _blades(settings), settings.turning, where))


def _loads(
    settings: CaseSettings, bodies: Mapping[str, Loaded], components: tuple[Component, ...], path: Path | str
) -> tuple[tuple[Component, ...], tuple[Load, ...], list[str]]:
    """Members with the rows of pressure fields, all loads, and what a reader should know."""
    found: list[Load] = []
    said, named = [], {m.name: m for m in components}
    base, blades, turning = settings.base_order, _blades(settings), settings.turning
    for i, x in enumerate(settings.loads):
        body, row = settings.address(x.row or x.face or "")
        b = _body(bodies, body, path, "excitation")
        if x.field is not None:
            row, face = f"field {i + 1}", row  # no excitation of a body has a blank in its name
            named[body], sentence = with_field(named[body], x, row, face, path)
            said.append(sentence)
        else:
            _among(b.group.excitations, row, path, "excitation")
            if x.speed_rpm is not None and b.group.excitations[row].unit != CENTRIFUGAL:
                raise UserError(f"{path}: excitations.{row}.speed_rpm: the excitation is no centrifugal load; write "
                                "centrifugal = true in the body, or leave speed_rpm out")  # fmt: skip
            if not x.is_zero and _is_still(b, "excitation", row):
                raise UserError(f"{path}: excitation: '{x.row}' moves nothing: it acts where '{b.basis.name}' is held; "
                                "give it another point, or direction, in the body.toml")  # fmt: skip
        try:
            found += loads_of(x, body, row, base, blades, turning)
        except UserError as error:
            raise UserError(f"{path}: excitations.{x.row or x.face}: {error}") from error
    moved = [(*settings.address(s.row), s.stiffness * s.motion) for s in settings.springs if s.motion]
    return tuple(named.values()), (*found, *(Load(*one) for one in moved)), said


def _outputs(settings: CaseSettings, bodies: Mapping[str, Loaded], path: Path | str) -> tuple[Output, ...]:

    found = []
    for m in settings.outputs:
        body, name = settings.address(m.monitor)
        group = _body(bodies, body, path, "monitor").group
        if name in group.gauges and name not in group.monitors:
            found.append(Output(body, name, group.gauges[name].labels[0]))
            continue
        known = group.monitors
        _among(known, name, path, "monitor")
        label = f"u_{m.direction}"
        if label not in known[name].labels:
            labels = ", ".join(known[name].labels)
            raise UserError(f"{path}: direction: monitor '{name}' reads {labels}, not {label}; choose one")
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


def _held(w: Output) -> str:
    return (
        f"Monitor '{w.monitor}' reads no {w.label}: '{w.component}' is held there; give it another point in body.toml."
    )


def _among(rows: Mapping[str, Any], name: str, path: Path | str, key: str) -> None:
    if name not in rows:
        raise UserError(f"{path}: {key}: the modal file has no {key} '{name}'; it has {', '.join(rows) or 'none'}")

"""The contacts of a case: what touches what, with which points, springs and law."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..contact.composed import ContactModel, compose
from ..contact.law import Law
from ..contact.settings import ContactLaw, load_contact
from ..contact.stiffness import Given
from ..data import Array, Interface
from ..errors import UserError, at, of_file
from ..files.store import ordinary
from ..harmonic_balance.accuracy import more
from ..harmonic_balance.forces import GIB, aft_bytes, of_this_machine
from ..reduced.compliance import SURFACE
from ..system.assembly import Contact, ContactFace, preloaded_contact
from ..system.component import Component
from ..system.ground import Ground
from ..system.nodal import Nodal, nodal, static_compliance
from ..system.pairing import Pairing, facing, in_ring
from ..units import percent
from .compliance import Face, Springs, counted_once, static_answer
from .loaded import Loaded, axis_of, body_of, place_of
from .points import (
    curved_springs,
    cut_at_the_outline,
    nodal_patch,
    number_of_points,
    patch_of,
    pieces,
    resolved,
    waves,
)
from .settings import GROUND, CaseSettings, ContactSettings


def swept(c: ContactSettings) -> bool:
    """Whether the sweep's normal forces press a contact."""
    return c.normal_force is None and c.interference is None


def springs_of(
    settings: CaseSettings, bodies: Mapping[str, Loaded], c: ContactSettings, load: float | None
) -> tuple[ContactSettings, Springs, list[str]]:
    """A contact's settings with the size of its patch, its springs (of a curved one at a load, N), and messages."""
    loaded, faces = sides(settings, bodies, c)
    own = sized(c, faces[0])
    if c.is_curved:
        springs, message = curved_springs(own, load)
    elif c.what.rigid:
        springs, message = (0.0, 0.0, 0.0), ""
    else:
        springs, message = counted_once(c, _given(_composed(c, settings.path)), _faces(settings, c, loaded))
    said = [message]
    if "orbit" in settings.asked or c.what.rigid:
        stiffness = math.inf if c.what.rigid else springs[0]
        said.append(static_answer(c, stiffness, _faces(settings, c, loaded)))
    return own, springs, [words for words in said if words]


def sides(
    settings: CaseSettings, bodies: Mapping[str, Loaded], c: ContactSettings
) -> tuple[list[Loaded], list[Interface]]:
    """The one or two bodies of a contact and their interfaces.

    Raises:
        UserError: one that is not there, or that supports hold.
    """
    ends = settings.ends(c)
    loaded = [body_of(bodies, body) for body, _ in ends]
    faces = [b.face(name) for b, (_, name) in zip(loaded, ends, strict=True)]
    for b, face, (_, name) in zip(loaded, faces, ends, strict=True):
        if face.held_share == 1.0:
            raise UserError(
                f"the supports of '{b.basis.name}' hold the face '{name}', so that "
                "nothing can open or slip there; free it in [[supports]] of the body, or take another face "
                '(what stands still is against = "ground")'
            )
    return loaded, faces


At = Callable[[float | None], tuple["Contact", list[str]]]


"""Load (N) that a contact is fitted for, or None -> the contact, and messages."""


def contact_at(
    settings: CaseSettings, bodies: Mapping[str, Loaded], components: Mapping[str, Component], c: ContactSettings,
    springs: Springs,
) -> tuple[At, list[str]]:  # fmt: skip
    """A contact for any load, and messages. springs: of one that is not curved."""
    ends = settings.ends(c)
    loaded, faces = sides(settings, bodies, c)
    first, second, met = ContactFace(*ends[0]), None, None
    if len(ends) == 2:
        met = _met(settings, c, loaded, faces)
        second = ContactFace(*ends[1], met.frame, c.against_sector)
    moved = _ground(c, loaded, faces[0])
    said, found, compliance = [f"{c.interface}: {words}" for words in met.messages] if met else [], None, None
    said += [f"{c.interface}: the supports of '{b.basis.name}' hold {percent(share)} of the face '{name}': nothing "
             "opens or slips there by itself." for b, face, (_, name) in zip(loaded, faces, ends, strict=True)
             if (share := face.held_share) > 0]  # fmt: skip
    if c.patch == "nodal":
        found, first, second, compliance = _nodal(settings, components, c, (first, second), met)
        said.append(f"{c.interface}: the patch of {len(found.points)} points moves with {found.count - 6} deformations "
                    "of the bodies besides its six rigid coordinates.")  # fmt: skip

    @lru_cache(maxsize=64)
    @at(f"contacts.{c.interface}")
    def under(load: float | None) -> tuple[Contact, list[str]]:
        _refuse_too_many(settings, c, load, found)
        k, words = curved_springs(c, load) if c.is_curved else (springs, "")
        if c.fit == "exact":
            patch = pieces(c, load)
        else:
            whole = _law(c, settings.path, k, load)
            if found is not None:
                patch = nodal_patch(c, whole, found)
            else:
                patch = patch_of(c, whole, c.what, faces[0], load)
        more = [words] * bool(words) + resolved(c, patch, load)
        more += cut_at_the_outline(c, patch) if found is None else []
        made = preloaded_contact(
            c.interface, patch, first, second=second, normal=c.normal_force, interference=c.interference or 0.0,
            compliance=compliance,
        )  # fmt: skip
        return replace(made, ground=moved), more

    return under, said


def _ground(c: ContactSettings, loaded: list[Loaded], face: Interface) -> Ground | None:
    """How the other side of a contact moves; about the axis of its body, where nothing else is said."""
    if c.ground is None:
        return None
    return c.ground.ground(*axis_of(loaded[-1].settings, loaded[-1].basis), face, place_of(loaded[0]))


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


def of_force(at: At, normal: float) -> Contact:
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


def described(c: ContactSettings, path: Path) -> ContactSettings:
    """A contact with what its file says it is, where it has one.

    Raises:
        UserError: no such file, a law that cannot stand here.
    """
    said, file = _source(c, path)
    if c.file is not None:
        c = c.model_copy(update={key: getattr(said, key) for key in ContactLaw.model_fields})
        try:
            c.what.fits(c)
            c.fits_here()
        except ValueError as error:
            raise UserError(f"{file}: {error}", "file") from error
    if c.is_curved:
        return c
    found = _composed(c, path)
    if found.law is None:
        key, it = ("file", file) if c.file is not None else ("stiffness", "it")
        needed = "friction" if said.what.rigid else "friction and a tangential stiffness"
        raise UserError(f"{it} needs {needed} to make a law; add what is missing", key)
    if c.includes is None and found.stiffness and found.stiffness.includes == SURFACE:
        c = c.model_copy(update={"includes": SURFACE})
    return c


def _source(c: ContactSettings, path: Path) -> tuple[ContactLaw, Path]:
    """Who says what a contact is, and its file: its contact.toml, or the case."""
    file = path.parent / str(c.file)
    if c.file is None:
        return c, path
    if not ordinary(file).is_file():
        raise UserError(f"there is no file {file}; correct the path", "file")
    return load_contact(file), file


def _composed(c: ContactSettings, path: Path, load: float | None = None, given: Given | None = None) -> ContactModel:
    """The laws of a whole contact under a load, N. given: stiffnesses instead of its own."""
    said, file = _source(c, path)
    if given is not None:
        said = said.model_copy(update={"stiffness": given, "normal_stiffness": None, "tangential_stiffness": None})
    with of_file(None if c.file is None else file):
        return compose(said, file, load or 0.0)


def _given(found: ContactModel) -> Springs:
    """Stiffnesses along n, t1, t2, N/m; zeros of a rigid contact."""
    if found.stiffness is None:
        return 0.0, 0.0, 0.0
    return (found.normal_0, *found.stiffness.tangential)


def _law(c: ContactSettings, path: Path, springs: Springs, load: float | None) -> Law:
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


def sized(c: ContactSettings, face: Interface) -> ContactSettings:
    """The contact with the extents of its patch; given ones that differ by more than 5 % are refused."""
    b0, h0 = (float(v) for v in face.extent)
    sizes = {"width": b0, "height": h0}
    for key, own in (("width", b0), ("height", h0)):
        given = getattr(c, key)
        if own == 0:  # a point, of a system by hand: the patch is what the case says
            sizes[key] = given or 0.0
        elif given is not None and abs(given / own - 1) > 0.05:
            raise UserError(
                f"{given:g} m is not the patch's, which is {own:g} m; leave it out or correct it (metres)", key
            )
    return c.model_copy(update=sizes)

"""A file whose parts touch: a body.toml for each body that it makes, and a case with its contacts
and preload."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..basis import read_basis
from ..data import Array, Indices, Joint, Mesh
from ..errors import UserError
from ..files.store import ordinary
from ..mesh import UNITS, boundary_facets, read_files, read_mesh, suffix_of
from ..mesh.chosen import bodies, of_instances, with_parts
from ..mesh.materials import NONE, Substitute
from ..mesh.raw import joined
from ..mesh.touching import touch_of, touching_facets
from .importing import (
    CAD,
    Imported,
    body_name,
    import_file,
    length_unit,
    refuse_hanging,
    refuse_taken,
    with_page,
)
from .job import open_job
from .modal import modes_stage
from .parts import (
    Part,
    Patch,
    add_lines,
    apart_cad,
    joint_lines,
    meeting,
    sentence,
    shape_of,
    with_case,
    with_names,
)
from .stage import Report
from .summary import frequency_lines


def import_deck(
    file: Path,
    folder: Path | None,
    unit: str | None,
    report: Report = lambda _: None,
    instead: Substitute = NONE,
    solids_only: bool = False,
) -> Imported:
    """Import a file; a deck whose contact pairs separate bodies becomes an assembly.

    Raises:
        UserError: unreadable files, files that are there already.
    """
    pattern = PAIRS.get(suffix_of(file))
    deck = [f.read_bytes().replace(b"\r", b"\n") for f in read_files(file) if f.is_file()] if pattern else []
    if pattern is None or not any(map(pattern.search, deck)):
        return import_file(file, folder, unit, report=report, instead=instead, solids_only=solids_only)
    unit = length_unit(unit, file)
    mesh = read_mesh(file, unit)
    if not solids_only:
        refuse_hanging(file, mesh)
    groups = bodies(mesh)
    joints, told = _between_bodies(mesh, groups)
    if not joints:
        made = import_file(file, folder, unit, report=report, instead=instead)
        made = replace(made, told=(*made.told[:-1], *told, made.told[-1]))
        return with_page(made) if told and made.mesh is not None else made
    meshes = [of_instances(mesh, group) for group in groups]
    patches = list(_patches(joints, meshes, UNITS[unit]))
    pairs = zip(patches, joints, strict=True)
    said = [*told, *(_sentence(groups, patch, joint, unit) for patch, (joint, _) in pairs)]
    force, texts = _pressed(mesh)
    return _assembly(file, folder, unit, groups, meshes, patches, [*said, *texts], force, instead)


def with_modes(made: Imported, report: Report = lambda _: None) -> Imported:
    """Solve for the modes of an imported body at once: a line of frequencies, told and on its page.

    Raises:
        UserError, NotConverged: see `modes_stage`; the body.toml stays.
    """
    if made.path.name != "body.toml":
        return made  # several bodies, or modes that are there already
    path, _ = modes_stage(open_job(made.path), report=report)
    lines = frequency_lines(read_basis(path))
    made = replace(made, told=(*made.told[:-1], *lines, made.told[-1]))
    return made if made.mesh is None else with_page(made, lines)


def import_apart(
    file: Path, folder: Path | None, unit: str | None, report: Report = lambda _: None,
    instead: Substitute = NONE,
) -> Imported:
    """The solids of a CAD file, or the parts of a mesh that share no points, as bodies in contact.

    Raises:
        UserError: see `import_parts`; a file of one part, parts that touch nowhere.
    """
    if not ordinary(file).is_file():
        raise UserError(f"{file}: there is no such file; correct the path")
    if file.suffix.lower() in CAD:
        return apart_cad(file, folder, report)
    unit = length_unit(unit, file)
    mesh = read_mesh(file, unit)
    groups = bodies(mesh)
    if len(groups) < 2:
        raise UserError(f"{file}: is one part: there is nothing to set apart; leave --apart out")
    meshes = [of_instances(mesh, group) for group in groups]
    parts = _parts(file, folder, groups)
    _, found = meeting(meshes, UNITS[unit])
    patches = [replace(with_names(parts, patch, found), alone=False) for patch in found]
    if not patches:
        raise UserError(
            f"{file}: its {len(groups)} parts touch nowhere, so there is no contact; leave --apart "
            "out"
        )
    said = [sentence(parts, patch, unit) for patch in patches]
    return _assembly(file, folder, unit, groups, meshes, patches, said, instead=instead)


def _parts(file: Path, folder: Path | None, groups: list[list[str]]) -> list[Part]:
    home = folder or Path(body_name(file.stem))
    names = [body_name("-".join(group)) for group in groups]
    return [Part(file, name, home / name / "body.toml") for name in names]


def _assembly(
    file: Path,
    folder: Path | None,
    unit: str,
    groups: list[list[str]],
    meshes: list[Mesh],
    patches: list[Patch],
    said: Sequence[str],
    force: str = "1000.0]       # N",
    instead: Substitute = NONE,
) -> Imported:
    """Write the bodies and the case of a file's parts. force: end of the line of normal forces of
    the case."""
    home, parts = folder or Path(body_name(file.stem)), _parts(file, folder, groups)
    refuse_taken(home / "case.toml", *(part.body for part in parts))
    told: list[str] = []
    with whole_or_absent(home, *(part.body.parent for part in parts)):
        for number, (part, group) in enumerate(zip(parts, groups, strict=True)):
            new = import_file(
                file, part.body.parent, unit, group, name=part.new_name, instead=instead
            )
            told += [text for text in new.told[:-1] if text not in told]
            add_lines(part, joint_lines(parts, number, patches, unit))
    shapes = [replace(shape_of(m, UNITS[unit]), points=_free(m, UNITS[unit])) for m in meshes]
    return with_case(home, parts, patches, shapes, unit, [*told, *said], force)


@contextmanager
def whole_or_absent(*folders: Path) -> Iterator[None]:
    """New folders are taken away again where what is written into them ends in a mistake."""
    new = [folder for folder in folders if not folder.exists()]
    try:
        yield
    except UserError:
        for folder in new:
            shutil.rmtree(folder, ignore_errors=True)
        raise


def _free(mesh: Mesh, metres: float) -> Array:
    """(p, 3) points of the surface that the file does not hold, in units of `metres`; all if it
    holds every one."""
    surface = np.unique(joined(f.ravel() for f in boundary_facets(mesh).values()))
    held = joined(mesh.point_sets[name] for name in mesh.supports if name in mesh.point_sets)
    free = np.setdiff1d(surface, held)
    return mesh.points[free if len(free) else surface] / metres


PAIRS = {
    ".inp": re.compile(rb"^\s*\*\s*CONTACT\s+PAIR", re.IGNORECASE | re.MULTILINE),
    ".cdb": re.compile(rb"^\s*ET\s*,.*17[1-57]\s*($|!|,)|^ETBLOCK", re.IGNORECASE | re.MULTILINE),
    **dict.fromkeys(
        (".bdf", ".nas", ".fem", ".dat"), re.compile(rb"^\s*BCTSET\b", re.IGNORECASE | re.MULTILINE)
    ),
}
"""Suffix -> what stands in decks that may have faces in contact."""


Ends = tuple[int, int]


def _between_bodies(
    mesh: Mesh, groups: list[list[str]]
) -> tuple[list[tuple[Joint, Ends]], list[str]]:
    """Pairs whose faces are of two bodies, each once, with these; and what is said of the others.
    """
    joints, told, seen = [], [], dict[frozenset[str], str]()
    instances = with_parts(mesh).instances
    for joint in mesh.joints:
        pair = f"warning: {joint.where}: '{joint.slave}' on '{joint.master}'"
        ends = [_body(mesh, instances, groups, face) for face in (joint.slave, joint.master)]
        key = frozenset((joint.slave, joint.master))
        if None in ends:
            at = (joint.slave, joint.master)[ends.index(None)]
            told.append(
                f"{pair}: '{at}' is no face of the surface of one body; no contact is written"
            )
        elif ends[0] == ends[1]:
            told.append(f"{pair}: both lie on one body, where no contact is read: they move freely")
        elif key in seen:
            told.append(f"{pair}: the pair is there already ({seen[key]}); it is taken once")
        else:
            seen[key] = joint.where
            joints.append((joint, (int(ends[0] or 0), int(ends[1] or 0))))
    return joints, told


def _body(
    mesh: Mesh, instances: Mapping[str, Indices], groups: list[list[str]], face: str
) -> int | None:
    """The number of the body that has a face; None where it is none of the surface, or of several
    bodies."""
    if face not in mesh.faces:
        return None
    points = mesh.face_points(face)
    inside = (
        np.isin(points, np.concatenate([instances[n] for n in group])).all() for group in groups
    )
    return next((number for number, whole in enumerate(inside) if whole), None)


def _patches(
    joints: list[tuple[Joint, Ends]], meshes: list[Mesh], metres: float
) -> Iterator[Patch]:
    """The contacts, both faces cut to what touches (whole where they lie apart): the same in either
    order."""
    taken: set[str] = set()
    for joint, ends in joints:
        names, bodies_ = (joint.slave, joint.master), [meshes[end] for end in ends]
        whole = [body.faces[name] for body, name in zip(bodies_, names, strict=True)]
        cut = [touching_facets(bodies_[i], bodies_[1 - i], whole[i], whole[1 - i]) for i in (0, 1)]
        apart = not all(cut)
        found = [
            touch_of(body, w if apart else c)
            for body, w, c in zip(bodies_, whole, cut, strict=True)
        ]
        faces, sets = [], []
        for i in (0, 1):
            all_of_it = apart or sum(map(len, cut[i].values())) == sum(map(len, whole[i].values()))
            plain = body_name(names[i], "contact")
            name = plain if all_of_it else body_name(f"{names[i]}-on-{names[1 - i]}", "contact")
            if name in taken and not all_of_it:
                name = f"{name[:60]}-{len(taken)}"
            taken.add(name)
            faces.append(name)
            sets.append(names[i] if all_of_it else "")
        boxes = np.array([[*t.low, *t.high] for t in found]) / metres
        area = min(t.area for t in found) / metres**2
        normal = None if any(t.normal is None for t in found) else found[0].normal
        friction = 0.2 if joint.friction is None else joint.friction
        yield Patch(
            ends, area, normal, boxes, (faces[0], faces[1]), False, friction, (sets[0], sets[1])
        )


def _sentence(groups: list[list[str]], patch: Patch, joint: Joint, unit: str) -> str:
    bodies_ = [body_name("-".join(groups[i])) for i in patch.parts]
    one, other = (f"{body}:{face}" for body, face in zip(bodies_, patch.faces, strict=True))
    mu = "friction 0.2 is a guess" if joint.friction is None else f"friction {joint.friction:g}"
    kind = "" if patch.normal is not None else "; curved, written as comments"
    cut = [
        name
        for name, whole in zip((joint.slave, joint.master), patch.sets, strict=True)
        if not whole
    ]
    less = f"; of {' and '.join(map(repr, cut))} what touches" if cut else ""
    return f"{joint.where}: {one} against {other}, {patch.area:.4g} {unit}2, {mu}{less}{kind}"


def _pressed(mesh: Mesh) -> tuple[str, list[str]]:
    """End of the line of normal forces, and what to say of it: every contact is pressed by all bolts together."""
    pressing = [(where, force) for where, force in mesh.preloads if force > 0]
    said = [f"{where}: preload {force:g} N" for where, force in pressing]
    said += [
        f"warning: {where}: the preload {force:g} N presses nothing together: not used; correct "
        "its sign"
        for where, force in mesh.preloads
        if force <= 0
    ]
    if not pressing:
        return "1000.0]       # N", said
    total = sum(force for _, force in pressing)
    return (
        f"{total:.6g}]       # N in each contact, of all bolts: write normal_force into one that "
        "has fewer",
        said,
    )

"""A deck whose parts touch: a body.toml for each body that it makes, and a case with its contacts and preload."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np

from ..data import Array, Joint, Mesh
from ..files.store import write_text
from ..mesh import UNITS, boundary_facets, read_mesh
from ..mesh.cards import files_of
from ..mesh.chosen import bodies, of_instances
from .importing import Imported, body_name, import_file, refuse_taken
from .parts import Part, Patch, Shape, add_lines, case_lines, drive
from .stage import Report


def import_deck(file: Path, folder: Path | None, unit: str, report: Report = lambda _: None) -> Imported:
    """Import a file; a deck whose instances make several bodies in contact becomes an assembly.

    Raises:
        UserError: unreadable files, files that are there already.
    """
    if file.suffix.lower() != ".inp" or unit not in UNITS or not _touches(file):
        return import_file(file, folder, unit, report=report)
    mesh = read_mesh(file, unit)
    groups = bodies(mesh) if mesh.instances else []
    joints = [(joint, ends) for joint in mesh.joints if (ends := _between(mesh, groups, joint))]
    if not joints:
        return import_file(file, folder, unit, report=report)
    home = folder or Path(body_name(file.stem))
    names = [body_name("-".join(group)) for group in groups]
    parts = [Part(file, name, home / name / "body.toml") for name in names]
    refuse_taken(home / "case.toml", *(part.body for part in parts))
    shapes = [_shape(of_instances(mesh, group), UNITS[unit]) for group in groups]
    patches = [_patch(mesh, joint, ends, UNITS[unit]) for joint, ends in joints]
    flat = [patch for patch in patches if patch.normal is not None]
    told: list[str] = []
    for number, (part, group) in enumerate(zip(parts, groups, strict=True)):
        told += import_file(file, part.body.parent, unit, group).told[:-1]
        add_lines(part, _interfaces(number, patches, joints))
    told += [_sentence(parts, patch, joint, unit) for patch, (joint, _) in zip(patches, joints, strict=True)]
    force, texts = _pressed(mesh)
    if not flat:
        return Imported(home, (*told, *texts, "warning: none of the contact pairs is flat, so no case is written"))
    rows = drive(parts[flat[0].parts[0]], shapes[flat[0].parts[0]].points, flat[0])
    lines = case_lines(home, parts, flat, shapes, unit, rows, force)
    write_text(home / "case.toml", "\n".join(lines) + "\n")
    last = f"{home / 'case.toml'}: ready. Correct its numbers, then: microslip run {shlex.quote(str(home))}"
    return Imported(home / "case.toml", (*told, *texts, last))


def _touches(file: Path) -> bool:
    found = re.compile(rb"^\s*\*\s*CONTACT\s+PAIR", re.IGNORECASE | re.MULTILINE)
    return any(found.search(f.read_bytes()) for f in files_of(file) if f.is_file())


def _between(mesh: Mesh, groups: list[list[str]], joint: Joint) -> tuple[int, int] | None:
    """The two bodies whose faces touch; None where they are one, or where a face is none of the surface."""
    ends = []
    for face in (joint.slave, joint.master):
        if face not in mesh.faces:
            return None
        points = mesh.face_points(face)
        ends += [
            number
            for number, group in enumerate(groups)
            if np.isin(points, np.concatenate([mesh.instances[n] for n in group])).all()
        ]
    return (ends[0], ends[1]) if len(ends) == 2 and ends[0] != ends[1] else None


def _shape(mesh: Mesh, metres: float) -> Shape:
    surface = np.unique(np.concatenate([f.ravel() for f in boundary_facets(mesh).values()]))
    points = mesh.points[surface] / metres
    return Shape(points, np.array([points.min(axis=0), points.max(axis=0)]))


def _patch(mesh: Mesh, joint: Joint, ends: tuple[int, int], metres: float) -> Patch:
    """The contact by its slave face."""
    area, normal = _area(mesh, joint.slave)
    boxes = []
    for face in (joint.slave, joint.master):
        points = mesh.points[mesh.face_points(face)] / metres
        boxes.append([*points.min(axis=0), *points.max(axis=0)])
    faces = (body_name(joint.slave, "contact"), body_name(joint.master, "contact"))
    friction = 0.2 if joint.friction is None else joint.friction
    return Patch(ends, area / metres**2, normal, np.array(boxes), faces, True, friction)


def _area(mesh: Mesh, face: str) -> tuple[float, Array | None]:
    """m2, and the outward normal, None where the face is curved."""
    from ..fem.discretise import face_blocks

    vectors = np.concatenate([b.area.reshape(-1, 3) for b in face_blocks(mesh, face)])
    area, mean = float(np.linalg.norm(vectors, axis=1).sum()), vectors.sum(axis=0)
    return area, mean / np.linalg.norm(mean) if np.linalg.norm(mean) > 0.999 * area else None


def _interfaces(number: int, patches: list[Patch], joints: list[tuple[Joint, tuple[int, int]]]) -> list[str]:
    """Lines of a body.toml: the interfaces of its contacts, each once; curved ones as comments."""
    lines: dict[str, list[str]] = {}
    for patch, (joint, ends) in zip(patches, joints, strict=True):
        for end, name, face in zip(ends, patch.faces, (joint.slave, joint.master), strict=True):
            if end == number:
                mark = "" if patch.normal is not None else "#"
                quoted = face.replace("\\", "\\\\").replace('"', '\\"')
                lines[name] = ["", f"{mark}[[interfaces]]", f'{mark}name = "{name}"', f'{mark}face = "{quoted}"']
    return [line for own in lines.values() for line in own]


def _sentence(parts: list[Part], patch: Patch, joint: Joint, unit: str) -> str:
    one, other = (f"{parts[i].name}:{face}" for i, face in zip(patch.parts, patch.faces, strict=True))
    mu = "friction 0.2 is a guess" if joint.friction is None else f"friction {joint.friction:g}"
    kind = "" if patch.normal is not None else "; curved, written as comments"
    return f"{joint.where}: {one} against {other}, {patch.area:.4g} {unit}2, {mu}{kind}"


def _pressed(mesh: Mesh) -> tuple[str, list[str]]:
    """End of the line of normal forces, and what to say of it: every contact is pressed by all bolts together."""
    if not mesh.preloads:
        return "1000.0]       # N", []
    total = sum(abs(force) for _, force in mesh.preloads)
    said = [f"{where}: preload {force:g} N" for where, force in mesh.preloads]
    return f"{total:.6g}]       # N in each contact, of all bolts: write normal_force into one that has fewer", said

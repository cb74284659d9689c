"""Labels and colours that a CAD program left on surfaces."""

from __future__ import annotations

import re
from pathlib import Path

import gmsh

Marks = dict[int, tuple[str, tuple[int, int, int] | None]]  # surface -> label, colour
STEP_KINDS = {
    "PLANE": "Plane",
    "CYLINDRICAL_SURFACE": "Cylinder",
    "CONICAL_SURFACE": "Cone",
    "SPHERICAL_SURFACE": "Sphere",
    "TOROIDAL_SURFACE": "Torus",
}


def marks_of(path: Path) -> Marks:
    """Label and colour of every surface; gmsh shows colours, face names of a STEP come from its text."""
    marks: Marks = {}
    bodies = {short_name(*solid) for solid in gmsh.model.getEntities(3)}  # gmsh repeats them on coloured faces
    for _, tag in gmsh.model.getEntities(2):
        red, green, blue, alpha = gmsh.model.getColor(2, tag)
        label = short_name(2, tag)
        marks[tag] = ("" if label in bodies else label, (red, green, blue) if alpha else None)  # no colour: alpha 0
    if path.suffix.lower() in (".step", ".stp"):
        written = step_faces(path.read_text(encoding="latin-1"))
        for solid in gmsh.model.getEntities(3):
            for tag, label in step_labels(solid, written).items():
                marks[tag] = (marks[tag][0] or label, marks[tag][1])
    return marks


def short_name(dim: int, tag: int) -> str:
    """Last part of the path under which gmsh shows a shape of an assembly."""
    return gmsh.model.getEntityName(dim, tag).rsplit("/", 1)[-1]


def step_faces(text: str) -> list[list[tuple[str, str]]]:
    """For every solid of a STEP text the (kind, name) of its faces, in the order OpenCASCADE reads them."""
    records = dict(re.findall(r"#(\d+)\s*=\s*(\w*\s*\((?:[^';]|'[^']*')*\))\s*;", text))

    def references(record: str) -> list[str]:
        return re.findall(r"#(\d+)", re.sub(r"'[^']*'", "", record))

    def shell_faces(record: str) -> list[str]:
        below = [records.get(r, "") for r in references(record)]
        faces = [r for r in below if re.match("ADVANCED_FACE|FACE_SURFACE", r)]
        return faces or [face for r in below if "CLOSED_SHELL" in r for face in shell_faces(r)]

    def kind_and_name(face: str) -> tuple[str, str]:
        surface = records.get(references(face)[-1], "")
        name = re.search(r"'((?:[^']|'')*)'", face)
        return STEP_KINDS.get(surface.split("(")[0].strip(), "other"), name[1] if name else ""

    solids = [r for r in records.values() if re.match("MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS", r)]
    return [[kind_and_name(face) for face in shell_faces(solid)] for solid in solids]


def step_labels(solid: tuple[int, int], written: list[list[tuple[str, str]]]) -> dict[int, str]:
    """Names for the surfaces of one solid, if the sequence of surface kinds leaves no doubt which solid it is."""
    tags = sorted(tag for _, tag in gmsh.model.getBoundary([solid], combined=False, oriented=False))
    known = set(STEP_KINDS.values())
    kinds = [kind if (kind := gmsh.model.getType(2, tag)) in known else "other" for tag in tags]
    names = {tuple(name for _, name in faces) for faces in written if [kind for kind, _ in faces] == kinds}
    return dict(zip(tags, names.pop(), strict=True)) if len(names) == 1 else {}

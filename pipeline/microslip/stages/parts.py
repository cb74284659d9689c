"""Parts that touch: a body.toml each with the faces where they meet, and a case with the contacts between them."""

from __future__ import annotations

import json
import os
import shlex
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Array, Mesh
from ..errors import UserError
from ..files.store import ordinary, write_text
from ..mesh import UNITS, boundary_facets, read_mesh
from ..mesh.materials import NONE, Substitute
from ..mesh.touching import touches
from ..settings.toml import load_toml
from .importing import (
    CAD,
    MATRICES,
    Imported,
    body_name,
    cad_result,
    import_file,
    length_unit,
    refuse_taken,
)
from .stage import Report

NORMAL_STIFFNESS, TANGENTIAL_STIFFNESS = 4e11, 2e11
"""N/m3, per area of a joint of machined steel: where an own case begins, not a property of it."""

STEEL = 5170.0
"""m/s, speed of sound in a bar."""


@dataclass(frozen=True)
class Part:
    """One part of an assembly: its file, its name there, and the body.toml around it; there: before
    anything is written."""

    file: Path
    name: str
    body: Path
    there: bool = False

    @property
    def keys(self) -> dict[str, Any]:
        """The keys of the body.toml."""
        return tomllib.loads(self.body.read_text(encoding="utf-8"))

    @property
    def new_name(self) -> str:
        """Of the body that is written: with that of the assembly's folder, so that parts of one name
        in two assemblies are two bodies; that of the part alone if it would be too long."""
        both = f"{body_name(self.body.parent.parent.resolve().name)}-{self.name}"
        return both if len(both) <= 64 else self.name


@dataclass(frozen=True)
class Shape:
    """points: (p, 3) of the surface of a part, at which it may be driven. box: (2, 3) low and high corner of it all."""

    points: Array
    box: Array


@dataclass(frozen=True)
class Patch:
    """Where two parts touch, lengths in the parts' unit.

    Attributes:
        parts: their numbers. area, normal: (3,) None where it is curved. boxes: (2, 6) low and high corner in either
            part. faces: its name in either part. alone: whether these two parts touch nowhere else. friction: its
            coefficient. sets: of either part's file, those which the faces are wholly.
    """

    parts: tuple[int, int]
    area: float
    normal: Array | None
    boxes: Array
    faces: tuple[str, str] = ("", "")
    alone: bool = True
    friction: float = 0.2
    sets: tuple[str, str] = ("", "")


def import_parts(
    files: Sequence[Path], folder: Path | None, unit: str | None, report: Report = lambda _: None,
    instead: Substitute = NONE,
) -> Imported:
    """Write a body.toml around each of several files, with its faces where it touches the others, and a case.toml.

    Args:
        files: CAD files or meshes, all of one kind, in the same coordinates, or folders with a body.toml around one, to
            whose end lines are added. folder: of the case, and of those of the new bodies; by default of all the names.
        unit: of lengths.

    Raises:
        UserError: unreadable files, nothing that touches, files that are there already.
    """
    home, parts = _parts(files, folder)
    unit = _unit_of(files, unit)
    report("where the parts touch")
    shapes, patches = _found(parts, unit)
    if not patches:
        raise UserError(
            f"{' and '.join(map(str, files))}: touch nowhere; they have to lie in the same coordinates, without a gap "
            "between them and without overlap"
        )
    _refuse_named(parts, patches)
    told: list[str] = []
    for number, part in enumerate(parts):
        if not part.there:
            written = import_file(
                part.file, part.body.parent, unit, report=report, name=part.new_name, instead=instead
            ).told[:-1]
            told += [text.splitlines()[0] for text in written]  # a table of surfaces stands in the body.toml as well
        add_lines(part, joint_lines(parts, number, patches, unit))
    told += [sentence(parts, patch, unit) for patch in patches]
    return with_case(home, parts, patches, shapes, unit, told)


def with_case(
    home: Path, parts: Sequence[Part], patches: Sequence[Patch], shapes: Sequence[Shape], unit: str, told: list[str],
    force: str = "1000.0]       # N",
) -> Imported:  # fmt: skip
    """The parts with a case.toml of those contacts that are flat. force: end of the line of its normal forces."""
    flat, case = [patch for patch in patches if patch.normal is not None], home / "case.toml"
    if not flat:
        return Imported(home, (*told, "warning: none of the contacts is flat, so no case is written"))
    driven = flat[0].parts[0]
    rows = drive(parts[driven], shapes[driven].points, flat[0])
    write_text(case, "\n".join(case_lines(home, parts, flat, shapes, unit, rows, force)) + "\n")
    last = f"{case}: ready. Correct its numbers, then: microslip run {shlex.quote(str(home))}"
    return Imported(case, (*told, last))


def _parts(files: Sequence[Path], folder: Path | None) -> tuple[Path, list[Part]]:
    """The folder of an assembly, and its parts, none of which would take the place of anything.

    Raises:
        UserError: see `import_parts`.
    """
    for file in files:
        if not (file / "body.toml" if file.is_dir() else ordinary(file)).is_file():
            raise UserError(f"{file}: there is no such file, or no body.toml in this folder; correct the path")
        _refuse_again(file, files)
    names = [body_name(f.resolve().name if f.is_dir() else f.stem) for f in files]
    home = folder or Path("-".join(names)[:64].rstrip("-._"))
    parts = [_part(f, n, home) for f, n in zip(files, names, strict=True)]
    names = [part.name for part in parts]
    if twice := sorted({n for n in names if names.count(n) > 1}):
        raise UserError(f"{twice[0]}: is the name of two of these parts; give the files names of their own")
    refuse_taken(home / "case.toml", *(part.body for part in parts if not part.there))
    return home, parts


def _refuse_again(folder: Path, files: Sequence[Path]) -> None:
    """Refuse a folder whose body is around one of the files: that import is repeated."""
    if not folder.is_dir():
        return
    geometry = load_toml(folder / "body.toml").get("geometry", {})
    own = {(folder / geometry[k]).resolve() for k in ("cad", "mesh") if isinstance(geometry.get(k), str)}
    if again := [file for file in files if file.resolve() in own]:
        raise UserError(
            f"{folder / 'body.toml'}: is there already, made of {again[0]}; give another folder as last argument "
            "(nothing was changed)"
        )


def _refuse_named(parts: Sequence[Part], patches: Sequence[Patch]) -> None:
    """Refuse bodies that have a face or an interface under the name of a new one."""
    for patch in patches:
        for i, face in zip(patch.parts, patch.faces, strict=True):
            keys = parts[i].keys if parts[i].there else {}
            taken = {
                row.get("name") for row in (*keys.get("interfaces", ()), *keys.get("geometry", {}).get("faces", ()))
            }
            if face in taken:
                raise UserError(f"{parts[i].body}: has a face or an interface '{face}' already; rename or remove it")


def apart_cad(file: Path, folder: Path | None, report: Report = lambda _: None) -> Imported:
    """The solids of one CAD file as parts of an assembly, each in a file of its own beside its body.toml.

    Raises:
        UserError: see `import_parts`; a file of one solid.
    """
    home = folder or Path(body_name(file.stem))
    if not ordinary(file).is_file():
        raise UserError(f"{file}: there is no such file; correct the path")
    refuse_taken(home)
    report(f"solids of {file}")
    with tempfile.TemporaryDirectory() as scratch:
        names = json.loads(cad_result(["--apart", str(file.resolve()), scratch]))
        made = [home / name / f"{name}.step" for name in names]
        for new in made:
            write_text(new, (Path(scratch) / new.name).read_text(encoding="utf-8"))
    return import_parts(made, home, "mm", report)


def _unit_of(files: Sequence[Path], asked: str | None) -> str:
    """The unit of lengths: that of the bodies that are there, which must be one, else the one asked for."""
    unit = length_unit(asked, next((f for f in files if f.is_file()), files[0]))
    own = {f: tomllib.loads((f / "body.toml").read_text())["length_unit"] for f in files if f.is_dir()}
    if len({*own.values()}) > 1 or len(own) not in (0, len(files)) and unit not in own.values():
        said = ", ".join(f"{f} in {u}" for f, u in own.items())
        raise UserError(f"{said}: parts of one assembly need one unit of length (of files: --unit)")
    return next(iter(own.values()), unit)


def _part(file: Path, name: str, home: Path) -> Part:
    if not file.is_dir():
        return Part(file, name, home / name / "body.toml")
    part = Part(file, name, file / "body.toml", there=True)
    geometry = part.keys.get("geometry", {})
    source = geometry.get("cad") or geometry.get("mesh")
    if source is None:
        raise UserError(f"{part.body}: geometry: only bodies with cad or mesh can be laid beside each other")
    return Part(file / source, str(part.keys.get("name", name)), part.body, there=True)


def _found(parts: Sequence[Part], unit: str) -> tuple[list[Shape], list[Patch]]:
    """The shapes of the parts, and the patches, with names of their faces."""
    kinds = {part.file.suffix.lower() in CAD for part in parts}
    named = ", ".join(str(part.file) for part in parts)
    if all(part.file.suffix.lower() in MATRICES for part in parts):
        raise UserError(
            f"{named}: one file of matrices is imported at a time; name that of the stiffness alone, the mass beside "
            "it is found by its name"
        )
    if len(kinds) > 1 or any(part.file.suffix.lower() in MATRICES for part in parts):
        raise UserError(
            f"{named}: where they touch can be told of CAD files or of meshes, "
            "all of one kind; import the others one by one"
        )
    files = [part.file for part in parts]
    shapes, patches = (
        _of_cad(files, unit) if kinds == {True} else meeting([read_mesh(f, unit) for f in files], UNITS[unit])
    )
    return shapes, [with_names(parts, patch, patches) for patch in patches]


def with_names(parts: Sequence[Part], patch: Patch, patches: Sequence[Patch]) -> Patch:
    """The patch with its faces named after the other part, numbered where the two have several."""
    same = [p for p in patches if p.parts == patch.parts]
    end = "" if len(same) == 1 else f"-{1 + [p is patch for p in same].index(True)}"
    one, other = (parts[i].name for i in patch.parts)
    return replace(patch, faces=(f"{other[:60]}{end}", f"{one[:60]}{end}"), alone=len(same) == 1)


def _of_cad(files: Sequence[Path], unit: str) -> tuple[list[Shape], list[Patch]]:
    found = json.loads(cad_result(["--touches", unit, *map(str, files)]))
    made = []
    for touch in found["touches"]:
        normal = None if touch["normal"] is None else np.array(touch["normal"])
        made.append(Patch(tuple(touch["parts"]), touch["area"], normal, np.array([touch["box"]] * 2)))
    pairs = zip(found["corners"], found["boxes"], strict=True)
    return [Shape(np.array(corners), np.reshape(box, (2, 3))) for corners, box in pairs], made


def meeting(meshes: Sequence[Mesh], scale: float) -> tuple[list[Shape], list[Patch]]:
    """The shapes of meshes (m), and where they touch each other, in units of `scale` metres."""
    made = []
    for i, j in combinations(range(len(meshes)), 2):
        theirs = touches(meshes[j], meshes[i])
        for own in touches(meshes[i], meshes[j]) if theirs else ():
            met = min(theirs, key=lambda t: float(np.linalg.norm(t.low + t.high - own.low - own.high)))
            boxes = np.array([[*t.low, *t.high] for t in (own, met)]) / scale
            made.append(Patch((i, j), own.area / scale**2, own.normal, boxes))
    return [shape_of(mesh, scale) for mesh in meshes], made


def shape_of(mesh: Mesh, scale: float) -> Shape:
    """The shape of a mesh (m), in units of `scale` metres."""
    surface = np.unique(np.concatenate([f.ravel() for f in boundary_facets(mesh).values()]))
    points = mesh.points[surface] / scale
    return Shape(points, np.array([points.min(axis=0), points.max(axis=0)]))


def joint_lines(
    parts: Sequence[Part], number: int, patches: Sequence[Patch], unit: str
) -> list[str]:
    """Lines of a body.toml: the faces and interfaces where a part touches others, each once.

    Curved ones are comments. A face that is wholly a set of the file needs no rule.
    """
    lines: list[str] = []
    written: set[str] = set()
    for patch in patches:
        if number not in patch.parts or patch.faces[patch.parts.index(number)] in written:
            continue
        mine = patch.parts.index(number)
        name = patch.faces[mine]
        written.add(name)
        other, mark = parts[patch.parts[1 - mine]], "" if patch.normal is not None else "#"
        beside = Path(os.path.relpath(other.file.resolve(), parts[number].body.parent.resolve())).as_posix()
        if patch.sets[mine]:
            face = json.dumps(patch.sets[mine], ensure_ascii=False)
            lines += ["", f"{mark}[[interfaces]]", f'{mark}name = "{name}"', f"{mark}face = {face}"]
            continue
        lines += ["", f"{mark}[[geometry.faces]]       # where it touches {other.name}, {patch.area:.4g} {unit}2"]
        lines += [f'{mark}name = "{name}"', f"{mark}touching = {json.dumps(beside)}"]
        if not patch.alone:
            low, high = patch.boxes[mine].reshape(2, 3)
            more = 0.01 * float(np.linalg.norm(high - low))
            lines += [f"{mark}box = [{', '.join(f'{v:.6g}' for v in (*(low - more), *(high + more)))}]"]
        lines += [f"{mark}[[interfaces]]", f'{mark}name = "{name}"', f'{mark}face = "{name}"']
    return lines


def add_lines(part: Part, lines: Sequence[str]) -> None:
    """Write lines at the end of a body.toml."""
    if lines:
        write_text(part.body, part.body.read_text(encoding="utf-8").rstrip("\n") + "\n" + "\n".join(lines) + "\n")


def sentence(parts: Sequence[Part], patch: Patch, unit: str) -> str:
    one, other = (parts[i].name for i in patch.parts)
    where = f"{one} touches {other} over {patch.area:.4g} {unit}2"
    return f"{where}: " + (
        f"{one}:{patch.faces[0]} against {other}:{patch.faces[1]}"
        if patch.normal is not None
        else "a curved patch, written as comments: uncomment them and give it curvature or patch in a case"
    )


def drive(part: Part, corners: Array, patch: Patch) -> tuple[str, str]:
    """Excitation and monitor of a part: its own first ones, or new ones at the point farthest from a patch."""
    names = [next((row["name"] for row in part.keys.get(key, ())), "") for key in ("excitations", "monitors")]
    middle = (patch.boxes[0, :3] + patch.boxes[0, 3:]) / 2
    at = ", ".join(f"{v:.6g}" for v in corners[np.linalg.norm(corners - middle, axis=1).argmax()] + 0.0)
    n = np.zeros(3) if patch.normal is None else patch.normal
    lines = []
    if not names[0]:
        lines += ["", "[[excitations]]           # a force of 1 N, as far from the contact as can be:"]
        lines += ["                          # move it, and the probe, when you clamp the body there"]
        along = ", ".join(f"{v:.6g}" for v in np.round(n, 9) + 0.0)
        lines += ['name = "shaker"', f"point = [{at}]", f"direction = [{along}]"]
    if not names[1]:
        lines += ["", "[[monitors]]", 'name = "probe"', f"point = [{at}]"]
    add_lines(part, lines)
    return names[0] or "shaker", names[1] or "probe"


def case_lines(
    home: Path, parts: Sequence[Part], patches: Sequence[Patch], shapes: Sequence[Shape], unit: str,
    rows: tuple[str, str], pressed: str,
) -> list[str]:  # fmt: skip
    """Lines of a case.toml of the parts and their flat contacts. pressed: end of the line of its normal forces."""
    driven, n = parts[patches[0].parts[0]].name, patches[0].normal
    axis = "xyz"[int(np.abs(n).argmax())] if n is not None else "x"
    low, high = _band(shapes, UNITS[unit])
    springs = [f", weak_springs = {low / 100:.2g}" * bool(part.keys.get("free")) for part in parts]
    called = [(part.name, str(part.keys["name"])) for part in parts]
    named = [f'name = "{n}"' + f', body = "{own}"' * (own != n) for n, own in called]
    bodies = ",\n".join(f"    {{ {n}{s} }}" for n, s in zip(named, springs, strict=True))
    lines = [
        f'name = "{body_name(home.resolve().name)}"',
        f'excitation = "{driven}:{rows[0]}"   # move it and the monitor, in its body.toml, when you clamp there',
        "amplitude = 1.0             # N",
        f'monitor = "{driven}:{rows[1]}"',
        f'direction = "{axis}"',
        "bodies = [                  # weak_springs, Hz: of what nothing holds; leave them out of supported bodies",
        bodies,
        "]",
    ]
    for patch in patches:
        one, other = (f"{parts[i].name}:{face}" for i, face in zip(patch.parts, patch.faces, strict=True))
        area = patch.area * UNITS[unit] ** 2
        lines += [
            "", "[[contacts]]", f'interface = "{one}"', f'against = "{other}"',
            f"normal_stiffness = {NORMAL_STIFFNESS * area:.2g}   # N/m of the whole patch: a guess by its area",
            f"tangential_stiffness = {TANGENTIAL_STIFFNESS * area:.2g}", f"friction = {patch.friction:g}",
            "points = [3, 3]",
        ]  # fmt: skip
    return [
        *lines,
        "",
        "# A guess for free parts, about the first bending of a beam as long as all of them:",
        "# when you clamp one, set the band anew; microslip modes tells the frequencies.",
        "[sweep]",
        f"start = {float(f'{low:.2g}'):g}",
        f"stop = {float(f'{high:.2g}'):g}",
        "points = 100",
        f"normal_forces = [{pressed}",
    ]


def _band(shapes: Sequence[Shape], scale: float) -> tuple[float, float]:
    """Hz, from half to three times the first frequency of a free beam of steel: as long as all parts together, as
    thick as the thinnest."""
    length = scale * float(np.ptp(np.concatenate([shape.box for shape in shapes]), axis=0).max())
    thickness = scale * min(float(np.ptp(shape.box, axis=0).min()) for shape in shapes)
    first = 4.730**2 / (2 * np.pi * np.sqrt(12)) * STEEL * thickness / length**2
    return first / 2, 3 * first

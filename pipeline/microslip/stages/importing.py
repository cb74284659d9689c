"""From a CAD file or another program's file to a body folder: a body.toml that runs as it stands."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shlex
import subprocess
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ..basis import write_basis
from ..data import (
    Array,
    BodyLoad,
    FacetLoad,
    Indices,
    Material,
    Mesh,
    NodalLoad,
    RigidLink,
    SpinLoad,
)
from ..errors import UserError
from ..files.store import ordinary, write_text
from ..frames import rotation
from ..mesh import UNITS, likely_unit, mesh_problems, read_mesh, suffix_of, unit_of
from ..mesh.chosen import of_instances
from ..mesh.materials import NONE, STANDS, Substitute
from ..mesh.raw import Unread, in_its_line, joined, refused
from ..mesh.unv import UNIVERSAL, has_solids
from ..plausible import density
from ..units import SYSTEMS, to_rpm, usual_system
from .meshing import run_apart
from .stage import Report

MATRICES = (".mtx", ".mm", ".mat", ".h5", ".hdf5", ".npz", ".op4", ".pch", ".dmig", ".sti", ".mas")
_NODES = (".inp", ".cdb", ".csv", ".txt", ".bdf", ".dat", ".msh", ".med", ".unv")
_MESHES = (".inp", ".cdb", ".msh", ".med", ".unv")
CAD = (".step", ".stp", ".brep", ".iges", ".igs")
KINDS = {
    **dict.fromkeys(CAD, "a CAD file"), **dict.fromkeys((s for s in MATRICES if s[1] != "h"), "a file of matrices"),
    ".inp": "a deck of Abaqus or CalculiX", ".cdb": "a deck of Ansys", ".bdf": "a deck of Nastran",
    ".msh": "a mesh of gmsh", ".unv": "a universal file", ".uff": "a universal file", ".toml": "a settings file",
}  # fmt: skip
"""What a file is by its suffix, where that is no modal file's."""


@dataclass(frozen=True)
class Imported:
    """The body file that was written, and what to say of it.

    Attributes:
        mesh: of the file, for its page; None of CAD files, matrices, measured modes and assemblies.
    """

    path: Path
    told: tuple[str, ...]
    file: Path | None = None
    mesh: Mesh | None = None


def import_file(
    file: Path,
    folder: Path | None,
    unit: str | None = None,
    instances: Sequence[str] = (),
    report: Report = lambda _: None,
    name: str = "",
    instead: Substitute = NONE,
    solids_only: bool = True,
) -> Imported:
    """Write a body.toml around a CAD file, a mesh or matrices; nothing is copied, the file is named where it lies.

    Args:
        file: a CAD file, a mesh with or without materials, or the stiffness matrix of a pair. folder: of the new
            body.toml; by default one of the file's name here. unit: of its lengths; None: that which
            the file tells, else mm. instances: those of a deck that are the body, all if none.
        name: of the body; the folder's if not given. instead: of numbers that the file's materials lack, steel's where
            it has none. solids_only: whether beams and shells that are joined to the solids may be left out.

    Raises:
        UserError: unreadable, or there is a body.toml already.
    """
    if not ordinary(file).is_file():
        raise UserError(f"{file}: there is no such file; correct the path")
    unit = length_unit(unit, file)
    name = name or body_name((folder.resolve().name if folder else "") or file.stem)
    modes = False
    if file.suffix.lower() in UNIVERSAL:
        from ..exchange.measured import holds_modes, holds_results

        if holds_results(file) and not has_solids(file):
            return _measured(file, (folder or Path(name)) / "basis.h5", unit, name)
        modes = holds_modes(file)
    target = (folder or Path(name)) / "body.toml"
    refuse_taken(target, *[target.with_name(FOREIGN)] * modes)
    kind = suffix_of(file)
    of_mesh = partial(_mesh, instances=instances, instead=instead, solids_only=solids_only)
    made = _matrices if kind in MATRICES else of_mesh
    if kind in CAD:
        made = partial(_cad, report=report)
    report(f"reading {file}")
    if made is _matrices and _in_metres(file):
        unit = "m"
    mesh: Mesh | None
    with in_its_line(file):
        lines, told, mesh = (*made(file, target.parent, unit), None)[:3]
    head = [f'name = "{name}"', f'length_unit = "{unit}"']
    write_text(target, "\n".join([*head, *lines]) + "\n")
    if modes:
        told = [*told, *_foreign(file, target.with_name(FOREIGN), unit, name)]
    missing = "interfaces" if "[[supports]]" in lines else "supports, interfaces"
    last = f"{target}: ready. Add {missing} and loads, then: microslip run {shlex.quote(str(target.parent))}"
    found = Imported(target, (*told, last), file, mesh)
    return found if mesh is None else with_page(found)


def with_page(imported: Imported, modes: Sequence[str] = ()) -> Imported:
    """The same with its page beside the body.toml: what the file holds, what was taken, what is left to do.

    Args:
        modes: lines of the first frequencies among what was told, if there are some.
    """
    from ..report.imported import import_page, marked_faces

    assert imported.file is not None and imported.mesh is not None
    folder, drawn = imported.path.parent, None
    with contextlib.suppress(ImportError):
        from ..pictures.sketch import body_sketch

        drawn = body_sketch(imported.mesh, marked_faces(imported.mesh), folder / "import.png")
    page = str(folder / "import.html")
    told = [text for text in imported.told[:-1] if not text.startswith(page)]
    said = [text for text in told if text not in modes]
    text = import_page(imported.file, imported.mesh, said, drawn, modes, str(imported.path))
    write_text(folder / "import.html", text)
    if drawn is not None:
        drawn.unlink()  # it is in the page
    return replace(imported, told=(*told, f"{page}: the same as a page", imported.told[-1]))


def length_unit(unit: str | None, file: Path) -> str:
    """The unit of lengths that was asked for, else that which the file tells, or its densities, else mm.

    Raises:
        UserError: an unknown one.
    """
    if unit is not None and unit not in UNITS:
        raise UserError(f"--unit {unit}: unknown unit of length; choose one of {', '.join(UNITS)}")
    return unit or unit_of(file) or likely_unit(file) or "mm"


def substitute(density: float | None, young: float | None, poisson: float | None) -> Substitute:
    """What --density, --young and --poisson say.

    Raises:
        UserError: numbers that no material has.
    """
    for key, value, least, most in (
        ("density", density, 0, np.inf), ("young", young, 0, np.inf), ("poisson", poisson, -1, 0.5),
    ):  # fmt: skip
        if value is not None and not least < value < most:
            raise UserError(f"--{key} {value:g}: no material has that; it is in SI, as 7850, 2.1e11 and 0.3 of steel")
    return Substitute(density, young, poisson)


def refuse_taken(*new: Path) -> None:
    """Raise `UserError` of the first of new files that is there already."""
    for path in new:
        if path.exists():
            raise UserError(f"{path}: is there already; give another folder as last argument (nothing was changed)")


def body_name(stem: str, none: str = "part") -> str:
    """The name that a body, or an interface, has by that of its folder, file or face."""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", stem).lstrip("-._")[:64] or none


FOREIGN = "modes_of_file.h5"
"""Modal file of the modes that stand in a mesh file."""


def _measured(file: Path, target: Path, unit: str, name: str) -> Imported:
    """Modes of a test become a modal file at once: nothing is left to solve."""
    from ..exchange.measured import read_measured

    refuse_taken(target)
    basis, told = read_measured(file, unit, name)
    write_basis(target, basis)
    group = basis.groups[0, 0]
    first, last = group.frequency[[0, -1]]
    size = f"{file}: {group.n_modes} modes from {first:.6g} to {last:.6g} Hz at {basis.mesh.n_points} points"
    end = f"{target}: ready. Beside a computed one: microslip compare {target} OTHER.h5"
    return Imported(target, (size, *told, end))


def _foreign(file: Path, target: Path, unit: str, name: str) -> list[str]:
    """Modes that stand in a mesh file become a modal file beside the body, to compare with."""
    try:
        made = _measured(file, target, unit, name)
    except UserError as error:
        return [f"note: the modes of the file are left aside: {error}"]
    body = Path("build") / name / "basis.h5"
    return [made.told[0], f"{target}: these modes. Beside those of the body: microslip compare {target} {body}"]


def _beside(file: Path, folder: Path) -> str:
    """The file's path from the folder, as TOML text."""
    return json.dumps(Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix())


def _sets(mesh: Mesh, held: bool = False) -> list[str]:
    """Supports (unless those of the file are there) and interfaces to choose from, as comments."""
    names = sorted(n for n in {*mesh.faces, *mesh.point_sets} if len(mesh.face_points(n)) < mesh.n_points)
    names = [n for n in names if not held or n not in mesh.supports]
    if not names:
        return ["# The file names no sets to make faces of: give them by box, see docs/body_toml.md."]
    lines = ["", "# Sets of the file: " + ", ".join(names)]
    first = json.dumps(next((n for n in names if n in mesh.faces), names[0]))
    if not held:
        lines += ["#[[supports]]             # then remove free = true at the top", f"#face = {first}"]
    lines += ["#[[interfaces]]           # where it touches its neighbour", '#name = "contact"', f"#face = {first}"]
    return lines


def _supports(mesh: Mesh, holding: bool) -> tuple[list[str], list[str]]:
    """The file's own supports, and what to say of them. holding: they leave no rigid motion."""
    told = [f"warning: not taken as a support: {text}" for text in mesh.not_held]
    if not mesh.supports:
        return [], told
    lines = ["", "# Held by the file itself:"]
    for name, directions in mesh.supports.items():
        lines += ["[[supports]]", f"face = {json.dumps(name)}"]
        moves = "".join(c for c in directions if c in "xyz")
        turns = "".join("xyz"["abc".index(c)] for c in directions if c in "abc")
        lines += [f'directions = "{moves}"'] if moves != "xyz" else []
        lines += [f"rotations = {'true' if turns == 'xyz' else json.dumps(turns)}"] if turns else []
    named = ", ".join(f"{name} in {directions}" for name, directions in mesh.supports.items())
    if not holding:
        lines[1] = "# Held by the file itself, but not against every rigid motion:"
        named += "; they leave rigid motions, so the body floats (free = true)"
        return lines, [*told, f"warning: supports of the file: {named}"]
    return lines, [*told, f"supports of the file: {named}"]


def _fixed(mesh: Mesh) -> Indices:
    """Degrees of freedom that the file's supports hold."""
    none = np.zeros(0, dtype=np.int64)
    held = [(mesh.point_sets.get(n, none), ways) for n, ways in mesh.supports.items()]
    return joined(3 * s + "xyz".index(c) for s, ways in held for c in ways if c in "xyz")


def _count(mesh: Mesh) -> int:
    """How many modes are asked for: those of the sector at a nodal diameter have one cut face."""
    face = "" if mesh.sector is None else mesh.sector.faces[0]
    cut = 3 * len(mesh.set_points(face)) if face in {*mesh.faces, *mesh.point_sets} else 0
    ties = 0 if mesh.ties is None else mesh.ties.rows.shape[0]
    fixed = len(np.unique(_fixed(mesh)))
    return max(min(USUAL, 3 * mesh.n_points - fixed - cut - ties - 2), 1)


def _hold(mesh: Mesh, metres: float) -> bool:
    """Whether the file's supports leave no rigid motion."""
    from ..fem.discretise import discretise
    from ..fem.tied import tied_upper
    from ..modal.equilibrium import lumped_springs
    from ..modal.rigid import free_motions, free_motions_of_ring, left_by, unresisted

    none, fixed = np.zeros(0, dtype=np.int64), _fixed(mesh)
    centre, pattern = mesh.points.mean(axis=0), discretise(mesh).pattern
    springs, ring = lumped_springs(mesh, pattern), mesh.sector
    if ring is not None and mesh.ties is None and len(fixed):  # all sectors together may be held
        turn = rotation(np.array(ring.axis), 2 * np.pi / ring.sectors)
        motions = free_motions_of_ring(
            mesh.points, metres * np.array(ring.point), fixed, turn, ring.sectors
        )
        return unresisted(motions, springs, pattern).shape[1] == 0
    if mesh.ties is None:
        return unresisted(free_motions(mesh.points, centre, fixed), springs, pattern).shape[1] == 0
    first, sets = 3 * mesh.n_points, mesh.ties.sets
    moves = [first + 6 * sets.get(n, none) + "xyzabc".index(c) for n, ways in mesh.supports.items() for c in ways]
    free = tied_upper(pattern, np.concatenate([fixed, *moves]), mesh.ties)
    return unresisted(left_by(free, mesh.points, centre, fixed), springs, pattern).shape[1] == 0


def _tied(file: Path, mesh: Mesh) -> tuple[Mesh, list[str]]:
    """The mesh with the equations of its constraints, and these in words.

    Raises:
        UserError: with file and line, what is wrong with one.
    """
    if (links := mesh.links) is None:
        return mesh, []
    from ..fem.discretise import discretise
    from ..fem.links import linked
    from ..fem.tied import tied_upper

    with in_its_line(file):
        mesh, told = linked(mesh)
        tied_upper(discretise(mesh).pattern, np.zeros(0, dtype=np.int64), mesh.ties)
    said: dict[str, list[str]] = {}
    for link, text in zip(links.items, told, strict=True):
        said.setdefault(link.where, []).append(text)
    told = [texts[0] if len(texts) == 1 else f"{where}: {len(texts)} constraints" for where, texts in said.items()]
    return mesh, told if len(told) <= 12 else [*told[:10], f"and {len(told) - 10} constraints more"]


LONGEST_LOOK = 30.0
"""Seconds that the surfaces of a file may take to be triangulated for a picture, at first as they bend, then coarsely,
then not at all."""


def cad_table(file: Path, unit: str, picture: Path | None = None, report: Report = lambda _: None) -> tuple[str, str]:
    """Solids and numbered surfaces of a CAD file, read in a process of its own.

    Args:
        picture: where to draw the surfaces with their numbers.

    Returns:
        The table, and why there is no picture if one was asked for and could not be drawn.

    Raises:
        UserError: what the CAD kernel says.
    """
    with tempfile.TemporaryDirectory() as scratch:
        triangles = Path(scratch) / "triangles.npz"
        words = ["--list", str(file), unit]
        if picture is not None:
            for more in ([], ["coarse"]):
                report(f"{'coarse ' * bool(more)}triangles of {file.name} for a picture, {LONGEST_LOOK:.0f} s at most")
                with contextlib.suppress(subprocess.TimeoutExpired):
                    text = cad_result([*words, str(triangles), *more], LONGEST_LOOK)
                    return text, _draw(triangles, f"{file.name}: its surfaces", picture)
        report(f"surfaces of {file.name}")
        return cad_result(words), "" if picture is None else f"not triangulated within {2 * LONGEST_LOOK:.0f} s"


def cad_result(words: list[str], limit: float | None = None) -> str:
    """What the CAD route prints, in a process of its own.

    Raises:
        UserError: what the CAD kernel says. TimeoutExpired: nothing within the limit, s.
    """
    with tempfile.TemporaryDirectory() as scratch:
        done = run_apart(["-m", "microslip.cad", *words], scratch, limit)
    if done.returncode:
        raise UserError((done.stderr.strip().splitlines() or [f"{' '.join(words)}: cannot be read"])[-1])
    return done.stdout.strip()


def _draw(triangles: Path, title: str, picture: Path) -> str:
    """Draw numbered surfaces; why not, if that fails."""
    from ..pictures import can_draw

    if reason := can_draw():
        return reason
    from ..pictures.numbered import surfaces_picture

    picture.parent.mkdir(parents=True, exist_ok=True)
    with np.load(triangles) as data:
        surfaces_picture(data["points"], data["triangles"], data["surface"], title, picture)
    return ""


def _cad(file: Path, folder: Path, unit: str, report: Report) -> tuple[list[str], list[str]]:
    picture = folder / "surfaces.png"
    text, reason = cad_table(file, unit, picture, report)
    told = [text, f"warning: no picture of the surfaces: {reason}" if reason else f"{picture}: the surfaces, numbered"]
    if text.count("\nsolid ") > 1:
        apart = f"microslip import {shlex.quote(str(file))} --apart"
        told.append(f"the solids are joined to one body; each as a body of its own, with contacts between: {apart}")
    shown = "" if reason else f", shown in {picture.name}"
    surfaces = "\n".join(f"# {line}" for line in text.splitlines()[1:])
    lines = OF_CAD.format(cad=_beside(file, folder), shown=shown, surfaces=surfaces).splitlines()
    return [*lines, *_end()], told


OF_CAD = """\
free = true               # nothing is held yet

[geometry]
cad = {cad}

# The surfaces of the file{shown}:
{surfaces}
# Part of a surface: box with cut = true; where another body lies on it: touching = "other.step".
# Name those you need, each by one of surfaces, label, colour, box:
#[[geometry.faces]]
#name = "clamp"
#surfaces = [1]
#[[geometry.faces]]
#name = "contact"
#surfaces = [2]

[mesh]
#size = 5.0               # a fifteenth of the diagonal if not given

[material]
name = "steel"
density = 7850.0          # kg/m3
young = 2.1e11            # Pa
poisson = 0.3

#[[supports]]             # then remove free = true at the top
#face = "clamp"
#[[interfaces]]           # where it touches its neighbour
#name = "contact"
#face = "contact"
#[[excitations]]          # a force of 1 N
#name = "shaker"
#point = [0.0, 0.0, 0.0]
#direction = [1.0, 0.0, 0.0]
#[[monitors]]
#name = "tip"
#point = [0.0, 0.0, 0.0]
"""
"""A body.toml around a CAD file."""

USUAL = 20
"""Modes that are asked for where the body has as many."""


def _end(count: int = USUAL) -> list[str]:
    return ["", "[modes]", f"count = {count}", "", "[damping]", "ratio = 0.001"]


STEEL = Substitute(7850.0, 2.1e11, 0.3)


def refuse_hanging(file: Path, mesh: Mesh) -> None:
    """Raise `UserError` if elements that are left out hold or load the solids."""
    if mesh.hanging:
        raise refused(
            file,
            f"{mesh.hanging}, and beams, shells and the like are not read: without them other frequencies come. Model "
            "them by solids, or write --solids-only if the solids are meant to stand alone",
        )


def _mesh(
    file: Path,
    folder: Path,
    unit: str,
    instances: Sequence[str] = (),
    instead: Substitute = NONE,
    solids_only: bool = True,
) -> tuple[list[str], list[str], Mesh]:
    system, asked = usual_system(unit), instead
    given = {key: getattr(asked, key) for key in ("density", "young", "poisson")}
    numbers = {key: getattr(STEEL, key) if value is None else value for key, value in given.items()}
    instead = Substitute(**numbers, whole=asked.young is not None)
    told = []
    try:
        mesh = read_mesh(file, unit, system, instead=instead)
    except UserError as error:
        if isinstance(error.__cause__, Unread):  # steel in its place would be wrong
            raise
        mesh = read_mesh(file, unit)  # its materials alone may be at fault
        told = [f"warning: {error}"]
    joints = [f"{j.where}: '{j.slave}' on '{j.master}': make them interfaces and a contact" for j in mesh.joints]
    mesh = of_instances(mesh, instances) if instances else mesh
    if not solids_only:
        refuse_hanging(file, mesh)
    mesh, ties = _tied(file, mesh)
    again = [f"warning: {text}" for texts in mesh_problems(mesh) for text in texts]
    lacking = [text for text in again if text.endswith(STANDS)]
    told = [*lacking, *told, *_holds(file, mesh, unit, [text for text in again if text not in lacking])]
    told += [*ties, *((*joints, *_pressed(mesh)) if not instances else ())]
    holding = _hold(mesh, UNITS[unit])
    held, said = _supports(mesh, holding)
    told += said
    lines = [] if holding else ["free = true               # nothing holds it wholly yet"]
    lines += ["", "[geometry]", f"mesh = {_beside(file, folder)}"]
    lines += [f"instances = {json.dumps(list(instances))}"] if instances else []
    rule = f'integration = "{mesh.integration}"  # the points that the program of the file takes'
    lines += ["", "[mesh]", rule] if mesh.integration != "full" else []
    lines += ["", "[material]", *_material(mesh, numbers, bool(lacking))]
    if mesh.materials:
        told += [f"{m.name}: {m.density:.6g} kg/m3 in the units {system}" for m in mesh.materials]
    else:
        same = instead == replace(STEEL, whole=instead.whole)
        text = "steel" if same else ", ".join(_keys(numbers))
        text = f"warning: no material was taken from the file; body.toml says {text}"
        told.insert(0, f"{text} (--density, --young, --poisson)")
    hot, said = _temperatures(mesh)
    ring, words = _cyclic(mesh, UNITS[unit])
    told += [*said, *words]
    count = _count(mesh)
    if count < USUAL:
        told.append(f"modes: {count} asked for, the body has few degrees of freedom")
    turning, loads, words = _state(mesh, UNITS[unit], bool(ring), holding)
    told += words
    lines = [*_noted([text for text in told if text not in again]), *lines]
    ring = [*ring[:4], *turning, *ring[4:]] if ring or turning else []
    kept, words = _retained(mesh)
    told += words
    sets = _sets(mesh, bool(held) or holding)
    return [*lines, *hot, *ring, *loads, *held, *kept, *sets, *_end(count)], told, mesh


def _holds(file: Path, mesh: Mesh, unit: str, warnings: Sequence[str]) -> list[str]:
    """What the file holds, its size, and what is to be doubted of it."""
    kinds = ", ".join(f"{len(c)} {t}" for t, c in mesh.cells.items())
    alone = f"; the solids alone: {mesh.hanging.partition(': ')[2]} and are left out" if mesh.hanging else ""
    solid = mesh.points[np.unique(joined(c.ravel() for c in mesh.cells.values()))]
    size = " x ".join(f"{v:.4g}" for v in np.ptp(solid, axis=0) / UNITS[unit])
    told = [f"{file}: {mesh.n_points} points, {kinds}, {size} {unit}{alone}", *warnings]
    if unit != "mm" and not unit_of(file) and likely_unit(file) == unit:
        told.append(f"note: lengths are taken in {unit}, as its densities are no solid's in mm and t; else --unit")
    doubts = (density(f"{file}: {m.name}: density", m.density) for m in mesh.materials)
    told += [f"warning: {text}" for text in doubts if text]
    told += [f"note: {text}" for text in mesh.remarks]
    if mesh.lumps is not None and (mass := float(mesh.lumps.masses.sum())):
        told.append(f"point masses of the file: {mass:.6g} kg")
    return told


def _material(mesh: Mesh, numbers: Mapping[str, float], lacking: bool) -> list[str]:
    """Lines of [material]; lacking: whether one of the file's has not all of its numbers."""
    if not mesh.materials:
        return ["# the file brings no material that can be used", *_keys(numbers)]
    of_each = [f"# {m.name}: {m.density:.6g} kg/m3, C_xxxx {m.elasticity[0, 0]:.6g} Pa" for m in mesh.materials]
    return ['from = "mesh"', *(_keys(numbers) if lacking else ()), *of_each]


def _keys(numbers: Mapping[str, float]) -> list[str]:
    """Lines of [material]."""
    return [f"{key} = {f'{value:.9g}'.replace('e+', 'e')}" for key, value in numbers.items()]


def _retained(mesh: Mesh) -> tuple[list[str], list[str]]:
    """Lines of [[interfaces]] where the file keeps displacements, comments where these are no face, and what to say."""
    lines, told = [], []
    for name in mesh.retained:
        mark = "" if name in mesh.faces else "#"
        title = body_name(name, "retained")
        lines += ["", f"{mark}[[interfaces]]           # the file retains its displacements"]
        lines += [f"{mark}name = {json.dumps(title)}", f"{mark}face = {json.dumps(name)}"]
        none = "; it is no whole face of the surface, so it is written as a comment: give the face by box" * bool(mark)
        told.append(f"retained displacements of '{name}': an interface, not a support{none}")
    return lines, told


def _noted(told: Sequence[str]) -> list[str]:
    """The key of a body.toml that says what of the file is left out, which modes and the report repeat."""
    texts = [text.removeprefix("warning: ") for text in told if text.startswith("warning: ")]
    line = f"note = {json.dumps('; '.join(texts), ensure_ascii=False)}"
    return [f"{line}   # said by modes: take it out when it is mended"] * bool(texts)


def _temperatures(mesh: Mesh) -> tuple[list[str], list[str]]:
    """Lines of [temperature] and what to say of it: in force where moduli hang on it and nothing is
    strained by it."""
    hanging = [m for m in mesh.materials if m.softening is not None]
    said = [_softened(m, mesh) for m in hanging]
    if mesh.temperature is None:
        return [], [f"warning: {text}" for text in said]
    free, actual = mesh.temperature[:, 0], _actual(mesh.temperature)
    whole = not np.isnan(free).any()
    strained = bool((np.abs(actual - free) > 0).any()) and any(m.expansion.any() for m in mesh.materials)
    lines = ["[temperature]", 'from = "mesh"', 'scale = "C"             # or "K"']
    if whole and (mesh.state is not None or (hanging and not strained)):
        return ["", *lines], [f"temperatures of the file are in force: {text}" for text in said]
    told = "temperatures: used only once [temperature] of body.toml is uncommented"
    told = f"warning: {told}" if mesh.state is not None else told
    if hanging:
        why = "they strain the body as well" if strained else "not all of them are there"
        return ["", *(f"#{line}" for line in lines)], [
            *(f"warning: {text}" for text in said),
            f"{told}; {why}",
        ]
    return ["", *(f"#{line}" for line in lines)], [told]


def _actual(temperature: Array) -> Array:
    """(n,) actual temperatures: the stress-free ones where the file gives no others."""
    free, actual = temperature.T
    return np.where(np.isnan(actual), free, actual)


def _softened(material: Material, mesh: Mesh) -> str:
    """How far a modulus falls at the temperatures of the file, and the frequencies with it."""
    assert material.softening is not None
    T, factor = material.softening.T
    text = f"the modulus of {material.name} depends on temperature"
    hot = np.zeros(0) if mesh.temperature is None else _actual(mesh.temperature)
    if not np.isfinite(hot).any():
        return f"{text}, but the file says none: that of its first row is taken"
    least, most = np.interp([np.nanmin(hot), np.nanmax(hot)], T, factor)
    low, high = sorted((least, most))
    at = f"{low:.4g}" if high - low < 1e-6 else f"{low:.4g} to {high:.4g}"
    factor = f"so frequencies by a factor of {low**0.5:.4g}"
    return f"{text}: {at} of its first row at those of the file, {factor}"


def _cyclic(mesh: Mesh, metres: float) -> tuple[list[str], list[str]]:
    """Lines of [rotation] and [cyclic] of a file that is a sector, and what to say of them.

    The right face is the left one turned by 2 pi / sectors about the axis, so of the two it is the
    one ahead.
    """
    if (sector := mesh.sector) is None:
        return [], []
    axis = np.array(sector.axis) / np.linalg.norm(sector.axis)
    if len([name for name in sector.faces if name in mesh.faces]) < 2:
        faces = " and ".join(map(repr, sector.faces))
        told = f"warning: {sector.where}: {faces} are no faces of the surface"
        return [], [f"{told}; name two in [cyclic], without it the cut is free"]
    point = metres * np.array(sector.point)
    one, other = (mesh.points[mesh.face_points(n)].mean(axis=0) - point for n in sector.faces)
    left, right = sector.faces if axis @ np.cross(one, other) > 0 else sector.faces[::-1]
    numbers = [", ".join(f"{v:.9g}" for v in row) for row in (axis + 0.0, np.array(sector.point) + 0.0)]
    lines = ["", "[rotation]", f"axis = [{numbers[0]}]", f"point = [{numbers[1]}]", "", "[cyclic]"]
    lines += [
        f"sectors = {sector.sectors}",
        f"left = {json.dumps(left)}",
        f"right = {json.dumps(right)}",
    ]
    lines += [f"nodal_diameters = {list(sector.diameters)}"] if sector.diameters else []
    unlike = len(mesh.face_points(left)) != len(mesh.face_points(right))
    lines += ['follows = "left"'] if unlike and left == sector.faces[0] else []
    told = f"{sector.where}: one of {sector.sectors} cyclic sectors, '{right}' ahead of '{left}'"
    more = f"; they are not meshed alike: the nodes of '{sector.faces[0]}' follow the other face"
    return lines, [told + more * unlike]


_LOADED = {FacetLoad: "loaded facet", BodyLoad: "acceleration field", SpinLoad: "rotation"}


def _state(mesh: Mesh, metres: float, ring: bool, held: bool) -> tuple[list[str], list[str], list[str]]:
    """Lines of [rotation] (behind those of a ring) and [[loads]] of the file's static step, and what to say of it."""
    if (state := mesh.state) is None:
        return [], [], []
    if not held:
        return [], [], [f"warning: {state.where}: its loads are left out, for nothing holds the body against them"]
    count = Counter[str]()
    for load in state.loads:
        kind = load.kind if isinstance(load, NodalLoad) else _LOADED[type(load)]
        count[kind] += len(load.values) if isinstance(load, NodalLoad | FacetLoad) else 1
    acting = [f"{number} {kind}{'s' * (number > 1)}" for kind, number in count.items()]
    acting += ["temperatures"] * (mesh.temperature is not None)
    law = "finite displacements" if state.nonlinear else "one linear solution"
    if (grown := _grown(mesh)) and state.nonlinear:
        law += (
            f"; heat stretches the body by up to {grown:.2g}, and moduli are those of the heated body: "
            f"CalculiX raises them by as much, so its frequencies are up to {grown / 2:.1g} higher"
        )
    if state.supports is not None:
        law += f"; held there by {', '.join(f'{n} in {w}' for n, w in state.supports.items()) or 'nothing'}"
    said = [f"{state.where}: the modes are about its static state: {', '.join(acting) or 'nothing acts'}; {law}"]
    turning = [] if ring else ["", "[rotation]"]
    turning.append(f'prestress = "{"nonlinear" if state.nonlinear else "linear"}"')
    if mesh.links is not None and any(isinstance(link, RigidLink) for link in mesh.links.items):
        text = "that forces turn with the arms of rigid links is left out of the stiffness, as in CalculiX"
        finite = (
            ", and the arms keep their directions at rest: CalculiX turns them" * state.nonlinear
        )
        said.append(
            f"warning: {state.where}: {text}{finite}; where links turn much, mesh their bodies"
        )
    spins = [load for load in state.loads if isinstance(load, SpinLoad) and load.speed]
    if len(spins) > 1 or any(spin.cells is not None for spin in spins):
        said.append(
            f"warning: {spins[0].where}: is left out, frequencies will differ: [rotation] turns the whole body about "
            "one axis; write one that does"
        )
    elif spins:
        (spin,) = spins
        axis, speed = spin.axis / np.linalg.norm(spin.axis) + 0.0, to_rpm(spin.speed)
        heavy = mesh.lumps is not None and bool(mesh.lumps.masses.any())
        whole = (
            "; point masses turn with the body, all of them: CalculiX leaves their softening out"
            * heavy
        )
        said.append(f"{spin.where}: {speed:.6g} rpm{whole}")
        if not ring:
            numbers = [", ".join(f"{v:.15g}" for v in row) for row in (axis, spin.point / metres + 0.0)]
            turning += [f"axis = [{numbers[0]}]", f"point = [{numbers[1]}]"]
        turning.append(f"speeds_rpm = [{speed!r}]")
    rest = len(state.loads) > sum(isinstance(load, SpinLoad) for load in state.loads)
    rest = rest or state.supports is not None
    return turning, ["", "[[loads]]", 'kind = "mesh"             # those of its static step'] if rest else [], said


def _grown(mesh: Mesh) -> float:
    """The largest stretch by heat, less 1; 0 where the file has no temperatures."""
    if mesh.temperature is None or not mesh.materials:
        return 0.0
    free, actual = mesh.temperature[:, 0], _actual(mesh.temperature)
    largest = [np.abs(m.thermal_strain(actual, free)).max(initial=0.0) for m in mesh.materials]
    return float(np.nan_to_num(max(largest)))


def _pressed(mesh: Mesh) -> list[str]:
    """Preloads of bolts that are one body with all that they hold, and not in its static step: no contact takes them.
    """
    if mesh.state is not None:
        return []
    return [
        f"warning: {where}: the preload of {force:g} N is not used: the bolt and all that it holds are one "
        "body; tie it to one side alone, with a *CONTACT PAIR on the other"
        for where, force in mesh.preloads
    ]


def _in_metres(file: Path) -> bool:
    """Whether bulk data says that it was written by `exchange.dmig`, in SI."""
    with file.open("rb") as stream:
        head = stream.read(800)
    return head.startswith(b"$ Superelement ") and b"by microslip" in head and b"$ SI units" in head


def _matrices(file: Path, folder: Path, unit: str) -> tuple[list[str], list[str]]:
    from ..exchange.matrices import matrix_names, own_nodes

    names = matrix_names(file)
    told = [f"{file}: matrices {', '.join(names) or 'none'}"]
    mass = _mass_of(file, names)
    own, generalised = own_nodes(file)
    nodes = file if own else _nodes_of(file)
    lines = ["free = true               # nothing is held yet", "", "[geometry.matrices]"]
    lines.append(f"stiffness = {_beside(file, folder)}")
    lines.append(f"mass = {_beside(mass, folder)}")
    upper = {n.upper() for n in names}
    for key, usual in (
        ("damping", ("C", "BAA", "BAAX", "C_R")),
        ("gyroscopic", ("G", "GAAX", "G_R")),
        ("circulatory", ("NAAX", "N_R")),
    ):
        if upper & set(usual) and mass == file:
            lines.append(f"#{key} = {_beside(file, folder)}")
    if nodes is None:
        lines.append('nodes = "nodes.csv"       # write it: number, x, y, z of every node')
        told.append(f"warning: no file of nodes is beside {file.name}; write {folder / 'nodes.csv'}: number, x, y, z")
    else:
        lines.append(f"nodes = {_beside(nodes, folder)}")
        told.append(f"nodes from {nodes}")
    if generalised:
        lines.append("superelement = true        # rows without a node are its generalised coordinates")
    lines.append("#grounded = true          # the supports are in the matrices already (then remove free = true)")
    if usual_system(unit) is None:
        lines.append(f'units = "m-kg-s"          # of the matrices: {", ".join(SYSTEMS)}')
    if nodes is not None and nodes.suffix in _MESHES:
        return [*lines, *_sets(read_mesh(nodes, unit)), *_end()], told
    return [*lines, "", "#[geometry.matrices.sets]", "#tip = [1, 2, 3]", *_end()], told


def _mass_of(file: Path, names: list[str]) -> Path:
    """The same file if it holds several matrices, else the partner beside it."""
    if len(names) > 1:
        return file
    if file.suffix == ".sti":
        return file.with_suffix(".mas")
    for old, new in (("K", "M"), ("k", "m"), ("stiffness", "mass"), ("Stiffness", "Mass")):
        at = file.stem.rfind(old)
        partner = file.with_name(file.stem[:at] + new + file.stem[at + len(old) :] + file.suffix)
        if at >= 0 and partner.is_file():
            return partner
    raise UserError(
        f"{file}: no mass matrix is beside it; name the two K{file.suffix} and M{file.suffix}, or write a body.toml"
    )


def _nodes_of(file: Path) -> Path | None:
    for place in [file.with_suffix(s) for s in _NODES] + [file.with_name(f"nodes{s}") for s in _NODES]:
        if place.is_file() and place != file:
            return place
    return None

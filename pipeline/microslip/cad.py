"""Meshing with gmsh: what every geometry/<body>/build.py shares, and the route of a user's own CAD file.

Only this module and the build files import gmsh, and they are always run as their own process:

    python geometry/blade/build.py SETTINGS OUT.msh      a body that draws itself
    python -m microslip.cad SETTINGS OUT.msh             STEP, BREP or IGES, faces picked by rules
    python -m microslip.cad --list FILE UNIT             table of solids and faces to choose from

SETTINGS is a body file (.toml) or the same structure as .json. Lengths, the mesh's too, are in its `length_unit`.
A failure is one sentence on stderr and exit code 2, and leaves no file.
"""

from __future__ import annotations

import json
import math
import os
import sys
import tomllib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import gmsh
import numpy as np

from microslip.data import UserError

TETRA10 = 11  # gmsh's number of the element type
# corners of the edges on which gmsh's mid-side nodes 4..9 lie (the last two swapped against VTK)
EDGES = np.array([[0, 1], [1, 2], [2, 0], [3, 0], [3, 2], [3, 1]])
SMALLEST_JACOBIAN = 0.05  # of the straight-sided element; below it the mid-side nodes are straightened


# ---------------------------------------------------------------- shared by all build files


def run(draw: Callable[[dict[str, Any], dict[str, Any]], None]) -> None:
    """Main of a build file: read the command line, call draw(parameters, mesh), mesh, write."""
    if len(sys.argv) != 3:
        sys.exit(f"usage: python {Path(sys.argv[0]).name} SETTINGS.(toml|json) OUT.msh")

    def work() -> None:
        settings = read_settings(sys.argv[1])
        mesh = dict(settings.get("mesh", {}))
        draw(dict(settings.get("geometry", {}).get("parameters", {})), mesh)
        finish(mesh, sys.argv[2])

    guarded(work, sys.argv[1])


def guarded(work: Callable[[], None], source: str) -> None:
    """Run `work` with gmsh open; a mistake becomes one sentence on stderr and exit code 2."""
    prefix = Path(source).name if not source.endswith(".json") else "body.toml"
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)  # one thread: the same bytes at every run
        gmsh.logger.start()
        work()
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:  # gmsh raises plain Exception
        text = str(error) if isinstance(error, (UserError, OSError)) else f"{type(error).__name__}: {error}"
        print(f"{prefix}: {' '.join(text.split())}", file=sys.stderr)
        sys.exit(2)
    finally:
        gmsh.finalize()


def read_settings(path: str) -> dict[str, Any]:
    """A body file (.toml) or its resolved copy (.json); relative CAD paths start at settings["folder"]."""
    try:
        text = Path(path).read_text(encoding="utf-8")
        settings = json.loads(text) if path.endswith(".json") else tomllib.loads(text)
    except (OSError, ValueError) as error:
        raise UserError(f"cannot be read: {error}") from None
    settings.setdefault("folder", str(Path(path).resolve().parent))
    return settings


def checked(given: dict[str, Any], defaults: dict[str, Any], signed: Sequence[str] = ()) -> dict[str, Any]:
    """`defaults` overwritten by `given`; unknown names and numbers that are not positive are refused.

    Numbers named in `signed`, or whose default is not positive, may have any sign.
    """
    for name, value in given.items():
        key = f"geometry.parameters.{name}"
        if name not in defaults:
            raise UserError(f"{key} is unknown; this body knows {', '.join(defaults)}")
        if not isinstance(defaults[name], (int, float)):
            continue
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise UserError(f"{key} = {value!r} must be a number")
        if value <= 0 < defaults[name] and name not in signed:
            raise UserError(f"{key} = {value} must be positive")
    return {**defaults, **given}


def name_face(name: str, surfaces: Iterable[int]) -> None:
    """Name boundary surfaces (physical group of dimension 2)."""
    tags = sorted(set(surfaces))
    if not tags:
        raise UserError(f"face {name!r} is empty: the parameters leave no such surface")
    gmsh.model.addPhysicalGroup(2, tags, name=name)


def name_body(volumes: Iterable[int] | None = None) -> None:
    """Name the volumes, all of them by default, as the physical group "body"."""
    tags = [tag for _, tag in gmsh.model.getEntities(3)] if volumes is None else sorted(volumes)
    if not tags:
        raise UserError("the drawing has no volume")
    gmsh.model.addPhysicalGroup(3, tags, name="body")


def boundary_surfaces() -> list[int]:
    """Tags of the surfaces that bound exactly one volume."""
    volumes = gmsh.model.getEntities(3)
    return sorted(tag for _, tag in gmsh.model.getBoundary(volumes, combined=True, oriented=False))


def surfaces_where(predicate: Callable[[np.ndarray, np.ndarray], bool]) -> list[int]:
    """Tags of the boundary surfaces for which predicate(centre (3,), box (2, 3)) holds, in length_unit.

    The box is low and high corner; OpenCASCADE widens it by about 1e-7, compare with a tolerance.
    """

    def look(tag: int) -> bool:
        centre = np.array(gmsh.model.occ.getCenterOfMass(2, tag))
        return bool(predicate(centre, np.reshape(gmsh.model.getBoundingBox(2, tag), (2, 3))))

    return [tag for tag in boundary_surfaces() if look(tag)]


def finish(mesh: dict[str, Any], out: str) -> None:
    """Mesh the drawing with the sizes of [mesh], straighten inverted elements, write `out` or nothing."""
    order = mesh.get("order", 2)
    if order not in (1, 2):
        raise UserError(f"mesh.order = {order!r} must be 1 or 2")
    set_sizes(mesh)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(order)
    straightened = straighten() if order == 2 else 0
    refuse_inverted()
    write(out)
    tags, _, _ = gmsh.model.mesh.getNodes()
    counts = [len(e) for e in gmsh.model.mesh.getElements(3)[1]]
    print(f"{Path(out).name}: {len(tags)} nodes, {sum(counts)} elements, {straightened} straightened")


def set_sizes(mesh: dict[str, Any]) -> None:
    """Element sizes: mesh.size everywhere, mesh.local.<face> at that face and growing away from it."""
    size = positive_size("mesh.size", mesh.get("size", default_size()))
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    faces = {gmsh.model.getPhysicalName(2, tag): tag for _, tag in gmsh.model.getPhysicalGroups(2)}
    fields = []
    for name, near in mesh.get("local", {}).items():
        if name not in faces:
            raise UserError(f"mesh.local.{name} is not a face of this body; faces are {', '.join(faces)}")
        surfaces = gmsh.model.getEntitiesForPhysicalGroup(2, faces[name])
        fields.append(refined_near(surfaces, positive_size(f"mesh.local.{name}", near), size))
    if fields:
        least = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(least, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(least)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)


def refined_near(surfaces: Sequence[int], near: float, far: float) -> int:
    """Size field: `near` on the surfaces, `far` at a distance of five elements."""
    field = gmsh.model.mesh.field
    distance, threshold = field.add("Distance"), field.add("Threshold")
    field.setNumbers(distance, "SurfacesList", surfaces)
    field.setNumber(threshold, "InField", distance)
    for option, value in {"SizeMin": near, "SizeMax": far, "DistMin": near, "DistMax": near + 5 * far}.items():
        field.setNumber(threshold, option, value)
    return threshold


def positive_size(key: str, value: Any) -> float:
    """The element size, refused when it is no length or would make a mesh beyond any memory."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < math.inf:
        raise UserError(f"{key} = {value!r} must be a positive length")
    box = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3))
    if value < 1e-3 * np.linalg.norm(box[1] - box[0]):
        raise UserError(f"{key} = {value} is below a thousandth of the body; is it in length_unit?")
    return float(value)


def default_size() -> float:
    """A fifteenth of the diagonal, not above the thickness-like length 3 volume / surface."""
    box = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3))
    volume = sum(gmsh.model.occ.getMass(3, tag) for _, tag in gmsh.model.getEntities(3))
    area = sum(gmsh.model.occ.getMass(2, tag) for tag in boundary_surfaces())
    diagonal = float(np.linalg.norm(box[1] - box[0]))
    return max(diagonal / 100, min(diagonal / 15, 3 * volume / area))


# ---------------------------------------------------------------- curved elements


def straighten(passes: int = 20) -> int:
    """Straighten the sides of second-order tetrahedra that are inverted or nearly so; returns how many.

    gmsh curves elements at the boundary without looking at their volume, and 1-2 % of them turn inside out.
    A moved node belongs to its neighbours too, hence the passes; periodic faces keep their match.
    """
    done: set[int] = set()
    partners = periodic_partners()
    for _ in range(passes):
        elements, nodes = tetrahedra()
        if not len(elements):
            return 0
        bad = np.flatnonzero(jacobian_ratio(elements, nodes) < SMALLEST_JACOBIAN)
        new = set(elements[bad].tolist())
        if new <= done:  # what is still bad has straight sides already: refuse_inverted() speaks
            break
        done |= new
        middles = set(nodes[bad, 4:].ravel().tolist())
        middles |= {q for p in middles for q in partners.get(p, ())}
        move_to_middle(middles, nodes)
    return len(done)


def tetrahedra() -> tuple[np.ndarray, np.ndarray]:
    """Tags (e,) and node tags (e, 10) of all second-order tetrahedra, gmsh's node order."""
    elements, nodes = gmsh.model.mesh.getElementsByType(TETRA10)
    return np.asarray(elements, int), np.asarray(nodes, int).reshape(-1, 10)


def node_table() -> np.ndarray:
    """Coordinates of all nodes, indexed by node tag."""
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    table = np.full((int(tags.max()) + 1, 3), np.nan)
    table[tags] = xyz.reshape(-1, 3)
    return table


def jacobian_ratio(elements: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Smallest Jacobian determinant inside each curved tetrahedron over that of the straight one, (e,)."""
    x = node_table()[nodes[:, :4]]
    straight = np.linalg.det(x[:, 1:] - x[:, :1])
    return np.asarray(gmsh.model.mesh.getElementQualities(elements, "minDetJac")) / np.abs(straight)


def move_to_middle(middles: set[int], nodes: np.ndarray) -> None:
    """Put mid-side nodes halfway between the two ends of their edge."""
    table = node_table()
    where = np.isin(nodes[:, 4:], list(middles))
    element, edge = np.nonzero(where)
    ends = nodes[element[:, None], EDGES[edge]]
    middle, first = np.unique(nodes[element, edge + 4], return_index=True)
    for tag, pair in zip(middle.tolist(), ends[first], strict=True):
        gmsh.model.mesh.setNode(tag, table[pair].mean(axis=0), [])


def periodic_partners() -> dict[int, set[int]]:
    """For each node on a periodic face the nodes that must move with it."""
    partners: dict[int, set[int]] = {}
    for dim, tag in gmsh.model.getEntities(1) + gmsh.model.getEntities(2):
        master, slaves, masters, _ = gmsh.model.mesh.getPeriodicNodes(dim, tag, includeHighOrderNodes=True)
        if master != tag:
            for a, b in zip(slaves.tolist(), masters.tolist(), strict=True):
                partners.setdefault(a, set()).add(b)
                partners.setdefault(b, set()).add(a)
    return partners


def refuse_inverted() -> None:
    """Every volume element must have a positive Jacobian at its nodes."""
    worst = 0
    for kind, elements in zip(*gmsh.model.mesh.getElements(3)[:2], strict=True):
        _, _, _, count, local, _ = gmsh.model.mesh.getElementProperties(kind)
        _, determinants, _ = gmsh.model.mesh.getJacobians(kind, np.ravel(local))
        worst += int((determinants.reshape(len(elements), count).min(axis=1) <= 0).sum())
    if worst:
        raise UserError(f"{worst} elements have no positive volume; choose a smaller mesh.size")


def write(out: str) -> None:
    """MSH 4.1 text, complete or absent: a temporary file beside it, synchronised, renamed."""
    target = Path(out)
    part = target.with_name(f".{target.stem}.{os.getpid()}.part.msh")
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 0)
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    try:
        if not target.parent.is_dir():
            raise UserError(f"the folder {target.parent} does not exist")
        gmsh.write(str(part))
        with open(part, "rb+") as file:
            file.seek(-min(64, os.path.getsize(part)), os.SEEK_END)
            if not file.read().rsplit(b"\n", 2)[-2].startswith(b"$End"):
                raise UserError(f"{target} could not be written completely; is the disk full?")
            os.fsync(file.fileno())
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)

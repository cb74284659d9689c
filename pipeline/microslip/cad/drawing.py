"""What every drawing shares, a body's own or an imported one: settings, names, sizes, meshing, writing."""

from __future__ import annotations

import contextlib
import inspect
import json
import math
import os
import re
import signal
import sys
import threading
import tomllib
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import gmsh
import numpy as np

from microslip.cad.curved import refuse_inverted, straighten
from microslip.errors import UserError
from microslip.files.store import complete_or_absent, ordinary

warnings: list[str] = []
MOST_ELEMENTS = 5e6  # beyond it a size is taken for a mistake in the unit


def run(draw: Callable[[dict[str, Any], dict[str, Any]], None]) -> None:
    """Main of a build file: read the command line, call draw(parameters, mesh), mesh, write."""
    if len(sys.argv) != 3:
        sys.exit(f"usage: python {Path(sys.argv[0]).name} SETTINGS.(toml|json) OUT.msh")

    def work() -> None:
        settings = read_settings(sys.argv[1])
        try:
            inspect.signature(draw).bind({}, {})
        except TypeError:
            line = f"{Path(draw.__code__.co_filename).name}, line {draw.__code__.co_firstlineno}"
            raise UserError(
                f"{line}: {draw.__name__}{inspect.signature(draw)} does not take two arguments; write "
                f"{draw.__name__}(parameters, mesh), the tables [geometry.parameters] and [mesh]"
            ) from None
        mesh = dict(settings.get("mesh", {}))
        draw(dict(settings.get("geometry", {}).get("parameters", {})), mesh)
        finish(mesh, sys.argv[2])

    guarded(work, sys.argv[1])


def guarded(work: Callable[[], None], source: str) -> None:
    """Run `work` with gmsh open; a mistake becomes one sentence on stderr and exit code 2."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Python's own handler would wait for gmsh to return
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.open, gmsh.merge = _audible(gmsh.open), _audible(gmsh.merge)
    gmsh.model.occ.importShapes = staticmethod(_audible(gmsh.model.occ.importShapes))
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)  # one thread: the same bytes at every run
        work()
        print("".join(f"warning: {text}\n" for text in warnings), end="", file=sys.stderr)
    except Exception as error:  # gmsh raises plain Exception
        text = _told(error)
        prefix = "" if source.endswith(".json") else f"{Path(source).name}: "  # whoever wrote the .json names the body
        print(prefix + " ".join(text.split()), file=sys.stderr)
        sys.exit(2)
    finally:
        gmsh.finalize()


def _told(error: Exception) -> str:
    """What failed in a sentence, which begins with the line of the build file, or of a file beside it, that failed."""
    if isinstance(error, UserError):
        return str(error)
    folder = Path(sys.argv[0]).resolve().parent
    trace = traceback.extract_tb(error.__traceback__) if folder != Path(__file__).resolve().parent else []
    lines = [
        f"{Path(f.filename).name}, line {f.lineno}: " for f in trace if Path(f.filename).resolve().parent == folder
    ]
    at = lines[-1] if lines else ""
    if isinstance(error, OSError) and error.filename and at:
        begins = '; write Path(__file__).parent / "name" of a file beside the build file'
        return f"{at}{error.filename}: {error.strerror}{begins * isinstance(error, FileNotFoundError)}"
    known = isinstance(error, OSError) or type(error) is Exception
    return at + (str(error) if known else f"{type(error).__name__}: {error}")


def _audible(read: Callable[..., Any]) -> Callable[..., Any]:
    """gmsh opens files in C; whoever starts this process hears of them as of those that Python opens."""

    def told(name: str, *words: Any, **more: Any) -> Any:
        sys.audit("open", str(name), "r", 0)
        return read(name, *words, **more)

    return told


def warn(text: str) -> None:
    """A line on stderr once the work is done."""
    warnings.append(text)


def read_settings(path: str) -> dict[str, Any]:
    """A body file (.toml) or its resolved copy (.json); relative CAD paths start at settings["folder"]."""
    try:
        text = ordinary(path).read_text(encoding="utf-8")
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
        if not isinstance(defaults[name], int | float):
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
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


def name_body() -> None:
    """Name all volumes as the physical group "body"."""
    tags = [tag for _, tag in gmsh.model.getEntities(3)]
    if not tags:
        raise UserError("the drawing has no volume")
    gmsh.model.addPhysicalGroup(3, tags, name="body")


def boundary_surfaces(volumes: Sequence[tuple[int, int]] | None = None) -> list[int]:
    """Tags of the surfaces that bound exactly one volume."""
    volumes = gmsh.model.getEntities(3) if volumes is None else volumes
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
    try:
        straightened = generate(order)
    except UserError:  # by other algorithms, where the first leaves triangles that overlap
        gmsh.model.mesh.clear()
        with time_limit(LONGEST_REPAIR, f"gmsh mends the surface for {LONGEST_REPAIR:.0f} s; try another mesh.size"):
            straightened = generate(order, mend=True)
    write(out)
    tags, _, _ = gmsh.model.mesh.getNodes()
    counts = [len(e) for e in gmsh.model.mesh.getElements(3)[1]]
    print(f"{Path(out).name}: {len(tags)} nodes, {sum(counts)} elements, {straightened} straightened")


LONGEST_REPAIR = 120.0  # seconds; gmsh refines the seam of a closed spline surface for ever


def generate(order: int, mend: bool = False) -> int:
    """Mesh in elements of an order; how many of them were straightened. mend: surfaces with overlapping triangles are
    meshed anew in other ways, and finer."""
    gmsh.option.setNumber("Mesh.AlgorithmSwitchOnFailure", mend)
    try:
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
    except Exception as error:
        raise UserError(f"gmsh cannot mesh the body ({error}); try another mesh.size") from None
    if not all(len(gmsh.model.mesh.getElements(3, tag)[0]) for _, tag in gmsh.model.getEntities(3)):
        raise UserError("gmsh left a solid without elements; try another mesh.size")
    straightened = straighten() if order == 2 else 0
    refuse_inverted()
    return straightened


@contextlib.contextmanager
def time_limit(seconds: float, text: str) -> Iterator[None]:
    """Leave the process when the body of the `with` hangs in foreign code."""

    def leave() -> None:
        os.write(2, f"{text}\n".encode())
        os._exit(2)

    timer = threading.Timer(seconds, leave)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def set_sizes(mesh: dict[str, Any]) -> None:
    """Element sizes: mesh.size everywhere, mesh.local.<face> at that face and growing away from it."""
    size = positive_size("mesh.size", default_size() if mesh.get("size") is None else mesh["size"])
    refuse_too_many("mesh.size", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    faces = {gmsh.model.getPhysicalName(2, tag): tag for _, tag in gmsh.model.getPhysicalGroups(2)}
    fields = []
    for name, near in (mesh.get("local") or {}).items():
        if name not in faces:
            raise UserError(f"mesh.local.{name} is not a face of this body; faces are {', '.join(faces)}")
        surfaces = gmsh.model.getEntitiesForPhysicalGroup(2, faces[name])
        near = positive_size(f"mesh.local.{name}", near)
        refuse_too_many(f"mesh.local.{name}", near, surfaces)
        fields.append(refined_near(surfaces, near, size))
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
    values = {"SizeMin": near, "SizeMax": far, "DistMin": near, "DistMax": near + 5 * far}
    for option, value in values.items():
        field.setNumber(threshold, option, value)
    return threshold


def positive_size(key: str, value: Any) -> float:
    """An element size, refused when it is no positive number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < math.inf:
        raise UserError(f"{key} = {value!r} must be a positive length")
    return float(value)


def refuse_too_many(key: str, size: float, surfaces: Sequence[int] | None = None) -> None:
    """A regular tetrahedron of edge a fills a^3 / 8.5, a triangle a^2 / 2.3; about four tetrahedra stand on it."""
    if surfaces is None:
        elements = 8.5 * sum(gmsh.model.occ.getMass(*solid) for solid in gmsh.model.getEntities(3)) / size**3
    else:
        elements = 4 * 2.3 * sum(gmsh.model.occ.getMass(2, tag) for tag in surfaces) / size**2
    if elements > MOST_ELEMENTS:
        raise UserError(f"{key} = {size:g} would make about {elements:.1g} elements; is it in length_unit?")


def default_size() -> float:
    """A fifteenth of the diagonal, not above the thickness-like length 3 volume / surface."""
    box = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3))
    volume = sum(gmsh.model.occ.getMass(3, tag) for _, tag in gmsh.model.getEntities(3))
    area = sum(gmsh.model.occ.getMass(2, tag) for tag in boundary_surfaces())
    diagonal = float(np.linalg.norm(box[1] - box[0]))
    return max(diagonal / 100, min(diagonal / 15, 3 * volume / area))


def write(out: str) -> None:
    """MSH 4.1 text, complete or absent."""
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 0)
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    with complete_or_absent(out) as part:
        gmsh.write(str(part))
        with open(part, "rb") as file:  # gmsh does not notice a full disk
            file.seek(max(0, part.stat().st_size - 64))
            if not re.search(rb"\$End\w+\s*$", file.read()):
                raise UserError(f"{out} could not be written completely; is the disk full?")

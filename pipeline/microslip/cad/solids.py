"""A user's own STEP, BREP or IGES file: read it in the unit asked for, refuse what is no closed solid, join parts."""

from __future__ import annotations

import contextlib
import math
import os
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import gmsh
import numpy as np

from microslip.cad.drawing import boundary_surfaces, time_limit, warn
from microslip.cad.marks import Marks, marks_of
from microslip.errors import UserError
from microslip.files.store import ordinary
from microslip.mesh import UNITS
from microslip.plausible import EXTENT

OCC_UNITS = {"m": "M", "cm": "CM", "mm": "MM", "um": "UM", "in": "INCH", "ft": "FT"}
ENDS = {  # how a complete text file of the kind ends; OpenCASCADE takes half files for whole, or hangs in them
    ".step": rb"END-ISO-10303-21;\s*$",
    ".stp": rb"END-ISO-10303-21;\s*$",
    ".brep": rb"\*\s+[+-]?\d+ \d+\s*$",
    ".iges": rb"T {0,6}\d+\s*$",
    ".igs": rb"T {0,6}\d+\s*$",
}
LONGEST_IMPORT = 20.0, 20e-6  # seconds and seconds per byte; OpenCASCADE loops for ever in some damaged files


def load(path: Path, unit: str) -> Marks:
    """Import a CAD file, in `unit`, with touching solids joined; label and colour of its boundary surfaces."""
    if unit not in UNITS:
        raise UserError(f"length_unit = {unit!r} is unknown; it is one of {', '.join(UNITS)}")
    if not ordinary(path).is_file():
        raise UserError(f"geometry.cad: there is no file {path}")
    import_shapes(path, unit)
    solids = gmsh.model.getEntities(3)
    if not solids:
        count = len(gmsh.model.getEntities(2))
        raise UserError(
            f"geometry.cad: {path.name} holds no solid ({count} surfaces of open or loose shells); "
            "close the body in the CAD program and export it as a solid"
        )
    for solid in solids:
        refuse_damaged(path, solid)
    marks = marks_of(path)
    if len(solids) > 1:
        marks = join(path, solids, marks)
    warn_of_unit(path, unit)
    return marks


def import_shapes(path: Path, unit: str) -> None:
    """Let OpenCASCADE read the file. STEP and IGES state their unit and are converted, BREP is taken as it is."""
    kind = path.suffix.lower()
    if kind not in ENDS:
        raise UserError(f"geometry.cad: the name {path.name} must end in one of {', '.join(ENDS)}")
    if not re.search(ENDS[kind], path.read_bytes()[-400:]):
        raise UserError(f"geometry.cad: {path.name} is no {kind[1:].upper()} file or is cut off; export it again")
    if kind in (".step", ".stp"):
        gmsh.option.setString("Geometry.OCCTargetUnit", OCC_UNITS[unit])
    elif kind in (".iges", ".igs"):  # always arrives in mm
        gmsh.option.setNumber("Geometry.OCCScaling", UNITS["mm"] / UNITS[unit])
    longest = LONGEST_IMPORT[0] + LONGEST_IMPORT[1] * path.stat().st_size
    late = f"geometry.cad: {path.name} is damaged, it was not read within {longest:.0f} s; export it again"
    try:
        with time_limit(longest, late), silent():
            shapes = gmsh.model.occ.importShapes(str(path), highestDimOnly=True)
            if kind in (".iges", ".igs") and all(dim < 3 for dim, _ in shapes):
                sew(shapes)
            gmsh.model.occ.synchronize()
    except Exception as error:
        raise UserError(f"geometry.cad: {path.name} cannot be read ({error}); export it again") from None


def sew(shapes: Sequence[tuple[int, int]]) -> None:
    """IGES writes a solid as loose surfaces."""
    with contextlib.suppress(Exception):  # stays surfaces, which load() refuses
        skin = gmsh.model.occ.addSurfaceLoop([tag for dim, tag in shapes if dim == 2], sewing=True)
        gmsh.model.occ.addVolume([skin])


@contextlib.contextmanager
def silent() -> Iterator[None]:
    """Keep OpenCASCADE's own chatter off the screen."""
    sys.stdout.flush()
    kept = os.dup(1)
    with tempfile.TemporaryFile() as sink:
        os.dup2(sink.fileno(), 1)
        try:
            yield
        finally:
            os.dup2(kept, 1)
            os.close(kept)


def refuse_damaged(path: Path, solid: tuple[int, int]) -> None:
    """A solid has a volume; in its skin every edge joins exactly two faces (a seam joins a face to itself)."""
    if not 0 < gmsh.model.occ.getMass(*solid) < math.inf:
        raise UserError(f"geometry.cad: a solid in {path.name} has no volume; repair it in the CAD program")
    uses: Counter[int] = Counter()
    for surface in gmsh.model.getBoundary([solid], oriented=False):
        uses.update(edge for _, edge in gmsh.model.getBoundary([surface], combined=False, oriented=False))
    real = {edge: n for edge, n in uses.items() if gmsh.model.occ.getMass(1, edge) > 0}  # poles have none
    for wrong, what in ((lambda n: n < 2, "is open"), (lambda n: n > 2, "is not manifold")):
        count = sum(map(wrong, real.values()))
        if count:
            raise UserError(
                f"geometry.cad: a solid in {path.name} {what} along {count} edges; repair it in the CAD program"
            )


def join(path: Path, solids: list[tuple[int, int]], marks: Marks) -> Marks:
    """Make touching solids share their common surfaces; the new surfaces inherit label and colour."""
    occ = gmsh.model.occ
    before = sum(occ.getMass(*solid) for solid in solids)
    made = [entity for entity in occ.fragment(solids, [], removeObject=False)[0] if entity[0] == 3]
    occ.synchronize()
    heirs: Marks = {}
    for tag in boundary_surfaces(made):
        point = point_on(tag)
        heirs[tag] = next((marks[old] for old in marks if lies_on(old, point)), ("", None))
    occ.remove([solid for solid in solids if solid not in made], recursive=True)
    occ.synchronize()
    parts = count_parts(made)
    if parts > 1:
        raise UserError(
            f"geometry.cad: the solids of {path.name} fall into {parts} parts that share no face; "
            "join them in the CAD program or mesh each as a body of its own"
        )
    if sum(occ.getMass(*solid) for solid in made) < (1 - 1e-6) * before:
        warn(f"{path.name}: solids overlap; the common part is counted once")
    return heirs


def point_on(surface: int) -> np.ndarray:
    """Some point inside a trimmed surface."""
    low, high = map(np.array, gmsh.model.getParametrizationBounds(2, surface))
    for n in (2, 3, 5, 9, 17, 33, 65):
        for u in range(1, n):
            for v in range(1, n):
                at = low + (high - low) * [u / n, v / n]
                if gmsh.model.isInside(2, surface, at, parametric=True):
                    return gmsh.model.getValue(2, surface, at)
    return np.array(gmsh.model.occ.getCenterOfMass(2, surface))


def lies_on(surface: int, point: np.ndarray) -> bool:
    """Is the point on the trimmed surface? (isInside alone looks at its projection.)"""
    box = np.reshape(gmsh.model.getBoundingBox(2, surface), (2, 3))
    near = 1e-6 * np.linalg.norm(box[1] - box[0])
    if ((point < box[0] - near) | (point > box[1] + near)).any():
        return False
    closest, _ = gmsh.model.getClosestPoint(2, surface, point)
    return bool(np.linalg.norm(closest - point) < near and gmsh.model.isInside(2, surface, point))


def count_parts(solids: Sequence[tuple[int, int]]) -> int:
    """Number of groups of solids that hang together by common faces."""
    groups: list[set[int]] = []
    for solid in solids:
        mine = {tag for _, tag in gmsh.model.getBoundary([solid], oriented=False)}
        touching = [group for group in groups if group & mine]
        groups = [group for group in groups if not group & mine] + [mine.union(*touching)]
    return len(groups)


def warn_of_unit(path: Path, unit: str) -> None:
    """Bodies above 100 m or below 1 mm are mostly a wrong unit (`plausible.EXTENT`)."""
    box = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3)) * UNITS[unit]
    size = float(np.linalg.norm(box[1] - box[0]))
    if not EXTENT[0] <= size <= EXTENT[1]:
        warn(f"{path.name} is {size:.3g} m long in length_unit = {unit!r}; is the unit right?")

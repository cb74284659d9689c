"""Any mesh file -> `Mesh`: named faces, unit of length, quality gates.

Readers of their own (`msh` for MSH 4.1, `inp`, `cdb`, `med`, `unv`, `bdf`) keep node numbers and notice damage. Other
versions of MSH, VTU and VTK files go through meshio, which is called here only. Node orders are VTK's from here on.
"""

from __future__ import annotations

import contextlib
import copy
import io
import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Array, Indices, Lumps, Mesh
from ..errors import UserError, in_its_file
from ..files.hostile import tried
from ..files.store import ordinary
from ..plausible import DENSITY
from ..topology import CELL_TYPES, FACET_CORNERS
from ..units import density, usual_system
from .bdf import read_bdf
from .bdf_cards import included
from .cards import files_of
from .cdb import read_cdb
from .inp import read_inp
from .linking import renumbered
from .loading import state_of
from .lumps import hanging, on_mesh, points_of, spread
from .materials import NONE, Substitute, in_si
from .med import read_med
from .msh import is_msh41, read_msh41
from .raw import NODES, Damaged, RawMesh, refused, turn_left_handed
from .surface import boundary_facets, faces_from_points, match_facets
from .unv import UNIVERSAL, length_unit, read_unv

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
"""Unit of length -> metres."""

_FARTHEST = 1e9  # m; beyond it a file is damaged, and geometry loses its digits
_IGNORED = {"vertex", "line", "line3"}


@in_its_file
def read_mesh(
    path: Path | str, unit: str, system: str | None = None, zero: float = 0.0, instead: Substitute = NONE
) -> Mesh:
    """Read a volume mesh with its named sets.

    Args:
        path: gmsh's ``.msh``, an Abaqus or CalculiX ``.inp``, an Ansys ``.cdb``, ``.med``, ``.unv``, ``.vtu``, ``.vtk``
            or Nastran's ``.bdf``.
        unit: of the file's coordinates, a key of `UNITS`. system: of the units its materials are written in, a key of
            `units.SYSTEMS`; None: its materials are left out. zero: K of the file's temperature 0. instead: what stands
            for numbers that its materials lack.

    Returns:
        The mesh in metres. A named set of facets becomes a face; so does a named set of points in which whole
        boundary facets lie (it also stays a point set). A set with facets inside the volume becomes none and stands
        in `Mesh.inner`. Points that no cell uses are dropped.

    Raises:
        UserError: unreadable or truncated file, no volume cells, unsupported cells.
    """
    path = Path(path)
    if unit not in UNITS:
        raise UserError(f"the unit of length '{unit}' is unknown; choose one of {', '.join(UNITS)}")
    if not ordinary(path).is_file():
        raise UserError("no such mesh file; make it first or correct the path")
    try:
        raw = _read_raw(path)
        _parsed.cache_clear()  # a file that it includes may change
        if (said := unit_of(path)) not in ("", unit):
            raw.lost.append(f"the file tells its lengths in {said}, here they are taken in {unit}: which is right?")
        made = [in_si(m, system, zero, instead) for m in raw.materials] if system else []
        materials, lacking = tuple(m for m, _ in made), [text for _, text in made if text]
        raw.lost = [*lacking, *raw.lost]
        mesh = _mesh_of(raw, UNITS[unit], system or usual_system(unit))
        return replace(mesh, materials=materials, regions=mesh.regions if materials else {})
    except Damaged as error:
        raise _refused(path, error) from error
    except OSError as error:
        raise UserError(f"cannot be read ({error.strerror}); correct the path") from error


def _refused(path: Path, error: Damaged) -> UserError:
    """What is wrong with a file, or with a line of it, and what to do."""
    text = f"{error.args[0]}"
    remedy = "" if "; " in text else "; correct it or write it again"
    if error.file:
        return UserError(text + remedy, file=error.file)
    if re.match(r"line \d+: ", text):
        text = f"{path.name}, {text}"
    told = text if text.startswith(f"{path.name}, ") else f"cannot be used: {text}"
    return refused(path, told + remedy)


_READERS: dict[str, Callable[[Path], RawMesh]] = {
    **dict.fromkeys((".cdb", ".anf", ".mac", ".ans"), read_cdb),
    **dict.fromkeys((".bdf", ".nas", ".fem", ".dat"), read_bdf),
    **dict.fromkeys(UNIVERSAL, read_unv),
    ".inp": read_inp,
    ".med": read_med,
}

_BY_MESHIO = (".msh", ".vtu", ".vtk")


_LANGUAGES = (
    (".cdb", r"^\s*(/BATCH|/PREP7|/UNITS|/COM|NBLOCK|EBLOCK|ETBLOCK|ET),?"),
    (".inp", r"^\s*\*(HEADING|NODE|PART|INCLUDE|ELEMENT|MATERIAL)\b"),
    (".bdf", r"^\s*(SOL\s|CEND|BEGIN\s|GRID)"),
)
"""Reader, and the first words by which it is known, of files whose suffix several programs use."""


def suffix_of(path: Path) -> str:
    """The suffix of a file; of ``.dat`` and ``.inp`` that of the program whose words stand there.

    Workbench writes Ansys's commands into ``ds.dat``, Ansys's own input is called ``.inp``, and
    ``.dat`` is Nastran's.
    """
    suffix = path.suffix.lower()
    if suffix not in (".dat", ".inp") or not path.is_file():
        return suffix
    with ordinary(path).open(encoding="latin-1") as file:
        lines = [line for _, line in zip(range(2000), file, strict=False)]
    for line in lines:
        for language, words in _LANGUAGES:
            if re.match(words, line, re.IGNORECASE):
                return language
    return suffix


_TELLS = {"SI": "m", "MKS": "m", "UMKS": "um", "CGS": "cm", "MPA": "mm", "BFT": "ft", "BIN": "in"}
"""Ansys's /UNITS -> unit of length."""


def unit_of(path: Path) -> str:
    """The unit of length, a key of `UNITS`, that a file tells (/UNITS of Ansys, data set 164);
    empty if it does not."""
    if not path.is_file():
        return ""
    kind = suffix_of(path)
    if _READERS.get(kind) is read_cdb:
        text = ordinary(path).read_text(encoding="latin-1")
        said = re.search(r"^\s*/UNITS\s*,\s*(\w+)", text, re.IGNORECASE | re.MULTILINE)
        return _TELLS.get(said[1].upper(), "") if said else ""
    if _READERS.get(kind) is read_unv:
        return length_unit(ordinary(path).read_text(encoding="latin-1"), UNITS)
    return ""


def likely_unit(path: Path) -> str:
    """m or in where the file's densities are a solid's in these and far from it in mm; empty otherwise."""
    try:
        raw = _read_raw(path) if path.is_file() and suffix_of(path) in _READERS else None
    except UserError:
        return ""
    densities = [m.density for m in raw.materials if m.density] if raw else []
    if not densities or min(densities) * density("mm-t-s") < 40 * DENSITY[1]:
        return ""
    for unit in ("m", "in"):
        factor = density(usual_system(unit) or "")
        if all(DENSITY[0] <= value * factor <= DENSITY[1] for value in densities):
            return unit
    return ""


def _read_raw(path: Path) -> RawMesh:
    """A file's content, its own to change; the file that was read last is not parsed again."""
    found = ordinary(path).stat()
    return copy.deepcopy(_parsed(path, found.st_mtime_ns, found.st_size))


@lru_cache(maxsize=1)
def _parsed(path: Path, time: int, size: int) -> RawMesh:
    suffix = suffix_of(path)
    if suffix == ".msh" and is_msh41(path):
        return read_msh41(path)
    if suffix in _READERS:
        with ordinary(path).open("rb") as file:
            head = file.read(4096)
        if suffix != ".med" and head.count(0) > 8:
            way = "UTF-16; write it as UTF-8 or ASCII" if head[:2] in (b"\xff\xfe", b"\xfe\xff") else "no text"
            raise Damaged(f"it is {way}")
        return _READERS[suffix](path)
    if suffix in _BY_MESHIO:
        return _by_meshio(path, _from_meshio)
    known = ", ".join([*_READERS, *_BY_MESHIO])
    raise UserError(f"meshes are not read from a file '{suffix}'; use one of {known}")


def read_files(path: Path) -> list[Path]:
    """A mesh file and those that it reads (INCLUDE, INPUT); what is missing is told where it is read."""
    reader = _READERS.get(suffix_of(path))
    return files_of(path) if reader is read_inp else included(path) if reader is read_bdf else [path]


def _mesh_of(raw: RawMesh, metres: float, system: str | None) -> Mesh:
    foreign = sorted({kind for kind, cells in raw.blocks if kind not in CELL_TYPES and len(cells)})
    if foreign:
        way = f"convert the mesh to one of {', '.join(CELL_TYPES)}"
        if {"wedge18", "pyramid14"} & set(foreign):
            way += " (in gmsh: Mesh.SecondOrderIncomplete = 1)"
        raise UserError(f"cells of type {', '.join(foreign)} cannot be assembled; {way}")
    if raw.points.shape[1:] != (3,) or not np.isfinite(raw.points).all():
        lost = raw.node_id[~np.isfinite(raw.points).reshape(len(raw.points), -1).all(axis=1)]
        which = f"node {lost[0]} has others" if len(lost) else "there are others"
        raise UserError(f"coordinates must be three finite numbers a point, and {which}; correct them")
    _sort_by_region(raw)
    turn_left_handed(raw)
    cells: dict[str, list[Indices]] = {}
    for kind, connectivity in raw.blocks:
        if len(connectivity):
            cells.setdefault(kind, []).append(connectivity)
    if not cells:
        raise UserError("holds no volume cells (only surfaces or lines?); mesh the volume first")
    attached = hanging(raw)
    lumps = spread(raw, system)
    points = raw.points * metres
    away = np.abs(points).max(axis=1)
    if away.max() > _FARTHEST:
        node = raw.node_id[away.argmax()] if away.argmax() < len(raw.node_id) else ""
        raise UserError(f"node {node} lies {away.max():.3g} m from the origin; the file is damaged")
    whole = {t: np.concatenate(c) for t, c in cells.items()}
    mesh = _assemble_mesh(raw, points, whole, metres, system, lumps)
    return replace(mesh, hanging=attached, retained=tuple(n for n in raw.retained if n in mesh.point_sets))


# other formats, by meshio ----------------------------------------------------------------------------------------


@in_its_file
def point_data(path: Path) -> tuple[Array, dict[str, Array]]:
    """(n, 3) points of a file in its own unit and the values that it holds at them, by name.

    Raises:
        UserError: the file cannot be read.
    """
    try:
        mesh = _by_meshio(path, lambda found: found)
    except Damaged as error:
        raise UserError(f"is damaged or cannot be used ({error}); write it again") from error
    return np.asarray(mesh.points, dtype=float), {k: np.asarray(v) for k, v in mesh.point_data.items()}


def _by_meshio(path: Path, made: Callable[[Any], Any]) -> Any:
    """What is made of meshio's mesh."""
    import meshio

    _check_sections(path)
    _check_xml(path)
    if trouble := tried(path, _TRIAL):
        raise Damaged(f"reading it {trouble}")
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return made(meshio.read(path))
    except Damaged:
        raise
    except (Exception, SystemExit) as error:  # meshio raises whatever its parsers meet, and exits on some
        if isinstance(error, KeyError) and error.args[:1] and error.args[0] in NODES:
            kind = error.args[0]
            better = "write it as MSH 4.1" if path.suffix.lower() == ".msh" else "write it as .msh, .inp, .med or .unv"
            raise Damaged(f"cells of type {kind} are not read from this kind of {path.suffix}; {better}") from error
        text = str(error) if not isinstance(error, SystemExit) else said.getvalue()
        detail = " ".join(text.split())[-160:] or "unknown format"
        raise Damaged(f"not readable as {path.suffix or 'a file without suffix'}: {detail}") from error


def _check_sections(path: Path) -> None:
    """Truncated files of gmsh and numbers beyond the file's size, which meshio does not notice or survive."""
    if path.suffix.lower() != ".msh":
        return
    data = path.read_bytes()
    for name in re.findall(rb"^\$(?!End)(\w+)[ \t\r]*$", data, re.MULTILINE):
        if name in (b"Nodes", b"Elements", b"PhysicalNames", b"Entities") and b"$End" + name not in data:
            raise Damaged(f"the section ${name.decode()} has no end, the file is truncated")
    limit = max(10**7, 10 * len(data))
    if re.search(rb"^\$MeshFormat\s+[\d.]+\s+0\s", data) and any(
        int(number[:30]) > limit for number in re.findall(rb"(?<![\d.])\d{8,}(?![\d.])", data)
    ):
        raise Damaged("it holds a number that a file of this size cannot need")


_TRIAL = """
import meshio
try:
    meshio.read(path)
except SystemExit:
    pass
"""


def _check_xml(path: Path) -> None:
    """A mesh needs no entities; those of XML can grow without bounds and name other files."""
    if path.suffix.lower() == ".vtu" and re.search(rb"<!\s*(DOCTYPE|ENTITY)", path.read_bytes(), re.IGNORECASE):
        raise Damaged("it declares entities of XML, which no mesh needs")


def _from_meshio(mesh: Any) -> RawMesh:
    points = np.asarray(mesh.points, dtype=float)
    raw = RawMesh(points, np.arange(1, len(points) + 1))
    for block in mesh.cells:
        nodes = _valid(block.data, len(points))
        if block.type not in FACET_CORNERS and block.type not in _IGNORED:
            raw.blocks.append((block.type, nodes))
    for name, chosen in (mesh.point_sets or {}).items():
        raw.add_points(str(name), np.unique(_valid(chosen, len(points))))
    for name, per_block in _cell_sets(mesh).items():
        for block, chosen in zip(mesh.cells, per_block, strict=False):
            if chosen is None or not len(chosen):
                continue
            nodes = _valid(block.data, len(points))[_valid(chosen, len(block.data))]
            if block.type in {*FACET_CORNERS, *_IGNORED}:
                raw.add_to_set(name, block.type, nodes)
    return raw


def _valid(indices: Any, count: int) -> Indices:
    indices = np.asarray(indices, dtype=np.int64)
    if indices.size and not (0 <= indices.min() and indices.max() < count):
        raise Damaged("cells or sets refer to what is not in the file, it is truncated")
    return indices


def _cell_sets(raw: Any) -> dict[str, list]:
    """Set name -> chosen cells of each block. meshio leaves the groups of gmsh's format 2.2 as numbers of cells."""
    sets = {str(k): v for k, v in (raw.cell_sets or {}).items() if not str(k).startswith("gmsh:")}
    numbers = (raw.cell_data or {}).get("gmsh:physical")
    for name, (number, dimension) in (raw.field_data or {}).items() if numbers is not None else ():
        pairs = zip(raw.cells, numbers or (), strict=True)
        sets.setdefault(str(name), [np.flatnonzero(v == number) if b.dim == dimension else [] for b, v in pairs])
    return sets


# surface and faces ------------------------------------------------------------------------------------------------


def _assemble_mesh(
    raw: RawMesh,
    points: Array,
    cells: dict[str, Indices],
    metres: float,
    system: str | None,
    lumps: Lumps | None,
) -> Mesh:
    used = np.unique(np.concatenate([points_of(lumps), *(c.ravel() for c in cells.values())]))
    renumber = np.full(len(points), -1, dtype=np.int64)
    renumber[used] = np.arange(len(used))
    mesh = Mesh(
        points=points[used],
        cells={t: renumber[c] for t, c in cells.items()},
        regions={} if not raw.regions else {t: r for (t, _), r in zip(raw.blocks, raw.regions, strict=True) if len(r)},
        cell_id=_cell_numbers(raw),
        temperature=None if raw.temperature is None else raw.temperature[used],
        point_sets={n: kept for n, s in raw.point_sets.items() if len(kept := _kept(renumber[s]))},
        node_id=raw.node_id[used],
    )
    boundary = boundary_facets(mesh)
    faces: dict[str, dict[str, Indices]] = {}
    inner: dict[str, tuple[int, int]] = {}
    for name, blocks in raw.facets.items():
        face = match_facets(boundary, [renumber[b] for b in blocks])
        wanted = len({tuple(row) for b in blocks for row in np.sort(b, axis=1).tolist()})
        found = sum(map(len, face.values()))
        if found < wanted:
            inner[name] = (wanted - found, wanted)
        elif found:
            faces[name] = face
    for name, chosen in mesh.point_sets.items():
        if name in faces or name in inner:
            continue
        if face := faces_from_points(boundary, chosen, len(mesh.points)):
            faces[name] = face
    links = renumbered(raw, points, renumber, metres)
    state = state_of(raw, replace(mesh, links=links), renumber, boundary, metres, system)
    known = {*mesh.point_sets, *(links.sets if links else ())}
    supports = {n: directions for n, directions in raw.supports.items() if n in known}
    if idle := ", ".join(f"'{name}'" for name in raw.supports if name not in known):
        raw.remarks.append(
            f"held, but no element or constraint uses these nodes, so it holds nothing: {idle}"
        )
    return replace(
        mesh, faces=faces, inner=inner, supports=supports, not_held=tuple(raw.not_held), unended=raw.unended,
        links=links, state=state, integration=raw.integration,
        lost=tuple(raw.lost), remarks=tuple(raw.remarks), joints=tuple(raw.joints),
        sector=raw.sector, preloads=tuple(raw.preloads),
        instances={n: kept for n, s in raw.instances.items() if len(kept := _kept(renumber[s]))},
        lumps=None if lumps is None else on_mesh(lumps, renumber),
    )  # fmt: skip


def _cell_numbers(raw: RawMesh) -> dict[str, Indices]:
    """The file's numbers of the cells of each type, if it has any."""
    found: dict[str, list[Indices]] = {}
    for (kind, _), ids in zip(raw.blocks, raw.cell_id, strict=False):
        found.setdefault(kind, []).append(ids)
    return {kind: np.concatenate(parts) for kind, parts in found.items()}


def _sort_by_region(raw: RawMesh) -> None:
    """Blocks of one type put together, their cells in the order of their materials."""
    if not raw.regions:
        return
    blocks, regions, ids = [], [], []
    for kind in dict.fromkeys(kind for kind, _ in raw.blocks):
        own = [i for i, (k, _) in enumerate(raw.blocks) if k == kind]
        cells = np.concatenate([raw.blocks[i][1] for i in own])
        region = np.concatenate([raw.regions[i] for i in own])
        order = np.argsort(region, kind="stable")
        blocks.append((kind, cells[order]))
        regions.append(region[order])
        ids.append(np.concatenate([raw.cell_id[i] for i in own])[order])
    raw.blocks, raw.regions, raw.cell_id = blocks, regions, ids


def _kept(indices: Indices) -> Indices:
    return indices[indices >= 0]

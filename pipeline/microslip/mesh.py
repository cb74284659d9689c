"""Any mesh file -> `Mesh`: named faces, unit of length, quality gates.

The only place that calls meshio. Node orders are VTK's from here on; gmsh's different order of the last two
mid-side nodes of a ten-node tetrahedron is turned by meshio and checked by a test.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .data import Array, Indices, Mesh, UserError
from .topology import CELL_TYPES, FACET_CORNERS

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
"""Unit of length -> metres."""

_FIRST_ORDER = {"tetra", "hexahedron"}
_IGNORED = {"vertex", "line", "line3"}


def read_mesh(path: Path | str, unit: str) -> Mesh:
    """Read a volume mesh with its named sets.

    Args:
        path: any file meshio reads (``.msh``, ``.inp``, ``.med``, ``.vtu``, ``.bdf``, ...).
        unit: of the file's coordinates, a key of `UNITS`.

    Returns:
        The mesh in metres. A named set of facets becomes a face; so does a named set of points in which whole
        boundary facets lie (it also stays a point set). Points that no cell uses are dropped.

    Raises:
        UserError: unreadable or truncated file, no volume cells, unsupported cells.
    """
    path = Path(path)
    raw = _read_raw(path)
    cells, foreign = _volume_cells(raw)
    if foreign:
        raise UserError(
            f"{path}: cells of type {', '.join(sorted(foreign))} cannot be assembled; "
            f"convert the mesh to one of {', '.join(CELL_TYPES)}"
        )
    if not cells:
        raise UserError(f"{path}: holds no volume cells (only surfaces or lines?); mesh the volume first")
    if path.suffix.lower() == ".med":
        cells = {t: c[:, _mirrored(t)] for t, c in cells.items()}  # MED's own order
    points = np.asarray(raw.points, dtype=float) * UNITS[unit]
    if points.shape[1] != 3 or not np.isfinite(points).all():
        raise UserError(f"{path}: coordinates must be three finite numbers a point; the file is damaged or not 3-D")
    if max(c.max() for c in cells.values()) >= len(points):
        raise UserError(f"{path}: cells refer to points that are not in the file; it is truncated, write it again")
    return _assemble_mesh(points, cells, _named_facets(raw), _named_points(raw), path)


def _read_raw(path: Path):
    import meshio

    if not path.is_file():
        raise UserError(f"{path}: no such mesh file; make it first or correct the path")
    _know_more_abaqus_types()
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio raises whatever its parsers meet, and exits on some
        text = str(error) if not isinstance(error, SystemExit) else said.getvalue()
        detail = " ".join(text.split())[-160:] or "unknown format"
        raise UserError(f"{path}: is damaged or of a format that cannot be read ({detail}); write it again") from error


def _mirrored(cell_type: str) -> Indices:
    """Permutation between VTK's order and the mirrored one of MED, which meshio leaves as it is."""
    kind = CELL_TYPES[cell_type]
    corners = [0, 2, 1, 3] if kind.corners == 4 else [0, 3, 2, 1, 4, 7, 6, 5]
    image = kind.reference[: kind.corners][corners]
    # the affine map that takes each corner to its mirrored partner takes every other node to its own
    ones = np.ones((kind.corners, 1))
    map_ = np.linalg.lstsq(np.hstack([kind.reference[: kind.corners], ones]), image, rcond=None)[0]
    moved = np.hstack([kind.reference, np.ones((len(kind.reference), 1))]) @ map_
    return np.abs(moved[:, None] - kind.reference[None]).sum(axis=2).argmin(axis=1)


def _know_more_abaqus_types() -> None:
    """Second-order facets that mesh generators write beside the solid, which meshio's Abaqus reader lacks."""
    from meshio.abaqus import _abaqus

    known = getattr(_abaqus, "abaqus_to_meshio_type", {})
    for name, kind in {"CPS6": "triangle6", "CPE6": "triangle6", "S6": "triangle6", "CPS8": "quad8", "S8": "quad8"}.items():
        known.setdefault(name, kind)
    known["C3D4H"] = "tetra"


def _volume_cells(raw) -> tuple[dict[str, Indices], set[str]]:  # noqa: ANN001
    cells: dict[str, list[Indices]] = {}
    foreign: set[str] = set()
    for block in raw.cells:
        if block.type in CELL_TYPES:
            cells.setdefault(block.type, []).append(np.asarray(block.data, dtype=np.int64))
        elif block.type not in FACET_CORNERS and block.type not in _IGNORED and len(block.data):
            foreign.add(block.type)
    return {t: np.concatenate(b) for t, b in cells.items() if sum(map(len, b))}, foreign


def _cell_sets(raw) -> dict[str, list]:  # noqa: ANN001
    """Set name -> chosen cells of each block. meshio leaves the groups of gmsh's format 2.2 as numbers of cells."""
    sets = {str(k): v for k, v in (raw.cell_sets or {}).items() if not str(k).startswith("gmsh:")}
    numbers = (raw.cell_data or {}).get("gmsh:physical")
    for name, (number, dimension) in ((raw.field_data or {}).items() if numbers is not None else ()):
        pairs = zip(raw.cells, numbers, strict=True)
        sets.setdefault(str(name), [np.flatnonzero(v == number) if b.dim == dimension else [] for b, v in pairs])
    families = (raw.cell_data or {}).get("cell_tags", [])
    for number, names in getattr(raw, "cell_tags", {}).items():  # MED: a family of cells may bear several names
        for name in names:
            chosen = [np.flatnonzero(np.asarray(f) == number) for f in families]
            pairs = zip(sets.get(name, chosen), chosen, strict=True)
            sets[name] = [np.union1d(a, b) for a, b in pairs]
    return sets


def _named_facets(raw) -> dict[str, list[Indices]]:  # noqa: ANN001
    """Set name -> corner points of its facets, (f, 3) or (f, 4) per cell block."""
    named: dict[str, list[Indices]] = {}
    for name, per_block in _cell_sets(raw).items():
        for block, chosen in zip(raw.cells, per_block, strict=False):
            if block.type in FACET_CORNERS and chosen is not None and len(chosen):
                facets = np.asarray(block.data, dtype=np.int64)[np.asarray(chosen, dtype=np.int64)]
                named.setdefault(name, []).append(facets[:, : FACET_CORNERS[block.type]])
    return named


def _named_points(raw) -> dict[str, Indices]:  # noqa: ANN001
    named = {str(k): np.unique(np.asarray(v, dtype=np.int64)) for k, v in (raw.point_sets or {}).items()}
    for name, per_block in _cell_sets(raw).items():
        for block, chosen in zip(raw.cells, per_block, strict=False):
            if block.type in _IGNORED and chosen is not None and len(chosen):
                found = np.unique(np.asarray(block.data)[np.asarray(chosen, dtype=np.int64)])
                named[name] = np.union1d(named.get(name, np.zeros(0, dtype=np.int64)), found)
    return named


def _assemble_mesh(
    points: Array,
    cells: dict[str, Indices],
    facets: Mapping[str, list[Indices]],
    point_sets: Mapping[str, Indices],
    path: Path,
) -> Mesh:
    used = np.unique(np.concatenate([c.ravel() for c in cells.values()]))
    renumber = np.full(len(points), -1, dtype=np.int64)
    renumber[used] = np.arange(len(used))
    mesh = Mesh(
        points=points[used],
        cells={t: renumber[c] for t, c in cells.items()},
        point_sets={n: kept for n, s in point_sets.items() if len(kept := _kept(renumber[s]))},
        node_id=used + 1,
    )
    boundary = boundary_facets(mesh)
    faces: dict[str, dict[str, Indices]] = {}
    for name, blocks in facets.items():
        face = _match_facets(boundary, [renumber[b] for b in blocks])
        wanted, found = sum(map(len, blocks)), sum(map(len, face.values()))
        if found:
            faces[name] = face
        if found < wanted:
            raise UserError(
                f"{path}: {wanted - found} of {wanted} facets of the set '{name}' are not on the surface of the "
                "volume mesh; remove the set or mesh volume and surface together"
            )
    for name, chosen in mesh.point_sets.items():
        if name not in faces and (face := faces_from_points(boundary, chosen, len(mesh.points))):
            faces[name] = face
    return Mesh(mesh.points, mesh.cells, faces, mesh.point_sets, mesh.node_id)


def _kept(indices: Indices) -> Indices:
    return indices[indices >= 0]


def boundary_facets(mesh: Mesh) -> dict[str, Indices]:
    """Facets that belong to one cell only, by type, in the order that makes the normal point outwards."""
    by_type: dict[str, list[Indices]] = {}
    for cell_type, cells in mesh.cells.items():
        kind = CELL_TYPES[cell_type]
        every = np.concatenate([cells[:, list(f)] for f in kind.facets])
        by_type.setdefault(kind.facet_type, []).append(every)
    stacked = {t: np.concatenate(f) for t, f in by_type.items()}
    result = {}
    for corners in (3, 4):
        family = [t for t in stacked if FACET_CORNERS[t] == corners]
        if not family:
            continue
        keys = np.sort(np.concatenate([stacked[t][:, :corners] for t in family]), axis=1)
        _, inverse, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
        single = (count == 1)[inverse.ravel()]
        start = 0
        for t in family:
            chosen = single[start : start + len(stacked[t])]
            start += len(stacked[t])
            if chosen.any():
                result[t] = stacked[t][chosen]
    return result


def _match_facets(boundary: Mapping[str, Indices], wanted: Iterable[Indices]) -> dict[str, Indices]:
    """Boundary facets whose corners are those of the wanted ones (which may be first order or turned)."""
    wanted = list(wanted)
    result = {}
    for facet_type, facets in boundary.items():
        corners = FACET_CORNERS[facet_type]
        keys = {tuple(row) for w in wanted if w.shape[1] == corners for row in np.sort(w, axis=1).tolist()}
        if not keys:
            continue
        chosen = [i for i, row in enumerate(np.sort(facets[:, :corners], axis=1).tolist()) if tuple(row) in keys]
        if chosen:
            result[facet_type] = facets[chosen]
    return result


def faces_from_points(boundary: Mapping[str, Indices], chosen: Indices, n_points: int) -> dict[str, Indices]:
    """Boundary facets that lie wholly in a set of points."""
    inside = np.zeros(n_points, dtype=bool)
    inside[chosen] = True
    result = {}
    for facet_type, facets in boundary.items():
        whole = inside[facets].all(axis=1)
        if whole.any():
            result[facet_type] = facets[whole]
    return result


def mesh_problems(mesh: Mesh) -> tuple[list[str], list[str]]:
    """Look for what would spoil a solution: (errors, warnings), each a sentence without the file's name.

    Errors: unconnected parts, coincident points, repeated points in a cell, inside-out cells (by their corners;
    curved cells are examined at the quadrature points when they are assembled). Warnings: first-order cells.
    """
    errors, warnings = [], []
    for cell_type, cells in mesh.cells.items():
        repeated = (np.diff(np.sort(cells, axis=1), axis=1) == 0).any(axis=1)
        if repeated.any():
            errors.append(f"{repeated.sum()} {cell_type} cells name a point twice (first: {_first(repeated)}); they are degenerate, remesh")
            continue
        volume = corner_volumes(mesh, cell_type)
        scale = np.abs(volume).mean()
        if (flat := np.abs(volume) < 1e-9 * scale).any():
            errors.append(f"{flat.sum()} {cell_type} cells have no volume (first: {_first(flat)}); remesh")
        elif (inverted := volume < 0).any():
            errors.append(
                f"{inverted.sum()} of {len(cells)} {cell_type} cells are inside out (first: {_first(inverted)}); "
                "the node order is not the one of the format, or the mesh is damaged"
            )
        if cell_type in _FIRST_ORDER:
            warnings.append(
                f"first-order cells ({cell_type}) are too stiff in bending (frequencies can be tens of per cents "
                "high); use second-order ones"
            )
    pairs = _coincident(mesh.points)
    parts = part_numbers(mesh)
    if len(pairs):
        a, b = mesh.node_id[pairs[0]]
        errors.append(
            f"{len(pairs)} pairs of points coincide (first: nodes {a} and {b}), so neighbouring cells are not "
            "joined; merge duplicate nodes"
        )
    elif parts.max() > 0:
        sizes = np.bincount(parts)
        errors.append(
            f"the mesh falls into {len(sizes)} parts that share no points ({', '.join(map(str, sizes[:6]))} points); "
            "join them or give each its own body"
        )
    return errors, warnings


def _first(mask: Array) -> int:
    return int(np.flatnonzero(mask)[0]) + 1


def corner_volumes(mesh: Mesh, cell_type: str) -> Array:
    """(e,) signed volume of the tetrahedron at the cell's first corner times 6 (tetrahedra) or the mean over corners."""
    p = mesh.points[mesh.cells[cell_type]]
    if CELL_TYPES[cell_type].corners == 4:
        return np.linalg.det(p[:, 1:4] - p[:, :1])
    neighbours = ((0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7), (4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3))
    dets = np.array([np.linalg.det(np.stack([p[:, j] - p[:, i] for j in (a, b, c)], axis=1)) for i, a, b, c in neighbours])
    return dets.min(axis=0)


def _coincident(points: Array) -> Indices:
    size = np.ptp(points, axis=0).max()
    return cKDTree(points).query_pairs(1e-9 * size, output_type="ndarray")


def part_numbers(mesh: Mesh) -> Indices:
    """(n,) number of the connected part each point belongs to."""
    rows = np.concatenate([np.repeat(c[:, 0], c.shape[1] - 1) for c in mesh.cells.values()])
    cols = np.concatenate([c[:, 1:].ravel() for c in mesh.cells.values()])
    graph = sp.coo_matrix((np.ones(len(rows)), (rows, cols)), shape=(mesh.n_points, mesh.n_points))
    return connected_components(graph, directed=False)[1].astype(np.int64)

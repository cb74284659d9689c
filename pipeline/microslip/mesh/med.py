"""Reader of MED files (Salome, Code_Aster): HDF5 with one mesh, cells by type, groups by families.

Written against the description of the MED 3 and 4 file format. MED counts the corners of a cell the other way round
than VTK; its nodes on edges and faces stand in the order of the edges and faces of these corners.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..data import Flags, Indices
from ..files.hostile import HostileFile, read_hdf5
from ..topology import CELL_TYPES
from .raw import NODES, Damaged, RawMesh

_KINDS = {
    "PO1": "vertex", "SE2": "line", "SE3": "line3", "TR3": "triangle", "TR6": "triangle6", "QU4": "quad",
    "QU8": "quad8", "QU9": "quad9", "TE4": "tetra", "T10": "tetra10", "HE8": "hexahedron", "H20": "hexahedron20",
    "H27": "hexahedron27", "PE6": "wedge", "P15": "wedge15", "PY5": "pyramid", "P13": "pyramid13",
}  # fmt: skip
_IGNORED = {"SE4"}  # lines
_CORNERS = {4: (0, 2, 1, 3), 5: (0, 3, 2, 1, 4), 6: (0, 2, 1, 3, 5, 4), 8: (0, 3, 2, 1, 4, 7, 6, 5)}
"""Number of corners -> MED's corner at each of VTK's."""
_FACES = ((0, 1, 2, 3), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7))
"""Corners (MED's) of the faces in the order of the nodes 21 to 26 of a HEXA27."""


def read_med(path: Path) -> RawMesh:
    """Read the mesh.

    Raises:
        Damaged: hostile or damaged content, several meshes or steps, cells that cannot be assembled, by their type.
    """
    try:
        return read_hdf5(path, _read)
    except HostileFile as error:
        if isinstance(error.__cause__, Damaged):
            raise error.__cause__ from None
        raise Damaged(str(error)) from None


def _read(file: h5py.File) -> RawMesh:
    name, step = _only_step(file)
    nodes = step["NOE"]
    flat = np.asarray(nodes["COO"][()], dtype=float).ravel()
    count = _number(nodes["COO"], len(flat) // 3)
    if len(flat) != 3 * count or not count:
        raise Damaged(f"it holds {len(flat)} coordinates of {count} nodes; only meshes in space are read")
    number = np.asarray(nodes["NUM"][()], dtype=np.int64).ravel() if "NUM" in nodes else np.arange(1, count + 1)
    if len(number) != count or len(np.unique(number)) != count:
        raise Damaged("the numbers of its nodes are incomplete or stand there twice")
    raw = RawMesh(flat.reshape(3, count).T.copy(), number)
    families = _families(file, name)
    for group, chosen in _named(_per_cell(nodes, "FAM", count, 0), families):
        raw.add_points(group, np.flatnonzero(chosen))
    for kind, cells, family, ids in _cells(step, count):
        if kind in CELL_TYPES:
            raw.blocks.append((kind, cells[:, vtk_places(kind)]))
            raw.cell_id.append(ids)
            continue
        for group, chosen in _named(family, families):
            raw.add_to_set(group, kind, cells[chosen])
    return raw


def _only_step(file: h5py.File) -> tuple[str, h5py.Group]:
    meshes = list(file["ENS_MAA"]) if "ENS_MAA" in file else []
    if len(meshes) != 1:
        raise Damaged(f"it holds {len(meshes)} meshes; write one alone")
    mesh = file["ENS_MAA"][meshes[0]]
    if "NOE" in mesh:
        return meshes[0], mesh
    steps = [s for s in mesh.values() if isinstance(s, h5py.Group) and "NOE" in s and "COO" in s["NOE"]]
    if len(steps) != 1:
        raise Damaged(f"its mesh has nodes at {len(steps)} steps; write an unstructured mesh of one")
    return meshes[0], steps[0]


def _number(item: h5py.Dataset, otherwise: int) -> int:
    return int(item.attrs.get("NBR", otherwise))


def _cells(step: h5py.Group, points: int) -> Iterator[tuple[str, Indices, Indices, Indices]]:
    """Type, nodes (e, k) in MED's order, family and number of the cells of each type."""
    for name, group in (step["MAI"] if "MAI" in step else {}).items():
        if name in _IGNORED:
            continue
        if name not in _KINDS:
            first = int(np.asarray(group["NUM"][()]).flat[0]) if "NUM" in group and group["NUM"].size else 1
            raise Damaged(f"cell {first} is of MED's type {name}, which cannot be assembled")
        kind, flat = _KINDS[name], np.asarray(group["NOD"][()], dtype=np.int64).ravel()
        count = _number(group["NOD"], len(flat) // NODES[kind])
        if len(flat) != NODES[kind] * count:
            raise Damaged(f"its cells of the type {name} have another number of nodes than they need")
        if len(flat) and not (1 <= flat.min() and flat.max() <= points):
            raise Damaged(f"its cells of the type {name} name a node that is not in the file")
        family = _per_cell(group, "FAM", count, 0)
        yield kind, flat.reshape(NODES[kind], count).T - 1, family, _per_cell(group, "NUM", count, 1)


def _per_cell(group: h5py.Group, name: str, count: int, first: int) -> Indices:
    if name not in group:
        return np.arange(count) + 1 if first else np.zeros(count, dtype=np.int64)
    values = np.asarray(group[name][()], dtype=np.int64).ravel()
    if len(values) != count:
        raise Damaged(f"{group.name}/{name} has {len(values)} numbers for {count} cells")
    return values


def _families(file: h5py.File, mesh: str) -> dict[int, list[str]]:
    """Number of a family -> names of the groups it belongs to. Those of nodes are above 0, those of cells below."""
    found: dict[int, list[str]] = {}
    place = file.get(f"FAS/{mesh}")
    for side in ("NOEUD", "ELEME"):
        for family in (place[side] if isinstance(place, h5py.Group) and side in place else {}).values():
            names = family["GRO/NOM"][()] if "GRO/NOM" in family else ()
            found[int(family.attrs["NUM"])] = [n for n in map(_text, names) if n]
    return found


def _text(name: Any) -> str:
    """A name of 80 characters, as bytes or as numbers."""
    data = np.asarray(name).tobytes()
    return data.split(b"\0")[0].decode("utf-8", "replace").strip()


def _named(family: Indices, families: dict[int, list[str]]) -> Iterator[tuple[str, Flags]]:
    """Names of groups, and which of the members with these families belong to each."""
    for number in np.unique(family).tolist():
        for name in families.get(number, []) if number else []:
            yield name, family == number


def vtk_places(cell_type: str) -> list[int]:
    """Places in MED's list of the nodes of a cell in VTK's order."""
    kind = CELL_TYPES[cell_type]
    corner = _CORNERS[kind.corners]
    places, count = list(corner), len(kind.reference)
    edges = {frozenset(edge): kind.corners + i for i, edge in enumerate(kind.edges)}
    if count > kind.corners:
        places += [edges[frozenset((corner[a], corner[b]))] for a, b in kind.edges]
    if count == 27:
        faces = {frozenset(face): 20 + i for i, face in enumerate(_FACES)}
        places += [faces[frozenset(corner[i] for i in facet[:4])] for facet in kind.facets] + [26]
    return places

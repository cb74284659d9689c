"""Numbers and positions of nodes: a table, a mesh (then with its cells and sets), or GRID cards."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...data import Array, Indices, Mesh
from ...errors import UserError
from ...mesh import UNITS, read_mesh
from . import hdf5, matlab, nastran
from .found import Unreadable, pick, table

_TABLES = (".csv", ".txt", ".tsv", ".xyz")
_USUAL = ("NODES", "NODE", "COORDINATES", "XYZ", "GRID")


def read_nodes(path: Path, name: str, unit: str) -> Mesh:
    """The nodes as a mesh, in metres: with cells and sets if the file is a mesh.

    A table has the columns number, x, y, z.

    Raises:
        UserError: unreadable, nodes that are numbered twice.
        Unreadable: a table that is none.
    """
    suffix = path.suffix.lower()
    if suffix in _TABLES:
        return _mesh_of(table(path.read_text(encoding="utf-8", errors="replace"), 4, path.name), unit)
    if suffix in (".mat", ".h5", ".hdf5"):
        return _mesh_of(_stored(path, name), unit)
    if suffix in (".bdf", ".dat", ".nas", ".pch"):
        return _mesh_of(nastran.grids(path), unit)
    return read_mesh(path, unit)


def _stored(path: Path, name: str) -> Array:
    import h5py

    if h5py.is_hdf5(path):
        if not name:
            raise UserError(f"say which table holds number, x, y, z as {path.name}#NAME")
        return hdf5.read_table(path, name, 4)
    import scipy.io

    known = [n for n, shape, _ in matlab._trusting(scipy.io.whosmat, path) if len(shape) == 2 and shape[1] == 4]
    found = pick(known, name, _USUAL, path)
    return np.asarray(matlab._trusting(scipy.io.loadmat, path, variable_names=[found])[found], dtype=float)


def _mesh_of(values: Any, unit: str) -> Mesh:
    values = np.asarray(values, dtype=float)
    number = values[:, 0]
    if not len(values) or not np.isfinite(values).all() or np.abs(values).max() > 1e15:
        raise Unreadable("the table of nodes holds no nodes, or numbers that are not finite")
    if (number != np.round(number)).any() or number.min() < 1:
        raise Unreadable("the first column must be the number of the node, a whole number from 1 on")
    ids = number.astype(np.int64)
    twice = np.flatnonzero(np.bincount(np.unique(ids, return_inverse=True)[1]) > 1)
    if len(twice):
        raise Unreadable(f"node {np.unique(ids)[twice[0]]} is given twice")
    return Mesh(values[:, 1:] * UNITS[unit], {}, {}, {}, ids)


def read_dofs(path: Path) -> Indices:
    """(m, 2) node number and component (1 to 6; 0 0: generalised) of every row, from ``node.direction`` or two columns.

    Raises:
        Unreadable: other things.
    """
    from .calculix import read_dof

    text = path.read_text(encoding="utf-8", errors="replace")
    words = [line for line in text.splitlines() if line.strip()]
    if words and len(words[0].replace(",", " ").split()) == 1:
        return read_dof(path)
    values = table(text, 2, path.name)
    if (values != np.round(values)).any() or np.abs(values).max(initial=0.0) > 1e15:
        raise Unreadable(f"{path.name} must hold whole numbers: node and direction (1 to 6)")
    return values.astype(np.int64)

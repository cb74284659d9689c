"""CalculiX ``*FREQUENCY, SOLVER=MATRIXSTORAGE``: upper triangles in .sti and .mas, node.direction of rows in .dof."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...data import Indices
from .found import StoredMatrix, Unreadable, sparse, square, table


def names(path: Path) -> list[str]:
    """A file holds one matrix."""
    return [path.stem]


def read(path: Path, name: str) -> StoredMatrix:
    """Read a .sti or .mas file, and the .dof file beside it.

    Raises:
        Unreadable: it is not what CalculiX writes.
    """
    beside = path.with_suffix(".dof")
    if not beside.is_file():
        raise Unreadable(f"the file {beside.name}, which names its rows, is not beside it")
    dofs = read_dof(beside)
    entries = table(path.read_text(encoding="ascii", errors="replace"), 3, "the matrix")
    i, j = entries[:, 0].astype(np.int64) - 1, entries[:, 1].astype(np.int64) - 1
    upper = sparse(entries[:, 2], i, j, len(dofs))
    off = upper.copy()
    off.setdiag(0)
    return StoredMatrix(square(upper + off.T, "the matrix"), dofs)


def read_dof(path: Path) -> Indices:
    """(m, 2) node number and direction of every row.

    Raises:
        Unreadable: a line that is no ``node.direction``.
    """
    lines = path.read_text(encoding="ascii", errors="replace").split()
    try:
        pairs = [line.split(".") for line in lines]
        return np.array([[int(node), int(way)] for node, way in pairs], dtype=np.int64).reshape(-1, 2)
    except (ValueError, OverflowError):
        raise Unreadable(f"{path.name} holds a line that is no node.direction") from None

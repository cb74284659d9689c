"""Nastran: OUTPUT4 files, and DMIG cards, which name node and component of every row. Read by pyyeti."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from .found import DENSE, StoredMatrix, Unreadable, sparse, square


def names(path: Path) -> list[str]:
    """Matrices of the file, in capitals.

    Raises:
        Unreadable: neither OUTPUT4 nor DMIG cards.
    """
    if path.suffix.lower() == ".op4":
        return [name.upper() for name in _op4(path)]
    return [name.upper() for name in _dmig(path)]


def read(path: Path, name: str) -> StoredMatrix:
    """Read one matrix.

    Raises:
        Unreadable: damaged.
    """
    if path.suffix.lower() == ".op4":
        return StoredMatrix(square(_op4(path)[name.lower()], name))
    frame = _dmig(path)[name.lower()]
    rows = np.array([tuple(i) for i in frame.index], dtype=np.int64).reshape(-1, 2)
    cols = np.array([tuple(i) for i in frame.columns], dtype=np.int64).reshape(-1, 2)
    dofs = np.unique(np.vstack([rows, cols]), axis=0)
    place = {tuple(d): i for i, d in enumerate(dofs.tolist())}
    values = np.asarray(frame, dtype=float)
    i, j = np.nonzero(values)
    at = [np.array([place[tuple(d)] for d in side.tolist()], dtype=np.int64) for side in (rows, cols)]
    return StoredMatrix(square(sparse(values[i, j], at[0][i], at[1][j], len(dofs)), name), dofs)


def grids(path: Path) -> Any:
    """(k, 4) number, x, y, z of GRID cards in the basic system.

    Raises:
        Unreadable: no GRID cards, or local systems.
    """
    from pyyeti.nastran import bulk

    found = _quietly(bulk.rdgrids, path)
    if found is None or not len(found):
        raise Unreadable("it holds no GRID cards")
    if np.any(found[:, 1] != 0) or np.any(found[:, 5] > 0):
        raise Unreadable("its GRID cards use local coordinate systems; write them in the basic one")
    return found[:, [0, 2, 3, 4]]


def _op4(path: Path) -> Any:
    from pyyeti.nastran import op4

    found = _quietly(op4.read, path, sparse=True)
    if not found:
        raise Unreadable("it holds no matrix of OUTPUT4")
    return found


def _dmig(path: Path) -> Any:
    from pyyeti.nastran import bulk

    found = _quietly(bulk.rddmig, path)
    if not found:
        raise Unreadable("it holds no DMIG cards")
    if any(max(frame.shape) > DENSE for frame in found.values()):
        raise Unreadable(f"DMIG matrices of more than {DENSE} rows are not read; write OUTPUT4")
    return found


def _quietly(reader: Any, path: Path, **how: Any) -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return reader(str(path), **how)
    except (Exception, SystemExit) as error:  # pyyeti raises whatever its parser meets
        if isinstance(error, ModuleNotFoundError):
            raise
        raise Unreadable(f"not readable as Nastran's ({' '.join(str(error).split())[:100]})") from error

"""HDF5: a full matrix as a dataset; a sparse one as a group in one of three usual ways.

``row, col, data`` (entries), ``indptr, indices, data`` (compressed rows), ``jc, ir, data`` (compressed columns, as
MATLAB 7.3 stores them). Nothing that leaves the file is followed.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.sparse as sp

from ...files.hostile import HostileFile, read_hdf5
from .found import DENSE, StoredMatrix, Unreadable, square

_WAYS = (("row", "col", "data"), ("indptr", "indices", "data"), ("jc", "ir", "data"))
_SKIP = "#refs#"


def names(path: Path) -> list[str]:
    """Paths of the file's matrices.

    Raises:
        Unreadable: damaged or hostile.
    """
    return _guarded(path, _names)


def read(path: Path, name: str) -> StoredMatrix:
    """Read one matrix.

    Raises:
        Unreadable: damaged or hostile, no matrix.
    """
    return StoredMatrix(square(_guarded(path, lambda file: _matrix(file[name], name)), name))


def read_table(path: Path, name: str, columns: int) -> Any:
    """(k, columns) numbers of a dataset, either way round (MATLAB's dimensions are reversed).

    Raises:
        Unreadable: it is none.
    """
    values = _guarded(path, lambda file: np.asarray(file[name][()], dtype=float))
    if values.ndim == 2 and values.shape[1] != columns and values.shape[0] == columns:
        values = values.T
    if values.ndim != 2 or values.shape[1] != columns:
        raise Unreadable(f"{name} is no table of {columns} columns")
    return values


def _guarded(path: Path, action: Callable[[h5py.File], Any]) -> Any:
    try:
        return read_hdf5(path, action)
    except HostileFile as error:
        if isinstance(error.__cause__, Unreadable):
            raise error.__cause__ from None
        raise Unreadable(str(error)) from error


def _names(group: h5py.Group, where: str = "") -> list[str]:
    found = []
    for name, item in group.items():
        place = f"{where}{name}"
        if name == _SKIP:
            continue
        if isinstance(item, h5py.Group):
            found += [place] if _way(item) else _names(item, f"{place}/")
        elif item.ndim == 2 and item.shape[0] == item.shape[1] and item.dtype.kind in "fiu":
            found.append(place)
    return found


def _way(group: h5py.Group) -> tuple[str, str, str] | None:
    return next((way for way in _WAYS if all(part in group for part in way)), None)


def _matrix(item: h5py.Dataset | h5py.Group, name: str) -> Any:
    if isinstance(item, h5py.Dataset):
        if max(item.shape, default=0) > DENSE:
            raise Unreadable(f"{name} is stored in full with {max(item.shape)} rows; store it sparse")
        return np.asarray(item[()]).T  # MATLAB's order; of a symmetric matrix the same
    way = _way(item)
    if way is None:
        raise Unreadable(f"{name} is neither a full nor a sparse matrix")
    a, b, data = (np.asarray(item[part][()]).ravel() for part in way)
    if way[0] == "row":
        n = int(item.attrs["shape"][0]) if "shape" in item.attrs else int(max(a.max(initial=-1), b.max(initial=-1)) + 1)
        return _entries(data, a, b, n)
    a, b, n = a.astype(np.int64), b.astype(np.int64), len(a) - 1
    if len(a) < 2 or a[0] != 0 or (np.diff(a) < 0).any() or a[-1] != len(b) or len(b) != len(data):
        raise Unreadable(f"{name} is no compressed matrix")
    outer = np.repeat(np.arange(n), np.diff(a))
    return _entries(data, outer, b, n) if way[0] == "indptr" else _entries(data, b, outer, n)


def _entries(data: Any, rows: Any, cols: Any, n: int) -> sp.csr_matrix:
    from .found import sparse

    return sparse(data, rows, cols, n)

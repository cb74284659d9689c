"""MATLAB's .mat up to version 7 by scipy, 7.3 as HDF5; full or sparse matrices."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py

from ...files.hostile import tried
from . import hdf5
from .found import DENSE, StoredMatrix, Unreadable, square


def names(path: Path) -> list[str]:
    """Matrices of the file, larger than one number.

    Raises:
        Unreadable: no .mat file.
    """
    if h5py.is_hdf5(path):
        return hdf5.names(path)
    import scipy.io

    return [
        name
        for name, shape, kind in _trusting(scipy.io.whosmat, path)
        if len(shape) == 2 and shape[0] == shape[1] and kind in ("double", "single", "sparse")
    ]


def read(path: Path, name: str) -> StoredMatrix:
    """Read one variable.

    Raises:
        Unreadable: damaged, or too large.
    """
    if h5py.is_hdf5(path):
        return hdf5.read(path, name)
    import scipy.io

    for found, shape, kind in _trusting(scipy.io.whosmat, path):
        if found == name and kind != "sparse" and max(shape) > DENSE:
            raise Unreadable(f"{name} is stored in full with {max(shape)} rows; store it sparse")
    return StoredMatrix(square(_trusting(scipy.io.loadmat, path, variable_names=[name])[name], name))


_TRIAL = """
import scipy.io
scipy.io.whosmat(str(path))
scipy.io.loadmat(str(path))
"""


def _trusting(reader: Any, path: Path, **how: Any) -> Any:
    """Call scipy, whose compiled parser does not survive every damaged file."""
    if trouble := tried(path, _TRIAL):
        raise Unreadable(f"it is damaged (reading it {trouble})")
    try:
        return reader(str(path), **how)
    except (Exception, SystemExit) as error:  # scipy raises whatever its parser meets
        raise Unreadable(f"no .mat file that can be read ({' '.join(str(error).split())[:100]})") from error

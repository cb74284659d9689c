"""NumPy's .npz: SciPy's ``save_npz`` of one sparse matrix, or several as NAME_data, NAME_indices, NAME_indptr,
NAME_shape (compressed rows) and full ones. Nothing in it is executed."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from .found import DENSE, StoredMatrix, Unreadable, square

_PARTS = ("data", "indices", "indptr", "shape")
LARGEST_FILE = 2**34
"""Bytes that the arrays of a file may take in memory."""


def names(path: Path) -> list[str]:
    """Matrices of the file.

    Raises:
        Unreadable: damaged, or no .npz file.
    """
    stored = _stored(path)
    if set(_PARTS) <= set(stored):
        return [path.stem]
    parts = [name.removesuffix("_data") for name in stored if name.endswith("_data")]
    sparse = [name for name in parts if all(f"{name}_{part}" in stored for part in _PARTS)]
    taken = {f"{name}_{part}" for name in sparse for part in _PARTS}
    return [*sparse, *(name for name in stored if name not in taken)]


def read(path: Path, name: str) -> StoredMatrix:
    """Read one matrix.

    Raises:
        Unreadable: damaged, or no matrix.
    """
    stored = _stored(path)
    single = set(_PARTS) <= set(stored)
    if single or f"{name}_data" in stored:
        kind = str(_array(path, "format").astype(str)) if "format" in stored and single else "csr"
        parts = {part: _array(path, part if single else f"{name}_{part}") for part in _PARTS}
        return StoredMatrix(square(_compressed(parts, kind, name), name))
    whole = _array(path, name)
    if max(whole.shape, default=0) > DENSE:
        raise Unreadable(f"{name} is stored in full with {max(whole.shape)} rows; store it sparse")
    return StoredMatrix(square(whole, name))


def _compressed(parts: dict[str, Any], kind: str, name: str) -> Any:
    kinds = {"csr": sp.csr_matrix, "csc": sp.csc_matrix}
    if kind not in kinds or parts["shape"].shape != (2,) or parts["data"].dtype.kind not in "fiuc":
        raise Unreadable(f"{name} is no matrix of compressed rows or columns")
    try:
        return kinds[kind]((parts["data"], parts["indices"], parts["indptr"]), shape=tuple(parts["shape"].tolist()))
    except (ValueError, TypeError, IndexError) as error:
        raise Unreadable(f"{name} is no compressed matrix ({' '.join(str(error).split())[:80]})") from error


def _stored(path: Path) -> list[str]:
    """Names of the arrays, after a look at their size."""
    try:
        with zipfile.ZipFile(path) as archive:
            inside = archive.infolist()
    except (zipfile.BadZipFile, ValueError) as error:
        raise Unreadable("it is damaged or no .npz file") from error
    if sum(item.file_size for item in inside) > LARGEST_FILE:
        raise Unreadable(f"its arrays are larger than {LARGEST_FILE // 2**30} GiB")
    return [item.filename.removesuffix(".npy") for item in inside]


def _array(path: Path, name: str) -> Any:
    try:
        with np.load(path, allow_pickle=False) as archive:
            return np.asarray(archive[name])
    except Exception as error:  # numpy and zlib raise whatever a damaged file makes them meet
        raise Unreadable(f"{name} cannot be read ({' '.join(str(error).split())[:80]})") from error

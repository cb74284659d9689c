"""What one file of matrices holds, and the refusal of what cannot be one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...data import Array, Indices
from ...errors import UserError
from ...settings.mistakes import is_number

LARGEST = 50_000_000
"""Rows at most: more is a damaged header."""

DENSE = 20_000
"""Rows of a matrix that is stored in full, at most."""


@dataclass(frozen=True)
class StoredMatrix:
    """One matrix of a file: (m, m), and the (m, 2) node number and component (1 to 6; 0: generalised) of its rows."""

    matrix: sp.csr_matrix
    dofs: Indices | None = None


class Unreadable(ValueError):
    """A file that contradicts itself. The text says how, without the file's name."""


def sparse(values: Any, rows: Any, cols: Any, n: int) -> sp.csr_matrix:
    """(n, n) from entries, 0-based.

    Raises:
        Unreadable: entries outside, a size beyond all bounds.
    """
    rows, cols = np.asarray(rows, dtype=np.int64).ravel(), np.asarray(cols, dtype=np.int64).ravel()
    values = np.asarray(values, dtype=float).ravel()
    if not 0 < n <= LARGEST:
        raise Unreadable(f"a matrix of {n} rows cannot be used")
    if not len(rows) == len(cols) == len(values):
        raise Unreadable("entries and their places differ in number")
    if len(rows) and (min(rows.min(), cols.min()) < 0 or max(rows.max(), cols.max()) >= n):
        raise Unreadable(f"an entry lies outside the {n} rows and columns")
    return sp.coo_matrix((values, (rows, cols)), shape=(n, n)).tocsr()


def square(matrix: Any, name: str) -> sp.csr_matrix:
    """A real, square, finite matrix of any kind as CSR.

    Raises:
        Unreadable: it is none.
    """
    if sp.issparse(matrix):
        _check_places(matrix, name)
    else:
        matrix = np.asarray(matrix)
        if matrix.dtype.kind not in "fiuc" or matrix.ndim != 2:
            raise Unreadable(f"{name} is no matrix of numbers")
    if matrix.shape[0] != matrix.shape[1] or not matrix.shape[0]:
        raise Unreadable(f"{name} has {matrix.shape[0]} rows and {matrix.shape[1]} columns; it must be square")
    out = sp.csr_matrix(matrix)
    if np.iscomplexobj(out.data):
        if np.abs(out.data.imag).max(initial=0.0) > 0:
            raise Unreadable(f"{name} is complex; hysteretic damping is not read, give the real matrix")
        out = sp.csr_matrix((out.data.real, out.indices, out.indptr), shape=out.shape)
    out = out.astype(float)
    if not np.isfinite(out.data).all():
        raise Unreadable(f"{name} holds a number that is not finite")
    out.sum_duplicates()
    return out


def _check_places(matrix: Any, name: str) -> None:
    """Sparse matrices of damaged files point anywhere; scipy's compiled loops would follow them.

    Raises:
        Unreadable: they do.
    """
    try:
        if hasattr(matrix, "indptr"):
            matrix.check_format(full_check=True)
        else:
            entries = matrix.tocoo()
            sparse(np.zeros(entries.nnz), entries.row, entries.col, max(matrix.shape))
    except (ValueError, IndexError, TypeError) as error:
        raise Unreadable(f"{name} is damaged ({' '.join(str(error).split())[:80]})") from error


def pick(names: list[str], wanted: str, usual: tuple[str, ...], path: Path) -> str:
    """Which of a file's matrices is meant: the one named, the only one, or the first of the usual names.

    Raises:
        UserError: there is none of that name, or it is not clear which.
    """
    known = {name.upper(): name for name in names}
    if wanted:
        if wanted.upper() in known:
            return known[wanted.upper()]
        raise UserError(f"holds no matrix '{wanted}'; it holds {', '.join(names) or 'none'}")
    if found := [known[u] for u in usual if u in known]:
        return found[0]
    if len(names) == 1:
        return names[0]
    raise UserError(f"holds {', '.join(names) or 'no matrix'}; say which one is meant as {path.name}#NAME")


def table(text: str, columns: int, what: str) -> Array:
    """(k, columns) numbers of a text, split at spaces and commas.

    Raises:
        Unreadable: other things, or a line of another length.
    """
    rows = [line.replace(",", " ").replace(";", " ").split() for line in text.splitlines()]
    rows = [row for row in rows if row and not row[0].startswith(("#", "%", "*"))]
    if rows and not is_number(rows[0][0]):
        rows = rows[1:]  # a heading
    for number, row in enumerate(rows):
        if len(row) != columns:
            raise Unreadable(f"line {number + 1} of {what} has {len(row)} entries instead of {columns}")
    try:
        return np.array([[float(v) for v in row] for row in rows]).reshape(-1, columns)
    except ValueError as error:
        raise Unreadable(f"{what} holds something that is no number ({str(error)[-60:]})") from None

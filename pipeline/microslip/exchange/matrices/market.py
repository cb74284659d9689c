"""Matrix Market: coordinate and array files, general, symmetric or skew-symmetric (Boisvert, Pozo, Remington 1996)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp

from .found import LARGEST, Found, Unreadable, sparse, square

_KINDS = ("general", "symmetric", "skew-symmetric")


def names(path: Path) -> list[str]:
    """A file holds one matrix, which has no name."""
    return [path.stem]


def read(path: Path, name: str) -> Found:
    """Read the matrix.

    Raises:
        Unreadable: it is not what the format says.
    """
    with open(path, encoding="ascii", errors="replace") as file:
        head = file.readline().lower().split()
        if len(head) != 5 or head[:2] != ["%%matrixmarket", "matrix"]:
            raise Unreadable("the first line is not that of a Matrix Market file")
        form, field, kind = head[2:]
        if field not in ("real", "integer", "double") or kind not in _KINDS or form not in ("coordinate", "array"):
            raise Unreadable(f"a matrix '{form} {field} {kind}' is not read; write it real and general or symmetric")
        line = file.readline()
        while line.startswith("%") or (line and not line.strip()):
            line = file.readline()
        size = _whole(line)
        if len(size) != (3 if form == "coordinate" else 2) or size[0] != size[1] or not 0 < size[0] <= LARGEST:
            raise Unreadable(f"a matrix of the size '{line.strip()[:60]}' cannot be used; it must be square")
        rest = file.read()
    if form == "array":
        return Found(_array(rest, size[0], kind))
    if size[2] > len(rest):
        raise Unreadable(f"the file is cut off: it announces {size[2]} entries")
    try:
        entries = np.array(rest.split(), dtype=float).reshape(-1, 3)
    except ValueError:
        raise Unreadable("entries are not 'row column value' throughout") from None
    if len(entries) != size[2]:
        raise Unreadable(f"it announces {size[2]} entries and holds {len(entries)}")
    i, j, v = entries[:, 0].astype(np.int64) - 1, entries[:, 1].astype(np.int64) - 1, entries[:, 2]
    return Found(square(_both_halves(sparse(v, i, j, size[0]), kind), "the matrix"))


def _whole(line: str) -> list[int]:
    try:
        return [int(word) for word in line.split()]
    except ValueError:
        return []


def _both_halves(matrix: sp.csr_matrix, kind: str) -> sp.csr_matrix:
    if kind == "general":
        return matrix
    off = matrix.copy()
    off.setdiag(0)
    return matrix + (off.T if kind == "symmetric" else -off.T)


def _array(text: str, n: int, kind: str) -> sp.csr_matrix:
    try:
        values = np.array(text.split(), dtype=float)
    except ValueError:
        raise Unreadable("the entries are not all numbers") from None
    wanted = n * n if kind == "general" else n * (n + 1) // 2 if kind == "symmetric" else n * (n - 1) // 2
    if len(values) != wanted:
        raise Unreadable(f"it needs {wanted} entries and holds {len(values)}")
    if kind == "general":
        return square(values.reshape(n, n).T, "the matrix")
    full = np.zeros((n, n))
    lower = np.tril_indices(n, 0 if kind == "symmetric" else -1)
    order = np.lexsort((lower[0], lower[1]))  # by columns
    full[lower[0][order], lower[1][order]] = values
    return square(full + np.tril(full, -1).T * (1 if kind == "symmetric" else -1), "the matrix")

"""Matrix Market, read by SciPy: coordinate and array files, general, symmetric or skew-symmetric."""

from __future__ import annotations

from pathlib import Path

import scipy.io

from .found import LARGEST, StoredMatrix, Unreadable, square


def names(path: Path) -> list[str]:
    """A file holds one matrix, which has no name."""
    return [path.stem]


def read(path: Path, name: str) -> StoredMatrix:
    """Read the matrix.

    Raises:
        Unreadable: it is not what the format says.
    """
    try:
        n, columns, count, form, field, kind = scipy.io.mminfo(str(path))
    except (ValueError, OverflowError) as error:
        raise Unreadable(f"it is no Matrix Market file ({error})") from None
    if field not in ("real", "integer", "double") or kind == "hermitian":
        raise Unreadable(f"a matrix '{form} {field} {kind}' is not read; write it real and general or symmetric")
    if n != columns or not 0 < n <= LARGEST:
        raise Unreadable(f"a matrix of {n} rows and {columns} columns cannot be used; it must be square")
    count = count if form == "coordinate" else n * (n - 1) // 2
    if count > path.stat().st_size:  # before room is made for them
        raise Unreadable(f"the file is cut off: it announces {count} entries")
    try:
        found = scipy.io.mmread(str(path))
    except (ValueError, OverflowError) as error:
        raise Unreadable(f"it announces {count} entries, which cannot be read ({error})") from None
    return StoredMatrix(square(found, "the matrix"))

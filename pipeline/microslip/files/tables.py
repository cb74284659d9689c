"""Tables as comma-separated text: a head, and a line a row."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..data import Array


def rows_csv(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Of cells that are written already."""
    return "\n".join(",".join(row) for row in (head, *rows)) + "\n"


def columns_csv(columns: Mapping[str, Array], digits: int) -> str:
    """Of name -> numbers, columns of equal length, so many significant digits of each."""
    rows = zip(*columns.values(), strict=True)
    return rows_csv(columns, ((f"{v:.{digits}g}" for v in row) for row in rows))

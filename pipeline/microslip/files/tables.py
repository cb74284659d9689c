"""Tables as comma-separated text: a head, and a line a row."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from .store import write_text


def rows_csv(head: Iterable[str], rows: Iterable[Iterable[str | float]], digits: int = 8) -> str:
    """Numbers with so many significant digits, an empty cell for one that is not known (NaN); texts in quotes where
    they hold a comma (RFC 4180)."""
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(head)
    lines.writerows([_cell(v, digits) for v in row] for row in rows)
    return text.getvalue()


def _cell(value: str | float, digits: int) -> str:
    return value if isinstance(value, str) else "" if value != value else f"{value:.{digits}g}"


def columns_csv(columns: Mapping[str, Iterable[Any]], digits: int) -> str:
    """Of name -> numbers or texts, columns of equal length."""
    return rows_csv(columns, zip(*columns.values(), strict=True), digits)


def write_columns(columns: Mapping[str, Iterable[Any]], digits: int, path: Path) -> None:
    """Name -> numbers or texts, as a file."""
    write_text(path, columns_csv(columns, digits))


def csv_files(tables: Mapping[str, Mapping[str, Iterable[Any]]], digits: int) -> dict[str, Callable[[Path], None]]:
    """File name -> what writes its columns; those without columns are left out."""
    return {name: partial(write_columns, of, digits) for name, of in tables.items() if of}


def write_tables(folder: Path, tables: Mapping[str, Mapping[str, Iterable[Any]]], digits: int) -> list[Path]:
    """Write file name -> columns; those without columns are left out."""
    files = csv_files(tables, digits)
    for name, write in files.items():
        write(folder / name)
    return [folder / name for name in files]

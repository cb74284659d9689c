"""What the pages of a response and of a survey say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..units import Quantity
from .page import Album, Piece, fold, number, page, say, table

MOST_ROWS = 60
"""Rows of a table that a page shows at once; the others unfold."""

SHOWN = (
    "friction response", "stress over frequency", "stress over normal force", "stress at resonance", "Haigh diagram",
    "contacts at resonance",
)  # fmt: skip
"""Pictures of a response in their order."""


def response_html(summary: Mapping[str, Any], pictures: Mapping[str, Path]) -> str:
    """The page of a case alone.

    Args:
        summary: the response of `body.report_html`; its messages stand on top. pictures: name -> file.
    """
    told = {k: v for k, v in summary.items() if k not in ("messages", "pictures")}
    pieces = [say(*summary.get("messages", []), tone="warn"), *response_pieces(told, Album(pictures))]
    return page(f"{summary.get('case', 'case')}: friction response", pieces)


def survey_html(
    title: str, sentences: Sequence[str], tables: Mapping[str, Mapping[str, Any]], pictures: Sequence[Path]
) -> str:
    """The page of a survey: what was found in words, pictures and tables (file name -> column -> values)."""
    album = Album({p.name: p for p in pictures})
    pieces = [say(*sentences, tone="note"), *album.begun("")]
    for name, columns in tables.items():
        rows = [[number(float(v), 5) for v in row] for row in zip(*columns.values(), strict=True)]
        shown = table([_label(key) for key in columns], rows)
        pieces += [Piece("h2", name), shown if len(rows) <= MOST_ROWS else fold(f"{len(rows)} rows", shown)]
    return page(title, pieces)


def response_pieces(response: Mapping[str, Any], album: Album) -> list[Piece]:
    """What the case tells, its tables, and every picture that no other section took."""
    told = {k: v for k, v in response.items() if not k.endswith("sha256") and v not in ("", None)}
    words, failed = told.pop("description", ""), told.get("failed_points")
    tables = {k: v for k, v in told.items() if isinstance(v, list) and v and isinstance(v[0], Mapping)}
    facts = [(_label(k), _cell(v)) for k, v in told.items() if k not in tables]
    rest = [n for n in album.left if n not in SHOWN and not n.startswith(("mode_", "modes_", "animation_"))]
    return [
        say(f"{words}." if words else ""),
        say(f"{failed} points did not converge; they are marked in the table." if failed else "", tone="bad"),
        *(piece for k, v in tables.items() for piece in (Piece("h3", _label(k)), _table_of(v))),
        *map(album.take, SHOWN),
        *(album.take(name, name) for name in rest),
        table((), facts),
    ]


def _table_of(rows: Sequence[Mapping[str, Any]]) -> Piece:
    """Of rows that have the same names."""
    columns = [_column(key) for key in rows[0]]
    cells = [[_cell(v if f == 1 else v * f) for v, (f, _) in zip(row.values(), columns, strict=True)] for row in rows]
    return table([name for _, name in columns], cells)


_FACTORS = (
    *((Quantity(unit).column("amplitude"), (1e6, Quantity(unit).micro)) for unit in ("m", "rad", "1")),
    ("_Pa", (1e-6, "MPa")),
)
"""Ends of names of numbers that are shown in another unit."""

_UNITS = ("N", "Hz", "m", "mm", "µm", "m/m", "µm/m", "rad", "µrad", "s", "Pa", "MPa", "rpm", "W", "J", "K")


def _column(key: str) -> tuple[float, str]:
    """Factor and name of a column: lengths and stresses in units for people."""
    for end, (factor, unit) in _FACTORS:
        if key.endswith(end):
            return factor, _label(f"{key.rpartition('_')[0]}_{unit}")
    return 1.0, _label(key)


def _label(key: str) -> str:
    """``normal_force_N`` -> ``normal force in N``."""
    *words, last = key.split("_")
    unit = "m/m" if last == "strain" else last
    return " ".join([*words, "in", unit] if words and unit in _UNITS else [*words, last])


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(_cell, value))
    return number(value, 5) if isinstance(value, float) else str(value)

"""The page of motions in time: what motions they are, pictures of each, all numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..units import percent
from .page import Album, Piece, fold, number, page, say, table

Row = Mapping[str, Any]


def orbit_html(
    title: str, rows: Sequence[Row], notes: Sequence[str], messages: Sequence[str], pictures: Sequence[Path]
) -> str:  # fmt: skip
    """The page.

    Args:
        rows: of orbit.csv, with ``name`` and ``kind`` of each motion, and ``of``, what is read. notes: sentences.
        messages: what a reader must know.
    """
    album = Album({p.name: p for p in pictures})
    pieces = [
        _answer(rows),
        say(*notes, READ_AS, tone="note"),
        Piece("box", [say(*messages)], tone="warn") if messages else say(""),
        *album.begun(""),
    ]
    keys = [key for key in rows[0] if key not in ("name", "kind", "of")]
    numbers = table(
        [key.replace("_", " ") for key in keys], [[number(float(row[key]), 6) for key in keys] for row in rows]
    )
    return page(title, [*pieces, fold("All numbers, as in orbit.csv", numbers)])


def _answer(rows: Sequence[Row]) -> Piece:
    """A line a motion; columns that say nothing of any are left out."""
    columns = {
        "excited by": [row["name"] for row in rows],
        "motion": [row["kind"] for row in rows],
        "period": [_count(row["repeats_after_periods"]) for row in rows],
        "impacts": [_rate(row["impacts_per_period"]) for row in rows],
        "slips": [_rate(row["slips_per_period"]) for row in rows],
        "moves": [row["of"].sized(_largest(row)) for row in rows],
        "speed": [f"{row['of'].sized(row[row['of'].column('largest_velocity') + '_s'])}/s" for row in rows],
        "force": [_with(row["largest_contact_force_N"], "N") for row in rows],
        "lost": [_with(row["lost_in_contacts_J_per_period"], "J") for row in rows],
        "Lyapunov": [_exponent(row) for row in rows],
        "error": [percent(row["estimated_error"]) if math.isfinite(row["estimated_error"]) else "" for row in rows],
    }
    told = {head: cells for head, cells in columns.items() if any(cells)}
    return table(list(told), list(zip(*told.values(), strict=True)))


READ_AS = (
    "Period: after how many of the excitation it comes back. Impacts, slips and energy lost in contacts: in one "
    "period of the excitation. Displacement, speed and contact force are the largest, and so is the Lyapunov exponent."
)


def _largest(row: Row) -> float:
    return max(abs(row[row["of"].column(name)]) for name in ("smallest", "largest"))


def _count(periods: float) -> str:
    return f"{periods:.0f}" if periods else ""


def _rate(value: float) -> str:
    return number(value) if value else ""


def _with(value: float, unit: str) -> str:
    return f"{number(value)} {unit}" if math.isfinite(value) and value else ""


def _exponent(row: Row) -> str:
    value, around = row["lyapunov_exponent_1_s"], row["lyapunov_uncertainty_1_s"]
    return f"{number(value, 3)} ± {number(around, 2)} 1/s" if math.isfinite(value) else ""

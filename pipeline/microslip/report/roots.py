"""Roots as a table, on a page and on the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from ..roots.spectrum import Spectrum
from .page import Piece, say, table


def root_table(found: Spectrum) -> list[Piece]:
    """A row a root, and how it is read."""
    c = found.columns
    rows: list[Sequence[object]] = [
        (f"{f:.7f}", f"{g:.7g}", f"{d:.3e}", v, f"{t:.1e}", f"{r:.1e}", f"{e:.1e}")
        for f, g, d, v, t, r, e in zip(
            c["frequency_Hz"], c["growth_1_s"], c["damping_ratio"], c["verdict"], c["neutral_below_1_s"], c["residual"],
            c["backward_error"], strict=True,
        )
    ]  # fmt: skip
    head = ["Hz", "growth 1/s", "damping ratio", "", "neutral below 1/s", "residual", "backward error"]
    return [table(head, rows), say(READ_AS, tone="note")]


READ_AS = (
    "An amplitude grows as exp(growth t). Neutral: the growth rate is nearer to zero than the data decide. Residual: "
    "of the equation over the elastic force; backward error: over the norms of the matrices."
)


def table_lines(found: Spectrum) -> list[str]:
    """The table for the terminal."""
    head = f"{'Hz':>14} {'growth 1/s':>14} {'damping':>11}  {'':8} {'backward error':>14}"
    c = found.columns
    shown = ("frequency_Hz", "growth_1_s", "damping_ratio", "verdict", "backward_error")
    rows = zip(*(c[k] for k in shown), strict=True)
    return [head, *(f"{f:14.7f} {g:14.7g} {d:11.3e}  {v:8} {e:14.1e}" for f, g, d, v, e in rows)]

"""The page of roots: the answer, the plane, the table, what happens over a range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ..roots.diagram import Diagram
from ..roots.spectrum import Spectrum
from .page import Album, Piece, fold, page, say, table

CAPTIONS = {
    "plane": "Roots in the complex plane. What stands right of the line grows by itself.",
    "over": "Growth rate and frequency of every root; in colour those that grow somewhere.",
}


def roots_html(
    title: str, state: str, found: Spectrum, over: Diagram | None, pictures: Mapping[str, Path]
) -> str:  # fmt: skip
    """The page, which begins with the answer.

    Args:
        state: the values of the parameters, in words. pictures: ``plane`` and ``over``.
    """
    album = Album(pictures)
    lead = [f"{state}: {found.sentence}."] + ([f"{over.sentence[0].upper()}{over.sentence[1:]}."] if over else [])
    pieces = [
        say(*lead, tone="lead"),
        album.take("plane", CAPTIONS["plane"]),
        root_table(found),
        say(READ_AS, tone="note"),
        album.take("over", CAPTIONS["over"]),
    ]
    if over is not None:
        counts = [(f"{v:.6g}", str(n)) for v, n in zip(over.values, over.unstable, strict=True)]
        pieces.append(fold("How many roots grow at each value", table([over.parameter, "grow"], counts)))
    return page(title, pieces)


def root_table(found: Spectrum) -> Piece:
    """A row a root."""
    c = found.columns
    rows: list[Sequence[object]] = [
        (f"{f:.7f}", f"{g:.7g}", f"{d:.3e}", v, f"{t:.1e}", f"{r:.1e}", f"{e:.1e}")
        for f, g, d, v, t, r, e in zip(
            c["frequency_Hz"], c["growth_1_s"], c["damping_ratio"], c["verdict"], c["neutral_below_1_s"], c["residual"],
            c["backward_error"], strict=True,
        )
    ]  # fmt: skip
    head = ["Hz", "growth 1/s", "damping ratio", "", "neutral below 1/s", "residual", "backward error"]
    return table(head, rows)


READ_AS = (
    "An amplitude grows as exp(growth t). Neutral: the growth rate is nearer to zero than the data decide. Residual: "
    "of the equation over the elastic force; backward error: over the norms of the matrices."
)

"""The page of an assembly that slides: the map first, then the roots at the case's own state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ..roots.full import Compared
from ..roots.map import Map
from ..roots.spectrum import Spectrum
from .page import Album, Piece, fold, page, say, table
from .roots import CAPTIONS, READ_AS, root_table

OF_MAP = (
    "Colour: number of roots that grow. Black lines: Hopf lines, where the fastest growth rate is zero. Grey lines: "
    "growth rate in 1/s."
)

OF_FULL = " Dots: states counted in the unreduced matrices as well."


OF_CYCLES = (
    "Half of the way from the smallest to the largest value of the first read-out in a period, from the Hopf point on. "
    "Supercritical: the limit cycle grows out of the equilibrium softly; subcritical: it is reached by a jump. Dots: "
    "the same of a motion in time that began on the orbit, in its last period."
)

OF_RELIEF = "The same over a second parameter: each wall stands at one of its values and begins at the Hopf point."


OF_WAVES = "One period of a root that grows, without its growth. Its size is chosen; motion/ holds it for ParaView."


def squeal_html(
    title: str, said: Sequence[str], found: Spectrum, over: Map | None, full: Sequence[Compared],
    pictures: Mapping[str, Path],
) -> str:  # fmt: skip
    """The page, which begins with the answer.

    Args:
        said: sentences. pictures: ``map``, ``cycles``, ``relief``, ``plane``, and motions of roots, ``root_...``.
    """
    album = Album(pictures)
    words = OF_MAP + OF_FULL * bool(full)
    pieces: list[Piece] = [say(*(f"{s[0].upper()}{s[1:]}." for s in said), tone="lead"), album.take("map", words)]
    if full and over is not None:
        rows = [(f"{c.x:.4g}", f"{c.y:.4g}", c.reduced, c.full, f"{c.distance:.1e}") for c in full]
        head = [over.x.title, over.y.title, "grow, reduced", "grow, unreduced", "relative difference"]
        pieces.append(fold("States in unreduced matrices", table(head, rows)))
    pieces += [album.take(name, OF_WAVES) for name in pictures if name.startswith("root_")]
    pieces += [album.take("cycles", OF_CYCLES), album.take("relief", OF_RELIEF)]
    pieces += [album.take("plane", CAPTIONS["plane"]), root_table(found), say(READ_AS, tone="note")]
    return page(title, pieces)

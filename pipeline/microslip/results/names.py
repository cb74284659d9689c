"""Numbers in names of series and headings of columns: short, and never the same for two of them."""

from __future__ import annotations

from collections.abc import Sequence

from ..data import Array

_DIGITS = range(6, 18)
"""Of a number in a name; a double has 17 at most."""


def exact(value: float) -> str:
    """A number in the fewest digits, six or more, that say it to the last bit."""
    return next(text for d in _DIGITS if float(text := f"{value:.{d}g}") == value or d == _DIGITS[-1])


def digits(values: Sequence[float] | Array, least: int = _DIGITS[0]) -> int:
    """The fewest significant digits, `least` or more, that tell numbers that differ from each other."""
    differ = len(set(values))
    return next(d for d in range(least, _DIGITS[-1] + 1) if len({f"{v:.{d}g}" for v in values}) == differ)


def apart(values: Sequence[float], least: int = _DIGITS[0]) -> list[str]:
    """Numbers in so many `digits`."""
    return [f"{value:.{digits(values, least)}g}" for value in values]

"""Numbers in names of series and headings of columns: short, and never the same for two of them."""

from __future__ import annotations

from collections.abc import Sequence

_DIGITS = range(6, 18)
"""Of a number in a name; a double has 17 at most."""


def exact(value: float) -> str:
    """A number in the fewest digits, six or more, that say it to the last bit."""
    return next(text for d in _DIGITS if float(text := f"{value:.{d}g}") == value or d == _DIGITS[-1])


def apart(values: Sequence[float], least: int = _DIGITS[0]) -> list[str]:
    """Numbers in the fewest digits, `least` or more, that tell those that differ from each other."""
    many = ([f"{value:.{d}g}" for value in values] for d in range(least, _DIGITS[-1] + 1))
    return next(texts for texts in many if len(set(texts)) == len(set(values)))

"""What arguments of the public functions of rolling may be, and the sentence that refuses others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from ..data import Array
from ..errors import UserError

TINY = 1e-300
FINITE, POSITIVE, SOME = (-np.inf, np.inf, "finite"), (TINY, np.inf, "positive"), (0.0, np.inf, "0 or more")
BOUNDS = {
    "xi": FINITE,
    "eta": FINITE,
    "phi": FINITE,
    "a": POSITIVE,
    "b": POSITIVE,
    "normal_force": POSITIVE,
    "friction": SOME,
    "shear": POSITIVE,
    "poisson": (0.0, 0.5, "0 to 0.5"),
    "speed": POSITIVE,
    "A": POSITIVE,
    "B": POSITIVE,
    "force": SOME,
    "modulus": POSITIVE,
    "ratio": POSITIVE,
    "radius": POSITIVE,
    "wheel_at": POSITIVE,
    "rail_at": POSITIVE,
    "unit": POSITIVE,
    "noise": SOME,
    "width": POSITIVE,
    "cover": (1.0, np.inf, "1 or more"),
    "profile": FINITE,
    "lateral": FINITE,
    "yaw": FINITE,
    "roll": FINITE,
    "turning": SOME,
    "vertical": SOME,
    "load": POSITIVE,
    "approach": FINITE,
    "checked": (1.0, np.inf, "1 or more"),
}
"""Least and most of each; none is infinite."""


def broadcast(**given: ArrayLike) -> list[Array]:
    """Arrays (n,) of numbers that `BOUNDS` allow.

    Raises:
        UserError: see `joined`.
    """
    return [np.ravel(v) for v in joined(**given)]


def joined(**given: ArrayLike) -> list[Array]:
    """Arrays of one shape.

    Raises:
        UserError: a number that is out of bounds, or none; shapes that do not go together.
    """
    arrays = [number(name, value) for name, value in given.items()]
    try:
        return list(np.broadcast_arrays(*arrays))
    except ValueError as error:
        shapes = ", ".join(f"{name} {v.shape}" for name, v in zip(given, arrays, strict=True) if v.size > 1)
        raise UserError(f"shapes do not go together: {shapes}; give single numbers or arrays alike") from error


def number(name: str, value: ArrayLike) -> Array:
    """An array of any shape.

    Raises:
        UserError: see `broadcast`.
    """
    try:
        v = np.asarray(value, float)
    except (TypeError, ValueError) as error:
        raise UserError(f"{name}: is {value!r}; give numbers") from error
    least, most, must = BOUNDS[name]
    good = np.isfinite(v) & (v >= least) & (v <= most)
    if not v.size:
        raise UserError(f"{name}: is empty; give one number at the least")
    if not good.all():
        i = int(np.argmin(good))
        where = f" in state {i}" if v.size > 1 else ""
        raise UserError(f"{name}: is {v.ravel()[i]:g}{where}; it must be {must}")
    return v


def words(**given: tuple[Any, Any]) -> None:
    """Each a word and the `Literal` of what it may be.

    Raises:
        UserError: another word.
    """
    for name, (word, known) in given.items():
        if word not in get_args(known):
            raise UserError(f"{name}: is {word!r}; give {' or '.join(map(repr, get_args(known)))}")


def wholes(name: str, value: Any, least: Sequence[int]) -> tuple[int, ...]:
    """So many whole numbers as there are least ones.

    Raises:
        UserError: others.
    """
    try:
        found = tuple(int(n) for n in value)
        good = found == tuple(value) and len(found) == len(least)
        good = good and all(n >= m for n, m in zip(found, least, strict=True))
    except (TypeError, ValueError):
        good = False
    if not good:
        raise UserError(
            f"{name}: is {value!r}; give {len(least)} whole numbers of {', '.join(map(str, least))} or more"
        )
    return found


def of_kind(kind: Any, **given: Any) -> None:
    """Raises `UserError` of what is of another kind."""
    for name, value in given.items():
        if not isinstance(value, kind):
            raise UserError(f"{name}: is {type(value).__name__}; give {getattr(kind, '__name__', kind)}")


def grid_of(elements: Any) -> tuple[int, int]:
    """Whole numbers along and across.

    Raises:
        UserError: others.
    """
    nx, ny = wholes("elements", elements, (2, 2))
    return nx, ny

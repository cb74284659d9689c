"""What a number, a vector or a name in a settings file may be, and what all tables of settings have in common."""

from __future__ import annotations

import ast
import inspect
import math
import re
import sys
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, PrivateAttr

from .texts import texts_of

LENGTH = "length"
"""Marks a number as a length in the file's unit."""


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _finite_vector(value: Any) -> Any:
    return tuple(map(_float, value)) if isinstance(value, list) else value


def _float(value: Any) -> Any:
    """Whole numbers stand for numbers; true and false do not."""
    if isinstance(value, bool) or not isinstance(value, int):
        return value
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _whole(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("must be a whole number, not true or false")
    return value


def _nodal_diameters(value: Any) -> Any:
    if value == "all":
        return value
    listed = value if isinstance(value, list | tuple) else [None]
    if any(isinstance(v, bool) or not isinstance(v, int) or v < 0 for v in listed):
        raise ValueError('must be "all" or a list of whole numbers, none negative; write [0, 3] for 0 and 3')
    return tuple(value)


def has_length(value: tuple[float, ...]) -> tuple[float, ...]:
    """A direction as it is, if it is one.

    Raises:
        ValueError: it has no length.
    """
    if not any(value):
        raise ValueError("a direction must not be [0, 0, 0]")
    of_sensible_size(max(map(abs, value)))
    return value


def of_sensible_size(value: float) -> float:
    """A number as it is, if its square and products with others neither overflow nor vanish, as no quantity's do.

    Raises:
        ValueError: they do.
    """
    if value and math.isfinite(value) and not 1 / BEYOND <= abs(value) <= BEYOND:
        raise ValueError(f"{value:g} is beyond all bounds; write 0, or a number between {1 / BEYOND:g} and {BEYOND:g}")
    return value


def not_too_large(value: float) -> float:
    """A component of a vector as it is, if it is small enough; what is left of zero by rounding is none too small.

    Raises:
        ValueError: it is larger than any quantity.
    """
    return of_sensible_size(value) if abs(value) > 1 else value


BEYOND = 1e30
"""Size of a number, in any unit that files are written in, that is a mistake; its inverse too."""


def damping_ratio(value: float) -> float:
    """A damping ratio as it is, if a vibration with it swings at all.

    Raises:
        ValueError: it does not.
    """
    if not 0 <= value < 1:
        raise ValueError(f"a damping ratio of {value:g} must lie below 1 and not below 0; 0.01 is 1 % of the critical")
    return value


MOST_FRICTION = 5.0
"""Rubber on a rough road reaches 2 to 4, metals in air stay below 2: what is larger is a percentage or an angle."""


def _friction(value: float) -> float:
    if value > MOST_FRICTION:
        raise ValueError(
            f"a friction coefficient of {value:g} must not be greater than {MOST_FRICTION:g}; 0.3 is usual of dry "
            "metals, and a contact sticks if it is pressed harder"
        )
    return value


NodalDiameters = Annotated[Literal["all"] | tuple[int, ...], BeforeValidator(_nodal_diameters)]
Number = Annotated[float, BeforeValidator(_float), Field(allow_inf_nan=False), AfterValidator(of_sensible_size)]
Component = Annotated[float, BeforeValidator(_float), Field(allow_inf_nan=False), AfterValidator(not_too_large)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Ratio = Annotated[NotNegative, AfterValidator(damping_ratio), Field(lt=1)]
Coefficient = Annotated[NotNegative, AfterValidator(_friction), Field(le=MOST_FRICTION)]
Length = Annotated[Number, LENGTH]
PositiveLength = Annotated[Positive, LENGTH]
Vector = Annotated[tuple[Component, Component, Component], BeforeValidator(_finite_vector)]
Direction = Annotated[
    tuple[Component, Component, Component], BeforeValidator(_finite_vector), AfterValidator(has_length)
]
Point = Annotated[tuple[Component, Component, Component], BeforeValidator(_finite_vector), LENGTH]
Box = Annotated[
    tuple[Component, Component, Component, Component, Component, Component], BeforeValidator(_finite_vector), LENGTH
]
Numbers = Annotated[tuple[Number, ...], BeforeValidator(_finite_vector)]
Positives = Annotated[tuple[Positive, ...], BeforeValidator(_finite_vector)]
Ratios = Annotated[tuple[Ratio, ...], BeforeValidator(_finite_vector)]
Directions = Literal["x", "y", "z", "xy", "xz", "yz", "xyz"]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=64)]
FaceName = Annotated[str, Field(min_length=1, max_length=200)]  # as other programs name their sets


Byte = Annotated[int, Field(ge=0, le=255)]
NodeNumber = Annotated[int, Field(ge=1)]
EngineOrder = Annotated[int, Field(ge=1, le=10000)]


class Model(BaseModel):
    """Strict, frozen, no unknown keys. Below a key stands what it is, ``[Hz] of the load``."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


def keys_of(model: type[BaseModel]) -> dict[str, tuple[str, str]]:
    """Key as it is written -> unit and meaning, by the text below it or below that of a base."""
    return {f.alias or name: _said(model, name, f) for name, f in model.model_fields.items()}


def _said(model: type[BaseModel], name: str, field: Any) -> tuple[str, str]:
    texts = (_texts(base.__module__).get((base.__name__, name)) for base in model.__mro__)
    text = " ".join(next(filter(None, texts), "").split())
    _, unit, meaning = re.split(r"^(?:\[([^]]*)\](?!\())?", text, maxsplit=1)
    return unit or ("length_unit" if is_length(field) else ""), meaning.strip()


@cache
def _texts(module: str) -> dict[tuple[str, str], str]:
    try:
        return texts_of(ast.parse(inspect.getsource(sys.modules[module])))
    except (KeyError, OSError, TypeError):
        return {}


def is_length(field: Any) -> bool:
    """Whether the number of a key is marked as a length."""
    return LENGTH in field.metadata or f"'{LENGTH}'" in str(field.annotation)


class OfFile(Model):
    """What a whole file says, which knows where it stands."""

    _path: Path = PrivateAttr()

    @property
    def path(self) -> Path:
        """Of the file, beside which others are that it names."""
        return self._path


def only_one(model: Model, *keys: str, what: str = "") -> None:
    """Refuse a section that does not give exactly one of some keys; an empty text is none.

    Args:
        what: who needs it, if the section's name does not tell.

    Raises:
        ValueError: none, or several.
    """
    given = [k for k in keys if getattr(model, k) not in (None, "")]
    if len(given) != 1:
        has, do = (" and ".join(given), "keep") if given else ("none", "give")
        raise ValueError(f"{what}needs exactly one of {', '.join(keys)}, and has {has}; {do} one")


def named_once(settings: Any, *groups: str) -> None:
    """Refuse two entries of lists of tables under one name: the second would take the place of the first.

    Args:
        groups: keys of lists whose entries have a name; several in one text, apart by blanks, share their names.

    Raises:
        ValueError: with the list and the name.
    """
    for group in groups:
        names: set[str] = set()
        for key in group.split():
            for item in getattr(settings, key):
                if item.name in names:
                    raise ValueError(f"{key}: the name '{item.name}' is used twice; rename one")
                names.add(item.name)

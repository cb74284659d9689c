"""What keys of a contact's settings may hold, beyond `body`'s."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from ..settings.numbers import NotNegative, Number, Positive, _finite_vector, _tuple
from .layer import BOUNDARIES

NotNegativeLength = Annotated[NotNegative, "length"]
Lengths = Annotated[tuple[Number, ...], BeforeValidator(_finite_vector), "length"]
PositiveLengths = Annotated[tuple[Positive, ...], BeforeValidator(_finite_vector), "length"]
Radii = Annotated[tuple[float, float], BeforeValidator(_finite_vector), "length"]  # inf is flat
OneOrTwo = Positive | Annotated[tuple[Positive, Positive], BeforeValidator(_finite_vector)]
Column = Annotated[int, Field(ge=1)] | Annotated[str, Field(min_length=1)]
Columns = Annotated[tuple[Column, Column], BeforeValidator(_tuple)]
FileName = Annotated[str, Field(min_length=1)]
Poisson = Annotated[Number, Field(gt=-1, le=0.5)]
Boundary = Literal["stress-free", "hydrostatic", "no-lateral-strain"]
assert set(BOUNDARIES) == {"stress-free", "hydrostatic", "no-lateral-strain"}

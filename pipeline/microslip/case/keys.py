"""Types of keys that the parts of a case file share."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field

from ..settings.numbers import Positive, _finite_vector, _tuple

Count = Annotated[int, Field(ge=1, le=1000)]
Address = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+(:[A-Za-z0-9_.-]+)?$", max_length=200)]
"""``interface``, or ``body:interface`` where a case has several bodies."""

GROUND = "ground"

Order = Annotated[int, Field(ge=-1000, le=1000)]
Orders = Annotated[tuple[Order, ...], BeforeValidator(_tuple)]
Positives = Annotated[tuple[Positive, ...], BeforeValidator(_finite_vector)]

"""What arguments of the public functions of rolling may be, and arrays of one shape."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from ..data import Array
from ..errors import UserError
from ..settings.arguments import numbers, wholes
from ..settings.numbers import MOST_FRICTION, Component

Reals = Annotated[Any, numbers()]
"""Arrays of any shape, as the four below."""
Positives = Annotated[Any, numbers(gt=0)]
NotNegatives = Annotated[Any, numbers(ge=0)]
Frictions = Annotated[Any, numbers(ge=0, le=MOST_FRICTION)]
Poissons = Annotated[Any, numbers(ge=0, le=0.5)]
Poisson = Annotated[float, Field(ge=0, le=0.5)]
Angle = Annotated[Component, Field(ge=-np.pi / 2, le=np.pi / 2)]
"""rad; degrees are mostly beyond it."""
Resolution = Annotated[Any, wholes(2, 2)]
"""Along and across rolling."""


def joined(**arrays: ArrayLike) -> list[Array]:
    """Numbers of one shape.

    Raises:
        UserError: shapes that do not go together.
    """
    try:
        return list(np.broadcast_arrays(*(np.asarray(v, float) for v in arrays.values())))
    except ValueError as error:
        shapes = ", ".join(f"{name} {np.shape(v)}" for name, v in arrays.items() if np.size(v) > 1)
        raise UserError(f"shapes do not go together: {shapes}; give single numbers or arrays alike") from error

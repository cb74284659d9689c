"""Exact half-spaces between the profiles themselves, beside the strips on Hertz' ellipse."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..contact.solids import Solid
from ..data import Array
from ..errors import UserError
from .half_space import HalfSpaceContact, steady_rolling
from .half_space_influence import Grid, Pair
from .wheelset import RollingPatch

ELEMENTS = 44
"""Along and across; and twice as many, from which the answer is extrapolated: its error is of first order."""

WIDE = (1.3, 2.0, 3.0)
"""Half sides of the grid over the axes of the ellipse: the next one where the patch reaches the edge."""

FAR = 1.0
"""m between the surfaces where one of them has ended."""


class Exact(NamedTuple):
    """At n states. Attributes: at: (n,) their indices in the curve. x, y: (n,) forces on body 1, N. moment: (n,) N m.
    pressure: the largest, Pa."""

    at: Array
    x: Array
    y: Array
    moment: Array
    pressure: float


def exact(
    bodies: tuple[Solid, Solid],
    patch: RollingPatch,
    across: tuple[Array, Array],
    friction: float,
    creep: Array,
    at: Array,
) -> Exact:
    """Steady rolling at some states of a creep curve.

    Args:
        bodies: wheel and rail. across: (k,) places y over the patch, ascending, and distances of the surfaces there, m.
            creep: (3, n) xi, eta, phi. at: indices.

    Raises:
        UserError: a patch that is wider than three of Hertz' ellipse; see `half_space.steady_rolling`.
    """
    pair, states = Pair.of(*bodies), creep[:, at].T
    for wide in WIDE:
        try:
            coarse, fine = (_along(pair, patch, across, friction, states, wide, n * ELEMENTS) for n in (1, 2))
            break
        except UserError as error:
            if "edge of the grid" not in str(error):
                raise
            if wide == WIDE[-1]:
                raise UserError(f"the patch is more than {wide:g} times as wide as Hertz' ellipse") from error
    less, more = (np.array([[*c.force[:2], c.moment] for c in contacts]).T for contacts in (coarse, fine))
    x, y, moment = 2 * more - less
    return Exact(at, x, y, moment, float(max(c.pressure.max() for c in fine)))


def _along(
    pair: Pair, patch: RollingPatch, across: tuple[Array, Array], friction: float, states: Array, wide: float, n: int
) -> list[HalfSpaceContact]:
    """One state after the other, each begun at the last one."""
    grid = Grid.around(wide * patch.a, wide * patch.b, n, n)
    distance = patch.A * grid.x**2 + np.interp(grid.y, *across, left=FAR, right=FAR)
    contacts: list[HalfSpaceContact] = []
    for state in states:
        start = contacts[-1] if contacts else None
        contacts.append(
            steady_rolling(distance, grid, pair, friction, patch.normal_force, creepages=state, start=start)
        )
    return contacts

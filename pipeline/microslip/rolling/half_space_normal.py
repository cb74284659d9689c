"""Which elements of a grid touch, and how hard: conjugate gradients with p >= 0, for any undeformed distance."""

from __future__ import annotations

import numpy as np

from ..data import Array
from ..errors import UserError
from ..interrupts import look
from .half_space_influence import NORMAL, Influence

TOLERANCE = 1e-10
ITERATIONS = 2000


def normal_contact(
    distance: Array, influence: Influence, area: float, force: float | None = None, approach: float | None = None,
    start: Array | None = None, tolerance: float = TOLERANCE,
) -> tuple[Array, float]:  # fmt: skip
    """Pressure that closes the distance where it acts: p >= 0, e = h - approach + u_n >= 0, p e = 0.

    Conjugate gradients on the elements that touch; those whose pressure turns negative let go, those that overlap
    join (Polonsky and Keer, Wear 231, 1999; Vollebregt, J. Comput. Phys. 257, 2014).

    Args:
        distance: (nx, ny) undeformed distance h of the surfaces, m. influence: of the grid. area: of an element, m^2.
            force: N, or approach: m, one of the two. start: a pressure to begin with, Pa. tolerance: of the pressure,
            relative to its largest value.

    Returns:
        Pressure (nx, ny), Pa, and approach, m. No contact: zeros.

    Raises:
        UserError: neither or both of force and approach, no convergence.
    """
    if (force is None) == (approach is None):
        raise UserError("force, approach: give one of the two, the other follows")
    touching_at = float(distance.min())
    if force == 0 or (approach is not None and approach <= touching_at):
        return np.zeros(distance.shape), touching_at if approach is None else approach
    load = None if force is None else force / area
    pressure = _first(distance, influence, load, approach) if start is None or not np.any(start > 0) else start.copy()
    return _gradients(distance, influence, pressure, load, approach, tolerance)


def _first(distance: Array, influence: Influence, load: float | None, approach: float | None) -> Array:
    """As if the elements did not feel each other, or all of them shared the load."""
    if load is not None:
        return np.full(distance.shape, load / distance.size)
    return np.maximum(approach - distance, 0) / influence(_unit(distance.shape), NORMAL, NORMAL).max()


def _unit(shape: tuple[int, ...]) -> Array:
    unit = np.zeros((1, *shape))
    unit[0, shape[0] // 2, shape[1] // 2] = 1
    return unit


def _gradients(
    distance: Array, influence: Influence, pressure: Array, load: float | None, approach: float | None, tolerance: float
) -> tuple[Array, float]:  # fmt: skip
    def deformation(p: Array) -> Array:
        return influence(p[None], NORMAL, NORMAL)[0]

    single = float(deformation(_unit(distance.shape)[0]).max())
    if load is not None:
        pressure *= load / pressure.sum()
    direction, before, fresh = np.zeros_like(distance), 1.0, True
    for _ in range(ITERATIONS):
        look()
        touching = pressure > 0
        gap = deformation(pressure) + distance
        level = float(gap[touching].mean()) if load is not None else float(approach)  # type: ignore[arg-type]
        gap -= level
        here = float((gap[touching] ** 2).sum())
        direction = np.where(touching, gap + (0 if fresh else here / before) * direction, 0)
        answer = deformation(direction)
        if load is not None:
            answer -= answer[touching].mean()
        curvature = float((answer * direction)[touching].sum())
        joining = ~touching & (gap < 0)
        if curvature > 0:
            length = float((gap * direction)[touching].sum()) / curvature
        elif joining.any():  # those that touch are at rest among themselves
            length = 1 / single
        else:
            return pressure, level
        moved = np.maximum(np.where(touching, pressure - length * direction, 0), 0)
        moved[joining] = -length * gap[joining]
        fresh, before = bool(joining.any()), here
        if load is not None:
            moved *= load / moved.sum()
        change, pressure = np.abs(moved - pressure).max(), moved
        if change <= tolerance * pressure.max() and not fresh:
            return pressure, level
    raise UserError(f"distance: the pressure has not settled after {ITERATIONS} iterations; take a finer grid")

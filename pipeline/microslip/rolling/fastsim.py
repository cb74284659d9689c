"""Kalker's simplified theory, FASTSIM, as published: the reference beside the strip model.

Kalker, A fast algorithm for the simplified theory of rolling contact, Vehicle System Dynamics 11 (1982); on a grid of
equal rectangles, with the three flexibilities that become one for large creepage. Signs are those of `strips`.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from ..data import Array
from ..settings.arguments import checked, numbers
from ..settings.numbers import Coefficient, Component, Positive
from .arguments import Poisson, Resolution
from .kalker import creep_coefficients
from .strips import CreepForces, Tractions, blended

Bound = Literal["parabolic", "elliptic"]


def flexibilities(a: float, b: float, shear: float, poisson: float) -> Array:
    """(3,) m3/N: 8 a/(3 C11 G), 8 a/(3 C22 G), pi a sqrt(a/b)/(4 C23 G) (Kalker 1982)."""
    c11, c22, c23, _ = np.asarray(creep_coefficients(a / b, poisson))
    return np.asarray([8 * a / (3 * c11), 8 * a / (3 * c22), np.pi * a * np.sqrt(a / b) / (4 * c23)]) / shear


@checked
def fastsim(
    xi: Component, eta: Component, phi: Component, a: Positive, b: Positive, normal_force: Positive,
    friction: Coefficient, shear: Positive, poisson: Poisson, elements: Resolution = (44, 44),
    cover: Annotated[float, numbers(0, ge=1)] = 1.1, bound: Bound = "parabolic",
    blend: bool = True,
) -> tuple[CreepForces, Tractions]:  # fmt: skip
    """Forces and tractions of one state, see `strips.creep_forces` for the arguments.

    Args:
        elements: (nx, ny) over ``cover`` times the ellipse; one counts when its middle lies inside. bound: of the
            pressure that friction is taken from. blend: see `strips.blended`.

    Raises:
        UserError: a value or a word that no state of rolling has.
    """
    L = flexibilities(a, b, shear, poisson)
    if blend:
        L = np.asarray(blended(L, np.array([xi, eta, phi]), a, b, friction * normal_force))
    x, y = (cover * half * ((2 * np.arange(n) + 1) / n - 1) for half, n in zip((a, b), elements, strict=True))
    h, across = (2 * cover * half / n for half, n in zip((a, b), elements, strict=True))
    inside = np.maximum(1 - (x / a) ** 2 - (y[:, None] / b) ** 2, 0.0)
    mean = normal_force / (np.pi * a * b)
    p = 2 * mean * inside if bound == "parabolic" else 1.5 * mean * np.sqrt(inside)
    t, slip = np.zeros((2, *p.shape)), np.zeros((2, *p.shape))
    flexible, before = L[:2, None], np.zeros((2, len(y)))
    for i in range(len(x) - 1, -1, -1):
        rigid = np.array([xi / L[0] - phi * y / L[2], np.full(len(y), eta / L[1] + phi * (x[i] + h / 6) / L[2])])
        trial, limit = before - h * rigid, friction * p[:, i]
        size = np.hypot(*trial)
        t[:, :, i] = before = trial * np.minimum(1.0, np.divide(limit, size, out=np.ones_like(size), where=size > 0))
        slip[:, :, i] = np.where(limit > 0, flexible * (before - trial) / h, 0.0)
    area = np.full_like(p, h * across)
    X, Y = np.broadcast_arrays(x, y[:, None])
    slides = (inside > 0) & (slip != 0).any(axis=0)
    power = -(t * slip).sum(axis=0)
    x_, y_ = (t * area).sum(axis=(1, 2))
    moment = ((X * t[1] - Y * t[0]) * area).sum()
    share = slides.sum() / (inside > 0).sum()
    made = Tractions(X, Y, area, p, t[0], t[1], slip[0], slip[1], power)
    return CreepForces(x_, y_, moment, (power * area).sum(), share), made

"""Displacements of two elastic half-spaces under tractions that are constant on the rectangles of a grid.

Body 1 is the upper one, tractions act on it, displacements are differences u = u(1) - u(2), components (x, y, n) with n
into body 1. Boussinesq and Cerruti, integrated over a rectangle in closed form (Love 1929; Johnson, Contact Mechanics,
3.2 and 3.6; Kalker, Three-Dimensional Elastic Bodies in Rolling Contact, 1.6). Their sum over a grid is a convolution:
n elements cost n log n by the fast Fourier transform.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field
from scipy import fft

from ..contact.solids import Solid
from ..data import Array
from ..errors import UserError
from ..settings.arguments import Count, checked_fields
from ..settings.numbers import Component, Positive


@checked_fields
@dataclass(frozen=True)
class Pair:
    """Two half-spaces as one: 1/G = (1/G1 + 1/G2)/2, nu/G = (nu1/G1 + nu2/G2)/2 (Kalker 1990, 1.6).

    Attributes:
        shear: G, Pa. poisson: nu. mismatch: K with K/G = ((1 - 2 nu1)/G1 - (1 - 2 nu2)/G2)/4: normal tractions make
            the surfaces slide, tangential ones lift them; 0 for like bodies.

    Raises:
        UserError: G not positive, nu outside -1 < nu <= 0.5.
    """

    shear: Positive
    poisson: Annotated[float, Field(gt=-1, le=0.5)]
    mismatch: Component = 0.0

    @staticmethod
    def of(first: Solid, second: Solid) -> Pair:
        """The pair of an upper and a lower body; one of them may be rigid."""
        pair = ((1 / s.shear, s.poisson) for s in (first, second))
        (soft1, nu1), (soft2, nu2) = pair
        if not soft1 + soft2 > 0:
            raise UserError("young: both bodies are rigid, so the contact has no stiffness; give one of them a modulus")
        G = 2 / (soft1 + soft2)
        return Pair(G, G * (nu1 * soft1 + nu2 * soft2) / 2, G * ((1 - 2 * nu1) * soft1 - (1 - 2 * nu2) * soft2) / 4)


@checked_fields
@dataclass(frozen=True)
class Grid:
    """Rectangles of equal size; fields on it have shape (nx, ny), x along rolling.

    Attributes:
        nx, ny: numbers of elements. dx, dy: their sides, m. x0, y0: centre of the grid, m.

    Raises:
        UserError: no elements, sides that are not positive.
    """

    nx: Count
    ny: Count
    dx: Positive
    dy: Positive
    x0: Component = 0.0
    y0: Component = 0.0

    @staticmethod
    def around(a: float, b: float, nx: int, ny: int) -> Grid:
        """nx x ny elements over the rectangle with half sides a and b (m)."""
        return Grid(nx, ny, 2 * a / nx, 2 * b / ny)

    @property
    def x(self) -> Array:
        """(nx, 1) centres, m: combines with `y` to fields."""
        return (self.x0 + self.dx * (np.arange(self.nx) - (self.nx - 1) / 2))[:, None]

    @property
    def y(self) -> Array:
        """(1, ny) centres, m."""
        return (self.y0 + self.dy * (np.arange(self.ny) - (self.ny - 1) / 2))[None, :]

    @property
    def area(self) -> float:
        """Of one element, m^2."""
        return self.dx * self.dy

    def field(self, values: ArrayLike, key: str) -> Array:
        """(nx, ny) of a number or of anything that broadcasts to it; `key` names it in the error."""
        try:
            return np.broadcast_to(np.asarray(values, float), (self.nx, self.ny))
        except ValueError as error:
            shape = np.shape(values)
            raise UserError(f"{key}: shape {shape}; the grid has {self.nx} x {self.ny} elements") from error


def rectangle(x: Array, y: Array, dx: float, dy: float, pair: Pair) -> Array:
    """(3, 3, ...) u_i at (x, y) from its centre (m) per traction p_j on a rectangle dx x dy, m/Pa."""
    ends = [(x + s * dx / 2, y + t * dy / 2, s * t) for s in (1, -1) for t in (1, -1)]

    def over(antiderivative: Callable[[Array, Array], Array]) -> Array:
        return sum((sign * antiderivative(X, Y) for X, Y, sign in ends), np.zeros(np.broadcast(x, y).shape))

    across = over(_log_term)  # of y^2/R^3
    along = over(lambda X, Y: _log_term(Y, X))  # of x^2/R^3; together of 1/R
    shear = over(lambda X, Y: -np.hypot(X, Y))  # of x y/R^3
    G, nu, K = pair.shear, pair.poisson, pair.mismatch
    u_x = [along + (1 - nu) * across, nu * shear]
    u_y = [nu * shear, across + (1 - nu) * along]
    lift_x, lift_y = (K * over(_pole), K * over(lambda X, Y: _pole(Y, X))) if K else (np.zeros_like(along),) * 2
    u_n = [lift_x, lift_y, (1 - nu) * (along + across)]
    return np.array([[*u_x, -lift_x], [*u_y, -lift_y], u_n]) / (np.pi * G)


def _log_term(x: Array, y: Array) -> Array:
    """x ln(y + R), without cancellation for y < 0."""
    R = np.hypot(x, y)
    inside = np.where(y < 0, x * x / np.where(y < 0, R - y, 1), y + R)
    return x * np.log(np.where(x == 0, 1, inside))


def _pole(x: Array, y: Array) -> Array:
    """Antiderivative of x/R^2: y ln R + x arctan(y/x)."""
    R = np.hypot(x, y)
    return y * np.log(np.where(R == 0, 1, R)) + x * np.arctan2(y * np.sign(x), np.abs(x))


@dataclass(frozen=True)
class Influence:
    """Tractions of a grid -> displacements at the centres of its elements, or at a distance ahead of them.

    Attributes:
        shape: (nx, ny). size: of a grid at least twice as large. spectrum: (3, 3, ...) transform of the kernel on it,
            m/Pa. rows: (2, 2, size along x) the kernel's tangential part along a row.
    """

    shape: tuple[int, int]
    size: tuple[int, int]
    spectrum: Array
    rows: Array

    def row(self, k: int) -> Array:
        """(2, 2) u_i of an element per p_j of the one that is k places behind it, tangential, m/Pa."""
        return self.rows[:, :, k]

    def single(self) -> Influence:
        """The same in single precision: half the time, seven digits."""
        return replace(self, spectrum=self.spectrum.astype(np.complex64))

    def __call__(self, traction: Array, of: slice, by: slice) -> Array:
        """Displacements `of` these components (m) from the tractions `by` those: (components, nx, ny), Pa."""
        transformed = fft.rfft2(traction, self.size)
        kernel = self.spectrum[of, by]
        total = kernel[:, 0] * transformed[0]
        for j in range(1, len(transformed)):
            total += kernel[:, j] * transformed[j]
        return fft.irfft2(total, self.size)[:, : self.shape[0], : self.shape[1]]


TANGENTIAL, NORMAL = slice(0, 2), slice(2, 3)
ALL = slice(0, 3)


def influence(grid: Grid, pair: Pair, per: float = 1.0) -> Influence:
    """Displacements at the centres of the elements, m/Pa; over `per` metres of rolling, 1/Pa."""
    return _influence(grid.nx, grid.ny, grid.dx, grid.dy, pair, 1 / per, 0.0, 0.0)


def influence_ahead(grid: Grid, pair: Pair, step: float) -> Influence:
    """Displacements at the distance `step` (m) ahead of the centres, where material was a moment before, m/Pa."""
    return _influence(grid.nx, grid.ny, grid.dx, grid.dy, pair, 0.0, step, 1.0)


def influence_change(grid: Grid, pair: Pair) -> Influence:
    """(u(x) - u(x + dx))/dx: what the displacements of steady rolling add to the rigid slip, 1/Pa."""
    return _influence(grid.nx, grid.ny, grid.dx, grid.dy, pair, 1 / grid.dx, grid.dx, -1 / grid.dx)


@lru_cache(maxsize=16)
def _influence(
    nx: int, ny: int, dx: float, dy: float, pair: Pair, here: float, step: float, ahead: float
) -> Influence:  # fmt: skip
    """`here` times the displacements at the centres and `ahead` times those at `step` before them."""
    size = fft.next_fast_len(2 * nx - 1, real=True), fft.next_fast_len(2 * ny - 1, real=True)
    i, j = (np.arange(m) for m in size)
    x, y = np.where(i < nx, i, i - size[0])[:, None] * dx, np.where(j < ny, j, j - size[1])[None, :] * dy
    places = [(factor, x + s) for factor, s in ((here, 0.0), (ahead, step)) if factor]
    kernel = np.sum([factor * rectangle(X, y, dx, dy, pair) for factor, X in places], axis=0)
    return Influence((nx, ny), size, fft.rfft2(kernel), kernel[:2, :2, :, 0].copy())

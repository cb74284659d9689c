"""Newton's method for R(x, lambda) = 0, at a given lambda or on a plane across the curve of solutions.

Inside, everything is scaled, y = (x / x_scale, lambda / lam_scale), so that arclength and angles mean something; the
same curve in other units is the same sequence of points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
import scipy.linalg.lapack
import scipy.optimize

from ..data import Array
from ..interrupts import look

CONVERGED = "converged"


class Equations(Protocol):
    """R(x, lambda) = 0 for n unknowns and one parameter; R continuous, its derivatives may jump.

    Where they do not, an attribute ``smooth`` that is true says so: Newton's method then converges quadratically, and
    what its next correction would be is known from the last two.

    Attributes:
        x_scale: what a large x is, a number or (n,), in the units of x. lam_scale: what a large change of lambda is.
            Length along the curve is measured in these units.
    """

    @property
    def x_scale(self) -> Array | float: ...

    @property
    def lam_scale(self) -> float: ...

    def evaluate(self, x: Array, lam: float) -> tuple[Array, Array, Array]:
        """R (n,), dR/dx (n, n) and dR/dlambda (n,) at x (n,) and lambda; not finite where R is not defined."""
        ...


@dataclass(frozen=True)
class NewtonSettings:
    """When Newton's method stops.

    Attributes:
        tolerance: error of the scaled unknowns, estimated from the last correction and its contraction.
        iterations: at most. halvings: of a step that does not reduce the residual. forced: how often the best of the
            tried steps is taken although none reduces the residual (kinks). last_resort: then try a trust region.
    """

    tolerance: float = 1e-10
    iterations: int = 40
    halvings: int = 6
    forced: int = 3
    last_resort: bool = True


@dataclass(frozen=True)
class Solution:
    """What Newton's method found.

    Attributes:
        x: (n,). lam: as given. converged. status: "converged", or what went wrong and what to try.
        iterations: linear systems solved. evaluations: of R. error: estimated error of x / x_scale.
    """

    x: Array
    lam: float
    converged: bool
    status: str
    iterations: int
    evaluations: int
    error: float


def newton(problem: Equations, x: Array, lam: float, settings: NewtonSettings | None = None) -> Solution:
    """Solve R(x, lam) = 0 for x, from a guess (n,): steps halved until the residual falls, kinks allowed for."""
    scaled = Scaled(problem)
    y = scaled.pack(x, lam)
    c = correct(scaled, y, unit(len(y)), y[-1], settings or NewtonSettings())
    x = c.y[:-1] * scaled.x_scale
    return Solution(x, float(lam), c.ok, c.status, c.iterations, scaled.count, c.error)


class Scaled:
    """The problem in scaled coordinates; counts evaluations."""

    def __init__(self, problem: Equations) -> None:
        self.problem, self.count = problem, 0
        self.x_scale = np.asarray(problem.x_scale, dtype=float)
        self.lam_scale = float(problem.lam_scale)
        self.smooth = bool(getattr(problem, "smooth", False))

    def pack(self, x: Array, lam: float) -> Array:
        return np.append(np.asarray(x, dtype=float) / self.x_scale, float(lam) / self.lam_scale)

    def __call__(self, y: Array) -> tuple[Array, Array]:
        """R (n,) and D = (dR/dx, dR/dlambda) (n, n + 1) with respect to y."""
        R, B = self.bordered(y)
        return R, B[:-1]

    def bordered(self, y: Array) -> tuple[Array, Array]:
        """R (n,) and D above a row (n + 1, n + 1) that is still to be filled."""
        self.count += 1
        R, J, slope = self.problem.evaluate(y[:-1] * self.x_scale, float(y[-1]) * self.lam_scale)
        B = np.empty((len(y), len(y)), order="F")
        np.multiply(J, self.x_scale, out=B[:-1, :-1])
        np.multiply(slope, self.lam_scale, out=B[:-1, -1])
        return np.asarray(R, dtype=float), B


@dataclass(frozen=True)
class Corrected:
    """A point on the curve, or the attempt: tangent (n + 1,) with border . tangent = 1, sign of det [D; border] and the
    pivots it is the product of, contraction of the first two corrections."""

    y: Array
    ok: bool
    status: str
    iterations: int
    error: float
    tangent: Array | None = None
    sign: int = 0
    pivots: Array | None = None
    contraction: float = 0.0


def norm(v: Array) -> float:
    return math.sqrt(v @ v)  # numpy.linalg.norm takes ten times as long for a short vector


def unit(size: int) -> Array:
    e = np.zeros(size)
    e[-1] = 1.0
    return e


def _weights(D: Array) -> Array:
    """What makes every row's largest derivative 1, so that residuals of different units can be compared."""
    rows = np.abs(D).max(axis=1)
    return 1.0 / np.where((rows > 0) & np.isfinite(rows), rows, 1.0)


class _Place(NamedTuple):
    """A point y with the weighted residual (R, border . y - value), its derivative B = [D; border] and its norm, which
    is infinite if anything is not finite."""

    y: Array
    residual: Array
    B: Array
    size: float


def _place(y: Array, R: Array, B: Array, weights: Array, border: Array, value: float) -> _Place:
    """With R and B as `Scaled.bordered` tells them; the row of B is filled, the others weighted."""
    residual, D = np.empty(len(y)), B[:-1]
    np.multiply(R, weights, out=residual[:-1])
    residual[-1] = border @ y - value
    np.multiply(D, weights[:, None], out=D)
    B[-1] = border
    size = norm(residual)
    return _Place(y, residual, B, size if math.isfinite(size + norm(B.ravel(order="K"))) else math.inf)


def _factor(B: Array) -> tuple[Array, Array] | None:
    """LU of a matrix, which is overwritten; None if it is singular."""
    lu, pivots, info = scipy.linalg.lapack.dgetrf(B, overwrite_a=1)
    return None if info else (lu, pivots)


def _solve(factors: tuple[Array, Array], right: Array) -> Array:
    return scipy.linalg.lapack.dgetrs(*factors, right)[0]


def _determinant(factors: tuple[Array, Array]) -> int:
    """Sign of the determinant."""
    lu, pivots = factors
    negative = np.count_nonzero(lu.diagonal() < 0) + np.count_nonzero(pivots != np.arange(len(pivots)))
    return -1 if negative % 2 else 1


def correct(
    scaled: Scaled, y: Array, border: Array, value: float, settings: NewtonSettings, reach: float = math.inf
) -> Corrected:
    """Solve R = 0 with border . y = value, from y; not where a correction is longer than a reach.

    The residual is weighted by the derivatives at the start, so that units do not matter. Near a kink the direction
    can be one along which the residual rises however short the step, though the full step is right (the other side's
    derivative finishes the work): then the best of the tried steps is taken.
    """
    R, B = scaled.bordered(y)
    weights = _weights(B[:-1])
    here = _place(y, R, B, weights, border, value)
    sizes: list[float] = []
    forced = 0
    for iteration in range(1, settings.iterations + 1):
        look()
        factors = _factor(here.B) if here.size < math.inf else None
        if factors is None:
            what = "singular derivative" if here.size < math.inf else "R or its derivative is not a number"
            return _resort(scaled, here.y, border, value, settings, iteration, f"{what}: start elsewhere")
        dy = -_solve(factors, here.residual)
        sizes.append(norm(dy))
        if sizes[-1] > reach:
            return Corrected(here.y, False, "the solution is not near: start nearer", iteration, np.inf)
        if error := _small_enough(sizes, settings.tolerance * (1.0 + norm(here.y)), scaled.smooth):
            return _arrived(here.y + dy, factors, iteration, error, sizes)
        here, falls = _damped(scaled, here, dy, weights, border, value, settings.halvings)
        forced += not falls
        if forced > settings.forced:
            status = "no step reduces the residual: start nearer"
            return _resort(scaled, here.y, border, value, settings, iteration, status)
    status = "iterations used up: allow more, or start nearer"
    return _resort(scaled, here.y, border, value, settings, settings.iterations, status)


def _small_enough(sizes: list[float], tolerance: float, smooth: bool) -> float:
    """Estimated error after the last correction, 0 while it is not small enough: corrections contract at least as
    fast as before, so the next one is at most the last times the last contraction; where all is smooth a correction is
    a constant times the square of the one before, so the next one is the last times the square of the contraction."""
    last = sizes[-1]
    if last <= tolerance:
        return max(last, 1e-300)
    contraction = last / sizes[-2] if len(sizes) > 1 else 1.0
    error = last * contraction ** (2 if smooth else 1)
    return error if contraction < 0.1 and last < 1e-3 and error <= 0.1 * tolerance else 0.0


def _arrived(y: Array, factors: tuple[Array, Array], n: int, error: float, sizes: list[float]) -> Corrected:
    contraction = sizes[1] / sizes[0] if len(sizes) > 1 else 0.0
    tangent = _solve(factors, unit(len(y)))
    return Corrected(y, True, CONVERGED, n, error, tangent, _determinant(factors), factors[0].diagonal(), contraction)


def _damped(
    scaled: Scaled, before: _Place, dy: Array, weights: Array, border: Array, value: float, halvings: int
) -> tuple[_Place, bool]:
    """The first of the steps 1, 1/2, 1/4, ... that reduces the residual, else the best of them and False."""
    best = before._replace(size=math.inf)
    for k in range(halvings + 1):
        share = 0.5**k
        y = before.y + share * dy
        here = _place(y, *scaled.bordered(y), weights, border, value)
        if here.size <= (1.0 - 0.1 * share) * before.size:
            return here, True
        if here.size < best.size:
            best = here
    return best, False


def _resort(
    scaled: Scaled, y: Array, border: Array, value: float, settings: NewtonSettings, iterations: int, status: str
) -> Corrected:
    """The trust region of MINPACK (Powell's dogleg) from where Newton's method failed, then Newton again."""
    failed = Corrected(y, False, status, iterations, np.inf)
    if not settings.last_resort or not np.isfinite(y).all():
        return failed
    R, D = scaled(y)
    if not (np.isfinite(R).all() and np.isfinite(D).all()):
        return failed
    weights = _weights(D)

    def both(z: Array) -> tuple[Array, Array]:
        there = _place(z, *scaled.bordered(z), weights, border, value)
        return there.residual, there.B

    start = scipy.optimize.root(both, y, jac=True, method="hybr").x
    again = correct(scaled, start, border, value, replace(settings, last_resort=False))
    return replace(again, iterations=again.iterations + iterations) if again.ok else failed


def tangent(D: Array, orientation: int) -> Array | None:
    """Unit null vector t of D with the sign of det [D; t] asked for; None where D has a larger null space."""
    if not np.isfinite(D).all():
        return None
    D = D * _weights(D)[:, None]
    t = np.linalg.svd(D)[2][-1]
    factors = _factor(np.asfortranarray(np.vstack([D, t])))
    return None if factors is None else t * (orientation * _determinant(factors))

"""A solution of a ring followed over the frequency to where it ends, round turns on the way, by its arc length.

With z = (x / |x_0|, (Omega - Omega_0) / width), Omega counted towards another frequency, and a direction t of length 1,

    R(x, Omega) = 0,    t . (z - z_0) = h

are solved by Newton's method, whose steps are two of the ring's own: J a = -R and J b = dR/dz_-1, so that the curve's
own direction is along (-b, 1). (`continuation` follows curves of any kind, by one dense matrix.)

Where contacts open or begin to slide the curve has kinks. Some are so sharp that it goes back behind them: no step
ahead arrives, and the next piece is found from its derivative beyond the kink.
"""

from __future__ import annotations

import numpy as np

from ..data import Array
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.solver import CONVERGED, Point

STEPS = 100
"""At most, those in vain counted."""

LONGEST, SHORTEST = 0.25, 2e-3
"""Steps, of z."""

BACK = 0.3
"""Widths that the curve may go back before it counts as having ended."""

CORRECTIONS = 6
"""Newton steps at most."""

TOLERANCE = 1e-9
"""Of R over x."""


class Branch:
    """The solution through a point.

    Attributes: problem. begin. to: rad/s, whereto. width: rad/s, of what is between two points of a sweep.
    """

    def __init__(self, problem: Problem, begin: Point, to: float, width: float) -> None:
        self.problem, self.begin = problem, begin
        self.width, self.size = float(np.copysign(width, to - begin.Omega)), float(np.linalg.norm(begin.x))
        self.end = (to - begin.Omega) / self.width

    def onward(self) -> tuple[list[Point], bool]:
        """Points that are nearer to the frequency than all before them, the last one there, behind it, or about where
        the curve ends; whether it ends."""
        z = most = np.append(self.begin.x / self.size, 0.0)
        found, h, t = list[Point](), LONGEST, self._along(self._linear(z)[2], np.append(0 * self.begin.x, 1.0))
        for _ in range(STEPS):
            ahead, b, count = self._corrected(z, t, h)
            if ahead is None and h > SHORTEST:
                h *= 0.25
                continue
            if ahead is None:
                ahead, b, t = self._round(z, t)
                h = 2 * SHORTEST
            if ahead is None or ahead[-1] < most[-1] - BACK:
                return found, True
            z, t, h = ahead, self._along(b, t), min(1.5 * h if count <= 3 else h, LONGEST)
            if z[-1] > most[-1]:
                most = z
                found.append(Point(self._Omega(z), self.size * z[:-1], CONVERGED, 0.0, 0))
            if z[-1] >= self.end:
                return found, False
        return found, False

    def _Omega(self, z: Array) -> float:
        return self.begin.Omega + self.width * float(z[-1])

    def _linear(self, z: Array) -> tuple[Array, Array, Array]:
        """R, a and b, see above, in units of z."""
        x, at = self.size * z[:-1], self.problem.at(self._Omega(z))
        force, slopes = at.forces(x)
        R, J = at.residual_of(x, force), at.jacobian(slopes)
        return R / self.size, J.solve(-R) / self.size, J.solve(at.rate(x, force)) * (self.width / self.size)

    def _along(self, b: Array, before: Array) -> Array:
        """The curve's direction, on from another one."""
        t = np.append(-b, 1.0)
        return np.asarray(t / np.copysign(np.linalg.norm(t), t @ before))

    def _corrected(self, begin: Array, t: Array, h: float) -> tuple[Array | None, Array, int]:
        """The point a step ahead, or None, its b, and the number of corrections."""
        z, last = begin + h * t, np.inf
        for count in range(CORRECTIONS):
            R, a, b = self._linear(z)
            left = float(np.abs(R).max())
            if left <= TOLERANCE * np.abs(z[:-1]).max():
                return z, b, count
            if not left <= (0.5 * last if count > 1 else np.inf):
                break
            last, step = left, (h - t @ (z - begin) - t[:-1] @ a) / (t[-1] - t[:-1] @ b)
            z = z + np.append(a - b * step, step)
            if np.linalg.norm(z - begin - h * t) > h:
                break
        return None, t, CORRECTIONS

    def _round(self, z: Array, t: Array) -> tuple[Array | None, Array, Array]:
        """A point behind a kink, its b and the direction to it, by the derivative a little beyond: either way that does
        not lead back to where the curve came from."""
        for h in (SHORTEST, 2 * SHORTEST, 4 * SHORTEST):
            beyond = self._along(self._linear(z + h * t)[2], t)
            for way in (beyond, -beyond):
                found, b, _ = self._corrected(z, way, h)
                if found is not None and np.linalg.norm(found - (z - h * t)) > 0.5 * h:
                    return found, b, way
        return None, t, t

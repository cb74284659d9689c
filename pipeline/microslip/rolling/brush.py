"""A row of point contacts that is passed by material while slip and load change: unsteady rolling (Sextro, 6.10).

Elements lie in a row along rolling; material enters at the first one. What an element remembers moves on to the next
one while the wheel rolls by its length, so the step of time is that of an element, and convection is exact. The wheel's
structure is one mode, that gives way along rolling under the force.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from ..data import Array
from ..errors import UserError
from ..settings.arguments import checked, checked_fields, numbers
from ..settings.numbers import NotNegative, Positive
from .arguments import NotNegatives, Reals, joined


@checked_fields
@dataclass(frozen=True)
class Brush:
    """Attributes:
    share: (n,) of the normal force on each element, their sum 1, from the leading edge on. length: of the row, m.
    stiffness: of all elements together, N/m. friction: coefficient. speed: of rolling, m/s. compliance: of the mode,
    m/N; frequency: of it, rad/s; damping: ratio of it. under: normal force of which share and length are, N: as in
    Hertz' line contact the length goes with the root of the force, and the pressure keeps its shape; None: both stay.

    Raises:
        UserError: a number that is none of a brush.
    """

    share: Annotated[Any, numbers(1, ge=0)]
    length: Positive
    stiffness: Positive
    friction: Positive
    speed: Positive
    compliance: NotNegative = 0.0
    frequency: Annotated[float, Field(gt=0)] = np.inf
    damping: NotNegative = 0.05
    under: Positive | None = None

    def __post_init__(self) -> None:
        if not abs(np.sum(self.share) - 1) < 1e-9:
            raise UserError(f"Brush: share: must have the sum 1, and has {np.sum(self.share):g}; correct it")

    @property
    def step(self) -> float:
        """s, in which the wheel rolls by an element."""
        return self.length / len(self.share) / self.speed

    @property
    def spring(self) -> float:
        """N/m of an element."""
        return self.stiffness / len(self.share)

    @checked
    def carried(self, slip: Reals, force: NotNegatives) -> Array:
        """(t,) tangential force after each step, N, from rest of the springs.

        Args:
            slip: (t,) slip over the speed of rolling, in each step. force: (t,) normal force, N.

        Raises:
            UserError: slip that is not finite, force that is negative.
        """
        slip, force = map(np.atleast_1d, joined(slip=slip, force=force))
        longest = max(1.0, float(self.lengthened(force).max()))
        u, mode = np.zeros(len(self.share) + 2 * self._beyond(longest)), np.zeros(3)
        out, scale, elements = np.empty(len(slip)), -1.0, self._elements(0.0, longest)
        for i, (s, normal) in enumerate(zip(slip, force, strict=True)):
            if (now := float(self.lengthened(normal))) != scale:
                scale, elements = now, self._elements(now, longest)
            share, cover, way = elements
            moved = np.concatenate([[0.0], u[:-1]])
            held = self.friction * normal * share
            limit = np.divide(held, self.spring * cover, out=np.zeros(len(u)), where=cover > 0)
            far = moved + way * s * self.speed * self.step
            mode, u = self._balanced(mode, far, way, limit, self.spring * cover)
            out[i] = self.spring * (cover @ u)
        return out

    def lengthened(self, force: ArrayLike) -> Array:
        """By how much the row is longer under a normal force, N, than `length`."""
        force = np.asarray(force, float)
        return np.ones_like(force) if self.under is None else np.sqrt(force / self.under)

    def _beyond(self, longest: float) -> int:
        """Elements before and behind the row that a longest one reaches."""
        return int(np.ceil(0.5 * len(self.share) * (longest - 1) - 1e-9))

    def _elements(self, scale: float, longest: float) -> tuple[Array, Array, Array]:
        """Of a row so many times as long: what each element carries of the normal force, how much of it lies in the
        patch, and how long the material has been in it in a step, over its length. In half lengths from -1 on it enters
        at -scale."""
        n, beyond = len(self.share), self._beyond(longest)
        edge = 2 / n * (np.arange(n + 2 * beyond + 1) - beyond) - 1
        inside = np.clip(edge, -scale, scale)
        carried = np.concatenate([[0.0], np.cumsum(self.share)])
        at = inside / scale if scale > 0 else np.ones_like(edge)
        share = np.diff(np.interp(at, np.linspace(-1, 1, n + 1), carried))
        middle = 0.5 * (edge[1:] + edge[:-1])
        return share, 0.5 * n * np.diff(inside), np.clip(0.5 * n * (middle + scale), 0.0, 1.0)

    def _balanced(self, mode: Array, far: Array, way: Array, limit: Array, spring: Array) -> tuple[Array, Array]:
        """Mode (w, its velocity and acceleration) and stretches at the end of a step: Newmark's method, and Newton's on
        the one unknown dw, as the force falls with it piecewise straight."""
        if self.compliance == 0:
            return mode, np.clip(far, -limit, limit)
        h, c = self.step, self.compliance
        w0, v0, a0 = mode
        soft = 0.0 if np.isinf(self.frequency) else 1 / self.frequency**2
        loss = 0.0 if np.isinf(self.frequency) else 2 * self.damping / self.frequency
        mass = soft * 4 / h**2 + loss * 2 / h + 1  # of w over c, by the mean acceleration
        known = soft * (4 / h * v0 + a0) + loss * v0  # of what dw = w - w0 does not change
        dw = 0.0
        for _ in range(100):
            free = far - way * dw
            u = np.clip(free, -limit, limit)
            slope = -(spring * way * (np.abs(free) < limit)).sum()
            left = mass * dw - known + w0 - c * (spring @ u)
            change = -left / (mass - c * slope)
            dw += change
            if abs(change) <= 1e-13 * max(abs(dw), 1e-9):
                break
        u = np.clip(far - way * dw, -limit, limit)
        if not soft:
            return np.array([w0 + dw, dw / h, 0.0]), u
        v = 2 / h * dw - v0
        return np.array([w0 + dw, v, 2 / h * (v - v0) - a0]), u


def parabola(elements: int) -> Array:
    """(n,) shares of a parabolic pressure (6.4-29)."""
    edge = 1 - 2 * np.arange(elements + 1) / elements
    return 0.75 * -np.diff(edge - edge**3 / 3)


def jump(brush: Brush, before: float, after: float, force: float, lengths: float = 12.0) -> tuple[Array, Array]:
    """Time after a jump of the slip (s), and the force, N, both from the moment of the jump on; steady before it."""
    n = int(np.ceil(lengths * len(brush.share)))
    slip = np.concatenate([np.full(n, before), np.full(n, after)])
    found = brush.carried(slip, force)[n - 1 :]
    return brush.step * np.arange(n + 1), found


def reached(time: Array, force: Array) -> float:
    """s after which 1 - 1/e of the change of the force is done; straight between steps."""
    done = (force - force[0]) / (force[-1] - force[0])
    i = int(np.argmax(done >= 1 - np.exp(-1)))
    low, high = done[i - 1], done[i]
    return float(time[i - 1] + (1 - np.exp(-1) - low) / (high - low) * (time[i] - time[i - 1]))


def fitted(time: Array, force: Array) -> float:
    """s, time constant of the exponential that fits the force best (Sextro Fig. 6.10-4); its ends are those of the
    force."""
    from scipy.optimize import minimize_scalar

    done = (force - force[0]) / (force[-1] - force[0])

    def error(constant: float) -> float:
        return float(((done - 1 + np.exp(-time / constant)) ** 2).sum())

    about = reached(time, force)
    return float(minimize_scalar(error, bounds=(0.2 * about, 5 * about), method="bounded").x)

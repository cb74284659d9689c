"""First loading of a rough surface: microslip with shear strength and heating in closed form (Sextro, section 3.8).

A monotone curve, not a law: the tangential displacement only grows. `sliders.Strips` goes back and forth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..data import Array
from ..errors import UserError
from .heights import Heights
from .law import values
from .solids import bisected

NODES = 2048
"""Intervals of the slip depth in which the curve is laid out before it is refined: folds are found to 1e-6 of w."""

_SPREAD = np.append(np.linspace(0.0, 1.0, NODES)[:-1], [1 - 1e-9, 1.0])  # a smooth surface jumps at its last value
_HALVINGS = 45  # of a 2048th of the range: down to rounding
_BLOCK = 256  # rows laid out at a time: 4 MB


@dataclass(frozen=True)
class MonotoneSlip:
    """A rough surface pushed along at constant speed, in the book's numbers without dimension; `of` makes them.

    What decides is the slip depth s = u_x - u_S (3.8-14): heights touching by less than s slide. The ratio of the
    traction to the friction coefficient gives it, s = min(c w / (1 - dT), tau_S0, u_x), since the shear strength falls
    with the temperature as friction does (3.8-4, 3.8-15). With s, everything else is explicit:
    dT = k Q/(1 + k Q) with Q = F_NH/h(u_x) (3.8-18, 3.8-22, 3.8-23), F_T = (1 - dT)(F_N(u_x) - F_N(u_x - s)) (3.8-26),
    and w = s (1 - dT)/c. Where this w falls with s, one w has three answers; the state follows the branch that
    begins at w = 0 and jumps at its end.

    Attributes:
        heights: from x* = 0 (`heights.Cut` makes others so).
        stiffness: c_R0z* (3.8-6). roughness: R_Z* (3.8-28), 0 for a smooth surface. strength: tau_S0* (3.8-6), inf
            for none. heating: k_T* (3.8-19). One value or arrays, which broadcast with w and u.

    Raises:
        UserError: a number out of its bounds, heights above x* = 0.
    """

    heights: Heights
    stiffness: ArrayLike
    roughness: ArrayLike
    strength: ArrayLike = np.inf
    heating: ArrayLike = 0.0

    def __post_init__(self) -> None:
        for name, strict in (("stiffness", True), ("roughness", False), ("strength", True), ("heating", False)):
            value = np.asarray(getattr(self, name), dtype=float)
            if not np.all(value > 0 if strict else value >= 0) or (np.isinf(value).any() and name != "strength"):
                bound = "greater than 0" if strict else "0 or more"
                raise UserError(f"{name}: {value.min():g}; it must be {bound} and finite")
        if float(values(self.heights, "area", 0.0)) > 1e-12 and np.any(np.asarray(self.roughness) > 0):
            raise UserError("height distribution: begins below x = 0, where the contact is open; take Cut(...) of it")

    # normal ------------------------------------------------------------------------------------------------------

    def normal_force(self, u: ArrayLike) -> Array:
        """F_N*(u_x*) = R_Z* f(u_x*/R_Z*) (3.3-24, 3.8-27)."""
        u, R, rough = self._scaled(u)
        return np.where(rough, R * values(self.heights, "volume", u / R), np.maximum(u, 0.0))

    def area(self, u: ArrayLike) -> Array:
        """h*(u_x*): share of the area in contact; of a smooth surface all of it where u_x* > 0."""
        u, R, rough = self._scaled(u)
        return np.where(rough, values(self.heights, "area", u / R), np.where(u > 0, 1.0, 0.0))

    def approach(self, force: ArrayLike) -> Array:
        """u_x* under a normal force F_N*, by bisection; (3.3-24) solved for any heights.

        Raises:
            UserError: a force that does not press.
        """
        loads = np.asarray(force, dtype=float)
        if not (np.all(loads > 0) and np.all(np.isfinite(loads))):
            raise UserError("normal force: not a positive number; microslip needs a pressed contact")
        loads = loads + 0.0 * np.asarray(self.roughness)
        # beyond the deepest height the force has risen by less than the approach
        deepest = np.asarray(self.roughness, dtype=float) * float(self.heights.breaks()[..., -1])
        low, high = bisected(
            lambda u: self.normal_force(u) < loads, np.zeros_like(loads), loads + deepest, 200
        )
        return 0.5 * (low + high)

    # tangential, under a given normal displacement ---------------------------------------------------------------

    def force(self, w: ArrayLike, u: ArrayLike) -> Array:
        """F_T* (3.8-26) at the tangential displacement w_P* and the normal one u_x*; odd in w."""
        s = self.slip_depth(w, u)
        u = np.asarray(u, dtype=float)
        return np.sign(w) * (1 - self._warmth(s, u)) * (self.normal_force(u) - self.normal_force(u - s))

    def temperature(self, w: ArrayLike, u: ArrayLike) -> Array:
        """dT* (3.8-18): rise over dT_E, at which friction and strength would be gone."""
        return self._warmth(self.slip_depth(w, u), np.asarray(u, dtype=float))

    def slip_depth(self, w: ArrayLike, u: ArrayLike) -> Array:
        """s = u_x* - u_S*, on the branch that begins at w = 0: the least s that needs |w|, the whole of it if none."""
        w, rows, u, flat = self._rows(np.abs(np.asarray(w, dtype=float)), u)
        low, high = flat._brackets(w.ravel(), rows.ravel(), u)
        each, u = flat._picked(rows.ravel()), u[rows.ravel()]
        _, high = bisected(lambda s: each.displacement(s, u) < w.ravel(), low, high, _HALVINGS)
        return high.reshape(w.shape)

    def roots(self, w: float, u: float) -> Array:
        """All slip depths that satisfy (3.8-14) to (3.8-23) at w > 0 and u, rising: one or three, seldom more.

        For one value of each setting. Where two are closer than a `NODES`-th of the range, both are missed.
        """
        s_max = float(np.minimum(self.strength, u))
        grid = s_max * _SPREAD

        def excess(s: Array) -> Array:
            return self.displacement(s, u) - w

        side = np.sign(excess(grid))
        crosses = side[1:] != side[:-1]
        start, ends = side[:-1][crosses], (grid[:-1][crosses], grid[1:][crosses])
        _, high = bisected(lambda s: np.sign(excess(s)) == start, *ends, _HALVINGS)
        return np.append(high, s_max) if excess(grid[-1:])[0] < 0 else high

    def displacement(self, s: ArrayLike, u: ArrayLike) -> Array:
        """w_P* at which the slip depth s (up to min(tau_S0*, u_x*)) is a solution; where it falls with s the
        solution cannot be held."""
        s, u = np.asarray(s, dtype=float), np.asarray(u, dtype=float)
        return s * (1 - self._warmth(s, u)) / np.asarray(self.stiffness, dtype=float)

    # under a given normal force ----------------------------------------------------------------------------------

    def coefficient(self, w: ArrayLike, force: ArrayLike, mu_0: float = 1.0) -> Array:
        """Equivalent friction coefficient f = mu_0 F_T*/F_N* (3.8-29) at w_P* under a constant F_N*."""
        u = self.approach(force)
        return mu_0 * self.force(w, u) / np.asarray(force, dtype=float)

    # ---------------------------------------------------------------------------------------------------------------

    def _warmth(self, s: Array, u: Array) -> Array:
        """dT* = k Q/(1 + k Q)."""
        sliding = self.normal_force(u) - self.normal_force(u - s) - self.area(u - s) * s  # (3.8-23)
        touching = self.area(u)
        Q = np.where(touching > 0, np.maximum(sliding, 0.0) / np.where(touching > 0, touching, 1.0), 0.0)
        return np.asarray(self.heating) * Q / (1 + np.asarray(self.heating) * Q)

    def _rows(self, w: Array, u: ArrayLike) -> tuple[Array, Array, Array, MonotoneSlip]:
        """w over all that it broadcasts with; for each, its row; u (r,) and the settings (r,) of the rows."""
        u, *parts = np.broadcast_arrays(np.asarray(u, dtype=float), *self._settings())
        w, rows = np.broadcast_arrays(w, np.arange(u.size).reshape(u.shape))
        return w, rows, u.ravel(), MonotoneSlip(self.heights, *(part.ravel() for part in parts))

    def _brackets(self, w: Array, rows: Array, u: Array) -> tuple[Array, Array]:
        """Slip depths between which the displacement passes w (k,) for the first time; settings and u are rows (r,)."""
        s_max, high, low = np.maximum(np.minimum(self.strength, u), 0.0), np.zeros_like(w), np.zeros_like(w)
        for start in range(0, len(u), _BLOCK):
            block = np.arange(start, min(start + _BLOCK, len(u)))
            part = self._picked(block[:, None])
            reached = part.displacement(s_max[block, None] * _SPREAD, u[block, None])
            reached = np.maximum.accumulate(reached, axis=1)
            for row in block:
                mine = rows == row
                i = np.searchsorted(reached[row - start], w[mine])
                low[mine], high[mine] = (s_max[row] * _SPREAD[np.clip(j, 0, NODES)] for j in (i - 1, i))
        return low, high

    def _picked(self, rows: Array) -> MonotoneSlip:
        return MonotoneSlip(self.heights, *(np.asarray(part)[rows] for part in self._settings()))

    def _settings(self) -> tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike]:
        return self.stiffness, self.roughness, self.strength, self.heating

    def _scaled(self, u: ArrayLike) -> tuple[Array, Array, Array]:
        u, R = np.broadcast_arrays(np.asarray(u, dtype=float), np.asarray(self.roughness, dtype=float))
        return u, np.where(R > 0, R, 1.0), R > 0


def of(
    heights: Heights, stiffness_0: float, stiffness_t: float, area: float, roughness: float, mu_0: float, speed: float,
    strength: float = np.inf, temperature_limit: float = np.inf, heating: float = 0.0, unit: float = 1e-6,
) -> MonotoneSlip:  # fmt: skip
    """The numbers without dimension (3.8-6), (3.8-19), (3.8-28).

    Args:
        stiffness_0: c_N0, N/m. stiffness_t: c_R0z, N/m. area: A_0, m2. roughness: R_Z, m. mu_0: friction coefficient
            when cold. speed: v_P, m/s. strength: tau_S0, Pa. temperature_limit: dT_E, K. heating: k_T, K m2/W.
            unit: a_0, m, by which displacements are divided; forces are divided by c_N0 a_0, friction by mu_0 c_N0 a_0.
    """
    friction = mu_0 * stiffness_0
    k = heating * friction * unit * speed / (temperature_limit * area)
    return MonotoneSlip(heights, stiffness_t / friction, roughness / unit, strength * area / (friction * unit), k)

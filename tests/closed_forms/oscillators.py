"""Small smooth systems whose bifurcations are known."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from microslip.bifurcation.dynamics import Dynamics


def brusselator(low: float = 1.5, high: float = 4.0) -> Dynamics:
    """x' = 1 - (p + 1) x + x^2 y, y' = p x - x^2 y: rests at (1, p), Hopf point at p = 2 with omega = 1."""

    def rate(z: Any, p: Any, _: Any) -> Any:
        x, y = z[0], z[1]
        return jnp.stack([1 - (p + 1) * x + x**2 * y, p * x - x**2 * y])

    return Dynamics(rate, ("x", "y"), np.array([2.0, 2.0]), high - low)


A_1, A_2, B_1, B_2 = 0.14, 1.14, 2.0, 100.0
"""Of Sextro Eq. (4.4-9)."""


def belt(low: float, high: float, over: str = "B", **fixed: float) -> Dynamics:
    """The two masses on a belt of Sextro Eq. (4.4-1), with the mass ratio that is missing there, in its own words; over
    B, v_0 or D, the others fixed."""

    def mu(v: Any) -> Any:
        return A_1 * (1 + A_2 * jnp.exp(-B_1 * jnp.abs(v))) * jnp.arctan(B_2 * v)

    def rate(x: Any, p: Any, _: Any) -> Any:
        k = {"B": 8.0, "v_0": 1.0, "D": 0.1} | fixed | {over: p}
        B, v, D = k["B"], k["v_0"], k["D"]
        first = -3.0 * x[0] - 4.0 * D * x[1] + x[2] + 2 * D * x[3] + B * (mu(-v) - mu(x[1] - v))
        second = x[0] + 2 * D * x[1] - x[2] - 2 * D * x[3] + B * (mu(-v) - mu(x[3] - v))
        return jnp.stack([x[1], first / 2.5, x[3], second])

    return Dynamics(rate, ("x_1", "x_2", "x_3", "x_4"), np.full(4, 4.0), high - low)

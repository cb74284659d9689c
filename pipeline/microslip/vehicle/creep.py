"""Creep forces for motions in time, as pure functions of jax: Kalker's linear theory, the strips, a table of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp

from ..rolling import strips
from ..rolling.kalker import creep_coefficients
from ..rolling.table import CreepTable

Array = Any
Creep = Callable[..., tuple[Array, Array, Array]]
"""(xi, eta, phi, a, b, normal force, friction, G, nu), arrays (n,) -> F_x, F_y (N), M_z (N m) on the upper body."""


def linear(
    xi: Array, eta: Array, phi: Array, a: Array, b: Array, force: Array, friction: Array, shear: Array, poisson: Array
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Kalker's, without slip: no friction is large enough."""
    c11, c22, c23, c33 = creep_coefficients(a / b, poisson) * shear
    c = jnp.sqrt(a * b)
    y = -(c**2) * c22 * eta - c**3 * c23 * phi
    return -(c**2) * c11 * xi, y, c**3 * c23 * eta - c**4 * c33 * phi


def of_strips(**how: Any) -> Creep:
    """`strips.creep_forces`, of these keywords."""

    def forces(*given: Array) -> tuple[Array, Array, Array]:
        pose = strips.poses(*(jnp.broadcast_to(v, given[0].shape) for v in given), **how)
        found = strips.forces(pose, how.get("elements", (20, 20)), how.get("distribution", "constant"))
        return found.x, found.y, found.moment

    return forces


def of_table(table: CreepTable) -> Creep:
    """What `CreepTable.forces` reads, in a compiled loop; poisson is that of the table."""
    scales, values = jnp.asarray(table.coefficients), jnp.asarray(table.values)
    ends = [(float(v[0]), float(v[-1]), len(v)) for v in (table.size, table.azimuth, table.polar)]
    ends.append((float(jnp.log(table.ratio[0])), float(jnp.log(table.ratio[-1])), len(table.ratio)))

    def forces(
        xi: Array, eta: Array, phi: Array, a: Array, b: Array, force: Array, friction: Array, shear: Array, _: Array
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        area, held = a * b, friction * force
        ratio = jnp.clip(jnp.log(a / b), ends[3][0], ends[3][1])
        scale = jnp.stack([jnp.interp(ratio, jnp.log(jnp.asarray(table.ratio)), c) for c in scales])
        r = shear * area / held * scale * jnp.stack([xi, eta, jnp.sqrt(area) * phi])
        r = jnp.sqrt(jnp.sum(r**2, axis=0) + 1e-30)
        forward, turned = jnp.where(xi < 0, -1.0, 1.0), jnp.where(phi < 0, -1.0, 1.0)
        flat = jnp.sqrt((xi / b) ** 2 + (eta / a) ** 2)
        azimuth = jnp.arctan2(turned * eta * jnp.sqrt(b), jnp.abs(xi) * jnp.sqrt(a))
        x, y, moment = _straight(values, ends, (r / (1 + r), azimuth, jnp.arctan2(flat, jnp.abs(phi)), ratio))
        return forward * held * x, turned * held * y, turned * held * jnp.sqrt(area) * moment

    return forces


def _straight(values: Array, ends: list[tuple[float, float, int]], at: tuple[Array, ...]) -> Array:
    """(3, n) of (3, ...) values on equal steps, straight between them."""
    lows, shares = [], []
    for (low, high, count), v in zip(ends, at, strict=True):
        place = jnp.clip((v - low) / (high - low), 0.0, 1.0) * (count - 1)
        lows.append(jnp.clip(jnp.floor(place).astype(int), 0, count - 2))
        shares.append(place - lows[-1])
    total: Array = 0.0
    for corner in range(2 ** len(at)):
        up = [corner >> k & 1 for k in range(len(at))]
        weight: Array = 1.0
        for share, one in zip(shares, up, strict=True):
            weight = weight * (share if one else 1 - share)
        total = total + weight * values[(slice(None), *(low + one for low, one in zip(lows, up, strict=True)))]
    return total

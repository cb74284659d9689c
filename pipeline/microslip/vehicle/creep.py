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
    widest = float(table.ratio[-1])

    def forces(
        xi: Array, eta: Array, phi: Array, a: Array, b: Array, force: Array, friction: Array, shear: Array, _: Array
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        ratio, c = jnp.clip(a / b, 1 / widest, widest), jnp.sqrt(a * b)
        wide = jnp.sqrt(ratio)
        x, y, moment = table.read(xi, eta, phi, c * wide, c / wide, friction * force, shear, jnp)
        return x, y, moment

    return forces

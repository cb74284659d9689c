"""Creep forces for motions in time, as pure functions of jax: Kalker's linear theory, the strips, a table of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
from jax import lax

from ..rolling import strips
from ..rolling.kalker import coefficients_at
from ..rolling.table import CreepTable, cubic, placed

Array = Any
Creep = Callable[..., tuple[Array, Array, Array]]
"""(xi, eta, phi, a, b, normal force, friction, G, nu), arrays (n,) -> F_x, F_y (N), M_z (N m) on the upper body."""


def linear(
    xi: Array, eta: Array, phi: Array, a: Array, b: Array, force: Array, friction: Array, shear: Array, poisson: Array
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Kalker's, without slip: no friction is large enough."""
    c11, c22, c23, c33 = coefficients_at(a / b, poisson) * shear
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
    """What `CreepTable.forces` reads, in a compiled loop; poisson is that of the table, a/b beyond it is its end."""
    axes, values = [jnp.asarray(axis) for axis in table.axes], jnp.asarray(table.values)
    ridge = int(jnp.searchsorted(axes[0], 0.5))
    least, most = float(table.ratio[0]), float(table.ratio[-1])

    def forces(
        xi: Array, eta: Array, phi: Array, a: Array, b: Array, force: Array, friction: Array, shear: Array, _: Array
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        held, c, ratio = friction * force, jnp.sqrt(a * b), jnp.clip(a / b, least, most)
        p = strips.poses(xi, eta, phi, a, b, held, jnp.ones_like(a), shear, table.poisson, **table.how)
        at, signs = placed(p, ratio, jnp)
        weights = [
            cubic(axis, v, ridge if k == 0 else 0, jnp) for k, (axis, v) in enumerate(zip(axes, at, strict=True))
        ]
        x, y, moment = jnp.stack([_between(values, weights, i) for i in range(len(xi))], axis=1) * signs * held
        return x, y, c * moment

    return forces


def _between(values: Array, weights: list[tuple[Array, Array]], i: int) -> Array:
    """(3,) values at the place i."""
    first = [jnp.int32(0), *(first[i].astype(jnp.int32) for first, _ in weights)]
    found = lax.dynamic_slice(values, first, [len(values), *(w.shape[1] for _, w in weights)])
    for _, weight in reversed(weights):
        found = found @ weight[i]
    return found

"""Harmonics of the contact force from harmonics of the displacement, with all derivatives: alternating frequency/time.

The points of a contact do not know of each other, so the derivative is taken per point, with respect to the 3 (2 H + 1)
displacement harmonics of that point alone, and contracted with the kinematics of the contact afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp

from ..programs import inner
from ..series import cycle_waves
from .law import Array, Law, Scalar, point_axes
from .periodic import Known, near, unknown, with_slopes

CHUNK = 120
"""Points treated at a time: their tangents stay in the cache, and memory does not grow with the number of points."""

CHUNK_ALONE = 480
"""The same of forces without tangents: the fewer parts, the less often each operation begins."""


@partial(inner, static_argnames=("samples", "count", "chunk"))
def force_harmonics(
    law: Law, u: Array, period: Scalar, samples: int = 64, count: int = 2, chunk: int = CHUNK,
    periodicity: Scalar = 0.0,
) -> tuple[Array, Array]:  # fmt: skip
    """Harmonics of the force in the last cycle, and their derivative.

    A point that slides all the way both ways has forgotten its beginning after one cycle. A point that slides little,
    or whose normal load swings, may creep for many: ask for more, and let ``periodicity`` end them.

    Args:
        u: (n, 3, 2 H + 1) displacement: mean, cos, sin, cos 2, sin 2, ... in m. period: s. samples: a cycle.
        count: of cycles at most. chunk: points at a time; the cost is linear in the number of points whatever it is.
        periodicity: the cycles of a chunk end when its sliders are periodic within this share of its largest force
            (`periodic.periodic`); 0 marches all of them.

    Returns:
        (n, 3, 2 H + 1) force in N and (n, 3, 2 H + 1, 3, 2 H + 1) its derivative in N/m.
    """

    def one(law: Law, u: Array) -> tuple[Array, Array]:
        return _with_derivative(law, u, period, samples, count, periodicity)

    force, slope = _chunked(one, law, chunk, u)
    return force, slope


@partial(inner, static_argnames=("samples", "count", "chunk"))
def force_alone(
    law: Law, u: Array, period: Scalar, samples: int = 64, count: int = 2, chunk: int = CHUNK_ALONE,
    periodicity: Scalar = 0.0,
) -> Array:  # fmt: skip
    """The force of `force_harmonics` without its derivative; in chunks of one size after the same number of cycles."""
    return force_near(law, u, unknown(law, u.shape[0]), period, samples, count, chunk, periodicity)[0]


def force_near(
    law: Law, u: Array, known: Known, period: Scalar, samples: int, count: int, chunk: int = CHUNK_ALONE,
    periodicity: Scalar = 0.0,
) -> tuple[Array, Known]:  # fmt: skip
    """`force_alone`, begun with what sliders remember of a motion near by, and what they remember now."""
    values, ahead, transform = map(jnp.asarray, cycle_waves(u.shape[2] // 2, samples))

    def one(law: Law, u: Array, *known: Array) -> tuple[Array, ...]:
        path, rate = (jnp.einsum("sh,nkh->snk", of, u) for of in (values, ahead))
        begun = Known(*(jnp.moveaxis(x, 0, -1) for x in known))
        force, found = near(law, path, rate / period, period, count, periodicity, transform, begun)
        return jnp.einsum("hkn->nkh", force), *(jnp.moveaxis(x, -1, 0) for x in found)

    force, *found = _chunked(one, law, chunk, u, *(jnp.moveaxis(x, -1, 0) for x in known))
    return force, Known(*(jnp.moveaxis(x, 0, -1) for x in found))


def _chunked(one: Callable[..., tuple[Array, ...]], law: Law, most: int, *given: Array) -> tuple[Array, ...]:
    """What ``one`` finds for a law and what is given of points (n, ...), so many points at a time at most."""
    n = given[0].shape[0]
    if n <= most:
        return one(law, *given)
    parts = -(-n // most)
    chunk = -(-n // parts)
    fill = parts * chunk - n
    whole = [jnp.pad(x, [(0, fill), *[(0, 0)] * (x.ndim - 1)], mode="edge") for x in given]
    filled = [x.reshape(parts, chunk, *x.shape[1:]) for x in whole]
    leaves, tree = jax.tree_util.tree_flatten(law)
    axes = point_axes(law, n)
    split = [_split(leaf, axis, parts, chunk) for leaf, axis in zip(leaves, axes, strict=True) if axis is not None]

    def part(given: tuple[list[Array], list[Array]]) -> tuple[Array, ...]:
        per_point = iter(given[0])
        mixed = [leaf if axis is None else next(per_point) for leaf, axis in zip(leaves, axes, strict=True)]
        return one(jax.tree_util.tree_unflatten(tree, mixed), *given[1])

    return tuple(x.reshape(-1, *x.shape[2:])[:n] for x in jax.lax.map(part, (split, filled)))


def _split(leaf: Array, axis: int, parts: int, chunk: int) -> Array:
    """(parts, ...) with ``chunk`` points along the axis of each part, filled with the last one."""
    last = jnp.moveaxis(jnp.asarray(leaf), axis, -1)
    fill = [(0, 0)] * (last.ndim - 1) + [(0, parts * chunk - last.shape[-1])]
    whole = jnp.moveaxis(jnp.pad(last, fill, mode="edge").reshape(*last.shape[:-1], parts, chunk), -2, 0)
    return jnp.moveaxis(whole, -1, 1) if axis == 0 else whole


def _with_derivative(
    law: Law, u: Array, period: Scalar, samples: int, count: int, periodicity: Scalar
) -> tuple[Array, Array]:
    """With the tangents along every harmonic of every direction."""
    values, ahead, transform = map(jnp.asarray, cycle_waves(u.shape[2] // 2, samples))
    path, rate = (jnp.einsum("sh,nkh->snk", of, u) for of in (values, ahead))
    found, slope = with_slopes(law, path, rate / period, period, count, periodicity, values, ahead, transform)
    return jnp.einsum("hs,snk->nkh", transform, found.force), jnp.einsum("hzjnk->nkhjz", slope)

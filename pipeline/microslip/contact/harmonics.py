"""Harmonics of the contact force from harmonics of the displacement, with all derivatives: alternating frequency/time.

The points of a contact do not know of each other, so the derivative is taken per point, with respect to the 3 (2 H + 1)
displacement harmonics of that point alone, and contracted with the kinematics of the contact afterwards.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .law import Array, Law, State, point_axes

CHUNK = 120
"""Points treated at a time: their tangents stay in the cache, and memory does not grow with the number of points."""


def waves(harmonics: int, samples: int) -> tuple[Array, Array]:
    """(s, 2 H + 1) values of 1, cos, sin, cos 2, ... at the samples, and (2 H + 1, s) its inverse, the transform.

    Raises:
        ValueError: fewer than 2 H + 1 samples cannot hold H harmonics.
    """
    if samples < 2 * harmonics + 1:
        raise ValueError(f"{samples} samples cannot hold {harmonics} harmonics; take at least {2 * harmonics + 1}")
    t = 2 * np.pi * np.arange(samples) / samples
    pairs = [f(h * t) for h in range(1, harmonics + 1) for f in (np.cos, np.sin)]
    values = np.column_stack([np.ones(samples), *pairs])
    weights = np.full(2 * harmonics + 1, 2.0 / samples)
    weights[0] = 1.0 / samples
    return jnp.asarray(values), jnp.asarray(weights[:, None] * values.T)


@partial(jax.jit, static_argnames=("samples", "count", "chunk"))
def force_harmonics(
    law: Law, u: Array, period: Array | float, samples: int = 64, count: int = 2, chunk: int = CHUNK,
    settled: Array | float = 0.0,
) -> tuple[Array, Array]:  # fmt: skip
    """Harmonics of the force in the last of ``count`` cycles, and their derivative.

    A point that slides all the way both ways has forgotten its beginning after one cycle. Where the normal load swings
    a point may creep for many cycles until it shakes down: ask for more, and let ``settled`` end them.

    Args:
        u: (n, 3, 2 H + 1) displacement: mean, cos, sin, cos 2, sin 2, ... in m. period: s. samples: a cycle.
        count: of cycles at most. chunk: points at a time; the cost is linear in the number of points whatever it is.
        settled: the cycles end when no point of a chunk ends one with a force that differs from the one before by
            more than this share of the chunk's largest; 0 marches all of them.

    Returns:
        (n, 3, 2 H + 1) force in N and (n, 3, 2 H + 1, 3, 2 H + 1) its derivative in N/m.
    """
    n = u.shape[0]
    if n <= chunk:
        return _with_derivative(law, u, period, samples, count, settled)
    parts = -(-n // chunk)
    filled = jnp.concatenate([u, jnp.zeros((parts * chunk - n, *u.shape[1:]))]).reshape(parts, chunk, *u.shape[1:])
    leaves, tree = jax.tree_util.tree_flatten(law)
    axes = point_axes(law, n)
    split = [_split(leaf, axis, parts, chunk) for leaf, axis in zip(leaves, axes, strict=True) if axis is not None]

    def one(part: tuple[list[Array], Array]) -> tuple[Array, Array]:
        per_point = iter(part[0])
        mixed = [leaf if axis is None else next(per_point) for leaf, axis in zip(leaves, axes, strict=True)]
        return _with_derivative(jax.tree_util.tree_unflatten(tree, mixed), part[1], period, samples, count, settled)

    force, slope = jax.lax.map(one, (split, filled))
    return force.reshape(-1, *u.shape[1:])[:n], slope.reshape(-1, *slope.shape[2:])[:n]


def _split(leaf: Array, axis: int, parts: int, chunk: int) -> Array:
    """(parts, ...) with ``chunk`` points along the axis of each part, filled with the last one."""
    last = jnp.moveaxis(jnp.asarray(leaf), axis, -1)
    fill = [(0, 0)] * (last.ndim - 1) + [(0, parts * chunk - last.shape[-1])]
    whole = jnp.moveaxis(jnp.pad(last, fill, mode="edge").reshape(*last.shape[:-1], parts, chunk), -2, 0)
    return jnp.moveaxis(whole, -1, 1) if axis == 0 else whole


class _Running(NamedTuple):
    """State and tangents at the end of a cycle, force there (n, 3), its change over the cycle, cycles done."""

    carried: tuple[State, State]
    force: Array
    change: Array
    done: Array


def _with_derivative(
    law: Law, u: Array, period: Array | float, samples: int, count: int, settled: Array | float
) -> tuple[Array, Array]:
    """Marched together with the tangents of state and force along every harmonic.

    A harmonic of one direction moves all points alike: only (3 (2 H + 1), 3) numbers a sample, and not those of every
    point, are handed to the tangents of `Law.step`.
    """
    harmonics, size = u.shape[2] // 2, u.shape[1] * u.shape[2]
    values, transform = waves(harmonics, samples)
    rates = (values - jnp.roll(values, 1, axis=0)) * (samples / period)
    unit = jnp.eye(size).reshape(size, *u.shape[1:])

    def one(carried: tuple[State, State], rows: tuple[Array, Array]) -> tuple[tuple[State, State], tuple[Array, Array]]:
        state, tangents = carried
        at = tuple(u @ row for row in rows)

        def push(along: State, *moved: Array) -> tuple[tuple[Array, State], tuple[Array, State]]:
            whole = tuple(jnp.broadcast_to(m, u.shape[:2]) for m in moved)
            return jax.jvp(lambda x, v, s: law.step(x, v, period / samples, s), (*at, state), (*whole, along))

        moved = (unit @ row for row in rows)
        (force, after), (slope, changed) = jax.vmap(push, out_axes=((None, None), (0, 0)))(tangents, *moved)
        return (after, changed), (force, slope)

    def cycle(running: _Running) -> _Running:
        first = jax.tree_util.tree_map(lambda row: row[:-1], (values, rates))
        carried, _ = jax.lax.scan(lambda c, rows: (one(c, rows)[0], None), running.carried, first)
        carried, (force, _) = one(carried, (values[-1], rates[-1]))
        return _Running(carried, force, jnp.abs(force - running.force).max(), running.done + 1)

    def unsettled(running: _Running) -> Array:
        return (running.done < count - 1) & (running.change > settled * jnp.abs(running.force).max())

    state = law.init(u.shape[0])
    carried = state, jax.tree_util.tree_map(lambda leaf: jnp.zeros((size, *leaf.shape)), state)
    running = _Running(carried, jnp.zeros(u.shape[:2]), jnp.asarray(jnp.inf), jnp.asarray(0))
    carried = jax.lax.while_loop(unsettled, cycle, running).carried if count > 1 else carried
    _, (force, slope) = jax.lax.scan(one, carried, (values, rates))
    slopes = jnp.einsum("hs,smnk->nkhm", transform, slope)
    return jnp.einsum("hs,snk->nkh", transform, force), slopes.reshape(*u.shape, *u.shape[1:])

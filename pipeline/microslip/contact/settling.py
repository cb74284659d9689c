"""A cycle of a law whose sliders can be solved for (`Law.recalled`), again and again from other memories.

Where a step begins, but for the memory, does not depend on the cycle. What steps are of besides the memory
(`Law.way`) is therefore found once, for all samples at once; what goes from sample to sample is `Law.drag` alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .cycle import rates, stepped
from .law import Array, Law, State


class Ways(NamedTuple):
    """The steps of a cycle.

    Attributes:
        rate: (s, n, 3) m/s. placed: states at the samples, what they remember apart. begun: states the steps begin
            with, of the first cycle the first one at rest. first: what the steps of the first cycle are of, `Law.way`;
            all: those of every other.
    """

    rate: Array
    placed: State
    begun: State
    first: Any
    all: Any


def ways(law: Law, path: Array, dt: Array | float) -> Ways:
    """Of a periodic path (s, n, 3) m."""
    rate, rest = rates(path, dt), law.init(path.shape[1])
    placed = jax.vmap(lambda u, v: stepped(law, u, v, dt, rest)[1])(path, rate)
    before = jax.tree_util.tree_map(lambda leaf: jnp.roll(leaf, 1, axis=0), placed)
    every = jax.vmap(lambda u, v, state: law.way(u, v, dt, state))(path, rate, before)
    begun, first = _beginning(before, rest), _beginning(every, law.way(path[0], rate[0], dt, rest))
    return Ways(rate, placed, begun, first, every)


def _beginning(rows: Any, first: Any) -> Any:
    """Rows with another first one."""
    return jax.tree_util.tree_map(lambda leaf, one: leaf.at[0].set(one), rows, first)


class Cycle(NamedTuple):
    """A cycle: forces (s, 3, n) N, the memory that every step begins with (s, ..., 2, n) N, and that at its end."""

    force: Array
    begun: Array
    memory: Array


def cycle(law: Law, ways: Any, memory: Array) -> Cycle:
    """From a memory at its beginning; ways: `Law.way` of its steps."""

    def one(memory: Array, way: Any) -> tuple[Array, tuple[Array, Array]]:
        force, after = law.drag(way, memory)
        return after, (force, memory)

    after, (force, begun) = jax.lax.scan(one, memory, ways)
    return Cycle(force, begun, after)


def recall(law: Law, ways: Any, memory: Array) -> tuple[Cycle, Array]:
    """`cycle`, and (2, ..., 2, n) how the memory at the end follows either direction of that at the beginning."""

    def one(carried: tuple[Array, Array], way: Any) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        memory, slope = carried

        def dragged(memory: Array) -> tuple[Array, Array]:
            force, after = law.drag(way, memory)
            return after, force

        def along(tangent: Array) -> tuple[Array, Array, Array]:
            return jax.jvp(dragged, (memory,), (tangent,), has_aux=True)

        after, slope, force = jax.vmap(along, out_axes=(None, 0, None))(slope)
        return (after, slope), (force, memory)

    (after, slope), (force, begun) = jax.lax.scan(one, (memory, directions(memory)), ways)
    return Cycle(force, begun, after), slope


def directions(memory: Array) -> Array:
    """(2, ..., 2, n): 1 N along either direction of a memory (..., 2, n)."""
    return jnp.stack([jnp.zeros_like(memory).at[..., k, :].set(1.0) for k in range(2)])

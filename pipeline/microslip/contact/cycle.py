"""One cycle of a periodic path through a contact law: with tangents, or again and again from other memories.

Where the sliders of a law can be solved for (`law.SolvableMemory`), where a step begins does not depend on the cycle,
but for the memory. What steps are of besides the memory (`way`) is therefore found once, for all samples at once; what
goes from sample to sample is `drag` alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .law import Array, Law, Scalar, State, stepped, velocities


def around(path: Array, dt: Scalar) -> Array:
    """Rates of a periodic path (s, ...) over the steps that end at its samples."""
    return velocities(path, dt, path[-1])


def push(
    law: Law, dt: Scalar, state: State, tangents: State, rows: tuple[Array, ...]
) -> tuple[tuple[Array, State], tuple[Array, State]]:
    """`law.march`, and its tangents along every parameter: of the force (s, p, n, 3), and of the state.

    Args:
        tangents: of the state at the beginning, parameters first. rows: (s, n, 3) m and m/s of the path, and (s, p, 3)
            by which a parameter moves all points alike: only these numbers a sample, not those of every point, are
            handed to the tangents of a step.
    """

    def one(carried: tuple[State, State], row: tuple[Array, ...]) -> tuple[tuple[State, State], tuple[Array, ...]]:
        state, tangents = carried
        u, v, *moved = row

        def along(tangent: State, *moved: Array) -> tuple[tuple[Array, State], tuple[Array, State]]:
            whole = tuple(jnp.broadcast_to(m, u.shape) for m in moved)
            return jax.jvp(lambda x, v, s: stepped(law, x, v, dt, s), (u, v, state), (*whole, tangent))

        (force, after), (slope, changed) = jax.vmap(along, out_axes=((None, None), (0, 0)))(tangents, *moved)
        return (after, changed), (force, slope)

    (after, changed), (force, slope) = jax.lax.scan(one, (state, tangents), rows)
    return (force, after), (slope, changed)


def blank(state: State, count: int) -> State:
    """No tangents, so many."""
    return jax.tree_util.tree_map(lambda leaf: jnp.zeros((count, *leaf.shape)), state)


# from other memories -------------------------------------------------------------------------------------------------


class Ways(NamedTuple):
    """The steps of a cycle.

    Attributes:
        rate: (s, n, 3) m/s. placed: states at the samples, what they remember apart. all: what steps are of,
            `way`; first: that of the first step of all, from rest.
    """

    rate: Array
    placed: State
    all: Any
    first: Any


def ways(law: Law, path: Array, rate: Array, dt: Scalar) -> Ways:
    """Of a periodic path (s, n, 3) m and its rate (s, n, 3) m/s."""
    rest = law.init(path.shape[1])
    placed = jax.vmap(lambda u, v: stepped(law, u, v, dt, rest)[1])(path, rate)
    every = jax.vmap(lambda u, v, state: law.way(u, v, dt, state))(path, rate, rolled(placed))
    return Ways(rate, placed, every, law.way(path[0], rate[0], dt, rest))


def rolled(rows: Any) -> Any:
    """A sample later."""
    return jax.tree_util.tree_map(lambda leaf: jnp.roll(leaf, 1, axis=0), rows)


def beginning(rows: Any, first: Any) -> Any:
    """Rows with another first one."""
    return jax.tree_util.tree_map(lambda leaf, one: leaf.at[0].set(one), rows, first)


class CycleFromMemory(NamedTuple):
    """A cycle: forces (s, 3, n) N, the memory that every step begins with (s, ..., 2, n) N, and that at its end."""

    force: Array
    begun: Array
    memory: Array


def cycle(law: Law, ways: Any, memory: Array) -> CycleFromMemory:
    """From a memory at its beginning; ways: `way` of its steps."""

    def one(memory: Array, way: Any) -> tuple[Array, tuple[Array, Array]]:
        force, after = law.drag(way, memory)
        return after, (force, memory)

    after, (force, begun) = jax.lax.scan(one, memory, ways)
    return CycleFromMemory(force, begun, after)


def first_memory(law: Law, ways: Ways, rest: Array) -> Array:
    """That after the first cycle, from rest."""

    def one(sample: Any, memory: Array) -> Array:
        return law.drag(jax.tree_util.tree_map(lambda leaf: leaf[sample], ways.all), memory)[1]

    return jax.lax.fori_loop(1, len(ways.rate), one, law.drag(ways.first, rest)[1])


class SummedCycle(NamedTuple):
    """A cycle: (h, 3, n) weighted sums of its forces, N, the largest entry of these, and the memory at its end."""

    force: Array
    size: Array
    memory: Array


def turn(law: Law, ways: Any, weights: Array, memory: Array) -> SummedCycle:
    """From a memory at its beginning; ways: `way` of its steps. weights: (s, h) of the sums."""

    def one(at: tuple[Array, Array, Array], row: tuple[Any, Array]) -> tuple[tuple[Array, Array, Array], None]:
        force, after = law.drag(row[0], at[2])
        return (*_more(at, force, row[1]), after), None

    (force, size, after), _ = jax.lax.scan(one, (*_none(memory, weights), memory), (ways, weights))
    return SummedCycle(force, size.max(), after)


def recall(law: Law, ways: Any, weights: Array, memory: Array) -> tuple[SummedCycle, Array]:
    """`turn`, and (2, ..., 2, n) how the memory at the end follows either direction of that at the beginning."""

    def one(at: Any, row: tuple[Any, Array]) -> tuple[Any, None]:
        *sums, memory, slope = at

        def dragged(memory: Array) -> tuple[Array, Array]:
            force, after = law.drag(row[0], memory)
            return after, force

        def along(tangent: Array) -> tuple[Array, Array, Array]:
            return jax.jvp(dragged, (memory,), (tangent,), has_aux=True)

        after, slope, force = jax.vmap(along, out_axes=(None, 0, None))(slope)
        return (*_more(sums, force, row[1]), after, slope), None

    begin = (*_none(memory, weights), memory, directions(memory))
    (force, size, after, slope), _ = jax.lax.scan(one, begin, (ways, weights))
    return SummedCycle(force, size.max(), after), slope


def _none(memory: Array, weights: Array) -> tuple[Array, Array]:
    """No sums, and no largest force of a point."""
    n = memory.shape[-1]
    return jnp.zeros((weights.shape[1], 3, n)), jnp.zeros((3, n))


def _more(sums: Any, force: Array, weight: Array) -> tuple[Array, Array]:
    """With the force (3, n) of a sample."""
    return sums[0] + weight[:, None, None] * force, jnp.maximum(sums[1], jnp.abs(force))


def directions(memory: Array) -> Array:
    """(2, ..., 2, n): 1 N along either direction of a memory (..., 2, n)."""
    return jnp.stack([jnp.zeros_like(memory).at[..., k, :].set(1.0) for k in range(2)])

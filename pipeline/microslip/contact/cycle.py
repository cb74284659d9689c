"""One cycle of a path through a contact law, from the state that it begins with; alone, or with tangents."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from ..programs import inner
from .law import Array, Law, State


@inner
def stepped(law: Law, u: Array, v: Array, dt: Array | float, state: State) -> tuple[Array, State]:
    """`Law.step`, which python reads once for all its uses."""
    return law.step(u, v, dt, state)


def rates(path: Array, dt: Array | float) -> Array:
    """Rates of a periodic path (s, ...) over the steps that end at its samples."""
    return (path - jnp.roll(path, 1, axis=0)) / dt


def march(law: Law, path: Array, dt: Array | float, state: State) -> tuple[Array, State]:
    """Forces (s, n, 3) N along a path (s, n, 3) m, and the state at its end."""

    def one(state: State, row: tuple[Array, Array]) -> tuple[State, Array]:
        force, after = stepped(law, *row, dt, state)
        return after, force

    after, force = jax.lax.scan(one, state, (path, rates(path, dt)))
    return force, after


def push(
    law: Law, path: Array, dt: Array | float, state: State, tangents: State, moves: Array
) -> tuple[tuple[Array, State], tuple[Array, State]]:
    """`march`, and its tangents along every parameter: of the force (s, p, n, 3), and of the state.

    Args:
        tangents: of the state at the beginning, parameters first. moves: (s, p, 3) m, by which a parameter moves all
            points alike: only these numbers a sample, not those of every point, are handed to the tangents of a step.
    """
    rows = (path, rates(path, dt), moves, rates(moves, dt))

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

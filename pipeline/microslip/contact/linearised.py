"""A cycle through a contact law, linearised: how the force and what the sliders remember follow a change of the motion.

A step depends on where it ends, on where it began, and on the memory there. With derivatives of the step alone

    x_s = A_s x_(s-1) + B_s u_s + C_s u_(s-1),    F_s = G_s x_(s-1) + D_s u_s + E_s u_(s-1)

for the tangents x of the memory and F of the force under moves u of the samples. These derivatives are taken for many
samples at once; what goes from sample to sample is this recursion. It is linear in the memory that the cycle begins
with, so that one cycle tells what every beginning would give.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from .law import Array, Law, State

BLOCK = 2048
"""Samples times sliders that are differentiated at once, for the cache and for memory that does not grow with them."""


class Linearised(NamedTuple):
    """A cycle under p parameters, of m sliders at each of n points.

    Attributes:
        memory: (p, m, 2, n) tangents at the end, from a beginning without any. by_memory: (2, m, 2, n) those of a
            memory of 1 N along either direction at the beginning. slope: (w, p, 3, n) weighted sums of the force's
            tangents. slope_by_memory: (w, 3, 2, m, n) those of the memory at the beginning.
    """

    memory: Array
    by_memory: Array
    slope: Array
    slope_by_memory: Array

    def begun_with(self, memory: Array) -> Array:
        """`slope` of a cycle that begins with tangents (p, m, 2, n) of the memory."""
        return self.slope + jnp.einsum("wikmn,pmkn->wpin", self.slope_by_memory, memory)


class _Steps(NamedTuple):
    """Derivatives of steps, samples along the first axis, as named above.

    Attributes:
        A: (s, 2, m, 2, n). B, C: (s, 3, m, 2, n). D, E: (s, 3, n, 3). G: (s, 3, m, 2, n).
    """

    A: Array
    B: Array
    C: Array
    D: Array
    E: Array
    G: Array


def linearised(
    law: Law, path: Array, rate: Array, dt: Array | float, start: State, follows: bool, moves: Array, weights: Array
) -> Linearised:  # fmt: skip
    """The cycle that begins with a state, of a law whose sliders can be solved for (`Law.recalled`).

    Args:
        path: (s, n, 3) m. rate: (s, n, 3) m/s over the steps. follows: the state is that after another such cycle, not
            one of rest. moves: (s, p, 3) m of all points alike, periodic. weights: (w, s).
    """
    samples, p = moves.shape[:2]
    memory = sliders(law.memory(path[-1], start), 0)
    m, n = memory.shape[0], memory.shape[2]
    size = max(k for k in range(1, samples + 1) if samples % k == 0 and k * m * n <= max(BLOCK, m * n))
    rows = (path, rate, moves, jnp.roll(moves, 1, axis=0), weights.T)

    def block(carried: tuple, rows: tuple[Array, ...]) -> tuple[tuple, None]:
        state, held, x, by_memory, slope, slope_by_memory = carried
        u, v, moved, before, weight = rows
        after, states = jax.lax.scan(lambda one, row: (law.step(*row, dt, one)[1], one), state, (u, v))
        steps, held = _steps(law, u, v, dt, states, held)
        (x, by_memory), (along, by_start) = jax.lax.scan(_recursion, (x, by_memory), (steps, moved, before))
        direct = [jnp.einsum("sw,spj,sjni->wpin", weight, m, D) for m, D in ((moved, steps.D), (before, steps.E))]
        slope = slope + direct[0] + direct[1] + jnp.einsum("sw,spin->wpin", weight, along)
        slope_by_memory = slope_by_memory + jnp.einsum("sw,sikmn->wikmn", weight, by_start)
        return (after, held, x, by_memory, slope, slope_by_memory), None

    w = len(weights)
    none = jnp.zeros((p, m, 2, n)), jnp.zeros((w, p, 3, n)), jnp.zeros((w, 3, 2, m, n))
    units = jnp.broadcast_to(jnp.eye(2)[:, None, :, None], (2, m, 2, n))
    held = _held_at(law, path[-1], rate[-1], dt, start) if follows else _none(start, 3)
    begin = (start, held, none[0], units, none[1], none[2])
    blocks = tuple(row.reshape(samples // size, size, *row.shape[1:]) for row in rows)
    _, _, *found = jax.lax.scan(block, begin, blocks)[0]
    return Linearised(*found)


def sliders(memory: Array, lead: int) -> Array:
    """(..., m, 2, n) of a memory (..., 2, n) of one slider a point or (..., m, 2, n), after so many leading axes."""
    return memory.reshape(*memory.shape[:lead], -1, *memory.shape[-2:])


def _steps(law: Law, u: Array, v: Array, dt: Array | float, states: State, held: State) -> tuple[_Steps, State]:
    """Derivatives of steps to (s, n, 3) from states, and what goes on: tangents of the last state without its memory.

    Args:
        held: that of the state before.
    """
    ways = _ways(u.shape[1])

    def ahead(u: Array, v: Array, state: State) -> tuple[Array, ...]:
        """Of the end of a step and of the memory at its beginning."""
        memory = law.memory(u, state)
        units = jnp.stack([jnp.zeros_like(memory).at[..., k, :].set(1.0) for k in range(2)])
        of_end, after = _along(law, u, v, dt, state, ways, ways / dt, _none(state, 3))
        _, turned = _along(law, u, v, dt, state, 0 * ways[:2], 0 * ways[:2], jax.vmap(law.recalled)(_none(state, 2), units))
        _, pull = jax.vjp(lambda x: law.step(u, v, dt, law.recalled(state, x))[0], memory)
        A, B = (jax.vmap(law.memory, (None, 0))(u, s) for s in (turned, after))
        return A, B, of_end, jax.vmap(pull)(ways)[0], jax.vmap(law.recalled)(after, jnp.zeros_like(B))

    A, B, D, G, left = jax.vmap(ahead)(u, v, states)
    before = jax.tree_util.tree_map(lambda one, many: jnp.concatenate([one[None], many[:-1]]), held, left)

    def behind(u: Array, v: Array, state: State, held: State) -> tuple[Array, Array]:
        """Of the beginning of a step."""
        of_start, after = _along(law, u, v, dt, state, 0 * ways, -ways / dt, held)
        return of_start, jax.vmap(law.memory, (None, 0))(u, after)

    E, C = jax.vmap(behind)(u, v, states, before)
    last = jax.tree_util.tree_map(lambda leaf: leaf[-1], left)
    return _Steps(*(sliders(x, 2) for x in (A, B, C)), D, E, sliders(G, 2)), last


def _along(
    law: Law, u: Array, v: Array, dt: Array | float, state: State, du: Array, dv: Array, along: State
) -> tuple[Array, State]:  # fmt: skip
    """Tangents of force and state at the end of a step along several changes."""

    def push(du: Array, dv: Array, along: State) -> tuple[Array, State]:
        return jax.jvp(lambda u, v, s: law.step(u, v, dt, s), (u, v, state), (du, dv, along))[1]

    return jax.vmap(push)(du, dv, along)


def _held_at(law: Law, u: Array, v: Array, dt: Array | float, state: State) -> State:
    """Tangents of a state along where it is, without its memory: those at the end of a step that leads there."""
    ways = _ways(len(u))
    _, after = _along(law, u, v, dt, state, ways, ways / dt, _none(state, 3))
    memory = jnp.zeros_like(law.memory(u, state))
    return jax.vmap(law.recalled, (0, None))(after, memory)


def _ways(n: int) -> Array:
    """(3, n, 3) along n, t1 and t2, all points alike."""
    return jnp.broadcast_to(jnp.eye(3)[:, None], (3, n, 3))


def _none(state: State, count: int) -> State:
    """No tangents, so many."""
    return jax.tree_util.tree_map(lambda leaf: jnp.zeros((count, *leaf.shape)), state)


def _recursion(
    carried: tuple[Array, Array], row: tuple[_Steps, Array, Array]
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """A sample on: (p, m, 2, n) tangents of the memory and (2, m, 2, n) those of the memory at the beginning; those of
    the force (p, 3, n) and (3, 2, m, n)."""
    (x, begun), (step, moved, before) = carried, row
    force = jnp.sum(step.G * x[:, None], axis=(2, 3))
    by_start = jnp.einsum("imdn,kmdn->ikmn", step.G, begun)
    way = sum(moved[:, j, None, None, None] * step.B[j] + before[:, j, None, None, None] * step.C[j] for j in range(3))
    turned = [step.A[0] * y[:, :, :1] + step.A[1] * y[:, :, 1:] for y in (x, begun)]
    return (turned[0] + way, turned[1]), (force, by_start)

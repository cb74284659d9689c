"""A cycle through a contact law, linearised: how the force and what the sliders remember follow a change of the motion.

A step depends on where it ends, on where it began, and on the memory there. With derivatives of the step alone

    x_s = A_s x_(s-1) + B_s m_s,    F_s = G_s x_(s-1) + D_s m_s

for the tangents x of the memory and F of the force under moves m_s = (u_s, u'_s, u_(s-1), u'_(s-1)) of the samples,
the rates u' only where a law reads them (`Law.viscous`). These derivatives are taken for many
samples at once; what goes from sample to sample is this recursion. It is linear in the memory that the cycle begins
with, so that one cycle tells what every beginning would give.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .cycle import Ways, beginning, blank, directions, rolled
from .law import Array, Law, Scalar, State, stepped

BLOCK = 2048
"""Samples times sliders that are differentiated at once, for the cache and for memory that does not grow with them."""


class Linearised(NamedTuple):
    """A cycle under w signals along each of n, t1 and t2, of m sliders at each of n points.

    Attributes:
        memory: (w, 3, m, 2, n) tangents at the end, from a beginning without any. by_memory: (2, m, 2, n) those of a
            memory of 1 N along either direction at the beginning. slope: (h, w, 3, 3, n) weighted sums of the tangents
            of the force, its directions last but one. slope_by_memory: (h, 2, 3, m, n) those of the memory at the
            beginning.
    """

    memory: Array
    by_memory: Array
    slope: Array
    slope_by_memory: Array

    def begun_with(self, memory: Array) -> Array:
        """`slope` of a cycle that begins with tangents (w, 3, m, 2, n) of the memory."""
        return self.slope + jnp.einsum("hdimn,wkmdn->hwkin", self.slope_by_memory, memory)


class _Steps(NamedTuple):
    """Derivatives of steps, samples along the first axis, as named above.

    Attributes:
        A: (s, 2, m, 2, n). B: (s, k, 3, m, 2, n) of k moves. D: (s, k, 3, 3, n), of the force's directions last but
            one. G: (s, 3, m, 2, n).
    """

    A: Array
    B: Array
    D: Array
    G: Array


def linearised(
    law: Law, path: Array, dt: Scalar, ways: Ways, memory: Array, whole: Array, signals: Array, rates: Array,
    weights: Array,
) -> Linearised:  # fmt: skip
    """A cycle of a law whose sliders can be solved for (`Law.recalled`).

    Args:
        path: (s, n, 3) m. ways: of its steps. memory: that every step begins with. whole: whether the cycle is the
            periodic one, and the tangents of the force are asked for as well, or that from rest. signals: (s, w) by
            which all points move alike, periodic; rates: of theirs, over the time. weights: (h, s).
    """
    (samples, w), h, n = signals.shape, len(weights), path.shape[1]
    m = sliders(memory, 1).shape[1]
    size = max(k for k in range(1, samples + 1) if samples % k == 0 and k * m * n <= max(BLOCK, m * n))

    def block(carried: tuple, rows: tuple[Array, ...]) -> tuple[tuple, None]:
        x, by_memory, *sums = carried
        *place, moves, weight = rows
        steps = jax.lax.map(lambda row: _step(law, dt, *row), tuple(place))  # of all at once each would be found often
        (x, by_memory), each = jax.lax.scan(_recursion, (x, by_memory), (steps, moves))

        def more() -> list[Array]:
            forces = _forces(steps, moves, *each)
            return [a + jnp.einsum("sh,s...->h...", weight, b) for a, b in zip(sums, forces, strict=True)]

        sums = jax.lax.cond(whole, more, lambda: sums)
        return (x, by_memory, *sums), None

    held = jax.vmap(lambda u, v: _held(law, u, v, dt))(path, ways.rate)
    held = jax.tree_util.tree_map(lambda leaf: jnp.roll(leaf, 1, axis=0).at[0].multiply(whole), held)
    before = rolled(ways.placed)
    begun = jax.tree_util.tree_map(
        lambda first, every: jnp.where(whole, every, first), beginning(before, law.init(n)), before
    )
    each = jnp.broadcast_to(jnp.eye(2)[:, None, :, None], (2, m, 2, n))
    sums = jnp.zeros((h, w, 3, 3, n)), jnp.zeros((h, 2, 3, m, n))
    now = jnp.stack([signals, rates] if law.viscous else [signals], axis=1)
    moves = jnp.concatenate([now, jnp.roll(now, 1, axis=0)], axis=1)
    rows = (path, ways.rate, begun, held, memory, moves, weights.T)
    blocks = jax.tree_util.tree_map(lambda row: row.reshape(samples // size, size, *row.shape[1:]), rows)
    found, _ = jax.lax.scan(block, (jnp.zeros((w, 3, m, 2, n)), each, *sums), blocks)
    return Linearised(*found)


def sliders(memory: Array, lead: int) -> Array:
    """(..., m, 2, n) of a memory (..., 2, n) of one slider a point or (..., m, 2, n), after so many leading axes."""
    return memory.reshape(*memory.shape[:lead], -1, *memory.shape[-2:])


def _step(law: Law, dt: Scalar, u: Array, v: Array, state: State, held: State, memory: Array) -> _Steps:
    """Derivatives of a step to u (n, 3) m at the rate v (n, 3) m/s.

    Args:
        state: that it begins with but for the memory. held: its tangents, see `_held`.
    """
    moves = _ways(law, u.shape[0])
    along = jax.tree_util.tree_map(lambda *both: jnp.concatenate(both), blank(state, len(moves[0])), held)
    du, dv = (jnp.concatenate([of, jnp.zeros_like(of)]) for of in moves)
    way, pushed = jax.vmap(
        lambda *moved: jax.jvp(lambda u, v, s: law.way(u, v, dt, s), (u, v, state), moved), out_axes=(None, 0)
    )(du, dv, along)

    def moved(tangent: Any) -> tuple[Array, Array]:
        return jax.jvp(lambda way: law.drag(way, memory), (way,), (tangent,))[1]

    def remembered(tangent: Array) -> tuple[Array, Array]:
        return jax.jvp(lambda memory: law.drag(way, memory), (memory,), (tangent,))[1]

    (force, after), (by_memory, A) = jax.vmap(moved)(pushed), jax.vmap(remembered)(directions(memory))
    A, after = sliders(A, 1), sliders(after, 1)
    G = by_memory.swapaxes(0, 1)[:, None] if A.shape[1] == 1 else _by_slider(law, way, memory)
    B, D = (x.reshape(-1, 3, *x.shape[1:]) for x in (after, force))
    return _Steps(A, B, D, G)


def _by_slider(law: Law, way: Any, memory: Array) -> Array:
    """(3, m, 2, n) derivatives of the force with respect to the memory of each slider."""
    _, pull = jax.vjp(lambda memory: law.drag(way, memory)[0], memory)
    unit = jnp.broadcast_to(jnp.eye(3)[:, :, None], (3, 3, memory.shape[-1]))
    return sliders(jax.vmap(pull)(unit)[0], 1)


def _held(law: Law, u: Array, v: Array, dt: Scalar) -> State:
    """Tangents, along `_ways`, of the state at a place but for the memory."""
    rest = law.init(len(u))

    def push(du: Array, dv: Array) -> State:
        return jax.jvp(lambda u, v: stepped(law, u, v, dt, rest)[1], (u, v), (du, dv))[1]

    after = jax.vmap(push)(*_ways(law, len(u)))
    return jax.vmap(law.recalled, (0, None))(after, jnp.zeros_like(law.memory(u, rest)))


def _ways(law: Law, n: int) -> tuple[Array, Array]:
    """Moves (3, n, 3) along n, t1 and t2, all points alike, and of the rate; (6, n, 3) where the law reads this: of
    the place first."""
    ways = jnp.broadcast_to(jnp.eye(3)[:, None], (3, n, 3))
    zero = jnp.zeros_like(ways)
    return (jnp.concatenate([ways, zero]), jnp.concatenate([zero, ways])) if law.viscous else (ways, zero)


def _recursion(
    carried: tuple[Array, Array], row: tuple[_Steps, Array]
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Tangents (w, 3, m, 2, n) of the memory and (2, m, 2, n) those of the memory at the beginning, a sample on; and as
    they were."""
    (x, begun), (step, moves) = carried, row
    turned = [step.A[0] * y[..., :1, :] + step.A[1] * y[..., 1:, :] for y in (x, begun)]
    way = sum(move[:, None, None, None, None] * B for move, B in zip(moves, step.B, strict=True))
    return (turned[0] + way, turned[1]), carried


def _forces(steps: _Steps, moves: Array, x: Array, begun: Array) -> tuple[Array, Array]:
    """Tangents (s, w, 3, 3, n) of the force, and (s, 2, 3, m, n) those under the memory at the beginning."""
    force = jnp.sum(steps.G[:, None, None] * x[:, :, :, None], axis=(4, 5))
    for k in range(moves.shape[1]):
        force += moves[:, k, :, None, None, None] * steps.D[:, k, None]
    return force, jnp.sum(steps.G[:, None] * begun[:, :, None], axis=4)

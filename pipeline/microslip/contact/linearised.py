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

from .cycle import blank, stepped, units
from .law import Array, Law, State

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
        A: (s, 2, m, 2, n). B, C: (s, 3, m, 2, n). D, E: (s, 3, 3, n), of the force's directions last but one. G:
            (s, 3, m, 2, n).
    """

    A: Array
    B: Array
    C: Array
    D: Array
    E: Array
    G: Array


def linearised(
    law: Law, path: Array, rate: Array, dt: Array | float, start: State, whole: Array, signals: Array, weights: Array
) -> Linearised:  # fmt: skip
    """The cycle that begins with a state, of a law whose sliders can be solved for (`Law.recalled`).

    Args:
        path: (s, n, 3) m. rate: (s, n, 3) m/s over the steps. start: of rest, or after such a cycle; then ``whole``
            asks for the tangents of the force as well. signals: (s, w) by which all points move alike, periodic.
            weights: (h, s).
    """
    (samples, w), h = signals.shape, len(weights)
    memory = sliders(law.memory(path[-1], start), 0)
    m, n = memory.shape[0], memory.shape[2]
    size = max(k for k in range(1, samples + 1) if samples % k == 0 and k * m * n <= max(BLOCK, m * n))

    def block(carried: tuple, rows: tuple[Array, ...]) -> tuple[tuple, None]:
        state, held, x, by_memory, *sums = carried
        u, v, signal, before, weight = rows
        after, states = jax.lax.scan(lambda one, row: (stepped(law, *row, dt, one)[1], one), state, (u, v))
        steps, held = _steps(law, u, v, dt, states, held)
        (x, by_memory), each = jax.lax.scan(_recursion, (x, by_memory), (steps, signal, before))

        def more() -> list[Array]:
            forces = _forces(steps, signal, before, *each)
            return [a + jnp.einsum("sh,s...->h...", weight, b) for a, b in zip(sums, forces, strict=True)]

        sums = jax.lax.cond(whole, more, lambda: sums)
        return (after, held, x, by_memory, *sums), None

    held = jax.tree_util.tree_map(lambda leaf: leaf * whole, _held(law, path[-1], rate[-1], dt, start))
    each = jnp.broadcast_to(jnp.eye(2)[:, None, :, None], (2, m, 2, n))
    sums = jnp.zeros((h, w, 3, 3, n)), jnp.zeros((h, 2, 3, m, n))
    rows = (path, rate, signals, jnp.roll(signals, 1, axis=0), weights.T)
    blocks = tuple(row.reshape(samples // size, size, *row.shape[1:]) for row in rows)
    _, _, *found = jax.lax.scan(block, (start, held, jnp.zeros((w, 3, m, 2, n)), each, *sums), blocks)[0]
    return Linearised(*found)


def sliders(memory: Array, lead: int) -> Array:
    """(..., m, 2, n) of a memory (..., 2, n) of one slider a point or (..., m, 2, n), after so many leading axes."""
    return memory.reshape(*memory.shape[:lead], -1, *memory.shape[-2:])


def _steps(law: Law, u: Array, v: Array, dt: Array | float, states: State, held: State) -> tuple[_Steps, State]:
    """Derivatives of steps to (s, n, 3) from states, and what goes on: `_held` of the last step.

    Args:
        held: of the step before.
    """
    ways = _ways(u.shape[1])
    after = jax.vmap(lambda u, v, state: _held(law, u, v, dt, state))(u, v, states)
    before = jax.tree_util.tree_map(lambda one, many: jnp.concatenate([one[None], many[:-1]]), held, after)

    def step(u: Array, v: Array, state: State, held: State) -> _Steps:
        memory = law.memory(u, state)
        along = (blank(state, 3), held, units(law, state, memory))
        tangents = jax.tree_util.tree_map(lambda *leaves: jnp.concatenate(leaves), *along)
        still = jnp.zeros_like(ways[:2])
        du, dv = jnp.concatenate([ways, 0 * ways, still]), jnp.concatenate([ways / dt, -ways / dt, still])
        force, ended = _pushed(law, u, v, dt, state, du, dv, tangents)
        remembered, force = sliders(jax.vmap(law.memory, (None, 0))(u, ended), 1), force.swapaxes(1, 2)
        one = remembered.shape[1] == 1
        G = force[6:].swapaxes(0, 1)[:, None] if one else _by_slider(law, u, v, dt, state, memory)
        return _Steps(remembered[6:], remembered[:3], remembered[3:6], force[:3], force[3:6], G)

    return jax.vmap(step)(u, v, states, before), jax.tree_util.tree_map(lambda leaf: leaf[-1], after)


def _by_slider(law: Law, u: Array, v: Array, dt: Array | float, state: State, memory: Array) -> Array:
    """(3, m, 2, n) derivatives of the force with respect to the memory of each slider."""
    _, pull = jax.vjp(lambda x: stepped(law, u, v, dt, law.recalled(state, x))[0], memory)
    return sliders(jax.vmap(pull)(_ways(u.shape[0]))[0], 1)


def _pushed(
    law: Law, u: Array, v: Array, dt: Array | float, state: State, du: Array, dv: Array, along: State
) -> tuple[Array, State]:  # fmt: skip
    """Tangents of force and state at the end of a step along several changes: (p, n, 3) m, m/s, and of the state."""

    def push(du: Array, dv: Array, along: State) -> tuple[Array, State]:
        return jax.jvp(lambda u, v, s: stepped(law, u, v, dt, s), (u, v, state), (du, dv, along))[1]

    return jax.vmap(push)(du, dv, along)


def _held(law: Law, u: Array, v: Array, dt: Array | float, state: State) -> State:
    """Tangents of the state at the end of a step along where that is, but for the memory."""
    ways = _ways(len(u))
    _, after = _pushed(law, u, v, dt, state, ways, ways / dt, blank(state, 3))
    return jax.vmap(law.recalled, (0, None))(after, jnp.zeros_like(law.memory(u, state)))


def _ways(n: int) -> Array:
    """(3, n, 3) along n, t1 and t2, all points alike."""
    return jnp.broadcast_to(jnp.eye(3)[:, None], (3, n, 3))


def _recursion(
    carried: tuple[Array, Array], row: tuple[_Steps, Array, Array]
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Tangents (w, 3, m, 2, n) of the memory and (2, m, 2, n) those of the memory at the beginning, a sample on; and as
    they were."""
    (x, begun), (step, signal, before) = carried, row
    turned = [step.A[0] * y[..., :1, :] + step.A[1] * y[..., 1:, :] for y in (x, begun)]
    way = signal[:, None, None, None, None] * step.B + before[:, None, None, None, None] * step.C
    return (turned[0] + way, turned[1]), carried


def _forces(steps: _Steps, signal: Array, before: Array, x: Array, begun: Array) -> tuple[Array, Array]:
    """Tangents (s, w, 3, 3, n) of the force, and (s, 2, 3, m, n) those under the memory at the beginning."""
    force = jnp.sum(steps.G[:, None, None] * x[:, :, :, None], axis=(4, 5))
    force += signal[:, :, None, None, None] * steps.D[:, None]
    force += before[:, :, None, None, None] * steps.E[:, None]
    return force, jnp.sum(steps.G[:, None] * begun[:, :, None], axis=4)

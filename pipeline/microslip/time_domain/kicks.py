"""A step of second order: half a kick by the contacts, flow, and half a kick by what they say where the bodies came to.

It takes any law: with memory, set-valued, on bodies that yield beside their modes.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from .bodies import Bodies, MotionState, Options, by_force, exponent
from .contacts import Held, answer, force_at, rigid_answer, slowed, times
from .flow import flown, worked


def step(options: Options, B: Bodies, n: Any, now: MotionState) -> MotionState:
    """n steps, of which more than one only where no contact is met in them."""
    p = B.omega2.shape[1]
    dt = B.flow.length[0] * n
    touched, pushed = 0.5 * dt * now.push, 0.5 * dt * times(B.loads, now.o)
    v = now.y[:, p:] + touched + pushed
    y, o, (given, taken) = _flown(options, B, n, now.y.at[:, p:].set(v), now.o)
    q, v_free = y[:, :p], y[:, p:]
    o, moves = _driven(options, B, now, o, dt)
    held, push = answered(options, B, q, v_free, touched + pushed, o, moves, dt, now.held)
    work = jnp.zeros(())
    after = 0.5 * dt * push, 0.5 * dt * times(B.loads, o)
    for contacts, loads, mean in ((touched, pushed, 0.5 * (now.y[:, p:] + v)), (*after, v_free + 0.5 * sum(after))):
        work -= jnp.sum(contacts * mean)
        given += jnp.sum(loads * mean)
    y = y.at[:, p:].add(sum(after))
    energy = now.energy + jnp.stack([given, taken, work, held.lost, jnp.zeros(()), held.given])
    energy = energy.at[4].set(held.stored)
    return now._replace(
        y=y, o=o, time=now.time + dt, push=push, held=held, energy=energy, worst=jnp.maximum(now.worst, held.missed),
        missed=now.missed + 0.5 * dt * jnp.sqrt(jnp.sum((push - now.push) ** 2)),
    )  # fmt: skip


def _flown(options: Options, B: Bodies, n: Any, y: Any, o: Any) -> tuple[Any, Any, Any]:
    """(b, 2 p) and o after n steps, done by powers of two, and (2,) J given by loads and taken by dampers in them."""

    def on(carried: tuple) -> tuple:
        n, y, o, works = carried
        k = exponent(n)
        y, more = worked(B.flow.stack[k], y, o)
        return n - (1 << k), y, times(B.flow.turn[k], o), works + more.sum(axis=1)

    first = n, y, o, jnp.zeros(2)
    return (jax.lax.while_loop(lambda c: c[0] > 0, on, first) if options.leaps else on(first))[1:]


def _driven(options: Options, B: Bodies, now: MotionState, o: Any, dt: Any) -> tuple[Any, Any]:
    """(n,) o after a step, and o' there, where o turns or, in a run-up, is driven."""
    if options.ramp is None:
        return o, times(B.rate, o)
    ramp, harmonics = options.ramp
    o = ramp.driving(now.time + dt, harmonics, jnp)
    return o, (o - now.o) / dt


def answered(
    options: Options,
    B: Bodies,
    q: Any,
    v_free: Any,
    half: Any,
    o: Any,
    moves: Any,
    dt: Any,
    held: Held,
    share: float = 1.0,
) -> tuple[Held, Any]:
    """What contacts hold where the bodies are, and (b, p) their accelerations of the modes.

    Args:
        v_free: (b, p) velocities without the kick at the step's end. half: (b, p) that kick, as far as it is known.
            moves: (n,) o'. share: of a whole kick that is still to come before the bodies flow on.
    """
    free = times(B.D, q.reshape(-1)) + times(B.D_o, o)
    given = times(B.D_o, moves)
    v = times(B.D, (v_free + half).reshape(-1)) + given
    unbraked = jnp.zeros(())
    if B.braking is not None and share == 1.0:
        before = times(B.D, v_free.reshape(-1)) + given
        v, unbraked = slowed(B.groups, B.braking, B.F_0, free, before, dt, held)
    if B.meets is None:
        held = answer(B.groups, B.yielding, free, v, dt, held, options.accounts)
        return held._replace(missed=held.missed + dt * unbraked), by_force(B, held.force)
    force, *others = force_at(B.groups, free, v, dt, held.states)
    ahead = free
    if B.yielding is None:
        v = v_free + share * dt * (by_force(B, force) + times(B.loads, o))
        then = flown(B.flow.stack[0][: q.shape[1]], jnp.concatenate([q, v], axis=1), o)  # after another step
        ahead = times(B.D, then.T.reshape(-1)) + times(B.D_o, times(B.flow.turn[0], o))
    else:
        free = free + times(B.yielding.R, B.F_0)
    points = B.meets if B.yielding is not None else B.meets._replace(A=share * B.meets.A, r=B.meets.r / share)
    owed = held.owed
    held = rigid_answer(B.groups, points, B.yielding, free, ahead, dt, held, tuple(others), options.accounts)
    push = by_force(B, held.force)
    if B.yielding is None and options.accounts:
        whole, rigid = push + times(B.loads, o), 0.5 * dt * (held.force - force)
        now, then = (times(B.D, (v_free + part * dt * whole).reshape(-1)) + given for part in (0.25, share - 0.25))
        held = held._replace(lost=held.lost + owed + jnp.sum(rigid * now), owed=jnp.sum(rigid * then))
    return held, push

"""The compiled loop: steps from sample to sample, leaps where nothing touches, and events.

Where nothing touches, the gap is at least g, and no point comes nearer faster than V by the energy of the motion about
the steady one, nor does its velocity change faster than A: leaps of g / V, or of t with closing t + A t^2 / 2 = g, are
exact and miss no impact, however fast the bodies ring (gaps are convex in the way of a point).
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from ..programs import inner, program
from . import fourth, kicks
from .bodies import Bodies, Hardest, Listed, MotionState, Options, Snapshot, exponent
from .contacts import Held, moved, parts, times, untouched

LEAST = 4
"""Shortest steps that are leapt over at once; nearer to a contact they are gone one by one."""

DIGITS = 5
"""Of a leap, which is flown by powers of two: a few more bring it no nearer, as what it is reckoned by is a bound."""

ROUNDING = 1e-6
"""Share of a leap that is left out, so that rounding does not bring it into contact."""


@partial(inner, static_argnums=0)
def begun(options: Options, B: Bodies, y: Any, o: Any, held: Held | None) -> MotionState:
    """At time 0, bodies at y (b, 2 p), the contacts there from what they held, or never touched before."""
    q, v = jnp.split(y, 2, axis=1)
    dt, moves = B.flow.length[0], times(B.rate, o)
    before = held or untouched(B.groups)
    held, push = kicks.answered(options, B, q, v, 0 * v, o, moves, dt, before, 0.5)
    zero, none = jnp.zeros(()), jnp.zeros((4, sum(len(g.G) for g in B.groups)))
    energy = jnp.zeros(6).at[4].set(held.stored)
    now = MotionState(y, o, zero, push, held, energy, held.missed, none.astype(bool), none, (), jnp.zeros(2, int), zero)
    return typed(fourth.begun(B, now) if options.halvings else now)


def typed(traced: Any) -> Any:
    """With types of their own, which plain numbers in a law's state do not have: loops give back what they are given,
    or their step is traced and their program compiled twice."""
    return jax.tree_util.tree_map(lambda x: jnp.asarray(x, x.dtype), traced)


@partial(program, static_argnums=(0, 1))
def run(
    options: Options,
    events: int,
    B: Bodies,
    now: MotionState,
    each: Any,
    s: Any,
    rows: Any,
    steps: Any,
) -> tuple[MotionState, Listed, Snapshot, Any, Hardest]:
    """Rows of so many steps each, of which each (room,) is a sample, the first again after the last of s; as many as
    are asked for, or until numbers are infinite.

    Args:
        steps: done so far, all told. events: that are listed.

    Returns:
        Where the motion is; the events; the last s samples, row i at i modulo s of (room, ...); how many rows there
        were; the row in which steps missed most.
    """
    p = B.omega2.shape[1]
    step = partial(one_step, options, B)

    def on(carried: tuple) -> tuple:
        left, now, listed = carried
        left, now = jax.lax.while_loop(lambda c: (c[0] > 0) & ~c[1].met.any(), lambda c: step(*c), (left, now))
        return left, now._replace(met=jnp.zeros_like(now.met)), _noted(now, listed)

    def look(now: MotionState) -> Snapshot:
        q, v = now.y[:, :p], now.y[:, p:]
        bodies = 0.5 * jnp.sum(v**2 + B.omega2 * q**2)
        return Snapshot(q.reshape(-1), v.reshape(-1), now.held.d, now.held.force, now.energy, bodies, now.time)

    def row(carried: tuple) -> tuple:
        i, steps, _, now, listed, seen, hardest = carried
        before, count = now, each[i % s]
        _, now, listed = jax.lax.while_loop(lambda c: c[0] > 0, on, (count, now, listed))
        steps = steps + count
        now = now._replace(o=oscillators(options, B, steps * B.flow.length[0]))
        if options.halvings:
            now = now._replace(held=fourth.at_sample(B, now))
        sample = look(now)
        kept = jax.tree_util.tree_map(lambda all_of, one: all_of.at[i % s].set(one), seen, sample)
        rise = now.missed - before.missed
        hardest = Hardest(*(jnp.where(rise > hardest[0], *x) for x in zip((rise, before.time), hardest, strict=True)))
        return i + 1, steps, jnp.isfinite(sample.mechanical), now, listed, kept, hardest

    listed = Listed(jnp.zeros((), int), jnp.zeros((events, 3)))
    seen = jax.tree_util.tree_map(lambda one: jnp.zeros((len(each), *one.shape)), look(now))
    first = jnp.zeros((), int), steps, jnp.ones((), bool), now, listed, seen, Hardest(-jnp.ones(()), now.time)
    i, _, _, now, listed, seen, hardest = jax.lax.while_loop(lambda c: (c[0] < rows) & c[2], row, first)
    return now, listed, seen, i, hardest


def oscillators(options: Options, B: Bodies, time: Any) -> Any:
    """(n,) o at a time, so that the rounding of many turns does not add up."""
    if options.ramp is not None:
        return options.ramp[0].driving(time, options.ramp[1], jnp)
    angle = time * B.harmonics
    return jnp.concatenate([jnp.ones(1), jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=1).reshape(-1)])


def one_step(options: Options, B: Bodies, left: Any, now: MotionState) -> tuple[Any, MotionState]:
    """A step, or a leap over as many as no contact is met in, of those that are left; and what is left then."""
    free = _free(B, now) if options.leaps else jnp.zeros((), int)
    far = jnp.clip(free, 1, left)
    if not options.halvings:
        return left - far, _told(B, far, now, kicks.step(options, B, far, now))
    near = jnp.minimum(now.level[0], exponent(left))

    def leap(now: MotionState) -> tuple[Any, MotionState]:
        return far, _told(B, far, now, fourth.leapt(kicks.step(options, B, far, now)))

    def step(now: MotionState) -> tuple[Any, MotionState]:
        done, after = fourth.step(options, B, near, now)
        return jnp.where(done, 1 << near, 0), _told(B, 1 << near, now, after, done)

    done, after = jax.lax.cond(free >= LEAST, leap, step, now) if options.leaps else step(now)
    return left - done, after


def _free(B: Bodies, now: MotionState) -> Any:
    """Steps in which no point of contact can close its gap: an even number, of `DIGITS` binary digits."""
    p = B.omega2.shape[1]
    z = now.y - times(B.steady, now.o)
    swings = jnp.sqrt(jnp.sum(z[:, p:] ** 2 + B.omega2 * z[:, :p] ** 2))
    fastest, bent = (swings * by_swing + steady for by_swing, steady in (B.reach, B.bends))
    w = times(B.D, now.y[:, p:].reshape(-1)) + times(B.D_o, times(B.rate, now.o))
    begin, free = 0, []
    for g, u, rate in zip(B.groups, now.held.places, parts(B.groups, w), strict=True):
        points = slice(begin, begin + len(u))
        free.append(_unmet(g.law.overlap, u, moved(g, rate), fastest[points], bent[points]))
        begin += len(u)
    most = jnp.minimum(jnp.min(jnp.concatenate(free)) / B.flow.length[0], 2.0 ** (len(B.flow.length) - 1))
    last = jnp.maximum(exponent(jnp.maximum(most, 1.0)) - (DIGITS - 1), 1)
    return (most.astype(int) >> last) << last


def _unmet(overlap: Any, u: Any, w: Any, fastest: Any, bent: Any) -> Any:
    """(n,) s in which points at u (n, 3) with velocities w meet nothing, if they move no faster and turn no more; 0
    where they touch, though they part."""
    deep, closing = jax.jvp(overlap, (u,), (w,))
    gap, a = jnp.maximum(-deep, 0.0), bent + 1e-300
    root = jnp.sqrt(closing**2 + 2 * a * gap)
    ahead = (1 - ROUNDING) * jnp.where(closing > 0, 2 * gap / (closing + root + 1e-300), (root - closing) / a)
    past = overlap(u + ahead[:, None] * w) + 0.5 * a * ahead**2
    sure = gap / (fastest + 1e-300)
    return jnp.where((past <= 0) & (deep <= 0), jnp.maximum(ahead, sure), sure)


def _told(B: Bodies, n: Any, now: MotionState, after: MotionState, done: Any = True) -> MotionState:
    """With the events of n short steps, if they were done."""
    met, at = _met(now, after.held, B.flow.length[0] * n)
    return typed(after._replace(met=met & done, at=at))


def _met(before: MotionState, held: Held, dt: Any) -> tuple[Any, Any]:
    """(4, contacts) events of a step and when: where the deepest point of a contact passes zero; where sliding begins
    and ends in it."""
    a, b = before.held.approach, held.approach
    met = (a <= 0) & (b > 0), (a > 0) & (b <= 0), held.slips & ~before.held.slips, before.held.slips & ~held.slips
    share = jnp.where((a > 0) != (b > 0), -a / jnp.where(b == a, 1.0, b - a), 0.5)
    half = jnp.full_like(a, 0.5)
    return jnp.stack(met), before.time + dt * jnp.stack([share, share, half, half])


def _noted(now: MotionState, listed: Listed) -> Listed:
    kind, contact = jnp.meshgrid(jnp.arange(4.0), jnp.arange(1.0 * now.met.shape[1]), indexing="ij")
    place = listed.count + jnp.cumsum(now.met.reshape(-1)).reshape(now.met.shape) - 1
    rows = jnp.stack([now.at, contact, kind], axis=-1)
    rows = listed.rows.at[jnp.where(now.met, place, len(listed.rows))].set(rows, mode="drop")
    return Listed(listed.count + jnp.sum(now.met), rows)

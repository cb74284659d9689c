"""The compiled loop: steps from sample to sample, leaps where nothing touches, and events.

Where nothing touches, the gap is at least g, and no point comes nearer faster than V by the energy of the motion about
the steady one: a leap of g / V is exact and misses no impact, however fast the bodies ring.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from . import fourth, kicks
from .bodies import Bodies, Listed, Now, Options, Seen
from .contacts import Group, Held, times


@partial(jax.jit, static_argnums=0)
def begun(options: Options, groups: tuple[Group, ...], B: Bodies, now: Now) -> Now:
    """The contacts where the bodies are."""
    q, v = jnp.split(now.y, 2, axis=1)
    dt, moves = B.flow.length[0], times(B.rate, now.o)
    held, push = kicks.answered(options, groups, B, q, v, 0 * v, now.o, moves, dt, now.held, 0.5)
    now = now._replace(push=push, held=held, energy=now.energy.at[4].set(held.stored), worst=held.missed)
    return fourth.begun(groups, B, now) if options.halvings else now


@partial(jax.jit, static_argnums=0)
def run(
    options: Options, groups: tuple[Group, ...], B: Bodies, now: Now, listed: Listed, oscillators: Any, steps: Any
) -> tuple[Now, Listed, Seen]:
    """Samples after (s,) steps each; oscillators: (s, n) o there, so that rounding does not add up."""
    p = B.omega2.shape[1]
    step = partial(one_step, options, groups, B)

    def on(carried: tuple) -> tuple:
        left, now, listed = carried
        left, now = jax.lax.while_loop(lambda c: (c[0] > 0) & ~c[1].met.any(), lambda c: step(*c), (left, now))
        return left, now._replace(met=jnp.zeros_like(now.met)), _noted(now, listed)

    def sample(carried: tuple, one: tuple) -> tuple[tuple, Seen]:
        o, count = one
        _, now, listed = jax.lax.while_loop(lambda c: c[0] > 0, on, (count, *carried))
        now = now._replace(o=o)
        q, v = now.y[:, :p], now.y[:, p:]
        bodies = 0.5 * jnp.sum(v**2 + B.omega2 * q**2)
        seen = Seen(q.reshape(-1), v.reshape(-1), now.held.d, now.held.force, now.energy, bodies, now.time)
        return (now, listed), seen

    (now, listed), seen = jax.lax.scan(sample, (now, listed), (oscillators, steps))
    return now, listed, seen


def one_step(options: Options, groups: tuple[Group, ...], B: Bodies, left: Any, now: Now) -> tuple[Any, Now]:
    """A step, or a leap over as many as no contact is met in, of those that are left; and what is left then."""
    k = _leap(groups, B, left, now) if options.leaps else 0
    if not options.halvings:
        after = kicks.step(options, groups, B, k, now)
        met, at = _met(now, after.held, B.flow.length[k])
        return left - 2**k, after._replace(met=met, at=at)
    k = jnp.maximum(k, jnp.minimum(now.level, jnp.floor(jnp.log2(left) + 1e-12).astype(int)))
    done, after = fourth.step(options, groups, B, k, now)
    met, at = _met(now, after.held, B.flow.length[k])
    return left - jnp.where(done, 2**k, 0), after._replace(met=met & done, at=at)


def _leap(groups: tuple[Group, ...], B: Bodies, left: Any, now: Now) -> Any:
    """k of the longest leap of 2^k steps, of those that are left, that no point of contact can close its gap in."""
    p = B.omega2.shape[1]
    z = now.y - times(B.steady, now.o)
    swings = jnp.sqrt(jnp.sum(z[:, p:] ** 2 + B.omega2 * z[:, :p] ** 2))
    gaps = -jnp.concatenate([g.law.overlap(u) for g, u in zip(groups, now.held.places, strict=True)])
    steps = jnp.min(gaps / (B.reach * swings + B.drift + 1e-300)) / B.flow.length[0]
    longest = jnp.minimum(jnp.maximum(steps, 1.0), left)
    k = jnp.floor(jnp.log2(longest) + 1e-12).astype(int)
    return jnp.clip(k, 0, len(B.flow.length) - 1)


def _met(before: Now, held: Held, dt: Any) -> tuple[Any, Any]:
    """(4, contacts) events of a step and when: where the deepest point of a contact passes zero; where sliding begins
    and ends in it."""
    a, b = before.held.approach, held.approach
    met = (a <= 0) & (b > 0), (a > 0) & (b <= 0), held.slips & ~before.held.slips, before.held.slips & ~held.slips
    share = jnp.where((a > 0) != (b > 0), -a / jnp.where(b == a, 1.0, b - a), 0.5)
    half = jnp.full_like(a, 0.5)
    return jnp.stack(met), before.time + dt * jnp.stack([share, share, half, half])


def _noted(now: Now, listed: Listed) -> Listed:
    kind, contact = jnp.meshgrid(jnp.arange(4.0), jnp.arange(1.0 * now.met.shape[1]), indexing="ij")
    place = listed.count + jnp.cumsum(now.met.reshape(-1)).reshape(now.met.shape) - 1
    rows = jnp.stack([now.at, contact, kind], axis=-1)
    rows = listed.rows.at[jnp.where(now.met, place, len(listed.rows))].set(rows, mode="drop")
    return Listed(listed.count + jnp.sum(now.met), rows)

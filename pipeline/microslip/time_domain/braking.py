"""Friction that follows the velocity alone: solved for in every half kick, so that its slope sets no limit to the step.

The velocity after the kick is that before it, less what the friction at that velocity takes in it.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .contacts import ContactGroup, Held, force_at, joined, moved, parts

TURNS, NEWTON = 100, 8
"""Turns of `slowed` at most, and steps of Newton's method in each."""


class Braking(NamedTuple):
    """slowing: (c, c) m/s per N that half a kick changes the contacts' velocities by. most: (points,) of it that each
    point may count on, group by group."""

    slowing: Any
    most: tuple[Any, ...]


def slowed(
    groups: tuple[ContactGroup, ...], B: Braking, F_0: Any, d: Any, v: Any, dt: Any, held: Held
) -> tuple[Any, Any]:  # fmt: skip
    """(c,) velocities of contacts after half a kick, and what is missing, m/s.

    v: before that kick. Newton's method from what the last force leaves; where that does not do, from turns in which
    each point brakes by itself, as if all that yields were its own, from where the others leave it (forward and
    backward steps: P. L. Lions, B. Mercier, SIAM J. Numer. Anal. 16, 1979).
    """
    enough = 1e-10 * jnp.abs(v).max() + 1e-18

    def left(force: Any) -> Any:
        return v - B.slowing @ (force - F_0)

    def missing(at: Any) -> Any:
        return at - left(force_at(groups, d, at, dt, held.states)[0])

    def newton(carried: tuple) -> tuple:
        i, at, r = carried
        at = at - jnp.linalg.solve(jax.jacfwd(missing)(at), r)
        return i + 1, at, missing(at)

    def refined(at: Any) -> tuple:
        more = partial(_unsolved, NEWTON, enough)
        _, at, r = jax.lax.while_loop(more, newton, (0, at, missing(at)))
        return at, jnp.nan_to_num(jnp.abs(r).max(), nan=jnp.inf)

    def turn(carried: tuple) -> tuple:
        i, at, forces, _, _ = carried
        alone = zip(groups, forces, held.states, B.most, parts(groups, d), parts(groups, at), strict=True)
        after = tuple(_alone(g, f, state, y, place, rate, dt) for g, f, state, y, place, rate in alone)
        at = left(joined(groups, after))
        return i + 1, at, after, *refined(at)

    at = left(held.force)
    begin = (0, at, held.forces, *refined(at))
    *_, found, missed = jax.lax.while_loop(lambda c: (c[4] > enough) & (c[0] < TURNS), turn, begin)
    return found, missed


def _alone(g: ContactGroup, force: Any, state: Any, most: Any, place: Any, rate: Any, dt: Any) -> Any:
    """(c n, 3) forces of a group whose points brake by themselves from forces, at coordinates and velocities (c, k)."""
    u, w = moved(g, place + g.offset), moved(g, rate)
    by_law = g.law.step(u, w, dt, state)[0]
    if not g.law.brakes:
        return by_law
    trial = w.at[:, 1:].add(most[:, None] * force[:, 1:])
    held = (trial - g.law.slowed(u, trial, dt, state, most))[:, 1:] / jnp.where(most > 0, most, 1.0)[:, None]
    return jnp.concatenate([by_law[:, :1], held], axis=1)


def _unsolved(most: int, enough: Any, carried: tuple) -> Any:
    return (jnp.abs(carried[2]).max() > enough) & (carried[0] < most)

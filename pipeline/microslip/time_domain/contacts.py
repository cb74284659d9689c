"""What contacts answer to a motion in time: their laws' forces where they are, or where the bodies yield at once."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.law import Law, Step, norm
from ..contact.patch import Patch
from ..contact.set_valued import SetValued
from ..programs import seldom
from .ground import Moving
from .inclusion import Meets, over_waves, solve

CHORDS = 12
"""Iterations for contacts beside which the modes leave compliance out, with the slope of sticking contacts; modes leave
out little beside what a contact yields, so few are needed."""

ITERATIONS = 30
"""Of Newton's method, where they do not do."""

SLID = 1e-9
"""Share of a way beyond which a slider has slid and not only rounding."""

ROUNDING = 1e-14
"""Share of where points are, and of the path slid so far, that their difference in a step may be off by."""

SLIDES = 1e-9
"""Share of the largest way of points that is found by iteration, beyond which one slides."""

MEETS = 1e-9
"""Share of its way in the next step that a point may lack to the other side and touch it."""

FEW = 4096
"""Numbers of a matrix up to which a product is faster as a sum that is compiled together with what surrounds it."""


class ContactGroup(NamedTuple):
    """Equal contacts, whose coordinates stand one after the other. law: of all of their points, on its ground. G: (c,
    n, 3, k) of each. offset: (c, k) where they stand at d = 0."""

    law: Any
    G: Any
    offset: Any

    @property
    def over(self) -> Any:
        """Its law, without the ground."""
        return self.law.law if isinstance(self.law, Moving) else self.law

    @property
    def rigid(self) -> bool:
        """Whether its law is set-valued."""
        return isinstance(self.over, SetValued)


class Yielding(NamedTuple):
    """R: (c, c) m/N. share: (c, c), `Equations.yields`. F_0: (c,) N."""

    R: Any
    share: Any
    F_0: Any


class Held(NamedTuple):
    """What contacts hold.

    Attributes:
        d, force: (c,) of the coordinates; of steps of fourth order, at samples alone. states: of the laws, group by
            group; forces, places: (c n, 3) N and m of their points.
        approach: (contacts,) m of each contact's deepest point; where a law does not know it, whether it is pressed
            (1 or 0). slips: (contacts,) bool.
        lost, given, stored: J, lost in the last step, given by moving ground in it, and stored after it. missed: m, the
            largest residual of implicit contacts. owed: J, what set-valued laws take from masses in the second half of
            the kick.
    """

    d: Any
    force: Any
    states: tuple[Any, ...]
    forces: tuple[Any, ...]
    places: tuple[Any, ...]
    approach: Any
    slips: Any
    lost: Any
    given: Any
    stored: Any
    missed: Any
    owed: Any


def times(A: Any, x: Any) -> Any:
    """A x over the last axis."""
    return (A * x[..., None, :]).sum(axis=-1) if A.size <= FEW else jnp.einsum("...ij,...j->...i", A, x)


def gapes(patch: Patch) -> bool:
    """Whether its law knows where it opens."""
    return not bool(_unknown(patch.law, np.zeros((len(patch.points), 3))))


@seldom
def _unknown(law: Law, u: Any) -> Any:
    return jnp.isnan(law.overlap(u)).any()


def untouched(groups: tuple[ContactGroup, ...]) -> Held:
    """Contacts that were never loaded, at u = 0."""
    d = jnp.zeros(sum(g.offset.size for g in groups))
    counts = [int(g.G.shape[0] * g.G.shape[1]) for g in groups]
    states = tuple(g.law.init(n) for g, n in zip(groups, counts, strict=True))
    points = tuple(jnp.zeros((n, 3)) for n in counts)
    none, zero = jnp.zeros(sum(len(g.G) for g in groups)), jnp.zeros(())
    return Held(d, d, states, points, points, none, none.astype(bool), zero, zero, zero, zero, zero)


def parts(groups: tuple[ContactGroup, ...], d: Any) -> list[Any]:
    """(c, k) of each group."""
    each, begin = [], 0
    for g in groups:
        each.append(d[begin : begin + g.offset.size].reshape(g.offset.shape))
        begin += g.offset.size
    return each


def moved(g: ContactGroup, d: Any) -> Any:
    """(c n, 3) of the points, by coordinates (c, k)."""
    return (g.G * d[:, None, None, :]).sum(axis=-1).reshape(-1, 3)


def force_at(groups: tuple[ContactGroup, ...], d: Any, v: Any, dt: Any, states: tuple[Any, ...]) -> tuple:
    """Force (c,) at d with velocity v, states and points' forces of all groups."""
    after, points = [], []
    for g, state, at, rate in zip(groups, states, parts(groups, d), parts(groups, v), strict=True):
        u = moved(g, at + g.offset)
        f, s = (jnp.zeros_like(u), state) if g.rigid else g.law.step(u, moved(g, rate), dt, state)
        after.append(s)
        points.append(f)
    return joined(groups, points), tuple(after), tuple(points)


def joined(groups: tuple[ContactGroup, ...], points: Any) -> Any:
    """(c,) forces of the coordinates, by those (c n, 3) of the points of all groups."""
    each = zip(groups, points, strict=True)
    forces = [(g.G * f.reshape(*g.G.shape[:3], 1)).sum(axis=(1, 2)).reshape(-1) for g, f in each]
    return jnp.concatenate([jnp.zeros(0), *forces])


def slope_at(groups: tuple[ContactGroup, ...], d: Any, v: Any, dt: Any, states: tuple[Any, ...]) -> Any:
    """(c, c) derivative of the force, point by point."""
    blocks = list[Any]()
    for g, state, at, rate in zip(groups, states, parts(groups, d), parts(groups, v), strict=True):
        u, w = moved(g, at + g.offset), moved(g, rate)

        def along(direction: Any, g: ContactGroup = g, u: Any = u, w: Any = w, state: Any = state) -> Any:
            tangent = jnp.broadcast_to(direction, u.shape)
            return jax.jvp(lambda x: g.law.step(x, w, dt, state)[0], (u,), (tangent,))[1]

        S = jax.vmap(along)(jnp.eye(3)).reshape(3, *g.G.shape[:3])
        blocks += list(jnp.einsum("cnia,jcni,cnjb->cab", g.G, S, g.G))
    return jax.scipy.linalg.block_diag(jnp.zeros((0, 0)), *blocks)


def _placed(groups: tuple[ContactGroup, ...], bodies: Yielding, free: Any, v: Any, dt: Any, held: Held) -> tuple:
    """d (c,) of contacts that modes alone would have at `free`, where bodies yield at once; the residual, m; and what
    `force_at` says there. With the slope of sticking contacts first, with their own where that does not do."""
    enough = 1e-10 * jnp.abs(free).max() + 1e-17

    def missing(d: Any) -> tuple:
        there = force_at(groups, d, v, dt, held.states)
        return d, d - free + times(bodies.R, there[0] - bodies.F_0), there

    def wanted(most: int, carried: tuple) -> Any:
        i, (_, r, _) = carried
        return (jnp.abs(r).max() > enough) & (i < most)

    def chord(carried: tuple) -> tuple:
        i, (d, r, _) = carried
        return i + 1, missing(d - times(bodies.share, r))

    def newton(carried: tuple) -> tuple:
        i, (d, r, _) = carried
        J = jnp.eye(len(free)) + bodies.R @ slope_at(groups, d, v, dt, held.states)
        return i + 1, missing(d - jnp.linalg.solve(J, r))

    first = missing(free - times(bodies.R, held.force - bodies.F_0))
    _, chorded = jax.lax.while_loop(partial(wanted, CHORDS), chord, (0, first))
    _, (d, r, there) = jax.lax.while_loop(partial(wanted, ITERATIONS), newton, (0, chorded))
    return d, jnp.abs(r).max(), there


def answer(
    groups: tuple[ContactGroup, ...], bodies: Yielding | None, free: Any, v: Any, dt: Any, held: Held, accounts: bool
) -> Held:  # fmt: skip
    """What contacts hold after a step of dt to where modes alone have them, `free` (c,), with velocities v.

    Args:
        bodies: None: they yield by their modes only. accounts: whether energies are asked for.
    """
    if bodies is None:
        d, missed, (force, states, points) = free, jnp.zeros(()), force_at(groups, free, v, dt, held.states)
    else:
        d, missed, (force, states, points) = _placed(groups, bodies, free, v, dt, held)
    after = told(groups, placed(groups, d), dt, held, accounts, states, points)
    return after._replace(d=d, force=force, missed=missed)


def placed(groups: tuple[ContactGroup, ...], d: Any) -> tuple[Any, ...]:
    """(c n, 3) of the points of each group."""
    return tuple(moved(g, at + g.offset) for g, at in zip(groups, parts(groups, d), strict=True))


def told(
    groups: tuple[ContactGroup, ...],
    places: tuple[Any, ...],
    dt: Any,
    held: Held,
    accounts: bool,
    states: tuple[Any, ...],
    points: tuple[Any, ...],
    by_law: bool = True,
) -> Held:
    """What contacts hold, with events and energies, d and force as before; by_law: whether set-valued laws say what
    they lose."""
    approach, slips, lost, stored = [jnp.zeros(0)], [jnp.zeros(0, bool)], jnp.zeros(()), jnp.zeros(())
    given = jnp.zeros(())
    for i, (g, u) in enumerate(zip(groups, places, strict=True)):
        way = u - held.places[i]
        slip, before = g.law.slip(states[i]), g.law.slip(held.states[i])
        rounding = ROUNDING * (norm(u.T[1:]) + norm(slip.T))
        slid = norm((slip - before).T) > SLID * norm(way.T[1:]) + rounding
        deep = jnp.full(len(u), jnp.nan) if g.rigid else g.law.overlap(u)
        deep = jnp.where(jnp.isnan(deep), points[i][:, 0] > 0, deep)
        approach.append(jnp.max(deep.reshape(len(g.G), -1), axis=1))
        slips.append(jnp.any(slid.reshape(len(g.G), -1), axis=1))
        if accounts:
            step = Step(u, way, dt, held.forces[i], points[i], held.states[i], states[i])
            moves = jnp.sum(g.law.given(step))
            lost += jnp.sum(g.law.lost(step)) if by_law or not g.rigid else moves
            given += moves
            stored += jnp.sum(g.law.stored(u, states[i]))
    zero, events = jnp.zeros(()), (jnp.concatenate(approach), jnp.concatenate(slips))
    return Held(held.d, held.force, states, points, places, *events, lost, given, stored, zero, zero)


def rigid_answer(
    groups: tuple[ContactGroup, ...], meets: Meets, bodies: Yielding | None, free: Any, ahead: Any, dt: Any, held: Held,
    others: tuple, accounts: bool,
) -> Held:  # fmt: skip
    """What contacts hold, some of them set-valued, see `inclusion`. A point sticks where the coefficient at rest can
    hold it, and slides with that of its speed where it cannot.

    Args:
        meets: of the points of set-valued laws. bodies: None: masses meet, and a force moves the next step. free: (c,)
            of the coordinates without the forces of set-valued laws. ahead: (c,) after the next step without them; of
            masses. held: before the step. others: states and points' forces of all groups, zero of set-valued ones.
    """
    states, points = map(list, others)
    spots = [i for i, g in enumerate(groups) if g.rigid]
    back = meets.back if bodies is None else None
    asked = [_asked(groups, i, back, free, ahead, dt, held) for i in spots]
    ways, pressed, first, *slopes = (jnp.concatenate(x) for x in zip(*asked, strict=True))
    if any(isinstance(groups[i].law, Moving) and groups[i].law.wavy for i in spots):
        meets = over_waves(meets, *slopes)
    ends = np.cumsum([len(w) for w, *_ in asked])[:-1]

    def coefficients(speed: Any) -> Any:
        each = zip(spots, jnp.split(speed, ends), jnp.split(pressed, ends), strict=True)
        return jnp.concatenate([groups[i].over.friction.coefficient(x, jnp.nan_to_num(n)) for i, x, n in each])

    highest = coefficients(jnp.zeros(len(ways)))

    def further(before: tuple, _: Any) -> tuple[tuple, None]:
        """With the coefficient at rest first; then with that of its speed where a point slides by that."""
        f, _, _, slides = before
        f, w, missed = solve(meets, ways, lambda x: jnp.where(slides, coefficients(x / dt), highest), pressed, f)
        return (f, w, missed, slid(w, ways)), None

    if all(groups[i].over.friction.constant for i in spots):
        f, w, missed = solve(meets, ways, lambda _: highest, pressed, first)
    else:
        begin = first, ways, jnp.zeros(()), jnp.zeros(len(ways), bool)
        f, w, missed, _ = jax.lax.scan(further, begin, length=2)[0]
    slipped = jnp.where(slid(w, ways)[:, None], w[:, 1:], 0.0)
    for i, force, way in zip(spots, jnp.split(f, ends), jnp.split(slipped, ends), strict=True):
        law = groups[i].law
        if isinstance(law, Moving):
            points[i], states[i] = law.slid(force, way, _point(groups, i, free), dt, held.states[i])
        else:
            points[i], states[i] = force, held.states[i] + way.T
    force = joined(groups, points)
    d = free if bodies is None else free - times(bodies.R, force)
    by_law = bodies is not None
    after = told(groups, placed(groups, d), dt, held, accounts, tuple(states), tuple(points), by_law)
    return after._replace(d=d, force=force, missed=missed)


def slid(w: Any, free: Any) -> Any:
    """(p,) whether points slide, by their motions (p, 3), and those without forces."""
    return norm(w[:, 1:].T) > SLIDES * jnp.maximum(jnp.abs(w), jnp.abs(free))[:, 1:].max()


def _asked(groups: tuple[ContactGroup, ...], i: int, back: Any, free: Any, ahead: Any, dt: Any, held: Held) -> tuple:
    """Of the points of a group: w_0, `pressed` and `first` of `inclusion.solve`, and (n, 2) the slopes of the ground
    under them that turn their way, and their force. back: see `Meets`; None of bodies that
    yield."""
    g, law, before, first = groups[i], groups[i].over, held.places[i], held.forces[i]
    u, then = (_point(groups, i, d) for d in (free, ahead))
    come, goes, deep, slopes = u - before, then - u, u[:, 0], (jnp.zeros((len(u), 2)),) * 2
    if isinstance(g.law, Moving):
        come, goes, deep, first, slopes = g.law.passed(before, u, then, first, dt, held.states[i])
    pressed = jnp.full(len(u), jnp.nan) if law.normal is None else law.normal.force(deep)
    gap = jnp.broadcast_to(law.gap, len(u))
    if back is None:
        return come.at[:, 0].set(deep - gap), pressed, first, *slopes
    along = goes[:, 0] + law.restitution * come[:, 0]
    if law.normal is None:  # but for rounding, which would open what rests
        out = back * jnp.maximum(deep - gap - jnp.abs(goes[:, 0]), 0.0)  # so far that rounding does not open it
        out = jnp.where(come[:, 0] > out, 0.0, out)  # no part of an impact
        along = jnp.where(deep + MEETS * jnp.abs(goes[:, 0]) >= gap, along + out, -jnp.inf)
    return goes.at[:, 0].set(along), pressed, first, *slopes


def _point(groups: tuple[ContactGroup, ...], i: int, d: Any) -> Any:
    """(n, 3) m of the points of a group."""
    return moved(groups[i], parts(groups, d)[i] + groups[i].offset)


# friction that follows the velocity alone: solved for in every half kick, so that its slope sets no limit to the step;
# the velocity after the kick is that before it, less what the friction at that velocity takes in it

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

    def unsolved(carried: tuple) -> Any:
        return (jnp.abs(carried[2]).max() > enough) & (carried[0] < NEWTON)

    def refined(at: Any) -> tuple:
        _, at, r = jax.lax.while_loop(unsolved, newton, (0, at, missing(at)))
        return at, jnp.nan_to_num(jnp.abs(r).max(), nan=jnp.inf)

    def turn(carried: tuple) -> tuple:
        i, at, forces, _, _ = carried
        alone = zip(groups, forces, held.states, B.most, parts(groups, d), parts(groups, at), strict=True)
        after = tuple(_alone(g, f, state, y, place, rate, dt) for g, f, state, y, place, rate in alone)
        at = left(joined(groups, after))
        return i + 1, at, after, *refined(at)

    at = left(held.force)
    begin = (0, at, held.forces, *refined(at))
    *_, velocity, missed = jax.lax.while_loop(lambda c: (c[4] > enough) & (c[0] < TURNS), turn, begin)
    return velocity, missed


def _alone(g: ContactGroup, force: Any, state: Any, most: Any, place: Any, rate: Any, dt: Any) -> Any:
    """(c n, 3) forces of a group whose points brake by themselves from forces, at coordinates and velocities (c, k)."""
    u, w = moved(g, place + g.offset), moved(g, rate)
    by_law = g.law.step(u, w, dt, state)[0]
    if not g.law.brakes:
        return by_law
    trial = w.at[:, 1:].add(most[:, None] * force[:, 1:])
    braked = (trial - g.law.slowed(u, trial, dt, state, most))[:, 1:] / jnp.where(most > 0, most, 1.0)[:, None]
    return jnp.concatenate([by_law[:, :1], braked], axis=1)

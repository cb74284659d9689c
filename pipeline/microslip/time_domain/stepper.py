"""The compiled loop: exact flow, contact force, kick; leaps where nothing touches.

A step of tau: the bodies flow for tau as if nothing touched (`flow`), the contacts say their force F at the place they
came to, and F - F_0 kicks the velocities by tau, half of it before what is read out and half after: symmetric, and of
second order. What the bodies have of energy is what loads gave, less what dampers and kicks took, to rounding.

Where nothing touches, the gap is at least g, and no point comes nearer faster than V by the energy of the motion about
the steady one: a leap of g / V is exact and misses no impact, however fast the bodies ring.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.law import Law, Step
from ..data import Array, UserError
from ..harmonic_balance.forces import repeated
from .equations import Equations
from .flow import Flow, blocks, flow
from .ground import moving

EVENTS = 8192
"""Events that one call of the loop keeps; of more, only their number is known."""

KINDS = ("closes", "opens", "slips", "sticks")

CHORDS = 12
"""Iterations for contacts beside which the modes leave compliance out, with the slope of sticking contacts; modes leave
out little beside what a contact yields, so few are needed."""

ITERATIONS = 30
"""Of Newton's method, where they do not do."""


class Group(NamedTuple):
    """Equal contacts. law: of all of their points. G: (n, 3, k) of one. index, offset: (c, k) coordinates and preload
    state of each."""

    law: Law
    G: Any
    index: Any
    offset: Any


class Bodies(NamedTuple):
    """What the loop reads of the equations, as jax arrays in blocks of modes.

    Attributes:
        flow. tau: s. D: (c, b, 2 p) and D_o (c, n): d of the contact coordinates. kick: (b, p, c) velocities per force.
            R, yields: (c, c), see `Equations`. F_0: (c,). omega2: (b, p). steady: (b, 2 p, n) of the periodic motion
            without contacts.
        slowing: (c, c) m/s per N that half a kick changes the contacts' velocities by; yielding: (points,) of it that
            each point may count on, group by group.
        reach: (points,) norm of their motion by modes, drift: (points,) m/s of the steady motion at most: see `_leap`.
    """

    flow: Flow
    tau: Any
    D: Any
    D_o: Any
    kick: Any
    R: Any
    yields: Any
    F_0: Any
    omega2: Any
    steady: Any
    reach: Any
    drift: Any
    slowing: Any = None
    yielding: Any = ()


class Now(NamedTuple):
    """Where the motion is.

    Attributes:
        y: (b, 2 p) modal displacements and velocities, the kick's second half taken. o: (n,). force: (c,) N and N m.
            states: of the laws, group by group; points, places: forces and displacements (c n, 3) of their points.
            approach: (contacts,) m of each contact's deepest point; where a law does not know it, whether it is pressed
            (1 or 0). slips: (contacts,) bool.
        energy: (6,) J since the start: given by loads, taken by dampers, done on contacts, lost there for good, what
            contacts store now, and what moving ground gave them. worst: m, the largest residual of an implicit contact.
        count: of events. events: (EVENTS, 3): time in s, contact, kind.
    """

    y: Any
    o: Any
    time: Any
    force: Any
    states: tuple[Any, ...]
    points: tuple[Any, ...]
    places: tuple[Any, ...]
    approach: Any
    slips: Any
    energy: Any
    worst: Any
    count: Any
    events: Any


class Seen(NamedTuple):
    """A sample: (m,) q and q', (c,) d and force, (6,) energies (see `Now`) and the bodies' own, J; time, s."""

    q: Any
    q_dot: Any
    d: Any
    force: Any
    energy: Any
    mechanical: Any
    time: Any


@dataclass(frozen=True)
class Options:
    """What the loop is compiled for. yields: whether modes leave out compliance. leaps: over flights without contact.
    accounts: of the energy that contacts store and lose. brakes: whether friction follows the velocity alone."""

    yields: bool
    leaps: bool
    accounts: bool
    brakes: bool = False


@dataclass(frozen=True, eq=False)
class Stepper:
    """The loop of an assembly's equations, with steps of tau (s).

    Attributes:
        equations. tau. accounts: whether what contacts store and lose is followed, which every law can tell or not.
    """

    equations: Equations
    tau: float
    accounts: bool = True

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        contacts = self.equations.contacts
        begins = np.cumsum([0, *(c.patch.count for c in contacts)])
        found = []
        for same in self.same:
            patch = contacts[same[0]].patch
            index = np.array([np.arange(begins[i], begins[i + 1]) for i in same])
            offset = np.array([contacts[i].offset for i in same])
            law = repeated(patch.law, len(patch.points), len(same))
            if (ground := contacts[same[0]].ground) is not None:
                law = moving(law, ground, np.tile(patch.points, (len(same), 1)))
            found.append(Group(law, jnp.asarray(patch.kinematics), jnp.asarray(index), jnp.asarray(offset)))
        return tuple(found)

    @cached_property
    def same(self) -> list[list[int]]:
        """Numbers of the contacts, those of one patch object on the same ground together."""
        found: dict[tuple, list[int]] = {}
        for i, c in enumerate(self.equations.contacts):
            found.setdefault((id(c.patch), c.ground), []).append(i)
        return list(found.values())

    @cached_property
    def order(self) -> Any:
        """(contacts,) place of each contact where they stand group by group."""
        return jnp.asarray(np.argsort([i for same in self.same for i in same]).astype(int))

    @cached_property
    def options(self) -> Options:
        e = self.equations
        gapes = [g.law.overlap(jnp.zeros((len(g.index) * len(g.G), 3))) for g in self.groups]
        opens = bool(gapes) and not any(bool(jnp.isnan(a).any()) for a in gapes)
        dissipative = np.linalg.eigvalsh(0.5 * (e.C + e.C.T)).min(initial=0.0) >= -1e-9 * np.abs(e.C).max(initial=0.0)
        leaps = opens and not e.F_0.any() and e.steady is not None and bool(dissipative)
        return Options(bool(e.R.any()), leaps, self.accounts, any(g.law.brakes for g in self.groups))

    @cached_property
    def bodies(self) -> Bodies:
        e = self.equations
        b, p = blocks(e)
        m, c, n = len(e.omega2), len(e.D), e.turning.shape[0]
        D = np.zeros((c, b, 2 * p))
        D[:, :, :p] = e.D.reshape(c, b, p)
        steady, still = np.zeros((b, 2 * p, n)), np.zeros((m, n)) if e.steady is None else e.steady
        steady[:, :p] = still.reshape(b, p, n)
        steady[:, p:] = (still @ e.turning).reshape(b, p, n)
        rows, given = self._points
        reach = np.linalg.norm(rows, axis=(1, 2))
        drift = np.linalg.norm(np.abs((rows @ still + given) @ e.turning).sum(axis=2), axis=1)
        return Bodies(
            flow(e, self.tau), self.tau, *map(jnp.asarray, (D, e.D_o, -e.D.T.reshape(b, p, c), e.R, e.yields, e.F_0)),
            *map(jnp.asarray, (e.omega2.reshape(b, p), steady, reach, drift)),
        )._replace(slowing=jnp.asarray(0.5 * self.tau * e.D @ e.D.T), yielding=self._yielding)  # fmt: skip

    @property
    def _points(self) -> tuple[Array, Array]:
        """(points, 3, m) and (points, 3, n): motion of all points by modes and by what the loads move beside them."""
        e, rows, given = (
            self.equations,
            [np.zeros((0, 3, len(self.equations.omega2)))],
            [np.zeros((0, 3, self.equations.turning.shape[0]))],
        )
        for g in self.groups:
            rows += [np.asarray(g.G) @ e.D[i] for i in np.asarray(g.index)]
            given += [np.asarray(g.G) @ e.D_o[i] for i in np.asarray(g.index)]
        return np.concatenate(rows), np.concatenate(given)

    @property
    def _yielding(self) -> tuple[Any, ...]:
        """Of every group (c n,) m/s per N: no pattern of tangential forces moves points by more."""
        T = self._points[0][:, 1:].reshape(-1, len(self.equations.omega2))
        rows = 0.5 * self.tau * np.abs(T @ T.T).sum(axis=1).reshape(-1, 2).max(axis=1, initial=0.0)
        ends = np.cumsum([len(g.index) * len(g.G) for g in self.groups])
        return tuple(map(jnp.asarray, np.split(rows, ends[:-1]))) if len(ends) else ()

    def start(self, q: Array, v: Array, time: float = 0.0) -> Now:
        """At rest or moving, from modal coordinates (m,) and velocities; contacts come there from u = 0 on a straight
        way."""
        e = self.equations
        b, p = blocks(e)
        y = jnp.concatenate([jnp.asarray(q).reshape(b, p), jnp.asarray(v).reshape(b, p)], axis=1)
        states = tuple(g.law.init(len(g.index) * len(g.G)) for g in self.groups)
        points = tuple(jnp.zeros((len(g.index) * len(g.G), 3)) for g in self.groups)
        none = jnp.zeros(len(e.contacts))
        now = Now(
            y, jnp.asarray(e.oscillators(time)), jnp.asarray(float(time)), jnp.zeros(len(e.D)), states, points, points,
            none, none.astype(bool), jnp.zeros(6), jnp.zeros(()), jnp.zeros((), dtype=int), jnp.zeros((EVENTS, 3)),
        )  # fmt: skip
        return _begun(self.options, self.groups, self.order, self.bodies, now)

    def run(self, now: Now, steps: Array) -> tuple[Now, Seen]:
        """Samples (s,) further, each after so many steps; compiled anew for another s alone."""
        reached = float(now.time) + self.tau * np.cumsum(steps)
        o = jnp.asarray(self.equations.oscillators(reached))
        now = now._replace(count=jnp.zeros((), dtype=int))
        return _run(self.options, self.groups, self.order, self.bodies, now, o, jnp.asarray(steps))


def static_force(stepper: Stepper) -> Callable[[Array], tuple[Array, Array]]:
    """Function of modal displacements (m,): force (c,) of contacts that came there on a straight way, and (c, c) its
    slope with respect to d."""
    e, groups = stepper.equations, stepper.groups
    states = tuple(g.law.init(len(g.index) * len(g.G)) for g in groups)
    if e.R.any():
        raise UserError('start: where modes leave compliance out of the contacts, begin from "rest"')

    @jax.jit
    def found(q: Any) -> tuple[Any, Any]:
        d = jnp.asarray(e.D) @ q + jnp.asarray(e.D_o[:, 0])
        still = jnp.zeros_like(d)
        force = _force(groups, d, still, 1.0, states, len(d))[0]
        return force, _slope(groups, d, still, 1.0, states, len(d))

    return lambda q: tuple(np.asarray(x) for x in found(q))  # type: ignore[return-value]


class Pressed(NamedTuple):
    """What contacts answer to a step: see `Now`; energy lost in it, given by moving ground, and stored after it, J."""

    d: Any
    force: Any
    states: tuple[Any, ...]
    points: tuple[Any, ...]
    places: tuple[Any, ...]
    approach: Any
    slips: Any
    lost: Any
    given: Any
    stored: Any
    worst: Any


def _displaced(g: Group, d: Any) -> Any:
    """(c n, 3) m of the points of a group."""
    return jnp.einsum("nia,ca->cni", g.G, d[g.index] + g.offset).reshape(-1, 3)


def _moving(g: Group, v: Any) -> Any:
    return jnp.einsum("nia,ca->cni", g.G, v[g.index]).reshape(-1, 3)


def _contracted(g: Group, points: Any) -> Any:
    return jnp.einsum("nia,cni->ca", g.G, points.reshape(len(g.index), -1, 3))


def _force(groups: tuple[Group, ...], d: Any, v: Any, dt: Any, states: tuple[Any, ...], count: int) -> tuple:
    """Force (c,) at d with velocity v, states and points' forces of all groups."""
    force, after, points = jnp.zeros(count), [], []
    for g, state in zip(groups, states, strict=True):
        f, s = g.law.step(_displaced(g, d), _moving(g, v), dt, state)
        force = force.at[g.index].set(_contracted(g, f))
        after.append(s)
        points.append(f)
    return force, tuple(after), tuple(points)


def _slope(groups: tuple[Group, ...], d: Any, v: Any, dt: Any, states: tuple[Any, ...], count: int) -> Any:
    """(c, c) derivative of the force, point by point."""
    out = jnp.zeros((count, count))
    for g, state in zip(groups, states, strict=True):
        u, w = _displaced(g, d), _moving(g, v)

        def along(direction: Any, g: Group = g, u: Any = u, w: Any = w, state: Any = state) -> Any:
            tangent = jnp.broadcast_to(direction, u.shape)
            return jax.jvp(lambda x: g.law.step(x, w, dt, state)[0], (u,), (tangent,))[1]

        S = jax.vmap(along)(jnp.eye(3)).reshape(3, len(g.index), -1, 3)
        k = jnp.einsum("nia,jcni,njb->cab", g.G, S, g.G)
        out = out.at[g.index[:, :, None], g.index[:, None, :]].set(k)
    return out


def _placed(options: Options, groups: tuple[Group, ...], B: Bodies, free: Any, v: Any, dt: Any, now: Now) -> tuple:
    """d (c,) of contacts that bodies alone would have at `free`, where those yield at once; the residual, m; and what
    `_force` says there. With the slope of sticking contacts first, with their own where that does not do."""
    count = len(free)
    if not options.yields:
        return free, jnp.zeros(()), _force(groups, free, v, dt, now.states, count)
    enough = 1e-10 * jnp.abs(free).max() + 1e-17

    def missing(d: Any) -> tuple:
        there = _force(groups, d, v, dt, now.states, count)
        return d, d - free + B.R @ (there[0] - B.F_0), there

    def wanted(most: int, carried: tuple) -> Any:
        i, (_, r, _) = carried
        return (jnp.abs(r).max() > enough) & (i < most)

    def chord(carried: tuple) -> tuple:
        i, (d, r, _) = carried
        return i + 1, missing(d - B.yields @ r)

    def newton(carried: tuple) -> tuple:
        i, (d, r, _) = carried
        J = jnp.eye(count) + B.R @ _slope(groups, d, v, dt, now.states, count)
        return i + 1, missing(d - jnp.linalg.solve(J, r))

    first = missing(free - B.R @ (now.force - B.F_0))
    _, found = jax.lax.while_loop(partial(wanted, CHORDS), chord, (0, first))
    _, (d, r, there) = jax.lax.while_loop(partial(wanted, ITERATIONS), newton, (0, found))
    return d, jnp.abs(r).max(), there


def _pressed(options: Options, groups: tuple, order: Any, B: Bodies, free: Any, v: Any, dt: Any, now: Now) -> Pressed:
    d, worst, (force, states, points) = _placed(options, groups, B, free, v, dt, now)
    places = tuple(_displaced(g, d) for g in groups)
    approach, slips, (lost, given, stored) = [], [], jnp.zeros(3)
    for i, (g, u) in enumerate(zip(groups, places, strict=True)):
        slid = jnp.abs(g.law.slip(states[i]) - g.law.slip(now.states[i])) > SLID * jnp.abs(u - now.places[i])[:, 1:]
        deep = g.law.overlap(u)
        deep = jnp.where(jnp.isnan(deep), points[i][:, 0] > 0, deep)
        approach.append(jnp.max(deep.reshape(len(g.index), -1), axis=1))
        slips.append(jnp.any(slid.reshape(len(g.index), -1), axis=1))
        if options.accounts:
            moved = u - now.places[i]
            step = Step(u, moved, dt, now.points[i], points[i], now.states[i], states[i])
            lost, given = lost + jnp.sum(g.law.lost(step)), given + jnp.sum(g.law.given(step))
            stored += jnp.sum(g.law.stored(u, states[i]))
    by_contact = [jnp.concatenate(x)[order] if x else jnp.zeros(0) for x in (approach, slips)]
    touched = by_contact[0], by_contact[1].astype(bool)
    return Pressed(d, force, states, points, places, *touched, lost, given, stored, worst)


SLID = 1e-9
"""Share of a way beyond which a slider has slid and not only rounding."""


@partial(jax.jit, static_argnums=0)
def _begun(options: Options, groups: tuple[Group, ...], order: Any, B: Bodies, now: Now) -> Now:
    """The contacts where the bodies are, half a kick taken."""
    p = B.omega2.shape[1]
    free = jnp.einsum("cbi,bi->c", B.D, now.y) + B.D_o @ now.o
    v = jnp.einsum("cbi,bi->c", B.D[:, :, :p], now.y[:, p:]) + B.D_o @ (_turning(B) @ now.o)
    found = _pressed(options, groups, order, B, free, v, B.tau, now)
    half = 0.5 * B.tau * jnp.einsum("bpc,c->bp", B.kick, found.force - B.F_0)
    y = now.y.at[:, p:].add(half)
    done = -jnp.sum(half * (now.y[:, p:] + 0.5 * half))
    return now._replace(
        y=y, force=found.force, states=found.states, points=found.points, places=found.places, approach=found.approach,
        slips=found.slips, energy=now.energy.at[2].set(done).at[4].set(found.stored), worst=found.worst,
    )  # fmt: skip


def _turning(B: Bodies) -> Any:
    """(n, n) o' over o, from its flow over a step: exact for the rates that a contact's dampers need."""
    turn = B.flow.turn[0]
    return (turn - turn.T) / (2 * B.tau)


@partial(jax.jit, static_argnums=0)
def _run(
    options: Options, groups: tuple[Group, ...], order: Any, B: Bodies, now: Now, oscillators: Any, steps: Any
) -> tuple[Now, Seen]:
    """Samples after (s,) steps each; oscillators: (s, n) o there, so that rounding does not add up."""
    p = B.omega2.shape[1]

    def sample(now: Now, one: tuple) -> tuple[Now, Seen]:
        o, count = one
        step = partial(_step, options, groups, order, B)
        left, now = jax.lax.while_loop(lambda c: c[0] > 0, lambda c: step(*c), (count, now))
        now = now._replace(o=o)
        half = 0.5 * B.tau * jnp.einsum("bpc,c->bp", B.kick, now.force - B.F_0)
        q, v = now.y[:, :p], now.y[:, p:] - half
        energy = now.energy.at[2].add(jnp.sum(half * (v + 0.5 * half)))  # the second half of the kick is to come
        bodies = 0.5 * jnp.sum(v**2 + B.omega2 * q**2)
        d = jnp.einsum("cbi,bi->c", B.D, now.y) + B.D_o @ o - B.R @ (now.force - B.F_0)
        return now, Seen(q.reshape(-1), v.reshape(-1), d, now.force, energy, bodies, now.time)

    return jax.lax.scan(sample, now, (oscillators, steps))


def _step(options: Options, groups: tuple, order: Any, B: Bodies, left: Any, now: Now) -> tuple[Any, Now]:
    """One step, or a leap over as many as no contact is met in."""
    p = B.omega2.shape[1]
    k = _leap(groups, B, now, left) if options.leaps else 0
    F, dt = B.flow, B.tau * 2.0**k
    z = jnp.concatenate([now.y, jnp.broadcast_to(now.o, (len(now.y), len(now.o)))], axis=1)
    y = jnp.einsum("bij,bj->bi", F.move[k], z)
    o = F.turn[k] @ now.o
    given, taken = (jnp.einsum("bi,bij,bj->", z, Q[k], z) for Q in (F.supplied, F.damped))
    free = jnp.einsum("cbi,bi->c", B.D, y) + B.D_o @ o
    half = 0.5 * B.tau * jnp.einsum("bpc,c->bp", B.kick, now.force - B.F_0)
    v = jnp.einsum("cbi,bi->c", B.D[:, :, :p], y[:, p:] + half) + B.D_o @ (_turning(B) @ o)
    if options.brakes:
        v, missed = slowed(groups, B, free, v + B.slowing @ (now.force - B.F_0), dt, now)
        now = now._replace(worst=jnp.maximum(now.worst, missed * dt))
    found = _pressed(options, groups, order, B, free, v, dt, now)
    kick = B.tau * jnp.einsum("bpc,c->bp", B.kick, found.force - B.F_0)
    work = -jnp.sum(kick * (y[:, p:] + 0.5 * kick))
    energy = now.energy + jnp.stack([given, taken, work, found.lost, 0.0 * work, found.given])
    energy = energy.at[4].set(found.stored)
    after = now._replace(
        y=y.at[:, p:].add(kick), o=o, time=now.time + dt, force=found.force, states=found.states, points=found.points,
        places=found.places, approach=found.approach, slips=found.slips, energy=energy,
        worst=jnp.maximum(now.worst, found.worst),
    )  # fmt: skip
    return left - 2**k, _noted(now, after, dt)


def slowed(groups: tuple[Group, ...], B: Bodies, d: Any, v: Any, dt: Any, now: Now) -> tuple[Any, Any]:
    """(c,) velocities of contacts after half a kick by friction that follows them alone, and what is missing, m/s.

    v: before that kick. Newton's method from what the last force leaves; where that does not do, from turns in which
    each point brakes by itself, as if all that yields were its own, from where the others leave it (forward and
    backward steps: P. L. Lions, B. Mercier, SIAM J. Numer. Anal. 16, 1979).
    """
    enough = 1e-10 * jnp.abs(v).max() + 1e-18

    def left(force: Any) -> Any:
        return v - B.slowing @ (force - B.F_0)

    def missing(at: Any) -> Any:
        return at - left(_force(groups, d, at, dt, now.states, len(d))[0])

    def newton(carried: tuple) -> tuple:
        i, at, r = carried
        at = at - jnp.linalg.solve(jax.jacfwd(missing)(at), r)
        return i + 1, at, missing(at)

    def refined(at: Any) -> tuple:
        more = partial(_unsolved, NEWTON, enough)
        _, at, r = jax.lax.while_loop(more, newton, (0, at, missing(at)))
        return at, jnp.nan_to_num(jnp.abs(r).max(), nan=jnp.inf)

    def turn(carried: tuple) -> tuple:
        i, at, points, _, _ = carried
        force, after = jnp.zeros_like(d), []
        for g, f, state, y in zip(groups, points, now.states, B.yielding, strict=True):
            u, w = _displaced(g, d), _moving(g, at)
            trial = w.at[:, 1:].add(y[:, None] * f[:, 1:])
            held = (trial - g.law.slowed(u, trial, dt, state, y))[:, 1:] / jnp.where(y > 0, y, 1.0)[:, None]
            by_law = g.law.step(u, w, dt, state)[0]
            f = jnp.concatenate([by_law[:, :1], held], axis=1) if g.law.brakes else by_law
            force = force.at[g.index].set(_contracted(g, f))
            after.append(f)
        return i + 1, left(force), tuple(after), *refined(left(force))

    at = left(now.force)
    begin = (0, at, now.points, *refined(at))
    *_, found, missed = jax.lax.while_loop(lambda c: (c[4] > enough) & (c[0] < TURNS), turn, begin)
    return found, missed


def _unsolved(most: int, enough: Any, carried: tuple) -> Any:
    return (jnp.abs(carried[2]).max() > enough) & (carried[0] < most)


TURNS, NEWTON = 100, 8
"""Turns of `slowed` at most, and steps of Newton's method in each."""


def _leap(groups: tuple[Group, ...], B: Bodies, now: Now, left: Any) -> Any:
    """k of the longest leap of 2^k steps, of those that are left, that no point of contact can close its gap in."""
    p = B.omega2.shape[1]
    z = now.y - jnp.einsum("bin,n->bi", B.steady, now.o)
    swings = jnp.sqrt(jnp.sum(z[:, p:] ** 2 + B.omega2 * z[:, :p] ** 2))
    gaps = -jnp.concatenate([g.law.overlap(u) for g, u in zip(groups, now.places, strict=True)])
    steps = jnp.min(gaps / (B.reach * swings + B.drift + 1e-300)) / B.tau
    longest = jnp.minimum(jnp.maximum(steps, 1.0), left)
    k = jnp.floor(jnp.log2(longest) + 1e-12).astype(int)
    return jnp.clip(k, 0, len(B.flow.turn) - 1)


def _noted(before: Now, after: Now, dt: Any) -> Now:
    """Events of a step: where the deepest point of a contact passes zero; where sliding begins and ends in it."""
    a, b = before.approach, after.approach
    met = (a <= 0) & (b > 0), (a > 0) & (b <= 0), after.slips & ~before.slips, before.slips & ~after.slips
    happens = jnp.stack(met)

    def write(now: Now) -> Now:
        share = jnp.where(happens[:2].any(axis=0), -a / jnp.where(b == a, 1.0, b - a), 0.5)
        times = now.time - dt + dt * jnp.stack([share, share, 0.5 + 0 * a, 0.5 + 0 * a])
        kind, contact = jnp.meshgrid(jnp.arange(4.0), jnp.arange(1.0 * len(a)), indexing="ij")
        place = now.count + jnp.cumsum(happens.reshape(-1)).reshape(happens.shape) - 1
        rows = jnp.stack([times, contact, kind], axis=-1)
        events = now.events.at[jnp.where(happens, place, EVENTS)].set(rows, mode="drop")
        return now._replace(events=events, count=now.count + jnp.sum(happens))

    return jax.lax.cond(happens.any(), write, lambda now: now, after)

"""The compiled loop: exact flow, contact force, kick; leaps where nothing touches.

A step of dt: the contacts' force F kicks the velocities by F - F_0 for dt / 2, the bodies flow for dt as if nothing
touched (`flow`), the contacts say their force at the place they came to, and that kicks for dt / 2: symmetric, and of
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
import scipy.linalg

from ..contact.set_valued import SetValued
from ..data import Array, UserError
from ..harmonic_balance.forces import repeated
from .braking import Braking, slowed
from .contacts import Group, Held, Yielding, answer, force_at, rigid_answer, slope_at, times, untouched
from .equations import Equations
from .flow import DOUBLINGS, Flow, blocks, flow
from .ground import moving
from .inclusion import Meets, meets
from .ramp import Ramp

EVENTS = 8192
"""Events that one call of the loop keeps; of more, only their number is known."""

KINDS = ("closes", "opens", "slips", "sticks")


class Bodies(NamedTuple):
    """What the loop reads of the equations, as jax arrays in blocks of modes.

    Attributes:
        flow. yielding: see `contacts`. meets: of set-valued points, None: there are none.
            braking: of friction that follows the velocity alone, None: there is none. F_0: (c,). D: (c, m) and
            D_o (c, n): d of the contact coordinates. rate: (n, n) o' over o. kick: (m, c) velocities per force.
        omega2: (b, p). steady: (b, 2 p, n) of the periodic motion without contacts. reach: (points,) norm of their
            motion by modes, drift: (points,) m/s of the steady motion at most: see `_leap`. loads: (b, p, n) modal
            forces of o that kick, of a run-up.
    """

    flow: Flow
    yielding: Yielding | None
    meets: Meets | None
    braking: Braking | None
    F_0: Any
    D: Any
    D_o: Any
    rate: Any
    kick: Any
    omega2: Any
    steady: Any
    reach: Any
    drift: Any
    loads: Any


class Now(NamedTuple):
    """Where the motion is.

    Attributes:
        y: (b, 2 p) modal displacements and velocities. o: (n,). push: (b, p) accelerations by contacts. held: by
            them.
        energy: (6,) J since the start: given by loads, taken by dampers, done on contacts, lost there for good, what
            contacts store now, and what moving ground gave them. worst: m, the largest residual of an implicit contact.
        met: (4, contacts) the events of the last step, at: when, s.
    """

    y: Any
    o: Any
    time: Any
    push: Any
    held: Held
    energy: Any
    worst: Any
    met: Any
    at: Any


class Listed(NamedTuple):
    """Events. count: of them. rows: (EVENTS, 3): time in s, contact, kind."""

    count: Any
    rows: Any


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
    """What the loop is compiled for. leaps: over flights without contact. accounts: of the energy that contacts store
    and lose. ramp: o is that of a run-up, with these harmonics, whose loads kick."""

    leaps: bool
    accounts: bool
    ramp: tuple[Ramp, tuple[int, ...]] | None = None


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
        contacts, found = self.equations.contacts, []
        for same in self.same:
            patch = contacts[same[0]].patch
            offset = np.array([contacts[i].offset for i in same])
            law = repeated(patch.law, len(patch.points), len(same))
            if (ground := contacts[same[0]].ground) is not None:
                if isinstance(law, SetValued):
                    raise UserError(f"{contacts[same[0]].name}: ground: set-valued contacts stand on ground at rest")
                law = moving(law, ground, np.tile(patch.points, (len(same), 1)))
            G = np.broadcast_to(patch.kinematics, (len(same), *patch.kinematics.shape))
            found.append(Group(law, jnp.asarray(G), jnp.asarray(offset)))
        return tuple(found)

    @cached_property
    def same(self) -> list[list[int]]:
        """Numbers of the contacts, those of one patch object on the same ground together."""
        found: dict[tuple, list[int]] = {}
        for i, c in enumerate(self.equations.contacts):
            found.setdefault((id(c.patch), c.ground), []).append(i)
        return list(found.values())

    @cached_property
    def rows(self) -> Array:
        """(c,) of the equations' contact coordinates, those of the loop."""
        begins = np.cumsum([0, *(c.patch.count for c in self.equations.contacts)])
        parts = [np.arange(begins[i], begins[i + 1]) for same in self.same for i in same]
        return np.concatenate([np.zeros(0, int), *parts])

    @cached_property
    def numbers(self) -> Array:
        """(contacts,) of the equations, those of the loop."""
        return np.array([i for same in self.same for i in same], dtype=int)

    @cached_property
    def options(self) -> Options:
        e = self.equations
        gapes = [g.law.overlap(jnp.zeros((g.G.shape[0] * g.G.shape[1], 3))) for g in self.groups]
        opens = bool(gapes) and not any(bool(jnp.isnan(a).any()) for a in gapes)
        dissipative = np.linalg.eigvalsh(0.5 * (e.C + e.C.T)).min(initial=0.0) >= -1e-9 * np.abs(e.C).max(initial=0.0)
        leaps = opens and not e.F_0.any() and e.steady is not None and bool(dissipative)
        return Options(leaps, self.accounts, (e.ramp, e.harmonics) if e.ramp else None)

    @cached_property
    def bodies(self) -> Bodies:
        e, rows = self.equations, self.rows
        b, p = blocks(e)
        n = e.turning.shape[0]
        steady, still = np.zeros((b, 2 * p, n)), np.zeros((b * p, n)) if e.steady is None else e.steady
        steady[:, :p] = still.reshape(b, p, n)
        steady[:, p:] = (still @ e.turning).reshape(b, p, n)
        moved, given = self._points
        reach = np.linalg.norm(moved, axis=(1, 2))
        drift = np.linalg.norm(np.abs((moved @ still + given) @ e.turning).sum(axis=2), axis=1)
        D, D_o, F_0 = e.D[rows], e.D_o[rows], jnp.asarray(e.F_0[rows])
        R, share = (jnp.asarray(x[np.ix_(rows, rows)]) for x in (e.R, e.yields))
        loads = (np.zeros((b * p, n)) if e.push is None else e.push).reshape(b, p, n)
        arrays = map(jnp.asarray, (D, D_o, e.turning, -D.T, e.omega2.reshape(b, p), steady, reach, drift, loads))
        flows = flow(e, self.tau, DOUBLINGS if self.options.leaps else 0)
        return Bodies(
            flows, Yielding(R, share, F_0) if e.R.any() else None, self._meets(flows), self._braking, F_0, *arrays
        )

    @property
    def _braking(self) -> Braking | None:
        if not any(g.law.brakes for g in self.groups):
            return None
        D, moved = self.equations.D[self.rows], self._points[0][:, 1:].reshape(-1, len(self.equations.omega2))
        most = 0.5 * self.tau * np.abs(moved @ moved.T).sum(axis=1).reshape(-1, 2).max(axis=1, initial=0.0)
        ends = np.cumsum([g.G.shape[0] * g.G.shape[1] for g in self.groups])[:-1]
        return Braking(jnp.asarray(0.5 * self.tau * D @ D.T), tuple(map(jnp.asarray, np.split(most, ends))))

    def _meets(self, flows: Flow) -> Meets | None:
        """Of set-valued points, see `inclusion`.

        Raises:
            UserError: they stand beside other laws on bodies that yield, or some yield and some do not.
        """
        e, rigid = self.equations, np.array([r for G, r in self._spots for _ in G], dtype=bool)
        if not rigid.any():
            return None
        if not e.R.any():
            p = blocks(e)[1]
            speeds = scipy.linalg.block_diag(*np.asarray(flows.stack[0][:, :p, p : 2 * p]))
            D = self._points[0][rigid].reshape(-1, len(e.omega2))
            return meets(jnp.asarray(D @ speeds @ D.T * self.tau))
        names = ", ".join(c.name for c in e.contacts)
        if not rigid.all() or any(g.law.normal is not None for g in self.groups):
            raise UserError(
                f"contacts {names}: on bodies that yield beside their modes, set-valued laws stand alone and press of "
                'themselves; give all of them law = "set-valued" and no normal stiffness'
            )
        if any(float(np.max(g.law.restitution)) > 0 for g in self.groups):
            raise UserError(
                f"contacts {names}: restitution: is for bodies of modes alone; these yield beside them, and what "
                "comes back is theirs: leave it out"
            )
        rows = np.concatenate([G for G, _ in self._spots]).reshape(-1, len(e.D))
        yields, moves = rows @ e.R[np.ix_(self.rows, self.rows)] @ rows.T, np.abs(rows).any(axis=1)
        if np.diag(yields)[moves].min() <= 1e-9 * np.diag(yields).max():
            raise UserError(
                f"contacts {names}: some of these bodies yield beside their modes and some do not; keep the residual "
                "compliance of all contacts, or of none"
            )
        return meets(jnp.asarray(yields))

    @cached_property
    def _spots(self) -> list[tuple[Array, bool]]:
        """Of each contact as the loop has them: (n, 3, c) of its points, and whether its law is set-valued."""
        begin, found = 0, []
        for g in self.groups:
            for G in np.asarray(g.G):
                rows = np.zeros((*G.shape[:2], len(self.rows)))
                rows[:, :, begin : begin + G.shape[2]] = G
                found.append((rows, g.rigid))
                begin += G.shape[2]
        return found

    @property
    def _points(self) -> tuple[Array, Array]:
        """(points, 3, m) and (points, 3, n): motion of all points by modes and by what the loads move beside them."""
        e = self.equations
        spots = np.concatenate([np.zeros((0, 3, len(e.D))), *(G for G, _ in self._spots)])
        return spots @ e.D[self.rows], spots @ e.D_o[self.rows]

    def start(self, q: Array, v: Array, time: float = 0.0, held: Held | None = None) -> Now:
        """At rest or moving, from modal coordinates (m,) and velocities; contacts come there on a straight way from
        what they held, from u = 0 if it is not given."""
        e = self.equations
        b, p = blocks(e)
        y = jnp.concatenate([jnp.asarray(q).reshape(b, p), jnp.asarray(v).reshape(b, p)], axis=1)
        none = jnp.zeros((4, len(e.contacts)))
        now = Now(
            y, jnp.asarray(e.oscillators(time)), jnp.asarray(float(time)), jnp.zeros((b, p)),
            held or untouched(self.groups), jnp.zeros(6), jnp.zeros(()), none.astype(bool), none,
        )  # fmt: skip
        return _begun(self.options, self.groups, self.bodies, now)

    def run(self, now: Now, steps: Array, events: int = EVENTS) -> tuple[Now, Seen, Array, int]:
        """Samples (s,) further, each after so many steps of tau; compiled anew for another s alone.

        Returns:
            Where the motion is; the samples; (e, 3) events: time in s, contact, kind, an index of `KINDS`; how many
            there were, which may be more.
        """
        reached = float(now.time) + self.tau * np.cumsum(steps)
        o = jnp.asarray(self.equations.oscillators(reached))
        listed = Listed(jnp.zeros((), int), jnp.zeros((events, 3)))
        now, listed, seen = _run(self.options, self.groups, self.bodies, now, listed, o, jnp.asarray(steps))
        count, back = int(listed.count), np.argsort(self.rows)
        rows = np.array(listed.rows[: min(count, events)])
        rows[:, 1] = self.numbers[rows[:, 1].astype(int)] if len(rows) else 0
        seen = Seen._make(map(np.asarray, seen))
        return now, seen._replace(d=seen.d[:, back], force=seen.force[:, back]), rows, count


def static_force(stepper: Stepper) -> Callable[[Array], tuple[Array, Array]]:
    """Function of modal displacements (m,): modal forces (m,) of contacts that came there on a straight way, and (m, m)
    their slope."""
    groups, bodies = stepper.groups, stepper.bodies
    states = untouched(groups).states
    if bodies.meets is not None:
        raise UserError('start: set-valued contacts have no stiffness to find a rest by; begin from "rest"')
    if bodies.yielding is not None:
        raise UserError('start: where modes leave compliance out of the contacts, begin from "rest"')

    @jax.jit
    def found(q: Any) -> tuple[Any, Any]:
        d = bodies.D @ q + jnp.asarray(stepper.equations.still[1][stepper.rows])
        still = jnp.zeros_like(d)
        force = force_at(groups, d, still, 1.0, states)[0]
        return bodies.D.T @ (force - bodies.F_0), bodies.D.T @ slope_at(groups, d, still, 1.0, states) @ bodies.D

    return lambda q: tuple(np.asarray(x) for x in found(q))  # type: ignore[return-value]


def _pushed(
    options: Options, groups: tuple[Group, ...], B: Bodies, q: Any, v_free: Any, half: Any, o: Any, moves: Any, dt: Any,
    held: Held, share: float = 1.0,
) -> tuple[Held, Any]:  # fmt: skip
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
        v, unbraked = slowed(groups, B.braking, B.F_0, free, before, dt, held)
    if B.meets is None:
        held = answer(groups, B.yielding, free, v, dt, held, options.accounts)
        return held._replace(missed=held.missed + dt * unbraked), _by_force(B, held.force)
    force, *others = force_at(groups, free, v, dt, held.states)
    ahead = free
    if B.yielding is None:
        ahead = _ahead(B, q, v_free + share * dt * (_by_force(B, force) + times(B.loads, o)), o)
    else:
        free = free + times(B.yielding.R, B.F_0)
    points = B.meets if B.yielding is not None else B.meets._replace(A=share * B.meets.A, r=B.meets.r / share)
    owed = held.owed
    held = rigid_answer(groups, points, B.yielding, free, ahead, dt, held, tuple(others), options.accounts)
    push = _by_force(B, held.force)
    if B.yielding is None and options.accounts:
        whole, rigid = push + times(B.loads, o), 0.5 * dt * (held.force - force)
        now, then = (times(B.D, (v_free + part * dt * whole).reshape(-1)) + given for part in (0.25, share - 0.25))
        held = held._replace(lost=held.lost + owed + jnp.sum(rigid * now), owed=jnp.sum(rigid * then))
    return held, push


def _by_force(B: Bodies, force: Any) -> Any:
    """(b, p) m/s2 of the modes by forces (c,) of the contact coordinates."""
    return times(B.kick, force - B.F_0).reshape(B.omega2.shape)


def _ahead(B: Bodies, q: Any, v: Any, o: Any) -> Any:
    """(c,) of the contact coordinates after another step."""
    z = jnp.concatenate([q, v, jnp.broadcast_to(o, (len(q), len(o)))], axis=1)
    then = times(B.flow.stack[0][:, : q.shape[1]], z)
    return times(B.D, then.reshape(-1)) + times(B.D_o, times(B.flow.turn[0], o))


@partial(jax.jit, static_argnums=0)
def _begun(options: Options, groups: tuple[Group, ...], B: Bodies, now: Now) -> Now:
    """The contacts where the bodies are."""
    q, v = jnp.split(now.y, 2, axis=1)
    held, push = _pushed(options, groups, B, q, v, 0 * v, now.o, times(B.rate, now.o), B.flow.length[0], now.held, 0.5)
    return now._replace(push=push, held=held, energy=now.energy.at[4].set(held.stored), worst=held.missed)


@partial(jax.jit, static_argnums=0)
def _run(
    options: Options, groups: tuple[Group, ...], B: Bodies, now: Now, listed: Listed, oscillators: Any, steps: Any
) -> tuple[Now, Listed, Seen]:
    """Samples after (s,) steps each; oscillators: (s, n) o there, so that rounding does not add up."""
    p = B.omega2.shape[1]
    step = partial(_step, options, groups, B)

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


def _step(options: Options, groups: tuple[Group, ...], B: Bodies, left: Any, now: Now) -> tuple[Any, Now]:
    """One step, or a leap over as many as no contact is met in."""
    p = B.omega2.shape[1]
    k = _leap(groups, B, left, now) if options.leaps else 0
    dt = B.flow.length[k]
    touched, pushed = 0.5 * dt * now.push, 0.5 * dt * times(B.loads, now.o)
    v = now.y[:, p:] + touched + pushed
    z = jnp.concatenate([now.y[:, :p], v, jnp.broadcast_to(now.o, (len(v), len(now.o)))], axis=1)
    flown = times(B.flow.stack[k], z)
    q, v_free = flown[:, :p], flown[:, p : 2 * p]
    given, taken = jnp.sum(z * flown[:, 2 * p :].reshape(len(z), 2, -1).transpose(1, 0, 2), axis=(1, 2))
    o, moves = _driven(options, B, now, k, dt)
    held, push = _pushed(options, groups, B, q, v_free, touched + pushed, o, moves, dt, now.held)
    y, work = jnp.concatenate([q, v_free], axis=1), jnp.zeros(())
    after = 0.5 * dt * push, 0.5 * dt * times(B.loads, o)
    for contacts, loads, mean in ((touched, pushed, 0.5 * (now.y[:, p:] + v)), (*after, v_free + 0.5 * sum(after))):
        work -= jnp.sum(contacts * mean)
        given += jnp.sum(loads * mean)
    y = y.at[:, p:].add(sum(after))
    energy = now.energy + jnp.stack([given, taken, work, held.lost, jnp.zeros(()), held.given])
    energy = energy.at[4].set(held.stored)
    met, at = _met(now, held, dt)
    return left - 2**k, Now(
        y, o, now.time + dt, push, held, energy, jnp.maximum(now.worst, held.missed), met, at
    )  # fmt: skip


def _driven(options: Options, B: Bodies, now: Now, k: Any, dt: Any) -> tuple[Any, Any]:
    """(n,) o after a step, and o' there."""
    if options.ramp is None:
        o = times(B.flow.turn[k], now.o)
        return o, times(B.rate, o)
    ramp, harmonics = options.ramp
    o = ramp.driving(now.time + dt, harmonics, jnp)
    return o, (o - now.o) / dt


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

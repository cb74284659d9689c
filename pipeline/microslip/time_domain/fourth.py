"""A step of fourth order, for contacts whose laws are differential equations: kicks at its begin, middle and end.

The flow between kicks being exact, with N the accelerations by contacts,

    v += h N_1 / 6,  flow h / 2,  v += h (N_2 + N_3) / 3,  flow h / 2,  v += h N_4 / 6

are the weights of the classical Runge-Kutta method in the coordinates that flow (J. D. Lawson, SIAM J. Numer. Anal. 4,
1967); N_2 to N_4 are what contacts say in its stages, and what they remember goes along with the same weights. N_5,
where the step ends, is N_1 of the next one. What the step misses is estimated by h (N_4 - N_5) / 6, of third order, to
the power that makes it one of fourth; and by how much N is bent otherwise than in the steps before: a jump of N within
a step, h (N_1 - N_2 - N_3 + N_5) / 3, is what Simpson's weights miss of it at most. So a kink is seen wherever in the
step a contact closes, opens or begins to slide. Where that is too much the step is done again in halves, down to a
512th, so that no more is lost there than in a step of the smooth motion.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .bodies import Bodies, MotionState, Options, by_modes, exponent, to_modes
from .contacts import Held, joined, times, told
from .flow import flown, worked

HALVINGS = 10
"""Of a step, of which the shortest flow is half a step: where contacts change it is a 512th at least."""

MISSED = 1e-3
"""Of (step times the fastest frequency)^4: what a step may miss, a share of the motion."""

GROWS = 40.0
"""How many times smaller than it may be the estimate of a step is after which the next one is twice as long."""

SMOOTH = 8.0
"""How many times less a step misses where accelerations bend as oddly as in the step before: of a kink Simpson's
weights miss up to a quarter of what they miss of a jump, of what is smooth a thousandth."""

SLOW = 0.03
"""Over the fastest frequency, s: laws that follow the motion more quickly would make steps too short."""


class StageForces(NamedTuple):
    """push: (b, p) accelerations. Group by group forces: (c n, 3) N, rates: (k, n) of what is remembered, places and
    speeds: (c n, 3) m and m/s of the points."""

    push: Any
    forces: tuple[Any, ...]
    rates: tuple[Any, ...]
    places: tuple[Any, ...]
    speeds: tuple[Any, ...]


class Bending(NamedTuple):
    """bent: (b, p) second differences of the accelerations in the last step, m/s4, slope: how they change, m/s5; h: s,
    that step. curl: how they change otherwise, m/s6."""

    bent: Any
    slope: Any
    h: Any
    curl: Any


def begun(B: Bodies, now: MotionState) -> MotionState:
    """With what the contacts remember, and their forces by that."""
    x = tuple(
        g.law.memory(f, s).reshape(g.law.remembers, len(f)) if g.law.remembers else jnp.zeros((0, len(f)))
        for g, f, s in zip(B.groups, now.held.forces, now.held.states, strict=True)
    )
    first = _answer(B, now.y, now.o, x, now.time)
    held = now.held._replace(forces=first.forces)
    straight = Bending(0 * first.push, 0 * first.push, jnp.zeros(()), jnp.zeros(()))
    return now._replace(push=first.push, held=held, memory=(x, first.rates, straight), level=jnp.full(2, 1, int))


def leapt(now: MotionState) -> MotionState:
    """After a leap: contacts that were open all along remember nothing, and what comes is met as it was last time."""
    nothing = jax.tree_util.tree_map(jnp.zeros_like, now.memory)
    return now._replace(memory=nothing, level=jnp.broadcast_to(now.level[1], 2))


def _answer(B: Bodies, y: Any, o: Any, x: tuple[Any, ...], time: Any) -> StageForces:
    """What contacts say where the bodies are, (b, 2 p)."""
    q, v = (part.reshape(-1) for part in jnp.split(y, 2, axis=1))
    moves, push, answers = times(B.rate, o), B.preload, []
    for g, spots, memory in zip(B.groups, B.spots, x, strict=True):
        u, w = by_modes(spots, q, o) + spots.rest, by_modes(spots, v, moves)
        force, rate = g.law.rates(u.T, w.T, memory, time, B.flow.length[0])
        push -= to_modes(spots, force)
        answers.append((force, rate, u.T, w.T))
    return StageForces(push.reshape(B.omega2.shape), *zip(*answers, strict=True))


def step(options: Options, B: Bodies, k: Any, now: MotionState) -> tuple[Any, MotionState]:
    """Whether 2^k steps were done, and where the motion is then; where they were not, what is to be tried."""
    p, h, half = B.omega2.shape[1], B.flow.length[k], B.flow.length[k - 1]
    x, rates, _ = now.memory
    o = times(B.flow.turn[k - 1], now.o), times(B.flow.turn[k], now.o)
    stack = B.flow.stack[k - 1]
    moves = stack[: 2 * p]

    def on(y: Any, o: Any) -> Any:
        return flown(moves, y, o).T

    def kick(y: Any, push: Any) -> Any:
        return y.at[:, p:].add(push)

    def pushed(push: Any) -> Any:
        """(b, 2 p) what half a step makes of an acceleration."""
        return flown(moves[:, p : 2 * p], push, now.o[:0]).T

    def grown(share: Any, *by: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(a + share * sum(r) for a, *r in zip(x, *by, strict=True))

    free, first = on(now.y, now.o), pushed(now.push)
    two = _answer(B, free + half * first, o[0], grown(half, rates), now.time + half)
    three = _answer(B, kick(free, half * two.push), o[0], grown(half, two.rates), now.time + half)
    end = on(free, o[0]) + h * pushed(three.push)
    four = _answer(B, end, o[1], grown(h, three.rates), now.time + h)
    kicks = (h / 6 * now.push, h / 3 * (two.push + three.push), h / 6 * four.push)
    y, energy = _gone(stack, now.y, (now.o, o[0]), kicks)
    x = grown(h / 6, rates, two.rates, two.rates, three.rates, three.rates, four.rates)
    last = _answer(B, y, o[1], x, now.time + h)
    held = _held(options, B, h, now, last, x)
    size = _norm(jnp.concatenate([y[:, p:], jnp.sqrt(jnp.abs(B.omega2)) * y[:, :p]])) + 1e-300
    bent, third, kink = _missed(h, now, two.push + three.push, four.push, last.push)
    third = third / size
    missed = 2 * third * jnp.sqrt(jnp.sqrt(third)) + kink / size
    done, level = _judged(options, k, now.level[0], missed, B.enough)
    first = done & (now.memory[2].h == 0)
    energy = now.energy.at[:3].add(energy).at[3].add(held.lost).at[4].set(held.stored).at[5].add(held.given)
    after = now._replace(
        y=y, o=o[1], time=now.time + h, push=last.push, held=held, energy=energy, memory=(x, last.rates, bent),
        missed=now.missed + missed * size,
    )  # fmt: skip
    after = jax.tree_util.tree_map(lambda a, b: jnp.where(done, a, b), after, now)
    return done, after._replace(level=jnp.stack([level, jnp.where(first, level, now.level[1])]))


def _norm(x: Any) -> Any:
    return jnp.sqrt(jnp.sum(x**2))


def _missed(h: Any, now: MotionState, middle: Any, four: Any, five: Any) -> tuple[Bending, Any, Any]:
    """How N is bent in a step; what the step misses of velocities by third order, and by a kink."""
    before, between = now.memory[2], 0.5 * (h + now.memory[2].h)
    bent = (now.push - middle + five) / h**2
    as_before = [0.0, before.bent, before.bent + between * before.slope]
    odd = jnp.min(jnp.stack([_norm(bent - expected) for expected in as_before]))
    kink = h**3 / 3 * jnp.maximum(odd - 2 * before.curl * between**2, odd / SMOOTH)
    return Bending(bent, (bent - before.bent) / between, h, odd / between**2), h / 6 * _norm(four - five), kink


def _judged(options: Options, k: Any, level: Any, missed: Any, enough: Any) -> tuple[Any, Any]:
    """Whether a step is good, and which one is to be tried then."""
    done = ~(missed > enough) | (k <= 1)
    fewer = jnp.clip(exponent(jnp.sqrt(jnp.sqrt(enough / (missed + 1e-300)))), -4, -1)
    longer = jnp.where(GROWS * missed < enough, jnp.maximum(level, k + 1), level)
    return done, jnp.clip(jnp.where(done, longer, k + fewer), 1, options.halvings)


def _gone(stack: Any, y: Any, oscillators: tuple[Any, Any], kicks: tuple[Any, Any, Any]) -> tuple[Any, Any]:
    """(b, 2 p) after kicks with flows between them, and (3,) J given by loads, taken by dampers, done on contacts."""
    p = y.shape[1] // 2
    works, work = jnp.zeros((2, len(y))), jnp.zeros(len(y))
    for i, push in enumerate(kicks):
        work -= jnp.sum(push * (y[:, p:] + 0.5 * push), axis=1)
        y = y.at[:, p:].add(push)
        if i < 2:
            y, more = worked(stack, y, oscillators[i])
            works += more
    return y, jnp.concatenate([works, work[None]]).sum(axis=1)


def _held(options: Options, B: Bodies, h: Any, now: MotionState, last: StageForces, x: tuple[Any, ...]) -> Held:
    """What contacts hold: their state as their law's own step tells it, with the memory that was integrated; of their
    coordinates see `at_sample`."""
    states = list[Any]()
    for g, u, w, state, memory in zip(B.groups, last.places, last.speeds, now.held.states, x, strict=True):
        _, after = g.law.step(u, w, h, state)
        states.append((g.law.recalled(after, memory) if g.law.remembers else None) or after)
    return told(B.groups, last.places, h, now.held, options.accounts, tuple(states), last.forces)


def at_sample(B: Bodies, now: MotionState) -> Held:
    """With what contacts hold in their coordinates, which no step asks for."""
    q, _ = jnp.split(now.y, 2, axis=1)
    d = times(B.D, q.reshape(-1)) + times(B.D_o, now.o)
    return now.held._replace(d=d, force=joined(B.groups, now.held.forces))

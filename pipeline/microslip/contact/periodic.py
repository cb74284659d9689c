"""Periodic motion through a contact law: cycles are marched until what the sliders remember comes back with them.

Most points forget their beginning within a cycle. A point that slides a little in each cycle, always nearly the same
way, forgets it slowly: its force turns on the friction circle by a small angle per cycle. Where two marched cycles
differ, the memory x at which a cycle begins is therefore solved for, by Newton's method with the exact derivative of
the map P from it to the memory at the end, which costs two tangents more and is used again while it serves. Sliders
do not know of each other, so this is a 2 x 2 system for each.

A slider that does not slide at all keeps what the first cycle, from rest, has left in it; one that slides ever so
little forgets that in the end. Between both the limit of infinitely many cycles jumps, so what is solved is

    x = P(x) + d (x_1 - x)

with the memory x_1 after the first cycle and d = `RECALL`: the mean of all cycles with weights (1 + d)^-n, continuous
in the motion. It differs from the limit where less than d of the memory is forgotten in a cycle.

P brings two memories never further apart (friction and springs dissipate), so that cycle after cycle converges; a
slider that Newton's step does not bring closer goes on so for a while, longer each time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..programs import inner
from .cycle import SummedCycle, Ways, around, beginning, blank, cycle, first_memory, push, recall, turn, ways
from .law import Array, Law, Scalar, State, march
from .linearised import Linearised, linearised

FEWEST = 4
"""Cycles that have to be allowed if sliders are to be solved for; fewer are marched."""

RECALL = 1e-5
"""Share of its memory that a slider regains in a cycle from the first one."""

# Anything from 0.2 and 0.5 to 0.9 and 0.99 does: of 4000 random paths, 1500 of them slow, none took above 20 cycles.
_STRAIGHT = 0.5  # share of what was missing above which a cycle is marched before another step
_GAIN = 0.9  # share of it above which the step was in vain
_SERVES = 0.1  # share of Newton's step above which the next one asks for the derivative again, which is two cycles
_SOLVED = 1e-12  # share of the largest force to which sliders are solved for, as their error is in every answer


class Periodic(NamedTuple):
    """The last of the cycles.

    Attributes:
        force: (s, n, 3) N. state: at its end. cycles: how many were marched, without those for derivatives alone.
    """

    force: Array
    state: State
    cycles: Array


class _At(NamedTuple):
    """Between two marched cycles.

    Attributes:
        found: the last one. memory: at its end. change: of the memory over it, the largest entry. periodic: whether the
            memory is periodic.
    """

    found: Periodic
    memory: Array
    change: Array
    periodic: Array


class Known(NamedTuple):
    """What sliders were found to remember, to begin with where the motion is another one near by.

    Attributes:
        memory: (..., 2, n) N with which the periodic cycle begins. slope: (2, ..., 2, n) of the memory at its end by
            that, near by. told: (n,) whether anything is known.
    """

    memory: Any
    slope: Any
    told: Any


def unknown(law: Law, n: int) -> Known:
    """Nothing, of n points; of numpy, as operations one by one would compile a program each."""
    shape = jax.eval_shape(lambda law: law.memory(jnp.zeros((n, 3)), law.init(n)), law).shape
    return Known(np.zeros(shape), np.zeros((2, *shape)), np.zeros(n, dtype=bool))


class _Solving(NamedTuple):
    """Between two cycles of sliders that are solved for.

    Attributes:
        last: the last one. begun: the memory that it began with. memory: that the next one begins with. slope: of the
            memory at the end by that at the beginning, of the last cycle or an earlier one. renew: whether the next
            one is asked for it. tried: (..., n) what each slider missed of the solution when it was solved for last.
            solved: (..., n) whether the next beginning was solved for. failed: (..., n) how often that was in vain.
            wait: (..., n) cycles to march before it is tried again. cycles: how many. step: (..., n) N of Newton's
            method. missed: how far from the solution the farthest is, over the largest force. periodic: whether the
            memory is periodic.
    """

    last: SummedCycle
    begun: Array
    memory: Array
    slope: Array
    renew: Array
    tried: Array
    solved: Array
    failed: Array
    wait: Array
    cycles: Array
    step: Array
    missed: Array
    periodic: Array


@partial(inner, static_argnames="count")
def periodic(
    law: Law, path: Array, period: Scalar, count: int = 2, periodicity: Scalar = 0.0,
    rate: Array | None = None,
) -> Periodic:  # fmt: skip
    """Force in the last cycle of a periodic path, marched from rest.

    The memory is taken for periodic when Newton's step is within the tolerance. Of laws that cannot be solved for, or
    if fewer than `FEWEST` cycles are allowed: when what its change still sums up to, the rest of a geometric series
    with the ratio of the last two changes, is. The cycle that shows it is the one returned, so that a memory that one
    cycle makes periodic takes two.

    Args:
        path: (s, n, 3) m. period: s. count: of cycles at most. periodicity: tolerance as a share of the cycle's largest
            force; 0 marches all of them and solves for nothing. rate: (s, n, 3) m/s at the samples; backward
            differences if not given, of first order in the samples.
    """
    dt = period / len(path)
    rate = around(path, dt) if rate is None else rate
    if solves(law, count):
        return _Sliders(law, path, rate, dt, periodicity, count).periodic()[0]
    loop = _Loop(law, path, rate, dt, periodicity, count)
    return jax.lax.while_loop(loop.unfinished, loop.marching, loop.rest()).found


def near(
    law: Law, path: Array, rate: Array, period: Scalar, count: int, periodicity: Scalar,
    weights: Array, known: Known,
) -> tuple[Array, Known]:  # fmt: skip
    """Weighted sums of the force of `periodic`, begun with what is known of a path near by; and what is known then.

    The periodic memory is the only one there is, however it is begun. Laws that cannot be solved for are marched from
    rest.

    Args:
        rate: (s, n, 3) m/s. weights: (h, s) of the sums.

    Returns:
        (h, 3, n) N, and what is known.
    """
    if not solves(law, count):
        force = periodic(law, path, period, count, periodicity, rate).force
        return jnp.einsum("hs,snk->hkn", weights, force), known
    found = _Sliders(law, path, rate, period / len(path), periodicity, count, weights, known).solution
    told = jnp.isfinite(found.memory).all(axis=tuple(range(found.memory.ndim - 1)))
    return found.last.force, Known(found.memory, found.slope, told)


def with_slopes(
    law: Law, path: Array, rate: Array, period: Scalar, count: int, periodicity: Scalar,
    signals: Array, ahead: Array, weights: Array,
) -> tuple[Periodic, Array]:  # fmt: skip
    """`periodic` and the derivative of the force.

    Where sliders can be solved for it is that of the periodic state, from the tangents of the first cycle and those of
    the periodic one; otherwise tangents are marched along, and it is that of the cycles marched.

    Args:
        rate: (s, n, 3) m/s. signals: (s, w) m, by which all points move alike along each of n, t1 and t2. ahead:
            (s, w) m, their derivatives over the time in cycles. weights: (h, s).

    Returns:
        The cycle, and (h, w, 3, n, 3) weighted sums of the derivatives over its samples.
    """
    dt = period / len(path)
    if solves(law, count):
        return _Sliders(law, path, rate, dt, periodicity, count).slopes(signals, ahead / period, weights)
    return _Loop(law, path, rate, dt, periodicity, count).slopes(signals, ahead / period, weights)


def solves(law: Law, count: int) -> bool:
    """Whether sliders are solved for where so many cycles are allowed."""
    one = law.init(1)
    return count >= FEWEST and law.recalled(one, law.memory(jnp.zeros((1, 3)), one)) is not None


@dataclass(frozen=True, eq=False)
class _Loop:
    """A path through a law, again and again; arguments as in `periodic`."""

    law: Law
    path: Array
    rate: Array
    dt: Scalar
    periodicity: Scalar
    count: int

    def rest(self) -> _At:
        """Before the first cycle."""
        state, force = self.law.init(self.path.shape[1]), jnp.zeros(self.path.shape)
        found = Periodic(force, state, jnp.asarray(0))
        return _At(found, self.law.memory(force[-1], state), jnp.asarray(jnp.inf), jnp.asarray(False))

    def unfinished(self, at: _At) -> Array:
        """Whether to march on."""
        return (at.found.cycles < self.count) & ~at.periodic

    def marching(self, at: _At) -> _At:
        """One cycle more."""
        return self._marched(at, *march(self.law, self.path, self.dt, at.found.state, self.rate))

    def slopes(self, signals: Array, rates: Array, weights: Array) -> tuple[Periodic, Array]:
        """Tangents are marched along with every cycle."""

        def cycle(carried: tuple[_At, State, Array]) -> tuple[_At, State, Array]:
            at, tangents, _ = carried
            rows = self.path, self.rate, *moves
            (force, after), (slope, changed) = push(self.law, self.dt, at.found.state, tangents, rows)
            return self._marched(at, force, after), changed, jnp.einsum("ws,spnk->wpnk", weights, slope)

        each = (jnp.einsum("sw,jk->swjk", of, jnp.eye(3)) for of in (signals, rates))
        moves = tuple(of.reshape(len(signals), -1, 3) for of in each)
        size, rest = moves[0].shape[1], self.rest()
        begin = rest, blank(rest.found.state, size), jnp.zeros((len(weights), size, *self.path.shape[1:]))
        at, _, slope = jax.lax.while_loop(lambda c: self.unfinished(c[0]), cycle, begin)
        return at.found, slope.reshape(len(weights), -1, 3, *self.path.shape[1:])

    def _marched(self, at: _At, force: Array, state: State) -> _At:
        memory = self.law.memory(force[-1], state)
        change, ended = self._change(at, force, memory)
        return _At(Periodic(force, state, at.found.cycles + 1), memory, change, ended)

    def _change(self, at: _At, force: Array, memory: Array) -> tuple[Array, Array]:
        """Largest change of the memory over the cycle, and whether it is periodic as `periodic` says of marching."""
        first = at.found.cycles == 0  # began where no cycle ends, though an open contact's memory may be the same
        change = jnp.where(first, jnp.inf, jnp.abs(memory - at.memory).max())
        gap, size = at.change - change, jnp.abs(force).max()
        left = jnp.where(gap > 0, change**2 / jnp.where(gap > 0, gap, 1.0), jnp.inf)
        rounding = change <= jnp.minimum(self.periodicity, 1e-15) * size
        return change, rounding | (jnp.maximum(change, left) <= self.periodicity * size)


class _Sliders:
    """A path through a law whose sliders are solved for; arguments as in `periodic` and `near`."""

    def __init__(
        self, law: Law, path: Array, rate: Array, dt: Scalar, periodicity: Scalar, count: int,
        weights: Array | None = None, known: Known | None = None,
    ) -> None:  # fmt: skip
        self.law, self.path, self.dt, self.periodicity, self.count = law, path, dt, periodicity, count
        self.weights = jnp.zeros((len(path), 0)) if weights is None else weights.T
        self.known = unknown(law, path.shape[1]) if known is None else known
        self.rest = law.memory(jnp.zeros(path.shape[1:]), law.init(path.shape[1]))
        self.ways: Ways = ways(law, path, rate, dt)
        self.first = first_memory(law, self.ways, self.rest)

    @cached_property
    def solution(self) -> _Solving:
        """Cycles that begin where Newton's method puts them."""
        known, solved = self.known, jnp.asarray(self.periodicity) > 0
        new = ~(known.told.all() & solved)
        memory = jnp.where(new, self.first, known.memory)
        each, W = jnp.zeros((*memory.shape[:-2], memory.shape[-1])), self.weights.shape[1]
        counted, none = each.astype(int), SummedCycle(jnp.zeros((W, 3, len(known.told))), jnp.zeros(()), memory)
        begin = _Solving(
            none, memory, memory, known.slope, new & solved, each + jnp.inf, each > 0, counted, counted,
            jnp.asarray(1), each + jnp.inf, jnp.asarray(jnp.inf), jnp.asarray(False),
        )  # fmt: skip
        return jax.lax.while_loop(lambda at: (at.cycles < self.count) & ~at.periodic, self._solving, begin)

    def periodic(self) -> tuple[Periodic, Array]:
        """See `periodic`, and (s, ..., 2, n) the memory that every step begins with."""
        at, placed = self.solution, jax.tree_util.tree_map(lambda leaf: leaf[-1], self.ways.placed)
        last = cycle(self.law, self.ways.all, at.begun)
        return Periodic(last.force.swapaxes(1, 2), self.law.recalled(placed, last.memory), at.cycles), last.begun

    def slopes(self, signals: Array, rates: Array, weights: Array) -> tuple[Periodic, Array]:
        """Tangents of the first cycle, which sliders that stick keep, and of the periodic one."""
        whole, last_begun = self.periodic()
        first_begun = cycle(self.law, beginning(self.ways.all, self.ways.first), self.rest).begun
        found = jax.lax.map(
            lambda of: linearised(self.law, self.path, self.dt, self.ways, of[0], of[1], signals, rates, weights),
            (jnp.stack([first_begun, last_begun]), jnp.array([False, True])),
        )  # fmt: skip
        first, last = (Linearised(*(leaf[k] for leaf in found)) for k in (0, 1))
        begin = _Newton(last.by_memory)(last.memory + RECALL * first.memory)
        return whole, jnp.einsum("hwkin->hwkni", last.begun_with(begin))

    def _solving(self, at: _Solving) -> _Solving:
        """One cycle more, and the next begins where Newton's method expects the solution."""
        given = self.law, self.ways.all, self.weights, at.memory
        last, slope = jax.lax.cond(at.renew, lambda: recall(*given), lambda: (turn(*given), at.slope))
        memory, size, newton = last.memory, last.size, _Newton(slope)
        missing = memory - at.memory + RECALL * (self.first - at.memory)
        left = _length(missing)
        step = jnp.where((left > 1e-15 * size)[..., None, :], newton(missing), 0.0)  # below is rounding

        # the step is straight, the circle is not: a cycle brings it back
        across = at.solved & (left > _STRAIGHT * at.tried)
        ready = ~across & (at.wait == 0)
        vain = ready & ~at.solved & (left > _GAIN * at.tried)
        failed = at.failed + vain
        wait = jnp.where(vain, failed, jnp.maximum(at.wait - 1, 0))
        use = ready & ~vain & newton.regular & (self.periodicity > 0)
        tried = jnp.where(vain, jnp.inf, jnp.where(use, left, at.tried))  # after waiting it is tried whatever is left
        marched = jnp.where(self.periodicity > 0, (memory + RECALL * self.first) / (1 + RECALL), memory)
        held = jnp.where(use[..., None, :], at.memory + step, marched)
        long = _length(step)
        missed = jnp.where(at.renew, long, _still(long, at.step)).max() / jnp.where(size > 0, size, 1.0)
        ended, renew = missed <= jnp.minimum(self.periodicity, _SOLVED), missed > _SERVES * at.missed
        on, count = jnp.asarray(self.periodicity > 0), at.cycles + 1
        return _Solving(
            last, at.memory, held, slope, renew & on, tried, use, failed, wait, count, long, missed, ended & on
        )  # fmt: skip


def _still(step: Array, before: Array) -> Array:
    """How far it is to the solution by a derivative of another cycle, (..., n): steps go on shrinking as they did.

    A derivative that is wrong, as that of a slider which has begun to stick, makes short steps of a long way."""
    shrunk = jnp.where(before < jnp.inf, jnp.minimum(step / jnp.where(before > 0, before, 1.0), 1.0), 1.0)
    return jnp.where(step > 0, step / jnp.maximum(1 - shrunk, 1e-9), 0.0)


def _length(memory: Array) -> Array:
    """(..., n) of (..., 2, n)."""
    return jnp.sqrt(jnp.sum(memory**2, axis=-2))


class _Newton:
    """((1 + d) I - P')^-1 of every slider, where it is regular, as it is of laws that dissipate; elsewhere I.

    P' (2, ..., 2, n): derivative along the two directions of the start.
    """

    def __init__(self, slope: Array) -> None:
        a, b = 1 + RECALL - slope[0, ..., 0, :], -slope[1, ..., 0, :]
        c, d = -slope[0, ..., 1, :], 1 + RECALL - slope[1, ..., 1, :]
        found = a * d - b * c
        self.regular = found > 0
        over = jnp.where(self.regular, 1 / jnp.where(self.regular, found, 1.0), 1.0)
        one, none = jnp.ones_like(a), jnp.zeros_like(a)
        a, b, c, d = (jnp.where(self.regular, x, y) for x, y in ((a, one), (b, none), (c, none), (d, one)))
        self.rows = over * jnp.stack([d, -b]), over * jnp.stack([-c, a])

    def __call__(self, change: Array) -> Array:
        """(..., 2, n) of (..., 2, n)."""
        first, second = change[..., 0, :], change[..., 1, :]
        return jnp.stack([row[0] * first + row[1] * second for row in self.rows], axis=-2)

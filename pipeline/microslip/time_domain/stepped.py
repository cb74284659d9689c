"""Motions in time that are left to themselves at one frequency after the other, each begun where the last one ended: a
stepped sweep, as on a shaker."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from ..data import Array
from ..interrupts import look
from ..system.assembly import Assembly
from . import equations, orbit, starts
from . import samples as kept_samples
from .bodies import MotionState, Sample
from .contacts import untouched
from .stepper import KINDS, Stepper

SAMPLES, KEPT = 32, 32
"""Of a period, and periods in which a motion is looked at."""

OF_CONTACT = 12
"""Steps in a period of the fastest motion with closed contacts, fewer than where a motion itself is
asked for. With 8, 16 and 40 amplitudes of a lap joint that opens and of a shrouded blade differ by
0.5 %, less than `SETTLED`."""

LOOKS = 8
"""Times at most that a motion is looked at."""

SETTLED = 0.01
"""Share by which the amplitude may differ from that of the last look when a motion counts as
settled, and a quarter of the spread of its swings besides: that of an irregular motion is not known
better by `KEPT` periods."""

DYING = 0.8
"""Times what swings differed by at the last look, below which what is left of the start still dies
away."""

PORTION = 0.25
"""s of CPU time, about, between two looks at what is left of it."""

IRREGULAR = 0.15
"""Share of the largest swing by which that of a period may be less in a motion that counts as regular; small impacts
among many points leave some hundredths. Half and twice of it give the quick tests the same answers."""

BESIDE = 0.1
"""Share of the way back to where the last motion ended, by which one that begins on a solution of a
harmonic balance is put beside it: an unstable one is left."""

LOST = 0.2
"""Share by which an amplitude changes in a step in which a motion is lost. Half and twice of it find the same
ends of the bistable motion of the tests."""


@dataclass(frozen=True, eq=False)
class SettledMotion:
    """What a motion is at a frequency when it has been left to itself.

    Attributes:
        frequency: Hz. amplitude: 0-peak of the first harmonic of the first read-out over `KEPT` periods, in its unit.
            swing: half of what it spans in the wildest of them, and least: in the calmest. opens: whether a contact
            does. end: where it is after whole periods: (b, 2 p) as `MotionState.y`, then all that contacts
            hold.
    """

    frequency: float
    amplitude: float
    swing: float
    least: float
    opens: bool
    end: Sequence[Array]

    @property
    def irregular(self) -> bool:
        """Whether its swings differ from period to period."""
        return not self.swing - self.least <= IRREGULAR * self.swing

    def like(self, amplitude: float, within: float = IRREGULAR) -> bool:
        """Whether another amplitude is its own, to a share of the larger one."""
        return abs(self.amplitude - amplitude) <= within * max(self.amplitude, amplitude)

    def distance(self, other: SettledMotion) -> float:
        """Of amplitudes; infinite where one of them is no number."""
        return float(np.nan_to_num(abs(self.amplitude - other.amplitude), nan=np.inf))

    def jumps_to(self, after: SettledMotion) -> bool:
        """Whether the motion is lost in a step: amplitude and swings are other ones."""
        apart = after.swing < self.least or self.swing < after.least
        return not after.like(self.amplitude, LOST) and (apart or not np.isfinite(after.swing))


class TimeIsOver(Exception):
    """A motion that has not settled within its time."""


class _Clock:
    """CPU time (s) that a motion may take, without the first period of each kind, which compiles."""

    def __init__(self, stepper: Stepper, patience: float) -> None:
        self.stepper, self.left = stepper, patience

    def advanced(self, now: MotionState, steps: Array, periods: int) -> tuple[MotionState, Sample, Array]:
        """As `Stepper.advanced` over some periods, in portions that take about `PORTION` each.

        Raises:
            TimeIsOver: before the last of them.
        """
        samples, listed, done, ahead = list[Sample](), list[Array](), 0, 1
        each = 1 if len(steps) == SAMPLES else SAMPLES  # rows of a period
        while done < periods:
            if self.left <= 0:
                raise TimeIsOver
            look()
            began = time.process_time()
            now, seen, events, *_ = self.stepper.advanced(now, steps, ahead * each)
            took = time.process_time() - began
            self.left -= took if done else 0.0
            samples.append(seen)
            listed.append(events)
            done += ahead
            if not np.isfinite(seen.mechanical[-1]):
                break
            longer = int(np.clip(PORTION / max(took, 1e-6) * ahead, 1, orbit.FURTHER * ahead))
            ahead = min(longer, periods - done)
        joined = Sample(*(np.concatenate(parts) for parts in zip(*samples, strict=True)))
        return now, joined, np.concatenate(listed)


def settled(
    assembly: Assembly,
    frequency: float,
    most: int,
    begin: SettledMotion | None = None,
    balance: Callable[[equations.MotionEquations], starts.PeriodicStart] | None = None,
    known: Sequence[float] = (),
    patience: float = math.inf,
) -> SettledMotion:
    """The motion at a frequency (Hz), looked at until it does not change any more or `most` periods are over.

    Args:
        begin: where it begins; at rest under the steady loads if not given. balance: a periodic
            motion on which it begins instead, but for `BESIDE`. known: amplitudes of motions at
            this frequency; one that has come to one of them has settled. patience: s of CPU time.

    Raises:
        UserError: what has no form in time, see `equations.of`. NotConverged: no rest is found.
        TimeIsOver: it has not settled before.
    """
    e = equations.of(assembly, 2 * np.pi * frequency)
    steps = max(orbit.OF_PERIOD, int(np.ceil(OF_CONTACT * e.fastest / e.Omega)))
    each = orbit.steps_of_a_sample(e, SAMPLES, steps)
    stepper = Stepper(e, 2 * np.pi / e.Omega / (each * SAMPLES), accounts=False)
    now, clock = _begun(stepper, begin, balance(e) if balance else None), _Clock(stepper, patience)
    turning = 2 * np.exp(-2j * np.pi * np.arange(1, KEPT * SAMPLES + 1) / SAMPLES)
    unseen, known, varies = max(most // LOOKS - KEPT, 1), [*known, np.inf], np.inf
    for _ in range(LOOKS):
        now = clock.advanced(now, np.full(SAMPLES, each * SAMPLES), unseen)[0]
        now, seen, events = clock.advanced(now, np.full(KEPT * SAMPLES, each), KEPT)
        y = kept_samples.read(e, seen)[0]
        end = [np.asarray(x) for x in (now.y, *jax.tree_util.tree_leaves(now.held))]
        if len(y) < len(turning) or not np.isfinite(seen.mechanical[-1]):
            return SettledMotion(frequency, np.nan, np.nan, np.nan, True, end)
        spans = 0.5 * np.ptp(y.reshape(KEPT, SAMPLES), axis=1)
        amplitude, before, varies = float(abs(np.mean(turning * y))), varies, float(np.ptp(spans))
        spread = varies / max(spans.max(), 1e-300)
        within = (SETTLED + 0.25 * spread) * amplitude
        steady = spread <= 2 * SETTLED or varies > DYING * before
        if steady and np.abs(np.array(known) - amplitude).min() <= within:
            break
        known[-1] = amplitude
    opens = bool((events[:, 2] == KINDS.index("opens")).any())
    return SettledMotion(frequency, amplitude, float(spans.max()), float(spans.min()), opens, end)


def _begun(stepper: Stepper, begin: SettledMotion | None, balance: starts.PeriodicStart | None) -> MotionState:
    """At rest, where a motion ended, or on a periodic one, a little on the way to where the other
    ended."""
    if balance is not None:
        now = starts.begun(stepper, balance)
        if begin is None:
            return now
        y, held = np.asarray(now.y), now.held
        y = y + BESIDE * (begin.end[0] - y)
    elif begin is not None:
        leaves, tree = jax.tree_util.tree_flatten(untouched(stepper.groups))
        typed = [jnp.asarray(x, like.dtype) for x, like in zip(begin.end[1:], leaves, strict=True)]
        y, held = begin.end[0], jax.tree_util.tree_unflatten(tree, typed)
    else:
        return stepper.start(*orbit.begun(stepper.equations, "static"))
    q, v = np.split(y, 2, axis=1)
    return stepper.start(q.ravel(), v.ravel(), held=held)

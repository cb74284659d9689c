"""Sweeps in time: motions that are left to themselves at one frequency after the other, each begun where the last one
ended, as on a shaker; about a place where a response jumps or leaves a gap downwards, upwards, and from rest where both
are on different motions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..data import Array
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.reduced import stuck, stuck_damping
from ..harmonic_balance.reduced import untouched as free
from ..harmonic_balance.response import HarmonicResponse, between, operating
from ..harmonic_balance.solver import Point
from ..interrupts import look
from ..progress import Report
from ..results import Journal
from ..results.names import exact
from ..system.assembly import Assembly
from . import equations, orbit, starts
from .bodies import MotionState, Snapshot
from .contacts import untouched
from .samples import read
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

    def advanced(self, now: MotionState, steps: Array, periods: int) -> tuple[MotionState, Snapshot, Array]:
        """As `Stepper.advanced` over some periods, in portions that take about `PORTION` each.

        Raises:
            TimeIsOver: before the last of them.
        """
        samples, listed, done, ahead = list[Snapshot](), list[Array](), 0, 1
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
        joined = Snapshot(*(np.concatenate(parts) for parts in zip(*samples, strict=True)))
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
        y = read(e, seen)[0]
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


# about a gap of a response ------------------------------------------------------------------------------------------

FEWEST, MOST = 300, 800
"""Periods at most that a motion is left to itself at a frequency, with much and with little
damping."""

FORGOTTEN = 4.0
"""Natural logarithm by which a vibration of the bodies dies away in them."""

LOWEST = 0.5
"""Share of the first frequency of a sweep down to which a motion is followed that does not fall
back in the band."""

DOWN, UP, REST = "downwards", "upwards", "from rest"

SHARES = {DOWN: 0.35, UP: 0.6, REST: 0.7}
"""Of the time at a place, until which each of the ways goes on; the rest is for the curve. Half or
twice of them cuts a sweep elsewhere, and what is found in all of its time is the same."""

WITHIN, STEPS = 30, 80
"""Frequencies of a sweep in time within a gap, and of all of it, at most."""

HALVINGS = 3
"""Times that a step in which a motion is lost is halved."""

ALIKE = 2
"""Frequencies one after the other at which a motion is that of the sweep when it counts as having
come back to it."""

SAME = 0.05
"""Share by which a motion may differ from the harmonic balance's that leads it on to the next
frequency. Half and twice of it give the quick tests the same answers."""


class SweptMotions(NamedTuple):
    """Swept upwards and downwards, in that order, and each from rest; the way and the frequency
    (Hz) before which the time was over, None: it was enough; spent: s of it."""

    up: Sequence[SettledMotion] = ()
    down: Sequence[SettledMotion] = ()
    rest: Sequence[SettledMotion] = ()
    cut: tuple[str, float] | None = None
    spent: float = 0.0


def on_two_motions(
    up: Sequence[SettledMotion], down: Sequence[SettledMotion]
) -> list[tuple[SettledMotion, SettledMotion]]:
    """The lower and the higher motion where two sweeps are on different ones, by frequency."""
    upwards = {m.frequency: m for m in up}
    pairs = [(upwards[m.frequency], m) for m in down if m.frequency in upwards]
    pairs = [(a, b) for a, b in pairs if not a.like(b.amplitude)]
    ordered = [(a, b) if a.amplitude < b.amplitude else (b, a) for a, b in pairs]
    return sorted(ordered, key=lambda pair: pair[0].frequency)


def nearer(m: SettledMotion, low: SettledMotion, high: SettledMotion) -> bool:
    """Whether a motion is the higher one of two."""
    return abs(m.amplitude - high.amplitude) < abs(m.amplitude - low.amplitude)


def _periods(problem: Problem, gap: tuple[float, float]) -> int:
    """How long motions are left to themselves, by the least damping of the modes about a gap, stuck
    and free."""
    part = problem.assembly.joined(1)
    pairs = [(part, problem.assembly.stiffness), (free(part), np.zeros((0, 0)))]
    f, D = (np.concatenate([of(part_of, k) for part_of, k in pairs]) for of in (stuck, stuck_damping))
    about = D[(f > 0.5 * gap[0]) & (f < 2 * gap[1]) & (D > 0)]
    wanted = FORGOTTEN / (2 * np.pi * about.min(initial=1.0))
    return int(np.clip(wanted, FEWEST, MOST))


class Sweeps:
    """Sweeps in time about a gap (Hz, Hz) of a response under a normal force (N).

    patience: s of CPU time at the place, of which they take `SHARES`, that of an earlier run
    counted, but not what compiles; a motion that would take longer is cut. journal:
    keeps each motion that is not; those of an earlier run are gone on with.
    """

    def __init__(
        self,
        problem: Problem,
        found: HarmonicResponse,
        gap: tuple[float, float],
        normal: float,
        report: Report,
        patience: float,
        journal: Journal | None = None,
    ) -> None:
        self.problem, self.gap, self.normal, self.report = problem, gap, normal, report
        self.patience, self.spent, self.compiled = patience, 0.0, False
        self.journal = journal
        self.cut: tuple[str, float] | None = None
        self.asked = found.frequency[found.asked]
        self.step = float(np.median(np.diff(self.asked)))
        self.periods = _periods(problem, gap)
        self.balanced = {
            float(f): (Point(2 * np.pi * f, x), float(amplitude))
            for f, x, amplitude, good in zip(
                found.frequency, found.x, np.abs(found.monitor), found.converged, strict=True
            )
            if good
        }
        self.seen = {f: [amplitude] for f, (_, amplitude) in self.balanced.items()}

    def motions(self) -> SweptMotions:
        """All of them, or those for which the time was enough.

        Raises:
            UserError, NotConverged: see `settled`.
        """
        low, high = self.gap
        below, above = self.asked[self.asked < low].tolist(), self.asked[self.asked > high].tolist()
        within = self.asked[(self.asked >= low) & (self.asked <= high)]
        inside = within[:: 1 + len(within) // WITHIN].tolist()
        beneath = np.arange(1, (1 - LOWEST) * self.asked[0] / self.step) * self.step
        under = [*below[::-1], *(self.asked[0] - beneath).tolist()]
        down, fell = self._way(DOWN, [*above[1::-1], *inside[::-1], *under], low, -1.0, [])
        back = [m.frequency for m in down[-2::-1]] if fell else [*below[-2:], *inside, *above[:2]]
        further = [f for f in above if f > max(back)]
        up, _ = self._way(UP, [*back, *further], high, 1.0, down[-1:] if fell else [])
        rest = self._from_rest(on_two_motions(up, down))
        return SweptMotions(up, down, rest, self.cut, self.spent)

    def _from_rest(self, two: Sequence[tuple[SettledMotion, SettledMotion]]) -> list[SettledMotion]:
        """Motions from rest where there are two, at some frequencies, and between those that lead
        to different ones."""
        last, motions = len(two) - 1, dict[int, SettledMotion]()
        wanted = sorted({round(i * last / 3) for i in range(4)}) if two else []
        while wanted:
            for i in wanted:
                if (motion := self._at(REST, two[i][0].frequency)) is None:
                    return [motions[i] for i in sorted(motions)]
                motions[i] = motion
            seen = sorted(motions)
            higher = [nearer(motions[i], *two[i]) for i in seen]
            pairs = zip(pairwise(seen), pairwise(higher), strict=True)
            wanted = [(i + j) // 2 for (i, j), (a, b) in pairs if a != b and j > i + 1]
        return [motions[i] for i in sorted(motions)]

    def _way(
        self, way: str, frequency: Sequence[float], end: float, sign: float, motions: list[SettledMotion]
    ) -> tuple[list[SettledMotion], bool]:
        """A stepped sweep that goes on from motions, and whether it has come back to the harmonic
        balance's beyond an end of the gap (Hz), where it ends."""
        alike = 0
        for f in frequency[:STEPS]:
            if not (steps := self._on(way, f, motions[-1] if motions else None)):
                break
            motions = [*motions, *steps]
            back = sign * (f - end) > 0 and motions[-1].like(self._balanced(f)[1])
            alike = alike + 1 if back else 0
            if alike == ALIKE or not np.isfinite(motions[-1].amplitude):
                break
        return motions, alike == ALIKE

    def _on(self, way: str, f: float, begin: SettledMotion | None) -> list[SettledMotion]:
        """A step to a frequency (Hz). Where the motion is lost in it, the step is halved about the
        place: a sweep that is slow enough stays longer."""
        here = self._at(way, f, begin)
        if here is None:
            return []
        if begin is None or self._led(f, begin, here):
            return [here]
        steps = [begin, here]
        for _ in range(HALVINGS):
            i = int(np.argmax([a.distance(b) for a, b in pairwise(steps)]))
            middle = 0.5 * (steps[i].frequency + steps[i + 1].frequency)
            if not steps[i].jumps_to(steps[i + 1]):
                break
            if (motion := self._at(way, middle, steps[i])) is None:
                break
            steps.insert(i + 1, motion)
        if len(steps) > 2 and steps[-2].jumps_to(here):  # the whole step may have thrown it off
            steps[-1] = self._at(way, f, steps[-2]) or here
        return steps[1:]

    def _at(self, way: str, f: float, begin: SettledMotion | None = None) -> SettledMotion | None:
        """The motion at a frequency (Hz), as it was kept or integrated now; None where the time is
        over that its way may take."""
        until = SHARES[way] * self.patience
        low, high = self.gap
        series = f"in time {way}, F_N = {exact(self.normal)} N, {low!r} to {high!r} Hz"
        series += f", after {begin.frequency!r} Hz" if begin else ""
        after = repr(begin.amplitude) if begin else ""
        row = self.journal.of(series).get(f, {}) if self.journal else {}
        try:
            if self.spent > until:
                raise TimeIsOver
            if row.get("after") != after:
                self.report(f"motion in time, {way}, F_N = {self.normal:g} N: {f:.6g} Hz")
                row = self._integrated(way, f, begin, until - self.spent) | {"after": after}
                if self.journal:
                    self.journal.keep(series, f, row)
        except TimeIsOver:
            self.spent, self.cut = max(self.spent, until), self.cut or (way, f)
            return None
        self.spent += row["took"]
        end = [np.asarray(row[f"end/{i}"]) for i in range(row["leaves"])]
        amplitude, swing, least = (row[name] for name in ("amplitude", "swing", "least"))
        m = SettledMotion(f, amplitude, swing, least, bool(row["opens"]), end)
        self.seen.setdefault(f, []).extend([] if m.irregular else [m.amplitude])
        return m

    def _integrated(self, way: str, f: float, begin: SettledMotion | None, left: float) -> dict:
        """What a journal keeps of a motion, with the CPU time (s) that it took beside compiling.

        Raises:
            TimeIsOver: more than is left (s).
        """
        began, point = time.process_time(), None if way == REST else self._leading(f, begin)
        on = partial(starts.of_point, problem=self.problem, point=point) if point else None
        seen = self.seen.get(f, ())
        m = settled(self.problem.assembly, f, self.periods, begin, on, seen, left)
        took = time.process_time() - began if self.compiled else 0.0
        self.compiled = True
        end = {f"end/{i}": x for i, x in enumerate(m.end)}
        numbers = {name: getattr(m, name) for name in ("amplitude", "swing", "least", "opens")}
        return numbers | end | {"leaves": len(end), "took": took}

    def _leading(self, f: float, begin: SettledMotion | None) -> Point | None:
        """The solution of the harmonic balance to begin on: at the first frequency (Hz), and while
        the motion is its, on the same side of the gap."""
        if begin is None:
            return self.balanced.get(f, (None, 0.0))[0]
        low, high = self.gap
        same_side = max(f, begin.frequency) <= low or min(f, begin.frequency) >= high
        before = self.balanced.get(begin.frequency)
        leads = same_side and before is not None and begin.like(before[1], SAME)
        return self._balanced(f)[0] if leads else None

    def _led(self, f: float, begin: SettledMotion, here: SettledMotion) -> bool:
        """Whether a motion stays the harmonic balance's in a step to a frequency (Hz), however far
        its amplitude goes."""
        leads = self._leading(f, begin) is not None
        return leads and here.like(self._balanced(f)[1], SAME)

    def _balanced(self, f: float) -> tuple[Point | None, float]:
        """Solution and amplitude of the harmonic balance at a frequency (Hz); None and nan where it
        has none."""
        if f not in self.balanced:
            point = between(self.problem, [p for p, _ in self.balanced.values()], f)
            if not point.converged:
                return None, np.nan
            self.balanced[f] = point, float(abs(operating(self.problem, point).outputs[0, 1]))
        return self.balanced[f]

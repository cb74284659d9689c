"""What moves where a sweep jumps, ends at a fold or leaves a gap: motions in time, from rest and swept up and down, and
the whole curve of periodic motions, stable or not.

A harmonic balance finds periodic motions, stable or not, and says neither which of several is reached nor whether one
is left at all. Motions in time do.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Array
from ..errors import NotConverged, UserError
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.reduced import stuck, stuck_damping, untouched
from ..harmonic_balance.refinement import between
from ..harmonic_balance.response import HarmonicResponse, operating
from ..harmonic_balance.solver import CONVERGED, Point
from ..harmonic_balance.stability import Settings as Multipliers
from ..harmonic_balance.stability import Stability, orbit, stability
from ..time_domain.stepped import Settled, settled
from ..units import Quantity, counted, percent
from .assemble import build
from .curves import Followed, Keep, curves
from .problem import problem_of
from .questions import CurveOfCase
from .settings import CaseSettings
from .surveys import Bases

Report = Callable[[str], None]

FEWEST, MOST = 300, 800
"""Periods at most that a motion is left to itself at a frequency, with much and with little damping."""

FORGOTTEN = 4.0
"""Natural logarithm by which a vibration of the bodies dies away in them."""

LOWEST = 0.5
"""Share of the first frequency of a sweep down to which a motion is followed that does not fall back in the band."""

SHARES = {"downwards": 0.5, "upwards": 0.85, "from rest": 1.0}
"""Of the time that motions may take, until which each of the ways goes on."""

WITHIN, STEPS = 30, 80
"""Frequencies of a sweep in time within a gap, and of all of it, at most."""

LONG = 120.0
"""s that a motion at a frequency may take in a sweep that nobody asked for, and the stability of a
curve, but for what compiles."""

LOST, HALVINGS = 0.2, 3
"""Share by which an amplitude changes in a step in which a motion is lost, and how often such a step is halved."""

ALIKE = 2
"""Frequencies one after the other at which a motion is that of the sweep when it counts as having come back to it."""


@dataclass(frozen=True)
class Beyond:
    """Motions in time under a normal force.

    Attributes:
        normal: N. gap: Hz, Hz, where it is looked. up, down: swept upwards and downwards, in that order. rest: each
            from rest. quantity: what is read. why: why there are none. cut: where they ended for
            want of time. curves: of periodic motions, with so many
            samples of a cycle. stability: of each of them some points, by their place.
    """

    normal: float
    gap: tuple[float, float] = (0.0, 0.0)
    up: Sequence[Settled] = ()
    down: Sequence[Settled] = ()
    rest: Sequence[Settled] = ()
    quantity: Quantity = field(default_factory=Quantity)
    why: str = ""
    cut: str = ""
    curves: Sequence[Followed] = ()
    samples: int = 0
    stability: Sequence[Mapping[int, Stability]] = ()

    @property
    def two(self) -> list[tuple[Settled, Settled]]:
        """The lower and the higher motion where sweeps upwards and downwards are on different ones, by frequency."""
        known = {one.frequency: one for one in self.up}
        pairs = [(known[d.frequency], d) for d in self.down if d.frequency in known]
        apart = [
            sorted(pair, key=lambda m: m.amplitude)
            for pair in pairs
            if not pair[0].like(pair[1].amplitude)
        ]
        return sorted(((low, high) for low, high in apart), key=lambda pair: pair[0].frequency)

    @property
    def irregular(self) -> list[Settled]:
        """Motions without a period."""
        return [m for m in (*self.up, *self.down, *self.rest) if m.irregular]

    def rows(self) -> list[dict[str, float | str]]:
        """A row a motion, for tables."""
        column = self.quantity.column
        return [
            {
                "normal_force_N": self.normal,
                "way": way,
                "frequency_Hz": m.frequency,
                column("amplitude"): m.amplitude,
                column("swing"): m.swing,
                "contacts": "open" if m.opens else "closed",
                "motion": "irregular" if m.irregular else "regular",
            }
            for way, motions in (
                ("from rest", self.rest),
                ("upwards", self.up),
                ("downwards", self.down),
            )
            for m in motions
        ]

    @property
    def band(self) -> tuple[float, float]:
        """Hz, Hz, of all that was looked at."""
        at = [*self.gap, *(m.frequency for m in (*self.up, *self.down))]
        return min(at), max(at)

    def columns(self) -> list[dict[str, Array]]:
        """A table of each curve; ``stable`` is nan where that was not looked at."""
        found = []
        for one, looked in zip(self.curves, self.stability, strict=True):
            stable = np.full(len(one.rows), np.nan)
            stable[list(looked)] = [s.stable for s in looked.values()]
            found.append({**one.columns(), "stable": stable})
        return found

    def sentences(self) -> list[str]:
        """Which motion is reached from rest, which other ones there are, how high, and how they are reached; what the
        curve of periodic motions is and whether it is stable."""
        return [*self._in_time(), *map(_of_curve, self.curves), *self._stable()]

    def _stable(self) -> list[str]:
        """How many of the motions on the curves are stable, and where some are not."""
        looked = [
            (float(one.parameter[i]), s)
            for one, each in zip(self.curves, self.stability, strict=True)
            for i, s in each.items()
        ]
        lost = sorted(f for f, s in looked if not s.stable)
        if not looked:
            return []
        said = f"On the curve, by harmonic balance with {self.samples} samples of a cycle, "
        said += f"{len(looked) - len(lost)} of {counted(len(looked), 'motion')} that were looked at are stable"
        if not lost:
            return [f"{said}."]
        where = (
            f"at {lost[0]:.5g} Hz"
            if len(lost) == 1
            else f"between {lost[0]:.5g} and {lost[-1]:.5g} Hz"
        )
        return [
            f"{said}; those that are not, {where}, are not reached: what is, motions in time say."
        ]

    def _in_time(self) -> list[str]:
        of = f"Under F_N = {self.normal:g} N"
        if self.why:
            return [
                f"{of} motions in time are not known: {self.why}; respond --over frequency follows the curve."
            ]
        if not self.down:
            return []
        cut = [self.cut] if self.cut else []
        if cut and not self.two:
            return [f"{of} motions in time are known in part{self._gap()}.", *cut, *self._wild()]
        if not (two := self.two):
            return [
                f"{of} sweeps in time, upwards and downwards, meet the same motion{self._gap()}.",
                *self._wild(),
            ]
        low, high = two[0][0].frequency, two[-1][0].frequency
        top = max((pair[1] for pair in two), key=lambda m: m.swing)
        where = f"at {low:.5g} Hz" if low == high else f"from {low:.5g} to {high:.5g} Hz"
        said = [
            f"{of} there are two motions {where}, found by integrating in time; the higher one swings by up to "
            f"{self._size(top.swing)} at {top.frequency:.5g} Hz."
        ]
        return [*said, *self._from_rest(two), *self._left(two), *cut, *self._wild()]

    def _size(self, value: float) -> str:
        return self.quantity.sized(value, 3)

    def _gap(self) -> str:
        top = max(self.down, key=lambda m: m.swing)
        return f", at most {self._size(top.swing)} at {top.frequency:.5g} Hz"

    def _from_rest(self, two: Sequence[tuple[Settled, Settled]]) -> list[str]:
        """Which of two motions is reached from rest, in ranges of frequency."""
        at = {low.frequency: (low, high) for low, high in two}
        known = sorted((m for m in self.rest if m.frequency in at), key=lambda m: m.frequency)
        if not known:
            return []
        higher = [nearer(m, *at[m.frequency]) for m in known]
        runs, begin = list[str](), 0
        for i in range(1, len(known) + 1):
            if i == len(known) or higher[i] != higher[begin]:
                a, b = known[begin], known[i - 1]
                span = (
                    f"at {a.frequency:.5g} Hz"
                    if a is b
                    else f"from {a.frequency:.5g} to {b.frequency:.5g} Hz"
                )
                top = max(known[begin:i], key=lambda m: m.amplitude)
                words = "higher" if higher[begin] else "lower"
                open_ = (
                    "contacts open" if any(m.opens for m in known[begin:i]) else "contacts closed"
                )
                runs.append(
                    f"the {words} one {span} ({open_}, at most {self._size(top.amplitude)})"
                )
                begin = i
        return [f"From rest it comes to {', to '.join(runs)}."]

    def _left(self, two: Sequence[tuple[Settled, Settled]]) -> list[str]:
        """Where each sweep leaves the motion on which it comes."""
        said = []
        for way, motions, pair, on in (
            ("upwards", self.up, two[-1], "up"),
            ("downwards", self.down, two[0], "down"),
        ):
            at = next(i for i, m in enumerate(motions) if m.frequency == pair[0].frequency)
            which = "lower" if motions[at] is pair[0] else "higher"
            at = next((i for i in range(at, len(motions) - 1) if _jumps(*motions[i : i + 2])), at)
            last = motions[at]
            stays = f"A slow sweep {way} stays on the {which} one {on} to {last.frequency:.5g} Hz"
            after = motions[at + 1] if at + 1 < len(motions) else None
            ends = (
                ", where it ends"
                if after is None
                else (f" and is at {self._size(after.amplitude)} at {after.frequency:.5g} Hz")
            )
            said.append(f"{stays} ({self._size(last.amplitude)}){ends}.")
        return said

    def _wild(self) -> list[str]:
        """Where motions are irregular."""
        if not self.irregular:
            return []
        wild = sorted({m.frequency for m in self.irregular})
        top = max(self.irregular, key=lambda m: m.swing)
        span = (
            f"at {wild[0]:.5g} Hz"
            if len(wild) == 1
            else f"at frequencies from {wild[0]:.5g} to {wild[-1]:.5g} Hz"
        )
        return [
            f"Motions are irregular, without a period, {span}, with swings of up to {self._size(top.swing)}."
        ]


def _of_curve(one: Followed) -> str:
    """A curve in a sentence."""
    said = f"Curve of periodic motions, {one.sentences()[0]}"
    more = f"; it goes on from {one.parameter[-1]:.5g} Hz (respond --over frequency)."
    return said if not one.status.startswith("points") else said.removesuffix(".") + more


def _jumps(before: Settled, after: Settled) -> bool:
    """Whether a motion is lost in a step."""
    return not after.like(before.amplitude, LOST)


def nearer(m: Settled, low: Settled, high: Settled) -> bool:
    """Whether a motion is the higher one of two."""
    return abs(m.amplitude - high.amplitude) < abs(m.amplitude - low.amplitude)


HARMONICS, FINER, FINEST = 7, 256, 512
"""Harmonics of a curve of contacts that open and samples of a cycle with which it is begun, at least, and up to which
samples are doubled. Stability of motions with fewer is not that of what they stand for."""

COARSE = 0.05
"""Share of the points of a curve that may fail their checks."""

POINTS, LOOKED_AT = 120, 8
"""Points of a curve at most, and how many of all are looked at for stability."""


def with_curve(
    one: Beyond, settings: CaseSettings, bases: Bases, path: Path | str, keep: Keep, report: Report
) -> Beyond:
    """The same with the curve of periodic motions from either end of what was looked at, as fine as open contacts need,
    and the stability of some of its points; without it where there are no motions in time to hold it against, or only
    one that is regular, which then say all there is."""
    if one.why or one.cut or not (one.two or one.irregular):
        return one
    low, high = one.band
    harmonics, samples = max(HARMONICS, settings.balanced), max(FINER, settings.sampled)
    while True:
        curve = CurveOfCase(band=(low, high), points=POINTS)
        asked: dict[str, Any] = {"harmonics": harmonics, "samples": samples, "curve": curve}
        if settings.sweep.normal_forces is not None:
            asked["sweep"] = settings.sweep.model_copy(update={"normal_forces": (one.normal,)})
        finer = settings.model_copy(update=asked)
        found = _both_ways(finer, bases, path, keep, report)
        failed = 1 - float(np.mean(np.concatenate([f.converged for f in found]))) if found else 0.0
        if failed <= COARSE or 2 * samples > FINEST:
            break
        samples *= 2
        report(
            f"{percent(failed)} of the curve's points fail their checks; once more with {samples} samples"
        )
    built = build(finer, bases, path)
    problem = problem_of(built, one.normal if settings.sweep.normal_forces is not None else None)
    each = [_looked_at(problem, f, max(LOOKED_AT // len(found), 1), report) for f in found]
    return replace(one, curves=found, samples=samples, stability=each)


def _both_ways(
    settings: CaseSettings, bases: Bases, path: Path | str, keep: Keep, report: Report
) -> list[Followed]:
    """The curve from the upper end, and from the lower one where the first does not arrive there."""
    assert settings.curve is not None and settings.curve.band is not None
    found = list[Followed]()
    for band in (settings.curve.band[::-1], settings.curve.band):
        if found and found[0].complete:
            break
        way = settings.curve.model_copy(update={"band": band})
        some, whole = curves(
            settings.model_copy(update={"curve": way}), bases, path, "frequency", keep, report
        )
        if not whole:
            raise KeyboardInterrupt
        found += [replace(f, legs=0) for f in some[:1] if f.rows]  # each is told by where it begins
    return found


def _looked_at(problem: Problem, one: Followed, count: int, report: Report) -> dict[int, Stability]:
    """Place -> stability of some of a curve's points that pass their checks; none where it cannot be told."""
    good, found = np.flatnonzero(one.converged), dict[int, Stability]()
    chosen = np.linspace(0, len(good) - 1, min(count, len(good))).round().astype(int)
    began = time.monotonic()
    for i in good[np.unique(chosen)].tolist():
        f = float(one.parameter[i])
        report(f"stability of the curve, {one.label}: {f:.6g} Hz")
        try:
            motion = orbit(problem, one.rows[i]["x"], 2 * np.pi * f)
        except UserError:
            return {}
        found[i] = stability(motion, Multipliers(steps=128))
        began = began if len(found) > 1 else time.monotonic()  # the first one compiles
        if time.monotonic() - began > LONG:
            break
    return found


def _periods(problem: Problem, gap: tuple[float, float]) -> int:
    """How long motions are left to themselves, by the least damping of the modes about a gap, stuck and free."""
    part = problem.assembly.joined(1)
    pairs = [(part, problem.assembly.stiffness), (untouched(part), np.zeros((0, 0)))]
    f, D = (np.concatenate([of(one, k) for one, k in pairs]) for of in (stuck, stuck_damping))
    about = D[(f > 0.5 * gap[0]) & (f < 2 * gap[1]) & (D > 0)]
    wanted = FORGOTTEN / (2 * np.pi * about.min(initial=1.0))
    return int(np.clip(wanted, FEWEST, MOST))


def beyond(
    problem: Problem,
    found: HarmonicResponse,
    gap: tuple[float, float],
    normal: float,
    of: Quantity,
    report: Report,
    patience: float,
) -> Beyond:
    """Motions in time about a gap (Hz, Hz) of a response. patience: s of CPU time after the first of them."""
    if problem.assembly.ring is not None:
        return Beyond(
            normal,
            gap,
            why="sectors of a ring need not stay alike in time; microslip orbit integrates",
        )
    try:
        return _Swept(problem, found, gap, normal, report, patience).all_of_it(of)
    except (UserError, NotConverged) as error:
        return Beyond(normal, gap, why=str(error))


class _Swept:
    """Sweeps in time about a gap."""

    def __init__(
        self,
        problem: Problem,
        found: HarmonicResponse,
        gap: tuple[float, float],
        normal: float,
        report: Report,
        patience: float,
    ) -> None:
        self.patience, self.began, self.cut = patience, math.inf, ""
        self.problem, self.gap, self.normal, self.report = problem, gap, normal, report
        self.asked = found.frequency[found.asked]
        self.step = float(np.median(np.diff(self.asked)))
        self.periods = _periods(problem, gap)
        good = found.converged
        self.known = dict(
            zip(found.frequency[good].tolist(), np.abs(found.monitor[good]).tolist(), strict=True)
        )
        solved = zip(found.frequency[good].tolist(), found.x[good], strict=True)
        self.points = [Point(2 * np.pi * f, x, CONVERGED, 0.0, 0) for f, x in solved]

    def all_of_it(self, of: Quantity) -> Beyond:
        low, high = self.gap
        below, above = self.asked[self.asked < low].tolist(), self.asked[self.asked > high].tolist()
        within = self.asked[(self.asked >= low) & (self.asked <= high)]
        inside = within[:: 1 + len(within) // WITHIN].tolist()
        beneath = (
            self.asked[0] - self.step * np.arange(1, (1 - LOWEST) * self.asked[0] / self.step)
        ).tolist()
        down, fell = self._way(
            "downwards", [*above[1::-1], *inside[::-1], *below[::-1], *beneath], low, -1.0
        )
        again = [m.frequency for m in down[::-1]] if fell else [*below[-2:], *inside, *above[:2]]
        begin = down[-1] if fell else None
        up, _ = self._way(
            "upwards", [*again, *(f for f in above if f > again[-1])], high, 1.0, begin
        )
        both = Beyond(self.normal, self.gap, up, down).two
        return Beyond(self.normal, self.gap, up, down, self._from_rest(both), of, cut=self.cut)

    def _spent(self, way: str, f: float) -> bool:
        """Whether the time is over that a way may take; it is said once, with the frequency (Hz) that is left out."""
        over = time.process_time() - self.began > SHARES[way] * self.patience
        if over and not self.cut:
            self.cut = (
                f"Motions in time ended after {self.patience:g} s, {way} before {f:.5g} Hz: what comes then is not "
                "known; give them more time (sweep.patience)."
            )
        return over

    def _from_rest(self, both: Sequence[tuple[Settled, Settled]]) -> list[Settled]:
        """Motions from rest where there are two, at some frequencies, and between those that lead to different ones."""
        count = len(both)
        wanted, found = (
            sorted({round(i * (count - 1) / 3) for i in range(4)} if count else set()),
            dict[int, Settled](),
        )
        while wanted and not self._spent("from rest", both[wanted[0]][0].frequency):
            for i in wanted:
                found[i] = self._at("from rest", both[i][0].frequency)
            known = sorted(found)
            higher = [nearer(found[i], *both[i]) for i in known]
            pairs = zip(known, known[1:], higher, higher[1:], strict=False)
            wanted = [(i + j) // 2 for i, j, a, b in pairs if a != b and j > i + 1]
        return [found[i] for i in sorted(found)]

    def _way(
        self,
        way: str,
        frequency: Sequence[float],
        end: float,
        sign: float,
        begin: Settled | None = None,
    ) -> tuple[list[Settled], bool]:
        """A stepped sweep, and whether it has come back to the harmonic balance's beyond an end of the gap (Hz), where
        it ends."""
        motions, alike = list[Settled](), 0
        for f in frequency[:STEPS]:
            if self._spent(way, f):
                break
            motions += self._on(way, f, motions[-1] if motions else begin)
            beyond = sign * (f - end) > 0
            alike = alike + 1 if beyond and motions[-1].like(self._balanced(f)) else 0
            if alike == ALIKE or not np.isfinite(motions[-1].amplitude):
                break
        return motions, alike == ALIKE

    def _on(
        self, way: str, f: float, begin: Settled | None, halvings: int = HALVINGS
    ) -> list[Settled]:
        """A step to a frequency (Hz); where the motion is lost on it, by steps of half of it: a sweep that is slow
        enough stays longer."""
        here = self._at(way, f, begin)
        if begin is None or halvings == 0 or not _jumps(begin, here) or self._spent(way, f):
            return [here]
        first = self._on(way, 0.5 * (begin.frequency + f), begin, halvings - 1)
        return [*first, *self._on(way, f, first[-1], halvings - 1)]

    def _at(self, way: str, f: float, begin: Settled | None = None) -> Settled:
        self.report(f"motion in time, {way}, F_N = {self.normal:g} N: {f:.6g} Hz")
        began = time.monotonic()
        found = settled(self.problem.assembly, f, self.periods, begin)
        self.began = min(self.began, time.process_time())  # the first one compiles
        if (
            begin is not None and (took := time.monotonic() - began) > LONG
        ):  # the first one compiles
            raise UserError(
                f"a frequency takes {took:.0f} s, too long for a sweep ([orbit] asks for single ones)"
            )
        return found

    def _balanced(self, f: float) -> float:
        """Amplitude of the harmonic balance at a frequency (Hz); nan where it has no solution."""
        if f not in self.known:
            point = between(self.problem, self.points, f)
            self.known[f] = (
                float(abs(operating(self.problem, point).outputs[0, 1]))
                if point.converged
                else np.nan
            )
        return self.known[f]

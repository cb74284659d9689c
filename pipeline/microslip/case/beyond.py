"""What moves where a sweep jumps, ends at a fold or leaves a gap: motions in time, from rest and swept up and down, and
the whole curve of periodic motions, stable or not.

A harmonic balance finds periodic motions, stable or not, and says neither which of several is reached nor whether one
is left at all. Motions in time do.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..data import Array
from ..errors import NotConverged, UserError
from ..harmonic_balance.checkpoint import Spend
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.response import HarmonicResponse
from ..harmonic_balance.stability import Settings as Multipliers
from ..harmonic_balance.stability import Stability, orbit, stability
from ..progress import Report
from ..results import Journal
from ..time_domain.swept import DOWN, REST, SAME, UP, SettledMotion, Sweeps, on_two_motions
from ..units import Quantity, percent
from .assemble import build
from .curves import Followed, Keep, curves
from .problem import problem_of
from .questions import CurveOfCase
from .settings import CaseSettings
from .surveys import Bases


@dataclass(frozen=True)
class Beyond:
    """Motions in time under a normal force.

    Attributes:
        normal: N. gap: Hz, Hz, where it is looked. up, down: swept upwards and downwards, in that order. rest: each
            from rest. quantity: what is read. why: why there are none. cut, patience: the way and
            the frequency (Hz) before which motions had their share of the CPU time (s). spent: s of
            it, by motions. curves: of periodic motions, with so many samples of a cycle. stability:
            of each of them some points, by their place.
    """

    normal: float
    gap: tuple[float, float] = (0.0, 0.0)
    up: Sequence[SettledMotion] = ()
    down: Sequence[SettledMotion] = ()
    rest: Sequence[SettledMotion] = ()
    quantity: Quantity = field(default_factory=Quantity)
    why: str = ""
    cut: tuple[str, float] | None = None
    patience: float = 0.0
    spent: float = 0.0
    curves: Sequence[Followed] = ()
    samples: int = 0
    stability: Sequence[Mapping[int, Stability]] = ()

    @property
    def two(self) -> list[tuple[SettledMotion, SettledMotion]]:
        """The lower and the higher motion where sweeps upwards and downwards are on different ones, by frequency."""
        return on_two_motions(self.up, self.down)

    def beside(self, frequency: float, amplitude: float) -> list[SettledMotion]:
        """The motions of either sweep next to a frequency (Hz) that are as high as an amplitude."""
        next_to = [min(way, key=lambda m: abs(m.frequency - frequency)) for way in (self.up, self.down) if way]
        return [m for m in next_to if m.like(amplitude, SAME)]

    @property
    def irregular(self) -> list[SettledMotion]:
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
                (REST, self.rest),
                (UP, self.up),
                (DOWN, self.down),
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


HARMONICS, FINER, FINEST = 7, 256, 512
"""Harmonics of a curve of contacts that open and samples of a cycle with which it is begun, at least, and up to which
samples are doubled. Stability of motions with fewer is not that of what they stand for."""

COARSE = 0.05
"""Share of the points of a curve that may fail their checks."""

POINTS, LOOKED_AT = 120, 8
"""Points of a curve at most, and how many of all are looked at for stability."""


def with_curve(
    one: Beyond,
    found: HarmonicResponse,
    settings: CaseSettings,
    bases: Bases,
    keep: Keep,
    report: Report,
) -> Beyond:
    """The same with the curve of periodic motions from either end of what was looked at, begun on the
    solutions of the sweep where it has some there, as fine as open contacts need, and the stability
    of some of its points; without it where there are no motions in time to hold it against, or only
    one that is regular, which then say all there is. It takes what the motions have left of the
    time at the place."""
    if one.why or one.cut or not (one.two or one.irregular):
        return one
    low, high = one.band
    good = found.converged
    known = dict(zip(found.frequency[good].tolist(), found.x[good], strict=True))
    spent = one.spent

    def spend(seconds: float) -> bool:
        nonlocal spent
        spent += seconds
        return spent <= one.patience

    harmonics, samples = max(HARMONICS, settings.balanced), max(FINER, settings.sampled)
    while True:
        curve = CurveOfCase(band=(low, high), points=POINTS)
        asked: dict[str, Any] = {"harmonics": harmonics, "samples": samples, "curve": curve}
        if settings.sweep.normal_forces is not None:
            asked["sweep"] = settings.sweep.model_copy(update={"normal_forces": (one.normal,)})
        finer = settings.model_copy(update=asked)
        both = _both_ways(finer, bases, keep, report, known, spend)
        failed = 1 - float(np.mean(np.concatenate([f.converged for f in both]))) if both else 0.0
        if failed <= COARSE or 2 * samples > FINEST or not spend(0.0):
            break
        samples *= 2
        report(f"{percent(failed)} of the curve's points fail their checks; once more with {samples} samples")
    built = build(finer, bases)
    problem = problem_of(built, one.normal if settings.sweep.normal_forces is not None else None)
    each = [_looked_at(problem, f, max(LOOKED_AT // len(both), 1), report, spend) for f in both]
    return replace(one, curves=both, samples=samples, stability=each)


def _both_ways(
    settings: CaseSettings,
    bases: Bases,
    keep: Keep,
    report: Report,
    known: Mapping[float, Array],
    spend: Spend,
) -> list[Followed]:
    """The curve from the upper end, and from the lower one where the first does not arrive there and there is time."""
    assert settings.curve is not None and settings.curve.band is not None
    found = list[Followed]()
    for band in (settings.curve.band[::-1], settings.curve.band):
        if found and (found[0].complete or not spend(0.0)):
            break
        way = settings.curve.model_copy(update={"band": band})
        some, whole = curves(settings.model_copy(update={"curve": way}), bases, "frequency", keep, report, known, spend)
        if not whole:
            raise KeyboardInterrupt
        found += [replace(f, legs=0) for f in some[:1] if f.rows]  # each is told by where it begins
    return found


def _looked_at(
    problem: Problem,
    one: Followed,
    count: int,
    report: Report,
    spend: Spend,
) -> dict[int, Stability]:
    """Place -> stability of some of a curve's points that pass their checks; none where it cannot be told."""
    good, found = np.flatnonzero(one.converged), dict[int, Stability]()
    chosen = np.linspace(0, len(good) - 1, min(count, len(good))).round().astype(int)
    for i in good[np.unique(chosen)].tolist():
        if not spend(0.0):
            break
        began, f = time.process_time(), float(one.parameter[i])
        report(f"stability of the curve, {one.label}: {f:.6g} Hz")
        try:
            motion = orbit(problem, one.rows[i]["x"], 2 * np.pi * f)
        except UserError:
            return {}
        found[i] = stability(motion, Multipliers(steps=128))
        spend(time.process_time() - began if len(found) > 1 else 0.0)  # the first one compiles
    return found


def beyond(
    problem: Problem,
    found: HarmonicResponse,
    gap: tuple[float, float],
    normal: float,
    of: Quantity,
    report: Report,
    patience: float,
    journal: Journal | None = None,
) -> Beyond:
    """Motions in time about a gap (Hz, Hz) of a response. patience, journal: see `Sweeps`."""
    if problem.assembly.ring is not None:
        why = "sectors of a ring need not stay alike in time; microslip orbit integrates"
        return Beyond(normal, gap, why=why)
    try:
        m = Sweeps(problem, found, gap, normal, report, patience, journal).motions()
    except (UserError, NotConverged) as error:
        return Beyond(normal, gap, why=str(error))
    return Beyond(normal, gap, m.up, m.down, m.rest, of, cut=m.cut, patience=patience, spent=m.spent)

"""Motions in time that are left to themselves at one frequency after the other, each begun where the last one ended: a
stepped sweep, as on a shaker."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..system.assembly import Assembly
from . import equations, orbit
from . import samples as kept_samples
from .bodies import Now
from .stepper import KINDS, Stepper

SAMPLES, KEPT = 32, 32
"""Of a period, and periods in which a motion is looked at."""

OF_CONTACT = 40
"""Steps in a period of the fastest motion with closed contacts, fewer than where a motion itself is asked for; they are
halved where contacts open, close or slide."""

LOOKS = 8
"""Times at most that a motion is looked at."""

SETTLED = 0.01
"""Share by which the amplitude may differ from that of the last look when a motion counts as settled."""

DYING = 0.8
"""Times the spread of swings at the last look, below which what is left of the start still dies away."""

IRREGULAR = 0.15
"""Share of the largest swing by which that of a period may be less in a motion that counts as regular; small impacts
among many points leave some hundredths."""


@dataclass(frozen=True, eq=False)
class Settled:
    """What a motion is at a frequency when it has been left to itself.

    Attributes:
        frequency: Hz. amplitude: 0-peak of the first harmonic of the first read-out over `KEPT` periods, in its unit.
            swing: half of what it spans in the wildest of them, and least: in the calmest. opens: whether a contact
            does. end: where it is, after whole periods.
    """

    frequency: float
    amplitude: float
    swing: float
    least: float
    opens: bool
    end: Now

    @property
    def irregular(self) -> bool:
        """Whether its swings differ from period to period."""
        return not self.swing - self.least <= IRREGULAR * self.swing

    def like(self, amplitude: float, within: float = IRREGULAR) -> bool:
        """Whether another amplitude is its own, to a share of the larger one."""
        return abs(self.amplitude - amplitude) <= within * max(self.amplitude, amplitude)


def settled(
    assembly: Assembly, frequency: float, most: int, begin: Settled | None = None
) -> Settled:
    """The motion at a frequency (Hz), looked at until it does not change any more or `most` periods are over.

    Args:
        begin: where it begins; at rest under the steady loads if not given.

    Raises:
        UserError: what has no form in time, see `equations.of`. NotConverged: no rest is found.
    """
    e = equations.of(assembly, 2 * np.pi * frequency)
    steps = max(orbit.OF_PERIOD, int(np.ceil(OF_CONTACT * e.fastest / e.Omega)))
    each = orbit.steps_of_a_sample(e, SAMPLES, steps)
    stepper = Stepper(e, 2 * np.pi / e.Omega / (each * SAMPLES), accounts=False)
    if begin is None:
        now = stepper.start(*orbit.begun(e, "static"))
    else:
        q, v = np.split(np.asarray(begin.end.y), 2, axis=1)
        now = stepper.start(q.ravel(), v.ravel(), held=begin.end.held)
    turning = 2 * np.exp(-2j * np.pi * np.arange(1, KEPT * SAMPLES + 1) / SAMPLES)
    amplitude, spread = np.inf, np.inf
    for _ in range(LOOKS):
        now = stepper.advanced(now, np.full(SAMPLES, each * SAMPLES), max(most // LOOKS - KEPT, 1))[
            0
        ]
        now, seen, events, *_ = stepper.advanced(now, np.full(KEPT * SAMPLES, each))
        y = kept_samples.read(e, seen)[0]
        if len(y) < len(turning) or not np.isfinite(seen.mechanical[-1]):
            return Settled(frequency, np.nan, np.nan, np.nan, True, now)
        before = amplitude, spread
        amplitude, spans = (
            float(abs(np.mean(turning * y))),
            0.5 * np.ptp(y.reshape(KEPT, SAMPLES), axis=1),
        )
        spread = float(np.ptp(spans) / max(spans.max(), 1e-300))
        steady = spread <= 2 * SETTLED or spread > DYING * before[1]
        if steady and abs(amplitude - before[0]) <= SETTLED * amplitude:
            break
    opens = bool((events[:, 2] == KINDS.index("opens")).any())
    return Settled(frequency, amplitude, float(spans.max()), float(spans.min()), opens, now)

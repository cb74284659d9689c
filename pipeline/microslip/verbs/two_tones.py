"""Vibration under two frequencies without a common period, as [two_tones] asks: two loads, or a load and a self-excited
vibration."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, model_validator

from ..analyses import two_tones
from ..analysis import Analysis, Answer, Drawing, Question
from ..data import Array
from ..pictures.plots import plain_axes
from ..report.page import Piece, fold, number, say, table
from ..results.tones import TwoTones
from ..settings.numbers import Model, Positive
from ..units import Quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..harmonic_balance.tones import Solved

STRONGEST = 16
"""Pairs in the table of a point."""

READ_AS = (
    "A pair (k1, k2) stands for the frequency k1 f1 + k2 f2; its amplitude is 0-peak. Powers are means: what the loads "
    "of either tone supply, what the bodies' damping takes, and what the contacts take by their own count."
)


class Keys(Model):
    """Quasi-periodic vibration under loads of two frequencies without a common period, by
    `microslip two-tones`."""

    start: Positive
    """[Hz] of the first tone"""
    stop: Positive | None = None
    """[Hz] if several points are asked for"""
    points: Annotated[int, Field(ge=1, le=100000)] = 1
    """equally spaced"""
    second: Positive | None = None
    """[Hz] of the second tone, of excitations with `tone = 2`, held; a guess within 15 % where it
    is `free`"""
    ratio: Positive | None = None
    """or of the second to the first frequency"""
    free: bool = False
    """whether the second frequency is that of a vibration of its own, and not known"""
    harmonics: Annotated[int, Field(ge=1, le=60)] = 5
    """pairs (k1, k2) with abs(k1) + abs(k2) up to that are balanced"""
    samples: Annotated[int, Field(ge=8, le=100000)] | None = None
    """of a turn of the faster angle; 8 a harmonic and 32 at least if not given"""
    turns: Annotated[int, Field(ge=8, le=10000)] | None = None
    """of the faster angle, at least, in the line along which contacts that remember are marched;
    8 a harmonic and 32 at least if not given"""

    @model_validator(mode="after")
    def _two(self) -> Keys:
        if (self.second is None) == (self.ratio is None):
            raise ValueError("second: give second (Hz) or ratio, and not both")
        if (self.stop is None) != (self.points == 1):
            raise ValueError("points: stop and points come together; give both of a sweep, none of a single frequency")
        return self

    @property
    def hertz(self) -> tuple[Array, Array]:
        """(f,) Hz of both tones."""
        first = np.linspace(self.start, self.stop or self.start, self.points)
        return first, first * self.ratio if self.ratio is not None else np.full(self.points, self.second or 0.0)


def solve(q: Question) -> Answer:
    """See `microslip.two_tones`; whole if every point converged."""
    asked: Keys = q.asked
    first, second = asked.hertz
    motions = two_tones(
        q.built, first, second, free=asked.free, harmonics=asked.harmonics, samples=asked.samples, turns=asked.turns,
        kept=q.kept, report=q.report,
    )  # fmt: skip
    highest = int(np.argmax(np.where(motions.converged, np.abs(motions.of(1, 0)), -1.0)))
    reached = np.abs(motions.amplitude[motions.converged, 0, 1:]).sum(axis=-1).max(initial=0.0)
    solved, diagrams = bool(motions.converged[highest]), dict[str, Drawing]()
    title = f"{motions.first[highest]:.6g} and {motions.second[highest]:.6g} Hz"
    if len(motions) > 1 and motions.converged.any():
        diagrams[""] = Drawing(partial(draw_amplitudes, motions))
    if solved:
        diagrams["point"] = Drawing(partial(draw_point, motions, highest), title, (9.0, 6.4))
    return Answer(
        sentences=[*_sentences(motions, highest), *motions.messages],
        data={"": motions},
        diagrams=diagrams,
        tables=_tables(motions, highest),
        largest=float(reached),
        whole=bool(motions.converged.all()),
    )


def _sentences(motions: Solved, i: int) -> list[str]:
    failures = [f"{f:.6g} Hz: {why}" for f, why in motions.failures]
    if not motions.converged[i]:
        return failures
    if not motions.amplitude[i, 0, 1:].any():
        return [f"{motions.readouts[0]} does not move; read another direction or another monitor.", *failures]
    sized, error = Quantity(motions.units[0]).sized, motions.error_estimate(i)
    one, two = (sized(float(abs(motions.of(*k)[i]))) for k in ((1, 0), (0, 1)))
    share = f"{100 * error:.2g} % of the largest amplitude" if np.isfinite(error) else "an unknown share"
    return [
        f"{motions.first[i]:.6g} and {motions.second[i]:.6g} Hz: {motions.readouts[0]} swings by {one} and {two}; the "
        f"estimated error is {share}.",
        *failures,
    ]


def _tables(motions: TwoTones, i: int) -> list[Piece]:
    pieces = [say(READ_AS, tone="note")]
    if motions.converged[i]:
        pieces.append(_pairs(motions, i))
    if len(motions) > 1:
        pieces.append(fold("All points, as in two_tones.csv", _points(motions)))
    return pieces


def _pairs(motions: TwoTones, i: int) -> Piece:
    size, f = np.abs(motions.amplitude[i, 0]), motions.frequencies(i)
    strongest = np.argsort(-size, kind="stable")[:STRONGEST]
    unit = Quantity(motions.units[0]).said
    rows = [
        ["({}, {})".format(*motions.pairs[j]), number(abs(float(f[j])), 6), number(float(size[j]), 6)]
        for j in strongest
    ]
    return table(["pair", "frequency in Hz", f"{motions.readouts[0]} in {unit}"], rows)


def _points(motions: TwoTones) -> Piece:
    unit = Quantity(motions.units[0]).said
    head = [
        "first in Hz", "second in Hz", f"(1, 0) in {unit}", f"(0, 1) in {unit}", "first supplies, W", "second, W",
        "damped in W", "contacts in W", "",
    ]  # fmt: skip
    sizes = (np.abs(motions.of(*k)) for k in ((1, 0), (0, 1)))
    powers = *motions.supplied.T, motions.damped, motions.lost
    rows = zip(motions.first, motions.second, *sizes, *powers, motions.status, strict=True)
    return table(head, [[*(number(float(v), 6) for v in row), status] for *row, status in rows])


def draw_amplitudes(motions: TwoTones, figure: Figure) -> None:
    """Those of the strongest pairs over the first frequency."""
    axes = figure.subplots()
    plain_axes(axes)
    motions.plot(axes)


def draw_point(motions: TwoTones, i: int, figure: Figure) -> None:
    """Spectrum and torus of a point above, the motion in time below."""
    panels: dict[str, Axes] = figure.subplot_mosaic([["spectrum", "torus"], ["time", "time"]], height_ratios=[1.5, 1.0])
    for name in ("spectrum", "time"):
        plain_axes(panels[name])
    motions.plot(panels["spectrum"], point=i)
    motions.plot_torus(panels["torus"], i)
    time = np.linspace(0.0, 24.0 / (motions.first[i] + motions.second[i]), 2000)
    y = motions.motion(time, i)
    by, unit = Quantity(motions.units[0]).scale(float(np.abs(y).max(initial=0.0)))
    panels["time"].plot(time, by * y, color="#0b4f9c", linewidth=1.0)
    panels["time"].set(xlabel="time in s", ylabel=f"{motions.readouts[0]} in {unit}", xlim=(0.0, time[-1]))


ANALYSIS = Analysis(
    "two_tones",
    Keys,
    solve,
    lost="some points did not converge",
    needed="start and second (Hz), or ratio",
    swept=False,
)

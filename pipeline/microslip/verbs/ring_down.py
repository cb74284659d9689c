"""How joints are measured: the loads are taken off at a resonance; frequency and damping of the motion that dies away,
over its amplitude, beside the nonlinear mode of the same case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import cycle
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field
from scipy.signal import fftconvolve
from scipy.signal.windows import blackmanharris

from ..analysis import Analysis, Answer, Drawing, Question
from ..case.assemble import Built
from ..case.problem import forces_of, pressed_by, problem_of
from ..data import Array
from ..errors import NotConverged, UserError
from ..harmonic_balance import nonlinear_modes
from ..harmonic_balance.nonlinear_modes import Backbone
from ..harmonic_balance.peak import highest
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.readout import measured
from ..harmonic_balance.response import operating
from ..harmonic_balance.solver import Point, sweep
from ..pictures.plots import COLOURS, plain_axes, plain_numbers
from ..results.dataset import Dataset, Variable
from ..results.journal import once
from ..settings.numbers import Model, NotNegative, Positive
from ..time_domain import equations, orbit, starts
from ..units import Quantity, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WINDOW = 6
"""Periods of the window in which frequency and amplitude are taken: what is a third of the frequency
away, a level above all, counts in it by less than 1e-4 (Blackman and Harris, -92 dB)."""

SPARE = 1.2
"""Times as long as by the nonlinear mode the motion dies away, it is followed."""

LOW = 30.0
"""A nonlinear mode begins at so small a part of the amplitude at which contacts begin to slide, at the most."""


class Keys(Model):
    """A vibration that dies away, by `microslip ring-down`."""

    frequency: Positive | None = None
    """[Hz] at which the case is driven until its loads are taken off; the highest resonance in
    the sweep's band if not given"""
    amplitude: Positive | None = None
    """[m] of the first read-out: the motion begins in the nonlinear mode instead, where that has
    it"""
    mode: Annotated[int, Field(ge=1, le=2000)] | None = None
    """with sticking contacts, 1 the lowest, that is compared; the one that answers the excitation
    most in the sweep's band if not given"""
    normal_force: NotNegative | None = None
    """[N] instead of all those of the sweep"""
    down_to: Annotated[Positive, Field(le=0.5)] = 0.01
    """share of the first amplitude at which it ends"""
    periods: Annotated[int, Field(ge=2 * WINDOW, le=1000000)] = 5000
    """at most"""
    samples: Annotated[int, Field(ge=16, le=4096)] = 64
    """of a period"""


def solve(q: Question) -> Answer:
    """A motion under every normal force; whole if none ends above `down_to`, and no nonlinear mode early."""
    asked: Keys = q.asked
    built: Built = q.built
    forces = forces_of(built, asked.normal_force)
    quantity, kept = measured(built.assembly), dict[float, dict[str, Any]]()
    for number, force in enumerate(forces):
        problem = problem_of(built, force, form="relative")
        pressed = pressed_by(built, problem) if force is None else force
        q.report(f"ring-down at F_N = {pressed:g} N, {number + 1} of {len(forces)}")
        name = f"normal force {pressed!r} N"
        kept[pressed] = once(q.kept, name, 0.0, partial(_rung, built, force, problem, asked, q.report))
    decays = {
        normal: measured_decay(one["time"], one["readout"], one["Omega"], asked.down_to, one["amplitude"])
        for normal, one in kept.items()
    }
    decay, motion = _of_decays(decays, kept, quantity), _of_motions(kept, quantity)
    return Answer(
        sentences=[
            words for normal, one in kept.items() for words in _sentences(normal, decays[normal], one, quantity)
        ],
        data={"": decay, "motion": motion},
        diagrams={"": Drawing(partial(draw, decay, motion, quantity), "a vibration that dies away", (9.0, 7.2))},
        largest=max(one["amplitude"] for one in kept.values()),
        whole=not any(one["unreached"] or decays[normal].lost for normal, one in kept.items()),
    )


def _of_decays(decays: Mapping[float, Decay], kept: Mapping[float, dict[str, Any]], of: Quantity) -> Dataset:
    """One after the other, with the nonlinear mode at the same amplitudes."""
    parts = []
    for normal, d in decays.items():
        one, log = kept[normal], np.log(d.amplitude)
        mode = [
            np.interp(log, np.log(one["mode_amplitude"]), one[f"mode_{key}"], left=np.nan, right=np.nan)
            for key in ("frequency", "damping")
        ]
        parts.append((np.full(len(log), normal), d.time, d.amplitude, d.frequency, d.damping, *mode))
    told = [
        ("normal_force", "N", "of the contacts that the sweep presses"),
        ("time", "s", "since the loads were taken off"),
        ("amplitude", of.unit, "of the first read-out, 0-peak, of its part near the frequency"),
        ("frequency", "Hz", "of the motion"),
        ("damping_ratio", "1", "of the motion"),
        ("mode_frequency", "Hz", "of the nonlinear mode at that amplitude"),
        ("mode_damping_ratio", "1", "of the nonlinear mode at that amplitude"),
    ]
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    named = zip(told, columns, strict=True)
    return Dataset("ring_down", {n: Variable(v, unit, holds) for (n, unit, holds), v in named})


def _of_motions(kept: Mapping[float, dict[str, Any]], of: Quantity) -> Dataset:
    normal = np.repeat(list(kept), [len(one["time"]) for one in kept.values()])
    time, readout = (np.concatenate([one[key] for one in kept.values()]) for key in ("time", "readout"))
    return Dataset("ring_down_motion", {
        "normal_force": Variable(normal, "N", "of the contacts that the sweep presses"),
        "time": Variable(time, "s", "since the loads were taken off"),
        "readout": Variable(readout, of.unit, "the first read-out"),
    })  # fmt: skip


def _sentences(normal: float, d: Decay, one: dict[str, Any], of: Quantity) -> list[str]:
    begun = f"F_N = {normal:g} N: "
    if not len(d.time):
        return [f"{begun}{d.lost or 'it ends before its frequency can be told'}."]
    most = int(d.damping.argmax())
    said = (
        f"{begun}from {d.frequency[0]:.6g} Hz at {of.sized(d.amplitude[0])} to {d.frequency[-1]:.6g} Hz at "
        f"{of.sized(d.amplitude[-1])} in {d.time[-1]:.4g} s; most damped, {percent(d.damping[most])}, at "
        f"{of.sized(d.amplitude[most])}."
    )
    more = [f"{begun}{why.rstrip('.')}." for why in (d.lost, one["unreached"], *one["messages"].splitlines()) if why]
    return [said, *more]


def draw(decay: Dataset, motion: Dataset, of: Quantity, figure: Figure) -> None:
    """The motions above; below, over the amplitude, their frequency and damping beside those of the nonlinear modes."""
    panels: dict[str, Axes] = figure.subplot_mosaic([["motion", "motion"], ["frequency", "damping_ratio"]])
    by, unit = of.shared(motion["readout"])
    for colour, normal in zip(cycle(COLOURS), dict.fromkeys(decay["normal_force"])):
        label, own = f"$F_N$ = {normal:g} N", motion["normal_force"] == normal
        panels["motion"].plot(motion["time"][own], by * motion["readout"][own], color=colour, lw=0.7, label=label)
        own = decay["normal_force"] == normal
        amplitude = by * decay["amplitude"][own]
        for name, scale in (("frequency", 1.0), ("damping_ratio", 100.0)):
            axes = panels[name]
            axes.plot(amplitude, scale * decay[f"mode_{name}"][own], color=colour, lw=2.6, alpha=0.35)
            axes.plot(amplitude, scale * decay[name][own], ".", color=colour, ms=3)
    for axes in panels.values():
        plain_axes(axes)
    panels["motion"].set(xlabel="time in s", ylabel=f"read-out in {unit}")
    panels["motion"].legend(fontsize=8, frameon=False)
    for name, says in (("frequency", "frequency in Hz"), ("damping_ratio", "damping ratio in %")):
        panels[name].set(xscale="log", xlabel=f"amplitude in {unit}", ylabel=says)
        plain_numbers(panels[name].xaxis, (1.0, 2.0, 5.0))
    panels["damping_ratio"].set_ylim(bottom=0)
    panels["frequency"].set_title("points: the motion; broad lines: the nonlinear mode", fontsize=9)


# the motion ------------------------------------------------------------------------------------------------------


def _rung(built: Built, force: float | None, problem: Problem, asked: Keys, report: Any) -> dict[str, Any]:
    """The nonlinear mode and the motion under a normal force, as a journal keeps them."""
    band = 2 * np.pi * built.settings.sweep.grid
    stuck = nonlinear_modes.about_rest(problem)[0]
    number = nonlinear_modes.strongest(stuck, band[0], band[-1]) if asked.mode is None else asked.mode - 1
    point, amplitude = None, asked.amplitude
    if amplitude is None:
        point, amplitude = _driven(problem, asked.frequency, band, report)
    low = min(asked.down_to * amplitude / 2, nonlinear_modes.sliding_amplitude(stuck, number) / LOW)
    report("its nonlinear mode")
    mode = nonlinear_modes.backbone(problem, low, 1.02 * amplitude, number, asked=(amplitude,))
    if not len(mode.amplitude):
        raise NotConverged(f"no nonlinear mode is found: {mode.status}")
    if point is None:
        at = int(np.abs(mode.amplitude - amplitude).argmin())
        problem, point = nonlinear_modes.motion(problem, mode, at)
    assembly = built.pressed(force)
    alone = replace(assembly, loads=tuple(x for x in assembly.loads if x.harmonic == 0))
    begins = starts.of_balance(equations.of(assembly, point.Omega), problem, point)
    periods = min(_periods(mode, amplitude, asked.down_to), asked.periods)
    free = equations.of(alone, point.Omega)
    motion = orbit.run(free, 0, periods, asked.samples, None, begins, report)
    return {
        "time": motion.time, "readout": motion.y[0], "Omega": point.Omega, "amplitude": amplitude,
        "mode_amplitude": mode.amplitude, "mode_frequency": mode.frequency, "mode_damping": mode.damping,
        "unreached": "" if mode.complete else mode.failing or mode.status,
        "messages": "\n".join(motion.messages),
    }  # fmt: skip


def _driven(problem: Problem, frequency: float | None, band: Array, report: Any) -> tuple[Point, float]:
    """The vibration from which the loads are taken, and its amplitude."""
    if frequency is None:
        peak = highest(problem, band, report).peak
        point = Point(peak.lam, peak.x, peak.status, 0.0, 0)
    else:
        point = sweep(problem, np.array([frequency]))[0]
    if not point.converged:
        raise UserError(f"frequency: nothing to begin with: {point.status}; give another frequency, or amplitude")
    return point, float(np.abs(operating(problem, point).outputs[0, 1]))


def _periods(mode: Backbone, amplitude: float, down_to: float) -> int:
    """In which a motion on the mode dies away from an amplitude to a share of it: A' = -zeta omega A."""
    inside = (mode.amplitude <= amplitude) & (mode.amplitude >= down_to * amplitude)
    log, damping = np.log(mode.amplitude[inside]), mode.damping[inside]
    if len(log) < 2 or damping.min() <= 0:
        return 10**9
    return int(np.ceil(SPARE * np.trapezoid(1 / (2 * np.pi * damping), log))) + WINDOW


# frequency and damping of it -----------------------------------------------------------------------------------


class Decay(NamedTuple):
    """A motion that dies away, once a period: (k,) s, amplitude, Hz and damping ratio. lost: why it ends early."""

    time: Array
    amplitude: Array
    frequency: Array
    damping: Array
    lost: str = ""


def measured_decay(time: Array, y: Array, Omega: float, down_to: float, first: float) -> Decay:
    """Frequency and damping of a read-out that dies away, from its part near a frequency.

    With a window w of `WINDOW` periods, c(t) = int w(s) y(t + s) exp(-i phi(t + s)) ds,
    omega = phi' + arg(c)' and sigma = -(ln |c|)' by differences over periods; phi follows the
    frequency in a second pass. What the window makes of exp(-sigma s) is taken out of the amplitude.
    Exact for an exponential, of second order in the change over a window.

    Args:
        time, y: (s,) evenly spaced, s and the unit of the read-out. Omega: rad/s at the beginning. down_to: share of
            the amplitude `first` at which it ends.
    """
    step, period = float(time[1] - time[0]), 2 * np.pi / Omega
    count, each = int(round(WINDOW * period / step)), max(int(round(period / step)), 1)
    window = blackmanharris(count) / blackmanharris(count).sum()
    middle = time[: len(time) - count + 1] + 0.5 * (count - 1) * step
    moved = y - np.interp(time, middle, fftconvolve(y, window, mode="valid"))
    t, omega = middle[::each], np.full(len(middle[::each]), Omega)
    for _ in range(2):
        fine = np.interp(time, t, omega)
        phase = np.concatenate([[0.0], np.cumsum(0.5 * step * (fine[1:] + fine[:-1]))])
        c = 2 * fftconvolve(moved * np.exp(-1j * phase), window, mode="valid")[::each]
        omega = np.gradient(np.interp(t, time, phase) + np.unwrap(np.angle(c)), t)
    sigma = -np.gradient(np.log(np.abs(c)), t)
    passed = np.exp(np.outer(sigma, (np.arange(count) - 0.5 * (count - 1)) * -step)) @ window
    inside = slice(WINDOW // 2, -WINDOW // 2)  # whose windows see the level of theirs
    t, a, f, zeta = (v[inside] for v in (t, np.abs(c) / passed, omega / (2 * np.pi), sigma / omega))
    if not len(a):
        return Decay(t, a, f, zeta, "it is gone before its frequency can be told; give a smaller down_to")
    ended = np.flatnonzero(a < down_to * first)
    lost = "" if len(ended) else f"after {time[-1]:.4g} s it still has {percent(a[-1] / first)} of its amplitude"
    last = int(ended[0]) if len(ended) else len(a)
    return Decay(t[:last], a[:last], f[:last], zeta[:last], lost)


ANALYSIS = Analysis(
    "ring_down",
    Keys,
    solve,
    lost="a motion does not die away far enough, or a nonlinear mode ends early",
)

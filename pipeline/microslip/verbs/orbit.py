"""Motion in time of a case from rest, as [orbit] asks: phase portraits, impacts, periods after which it comes back."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator
from scipy.interpolate import CubicHermiteSpline

from ..analysis import Analysis, Answer, Files, Question
from ..case.assemble import Built
from ..case.contacts import swept
from ..case.problem import problem_of
from ..errors import UserError, at, of_file
from ..files.tables import write_columns
from ..pictures.orbit import chatter_picture, orbit_picture, portraits, section_picture
from ..report.page import Piece
from ..report.response import number_tables
from ..settings.numbers import Model, NotNegative, Number, Positive, _finite_vector, _tuple
from ..system.assembly import Assembly
from ..time_domain import classification, equations, orbit, recorded, starts
from ..time_domain.classification import Exponent
from ..time_domain.orbit import Orbit
from ..time_domain.ramp import Ramp
from ..units import Quantity, counted, percent

Row = Mapping[str, float]
Named = Sequence[tuple[str, Orbit]]


def _several(value: object) -> object:
    return _finite_vector([value] if isinstance(value, int | float) and not isinstance(value, bool) else value)


Several = Annotated[tuple[Positive, ...], BeforeValidator(_several, json_schema_input_type=Positive | list[Positive])]


FREQUENCY = "frequency"
"""Parameter of a Poincare section that is no key of the case."""


class RunUp(Model):
    """An excitation whose frequency goes linearly from one to another, up or down."""

    start: Positive
    """[Hz] of the first harmonic, instead of `frequency`"""
    stop: Positive
    """[Hz] to here, up or down"""
    time: Positive
    """[s] within this time"""
    engine_order: Annotated[int, Field(ge=1, le=1000)] = 1
    """the rotation speed is the frequency over it; centrifugal loads follow its square"""
    euler: Annotated[tuple[str, ...], BeforeValidator(_tuple)] = ()
    """bodies that turn with it, which feel its change as a load in their frame"""

    @model_validator(mode="after")
    def _apart(self) -> RunUp:
        if self.start == self.stop:
            raise ValueError("start and stop: give two different frequencies")
        return self


class Release(Model):
    """Where the bodies of a motion in time are let go."""

    displacement: Annotated[tuple[Number, ...], BeforeValidator(_finite_vector)] | None = None
    """[m] where the bodies are let go, instead of `start`: coordinates of all of them, those of
    their modes, one body after the other, zero if not given"""
    velocity: Annotated[tuple[Number, ...], BeforeValidator(_finite_vector)] | None = None
    """[m/s] of these coordinates"""
    mode: Annotated[int, Field(ge=1)] | None = None
    """or a mode of the bodies without their contacts, by its number from 1"""
    amplitude: Number | None = None
    """[m] of the first monitor in that mode"""


class Keys(Model):
    """The motion in time from a start, by `microslip orbit`.

    A run-up is kept whole, in samples and steps of a period of its highest frequency.
    """

    frequency: Several | None = None
    """[Hz] of the first harmonic of the excitations: one or several, one motion each"""
    Omega: Several | None = None
    """[rad/s] or so"""
    run_up: RunUp | None = None
    settle: Annotated[int, Field(ge=0, le=1000000)] = 300
    """periods that are left to themselves"""
    keep: Annotated[int, Field(ge=1, le=100000)] = 40
    """periods that are kept"""
    samples: Annotated[int, Field(ge=8, le=8192)] = 256
    """of each that is kept"""
    steps: Annotated[int, Field(ge=1, le=100000000)] | None = None
    """of each; if not given, 150 in a period of the fastest motion with closed contacts, and 512
    at least"""
    start: Literal["static", "rest", "balance"] = "static"
    """at rest under the steady loads, or as preloaded; or on the vibration of harmonic balance"""
    release: Release | None = None
    normal_force: NotNegative | None = None
    """[N] of the contacts that the sweep presses"""
    over: str | None = None
    """Poincare section over a parameter: `frequency` (Hz), any key of the case by its dotted name, or
    of its system.toml behind `system.`; each motion begins as `start` says"""
    low: Number | None = None
    """first value of it"""
    high: Number | None = None
    """last one"""
    points: Annotated[int, Field(ge=2, le=100000)] = 41
    """values of it, equally spaced"""

    @model_validator(mode="after")
    def _one_of_both(self) -> Keys:
        if sum(map(bool, (self.frequency, self.Omega, self.run_up, self.over == FREQUENCY))) != 1:
            raise ValueError("frequency: give frequency (Hz) or Omega (rad/s), one or more of them, or run_up")
        if self.over is not None and (None in (self.low, self.high) or self.low == self.high):
            raise ValueError("over: give low and high, two different numbers")
        if self.over is None and (wrong := sorted(self.model_fields_set & {"low", "high", "points"})):
            raise ValueError(f"{wrong[0]}: belongs to over, the key that varies; give over, or leave it out")
        if (self.over or "").startswith("orbit."):
            raise ValueError("over: orbit's own keys do not vary; give frequency, or a key of the case")
        if self.over not in (None, FREQUENCY) and (self.run_up or len(self.hertz) > 1):
            raise ValueError("over: give one frequency, at which it varies")
        if self.run_up and (wrong := sorted(self.model_fields_set & {"settle", "keep"})):
            raise ValueError(f"{wrong[0]}: a run-up is kept from its beginning to its end; leave it out")
        if self.release is not None and "start" in self.model_fields_set:
            raise ValueError("release: gives the start; leave start out, or release")
        if self.run_up and self.start == "balance":
            raise ValueError('start: a run-up begins at rest; write "static" or "rest"')
        return self

    @property
    def values(self) -> list[float]:
        """Of the parameter of a Poincare section; none without one."""
        return np.linspace(self.low or 0.0, self.high or 0.0, self.points).tolist() if self.over else []

    @property
    def hertz(self) -> tuple[float, ...]:
        if self.over == FREQUENCY:
            return tuple(self.values)
        return self.frequency or tuple(w / (2 * math.pi) for w in self.Omega or ())


def solve(q: Question) -> Answer:
    """The motions in time, a sentence a motion; whole if none diverged. The file is filled as they go."""
    file, built = q.folder / "orbit.h5", q.built
    with of_file(q.varied.path):
        ran = recorded.run(file, _motions(q), q.inputs, q.fresh, q.report)
    found: Named = [(one.name, one) for one in ran]
    if q.asked.over:
        return _sections(q.asked, found, built)
    files: Files = {"orbit.csv": partial(write_columns, _columns(found), 8)}
    files["orbit.h5"] = lambda _: None  # is there
    ends = [_ends(one) for _, one in found if len(one.time)]
    notes = [words for one in found for words in (_sentence(*one), *_chatter(*one))]
    return Answer(
        [*notes, *_messages(found, built)],
        tables=_shown(found),
        largest=max((0.5 * (top - low) for top, low in ends), default=0.0),
        judged={"normal": q.asked.normal_force, "in_time": True},
        whole=not any(np.isfinite(one.diverged) for _, one in found),
        files=files | _pictures(found, built.settings.name),
        moving=lambda folder: _moving(found, built, folder),
    )


def _motions(q: Question) -> list[recorded.Integration]:
    """Those that a case asks for."""
    asked, over = q.asked, q.asked.over
    if over in (None, FREQUENCY):
        return _asked(asked, q.built)
    motions = []
    for value in asked.values:
        (one,) = _asked(asked, q.varied.built({over: value}, "orbit.over"))
        motions.append(replace(one, name=f"{over} = {value:.6g}"))
    return motions


def _sections(asked: Keys, found: Named, built: Built) -> Answer:
    """Where the read-out and its velocity are after every period, over the parameter."""
    over, case = asked.over or "", built.settings.name
    kept = [(value, one) for value, (_, one) in zip(asked.values, found, strict=True) if len(one.time)]
    of = kept[0][1].of() if kept else Quantity()
    names = "frequency_Hz" if over == FREQUENCY else over, of.column("displacement"), f"{of.column('velocity')}_s"
    rows = [np.array([np.full_like(y, value), y, v]) for value, one in kept for y, v in [one.section]]
    columns = dict(zip(names, np.concatenate([np.zeros((3, 0)), *rows], axis=1), strict=True))
    table = {names[0]: asked.values, "motion": [classification.kind(one) for _, one in found], **_columns(found)}
    kinds = ", ".join(f"{n} {KIND.get(kind, kind)}" for kind, n in Counter(table["motion"]).most_common())
    label = "frequency in Hz" if over == FREQUENCY else over
    draw = partial(section_picture, kept, label, title=f"{case}: Poincaré section over {over}")
    said = f"{over} from {asked.low:g} to {asked.high:g}, {counted(len(found), 'motion')}: {kinds}."
    return Answer(
        [said, *_messages(found, built)],
        largest=max((0.5 * (top - low) for top, low in (_ends(one) for _, one in kept)), default=0.0),
        judged={"normal": asked.normal_force, "in_time": True},
        whole=not any(np.isfinite(one.diverged) for _, one in found),
        files={
            "orbit.csv": partial(write_columns, table, 8),
            "orbit_section.csv": partial(write_columns, columns, 8),
            "orbit.h5": lambda _: None,  # is there
            "pictures/section.png": draw,
        },
    )


def _moving(found: Named, built: Built, folder: Path) -> list[Path]:
    from ..pictures.moving import moving_bodies

    return moving_bodies(found, built, folder)


def _asked(asked: Keys, built: Built) -> list[recorded.Integration]:
    """The motions that a case asks for.

    Raises:
        UserError: nothing presses a contact that waits for it.
    """
    motions = list[recorded.Integration]()
    if asked.normal_force is None and (waiting := [c.interface for c in built.contacts if swept(c)]):
        raise UserError("nothing presses it; give orbit.normal_force, N", f"contacts.{waiting[0]}")
    assembly = built.pressed(asked.normal_force)
    if asked.run_up is not None:
        motions.append(_run_up(assembly, asked, asked.run_up))
    for f in asked.hertz:
        name = f"{2 * np.pi * f:.6g} rad/s" if asked.Omega else f"{f:.6g} Hz"
        driven = equations.of(assembly, 2 * np.pi * f)
        start: orbit.Start | starts.PeriodicStart
        if asked.start == "balance":
            start = starts.of_balance(driven, problem_of(built, asked.normal_force))
        else:
            start = _rest(driven, asked)
        motions.append(recorded.Integration(name, driven, asked.settle, asked.keep, asked.samples, asked.steps, start))
    return motions


def _rest(e: equations.MotionEquations, asked: Keys) -> orbit.Start:
    """Where bodies stand, or are let go."""
    if asked.release is not None:
        with at("orbit"):
            return starts.released(e, asked.release.model_dump(), "release")
    assert asked.start != "balance"
    return asked.start


def _run_up(assembly: Assembly, asked: Keys, how: RunUp) -> recorded.Integration:
    ramp = Ramp(2 * np.pi * how.start, 2 * np.pi * how.stop, how.time, how.engine_order, how.euler)
    name = f"{how.start:.6g} to {how.stop:.6g} Hz in {how.time:.6g} s"
    driven = equations.of_ramp(assembly, ramp)
    start = _rest(driven, asked)
    return recorded.Integration(name, driven, 0, ramp.periods, asked.samples, asked.steps, start)


def _messages(found: Named, built: Built) -> list[str]:
    """What a reader must know of them."""
    own = [f"{name}: {words}" for name, one in found for words in one.messages]
    for name, one in found:
        if one.equations.ramp and any(c.at(0).group.speed for c in one.equations.assembly.components):
            own.append(f"{name}: the matrices stay those of one speed.")
        for b in built.settings.components if one.equations.ramp else ():
            if b.pressed_at_rpm is not None:
                own.append(f"{name}: the contacts of {b.name} stay pressed as at {b.pressed_at_rpm:g} rpm.")
    return own


def _sentence(name: str, one: Orbit) -> str:
    if not len(one.time):
        return f"{name}: {one.said}."
    largest, smallest = _ends(one)
    size = one.of().sized(0.5 * (largest - smallest), 5)
    error = f", its last period uncertain by {percent(one.error)}" if np.isfinite(one.error) else ""
    return f"{name}: {one.said}; {one.labels[0]} swings by {size} on either side{error}."


KIND = {"open": "not back yet", "short": "too short to say", "away": "goes away"}
"""Of `classification.kind`, what needs other words in a table."""


def _chatter(name: str, one: Orbit) -> list[str]:
    """A sentence for every contact that comes to rest after rebounds."""
    said = []
    for i, contact in enumerate(one.contacts):
        if found := classification.chatter(one, i):
            impacts = sorted({c.impacts for c in found})
            counts = f"{impacts[0]}" if len(impacts) == 1 else f"{impacts[0]} to {impacts[-1]}"
            flight, steps = min((c.flight, c.flight / c.step) for c in found)
            said.append(
                f"{name}: {contact} comes to rest after {counts} impacts, {counted(len(found), 'time')} in "
                f"what is kept; the shortest flight is {1e3 * flight:.3g} ms, {steps:.0f} steps."
            )
    return said


def _pictures(found: Named, case: str) -> Files:
    """Phase portraits together, a sheet a motion, and one more for each contact that chatters."""
    seen = [(name, one) for name, one in found if len(one.time)]
    drawn: Files = {}
    if len(seen) > 1:  # one that diverges as it settles leaves nothing to draw
        drawn["phase_portraits.png"] = partial(portraits, seen, title=f"{case}: phase portraits")
    for i, (name, one) in enumerate(seen, 1):
        title = f"{case}: {name}\n{one.said}"
        drawn[f"orbit_{i}.png"] = partial(orbit_picture, one, _row(one), title=title)
        for k, contact in enumerate(one.contacts):
            if classification.chatter(one, k):
                title = f"{case}: {name}, chatter of {contact}"
                drawn[f"chatter_{i}_{contact}.png"] = partial(chatter_picture, one, k, title=title)
    return {f"pictures/{name}": draw for name, draw in drawn.items()}


def _columns(found: Named) -> dict[str, Any]:
    """A row a motion."""
    rows = [_row(one) for _, one in found]
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


def _shown(found: Named) -> list[Piece]:
    """That table on the page, without what is known of no motion."""
    kinds = [KIND.get(kind := classification.kind(one), kind) for _, one in found]
    known = {key: values for key, values in _columns(found).items() if np.isfinite(values).any()}
    shown = {"excited_by": [name for name, _ in found], "motion": kinds, **known}
    return number_tables({"orbit.csv": shown})


def _ends(one: Orbit) -> tuple[float, float]:
    """Largest and smallest value of the first read-out, between the samples too."""
    return _top(one, 1.0), -_top(one, -1.0)


def _top(one: Orbit, sign: float) -> float:
    """Of the cubics through the outermost sample and its neighbours with their velocities: at an impact they stay below
    what it meets, where a parabola through the places alone passes beyond it."""
    y = sign * one.y[0]
    if len(y) < 2:
        return float(y.max(initial=-np.inf))
    i = int(np.argmax(y))
    near = slice(max(i - 1, 0), i + 2)
    way = CubicHermiteSpline(one.time[near], y[near], sign * one.v[0, near])
    turns = way.derivative().roots(extrapolate=False)
    return float(np.max([y[i], *way(turns[np.isfinite(turns)])]))


def _row(one: Orbit) -> dict[str, float]:
    grows, of = one.exponent or Exponent(np.nan, np.nan, 0), one.of()
    largest, smallest = _ends(one)
    return {
        "frequency_Hz": one.Omega / (2 * np.pi),
        "angular_frequency_rad_s": one.Omega,
        "repeats_after_periods": one.repeats,
        "impacts_per_period": one.impacts,
        "slips_per_period": one.slips,
        of.column("smallest"): smallest,
        of.column("largest"): largest,
        f"{of.column('largest_velocity')}_s": np.abs(one.v[0]).max(initial=0.0),
        "largest_contact_force_N": classification.largest_force(one),
        "lost_in_contacts_J_per_period": classification.lost(one),
        "lyapunov_exponent_1_s": grows.value,
        "lyapunov_uncertainty_1_s": grows.uncertainty,
        "second_frequency": classification.second_frequency(one) if one.repeats == 0 else np.nan,
        "steps_per_period": one.steps,
        "estimated_error": one.error,
        "energy_balance": one.balance,
        "contact_energy_drift": one.drift,
    }


def _band(asked: Mapping[str, Any]) -> dict[str, float]:
    """An octave around what is asked of the motion; nothing where that says no numbers."""
    if not isinstance(asked, Mapping):
        return {}
    ramp = asked.get("run_up")
    over = [asked.get("low"), asked.get("high")] if asked.get("over") == FREQUENCY else None
    ends = [ramp.get("start"), ramp.get("stop")] if isinstance(ramp, Mapping) else None
    for values, unit in ((asked.get("frequency"), 1.0), (asked.get("Omega"), 2 * math.pi), (ends, 1.0), (over, 1.0)):
        every = values if isinstance(values, list | tuple) else [values]
        some = [v for v in every if isinstance(v, int | float)]
        if some and min(some) > 0:
            return {"start": 0.5 * min(some) / unit, "stop": 2.0 * max(some) / unit}
    return {}


ANALYSIS = Analysis(
    "orbit",
    Keys,
    solve,
    lost="a motion diverged",
    needed="frequency (Hz), Omega (rad/s) or run_up",
    swept=False,
    options=("over", "low", "high", "points"),
    band=_band,
    unloaded=lambda asked: asked.release is not None,
)

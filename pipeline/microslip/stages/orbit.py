"""Motions in time of a case: a table, all samples in HDF5, pictures and a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ..case import CaseSettings, headline
from ..case.assemble import Built
from ..case.contacts import swept
from ..case.problem import problem_of
from ..case.questions import OrbitOfCase, RunUpOfCase
from ..errors import UserError, at, in_its_file
from ..files import store
from ..files.tables import columns_csv
from ..report.orbit import orbit_html
from ..system.assembly import Assembly
from ..time_domain import classification, equations, orbit, recorded, starts
from ..time_domain.classification import Exponent
from ..time_domain.orbit import Orbit
from ..time_domain.ramp import Ramp
from ..units import counted, percent
from .answer import CaseJob, Written
from .moving import moving_bodies
from .stage import Stage


@in_its_file
def orbit_stage(case: CaseJob) -> Written:
    """The motions in time that a case asks for, a sentence a motion; whole if none diverged.

    Raises:
        UserError: the case asks for none.
    """
    if case.settings.orbit is None:
        raise UserError("is missing; add [orbit] with frequency (Hz), Omega (rad/s) or run_up", "orbit")
    return case.answer("orbit", "stages.orbit", _work)


def _work(stage: Stage, case: CaseJob) -> Written:
    folder, name, built = case.folder, case.settings.name, case.built()
    motions = _asked(case.settings, built)
    stage.begin()
    ran = recorded.run(folder / "orbit.h5", motions, case.made_by(stage), case.force, case.report)
    found = [(m.name, m) for m in ran]
    notes, messages = _notes(found), [*_messages(found, built), *_doubted(found, built)]
    store.write_text(folder / "orbit.csv", columns_csv(_table(found), 8))
    drawn = _pictures(found, folder / "pictures", name) if case.pictures else []
    moving = moving_bodies(found, built, folder) if case.pictures else []
    drawn += [path for path in moving if path.suffix == ".gif"]
    rows = [{"name": m, "kind": KIND.get(kind := classification.kind(one), kind), "of": one.of(), **_row(one)}
            for m, one in found]  # fmt: skip
    page = orbit_html(f"{name}: motion in time", rows, notes, messages, drawn)
    store.write_text(folder / "orbit.html", page)
    made = [*(folder / f"orbit.{end}" for end in ("html", "csv", "h5")), *dict.fromkeys(drawn + moving)]
    return Written(made, [*notes, *messages], not any(np.isfinite(one.diverged) for _, one in found))


def _asked(settings: CaseSettings, built: Built) -> list[recorded.Asked]:
    """The motions that a case asks for.

    Raises:
        UserError: nothing presses a contact that waits for it.
    """
    asked, motions = settings.orbit, list[recorded.Asked]()
    assert asked is not None
    if asked.normal_force is None and (waiting := [c.interface for c in built.contacts if swept(c)]):
        raise UserError("nothing presses it; give orbit.normal_force, N", f"contacts.{waiting[0]}")
    assembly = built.pressed(asked.normal_force)
    if asked.run_up is not None:
        motions.append(_run_up(assembly, asked, asked.run_up))
    for f in asked.hertz:
        name = f"{2 * np.pi * f:.6g} rad/s" if asked.Omega else f"{f:.6g} Hz"
        driven = equations.of(assembly, 2 * np.pi * f)
        start: orbit.Start | starts.Periodic
        if asked.start == "balance":
            start = starts.of_balance(driven, problem_of(built, asked.normal_force))
        else:
            start = _rest(driven, asked)
        motions.append(recorded.Asked(name, driven, asked.settle, asked.keep, asked.samples, asked.steps, start))
    return motions


def _rest(e: equations.Equations, asked: OrbitOfCase) -> orbit.Start:
    """Where bodies stand, or are let go."""
    if asked.release is not None:
        with at("orbit"):
            return starts.released(e, asked.release.model_dump(), "release")
    assert asked.start != "balance"
    return asked.start


def _run_up(assembly: Assembly, asked: OrbitOfCase, how: RunUpOfCase) -> recorded.Asked:
    ramp = Ramp(2 * np.pi * how.start, 2 * np.pi * how.stop, how.time, how.engine_order, how.euler)
    name = f"{how.start:.6g} to {how.stop:.6g} Hz in {how.time:.6g} s"
    driven = equations.of_ramp(assembly, ramp)
    start = _rest(driven, asked)
    return recorded.Asked(name, driven, 0, ramp.periods, asked.samples, asked.steps, start)


def _notes(found: Sequence[tuple[str, Orbit]]) -> list[str]:
    """What motions they are, in sentences."""
    return [words for name, one in found for words in (_sentence(name, one), *_chatter(name, one))]


def _messages(found: Sequence[tuple[str, Orbit]], built: Built) -> list[str]:
    """What a reader must know of them."""
    own = [f"{name}: {words}" for name, one in found for words in one.messages]
    for name, one in found:
        if one.equations.ramp and any(c.at(0).group.speed for c in one.equations.assembly.components):
            own.append(f"{name}: the matrices stay those of one speed.")
        for b in built.settings.components if one.equations.ramp else ():
            if b.pressed_at_rpm is not None:
                own.append(f"{name}: the contacts of {b.name} stay pressed as at {b.pressed_at_rpm:g} rpm.")
    return [*own, *built.messages]


def _doubted(found: Sequence[tuple[str, Orbit]], built: Built) -> list[str]:
    """What looks like a number in a wrong unit."""
    ends = [_ends(one) for _, one in found if len(one.time)]
    swing = max((0.5 * (largest - smallest) for largest, smallest in ends), default=0.0)
    asked = built.settings.orbit
    return headline.doubted(built, swing, asked.normal_force if asked else None, in_time=True)


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


def _pictures(found: Sequence[tuple[str, Orbit]], folder: Path, case: str) -> list[Path]:
    """Phase portraits together, a sheet a motion, and one more for each contact that chatters."""
    from ..pictures.orbit import chatter_picture, orbit_picture, portraits

    seen, drawn = [(name, one) for name, one in found if len(one.time)], list[Path]()
    if len(seen) > 1:  # one that diverges as it settles leaves nothing to draw
        drawn.append(portraits(seen, folder / "phase_portraits.png", f"{case}: phase portraits"))
    for i, (name, one) in enumerate(seen, 1):
        title = f"{case}: {name}\n{one.said}"
        drawn.append(orbit_picture(one, _row(one), folder / f"orbit_{i}.png", title))
        for k, contact in enumerate(one.contacts):
            if classification.chatter(one, k):
                title = f"{case}: {name}, chatter of {contact}"
                drawn.append(chatter_picture(one, k, folder / f"chatter_{i}_{contact}.png", title))
    return drawn


def _table(found: Sequence[tuple[str, Orbit]]) -> dict[str, Any]:
    """Column -> values, one a motion."""
    rows = [_row(one) for _, one in found]
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


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

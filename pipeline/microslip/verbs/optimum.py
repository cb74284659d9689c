"""The normal force, or another setting, at which the highest resonance of a case is lowest."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import lru_cache, partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field

from ..analysis import Analysis, Answer, Files, Question
from ..case import headline
from ..case.assemble import Built
from ..case.messages import lifts
from ..case.problem import forces_of, problem_of
from ..continuation import NO_OPTIMUM, Peak
from ..data import Array
from ..errors import UserError
from ..files.store import ordinary
from ..harmonic_balance import peak
from ..harmonic_balance.growing import verdict
from ..harmonic_balance.peak import HighestPeak, Make, Optimum, Top
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.readout import measured
from ..harmonic_balance.response import NOT_FOUND
from ..harmonic_balance.solver import CONVERGED
from ..report.response import number_tables
from ..results.dataset import Dataset, Variable
from ..results.journal import once
from ..settings.numbers import Model, Number, _tuple
from ..units import METRES, Quantity, percent
from .backbone import amplitude_name

OF_CONTACTS = ("normal_stiffness", "tangential_stiffness", "friction", "roughness")
"""Keys of a contact that may change in all of them at once."""

NORMAL_FORCE = "normal_force"

UNITS = {
    NORMAL_FORCE: "N",
    "normal_stiffness": "N/m",
    "tangential_stiffness": "N/m",
    "roughness": "m",
    "mass": "kg",
    "pressed_at_rpm": "rpm",
    "speed_rpm": "rpm",
    "weak_springs": "Hz",
    "turn": "degrees",
    "phase": "degrees",
}
"""Of settings, by the last part of their names; other ones are told without."""

SIGNED = ("turn", "phase", "place")
"""Keys of angles, which may pass through 0; all others are followed in equal ratios."""

RESONANCE, NOT_VALID = "highest resonance", "not valid: contacts would lift off"
DOUBTFUL = "doubtful"
"""What a row of ``optimum.csv`` is, and behind it what makes one doubtful."""

HARDLY = 0.01
"""Share by which a setting changes the highest resonance over its whole range, below which it is
said to hardly matter: what two tops have to be apart to be two, `harmonic_balance.sweeps.DIP`."""

TABLE = "optimum.csv"


class Keys(Model):
    """The value of a setting at which the highest resonance is lowest, by `microslip optimum`."""

    over: str = NORMAL_FORCE
    """`normal_force`, a key of the contacts (`friction`, `tangential_stiffness`, ...: of all), or
    any key of the case by its dotted name, or of its system.toml behind `system.`"""
    low: Number | None = None
    """first value of the range that is searched; the smallest of `sweep.normal_forces` if not
    given"""
    high: Number | None = None
    """last value of it; the largest of `sweep.normal_forces` if not given"""
    points: Annotated[int, Field(ge=2, le=10000)] = 6
    """values from one end to the other at which a sweep looks for it first"""
    beside: Annotated[
        tuple[str, ...], BeforeValidator(lambda v: (v,) if isinstance(v, str) else _tuple(v))
    ] = ()
    """cases, or folders of their products, whose optimum over the same setting was found before,
    drawn on the same picture"""

    @property
    def setting(self) -> str:
        """What varies; the command line writes hyphens."""
        return NORMAL_FORCE if self.over == "normal-force" else self.over


def solve(q: Question) -> Answer:
    """The highest resonance at the values and between them; whole if it is known where it is
    lowest."""
    asked: Keys = q.asked
    built, over = q.built, asked.setting
    others = found_before(asked.beside, over, measured(built.assembly))
    found = search(q)
    return answer(found, over, built, others, _remarks(found, over, built, q.report))


def search(q: Question) -> Optimum:
    """The value of a setting at which the highest resonance of the sweep's band is lowest.

    Raises:
        UserError: no range, or contacts that the sweep does not press.
    """
    asked: Keys = q.asked
    built, over = q.built, asked.setting
    forces = [n for n in forces_of(built) if n is not None]
    signed = over.rpartition(".")[2] in SIGNED
    low, high = _ends(asked, forces, signed)
    if over == NORMAL_FORCE and not forces:
        raise UserError(
            "no contact is pressed by the sweep's normal forces; there is nothing to change"
        )
    if over == NORMAL_FORCE:
        make = under_forces(built, low, high)
    else:  # what is wrong with the key, or at an end, is said before anything is computed
        _refuse_contacts(over, built)
        for value in (low, high):
            _with(q, value)
        normal = forces[-1] if forces else None
        length = problem_of(built, normal).length
        make = lru_cache(maxsize=64)(
            lambda value: problem_of(_with(q, value), normal, length=length)
        )

    def look(value: float, problem: Problem) -> Top:
        return kept_top(
            once(q.kept, RESONANCE, value, lambda: row_of(peak.highest(problem, band, q.report)))
        )

    band = 2 * np.pi * built.settings.sweep.grid
    values = (np.linspace if signed else np.geomspace)(low, high, asked.points)
    return peak.optimum(make, values.tolist(), band, report=q.report, look=look)


def under_forces(built: Built, low: float, high: float) -> Make:
    """The balance of a case under a normal force (N) between two, its scale the same for all."""
    length = problem_of(built, float(np.sqrt(low * high))).length
    return lru_cache(maxsize=64)(partial(problem_of, built, length=length))


def _ends(asked: Keys, forces: Sequence[float], signed: bool) -> tuple[float, float]:
    """Of the range."""
    low, high = asked.low, asked.high
    if asked.setting == NORMAL_FORCE and len(forces) > 1:
        low = min(n for n in forces if n > 0) if low is None else low
        high = max(forces) if high is None else high
    if low is None or high is None or not low < high or not (low > 0 or signed):
        kind = "numbers" if signed else "positive numbers"
        none = (
            "" if low is None or high is None else f" from {low:g} to {high:g} there is no range;"
        )
        raise UserError(
            f"{asked.setting}:{none} give --low and --high, two {kind}, the first one smaller"
        )
    return low, high


def _refuse_contacts(over: str, built: Built) -> None:
    """Refuse a key of contacts that names none of them."""
    whose, _, key = over.partition(".")
    if whose == "contacts" and key in OF_CONTACTS:
        names = ", ".join(c.interface for c in built.settings.contacts)
        raise UserError(
            f"names no contact; write --over {key} for all of them, or contacts.NAME.{key} with "
            f"NAME of {names}",
            "over",
        )


def _with(q: Question, value: float) -> Built:
    """The case with another value of its setting; one of `OF_CONTACTS` in every contact that has
    it."""
    over, contacts = q.asked.setting, q.varied.raw.get("contacts", [])
    keys = (
        [f"contacts.{i}.{over}" for i, c in enumerate(contacts) if over in c]
        if over in OF_CONTACTS
        else [over]
    )
    built: Built = q.varied.built(dict.fromkeys(keys, value), f"optimum.over: {over}")
    return built


# the highest resonance, as a journal keeps it ----------------------------------------------------


def row_of(top: Top) -> dict[str, Any]:
    """What a journal keeps of it."""
    return {**vars(top.peak), "end": top.end or np.nan, "unsolved": top.unsolved}


def kept_top(row: Mapping[str, Any]) -> Top:
    """`row_of` back."""
    top = Peak(**{f.name: row[f.name] for f in fields(Peak)})
    return Top(top, None if np.isnan(row["end"]) else row["end"], row["unsolved"])


# tables and sentences ----------------------------------------------------------------------------


def answer(
    found: Optimum,
    over: str,
    built: Built,
    beside: Mapping[str, Array],
    remarks: Sequence[str] = (),
) -> Answer:
    """``optimum.csv``: the highest resonance at every value and the optimum; a picture and the
    page.

    Args:
        beside: see `found_before`. remarks: more sentences.
    """
    from ..pictures.following import optimum_plot

    of, case = measured(built.assembly), built.settings.name
    data, files = dataset_of(found, over, built), Files()
    if any(one.status == CONVERGED for one in found.found.values()):
        label = over.replace("_", " ") + (unit_of(over) and f" in{unit_of(over)}")
        title = f"{case}: highest resonance and optimum"
        good = {value: valid(one, built) for value, one in found.found.items()}
        files["pictures/optimum.png"] = lambda p: optimum_plot(
            found, label, title, p, of, case, beside, good
        )
    why = missed(found, over)
    said = [
        f"{optimum_message(found, over, of)}{doubt(found.resonance, built)}.",
        *([f"{why}."] if why else []),
    ]
    said += [_lowest_of(name, values, over, of) for name, values in beside.items()]
    return Answer(
        [*said, *remarks],
        data={"": data},
        tables=number_tables({TABLE: data.columns()}),
        largest=None,
        files=files,
        missing=why,
    )


def dataset_of(found: Optimum, over: str, built: Built) -> Dataset:
    """A row a value, and the optimum; NaN where no resonance is known."""
    each = found.found.items()
    rows = [
        (v, one, RESONANCE + doubt(one, built) if one.status == CONVERGED else one.status)
        for v, one in each
    ]
    if found.resonance.status == CONVERGED:
        what = f"optimum: {found.status}" if is_optimum(found) else f"lowest: {found.status}"
        what = "lowest: the setting hardly matters" if hardly(found) else what
        rows.append((found.parameter, found.resonance, what))
    return _table(over, measured(built.assembly), rows)


def _table(over: str, of: Quantity, rows: Sequence[tuple[float, HighestPeak, str]] = ()) -> Dataset:
    """Of a value, the resonance there and what it is, each."""
    numbers = np.array(
        [
            (v, one.Omega / (2 * np.pi), one.amplitude)
            if one.status == CONVERGED
            else (v, *UNKNOWN)
            for v, one, _ in rows
        ]
    ).reshape(-1, 3)
    value, frequency, amplitude = numbers.T
    unit, name = UNITS.get(over.rpartition(".")[2], "1"), amplitude_name(of)
    return Dataset(
        "optimum",
        {
            over: Variable(value, unit, "of the setting"),
            "frequency": Variable(frequency, "Hz", "of the highest resonance"),
            name: Variable(amplitude, of.unit, "of the first read-out there, 0-peak"),
            "what": Variable(np.array([what for *_, what in rows], str), "1", "it is"),
        },
    )


UNKNOWN = np.nan, np.nan


def unit_of(over: str) -> str:
    """`` kg``: of a setting, behind a number; nothing where it is not known."""
    unit = UNITS.get(over.rpartition(".")[2], "")
    return unit and f" {unit}"


def _left_by(name: str) -> Path:
    """The table that a case, or the folder of its products, has left."""
    folder = Path("build") / name
    return (folder if folder.is_dir() else Path(name)) / TABLE


def found_before(names: Sequence[str], over: str, of: Quantity) -> dict[str, Array]:
    """Highest resonances of other cases, from the ``optimum.csv`` that each has left.

    Returns:
        Case -> (4, k): values of the setting, frequencies (Hz), amplitudes, and 1 where they are
        valid, else 0.

    Raises:
        UserError: a case without that table, or one over another setting or of another quantity.
    """
    found = {}
    for name in names:
        if not (file := _left_by(name)).is_file():
            file = Path("build") / name / TABLE
            raise UserError(
                f"{name}: there is no {file}; type microslip optimum {name} --over {over} first",
                "beside",
            )
        head, *rows = csv.reader(ordinary(file).read_text(encoding="utf-8").splitlines())
        if head != (asked := list(_table(over, of).columns())):
            raise UserError(
                f"holds {', '.join(head)}, not {', '.join(asked)}; name another case", file=file
            )
        known = [
            [*map(float, row[:3]), row[3] == RESONANCE]
            for row in rows
            if row[3].startswith(RESONANCE)
        ]
        if not known:
            why = f" ({rows[0][3]})" if rows else ""
            raise UserError(
                f"no resonance is known at any value{why}; name another case", file=file
            )
        found[file.parent.name] = np.array(known).T
    return found


def _lowest_of(name: str, values: Array, over: str, of: Quantity) -> str:
    """The lowest of the resonances of another case."""
    value, f, amplitude, good = values[:, values[2].argmin()]
    said = "" if good else "; doubtful or not valid, see its optimum.csv"
    where = f"{over} = {value:.4g}{unit_of(over)}, {of.sized(amplitude)} at {f:.5g} Hz"
    return f"{name}: lowest at {where}{said}."


def valid(one: HighestPeak, built: Built) -> bool:
    """Whether no contact is open at a resonance though what stands for its law does not follow it,
    and all points of the sweep that led to it have a solution."""
    return not one.unsolved and (one.open is None or not lifts(built, one.open[None])[0])


def doubt(one: HighestPeak, built: Built) -> str:
    """What speaks against a resonance, behind a semicolon; nothing, where nothing does."""
    if one.status != CONVERGED or valid(one, built):
        return ""
    return f"; {DOUBTFUL}: {one.unsolved}" if one.unsolved else f"; {NOT_VALID}"


def _remarks(found: Optimum, over: str, built: Built, report: Any) -> list[str]:
    """How uncertain the lowest of the highest resonances is for want of harmonics, whether it is
    stable, and what looks like a number in a wrong unit in any of them."""
    best, known = (
        found.resonance,
        {v: one for v, one in found.found.items() if one.status == CONVERGED},
    )
    if not known:
        return []
    at = f"{best.Omega / (2 * np.pi):.6g} Hz under {over} = {found.parameter:.6g}{unit_of(over)}"
    error, stable = None, list[str]()
    if found.problem is not None and best.status == CONVERGED:
        report("error of harmonics and samples")
        error = headline.estimated(built, found.problem, best.x, best.Omega)
        stable = verdict(found.problem, best.x, best.Omega, f"The motion at {at}")
    forces = known if over == NORMAL_FORCE else [n for n in forces_of(built) if n is not None]
    largest = max(one.amplitude for one in known.values())
    doubts = headline.doubted(built, largest, max(forces, default=None))
    return [*headline.said_of(built.settings, f"The amplitude at {at}", error), *stable, *doubts]


def optimum_message(found: Optimum, over: str, of: Quantity = METRES) -> str:
    """The optimum of what is read in a sentence."""
    best, unit = found.resonance, unit_of(over)
    if best.status != CONVERGED:
        return f"{over}: no resonance is known at any value{_unknown(found, unit)}"
    name, low, high = (
        "normal force" if over == NORMAL_FORCE else over,
        min(found.found),
        max(found.found),
    )
    height, at = of.sized(best.amplitude), f"{best.Omega / 2 / np.pi:.6g} Hz"
    if hardly(found):
        changes = (
            f"less than {percent(found.spread)}"
            if found.spread > 1e-6
            else "nothing that could be told"
        )
        said = f"the setting hardly matters: from {name} = {low:g} to {high:g}{unit} the highest "
        said += f"resonance, {height} at {at}, changes by {changes}"
        return f"{said}{_unknown(found, unit)}{_rising(found, unit)}"
    said = (
        f"{name} = {found.parameter:.6g}{unit}: the highest resonance, {height} at {at}, is lowest"
    )
    if end := end_of(found):
        beyond = f"--low below {low:g}" if end == "--low" else f"--high above {high:g}"
        said += f" of all from {low:g} to {high:g}{unit}: it falls towards this end, so an optimum "
        said += f"may lie beyond; look there with {beyond}"
    elif not is_optimum(found):
        said += " of those that were found"
    abrupt = {"kink": " (where it changes abruptly)", "two peaks": " (where two are equally high)"}
    return f"{said}{abrupt.get(found.status, '')}{_unknown(found, unit)}{_rising(found, unit)}"


def _unknown(found: Optimum, unit: str) -> str:
    """At which values no resonance is known, and why."""
    why: dict[str, list[str]] = {}
    for value, one in found.found.items():
        if one.status != CONVERGED:
            why.setdefault(one.status, []).append(f"{value:.4g}")
    return "".join(f"; at {', '.join(values)}{unit} {status}" for status, values in why.items())


def _rising(found: Optimum, unit: str) -> str:
    """Where the response is higher at an end of the band than any resonance in it."""
    said = ""
    for end in sorted(set(found.rising.values())):
        values = ", ".join(f"{value:.4g}" for value, where in found.rising.items() if where == end)
        said += f"; at {values}{unit} the response is higher still at {end / 2 / np.pi:.6g} Hz, an "
        said += "end of the band: a resonance may lie beyond, widen the sweep"
    return said


def hardly(found: Optimum) -> bool:
    """Whether the setting hardly matters: no resonance that is known is much higher than
    another."""
    return found.spread < HARDLY and all(one.status == CONVERGED for one in found.found.values())


def is_optimum(found: Optimum) -> bool:
    """Whether the lowest place lies between the ends."""
    return found.status in ("converged", "kink", "two peaks")


def end_of(found: Optimum) -> str:
    """The end of the range at which the resonance is lowest, by the option that moves it; nothing
    where there is an optimum in between, or none is known."""
    ends = {min(found.found): "--low", max(found.found): "--high"}
    return ends.get(found.parameter, "") if found.status == NO_OPTIMUM else ""


def missed(found: Optimum, over: str) -> str:
    """Why it is not known where the resonance is lowest, or at which values the search failed;
    nothing where it is, or the setting hardly matters."""
    if not (is_optimum(found) or hardly(found) or end_of(found)):
        return f"no optimum was found: {found.status}"
    lost = [f"{v:.4g}" for v, one in found.found.items() if one.status.startswith(NOT_FOUND)]
    if not lost:
        return ""
    what = "optimum" if is_optimum(found) else "lowest"
    values = f"{', '.join(lost)}{unit_of(over)}"
    return f"at {values} no resonance was found; the {what} is that of the others"


ANALYSIS = Analysis(
    "optimum",
    Keys,
    solve,
    lost="it is not known where the resonance is lowest",
    options=("over", "low", "high", "points", "beside"),
    files=lambda asked: [str(_left_by(name).resolve()) for name in asked.beside],
)

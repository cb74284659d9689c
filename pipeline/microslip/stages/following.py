"""What is followed from a case instead of swept: backbones, the optimum of a setting, and the stability of a response.

Each is a table (CSV) and a picture in the case's folder, and sentences for the terminal.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..basis import read_basis
from ..case import checkpoint, headline, load_case
from ..case.assemble import Built
from ..case.messages import lifts
from ..case.problem import forces_of, pressed_by, problem_of
from ..continuation import NO_OPTIMUM
from ..data import Array
from ..errors import UserError, in_its_file
from ..files import store
from ..files.store import ordinary
from ..files.tables import rows_csv
from ..harmonic_balance.growing import verdict
from ..harmonic_balance.nonlinear_modes import REACHED
from ..harmonic_balance.readout import measured
from ..harmonic_balance.response import NOT_FOUND
from ..harmonic_balance.solver import CONVERGED
from ..results import read_response
from ..results.checks import checked, largest
from ..units import METRES, Quantity, percent
from .stage import Report, Stage
from .varied import Varied

if TYPE_CHECKING:
    from ..harmonic_balance.nonlinear_modes import Backbone
    from ..harmonic_balance.peak import HighestPeak, Optimum
    from ..harmonic_balance.problem import Problem
    from ..harmonic_balance.stability import Stability

OF_CONTACTS = ("normal_stiffness", "tangential_stiffness", "friction", "roughness")
"""Keys of a contact that `optimum` may change in all of them at once."""

NORMAL_FORCE = "normal_force"
_NONE: Mapping[str, Array] = MappingProxyType({})
_UNITS = {
    NORMAL_FORCE: "N", "normal_stiffness": "N/m", "tangential_stiffness": "N/m", "roughness": "m", "mass": "kg",
    "pressed_at_rpm": "rpm", "speed_rpm": "rpm", "weak_springs": "Hz", "turn": "degrees", "phase": "degrees",
}  # fmt: skip
"""Of settings, by the last part of their names; other ones are told without."""
_SIGNED = ("turn", "phase", "place")
"""Keys of angles, which may pass through 0; all others are followed in equal ratios."""


@dataclass(frozen=True)
class Case(Varied):
    """A case file and its modal files. Attributes: see `Varied`; folder: of its products."""

    folder: Path

    @property
    def name(self) -> str:
        """Of the case."""
        return str(self.raw.get("name", self.path.stem))

    @cached_property
    def quantity(self) -> Quantity:
        """What the first read-out measures."""
        return measured(self.plain.assembly)

    @cached_property
    def plain(self) -> Built:
        """With its keys as they are."""
        return self.built({}, "")

    def with_(self, key: str, value: float) -> Built:
        """With another value of a key; one of `OF_CONTACTS` in every contact that has it."""
        all_of_them = [f"contacts.{i}.{key}" for i, c in enumerate(self.raw.get("contacts", [])) if key in c]
        return self.built(dict.fromkeys(all_of_them if key in OF_CONTACTS else [key], value), f"--over {key}")

    def table(self, name: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> Path:
        """A CSV file of the case, whose picture and page are yet to be made: those of an earlier
        run must not stand beside it, should this one end here."""
        stem = name.removesuffix(".csv")
        for former in (f"{stem}.html", f"pictures/{stem}.png"):
            (self.folder / former).unlink(missing_ok=True)
        file = self.folder / name
        store.write_text(file, rows_csv(head, rows))
        store.write_json(store.sidecar_path(file), Stage(file, (), case=self.path).origin_noted())
        return file


def open_case(path: Path, files: Mapping[str, Path], folder: Path, assignments: Sequence[str] = ()) -> Case:
    """A case and its modal files."""
    _, raw = checkpoint.followed(*load_case(path, assignments), folder)
    return Case(path, raw, {name: read_basis(file) for name, file in files.items()}, folder)


# nonlinear modes -----------------------------------------------------------------------------------------------------


@in_its_file
def backbones(
    case: Case,
    mode: int | None = None,
    low: float | None = None,
    high: float | None = None,
    report: Report = lambda _: None,
) -> dict[float, Backbone]:
    """Frequency and damping over the amplitude of the first read-out, for every normal force (N) of the case.

    Args:
        mode: number of the mode with sticking contacts, 1 the lowest; the one that answers the excitation most in the
            band of the sweep if not given.
        low, high: amplitudes, m; from a thirtieth to thirty times where the contacts begin to slide if not given.
    """
    from ..harmonic_balance.nonlinear_modes import about_rest, backbone, sliding_amplitude

    found: dict[float, Backbone] = {}
    built, of = case.plain, case.quantity
    asked_for = forces_of(built)
    forces = [n for n in asked_for if n != 0] or asked_for
    if 0.0 in asked_for:
        report("left out: a normal force of 0 N, under which nothing sticks")
    for count, asked in enumerate(forces, 1):
        problem = about_rest(problem_of(built, asked, form="relative"))[0]
        normal = pressed_by(built, problem) if asked is None else asked
        report(f"backbone at F_N = {normal:g} N, {count} of {len(forces)}")
        number = _mode_of(case, problem, mode)
        begins = sliding_amplitude(problem, number)
        found[normal] = backbone(problem, low or begins / 30, high or begins * 30, number, report=report)
        _backbone_table(found, case)
        one = found[normal]
        said = f"mode {number + 1}, {one.stuck / 2 / np.pi:.6g} Hz stuck"
        if len(one.amplitude):
            i = int(np.argmax(one.damping))
            said += (
                f", {one.Omega[-1] / 2 / np.pi:.6g} Hz at {of.sized(one.amplitude[-1], 3)}; damping at most "
                f"{100 * one.damping[i]:.3g} % at {of.sized(one.amplitude[i], 3)}"
            )
            said += f"; {checked(largest(one.checks))}"
        report(f"F_N = {normal:g} N: {said}" + ("" if one.complete else f" ({one.failing or one.status})"))
    return found


def _mode_of(case: Case, problem: Problem, mode: int | None) -> int:
    """Number of a mode with sticking contacts, 0 the lowest: the one asked for (from 1), or the strongest of the
    sweep's band."""
    from ..harmonic_balance.nonlinear_modes import strongest

    sweep = case.plain.settings.sweep
    if mode is not None:
        return counted_from_1(problem, mode)
    return strongest(problem, 2 * np.pi * sweep.start, 2 * np.pi * sweep.stop)


def counted_from_1(problem: Problem, mode: int) -> int:
    """Number of a mode with sticking contacts, 0 the lowest, that a person counts from 1.

    Raises:
        UserError: a rigid motion that neither supports nor contacts hold.
    """
    from ..harmonic_balance.nonlinear_modes import RIGID, stuck_modes

    omega = stuck_modes(problem)[0]
    rigid = int((omega <= RIGID * omega.max(initial=0.0)).sum())
    if not 1 <= mode <= rigid:
        return mode - 1
    first = f"; the first is --mode {rigid + 1}, {omega[rigid] / (2 * np.pi):.5g} Hz" if rigid < len(omega) else ""
    raise UserError(
        f"--mode {mode}: is a rigid motion at 0 Hz, which neither supports nor sticking contacts hold, and has no "
        f"backbone; choose a mode that vibrates{first}"
    )


def remarks_on_backbones(
    found: Mapping[float, Backbone], case: Case, mode: int | None = None, report: Report = lambda _: None
) -> list[str]:
    """How uncertain the largest damping ratio is for want of harmonics, and what looks like a number in a wrong unit.

    Args:
        mode: see `backbones`.
    """
    from ..harmonic_balance import nonlinear_modes

    known = [(n, one) for n, one in found.items() if len(one.damping) and not one.failing]
    if not known:
        return []
    normal, best = max(known, key=lambda pair: float(pair[1].damping.max()))
    at, built, e = int(best.damping.argmax()), case.plain, None
    asked = None if forces_of(built) == [None] else normal
    problem = nonlinear_modes.about_rest(problem_of(built, asked, form="relative"))[0]
    if headline.is_estimated(built, problem):
        report("error of harmonics and samples")
        e = nonlinear_modes.error(problem, best, at, _mode_of(case, problem, mode))
    amplitude = float(best.amplitude[at])
    where = f"The damping ratio at {case.quantity.sized(amplitude, 3)} under F_N = {normal:g} N"
    said = headline.said_of(built.settings, where, e)
    return _told_of(said, headline.doubted(built, amplitude, max(found)), report)


def _told_of(said: list[str], doubts: list[str], report: Report) -> list[str]:
    """Both, reported."""
    for text in [*said, *(f"warning: {doubt}" for doubt in doubts)]:
        report(text)
    return [*said, *doubts]


def unreached(found: Mapping[float, Backbone]) -> str:
    """Which nonlinear modes do not reach all amplitudes, or hold motions that fail their checks; nothing where none."""
    early = [f"{normal:g} N" for normal, one in found.items() if one.status != REACHED]
    said = [f"the backbone at {', '.join(early)} ends early"] if early else []
    said += [f"at {normal:g} N {one.failing}" for normal, one in found.items() if one.failing]
    return "; ".join(said)


def write_backbones(found: Mapping[float, Backbone], case: Case, remarks: Sequence[str] = ()) -> list[Path]:
    """``backbone.csv``, ``pictures/backbone.png`` and ``backbone.html``. remarks: see `remarks_on_backbones`."""
    from ..pictures.following import backbone_plot
    from ..pictures.plots import save

    title, picture = _title(case, "nonlinear mode"), case.folder / "pictures" / "backbone.png"
    draw = partial(backbone_plot, found, title, of=case.quantity)
    files = [_backbone_table(found, case), save(draw, picture)]
    said = [_backbone_message(normal, one, case.quantity) for normal, one in sorted(found.items())]
    return [*files, _page(case, "backbone", title, [*said, *remarks], files)]


def _backbone_message(normal: float, one: Backbone, of: Quantity) -> str:
    """A nonlinear mode in a sentence."""
    if not len(one.amplitude):
        return f"F_N = {normal:g} N: no motion was found: {one.status}."
    i, f = int(one.damping.argmax()), one.frequency
    said = (
        f"F_N = {normal:g} N: from {f[0]:.5g} Hz (sticking: {one.stuck / 2 / np.pi:.5g} Hz) to {f[-1]:.5g} Hz; most "
        f"damped, {100 * one.damping[i]:.3g} %, at an amplitude of {of.sized(one.amplitude[i], 3)} and {f[i]:.5g} Hz"
    )
    said += f"; {one.failing}" if one.failing else ""
    return said + ("." if one.status == REACHED else f"; it ends early: {one.status}.")


def _page(case: Case, name: str, title: str, sentences: Sequence[str], files: Sequence[Path]) -> Path:
    """The page of tables and pictures that were written."""
    from ..report.page import answer_page
    from ..report.response import number_tables

    tables = {}
    for file in (f for f in files if f.suffix == ".csv"):
        head, *rows = csv.reader(file.read_text(encoding="utf-8").splitlines())
        tables[file.name] = dict(zip(head, zip(*rows, strict=True), strict=True)) if rows else {}
    page = case.folder / f"{name}.html"
    drawn = [f for f in files if f.suffix == ".png"]
    store.write_text(page, answer_page(title, sentences, drawn, *number_tables(tables)))
    return page


def _backbone_table(found: Mapping[float, Backbone], case: Case) -> Path:
    rows = []
    for normal, one in sorted(found.items()):
        order = zip(one.amplitude, one.Omega / (2 * np.pi), one.damping, strict=True)
        rows += [(f"{normal:g}", f"{a:.8g}", f"{f:.10g}", f"{d:.8g}") for a, f, d in order]
    head = ("normal_force_N", case.quantity.column("amplitude"), "frequency_Hz", "damping_ratio")
    return case.table("backbone.csv", head, rows)


def _title(case: Case, what: str) -> str:
    return f"{case.name}: {what}"


# the optimum of a setting --------------------------------------------------------------------------------------------


@in_its_file
def optimum_over(
    case: Case, over: str = NORMAL_FORCE, low: float | None = None, high: float | None = None, points: int = 6,
    report: Report = lambda _: None,
) -> Optimum:  # fmt: skip
    """The value of a setting at which the highest resonance of the sweep's band is lowest.

    Args:
        over: ``normal_force``; a key of the contacts, changed in all of them; or any key of the case, dotted.
        low, high: of that value, above 0 if it is no angle; the sweep's normal forces if not given. points: values
            from one to the other at which it is looked for. ``optimum.csv`` holds the resonances as they are found.

    Raises:
        UserError: no range, or contacts that the sweep does not press.
    """
    from ..harmonic_balance.peak import optimum

    built = case.plain
    forces = [n for n in forces_of(built) if n is not None]
    if over == NORMAL_FORCE and len(forces) > 1:
        low = min(n for n in forces if n > 0) if low is None else low
        high = max(forces) if high is None else high
    signed = over.rpartition(".")[2] in _SIGNED
    if low is None or high is None or not low < high or not (low > 0 or signed):
        kind = "numbers" if signed else "positive numbers"
        given = "" if low is None or high is None else f" from {low:g} to {high:g} there is no range;"
        raise UserError(f"{over}:{given} give --low and --high, two {kind}, the first one smaller")
    if over == NORMAL_FORCE and not forces:
        raise UserError("no contact is pressed by the sweep's normal forces; there is nothing to change")
    if over != NORMAL_FORCE:  # what is wrong with the key, or at an end, is said before anything is computed
        _check_key(over, case)
        for value in (low, high):
            case.with_(over, value)
    between = float(np.sqrt(low * high)) if over == NORMAL_FORCE else forces[-1] if forces else None
    length = problem_of(built, between).length

    @lru_cache(maxsize=64)
    def make(value: float) -> Problem:
        normal = value if over == NORMAL_FORCE else forces[-1] if forces else None
        return problem_of(built if over == NORMAL_FORCE else case.with_(over, value), normal, length=length)

    sweep = built.settings.sweep
    band = 2 * np.pi * np.linspace(sweep.start, sweep.stop, sweep.points)

    def keep(found: Mapping[float, HighestPeak]) -> None:
        _optimum_table(found, over, case)

    values = np.linspace(low, high, points) if signed else np.geomspace(low, high, points)
    return optimum(make, [float(v) for v in values], band, report=report, keep=keep)


def _check_key(over: str, case: Case) -> None:
    """Refuse a key of contacts that names none of them."""
    whose, _, key = over.partition(".")
    if whose == "contacts" and key in OF_CONTACTS:
        names = ", ".join(c.interface for c in case.plain.settings.contacts)
        raise UserError(
            f"names no contact; write --over {key} for all of them, or contacts.NAME.{key} with NAME of {names}",
            f"--over {over}",
        )


def remarks_on_optimum(found: Optimum, over: str, case: Case, report: Report = lambda _: None) -> list[str]:
    """How uncertain the lowest of the highest resonances is for want of harmonics, and what looks like a number in a
    wrong unit in any of them."""
    best, built, e = found.resonance, case.plain, None
    known = {value: one for value, one in found.found.items() if one.status == CONVERGED}
    if not known:
        return []
    if found.problem is not None and best.status == CONVERGED:
        report("error of harmonics and samples")
        e = headline.estimated(built, found.problem, best.x, best.Omega)
    at = f"{best.Omega / (2 * np.pi):.6g} Hz under {over} = {found.parameter:.6g}{unit_of(over)}"
    said = headline.said_of(built.settings, f"The amplitude at {at}", e)
    if found.problem is not None and best.status == CONVERGED:
        said += verdict(found.problem, best.x, best.Omega, f"The motion at {at}")
    forces = known if over == NORMAL_FORCE else [n for n in forces_of(built) if n is not None]
    largest = max(one.amplitude for one in known.values())
    return _told_of(said, headline.doubted(built, largest, max(forces, default=None)), report)


def write_optimum(
    found: Optimum,
    over: str,
    case: Case,
    beside: Mapping[str, Array] = _NONE,
    remarks: Sequence[str] = (),
) -> list[Path]:
    """``optimum.csv``: the highest resonance at every value and the optimum; ``pictures/optimum.png``;
    ``optimum.html``. beside: see `found_before`. remarks: more sentences of the page."""
    from ..pictures.following import optimum_plot
    from ..pictures.plots import save

    files, title = [_optimum_table(found.found, over, case, found)], _title(case, "highest resonance and optimum")
    if any(one.status == CONVERGED for one in found.found.values()):
        label = over.replace("_", " ") + (unit_of(over) and f" in{unit_of(over)}")
        picture = case.folder / "pictures" / "optimum.png"
        good = {value: valid(one, case) for value, one in found.found.items()}
        more: dict[str, Any] = {"of": case.quantity, "name": case.name, "others": beside, "valid": good}
        files.append(save(partial(optimum_plot, found, label, title, **more), picture))
    said = [
        f"{told(found, over, case)}.",
        *([f"{why}."] if (why := missed(found, over)) else []),
        *(_lowest_of(name, values, over, case.quantity) for name, values in beside.items()),
        *remarks,
    ]
    return [*files, _page(case, "optimum", title, said, files)]


def found_before(names: Sequence[str], over: str, case: Case) -> dict[str, Array]:
    """Highest resonances of other cases, from the ``optimum.csv`` that each has left.

    Args:
        names: of the cases, or the folders of their products.

    Returns:
        Case -> (4, k): values of the setting, frequencies (Hz), amplitudes, and 1 where they are valid, else 0.

    Raises:
        UserError: a case without that table, or one over another setting or of another quantity.
    """
    found = {}
    for name in names:
        folder = case.folder.parent / name
        folder = folder if folder.is_dir() else Path(name)
        if not (file := folder / "optimum.csv").is_file():
            file = case.folder.parent / name / file.name
            raise UserError(f"--beside {name}: there is no {file}; type microslip optimum {name} --over {over} first")
        asked = _optimum_head(over, case)
        head, *rows = csv.reader(ordinary(file).read_text(encoding="utf-8").splitlines())
        if head != asked:
            raise UserError(f"{file}: holds {', '.join(head)}, not {', '.join(asked)}; name another case")
        known = [[*map(float, row[:3]), row[3] == RESONANCE] for row in rows if row[3].startswith(RESONANCE)]
        if not known:
            why = f" ({rows[0][3]})" if rows else ""
            raise UserError(f"{file}: no resonance is known at any value{why}; name another case")
        found[folder.name] = np.array(known).T
    return found


def _lowest_of(name: str, values: Array, over: str, of: Quantity) -> str:
    """The lowest of the resonances of another case."""
    value, f, amplitude, valid = values[:, values[2].argmin()]
    said = "" if valid else "; doubtful or not valid, see its optimum.csv"
    return f"{name}: lowest at {over} = {value:.4g}{unit_of(over)}, {of.sized(amplitude)} at {f:.5g} Hz{said}."


RESONANCE, NOT_VALID = "highest resonance", "not valid: contacts would lift off"
DOUBTFUL = "doubtful"
"""What a row of ``optimum.csv`` is, and behind it what makes one doubtful."""


def valid(one: HighestPeak, case: Case) -> bool:
    """Whether no contact is open at a resonance though what stands for its law does not follow it, and all points of
    the sweep that led to it have a solution."""
    return not one.unsolved and (one.open is None or not lifts(case.plain, one.open[None])[0])


def told(found: Optimum, over: str, case: Case) -> str:
    """`optimum_message`, and whether it is valid."""
    return optimum_message(found, over, case.quantity) + doubt(found.resonance, case)


def doubt(one: HighestPeak, case: Case) -> str:
    """What speaks against a resonance, behind a semicolon; nothing, where nothing does."""
    if one.status != CONVERGED or valid(one, case):
        return ""
    return f"; {DOUBTFUL}: {one.unsolved}" if one.unsolved else f"; {NOT_VALID}"


def _optimum_table(found: Mapping[float, HighestPeak], over: str, case: Case, best: Optimum | None = None) -> Path:
    shown = [
        (v, r, RESONANCE + doubt(r, case) if r.status == CONVERGED else r.status) for v, r in found.items()
    ]  # fmt: skip
    if best is not None and best.resonance.status == CONVERGED:
        what = f"optimum: {best.status}" if is_optimum(best) else f"lowest: {best.status}"
        shown.append((best.parameter, best.resonance, "lowest: the setting hardly matters" if hardly(best) else what))
    rows = [(f"{v:.10g}", *_place(r), what) for v, r, what in shown]
    return case.table("optimum.csv", _optimum_head(over, case), rows)


def _place(one: HighestPeak) -> tuple[str, str]:
    """Frequency (Hz) and amplitude of a resonance as cells, empty where none is known."""
    known = one.status == CONVERGED
    return (f"{one.Omega / 2 / np.pi:.10g}", f"{one.amplitude:.8g}") if known else ("", "")


def _optimum_head(over: str, case: Case) -> list[str]:
    """Headings of ``optimum.csv``, with their units where they are known."""
    unit = unit_of(over).strip().replace("/", "_")
    return [f"{over}_{unit}".removesuffix("_"), "frequency_Hz", case.quantity.column("amplitude"), "what"]


def unit_of(over: str) -> str:
    """`` kg``: of a setting, behind a number; nothing where it is not known."""
    unit = _UNITS.get(over.rpartition(".")[2], "")
    return unit and f" {unit}"


def optimum_message(found: Optimum, over: str, of: Quantity = METRES) -> str:
    """The optimum of what is read in a sentence."""
    best, unit = found.resonance, unit_of(over)
    if best.status != CONVERGED:
        return f"{over}: no resonance is known at any value{_unknown(found, unit)}"
    name, height = "normal force" if over == NORMAL_FORCE else over, of.sized(best.amplitude)
    if hardly(found):
        changes = f"less than {percent(found.spread)}" if found.spread > 1e-6 else "nothing that could be told"
        lines = f"the setting hardly matters: from {name} = {min(found.found):g} to {max(found.found):g}{unit} the "
        lines += f"highest resonance, {height} at {best.Omega / 2 / np.pi:.6g} Hz, changes by {changes}"
    else:
        lines = f"{name} = {found.parameter:.6g}{unit}: the highest resonance, {height} at "
        lines += f"{best.Omega / 2 / np.pi:.6g} Hz, is lowest"
        lines += _FOUND_AS.get(found.status, "") or _at_an_end(found, unit)
        lines += "" if is_optimum(found) or end_of(found) else " of those that were found"
    return lines + _unknown(found, unit) + _rising(found, unit)


def _unknown(found: Optimum, unit: str) -> str:
    """At which values no resonance is known, and why."""
    why: dict[str, list[float]] = {}
    for value, one in found.found.items():
        if one.status != CONVERGED:
            why.setdefault(one.status, []).append(value)
    return "".join(f"; at {', '.join(f'{v:.4g}' for v in values)}{unit} {status}" for status, values in why.items())


_FOUND_AS = {"kink": " (where it changes abruptly)", "two peaks": " (where two are equally high)"}
"""What an optimum is that is no smooth lowest place."""


def _rising(found: Optimum, unit: str) -> str:
    """Where the response is higher at an end of the band than any resonance in it."""
    said = ""
    for end in sorted(set(found.rising.values())):
        values = ", ".join(f"{value:.4g}" for value, where in found.rising.items() if where == end)
        said += (
            f"; at {values}{unit} the response is higher still at {end / 2 / np.pi:.6g} Hz, an end of the band: a "
            "resonance may lie beyond, widen the sweep"
        )
    return said


HARDLY = 0.01
"""Share by which a setting changes the highest resonance over its whole range, below which it is said to hardly matter:
what two tops have to be apart to be two, `harmonic_balance.sweeps.DIP`."""


def hardly(found: Optimum) -> bool:
    """Whether the setting hardly matters: no resonance that is known is much higher than another."""
    return found.spread < HARDLY and all(one.status == CONVERGED for one in found.found.values())


def is_optimum(found: Optimum) -> bool:
    """Whether the lowest place lies between the ends."""
    return found.status in ("converged", "kink", "two peaks")


def end_of(found: Optimum) -> str:
    """The end of the range at which the resonance is lowest, by the option that moves it; nothing where there is an
    optimum in between, or none is known."""
    if found.status != NO_OPTIMUM:
        return ""
    return {min(found.found): "--low", max(found.found): "--high"}.get(found.parameter, "")


def _at_an_end(found: Optimum, unit: str) -> str:
    """That it is lowest at an end, and where to look for an optimum."""
    if not (end := end_of(found)):
        return ""
    low, high = min(found.found), max(found.found)
    beyond = f"--low below {low:g}" if end == "--low" else f"--high above {high:g}"
    return (
        f" of all from {low:g} to {high:g}{unit}: it falls towards this end, so an optimum may lie "
        f"beyond; look there with {beyond}"
    )


def missed(found: Optimum, over: str) -> str:
    """Why it is not known where the resonance is lowest, or at which values the search failed; nothing where it is, or
    the setting hardly matters."""
    if not (is_optimum(found) or hardly(found) or end_of(found)):
        return f"no optimum was found: {found.status}"
    lost = [f"{v:.4g}" for v, one in found.found.items() if one.status.startswith(NOT_FOUND)]
    unit, what = unit_of(over), "optimum" if is_optimum(found) else "lowest"
    return f"at {', '.join(lost)}{unit} no resonance was found; the {what} is that of the others" if lost else ""


# stability -----------------------------------------------------------------------------------------------------------


@in_its_file
def stabilities(case: Case, report: Report = lambda _: None) -> dict[float, dict[float, Stability]]:
    """Of every converged point of the case's ``response.h5``: normal force, N -> frequency, Hz -> its stability.

    ``stability.csv`` holds the points as they are found.

    Raises:
        UserError: a sector that stands for a ring, whose sectors may part company.
    """
    from ..harmonic_balance.stability import Settings, orbit, stability

    built, found = case.plain, dict[float, dict[float, Any]]()
    if built.settings.ring is not None and built.settings.ring.model == "sector":
        raise UserError('"sector" cannot tell whether the sectors stay alike; write model = "full"', "ring.model")
    if built.settings.mode == "book":
        raise UserError('"book" has no motion in time to perturb; write mode = "aft"', "mode")
    response = read_response(case.folder / "response.h5")
    done, count = 0, sum(int(series.converged.sum()) for series in response.series)
    for series in response.series:
        normal = float(series.parameters["normal_force"])
        problem = problem_of(built, normal if forces_of(built) != [None] else None)
        rows = found.setdefault(normal, {})
        for i in np.flatnonzero(series.converged):
            f = float(series.frequency[i])
            done += 1
            report(f"{done} of {count} points' stability: {normal:g} N, {f:.6g} Hz")
            rows[f] = stability(orbit(problem, series.arrays["x"][i], 2 * np.pi * f), Settings(steps=256))
            _stability_table(found, case)
    return found


def write_stabilities(found: Mapping[float, Mapping[float, Stability]], case: Case) -> list[Path]:
    """``stability.csv`` and ``pictures/stability.png``."""
    from ..pictures.following import stability_plot
    from ..pictures.plots import save

    picture = case.folder / "pictures" / "stability.png"
    draw = partial(stability_plot, found, _title(case, "stability"))
    return [_stability_table(found, case), save(draw, picture)]


def _stability_table(found: Mapping[float, Mapping[float, Stability]], case: Case) -> Path:
    rows = []
    for normal, points in found.items():
        for f, one in sorted(points.items()):
            error = one.error[0] if len(one.error) else 0.0
            cells = f"{normal:g}", f"{f:.10g}", f"{one.stable:d}", f"{one.growth:.6g}", f"{error:.2g}", one.loss
            rows.append(cells)
    return case.table("stability.csv", ("normal_force_N", "frequency_Hz", "stable", "growth", "error", "loss"), rows)


def unstable(found: Mapping[float, Mapping[float, Stability]]) -> str:
    """Which points are not stable, in a sentence."""
    lost = [(n, f, one.loss) for n, points in found.items() for f, one in sorted(points.items()) if not one.stable]
    count = sum(len(points) for points in found.values())
    if not lost:
        return f"all {count} points are stable"
    normal, f, loss = lost[0]
    return f"{len(lost)} of {count} points are not stable, the first at {normal:g} N, {f:.6g} Hz ({loss})"

"""The friction response of a case: from its files to tables, pictures and a page."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..basis import read_basis
from ..case import CaseResult, CaseSettings, checkpoint, headline, load_case, run_case
from ..case.assemble import build
from ..case.beyond import with_curve
from ..case.messages import at_places, lifted, method, off, what_moves
from ..case.run import jumps, with_motions
from ..case.settings import FIRST_HARMONICS
from ..data import Array, ModalBasis
from ..errors import UserError, in_its_file
from ..files import store
from ..files.png import BESIDE
from ..files.tables import rows_csv, write_tables
from ..harmonic_balance.response import HarmonicResponse
from ..harmonic_balance.sweeps import overhanging
from ..report.response import JUMPS, highest, lifted_forces, response_html
from ..results import Response, Series, read_journal, read_response, response_of, response_table, write_response
from ..results.checks import UNCERTAIN, sentence
from ..results.names import apart
from ..results.series import CONVERGED
from ..units import counted, to_rpm
from . import assessment
from .checkpoint import Checkpoint, inputs_of
from .ring import draw_ring
from .stage import Made, Report, Stage

if TYPE_CHECKING:
    from ..operating.contact_maps import ContactMap


@dataclass(frozen=True)
class Wanted:
    """What is made of a response besides its tables.

    Attributes:
        stresses: of the body that is watched, where its modal file holds stress modes: at ``all`` points, so that they
            can be drawn over the frequency, at the ``resonances``, or ``none``. pictures: whether any.
        beside: what else curves are drawn as, see `files.png.BESIDE`.
    """

    stresses: Literal["all", "resonances", "none"] = "all"
    pictures: bool = True
    beside: str = field(default_factory=BESIDE.get)


ALL = Wanted()


@in_its_file
def response_stage(
    case_path: Path, files: Mapping[str, Path], folder: Path, assignments: list[str] | None = None,
    force: bool = False, report: Report = lambda _: None, log: bool = False, wanted: Wanted = ALL,
) -> tuple[dict[str, Any], bool]:  # fmt: skip
    """Friction frequency response of a case in `folder`: HDF5, CSV, pictures, files for ParaView, a summary (JSON).

    Every finished point is kept in ``response.points``, from which an interrupted run goes on.

    Args:
        files: body of the case -> its modal file. log: write ``convergence.csv``. wanted: besides tables.

    Returns:
        The summary, and whether every point converged.
    """
    stage = response_of_case(folder, force, report, case_path)
    with stage.making():
        settings, raw = load_case(case_path, assignments)
        inputs = inputs_of(raw, settings, files)
        more = {"wanted": asdict(ALL)}  # what is there with all that can be made will do
        if wanted == ALL or wanted.beside or not stage.is_made(inputs | more):
            more = {"wanted": asdict(wanted)}
        stage.make(inputs | more, lambda: _work(stage, settings, raw, files, wanted))
        summary = json.loads(stage.product.read_text())
        if log:
            store.write_text(folder / "convergence.csv", convergence_table(read_response(folder / "response.h5")))
        _tell(summary, report)
        report(f"page: {folder / 'response.html'}")
        return summary, summary["failed_points"] == 0


def response_of_case(
    folder: Path, force: bool = False, report: Report = lambda _: None, case: Path | None = None
) -> Stage:
    """The stage whose product is the summary of a response, known by ``response.json``."""
    return Stage(folder / "response.json", ("stages.response",), force, report, case=case)


def _work(
    stage: Stage,
    settings: CaseSettings,
    raw: dict[str, Any],
    files: Mapping[str, Path],
    wanted: Wanted,
) -> Made:
    bases = {name: read_basis(file) for name, file in files.items()}
    folder = stage.product.parent
    told = stage.report if stage.is_unfinished else None
    points = Checkpoint(folder / "response.points", raw, files, stage.force, stage.begin, True, told)
    try:
        begin = _harmonics(points, settings, bases) if settings.looks_for_harmonics else FIRST_HARMONICS
        result = run_case(settings, bases, stage.report, points.journal, begin)
        if places := jumps(result):
            at = f"at {counted(len(places), 'place')} the response jumps, folds or has no solution"
            left = f"Motions in time are not on this page yet: {at}; the same command goes on."
            so_far = replace(result, messages=(*result.messages, left))
            known = _finished(points, so_far, Wanted("none", pictures=False), stage.report)
            stage.clear(folder / name for name in known["files"])
            stage.report(
                f"{folder / 'response.html'} has what is known so far; {at}: dozens of motions in time, of seconds each"
            )
        motions = Checkpoint(folder / "motions.points", raw, files, stage.force, stage.begin, True)
        result = with_motions(result, stage.report, motions.journal)
        curve = Checkpoint(folder / "curve.points", raw, files, stage.force, stage.begin)
        own = bases, curve.journal, stage.report
        each = (with_curve(b, result.responses[b.normal], result.settings, *own) for b in result.beyond)
        result = replace(result, beyond=tuple(each))
    except KeyboardInterrupt:
        _unfinished(points, stage)
        raise
    summary = _finished(points, result, wanted, stage.report)
    store.write_json(stage.product, summary)
    pictures = [folder / "pictures" / name for name in summary["pictures"].values()]
    return Made([*pictures, *(folder / name for name in summary["files"])])


def _harmonics(points: Checkpoint, settings: CaseSettings, bases: Mapping[str, ModalBasis]) -> int:
    """With how many to begin where their number is looked for: those of the points that are kept."""
    with contextlib.suppress(UserError, KeyError, ValueError, TypeError):
        head, _ = read_journal(points.file)
        kept = int(head["harmonics"])
        built = build(settings.with_harmonics(kept), bases)
        if not points.fresh and head["inputs"] == points.inputs(built):
            return kept
    return FIRST_HARMONICS


def _unfinished(points: Checkpoint, stage: Stage) -> None:
    """``response.h5`` of what there is so far, in place of what an earlier run has left; without a point of this run
    all stays as it was."""
    with contextlib.suppress(UserError):
        if points.opened and any(read_journal(points.file)[1].values()):
            found = read_response(points.file)
            points.begin()
            stage.clear()
            write_response(points.file.with_suffix(".h5"), found)


def _tell(summary: Mapping[str, Any], report: Report) -> None:
    """How it was solved, the stuck modes and what a reader must know."""
    if summary["method"]:
        report(summary["method"])
    for i, mode in enumerate(summary.get("stuck_modes", ()), 1):
        f, D, width = (mode[key] for key in ("frequency_Hz", "damping_ratio", "half_power_width_Hz"))
        report(f"stuck mode {i}: {f:.6g} Hz, damping ratio {100 * D:.3g} %, half-power width {width:.3g} Hz")
    report(summary["checked"])
    for message in summary["messages"]:
        report(f"warning: {message}")


def _finished(points: Checkpoint, result: CaseResult, wanted: Wanted, report: Report) -> dict[str, Any]:
    """Tables, pictures and files of a case that has run, and their summary."""
    folder, summary = points.file.parent, summarise(result)
    points.begin()
    response = _response(points, result, summary)
    series = {normal: response.one(normal_force=normal) for normal in result.responses}
    store.write_text(folder / "response.csv", response_table(series))
    summary["unsolved"] = unsolved(series)
    summary["resonances"] = _judged(response, result, summary["resonances"])
    drawn = _drawn(result, summary["resonances"], folder) if wanted.pictures else {}
    response = replace(response, resonances=tuple(summary["resonances"]))
    write_response(folder / "response.h5", response)
    files = [folder / "response.h5", folder / "response.csv"]
    curve = [columns for one in result.beyond for columns in one.columns()]
    joined = {name: np.concatenate([c[name] for c in curve]) for name in (curve[0] if curve else ())}
    files += write_tables(folder, {"motions.csv": _columns(summary["motions_in_time"]), "curve.csv": joined}, 8)
    drawn |= _ring(result, response, folder, report) if wanted.pictures else {}
    more = _assessed(result, response, folder, wanted, report)
    if more is not None:
        known = {(row["normal_force_N"], row["frequency_Hz"]): row for row in summary["resonances"]}
        rows = [known.get((row["normal_force_N"], row["frequency_Hz"]), {}) | row for row in more.rows]
        summary["resonances"] = [_ordered(row) for row in rows] or summary["resonances"]
        drawn, files = drawn | more.drawn, files + more.files
        summary["messages"] += [*more.messages, *_stress_doubted(result, more)]
        summary |= {"stressed_body": more.body} if len(response.bodies) > 1 else {}
    if wanted.pictures and (result.settings.ring is not None or more is not None):
        summary["messages"] += _not_drawn()
    summary["checked"] = sentence(response, response.estimated)
    if result.rising:
        summary["checked"] += f"; still rising at {counted(len(result.rising), 'end')} of the band"
    summary["response_sha256"] = store.hash_file(folder / "response.h5")
    summary["pictures"] = {title: path.name for title, path in drawn.items()}
    summary["files"] = [path.name for path in [*files, folder / "response.html"]]
    store.write_text(folder / "response.html", response_html(summary, drawn))
    return summary


def _columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Name -> column of rows that have the same names; none where there are no rows."""
    return {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}


def _judged(response: Response, result: CaseResult, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of resonances with the effective damping there, the other read-outs, what the contacts do, and what speaks
    against them."""
    out, others = [], result.readouts[1:]
    for row in rows:
        normal, f = row["normal_force_N"], row["frequency_Hz"]
        series = response.one(normal_force=normal)
        i = int(np.abs(series.frequency - f).argmin())
        columns = series.columns()
        table = {name: float(columns[name][i]) for name in ("damping_ratio", "slipping", "open")}
        errors = result.errors.get(normal, {})
        share = next((e for at, e in errors.items() if np.isclose(at, f, rtol=1e-9, atol=0)), None)
        table |= {w.column: float(abs(w.harmonics(series)[i, 1])) for w in others}
        table |= {} if share is None or not np.isfinite(share) else {"estimated_error": abs(share)}
        out.append(_ordered(row | table | {"doubt": _doubt(result, normal, f, series.status[i], share or 0.0)}))
    return out


def _ordered(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row with what speaks against it at its end."""
    return {k: v for k, v in row.items() if k != "doubt"} | {"doubt": row.get("doubt", "")}


def _doubt(result: CaseResult, normal: float, frequency: float, status: str, error: float) -> str:
    """What speaks against a resonance; nothing, where nothing does."""
    found = result.responses[normal]
    beside = np.argsort(np.abs(found.frequency - frequency))[:2]
    if status != CONVERGED:
        return status
    if lifted(result.built, found)[beside].any():
        return "contacts would lift off: not valid"
    if _jumps(found, frequency) or any(
        np.isclose(f, frequency) for f, _ in overhanging(found, result.resonances[normal])
    ):
        known = any(b.down and b.normal == normal for b in result.beyond)
        return f"beside it is {JUMPS}, " + (
            "see the motions in time" if known else "higher perhaps: respond --over frequency"
        )
    if not np.isfinite(error):
        return "uncertain: no solution with more harmonics"
    return f"uncertain by about {off(error)}: raise harmonics and samples" if abs(error) > UNCERTAIN else ""


def _jumps(found: HarmonicResponse, frequency: float) -> bool:
    """Whether the response jumps to another motion within a step of a resonance."""
    ok = np.flatnonzero(found.converged)
    f, a = found.frequency[ok], np.abs(found.monitor[ok])
    step = float(np.median(np.diff(found.frequency[found.asked])))
    near = (np.diff(f) < 0.02 * step) & (np.abs(f[:-1] - frequency) < step)
    return bool((near & (np.abs(np.diff(a)) > 0.2 * a.max(initial=0.0))).any())


def _drawn(result: CaseResult, rows: list[dict[str, Any]], folder: Path) -> dict[str, Path]:
    """Title -> picture of the first read-out, with others of its unit where they are few, and of each other one."""
    from ..pictures.following import curve_plot
    from ..pictures.plots import save
    from ..pictures.response import response_picture, together

    asked = result.readouts
    first = together(asked, len(result.responses))
    groups = {"friction response": first} | {f"friction response of {w.name}": [w] for w in asked if w not in first}
    drawn = {}
    for title, group in groups.items():
        name = re.sub(r"[^A-Za-z0-9_.-]+", "_", title.removeprefix("friction "))
        drawn[title] = folder / "pictures" / f"{name}.png"
        save(partial(response_picture, result, shown=group, rows=rows), drawn[title])
    if lines := [one for b in result.beyond for one in b.curves if len(one.rows) > 1]:
        title = "curve of periodic motions about jumps and gaps"
        draw = partial(curve_plot, lines, title=f"{result.settings.name}: {title}")
        drawn[title] = save(draw, folder / "pictures" / "curve.png")
    return drawn


def _ring(result: CaseResult, response: Response, folder: Path, report: Report) -> dict[str, Path]:
    """Title -> picture of the whole ring at its highest resonance; nothing without a ring, a resonance or PyVista."""
    row = highest(response.resonances)
    if result.settings.ring is None or row is None or _can_draw() is not None:
        return {}
    report("picture of the ring")
    series, path = response.one(normal_force=row["normal_force_N"]), folder / "pictures" / "ring.png"
    drawn = draw_ring(result.built, series, row, path)
    return {} if drawn is None else {"ring at resonance": drawn}


def _response(points: Checkpoint, result: CaseResult, summary: Mapping[str, Any]) -> Response:
    """What goes into ``response.h5``: the journal's points of this case's sweep."""
    names = {checkpoint.series_name(n): n for n in result.responses}
    head, held = read_journal(points.file)
    low, high = result.settings.sweep.start, result.settings.sweep.stop
    found = {
        name: _with_folds({k: p for k, p in held.get(name, {}).items() if low <= k <= high}, result.folds[normal])
        for name, normal in names.items()
    }
    told = {"parameters": {name: {"normal_force": n} for name, n in names.items()}, "finished": True}
    told["estimated"] = result.truncation
    told |= {key: summary[key] for key in ("resonances", "stuck_modes", "messages")}
    return response_of({**head, **told}, found)


def _with_folds(
    rows: Mapping[float, Mapping[str, Any]], folds: Sequence[tuple[float, float]]
) -> Mapping[float, Mapping[str, Any]]:
    """Points by frequency (Hz), with ``fold`` 1 at the folds (Hz, m) of a response that has some."""
    if not folds:
        return rows
    at = np.array([f for f, _ in folds])
    return {f: {**row, "fold": int(np.isclose(f, at, rtol=1e-12).any())} for f, row in rows.items()}


@dataclass(frozen=True)
class _Assessed:
    body: str
    rows: list[dict[str, Any]]
    drawn: dict[str, Path]
    files: list[Path]
    messages: list[str]


def _assessed(
    result: CaseResult, response: Response, folder: Path, wanted: Wanted, report: Report
) -> _Assessed | None:  # fmt: skip
    """Stresses of the body that is watched, where its modal file holds stress modes, and its contacts; in pictures."""
    first = None if wanted.stresses == "none" else checkpoint.drawn_monitor(result.built)
    basis = _watched(result)
    if first is None or not assessment.has_stresses(basis, response, first[0]):
        return None
    component, monitor = first
    limits = result.settings.material_limits
    everywhere = wanted.stresses == "all"
    found = assessment.assess(response, basis, monitor, component, limits, report=report, everywhere=everywhere)
    found = replace(
        found, lifted=_lifted_off(result, found), not_valid=lifted_forces(response.resonances),
        unsure=result.unsure,
    )  # fmt: skip
    maps, messages = ({}, []) if found.highest is None else _maps(result, found, report)
    drawn = {}
    if wanted.pictures:
        report("pictures of stresses")
        scenes = _can_draw() is None
        name, arrays = result.settings.name, response.series[0].arrays
        contacts = sum(n.startswith("contacts/") and n.endswith("/dissipated") for n in arrays)
        drawn = assessment.draw(found, basis, name, folder / "pictures", scenes, maps, contacts)
    return _Assessed(component, found.table(), drawn, _for_paraview(found, basis, maps, folder), messages)


def _watched(result: CaseResult) -> ModalBasis:
    """Of the body with the first read-out, which a whole ring has many of."""
    return result.built.bodies[result.built.assembly.outputs[0].component].basis


def _stress_doubted(result: CaseResult, more: _Assessed) -> list[str]:
    """What is said of a stress that no metal bears."""
    return headline.stressed(result.built, max((row["stress_amplitude_Pa"] for row in more.rows), default=0.0))


def _lifted_off(result: CaseResult, found: assessment.Assessment) -> dict[float, Array]:
    """Normal force (N) -> at which of the points whose stress is drawn contacts would lift off."""
    off = {}
    for normal, (series, _, chosen, _) in found.sweeps.items():
        r = result.responses[normal]
        off[normal] = np.interp(series.frequency[chosen], r.frequency, lifted(result.built, r)) > 0
    return off


def _maps(
    result: CaseResult, found: assessment.Assessment, report: Report
) -> tuple[dict[str, list[ContactMap]], list[str]]:
    """Title -> contacts at the resonance at which they slip most; nothing, and why, where they do not agree with the
    response."""
    top = found.slipping
    assert top is not None
    report(f"contacts at {top.stressed_at:.6g} Hz")
    series = found.sweeps[top.normal_force][0]
    at = top.stressed
    row = {name: values[at] for name, values in series.arrays.items()} | {"status": series.status[at]}
    try:
        return {"contacts at resonance": checkpoint.maps_at(result.built, top.normal_force, row)}, []
    except UserError as error:
        report(f"warning: {error}")
        return {}, [str(error)]


def _for_paraview(
    found: assessment.Assessment, basis: ModalBasis, maps: Mapping[str, list[ContactMap]], folder: Path
) -> list[Path]:
    """The operating shape at the worst resonance and the contacts where they slip most as VTU; nothing without
    meshio."""
    if not _is_there("meshio"):
        return []
    from ..operating.contact_maps import write_contact_vtu

    files = []
    if assessment.write_shape(found, basis, folder / "operating_shape.vtu") is not None:
        files.append(folder / "operating_shape.vtu")
    for patch in [patch for patches in maps.values() for patch in patches]:
        files.append(folder / f"contact_{re.sub(r'[^A-Za-z0-9_.-]', '_', patch.name)}.vtu")
        write_contact_vtu(patch, files[-1])
    return files


def _can_draw() -> str | None:
    """See `pictures.can_draw`."""
    if not _is_there("pyvista"):
        return "PyVista is not there"
    from ..pictures import can_draw

    return can_draw()


def _not_drawn() -> list[str]:
    """What a page says whose bodies are not drawn although PyVista is there."""
    reason = _can_draw() if _is_there("pyvista") else None
    return [f"The pictures of bodies are missing: {reason}; then run it again with --force."] if reason else []


def _is_there(package: str) -> bool:
    try:
        return importlib.util.find_spec(package) is not None
    except ImportError:  # an environment that hides it
        return False


def convergence_table(response: Response) -> str:
    """CSV text: a row a point with its status, steps, and the error before every Newton step."""
    rows = []
    for s in response.series:
        columns = [s.arrays.get(n, np.full(len(s.key), np.nan)) for n in ("peak", "iterations", "error")]
        history = s.arrays.get("history", np.zeros((len(s.key), 0)))
        for f, status, peak, steps, error, errors in zip(s.frequency, s.status, *columns, history, strict=True):
            each = " ".join(f"{e:.1e}" for e in errors if e)
            rows.append([s.name, f"{f:.10g}", f"{peak > 0:d}", status, f"{steps:.0f}", f"{error:.1e}", each])
    return rows_csv("sweep,frequency_Hz,peak,status,iterations,error,errors before each step".split(","), rows)


def summarise(result: CaseResult) -> dict[str, Any]:
    """Numbers of a case for the report and the terminal."""
    rows, names = [], [w.name for w in result.readouts]
    name = result.quantity.column("amplitude")
    for normal, peaks in result.resonances.items():
        rows += [{"normal_force_N": normal, "frequency_Hz": f, name: a} for f, a in peaks]
    failed = sum(int(np.sum(~r.converged)) for r in result.responses.values())
    truncation = {} if result.truncation is None else {"estimated_error_of_harmonics": result.truncation}
    return {
        "case": result.settings.name,
        "mode": result.settings.mode,
        "harmonics": result.settings.balanced,
        "method": method(result.settings, result.errors),
        **truncation,
        "description": result.settings.description,
        "rotation_speed_rpm": to_rpm(result.speed),
        "stuck_frequencies_Hz": [float(f) for f in result.stuck[_rigid(result) :][:8]],
        "damping": result.settings.damping_as,
        "stuck_modes": _stuck_modes(result),
        **({"stuck_under_N": max(result.responses)} if result.responses else {}),
        **({"read_outs": names} if len(names) > 1 else {}),
        "resonances": rows,
        "rising_at_the_edge": [
            {"normal_force_N": r.normal_force, "frequency_Hz": r.frequency, name: r.amplitude, "add": r.add}
            for r in result.rising
        ],
        "folds": [
            {"normal_force_N": n, "frequency_Hz": f, name: a} for n, folds in result.folds.items() for f, a in folds
        ],
        "motions_in_time": [row for one in result.beyond for row in one.rows()],
        "beyond": [words for one in result.beyond for words in what_moves(one)],
        "failed_points": failed,
        "messages": list(result.messages),
    }


def unsolved(series: Mapping[float, Series]) -> str:
    """How many points of a case are no solutions, which, and where that is marked; nothing where all are.

    Args:
        series: normal force (N) -> its points.
    """
    failed = {n: [f for f, _ in s.failures] for n, s in series.items() if s.failures}
    if not failed:
        return ""
    many, whole = sum(map(len, failed.values())), sum(map(len, series.values()))
    named = dict(zip(series, apart(list(series)), strict=True))[next(iter(failed))]
    more = " and so on" if len(failed) > 1 else ""
    return (
        f"{many} of {counted(whole, 'point')} did not converge, {at_places(failed)}; response.csv marks them by 0 in "
        f"converged_FN_{named}_N{more}"
    )


RIGID = 1e-6
"""Share of the highest frequency with sticking contacts below which another one is rounding: a rigid-body motion."""


def _rigid(result: CaseResult) -> int:
    """Number of rigid-body motions with sticking contacts."""
    return int(np.searchsorted(result.stuck, RIGID * result.stuck.max(initial=0.0)))


def _stuck_modes(result: CaseResult) -> list[dict[str, float]]:
    """Damping of every mode with sticking contacts that the excited harmonics reach, and of the first one beyond; not
    of rigid-body motions."""
    most = result.settings.sweep.stop * result.settings.balanced
    first = _rigid(result)
    count = int(np.searchsorted(result.stuck, most)) + 1
    pairs = zip(result.stuck[first:count].tolist(), result.stuck_damping[first:count].tolist(), strict=True)
    return [{"frequency_Hz": f, "damping_ratio": D, "half_power_width_Hz": 2 * D * f} for f, D in pairs]

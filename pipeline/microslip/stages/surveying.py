"""Surveys of a case from its files to tables and pictures: over engine orders, speeds, ranges; curves followed by
arclength; identification."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..analysis import Answer, Files
from ..case import CaseSettings, headline, surveys
from ..case.assemble import build
from ..case.curves import UNITS, Followed, curves, error_of, highest
from ..case.problem import normal_forces
from ..data import Array, ModalBasis
from ..errors import in_its_file
from ..files.tables import csv_files, write_tables
from ..harmonic_balance.envelope import Worst, lowest, worst
from ..report.response import number_tables
from ..report.words import number_list
from ..results import Response, read_journal, response_of, write_response
from ..results.checks import sentence
from ..units import counted
from .answer import CaseJob, Written, answered, written
from .checkpoint import Checkpoint
from .stage import Report, Stage

if TYPE_CHECKING:
    from ..harmonic_balance.envelope import Envelope, OverOrders, SpeedResponse

Bases = Mapping[str, ModalBasis]
Tables = Mapping[str, Mapping[str, Array]]
"""File name -> column -> values."""
Write = Callable[[Tables], None]
"""Writes what there is of the tables of a survey, which may be interrupted."""


@in_its_file
def survey_stage(case: CaseJob, kind: str) -> Written:
    """A survey of a case.

    Args:
        kind: a key of `KINDS`, or one of `curves.OVER`.

    Raises:
        UserError: the case does not ask for it, or asks for what cannot be.
        KeyboardInterrupt: after what a curve has found until then is written.
    """
    case = replace(case, swept=kind != "identification")
    product = case.folder / f"{kind}.json"
    stage = Stage(product, ("stages.surveying",), case.force, case.report, case=case.path)
    with stage.making():
        return answered(stage, case.inputs, partial(_work, stage, case, kind))


def _work(stage: Stage, case: CaseJob, kind: str) -> Written:
    folder = case.folder

    def begin() -> None:
        stage.begin()
        stage.product.unlink(missing_ok=True)

    told = case.report if stage.is_unfinished else None
    file = folder / f"over_{kind}.points"
    points = Checkpoint(file, case.raw, case.files, case.force, begin, report=told)

    def write(tables: Tables) -> None:
        begin()
        stage.clear([file.with_suffix(".h5")])
        write_tables(folder, tables, 12)

    survey = partial(KINDS[kind], write) if kind in KINDS else partial(_curve, kind, points)
    answer = survey(case.settings, case.bases, case.report)
    begin()
    name, words = kind, _TITLES.get(kind, kind)
    if kind not in KINDS:
        name, words = f"over_{kind}", f"over the {kind.replace('_', ' ')}"
    found = written(answer, name, folder, f"{case.settings.name}: {words}", True)
    if not answer.whole:
        raise KeyboardInterrupt
    return found


def _answer(
    tables: Tables, draw: Files, sentences: Sequence[str],
    missing: str = "", whole: bool = True,
) -> Answer:  # fmt: skip
    """A survey: its tables are shown whole. missing: what was asked for and is not known. whole: nobody interrupted
    it."""
    pieces, files = number_tables(tables), csv_files(tables, 12) | dict(draw)
    return Answer(sentences, tables=pieces, files=files, missing=missing, whole=whole)


def _judged_by(
    said: Sequence[str], settings: CaseSettings, bases: Bases, kind: str, largest: Array,
    stress: Sequence[float] | Array = (), remarks: list[str] | None = None,
) -> list[str]:  # fmt: skip
    """Sentences, and what is said of the largest motion, see `headline.doubted`.

    Args:
        largest, stress: amplitudes of the first read-out, and Pa. remarks: on how uncertain it is; None: that was
            not estimated.
    """
    how = headline.said_of(settings, "", None) if remarks is None else remarks
    built = surveys.at_its_beginning(settings, bases, kind)
    tops = (float(np.nanmax(values, initial=0.0)) for values in (largest, np.asarray(stress)))
    return [*how, *said, *headline.doubted(built, next(tops), max(normal_forces(built), default=None), next(tops))]


def _unsolved(points: int) -> str:
    """Of points that did not converge, in words."""
    return f"{counted(points, 'point')} did not converge" if points else ""


_TITLES = {"orders": "engine orders", "speeds": "over the speed", "ranges": "over ranges of its settings"}
"""What pages of surveys are called."""


def _orders(write: Write, settings: CaseSettings, bases: Bases, report: Report) -> Answer:
    from ..pictures.coupled import over_orders_picture, worst_order_picture

    def tables(found: Mapping[str, OverOrders]) -> Tables:
        first, columns = max(found.values(), key=lambda r: len(r.order)), dict[str, Array]()
        for label, r in found.items():
            plain = label.replace("$F_N$", "FN").replace(" = ", "_").replace(" ", "_")
            left = len(first.order) - len(r.order)
            own = {f"{n}_{plain}": _padded(v, left) for n, v in r.columns().items() if n not in of_all}
            columns |= {n: v for n, v in first.columns().items() if n in of_all} | own
        return {"orders_worst.csv": _worst_table(list(found.values())), "orders.csv": columns}

    of_all = {"engine_order", "wave"}
    found = surveys.over_orders(settings, bases, report, lambda some: write(tables(some)))
    title = f"{settings.name}: resonances over the engine order"
    failed = _unsolved(sum(int(r.failed.sum()) for r in found.values()))
    every = list(found.values())
    draw: Files = {"pictures/orders.png": lambda figure: over_orders_picture(found, figure, title)}
    if len(found) > 1:
        words = f"{settings.name}: the worst of all engine orders over the normal force"
        draw = {"pictures/orders_worst.png": lambda p: worst_order_picture(every, p, words)} | draw
    amplitude, stress = (np.concatenate([getattr(r, of) for r in every]) for of in ("amplitude", "stress"))
    said = _judged_by(_worst_sentences(every), settings, bases, "orders", amplitude, stress)
    return _answer(tables(found), draw, said, failed)


def _padded(column: Array, left: int) -> Array:
    """With so many values more that are not known."""
    return np.append(column, [""] * left if column.dtype.kind == "U" else [np.nan] * left)


def _worst_table(found: Sequence[OverOrders]) -> dict[str, Array]:
    """Column -> under every normal force: the largest amplitude and stress over the engine orders, and where."""
    columns = {"normal_force_N": np.array([r.normal_force for r in found])}
    for name, of in _judged(found):
        told = [worst(r, of) for r in found]
        values = [(np.nan,) * 3 if w is None else (w.value, w.order, w.frequency) for w in told]
        names = name, f"engine_order_of_{of}", f"frequency_of_{of}_Hz"
        columns |= dict(zip(names, np.array(values, dtype=float).T, strict=True))
    for name, each in (
        ("orders_without_resonance", [(np.isnan(r.amplitude) & ~r.lost).sum() for r in found]),
        ("orders_not_found", [r.lost.sum() for r in found]),
        ("failed_points", [r.failed.sum() for r in found]),
    ):
        columns[name] = np.array(each, dtype=float)
    return columns


def _judged(found: Sequence[OverOrders]) -> list[tuple[str, Literal["stress", "amplitude"]]]:
    """Column and name of what the worst engine order is looked for in: the stress first, where it is known."""
    columns: list[tuple[str, Literal["stress", "amplitude"]]] = [
        ("stress_amplitude_Pa", "stress"),
        (found[0].quantity.column("amplitude"), "amplitude"),
    ]
    return columns if any(np.isfinite(r.stress).any() for r in found) else columns[1:]


def _worst_sentences(found: Sequence[OverOrders]) -> list[str]:
    """The worst engine order, and under which normal force it is best."""
    said = []
    for _, of in _judged(found):
        rows = [w for r in found if (w := worst(r, of)) is not None]
        if rows:
            said.append(_worst_sentence(rows, of, found))
    if not any(np.isfinite(r.stress).any() for r in found):
        said.append("Stresses are not known: the modal file holds none (output.nodal_stress = true in body.toml).")
    known = any(np.isfinite(r.amplitude).any() for r in found)
    none = [] if known or any(r.lost.any() for r in found) else ["No resonance in the band."]
    return said + none + [s for r in found for s in _lost_orders(r)]


def _lost_orders(one: OverOrders) -> list[str]:
    """Of which engine orders no resonance was found under a normal force, and why not of the first of them."""
    if not (lost := np.flatnonzero(one.lost).tolist()):
        return []
    under = "" if np.isnan(one.normal_force) else f"F_N = {one.normal_force:.6g} N, "
    return [f"{under}engine order {number_list([int(e) for e in one.order[lost]])}: {one.missing[lost[0]]}."]


def _worst_sentence(rows: Sequence[Worst], of: str, found: Sequence[OverOrders]) -> str:
    best, orders = lowest(rows), number_list([int(e) for e in found[0].order])
    value = f"{1e-6 * best.value:.4g} MPa" if of == "stress" else found[0].quantity.sized(best.value)
    where = f"{value} at engine order {best.order}, {best.frequency:.5g} Hz"
    what = f"Over engine orders {orders} the worst {of}{' amplitude' if of == 'stress' else ''}"
    if len(found) == 1:
        return f"{what} is {where}{_known(best)}."
    forces = [r.normal_force for r in found]
    end = {min(forces): "smallest", max(forces): "largest"}.get(best.normal_force)
    said = f" (the {end} compared, the optimum may lie beyond)" if end else f" ({len(forces)} compared)"
    return f"{what} is lowest under F_N = {best.normal_force:.6g} N{said}: {where}{_known(best)}."


def _known(row: Worst) -> str:
    none = row.count - row.known - row.lost
    said = [f"{counted(none, 'engine order')} without a resonance in the band"] if none else []
    said += [f"of {counted(row.lost, 'engine order')} none was found"] if row.lost else []
    return f" ({', '.join(said)})" if said else ""


def _speeds(write: Write, settings: CaseSettings, bases: Bases, report: Report) -> Answer:
    from ..pictures.coupled import speed_line_picture

    def tables(r: SpeedResponse) -> Tables:
        return {"speeds.csv": {"frequency_Hz": r.frequency, **r.columns()}}

    r = surveys.over_speeds(settings, bases, report, lambda some: write(tables(some)))
    amplitude = np.where(r.converged, np.abs(r.monitor), np.nan)
    title = f"{settings.name}: along engine order {r.order}"
    top = int(np.argmax(np.nan_to_num(amplitude)))
    drawn = r.rpm, r.frequency, amplitude, r.normal
    size = r.quantity.sized(float(amplitude[top]))
    said = [f"Largest amplitude {size} at {r.rpm[top]:.6g} rpm, {r.frequency[top]:.6g} Hz."]
    said = said if r.converged.any() else ["No amplitude is known: no speed has a solution."]
    if still := [b.name for b in settings.components if not bases[b.name].ranges]:
        said.append(f"The same at all speeds: {', '.join(still)} (no rotation.range_rpm in a body.toml).")
    return _answer(
        tables(r),
        {"pictures/speeds.png": lambda p: speed_line_picture(*drawn, p, title, r.quantity)},
        _judged_by(said, settings, bases, "speeds", amplitude),
        _unsolved(int((~r.converged).sum())),
    )


def _ranges(write: Write, settings: CaseSettings, bases: Bases, report: Report) -> Answer:
    from ..pictures.coupled import envelope_picture

    def tables(e: Envelope) -> Tables:
        return {"ranges_combinations.csv": e.corners(), "ranges.csv": e.columns()}

    e = surveys.over_ranges(settings, bases, report, lambda some: write(tables(some)))
    title = f"{settings.name}: over {', '.join(e.names).replace('_', ' ')}"
    return _answer(
        tables(e),
        {"pictures/ranges.png": lambda p: envelope_picture(e, p, title)},
        _judged_by(_ranges_sentences(e), settings, bases, "ranges", e.peaks),
        _unsolved(int((~e.converged).sum())),
    )


def _ranges_sentences(e: Envelope) -> list[str]:
    """The largest amplitudes of the combinations, and which of them are not known everywhere."""
    said, known = [], np.isfinite(e.peaks)
    if known.any():
        most = " and ".join(e.quantity.sized(float(pick(e.peaks))) for pick in (np.nanmin, np.nanmax))
        said.append(f"Largest amplitude between {most} on the grid of the sweep.")
        said.append(f"It is largest with {_combination(e, int(np.nanargmax(e.peaks)))}.")
    failed = (~e.converged).sum(axis=1)
    if some := np.flatnonzero(failed).tolist():
        each = "; ".join(f"{failed[i]} with {_combination(e, i)}" for i in some)
        are = "is" if len(some) == 1 else "are"
        said.append(
            f"{len(some)} of {counted(len(failed), 'combination')} {are} not known everywhere, and the envelope leaves "
            f"out what is missing: of {len(e.frequency)} points did not converge {each}."
        )
    return said


def _combination(e: Envelope, i: int) -> str:
    """Combination number i in words."""
    return ", ".join(f"{name.replace('_', ' ')} {v:.4g}" for name, v in zip(e.names, e.values[i], strict=True))


def _identification(write: Write, settings: CaseSettings, bases: Bases, report: Report) -> Answer:
    from ..pictures.coupled import nodal_diameter_picture

    found, diagrams = surveys.identification(settings, bases)
    title = f"{settings.name}: nodal diameters with sticking contacts, $c_T$ = {found.ratio:g} $c_N$"
    at = next(d for d in diagrams if d.stiffness == found.stiffness)
    return _answer(
        {"identification.csv": found.columns(), "nodal_diameters.csv": at.columns()},
        {"pictures/nodal_diameters_stuck.png": lambda p: nodal_diameter_picture(diagrams, p, title, found)},
        found.sentences(),
    )


def _curve(over: str, points: Checkpoint, settings: CaseSettings, bases: Bases, report: Report) -> Answer:
    from ..pictures.following import curve_plot

    found, whole = curves(settings, bases, over, points.journal, report)
    if not whole:
        found = [one for one in found if one.rows]
    if not found:
        raise KeyboardInterrupt
    columns = {name: np.concatenate([one.columns()[name] for one in found]) for name in found[0].columns()}
    error, remarks = _error(found, settings, bases, report) if whole else (None, None)
    title, name = f"{settings.name}: over the {over.replace('_', ' ')}", f"over_{over}"
    response = _written(points, found, whole)
    failed = _unsolved(sum(int((~s.converged).sum()) for s in response.series))
    by = found[0].quantity.shared(a for one in found for a in one.amplitude)
    drawn, early = [one for one in found if len(one.rows) > 1], sum(one.early for one in found)
    arrived, asked = sum(one.complete for one in found), sum(one.legs is None for one in found)
    missing = [f"{early} of {counted(len(found), 'curve')} end{'s' * (early == 1)} early"] if early else []
    missing += ["not every curve reaches the other end"] if arrived < asked and not early else []
    largest = np.concatenate([np.where(one.converged, one.amplitude, 0.0) for one in found])
    said = [*(words for one in found for words in one.sentences(by)), sentence(response, error)]
    draw: Files = {f"{name}.h5": lambda p: write_response(p, response)}
    if drawn:
        draw[f"pictures/{name}.png"] = lambda p: curve_plot(drawn, p, title)
    return _answer(
        {f"{name}.csv": columns},
        draw,
        _judged_by(said, settings, bases, over, largest, remarks=remarks),
        "; ".join([*missing, *filter(None, [failed])]),
        whole,
    )


def _error(
    found: Sequence[Followed], settings: CaseSettings, bases: Bases, report: Report
) -> tuple[float | None, list[str] | None]:
    """Estimated error of the highest point, over its amplitude, and what is said of it; None where there is none."""
    if (top := highest(found)) is None:
        return None, None
    one, i = top
    report("error of harmonics and samples")
    e, fed = error_of(build(settings, bases), one, i)
    at = f"{one.parameter[i]:.6g} {UNITS[one.over]}"
    said = headline.said_of(settings, f"{one.label}: the amplitude at {at}", e)
    if e is None:
        return None, [*said, *fed] if fed else None
    return e.readout, [*(said if e.readout > headline.TRUNCATION else []), *fed]


def _written(points: Checkpoint, found: list[Followed], whole: bool) -> Response:
    """The points as a response."""
    from ..harmonic_balance.checkpoint import OF_THE_WAY

    head, _ = read_journal(points.file)
    series = {
        one.name: {
            float(i): {n: v for n, v in row.items() if not n.startswith(OF_THE_WAY)} for i, row in enumerate(one.rows)
        }
        for one in found
        if one.rows
    }
    return response_of({**head, "finished": whole}, series)


KINDS: dict[str, Callable[[Write, CaseSettings, Bases, Report], Answer]] = {
    "orders": _orders,
    "speeds": _speeds,
    "ranges": _ranges,
    "identification": _identification,
}

"""Samples of a case's ring with sectors that differ: all of them as a table, envelopes, pictures and a page."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..basis import read_basis
from ..case import CaseSettings, headline
from ..case.assemble import Built, build
from ..case.contacts import swept
from ..case.problem import book_models
from ..case.questions import MistuningOfCase, ScatterOfCase
from ..data import Array, Indices
from ..errors import UserError, at, in_its_file
from ..files import store
from ..files.tables import columns_csv, rows_csv
from ..harmonic_balance.readout import measured
from ..mistuning.ensemble import COLUMNS, RARE, Ensemble, choose, ready, run
from ..mistuning.ring import Tuned
from ..mistuning.samples import Asked, Sample
from ..mistuning.scatter import OF_CONTACTS, Scatter, check
from ..mistuning.sensitivity import Approximation, approximation
from ..mistuning.statistics import SHARES, fits
from ..report.mistuning import mistuning_html
from ..system.assembly import Assembly, Contact
from ..units import counted
from .answer import CaseJob, Written
from .stage import Stage, hash_of_code


@in_its_file
def mistuning_stage(case: CaseJob, workers: int | None = None) -> Written:
    """What a case asks for in [mistuning]; whole if every sample has a solution.

    Args:
        workers: see `mistuning.ensemble.run`.

    Raises:
        UserError: the case asks for none; a scatter of what is not there, or that leaves nothing of it.
    """
    if case.settings.mistuning is None:
        raise UserError("is missing; add [[mistuning.scatter]] with of and deviation", "mistuning")
    return case.answer("mistuning", "stages.mistuning", partial(_work, workers=workers))


def _work(stage: Stage, case: CaseJob, workers: int | None) -> Written:
    folder, settings, built = case.folder, case.settings, case.built()
    asked = settings.mistuning
    assert asked is not None
    kept = folder / "mistuning.npz"
    if case.force:
        for old in (kept, folder / "rare.npz"):
            old.unlink(missing_ok=True)
    known = _of_samples(case.inputs)
    with at("mistuning", case.path):
        what = asked_of(built, settings)
        ready(what, asked.samples, asked.rare)
        found = run(what, asked.samples, asked.until, workers, kept, known, report=case.report)
        if asked.rare:
            found.rare = choose(found, asked.rare, workers, folder / "rare.npz", known, report=case.report)
    worst = None
    if found.solved.any():
        case.report("the highest sample, searched again from either side")
        worst = found.search_again()
    stage.begin()
    first = next((s for s in what.scatter if s.of == "frequency" and s.deviation), None)
    lone = first is not None and what.tuned.body(first).sectors == 1 and settings.stuck_ratios is None
    near = approximation(what, first) if first and lone and not what.stuck else None
    alone = near is not None and len(what.scatter) > 1
    doubts = _doubted(found, built, asked)
    sentences = [*said(found), *([FIRST_ALONE] if alone else []), *built.messages, *doubts]
    made = _written(found, near, folder)
    drawn = _pictures(found, worst, near, folder / "pictures", settings.name) if worst and case.pictures else []
    page = folder / "mistuning.html"
    store.write_text(page, mistuning_html(f"{settings.name}: mistuned", found, sentences, drawn))
    return Written([page, *made, *drawn], sentences, bool(found.solved.all()))


def _doubted(found: Ensemble, built: Built, asked: MistuningOfCase) -> list[str]:
    """What looks like a number in a wrong unit: of the highest blade of all samples, or the tuned ring's."""
    amplitude, stress = (float(np.nanmax(found.column(of), initial=0.0)) for of in ("amplitude", "stress_Pa"))
    top = max(amplitude, found.tuned.top.amplitude)
    return headline.doubted(built, top, _normal_force(built, asked), stress)


FIRST_ALONE = "First order is of the first scatter of frequencies alone; the samples have all that scatters."


def _of_samples(inputs: Mapping[str, Any]) -> str:
    """Hash of what one sample depends on: not how many there are."""
    case = dict(inputs["case"])
    case["mistuning"] = {k: v for k, v in case["mistuning"].items() if k not in ("samples", "until", "rare")}
    return store.fingerprint({**inputs, "case": case}, hash_of_code(("mistuning.samples",)))


def asked_of(built: Built, case: CaseSettings) -> Asked:
    """What is asked of every sample of a case.

    Raises:
        UserError: a scatter of what is not there, or that leaves nothing of it.
    """
    settings, asked = built.settings, case.mistuning
    assert asked is not None
    force = _normal_force(built, asked)
    sector = built.one(force)
    sector = replace(sector, outputs=sector.outputs[:1])
    others = (_others(s, i, built, case, force) for i, s in enumerate(asked.scatter))
    each = enumerate(zip(asked.scatter, others, strict=True))
    scatter = tuple(_scatter(s, i, built, case.path.parent, o) for i, (s, o) in each)
    check(scatter)
    thrown = {b.name for b in settings.components if b.pressed_at_rpm is not None}
    pressed = {name: tuple(c.name for c in sector.contacts if name in _ends(c)) for name in thrown}
    tuned = Tuned(sector, pressed)
    tuned.check(scatter)
    sweep = settings.sweep
    frequency = np.linspace(sweep.start, sweep.stop, sweep.points)
    balance = {"harmonics": settings.balanced, **settings.marching}
    models = partial(book_models, strips=settings.strips) if settings.mode == "book" else None
    return Asked(tuned, scatter, frequency, asked.seed, balance, asked.stuck, models)


def _ends(contact: Contact) -> set[str]:
    return {side.component for side in (contact.first, contact.second) if side is not None}


def _normal_force(built: Built, asked: MistuningOfCase) -> float | None:
    """N, of the contacts that the sweep presses; None where there are none."""
    if not any(swept(c) for c in built.contacts):
        return None
    given = built.settings.sweep.normal_forces
    if asked.normal_force is None and (not given or isinstance(given, str)):
        raise UserError("is missing; give that of the contacts, in N", "normal_force")
    return asked.normal_force if asked.normal_force is not None else min(float(x) for x in given or ())


def _others(
    s: ScatterOfCase, number: int, built: Built, case: CaseSettings, force: float | None
) -> dict[int, Assembly]:  # fmt: skip
    """Sector -> what stands for a ring of bodies made from its modal file; every file is read once."""
    bases, made = {name: b.basis for name, b in built.bodies.items()}, dict[str, Assembly]()
    name = s.body or next(iter(bases))
    for sector, file in s.others.items():
        with at(f"scatter.{number}.others.{sector} ({file})", case.path):
            if file not in made:
                made[file] = build(case, {**bases, name: read_basis(case.path.parent / file)}).one(force)
    return {int(sector): made[file] for sector, file in s.others.items()}


def _scatter(s: ScatterOfCase, number: int, built: Built, folder: Path, others: Mapping[int, Assembly]) -> Scatter:
    ring = built.assembly.ring
    blades = ring.blades if ring is not None and s.arrangement != "drawn" else None
    values = _measured(folder / s.file, s.of, blades) if s.file else s.values
    contact = s.contact
    if contact is not None and s.of in OF_CONTACTS:
        named = {c.interface: x.name for c, x in zip(built.contacts, built.assembly.contacts, strict=True)}
        contact = named.get(contact, contact)
    with at(f"scatter.{number} ({s.of})"):
        return Scatter(s.of, s.deviation, s.distribution, values, others, s.arrangement, s.body, contact, s.at,
                       s.together, s.neighbours)  # fmt: skip


def _measured(file: Path, of: str, blades: int | None = None) -> tuple[float, ...]:
    """Deviations in a table: its column ``deviation``, or ``frequency_Hz`` over its mean, less 1; in the order of its
    rows, or of its column ``blade`` or ``sector``, which then has all blades of a ring of so many."""
    try:
        with store.ordinary(file).open(newline="", encoding="utf-8-sig") as text:
            rows = list(csv.DictReader(line for line in text if not line.startswith("#")))
    except FileNotFoundError as error:
        raise UserError(f"file: {file}: there is no such table; correct the name") from error
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"file: {file}: cannot be read as comma-separated values ({error})") from error
    for name in ("deviation", "frequency_Hz"):
        if rows and name in rows[0]:
            found = _column(file, rows, name)[_places(file, rows, blades)]
            if name == "frequency_Hz" and found.min() <= 0:
                raise UserError(f"file: {file}: column {name}: holds {found.min():g}; a frequency is above zero")
            return tuple(found if name == "deviation" else found / found.mean() - 1)
    raise UserError(f"file: {file}: has no row, or neither a column deviation nor frequency_Hz; add one for {of}")


def _column(file: Path, rows: list[dict[str, str]], name: str) -> Array:
    try:
        found = np.array([float(row[name]) for row in rows])
    except (TypeError, ValueError) as error:
        raise UserError(f"file: {file}: column {name}: {error}; every row needs a number") from error
    if not np.isfinite(found).all():
        raise UserError(f"file: {file}: column {name}: holds what is not a finite number; correct it")
    return found


def _places(file: Path, rows: list[dict[str, str]], blades: int | None) -> Indices:
    """Rows in the order in which blades stand round the ring, where the table numbers them."""
    for name in ("blade", "sector"):
        if name in rows[0]:
            numbers = _column(file, rows, name)
            if (np.sort(numbers) - numbers.min() != np.arange(len(numbers))).any():
                raise UserError(f"file: {file}: column {name}: must number all blades round the ring, each once")
            if blades is not None and len(rows) != blades:
                raise UserError(
                    f"file: {file}: column {name}: numbers {len(rows)} of {blades} blades; give all, or leave it out"
                )
            return np.argsort(numbers)
    return np.arange(len(rows))


def said(found: Ensemble) -> list[str]:
    """What a reader came for, in sentences."""
    top, assembly = found.tuned.top, found.asked.tuned.whole
    sized, N = measured(assembly).sized, found.asked.tuned.sectors
    count, warned = int(found.solved.sum()), [f"warning: {one}" for one in found.unsure]
    told = [
        f"The tuned ring of {N} sectors reaches {sized(top.amplitude)} at {top.frequency:.6g} Hz.",
    ]
    if not count:
        return [*told, *warned, "No sample has a solution."]
    a, at = found.amplification, found.highest
    told.append(
        f"Amplification of the highest blade in {counted(count, 'sample')}: mean {np.nanmean(a):.4g}, 95 % quantile "
        f"{found.quantile(0.95)}, 99 % quantile {found.quantile(0.99)}; the intervals hold with 95 %."
    )
    if (rare := found.rare) is not None:
        told.append(
            f"99.9 % quantile by {rare.samples} of {rare.drawn} samples, chosen by a linear ring: {rare.quantile}, as "
            f"well told as by {rare.worth:.3g} plain samples; by the plain ones {found.quantile(RARE)}. Ranks of the "
            f"linear ring and of that with friction correlate by {rare.correlation:.2f}."
        )
        if not rare.worth > rare.samples:
            told.append("warning: chosen samples tell no more than plain ones would; the linear ring says too little.")
    told.append(
        f"The highest of all is {a[at]:.4g}, sample {at}: blade {int(found.column('sector')[at])} at "
        f"{found.column('frequency_Hz')[at]:.6g} Hz."
    )
    if found.again is not None:
        up, down = (f"{one.amplitude / top.amplitude:.5g} at {one.frequency:.6g} Hz" for one in found.again)
        told.append(
            f"Searched for again in steps of a quarter, its peak is {up} from below and {down} from above; the first "
            f"search found {a[at]:.5g}."
        )
    if found.asked.stuck:
        whitehead = 0.5 * (1 + np.sqrt(N))
        told.append(f"Contacts stick. Whitehead's bound for one family of modes and equal damping is {whitehead:.4g}.")
    if not any(s.random for s in found.asked.scatter):
        told.append("Nothing is drawn, so there is one sample.")
    if found.envelope.samples(N) > len(found):
        told.append(f"The envelope is that of all {found.envelope.samples(N)} samples that were kept.")
    if np.isnan(found.column("strain")).all() and any(m.groups[0].gauges for m in assembly.components):
        told.append("The gauges read nothing but rounding of this motion, so samples.csv has no strain.")
    return [*told, *warned]


def _written(found: Ensemble, near: Approximation | None, folder: Path) -> list[Path]:
    column = measured(found.asked.tuned.whole).column
    told_of = [n for n in COLUMNS if n not in ("stress_Pa", "strain") or not np.isnan(found.column(n)).all()]
    rows = found.rows[:, [COLUMNS.index(n) for n in told_of]]
    head = ["sample", "amplification", *(column(n) if n == "amplitude" else n for n in told_of)]
    cells = (
        [str(i), f"{a:.12g}", *(f"{v:.12g}" for v in row)]
        for i, (a, row) in enumerate(zip(found.amplification, rows, strict=True))
    )
    store.write_text(folder / "samples.csv", rows_csv(head, cells))
    tuned = np.nanmax(found.tuned.grid, axis=1)
    envelope = {"frequency_Hz": found.asked.frequency, column("tuned"): tuned} | {
        n if n == "weibull_exponent" else column(n): v for n, v in found.envelope.columns().items()
    }
    store.write_text(folder / "envelope.csv", columns_csv(envelope, 8))
    told = [found.quantile(share) for share in SHARES]
    quantiles: dict[str, Array] = {
        "share": np.array(SHARES),
        **{name: np.array([getattr(q, name) for q in told]) for name in ("value", "low", "high")},
    }
    if found.rare is not None:
        for name in ("value", "low", "high"):
            own = getattr(found.rare.quantile, name)
            quantiles[f"chosen_{name}"] = np.array([own if share == RARE else np.nan for share in SHARES])
    for fit in fits(found.amplification[found.solved]):
        quantiles[fit.name.replace(" ", "_")] = np.array([fit.quantiles[share] for share in SHARES])
    store.write_text(folder / "quantiles.csv", columns_csv(quantiles, 8))
    names = ["samples.csv", "quantiles.csv", "envelope.csv"]
    if near is not None:
        columns: dict[str, Array] = {
            "frequency_Hz": near.frequency, column("mean"): near.mean, column("deviation"): near.deviation,
            "weibull_exponent": near.weibull_exponent, column("quantile_2.5_percent"): near.envelope(0.025),
            column("quantile_97.5_percent"): near.envelope(0.975),
        }  # fmt: skip
        store.write_text(folder / "approximation.csv", columns_csv(columns, 8))
        names.append("approximation.csv")
    return [folder / name for name in names]


def _pictures(found: Ensemble, worst: Sample, near: Approximation | None, folder: Path, case: str) -> list[Path]:
    from ..pictures.mistuning import amplification_picture, envelope_picture, sensitivity_picture, worst_picture

    drawn = [sensitivity_picture(near, folder / "sensitivity.png", f"{case}: sensitivities")] if near else []
    return [
        amplification_picture(found, folder / "amplification.png", f"{case}: highest blade over the tuned ring's"),
        envelope_picture(found, near, folder / "mistuned.png", f"{case}: all blades of all samples"),
        worst_picture(found, worst, folder / "worst.png", f"{case}: the highest of all samples"),
        *drawn,
    ]

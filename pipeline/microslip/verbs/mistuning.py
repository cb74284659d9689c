"""Samples of a ring whose blades or contacts differ, as [mistuning] says: how much higher the highest blade gets."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from ..analysis import Analysis, Answer, Files, Question
from ..basis import read_basis
from ..case.assemble import Built, build
from ..case.contacts import swept
from ..case.problem import book_models
from ..data import Array, Indices
from ..errors import UserError, at
from ..files import store
from ..files.tables import csv_files, rows_csv
from ..harmonic_balance.readout import measured
from ..mistuning.ensemble import COLUMNS, RARE, Ensemble, choose, ready, run
from ..mistuning.ring import Tuned
from ..mistuning.samples import Asked, Sample
from ..mistuning.scatter import OF_CONTACTS, Scatter, check
from ..mistuning.sensitivity import Approximation, approximation
from ..mistuning.statistics import SHARES, fits
from ..pictures.mistuning import (
    amplification_picture,
    envelope_picture,
    sensitivity_picture,
    worst_picture,
)
from ..report.page import Piece, fold, number, say, table
from ..settings.numbers import Model, NotNegative, Number, Positive, _finite_vector, _tuple
from ..system.assembly import Assembly, Contact
from ..units import counted


def _share(value: Any) -> Any:
    """2% or 0.02."""
    if isinstance(value, str) and value.endswith("%"):
        try:
            return float(value.removesuffix("%")) / 100
        except ValueError:
            return value
    return value


class ScatterKeys(Model):
    """What differs from sector to sector of a ring."""

    of: Literal[
        "frequency", "damping", "mass", "added_mass", "modal_file", "normal_force", "gap", "friction", "stiffness"
    ]
    """of a body's modes, its mass, `added_mass` at a monitor or `modal_file`; or of a contact"""
    deviation: NotNegative = 0.0
    """standard deviation, a share of the nominal value; of `added_mass` kg, of `gap` m"""
    distribution: Literal["normal", "lognormal", "uniform"] = "normal"
    """the median of a lognormal one is nominal"""
    values: Annotated[tuple[Number, ...], BeforeValidator(_finite_vector)] = ()
    """or deviations that are known, sector by sector; a shorter pattern is repeated"""
    file: str | None = None
    """or a table with the column `deviation`, or `frequency_Hz`, whose mean is nominal; in the
    order of its rows, or of its column `blade` or `sector`"""
    others: dict[str, str] = {}
    """or sectors, from 0, that have another modal file, and the file (`{ 3 = "repaired.h5" }`),
    of `modal_file`"""
    arrangement: Literal["given", "shuffled", "drawn"] = "given"
    """of the known values: as given, in another order in every sample, or each drawn from them"""
    body: str | None = None
    """whose; may be left out where there is one"""
    contact: str | None = None
    """its interface; may be left out where there is one"""
    at: str | None = None
    """monitor at which `added_mass` sits"""
    together: Annotated[Number, Field(ge=0, le=1)] = 1.0
    """correlation between the modes of a body; 0: each alone"""
    neighbours: Annotated[Number, Field(ge=-1, le=1)] = 0.0
    """correlation between a sector and the next one"""

    @model_validator(mode="after")
    def _one_of_three(self) -> ScatterKeys:
        if (self.of == "modal_file") != bool(self.others):
            raise ValueError("others: belong to modal_file, which needs them; give { 3 = 'repaired.h5' }")
        given = sum(map(bool, (self.deviation, self.values, self.file, self.others)))
        if not given:
            raise ValueError("deviation: nothing scatters; give one above zero, or values or a file of known ones")
        if given > 1:
            raise ValueError("deviation: give one of deviation, values, file and others")
        if bad := [key for key in self.others if not key.isdecimal()]:
            raise ValueError(f"others.{bad[0]}: is no sector; count them from 0")
        return self


class Keys(Model):
    """Samples of the whole ring with sectors that differ, by `microslip mistune`."""

    scatter: Annotated[tuple[ScatterKeys, ...], BeforeValidator(_tuple), Field(min_length=1)]
    samples: Annotated[int, Field(ge=1, le=100000000)] = 100
    """whole rings that are solved, at most"""
    until: Annotated[Positive, Field(le=1), BeforeValidator(_share)] | None = None
    """ends when half of the interval of the 95 % quantile is that share of it"""
    rare: Annotated[int, Field(ge=0, le=1000000)] = 0
    """further samples, chosen by a linear ring, for the 99.9 % quantile; none if 0"""
    seed: Annotated[int, Field(ge=0)] = 0
    """of all random numbers; a sample depends on it and its number alone"""
    stuck: bool = False
    """whether contacts stick, which is linear"""
    normal_force: NotNegative | None = None
    """[N] of the contacts that the sweep presses; its smallest if not given"""
    workers: Annotated[int, Field(ge=1, le=1024)] | None = None
    """processes; as many as there are cores if not given, samples are the same for any number"""


def solve(q: Question) -> Answer:
    """All samples; whole if every one has a solution."""
    built, asked, folder = q.built, q.asked, q.folder
    kept = [folder / "mistuning.npz", folder / "rare.npz"]
    if q.fresh:
        for old in kept:
            old.unlink(missing_ok=True)
    known = store.fingerprint(q.inputs, asked.model_dump(exclude={"samples", "until", "rare", "workers"}))
    what = asked_of(built, asked)
    ready(what, asked.samples, asked.rare)
    found = run(what, asked.samples, asked.until, asked.workers, kept[0], known, report=q.report)
    if asked.rare:
        found.rare = choose(found, asked.rare, asked.workers, kept[1], known, report=q.report)
    worst = None
    if found.solved.any():
        q.report("the highest sample, searched again from either side")
        worst = found.search_again()
    first = next((s for s in what.scatter if s.of == "frequency" and s.deviation), None)
    lone = first is not None and what.tuned.body(first).sectors == 1 and built.settings.stuck_ratios is None
    near = approximation(what, first) if first and lone and not what.stuck else None
    alone = near is not None and len(what.scatter) > 1
    amplitude, stress = (
        float(np.nanmax(found.column(of), initial=0.0)) for of in ("amplitude", "stress_Pa")
    )
    return Answer(
        [*said(found), *([FIRST_ALONE] if alone else [])],
        tables=_pieces(found),
        largest=max(amplitude, found.tuned.top.amplitude),
        judged={"normal": _normal_force(built, asked), "stress": stress},
        whole=bool(found.solved.all()),
        files=_files(found, near) | (_pictures(found, worst, near, built.settings.name) if worst else {}),
    )


FIRST_ALONE = "First order is of the first scatter of frequencies alone; the samples have all that scatters."


def asked_of(built: Built, asked: Keys) -> Asked:
    """What is asked of every sample of a case.

    Raises:
        UserError: a scatter of what is not there, or that leaves nothing of it.
    """
    settings = built.settings
    force = _normal_force(built, asked)
    sector = built.one(force)
    sector = replace(sector, outputs=sector.outputs[:1])
    others = (_others(s, i, built, force) for i, s in enumerate(asked.scatter))
    each = enumerate(zip(asked.scatter, others, strict=True))
    scatter = tuple(_scatter(s, i, built, settings.path.parent, o) for i, (s, o) in each)
    check(scatter)
    thrown = {b.name for b in settings.components if b.pressed_at_rpm is not None}
    pressed = {name: tuple(c.name for c in sector.contacts if name in _ends(c)) for name in thrown}
    tuned = Tuned(sector, pressed)
    tuned.check(scatter)
    balance = {"harmonics": settings.balanced, **settings.marching}
    models = partial(book_models, strips=settings.strips) if settings.mode == "book" else None
    return Asked(tuned, scatter, settings.sweep.grid, asked.seed, balance, asked.stuck, models)


def _ends(contact: Contact) -> set[str]:
    return {side.component for side in (contact.first, contact.second) if side is not None}


def _normal_force(built: Built, asked: Keys) -> float | None:
    """N, of the contacts that the sweep presses; None where there are none."""
    if not any(swept(c) for c in built.contacts):
        return None
    given = built.settings.sweep.normal_forces
    if asked.normal_force is None and (not given or isinstance(given, str)):
        raise UserError("is missing; give that of the contacts, in N", "normal_force")
    return asked.normal_force if asked.normal_force is not None else min(float(x) for x in given or ())


def _others(s: ScatterKeys, number: int, built: Built, force: float | None) -> dict[int, Assembly]:
    """Sector -> what stands for a ring of bodies made from its modal file; every file is read once."""
    case = built.settings
    bases, made = {name: b.basis for name, b in built.bodies.items()}, dict[str, Assembly]()
    name = s.body or next(iter(bases))
    for sector, file in s.others.items():
        with at(f"scatter.{number}.others.{sector} ({file})", case.path):
            if file not in made:
                made[file] = build(case, {**bases, name: read_basis(case.path.parent / file)}).one(force)
    return {int(sector): made[file] for sector, file in s.others.items()}


def _scatter(s: ScatterKeys, number: int, built: Built, folder: Path, others: Mapping[int, Assembly]) -> Scatter:
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


def _files(found: Ensemble, near: Approximation | None) -> Files:
    column = measured(found.asked.tuned.whole).column
    told_of = [n for n in COLUMNS if n not in ("stress_Pa", "strain") or not np.isnan(found.column(n)).all()]
    rows = found.rows[:, [COLUMNS.index(n) for n in told_of]]
    head = ["sample", "amplification", *(column(n) if n == "amplitude" else n for n in told_of)]
    cells = [
        [str(i), f"{a:.12g}", *(f"{v:.12g}" for v in row)]
        for i, (a, row) in enumerate(zip(found.amplification, rows, strict=True))
    ]
    samples = rows_csv(head, cells)
    tuned = np.nanmax(found.tuned.grid, axis=1)
    envelope = {"frequency_Hz": found.asked.frequency, column("tuned"): tuned} | {
        n if n == "weibull_exponent" else column(n): v for n, v in found.envelope.columns().items()
    }
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
    tables = {"quantiles.csv": quantiles, "envelope.csv": envelope}
    if near is not None:
        tables["approximation.csv"] = {
            "frequency_Hz": near.frequency, column("mean"): near.mean, column("deviation"): near.deviation,
            "weibull_exponent": near.weibull_exponent, column("quantile_2.5_percent"): near.envelope(0.025),
            column("quantile_97.5_percent"): near.envelope(0.975),
        }  # fmt: skip
    return {"samples.csv": partial(store.write_text, text=samples)} | csv_files(tables, 8)


def _pictures(found: Ensemble, worst: Sample, near: Approximation | None, case: str) -> Files:
    title = f"{case}: highest blade over the tuned ring's"
    drawn: Files = {"amplification": partial(amplification_picture, found, title=title)}
    title = f"{case}: all blades of all samples"
    drawn["mistuned"] = partial(envelope_picture, found, near, title=title)
    title = f"{case}: the highest of all samples"
    drawn["worst"] = partial(worst_picture, found, worst, title=title)
    if near:
        title = f"{case}: sensitivities"
        drawn["sensitivity"] = partial(sensitivity_picture, near, title=title)
    return {f"pictures/{name}.png": draw for name, draw in drawn.items()}


READ_AS = (
    "Amplification: the highest amplitude of any blade over the frequency, over that of the ring of equal sectors. "
    "Intervals lie between order statistics and hold whatever the distribution is. The distance of a fit is the "
    "largest difference between its distribution function and that of the samples; in the tail, of the highest tenth."
)
WORST = 12
"""Samples in the table of the highest."""


def _pieces(found: Ensemble) -> list[Piece]:
    highest = fold("The highest samples, all in samples.csv", _highest(found))
    return [_quantiles(found), _fits(found), highest, say(READ_AS, tone="note")]


def _quantiles(found: Ensemble) -> Piece:
    told = [found.quantile(share) for share in SHARES]
    rows = [[f"{100 * q.share:g} %", number(q.value), _end(q.low), _end(q.high)] for q in told]
    if found.rare is not None:
        q = found.rare.quantile
        head = f"{100 * q.share:g} %, by {found.rare.samples} chosen samples"
        rows.append([head, number(q.value), _end(q.low), _end(q.high)])
    return table(["of the samples below", "amplification", "at least", "at most"], rows)


def _end(value: float) -> str:
    return number(value) if 0 < value < np.inf else "too few samples"


def _fits(found: Ensemble) -> Piece:
    rows = [
        [f.name, *(number(v) for v in f.quantiles.values()), number(f.distance, 2), number(f.tail, 2)]
        for f in fits(found.amplification[found.solved])
    ]
    return table(["fit", *(f"{100 * s:g} %" for s in SHARES), "distance", "in the tail"], rows)


def _highest(found: Ensemble) -> Piece:
    a = np.where(found.solved, found.amplification, -np.inf)
    rows = [
        [i, number(a[i]), number(found.column("frequency_Hz")[i], 6), int(found.column("sector")[i]),
         number(found.column("localisation")[i], 3)]
        for i in np.argsort(-a, kind="stable")[:WORST] if np.isfinite(a[i])
    ]  # fmt: skip
    return table(["sample", "amplification", "frequency in Hz", "blade", "localisation"], rows)


ANALYSIS = Analysis(
    "mistuning",
    Keys,
    solve,
    lost="some samples have no solution; samples.csv has no amplitude for them",
    needed="scatter = [{ of, deviation }]",
    verb="mistune",
    options=("samples", "until", "rare", "workers"),
    alone=True,
    fits=lambda _, case: "" if case.ring else "is that of a ring; add [ring] with blades and engine_order",
    files=lambda asked: [file for s in asked.scatter for file in (s.file, *s.others.values())],
)

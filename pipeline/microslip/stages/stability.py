"""Roots of a body about its equilibrium or steady sliding: tables, pictures, a page that begins with the answer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..data import UserError
from ..files import hdf5, store
from ..files.tables import columns_csv, rows_csv
from ..linalg.parametric import Family, family_of
from ..linalg.quadratic import Window
from ..modal.foreign import values_of
from ..report.roots import roots_html
from ..roots.diagram import Diagram, diagram
from ..roots.spectrum import Spectrum, spectrum
from ..settings.body import StabilitySettings
from ..units import from_rpm, rpm_text
from .job import Job, open_job
from .modal import matrices_inputs
from .stage import Made, Report, Stage


def stability_stage(
    path: Path, assignments: list[str], force: bool = False, report: Report = lambda _: None, pictures: bool = True
) -> tuple[list[Path], list[str], bool]:  # fmt: skip
    """Roots of a body in the window that its [stability] asks for, in build/NAME.

    Returns:
        The files, sentences and lines of a table, and whether the roots are proved complete.

    Raises:
        UserError: no matrices, no window, a parameter that there is not.
    """
    job = open_job(path, assignments)
    given, asked = job.settings.geometry.matrices, job.settings.stability
    if given is None:
        raise UserError(f"{job.path}: stability is computed of geometry.matrices or of a modal file; give build/NAME")
    if asked is None:
        raise UserError(f"{job.path}: stability: is missing; add [stability] with frequency = [0.0, HIGHEST] in Hz")
    stage = Stage(job.build_folder / "stability.json", ("stages.stability",), force, report)
    stage.make(
        {**matrices_inputs(job, given), "pictures": pictures}, lambda: _work(stage, job, asked, report, pictures)
    )
    told = json.loads(stage.product.read_text())
    return [stage.product.parent / name for name in told["files"]], told["lines"], told["complete"]


def window_of(asked: StabilitySettings) -> Window:
    """The window in 1/s and rad/s."""
    low, high = asked.frequency
    return Window(asked.growth, (from_rpm(60 * low), from_rpm(60 * high)))


def family(job: Job) -> Family:
    """The matrices of a body, with what scales with parameters.

    Raises:
        UserError: see `exchange.matrices.read_matrices`.
    """
    from ..exchange.matrices import read_matrices

    given = job.settings.geometry.matrices
    assert given is not None
    try:
        return family_of(read_matrices(given, job.folder, job.settings.length_unit, job.settings.parameters))
    except UserError as error:
        text = str(error)
        raise UserError(text if text.startswith(str(job.folder)) else f"{job.path}: {text}") from error


def _work(stage: Stage, job: Job, asked: StabilitySettings, report: Report, pictures: bool) -> Made:
    folder, matrices, at = stage.product.parent, family(job), values_of(job.settings)
    try:
        if asked.range is not None:
            for value in asked.range:
                matrices.values({**at, asked.over: value}, asked.over)
        Q = matrices.at(at)
    except UserError as error:
        raise UserError(f"{job.path}: {error}") from error
    window = window_of(asked)
    found = spectrum(
        Q, window, accuracy=asked.accuracy, neutral=asked.neutral, certify=asked.certify, report=report
    )  # fmt: skip
    over = None
    if asked.range is not None:
        values = np.linspace(*asked.range, asked.points)
        how = {"tolerance": asked.tolerance, "neutral": asked.neutral}
        over = diagram(matrices, asked.over, values, window, at=at, report=report, **how)
    stage.begin()
    names = _written(folder, job, found, over, pictures)
    told = {
        "files": names,
        "lines": [*table_lines(found), found.sentence, *([over.sentence] if over else [])],
        "complete": found.complete or not asked.certify,
    }
    store.write_text(stage.product, json.dumps(told, indent=1) + "\n")
    return Made([folder / name for name in names])


def _written(folder: Path, job: Job, found: Spectrum, over: Diagram | None, pictures: bool) -> list[str]:
    """Names of the files, the page first."""
    drawn = _pictures(found, over, folder / "pictures") if pictures else {}
    texts = {
        "stability.html": roots_html(f"{job.settings.name}: stability", state_words(job), found, over, drawn),
        "stability.csv": table_csv(found),
    }
    if over is not None:
        texts["stability_over.csv"] = columns_csv(over.columns, 12)
    for name, text in texts.items():
        store.write_text(folder / name, text)
    write_roots(folder / "stability.h5", found, over, values_of(job.settings))
    return [*texts, "stability.h5", *(str(p.relative_to(folder)) for p in drawn.values())]


def write_roots(path: Path, found: Spectrum, over: Diagram | None, values: Mapping[str, float]) -> None:
    """Roots, their right and left vectors, and the roots over a range, as HDF5 with named dimensions.

    Raises:
        UserError: no permission, no space.
    """
    with store.complete_or_absent(path) as temporary:
        with hdf5.create(temporary) as file:
            file.attrs["format"], file.attrs["complete"] = "microslip-roots", int(found.complete)
            file.attrs["values"] = json.dumps(dict(values))
            where = file.create_group("roots")
            for name, column in found.columns.items():
                hdf5.put(where, name, np.array(column), dims=("root",))
            hdf5.put(where, "s", found.roots.s, "1/s", ("root",))
            for name, vectors in (("shape", found.roots.x), ("left", found.roots.y)):
                hdf5.put(where, name, vectors, dims=("coordinate", "root"))
            for name, column in over.columns.items() if over else ():
                hdf5.put(file.require_group("over"), name, column, dims=("row",))
        hdf5.seal(temporary)


def state_words(job: Job) -> str:
    """Where the roots of the table are taken: "At 120 rpm"."""
    others = [f"{name} = {value:g}" for name, value in job.settings.values.items()]
    return "At " + ", ".join([rpm_text(values_of(job.settings)["speed"]), *others])


def _pictures(found: Spectrum, over: Diagram | None, folder: Path) -> dict[str, Path]:
    from ..pictures.plots import save_figure

    folder.mkdir(exist_ok=True)
    drawn = {"plane": save_figure(found.plot(), folder / "roots.png")}
    if over is not None:
        drawn["over"] = save_figure(over.plot(), folder / "roots_over.png")
    return drawn


def table_csv(found: Spectrum) -> str:
    """One row a root, sixteen digits."""
    rows = zip(*found.columns.values(), strict=True)
    return rows_csv(found.columns, ((v if isinstance(v, str) else f"{v:.16g}" for v in row) for row in rows))


def table_lines(found: Spectrum) -> list[str]:
    """The table for the terminal."""
    head = f"{'Hz':>14} {'growth 1/s':>14} {'damping':>11}  {'':8} {'backward error':>14}"
    c = found.columns
    shown = ("frequency_Hz", "growth_1_s", "damping_ratio", "verdict", "backward_error")
    rows = zip(*(c[k] for k in shown), strict=True)
    return [head, *(f"{f:14.7f} {g:14.7g} {d:11.3e}  {v:8} {e:14.1e}" for f, g, d, v, e in rows)]

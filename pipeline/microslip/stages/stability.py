"""Roots of a body about its equilibrium or steady sliding: tables, pictures, a page that begins with the answer."""

from __future__ import annotations

import json
from pathlib import Path

from ..data import UserError
from ..files import store
from ..files.tables import rows_csv
from ..linalg.parametric import Family, family_of
from ..linalg.quadratic import Window
from ..settings.body import StabilitySettings
from ..stability.spectrum import Spectrum, spectrum
from ..units import from_rpm
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
    stage.make({**matrices_inputs(job, given), "pictures": pictures}, lambda: _work(stage, job, asked, report))
    told = json.loads(stage.product.read_text())
    return [stage.product.parent / name for name in told["files"]], told["lines"], told["complete"]


def values_of(job: Job) -> dict[str, float]:
    """The state of a body: its speed of rotation (rad/s) and the values of its other parameters."""
    return {"speed": from_rpm(job.settings.rotation.speeds_rpm[0]), **job.settings.values}


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


def _work(stage: Stage, job: Job, asked: StabilitySettings, report: Report) -> Made:
    folder = stage.product.parent
    found = spectrum(
        family(job).at(values_of(job)), window_of(asked), accuracy=asked.accuracy, neutral=asked.neutral,
        certify=asked.certify, report=report,
    )  # fmt: skip
    stage.begin()
    store.write_text(folder / "stability.csv", table_csv(found))
    names = ["stability.csv"]
    told = {
        "files": names,
        "lines": [*table_lines(found), found.sentence],
        "complete": found.complete or not asked.certify,
    }
    store.write_text(stage.product, json.dumps(told, indent=1) + "\n")
    return Made([folder / name for name in names])


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

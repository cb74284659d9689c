"""Roots of a body about its equilibrium or steady sliding: tables, pictures, a page that begins with the answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis import Answer, Files
from ..basis import read_basis
from ..errors import UserError, in_its_file, of_file
from ..exchange.choice import select
from ..files import store
from ..files.tables import write_columns
from ..linalg.parametric import Family, family_of, family_of_group
from ..linalg.quadratic import Window
from ..modal.foreign import values_of
from ..pictures.roots import over_picture, plane_picture
from ..report.page import fold, table
from ..report.roots import root_table, table_lines
from ..ring.resonances import speeds_of
from ..roots.asked import window_of, write_roots
from ..roots.diagram import diagram
from ..roots.spectrum import spectrum
from ..settings.body import StabilitySettings
from ..units import rpm_text
from .answer import Written, made
from .job import Job, open_job
from .modal import matrices_inputs, modes_stage
from .stage import Report, Stage


@dataclass(frozen=True)
class Inquiry:
    """What is asked of which matrices.

    Attributes:
        name: for titles. folder: of the products. where: begins a refusal. family: makes the matrices. at: values of
            their parameters. window, asked: of [stability]. inputs: what the answer depends on. speeds: how many
            the modal file has.
    """

    name: str
    folder: Path
    where: Path
    family: Callable[[], Family]
    at: Mapping[str, float]
    window: Window
    asked: StabilitySettings
    inputs: Mapping[str, Any]
    speeds: int = 1

    @property
    def state(self) -> str:
        """Where the roots of the table are taken: "At 120 rpm"."""
        others = [f"{name} = {value:g}" for name, value in self.at.items() if name != "speed"]
        return "At " + ", ".join([rpm_text(self.at["speed"]), *others])


def stability_stage(
    path: Path, assignments: list[str], force: bool = False, report: Report = lambda _: None, pictures: bool = True,
    speed: int | None = None,
) -> Written:  # fmt: skip
    """Roots of a body or of a modal file, and over a range of a parameter where [stability] asks for it; whole if they
    are proved complete.

    Args:
        speed: which of the modal file's, counted from 0.

    Raises:
        UserError: no window, a parameter that there is not, a case.
    """
    q = question(path, assignments, report, speed)
    origin = None if q.where.suffix == ".h5" else q.where
    stage = Stage(q.folder / "stability.json", ("stages.stability",), force, report, origin)
    return made(stage, q.inputs, f"{q.name}: stability. {q.state}", pictures, lambda _: _answer(q, report))


@in_its_file
def question(
    path: Path, assignments: list[str], report: Report = lambda _: None, speed: int | None = None
) -> Inquiry:  # fmt: skip
    """What a body.toml or a modal file asks.

    Raises:
        UserError: matrices without a window, or with a number of a speed; one that the modal file does not have; a
            case; settings for a modal file.
    """
    if path.suffix == ".h5":
        if assignments:
            raise UserError(f"--set {assignments[0]}: a modal file has no settings; give its body.toml instead")
        return _of_basis(path, None, speed)
    job = open_job(path, assignments)
    given, asked = job.settings.geometry.matrices, job.settings.stability
    if given is None:
        return _of_basis(modes_stage(job, report=report)[0], asked, speed)
    if speed is not None:
        raise UserError(f"--speed {speed}: is of a modal file; matrices have rotation.speeds_rpm")
    if asked is None:
        raise UserError("is missing; add [stability] with frequency = [0.0, HIGHEST] in Hz", "stability")
    return Inquiry(
        job.settings.name, job.build_folder, job.path, lambda: family(job), values_of(job.settings), window_of(asked),
        asked, matrices_inputs(job, given),
    )  # fmt: skip


def _of_basis(file: Path, asked: StabilitySettings | None, speed: int | None) -> Inquiry:
    """All roots of one of a modal file's speeds, the first if not given, or those in a window."""
    whole = read_basis(file)
    basis = select(whole, speed or 0, None)
    g = basis.groups[min(basis.groups)]
    if asked is None:
        highest = float(g.omega.max(initial=1.0)) / np.pi  # twice the frequency of the highest mode
        asked = StabilitySettings(growth=(-2 * np.pi * highest, 2 * np.pi * highest), frequency=(0.0, highest))
    inputs = {"basis": store.hash_file(file), "stability": asked.model_dump(), "speed": g.speed}
    reduced, speeds = family_of_group(basis.name, g), len(speeds_of(whole))
    return Inquiry(
        basis.name, file.parent, file, lambda: reduced, {"speed": g.speed}, window_of(asked), asked, inputs, speeds
    )


def family(job: Job) -> Family:
    """The matrices of a body, with what scales with parameters.

    Raises:
        UserError: see `exchange.matrices.read_matrices`.
    """
    from ..exchange.matrices import read_matrices

    given = job.settings.geometry.matrices
    assert given is not None
    with of_file(job.path):
        return family_of(read_matrices(given, job.folder, job.settings.length_unit, job.settings.parameters))


def _answer(q: Inquiry, report: Report) -> Answer:
    matrices, asked = q.family(), q.asked
    with of_file(q.where):
        for value in asked.range or ():
            matrices.values({**q.at, asked.over: value}, asked.over)
        Q = matrices.at(q.at)
    found = spectrum(
        Q, q.window, accuracy=asked.accuracy, neutral=asked.neutral, certify=asked.certify, report=report
    )  # fmt: skip
    over = None
    if asked.range is not None:
        over = diagram(
            matrices, asked.over, np.linspace(*asked.range, asked.points), q.window, at=q.at,
            tolerance=asked.tolerance, neutral=asked.neutral, report=report,
        )  # fmt: skip
    files: Files = {
        "stability.csv": partial(write_columns, found.columns, 16),
        "stability.h5": lambda path: write_roots(path, found, over, q.at),
        "pictures/roots.png": partial(plane_picture, found),
    }
    pieces, said = root_table(found), [found.sentence]
    if over is not None:
        files["stability_over.csv"] = partial(write_columns, over.columns, 12)
        files["pictures/roots_over.png"] = partial(over_picture, over)
        counts = [(f"{v:.6g}", str(n)) for v, n in zip(over.values, over.unstable, strict=True)]
        pieces.append(fold("How many roots grow at each value", table([over.parameter, "grow"], counts)))
        said.append(over.sentence)
    whole = found.complete or not asked.certify
    if q.speeds > 1:
        which = f"{q.state}, one of the {q.speeds} speeds of the modal file"
        said.append(f"{which}: --speed 0 to {q.speeds - 1} chooses")
    return Answer(said, tables=pieces, whole=whole, files=files, lines=table_lines(found))

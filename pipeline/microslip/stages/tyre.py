"""A tyre whose slip or load jumps: from its modal file to time constants, as tables, a picture and a page."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ..analysis import Answer
from ..basis import read_basis
from ..data import ModalBasis
from ..files.tables import csv_files
from ..pictures.tyre import tyre_picture
from ..report.page import say
from ..report.response import number_tables
from ..results import Journal
from ..rolling.tyre import TyreAnswer, load_tyre, study
from .answer import RollJob, Written
from .job import open_job
from .modal import modes_stage
from .places import find_body
from .stage import Report


def tyre_stage(job: RollJob) -> Written:
    """What a case of a tyre asks for; the modal file of its body is made where it is not up to date.

    Raises:
        UserError: mistakes of the case or its body.
    """
    case, raw = load_tyre(job.path, list(job.assignments))
    stage = job.stage(case.name, "tyre", "stages.tyre")
    file, _ = modes_stage(open_job(find_body(job.path, case.tyre.body, Path("."))), report=job.report)

    def solve(_: Journal, report: Report) -> Answer:
        report("jumps of slip and load")
        wheel = read_basis(file)
        return _answer(study(case, wheel.groups[0, 0]), wheel, case.name)

    files = [file.resolve()]
    return job.answer(stage, case.name, raw, files, "unsteady rolling", solve)


def _answer(found: TyreAnswer, wheel: ModalBasis, case: str) -> Answer:
    slips, forces = found.steady
    tables = {
        "loads.csv": found.loads(),
        "constants.csv": found.constants,
        "steady.csv": {"slip": slips, "force_over_normal_force": forces},
    }
    drawn = {"pictures/tyre.png": partial(tyre_picture, found, title=case, wheel=wheel)}
    pieces = [*number_tables({"loads.csv": tables["loads.csv"]}), say(READ_AS, tone="note")]
    return Answer(found.sentences(), tables=pieces, files=csv_files(tables, 8) | drawn)


READ_AS = (
    "A row of point contacts along the middle of the patch, each with its share of the static pressure, is passed by "
    "the material (Sextro, 6.10). Time constants are of the exponential that fits the force best; the normal force "
    "follows from the static state, large displacements and contact by Newton's method. Reached: 1 - 1/e of the change."
)

"""A small vehicle on unround wheels: wear over the circumference and growth of waves as tables, pictures, a page."""

from __future__ import annotations

from functools import partial

from ..analysis import Answer
from ..files.tables import csv_files
from ..pictures.vehicle import circumference_picture, growth_picture, recorded_picture
from ..report.page import say
from ..results import Journal
from ..rolling.settings import SectionKeys
from ..vehicle.kinematics import recorded
from ..vehicle.settings import KinematicsCase, VehicleCase, load_kinematics, load_vehicle
from ..vehicle.study import study
from .answer import RollJob, Written
from .stage import Report


def vehicle_stage(job: RollJob) -> Written:
    """What a case of a vehicle asks for; whole if it did not end early.

    Raises:
        UserError: mistakes of the case or its profiles.
    """
    case, raw = load_vehicle(job.path, list(job.assignments))
    stage = job.stage(case.name, "unround", "stages.vehicle")
    solve, files = partial(_unround, job, case), _profiles(case.wheel, case.rail)
    return job.answer(stage, case.name, raw, files, "unround wheels", solve)


def kinematics_stage(job: RollJob) -> Written:
    """Wear of a wheel by the kinematics of a file.

    Raises:
        UserError: mistakes of the case or its files.
    """
    case, raw = load_kinematics(job.path, list(job.assignments))
    stage = job.stage(case.name, "unround", "stages.vehicle")
    files = [*_profiles(case.wheel, case.rail), case.kinematics.file]
    solve = partial(_recorded, job, case)
    return job.answer(stage, case.name, raw, files, "wear of a wheel", solve)


def _profiles(*sections: SectionKeys) -> list[str]:
    """Files of the profiles."""
    return [s.profile for s in sections if isinstance(s.profile, str)]


def _recorded(job: RollJob, case: KinematicsCase, journal: Journal, report: Report) -> Answer:
    found = recorded(case, job.path.parent, report, journal)
    tables = {"circumference.csv": found.circumference(), "wear.csv": found.jumped()}
    drawn = {"pictures/circumference.png": partial(recorded_picture, found, title=case.name)}
    return Answer(found.sentences(), whole=not found.ended, files=csv_files(tables, 10) | drawn)


def _unround(job: RollJob, case: VehicleCase, journal: Journal, report: Report) -> Answer:
    found = study(case, job.path.parent, report, journal)
    tables = {
        "circumference.csv": found.circumference(),
        "growth.csv": found.growing(),
        "speeds.csv": found.over_speed(),
    }
    drawn = {
        "pictures/circumference.png": partial(circumference_picture, found, title=case.name),
        "pictures/growth.png": partial(growth_picture, found, title=case.name),
    }
    return Answer(
        found.sentences(),
        tables=[say(READ_AS, tone="note")],
        whole=not found.ended,
        files=csv_files(tables, 10) | drawn,
    )


READ_AS = (
    "Angles count from the mark of the wheel: what stands at 90 degrees rolls over the rail a quarter of a turn after "
    "the mark. Radii are those that the contact sees, means weighted by its pressure. Wear is "
    "the coefficient times the frictional work over each strip (Sextro, 6.8-6), laid over the strips of the tread."
)

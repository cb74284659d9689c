"""A small vehicle on unround wheels: wear over the circumference and growth of waves as tables, pictures, a page."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..errors import UserError, of_file
from ..files import store
from ..files.tables import write_tables
from ..report.page import answer_page
from ..report.vehicle import vehicle_html
from ..results import Journal, open_journal
from ..rolling.settings import Section
from ..vehicle.kinematics import recorded
from ..vehicle.settings import KinematicsCase, VehicleCase, load_kinematics, load_vehicle
from ..vehicle.study import Studied, study
from .answer import RollJob, Written, answered
from .stage import Stage, hash_of_code


def vehicle_stage(job: RollJob) -> Written:
    """What a case of a vehicle asks for; whole if it did not end early.

    Raises:
        UserError: mistakes of the case or its profiles.
    """
    case, raw = load_vehicle(job.path, list(job.assignments))
    stage = job.stage(case.name, "unround", "stages.vehicle")
    inputs = job.inputs(raw, _profiles(case.wheel, case.rail))
    return _answered(stage, inputs, lambda: _work(stage, case, job, inputs))


def kinematics_stage(job: RollJob) -> Written:
    """Wear of a wheel by the kinematics of a file.

    Raises:
        UserError: mistakes of the case or its files.
    """
    case, raw = load_kinematics(job.path, list(job.assignments))
    stage = job.stage(case.name, "unround", "stages.vehicle")
    inputs = job.inputs(raw, [*_profiles(case.wheel, case.rail), case.kinematics.file])
    return _answered(stage, inputs, lambda: _recorded(stage, case, job, inputs))


def _profiles(*sections: Section) -> list[str]:
    """Files of the profiles."""
    return [s.profile for s in sections if isinstance(s.profile, str)]


def _recorded(stage: Stage, case: KinematicsCase, job: RollJob, inputs: Mapping[str, Any]) -> Written:
    with _kept(stage, job.path, inputs) as journal:
        found = recorded(case, job.path.parent, stage.report, journal)
    stage.begin()
    folder, drawn = stage.product.parent, []
    made = write_tables(folder, {"circumference.csv": found.circumference(), "wear.csv": found.jumped()}, 10)
    if job.pictures:
        from ..pictures.vehicle import recorded_picture

        drawn = [recorded_picture(found, folder / "pictures" / "circumference.png", case.name)]
    page = folder / "unround.html"
    store.write_text(page, answer_page(f"{case.name}: wear of a wheel", found.sentences(), drawn))
    return Written([page, *made, *drawn], found.sentences(), not found.ended)


def _points(stage: Stage) -> Path:
    return stage.product.with_suffix(".points")


def _answered(stage: Stage, inputs: Mapping[str, Any], work: Callable[[], Written]) -> Written:
    found = answered(stage, inputs, work)
    _points(stage).unlink(missing_ok=True)
    return found


@contextlib.contextmanager
def _kept(stage: Stage, case_path: Path, inputs: Mapping[str, Any]) -> Iterator[Journal]:
    """A journal of what is finished, until all that is made of it is there; mistakes are told with the case."""
    depends = store.hash_settings({**inputs, "pictures": None, "code": hash_of_code(stage.code)})
    with of_file(case_path), open_journal(_points(stage), depends, {"case": str(case_path)}, stage.force) as journal:
        try:
            yield journal
        except UserError:
            if not journal.series:
                _points(stage).unlink()
            raise


def _work(stage: Stage, case: VehicleCase, job: RollJob, inputs: Mapping[str, Any]) -> Written:
    folder = stage.product.parent
    with _kept(stage, job.path, inputs) as journal:
        found = study(case, job.path.parent, stage.report, journal)
    stage.begin()
    made = _tables(found, folder)
    drawn = _pictures(found, folder / "pictures", case.name) if job.pictures else []
    page = folder / "unround.html"
    store.write_text(page, vehicle_html(f"{case.name}: unround wheels", found, drawn))
    return Written([page, *made, *drawn], found.sentences(), not found.ended)


def _tables(found: Studied, folder: Path) -> list[Path]:
    tables = {
        "circumference.csv": found.circumference(),
        "growth.csv": found.growing(),
        "speeds.csv": found.over_speed(),
    }
    return write_tables(folder, tables, 10)


def _pictures(found: Studied, folder: Path, name: str) -> list[Path]:
    from ..pictures.vehicle import circumference_picture, growth_picture

    return [
        circumference_picture(found, folder / "circumference.png", name),
        growth_picture(found, folder / "growth.png", name),
    ]

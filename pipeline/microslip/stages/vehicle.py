"""A small vehicle on unround wheels: wear over the circumference and growth of waves as tables, pictures, a page."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..data import UserError
from ..errors import told_of
from ..files import store
from ..files.tables import columns_csv
from ..report.page import answer_page
from ..report.vehicle import vehicle_html
from ..results import Journal, open_journal
from ..vehicle.kinematics import recorded
from ..vehicle.settings import VehicleCase, load_kinematics, load_vehicle
from ..vehicle.study import Studied, study
from .answer import Answer, answered
from .stage import Report, Stage, hash_of_code


def vehicle_stage(
    case_path: Path, root: Path = Path("build"), assignments: list[str] | None = None, force: bool = False,
    report: Report = lambda _: None, pictures: bool = True,
) -> Answer:  # fmt: skip
    """What a case of a vehicle asks for, in ``root/NAME``; whole if it did not end early.

    Raises:
        UserError: mistakes of the case or its profiles.
    """
    case, raw = load_vehicle(case_path, assignments)
    stage = Stage(root / case.name / "unround.json", ("stages.vehicle",), force, report)
    files = [case_path.parent / s.profile for s in (case.wheel, case.rail) if isinstance(s.profile, str)]
    inputs = {"case": raw, "profiles": [store.hash_file(f) for f in files if f.is_file()], "pictures": pictures}
    return _answered(stage, inputs, lambda: _work(stage, case, case_path, pictures, inputs))


def kinematics_stage(
    case_path: Path, root: Path = Path("build"), assignments: list[str] | None = None, force: bool = False,
    report: Report = lambda _: None, pictures: bool = True,
) -> Answer:  # fmt: skip
    """Wear of a wheel by the kinematics of a file, in ``root/NAME``.

    Raises:
        UserError: mistakes of the case or its files.
    """
    case, raw = load_kinematics(case_path, assignments)
    stage = Stage(root / case.name / "unround.json", ("stages.vehicle",), force, report)
    names = [s.profile for s in (case.wheel, case.rail) if isinstance(s.profile, str)] + [case.kinematics.file]
    files = [case_path.parent / name for name in names]
    inputs = {"case": raw, "files": [store.hash_file(f) for f in files if f.is_file()], "pictures": pictures}

    def work() -> Answer:
        with _kept(stage, case_path, inputs) as journal:
            found = recorded(case, case_path.parent, report, journal)
        stage.begin()
        folder, drawn = stage.product.parent, []
        made = [folder / "circumference.csv", folder / "wear.csv"]
        for path, columns in zip(made, (found.circumference(), found.jumped()), strict=True):
            store.write_text(path, columns_csv(columns, 10))
        if pictures:
            from ..pictures.vehicle import recorded_picture

            drawn = [recorded_picture(found, folder / "pictures" / "circumference.png", case.name)]
        page = folder / "unround.html"
        store.write_text(page, answer_page(f"{case.name}: wear of a wheel", found.sentences(), drawn))
        return Answer([page, *made, *drawn], found.sentences(), not found.ended)

    return _answered(stage, inputs, work)


def _points(stage: Stage) -> Path:
    return stage.product.with_suffix(".points")


def _answered(stage: Stage, inputs: Mapping[str, Any], work: Callable[[], Answer]) -> Answer:
    found = answered(stage, inputs, work)
    _points(stage).unlink(missing_ok=True)
    return found


@contextlib.contextmanager
def _kept(stage: Stage, case_path: Path, inputs: Mapping[str, Any]) -> Iterator[Journal]:
    """A journal of what is finished, until all that is made of it is there; mistakes are told with the case."""
    depends = store.hash_settings({**inputs, "pictures": None, "code": hash_of_code(stage.code)})
    with told_of(case_path), open_journal(_points(stage), depends, {"case": str(case_path)}, stage.force) as journal:
        try:
            yield journal
        except UserError:
            if not journal.series:
                _points(stage).unlink()
            raise


def _work(stage: Stage, case: VehicleCase, case_path: Path, pictures: bool, inputs: Mapping[str, Any]) -> Answer:
    folder = stage.product.parent
    with _kept(stage, case_path, inputs) as journal:
        found = study(case, case_path.parent, stage.report, journal)
    stage.begin()
    made = _tables(found, folder)
    drawn = _pictures(found, folder / "pictures", case.name) if pictures else []
    page = folder / "unround.html"
    store.write_text(page, vehicle_html(f"{case.name}: unround wheels", found, drawn))
    return Answer([page, *made, *drawn], found.sentences(), not found.ended)


def _tables(found: Studied, folder: Path) -> list[Path]:
    tables = {
        "circumference.csv": found.circumference(),
        "growth.csv": found.growing(),
        "speeds.csv": found.over_speed(),
    }
    for name, columns in tables.items():
        if columns:
            store.write_text(folder / name, columns_csv(columns, 10))
    return [folder / name for name, columns in tables.items() if columns]


def _pictures(found: Studied, folder: Path, name: str) -> list[Path]:
    from ..pictures.vehicle import circumference_picture, growth_picture

    return [
        circumference_picture(found, folder / "circumference.png", name),
        growth_picture(found, folder / "growth.png", name),
    ]

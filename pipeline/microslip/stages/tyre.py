"""A tyre whose slip or load jumps: from its modal file to time constants, as tables, a picture and a page."""

from __future__ import annotations

from pathlib import Path

from ..basis import read_basis
from ..errors import told_of
from ..files import store
from ..files.tables import columns_csv
from ..report.tyre import tyre_html
from ..rolling.slip import Studied, TyreCase, load_tyre, study
from .answer import Answer, answered
from .job import open_job
from .modal import modes_stage
from .places import find_body
from .stage import Report, Stage


def tyre_stage(
    case_path: Path, root: Path = Path("build"), assignments: list[str] | None = None, force: bool = False,
    report: Report = lambda _: None, pictures: bool = True,
) -> Answer:  # fmt: skip
    """What a case of a tyre asks for, in ``root/NAME``; the modal file of its body is made where it is not up to date.

    Raises:
        UserError: mistakes of the case or its body.
    """
    case, raw = load_tyre(case_path, assignments)
    job = open_job(find_body(case_path, case.tyre.body, Path(".")), root=Path("."))
    basis, _ = modes_stage(job, report=report)
    stage = Stage(root / case.name / "tyre.json", ("stages.tyre",), force, report)
    inputs = {"case": raw, "basis": store.hash_file(basis), "pictures": pictures}
    return answered(stage, inputs, lambda: _work(stage, case, case_path, basis, pictures))


def _work(stage: Stage, case: TyreCase, case_path: Path, basis: Path, pictures: bool) -> Answer:
    folder = stage.product.parent
    stage.report("jumps of slip and load")
    with told_of(case_path):
        found = study(case, read_basis(basis).groups[0, 0])
    stage.begin()
    made = _tables(found, folder)
    drawn = [_picture(found, folder / "pictures", case.name)] if pictures else []
    page = folder / "tyre.html"
    store.write_text(page, tyre_html(f"{case.name}: unsteady rolling", found, drawn))
    return Answer([page, *made, *drawn], found.sentences())


def _tables(found: Studied, folder: Path) -> list[Path]:
    slips, forces = found.steady
    tables = {
        "constants.csv": found.constants, "loads.csv": found.loads(),
        "steady.csv": {"slip": slips, "force_over_normal_force": forces},
    }  # fmt: skip
    for name, columns in tables.items():
        store.write_text(folder / name, columns_csv(columns, 8))
    return [folder / name for name in tables]


def _picture(found: Studied, folder: Path, name: str) -> Path:
    from ..pictures.tyre import tyre_picture

    return tyre_picture(found, folder / "tyre.png", name)

"""A tyre whose slip or load jumps: from its modal file to time constants, as tables, a picture and a page."""

from __future__ import annotations

from pathlib import Path

from ..basis import read_basis
from ..data import ModalBasis
from ..errors import of_file
from ..files import store
from ..files.tables import write_tables
from ..report.tyre import tyre_html
from ..rolling.slip import Studied, TyreCase, load_tyre, study
from .answer import RollJob, Written, answered
from .job import open_job
from .modal import modes_stage
from .places import find_body
from .stage import Stage


def tyre_stage(job: RollJob) -> Written:
    """What a case of a tyre asks for; the modal file of its body is made where it is not up to date.

    Raises:
        UserError: mistakes of the case or its body.
    """
    case, raw = load_tyre(job.path, list(job.assignments))
    stage = job.stage(case.name, "tyre", "stages.tyre")
    basis, _ = modes_stage(open_job(find_body(job.path, case.tyre.body, Path("."))), report=job.report)
    return answered(stage, job.inputs(raw, [basis.resolve()]), lambda: _work(stage, case, job, basis))


def _work(stage: Stage, case: TyreCase, job: RollJob, basis: Path) -> Written:
    folder = stage.product.parent
    stage.report("jumps of slip and load")
    with of_file(job.path):
        wheel = read_basis(basis)
        found = study(case, wheel.groups[0, 0])
    stage.begin()
    made = _tables(found, folder)
    drawn = [_picture(found, wheel, folder / "pictures", case.name)] if job.pictures else []
    page = folder / "tyre.html"
    store.write_text(page, tyre_html(f"{case.name}: unsteady rolling", found, drawn))
    return Written([page, *made, *drawn], found.sentences())


def _tables(found: Studied, folder: Path) -> list[Path]:
    slips, forces = found.steady
    tables = {
        "constants.csv": found.constants, "loads.csv": found.loads(),
        "steady.csv": {"slip": slips, "force_over_normal_force": forces},
    }  # fmt: skip
    return write_tables(folder, tables, 8)


def _picture(found: Studied, wheel: ModalBasis, folder: Path, name: str) -> Path:
    from ..pictures.tyre import tyre_picture

    return tyre_picture(found, folder / "tyre.png", name, wheel)

"""Rolling contact of a case: patches and creep curve as tables, pictures and a page."""

from __future__ import annotations

from functools import partial
from importlib.util import find_spec
from pathlib import Path

from ..analysis import Answer, Files
from ..basis import read_basis
from ..errors import UserError, in_its_file
from ..files import store
from ..files.tables import csv_files, rows_csv
from ..pictures.rolling import curve_picture, traction_picture, wearing_picture, write_tractions_vtu
from ..report.page import Piece, number, say, table
from ..results import Journal
from ..rolling.behind import ROWS, Behind, behind
from ..rolling.contact_table import ContactTable, contact_table, write_contact_table
from ..rolling.settings import RollingCase, SectionKeys, load_rolling
from ..rolling.study import RollingAnswer, rows_of_patches, study
from ..rolling.table import creep_table, write_creep_table
from ..rolling.wearing import ProfileWear, wearing
from .answer import RollJob, Written
from .job import Job, open_job
from .modal import modes_stage
from .places import find_body
from .stage import Report


def rolling_stage(job: RollJob) -> Written:
    """What a rolling case asks for.

    Raises:
        UserError: mistakes of the case or its profiles.
    """
    case, raw = load_rolling(job.path, list(job.assignments))
    stage = job.stage(case.name, "rolling", "stages.rolling")
    bodies = _bodies(case, job.path, job.report)
    files: list[Path | str] = [*case.files, *(body.resolve() for body in bodies)]

    solve = partial(_answer, case, job.path, bodies)
    return job.answer(stage, case.name, raw, files, "rolling contact", solve)


def _bodies(case: RollingCase, case_path: Path, report: Report) -> list[Path]:
    """Modal files of wheel and rail, made where they are not up to date."""
    if case.elastic is None:
        return []
    named = {"wheel": case.elastic.wheel, "rail": case.elastic.rail}
    jobs = {key: open_job(find_body(case_path, name, Path("."))) for key, name in named.items()}
    for key, job in jobs.items():
        _of_one_material(case_path, key, job, getattr(case, key))
    return [modes_stage(job, report=report)[0] for job in jobs.values()]


@in_its_file
def _of_one_material(case_path: Path, key: str, job: Job, section: SectionKeys) -> None:
    """A body and the half-space that stands for its contact, of which one is taken out and the other put in."""
    own = [getattr(job.settings.material, name, None) for name in ("young", "poisson")]
    asked = [section.young, section.poisson]
    if None not in own and own != asked:
        raise UserError(
            f"{key}.young, {key}.poisson: {asked} in the case and {own} in {job.path}; with [elastic] "
            "they must be the same, correct one"
        )


def _answer(case: RollingCase, path: Path, bodies: list[Path], _: Journal, report: Report) -> Answer:
    report("patches and creep curve")
    found = study(case, path)
    elastic, contacts = _behind(found, bodies), _contacts(found, report)
    worn = _wearing(found, path, report)
    files, said = _tables(found) | ({} if worn is None else _worn_tables(worn)), found.sentences()
    if elastic is not None:
        files |= csv_files({"stiffness.csv": {"direction": ROWS, **elastic.columns()}}, 8)
        said.append(elastic.sentence())
    if case.table is not None:
        report("table of creep forces")
        how = case.model.model_dump(include={"distribution", "coefficients"})
        table = creep_table(found.track.elastic.poisson, **case.table.model_dump(), **how)
        files["creep_table.h5"] = lambda file: write_creep_table(file, table)
        said.append(table.sentence())
    if contacts is not None:
        files["contact_table.h5"] = lambda file: write_contact_table(file, contacts)
        said.append(contacts.sentence())
    said += [worn.sentence(), *worn.warnings()] if worn is not None else []
    drawn = _pictures(found, worn, case.name) if found.forces is not None else {}
    return Answer(
        said,
        tables=[_patches(found), say(READ_AS, tone="note")],
        files=files | drawn,
        moving=partial(_in_paraview, found),
    )


def _behind(found: RollingAnswer, bodies: list[Path]) -> Behind | None:
    elastic = found.case.elastic
    if elastic is None or not found.patches:
        return None
    files = [read_basis(file) for file in bodies]
    groups, methods = [b.groups[0, 0] for b in files], [b.reduction for b in files]
    return behind(found.patches[0], found.case.solids, groups, elastic.face, methods)


def _contacts(found: RollingAnswer, report: Report) -> ContactTable | None:
    asked = found.case.contacts
    if asked is None:
        return None
    return contact_table(found.track, found.case.vertical_force, **asked.model_dump(), report=report)


def _wearing(found: RollingAnswer, path: Path, report: Report) -> ProfileWear | None:
    if found.case.wear is None or not found.case.wear.updates:
        return None
    return wearing(found.case, found.track, found.case.characteristic(path), found.case.surface(path), report)


def _worn_tables(worn: ProfileWear) -> Files:
    """Over the passages, and both profiles as tables in mm that a case takes."""
    tables = {"wearing.csv": worn.columns()}
    tables |= {f"{name}_worn.csv": getattr(worn, name).columns(worn.smoothing) for name in ("wheel", "rail")}
    return csv_files(tables, 10)


def _tables(found: RollingAnswer) -> Files:
    rows = {"patches.csv": rows_of_patches(found.patches)}
    made: Files = {}
    if found.forces is not None:
        columns = {"creep.csv": found.columns(), "exact.csv": found.beside(), "wear.csv": found.worn()}
        made, rows["forces.csv"] = csv_files(columns, 8), found.generalised()
    return made | {name: partial(store.write_text, text=rows_csv(*of)) for name, of in rows.items()}


def _pictures(found: RollingAnswer, worn: ProfileWear | None, case: str) -> Files:
    drawn: Files = {
        "pictures/creep.png": partial(curve_picture, found, title=f"{case}: creep curve"),
        "pictures/tractions.png": partial(traction_picture, found, title=case),
    }
    if worn is not None:
        drawn["pictures/wearing.png"] = partial(wearing_picture, worn, title=case)
    return drawn


def _in_paraview(found: RollingAnswer, folder: Path) -> list[Path]:
    if found.forces is None or found.tractions is None or not find_spec("meshio"):
        return []
    write_tractions_vtu(found.tractions, file := folder / "tractions.vtu")
    return [file]


READ_AS = (
    "Forces act on the wheel, at the middle of the patch: x forward, y to the left, z up. A positive creepage means "
    "that the wheel's surface moves forward (to the left) against the rail, and gives a negative force. Hertz' ellipse "
    "with the mean curvature over the patch; strips of point contacts (Sextro, 6.5)."
)


def _patches(found: RollingAnswer) -> Piece:
    head = ["y on the rail in mm", "angle in mrad", "a, b in mm", "normal force in N", "pressure in MPa",
            "creepages", "spin in 1/m"]  # fmt: skip
    rows = [
        [number(1e3 * p.on_rail), number(1e3 * p.angle, 3), f"{1e3 * p.a:.3g}, {1e3 * p.b:.3g}",
         number(p.normal_force, 5), number(p.pressure / 1e6), f"{p.xi:.3g}, {p.eta:.3g}", number(p.phi, 3)]
        for p in found.patches
    ]  # fmt: skip
    return table(head, rows)

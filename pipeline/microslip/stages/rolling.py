"""Rolling contact of a case: patches and creep curve as tables, pictures and a page."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from ..basis import read_basis
from ..errors import UserError, in_its_file, of_file
from ..files import store
from ..files.tables import rows_csv, write_tables
from ..report.rolling import rolling_html
from ..rolling.behind import ROWS, Behind, behind
from ..rolling.contact_table import ContactTable, contact_table, write_contact_table
from ..rolling.settings import RollingCase, Section, load_rolling
from ..rolling.study import Studied, rows_of_patches, study
from ..rolling.table import creep_table, write_creep_table
from ..rolling.wearing import Wearing, wearing
from .answer import RollJob, Written, answered
from .job import Job, open_job
from .modal import modes_stage
from .places import find_body
from .stage import Report, Stage


def rolling_stage(job: RollJob) -> Written:
    """What a rolling case asks for.

    Raises:
        UserError: mistakes of the case or its profiles.
    """
    case, raw = load_rolling(job.path, list(job.assignments))
    stage = job.stage(case.name, "rolling", "stages.rolling")
    bodies = _bodies(case, job.path, job.report)
    inputs = job.inputs(raw, [*case.files, *(body.resolve() for body in bodies)])
    return answered(stage, inputs, lambda: _work(stage, case, job, bodies))


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
def _of_one_material(case_path: Path, key: str, job: Job, section: Section) -> None:
    """A body and the half-space that stands for its contact, of which one is taken out and the other put in."""
    own = [getattr(job.settings.material, name, None) for name in ("young", "poisson")]
    asked = [section.young, section.poisson]
    if None not in own and own != asked:
        raise UserError(
            f"{key}.young, {key}.poisson: {asked} in the case and {own} in {job.path}; with [elastic] "
            "they must be the same, correct one"
        )


def _work(stage: Stage, case: RollingCase, job: RollJob, bodies: list[Path]) -> Written:
    folder = stage.product.parent
    stage.report("patches and creep curve")
    with of_file(job.path):
        found = study(case, job.path)
        elastic = _behind(found, bodies)
        contacts = _contacts(stage, found)
        worn = _wearing(stage, found, job.path)
    stage.begin()
    made = _tables(found, folder)
    beside, more = _beside(stage, found, elastic, contacts)
    if worn is not None:
        beside += _worn_tables(worn, folder)
        more += [worn.sentence(), *worn.warnings()]
    drawn = []
    if job.pictures and found.forces is not None:
        drawn = _pictures(found, worn, folder / "pictures", case.name)
    page = folder / "rolling.html"
    shown = [p for p in drawn if p.suffix == ".png"]
    store.write_text(page, rolling_html(f"{case.name}: rolling contact", found, shown, more))
    return Written([page, *made, *beside, *drawn], [*found.sentences(), *more])


def _beside(
    stage: Stage, found: Studied, elastic: Behind | None, contacts: ContactTable | None
) -> tuple[list[Path], list[str]]:
    """Files of what is asked beside the curve, and what is said of them."""
    folder, case, made, more = stage.product.parent, found.case, [], []
    if elastic is not None:
        made += write_tables(folder, {"stiffness.csv": {"direction": ROWS, **elastic.columns()}}, 8)
        more.append(elastic.sentence())
    if case.table is not None:
        stage.report("table of creep forces")
        how = case.model.model_dump(include={"distribution", "coefficients"})
        table = creep_table(found.track.elastic.poisson, **case.table.model_dump(), **how)
        made.append(write_creep_table(folder / "creep_table.h5", table))
        more.append(table.sentence())
    if contacts is not None:
        made.append(write_contact_table(folder / "contact_table.h5", contacts))
        more.append(contacts.sentence())
    return made, more


def _behind(found: Studied, bodies: list[Path]) -> Behind | None:
    elastic = found.case.elastic
    if elastic is None or not found.patches:
        return None
    files = [read_basis(file) for file in bodies]
    groups, methods = [b.groups[0, 0] for b in files], [b.reduction for b in files]
    return behind(found.patches[0], found.case.solids, groups, elastic.face, methods)


def _contacts(stage: Stage, found: Studied) -> ContactTable | None:
    asked = found.case.contacts
    if asked is None:
        return None
    return contact_table(found.track, found.case.vertical_force, **asked.model_dump(), report=stage.report)


def _wearing(stage: Stage, found: Studied, path: Path) -> Wearing | None:
    if found.case.wear is None or not found.case.wear.updates:
        return None
    return wearing(found.case, found.track, found.case.characteristic(path), found.case.surface(path), stage.report)


def _worn_tables(worn: Wearing, folder: Path) -> list[Path]:
    """Over the passages, and both profiles as tables in mm that a case takes."""
    tables = {"wearing.csv": worn.columns()}
    tables |= {f"{name}_worn.csv": getattr(worn, name).columns(worn.smoothing) for name in ("wheel", "rail")}
    return write_tables(folder, tables, 10)


def _tables(found: Studied, folder: Path) -> list[Path]:
    head, rows = rows_of_patches(found.patches)
    store.write_text(folder / "patches.csv", rows_csv(head, rows))
    if found.forces is None:
        return [folder / "patches.csv"]
    made = {"creep.csv": found.columns(), "exact.csv": found.beside(), "wear.csv": found.worn()}
    written = write_tables(folder, made, 8)
    head, rows = found.generalised()
    store.write_text(folder / "forces.csv", rows_csv(head, rows))
    return [*written, folder / "patches.csv", folder / "forces.csv"]


def _pictures(found: Studied, worn: Wearing | None, folder: Path, name: str) -> list[Path]:
    from ..pictures.rolling import curve_picture, traction_picture, wearing_picture, write_tractions_vtu

    drawn = [
        curve_picture(found, folder / "creep.png", f"{name}: creep curve"),
        traction_picture(found, folder / "tractions.png", name),
    ]
    if worn is not None:
        drawn.append(wearing_picture(worn, folder / "wearing.png", name))
    if found.tractions is not None and find_spec("meshio"):
        drawn.append(folder.parent / "tractions.vtu")
        write_tractions_vtu(found.tractions, drawn[-1])
    return drawn

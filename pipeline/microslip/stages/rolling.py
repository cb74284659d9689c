"""Rolling contact of a case: patches and creep curve as tables, pictures and a page."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from ..contact.friction import OfTable
from ..errors import told_of
from ..files import store
from ..files.tables import columns_csv, rows_csv
from ..report.rolling import rolling_html
from ..rolling.contact_table import contact_table, write_contact_table
from ..rolling.settings import RollingCase, load_rolling
from ..rolling.study import Studied, rows_of_patches, study
from ..rolling.table import creep_table, write_creep_table
from .answer import Answer, answered
from .stage import Report, Stage


def rolling_stage(
    case_path: Path, root: Path = Path("build"), assignments: list[str] | None = None, force: bool = False,
    report: Report = lambda _: None, pictures: bool = True,
) -> Answer:  # fmt: skip
    """What a rolling case asks for, in ``root/NAME``.

    Raises:
        UserError: mistakes of the case or its profiles.
    """
    case, raw = load_rolling(case_path, assignments)
    stage = Stage(root / case.name / "rolling.json", ("stages.rolling",), force, report)
    files = [case_path.parent / s.profile for s in (case.wheel, case.rail) if isinstance(s.profile, str)]
    files += [case_path.parent / case.friction.file] if isinstance(case.friction, OfTable) else []
    profiles = [store.hash_file(file) for file in files if file.is_file()]
    inputs = {"case": raw, "profiles": profiles, "pictures": pictures}
    return answered(stage, inputs, lambda: _work(stage, case, case_path, pictures))


def _work(stage: Stage, case: RollingCase, case_path: Path, pictures: bool) -> Answer:
    folder = stage.product.parent
    stage.report("patches and creep curve")
    with told_of(case_path):
        found, contacts = study(case, case_path.parent), None
        if case.contacts is not None:
            stage.report("table of contacts")
            contacts = contact_table(found.track, case.vertical_force, **case.contacts.model_dump())
    stage.begin()
    sentences = found.sentences()
    made = _tables(found, folder)
    if case.table is not None:
        stage.report("table of creep forces")
        how = case.model.model_dump(include={"distribution", "coefficients"})
        table = creep_table(found.track.elastic.poisson, **case.table.model_dump(), **how)
        made.append(write_creep_table(folder / "creep_table.h5", table))
        sentences.append(
            f"Between the points of the table forces are off by {100 * table.error[:, 0].max():.2g} % of mu F_N in the "
            f"mean; 95 % of {table.checked} states are below {100 * table.error[:, 1].max():.2g} %, the largest "
            f"error is {100 * table.error[:, 2].max():.2g} %."
        )
    if contacts is not None:
        made.append(write_contact_table(folder / "contact_table.h5", contacts))
        sentences.append(contacts.sentence())
    drawn = _pictures(found, folder / "pictures", case.name) if pictures and found.forces is not None else []
    page = folder / "rolling.html"
    store.write_text(
        page, rolling_html(f"{case.name}: rolling contact", found, [p for p in drawn if p.suffix == ".png"])
    )
    return Answer([page, *made, *drawn], sentences)


def _tables(found: Studied, folder: Path) -> list[Path]:
    head, rows = rows_of_patches(found.patches)
    store.write_text(folder / "patches.csv", rows_csv(head, ([f"{v:.8g}" for v in row] for row in rows)))
    if found.forces is None:
        return [folder / "patches.csv"]
    made = {"creep.csv": found.columns(), "exact.csv": found.beside(), "wear.csv": found.worn()}
    for name, columns in made.items():
        if columns:
            store.write_text(folder / name, columns_csv(columns, 8))
    head, generalised = found.generalised()
    cells = ([v if isinstance(v, str) else f"{v:.8g}" for v in row] for row in generalised)
    store.write_text(folder / "forces.csv", rows_csv(head, cells))
    written = [name for name, columns in made.items() if columns]
    return [folder / name for name in (*written, "patches.csv", "forces.csv")]


def _pictures(found: Studied, folder: Path, name: str) -> list[Path]:
    from ..pictures.rolling import curve_picture, traction_picture, write_tractions_vtu

    drawn = [
        curve_picture(found, folder / "creep.png", f"{name}: creep curve"),
        traction_picture(found, folder / "tractions.png", name),
    ]
    if found.tractions is not None and find_spec("meshio"):
        drawn.append(folder.parent / "tractions.vtu")
        write_tractions_vtu(found.tractions, drawn[-1])
    return drawn

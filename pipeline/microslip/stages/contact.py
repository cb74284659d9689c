"""What a contact law does: tables and pictures."""

from __future__ import annotations

from pathlib import Path

from ..files import store
from ..files.tables import rows_csv, write_tables
from .answer import Written
from .stage import Made, Report, Stage


def contact_stage(
    path: Path, assignments: list[str], output: Path | None, report: Report = lambda _: None
) -> Written:
    """What a contact law does: tables (CSV) and pictures (PNG) in build/<name>/ or `output`.

    Returns:
        The short table and judgements; files.

    Raises:
        UserError, NotConverged: see `contact.study.study`; then nothing is written.
    """
    from ..contact.study import study
    from ..pictures.contact import draw

    report("laws and motions")
    found = study(path, assignments)
    folder = output or Path("build") / found.contact.file.name
    summary = folder / "summary.csv"
    rows = [*found.told, *(("judgement", s) for s in found.sentences)]
    report("pictures and tables")

    def work() -> Made:
        named = {f"{name}.csv": columns for name, columns in found.written.items()}
        files.extend([*write_tables(folder, named, 10), *draw(found, folder)])
        store.write_text(summary, rows_csv(("what", "value"), rows))
        return Made(files)

    files, origin = list[Path](), None if output else path
    Stage(summary, ("contact.study",), True, report, origin).make({}, work)
    width = max(len(what) for what, _ in found.told)
    lines = [f"{what:{width}}  {value}" for what, value in found.told]
    return Written(sorted([*files, summary]), [*lines, *found.sentences])

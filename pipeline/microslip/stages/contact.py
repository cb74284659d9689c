"""What a contact law does: tables and pictures."""

from __future__ import annotations

from pathlib import Path

from ..files import store
from ..files.tables import rows_csv, write_tables
from .stage import Report


def contact_stage(
    path: Path, assignments: list[str], output: Path | None, report: Report = lambda _: None
) -> list[str]:
    """What a contact law does: tables (CSV) and pictures (PNG) in build/<name>/ or `output`.

    Returns:
        Lines to print: the short table, judgements, files.

    Raises:
        UserError, NotConverged: see `contact.study.study`; then nothing is written.
    """
    from ..contact.study import study
    from ..pictures.contact import draw

    path = path / "contact.toml" if path.is_dir() else path
    report("laws and motions")
    found = study(path, assignments)
    folder = output or Path("build") / found.contact.file.name
    summary = folder / "summary.csv"
    rows = [*found.told, *(("judgement", s) for s in found.sentences)]
    report("pictures and tables")
    with store.making(summary, report):
        tables = write_tables(folder, {f"{name}.csv": columns for name, columns in found.tables.items()}, 10)
        files = [*draw(found, folder), *tables, summary]
        store.write_text(summary, rows_csv(("what", "value"), rows))
    width = max(len(what) for what, _ in found.told)
    lines = [f"{what:{width}}  {value}" for what, value in found.told]
    return [*lines, *found.sentences, *map(str, sorted(files))]

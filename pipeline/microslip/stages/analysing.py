"""Any analysis of a case, from its files to tables, files, diagrams and a page; see `microslip.analysis`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from .. import analysis
from ..analysis import Analysis, Answer, Drawing, Question
from ..case import headline
from ..errors import UserError
from ..files import store
from ..files.tables import columns_csv
from ..pictures.plots import empty_figure, save_figure
from ..report.page import answer_page
from ..results import open_journal
from ..settings.mistakes import validate
from .answer import CaseJob, Written
from .stage import Stage
from .varied import Varied


def analysed(name: str, case: CaseJob) -> Written:
    """The answer to what a case asks for in the table of an analysis, made where it is not up to date.

    Raises:
        UserError: the case asks for nothing, or for what cannot be.
    """
    one = analysis.analyses()[name]
    asked = case.settings.asked.get(name)
    if asked is None and one.needed:
        table = f"[[{name}]]" if one.several else f"[{name}]"
        raise UserError(f"is missing; add {table} with {one.needed}", name, case.path)
    asked = validate(one.asks, {}, case.path) if asked is None else asked
    file = analysis.file_of(name)
    return case.answer(name, file, partial(_work, one, asked))


def _work(one: Analysis, asked: Any, stage: Stage, case: CaseJob) -> Written:
    """Finished points stay in a journal until all that is made of them is there."""
    points, built = case.folder / f"{one.name}.points", case.built()
    inputs, head = case.made_by(stage), {"case": case.settings.name}
    varied = Varied(case.path, case.raw, case.bases)
    own = case.made_by(stage, one.name)
    with open_journal(points, inputs, head, case.force) as journal:
        question = Question(asked, built, journal, case.report, varied, case.folder, own, case.force)
        try:
            answer = one.solve(question)
        except UserError as error:
            if not journal.series:
                points.unlink()
            if error.file is None:
                error.key = ".".join(filter(None, (one.name, error.key)))
            raise
    stage.begin()
    title = f"{case.settings.name}: {one.name.replace('_', ' ')}"
    if answer.largest is not None:
        of_case = [*built.messages, *headline.doubted(built, answer.largest)]
        answer = replace(answer, sentences=[*answer.sentences, *of_case])
    return written(answer, one.name, case.folder, title, case.pictures, case.settings.name)


def written(answer: Answer, name: str, folder: Path, title: str, pictures: bool, case: str = "") -> Written:
    """The files of an answer, the page first, and what is said of them.

    Args:
        name: begins those that have no name of their own. case: begins the titles of diagrams.
    """
    made, moving, begins = _data(name, answer, folder), list[Path](), "pictures/"
    pictured = [file for file in answer.files if file.startswith(begins) and pictures]
    for file, write in answer.files.items():
        if file in pictured or not file.startswith(begins):
            write(folder / file)
    made += [folder / file for file in answer.files if not file.startswith(begins)]
    shown = [folder / file for file in pictured]
    if pictures:
        shown += [drawn(d, folder / f"{begins}{_named(name, end)}.png", case) for end, d in answer.diagrams.items()]
        moving = list(answer.moving(folder))
    shown += [path for path in moving if path.suffix == ".gif"]
    page = folder / f"{name}.html"
    store.write_text(page, answer_page(title, answer.sentences, shown, *answer.tables))
    files = [page, *made, *dict.fromkeys([*shown, *moving])]
    return Written(files, [*answer.lines, *answer.sentences], answer.whole)


def _named(name: str, end: str) -> str:
    return f"{name}_{end}" if end else name


def _data(name: str, answer: Answer, folder: Path) -> list[Path]:
    """A table and a file of each."""
    files = []
    for end, data in answer.data.items():
        stem = folder / _named(name, end)
        store.write_text(stem.with_suffix(".csv"), columns_csv(data.columns(), 10))
        files += [stem.with_suffix(".csv"), data.save(stem.with_suffix(".h5"))]
    return files


def drawn(diagram: Drawing, path: Path, case: str = "") -> Path:
    """A diagram as a PNG, the name of its case before its title."""
    figure = empty_figure(*diagram.size)
    diagram.draw(figure)
    if title := ": ".join(filter(None, (case, diagram.title))):
        figure.suptitle(title)
    return save_figure(figure, path)

"""Any analysis of a case, from its files to tables, files, diagrams and a page; see `microslip.analysis`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from .. import analysis
from ..analysis import Analysis, Answer, Drawing, Question
from ..case import headline
from ..errors import UserError, at
from ..files import store
from ..files.tables import columns_csv
from ..pictures.plots import empty_figure, save_figure
from ..report.page import answer_page
from ..results import open_journal
from ..settings.mistakes import validate
from .answer import CaseJob, Written
from .stage import Stage


def analysed(name: str, case: CaseJob) -> Written:
    """The answer to what a case asks for in the table of an analysis, made where it is not up to date.

    Raises:
        UserError: the case asks for nothing, or for what cannot be.
    """
    one = analysis.analyses()[name]
    asked = case.settings.asked.get(name)
    if asked is None and one.needed:
        raise UserError(f"is missing; add [{name}] with {one.needed}", name, case.path)
    asked = validate(one.asks, {}, case.path) if asked is None else asked
    file = analysis.file_of(name)
    return case.answer(name, file, partial(_work, one, asked))


def _work(one: Analysis, asked: Any, stage: Stage, case: CaseJob) -> Written:
    """Finished points stay in a journal until all that is made of them is there."""
    points, built = case.folder / f"{one.name}.points", case.built()
    inputs, head = case.made_by(stage), {"case": case.settings.name}
    with at(one.name), open_journal(points, inputs, head, case.force) as journal:
        try:
            answer = one.solve(Question(asked, built, journal, case.report))
        except UserError:
            if not journal.series:
                points.unlink()
            raise
    stage.begin()
    doubts = headline.doubted(built, answer.largest)
    sentences = [*answer.sentences, *built.messages, *doubts]
    pictures = _drawn(one.name, answer, case) if case.pictures else []
    page = case.folder / f"{one.name}.html"
    title = f"{case.settings.name}: {one.name.replace('_', ' ')}"
    store.write_text(page, answer_page(title, sentences, pictures, *answer.tables))
    return Written([page, *_data(one.name, answer, case.folder), *pictures], sentences, answer.whole)


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


def _drawn(name: str, answer: Answer, case: CaseJob) -> list[Path]:
    folder = case.folder / "pictures"
    return [drawn(d, folder / f"{_named(name, end)}.png", case.settings.name) for end, d in answer.diagrams.items()]


def drawn(diagram: Drawing, path: Path, case: str = "") -> Path:
    """A diagram as a PNG, the name of its case before its title."""
    figure = empty_figure(*diagram.size)
    diagram.draw(figure)
    if title := ": ".join(filter(None, (case, diagram.title))):
        figure.suptitle(title)
    return save_figure(figure, path)

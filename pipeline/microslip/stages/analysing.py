"""Any analysis of a case, from its files to tables, files, diagrams and a page; see `microslip.analysis`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from .. import analysis
from ..analysis import Analysis, Question
from ..case import headline
from ..errors import UserError
from ..settings.mistakes import validate
from .answer import CaseJob, Written, kept, written
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
    built, varied = case.built(), Varied(case.path, case.raw, case.bases)
    own, head = case.made_by(stage, one.name), {"case": case.settings.name}
    with kept(stage, case.made_by(stage), head) as journal:
        question = Question(asked, built, journal, case.report, varied, case.folder, own, case.force)
        try:
            answer = one.solve(question)
        except UserError as error:
            if error.file is None:
                error.key = ".".join(filter(None, (one.name, error.key)))
            raise
    stage.begin()
    title = f"{case.settings.name}: {one.name.replace('_', ' ')}"
    if answer.largest is not None:
        of_case = [*built.messages, *headline.doubted(built, answer.largest)]
        answer = replace(answer, sentences=[*answer.sentences, *of_case])
    return written(answer, one.name, case.folder, title, case.pictures, case.settings.name)

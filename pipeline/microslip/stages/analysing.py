"""Any analysis of a case, from its files to tables, files, diagrams and a page; see `microslip.analysis`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from .. import analysis
from ..analysis import Analysis, Answer, Question
from ..case import headline
from ..errors import UserError, of_file
from ..files import store
from ..results import Journal
from ..settings.mistakes import validate
from .answer import CaseJob, Written, made
from .stage import Stage, hash_of_code
from .varied import Varied


def analysed(name: str, case: CaseJob) -> Written:
    """The answer to what a case asks for in the table of an analysis, made where it is not up to date.

    Raises:
        UserError: the case asks for nothing, or for what cannot be.
    """
    one = analysis.analyses()[name]
    case = replace(case, swept=one.swept)
    asked = case.settings.asked.get(name)
    if asked is None and one.needed:
        table = f"[[{name}]]" if one.several else f"[{name}]"
        raise UserError(f"is missing; add {table} with {one.needed}", name, case.path)
    asked = validate(one.asks, {}, case.path) if asked is None else asked
    code, called = (analysis.file_of(name),), case.settings.name
    stage = Stage(case.folder / f"{name}.json", code, case.force, case.report, case=case.path)
    solve, title = partial(_answer, one, asked, stage, case), f"{called}: {name.replace('_', ' ')}"
    with of_file(case.path):
        return made(stage, case.inputs, title, case.pictures, solve, called)


def _answer(one: Analysis, asked: Any, stage: Stage, case: CaseJob, journal: Journal) -> Answer:
    built, varied = case.built(), Varied(case.path, case.raw, case.bases)
    others = {key: value for key, value in case.inputs["case"].items() if key != one.name}
    inputs = {**case.inputs, "case": others, "code": hash_of_code(stage.code)}
    own = store.hash_settings(inputs)
    try:
        answer = one.solve(Question(asked, built, journal, case.report, varied, case.folder, own, case.force))
    except UserError as error:
        if error.file is None:
            error.key = ".".join(filter(None, (one.name, error.key)))
        raise
    if answer.largest is None:
        return answer
    of_case = [*built.messages, *headline.doubted(built, answer.largest)]
    return replace(answer, sentences=[*answer.sentences, *of_case])

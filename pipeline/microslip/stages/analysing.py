"""Any analysis of a case, from its files to tables, files, diagrams and a page; see `microslip.analysis`."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from .. import analysis
from ..analysis import Analysis, Answer, Question
from ..case import headline
from ..errors import UserError, of_file
from ..files import store
from ..results import Journal, open_journal
from ..settings.meant import case_file
from ..settings.mistakes import validate
from .answer import CaseJob, Written, case_job, depends, made
from .stage import Report, Stage, hash_of_code
from .varied import Varied


def analysed(name: str, case: CaseJob) -> Written:
    """The answer to what a case asks for in the table of an analysis, made where it is not up to date.

    Raises:
        UserError: the case asks for nothing, or for what cannot be.
    """
    case, stage, solve = _asked(name, case)
    called = case.settings.name
    with of_file(case.path):
        return made(stage, case.inputs, f"{called}: {name.replace('_', ' ')}", case.pictures, solve, called)


def analyse(
    name: str, case: Path | str, basis: Path | None = None, /, *, folder: Path | str | None = None,
    assignments: Sequence[str] = (), report: Report = lambda _: None, **keys: Any,
) -> Answer:  # fmt: skip
    """What an analysis of a case answers, without pages, tables and pictures.

    Args:
        name: of its verb or its table, "ring-down", "two_tones". case: a case.toml or its folder, the name of a
            case, or "sample". basis: modal file of its only body; looked for, and made, as `microslip run` does if
            not given.
        folder: keeps what is finished, so that an interrupted call goes on. assignments: keys of the case that
            have other values, as ``--set`` has them. keys: of the analysis, likewise.

    Returns:
        Its ``sentences``, the result first; ``data``, datasets by their names ("" the first), each with ``to_xarray``,
        ``to_dataframe`` and ``save``; ``diagrams``.

    Raises:
        UserError: no analysis of this name; the case asks for nothing, or for what cannot be.

    Examples:
        >>> import microslip as ms
        >>> answer = ms.analyse("map", "sample", low=20.0, high=60.0, forces=3)  # doctest: +SKIP
        >>> answer.data[""]["frequency"]  # Hz, of the highest resonance under each normal force  # doctest: +SKIP
    """
    verbs = {analysis.verb_of(name).name: name for name in analysis.places()}
    table = verbs.get(name, name)
    if table not in verbs.values():
        raise UserError(f"there is no analysis '{name}'; there are {', '.join(sorted(verbs))}", "name")
    more = [f"{table}.{key}={json.dumps(value)}" for key, value in keys.items()]
    own = case_job(case_file(Path(case)), basis, [*assignments, *more], report=report)
    with tempfile.TemporaryDirectory() as made_up:
        own, stage, solve = _asked(table, replace(own, folder=Path(folder or made_up)))
        kept = stage.product.with_suffix(".points")
        with of_file(own.path), open_journal(kept, depends(stage, own.inputs), {}) as journal:
            return solve(journal)


def _asked(name: str, case: CaseJob) -> tuple[CaseJob, Stage, Callable[[Journal], Answer]]:
    """The case as an analysis takes it, the stage of its product, and what solves it."""
    one = analysis.analyses()[name]
    case = replace(case, swept=one.swept)
    asked = case.settings.asked.get(name)
    if asked is None and one.needed:
        table = f"[[{name}]]" if one.several else f"[{name}]"
        raise UserError(f"is missing; add {table} with {one.needed}", name, case.path)
    asked = validate(one.asks, {}, case.path) if asked is None else asked
    stage = Stage(case.folder / f"{name}.json", (analysis.file_of(name),), case.force, case.report, case=case.path)
    return case, stage, partial(_answer, one, asked, stage, case)


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

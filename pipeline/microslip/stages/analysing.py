"""Any analysis of a case, from its files to tables, files, diagrams and a page, see
`microslip.analysis`; a case with other values of its keys, and its bodies as they are meshed."""

from __future__ import annotations

import copy
import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from .. import analysis
from ..analysis import Analysis, Answer, Question
from ..case import headline
from ..case.assemble import Built, build
from ..case.settings import case_model
from ..data import Mesh, ModalBasis
from ..errors import UserError, at, of_file
from ..files import store
from ..results import Journal, open_journal
from ..settings.body import BodySettings
from ..settings.meant import case_file
from ..settings.mistakes import validate
from ..settings.toml import override
from ..system.assembly import Assembly
from ..system.settings import load_system
from .answer import CaseJob, Written, case_job, depends, made
from .job import open_job
from .meshing import load_mesh, mesh_stage
from .places import find_body, lumped
from .stage import Report, Stage, hash_of_code


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
    tables = {analysis.verb_of(table).name: table for table in analysis.places()}
    table = tables.get(name, name)
    if table not in tables.values():
        raise UserError(f"there is no analysis '{name}'; there are {', '.join(sorted(tables))}", "name")
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
    of_case = [*built.messages, *headline.doubted(built, answer.largest, **answer.judged)]
    return replace(answer, sentences=[*answer.sentences, *of_case])


OF_SYSTEM = "system."
"""Begins keys that are those of a system.toml and not of the case."""


@dataclass(frozen=True)
class Varied:
    """A case. Attributes: path. raw: its text as a table. bases: body -> modal basis."""

    path: Path
    raw: Mapping[str, Any]
    bases: Mapping[str, ModalBasis]

    def under(self, values: Mapping[str, float], where: str) -> Assembly:
        """The assembly of `built`."""
        return self.built(values, where).assembly

    def built(self, values: Mapping[str, float], where: str) -> Built:
        """The case with other values of keys, dotted. where: the key that says so, for messages.

        Raises:
            UserError: a key that is none of the case or the system.
        """
        raw: dict[str, Any] = copy.deepcopy(dict(self.raw))
        own = [f"{k}={v!r}" for k, v in values.items() if not k.startswith(OF_SYSTEM)]
        others = [
            f"{k.removeprefix(OF_SYSTEM)}={v!r}"
            for k, v in values.items()
            if k.startswith(OF_SYSTEM)
        ]
        with at(where, self.path), of_file(self.path):
            settings = validate(case_model(), override(raw, own, self.path, ""), self.path)
            return build(settings, self._systems(others) if others else self.bases)

    def meshed(self, name: str, where: str) -> tuple[Mesh, BodySettings]:
        """The mesh of a body, in metres, and its settings. where: the key that asks for it.

        Raises:
            UserError: it has none.
        """
        job = None if lumped(self.path, name) else open_job(find_body(self.path, name, Path(".")))
        if job is None or job.settings.geometry.matrices is not None:
            raise UserError(
                f"'{name}' has no mesh, so there is nothing unreduced; leave full out",
                where,
                self.path,
            )
        return load_mesh(job, mesh_stage(job))[0], job.settings

    def _systems(self, assignments: list[str]) -> dict[str, ModalBasis]:
        found = dict(self.bases)
        made = {name: lumped(self.path, basis.name) for name, basis in self.bases.items()}
        for name, file in made.items():
            if file is not None:
                found[name] = load_system(file, assignments).basis()
        if not any(made.values()):
            raise UserError(
                f"'{OF_SYSTEM}' names a key of a system.toml, but no body of this case has one"
            )
        return found

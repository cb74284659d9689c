"""A case on its way to an answer, and what an answer is: files, and what is said of them."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from ..analysis import Answer, Drawing
from ..basis import read_basis
from ..case import CaseSettings, load_case
from ..case.assemble import Built, build
from ..data import ModalBasis
from ..errors import UserError, in_its_file, of_file
from ..files import store
from ..files.tables import columns_csv
from ..pictures.plots import empty_figure, save_figure
from ..report.page import answer_page
from ..results import Journal, open_journal
from .checkpoint import inputs_of
from .stage import Made, Report, Stage, folder_of_case, hash_of_code


class Written(NamedTuple):
    """What a stage leaves for a reader.

    Attributes:
        files: the page first. said: sentences, and lines of a table. whole: whether nothing of it was lost. missing:
            what, in words.
    """

    files: Sequence[Path]
    said: Sequence[str]
    whole: bool = True
    missing: str = ""


def answered(stage: Stage, inputs: Mapping[str, Any], work: Callable[[], Written]) -> Written:
    """The answer that a stage's product (JSON) holds, made where it is not up to date; see `Stage.make`. What
    `work` keeps in ``NAME.points`` until then is removed."""
    folder = stage.product.parent

    def make() -> Made:
        found = work()
        names = [str(path.relative_to(folder)) for path in found.files]
        told = {"files": names, "said": list(found.said), "whole": bool(found.whole)}
        told |= {"missing": found.missing}
        store.write_json(stage.product, told)
        return Made(found.files)

    stage.make(inputs, make)
    points_of(stage).unlink(missing_ok=True)
    told = json.loads(stage.product.read_text())
    return Written([folder / name for name in told["files"]], told["said"], told["whole"], told["missing"])


def points_of(stage: Stage) -> Path:
    """The journal of what is finished, until all that is made of it is there."""
    return stage.product.with_suffix(".points")


@contextlib.contextmanager
def kept(stage: Stage, inputs: str, head: Mapping[str, Any]) -> Iterator[Journal]:
    """That journal, opened; gone where a mistake is told before anything is finished. inputs, head:
    see `results.open_journal`."""
    with open_journal(points_of(stage), inputs, head, stage.force) as journal:
        try:
            yield journal
        except UserError:
            if not journal.series:
                points_of(stage).unlink()
            raise


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
    whole = answer.whole and not answer.missing
    return Written(files, [*answer.lines, *answer.sentences], whole, answer.missing)


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


@dataclass(frozen=True)
class CaseJob:
    """One case on its way to an answer.

    Attributes:
        path: the case file. files: body of the case -> its modal file. folder: of the answer. assignments: keys that
            have other values. force, report: see `Stage`. pictures: whether they are wanted.
    """

    path: Path
    files: Mapping[str, Path]
    folder: Path
    assignments: Sequence[str] = ()
    force: bool = False
    report: Report = lambda _: None
    pictures: bool = True

    @cached_property
    def _loaded(self) -> tuple[CaseSettings, dict[str, Any]]:
        return load_case(self.path, list(self.assignments))

    @property
    def settings(self) -> CaseSettings:
        return self._loaded[0]

    @property
    def raw(self) -> dict[str, Any]:
        """The case as a table."""
        return self._loaded[1]

    @cached_property
    def bases(self) -> dict[str, ModalBasis]:
        """Body of the case -> its modal basis."""
        return {name: read_basis(file) for name, file in self.files.items()}

    def built(self) -> Built:
        """The case's assembly."""
        return build(self.settings, self.bases)

    @cached_property
    def inputs(self) -> dict[str, Any]:
        """What the answer depends on, besides pictures."""
        return inputs_of(self.raw, self.settings, self.files)

    def made_by(self, stage: Stage, but: str = "") -> str:
        """Hash of what all that is computed depends on, but a table of the case."""
        case = {key: value for key, value in self.inputs["case"].items() if key != but}
        return store.hash_settings({**self.inputs, "case": case, "code": hash_of_code(stage.code)})

    @in_its_file
    def answer(self, name: str, module: str | Path, work: Callable[[Stage, CaseJob], Written]) -> Written:
        """The answer that ``name.json`` holds, made by a module's `work` where it is not up to date."""
        product = self.folder / f"{name}.json"
        stage = Stage(product, (module,), self.force, self.report, case=self.path)
        return answered(stage, {**self.inputs, "pictures": self.pictures}, lambda: work(stage, self))


@dataclass(frozen=True)
class RollJob:
    """One case of rolling contact on its way to an answer.

    Attributes:
        path: the case file. root: where the folder of its name is made. Others: see `CaseJob`.
    """

    path: Path
    root: Path = Path("build")
    assignments: Sequence[str] = ()
    force: bool = False
    report: Report = lambda _: None
    pictures: bool = True

    def answer(
        self, case: str, name: str, module: str, raw: Mapping[str, Any], files: Iterable[Path | str],
        title: str, solve: Callable[[Journal, Report], Answer],
    ) -> Written:  # fmt: skip
        """The answer that ``name.json`` holds, made where it is not up to date.

        Args:
            case: its name. raw: it as a table. files: that it names; what is missing is told where
                it is read. title: of the page.
        """
        product = folder_of_case(self.path, case, self.root) / f"{name}.json"
        stage = Stage(product, (module,), self.force, self.report, case=self.path)
        there = [file for f in files if (file := self.path.parent / f).is_file()]
        inputs = {"case": raw, "files": [store.hash_file(file) for file in there]}
        own = store.hash_settings({**inputs, "code": hash_of_code(stage.code)})

        def work() -> Written:
            with of_file(self.path), kept(stage, own, {"case": case}) as journal:
                answer = solve(journal, self.report)
            stage.begin()
            return written(answer, name, product.parent, f"{case}: {title}", self.pictures)

        return answered(stage, {**inputs, "pictures": self.pictures}, work)

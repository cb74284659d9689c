"""A case on its way to an answer, and what an answer is: files, and what is said of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from ..analysis import Answer, Drawing
from ..basis import read_basis
from ..case import CaseSettings, checkpoint, load_case
from ..case.assemble import Built, build
from ..data import ModalBasis
from ..errors import UserError
from ..files import store
from ..files.png import BESIDE
from ..files.tables import columns_csv
from ..pictures.plots import empty_figure, save, save_figure
from ..report.page import answer_page
from ..results import Journal, open_journal
from .checkpoint import inputs_of
from .places import existing_files, modal_files
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
    """What a stage's product (JSON) holds of an answer, made where it is not up to date; see `Stage.make`."""
    folder = stage.product.parent

    def make() -> Made:
        found = work()
        names = [str(path.relative_to(folder)) for path in found.files]
        told = {"files": names, "said": list(found.said), "whole": bool(found.whole)}
        store.write_json(stage.product, {**told, "missing": found.missing})
        return Made(found.files)

    stage.make(inputs, make)
    told = json.loads(stage.product.read_text())
    return Written([folder / name for name in told["files"]], told["said"], told["whole"], told["missing"])


def made(
    stage: Stage, inputs: Mapping[str, Any], title: str, pictures: bool, solve: Callable[[Journal], Answer],
    case: str = "",
) -> Written:  # fmt: skip
    """The answer that a stage's product (JSON) holds, solved where it is not up to date. What is finished stays in a
    journal, ``NAME.points``, until all that is made of it is there.

    Args:
        inputs: what it depends on, besides pictures. title: of the page. case: begins the titles of diagrams.
    """
    points = stage.product.with_suffix(".points")

    def work() -> Written:
        with open_journal(points, depends(stage, inputs), {"case": case}, stage.force) as journal:
            try:
                answer = solve(journal)
            except UserError:
                if not journal.series:
                    points.unlink()
                raise
        stage.begin()
        return written(answer, stage.product.stem, stage.product.parent, title, pictures, case)

    found = answered(stage, {**inputs, "pictures": pictures and (BESIDE.get() or True)}, work)
    points.unlink(missing_ok=True)
    return found


def depends(stage: Stage, inputs: Mapping[str, Any]) -> str:
    """Hash of all that the finished parts of an answer depend on."""
    return store.hash_settings({**inputs, "code": hash_of_code(stage.code)})


def written(answer: Answer, name: str, folder: Path, title: str, pictures: bool, case: str = "") -> Written:
    """The files of an answer, the page first, and what is said of them.

    Args:
        name: begins those that have no name of their own. case: begins the titles of diagrams.
    """
    wanted = {file: write for file, write in answer.files.items() if pictures or not file.endswith(".png")}
    for file, write in wanted.items():
        save(write, folder / file) if file.endswith(".png") else write(folder / file)
    shown = [folder / file for file in wanted if file.endswith(".png")]
    made = [*_data(name, answer, folder), *(folder / file for file in wanted if not file.endswith(".png"))]
    moving: Sequence[Path] = ()
    if pictures:
        places = {folder / "pictures" / f"{_named(name, end)}.png": d for end, d in answer.diagrams.items()}
        shown += [drawn(diagram, place, case) for place, diagram in places.items()]
        moving = answer.moving(folder)
    shown += [path for path in moving if path.suffix in (".gif", ".png")]
    page = folder / f"{name}.html"
    store.write_text(page, answer_page(title, answer.sentences, shown, *answer.tables))
    whole = answer.whole and not answer.missing
    return Written(
        [page, *made, *dict.fromkeys([*shown, *moving])], [*answer.lines, *answer.sentences], whole, answer.missing
    )


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
            have other values. force, report: see `Stage`. pictures: whether they are wanted. swept: whether it takes as
            many harmonics as the response has, where their number follows from its error.
    """

    path: Path
    files: Mapping[str, Path]
    folder: Path
    assignments: Sequence[str] = ()
    force: bool = False
    report: Report = lambda _: None
    pictures: bool = True
    swept: bool = False

    @cached_property
    def _loaded(self) -> tuple[CaseSettings, dict[str, Any]]:
        settings, raw = load_case(self.path, list(self.assignments))
        return checkpoint.followed(settings, raw, self.folder) if self.swept else (settings, raw)

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


def case_job(
    case: Path, basis: Path | None = None, assignments: Sequence[str] = (), force: bool = False,
    report: Report = lambda _: None, pictures: bool = True, root: Path = Path("."), make: bool = True,
) -> CaseJob:  # fmt: skip
    """A case on its way. basis: of its only body; if not given its modal files are made where they are not up to date,
    or, unless `make`, have to be there. root: where paths begin."""
    settings, _ = load_case(case, list(assignments))
    folder = folder_of_case(case, settings.name, root / "build")
    made = make and basis is None
    files = modal_files(settings, root, report) if made else existing_files(settings, basis, root)
    return CaseJob(case, files, folder, assignments, force, report, pictures)

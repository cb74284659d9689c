"""A case on its way to an answer, and what an answer is: files, and what is said of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from ..basis import read_basis
from ..case import CaseSettings, load_case
from ..case.assemble import Built, build
from ..data import ModalBasis
from ..errors import in_its_file
from ..files import store
from .checkpoint import inputs_of
from .stage import Made, Report, Stage, folder_of_case, hash_of_code


class Written(NamedTuple):
    """What a stage leaves for a reader.

    Attributes:
        files: the page first. said: sentences, and lines of a table. whole: whether nothing of it was lost.
    """

    files: Sequence[Path]
    said: Sequence[str]
    whole: bool = True


def answered(stage: Stage, inputs: Mapping[str, Any], work: Callable[[], Written]) -> Written:
    """The answer that a stage's product (JSON) holds, made where it is not up to date; see `Stage.make`."""
    folder = stage.product.parent

    def make() -> Made:
        found = work()
        names = [str(path.relative_to(folder)) for path in found.files]
        told = {"files": names, "said": list(found.said), "whole": bool(found.whole)}
        store.write_json(stage.product, told)
        return Made(found.files)

    stage.make(inputs, make)
    told = json.loads(stage.product.read_text())
    return Written([folder / name for name in told["files"]], told["said"], told["whole"])


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
        """The answer that ``name.json`` holds, made by a module's `work` where it is not up to date.

        What `work` keeps in ``name.points`` until then is removed.
        """
        product = self.folder / f"{name}.json"
        stage = Stage(product, (module,), self.force, self.report, case=self.path)
        found = answered(stage, {**self.inputs, "pictures": self.pictures}, lambda: work(stage, self))
        stage.product.with_suffix(".points").unlink(missing_ok=True)
        return found


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

    def stage(self, case: str, name: str, module: str) -> Stage:
        """The stage whose product is ``name.json``, made by a module."""
        product = folder_of_case(self.path, case, self.root) / f"{name}.json"
        return Stage(product, (module,), self.force, self.report, case=self.path)

    def inputs(self, raw: Mapping[str, Any], files: Iterable[Path | str]) -> dict[str, Any]:
        """What the answer depends on: the case as a table, files that it names (what is missing is told where it is
        read), and whether pictures are wanted."""
        there = [file for name in files if (file := self.path.parent / name).is_file()]
        return {"case": raw, "files": [store.hash_file(file) for file in there], "pictures": self.pictures}

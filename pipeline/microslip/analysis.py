"""An analysis of a case: the keys it has, how it is solved, and what an answer is; all by their names.

Verb, table of a case.toml, files, page, lock and kept points follow from it (`stages.analysing`).
Each is one module that holds ``ANALYSIS``: a file of `verbs/`, or what another package names by an
entry point ``microslip.analysis``. What a module says at its head is what `microslip --help` says
of the verb.
"""

from __future__ import annotations

import ast
import pkgutil
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .results import Journal
    from .settings.numbers import Model

GROUP = "microslip.analysis"


class Data(Protocol):
    """What is written as a table and as a file of all that is known."""

    def columns(self) -> dict[str, Any]:
        """Name with unit -> column of the table."""

    def save(self, path: Path) -> Path:
        """Write a file, complete or absent."""


class Drawing(NamedTuple):
    """A figure: what draws it from the data beside it, its title, and its size in inches."""

    draw: Callable[[Figure], None]
    title: str = ""
    size: tuple[float, float] = (7.0, 4.6)


@dataclass(frozen=True)
class Question:
    """What is asked of a case.

    Attributes:
        asked: the keys of the analysis, a model of its `Analysis.asks`. built: the case's assembly, a
            `case.assemble.Built`. kept: what is finished, for a run that goes on. report: is told what is under way.
    """

    asked: Any
    built: Any
    kept: Journal
    report: Callable[[str], None]


@dataclass(frozen=True)
class Answer:
    """What is answered.

    Attributes:
        sentences: the result first. data: end of the files' names -> what they hold; the first one without an end.
            diagrams: likewise. tables: pieces of the page (`report.page`). largest: amplitude of the first read-out, of
            which is told whether it looks like a number in a wrong unit. whole: whether nothing of it was lost.
    """

    sentences: Sequence[str]
    data: Mapping[str, Data]
    diagrams: Mapping[str, Drawing] = field(default_factory=dict)
    tables: Sequence[Any] = ()
    largest: float = 0.0
    whole: bool = True


@dataclass(frozen=True)
class Analysis:
    """What may be asked of a case.

    Attributes:
        name: its table in a case.toml, and how its files are called; its verb has hyphens.
        asks: the keys of that table. solve: raises `UserError` for what cannot be, whose sentence
            begins with a key.
        lost: what has happened where an answer is not whole, for a reader.
        needed: keys without which a case asks for nothing; "": the table may be left out.
        swept: whether it is about the case's sweep, which must be given.
    """

    name: str
    asks: type[Model]
    solve: Callable[[Question], Answer]
    lost: str
    needed: str = ""
    swept: bool = True


@cache
def places() -> dict[str, str]:
    """Name of every analysis -> its module, which is not loaded."""
    verbs = Path(__file__).parent / "verbs"
    here = {m.name: f"{__package__}.verbs.{m.name}" for m in pkgutil.iter_modules([str(verbs)])}
    return {point.name: point.value.partition(":")[0] for point in entry_points(group=GROUP)} | here


@cache
def analyses() -> dict[str, Analysis]:
    """All by name; one of another package that cannot be loaded is left out with a warning."""
    loaded = {}
    for name, module in places().items():
        try:
            one = import_module(module).ANALYSIS
            if one.name != name:
                raise ValueError(f"its name is {one.name!r}")
            loaded[name] = one
        except Exception as error:
            if module.partition(".")[0] == __package__:
                raise
            said = f"{GROUP}: {name}, {module}, cannot be loaded ({error})"
            warnings.warn(f"{said}; it is left out: mend or remove its package", stacklevel=2)
    return loaded


def file_of(name: str) -> Path:
    """The module of an analysis, which is not loaded."""
    spec = find_spec(places()[name])
    assert spec is not None and spec.origin is not None
    return Path(spec.origin)


def said_of(name: str) -> str:
    """What the module of an analysis says at its head."""
    return ast.get_docstring(ast.parse(file_of(name).read_text(encoding="utf-8"))) or name

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

from .settings.texts import texts_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .results import Journal
    from .settings.numbers import Model

GROUP = "microslip.analysis"


Files = dict[str, Callable[[Any], Any]]
"""Names below the folder of an answer -> what writes them there; of a PNG, what draws it into a figure."""


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
        asked: the keys of the analysis, a model of its `Analysis.asks`. built: the case's assembly,
            a `case.assemble.Built`. kept: what is finished, for a run that goes on. report: is told
            what is under way. varied: the case with other values of its keys, and meshes of its
            bodies, a `stages.analysing.Varied`. folder: of the answer, where a run may keep what it
            will go on with in files of its own; inputs: hash of what they depend on besides the
            keys of the analysis; fresh: they are to be made anew.
    """

    asked: Any
    built: Any
    kept: Journal
    report: Callable[[str], None]
    varied: Any
    folder: Path
    inputs: str
    fresh: bool = False


@dataclass(frozen=True)
class Answer:
    """What is answered.

    Attributes:
        sentences: the result first. data: end of the files' names -> what they hold; the first one
            without an end. diagrams: likewise. tables: pieces of the page (`report.page`). largest:
            amplitude of the first read-out, of which is told whether it looks like a number in a
            wrong unit; None where the sentences tell all that is to be said of the case. judged:
            what else `case.headline.doubted` looks at. whole: whether nothing of it was lost.
            missing: what was asked for and is not known, in words.
        files: see `Files`; PNG files are made where pictures are wanted, and shown on the page.
            moving: writes bodies that move below that folder, where pictures are wanted. lines: of
            a table for the terminal.
    """

    sentences: Sequence[str]
    data: Mapping[str, Data] = field(default_factory=dict)
    diagrams: Mapping[str, Drawing] = field(default_factory=dict)
    tables: Sequence[Any] = ()
    largest: float | None = 0.0
    judged: Mapping[str, Any] = field(default_factory=dict)
    whole: bool = True
    files: Files = field(default_factory=dict)
    moving: Callable[[Path], Sequence[Path]] = lambda _: ()
    lines: Sequence[str] = ()
    missing: str = ""


@dataclass(frozen=True)
class Analysis:
    """What may be asked of a case.

    Attributes:
        name: its table in a case.toml, and how its files are called; its verb has hyphens.
        asks: the keys of that table. solve: raises `UserError` for what cannot be, with a key of
            the table, or with the case file and any key of it.
        lost: what has happened where an answer is not whole, for a reader.
        needed: keys without which a case asks for nothing; "": the table may be left out.
        swept: whether it is about the case's sweep, which must be given.
        verb: another one. options: keys, of a class `Keys`, that are options of the verb too. Both
            are read where they are written, without loading the module.
        several: whether a case may have several such tables, whose keys have a name; `asked` is
            a tuple of them.
        alone: whether its sweep is for it, so that `microslip run` makes no response of the case.
        band: keys as they are written -> start and stop (Hz) of the sweep of a case that has none;
            nothing: any will do. unloaded: whether what they ask for needs no excitation.
        fits: a sentence where they do not go with a `case.CaseSettings`. files: that they name.
    """

    name: str
    asks: type[Model]
    solve: Callable[[Question], Answer]
    lost: str
    needed: str = ""
    swept: bool = True
    verb: str = ""
    options: Sequence[str] = ()
    several: bool = False
    alone: bool = False
    band: Callable[[Mapping[str, Any]], Mapping[str, float]] = lambda _: {}
    unloaded: Callable[[Any], bool] = lambda _: False
    fits: Callable[[Any, Any], str] = lambda *_: ""
    files: Callable[[Any], Sequence[str | None]] = lambda _: ()


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


class Verb(NamedTuple):
    """A verb as its module says it. Attributes: name. help: the head of the module. options: key ->
    what it is, of `Analysis.options`."""

    name: str
    help: str
    options: Mapping[str, str]


def verb_of(name: str) -> Verb:
    """The verb of an analysis, whose module is not loaded."""
    tree = ast.parse(file_of(name).read_text(encoding="utf-8"))
    made = [
        n.value for n in tree.body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "ANALYSIS"
    ]
    keys = {k.arg: k.value for call in made for k in getattr(call, "keywords", ())}
    verb, options = (ast.literal_eval(keys[key]) if key in keys else "" for key in ("verb", "options"))
    texts = {of[1]: text for of, text in texts_of(tree).items() if of[0] == "Keys"}
    said = {key: " ".join(texts[key].split()) for key in options}
    return Verb(verb or name.replace("_", "-"), ast.get_docstring(tree) or name, said)

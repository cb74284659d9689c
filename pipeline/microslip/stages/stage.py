"""A stage: the product it makes, what that depends on, and the one rule when there is work to do.

`make` and ``microslip run`` share this rule, so editing a normal force never remeshes.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from ..errors import UserError
from ..files import store
from ..files.png import beside
from ..progress import Report
from ..settings.toml import load_toml

PACKAGE = Path(__file__).parents[1]


@dataclass(frozen=True)
class Made:
    """What the work of a stage leaves.

    Attributes:
        files: written with the product, in its folder or below. opened: read on the way, and not known before. note:
            volatile things for the sidecar. whole: whether nothing was missing; else the next run tries again.
    """

    files: Iterable[Path] = ()
    opened: Iterable[Path] = ()
    note: Mapping[str, Any] = field(default_factory=dict)
    whole: bool = True


@dataclass(frozen=True)
class Stage:
    """One product, made by one process at a time, and only when what it depends on has changed.

    Attributes:
        product: the file by which it is known; its sidecar and its lock stand beside it.
        code: modules that make it, of this package by name, others by file; the source of all that they import counts
            as an input.
        force: work even if there is nothing to do. report: is told what is being done.
        origin: the settings file by whose name the product is called: that of another file, which
            still has this name, is not overwritten. None: the place was asked for.
        case: the case file by whose name the folder is called, see `folder_of_case`.
    """

    product: Path
    code: tuple[str | Path, ...]
    force: bool = False
    report: Report = lambda _: None
    origin: Path | None = None
    case: Path | None = None

    def make(self, inputs: Mapping[str, Any], work: Callable[[], Made]) -> bool:
        """Do the work unless the product is up to date. Returns whether it was done.

        Args:
            inputs: settings, and hashes of files, that the product depends on.
            work: writes the product. It calls `begin` before the first of several files.

        Raises:
            UserError: it would take the place of another settings file's product.
        """
        with self.making():
            all_inputs = {**inputs, "code": hash_of_code(self.code)}
            if store.nothing_to_do(self.product, all_inputs, self.force, self.report):
                return False
            self._refuse_another()
            made = work()
            if made.whole:
                pictures = [path for path in made.files if path.suffix == ".png"]
                files = [*made.files, *(f for path in pictures for f in beside(path) if f.is_file())]
                self.clear([self.product, *files])
                note = {**made.note, **self.origin_noted()}
                store.note_product(self.product, all_inputs, files, made.opened, **note)
            return True

    def _refuse_another(self) -> None:
        if self.origin is not None:
            refuse_another(self.origin, self.product, origin_of(self.product))

    def origin_noted(self) -> dict[str, Any]:
        """Where the settings file stands, seen from the product, so that both can be moved together."""
        file = self.case or self.origin
        if file is None or not file.is_file():
            return {}
        key = "origin" if self.case is None else "case"
        return {key: seen_from(self.product, file), "name": load_toml(file).get("name")}

    def is_made(self, inputs: Mapping[str, Any]) -> bool:
        """Whether the product is up to date, and not to be made all the same."""
        return not self.force and store.is_up_to_date(self.product, {**inputs, "code": hash_of_code(self.code)})

    @property
    def is_unfinished(self) -> bool:
        """Whether nothing stands there that was made to its end."""
        return not store.sidecar_path(self.product).is_file()

    def making(self) -> AbstractContextManager[None]:
        """What else belongs to the product is made under its lock, see `store.making`."""
        return store.making(self.product, self.report)

    def begin(self) -> None:
        """What stands there counts no more: a run that ends here is begun anew."""
        store.unfinished(self.product)

    def clear(self, keep: Iterable[Path] = ()) -> None:
        """What a former run has left goes, but files to `keep`, of this one. See `store.clear_former`."""
        store.clear_former(self.product, keep)


def seen_from(product: Path, file: Path) -> str:
    """The path of a file or folder from the folder of a product; what is a link keeps its name."""
    return os.path.relpath(file.parent.resolve() / file.name, product.parent.resolve())


def is_same(file: Path, other: Path) -> bool:
    """Whether two paths name one entry of one folder."""
    return file.name == other.name and file.parent.resolve() == other.parent.resolve()


def origin_of(product: Path) -> Path | None:
    """The settings file that a product is made of, or None where that is not known, or the file is
    gone or has another name by now."""
    return _noted_in(store.sidecar_path(product), "origin") if product.is_file() else None


def folder_of_case(path: Path, name: str, root: Path = Path("build")) -> Path:
    """Where the products of a case stand: the folder of its name.

    Raises:
        UserError: those of another case stand there, which still has this name.
    """
    folder = root / name
    for sidecar in sorted(folder.glob("*.json")):
        refuse_another(path, folder, _noted_in(sidecar, "case"))
    return folder


def refuse_another(file: Path, product: Path, other: Path | None) -> None:
    """Refuse to put what is made of a settings file in the place of what is made of another one.

    Args:
        product: a file, or a folder of products. other: the settings file it is made of.

    Raises:
        UserError: the files are not the same.
    """
    if other is not None and not is_same(other, file):
        gone = product if product.is_dir() or product.suffix == ".msh" else product.parent
        raise UserError(
            f"{file}: name: {product} is made of {other}, which has the same name; give one of "
            f"them another name (for one run: --set name=NAME), or delete {gone} if {other} is a copy"
        )


def _noted_in(sidecar: Path, key: str) -> Path | None:
    """The settings file that a sidecar names, if it is there and is called as it was."""
    try:
        note = json.loads(store.ordinary(sidecar).read_text())
        file = Path(os.path.relpath(sidecar.parent.resolve() / note[key]))
        named = file.is_file() and load_toml(file).get("name") == note["name"]
    except (OSError, ValueError, KeyError, TypeError, UserError):
        return None
    return file if named else None


@cache
def hash_of_code(modules: tuple[str | Path, ...]) -> str:
    """SHA-256 of the sources of modules and of all that they import; a package stands for all that is in it.

    What is no module counts with the modules of its folder and of the folders above it.
    """
    todo, found = [f for m in modules for f in _files(m)], set[Path]()
    while todo:
        file = todo.pop()
        if file not in found:
            found.add(file)
            todo += _imported(file)
    folders = {f.parent for f in found if f.is_relative_to(PACKAGE)} - {PACKAGE}
    beside = {f for folder in folders for f in folder.rglob("*") if f.is_file() and f.suffix != ".py"}
    found |= {f for f in beside if f.parent.name != "__pycache__"}
    named = sorted((os.path.relpath(f, PACKAGE), store.hash_file(f)) for f in found)
    return store.hash_settings(named)


def _files(module: str | Path) -> list[Path]:
    if isinstance(module, Path):
        return [module]
    place = PACKAGE / module.replace(".", "/")
    return sorted(place.rglob("*.py")) if place.is_dir() else [place.with_suffix(".py")]


_IMPORT = re.compile(r"^[ \t]*from (\.+|microslip\.?)([\w.]*) import (\([^)]*\)|[^\n]*)", re.M)


def _imported(file: Path) -> list[Path]:
    """Files of the package that a file imports, anywhere in its text."""
    found = []
    for root, module, names in _IMPORT.findall(file.read_text(encoding="utf-8")):
        base = PACKAGE if root.startswith("microslip") else file.parents[len(root) - 1]
        place = base.joinpath(*filter(None, module.split(".")))
        inside = [place / name for name in re.findall(r"(\w+)(?: as \w+)?", names)]
        found += [p.with_suffix(".py") for p in (place, *inside)] + [p / "__init__.py" for p in (place, *inside)]
    return [f for f in found if f.is_file()]

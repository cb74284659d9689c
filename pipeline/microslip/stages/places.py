"""Where the bodies and the modal files of a case are."""

from __future__ import annotations

import contextlib
import difflib
import shlex
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path

from ..case import CaseSettings
from ..case.settings import BodyOfCase
from ..errors import UserError, in_its_file
from ..files import store
from ..settings.toml import load_toml
from .job import ASKED, bodies_of, open_job, system_file
from .modal import modes_stage, system_stage
from .stage import Report, is_same, origin_of

WHEEL_AND_RAIL, TYRE = frozenset({"wheel", "rail"}), frozenset({"tyre", "jumps"})
"""Keys by which a case of rolling contact is known."""


def keys_of(path: Path) -> set[str]:
    """Of a settings file; none of anything else."""
    return set(load_toml(path)) if path.is_file() and path.suffix == ".toml" else set()


def rolls(path: Path) -> bool:
    """True for a case of rolling contact."""
    return any(keys <= keys_of(path) for keys in (WHEEL_AND_RAIL, TYRE))


def is_case(path: Path) -> bool:
    """True for a case file (it has a sweep, or bodies of which another thing is asked), False for a body file."""
    keys = keys_of(path)
    return bool(keys & {"body", "sweep"}) or bool(keys & {"bodies"} and keys & ASKED)


def modal_files(
    case: CaseSettings, root: Path, report: Report, known: Mapping[str, Path] | None = None
) -> dict[str, Path]:
    """Body of a case -> its modal file, computed where that is not up to date; basis.h5 beside a case of one body
    without a body.toml there; that of a body that is nowhere, if it was made once.

    Raises:
        UserError: a body that is nowhere.
    """
    path = case.path
    found = ({} if path.with_name("body.toml").is_file() else _beside(case)) | dict(known or {})
    for b in case.components:
        if b.name in found:
            continue
        body = b.body or b.name
        if b.file is not None:
            found[b.name] = _named(path, b)
        elif (system := lumped(path, body)) is not None:
            found[b.name] = system_stage(system, report=report, root=root)
        else:
            found[b.name] = _made(path, body, root, report)
    return found


def _made(path: Path, body: str, root: Path, report: Report) -> Path:
    """The modal file of a body that a case names."""
    file = root / "build" / body / "basis.h5"
    try:
        place = find_body(path, body, root)
    except UserError:
        if file.is_file():
            return file
        raise
    job = open_job(place, root=root)
    modes_stage(job, report=report)
    return job.basis_file


def lumped(case_path: Path, name: str) -> Path | None:
    """The system.toml of a small system of that name beside a case, in its folder or in one of the system's name."""
    for place in (case_path.parent / "system.toml", case_path.parent / name / "system.toml"):
        file = system_file(place) if place.is_file() else None
        if file is not None and load_toml(file).get("name") == name:
            return file
    return None


@in_its_file
def existing_files(case: CaseSettings, basis_file: Path | None, root: Path) -> dict[str, Path]:
    """Body of a case -> a modal file that exists."""
    path = case.path
    beside = path.with_name("basis.h5")
    if len(case.components) == 1 and case.components[0].file is None and basis_file is not None:
        return {case.components[0].name: basis_file}
    if there := _beside(case):
        return there
    if basis_file is not None:
        raise UserError(f"has {len(case.components)} bodies; name their modal files in it (bodies.<name>.file)")
    found = {}
    for b in case.components:
        found[b.name] = _named(path, b) if b.file else root / "build" / (b.body or b.name) / "basis.h5"
        if not found[b.name].is_file():
            own = [beside] if len(case.components) == 1 else []
            raise UserError(_nowhere(case, b, [*own, found[b.name]], root))
        if b.file is None:
            _refuse_another(path, b, found[b.name], root)
    return found


def _refuse_another(path: Path, b: BodyOfCase, file: Path, root: Path) -> None:
    """Refuse a modal file that is made of another body of the name which the case means."""
    made_of, meant = origin_of(file), lumped(path, b.body or b.name)
    with contextlib.suppress(UserError):  # a modal file alone will do
        meant = meant or find_body(path, b.body or b.name, root)
    if made_of is not None and meant is not None and not is_same(made_of, meant):
        raise UserError(
            f"means {meant}, but {file} is made of {made_of}, which has the same name; give one of "
            f"them another name and type: microslip modes {shlex.quote(str(meant))}",
            f"bodies.{b.name}",
        )


def _beside(case: CaseSettings) -> dict[str, Path]:
    """The modal file basis.h5 beside a case of one body that names no other."""
    file = case.path.with_name("basis.h5")
    one = case.components[0] if len(case.components) == 1 else None
    return {one.name: file} if one is not None and one.file is None and file.is_file() else {}


@in_its_file
def _named(path: Path, b: BodyOfCase) -> Path:
    """The modal file that a body of a case names.

    Raises:
        UserError: it is not there.
    """
    file = path.parent / (b.file or "")
    if not store.ordinary(file).is_file():
        raise UserError(
            f"there is no file {file}; paths in a case start in the folder of the case: correct it",
            f"bodies.{b.name}.file",
        )
    return file


def _nowhere(case: CaseSettings, b: BodyOfCase, looked: list[Path], root: Path) -> str:
    """A modal file that is not there: where it was looked for, and what to type."""
    path, name, said = case.path, b.body or b.name, " or ".join(map(str, looked))
    begun = f"there is no modal file of '{name}': no {said} in {root.resolve()}"
    with contextlib.suppress(UserError):
        by_hand = lumped(path, name)
        if by_hand is None:
            find_body(path, name, root)
        return f"{begun}; microslip run {shlex.quote(str(by_hand.parent if by_hand else path))} makes it"
    give = "give it after the case" if len(case.components) == 1 else f"name one in bodies.{b.name}.file"
    return f"{begun}; {_elsewhere(path, name, root) or f'correct the name, or {give}'}"


def _elsewhere(path: Path, name: str, root: Path) -> str:
    """What to do about a body that is not here: go to the folder where it is, or write the name of one that is."""
    here = root.resolve()
    for folder in dict.fromkeys((*path.resolve().parents, *here.parents)):
        there = (folder / "build" / name / "basis.h5", folder / "geometry" / name / "body.toml")
        if folder != here and any(p.is_file() for p in there):
            case = path.resolve()
            case = case.relative_to(folder) if case.is_relative_to(folder) else case
            return f"it is in {folder}: go there (cd {shlex.quote(str(folder))}) and give the case as {case}"
    known = sorted({p.parent.name for p in (*root.glob("build/*/basis.h5"), *root.glob("geometry/*/body.toml"))})
    close = difflib.get_close_matches(name, known, 1)
    if close:
        return f"is '{close[0]}' meant? Correct the name in the case"
    return f"the bodies here are {', '.join(known)}: correct the name in the case" if known else ""


@in_its_file
def find_body(case_path: Path, name: str, root: Path) -> Path:
    """The body file of a name that a case gives.

    It stands beside the case, in any file, in body.toml of a folder there, or in NAME/ or
    geometry/ of the case's folder, of one above it, or of `root`, the nearest first, so that a case
    means the same body wherever it is run. In geometry/ it is geometry/NAME/body.toml, or any file
    of geometry/*/ that says that name (a body's second arrangement, the other side of a rig).

    Raises:
        UserError: if there is none.
    """
    for number, folder in enumerate((*_above(case_path.parent, root), root)):
        beside = [folder / "body.toml", *bodies_of(folder)] if number == 0 else []
        usual = [*beside, folder / "geometry" / name / "body.toml", folder / name / "body.toml"]
        usual += sorted(folder.glob("*/body.toml")) if number == 0 else []  # as `import` writes them
        for file in (*filter(Path.is_file, usual), *sorted((folder / "geometry").glob("*/*.toml"))):
            if load_toml(file).get("name") == name:
                return file
    raise UserError(
        f"no body.toml of a body '{name}' is beside it, nor in {name}/ or geometry/ of its folder, "
        f"of one above it or of {root.resolve()}; "
        + (_elsewhere(case_path, name, root) or "correct the name, or type this where geometry/ is"),
        "body",
    )


def _above(first: Path, root: Path) -> Iterator[Path]:
    """A folder and those above it, seen from `root`, up to one in which anybody may write: what is found there may be
    anybody's."""
    yield first
    here = root.resolve()
    for folder in first.resolve().parents:
        if folder.stat().st_mode & stat.S_IWOTH:
            return
        yield root / folder.relative_to(here) if folder.is_relative_to(here) else folder

"""One body on its way through the chain, and what a path that a person gives holds."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..analysis import places
from ..errors import UserError
from ..settings.body import BodySettings, body_settings, load_body
from ..settings.toml import load_toml

_NO_SETTINGS = set(".step .stp .brep .iges .igs .inp .cdb .msh .med .unv .bdf .mtx .mat".split())


@dataclass(frozen=True)
class Job:
    """One body on its way through the chain: its file, settings in SI and as written, and where products go."""

    path: Path
    settings: BodySettings
    raw: dict[str, Any]
    root: Path

    @property
    def folder(self) -> Path:
        return self.path.parent

    @property
    def mesh_file(self) -> Path:
        """The mesh the body is assembled on: the product of its build or CAD file, or the user's own."""
        own = self.settings.geometry.mesh
        if own is not None:
            return self.folder / own
        return self.root / "meshes" / f"{self.settings.name}.msh"

    @property
    def build_folder(self) -> Path:
        return self.root / "build" / self.settings.name

    @property
    def basis_file(self) -> Path:
        return self.build_folder / "basis.h5"

    @property
    def case_file(self) -> Path | None:
        """case.toml beside the body, or pipeline/cases/<name>.toml where the chain is run."""
        for place in (self.folder / "case.toml", self.root / "pipeline" / "cases" / f"{self.settings.name}.toml"):
            if place.is_file():
                return place
        return None


def open_job(path: Path | str, assignments: list[str] | None = None, root: Path | str = ".") -> Job:
    """Read a body file (or the body.toml in a folder).

    Raises:
        UserError: see `load_body`; another body file of the folder has the same name.
    """
    path = Path(path)
    if holds_a_case_alone(path):
        raise UserError(f"{path}: holds a case and no body; run it with: microslip run {shlex.quote(str(path))}")
    if path.is_dir():
        path = path / "body.toml"
    if path.suffix.lower() in _NO_SETTINGS and path.is_file():
        raise UserError(f"{path}: is no body.toml; make one around it with: microslip import {shlex.quote(str(path))}")
    settings, raw = load_body(path, assignments)
    _only_one(path, settings.name)
    return Job(path, settings, raw, Path(root))


def job_of(raw: dict[str, Any], folder: Path) -> Job:
    """A body from the keys of a body.toml, its paths beginning in a folder.

    Raises:
        UserError: see `load_body`.
    """
    path = folder / "body"
    return Job(path, body_settings(raw, path), raw, folder)


def bodies_of(folder: Path) -> Mapping[Path, str]:
    """File -> name of the bodies in a folder; of a file with a mistake its reader tells when it is run."""
    found = {}
    for file in sorted(folder.glob("*.toml")):
        with suppress(UserError):
            keys = load_toml(file)
            if "geometry" in keys and not ASKED & set(keys):
                found[file] = str(keys.get("name"))
    return found


def _only_one(path: Path, name: str) -> None:
    """Refuse a body whose products would take the place of those of another one of the folder.

    Raises:
        UserError: with both files.
    """
    same = [file.name for file, called in bodies_of(path.parent).items() if called == name and not file.samefile(path)]
    if same:
        raise UserError(
            f"{path}: name: {same[0]} beside it is a body of the name '{name}' too, and their products would stand in "
            "one folder; give one of them another name"
        )


def holds_a_case_alone(path: Path) -> bool:
    """Whether a folder has a case.toml, and neither a body.toml nor a system.toml beside it."""
    return [(path / f"{name}.toml").is_file() for name in ("case", "body", "system")] == [True, False, False]


ASKED = frozenset({"sweep", *places()})
"""Keys of a case, one of which it has, and a system.toml none."""


def system_file(path: Path) -> Path | None:
    """The system.toml that a path names: a file of masses, rigid bodies or matrices, or the folder that holds it."""
    if path.is_dir() and not (path / "body.toml").is_file():
        path = path / "system.toml"
    if path.is_file() and path.suffix == ".toml" and {"masses", "bodies", "matrices"} & set(keys := load_toml(path)):
        return None if {*ASKED, "geometry"} & set(keys) else path  # a case has bodies, a body masses too
    return None

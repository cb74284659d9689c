"""A case with other values of its keys: the assembly that it then describes; its bodies as they are meshed."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..case.assemble import Built, build
from ..case.settings import case_model
from ..data import Mesh, ModalBasis
from ..errors import UserError, at, of_file
from ..settings.body import BodySettings
from ..settings.mistakes import validate
from ..settings.toml import override
from ..system.assembly import Assembly
from ..system.settings import load_system
from .job import open_job
from .meshing import load_mesh, mesh_stage
from .places import find_body, lumped

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
        others = [f"{k.removeprefix(OF_SYSTEM)}={v!r}" for k, v in values.items() if k.startswith(OF_SYSTEM)]
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
            raise UserError(f"'{name}' has no mesh, so there is nothing unreduced; leave full out", where, self.path)
        return load_mesh(job, mesh_stage(job))[0], job.settings

    def _systems(self, assignments: list[str]) -> dict[str, ModalBasis]:
        found = dict(self.bases)
        made = {name: lumped(self.path, basis.name) for name, basis in self.bases.items()}
        for name, file in made.items():
            if file is not None:
                found[name] = load_system(file, assignments).basis()
        if not any(made.values()):
            raise UserError(f"'{OF_SYSTEM}' names a key of a system.toml, but no body of this case has one")
        return found

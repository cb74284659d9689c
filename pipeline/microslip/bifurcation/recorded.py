"""Diagrams of a case in their file: written whole, read again as branches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import UserError, in_its_file
from ..files import hdf5, store
from ..files.hostile import reading, refuse_damaged
from ..settings.arguments import checked
from . import branches
from .branches import Collected, DiagramBranch, draw

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT, VERSION = "microslip-bifurcation", "0.1"

_TRIAL = "from microslip.bifurcation.recorded import _read; _read(path)"


@dataclass(frozen=True, eq=False, repr=False)
class Branches(Collected):
    """A diagram as its file has it. Attributes: name. parameter, unit: of its axis. branches."""

    name: str
    parameter: str
    unit: str
    branches: tuple[DiagramBranch, ...]

    def __len__(self) -> int:
        return len(self.branches)

    def plot(self, axes: Axes, read_out: int = 0) -> None:
        """Half of the way from the smallest to the largest value of a read-out, in matplotlib's axes."""
        axis = f"{self.parameter} in {self.unit}".removesuffix(" in ")
        draw(self.branches, [], axes, axis, read_out)

    def __repr__(self) -> str:
        return f"<Branches: {self.name}, over {self.parameter}: {', '.join(b.name for b in self.branches)}>"


def write_bifurcation(path: Path, diagrams: Sequence[Branches]) -> Path:
    """All diagrams of a case, complete or not at all."""
    with hdf5.sealed(path) as file:
        file.attrs["format"], file.attrs["version"] = FORMAT, VERSION
        for diagram in diagrams:
            group = file.create_group(diagram.name)
            group.attrs["parameter"], group.attrs["unit"] = diagram.parameter, diagram.unit
            for i, branch in enumerate(diagram.branches):
                branches.put(group.create_group(f"branch_{i}"), branch)
    return path


@checked
@in_its_file
def read_bifurcation(path: Path | str) -> Mapping[str, Branches]:
    """Read ``bifurcation.h5``: name of a diagram -> its branches, with every orbit and its multipliers.

    Raises:
        UserError: missing, damaged, foreign or of another version.
    """
    path = Path(path)
    if not store.ordinary(path).is_file():
        raise UserError("no such file of bifurcations; run microslip bifurcate first or correct the path")
    refuse_damaged(path, _TRIAL, "run the case again")
    return _read(path)


def _read(path: Path) -> dict[str, Branches]:
    with reading(path, FORMAT, VERSION, "run the case again") as file:
        return {
            name: Branches(
                name, str(group.attrs["parameter"]), str(group.attrs["unit"]),
                tuple(branches.get(group[f"branch_{i}"]) for i in range(len(group))),
            )
            for name, group in file.items()
        }  # fmt: skip

"""The sections of a contact's settings that come in kinds: stiffness, roughness, friction and law.

A kind is a class of settings with ``kind: Literal["its name"]`` that makes its own arithmetic, beside which it stands:
`stiffness.Stiffness`, `roughness.Roughness`, `friction.FrictionKind` and `LawKind` say what. It is named where
`settings` lists the kinds, or, in a package of one's own, by an entry point:

    [project.entry-points."microslip.law"]
    pad = "pads:Pad"
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Union

import numpy as np
from pydantic import BeforeValidator, Field

from ..errors import UserError
from ..files.store import ordinary
from ..settings.numbers import Model, NotNegative, Number, Positive, _finite_vector, _tuple
from ..settings.toml import load_toml
from .layer import BOUNDARIES

if TYPE_CHECKING:
    from .composed import ContactModel
    from .law import Law
    from .normal import Normal
    from .settings import ContactLaw

NotNegativeLength = Annotated[NotNegative, "length"]
Lengths = Annotated[tuple[Number, ...], BeforeValidator(_finite_vector), "length"]
PositiveLengths = Annotated[tuple[Positive, ...], BeforeValidator(_finite_vector), "length"]
Radii = Annotated[tuple[float, float], BeforeValidator(_finite_vector), "length"]  # inf is flat
OneOrTwo = Positive | Annotated[tuple[Positive, Positive], BeforeValidator(_finite_vector)]
Column = Annotated[int, Field(ge=1)] | Annotated[str, Field(min_length=1)]
Columns = Annotated[tuple[Column, Column], BeforeValidator(_tuple)]
FileName = Annotated[str, Field(min_length=1)]
Poisson = Annotated[Number, Field(gt=-1, le=0.5)]
Boundary = Literal["stress-free", "hydrostatic", "no-lateral-strain"]
assert set(BOUNDARIES) == {"stress-free", "hydrostatic", "no-lateral-strain"}

SECTIONS = ("stiffness", "roughness", "friction", "law")


class Kind(Model):
    """Base of all kinds."""

    kind: str


def kinds(section: str, *own: type[Kind]) -> Any:
    """The annotation of a section: any of its kinds, told apart by `kind`; those of other packages last."""
    known = (*own, *of_others(section).values())
    return Annotated[Union[known], Field(discriminator="kind")]  # noqa: UP007


def of_others(section: str) -> dict[str, Any]:
    """Name -> what other packages give under it; what cannot be loaded is left out with a warning."""
    found = dict[str, Any]()
    for entry in sorted(entry_points(group=f"microslip.{section}"), key=lambda entry: entry.name):
        try:
            found[entry.name] = entry.load()
        except Exception as error:
            package = entry.dist.name if entry.dist else "another package"
            said = f"microslip.{section}: {entry.name} of {package}, {entry.value}, cannot be loaded ({error})"
            warnings.warn(f"{said}; it is left out: mend or remove its package", stacklevel=2)
    return found


def sources_of_others(contacts: Iterable[ContactLaw]) -> dict[str, Path]:
    """Module -> file of the kinds of other packages that contacts name: what is computed with them depends on it."""
    modules = {type(getattr(c, section)).__module__ for c in contacts for section in SECTIONS}
    others = sorted(m for m in modules if m.split(".")[0] not in (__name__.split(".")[0], "builtins"))
    return {name: Path(found.origin) for name in others if (found := find_spec(name)) and found.origin}


class LawKind(Kind):
    """What sticks, slips and opens.

    Attributes:
        partly: whether some of it may slip while the rest sticks. opens: whether it carries no pull. of_the_force:
            whether its numbers are those of the very force that presses it, `ContactModel.pressed`. rigid: whether it
            has no stiffness at all.
    """

    kind: str
    """what sticks, slips and opens"""
    partly: ClassVar[bool] = False
    opens: ClassVar[bool] = True
    of_the_force: ClassVar[bool] = False
    rigid: ClassVar[bool] = False

    def fits(self, contact: ContactLaw) -> None:
        """Refuse settings of the other sections that it cannot use.

        Raises:
            ValueError: the section's name, a colon and what is wrong.
        """

    def normal(self, contact: ContactModel) -> Normal | None:
        """A normal law of its own, in place of the one that stiffness and roughness make."""
        return None

    def places(self, width: float, height: float) -> tuple[np.ndarray, np.ndarray] | None:
        """(n, 2) m and areas (n,) m2 of its points on a patch of width x height, where it is particular about them."""
        return None

    def law(self, contact: ContactModel) -> Law:
        """Of the full area.

        Raises:
            UserError: numbers that make none.
        """
        raise NotImplementedError


def beside(path: Path, name: str) -> Path:
    """A file that a contact file names, sought beside it.

    Raises:
        UserError: there is no such file.
    """
    found = path.parent / name
    if not ordinary(found).is_file():
        raise UserError(f"there is no file {found}; correct the name (it is sought beside this file)", "file")
    return found


def files_of(path: Path) -> list[Path]:
    """Files that a contact file names (curves, profiles, tables, a modal file), as far as it can be read."""
    try:
        tables = [table for table in load_toml(path).values() if isinstance(table, dict)]
    except UserError:  # told where the contact is made
        return []
    return [path.parent / table["file"] for table in tables if isinstance(table.get("file"), str)]

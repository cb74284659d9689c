"""The sections of a contact's settings that come in kinds: stiffness, roughness, friction and element.

A kind is a class of settings with ``kind: Literal["its name"]`` that makes its own arithmetic. It stands beside that,
and its place is the only entry it needs: in `OWN`, or, in a package of one's own, as an entry point:

    [project.entry-points."microslip.element"]
    pad = "pads:Pad"
"""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Union

from pydantic import Field

from ..body import Model, load_toml
from ..data import UserError
from ..store import ordinary

if TYPE_CHECKING:
    from .composed import Contact
    from .friction import Friction
    from .heights import Heights
    from .law import Law
    from .normal import Normal
    from .settings import ContactLaw, Temperature
    from .stiffness import Source

OWN = {
    "stiffness": (
        "stiffness:Given", "stiffness:OfLayer", "stiffness:OfHertz", "stiffness:OfCurve", "stiffness:OfBasis",
    ),
    "roughness": (
        "roughness:Shape", "roughness:ExponentialHeights", "roughness:GaussianHeights", "roughness:TableHeights",
        "roughness:ProfileHeights",
    ),
    "friction": (
        "friction:OfCoulomb", "friction:OfStaticSliding", "friction:OfFalling",
        "friction:OfExponential", "friction:OfHeated", "friction:OfTable",
        "friction:OfLubricated",
    ),
    "element": (
        "point:Massless", "regularised:WithMass", "sliders:OfStrips", "sliders:OfIwan", "sliders:OfMindlin",
    ),
}  # fmt: skip
"""Section -> module and class of each kind, in the order in which they are told."""


def kinds(section: str) -> Any:
    """The annotation of a section: any of its kinds, told apart by `kind`; those of other packages last."""
    own = (EntryPoint(place, f"{__package__}.{place}", section) for place in OWN[section])
    known = tuple(entry.load() for entry in (*own, *_of_others(section)))
    return Annotated[Union[known], Field(discriminator="kind")]  # noqa: UP007


def _of_others(section: str) -> list[EntryPoint]:
    return sorted(entry_points(group=f"microslip.{section}"), key=lambda entry: entry.name)


def sources_of_others() -> dict[str, Path]:
    """Module -> file of the kinds of other packages: what is computed with them depends on it."""
    modules = {entry.module for section in OWN for entry in _of_others(section)}
    return {name: Path(found.origin) for name in sorted(modules) if (found := find_spec(name)) and found.origin}


class _Kind(Model):
    kind: str


class Stiffness(_Kind):
    """Where the stiffness of the full area comes from.

    Attributes:
        is_law: whether it is a normal law by itself, to which no roughness belongs.
    """

    is_law: ClassVar[bool] = False

    def source(self, path: Path) -> Source:
        """What the contact file at a path makes of it.

        Raises:
            UserError: with its key, the section's name left out.
        """
        raise NotImplementedError


class Roughness(_Kind):
    """A distribution of heights."""

    def heights(self, path: Path, unit: float) -> tuple[Heights, float]:
        """The distribution and R_Z in m.

        Args:
            path: of the contact file. unit: of lengths in files without one of their own, m.
        """
        raise NotImplementedError


class FrictionKind(_Kind):
    """A characteristic; each may scatter in time.

    Attributes:
        heated: whether it needs the heat of sliding, [temperature], and an area.
    """

    heated: ClassVar[bool] = False

    def friction(self, path: Path, heat: Temperature | None, area: float | None) -> Friction:
        """The characteristic.

        Args:
            path: of the contact file. heat: [temperature]. area: nominal, m2.
        """
        raise NotImplementedError


class Element(_Kind):
    """What sticks and slips.

    Attributes:
        partly: whether some of it may slip while the rest sticks.
    """

    partly: ClassVar[bool] = False

    def fits(self, contact: ContactLaw) -> None:
        """Refuse settings of the other sections that it cannot use.

        Raises:
            ValueError: the section's name, a colon and what is wrong.
        """

    def normal(self, contact: Contact) -> Normal | None:
        """A normal law of its own, in place of the one that stiffness and roughness make."""
        return None

    def law(self, contact: Contact) -> Law:
        """Of the full area.

        Raises:
            UserError: numbers that make none.
        """
        raise NotImplementedError


def own_normal_law(length: float | None, preload: float | None, contact: ContactLaw) -> None:
    """Refuse a normal law of the element's (hyperbolic with a length, constant with a preload) that has no place.

    Raises:
        ValueError: see `Element.fits`.
    """
    if length is not None and contact.roughness is None:
        raise ValueError("element.length: the hyperbolic law needs a rough surface; add [roughness]")
    if preload is not None and (contact.roughness is not None or contact.is_pressed):
        raise ValueError(
            "element.preload: a constant force has neither roughness nor another force beside it; remove [roughness] "
            "and motion.normal_force"
        )


def own_normal(length: float | None, preload: float | None, contact: Contact) -> Normal | None:
    """The hyperbolic law (with a length), or a constant force (with a preload)."""
    from .law import value
    from .normal import Hyperbolic, Preload

    if preload is not None:
        return Preload(value(preload))
    if length is None or contact.heights is None or contact.roughness is None:
        return None
    return Hyperbolic(value(contact.normal_0), value(contact.roughness), contact.heights, value(length))


def beside(path: Path, name: str, key: str) -> Path:
    """A file that a contact file names, sought beside it.

    Raises:
        UserError: there is no such file.
    """
    found = path.parent / name
    if not ordinary(found).is_file():
        raise UserError(f"{path}: {key}: there is no file {found}; correct the name (it is sought beside this file)")
    return found


def files_of(path: Path) -> list[Path]:
    """Files that a contact file names (curves, profiles, tables, a modal file), as far as it can be read."""
    try:
        tables = [table for table in load_toml(path).values() if isinstance(table, dict)]
    except UserError:  # told where the contact is made
        return []
    return [path.parent / table["file"] for table in tables if isinstance(table.get("file"), str)]

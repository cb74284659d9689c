"""system.toml: what a person may write about a small system, checked, and the system that it describes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from ..data import ModalBasis
from ..errors import UserError, in_its_file
from ..settings.numbers import (
    Direction,
    Model,
    Name,
    NotNegative,
    Number,
    Numbers,
    Positive,
    Ratio,
    Vector,
    _finite_vector,
    _tuple,
    named_once,
)
from ..settings.toml import read_settings
from .lumped import Body, Contact, Damper, Force, Monitor, Spring, System

Six = Annotated[Numbers | Number, Field(union_mode="left_to_right")]


class MassSettings(Model):
    """A point mass."""

    name: Name
    """of the component"""
    mass: NotNegative = 0.0
    """[kg]"""
    at: Vector = (0.0, 0.0, 0.0)
    """[m] where it is"""
    free: str = "xyz"
    """directions it can move in, `x` or `xz`"""


class BodyOfSystem(Model):
    """A rigid body."""

    name: Name
    """of the component"""
    mass: Positive
    """[kg]"""
    inertia: Annotated[tuple[Positive, Positive, Positive], BeforeValidator(_finite_vector)]
    """[kg m2] about its centre of mass, principal values along x, y, z"""
    at: Vector = (0.0, 0.0, 0.0)
    """[m] centre of mass"""
    free: str | None = None
    """directions it can move in, such as `x z ry`; all if not given"""


class LinkSettings(Model):
    """What springs and dampers have in common."""

    between: Annotated[tuple[Name, Name], BeforeValidator(_tuple)]
    """two components, or one and `ground`"""
    axis: Direction | None = None
    """along which it acts; the line between the components if not given, or the one direction in
    which one is free"""
    at: Vector | None = None
    """[m] where it acts on both; at each component's centre if not given"""


class SpringSettings(LinkSettings):
    """A spring."""

    stiffness: Six
    """[N/m or N m/rad] one number along the axis, three along x, y, z, or six with those about
    them"""


class DamperSettings(LinkSettings):
    """A damper."""

    damping: Six
    """[N s/m or N m s/rad] likewise"""


class ContactOfSystem(Model):
    """A place of a component where it rubs."""

    name: Name
    """by which cases name it"""
    on: Name
    """its component"""
    normal: Direction
    """out of the component"""
    t2: Direction | None = None
    """direction whose projection becomes t2; an axis at right angles if not given"""
    at: Vector | None = None
    """[m] the component's centre if not given"""
    width: NotNegative = 0.0
    """[m] of the patch along t1"""
    height: NotNegative = 0.0
    """[m] of the patch along t2"""
    role: Literal["left", "right", "ground", "bolt"] = "ground"
    """as of a body's [interface](body_toml.md#interfaces)"""
    partner: str = ""
    """name of the interface it faces"""


class ForceSettings(Model):
    """A unit force."""

    name: Name
    """by which cases name it"""
    on: Name
    """its component"""
    direction: Direction
    """of the unit force; its length does not matter"""
    at: Vector | None = None
    """[m] the component's centre if not given"""


class MonitorSettings(Model):
    """Where displacements are read."""

    name: Name
    """by which cases name it"""
    on: Name
    """its component"""
    at: Vector | None = None
    """[m] the component's centre if not given"""


Square = Annotated[tuple[Numbers, ...], BeforeValidator(_tuple)]


class MatrixSettings(Model):
    """Rows of M, K and C over the free directions of the components, in their order."""

    mass: Square
    """M"""
    stiffness: Square
    """K"""
    damping: Square | None = None
    """C"""


class SystemSettings(Model):
    """A whole system.toml (SI, lengths in m)."""

    name: Name
    """names the folder of the products, `build/NAME/`"""
    description: str = ""
    """one line for the report"""
    masses: Annotated[tuple[MassSettings, ...], BeforeValidator(_tuple)] = ()
    bodies: Annotated[tuple[BodyOfSystem, ...], BeforeValidator(_tuple)] = ()
    springs: Annotated[tuple[SpringSettings, ...], BeforeValidator(_tuple)] = ()
    dampers: Annotated[tuple[DamperSettings, ...], BeforeValidator(_tuple)] = ()
    matrices: MatrixSettings | None = None
    contacts: Annotated[tuple[ContactOfSystem, ...], BeforeValidator(_tuple)] = ()
    forces: Annotated[tuple[ForceSettings, ...], BeforeValidator(_tuple)] = ()
    monitors: Annotated[tuple[MonitorSettings, ...], BeforeValidator(_tuple)] = ()
    damping_ratio: Ratio = 0.0
    """of every mode, added to what dampers make"""

    @model_validator(mode="after")
    def _names_once(self) -> SystemSettings:
        named_once(self, "masses bodies", "contacts", "forces", "monitors")
        return self


@in_its_file
def load_system(path: Path | str, assignments: list[str] | None = None) -> System:
    """Read and check a system file; components are its masses, then its bodies, in the order of the file.

    Raises:
        UserError: with every mistake named by file and key.
    """
    s, raw = read_settings(SystemSettings, path, assignments)
    components = [Body(m.name, m.mass, m.at, None, m.free) for m in s.masses]
    components += [Body(b.name, b.mass, b.at, b.inertia, b.free) for b in s.bodies]
    links = [Spring(i.between[0], i.between[1], i.stiffness, i.axis, i.at) for i in s.springs]
    links += [Damper(i.between[0], i.between[1], i.damping, i.axis, i.at) for i in s.dampers]
    contacts = [Contact(**c.model_dump()) for c in s.contacts]
    forces, monitors = [Force(**f.model_dump()) for f in s.forces], [Monitor(**m.model_dump()) for m in s.monitors]
    more: dict[str, Any] = {"contacts": contacts, "forces": forces, "monitors": monitors, "ratio": s.damping_ratio}
    if (m := s.matrices) is not None and not components:
        return replace(System.of_matrices(s.name, m.mass, m.stiffness, m.damping, **more), links=links, settings=raw)
    if m is not None:
        more |= {"mass": m.mass, "stiffness": m.stiffness, "damping": m.damping}
    if not components:
        raise UserError("the system has no components; add [[masses]], [[bodies]] or [matrices]")
    return System(s.name, components, links, settings=raw, **more)


@in_its_file
def system_basis(path: Path | str, assignments: list[str] | None = None) -> ModalBasis:
    """The modal basis of a system file.

    Raises:
        UserError: with the file's name.
    """
    return load_system(path, assignments).basis()

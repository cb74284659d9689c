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
    """A point mass: kg, place in m, directions it is free in."""

    name: Name
    mass: NotNegative = 0.0
    at: Vector = (0.0, 0.0, 0.0)
    free: str = "xyz"


class BodyOfSystem(Model):
    """A rigid body: inertia about its centre of mass, three principal values along x, y, z, kg m2."""

    name: Name
    mass: Positive
    inertia: Annotated[tuple[Positive, Positive, Positive], BeforeValidator(_finite_vector)]
    at: Vector = (0.0, 0.0, 0.0)
    free: str | None = None


class LinkSettings(Model):
    """What springs and dampers have in common."""

    between: Annotated[tuple[Name, Name], BeforeValidator(_tuple)]
    axis: Direction | None = None
    at: Vector | None = None


class SpringSettings(LinkSettings):
    """One stiffness along the axis, three along x, y, z, or six."""

    stiffness: Six


class DamperSettings(LinkSettings):
    """One damping along the axis, three along x, y, z, or six."""

    damping: Six


class ContactOfSystem(Model):
    """See `Contact`."""

    name: Name
    on: Name
    normal: Direction
    t2: Direction | None = None
    at: Vector | None = None
    width: NotNegative = 0.0
    height: NotNegative = 0.0
    role: Literal["left", "right", "ground", "bolt"] = "ground"
    partner: str = ""


class ForceSettings(Model):
    """See `Force`."""

    name: Name
    on: Name
    direction: Direction
    at: Vector | None = None


class MonitorSettings(Model):
    """See `Monitor`."""

    name: Name
    on: Name
    at: Vector | None = None


Square = Annotated[tuple[Numbers, ...], BeforeValidator(_tuple)]


class MatrixSettings(Model):
    """Rows of M, K and C over the free directions of the components, in their order."""

    mass: Square
    stiffness: Square
    damping: Square | None = None


class SystemSettings(Model):
    """A whole system.toml (SI, lengths in m)."""

    name: Name
    description: str = ""
    masses: Annotated[tuple[MassSettings, ...], BeforeValidator(_tuple)] = ()
    bodies: Annotated[tuple[BodyOfSystem, ...], BeforeValidator(_tuple)] = ()
    springs: Annotated[tuple[SpringSettings, ...], BeforeValidator(_tuple)] = ()
    dampers: Annotated[tuple[DamperSettings, ...], BeforeValidator(_tuple)] = ()
    matrices: MatrixSettings | None = None
    contacts: Annotated[tuple[ContactOfSystem, ...], BeforeValidator(_tuple)] = ()
    forces: Annotated[tuple[ForceSettings, ...], BeforeValidator(_tuple)] = ()
    monitors: Annotated[tuple[MonitorSettings, ...], BeforeValidator(_tuple)] = ()
    damping_ratio: Ratio = 0.0

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

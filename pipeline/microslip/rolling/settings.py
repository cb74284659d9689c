"""The case of a rolling contact: wheel, rail, pose, load and what is asked; every key, checked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import jax.numpy as jnp
import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from ..contact.friction import Friction
from ..contact.kinds import FileName, OneOrTwo, Poisson
from ..contact.law import value
from ..contact.settings import AnyFriction, AnyRoughness, _short
from ..contact.solids import Solid
from ..errors import UserError, at
from ..settings.numbers import Model, Name, NotNegative, Number, Numbers, Positive, _finite_vector, _tuple
from ..settings.toml import read_settings
from .contact_table import POINTS as SHIFTS
from .ellipse import combined
from .kalker import Coefficients
from .laws import Heat, RoughSurface
from .profiles import EVERYWHERE, WIDTH, CrossSection, Mirror, circle, has_arc, polynomial, read_profile
from .strips import Distribution, Spin
from .table import ELEMENTS, POINTS
from .temperature import Conductor
from .wheelset import Pose, Track

WIDEST = 0.02
"""m, over which worn profiles are smoothed at most."""

Temperature = Annotated[Number, Field(gt=-273.15)]
Count = Annotated[int, Field(ge=2, le=400)]
Fineness = Annotated[int, Field(ge=4, le=100)]

SUFFIXES = {"wheel": (".prw", ".whl"), "rail": (".prr", ".ban")}
MIDDLES = {"wheel": "axle", "rail": "track"}

BIGGEST = 5.0
"""m: a wheel's radius, or half a track, above this is given in another unit."""


ROUGHEST = 1e-3
"""m: R_Z above this is given in another unit."""


class SectionKeys(Model):
    """A cross-section."""

    profile: Number | Annotated[Numbers, Field(min_length=1)] | FileName
    """[m] radius of a circle, convex positive, hollow negative; coefficients of y^2, y^3, ...
    (1/m, ...); or a [file](rolling.md#from-profiles-to-patches)"""
    width: Positive = WIDTH
    """[m] of a circle or polynomial"""
    noise: Annotated[NotNegative, Field(le=1e-3)] = 0.0
    """[m] standard deviation of a measured profile, by which it is smoothed"""
    mirror: Mirror = ""
    """axes that run the other way in its file"""
    between: Annotated[tuple[Number, Number], BeforeValidator(_finite_vector)] | None = None
    """[m] y of a file that are kept, after that"""
    at: Annotated[Positive, Field(le=BIGGEST)] = 0.75
    """[m] of the profile's origin from the middle of the track or axle; **required** where a
    profile is measured"""
    young: Positive = 2.1e11
    """[Pa] E"""
    poisson: Poisson = 0.28
    """nu"""

    @model_validator(mode="after")
    def _is_an_arc(self) -> SectionKeys:
        measured = isinstance(self.profile, str)
        idle = [key for key in (("width",) if measured else ("mirror", "noise", "between")) if getattr(self, key)]
        if asked := [key for key in idle if key in self.model_fields_set]:
            of, other = ("a file", "a formula") if measured else ("a formula", "a file")
            how = "give between" if measured else "change width or the signs of the coefficients"
            raise ValueError(f"{asked[0]}: is of a profile from {other}, this one is from {of}; remove it, or {how}")
        if isinstance(self.profile, float) and not has_arc(self.profile, self.width):
            raise ValueError(
                f"a profile of radius {self.profile:g} m has no arc {self.width:g} m wide; correct profile or width"
            )
        if isinstance(self.profile, tuple) and np.ptp(polynomial(self.profile, self.width).z) > self.width:
            raise ValueError(
                f"a profile of coefficients {list(self.profile)} is higher than its {self.width:g} m of width; they "
                "are in 1/m, 1/m^2, ..."
            )
        return self

    def made(self, folder: Path, outward: float) -> CrossSection:
        """outward: 1 if a convex profile falls to its sides (a rail), -1 if it rises (a wheel)."""
        if isinstance(self.profile, str):
            return read_profile(
                folder / self.profile, self.noise, mirror=self.mirror, between=self.between or EVERYWHERE
            )
        if isinstance(self.profile, tuple):
            return polynomial(self.profile, self.width)
        return circle(outward * self.profile, self.width)


class Wheel(SectionKeys):
    """A wheel."""

    radius: Annotated[Positive, Field(le=BIGGEST)]
    """[m] of the running circle"""


class Rail(SectionKeys):
    """A rail."""

    inclination: Annotated[Number, Field(ge=-0.2, le=0.2)] = 0.0
    """[rad] towards the track's middle; a profile that is drawn canted has 0. With another one
    the origin moves to the point that is highest then, and `at` is of that"""


class PoseOfCase(Model):
    """Where the wheelset is and how it moves, in track axes."""

    lateral: Number = 0.0
    """[m] to the right"""
    yaw: Annotated[Number, Field(ge=-0.2, le=0.2)] = 0.0
    """[rad]"""
    roll: Annotated[Number, Field(ge=-0.2, le=0.2)] = 0.0
    """[rad]"""
    speed: Positive = 20.0
    """[m/s]"""
    turning: Positive | None = None
    """[rad/s] of the axle; it rolls if not given"""
    side: Literal["left", "right", "both"] = "right"
    """`both` is the whole axle, which rolls until both wheels carry the same; the curve is of
    the patch that carries most"""

    @model_validator(mode="after")
    def _rolls(self) -> PoseOfCase:
        if self.side == "both" and "roll" in self.model_fields_set:
            raise ValueError('pose.roll: with side = "both" the axle rolls until both wheels carry the same; remove it')
        return self


class Creep(Model):
    """What the curve runs over; creepages not given are those of the pose."""

    over: Literal["longitudinal", "lateral", "spin"] = "longitudinal"
    """what the curve runs over"""
    start: Number = 0.0
    """first creepage (spin: 1/m)"""
    stop: Number
    """last one"""
    points: Annotated[int, Field(ge=2, le=100000)] = 61
    """of the curve"""
    longitudinal: Number | None = None
    """creepage; that of the pose if not given"""
    lateral: Number | None = None
    """likewise"""
    spin: Number | None = None
    """[1/m] likewise"""
    shown: Number | None = None
    """whose tractions are drawn; the middle if not given"""

    @model_validator(mode="after")
    def _runs(self) -> Creep:
        if self.start == self.stop:
            raise ValueError("creep.stop: must differ from start")
        low, high = sorted((self.start, self.stop))
        if self.shown is not None and not low <= self.shown <= high:
            raise ValueError(f"creep.shown: {self.shown:g} is not between start and stop, {low:g} to {high:g}")
        return self


class StripKeys(Model):
    """How a patch is divided and what it is made of, see `strips.creep_forces`."""

    elements: Annotated[tuple[Count, Count], BeforeValidator(_tuple)] = (20, 20)
    """along and across rolling"""
    distribution: Distribution = "constant"
    """of the bound of the traction over a strip"""
    coefficients: Coefficients = "table"
    """Kalker's, from his table or the book's polynomials (6.4-26)"""
    spin: Spin = "kalker"
    """with the third spring of Kalker, or the book's two"""


class ModelOfCase(StripKeys):
    """How a patch is divided and what it is made of, see `strips.creep_forces`."""

    exact: Annotated[int, Field(ge=0, le=1000)] = 5
    """states of the curve that are compared with exact half-spaces between the profiles
    themselves"""


class TableOfCase(Model):
    """A table of creep forces, see `table.CreepTable`."""

    points: Annotated[tuple[Fineness, Fineness, Fineness, Fineness, Fineness], BeforeValidator(_tuple)] = POINTS
    """of the size below and above saturation, azimuth, polar angle, a/b"""
    elements: Annotated[tuple[Count, Count], BeforeValidator(_tuple)] = ELEMENTS
    """of the strips it is made with"""


class ContactsOfCase(Model):
    """A table of contacts, made for the vertical force of the case on each wheel, see
    `contact_table.ContactTable`."""

    lateral: Annotated[Positive, Field(le=0.05)]
    """[m] shift to either side"""
    yaw: Annotated[Positive, Field(le=0.2)]
    """[rad] to either side"""
    points: Annotated[tuple[Count, Fineness], BeforeValidator(_tuple)] = SHIFTS
    """of the shift to one side, and of the yaw"""


class ElasticOfCase(Model):
    """The bodies behind the patch."""

    wheel: Name = "wheel"
    """body whose modal file is taken or made"""
    rail: Name = "rail"
    """likewise"""
    face: Name = "patch"
    """their interface at the patch, t2 along rolling"""


class HeatOfCase(Model):
    """What conducts the heat of friction; steel if not given."""

    conductivity: OneOrTwo = 50.0
    """[W/(m K)] one number, or two of wheel and rail"""
    density: OneOrTwo = 7850.0
    """[kg/m3] likewise"""
    heat_capacity: OneOrTwo = 450.0
    """[J/(kg K)] likewise"""
    start: Temperature | Annotated[tuple[Temperature, Temperature], BeforeValidator(_finite_vector)] = 20.0
    """[°C] temperature before the contact, likewise"""
    limit: Positive | None = None
    """[K] rise above 20 °C at which friction would be gone; without it friction does not change"""

    def made(self) -> Heat:
        keys = self.conductivity, self.density, self.heat_capacity, self.start
        *steel, start = ((v, v) if isinstance(v, float) else v for v in keys)
        wheel, rail = (Conductor(*v) for v in zip(*steel, strict=True))
        return Heat((wheel, rail), start, self.limit)


class WearOfBody(Model):
    """What a passage wears."""

    coefficient: Positive
    """[m3/J] of wheel and rail each, worn volume over frictional work"""


class WearOfCase(WearOfBody):
    """What a passage wears, and profiles that are renewed by it."""

    updates: Annotated[int, Field(ge=0, le=1000)] = 0
    """of both profiles, 0 for none"""
    passages: Positive | None = None
    """in all of them, of the wheel over every place of the rail and of the rail under every
    place of the wheel"""
    smoothing: Annotated[NotNegative, Field(le=WIDEST)] = 1e-3
    """[m] standard deviation of the Gaussian that the contact sees worn depths through"""
    lateral: Numbers | None = None
    """[m] shifts of the wheelset that share the passages; that of the pose if not given"""

    @model_validator(mode="after")
    def _renews(self) -> WearOfCase:
        if (self.updates > 0) != (self.passages is not None):
            raise ValueError("wear: give both updates and passages for profiles that are renewed, or neither")
        if self.lateral is not None and not (self.updates and self.lateral):
            raise ValueError("wear.lateral: shares the passages of updates; give shifts and updates, or remove it")
        return self


class RollingCase(Model):
    """A wheel on a rail."""

    name: Name
    """names the folder of the products, `build/NAME/`"""
    wheel: Wheel
    rail: Rail
    friction: Annotated[AnyFriction, _short("coulomb", "mu", AnyFriction)]
    """coefficient, or a table of a characteristic as in a [contact.toml](contact_toml.md)"""
    roughness: Annotated[AnyRoughness | None, _short("polynomial", "R_Z", AnyRoughness)] = None
    """[m] R_Z, or a table likewise"""
    vertical_force: NotNegative
    """[N] on this wheel"""
    pose: PoseOfCase = PoseOfCase()
    creep: Creep
    model: ModelOfCase = ModelOfCase()
    table: TableOfCase | None = None
    contacts: ContactsOfCase | None = None
    elastic: ElasticOfCase | None = None
    heat: HeatOfCase | None = None
    wear: WearOfCase | None = None

    @model_validator(mode="after")
    def _fits(self) -> RollingCase:
        self._stands()
        if self.friction.heated:
            raise ValueError(
                f'friction.kind: "{self.friction.kind}" belongs to contact files, whose [temperature] rolling has not; '
                "take another kind and give heat.limit"
            )
        if self.friction.deviation:
            raise ValueError("friction.deviation: rolling is steady, and friction random in time is not; remove it")
        if self.table is not None and self.model.spin == "book":
            raise ValueError('table: is made with model.spin = "kalker"; take that, or remove the table')
        if self.wear is not None and self.wear.updates and self.pose.side == "both":
            raise ValueError(
                'wear.updates: renew the profiles of one wheel and its rail; set pose.side to "right" or "left"'
            )
        if self.contacts is not None and not self.vertical_force > 0:
            raise ValueError("contacts: is a table for the vertical force of the case; give vertical_force above 0")
        if self.table is not None and not (self.is_constant and self.roughness is None):
            raise ValueError(
                "table: is of constant friction on smooth bodies; give a number, without heat.limit and roughness, or "
                "remove the table"
            )
        return self

    def _stands(self) -> None:
        """Files are of the body that names them, and where they stand is given: a few mm move the contact."""
        bodies = {"wheel": self.wheel, "rail": self.rail}
        for name, other in (("wheel", "rail"), ("rail", "wheel")):
            file = bodies[name].profile
            if isinstance(file, str) and Path(file).suffix.lower() in SUFFIXES[other]:
                raise ValueError(f"{name}.profile: {file} is the profile of a {other}; exchange wheel and rail")
        measured = [name for name, body in bodies.items() if isinstance(body.profile, str)]
        for name, body in bodies.items():
            if measured and "at" not in body.model_fields_set:
                raise ValueError(
                    f"{name}.at: is missing, and with the measured profile of the {measured[0]} there is no usual one; "
                    f"give the distance of the {name}'s profile from the middle of the {MIDDLES[name]}, m"
                )

    @property
    def files(self) -> list[str]:
        """Names of all that stand beside the case: profiles, and tables of friction and of heights."""
        tables = [getattr(table, "file", None) for table in (self.friction, self.roughness)]
        return [name for name in (self.wheel.profile, self.rail.profile, *tables) if isinstance(name, str)]

    @property
    def is_constant(self) -> bool:
        """Whether one coefficient of friction holds everywhere."""
        return self.friction.kind == "coulomb" and (self.heat is None or self.heat.limit is None)

    def characteristic(self, path: Path) -> Friction:
        """Of files beside the case's.

        Raises:
            UserError: a file that is none, no friction.
        """
        with at("friction"):
            friction = self.friction.friction(path, None, None)
            if not np.max(friction.highest(jnp.ones(1))) > 0:
                raise UserError("is 0 at all speeds; the creep force is a part of it, so give more than 0")
        return friction

    def surface(self, path: Path) -> RoughSurface | None:
        """Rough, if it is asked, of files beside the case's.

        Raises:
            UserError: a file that is none, heights of another unit.
        """
        if self.roughness is None:
            return None
        with at("roughness"):
            heights, R_Z = self.roughness.heights(path, 1.0)
            if R_Z > ROUGHEST:
                raise UserError(f"R_Z = {float(R_Z):g} m is no roughness; give it in m, worn rails have 1e-5")
        return RoughSurface(heights, value(R_Z))

    @property
    def solids(self) -> tuple[Solid, Solid]:
        """Of wheel and rail."""
        return Solid(self.wheel.young, self.wheel.poisson), Solid(self.rail.young, self.rail.poisson)

    def track(self, folder: Path) -> Track:
        """Of files beside the case.

        Raises:
            UserError: profiles that are none.
        """
        elastic = combined(*self.solids)
        rail = self.rail.made(folder, 1.0).turned(self.rail.inclination)
        return Track(self.wheel.made(folder, -1.0), rail, self.wheel.radius, self.wheel.at, self.rail.at, elastic)

    def posed(self) -> Pose:
        p = self.pose
        return Pose(p.lateral, p.yaw, p.roll, p.speed, p.turning)


def load_rolling(path: Path | str, assignments: Sequence[str] | None = None) -> tuple[RollingCase, dict[str, Any]]:
    """A rolling case (SI units); see `read_settings`."""
    return read_settings(RollingCase, path, assignments)

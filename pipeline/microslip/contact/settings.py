"""contact.toml: what a person may write about one contact, checked, with every mistake named by its key.

`load_contact` returns the settings in SI: every length of the file, given in `length_unit`, has become metres, every
area square metres. `study` makes laws and curves of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from ..mesh import UNITS
from ..settings.body import to_metres
from ..settings.numbers import (
    Coefficient,
    Model,
    Name,
    NotNegative,
    Number,
    Positive,
    PositiveLength,
    Positives,
    only_one,
)
from ..settings.toml import read_settings
from .friction import (
    FrictionKind,
    OfCoulomb,
    OfExponential,
    OfFalling,
    OfHeated,
    OfLubricated,
    OfStaticSliding,
    OfTable,
)
from .jenkins import OfJenkins
from .kinds import Boundary, LawKind, Lengths, PositiveLengths, kinds
from .point import OfPoint
from .rate import OfRate
from .regularised import WithMass
from .roughness import ExponentialHeights, GaussianHeights, ProfileHeights, Roughness, Shape, TableHeights
from .set_valued import OfSetValued
from .sliders import OfIwan, OfMindlin, OfStrips
from .stiffness import Given, OfBasis, OfCurve, OfHertz, OfLayer, Stiffness

if TYPE_CHECKING:  # what all kinds of a section are
    AnyStiffness = Stiffness
    AnyRoughness = Roughness
    AnyFriction = FrictionKind
    AnyLaw = LawKind
else:
    AnyStiffness = kinds("stiffness", Given, OfLayer, OfHertz, OfCurve, OfBasis)
    AnyRoughness = kinds("roughness", Shape, ExponentialHeights, GaussianHeights, TableHeights, ProfileHeights)
    AnyFriction = kinds(
        "friction", OfCoulomb, OfStaticSliding, OfFalling, OfExponential, OfHeated, OfTable, OfLubricated
    )  # fmt: skip
    AnyLaw = kinds("law", OfPoint, OfJenkins, WithMass, OfRate, OfStrips, OfIwan, OfMindlin, OfSetValued)


class Motion(Model):
    """How the contact moves: u_n > 0 closes. Each row is mean, cos, sin, cos 2, sin 2, ... of the frequency."""

    frequency: Positive
    """[Hz] of the first harmonic"""
    normal: Lengths = (0.0,)
    """u_n, positive closes: mean, cos, sin, cos 2, sin 2, ..."""
    t1: Lengths = (0.0,)
    """u_t1, likewise"""
    t2: Lengths = (0.0,)
    """u_t2, likewise"""
    normal_force: Positive | None = None
    """[N] static; instead of the mean of `normal`"""
    drift: Number = 0.0
    """[m/s] constant speed along t1 besides"""
    cycles: Annotated[int, Field(ge=1, le=1000)] = 3
    """how many; the last one is drawn"""
    samples: Annotated[int, Field(ge=16, le=100000)] = 512
    """of a cycle"""
    amplitudes: PositiveLengths = ()
    """of the hysteresis loops along t1; about the slip limit if not given"""

    @model_validator(mode="after")
    def _rows(self) -> Motion:
        for key in ("normal", "t1", "t2"):
            if not getattr(self, key):
                raise ValueError(f"{key}: is empty; give the mean, then cos and sin of each harmonic")
        if self.normal_force is not None and self.normal[0] != 0:
            raise ValueError("normal_force and the mean of normal both press the contact; keep one of the two")
        if max(len(self.normal), len(self.t1), len(self.t2)) >= self.samples:
            raise ValueError(f"samples: {self.samples} cannot hold that many harmonics; raise them")
        return self


class Temperature(Model):
    """Heat of sliding (3.6-3, 3.6-5, 3.8-4)."""

    resistance: NotNegative
    """[K m2/W] k_T: rise of temperature over heat flow"""
    limit: Positive
    """[K] dT_E: rise at which friction and shear strength would be gone"""


class Microslip(Model):
    """First loading with shear strength and heating (3.8): tangential force over displacement."""

    mu: Annotated[Coefficient, Field(gt=0)] | None = None
    """friction coefficient, cold; that of [friction] if not given"""
    speed: NotNegative = 0.0
    """[m/s] of loading, for the heat"""
    yield_shear: Positive | None = None
    """[Pa] tau_S0, shear strength, cold"""
    approaches: PositiveLengths = ()
    """one curve each"""
    normal_forces: Positives = ()
    """[N] one curve each; instead of approaches"""
    displacement: PositiveLength | None = None
    """up to which it is drawn"""

    @model_validator(mode="after")
    def _pressed(self) -> Microslip:
        if self.approaches and self.normal_forces:
            raise ValueError("approaches and normal_forces both press the contact; keep one of the two")
        return self


class Wear(Model):
    """Wear at a constant normal force (3.9): exactly one of coefficient, archard (with hardness), energy_density."""

    normal_force: Positive
    """[N] constant"""
    speed: Positive
    """[m/s] of sliding"""
    time: Positive
    """[s] of sliding"""
    mu: Annotated[Coefficient, Field(gt=0)] | None = None
    """friction coefficient; that of [friction] at the speed if not given"""
    coefficient: Positive | None = None
    """[m3/J] I_W: worn volume over frictional work"""
    archard: Positive | None = None
    """K: worn volume = K force way/hardness"""
    hardness: Positive | None = None
    """[Pa] of the softer body"""
    energy_density: Positive | None = None
    """[J/m3] Fleischer's: frictional work over worn volume"""

    @model_validator(mode="after")
    def _one_way(self) -> Wear:
        only_one(self, "coefficient", "archard", "energy_density")
        if self.archard is not None and self.hardness is None:
            raise ValueError("archard needs the hardness (Pa) of the softer body; add it")
        return self


class Limits(Model):
    """What the contact is held against: yield by Tresca (3.1-31), and the frequency of the motion (3.2-31)."""

    yield_shear: Positive | None = None
    """[Pa] tau_S, yield stress in shear: half of that in tension"""
    tolerance: Positive = 0.01
    """error of the static stiffness that is allowed (3.2-31)"""
    boundary: Boundary = "stress-free"
    """what holds the sides, for the yield check where the stiffness is not a layer's"""


def _short(kind: str, key: str, tables: Any) -> BeforeValidator:
    """A number is short for a table of one kind with that number."""

    def written_out(value: Any) -> Any:
        if isinstance(value, int | float) and not isinstance(value, bool):
            return {"kind": kind, key: float(value)}
        if value is None or isinstance(value, dict | Model):
            return value
        raise ValueError("must be a number or a table; correct it")

    return BeforeValidator(written_out, json_schema_input_type=NotNegative | tables)


def _named(value: Any) -> Any:
    """A name is short for a table of that kind."""
    if value is None or isinstance(value, dict | Model):
        return value
    if isinstance(value, str):
        return {"kind": value}
    raise ValueError("must be the name of a law, or a table; correct it")


class ContactLaw(Model):
    """What a contact is, wherever it stands: the same keys in contact.toml and in a contact of case.toml.

    A number stands for a table: R_Z of polynomial heights, Coulomb's coefficient; so does the name
    of a law.
    """

    stiffness: AnyStiffness | None = None
    """as in a [contact.toml](contact_toml.md), lengths in m, instead of the two below"""
    normal_stiffness: Positive | None = None
    """[N/m] c_N0 of the whole patch, short for stiffness of kind given; **required** where nothing
    else says it"""
    tangential_stiffness: Positive | None = None
    """[N/m] c_R0, likewise"""
    roughness: Annotated[AnyRoughness | None, _short("polynomial", "R_Z", AnyRoughness)] = None
    """[length_unit] R_Z, or a table as in a contact.toml"""
    friction: Annotated[AnyFriction | None, _short("coulomb", "mu", AnyFriction)] = None
    """coefficient, or a table as in a contact.toml; **required** without file"""
    law: Annotated[AnyLaw | None, BeforeValidator(_named, json_schema_input_type=str | AnyLaw)] = None
    """name or table of a law, as in a contact.toml, also of [another package](own_law.md);
    `rough` with roughness, `smooth` without if not given"""
    temperature: Temperature | None = None
    """heat of sliding, as in a [contact.toml](contact_toml.md)"""

    @property
    def is_pressed(self) -> bool:
        """Whether a normal force is given beside the sections."""
        return False

    @property
    def can_be_pressed(self) -> bool:
        """Whether a normal force may press it."""
        return True

    @property
    def is_elsewhere(self) -> bool:
        """Whether something else says what the contact is."""
        return False

    @property
    def unit(self) -> float:
        """m that lengths are given in by files without a unit of their own."""
        return 1.0

    @property
    def springs(self) -> Stiffness:
        """Where the stiffness comes from."""
        if self.stiffness is not None:
            return self.stiffness
        assert self.normal_stiffness is not None  # one of them is, see `_fits`
        return Given(kind="given", normal=self.normal_stiffness, tangential=self.tangential_stiffness)

    @property
    def what(self) -> LawKind:
        """The law that is given, or follows from the surface."""
        return self.law or OfPoint(kind="smooth" if self.roughness is None else "rough")

    @property
    def coefficient(self) -> float:
        """Coulomb's, 0 where friction is no single number."""
        return self.friction.mu if isinstance(self.friction, OfCoulomb) else 0.0

    @model_validator(mode="after")
    def _fits(self) -> ContactLaw:
        short = [key for key in ("normal_stiffness", "tangential_stiffness") if getattr(self, key) is not None]
        if self.stiffness is not None and short:
            raise ValueError(f"{short[0]}: is short for a table of stiffness; give one of the two")
        if self.is_elsewhere:
            return self
        if self.what.rigid:
            self.what.fits(self)
            return self
        if self.stiffness is None and self.normal_stiffness is None:
            raise ValueError("normal_stiffness: is missing; add it, or a table of stiffness")
        if self.springs.is_law and self.roughness is not None:
            raise ValueError(f'roughness: stiffness.kind = "{self.springs.kind}" is a normal law already; remove it')
        if self.friction is not None and self.heated and self.temperature is None:
            raise ValueError(f'friction: kind = "{self.friction.kind}" needs the heat of sliding; add [temperature]')
        if self.heated and not self.has_area:
            raise ValueError("stiffness.area: is missing, and [friction] needs the nominal area; add it")
        if isinstance(self.friction, OfLubricated) and self.roughness is None:
            raise ValueError("friction: a lubricated surface needs its heights; add [roughness]")
        self.what.fits(self)
        return self

    @property
    def heated(self) -> bool:
        """Whether the friction needs the heat of sliding."""
        return self.friction is not None and self.friction.heated

    @property
    def has_area(self) -> bool:
        """Whether the nominal area is known."""
        return getattr(self.stiffness, "area", None) is not None or isinstance(self.stiffness, OfBasis)


class ContactFile(ContactLaw):
    """A whole contact.toml."""

    name: Name
    """names the folder of the products, `build/NAME/`"""
    description: str = ""
    """one line for the report"""
    length_unit: Literal["m", "cm", "mm", "um", "in", "ft"] = "m"
    """unit of every length in this file; areas are its square"""
    dimensionless: bool = False
    """its numbers have no dimension, as the book's with a star: tables and pictures have no units"""
    motion: Motion | None = None
    microslip: Microslip | None = None
    wear: Wear | None = None
    limits: Limits = Limits()

    @property
    def is_pressed(self) -> bool:
        return self.motion is not None and self.motion.normal_force is not None

    @property
    def can_be_pressed(self) -> bool:
        return self.motion is None or self.is_pressed

    @property
    def unit(self) -> float:
        return UNITS[self.length_unit]

    @model_validator(mode="after")
    def _whole(self) -> ContactFile:
        for key in ("wear", "microslip"):
            if getattr(self, key) is not None and not self.has_area:
                raise ValueError(f"stiffness.area: is missing, and [{key}] needs the nominal area; add it")
        for key in ("microslip", "wear"):
            if getattr(self, key) is not None and self.roughness is None:
                raise ValueError(f"{key}: needs the heights of a rough surface; add [roughness]")
        if self.motion is not None and self.friction is None:
            raise ValueError("motion: a contact that moves needs its friction; add [friction]")
        for key in ("motion", "microslip"):
            if getattr(self, key) is not None and getattr(self.springs, "tangential", 1.0) is None:
                raise ValueError(f"stiffness.tangential: is missing, and [{key}] needs it; add it")
        if self.microslip is not None and self.microslip.mu is None and not isinstance(self.friction, OfCoulomb):
            raise ValueError('microslip.mu: is missing, and there is no friction of kind = "coulomb"; add it')
        if self.wear is not None and self.wear.mu is None and self.friction is None:
            raise ValueError("wear.mu: is missing, and there is no [friction] to take it from; add it")
        return self


def load_contact(path: Path | str, assignments: list[str] | None = None) -> ContactFile:
    """Read and check a contact file.

    Args:
        path: of the contact.toml. assignments: ``--set`` texts.

    Returns:
        The settings in SI.

    Raises:
        UserError: with every mistake named by file and key.
    """
    settings, _ = read_settings(ContactFile, path, assignments)
    return to_metres(settings, settings.unit)

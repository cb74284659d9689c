"""contact.toml: what a person may write about one contact, checked, with every mistake named by its key.

`load_contact` returns the settings in SI: every length of the file, given in `length_unit`, has become metres, every
area square metres. `study` makes laws and curves of them.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, Field, model_validator

from ..body import (
    Coefficient,
    Model,
    Name,
    NotNegative,
    Number,
    Numbers,
    Positive,
    PositiveLength,
    Positives,
    _finite_vector,
    _is_length,
    _scaled,
    _tuple,
    load_toml,
    only_one,
    override,
    validate,
)
from ..errors import UserError
from ..mesh import UNITS
from ..store import ordinary
from .curves import FORCES, LENGTHS
from .layer import BOUNDARIES
from .topography import UNITS as PROFILE_UNITS

NotNegativeLength = Annotated[NotNegative, "length"]
Lengths = Annotated[tuple[Number, ...], BeforeValidator(_finite_vector), "length"]
PositiveLengths = Annotated[tuple[Positive, ...], BeforeValidator(_finite_vector), "length"]
Radii = Annotated[tuple[float, float], BeforeValidator(_finite_vector), "length"]  # inf is flat
OneOrTwo = Positive | Annotated[tuple[Positive, Positive], BeforeValidator(_finite_vector)]
Column = Annotated[int, Field(ge=1)] | Annotated[str, Field(min_length=1)]
Columns = Annotated[tuple[Column, Column], BeforeValidator(_tuple)]
Poisson = Annotated[Number, Field(gt=-1, le=0.5)]
Boundary = Literal["stress-free", "hydrostatic", "no-lateral-strain"]
assert set(BOUNDARIES) == {"stress-free", "hydrostatic", "no-lateral-strain"}


# [stiffness] -------------------------------------------------------------------------------------------------------


class Given(Model):
    """Stiffnesses of the full area, from wherever they come: a rig, a handbook, another program."""

    kind: Literal["given"]
    normal: Positive
    tangential: OneOrTwo | None = None
    area: Positive | None = None
    includes: Literal["surface", "bulk", "bulk+surface"] = "bulk"


class LayerSource(Model):
    """An elastic layer under the contact (3.1): c_N0 = E~ A/l_0, c_R0 = G A/l_0."""

    kind: Literal["layer"]
    young: Positive
    poisson: Poisson
    shear: Positive | None = None
    thickness: PositiveLength
    area: Positive
    boundary: Boundary = "stress-free"
    density: Positive | None = None


class HertzSource(Model):
    """Two curved bodies (Hertz, Mindlin): F = C u^(3/2), tangential stiffness in proportion to the normal one."""

    kind: Literal["hertz"]
    young: Positive
    poisson: Poisson
    radii: Radii
    young_2: Positive | None = None
    poisson_2: Poisson | None = None
    radii_2: Radii = (math.inf, math.inf)
    angle: Number = 0.0
    axis: Literal[0, 1] = 0


class CurveSource(Model):
    """A measured curve of force over displacement, or one of `microslip closure`, in a file of columns."""

    kind: Literal["curve"]
    file: Annotated[str, Field(min_length=1)]
    tangential: OneOrTwo | None = None
    columns: Columns = (1, 2)
    displacement_unit: Literal[tuple(LENGTHS)] = "um"  # type: ignore[valid-type]
    force_unit: Literal[tuple(FORCES)] = "N"  # type: ignore[valid-type]
    gap: bool = False
    noise: NotNegative = 0.0
    area: Positive | None = None
    includes: Literal["surface", "bulk", "bulk+surface"] = "bulk+surface"


class BasisSource(Model):
    """A local static finite-element model: what a patch of a modal file yields beyond its eigenmodes."""

    kind: Literal["basis"]
    file: Annotated[str, Field(min_length=1)]
    interface: Name
    facing: Name | None = None


Stiffness = Annotated[Given | LayerSource | HertzSource | CurveSource | BasisSource, Field(discriminator="kind")]

# [roughness] -------------------------------------------------------------------------------------------------------


class Shape(Model):
    """A cumulative height distribution by its formula: polynomial (3.3-4) or linear (3.3-29)."""

    kind: Literal["polynomial", "linear"]
    R_Z: PositiveLength
    R_Z_other: NotNegativeLength = 0.0


class ExponentialHeights(Model):
    """Exponential heights (3.3-34), whose peaks beyond u = 0 are cut off."""

    kind: Literal["exponential"]
    R_Z: PositiveLength
    rate: Positive = 4.0
    R_Z_other: NotNegativeLength = 0.0


class GaussianHeights(Model):
    """Gaussian heights (3.3-7), whose peaks beyond u = 0 are cut off."""

    kind: Literal["gaussian"]
    R_Z: PositiveLength
    mean: Positive = 0.5
    deviation: Positive = 20**-0.5
    R_Z_other: NotNegativeLength = 0.0


class TableHeights(Model):
    """A table: depths below the highest peak, and the share of the area that is higher, from 0 to 1."""

    kind: Literal["table"]
    R_Z: PositiveLength | None = None
    depth: Lengths = ()
    share: Numbers = ()
    file: str | None = None
    columns: Columns = (1, 2)
    R_Z_other: NotNegativeLength = 0.0

    @model_validator(mode="after")
    def _one_way(self) -> TableHeights:
        if (self.file is None) == (not self.depth):
            raise ValueError("heights of a table need either file, or depth and share; keep one of the two ways")
        if len(self.depth) != len(self.share):
            raise ValueError(f"{len(self.depth)} depths and {len(self.share)} shares; give one share a depth")
        return self


class ProfileHeights(Model):
    """A measured surface profile: columns of way and height, or the file of an instrument."""

    kind: Literal["profile"]
    file: Annotated[str, Field(min_length=1)]
    unit: Literal[tuple(PROFILE_UNITS)] = "um"  # type: ignore[valid-type]
    way_unit: Literal[tuple(PROFILE_UNITS)] | None = None  # type: ignore[valid-type]
    columns: Columns = (1, 2)
    level: Annotated[int, Field(ge=0, le=10)] | Literal["none"] = 1
    R_Z_other: NotNegativeLength = 0.0


Roughness = Annotated[
    Shape | ExponentialHeights | GaussianHeights | TableHeights | ProfileHeights, Field(discriminator="kind")
]

# [friction] --------------------------------------------------------------------------------------------------------


class Random(Model):
    """Scatter in time, for every characteristic: mean times 1 + deviation xi(t)."""

    deviation: NotNegative = 0.0
    memory: Positive = 1e-3
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0


class CoulombFriction(Random):
    """The same coefficient at every speed."""

    kind: Literal["coulomb"]
    mu: Coefficient


class StaticSlidingFriction(Random):
    """One coefficient for sticking, a lower one for sliding."""

    kind: Literal["static-sliding"]
    static: Coefficient
    sliding: Coefficient


class FallingFriction(Random):
    """mu_0/(1 + p_v v) (3.6-15)."""

    kind: Literal["falling"]
    mu_0: Coefficient
    p_v: NotNegative


class ExponentialFriction(Random):
    """(mu_0 - mu_inf) exp(-rate v) + mu_inf (4.1-22)."""

    kind: Literal["exponential"]
    mu_0: Coefficient
    mu_inf: Coefficient
    rate: NotNegative


class HeatedFriction(Random):
    """Linear loss with the temperature that sliding makes (3.6-3, 3.6-5); needs [temperature] and an area."""

    kind: Literal["heated"]
    mu_0: Coefficient


class TableFriction(Random):
    """A measured table of the coefficient over the speed, shifted by the temperature as rubber is (WLF)."""

    kind: Literal["table"]
    file: Annotated[str, Field(min_length=1)]
    columns: Columns = (1, 2)
    temperature: Positive = 293.15
    reference: Positive = 293.15
    c_1: Number = 8.86
    c_2: Positive = 101.6


class LubricatedFriction(Random):
    """Dry and fluid part of a lubricated rough surface (3.6-21): drawn; laws take the dry part (heated)."""

    kind: Literal["lubricated"]
    mu_0: Annotated[Coefficient, Field(gt=0)]
    viscosity: NotNegative
    film: Annotated[Number, Field(gt=0, lt=1)] = 0.01


Friction = Annotated[
    CoulombFriction | StaticSlidingFriction | FallingFriction | ExponentialFriction | HeatedFriction | TableFriction
    | LubricatedFriction,
    Field(discriminator="kind"),
]  # fmt: skip

# [element] ---------------------------------------------------------------------------------------------------------


class Massless(Model):
    """The point contact element without mass (3.7): a return map with exact stick."""

    kind: Literal["massless"] = "massless"
    damping: NotNegative = 0.0
    length: PositiveLength | None = None
    preload: Positive | None = None


class WithMass(Model):
    """The point contact element with a mass and smoothed friction (3.7-19 to 3.7-44): a differential equation."""

    kind: Literal["with-mass"]
    mass: Positive
    slope: Positive
    damping: NotNegative = 0.0
    length: PositiveLength | None = None
    printed: bool = False


class StripsElement(Model):
    """Microslip by the strips of the rough surface (5.2-33), Coulomb friction in each."""

    kind: Literal["strips"]
    count: Annotated[int, Field(ge=2, le=500)] = 32


class IwanElement(Model):
    """Microslip by Iwan's sliders in parallel; with an exponent by Segalman's four parameters."""

    kind: Literal["iwan"]
    count: Annotated[int, Field(ge=2, le=500)] = 32
    weakest: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    exponent: Annotated[Number, Field(gt=-1, le=0)] | None = None
    ratio: NotNegative = 0.0


class MindlinElement(Model):
    """Microslip of a Hertzian contact (Cattaneo, Mindlin) under a varying load; needs stiffness.kind = "hertz"."""

    kind: Literal["mindlin"]
    count: Annotated[int, Field(ge=2, le=500)] = 32


Element = Annotated[Massless | WithMass | StripsElement | IwanElement | MindlinElement, Field(discriminator="kind")]

# the rest ----------------------------------------------------------------------------------------------------------


class Motion(Model):
    """How the contact moves: u_n > 0 closes. Each row is mean, cos, sin, cos 2, sin 2, ... of the frequency."""

    frequency: Positive
    normal: Lengths = (0.0,)
    t1: Lengths = (0.0,)
    t2: Lengths = (0.0,)
    normal_force: Positive | None = None
    drift: Number = 0.0
    cycles: Annotated[int, Field(ge=1, le=1000)] = 3
    samples: Annotated[int, Field(ge=16, le=100000)] = 512
    amplitudes: PositiveLengths = ()

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
    limit: Positive


class Microslip(Model):
    """First loading with shear strength and heating (3.8): tangential force over displacement."""

    mu: Annotated[Coefficient, Field(gt=0)] | None = None
    speed: NotNegative = 0.0
    yield_shear: Positive | None = None
    approaches: PositiveLengths = ()
    normal_forces: Positives = ()
    displacement: PositiveLength | None = None

    @model_validator(mode="after")
    def _pressed(self) -> Microslip:
        if self.approaches and self.normal_forces:
            raise ValueError("approaches and normal_forces both press the contact; keep one of the two")
        return self


class Wear(Model):
    """Wear at a constant normal force (3.9): exactly one of coefficient, archard (with hardness), energy_density."""

    normal_force: Positive
    speed: Positive
    time: Positive
    mu: Annotated[Coefficient, Field(gt=0)] | None = None
    coefficient: Positive | None = None
    archard: Positive | None = None
    hardness: Positive | None = None
    energy_density: Positive | None = None

    @model_validator(mode="after")
    def _one_way(self) -> Wear:
        only_one(self, "coefficient", "archard", "energy_density")
        if self.archard is not None and self.hardness is None:
            raise ValueError("archard needs the hardness (Pa) of the softer body; add it")
        return self


class Limits(Model):
    """What the contact is held against: yield by Tresca (3.1-31), and the frequency of the motion (3.2-31)."""

    yield_shear: Positive | None = None
    tolerance: Positive = 0.01
    boundary: Boundary = "stress-free"


class ContactFile(Model):
    """A whole contact.toml."""

    name: Name
    description: str = ""
    length_unit: Literal["m", "cm", "mm", "um", "in", "ft"] = "m"
    stiffness: Stiffness
    roughness: Roughness | None = None
    friction: Friction | None = None
    element: Element = Massless()
    motion: Motion | None = None
    microslip: Microslip | None = None
    wear: Wear | None = None
    temperature: Temperature | None = None
    limits: Limits = Limits()

    @model_validator(mode="after")
    def _whole(self) -> ContactFile:
        area = getattr(self.stiffness, "area", None)
        curved = isinstance(self.stiffness, HertzSource | CurveSource)
        if curved and self.roughness is not None:
            raise ValueError(f'roughness: stiffness.kind = "{self.stiffness.kind}" is a normal law already; '
                             "remove [roughness]")  # fmt: skip
        heated = isinstance(self.friction, HeatedFriction | LubricatedFriction)
        if heated and self.temperature is None:
            raise ValueError(f'friction: kind = "{self.friction.kind}" needs the heat of sliding; '  # type: ignore[union-attr]
                             "add [temperature]")  # fmt: skip
        for key, wanted in (("friction", heated), ("wear", self.wear), ("microslip", self.microslip)):
            if wanted and area is None and not isinstance(self.stiffness, BasisSource):
                raise ValueError(f"stiffness.area: is missing, and [{key}] needs the nominal area; add it")
        for key in ("microslip", "wear"):
            if getattr(self, key) is not None and self.roughness is None:
                raise ValueError(f"{key}: needs the heights of a rough surface; add [roughness]")
        if isinstance(self.friction, LubricatedFriction) and self.roughness is None:
            raise ValueError("friction: a lubricated surface needs its heights; add [roughness]")
        self._element()
        if self.motion is not None and self.friction is None:
            raise ValueError("motion: a contact that moves needs its friction; add [friction]")
        for key in ("motion", "microslip"):
            if getattr(self, key) is not None and getattr(self.stiffness, "tangential", 1.0) is None:
                raise ValueError(f"stiffness.tangential: is missing, and [{key}] needs it; add it")
        if self.microslip is not None and self.microslip.mu is None and not isinstance(self.friction, CoulombFriction):
            raise ValueError('microslip.mu: is missing, and there is no friction of kind = "coulomb"; add it')
        if self.wear is not None and self.wear.mu is None and self.friction is None:
            raise ValueError("wear.mu: is missing, and there is no [friction] to take it from; add it")
        return self

    def _element(self) -> None:
        kind = self.element.kind
        if kind in ("strips", "iwan", "mindlin") and not isinstance(self.friction, CoulombFriction):
            raise ValueError(f'element: kind = "{kind}" slides by Coulomb; write [friction] kind = "coulomb"')
        if kind in ("strips", "iwan", "mindlin") and getattr(self.friction, "deviation", None):
            raise ValueError(f'element: "{kind}" takes no friction that scatters; remove friction.deviation')
        if kind == "strips" and self.roughness is None:
            raise ValueError("element: strips are those of a rough surface; add [roughness]")
        if kind == "mindlin" and not isinstance(self.stiffness, HertzSource):
            raise ValueError('element: "mindlin" is the partial slip of curved bodies; write stiffness.kind = "hertz"')
        length = getattr(self.element, "length", None)
        if length is not None and self.roughness is None:
            raise ValueError("element.length: the hyperbolic law needs a rough surface; add [roughness]")
        preload = getattr(self.element, "preload", None)
        if preload is not None and (self.roughness is not None or self.motion and self.motion.normal_force):
            raise ValueError("element.preload: a constant force has neither roughness nor another force beside it; "
                             "remove [roughness] and motion.normal_force")  # fmt: skip


def load_contact(path: Path | str, assignments: list[str] | None = None) -> ContactFile:
    """Read and check a contact file.

    Args:
        path: of the contact.toml. assignments: ``--set`` texts.

    Returns:
        The settings in SI.

    Raises:
        UserError: with every mistake named by file and key.
    """
    path = Path(path)
    raw = override(load_toml(path), assignments or [], path)
    settings = validate(ContactFile, raw, path)
    return _to_metres(settings, UNITS[settings.length_unit])


def _to_metres(model: Any, scale: float) -> Any:
    """Multiply every number marked as a length, and every area by the square, at any depth."""
    if not isinstance(model, BaseModel):
        return model
    update = {}
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if name == "area":
            update[name] = _scaled(value, scale**2)
        else:
            update[name] = _scaled(value, scale) if _is_length(field) else _to_metres(value, scale)
    return model.model_copy(update=update)


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

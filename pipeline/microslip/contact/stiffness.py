"""Where the stiffness of a contact comes from: the kinds of [stiffness]."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from ..basis import read_basis
from ..errors import UserError
from ..settings.numbers import Name, NotNegative, Number, Positive, PositiveLength
from .curves import FORCES, LENGTHS, read_curve
from .hertz import Hertz, half_curvatures
from .kinds import Boundary, Columns, FileName, Kind, OneOrTwo, Poisson, Radii, beside
from .law import value
from .layer import Layer
from .normal import Normal, Penalty, Potential, measured
from .series import BULK, ContactStiffness, of_layer, of_patch
from .solids import Solid

HERTZ_DEPTH = 1e-6
"""m, approach at which the numbers of a Hertzian contact as a power law are taken; the law is the same for any."""


@dataclass(frozen=True)
class Source:
    """What a kind of stiffness says.

    Attributes:
        normal: c_N0, N/m. stiffness: of the full area; None without a tangential one. area: nominal, m2, or None. law:
            the normal law of smooth surfaces. layer, hertz: where the numbers come from one.
    """

    normal: float
    stiffness: ContactStiffness | None
    area: float | None
    law: Normal
    layer: Layer | None = None
    hertz: Hertz | None = None


class Stiffness(Kind):
    """Where the stiffness of the full area comes from.

    Attributes:
        is_law: whether it is a normal law by itself, to which no roughness belongs.
    """

    is_law: ClassVar[bool] = False
    kind: str
    """its [source](contact_stiffness.md)"""

    def source(self, path: Path) -> Source:
        """What the contact file at a path makes of it.

        Raises:
            UserError: with its key in the section.
        """
        raise NotImplementedError


class Given(Stiffness):
    """Stiffnesses of the full area, from wherever they come: a rig, a handbook, another program."""

    kind: Literal["given"]
    normal: Positive
    """[N/m] c_N0"""
    tangential: OneOrTwo | None = None
    """[N/m] c_R0; or two, along t1 and t2"""
    area: Positive | None = None
    """[length_unit²] A_0, nominal area; needed for yield, heat, microslip and wear"""
    includes: Literal["surface", "bulk", "bulk+surface"] = "bulk"
    """which compliance the numbers count"""

    def source(self, path: Path) -> Source:
        law = Penalty(value(self.normal))
        return Source(self.normal, _both(self.normal, self.tangential, self.includes), self.area, law)


class OfLayer(Stiffness):
    """An elastic layer under the contact (3.1): c_N0 = E~ A/l_0, c_R0 = G A/l_0."""

    kind: Literal["layer"]
    young: Positive
    """[Pa] E"""
    poisson: Poisson
    """nu"""
    shear: Positive | None = None
    """[Pa] G, if it is not E/2(1 + nu)"""
    thickness: PositiveLength
    """l_0, depth of the layer"""
    area: Positive
    """[length_unit²] A_0, nominal area; needed for yield, heat, microslip and wear"""
    boundary: Boundary = "stress-free"
    """what holds the sides of the layer (3.1)"""
    density: Positive | None = None
    """[kg/m3] for the limit of application"""

    def source(self, path: Path) -> Source:
        layer = Layer(Solid(self.young, self.poisson, self.shear), self.thickness, self.boundary, self.density)
        found = of_layer(layer, self.area)
        return Source(found.normal, found, self.area, Penalty(value(found.normal)), layer)


class OfHertz(Stiffness):
    """Two curved bodies (Hertz, Mindlin): F = C u^(3/2), tangential stiffness in proportion to the normal one."""

    kind: Literal["hertz"]
    young: Positive
    """[Pa] E, of the first body"""
    poisson: Poisson
    """nu"""
    radii: Radii
    """principal radii of the first body: inf is flat, negative is hollow"""
    young_2: Positive | None = None
    """[Pa] of the second body; the first one's if not given"""
    poisson_2: Poisson | None = None
    """nu, likewise"""
    radii_2: Radii = (math.inf, math.inf)
    """of the second body"""
    angle: Number = 0.0
    """[rad] of the second body's first axis from the first one's"""
    axis: Literal[0, 1] = 0
    """of the ellipse, 0 or 1, that t1 lies along"""

    is_law: ClassVar[bool] = True

    def source(self, path: Path) -> Source:
        first = Solid(self.young, self.poisson)
        second = Solid(self.young_2 or self.young, self.poisson if self.poisson_2 is None else self.poisson_2)
        A, B, _ = half_curvatures(self.radii, self.radii_2, self.angle)
        hertz = Hertz(first, second, A, B)
        force = float(hertz.force(HERTZ_DEPTH))
        normal = 1.5 * force / HERTZ_DEPTH
        x, y = hertz.tangential_ratio
        t1, t2 = (y, x) if self.axis else (x, y)
        both = ContactStiffness(normal, (t1 * normal, t2 * normal), BULK, f"Hertz at {1e6 * HERTZ_DEPTH:g} µm")
        return Source(normal, both, None, Potential(value(force), value(HERTZ_DEPTH), value(1.5)), hertz=hertz)


class OfCurve(Stiffness):
    """A measured curve of force over displacement, or one of `microslip closure`, in a file of columns."""

    kind: Literal["curve"]
    file: FileName
    """columns of the curve, sought beside this file"""
    tangential: OneOrTwo | None = None
    """[N/m] c_R0; or two, along t1 and t2"""
    columns: Columns = (1, 2)
    """of displacement and force, counted from 1 or by name"""
    displacement_unit: Literal[tuple(LENGTHS)] = "um"  # type: ignore[valid-type]
    """in the curve's file"""
    force_unit: Literal[tuple(FORCES)] = "N"  # type: ignore[valid-type]
    """in the curve's file"""
    gap: bool = False
    """the displacement of the file opens the contact"""
    noise: NotNegative = 0.0
    """[N] by which the force may fall between neighbours; evened then"""
    area: Positive | None = None
    """[length_unit²] A_0, nominal area; needed for yield, heat, microslip and wear"""
    includes: Literal["surface", "bulk", "bulk+surface"] = "bulk+surface"
    """which compliance the numbers count"""

    is_law: ClassVar[bool] = True

    def source(self, path: Path) -> Source:
        file = beside(path, self.file)
        units = self.displacement_unit, self.force_unit
        law = measured(read_curve(file, *self.columns, *units, self.gap, self.noise, self.includes))
        normal = float(law.nominal)
        return Source(normal, _both(normal, self.tangential, self.includes), self.area, law)


class OfBasis(Stiffness):
    """A local static finite-element model: what a patch of a modal file yields beyond its eigenmodes."""

    kind: Literal["basis"]
    file: FileName
    """a modal file, sought beside this one"""
    interface: Name
    """name of the contact in the modal file"""
    facing: Name | None = None
    """the other contact of the same body that is closed at the same time"""

    def source(self, path: Path) -> Source:
        basis = read_basis(beside(path, self.file))
        group = basis.groups[0, 0]
        for key, name in (("interface", self.interface), ("facing", self.facing)):
            if name is not None and name not in group.interfaces:
                known = ", ".join(group.interfaces) or "none"
                raise UserError(f"the modal file of '{basis.name}' has no interface '{name}'; it has {known}", key)
        found = of_patch(group, basis.reduction, self.interface, self.facing or "", basis.sectors)
        area = float(np.sum(group.interfaces[self.interface].areas))
        return Source(found.normal, found, area, Penalty(value(found.normal)))


def _both(normal: float, tangential: float | tuple[float, float] | None, includes: str) -> ContactStiffness | None:
    if tangential is None:
        return None
    pair = tangential if isinstance(tangential, tuple) else (tangential, tangential)
    return ContactStiffness(normal, pair, includes)

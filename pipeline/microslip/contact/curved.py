"""Curved faces: pins and wires in their holes. Gaps of the points, lines of contact, and the foundation that fits them.

Points on springs know nothing of each other (Winkler's elastic foundation): pressed by a curved body they carry a
parabola of pressure, an elastic half-space carries Hertz' ellipse. One modulus fits one number at one load, and
`Foundation` says how far off the others are. Johnson, Contact Mechanics, 4.2 and 4.3; Sextro, section 5.5.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ..data import Array
from ..errors import UserError
from ..reduced.compliance import SURFACE
from .curves import NormalCurve
from .hertz import Hertz
from .law import Law, value
from .normal import Gapped, Normal, Preload
from .portion import Portion
from .sliders import Strips
from .solids import Solid, doubles, mean_inverse_distance, normal_modulus

Match = Literal["approach", "width"]

WIDEST = 2 / 3
"""Share of its strip that a line of contact may be wide: from 0.89 on, the strip's own yielding under uniform pressure
is larger than all that the line adds to a growing force."""


def in_hole(pin: float, hole: float) -> float:
    """Relative radius R (m) of a pin in a hole: 1/R = 1/r_pin - 1/r_hole.

    Raises:
        UserError: a pin that is not thinner than its hole.
    """
    if not 0 < pin < hole:
        raise UserError(f"radii: a pin of radius {pin:g} m does not fit in a hole of radius {hole:g} m with play")
    return pin * hole / (hole - pin)


def gap(points: Array, radii: tuple[float, float]) -> Array:
    """(n,) initial gap of the points (n, 2), m: y^2/(2 R_1) + z^2/(2 R_2), relative radii along t1 and t2, inf flat.

    Raises:
        UserError: a radius that is not positive: such faces touch at their rims.
    """
    if not min(radii) > 0:
        raise UserError(f"curvature: radii of {radii[0]:g} and {radii[1]:g} m; relative ones are positive, inf if flat")
    return points[:, 0] ** 2 / (2 * radii[0]) + points[:, 1] ** 2 / (2 * radii[1])


def apart(law: Law, gap: Array) -> Law:
    """The law of points that begin to touch later, by a gap (n,) in m for each.

    Raises:
        UserError: a law whose normal force no motion changes.
    """
    if isinstance(law, Portion):
        return replace(law, whole=apart(law.whole, gap))
    if isinstance(law, Strips) and law.held is None:
        return replace(law, at=jnp.asarray(law.at) + jnp.asarray(gap) / law.depth)
    whole: Any = law
    normal = getattr(whole, "normal", None)
    if isinstance(normal, Normal) and not isinstance(normal, Preload):
        return replace(whole, normal=Gapped(normal, value(gap)))
    raise UserError("the law's normal force is given and not found from the approach; take another law")


@dataclass(frozen=True)
class Line:
    """Two cylinders along a line, or a cylinder in a hole: Hertz' line contact, plane strain.

    Attributes:
        first, second: materials. radius: relative, m (`in_hole`). length: of the line, m.
        modulus: E*, Pa.

    Raises:
        UserError: a radius or a length that is not positive, two rigid bodies.
    """

    first: Solid
    second: Solid
    radius: float
    length: float
    modulus: float = field(init=False)

    def __post_init__(self) -> None:
        if not (0 < self.radius < np.inf and 0 < self.length < np.inf):
            raise UserError(f"line contact: radius {self.radius:g} m, length {self.length:g} m; both must be positive")
        object.__setattr__(self, "modulus", normal_modulus(self.first, self.second))

    def half_width(self, force: ArrayLike) -> Array:
        """a (m) under a normal force (N): a^2 = 4 F R / (pi E* l)."""
        F = doubles(force)
        return np.sqrt(4 * F * self.radius / (np.pi * self.modulus * self.length))

    def force_of(self, half_width: ArrayLike) -> Array:
        """The inverse of `half_width`, N."""
        return np.pi * self.modulus * self.length * doubles(half_width) ** 2 / (4 * self.radius)

    def largest_pressure(self, force: ArrayLike) -> Array:
        """2 F / (pi a l), Pa, in the middle; zero without force."""
        a, F = self.half_width(force), doubles(force)
        return np.divide(2 * F, np.pi * a * self.length, out=np.zeros_like(a), where=a > 0)

    def pressure(self, force: float, x: ArrayLike) -> Array:
        """Pressure (Pa) at distances (m) from the line; zero outside."""
        inside = 1 - (doubles(x) / self.half_width(force)) ** 2
        return self.largest_pressure(force) * np.sqrt(np.maximum(inside, 0.0))

    def approach(self, force: ArrayLike, strip: float) -> Array:
        """Approach (m) of the bodies beyond the mean one of a strip (m wide) under uniform pressure.

        A line has no approach of its own: in the plane it grows with the logarithm of the distance it is measured to.
        What a body yields under uniform pressure on its strip stands in its modes; the rest is local, and the
        logarithm of the distance drops out: with u(x) = -2/(pi E*) int p(s) ln|x - s| ds of both,

            delta = 2 F / (pi E* l) (ln(2 w / a) - 1).

        So the compliance of the bodies is counted once, as long as the line is narrow: see `WIDEST`.
        """
        F = doubles(force)
        a = np.where(F > 0, self.half_width(F), strip)
        return 2 * F / (np.pi * self.modulus * self.length) * (np.log(2 * strip / a) - 1)

    def stiffness(self, force: ArrayLike, strip: float) -> Array:
        """dF/d(delta) of `approach`, N/m; zero without force."""
        F = doubles(force)
        a = np.where(F > 0, self.half_width(F), strip)
        k = np.pi * self.modulus * self.length / (2 * (np.log(2 * strip / a) - 1.5))
        return np.where(F > 0, k, 0.0)

    def curve(self, largest: float, strip: float, count: int = 81) -> NormalCurve:
        """`approach` as a normal law up to a force (N), straight beyond: the whole contact as one point.

        Raises:
            UserError: a force under which the line of contact fills its strip, see `WIDEST`.
        """
        wide = 2 * float(self.half_width(max(largest, 0.0)))
        if not largest > 0 or wide > WIDEST * strip:
            raise UserError(
                f"line contact: under {largest:g} N it is {1e3 * wide:.3g} mm wide "
                f"and its face {1e3 * strip:.3g} mm; give a positive force, or a face wider by half at least"
            )
        F = largest * np.linspace(0, 1, count) ** 3
        return NormalCurve(self.approach(F, strip), F, self.stiffness(F, strip), SURFACE, f"line to {largest:g} N")

    @property
    def tangential_ratio(self) -> tuple[float, float]:
        """(around, along): tangential over normal stiffness while all of the line sticks, across and along the line.

        A tangential force makes the traction Q / (pi sqrt(a^2 - x^2)), a growing normal one the same (Johnson 7.2), so
        that the logarithms agree: around, plane strain with the same 2/(pi E*) makes it 1; along, antiplane shear with
        (1/G_1 + 1/G_2)/pi makes it 1 - nu of equal bodies. As for a circle the ratio holds at every load.
        """
        return 1.0, float(2 / self.modulus / (1 / self.first.shear + 1 / self.second.shear))


def point_curve(contact: Hertz, largest: float, face: tuple[float, float], count: int = 81) -> NormalCurve:
    """Hertz' approach beyond the mean one of a face (m x m) under uniform pressure, as for `Line.approach`.

    The face yields as a rectangle on two half-spaces would; the finite elements of the bodies say so too where the
    face lies far from their edges.

    Raises:
        UserError: a force under which the contact fills its face.
    """
    held = mean_inverse_distance(*face) / (np.pi * contact.modulus)
    if not largest > 0 or held * float(contact.normal_stiffness(max(largest, 0.0))) > 0.8:
        a, b = (2e3 * float(v) for v in contact.semi_axes(max(largest, 0.0)))
        raise UserError(
            f"point contact: under {largest:g} N it is {a:.3g} x {b:.3g} mm and its face {1e3 * face[0]:.3g} x "
            f"{1e3 * face[1]:.3g} mm; give a positive force, or a face some times larger"
        )
    F = largest * np.linspace(0, 1, count) ** 3
    k = contact.normal_stiffness(F)
    slopes = np.divide(k, 1 - held * k)
    return NormalCurve(contact.approach(F) - held * F, F, slopes, SURFACE, f"Hertz to {largest:g} N")


# the elastic foundation ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Foundation:
    """Springs side by side that stand for an elastic contact at one load.

    Attributes:
        stiffness: k, Pa/m. force: N, the load. match: ``approach`` or ``width``, what agrees there. approach, width,
            peak, slope: of the foundation over Hertz' at that load: approach, half width (the longer half axis), the
            largest pressure, dF/d(delta).
    """

    stiffness: float
    force: float
    match: Match
    approach: float
    width: float
    peak: float
    slope: float

    @property
    def sentence(self) -> str:
        """For a reader."""
        far = ", ".join(
            f"{name} {100 * (value - 1):+.0f} %"
            for name, value in (("approach", self.approach), ("width", self.width), ("largest pressure", self.peak),
                                ("stiffness", self.slope))
        )  # fmt: skip
        return (f"An elastic foundation of {self.stiffness:.4g} Pa/m agrees with Hertz in {self.match} at "
                f"{self.force:.4g} N; against Hertz: {far}.")  # fmt: skip


def foundation_of_line(line: Line, force: float, strip: float, match: Match = "approach") -> Foundation:
    """Of F = 4/3 k l sqrt(2 R) delta^(3/2), a^2 = 2 R delta, p_0 = k delta.

    ``width``: k = (3 pi / 8) E*/a (Johnson 4.3: 1.18 E*/a); then the pressure in the middle is 3 pi / 8 = 1.18 of
    Hertz' at every such load.

    Args:
        force: N. strip: width (m) of the face whose own yielding the bodies hold, see `Line.approach`.

    Raises:
        UserError: no force, or one that makes the line wider than the strip.
    """
    R, length = line.radius, line.length
    line.curve(force, strip)  # a force that the strip carries
    a, approach = float(line.half_width(force)), float(line.approach(force, strip))
    delta = approach if match == "approach" else a * a / (2 * R)
    k = force / (4 / 3 * length * np.sqrt(2 * R) * delta**1.5)
    width, peak = float(np.sqrt(2 * R * delta)) / a, k * delta / float(line.largest_pressure(force))
    slope = 1.5 * force / delta / float(line.stiffness(force, strip))
    return Foundation(float(k), force, match, delta / approach, width, peak, slope)


def foundation_of_point(contact: Hertz, force: float, match: Match = "approach") -> Foundation:
    """Of F = pi k delta^2 / (2 sqrt(A B)) over the ellipse A x^2 + B y^2 < delta, p_0 = k delta.

    A circle with ``width``: k = 16 E* / (3 pi a) (Johnson 4.3: 1.70 E*/a), the largest pressure 4/3 of Hertz'; with
    ``approach`` it is sqrt(2) too wide. Either way the force grows with delta^2, Hertz' with delta^(3/2), so the
    stiffness is 4/3 of Hertz' where force and approach agree.

    Raises:
        UserError: no force.
    """
    if not force > 0:
        raise UserError(f"force: {force:g} N; a foundation is fitted at a load, so it must be positive")
    approach, a = float(contact.approach(force)), float(np.max(contact.semi_axes(force)))
    least = min(contact.A, contact.B)
    delta = approach if match == "approach" else least * a * a
    k = force * 2 * np.sqrt(contact.A * contact.B) / (np.pi * delta**2)
    width, peak = float(np.sqrt(delta / least)) / a, k * delta / float(contact.largest_pressure(force))
    slope = 2 * force / delta / float(contact.normal_stiffness(force))
    return Foundation(float(k), force, match, delta / approach, width, peak, slope)

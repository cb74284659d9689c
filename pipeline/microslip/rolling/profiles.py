"""Cross-sections of wheel and rail: files, circles, polynomials (Sextro, 6.2).

y runs to the field side, z down; m. A wheel's material lies above its profile, a rail's below.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, UnivariateSpline
from scipy.optimize import minimize_scalar

from ..data import Array
from ..errors import UserError, in_its_file, of_file
from ..files import store
from ..settings.arguments import checked
from ..settings.mistakes import is_number
from ..settings.numbers import Component, NotNegative, Positive

WIDTH = 0.07
"""m, of profiles that are given by a formula."""

EVERYWHERE = (-np.inf, np.inf)


@dataclass(frozen=True)
class CrossSection:
    """A smooth curve z(y) through points.

    Attributes: y, z: (k,) m, y rising. name: for sentences. noise: standard deviation of measured z, m; the curve then
        keeps that distance from the points on average, which is what makes its curvature usable. moved: y, z of this
        origin in the axes of the drawn profile, where it has been turned, m.
    """

    y: Array
    z: Array
    name: str = "profile"
    noise: float = 0.0
    moved: tuple[float, float] = (0.0, 0.0)

    def __repr__(self) -> str:
        return f"<CrossSection {self.name}: {len(self.y)} points, y from {self.y[0]:.6g} to {self.y[-1]:.6g} m>"

    @cached_property
    def curve(self) -> CubicSpline | UnivariateSpline:
        if self.noise:
            return UnivariateSpline(self.y, self.z, k=5, s=len(self.y) * self.noise**2, ext=2)
        return CubicSpline(self.y, self.z, extrapolate=False)

    @cached_property
    def inclined(self) -> CubicSpline | UnivariateSpline:
        """The derivative of the curve."""
        return self.curve.derivative()

    def height(self, y: ArrayLike) -> Array:
        """z, m; NaN beyond its ends."""
        return self._of(self.curve, y)

    def slope(self, y: ArrayLike) -> Array:
        """dz/dy; NaN beyond its ends."""
        return self._of(self.inclined, y)

    def _of(self, curve: CubicSpline | UnivariateSpline, y: ArrayLike) -> Array:
        at = np.asarray(y, dtype=float)
        inside = (at >= self.y[0]) & (at <= self.y[-1])
        return np.where(inside, curve(np.clip(at, self.y[0], self.y[-1])), np.nan)

    def turned(self, angle: float) -> CrossSection:
        """Inclined by an angle (rad) towards the track: a canted rail. Its origin is the point that is highest then."""
        if not angle:
            return self
        c, s = np.cos(angle), np.sin(angle)
        y, z = c * self.y + s * self.z, c * self.z - s * self.y
        with of_file(self.name):
            turned = _checked(y, z, self.name, self.noise)
        at = np.clip(np.argmin(z), 1, len(z) - 2)
        top = minimize_scalar(turned.height, bounds=sorted((y[at - 1], y[at + 1])), method="bounded").x
        high = float(turned.height(top))
        moved = float(c * top - s * high), float(c * high + s * top)
        return replace(turned, y=turned.y - top, z=turned.z - high, moved=moved)


def polynomial(coefficients: Sequence[float], width: float = WIDTH) -> CrossSection:
    """z = c_0 y^2 + c_1 y^3 + ... over the width, m (6.2-12)."""
    y = np.linspace(-0.5 * width, 0.5 * width, 401)
    return CrossSection(y, sum((c * y ** (k + 2) for k, c in enumerate(coefficients)), np.zeros_like(y)))


def has_arc(radius: float, width: float) -> bool:
    return 0 < width < 1.8 * abs(radius)


@checked
def circle(radius: Component, width: Positive = WIDTH) -> CrossSection:
    """An arc that falls to both sides of the origin, as a convex rail or a hollow wheel; a negative radius rises, m.

    Raises:
        UserError: an arc as wide as its circle; numbers that are none.
    """
    if not has_arc(radius, width):
        raise UserError(f"profile: a radius of {radius:g} m has no arc {width:g} m wide; correct one of them")
    y = np.linspace(-0.5 * width, 0.5 * width, 401)
    return CrossSection(y, np.sign(radius) * (abs(radius) - np.sqrt(radius**2 - y**2)))


Mirror = Literal["", "y", "z", "yz"]
MINIPROF = (".ban", ".whl")
DEEP = 0.015
"""m, that a profile is high if it has a flange, or is that of a rail with its sides."""


@checked
@in_its_file
def read_profile(
    path: Path | str, noise: NotNegative = 0.0, unit: Positive = 1e-3, mirror: Mirror = "",
    between: Sequence[float] = EVERYWHERE,
) -> CrossSection:  # fmt: skip
    """A profile of a file: ``.prr`` and ``.prw`` (points between point.begin and point.end), MiniProf's ``.ban`` and
    ``.whl``, or a table of y and z with commas or blanks between.

    Args:
        noise: see `CrossSection`. unit: of the numbers of a table, m. mirror: axes that run the other way in the file;
            those of MiniProf do not tell. between: y that are kept, m, after that.

    Raises:
        UserError: no file, no numbers; points that turn back or of another unit; arguments that are none.
    """
    path = Path(path)
    if len(between) != 2 or not between[0] < between[1]:
        raise UserError(f"between: is {between!r}; give two y, m, the lower one first")
    try:
        lines = store.ordinary(path).read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"cannot be read as a profile ({error}); correct the path") from error
    lines = [line.split("!")[0].split("#")[0].strip() for line in lines]
    sign, shift = np.ones(2), np.zeros(2)
    if path.suffix.lower() in MINIPROF:
        unit, lines = 1e-3, _miniprof(lines)
    if comma := next((line for line in lines if DECIMAL_COMMA.search(line)), None):
        raise UserError(f"writes decimal commas ({comma}); write decimal points")
    if "point.begin" in lines:
        begin, end = lines.index("point.begin"), lines.index("point.end") if "point.end" in lines else len(lines)
        unit, sign, shift = _header(lines[:begin])
        lines = lines[begin + 1 : end]
        rows = [line.replace(",", " ").replace(";", " ").split()[:2] for line in lines if line]
    else:
        rows = _table([line for line in lines if line])
    try:
        points = np.array([[float(v) for v in row] for row in rows])
    except ValueError as error:
        raise UserError(f"{error}; a profile is a table of y and z") from error
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 5 or not np.isfinite(points).all():
        raise UserError("has no five points of y and z; a profile is a table of both")
    y, z = ((points + shift) * sign * unit * [1 - 2 * (axis in mirror) for axis in "yz"]).T
    kept = (y >= between[0]) & (y <= between[1])
    if kept.sum() < 5:
        raise UserError(f"has no five points between {between[0]:g} and {between[1]:g} m; correct that")
    y, z = y[kept], z[kept]
    middle = float(np.median(z))
    if np.ptp(z) > DEEP and middle - z.min() > z.max() - middle:
        other = mirror.replace("z", "") if "z" in mirror else mirror + "z"
        raise UserError(
            f"lies upside down with mirror = {mirror!r}, as flanges and sides of a head reach down and z with "
            f"them; set mirror = {other!r}"
        )
    return _checked(y, z, str(path), noise)


def _table(lines: list[str]) -> list[list[str]]:
    """Rows of y and z of a table, with a head or without; more columns need a head that names both.

    Raises:
        UserError: columns that could be others.
    """
    rows = [line.replace(",", " ").replace(";", " ").split() for line in lines]
    head = rows.pop(0) if rows and not is_number(rows[0][0]) else []
    named = {name.lower().removesuffix("_mm").removesuffix("_m"): k for k, name in enumerate(head)}
    known = {"y", "z"} & set(named)
    if len(known) == 2 and all(len(row) == len(head) for row in rows):
        return [[row[named["y"]], row[named["z"]]] for row in rows]
    if not known and all(len(row) == 2 for row in rows):
        return rows
    wide = max(rows, key=len, default=head)
    raise UserError(
        f"has {len(wide)} columns ({' '.join(head or wide)}); a profile is a table of y and z, so leave out "
        "the others, or name y and z in its first line"
    )


DECIMAL_COMMA = re.compile(r"\d,\d.*[;\t ]\s*[-+]?\d|\d[;\t ]\s*[-+]?\d+,\d")
"""Beside another mark between the columns."""


def _header(lines: list[str]) -> tuple[float, Array, Array]:
    """Unit in m, signs and shifts of y and z, as a ``.prr`` or ``.prw`` tells them."""
    header = dict.fromkeys(("shift.y", "shift.z", "mirror.y", "mirror.z", "rotate"), 0.0) | {"units.len.f": 1e3}
    for line in lines:
        key, equals, value = (part.strip() for part in line.partition("="))
        if equals and key in header and is_number(value):
            header[key] = float(value)
    if header["rotate"]:
        raise UserError("rotate is not read; turn the points, or set inclination in the case")
    if not header["units.len.f"] > 0:
        raise UserError("units.len.f must be greater than 0; 1000 says that the points are in mm")
    sign = 1 - 2 * np.array([header["mirror.y"], header["mirror.z"]])
    return 1 / header["units.len.f"], sign, np.array([header["shift.y"], header["shift.z"]])


def _miniprof(lines: list[str]) -> list[str]:
    """Points as "y z" of a file of MiniProf: keys or free text before, what begins with a quotation mark left out."""
    lines = [line for line in lines if not line.startswith('"')]
    keys = dict(line.split("=", 1) for line in lines if "=" in line)
    for key in ("XOffset", "YOffset", "Tilt"):
        if is_number(keys.get(key, "")) and float(keys[key]):
            raise UserError(f"{key} is not read; save the profile with {key} applied to its points")
    names = [name.strip() for name in keys.get("ColumnDef", "X,Y").split(",")]
    if not {"X", "Y"} <= set(names):
        raise UserError("ColumnDef names no X and Y; save the profile with both")
    rows = [line.split() for line in lines]
    rows = [row for row in rows if len(row) >= len(names) and all(map(is_number, row))]
    return [f"{row[names.index('X')]} {row[names.index('Y')]}" for row in rows]


WIDEST = 0.5
"""m: what is wider than this, or narrower than a thousandth of it, is given in another unit."""


def _checked(y: Array, z: Array, name: str, noise: float) -> CrossSection:
    rising = np.diff(y) * np.sign(y[-1] - y[0])
    if not (rising > 0).all():
        at = int(np.argmax(rising <= 0)) + 1
        raise UserError(
            f"turns back or crosses itself at point {at + 1} (y = {y[at] * 1e3:.4g} mm); y must rise or fall "
            "all along, so cut off what lies behind"
        )
    width = abs(y[-1] - y[0])
    if not WIDEST / 1000 < width < WIDEST:
        raise UserError(f"is {width:.3g} m wide; profiles are given in mm (unit = 1.0 for metres)")
    order = slice(None, None, 1 if y[-1] > y[0] else -1)
    return CrossSection(np.ascontiguousarray(y[order]), np.ascontiguousarray(z[order]), name, noise)

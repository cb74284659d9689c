"""A measured normal law: force over approach from a column file, as a smooth, monotone curve that is zero when open.

Sextro 3.1, first source. Between the measured points the curve is C1 and does not overshoot (PCHIP, Fritsch and
Butland 1984); below the first point it goes to zero like the third power, as rough surfaces do (3.3-25), above the
last one it is straight, as all of the area carries then (3.3-24).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from scipy.optimize import isotonic_regression

from ..data import Array, Indices
from ..errors import UserError, in_its_file, of_file
from ..files.store import ordinary
from ..reduced.compliance import BULK_AND_SURFACE
from .hertz import Hertz
from .profiles import RoundContact
from .series import BULK, INCLUDES
from .solids import bisected, pressing

LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}
FORCES = {"N": 1.0, "kN": 1e3, "mN": 1e-3}
FEWEST = 4
"""Points with force that a curve needs: fewer leave its stiffness to guesswork."""


@dataclass(frozen=True)
class NormalCurve:
    """A normal law by points.

    Attributes:
        knots: (k,) approaches, m, rising, the first one where the contact opens. loads: (k,) N there, the first one 0.
            slopes: (k,) N/m there, the first one 0. includes: what compliance was measured, one of
            `series.INCLUDES`; a rig measures both, unless the bodies' own yielding was taken off.
        source: for reports.

    Raises:
        UserError: an unknown word.
    """

    knots: Array
    loads: Array
    slopes: Array
    includes: str = BULK_AND_SURFACE
    source: str = "given"

    def __post_init__(self) -> None:
        if self.includes not in INCLUDES:
            raise UserError(f"includes: '{self.includes}' is unknown; choose one of {', '.join(INCLUDES)}")

    @property
    def separation(self) -> float:
        """Approach (m) at which the contact opens."""
        return float(self.knots[0])

    @property
    def stiffness_0(self) -> float:
        """Stiffness with all of the area in contact, c_N0, N/m: that beyond the last point."""
        return float(self.slopes[-1])

    def force(self, approach: ArrayLike) -> Array:
        """N at approaches (m, any shape)."""
        x, after = self._split(approach)
        return self._spline(x) + self.slopes[-1] * after

    def stiffness(self, approach: ArrayLike) -> Array:
        """Its derivative, N/m."""
        return self._spline.derivative()(self._split(approach)[0])

    def stored(self, approach: ArrayLike) -> Array:
        """Its integral from the open contact, J."""
        x, after = self._split(approach)
        return self._spline.antiderivative()(x) + after * (self.loads[-1] + 0.5 * self.slopes[-1] * after)

    def approach(self, force: ArrayLike) -> Array:
        """Approach (m) under forces (N, any shape); the smallest one where the curve is level.

        Raises:
            UserError: a negative force.
        """
        F = pressing(force)
        return np.array([self._inverse(v) for v in F.ravel()]).reshape(F.shape)

    @cached_property
    def _spline(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.knots, self.loads, self.slopes)

    def _split(self, approach: ArrayLike) -> tuple[Array, Array]:
        """Approaches held within the knots, and how far they go beyond the last one."""
        x = np.asarray(approach, dtype=float)
        return np.clip(x, self.knots[0], self.knots[-1]), np.maximum(x - self.knots[-1], 0.0)

    def _inverse(self, force: float) -> float:
        if force >= self.loads[-1]:
            return float(self.knots[-1] + (force - self.loads[-1]) / self.slopes[-1])
        i = max(int(np.searchsorted(self.loads, force)), 1)
        # a level stretch has no slope to divide by
        return float(bisected(lambda x: self._spline(x) < force, self.knots[i - 1], self.knots[i], 80)[1])


def of_contact(contact: Hertz | RoundContact, largest: float, count: int = 81) -> NormalCurve:
    """The curve of a point contact up to a normal force (N), with its own slopes; knots crowd where it opens.

    Raises:
        UserError: no force, or one that needs a wider profile.
    """
    if not 0 < largest < np.inf:
        raise UserError(f"largest: {largest:g} N; give the largest force the curve is to reach")
    u = float(contact.approach(largest)) * np.linspace(0, 1, count) ** 2
    loads = contact.force(u)
    slopes = contact.stiffness_at(u)
    slopes[0] = 0.0  # of a stamp it is not, whose force then sets in within the first interval
    return NormalCurve(u, loads, slopes, BULK, f"{type(contact).__name__} to {largest:g} N")


def curve(
    approach: ArrayLike, force: ArrayLike, noise: float = 0.0, includes: str = BULK_AND_SURFACE, name: str = "curve",
    places: Indices | None = None,
) -> NormalCurve:  # fmt: skip
    """The law through measured points.

    Args:
        approach: (k,) m, rising, positive closing. force: (k,) N, not negative, not falling. noise: N, a force may
            fall by as much between neighbours; it is evened then (isotonic regression, the nearest curve that does
            not fall). includes: one of `series.INCLUDES`. name: file, for messages.
        places: (k,) lines of the file the points stand in.

    Raises:
        UserError: NaN, negative or falling forces, approaches that do not rise, fewer than `FEWEST` points with force,
            a curve that ends level; each with file and line.
    """
    x, F = (np.asarray(v, dtype=float) for v in (approach, force))
    if x.ndim != 1 or x.shape != F.shape:
        raise UserError(f"{name}: needs one force for each approach, {x.size} approaches and {F.size} forces are given")
    _check(name, places, x, F, noise)
    if (np.diff(F) < 0).any():
        F = np.asarray(isotonic_regression(F).x)
    F = np.maximum(F, 0.0)
    first = int(np.flatnonzero(F > 0)[0]) if (F > 0).any() else len(F)
    start = max(first - 1, 0)
    x, F = x[start:], F[start:]
    if np.sum(F > 0) < FEWEST:
        raise UserError(f"{name}: {np.sum(F > 0)} points with a force are too few; a curve needs at least {FEWEST}")
    slope = _slopes(x, F)
    if not slope[-1] > 0:
        raise UserError(
            f"{name}: the force does not rise at the end of the curve ({F[-1]:g} N); leave out what the load cell did "
            "not resolve"
        )
    if F[0] > 0:
        return _opened(x, F, slope, includes, name)
    slope[0] = 0.0  # no kink where the contact opens; still monotone
    return NormalCurve(x, F, slope, includes, name)


def _slopes(x: Array, F: Array) -> Array:
    """PCHIP's, but for ends that it makes level although the force rises there: then the chord's, as monotone."""
    slope, chord = PchipInterpolator(x, F).derivative()(x), np.diff(F) / np.diff(x)
    slope[[0, -1]] = np.where(slope[[0, -1]] > 0, slope[[0, -1]], chord[[0, -1]])
    return slope


_CLOSE = 1e-15  # m: approaches nearer than this are one, less than rounding of a file's digits


def _opened(x: Array, F: Array, slope: Array, includes: str, name: str) -> NormalCurve:
    """A curve that begins under load, led to zero by F_1 (1 + (u - u_1) F_1'/(3 F_1))^3."""
    if not slope[0] > 0:
        raise UserError(
            f"{name}: begins at {F[0]:g} N and is level there, so nothing tells where the contact opens; measure from "
            "a smaller load on"
        )
    lead = 3 * F[0] / slope[0]
    if lead < _CLOSE:  # the first force is rounding, and the contact opens there
        return NormalCurve(x, np.append(0.0, F[1:]), np.append(0.0, slope[1:]), includes, name)
    return NormalCurve(
        np.concatenate([[x[0] - lead], x]), np.concatenate([[0.0], F]), np.concatenate([[0.0], slope]), includes, name
    )


def _check(name: str, places: Indices | None, x: Array, F: Array, noise: float) -> None:
    for what, v in (("approach", x), ("force", F)):
        bad = np.flatnonzero(~np.isfinite(v))
        if len(bad):
            raise UserError(f"{name}: {_line(places, bad[0])}the {what} is no finite number; correct it or take it out")
    for what, v, most, unit in (("approach", x, 1.0, "m"), ("force", F, 1e12, "N")):
        far = np.flatnonzero(np.abs(v) > most)
        if len(far):
            told = f"{_line(places, far[0])}the {what} is {v[far[0]]:g} {unit}"
            raise UserError(f"{name}: {told}, which is no contact's; correct the unit")
    bad = np.flatnonzero(np.diff(x) <= _CLOSE)
    if len(bad):
        raise UserError(
            f"{name}: {_line(places, bad[0] + 1)}the contact does not close further ({x[bad[0]]:g} m, then "
            f"{x[bad[0] + 1]:g} m); give one loading branch, sorted, each approach once"
        )
    if (F < -noise).any():
        i = int(F.argmin())
        raise UserError(f"{name}: {_line(places, i)}the force is {F[i]:g} N; take off the load cell's offset")
    bad = np.flatnonzero(np.diff(F) < -noise)
    if len(bad):
        raise UserError(
            f"{name}: {_line(places, bad[0] + 1)}the force falls from {F[bad[0]]:g} to {F[bad[0] + 1]:g} N while the "
            "contact closes; give the loading branch only, or state the noise of the force (N) that may be evened"
        )


def _line(places: Indices | None, i: int) -> str:
    return f"point {i + 1}: " if places is None else f"line {places[i]}: "


# files -------------------------------------------------------------------------------------------------------------


def read_curve(
    path: Path | str, displacement: int | str = 1, force: int | str = 2, length_unit: str = "um", force_unit: str = "N",
    gap: bool = False, noise: float = 0.0, includes: str = BULK_AND_SURFACE,
) -> NormalCurve:  # fmt: skip
    """A curve from a file of columns, measured or of ``microslip closure``.

    Comma, semicolon, tab or blanks between the columns, ``#`` before messages.

    Args:
        displacement, force: columns, counted from 1 or named as in the file's heading. length_unit: one of
            `LENGTHS`. force_unit: one of `FORCES`. gap: whether the displacement opens the contact. noise: N.

    Raises:
        UserError: what cannot be read, with file and line; see `curve`.
    """
    with of_file(path):
        for what, unit, known in (("length_unit", length_unit, LENGTHS), ("force_unit", force_unit, FORCES)):
            if unit not in known:
                raise UserError(f"'{unit}' is unknown; choose one of {', '.join(known)}", what)
    table, places = read_columns(path, (displacement, force))
    order = slice(None, None, -1) if gap and len(table) > 1 and table[0, 0] < table[-1, 0] else slice(None)
    x, F, places = table[order, 0] * LENGTHS[length_unit], table[order, 1] * FORCES[force_unit], places[order]
    return curve(-x if gap else x, F, noise, includes, str(path), places)


@in_its_file
def read_columns(path: Path | str, columns: tuple[int | str, ...]) -> tuple[Array, Indices]:
    """(k, c) numbers of some columns of a text file, and the lines they stand in, counted from 1.

    A comma is a decimal point where semicolons or tabs part the columns. NaN is read as such; the callers refuse it.
    The first line may be a heading, and so may those after it in which no column holds a number.

    Raises:
        UserError: no such file, no such column, a line that is short or holds no number.
    """
    lines = [(i, line.split("#", 1)[0].strip()) for i, line in enumerate(_text(Path(path)).splitlines(), 1)]
    lines = [(i, line) for i, line in lines if line]
    if not lines:
        raise UserError("is empty; it needs columns of numbers")
    split = _splitter([line for _, line in lines])
    heads = _headings([split(line) for _, line in lines])
    picks = [_column(c, heads) for c in columns]
    rows, places = [], []
    for i, line in lines[len(heads) :]:
        cells = split(line)
        values = [_number(cells[p]) if p < len(cells) else None for p in picks]
        for p, v in zip(picks, values, strict=True):
            if v is None:
                held = f"'{cells[p]}' is no number" if p < len(cells) else "there is none"
                raise UserError(f"line {i}: column {p + 1}: {held}; correct the line or begin it with #")
        rows.append(values)
        places.append(i)
    return np.array(rows, dtype=float).reshape(-1, len(picks)), np.array(places, dtype=np.int64)


_DECIMALS = re.compile(r"[^\s,]+(,[^\s,]+)?(\s+[^\s,]+(,[^\s,]+)?)+")
"""A line of columns parted by blanks, each with one comma inside at most."""


@in_its_file
def read_table(path: Path, columns: tuple[int | str, ...], names: tuple[str, ...]) -> Array:
    """`read_columns`, all numbers of which are finite.

    Args:
        names: of the columns, for the complaint.
    """
    table, lines = read_columns(path, columns)
    if (bad := np.argwhere(~np.isfinite(table))).size:
        row, column = bad[0]
        raise UserError(f"line {lines[row]}: the {names[column]} is no finite number; correct it")
    return table


def _text(path: Path) -> str:
    try:
        raw = ordinary(path).read_bytes()
    except OSError as error:
        raise UserError(f"cannot be read ({error.strerror}); correct the path") from error
    if b"\0" in raw:
        raise UserError("is no text file; give columns of numbers as text")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")  # rigs write the micro sign so


def _splitter(lines: list[str]) -> Callable[[str], list[str]]:
    common = [m for m in (";", "\t", ",") if 2 * sum(m in line for line in lines) > len(lines)]
    mark = common[0] if common else None
    if mark == "," and 2 * sum(_DECIMALS.fullmatch(line) is not None for line in lines) > len(lines):
        mark = None  # blanks part the columns, commas the decimals

    def split(line: str) -> list[str]:
        cells = re.split(r"\s+", line) if mark is None else line.split(mark)
        cells = [c.strip().strip('"') for c in cells]
        return [c.replace(",", ".") for c in cells] if mark in (";", "\t", None) else cells

    return split


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _headings(lines: list[list[str]]) -> list[list[str]]:
    """Cells of the lines before the first number: title, names, units."""
    if _number(lines[0][0]) is not None:
        return []
    numbers = (i for i, cells in enumerate(lines[1:], 1) if any(_number(c) is not None for c in cells))
    return lines[: next(numbers, 1)]


def _column(wanted: int | str, heads: list[list[str]]) -> int:
    if isinstance(wanted, int):
        if wanted < 1:
            raise UserError("columns are counted from 1", f"column {wanted}")
        return wanted - 1
    for head in heads:
        if wanted in head:
            return head.index(wanted)
    names = ", ".join(name for head in heads for name in head)
    raise UserError(f"the file has {names or 'no names'}; give a number", f"column '{wanted}'")

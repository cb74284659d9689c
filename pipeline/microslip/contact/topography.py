"""Measured surface profiles: roughness numbers and the cumulative height distribution (Sextro, section 3.3).

A profile is heights z over a way x, both in m. Between its points it is taken as straight, so the share of its length
that lies above a level is known exactly, is continuous, and starts from zero at the highest peak: with it the normal
force of `heights.Tabulated` is C1 and zero at separation, as measured, without a fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import UserError, in_its_file
from ..files.store import ordinary
from .curves import LENGTHS, read_columns

if TYPE_CHECKING:
    from .heights import Tabulated

UNITS = LENGTHS | {"µm": 1e-6, "μm": 1e-6, "in": 0.0254}
"""m of the units of length that a profile may stand in."""

SAMPLING_LENGTHS = 5


@dataclass(frozen=True)
class SurfaceProfile:
    """A measured profile.

    Attributes:
        x: (k,) way, m, rising. z: (k,) height, m; or (l, k), l parallel lines of a map. name: in messages.
    """

    x: np.ndarray
    z: np.ndarray
    name: str = "profile"

    @property
    def lines(self) -> np.ndarray:
        """(l, k) the heights as lines, also where there is one."""
        return np.atleast_2d(self.z)


@dataclass(frozen=True)
class RoughnessNumbers:
    """Roughness numbers of a profile in m, from its mean line as it is, without a filter: waviness is in them.

    Attributes:
        Ra: mean of |z|. Rq: root of the mean of z^2. Rt: highest peak to deepest valley of the whole. Rmax: the largest
            peak to valley height of five equal sampling lengths. Rz: their mean (Sextro's R_Z).
    """

    Ra: float
    Rq: float
    Rt: float
    Rmax: float
    Rz: float


@dataclass(frozen=True)
class Fit:
    """R_Z of the polynomial (3.3-4) that fits a measured distribution. residual: root mean square of the area."""

    roughness: float
    residual: float


@in_its_file
def read_profile(
    path: str | Path, unit: str | tuple[str, str], level: int | None = 1, columns: tuple[int | str, int | str] = (1, 2)
) -> SurfaceProfile:
    """A profile from a file of columns, way x and height z; see `curves.read_columns`.

    Any other file name than .txt, .csv, .tsv, .dat, .asc, .prf or none is given to `read_instrument`.

    Args:
        unit: of both columns ("um"), or of x and z ("mm", "um"). level: order of the polynomial in x that is taken off
            by least squares, see `levelled`; None leaves the heights as they are. columns: of x and z, counted from 1
            or named as in the file's heading.

    Raises:
        UserError: a file that cannot be read, a line without two finite numbers, x that does not rise, fewer than ten
            points, heights that are all the same, an unknown unit.
    """
    path = Path(path)
    if path.suffix.lower() not in (".txt", ".csv", ".tsv", ".dat", ".asc", ".prf", ""):
        return read_instrument(path, level)
    scales = _scales(unit)
    table, lines = read_columns(path, columns)
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        i, column = bad[0]
        raise UserError(f"line {lines[i]}: {'xz'[column]} is no finite number; correct it or take the line out")
    x = table[:, 0]
    falls = np.flatnonzero(np.diff(x) <= 0)
    if len(falls):
        i = falls[0] + 1
        raise UserError(
            f"line {lines[i]}: x = {x[i]:g} does not lie behind {x[i - 1]:g}; "
            "sort the lines by x and leave doubled ones out"
        )
    return _levelled(x * scales[0], table[:, 1] * scales[1], path, level)


def _scales(unit: str | tuple[str, str]) -> list[float]:
    names = (unit, unit) if isinstance(unit, str) else tuple(unit)
    for name in names:
        if name not in UNITS:
            raise UserError(f"unknown unit of length {name!r}; one of {', '.join(UNITS)}")
    if len(names) != 2:
        raise UserError(f"units of x and z are two names; got {len(names)}")
    return [UNITS[name] for name in names]


def _levelled(x: np.ndarray, z: np.ndarray, path: Path, level: int | None) -> SurfaceProfile:
    """A checked profile of a file, `levelled`."""
    if z.shape[-1] < 10:
        raise UserError(f"{z.shape[-1]} points; a profile needs ten or more")
    if np.ptp(z) == 0:
        raise UserError(f"z is {z.flat[0]:g} m everywhere; a smooth surface needs no height distribution")
    return levelled(SurfaceProfile(x, z, str(path)), level)


@in_its_file
def read_instrument(path: str | Path, level: int | None = 1) -> SurfaceProfile:
    """A line or a map from a file of a profilometer, by SurfaceTopography (`pip install "microslip[profile]"`).

    Args:
        level: as in `read_profile`; every line of a map on its own.

    Raises:
        UserError: SurfaceTopography is missing or cannot read the file, the file names no unit of length, holds
            points that were not measured, or as `read_profile`.
    """
    path = Path(path)
    try:
        from SurfaceTopography import read_topography
    except ImportError:
        raise UserError(
            "files of instruments are read by SurfaceTopography; "
            'pip install "microslip[profile]", or write two columns x, z to a .txt file'
        ) from None
    if not ordinary(path).is_file():
        raise UserError("no such file")
    try:
        topography = read_topography(str(path))
        x, z = _positions(topography)
    except Exception as error:  # a reader per instrument, each with its own
        raise UserError(f"SurfaceTopography cannot read it ({str(error).splitlines()[0]})") from None
    if topography.unit not in UNITS:
        raise UserError(f"its unit of length is {topography.unit!r}, not one of {', '.join(UNITS)}")
    if np.ma.is_masked(z) or not np.all(np.isfinite(z)):
        raise UserError("some points were not measured; fill them in the instrument's program", "z")
    scale = UNITS[topography.unit]
    return _levelled(np.asarray(x) * scale, np.asarray(z) * scale, path, level)


def _positions(topography: object) -> tuple[np.ndarray, np.ndarray]:
    """(k,) x and (k,) or (l, k) z of a line scan or a map, whose first axis is x."""
    if topography.dim == 1:  # type: ignore[attr-defined]
        return topography.positions_and_heights()  # type: ignore[attr-defined, no-any-return]
    x, _, z = topography.positions_and_heights()  # type: ignore[attr-defined]
    return x[:, 0], z.T


def levelled(profile: SurfaceProfile, order: int | None = 1) -> SurfaceProfile:
    """The profile less the polynomial in x of this order that fits it best in the mean square; lines one by one.

    0 takes off the mean, 1 the tilt of the part in the instrument, 2 also a cylinder or the sag of the guide. None
    changes nothing.
    """
    if order is None:
        return profile
    s = 2 * (profile.x - profile.x[0]) / np.ptp(profile.x) - 1
    weights = np.sqrt(_shares(profile.x))[:, None]
    A = np.polynomial.legendre.legvander(s, order)
    fit = A @ np.linalg.lstsq(weights * A, weights * profile.lines.T, rcond=None)[0]
    return replace(profile, z=(profile.lines - fit.T).reshape(profile.z.shape))


def _shares(x: np.ndarray) -> np.ndarray:
    """(k,) share of the length that belongs to each point: half of both its neighbouring intervals."""
    d = np.diff(x)
    return (np.append(d, 0) + np.append(0, d)) / (2 * (x[-1] - x[0]))


def roughness(profile: SurfaceProfile) -> RoughnessNumbers:
    """Ra, Rq, Rt, Rmax and Rz of a profile, of a map the means over its lines (Rt and Rmax: the largest)."""
    z, shares = profile.lines, _shares(profile.x)
    z = z - (z @ shares)[:, None]
    edges = np.linspace(profile.x[0], profile.x[-1], SAMPLING_LENGTHS + 1)
    heights = np.array([_peak_to_valley(profile.x, z, a, b) for a, b in zip(edges, edges[1:], strict=False)])
    return RoughnessNumbers(
        Ra=float(np.mean(np.abs(z) @ shares)), Rq=float(np.mean(np.sqrt(z**2 @ shares))),
        Rt=float(np.max(np.ptp(z, axis=1))), Rmax=float(heights.max()), Rz=float(heights.mean()),
    )


def _peak_to_valley(x: np.ndarray, z: np.ndarray, start: float, end: float) -> np.ndarray:
    """(l,) of the part from start to end, the straight pieces cut there."""
    inside = z[:, (x >= start) & (x <= end)]
    cut = np.array([[np.interp(at, x, line) for at in (start, end)] for line in z])
    return np.ptp(np.column_stack([inside, cut]), axis=1)


def material_curve(profile: SurfaceProfile, count: int = 129) -> tuple[np.ndarray, np.ndarray]:
    """Share of the length that lies higher than a depth below the highest peak: the cumulative height distribution.

    Returns:
        (count,) depths in m, from 0 to the deepest valley; (count,) shares from 0 to 1, exact at these depths.
    """
    top = float(profile.lines.max())
    depth = np.linspace(0, float(np.ptp(profile.lines)), count)
    high = top - np.maximum(profile.lines[:, :-1], profile.lines[:, 1:]).ravel()
    low = top - np.minimum(profile.lines[:, :-1], profile.lines[:, 1:]).ravel()
    weights = np.tile(np.diff(profile.x), len(profile.lines)) / (len(profile.lines) * np.ptp(profile.x))
    width = np.maximum(low - high, 1e-300)  # a level piece has its whole length at one depth
    share = np.array([weights @ np.clip((d - high) / width, 0.0, 1.0) for d in depth])
    share[0], share[-1] = 0.0, 1.0  # level pieces at the very top touch right behind it
    return depth, share


def heights(profile: SurfaceProfile, roughness_z: float, count: int = 129) -> Tabulated:
    """The measured cumulative height distribution as a law's heights, depths divided by roughness_z (m)."""
    from .heights import tabulated

    if not roughness_z > 0:
        raise UserError(f"{profile.name}: a roughness of {roughness_z:g} m; it must be positive")
    depth, share = material_curve(profile, count)
    return tabulated(depth / roughness_z, share, profile.name)


def fit_roughness(profile: SurfaceProfile, count: int = 513) -> Fit:
    """R_Z of 3 x^2 - 2 x^3 by least squares over the measured distribution (Sextro Eqs. (3.3-4), (3.3-5)).

    x = 0 is the highest peak. A single high peak therefore shows as a large residual.
    """
    from scipy.optimize import minimize_scalar

    depth, share = material_curve(profile, count)

    def misfit(log_r: float) -> float:
        s = np.clip(depth / np.exp(log_r), 0.0, 1.0)
        return float(np.mean((s * s * (3 - 2 * s) - share) ** 2))

    best = minimize_scalar(misfit, bounds=(np.log(depth[-1] / 20), np.log(depth[-1] * 5)), method="bounded")
    return Fit(float(np.exp(best.x)), float(np.sqrt(best.fun)))

"""Wear of rough surfaces at a given normal force: the height distribution over time (Sextro, section 3.9).

Dimensionless as in `heights`: depths x* = x / R_Z below the highest peak of the new surface, force F* =
F_N / (c_N0 R_Z), pressure p* = u* - x*, which is p_N A_0 / (c_N0 R_Z). A strip in contact loses dx*/dt* = p* (3.9-9)
with t* = I_W mu v c_N0 t / A_0 (3.9-10, without its missing Delta t). The approach u* follows from the force at every
moment, as the pressure belongs to the worn surface (3.9-8).

The course is known. The overlap of the wall with the NEW surface is what is pressed elastically, F*, and what was worn
off, F* t*; strips once in contact stay there. So the approach is that of the new surface under a growing force,

    V(u*) = F* (1 + t*),

V the volume (3.3-21) of the new surface, and a strip of depth x* that touches from t_x* on (0 if it did from the
start) has the pressure, by dp*/dt* = du*/dt* - p*,

    p*(t*) = p*(0) exp(-t*) + integral of exp(-(t* - s)) du*(s) from t_x* to t*.

`course` evaluates this; `evolve` steps through any other wear rate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..errors import NotConverged, UserError
from ..programs import program
from .friction import Friction, coefficients
from .heights import Heights, Tabulated, as_table, summed
from .normal import Rough
from .solids import bisected


@dataclass(frozen=True)
class WearCourse:
    """The course of wear at a constant normal force.

    Attributes:
        force: F*. times: (t,) t*, from 0. approach: (t,) u*. share: (k,) z* of the strips, from 0 to 1. depth: (t, k)
            their depths x*, rising along a row.
    """

    force: float
    times: np.ndarray
    approach: np.ndarray
    share: np.ndarray
    depth: np.ndarray

    @property
    def pressure(self) -> np.ndarray:
        """(t, k) p*."""
        return np.maximum(self.approach[:, None] - self.depth, 0.0)

    @property
    def area(self) -> np.ndarray:
        """(t,) share of the nominal area in contact."""
        return np.array([np.interp(u, x, self.share) for u, x in zip(self.approach, self.depth, strict=True)])

    @property
    def worn(self) -> np.ndarray:
        """(t,) worn volume over A_0 R_Z; Archard's law asks for F* t*."""
        return np.trapezoid(self.depth - self.depth[0], self.share, axis=1)

    @property
    def roughness(self) -> np.ndarray:
        """(t,) highest peak to deepest valley over R_Z."""
        return np.ptp(self.depth, axis=1)

    def heights(self, i: int = -1) -> Tabulated:
        """The cumulative height distribution at times[i], over depths below the highest peak of the new surface."""
        return summed(self.depth[i], self.share)


def approach_under(heights: Heights, force: np.ndarray | float) -> np.ndarray:
    """u* at which the normal force is F* (any shape, positive), by bisection down to rounding."""
    force, volume = np.asarray(force, float), _volume_of(heights)
    first, last = np.asarray(heights.breaks())[[0, -1]]
    low, high = bisected(lambda u: volume(u) < force, np.full(force.shape, first), last + force, 64)
    return 0.5 * (low + high)


_volume = program(lambda heights, u: heights.volume(u))


def _volume_of(heights: Heights) -> Callable[[np.ndarray], np.ndarray]:
    """`Heights.volume` on arrays of numpy: filled up to a power of two, because jax compiles anew for every size."""
    if not isinstance(heights, Tabulated):

        def of_any(u: np.ndarray) -> np.ndarray:
            size = max(np.size(u), 64)
            filled = np.resize(u, 1 << (size - 1).bit_length())
            return np.asarray(_volume(heights, filled))[: np.size(u)].reshape(np.shape(u))

        return of_any
    x, area, volume = (np.asarray(v) for v in (heights.x, heights.area_at, heights.volume_at))
    width, slope = np.diff(x), np.diff(area) / np.where(np.diff(x) > 0, np.diff(x), 1.0)

    def of_table(u: np.ndarray) -> np.ndarray:
        j = np.clip(np.searchsorted(x, u, side="right") - 1, 0, len(x) - 2)
        d = np.clip(u - x[j], 0.0, width[j])
        return volume[j] + d * (area[j] + 0.5 * slope[j] * d) + np.maximum(u - x[-1], 0.0)

    return of_table


# the exact course ----------------------------------------------------------------------------------------------------


def course(heights: Heights, force: float, times: np.ndarray, count: int = 257) -> WearCourse:
    """Exact course of wear whose rate is the pressure.

    Args:
        heights: of the surface when it begins, new or worn; `Cut` where it has no highest peak. force: F*, positive.
            times: (t,) t* of 0 or more, rising. count: of strips, where the heights are no table.

    Returns:
        At the times; the first row is that of times[0].

    Raises:
        UserError: a force that is not positive, or too small for the times; times that fall or are negative.
    """
    times = np.asarray(times, float)
    if not force > 0 or not np.isfinite(force):
        raise UserError(f"wear: a normal force of {force:g}; it must be positive")
    if times.ndim != 1 or not len(times) or not times[0] >= 0 or not np.all(np.diff(times) >= 0):
        raise UserError("wear: the times must be a row of rising numbers from 0 on")
    table = as_table(heights, count)
    x, share = np.asarray(table.x), np.asarray(table.area_at)
    u = approach_under(heights, force * (1 + times))
    start = float(approach_under(heights, force))
    edges, s, pushed = _pushed(heights, force, start, np.concatenate([x[x < u[-1]], u]))
    at_x, at_u = (np.searchsorted(edges, np.clip(v, start, edges[-1])) for v in (x, u))
    since = s[at_u][:, None] - s[at_x]  # time in contact; negative: not yet touched
    pressure = pushed[at_u][:, None] - np.exp(-np.maximum(since, 0)) * pushed[at_x]
    pressure += np.maximum(start - x, 0.0) * np.exp(-times)[:, None]
    depth = np.where(x < u[:, None], u[:, None] - np.maximum(pressure, 0.0), x)
    return WearCourse(float(force), times, u, share, np.maximum.accumulate(depth, axis=1))


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_LONGEST = 0.5  # t* per cell: 8 nodes then integrate to rounding
_MOST = 1e6  # cells: some seconds


def _pushed(
    heights: Heights, force: float, start: float, marks: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Approaches from ``start`` over all marks behind it, V / F* there, and the integral of exp(-(s - s')) du.

    The integral from ``start`` to each of them is carried from cell to cell, so that nothing overflows.
    """
    last, volume = float(np.asarray(heights.breaks())[-1]), _volume_of(heights)
    edges = np.unique(np.clip(np.concatenate([[start, min(last, marks.max())], marks]), start, None))
    s = volume(edges) / force
    parts = np.where(edges[1:] <= last, np.ceil(np.diff(s) / _LONGEST), 1).clip(1)
    if parts.sum() > _MOST:
        raise UserError(
            f"wear: a normal force of {force:.3g} wears the surface over {parts.sum() * _LONGEST:.3g} of its own "
            "times; give a larger force or less time"
        )
    parts = parts.astype(int)
    fine = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(edges[:-1], edges[1:], parts, strict=True)]
    edges = np.append(np.concatenate(fine) if fine else np.zeros(0), edges[-1])
    s = volume(edges) / force
    half = 0.5 * np.diff(edges)
    inner = edges[:-1, None] + half[:, None] * (1 + _NODES)
    grown = np.exp(volume(inner) / force - s[1:, None]) @ _WEIGHTS * half
    kept = np.exp(-np.diff(s))
    grown = np.where(edges[1:] > last, force * (1 - kept), grown)  # full contact: du = F* ds
    pushed = np.zeros(len(edges))
    for i, (k, g) in enumerate(zip(kept, grown, strict=True)):
        pushed[i + 1] = k * pushed[i] + g
    return edges, s, pushed


# any wear rate --------------------------------------------------------------------------------------------------------


def evolve(
    heights: Heights,
    force: float,
    time: float,
    rate: Callable[[np.ndarray], np.ndarray] | None = None,
    tolerance: float = 1e-4,
    step: float | None = None,
    count: int = 257,
) -> WearCourse:
    """Course of wear by Heun's method, for a rate dx*/dt* that is any rising function of the pressure.

    An explicit step keeps the strips in order as long as step times slope of the rate is 1 at most (p* itself: dt* <=
    1); Heun's step is the mean of the old surface and two explicit ones, so the same bound holds for it. The step is
    taken as large as this and the tolerance allow, and again with half of it where the order is lost nevertheless.

    Args:
        heights, force, count: as in `course`. time: t*. rate: of an array of p*, 0 at 0, not falling; p* if None
            (I_W may depend on the frictional power, after 3.9-4). tolerance: of the depths x* per step. step: a fixed
            t* in place of the chosen one.

    Returns:
        After every step, the first row new.

    Raises:
        UserError: a force, a time or a step that is not positive, a fixed step beyond the bound. NotConverged: the
            step falls below 1e-12 of the time.
    """
    if not force > 0 or not time > 0:
        raise UserError(f"wear: a normal force of {force:g} and a time of {time:g}; both must be positive")
    if step is not None and not step > 0:
        raise UserError(f"wear: a step of {step:g}; it must be positive")
    table = as_table(heights, count)
    x, share = np.array(table.x), np.asarray(table.area_at)
    rate = rate or (lambda p: p)
    times, depths, h = [0.0], [x], time if step is None else step
    while times[-1] < time * (1 - 1e-12):
        bound = 1 / max(_steepest(x, share, force, rate), 1e-300)
        h = min(h, time - times[-1], np.inf if step else bound)
        if h > bound * (1 + 1e-9):
            raise UserError(f"wear: a step of {h:g} puts strips out of order; take one of at most {bound:.3g}, or none")
        first = stepped(x, share, force, h, rate)
        after = 0.5 * (x + stepped(first, share, force, h, rate))
        error = float(np.abs(after - first).max())
        if step is None and (error > tolerance or np.any(np.diff(after) < 0)):
            h *= 0.5 if error <= tolerance else max(0.2, 0.9 * np.sqrt(tolerance / error))
            if h < 1e-12 * time:
                raise NotConverged("wear: the step becomes too small; the rate must be a continuous function from 0 on")
            continue
        x = after
        times.append(times[-1] + h)
        depths.append(x)
        if step is None:
            h *= min(3.0, 0.9 * np.sqrt(tolerance / max(error, 1e-300)))
    u = np.array([_approach(d, share, force) for d in depths])
    return WearCourse(float(force), np.array(times), u, share, np.array(depths))


def stepped(
    x: np.ndarray, share: np.ndarray, force: float, h: float, rate: Callable[[np.ndarray], np.ndarray] | None = None
) -> np.ndarray:
    """(k,) depths after one explicit step (Sextro Eq. (3.9-9)), the approach recomputed from the force."""
    pressure = np.maximum(_approach(x, share, force) - x, 0.0)
    return x + h * (pressure if rate is None else rate(pressure))


def _approach(x: np.ndarray, share: np.ndarray, force: float) -> float:
    """u* of a table of strips under F*: the volume between two nodes is quadratic.

    Depths that are not in order are sorted: the area below a level does not ask where it lies.
    """
    if np.any(np.diff(x) < 0):
        x = np.sort(x)
    volume = np.concatenate([[0.0], np.cumsum(0.5 * (share[1:] + share[:-1]) * np.diff(x))])
    if force >= volume[-1]:
        return float(x[-1] + force - volume[-1])
    j = int(np.searchsorted(volume, force, side="right")) - 1
    rest, slope = force - volume[j], (share[j + 1] - share[j]) / (x[j + 1] - x[j])
    return float(x[j] + 2 * rest / (share[j] + np.sqrt(share[j] ** 2 + 2 * slope * rest)))


def _steepest(x: np.ndarray, share: np.ndarray, force: float, rate: Callable[[np.ndarray], np.ndarray]) -> float:
    """Largest slope of the rate over the pressures there are."""
    p = np.linspace(0.0, max(_approach(x, share, force) - x[0], 1e-300), 65)
    return float(np.max(np.diff(rate(p))) / (p[1] - p[0]))


# coefficients --------------------------------------------------------------------------------------------------------


def from_archard(K: float, hardness: float, mu: float) -> float:
    """I_W in m3/J (worn volume over frictional work, 3.9-3) of Archard's K: volume = K F_N way / hardness (Pa)."""
    for name, value in (("hardness", hardness), ("friction coefficient", mu)):
        if not value > 0:
            raise UserError(f"wear: a {name} of {value:g}; it must be positive")
    return K / (hardness * mu)


def from_energy_density(density: float) -> float:
    """I_W in m3/J of Fleischer's apparent frictional energy density in J/m3: the work that wears off a volume."""
    if not density > 0:
        raise UserError(f"wear: an energy density of {density:g} J/m3; it must be positive")
    return 1 / density


def dimensionless_time(
    energy: np.ndarray, coefficient: float, normal: Rough, area: np.ndarray | float, force: np.ndarray
) -> np.ndarray:
    """t* of a frictional work (J) under a normal force (N): I_W mu v c_N0 t / A_0 (3.9-10), mu v t = work / force."""
    return coefficient * np.asarray(energy) * np.asarray(normal.stiffness_0) / (area * np.asarray(force))


# the closed loop of Fig. 3.9-4 ---------------------------------------------------------------------------------------


def worn_law(
    normal: Rough, energy: np.ndarray, force: np.ndarray, coefficient: float, area: np.ndarray | float
) -> Rough:
    """The rough law after frictional work at a normal force: a table of heights per point, of the exact course.

    The approach goes on being counted from where the NEW surface began to touch: a worn one begins later. Where the
    force swings during the work, its mean over the sliding way stands for it, energy / (mu way); what is worn off in
    all is the same, and steps that wear little keep the difference in shape small.

    Args:
        normal: new or worn. energy: (n,) J dissipated at each point. force: (n,) N at which it was; where it is 0
            nothing wears. coefficient: I_W, m3/J. area: nominal area of a point, m2, or (n,) of each.
    """
    energy, force = np.broadcast_arrays(np.atleast_1d(np.asarray(energy, float)), np.asarray(force, float))
    if not np.all(energy >= 0) or not np.all(force >= 0) or not coefficient >= 0 or not np.all(area > 0):
        raise UserError("wear: energy, force and coefficient must be 0 or more, and the area positive")
    table, n = as_table(normal.heights), len(energy)
    x, share = (np.broadcast_to(np.asarray(v), (n, np.shape(v)[-1])).copy() for v in (table.x, table.area_at))
    scale = np.broadcast_to(np.asarray(normal.stiffness_0) * np.asarray(normal.roughness), (n,))
    time = np.broadcast_to(dimensionless_time(energy, coefficient, normal, area, np.where(force > 0, force, 1.0)), (n,))
    for i in np.flatnonzero(force > 0):
        x[i] = course(summed(x[i], share[i]), force[i] / scale[i], time[i : i + 1]).depth[0]
    return replace(normal, heights=summed(x, share))


@dataclass(frozen=True)
class RunningIn:
    """A contact that slides at a constant normal force while it wears.

    Attributes:
        time: (t,) s. approach: (t,) m. area: (t,) m2 in contact. peak: (t,) largest pressure, Pa. stiffness: (t,)
            normal stiffness, N/m. power: (t,) frictional power, W. worn: (t,) volume, m3. laws: the t normal laws.
    """

    time: np.ndarray
    approach: np.ndarray
    area: np.ndarray
    peak: np.ndarray
    stiffness: np.ndarray
    power: np.ndarray
    worn: np.ndarray
    laws: tuple[Rough, ...]


def run_in(
    normal: Rough, friction: Friction, coefficient: float, area: float, force: float, speed: float, time: np.ndarray
) -> RunningIn:
    """The loop of Sextro's Fig. 3.9-4: heights -> normal law -> force, area, frictional power -> wear -> heights.

    Between the times the course is exact, whatever their distance; each time leaves the error of one table.

    Args:
        normal: of one point. friction: its coefficient at the speed is taken. coefficient: I_W, m3/J. area: nominal,
            m2. force: N. speed: of sliding, m/s. time: (t,) s, from 0, rising.
    """
    time = np.asarray(time, float)
    if not force > 0 or not speed >= 0 or len(time) == 0 or time[0] != 0 or np.any(np.diff(time) < 0):
        raise UserError("wear: needs a positive force, a speed of 0 or more, and times that rise from 0")
    power = float(coefficients(friction, speed, force)[0]) * force * speed
    tables = [as_table(normal.heights)]
    for dt in np.diff(time):
        law = worn_law(
            replace(normal, heights=tables[-1]), np.array([power * dt]), np.array([force]), coefficient, area
        )
        worn = as_table(law.heights)
        tables.append(summed(np.asarray(worn.x)[0], np.asarray(worn.area_at)[0]))
    c, R = float(normal.stiffness_0), float(normal.roughness)
    u = np.array([float(approach_under(t, force / (c * R))) for t in tables])
    share = np.array([np.interp(v, np.asarray(t.x), np.asarray(t.area_at)) for t, v in zip(tables, u, strict=True)])
    highest = np.array([np.asarray(t.x)[np.flatnonzero(np.asarray(t.area_at) == 0)[-1]] for t in tables])
    return RunningIn(
        time,
        approach=R * u,
        area=area * share,
        peak=c * R * (u - highest) / area,
        stiffness=c * share,
        power=np.full(len(time), power),
        worn=coefficient * power * time,
        laws=tuple(replace(normal, heights=t) for t in tables),
    )

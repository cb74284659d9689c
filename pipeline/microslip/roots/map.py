"""A map over two parameters of an assembly that slides: how many roots grow at each state, and how fast the fastest."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import sliding
from ..bifurcation import mechanics
from ..data import Array, largest
from ..errors import NotConverged, UserError
from ..linalg import quadratic
from ..linalg.quadratic import Quadratic, Window
from ..progress import Report
from ..results.journal import Journal, once
from ..system.assembly import Assembly
from .drawing import Shown, new_axes, states

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Axis:
    """A parameter of a map: what it is, in unit; its values (p,), rising; keys that follow it, each with its factor."""

    label: str
    unit: str
    values: Array
    keys: Mapping[str, float]

    def at(self, value: float) -> dict[str, float]:
        """Key -> its value at a value of the parameter."""
        return {key: factor * float(value) for key, factor in self.keys.items()}

    @property
    def title(self) -> str:
        return f"{self.label} in {self.unit}" if self.unit else self.label


@dataclass(frozen=True, repr=False)
class Map(Shown):
    """Roots of a window at every pair of values.

    Attributes:
        x, y: the parameters. unstable: (y, x) number of roots that grow; -1 where no equilibrium was found. growth:
            (y, x) 1/s and frequency: (y, x) Hz of the root that grows fastest, or decays slowest; NaN likewise.
        neutral: 1/s, growth rates below it are neutral. window: of the roots. coordinates: of the assembly.
    """

    x: Axis
    y: Axis
    unstable: Array
    growth: Array
    frequency: Array
    neutral: float
    window: Window
    coordinates: int

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        n, good = self.unstable.size, self.unstable >= 0
        counts = [f"{(self.unstable == k).sum()} with {k}" for k in range(int(self.unstable.max(initial=0)) + 1)]
        lost = f"; no equilibrium at {n - int(good.sum())}" if not good.all() else ""
        top = ""
        if good.any() and np.nanmax(self.growth) > self.neutral:
            i, j = np.unravel_index(np.nanargmax(self.growth), self.growth.shape)
            top = (f"; fastest {self.growth[i, j]:.4g} 1/s at {self.frequency[i, j]:.5g} Hz, {self.x.label} "
                   f"{self.x.values[j]:.4g}, {self.y.label} {self.y.values[i]:.4g}")  # fmt: skip
        return f"of {n} states {', '.join(counts)} roots that grow, all roots computed at each{lost}{top}"

    @property
    def limit(self) -> Array:
        """(y,) the smallest value of x at which a root begins to grow, by straight lines; NaN where none does."""
        limits = np.full(len(self.y.values), np.nan)
        for i, g in enumerate(self.growth):
            up = np.flatnonzero((g[:-1] <= 0) & (g[1:] > 0))
            if len(up):
                j = up[0]
                limits[i] = np.interp(0.0, g[j : j + 2], self.x.values[j : j + 2])
        return limits

    @property
    def columns(self) -> dict[str, Array]:
        """Column -> values, a row a state."""
        y, x = np.meshgrid(self.y.values, self.x.values, indexing="ij")
        return {
            self.x.label: x.ravel(), self.y.label: y.ravel(), "unstable": self.unstable.ravel(),
            "growth_1_s": self.growth.ravel(), "frequency_Hz": self.frequency.ravel(),
        }  # fmt: skip

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the number of roots that grow in colour, growth rates as lines, and the Hopf lines between."""
        axes = axes or new_axes()
        states(axes, self)
        return axes


KEPT = "rows of the map"
"""Series of the journal."""


def over_map(
    make: Callable[[dict[str, float]], Assembly], x: Axis, y: Axis, window: Window, neutral: float = 0.0,
    report: Report = lambda _: None, journal: Journal | None = None,
) -> Map:  # fmt: skip
    """The roots of an assembly about sliding at every pair of values of two parameters.

    Args:
        make: the assembly with values of keys. window: of the roots that count. neutral: 1/s. journal: where finished
            rows are kept, and known ones found.

    Raises:
        UserError: what `sliding.of` refuses; contacts that remember.
    """

    def row(i: int, value: float) -> dict[str, Any]:
        report(f"{y.label} {value:.4g}, {i + 1} of {len(y.values)}")
        return _solved(_row(make, x, y.at(value)), x, window, neutral)

    rows = [once(journal, KEPT, i, partial(row, i, value)) for i, value in enumerate(y.values)]
    names = "unstable", "growth", "frequency"
    unstable, growth, frequency = (np.array([r[name] for r in rows]) for name in names)
    return Map(x, y, unstable, growth, frequency, neutral, window, int(rows[0]["coordinates"]))


def _solved(row: Callable[[float], sliding.Sliding], x: Axis, window: Window, neutral: float) -> dict[str, Any]:
    """A row of a map, by the names of `Map`."""
    n, z, count = len(x.values), None, 0
    unstable, growth, frequency = np.full(n, -1), np.full(n, np.nan), np.full(n, np.nan)
    for j, p in enumerate(x.values):
        s = row(float(p))
        count = len(s.push)
        try:
            z = sliding.equilibrium(s, z)
        except NotConverged:
            z = None
            continue
        C, K = sliding.linearised(s, z)
        roots = quadratic.every_value(Quadratic(np.eye(len(K)), C, K))
        roots = roots[window.holds(roots)]
        tolerance = np.maximum(neutral, quadratic.ROUNDING * largest(roots))
        unstable[j] = (roots.real > tolerance).sum()
        if len(roots):
            top = roots[np.argmax(roots.real)]
            growth[j], frequency[j] = top.real, top.imag / (2 * np.pi)
    return {"unstable": unstable, "growth": growth, "frequency": frequency, "coordinates": count}


def _row(
    make: Callable[[dict[str, float]], Assembly], x: Axis, fixed: dict[str, float]
) -> Callable[[float], sliding.Sliding]:  # fmt: skip
    """The equations over x: interpolated to rounding where that is possible, which saves making most assemblies."""

    def at(p: float) -> Assembly:
        return make({**fixed, **x.at(p)})

    try:
        return mechanics.over(at, float(x.values[0]), float(x.values[-1])).at
    except UserError as error:
        if error.key != "parameter":
            raise
    like = sliding.points_moved(at(float(x.values[0])))
    return lambda p: sliding.of(at(p), like)

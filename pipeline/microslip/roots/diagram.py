"""Roots over a range of a parameter, mostly the speed: how many grow, and how fast, at each of its values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..data import Array, ComplexArray
from ..linalg import quadratic
from ..linalg.parametric import Family
from ..linalg.quadratic import Window
from ..linalg.sampled import Sampled, sampled
from ..progress import Report
from .drawing import Shown, new_axes, over

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class Diagram(Shown):
    """Roots in a window at values of a parameter.

    Attributes:
        parameter: its name; ``speed`` is in rad/s. values: (p,) ascending. s: at each value (r,) roots, 1/s, in the
            order of their frequencies; their number may change. error: at each value (r,) estimated error, 1/s.
        neutral: 1/s, growth rates below it, or below the error, are neutral. window: that was searched.
        basis: from which they come; None: the matrices are small and every value was solved by itself.
    """

    parameter: str
    values: Array
    s: tuple[ComplexArray, ...]
    error: tuple[Array, ...]
    neutral: float
    window: Window
    basis: Sampled | None

    @property
    def unstable(self) -> Array:
        """(p,) number of roots that grow."""
        pairs = zip(self.s, self.error, strict=True)
        return np.array([int((s.real > np.maximum(e, self.neutral)).sum()) for s, e in pairs])

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        counts, unit = self.unstable, " rad/s" if self.parameter == "speed" else ""
        edges = np.flatnonzero(np.diff(counts))
        parts = np.split(np.arange(len(counts)), edges + 1)
        each = [f"{counts[p[0]]} from {self.values[p[0]]:.4g} to {self.values[p[-1]]:.4g}" for p in parts]
        shown = ", ".join(each[:8]) + (", ..." if len(each) > 8 else "")
        return f"roots that grow over {self.parameter}{unit}: {shown}; {self.proof}"

    @property
    def proof(self) -> str:
        """Where the numbers come from, and how good they are."""
        if self.basis is None:
            return f"all roots computed at each of {len(self.values)} values"
        b = self.basis
        worst = max((float((e / np.abs(s)).max(initial=0.0)) for s, e in zip(self.s, self.error, strict=True)))
        return (
            f"one basis of {b.V.shape[1]} coordinates from {len(b.samples)} values, relative error "
            f"{b.held_out_error[-1]:.1e} at the value held out last, {worst:.1e} estimated at most"
        )

    @property
    def columns(self) -> dict[str, Array]:
        """Column -> values, one row a root at a value."""
        at = np.repeat(self.values, [len(s) for s in self.s])
        s, error = np.concatenate(self.s), np.concatenate(self.error)
        return {
            self.parameter: at, "frequency_Hz": s.imag / (2 * np.pi), "growth_1_s": s.real,
            "damping_ratio": -s.real / np.maximum(np.abs(s), 1e-300), "estimated_error_1_s": error,
        }  # fmt: skip

    @property
    def branches(self) -> ComplexArray:
        """(b, p) roots followed from value to value, NaN where one is outside the window: for pictures."""
        rows: list[ComplexArray] = []
        last: list[int] = []
        for j, s in enumerate(self.s):
            going = [i for i, at in enumerate(last) if at == j - 1]
            pairs = _partners(np.array([rows[i][j - 1] for i in going]), s)
            for k, i in pairs:
                rows[going[k]][j], last[going[k]] = s[i], j
            for i in sorted(set(range(len(s))) - {i for _, i in pairs}):  # of equal ones each by itself
                rows.append(np.full(len(self.values), complex(np.nan, np.nan)))
                rows[-1][j] = s[i]
                last.append(j)
        return np.array(rows).reshape(len(rows), len(self.values))

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` over branch and parameter: frequency (Hz) and growth (1/s)."""
        import xarray

        b = self.branches
        axes = ("branch", self.parameter)
        return xarray.Dataset(
            {
                "frequency": (axes, b.imag / (2 * np.pi), {"units": "Hz"}),
                "growth": (axes, b.real, {"units": "1/s"}),
                "unstable": ((self.parameter,), self.unstable),
            },
            coords={"branch": np.arange(1, len(b) + 1), self.parameter: self.values},
        )

    def plot(self, axes: Axes | None = None, what: Literal["growth", "frequency"] = "growth") -> Axes:
        """Draw growth rates or frequencies over the parameter; in colour what grows somewhere."""
        axes = axes or new_axes()
        over(axes, self, what == "frequency")
        return axes


def _partners(before: ComplexArray, now: ComplexArray) -> list[tuple[int, int]]:
    """Pairs of roots that are each other's nearest, all together as near as can be."""
    from scipy.optimize import linear_sum_assignment

    if not len(before) or not len(now):
        return []
    distance = np.abs(before[:, None] - now[None])
    size = np.maximum(np.abs(before)[:, None], np.abs(now)[None])
    far = distance > 0.05 * size
    rows, columns = linear_sum_assignment(np.where(far, 1e3 * size, distance))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if not far[i, j]]


def diagram(
    family: Family, parameter: str, values: Array, window: Window, *, at: Mapping[str, float] | None = None,
    tolerance: float = 1e-7, neutral: float = 0.0, report: Report = lambda _: None,
) -> Diagram:  # fmt: skip
    """Roots in a window at values of a parameter: of large matrices from one basis (`linalg.sampled`).

    Args:
        values: (p,) ascending. at: values of the other parameters. tolerance: relative, of the basis. neutral: 1/s.

    Raises:
        UserError: a parameter that no matrix scales with, a value at which one is not defined. NotConverged: no basis.
    """
    values = np.asarray(values, dtype=float)
    for end in values[[0, -1]]:
        family.values({**(at or {}), parameter: float(end)}, parameter)
    basis = None
    if family.terms[0].matrix.shape[0] > quadratic.DENSE:
        low, high = float(values[0]), float(values[-1])
        basis = sampled(family, parameter, low, high, window, tolerance=tolerance, values=at, report=report)
    each = []
    for value in values:
        if basis is not None:
            each.append(basis.at(float(value))[:2])
            continue
        s = quadratic.every_value(family.at({**(at or {}), parameter: float(value)}))
        s = s[window.holds(s)]
        each.append((s[np.argsort(s.imag, kind="stable")], 1e-12 * np.abs(s)))
    s, error = zip(*each, strict=True)
    return Diagram(parameter, values, s, error, neutral, window, basis)

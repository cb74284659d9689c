"""Roots in diagrams of matplotlib: their plane, and growth and frequency over a parameter."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, ComplexArray
from ..units import to_rpm

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .diagram import Diagram
    from .map import Map
    from .spectrum import Spectrum

KINDS = (
    ("stable", "#0b4f9c", "o", "#0b4f9c"),
    ("neutral", "#5b6270", "s", "white"),
    ("unstable", "#c8382c", "^", "#c8382c"),
)
COLOURS = ("#0b4f9c", "#c8382c", "#26863c", "#8a4fb5", "#d98410", "#16919c", "#8c564b", "#c2408f")
GREY = "#b4bac6"
TINTS = ("#dfe9f5", "#f6c9a8", "#e58f6a", "#c8503c", "#8f2a2a", "#5c1a24")
"""Of states in which 0, 1, 2, ... roots grow."""
LABELLED = 8
"""Roots that grow and are named in a picture."""


def new_axes() -> Axes:
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]


class Shown(ABC):
    """What has an answer in one sentence, and columns by their names."""

    @property
    @abstractmethod
    def sentence(self) -> str: ...

    @property
    @abstractmethod
    def columns(self) -> dict[str, Any]: ...

    def to_dataframe(self) -> Any:
        """The columns as a `pandas.DataFrame`."""
        import pandas

        return pandas.DataFrame(self.columns)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.sentence}>"


def plane(axes: Axes, found: Spectrum) -> None:
    """Growth rate to the right, frequency upwards; the side that grows is tinted."""
    verdict, kilo = np.array(found.verdict), _kilo(found.frequency)
    y = found.frequency / kilo
    for kind, colour, mark, inside in KINDS:
        own = verdict == kind
        axes.plot(
            found.growth[own], y[own], mark, color=colour, markerfacecolor=inside, markersize=7,
            label=f"{kind} ({int(own.sum())})", ls="", clip_on=False, zorder=3,
        )  # fmt: skip
    axes.axvline(0.0, color="#333333", linewidth=0.9)
    left, right = axes.get_xlim()
    right = max(right, 0.15 * (right - left))
    axes.axvspan(0.0, right, color=KINDS[2][1], alpha=0.06, lw=0)
    axes.set_xlim(left, right)
    grow = np.flatnonzero(verdict == "unstable")
    for i in grow[np.argsort(-found.growth[grow])][:LABELLED]:
        text = f"{found.frequency[i]:.2f} Hz\n{found.growth[i]:+.4g} 1/s"
        beyond = found.growth[i] > left + 0.75 * (right - left)
        axes.annotate(
            text, (found.growth[i], y[i]), (-8 if beyond else 8, 0), textcoords="offset points", fontsize=8,
            va="center", ha="right" if beyond else "left",
        )  # fmt: skip
    low, high = np.array(found.window.omega) / (2 * np.pi * kilo)
    high = high if np.isfinite(high) else 1.1 * max(float(y.max(initial=0.0)), 1e-12)
    axes.set(xlabel="growth rate in 1/s", ylabel=f"frequency in {'kHz' if kilo > 1 else 'Hz'}", ylim=(low, high))


def over(axes: Axes, found: Diagram, frequency: bool) -> None:
    """Growth rates, or frequencies, over the parameter: in colour what grows anywhere, the others grey."""
    every, speed = list(found.branches), found.parameter == "speed"
    growing = sorted((b for b in every if _grows(b, found)), key=lambda b: -float(np.nanmax(b.real)))
    others = [b for b in every if not _grows(b, found)]
    x, label = to_rpm(found.values) if speed else found.values, "speed in rpm" if speed else found.parameter
    kilo = _kilo(np.concatenate([b.imag[np.isfinite(b)] for b in every]) / (2 * np.pi)) if every else 1.0

    def values(b: ComplexArray) -> Array:
        return b.imag / (2 * np.pi * kilo) if frequency else b.real

    for i, b in enumerate(others):
        axes.plot(x, values(b), color=GREY, linewidth=1.0, label="" if i else "never grow")
    for i, b in enumerate(growing):
        told = f"{np.nanmin(b.imag) / (2 * np.pi):.5g} to {np.nanmax(b.imag) / (2 * np.pi):.5g} Hz"
        axes.plot(x, values(b), color=COLOURS[i % len(COLOURS)], linewidth=1.8, label=told)
    axes.set(xlabel=label, ylabel=f"frequency in {'kHz' if kilo > 1 else 'Hz'}" if frequency else "growth rate in 1/s")
    if not frequency:
        axes.axhline(0.0, color="#333333", linewidth=0.9)
        _growth_scale(axes, growing)


def states(axes: Axes, found: Map) -> None:
    """Number of roots that grow in colour, Hopf lines in black, growth rates in grey."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    x, y, most = found.x.values, found.y.values, max(int(found.unstable.max(initial=0)), 1)
    colours = ["#f0f0f0", *TINTS[: most + 1]]
    axes.pcolormesh(x, y, found.unstable, cmap=ListedColormap(colours),
                    norm=BoundaryNorm(np.arange(-1.5, most + 1), len(colours)), shading="nearest")  # fmt: skip
    if np.isfinite(found.growth).all():
        top = float(found.growth.max())
        lines = axes.contour(x, y, found.growth, levels=_levels(top), colors="#5b6270", linewidths=0.8)
        axes.clabel(lines, fmt="%g", fontsize=8)
        axes.contour(x, y, found.growth, levels=[0.0], colors="black", linewidths=2.0)
    kinds = {-1: "no equilibrium", 0: "no root grows", 1: "1 root grows"}
    seen = np.unique(found.unstable).astype(int)
    handles = [Patch(color=colours[k + 1], label=kinds.get(int(k), f"{k} roots grow")) for k in seen]
    axes.legend(handles=handles, loc="upper left", fontsize=9, framealpha=0.9)
    axes.set(xlabel=found.x.title, ylabel=found.y.title, xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))


def _levels(top: float) -> Array:
    """Round growth rates above zero, about five of them."""
    if not top > 0:
        return np.array([1e300])
    step = 10.0 ** np.floor(np.log10(top / 2))
    step *= next(k for k in (1, 2, 5, 10) if top / (k * step) <= 6)
    return np.arange(1, int(top / step) + 1) * step if top > step else np.array([0.5 * top])


def _grows(b: ComplexArray, found: Diagram) -> bool:
    """Whether a branch grows by more than its error somewhere."""
    for value, s, error in zip(b, found.s, found.error, strict=True):
        at = np.flatnonzero(s == value)
        if len(at) and value.real > max(found.neutral, float(error[at[0]])):
            return True
    return False


def _kilo(frequency: Array) -> float:
    return 1e3 if frequency.max(initial=0.0) >= 2e3 else 1.0


def _growth_scale(axes: Axes, growing: list[ComplexArray]) -> None:
    """Linear about 0 and logarithmic beyond, where growth rates differ by more than a factor of 20."""
    tops = [float(np.nanmax(b.real)) for b in growing]
    if tops and max(tops) > 20 * min(tops):
        width = max(min(tops), 1e-3 * max(tops))
        low, high = axes.get_ylim()
        axes.set_yscale("asinh", linear_width=width)
        decades = 10.0 ** np.arange(np.round(np.log10(width)), np.log10(max(abs(low), high)) + 1)
        ticks = [t for t in (*-decades[::-1], 0.0, *decades) if low <= t <= high]
        axes.set_yticks(ticks, [f"{t:g}" for t in ticks])
        axes.set_yticks([], minor=True)
        axes.set_ylim(low, high)

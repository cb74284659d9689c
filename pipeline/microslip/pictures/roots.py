"""Complex roots: in their plane, and growth and frequency over a parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..data import Array, ComplexArray
from ..roots.diagram import Diagram
from ..roots.spectrum import Spectrum
from ..units import to_rpm
from .plots import COLOURS, empty_figure, plain_axes, said_beside, single_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = (("stable", COLOURS[0], "o", COLOURS[0]), ("neutral", COLOURS[8], "s", "white"))
GREY = "#b4bac6"
LABELLED = 8
"""Roots that grow and are named in a picture."""


def spectrum_figure(found: Spectrum) -> Figure:
    """Roots in the complex plane: growth rate to the right, frequency upwards; the side that grows is tinted."""
    figure, axes = single_panel(7.0, 5.2)
    verdict, kilo = np.array(found.verdict), _kilo(found.frequency)
    y = found.frequency / kilo
    for kind, colour, mark, inside in (*KINDS, ("unstable", COLOURS[1], "^", COLOURS[1])):
        own = verdict == kind
        count = int(own.sum())
        axes.plot(
            found.growth[own], y[own], mark, color=colour, markerfacecolor=inside, markersize=7,
            label=f"{kind} ({count})", ls="", clip_on=False, zorder=3,
        )  # fmt: skip
    axes.axvline(0.0, color="#333333", linewidth=0.9)
    left, right = axes.get_xlim()
    right = max(right, 0.15 * (right - left))
    axes.axvspan(0.0, right, color=COLOURS[1], alpha=0.06, lw=0)
    axes.set_xlim(left, right)
    grow = np.flatnonzero(verdict == "unstable")
    for i in grow[np.argsort(-found.growth[grow])][:LABELLED]:
        text = f"{found.frequency[i]:.2f} Hz\n{found.growth[i]:+.4g} 1/s"
        beyond = found.growth[i] > left + 0.75 * (right - left)
        said_beside(
            axes, text, (found.growth[i], y[i]), (-8, 0) if beyond else (8, 0), fontsize=8, va="center",
            ha="right" if beyond else "left",
        )  # fmt: skip
    low, high = np.array(found.window.omega) / (2 * np.pi * kilo)
    high = high if np.isfinite(high) else 1.1 * max(float(y.max(initial=0.0)), 1e-12)
    axes.set(xlabel="growth rate in 1/s", ylabel=f"frequency in {'kHz' if kilo > 1 else 'Hz'}", ylim=(low, high))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def _kilo(frequency: Array) -> float:
    return 1e3 if frequency.max(initial=0.0) >= 2e3 else 1.0


def diagram_figure(found: Diagram) -> Figure:
    """Growth rate and frequency over the parameter: in colour what grows anywhere, the others grey."""
    figure = empty_figure(8.0, 7.2)
    above, below = figure.subplots(2, 1, sharex=True)
    branches = found.branches
    with np.errstate(invalid="ignore"):
        growing = [b for b in branches if (b.real > max(found.neutral, 0.0)).any() and _decided(b, found)]
        others = [b for b in branches if not any(b is g for g in growing)]
    growing.sort(key=lambda b: -float(np.nanmax(b.real)))
    x, label = _abscissa(found)
    kilo = _kilo(np.nan_to_num(branches.imag).ravel() / (2 * np.pi))
    for axes in (above, below):
        plain_axes(axes)
        for b in others:
            axes.plot(x, _values(axes is above, b, kilo), color=GREY, linewidth=1.0)
        for i, b in enumerate(growing):
            told = f"{np.nanmin(b.imag) / (2 * np.pi):.0f} to {np.nanmax(b.imag) / (2 * np.pi):.0f} Hz"
            axes.plot(x, _values(axes is above, b, kilo), color=COLOURS[i % len(COLOURS)], linewidth=1.8, label=told)
    above.axhline(0.0, color="#333333", linewidth=0.9)
    _growth_scale(above, growing, others)
    above.set_ylabel("growth rate in 1/s")
    below.set(xlabel=label, ylabel=f"frequency in {'kHz' if kilo > 1 else 'Hz'}")
    handles, labels = above.get_legend_handles_labels()
    if others:
        handles.append(above.plot([], [], color=GREY)[0])
        labels.append("never grow")
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 4), frameon=False, fontsize=9)
    return figure


def _decided(b: ComplexArray, found: Diagram) -> bool:
    """Whether a branch grows by more than its error somewhere."""
    for value, s, error in zip(b, found.s, found.error, strict=True):
        at = np.flatnonzero(s == value)
        if len(at) and value.real > max(found.neutral, float(error[at[0]])):
            return True
    return False


def _values(growth: bool, b: ComplexArray, kilo: float) -> Array:
    return b.real if growth else b.imag / (2 * np.pi * kilo)


def _growth_scale(axes: Axes, growing: list[ComplexArray], others: list[ComplexArray]) -> None:
    """Linear about 0 and logarithmic beyond, where growth rates differ by more than a factor of 20."""
    tops = [float(np.nanmax(b.real)) for b in growing]
    if tops and max(tops) > 20 * min(tops):
        axes.set_yscale("asinh", linear_width=max(min(tops), 1e-3 * max(tops)))
        axes.yaxis.set_major_formatter(lambda x, _: f"{x:g}")


def _abscissa(found: Diagram) -> tuple[Array, str]:
    if found.parameter == "speed":
        return to_rpm(found.values), "speed in rpm"
    return found.values, found.parameter

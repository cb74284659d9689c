"""Complex roots: in their plane, and growth and frequency over a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..bifurcation.cycles import Cycles
from ..roots.diagram import Diagram
from ..roots.map import Map
from ..roots.spectrum import Spectrum
from .plots import empty_figure, plain_axes, save_figure, single_panel


def plane_picture(found: Spectrum, path: Path) -> Path:
    """The roots in the complex plane."""
    figure, axes = single_panel(7.0, 5.2)
    found.plot(axes)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return save_figure(figure, path)


def over_picture(found: Diagram, path: Path) -> Path:
    """Growth rates above frequencies, over the parameter."""
    figure = empty_figure(8.0, 7.2)
    above, below = figure.subplots(2, 1, sharex=True)
    for axes in (above, below):
        plain_axes(axes)
    found.plot(above, "growth")
    found.plot(below, "frequency")
    above.set_xlabel("")
    handles, labels = above.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 3), frameon=False, fontsize=9)
    return save_figure(figure, path)


def map_picture(found: Map, full: Sequence[tuple[float, float, int]], path: Path) -> Path:
    """Where how many roots grow. full: states (x, y) counted in unreduced matrices, and their number there."""
    figure, axes = single_panel(7.0, 5.2)
    axes.grid(visible=False)
    found.plot(axes)
    for x, y, count in full:
        axes.plot(x, y, "o", color="#c8382c" if count else "white", markeredgecolor="black", markersize=7, zorder=4)
    return save_figure(figure, path)


def cycles_picture(found: Sequence[Cycles], title: str, path: Path) -> Path:
    """Amplitude of limit cycles over the parameter: in blue from supercritical Hopf points, dashed red from others."""
    figure, axes = single_panel(7.0, 4.4)
    for number, c in enumerate(found):
        columns = c.columns
        name = next(key for key in columns if key.startswith("amplitude"))
        kind, colour, line = ("super", "#0b4f9c", "-") if c.supercritical else ("sub", "#c8382c", "--")
        label = f"{c.hopf.omega / (2 * np.pi):.5g} Hz, {kind}critical"
        axes.plot(columns["parameter"], 1e6 * columns[name], line, color=colour, marker=".", label=label)
        axes.plot(c.hopf.p, 0.0, "o", color="white", markeredgecolor=colour, zorder=3)
        if number == 0:
            axes.set(xlabel=title, ylabel=f"{name} in um")
    axes.legend(frameon=False, fontsize=9)
    return save_figure(figure, path)

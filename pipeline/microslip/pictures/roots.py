"""Complex roots: in their plane, and growth and frequency over a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bifurcation.cycles import Cycles
from ..roots.diagram import Diagram
from ..roots.map import Map
from ..roots.spectrum import Spectrum
from ..units import Quantity
from .plots import RED, legend_below, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plane_picture(found: Spectrum, figure: Figure) -> None:
    """The roots in the complex plane."""
    (axes,) = panels(figure, (7.0, 5.2))
    found.plot(axes)
    legend_below(figure, 3, *axes.get_legend_handles_labels(), frameon=False)


def over_picture(found: Diagram, figure: Figure) -> None:
    """Growth rates above frequencies, over the parameter."""
    above, below = panels(figure, (8.0, 7.2), 2, sharex=True)
    found.plot(above, "growth")
    found.plot(below, "frequency")
    above.set_xlabel("")
    handles, labels = above.get_legend_handles_labels()
    legend_below(figure, min(len(labels), 3), handles, labels, frameon=False)


def map_picture(found: Map, full: Sequence[tuple[float, float, int]], figure: Figure) -> None:
    """Where how many roots grow. full: states (x, y) counted in unreduced matrices, and their number there."""
    (axes,) = panels(figure, (7.0, 5.2))
    axes.grid(visible=False)
    found.plot(axes)
    for x, y, count in full:
        axes.plot(x, y, "o", color=RED if count else "white", markeredgecolor="black", markersize=7, zorder=4)


KINDS = {"supercritical": "#0b4f9c", "subcritical": RED}
DOTS: dict[str, Any] = {"ls": "", "marker": "o", "markeredgecolor": "black"}
IN_TIME: dict[str, Any] = {**DOTS, "color": "#e8a013"}
NAMED_IN_TIME = "motions in time"


def cycles_picture(found: Sequence[Cycles], title: str, figure: Figure) -> None:
    """Amplitude of limit cycles over the parameter: in blue from supercritical Hopf points, in red from others;
    dots are motions in time."""
    (axes,) = panels(figure, (7.0, 4.4))
    scale, unit = _shared(found)
    for number, c in enumerate(found):
        columns, colour = c.columns, KINDS[c.kind]
        height, seen = (scale * columns[c.system.column(what)] for what in ("amplitude", "in time"))
        label = f"{c.hopf.omega / (2 * np.pi):.5g} Hz, {c.kind}"
        axes.plot(columns["parameter"], height, color=colour, marker=".", label=label)
        axes.plot(c.hopf.p, 0.0, "o", color="white", markeredgecolor=colour, zorder=3)
        label = "" if number else NAMED_IN_TIME
        axes.plot(columns["parameter"], seen, markersize=8, zorder=4, label=label, **IN_TIME)
    axes.set(xlabel=title, ylabel=f"amplitude {found[0].system.named[0]} in {unit}")
    axes.legend(frameon=False, fontsize=9)


def _shared(found: Sequence[Cycles]) -> tuple[float, str]:
    """Factor and unit of the amplitudes of all."""
    column = found[0].system.column("amplitude")
    return Quantity(*found[0].system.units[:1]).shared(np.concatenate([c.columns[column] for c in found]))


def relief_picture(found: Sequence[tuple[float, Cycles]], titles: tuple[str, str], figure: Figure) -> None:
    """Amplitude of limit cycles upwards over two parameters, Hopf points on the ground, motions in time as dots.

    Args:
        found: (value of the second parameter, cycles there). titles: of the two parameters.
    """
    figure.set_size_inches(8.0, 6.2)
    axes: Any = figure.add_subplot(projection="3d", computed_zorder=False)
    scale, unit = _shared([c for _, c in found])
    for depth, (value, c) in enumerate(reversed(found)):  # the nearest is drawn last
        _wall(axes, value, c, 3 * depth, scale)
    axes.set_xlabel(titles[0], labelpad=8)
    axes.set_ylabel(titles[1], labelpad=14)
    axes.set_zlabel(f"amplitude {found[0][1].system.named[0]} in {unit}")
    axes.set_yticks(sorted({value for value, _ in found})[:: -(-len(found) // 8)])
    axes.set_zlim(0.0)
    axes.view_init(24, -62)
    axes.set_box_aspect((1.3, 1.3, 0.8), zoom=0.95)
    handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    names = sorted(handles, key=[*KINDS, "Hopf points", NAMED_IN_TIME].index)
    lines = [handles[name] for name in names]
    figure.legend(lines, names, loc="outside upper center", ncols=4, frameon=False, fontsize=9)


def _wall(axes: Any, value: float, c: Cycles, order: int, scale: float) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    columns, colour = c.columns, KINDS[c.kind]
    x, z = np.append(c.hopf.p, columns["parameter"]), scale * np.append(0.0, columns[c.system.column("amplitude")])
    y, dots = np.full(len(x), value), scale * columns[c.system.column("in time")]
    wall = np.concatenate([np.column_stack([x, y, z]), np.column_stack([x, y, 0 * z])[::-1]])
    axes.add_collection3d(Poly3DCollection([wall], facecolor=colour, alpha=0.18, zorder=order))
    axes.plot(x, y, z, color=colour, linewidth=1.8, zorder=order + 1, label=c.kind)
    size: dict[str, Any] = {"markersize": 6, "zorder": order + 2}
    axes.plot(x[:1], y[:1], z[:1], color="white", label="Hopf points", **DOTS, **size)
    axes.plot(x[1:], y[1:], dots, label=NAMED_IN_TIME, **IN_TIME, **size)

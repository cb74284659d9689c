"""Pictures of bifurcations: branches over the parameter, orbits in their phase plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..bifurcation.branches import DiagramBranch
from ..bifurcation.diagram import Diagram
from ..units import Quantity
from .plots import COLOURS, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def diagram_picture(found: Diagram, figure: Figure, title: str, axis: str) -> None:
    """Half of the way from the smallest to the largest value of a read-out over the parameter."""
    (axes,) = panels(figure, (10.5, 5.4))
    found.plot(axes, axis)
    axes.set_title(title, fontweight="bold")


SHOWN = 6


def portraits_picture(found: Diagram, figure: Figure, title: str, unit: str) -> None:
    """Orbits of every branch in the phase plane of the first read-out, from its beginning to its end by colour."""
    shown = [b for b in found.branches if not b.still][:9]
    columns = min(len(shown), 3)
    rows = -(-len(shown) // columns)
    places = panels(figure, (4.4 * columns + 0.4, 4.0 * rows), rows, columns, len(shown))
    for axes, branch in zip(places, shown, strict=True):
        _portraits(found, branch, axes, unit)
    figure.suptitle(title, fontweight="bold")


def _portraits(found: Diagram, branch: DiagramBranch, axes: Axes, parameter_unit: str) -> None:
    for k, i in enumerate(dict.fromkeys(np.linspace(0, len(branch) - 1, SHOWN).round().astype(int).tolist())):
        orbit = branch.orbit(found.system, i)
        y = found.system.seen(orbit.sampled(16), orbit.p)[:, 0]
        y = np.append(y, y[0])
        velocity = np.gradient(np.concatenate([y[-3:-1], y, y[1:3]]), orbit.period / (len(y) - 1))[2:-2]
        style = "-" if branch.stable[i] else (0, (4, 3))
        label = f"{branch.parameter[i]:.4g} {parameter_unit}".strip()
        axes.plot(y, velocity, ls=style, lw=1.3, color=COLOURS[k], label=label)
    unit = Quantity(branch.units[0]).said if branch.units else ""
    axes.set(xlabel=f"{found.system.named[0]} in {unit}".removesuffix(" in "))
    axes.set(ylabel=f"velocity in {unit}/s" if unit else "velocity")
    axes.set_title(branch.name, fontsize=9)
    axes.legend(fontsize=7, frameon=False, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.14))

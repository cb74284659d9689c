"""Pictures of bifurcations: branches over the parameter, orbits in their phase plane."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..bifurcation.branches import SPECIAL, Branch
from ..bifurcation.diagram import Diagram
from ..units import METRES
from .plots import COLOURS, empty_figure, plain_axes, save_figure, single_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKS = {"Hopf": ("o", "Hopf point"), "fold": ("D", "fold"), "period doubling": ("s", "period doubling"),
         "torus": ("^", "torus point"), "branch point": ("X", "branch point")}  # fmt: skip


def diagram_picture(found: Diagram, path: Path, title: str, axis: str, read_out: int = 0) -> Path:
    """Half of the way from the smallest to the largest value of a read-out over the parameter."""
    figure, axes = single_panel(9.5, 5.6)
    draw(found, axes, axis, read_out)
    axes.set_title(title, fontweight="bold")
    return save_figure(figure, path)


def draw(found: Diagram, axes: Axes, axis: str, read_out: int = 0) -> None:
    """Branches in the axes: lines where stable, dashes where not, marks where something happens."""
    top = max(float(np.abs(b.swing[:, read_out]).max(initial=0.0)) for b in found.branches)
    factor, unit = METRES.scale(top) if found.system.unit == "m" else (1.0, found.system.unit)
    for i, branch in enumerate(found.branches):
        y = factor * branch.swing[:, read_out]
        colour = "#30343c" if branch.still else COLOURS[(i - 1) % len(COLOURS)]
        for part, stable in branch.stretches():
            style = "-" if stable else (0, (4, 3))
            axes.plot(branch.parameter[part], y[part], ls=style, color=colour, lw=2.2 if stable else 1.0)
    for kind in SPECIAL:
        places = [(float(b.parameter[i]), factor * float(b.swing[i, read_out])) for b in found.branches
                  for i in b.of_kind(kind)]  # fmt: skip
        if places:
            mark, words = MARKS[kind]
            axes.plot(*np.array(places).T, mark, color="white", mec="#30343c", ms=6, label=words, zorder=5)
    axes.plot([], [], "-", color="#30343c", lw=2.2, label="stable")
    axes.plot([], [], ls=(0, (4, 3)), color="#30343c", lw=1.0, label="unstable")
    name = found.system.named[read_out]
    axes.set(xlabel=axis, ylabel=f"{name}: amplitude in {unit}".removesuffix(" in "))
    axes.legend(fontsize=8, frameon=False, ncols=7, loc="lower left", bbox_to_anchor=(0.0, 1.06))


SHOWN = 6


def portraits_picture(found: Diagram, path: Path, title: str, unit: str) -> Path:
    """Orbits of every branch in the phase plane of the first read-out, from its beginning to its end by colour."""
    shown = [b for b in found.branches if not b.still][:9]
    columns = min(len(shown), 3)
    rows = -(-len(shown) // columns)
    figure = empty_figure(4.4 * columns + 0.4, 4.0 * rows)
    for axes, branch in zip(np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel(), shown, strict=False):
        plain_axes(axes)
        _portraits(found, branch, axes, unit)
    figure.suptitle(title, fontweight="bold")
    return save_figure(figure, path)


def _portraits(found: Diagram, branch: Branch, axes: Axes, unit: str) -> None:
    for k, i in enumerate(dict.fromkeys(np.linspace(0, len(branch) - 1, SHOWN).round().astype(int).tolist())):
        orbit = branch.orbit(found.system, i)
        y = found.system.seen(orbit.sampled(16), orbit.p)[:, 0]
        y = np.append(y, y[0])
        velocity = np.gradient(np.concatenate([y[-3:-1], y, y[1:3]]), orbit.period / (len(y) - 1))[2:-2]
        style = "-" if branch.stable[i] else (0, (4, 3))
        label = f"{orbit.p:.4g} {unit}".strip()
        axes.plot(y, velocity, ls=style, lw=1.3, color=COLOURS[k], label=label)
    axes.set(xlabel=found.system.named[0], ylabel="velocity")
    axes.set_title(branch.name, fontsize=9)
    axes.legend(fontsize=7, frameon=False)

"""Branches over the parameter, in matplotlib's axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..units import Quantity
from .branches import SPECIAL, Branch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKS = {"Hopf": ("o", "Hopf point"), "fold": ("D", "fold"), "period doubling": ("s", "period doubling"),
         "torus": ("^", "torus point"), "branch point": ("X", "branch point")}  # fmt: skip


def draw(
    branches: Sequence[Branch], dots: Sequence[tuple[float, float]], axes: Axes, axis: str, read_out: int = 0
) -> None:
    """Branches in the axes: lines where stable, dashes where not, marks where something happens."""
    top = max(float(np.abs(b.swing[:, read_out]).max(initial=0.0)) for b in branches)
    name, units = branches[0].outputs[read_out], branches[0].units
    factor, unit = Quantity(units[read_out]).scale(top) if units else (1.0, "")
    for i, branch in enumerate(branches):
        y = factor * branch.swing[:, read_out]
        colour = "#30343c" if branch.still else f"C{(i - 1) % 10}"
        axes.plot([], [], "-", color=colour, lw=2.2, label=branch.name)
        for part, stable in branch.stretches():
            style = "-" if stable else (0, (4, 3))
            axes.plot(branch.parameter[part], y[part], ls=style, color=colour, lw=2.2 if stable else 1.0)
    for kind in SPECIAL:
        places = [(float(b.parameter[i]), factor * float(b.swing[i, read_out])) for b in branches
                  for i in b.of_kind(kind)]  # fmt: skip
        if places:
            mark, words = MARKS[kind]
            axes.plot(*np.array(places).T, mark, color="white", mec="#30343c", ms=6, label=words, zorder=5)
    if dots:
        x, y = np.array(dots).T
        axes.plot(x, factor * y, ".", color="#30343c", ms=9, label="motions come here", zorder=6)
    axes.plot([], [], ls=(0, (4, 3)), color="#30343c", lw=1.0, label="unstable")
    axes.set(xlabel=axis, ylabel=f"{name}: amplitude in {unit}".removesuffix(" in "))
    axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))

"""Motions of two frequencies: spectrum, torus and time of a point; amplitudes over a frequency."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..results.tones import TwoTones
from ..units import Quantity
from .plots import empty_figure, plain_axes, save_figure, single_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def point_picture(found: TwoTones, i: int, path: Path, title: str) -> Path:
    """Spectrum and torus above, the motion in time below."""
    figure = empty_figure(9.0, 6.4)
    panels: dict[str, Axes] = figure.subplot_mosaic([["spectrum", "torus"], ["time", "time"]], height_ratios=[1.5, 1.0])
    for name in ("spectrum", "time"):
        plain_axes(panels[name])
    found.plot(panels["spectrum"], point=i)
    found.plot_torus(panels["torus"], i)
    time = np.linspace(0.0, 24.0 / (found.first[i] + found.second[i]), 2000)
    y = found.motion(time, i)
    by, unit = Quantity(found.units[0]).scale(float(np.abs(y).max(initial=0.0)))
    panels["time"].plot(time, by * y, color="#0b4f9c", linewidth=1.0)
    panels["time"].set(xlabel="time in s", ylabel=f"{found.readouts[0]} in {unit}", xlim=(0.0, time[-1]))
    if title:
        figure.suptitle(title)
    return save_figure(figure, path)


def curves_picture(found: TwoTones, path: Path, title: str) -> Path:
    """Amplitudes of the strongest pairs over the first frequency."""
    figure, axes = single_panel(7.0, 4.6)
    found.plot(axes)
    axes.set_title(title)
    return save_figure(figure, path)

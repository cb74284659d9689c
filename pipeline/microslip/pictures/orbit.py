"""Pictures of motions in time: phase portraits with the points after every period, and the last periods over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..data import Array
from .plots import COLOURS, empty_figure, length_scale, length_unit, plain_axes, plain_numbers, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..time_domain.orbit import Orbit

SHOWN = 4
"""Periods that are drawn over time."""
SPECTRUM = 1e-5
"""Share of its largest amplitude down to which a spectrum is drawn."""


def orbit_picture(orbit: Orbit, path: Path, title: str, read_out: int = 0) -> Path:
    """Phase portrait of a read-out, its last periods over time, and its spectrum."""
    figure = empty_figure(13.0, 4.3)
    left, middle, right = figure.subplots(1, 3)
    for axes in (left, middle, right):
        plain_axes(axes)
    portrait(orbit, left, read_out)
    _history(orbit, middle, read_out)
    _spectrum(orbit, right, read_out)
    left.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    figure.suptitle(title, fontweight="bold")
    return save_figure(figure, path)


def portraits(orbits: Sequence[tuple[str, Orbit]], path: Path, title: str) -> Path:
    """Phase portraits side by side, three in a row."""
    rows = -(-len(orbits) // 3)
    figure = empty_figure(4.4 * min(len(orbits), 3), 4.1 * rows)
    panels = np.atleast_1d(figure.subplots(rows, min(len(orbits), 3))).ravel()
    for axes, (name, orbit) in zip(panels, orbits, strict=False):
        plain_axes(axes)
        portrait(orbit, axes)
        axes.set_title("\n".join([name, *orbit.said.split(", ")]), fontsize=9)
    for axes in panels[len(orbits) :]:
        axes.set_visible(False)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", fontsize=9)
    figure.suptitle(title, fontweight="bold")
    return save_figure(figure, path)


def portrait(orbit: Orbit, axes: Axes, read_out: int = 0) -> None:
    """Velocity over displacement, and a point after every period of the excitation."""
    y, unit = length_unit(orbit.y[read_out])
    v, per_second = length_unit(orbit.v[read_out])
    axes.plot(y, v, color=COLOURS[0], linewidth=0.7)
    last = slice(orbit.samples - 1, None, orbit.samples)
    axes.plot(y[last], v[last], "o", color=COLOURS[1], markersize=4, label="after every period", zorder=4)
    axes.set(xlabel=f"{orbit.labels[read_out]} in {unit}", ylabel=f"velocity in {per_second}/s")


def _history(orbit: Orbit, axes: Axes, read_out: int) -> None:
    shown = slice(-SHOWN * orbit.samples, None)
    y, unit = length_unit(orbit.y[read_out])
    periods = (orbit.time[shown] - orbit.time[shown][0]) / orbit.period
    axes.plot(periods, y[shown], color=COLOURS[0], linewidth=1.0)
    axes.set(xlabel="time in periods of the excitation", ylabel=f"{orbit.labels[read_out]} in {unit}")


def _spectrum(orbit: Orbit, axes: Axes, read_out: int) -> None:
    """Amplitudes over multiples of the excitation, by a Hann window over all periods that are kept, down to
    `SPECTRUM` of the largest."""
    y = orbit.y[read_out]
    window = np.hanning(len(y))
    amplitude: Array = np.abs(np.fft.rfft(window * (y - y.mean()))) * 2 / window.sum()
    multiples = np.arange(len(amplitude)) * orbit.samples / len(y)
    seen = multiples <= min(12.0, orbit.samples / 2)
    _, unit = length_unit(1e-2 * amplitude)
    scaled, top = length_scale(unit) * amplitude, length_scale(unit) * amplitude.max(initial=1e-300)
    axes.semilogy(multiples[seen], np.maximum(scaled, 1e-300)[seen], color=COLOURS[2], lw=0.9)
    axes.set(xlabel="multiples of the excitation frequency", ylabel=f"amplitude in {unit}")
    axes.set_ylim(SPECTRUM * top, 2 * top)
    plain_numbers(axes.yaxis, (1.0,))

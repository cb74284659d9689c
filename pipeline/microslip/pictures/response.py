"""Two-dimensional pictures of results, by matplotlib, off-screen."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..case import CaseResult, CaseSettings
from ..case.run import lifted
from ..data import Array
from ..harmonic_balance import FrequencyResponse
from ..harmonic_balance.sweeps import overhanging
from ..results.names import apart
from ..units import METRES, Quantity
from .operating import shades
from .plots import plain_numbers, said_beside, through

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def response_picture(result: CaseResult, path: Path) -> None:
    """Amplitude over frequency for every normal force, with the free body and the sticking eigenfrequencies."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), dpi=130, layout="constrained")
    axes = figure.subplots()
    axes.plot(result.free.frequency, 1e6 * np.abs(result.free.monitor), color="0.6", lw=1, label="no contact")
    forces, colours = sorted(result.responses), shades(len(result.responses))
    lifts = False
    for colour, normal, said in zip(colours, forces, apart(forces), strict=True):
        r = result.responses[normal]
        apart_from_it = overhanging(r, result.resonances[normal])
        f, amplitude = _with_peaks(r, result.resonances[normal])
        on = ~np.isin(f, [at for at, _ in apart_from_it])
        if (off := lifted(result.built, r)).any():
            off = np.interp(f, r.frequency, off) > 0
            axes.plot(*through(f[on], np.where(off, amplitude, np.nan)[on]), color=colour, lw=1.8, ls=":")
            amplitude, lifts = np.where(off, np.nan, amplitude), True
        line = "-" if np.isfinite(amplitude).any() else ":"
        axes.plot([at for at, _ in apart_from_it], [1e6 * a for _, a in apart_from_it], "o", color=colour, ms=4)
        axes.plot(*through(f[on], amplitude[on]), color=colour, lw=1.6, ls=line, label=f"$F_N$ = {said} N")
    if any(np.abs(line.get_ydata()).max(initial=0.0) > 0 for line in axes.get_lines()):
        axes.set_yscale("log")
        plain_numbers(axes.yaxis, (1.0,))
    low, high = result.free.frequency[[0, -1]]
    axes.set_xlim(low, high)
    _stuck_lines(axes, result.stuck[(result.stuck > low) & (result.stuck < high)], (high - low) / 26)
    s = result.settings
    axes.set_xlabel("excitation frequency in Hz")
    axes.set_ylabel(f"amplitude of {_read(s, result.quantity)}, in {result.quantity.micro} (0-peak)")
    to = f" to {s.amplitude:g} N at {s.excitation}" if s.excitation else ""
    axes.set_title(f"{s.name}: friction response{to}")
    axes.grid(True, which="both", alpha=0.25)
    told = "dashed: sticking contacts"
    if len(result.responses) > 1:
        told += f" at $F_N$ = {max(result.responses):g} N"
    told += "; dotted: contacts would lift off, not valid" if lifts else ""
    handles, labels = _by_rows(*axes.get_legend_handles_labels(), LEGEND)
    figure.legend(handles, labels, loc="outside lower center", ncols=LEGEND, fontsize=9, title=told, title_fontsize=8)
    figure.savefig(path, format="png")


LEGEND = 6
"""Columns of the legend."""


def _by_rows(handles: list[Any], labels: list[str], columns: int) -> tuple[list[Any], list[str]]:
    """A legend, which is filled by columns, in the order in which its rows are read."""
    order = [i for column in range(columns) for i in range(column, len(labels), columns)]
    return [handles[i] for i in order], [labels[i] for i in order]


def _stuck_lines(axes: Axes, frequencies: Array, width: float) -> None:
    """A line at every frequency (Hz), its number on a side where there is so much room (Hz) for it."""
    taken, last = axes.get_xlim()
    for f, end in pairwise([*frequencies, last]):
        axes.axvline(f, color="0.75", lw=0.8, ls="--", zorder=0)
        right = end - f > width
        if right or f - width > taken:
            at = {"xycoords": ("data", "axes fraction"), "ha": "left" if right else "right"}
            said_beside(axes, f"{f:.0f}", (f, 0.0), (2 if right else -2, 3), fontsize=8, color="0.45", **at)
        taken = f + width if right else f


def _read(s: CaseSettings, of: Quantity) -> str:
    """The first read-out; without a direction where none is told, or of a gauge, which has its own."""
    first = s.outputs[0]
    if of != METRES or (s.monitor is None and "direction" not in first.model_fields_set):
        return first.monitor
    return f"{first.monitor}, {first.direction}"


def comparison_picture(
    case: CaseSettings, marched: Mapping[float, Array], book: Mapping[float, Array], path: Path, of: Quantity = METRES
) -> None:
    """Amplitude over frequency in both modes, a panel a normal force.

    Args:
        marched, book: normal force (N) -> (2, f) Hz and m, not a number where a point did not converge. of: what is
            read; m stands for its unit.
    """
    from matplotlib.figure import Figure

    rows = -(-len(marched) // 3)
    columns = min(len(marched), 3)
    figure = Figure(figsize=(4.2 * columns + 0.6, 3.2 * rows + 0.9), dpi=110, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True)
    for axes in panels.ravel()[len(marched) :]:
        axes.remove()
    for axes, force, told in zip(panels.ravel(), marched, apart(list(marched)), strict=False):
        axes.semilogy(marched[force][0], 1e6 * marched[force][1], color="#1f4e79", lw=2.2, label="marched in time")
        axes.semilogy(book[force][0], 1e6 * book[force][1], color="#d1603d", lw=1.4, ls="--", label="book")
        axes.set_title(f"$F_N$ = {told} N", fontsize=10)
        axes.grid(True, which="both", alpha=0.25)
    panels[0, 0].legend(fontsize=9, title=f"marched: H = {case.harmonics}", title_fontsize=8)
    figure.suptitle(f"{case.name}: the book's mode beside the marched laws", fontsize=11)
    figure.supxlabel("excitation frequency in Hz", fontsize=10)
    figure.supylabel(f"first harmonic of the read-out in {of.micro} (0-peak)", fontsize=10)
    figure.savefig(path, format="png")


def _with_peaks(r: FrequencyResponse, peaks: list[tuple[float, float]]) -> tuple[Array, Array]:
    """Frequency, Hz, and amplitude, millionths of its unit, at the points of a sweep and at the peaks found between
    them."""
    f = np.concatenate([r.frequency, [f for f, _ in peaks]])
    amplitude = np.concatenate([np.where(r.converged, np.abs(r.monitor), np.nan), [a for _, a in peaks]])
    order = np.argsort(f, kind="stable")
    return f[order], 1e6 * amplitude[order]

"""Two-dimensional pictures of results, by matplotlib, off-screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..case import CaseResult, CaseSettings
from ..case.messages import lifted
from ..case.readouts import Readout
from ..case.run import free_response
from ..data import Array
from ..harmonic_balance import FrequencyResponse
from ..harmonic_balance.response import HarmonicResponse
from ..harmonic_balance.sweeps import overhanging
from ..results.names import apart
from ..units import METRES, Quantity
from .plots import by_rows, in_shades, legend_below, mark_missing, plain_numbers, said_beside, swept
from .touch import tell_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TOGETHER = 6
"""Curves in a picture up to which read-outs of one unit share it."""
STYLES = ("-", "--", "-.")
"""Lines of read-outs that share a picture; dotted ones are not valid."""


def together(asked: Sequence[Readout], forces: int) -> list[Readout]:
    """Read-outs drawn beside the first one: those of its unit, where all curves are few."""
    alike = [w for w in asked if w.quantity == asked[0].quantity]
    return alike if len(alike) <= len(STYLES) and len(alike) * forces <= TOGETHER else alike[:1]


def response_picture(
    result: CaseResult, figure: Figure, shown: Sequence[Readout] = (), rows: Sequence[Mapping[str, Any]] = ()
) -> None:
    """Amplitude over frequency for every normal force, with the free body and the sticking eigenfrequencies.

    Args:
        shown: read-outs of one unit, the first one of the case if not given. rows: the table of resonances, which
            tells what the others read there.
    """
    shown = shown or result.readouts[:1]
    figure.set_size_inches(9, 6)
    figure.set_dpi(130)
    axes = figure.subplots()
    by, unit = shown[0].quantity.shared(_heights(result, rows, shown[0].quantity))
    styled, scale = zip(shown, STYLES, strict=False), (by, unit)
    lifts = [_curves(axes, result, w, rows, style, len(shown) > 1, scale) for w, style in styled]
    if any(np.abs(line.get_ydata()).max(initial=0.0) > 0 for line in axes.get_lines()):
        axes.set_yscale("log")
        plain_numbers(axes.yaxis, (1.0,))
    low, high = result.free.frequency[[0, -1]]
    axes.set_xlim(low, high)
    _stuck_lines(axes, result.stuck[(result.stuck > low) & (result.stuck < high)], (high - low) / 26)
    s, first = result.settings, shown[0]
    of = f" of {_read(s, first.quantity) if first.number == 0 else first.name}," if len(shown) == 1 else ""
    axes.set(xlabel="excitation frequency in Hz", ylabel=f"amplitude{of} in {unit} (0-peak)")
    axes.set_title(f"{s.name}: friction response{_driven_by(result)}")
    axes.grid(True, which="both", alpha=0.25)
    words = "dashed, grey: sticking contacts" if len(shown) > 1 else "dashed: sticking contacts"
    if len(result.responses) > 1:
        words += f" at $F_N$ = {max(result.responses):g} N"
    words += "; dotted: contacts would lift off, not valid" if any(lifts) else ""
    words += "; in time: triangles swept up and down, crosses from rest" if any(b.down for b in result.beyond) else ""
    columns = 6 if len(shown) == 1 else 3
    order = by_rows(*axes.get_legend_handles_labels(), columns)
    legend_below(figure, columns, *order, title=words, title_fontsize=8)


def _heights(result: CaseResult, rows: Sequence[Mapping[str, Any]], of: Quantity) -> list[float]:
    """Amplitudes of the resonances that are valid, of all read-outs of a quantity; those of the sweeps without any."""
    columns = [w.column for w in result.readouts if w.quantity == of] + [of.column("amplitude")]
    valid = [row for row in rows if "not valid" not in row.get("doubt", "")] or rows
    found = [float(row[c]) for row in valid for c in columns if c in row]
    return found or [float(np.abs(r.monitor[r.converged]).max(initial=0.0)) for r in result.responses.values()]


def _driven_by(result: CaseResult) -> str:
    """The only excitation, if it is one; a force or a pressure."""
    s, assembly = result.settings, result.built.assembly
    if not s.excitation:
        return ""
    load = assembly.loads[0]
    groups = next(m for m in assembly.components if m.name == load.component).groups
    unit = next(iter(groups.values())).excitations[load.row].unit
    return f" to {s.amplitude:g} {unit} at {s.excitation}"


def _curves(
    axes: Axes, result: CaseResult, w: Readout, rows: Sequence[Mapping[str, Any]], style: str, named: bool,
    scale: tuple[float, str],
) -> bool:  # fmt: skip
    """Draw a read-out without contact and for every normal force, its amplitudes times a factor and in that unit;
    whether contacts would lift off somewhere."""
    of, built, (by, unit) = f", {w.name}" * named, result.built, scale
    free = result.free
    if w.number:
        read = replace(built.assembly, outputs=built.assembly.outputs[w.number :])
        grid = result.settings.sweep.grid
        free = free_response(replace(built, assembly=read), grid)
    axes.plot(free.frequency, by * np.abs(free.monitor), color="0.6", lw=1, ls=style, label=f"no contact{of}")
    words, lifts = dict(zip(sorted(result.responses), apart(sorted(result.responses)), strict=True)), False
    for line, normal, r in in_shades(result.responses):
        peaks = result.resonances[normal]
        apart_from_it = [f for f, _ in overhanging(r, peaks)]
        if w.number:
            r = replace(r, monitor=r.outputs[:, w.number, 1])
            heights = {row["frequency_Hz"]: row[w.column] for row in rows if row["normal_force_N"] == normal}
            peaks = [(f, heights[f]) for f, _ in peaks if f in heights]
        _tell(axes, r, by, unit, line["color"], f"F_N = {words[normal]} N{of}")
        f, amplitude = _with_peaks(r, peaks, by)
        on = ~np.isin(f, apart_from_it)
        off = np.interp(f, r.frequency, lifted(built, r)) > 0
        lifts |= bool(off.any())
        single = [(f, by * a) for f, a in peaks if f in apart_from_it]
        axes.plot(*np.reshape(single, (-1, 2)).T, "o", color=line["color"], ms=4)
        label = f"$F_N$ = {words[normal]} N{of}"
        swept(axes, f[on], amplitude[on], off[on], partial(result.unsure, normal), style, label=label, **line)
    for row, (line, normal, r) in enumerate(in_shades(result.responses) if w.number == 0 else ()):
        mark_missing(axes, r.frequency[~r.converged], line["color"], row)
        for one in (b for b in result.beyond if b.normal == normal):
            for motions, mark in ((one.up, "^"), (one.down, "v"), (one.rest, "x")):
                at = [(m.frequency, by * m.amplitude) for m in motions]
                axes.plot(*np.reshape(at, (-1, 2)).T, mark, color=line["color"], ms=4, mfc="none")
    return lifts


def _tell(axes: Axes, r: HarmonicResponse, by: float, unit: str, colour: Any, label: str) -> None:
    """What every point of a response is, for pages whose curves are pointed at."""
    ok, columns = r.converged, r.columns()
    amplitude = by * np.abs(r.monitor[ok])
    each = {
        "frequency in Hz": r.frequency[ok],
        f"amplitude in {unit}": amplitude,
        "phase in degrees": np.degrees(np.angle(r.monitor[ok])),
        "slip in %": 100 * columns["slipping"][ok],
        "open in %": 100 * columns["open"][ok],
        "lost in friction in J per cycle": r.dissipated[ok],
    }
    tell_points(axes, r.frequency[ok], amplitude, each, colour, label)


def _stuck_lines(axes: Axes, frequencies: Array, width: float) -> None:
    """A line at every frequency (Hz), its number on a side where there is so much room (Hz) for it."""
    taken, last = axes.get_xlim()
    for f, end in zip(frequencies, [*frequencies[1:], last], strict=False):  # nothing of none
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
    case: CaseSettings, marched: Mapping[float, Array], book: Mapping[float, Array], figure: Figure,
    of: Quantity = METRES,
) -> None:  # fmt: skip
    """Amplitude over frequency in both modes, a panel a normal force.

    Args:
        marched, book: normal force (N) -> (2, f) Hz and m, not a number where a point did not converge. of: what is
            read; m stands for its unit.
    """
    rows, columns = -(-len(marched) // 3), min(len(marched), 3)
    figure.set_size_inches(4.2 * columns + 0.6, 3.2 * rows + 0.9)
    scale, unit = of.shared(np.concatenate([a for _, a in (*marched.values(), *book.values())]))
    places = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
    for axes in places[len(marched) :]:
        axes.remove()
    for axes, force, words in zip(places, marched, apart(list(marched)), strict=False):
        axes.semilogy(marched[force][0], scale * marched[force][1], color="#1f4e79", lw=2.2, label="marched in time")
        axes.semilogy(book[force][0], scale * book[force][1], color="#d1603d", lw=1.4, ls="--", label="book")
        axes.set_title(f"$F_N$ = {words} N", fontsize=10)
        axes.grid(True, which="both", alpha=0.25)
    places[0].legend(fontsize=9, title=f"marched: H = {case.harmonics}", title_fontsize=8)
    figure.suptitle(f"{case.name}: the book's mode beside the marched laws", fontsize=11)
    figure.supxlabel("excitation frequency in Hz", fontsize=10)
    figure.supylabel(f"first harmonic of the read-out in {unit} (0-peak)", fontsize=10)


def _with_peaks(r: FrequencyResponse, peaks: list[tuple[float, float]], by: float) -> tuple[Array, Array]:
    """Frequency, Hz, and amplitude times a factor at the points of a sweep and at the peaks found between them."""
    f = np.concatenate([r.frequency, [f for f, _ in peaks]])
    amplitude = np.concatenate([np.where(r.converged, np.abs(r.monitor), np.nan), [a for _, a in peaks]])
    order = np.argsort(f, kind="stable")
    return f[order], by * amplitude[order]

"""Curves by matplotlib: compliance over the number of modes, Campbell diagram, pressure of closed faces."""

from __future__ import annotations

import io
import json
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ..data import Array, ContactState, ModalBasis, ModalGroup
from ..files.png import CURVES, with_text
from ..files.store import complete_or_absent
from ..modal.campbell import SURE, VISIBLE, Crossing, Tracks, crossings, gyroscopic_change, parted
from ..reduced.truncation import Coordinate, coordinates, percent
from ..results.checks import UNCERTAIN
from ..units import METRES, from_rpm, rpm_text, to_rpm
from .touch import curves_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    from ..modal.closures import ContactCurve

COLOURS = ("#0b4f9c", "#c8382c", "#26863c", "#8a4fb5", "#d98410", "#16919c", "#8c564b", "#c2408f", "#5b6270", "#94a112")


def empty_figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=110, layout="constrained")


def single_panel(width: float, height: float) -> tuple[Figure, Axes]:
    """A figure (inches) of a single diagram."""
    figure = empty_figure(width, height)
    axes = figure.subplots()
    plain_axes(axes)
    return figure, axes


def save_figure(figure: Figure, path: Path) -> Path:
    """As PNG, complete or absent, without a date in it."""
    with complete_or_absent(path) as temporary:
        write_png(figure, temporary)
    return path


def write_png(figure: Figure, to: Path | IO[bytes]) -> None:
    """Arranged while it is drawn; `savefig` draws once more before, for formats that are cut to size. Its curves go
    into the file, from where pages take them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure.set_facecolor("white")
    drawn = io.BytesIO()
    FigureCanvasAgg(figure).print_png(drawn, metadata={"Software": None})
    png, curves = drawn.getvalue(), curves_of(figure)
    png = png if curves is None else with_text(png, CURVES, json.dumps(curves, separators=(",", ":")))
    to.write_bytes(png) if isinstance(to, Path) else to.write(png)


def plain_axes(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#dde0e6", linewidth=0.7)
    axes.set_axisbelow(True)


def through(x: Array, y: Array, each: int = 8) -> tuple[Array, Array]:
    """A line through points (x rising, y positive or not a number) that rounds resonances: 1 / y^2, a parabola near one
    is interpolated by cubics that keep its rises and falls, so that none is added."""
    from scipy.interpolate import PchipInterpolator

    fine = np.interp(np.arange(0, len(x) - 1 + 1e-9, 1 / each), np.arange(len(x)), x)
    out = np.interp(fine, x, y)
    known = np.flatnonzero(np.isfinite(y) & (y > 0))
    for run in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        if len(run) > 2 and (np.diff(x[run]) > 0).all():
            inside = (fine >= x[run[0]]) & (fine <= x[run[-1]])
            scale = y[run].max()
            out[inside] = scale / np.sqrt(PchipInterpolator(x[run], (scale / y[run]) ** 2)(fine[inside]))
    return fine, out


LIGHT = 0.35
"""How much of its colour a curve keeps where it is uncertain."""


def lighter_means() -> str:
    """For a legend."""
    return f"lighter: uncertain by more than {100 * UNCERTAIN:g} %"


def lighter(axes: Axes, x: Array, y: Array, unsure: Array, **line: Any) -> None:
    """A curve, lighter where its points (bool, like x) are uncertain; the first one of an axes is told in the
    legend."""
    axes.plot(x, np.where(unsure, np.nan, y), **line)
    if unsure.any():
        told = lighter_means()
        label = "_" if told in axes.get_legend_handles_labels()[1] else told
        axes.plot(x, np.where(unsure, y, np.nan), **(line | {"alpha": LIGHT, "label": label}))


def widths(count: int) -> list[float]:
    """Widths of curves that may coincide, in the order in which they are drawn: those below are wider, so that all are
    seen. A single one is as wide as the last."""
    return np.linspace(1.6 + min(1.2 * (count - 1), 3.2), 1.6, count).tolist()


def mark_missing(axes: Axes, x: Array, colour: Any, row: int = 0) -> None:
    """Crosses at the lower edge where a curve has no point that converged, those of each curve in a row of its own; the
    first ones of an axes are told in the legend."""
    if not len(x):
        return
    told = "did not converge"
    label = "_" if told in axes.get_legend_handles_labels()[1] else told
    height = np.full(len(x), 0.015 + 0.02 * row)
    how: dict[str, Any] = {"ms": 5, "mew": 1.3, "clip_on": False, "zorder": 5, "label": label}
    axes.plot(x, height, "x", color=colour, transform=axes.get_xaxis_transform(), **how)


def said_beside(axes: Axes, text: str, at: tuple[float, float], shift: tuple[float, float], **how: Any) -> None:
    """Words beside a place of a diagram, so many points to the right and above it."""
    axes.annotate(text, at, xytext=shift, textcoords="offset points", **how)


def whole_numbers(axes: Axes) -> None:
    """Along the abscissa."""
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def plain_numbers(axis: Axis, within: tuple[float, ...]) -> None:
    """Numbers without powers of ten on a logarithmic axis, at these multiples of every power."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=within))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.set_minor_formatter(NullFormatter())


# --- closure -------------------------------------------------------------------------------------------------------


def closure_curve_plot(curve: ContactCurve, title: str, path: Path) -> Path:
    """Normal force of a closure over the approach of its faces, and its slope, the stiffness of the contact."""
    figure = empty_figure(10.5, 3.9)
    scale, unit = METRES.scale(float(np.abs(curve.approach).max()))
    panels = (
        (curve.force, "normal force in N"),
        (curve.stiffness, "stiffness in N/m"),
        (100 * curve.closed_share, "share of the face in contact in %"),
    )
    for axes, (y, name) in zip(figure.subplots(1, 3), panels, strict=True):
        plain_axes(axes)
        axes.plot(scale * curve.approach, y, "-o", color=COLOURS[0], linewidth=1.6, markersize=4)
        axes.set_xlabel(f"approach of the faces in {unit}")
        axes.set_ylabel(name)
        axes.set_ylim(0, 1.08 * max(float(y.max()), 1e-300))
        axes.ticklabel_format(axis="y", scilimits=(-3, 5), useMathText=True)
    figure.suptitle(title, fontweight="bold")
    return save_figure(figure, path)


# --- compliance ----------------------------------------------------------------------------------------------------

_STYLE = {
    "u_n": ("#c8382c", "-"), "u_t1": ("#26863c", "-"), "u_t2": ("#0b4f9c", "-"),
    "phi_n": ("#c8382c", ":"), "phi_t1": ("#26863c", ":"), "phi_t2": ("#0b4f9c", ":"), "squeezed": ("#111111", "-"),
}  # fmt: skip


def compliance_plot(basis: ModalBasis, group: ModalGroup, path: Path, most: int = 12) -> Path | None:
    """Share of the static compliance over the number of modes, one panel an interface (None without rows)."""
    panels: dict[str, list[Coordinate]] = {}
    for c in coordinates(group):
        where = {"squeeze": "pressed from both sides", "excitation": "excitations", "monitor": "monitors"}.get(
            c.kind, c.label.rsplit(" ", 1)[0]
        )
        panels.setdefault(where, []).append(c)
    if not panels:
        return None
    names = list(panels)[:most]
    columns = min(len(names), 3)
    rows = math.ceil(len(names) / columns)
    figure = empty_figure(max(4.8 * columns, 6.0), 0.9 + 2.9 * rows)  # the legends stand beside the panels
    table = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, name in zip(table, names, strict=False):
        _compliance_panel(axes, name, panels[name], group.n_modes)
    for axes in table[len(names) :]:
        axes.set_visible(False)
    figure.supxlabel("number of modes kept")
    figure.supylabel("share of the static compliance in %")
    more = f" (first {most} of {len(panels)} panels)" if len(panels) > most else ""
    figure.suptitle(f"{basis.name}: how much of the static compliance the modes hold{more}", fontweight="bold")
    return save_figure(figure, path)


def _compliance_panel(axes: Axes, name: str, found: Sequence[Coordinate], count: int) -> None:
    plain_axes(axes)
    axes.axhline(100, color="#5b6270", linewidth=0.8)
    kept = np.arange(count + 2)
    for i, c in enumerate(found):
        short = c.label.rsplit(" ", 1)[-1] if c.kind != "excitation" else c.label.rsplit(" ", 1)[0]
        short = c.label if c.kind == "monitor" else short
        colour, line = _STYLE.get(short, (COLOURS[i % len(COLOURS)], "-"))
        label = f"{c.label.removesuffix(' squeezed') if c.kind == 'squeeze' else short}  {percent(c.share)}"
        share = 100 * np.concatenate([[0.0], c.shares, [c.share]])
        axes.step(kept, share, line, where="post", color=colour, label=label, linewidth=1.6)
    axes.set_title(name, fontsize=10)
    axes.set_xlim(0, count + 0.6)
    axes.set_ylim(-3, 106)
    whole_numbers(axes)
    axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, handlelength=1.4)


# --- Campbell ------------------------------------------------------------------------------------------------------


def campbell_plot(basis: ModalBasis, tracks: Tracks, orders: Sequence[int], path: Path) -> Path:
    """Frequencies over the speed with engine-order lines and their crossings; rigid motions are left out."""
    moving = np.nanmax(tracks.omega, axis=1) > 0
    if moving.any():
        tracks = replace(tracks, modes=tracks.modes[moving], omega=tracks.omega[moving], mac=tracks.mac[moving])
    figure, axes = single_panel(8.6, 6.4)
    orders = sorted({k for k in orders if k > 0})
    top = _ceiling(tracks, orders)
    rpm = to_rpm(np.linspace(tracks.speeds[0], tracks.speeds[-1], 201))
    split = parted(basis)
    _curves(axes, tracks, rpm, top)
    if split is not None:
        _split(axes, basis, split, rpm, top)
    for order in orders:
        axes.plot(rpm, order * rpm / 60, color="#5b6270", linewidth=0.9, linestyle=(0, (5, 3)), zorder=1.5)
        _order_label(axes, order, rpm[-1], top)
    _mark(axes, [c for c in crossings(split or tracks, orders) if c.frequency <= top])
    _campbell_frame(axes, basis, rpm, top, tracks)
    return save_figure(figure, path)


_WHIRL = {"forward": "^", "backward": "v", "mixed": "x"}


def _split(axes: Axes, basis: ModalBasis, split: Tracks, rpm: Array, top: float) -> None:
    """The branches with gyroscopic coupling, thin and dark, with the direction at every station."""
    ink = "#30343c"
    for c in range(len(split.modes)):
        f = split.frequency(c, from_rpm(rpm))
        axes.plot(rpm, np.where(f <= top, f, np.nan), color=ink, linewidth=0.9, linestyle=(0, (4, 1.5)), zorder=2.5)
    for way, mark in _WHIRL.items():
        at = [
            (to_rpm(g.speed), f)
            for (_, h), g in sorted(basis.groups.items())
            if g.gyroscopic is not None and h == 0
            for f, direction in zip(g.gyroscopic.frequency, g.gyroscopic.direction, strict=True)
            if direction == way and f <= top
        ]
        if at:
            axes.plot(*zip(*at, strict=True), mark, color=ink, markersize=4.5, zorder=3.5, label=way, clip_on=False)
    axes.legend(title="with gyroscopic coupling,\nrotating frame", loc="upper left", fontsize=8, title_fontsize=8)


def _ceiling(tracks: Tracks, orders: Sequence[int]) -> float:
    """Hz shown: all modes, or with engine orders the part they reach and a bit more, the lowest mode at least."""
    highest = float(np.nanmax(tracks.omega)) / (2 * np.pi)
    if not orders:
        return 1.05 * highest
    reached = max(orders) * tracks.speeds[-1] / (2 * np.pi)
    lowest = np.nanmin(tracks.omega, axis=1) / (2 * np.pi)
    above = lowest[(lowest > 1.1 * reached) & (lowest < 1.5 * reached)]
    least = 1.1 * float(np.nanmax(tracks.omega, axis=1).min()) / (2 * np.pi)
    return float(min(1.05 * highest, max([1.2 * reached, least, *(1.1 * above)])))


def _curves(axes: Axes, tracks: Tracks, rpm: Array, top: float) -> None:
    speeds = np.union1d(from_rpm(rpm), tracks.speeds)  # a curve may be of one station
    labels, rpm = [], to_rpm(speeds)
    for c in range(len(tracks.modes)):
        f = tracks.frequency(c, speeds)
        if np.nanmin(f) > top:
            continue
        colour = COLOURS[c % len(COLOURS)]
        known = tracks.modes[c] >= 0
        axes.plot(rpm, f, color=colour, linewidth=1.8)
        at = tracks.speeds[known] if tracks.solved is None else tracks.solved
        stations = tracks.frequency(c, at)
        shown = stations <= top
        axes.plot(to_rpm(at[shown]), stations[shown], "o", color=colour, markersize=4.5, clip_on=False, zorder=3)
        for step in np.flatnonzero(tracks.mac[c] < SURE):
            part = (speeds >= tracks.speeds[step]) & (speeds <= tracks.speeds[step + 1])
            axes.plot(rpm[part], f[part], color="white", linewidth=2.4, linestyle=(0, (2, 3)))
        end = int(np.flatnonzero(np.isfinite(f) & (f <= top))[-1])
        first = int(tracks.modes[c][known][0]) + 1
        labels.append((float(f[end]), float(rpm[end]), f"mode {first}", colour))
    _end_labels(axes, labels, float(rpm[-1]), top)


def _end_labels(axes: Axes, labels: list[tuple[float, float, str, str]], last: float, top: float) -> None:
    """Name each curve at its right end, moved apart where two would overlap."""
    gap, y = 0.032 * top, -math.inf
    for f, x, text, colour in sorted(labels):
        y = max(f, y + gap)
        cut = x < last  # leaves the picture through its upper edge
        at, shift = ((x, f), (5, -8)) if cut else ((x, y), (6, 0))
        said_beside(axes, text, at, shift, color=colour, annotation_clip=False, va="center", fontsize=8.5)


def _order_label(axes: Axes, order: int, last: float, top: float, text: str = "") -> None:
    """On the line, near where it leaves the picture; a text of one's own stands at the speed `last`, rpm."""
    from matplotlib.patheffects import withStroke

    x = last if text else min(last, 60 * top / order) * 0.96
    behind = [withStroke(linewidth=6, foreground="white")]
    axes.text(
        x, order * x / 60, text or f"EO {order}", ha="center", va="center", fontsize=8, color="#3c424e",
        path_effects=behind,
    )  # fmt: skip


def _mark(axes: Axes, found: Sequence[Crossing]) -> None:
    x = [to_rpm(c.speed) for c in found]
    axes.plot(
        x, [c.frequency for c in found], "o", mfc="white", mec="#111111", markersize=6, zorder=4, linestyle="none"
    )


def _campbell_frame(axes: Axes, basis: ModalBasis, rpm: Array, top: float, tracks: Tracks) -> None:
    axes.set_xlim(rpm[0], rpm[-1])
    axes.set_ylim(0, top)
    axes.set_xlabel("rotation speed in rpm")
    axes.set_ylabel("frequency in Hz")
    note = "dots: computed; curves joined by MAC; circles: engine order meets mode"
    if tracks.solved is not None:
        note = f"dots: computed; curves: {len(tracks.speeds)} speeds of the range, joined by MAC; circles: crossings"
    shown = np.nanmin(tracks.omega, axis=1) / (2 * np.pi) <= top
    if (tracks.mac[shown] < SURE).any():
        note += f"; dotted: MAC below {SURE:g}, add speeds"
    if (change := gyroscopic_change(basis)) and change <= VISIBLE:
        note += f"; gyroscopic coupling changes them by less than {100 * VISIBLE:g} %"
    elif change:
        note += "; engine orders meet the branches with gyroscopic coupling"
    if not shown.all():
        note += f"; {int((~shown).sum())} modes lie above"
    axes.set_title(f"{basis.name}: Campbell diagram", fontweight="bold")
    note = textwrap.fill(note, 110)
    axes.text(0.5, -0.13, note, transform=axes.transAxes, ha="center", va="top", fontsize=8, color="#5b6270")


# --- static contact ------------------------------------------------------------------------------------------------


MOST_CLOSURES, CURVES_BESIDE = 12, 3
"""Closures whose pressure is drawn, and up to how many stand one below the other with a force curve each."""


def closure_plot(basis: ModalBasis, path: Path) -> Path | None:
    """Pressure on every face that touches at the highest speed, and its normal force over the speeds (or None)."""
    states = {g.speed: g.contacts for g in basis.groups.values() if g.contacts}
    if not any(c.normal_force for contacts in states.values() for c in contacts.values()):
        return None
    states = dict(sorted(states.items()))
    names = list(states[max(states)])
    draw = _closures_beside if len(names) <= CURVES_BESIDE else _closures_tiled
    figure = draw(states, names[:MOST_CLOSURES])
    more = f" (first {MOST_CLOSURES} of {len(names)})" if len(names) > MOST_CLOSURES else ""
    figure.suptitle(f"{basis.name}: contact at {rpm_text(max(states))}{more}", fontweight="bold")
    return save_figure(figure, path)


States = Mapping[float, Mapping[str, ContactState]]


def _closures_beside(states: States, names: Sequence[str]) -> Figure:
    """A row for each closure: its pressure, and its force over the speeds."""
    several = len(states) > 1
    last = states[max(states)]
    figure = empty_figure(9.6, 0.4 + sum(_height(last[name], 5.2 if several else 8.6) for name in names))
    panels = figure.subplots(len(names), 2 if several else 1, squeeze=False, width_ratios=[3, 2] if several else [1])
    for row, name in zip(panels, names, strict=True):
        _pressure_map(row[0], name, last[name])
        if several:
            _force_curves(row[1], states, [name])
    return figure


def _closures_tiled(states: States, names: Sequence[str], columns: int = 4) -> Figure:
    """Pressures beside each other, and all forces in one diagram below."""
    rows, several = math.ceil(len(names) / columns), len(states) > 1
    last = states[max(states)]
    high = [max(_height(last[name], 2.6) for name in names)] * rows + [3.0] * several
    figure = empty_figure(3.4 * columns, 0.4 + sum(high))
    grid = figure.add_gridspec(rows + several, columns, height_ratios=high)
    for i, name in enumerate(names):
        _pressure_map(figure.add_subplot(grid[i // columns, i % columns]), name, last[name])
    if several:
        axes = figure.add_subplot(grid[rows, :])
        _force_curves(axes, states, names)
        axes.legend(fontsize=8, ncols=2, loc="upper left")
    return figure


def _force_curves(axes: Axes, states: States, names: Sequence[str]) -> None:
    """Normal forces over the speeds that were solved for."""
    plain_axes(axes)
    rpm = [to_rpm(speed) for speed in states]
    for i, name in enumerate(names):
        force = [contacts[name].normal_force for contacts in states.values()]
        axes.plot(rpm, force, "o-", color=COLOURS[i % len(COLOURS)], label=name)
    axes.set(xlabel="rotation speed in rpm", ylabel="normal force in N", ylim=(0, None))


def _on_face(c: ContactState) -> tuple[Array, Array]:
    """Coordinates of a face's points along its two long directions, mm."""
    middle = c.points - c.points.mean(axis=0)
    x, y = 1e3 * (middle @ np.linalg.svd(middle, full_matrices=False)[2][:2].T).T
    return x, y


def _height(c: ContactState, width: float) -> float:
    """Inches that the map of a face needs, drawn so wide, with its title and colour bar."""
    x, y = _on_face(c)
    return 1.75 + width * min(float(np.ptp(y)) / max(float(np.ptp(x)), 1e-9), 0.6)


def _pressure_map(axes: Axes, name: str, c: ContactState) -> None:
    """The face seen along its normal: points sized by their area, coloured by the pressure."""
    x, y = _on_face(c)
    order = np.argsort(c.pressure, kind="stable")
    box = max(float(np.ptp(x)), float(np.ptp(y)), 1e-9)
    size = np.clip(c.areas * 1e6 / box**2 * 4e4, 6, 200)
    shown = axes.scatter(
        x[order], y[order], s=size[order], c=1e-6 * c.pressure[order], cmap="YlOrRd", vmin=0, edgecolors="#8a929c",
        linewidths=0.4,
    )  # fmt: skip
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.set(xlabel="mm along the face", ylabel="mm")
    axes.set_title(f"{name}: {c.normal_force:.4g} N\non {percent(c.closed_share)} of the face", fontsize=10)
    axes.figure.colorbar(shown, ax=axes, label="pressure in MPa", location="bottom", shrink=0.6)


def by_rows(handles: list[Any], labels: list[str], columns: int) -> tuple[list[Any], list[str]]:
    """A legend, which is filled by columns, in the order in which its rows are read."""
    order = [i for column in range(columns) for i in range(column, len(labels), columns)]
    return [handles[i] for i in order], [labels[i] for i in order]

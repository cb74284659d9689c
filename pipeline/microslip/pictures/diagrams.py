"""Diagrams of a cyclic body by matplotlib: nodal diameters, interference (SAFE, ZZENF), Campbell of every wave."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, ModalBasis
from ..modal.campbell import Tracks
from ..ring.expansion import FORWARD, STANDING, aliased
from ..ring.neighbours import closed_gap, stuck
from ..ring.resonances import (
    Families,
    Margin,
    Resonance,
    eigenmodes,
    families,
    family_ranges,
    harmonics_of,
    margins,
    resonances,
    speeds_of,
    tracks,
    wave_tracks,
    zigzag,
)
from ..units import from_rpm, rpm_text, to_rpm
from .plots import (
    COLOURS,
    _end_labels,
    _order_label,
    empty_figure,
    plain_axes,
    said_beside,
    save_figure,
    single_panel,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CLOSE = 0.05
"""Modes nearer than this part to an engine order that excites them are marked in the interference diagram."""

MOST_PANELS = 4

INK, FAINT = "#111111", "#5b6270"


def _colour(family: int) -> str:
    return COLOURS[family % len(COLOURS)]


def _hertz(omega: Array) -> Array:
    return omega / (2 * np.pi)


def _note(axes: Axes, text: str, below: float) -> None:
    axes.text(0.5, below, text, transform=axes.transAxes, ha="center", va="top", fontsize=8, color=FAINT, wrap=True)


# --- nodal diameters -----------------------------------------------------------------------------------------------


def nodal_diameter_plot(basis: ModalBasis, path: Path) -> Path:
    """Frequency over nodal diameter at the lowest and the highest speed, one line a family."""
    figure, axes = single_panel(8.6, 6.0)
    ends = dict.fromkeys((speeds_of(basis)[0], speeds_of(basis)[-1]))
    shown = [families(basis, s) for s in ends]
    top = 1.05 * max(float(eigenmodes(basis.groups[s, k]).frequency.max()) for s in ends for k in harmonics_of(basis))
    for i, (speed, found) in enumerate(zip(ends, shown, strict=True)):
        _family_lines(axes, found, top, solid=i == 0)
        _others(axes, basis, speed, found, top)
    axes.set_ylim(0, top)
    _family_labels(axes, shown[-1], top)
    _nodal_axis(axes, basis)
    axes.set_ylabel("frequency in Hz")
    axes.set_title(f"{basis.name}: nodal diameters of {basis.sectors} sectors", fontweight="bold")
    note = "lines join modes of the same shape (MAC)"
    if len(shown) > 1:
        first, last = ends
        note = f"filled: at {rpm_text(first)}; hollow: at {rpm_text(last)}; {note}"
    _note(axes, note, -0.11)
    return save_figure(figure, path)


def _family_lines(axes: Axes, found: Families, top: float, solid: bool = True, width: float = 1.4) -> None:
    for c, omega in enumerate(found.omega):
        here = np.isfinite(omega)
        style: dict[str, Any] = {"linestyle": "-" if solid else (0, (4, 2)), "linewidth": width}
        axes.plot(found.harmonics[here], _hertz(omega[here]), color=_colour(c), **style)
        here &= _hertz(omega) <= top
        if not here.any():  # an empty line without clipping spoils the layout
            continue
        fill = _colour(c) if solid else "white"
        where: dict[str, Any] = {"linestyle": "none", "markersize": 5, "clip_on": False, "zorder": 3}
        axes.plot(found.harmonics[here], _hertz(omega[here]), "o", mfc=fill, mec=_colour(c), **where)


def _others(axes: Axes, basis: ModalBasis, speed: int, found: Families, top: float) -> None:
    """Modes that belong to no family, as crosses."""
    for k in found.harmonics.tolist():
        f = eigenmodes(basis.groups[speed, k]).frequency
        lone = [v for j, v in enumerate(f) if found.of(k, j) < 0 and v <= top]
        axes.plot([k] * len(lone), lone, "x", color=FAINT, markersize=5, zorder=3)


def _family_labels(axes: Axes, found: Families, top: float) -> None:
    """Name each family at its last point, moved apart where two would overlap."""
    labels = []
    for c, omega in enumerate(found.omega):
        here = np.flatnonzero(np.isfinite(omega) & (_hertz(omega) <= top))
        if len(here):
            last = int(here[-1])
            labels.append((float(_hertz(omega[last])), float(found.harmonics[last]), f"family {c + 1}", _colour(c)))
    _end_labels(axes, labels, float(found.harmonics[-1]), top)


def _nodal_axis(axes: Axes, basis: ModalBasis) -> None:
    held = harmonics_of(basis)
    step = max(1, math.ceil((basis.sectors // 2) / 16))
    axes.set_xticks(range(0, basis.sectors // 2 + 1, step))
    axes.set_xlim(-0.02 * basis.sectors / 2, max(basis.sectors / 2, held[-1]))
    axes.set_xlabel("nodal diameter")


def stuck_plot(basis: ModalBasis, path: Path) -> Path | None:
    """Frequency over nodal diameter with open contacts and with neighbours stuck, at the highest speed.

    None where no contact faces the next sector or the basis does not hold its statics.
    """
    name = closed_gap(basis)
    if name is None:
        return None
    speed, harmonics = speeds_of(basis)[-1], harmonics_of(basis)
    found = families(basis, speed)
    shut = {k: _hertz(stuck(basis, basis.groups[speed, k], name)[0]) for k in harmonics}
    shown = max(2, len(found.omega) // 2)
    top = 1.05 * max(float(f[:shown].max()) for f in shut.values())
    figure, axes = single_panel(8.6, 6.0)
    _family_lines(axes, found, top, width=0.8)
    _family_labels(axes, found, top)
    for k, f in shut.items():
        axes.plot([k] * int((f <= top).sum()), f[f <= top], "s", color=INK, markersize=5, zorder=4, clip_on=False)
    axes.set_ylim(0, top)
    _nodal_axis(axes, basis)
    axes.set_ylabel("frequency in Hz")
    kept = any(c.modes == "closed" and c.sector_shift for c in basis.groups[speed, harmonics[0]].contacts.values())
    apart, state = ("sliding", "closed along their normal") if kept else ("apart", "open")
    axes.set_title(f"{basis.name}: neighbours {apart} and stuck, {rpm_text(speed)}", fontweight="bold")
    note = f"lines: contacts {state}; black squares: the contact '{name}' and its neighbour do not move on each other"
    _note(axes, note, -0.11)
    return save_figure(figure, path)


# --- interference --------------------------------------------------------------------------------------------------


def safe_plot(basis: ModalBasis, orders: Sequence[int], path: Path) -> Path | None:
    """Interference diagram, one panel a speed (None if the body does not turn, or at most at one nodal diameter)."""
    turning = [s for s in speeds_of(basis) if families(basis, s).speed > 0]
    if not turning or len(harmonics_of(basis)) < 2:
        return None
    turning = [turning[i] for i in np.unique(np.linspace(0, len(turning) - 1, MOST_PANELS).round().astype(int))]
    columns = 1 if len(turning) == 1 else 2
    rows = math.ceil(len(turning) / columns)
    figure = empty_figure(8.0 if columns == 1 else 6.4 * columns, 1.3 + 5.2 * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, speed in zip(panels, turning, strict=False):
        _safe_panel(axes, basis, speed, sorted({e for e in orders if e > 0}))
    figure.suptitle(f"{basis.name}: interference diagram (SAFE, ZZENF)", fontweight="bold")
    note = _SAFE_NOTE if orders else _SAFE_NOTE.split(";")[0]
    if len(panels) > len(turning):
        panels[-1].set_axis_off()
        panels[-1].text(0.5, 0.5, note, ha="center", va="center", color=FAINT)
    else:
        figure.supxlabel(note, fontsize=8.5, color=FAINT)
    return save_figure(figure, path)


_SAFE_NOTE = (
    "grey line: frequency = engine order x speed, reflected at 0 and N/2\n(solid: the wave runs backward on the rotor, "
    f"dashed: forward);\ndiamonds: engine orders of the body file; red rings: a mode within {100 * CLOSE:g} % of one"
)


def _safe_panel(axes: Axes, basis: ModalBasis, speed: int, orders: Sequence[int]) -> None:
    plain_axes(axes)
    found = families(basis, speed)
    turns = found.speed / (2 * np.pi)
    top = _safe_ceiling(found, orders, turns)
    axes.set_ylim(0, top)
    _excitation_line(axes, basis.sectors, turns, top, orders)
    _family_lines(axes, found, top, width=0.8)
    _others(axes, basis, speed, found, top)
    _family_labels(axes, found, top)
    _close_ones(axes, margins(basis, speed, orders, CLOSE), top)
    _nodal_axis(axes, basis)
    axes.set_ylabel("frequency in Hz")
    axes.set_title(rpm_text(speed), fontsize=11)


def _safe_ceiling(found: Families, orders: Sequence[int], turns: float) -> float:
    """Hz shown: all modes, or the part that the engine orders reach and the next family above."""
    highest = float(np.nanmax(_hertz(found.omega)))
    if not orders:
        return 1.05 * highest
    reached = max(orders) * turns
    above = [high for low, high in family_ranges(found).values() if low > 1.1 * reached]
    return min(1.05 * highest, max(1.15 * reached, 1.1 * min(above, default=0.0)))


def _excitation_line(axes: Axes, sectors: int, turns: float, top: float, orders: Sequence[int]) -> None:
    corners, hertz = zigzag(sectors, turns, top)
    for leg in range(len(corners) - 1):
        style = "-" if leg % 2 == 0 else (0, (5, 3))
        axes.plot(corners[leg : leg + 2], hertz[leg : leg + 2], color="#8a90a0", linewidth=1.2, linestyle=style)
    every = [e for e in range(1, int(top / turns) + 1) if e not in orders]
    if len(every) <= 200:
        at = [aliased(e, sectors)[0] for e in every]
        axes.plot(at, [e * turns for e in every], ".", color="#8a90a0", markersize=4, zorder=1.6)
    shown = [e for e in orders if e * turns <= top]
    at = [aliased(e, sectors)[0] for e in shown]
    if shown:
        axes.plot(at, [e * turns for e in shown], "D", color="#3c424e", markersize=5, zorder=3.5, clip_on=False)
    for e, k in zip(shown, at, strict=True):
        _on_line(axes, f"EO {e}", k, e * turns, aliased(e, sectors)[1], 2 * k >= sectors - 1)


def _on_line(axes: Axes, text: str, k: int, hertz: float, direction: str, at_edge: bool) -> None:
    """The engine order's name, on the side of the line that is free: below a rising leg, above a falling one."""
    from matplotlib.patheffects import withStroke

    right = not at_edge
    shift = {FORWARD: (9, 7), STANDING: (11, -2)}.get(direction, (9, -7)) if right else (-12, 0)
    how = {"ha": "left" if right else "right", "va": "center", "fontsize": 8, "color": "#3c424e", "zorder": 5}
    behind = [withStroke(linewidth=3, foreground="white")]
    said_beside(axes, text, (k, hertz), shift, path_effects=behind, **how)


def _close_ones(axes: Axes, found: Sequence[Margin], top: float) -> None:
    for m in found:
        if m.frequency <= top:
            where: dict[str, Any] = {"mec": "#d02020", "mew": 1.8, "markersize": 12, "zorder": 4, "clip_on": False}
            axes.plot(m.nodal_diameter, m.frequency, "o", mfc="none", **where)


# --- Campbell ------------------------------------------------------------------------------------------------------


def cyclic_campbell_plot(basis: ModalBasis, orders: Sequence[int], path: Path) -> Path | None:
    """Campbell diagram of all nodal diameters (None with fewer than two speeds).

    One curve a family and nodal diameter, strong where an engine order excites the nodal diameter; circles mark only
    true resonances.
    """
    curves = tracks(basis)
    if not curves:
        return None
    figure, axes = single_panel(9.2, 6.8)
    orders = sorted({e for e in orders if e > 0})
    speeds = next(iter(curves.values())).speeds
    rpm = to_rpm(np.linspace(speeds[0], speeds[-1], 201))
    top = _campbell_ceiling(curves, orders, speeds[-1])
    joined = families(basis)
    found = [r for r in resonances(basis, orders) if r.frequency <= top]
    waves = {aliased(e, basis.sectors) for e in orders} or {(k, "") for k in curves}
    excited = {wave: t for wave in sorted(waves) if (t := wave_tracks(basis, *wave)) is not None}
    hidden, strong = _waves(axes, joined, curves, excited, rpm, top)
    for order in orders:
        axes.plot(rpm, order * rpm / 60, color=FAINT, linewidth=0.9, linestyle=(0, (5, 3)), zorder=1.5)
        at = _free_place(order, rpm, top, strong, found)
        _order_label(axes, order, at, top, f"EO {order}, k={aliased(order, basis.sectors)[0]}")
    x, y = [to_rpm(r.speed) for r in found], [r.frequency for r in found]
    axes.plot(x, y, "o", mfc="white", mec=INK, markersize=6, zorder=4, linestyle="none")
    axes.set_xlim(rpm[0], rpm[-1])
    axes.set_ylim(0, top)
    axes.set_xlabel("rotation speed in rpm")
    axes.set_ylabel("frequency in Hz")
    axes.set_title(f"{basis.name}: Campbell diagram of {basis.sectors} sectors", fontweight="bold")
    note = "one curve a family and nodal diameter k"
    if orders:
        note = "strong lines: nodal diameters k that an engine order excites; faint: all others; "
        note += "circles: true resonances (same frequency, same k)"
    above = f"; {hidden} {'family lies' if hidden == 1 else 'families lie'} above" if hidden else ""
    _note(axes, note + above, -0.13)
    return save_figure(figure, path)


def _campbell_ceiling(curves: dict[int, Tracks], orders: Sequence[int], fastest: float) -> float:
    every = [t.omega[c] / (2 * np.pi) for t in curves.values() for c in range(len(t.omega))]
    highest = max(float(np.nanmax(f)) for f in every)
    if not orders:
        return 1.05 * highest
    reached = max(orders) * fastest / (2 * np.pi)
    above = [float(np.nanmin(f)) for f in every if 1.1 * reached < np.nanmin(f) < 1.5 * reached]
    least = min((float(np.nanmax(f)) for f in every if np.nanmax(f) > 0), default=0.0)
    return min(1.05 * highest, max([1.15 * reached, 1.05 * least, *(1.05 * f for f in above)]))


def _waves(
    axes: Axes, joined: Families, curves: dict[int, Tracks], excited: dict[tuple[int, str], Tracks], rpm: Array,
    top: float,
) -> tuple[int, list[Array]]:  # fmt: skip
    """Draw every curve, faint unless its wave is excited; how many families lie above, and the strong curves."""
    speeds, labels, hidden, drawn = from_rpm(rpm), [], 0, []
    for c, row in enumerate(joined.modes):
        members = {int(k): int(j) for k, j in zip(joined.harmonics, row, strict=True) if j >= 0}
        lines = {k: f for k, j in members.items() if (f := _line(curves[k], j, speeds)) is not None}
        waves = [_line(t, members[k], speeds) for (k, _), t in excited.items() if k in members]
        strong = [f for f in waves if f is not None and np.nanmin(f) <= top]
        hidden += not any(np.nanmin(f) <= top for f in lines.values())
        for f in [f for k, f in lines.items() if k not in {k for k, _ in excited}]:
            axes.plot(rpm, np.where(f <= top, f, np.nan), color=_colour(c), linewidth=0.7, alpha=0.35)
        drawn += strong
        for f in strong:
            axes.plot(rpm, np.where(f <= top, f, np.nan), color=_colour(c), linewidth=1.4)
        if strong:
            f = strong[len(strong) // 2]
            end = int(np.flatnonzero(np.isfinite(f) & (f <= top))[-1])
            labels.append((float(f[end]), float(rpm[end]), f"family {c + 1}", _colour(c)))
    _end_labels(axes, labels, float(rpm[-1]), top)
    return hidden, drawn


def _free_place(order: int, rpm: Array, top: float, curves: Sequence[Array], rings: Sequence[Resonance]) -> float:
    """rpm at which an engine order's name stands, far right but not on a curve or a ring if that can be had."""
    last = min(float(rpm[-1]), 60 * top / order)
    best = (-1.0, 0.93 * last)
    for part in np.arange(0.93, 0.5, -0.02):
        x = part * last
        y = order * x / 60
        here = [abs(float(np.interp(x, rpm, f)) - y) / top for f in curves]
        marks = [max(abs(to_rpm(r.speed) - x) / rpm[-1] - 0.03, 0) + abs(r.frequency - y) / top for r in rings]
        room = min([f for f in [*here, *marks] if np.isfinite(f)], default=1.0)
        if room > 0.028:
            return float(x)
        best = max(best, (room, float(x)))
    return best[1]


def _line(t: Tracks, mode: int, speeds: Array) -> Array | None:
    """Frequencies of the curve that begins as `mode` at the lowest speed."""
    curve = np.flatnonzero(t.modes[:, 0] == mode)
    return t.frequency(int(curve[0]), speeds) if len(curve) else None

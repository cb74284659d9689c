"""Frequencies over speed and nodal diameter: Campbell diagrams, nodal diameters, interference (SAFE, ZZENF)."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, ModalBasis
from ..modal.campbell import SURE, VISIBLE, Tracks, crossings, gyroscopic_change, parted
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
from .plots import COLOURS, GREY, INK, Look, note_below, panels, said_beside

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLOSE = 0.05
"""Modes nearer than this part to an engine order that excites them are marked in the interference diagram."""

MOST_PANELS = 4

DARK = "#3c424e"
"""Of engine orders and their names."""

DASHES = (0, (5, 3))

Label = tuple[float, float, str, str]
"""Ordinate and abscissa of the end of a curve, its name and its colour."""


def _colour(family: int) -> str:
    return COLOURS[family % len(COLOURS)]


def _hertz(omega: Array) -> Array:
    return omega / (2 * np.pi)


def _outlined(width: float) -> list[Any]:
    """Letters on white, for words that stand on lines."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=width, foreground="white")]


def end_labels(axes: Axes, labels: list[Label], last: float, top: float) -> None:
    """Name each curve at its right end, moved apart where two would overlap."""
    gap, y = 0.032 * top, -math.inf
    for f, x, text, colour in sorted(labels):
        y = max(f, y + gap)
        cut = x < last  # leaves the picture through its upper edge
        at, shift = ((x, f), (5, -8)) if cut else ((x, y), (6, 0))
        said_beside(axes, text, at, shift, color=colour, annotation_clip=False, va="center", fontsize=8.5)


# nodal diameters ---------------------------------------------------------------------------------


def _rpm(basis: ModalBasis, number: int) -> str:
    """A speed of the body by its number."""
    return rpm_text(basis.groups[number, harmonics_of(basis)[0]].speed)


def nodal_diameter_plot(basis: ModalBasis, figure: Figure) -> None:
    """Frequency over nodal diameter at the lowest and the highest speed, one line a family."""
    (axes,) = panels(figure, (8.6, 6.0))
    ends = dict.fromkeys((speeds_of(basis)[0], speeds_of(basis)[-1]))
    shown = [families(basis, s) for s in ends]
    top = 1.05 * max(float(eigenmodes(basis.groups[s, k]).frequency.max()) for s in ends for k in harmonics_of(basis))
    for i, (speed, found) in enumerate(zip(ends, shown, strict=True)):
        _family_lines(axes, found, top, solid=i == 0)
        _others(axes, basis, speed, found, top)
    _nodal_frame(axes, basis, shown[-1], top)
    axes.set_title(f"{basis.name}: nodal diameters of {basis.sectors} sectors", fontweight="bold")
    note = "lines join modes of the same shape (MAC)"
    if len(shown) > 1:
        first, last = (_rpm(basis, s) for s in ends)
        note = f"filled: at {first}; hollow: at {last}; {note}"
    note_below(axes, note, -0.11, wrap=True)


def _family_lines(axes: Axes, found: Families, top: float, solid: bool = True, width: float = 1.4) -> None:
    for c, omega in enumerate(found.omega):
        k, f, colour = found.harmonics, _hertz(omega), _colour(c)
        here = np.isfinite(omega)
        axes.plot(k[here], f[here], color=colour, linestyle="-" if solid else (0, (4, 2)), linewidth=width)
        here &= f <= top
        if here.any():  # an empty line without clipping spoils the layout
            dots: Look = {"markersize": 5, "clip_on": False, "zorder": 3, "linestyle": "none"}
            axes.plot(k[here], f[here], "o", mfc=colour if solid else "white", mec=colour, **dots)


def _others(axes: Axes, basis: ModalBasis, speed: int, found: Families, top: float) -> None:
    """Modes that belong to no family, as crosses."""
    for k in found.harmonics.tolist():
        f = eigenmodes(basis.groups[speed, k]).frequency
        lone = [v for j, v in enumerate(f) if found.of(k, j) < 0 and v <= top]
        axes.plot([k] * len(lone), lone, "x", color=GREY, markersize=5, zorder=3)


def _nodal_frame(axes: Axes, basis: ModalBasis, found: Families, top: float) -> None:
    """Name each family at its last point that is seen; both axes."""
    labels, half = [], basis.sectors // 2
    for c, omega in enumerate(found.omega):
        here = np.flatnonzero(np.isfinite(omega) & (_hertz(omega) <= top))
        if len(here):
            last = int(here[-1])
            labels.append((float(_hertz(omega[last])), float(found.harmonics[last]), f"family {c + 1}", _colour(c)))
    end_labels(axes, labels, float(found.harmonics[-1]), top)
    axes.set_xticks(range(0, half + 1, max(1, math.ceil(half / 16))))
    axes.set_xlim(-0.02 * basis.sectors / 2, max(basis.sectors / 2, harmonics_of(basis)[-1]))
    axes.set(xlabel="nodal diameter", ylabel="frequency in Hz", ylim=(0, top))


def stuck_plot(basis: ModalBasis, figure: Figure) -> None:
    """Frequency over nodal diameter with open contacts and with neighbours stuck, at the highest speed; nothing where
    no contact faces the next sector or the basis does not hold its statics."""
    name = closed_gap(basis)
    if name is None:
        return
    speed, harmonics = speeds_of(basis)[-1], harmonics_of(basis)
    found = families(basis, speed)
    shut = {k: _hertz(stuck(basis, basis.groups[speed, k], name)[0]) for k in harmonics}
    shown = max(2, len(found.omega) // 2)
    top = 1.05 * max(float(f[:shown].max()) for f in shut.values())
    (axes,) = panels(figure, (8.6, 6.0))
    _family_lines(axes, found, top, width=0.8)
    for k, f in shut.items():
        axes.plot([k] * int((f <= top).sum()), f[f <= top], "s", color=INK, markersize=5, zorder=4, clip_on=False)
    _nodal_frame(axes, basis, found, top)
    kept = any(c.modes == "closed" and c.sector_shift for c in basis.groups[speed, harmonics[0]].contacts.values())
    apart, state = ("sliding", "closed along their normal") if kept else ("apart", "open")
    axes.set_title(f"{basis.name}: neighbours {apart} and stuck, {_rpm(basis, speed)}", fontweight="bold")
    note = f"lines: contacts {state}; black squares: the contact '{name}' and its neighbour do not move on each other"
    note_below(axes, note, -0.11, wrap=True)


# interference ------------------------------------------------------------------------------------


def safe_plot(basis: ModalBasis, orders: Sequence[int], figure: Figure) -> None:
    """Interference diagram, one panel a speed; nothing if the body does not turn, or at most at one nodal diameter."""
    turning = [s for s in speeds_of(basis) if families(basis, s).speed > 0]
    if not turning or len(harmonics_of(basis)) < 2:
        return
    turning = [turning[i] for i in np.unique(np.linspace(0, len(turning) - 1, MOST_PANELS).round().astype(int))]
    columns = 1 if len(turning) == 1 else 2
    rows = math.ceil(len(turning) / columns)
    size = 8.0 if columns == 1 else 6.4 * columns, 1.3 + 5.2 * rows
    places = panels(figure, size, rows, columns)
    for axes, speed in zip(places, turning, strict=False):
        _safe_panel(axes, basis, speed, sorted({e for e in orders if e > 0}))
    figure.suptitle(f"{basis.name}: interference diagram (SAFE, ZZENF)", fontweight="bold")
    note = _SAFE_NOTE if orders else _SAFE_NOTE.split(";")[0]
    if len(places) > len(turning):
        places[-1].set_axis_off()
        places[-1].text(0.5, 0.5, note, ha="center", va="center", color=GREY)
    else:
        figure.supxlabel(note, fontsize=8.5, color=GREY)


_SAFE_NOTE = (
    "grey line: frequency = engine order x speed, reflected at 0 and N/2\n(solid: the wave runs backward on the rotor, "
    f"dashed: forward);\ndiamonds: engine orders of the body file; red rings: a mode within {100 * CLOSE:g} % of one"
)


def _safe_panel(axes: Axes, basis: ModalBasis, speed: int, orders: Sequence[int]) -> None:
    found = families(basis, speed)
    turns = found.speed / (2 * np.pi)
    top = _safe_ceiling(found, orders, turns)
    axes.set_ylim(0, top)
    _excitation_line(axes, basis.sectors, turns, top, orders)
    _family_lines(axes, found, top, width=0.8)
    _others(axes, basis, speed, found, top)
    _close_ones(axes, margins(basis, speed, orders, CLOSE), top)
    _nodal_frame(axes, basis, found, top)
    axes.set_title(_rpm(basis, speed), fontsize=11)


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
        part = slice(leg, leg + 2)
        axes.plot(corners[part], hertz[part], color="#8a90a0", linewidth=1.2, linestyle=DASHES if leg % 2 else "-")
    every = [e for e in range(1, int(top / turns) + 1) if e not in orders]
    if len(every) <= 200:
        at = [aliased(e, sectors)[0] for e in every]
        axes.plot(at, [e * turns for e in every], ".", color="#8a90a0", markersize=4, zorder=1.6)
    for e in [e for e in orders if e * turns <= top]:
        k, direction = aliased(e, sectors)
        axes.plot(k, e * turns, "D", color=DARK, markersize=5, zorder=3.5, clip_on=False)
        # on the side of the line that is free: below a rising leg, above a falling one
        right = 2 * k < sectors - 1
        shift = {FORWARD: (9, 7), STANDING: (11, -2)}.get(direction, (9, -7)) if right else (-12, 0)
        how = {"ha": "left" if right else "right", "va": "center", "fontsize": 8, "color": DARK, "zorder": 5}
        said_beside(axes, f"EO {e}", (k, e * turns), shift, path_effects=_outlined(3), **how)


def _close_ones(axes: Axes, found: Sequence[Margin], top: float) -> None:
    rings: Look = {"mfc": "none", "mec": "#d02020", "mew": 1.8, "markersize": 12, "zorder": 4}
    for m in (m for m in found if m.frequency <= top):
        axes.plot(m.nodal_diameter, m.frequency, "o", clip_on=False, **rings)


# Campbell ----------------------------------------------------------------------------------------


def ceiling(curves: Sequence[Array], reached: float, beyond: float, more: float) -> float:
    """Hz shown: all modes, or with engine orders the part they reach and a bit more, the lowest mode at least.

    Args:
        curves: Hz, nan where not known. reached: Hz, by the highest engine order; 0: there is none. beyond, more:
            factors of what is reached, and of modes.
    """
    highest = 1.05 * max(float(np.nanmax(f)) for f in curves)
    if not reached:
        return highest
    lowest = [float(np.nanmin(f)) for f in curves]
    above = [more * f for f in lowest if 1.1 * reached < f < 1.5 * reached]
    least = min((float(np.nanmax(f)) for f in curves if np.nanmax(f) > 0), default=0.0)
    return min(highest, max([beyond * reached, more * least, *above]))


def _campbell_frame(
    axes: Axes, rpm: Array, top: float, rings: Sequence[tuple[float, float]], title: str, note: str, **how: Any
) -> None:
    """Both axes, and circles where engine orders meet modes: pairs of rad/s and Hz."""
    x, y = [to_rpm(speed) for speed, _ in rings], [f for _, f in rings]
    axes.plot(x, y, "o", mfc="white", mec=INK, markersize=6, zorder=4, linestyle="none")
    axes.set(xlim=(rpm[0], rpm[-1]), ylim=(0, top), xlabel="rotation speed in rpm", ylabel="frequency in Hz")
    axes.set_title(title, fontweight="bold")
    note_below(axes, note, -0.13, **how)


def _order_line(axes: Axes, order: int, rpm: Array, at: float, text: str) -> None:
    """An engine order and its name on it, at a speed (rpm)."""
    axes.plot(rpm, order * rpm / 60, color=GREY, linewidth=0.9, linestyle=DASHES, zorder=1.5)
    how: Look = {"ha": "center", "va": "center", "fontsize": 8, "color": DARK}
    axes.text(at, order * at / 60, text, path_effects=_outlined(6), **how)


def campbell_plot(basis: ModalBasis, tracks: Tracks, orders: Sequence[int], figure: Figure) -> None:
    """Frequencies over the speed with engine-order lines and their crossings; rigid motions are left out."""
    moving = np.nanmax(tracks.omega, axis=1) > 0
    if moving.any():
        tracks = replace(tracks, modes=tracks.modes[moving], omega=tracks.omega[moving], mac=tracks.mac[moving])
    (axes,) = panels(figure, (8.6, 6.4))
    orders = sorted({k for k in orders if k > 0})
    fastest = float(_hertz(tracks.speeds[-1]))
    top = ceiling(list(_hertz(tracks.omega)), max(orders, default=0) * fastest, 1.2, 1.1)
    rpm = to_rpm(np.linspace(tracks.speeds[0], tracks.speeds[-1], 201))
    split = parted(basis)
    _curves(axes, tracks, rpm, top)
    if split is not None:
        _split(axes, basis, split, rpm, top)
    for order in orders:
        _order_line(axes, order, rpm, min(rpm[-1], 60 * top / order) * 0.96, f"EO {order}")
    rings = [(c.speed, c.frequency) for c in crossings(split or tracks, orders) if c.frequency <= top]
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
    _campbell_frame(axes, rpm, top, rings, f"{basis.name}: Campbell diagram", textwrap.fill(note, 110))


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


def _curves(axes: Axes, tracks: Tracks, rpm: Array, top: float) -> None:
    speeds = np.union1d(from_rpm(rpm), tracks.speeds)  # a curve may be of one station
    labels, rpm = [], to_rpm(speeds)
    for c in range(len(tracks.modes)):
        f = tracks.frequency(c, speeds)
        if np.nanmin(f) > top:
            continue
        known = tracks.modes[c] >= 0
        axes.plot(rpm, f, color=_colour(c), linewidth=1.8)
        at = tracks.speeds[known] if tracks.solved is None else tracks.solved
        stations = tracks.frequency(c, at)
        shown = stations <= top
        axes.plot(to_rpm(at[shown]), stations[shown], "o", color=_colour(c), markersize=4.5, clip_on=False, zorder=3)
        for step in np.flatnonzero(tracks.mac[c] < SURE):
            part = (speeds >= tracks.speeds[step]) & (speeds <= tracks.speeds[step + 1])
            axes.plot(rpm[part], f[part], color="white", linewidth=2.4, linestyle=(0, (2, 3)))
        labels.append(_ending(f, rpm, top, f"mode {int(tracks.modes[c][known][0]) + 1}", _colour(c)))
    end_labels(axes, labels, float(rpm[-1]), top)


def _ending(f: Array, rpm: Array, top: float, name: str, colour: str) -> Label:
    """Of a curve, where it is last seen."""
    end = int(np.flatnonzero(np.isfinite(f) & (f <= top))[-1])
    return float(f[end]), float(rpm[end]), name, colour


def cyclic_campbell_plot(basis: ModalBasis, orders: Sequence[int], figure: Figure) -> None:
    """Campbell diagram of all nodal diameters; nothing with fewer than two speeds.

    One curve a family and nodal diameter, strong where an engine order excites the nodal diameter; circles mark only
    true resonances.
    """
    curves = tracks(basis)
    if not curves:
        return
    (axes,) = panels(figure, (9.2, 6.8))
    orders = sorted({e for e in orders if e > 0})
    speeds = next(iter(curves.values())).speeds
    rpm = to_rpm(np.linspace(speeds[0], speeds[-1], 201))
    reached = max(orders, default=0) * float(_hertz(speeds[-1]))
    top = ceiling([f for t in curves.values() for f in _hertz(t.omega)], reached, 1.15, 1.05)
    found = [r for r in resonances(basis, orders) if r.frequency <= top]
    waves = {aliased(e, basis.sectors) for e in orders} or {(k, "") for k in curves}
    excited = {wave: t for wave in sorted(waves) if (t := wave_tracks(basis, *wave)) is not None}
    hidden, strong = _waves(axes, families(basis), curves, excited, rpm, top)
    for order in orders:
        at = _free_place(order, rpm, top, strong, found)
        _order_line(axes, order, rpm, at, f"EO {order}, k={aliased(order, basis.sectors)[0]}")
    note = "one curve a family and nodal diameter k"
    if orders:
        note = "strong lines: nodal diameters k that an engine order excites; faint: all others; "
        note += "circles: true resonances (same frequency, same k)"
    note += f"; {hidden} {'family lies' if hidden == 1 else 'families lie'} above" if hidden else ""
    title = f"{basis.name}: Campbell diagram of {basis.sectors} sectors"
    _campbell_frame(axes, rpm, top, [(r.speed, r.frequency) for r in found], title, note, wrap=True)


def _waves(
    axes: Axes, joined: Families, curves: dict[int, Tracks], excited: dict[tuple[int, str], Tracks], rpm: Array,
    top: float,
) -> tuple[int, list[Array]]:  # fmt: skip
    """Draw every curve, faint unless its wave is excited; how many families lie above, and the strong curves."""
    speeds, labels, hidden, drawn = from_rpm(rpm), [], 0, []
    strongly = {k for k, _ in excited}
    for c, row in enumerate(joined.modes):
        members = {int(k): int(j) for k, j in zip(joined.harmonics, row, strict=True) if j >= 0}
        lines = {k: f for k, j in members.items() if (f := _line(curves[k], j, speeds)) is not None}
        waves = [_line(t, members[k], speeds) for (k, _), t in excited.items() if k in members]
        strong = [f for f in waves if f is not None and np.nanmin(f) <= top]
        hidden += not any(np.nanmin(f) <= top for f in lines.values())
        faint = [f for k, f in lines.items() if k not in strongly]
        looks: list[tuple[list[Array], Look]] = [(faint, {"lw": 0.7, "alpha": 0.35}), (strong, {"lw": 1.4})]
        for f, look in ((f, look) for these, look in looks for f in these):
            axes.plot(rpm, np.where(f <= top, f, np.nan), color=_colour(c), **look)
        drawn += strong
        if strong:
            labels.append(_ending(strong[len(strong) // 2], rpm, top, f"family {c + 1}", _colour(c)))
    end_labels(axes, labels, float(rpm[-1]), top)
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

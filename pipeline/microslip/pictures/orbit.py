"""Pictures of motions in time: phase portrait, last periods with events, spectrum, what contacts do, chatter."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..data import Array
from ..time_domain.classification import Chatter, chatter, coordinates, loops, rubs
from ..units import METRES, Quantity
from .plots import COLOURS, empty_figure, plain_axes, plain_numbers, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..time_domain.orbit import Orbit

Panel = Callable[["Axes"], object]

SHOWN = 4
"""Periods that are drawn over time."""
SPECTRUM = 1e-5
"""Share of its largest amplitude down to which a spectrum is drawn."""
HIGHEST = 12.0
"""Multiples of the excitation up to which it is drawn."""
OF_CONTACTS = 3
"""Contacts that are drawn, those that lose most."""
WINDOW = 8
"""Periods in each window of a spectrogram."""
BOLD = 8
"""Letters of a title to an inch."""
EVENT_MARKS = (("closes", "v", 4, "meets"), ("slips", "|", 9, "begins to slip"))


def orbit_picture(orbit: Orbit, row: Mapping[str, float], path: Path, title: str) -> Path:
    """What its read-out does, and where there is friction, the ways of contacts in their plane and their loops.

    Phase portrait, the last periods with events, the spectrum; where the motion does not repeat, its Poincare section
    and how the spectrum changes. Of a run-up, its size over the frequency, and the spectrum that changes with that.

    Args:
        row: of the table of motions, whose numbers stand above.
    """
    panels: list[Panel] = [orbit.plot, partial(_history, orbit), partial(_spectrum, orbit)]
    if orbit.run_up:
        panels = [partial(_over_frequency, orbit), partial(_history, orbit)]
    elif not orbit.repeats:
        panels.insert(1, partial(_section, orbit))
    if not orbit.repeats and len(orbit.time) >= 2 * WINDOW * orbit.samples:
        panels.append(partial(_orders if orbit.run_up else _spectrogram, orbit))
    areas = loops(orbit)
    rubbing = [i for i in range(len(orbit.touching)) if rubs(orbit, i)]
    for i in sorted(rubbing, key=lambda i: -np.nansum(areas[coordinates(orbit, i)]))[:OF_CONTACTS]:
        panels += _of_contact(orbit, i, areas)
    columns = 2 if len(panels) == 4 else 3
    rows = -(-len(panels) // columns)
    figure = empty_figure(4.4 * columns, 0.4 + 3.9 * rows)
    places = figure.subplots(rows, columns).ravel()
    for axes, draw in zip(places, panels, strict=False):
        plain_axes(axes)
        draw(axes)
    for axes in places[len(panels) :]:
        axes.set_visible(False)
    places[0].legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    lost = row["lost_in_contacts_J_per_period"]
    more = f"; contacts lose {lost:.4g} J a period" if len(orbit.touching) and np.isfinite(lost) else ""
    lines = [textwrap.fill(line, int(BOLD * 4.4 * columns)) for line in (title + more).splitlines()]
    figure.suptitle("\n".join(lines), fontweight="bold")
    return save_figure(figure, path)


def portraits(orbits: Sequence[tuple[str, Orbit]], path: Path, title: str) -> Path:
    """Phase portraits side by side, three in a row."""
    rows = -(-len(orbits) // 3)
    figure = empty_figure(4.4 * min(len(orbits), 3), 4.1 * rows)
    panels = np.atleast_1d(figure.subplots(rows, min(len(orbits), 3))).ravel()
    for axes, (name, orbit) in zip(panels, orbits, strict=False):
        plain_axes(axes)
        orbit.plot(axes)
        axes.set_title("\n".join([name, *orbit.said.split(", ")]), fontsize=9)
    for axes in panels[len(orbits) :]:
        axes.set_visible(False)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", fontsize=9)
    figure.suptitle(title, fontweight="bold")
    return save_figure(figure, path)


def _section(orbit: Orbit, axes: Axes) -> None:
    """Velocity over displacement after every period: the Poincare section."""
    last = slice(orbit.samples - 1, None, orbit.samples)
    (y, unit), (v, per_second) = (_sized(x[0], orbit.of(0)) for x in (orbit.y, orbit.v))
    axes.plot(y[last], v[last], ".", color=COLOURS[1], markersize=5)
    axes.set(xlabel=f"{orbit.labels[0]} in {unit}", ylabel=f"velocity in {per_second}/s")
    axes.set_title(f"Poincaré section, {len(y[last])} periods", fontsize=9)


def _over_frequency(orbit: Orbit, axes: Axes) -> None:
    """Displacement over the frequency of the excitation, and its largest size in every period of that."""
    f, (y, unit) = orbit.frequency, _sized(orbit.y[0], orbit.of(0))
    moves = np.flatnonzero(f != f[-1])
    period = np.floor(np.cumsum(f[moves]) * (orbit.time[1] - orbit.time[0])).astype(int)
    begins = np.searchsorted(period, np.unique(period))
    largest = np.maximum.reduceat(np.abs(y[moves]), begins)
    axes.plot(f[moves], y[moves], color=COLOURS[0], linewidth=0.4)
    axes.plot(f[begins], largest, color=COLOURS[1], linewidth=1.4, label="largest in each period")
    axes.set(xlabel="frequency of the excitation in Hz", ylabel=f"{orbit.labels[0]} in {unit}")


def _orders(orbit: Orbit, axes: Axes) -> None:
    """Spectra as in `_spectrogram`, in Hz over time, and the frequencies of the loads."""
    middle, multiples, decibels = _spectra(orbit)
    last, f = orbit.Omega / (2 * np.pi), orbit.frequency
    drawn = axes.pcolormesh(
        middle * orbit.period, multiples * last, decibels.T, vmin=-80, vmax=0, cmap="viridis", shading="nearest"
    )
    axes.figure.colorbar(drawn, ax=axes, label="amplitude in dB")  # type: ignore[union-attr]
    for h in orbit.equations.harmonics:
        axes.plot(orbit.time, h * f, color="white", linewidth=1.0, linestyle="--", label=_order(orbit, h))
    axes.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, labelcolor="black")
    for line in axes.get_legend().get_lines():  # type: ignore[union-attr]
        line.set_color("black")
    axes.set(xlabel="time in s", ylabel="frequency in Hz", ylim=(0, min(multiples[-1], 4.0) * last))
    axes.grid(False)


def _order(orbit: Orbit, harmonic: int) -> str:
    """Of a load: its engine order where bodies turn slower than it, else which harmonic it is."""
    ramp = orbit.equations.ramp
    turns = ramp is not None and ramp.order > 1
    return f"engine order {harmonic * ramp.order}" if turns and ramp else f"excitation, harmonic {harmonic}"


def _history(orbit: Orbit, axes: Axes) -> None:
    shown = slice(-SHOWN * orbit.samples, None)
    y, unit = _sized(orbit.y[0][shown], orbit.of(0))
    time = orbit.time[shown]
    axes.plot((time - time[0]) / orbit.period, y, color=COLOURS[0], linewidth=1.0)
    for kind, mark, size, words in EVENT_MARKS:
        at = _times(orbit, kind)
        at = at[at >= time[0]]
        if len(at):
            place = np.interp(at, time, y)
            axes.plot((at - time[0]) / orbit.period, place, mark, color=COLOURS[1], markersize=size, label=words, ls="")
    if len(axes.lines) > 1:
        axes.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    axes.set(xlabel="time in periods of the excitation", ylabel=f"{orbit.labels[0]} in {unit}")


def _sized(values: Array, of: Quantity = METRES) -> tuple[Array, str]:
    """In the unit that the phase portrait takes."""
    factor, unit = of.scale(np.abs(values).max(initial=0.0))
    return factor * values, unit


def _times(orbit: Orbit, kind: str, contact: int | None = None) -> Array:
    """s, of the events of a kind; slips of contacts with friction alone."""
    chosen = [i for i in range(len(orbit.touching)) if kind != "slips" or rubs(orbit, i)]
    return np.sort(np.concatenate([np.zeros(0), *(orbit.times(kind, i) for i in chosen if contact in (None, i))]))


def _spectrum(orbit: Orbit, axes: Axes) -> None:
    """Amplitudes over multiples of the excitation, by a Hann window over all periods that are kept, down to
    `SPECTRUM` of the largest."""
    y = orbit.y[0]
    window = np.hanning(len(y))
    amplitude: Array = np.abs(np.fft.rfft(window * (y - np.average(y, weights=window)))) * 2 / window.sum()
    multiples = np.arange(len(amplitude)) * orbit.samples / len(y)
    seen = multiples <= min(HIGHEST, orbit.samples / 2)
    by, unit = orbit.of(0).scale(0.1 * amplitude.max(initial=0.0))
    scaled, top = by * amplitude, by * amplitude.max(initial=1e-300)
    axes.semilogy(multiples[seen], np.maximum(scaled, 1e-300)[seen], color=COLOURS[2], lw=0.9)
    axes.set(xlabel="multiples of the excitation frequency", ylabel=f"amplitude in {unit}")
    axes.set_ylim(SPECTRUM * top, 2 * top)
    plain_numbers(axes.yaxis, (1.0,))


def _spectra(orbit: Orbit) -> tuple[Array, Array, Array]:
    """Middles of windows of `WINDOW` periods that overlap; multiples of the excitation; (w, m) dB of the largest."""
    y, n = orbit.y[0] - orbit.y[0].mean(), WINDOW * orbit.samples
    begins = np.arange(0, len(y) - n + 1, orbit.samples)
    sizes = np.abs(np.fft.rfft(np.hanning(n) * y[begins[:, None] + np.arange(n)], axis=1))
    multiples = np.arange(sizes.shape[1]) / WINDOW
    seen = multiples <= min(HIGHEST, orbit.samples / 2)
    decibels = 20 * np.log10(np.maximum(sizes[:, seen] / sizes.max(), 1e-300))
    return begins / orbit.samples + 0.5 * WINDOW, multiples[seen], decibels


def _spectrogram(orbit: Orbit, axes: Axes) -> None:
    """Spectra of windows in time, in dB of the largest amplitude."""
    middle, multiples, decibels = _spectra(orbit)
    drawn = axes.pcolormesh(middle, multiples, decibels.T, vmin=-80, vmax=0, cmap="viridis", shading="nearest")
    axes.figure.colorbar(drawn, ax=axes, label="amplitude in dB")  # type: ignore[union-attr]
    axes.set(xlabel="time in periods of the excitation", ylabel="multiples of its frequency")
    axes.grid(False)


def _of_contact(orbit: Orbit, contact: int, areas: Array) -> list[Panel]:
    """Its way in its plane, where it has one, and loops of the coordinates that lose a hundredth of what it loses."""
    rows, met = coordinates(orbit, contact), orbit.touching[contact]
    plane = len(met.tangential) >= 3
    found: list[Panel] = [partial(_way, orbit, contact)] if plane else []
    names = {1: "t1", 2: "t2"} if plane else {0: "along it"}
    own = areas[rows]
    for k, name in names.items():
        if abs(own[k]) >= 0.01 * np.abs(own).max():
            found.append(partial(_loop, orbit, rows.start + k, f"{met.name}, {name}"))
    return found


def _way(orbit: Orbit, contact: int, axes: Axes) -> None:
    rows = coordinates(orbit, contact)
    (one, other), unit = _sized(orbit.d[rows][1:3, -SHOWN * orbit.samples :])
    axes.plot(one, other, color=COLOURS[3], linewidth=1.0)
    name = orbit.contacts[contact]
    axes.set(xlabel=f"slip plane of {name}: t1 in {unit}", ylabel=f"t2 in {unit}")
    axes.set_aspect("equal", adjustable="datalim")


def _loop(orbit: Orbit, row: int, name: str, axes: Axes) -> None:
    """Force over displacement of the periods that `classification.loops` takes. Its area is no loss where the ground
    moves, so none is written."""
    count = (orbit.repeats or SHOWN) * orbit.samples + 1
    d, unit = _sized(orbit.d[row, -count:])
    axes.plot(d, orbit.force[row, -count:], color=COLOURS[4], linewidth=1.0)
    axes.set(xlabel=f"{name}: displacement in {unit}", ylabel="force in N")


def chatter_picture(orbit: Orbit, contact: int, path: Path, title: str) -> Path:
    """Displacement and velocity over the time of two periods, and the phase portrait, as in Sextro Fig. 4.2-3: impacts
    and where it comes to rest are marked."""
    figure = empty_figure(13.0, 4.3)
    first = chatter(orbit, contact)
    begin = orbit.time[-2 * orbit.samples] if len(orbit.time) > 2 * orbit.samples else orbit.time[0]
    seen = orbit.time >= begin
    panels = figure.subplots(1, 3)
    impacts = _times(orbit, "closes", contact)
    for axes, values, what, per in (
        (panels[0], orbit.y[0], orbit.labels[0], ""),
        (panels[1], orbit.v[0], "velocity", "/s"),
    ):
        plain_axes(axes)
        scaled, unit = _sized(values[seen], orbit.of(0))
        axes.plot(orbit.time[seen] - begin, scaled, color=COLOURS[0], linewidth=0.9)
        shown = impacts[impacts >= begin]
        axes.plot(shown - begin, np.interp(shown, orbit.time[seen], scaled), "|", color=COLOURS[1], label="meets")
        _rests(axes, [c for c in first if c.time + c.stays >= begin], begin)
        axes.set(xlabel="time in s", ylabel=f"{what} in {unit}{per}")
    plain_axes(panels[2])
    orbit.plot(panels[2])
    panels[0].legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    figure.suptitle(title, fontweight="bold")
    return save_figure(figure, path)


def _rests(axes: Axes, found: Sequence[Chatter], begin: float) -> None:
    for i, one in enumerate(found):
        axes.axvspan(
            max(one.time - begin, 0.0), one.time + one.stays - begin, color="#f2d9a0", lw=0, zorder=0,
            label="" if i else "rests",
        )  # fmt: skip

"""Pictures of motions in time: phase portrait, last periods with events, spectrum, what contacts do, chatter."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..data import Array
from ..time_domain.classification import chatter, coordinates, loops, rubs
from ..units import METRES
from .plots import ABOVE, COLOURS, in_rows, in_unit, panels, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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


def orbit_picture(orbit: Orbit, row: Mapping[str, float], figure: Figure, title: str) -> None:
    """What its read-out does, and where there is friction, the ways of contacts in their plane and their loops.

    Phase portrait, the last periods with events, the spectrum; where the motion does not repeat, its Poincare section
    and how the spectrum changes. Of a run-up, its size over the frequency, and the spectrum that changes with that.

    Args:
        row: of the table of motions, whose numbers stand above.
    """
    draw: list[Panel] = [orbit.plot, partial(_history, orbit), partial(_spectrum, orbit)]
    if orbit.run_up:
        draw = [partial(_over_frequency, orbit), partial(_history, orbit)]
    elif not orbit.repeats:
        draw.insert(1, partial(_section, orbit))
    if not orbit.repeats and len(orbit.time) >= 2 * WINDOW * orbit.samples:
        draw.append(partial(_spectrogram, orbit))
    areas = loops(orbit)
    rubbing = [i for i in range(len(orbit.touching)) if rubs(orbit, i)]
    for i in sorted(rubbing, key=lambda i: -np.nansum(areas[coordinates(orbit, i)]))[:OF_CONTACTS]:
        draw += _of_contact(orbit, i, areas)
    columns = 2 if len(draw) == 4 else 3
    rows = -(-len(draw) // columns)
    places = panels(figure, (4.4 * columns, 0.4 + 3.9 * rows), rows, columns, len(draw))
    for axes, one in zip(places, draw, strict=True):
        one(axes)
    places[0].legend(**ABOVE)
    lost = row["lost_in_contacts_J_per_period"]
    more = f"; contacts lose {lost:.4g} J a period" if len(orbit.touching) and np.isfinite(lost) else ""
    lines = [textwrap.fill(line, int(BOLD * 4.4 * columns)) for line in (title + more).splitlines()]
    figure.suptitle("\n".join(lines), fontweight="bold")


def portraits(orbits: Sequence[tuple[str, Orbit]], figure: Figure, title: str) -> None:
    """Phase portraits side by side, three in a row."""
    places = in_rows(figure, len(orbits), 3, 4.4, 4.1)
    for axes, (name, orbit) in zip(places, orbits, strict=True):
        orbit.plot(axes)
        axes.set_title("\n".join([name, *orbit.said.split(", ")]), fontsize=9)
    figure.legend(*places[0].get_legend_handles_labels(), loc="outside lower center", fontsize=9)
    figure.suptitle(title, fontweight="bold")


def section_picture(orbits: Sequence[tuple[float, Orbit]], over: str, figure: Figure, title: str) -> None:
    """The read-out after every period, and the largest one between, over a parameter whose values stand before the
    motions. over: label of the parameter, with its unit."""
    axes, below = panels(figure, (8.0, 6.4), 2, 1, sharex=True)
    if orbits:
        first = orbits[0][1]
        sections = [one.section[0] for _, one in orbits]
        at = np.repeat([value for value, _ in orbits], [len(y) for y in sections])
        tops = np.array([np.abs(one.y[0]).max() for _, one in orbits])
        (y, top), unit = in_unit(first.of(), np.concatenate(sections), tops)
        axes.plot(at, y, ".", color=COLOURS[0], markersize=2.5)
        axes.set(ylabel=f"{first.labels[0]} after every period in {unit}")
        below.plot([value for value, _ in orbits], top, ".-", color=COLOURS[1], markersize=4, linewidth=1.0)
        below.set(xlabel=over, ylabel=f"largest in the motion in {unit}")
    figure.suptitle(title, fontweight="bold")


def _section(orbit: Orbit, axes: Axes) -> None:
    """Velocity over displacement after every period: the Poincare section."""
    ((y,), unit), ((v,), per_second) = (in_unit(orbit.of(), x) for x in orbit.section)
    axes.plot(y, v, ".", color=COLOURS[1], markersize=5)
    axes.set(xlabel=f"{orbit.labels[0]} in {unit}", ylabel=f"velocity in {per_second}/s")
    axes.set_title(f"Poincaré section, {len(y)} periods", fontsize=9)


def _over_frequency(orbit: Orbit, axes: Axes) -> None:
    """Displacement over the frequency of the excitation, and its largest size in every period of that."""
    f, ((y,), unit) = orbit.frequency, in_unit(orbit.of(), orbit.y[0])
    moves = np.flatnonzero(f != f[-1])
    period = np.floor(np.cumsum(f[moves]) * (orbit.time[1] - orbit.time[0])).astype(int)
    begins = np.searchsorted(period, np.unique(period))
    largest = np.maximum.reduceat(np.abs(y[moves]), begins)
    axes.plot(f[moves], y[moves], color=COLOURS[0], linewidth=0.4)
    axes.plot(f[begins], largest, color=COLOURS[1], linewidth=1.4, label="largest in each period")
    axes.set(xlabel="frequency of the excitation in Hz", ylabel=f"{orbit.labels[0]} in {unit}")


def _order(orbit: Orbit, harmonic: int) -> str:
    """Of a load: its engine order where bodies turn slower than it, else which harmonic it is."""
    ramp = orbit.equations.ramp
    turns = ramp is not None and ramp.order > 1
    return f"engine order {harmonic * ramp.order}" if turns and ramp else f"excitation, harmonic {harmonic}"


def _history(orbit: Orbit, axes: Axes) -> None:
    shown = slice(-SHOWN * orbit.samples, None)
    (y,), unit = in_unit(orbit.of(), orbit.y[0][shown])
    time = orbit.time[shown]
    axes.plot((time - time[0]) / orbit.period, y, color=COLOURS[0], linewidth=1.0)
    for kind, mark, size, words in EVENT_MARKS:
        at = _times(orbit, kind, time[0])
        if len(at):
            place = np.interp(at, time, y)
            axes.plot((at - time[0]) / orbit.period, place, mark, color=COLOURS[1], markersize=size, label=words, ls="")
    if len(axes.lines) > 1:
        axes.legend(ncols=2, **ABOVE)
    axes.set(xlabel="time in periods of the excitation", ylabel=f"{orbit.labels[0]} in {unit}")


def _times(orbit: Orbit, kind: str, begin: float, contact: int | None = None) -> Array:
    """s, of the events of a kind from then on; slips of contacts with friction alone."""
    chosen = [i for i in range(len(orbit.touching)) if kind != "slips" or rubs(orbit, i)]
    at = np.sort(np.concatenate([np.zeros(0), *(orbit.times(kind, i) for i in chosen if contact in (None, i))]))
    return at[at >= begin]


def _spectrum(orbit: Orbit, axes: Axes) -> None:
    """Amplitudes over multiples of the excitation, by a Hann window over all periods that are kept, down to
    `SPECTRUM` of the largest."""
    y = orbit.y[0]
    window = np.hanning(len(y))
    amplitude: Array = np.abs(np.fft.rfft(window * (y - np.average(y, weights=window)))) * 2 / window.sum()
    multiples = np.arange(len(amplitude)) * orbit.samples / len(y)
    seen = multiples <= min(HIGHEST, orbit.samples / 2)
    by, unit = orbit.of().scale(0.1 * amplitude.max(initial=0.0))
    top = by * amplitude.max(initial=1e-300)
    axes.semilogy(multiples[seen], np.maximum(by * amplitude, 1e-300)[seen], color=COLOURS[2], lw=0.9)
    axes.set(xlabel="multiples of the excitation frequency", ylabel=f"amplitude in {unit}")
    axes.set_ylim(SPECTRUM * top, 2 * top)
    plain_numbers(axes.yaxis, (1.0,))


def _spectrogram(orbit: Orbit, axes: Axes) -> None:
    """Spectra of windows of `WINDOW` periods that overlap, in dB of the largest amplitude, over periods and multiples
    of the excitation; of a run-up over time and frequency, with those of the loads."""
    y, n = orbit.y[0] - orbit.y[0].mean(), WINDOW * orbit.samples
    begins = np.arange(0, len(y) - n + 1, orbit.samples)
    sizes = np.abs(np.fft.rfft(np.hanning(n) * y[begins[:, None] + np.arange(n)], axis=1))
    multiples = np.arange(sizes.shape[1]) / WINDOW
    seen = multiples <= min(HIGHEST, orbit.samples / 2)
    decibels = 20 * np.log10(np.maximum(sizes[:, seen] / sizes.max(), 1e-300)).T
    period, last = (orbit.period, orbit.Omega / (2 * np.pi)) if orbit.run_up else (1.0, 1.0)
    x, y = (begins / orbit.samples + 0.5 * WINDOW) * period, multiples[seen] * last
    drawn = axes.pcolormesh(x, y, decibels, vmin=-80, vmax=0, cmap="viridis", shading="nearest")
    axes.figure.colorbar(drawn, ax=axes, label="amplitude in dB")  # type: ignore[union-attr]
    axes.grid(False)
    if not orbit.run_up:
        axes.set(xlabel="time in periods of the excitation", ylabel="multiples of its frequency")
        return
    for h in orbit.equations.harmonics:
        f, label = h * orbit.frequency, _order(orbit, h)
        axes.plot(orbit.time, f, color="white", linewidth=1.0, linestyle="--", label=label)
    for line in axes.legend(ncols=3, labelcolor="black", **ABOVE).get_lines():
        line.set_color("black")
    axes.set(xlabel="time in s", ylabel="frequency in Hz", ylim=(0, min(y[-1], 4.0 * last)))


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
    ((t1, t2),), unit = in_unit(METRES, orbit.d[rows][1:3, -SHOWN * orbit.samples :])
    axes.plot(t1, t2, color=COLOURS[3], linewidth=1.0)
    axes.set(xlabel=f"slip plane of {orbit.contacts[contact]}: t1 in {unit}", ylabel=f"t2 in {unit}")
    axes.set_aspect("equal", adjustable="datalim")


def _loop(orbit: Orbit, row: int, name: str, axes: Axes) -> None:
    """Force over displacement of the periods that `classification.loops` takes. Its area is no loss where the ground
    moves, so none is written."""
    count = (orbit.repeats or SHOWN) * orbit.samples + 1
    (d,), unit = in_unit(METRES, orbit.d[row, -count:])
    axes.plot(d, orbit.force[row, -count:], color=COLOURS[4], linewidth=1.0)
    axes.set(xlabel=f"{name}: displacement in {unit}", ylabel="force in N")


def chatter_picture(orbit: Orbit, contact: int, figure: Figure, title: str) -> None:
    """Displacement and velocity over the time of two periods, and the phase portrait, as in Sextro Fig. 4.2-3: impacts
    and where it comes to rest are marked."""
    first, second, portrait = panels(figure, (13.0, 4.3), 1, 3)
    begin = orbit.time[-2 * orbit.samples] if len(orbit.time) > 2 * orbit.samples else orbit.time[0]
    seen = orbit.time >= begin
    time, impacts = orbit.time[seen] - begin, _times(orbit, "closes", begin, contact)
    rests = [c for c in chatter(orbit, contact) if c.time + c.stays >= begin]
    histories = (first, orbit.y[0], orbit.labels[0], ""), (second, orbit.v[0], "velocity", "/s")
    for axes, values, what, per in histories:
        (scaled,), unit = in_unit(orbit.of(), values[seen])
        axes.plot(time, scaled, color=COLOURS[0], linewidth=0.9)
        at = np.interp(impacts, orbit.time[seen], scaled)
        axes.plot(impacts - begin, at, "|", color=COLOURS[1], label="meets")
        for i, c in enumerate(rests):
            ends = max(c.time - begin, 0.0), c.time + c.stays - begin
            axes.axvspan(*ends, color="#f2d9a0", lw=0, zorder=0, label="" if i else "rests")
        axes.set(xlabel="time in s", ylabel=f"{what} in {unit}{per}")
    orbit.plot(portrait)
    first.legend(ncols=2, **ABOVE)
    figure.suptitle(title, fontweight="bold")

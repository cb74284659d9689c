"""A steady vibration in pictures: response and stress over normal force, Haigh diagram, contact maps, stresses."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array
from ..operating.cycle import at_time, farthest_at
from ..operating.fatigue import Endurance, MaterialLimits, allowed_amplitude, vibration_margin
from ..operating.motion import Motion, displacement
from ..operating.stress import CycleStress, StressPeaks
from ..units import METRES, counted
from .plots import (
    COLOURS,
    by_rows,
    empty_figure,
    mark_missing,
    plain_numbers,
    said_beside,
    save_figure,
    single_panel,
    through,
    widths,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..operating.contact_maps import ContactMap
    from .lettering import Picture
    from .views import Studio

Curves = Mapping[float, tuple[Array, Array]]
"""Normal force, N -> abscissa and ordinate of a curve."""


def shades(count: int) -> list[tuple[float, ...]]:
    """Colours of a rising parameter, light to dark; a single one is dark."""
    from matplotlib import colormaps

    return [tuple(colormaps["viridis"](x)) for x in np.linspace(0.05, 0.85, max(count, 1))[::-1]]


# over frequency, over normal force ---------------------------------------------------------------------------------


def over_frequency_plot(
    curves: Curves, quantity: str, title: str, path: Path, lifted: Mapping[float, Array] | None = None
) -> Path:
    """A quantity over the frequency (Hz) for every normal force, on a logarithmic scale.

    Args:
        curves: NaN where a point did not converge, which is marked. quantity: label of the ordinate with its unit.
            lifted: normal force, N -> which points are not valid, because contacts would lift off; they are dotted.
    """
    figure, axes = single_panel(9.0, 6.0)
    pairs = list(zip(shades(len(curves)), sorted(curves.items()), strict=True))
    told = ""
    for width, (colour, (normal, (x, y))) in zip(widths(len(pairs)), pairs, strict=True):
        off = (lifted or {}).get(normal, np.zeros(len(x), dtype=bool))
        if off.any():
            axes.semilogy(*through(x, np.where(off, y, np.nan)), color=colour, linewidth=width, linestyle=":")
            told = "dotted: contacts would lift off, not valid"
        line = {"linestyle": ":" if off.all() else "-", "label": f"$F_N$ = {normal:g} N"}
        axes.semilogy(*through(x, np.where(off, np.nan, y)), color=colour, linewidth=width, **line)
    for row, (colour, (_, (x, y))) in enumerate(pairs):
        mark_missing(axes, x[np.isnan(y)], colour, row)
    low, high = (f(float(f(x)) for x, _ in curves.values()) for f in (min, max))
    axes.set(xlabel="excitation frequency in Hz", ylabel=quantity, title=title, xlim=(low, high))
    numbers_within(axes.yaxis)
    lines, names = axes.get_legend_handles_labels()
    lines, names = by_rows(lines, names, 6)
    figure.legend(lines, names, loc="outside lower center", ncols=6, fontsize=9, title=told or None, title_fontsize=8)
    return save_figure(figure, path)


def over_normal_force_plot(
    peaks: Mapping[str, Sequence[tuple[float, float]]], quantity: str, title: str, path: Path,
    lifted: Collection[float] = (),
) -> Path:  # fmt: skip
    """The largest value of each resonance over the normal force (N), both logarithmic; the lowest is marked.

    Args:
        peaks: name of a resonance -> (normal force, value) pairs. A normal force of 0 has no place on the axis.
            lifted: normal forces under which contacts would lift off, so that values are not valid: hollow.
    """
    figure, axes = single_panel(8.0, 5.2)
    for i, (name, pairs) in enumerate(peaks.items()):
        x, y = np.array(sorted(p for p in pairs if p[0] > 0)).reshape(-1, 2).T
        if not len(x):
            continue
        off = np.isin(x, list(lifted))
        colour, best = COLOURS[i % len(COLOURS)], int(np.argmin(np.where(off & ~off.all(), np.inf, y)))
        axes.loglog(x, y, "-", color=colour, linewidth=1.6, label=name)
        axes.plot(x[~off], y[~off], "o", color=colour, markersize=4)
        axes.plot(x[off], y[off], "o", color=colour, markersize=4, mfc="white")
        if 0 < best < len(x) - 1:
            axes.plot(x[best], y[best], "o", markersize=9, mfc="none", mec=colour, mew=1.6)
            how = {"ha": "center", "va": "top", "fontsize": 8.5, "color": colour}
            said_beside(axes, f"{x[best]:.3g} N", (x[best], y[best]), (0, -9), **how)
    hollow = any(normal in lifted for pairs in peaks.values() for normal, _ in pairs)
    axes.set(xlabel="normal force in N", ylabel=quantity, title=title)
    if hollow:
        axes.plot([], [], "o", color="0.3", markersize=4, mfc="white", label="contacts would lift off: not valid")
    axes.margins(y=0.15)
    for axis in (axes.xaxis, axes.yaxis):
        numbers_within(axis)
    if len(peaks) > 1 or hollow:
        axes.legend(fontsize=9)
    return save_figure(figure, path)


def numbers_within(axis: Any) -> None:
    """Numbers without powers of ten on a logarithmic axis; more of them where it spans less than a decade or two."""
    low, high = axis.get_view_interval()
    span = np.log10(high / low)
    within = (1.0,) if span > 2.5 else (1.0, 2.0, 5.0) if span > 0.8 else tuple(np.arange(1.0, 10.0))
    plain_numbers(axis, within)


# fatigue -----------------------------------------------------------------------------------------------------------


def haigh_plot(cycle: CycleStress, limits: MaterialLimits, worst: Endurance, title: str, path: Path) -> Path:
    """All places in the Haigh diagram: amplitude over mean, with the Goodman line and the line of yielding.

    Args:
        worst: the place to mark.
    """
    figure, axes = single_panel(8.0, 5.4)
    mean, amplitude = 1e-6 * cycle.mean, 1e-6 * cycle.amplitude
    left = min(float(mean.min()), -0.15e-6 * limits.tensile_strength)
    x = np.linspace(left, 1e-6 * limits.tensile_strength, 201)
    axes.plot(x, 1e-6 * allowed_amplitude(limits, 1e6 * x), color=COLOURS[1], linewidth=1.8, label="Goodman")
    if limits.yield_strength is not None:
        y = 1e-6 * limits.yield_strength - np.abs(x)
        axes.plot(x[y >= 0], y[y >= 0], color=COLOURS[4], linewidth=1.4, linestyle="--", label="yielding")
    dots: dict[str, Any] = {"s": 5, "alpha": 0.35, "linewidths": 0}
    out, zones = cycle.counted, np.flatnonzero(cycle.singular)
    if len(zones):
        axes.scatter(mean[zones], amplitude[zones], color="0.6", label="in singular zones", **dots)
    axes.scatter(mean[out], amplitude[out], color=COLOURS[0], label="places of the body", **dots)
    told = f"worst place: {1e-6 * worst.amplitude:.3g} MPa about {1e-6 * worst.mean:.3g} MPa,\n{_margin(worst)}"
    axes.plot(
        1e-6 * worst.mean, 1e-6 * worst.amplitude, "o", color="#111111", mfc="none", markersize=9, mew=1.8, label=told
    )
    top = max(1.15e-6 * limits.fatigue_strength, 1.1 * float(amplitude.max()))
    axes.set(
        xlabel="mean stress in MPa (static and mean, compression negative)",
        ylabel="stress amplitude in MPa",
        title=title,
        ylim=(0, top),
        xlim=(left, 1.03e-6 * limits.tensile_strength),
    )
    axes.legend(fontsize=9, loc="upper right")
    _close_up(axes, mean[out], amplitude[out])
    return save_figure(figure, path)


def _close_up(axes: Axes, mean: Array, amplitude: Array) -> None:
    """Where the places fill a corner of the diagram alone: a window on them, or words where no mean stress shows."""
    (left, right), (_, top) = axes.get_xlim(), axes.get_ylim()
    high = float(amplitude.max())
    if not 0 < high < 0.25 * top:
        return
    if np.ptp(mean) < 0.005 * (right - left):
        said = f"all places: mean stress {mean.min():.2g} to {mean.max():.2g} MPa,\namplitude up to {high:.3g} MPa"
        line = {"arrowstyle": "-", "color": COLOURS[0]}
        said_beside(axes, said, (mean.mean(), high), (40, 40), fontsize=9, color=COLOURS[0], arrowprops=line)
        return
    window = axes.inset_axes((0.52, 0.36, 0.45, 0.3))
    window.scatter(mean, amplitude, s=5, color=COLOURS[0], alpha=0.35, linewidths=0)
    window.set_title("the places, enlarged", fontsize=8)
    window.set_ylim(0, 1.1 * high)
    window.tick_params(labelsize=7.5)


def _margin(worst: Endurance) -> str:
    if not np.isfinite(worst.vibration):
        return "nothing vibrates"
    return f"reserve factor {worst.vibration:.3g}"


# contacts ----------------------------------------------------------------------------------------------------------

_PANELS = (
    ("pressure_mean", "mean pressure", 1e-6, "MPa", "YlOrRd"),
    ("traction", "swing of the traction", 1e-6, "MPa", "YlOrRd"),
    ("dissipated", "lost per cycle", 1.0, "J/m²", "BuPu"),
    ("slipping", "slips", 100.0, "% of the cycle", "viridis"),
    ("open", "separated", 100.0, "% of the cycle", "viridis"),
)


def contact_map_plot(maps: Sequence[ContactMap], title: str, path: Path) -> Path:
    """Pressure, traction, energy, slip and separation on every patch, a column each, seen along its normal."""
    spans = [np.maximum(np.ptp(m.places, axis=0), 1e-6) for m in maps]
    flat = [bool(s[1] <= s[0]) for s in spans]
    slender = max(min(float(s.min() / s.max()), 1.0) for s in spans)
    high = min(4.0 * slender, 1.6)  # inches of a panel; what is wider than it needs to be stays white
    narrow = slender > 0.4  # titles in two lines
    beside = 0.8 if narrow else 0.62
    figure = empty_figure(
        max(0.8 + min(1.9 + high / slender, 5.2) * len(maps), 6.5), 0.7 + len(_PANELS) * (beside + high)
    )
    table = figure.subplots(len(_PANELS), len(maps), squeeze=False)
    for j, (m, lies) in enumerate(zip(maps, flat, strict=True)):
        for i, panel in enumerate(_PANELS):
            _map_panel(table[i, j], m, *panel, lies, "\n" if narrow else ": ")
        told = f"{m.name}: {m.normal_force:.4g} N, {_energy(m.loss)} a cycle{_left(m)}"
        table[0, j].set_title(f"{told}\n{table[0, j].get_title()}", fontsize=9.5)
        for axes in table[:-1, j]:
            axes.tick_params(labelbottom=False)
        table[-1, j].set_xlabel(("t1" if lies else "t2") + " in mm", fontsize=9)
    figure.suptitle(title, fontweight="bold")
    return save_figure(figure, path)


def _left(m: ContactMap) -> str:
    """How a patch loses energy that slips nowhere, and what its samples leave in the balance."""
    opens = " as area opens" if _energy(m.loss) != "0 J" and not m.slipping.any() else ""
    left = _energy(m.unbalanced)
    return opens + ("" if left == "0 J" else f"\n{left} more not balanced by {counted(m.samples, 'sample')}")


def _energy(joules: float) -> str:
    if abs(joules) < 1e-15:  # rounding of forces that give back what they took
        return "0 J"
    units = ((1.0, "J"), (1e3, "mJ"), (1e6, "µJ"))
    scale, unit = next(((s, u) for s, u in units if abs(joules) * s >= 0.5), (1e9, "nJ"))
    return f"{joules * scale:.3g} {unit}"


def _map_panel(
    axes: Axes, m: ContactMap, name: str, label: str, scale: float, unit: str, colours: str, lies: bool, between: str
) -> None:
    from matplotlib.ticker import MaxNLocator

    from ..operating.contact_maps import grid_of, on_grid

    values, places = scale * getattr(m, name), m.places if lies else m.places[:, ::-1]
    low, high = min(float(values.min()), 0.0), 100.0 if unit.startswith("%") else max(float(values.max()), 0.0)
    how: dict[str, Any] = {"vmin": low, "vmax": high if high > low else 1.0, "cmap": colours}
    edges = grid_of(places)
    if edges is not None:
        shown: Any = axes.pcolormesh(1e3 * edges[0], 1e3 * edges[1], on_grid(places, values), **how)
    else:
        shown = axes.scatter(1e3 * places[:, 0], 1e3 * places[:, 1], c=values, s=14, **how)
    axes.set_aspect("equal")
    axes.set_ylabel(("t2" if lies else "t1") + " in mm", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.set_title(f"{label}{between}{_span(values)} {unit}", fontsize=9.5)
    ticks: Any = MaxNLocator(4) if high > low else [0.0]
    bar = axes.figure.colorbar(shown, ax=axes, shrink=0.95, pad=0.02, aspect=10, ticks=ticks)
    bar.ax.tick_params(labelsize=7.5)


def _span(values: Array) -> str:
    """Smallest and largest value; one where both read the same."""
    low, high = float(values.min()), float(values.max())
    told = f"{low:.3g} to {high:.3g}"
    return f"{high:.3g} everywhere, in" if told == f"{high:.3g} to {high:.3g}" else told


# the body ----------------------------------------------------------------------------------------------------------


def stress_picture(
    studio: Studio, motion: Motion, cycle: CycleStress, title: str, limits: MaterialLimits | None = None,
    mark: int | None = None,
) -> Picture | None:  # fmt: skip
    """The body at the instant it swings farthest, coloured by stress amplitude, and by the margin.

    Args:
        motion: at one frequency. cycle: its stress at the nodes. limits: add the margin. mark: node to draw a ring
            round.

    Returns:
        None where the stress is not known at the nodes of the mesh or no shapes are stored.
    """
    from . import views
    from .lettering import captioned, side_by_side
    from .scene import fit

    n = studio.basis.mesh.n_points
    if len(cycle.points) != n or any(len(p.group.phi) != n for p in motion.parts):
        return None
    shape, size, degrees = farthest(motion, n)
    grown = views.nice(views.AMPLITUDE * studio.extent / max(size, 1e-300))
    moved = (studio.basis.mesh.points + grown * shape)[studio.outside.source]
    camera = fit(np.vstack([studio.points, moved]), studio.axes, views.AREA)
    fields = [("stress amplitude (von Mises)", 1e-6 * cycle.amplitude, "MPa", views.STRESS_MAP)]
    if np.abs(cycle.mean).max() > 0.05 * float(cycle.amplitude.max()):
        fields.append(("largest stress of the cycle", 1e-6 * cycle.largest, "MPa", views.STRESS_MAP))
    if limits is not None:
        used = 100.0 / np.maximum(vibration_margin(limits, cycle.amplitude, cycle.mean), 1e-3)
        fields.append(("share of the endured amplitude", used, "%", views.STRESS_MAP))
    tiles = []
    for label, values, unit, colours in fields:
        image = views.stress_tile(
            studio, values, grown * shape, camera, 0.8, unit, colours, mark, cycle.singular
        )
        tiles.append(captioned(image, label, size=16))
    ring = "" if mark is None else f" Ring: the worst place{'' if _seen(studio, mark) else ', on the far side'}."
    zones = f" {views.ZONES}" if cycle.singular.any() else ""
    note = (
        f"Drawn at {degrees:.0f} degrees of the cycle, {grown:g} times as large; largest displacement "
        f"{METRES.sized(size, 3)}; grey lines: at rest.{ring}{zones}"
    )
    return captioned(side_by_side(tiles), title, note, 20)


def _seen(studio: Studio, node: int) -> bool:
    """Whether the surface at a node faces the viewer."""
    from .scene import vertex_normals

    here = studio.outside.source == node
    if not here.any():  # inside the body
        return False
    return bool((vertex_normals(studio.points, studio.outside.triangles)[here] @ studio.axes[2] > 0).any())


def farthest(motion: Motion, points: int) -> tuple[Array, float, float]:
    """Displacement (n, 3) about its mean at the instant at which some node is farthest out, how far (m), and Omega t.

    Omega t in degrees, to a hundredth of the cycle.
    """
    a = displacement(motion.at(0), np.arange(points))[0].copy()
    a[0] = 0.0
    best = farthest_at(a)
    shape = at_time(a, best, axis=0)
    return shape, float(np.linalg.norm(shape, axis=1).max()), float(np.degrees(best))


def stress_curve(frequency: Array, peaks: StressPeaks, converged: Array | None = None) -> tuple[Array, Array]:
    """Frequency (Hz) and largest stress amplitude (MPa) of a sweep, for `over_frequency_plot`."""
    y = 1e-6 * peaks.amplitude
    return frequency, y if converged is None else np.where(converged, y, np.nan)

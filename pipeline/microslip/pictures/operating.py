"""A steady vibration in pictures: response and stress over normal force, Haigh diagram, contact maps, stresses."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, ModalBasis
from ..operating.cycle import at_time, farthest_at
from ..operating.fatigue import Endurance, MaterialLimits, allowed_amplitude, vibration_margin
from ..operating.motion import Motion, displacement
from ..operating.stress import CycleStress
from ..units import METRES, Quantity, counted
from .plots import (
    COLOURS,
    INK,
    LIGHT,
    LIGHTER,
    Look,
    by_rows,
    in_shades,
    legend_below,
    mark_missing,
    numbers_within,
    panels,
    said_beside,
    swept,
)
from .turning import Outside, Turned, outside, turned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..operating.contact_maps import ContactMap
    from .lettering import Picture
    from .views import Studio

Curves = Mapping[float, tuple[Array, Array]]
"""Normal force, N -> abscissa and ordinate of a curve."""


Unsure = Callable[[float, Array], Array]
"""Normal force (N) and frequencies (Hz) -> bool, where amplitudes are uncertain."""


def all_sure(normal: float, frequency: Array) -> Array:
    """Nowhere."""
    return np.zeros(len(frequency), dtype=bool)


# over frequency, over normal force ---------------------------------------------------------------------------------


def over_frequency_plot(
    curves: Curves, quantity: str, title: str, figure: Figure, lifted: Mapping[float, Array] | None = None,
    unsure: Unsure = all_sure,
) -> None:  # fmt: skip
    """A quantity over the frequency (Hz) for every normal force, on a logarithmic scale.

    Args:
        curves: NaN where a point did not converge, which is marked. quantity: label of the ordinate with its unit.
            lifted: normal force, N -> which points are not valid, because contacts would lift off; they are dotted.
            unsure: see `Unsure`; curves are lighter there.
    """
    (axes,) = panels(figure, (9.0, 6.0))
    axes.set_yscale("log")
    words = None
    for line, normal, (x, y) in in_shades(curves):
        off = (lifted or {}).get(normal, np.zeros(len(x), dtype=bool))
        words = "dotted: contacts would lift off, not valid" if off.any() else words
        swept(axes, x, y, off, partial(unsure, normal), label=f"$F_N$ = {normal:g} N", **line)
    for row, (line, _, (x, y)) in enumerate(in_shades(curves)):
        mark_missing(axes, x[np.isnan(y)], line["color"], row)
    low, high = (f(float(f(x)) for x, _ in curves.values()) for f in (min, max))
    axes.set(xlabel="excitation frequency in Hz", ylabel=quantity, title=title, xlim=(low, high))
    numbers_within(axes.yaxis)
    legend_below(figure, 6, *by_rows(*axes.get_legend_handles_labels(), 6), title=words, title_fontsize=8)


def over_normal_force_plot(
    peaks: Mapping[str, Sequence[tuple[float, float]]], quantity: str, title: str, figure: Figure,
    lifted: Collection[float] = (), unsure: Collection[tuple[float, float]] = (),
) -> None:  # fmt: skip
    """The largest value of each resonance over the normal force (N), both logarithmic; the lowest is marked.

    Args:
        peaks: name of a resonance -> (normal force, value) pairs. A normal force of 0 has no place on the axis.
            lifted: normal forces under which contacts would lift off, so that values are not valid: hollow. unsure:
            pairs that are uncertain: lighter.
    """
    (axes,) = panels(figure, (8.0, 5.2))
    dot: Look = {"marker": "o", "ls": "", "markersize": 4}
    for i, (name, pairs) in enumerate(peaks.items()):
        x, y = np.array(sorted(p for p in pairs if p[0] > 0)).reshape(-1, 2).T
        if not len(x):
            continue
        off = np.isin(x, list(lifted))
        colour, best = COLOURS[i % len(COLOURS)], int(np.argmin(np.where(off & ~off.all(), np.inf, y)))
        axes.loglog(x, y, "-", color=colour, linewidth=1.6, label=name)
        light = np.array([pair in unsure for pair in zip(x, y, strict=True)])
        for these, look in ((~off & ~light, Look()), (~off & light, Look(alpha=LIGHT)), (off, Look(mfc="white"))):
            axes.plot(x[these], y[these], color=colour, **dot, **look)
        if 0 < best < len(x) - 1:
            axes.plot(x[best], y[best], "o", markersize=9, mfc="none", mec=colour, mew=1.6)
            how = {"ha": "center", "va": "top", "fontsize": 8.5, "color": colour}
            said_beside(axes, f"{x[best]:.3g} N", (x[best], y[best]), (0, -9), **how)
    hollow = any(normal in lifted for pairs in peaks.values() for normal, _ in pairs)
    axes.set(xlabel="normal force in N", ylabel=quantity, title=title)
    if hollow:
        axes.plot([], [], color="0.3", mfc="white", label="contacts would lift off: not valid", **dot)
    axes.margins(y=0.15)
    for axis in (axes.xaxis, axes.yaxis):
        numbers_within(axis)
    if len(unsure):
        axes.plot([], [], color="0.3", alpha=LIGHT, label=LIGHTER, **dot)
    if len(peaks) > 1 or hollow or len(unsure):
        axes.legend(fontsize=9)


# fatigue -----------------------------------------------------------------------------------------------------------


def haigh_plot(cycle: CycleStress, limits: MaterialLimits, worst: Endurance, title: str, figure: Figure) -> None:
    """All places in the Haigh diagram: amplitude over mean, with the Goodman line and the line of yielding.

    Args:
        worst: the place to mark.
    """
    (axes,) = panels(figure, (8.0, 5.4))
    mean, amplitude, strength = 1e-6 * cycle.mean, 1e-6 * cycle.amplitude, 1e-6 * limits.tensile_strength
    left = min(float(mean.min()), -0.15 * strength)
    x = np.linspace(left, strength, 201)
    axes.plot(x, 1e-6 * allowed_amplitude(limits, 1e6 * x), color=COLOURS[1], linewidth=1.8, label="Goodman")
    if limits.yield_strength is not None:
        y = 1e-6 * limits.yield_strength - np.abs(x)
        axes.plot(x[y >= 0], y[y >= 0], color=COLOURS[4], linewidth=1.4, linestyle="--", label="yielding")
    out, zones = cycle.counted, np.flatnonzero(cycle.singular)
    if len(zones):
        axes.scatter(mean[zones], amplitude[zones], color="0.6", label="in singular zones", **_PLACES)
    axes.scatter(mean[out], amplitude[out], color=COLOURS[0], label="places of the body", **_PLACES)
    at = 1e-6 * worst.mean, 1e-6 * worst.amplitude
    margin = f"reserve factor {worst.vibration:.3g}" if np.isfinite(worst.vibration) else "nothing vibrates"
    label = f"worst place: {1e-6 * worst.amplitude:.3g} MPa about {1e-6 * worst.mean:.3g} MPa,\n{margin}"
    axes.plot(*at, "o", color=INK, mfc="none", markersize=9, mew=1.8, label=label)
    axes.set(
        xlabel="mean stress in MPa (static and mean, compression negative)",
        ylabel="stress amplitude in MPa",
        title=title,
        ylim=(0, max(1.15e-6 * limits.fatigue_strength, 1.1 * float(amplitude.max()))),
        xlim=(left, 1.03 * strength),
    )
    axes.legend(fontsize=9, loc="upper right")
    _close_up(axes, cycle)


_PLACES: Look = {"s": 5, "alpha": 0.35, "linewidths": 0}


def _close_up(axes: Axes, cycle: CycleStress) -> None:
    """Where the places fill a corner of the diagram alone: a window on them, or words where no mean stress shows."""
    (left, right), (_, top) = axes.get_xlim(), axes.get_ylim()
    mean, amplitude = (1e-6 * of[cycle.counted] for of in (cycle.mean, cycle.amplitude))
    high = 1e-6 * cycle.highest
    if not 0 < high < 0.25 * top:
        return
    if np.ptp(mean) < 0.005 * (right - left):
        least, most = cycle.means
        said = f"all places: mean stress {1e-6 * least:.2g} to {1e-6 * most:.2g} MPa,\n"
        said += f"amplitude up to {high:.3g} MPa"
        line = {"arrowstyle": "-", "color": COLOURS[0]}
        said_beside(axes, said, (mean.mean(), high), (40, 40), fontsize=9, color=COLOURS[0], arrowprops=line)
        return
    window = axes.inset_axes((0.52, 0.36, 0.45, 0.3))
    window.scatter(mean, amplitude, color=COLOURS[0], **_PLACES)
    window.set_title("the places, enlarged", fontsize=8)
    window.set_ylim(0, 1.1 * high)
    window.tick_params(labelsize=7.5)


# contacts ----------------------------------------------------------------------------------------------------------

_PANELS = (
    ("pressure_mean", "mean pressure", 1e-6, "MPa", "YlOrRd"),
    ("traction", "swing of the traction", 1e-6, "MPa", "YlOrRd"),
    ("dissipated", "lost per cycle", 1.0, "J/m²", "BuPu"),
    ("slipping", "slips", 100.0, "% of the cycle", "viridis"),
    ("open", "separated", 100.0, "% of the cycle", "viridis"),
)


def contact_map_plot(maps: Sequence[ContactMap], title: str, figure: Figure) -> None:
    """Pressure, traction, energy, slip and separation on every patch, a column each, seen along its normal."""
    spans = [np.maximum(np.ptp(m.places, axis=0), 1e-6) for m in maps]
    slender = max(min(float(s.min() / s.max()), 1.0) for s in spans)
    high = min(4.0 * slender, 1.6)  # inches of a panel; what is wider than it needs to be stays white
    narrow, rows = slender > 0.4, len(_PANELS)  # titles in two lines
    wide = max(0.8 + min(1.9 + high / slender, 5.2) * len(maps), 6.5)
    figure.set_size_inches(wide, 0.7 + rows * ((0.8 if narrow else 0.62) + high))
    table = figure.subplots(rows, len(maps), squeeze=False)
    for m, span, column in zip(maps, spans, table.T, strict=True):
        lies = bool(span[1] <= span[0])
        for axes, panel in zip(column, _PANELS, strict=True):
            _map_panel(axes, m, *panel, lies, "\n" if narrow else ": ")
            axes.tick_params(labelbottom=axes is column[-1])
        words = f"{m.name}: {m.normal_force:.4g} N, {_energy(m.loss)} a cycle{_left(m)}"
        column[0].set_title(f"{words}\n{column[0].get_title()}", fontsize=9.5)
        column[-1].set_xlabel(("t1" if lies else "t2") + " in mm", fontsize=9)
    figure.suptitle(title, fontweight="bold")


def _left(m: ContactMap) -> str:
    """How a patch loses energy that slips nowhere, and what its samples leave in the balance."""
    opens = " as area opens" if _energy(m.loss) != "0 J" and not m.slipping.any() else ""
    left = _energy(m.unbalanced)
    return opens + ("" if left == "0 J" else f"\n{left} more not balanced by {counted(m.samples, 'sample')}")


def _energy(joules: float) -> str:
    return Quantity("J").sized(joules, 3) if abs(joules) >= 1e-15 else "0 J"  # else forces give back what they took


def _map_panel(
    axes: Axes, m: ContactMap, name: str, label: str, scale: float, unit: str, colours: str, lies: bool, between: str
) -> None:
    from matplotlib.ticker import MaxNLocator

    from ..operating.contact_maps import grid_of, on_grid

    values, places = scale * getattr(m, name), m.places if lies else m.places[:, ::-1]
    low, high = min(float(values.min()), 0.0), 100.0 if unit.startswith("%") else max(float(values.max()), 0.0)
    how: Look = {"vmin": low, "vmax": high if high > low else 1.0, "cmap": colours}
    edges = grid_of(places)
    if edges is not None:
        shown: Any = axes.pcolormesh(1e3 * edges[0], 1e3 * edges[1], on_grid(places, values), **how)
    else:
        shown = axes.scatter(1e3 * places[:, 0], 1e3 * places[:, 1], c=values, s=14, **how)
    axes.set_aspect("equal")
    axes.set_ylabel(("t2" if lies else "t1") + " in mm", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.set_title(f"{label}{between}{_span(m.span(name), scale)} {unit}", fontsize=9.5)
    ticks: Any = MaxNLocator(4) if high > low else [0.0]
    bar = axes.figure.colorbar(shown, ax=axes, shrink=0.95, pad=0.02, aspect=10, ticks=ticks)
    bar.ax.tick_params(labelsize=7.5)


def _span(ends: tuple[float, float], scale: float) -> str:
    """Smallest and largest value; one where both read the same."""
    low, high = (f"{scale * end:.3g}" for end in ends)
    return f"{high} everywhere, in" if low == high else f"{low} to {high}"


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
    shape, full_scale, degrees = farthest(motion, n)
    grown = views.nice(views.AMPLITUDE * studio.extent / max(full_scale, 1e-300))
    moved = (studio.basis.mesh.points + grown * shape)[studio.outside.source]
    camera = fit(np.vstack([studio.points, moved]), studio.axes, views.AREA)
    swing, most = 1e-6 * cycle.highest, 1e-6 * cycle.top
    fields = [("stress amplitude (von Mises)", 1e-6 * cycle.amplitude, "MPa", swing)]
    if np.abs(cycle.mean).max() > 0.05 * cycle.highest:
        fields.append(("largest stress of the cycle", 1e-6 * cycle.largest, "MPa", most))
    if limits is not None:
        used = 100.0 / np.maximum(vibration_margin(limits, cycle.amplitude, cycle.mean), 1e-3)
        fields.append(("share of the endured amplitude", used, "%", np.nan))
    tiles = []
    for label, values, unit, largest in fields:
        image = views.stress_tile(studio, values, grown * shape, camera, 0.8, unit, largest, mark=mark)
        tiles.append(captioned(image, label, size=16))
    ring = "" if mark is None else f" Ring: the worst place{'' if _seen(studio, mark) else ', on the far side'}."
    zones = f" {views.ZONES}" if cycle.singular.any() else ""
    note = (
        f"Drawn at {degrees:.0f} degrees of the cycle, {grown:g} times as large; largest displacement "
        f"{METRES.sized(full_scale, 3)}; grey lines: at rest.{ring}{zones}"
    )
    return captioned(side_by_side(tiles), title, note, 20)


def turning_stress(
    basis: ModalBasis, motion: Motion, cycle: CycleStress, title: str, limits: MaterialLimits | None
) -> str:
    """The body over the cycle, coloured by its stress, as it turns on a page; see `stress_picture`."""
    skin = outside(basis.mesh)
    moving = displacement(motion.at(0), skin.source)[0][1:]
    shapes = [
        Turned("stress amplitude", moving, _capped(1e-6 * cycle.amplitude, skin), "MPa, von Mises", True),
        Turned("largest stress", None, _capped(1e-6 * cycle.largest, skin), "MPa, von Mises", True),
    ]
    if limits is not None:
        used = 100.0 / np.maximum(vibration_margin(limits, cycle.amplitude, cycle.mean), 1e-3)
        shapes.append(Turned("share of the endured amplitude", None, _capped(used, skin), "%", True))
    return turned(basis.mesh.points[skin.source], skin, shapes, title)


def _capped(values: Array, skin: Outside) -> Array:
    """At the vertices, without the highest 0.2 %, which a corner has."""
    seen = values[skin.source]
    return np.minimum(seen, np.quantile(seen, 0.998))


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

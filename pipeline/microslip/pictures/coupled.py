"""A coupled ring in pictures: nodal diameters over contact stiffness, resonances over engine order, envelopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..data import Array
from ..harmonic_balance.envelope import lowest, worst
from ..units import METRES, Quantity
from .plots import (
    legend_below,
    mark_missing,
    numbers_within,
    panels,
    plain_numbers,
    said_beside,
    shades,
    whole_numbers,
    widths,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..harmonic_balance.envelope import Envelope, OverOrders
    from ..harmonic_balance.identification import IdentifiedStiffness, NodalDiagram

BLUE, RED = "#1f5f99", "#b3261e"


def _logarithmic(axes: Axes, label: str) -> None:
    """The ordinate, with plain numbers."""
    axes.set_yscale("log")
    plain_numbers(axes.yaxis, (1.0, 2.0, 5.0))
    axes.set_ylabel(label)


def nodal_diameter_picture(
    diagrams: Sequence[NodalDiagram], figure: Figure, title: str, found: IdentifiedStiffness | None = None
) -> None:
    """Frequencies over the nodal diameter for several contact stiffnesses, with what was measured (Sextro Fig. 5.4-1).

    Args:
        diagrams: of rising stiffness. found: measured frequencies, the fitted one filled.
    """
    (axes,) = panels(figure, (9.0, 6.0))
    for colour, d in zip(shades(len(diagrams)), diagrams, strict=True):
        for j, f in enumerate(d.frequency.T):
            label = f"$c_N$ = {d.stiffness:.3g} N/m" if j == 0 else None
            axes.plot(d.index, f, "o-", color=colour, markersize=3.5, linewidth=1.3, label=label)
    if found is not None:
        for m in found.measured:
            fill = RED if m == found.fitted else "none"
            axes.plot(m.index, m.frequency, "^", color=RED, markersize=9, zorder=5, markerfacecolor=fill)
        axes.plot([], [], "^", color=RED, label="measured, fitted")
        if len(found.measured) > 1:
            axes.plot([], [], "^", color=RED, markerfacecolor="none", label="measured, predicted")
    axes.set(xlabel="nodal diameter", ylabel="frequency in Hz", title=title)
    whole_numbers(axes)
    axes.set_ylim(bottom=0.0)
    legend_below(figure)


def over_orders_picture(found: Mapping[str, OverOrders], figure: Figure, title: str) -> None:
    """Resonance frequency, amplitude and stress over the engine order (Sextro Figs. 5.5-2, 5.5-4, 5.5-7b).

    Args:
        found: label, such as a normal force, -> resonances.
    """
    stressed = any(np.isfinite(r.stress).any() for r in found.values())
    last = list(found.values())[-1]
    scale, unit = last.quantity.shared(np.concatenate([r.amplitude for r in found.values()]))
    upper, *lower = panels(figure, (9.0, 9.5 if stressed else 7.0), 3 if stressed else 2, sharex=True)
    for width, colour, (label, r) in zip(widths(len(found)), shades(len(found)), found.items(), strict=True):
        line: dict[str, Any] = {"color": colour, "markersize": 3 + width, "linewidth": width}
        upper.plot(r.order, r.frequency, "o-", label=label, **line)
        for axes, values in zip(lower, (scale * r.amplitude, 1e-6 * r.stress), strict=False):
            axes.plot(r.order, values, "o-", **line)
    upper.plot(last.order, last.stuck, color="0.6", linewidth=1, linestyle="--", label="sticking contacts")
    upper.set(ylabel="resonance in Hz", title=title)
    labels = f"amplitude in {unit} (0-peak)", "largest stress amplitude in MPa"
    for axes, label in zip(lower, labels, strict=False):
        _logarithmic(axes, label)
    lower[-1].set(xlabel="engine order", xlim=(last.order.min() - 0.5, last.order.max() + 0.5))
    whole_numbers(lower[-1])
    legend_below(figure)


def worst_order_picture(found: Sequence[OverOrders], figure: Figure, title: str) -> None:
    """The worst of all engine orders over the normal force, as their table has it: stress where it is known, else
    amplitude; the lowest is marked, and every point says its engine order."""
    stressed = any(np.isfinite(r.stress).any() for r in found)
    of: Literal["stress", "amplitude"] = "stress" if stressed else "amplitude"
    rows = [w for r in found if (w := worst(r, of)) is not None]
    best = lowest(rows)
    scale, unit = (1e-6, "MPa") if stressed else found[0].quantity.shared(w.value for w in rows)
    (axes,) = panels(figure, (9.0, 5.5))
    x, y = [w.normal_force for w in rows], [scale * w.value for w in rows]
    axes.plot(x, y, "o-", color=BLUE, markersize=4, linewidth=1.6)
    label = f"lowest: {scale * best.value:.3g} {unit} under {best.normal_force:.4g} N"
    axes.plot(best.normal_force, scale * best.value, "o", ms=10, mfc="none", mec=RED, mew=1.6, label=label)
    for w in rows:
        said_beside(axes, f"EO {w.order}", (w.normal_force, scale * w.value), (0, 9), ha="center", fontsize=8.5)
    if min(x) > 0:
        axes.set_xscale("log")
        numbers_within(axes.xaxis)
    axes.set_yscale("log")
    axes.margins(y=0.15)
    numbers_within(axes.yaxis)
    what = "stress amplitude" if stressed else "amplitude"
    axes.set(xlabel="normal force in N", ylabel=f"worst {what} in {unit}", title=title)
    axes.legend(fontsize=9)


def envelope_picture(found: Envelope, figure: Figure, title: str) -> None:
    """Smallest and largest amplitude over the frequency, with every combination (Sextro Fig. 5.4-2)."""
    (axes,) = panels(figure, (9.0, 6.0))
    (scale, unit), between = found.quantity.shared(found.high), "between the smallest and the largest"
    low, high = scale * found.low, scale * found.high
    axes.fill_between(found.frequency, low, high, color="#9ec5e8", alpha=0.6, linewidth=0, label=between)
    for i, (a, ok) in enumerate(zip(found.monitor, found.converged, strict=True)):
        label = f"each of {len(found.monitor)} combinations" if i == 0 else None
        axes.plot(found.frequency, np.where(ok, scale * np.abs(a), np.nan), color="0.45", linewidth=0.6, label=label)
    mark_missing(axes, found.frequency[~found.converged.all(axis=0)], RED)
    _logarithmic(axes, f"amplitude in {unit} (0-peak)")
    axes.set(xlim=(found.frequency[0], found.frequency[-1]), xlabel="excitation frequency in Hz", title=title)
    legend_below(figure, 3)


def speed_line_picture(
    rpm: Array, frequency: Array, amplitude: Array, normal: Array, figure: Figure, title: str, of: Quantity = METRES
) -> None:
    """Amplitude and normal forces along an engine-order line.

    Args:
        rpm, frequency: (s,) speeds and Hz. amplitude: (s,) m, NaN where not converged. normal: (s, contacts) N. of:
            what is read; m stands for its unit.
    """
    upper, lower = panels(figure, (9.0, 6.5), 2, sharex=True, height_ratios=[2, 1])
    scale, unit = of.shared(amplitude)
    upper.plot(rpm, scale * amplitude, color=BLUE, linewidth=1.6)
    if (lost := np.isnan(amplitude)).any():
        mark_missing(upper, rpm[lost], BLUE)
        upper.legend(fontsize=8)
    _logarithmic(upper, f"amplitude in {unit} (0-peak)")
    upper.set_title(title)
    for i, (colour, force) in enumerate(zip(shades(normal.shape[1]), normal.T, strict=True)):
        lower.plot(rpm, force, color=colour, linewidth=1.4, label=f"contact {i + 1}")
    lower.set(ylabel="mean normal force in N", xlabel="rotation speed in rpm", xlim=(rpm[0], rpm[-1]))
    if 1 < normal.shape[1] < 9:
        lower.legend(fontsize=8)
    ratio = float(frequency[0] / rpm[0])
    scales: Any = (lambda n: n * ratio, lambda f: f / ratio)
    upper.secondary_xaxis("top", functions=scales).set_xlabel("excitation frequency in Hz")

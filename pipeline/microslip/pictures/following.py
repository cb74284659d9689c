"""Pictures of what is followed: curves through folds, backbones, a resonance over a setting, stability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array
from ..units import METRES, Quantity
from .plots import (
    COLOURS,
    RED,
    in_shades,
    legend_below,
    numbers_within,
    panels,
    plain_numbers,
    said_beside,
    shades,
    widths,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..case.curves import Followed
    from ..harmonic_balance.nonlinear_modes import Backbone
    from ..harmonic_balance.peak import Optimum
    from ..harmonic_balance.stability import Stability

_OVER = {"frequency": "excitation frequency in Hz", "load": "share of the load", "normal_force": "normal force in N"}


def curve_plot(found: Sequence[Followed], figure: Figure, title: str) -> None:
    """Amplitude over frequency, load or normal force; folds marked, every second leg between folds dashed."""
    (axes,) = panels(figure, (9.0, 5.6))
    scale, unit = found[0].quantity.shared(np.concatenate([one.amplitude for one in found]))
    colours = shades(len(found)) if len(found) > 1 else [COLOURS[0]]
    fold: dict[str, Any] = {"markerfacecolor": "white"}
    lost: dict[str, Any] = {"color": RED, "markersize": 9, "ls": "none"}
    for width, colour, one in zip(widths(len(found)), colours, found, strict=True):
        x, y = one.parameter, scale * one.amplitude
        ends = [0, *np.flatnonzero(one.fold), len(x) - 1]
        for leg, (a, b) in enumerate(zip(ends[:-1], ends[1:], strict=True)):
            label = None if leg else one.label.replace("F_N", "$F_N$")
            axes.plot(x[a : b + 1], y[a : b + 1], "--" if leg % 2 else "-", color=colour, linewidth=width, label=label)
        size = 6 if one.fold.sum() < 8 else 3.5
        axes.plot(x[one.fold], y[one.fold], "o", color=colour, markersize=size, zorder=4, **fold)
        if one.early:
            axes.plot(x[-1], y[-1], "x", zorder=5, **lost)
    if any(one.fold.any() for one in found):
        axes.plot([], [], "o", color="0.3", markersize=6, label="fold", **fold)
        axes.plot([], [], "--", color="0.3", label="runs back")
    if any(one.early for one in found):
        axes.plot([], [], "x", label="ends early", **lost)
    _for_reading(axes, found, scale)
    axes.set(xlabel=_OVER[found[0].over], ylabel=f"amplitude of the read-out in {unit} (0-peak)", title=title)
    legend_below(figure, 5)


def _for_reading(axes: Axes, found: Sequence[Followed], scale: float) -> None:
    """Logarithmic axes where values are spread over more than a factor of thirty."""
    heights = scale * np.concatenate([one.amplitude for one in found])
    ends = np.concatenate([one.parameter for one in found])
    spread = {"y": heights} if found[0].over == "frequency" else {"y": heights, "x": ends}
    axes.set_ylim(bottom=0)
    for name, values in spread.items():
        if 0 < 30 * values.min() < values.max():
            axes.set(**{f"{name}scale": "log"})
            within = (1.0, 2.0, 5.0) if values.max() < 300 * values.min() else (1.0,)
            plain_numbers(axes.yaxis if name == "y" else axes.xaxis, within)
            axes.autoscale(axis="both" if name == "y" else "x")


def backbone_plot(found: Mapping[float, Backbone], title: str, figure: Figure, of: Quantity = METRES) -> None:
    """Frequency and damping ratio over the amplitude of what is read, a curve a normal force (N)."""
    left, right = panels(figure, (10.5, 4.4), 1, 2)
    ends = [np.sqrt(one.amplitude[:1] * one.amplitude[-1:]) for one in found.values()]
    scale, unit = of.shared(np.concatenate(ends))
    for line, normal, one in in_shades(found):
        x, label = scale * one.amplitude, f"$F_N$ = {normal:g} N"
        left.semilogx(x, one.Omega / (2 * np.pi), label=label, **line)
        left.axhline(one.stuck / (2 * np.pi), color=line["color"], linewidth=0.8, linestyle=":")
        right.semilogx(x, 100 * one.damping, label=label, **line)
    for axes, quantity in ((left, "frequency in Hz (dotted: contacts stuck)"), (right, "damping ratio in %")):
        axes.set(xlabel=f"amplitude of the read-out in {unit} (0-peak)", ylabel=quantity)
        plain_numbers(axes.xaxis, (1.0,))
    right.set_ylim(bottom=0)
    figure.suptitle(title, fontsize=12)
    legend_below(figure, 6, *left.get_legend_handles_labels())


def optimum_plot(
    found: Optimum, label: str, title: str, figure: Figure, of: Quantity = METRES, name: str = "",
    others: Mapping[str, Array] | None = None, valid: Mapping[float, bool] | None = None,
) -> None:  # fmt: skip
    """Height and frequency of the highest resonance of what is read over a setting, the optimum marked; hollow and
    dotted what is doubtful or not valid, crosses where none is known.

    Args:
        name: of what was found, where others stand beside it: name -> (4, k) values of the setting, Hz, amplitudes, and
            1 where they are valid. valid: value -> whether what was found there is; all of it if not given.
    """
    left, right = panels(figure, (10.5, 4.4 + 0.35 * bool(others)), 1, 2)
    known = {value: one for value, one in found.found.items() if one.status == "converged"}
    good = valid or {}
    own = np.array([[v, one.Omega / (2 * np.pi), one.amplitude, good.get(v, True)] for v, one in known.items()]).T
    scale, unit = of.shared(own[2])  # as its page has it
    curves = {**(others or {}), name: own}
    hollow: dict[str, Any] = {"markersize": 4, "markerfacecolor": "white"}
    for (words, (x, f, a, ok)), colour in zip(curves.items(), COLOURS, strict=False):
        for axes, y in ((left, scale * a), (right, f)):
            axes.plot(x, y, "o:", color=colour, linewidth=1.2, **hollow)
            axes.plot(x, np.where(ok > 0, y, np.nan), "o-", color=colour, markersize=4, linewidth=1.6, label=words)
    doubtful = not all(one[3].all() for one in curves.values())
    if doubtful:
        left.plot([], [], "o:", color="0.3", label="doubtful or not valid, see the table", **hollow)
    lost = [value for value in found.found if value not in known]
    place = list(known).index(found.parameter)
    abscissae, heights = (np.concatenate([one[i] for one in curves.values()]) for i in (0, 2))
    for axes, y in ((left, scale * own[2]), (right, own[1])):
        if lost:
            foot, words = axes.get_xaxis_transform(), "no resonance known, see the table"
            axes.plot(lost, np.full(len(lost), 0.03), "x", color=RED, transform=foot, label=words)
        axes.plot(found.parameter, y[place], "o", markersize=11, mfc="none", mec=RED, mew=1.8)
        axes.set_xlabel(label)
        if abscissae.min() > 0 and abscissae.max() > 4 * abscissae.min():  # far enough apart for three numbers
            axes.set_xscale("log")
            numbers_within(axes.xaxis)
    at = found.parameter, scale * own[2][place]
    said_beside(left, f"{found.parameter:.4g}", at, (0, -18), ha="center", fontsize=9, color=RED)
    if heights.max() > 5 * heights.min():
        left.set_yscale("log")
        numbers_within(left.yaxis)
    left.set_ylabel(f"height of the highest resonance in {unit} (0-peak)")
    left.margins(y=0.15)
    right.set_ylabel("its frequency in Hz")
    figure.suptitle(title, fontsize=12)
    if others or doubtful or lost:
        legend_below(figure, 4, *left.get_legend_handles_labels())


def stability_plot(found: Mapping[float, Mapping[float, Stability]], title: str, figure: Figure) -> None:
    """Largest multiplier over the frequency, a curve a normal force (N); what is not stable stands out."""
    (axes,) = panels(figure, (9.0, 5.0))
    axes.axhline(1.0, color="#333", linewidth=1.0)
    for line, normal, points in in_shades(found):
        f = np.array(sorted(points))
        growth = np.array([points[x].growth for x in f])
        lost = np.array([not points[x].stable for x in f], dtype=bool)
        axes.plot(f, growth, label=f"$F_N$ = {normal:g} N", **line)
        axes.plot(f[lost], growth[lost], "o", color=RED, markersize=5)
    multiplier = "largest Floquet multiplier (red dots: not stable)"
    axes.set(xlabel="excitation frequency in Hz", ylabel=multiplier, title=title)
    legend_below(figure, 6)

"""Pictures of what is followed: curves through folds, backbones, a resonance over a setting, stability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..data import Array
from ..units import METRES, Quantity
from .operating import numbers_within, shades
from .plots import (
    COLOURS,
    empty_figure,
    plain_axes,
    plain_numbers,
    said_beside,
    save_figure,
    single_panel,
    widths,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..case.curves import Followed
    from ..harmonic_balance.nonlinear_modes import Backbone
    from ..harmonic_balance.peak import Optimum
    from ..harmonic_balance.stability import Stability


def curve_plot(found: Sequence[Followed], path: Path, title: str) -> Path:
    """Amplitude over frequency, load or normal force; folds marked, every second leg between folds dashed."""
    figure, axes = single_panel(9.0, 5.6)
    scale, unit = found[0].quantity.shared(np.concatenate([one.amplitude for one in found]))
    colours = shades(len(found)) if len(found) > 1 else [COLOURS[0]]
    for width, colour, one in zip(widths(len(found)), colours, found, strict=True):
        x, y = one.parameter, scale * one.amplitude
        ends = [0, *np.flatnonzero(one.fold), len(x) - 1]
        for leg, (a, b) in enumerate(zip(ends[:-1], ends[1:], strict=True)):
            line, label = "--" if leg % 2 else "-", one.label.replace("F_N", "$F_N$") if leg == 0 else None
            axes.plot(x[a : b + 1], y[a : b + 1], line, color=colour, linewidth=width, label=label)
        size = 6 if one.fold.sum() < 8 else 3.5
        axes.plot(x[one.fold], y[one.fold], "o", color=colour, markersize=size, markerfacecolor="white", zorder=4)
        if one.early:
            axes.plot(x[-1], y[-1], "x", color="#c8382c", markersize=9, zorder=5)
    if any(one.fold.any() for one in found):
        axes.plot([], [], "o", color="0.3", markersize=6, markerfacecolor="white", label="fold")
        axes.plot([], [], "--", color="0.3", label="runs back")
    if any(one.early for one in found):
        axes.plot([], [], "x", color="#c8382c", markersize=9, linestyle="none", label="ends early")
    _for_reading(axes, found, scale)
    axes.set(xlabel=_OVER[found[0].over], ylabel=f"amplitude of the read-out in {unit} (0-peak)", title=title)
    figure.legend(loc="outside lower center", ncols=5, fontsize=9)
    return save_figure(figure, path)


_OVER = {"frequency": "excitation frequency in Hz", "load": "share of the load", "normal_force": "normal force in N"}


def _for_reading(axes: Axes, found: Sequence[Followed], scale: float) -> None:
    """Logarithmic axes where values are spread over more than a factor of thirty."""
    heights = scale * np.concatenate([one.amplitude for one in found])
    ends = np.concatenate([one.parameter for one in found])
    spread = {"y": heights} if found[0].over == "frequency" else {"y": heights, "x": ends}
    axes.set_ylim(bottom=0)
    for name, values in spread.items():
        if not 0 < 30 * values.min() < values.max():
            continue
        axis = axes.yaxis if name == "y" else axes.xaxis
        axes.set(**{f"{name}scale": "log"})
        plain_numbers(axis, (1.0, 2.0, 5.0) if values.max() < 300 * values.min() else (1.0,))
        axes.autoscale(axis="both" if name == "y" else "x")


def backbone_plot(found: Mapping[float, Backbone], title: str, path: Path, of: Quantity = METRES) -> Path:
    """Frequency and damping ratio over the amplitude of what is read, a curve a normal force (N)."""
    figure = empty_figure(10.5, 4.4)
    left, right = figure.subplots(1, 2)
    ends = [np.sqrt(one.amplitude[:1] * one.amplitude[-1:]) for one in found.values()]
    scale, unit = of.shared(np.concatenate(ends))
    order = sorted(found.items())
    for width, colour, (normal, one) in zip(widths(len(order)), shades(len(order)), order, strict=True):
        x, label = scale * one.amplitude, f"$F_N$ = {normal:g} N"
        left.semilogx(x, one.Omega / (2 * np.pi), color=colour, linewidth=width, label=label)
        left.axhline(one.stuck / (2 * np.pi), color=colour, linewidth=0.8, linestyle=":")
        right.semilogx(x, 100 * one.damping, color=colour, linewidth=width, label=label)
    for axes, quantity in ((left, "frequency in Hz (dotted: contacts stuck)"), (right, "damping ratio in %")):
        plain_axes(axes)
        axes.set(xlabel=f"amplitude of the read-out in {unit} (0-peak)", ylabel=quantity)
        plain_numbers(axes.xaxis, (1.0,))
    right.set_ylim(bottom=0)
    figure.suptitle(title, fontsize=12)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=9)
    return save_figure(figure, path)


def optimum_plot(
    found: Optimum, label: str, title: str, path: Path, of: Quantity = METRES, name: str = "",
    beside: Mapping[str, Array] | None = None, valid: Mapping[float, bool] | None = None,
) -> Path:  # fmt: skip
    """Height and frequency of the highest resonance of what is read over a setting, the optimum marked; hollow and
    dotted what is doubtful or not valid, crosses where none is known.

    Args:
        name: of what was found, where others stand beside it: name -> (4, k) values of the setting, Hz, amplitudes, and
            1 where they are valid. valid: value -> whether what was found there is; all of it if not given.
    """
    figure = empty_figure(10.5, 4.4 + 0.35 * bool(beside))
    left, right = figure.subplots(1, 2)
    known = {value: one for value, one in found.found.items() if one.status == "converged"}
    good = valid or {}
    own = np.array([[v, one.Omega / (2 * np.pi), one.amplitude, good.get(v, True)] for v, one in known.items()]).T
    scale, unit = of.shared(own[2])  # as its page has it
    curves = {**(beside or {}), name: own}
    for (said, (x, f, a, ok)), colour in zip(curves.items(), COLOURS, strict=False):
        for axes, y in ((left, scale * a), (right, f)):
            axes.plot(x, y, "o:", color=colour, markersize=4, markerfacecolor="white", linewidth=1.2)
            axes.plot(x, np.where(ok > 0, y, np.nan), "o-", color=colour, markersize=4, linewidth=1.6, label=said)
    doubtful = not all(one[3].all() for one in curves.values())
    if doubtful:
        hollow = {"color": "0.3", "markersize": 4, "markerfacecolor": "white"}
        left.plot([], [], "o:", **hollow, label="doubtful or not valid, see the table")
    lost = [value for value in found.found if value not in known]
    for axes in (left, right) if lost else ():
        at_the_foot, label = axes.get_xaxis_transform(), "no resonance known, see the table"
        axes.plot(lost, np.full(len(lost), 0.03), "x", color="#c8382c", transform=at_the_foot, label=label)
    place = list(known).index(found.parameter)
    for axes, y in ((left, scale * own[2]), (right, own[1])):
        at = (found.parameter, y[place])
        axes.plot(*at, "o", markersize=11, mfc="none", mec="#c8382c", mew=1.8)
        plain_axes(axes)
        axes.set_xlabel(label)
        _over_ratios(axes, np.concatenate([one[0] for one in curves.values()]))
        if axes is left:
            said_beside(axes, f"{found.parameter:.4g}", at, (0, -18), ha="center", fontsize=9, color="#c8382c")
    height = scale * np.concatenate([one[2] for one in curves.values()])
    if height.max() > 5 * height.min():
        left.set_yscale("log")
        numbers_within(left.yaxis)
    left.set_ylabel(f"height of the highest resonance in {unit} (0-peak)")
    left.margins(y=0.15)
    right.set_ylabel("its frequency in Hz")
    figure.suptitle(title, fontsize=12)
    if beside or doubtful or lost:
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9)
    return save_figure(figure, path)


def _over_ratios(axes: Axes, x: Array) -> None:
    """A logarithmic axis with round numbers, where all are positive and far enough apart for three of them."""
    if x.min() > 0 and x.max() > 4 * x.min():
        axes.set_xscale("log")
        numbers_within(axes.xaxis)


def stability_plot(found: Mapping[float, Mapping[float, Stability]], title: str, path: Path) -> Path:
    """Largest multiplier over the frequency, a curve a normal force (N); what is not stable stands out."""
    figure, axes = single_panel(9.0, 5.0)
    axes.axhline(1.0, color="#333", linewidth=1.0)
    order = sorted(found.items())
    for width, colour, (normal, points) in zip(widths(len(order)), shades(len(order)), order, strict=True):
        f = np.array(sorted(points))
        growth = np.array([points[x].growth for x in f])
        lost = np.array([not points[x].stable for x in f], dtype=bool)
        axes.plot(f, growth, color=colour, linewidth=width, label=f"$F_N$ = {normal:g} N")
        axes.plot(f[lost], growth[lost], "o", color="#c8382c", markersize=5)
    axes.set(
        xlabel="excitation frequency in Hz", ylabel="largest Floquet multiplier (red dots: not stable)", title=title
    )
    figure.legend(loc="outside lower center", ncols=6, fontsize=9)
    return save_figure(figure, path)

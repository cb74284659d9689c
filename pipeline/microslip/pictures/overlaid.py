"""Curves of several pictures of one kind in one: a colour for each value of what was varied, dashes for what stands
beside each other in each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array
from .plots import COLOURS, plain_axes, shades
from .touch import DASHES, SYMBOLS, Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Curves = Mapping[str, Any]
"""See `touch.curves_of`."""

PATTERNS = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 3)))
_PREFIX = {"G": 1e9, "M": 1e6, "k": 1e3, "": 1.0, "m": 1e-3, "µ": 1e-6, "n": 1e-9}
_UNITS = {f"{p}{unit}": (unit, f) for p, f in _PREFIX.items() for unit in ("m", "rad", "N", "Pa", "J", "s", "m/m")}
_UNITS |= {"N/µm": ("N/m", 1e6), "N/m": ("N/m", 1.0), "h": ("s", 3600.0)}
"""Unit in a label -> the one of SI, and how many of those it is."""
WIDTH, COLUMN, ROW = 6.8, 2.6, 0.22
"""inches: of a picture of one column, of one more, of a line of its legend."""


def can_overlay(pictures: Sequence[Curves]) -> bool:
    """Whether they have the same axes, but for units that can be converted, and lines alone."""
    first = _axes_of(pictures[0])
    return all(trace["type"] == "scatter" for one in pictures for trace in one["data"]) and all(
        _axes_of(one).keys() == first.keys()
        and all(_factor(axis, first[name]) is not None for name, axis in _axes_of(one).items())
        for one in pictures
    )


def overlaid(pictures: Mapping[str, Curves], key: str, title: str, figure: Figure) -> None:
    """All in the axes of the first.

    Args:
        pictures: value of the key -> curves that `can_overlay`.
    """
    from matplotlib.lines import Line2D

    first = next(iter(pictures.values()))
    colours: Sequence[Any] = shades(len(pictures)) if _rising(pictures) else COLOURS
    names = _named(pictures)
    styles = {name: pattern for name, (_, pattern) in names.items()} if len({p for _, p in names.values()}) > 1 else {}
    rows = [-(-len(pictures) // 6), -(-len(styles) // 4)]
    columns = len({round(a["domain"][0], 1) for name, a in _axes_of(first).items() if name.startswith("x")})
    wide = WIDTH + COLUMN * (columns - 1)
    high, foot = wide / max(first["shape"], 0.9), 0.75 + ROW * (sum(rows) + 1.5)
    figure.set_layout_engine("none")
    figure.set_size_inches(wide, high + foot)
    lines = max((note["text"].count("<br>") + 1 for note in _titles(first)), default=0)
    part = (0.95 / wide, foot / (high + foot)), (1 - 0.2 / wide, 1 - (0.5 + 0.18 * lines) / (high + foot))
    drawn = _empty_axes(figure, first, *part)
    for colour, curves in zip(colours, pictures.values(), strict=False):
        for trace in curves["data"]:
            _draw(drawn[trace["yaxis"]], trace, curves, first, colour, styles)
    for name, axes in drawn.items():
        _limit(axes, name, pictures, first)
    how: dict[str, Any] = {"loc": "lower center", "frameon": False, "fontsize": 9}
    values = [Line2D([], [], color=c, linewidth=2) for c in colours[: len(pictures)]]
    figure.legend(values, list(pictures), title=key, ncols=6, bbox_to_anchor=(0.5, 0.0), **how)
    if styles:
        handles = [_sample(names[name][0], style) for name, style in styles.items()]
        above = 0.5, ROW * (rows[0] + 1.4) / (high + foot)
        figure.legend(handles, list(map(_words, styles)), ncols=4, bbox_to_anchor=above, **how)
    figure.suptitle(title, fontweight="bold")


def _named(pictures: Mapping[str, Curves]) -> dict[str, tuple[Trace, Any]]:
    """What legends name -> one of its lines, and its dashes: those beside each other in a panel differ."""
    found, count = dict[str, tuple[Trace, Any]](), dict[str, int]()
    for one in pictures.values():
        for trace in one["data"]:
            if trace.get("showlegend") and "fill" not in trace and trace["name"] not in found:
                number = count.setdefault(trace["yaxis"], 0)
                count[trace["yaxis"]] += 1
                found[trace["name"]] = trace, PATTERNS[number % len(PATTERNS)]
    return found


def _rising(pictures: Mapping[str, Curves]) -> bool:
    """Whether the values are numbers in their order."""
    try:
        numbers = [float(value) for value in pictures]
    except ValueError:
        return False
    return numbers in (sorted(numbers), sorted(numbers, reverse=True))


def _axes_of(curves: Curves) -> dict[str, Any]:
    """Name, x1 or y1, -> axis."""
    return {n.replace("axis", ""): axis for n, axis in curves["layout"].items() if n[1:].startswith("axis")}


def _parted(label: str) -> tuple[str, str]:
    """What a label tells, and its unit; no unit where it tells none."""
    found = re.fullmatch(r"(?s)(.*\bin) (\S+)", label)
    return (found[1], found[2]) if found and found[2] in _UNITS else (label, "")


def _factor(axis: Mapping[str, Any], other: Mapping[str, Any]) -> float | None:
    """By which numbers of an axis become those of another one; None where they tell different things."""
    (what, unit), (asked, wanted) = (_parted(one["title"]["text"]) for one in (axis, other))
    if what != asked or bool(unit) != bool(wanted) or axis["type"] != other["type"]:
        return None
    if not unit:
        return 1.0
    (of, size), (to, into) = _UNITS[unit], _UNITS[wanted]
    return size / into if of == to else None


def _titles(curves: Curves) -> list[Any]:
    """Those of panels."""
    return [note for note in curves["layout"]["annotations"] if "domain" in str(note["xref"])]


def _empty_axes(
    figure: Figure, first: Curves, corner: tuple[float, float], other: tuple[float, float]
) -> dict[str, Axes]:
    """Name of an ordinate -> axes where the first picture has it, between two corners of the figure."""
    wide, tall = (end - start for start, end in zip(corner, other, strict=True))
    drawn: dict[str, Axes] = {}
    every = _axes_of(first)
    for name, axis in every.items():
        if not name.startswith("y"):
            continue
        if "overlaying" in axis:
            drawn[name] = drawn[axis["overlaying"]].twinx()
        else:
            (left, right), (low, high) = every[axis["anchor"]]["domain"], axis["domain"]
            place = corner[0] + wide * left, corner[1] + tall * low, wide * (right - left), tall * (high - low)
            drawn[name] = figure.add_axes(place)
            plain_axes(drawn[name])
            drawn[name].set_xlabel(_words(every[axis["anchor"]]["title"]["text"]))
            drawn[name].set_xscale(every[axis["anchor"]]["type"])
        drawn[name].set_ylabel(_words(axis["title"]["text"]))
        drawn[name].set_yscale(axis["type"])
    for note in _titles(first):
        drawn[note["yref"].split()[0]].set_title(_words(note["text"]), fontsize=10)
    return drawn


def _draw(
    axes: Axes, trace: Trace, curves: Curves, first: Curves, colour: Any, styles: Mapping[str, Any]
) -> None:
    """A line or points of one picture, in the units of the first; nothing of what only tells or shades."""
    if "text" in trace or "fill" in trace:
        return
    x, y = (_numbers(trace[of], _factor(_axes_of(curves)[a], _axes_of(first)[a]))
            for of, a in (("x", trace["xaxis"]), ("y", trace["yaxis"])))  # fmt: skip
    (line,) = axes.plot(x, y, color=colour, label="_", alpha=trace["opacity"])
    _look(line, trace, styles.get(trace["name"]))


def _look(line: Any, trace: Trace, style: Any) -> None:
    plain = {word: kind for kind, word in DASHES.items()}
    dash = plain.get(trace.get("line", {}).get("dash") or "", "none") if "lines" in trace["mode"] else "none"
    line.set(linestyle=style if style and dash == "-" else dash, linewidth=1.5)
    if marker := trace.get("marker"):
        line.set(marker=next(k for k, v in SYMBOLS.items() if v == marker["symbol"]), markersize=4)
        line.set(fillstyle="none" if marker["color"] == "white" else "full")


def _sample(trace: Trace, style: Any) -> Any:
    """For the legend."""
    from matplotlib.lines import Line2D

    line = Line2D([], [], color="0.3")
    _look(line, trace, style)
    return line


def _numbers(values: Sequence[float | None], factor: float | None) -> Array:
    return np.array([np.nan if v is None else v for v in values]) * (factor or 1.0)


def _limit(axes: Axes, name: str, pictures: Mapping[str, Curves], first: Curves) -> None:
    """The union of the limits that the pictures have."""
    abscissa = _axes_of(first)[name].get("overlaying", name).replace("y", "x")
    for axis, limit in ((abscissa, axes.set_xlim), (name, axes.set_ylim)):
        ends = []
        for curves in pictures.values():
            own = _axes_of(curves)[axis]
            factor = _factor(own, _axes_of(first)[axis]) or 1.0
            ends.append([factor * (10**end if own["type"] == "log" else end) for end in own["range"]])
        falls = ends[0][0] > ends[0][1]
        low, high = min(map(min, ends)), max(map(max, ends))
        limit((high, low) if falls else (low, high))


def _words(html: str) -> str:
    """A text of a page as matplotlib has it."""
    plain = re.sub(r"<(sub|sup)>(.*?)</\1>", lambda m: f"${'_' if m[1] == 'sub' else '^'}{{{m[2]}}}$", html)
    return plain.replace("<br>", "\n")

"""A drawn figure as data that a page's curves are made of, to zoom and to ask for values: its lines, points and maps in
the terms of plotly.

What is there is read from the figure, so that the picture and the curves cannot differ. A figure that holds anything
else (bodies, bars, arrows) has none: its picture stands alone.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

Trace = dict[str, Any]

DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
SYMBOLS = {
    "o": "circle", ".": "circle", "s": "square", "^": "triangle-up", "v": "triangle-down", "x": "x-thin-open",
    "+": "cross-thin-open", "*": "star", "D": "diamond", "d": "diamond", "|": "line-ns-open", "_": "line-ew-open",
}  # fmt: skip
DIGITS = 7
MOST = 200_000
"""Numbers of a figure above which it has no curves: the page would be slow."""


def tell_points(axes: Axes, x: Array, y: Array, columns: Mapping[str, Array], colour: Any, label: str) -> None:
    """Points of a curve, not drawn in the picture, that tell what they are where a page's curves are pointed at.

    Args:
        columns: name with unit -> (len(x),) numbers or words.
    """
    (line,) = axes.plot(x, y, linestyle="none", marker="none", color=colour, label=f"_{label}")
    line.set_gid(json.dumps({name: list(map(_word, values)) for name, values in columns.items()}))


def curves_of(figure: Figure) -> dict[str, Any] | None:
    """Traces and layout of a figure that was drawn, see plotly's `newPlot`; None where it holds what is no curve."""
    panels = [axes for axes in figure.axes if axes.get_visible() and axes.get_label() != "<colorbar>"]
    drawn: list[Any] = [line.get_xdata() for axes in panels for line in axes.lines]
    drawn += [some.get_array() for axes in panels for some in axes.collections]
    if not 0 < sum(map(np.size, drawn)) < MOST or any(_other(axes) for axes in panels):
        return None
    traces: list[Trace] = []
    layout: dict[str, Any] = {
        "margin": {"l": 20, "r": 20, "t": 20, "b": 20}, "hovermode": "closest", "plot_bgcolor": "white",
        "font": {"size": 12}, "annotations": [], "shapes": [], "showlegend": False,
        "legend": {"orientation": "h", "x": 0, "y": -0.13, "yanchor": "top", "yref": "paper"},
    }  # fmt: skip
    bounds = np.array([axes.get_position().extents for axes in panels])
    (left, low), (right, high) = bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)
    frame = np.array([left, low]), np.array([right - left, high - low])
    shares = ((bounds.reshape(-1, 2, 2) - frame[0]) / frame[1]).reshape(-1, 4)
    for number, axes in enumerate(panels, 1):
        before = [i for i, other in enumerate(panels[: number - 1], 1) if _together(axes, other)]
        _panel(axes, number, before[0] if before else 0, shares[number - 1].tolist(), frame, traces, layout)
    width, height = figure.get_size_inches()
    title = figure.get_suptitle() or panels[0].get_title() * (len(panels) == 1)
    layout |= {"title": {"text": _text(title), "font": {"size": 14}}} if title else {}
    lines = max((a.get_title().count("\n") + 1 for a in panels if len(panels) > 1 and a.get_title()), default=0)
    bars = any(axes.get_label() == "<colorbar>" for axes in figure.axes)
    layout["margin"] |= {"t": 15 * lines + (50 if title else 20), "r": 70 if bars else 20}
    return {"data": traces, "layout": layout, "shape": round(width / height, 3)}


def _other(axes: Axes) -> bool:
    """Whether it holds what is neither a line, nor points, nor a map over a grid, nor a shaded strip, nor words."""
    from matplotlib.collections import LineCollection, PathCollection, QuadMesh

    drawn = (PathCollection, QuadMesh, LineCollection)
    return bool(
        axes.name != "rectilinear" or axes.images or axes.tables or not all(_span(axes, p) for p in axes.patches)
    ) or any(
        not isinstance(one, drawn) and not _between(one) or (isinstance(one, QuadMesh) and _edges(one) is None)
        for one in axes.collections
    )


def _span(axes: Axes, patch: Any) -> bool:
    """Whether it shades all that is between two abscissae."""
    from matplotlib.patches import Rectangle

    whole = isinstance(patch, Rectangle) and (patch.get_y(), patch.get_height()) == (0.0, 1.0)
    return bool(whole and patch.get_data_transform() == axes.get_xaxis_transform())


def _between(some: Any) -> bool:
    """Whether it fills what is between two curves."""
    from matplotlib.collections import PolyCollection

    kind = type(some).__name__ in ("PolyCollection", "FillBetweenPolyCollection")
    return isinstance(some, PolyCollection) and kind and some.get_array() is None and len(some.get_paths()) == 1


def _together(axes: Axes, other: Axes) -> bool:
    """Whether two share a place, each with an ordinate of its own."""
    return bool(np.allclose(axes.get_position().bounds, other.get_position().bounds, atol=1e-3))


def _panel(
    axes: Axes,
    number: int,
    over: int,
    place: list[float],
    frame: tuple[Array, Array],
    traces: list[Trace],
    layout: dict[str, Any],
) -> None:
    """Add what an axes holds.

    Args:
        over: number of the axes whose place it shares; 0: none. place: its left, lower, right and upper end, as shares
            of the figure. frame: lower left corner and size of all axes, shares of the picture.
    """
    here = {"xaxis": f"x{over or number}", "yaxis": f"y{number}"}
    pointed = any(line.get_gid() for line in axes.lines)
    named = {line: text for line, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    for line in axes.lines:
        traces += [{**trace, **here} for trace in _line(axes, line, named.get(line, ""), pointed)]
    for some in axes.collections:
        drawn = _filled(some, named.get(some, "")) if _between(some) else _collection(some, frame)
        traces += [{**trace, **here} for trace in drawn]
    for patch in axes.patches:
        where = {"xref": here["xaxis"], "yref": f"y{number} domain"}
        layout["shapes"].append(_strip(patch, named.get(patch, "")) | where)
    if not over:
        layout[f"xaxis{number}"] = _axis(axes.get_xlabel(), axes.get_xscale(), axes.get_xlim()) | {
            "domain": place[::2], "anchor": f"y{number}",
        }  # fmt: skip
    layout[f"yaxis{number}"] = _axis(axes.get_ylabel(), axes.get_yscale(), axes.get_ylim()) | (
        {"overlaying": f"y{over}", "side": "right", "anchor": f"x{over}"}
        if over
        else {"domain": place[1::2], "anchor": f"x{number}"}
    )
    layout["showlegend"] |= bool(named)
    legend = axes.get_legend() or next(iter(axes.figure.legends), None)
    if legend is not None and (words := legend.get_title().get_text()):
        layout["legend"]["title"] = {"text": f"{_text(words)}<br>", "font": {"size": 10}, "side": "top"}
    at = {"xref": here["xaxis"], "yref": here["yaxis"], "showarrow": False, "font": {"size": 10}, "yanchor": "bottom"}
    layout["annotations"] += [at | {"text": _text(words), "x": x, "y": y} for words, x, y in _words(axes)]
    if len(axes.figure.axes) > 1 and (title := axes.get_title()):
        above = {"xref": f"{here['xaxis']} domain", "yref": f"{here['yaxis']} domain", "x": 0.5, "y": 1.0}
        layout["annotations"].append(at | above | {"text": _text(title)})


def _words(axes: Axes) -> list[tuple[str, float, float]]:
    """Texts at places of the data; of a logarithmic axis in powers of ten, as plotly has them."""
    out = []
    for text in axes.texts:
        x, y = getattr(text, "xy", text.get_position())
        if text.get_transform() == axes.transData or hasattr(text, "xy"):
            logged = [np.log10(v) if scale == "log" and v > 0 else v
                      for v, scale in ((x, axes.get_xscale()), (y, axes.get_yscale()))]  # fmt: skip
            out.append((text.get_text(), float(logged[0]), float(logged[1])))
    return out


def _axis(label: str, scale: str, limits: tuple[float, float]) -> dict[str, Any]:
    bounds = [float(np.log10(v)) for v in limits] if scale == "log" else list(map(float, limits))
    decades = {"dtick": 1, "minor": {"showgrid": True, "gridcolor": "#eef0f4"}}
    far = scale == "log" and abs(bounds[1] - bounds[0]) > 1.2
    return (decades if far else {}) | {
        "title": {"text": _text(label), "standoff": 8}, "type": scale if scale == "log" else "linear", "range": bounds,
        "showline": True, "linecolor": "#888", "gridcolor": "#dde0e6", "zeroline": False, "ticks": "outside",
        "automargin": True,
    }  # fmt: skip


def _line(axes: Axes, line: Line2D, label: str, pointed: bool) -> list[Trace]:
    """A line, or the points that tell; nothing of one that is not seen."""
    from matplotlib.colors import to_hex

    x, y = np.asarray(line.get_xdata(orig=False), dtype=float), np.asarray(line.get_ydata(orig=False), dtype=float)
    if not line.get_visible() or not len(x):
        return []
    if line.get_transform() != axes.transData:  # in shares of the axes
        places = line.get_transform().transform(np.column_stack([x, y]))
        x, y = axes.transData.inverted().transform(places).T
    colour = to_hex(line.get_color())
    trace: Trace = {"type": "scatter", "x": _numbers(x), "y": _numbers(y), "legendgroup": colour}
    trace |= {"showlegend": bool(label), "name": _text(label), "opacity": line.get_alpha() or 1.0}
    if gid := line.get_gid():
        columns = json.loads(gid)
        rows = ["<br>".join(f"{name}: {values[i]}" for name, values in columns.items()) for i in range(len(x))]
        head = _text(str(line.get_label()).removeprefix("_"))
        return [trace | {
            "mode": "markers", "marker": {"color": colour, "size": 5, "opacity": 0.35}, "text": rows, "name": head,
            "hovertemplate": f"<b>{head}</b><br>%{{text}}<extra></extra>", "showlegend": False,
        }]  # fmt: skip
    style, marker = str(line.get_linestyle()), SYMBOLS.get(str(line.get_marker()))
    dashes = None if style in ("None", "none") else DASHES.get(style, "dash")
    if dashes is None and marker is None:
        return []
    mode = "+".join(word for word, there in (("lines", dashes), ("markers", marker)) if there)
    step = {"hv": "steps-post", "vh": "steps-pre"}
    shape = next((k for k, v in step.items() if v == line.get_drawstyle()), "linear")
    trace |= {"mode": mode, "line": {"color": colour, "width": line.get_linewidth(), "dash": dashes, "shape": shape}}
    if marker:
        inside = to_hex(line.get_markerfacecolor()) if str(line.get_markerfacecolor()) != "none" else "white"
        edge = {"color": colour, "width": 1}
        trace["marker"] = {"symbol": marker, "color": inside, "size": line.get_markersize() * 1.2, "line": edge}
    return [trace | ({"hoverinfo": "skip"} if pointed and dashes else {})]


def _filled(some: Any, label: str) -> list[Trace]:
    """What is between two curves."""
    from matplotlib.colors import to_hex

    x, y = np.asarray(some.get_paths()[0].vertices).T
    shade = {"fill": "toself", "fillcolor": to_hex(some.get_facecolor()[0]), "opacity": some.get_alpha() or 1.0}
    return [{
        "type": "scatter", "mode": "lines", "x": _numbers(x), "y": _numbers(y), "line": {"width": 0}, **shade,
        "hoverinfo": "skip", "showlegend": bool(label), "name": _text(label),
    }]  # fmt: skip


def _strip(patch: Any, label: str) -> dict[str, Any]:
    """What shades a stretch of the abscissa; hatched ones are light."""
    from matplotlib.colors import to_hex

    colour = "#f3f4f7" if patch.get_hatch() else to_hex(patch.get_facecolor())
    legend: dict[str, Any] = {"showlegend": True, "name": _text(label)} if label else {}
    ends = {"x0": float(patch.get_x()), "x1": float(patch.get_x() + patch.get_width()), "y0": 0, "y1": 1}
    look = {"fillcolor": colour, "opacity": patch.get_alpha() or 1.0, "layer": "below"}
    return {"type": "rect", "line": {"width": 0}, **ends, **look, **legend}


def _bar(some: Any, frame: tuple[Array, Array]) -> Trace:
    """The colour bar of a map or of points, where the picture has it."""
    if (bar := some.colorbar) is None:
        return {}
    (x, low), (_, high) = (bar.ax.get_position().get_points() - frame[0]) / frame[1]
    words = bar.ax.get_ylabel() or bar.ax.get_xlabel() or bar.ax.get_title()
    return {
        "title": {"text": _text(words), "side": "right"},
        "x": float(x),
        "xanchor": "left",
        "y": float(low + high) / 2,
        "len": float(high - low),
        "thickness": 12,
    }


def _collection(some: Any, frame: tuple[Array, Array]) -> list[Trace]:
    """Points, lines, or a map over a grid."""
    from matplotlib.collections import PathCollection, QuadMesh
    from matplotlib.colors import LogNorm, to_hex

    values = some.get_array()
    if isinstance(some, QuadMesh):
        x, y = _edges(some) or (np.zeros(0), np.zeros(0))
        z: Array = np.ma.filled(np.ma.asarray(values, dtype=float), np.nan).reshape(len(y) - 1, len(x) - 1)
        logged = isinstance(some.norm, LogNorm)
        bar = _bar(some, frame)
        shown = np.log10(np.where(z > 0, z, np.nan)) if logged else z
        low, high = (np.log10(v) if logged else v for v in some.get_clim())
        ticks = {"tickvals": (at := np.linspace(low, high, 5)).tolist(), "ticktext": [f"{10**v:.3g}" for v in at]}
        return [{
            "type": "heatmap", "x": _numbers(x), "y": _numbers(y), "z": [_numbers(row) for row in shown],
            "text": [[f"{v:.4g}" for v in row] for row in z], "zmin": float(low), "zmax": float(high),
            "colorscale": _shades(some.cmap),
            "hovertemplate": "%{x:.5g}, %{y:.5g}: %{text}<extra></extra>", "showscale": bool(bar),
            "colorbar": bar | (ticks if logged else {}),
        }]  # fmt: skip
    if isinstance(some, PathCollection):
        x, y = np.asarray(some.get_offsets(), dtype=float).T
        colour: Any = to_hex(some.get_facecolor()[0]) if len(some.get_facecolor()) else "#888"
        marker = {"color": colour, "size": float(np.sqrt(np.mean(some.get_sizes())))}
        if values is not None:
            marker |= {"color": _numbers(np.asarray(values, dtype=float)), "colorscale": _shades(some.cmap)}
            bar = _bar(some, frame)
            low, high = map(float, some.get_clim())
            marker |= {"cmin": low, "cmax": high, "showscale": bool(bar), "colorbar": bar}
        return [{"type": "scatter", "mode": "markers", "x": _numbers(x), "y": _numbers(y), "marker": marker,
                 "showlegend": False}]  # fmt: skip
    colours = some.get_colors()
    return [
        {"type": "scatter", "mode": "lines", "x": _numbers(at[:, 0]), "y": _numbers(at[:, 1]), "hoverinfo": "skip",
         "line": {"color": to_hex(colours[i % len(colours)]), "width": 1}, "showlegend": False}
        for i, at in enumerate(some.get_segments())
    ]  # fmt: skip


def _shades(colours: Any) -> list[tuple[float, str]]:
    """A colour map as plotly has it."""
    from matplotlib.colors import to_hex

    return [(share, to_hex(colours(share))) for share in np.linspace(0, 1, 17).tolist()]


def _edges(mesh: Any) -> tuple[Array, Array] | None:
    """Abscissae and ordinates between the cells of a map whose grid is straight; None of another."""
    at = np.asarray(mesh.get_coordinates())
    x, y = at[0, :, 0], at[:, 0, 1]
    straight = np.allclose(at[..., 0], x) and np.allclose(at[..., 1], y[:, None])
    cells = mesh.get_array() is not None and np.size(mesh.get_array()) == (len(x) - 1) * (len(y) - 1)
    return (x, y) if straight and cells else None


def _numbers(values: Array) -> list[float | None]:
    """As JSON has them, to `DIGITS` digits; None of what is no number."""
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in np.asarray(values, dtype=float)]


def _word(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _text(words: str) -> str:
    """Mathematics between dollars as HTML has it."""

    def plain(formula: re.Match[str]) -> str:
        inside = re.sub(r"_(?:\{([^}]*)\}|(\w))", r"<sub>\1\2</sub>", formula[1])
        inside = re.sub(r"\^(?:\{([^}]*)\}|(\w))", r"<sup>\1\2</sup>", inside)
        return re.sub(r"\\math\w+|\\|[{}]", "", inside)

    return re.sub(r"\$([^$]*)\$", plain, words).replace("\n", "<br>")

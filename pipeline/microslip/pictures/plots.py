"""Curves by matplotlib: what all diagrams share, and those of a modal file: compliance, closures."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TypeVar

import numpy as np

from ..data import Array, ContactState, ModalBasis, ModalGroup
from ..files.png import CURVES, beside, with_text
from ..files.store import complete_or_absent
from ..reduced.truncation import Coordinate, coordinates, percent
from ..results.checks import UNCERTAIN
from ..units import METRES, Quantity, rpm_text, to_rpm
from .touch import curves_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure, SubFigure

    from ..modal.closures import ContactCurve

Curve = TypeVar("Curve")
Look = dict[str, Any]
"""How something is drawn, for matplotlib."""

COLOURS = (
    "#0b4f9c", "#c8382c", "#26863c", "#8a4fb5", "#d98410", "#16919c", "#8c564b", "#c2408f", "#5b6270", "#94a112",
)  # fmt: skip
RED, INK, GREY = "#c8382c", "#111111", "#5b6270"
"""Of what is marked, of dark marks, of notes."""

ABOVE: Look = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "frameon": False, "fontsize": 8}
"""A legend above its axes."""
BESIDE: Look = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5), "frameon": False, "fontsize": 8}
"""A legend at their right."""


# figures -----------------------------------------------------------------------------------------


def empty_figure(width: float = 7.0, height: float = 4.6) -> Figure:
    """inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=110, layout="constrained")


def figure_of(draw: Callable[[Figure], object]) -> Figure:
    """What is drawn into a new one."""
    figure = empty_figure()
    draw(figure)
    return figure


def save(draw: Callable[[Figure], object], path: Path) -> Path:
    """What is drawn into a figure, as a PNG that is complete or absent."""
    return save_figure(figure_of(draw), path)


def save_figure(figure: Figure, path: Path) -> Path:
    """As PNG, complete or absent, without a date in it; and as `files.png.BESIDE` has it."""
    with complete_or_absent(path) as temporary:
        write_png(figure, temporary)
    from matplotlib import rc_context

    for place in beside(path):
        kind = place.suffix[1:]
        nameless = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {"Software": None}}
        with complete_or_absent(place) as temporary, rc_context({"svg.hashsalt": "microslip"}):
            figure.savefig(temporary, format=kind, metadata=nameless[kind], dpi=300)
    return path


def write_png(figure: Figure, to: Path | IO[bytes]) -> None:
    """Arranged while it is drawn; `savefig` draws once more before, for formats that are cut to size. Its curves go
    into the file, from where pages take them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure.set_facecolor("white")
    drawn = io.BytesIO()
    FigureCanvasAgg(figure).print_png(drawn, metadata={"Software": None})
    png, curves = drawn.getvalue(), curves_of(figure)
    png = png if curves is None else with_text(png, CURVES, json.dumps(curves, separators=(",", ":")))
    to.write_bytes(png) if isinstance(to, Path) else to.write(png)


def panels(
    figure: Figure, size: tuple[float, float], rows: int = 1, columns: int = 1,
    count: int | None = None, **how: Any,
) -> list[Axes]:  # fmt: skip
    """Plain axes of a figure of a size (inches), row by row, whose curves have `COLOURS` in their
    order; those beyond a count are not seen."""
    figure.set_size_inches(size)
    return plain_panels(figure, rows, columns, count, **how)


def plain_panels(
    figure: Figure | SubFigure, rows: int = 1, columns: int = 1, count: int | None = None, **how: Any
) -> list[Axes]:
    """The same in a figure, or a part of one, as large as it is."""
    every = list(figure.subplots(rows, columns, squeeze=False, **how).ravel())
    for i, axes in enumerate(every):
        plain_axes(axes)
        axes.set_prop_cycle(color=COLOURS)
        axes.set_visible(count is None or i < count)
    return every[:count]


def in_rows(figure: Figure, count: int, columns: int, width: float, height: float) -> list[Axes]:
    """Plain axes, so many of a size (inches) in rows of so many."""
    columns = min(count, columns)
    rows = -(-count // columns)
    return panels(figure, (width * columns, height * rows), rows, columns, count)


def plain_axes(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#dde0e6", linewidth=0.7)
    axes.set_axisbelow(True)


def right_axes(axes: Axes, label: str, **limits: Any) -> Axes:
    """Axes with an ordinate of their own at the right."""
    other = axes.twinx()
    other.set(ylabel=label, **limits)
    other.spines["top"].set_visible(False)
    return other


# curves ------------------------------------------------------------------------------------------


def through(x: Array, y: Array, each: int = 8) -> tuple[Array, Array]:
    """A line through points (x rising, y positive or not a number) that rounds resonances: 1 / y^2, a parabola near one
    is interpolated by cubics that keep its rises and falls, so that none is added."""
    from scipy.interpolate import PchipInterpolator

    fine = np.interp(np.arange(0, len(x) - 1 + 1e-9, 1 / each), np.arange(len(x)), x)
    out = np.interp(fine, x, y)
    known = np.flatnonzero(np.isfinite(y) & (y > 0))
    for run in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        if len(run) > 2 and (np.diff(x[run]) > 0).all():
            inside = (fine >= x[run[0]]) & (fine <= x[run[-1]])
            scale = y[run].max()
            out[inside] = scale / np.sqrt(PchipInterpolator(x[run], (scale / y[run]) ** 2)(fine[inside]))
    return fine, out


LIGHT = 0.35
"""How much of its colour a curve keeps where it is uncertain."""
LIGHTER = f"lighter: uncertain by more than {100 * UNCERTAIN:g} %"
"""For a legend."""


def once(axes: Axes, label: str) -> str:
    """The label, or none where the legend of the axes has it."""
    return "_" if label in axes.get_legend_handles_labels()[1] else label


def lighter(axes: Axes, x: Array, y: Array, unsure: Array, **line: Any) -> None:
    """A curve, lighter where its points (bool, like x) are uncertain; the first one of an axes is told in the
    legend."""
    axes.plot(x, np.where(unsure, np.nan, y), **line)
    if unsure.any():
        light = {"alpha": LIGHT, "label": once(axes, LIGHTER)}
        axes.plot(x, np.where(unsure, y, np.nan), **(line | light))


def swept(
    axes: Axes, x: Array, y: Array, lifts: Array, unsure: Callable[[Array], Array], dashes: str = "-", **line: Any
) -> None:
    """A curve over the frequency that rounds its resonances, dotted where contacts would lift off (bool, like x),
    lighter where it is uncertain (frequencies -> bool)."""
    if lifts.any():
        axes.plot(*through(x, np.where(lifts, y, np.nan)), ls=":", **{**line, "label": None})
        y = np.where(lifts, np.nan, y)
        dashes = dashes if np.isfinite(y).any() else ":"
    fine, drawn = through(x, y)
    lighter(axes, fine, drawn, unsure(fine), ls=dashes, **line)


def widths(count: int) -> list[float]:
    """Widths of curves that may coincide, in the order in which they are drawn: those below are wider, so that all are
    seen. A single one is as wide as the last."""
    return np.linspace(1.6 + min(1.2 * (count - 1), 3.2), 1.6, count).tolist()


def shades(count: int, high: float = 0.85) -> list[tuple[float, ...]]:
    """Colours of a rising parameter, light to dark; a single one is dark."""
    from matplotlib import colormaps

    return [tuple(colormaps["viridis"](x)) for x in np.linspace(0.05, high, max(count, 1))[::-1]]


def in_shades(curves: Mapping[float, Curve]) -> Iterator[tuple[Look, float, Curve]]:
    """Curves by a rising number: how each is drawn, the number, and the curve."""
    looks = zip(widths(len(curves)), shades(len(curves)), sorted(curves.items()), strict=True)
    return (({"linewidth": width, "color": colour}, *each) for width, colour, each in looks)


def mark_missing(axes: Axes, x: Array, colour: Any, row: int = 0) -> None:
    """Crosses at the lower edge where a curve has no point that converged, those of each curve in a row of its own; the
    first ones of an axes are told in the legend."""
    if len(x):
        height = np.full(len(x), 0.015 + 0.02 * row)
        how: Look = {"ms": 5, "mew": 1.3, "clip_on": False, "zorder": 5}
        label, foot = once(axes, "did not converge"), axes.get_xaxis_transform()
        axes.plot(x, height, "x", color=colour, transform=foot, label=label, **how)


def in_unit(of: Quantity, *values: Array) -> tuple[list[Array], str]:
    """Values in the unit in which the largest of them all is neither long nor a power of ten."""
    factor, unit = of.scale(max(float(np.nanmax(np.abs(v), initial=0.0)) for v in values))
    return [factor * v for v in values], unit


# words -------------------------------------------------------------------------------------------


def legend_below(figure: Figure, columns: int = 4, *what: Any, **how: Any) -> None:
    figure.legend(*what, loc="outside lower center", ncols=columns, **{"fontsize": 9, **how})


def by_rows(handles: list[Any], labels: list[str], columns: int) -> tuple[list[Any], list[str]]:
    """A legend, which is filled by columns, in the order in which its rows are read."""
    order = [i for column in range(columns) for i in range(column, len(labels), columns)]
    return [handles[i] for i in order], [labels[i] for i in order]


def said_beside(axes: Axes, text: str, at: tuple[float, float], shift: tuple[float, float], **how: Any) -> None:
    """Words beside a place of a diagram, so many points to the right and above it."""
    axes.annotate(text, at, xytext=shift, textcoords="offset points", **how)


def note_below(axes: Axes, text: str, below: float, **how: Any) -> None:
    """Small grey words in the middle under a diagram, at a share of its height."""
    axes.text(0.5, below, text, transform=axes.transAxes, ha="center", va="top", fontsize=8, color=GREY, **how)


def whole_numbers(axes: Axes) -> None:
    """Along the abscissa."""
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def plain_numbers(axis: Axis, within: tuple[float, ...]) -> None:
    """Numbers without powers of ten on a logarithmic axis, at these multiples of every power."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=within))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def numbers_within(axis: Axis) -> None:
    """The same, more of them where the axis spans less than a decade or two."""
    low, high = axis.get_view_interval()
    span = np.log10(high / low)
    plain_numbers(axis, (1.0,) if span > 2.5 else (1.0, 2.0, 5.0) if span > 0.8 else tuple(np.arange(1.0, 10.0)))


# closures ----------------------------------------------------------------------------------------


def closure_curve_plot(curve: ContactCurve, title: str, figure: Figure) -> None:
    """Normal force of a closure over the approach of its faces, and its slope, the stiffness of the contact."""
    scale, unit = METRES.scale(float(np.abs(curve.approach).max()))
    ordinates = (
        (curve.force, "normal force in N"),
        (curve.stiffness, "stiffness in N/m"),
        (100 * curve.closed_share, "share of the face in contact in %"),
    )
    for axes, (y, name) in zip(panels(figure, (10.5, 3.9), 1, 3), ordinates, strict=True):
        axes.plot(scale * curve.approach, y, "-o", linewidth=1.6, markersize=4)
        top = 1.08 * max(float(y.max()), 1e-300)
        axes.set(xlabel=f"approach of the faces in {unit}", ylabel=name, ylim=(0, top))
        axes.ticklabel_format(axis="y", scilimits=(-3, 5), useMathText=True)
    figure.suptitle(title, fontweight="bold")


MOST_CLOSURES, CURVES_BESIDE = 12, 3
"""Closures whose pressure is drawn, and up to how many stand one below the other with a force curve each."""

States = Mapping[float, Mapping[str, ContactState]]


def closure_plot(basis: ModalBasis, figure: Figure) -> None:
    """Pressure on every face that touches at the highest speed, and its normal force over the
    speeds; nothing where none is pressed."""
    contacts = {g.speed: g.contacts for g in basis.groups.values() if g.contacts}
    if not any(c.normal_force for faces in contacts.values() for c in faces.values()):
        return
    states = dict(sorted(contacts.items()))
    names = list(states[max(states)])
    draw = _closures_beside if len(names) <= CURVES_BESIDE else _closures_tiled
    draw(figure, states, names[:MOST_CLOSURES])
    more = f" (first {MOST_CLOSURES} of {len(names)})" if len(names) > MOST_CLOSURES else ""
    figure.suptitle(f"{basis.name}: contact at {rpm_text(max(states))}{more}", fontweight="bold")


def _closures_beside(figure: Figure, states: States, names: Sequence[str]) -> None:
    """A row for each closure: its pressure, and its force over the speeds."""
    several, last = len(states) > 1, states[max(states)]
    high = 0.4 + sum(_height(last[name], 5.2 if several else 8.6) for name in names)
    figure.set_size_inches(9.6, high)
    ratios = [3, 2] if several else [1]
    table = figure.subplots(len(names), len(ratios), squeeze=False, width_ratios=ratios)
    for row, name in zip(table, names, strict=True):
        _pressure_map(row[0], name, last[name])
        if several:
            _force_curves(row[1], states, [name])


def _closures_tiled(figure: Figure, states: States, names: Sequence[str], columns: int = 4) -> None:
    """Pressures beside each other, and all forces in one diagram below."""
    rows, several = math.ceil(len(names) / columns), len(states) > 1
    last = states[max(states)]
    high = [max(_height(last[name], 2.6) for name in names)] * rows + [3.0] * several
    figure.set_size_inches(3.4 * columns, 0.4 + sum(high))
    grid = figure.add_gridspec(rows + several, columns, height_ratios=high)
    for i, name in enumerate(names):
        _pressure_map(figure.add_subplot(grid[i // columns, i % columns]), name, last[name])
    if several:
        axes = figure.add_subplot(grid[rows, :])
        _force_curves(axes, states, names)
        axes.legend(fontsize=8, ncols=2, loc="upper left")


def _force_curves(axes: Axes, states: States, names: Sequence[str]) -> None:
    """Normal forces over the speeds that were solved for."""
    plain_axes(axes)
    rpm = [to_rpm(speed) for speed in states]
    for i, name in enumerate(names):
        force = [contacts[name].normal_force for contacts in states.values()]
        axes.plot(rpm, force, "o-", color=COLOURS[i % len(COLOURS)], label=name)
    axes.set(xlabel="rotation speed in rpm", ylabel="normal force in N", ylim=(0, None))


def _on_face(c: ContactState) -> tuple[Array, Array]:
    """Coordinates of a face's points along its two long directions, mm."""
    middle = c.points - c.points.mean(axis=0)
    x, y = 1e3 * (middle @ np.linalg.svd(middle, full_matrices=False)[2][:2].T).T
    return x, y


def _height(c: ContactState, width: float) -> float:
    """Inches that the map of a face needs, drawn so wide, with its title and colour bar."""
    x, y = _on_face(c)
    return 1.75 + width * min(float(np.ptp(y)) / max(float(np.ptp(x)), 1e-9), 0.6)


def _pressure_map(axes: Axes, name: str, c: ContactState) -> None:
    """The face seen along its normal: points sized by their area, coloured by the pressure."""
    x, y = _on_face(c)
    order = np.argsort(c.pressure, kind="stable")
    box = max(float(np.ptp(x)), float(np.ptp(y)), 1e-9)
    size = np.clip(c.areas * 1e6 / box**2 * 4e4, 6, 200)
    shown = axes.scatter(
        x[order], y[order], s=size[order], c=1e-6 * c.pressure[order], cmap="YlOrRd", vmin=0, edgecolors="#8a929c",
        linewidths=0.4,
    )  # fmt: skip
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.set(xlabel="mm along the face", ylabel="mm")
    axes.set_title(f"{name}: {c.normal_force:.4g} N\non {percent(c.closed_share)} of the face", fontsize=10)
    axes.figure.colorbar(shown, ax=axes, label="pressure in MPa", location="bottom", shrink=0.6)


# compliance --------------------------------------------------------------------------------------

_STYLE = {
    "u_n": ("#c8382c", "-"), "u_t1": ("#26863c", "-"), "u_t2": ("#0b4f9c", "-"),
    "phi_n": ("#c8382c", ":"), "phi_t1": ("#26863c", ":"), "phi_t2": ("#0b4f9c", ":"), "squeezed": ("#111111", "-"),
}  # fmt: skip


def compliance_plot(basis: ModalBasis, group: ModalGroup, figure: Figure, most: int = 12) -> None:
    """Share of the static compliance over the number of modes, one panel an interface; nothing
    without rows."""
    others = {"squeeze": "pressed from both sides", "excitation": "excitations", "monitor": "monitors"}
    found: dict[str, list[Coordinate]] = {}
    for c in coordinates(group):
        found.setdefault(others.get(c.kind, c.label.rsplit(" ", 1)[0]), []).append(c)
    if not found:
        return
    count = min(len(found), most)
    columns = min(count, 3)
    rows = math.ceil(count / columns)
    size = max(4.8 * columns, 6.0), 0.9 + 2.9 * rows  # the legends stand beside the panels
    table = panels(figure, size, rows, columns, count, sharex=True, sharey=True)
    for axes, (name, own) in zip(table, found.items(), strict=False):
        _compliance_panel(axes, name, own, group.n_modes)
    figure.supxlabel("number of modes kept")
    figure.supylabel("share of the static compliance in %")
    more = f" (first {most} of {len(found)} panels)" if len(found) > most else ""
    figure.suptitle(f"{basis.name}: how much of the static compliance the modes hold{more}", fontweight="bold")


def _compliance_panel(axes: Axes, name: str, found: Sequence[Coordinate], count: int) -> None:
    axes.axhline(100, color=GREY, linewidth=0.8)
    kept = np.arange(count + 2)
    for i, c in enumerate(found):
        short = c.label.rsplit(" ", 1)[-1] if c.kind != "excitation" else c.label.rsplit(" ", 1)[0]
        short = c.label if c.kind == "monitor" else short
        colour, line = _STYLE.get(short, (COLOURS[i % len(COLOURS)], "-"))
        label = f"{c.label.removesuffix(' squeezed') if c.kind == 'squeeze' else short}  {percent(c.share)}"
        share = 100 * np.concatenate([[0.0], c.shares, [c.share]])
        axes.step(kept, share, line, where="post", color=colour, label=label, linewidth=1.6)
    axes.set_title(name, fontsize=10)
    axes.set(xlim=(0, count + 0.6), ylim=(-3, 106))
    whole_numbers(axes)
    axes.legend(**BESIDE | {"fontsize": 7, "loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}, handlelength=1.4)

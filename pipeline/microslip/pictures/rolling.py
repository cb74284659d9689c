"""Rolling contact: the creep curve, tractions over the patch, and where the wheel touches."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array
from ..exchange import vtu
from ..rolling.strips import Tractions
from ..rolling.study import RollingAnswer
from ..rolling.wearing import ProfileWear
from .plots import COLOURS, legend_below, panels, plain_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

LABELS = {"longitudinal": "longitudinal creepage", "lateral": "lateral creepage", "spin": "spin in 1/m"}


def curve_picture(found: RollingAnswer, figure: Figure, title: str) -> None:
    """Creep forces over the friction that is held; the published FASTSIM and exact half-spaces at some points."""
    assert found.forces is not None
    (axes,) = panels(figure, (8.0, 4.8))
    x, f, friction = found.over, found.forces, found.held
    drawn = {"F_x": f.x, "F_y": f.y, "|F|": np.hypot(f.x, f.y)}
    for i, (name, values) in enumerate(drawn.items()):
        if np.abs(values).max() > 1e-6 * friction:
            axes.plot(x, values / friction, color=COLOURS[i], label=f"${name}/\\mu F_N$")
    hollow: dict[str, Any] = {"fillstyle": "none"}
    if found.reference is not None:
        at, of = found.reference
        axes.plot(x[at], of, "o", markersize=4, color="0.35", label="|F| by FASTSIM, 44 x 44", **hollow)
    if found.exact is not None:
        at, each = found.exact.at, np.hypot(found.exact.x, found.exact.y) / friction
        axes.plot(x[at], each, "D", markersize=6, color="black", label="|F| of exact half-spaces", **hollow)
    axes.axvline(x[found.shown], color="0.6", linestyle=":", linewidth=1.0)
    axes.set(xlabel=LABELS[found.case.creep.over], ylabel="force on the wheel", title=title)
    legend_below(figure)


def traction_picture(found: RollingAnswer, figure: Figure, title: str) -> None:
    """Tractions over the patch, and along its middle strip."""
    assert found.tractions is not None
    t, mu = found.tractions, found.highest
    figure.set_size_inches(9.6, 4.6)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.15])
    plain_axes(right)
    image = _cells(left, t, np.hypot(t.traction_x, t.traction_y) / 1e6)
    pick = tuple(slice(step // 2, None, step) for step in (max(1, n // 10) for n in t.x.shape))
    left.quiver(1e3 * t.x[pick], 1e3 * t.y[pick], t.traction_x[pick], t.traction_y[pick], color="white", width=0.004)
    spans = np.ptp(_corners(t), axis=(0, 1))
    stretch = stretched(spans)
    words = "traction in MPa" if stretch == 1.0 else "traction in MPa\nx and y to scales of their own"
    left.set(xlabel="x in mm, rolling to the right", ylabel="y in mm", title=words)
    left.set_aspect(stretch)
    flat = stretch * spans[1] < 0.5 * spans[0]  # no higher than its colour bar is long
    figure.colorbar(image, ax=left, shrink=0.85, location="bottom" if flat else "right")
    row = t.x.shape[0] // 2
    x, limit = 1e3 * t.x[row], mu * t.pressure[row] / 1e6
    bound = "$\\pm\\mu p$" if found.case.is_constant else "$\\pm\\mu p$, highest $\\mu$"
    right.fill_between(x, -limit, limit, color="0.9", label=bound)
    for i, (name, values) in enumerate((("x", t.traction_x), ("y", t.traction_y))):
        right.plot(x, values[row] / 1e6, color=COLOURS[i], label=f"traction along {name}")
    right.set(xlabel="x in mm", ylabel="MPa", title=f"along the strip y = {1e3 * t.y[row, 0]:.3g} mm")
    figure.legend(fontsize=9, loc="outside lower right", ncols=3)
    over = LABELS[found.case.creep.over].split(" in ")[0]
    figure.suptitle(f"{title}: {over} {found.over[found.shown]:.4g}")


NARROW = 1 / 3
"""Width over length of a drawn patch at least, with room for the numbers of both axes; those of a flange are 1 / 17."""


def stretched(size: Array) -> float:
    """How many times as wide the second axis is drawn as the first, for patches (2,) m long and wide that are narrower
    one way than `NARROW`."""
    slender = float(size[1] / size[0])
    return NARROW / slender if slender < NARROW else min(1 / (NARROW * slender), 1.0)


def wearing_picture(worn: ProfileWear, figure: Figure, title: str) -> None:
    """What is worn off both profiles, and the largest pressure over the passages."""
    left, right = panels(figure, (9.6, 4.2), 1, 2)
    bodies = {"wheel": worn.wheel, "rail": worn.rail}
    for name, body in bodies.items():
        left.plot(1e3 * body.y, 1e6 * body.depth, label=name)
    touched = [1e3 * body.y[body.depth > 0] for body in bodies.values()]
    ends = min(y.min() for y in touched) - 3, max(y.max() for y in touched) + 3
    left.set(xlim=ends, xlabel="y of the profile in mm", ylabel="worn off in µm")
    left.invert_yaxis()
    left.legend(fontsize=9)
    over = worn.columns()
    right.plot(over["passages"], over["largest_pressure_Pa"] / 1e6, ".-", color=COLOURS[2])
    right.set(xlabel="passages", ylabel="largest pressure in MPa")
    figure.suptitle(f"{title}: profiles that wear")


def write_tractions_vtu(t: Tractions, path: Path) -> None:
    """Elements of a patch as a VTU file, z = 0. Cell data: ``pressure``, ``traction`` (3,) on the wheel, Pa; ``slip``
    (3,) of the wheel over the speed; ``area`` m2.

    Raises:
        UserError: no permission, no space.
    """
    import meshio

    corners = _corners(t)
    points = np.append(corners.reshape(-1, 2), np.zeros((corners.size // 2, 1)), axis=1)
    flat = np.zeros(t.traction_x.size)
    vectors = {"traction": (t.traction_x, t.traction_y), "slip": (t.slip_x, t.slip_y)}
    data = {name: np.stack([*(v.ravel() for v in each), flat], axis=1) for name, each in vectors.items()}
    data |= {"pressure": t.pressure.ravel(), "area": np.broadcast_to(t.area, t.x.shape).ravel()}
    quads = np.arange(len(points)).reshape(-1, 4)
    vtu.save(meshio.Mesh(points, {"quad": quads}, cell_data={k: [vtu.single(v)] for k, v in data.items()}), path)


def _corners(t: Tractions) -> Array:
    """(elements, 4, 2) of their rectangles, m."""
    half = 0.5 * np.abs(np.diff(t.x, axis=1)).mean(axis=1, keepdims=True)
    tall = 0.5 * t.area / (2 * half)
    corners = [(t.x + i * half, t.y + j * tall) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return np.stack([np.stack(c, axis=-1) for c in corners], axis=-2).reshape(-1, 4, 2)


def _cells(axes: Axes, t: Tractions, values: Array) -> PolyCollection:
    """A rectangle for each element, coloured."""
    from matplotlib.collections import PolyCollection

    drawn = PolyCollection(list(1e3 * _corners(t)), array=values.ravel(), cmap="viridis")
    axes.add_collection(drawn)
    axes.autoscale_view()
    axes.grid(False)
    return drawn

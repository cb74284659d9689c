"""A tyre whose slip jumps: the wheel, its patch, a jump with the exponential that fits it, time constants over the
slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..data import Array, ModalBasis
from ..mesh import boundary_facets
from ..rolling.tyre import TyreAnswer, jump
from .plots import COLOURS, Look, plain_panels
from .scene import element_sides

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

TO_ITS_SIDE = 1e-6
"""Of the wheel's size: points that near to its outermost plane are of its side."""


def tyre_picture(found: TyreAnswer, figure: Figure, title: str, wheel: ModalBasis | None = None) -> None:
    """Four panels, and beside them the wheel of a modal file as it stands, whole and near its patch."""
    figure.set_size_inches(9.6 if wheel is None else 13.6, 6.4)
    rest: Figure | SubFigure = figure
    if wheel is not None:
        left, rest = np.ravel(np.asarray(figure.subfigures(1, 2, width_ratios=(4.2, 9.4))))
        _standing(left, found, wheel)
    patch, steady, jumps, constants = plain_panels(rest, 2, 2)
    r, b = found.row, found.brush
    xi = np.linspace(-1, 1, 201)
    ellipse = 1e-3 * r.highest * np.sqrt(1 - xi**2)
    patch.plot(1e3 * r.x, 1e-3 * r.pressure, ".", color="0.6", label="points of the mesh")
    patch.plot(1e3 * (r.middle + 0.5 * r.length * xi), ellipse, color=COLOURS[0], label="of the row")
    patch.legend(fontsize=8)
    half = 0.7e3 * r.length
    patch.set(xlabel="x in mm, rolling to the right", ylabel="kPa", xlim=(-half, half), title="pressure of the patch")
    slips, forces = found.steady
    steady.plot(100 * slips, forces)
    steady.set(xlabel="slip in %", ylabel="force over normal force", ylim=(0, None), title="steady rolling")
    shown, c = found.case.jumps.shown, found.constants
    row, seen = int(np.flatnonzero(c["slip"] == shown)[0]), slice(int(np.ceil(4.0 * len(b.share))) + 1)
    ways = (("up", 0.0, shown, "from 0"), ("down", shown, 0.0, "back to 0"))
    for colour, (way, first, last, name) in zip(COLOURS, ways, strict=False):
        fitted, line = c[f"{way}_fitted_s"], Look(color=colour)
        time, force = (values[seen] for values in jump(b, first, last, r.force))
        constant, end = fitted[row], force[-1]
        jumps.plot(time, force / r.force, label=f"slip {100 * first:g} to {100 * last:g} %", **line)
        fit = end + (force[0] - end) * np.exp(-time / constant)
        jumps.plot(time, fit / r.force, ":", label=f"exponential of {constant:.3g} s", **line)
        constants.plot(100 * c["slip"], fitted, "o-", markersize=3, label=name, **line)
        constants.plot(100 * c["slip"], c[f"rigid_{way}_fitted_s"], "--", label=f"{name}, rigid wheel", **line)
    jumps.set(xlabel="time in s", ylabel="force over normal force", title="a jump and back")
    jumps.legend(fontsize=8)
    constants.set(xlabel="slip in %", ylabel="time constant in s", title="time constants")
    constants.set_ylim(0, 1.5 * max(np.nanmax(c[f"{way}_fitted_s"]) for way in ("up", "down")))  # room for four names
    constants.legend(fontsize=8, loc="upper right", ncols=2)
    figure.suptitle(title)


def _standing(figure: SubFigure, found: TyreAnswer, wheel: ModalBasis) -> None:
    """Mesh of the wheel's side at rest and deformed, in its true size."""
    from matplotlib.collections import LineCollection

    t, group, points = found.case.tyre, wheel.groups[0, 0], wheel.mesh.points
    down, axle, along = group.interfaces[t.interface].rotation
    sides = _side(wheel, axle)
    flat = np.column_stack([points @ along, -points @ down]) * 1e3
    moved = flat + np.column_stack([group.u_static @ along, -group.u_static @ down]) * 1e3
    size = 1e3 * np.linalg.norm(group.u_static, axis=1)[sides].mean(axis=1)
    whole, near = plain_panels(figure, 2, height_ratios=(1.5, 1))
    for axes in (whole, near):
        axes.set_aspect("equal")
        axes.add_collection(LineCollection(list(flat[sides]), colors="0.75", linewidths=0.6))
        drawn = LineCollection(list(moved[sides]), array=size, cmap="viridis", linewidths=0.9)
        axes.add_collection(drawn)
        axes.axhline(moved[:, 1].min(), color="0.2", linewidth=1.2)
        axes.set(xlabel="x in mm, rolling to the right", ylabel="mm")
    reach = 1.05 * np.abs(flat).max()
    half, low = 1.3e3 * found.row.length, moved[:, 1].min()
    whole.set(xlim=(-reach, reach), ylim=(-reach, reach), title="mesh at rest (grey) and as it stands")
    near.set(xlim=(-half, half), ylim=(low - 0.3 * half, low + 0.9 * half), title="near the patch, in true size")
    figure.colorbar(drawn, ax=[whole, near], shrink=0.6, location="bottom", label="displacement in mm")


def _side(wheel: ModalBasis, axle: Array) -> Array:
    """(k, 2) points of the element sides that lie outermost along the axle."""
    at = wheel.mesh.points @ axle
    lies = at > at.max() - TO_ITS_SIDE * np.ptp(at)
    pairs = [element_sides(kind, nodes) for kind, nodes in boundary_facets(wheel.mesh).items()]
    every = np.unique(np.concatenate(pairs), axis=0)
    return every[lies[every].all(axis=1)]

"""A tyre whose slip jumps: its patch, a jump with the exponential that fits it, time constants over the slip."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..rolling.brush import jump
from ..rolling.slip import Studied
from .plots import COLOURS, empty_figure, plain_axes, save_figure


def tyre_picture(found: Studied, path: Path, title: str) -> Path:
    """Four panels."""
    figure = empty_figure(9.6, 6.4)
    (patch, steady), (one, constants) = figure.subplots(2, 2)
    for axes in (patch, steady, one, constants):
        plain_axes(axes)
    r, b = found.row, found.brush
    patch.plot(1e3 * r.x, 1e-3 * r.pressure, ".", color="0.6", label="points of the mesh")
    xi = np.linspace(-1, 1, 201)
    ellipse = 1e-3 * r.highest * np.sqrt(1 - xi**2)
    patch.plot(1e3 * (r.middle + 0.5 * r.length * xi), ellipse, color=COLOURS[0], label="of the row")
    patch.legend(fontsize=8)
    half = 0.7e3 * r.length
    patch.set(xlabel="x in mm, rolling to the right", ylabel="kPa", xlim=(-half, half), title="pressure of the patch")
    slips, forces = found.steady
    steady.plot(100 * slips, forces, color=COLOURS[0])
    steady.set(xlabel="slip in %", ylabel="force over normal force", ylim=(0, None), title="steady rolling")
    shown, c = found.case.jumps.shown, found.constants
    row, seen = int(np.flatnonzero(c["slip"] == shown)[0]), slice(int(np.ceil(4.0 * len(b.share))) + 1)
    for i, (way, first, last) in enumerate((("up", 0.0, shown), ("down", shown, 0.0))):
        time, force = jump(b, first, last, r.force)
        constant = c[f"{way}_fitted_s"][row]
        time, force, end = time[seen], force[seen], force[-1]
        one.plot(time, force / r.force, color=COLOURS[i], label=f"slip {100 * first:g} to {100 * last:g} %")
        fit = end + (force[0] - end) * np.exp(-time / constant)
        one.plot(time, fit / r.force, ":", color=COLOURS[i], label=f"exponential of {constant:.3g} s")
    one.set(xlabel="time in s", ylabel="force over normal force", title="a jump and back")
    one.legend(fontsize=8)
    for i, (way, name) in enumerate((("up", "from 0"), ("down", "back to 0"))):
        constants.plot(100 * c["slip"], c[f"{way}_fitted_s"], "o-", markersize=3, color=COLOURS[i], label=name)
        constants.plot(
            100 * c["slip"], c[f"rigid_{way}_fitted_s"], "--", color=COLOURS[i], label=f"{name}, rigid wheel"
        )
    constants.set(xlabel="slip in %", ylabel="time constant in s", title="time constants")
    constants.set_ylim(0, 1.5 * max(np.nanmax(c[f"{way}_fitted_s"]) for way in ("up", "down")))  # room for four names
    constants.legend(fontsize=8, loc="upper right", ncols=2)
    figure.suptitle(title)
    return save_figure(figure, path)

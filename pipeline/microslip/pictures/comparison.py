"""Two bodies beside each other: the MAC of all modes as a table in colours, and every pair of modes side by side.

A body with a mesh is drawn by its skin, a measured one by its points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, ModalBasis, ModalGroup
from ..modal.sampling import is_solid
from ..reduced.coordinates import in_modes
from ..reduced.correlation import Comparison, Pair, measured_directions, nearest_points
from .lettering import INK, captioned, save_png, scaled, sheet, side_by_side
from .plots import save
from .scene import OUTLINE, Camera, Stage, fit, surface, view_axes
from .views import AMPLITUDE, Studio, hertz, mode_pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .lettering import Picture

Both = tuple[ModalBasis, ModalBasis]

MOST_PAIRS = 12
"""Pairs on the sheet."""

AREA = 60_000
"""Pixels of one picture."""


def mac_plot(found: Comparison, names: tuple[str, str], figure: Figure) -> None:
    """The MAC of every mode with every other; pairs have a frame and their number."""
    rows, columns = found.mac.shape
    figure.set_size_inches(1.8 + 0.42 * min(max(columns, 6), 30), 1.6 + 0.36 * min(max(rows, 6), 30))
    axes = figure.add_subplot()
    drawn = axes.imshow(found.mac, cmap="Blues", vmin=0, vmax=1, origin="lower", aspect="auto")
    for p in found.pairs:
        colour = "white" if p.mac > 0.6 else "#111111"
        axes.text(p.second, p.first, f"{100 * p.mac:.0f}", ha="center", va="center", color=colour, fontsize=7)
    frequencies = found.first_frequency, found.second_frequency
    for axis, name, frequency in zip((axes.yaxis, axes.xaxis), names, frequencies, strict=True):
        every = max(1, -(-len(frequency) // 30))
        axis.set_ticks(range(0, len(frequency), every))
        axis.set_ticklabels([f"{j + 1}: {hertz(frequency[j])}" for j in range(0, len(frequency), every)], fontsize=7)
        axis.set_label_text(name)
    axes.tick_params(axis="x", rotation=90)
    figure.colorbar(drawn, label="MAC; numbers: pairs, per cent", fraction=0.05)


@dataclass(frozen=True)
class ContactFace:
    """One of the two bodies: its group in its own modes, where it is measured, and what it is drawn from."""

    basis: ModalBasis
    group: ModalGroup
    solid: bool


def pair_sheet(bodies: Both, seen: Both, found: Comparison, key: tuple[int, int] = (0, 0)) -> Picture | None:
    """Pairs of modes, the first body at the left, the second with the sign (or phase) of the first at the right.

    None if no modes are paired.

    Args:
        bodies: what is drawn. seen: the bodies as they were compared, with points in common.
    """
    if not found.pairs:
        return None
    first, second = bodies
    sides = [ContactFace(b, in_modes(b.groups[key]), is_solid(b)) for b in bodies]
    signs = _factors([in_modes(b.groups[key]) for b in seen], seen, found)
    stage = Stage()
    try:
        axes = view_axes(next((s for s in sides if s.solid), sides[0]).basis.inertia)
        tiles = [_pair(stage, sides, p, signs[i], axes) for i, p in enumerate(found.pairs[:MOST_PAIRS])]
    finally:
        stage.close()
    left = f" {len(found.pairs) - MOST_PAIRS} pairs more are not drawn." if len(found.pairs) > MOST_PAIRS else ""
    note = f"Left {first.name}, right {second.name}, amplified; grey: at rest.{left}"
    return sheet(tiles, f"{first.name} and {second.name}: {len(found.pairs)} pairs of modes", note)


def _factors(groups: Sequence[ModalGroup], seen: Both, found: Comparison) -> list[tuple[Any, Any]]:
    """Of each pair a factor for both shapes, of size 1: the first stands, the second moves with it."""
    at = _common(*seen, found)
    known = np.ones((len(at[0]), 3), dtype=bool)
    for basis, group, points in zip(seen, groups, at, strict=True):
        known &= measured_directions(basis, group)[points]
    a, b = (g.phi[points][known] for g, points in zip(groups, at, strict=True))
    return [_turned(a[:, p.first], b[:, p.second]) for p in found.pairs]


def _turned(a: Array, b: Array) -> tuple[Any, Any]:
    """Factors of size 1 that turn the largest component of a real (and positive) and b into a's phase."""
    turn = np.conj(a[np.abs(a).argmax()])
    turn = turn / max(abs(turn), 1e-300)
    product = np.vdot(b, a * turn)
    return turn, product / max(abs(product), 1e-300)


def _common(first: ModalBasis, second: ModalBasis, found: Comparison) -> tuple[Array, Array]:
    """Numbers of the points of both that lie on each other."""
    swapped = first.mesh.n_points > second.mesh.n_points
    few, many = (second, first) if swapped else (first, second)
    limit = float(found.distance.max(initial=0.0)) * (1 + 1e-9) + 1e-300
    at, _ = nearest_points(few.mesh.points, many.mesh.points, limit)
    own = np.arange(few.mesh.n_points)
    return (at, own) if swapped else (own, at)


def _pair(stage: Stage, sides: Sequence[ContactFace], p: Pair, factors: tuple[Any, Any], axes: Array) -> Picture:
    """Both shapes of a pair under their frequencies."""
    images = []
    for s, factor, j, f in zip(sides, factors, (p.first, p.second), p.frequency, strict=True):
        drawn = _draw(stage, s, np.real(s.group.phi[:, :, j] * factor), axes)
        images.append(captioned(drawn, f"{j + 1}: {hertz(f)}", size=15))
    size = max(i.height for i in images)
    images = [scaled(i, min(1.0, size / i.height)) for i in images]
    change = "rigid" if not p.frequency[0] > 0 else f"{100 * p.deviation:+.2f} %"
    return captioned(side_by_side(images), f"MAC {p.mac:.3f}, {change}", size=15)


def _draw(stage: Stage, side: ContactFace, shape: Array, axes: Array) -> Picture:
    """One shape of one body, not captioned."""
    basis = side.basis
    extent = float(np.ptp(basis.mesh.points, axis=0).max())
    swing = AMPLITUDE * extent
    box = np.array([basis.mesh.points.min(axis=0) - swing, basis.mesh.points.max(axis=0) + swing])
    corners = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    camera = fit(corners, axes, AREA)
    if side.solid:
        studio = Studio(basis, surface(basis.mesh), stage, axes, extent)
        group = replace(side.group, phi=shape[:, :, None], kind=("normal",))
        return next(iter(mode_pictures(studio, group, 1, camera)))
    return _points(stage, basis.mesh.points, swing * shape / max(np.linalg.norm(shape, axis=1).max(), 1e-300), camera)


def _points(stage: Stage, points: Array, moved: Array, camera: Camera) -> Picture:
    """Points at rest and moved, joined by lines."""
    stage.clear()
    n = len(points)
    both = np.vstack([points, points + moved])
    stage.lines(both, np.column_stack([np.arange(n), n + np.arange(n)]), OUTLINE, 1.5)
    stage.dots(points, (176, 180, 190), 4)
    stage.dots(points + moved, INK, 6)
    return stage.shoot(camera)


def draw_comparison(
    bodies: Both, seen: Both, found: Comparison, key: tuple[int, int], folder: Path, scenes: bool = True
) -> dict[str, Path]:
    """Write ``mac.png`` and, where PyVista can draw, ``pairs.png``. Name -> file. Arguments: see `pair_sheet`."""
    from . import quiet_vtk

    folder.mkdir(parents=True, exist_ok=True)
    names = bodies[0].name, bodies[1].name
    drawn = {"mac": save(partial(mac_plot, found, names), folder / "mac.png")}
    if scenes:
        quiet_vtk()
        image = pair_sheet(bodies, seen, found, key)
        if image is not None:
            drawn["pairs"] = save_png(image, folder / "pairs.png")
    return drawn

"""A CAD file from two sides with the number of every surface on it, to choose faces from."""

from __future__ import annotations

import colorsys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..data import Array, Indices
from .lettering import INK, captioned, font, pen, save_png, side_by_side
from .scene import Camera, Stage, axes_towards, fit, quiet_vtk, view_axes
from .views import _measured

if TYPE_CHECKING:
    from .lettering import Picture

AREA = 620_000
"""Pixels of one view."""

LEAST_PIXELS = 40
"""A surface of which less is seen gets no number in that view."""


def surfaces_picture(points: Array, triangles: Indices, surface: Indices, title: str, path: Path) -> Path:
    """Write the picture.

    Args:
        points: (n, 3) m. triangles: (t, 3). surface: (t,) number of the CAD surface of each triangle.
    """
    quiet_vtk()
    stage = Stage()
    spread = np.cov((points - points.mean(axis=0)).T) + 1e-30 * np.eye(3)
    axes = view_axes(np.trace(spread) * np.eye(3) - spread)
    used, names = np.zeros(0, dtype=int), np.unique(surface)
    views = []
    try:
        for side in (axes, axes_towards(-axes[2])):
            image, shown = _view(stage, fit(points, side, AREA), points, triangles, surface)
            views.append(image)
            used = np.union1d(used, shown)
    finally:
        stage.close()
    hidden = [str(v) for v in np.setdiff1d(names, used)]
    more = f" Hidden here, or too small for a number: {', '.join(hidden)}." if hidden else ""
    note = (
        "The numbers are those of the table and of geometry.faces.surfaces. Seen from two opposite sides. "
        f"Teeth along an edge are the triangles' of this picture, not the file's.{more}"
    )
    return save_png(captioned(side_by_side(views), title, note, 22), path)


def _view(
    stage: Stage, camera: Camera, points: Array, triangles: Indices, surface: Indices
) -> tuple[Picture, list[int]]:
    """One view, and the surfaces that got a number in it."""
    names, which = np.unique(surface, return_inverse=True)
    flat = _split(triangles, which, len(points))
    soft = np.array([_soft(i) for i in range(len(names))], dtype=np.uint8)
    stage.clear()
    stage.skin(points[flat[0]], flat[1], scalars=soft[which], rgb=True)
    image = stage.shoot(camera)
    code = np.arange(1, len(names) + 1) * 0x9E3779 % 2**24  # far apart: no edge between two looks like a third
    codes = np.column_stack([code >> 8 * k & 255 for k in range(3)]).astype(np.uint8)
    stage.clear()
    stage.skin(points[flat[0]], flat[1], scalars=codes[which], rgb=True, lighting=False, ambient=1.0, diffuse=0.0)
    seen = np.asarray(stage.shoot(camera).convert("RGB")).astype(int) @ np.array([1, 256, 65536])
    draw, face = pen(image), font(15, True)
    told: list[int] = []
    taken: list[tuple[float, float, float, float]] = []
    places = [(name, place) for name, c in zip(names.tolist(), code, strict=True) if (place := _deepest(seen == c))]
    for name, (x, y, _) in sorted(places, key=lambda p: -p[1][2]):
        box = draw.textbbox((x, y), str(name), face, anchor="mm")
        if any(box[0] < r and box[2] > l and box[1] < b and box[3] > t for l, t, r, b in taken):
            continue
        taken.append(box)
        told.append(name)
        draw.text((x, y), str(name), INK, face, anchor="mm", stroke_width=3, stroke_fill="white")
    return _measured(image, camera), told


def _split(triangles: Indices, which: Indices, count: int) -> tuple[Indices, Indices]:
    """Points once for each surface they lie on, so that edges between surfaces stay sharp: source and triangles."""
    keys = triangles + count * which[:, None]
    unique, local = np.unique(keys, return_inverse=True)
    return unique % count, local.reshape(-1, 3)


def _soft(number: int) -> tuple[int, int, int]:
    """Light colours, neighbours in number far apart in hue."""
    red, green, blue = colorsys.hls_to_rgb((0.58 + 0.381966 * number) % 1.0, 0.80, 0.55)
    return round(255 * red), round(255 * green), round(255 * blue)


def _deepest(mask: Array) -> tuple[int, int, float] | None:
    """The pixel of a region that is farthest from its border, and how far; None if hardly anything of it is seen."""
    if mask.sum() < LEAST_PIXELS:
        return None
    from scipy.ndimage import distance_transform_edt

    depth = distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    row, column = np.unravel_index(int(depth.argmax()), depth.shape)
    return int(column), int(row), float(depth[row, column])

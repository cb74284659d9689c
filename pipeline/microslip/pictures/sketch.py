"""A mesh as a small picture, without VTK: facets from the farthest to the nearest, named ones in colour."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..data import Array, Mesh
from ..mesh import boundary_facets
from .lettering import save_png
from .scene import FINER, GREY, OUTLINE, fit, view_axes

AREA = 330_000
"""Pixels."""

MOST_LINES = 40_000
"""Facets beyond which the sides of elements are not drawn."""

_RING = {3: (0, 1, 2), 4: (0, 1, 2, 3), 6: (0, 3, 1, 4, 2, 5), 8: (0, 4, 1, 5, 2, 6, 3, 7)}
_RING[9] = _RING[8]


def body_sketch(mesh: Mesh, marked: Mapping[str, tuple[int, int, int]], path: Path) -> Path:
    """Draw the outside of a mesh.

    Args:
        marked: face -> its colour, the later ones over the earlier.
    """
    from PIL import Image, ImageDraw

    facets = boundary_facets(mesh)
    used = np.unique(np.concatenate([f.ravel() for f in facets.values()]))
    spread = np.cov((mesh.points[used] - mesh.points[used].mean(axis=0)).T) + 1e-30 * np.eye(3)
    inertia = np.trace(spread) * np.eye(3) - spread
    axes, thin = view_axes(inertia), np.linalg.eigh(inertia)[1][:, 2]
    behind = axes @ (2 * np.outer(thin, thin) - np.eye(3))  # half a turn about the shortest axis
    axes = max(axes, behind, key=lambda a: _shown(mesh, marked, a[2]))
    camera = fit(mesh.points[used], axes, AREA)
    colours = _colours(mesh, marked)
    size = (FINER * camera.size[0], FINER * camera.size[1])
    pixels = FINER * camera.project(mesh.points)
    rows = []
    for nodes in facets.values():
        corners = mesh.points[nodes[:, : 3 if nodes.shape[1] in (3, 6) else 4]]
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
        normal = normal @ axes.T / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        depth = corners.mean(axis=1) @ axes[2]
        keys = map(frozenset, nodes[:, : corners.shape[1]].tolist())
        light = np.clip(0.45 + 0.55 * (normal @ _LIGHT), 0.2, 1.0)
        every = zip(nodes[:, _RING[nodes.shape[1]]], normal[:, 2], depth, light, keys, strict=True)
        rows += [
            (d, ring, shade, colours.get(key, GREY)) for ring, n, d, shade, key in every if n > 0
        ]
    image = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(image)
    outline = OUTLINE if len(rows) < MOST_LINES else None
    for _, ring, shade, colour in sorted(rows, key=lambda row: row[0]):
        fill = tuple(round(min(1.18 * shade, 1.0) * c) for c in colour)
        draw.polygon([tuple(p) for p in pixels[ring].tolist()], fill=fill, outline=outline)
    return save_png(image.resize(camera.size, Image.Resampling.LANCZOS), path)


def _shown(mesh: Mesh, marked: Mapping[str, object], towards: Array) -> int:
    """How many of the named faces turn towards the viewer."""
    count = 0
    for name in marked:
        for kind, nodes in mesh.faces.get(name, {}).items():
            corners = mesh.points[nodes[:, : 3 if kind.startswith("triangle") else 4]]
            normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1]).sum(axis=0)
            count += bool(normal @ towards > 0.1 * np.linalg.norm(normal))
    return count


_LIGHT: Array = np.array([-0.36, 0.48, 0.8])


def _colours(
    mesh: Mesh, marked: Mapping[str, tuple[int, int, int]]
) -> dict[frozenset[int], tuple[int, int, int]]:
    """Corners of the facets of named faces -> their colour."""
    found: dict[frozenset[int], tuple[int, int, int]] = {}
    for name, colour in marked.items():
        for kind, nodes in mesh.faces.get(name, {}).items():
            corners = nodes[:, : 3 if kind.startswith("triangle") else 4]
            found |= dict.fromkeys(map(frozenset, corners.tolist()), colour)
    return found

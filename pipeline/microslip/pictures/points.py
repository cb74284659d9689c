"""Shapes of a body whose nodes alone are known (foreign matrices, a test): where each node is and where it goes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, ModalBasis, ModalGroup
from ..reduced.coordinates import in_modes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 12
COLUMNS = 4
SHARE = 0.12
"""Largest motion drawn, over the size of the body."""


def points_sheet(basis: ModalBasis, group: ModalGroup, figure: Figure, most: int = MOST) -> None:
    """The first elastic modes as a sheet of three-dimensional sketches; nothing without shapes."""
    g = group if group.to_diagonal is None else in_modes(group)
    elastic = [j for j in range(len(g.omega)) if g.omega[j] > 0][:most]
    if not len(g.phi) or not elastic:
        return
    rows, columns = -(-len(elastic) // COLUMNS), min(COLUMNS, len(elastic))
    figure.set_size_inches(3.0 * columns, 3.1 * rows)
    for place, j in enumerate(elastic, 1):
        axes: Any = figure.add_subplot(rows, columns, place, projection="3d")
        _sketch(axes, basis.mesh.points, g.phi[:, :, j].real if moves(g, j) else np.zeros_like(basis.mesh.points))
        still = "" if moves(g, j) else "\nrotations alone"
        axes.set_title(f"{j + 1}: {g.omega[j] / 2 / np.pi:.5g} Hz{still}", fontsize=10)

def moves(group: ModalGroup, mode: int) -> bool:
    """Whether a mode displaces the nodes; that of a rod in torsion turns them only, and leaves rounding."""
    length = np.abs(group.phi)
    return bool(length[:, :, mode].max() > 1e-9 * length.max())


def _sketch(axes: Any, points: Array, shape: Array) -> None:
    size = max(float(np.ptp(points, axis=0).max()), 1e-12)
    moved = points + shape * SHARE * size / max(float(np.linalg.norm(shape, axis=1).max()), 1e-300)
    length = np.linalg.norm(shape, axis=1)
    pairs = np.stack([points, moved], axis=1)
    axes.scatter(*points.T, s=6, color="#c3c7ce", depthshade=False)
    axes.scatter(*moved.T, s=14, c=length, cmap="viridis", depthshade=False)
    for a, b in pairs if len(pairs) <= 400 else []:
        axes.plot(*np.stack([a, b], axis=1), color="#8b919c", linewidth=0.7)
    extent = np.maximum(np.ptp(np.vstack([points, moved]), axis=0), 0.15 * size)
    middle = 0.5 * (points.max(axis=0) + points.min(axis=0))
    for limits, m, e in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), middle, extent, strict=True):
        limits(m - 0.55 * e, m + 0.55 * e)
    axes.set_box_aspect(extent)
    axes.set_axis_off()

"""A body that moves in time, as an animation of one period."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..data import Array, ModalBasis
from ..units import METRES
from . import lettering, ring_views, views
from .scene import Stage, fit, quiet_vtk


def moving_gif(basis: ModalBasis, moved: Array, path: Path, title: str) -> Path:
    """Frames of displacements (f, sectors, points, 3) in m, amplified alike; of one body over its outline at rest.

    The colour is the size of the displacement; the largest one and the amplification stand below.
    """
    quiet_vtk()
    studio = views.open_studio(basis) if basis.sectors == 1 else ring_views.open_ring(basis, Stage())
    try:
        frames = _frames(studio, moved, title)
    finally:
        studio.stage.close()
    return lettering.save_gif(frames, path)


def _frames(studio: views.Studio | ring_views.RingStudio, moved: Array, title: str) -> list[lettering.Picture]:
    sizes = np.linalg.norm(moved, axis=3)
    full_scale, (frame, sector) = float(sizes.max()), np.unravel_index(sizes.max(axis=2).argmax(), sizes.shape[:2])
    source, count = studio.outside.source, len(moved)
    swing = views.AMPLITUDE if isinstance(studio, views.Studio) else ring_views.SWING
    factor = views.mode_scale(studio, moved[frame, sector], swing)
    note = f"amplified {factor:.3g} times; largest displacement {METRES.sized(full_scale)}"
    if isinstance(studio, views.Studio):
        still, triangles, note = studio.points, studio.outside.triangles, f"{note}; grey lines: at rest"
        studio.stage.lines(studio.basis.mesh.points, studio.outside.outline, (150, 154, 164), 1.5)
    else:
        still, triangles = studio.points(), studio.every(studio.triangles, len(source))
    shown = still + factor * moved[:, :, source].reshape(count, -1, 3)
    camera = fit(shown.reshape(-1, 3), studio.axes, 0.45 * views.AREA)
    colours = {"cmap": views.DISPLACEMENT_MAP, "clim": (0.0, 1.0)}
    data = studio.stage.skin(still, triangles, np.zeros(len(still)), **colours)
    frames = []
    for points, size in zip(shown, sizes[:, :, source].reshape(count, -1) / max(full_scale, 1e-300), strict=True):
        studio.stage.reshape(data, triangles, points, size)
        frames.append(lettering.captioned(studio.stage.shoot(camera), title, note, 16))
    return frames

"""A body that moves in time, as an animation of one period."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..data import Array, ModalBasis
from ..files.store import complete_or_absent
from ..units import METRES
from . import lettering, views
from .scene import fit, quiet_vtk

MILLISECONDS = 60
"""Of a frame."""


def moving_gif(basis: ModalBasis, moved: Array, path: Path, title: str) -> Path:
    """Frames of displacements (f, points, 3) in m, amplified alike, over the outline of the body at rest.

    The colour is the size of the displacement; the largest one and the amplification stand below.
    """
    quiet_vtk()
    studio = views.open_studio(basis)
    try:
        frames = _frames(studio, moved, title)
    finally:
        studio.stage.close()
    with complete_or_absent(path) as temporary:
        lettering.save_gif(str(temporary), frames, MILLISECONDS)
    return path


def _frames(studio: views.Studio, moved: Array, title: str) -> list[lettering.Picture]:
    sizes = np.linalg.norm(moved, axis=2)
    largest = float(sizes.max())
    factor = views.mode_scale(studio, moved[np.argmax(sizes.max(axis=1))])
    outside, source = studio.outside, studio.outside.source
    shown = studio.points + factor * moved[:, source]
    camera = fit(shown.reshape(-1, 3), studio.axes, 0.45 * views.AREA)
    note = f"amplified {factor:.3g} times; largest displacement {METRES.sized(largest)}; grey lines: at rest"
    studio.stage.lines(studio.basis.mesh.points, outside.outline, (150, 154, 164), 1.5)
    data = studio.stage.skin(
        studio.points, outside.triangles, np.zeros(len(source)), cmap=views.DISPLACEMENT_MAP, clim=(0.0, 1.0)
    )
    frames = []
    for points, size in zip(shown, sizes[:, source] / max(largest, 1e-300), strict=True):
        studio.stage.reshape(data, outside.triangles, points, size)
        frames.append(lettering.captioned(studio.stage.shoot(camera), title, note, 16))
    return frames

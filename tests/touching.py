"""Bodies that touch: meshes side by side, and a blade with a shroud that meets its own image in the next sector."""

from __future__ import annotations

import numpy as np
from meshes import brick

from microslip.data import Mesh

SECTORS = 12


def shrouded(n=(2, 2, 6), gap: float = 0.0, lean: tuple[float, float] = (0.9, -0.5)) -> Mesh:
    """A blade whose upper third widens to a shroud that fills its sector (rad) but for a gap; sheared along the axis.

    Its sides x1 (right) and x0 (left) are images of each other under the rotation by a sector about y.
    """

    def to(p: np.ndarray) -> np.ndarray:
        s, y, r = p[:, 0], p[:, 1], p[:, 2]
        height = (r - 0.3) / 0.1
        wide = np.clip((height - 0.5) / 0.25, 0, 1)
        half = 0.004 / r * (1 - wide) + (np.pi / SECTORS - 0.5 * gap / r) * wide
        angle = s * half + (lean[0] + lean[1] * height) * y / r
        return np.column_stack([r * np.sin(angle), y, r * np.cos(angle)])

    mesh = brick("hexahedron20", n, (2, 0.04, 0.1), (-1, -0.02, 0.3), to)
    faces = dict(mesh.faces)
    top = mesh.points[:, 0] ** 2 + mesh.points[:, 2] ** 2 > 0.3749**2
    for name, side in (("right", "x1"), ("left", "x0")):
        faces[name] = {t: f[top[f].all(axis=1)] for t, f in mesh.faces[side].items()}
    return Mesh(mesh.points, mesh.cells, faces, {}, mesh.node_id)


def together(**parts: Mesh) -> Mesh:
    """Meshes side by side in one, unjoined; the faces of part ``a`` are called ``a_x0`` and so on."""
    points, cells, faces, start = [], {}, {}, 0
    for name, m in parts.items():
        points.append(m.points)
        for t, c in m.cells.items():
            cells[t] = np.vstack([cells[t], c + start]) if t in cells else c + start
        faces |= {f"{name}_{k}": {t: f + start for t, f in v.items()} for k, v in m.faces.items()}
        start += m.n_points
    return Mesh(np.vstack(points), cells, faces, {}, np.arange(1, start + 1))

"""A small beam of ten-node tetrahedra and its modal basis, made within a second, for tests of files and rows."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np

from microslip.data import Mesh, ModalBasis
from microslip.mesh import boundary_facets
from microslip.modal.compute import modal_basis
from microslip.settings.body import BodySettings

SIZE = (0.02, 0.03, 0.12)  # m along x, y, z
_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
# six tetrahedra around the diagonal 0-6 of a brick in VTK's order
_SPLIT = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))


def beam(divisions: tuple[int, int, int] = (2, 2, 6), size: tuple[float, float, float] = SIZE) -> Mesh:
    """A box of ten-node tetrahedra, faces clamp (z = 0), tip, contact_left (x = 0), contact_right."""
    nx, ny, nz = divisions
    corners = np.array([[i / nx, j / ny, k / nz] for k in range(nz + 1) for j in range(ny + 1) for i in range(nx + 1)])
    bricks = np.array([_brick(i, j, k, nx, ny) for k, j, i in product(range(nz), range(ny), range(nx))])
    tets = bricks[:, _SPLIT].reshape(-1, 4)
    ends = np.sort(tets[:, _EDGES].reshape(-1, 2), axis=1)
    edges, inverse = np.unique(ends, axis=0, return_inverse=True)
    points = np.vstack([corners, corners[edges].mean(axis=1)]) * size
    cells = np.hstack([tets, len(corners) + inverse.reshape(-1, 6)])
    return named(Mesh(points, {"tetra10": cells}, node_id=np.arange(1, len(points) + 1)))


def _brick(i: int, j: int, k: int, nx: int, ny: int) -> list[int]:
    def number(a: int, b: int, c: int) -> int:
        return (c * (ny + 1) + b) * (nx + 1) + a

    ring = ((0, 0), (1, 0), (1, 1), (0, 1))
    return [number(i + a, j + b, k + c) for c in (0, 1) for a, b in ring]


def named(mesh: Mesh) -> Mesh:
    """The same mesh with its end and side faces named, and a point set at the tip."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    where = {"clamp": (2, low), "tip": (2, high), "contact_left": (0, low), "contact_right": (0, high)}
    faces = {}
    for name, (axis, bound) in where.items():
        flat = np.isclose(mesh.points[:, axis], bound[axis], atol=1e-9)
        faces[name] = {t: f[flat[f].all(axis=1)] for t, f in boundary_facets(mesh).items()}
    tip = np.flatnonzero(np.isclose(mesh.points[:, 2], high[2], atol=1e-9))
    return Mesh(mesh.points, mesh.cells, faces, {"tip_points": tip}, mesh.node_id)


def table(**changes: object) -> dict:
    """Settings of the beam as they would stand in a body.toml in metres."""
    x, y, z = SIZE
    settings = {
        "name": "small",
        "length_unit": "m",
        "geometry": {"mesh": "small.msh"},
        "material": {"density": 7850.0, "young": 2.1e11, "poisson": 0.3},
        "supports": [{"face": "clamp"}],
        "interfaces": [
            {"name": "right", "face": "contact_right", "role": "right", "partner": "left", "sector_shift": 1},
            {"name": "left", "face": "contact_left", "role": "left", "partner": "right", "sector_shift": -1},
        ],
        "excitations": [
            {"name": "shaker", "point": [x / 2, y / 2, z], "direction": [1.0, 2.0, 0.0]},
            {"name": "gas", "face": "contact_left", "pressure": True},
        ],
        "monitors": [{"name": "tip-probe", "point": [x / 2, y / 2, z]}],
        "gauges": [{"name": "root", "point": [x / 2, 0.0, 0.01], "direction": [0.0, 0.0, 1.0]}],
        "modes": {"count": 6, "solver": "superlu"},
        "damping": {"ratio": 0.002},
        "rotation": {"speeds_rpm": [0.0]},
    }
    return settings | changes


@cache
def basis(speeds_rpm: tuple[float, ...] = (0.0,), free: bool = False) -> ModalBasis:
    """The beam's basis; treat it as read-only."""
    changes: dict = {"rotation": {"speeds_rpm": list(speeds_rpm), "point": [0.0, 0.0, -0.2]}}
    if free:
        changes |= {"supports": [], "free": True}
    settings = BodySettings.model_validate(table(**changes))
    return modal_basis(beam(), settings, provenance={"settings": "small", "mesh_sha256": "0" * 64})

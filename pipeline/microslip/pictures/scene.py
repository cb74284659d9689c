"""The body as PyVista draws it: its surface, a camera that fits, and one off-screen window used again and again."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, Indices, Mesh
from ..mesh import boundary_facets
from . import lettering

if TYPE_CHECKING:
    import pyvista

# Facet -> flat triangles and element sides, so that curved facets look curved. Indices are VTK's local nodes.
_TRIANGLES = {
    "triangle": ((0, 1, 2),),
    "triangle6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad": ((0, 1, 2), (0, 2, 3)),
    "quad8": ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7)),
    "quad9": ((0, 4, 8), (0, 8, 7), (4, 1, 5), (4, 5, 8), (8, 5, 2), (8, 2, 6), (7, 8, 6), (7, 6, 3)),
}
_SIDES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "triangle6": ((0, 3), (3, 1), (1, 4), (4, 2), (2, 5), (5, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "quad8": ((0, 4), (4, 1), (1, 5), (5, 2), (2, 6), (6, 3), (3, 7), (7, 0)),
    "quad9": ((0, 4), (4, 1), (1, 5), (5, 2), (2, 6), (6, 3), (3, 7), (7, 0)),
}
SHARP = 44.0
"""Facets that meet at a larger angle (degrees) are drawn with an edge between them."""

FINER = 2
"""Pictures are rendered this many times larger and averaged down: smooth edges without the driver's help."""

GREY = (200, 204, 210)
OUTLINE = (90, 96, 108)


def quiet_vtk() -> None:
    """Let VTK render without a display: chosen only if the user has not chosen, before VTK opens a window."""
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")


@dataclass(frozen=True)
class Surface:
    """The outside of a mesh as flat triangles.

    Attributes:
        source: (v,) mesh point of each vertex; points on sharp edges appear once for each side.
        triangles: (t, 3) vertices. facet: (t,) number of the boundary facet of each triangle.
        facet_keys: facet (its sorted corner points) -> number.
        sides: (s, 2) mesh points, element sides. outline: (o, 2) mesh points, sharp edges.
    """

    source: Indices
    triangles: Indices
    facet: Indices
    facet_keys: dict[tuple[int, ...], int]
    sides: Indices
    outline: Indices


_COARSE = {3: ((0, 1, 2),), 4: ((0, 1, 2), (0, 2, 3))}


def surface(mesh: Mesh, coarse: bool = False) -> Surface:
    """Extract the outside of a mesh once (coarse: facets by their corners only, a quarter of the triangles)."""
    import pyvista as pv

    facets = boundary_facets(mesh)
    triangles, facet = flat_triangles(facets, coarse)
    sides = [element_sides(kind, nodes) for kind, nodes in facets.items()]
    corners = (row for kind, f in facets.items() for row in np.sort(f[:, : _corners(kind)], axis=1).tolist())
    keys = {tuple(row): number for number, row in enumerate(corners)}
    outline = sharp_edges(mesh.points, triangles)
    used, local = np.unique(triangles, return_inverse=True)
    raw: Any = pv.PolyData.from_regular_faces(mesh.points[used], local.reshape(-1, 3).astype(int))
    raw.point_data["source"] = used
    split = raw.compute_normals(
        cell_normals=False,
        split_vertices=True,
        feature_angle=SHARP,
        consistent_normals=False,
        auto_orient_normals=False,
    )
    return Surface(
        np.asarray(split.point_data["source"], dtype=np.int64), split.regular_faces.astype(np.int64), facet, keys,
        np.unique(np.concatenate(sides), axis=0), outline,
    )  # fmt: skip


def flat_triangles(facets: Mapping[str, Indices], coarse: bool) -> tuple[Indices, Indices]:
    """(t, 3) mesh points of the flat triangles that facets are parted into, coarse: by their corners alone, and (t,)
    the numbers of their facets."""
    flat, owner, count = [], [], 0
    for kind, nodes in facets.items():
        pattern = np.array(_COARSE[_corners(kind)] if coarse else _TRIANGLES[kind])
        flat.append(nodes[:, pattern].reshape(-1, 3))
        owner.append(np.repeat(np.arange(count, count + len(nodes)), len(pattern)))
        count += len(nodes)
    return np.concatenate(flat), np.concatenate(owner)


def sharp_edges(points: Array, triangles: Indices) -> Indices:
    """(s, 2) points of the edges at which triangles meet at a sharp angle, or none meets another."""
    ends = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    pairs, which = np.unique(ends, axis=0, return_inverse=True)
    total, normal = np.zeros((len(pairs), 3)), triangle_normals(points, triangles)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    np.add.at(total, which.ravel(), np.repeat(normal, 3, axis=0))
    return pairs[np.linalg.norm(total, axis=1) < 2 * np.cos(np.radians(SHARP / 2))].astype(np.int64)


def element_sides(kind: str, nodes: Indices) -> Indices:
    """(s, 2) mesh points of the sides of facets (n, k), the lower one first; those between facets come twice."""
    return np.sort(nodes[:, np.array(_SIDES[kind])].reshape(-1, 2), axis=1)


def _corners(kind: str) -> int:
    return 3 if kind.startswith("triangle") else 4


def face_triangles(outside: Surface, mesh: Mesh, name: str) -> Array:
    """(t,) which triangles of the outside belong to a named face."""
    chosen = np.zeros(outside.facet.max() + 1, dtype=bool)
    for kind, nodes in mesh.faces[name].items():
        for row in np.sort(nodes[:, : _corners(kind)], axis=1).tolist():
            if (number := outside.facet_keys.get(tuple(row))) is not None:
                chosen[number] = True
    return chosen[outside.facet]


def triangle_normals(points: Array, triangles: Indices) -> Array:
    """(t, 3) outward normals whose length is twice the area."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def vertex_normals(points: Array, triangles: Indices) -> Array:
    """(v, 3) unit normals, area-weighted over the triangles of each vertex."""
    normal = triangle_normals(points, triangles)
    total = np.stack(
        [np.bincount(triangles.ravel(), np.repeat(normal[:, i], 3), minlength=len(points)) for i in range(3)], axis=1
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.where(length > 0, length, 1.0)


@dataclass(frozen=True)
class Camera:
    """Parallel projection.

    Attributes:
        axes: (3, 3) rows right, up, towards the viewer. focus: (3,) point in the middle of the picture.
        height: m, of the picture. size: (width, height) in pixels. reach: m, largest distance from the focus.
    """

    axes: Array
    focus: Array
    height: float
    size: tuple[int, int]
    reach: float

    def project(self, points: Array) -> Array:
        """(k, 2) pixels (x to the right, y downwards) of (k, 3) points."""
        at = (np.atleast_2d(points) - self.focus) @ self.axes[:2].T * (self.size[1] / self.height)
        return np.column_stack([self.size[0] / 2 + at[:, 0], self.size[1] / 2 - at[:, 1]])

    @property
    def metres_per_pixel(self) -> float:
        return self.height / self.size[1]


def axes_towards(direction: Array, upward: Array | None = None) -> Array:
    """(3, 3) rows right, up, towards the viewer, for a viewer in the given direction; z is up unless seen end on."""
    d = direction / np.linalg.norm(direction)
    choices = [np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])]
    up = next(u for u in ([upward] if upward is not None else []) + choices if abs(d @ u) < 0.97 * np.linalg.norm(u))
    right = np.cross(up, d)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(d, right), d])


def view_axes(inertia: Array) -> Array:
    """Where to look from so that the body shows itself: mostly along its thinnest principal axis, a little along
    the others, from in front (-y), the right (+x) and above (+z).

    Args:
        inertia: (3, 3) about the centre.
    """
    _, vectors = np.linalg.eigh(inertia)
    front = np.array([1.0, -1.2, 0.8])
    length, middle, thin = (v * (1.0 if v @ front >= 0 else -1.0) for v in vectors.T)
    return axes_towards(0.32 * length + 0.60 * middle + 0.73 * thin)


def fit(
    points: Array, axes: Array, area: float, shape: tuple[float, float] = (0.4, 2.4), margin: float = 0.05
) -> Camera:
    """A camera that shows all points.

    Args:
        points: (k, 3). axes: see `Camera`. area: pixels of the picture. shape: limits of width over height.
    """
    seen = points @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    extent = np.maximum((high - low)[:2] * (1 + 2 * margin), 1e-12)
    ratio = float(np.clip(extent[0] / extent[1], *shape))
    width, height = round(np.sqrt(area * ratio)), round(np.sqrt(area / ratio))
    tall = max(extent[1], extent[0] / ratio)
    return Camera(axes, ((low + high) / 2) @ axes, float(tall), (width, height), float(np.linalg.norm(high - low)))


def fit_tile(points: Array, axes: Array, size: tuple[int, int], margin: float = 0.05) -> Camera:
    """A camera of a given picture size that shows all points."""
    ratio = size[0] / size[1]
    return replace(fit(points, axes, size[0] * size[1], (ratio, ratio), margin), size=size)


class Stage:
    """One off-screen window. Things are put on it, a picture is taken, it is cleared."""

    def __init__(self) -> None:
        import pyvista as pv

        self._pv: Any = pv
        self._plotter: Any = self._pv.Plotter(off_screen=True, lighting="none", window_size=[400, 400])
        self._plotter.set_background("white")
        self._plotter.disable_anti_aliasing()
        self._plotter.enable_parallel_projection()
        self._plotter.add_light(pv.Light(light_type="headlight", intensity=0.6))
        self._plotter.add_light(pv.Light(position=(0.6, 0.9, 1.0), light_type="camera light", intensity=0.45))

    def clear(self) -> None:
        self._plotter.clear_actors()

    def skin(self, points: Array, triangles: Indices, values: Array | None = None, **how: Any) -> pyvista.PolyData:
        """A smooth surface, coloured by `values` if given; both may be changed later by `reshape`."""
        data = self._pv.PolyData.from_regular_faces(points, triangles)
        data.point_data.active_normals = vertex_normals(points, triangles)
        style: dict[str, Any] = {
            "smooth_shading": False,
            "show_scalar_bar": False,
            "copy_mesh": False,
            "render": False,
            "ambient": 0.38,
            "diffuse": 0.75,
        }
        if values is not None:
            data.point_data["value"] = values
            style["scalars"] = "value"
        actor = self._plotter.add_mesh(data, **{**style, **how})
        actor.prop.interpolation = "Gouraud"
        return data

    @staticmethod
    def reshape(data: pyvista.PolyData, triangles: Indices, points: Array, values: Array | None = None) -> None:
        """Move a skin and colour it anew."""
        data.points = points
        data.point_data.active_normals = vertex_normals(points, triangles)
        if values is not None:
            data.point_data["value"] = values

    def lines(self, points: Array, pairs: Indices, colour: Any, width: float = 1.0, **how: Any) -> None:
        """Straight lines between pairs of points."""
        if not len(pairs):
            return
        used, local = np.unique(pairs, return_inverse=True)
        cells = np.column_stack([np.full(len(pairs), 2), local.reshape(-1, 2)])
        data = self._pv.PolyData(points[used], lines=cells.ravel())
        self._plotter.add_mesh(data, color=colour, line_width=FINER * width, lighting=False, render=False, **how)

    def dots(self, points: Array, colour: Any, size: float) -> None:
        if len(points):
            self._plotter.add_mesh(
                self._pv.PolyData(points),
                color=colour,
                point_size=FINER * size,
                render_points_as_spheres=True,
                lighting=False,
                render=False,
            )

    def arrow(self, start: Array, direction: Array, length: float, colour: Any) -> None:
        data = self._pv.Arrow(
            start=start,
            direction=direction,
            scale=length,
            tip_length=0.28,
            tip_radius=0.09,
            shaft_radius=0.03,
            tip_resolution=24,
        )
        self._plotter.add_mesh(data, color=colour, ambient=0.3, render=False)

    def shoot(self, camera: Camera) -> lettering.Picture:
        """Take the picture."""
        view = self._plotter.camera
        distance = 4 * max(camera.reach, camera.height)
        view.position = camera.focus + distance * camera.axes[2]
        view.focal_point = camera.focus
        view.up = camera.axes[1]
        view.parallel_scale = camera.height / 2
        view.clipping_range = (0.1 * distance, 2 * distance)
        size = [FINER * pixels for pixels in camera.size]
        if list(self._plotter.window_size) != size:
            self._plotter.window_size = size
        self._plotter.render()
        return lettering.picture(self._plotter.screenshot(return_img=True)).reduce(FINER)

    def close(self) -> None:
        self._plotter.close()

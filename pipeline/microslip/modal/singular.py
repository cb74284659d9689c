"""Where a stress is a property of the mesh: beside edges at which the elastic solution has no limit.

Such edges are those of faces that supports hold (of a roller where the surface goes on beyond it), those of contact
patches, sharp inner edges of the surface, nodes that are held and points that are loaded on their own. The zone of an
edge is as wide as the wall is thick: 2 V/S of the whole body, the thickness of a plate and the radius of a rod, or
2 A/P of the face where that is less; and never narrower than the mean edge of the elements at it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..data import Array, Flags, Indices, Mesh
from ..mesh.surface import boundary_facets
from ..settings.body import BodySettings
from ..topology import CELL_TYPES, FACET_CORNERS

SHARP = np.cos(np.radians(50.0))
"""Cosine of the turn of the surface across an inner edge from which on it is sharp: a rounded corner that is meshed
with two elements or more turns by 45 degrees or less."""

FLAT = 0.8
"""Cosine of the angle between facets up to which a surface goes on across an edge."""


@dataclass(frozen=True)
class Zones:
    """Attributes: edges: (k, 3) m, points along edges, and the width of their zone, m."""

    edges: tuple[tuple[Array, float], ...] = ()

    def hold(self, places: Array) -> Flags:
        """(p,) which of some places (p, 3) lie in a zone."""
        found = np.zeros(len(places), dtype=bool)
        for points, width in self.edges:
            found |= cKDTree(points).query(places, distance_upper_bound=width)[0] <= width
        return found


def singular_zones(mesh: Mesh, settings: BodySettings) -> Zones:
    """The zones of a body; none of one without elements."""
    if not mesh.cells:
        return Zones()
    surface = _Surface.of(mesh, settings)
    edges = [surface.inner()]
    for support in settings.supports:
        if support.face in {*mesh.faces, *mesh.point_sets}:
            nodes = mesh.set_points(support.face)
            edges.append(surface.rim(nodes, wholly=set(support.directions) == set("xyz")))
    for item in settings.interfaces:
        if item.role != "load" and item.face in mesh.faces:
            edges.append(surface.rim(mesh.face_points(item.face)))
    edges += [surface.spots(np.array(load.point)[None]) for load in settings.loads if load.point is not None]
    return Zones(tuple(edge for edge in edges if len(edge[0])))


@dataclass(frozen=True)
class _Surface:
    """Facets of a body's surface and their edges.

    Attributes:
        nodes: (f, 9) of the facets, the last one again where they have fewer. corners: (f, 4), of a triangle likewise.
        area: (f, 3) m2, outwards. middle: (f, 3) m.
        edges: (e, 2) corners, in order. owner: (e, 2) facets of an edge, -1: none. wall: 2 V/S, m. cut: (2, n) which
            nodes lie on either cut face of a cyclic sector: what lies wholly in one is no surface of the ring.
    """

    mesh: Mesh
    nodes: Indices
    corners: Indices
    area: Array
    middle: Array
    edges: Indices
    owner: Indices
    wall: float
    cut: Flags

    @classmethod
    def of(cls, mesh: Mesh, settings: BodySettings) -> _Surface:
        facets = boundary_facets(mesh)
        nodes = np.concatenate([_filled(f, 9) for f in facets.values()])
        corners = np.concatenate([_filled(f[:, : FACET_CORNERS[kind]], 4) for kind, f in facets.items()])
        cut = np.zeros((2, mesh.n_points), dtype=bool)
        faces = (settings.cyclic.left, settings.cyclic.right) if settings.cyclic else ()
        for of_face, face in zip(cut, faces, strict=False):
            of_face[mesh.face_points(face)] = True
        a, b, c, d = mesh.points[corners].swapaxes(0, 1)
        area, middle = 0.5 * np.cross(c - a, d - b), (a + b + c + d) / 4
        volume = np.einsum("fi,fi->", area, middle - mesh.points.mean(axis=0)) / 3
        real = ~_wholly(cut, corners)
        wall = 2 * volume / np.linalg.norm(area[real], axis=1).sum()
        edges, owner = _edges(corners)
        return cls(mesh, nodes, corners, area, middle, edges, owner, float(wall), cut)

    def rim(self, nodes: Indices, wholly: bool = True) -> tuple[Array, float]:
        """Points along the edges of the facets whose corners are all among some nodes, and of those that belong to no
        such facet; and the width of the zone. wholly: else only edges across which the surface goes on."""
        among = np.zeros(self.mesh.n_points, dtype=bool)
        among[nodes] = True
        mine: Flags = np.asarray(among[self.corners].all(axis=1))
        on: Flags = (self.owner >= 0) & mine[self.owner]
        rim = np.flatnonzero((on.sum(axis=1) == 1) & ~_wholly(self.cut, self.edges))
        length = np.linalg.norm(np.diff(self.mesh.points[self.edges[rim]], axis=1)[:, 0], axis=1)
        around, size = length.sum(), np.linalg.norm(self.area[mine], axis=1).sum()
        if not wholly:
            rim = rim[self._goes_on()[rim]]
        alone = np.setdiff1d(nodes, self.nodes[mine]) if wholly else np.zeros(0, dtype=np.int64)
        wide = min(self.wall, 2 * size / around) if around > 0 else self.wall
        wide = max(wide, self._elements(np.concatenate([self.edges[rim].ravel(), alone])))
        return np.concatenate([_along(self.mesh.points[self.edges[rim]], wide), self.mesh.points[alone]]), wide

    def inner(self) -> tuple[Array, float]:
        """Points along the sharp inner edges, and the width of their zone."""
        both = np.flatnonzero((self.owner >= 0).all(axis=1) & ~_wholly(self.cut, self.edges))
        one, other = self.owner[both].T
        turned = self._cosine(one, other) < SHARP
        inwards = np.einsum("ei,ei->e", self.middle[other] - self.middle[one], self.area[one]) > 0
        edges = self.edges[both[turned & inwards]]
        wide = max(self.wall, self._elements(edges.ravel()))
        return _along(self.mesh.points[edges], wide), wide

    def spots(self, points: Array) -> tuple[Array, float]:
        """Points (k, 3) that are loaded on their own, and the width of their zone."""
        near = cKDTree(self.mesh.points).query(points)[1]
        return points, max(self.wall, self._elements(near))

    def _goes_on(self) -> Flags:
        both = (self.owner >= 0).all(axis=1)
        return both & (self._cosine(*self.owner.T) > FLAT)

    def _cosine(self, one: Indices, other: Indices) -> Array:
        unit = self.area / np.linalg.norm(self.area, axis=1)[:, None]
        return np.asarray(np.einsum("ei,ei->e", unit[one], unit[other]))

    def _elements(self, nodes: Indices) -> float:
        """Mean length of the edges of the elements at some nodes, m; 0 where there are none."""
        at, lengths = np.zeros(self.mesh.n_points, dtype=bool), list[Array]()
        at[nodes] = True
        for kind, cells in self.mesh.cells.items():
            near = self.mesh.points[cells[at[cells].any(axis=1)]]
            lengths += [np.linalg.norm(near[:, a] - near[:, b], axis=1) for a, b in CELL_TYPES[kind].edges]
        every = np.concatenate(lengths)
        return float(every.mean()) if len(every) else 0.0


def _wholly(cut: Flags, nodes: Indices) -> Flags:
    """(k,) whether all of some nodes (k, m) lie on one of two faces (2, n)."""
    return np.asarray(cut[:, nodes].all(axis=2).any(axis=0))


def _filled(nodes: Indices, count: int) -> Indices:
    """(f, count) nodes of facets, the last one again where there are fewer."""
    return nodes[:, np.minimum(np.arange(count), nodes.shape[1] - 1)]


def _edges(corners: Indices) -> tuple[Indices, Indices]:
    """(e, 2) corners of the edges of facets (f, 4), and (e, 2) the facets that share each, -1 for none."""
    pairs = np.concatenate([corners[:, [i, (i + 1) % 4]] for i in range(4)])
    owner = np.tile(np.arange(len(corners)), 4)
    real = pairs[:, 0] != pairs[:, 1]
    pairs, owner = np.sort(pairs[real], axis=1), owner[real]
    edges, first, number = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    owners = np.full((len(edges), 2), -1)
    owners[:, 0] = owner[first]
    others = np.ones(len(owner), dtype=bool)
    others[first] = False
    owners[number.ravel()[others], 1] = owner[others]
    return edges, owners


def _along(edges: Array, width: float) -> Array:
    """(k, 3) points along edges (e, 2, 3), a third of a zone's width apart."""
    if not len(edges):
        return np.zeros((0, 3))
    length = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).max()
    at = np.linspace(0.0, 1.0, int(np.ceil(3 * length / width)) + 1)[:, None, None]
    return np.asarray((edges[:, 0] * (1 - at) + edges[:, 1] * at).reshape(-1, 3))

"""Where the surfaces of two meshes lie on each other, facet by facet: each whole, by its middle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..data import Array, Indices, Mesh
from ..topology import FACET_CORNERS
from .surface import boundary_facets

NEAR = 0.01
"""How far apart they may be, in sizes of a facet."""

BEND = 0.8
"""Cosine of the angle between neighbouring facets beyond which a new patch begins."""

FLAT = 0.999
"""Least share of its area that a flat patch shows from the front."""


@dataclass(frozen=True)
class Touch:
    """A patch that a mesh has in common with another: lengths in m.

    Attributes:
        facets: type -> (f, k) facets. area: m2. normal: (3,) outwards, None where the patch is curved.
        low, high: (3,) corners of its box.
    """

    facets: dict[str, Indices]
    area: float
    normal: Array | None
    low: Array
    high: Array


def touches(mesh: Mesh, other: Mesh) -> list[Touch]:
    """The patches of a mesh's surface that lie on another mesh's surface, the largest first."""
    found = touching_facets(mesh, other)
    if not found:
        return []
    numbers = _patches(mesh, found)
    parts, start = [], 0
    for kind, facets in found.items():
        parts.append((kind, facets, numbers[start : start + len(facets)]))
        start += len(facets)
    made = [
        touch_of(mesh, {kind: facets[own == i] for kind, facets, own in parts if (own == i).any()})
        for i in range(numbers.max() + 1)
    ]
    return sorted(made, key=lambda touch: -touch.area)


Facets = Mapping[str, Indices]


def touching_facets(
    mesh: Mesh, other: Mesh, within: Facets | None = None, onto: Facets | None = None
) -> dict[str, Indices]:
    """Type -> (f, k) facets of the mesh whose middle lies on the other's surface, facing it.

    Where the other's facets are so much smaller that none does, those on which the middle of one of
    the other's lies.

    Args:
        within: facets of the mesh to choose from, onto: of the other to lie on; None: the whole
            surface.
    """
    own, theirs = within or boundary_facets(mesh), onto or boundary_facets(other)
    result = {}
    for kind, facets in own.items():
        chosen, _ = _lies_on(*_middle(mesh, facets), _triangles(other, theirs))
        if chosen.any():
            result[kind] = facets[chosen]
    if result:
        return result
    points, vectors = (
        np.concatenate(part)
        for part in zip(*(_middle(other, f) for f in theirs.values()), strict=True)
    )
    for kind, facets in own.items():
        _, hit = _lies_on(points, vectors, _triangles(mesh, {kind: facets}))
        met = hit.reshape(FACET_CORNERS[kind] - 2, len(facets)).sum(axis=0) > 0
        if met.any():
            result[kind] = facets[met]
    return result


def _middle(mesh: Mesh, facets: Indices) -> tuple[Array, Array]:
    """(f, 3) middles and (f, 3) area vectors of facets, by their corners."""
    corner = mesh.points[facets[:, : 3 if facets.shape[1] in (3, 6) else 4]]
    last = corner[:, -1]  # of a triangle its diagonals are two sides
    return corner.mean(axis=1), np.cross(corner[:, 2] - corner[:, 0], last - corner[:, 1]) / 2


def _triangles(mesh: Mesh, facets: Facets) -> Array:
    """(t, 3, 3) corners of the triangles that facets are made of: the first ones of all, then the
    second ones."""
    made = []
    for kind, nodes in facets.items():
        corners = FACET_CORNERS[kind]
        made += [
            mesh.points[nodes[:, list(three)]] for three in ((0, 1, 2), (0, 2, 3))[: corners - 2]
        ]
    return np.concatenate(made)


def _lies_on(points: Array, vectors: Array, triangles: Array) -> tuple[np.ndarray, np.ndarray]:
    """(f,) whether a facet, by its middle, lies on one of some triangles that face it, and (t,) on
    which ones any does."""
    centres = triangles.mean(axis=1)
    reach = float(np.linalg.norm(triangles - centres[:, None], axis=2).max())
    near = NEAR * np.sqrt(np.linalg.norm(vectors, axis=1))
    inside = ((points > triangles.min(axis=(0, 1)) - near[:, None]).all(axis=1)) & (
        points < triangles.max(axis=(0, 1)) + near[:, None]
    ).all(axis=1)
    found, hit, tree = (
        np.zeros(len(points), dtype=bool),
        np.zeros(len(triangles), dtype=bool),
        cKDTree(centres),
    )
    for i in np.flatnonzero(inside):
        close = np.array(tree.query_ball_point(points[i], reach + near[i]), dtype=np.int64)
        if len(close):
            on = _on(points[i], vectors[i], triangles[close], near[i])
            found[i] = on.any()
            hit[close[on]] = True
    return found, hit


def _on(point: Array, vector: Array, triangles: Array, near: float) -> np.ndarray:
    """(t,) which triangles a point lies on, and face against a vector."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = np.cross(u, v)
    twice, to = np.linalg.norm(normal, axis=1), point - a
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = normal / twice[:, None]
        first = np.einsum("ti,ti->t", np.cross(to, v), unit) / twice
        second = np.einsum("ti,ti->t", np.cross(u, to), unit) / twice
        within = (first > -1e-6) & (second > -1e-6) & (first + second < 1 + 1e-6)
        facing = unit @ vector < -BEND * np.linalg.norm(vector)
        return within & facing & (np.abs(np.einsum("ti,ti->t", to, unit)) < near)


def _patches(mesh: Mesh, found: dict[str, Indices]) -> Indices:
    """(f,) number of the patch that each facet belongs to: neighbours with a common corner that do not bend off."""
    corners = [facets[:, : FACET_CORNERS[kind]] for kind, facets in found.items()]
    vectors = np.concatenate([_middle(mesh, facets)[1] for facets in found.values()])
    unit = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    owner = np.repeat(np.arange(len(unit)), np.concatenate([np.full(len(c), c.shape[1]) for c in corners]))
    at = np.concatenate([c.ravel() for c in corners])
    meets = sp.csr_matrix((np.ones(len(at)), (owner, at)), shape=(len(unit), mesh.n_points))
    pairs = sp.coo_matrix(meets @ meets.T)
    smooth = np.einsum("pi,pi->p", unit[pairs.row], unit[pairs.col]) > BEND
    joined = sp.coo_matrix((smooth[smooth], (pairs.row[smooth], pairs.col[smooth])), shape=pairs.shape)
    return np.asarray(sp.csgraph.connected_components(joined, directed=False)[1])


def touch_of(mesh: Mesh, facets: Facets) -> Touch:
    """The patch that facets of a mesh make."""
    vectors = np.concatenate([_middle(mesh, f)[1] for f in facets.values()])
    points = mesh.points[np.unique(np.concatenate([f.ravel() for f in facets.values()]))]
    whole, area = vectors.sum(axis=0), float(np.linalg.norm(vectors, axis=1).sum())
    flat = np.linalg.norm(whole) > FLAT * area
    return Touch(
        dict(facets), area, whole / area if flat else None, points.min(axis=0), points.max(axis=0)
    )

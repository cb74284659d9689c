"""Two faces that meet, cut into pieces on which both are smooth, with quadrature points on every piece.

Shape functions of the other face have kinks along its edges. A rule that ignores them neither integrates the forces
of a uniform pressure exactly nor passes the patch test; on the pieces it does (M. A. Puso, T. A. Laursen, Computer
Methods in Applied Mechanics and Engineering 193 (2004) 601, section 3.3).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.spatial import cKDTree

from ..data import Array, Indices
from ..topology import FACET_CORNERS
from .discretise import quadrature, reference_nodes, shape_functions

FACING = -0.5
"""Facets face each other if the cosine between their normals is below this."""

Facets = tuple[tuple[str, Indices], ...]
"""Facets of a face by type: ((facet type, (f, k) point indices), ...)."""


@dataclass(frozen=True)
class Points:
    """Quadrature points on pieces of one pair of facet types.

    Attributes:
        master_type: of facet (``""``: a plane). slave: (p, ks), master: (p, km) point indices.
        numbers: (p, ks) number of each node among those of the slave face. N: (p, ks) shape functions, hats: (p, ks)
            positive ones (`node_hats`). weight: (p,) area in the reference geometry, m2. start: (p, 2) where on the
            master facet the projection begins.
    """

    master_type: str
    slave: Indices
    master: Indices
    numbers: Indices
    N: Array
    hats: Array
    weight: Array
    start: Array


@cache
def _coefficients(facet_type: str) -> Array:
    """(9, k) of the monomials x^i y^j, i, j = 0..2 (j fastest), in every shape function of a facet type."""
    grid = np.array([(x, y) for x in (0.1, 0.3, 0.6) for y in (0.1, 0.35, 0.55)])
    return np.linalg.solve(_monomials(grid, 0, 0), shape_functions(facet_type, grid)[0])


def _monomials(at: Array, dx: int, dy: int) -> Array:
    """(q, 9) derivatives of the monomials at (q, 2)."""
    one, zero = np.ones(len(at)), np.zeros(len(at))

    def powers(x: Array, derivative: int) -> list[Array]:
        return [[one, x, x**2], [zero, one, 2 * x], [zero, zero, 2 * one]][derivative]

    X, Y = powers(at[:, 0], dx), powers(at[:, 1], dy)
    return np.stack([a * b for a in X for b in Y], axis=1)


def facet_functions(facet_type: str, at: Array) -> tuple[Array, Array, Array]:
    """Shape functions (q, k), their first (q, 2, k) and second (q, 2, 2, k) derivatives at (q, 2)."""
    C = _coefficients(facet_type)
    first = np.stack([_monomials(at, 1, 0) @ C, _monomials(at, 0, 1) @ C], axis=1)
    mixed = _monomials(at, 1, 1) @ C
    second = np.stack([_monomials(at, 2, 0) @ C, mixed, mixed, _monomials(at, 0, 2) @ C], axis=1)
    return _monomials(at, 0, 0) @ C, first, second.reshape(len(at), 2, 2, C.shape[1])


def node_hats(facet_type: str, at: Array) -> Array:
    """(q, k) positive functions of the nodes that add up to 1: linear between nodes, mid-side ones included.

    On a triangle of six nodes linear on its four parts, on a square bilinear on its four parts; without a node in the
    middle, as in ``quad8``, its share goes to the four mid-side nodes.
    """
    if facet_type in ("triangle", "quad"):
        return facet_functions(facet_type, at)[0]
    x, y = at.T
    if facet_type == "triangle6":
        a = np.stack([1 - x - y, x, y])
        corners = np.maximum(2 * a - 1, 0)
        edges = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        middle = [np.clip(np.minimum(np.minimum(2 * a[i], 2 * a[j]), 1 - 2 * a[k]), 0, 1) for i, j, k in edges]
        return np.stack([*corners, *middle], axis=1)

    def hats(t: Array) -> dict[float, Array]:
        return {0.0: np.maximum(1 - 2 * t, 0), 0.5: 1 - np.abs(2 * t - 1), 1.0: np.maximum(2 * t - 1, 0)}

    X, Y = hats(x), hats(y)
    found = np.stack([X[float(i)] * Y[float(j)] for i, j in reference_nodes("quad9")], axis=1)
    if facet_type == "quad8":
        found = np.hstack([found[:, :4], found[:, 4:8] + 0.25 * found[:, 8:]])
    return found


def _fine_rule(kind: str) -> tuple[Array, Array]:
    """Points (q, 2) and weights (q,) of the second-order rule on each of the four parts of a triangle or square."""
    at, w = quadrature("triangle6" if kind == "triangle" else "quad9")
    shifts = ((0, 0), (0.5, 0), (0, 0.5))
    parts = [0.5 * at + np.array(s) for s in shifts]
    parts.append(0.5 - 0.5 * at if kind == "triangle" else 0.5 * at + 0.5)
    return np.concatenate(parts), np.tile(0.25 * w, 4)


def corner_type(facet_type: str) -> str:
    return "triangle" if FACET_CORNERS[facet_type] == 3 else "quad"


@dataclass(frozen=True)
class Flat:
    """Facets seen as flat polygons.

    Attributes:
        corners: (f, c, 3) m. centre: (f, 3). normal: (f, 3) unit. radius: (f,) largest distance centre-corner.
    """

    corners: Array
    centre: Array
    normal: Array
    radius: Array


def flat(facet_type: str, facets: Indices, x: Array) -> Flat:
    """Flat polygons through the corners of facets at positions x (n, 3)."""
    corners = x[facets[:, : FACET_CORNERS[facet_type]]]
    centre = corners.mean(axis=1)
    across = corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1]
    normal = np.cross(*across) if corners.shape[1] == 4 else np.cross(corners[:, 1] - corners[:, 0], across[0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    return Flat(corners, centre, normal, np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1))


def near_pairs(slave: Flat, master: Flat, slide: float, far: float) -> tuple[Indices, Indices]:
    """Numbers (i, j) of slave and master facets that face each other within `slide` along the face, `far` across."""
    tree = cKDTree(master.centre)
    reach = slave.radius + master.radius.max() + np.hypot(slide, far)
    near = tree.query_ball_point(slave.centre, reach, return_sorted=True)
    i = np.repeat(np.arange(len(near)), [len(v) for v in near])
    j = np.array([v for row in near for v in row], dtype=np.int64)
    if not len(j):
        return i, j
    apart = master.centre[j] - slave.centre[i]
    height = np.einsum("pi,pi->p", apart, slave.normal[i])
    along = np.linalg.norm(apart - height[:, None] * slave.normal[i], axis=1)
    keep = (along < slave.radius[i] + master.radius[j] + slide) & (np.abs(height) < far)
    keep &= np.einsum("pi,pi->p", slave.normal[i], master.normal[j]) < FACING
    return i[keep], j[keep]


def clip(subject: list[tuple[float, float]], window: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Common part of two convex polygons, both anticlockwise (Sutherland and Hodgman); empty if there is none."""
    out = subject
    for k in range(len(window)):
        (ax, ay), (bx, by) = window[k - 1], window[k]
        ex, ey = bx - ax, by - ay
        side = [ex * (y - ay) - ey * (x - ax) for x, y in out]
        new: list[tuple[float, float]] = []
        for m in range(len(out)):
            p, q, sp, sq = out[m - 1], out[m], side[m - 1], side[m]
            if (sp < 0) != (sq < 0):
                t = sp / (sp - sq)
                new.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
            if sq >= 0:
                new.append(q)
        out = new
        if not out:
            break
    return out


def _pieces(slave: Flat, master: Flat, i: Indices, j: Indices) -> tuple[Array, Array, Array]:
    """Triangles (t, 3, 2) in the plane of slave facet (t,), with master facet (t,), that tile all common parts."""
    frame = _frames(slave)
    mine = np.einsum("fab,fcb->fca", frame, slave.corners - slave.centre[:, None])
    theirs = np.einsum("pab,pcb->pca", frame[i], master.corners[j] - slave.centre[i][:, None])[:, ::-1]
    least = 1e-9 * slave.radius**2
    triangles, a, b = [], [], []
    for number, (s, m) in enumerate(zip(i.tolist(), j.tolist(), strict=True)):
        common = clip(mine[s].tolist(), theirs[number].tolist())
        for k in range(1, len(common) - 1):
            p, q, r = common[0], common[k], common[k + 1]
            if (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]) > least[s]:
                triangles.append((p, q, r))
                a.append(s)
                b.append(m)
    return np.array(triangles).reshape(-1, 3, 2), np.array(a, dtype=np.int64), np.array(b, dtype=np.int64)


def _frames(polygons: Flat) -> Array:
    """(f, 2, 3) two unit vectors in the plane of each polygon, anticlockwise about its normal."""
    first = polygons.corners[:, 1] - polygons.corners[:, 0]
    first -= np.einsum("fi,fi->f", first, polygons.normal)[:, None] * polygons.normal
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(polygons.normal, first)], axis=1)


def _to_reference(flat_corners: Array, places: Array) -> Array:
    """(t, 3, 2) reference coordinates of places (t, 3, 2) in facets with flat corners (t, c, 2)."""
    kind = "triangle" if flat_corners.shape[1] == 3 else "quad"
    at = np.broadcast_to(reference_nodes(kind).mean(axis=0), places.shape).copy()
    for _ in range(1 if kind == "triangle" else 12):
        N, dN, _ = facet_functions(kind, at.reshape(-1, 2))
        N, dN = N.reshape(*at.shape[:2], -1), dN.reshape(*at.shape[:2], 2, -1)
        J = np.einsum("tqak,tkb->tqba", dN, flat_corners)
        at += np.linalg.solve(J, (places - np.einsum("tqk,tkb->tqb", N, flat_corners))[..., None])[..., 0]
    return at


def cut(
    x: Array, reference: Array, slave_type: str, slave_facets: Indices, numbers: Indices, master_type: str,
    master_facets: Indices, turned: Array, far: float,
) -> tuple[Points, Indices, Indices]:  # fmt: skip
    """Quadrature points on the common parts of two sets of facets.

    Args:
        x: (n, 3) positions now. reference: (n, 3) positions that areas are counted in. numbers: (f, ks)
            of the slave's nodes. turned: (n, 3) positions of the master now. far: m, see `near_pairs`.

    Returns:
        The points, and the numbers (t,), (t,) of slave and master facet of every piece.
    """
    slave, master = flat(slave_type, slave_facets, x), flat(master_type, master_facets, turned)
    tri, i, j = _pieces(slave, master, *near_pairs(slave, master, 0.0, far))
    mine = np.einsum("fab,fcb->fca", _frames(slave), slave.corners - slave.centre[:, None])
    ends = _to_reference(mine[i], tri) if len(tri) else tri
    at, w = _fine_rule("triangle")
    L = np.column_stack([1 - at.sum(axis=1), at])
    xi = np.einsum("qk,tkd->tqd", L, ends)
    edges = ends[:, 1:] - ends[:, :1]
    size = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    flat_xi, q = xi.reshape(-1, 2), len(w)
    own, other = np.repeat(i, q), np.repeat(j, q)
    N, dN, _ = facet_functions(slave_type, flat_xi)
    t = np.einsum("pak,pki->pai", dN, reference[slave_facets[own]])
    weight = np.linalg.norm(np.cross(t[:, 0], t[:, 1]), axis=1) * (size[:, None] * w).ravel()
    start = np.broadcast_to(reference_nodes(corner_type(master_type)).mean(axis=0), flat_xi.shape)
    points = Points(
        master_type, slave_facets[own], master_facets[other], numbers[own], N,
        node_hats(slave_type, flat_xi), weight, start,
    )  # fmt: skip
    return points, i, j


def whole(reference: Array, slave_type: str, facets: Indices, numbers: Indices) -> Points:
    """Quadrature points of uncut facets, against a plane."""
    at, w = _fine_rule(corner_type(slave_type))
    N, dN, _ = facet_functions(slave_type, at)
    t = np.einsum("qak,fki->fqai", dN, reference[facets])
    weight = np.linalg.norm(np.cross(t[:, :, 0], t[:, :, 1]), axis=2) * w
    f, q = weight.shape
    own = np.repeat(np.arange(f), q)
    return Points(
        "", facets[own], np.zeros((f * q, 0), dtype=np.int64), numbers[own], np.tile(N, (f, 1)),
        np.tile(node_hats(slave_type, at), (f, 1)), weight.ravel(), np.zeros((f * q, 2)),
    )  # fmt: skip

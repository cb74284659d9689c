"""Constraints of a deck -> linear equations between displacements (`data.Ties`).

A node tied to a face moves as the face does at its nearest point, u = sum N_i u_i; it is laid there, so that rigid
motions stay free. A coupled node moves as u_r + theta x r with its reference node. A reference node that follows others
in the mean has the rigid motion that fits theirs best by weights, the static counterpart of which spreads its force
and moment over them (Abaqus' distributing coupling, Nastran's RBE3).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..data import Array, AverageLink, Equation, FaceTie, Guide, Indices, Links, Mesh, RigidLink, Ties
from ..errors import UserError
from ..frames import rigid_fields
from ..topology import FACET_CORNERS
from .discretise import face_blocks, shape_functions

NEAR = 0.05
"""Share of the size of a master's facets within which a node is tied where the deck gives no tolerance."""

_CANDIDATES = 8

_OTHERWISE = {FaceTie: "leave out", AverageLink: "another"}


@dataclass
class _Rows:
    """Rows as they are made: (r,) numbers of equal equations, columns, factors."""

    n: int
    row: list[Indices] = field(default_factory=list)
    column: list[Indices] = field(default_factory=list)
    factor: list[Array] = field(default_factory=list)
    dependent: list[Indices] = field(default_factory=list)
    of: list[int] = field(default_factory=list)
    count: int = 0

    def add(self, link: int, columns: Indices, factors: Array, dependent: Indices) -> None:
        """Equations (r, t) of t terms each."""
        r, t = columns.shape
        self.row.append(np.repeat(self.count + np.arange(r), t))
        self.column.append(columns.ravel())
        self.factor.append(factors.ravel())
        self.dependent.append(dependent)
        self.of += [link] * r
        self.count += r

    def dof(self, nodes: Indices | int, way: Indices | int) -> Indices:
        """Columns of a direction (0 to 5) of points and reference nodes."""
        nodes = np.asarray(nodes)
        return np.where(nodes < self.n, 3 * nodes + way, 3 * self.n + 6 * (nodes - self.n) + way)


def linked(mesh: Mesh) -> tuple[Mesh, list[str]]:
    """The mesh with the equations of its links, tied nodes laid on their faces, and what was tied in words.

    Raises:
        UserError: links without nodes, ties without partner, with their place in the file.
    """
    links = mesh.links
    if links is None or not links.items:
        return mesh, []
    rows, told = _Rows(mesh.n_points), []
    for number, link in enumerate(links.items):
        if isinstance(link, FaceTie):
            mesh, text = _tied_face(mesh, link, rows, number)
        else:
            text = _MAKERS[type(link)](mesh, link, rows, number)
        told.append(text)
    return replace(mesh, ties=_ties(mesh, links, rows)), told


def _ties(mesh: Mesh, links: Links, rows: _Rows) -> Ties:
    width = 3 * mesh.n_points + 6 * len(links.references)
    place = (np.concatenate(rows.row), np.concatenate(rows.column))
    matrix = sp.csr_matrix((np.concatenate(rows.factor), place), shape=(rows.count, width))
    matrix.eliminate_zeros()
    return Ties(
        matrix, np.concatenate(rows.dependent), np.array(rows.of), tuple(link.where for link in links.items),
        tuple(_OTHERWISE.get(type(link), "refuse") for link in links.items), links.references,
        np.concatenate([mesh.node_id, links.reference_id]), links.sets,
    )  # fmt: skip


def _position(mesh: Mesh, nodes: Indices) -> Array:
    """(m, 3) of points and reference nodes."""
    assert mesh.links is not None
    return np.concatenate([mesh.points, mesh.links.references])[nodes]


def _members(mesh: Mesh, link: RigidLink | AverageLink) -> Indices:
    """Nodes that a link takes in, without its reference node.

    Raises:
        UserError: there are none.
    """
    if not isinstance(link.members, str):
        found = link.members
    elif link.members in mesh.faces:
        found = mesh.face_points(link.members)
    else:
        raise UserError(f"{link.where} names '{link.members}', which is no face of the mesh")
    if not len(found := found[found != link.reference]):
        raise UserError(f"{link.where} couples no nodes to its reference node; name a surface or set that has some")
    return found


def _equation(mesh: Mesh, link: Equation, rows: _Rows, number: int) -> str:
    columns = rows.dof(link.nodes, link.directions)[None]
    if not link.factors.any():
        raise UserError(f"{link.where} has no factor but 0; correct or remove it")
    if link.first and not link.factors[0]:
        raise UserError(f"{link.where} has the factor 0 at its first term, which it is to give; put another one first")
    rows.add(number, columns, link.factors[None], columns[:, 0] if link.first else np.array([-1]))
    return f"{link.where}: {len(link.nodes)} terms"


def _rigid(mesh: Mesh, link: RigidLink, rows: _Rows, number: int) -> str:
    members = _members(mesh, link)
    r = _position(mesh, members) - _position(mesh, np.array([link.reference]))
    axes = np.eye(3) if link.axes is None else link.axes
    for way in ["xyz".index(c) for c in link.directions if c in "xyz"]:
        moment = np.cross(r, axes[way])  # e (theta x r) = theta (r x e)
        _along(rows, number, members, link.reference, axes[way], moment)
    turning = members[members >= mesh.n_points]
    for way in ["abc".index(c) for c in link.directions if c in "abc"]:
        _along(rows, number, turning, link.reference, axes[way], None)
    return f"{link.where}: {len(members)} nodes follow node {_number(mesh, link.reference)}"


def _along(
    rows: _Rows, number: int, members: Indices, reference: int, e: Array, moment: Array | None
) -> None:
    """e u_m = e u_r + moment theta_r of members; without moments (m, 3) the same of their rotations.

    An equation gives the member's own displacement where e is an axis of the body, else any.
    """
    first, ways = (3 if moment is None else 0), [int(w) for w in np.flatnonzero(np.abs(e) > 1e-15)]
    of = np.full(len(members), reference)
    own = np.column_stack([rows.dof(members, first + w) for w in ways])
    columns, factors = [own, *(rows.dof(of, first + w)[:, None] for w in ways)], [e[ways], -e[ways]]
    table = np.tile(np.concatenate(factors), (len(members), 1))
    if moment is not None:
        columns += [rows.dof(of, 3 + w)[:, None] for w in range(3)]
        table = np.hstack([table, -moment])
    plain = len(ways) == 1
    rows.add(number, np.hstack(columns), table, own[:, 0] if plain else np.full(len(members), -1))


def _guide(mesh: Mesh, link: Guide, rows: _Rows, number: int) -> str:
    first = 3 if link.turning else 0
    columns = np.column_stack([rows.dof(link.nodes, first + way) for way in range(3)])
    rows.add(number, columns, link.axes, np.full(len(columns), -1))
    what = "rotations" if link.turning else "displacements in skewed directions"
    return f"{link.where}: {len(columns)} {what} are zero"


def _average(mesh: Mesh, link: AverageLink, rows: _Rows, number: int) -> str:
    members = _members(mesh, link)
    weights = _weights(mesh, link, members)
    origin = _position(mesh, np.array([link.reference]))
    fields = rigid_fields(_position(mesh, members), origin[0])
    size = max(float(np.abs(_position(mesh, members) - origin).max()), 1e-300)
    scaled = fields / np.array([1, 1, 1, size, size, size])
    gram = np.einsum("mij,mic,mjd->cd", weights, scaled, scaled)
    values, V = np.linalg.eigh(gram)
    ways = ["xyzabc".index(c) for c in link.directions]
    if values[0] < 1e-12 * values[-1] and set(ways) & {3, 4, 5}:
        raise UserError(
            f"{link.where} couples {len(members)} nodes on a line, which tell no rotation about it; add nodes beside "
            "it, or couple displacements alone"
        )
    inverse = (V[:, values > 1e-12 * values[-1]] / values[values > 1e-12 * values[-1]]) @ V.T[
        values > 1e-12 * values[-1]
    ]
    known = inverse @ gram  # projects on the rigid motions that the members tell
    single = link.weights is not None and link.weights.ndim == 3
    if single and np.abs(known - np.eye(6))[ways].max() > 1e-6:
        raise UserError(
            f"{link.where} follows its nodes in directions that do not tell all of its motion; add some to it"
        )
    fit = np.einsum("cd,mij,mjd->cmi", inverse, weights, scaled) / np.array([1, 1, 1, size, size, size])[:, None, None]
    own = rows.dof(np.repeat(members, 3), np.tile(np.arange(3), len(members)))
    axes = np.eye(3) if link.axes is None else link.axes
    for way in ways:
        first, e = way - way % 3, axes[way % 3]
        moved = rows.dof(np.full(3, link.reference), first + np.arange(3))
        factors = np.concatenate([-e, np.einsum("k,kmi->mi", e, fit[first : first + 3]).ravel()])
        given = rows.dof(np.array([link.reference]), way)
        if link.axes is not None:
            given = np.full(1, -1)
        rows.add(number, np.concatenate([moved, own])[None], factors[None], given)
    return f"{link.where}: node {_number(mesh, link.reference)} follows {len(members)} nodes in the mean"


def _weights(mesh: Mesh, link: AverageLink, members: Indices) -> Array:
    """(m, 3, 3) weights as given, or the tributary areas int N_i dA of a face's nodes, m2.

    Raises:
        UserError: areas of what is no face, weights that add up to nothing.
    """
    if link.weights is not None and not isinstance(link.members, str):
        kept = link.members != link.reference
        weights = np.asarray(link.weights, dtype=float)
        if weights.ndim == 3:
            weights = weights[kept]
            if not np.trace(weights.sum(axis=0)) > 0:
                raise UserError(f"{link.where} has weights whose sum is not above 0; correct them")
            return weights
        weights = np.broadcast_to(weights, len(kept))[kept]
    elif isinstance(link.members, str) and link.members in mesh.faces:
        area = np.zeros(mesh.n_points)
        for block in face_blocks(mesh, link.members):
            np.add.at(area, block.facets, np.linalg.norm(block.area, axis=2) @ block.N)
        weights = area[members]
    else:
        raise UserError(f"{link.where} weighs nodes by areas of '{link.members}', which is no face of the mesh")
    if not weights.sum() > 0:
        raise UserError(f"{link.where} has weights whose sum is not above 0; correct them")
    return weights[:, None, None] * np.eye(3)


def _number(mesh: Mesh, node: int) -> int:
    assert mesh.links is not None
    return int(np.concatenate([mesh.node_id, mesh.links.reference_id])[node])


_MAKERS: dict[type, Callable[[Mesh, Any, _Rows, int], str]] = {
    Equation: _equation, RigidLink: _rigid, AverageLink: _average, Guide: _guide,
}  # fmt: skip


# nodes on faces ------------------------------------------------------------------------------------------------------


def _tied_face(mesh: Mesh, link: FaceTie, rows: _Rows, number: int) -> tuple[Mesh, str]:
    """Rows of a tie, and the mesh with its nodes laid on the master face."""
    for name, needed in ((link.slave, "slave"), (link.master, "master")):
        if name not in mesh.faces and (needed == "master" or name not in mesh.point_sets):
            inside = " on the surface" if name in mesh.inner else ""
            raise UserError(f"{link.where} names the {needed} '{name}', which is no face{inside} of the mesh")
    master = mesh.face_points(link.master)
    slaves = np.setdiff1d(mesh.set_points(link.slave), master)
    if not len(slaves):
        raise UserError(f"{link.where}: every node of '{link.slave}' is one of '{link.master}' already; remove the tie")
    size = facet_size(mesh, link.master)
    reach = NEAR * size if link.tolerance is None else link.tolerance
    distance, nodes, N, foot = nearest_on_face(mesh.points, mesh.faces[link.master], mesh.points[slaves])
    near = distance <= reach * (1 + 1e-9)
    if not near.any():
        raise UserError(
            f"{link.where}: no node of '{link.slave}' lies within {reach:.3g} m of '{link.master}' (the nearest at "
            f"{distance.min():.3g} m); correct the surfaces or give POSITION TOLERANCE"
        )
    for way in range(3):
        own = rows.dof(slaves[near], way)
        columns = np.column_stack([own, rows.dof(nodes[near], way)])
        rows.add(number, columns, np.column_stack([np.ones(near.sum()), -N[near]]), own)
    points = mesh.points.copy()
    points[slaves[near]] = foot[near]
    text = f"{link.where}: {near.sum()} nodes of '{link.slave}' tied to '{link.master}'"
    if not near.all():
        text += f", {(~near).sum()} lie farther than {reach:.3g} m and are left free"
    if distance[near].max() > 1e-6 * size:
        text += f"; laid on it, moved by up to {distance[near].max():.3g} m"
    return replace(mesh, points=points), text


def facet_size(mesh: Mesh, face: str) -> float:
    """Mean length of the edges of a face's facets, m."""
    lengths = []
    for kind, facets in mesh.faces[face].items():
        corners = mesh.points[facets[:, : FACET_CORNERS[kind]]]
        lengths.append(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).ravel())
    return float(np.concatenate(lengths).mean())


def nearest_on_face(points: Array, face: Mapping[str, Indices], x: Array) -> tuple[Array, Indices, Array, Array]:
    """The nearest points of a curved face to points x (m, 3).

    Returns:
        (m,) distances, (m, k) nodes of the facet that has the nearest point, (m, k) shape functions there (0 for
        nodes that fill up), (m, 3) the nearest points.
    """
    width = max(f.shape[1] for f in face.values())
    best = np.full(len(x), np.inf)
    nodes, N, foot = np.zeros((len(x), width), dtype=np.int64), np.zeros((len(x), width)), np.zeros((len(x), 3))
    for kind, facets in face.items():
        count = min(_CANDIDATES, len(facets))
        _, near = cKDTree(points[facets].mean(axis=1)).query(x, k=count)
        near = np.reshape(near, (len(x), count))
        for column in near.T:
            own = facets[column]
            shape, at = _foot(kind, points[own], x)
            distance = np.linalg.norm(at - x, axis=1)
            closer = distance < best * (1 - 1e-9)
            best[closer], foot[closer] = distance[closer], at[closer]
            k = own.shape[1]
            nodes[closer], N[closer] = own[closer][:, :1], 0.0
            nodes[closer, :k], N[closer, :k] = own[closer], shape[closer]
    return best, nodes, N, foot


def _foot(kind: str, corners: Array, x: Array) -> tuple[Array, Array]:
    """Shape functions (m, k) and place (m, 3) of the nearest point of each facet (m, k, 3), by Gauss-Newton steps."""
    triangle = FACET_CORNERS[kind] == 3
    at = np.full((len(x), 2), 1 / 3 if triangle else 0.5)
    for _ in range(30):
        N, dN = shape_functions(kind, at)
        miss = x - np.einsum("mk,mki->mi", N, corners)
        J = np.einsum("mjk,mki->mij", dN, corners)
        JJ = np.einsum("mij,mil->mjl", J, J)
        step = np.linalg.solve(JJ, np.einsum("mij,mi->mj", J, miss)[..., None])[..., 0]
        moved = _inside(at + step, triangle)
        change = np.abs(moved - at).max(initial=0.0)
        at = moved
        if change < 1e-14:
            break
    at = np.round(at, 13)  # a node on a node is that node
    N, _ = shape_functions(kind, at)
    N[np.abs(N) < 1e-12] = 0.0
    return N, np.einsum("mk,mki->mi", N, corners)


def _inside(at: Array, triangle: bool) -> Array:
    """The nearest coordinates within the reference facet."""
    at = np.clip(at, 0.0, 1.0)
    if triangle:
        over = np.maximum(at.sum(axis=1) - 1, 0.0)[:, None]
        at = np.clip(at - over / 2, 0.0, 1.0)
    return at

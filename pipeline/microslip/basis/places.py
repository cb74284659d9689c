"""Where a modal file says that its patches, loads and read-outs stand, against its own mesh and shapes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError

from ..data import CENTRIFUGAL, Array, Indices, Interface, Mesh, ModalBasis, ModalGroup, Rows, StressSet
from ..modal.rows import Location, Locator
from ..reduced.coordinates import fit_residual
from .integrals import face_mean, shape_functions, tables

NEAR = 1e-9
"""Of the body's size: what places may be off by."""


def face_of(mesh: Mesh, item: Interface) -> Mapping[str, Indices]:
    """Facets of the face that has the area and the centre of a patch; none where there is no such face."""
    for face in mesh.faces.values():
        area, centre, _ = face_mean(mesh.points, face, np.zeros((mesh.n_points, 0)))
        near = np.abs(centre - item.origin).max() < 1e-9 * np.sqrt(area)
        if near and abs(area / item.areas.sum() - 1) < 1e-9:
            return face
    return {}


def normals_error(mesh: Mesh, item: Interface, face: Mapping[str, Indices]) -> float:
    """Largest error of the normals of a patch: against the facets whose node order tells what is outside, or, of
    points without facets, against the frame."""
    if not face:
        return float(np.abs(item.normals - item.rotation[0]).max(initial=0.0))
    points, normals = (np.concatenate(parts) for parts in zip(*_surface(mesh, face), strict=True))
    away, nearest = KDTree(points).query(item.points)
    if away.max(initial=0.0) > NEAR * np.ptp(mesh.points, axis=0).max():
        return np.inf
    return float(np.abs(item.normals - normals[nearest]).max(initial=0.0))


def _surface(mesh: Mesh, face: Mapping[str, Indices]) -> Iterator[tuple[Array, Array]]:
    """Quadrature points (p, 3) and outward unit normals (p, 3) of a face, one type of facets at a time."""
    for kind, facets in face.items():
        N, dN, _ = tables(kind)
        tangents = np.einsum("qdk,fki->fqdi", dN, mesh.points[facets])
        normal = np.cross(tangents[:, :, 0], tangents[:, :, 1]).reshape(-1, 3)
        at = np.einsum("qk,fki->fqi", N, mesh.points[facets]).reshape(-1, 3)
        yield at, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def outline_error(mesh: Mesh, item: Interface, face: Mapping[str, Indices]) -> float:
    """How far corners of a polygon are from nodes of its face, and its area and its extents along t1 and t2 from those
    of the nodes, each over its own size."""
    nodes = item.points
    if face:
        nodes = mesh.points[np.unique(np.concatenate([f.ravel() for f in face.values()]))]
    flat = nodes @ item.rotation[1:].T
    size = max(np.ptp(flat, axis=0).max(), 1e-300)  # one point has none
    wrong = float(np.abs(np.ptp(flat, axis=0) - item.extent).max() / size)
    if not len(item.polygon):
        return wrong
    off = float(KDTree(nodes).query(item.polygon)[0].max() / size)
    x, y = (item.polygon @ item.rotation[1:].T).T
    area = (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2  # positive: anticlockwise about n
    try:
        whole = ConvexHull(flat).volume
    except QhullError:
        return np.inf
    return max(wrong, off, 1e-3 * abs(float(area / whole) - 1))  # points along a side are no corners


def misfit_error(item: Interface) -> float:
    """Largest error of the share of a patch's motion that its own six rows leave, where its shapes are kept."""
    if not len(item.shapes):
        return 0.0
    share = fit_residual(item, item.shapes, item.rows)
    return float(np.abs(share - item.fit_residual).max(initial=0.0))


def turning_error(item: Interface) -> float:
    """Largest error of the three rotations of a patch against the best rigid fit of its shapes, over
    the largest; 0 where they are not kept, or its points lie on a line."""
    r = item.points - item.origin
    second = np.einsum("p,pi,pj->ij", item.areas, r, r)
    J = np.trace(second) * np.eye(3) - second
    if not len(item.shapes) or np.linalg.cond(J) > 1e9:
        return 0.0
    turned = np.cross(r[:, :, None], item.shapes, axis=1)
    fit = item.rotation @ np.linalg.solve(J, np.tensordot(item.areas, turned, axes=1))
    return float(np.abs(fit - item.rows[3:]).max() / max(float(np.abs(fit).max()), 1e-300))


def set_error(mesh: Mesh, places: StressSet) -> float:
    """How far places of strains are from points of the cells' rules, or from nodes, over the size of the body."""
    points = [mesh.points]
    if places.location == "gauss":
        points = [np.einsum("qk,eki->eqi", tables(k)[0], mesh.points[c]).reshape(-1, 3) for k, c in mesh.cells.items()]
    away = KDTree(np.concatenate(points)).query(places.points)[0]
    return float(away.max(initial=0.0) / np.ptp(mesh.points, axis=0).max())


@lru_cache(maxsize=1)
def _locator(mesh: Mesh) -> Locator:
    return Locator(mesh, shape_functions)


@lru_cache(maxsize=32)
def _around(mesh: Mesh, point: tuple[float, ...]) -> list[Location]:
    """The point in every cell that holds it: the same one in all groups of a file."""
    return _locator(mesh).around(np.array(point))


class Places:
    """Loads and read-outs of a group against the shapes where they are said to be."""

    def __init__(self, basis: ModalBasis) -> None:
        self.basis, self.mesh = basis, basis.mesh
        self.size = np.ptp(basis.mesh.points, axis=0).max()

    def monitor_error(self, g: ModalGroup, rows: Rows) -> float:
        """Largest difference of displacements from those of the shapes at the point, and from the static one. The mean
        angle of several points is not told of one: their middle has to be within reach of the body."""
        axes = ["xyz".find(label[-1]) for label in rows.labels if label[:2] == "u_"]
        if len(axes) != len(rows.labels):
            return self._beyond(rows.point)
        fields = np.concatenate([g.phi, g.u_static[:, :, None]], axis=2)
        read = np.column_stack([rows.rows, rows.static]) if len(rows.static) else rows.rows
        scale = np.maximum(np.abs(fields).max(axis=(0, 1)), 1e-300)[: read.shape[1]]
        places = _around(self.mesh, tuple(rows.point))
        at = (place.N @ fields[place.nodes].reshape(len(place.nodes), -1) for place in places)
        errors = (np.abs((u.reshape(3, -1)[axes, : read.shape[1]] - read) / scale).max() for u in at)
        return float(min(errors, default=np.inf))

    def load_error(self, g: ModalGroup, rows: Rows) -> float:
        """How far a load is from a unit force at its point, along any direction, or spread over a face or a set with
        this centre; of a pressure and of centrifugal force how far the centre is, over the size of the body."""
        if rows.unit == CENTRIFUGAL:
            return float(np.abs(rows.point - self.basis.centre).max() / self.size)
        faces = [face_mean(self.mesh.points, f, g.phi)[1:] for f in self.mesh.faces.values()]
        sets = [(self.mesh.points[s].mean(axis=0), g.phi[s].mean(axis=0)) for s in self.mesh.point_sets.values()]
        if rows.labels == ("pressure",):
            return min((float(np.abs(at - rows.point).max() / self.size) for at, _ in faces), default=np.inf)
        moved = [u for at, u in (*faces, *sets) if np.abs(at - rows.point).max() < NEAR * self.size]
        moved += [np.tensordot(p.N, g.phi[p.nodes], axes=1) for p in _around(self.mesh, tuple(rows.point))]
        return min((_along(u, rows.rows[0]) for u in moved), default=np.inf)

    def gauge_error(self, g: ModalGroup, rows: Rows) -> float:
        """How far a gauge's strains are from those of the shapes at its point along any one direction, over the
        largest there; of few modes how far beyond the principal ones."""
        places = _around(self.mesh, tuple(rows.point))
        return min((_strain_error(g, place, rows, self.size) for place in places), default=np.inf)

    def _beyond(self, point: Array) -> float:
        low, high = self.mesh.points.min(axis=0), self.mesh.points.max(axis=0)
        return float(np.maximum(low - point, point - high).max(initial=0.0) / self.size)


def _along(u: Array, row: Array) -> float:
    """What the best unit direction leaves of a row, with how far its length is from 1: u (3, m), row (m,)."""
    A, b = (np.concatenate([x.real, x.imag], axis=-1) for x in (u, row))
    d = np.linalg.lstsq(A.T, b, rcond=1e-12)[0]
    known = np.linalg.matrix_rank(A, tol=1e-9 * max(np.abs(A).max(), 1e-300)) == 3
    left = float(np.abs(d @ A - b).max() / max(np.abs(A).max(), 1e-300))
    return max(left, abs(float(np.linalg.norm(d)) - 1) if known else 0.0)


def _strain_error(g: ModalGroup, place: Location, rows: Rows, extent: float) -> float:
    """See `Places.gauge_error`: strain d . (1 + H)^T grad(u) d, H = grad(u_static) of a nonlinear equilibrium."""
    slopes = np.einsum("bk,kam->abm", place.grad, g.phi[place.nodes])
    H = np.einsum("bk,ka->ab", place.grad, g.u_static[place.nodes]) * (g.prestress == "nonlinear")
    slopes = np.einsum("ca,cbm->abm", np.eye(3) + H, slopes)
    parts = np.concatenate([slopes.real, slopes.imag], axis=2)
    strain = (parts + parts.transpose(1, 0, 2)) / 2
    read = np.concatenate([rows.rows[0].real, rows.rows[0].imag])
    rigid = float(np.abs(g.phi).max(initial=0.0)) / extent  # whose motions strain nothing
    size = max(float(np.abs(strain).max()), rigid, 1e-300)
    index = np.triu_indices(3)
    equations = strain[index].T * np.where(index[0] == index[1], 1.0, 2.0) / size
    equations = np.vstack([equations, (index[0] == index[1]).astype(float)])  # a direction has length 1
    if np.linalg.matrix_rank(equations, tol=1e-5) < 6:
        principal = np.linalg.eigvalsh(strain.transpose(2, 0, 1))
        return float(np.maximum(principal[:, 0] - read, read - principal[:, 2]).max() / size)
    D = np.zeros((3, 3))
    D[index] = np.linalg.lstsq(equations, np.append(read / size, 1.0), rcond=None)[0]
    d = np.linalg.eigh(D + D.T - np.diag(np.diag(D)))[1][:, 2]
    return float(np.abs(np.einsum("a,abm,b->m", d, strain, d) - read).max() / size)

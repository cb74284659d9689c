"""Rows on the nodal displacements: interfaces, loads, monitors, gauges.

A row set is a sparse matrix B (r, 3n) on u = (u_x1, u_y1, u_z1, u_x2, ...): ``B @ u`` reads, ``B.T @ f`` loads.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from scipy.optimize import lsq_linear, nnls
from scipy.spatial import ConvexHull, QhullError

from ..data import Array, Indices, Mesh
from ..errors import UserError
from ..fem.discretise import face_blocks, shape_functions
from ..frames import skew
from ..topology import CELL_TYPES, CellType


@dataclass(frozen=True)
class Patch:
    """A contact or load face as rows.

    Attributes:
        origin: (3,) area centre, m. rotation: (3, 3) rows n, t1, t2. B: (6, 3n) area-weighted rigid fit in that
            frame. points: (p, 3) m. areas: (p,) m2. normals: (p, 3). N: (p, n) shape functions at the points.
        characteristic: (c, 3n) rows of characteristic coordinates, pattern: (p, 3, c) what one of them moves, if any.
    """

    origin: Array
    rotation: Array
    B: sp.csr_matrix
    points: Array
    areas: Array
    normals: Array
    N: sp.csr_matrix
    extent: Array
    polygon: Array
    characteristic: sp.csr_matrix | None = None
    pattern: Array = field(default_factory=lambda: np.zeros((0, 3, 0)))

    def moved(self, phi: Array) -> Array:
        """(p, 3, m) motion of the patch's points of shapes (n, 3, m)."""
        return (self.N @ phi.reshape(len(phi), -1)).reshape(len(self.points), 3, -1)

    def fit_residual(self, phi: Array) -> Array:
        """(m,) share of the patch's motion that no rigid motion explains, for shapes (n, 3, m)."""
        u = self.moved(phi)
        rigid = self.B @ phi.reshape(-1, phi.shape[2])
        t = self.rotation.T @ rigid[:3]
        w = self.rotation.T @ rigid[3:]
        r = self.points - self.origin
        fit = t[None] + np.cross(w.T[:, None, :], r[None], axis=2).transpose(1, 2, 0)
        left = np.sqrt(np.einsum("p,pim->m", self.areas, np.abs(u - fit) ** 2))
        whole = np.sqrt(np.einsum("p,pim->m", self.areas, np.abs(u) ** 2))
        return np.divide(left, whole, out=np.zeros_like(left), where=whole > 0)


def patch(mesh: Mesh, face: str, t2: Array | None, name: str, needs_frame: bool = True) -> Patch:
    """Area-weighted, work-conjugate rigid fit of a face (Sextro Eqs. (5.1-6), (5.1-8)).

    The six rows minimise the area integral of |u - t - w x r|^2, so a rigid motion is reproduced exactly and
    ``B.T f`` is the linear traction field with resultant f.

    Args:
        t2: direction whose projection on the face becomes the second tangent; None: z, or y where z is the
            normal. name: for messages.
        needs_frame: whether a face without a mean normal (a bore) is refused; else it gets the body's axes.

    Raises:
        UserError: t2 along the normal; no mean normal; a patch whose points lie on a line.
    """
    blocks = face_blocks(mesh, face)
    points = np.concatenate([b.points.reshape(-1, 3) for b in blocks])
    vectors = np.concatenate([b.area.reshape(-1, 3) for b in blocks])
    areas = np.linalg.norm(vectors, axis=1)
    N = _interpolation(mesh.n_points, [(b.facets, b.N) for b in blocks])
    normal = vectors.sum(axis=0)
    closed = bool(np.linalg.norm(normal) < 1e-6 * areas.sum())
    rotation = np.eye(3) if closed and not needs_frame else _frame(normal, t2, areas, name)
    nodes = mesh.points[mesh.face_points(face)]
    return _fitted(nodes, points, vectors / areas[:, None], areas, N, rotation, closed, (name, face))


def node_patch(mesh: Mesh, name_of_set: str, t2: Array | None, normal: Array | None, name: str) -> Patch:
    """The evenly weighted rigid fit of a list of nodes, each with its share of the area that they span.

    Args:
        normal: outwards; None: that of the plane through the nodes, away from the middle of all nodes.
            t2, name: as for `patch`.

    Raises:
        UserError: nodes on a line; nodes that are not flat and no normal given.
    """
    at = mesh.face_points(name_of_set)
    points = mesh.points[at]
    if len(points) == 1:
        return _single(mesh, int(at[0]), t2, normal, name)
    n = _plane_normal(points, mesh.points.mean(axis=0), name, name_of_set) if normal is None else normal
    rotation = _frame(np.asarray(n, dtype=float), t2, np.zeros(1), name)
    try:
        area = ConvexHull((points - points[0]) @ rotation[1:].T).volume
    except QhullError:
        area = 0.0
    if not area > 0:
        raise UserError(
            f"interface '{name}': the {len(points)} nodes of '{name_of_set}' lie on a line, so it has no rotation; "
            "name nodes that span an area"
        )
    count = len(points)
    N = sp.csr_matrix((np.ones(count), (np.arange(count), at)), shape=(count, mesh.n_points))
    normals = np.broadcast_to(rotation[0], points.shape).copy()
    return _fitted(points, points, normals, np.full(count, area / count), N, rotation, False, (name, name_of_set))


def _single(mesh: Mesh, node: int, t2: Array | None, normal: Array | None, name: str) -> Patch:
    """A patch of one node, of unit weight; its rows are those of the node itself and are put in by the caller."""
    if normal is None:
        raise UserError(f"interfaces.{name}.normal: a single node does not tell which way is outwards; give normal")
    rotation = _frame(np.asarray(normal, dtype=float), t2, np.zeros(1), name)
    n, point = mesh.n_points, mesh.points[[node]]
    N = sp.csr_matrix(([1.0], ([0], [node])), shape=(1, n))
    B = sp.csr_matrix((6, 3 * n))
    return Patch(point[0], rotation, B, point, np.ones(1), rotation[:1], N, np.zeros(2), np.zeros((0, 3)))


def _plane_normal(points: Array, middle: Array, name: str, name_of_set: str) -> Array:
    """Normal of the plane nearest to some points, away from `middle`."""
    centre = points.mean(axis=0)
    size, axes = np.linalg.eigh((points - centre).T @ (points - centre))
    n = axes[:, 0]
    if size[0] > 0.02 * size[1] or abs(n @ (centre - middle)) < 1e-3 * np.linalg.norm(centre - middle):
        raise UserError(
            f"interfaces.{name}.normal: the nodes of '{name_of_set}' do not tell which way is outwards; give normal"
        )
    return n * np.sign(n @ (centre - middle))


def _fitted(
    nodes: Array, points: Array, normals: Array, areas: Array, N: sp.csr_matrix, rotation: Array, closed: bool,
    names: tuple[str, str],
) -> Patch:  # fmt: skip
    """The rows of a patch from its weighted points (p, 3) and the interpolation (p, n) to them."""
    name, face = names
    total = areas.sum()
    origin = areas @ points / total
    r = points - origin
    second = np.einsum("p,pi,pj->ij", areas, r, r)
    J = np.trace(second) * np.eye(3) - second
    if np.linalg.cond(J) > 1e9:
        raise UserError(
            f"interface '{name}': the points of face '{face}' lie on a line, so it has no rotation; "
            "pick a face with area"
        )
    # weights (6, p, 3): translation and J^-1 (r x u), turned into the interface frame
    W = np.empty((6, len(points), 3))
    W[:3] = rotation[:, None, :] * (areas / total)[None, :, None]
    cross = np.array([skew(v) for v in r])  # r x u = cross @ u
    W[3:] = np.einsum("ij,pjk->ipk", rotation @ np.linalg.inv(J), cross) * areas[None, :, None]
    B = sp.vstack([_expand(N, W[i]) for i in range(6)]).tocsr()
    extent = np.ptp(nodes @ rotation[1:].T, axis=0)
    polygon = np.zeros((0, 3)) if closed else _outline(nodes, rotation)
    return Patch(origin, rotation, B, points, areas, normals, N, extent, polygon)


def _outline(nodes: Array, rotation: Array) -> Array:
    """(k, 3) corners of the convex hull of points seen along the first row of `rotation`, anticlockwise."""
    flat = nodes @ rotation[1:].T
    hull = ConvexHull(flat).vertices
    corners = flat[hull]
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    sharp = turn > 1e-6 * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)  # not points along a side
    return nodes[hull[sharp]]


def _frame(normal: Array, t2: Array | None, areas: Array, name: str) -> Array:
    if np.linalg.norm(normal) <= 1e-6 * areas.sum():
        raise UserError(f"interface '{name}': the face closes on itself and has no mean normal; split it")
    n = normal / np.linalg.norm(normal)
    if t2 is None:
        t2 = np.eye(3)[1 if np.linalg.norm(n[:2]) < 1e-3 else 2]
    t2 = np.asarray(t2, dtype=float)
    flat = t2 - n * (n @ t2)
    if np.linalg.norm(flat) < 1e-3 * np.linalg.norm(t2):
        raise UserError(
            f"interfaces.{name}.t2: {t2.tolist()} is along the normal of the face; choose a direction in its plane"
        )
    t2 = flat / np.linalg.norm(flat)
    return np.array([n, np.cross(t2, n), t2])


def _interpolation(n: int, parts: list[tuple[Indices, Array]]) -> sp.csr_matrix:
    """(p, n) shape functions of facets (f, k) at quadrature points (q, k), p running over f then q."""
    rows, cols, values, start = [], [], [], 0
    for facets, N in parts:
        f, k = facets.shape
        q = len(N)
        rows.append(np.repeat(start + np.arange(f * q), k))
        cols.append(np.repeat(facets, q, axis=0).ravel())
        values.append(np.tile(N, (f, 1)).ravel())
        start += f * q
    shape = (start, n)
    return sp.csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))), shape=shape)


def _expand(N: sp.csr_matrix, weights: Array) -> sp.csr_matrix:
    """(1, 3n) row  sum_p weights_p . u(x_p)."""
    nodal = N.T @ weights
    return sp.csr_matrix(nodal.reshape(1, -1))


@dataclass(frozen=True)
class Location:
    """Where a point lies in the mesh.

    Attributes:
        nodes: (k,) points of its cell. N: (k,). grad: (3, k) 1/m. point: (3,) m, the place used.
        distance: m from the place asked for (0 inside).
    """

    nodes: Indices
    N: Array
    grad: Array
    point: Array
    distance: float


@dataclass
class Locator:
    """Finds the cell and reference coordinates of points (Newton on the curved map, nearest boxes first)."""

    mesh: Mesh
    shapes: Callable[[str, Array], tuple[Array, Array]] = shape_functions
    _first: list[int] = field(default_factory=list)  # number of the first cell of each type
    _low: Array = field(default_factory=lambda: np.zeros((0, 3)))
    _high: Array = field(default_factory=lambda: np.zeros((0, 3)))
    _middle: dict[str, tuple[Array, tuple[Array, Array]]] = field(default_factory=dict)
    """Where Newton's iteration begins in each type of cell, and the shape functions there."""

    def __post_init__(self) -> None:
        low: list[Array] = []
        high: list[Array] = []
        for cell_type, cells in self.mesh.cells.items():
            kind = CELL_TYPES[cell_type]
            middle = kind.reference[: kind.corners].mean(axis=0)
            self._middle[cell_type] = middle, self.shapes(cell_type, middle[None])
            self._first.append(sum(len(boxes) for boxes in low))
            first, last = self.mesh.points[cells].min(axis=1), self.mesh.points[cells].max(axis=1)
            # the sides of a quadratic cell may bulge beyond its nodes, by an eighth of their second difference
            bulge = 0.1 * (last - first).max(axis=1, keepdims=True) * (kind.order > 1)
            low.append(first - bulge)
            high.append(last + bulge)
        self._low, self._high = np.concatenate(low), np.concatenate(high)

    def around(self, point: Array) -> list[Location]:
        """The point in every cell that holds it: several where it lies on a side."""
        near = 1e-9 * np.ptp(self.mesh.points, axis=0).max()
        boxed = ((self._low - near <= point) & (point <= self._high + near)).all(axis=1)
        places = [self._in_cell(*self._cell(int(i)), point) for i in np.flatnonzero(boxed)]
        return [place for place in places if place.distance <= near]

    def find(self, point: Array, what: str) -> Location:
        """Locate a point; if it is outside, the nearest place of the body.

        Raises:
            UserError: further from the body than 2 % of the body's size.
        """
        point = np.asarray(point, dtype=float)
        away = np.linalg.norm(np.maximum(np.maximum(self._low - point, point - self._high), 0.0), axis=1)
        middle = np.linalg.norm(self._low + self._high - 2 * point, axis=1)
        best: Location | None = None
        for cell in np.lexsort((middle, away)):
            if best is not None and away[cell] >= best.distance:
                break  # no later box is nearer
            found = self._in_cell(*self._cell(int(cell)), point)
            if best is None or found.distance < best.distance - 1e-15:
                best = found
            if best.distance == 0.0:
                return best
        assert best is not None
        size = np.ptp(self.mesh.points, axis=0).max()
        if best.distance > 0.02 * size:
            raise UserError(
                f"{what}: the point {point.tolist()} m lies {best.distance:.4g} m outside the body (nearest place "
                f"{best.point.round(6).tolist()} m); correct it, or check length_unit"
            )
        return best

    def _cell(self, number: int) -> tuple[str, Indices]:
        block = bisect_right(self._first, number) - 1
        cell_type = list(self.mesh.cells)[block]
        return cell_type, self.mesh.cells[cell_type][number - self._first[block]]

    def _in_cell(self, cell_type: str, nodes: Indices, point: Array) -> Location:
        kind = CELL_TYPES[cell_type]
        x = self.mesh.points[nodes]
        xi, (N, dN) = self._middle[cell_type]
        for _ in range(25):
            J, before = (dN[0] @ x).T, xi
            xi = _into_cell(J, xi + np.linalg.lstsq(J, point - N[0] @ x, rcond=None)[0], kind)
            N, dN = self.shapes(cell_type, xi[None])
            if np.abs(xi - before).max() < 1e-13:
                break
        place = N[0] @ x
        distance = float(np.linalg.norm(point - place))
        if distance < 1e-9 * np.ptp(x, axis=0).max():
            distance = 0.0
        return Location(nodes, N[0], np.linalg.solve(dN[0] @ x, dN[0]), place, distance)


def _into_cell(J: Array, xi: Array, kind: CellType) -> Array:
    """Reference coordinates inside the cell whose image under J is nearest to that of xi (distance in space)."""
    if _inside(xi, kind.corners):
        return xi
    if kind.corners == 8:
        return lsq_linear(J, J @ xi, bounds=(0.0, 1.0), method="bvls").x
    # the mean of the corners with weights w >= 0; the heavy last row makes their sum 1
    corners = kind.reference[: kind.corners]
    A = J @ (corners - xi).T
    heavy = 1e6 * np.abs(A).max()
    w = nnls(np.vstack([A, np.full(len(corners), heavy)]), np.array([0.0, 0.0, 0.0, heavy]))[0]
    return w @ corners / w.sum()


def _inside(xi: Array, corners: int) -> bool:
    x, y, z = xi
    if (xi < 0).any():
        return False
    if corners == 8:
        return bool((xi <= 1).all())
    if corners == 6:
        return bool(x + y <= 1 and z <= 1)
    if corners == 5:
        return bool(max(abs(2 * x - 1), abs(2 * y - 1)) <= 1 - z)
    return bool(x + y + z <= 1)


@dataclass
class NodeLocator:
    """Finds the nearest of a body's nodes, where its cells are not known."""

    mesh: Mesh

    def find(self, point: Array, what: str) -> Location:
        """The node nearest to a point.

        Raises:
            UserError: further away than 2 % of the body's size.
        """
        away = np.linalg.norm(self.mesh.points - point, axis=1)
        nearest = int(away.argmin())
        size = np.ptp(self.mesh.points, axis=0).max()
        if away[nearest] > 0.02 * size:
            raise UserError(
                f"{what}: the node nearest to {np.asarray(point).tolist()} m lies {away[nearest]:.4g} m away (node "
                f"{self.mesh.node_id[nearest]}); give a node by its number, or check length_unit"
            )
        return at_node(self.mesh, nearest, float(away[nearest]))


def at_node(mesh: Mesh, position: int, distance: float = 0.0) -> Location:
    """The place of a node (without gradients)."""
    return Location(np.array([position]), np.ones(1), np.zeros((3, 1)), mesh.points[position], distance)


def point_rows(n: int, place: Location, directions: Array) -> sp.csr_matrix:
    """(r, 3n) displacement at a place along unit directions (r, 3)."""
    rows = np.zeros((len(directions), n * 3))
    for i, direction in enumerate(directions):
        rows[i].reshape(n, 3)[place.nodes] = place.N[:, None] * direction
    return sp.csr_matrix(rows)


def turning_row(n: int, places: Sequence[Location], axis: Array, name: str) -> sp.csr_matrix:
    """(1, 3n) small angle, rad, by which places turn about an axis (3,): of the rigid motion that fits them best.

    With r from their middle and J = sum of r^2 1 - r r^T, it is a . J^-1 sum of r x u; where the axis stands does not
    matter. Of places on a line J is singular: what turns them about the line is not seen and counts as zero.

    Raises:
        UserError: they lie on a line along the axis.
    """
    a, r = axis / np.linalg.norm(axis), np.array([place.point for place in places])
    r = r - r.mean(axis=0)
    J = np.einsum("pi,pi->", r, r) * np.eye(3) - r.T @ r
    inverse = np.linalg.pinv(J, rcond=1e-9, hermitian=True)
    seen = float(a @ inverse @ J @ a)
    if seen < 1e-6:
        raise UserError(f"monitors.{name}.points: they lie on a line along the axis, so they do not show how the body "
                        "turns about it; give points beside the axis")  # fmt: skip
    weights = np.cross(inverse @ a / seen, r)
    return sum(point_rows(n, place, w[None]) for place, w in zip(places, weights, strict=True))


def slope_rows(n: int, place: Location, direction: Array) -> sp.csr_matrix:
    """(3, 3n) derivative of the displacement along a unit direction d at a place: grad(u) d.

    A strain gauge reads d . grad(u) d, and about a deformed state the change of the Green strain,
    (d + grad(u_static) d) . grad(u) d.
    """
    rows = np.zeros((3, n, 3))
    slope = place.grad.T @ direction
    for i in range(3):
        rows[i, place.nodes, i] = slope
    return sp.csr_matrix(rows.reshape(3, -1))

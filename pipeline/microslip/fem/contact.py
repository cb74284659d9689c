"""Frictionless contact of two faces, or of a face and a rigid plane: gaps, forces and their derivative.

The gap of a point of the slave face is its distance from the nearest point of the master face along the master's
normal, less the interference. What must not be negative is the gap averaged with the hat function of every node of
the slave face (a mortar method with second-order displacements and pressures that are linear between nodes, mid-side
ones included: M. A. Puso, T. A. Laursen, J. Solberg, Computer Methods in Applied Mechanics and Engineering 197 (2008)
555). The pressure of a node is <lambda - penalty gap>, <.> the positive part; lambda is raised to that pressure until
the gaps vanish (augmented Lagrangian after Uzawa: J. C. Simo, T. A. Laursen, Computers & Structures 42 (1992)
97), so that the result does not depend on the penalty. All forces derive from one potential,

    Pi = sum over nodes of A / (2 penalty) <lambda - penalty gap>^2,

so the stiffness is symmetric, and with the second derivative of the gap it is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..data import Array, Indices, Mesh
from ..errors import NotConverged, UserError
from ..topology import FACET_CORNERS
from .discretise import Pattern, face_blocks
from .segments import Facets, Points, cut, facet_functions, flat, near_pairs, node_hats, whole

Places = Sequence[tuple[str, Indices, Array]]
"""Places of a face: (facet type, facets (f, k), reference coordinates (q, 2)), the coordinates alike in all facets."""

SLIDE = 1.5
"""Faces may slide by this many of their elements unless told otherwise."""

STIFF = 200.0
"""Penalty over modulus per element size, unless told otherwise. Only the number of iterations depends on it."""


@dataclass(frozen=True)
class Plane:
    """A rigid plane: a point (3,) m and the unit normal (3,) that points to the body."""

    point: Array
    normal: Array


@dataclass(frozen=True)
class ContactPair:
    """Two faces that may touch.

    Attributes:
        name: for messages. points: (n, 3) reference positions of the mesh, m.
        slave, master: facets; master is a `Plane` for a rigid one. nodes: (v,) points of the slave face.
        turn, about: the master stands where R (x - about) + about of its own points is (R (3, 3): a
            neighbouring sector; the unit matrix: the same body).
        interference: m, positive presses. penalty: (v,) Pa/m, of each node.
        slide: m, how far the faces may slide on each other.
        far: m, facets further apart than this do not belong together. size: m, of the slave's facets.
        stays_closed: whether the modes keep the contact's stiffness (closed along the normal, sliding freely).
    """

    name: str
    points: Array
    slave: Facets
    master: Facets | Plane
    nodes: Indices
    turn: Array
    about: Array
    interference: float
    penalty: Array
    slide: float
    far: float
    size: float
    stays_closed: bool = False

    @property
    def between_sectors(self) -> bool:
        """Whether the master belongs to a neighbouring sector."""
        return not np.allclose(self.turn, np.eye(3))

    def neighbour(self, x: Array) -> Array:
        """(n, 3) where the points of the master's body stand, for positions x (n, 3) of the slave's."""
        return (x - self.about) @ self.turn.T + self.about


def make_pair(
    mesh: Mesh, name: str, face: str, against: str | Plane, modulus: float, turn: Array | None = None,
    about: Array | None = None, interference: float = 0.0, penalty: float | None = None, slide: float | None = None,
    stays_closed: bool = False,
) -> ContactPair:  # fmt: skip
    """A pair from the names of two faces of a mesh, or a face and a plane.

    Args:
        modulus: Pa, of the material, for the penalty. Others: see `ContactPair`.

    Raises:
        UserError: faces that do not face each other, or that overlap deeply at rest.
    """
    slave = tuple(mesh.faces[face].items())
    nodes = mesh.face_points(face)
    areas = [np.linalg.norm(b.area, axis=2).sum(axis=1) for b in face_blocks(mesh, face)]
    size = float(np.sqrt(np.concatenate(areas).mean()))
    local = _local_sizes(mesh.n_points, slave, areas)[nodes]
    extent = float(np.linalg.norm(np.ptp(mesh.points[nodes], axis=0)))
    pair = ContactPair(
        name, mesh.points, slave, against if isinstance(against, Plane) else tuple(mesh.faces[against].items()),
        nodes, np.eye(3) if turn is None else turn, np.zeros(3) if about is None else about, interference,
        STIFF * modulus / local if penalty is None else np.full(len(nodes), penalty),
        SLIDE * size if slide is None else slide, 0.5 * extent, size, stays_closed,
    )  # fmt: skip
    _refuse_misplaced(pair, face, against)
    return pair


def _local_sizes(n: int, faces: Facets, areas: list[Array]) -> Array:
    """(n,) mean edge of the facets around each point, m."""
    total, count = np.zeros(n), np.zeros(n)
    for (_, facets), area in zip(faces, areas, strict=True):
        np.add.at(total, facets, np.sqrt(area)[:, None])
        np.add.at(count, facets, 1.0)
    return total / np.maximum(count, 1.0)


def _refuse_misplaced(pair: ContactPair, face: str, against: str | Plane) -> None:
    key = f"closures.{pair.name}"
    other = (
        "the plane"
        if isinstance(against, Plane)
        else f"'{against}'" + (" of the neighbouring sector" if pair.between_sectors else "")
    )
    cuts = cut_pair(pair, pair.points)
    if not cuts.points:
        raise UserError(
            f"{key}: face '{face}' and {other} do not face each other (nowhere are their outward normals opposite "
            f"within {pair.far:.3g} m); correct the names, sector_shift or the number of sectors"
        )
    gap = np.concatenate([project(pair, p, pair.points).gap for p in cuts.points])
    if gap.min() < -0.5 * pair.size:
        raise UserError(
            f"{key}: face '{face}' stands {-gap.min():.3g} m inside {other} already in the drawing, more than half an "
            "element; draw the faces touching or apart and give the interference as a number"
        )


# pattern -----------------------------------------------------------------------------------------------------------


def coupled_points(pair: ContactPair) -> Indices:
    """(m, 2) pairs of points that the contact may couple besides those that share a cell.

    All points of the slave facets around a corner and of the master facets within reach of these.
    """
    around: dict[int, set[int]] = {}  # mid-side nodes couple less than the corners beside them
    for slave_type, facets in pair.slave:
        reach = _reach(pair, slave_type, facets)
        for number, facet in enumerate(facets):
            together = {*facet.tolist(), *reach[number]}
            for corner in facet[: FACET_CORNERS[slave_type]].tolist():
                around.setdefault(corner, set()).update(together)
    keys = [np.zeros(0, dtype=np.int64)]
    n = len(pair.points)
    for members in around.values():
        nodes = np.array(sorted(members), dtype=np.int64)
        keys.append((nodes[:, None] * n + nodes[None])[np.triu_indices(len(nodes))])
    return np.stack(np.divmod(np.unique(np.concatenate(keys)), n), axis=1)


def _reach(pair: ContactPair, slave_type: str, facets: Indices) -> list[set[int]]:
    """Points of the master facets that each slave facet may meet."""
    found: list[set[int]] = [set() for _ in facets]
    if isinstance(pair.master, Plane):
        return found
    slave = flat(slave_type, facets, pair.points)
    for master_type, others in pair.master:
        master = flat(master_type, others, pair.neighbour(pair.points))
        for i, j in zip(*near_pairs(slave, master, pair.slide, pair.far), strict=True):
            found[i].update(others[j].tolist())
    return found


# pieces ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cut:
    """Quadrature points on the pieces of a slave face, kept while Newton iterates. made_at: (n, 3) positions."""

    points: tuple[Points, ...]
    made_at: Array


def cut_pair(pair: ContactPair, x: Array) -> Cut:
    """Cut the slave face along the edges of the master facets it meets at positions x (n, 3)."""
    number = np.zeros(len(x), dtype=np.int64)
    number[pair.nodes] = np.arange(len(pair.nodes))
    found = []
    for slave_type, facets in pair.slave:
        if isinstance(pair.master, Plane):
            found.append(whole(pair.points, slave_type, facets, number[facets]))
            continue
        for master_type, others in pair.master:
            turned = pair.neighbour(x)
            found.append(
                cut(x, pair.points, slave_type, facets, number[facets], master_type, others, turned, pair.far)[0]
            )
    return Cut(tuple(p for p in found if len(p.weight)), x)


def has_slid(pair: ContactPair, made: Cut, x: Array) -> bool:
    """Whether the faces have moved on each other so far that they are to be cut again."""
    if isinstance(pair.master, Plane):
        return False
    before, now = (_offsets(pair, made, at) for at in (made.made_at, x))
    return any(
        np.linalg.norm(np.cross(n, b - a), axis=1).max() > 1e-6 * pair.size
        for (a, n), (b, _) in zip(before, now, strict=True)
    )


def _offsets(pair: ContactPair, made: Cut, x: Array) -> list[tuple[Array, Array]]:
    """Per block the vectors from the master point found in `start` to the slave point, and the normal there."""
    turned = pair.neighbour(x)
    found = []
    for p in made.points:
        N, dN, _ = facet_functions(p.master_type, p.start)
        t = np.einsum("pak,pki->pai", dN, turned[p.master])
        n = np.cross(t[:, 0], t[:, 1])
        apart = np.einsum("pk,pki->pi", p.N, x[p.slave]) - np.einsum("pk,pki->pi", N, turned[p.master])
        found.append((apart, n / np.linalg.norm(n, axis=1)[:, None]))
    return found


# gaps --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Projection:
    """Nearest points of the master.

    Attributes:
        gap: (p,) m, negative inside, interference not counted. normal: (p, 3) of the master. at: (p, 2).
        N, slopes: (p, km), (p, 2, km) shape functions there and their derivatives. tangents: (p, 2, 3).
        bend: (p, 2, 2) normal parts of the second derivatives of the surface.
    """

    gap: Array
    normal: Array
    at: Array
    N: Array
    slopes: Array
    tangents: Array
    bend: Array


def project(pair: ContactPair, points: Points, x: Array) -> Projection:
    """Nearest points of the master facets (continued beyond their edges) for positions x (n, 3)."""
    mine = np.einsum("pk,pki->pi", points.N, x[points.slave])
    if isinstance(pair.master, Plane):
        p, n = len(mine), pair.master.normal
        gap = (mine - pair.master.point) @ n
        zero = np.zeros((p, 2, 0))
        return Projection(
            gap, np.broadcast_to(n, (p, 3)), points.start, zero[:, 0], zero, np.zeros((p, 2, 3)), np.zeros((p, 2, 2))
        )
    nodes = pair.neighbour(x)[points.master]
    at = points.start
    for _ in range(30):
        N, dN, ddN = facet_functions(points.master_type, at)
        t = np.matmul(dN, nodes)
        apart = mine - np.einsum("pk,pki->pi", N, nodes)
        n = np.cross(t[:, 0], t[:, 1])
        n /= np.linalg.norm(n, axis=1)[:, None]
        second = np.matmul(ddN.reshape(len(at), 4, -1), nodes).reshape(-1, 2, 2, 3)
        metric = np.matmul(t, t.transpose(0, 2, 1))
        slope = metric - np.einsum("pabi,pi->pab", second, apart)
        slope = np.where((np.linalg.det(slope) > 0.1 * np.linalg.det(metric))[:, None, None], slope, metric)
        step = np.linalg.solve(slope, np.einsum("pai,pi->pa", t, apart)[..., None])[..., 0]
        if np.abs(step).max(initial=0.0) < 1e-11:
            break
        at = at + np.clip(step, -0.5, 0.5)
    else:
        raise NotConverged(f"closures.{pair.name}: no nearest points were found; is the face strongly curved?")
    bend = np.einsum("pabi,pi->pab", second, n)
    return Projection(np.einsum("pi,pi->p", apart, n), n, at, N, dN, t, bend)


def _sparse(nodes: Indices, values: Array, n: int) -> sp.csr_matrix:
    """(p, 3n) rows with values (p, k, 3) at the degrees of freedom of nodes (p, k)."""
    p, k = nodes.shape
    columns = (3 * nodes[:, :, None] + np.arange(3)).reshape(-1)
    return sp.csr_matrix((values.reshape(-1), columns, np.arange(p + 1) * 3 * k), shape=(p, 3 * n))


@dataclass(frozen=True)
class Grip:
    """A contact at one position of the body.

    Attributes:
        pair, cut: see there. at: (n, 3) positions. multiplier: (v,) Pa, lambda. gap: (v,) m, mean gaps of the
            nodes, interference counted (infinite where a node meets nothing). area: (v,) m2. pressure: (v,) Pa,
            >= 0. touching: (v,) whether a node is closed. point_pressure, point_weight: (p,) at the
            quadrature points.
        on_slave, on_master: (p, 3n) derivative of the gaps with respect to the displacements, by body.
        hats: (v, p). projections: per block of the cut.
    """

    pair: ContactPair
    cut: Cut
    at: Array
    multiplier: Array
    gap: Array
    area: Array
    pressure: Array
    touching: Array
    point_pressure: Array
    point_weight: Array
    on_slave: sp.csr_matrix
    on_master: sp.csr_matrix
    hats: sp.csr_matrix
    projections: tuple[Projection, ...]

    @property
    def force(self) -> Array:
        """(n, 3) forces on the points of the body, N."""
        return self._forces(self.on_slave + self.on_master)

    @property
    def slave_force(self) -> Array:
        """(n, 3) the part that acts on the slave face, N."""
        return self._forces(self.on_slave)

    def _forces(self, rows: sp.csr_matrix) -> Array:
        return np.asarray(rows.T @ (self.point_weight * self.point_pressure)).reshape(-1, 3)

    def force_change(self, change: Array, bent: bool = True) -> Array:
        """(n, 3) change of the forces under a small motion (n, 3), N."""
        return -np.asarray(contact_matrix(self, bent) @ change.reshape(-1)).reshape(-1, 3)

    @property
    def penetration(self) -> float:
        """Largest mean penetration of a node that is pressed, m."""
        pressed = self.pressure > 0
        return float(np.abs(self.gap[pressed]).max(initial=0.0))


def grip(
    pair: ContactPair, made: Cut, x: Array, multiplier: Array, level: float = 1.0, held: Array | None = None
) -> Grip:
    """Gaps, pressures and forces at positions x (n, 3), with a share `level` of a positive interference.

    held: (v,) nodes that are closed whatever their gap (they may pull), for one step of Newton.
    """
    n = len(x)
    found = tuple(project(pair, p, x) for p in made.points)
    on_slave = sp.vstack(
        [_sparse(p.slave, p.N[..., None] * f.normal[:, None], n) for p, f in zip(made.points, found, strict=True)]
    ).tocsr()
    on_master = sp.vstack(
        [
            _sparse(p.master, -f.N[..., None] * (f.normal @ pair.turn)[:, None], n)
            for p, f in zip(made.points, found, strict=True)
        ]
    ).tocsr()
    hats = _hats(made, len(pair.nodes))
    weight = np.concatenate([p.weight for p in made.points])
    inside = level * pair.interference if pair.interference > 0 else pair.interference
    point_gap = np.concatenate([f.gap for f in found]) - inside
    area = hats @ weight
    meets = area > 1e-6 * area.max()
    gap = np.full(len(area), np.inf)
    gap[meets] = (hats @ (weight * point_gap))[meets] / area[meets]
    trial = np.where(meets, multiplier - pair.penalty * np.where(meets, gap, 0.0), 0.0)
    held = np.zeros(len(area), dtype=bool) if held is None else held & meets
    pressure = np.where(held, trial, np.maximum(trial, 0.0))
    # faces that touch without force count as closed
    touching = held | meets & (trial > -1e-9 * pair.penalty * pair.size)
    return Grip(
        pair, made, x, multiplier, gap, np.where(meets, area, 0.0), pressure, touching, hats.T @ pressure,
        weight, on_slave, on_master, hats, found,
    )  # fmt: skip


def _hats(made: Cut, nodes: int) -> sp.csr_matrix:
    """(v, p) hat functions of the nodes at the quadrature points."""
    start, rows, cols, values = 0, [], [], []
    for p in made.points:
        count, c = p.numbers.shape
        rows.append(p.numbers.ravel())
        cols.append(np.repeat(start + np.arange(count), c))
        values.append(p.hats.ravel())
        start += count
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols)))
    return sp.csr_matrix(entries, shape=(nodes, start))


def contact_stiffness(g: Grip, pattern: Pattern, bent: bool = True) -> Array:
    """(p, 3, 3) stiffness of a contact over the pattern, N/m; arguments as those of `contact_matrix`.

    Raises:
        UserError: points that the pattern does not couple: the faces have slid too far.
    """
    return _on_pattern(contact_matrix(g, bent).tocoo(), pattern, g.pair)


def contact_matrix(g: Grip, bent: bool = True, phase: complex = 1.0) -> sp.csr_matrix:
    """(3n, 3n) second derivative of the contact's potential, N/m.

    Args:
        bent: False leaves out the second derivative of the gap, which far from the solution, under pressures that
            are far too high, can make the stiffness indefinite.
        phase: factor by which the master's displacements lag those of the body's own points: exp(+-2 pi i k / N) for
            a neighbouring sector at nodal diameter k.
    """
    mean = sp.diags(np.where(g.touching, 1 / np.where(g.area > 0, g.area, 1.0), 0.0)) @ (
        g.hats @ sp.diags(g.point_weight)
    )
    rows = (mean @ (g.on_slave + phase * g.on_master)).tocsr()
    K = rows.conj().T @ sp.diags(g.pair.penalty * g.area) @ rows
    if bent and not isinstance(g.pair.master, Plane):
        Y, inner = _curvature(g, phase)
        K = K - Y.conj().T @ inner @ Y
    return K


def _curvature(g: Grip, phase: complex) -> tuple[Any, Any]:
    """Y (4p, 3n) and a block diagonal M (4p, 4p) with Y^T M Y = sum of force times second derivative of the gap.

    With xi the motion of the nearest point, A xi = T, B the turning of the tangents along n, k the bend, m the
    metric and W = B + k xi (T. A. Laursen, Computational Contact and Impact Mechanics, Springer 2002, Eq. (5.58)):

        d2 g = -(xi B + B xi + xi k xi) + g W m^-1 W.
    """
    pair, rows, blocks, start = g.pair, [], [], 0
    n = len(pair.points)
    for p, f in zip(g.cut.points, g.projections, strict=True):
        gap, count = f.gap, len(f.gap)
        load = (g.point_weight * g.point_pressure)[start : start + count]
        start += count
        T, normal = f.tangents @ pair.turn, f.normal @ pair.turn
        metric = np.matmul(f.tangents, f.tangents.transpose(0, 2, 1))
        inverse = np.linalg.inv(metric - gap[:, None, None] * f.bend)
        bending = f.slopes[..., None] * normal[:, None, None]  # (p, 2, km, 3)
        mine = p.N[:, None, :, None] * f.tangents[:, :, None]
        theirs = -f.N[:, None, :, None] * T[:, :, None] + gap[:, None, None, None] * bending
        xi = [np.einsum("pab,pbki->paki", inverse, v) for v in (mine, theirs)]
        for a in range(2):
            rows.append(_sparse(p.slave, xi[0][:, a], n) + phase * _sparse(p.master, xi[1][:, a], n))
        rows += [phase * _sparse(p.master, bending[:, a], n) for a in range(2)]
        blocks.append(load[:, None, None] * _second_derivative(gap, metric, f.bend))
    # rows stand block by block as (xi_1, xi_2, B_1, B_2), each (p, 3n)
    return sp.vstack(rows).tocsr(), sp.block_diag([_interleaved(b) for b in blocks], format="csr")


def _second_derivative(gap: Array, metric: Array, bend: Array) -> Array:
    """(p, 4, 4) d2 g in the variables (xi_1, xi_2, B_1, B_2)."""
    inverse, one = np.linalg.inv(metric), np.eye(2)
    bent = np.matmul(inverse, bend)
    d = gap[:, None, None]
    upper = np.concatenate([-bend + d * np.matmul(bend, bent), -one + d * bent.transpose(0, 2, 1)], axis=2)
    lower = np.concatenate([-one + d * bent, d * inverse], axis=2)
    return np.concatenate([upper, lower], axis=1)


def _interleaved(M: Array) -> sp.csr_matrix:
    """(4p, 4p) matrix that couples row a p + i with row b p + i by M (p, 4, 4)."""
    p = len(M)
    at = np.arange(p)
    return sp.bmat([[sp.csr_matrix((M[:, a, b], (at, at)), shape=(p, p)) for b in range(4)] for a in range(4)]).tocsr()


def _on_pattern(K: sp.coo_matrix, pattern: Pattern, pair: ContactPair) -> Array:
    a, b = K.row // 3, K.col // 3
    keep = (a <= b) & (K.data != 0)
    a, b, values = a[keep].astype(np.int64), b[keep].astype(np.int64), K.data[keep]
    keys = pattern.row.astype(np.int64) * pattern.n + pattern.col
    place = np.searchsorted(keys, a * pattern.n + b)
    place = np.minimum(place, len(keys) - 1)
    if (keys[place] != a * pattern.n + b).any():
        raise UserError(_slid(pair))
    flat_place = 9 * place + 3 * (K.row[keep] % 3) + K.col[keep] % 3
    out = np.zeros(9 * pattern.size, dtype=values.dtype)
    np.add.at(out, flat_place, values)
    return out.reshape(-1, 3, 3)


def _slid(pair: ContactPair) -> str:
    if pair.interference > pair.slide:
        return (
            f"closures.{pair.name}.interference: {pair.interference:.3g} m is more than the faces have room to give "
            f"way (they may slide by {pair.slide:.3g} m, about their elements); correct it (it is in length_unit)"
        )
    return (
        f"closures.{pair.name}: the faces slide on each other by more than {pair.slide:.3g} m, which was provided for; "
        "set closures.slide to the sliding you expect"
    )


# results -----------------------------------------------------------------------------------------------------------


def node_values(pair: ContactPair, values: Array, places: Places) -> Array:
    """(p,) values (v,) of the nodes, linear between them, at places of the slave face, facet by facet."""
    number = np.zeros(len(pair.points), dtype=np.int64)
    number[pair.nodes] = np.arange(len(pair.nodes))
    return np.concatenate([(values[number[f]] @ node_hats(t, at).T).ravel() for t, f, at in places])


def gap_at(g: Grip, places: Places) -> Array:
    """(p,) m: gap, the whole interference counted, at places of the slave face in the state of a grip.

    The nearest quadrature point of the contact tells which master facet (continued beyond its edges) is meant.
    """
    pair, x = g.pair, g.at
    known: list[Array] = [np.einsum("pk,pki->pi", p.N, pair.points[p.slave]) for p in g.cut.points]
    block = np.repeat(np.arange(len(known)), [len(k) for k in known])
    row = np.concatenate([np.arange(len(k)) for k in known])
    tree = cKDTree(np.concatenate(known))
    out = []
    for facet_type, facets, at in places:
        N = np.tile(facet_functions(facet_type, at)[0], (len(facets), 1))
        slave = np.repeat(facets, len(at), axis=0)
        nearest = np.asarray(tree.query(np.einsum("pk,pki->pi", N, pair.points[slave]))[1])
        gap = np.empty(len(nearest))
        for b, points in enumerate(g.cut.points):
            mine = block[nearest] == b
            rows = row[nearest[mine]]
            asked = replace(points, slave=slave[mine], N=N[mine], master=points.master[rows], start=points.start[rows])
            gap[mine] = project(pair, asked, x).gap
        out.append(gap - pair.interference)
    return np.concatenate(out)

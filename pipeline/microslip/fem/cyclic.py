"""One sector of a cyclic body: its two cut faces paired node by node, and the unknowns that remain.

The sector at +2 pi / N about the rotation axis (the right-hand neighbour) moves as R u exp(+i k 2 pi / N), where R
turns vectors by the sector angle and k is the nodal diameter. The neighbour's left cut face is this sector's right one:

    u_right = R u_left exp(+i k 2 pi / N),     all other displacements are free,

so the unknowns are u = T_k q with T_k = T_0 + exp(+i k 2 pi / N) T_R (D. L. Thomas, Int. J. Numer. Methods Eng. 14
(1979) 81). The static state has k = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..data import Array, Indices, Mesh, Ties
from ..errors import UserError
from ..frames import rotation
from ..mesh import part_numbers
from .discretise import FreeUpper, Pattern
from .links import NEAR, facet_size, nearest_on_face
from .tied import Tied, congruence, tied_upper

_CLOSE = 1e-3  # share of the distance to the nearest other node within which two nodes are one


@dataclass(frozen=True)
class CutFaces:
    """The nodes of the two cut faces: node ``right[i]`` is node ``left[i]`` turned by the sector angle.

    Attributes:
        sectors: N. left, right: (l,) point indices. rotation: (3, 3) R. share: (r, l) where the
            faces do not match: what each node of the right one, turned back, follows of those of
            the left one (N_i at its place); None: the pairs. backward: left and right are
            exchanged, so that R turns by -2 pi / N.
    """

    sectors: int
    left: Indices
    right: Indices
    rotation: Array
    share: sp.csr_matrix | None = None
    backward: bool = False

    @property
    def weights(self) -> sp.csr_matrix:
        """(r, l) shares of left nodes in the motion of right ones."""
        return sp.identity(len(self.left), format="csr") if self.share is None else self.share

    @property
    def ahead(self) -> Array:
        """(3, 3) rotation to the next sector."""
        return self.rotation.T if self.backward else self.rotation

    def phase(self, harmonic: int) -> complex | float:
        """exp(+i k 2 pi / N), its conjugate where left and right are exchanged; real for k = 0 and k = N/2."""
        if harmonic == 0:
            return 1.0
        if 2 * harmonic == self.sectors:
            return -1.0
        return complex(np.exp((-2j if self.backward else 2j) * np.pi * harmonic / self.sectors))


def pair_cut_faces(
    mesh: Mesh, left: str, right: str, axis: Array, point: Array, sectors: int, follows: str = "right"
) -> CutFaces:  # fmt: skip
    """Pair the nodes of the two cut faces, or tie those of one to the other where they do not match.

    Args:
        follows: which face's nodes are tied to the other: ``left`` or ``right``.

    Raises:
        UserError: the right face is not the left one turned by 2 pi / N about the axis.
    """
    a, b = mesh.face_points(left), mesh.face_points(right)
    if shared := np.intersect1d(a, b).size:
        raise UserError(
            f"cyclic: {shared} nodes lie on '{left}' and on '{right}'; the two cut faces must not touch (a sector that "
            "reaches the rotation axis cannot be closed; leave a bore)"
        )
    x, y = mesh.points[a] - point, mesh.points[b] - point
    R = rotation(axis, 2 * np.pi / sectors)
    part = part_numbers(mesh)  # nodes of tied parts may lie on each other
    apart = 10 * float(np.ptp(mesh.points, axis=0).max()) * part[:, None]
    turned, there = np.hstack([x @ R.T, apart[a]]), np.hstack([y, apart[b]])
    spacing = float(np.median(_nearest(there, there, 2)[0][:, 1])) if len(y) > 1 else 1.0
    distance, nearest = _nearest(there, turned)
    if len(a) == len(b) == len(np.unique(nearest)) and distance.max() <= _CLOSE * spacing:
        return CutFaces(sectors, a, b[nearest], R)
    _refuse_elsewhere(x, y, left, right, axis, sectors, spacing)
    names = (right, left) if follows == "left" else (left, right)
    return _tied_faces(
        mesh, names, R.T if follows == "left" else R, point, sectors, follows == "left"
    )


def _tied_faces(
    mesh: Mesh, names: tuple[str, str], R: Array, point: Array, sectors: int, backward: bool
) -> CutFaces:  # fmt: skip
    """Faces that do not match: the nodes of the second follow the first at their nearest points, turned.

    Raises:
        UserError: nodes that lie off it.
    """
    led, leading = mesh.face_points(names[1]), mesh.face_points(names[0])
    back = (mesh.points[led] - point) @ R + point
    distance, nodes, N, _ = nearest_on_face(mesh.points, mesh.faces[names[0]], back)
    # what leads lies on what follows, too: no part of the cut is left open
    moved = (mesh.points - point) @ R + point
    other = nearest_on_face(moved, mesh.faces[names[1]], mesh.points[leading])[0]
    size, off = facet_size(mesh, names[0]), np.r_[distance, other]
    if (off > NEAR * size).any():
        raise UserError(
            f"cyclic: '{names[1]}' is not '{names[0]}' turned by 2 pi / {sectors} about the rotation axis: "
            f"{int((off > NEAR * size).sum())} of their {len(off)} nodes lie up to {off.max():.3g} m off the other "
            f"face (edges of facets: {size:.3g} m); mesh the two faces alike (gmsh: setPeriodic)"
        )
    at = np.searchsorted(leading, nodes)
    entries = (N.ravel(), (np.repeat(np.arange(len(led)), N.shape[1]), at.ravel()))
    share = sp.csr_matrix(entries, shape=(len(led), len(leading)))
    return CutFaces(sectors, leading, led, R, share, backward)


def refuse_other_facets(mesh: Mesh, left: str, right: str, cut: CutFaces) -> None:
    """Nodes may meet where facets do not: two triangles over four nodes have two diagonals with the same middle.

    Raises:
        UserError: facets of the right face are not those of the left one turned.
    """
    if cut.share is not None:
        return
    mate = np.full(mesh.n_points, -1)
    mate[cut.left] = cut.right
    for kind in mesh.faces.get(left, {}):
        moved, there = mate[mesh.faces[left][kind]], mesh.faces[right].get(kind, np.zeros((0, 0), dtype=int))
        a, b = (np.unique(np.sort(facets, axis=1), axis=0) for facets in (moved, there))
        if not np.array_equal(a, b):
            raise UserError(
                f"cyclic: the nodes of '{left}' and '{right}' meet, but not their facets ({kind}: other diagonals); "
                "mesh the two faces alike (gmsh: setPeriodic)"
            )


def _nearest(points: Array, to: Array, count: int = 1) -> tuple[Array, Array]:
    distance, index = cKDTree(points).query(to, k=count)
    return np.asarray(distance), np.asarray(index)


def _refuse_elsewhere(
    x: Array, y: Array, left: str, right: str, axis: Array, N: int, spacing: float
) -> None:
    """Refuse faces that another axis, angle or order would bring onto each other."""
    if text := _elsewhere(x, y, left, right, axis, N, spacing):
        raise UserError(text)


def _elsewhere(
    x: Array, y: Array, left: str, right: str, axis: Array, N: int, spacing: float
) -> str:
    back = _nearest(y, x @ rotation(axis, -2 * np.pi / N).T)[0].max()
    if back < _CLOSE * spacing:
        return (
            f"cyclic: '{right}' is '{left}' turned by -2 pi / {N} about the rotation axis; exchange left and right, or "
            "turn the axis round"
        )
    if _congruent(x, y) and not _same_circles(x, y, axis, 0.5 * spacing):
        return (
            f"rotation: the faces '{left}' and '{right}' are alike, but are not turned about this axis onto each other "
            "(their points lie on other circles round it); correct rotation.axis and rotation.point"
        )
    angle = _angle_between(x, y, axis)
    count = 2 * np.pi / angle if angle else float(N)
    if abs(count - round(count)) > 0.01 * count:
        return (
            f"rotation.axis: the faces '{left}' and '{right}' are {np.degrees(angle):.4g} degrees apart about it, "
            "which is no whole number of sectors; correct rotation.axis and point"
        )
    if abs(count - N) > 0.01 * N:
        return (
            f"cyclic.sectors: the faces '{left}' and '{right}' are {np.degrees(angle):.4g} degrees apart about the "
            f"rotation axis, which makes {count:.4g} sectors, not {N}; correct sectors, or rotation.axis "
            "and point"
        )
    return ""


def _congruent(x: Array, y: Array) -> bool:
    """Whether two sets of points have the same distances from their middles."""
    a, b = (np.sort(np.linalg.norm(v - v.mean(axis=0), axis=1)) for v in (x, y))
    return len(a) == len(b) and bool(np.abs(a - b).max() < _CLOSE * a.max())


def _same_circles(x: Array, y: Array, axis: Array, within: float) -> bool:
    """Whether two sets of points lie on the same circles round the axis: the same heights and radii."""
    n = axis / np.linalg.norm(axis)
    at = [np.stack([v @ n, np.linalg.norm(v - np.outer(v @ n, n), axis=1)], axis=1) for v in (x, y)]
    return float(_nearest(at[0], at[1])[0].max()) < within and float(_nearest(at[1], at[0])[0].max()) < within


def _angle_between(x: Array, y: Array, axis: Array) -> float:
    """Angle about the axis from the mean of the left face to that of the right, rad, 0 to 2 pi."""
    n = axis / np.linalg.norm(axis)
    p, q = (v.mean(axis=0) - (v.mean(axis=0) @ n) * n for v in (x, y))
    return float(np.arctan2(n @ np.cross(p, q), p @ q) % (2 * np.pi))


@dataclass(frozen=True)
class SectorUnknowns:
    """The unknowns of a sector: its free degrees of freedom, the cut faces still apart, and their coupling.

    Attributes:
        apart: upper triangle over the f free degrees of freedom. cut: the pairing.
        stay: (f, m) T_0. turn: (f, m) T_R. boundary: positions, among the free, of those that move
        the cut faces.
    """

    apart: FreeUpper | Tied
    cut: CutFaces
    stay: sp.csr_matrix
    turn: sp.csr_matrix
    boundary: Indices

    def transformation(self, harmonic: int) -> sp.csr_matrix:
        """(f, m) T_k; real for k = 0 and N/2."""
        return (self.stay + self.cut.phase(harmonic) * self.turn).tocsr()


def sector_unknowns(pattern: Pattern, fixed: Indices, cut: CutFaces, ties: Ties | None = None) -> SectorUnknowns:
    """Eliminate the right cut face: its displacements that are unknowns become those of the left one, turned.

    Raises:
        UserError: ties that do not go on in the next sector, supports of a face that does not match
        the other one.
    """
    fixed, ties = _held_alike(pattern.n, fixed, cut, ties)
    apart = tied_upper(pattern, fixed, ties)
    f, rows = (
        apart.size,
        (apart.T if isinstance(apart, Tied) else sp.identity(apart.size, format="csr")),
    )
    free = apart.apart.free if isinstance(apart, Tied) else apart.free
    position, place = (np.full(3 * pattern.n, -1, dtype=np.int64) for _ in range(2))
    plain = np.flatnonzero(apart.own >= 0)
    position[apart.own[plain]], place[free] = plain, np.arange(len(free))
    l, r = (3 * nodes[:, None] + np.arange(3) for nodes in (cut.left, cut.right))
    at = place[l.ravel()]
    on_left = sp.diags((at >= 0).astype(float)) @ rows[np.maximum(at, 0)]
    followed = (
        sp.kron(cut.weights, np.where(np.abs(cut.rotation) > 1e-14, cut.rotation, 0.0)) @ on_left
    ).tocsr()
    gone = position[r.ravel()] >= 0
    right = position[r.ravel()][gone]
    keep = np.ones(f, dtype=bool)
    keep[right] = False
    number, m = np.cumsum(keep) - 1, int(keep.sum())
    stay = sp.csr_matrix((np.ones(m), (np.flatnonzero(keep), np.arange(m))), shape=(f, m))
    given = followed[gone].tocoo()
    turn = sp.csr_matrix((given.data, (right[given.row], number[given.col])), shape=(f, m))
    _refuse_unlike(apart, cut, stay, turn)
    return SectorUnknowns(apart, cut, stay, turn, np.union1d(np.unique(given.col), right))


def _held_alike(
    n: int, fixed: Indices, cut: CutFaces, ties: Ties | None
) -> tuple[Indices, Ties | None]:
    """Supports of both nodes of a pair, where they differ, as those of the left one: the right one follows it.

    What is held on the right as v is held on the left as R^-1 v; along no axis of the body it is an
    equation.
    """
    held = np.zeros((max(n, int(fixed.max(initial=0)) // 3 + 1), 3), dtype=bool)
    held.reshape(-1)[fixed] = True
    R = np.abs(cut.rotation) > 1e-12
    if cut.share is not None:
        return fixed, ties
    unlike = (R[None] & (held[cut.right][:, :, None] != held[cut.left][:, None, :])).any(
        axis=(1, 2)
    )
    rows = []
    for left, right in zip(cut.left[unlike], cut.right[unlike], strict=True):
        vectors = np.vstack([np.eye(3)[held[left]], cut.rotation[held[right]]])
        _, size, V = np.linalg.svd(vectors)
        S = V[: int((size > 1e-9).sum())]
        whole = (S**2).sum(axis=0) > 1 - 1e-9
        held[left], held[right] = whole, False
        _, size, V = np.linalg.svd(np.where(whole, 0.0, S))
        rows += [(left, v) for v in V[: int((size > 1e-9).sum())]]
    return np.flatnonzero(held.reshape(-1)), with_rows(ties, n, rows) if rows else ties


def with_rows(ties: Ties | None, n: int, rows: Sequence[tuple[int, Array]]) -> Ties:
    """The ties with supports of points along directions (3,) besides. n: number of points."""
    if ties is None:
        none = np.zeros(0, dtype=np.int64)
        ties = Ties(sp.csr_matrix((0, 3 * n)), none, none, (), (), np.zeros((0, 3)), np.arange(n))
    at, of = 3 * np.array([node for node, _ in rows])[:, None] + np.arange(3), np.arange(len(rows))
    data = np.concatenate([v for _, v in rows])
    more = sp.csr_matrix(
        (data, (np.repeat(of, 3), at.ravel())), shape=(len(rows), ties.rows.shape[1])
    )
    return replace(
        ties, rows=sp.vstack([ties.rows, more]).tocsr(), dependent=np.r_[ties.dependent, np.full(len(rows), -1)],
        of=np.r_[ties.of, np.full(len(rows), len(ties.told))], told=(*ties.told, "supports of the other cut face"),
        otherwise=(*ties.otherwise, "refuse"),
    )  # fmt: skip


def _refuse_unlike(
    apart: FreeUpper | Tied, cut: CutFaces, stay: sp.csr_matrix, turn: sp.csr_matrix
) -> None:
    """Refuse ties and supports that do not go on in the next sector: what follows others, or is held, on the right face
    must be so on the left one, turned and in any phase."""
    phase = np.exp(0.7j)
    free = apart.apart.free if isinstance(apart, Tied) else apart.free
    place = np.full(3 * (int(max(cut.left.max(), cut.right.max(), free.max() // 3)) + 1), -1)
    place[free] = np.arange(len(free))
    moved = stay + phase * turn
    moved = apart.T @ moved if isinstance(apart, Tied) else moved
    sides = []
    for nodes in (cut.left, cut.right):
        at = place[(3 * nodes[:, None] + np.arange(3)).ravel()]
        there = sp.diags((at >= 0).astype(float))
        sides.append(there @ moved[np.maximum(at, 0)])
    wrong = abs(sides[1] - phase * sp.kron(cut.weights, cut.rotation).tocsr() @ sides[0]).tocoo()
    if bad := len(np.unique(wrong.row[wrong.data > 1e-9] // 3)):
        raise UserError(
            f"cyclic: {bad} nodes of the cut faces are held, or follow others by the ties of the mesh file, and not "
            "alike on both faces; hold and tie them alike, or make the cut elsewhere"
        )


@dataclass(frozen=True)
class CyclicUpper:
    """The upper triangle over the unknowns of nodal diameter 0; stands where a `FreeUpper` stands.

    Attributes:
        unknowns: the sector's. indptr, indices: CSR of the upper triangle. collect: (entries, 9 p) sums the entries of
        a flattened (p, 3, 3) operator.
    """

    unknowns: SectorUnknowns
    transformation: sp.csr_matrix
    indptr: Indices
    indices: Indices
    collect: sp.csr_matrix

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.indptr) - 1

    def matrix(self, values: Array) -> sp.csr_matrix:
        """CSR upper triangle of an operator (p, 3, 3)."""
        n = len(self.indptr) - 1
        return sp.csr_matrix((self.collect @ values.reshape(-1), self.indices, self.indptr), shape=(n, n))

    def restrict(self, forces: Array) -> Array:
        """(m,) or (m, r) forces on the unknowns, from forces (3n,) or (3n, r) on all degrees of freedom."""
        return self.transformation.T @ self.unknowns.apart.restrict(forces)

    def unknowns_of(self, displacements: Array) -> Array:
        """(m, r) unknowns of displacements (3n, r) that move all sectors alike: `expand` turned round."""
        return self.unknowns.stay.T @ self.unknowns.apart.unknowns_of(displacements)

    def rows(self, B: sp.csr_matrix) -> sp.csr_matrix:
        """(r, m) rows on the unknowns, from rows (r, 3n) on all degrees of freedom."""
        return self.unknowns.apart.rows(B) @ self.transformation

    def expand(self, unknowns: Array, n: int) -> Array:
        """(3n,) or (3n, r) displacements of n points from the unknowns (m,) or (m, r)."""
        return self.unknowns.apart.expand(self.transformation @ unknowns, n)


def cyclic_upper(unknowns: SectorUnknowns, size: int) -> CyclicUpper:
    """The symmetric static problem of a sector; size: pairs of points in the pattern."""
    T = unknowns.transformation(0)
    return CyclicUpper(unknowns, T, *congruence(unknowns.apart, T, size))

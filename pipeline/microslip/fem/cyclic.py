"""One sector of a cyclic body: its two cut faces paired node by node, and the unknowns that remain.

The sector at +2 pi / N about the rotation axis (the right-hand neighbour) moves as R u exp(+i k 2 pi / N), where R
turns vectors by the sector angle and k is the nodal diameter. The neighbour's left cut face is this sector's right one:

    u_right = R u_left exp(+i k 2 pi / N),     all other displacements are free,

so the unknowns are u = T_k q with T_k = T_0 + exp(+i k 2 pi / N) T_R (D. L. Thomas, Int. J. Numer. Methods Eng. 14
(1979) 81). The static state has k = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..data import Array, Indices, Mesh, Ties
from ..errors import UserError
from ..frames import rotation
from ..mesh import part_numbers
from .discretise import FreeUpper, Pattern
from .tied import Tied, congruence, tied_upper

_CLOSE = 1e-3  # share of the distance to the nearest other node within which two nodes are one


@dataclass(frozen=True)
class CutFaces:
    """The paired nodes of the two cut faces: node ``right[i]`` is node ``left[i]`` turned by the sector angle.

    Attributes:
        sectors: N. left, right: (l,) point indices. rotation: (3, 3) R.
    """

    sectors: int
    left: Indices
    right: Indices
    rotation: Array

    def phase(self, harmonic: int) -> complex | float:
        """exp(+i k 2 pi / N); a real number for k = 0 and k = N/2."""
        if harmonic == 0:
            return 1.0
        if 2 * harmonic == self.sectors:
            return -1.0
        return complex(np.exp(2j * np.pi * harmonic / self.sectors))


def pair_cut_faces(mesh: Mesh, left: str, right: str, axis: Array, point: Array, sectors: int) -> CutFaces:
    """Pair the nodes of the two cut faces.

    Raises:
        UserError: the right face is not the left one turned by 2 pi / N about the axis, node by node.
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
    if len(a) != len(b) or len(np.unique(nearest)) < len(b) or distance.max() > _CLOSE * spacing:
        raise UserError(_no_match(x, y, left, right, axis, sectors, float(distance.max()), spacing))
    return CutFaces(sectors, a, b[nearest], R)


def refuse_other_facets(mesh: Mesh, left: str, right: str, cut: CutFaces) -> None:
    """Nodes may meet where facets do not: two triangles over four nodes have two diagonals with the same middle.

    Raises:
        UserError: facets of the right face are not those of the left one turned.
    """
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


def _no_match(x: Array, y: Array, left: str, right: str, axis: Array, N: int, distance: float, spacing: float) -> str:
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
    if len(x) != len(y):
        why = f"they have {len(x)} and {len(y)} nodes"
    else:
        why = f"nodes that should meet are up to {distance:.3g} m apart (neighbouring nodes: {spacing:.3g} m)"
    return (
        f"cyclic: '{right}' is not '{left}' turned by 2 pi / {N} about the rotation axis, node by node: {why}; mesh "
        "the two faces alike (gmsh: setPeriodic), cut faces that do not match are not tied"
    )


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
        stay: (f, m) T_0. turn: (f, m) T_R. left, right: (b,) positions, among the free, of the degrees of freedom on
        the cut faces; right ones are `block` (b, b) times the left ones times the phase.
    """

    apart: FreeUpper | Tied
    cut: CutFaces
    stay: sp.csr_matrix
    turn: sp.csr_matrix
    left: Indices
    right: Indices
    block: sp.csr_matrix

    def transformation(self, harmonic: int) -> sp.csr_matrix:
        """(f, m) T_k; real for k = 0 and N/2."""
        return (self.stay + self.cut.phase(harmonic) * self.turn).tocsr()


def sector_unknowns(pattern: Pattern, fixed: Indices, cut: CutFaces, ties: Ties | None = None) -> SectorUnknowns:
    """Eliminate the right cut face.

    Raises:
        UserError: a support holds one of a pair of nodes and not the other, or a direction that turning mixes.
    """
    apart = tied_upper(pattern, fixed, ties)
    free_left, free_right = _free_pairs(apart, cut)
    position = np.full(3 * pattern.n, -1, dtype=np.int64)
    plain = np.flatnonzero(apart.own >= 0)
    position[apart.own[plain]] = plain
    l, r = position[3 * cut.left[:, None] + np.arange(3)], position[3 * cut.right[:, None] + np.arange(3)]
    pair, i, j = np.nonzero(free_right[:, :, None] & free_left[:, None, :] & (np.abs(cut.rotation) > 1e-14)[None])
    rows, columns, values = r[pair, i], l[pair, j], cut.rotation[i, j]
    f = apart.size
    keep = np.ones(f, dtype=bool)
    keep[r[free_right]] = False
    number = np.cumsum(keep) - 1
    m = int(keep.sum())
    stay = sp.csr_matrix((np.ones(m), (np.flatnonzero(keep), np.arange(m))), shape=(f, m))
    turn = sp.csr_matrix((values, (rows, number[columns])), shape=(f, m))
    _refuse_tied(apart, cut, stay, turn)
    left, right = l[free_left], r[free_right]
    block = sp.csr_matrix((values, (rows, columns)), shape=(f, f))[right][:, left].tocsr()
    return SectorUnknowns(apart, cut, stay, turn, left, right, block)


def _refuse_tied(apart: FreeUpper | Tied, cut: CutFaces, stay: sp.csr_matrix, turn: sp.csr_matrix) -> None:
    """Refuse ties that do not go on in the next sector: what follows others on the right face must be what does so on
    the left one, turned and in any phase."""
    if isinstance(apart, FreeUpper):
        return
    phase = np.exp(0.7j)
    place = np.full(3 * (int(max(cut.left.max(), cut.right.max(), apart.apart.free.max() // 3)) + 1), -1)
    place[apart.apart.free] = np.arange(len(apart.apart.free))
    moved = apart.T @ (stay + phase * turn)
    sides = []
    for nodes in (cut.left, cut.right):
        at = place[(3 * nodes[:, None] + np.arange(3)).ravel()]
        there = sp.diags((at >= 0).astype(float))
        sides.append(there @ moved[np.maximum(at, 0)])
    wrong = abs(sides[1] - phase * sp.kron(sp.identity(len(cut.left)), cut.rotation).tocsr() @ sides[0]).tocoo()
    if bad := len(np.unique(wrong.row[wrong.data > 1e-9] // 3)):
        raise UserError(
            f"cyclic: {bad} nodes of the cut faces follow others by the ties of the mesh file, and not alike on both "
            "faces; tie them alike, leave them out of these ties, or make the cut elsewhere"
        )


def _free_pairs(apart: FreeUpper | Tied, cut: CutFaces) -> tuple[Array, Array]:
    """(l, 3) which directions are free on the left and on the right node of each pair."""
    left, right = (np.isin(3 * nodes[:, None] + np.arange(3), apart.own) for nodes in (cut.left, cut.right))
    R = np.abs(cut.rotation) > 1e-12
    mixed = (R[None] & (right[:, :, None] != left[:, None, :])).any(axis=(1, 2))
    if mixed.any():
        raise UserError(
            f"supports: {int(mixed.sum())} pairs of nodes on the cut faces are not held alike once turned by the "
            "sector angle; hold whole nodes on both faces (all of xyz), or the direction of the rotation axis alone"
        )
    return left, right


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

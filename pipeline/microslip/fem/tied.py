"""Displacements that hang on others: u = T x, the unknowns x that linear equations and supports leave.

Of the equations C (u, q) = 0 (`data.Ties`) every one gives one displacement. Those that name it are solved for it
first, u_d = (1 - C_dd)^-1 C_di u_i; of the others the one with the largest factor is taken, after what is known has
been put in. What is left of the reference nodes' motions q is turned to as many unknowns as really move something. So
K, M, forces F and rows B become T^T K T, T^T M T, T^T F and B T, at rest, at speed and in a sector alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.csgraph
import scipy.sparse.linalg as spla

from ..data import Array, Flags, Indices, Ties
from ..errors import UserError
from .discretise import FreeUpper, Pattern, free_upper

_NOTHING = 1e-10
"""Share of an equation below which what is left of it is rounding: others say it already."""


@dataclass(frozen=True)
class Tied:
    """The upper triangle over the unknowns of a body with ties; stands where a `FreeUpper` stands.

    Attributes:
        apart: of the displacements that are not held, ties left out. T: (f, m) of these. own: (m,) the degree of
            freedom (3 * point + component) that an unknown is, -1 of motions of reference nodes. indptr, indices: CSR
            of the upper triangle. collect: (entries, 9 p) sums the entries of a flattened (p, 3, 3) operator.
        fixed: what is held, of the points and behind them of reference nodes. motions: (6 k, m) what unknowns make of
            the reference nodes.
    """

    apart: FreeUpper
    T: sp.csr_matrix
    own: Indices
    indptr: Indices
    indices: Indices
    collect: sp.csr_matrix
    fixed: Indices
    motions: sp.csr_matrix

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.T.shape[1]

    def matrix(self, values: Array) -> sp.csr_matrix:
        """CSR upper triangle of an operator (p, 3, 3)."""
        data = self.collect @ values.reshape(-1)
        return sp.csr_matrix((data, self.indices, self.indptr), shape=(self.size, self.size))

    def congruent(self, A: sp.csr_matrix) -> sp.csr_matrix:
        """(m, m) matrix on the unknowns, from (3n, 3n)."""
        return (self.T.T @ A[self.apart.free][:, self.apart.free] @ self.T).tocsr()

    def restrict(self, forces: Array) -> Array:
        """(m,) or (m, r) forces on the unknowns, from forces (3n,) or (3n, r) on all degrees of freedom."""
        return self.T.T @ forces[self.apart.free]

    def rows(self, B: sp.csr_matrix) -> sp.csr_matrix:
        """(r, m) rows on the unknowns, from rows (r, 3n) on all degrees of freedom."""
        return (B[:, self.apart.free] @ self.T).tocsr()

    def expand(self, unknowns: Array, n: int) -> Array:
        """(3n,) or (3n, r) displacements of n points from the unknowns (m,) or (m, r)."""
        return self.apart.expand(self.T @ unknowns, n)

    def carried(self, forces: Array, n: int) -> Array:
        """(3n,) forces on the points that do on every motion the work of forces and moments (6 k,) on reference nodes.
        """
        on_points = np.zeros(3 * n)
        on_points[self.apart.free] = self.T @ spla.spsolve((self.T.T @ self.T).tocsc(), self.motions.T @ forces)
        return on_points

    def unknowns_of(self, displacements: Array) -> Array:
        """(m, r) unknowns of displacements (3n, r) that supports and ties allow: `expand` turned round."""
        x = np.zeros((self.size, *displacements.shape[1:]), dtype=displacements.dtype)
        plain = self.own >= 0
        x[plain] = displacements[self.own[plain]]
        if not plain.all():
            left = displacements[self.apart.free] - self.T @ x
            x[~plain] = self._moved_by.solve(self.T[:, ~plain].T @ left)
        return x

    @cached_property
    def _moved_by(self) -> spla.SuperLU:
        """Factors of the normal equations of the reference nodes' motions."""
        moved = self.T[:, self.own < 0]
        return spla.splu((moved.T @ moved).tocsc())


def tied_upper(pattern: Pattern, fixed: Indices, ties: Ties | None) -> FreeUpper | Tied:
    """The unknowns of a body. fixed: held degrees of freedom, of the points and behind them of reference nodes.

    Raises:
        UserError: equations that contradict each other or tie what is supported, with their place in the file.
    """
    if ties is None or not ties.rows.shape[0]:
        return free_upper(pattern, fixed[fixed < 3 * pattern.n])
    whole, own = transformation(ties, fixed)
    apart = free_upper(pattern, np.flatnonzero(np.diff(whole.indptr)[: 3 * pattern.n] == 0))
    T = whole[apart.free]
    indptr, indices, collect = congruence(apart, T, pattern.size)
    return Tied(apart, T, own, indptr, indices, collect, fixed, whole[3 * pattern.n :])


def congruence(apart: FreeUpper | Tied, T: sp.csr_matrix, size: int) -> tuple[Indices, Indices, sp.csr_matrix]:
    """CSR (indptr, indices) of the upper triangle of T^T A T, and (entries, 9 p) what sums it from A's operator.

    Args:
        apart: where the upper triangle of A stands. size: pairs of points in the pattern.
    """
    i = np.repeat(np.arange(len(apart.indptr) - 1), np.diff(apart.indptr))
    a, b, c, entry = _products(T, i, apart.indices.astype(np.int64))
    m = T.shape[1]
    key, where = np.unique(np.minimum(a, b) * m + np.maximum(a, b), return_inverse=True)
    row, column = np.divmod(key, m)
    indptr = np.searchsorted(row, np.arange(m + 1)).astype(np.int32)
    if isinstance(apart, FreeUpper):
        collect = sp.csr_matrix((c, (where, apart.gather[entry])), shape=(len(key), 9 * size))
    else:
        collect = sp.csr_matrix((c, (where, entry)), shape=(len(key), len(apart.indices))) @ apart.collect
    return indptr, column.astype(np.int32), collect


def _products(T: sp.csr_matrix, i: Array, j: Array) -> tuple[Array, Array, Array, Array]:
    """Where entry (i, j) of a symmetric matrix goes in T^T K T: unknowns a, b, factor c, and the entry's number."""
    count = np.diff(T.indptr)
    times = count[i] * count[j]
    entry = np.repeat(np.arange(len(i)), times)
    within = np.arange(len(entry)) - np.repeat(np.cumsum(times) - times, times)
    first, second = np.divmod(within, count[j[entry]])
    at_a, at_b = T.indptr[i[entry]] + first, T.indptr[j[entry]] + second
    a, b = T.indices[at_a].astype(np.int64), T.indices[at_b].astype(np.int64)
    c = T.data[at_a] * T.data[at_b]
    diagonal = i[entry] == j[entry]
    c = np.where(~diagonal & (a == b), 2 * c, c)  # (i, j) and (j, i) both land on the diagonal
    keep = ~diagonal | (a <= b)
    return a[keep], b[keep], c[keep], entry[keep]


def transformation(ties: Ties, fixed: Indices) -> tuple[sp.csr_matrix, Indices]:
    """(N, m) T of all N = 3n + 6k displacements and motions of reference nodes, and (m,) which of them each unknown is.

    Unknowns that are a point's displacement come first, in their order; -1: they move reference nodes, or what follows
    them.

    Raises:
        UserError: see `tied_upper`.
    """
    count = ties.rows.shape[1]
    held = np.zeros(count, dtype=bool)
    held[fixed] = True
    named, others = _in_force(ties, held)
    T, left = _solved(ties, named, held)
    T, left = _chosen(ties, others, T, left)
    n = count - 6 * len(ties.references)
    points, motions = left[left < n], left[left >= n]
    columns = np.searchsorted(left, motions)
    turned, own = [T[:, np.searchsorted(left, points)]], [points]
    for j in range(len(ties.references)):
        of = columns[(motions - n) // 6 == j]
        if len(of):
            turned.append(_independent(T[:, of].tocsc(), n))
            own.append(np.full(turned[-1].shape[1], -1, dtype=np.int64))
    return sp.hstack(turned).tocsr(), np.concatenate(own)


def _in_force(ties: Ties, held: Flags) -> tuple[Indices, Indices]:
    """Rows that give the displacement that they name, each once and none that is held, and those that may give any.

    Raises:
        UserError: with both places.
    """
    given: dict[int, int] = {}
    found, others = [], [int(row) for row in np.flatnonzero(ties.dependent < 0)]
    for row in map(int, np.flatnonzero(ties.dependent >= 0)):
        link, dof = int(ties.of[row]), int(ties.dependent[row])
        if held[dof] or dof in given:
            if ties.otherwise[link] != "refuse":
                others += [row] if ties.otherwise[link] == "another" else []
                continue
            other = f"{ties.told[given[dof]]} gives already" if dof in given else "a support holds"
            raise UserError(
                f"{ties.told[link]} gives a displacement ({_name(ties, dof)}) that {other}; take it out of one of them"
            )
        given[dof] = link
        found.append(row)
    return np.array(found, dtype=np.int64), np.array(others, dtype=np.int64)


def _name(ties: Ties, dof: int) -> str:
    """A degree of freedom for a person."""
    n = ties.rows.shape[1] - 6 * len(ties.references)
    if dof < n:
        return f"u_{'xyz'[dof % 3]} of node {ties.numbers[dof // 3]}"
    node, way = divmod(dof - n, 6)
    return f"{('u_x', 'u_y', 'u_z', 'phi_x', 'phi_y', 'phi_z')[way]} of node {ties.numbers[n // 3 + node]}"


def _solved(ties: Ties, rows: Indices, held: Flags) -> tuple[sp.csr_matrix, Indices]:
    """(N, l) what the rows that name what they give make of all displacements, and which l of them are left.

    Raises:
        UserError: rows that lead in a circle.
    """
    count, named = ties.rows.shape[1], ties.dependent[rows]
    free = ~held
    free[named] = False
    left = np.flatnonzero(free)
    C = ties.rows[rows]
    pivot = np.asarray(C[np.arange(len(rows)), named]).ravel() if len(rows) else np.zeros(0)
    C = sp.diags(-1.0 / pivot) @ C
    G, E = C[:, left].tocsr(), C[:, named].tolil()
    E.setdiag(0.0)
    E = E.tocsr()
    E.eliminate_zeros()
    given, power = G, E
    for _ in range(200):
        if not power.nnz:
            break
        given, power = (G + E @ given).tocsr(), (E @ power).tocsr()
        power.eliminate_zeros()
    else:
        around = ties.told[ties.of[rows[np.flatnonzero(np.diff(power.indptr))[0]]]]
        raise UserError(f"{around} leads in a circle with others: each gives what the next one needs; take one out")
    place = sp.csr_matrix(
        (np.ones(count - held.sum()), (np.r_[left, named], np.arange(count - held.sum()))),
        shape=(count, count - held.sum()),
    )
    return (place @ sp.vstack([sp.identity(len(left), format="csr"), given])).tocsr(), left


def _chosen(ties: Ties, rows: Indices, T: sp.csr_matrix, left: Indices) -> tuple[sp.csr_matrix, Indices]:
    """The same after the rows that may give any displacement: of each group that shares some the largest pivots."""
    C = ties.rows[rows]
    size = np.sqrt(np.asarray(C.multiply(C).sum(axis=1)).ravel())
    A = (sp.diags(1.0 / np.where(size > 0, size, 1.0)) @ C @ T).tocsr()
    A.data[np.abs(A.data) < _NOTHING] = 0.0
    A.eliminate_zeros()
    if not A.nnz:
        return T, left
    _, group = sp.csgraph.connected_components(sp.bmat([[None, A], [A.T, None]]), directed=False)
    group = group[: A.shape[0]]
    keep, blocks = np.ones(len(left), dtype=bool), []
    for number in np.unique(group[np.diff(A.indptr) > 0]):
        own = A[group == number]
        columns = np.unique(own.indices)
        _, R, order = scipy.linalg.qr(own[:, columns].toarray(), mode="economic", pivoting=True)
        rank = int((np.abs(np.diag(R)) > _NOTHING).sum())
        given, rest = columns[order[:rank]], columns[order[rank:]]
        keep[given] = False
        blocks.append((given, rest, -scipy.linalg.solve_triangular(R[:rank, :rank], R[:rank, rank:])))
    number = np.cumsum(keep) - 1
    at = [np.flatnonzero(keep), *(np.repeat(g, len(r)) for g, r, _ in blocks)]
    places = [number[keep], *(np.tile(number[r], len(g)) for g, r, _ in blocks)]
    data = [np.ones(int(keep.sum())), *(values.ravel() for *_, values in blocks)]
    more = sp.csr_matrix(
        (np.concatenate(data), (np.concatenate(at), np.concatenate(places))), shape=(len(left), int(keep.sum()))
    )
    return (T @ more).tocsr(), left[keep]


def _independent(moved: sp.csc_matrix, n: int) -> sp.csc_matrix:
    """Columns of one reference node turned to orthonormal ones; those that move no point are left out."""
    rows = np.unique(moved.indices[moved.indices < n])
    if not len(rows):
        return moved[:, :0]
    dense = moved[rows].toarray()
    size = np.linalg.norm(dense, axis=0)
    size[size == 0] = 1.0
    _, s, vt = np.linalg.svd(dense / size, full_matrices=False)
    keep = s > 1e-8 * s[0]
    return (moved @ sp.csr_matrix(vt[keep].T / s[keep] / size[:, None])).tocsc()

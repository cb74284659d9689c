"""Jacobians of assemblies: one dense matrix, or blocks in a chain or a ring, factorised block by block."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.linalg

from ..data import Array, largest


class Matrix(Protocol):
    """A square matrix that can be solved with; its vectors are ordered harmonic by harmonic."""

    def solve(self, right: Array) -> Array:
        """(size,) solution; the shortest one where the matrix is singular."""
        ...

    def dense(self) -> Array:
        """(size, size)."""
        ...

    @property
    def transposed(self) -> Matrix: ...


SINGULAR = 1e-10
"""Share of the largest pivot or singular value below which one stands for nothing but rounding."""


@dataclass(frozen=True, eq=False)
class DenseMatrix:
    """Attributes: A: (size, size)."""

    A: Array

    def dense(self) -> Array:
        return self.A

    @property
    def transposed(self) -> Matrix:
        return DenseMatrix(self.A.T)

    @cached_property
    def _factors(self) -> tuple[Array, Array]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)  # a singular matrix is seen to in `solve`
            return scipy.linalg.lu_factor(self.A, check_finite=False)

    def solve(self, right: Array) -> Array:
        """See `Matrix`: the mean place of a free body that slides is nowhere, and takes the shortest step."""
        if not np.isfinite(self.A).all():
            return np.full_like(right, np.nan)
        pivots = np.abs(np.diag(self._factors[0]))
        if pivots.min(initial=1.0) > SINGULAR * pivots.max(initial=0.0):
            step = scipy.linalg.lu_solve(self._factors, right, check_finite=False)
            if largest(step) < 1e10 * np.abs(right).max(initial=1e-300):
                return step
        return np.linalg.lstsq(self.A, right, rcond=SINGULAR)[0]


@dataclass(frozen=True, eq=False)
class CyclicMatrix:
    """Parts that each know only the one before and the one behind, the last one the first perhaps.

    Attributes:
        diagonal: (n,) blocks (s_i, s_i). behind: (n,) blocks (s_i, s_{i+1}), the last one to part 0, or None.
        before: (n,) blocks (s_i, s_{i-1}), the first one from part n - 1, or None. order: (size,) place of every entry
            of a vector ordered by parts in one ordered by harmonics.
    """

    diagonal: list[Array]
    behind: list[Array | None]
    before: list[Array | None]
    order: Array

    def dense(self) -> Array:
        n, pieces = len(self.diagonal), dict[tuple[int, int], Array]()
        for i, d in enumerate(self.diagonal):
            for j, block in ((i + 1, self.behind[i]), (i - 1, self.before[i]), (i, d)):
                if block is not None:
                    pieces[i, j % n] = block
        return assembled(pieces, n, self.order)

    @property
    def transposed(self) -> Matrix:
        n, turn = len(self.diagonal), lambda block: None if block is None else block.T
        behind = [turn(self.before[(i + 1) % n]) for i in range(n)]
        before = [turn(self.behind[i - 1]) for i in range(n)]
        return CyclicMatrix([d.T for d in self.diagonal], behind, before, self.order)

    def solve(self, right: Array) -> Array:
        """See `Matrix`. Blocks of less than the largest size are filled up by a unit matrix."""
        sizes = np.array([len(d) for d in self.diagonal])
        n, most = len(sizes), sizes.max(initial=0)
        filled = np.arange(most) < sizes[:, None]
        D, after, before = (np.zeros((n, most, most)) for _ in range(3))
        D[~filled, np.nonzero(~filled)[1]] = 1.0
        for blocks, out in ((self.diagonal, D), (self.behind, after), (self.before, before)):
            for one, block in zip(out, blocks, strict=True):
                if block is not None:
                    one[: len(block), : block.shape[1]] = block
        r, found = np.zeros((n, most)), np.empty_like(right)
        r[filled] = right[self.order]
        found[self.order] = around(D, after, before, r)[filled]
        if np.isfinite(found).all() and np.abs(found).max() < 1e10 * np.abs(right).max(initial=1e-300):
            return found
        return DenseMatrix(self.dense()).solve(right)


def around(D: Array, behind: Array, before: Array, r: Array) -> Array:
    """(n, s) x of a ring, D_i x_i + behind_i x_(i+1) + before_i x_(i-1) = r_i, by cyclic reduction: every second part
    is eliminated, all at once as they do not know each other, and what is left is a ring of half as many."""
    n, s = r.shape
    if n <= FEW:
        A, at = np.zeros((n, s, n, s)), np.arange(n)
        for block, to in ((D, at), (behind, (at + 1) % n), (before, (at - 1) % n)):
            A[at, :, to] += block
        return _solved(A.reshape(n * s, n * s), r.ravel()).reshape(n, s)
    out, kept = np.arange(1, n - n % 2, 2), np.arange(0, n, 2)
    X = _solved(D[out], np.concatenate([r[out, :, None], before[out], behind[out]], axis=2))
    D, r, after, ahead = D[kept].copy(), r[kept].copy(), behind[kept], before[kept]
    m = len(out)  # the part behind the kept ones 0 to m - 1, and before those 1 to m, on from 0 if there is none
    up, down = np.arange(m), np.arange(1, m + 1) % len(kept)
    behind_it, before_it = after[up] @ X, ahead[down] @ X
    r[up] -= behind_it[..., 0]
    r[down] -= before_it[..., 0]
    D[up] -= behind_it[..., 1 : 1 + s]
    D[down] -= before_it[..., 1 + s :]
    after[up], ahead[down] = -behind_it[..., 1 + s :], -before_it[..., 1 : 1 + s]
    x = np.empty((n, s))
    x[kept] = around(D, after, ahead, r)
    between = np.concatenate([x[out - 1], x[(out + 1) % n]], axis=1)[..., None]
    x[out] = X[..., 0] - (X[..., 1:] @ between)[..., 0]
    return x


FEW = 3
"""Parts of a ring that are solved for together."""


def _solved(A: Array, B: Array) -> Array:
    try:
        return np.linalg.solve(A, B)
    except np.linalg.LinAlgError:
        return np.full_like(B, np.nan)


def one_plus(pieces: dict[tuple[int, int], Array], sizes: list[int], coefficients: int) -> Matrix:
    """1 + the blocks (i, j) -> (W s_i, W s_j), as what can be solved fastest, however the parts are
    numbered. The blocks (i, i) are overwritten."""
    n = len(sizes)
    diagonal = [pieces[i, i] for i in range(n)]
    for block, s in zip(diagonal, sizes, strict=True):
        block.flat[:: coefficients * s + 1] += 1.0
    if n == 1:
        return DenseMatrix(diagonal[0])
    if n > 2 and (row := in_a_row(n, pieces)):
        behind, before = [*row[1:], row[0]], [row[-1], *row[:-1]]
        return CyclicMatrix(
            [diagonal[i] for i in row],
            [pieces.get(pair) for pair in zip(row, behind, strict=True)],
            [pieces.get(pair) for pair in zip(row, before, strict=True)],
            _order(sizes, coefficients, row),
        )
    return DenseMatrix(assembled(pieces, n, _order(sizes, coefficients, range(n))))


def assembled(pieces: dict[tuple[int, int], Array], n: int, order: Array) -> Array:
    """(size, size) of the blocks (i, j) of n parts; order: see `CyclicMatrix`."""
    begins = np.cumsum([0, *(len(pieces[i, i]) for i in range(n))])
    A = np.zeros((begins[-1], begins[-1]))
    for (i, j), block in pieces.items():
        A[begins[i] : begins[i + 1], begins[j] : begins[j + 1]] = block
    out = np.empty_like(A)
    out[np.ix_(order, order)] = A
    return out


def in_a_row(n: int, pairs: Iterable[tuple[int, int]]) -> list[int]:
    """The n parts in an order in which each is paired with those beside it alone, the last one
    with the first perhaps: chains one after the other, or one ring. Empty: there is none."""
    beside: list[set[int]] = [set() for _ in range(n)]
    for i, j in pairs:
        if i != j:
            beside[i].add(j)
            beside[j].add(i)
    if max(map(len, beside)) > 2:
        return []
    row: dict[int, None] = {}
    for begin in sorted(range(n), key=lambda i: len(beside[i]) == 2):  # chains at their ends
        if row and begin not in row and len(beside[begin]) == 2:
            return []  # a ring beside others
        at: int | None = begin if begin not in row else None
        while at is not None:
            row[at] = None
            at = next((j for j in sorted(beside[at]) if j not in row), None)
    return list(row)


def _order(sizes: list[int], coefficients: int, row: Iterable[int]) -> Array:
    """Places in a vector ordered by harmonics, then parts, of one ordered by parts as they are in
    a row, then harmonics."""
    total, begins = sum(sizes), np.cumsum([0, *sizes])
    return np.concatenate(
        [(np.arange(coefficients)[:, None] * total + np.arange(begins[i], begins[i + 1])).ravel() for i in row]
    )

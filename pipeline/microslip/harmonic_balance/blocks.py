"""Jacobians of assemblies: one dense matrix, or blocks in a chain or a ring, factorised block by block."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.linalg

from ..data import Array


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
class Dense:
    """Attributes: A: (size, size)."""

    A: Array

    def dense(self) -> Array:
        return self.A

    @property
    def transposed(self) -> Matrix:
        return Dense(self.A.T)

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
            if np.abs(step).max(initial=0.0) < 1e10 * np.abs(right).max(initial=1e-300):
                return step
        return np.linalg.lstsq(self.A, right, rcond=SINGULAR)[0]


@dataclass(frozen=True, eq=False)
class Cyclic:
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
        begins = np.cumsum([0, *(len(d) for d in self.diagonal)])
        A, n = np.zeros((begins[-1], begins[-1])), len(self.diagonal)
        for i, d in enumerate(self.diagonal):
            for j, block in ((i, d), ((i + 1) % n, self.behind[i]), ((i - 1) % n, self.before[i])):
                if block is not None:
                    A[begins[i] : begins[i + 1], begins[j] : begins[j + 1]] += block
        out = np.empty_like(A)
        out[np.ix_(self.order, self.order)] = A
        return out

    @property
    def transposed(self) -> Matrix:
        n, turn = len(self.diagonal), lambda block: None if block is None else block.T
        behind = [turn(self.before[(i + 1) % n]) for i in range(n)]
        return Cyclic([d.T for d in self.diagonal], behind, [turn(self.behind[i - 1]) for i in range(n)], self.order)

    def solve(self, right: Array) -> Array:
        """See `Matrix`. Block elimination; what goes round the ring is carried along as one more block column."""
        begins = np.cumsum([0, *(len(d) for d in self.diagonal)])
        pieces = [right[self.order[a:b]] for a, b in zip(begins[:-1], begins[1:], strict=True)]
        found = np.empty_like(right)
        found[self.order] = np.concatenate(self._eliminated(pieces))
        if np.isfinite(found).all() and np.abs(found).max() < 1e10 * np.abs(right).max(initial=1e-300):
            return found
        return Dense(self.dense()).solve(right)

    def _eliminated(self, r: list[Array]) -> list[Array]:
        """x by parts. Parts 0 to n - 2 are a chain, the last one closes it."""
        n, diagonal = len(r), self.diagonal[0]
        X: list[Array] = []  # of each part: columns of its own right side, of the last part, of the one behind
        for i in range(n - 1):
            right = np.column_stack([r[i], self._closing(i)])
            lower, upper = self.before[i] if i else None, self.behind[i] if i < n - 2 else None
            if i:
                diagonal = self.diagonal[i]
            if lower is not None:
                width = right.shape[1]
                right = right - lower @ X[-1][:, :width]
                if X[-1].shape[1] > width:
                    diagonal = diagonal - lower @ X[-1][:, width:]
            X.append(_solved(diagonal, right if upper is None else np.column_stack([right, upper])))
        width = 1 + len(self.diagonal[-1])
        for i in range(n - 3, -1, -1):
            X[i] = X[i][:, :width] - (X[i][:, width:] @ X[i + 1][:, :width] if X[i].shape[1] > width else 0.0)
        last, value = self.diagonal[-1], r[-1]
        for i, block in ((0, self.behind[-1]), (n - 2, self.before[-1])):
            if block is not None:
                last, value = last - block @ X[i][:, 1:], value - block @ X[i][:, 0]
        end = _solved(last, value)
        return [*(x[:, 0] - x[:, 1:] @ end for x in X), end]

    def _closing(self, i: int) -> Array:
        """(s_i, s_last) block from part i to the last one."""
        n = len(self.diagonal)
        out = np.zeros((len(self.diagonal[i]), len(self.diagonal[-1])))
        if i == 0 and self.before[0] is not None:
            out += self.before[0]
        behind = self.behind[n - 2]
        if i == n - 2 and behind is not None:
            out += behind
        return out


def _solved(A: Array, B: Array) -> Array:
    try:
        return np.linalg.solve(A, B)
    except np.linalg.LinAlgError:
        return np.full_like(B, np.nan)


def one_plus(
    pieces: dict[tuple[int, int], Array], sizes: list[int], coefficients: int, by_parts: bool = False
) -> Matrix:
    """1 + the blocks (i, j) -> (W s_i, W s_j), as what can be solved fastest. The blocks (i, i) are overwritten.

    Args:
        by_parts: whether vectors are ordered by parts, each by its harmonics.
    """
    n = len(sizes)
    diagonal = [pieces[i, i] for i in range(n)]
    for block, s in zip(diagonal, sizes, strict=True):
        block.flat[:: coefficients * s + 1] += 1.0
    if n == 1:
        return Dense(diagonal[0])
    order = np.arange(coefficients * sum(sizes)) if by_parts else _order(sizes, coefficients)
    whole = Cyclic(diagonal, [None] * n, [None] * n, order)
    if n > 2 and all((i - j) % n in (0, 1, n - 1) for i, j in pieces):
        whole.behind[:] = [pieces.get((i, (i + 1) % n)) for i in range(n)]
        whole.before[:] = [pieces.get((i, (i - 1) % n)) for i in range(n)]
        return whole
    begins = np.cumsum([0, *(coefficients * s for s in sizes)])
    A = np.zeros((begins[-1], begins[-1]))
    for i in range(n):
        A[begins[i] : begins[i + 1], begins[i] : begins[i + 1]] = diagonal[i]
    for (i, j), block in pieces.items():
        if i != j:
            A[begins[i] : begins[i + 1], begins[j] : begins[j + 1]] = block
    if by_parts:
        return Dense(A)
    out = np.empty_like(A)
    out[np.ix_(whole.order, whole.order)] = A
    return Dense(out)


def _order(sizes: list[int], coefficients: int) -> Array:
    """Places in a vector ordered by harmonics, then parts, of one ordered by parts, then harmonics."""
    total, begins = sum(sizes), np.cumsum([0, *sizes])
    return np.concatenate(
        [
            (np.arange(coefficients)[:, None] * total + np.arange(b, e)).ravel()
            for b, e in zip(begins[:-1], begins[1:], strict=True)
        ]
    )

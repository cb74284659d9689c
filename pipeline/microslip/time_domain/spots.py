"""How modes move the points of contact, and what forces of the points are to the modes, without what is zero.

A blade of a ring moves by modes of its own. What is not zero of each point's row stands together, with the points last,
so that a product is done side by side for all of them: of 24 blades a twelfth of the numbers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ..data import Array
from .contacts import times

SPARSE = 4
"""Times fewer modes than there are have to move each point, lest gathering them costs more than it saves."""


class Spots(NamedTuple):
    """Of n points. Where all modes move all points, s = m, columns and back are None.

    Attributes:
        D: (s, 3, n), or (3 n, m) of all modes. columns: (s, n) modes that move each point. back: (l, m) where in the
            (s n,) shares of the points those of each mode stand, s n: in none. D_o: (j, 3, n) by the loads' harmonics.
            rest: (3, n) m where d = 0.
    """

    D: Any
    columns: Any
    back: Any
    D_o: Any
    rest: Any


def spots(D: Array, D_o: Array, rest: Array) -> Spots:
    """Of points with motions D (n, 3, m) and D_o (n, 3, j), that rest at (n, 3)."""
    n, _, m = D.shape
    own = [np.flatnonzero(row.any(axis=0)) for row in D]
    s = max(map(len, own))
    given = D_o.transpose(2, 1, 0), rest.T
    if SPARSE * s > m:
        return Spots(D.transpose(1, 0, 2).reshape(3 * n, m), None, None, *given)
    columns, few = np.zeros((s, n), int), np.zeros((s, 3, n))
    stands = list[list[int]]([] for _ in range(m))
    for i, modes in enumerate(own):
        columns[: len(modes), i], few[: len(modes), :, i] = modes, D[i][:, modes].T
        for row, mode in enumerate(modes):
            stands[mode].append(row * n + i)
    back = np.full((max(map(len, stands)), m), s * n)
    for j, found in enumerate(stands):
        back[: len(found), j] = found
    return Spots(few, columns, back, *given)


def by_modes(S: Spots, q: Any, o: Any) -> Any:
    """(3, n) of the points by modal coordinates (m,) and o (j,), or by their rates."""
    given = (S.D_o * o[:, None, None]).sum(axis=0)
    if S.columns is None:
        return given + times(S.D, q).reshape(given.shape)
    return given + (S.D * q[S.columns][:, None]).sum(axis=0)


def to_modes(S: Spots, force: Any) -> Any:
    """(m,) modal forces by those of the points, (n, 3) N."""
    if S.columns is None:
        return times(S.D.T, force.T.reshape(-1))
    shares = (S.D * force.T).sum(axis=1).reshape(-1)
    return jnp.concatenate([shares, jnp.zeros(1)])[S.back].sum(axis=0)

"""A patch of many points by few of them, for derivatives that need not be exact.

The points of a patch that few coordinates move share their motion, so that few of them tell how the resultants follow
it: of 360 points of a rough contact that slides, 28 give Newton's steps within some thousandths.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..data import Array, Indices
from .law import Law, point_axes
from .patch import Patch
from .portion import portion

FEW = 24
"""Points that are enough, about."""

UNLIKE = 3.0
"""Times the mean that a point may stand for."""


@dataclass(frozen=True, eq=False)
class Thinned:
    """Some points of a patch. chosen: (m,) which; share: (m,) how many points each of them stands for."""

    chosen: Indices
    share: Array

    def law(self, law: Law, n: int) -> Law:
        """A law of n points for the few."""
        leaves, tree = jax.tree_util.tree_flatten(law)

        def few(leaf: Any, axis: int | None) -> Any:
            return leaf if axis is None else jnp.take(jnp.asarray(leaf), self.chosen, axis=axis)

        each = [few(x, axis) for x, axis in zip(leaves, point_axes(law, n), strict=True)]
        return portion(jax.tree_util.tree_unflatten(tree, each), jnp.asarray(self.share))

    def patch(self, patch: Patch) -> Patch:
        """A patch by its few points."""
        shapes = None if patch.shapes is None else patch.shapes[self.chosen]
        points, areas = patch.points[self.chosen], patch.areas[self.chosen] * self.share
        return replace(patch, points=points, areas=areas, law=self.law(patch.law, len(patch.points)), shapes=shapes)


def thinned(patch: Patch) -> Thinned | None:
    """About `FEW` points of a patch, as stiff as all of them where all are equal; None where they cannot be.

    Every p-th one, p a prime that the count is no multiple of, lest all stand in one row of a grid. Shares are the
    nearest to equal ones for which the sums of G_n^T G_n and G_t^T G_t over the points are those of all of them.
    """
    G, n = patch.kinematics, len(patch.points)
    steps = [p for p in range(2, n // FEW + 1) if n % p and all(p % q for q in range(2, p))]
    if not steps or G.shape[2] ** 2 > FEW * 2:
        return None
    chosen = np.arange(0, n, steps[-1])
    both = np.concatenate([np.einsum("nia,nib->nab", g, g).reshape(n, -1) for g in (G[:, :1], G[:, 1:])], axis=1)
    both = both[:, used] / np.abs(both[:, used]).max(axis=0) if (used := both.any(axis=0)).any() else both[:, used]
    whole, few, even = both.sum(axis=0), both[chosen].T, np.full(len(chosen), n / len(chosen))
    share = even + np.linalg.lstsq(few, whole - few @ even, rcond=1e-10)[0]
    kept = np.allclose(few @ share, whole, rtol=0.0, atol=1e-9 * n)
    return Thinned(chosen, share) if kept and (np.abs(np.log(share / even)) < np.log(UNLIKE)).all() else None

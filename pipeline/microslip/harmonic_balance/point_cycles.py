"""What the points of a patch do in a cycle."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.harmonics import fourier
from ..contact.law import Law, State, Step
from ..contact.periodic import periodic
from ..contact.point import PointContact
from ..data import Array
from ..programs import seldom


def needs_rate(law: Law) -> bool:
    """Whether the force depends on the speed of the motion, and not on its path alone."""
    return not (isinstance(law, PointContact) and law.friction.constant and law.damping is None)


class Cycle(NamedTuple):
    """What the n points of a patch do in one cycle.

    Attributes:
        dissipated: (n,) J, work done on the points. by_slip: (n,) J, friction force times the path slid; without what
            area that opens under load takes with it. lost: (n,) J that the law itself counts, see `Law.lost`.
            slipping, open: (n,) share of the cycle.
        unsteady: largest change of a resultant's sample against the cycle before, over the largest resultant force.
    """

    dissipated: Array
    by_slip: Array
    lost: Array
    slipping: Array
    open: Array
    unsteady: float

    @property
    def taken(self) -> Array:
        """(n,) J that the law counts as lost; the work done on the points where it counts nothing."""
        return np.where(np.isfinite(self.lost), self.lost, self.dissipated)


class Traced(NamedTuple):
    """What a force model makes of the points of a patch in time: force (s, n, 3) N of s samples of a cycle along n, t1,
    t2, the first one at the cycle's beginning, and the sums over the cycle."""

    force: Array
    cycle: Cycle


def traced(
    law: Law, G: Array, u: Array, period: float, samples: int, count: int, periodicity: float = 0.0,
    waves: tuple[Array, Array] | None = None,
) -> Traced:  # fmt: skip
    """One more cycle than the force is found from, looked at in time.

    Args:
        law: of n points. G: (n, 3, k) kinematics. u: (k, 2 H + 1) mean, cos, sin, cos 2, ... period: s.
        samples: of a cycle. count: cycles marched at most before. periodicity: see `contact.periodic.periodic`.
        waves: (s, W) of another series at the samples, and its derivative over the time in cycles.
    """
    if waves is None:
        values = np.asarray(fourier(u.shape[1] // 2, samples)[0])
        waves = values, 2 * np.pi * values @ derivative(u.shape[1])
    parts = _point_cycles(law, G, u, float(period), *waves, count, periodicity)
    dissipated, by_slip, lost, slipping, open_ = (np.asarray(p) for p in parts[:5])
    return Traced(parts[6], Cycle(dissipated, by_slip, lost, slipping, open_, float(parts[5])))


def above_rounding(terms: Any, axes: Any) -> Any:
    """Sums of works that come and go over axes of an array; zero where what is left is rounding of what came."""
    total = terms.sum(axis=axes)
    return total * (abs(total) > ROUNDING * abs(terms).sum(axis=axes))


ROUNDING = 1e-13
"""Share of the work that goes to and fro in a cycle below which what is lost is not told from zero."""

OF_STEPS = 1e-10
"""The same of what the law counts, which adds up the rounding of every step and of a cycle that is periodic so far."""


def derivative(coefficients: int) -> Array:
    """(W, W) harmonics mean, cos, sin, cos 2, ... of a signal's derivative over Omega t from its own."""
    out = np.zeros((coefficients, coefficients))
    for h in range(1, coefficients // 2 + 1):
        out[2 * h - 1, 2 * h], out[2 * h, 2 * h - 1] = h, -h
    return out


@partial(seldom, static_argnames=("count",))
def _point_cycles(
    law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, values: jax.Array, ahead: jax.Array, count: int,
    periodicity: jax.Array | float,
) -> tuple[jax.Array, ...]:  # fmt: skip
    samples = len(values)
    path, ahead = (jnp.einsum("sk,nia,ak->sni", v, G, u) for v in (values, ahead))
    before, state = periodic(law, path, period, count, periodicity)[:2]
    moved = path - jnp.roll(path, 1, axis=0)
    dt = period / samples

    def one(state: State, row: tuple[jax.Array, ...]) -> tuple[State, tuple[jax.Array, ...]]:
        force, after = law.step(row[0], row[1] / dt, dt, state)
        lost = law.lost(Step(row[0], row[1], dt, row[2], force, state, after))
        return after, (force, law.slip(after) - law.slip(state), lost)

    _, (force, slid, lost) = jax.lax.scan(one, state, (path, moved, jnp.roll(before, 1, axis=0)))
    mean = 0.5 * (force + jnp.roll(force, 1, axis=0))
    open_ = force[..., 0] <= 0
    moves = jnp.abs(slid).max(axis=-1) > 1e-9 * jnp.abs(moved).max()
    slips = moves & ~open_
    change = jnp.einsum("nia,sni->sa", G, force - before)[:, :3]
    size = jnp.abs(jnp.einsum("nia,sni->sa", G, force)[:, :3]).max()
    unsteady = jnp.where(size > 0, jnp.abs(change).max() / jnp.where(size > 0, size, 1.0), 0.0)
    by_slip = jnp.sum(mean[..., 1:] * slid * moves[..., None], axis=(0, 2))
    works = force * ahead / samples
    work, lost = above_rounding(works, (0, 2)), lost.sum(axis=0)
    lost = jnp.where(abs(lost) < OF_STEPS * abs(works).sum(axis=(0, 2)), 0.0, lost)  # not a number stays one
    return work, by_slip, lost, slips.mean(axis=0), open_.mean(axis=0), unsteady, force

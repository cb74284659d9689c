"""Harmonics of contact forces: equal contacts evaluated together, laws marched in time.

A force model answers `force(u, period)` -> (c, k, W) and `forces(u, period)` -> that and its derivative
(c, k, W, k, W), for c contacts of k coordinates and W = 2 H + 1 harmonics (mean, cos, sin, cos 2, ...), from their
displacements u (c, k, W).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.harmonics import CHUNK, CHUNK_ALONE, force_harmonics, force_near
from ..contact.law import Law, State, Step, point_axes
from ..contact.patch import Patch, thinned
from ..contact.periodic import Known, periodic, unknown, with_slopes
from ..contact.point import PointContact
from ..data import Array
from ..programs import often, program, seldom
from ..series import Torus, cycle_waves


class Forces(Protocol):
    """What a harmonic balance needs of c equal contacts."""

    def force(self, u: Array, period: float) -> Array:
        """(c, k, W) N and N m."""
        ...

    def forces(self, u: Array, period: float) -> tuple[Array, Array]:
        """`force` and its derivative (c, k, W, k, W) with respect to u."""
        ...

    def near(self, u: Array, period: float, known: Any) -> tuple[Array, Any]:
        """`force`, found from what is known of a motion near by, None if nothing is; and what is known now."""
        ...

    def rate(self, u: Array, period: float) -> Array | None:
        """(c, k, W) derivative of `force` with respect to the period, N/s; None where it is zero."""
        ...

    def point_cycles(self, u: Array, period: float) -> list[Cycle]:
        """What the points of each contact do in a cycle."""
        ...

    def traced(self, u: Array, period: float) -> list[Traced]:
        """The same with the points' forces in time, those that `force` is made of."""
        ...


@dataclass(frozen=True, eq=False)
class AFT:
    """The law of a patch, marched point by point: alternating frequency/time.

    Attributes:
        patch. contacts: c, how many equal ones. samples: of a cycle. cycles: at most, the last one counts.
        periodicity: they end when the sliders are periodic within this share of the largest force; 0 marches all.
        torus: of motions of two frequencies, W their coefficients and the cycle its closed line; None: of one.
        seldom: whether the forces are asked for some dozens of times only, as of an estimate of error.
        laws: (c,) of contacts that differ in numbers alone; None: all have the patch's.
    """

    patch: Patch
    contacts: int
    samples: int
    cycles: int
    periodicity: float = 1e-10
    torus: Torus | None = None
    seldom: bool = False
    laws: tuple[Law, ...] | None = None

    def waves(self, coefficients: int) -> tuple[Array, Array, Array]:
        """(s, W) of the series at the samples of a cycle, its derivative over the time in cycles there, and (W, s) its
        coefficients from samples."""
        return cycle_waves(coefficients // 2, self.samples) if self.torus is None else self.torus.waves

    @cached_property
    def law(self) -> Law:
        """The law for the points of all contacts."""
        if self.laws is not None:
            return beside(self.laws, len(self.patch.points))
        return repeated(self.patch.law, len(self.patch.points), self.contacts)

    @property
    def _programs(self) -> tuple[Any, Any]:
        """What finds the force, and the force with its derivative."""
        return _many if self.many else _seldom if self.seldom else _few

    @property
    def many(self) -> bool:
        """Whether there are more points than are differentiated at a time."""
        return self.contacts * len(self.patch.points) > CHUNK

    @cached_property
    def few(self) -> AFT:
        """Of some of the points where they are more than enough, for derivatives that need not be exact."""
        found = thinned(self.patch) if self.many else None
        if found is None:
            return self
        n = len(self.patch.points)
        laws = None if self.laws is None else tuple(found.law(law, n) for law in self.laws)
        return replace(self, patch=found.patch(self.patch), laws=laws)

    @cached_property
    def kinematics(self) -> Any:
        """(n, 3, k) jax array."""
        return jax.device_put(self.patch.kinematics)

    def _given(self, u: Array, period: float) -> tuple[Any, ...]:
        """Arguments of the programs; a NumPy number as the period would compile them again."""
        return self.law, self.kinematics, u, float(period), self.periodicity, self.samples, self.cycles

    def _given_on_line(self, u: Array, period: float) -> tuple[Any, ...]:
        assert self.torus is not None
        return self.law, self.kinematics, u, float(period), self.periodicity, *self.torus.waves, self.cycles

    def force(self, u: Array, period: float) -> Array:
        return self.near(u, period, None)[0]

    def near(self, u: Array, period: float, known: Known | None) -> tuple[Array, Known | None]:
        if self.torus is not None:
            return np.asarray(_on_line(*self._given_on_line(u, period))), None
        alone, _ = self._programs
        F, known = alone(*self._given(u, period), self._unknown if known is None else known)
        return np.asarray(F), known

    @cached_property
    def _unknown(self) -> Known:
        return unknown(self.law, self.contacts * len(self.patch.points))

    def forces(self, u: Array, period: float) -> tuple[Array, Array]:
        if self.torus is not None:
            F, J = _slopes_on_line(*self._given_on_line(u, period))
        else:
            _, both = self._programs
            F, J = both(*self._given(u, period))
        return np.asarray(F), np.asarray(J)

    def rate(self, u: Array, period: float) -> Array | None:
        if not needs_rate(self.patch.law):
            return None
        return np.asarray(_rate(*self._given(u, period)))

    def point_cycles(self, u: Array, period: float) -> list[Cycle]:
        return [one.cycle for one in self.traced(u, period)]

    def traced(self, u: Array, period: float) -> list[Traced]:
        G = self.kinematics
        given = self.samples, self.cycles, self.periodicity, self.waves(u.shape[2])[:2]
        laws = self.laws or (self.patch.law,) * len(u)
        return [traced(law, G, one, period, *given) for law, one in zip(laws, u, strict=True)]


def repeated(law: Law, n: int, times: int) -> Law:
    """A law of n points for `times` times as many: what it has per point is repeated."""
    if times == 1:
        return law
    leaves, tree = jax.tree_util.tree_flatten(law)
    axes = point_axes(law, n)

    def more(leaf: Any, axis: int | None) -> Any:
        if axis is None:
            return leaf
        return jnp.concatenate([jnp.asarray(leaf)] * times, axis=axis)

    return jax.tree_util.tree_unflatten(tree, [more(x, a) for x, a in zip(leaves, axes, strict=True)])


def beside(laws: Sequence[Law], n: int) -> Law:
    """One law for the n points of each of several that differ in numbers alone: what differs stands once a point."""
    leaves, (tree, *_) = zip(*map(jax.tree_util.tree_flatten, laws), strict=True)

    def joined(values: Sequence[Any], axis: int | None) -> Any:
        if axis is not None:
            return jnp.concatenate([jnp.asarray(x) for x in values], axis=axis)
        same = all(np.array_equal(x, values[0]) for x in values[1:])
        return values[0] if same else jnp.repeat(jnp.stack([jnp.asarray(x) for x in values]), n)

    each = zip(zip(*leaves, strict=True), point_axes(laws[0], n), strict=True)
    return jax.tree_util.tree_unflatten(tree, [joined(values, axis) for values, axis in each])


def _points(G: jax.Array, u: jax.Array) -> jax.Array:
    """(c n, 3, W) displacements of all points."""
    return jnp.einsum("nia,caw->cniw", G, u).reshape(-1, 3, u.shape[2])


def _with_slopes(
    law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, periodicity: jax.Array | float, samples: int,
    count: int,
) -> tuple[jax.Array, jax.Array]:  # fmt: skip
    c, n, W = u.shape[0], G.shape[0], u.shape[2]
    force, slope = force_harmonics(law, _points(G, u), period, samples, count, CHUNK, periodicity)
    half = jnp.einsum("nia,cnikjl->cnajkl", G, slope.reshape(c, n, 3, W, 3, W))
    return jnp.einsum("nia,cniw->caw", G, force.reshape(c, n, 3, W)), jnp.einsum("cnajkl,njb->cakbl", half, G)


def _force(
    law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, periodicity: jax.Array | float, samples: int,
    count: int, known: Known,
) -> tuple[jax.Array, Known]:  # fmt: skip
    force, known = force_near(law, _points(G, u), known, period, samples, count, CHUNK_ALONE, periodicity)
    return jnp.einsum("nia,cniw->caw", G, force.reshape(u.shape[0], G.shape[0], 3, u.shape[2])), known


def _compiled(how: Any) -> tuple[Any, Any]:
    return how(_force, static_argnames=("samples", "count")), how(_with_slopes, static_argnames=("samples", "count"))


_few, _seldom, _many = map(_compiled, (program, seldom, often))


@partial(program, static_argnames=("samples", "count"))
def _rate(
    law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, periodicity: jax.Array | float, samples: int,
    count: int,
) -> jax.Array:  # fmt: skip
    def of(T: jax.Array) -> jax.Array:
        return _force(law, G, u, T, periodicity, samples, count, unknown(law, u.shape[0] * G.shape[0]))[0]

    return jax.jvp(of, (period,), (jnp.ones(()),))[1]


@partial(program, static_argnames=("count",))
def _slopes_on_line(
    law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, periodicity: jax.Array | float, values: jax.Array,
    ahead: jax.Array, transform: jax.Array, count: int,
) -> tuple[jax.Array, jax.Array]:  # fmt: skip
    """`_with_slopes` of any series (s, W) in place of a cycle's."""
    c, n, W = u.shape[0], G.shape[0], u.shape[2]
    path, rate = _path(G, u, values), _path(G, u, ahead) / period
    found, slope = with_slopes(law, path, rate, period, count, periodicity, values, ahead, transform)
    slope = slope.reshape(W, W, 3, c, n, 3)  # of force w by motion x along j, of point n of contact c along i
    return _summed(G, found.force, c, transform), jnp.einsum("nia,wxjcni,njb->cawbx", G, slope, G)


@partial(program, static_argnames=("count",))
def _on_line(
    law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, periodicity: jax.Array | float, values: jax.Array,
    ahead: jax.Array, transform: jax.Array, count: int,
) -> jax.Array:  # fmt: skip
    path, rate = _path(G, u, values), _path(G, u, ahead) / period
    return _summed(G, periodic(law, path, period, count, periodicity, rate).force, u.shape[0], transform)


def _path(G: jax.Array, u: jax.Array, values: jax.Array) -> jax.Array:
    """(s, c n, 3) of all points."""
    return jnp.einsum("sw,nia,caw->scni", values, G, u).reshape(len(values), -1, 3)


def _summed(G: jax.Array, force: jax.Array, c: int, transform: jax.Array) -> jax.Array:
    """(c, k, W) of forces (s, c n, 3)."""
    return jnp.einsum("ws,scni,nia->caw", transform, force.reshape(len(force), c, -1, 3), G)


# what points do in a cycle -----------------------------------------------------------------------


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
    waves = waves or cycle_waves(u.shape[1] // 2, samples)[:2]
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


@partial(seldom, static_argnames=("count",))
def _point_cycles(
    law: Law, G: jax.Array, u: jax.Array, period: jax.Array | float, values: jax.Array, ahead: jax.Array, count: int,
    periodicity: jax.Array | float,
) -> tuple[jax.Array, ...]:  # fmt: skip
    samples = len(values)
    path, ahead = (jnp.einsum("sk,nia,ak->sni", v, G, u) for v in (values, ahead))
    before, state = periodic(law, path, period, count, periodicity, ahead / period)[:2]
    moved = path - jnp.roll(path, 1, axis=0)
    dt = period / samples

    def one(state: State, row: tuple[jax.Array, ...]) -> tuple[State, tuple[jax.Array, ...]]:
        u, rate, moved, force_before = row
        force, after = law.step(u, rate, dt, state)
        lost = law.lost(Step(u, moved, dt, force_before, force, state, after))
        return after, (force, law.slip(after) - law.slip(state), lost)

    _, (force, slid, lost) = jax.lax.scan(
        one, state, (path, ahead / period, moved, jnp.roll(before, 1, axis=0))
    )
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


# memory ------------------------------------------------------------------------------------------


GIB = 2.0**30

BASE = 0.5 * GIB
"""Of a process with its packages and compiled programs."""


def aft_bytes(points: int, coordinates: int, harmonics: int, samples: int, contacts: int = 1) -> float:
    """Peak of the memory that a response with the law of a patch takes; measured it is within a factor of 2, and up to
    3 times less with thousands of samples of laws whose memory is solved for.

    At the peak stand either the derivatives, W = 2 H + 1: the tangents of the force along 3 W harmonics in every sample
    of `CHUNK` points, then (3, W, 3, W) of every point, twice, and half contracted (k, W, 3, W); or ten
    histories (3 a sample and point) of one cycle that is looked at in time.

    Args:
        points: of a patch. coordinates: k of it. contacts: equal ones, evaluated together.
    """
    W, n = 2 * harmonics + 1, points * contacts
    derivatives = samples * 3 * W * min(n, CHUNK) * 3 + n * W * W * (2 * 9 + 3 * coordinates)
    return BASE + 8.0 * max(derivatives, 10 * samples * points * 3)


def of_this_machine() -> float:
    """Bytes that a process may have: the machine's, or what a control group leaves of them; infinite if unknown."""
    try:
        found = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return float("inf")
    for name in ("memory.max", "memory/memory.limit_in_bytes"):
        try:
            text = Path("/sys/fs/cgroup", name).read_text(encoding="ascii").strip()
        except (OSError, UnicodeDecodeError):
            continue
        found = min(found, float(text)) if text.isdecimal() else found
    return found

"""Floquet multipliers of a periodic solution, with contacts that remember.

A perturbation of the state (q, q', slider states) is carried through one period along the solution; the eigenvalues
of that map are the multipliers, the solution is stable if none lies outside the unit circle. The contact laws are
linearised at every time step (`jax.jvp` through `Law.step`), the body moves by the implicit midpoint rule, which needs
no force between two states of a law and adds no damping of its own (E. Hairer, C. Lubich and G. Wanner, Geometric
Numerical Integration, Springer 2006, II.1). Its error is h^2, so that two step lengths give the limit and a bound.

Not all of the state is looked at. Perturbations of the motion reach what they can; where no direction is added any
more the map is closed. A slider that sticks all the time keeps whatever offset it is given: a multiplier of exactly 1
for each, which no motion reaches and which says nothing about the motion. A slider that slides forgets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.elements import Spring
from ..contact.law import Law, State
from ..contact.periodic import periodic
from ..data import Array, ComplexArray, largest
from ..errors import UserError
from ..programs import inner
from ..series import derivative, summed
from .problem import Problem

Loss = Literal["", "fold", "flip", "Neimark-Sacker"]

SETTLED = 1e-10
"""Change of the contact forces from one cycle to the next, over the largest, at which the sliders count as periodic."""


@dataclass(frozen=True)
class ForcedOrbit:
    """A periodic motion of M q'' + C q' + K q + T^T F = f(t), d = T q - B F, and all that moves along with it.

    Attributes:
        M, C, K: (m, m); C with the gyroscopic matrix. rows: (c, m) contact coordinates T. compliance: (c, c) B that the
            modes leave out, m/N.
        laws: contact laws, in the order of the rows. kinematics: of each (n, 3, b) motion of its points per unit of its
            b rows.
        displacement: (c, 2 H + 1) d as the laws measure it: mean, cos, sin, cos 2, ... Omega: rad/s.
        cycles: at most, marched from rest until the sliders are periodic.
    """

    M: Array
    C: Array
    K: Array
    rows: Array
    compliance: Array
    laws: tuple[Law, ...]
    kinematics: tuple[Array, ...]
    displacement: Array
    Omega: float
    cycles: int = 100

    @property
    def period(self) -> float:
        """s."""
        return 2 * np.pi / self.Omega

    @property
    def blocks(self) -> list[slice]:
        """Rows of each law."""
        ends = np.cumsum([0, *(G.shape[2] for G in self.kinematics)])
        return [slice(int(a), int(b)) for a, b in zip(ends, ends[1:], strict=False)]


def orbit(problem: Problem, x: Array, Omega: float) -> ForcedOrbit:
    """The motion in time that unknowns x (k,) of a problem stand for at Omega (rad/s).

    Raises:
        UserError: a sector that stands for a ring: its sectors need not stay alike, unroll the assembly; a flow that
            tells the directions of a wave apart.
    """
    if problem.assembly.ring is not None:
        raise UserError("stability: a sector cannot tell whether the sectors of its ring stay alike; take all of them")
    contacts = problem.assembly.contacts
    part = problem.parts[1][0] if len(problem.parts[1]) == 1 else problem.assembly.joined(1)
    if any(np.iscomplexobj(f.K) or np.iscomplexobj(f.C) for f in problem.assembly.flow):
        raise UserError(
            "stability: the flow tells the two directions of a wave apart, which has no equation in time; give both "
            "the same coefficients"
        )
    models = {i: g.model for g in problem.groups for i in g.contacts}
    return ForcedOrbit(
        part.M, part.viscous(Omega), part.K, part.rows, part.residual, tuple(c.patch.law for c in contacts),
        tuple(c.patch.kinematics for c in contacts), np.vstack(problem.relative(x)), Omega,
        max(getattr(model, "cycles", 2) for model in models.values()),
    )  # fmt: skip


@dataclass(frozen=True)
class Stability:
    """Multipliers of a periodic motion.

    Attributes:
        multipliers: (k,) the largest first. error: (k,) of their sizes, estimated. stable: none outside the unit circle
            by more than its error. loss: how it was lost: a real multiplier above 1, one below -1, or a complex pair.
    """

    multipliers: ComplexArray
    error: Array
    stable: bool
    loss: Loss

    @property
    def growth(self) -> float:
        """Largest |multiplier|: by how much the worst perturbation grows in a period."""
        return float(np.abs(self.multipliers[0])) if len(self.multipliers) else 0.0


@dataclass(frozen=True)
class Settings:
    """How multipliers are computed.

    Attributes:
        steps: of a period; the second step length is half of it. largest: how many multipliers are kept. margin: of
            |multiplier| - 1 that counts as stable, or the estimated error if that is larger.
        forgotten: share of a slider's perturbation that counts as none. directions: of the state, at most.
    """

    steps: int = 512
    largest: int = 8
    margin: float = 1e-6
    forgotten: float = 1e-9
    directions: int = 600


def stability(motion: ForcedOrbit, settings: Settings | None = None) -> Stability:
    """Multipliers from two step lengths, extrapolated to none; the error is what that changed of their sizes.

    It is their logarithms, growth and turning angle, whose error is h^2; stiff directions, which turn through many
    angles in a period, keep their growth that way.
    """
    s = settings or Settings()
    coarse, fine = (multipliers(motion, n, s) for n in (s.steps, 2 * s.steps))
    left = list(coarse)
    best = []
    for value in fine[: s.largest]:
        # the same multiplier at another step length: of its size, then at its angle
        others = np.array(left)
        apart = np.abs(np.abs(others) - abs(value)) + 0.1 * np.abs(others - value)
        partner = left.pop(int(np.argmin(apart))) if left else value
        near = abs(value - partner) < 0.5 * abs(value)
        best.append(value * np.exp(np.log(value / partner) / 3.0) if near else value)
    values = np.array(best, dtype=complex)
    return judged(values, np.abs(np.abs(values) - np.abs(fine[: s.largest])), s.margin)


def judged(values: ComplexArray, error: Array, margin: float) -> Stability:
    """What multipliers say, sorted by size; `error` (k,) of each."""
    order = np.lexsort((-values.imag, -np.round(np.abs(values), 9)))  # of a pair the upper one first
    values, error = values[order], error[order]
    outside = np.abs(values) > 1.0 + np.maximum(margin, error)
    if not outside.any():
        return Stability(values, error, True, "")
    worst = values[outside][0]
    real = abs(worst.imag) <= max(margin, 1e-9) * abs(worst)
    loss: Loss = "Neimark-Sacker" if not real else "fold" if worst.real > 0 else "flip"
    return Stability(values, error, False, loss)


# the map of one period ----------------------------------------------------------------------------------------------


def multipliers(orbit: ForcedOrbit, steps: int, settings: Settings | None = None) -> ComplexArray:
    """(k,) all multipliers that perturbations of the motion can reach, at one step length, the largest first.

    Block by block the image of what was reached last is added to the space, until nothing new comes: sliders that slid
    remember at most the motion of one period, so that a handful of blocks of 2 m directions do.
    """
    s = settings or Settings()
    carry, unit = _carrier(orbit, steps)
    size, m = len(unit), 2 * len(orbit.M)
    basis = np.zeros((size, 0))
    images = np.zeros((size, 0))
    new = np.eye(size, m)
    while new.shape[1] and basis.shape[1] + new.shape[1] <= max(s.directions, m):
        images = np.hstack([images, carry(new * unit[:, None]) / unit[:, None]])
        basis = np.hstack([basis, new])
        new = _beyond(basis, images[:, -new.shape[1] :], s.forgotten)
    values = np.linalg.eigvals(basis.T @ images).astype(complex)
    return values[np.argsort(-np.abs(values), kind="stable")]


def _beyond(basis: Array, images: Array, least: float) -> Array:
    """Orthonormal directions of images that a basis does not hold, what is smaller than ``least`` of them left out."""
    rest = images - basis @ (basis.T @ images)
    rest -= basis @ (basis.T @ rest)
    U, size, _ = np.linalg.svd(rest, full_matrices=False)
    return U[:, size > least * max(1.0, largest(images))]


class _Body(NamedTuple):
    """One midpoint step of the body: place and speed in its middle, (m, 2 m) of z = (q, q') at its beginning and (m, c)
    of the contact forces F; rows T (c, m) and compliance B (c, c)."""

    place: jax.Array
    speed: jax.Array
    place_of_force: jax.Array
    speed_of_force: jax.Array
    rows: jax.Array
    compliance: jax.Array


class _Path(NamedTuple):
    """What the contacts do in every step, by law: place and speed (s, n, 3), states before it. Of all: derivatives of
    the forces (s, c, c), and the inverse by which the force of a step is found."""

    u: tuple[jax.Array, ...]
    v: tuple[jax.Array, ...]
    states: tuple[State, ...]
    slope: jax.Array
    drag: jax.Array
    inverse: jax.Array


@dataclass(frozen=True)
class _Memory:
    """The leaves of the laws' states that matter, as one vector. told: of every leaf, law by law. shapes: of those
    that matter."""

    told: tuple[tuple[bool, ...], ...]
    shapes: tuple[tuple[int, ...], ...]

    def kept(self, states: Sequence[State]) -> list[jax.Array]:
        every = [leaf for state in states for leaf in jax.tree_util.tree_leaves(state)]
        return [leaf for leaf, t in zip(every, (t for law in self.told for t in law), strict=True) if t]

    def packed(self, states: Sequence[State]) -> jax.Array:
        """(N,) of states."""
        return jnp.concatenate([jnp.zeros(0), *(leaf.ravel() for leaf in self.kept(states))])

    def unpacked(self, vector: jax.Array, like: tuple[State, ...]) -> tuple[State, ...]:
        """States, zero where nothing matters, of (N,)."""
        cuts = np.cumsum([int(np.prod(shape)) for shape in self.shapes])[:-1]
        parts = iter(jnp.split(vector, cuts) if self.shapes else [])
        out = []
        for state, told in zip(like, self.told, strict=True):
            leaves, tree = jax.tree_util.tree_flatten(state)
            pairs = zip(leaves, told, strict=True)
            moved = [next(parts).reshape(leaf.shape) if t else jnp.zeros_like(leaf) for leaf, t in pairs]
            out.append(jax.tree_util.tree_unflatten(tree, moved))
        return tuple(out)


def _carrier(orbit: ForcedOrbit, steps: int) -> tuple[Callable[[Array], Array], Array]:
    """The map (N, k) -> (N, k) of one period, and the (N,) units of its coordinates: q, q', states that matter."""
    dt = orbit.period / steps
    G = tuple(jax.device_put(g) for g in orbit.kinematics)
    parts = tuple(jax.device_put(orbit.displacement[rows]) for rows in orbit.blocks)
    body = _middle(orbit, dt)
    path = _followed(orbit.laws, G, parts, orbit.period, steps, orbit.cycles, body)
    along = zip(orbit.laws, path.u, path.v, path.states, strict=True)
    told = tuple(_matters(np.asarray(_effects(*one, dt)) > 0) for one in along)
    every = [leaf for state in path.states for leaf in jax.tree_util.tree_leaves(state)]
    pairs = list(zip(every, (t for law in told for t in law), strict=True))
    memory = _Memory(told, tuple(tuple(leaf.shape[1:]) for leaf, t in pairs if t))

    def carry(start: Array) -> Array:
        return np.asarray(_carried(orbit.laws, G, path, body, jax.device_put(start.T), dt, memory)).T

    return carry, _units(orbit, memory.kept(path.states))


def _units(orbit: ForcedOrbit, leaves: list[jax.Array]) -> Array:
    """(N,) sizes by which perturbations are measured: q that move the contacts as far as they move, the same times
    Omega, what the leaves of the states reach on the orbit."""
    amplitude = largest(orbit.displacement[:, 1:]) or 1.0
    q = np.full(len(orbit.M), amplitude / (largest(orbit.rows) or 1.0))
    parts = [np.full(int(np.prod(leaf.shape[1:])), float(jnp.abs(leaf).max(initial=0.0)) or 1.0) for leaf in leaves]
    return np.concatenate([q, q * orbit.Omega, *parts])


def _middle(orbit: ForcedOrbit, h: float) -> _Body:
    """The midpoint rule: v' = (M + h C/2 + h^2 K/4)^-1 (M v - h/2 (K q + T^T F)), q' = q + h/2 v' in the middle."""
    m = len(orbit.M)
    A = orbit.M + 0.5 * h * orbit.C + 0.25 * h**2 * orbit.K
    solved = np.linalg.solve(A, np.hstack([-0.5 * h * orbit.K, orbit.M, -0.5 * h * orbit.rows.T]))
    speed, by_force = solved[:, : 2 * m], solved[:, 2 * m :]
    place = np.eye(m, 2 * m) + 0.5 * h * speed
    arrays = (place, speed, 0.5 * h * by_force, by_force, orbit.rows, orbit.compliance)
    return _Body(*(jax.device_put(a) for a in arrays))


# the contacts along the orbit ---------------------------------------------------------------------------------------


@partial(inner, static_argnames=("steps", "count"))
def _followed(
    laws: tuple[Law, ...], kinematics: tuple[jax.Array, ...], parts: tuple[jax.Array, ...], period: float, steps: int,
    count: int, body: _Body,
) -> _Path:  # fmt: skip
    """The laws marched through the middles of the steps, and their derivatives there."""
    along = [_marched(*one, period, steps, count) for one in zip(laws, kinematics, parts, strict=True)]
    u, v, states, slopes, drags = (tuple(items) for items in zip(*along, strict=True))
    slope, drag = (jax.vmap(jax.scipy.linalg.block_diag)(*items) for items in (slopes, drags))
    held = body.rows @ body.place_of_force - body.compliance
    moved = body.rows @ body.speed_of_force
    inverse = jnp.linalg.inv(jnp.eye(len(held)) - slope @ held - drag @ moved)
    return _Path(u, v, states, slope, drag, inverse)


def _marched(law: Law, G: jax.Array, d: jax.Array, period: float, steps: int, count: int) -> tuple[Any, ...]:
    """Of one law: place and speed (s, n, 3), states before every step, derivatives (s, b, b) of the forces on its rows
    with respect to place and speed."""
    dt = period / steps
    middles = 2 * np.pi * (np.arange(steps) + 0.5) / steps
    values = summed(np.outer(middles, np.arange(1, d.shape[1] // 2 + 1)))
    rates = values @ derivative(d.shape[1])
    u = jnp.einsum("sk,nia,ak->sni", values, G, d)
    v = jnp.einsum("sk,nia,ak->sni", rates, G, d) * (2 * np.pi / period)

    def one(state: State, sample: tuple[jax.Array, jax.Array]) -> tuple[State, tuple[Any, ...]]:
        by_place, by_speed = _tangents(law, dt, state, *sample)
        both = (jnp.einsum("nia,nij,njb->ab", G, k, G) for k in (by_place, by_speed))
        return law.step(*sample, dt, state)[1], (state, *both)

    state = periodic(law, u, period, count, SETTLED, v)[:2][1]
    _, (states, slope, drag) = jax.lax.scan(one, state, (u, v))
    if isinstance(law, Spring):
        slope = jnp.einsum("na,sn,nb->sab", G[:, 1], _secants(law, G[:, 1], d, u[..., 1]), G[:, 1])
    return u, v, states, slope, drag


def _secants(law: Spring, G: jax.Array, d: jax.Array, middle: jax.Array) -> jax.Array:
    """(s, n) stiffness of a spring over every step, from its beginning to its end: of one that is met within a step
    that is the share of it, where the stiffness in the middle would be wrong by the first order of the step.

    Args: G: (n, b). d: (b, W) harmonics. middle: (s, n) m.
    """
    steps = len(middle)
    angles = 2 * np.pi * np.arange(steps + 1) / steps
    edge = jnp.einsum("sk,na,ak->sn", summed(np.outer(angles, np.arange(1, d.shape[1] // 2 + 1))), G, d)
    moved, force = jnp.diff(edge, axis=0), jnp.diff(law.force(edge), axis=0)
    moves = jnp.abs(moved) > STILL * jnp.abs(edge).max()
    return jnp.where(moves, force / jnp.where(moves, moved, 1.0), law.slope(middle))


STILL = 1e-7
"""Share of a motion below which a step has no secant but for rounding."""


def _tangents(law: Law, dt: float, state: State, u: jax.Array, v: jax.Array) -> tuple[jax.Array, jax.Array]:
    """(n, 3, 3) derivatives of the force with respect to place and speed, the state before the step held."""
    zero = jnp.zeros_like(u)

    def moved(*direction: jax.Array) -> jax.Array:
        return jax.jvp(lambda x, y: law.step(x, y, dt, state)[0], (u, v), direction)[1]

    unit = [jnp.broadcast_to(e, u.shape) for e in jnp.eye(3)]
    place, speed = [moved(e, zero) for e in unit], [moved(zero, e) for e in unit]
    return jnp.stack(place, axis=-1), jnp.stack(speed, axis=-1)


def _matters(effects: Array) -> tuple[bool, ...]:
    """Which leaves of a state have a say in the force, at once or by way of others: the path slid so far and the time
    have none, and would add multipliers of 1. effects: (leaves, 1 + leaves) on the force and on every leaf."""
    told = effects[:, 0].copy()
    for _ in told:
        told = told | (effects[:, 1:] & told).any(axis=1)
    return tuple(bool(t) for t in told)


@inner
def _effects(law: Law, u: jax.Array, v: jax.Array, states: State, dt: float) -> jax.Array:
    """(leaves, 1 + leaves) largest change along the orbit of the force, and of every leaf, when a leaf is moved."""
    leaves, tree = jax.tree_util.tree_flatten(states)
    rng = np.random.default_rng(0)
    moved = [jax.device_put(rng.normal(size=leaf.shape[1:])) for leaf in leaves]

    def one(largest: jax.Array, sample: tuple[Any, ...]) -> tuple[jax.Array, None]:
        at, rate, state = sample
        rows = []
        for k in range(len(leaves)):
            tangent = [m if j == k else jnp.zeros_like(m) for j, m in enumerate(moved)]
            step = partial(law.step, at, rate, dt)
            _, (force, after) = jax.jvp(step, (state,), (jax.tree_util.tree_unflatten(tree, tangent),))
            parts = [force, *jax.tree_util.tree_leaves(after)]
            rows.append(jnp.stack([jnp.abs(p).max(initial=0.0) for p in parts]))
        return jnp.maximum(largest, jnp.stack(rows)), None

    if not leaves:
        return jnp.zeros((0, 1))
    return jax.lax.scan(one, jnp.zeros((len(leaves), len(leaves) + 1)), (u, v, states))[0]


# perturbations carried along ----------------------------------------------------------------------------------------


@partial(inner, static_argnames=("memory",))
def _carried(
    laws: tuple[Law, ...], kinematics: tuple[jax.Array, ...], path: _Path, body: _Body, starts: jax.Array, dt: float,
    memory: _Memory,
) -> jax.Array:  # fmt: skip
    """(k, N) perturbations after one period, of (k, N) at its beginning."""
    size = body.place.shape[1]
    pushed = partial(_pushed, laws, kinematics, dt)

    def step(carried: tuple[jax.Array, jax.Array], sample: _Path) -> tuple[tuple[jax.Array, jax.Array], None]:
        z, remembered = carried
        place, speed = body.place @ z, body.speed @ z
        force = sample.slope @ (body.rows @ place) + sample.drag @ (body.rows @ speed)
        if memory.shapes:
            states, still = memory.unpacked(remembered, sample.states), jnp.zeros_like(force)
            force = force + pushed(sample, states, still, still)[0]
        force = sample.inverse @ force
        place, speed = place + body.place_of_force @ force, speed + body.speed_of_force @ force
        if memory.shapes:
            d = body.rows @ place - body.compliance @ force
            remembered = memory.packed(pushed(sample, states, d, body.rows @ speed)[1])
        return (2 * jnp.concatenate([place, speed]) - z, remembered), None

    def one(start: jax.Array) -> jax.Array:
        return jnp.concatenate(jax.lax.scan(step, (start[:size], start[size:]), path)[0])

    return jax.vmap(one)(starts)


def _pushed(
    laws: tuple[Law, ...], kinematics: tuple[jax.Array, ...], dt: float, sample: _Path, moved: tuple[State, ...],
    d: jax.Array, rate: jax.Array,
) -> tuple[jax.Array, list[State]]:  # fmt: skip
    """(c,) change of the forces, and that of the states, for changes of the states, of place and of speed (c,)."""
    forces, after, first = [], [], 0
    every = zip(laws, kinematics, sample.u, sample.v, sample.states, moved, strict=True)
    for law, G, u, v, state, tangent in every:
        rows = slice(first, first + G.shape[2])
        first = rows.stop
        moves = G @ d[rows], G @ rate[rows], tangent
        _, (force, changed) = jax.jvp(
            lambda u, v, state, law=law: law.step(u, v, dt, state), (u, v, state), moves
        )
        forces.append(jnp.einsum("nia,ni->a", G, force))
        after.append(changed)
    return jnp.concatenate(forces), after

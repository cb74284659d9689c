"""A plain integrator in time for small assemblies: Newmark's average acceleration, contact laws one step a time step.

    M q'' + C q' + K q + T^T (F - F_0) = f(t)

It knows the matrices of an assembly and the steps of its contact laws, and nothing of harmonics. Second order in the
step; friction that turns its direction is followed by the laws themselves to first order only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from microslip.contact.law import Law, march
from microslip.system.assembly import Assembly, Linear

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Steady:
    """The last of some periods, s steps long; all values at the ends of the steps.

    Attributes:
        q: (s, m). relative: contact -> (s, k) motion of its coordinates with the preloaded state. force: contact ->
            (s, k). load: (s, m) generalised force. outputs: (s, w). slip_work: contact -> J, friction force times the
            path slid. change: largest difference of q over the period, relative.
    """

    q: Array
    relative: list[Array]
    force: list[Array]
    load: Array
    outputs: Array
    slip_work: list[float]
    change: float

    def harmonics(self, values: Array, count: int) -> Array:
        """(..., count + 1) complex amplitudes of (s, ...): the mean, then a with Re(a exp(i h Omega t))."""
        found = np.moveaxis(np.fft.fft(values, axis=0)[: count + 1], 0, -1) / len(values)
        found[..., 1:] *= 2
        return found

    @property
    def supplied(self) -> float:
        """Work of the loads, J a period, by the trapezoidal rule."""
        moved = self.q - np.roll(self.q, 1, axis=0)
        return float(np.sum(0.5 * (self.load + np.roll(self.load, 1, axis=0)) * moved))


@dataclass(frozen=True, eq=False)
class Start:
    """Motion at t = 0.

    Attributes:
        q, v: (m,). cycles: contact -> (s, n, 3) a cycle of its points that ends there, which its law goes through until
            it is periodic.
    """

    q: Array
    v: Array
    cycles: list[Array]


def steady(
    assembly: Assembly, Omega: float, stages: Sequence[tuple[int, int]], start: Start | None = None
) -> list[Steady]:  # fmt: skip
    """(periods, steps a period) one after the other, each from where the last ended.

    Args:
        start: from rest in the preloaded state if None.
    """
    harmonics = max(x.harmonic for x in assembly.loads)
    linear = [assembly.joined(h) for h in range(harmonics + 1)]
    loads, made = np.array([part.load for part in linear]), _made(assembly, linear[1])
    carried = _begun(assembly, Omega, start, loads, linear[1], made)
    found = []
    for periods, steps in stages:
        t = 2 * np.pi * np.arange(1, steps + 1) / steps
        load = np.real(np.exp(1j * np.outer(t, np.arange(harmonics + 1))) @ loads)
        pieces = jnp.asarray(load).reshape(-1, CHUNK if steps % CHUNK == 0 else steps, load.shape[1])
        for _ in range(periods):
            before, outs = np.asarray(carried[0]), []
            for driven in pieces:
                carried, out = _period(made, carried, driven, 2 * np.pi / Omega / steps)
                outs.append(out)
        whole = jax.tree_util.tree_map(lambda *each: np.concatenate(each), *outs)
        found.append(_looked_at(assembly, made, linear[1].output, before, load, whole))
    return found


CHUNK = 64
"""Steps that one call of the compiled program takes, of whatever length they are."""


class Made(NamedTuple):
    """An assembly as arrays, so that assemblies of one kind share compiled programs: M, C, K (m, m), rows T (c, m);
    offset, preload (c,); contact -> kinematics, law."""

    M: jax.Array
    C: jax.Array
    K: jax.Array
    T: jax.Array
    offset: jax.Array
    preload: jax.Array
    kinematics: list[jax.Array]
    laws: list[Law]

    @property
    def slices(self) -> list[slice]:
        """Of the coordinates of each contact."""
        ends = np.cumsum([0, *(G.shape[2] for G in self.kinematics)])
        return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]


def _made(assembly: Assembly, linear: Linear) -> Made:
    matrices = (jnp.asarray(np.real(getattr(linear, key))) for key in ("M", "C", "K", "rows"))
    both = (jnp.asarray(np.concatenate([getattr(c, key) for c in assembly.contacts])) for key in ("offset", "preload"))
    patches = [c.patch for c in assembly.contacts]
    return Made(*matrices, *both, [jnp.asarray(p.kinematics) for p in patches], [p.law for p in patches])


def _contacts(made: Made, d: jax.Array, before: jax.Array, dt: Any, states: Any) -> tuple[jax.Array, Any]:
    """(c,) forces at relative motions d; forces of the points and the states after the step."""
    force, after, points = [], [], []
    for at, G, law, state in zip(made.slices, made.kinematics, made.laws, states, strict=True):
        u, last = (jnp.einsum("nik,k->ni", G, made.offset[at] + x[at]) for x in (d, before))
        F, new = law.step(u, (u - last) / dt, dt, state)
        force.append(jnp.einsum("nik,ni->k", G, F))
        after.append(new)
        points.append(F)
    return jnp.concatenate(force), (points, after)


@jax.jit
def _period(made: Made, carried: Any, driven: jax.Array, dt: Any) -> tuple[Any, Any]:
    """Steps under loads (s, m): q, q', q'' and states at their end; q, motions, forces, slip and points' forces."""
    M, C, K, T = made.M, made.C, made.K, made.T
    inverse = jnp.linalg.inv(M / (0.25 * dt**2) + C / (0.5 * dt) + K)
    solved = inverse @ T.T
    D = T @ solved

    def one(carried: Any, f: jax.Array) -> tuple[Any, Any]:
        q, v, a, states = carried
        known = f + T.T @ made.preload + M @ (q / (0.25 * dt**2) + v / (0.25 * dt) + a) + C @ (q / (0.5 * dt) + v)
        free = inverse @ known
        d_free, before = T @ free, T @ q

        def missing(d: jax.Array) -> tuple[jax.Array, Any]:
            F, after = _contacts(made, d, before, dt, states)
            R = d - d_free + D @ F
            return R, (R, F, after)

        def improve(at: Any) -> Any:
            slope, (R, _, _) = jax.jacfwd(missing, has_aux=True)(at[0])
            step = R / slope[0] if len(R) == 1 else jnp.linalg.solve(slope, R)
            return at[0] - step, jnp.abs(step).max(), at[2] + 1

        def on(at: Any) -> Any:
            return (at[1] > 1e-13 * (jnp.abs(at[0]).max() + jnp.abs(made.offset).max())) & (at[2] < 30)

        d, _, _ = jax.lax.while_loop(on, improve, (before, jnp.asarray(jnp.inf), 0))
        _, F, (points, after) = missing(d)[1]
        new = free - solved @ F
        acceleration = (new - q) / (0.25 * dt**2) - v / (0.25 * dt) - a
        speed = v + 0.5 * dt * (a + acceleration)
        slid = [law.slip(y) - law.slip(x) for law, x, y in zip(made.laws, states, after, strict=True)]
        return (new, speed, acceleration, after), (new, d, F, slid, points)

    return jax.lax.scan(one, carried, driven)


def _begun(
    assembly: Assembly, Omega: float, start: Start | None, loads: Array, linear: Linear, made: Made
) -> tuple[Any, ...]:  # fmt: skip
    """q, q', q'' and the states of the laws at t = 0."""
    m, c = linear.M.shape[0], len(linear.rows)
    if start is None:
        states = [law.init(len(G)) for law, G in zip(made.laws, made.kinematics, strict=True)]
        _, (_, states) = _contacts(made, jnp.zeros(c), jnp.zeros(c), 1.0, states)
        return jnp.zeros(m), jnp.zeros(m), jnp.zeros(m), states
    both = [_cycled(law, jnp.asarray(u), 2 * np.pi / Omega) for law, u in zip(made.laws, start.cycles, strict=True)]
    F = np.concatenate([np.einsum("nik,ni->k", x.patch.kinematics, np.asarray(f)[-1]) - x.preload
                        for x, (f, _) in zip(assembly.contacts, both, strict=True)])  # fmt: skip
    given = np.real(loads.sum(axis=0)) - np.real(linear.C @ start.v + linear.K @ start.q) - np.real(linear.rows).T @ F
    a = np.linalg.solve(np.real(linear.M), given)
    return jnp.asarray(start.q), jnp.asarray(start.v), jnp.asarray(a), [state for _, state in both]


LAPS = 100
"""Cycles after which sliders remember little of their beginning, and the integration goes on with it."""


@jax.jit
def _cycled(law: Law, u: jax.Array, period: Any) -> tuple[jax.Array, Any]:
    """Forces in the last of some cycles of a periodic path (s, n, 3), and the state at its end."""
    dt = period / len(u)
    v = (u - jnp.roll(u, 1, axis=0)) / dt
    start = march(law, u, dt, law.init(u.shape[1]), v)
    return jax.lax.fori_loop(1, LAPS, lambda _, last: march(law, u, dt, last[1], v), start)


def _looked_at(
    assembly: Assembly, made: Made, output: Array, before: Array, load: Array, out: Any
) -> Steady:  # fmt: skip
    q, d, F = (np.roll(np.asarray(x), 1, axis=0) for x in out[:3])  # the first sample at t = 0
    load = np.roll(load, 1, axis=0)
    slid, points = ([np.roll(np.asarray(x), 1, axis=0) for x in some] for some in out[3:])
    relative, force = zip(*[(d[:, at] + np.asarray(made.offset)[at], F[:, at]) for at in made.slices], strict=True)
    change = float(np.abs(q[0] - before).max() / np.abs(q).max())
    work = [float(np.sum(0.5 * (f + np.roll(f, 1, axis=0))[..., 1:] * s)) for f, s in zip(points, slid, strict=True)]
    return Steady(q, list(relative), list(force), load, q @ np.real(output).T, work, change)


def extrapolated(values: Sequence[Array], orders: Sequence[int] = (2, 3)) -> Array:
    """The limit of values found with steps h, h/2, h/4, ...: errors of the given orders are taken out one by one."""
    rows = list(values)
    for order in orders:
        if len(rows) < 2:
            break
        rows = [b + (b - a) / (2**order - 1) for a, b in zip(rows, rows[1:], strict=False)]
    return rows[-1]

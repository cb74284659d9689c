"""An independent balance of small systems in plain NumPy: dense, many harmonics, contact laws written anew.

    M q'' + C q' + K q + sum over points of R^T (F(R q + u_0) - F_0) = Re(f exp(i Omega t))

Unknown are the harmonics of q itself, nothing is eliminated, and derivatives are differences. No code of the program is
used: a point has a normal force and sliders behind springs, and a step of a slider ends on the circle of friction where
it would end outside (radial return, of first order on curved paths: `Solution.error` tells what that leaves).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

Array = np.ndarray
Normal = Callable[[Array], tuple[Array, Array, Array]]
"""Approaches (s, ...) m of a cycle -> normal forces N, shares of the area in contact, and the share of a tangential
spring that stretches over the step which ends at each sample."""

HARMONICS, SAMPLES = 32, 1024
TOLERANCE = 1e-10
"""Of the residual, over the loads."""


def constant(force: float) -> Normal:
    """A normal force that no motion changes."""
    return lambda u: (np.full_like(u, force), np.ones_like(u), np.ones_like(u))


def penalty(stiffness: float, gap: float) -> Normal:
    """A spring that cannot pull; a step in which it closes counts from where it touches."""

    def law(u: Array) -> tuple[Array, Array, Array]:
        after, before = u - gap, np.roll(u, 1, axis=0) - gap
        closes, share = (after > 0) & (before <= 0), np.where(after > 0, 1.0, 0.0)
        stretched = np.where(closes, after / np.where(closes, after - before, 1.0), share)
        return stiffness * np.maximum(after, 0.0), share, stretched

    return law


def rough(stiffness: float, roughness: float) -> Normal:
    """c R_Z (x^3 - x^4 / 2), x = u / R_Z, straight beyond 1; the area in contact is 3 x^2 - 2 x^3.

    Area that comes is stretched by half of a step; area that goes takes its part of force and spring with it.
    """

    def law(u: Array) -> tuple[Array, Array, Array]:
        x, beyond = np.clip(u / roughness, 0.0, 1.0), np.maximum(u / roughness - 1.0, 0.0)
        share = 3 * x**2 - 2 * x**3
        stretched = 0.5 * (share + np.minimum(share, np.roll(share, 1, axis=0)))
        return stiffness * roughness * (x**3 - 0.5 * x**4 + beyond), share, stretched

    return law


@dataclass(frozen=True)
class Point:
    """A place where a contact touches.

    Attributes:
        rows: (3, d) relative motion along n, t1, t2 per unit of q. offset: (3,) m, pressed: N, normal force, in the
            state that q counts from. stiffness: (j,) N/m of its tangential springs with all of the area in contact.
            limits: (j,) largest forces of their sliders over the normal force.
    """

    rows: Array
    offset: Array
    pressed: float
    normal: Normal
    stiffness: Array
    limits: Array


@dataclass(frozen=True)
class System:
    """M, C, K: (d, d). load: (d,) complex f. output: (w, d). Omega: rad/s."""

    M: Array
    C: Array
    K: Array
    load: Array
    output: Array
    points: Sequence[Point]
    Omega: float


@dataclass(frozen=True)
class Solution:
    """x: (2 H + 1, d) mean, cos, sin, cos 2, ... of q. amplitude: (w,) of the read-outs' first harmonic. lost: (p,) J a
    cycle, work done on the points. error: (w,) change of the amplitude from half the harmonics and samples. missing:
    largest entry of the residual over that of the loads."""

    x: Array
    amplitude: Array
    lost: Array
    error: Array
    missing: float


def solution(system: System, start: Array | None = None) -> Solution:
    """From harmonics of q or, if None, from the sticking system; with few harmonics and samples at first."""
    x = sticking(system) if start is None else start
    for level in (4, 2, 1):
        begin = np.zeros((2 * HARMONICS // level + 1, len(system.M)))
        begin[: len(x)] = x[: len(begin)]
        before, (x, missing) = begin, balanced(system, HARMONICS // level, SAMPLES // level, begin)
    coarse, fine = (np.abs(system.output @ (one[1] - 1j * one[2])) for one in (before, x))
    return Solution(x, fine, works(system, x), np.abs(fine - coarse), missing)


def sticking(system: System) -> Array:
    """(3, d) mean, cos and sin of q if no point slides and the normal forces do not move."""
    stiff = [p.stiffness.sum() * p.rows[1:].T @ p.rows[1:] for p in system.points]
    q = np.linalg.solve(system.K + sum(stiff) - system.Omega**2 * system.M + 1j * system.Omega * system.C, system.load)
    return np.array([np.zeros(len(q)), q.real, -q.imag])


def waves(harmonics: int, samples: int) -> Array:
    """(s, 2 H + 1) of 1, cos, sin, cos 2, ..."""
    t = 2 * np.pi * np.arange(samples) / samples
    return np.column_stack([np.ones(samples), *(f(h * t) for h in range(1, harmonics + 1) for f in (np.cos, np.sin))])


# contacts ----------------------------------------------------------------------------------------------------------

RECALL = 1e-5
"""Share of its memory that a slider regains in a cycle from the first one: of sliders that stick it says which of all
possible mean forces they keep (`microslip.contact.periodic` defines the limit of infinitely many cycles like that)."""

SETTLED = 1e-12
"""Of the largest force: by this much a slider's memory may miss its periodic one."""


def marched(force: Array, ways: Array, left: Array, limits: Array) -> Array:
    """(s, ...) forces of sliders along steps, from (...) the one before. See `rubbed`."""
    out = np.empty_like(ways)
    for i in range(len(ways)):
        force = force * left[i] + ways[i]
        force *= limits[i] / np.maximum(np.abs(force), limits[i])
        out[i] = force
    return out


def rubbed(first: Array, ways: Array, left: Array, limits: Array) -> Array:
    """(s, n) forces of n sliders in a periodic cycle, t1 + i t2, from rest.

    Args:
        first: (n,) N, springs times the way to the first sample. ways: (s, n) N, of the step that ends at each sample.
            left: (s, n) share of the force that the area still in contact keeps over it. limits: (s, n) N.
    """
    limits = limits + 1e-300
    begun = first * (limits[0] / np.maximum(np.abs(first), limits[0]))
    first = marched(begun, ways[1:], left[1:], limits[1:])[-1]
    start, out = first.copy(), marched(first, ways, left, limits)
    size = np.abs(out).max(axis=0) + 1e-300
    for _ in range(200):
        some = np.abs(out[-1] + RECALL * (first - start) - start) > SETTLED * size
        if not some.any():
            break
        given = ways[:, some], left[:, some], limits[:, some]
        start[some] = recalled(first[some], start[some], out[-1, some], size[some], given)
        out[:, some] = marched(start[some], *given)
    return out


def recalled(first: Array, start: Array, end: Array, size: Array, given: tuple[Array, ...]) -> Array:
    """(n,) better memories to start a cycle from, by Newton's method on P(x) + d (x_1 - x) = x; where a step of it does
    not help, what the cycle ends with."""
    h, missing = 1e-5 * size, end + RECALL * (first - start) - start
    along = [(marched(start + unit * h, *given)[-1] - end) / h for unit in (1.0, 1.0j)]
    a, b, c, d = along[0].real - 1 - RECALL, along[1].real, along[0].imag, along[1].imag - 1 - RECALL
    found = a * d - b * c
    regular = found > 1e-14
    over = np.where(regular, 1 / np.where(regular, found, 1.0), 0.0)
    step = -over * ((d * missing.real - b * missing.imag) + 1j * (a * missing.imag - c * missing.real))
    trial = start + step
    left = marched(trial, *given)[-1] + RECALL * (first - trial) - trial
    return np.where(regular & (np.abs(left) < 0.5 * np.abs(missing)), trial, end)


def touched(system: System, q: Array) -> tuple[list[Array], list[Array]]:
    """Of every point (s, c, 3) displacements and forces along n, t1, t2 of periodic motions q (s, c, d)."""
    moved = [q @ p.rows.T + p.offset for p in system.points]
    normal, each = [], []
    for p, u in zip(system.points, moved, strict=True):
        pressed, share, stretched = p.normal(u[..., 0])
        before, u_t = np.roll(share, 1, axis=0), u[..., 1] + 1j * u[..., 2]
        left = np.minimum(share / np.where(before > 0, before, 1.0), 1.0)
        ways = stretched * (u_t - np.roll(u_t, 1, axis=0))
        normal.append(pressed)
        each += [(k * share[0] * u_t[0], k * ways, left, mu * pressed)
                 for k, mu in zip(p.stiffness, p.limits, strict=True)]  # fmt: skip
    F = rubbed(*(np.concatenate(some, axis=-1) for some in zip(*each, strict=True)))
    F = F.reshape(len(q), -1, q.shape[1])  # (s, sliders, c)
    ends = np.cumsum([0, *(len(p.stiffness) for p in system.points)])
    sums = [F[:, a:b].sum(axis=1) for a, b in zip(ends[:-1], ends[1:], strict=True)]
    return moved, [np.stack([n, f.real, f.imag], axis=-1) for n, f in zip(normal, sums, strict=True)]


def forces(system: System, x: Array, samples: int) -> Array:
    """(c, 2 H + 1, d) harmonics of the generalised contact forces less the preload, of motions x (c, 2 H + 1, d)."""
    values = waves(x.shape[1] // 2, samples)
    each = touched(system, np.moveaxis(values @ x, 0, 1))[1]
    total = sum(F @ p.rows - p.pressed * p.rows[0] for F, p in zip(each, system.points, strict=True))
    weights = np.full(values.shape[1], 2.0 / samples)
    weights[0] = 1.0 / samples
    return (weights[:, None] * values.T) @ np.moveaxis(total, 1, 0)


def works(system: System, x: Array) -> Array:
    """(p,) J per cycle that points take in a motion x (2 H + 1, d), by the trapezoidal rule."""
    moved, each = touched(system, (waves(len(x) // 2, SAMPLES) @ x)[:, None])
    return np.array([np.sum(0.5 * (F + np.roll(F, 1, axis=0)) * (u - np.roll(u, 1, axis=0)))
                     for u, F in zip(moved, each, strict=True)])  # fmt: skip


# Newton's method ---------------------------------------------------------------------------------------------------


def dynamic(system: System, harmonics: int) -> Array:
    """((2 H + 1) d,) squared: what the harmonics of q are multiplied by."""
    blocks = [system.K]
    for h in range(1, harmonics + 1):
        stiff, viscous = system.K - (h * system.Omega) ** 2 * system.M, h * system.Omega * system.C
        blocks.append(np.block([[stiff, viscous], [-viscous, stiff]]))
    return scipy.linalg.block_diag(*blocks)


def balanced(system: System, harmonics: int, samples: int, x: Array, most: int = 80) -> tuple[Array, float]:
    """(2 H + 1, d) a solution from a start, and what is missing. A derivative is used again while it serves, and a step
    of a new one is halved until the residual falls."""
    A, f, derivative = dynamic(system, harmonics), np.zeros_like(x), None
    f[1], f[2] = system.load.real, -system.load.imag
    size = np.abs(system.load).max()

    def residual(x: Array) -> Array:
        return A @ x.ravel() + forces(system, x[None], samples).ravel() - f.ravel()

    R = residual(x)
    for _ in range(most):
        if np.abs(R).max() <= TOLERANCE * size:
            break
        fresh = derivative is None
        if derivative is None:
            derivative = scipy.linalg.lu_factor(A + slope(system, x, samples))
        step = -scipy.linalg.lu_solve(derivative, R).reshape(x.shape)
        share, left = 1.0, residual(x + step)
        while fresh and np.linalg.norm(left) >= np.linalg.norm(R) and share > 1e-3:
            share *= 0.5
            left = residual(x + share * step)
        ratio = np.linalg.norm(left) / np.linalg.norm(R)
        derivative = derivative if ratio <= 0.2 else None
        if fresh or ratio < 1:
            x, R = x + share * step, left
    return x, float(np.abs(R).max() / size)


def slope(system: System, x: Array, samples: int) -> Array:
    """((2 H + 1) d,) squared derivative of the contact forces, by differences."""
    h = 1e-7 * np.abs(x).max()
    moved = np.concatenate([x[None], x + h * np.eye(x.size).reshape(-1, *x.shape)])
    found = forces(system, moved, samples).reshape(x.size + 1, -1)
    return (found[1:] - found[0]).T / h

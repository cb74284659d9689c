"""The flow of a system over many short times side by side, with its derivatives by the variational equations.

Each piece chooses its own steps: the pair of orders 8, 5 and 3 of J. R. Dormand and P. J. Prince (E. Hairer, S. P.
Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.5 and II.10).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import DOP853

from ..programs import program
from .dynamics import Dynamics

MOST = 4000
"""Steps of a piece at most."""

SHORTEST = 1e-12
"""Share of a piece below which a step is so short that the motion is taken to become infinite."""


class Pieces(NamedTuple):
    """Ends of pieces: x (m, n), dx (m, n, n + 2) their derivatives over where they began, p and the period; steps (m,);
    fine (m,): whether the end was reached."""

    x: Any
    dx: Any
    steps: Any
    fine: Any


def _stages(rate: Callable, s: Any, Z: Any, first: Any, h: Any) -> tuple[Any, list[Any]]:
    """Z after a step and the thirteen slopes of it. Written out: a loop of such short vectors takes seven times as
    long."""
    K = [first]
    for i in range(1, 12):
        K.append(rate(s + float(DOP853.C[i]) * h, Z + h * _mix(DOP853.A[i, :i], K)))
    new = Z + h * _mix(DOP853.B, K)
    return new, [*K, rate(s + h, new)]


def _mix(weights: Any, K: list[Any]) -> Any:
    return sum(float(w) * k for w, k in zip(weights, K, strict=True) if w)


def _error(K: list[Any], h: Any, size: Any) -> Any:
    """Over what is allowed."""
    five, three = (_mix(E, K) / size for E in (DOP853.E5, DOP853.E3))
    five, three = jnp.sum(five**2), jnp.sum(three**2)
    return jnp.abs(h) * five / jnp.sqrt((five + 0.01 * three) * size.size + 1e-300)


def marched(
    rate: Callable, Z: Any, begin: Any, end: Any, absolute: Any, relative: float, most: int = MOST
) -> tuple[Any, Any, Any]:
    """Z (n, k) from begin to end, infinite where it does not get there; steps, and whether it does.

    Args:
        rate: function of s and Z. absolute: (n, 1) tolerance of the first column, which chooses the steps together with
            the others as far as they are larger.
    """

    def size(Z: Any, new: Any) -> Any:
        return absolute + relative * jnp.maximum(jnp.abs(Z), jnp.abs(new))[:, :1]

    def step(carried: tuple) -> tuple:
        s, Z, first, h, count = carried
        h = jnp.minimum(h, end - s)
        new, K = _stages(rate, s, Z, first, h)
        error = _error([k[:, :1] for k in K], h, size(Z, new))
        good = (error < 1.0) & jnp.isfinite(error)
        factor = jnp.clip(0.9 * jnp.where(jnp.isfinite(error), error, 1e9) ** (-1 / 8), 0.2, 6.0)
        last = good & (s + h >= end)
        s, Z, first = (jnp.where(good, a, b) for a, b in ((s + h, s), (new, Z), (K[-1], first)))
        return jnp.where(last, end, s), Z, first, h * jnp.where(good, factor, jnp.minimum(factor, 0.9)), count + 1

    start = (begin, Z, rate(begin, Z), 0.02 * (end - begin), 0)
    least = SHORTEST * (end - begin)
    s, Z, _, _, count = jax.lax.while_loop(lambda c: (c[0] < end) & (c[4] < most) & (c[3] > least), step, start)
    return jnp.where(s >= end, Z, jnp.inf), count, s >= end


BLOCK = 32
"""Pieces at most that one call of a compiled program flows side by side; more of them are several calls."""


def blocks(m: int) -> int:
    """In how many calls of equal size m pieces are done."""
    return next(k for k in range(-(-m // BLOCK), m + 1) if m % k == 0)


def pieces(system: Dynamics, x: Any, p: float, period: float, turns: int) -> Pieces:
    """The ends of m pieces of equal time, which together last one period, from x (m, n); turns: of what drives."""
    m, run = len(x), _pieces(system)
    parts = [run(nodes, begin, 1.0 / m, p, period, float(turns)) for nodes, begin in _parts(x)]
    return Pieces(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def samples(system: Dynamics, x: Any, p: float, period: float, turns: int, each: int) -> Any:
    """(m, each, n) of every one of m pieces at equal times, its beginning included and its end not."""
    m, run = len(x), _samples(system, each)
    parts = [run(nodes, begin, 1.0 / m, p, period, float(turns)) for nodes, begin in _parts(x)]
    return np.concatenate([np.asarray(part) for part in parts])


def _parts(x: Any) -> list[tuple[Any, Any]]:
    """Blocks of nodes, and when they begin in periods."""
    m = len(x)
    count = blocks(m)
    return list(zip(np.split(np.asarray(x), count), np.split(np.arange(m) / m, count), strict=True))


@cache
def rates(system: Dynamics) -> Callable[..., Any]:
    """Compiled function of x (m, n), p and the angle of what drives: x' (m, n)."""
    return program(jax.vmap(system.rate, (0, None, None)))


@cache
def _pieces(system: Dynamics, relative: float = 1e-11) -> Callable[..., Pieces]:
    """Compiled function of x (b, n), when they begin and how long they last in periods, p, the period, the turns."""

    @program
    def run(x: Any, begin: Any, lasts: Any, p: Any, period: Any, turns: Any) -> Pieces:
        n = x.shape[1]
        absolute = relative * jnp.asarray(system.scale)[:, None]

        def f(x: Any, p: Any, period: Any, s: Any) -> Any:
            return period * system.rate(x, p, 2 * jnp.pi * turns * s)

        def rate(s: Any, Z: Any) -> Any:
            def along(dx: Any, more: Any) -> Any:
                return jax.jvp(lambda x, p, T: f(x, p, T, s), (Z[:, 0], p, period), (dx, more[0], more[1]))[1]

            given = jnp.concatenate([jnp.zeros((n, 2)), jnp.eye(2)])
            slopes = jax.vmap(along, (1, 0), 1)(Z[:, 1:], given)
            return jnp.concatenate([f(Z[:, 0], p, period, s)[:, None], slopes], axis=1)

        def one(x: Any, begin: Any) -> tuple:
            Z = jnp.concatenate([x[:, None], jnp.eye(n), jnp.zeros((n, 2))], axis=1)
            return marched(rate, Z, begin, begin + lasts, absolute, relative)

        Z, steps, fine = jax.vmap(one)(x, begin)
        return Pieces(Z[:, :, 0], Z[:, :, 1:], steps, fine)

    return run


@cache
def _samples(system: Dynamics, each: int, relative: float = 1e-9) -> Callable[..., Any]:
    """Compiled function of the same: (b, each, n)."""

    @program
    def run(x: Any, begin: Any, lasts: Any, p: Any, period: Any, turns: Any) -> Any:
        absolute = relative * jnp.asarray(system.scale)[:, None]
        step = lasts / each

        def rate(s: Any, Z: Any) -> Any:
            return period * system.rate(Z[:, 0], p, 2 * jnp.pi * turns * s)[:, None]

        def on(Z: Any, begin: Any) -> tuple:
            return marched(rate, Z, begin, begin + step, absolute, relative)[0], Z[:, 0]

        def one(x: Any, begin: Any) -> Any:
            return jax.lax.scan(on, x[:, None], begin + step * jnp.arange(each))[1]

        return jax.vmap(one)(x, begin)

    return run


@cache
def left_alone(system: Dynamics, relative: float = 1e-8) -> Callable[..., Any]:
    """Compiled function of many starts x (k, n), p, the time each is left and the angle of what drives at the start:
    where they are then (k, n)."""

    @program
    def run(x: Any, p: Any, time: Any, angle: Any) -> Any:
        absolute = relative * jnp.asarray(system.scale)[:, None]
        driven = 0.0 if system.frequency is None else system.frequency(p)

        def rate(t: Any, Z: Any) -> Any:
            return system.rate(Z[:, 0], p, angle + driven * t)[:, None]

        def one(x: Any) -> Any:
            return marched(rate, x[:, None], 0.0, time, absolute, relative, 10_000_000)[0][:, 0]

        return jax.vmap(one)(x)

    return run

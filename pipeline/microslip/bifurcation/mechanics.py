"""Assemblies as systems of first order over a parameter: the one place of this room that knows mechanics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from .. import sliding
from ..data import Array
from ..errors import NotConverged, UserError
from ..harmonic_balance.readout import measured
from ..system.assembly import Assembly
from .dynamics import Dynamics

Make = Callable[[float], Assembly]
"""The assembly at a value of the parameter."""

HIGHEST = 65
"""Values of the parameter at most by which the equations are interpolated."""

EXACT = 1e-12
"""Share of the largest number to which they are."""


@dataclass(frozen=True, eq=False)
class ParametricEquations:
    """The equations of an assembly over a parameter, as polynomials of Chebyshev in jax: all its numbers, which makes
    derivatives over the parameter exact.

    Attributes:
        low, high: of the parameter. tree: of `sliding.Sliding`. series: of each of its leaves, (k, ...).
    """

    low: float
    high: float
    tree: Any
    series: list[Array]

    def at(self, p: Any) -> sliding.Sliding:
        x = (2 * p - self.low - self.high) / (self.high - self.low)
        T = [x, 2 * x * x - 1]
        while len(T) + 1 < max(map(len, self.series)):
            T.append(2 * x * T[-1] - T[-2])

        def leaf(c: Array) -> Any:
            return c[0] + sum(t * a for t, a in zip(T, c[1:], strict=False)) if len(c) > 1 else c[0]

        return jax.tree_util.tree_unflatten(self.tree, [leaf(c) for c in self.series])


def over(make: Make, low: float, high: float) -> ParametricEquations:
    """The equations of assemblies over a parameter, at as many values of it as they need.

    Raises:
        UserError: numbers that do not change smoothly with it; what `sliding.of` refuses.
    """
    like = sliding.points_moved(make(0.5 * (low + high)))
    for count in (5, 9, 17, 33, HIGHEST):
        x = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        values = 0.5 * (low + high + (high - low) * x)
        equations = [jax.tree_util.tree_flatten(sliding.of(make(float(p)), like)) for p in values]
        if len({str(tree) for _, tree in equations}) > 1:
            text = "laws of contacts change in kind with it; take another one, or a shorter range"
            raise UserError(text, "parameter")
        columns = zip(*(leaves for leaves, _ in equations), strict=True)
        series = [_series(x, np.array([np.asarray(leaf) for leaf in leaves])) for leaves in columns]
        ends = [np.abs(c[-2:]).max(initial=0.0) <= EXACT * np.abs(c).max(initial=0.0) for c in series]
        if all(ends):
            return ParametricEquations(low, high, equations[0][1], [_cut(c) for c in series])
    text = "the equations do not change smoothly with it; take a shorter range"
    raise UserError(text, "parameter")


def _series(x: Array, values: Array) -> Array:
    """(k, ...) coefficients through values at the zeros x of the k-th polynomial."""
    angle = np.outer(np.arange(len(x)), np.arccos(x))
    weights = np.cos(angle) * np.where(np.arange(len(x)) == 0, 1.0, 2.0)[:, None] / len(x)
    return np.tensordot(weights, values, 1)


def _cut(series: Array) -> Array:
    """Without what rounding leaves of the highest."""
    sizes = np.abs(series).reshape(len(series), -1).max(axis=1, initial=0.0)
    seen = np.flatnonzero(sizes > 0.01 * EXACT * sizes.max(initial=0.0))
    return series[: max(seen.max(initial=0) + 1, 1)]


def dynamics(make: Make, low: float, high: float, frequency: float | None = None) -> Dynamics:
    """Assemblies over a parameter as a system of first order, read as their outputs are.

    Args:
        frequency: rad/s of the first harmonic of the loads, where there are some.

    Raises:
        UserError: see `over`; loads without a frequency.
    """
    equations = over(make, low, high)
    middle = equations.at(jnp.asarray(0.5 * (low + high)))
    if len(middle.harmonics) and frequency is None:
        raise UserError("frequency: is missing: loads vibrate, so that their frequency is to be given")
    driven = None if not len(middle.harmonics) else lambda p: frequency + 0.0 * p

    def rate(z: Any, p: Any, angle: Any) -> Any:
        return sliding.rate(equations.at(p), z, angle)

    m, n = len(middle.push), middle.order

    def read(x: Array, p: float) -> Array:
        return x[..., :m] @ np.asarray(equations.at(jnp.asarray(p)).output).T

    labels = [f"q{i + 1}" for i in range(m)] + [f"v{i + 1}" for i in range(m)] + [f"x{i + 1}" for i in range(n - 2 * m)]
    assembly = make(0.5 * (low + high))
    names = tuple(f"{w.monitor} {w.label}" for w in assembly.outputs)
    units = tuple(measured(assembly, i).unit for i in range(len(names)))
    shown = read if names else None
    return Dynamics(rate, tuple(labels), size(middle), high - low, driven, names, shown, units, bends(equations))


def bends(equations: ParametricEquations) -> Array:
    """(n, r) what moves the points of contacts, as displacements and as velocities, and what their laws remember."""
    every = jax.tree_util.tree_unflatten(equations.tree, equations.series)
    m = every.push.shape[-1]
    rows = np.concatenate([np.zeros((1, m)), *(np.asarray(p.moved).reshape(-1, m) for p in every.points)])
    _, sizes, ways = np.linalg.svd(rows, full_matrices=False)
    ways = ways[sizes > EXACT * max(sizes[0], 1e-300)].T
    memory = np.eye(equations.at(jnp.asarray(equations.low)).order - 2 * m)
    return np.asarray(scipy.linalg.block_diag(ways, ways, memory))


def size(s: sliding.Sliding) -> Array:
    """(n,) what large coordinates are: displacements under what the contacts hold and the loads push, with velocities
    by the frequencies that go with them."""
    m = len(s.push)
    try:
        still = sliding.equilibrium(s)
    except NotConverged:
        still = np.zeros(s.order)
    values, X = np.linalg.eigh(0.5 * np.asarray(s.K + s.K.T))
    w = np.sqrt(np.maximum(np.abs(values), 1e-6 * np.abs(values).max(initial=1e-300)))
    push = np.abs(np.asarray(s.push)) + np.abs(np.asarray(s.cosine)).sum(0) + np.abs(np.asarray(s.sine)).sum(0)
    displacement = np.linalg.norm(still[:m]) + np.linalg.norm(np.abs(X.T @ push) / w**2) or 1.0
    mean = float(np.exp(np.mean(np.log(w))))
    return np.concatenate(
        [np.full(m, displacement), np.full(m, displacement * mean), np.full(s.order - 2 * m, displacement)]
    )

"""Harmonic balance in the coordinates that bend, against all coordinates: free and driven, and of an assembly."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from microslip.bifurcation.balance import Balance, CondensedBalance, Harmonics, equations
from microslip.bifurcation.dynamics import Dynamics
from microslip.continuation import NewtonSettings, newton

N = 10


def chain(driven: bool) -> Dynamics:
    """A van der Pol oscillator at the end of a damped chain that the parameter stretches; with a force at the other end
    it is driven."""
    rng = np.random.default_rng(5)
    S = rng.standard_normal((N, N)) / 4
    K, C = np.eye(N) + S @ S.T, 0.05 * np.eye(N)
    w = rng.standard_normal(N) / 3

    def rate(x, p, angle):
        q, v = x[:N], x[N:]
        z, dz = w @ q, w @ v
        bent = (0.3 - p * z**2) * dz - 0.2 * z**3 - 0.05 * z**2 + 0.1
        push = jnp.cos(angle) * jnp.zeros(N).at[0].set(0.3 * p) if driven else 0.0
        return jnp.concatenate([v, -(1 + 0.1 * p) * K @ q - C @ v + w * bent + push])

    unit = (w / np.linalg.norm(w))[:, None]
    V = np.block([[unit, np.zeros((N, 1))], [np.zeros((N, 1)), unit]])
    names = tuple(f"x{i}" for i in range(2 * N))
    frequency = (lambda p: 1.2 + 0.1 * p) if driven else None
    return Dynamics(rate, names, np.ones(2 * N), frequency=frequency, bends=V)


def near(system: Dynamics, H: int = 5) -> Harmonics:
    """A small swing of the coordinates that bend."""
    c = np.zeros((2 * H + 1, 2 * N))
    c[1], c[2] = 2.0 * system.bends[:, 0], -2.0 * system.bends[:, 1]
    return Harmonics(c, 1.1, 1.0)


@pytest.mark.parametrize("driven", [False, True])
def test_the_same_orbit_as_of_all_coordinates(driven: bool) -> None:
    system = chain(driven)
    few = equations(system, near(system))
    assert isinstance(few, CondensedBalance) and len(few.unknowns(near(system))) == 11 * 2 + (not driven)
    found = newton(few, few.unknowns(near(system)), 1.0, NewtonSettings(tolerance=1e-13))
    assert found.converged
    orbit = few.orbit(found.x, 1.0)
    assert np.abs(orbit.c[1:3]).max() > 0.1 and np.abs(orbit.c[0]).max() > 1e-3
    every = Balance(system, orbit)
    R, _, _ = every.evaluate(every.unknowns(orbit), 1.0)
    assert np.abs(R).max() < 1e-12
    np.testing.assert_allclose(few.unknowns(orbit), found.x, atol=1e-12)


@pytest.mark.parametrize("driven", [False, True])
def test_derivatives_at_an_orbit_are_those_of_differences(driven: bool) -> None:
    system = chain(driven)
    few = equations(system, near(system))
    x = newton(few, few.unknowns(near(system)), 1.0).x
    _, A, over = few.evaluate(x, 1.0)
    h = 1e-6

    def slope(way: np.ndarray, p: float) -> np.ndarray:
        ends = [few.evaluate(x + s * h * way, 1.0 + s * h * p)[0] for s in (1, -1)]
        return (ends[0] - ends[1]) / (2 * h)

    own = np.array([slope(way, 0.0) for way in np.eye(len(x))]).T
    np.testing.assert_allclose(A, own, atol=1e-8 * np.abs(A).max())
    np.testing.assert_allclose(over, slope(np.zeros(len(x)), 1.0), atol=1e-8 * np.abs(over).max())


def test_what_is_bent_all_over_is_not_condensed() -> None:
    system = chain(False)
    whole = Dynamics(system.rate, system.labels, system.scale, bends=np.eye(2 * N))
    unknown = Dynamics(system.rate, system.labels, system.scale)
    assert all(type(equations(one, near(system))) is Balance for one in (whole, unknown))

"""Points that a sweep adds of its own: at narrow modes, on both sides of folds, beside points without a solution."""

from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq
from test_harmonic_balance_time import Cubic, group, held

from microslip.contact.law import settings, value
from microslip.data import Array
from microslip.errors import UserError
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.checkpoint import labels, resumed_response
from microslip.harmonic_balance.response import HALVINGS, filled_response
from microslip.harmonic_balance.sweeps import hidden
from microslip.results import open_journal

ONE = np.ones(1)


def test_modes_that_are_one_but_for_rounding_get_one_point_and_those_of_the_sweep_none() -> None:
    """Pairs of a ring's waves differ in the last digits, and so may a mode and the frequency that was asked for."""
    modes = np.array([3.0, 3.5, 3.5 * (1 + 1e-14), 4.0 * (1 - 1e-14), 4.6, 9.0])
    assert hidden(np.arange(2.0, 7.0), modes, np.full(6, 0.01)) == pytest.approx([3.5, 4.6], rel=1e-12)
    assert hidden(np.arange(2.0, 7.0), np.zeros(0), np.zeros(0)) == []


def spring(law: Cubic, ratio: float = 0.025) -> balance.Problem:
    """A mass of 1 kg on 1 N/m that a force of 0.3 N drives, the law's force besides."""
    rows = {"face": np.outer([0, 1, 0, 0, 0, 0], ONE), "push": ONE, "tip": ONE}
    return balance.of(held(group(ONE, rows, ratio), law, [1], np.zeros(1), np.zeros(1), 0.3), 1, 64, length=1.0)


def forcing(amplitude: Array, omega: float) -> Array:
    """N that q" + 0.05 q' + q - 0.004 q^3 = F cos(omega t) takes for an amplitude, of its first harmonic alone."""
    return np.hypot(1 - omega**2 - 0.003 * amplitude**2, 0.05 * omega) * amplitude


def fold(low: float, high: float) -> float:
    """rad/s between which the lower motion of that equation at 0.3 N ends: where `forcing` turns, it is 0.3 N."""

    def left(omega: float) -> float:
        c, d = 1 - omega**2, 0.05 * omega
        turns = np.roots([2.7e-5, -0.012 * c, c**2 + d**2])  # of the amplitude squared: where dF/dA = 0
        return float(forcing(np.sqrt(turns.real.min()), omega)) - 0.3

    return brentq(left, low, high)


@pytest.mark.parametrize("points", [11, 31])
def test_a_fold_has_a_point_on_either_side(points: int) -> None:
    """A sweep upwards comes along the lower motion to the fold where that one ends, of the closed form: the last point
    before it and the first one behind it are added, a small share of a step apart."""
    frequency = np.linspace(0.6, 1.1, points) / (2 * np.pi)
    found = filled_response(spring(Cubic(value(-0.004))), frequency)
    step = frequency[1] - frequency[0]
    low, high = 2 * np.pi * found.frequency[found.added]
    assert low <= fold(0.8, 0.96) <= high and high - low == pytest.approx(2 * np.pi * step / 2**HALVINGS)
    a, b = np.abs(found.monitor[found.added])
    assert b > 1.5 * a
    for omega, amplitude in ((low, a), (high, b)):
        assert forcing(amplitude, omega) == pytest.approx(0.3, rel=1e-6)


def test_added_points_are_kept(tmp_path: Path) -> None:
    """Stopped between the two points of a fold, and run once more when all is known: the same points, nothing new."""
    problem, frequency = spring(Cubic(value(-0.004))), np.linspace(0.6, 1.1, 11) / (2 * np.pi)
    head = {"case": "duffing", "labels": labels(problem.assembly)}
    whole, told = filled_response(problem, frequency), list[str]()

    def impatient(text: str) -> None:
        told.append(text)
        if len([t for t in told if "the curve ends" in t]) == 2:
            raise UserError("stopped")

    for count in range(3):
        with open_journal(tmp_path / "points", "abc", head) as journal:
            try:
                found, _ = resumed_response(problem, frequency, journal, "one", impatient)
            except UserError:
                assert count == 0
                continue
        np.testing.assert_array_equal(found.frequency, whole.frequency)
        np.testing.assert_allclose(found.monitor, whole.monitor, rtol=1e-12)
        assert list(found.frequency[found.added]) == [k for k, r in journal.of("one").items() if r["added"]]
        assert len([t for t in told if "the curve ends" in t]) == 4 and len(told) == len(set(told)) + 2


@settings
class Brittle(Cubic):
    """A law without a value beyond a displacement of 1 m, and without a force below."""

    def step(self, u: Any, v: Any, dt: Any, state: Any) -> Any:
        return jnp.where(jnp.abs(u) < 1.0, 0.0 * u, jnp.nan), state


def test_points_without_a_solution_have_one_beside_them() -> None:
    """The linear oscillator, whose amplitude passes 1 m at two frequencies: there are added points, its 64 samples a
    cycle just not beyond; what lies between is told as what it is."""
    frequency = np.linspace(0.6, 1.4, 5) / (2 * np.pi)
    found = filled_response(spring(Brittle(value(0.0))), frequency)
    linear = lambda omega: 0.3 / np.hypot(1 - omega**2, 0.05 * omega)  # noqa: E731
    whole = [brentq(lambda omega: linear(omega) - 1.0, *ends) for ends in ((0.6, 1.0), (1.0, 1.4))]
    omega = 2 * np.pi * found.frequency[found.added]
    np.testing.assert_allclose(omega, whole, rtol=0, atol=1e-3)
    amplitude = np.abs(found.monitor[found.added])
    np.testing.assert_allclose(amplitude, linear(omega), rtol=1e-9)
    assert (0.999 < amplitude).all() and (amplitude <= 1 / np.cos(np.pi / 64)).all()
    assert found.converged[found.added].all() and (~found.converged).sum() == 1

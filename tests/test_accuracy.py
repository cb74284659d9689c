"""The estimated error of a truncated balance against solutions with many harmonics."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest
from test_harmonic_balance_laws import oscillator, point, three_dof, value

from microslip.case.run import _truncated
from microslip.contact.friction import Coulomb
from microslip.contact.normal import Penalty, Preload
from microslip.contact.patch import Patch
from microslip.contact.point import PointContact
from microslip.harmonic_balance.accuracy import enough, error, finer
from microslip.harmonic_balance.response import harmonic_response, of_body, operating
from microslip.harmonic_balance.solver import solve

MANY = 21


def opening(harmonics):
    """Three directions driven at 22 Hz; the contact slides both ways and lifts off."""
    law = PointContact(Penalty(value(2e5)), Coulomb(value(0.4)), value(6e4))
    patch = Patch("face", np.zeros((1, 2)), np.ones(1), law)
    return of_body(
        three_dof(0.03), (patch,), np.array([8.0]), np.array([20.0, 8.0, 4.0]), np.array([0, 1.0, 0]),
        harmonics=harmonics, samples=256, length=1e-4,
    )  # fmt: skip


def sliding(harmonics):
    patch, one = point(Preload(value(2.0)), 2e4, 0.3), np.array([1.0])
    return of_body(oscillator(), (patch,), np.array([2.0]), one, one, harmonics=harmonics, samples=256, length=1e-4)


def readout(problem, f):
    found = solve(problem, 2 * np.pi * f, [])
    assert found.converged
    return found, abs(operating(problem, found).watched[0, 1])


@pytest.mark.parametrize(
    ("make", "f"), [(opening, 22.0), (opening, 30.0), pytest.param(sliding, 17.0, marks=pytest.mark.slow)]
)
def test_the_estimate_is_of_the_size_of_the_error(make, f):
    """Within a factor of three of the difference to 21 harmonics, wherever that is above 1e-4."""
    exact = readout(make(MANY), f)[1]
    told = []
    for harmonics in (1, 3, 5):
        problem = make(harmonics)
        found, amplitude = readout(problem, f)
        estimate, true = error(problem, found.x, found.Omega).readout, abs(amplitude / exact - 1)
        told.append((harmonics, estimate, true))
        if true > 1e-4:
            assert true / 3 < estimate < 3 * true
    assert told[0][2] > 5 * told[2][2]


def test_more_harmonics_are_the_same_problem():
    few, many = opening(2), finer(opening(2), 5)
    made = opening(5)
    x = np.random.default_rng(2).normal(size=made.size)
    Omega = 2 * np.pi * 22.0
    np.testing.assert_array_equal(many.at(Omega).residual(x), made.at(Omega).residual(x))
    assert few.harmonics == 2 and finer(few, 200).groups[0].model.samples == 1600


def test_harmonics_are_added_until_the_tolerance_is_met():
    problem = opening(1)
    found = enough(problem, readout(problem, 22.0)[0], tolerance=2e-3)
    exact = readout(opening(MANY), 22.0)[1]
    amplitude = abs(operating(found.problem, found.point).watched[0, 1])
    assert found.reached and [e.harmonics for e in found.errors] == [1, 3, 6, 12][: len(found.errors)]
    assert abs(amplitude / exact - 1) < 2e-3 < found.errors[-2].readout
    assert not enough(problem, readout(problem, 22.0)[0], tolerance=1e-9, most=4).reached


def test_a_case_says_where_its_harmonics_are_too_few():
    """One harmonic at a contact that slides and opens is remarked on; seven are not."""
    built = SimpleNamespace(settings=SimpleNamespace(ring=None, mode="marched"))
    for harmonics, count in ((1, 1), (7, 0)):
        problem = opening(harmonics)
        found = harmonic_response(problem, np.array([22.0, 30.0]), np.ones(1))
        remarks = _truncated(built, problem, found, 8.0)
        assert len(remarks) == count
        assert all(re.match(r"At F_N = 8 N the amplitude at 22 Hz is uncertain by about [\d.]+ %", r) for r in remarks)

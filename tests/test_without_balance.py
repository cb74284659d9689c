"""Motions that nothing limits and bodies that nothing holds are said to be that; stiffness without bounds costs no
digits."""

from __future__ import annotations

import numpy as np
import pytest

import microslip as ms

CHAIN = 0.3 * np.array([[1.0, -1.0], [-1.0, 1.0]])


def at(system, *frequency, **more):
    return ms.harmonic_response(system, frequency, unit="rad/s", **more)


@pytest.mark.parametrize("damping", [0.0, 1e-30, 1e-160])
def test_at_its_resonance_a_mode_without_damping_has_no_amplitude(damping):
    """A damping below the rounding of stiffness less inertia is none."""
    found = at(ms.structure(1.0, 1.0, force={0: 1.0}, damping_ratio=damping), 0.5, 1.0, 2.0)
    assert found.converged.tolist() == [True, False, True] and found.status[1].startswith("resonance: ")
    assert np.isnan(found.amplitude[1])
    np.testing.assert_allclose(found.amplitude[[0, 2]], [1 / 0.75, 1 / 3], rtol=1e-12)


def test_a_mode_that_its_contact_does_not_feel_is_told_the_same_of():
    two = ms.structure(np.eye(2), np.diag([1.0, 4.0]), force={0: 0.3, 1: 1.0}, elements=[ms.jenkins(1.0, 0.5)])
    found = at(two, 0.9, 2.0)
    assert found.converged.tolist() == [True, False] and "resonance" in found.status[1]


def test_a_harmonic_that_meets_a_resonance_is_told_with_what_was_asked_for():
    idle = ms.structure(1.0, 1.0, force={0: 0.3}, elements=[ms.polynomial({3: 0.0})])
    said = at(idle, 0.5, 1.0).status
    assert "at 1 rad/s, harmonic 2 of 0.5 rad/s; " in said[0]
    assert "at 1 rad/s; " in said[1]


def test_small_damping_gives_its_large_amplitude():
    D = 1e-9
    found = at(ms.structure(1.0, 1.0, force={0: 1.0}, damping_ratio=D), 1.0)
    assert found.converged.all() and found.amplitude[0] == pytest.approx(1 / (2 * D), rel=1e-9)


def test_a_mode_at_its_resonance_that_nothing_drives_is_at_rest():
    found = at(ms.structure(np.eye(2), np.diag([1.0, 4.0]), force={0: 1.0}, output=[0, 1]), 2.0)
    assert found.converged.all()
    np.testing.assert_allclose(found.harmonics(0)[0, 1], -1 / 3, rtol=1e-12)
    assert abs(found.harmonics(1)).max() == 0


def test_a_free_body_moves_about_a_place_that_does_not_matter():
    """1 / (2 (-w^2)) of both masses together, and 1 / (2 (0.6 - w^2)) of one against the other."""
    found = at(ms.structure(np.eye(2), CHAIN, force={0: 1.0}, steady={0: 1.0, 1: -1.0}), 1.0, 2.0)
    w = np.array([1.0, 2.0])
    np.testing.assert_allclose(found.amplitude, np.abs(0.5 / -(w**2) + 0.5 / (0.6 - w**2)), rtol=1e-12)
    assert found.converged.all()
    np.testing.assert_allclose(found.harmonics(0)[:, 0].real, 1 / 0.6, rtol=1e-12)


@pytest.mark.parametrize("damping", [0.0, 0.1])
@pytest.mark.parametrize("K", [0.0, CHAIN])
def test_a_steady_force_on_a_free_body_has_no_balance(K, damping):
    n = len(np.atleast_1d(K))
    found = at(ms.structure(np.eye(n), np.atleast_2d(K), damping * np.eye(n), force={0: 1.0}, steady={0: 1.0}), 1.0)
    assert found.points[0].away and found.status[0].startswith("no balance: ")


@pytest.mark.parametrize("stiffness", [1e9, 1e15, 1e18])
def test_a_stop_that_is_not_met_changes_nothing_however_stiff(stiffness):
    """Displacements that are equal to so many digits are no longer subtracted: of 1e15 N/m the amplitude was 15 % off
    and called converged, of 1e18 another one came with every guess."""
    free, stop = (ms.structure(1.0, 1.0, 0.1, force={0: 0.01}, elements=e) for e in ([], [ms.stop(stiffness, 0.11)]))
    w = np.array([0.5, 0.9, 1.0, 1.5])
    exact, found = (at(one, *w, harmonics=1) for one in (free, stop))
    assert found.converged.all()
    np.testing.assert_allclose(found.amplitude, exact.amplitude, rtol=1e-8)
    np.testing.assert_allclose(exact.amplitude, 0.01 / np.abs(1 - w**2 + 0.1j * w), rtol=1e-12)


@pytest.mark.parametrize("stiffness", [1e6, 1e9, 1e12])
def test_two_bodies_joined_by_a_spring_of_any_stiffness(stiffness):
    """Together they are one mass, but for what the spring yields. That one moves by 1e-12 of the other, the check of
    the contact's motion cannot tell any more."""
    spring = ms.polynomial({1: stiffness}, at=0, to=1)
    two = ms.structure(np.eye(2), np.eye(2), 0.1 * np.eye(2), force={0: 1.0}, elements=[spring])
    w = np.array([0.5, 1.5])
    found = at(two, *w)
    assert all(p.converged for p in found.points) and (stiffness > 1e9 or found.converged.all())
    amplitude = np.abs(found.arrays["monitors/q"][:, 0, 1])  # what was found, told or not
    np.testing.assert_allclose(amplitude, 1 / np.abs(2 - 2 * w**2 + 0.2j * w), rtol=1 / stiffness + 1e-9)

"""Hard cases for following friction responses: nothing may stall, turn round or jump, from either end.

Kinks where sliders stick and slip, folds one after the other where a contact lifts off, samples that open one by one
and fold the curve for themselves, two stable motions at one frequency, hardening by a gap that closes.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from test_harmonic_balance_time import beam_in_space, cantilever, duffing, group, held

import microslip as ms
from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty
from microslip.contact.point import PointContact
from microslip.continuation import Branch, Settings, trace
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.solver import solve
from microslip.system.assembly import Assembly


def gap() -> Assembly:
    """A mass that closes a gap of a tenth: it hardens, and slides where it touches."""
    rows = {"face": np.vstack([np.eye(3)[:, :2], np.zeros((3, 2))]), "push": np.array([1.0, 0.6]), "tip": np.eye(2)[0]}
    law = PointContact(Penalty(value(3.0)), Coulomb(value(0.3)), value(2.0))
    offset = np.array([-0.1, 0.0])
    return held(group(np.array([1.0, 1.2]), rows, 0.02), law, [0, 1], np.zeros(2), offset, 0.02)


def ends(problem: Problem, low: float, high: float, points: int) -> list[Branch]:
    """The curve from its low end and from its high one."""
    found = []
    for direction, begin in ((1, low), (-1, high)):
        settings = Settings(direction=direction, low=low, high=high, points=points)
        first = solve(problem, begin, [])
        assert first.converged
        found.append(trace(problem, first.x, begin, settings))
    return found


CASES = {
    "duffing": (duffing, (7, 64, 1.0), (0.3, 2.5), 200, 2, 0),
    "stick and slip, 32 samples": (cantilever, (7, 32, 0.0125), (2.0, 12.0), 300, 0, 2),
    "stick and slip, 1024 samples": (cantilever, (7, 1024, 0.0125), (2.0, 12.0), 200, 0, 0),
    "a gap that closes": (gap, (3, 128, 0.1), (0.6, 2.0), 500, 2, 0),
    "lift-off in space": (beam_in_space, (3, 64, 0.05), (2.0, 6.0), 800, 4, 20),
}


QUICK = ("stick and slip, 32 samples",)


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in CASES])
def test_a_curve_is_followed_to_its_end_from_both_sides(name: str) -> None:
    """It reaches the other bound, in no more points than given, and the residual vanishes on it. Both ways meet the
    same motions: each curve passes every point of the other one, and is as long, so that neither ran to and fro."""
    make, (harmonics, samples, length), (low, high), most, folds, kinks = CASES[name]
    problem = replace(balance.of(make(), harmonics, samples, length=length), lam_scale=(high - low) / 10)
    there, back = ends(problem, low, high, most)
    for branch, bound in ((there, high), (back, low)):
        assert branch.points[-1].lam == bound and len(branch.points) < most
        assert len(branch.of_kind("fold")) >= folds and sum(p.kink for p in branch.points) >= kinks
        worst = max(np.abs(problem.at(p.lam).residual(p.x)).max() / np.abs(p.x).max() for p in branch.points[::7])
        assert worst < 1e-7  # next to a sample that opens the force bends like a root: 3e-8 there, 1e-9 elsewhere
    assert max(apart(problem, there, back), apart(problem, back, there)) < 0.02  # chords of steps up to 0.1
    assert back.points[-1].arclength == pytest.approx(there.points[-1].arclength, rel=0.01)


def apart(problem: Problem, one: Branch, other: Branch) -> float:
    """Largest distance of one curve's points from the chords of the other, in scaled units."""
    y, z = (np.column_stack([b.x / problem.x_scale, b.lam / problem.lam_scale]) for b in (one, other))
    legs = np.diff(z, axis=0)
    size = np.maximum((legs**2).sum(axis=1), 1e-300)
    found = 0.0
    for point in y:
        share = np.clip(((point - z[:-1]) * legs).sum(axis=1) / size, 0, 1)[:, None]
        found = max(found, float(np.linalg.norm(z[:-1] + share * legs - point, axis=1).min()))
    return found


@pytest.mark.parametrize("stiffness", [1e12, 1e15])
def test_stiff_contacts_are_rigid_links(stiffness: float) -> None:
    """Two masses whose second one a stiff spring, or a stop that a steady force keeps closed, holds, or which it joins,
    move as one mass does to the digits that rounding leaves; they are called solved."""
    K = np.array([[2.0, -1.0], [-1.0, 2.0]])
    whole = partial(ms.structure, np.eye(2), K, 0.02 * K, output=0)
    W = np.array([0.7, 1.2])
    alone = 0.3 / abs(2.0 - W**2 + 0.04j * W)
    joined = 0.3 / abs(2.0 - 2 * W**2 + 0.04j * W)
    for element, steady, expected in (
        (ms.polynomial({1: stiffness}, 1), 0.0, alone),
        (ms.stop(stiffness, -0.1, 1), 5.0, alone),
        (ms.polynomial({1: stiffness}, 0, 1), 0.0, joined),
        (ms.jenkins(stiffness, 1.0, 0, 1), 0.0, joined),
    ):
        made = whole(force={0: 0.3}, steady={1: steady}, elements=[element])
        found = ms.harmonic_response(made, W, unit="rad/s")
        assert found.converged.all(), found.status
        np.testing.assert_allclose(found.amplitude, expected, rtol=3e-4)


@pytest.mark.parametrize("stiffness", [1e12, 1e15])
def test_a_mass_that_a_steady_force_holds_on_a_stiff_stop_moves_as_its_spring(stiffness: float) -> None:
    """What is lost is less than the rounding of the work of the loads: no reason to refuse a motion that is right."""
    held = ms.structure(1.0, 1e6, force=[1.0], steady=[10.0], damping_ratio=0.01, elements=[ms.stop(stiffness, 0.0)])
    W = 2 * np.pi * np.array([10.0, 100.0])
    found = ms.harmonic_response(held, W, unit="rad/s")
    assert found.converged.all(), found.status
    np.testing.assert_allclose(found.amplitude, 1 / (stiffness + 1e6 - W**2), rtol=1e-5)


def test_why_a_hard_stop_has_no_solution_names_what_a_person_can_set() -> None:
    found = ms.harmonic_response(
        ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.stop(1e15, 0.1)]), [1.0], unit="rad/s"
    )
    assert not found.converged.any() and "samples" in found.status[0] and "points" not in found.status[0]

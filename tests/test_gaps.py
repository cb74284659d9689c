"""Rings with several contacts in each gap: the equations of a Newton step, gap by gap, against all of them at once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import microslip as ms
from microslip.analyses import balanced
from microslip.harmonic_balance import joints
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.solver import solve
from microslip.system import Body, Contact, Force, Monitor, Spring, System

BLADES, HARMONICS = 12, 1
RUB = {"normal_stiffness": 2e6, "tangential_stiffness": 1e6, "includes": "surface", "friction": 0.3, "points": [1, 1]}
RUB |= {"normal_force": 20.0, "width": 0.01, "height": 0.01}


def blade(contacts: int) -> Any:
    """Masses one above the other on springs, each with a face to either side."""
    bodies = [Body(f"m{i}", 0.1, (0.0, 0.0, 0.2 + 0.1 * i), free="x y z") for i in range(contacts)]
    names = ["ground", *(b.name for b in bodies)]
    springs = [Spring(a, b, (4e4, 9e4, 3e5)) for a, b in zip(names[:-1], names[1:], strict=True)]
    faces = [
        Contact(f"{side}{i}", f"m{i}", (way, 0, 0), t2=(0, 0, 1), role=side, sector_shift=int(way))
        for i in range(contacts)
        for side, way in (("right", 1.0), ("left", -1.0))
    ]
    push, tip = Force("push", bodies[-1].name, (1, 0.3, 0)), Monitor("tip", bodies[-1].name)
    return System("blade", bodies, springs, faces, [push], [tip], ratio=0.002).basis()


def ring(contacts: int, blades: int = BLADES) -> Problem:
    """All blades, whose gaps close at so many places."""
    gaps = [{"interface": f"right{i}", "against": f"left{i}", "against_sector": 1, **RUB} for i in range(contacts)]
    case = {"body": "blade", "excitation": "push", "amplitude": 5.0, "monitor": "tip", "direction": "x",
            "ring": {"blades": blades, "engine_order": 2, "model": "full"}, "contacts": gaps}  # fmt: skip
    return balanced(ms.assemble(case, blade=blade(contacts)), HARMONICS, 32)


@pytest.mark.parametrize("contacts", [1, 2, 3])
def test_a_step_around_the_ring_is_that_of_all_equations_at_once(contacts: int) -> None:
    """Contacts of one gap are solved for together; the whole matrix has n times as many rows."""
    problem = ring(contacts)
    gaps = problem.sides.ring
    assert gaps is not None and (gaps.count, gaps.each) == (BLADES, contacts)
    at = problem.at(2 * np.pi * 140.0)
    x = at.reference + 0.1 * np.abs(at.reference).max() * np.random.default_rng(1).normal(size=problem.size)
    J = at.jacobian(at.forces(x)[1])
    assert isinstance(J, joints.Joints) and J.apart is not None
    right = np.random.default_rng(2).normal(size=problem.size)
    dv = J.apart.step(right.reshape(-1, problem.count) * problem.scale, J.slopes)
    assert dv is not None
    exact = np.linalg.solve(J.dense(), right)
    np.testing.assert_allclose((dv / problem.scale).ravel(), exact, atol=1e-8 * np.abs(exact).max())


def test_the_vibration_is_that_of_a_ring_in_which_every_equation_knows_every_other() -> None:
    problem = ring(2)
    found = solve(problem, 2 * np.pi * 140.0, [])
    assert found.converged
    whole = replace(problem)
    whole.__dict__["sides"] = sides = replace(problem.sides)
    sides.__dict__["ring"] = None
    other = solve(whole, 2 * np.pi * 140.0, [])
    assert other.converged
    np.testing.assert_allclose(other.x, found.x, atol=1e-8 * np.abs(found.x).max())


def test_contacts_that_form_no_ring_are_solved_for_together() -> None:
    """Bodies that touch any others."""
    sides = ring(2).sides
    odd = replace(sides, part=np.random.default_rng(3).permutation(sides.part))
    assert odd.ring is None

"""Rotation speed and frequency tied along an engine-order line, bodies and contacts those of every speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refused
from test_speed_range import TOP, ranged

from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.harmonic_balance import envelope, response
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.solver import solve
from microslip.modal.campbell import crossings, track_basis
from microslip.modal.speed_range import basis_at
from microslip.system.assembly import Assembly, ContactFace, Load, Output, preloaded_contact
from microslip.system.component import Component

FINE = {"harmonics": 2, "samples": 32, "cycles": 30}
ORDER = 4


def rubbing(push: float = 1e4) -> Assembly:
    """A blade whose tip rubs on a wall, pushed by a pressure."""
    places, areas = grid(0.02, 0.003, (3, 1))
    law = PointContact(Penalty(value(1e6 / 3)), Coulomb(value(0.3)), value(5e5 / 3))
    wall = preloaded_contact("wall", Patch("tip", places, areas, law), ContactFace("blade", "tip"), None, normal=1.0)
    component = Component("blade", {0: ranged().groups[0, 0]})
    return Assembly((component,), (wall,), (Load("blade", "gas", push),), (Output("blade", "end", "u_x"),))


def pressed(rpm: float) -> float:
    """Grows with the square of the speed."""
    return 2e-7 * rpm**2


def at_speed(rpm: float) -> Assembly:
    """The blade of the range at a speed, and the wall as it is pressed there."""
    still = rubbing()
    (wall,) = still.contacts
    return replace(still, components=(turning(rpm),), contacts=(wall.pressed(pressed(rpm)),))


def turning(rpm: float) -> Component:
    return Component("blade", {0: basis_at(ranged(), rpm).groups[0, 0]})


def speeds(count: int = 12) -> np.ndarray:
    """About the crossing of the line with the first mode that sticks."""
    return np.linspace(0.55 * TOP, 0.95 * TOP, count)


@pytest.mark.slow
def test_every_speed_is_the_response_of_the_body_at_that_speed() -> None:
    """Against a problem built for three of the speeds alone, from groups of the range and forces by hand, started
    cold: 1e-7 of the amplitude. The contact slides at some and sticks at others."""
    found = envelope.along(at_speed, speeds(), ORDER, **FINE)
    assert found.converged.all()
    np.testing.assert_allclose(found.frequency, ORDER * speeds() / 60, rtol=1e-14)
    np.testing.assert_allclose(found.normal[:, 0], pressed(speeds()), rtol=1e-3)  # the means of friction bend the blade
    assert found.slipping.max() == 1.0 and found.slipping.min() == 0.0
    for i in (0, 5, 11):
        problem = balance.of(at_speed(float(speeds()[i])), **FINE)
        point = solve(problem, 2 * np.pi * ORDER * speeds()[i] / 60, [])
        alone = response.operating(problem, point).outputs[0]
        np.testing.assert_allclose(found.harmonics[i], alone, rtol=0, atol=1e-7 * np.abs(alone).max())
    assert list(found.columns())[0] == "speed_rpm" and "normal_force_1_N" in found.columns()


def test_a_free_blade_resonates_where_the_campbell_diagram_crosses() -> None:
    """Without a contact the largest answer along the line stands at the crossing of engine order and mode, within a
    step of the speeds (0.05 %); a body held at rest's modes would resonate elsewhere."""
    tracks = track_basis(ranged())
    meets = [c for c in crossings(tracks, [ORDER]) if c.curve == 0][0]
    free = Assembly(rubbing().components, (), rubbing().loads, rubbing().outputs)
    near = meets.speed * 30 / np.pi * (1 + np.linspace(-0.01, 0.01, 41))
    amplitude = []
    for n in near:
        at = replace(free, components=(turning(float(n)),))
        part = at.part(at.components[0], 1)
        w = 2 * np.pi * float(envelope.frequency(ORDER, n))
        amplitude.append(abs((part.output @ np.linalg.solve(part.K - w**2 * part.M + 1j * w * part.C, part.load))[0]))
    assert near[int(np.argmax(amplitude))] == pytest.approx(meets.speed * 30 / np.pi, rel=5e-4)
    at_rest = ranged().groups[0, 0].frequency[0] * 60 / ORDER
    assert abs(at_rest / near[20] - 1) > 0.05


def test_mistakes_are_told() -> None:
    for words, call in (
        ("one or more speeds", lambda: envelope.along(at_speed, np.zeros(0), 2)),
        ("all above 0", lambda: envelope.along(at_speed, np.array([0.0, 10.0]), 2)),
        ("stand in no ring", lambda: envelope.along(at_speed, np.array([8000.0]))),
        ("0 is steady", lambda: envelope.along(at_speed, np.array([8000.0]), 0)),
        ("outside the speed range", lambda: envelope.along(at_speed, np.array([2 * TOP]), 4)),
    ):
        refused(words, call)

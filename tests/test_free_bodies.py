"""Dampers that nothing but their contacts holds: stuck, sliding in part and as a whole, sliding away."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from integrator import steady

from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty, Preload
from microslip.contact.patch import Patch
from microslip.contact.point import PointContact
from microslip.data import ModalGroup
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance import pseudo_transient, response
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.solver import from_rest, solve
from microslip.system import Body, Contact, Force, Monitor, Spring, System
from microslip.system.assembly import Assembly, ContactFace, Load, Output
from microslip.system.assembly import Contact as Touching
from microslip.system.component import Component

Array = np.ndarray
Omega = 2 * np.pi * 97.0
PRESSED, NORMAL, TANGENTIAL = 100.0, 4e6, 2e6


def blade(name: str, frequency: float, axial: float, normal: tuple[float, float, float]) -> ModalGroup:
    """1 kg that swings along y and a share of that along z, four times as stiff across."""
    along, across = np.array([1.0, axial]), np.array([-axial, 1.0])
    K = (np.outer(along, along) + 16 * np.outer(across, across)) * (2 * np.pi * frequency) ** 2 / (1 + axial**2)
    face = Contact("face", name, normal, t2=(0, 0, 1))
    push, tip = Force("push", name, (0, 1, 0)), Monitor("tip", name)
    body = Body(name, 1.0, free="y z")
    return System(name, [body], [], [face], [push], [tip], stiffness=K, ratio=0.02).basis().groups[0, 0]


def wedge(push: float, friction: float = 0.3, hold: float = 0.0, axial: float = 0.3, damping: Any = None) -> Assembly:
    """A damper of 0.1 kg pressed with 100 N against the slopes of two blades that swing against each other.

    Its contacts hold it across the slopes; along z (the ridge) friction alone does, and springs of a frequency `hold`.
    """
    c = np.sqrt(0.5)
    normals = {"a": (-c, c, 0.0), "b": (-c, -c, 0.0)}
    groups = {name: blade(name, f, axial, normals[name]) for name, f in (("a", 100.0), ("b", 105.0))}
    spring = [Spring("ground", "damper", (0.1 * (2 * np.pi * hold) ** 2,) * 3)] if hold else []
    faces = [Contact(name, "damper", tuple(-x for x in normals[name]), t2=(0, 0, -1)) for name in normals]
    groups["damper"] = free_body(0.1, spring, faces)
    law = PointContact(
        Penalty(value(NORMAL)), Coulomb(value(friction)), value(TANGENTIAL), damping=damping
    )
    patch = Patch("face", np.zeros((1, 2)), np.ones(1), law, np.eye(3)[None])
    pressed = np.array([PRESSED, 0, 0])
    contacts = [
        Touching(f"seat {name}", patch, *sides(groups, name), pressed / NORMAL, pressed) for name in normals
    ]  # fmt: skip
    loads = Load("a", "push", push), Load("b", "push", -push)
    outputs = [Output(name, "tip", "u_y") for name in groups] + [Output("damper", "tip", "u_z")]
    return Assembly(tuple(Component(n, {0: g}) for n, g in groups.items()), tuple(contacts), loads, tuple(outputs))


def free_body(mass: float, springs: list[Any], faces: list[Contact], free: str = "x y z") -> ModalGroup:
    body = Body("damper", mass, free=free)
    return System(
        "damper", [body], springs, faces, [Force("gas", "damper", (0, 1, 0))], [Monitor("tip", "damper")]
    ).basis().groups[0, 0]  # fmt: skip


def sides(groups: dict[str, ModalGroup], name: str) -> tuple[ContactFace, ContactFace]:
    """The face of a blade, and what meets it of the damper, in the frame of the blade's."""
    first, second = groups[name].interfaces["face"], groups["damper"].interfaces[name]
    turned = first.rotation @ second.rotation.T @ second.rows[:3]
    return ContactFace(name, "face", rows={0: first.rows[:3]}), ContactFace("damper", name, rows={0: turned})


def rider(push: float, gas: float) -> Assembly:
    """A damper of 0.1 kg that rides on a blade: 30 N of friction, and a steady force along its way."""
    groups = {"a": blade("a", 100.0, 0.0, (-1.0, 0.0, 0.0))}
    groups["damper"] = free_body(0.1, [], [Contact("a", "damper", (1, 0, 0), t2=(0, 0, -1))], "y z")
    law = PointContact(Preload(value(PRESSED)), Coulomb(value(0.3)), value(TANGENTIAL))
    patch = Patch("face", np.zeros((1, 2)), np.ones(1), law, np.eye(3)[None])
    contact = Touching("seat", patch, *sides(groups, "a"), np.zeros(3), np.array([PRESSED, 0, 0]))
    loads = Load("a", "push", push), Load("damper", "gas", gas, harmonic=0)
    outputs = Output("a", "tip", "u_y"), Output("damper", "tip", "u_y")
    return Assembly(tuple(Component(n, {0: g}) for n, g in groups.items()), (contact,), loads, outputs)


def coarse(assembly: Assembly, harmonics: int = 5, samples: int = 128) -> Problem:
    return balance.of(assembly, harmonics, samples)


SLOW = pytest.mark.slow


@pytest.mark.slow
@pytest.mark.parametrize(
    ("push", "least", "most"),
    [pytest.param(30.0, 0.0, 0.01, marks=SLOW), (60.0, 0.5, 0.9), pytest.param(100.0, 0.95, 1.0, marks=SLOW)],
)
def test_a_damper_that_sticks_slides_in_part_and_as_a_whole_against_time(
    push: float, least: float, most: float
) -> None:
    """Time integration from rest with as many steps a period: every harmonic of every read-out to 1e-3 of the largest,
    with 31 harmonics; where part of it slides both need 2048, between 512 and these they move to each other by 1e-3.
    Sliding as a whole the damper is carried half a millimetre along the ridge, to where its hold
    (40 Hz) balances friction: 1e-2 of that place."""
    assembly = wedge(push, hold=40.0, damping=jnp.asarray(1e-4))
    fine = ((20, 2048),) if least == 0.5 else ()
    problem = balance.of(assembly, 31, 2048 if fine else 512)
    point = solve(problem, Omega, [])
    assert point.converged
    found = response.operating(problem, point)
    assert all(least <= c.slipping[0] <= most for c in found.cycles.values())
    motion = steady(assembly, Omega, ((60, 128), (40, 512), *fine))[-1]
    assert motion.change < 1e-4
    h = motion.harmonics(motion.outputs, 9)
    np.testing.assert_allclose(found.outputs[:, 1:10], h[:, 1:], rtol=0, atol=1e-3 * np.abs(h[:, 1:]).max())
    if least > 0.9:
        assert h[-1, 0].real > 5e-4
        np.testing.assert_allclose(found.outputs[-1, 0], h[-1, 0], rtol=1e-2)


@pytest.mark.parametrize("friction", [1e3, 1e-7])
def test_limits_of_large_and_small_friction(friction: float) -> None:
    """Stuck: linear, with both springs of every contact, 1e-9. Free: with the normal ones alone, 1e-5. No hold."""
    assembly = wedge(5.0, friction)
    problem = coarse(assembly)
    point = solve(problem, Omega, [])
    assert point.converged
    part = assembly.joined(1)
    k = np.diag([NORMAL, TANGENTIAL, TANGENTIAL] * 2 if friction > 1 else [NORMAL, 0.0, 0.0] * 2)
    A = part.K - Omega**2 * part.M + 1j * Omega * part.C + part.rows.T @ k @ part.rows
    direct = part.output @ np.linalg.solve(A, part.load)
    found = response.operating(problem, point).outputs
    tolerance = 1e-9 if friction > 1 else 1e-5
    np.testing.assert_allclose(found[:, 1], direct, rtol=0, atol=tolerance * np.abs(direct).max())


def test_a_place_that_nothing_determines_stays_the_one_at_rest() -> None:
    """Blades without any motion along the ridge: nothing moves the damper along it, and it slides as a whole. Rounding
    takes it no further than a thousandth of what its contacts' springs yield before they slide."""
    problem = coarse(wedge(100.0, axial=0.0))
    for point in (solve(problem, Omega, []), from_rest(problem, Omega)):
        assert point.converged
        found = response.operating(problem, point)
        assert min(c.slipping[0] for c in found.cycles.values()) > 0.9
        assert np.abs(found.outputs[-1]).max() < 1e-3 * 0.3 * PRESSED / TANGENTIAL


@pytest.mark.slow
def test_a_damper_that_slides_away_is_told_so() -> None:
    """Sliding and swinging normal forces push it along the ridge, where nothing stops it: in time it goes on and on,
    and the blades' amplitude is that of the balance with the damper in place to 1 %."""
    assembly = wedge(100.0, damping=jnp.asarray(1e-4))
    problem = coarse(assembly, 15, 256)
    point = solve(problem, Omega, [])
    assert point.away and not point.converged
    assert point.status.startswith("no balance: damper slides away: nothing balances a mean force of")
    found = response.operating(problem, point).outputs
    early, late = steady(assembly, Omega, ((60, 128), (20, 256)))
    places = [m.harmonics(m.outputs, 1)[-1, 0].real for m in (early, late)]
    assert places[1] > 1.2 * places[0] > 1e-3
    h = late.harmonics(late.outputs, 1)
    np.testing.assert_allclose(found[:2, 1], h[:2, 1], rtol=0, atol=1e-2 * np.abs(h[:2, 1]).max())


@pytest.mark.slow
def test_a_steady_force_is_held_by_friction_or_named() -> None:
    """A damper rides on a blade: while it sticks, 1 N displaces it by 1 N over the stiffness of its contact; once it
    slides both ways, nothing is left against the 1 N, and the status names it."""
    stuck = coarse(rider(1.0, 1.0))
    point = solve(stuck, Omega, [])
    assert point.converged
    means = response.operating(stuck, point).outputs[:, 0].real
    assert means[1] - means[0] == pytest.approx(1.0 / TANGENTIAL, rel=1e-9)
    away = solve(coarse(rider(60.0, 1.0)), Omega, [])
    assert away.status.startswith("no balance: damper slides away: nothing balances a mean force of 1 N on it")
    assert solve(coarse(rider(60.0, 0.0)), Omega, []).converged


@pytest.mark.slow
def test_slow_time_rests_at_solutions_and_leads_to_them() -> None:
    """A solution is a fixed point of every step of pseudo-time, and what is found from rest is the one of Newton's."""
    for push in (30.0, 100.0):
        problem = coarse(wedge(push, hold=40.0))
        point, other = solve(problem, Omega, []), from_rest(problem, Omega)
        assert point.converged and other.converged
        at = problem.at(Omega)
        q = at.modal(point.x, at.force(point.x))
        for rate in (1e-3 * Omega, 0.1 * Omega):
            R = pseudo_transient.slowly(at, rate, q).residual(point.x)
            assert np.abs(R).max() < 1e-8 * np.abs(point.x).max()
        first, second = (response.operating(problem, p).outputs for p in (point, other))
        np.testing.assert_allclose(second, first, rtol=0, atol=1e-6 * np.abs(first).max())


def test_a_damper_that_slides_as_a_whole_is_found() -> None:
    """Contacts so stiff and undamped, and held so softly, that Newton's method wanders from the sticking contacts."""
    problem = coarse(wedge(100.0, hold=5.0))
    assert pseudo_transient.serves(problem) and not pseudo_transient.unheld(problem)
    for f in (90.0, 105.0):
        point = solve(problem, 2 * np.pi * f, [])
        assert point.converged and point.iterations < 400

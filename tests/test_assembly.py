"""Assemblies: a sector that stands for a ring, the two forms of the equations, frames, derivatives."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.data import ModalBasis
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance import response
from microslip.harmonic_balance.readout import amplitude
from microslip.harmonic_balance.solver import newton, solve
from microslip.system import Body, Contact, Force, Monitor, Spring, System
from microslip.system.assembly import Assembly, ContactFace, Load, Output, across, preloaded_contact
from microslip.system.component import Component, Ring


def blade() -> ModalBasis:
    """A rigid tip of 1 kg with a contact on each side, 50 to 150 Hz, pushed off its centre."""
    tip = Body("tip", 1.0, (0, 0, 0), inertia=(1e-3, 2e-3, 3e-3))
    faces = [
        Contact("right", "tip", (1, 0, 0), t2=(0, 0, 1), at=(0.02, 0, 0)),
        Contact("left", "tip", (-1, 0, 0), t2=(0, 0, 1), at=(-0.02, 0, 0)),
    ]
    push = Force("gas", "tip", (1, 0.4, 0.2), at=(0, 0.01, 0.005))
    spring = Spring("ground", "tip", (1e5, 3e5, 9e5, 100.0, 200.0, 300.0))
    return System("blade", [tip], [spring], faces, [push], [Monitor("tip", "tip")], ratio=0.01).basis()


def sector(
    blades: int, order: int, normal: float = 20.0, push: float = 4.0, points: tuple[int, int] = (3, 2)
) -> Assembly:
    """One blade that stands for a ring: its right face meets the left one of the next blade."""
    places, areas = grid(0.02, 0.01, points)
    n = len(areas)
    law = PointContact(Penalty(value(2e6 / n)), Coulomb(value(0.05)), value(1e6 / n))
    facing = across(np.diag([1.0, 1, 1]), np.diag([-1.0, -1, 1]))
    patch = Patch("right", places, areas, law)
    sides = ContactFace("blade", "right"), ContactFace("blade", "left", facing, 1)
    contact = preloaded_contact("shroud", patch, *sides, normal=normal)
    component, load = Component("blade", {0: blade().groups[0, 0]}), Load("blade", "gas", push)
    return Assembly((component,), (contact,), (load,), (Output("blade", "tip", "u_x"),), Ring(blades, order))


FINE = {"harmonics": 3, "samples": 36, "cycles": 30, "periodicity": 1e-13, "length": 1e-6}
"""As many samples, cycles and points as in `test_assembly_cyclic`, and rings of five: one program serves all."""


RINGS = [(b, e, form) for b, e in ((6, 1), (6, 5), (4, 2), (5, 2), (7, 2), (5, 0)) for form in ("relative", "sides")]
QUICK = ((5, 2, "relative"),)


@pytest.mark.parametrize(
    "blades, order, form", [r if r in QUICK else pytest.param(*r, marks=pytest.mark.slow) for r in RINGS]
)
def test_a_sector_stands_for_the_whole_ring(blades: int, order: int, form: str) -> None:
    """1e-9 of the amplitude in every harmonic of every blade, work N times, with slip and lift-off; the number of
    samples (36) need not fit the number of blades, because every contact is marched from its own phase of the wave."""
    one, Omega = sector(blades, order), 2 * np.pi * 60.0
    lone, ring = balance.of(one, **FINE), balance.of(one.unrolled(), form=form, **FINE)
    a, b = solve(lone, Omega, []), solve(ring, Omega, [])
    assert a.converged and b.converged
    x, y = response.operating(lone, a), response.operating(ring, b)
    h = np.arange(4)
    turned = x.outputs[0] * np.exp(2j * np.pi * h * order * np.arange(blades)[:, None] / blades)
    np.testing.assert_allclose(y.outputs, turned, rtol=0, atol=1e-9 * np.abs(turned).max())
    assert y.supplied == pytest.approx(blades * x.supplied, rel=1e-9)
    share = x.cycles["shroud"].slipping.mean()
    assert 0 < share < 1 or 2 * order == blades or order == 0  # the push does not slide there


@pytest.mark.parametrize("form", ["relative", "sides"])
def test_jacobian_against_differences(form: str) -> None:
    """Central differences at a random state of a ring of five in both forms: 1e-6."""
    ring = balance.of(sector(5, 2).unrolled(), form=form, **{**FINE, "harmonics": 1})
    rng, Omega, h = np.random.default_rng(3), 2 * np.pi * 60.0, 1e-6
    x, d = 0.5 * rng.normal(size=ring.size), rng.normal(size=ring.size)
    _, J, R_Omega = ring.evaluate(x, Omega)
    along = (ring.evaluate(x + h * d, Omega)[0] - ring.evaluate(x - h * d, Omega)[0]) / (2 * h)
    np.testing.assert_allclose(J @ d, along, rtol=0, atol=1e-6 * np.abs(along).max())
    h = 1e-4
    along = (ring.evaluate(x, Omega + h)[0] - ring.evaluate(x, Omega - h)[0]) / (2 * h)
    np.testing.assert_allclose(R_Omega, along, rtol=0, atol=1e-5 * np.abs(along).max())


def test_both_forms_are_the_same_equations() -> None:
    """A chain of three between two walls: relative motions or both sides as unknowns, 1e-9."""
    ring = sector(3, 1, normal=50.0, push=2.0).unrolled()
    between = ring.contacts[:2]
    patch, rough = between[0].patch, Coulomb(value(0.3))  # as many points as between the blades: one program
    rubs = replace(patch, law=replace(patch.law, friction=rough))
    ends = ContactFace("blade_0", "left"), ContactFace("blade_2", "right")
    walls = [preloaded_contact(f"wall_{i}", rubs, end, None, normal=30.0) for i, end in enumerate(ends)]
    chain = Assembly(ring.components, (*between, *walls), ring.loads, ring.outputs)
    found = []
    for form in ("relative", "sides"):
        problem = balance.of(chain, form=form, **FINE)
        point = solve(problem, 2 * np.pi * 60.0, [])
        assert point.converged
        found.append(response.operating(problem, point))
    scale = np.abs(found[0].outputs).max()
    np.testing.assert_allclose(found[1].outputs, found[0].outputs, rtol=0, atol=1e-9 * scale)
    for name, force in found[0].force.items():
        np.testing.assert_allclose(found[1].force[name], force, rtol=0, atol=1e-8 * np.abs(force).max())


def test_turned_frames_move_the_place_and_the_axes() -> None:
    """Rigid motion of the second body, its rows read at another origin and in other axes: that of the first frame."""
    rng = np.random.default_rng(1)
    first, second = (np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
    move, turn, away = rng.normal(size=(3, 3))
    rows = np.concatenate([second @ move, second @ turn])
    place = move + np.cross(turn, away)  # of the first frame's origin, `away` from the second's
    np.testing.assert_allclose(
        across(first, second, away) @ rows, np.concatenate([first @ place, first @ turn]), rtol=0, atol=1e-12
    )


def test_linear_limit_is_modal_superposition() -> None:
    """Pressed so hard that nothing slides or opens, the sector's answer is that of the sticking stiffness: 1e-10."""
    one, Omega = sector(6, 2, normal=1e5, push=1.0), 2 * np.pi * 70.0
    problem = balance.of(one, **FINE)
    point = newton(problem.at(Omega), np.zeros(problem.size))
    part, k = problem.parts[1][0], problem.stiffness[0]
    A = part.K - Omega**2 * part.M + 1j * Omega * part.C + part.rows.conj().T @ k @ part.rows
    direct = part.output @ np.linalg.solve(A, part.load)
    np.testing.assert_allclose(response.operating(problem, point).outputs[0, 1], direct[0], rtol=1e-10)


def test_interference_finds_the_force_that_a_given_normal_force_has() -> None:
    """Pressed together by what the preload makes: the same response from a given approach as from a given force."""
    one, Omega = sector(6, 2, push=2.0), 2 * np.pi * 60.0
    given = one.contacts[0]
    wall = preloaded_contact("shroud", given.patch, ContactFace("blade", "right"), None, normal=20.0)
    by_force = Assembly(one.components, (wall,), one.loads, one.outputs)
    # the steady load that holds the blade against the wall where the contact is pressed by 20 N
    near = preloaded_contact(
        "shroud", given.patch, ContactFace("blade", "right"), None, interference=float(wall.offset[0])
    )
    loads = (*one.loads, Load("blade", "hold", 1.0, harmonic=0))
    group = one.components[0].groups[0]
    rows = group.interfaces["right"].rows[0][None] * 20.0
    held = replace(
        group, excitations={**group.excitations, "hold": replace(group.excitations["gas"], rows=rows, labels=("hold",))}
    )
    by_balance = Assembly((Component("blade", {0: held}),), (near,), loads, one.outputs)
    found = []
    for each in (by_force, by_balance):
        problem = balance.of(each, **FINE)
        point = solve(problem, Omega, [])
        assert point.converged
        found.append(response.operating(problem, point))
    np.testing.assert_allclose(found[1].outputs, found[0].outputs, rtol=0, atol=1e-9 * np.abs(found[0].outputs).max())


@pytest.mark.slow
@pytest.mark.parametrize("form", ["relative", "sides"])
def test_read_outs_come_in_the_order_they_are_listed_in(form: str) -> None:
    """Every order of two bodies and of three read-outs, two of them of one body: each row is the read-out's own, and
    so is the one that peaks are followed by (1e-9)."""
    ring = sector(2, 1).unrolled()
    kinds = (Output("blade_0", "tip", "u_x"), Output("blade_1", "tip", "u_y"), Output("blade_0", "tip", "u_y"))
    loads = (ring.loads[0],)  # on the first blade only, so that the two move differently
    Omega, right = 2 * np.pi * 60.0, None
    for components in permutations(ring.components):
        for outputs in permutations(kinds):
            p = balance.of(Assembly(components, ring.contacts, loads, outputs), form=form, **(FINE | {"harmonics": 1}))
            point = newton(p.at(Omega), p.at(Omega).reference)
            assert point.converged
            rows = response.operating(p, point).outputs[:, 1]
            found, at = dict(zip(outputs, rows, strict=True)), p.at(Omega)
            right = right or found
            for i, w in enumerate(outputs):
                assert found[w] == pytest.approx(right[w], rel=1e-9)
                assert amplitude(at, point.x, *at.forces(point.x), output=i).value == pytest.approx(right[w], rel=1e-9)
    assert len({f"{abs(y):.3e}" for y in right.values()}) == 3


def rubbing(phase: float, push: float, friction: float, points: tuple[int, int] = (3, 2)) -> Assembly:
    """A blade that rubs on the ground, all its loads turned by a phase."""
    places, areas = grid(0.02, 0.01, points)
    n = len(areas)
    law = PointContact(Penalty(value(2e6 / n)), Coulomb(value(friction)), value(1e6 / n))
    wall = preloaded_contact(
        "wall", Patch("right", places, areas, law), ContactFace("blade", "right"), None, normal=20.0
    )
    one = sector(4, 0)
    return Assembly(one.components, (wall,), (Load("blade", "gas", push * np.exp(1j * phase)),), one.outputs)


@pytest.mark.parametrize(
    ("push", "friction", "state"),
    [pytest.param(0.3, 0.05, "partial slip", marks=pytest.mark.slow), (0.2, 0.05, "stuck")],
)
def test_the_phase_of_all_loads_turns_the_answer_and_nothing_else(push: float, friction: float, state: str) -> None:
    """By 5 of 40 samples: 1e-10. Points that slip forget where their marching began, and those that
    never slipped remember nothing else than the preloaded place. A state that sticks loses nothing,
    and not what rounding leaves."""
    found = []
    for phase in (0.0, np.pi / 4):
        points = (3, 2) if state == "stuck" else (4, 3)  # of which some slip
        p = balance.of(rubbing(phase, push, friction, points), **{**FINE, "samples": 40})
        o = response.operating(p, solve(p, 2 * np.pi * 60.0, []))
        found.append((o.outputs[0, 1] * np.exp(-1j * phase), float(o.cycles["wall"].dissipated.sum())))
    assert found[1][0] == pytest.approx(found[0][0], rel=1e-10)
    share = o.cycles["wall"].slipping.mean()
    if state == "stuck":
        assert share == 0 and found[0][1] == found[1][1] == 0.0
    else:
        assert 0 < share < 0.5 and found[1][1] == pytest.approx(found[0][1], rel=1e-9) and found[0][1] > 1e-8

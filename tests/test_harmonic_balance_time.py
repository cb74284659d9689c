"""Harmonic balance against time integration of the same assembly: four systems, and where their energy goes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from closed_forms.beams import beam_element
from integrator import Start, Steady, extrapolated, steady

from microslip.contact.friction import Coulomb
from microslip.contact.law import Law, settings, value
from microslip.contact.normal import Penalty, Preload
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.data import Compliance, Interface, ModalGroup, Rows
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance import response
from microslip.harmonic_balance.response import Operating
from microslip.harmonic_balance.solver import solve
from microslip.series import fourier
from microslip.system import Body, Force, Monitor, Spring, System
from microslip.system import Contact as Face
from microslip.system.assembly import Assembly, Contact, ContactFace, Load, Output, across, preloaded_contact
from microslip.system.component import Component, Ring

Array = np.ndarray


# systems -----------------------------------------------------------------------------------------------------------


@settings
class Cubic(Law):
    """A spring along t1 whose force is k u^3."""

    stiffness: Any

    def init(self, n: int) -> Any:
        return jnp.zeros((2, n))

    def step(self, u: Any, v: Any, dt: Any, state: Any) -> Any:
        return u**3 * jnp.asarray([0.0, 1.0, 0.0]) * self.stiffness, state

    def slip(self, state: Any) -> Any:
        return state.T


def body(rows: Array, omega: Array, ratio: float = 0.0) -> ModalGroup:
    """Modes whose six rows at the interface ``face`` are given."""
    m = len(omega)
    face = Interface(
        np.zeros(3), np.eye(3), rows, np.zeros(m), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, m))
    )
    return ModalGroup(
        speed=0.0, omega=omega, kind=("normal",) * m, damping_ratio=np.full(m, ratio), M_r=np.eye(m),
        K_r=np.diag(omega**2), C_r=np.diag(2 * ratio * omega), G_r=np.zeros((m, m)), phi=np.zeros((0, 3, m)),
        interfaces={"face": face}, excitations={}, monitors={}, gauges={},
        compliance=Compliance((), np.zeros((0, 0)), np.zeros((0, 0)), False), stresses={}, u_static=np.zeros((0, 3)),
        checks={},
    )  # fmt: skip


def group(omega: Array, rows: dict[str, Array], ratio: float) -> ModalGroup:
    """Modes with an interface ``face`` of six rows, an excitation ``push`` and a monitor ``tip`` of one row each."""
    push, tip = (Rows(rows[n][None], (u,), "m", np.zeros(3)) for n, u in (("push", "push"), ("tip", "u")))
    return replace(body(rows["face"], omega, ratio), excitations={"push": push}, monitors={"tip": tip})


def held(body: ModalGroup, law: Law, directions: list[int], preload: Array, offset: Array, force: float) -> Assembly:
    """A body on one point contact that moves in some of the directions n, t1, t2."""
    shape = np.eye(3)[None][:, :, directions]
    patch = Patch("face", np.zeros((1, 2)), np.ones(1), law, shape)
    side = ContactFace("body", "face", rows={0: body.interfaces["face"].rows[directions]})
    contact = Contact("face", patch, side, None, offset, preload)
    load, output = Load("body", "push", force), Output("body", "tip", "u")
    return Assembly((Component("body", {0: body}),), (contact,), (load,), (output,))


def duffing() -> Assembly:
    """q'' + 0.05 q' + q + 0.05 q^3 = 0.4 cos t."""
    one = np.ones(1)
    rows = {"face": np.outer([0, 1, 0, 0, 0, 0], one), "push": one, "tip": one}
    return held(group(one, rows, 0.025), Cubic(value(0.05)), [1], np.zeros(1), np.zeros(1), 0.4)


def bending(elements: int) -> tuple[Array, Array]:
    """Eigenvalues and modes of a clamped beam of length, stiffness and mass per length 1; (displacement, slope)."""
    h, n = 1.0 / elements, 2 * (elements + 1)
    K, M = np.zeros((n, n)), np.zeros((n, n))
    k, m = beam_element(h)
    for e in range(elements):
        at = slice(2 * e, 2 * e + 4)
        K[at, at] += k
        M[at, at] += m
    return scipy.linalg.eigh(K[2:, 2:], M[2:, 2:])


def cantilever() -> Assembly:
    """20 bending modes, damping 3 %; a spring of 20 that slides at 0.25 holds the tip, pushed with 0.3."""
    squares, shapes = bending(10)
    tip = shapes[-2]
    rows = {"face": np.outer([0, 1, 0, 0, 0, 0], tip), "push": tip, "tip": tip}
    law = PointContact(Preload(value(1.0)), Coulomb(value(0.25)), value(20.0))
    return held(group(np.sqrt(squares), rows, 0.03), law, [1], np.zeros(1), np.zeros(1), 0.3)


def slider(harmonics: int, samples: int, ratio: float = 0.02, force: float = 1.0) -> balance.Problem:
    """1 kg, 100 rad/s, a Jenkins element of 2e4 N/m that slides at 0.6 N, after 30 um."""
    one = np.ones(1)
    rows = {"face": np.outer([0, 1, 0, 0, 0, 0], one), "push": one, "tip": one}
    law = PointContact(Preload(value(2.0)), Coulomb(value(0.3)), value(2e4))
    rubs = held(group(np.array([100.0]), rows, ratio), law, [1], np.zeros(1), np.zeros(1), force)
    return balance.of(rubs, harmonics, samples, length=3e-5)


def beam_in_space() -> Assembly:
    """Two planes of bending, of another stiffness each, and one axial mode; the tip is pressed down with 1.

    The push in the middle has parts along all three directions: the normal force swings until the tip lifts off, and
    it slides on curved paths.
    """
    squares, shapes = bending(4)
    squares, shapes = squares[:4], shapes[:, :4]
    tip, middle = shapes[-2], shapes[2]
    omega = np.concatenate([np.sqrt(squares), 1.3 * np.sqrt(squares), [12.0]])
    n, t2, t1 = (np.zeros(9) for _ in range(3))
    n[:4], t2[4:8], t1[8] = tip, tip, 1.4
    push = np.concatenate([middle, 0.8 * middle, [0.7]])
    rows = {"face": np.vstack([n, t1, t2, np.zeros((3, 9))]), "push": push, "tip": n + t2}
    law = PointContact(Penalty(value(40.0)), Coulomb(value(0.3)), value(25.0))
    pressed = np.array([1.0, 0, 0])
    return held(group(omega, rows, 0.04), law, [0, 1, 2], pressed, pressed / 40.0, 3.0)


def ring_of_four() -> Assembly:
    """Four rigid tips that touch each other in a circle, driven by a wave that runs round it once a period."""
    tip = Body("tip", 1.0, (0, 0, 0), inertia=(1e-3, 2e-3, 3e-3))
    faces = [
        Face("right", "tip", (1, 0, 0), t2=(0, 0, 1), at=(0.02, 0, 0)),
        Face("left", "tip", (-1, 0, 0), t2=(0, 0, 1), at=(-0.02, 0, 0)),
    ]
    push = Force("gas", "tip", (1, 0.4, 0.2), at=(0, 0.01, 0.005))
    spring = Spring("ground", "tip", (1e5, 3e5, 9e5, 100.0, 200.0, 300.0))
    blade = System("blade", [tip], [spring], faces, [push], [Monitor("tip", "tip")], ratio=0.04).basis()
    places, areas = grid(0.02, 0.01, (2, 1))
    law = PointContact(Penalty(value(1e6)), Coulomb(value(0.2)), value(5e5))
    facing = across(np.diag([1.0, 1, 1]), np.diag([-1.0, -1, 1]))
    patch = Patch("right", places, areas, law)
    contact = preloaded_contact(
        "shroud", patch, ContactFace("blade", "right"), ContactFace("blade", "left", facing, 1), normal=20.0
    )
    component, load = Component("blade", {0: blade.groups[0, 0]}), Load("blade", "gas", 30.0)
    return Assembly((component,), (contact,), (load,), (Output("blade", "tip", "u_x"),), Ring(4, 1)).unrolled()


def balanced(assembly: Assembly, Omega: float, near: Steady | None = None, **fine: Any) -> Operating:
    """The solution near a motion in time, or that which Newton's method finds from the sticking contacts."""
    problem = balance.of(assembly, **fine)
    starts = [] if near is None else [unknowns(problem, near)]
    point = solve(problem, Omega, starts)
    assert point.converged
    return response.operating(problem, point)


def unknowns(problem: balance.Problem, motion: Steady) -> Array:
    """x of the harmonics of a motion in time, its relative motions as unknowns."""
    moved = [u - c.offset for u, c in zip(motion.relative, problem.assembly.contacts, strict=True)]
    a = motion.harmonics(np.hstack(moved), problem.harmonics)
    x = np.zeros((problem.coefficients, problem.count))
    x[0], x[1::2], x[2::2] = a[:, 0].real, a[:, 1:].real.T, -a[:, 1:].imag.T
    return (x / problem.scale).ravel()


def begun(assembly: Assembly, found: Operating, samples: int) -> Start:
    """The state at t = 0 of a solution of the balance."""
    q = [
        np.concatenate([component[h] for component in found.q.values()])
        for h in range(len(next(iter(found.q.values()))))
    ]
    speed = sum(1j * h * found.Omega * one for h, one in enumerate(q))
    values = np.asarray(fourier(len(q) - 1, samples)[0])
    paths = [np.einsum("sw,kw,nik->sni", np.roll(values, -1, axis=0), u, c.patch.kinematics)
             for c, u in zip(assembly.contacts, found.relative.values(), strict=True)]  # fmt: skip
    return Start(np.real(sum(q)), np.real(speed), paths)


def apart(found: Operating, motion: Array) -> float:
    """Largest difference of the harmonics of all read-outs, in parts of the largest one."""
    return float(np.abs(found.outputs[:, : motion.shape[1]] - motion).max() / np.abs(motion).max())


def orders(values: list[Array]) -> Array:
    """Observed orders of convergence of values found with steps h, h/2, h/4, ..."""
    gaps = [float(np.abs(b - a).max()) for a, b in zip(values, values[1:], strict=False)]
    return -np.diff(np.log2(gaps))


# the integrator itself ---------------------------------------------------------------------------------------------


def test_the_integrator_is_of_second_order() -> None:
    """Against the exact answer of the linear beam, which nothing but springs holds, and by itself where it slides."""
    stuck = cantilever()
    law = replace(stuck.contacts[0].patch.law, friction=Coulomb(value(1e3)))
    contact = replace(stuck.contacts[0], patch=replace(stuck.contacts[0].patch, law=law))
    linear, Omega = replace(stuck, contacts=(contact,)), 3.9
    part = linear.joined(1)
    K = part.K + 20.0 * part.rows.T @ part.rows
    exact = (part.output @ np.linalg.solve(K - Omega**2 * part.M + 1j * Omega * part.C, part.load))[0]
    stages = ((90, 64), (50, 128), (50, 256), (50, 512))
    found = [s.harmonics(s.outputs, 1)[0, 1] for s in steady(linear, Omega, stages)]
    errors = np.abs(np.array(found) - exact) / abs(exact)
    np.testing.assert_allclose(-np.diff(np.log2(errors)), 2.0, atol=0.03)
    assert abs(extrapolated(found[1:], (2, 4)) - exact) < 2e-6 * abs(exact)


# four systems ------------------------------------------------------------------------------------------------------


STAGES = {
    duffing: (1.0, ((60, 128), (30, 256), (30, 512), (30, 1024))),
    cantilever: (3.9, ((70, 256), (12, 1024), (12, 2048), (12, 4096), (12, 8192))),
    beam_in_space: (3.4, ((50, 256), (15, 512), (15, 1024), (12, 2048))),
    ring_of_four: (2 * np.pi * 60.0, ((60, 256), (8, 1024), (8, 2048), (8, 4096))),
}


@cache
def moving(make: Any) -> list[Steady]:
    """Motions of a system from rest, each with half the step of the one before."""
    Omega, stages = STAGES[make]
    return steady(make(), Omega, stages)[1:]


@cache
def solved(make: Any, harmonics: int, samples: int) -> Operating:
    """The balance of a system, near the motion that was found from rest."""
    length = {duffing: 1.0, cantilever: 0.01, beam_in_space: 0.05, ring_of_four: 1e-5}[make]
    return balanced(make(), STAGES[make][0], moving(make)[-1], harmonics=harmonics, samples=samples, length=length)


def watched(make: Any, count: int) -> list[Array]:
    return [m.harmonics(m.outputs, count) for m in moving(make)]


def test_duffing_oscillator() -> None:
    """One part in a million of the largest harmonic, with 15 harmonics and an extrapolated integration."""
    values = watched(duffing, 7)
    np.testing.assert_allclose(orders(values), 2.0, atol=0.1)
    assert apart(solved(duffing, 15, 64), extrapolated(values, (2, 4))) < 1e-6


@pytest.mark.slow
def test_beam_with_a_jenkins_element() -> None:
    """20 modes, slip to and fro: 5e-6 of the amplitude after extrapolation, 63 harmonics. The error falls with the
    number of harmonics by more than its third power: the force has kinks, the beam takes two powers more."""
    motion = extrapolated(watched(cantilever, 5), (2,))
    found = [solved(cantilever, H, 8192) for H in (15, 31, 63)]
    errors = [apart(one, motion) for one in found]
    assert found[-1].cycles["face"].slipping[0] > 0.5
    assert errors[-1] < 5e-6 and errors[0] > 8 * errors[1] > 64 * errors[2]


@pytest.mark.slow
def test_beam_with_a_contact_in_space_that_lifts_off_has_two_motions() -> None:
    """Two stable motions at one frequency: the integration finds one from rest and stays at the other one from the
    balance's solution. Either: 1e-4 in every harmonic, with steps of a length, since the laws follow a slider that
    turns to first order only. The two differ by a hundred times that."""
    rest, from_rest = moving(beam_in_space)[-1], solved(beam_in_space, 21, 2048)
    assert apart(from_rest, rest.harmonics(rest.outputs, 7)) < 1e-4
    other = balanced(beam_in_space(), 3.4, harmonics=21, samples=1024, length=0.05)
    motion = steady(beam_in_space(), 3.4, ((30, 1024),), begun(beam_in_space(), other, 1024))[0]
    assert motion.change < 1e-8
    assert apart(other, motion.harmonics(motion.outputs, 7)) < 1e-4
    assert apart(other, rest.harmonics(rest.outputs, 7)) > 1e-2
    for one in (from_rest, other):
        assert one.cycles["face"].open[0] > 0.03 and one.cycles["face"].slipping[0] > 0.5


@pytest.mark.slow
def test_ring_of_four_in_a_wave() -> None:
    """Four blades, eight points that slide and open: 1e-4 in every harmonic of every blade, with steps of a length."""
    found, motion = solved(ring_of_four, 15, 2048), moving(ring_of_four)[-1]
    shares = [c for one in found.cycles.values() for c in (one.slipping.mean(), one.open.mean())]
    assert min(shares) > 0.2 and motion.change < 1e-4
    assert apart(found, motion.harmonics(motion.outputs, 5)) < 1e-4


# energy ------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "fine", "tolerance"),
    [
        (cantilever, (63, 8192), 1e-6),
        (beam_in_space, (21, 2048), 2e-4),
        pytest.param(ring_of_four, (15, 2048), 2e-4, marks=pytest.mark.slow),
    ],
)
def test_work_of_the_loads_is_the_friction_along_the_slip_path(make: Any, fine: Any, tolerance: float) -> None:
    """What loads supply less what damping takes, of truncated harmonics, against friction force times path slid, step
    by step in time, which converges with the step on its own: a slider on a line with the second power. Where points
    open and close within steps it does so unevenly, and the last halving has to leave less than the comparison asks."""
    slid = [sum(m.slip_work) for m in moving(make)]
    gaps = np.abs(np.diff(slid))
    if make is cantilever:
        assert (gaps[1:] < gaps[:-1] / 4).all()
    else:
        assert gaps[-1] < 0.2 * tolerance * slid[-1]
    found = solved(make, *fine)
    lost, by_slip = found.supplied - found.damped, sum(float(c.by_slip.sum()) for c in found.cycles.values())
    assert lost == pytest.approx(slid[-1], rel=tolerance)
    assert by_slip == pytest.approx(lost, rel=0.1 * tolerance)

"""Jenkins elements in the balance of an assembly: closed form of one harmonic, energy, tangents, what is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from closed_forms.one_harmonic import JenkinsContact, frequency_response
from refusals import refused
from test_contact_laws import FORCES, TANGENT, counted, path, work

from microslip.contact.jenkins import Jenkins, four_places
from microslip.contact.law import Example, march, value
from microslip.contact.patch import Patch, stuck_stiffness
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.response import harmonic_response
from microslip.programs import program
from microslip.system import Body, Contact, Force, Monitor, Spring, System
from microslip.system.assembly import Assembly, ContactFace, Load, Output, preloaded_contact
from microslip.system.component import Component

SPRINGS, SIZE = (3e6, 2e6, 5e6), (0.08, 0.03)
LAW = Example(Jenkins(value(3e6), value(2e6), value(5e6), value(4.0), 2), 1e-5, 1e-5)


def four(held: float, slider: int) -> Patch:
    n, along, across = (value(SPRINGS[i]) for i in (0, slider, 3 - slider))
    return Patch("rub", *four_places(*SIZE), Jenkins(n, along, across, value(held), slider).scaled(value(0.25)))


@pytest.mark.parametrize("slider", [1, 2])
def test_six_springs_are_those_of_an_even_patch(slider: int) -> None:
    """c_n, c_1, c_2, c_2 b^2/12 + c_1 h^2/12, c_n h^2/12, c_n b^2/12 (Sextro Eqs. (5.2-39) to (5.2-41))."""
    (n, t1, t2), (b2, h2) = SPRINGS, np.square(SIZE) / 12
    patch = four(3.0, slider)
    six = np.diag([n, t1, t2, t2 * b2 + t1 * h2, n * h2, n * b2])
    np.testing.assert_allclose(stuck_stiffness(patch, np.zeros(6)), six, rtol=1e-12, atol=1e-6)


@pytest.mark.parametrize("slider", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_one_harmonic_is_the_closed_form(slider: int) -> None:
    """A block pushed along the sliders, so that they slide as one; the error falls with the square of the samples."""
    springs = [Spring("ground", "block", (4e5, 3e5, 2e5))]
    push = (0.0, 1.0, 0.0) if slider == 1 else (1.0, 0.0, 0.0)  # t1 is y and t2 is x
    system = System(
        "block", [Body("block", 1.0, inertia=(2e-3, 1e-3, 3e-3))], springs,
        [Contact("rub", "block", (0, 0, -1), t2=(1, 0, 0))], [Force("push", "block", push)],
        [Monitor("tip", "block")], ratio=0.01,
    )  # fmt: skip
    group = system.basis().groups[0, 0]
    along = group.interfaces["rub"].rows[slider]
    assert abs(abs(along @ group.excitations["push"].rows[0]) - 1.0) < 1e-9
    read, f = group.monitors["tip"].rows[1 if slider == 1 else 0], np.linspace(200.0, 420.0, 23)
    k, held = SPRINGS[slider], 0.4
    six = np.diag(stuck_stiffness(four(held, slider), np.zeros(6)))
    closed = frequency_response(
        group, [JenkinsContact("rub", six, slider, k, held)], group.excitations["push"].rows[0], read, f
    )
    assert closed.converged.all() and (np.abs(closed.contact[:, slider]) > 2 * held / k).any()
    errors = []
    for samples in (64, 256):
        contact = preloaded_contact("rub", four(held, slider), ContactFace("block", "rub"), None, normal=2.0)
        loads, outputs = (Load("block", "push"),), (Output("block", "tip", "u_y" if slider == 1 else "u_x"),)
        problem = balance.of(Assembly((Component("block", {0: group}),), (contact,), loads, outputs), 1, samples)
        found = harmonic_response(problem, f)
        assert found.converged.all()
        errors.append(np.abs(found.monitor - closed.monitor).max() / np.abs(closed.monitor).max())
    assert errors[1] < 3e-4 and errors[0] > 8 * errors[1]


def test_a_cycle_takes_what_the_law_counts_and_gives_nothing_back() -> None:
    u = path(3, LAW, samples=1024)
    force, lost = counted(LAW.law, u, LAW.period / 1024)
    taken, size = work(np.asarray(force), np.asarray(u))
    assert (np.asarray(lost) > 0.01 * size).all()
    np.testing.assert_allclose(taken, lost, rtol=0, atol=1e-4 * size.max())


def test_the_slip_is_what_the_spring_with_the_slider_does_not_take() -> None:
    u = path(1, LAW, points=1, samples=32)
    force, state = program(march)(LAW.law, u, 1e-4, LAW.law.init(1))
    slid = np.asarray(u)[-1, 0, 2] - np.asarray(force)[-1, 0, 2] / 2e6
    assert abs(slid) > 1e-7
    np.testing.assert_allclose(LAW.law.slip(state), [[0.0, slid]], rtol=1e-9)


def test_it_does_not_open_and_holds_its_limit() -> None:
    u = path(5, LAW) - jnp.array([3e-5, 0.0, 0.0])
    force = np.asarray(FORCES(LAW.law, u, LAW.period, 2)[0])
    np.testing.assert_allclose(force[..., 0], 3e6 * np.asarray(u)[..., 0], rtol=1e-12)
    np.testing.assert_allclose(force[..., 1], 5e6 * np.asarray(u)[..., 1], rtol=1e-12)
    assert force[..., 0].min() < 0 and np.abs(force[..., 2]).max() == 4.0


def test_tangents_are_differences() -> None:
    u, direction = (path(seed, LAW, points=1, samples=32) for seed in (1, 2))
    tangent = np.asarray(TANGENT(LAW.law, u, 1e-4, direction)[1])
    run = jax.jit(lambda x: march(LAW.law, x, 1e-4, LAW.law.init(1))[0])
    fine = np.asarray(run(u + 1e-6 * direction) - run(u - 1e-6 * direction)) / 2e-6
    assert np.abs(tangent - fine).max() < 1e-6 * np.abs(tangent).max()


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
def test_nonsense_is_refused(bad: float) -> None:
    refused("Jenkins.held", four, bad, 1)

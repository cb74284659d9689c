"""Bodies that nothing but their contacts hold, pressed by steady loads: what presses them, and their modes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from refusals import refused

import microslip as ms
from microslip.case.problem import forces_of, pressed_by, problem_of
from microslip.errors import NotConverged, UserError
from microslip.harmonic_balance import nonlinear_modes
from microslip.harmonic_balance import problem as balance
from microslip.system import Body, Contact, Force, Monitor, Spring, System
from microslip.verbs.backbone import counted_from_1

HELD, NORMAL, TANGENTIAL = 1e5, 3e6, 1e6


def pressed(force: float, **contact: Any) -> Any:
    """A mass of 1 kg on springs, and one of 0.5 kg that a steady force presses against it."""
    springs = [Spring("ground", "a", (HELD, 1.5 * HELD, HELD))]
    face = Contact("face", "a", (1, 0, 0), t2=(0, 0, 1))
    push = [Force("push", "a", (0, 1, 0))]
    held = System("held", [Body("a", 1.0, free="x y")], springs, [face], push, [Monitor("a", "a")], ratio=0.01)
    back, press = Contact("face", "b", (-1, 0, 0), t2=(0, 0, -1)), Force("press", "b", (-1, 0, 0))
    loose = System("loose", [Body("b", 0.5, free="x y")], [], [back], [press], [Monitor("b", "b")])
    law = {"normal_stiffness": NORMAL, "tangential_stiffness": TANGENTIAL, "includes": "surface", "friction": 0.3}
    patch = {"width": 0.01, "height": 0.01, "points": [2, 2]}
    case = {
        "monitor": "held:a", "direction": "x", "harmonics": 1, "samples": 24,
        "bodies": [{"name": "held"}, {"name": "loose"}],
        "excitations": [{"row": "held:push", "amplitude": 1.0},
                        {"row": "loose:press", "amplitude": force, "harmonic": 0}],
        "contacts": [{"interface": "held:face", "against": "loose:face", "interference": 0.0,
                      **law, **patch, **contact}],
    }  # fmt: skip
    return ms.assemble(case, held=held.basis(), loose=loose.basis())


@pytest.mark.parametrize("interference", [0.0, 1e-4, -1e-4])
@pytest.mark.parametrize("force", [100.0, 36747.0])
def test_what_presses_a_free_body_balances_its_load(force: float, interference: float) -> None:
    """Whether it touches before it is loaded, or stands 0.1 mm away; without a state of rest there is no number."""
    built = pressed(force, interference=interference)
    problem = problem_of(built, None, form="relative")
    assert pressed_by(built, problem) == pytest.approx(force, rel=1e-9)


def test_a_body_that_is_pulled_away_has_no_state_of_rest() -> None:
    built = pressed(-100.0)
    with pytest.raises(NotConverged, match="no state of rest under the steady loads"):
        pressed_by(built, problem_of(built, None, form="relative"))


def test_the_modes_of_a_nonlinear_mode_are_those_at_rest_under_the_steady_loads() -> None:
    """Along x the masses 1 and 0.5 kg on springs 1e5 and, between them, 3e6 N/m; without the load the second one is
    free. In small motions the contact stays closed, so the curve begins there."""
    built = pressed(100.0)
    K, M = np.array([[HELD + NORMAL, -NORMAL], [-NORMAL, NORMAL]]), np.diag([1.0, 0.5])
    exact = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real.min())
    problem, _ = nonlinear_modes.about_rest(problem_of(built, None, form="relative"))
    omega = nonlinear_modes.stuck_modes(problem)[0]
    mode = int(np.abs(omega - exact).argmin())
    assert omega[mode] == pytest.approx(exact, rel=1e-9)
    curve = ms.backbone(built, 1e-7, 1e-6, mode=mode)
    np.testing.assert_allclose(curve.Omega, exact, rtol=1e-6)


def test_modes_that_do_not_bend_are_refused() -> None:
    """A motion that nothing holds, and one that the contact does not feel."""
    free = ms.structure(np.eye(2), [[1.0, -1.0], [-1.0, 1.0]], force={0: 1.0}, elements=[ms.jenkins(1.0, 1.0, 0, 1)])
    apart = ms.structure(np.eye(2), np.diag([1.0, 4.0]), output=1, elements=[ms.jenkins(1.0, 1.0, 0)])
    problem = balance.of(free, harmonics=1, form="relative")
    with pytest.raises(UserError, match=r"^mode: 1: is a rigid motion.*the first is --mode 2, 0\.31"):
        counted_from_1(problem, 1)
    assert counted_from_1(problem, 2) == 1
    for system, mode in ((free, 0), (apart, 1)):
        assert refused((), ms.backbone, system, 1e-3, 1.0, mode=mode).startswith("mode: ")


def test_forces_of_a_sweep_that_press_no_contact_are_said_to_and_give_one_answer() -> None:
    """Three equal responses were called those of 20, 100 and 1000 N."""
    rub = {"law": "smooth", "normal_stiffness": 2e5, "tangential_stiffness": 4e5, "friction": 0.2, "points": [1, 1]}
    case = {"body": "vane", "excitation": "magnet", "amplitude": 1.0, "monitor": "probe", "modes": 1,
            "sweep": {"start": 300.0, "stop": 400.0, "points": 3, "normal_forces": [20.0, 100.0, 1000.0]},
            "contacts": [{"interface": "right", "interference": 1e-4, **rub}]}  # fmt: skip
    built = ms.assemble(case, vane=ms.sample())
    assert forces_of(built) == [None]
    assert any("presses nothing" in words for words in built.messages)

"""Free bodies of a case: soft springs that say where a body stays which slides in all of its contacts; gauges read."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from refusals import refused

import microslip as ms
from microslip.case.weak_springs import on_weak_springs, raising
from microslip.system import Body, Contact, Force, Monitor, Spring, System


def pair(grounded: bool) -> System:
    """Two masses on a spring, free or one of them on the ground."""
    a = Body("a", 2.0, (0, 0, 0), inertia=(1e-3, 2e-3, 3e-3))
    b = Body("b", 1.0, (0.1, 0, 0), inertia=(1e-3, 1e-3, 1e-3))
    springs = [Spring("a", "b", (1e6, 2e6, 3e6, 1e3, 2e3, 3e3))]
    if grounded:
        springs.append(Spring("ground", "a", (1e5, 1e5, 1e5, 100.0, 100.0, 100.0)))
    face = Contact("face", "b", (1, 0, 0), t2=(0, 0, 1), at=(0.12, 0, 0))
    return System("pair", [a, b], springs, [face], [Force("push", "a", (1, 0, 0))], [Monitor("b", "b")])


def test_hold_gives_every_rigid_motion_one_frequency_and_leaves_the_elastic_ones() -> None:
    """Eigenvalues of K and M: six of (2 pi f)^2, the others as before to rounding."""
    group = pair(False).basis().groups[0, 0]
    after = on_weak_springs(group, 3.0)
    omega = np.sqrt(np.abs(scipy.linalg.eigh(after.K_r, after.M_r, eigvals_only=True)))
    np.testing.assert_allclose(omega[:6], 2 * np.pi * 3.0, rtol=1e-9)
    np.testing.assert_allclose(omega[6:], group.omega[6:], rtol=1e-9)


def test_what_is_held_already_is_not_held_again() -> None:
    pin = pair(True).basis().groups[0, 0]
    refused("the body is held already; weak_springs are", on_weak_springs, pin, 3.0)


def test_springs_that_are_not_weak_are_told() -> None:
    """A mass on another one, which a spring k holds, in a stiff contact: k + m (2 pi f)^2 over both masses."""
    k, f = 1e5, 10.0
    ground = Spring("ground", "a", (k, k, k))
    face, back = Contact("face", "a", (1, 0, 0), t2=(0, 0, 1)), Contact("face", "b", (-1, 0, 0), t2=(0, 0, -1))
    held = System("held", [Body("a", 1.0, free="x")], [ground], [face], [Force("push", "a", (1, 0, 0))], [])
    loose = System("loose", [Body("b", 1.0, free="x")], [], [back], [], [Monitor("b", "b")])
    case = {
        "name": "two", "excitation": "held:push", "amplitude": 1.0, "monitor": "loose:b", "direction": "x",
        "bodies": [{"name": "held"}, {"name": "loose", "weak_springs": f}],
        "contacts": [{"interface": "held:face", "against": "loose:face", "normal_stiffness": 1e10,
                      "tangential_stiffness": 1e10, "friction": 0.3, "width": 0.01, "height": 0.01}],
        "sweep": {"start": 20.0, "stop": 60.0, "points": 9, "normal_forces": [100.0]},
    }  # fmt: skip
    built = ms.assemble(case, held=held.basis(), loose=loose.basis())
    own = (2 * np.pi * f) ** 2
    share = 100 * 0.5 * own / (k + own)
    [said] = raising(built, 100.0)
    assert (
        f"weak springs of loose raise the mode with sticking contacts at {np.sqrt((k + own) / 2) / 2 / np.pi:.5g}"
        in said
    )
    assert f"by about {share:.2g} %" in said
    softer = {**case, "bodies": [{"name": "held"}, {"name": "loose", "weak_springs": f / 2}]}
    assert not raising(ms.assemble(softer, held=held.basis(), loose=loose.basis()), 100.0)

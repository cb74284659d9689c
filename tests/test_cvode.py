"""The stepper against an integrator that chooses its own steps (`cvode`), and both against exact solutions."""

from __future__ import annotations

from dataclasses import replace

import cvode
import numpy as np
import pytest
from closed_forms.impacts import dry_turns, restitution
from test_time_domain import BOOK, MASS, hitting, patch

import microslip as ms
from microslip.contact.friction import Coulomb
from microslip.contact.heights import Polynomial
from microslip.contact.law import Law, value
from microslip.contact.normal import Penalty, Rough
from microslip.contact.patch import Patch
from microslip.contact.regularised import MassContact
from microslip.system.assembly import Assembly
from microslip.time_domain import equations, orbit
from microslip.time_domain.equations import MotionEquations
from microslip.time_domain.stepper import Stepper

pytest.importorskip("sksundae")

BOOK_44 = MassContact(
    Rough(value(0.3e6), value(5.2e-6), Polynomial()), Coulomb(value(0.3)), value(1e5), None, value(1e-4), value(2e-4),
    value(1e4),
)  # fmt: skip


def rubbing(law: Law) -> MotionEquations:
    """The mass of section 4.2, pressed, and rubbed in two directions until it slides and lifts off."""
    touching = Patch("stop", np.zeros((1, 2)), np.ones(1), law)
    return equations.of(hitting(touching, normal=0.5, push=1.5), 300.0)


def chain() -> Assembly:
    K = np.array([[2.0, -1.0], [-1.0, 2.0]])
    elements = [ms.jenkins(1.0, 0.2), ms.stop(5.0, 0.3, at=1)]
    return ms.structure(np.eye(2), K, damping_ratio=0.02, force={0: 0.5}, elements=elements)


SLIDER = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.2)])
RUBS = patch(Penalty(value(2e5)), mu=0.3, stiffness=1e5).law
RUBS_ROUGH = patch(Rough(value(2e5), value(5e-6), Polynomial()), damping=1e-4, mu=0.3, stiffness=1e5).law

SYSTEMS = {
    "impact oscillator of section 4.2": (lambda: equations.of(hitting(BOOK), 64.32), 1024, 2e-6),
    "slider": (lambda: equations.of(SLIDER, 0.8), 4096, 5e-7),
    "two masses, slider and stop": (lambda: equations.of(chain(), 1.1), 4096, 1e-6),
    "rubs in three dimensions": (lambda: rubbing(RUBS), 8192, 6e-6),
    "rubs and is damped": (lambda: rubbing(RUBS_ROUGH), 1024, 5e-8),
    "element with a mass": (lambda: rubbing(BOOK_44), 32768, 4e-5),
}


SLOW = ("rubs and is damped", "element with a mass")


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in SYSTEMS])
def test_the_stepper_comes_to_what_the_reference_says(name: str) -> None:
    """With the order of its laws: with half the steps it is further away."""
    made, steps, most = SYSTEMS[name]
    e = made()
    exact = cvode.run(e, 4, 64)
    size, found = np.abs(exact.y).max(), [orbit.run(e, 0, 4, 64, n, "rest") for n in (steps // 4, steps)]
    errors = [np.abs(one.y - exact.y).max() / size for one in found]
    assert errors[1] < most and errors[1] < 0.5 * errors[0]
    np.testing.assert_allclose(found[1].v, exact.v, atol=30 * most * np.abs(exact.v).max())
    for kind in ("closes", "opens"):
        times = [one.events[(one.events[:, 2] == orbit.KINDS.index(kind)) & (one.events[:, 0] > 0), 0]
                 for one in (exact, found[1])]  # fmt: skip
        np.testing.assert_allclose(*times, atol=1e-4 * exact.period)
    assert exact.balance < 1e-5


def test_bodies_alone_move_exactly() -> None:
    """x'' + x = cos t from rest is t sin(t) / 2, and a body that nothing holds goes as (1 - cos t)."""
    alone = ms.structure(np.eye(2), np.diag([1.0, 0.0]), force={0: 1.0, 1: 1.0}, output=[0, 1])
    found = cvode.run(equations.of(alone, 1.0), 6, 256, settle=3, tolerance=1e-11)
    t = found.time
    np.testing.assert_allclose(found.y, [0.5 * t * np.sin(t), 1 - np.cos(t)], atol=1e-6)
    assert found.balance < 1e-6 and t[0] == pytest.approx(2 * np.pi * (3 + 1 / 256))


@pytest.mark.parametrize("ratio", [0.3, *(pytest.param(r, marks=pytest.mark.slow) for r in (0.05, 0.7))])
def test_a_viscous_contact_throws_back_what_its_closed_form_says(ratio: float) -> None:
    """By the reference to its tolerance, by the stepper of first order: the damper begins with a jump."""
    k, speed = 3e5, 0.1
    w = np.sqrt(k / MASS)
    e = equations.of(replace(hitting(patch(Penalty(value(k)), damping=2 * ratio / w)), loads=()), 20.0)
    e = replace(e, omega2=np.zeros(3), C=np.zeros((3, 3)))
    along = e.D[0] / (e.D[0] @ e.D[0])
    q, v, end = -1e-4 * along, speed * along, 1e-3 + 2 * np.pi / w
    rates = cvode.Rates(e)
    found = cvode.solve(rates, rates.start(q, v), np.array([end]), 1e-10).y[-1]
    assert e.D[0] @ found[3:6] == pytest.approx(-speed * restitution(ratio), rel=1e-6)
    errors = []
    for steps in (2**14, 2**16):
        s = Stepper(e, end / steps)
        seen = s.run(s.start(q, v), np.full(64, steps // 64))[1]
        errors.append(abs(float(e.D[0] @ np.asarray(seen.q_dot)[-1]) / speed + restitution(ratio)))
    assert errors[1] < 2e-5 and errors[1] < 0.8 * errors[0]


@pytest.mark.parametrize("stiffness, most", [(1e3, 2e-3), (1e5, 2e-5)])
def test_dry_friction_takes_the_same_from_every_swing(stiffness: float, most: float) -> None:
    """Let go at 1, an oscillator of one second's scale with friction 0.07: each turn is 0.14 nearer, until it is held.
    The slider's own spring is what is left of the error: 1 / stiffness."""
    e = equations.of(ms.structure(1.0, 1.0, output=0, elements=[ms.jenkins(stiffness, 0.07)]), 1.0)
    turns, end = dry_turns(1.0, 0.14), 8 * np.pi
    times = np.pi * np.arange(1, len(turns))
    along = 1.0 / e.shapes[0, 0]
    rates = cvode.Rates(e)
    by_reference = cvode.solve(rates, rates.start(np.array([along]), np.zeros(1)), times, 1e-9).y[1:, 0] / along
    s = Stepper(e, np.pi / 2**15)
    by_steps = np.asarray(s.run(s.start(np.array([along]), np.zeros(1)), np.full(len(times), 2**15))[1].q)[:, 0] / along
    assert len(turns) == 8 and end > times[-1]
    for found in (by_reference, by_steps):
        np.testing.assert_allclose(found, turns[1:], atol=most)

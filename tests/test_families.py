"""Responses followed over frequency, load and normal force: folds, and what a problem made anew at a value says."""

from __future__ import annotations

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from test_assembly import sector
from test_harmonic_balance_time import cantilever, duffing, group, held

import microslip as ms
from microslip.contact.friction import Coulomb
from microslip.contact.law import Array, Law, Scalar, State, Step, value
from microslip.contact.law import settings as contact_law
from microslip.contact.normal import Penalty
from microslip.contact.point import PointContact
from microslip.continuation import Settings
from microslip.errors import UserError
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance import response
from microslip.harmonic_balance.families import OverNormal, followed, of_frequency, of_load, of_normal_force
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.solver import newton, solve

FINE = {"harmonics": 1, "samples": 36, "cycles": 30, "length": 1e-6}


def ring(normal: float = 20.0) -> Problem:
    return balance.of(sector(6, 2, normal=normal, push=4.0), **FINE)


def test_folds_over_the_frequency() -> None:
    """Both of a Duffing oscillator, from either end; between them three motions, which a sweep does not show."""
    problem = balance.of(duffing(), 7, 64, length=1.0)
    told: list[str] = []
    family = of_frequency(problem, 0.3 / (2 * np.pi), 2.5 / (2 * np.pi))
    up, down = followed(family, told.append), followed(family.turned)
    folds, back = ([p.lam for p in branch.of_kind("fold")] for branch in (up, down))
    np.testing.assert_allclose(folds, [1.462616, 1.156018], rtol=1e-6)
    np.testing.assert_allclose(back[::-1], folds, rtol=1e-7)
    assert np.count_nonzero(np.diff(np.sign(up.lam - 1.3))) == 3 and "Hz" in told[-1]
    at = response.of_points(problem, family.points(up)[::20])
    assert at.converged.all() and np.abs(at.frequency - up.lam[::20] / family.unit).max() < 1e-12


@pytest.mark.parametrize("gap", [0.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_contacts_that_nothing_presses_give_the_scale_by_their_gap_or_the_load(gap: float) -> None:
    """q'' + 0.02 q' + q = 0.1 cos t on a wall of stiffness 1: begun open or just touching, the curve reaches its end
    in some hundred points; touching, it peaks at 2 / (1 + 1 / sqrt 2), the frequency of the spring of two slopes."""
    one = np.ones(1)
    body = group(one, {"face": np.outer([1, 0, 0, 0, 0, 0], one), "push": one, "tip": one}, 0.01)
    wall = PointContact(Penalty(value(1.0)), Coulomb(value(0.3)), value(1.0))
    problem = balance.of(held(body, wall, [0], np.zeros(1), np.array([-gap]), 0.1), 5, 128)
    family = of_frequency(problem, 0.7 / (2 * np.pi), 1.7 / (2 * np.pi))
    found = followed(family)
    assert found.status.startswith("bound") and len(found.points) < 1000
    if not gap:
        tip = np.abs(response.of_points(problem, family.points(found)).monitor)
        assert found.lam[np.argmax(tip)] == pytest.approx(2 / (1 + 0.5**0.5), rel=2e-3)


def test_over_the_load() -> None:
    """A slider that sticks under little load: at the end of the curve the motion of a sweep under the whole load."""
    problem = balance.of(cantilever(), 5, 128, length=0.0125)
    family = of_load(problem, 3.9 / (2 * np.pi), 0.05, 1.0)
    found = followed(family)
    first, *_, last = family.points(found)
    assert found.lam[-1] == 1.0 and found.status.startswith("bound")
    exact = solve(problem, 3.9, [])
    np.testing.assert_allclose(last.x, exact.x, rtol=0, atol=1e-8 * np.abs(exact.x).max())
    stuck = response.operating(family.problem(0.05), first)
    assert stuck.cycles["face"].slipping[0] == 0.0 < response.operating(problem, last).cycles["face"].slipping[0]


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.85, pytest.param(4.0, marks=pytest.mark.slow)])
def test_over_the_normal_force(factor: float) -> None:
    """From the force given to another one: there the motion of a problem that is pressed so from the beginning."""
    family = of_normal_force(ring(), 60.0, 1.0, factor)
    found = followed(family)
    last = family.points(found)[-1]
    assert found.lam[-1] == factor
    anew = ring(20.0 * factor)
    exact = newton(anew.at(2 * np.pi * 60.0), last.x)
    assert exact.converged
    np.testing.assert_allclose(last.x, exact.x, rtol=0, atol=1e-8 * np.abs(exact.x).max())
    a = response.operating(family.problem(factor), last).outputs
    np.testing.assert_allclose(a, response.operating(anew, exact).outputs, rtol=1e-7)


def test_derivatives_over_the_normal_force() -> None:
    family, rng = OverNormal(ring(), 2 * np.pi * 60.0, 10.0), np.random.default_rng(4)
    x, d, h = 0.5 * rng.normal(size=family.problem.size), rng.normal(size=family.problem.size), 1e-6
    _, J, by_force = family.evaluate(x, 1.3)
    along = (family.evaluate(x + h * d, 1.3)[0] - family.evaluate(x - h * d, 1.3)[0]) / (2 * h)
    np.testing.assert_allclose(J @ d, along, rtol=0, atol=1e-6 * np.abs(along).max())
    along = (family.evaluate(x, 1.3 + 1e-4)[0] - family.evaluate(x, 1.3 - 1e-4)[0]) / 2e-4
    np.testing.assert_allclose(by_force, along, rtol=0, atol=1e-4 * np.abs(along).max())


def test_the_normal_force_of_some_contacts() -> None:
    """Those that are not named keep theirs, whatever presses them; a force below zero counts as none."""
    problem = ring()
    kept = OverNormal(problem, 300.0, 10.0, contacts=frozenset()).at(3.0).groups[0]
    np.testing.assert_array_equal(kept.offset, problem.groups[0].offset)
    family = OverNormal(problem, 300.0, 10.0)
    assert family.at(3.0).groups[0].preload[0, 0] == 60.0 and family.at(-1.0).groups[0].preload[0, 0] == 0.0
    contacts = tuple(replace(c, preload=0.0 * c.preload) for c in problem.assembly.contacts)  # by interference
    held = replace(problem, assembly=replace(problem.assembly, contacts=contacts))
    np.testing.assert_array_equal(OverNormal(held, 300.0, 10.0).at(3.0).groups[0].offset, problem.groups[0].offset)


def test_a_curve_that_has_no_beginning_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from microslip.harmonic_balance import families

    failed = newton(ring().at(300.0), np.full(ring().size, np.nan))
    monkeypatch.setattr(families, "solve", lambda *_: failed)
    found = followed(of_frequency(ring(), 40.0, 80.0))
    assert found.points == () and found.status.startswith("no start")


@pytest.mark.parametrize("damping", [0.02, 2e-4])
def test_a_narrow_resonance_is_not_stepped_over(damping: float) -> None:
    """A linear oscillator but for a cubic spring of nothing: its peak F / (2 D sqrt(1 - D^2)), of which a curve in
    steps of a twentieth of the band had 64 % and less than 1 %."""
    system = ms.structure(1.0, 1.0, 2 * damping, force={0: 1e-4}, elements=[ms.polynomial({3: 1e-9})])
    curve = ms.follow(system, 0.5, 1.5, harmonics=1, unit="rad/s")
    assert curve.amplitude.max() == pytest.approx(1e-4 / (2 * damping), rel=1e-3)
    assert curve.converged.all() and len(curve.amplitude) < 50


def test_a_curve_that_ended_early_says_so() -> None:
    system = ms.structure(1.0, 1.0, 0.04, force={0: 1.0}, elements=[ms.jenkins(1e-3, 1e-6)])
    curve = ms.follow(system, 0.5, 1.5, harmonics=1, unit="rad/s", settings=Settings(points=5))
    assert repr(curve).endswith("; ended early: points: 5 are found; allow more to go on>")


def test_amplitudes_far_above_what_a_slider_yields_by_take_few_points() -> None:
    """A thousand times: the peak is what the force leaves that friction does not take, (F - 4 R / pi) / (c Omega)."""
    slides = ms.structure(1.0, 1.0, 0.02, force={0: 100.0}, elements=[ms.jenkins(1.0, 0.5)])
    curve = ms.follow(slides, 0.9, 1.1, harmonics=1, samples=64, unit="rad/s")
    assert curve.ended.startswith("bound") and len(curve) < 300
    assert curve.amplitude.max() == pytest.approx((100.0 - 4 * 0.5 / np.pi) / 0.02, rel=2e-4)


def test_peaks_of_a_curve_are_those_of_many_times_as_many_points() -> None:
    """To rounding: both are located, not read off the points."""
    system = ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[ms.polynomial({3: 0.05})])
    curve = ms.follow(system, 0.3, 2.5, harmonics=3, unit="rad/s")
    fine = ms.follow(
        system, 0.9, 1.6, harmonics=3, unit="rad/s", settings={"step_max": 0.06, "points": 5000}
    )
    assert len(curve.peaks) == len(fine.peaks) == 1 and len(fine) > 3 * len(curve)
    assert curve.peaks[0] == pytest.approx(fine.peaks[0], rel=1e-9)
    assert curve.amplitude.max() == pytest.approx(fine.amplitude.max(), rel=1e-10)
    assert curve.amplitude[curve.parameter == curve.peaks[0]] == curve.amplitude.max()


def test_between_its_folds_a_curve_is_unstable_and_dashed() -> None:
    """Of Duffing's oscillator: nowhere else, and multipliers are 1 at the folds."""
    system = ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[ms.polynomial({3: 0.05})])
    curve = ms.follow(system, 0.9, 1.6, harmonics=5, unit="rad/s", stability=True)
    turns = np.flatnonzero(curve.arrays["fold"])
    np.testing.assert_allclose(curve.arrays["growth"][turns], 1.0, atol=1e-3)
    inside = np.arange(turns[0] + 1, turns[1])
    assert not curve.stable[inside].any() and np.delete(curve.stable, inside).all()
    assert list(curve.bifurcations) == ["fold"]
    assert curve.plot(c="k", ls=":").lines[0].get_color() == "k"
    solid, dashed = (line.get_xydata() for line in curve.plot().lines[:2])
    assert np.isnan(solid[:, 1]).any()
    assert dashed[np.isfinite(dashed[:, 1]), 0].min() >= curve.folds.min() - 1e-3
    with pytest.raises(UserError, match="stability"):
        _ = ms.follow(system, 0.9, 1.0, harmonics=3, unit="rad/s").stable


@pytest.mark.slow
@pytest.mark.parametrize(
    ("element", "force", "damping", "span", "kind"),
    [
        (ms.polynomial({3: 1.0}), 10.0, 0.1, (1.3, 2.0), "branch point"),
        (ms.stop(3.0, 0.0), 1.0, 0.02, (2.1, 2.4), "period doubling"),
    ],
)
def test_where_a_curve_loses_its_stability_a_motion_in_time_leaves_it(
    element: ms.Element, force: float, damping: float, span: tuple[float, float], kind: str
) -> None:
    """A symmetric spring's motion gets a mean, a bilinear spring's the double period; on the other side they are as
    harmonic balance has them."""
    system = ms.structure(1.0, 1.0, damping, force={0: force}, elements=[element])
    curve = ms.follow(system, *span, harmonics=9, unit="rad/s", stability=True)
    (at,) = curve.bifurcations.pop(kind)
    start, left = {"displacement": {0: 0.5}}, []
    for omega in (at - 0.01, at + 0.01):
        seen = ms.integrate(system, omega, unit="rad/s", settle=800, keep=8, start=start)
        left.append(seen.repeats == 2 or (kind == "branch point" and abs(seen.y.mean()) > 1e-3))
    stable = [bool(curve.stable[np.abs(curve.parameter - at - d).argmin()]) for d in (-0.05, 0.05)]
    assert sorted(left) == [False, True] and left == [not one for one in stable]


@contact_law
class Rayleigh(Law):
    """Along t1 a force c (v^3 - v): small motions are fed."""

    c: Scalar

    def init(self, n: int) -> tuple[()]:
        return ()

    def step(self, u: Array, v: Array, dt: Scalar, state: State) -> tuple[Array, State]:
        return jnp.zeros_like(u).at[:, 1].set(self.c * (v[:, 1] ** 3 - v[:, 1])), state

    def slip(self, state: State) -> Array:
        return jnp.zeros((1, 2))

    def stored(self, u: Array, state: State) -> Array:
        return jnp.zeros(len(u))

    def lost(self, step: Step) -> Array:
        v = step.moved[:, 1] / step.dt
        return self.c * (v**4 - v**2) * step.dt


def test_a_load_that_quenches_a_self_excited_vibration_does_so_at_a_pair_on_the_unit_circle() -> None:
    """c (v^3 - v) with a speed of amplitude V on top: what disturbs it is fed by c (1 - 3/2 V^2), to the first order
    of c, so that V^2 = 2/3 where a second frequency dies out."""
    fed = ms.structure(
        1.0, 1.0, force={0: 3.0}, elements=[ms.Element(Rayleigh(value(0.01)), at=0, length=0.1)]
    )
    curve = ms.follow(
        fed, 0.2, 1.0, over="load", frequency=2.0, unit="rad/s", harmonics=3, stability=True
    )
    (load,) = curve.bifurcations["Neimark-Sacker"]
    V = 2.0 * np.interp(load, curve.parameter, curve.amplitude)
    assert V**2 == pytest.approx(2 / 3, rel=2e-3)
    assert not curve.stable[0] and curve.stable[-1]

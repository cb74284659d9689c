"""Bifurcations of systems with closed forms, and every number two ways."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
from closed_forms.oscillators import brusselator
from refusals import refused
from scipy.integrate import solve_ivp

import microslip as ms
from microslip.bifurcation import balance, branches, deflation, equilibria
from microslip.bifurcation.diagram import Diagram, DiagramPlan, diagram
from microslip.bifurcation.dynamics import Dynamics
from microslip.bifurcation.recorded import Branches
from microslip.bifurcation.shooting import PeriodicOrbit, Shooting


def circling(z: Any, p: Any) -> Any:
    """z' = (p + i) z - z |z|^2: of p > 0 the circle of the radius sqrt p, period 2 pi, multiplier exp(-4 pi p)."""
    r2 = z[0] ** 2 + z[1] ** 2
    return [p * z[0] - z[1] - r2 * z[0], z[0] + p * z[1] - r2 * z[1]]


def normal_form(sign: float = 1.0) -> Dynamics:
    """That, or with the other sign: the circle is there for p < 0 and repels."""

    def rate(z: Any, p: Any, _: Any) -> Any:
        x, y = circling(z, sign * p)
        return jnp.stack([sign * x, sign * y]) if sign > 0 else jnp.stack([-x, -y])

    return Dynamics(rate, ("x", "y"), np.ones(2), 2.0)


@cache
def circles() -> Diagram:
    return diagram(normal_form(), np.zeros(2), DiagramPlan(-1.0, 1.0, nodes=8, doublings=0))


def test_at_a_pitchfork_the_other_equilibria_are_followed() -> None:
    """x' = p x - x^3: x = 0 and, from p = 0 on, +- sqrt(p)."""
    fork = Dynamics(lambda x, p, _: jnp.stack([p * x[0] - x[0] ** 3]), ("x",), np.ones(1), 3.0)
    plan = DiagramPlan(-1.0, 2.0, orbits=False, branches=1)
    still, other = diagram(fork, np.zeros(1), plan).branches
    assert len(still.of_kind("branch point")) == 1 and other.stable.all()
    np.testing.assert_allclose(other.x[:, 0, 0] ** 2, other.parameter, atol=1e-8)
    np.testing.assert_allclose(sorted(other.x[[0, -1], 0, 0]), [-np.sqrt(2), np.sqrt(2)])


def lorenz() -> Dynamics:
    """Of Lorenz with 10 and 8/3: the equilibria off zero lose their stability at 10 (10 + 8/3 + 3) / (10 - 8/3 - 1)."""

    def rate(x: Any, p: Any, _: Any) -> Any:
        return jnp.stack([10 * (x[1] - x[0]), x[0] * (p - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]])

    return Dynamics(rate, ("x", "y", "z"), np.array([10.0, 10.0, 20.0]), 28.0)


def test_hopf_points_of_a_branch_that_crosses_are_found() -> None:
    found = diagram(lorenz(), np.zeros(3), DiagramPlan(0.1, 30.0, orbits=False, branches=1))
    np.testing.assert_allclose([h.p for h in found.hopf], 2 * [470 / 19], rtol=1e-6)


@pytest.mark.slow
def test_orbits_whose_period_grows_at_one_parameter_end_beside_a_homoclinic_one() -> None:
    """Those born at Lorenz's Hopf points do so at 13.926 (Sparrow, The Lorenz Equations, 1982)."""
    start = np.array([np.sqrt(72.0), np.sqrt(72.0), 27.0])
    _, cycles = diagram(lorenz(), start, DiagramPlan(5.0, 28.0, doublings=0)).branches
    assert cycles.ended.startswith("near a homoclinic orbit") and "13.926" in cycles.ended


def test_from_a_centre_the_cycles_of_van_der_pol_are_found() -> None:
    """x'' - mu (1 - x^2) x' + x = 0: at mu = 0 orbits of every size, of which that of amplitude 2 goes on as the limit
    cycle; its period is 7.6298745 at mu = 2."""

    def rate(x: Any, mu: Any, _: Any) -> Any:
        return jnp.stack([x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]])

    plan = DiagramPlan(-0.5, 2.0, branches=1)
    found = diagram(Dynamics(rate, ("x", "v"), np.ones(2), 2.5), np.zeros(2), plan)
    _, *branches = found.branches  # the centre, and the cycles by themselves unless rounding joins them to it
    assert not found.messages and np.abs(branches[0].parameter[branches[0].swing[:, 0] < 1.9]).max() < 1e-6
    branch = max(branches, key=lambda b: b.parameter.max())
    last = branch.parameter.argmax()
    assert branch.parameter[last] == 2.0 and branch.stable[last]
    assert branch.period[last] == pytest.approx(7.6298745, rel=1e-6)
    assert branch.swing[last, 0] == pytest.approx(2.0199, abs=1e-4)


def test_hopf_normal_form_is_found_with_its_circles() -> None:
    found = circles()
    (point,) = found.hopf
    assert abs(point.p) < 1e-12 and point.omega == pytest.approx(1.0, abs=1e-12)
    assert point.criticality == pytest.approx(-2.0, abs=1e-9)  # |z|^2 is twice the square of a unit shape's amplitude
    branch = found.branches[1]
    p = branch.parameter
    np.testing.assert_allclose(branch.period, 2 * np.pi, rtol=1e-9)
    np.testing.assert_allclose((branch.x**2).sum(axis=2), p[:, None] * np.ones((1, 8)), atol=1e-9)
    np.testing.assert_allclose(branch.multipliers[:, 0].real, np.exp(-4 * np.pi * p), atol=1e-8)
    assert branch.stable[1:].all() and "bound" in branch.ended
    still = found.branches[0]
    assert (still.stable == (still.parameter <= 1e-12)).all()


@pytest.mark.slow
def test_subcritical_circles_repel() -> None:
    """Of the reversed flow: p -> -p, the circles are there before the Hopf point and their multiplier is above 1."""
    found = diagram(normal_form(-1.0), np.zeros(2), DiagramPlan(-1.0, 1.0, nodes=8, doublings=0, points=12))
    assert found.hopf[0].criticality == pytest.approx(2.0, abs=1e-9)
    branch = found.branches[1]
    assert not branch.stable.any() and branch.parameter[-1] != 0


def rotor() -> Dynamics:
    """A circle of radius 1 beside another one that grows with p, of the frequency sqrt 2: a torus from p = 0 on."""

    def rate(z: Any, p: Any, _: Any) -> Any:
        one, other = circling(z[:2], 1.0), circling(z[2:], p)
        w = np.sqrt(2.0) - 1.0
        return jnp.stack([*one, other[0] - w * z[3], other[1] + w * z[2]])

    return Dynamics(rate, ("x", "y", "u", "v"), np.ones(4), 2.0)


@pytest.mark.slow
def test_torus_point_and_its_multipliers() -> None:
    from microslip.bifurcation import orbits
    from microslip.continuation import start

    system, n = rotor(), 8
    turn = 2 * np.pi * np.arange(n) / n
    x = np.stack([np.cos(turn), np.sin(turn), 0 * turn, 0 * turn], axis=1)
    problem = Shooting(system, PeriodicOrbit(system, x, 2 * np.pi, -0.5), 2 * np.pi)
    settings = DiagramPlan(-0.5, 0.5).settings
    state = start(problem, np.append(x, 2 * np.pi), -0.5, settings)
    found = [one for more, _ in orbits.follow(problem, state, settings) for one in more]
    (torus,) = [one for one in found if one.kind == "torus"]
    assert abs(torus.orbit.p) < 1e-9
    turned = np.exp(2j * np.pi * np.sqrt(2.0))
    np.testing.assert_allclose(sorted(torus.multipliers[:2].imag), sorted([turned.imag, -turned.imag]), atol=1e-8)
    assert found[0].stable and not found[-1].stable


@pytest.mark.slow
def test_period_of_van_der_pol() -> None:
    """6.66328685932313 at mu = 1 (e.g. A. Amore, F. Fernandez, arXiv 1401.4110), and its multiplier by the trace
    exp(integral of mu (1 - x^2)) (Liouville)."""
    system = Dynamics(lambda z, p, _: jnp.stack([z[1], p * (1 - z[0] ** 2) * z[1] - z[0]]), ("x", "v"), np.full(2, 2.0))
    found = diagram(system, np.zeros(2), DiagramPlan(-0.5, 1.0, nodes=16, doublings=0, step=0.2))
    orbit = found.branches[-1].orbit(system, -1)
    assert orbit.p == pytest.approx(1.0, abs=1e-12) and orbit.period == pytest.approx(6.66328685932313, rel=1e-9)
    x = orbit.sampled(64)[:, 0]
    (multiplier,) = orbit.multipliers
    assert np.log(multiplier.real) == pytest.approx(orbit.period * np.mean(1 - x**2), rel=1e-6)


@cache
def chemical() -> Diagram:
    return diagram(brusselator(), np.array([1.0, 1.5]), DiagramPlan(1.5, 2.3, nodes=16, doublings=0, step=0.3))


def test_brusselator() -> None:
    (point,) = chemical().hopf
    assert point.p == pytest.approx(2.0, abs=1e-11) and point.omega == pytest.approx(1.0, abs=1e-11)
    assert point.criticality < 0


def test_criticality_counts_quadratic_terms() -> None:
    """x' = -y - r^2 x + 1.5 x^2 + 2 x y, y' = x - r^2 y: r' = (-1 + 1.5 * 2 / 8) r^3
    (J. Guckenheimer, P. Holmes, Nonlinear Oscillations, Eq. (3.4.11)),
    r^2 twice the square of a unit shape's amplitude."""

    def rate(z: Any, p: Any, _: Any) -> Any:
        x, y = circling(z, p)
        return jnp.stack([x + 1.5 * z[0] ** 2 + 2 * z[0] * z[1], y])

    system = Dynamics(rate, ("x", "y"), np.ones(2), 2.0)
    assert equilibria.lyapunov(system, np.zeros(2), 0.0, 1.0) == pytest.approx(-1.25, abs=1e-12)


def test_shooting_is_harmonic_balance() -> None:
    """On the same orbit of the Brusselator: 40 harmonics to 1e-9, and fewer the worse."""
    system = chemical().system
    orbit = chemical().branches[1].orbit(system, -1)
    apart = []
    for H in (10, 20, 40):
        one, solution = balance.balanced(orbit, H)
        assert solution.converged
        apart.append(balance.distance(one, orbit))
    assert apart[2] < 1e-9 and apart[0] > 10 * apart[1] > 100 * apart[2]
    assert one.omega * orbit.period == pytest.approx(2 * np.pi, rel=1e-10)


def test_derivatives_are_those_of_differences() -> None:
    """Of the equations of shooting and of the balance, over all unknowns and the parameter."""
    system = chemical().system
    orbit = chemical().branches[1].orbit(system, -2)
    shoot = Shooting(system, orbit, orbit.period)
    harmonic = balance.Balance(system, balance.of_orbit(orbit, 5))
    for problem, x in ((shoot, shoot.unknowns(orbit)), (harmonic, harmonic.unknowns(harmonic.reference))):
        way, h = np.random.default_rng(1).normal(size=len(x)), 1e-6
        _, J, slope = problem.evaluate(x, orbit.p)
        ends = [problem.evaluate(x + s * h * way, orbit.p + s * h)[0] for s in (1, -1)]
        np.testing.assert_allclose(J @ way + slope, (ends[0] - ends[1]) / (2 * h), rtol=1e-5, atol=1e-6)


def by_scipy(system: Dynamics, orbit: PeriodicOrbit) -> np.ndarray:
    """Multipliers of the monodromy matrix that SciPy integrates with the variational equation."""
    n = system.count
    J = jax.jit(jax.jacfwd(lambda x: system.rate(x, orbit.p, 0.0)))
    f = jax.jit(lambda x: system.rate(x, orbit.p, 0.0))

    def rate(_: float, z: np.ndarray) -> np.ndarray:
        return np.concatenate([f(z[:n]), (np.asarray(J(z[:n])) @ z[n:].reshape(n, n)).ravel()])

    z = np.concatenate([orbit.x[0], np.eye(n).ravel()])
    end = solve_ivp(rate, (0, orbit.period), z, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(end[:n], orbit.x[0], atol=1e-8)
    return np.linalg.eigvals(end[n:].reshape(n, n))


@pytest.mark.slow
def test_multipliers_are_those_of_the_variational_equation() -> None:
    """And do not depend on the number of nodes."""
    system = chemical().system
    orbit = chemical().branches[1].orbit(system, -1)
    own = by_scipy(system, orbit)
    (multiplier,) = orbit.multipliers
    assert np.abs(own - 1).min() < 1e-7 and np.abs(own - multiplier).min() < 1e-8
    for nodes in (4, 30):
        x = orbit.sampled(60)[:: 960 // nodes] if nodes == 30 else orbit.x[::4]
        again = PeriodicOrbit(system, x, orbit.period, orbit.p)
        assert abs(again.multipliers[0] - multiplier) < 1e-8


def duffing() -> Dynamics:
    """q'' + 0.05 q' + q + 0.05 q^3 = 0.4 cos(p t): that of `ms.follow`'s docstring."""

    def rate(z: Any, p: Any, angle: Any) -> Any:
        return jnp.stack([z[1], 0.4 * jnp.cos(angle) - 0.05 * z[1] - z[0] - 0.05 * z[0] ** 3])

    return Dynamics(rate, ("q", "v"), np.full(2, 4.0), 2.0, frequency=lambda p: p)


@pytest.mark.slow
def test_folds_of_a_driven_oscillator_are_those_of_harmonic_balance() -> None:
    branch = diagram(duffing(), np.zeros(2), DiagramPlan(0.9, 1.7, nodes=8, step=0.3, doublings=0))["driven"]
    folds = branch.parameter[branch.of_kind("fold")]
    q = ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[ms.polynomial({3: 0.05})])
    np.testing.assert_allclose(folds, ms.follow(q, 0.3, 2.5, harmonics=9, unit="rad/s").folds, rtol=1e-6)
    top = branch.of_kind("fold")[0]
    assert branch.stable[: top - 1].all() and not branch.stable[top + 1 : branch.of_kind("fold")[1]].any()


def rossler() -> Dynamics:
    """x' = -y - z, y' = x + 0.2 y, z' = 0.2 + z (x - p), whose orbit doubles its period at p = 2.83."""

    def rate(s: Any, p: Any, _: Any) -> Any:
        x, y, z = s[0], s[1], s[2]
        return jnp.stack([-y - z, x + 0.2 * y, 0.2 + z * (x - p)])

    return Dynamics(rate, ("x", "y", "z"), np.array([4.0, 4.0, 4.0]), 3.0)


@pytest.mark.slow
def test_doubled_orbit_is_what_a_motion_comes_to() -> None:
    """Rossler's: beyond the doubling the orbit of one period is unstable, that of two stable, and SciPy's motion ends
    on it."""
    system = rossler()
    asked = DiagramPlan(2.6, 3.15, nodes=16, doublings=1, attractors=(2.7,), starts=3)
    found = diagram(system, np.array([0.02, -0.09, 0.09]), asked)
    (one,) = found.at("period doubling")["attractor 1 at 2.7"]
    assert 2.82 < one < 2.84
    twice = found["attractor 1 at 2.7 doubled 1"]
    i = int(np.argmin(np.abs(twice.parameter - 3.1)))
    orbit = twice.orbit(system, i)
    assert twice.stable[i] and orbit.period == pytest.approx(2 * 5.9, rel=0.03)

    def rate(_: float, s: np.ndarray) -> list[float]:
        return [-s[1] - s[2], s[0] + 0.2 * s[1], 0.2 + s[2] * (s[0] - orbit.p)]

    close = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-10}
    end = solve_ivp(rate, (0, 400), [1.0, 1.0, 0.0], **close).y[:, -1]
    again = solve_ivp(rate, (0, orbit.period), end, **close)
    np.testing.assert_allclose(again.y[:, -1], end, atol=1e-4)
    assert again.y[0].max() == pytest.approx(orbit.sampled(16)[:, 0].max(), abs=1e-2)


def test_a_branch_is_kept_and_read_again(tmp_path: Path) -> None:
    """With its read-outs' units, which tables, and pictures of what was read, have too."""
    branch = replace(circles().branches[1], units=("rad", "1"))
    branches.write(tmp_path / "b.h5", branch, "inputs")
    again = branches.kept(tmp_path / "b.h5", "inputs")
    assert again is not None and again.name == branch.name and again.ended == branch.ended
    np.testing.assert_array_equal(again.multipliers, branch.multipliers)
    np.testing.assert_array_equal(again.kind, branch.kind)
    assert again.units == branch.units and [c for c in branches.columns(again) if "largest" in c] == [
        f"{branch.outputs[0]}_largest_rad", f"{branch.outputs[1]}_largest_strain"
    ]  # fmt: skip
    axes = plt.figure().subplots(1, 2)
    for i, unit in enumerate(("rad", "m/m")):
        Branches("circles", "p", "", (again,)).plot(axes[i], i)
        assert axes[i].get_ylabel().endswith(unit)
    assert branches.kept(tmp_path / "b.h5", "other inputs") is None
    (tmp_path / "b.h5").write_bytes((tmp_path / "b.h5").read_bytes()[:-9])
    assert branches.kept(tmp_path / "b.h5", "inputs") is None


def test_tables_of_a_diagram() -> None:
    table = circles().to_dataframe()
    assert len(table) == sum(map(len, circles().branches)) and set(table["kind"]) >= {"Hopf", "start", "bound"}
    assert circles().to_xarray()["parameter"].shape == (len(table),)


def test_what_cannot_be_followed_is_refused() -> None:
    """No equilibrium, motions that grow without bounds, pairs of q'' + [[1, p], [-p, 2]] q = 0, which stand on the
    imaginary axis until they meet at p = 1/2, one value, a contact that sticks."""
    system = Dynamics(lambda z, p, _: jnp.stack([z[0] ** 2 + 1 + p**2]), ("x",), np.ones(1))
    refused("no equilibrium", diagram, system, np.ones(1), DiagramPlan(0.0, 1.0))

    def growing(z: Any, p: Any, angle: Any) -> Any:
        return jnp.stack([z[1], z[0] + 0.5 * z[0] ** 3 + jnp.cos(angle)])

    driven = Dynamics(growing, ("q", "v"), np.ones(2), 1.0, frequency=lambda p: p)
    far = np.array([50.0, 10.0])
    refused(("no periodic motion", "begin at"), diagram, driven, far, DiagramPlan(0.5, 1.0, nodes=4))

    def meeting(z: Any, p: Any, _: Any) -> Any:
        return jnp.stack([z[2], z[3], -z[0] - p * z[1], p * z[0] - 2 * z[1]])

    pairs = Dynamics(meeting, tuple("abcd"), np.ones(4), 1.0), np.zeros(4), 0.5, np.sqrt(1.5)
    refused(("no single pair", "give the bodies damping"), equilibria._sought, *pairs)
    refused("stop", ms.bifurcate, brusselator(), 1.0, 1.0)
    sticks = lambda p: ms.structure(1.0, 1.0, 0.02, elements=[ms.jenkins(1.0, p)])  # noqa: E731
    refused("jenkins", ms.bifurcate, sticks, 0.5, 1.0)


@pytest.mark.slow
def test_what_a_structure_does_over_a_parameter() -> None:
    """A mass on a spring of a cube under a steady force p: x + 0.5 x^3 = p, from Python."""
    found = ms.bifurcate(
        lambda p: ms.structure(1.0, 1.0, 0.05, steady={0: p}, output=0, elements=[ms.polynomial({3: 0.5})]), 0.0, 2.0
    )
    (still,) = found.branches
    x = still.largest[:, 0]
    np.testing.assert_allclose(x + 0.5 * x**3, still.parameter, atol=1e-10)
    assert still.stable.all() and not found.hopf


@pytest.mark.slow
def test_motions_find_the_orbit_that_no_branch_leads_to() -> None:
    """A circle that is there for all p, beside an equilibrium that is always stable: r' = -r (1 - r^2) (4 - r^2)."""

    def rate(z: Any, p: Any, _: Any) -> Any:
        r2 = z[0] ** 2 + z[1] ** 2
        grows = -(1 - r2) * (4 - r2)
        return jnp.stack([grows * z[0] - z[1], grows * z[1] + z[0]])

    system = Dynamics(rate, ("x", "y"), np.ones(2), 2.0)
    found = diagram(
        system, np.zeros(2), DiagramPlan(0.0, 1.0, nodes=8, doublings=0, attractors=(0.5,), starts=24, seed=3)
    )
    (one,) = found.attractors
    np.testing.assert_allclose(np.linalg.norm(one.orbit.x, axis=1), 2.0, atol=1e-8)
    begun = 3.0 * np.random.default_rng(3).uniform(-1, 1, (24, 2))
    assert one.share == np.mean(np.linalg.norm(begun, axis=1) > 1.0)  # the unstable circle of radius 1 divides them
    branch = found["attractor 1 at 0.5"]
    assert branch.parameter.min() == 0.0 and branch.parameter.max() == 1.0 and branch.stable.all()


def test_deflation_finds_every_circle_from_the_equilibrium_alone() -> None:
    """r' = r g(r^2), g = -(1 - r^2) (4 - r^2) (9 - r^2) / 80, turned by 1 + r^2 / 20: circles of the radius 1, 2 and 3,
    the middle one stable, each once, with its period and the multiplier exp(2 r^2 g'(r^2) T)."""

    def rate(z: Any, p: Any, _: Any) -> Any:
        r2 = z[0] ** 2 + z[1] ** 2
        grows, turns = -(1 - r2) * (4 - r2) * (9 - r2) / 80, 1 + r2 / 20
        return jnp.stack([grows * z[0] - turns * z[1], grows * z[1] + turns * z[0]])

    system = Dynamics(rate, ("x", "y"), np.ones(2), 1.0)
    found = deflation.coexisting(system, 0.5, [np.zeros(2)], [], 8)
    found.sort(key=lambda one: float(one.orbit.x[0] @ one.orbit.x[0]))
    assert [one.stable for one in found] == [False, True, False]
    for one, r2, slope in zip(found, (1.0, 4.0, 9.0), (24 / 80, -15 / 80, 40 / 80), strict=True):
        np.testing.assert_allclose((one.orbit.x**2).sum(axis=1), r2, rtol=1e-9)
        assert one.orbit.period == pytest.approx(2 * np.pi / (1 + r2 / 20), rel=1e-9)
        grown = np.exp(2 * r2 * slope * one.orbit.period)
        assert one.multipliers[0].real == pytest.approx(grown, rel=1e-5, abs=1e-9) or grown > 1e10


@pytest.mark.slow
def test_deflation_finds_the_three_motions_of_a_driven_oscillator() -> None:
    """Between the folds of Duffing's resonance, the unstable one in the middle, each as harmonic balance has it; known
    ones are not found again."""
    system = duffing()
    found = deflation.coexisting(system, 1.3, [np.zeros(2)], [], 8)
    found.sort(key=lambda one: float(np.ptp(one.orbit.sampled()[:, 0])))
    assert [one.stable for one in found] == [True, False, True]
    for one in found:
        harmonic, solution = balance.balanced(one.orbit, 15)
        assert solution.converged and balance.distance(harmonic, one.orbit) < 1e-9
    assert not deflation.coexisting(system, 1.3, [np.zeros(2)], [one.orbit for one in found], 8)


def test_deflated_equations_have_the_derivatives_of_differences() -> None:
    """Beside a known circle, shifted and run through twice as well, and beside an equilibrium."""
    orbit = circles().branches[1].orbit(circles().system, -1)
    places = [
        deflation.KnownSolution(orbit.system, orbit=orbit),
        deflation.KnownSolution(orbit.system, still=np.zeros(2)),
    ]
    turned = PeriodicOrbit(orbit.system, np.roll(orbit.x, 3, axis=0), orbit.period, orbit.p)
    assert places[0].distance(turned.x, turned.period)[0] < 1e-14
    assert places[0].distance(np.tile(orbit.x[::2], (2, 1)), 2 * orbit.period)[0] < 1e-14
    problem = Shooting(orbit.system, turned, orbit.period)
    deflated = deflation.Deflated(problem, places)
    random, h = np.random.default_rng(2), 1e-6
    x = problem.unknowns(turned) + 0.2 * random.normal(size=17)
    way = random.normal(size=17)
    ends = [deflated.evaluate(x + s * h * way, orbit.p)[0] for s in (1, -1)]
    np.testing.assert_allclose(deflated.evaluate(x, orbit.p)[1] @ way, (ends[0] - ends[1]) / (2 * h), rtol=1e-5)


@pytest.mark.slow
def test_deflation_of_a_diagram_follows_what_is_on_no_branch() -> None:
    """r' = -r (1 - r^2) (4 - r^2) again: no motion stays on the inner circle, and no Hopf point leads to either."""

    def rate(z: Any, p: Any, _: Any) -> Any:
        r2 = z[0] ** 2 + z[1] ** 2
        grows = -(1 - r2) * (4 - r2) / 8
        return jnp.stack([grows * z[0] - z[1], grows * z[1] + z[0]])

    system = ms.Dynamics(rate, ("x", "y"), np.ones(2), 1.0)
    found = ms.bifurcate(system, 0.0, 1.0, deflate=(0.5,), nodes=8, doublings=0, step=0.5)
    assert sorted(one.stable for one in found.deflated) == [False, True]
    for branch in found.branches[1:]:
        assert branch.parameter.min() == 0.0 and branch.parameter.max() == 1.0
        radius = np.linalg.norm(branch.x, axis=2)
        assert np.ptp(radius) < 1e-9 and branch.stable.all() == (radius[0, 0] > 1.5)
    assert len(found.branches) == 3


def test_two_pairs_that_cross_at_one_value_are_two_hopf_points() -> None:
    """Two circles of the frequencies 1 and sqrt 3 that are born at p = 0."""
    found = diagram(together(), np.zeros(4), DiagramPlan(-1.0, 1.0, orbits=False))
    np.testing.assert_allclose([h.p for h in found.hopf], 0.0, atol=1e-12)
    np.testing.assert_allclose(sorted(h.omega for h in found.hopf), [1.0, np.sqrt(3.0)], atol=1e-12)


def together() -> Dynamics:
    """Two circles that are born at p = 0, their frequencies those of two equal masses between three equal springs."""

    def rate(z: Any, p: Any, _: Any) -> Any:
        one, other, w = circling(z[:2], p), circling(z[2:], p), np.sqrt(3.0) - 1.0
        return jnp.stack([*one, other[0] - w * z[3], other[1] + w * z[2]])

    return Dynamics(rate, ("x", "y", "u", "v"), np.ones(4), 2.0)


@pytest.mark.slow
def test_orbits_are_born_at_both_of_two_hopf_points_at_one_value() -> None:
    found = diagram(together(), np.zeros(4), DiagramPlan(-1.0, 1.0, nodes=8, doublings=0, step=0.4))
    orbits = found.branches[1:]
    np.testing.assert_allclose([b.period[-1] for b in orbits], [2 * np.pi, 2 * np.pi / np.sqrt(3.0)], rtol=1e-9)
    assert all("bound" in b.ended for b in orbits)


def reacting(x: Any, y: Any, p: Any) -> tuple[Any, Any]:
    """The Brusselator."""
    return 1 - (p + 1) * x + x * x * y, p * x - x * x * y


@pytest.mark.parametrize("one", [lambda x, y, p: circling(jnp.stack([x, y]), p), reacting,
                                 lambda x, y, p: (y, -x + (p - x * x) * y)])  # fmt: skip
def test_alike_parts_that_are_not_coupled_are_refused_as_what_they_are(one: Any) -> None:
    """Whatever Newton's method makes of them: it is lost, finds one of both, or what follows is
    singular."""

    def rate(z: Any, p: Any, _: Any) -> Any:
        return jnp.stack([*one(z[0], z[1], p), *one(z[2], z[3], p)])

    start, rest = (1.5, [1.0, 1.5] * 2) if one is reacting else (-1.0, [0.0] * 4)
    system = Dynamics(rate, ("x", "y", "u", "v"), np.ones(4))
    refused("alike and not coupled", ms.bifurcate, system, start, start + 1.5, x=rest, orbits=False)


def test_extremes_lie_between_the_samples() -> None:
    """Of a sum of two harmonics whose extremes no sample hits, against a thousand times as many samples: samples alone
    miss 1e-4 of 256 a period, a parabola a hundredth of that, and less with the third power of the step."""
    from microslip.bifurcation.orbits import extremes

    def motion(t: np.ndarray) -> np.ndarray:
        return np.stack([np.sin(2 * np.pi * t + 0.0123), np.sin(2 * np.pi * t) + 0.2 * np.cos(6 * np.pi * t + 1.0)], 1)

    def worst(s: int) -> tuple[float, float]:
        """Missed by the parabolas and by the samples, wherever these lie."""
        ways = [motion((np.arange(s) + shift) / s) for shift in np.linspace(0, 1, 17)]
        return tuple(
            max(np.abs(np.concatenate(ends(y)) - exact).max() for y in ways)
            for ends in (extremes, lambda y: (y.max(axis=0), y.min(axis=0)))
        )

    fine = motion(np.arange(2**18) / 2**18)
    exact = np.concatenate([fine.max(axis=0), fine.min(axis=0)])
    coarse, close = worst(64), worst(256)
    assert close[0] < 1.5e-6 < 1e-4 < close[1]
    assert close[0] < coarse[0] / 50 and coarse[0] < 0.05 * coarse[1]
    assert np.array_equal(extremes(np.ones((8, 1)))[0], [1.0])
    rising = np.linspace(0.0, 1.0, 9)[:, None] ** 2
    assert extremes(rising, closed=False) == (1.0, 0.0)

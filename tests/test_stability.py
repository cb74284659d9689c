"""Floquet multipliers against closed forms, folds, brute force and motions in time; Hill's method as the second way."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.special
from refusals import refused
from test_assembly import sector

from microslip import continuation
from microslip.contact.friction import Coulomb
from microslip.contact.law import Law, settings
from microslip.contact.normal import Penalty, Preload
from microslip.contact.patch import Patch
from microslip.contact.point import PointContact
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.forces import AFT
from microslip.harmonic_balance.problem import Group, Problem
from microslip.harmonic_balance.solver import newton
from microslip.harmonic_balance.stability import ForcedOrbit, Settings, _carrier, judged, multipliers, orbit, stability
from microslip.system.assembly import Assembly, Contact, ContactFace, Linear


@settings
class Cubic(Law):
    """A force k u^3 along t1, without memory."""

    k: jax.Array

    def init(self, n):
        return ()

    def step(self, u, v, dt, state):
        return jnp.zeros_like(u).at[:, 1].set(self.k * u[:, 1] ** 3), state


@settings
class Parametric(Law):
    """Along t1 a spring as stiff as u_n."""

    def init(self, n):
        return ()

    def step(self, u, v, dt, state):
        return jnp.zeros_like(u).at[:, 1].set(u[:, 0] * u[:, 1]), state


@settings
class Pulling(Law):
    """Along t1 a force -c v that feeds energy in."""

    c: jax.Array

    def init(self, n):
        return ()

    def step(self, u, v, dt, state):
        return jnp.zeros_like(u).at[:, 1].set(-self.c * v[:, 1]), state


@settings
class Rubbing(Law):
    """Along t1 a damper of u_n v_n."""

    def init(self, n):
        return ()

    def step(self, u, v, dt, state):
        return jnp.zeros_like(u).at[:, 1].set(u[:, 0] * v[:, 0] * v[:, 1]), state


ONE_POINT = np.hstack([np.eye(3), np.zeros((3, 3))])[None]


def value(number):
    return jnp.asarray(number, dtype=float)


def moving(law, rows, M, C, K, harmonics, Omega, **more):
    """An orbit of one point contact whose three displacements (3, 2 H + 1) are given."""
    displacement = np.vstack([harmonics, np.zeros_like(harmonics)])
    return ForcedOrbit(M, C, K, rows, np.zeros((6, 6)), (law,), (ONE_POINT,), np.asarray(displacement), Omega, **more)


def along(*directions):
    """(6, m) rows of modes that move the contact along one direction each."""
    rows = np.zeros((6, len(directions)))
    rows[list(directions), range(len(directions))] = 1.0
    return rows


def one_mode(law, preload, load, K, C, directions=(1,), **more) -> Problem:
    """Masses of 1 kg on springs, with one point contact that a normal force presses."""
    m, zero = len(directions), np.zeros
    stiffness = np.diag([more.pop("k_n", 0.0), *[more.pop("k_t", 0.0)] * 2, 0, 0, 0])
    offset, forces = more.pop("offset", zero(6)), np.append(preload, zero(5))
    fine = [more.pop(key, usual) for key, usual in (("samples", 64), ("cycles", 100))]
    patch = more.pop("patch", None) or Patch("face", zero((1, 2)), np.ones(1), law)
    contact = Contact("face", patch, ContactFace("body", "face"), None, offset, forces)
    nothing, unit, f = zero((1, 6)), np.eye(m), np.array(load, dtype=complex)
    parts = tuple(
        (Linear(unit, np.diag(K), np.diag(C), along(*directions), zero((6, 6)), f * (h == 1),
                zero(6), unit[-1:], nothing, zero(1)),)
        for h in range(more.get("harmonics", 3) + 1)
    )  # fmt: skip
    group = Group(AFT(patch, 1, *fine), np.arange(6)[None], None, offset[None], forces[None], zero(1), (0,))
    return Problem(Assembly((), (contact,), (), ()), parts, (0,), (stiffness,), (group,), **more)


def solved(problem, Omega):
    found = newton(problem.at(Omega), problem.at(Omega).reference)
    assert found.converged
    return orbit(problem, found.x, Omega)


def slope_of(problem, x, Omega):
    slope = problem.at(Omega).forces(x)[1][0][0].transpose(1, 0, 3, 2)
    return slope.reshape(problem.size, problem.size)


def hill(orbit, slope):
    """Multipliers exp(lambda T) of Hill's method, in the frequency domain, for contacts without memory (G. von Groll,
    D. J. Ewins, J. Sound Vib. 241, 2001).

    A perturbation exp(lambda t) p(t) with p of H harmonics leads to (lambda^2 M + lambda (2 D M + C) + A) p = 0, D the
    derivative in time and A = D^2 M + D C + K + T^T k T of the balance itself. Of its 2 m (2 H + 1) eigenvalues those
    2 m are right whose p is centred about the mean (T. Detroux et al., Comput. Methods Appl. Mech. Eng. 296, 2015).

    Args:
        slope: (c (2 H + 1), c (2 H + 1)) derivative k of the contact forces' harmonics, the harmonics in the order of
            `ForcedOrbit.displacement`, the c rows of each together.
    """
    coefficients, m = orbit.displacement.shape[1], len(orbit.M)
    D = orbit.Omega * derivative(coefficients // 2)
    unit = np.eye(coefficients)
    T = np.kron(unit, orbit.rows)
    k = np.linalg.solve(np.eye(len(T)) + slope @ np.kron(unit, orbit.compliance), slope)
    A = np.kron(D @ D, orbit.M) + np.kron(D, orbit.C) + np.kron(unit, orbit.K) + T.T @ k @ T
    B = 2 * np.kron(D, orbit.M) + np.kron(unit, orbit.C)
    inverse = np.kron(unit, np.linalg.inv(orbit.M))
    exponents, shapes = np.linalg.eig(np.block([[np.zeros_like(A), np.eye(len(A))], [-inverse @ A, -inverse @ B]]))
    size = (np.abs(shapes[: len(A)].reshape(coefficients, m, -1)) ** 2).sum(axis=1)
    order = np.array([0] + [h for h in range(1, coefficients // 2 + 1) for _ in range(2)])
    values = []
    for i in np.argsort(order @ size / size.sum(axis=0), kind="stable"):
        value = complex(np.exp(exponents[i] * orbit.period))
        twin = value.real < 0 and abs(value.imag) < 1e-7 * abs(value) and exponents[i].imag < 0  # exp of both is one
        if not twin and len(values) < 2 * m:
            values.append(value)
    largest = np.array(sorted(values, key=lambda z: -abs(z)))
    return judged(largest, np.zeros(len(largest)), Settings().margin)


def derivative(harmonics):
    """(2 H + 1, 2 H + 1) harmonics of the derivative with respect to Omega t: mean, cos, sin, ..."""
    D = np.zeros((2 * harmonics + 1, 2 * harmonics + 1))
    for h in range(1, harmonics + 1):
        D[2 * h - 1, 2 * h], D[2 * h, 2 * h - 1] = h, -h
    return D


# closed forms ---------------------------------------------------------------------------------------------------------


def test_without_a_contact_force_the_multipliers_are_those_of_the_modes():
    """exp((-D +- i sqrt(1 - D^2)) omega T)."""
    omega, D = np.array([1.0, 1.7]), np.array([0.03, 0.1])
    law = Cubic(value(0.0))
    one = moving(law, along(1, 0), np.eye(2), np.diag(2 * D * omega), np.diag(omega**2), np.ones((3, 3)), 0.8)
    exact = np.exp((-D + 1j * np.sqrt(1 - D**2)) * omega * 2 * np.pi / 0.8)
    exact = np.sort_complex(np.concatenate([exact, exact.conj()]))
    for found in (stability(one), hill(one, np.zeros((18, 18)))):
        np.testing.assert_allclose(np.sort_complex(found.multipliers), exact, rtol=0, atol=1e-8)
        assert found.stable and found.loss == ""


@pytest.mark.parametrize("q", [0.5, 2.0])
def test_borders_of_stability_of_mathieus_equation(q):
    """x'' + (a - 2 q cos 2t) x = 0: on a = a_r(q) and b_r(q) both multipliers meet at 1 (r even) or -1 (r odd), so
    that their sum is 2 or -2; between b_r and a_r the motion grows, between a_r and b_(r+1) it does not."""

    def sums(a):
        one = moving(Parametric(), along(1), np.eye(1), np.zeros((1, 1)), a * np.eye(1), swing, 2.0)
        coarse, fine = (multipliers(one, n).sum().real for n in (256, 512))
        return one, fine + (fine - coarse) / 3

    swing = np.array([[0.0, -2 * q, 0.0], [0, 0, 0], [0, 0, 0]])
    a = [float(scipy.special.mathieu_a(r, q)) for r in range(3)]
    b = [np.nan] + [float(scipy.special.mathieu_b(r, q)) for r in (1, 2)]
    for place, expected in ((a[0], 2), (b[1], -2), (a[1], -2), (b[2], 2), (a[2], 2)):
        assert sums(place)[1] == pytest.approx(expected, abs=2e-6)
    for low, high, stable, loss in (
        (a[0], b[1], True, ""), (b[1], a[1], False, "flip"), (a[1], b[2], True, ""), (b[2], a[2], False, "fold"),
    ):  # fmt: skip
        one, _ = sums(0.5 * (low + high))
        found = stability(replace(one, C=np.full((1, 1), 1e-5)))
        assert (found.stable, found.loss) == (stable, loss)


def test_a_pair_that_turns_and_grows():
    """A force that follows the speed of a mode pushes it: a complex pair, |mu| = exp(c T / 2)."""
    law = Pulling(value(0.02))
    one = moving(law, along(1), np.eye(1), np.zeros((1, 1)), 2.3 * np.eye(1), np.zeros((3, 3)), 1.0)
    found = stability(one)
    assert found.loss == "Neimark-Sacker" and not found.stable
    assert found.growth == pytest.approx(np.exp(0.02 * np.pi), rel=1e-7)


def test_damping_that_follows_speed_and_place_leaves_the_product_of_the_multipliers():
    """x'' + u v x' + 1.7 x = 0 with u = cos t + sin t, v = u': it is
    exp(-integral of u v) = 1 (Liouville)."""
    swing = np.zeros((3, 3))
    swing[0] = [0, 1, 1]
    one = moving(Rubbing(), along(1), np.eye(1), np.zeros((1, 1)), 1.7 * np.eye(1), swing, 1.0)
    assert np.prod(multipliers(one, 512)) == pytest.approx(1.0, abs=1e-3)


def test_what_multipliers_say():
    assert judged(np.array([0.2, -0.9]), np.zeros(2), 1e-6).multipliers[0] == -0.9
    assert judged(np.array([1.0 + 1e-4]), np.array([1e-3]), 1e-6).stable
    assert judged(np.array([1.0 + 1e-4]), np.array([1e-5]), 1e-6).loss == "fold"


# folds ----------------------------------------------------------------------------------------------------------------


def duffing():
    """x'' + 0.1 x' + x + x^3 = 0.3 cos Omega t."""
    return one_mode(
        Cubic(value(1.0)), 0.0, [0.3], [1.0], [0.1], harmonics=9, samples=128, cycles=1, length=1.0, x_scale=1.0,
        lam_scale=1.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def duffing_branch():
    problem = duffing()
    low = 0.5
    settings = continuation.Settings(low=low, high=2.2, targets=(1.5,))
    return problem, continuation.trace(problem, problem.at(low).reference, low, settings)


def test_at_a_fold_one_multiplier_is_1(duffing_branch):
    """Both ways; the fold is located by the curve alone."""
    problem, branch = duffing_branch
    folds = branch.of_kind("fold")
    assert len(folds) == 2
    for p in folds:
        one = orbit(problem, p.x, p.lam)
        assert min(abs(stability(one).multipliers - 1)) < 3e-6
        assert min(abs(hill(one, slope_of(problem, p.x, p.lam)).multipliers - 1)) < 1e-7


def test_the_middle_of_three_solutions_is_unstable(duffing_branch):
    problem, branch = duffing_branch
    hits = sorted((p for p in branch.of_kind("target")), key=lambda p: abs(p.x).max())
    assert len(hits) == 3
    for p, stable in zip(hits, (True, False, True), strict=True):
        one = orbit(problem, p.x, p.lam)
        ways = stability(one), hill(one, slope_of(problem, p.x, p.lam))
        assert all(way.stable == stable and way.loss == ("" if stable else "fold") for way in ways)
        np.testing.assert_allclose(ways[0].multipliers, ways[1].multipliers, rtol=0, atol=3e-6)
        assert np.prod(ways[0].multipliers).real == pytest.approx(np.exp(-0.1 * one.period), rel=1e-5)  # Liouville


# memory ---------------------------------------------------------------------------------------------------------------


def sliding(mu=0.3):
    """1 kg, 100 rad/s, a Jenkins element of 2e4 N/m that slides at 0.6 N, 1 N drives."""
    law = PointContact(Preload(value(2.0)), Coulomb(value(mu)), value(2e4))
    return one_mode(
        law, 2.0, [1.0], [1e4], [4.0], k_t=2e4, harmonics=21, samples=1024, length=1e-4, x_scale=1.0, lam_scale=1.0
    )


def swinging(load):
    """A point that moves along n, t1 and t2; the normal force swings, friction acts in the plane."""
    law = PointContact(Penalty(value(2e5)), Coulomb(value(0.4)), value(6e4))
    omega = 2 * np.pi * np.array([60.0, 16.0, 20.0])
    return one_mode(
        law, 8.0, load, omega**2, 0.06 * omega, (0, 1, 2), k_n=2e5, k_t=6e4, offset=np.append(4e-5, np.zeros(5)),
        harmonics=21, samples=1024, cycles=3, length=1e-4,
    )  # fmt: skip


def in_time(problem, Omega, steps):
    """The map of one period of the nonlinear equations, as a function of (q, q a step before, slider states) flat.

    Central differences, the law marched along; nothing in common with what it is to prove but the law itself.
    """
    body, law, contact = problem.parts[1][0], problem.groups[0].model.law, problem.groups[0]
    dt = 2 * np.pi / Omega / steps
    T, K, C = jnp.asarray(body.rows[:3]), jnp.asarray(body.K), jnp.diag(jnp.asarray(body.C))
    load, m = jnp.asarray(body.load.real), len(body.M)
    preload, offset = jnp.asarray(contact.preload[0, :3]), jnp.asarray(contact.offset[0, :3])
    flat, unflatten = jax.flatten_util.ravel_pytree(law.init(1))

    def one(carried, i):
        q, before, state = carried
        F, state = law.step((offset + T @ q)[None], (T @ (q - before) / dt)[None], dt, state)
        drive = load * jnp.cos(Omega * i * dt) - K @ q - T.T @ (F[0] - preload)
        after = (dt**2 * drive + 2 * q - before + 0.5 * C * dt * before) / (1 + 0.5 * C * dt)
        return (after, q, state), q

    @jax.jit
    def period(z):
        (q, before, state), path = jax.lax.scan(one, (z[:m], z[m : 2 * m], unflatten(z[2 * m :])), jnp.arange(steps))
        return jnp.concatenate([q, before, jax.flatten_util.ravel_pytree(state)[0]]), path

    return period, np.concatenate([np.zeros(2 * m), np.asarray(flat)])


def brute_force(problem, Omega, steps, periods):
    """Eigenvalues of the derivative of that map by differences, at the state it settles to; q is moved with its
    neighbour in time, slip path and time are left out."""
    period, z = in_time(problem, Omega, steps)
    for _ in range(periods):
        z = np.asarray(period(z)[0])
    keep = np.arange(len(z) - 3)  # the last three: path slid along t1 and t2, time
    columns = []
    for i in keep:
        step = 1e-7 * max(abs(z[i]), 1e-9 * (z != 0).any(), float(np.abs(z[: 2 * len(problem.parts[1][0].M)]).max()))
        moved = [np.asarray(period(z + way * step * np.eye(len(z))[i])[0]) for way in (1, -1)]
        columns.append((moved[0] - moved[1])[keep] / (2 * step))
    values = np.linalg.eigvals(np.array(columns).T)
    return values[np.argsort(-abs(values))]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "f", "count", "steps"),
    [
        (sliding(), 17.0, 2, (2048, 8192, 60)),
        (sliding(), 15.0, 2, (2048, 8192, 60)),
        (swinging((12.0, 4, 2)), 22.0, 6, (2048, 8192, 60)),
        (swinging((20.0, 8, 4)), 22.0, 6, (2048, 8192, 60)),
    ],
    ids=["turning", "decaying", "space", "space and lift-off"],
)
def test_multipliers_with_memory_against_brute_force(problem, f, count, steps):
    """Two ways that share the law alone: the other is the motion in time, its map differentiated by differences.

    Both err by about the step where a contact changes between stick and slip between two samples, and the 21
    harmonics say when it opens to about 1e-4 of the period, during which a stiff contact turns the motion.
    """
    Omega = 2 * np.pi * f
    found = stability(solved(problem, Omega), Settings(steps=steps[0]))
    exact = brute_force(problem, Omega, *steps[1:])
    ways = (np.sort_complex(np.round(v[:count], 9)) for v in (found.multipliers, exact))
    np.testing.assert_allclose(*ways, rtol=0, atol=3e-3)
    assert found.stable and found.growth < 1


def test_a_slider_forgets_and_one_that_sticks_does_not_count():
    """Stuck, the oscillator is linear: its two multipliers and no 1 of the slider, whatever offset that has."""
    problem, Omega = sliding(mu=30.0), 2 * np.pi * 21.0
    found = multipliers(solved(problem, Omega), 2048)
    omega, D = np.sqrt(3e4), 2.0 / np.sqrt(3e4)
    assert (abs(found) > 1e-9).sum() == 2
    np.testing.assert_allclose(abs(found[:2]), np.exp(-D * omega * 2 * np.pi / Omega), rtol=1e-5)


@pytest.mark.slow
def test_what_a_motion_reaches_is_all_that_changes():
    """A patch of 8 points, some of which slide: the map of everything, column by column, has the same largest
    multipliers as the map on what perturbations of the motion reach; a slider that sticks all the time adds 1s, one
    that slides adds how it forgets offsets across its path, along which nothing moves here."""
    law = PointContact(Penalty(value(1e5)), Coulomb(value(0.3)), value([3e4] * 4 + [3e3] * 3 + [1e-3]))
    places = np.column_stack([np.linspace(-0.01, 0.01, 8), np.zeros(8)])
    problem = one_mode(
        law, 8.0, [0.0, 2.5], [1e5, 1e4], [10.0, 4.0], (0, 1), length=1e-4, samples=128,
        patch=Patch("face", places, np.ones(8), law), offset=np.append(1e-5, np.zeros(5)),
    )  # fmt: skip
    one = solved(problem, 2 * np.pi * 20.0)
    reached = multipliers(one, 256)
    carry, unit = _carrier(one, 256)
    every = np.linalg.eigvals(carry(np.diag(unit)) / unit[:, None])
    neutral = abs(every - 1) < 1e-9
    rest = every[~neutral][np.argsort(-abs(every[~neutral]))]
    assert neutral.sum() >= 1 and len(reached) < len(every) and not (abs(reached - 1) < 1e-9).any()
    np.testing.assert_allclose(abs(rest[:4]), abs(reached[:4]), rtol=1e-7)
    assert abs(rest[4]) < 1e-3


def test_compliance_beside_the_modes_is_that_of_a_mode_too_stiff_to_move_on_its_own():
    """A mode at 600 times the frequency held once as a mode and once as the compliance it leaves:
    what is missing is its damping, a delay of C/K = 5e-5 s, and less so its inertia."""
    law, stiff = Cubic(value(50.0)), 4e5
    M, K, C = np.eye(2), np.diag([1.0, stiff]), np.diag([0.1, 20.0])
    swing = np.array([[0, 0, 0], [0.1, 0.6, 0.2], [0, 0, 0]])
    rows = along(1, 1)
    rows[1, 1] = 0.2 * np.sqrt(stiff)
    whole = moving(law, rows, M, C, K, swing, 1.3)
    B = np.zeros((6, 6))
    B[1, 1] = 0.2**2
    short = replace(moving(law, rows[:, :1], M[:1, :1], C[:1, :1], K[:1, :1], swing, 1.3), compliance=B)
    left_out = replace(short, compliance=0 * B)
    exact, near, far = (stability(one, Settings(steps=4096)).multipliers[:2] for one in (whole, short, left_out))
    np.testing.assert_allclose(near, exact, rtol=0, atol=3e-3)
    assert abs(far - exact).max() > 0.1


# motions in time ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("f", "stable"), [pytest.param(90.0, True, marks=pytest.mark.slow), (115.0, False)])
def test_a_motion_that_loses_stability_by_a_multiplier_below_minus_1_repeats_every_second_period(f, stable):
    """A mass pressed on a spring that cannot pull, driven at about twice its own frequency."""
    law = PointContact(Penalty(value(2e5)), Coulomb(value(0.3)), value(1e5))
    omega = 2 * np.pi * 30.0
    problem = one_mode(
        law, 8.0, [20.0], [omega**2], [0.02 * omega], (0,), k_n=2e5, offset=np.append(4e-5, np.zeros(5)), harmonics=9,
        samples=1024, length=1e-5,
    )  # fmt: skip
    Omega = 2 * np.pi * f
    found = stability(solved(problem, Omega))
    assert found.stable == stable and found.loss == ("" if stable else "flip")
    period, z = in_time(problem, Omega, 1024)
    for _ in range(600):
        before, (z, path) = z, period(z)
    again = np.asarray(period(z)[0])
    size = float(np.abs(path).max())
    assert (abs(again[0] - z[0]) < 1e-3 * size) == stable  # the next period is not the same,
    assert abs(again[0] - before[0]) < 1e-3 * size  # the one after it is


RING = 2 * np.pi * 60.0


@pytest.fixture(scope="module")
def ring():
    """Four blades that rub on each other, driven by an engine order near a resonance, all alike."""
    problem = balance.of(sector(4, 1, points=(4, 3)).unrolled(), harmonics=9, samples=256, length=1e-6)
    found = newton(problem.at(RING), problem.at(RING).reference)
    assert found.converged
    return problem, found.x, orbit(problem, found.x, RING)


@pytest.fixture(scope="module")
def of_ring(ring):
    """Its multipliers."""
    return multipliers(ring[2], 256)


@pytest.mark.slow
def test_sectors_that_are_driven_alike_may_part_company(ring, of_ring):
    """The travelling wave of equal blades loses stability by a real multiplier: a solution of the sector, and one of
    the ring, but not the one that the ring takes. A sector alone cannot tell."""
    lone = balance.of(sector(4, 1), harmonics=3, samples=48, length=1e-6)
    refused("take all of them", orbit, lone, lone.at(RING).reference, RING)
    assert 1.004 < abs(of_ring[0]) < 1.01 and abs(of_ring[0].imag) < 1e-9 and abs(of_ring[1]) < 1


@pytest.mark.slow
def test_blades_part_company_in_time_as_fast_as_the_multiplier_says(ring, of_ring):
    """Central differences over 240 periods from the wave, a thousandth larger: blades 0 and 2 swing less and less, 1
    and 3 more and more, and the difference grows from period to period as the multiplier tells (30 % of its growth:
    both ways err by a thousandth of a multiplier)."""
    difference = parting(*ring, periods=240)
    assert difference[-1] > 2 * difference[120]
    grows = (difference[-1] / difference[160]) ** (1 / 79)
    assert grows - 1 == pytest.approx(abs(of_ring[0]) - 1, rel=0.3)


def parting(problem, x, one, periods, steps=1000):
    """(periods,) how much larger blades 1 and 3 swing than 0 and 2, of an assembly marched in time from a solution."""
    dt, part, at = one.period / steps, problem.parts[1][0], problem.at(one.Omega)
    T, K, C, M, load = (jnp.asarray(v) for v in (part.rows, part.K, part.C, part.M, part.load))
    inverse = jnp.linalg.inv(M / dt**2 + C / (2 * dt))
    contacts = problem.assembly.contacts
    offset = jnp.asarray(np.concatenate([c.offset for c in contacts]))
    preload = jnp.asarray(np.concatenate([c.preload for c in contacts]))

    def forces(u, v, states):
        found = [
            law.step(G @ u[rows], G @ v[rows], dt, state)
            for law, G, rows, state in zip(one.laws, map(jnp.asarray, one.kinematics), one.blocks, states, strict=True)
        ]
        F = [jnp.einsum("nia,ni->a", G, f) for G, (f, _) in zip(one.kinematics, found, strict=True)]
        return jnp.concatenate(F) - preload, tuple(state for _, state in found)

    def step(carried, i):
        q, before, states = carried
        F, states = forces(offset + T @ q, T @ (q - before) / dt, states)
        push = (load * jnp.exp(1j * one.Omega * i * dt)).real - K @ q - T.T @ F
        after = inverse @ (push + M @ (2 * q - before) / dt**2 + C @ before / (2 * dt))
        return (after, q, states), q

    march = jax.jit(lambda carried: jax.lax.scan(step, carried, jnp.arange(steps)))
    q = at.modal(x, at.force(x))

    def place(angle):
        return 1.001 * sum((q[h][0] * np.exp(1j * h * angle)).real for h in range(problem.harmonics + 1))

    carried = (
        jnp.asarray(place(0.0)), jnp.asarray(place(-one.Omega * dt)),
        tuple(law.init(len(G)) for law, G in zip(one.laws, one.kinematics, strict=True)),
    )  # fmt: skip
    out = []
    for _ in range(periods):
        carried, path = march(carried)
        swing = np.abs(np.asarray(path).reshape(steps, 4, 6)).max(axis=(0, 2))
        out.append(float(swing[1] + swing[3] - swing[0] - swing[2]))
    return np.array(out)

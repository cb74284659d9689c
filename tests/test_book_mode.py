"""The book's contact: one harmonic, constant normal force, elliptic orbits (Sextro, section 5.2), and its tables."""

import dataclasses
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from ellipses import exact
from refusals import refused
from test_assembly import sector

from microslip.contact import EXAMPLES
from microslip.contact.curved import apart
from microslip.contact.friction import Coulomb, StaticSliding
from microslip.contact.harmonics import force_alone
from microslip.contact.heights import Cut, Exponential, Linear, Polynomial, Smooth
from microslip.contact.hertz import Hertz
from microslip.contact.law import value, values
from microslip.contact.normal import Gapped, Greenwood, Penalty, Preload, Rough
from microslip.contact.patch import Patch, equilibrium, grid
from microslip.contact.point import PointContact
from microslip.contact.sliders import Iwan, mindlin, rough_strips, uniform
from microslip.contact.solids import Solid
from microslip.errors import UserError
from microslip.harmonic_balance import book, orbits, response, tables
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.forces import Forces
from microslip.harmonic_balance.solver import solve
from microslip.programs import program

TABLE, KNOWN = orbits.orbits()
MU, C_N0, C_R0, R_Z = 0.2, 840e6, 80e6, 7.5e-6


def slow(value: object) -> object:
    """A further component of a family of which others are tried by the quick tests."""
    return pytest.param(value, marks=pytest.mark.slow)


def number(x: float) -> jax.Array:
    return jnp.asarray(x, dtype=float)


def rough(n: int, heights: object = None, scale: float = 1.0) -> PointContact:
    """The contact of section 5.3, shared out among n points."""
    normal = Rough(number(scale * C_N0 / n), number(R_Z), heights or Polynomial())
    return PointContact(normal, Coulomb(number(MU)), number(scale * C_R0 / n))


def patch(law: object, counts: tuple[int, int] = (6, 2)) -> Patch:
    return Patch("right", *grid(0.072, 0.005, counts), law)


def motion(seed: int, tangential: float = 3e-6, normal: float = 2e-6, mean: float = 4e-6) -> np.ndarray:
    """(1, 6, 3) a motion in which some points stick and some slide."""
    rng = np.random.default_rng(seed)
    u = np.zeros((1, 6, 3))
    size = np.array([normal, tangential, tangential, *[tangential / 0.036] * 3])
    u[0, :, 1:] = rng.normal(size=(6, 2)) * size[:, None]
    u[0, :, 0] = mean, tangential, -tangential, 0.0, 2e-5, 1e-5
    return u


def ellipse(eta: float, zeta: float, angle: float = 0.0, phase: float = 0.0) -> np.ndarray:
    """(4,) cos and sin parts along t1 and t2 of an orbit whose long half-axis stands at an angle."""
    u = np.array([eta, -1j * zeta]) * np.exp(1j * phase)
    y, z = np.cos(angle) * u[0] - np.sin(angle) * u[1], np.sin(angle) * u[0] + np.cos(angle) * u[1]
    return np.array([y.real, -y.imag, z.real, -z.imag])


def held(t: np.ndarray) -> np.ndarray:
    """Force of unit spring and unit limit."""
    return np.asarray(_held(jnp.asarray(t)))


_held = jax.jit(lambda t: book.orbit_force(TABLE, jnp.ones(()), jnp.ones(()), t))
_forces = jax.jit(TABLE.forces)
_point_stiffness = jax.jit(lambda t: book.point_stiffness(TABLE, jnp.ones(()), jnp.ones(()), t))
_at = jax.jit(lambda found, mean, amplitude: found.at(mean, amplitude))
_swung = program(book.describing_function, static_argnums=3)
_lifting = program(book.lifting)


def along(eta: np.ndarray, zeta: np.ndarray) -> np.ndarray:
    """(2, n) K_eta, K_zeta of the table."""
    e = zeta / eta
    both = _forces(*(jnp.asarray(x) for x in (eta, e, 1 - e)))
    return np.array([np.where(eta > 1, np.asarray(f) / eta, 1.0) for f in both])


# Orbits ------------------------------------------------------------------------------------------------------------

SIZES = np.array([1.0 + 1e-6, 1.001, 1.03, 1.3, 2.0, 5.0, 40.0, 1e3])


def line(A: np.ndarray) -> np.ndarray:
    """The Jenkins element (errata to 5.2-25 to 5.2-28)."""
    theta = np.arccos(1 - 2 / A)
    return (theta - np.sin(2 * theta) / 2) / np.pi + 4j * (A - 1) / (np.pi * A**2)


def circle(A: np.ndarray) -> np.ndarray:
    """A force of constant size that lags by a constant angle."""
    return 1 / A**2 + 1j * np.sqrt(A**2 - 1) / A**2


@pytest.fixture(scope="module")
def computed() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half-axes and K_eta, K_zeta without the table: lines, circles, and places chosen at random, which are no nearer
    to the table's nodes than the held-out ones. All at once: 512 orbits cost as much as one."""
    rng = np.random.default_rng(3)
    A, e = 1 / np.sin(0.5 * rng.uniform(0.02, np.pi, 400)) ** 2, rng.uniform(0.0, 1.0, 400) ** 2
    n = len(SIZES)
    A, e = np.concatenate([SIZES, SIZES, A]), np.concatenate([np.full(n, 1e-5), np.ones(n), np.maximum(e, 1e-3)])
    return A, e * A, exact(A, e * A)


@pytest.mark.slow
@pytest.mark.parametrize(("which", "closed"), [(0, line), (1, circle)], ids=["line", "circle"])
def test_orbits_have_their_closed_forms(which: int, closed: object, computed: tuple) -> None:
    """Computed ones to the error of their ways (1e-5 of the limit), the table to the error it knows."""
    A, B, K = (x[..., which * len(SIZES) : (which + 1) * len(SIZES)] for x in computed)
    exact = closed(SIZES) * SIZES
    assert np.allclose(K[0] * A, exact, rtol=0, atol=2e-5)
    assert np.allclose(along(A, B)[0] * A, exact, rtol=0, atol=KNOWN.error)


@pytest.mark.parametrize(("ratio", "closed"), [(1e-5, line), (1.0, circle)], ids=["line", "circle"])
def test_the_table_has_the_closed_forms(ratio: float, closed: object) -> None:
    """To the error it knows."""
    assert np.allclose(along(SIZES, ratio * SIZES)[0], closed(SIZES), rtol=0, atol=KNOWN.error / SIZES)


def test_a_cross_stiffness_that_is_neither_stick_nor_slip() -> None:
    """A line with a little of the other direction: c_zeta above 1, and b_zeta > 0 (errata to zeta_A -> 0)."""
    c, b = along(np.array([1.2]), np.array([1e-3]))[1][0].real, along(np.array([2.0]), np.array([1e-3]))[1][0].imag
    assert 1.05 < c < 1.15 and b > 0.1


@pytest.mark.slow
def test_orbits_that_stick_circles_at_the_limit_and_lines() -> None:
    """One stiffness while nothing slides, without a division of nothing by nothing; a line is the thinnest ellipse."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert (exact(np.array([0.0, 0.5, 1.0, 1.0]), np.array([0.0, 0.0, 1.0, 0.0])) == 1).all()
        found = exact(np.array([2.0, 2.0]), np.array([0.0, 2 * orbits.THINNEST]))
    assert np.allclose(found[:, 0], found[:, 1], rtol=1e-9, atol=0)


@pytest.mark.slow
def test_the_error_of_the_table_is_the_one_it_promises(computed: tuple) -> None:
    """At the places chosen at random."""
    A, B, K = (x[..., 2 * len(SIZES) :] for x in computed)
    left = (along(A, B) - K) * np.stack([A, B])
    assert max(np.abs(left.real).max(), np.abs(left.imag).max()) <= KNOWN.error <= KNOWN.tolerance
    assert np.quantile(np.abs(left), 0.99) < 2 * KNOWN.typical


def test_no_orbit_gives_energy() -> None:
    """b >= 0 everywhere in the table, and zero where nothing slides."""
    A, e = (x.ravel() for x in np.meshgrid(np.geomspace(0.5, 1e4, 200), np.linspace(1e-4, 1, 60)))
    K = along(A, e * A)
    lost = A**2 * K[0].imag + (e * A) ** 2 * K[1].imag
    assert (lost >= -1e-9).all() and (K[:, A <= 1] == 1).all()


def test_full_slip_has_its_asymptote() -> None:
    """4 / (pi A) of a line and 1 / A of a circle, all of it loss; beyond the table's end too."""
    A = np.array([1e4, 1e9])
    assert np.allclose(along(A, 1e-5 * A)[0] * A, 4j / np.pi, rtol=0, atol=0.02)
    assert np.allclose(along(A, A)[0] * A, 1j, rtol=0, atol=1e-3)


def test_in_phase_motion_along_30_degrees() -> None:
    """5.2-16 with the difference of the squares: the axes stand at 30 degrees, and the force along the motion."""
    t = ellipse(2.0, 0.0, np.pi / 6)
    force = held(t)
    assert force[2] / force[0] == pytest.approx(np.tan(np.pi / 6), rel=1e-12)
    assert force[0] - 1j * force[1] == pytest.approx(2 * line(np.array(2.0)) * np.cos(np.pi / 6), abs=KNOWN.error)
    K = np.asarray(_point_stiffness(t))
    axes = np.rad2deg(np.arctan2(*np.linalg.eigh(K.imag)[1][::-1])) % 90
    assert np.allclose(axes, [30, 30], rtol=0, atol=1e-9)  # the printed sum of the squares gives 20.4


def test_an_orbit_turned_and_started_later_has_a_force_turned_and_started_later() -> None:
    for eta, zeta in ((0.7, 0.2), (1.5, 0.3), (3.0, 2.9), (2.0, 2.0)):
        K = along(np.array([eta]), np.array([zeta]))[:, 0]
        u = np.array([eta, -1j * zeta]) * np.exp(0.4j)
        f = K * u
        turned = np.array([np.cos(0.8) * f[0] - np.sin(0.8) * f[1], np.sin(0.8) * f[0] + np.cos(0.8) * f[1]])
        found = held(ellipse(eta, zeta, 0.8, 0.4))
        assert np.allclose(found[::2] - 1j * found[1::2], turned, rtol=0, atol=1e-9)


@pytest.mark.parametrize("t", [ellipse(2.0, 2.0), ellipse(2.0, 0.0, 0.3), np.zeros(4), ellipse(1.0, 0.5)])
def test_derivatives_are_finite_where_axes_or_amplitudes_vanish(t: np.ndarray) -> None:
    J = jax.jacfwd(_held)(jnp.asarray(t))
    assert np.isfinite(J).all() and np.abs(J).max() < 5


def test_derivatives_of_an_orbit_meet_differences() -> None:
    rng = np.random.default_rng(1)
    for _ in range(12):
        t = jnp.asarray(rng.normal(size=4) * 2)
        J = jax.jacfwd(_held)(t)
        D = [(held(t.at[k].add(1e-6)) - held(t.at[k].add(-1e-6))) / 2e-6 for k in range(4)]
        assert np.allclose(J, np.transpose(D), rtol=0, atol=1e-7)


# Normal direction --------------------------------------------------------------------------------------------------

NORMALS = {
    "rough": Rough(number(2e6), number(R_Z), Polynomial()),
    "exponential": Rough(number(2e6), number(R_Z), Cut(Exponential(number(4.0)))),
    "measured": EXAMPLES["measured point"].law.normal,
    "no roughness": Rough(number(2e6), number(R_Z), Smooth()),
    "penalty": Penalty(number(2e6), number(1e-6)),
    "Greenwood": Greenwood(number(5.0), number(2e-6)),
}


@pytest.mark.parametrize("name", [n if n in ("rough", "penalty") else slow(n) for n in NORMALS])
def test_normal_stiffness_is_the_integral(name: str, tmp_path: object) -> None:
    """5.2-12 by 8192 samples of the force itself, inside the table and far outside of it."""
    law = NORMALS[name]
    found, known = book.swings(law, where=tmp_path)
    u_G, u_A = (R_Z * np.ravel(x) for x in np.meshgrid(np.linspace(-0.8, 2.5, 12), [0.01, 0.3, 1.1, 3.0]))
    t = 2 * np.pi * (np.arange(8192) + 0.5) / 8192
    force = values(law, "force", u_G[:, None] + u_A[:, None] * np.cos(t))
    exact = 2 * (force * np.cos(t)).mean(axis=1) / u_A
    nominal = float(getattr(law, "stiffness_0", getattr(law, "nominal", 2e6)))
    unit = np.maximum(values(law, "stiffness", u_G + u_A), nominal)
    looked_up = np.asarray(_at(found, np.append(u_G, [0.0, 5 * R_Z]), np.append(u_A, [1e4 * R_Z] * 2)))
    inside, far = looked_up[:-2], looked_up[-2:]
    left = np.abs(inside - exact) / unit
    assert left.max() <= (known.error if known else 1e-6)
    if name == "rough":
        assert known.error <= known.tolerance
        assert np.allclose(far, 1e6, rtol=0.01)  # half of the full stiffness (errata to 5.2-12)


def test_a_lifting_spring_has_its_closed_form() -> None:
    y = np.linspace(-1.2, 1.2, 25)
    spring = Penalty(number(1.0))
    sampled = _swung(spring, y, np.ones(25), 4001)
    found = np.asarray(_lifting(np.append(y, [-1.0, 0.0, 1.0])))
    assert np.allclose(found[:-3], sampled, rtol=0, atol=5e-4)
    assert np.allclose(found[-3:], [0, 0.5, 1], rtol=0, atol=1e-9)


def test_strips_lift_one_after_the_other() -> None:
    """Their normal stiffness is that of the rough surface to the second order of their width."""
    strips = rough_strips(C_N0, R_Z, Polynomial(), C_R0, MU, 40)
    u_G, u_A = np.linspace(0.1, 2, 9) * R_Z, np.full(9, 0.4 * R_Z)
    one = _at(book.swings(strips)[0], u_G, u_A)
    whole = _swung(Rough(number(C_N0), number(R_Z), Polynomial()), u_G, u_A, 512)
    assert np.allclose(one, whole, rtol=0, atol=2e-3 * C_N0)


# Patches -----------------------------------------------------------------------------------------------------------

LAWS = {
    "rough": (rough(12), 0),
    "rough, microslip": (rough(12), 6),
    "smooth": (PointContact(Penalty(number(7e7)), Coulomb(number(MU)), number(7e6)), 0),
    "strips": (rough_strips(7e7, R_Z, Polynomial(), 7e6, MU, 8), 0),
    "Iwan": (Iwan(rough(12).normal, number(MU), number(7e6), *uniform(4)), 0),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, book.BookPatch]:
    where = tmp_path_factory.mktemp("tables")
    return {name: book.book_patch(patch(law), strips, where=where) for name, (law, strips) in LAWS.items()}


@pytest.mark.parametrize("name", [slow("rough, microslip"), "strips"])
def test_derivative_meets_differences(name: str, made: dict[str, book.BookPatch]) -> None:
    """Of all resultants with respect to all harmonics; the strips' springs jump where a strip begins to touch, and no
    difference is taken across that."""
    contact, u = made[name], motion(2)
    force, slope = contact.forces(u)
    assert np.allclose(force, contact.force(u), rtol=1e-12, atol=1e-9)
    rim = np.array([1, 1, 1, 0.036, 0.036, 0.036])
    unit = rim[:, None, None, None] * rim[None, None, :, None]
    found = np.zeros_like(slope[0])
    for i in range(6):
        for h in range(3):
            d = np.zeros_like(u)
            d[0, i, h] = 2e-11 / rim[i]
            found[:, :, i, h] = (contact.force(u + d) - contact.force(u - d))[0] / (2 * d[0, i, h])
    assert np.abs((found - slope[0]) / unit).max() < 2e-7 * np.abs(slope[0] / unit).max()


@pytest.mark.parametrize("name", [n if n in ("rough", "strips") else slow(n) for n in LAWS])
def test_stiffness_is_symmetric_and_makes_the_force(name: str, made: dict[str, book.BookPatch]) -> None:
    """5.2-32 with the angle of 5.2-16 against the form without an angle; and no cycle of the patch gives energy."""
    contact = made[name]
    for seed in range(4):
        u = motion(seed)
        K, a, F = contact.stiffness(u)[0], u[0, :, 1] - 1j * u[0, :, 2], contact.force(u)[0]
        f = F[:, 1] - 1j * F[:, 2]
        assert np.allclose(K, K.T, rtol=0, atol=1e-12 * np.abs(K).max())
        assert np.allclose(K @ a, f, rtol=0, atol=1e-9 * np.abs(f).max())
        lost = np.pi * (a.conj() @ f).imag
        work = contact.point_cycles(u)[0].dissipated
        assert (work >= -1e-16).all() and work.sum() == pytest.approx(lost, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("name", [slow(n) if n in ("smooth", "Iwan") else n for n in LAWS])
def test_points_in_time_are_those_that_the_patch_is_made_of(name: str, made: dict[str, book.BookPatch]) -> None:
    """Mean, cos and sin of the points' forces, contracted with the kinematics, are the patch's."""
    contact = made[name]
    for u in (motion(1), motion(2)):
        one, F, seen = contact.traced(u)[0], contact.force(u)[0], contact.point_cycles(u)[0]
        whole = np.einsum("nia,sni->sa", contact.patch.kinematics, one.force)
        wave = np.fft.rfft(whole, axis=0)[:2] / len(whole)
        found = np.stack([wave[0].real, 2 * wave[1].real, -2 * wave[1].imag], axis=1)
        assert np.allclose(found, F, rtol=0, atol=1e-12 * np.abs(F).max())
        np.testing.assert_array_equal(one.cycle.dissipated, seen.dissipated)


def test_contacts_are_evaluated_on_their_own(made: dict[str, book.BookPatch]) -> None:
    u = np.concatenate([motion(1), motion(2), motion(3)])
    contact = made["strips"]
    force, slope = contact.forces(u)
    for i in range(3):
        one, its = contact.forces(u[i : i + 1])
        assert np.allclose(force[i], one[0], rtol=1e-12) and np.allclose(slope[i], its[0], rtol=1e-9, atol=1e-3)
    assert contact.rate(u) is None
    model: Forces = contact
    assert model.point_cycles(u, 1.0)[2].unsteady == 0


def test_means_keep_the_preload_whatever_the_vibration(made: dict[str, book.BookPatch]) -> None:
    """u_G is the static one and friction has no mean (errata to 5.2-12): forces of 780 N stay 780 N."""
    contact = made["rough"]
    u = motion(5)
    u[0, :, 0] = equilibrium(contact.patch, 780.0)
    for scale in (0.0, 1.0, 10.0):
        swung = u * np.array([1, scale, scale])
        assert np.allclose(contact.force(swung)[0, :, 0], [780, 0, 0, 0, 0, 0], rtol=0, atol=1e-6)


@pytest.mark.parametrize("counts", [(1, 1), slow((12, 2)), slow((72, 5))])
def test_resultants_do_not_know_the_number_of_points(counts: tuple[int, int]) -> None:
    """In translation: the factor 1 / (n_y n_z) that 5.2-5 leaves out is in the numbers of the law."""
    u = motion(4)
    u[0, 3:] = 0.0
    found = book.book_patch(patch(rough(counts[0] * counts[1]), counts)).force(u)
    one = book.book_patch(patch(rough(12))).force(u)
    assert np.allclose(found, one, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["constant", slow("strips")])
def test_the_marched_law_agrees_where_the_book_assumes_no_more(name: str) -> None:
    """Constant normal force, elliptic orbits, one harmonic, marched until it is steady. Both are within the errors of
    the table and of the marched law's samples, which falls with their number (implicit steps)."""
    law = PointContact(Preload(number(65.0)), Coulomb(number(MU)), number(7e6))
    if name == "strips":
        law = rough_strips(7e7, R_Z, Polynomial(), 7e6, MU, 8).under(65.0)
    limit, spring = MU * 65.0, 7e6
    rng = np.random.default_rng(6)
    orbit = np.array([ellipse(s, s * e, a, p) for s, e, a, p in rng.uniform([0.3, 0, 0, 0], [6, 1, 6, 6], (24, 4))])
    u = np.zeros((24, 3, 3))
    u[:, 1:, 1:] = orbit.reshape(-1, 2, 2) * limit / spring
    u[:, 0, 0] = 5e-6
    marched = [np.asarray(force_alone(law, jnp.asarray(u), 1.0, s, 20, periodicity=1e-9)) for s in (512, 1024)]
    contact = book.book_patch(Patch("point", np.zeros((1, 2)), np.ones(1), law))
    whole = np.zeros((24, 6, 3))
    whole[:, :3] = u
    found = contact.force(whole)
    exact = 2 * marched[1] - marched[0]
    assert np.abs(marched[1] - marched[0])[:, 1:].max() < 0.01 * limit
    assert np.abs(found[:, 1:3, 1:] - exact[:, 1:, 1:]).max() < 2 * KNOWN.error * limit
    assert np.allclose(found[:, 0, 0], marched[1][:, 0, 0], rtol=1e-9)


def test_microslip_begins_at_once_and_ends_alike() -> None:
    """5.2-33: with roughness b > 0 at any amplitude, without it from u* = 1; the same force in full slip (5.2-5)."""
    u_G, at = equilibrium(patch(rough(12)), 780.0)[0], np.array([0.05, 0.5, 0.9, 1e4])
    limit = MU * 780.0 / (C_R0 * float(Polynomial().area(jnp.asarray(u_G / R_Z))))
    u = np.zeros((4, 6, 3))
    u[:, 0, 0], u[:, 1, 1] = u_G, at * limit
    plain, micro = (book.book_patch(patch(rough(12)), k).stiffness(u)[:, 1, 1] for k in (0, 16))
    assert np.all(plain[:3].imag == 0) and np.all(micro[:3].imag > 0)
    assert micro[0].real == pytest.approx(plain[0].real, rel=0.02)
    assert micro[3].imag == pytest.approx(plain[3].imag, rel=2e-3)
    finer = book.book_patch(patch(rough(12)), 64).stiffness(u)[:, 1, 1]
    assert np.abs(finer - micro).max() < 5e-3 * plain[0].real


def test_microslip_damps_small_torsion_too() -> None:
    """Fig. 5.2-6, phi_x alone: with roughness b > 0 at any amplitude, without it from where the outermost point slides;
    the same resultant in full slip, mu F_N times the mean distance of the points."""
    u_G, points = equilibrium(patch(rough(12)), 780.0)[0], patch(rough(12)).points
    limit = MU * 780.0 / (C_R0 * float(Polynomial().area(jnp.asarray(u_G / R_Z))))
    u = np.zeros((4, 6, 3))
    u[:, 0, 0], u[:, 3, 1] = u_G, np.array([0.05, 0.5, 0.99, 1e4]) * limit / np.hypot(*points.T).max()
    plain, micro = (book.book_patch(patch(rough(12)), k).stiffness(u)[:, 3, 3] for k in (0, 16))
    assert np.all(plain[:3].imag == 0) and np.all(micro[:3].imag > 0)
    moment = 4 / np.pi * MU * 780.0 * np.hypot(*points.T).mean()
    assert [k[3].imag * u[3, 3, 1] for k in (plain, micro)] == pytest.approx([moment, moment], rel=5e-3)


def test_strips_under_one_pressure_are_the_strips_of_the_contact_room() -> None:
    """Two ways to cut the same rough surface, with as many parts."""
    u = np.zeros((3, 6, 3))
    u[:, 0, 0], u[:, 1, 1] = 0.9 * R_Z, np.array([0.2, 0.7, 2.0]) * 1e-6
    cut = book.book_patch(patch(rough(1), (1, 1)), 60).force(u)
    own = book.book_patch(patch(rough_strips(C_N0, R_Z, Polynomial(), C_R0, MU, 60), (1, 1))).force(u)
    assert np.allclose(cut[:, 1], own[:, 1], rtol=0, atol=2e-3 * np.abs(own[:, 1]).max())


def test_the_diagonal_form_gives_the_same_forces_and_survives_what_does_not_move() -> None:
    """5.2-35: K_j = F_j / u_j; complex along the normal where others cause force; u_j = 0 keeps the diagonal."""
    contact = book.book_patch(patch(rough(12)), diagonal=True)
    full = book.book_patch(patch(rough(12)))
    u = motion(7)
    K, a = contact.stiffness(u)[0], u[0, :, 1] - 1j * u[0, :, 2]
    assert np.allclose(K @ a, full.stiffness(u)[0] @ a, rtol=1e-12) and np.count_nonzero(K) == 6
    assert abs(K[0, 0].imag) > 0
    u[0, 3:, 1:] = 0.0
    K, whole = contact.stiffness(u)[0], full.stiffness(u)[0]
    assert np.isfinite(K).all() and np.allclose(np.diag(K)[3:], np.diag(whole)[3:])


# Assemblies --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ring", [False, slow(True)], ids=["energy", "ring"])
def test_a_sector_stands_for_the_ring_and_energy_closes(ring: bool) -> None:
    """The balance with the book's contact: one sector against six, 1e-9; work of the loads is damping and friction."""
    one, Omega = sector(6, 1, normal=20.0, push=12.0), 2 * np.pi * 60.0
    found = []
    for assembly in (one, one.unrolled()) if ring else (one,):
        model = book.book_patch(assembly.contacts[0].patch)
        models = dict.fromkeys(range(len(assembly.contacts)), model)
        problem = balance.of(assembly, harmonics=1, length=1e-6, models=models)
        point = solve(problem, Omega, [])
        assert point.converged
        found.append(response.operating(problem, point))
    lost = found[0].cycles["shroud"].dissipated.sum()
    assert lost > 0 and found[0].supplied == pytest.approx(found[0].damped + lost, rel=1e-9)
    assert found[0].cycles["shroud"].slipping.mean() > 0
    if ring:
        turned = found[0].outputs[0] * np.exp(2j * np.pi * np.arange(2) * np.arange(6)[:, None] / 6)
        assert np.allclose(found[1].outputs, turned, rtol=0, atol=1e-9 * np.abs(turned).max())
        assert found[1].supplied == pytest.approx(6 * found[0].supplied)


# The book's figures 5.2-4 to 5.2-7 -----------------------------------------------------------------------------------


def test_initial_values_of_the_figures() -> None:
    """u_G* = 1, where all of the area touches: 1, 1, (1 + (h0 / b0)^2) / 12 and (1 - 1 / n^2) / 12 (5.2-39 to 5.2-41);
    no damping in the normal direction or of bending."""
    b0, h0, n = 0.072, 0.005, (24, 5)
    contact = book.book_patch(patch(rough(120), n))
    u = np.zeros((6, 6, 3))
    u[:, 0, 0] = R_Z
    u[np.arange(6), np.arange(6), 1] = 1e-4 * R_Z / np.array([1, 1, 1, b0, h0, b0])
    K = np.einsum("cii->ci", contact.stiffness(u))[np.arange(6), np.arange(6)]
    y, z = ((1 - 1 / k**2) / 12 for k in n)
    K /= np.array([C_N0, C_R0, C_R0, C_R0 * b0**2, C_N0 * h0**2, C_N0 * b0**2])
    assert np.allclose(K, [1, 1, 1, y + z * (h0 / b0) ** 2, z, y], rtol=0, atol=2e-4)  # the table's error
    large = u.copy()
    large[:, :, 1] *= 8e4
    found = np.einsum("cii->ci", contact.stiffness(large))[np.arange(6), np.arange(6)]
    assert np.all(found[[0, 4, 5]].imag == 0) and np.all(found[1:4].imag > 0)


# Files -------------------------------------------------------------------------------------------------------------


def test_a_table_comes_back_as_it_was_written(tmp_path: object) -> None:
    path = tmp_path / "ellipse.npz"
    tables.write(KNOWN, path)
    found = tables.read(path, "ellipse", KNOWN.law)
    assert found.error == KNOWN.error and np.array_equal(found.arrays["coefficients"], KNOWN.arrays["coefficients"])
    first = path.read_bytes()
    tables.write(KNOWN, path)
    assert path.read_bytes() == first


def test_damaged_and_foreign_tables_are_told_in_a_sentence(tmp_path: object) -> None:
    path = tmp_path / "table.npz"
    refused("no such table", tables.read, path, "ellipse")
    tables.write(KNOWN, path)
    whole = bytearray(path.read_bytes())
    for at in np.random.default_rng(0).integers(0, len(whole), 40):
        path.write_bytes(bytes(whole[:at]) + bytes([whole[at] ^ 0x55]) + bytes(whole[at + 1 :]))
        try:
            found = tables.read(path, "ellipse", KNOWN.law)  # a byte that nothing reads, of a date for one
        except UserError as error:
            assert str(path) in str(error) and "\n" not in str(error)
        else:
            assert np.array_equal(found.arrays["edge"], KNOWN.arrays["edge"])
    for text in (b"", b"no archive", bytes(whole[:1000])):
        path.write_bytes(text)
        refused("damaged", tables.read, path, "ellipse")
    tables.write(dataclasses.replace(KNOWN, kind="normal"), path)
    refused("something else", tables.read, path, "ellipse")
    np.savez(path, a=np.ones(3))
    refused("no table of microslip", tables.read, path, "ellipse")


def test_a_kept_table_is_used_and_a_damaged_one_made_again(tmp_path: object) -> None:
    law, calls = NORMALS["rough"], []
    book.swings(law, where=tmp_path)
    file = next(tmp_path.glob("normal-*.npz"))
    before = file.read_bytes()
    table = tables.kept("normal", tables.read(file, "normal").law, 1e-3, lambda: calls.append(1), tmp_path)
    assert not calls and table.error <= 1e-3
    file.write_bytes(before[:500])
    book.swings(law, where=tmp_path)
    assert file.read_bytes() == before
    book.swings(dataclasses.replace(law, heights=Linear()), where=tmp_path)
    assert len(list(tmp_path.glob("normal-*.npz"))) == 2
    book.swings(dataclasses.replace(law, stiffness_0=number(1.0), roughness=number(1e-6)), where=tmp_path)
    assert len(list(tmp_path.glob("normal-*.npz"))) == 2  # the table has no dimensions


def test_a_spline_has_the_fourth_order() -> None:
    def function(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        return (np.cos(2 * s[:, None]) * np.exp(t))[None, None]

    errors = []
    for count in (17, 33, 65):
        left = tables.refined(function, lambda d, s, t: np.abs(d), [((True, False), (False, False))], 0.0, (count,))[1]
        errors.append(float(left.max()))
    assert all(a > 12 * b for a, b in zip(errors, errors[1:], strict=False))


# What it cannot be -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "strips", "why"),
    [
        (EXAMPLES["point with mass"].law, 0, "without mass"),
        (dataclasses.replace(rough(1), friction=StaticSliding(number(0.4), number(0.3))), 0, "Coulomb"),
        (dataclasses.replace(rough(1), stiffness_2=number(1e6)), 0, "different tangential"),
        (dataclasses.replace(rough(1), damping=number(1e-5)), 0, "damping"),
        (LAWS["smooth"][0], 5, "strips are parts of a rough surface"),
        (LAWS["rough"][0], -1, "0 or more"),
        (mindlin(Hertz(Solid(2e11, 0.3), Solid(2e11, 0.3), 5.0, 20.0), 0.3, 3e-5, 4), 0, "different tangential"),
    ],
)  # fmt: skip
def test_other_laws_are_refused(law: object, strips: int, why: str) -> None:
    refused(why, book.book_patch, patch(law), strips)


def test_more_harmonics_are_refused() -> None:
    with pytest.raises(ValueError, match="one harmonic"):
        book.book_patch(patch(rough(12))).force(np.zeros((1, 6, 7)))


def test_points_that_begin_to_touch_later() -> None:
    """A gap per point in front of a law: of a spring its own gap; of a rough layer what each point has apart, 1e-12."""
    h = np.linspace(0, 3e-6, 12)
    plain, friction, c = number(C_N0 / 12), Coulomb(number(MU)), number(C_R0 / 12)
    gapped = book.book_patch(patch(PointContact(Gapped(Penalty(plain), value(h)), friction, c)))
    own = book.book_patch(patch(PointContact(Penalty(plain, value(h)), friction, c)))
    u = motion(3)
    np.testing.assert_array_equal(gapped.force(u), own.force(u))
    whole = patch(apart(rough(12), h))
    for strips in (0, 4):
        found, pieces = book.book_patch(whole, strips).force(u), 0.0
        for i, at in enumerate(whole.points):
            one = Patch("right", at[None], whole.areas[:1], rough(12))
            moved = u.copy()
            moved[0, 0, 0] -= h[i]
            pieces = pieces + book.book_patch(one, strips).force(moved)
        np.testing.assert_allclose(found, pieces, rtol=1e-12, atol=1e-12 * np.abs(pieces).max())

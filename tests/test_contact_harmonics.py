"""Force harmonics of contact points and their derivatives."""

import dataclasses

import jax
import numpy as np
import pytest

from microslip.contact import EXAMPLES
from microslip.contact.friction import Coulomb
from microslip.contact.harmonics import force_alone, force_harmonics, force_near
from microslip.contact.heights import Polynomial, tabulated
from microslip.contact.law import march, value
from microslip.contact.normal import Preload, Rough
from microslip.contact.periodic import RECALL, periodic, unknown
from microslip.contact.point import PointContact
from microslip.contact.rate import RateContact
from microslip.contact.wear import worn_law
from microslip.programs import program
from microslip.series import fourier

ROUGH = EXAMPLES["rough point"]
NEAR = program(force_near, static_argnames=("samples", "count", "chunk"))
MARCHED = program(march)
PERIODIC = periodic


def some(n, harmonics=3, seed=0, example=ROUGH):
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(n, 3, 2 * harmonics + 1)) / 3 * np.array([[1.0], [1], [1]])
    u *= np.array([example.normal, example.tangential, example.tangential])[:, None]
    u[:, 0, 0] += example.normal
    return u


def test_transform_is_the_inverse_of_the_waves() -> None:
    values, transform = fourier(4, 9)
    assert np.allclose(transform @ values, np.eye(9), rtol=0, atol=1e-15)


def test_too_few_samples_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 9"):
        fourier(4, 8)


def test_a_jenkins_element_has_its_closed_form() -> None:
    """Complex stiffness at three times the slip limit (Sextro Eqs. (5.2-24) to (5.2-28), errata): the first harmonic
    of sampled cycles converges with the second power of the step."""
    k, limit, x = 2e7, 40.0, 3.0
    theta = np.arccos(1 - 2 / x)
    exact = k * ((theta - np.sin(2 * theta) / 2) / np.pi + 4j * (x - 1) / (np.pi * x**2))
    law = PointContact(Preload(value(100.0)), Coulomb(value(0.4)), value(k))
    u = np.zeros((1, 3, 3))
    u[0, 1, 1] = x * limit / k
    errors = []
    for samples in (64, 256, 1024):
        f = np.asarray(force_alone(law, u, 1.0, samples=samples))[0, 1]
        errors.append(abs((f[1] - 1j * f[2]) / u[0, 1, 1] - exact) / k)
    assert errors[-1] < 1e-5 and all(a > 8 * b for a, b in zip(errors, errors[1:], strict=False))


def orbit(a, b, limit):
    """First cosine and sine of the force along t1 on the path (a cos, b sin), stiffness 1."""
    law = PointContact(Preload(value(1.0)), Coulomb(value(limit)), value(1.0))
    u = np.zeros((1, 3, 3))
    u[0, 1, 1], u[0, 2, 2] = a, b
    return np.asarray(force_alone(law, u, 1.0, samples=4096, count=3))[0, 1, 1:]


def test_on_a_circular_orbit_the_force_lags_by_a_constant_angle() -> None:
    """Radius a beyond the limit R: the force has length R and lags by arccos(R / (k a)) (errata to 5.2-25..28)."""
    assert np.allclose(orbit(1.0, 1.0, 0.5), [0.5 * 0.5, -0.5 * np.sqrt(0.75)], rtol=0, atol=1e-3)


def test_on_an_elliptic_orbit_the_limit_is_a_cone_and_not_a_box() -> None:
    """Each axis on its own would give the Jenkins element's 0.5 along t1 at twice its limit, whatever t2 does."""
    a, b, limit = 1.0, 2.0, 0.5
    force, forces = np.zeros(2), []
    path = [np.array([a * np.cos(t), b * np.sin(t)]) for t in np.linspace(0, 6 * np.pi, 30001)]
    for before, after in zip(path, path[1:], strict=False):
        force = force + after - before
        force = force * min(1.0, limit / np.hypot(*force))
        forces.append(force[0])
    last = np.array(forces[-10000:])
    expected = 2 * np.mean(last * np.cos(2 * np.pi * np.arange(1, 10001) / 10000))
    assert orbit(a, b, limit)[0] == pytest.approx(expected, abs=1e-3) and expected < 0.15


@pytest.mark.parametrize("name", ["rough point", "rough point, two stiffnesses", "rough point, damped"])
def test_derivative_matches_differences(name) -> None:
    example = EXAMPLES[name]
    u = some(6, example=example)
    direction = some(6, seed=1, example=example)
    slope = np.einsum("nkhlj,nlj->nkh", force_harmonics(example.law, u, example.period)[1], direction)
    step = 1e-6
    up, down = (np.asarray(force_harmonics(example.law, u + s * direction, example.period)[0]) for s in (step, -step))
    assert np.abs(slope - (up - down) / (2 * step)).max() <= 1e-5 * np.abs(slope).max()  # transitions inside the step


def test_chunks_and_values_per_point_change_nothing() -> None:
    n = 50
    law = dataclasses.replace(ROUGH.law, friction=Coulomb(np.linspace(0.1, 0.5, n)))
    whole = force_harmonics(law, some(n), ROUGH.period)
    parts = force_harmonics(law, some(n), ROUGH.period, chunk=16)
    for a, b in zip(whole, parts, strict=True):
        assert np.allclose(a, b, rtol=0, atol=1e-12 * np.abs(a).max())


@pytest.mark.parametrize("derived", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_tables_are_not_taken_for_values_per_point(derived: bool) -> None:
    """A table of as many nodes as there are points, and one table for each point, treated in chunks."""
    n = 50
    x = np.linspace(0, 1, n)
    same = tabulated(x, x**2 * (3 - 2 * x))
    own = worn_law(ROUGH.law.normal, np.linspace(0, 2.0, n), np.full(n, 100.0), 1e-12, 1e-6).heights
    assert same.x.shape == (n,) and own.x.shape[0] == n and own.x.ndim == 2
    for heights in (same, own):
        law = dataclasses.replace(ROUGH.law, normal=dataclasses.replace(ROUGH.law.normal, heights=heights))
        ways = [force_harmonics if derived else force_alone, law, some(n), ROUGH.period]
        whole, parts = (ways[0](*ways[1:], chunk=c) for c in (n, 16))
        for a, b in zip(whole if derived else [whole], parts if derived else [parts], strict=True):
            assert np.allclose(a, b, rtol=0, atol=1e-12 * np.abs(a).max())


def test_harmonics_are_those_of_the_marched_cycle() -> None:
    u = some(4)
    values, transform = fourier(3, 64)
    force, _ = PERIODIC(ROUGH.law, np.einsum("sh,nkh->snk", values, u), ROUGH.period, 2)[:2]
    expected = np.einsum("hs,snk->nkh", transform, force)
    found = force_alone(ROUGH.law, u, ROUGH.period)
    assert np.allclose(found, expected, rtol=0, atol=1e-12 * np.abs(force).max())


def swinging(name, n=40):
    """A law and n motions under which its normal load swings, the contact closed but for a few."""
    example = EXAMPLES[name]
    u = some(n, example=example)
    u[:, 0] *= 0.3
    u[:, 0, 0] = example.normal
    return example, u


@pytest.mark.parametrize(("name", "enough"), [
    ("smooth point", 400), pytest.param("rough strips", 5000, marks=pytest.mark.slow), ("Iwan", 400),
])  # fmt: skip
def test_cycles_go_on_until_the_sliders_have_settled(name: str, enough: int) -> None:
    """Under a swinging normal load sliders creep: two cycles are not enough, and the end of the creep is noticed.

    Within some recalls in twenty cycles although thousands of marched ones may be needed: the slow ones are solved for.
    """
    example, u = swinging(name)
    u = u[[6, 15, 18, 38, 39]]  # the slow ones
    values, transform = fourier(u.shape[2] // 2, 32)
    path = np.tile(np.einsum("sh,nkh->snk", values, u), (enough, 1, 1))
    force = np.array(MARCHED(example.law, path, example.period / 32, example.law.init(len(u)))[0])
    cycles = (force[32 * (n - 1) : 32 * n] for n in (2, enough))
    short, long = (np.einsum("hs,snk->nkh", transform, cycle) for cycle in cycles)
    how = {"samples": 32, "count": 20, "periodicity": 1e-9}
    ended = np.array(force_alone(example.law, u, example.period, **how))
    largest = np.abs(long).max()
    assert np.abs(ended - long).max() < 5 * RECALL * largest < 0.3 * np.abs(short - long).max()


def creeping(n):
    """A rough point of the rig's second arrangement, and n of its motions: harmonics of different size and phase.

    The first is the one on which Newton's step for the slider once fell in vain and was not tried again.
    """
    one = np.array([
        [5.3563138958355906e-07, 3.137756838087121e-10, 3.3876043521417583e-10],
        [-2.1718750385974032e-06, -4.165612640533182e-08, 7.8535357255714032e-10],
        [1.3596347393071197e-08, -1.759148003756245e-07, 1.846359000934190e-08],
    ])  # fmt: skip
    rng = np.random.default_rng(1)
    factor = np.exp(rng.normal(0, 1.2, (n, 3, 3))) * rng.choice([-1, 1], (n, 3, 3))
    factor[:, 0, 0] = factor[0] = 1
    normal = Rough(value(76e6), value(7.5e-6), Polynomial())
    law = PointContact(normal, Coulomb(value(0.4)), value(29e6))
    return law, np.einsum("sh,nkh->nsk", fourier(1, 64)[0], factor * one)[:, :, None], 1 / 108


def test_sliders_are_solved_for_in_few_cycles_whatever_their_motion() -> None:
    law, paths, period = creeping(500)
    found = jax.jit(jax.vmap(lambda path: periodic(law, path, period, 100, 1e-10)))(paths)
    cycles = np.asarray(found.cycles)
    assert (cycles > 4).sum() > 150
    assert cycles.max() <= 25


@pytest.mark.parametrize(
    "name", ["smooth point", *(pytest.param(name, marks=pytest.mark.slow) for name in ("rough strips", "Iwan"))]
)
def test_derivatives_are_those_of_the_periodic_state(name: str) -> None:
    """Also where one cycle changes little of it: by differences of the periodic force."""
    example, u = swinging(name)
    given = {"period": example.period, "samples": 32, "count": 100, "chunk": 16, "periodicity": 1e-13}
    slope = np.array(force_harmonics(example.law, u, **given)[1])
    moved = np.random.default_rng(1).normal(size=u.shape) * example.tangential
    h = 1e-6
    up, down = (np.array(force_alone(example.law, u + x * moved, **given)) for x in (h, -h))
    expected = np.einsum("nkhjl,njl->nkh", slope, moved)
    error = np.abs(0.5 * (up - down) / h - expected).max(axis=(1, 2)) / np.abs(expected).max()
    assert error.max() < 1e-5


@pytest.mark.parametrize(("name", "apart"), [
    ("smooth point", 0.0), pytest.param("rough strips", 0.0, marks=pytest.mark.slow), ("point with mass", 1e-6),
])  # fmt: skip
def test_force_and_derivative_belong_to_the_same_number_of_cycles(name: str, apart: float) -> None:
    """With a coarse tolerance, in chunks that settle at different times; where cycles are marched one more would show.

    Sliders that are solved for do not care for it: their force is the periodic one, as the derivative is.
    """
    example, u = swinging(name)
    coarse = {"period": example.period, "samples": 32, "count": 100, "chunk": 16, "periodicity": 1e-3}
    force, slope = (np.array(part) for part in force_harmonics(example.law, u, **coarse))
    alone, exact, fine = (
        np.array(force_alone(example.law, u, **{**coarse, "periodicity": within})) for within in (1e-3, 0.0, 1e-10)
    )
    size = np.abs(force).max()
    assert np.abs(alone - force).max() < 1e-12 * size
    assert np.abs(exact - force).max() > apart * size
    assert apart or np.abs(fine - force).max() < 1e-7 * size


def test_what_is_known_of_a_motion_near_by_changes_no_force() -> None:
    """The periodic memory is the only one there is; one that is no number counts as nothing known."""
    example, u = swinging("smooth point")
    given = {"samples": 32, "count": 100, "chunk": 16, "periodicity": 1e-12}
    law, period, nothing = example.law, example.period, unknown(example.law, len(u))
    cold = np.array(force_alone(law, u, period, **given))
    _, known = NEAR(law, 1.05 * u, nothing, period, **given)
    other = u.copy()
    other[3] = np.nan
    broken = NEAR(law, other, nothing, period, **given)[1]
    assert np.array(known.told).all() and not np.array(broken.told)[3]
    for begun in (known, broken):
        warm = np.array(NEAR(law, u, begun, period, **given)[0])
        assert np.abs(warm - cold).max() < 1e-9 * np.abs(cold).max()


@pytest.mark.parametrize(("slides", "most"), [(0.5, 2), (3.0, 2)])
def test_a_constant_normal_load_takes_no_cycle_more(slides: float, most: int) -> None:
    """To and fro, sticking or sliding: the first cycle forgets the beginning, the second one shows it and is used."""
    law = PointContact(Preload(value(100.0)), Coulomb(value(0.4)), value(2e7))
    t = 2 * np.pi * np.arange(64) / 64
    path = np.zeros((64, 1, 3))
    path[:, 0, 1] = slides * 2e-6 * np.cos(t - 0.3)
    done = PERIODIC(law, path, 1.0, 100, 1e-13).cycles
    assert int(done) == most


def test_a_contact_that_is_open_where_cycles_end_takes_two() -> None:
    """It remembers nothing there, as at the very beginning; but its first cycle came from elsewhere."""
    law = dataclasses.replace(EXAMPLES["smooth point"].law, friction=Coulomb(value(100.0)))
    t = 2 * np.pi * np.arange(64) / 64
    motion = 1e-6 * np.stack([np.sin(t + 0.05), 2 + np.cos(t), 0 * t], axis=1)[:, None]
    assert motion[-1, 0, 0] < 0 < motion[0, 0, 0]
    long = np.asarray(MARCHED(law, np.concatenate([motion] * 3), 1 / 64, law.init(1))[0])[-64:]
    ended = np.asarray(PERIODIC(law, motion, 1.0, 50, 1e-10).force)
    assert np.abs(ended - long).max() < 1e-12 * np.abs(long).max()


def test_sliders_are_remembered_one_by_one() -> None:
    """The sum of their forces says less: at its size, strips that are not yet periodic look as if they were."""
    example, u = swinging("rough strips", 1)
    state = example.law.init(1)
    values, _ = fourier(3, 64)
    force, state = MARCHED(example.law, np.einsum("sh,nkh->snk", values, u), 1.0, state)
    force = np.asarray(force)
    memory = np.asarray(example.law.memory(force[-1], state))
    assert memory.shape == (example.law.count(), 2, 1)
    np.testing.assert_allclose(memory.sum(axis=0)[:, 0], force[-1, 0, 1:], rtol=1e-12)


def test_friction_by_the_velocity_has_its_closed_form_whatever_the_samples() -> None:
    """F = mu F_N 2/pi arctan(k v) under u = A sin: the first harmonic is in phase with the speed,
    mu F_N (4/pi) (sqrt(1 + z^2) - 1) / z with z = k A omega; the harmonics fall as r^n, r < 0.64."""
    law = RateContact(Preload(value(10.0)), Coulomb(value(0.3)), value(2.0), value(0.0))
    A, period, z = 1.0, 2 * np.pi, 2.0
    u = np.zeros((1, 3, 7))
    u[0, 1, 2] = A
    errors = []
    for samples in (16, 32, 64):
        F = np.asarray(force_alone(law, u, period, samples))[0, 1]
        errors.append(abs(F[1] / (3.0 * 4 / np.pi * (np.sqrt(1 + z**2) - 1) / z) - 1))
        assert abs(F[2]) < 1e-12  # nothing in phase with the displacement
    assert errors[1] < 1e-2 * errors[0] and errors[2] < 1e-10

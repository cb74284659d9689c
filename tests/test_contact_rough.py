"""Rough normal laws: force, stiffness and energy are derivatives of each other; C1, rising, zero at separation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from refusals import refused
from scipy.stats import norm

from microslip.contact.curves import curve
from microslip.contact.friction import lubricated
from microslip.contact.heights import (
    Cut,
    Exponential,
    Gaussian,
    Heights,
    Linear,
    Polynomial,
    Smooth,
    as_table,
    combined,
    sampled,
    summed,
    tabulated,
)
from microslip.contact.normal import Greenwood, Hyperbolic, Penalty, Potential, Rough, measured
from microslip.contact.sliders import rough_strips
from microslip.contact.wear import course

TRIES = hypothesis_settings(max_examples=25, deadline=None, derandomize=True)
C, R, L = 2.4e8, 12e-6, 120e-6
TABLE = tabulated([0, 0.12, 0.3, 0.38, 0.55, 0.8, 0.95, 1.1], [0, 0.01, 0.12, 0.26, 0.63, 0.9, 0.98, 1])
SEPARATING: dict[str, Heights] = {
    "polynomial": Polynomial(),
    "linear": Linear(),
    "exponential, cut": Cut(Exponential(4.0)),
    "Gaussian, cut": Cut(Gaussian()),
    "table": TABLE,
}
ALL = SEPARATING | {"smooth": Smooth(), "exponential": Exponential(), "Gaussian": Gaussian(0.4, 0.2)}
NORMAL = (
    {f"rough, {k}": Rough(C, R, h) for k, h in ALL.items()}
    | {f"hyperbolic, {k}": Hyperbolic(C, R, ALL[k], L) for k in ("polynomial", "Gaussian, cut", "table")}
    | {
        "penalty": Penalty(C, 1e-6),
        "potential": Potential(2e3, R, 2.5, 1e-6),
        "Greenwood": Greenwood(700.0, R / 4, R),
        "measured": measured(curve([-1e-6, 2e-6, 5e-6, 9e-6, 14e-6], [0, 20, 240, 900, 2100])),
    }
)

AREA, VOLUME, ENERGY = (
    jax.jit(lambda h, x: h.area(x)),
    jax.jit(lambda h, x: h.volume(x)),
    jax.jit(lambda h, x: h.energy(x)),
)
FORCE = jax.jit(lambda law, u: law.force(u))
STORED = jax.jit(lambda law, u: law.stored(u))
LOCAL = jax.jit(lambda law, u: law.local(u))


@jax.jit
def slopes(heights, x):
    """Derivatives of area, volume and energy in x and in every number of the distribution."""
    heights = jax.tree_util.tree_map(lambda leaf: jnp.asarray(leaf, float), heights)
    return [jax.grad(f, argnums=(0, 1))(heights, x) for f in (AREA, VOLUME, ENERGY)]


@jax.jit
def derivatives(law, u):
    """Force, stiffness, share and the derivatives of force and energy."""
    slope = jax.vmap(jax.grad(lambda x: law.force(x[None])[0]))(u)
    work = jax.vmap(jax.grad(lambda x: law.stored(x[None])[0]))(u)
    return law.force(u), law.stiffness(u), law.share(u), slope, work


QUICK = "polynomial|Gaussian, cut|table|smooth|rough, polynomial|hyperbolic, table|Greenwood|measured".split("|")


def each(laws):
    """Every law; those of another distribution, which compile a program of their own, only in the slow tests."""
    params = [pytest.param(v, marks=() if k in QUICK else pytest.mark.slow) for k, v in laws.items()]
    return pytest.mark.parametrize("law", params, ids=laws.keys())


def differences(f, x, h):
    """Central differences of fourth order."""
    return (8 * (f(x + h) - f(x - h)) - (f(x + 2 * h) - f(x - 2 * h))) / (12 * h)


@each(ALL)
def test_volume_and_energy_are_integrals_of_the_area(law) -> None:
    """Between the breaks, where all three are smooth: differences of fourth order have 1e-12 / h = 1e-9 of rounding."""
    x = np.linspace(-0.5, 2.0, 400)
    smooth = np.abs(x[:, None] - np.asarray(law.breaks())).min(axis=1) > 4e-3
    for f, slope in ((ENERGY, VOLUME), (VOLUME, AREA)):
        found = differences(lambda s, f=f: np.asarray(f(law, s)), x, 1e-3)
        assert np.abs(found - slope(law, x))[smooth].max() < 1e-9


@each(SEPARATING)
def test_the_area_rises_from_zero_to_one_and_the_force_is_c1(law) -> None:
    area = np.asarray(AREA(law, np.linspace(-0.5, 3.0, 7001)))
    assert np.all(np.diff(area) >= -1e-15) and abs(area[-1] - 1) < 1e-12
    assert np.abs(np.diff(area)).max() < 5e-4 * 5  # no jump: the steepest area here has a slope below 5
    for f in (AREA, VOLUME, ENERGY):
        nothing = np.asarray(f(law, np.resize([-1.0, -1e-9, 0.0], 400)))  # the program of above
        assert np.all(nothing == 0)


@each(ALL)
def test_derivatives_are_finite_everywhere(law) -> None:
    """On the breaks and on both sides, also for every number of the law."""
    for x in np.concatenate([np.asarray(law.breaks()), [-3.0, 0.0, 0.3, 5.0]]):
        assert all(np.all(np.isfinite(g)) for g in jax.tree_util.tree_leaves(slopes(law, float(x))))


def test_cut_heights_are_those_below_the_cut() -> None:
    """Closed form of the exponential one; the Gaussian one against scipy's truncated distribution."""
    x, k = np.linspace(0, 1, 101), 4.0
    exact = (np.expm1(k * x) / k - x) / np.expm1(k)
    assert np.abs(np.asarray(VOLUME(Cut(Exponential(k)), x)) - exact).max() < 1e-15
    lost = norm.cdf(-0.5 * 20**0.5)
    area = (norm.cdf((x - 0.5) * 20**0.5) - lost) / (1 - lost)
    assert np.abs(np.asarray(AREA(Cut(Gaussian()), x)) - area).max() < 1e-14


def test_a_table_of_a_function_converges_with_the_square_of_its_step() -> None:
    x = np.linspace(0, 1.2, 301)
    errors = []
    for count in (17, 33, 65, 129):
        table = sampled(lambda s: np.clip(s, 0, 1) ** 2 * (3 - 2 * np.clip(s, 0, 1)), count=count)
        errors.append(float(np.abs(VOLUME(table, x) - VOLUME(Polynomial(), x)).max()))
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(np.abs(slopes - 2) < 0.1)
    assert errors[-1] < 1e-5


def test_a_distribution_with_tails_is_cut_when_told_to() -> None:
    def area(x):
        return norm.cdf((x - 0.5) * 20**0.5)

    refused("must go from 0 to 1", sampled, area, 0.0, 2.0)
    table = sampled(area, 0.0, 2.5, 2001, cut=True)
    x = np.linspace(-0.1, 2.4, 50)
    assert np.abs(VOLUME(table, x) - VOLUME(Cut(Gaussian()), x)).max() < 1e-6


LEVEL = tabulated([0, 0, 0.4, 0.4, 1, 1], [0, 0.2, 0.3, 0.6, 0.7, 1])
"""Level parts at the highest peak, in between and at the deepest valley: x = 0, 0.4 and 1 stand twice."""


def test_level_parts_are_jumps_and_integrated_exactly() -> None:
    """Against the closed form piece by piece, and against jumps of a small width in its limit."""
    x = np.array([-0.1, 0, 0.2, 0.3999, 0.4, 0.7, 0.9999, 1, 1.5])
    np.testing.assert_allclose(AREA(LEVEL, x), [0, 0.2, 0.25, 0.299975, 0.6, 0.65, 0.69998333, 1, 1], atol=1e-8)
    to_0, to_1 = 0.2 * 0.4 + 0.05 * 0.4, 0.6 * 0.6 + 0.05 * 0.6
    exact = {0.2: 0.2 * 0.2 + 0.125 * 0.04, 0.4: to_0, 1.0: to_0 + to_1, 1.5: to_0 + to_1 + 0.5}
    np.testing.assert_allclose(VOLUME(LEVEL, np.array([*exact])), [*exact.values()], rtol=1e-14)
    nodes, area = np.asarray(LEVEL.x), np.asarray(LEVEL.area_at)
    wide = tabulated(nodes + 1e-9 * np.array([0, 1, 0, 1, 0, 1]), area)
    for f in (VOLUME, ENERGY):
        np.testing.assert_allclose(f(LEVEL, x), f(wide, x), atol=1e-9)


def test_level_parts_in_everything_that_heights_are_made_into() -> None:
    """Strips, two surfaces, wear and a lubricated surface: the same as with jumps of a small width."""
    nodes, area = np.asarray(LEVEL.x), np.asarray(LEVEL.area_at)
    wide = tabulated(nodes + 1e-9 * np.array([0, 1, 0, 1, 0, 1]), area)
    u = np.linspace(-0.2, 1.6, 37)
    for made in (
        lambda h: [AREA(combined(h, 3e-6, Linear(), 4e-6)[0], u[::3] + 0.013)],
        lambda h: [np.asarray(LOCAL(rough_strips(1e8, 1e-5, h, 1e8, 0.3, 7), 1e-5 * u)[0]) / 1e3],
        lambda h: course(h, 0.3, np.array([0.5, 2.0])).approach,
        lambda h: lubricated(h, [0.3, 0.7], [0.0, 2.0], 0.1),
    ):
        for one, other in zip(made(LEVEL), made(wide), strict=True):
            np.testing.assert_allclose(one, other, atol=1e-6)
    assert float(rough_strips(1e8, 1e-5, LEVEL, 1e8, 0.3, 7).shares.sum()) == pytest.approx(1, rel=1e-12)


@TRIES
@given(seed=st.integers(0, 10**6))
def test_one_table_per_point_is_each_table_alone(seed) -> None:
    rng = np.random.default_rng(seed)
    x = np.cumsum(rng.uniform(0.01, 0.4, size=(3, 9)), axis=1)
    area = np.cumsum(rng.uniform(0, 1, size=(3, 9)), axis=1)
    area = (area - area[:, :1]) / (area[:, -1:] - area[:, :1])
    together = summed(x, area)
    u = rng.uniform(-0.5, 4, size=3)
    alone = [tabulated(*pair) for pair in zip(x, area, strict=True)]
    for f in (AREA, VOLUME, ENERGY):
        assert np.allclose(f(together, u), [float(f(h, u[i])) for i, h in enumerate(alone)], rtol=1e-13, atol=1e-15)
    whole = STORED(Hyperbolic(C, R, together, L), u * R)
    single = [float(STORED(Hyperbolic(C, R, h, L), u[i : i + 1] * R)[0]) for i, h in enumerate(alone)]
    assert np.allclose(whole, single, rtol=1e-12, atol=1e-12 * C * R * R)


@each(NORMAL)
def test_stiffness_and_energy_belong_to_the_force(law) -> None:
    """jax's derivative of the force is the stiffness, that of the energy the force; finite on every kink."""
    u = np.linspace(-0.3 * R, 12 * R, 600)
    force, stiffness, share, slope, work = map(np.asarray, derivatives(law, u))
    assert np.all(np.isfinite(slope)) and np.all(np.isfinite(work))
    away = np.abs(stiffness - np.roll(stiffness, 1)) < 0.2 * stiffness.max()  # one sample may stand on a jump
    assert np.abs(slope - stiffness)[away].max() <= 1e-12 * stiffness.max()
    assert np.abs(work - force).max() <= 1e-9 * force.max()
    assert np.all(np.diff(force) >= 0) and np.all(share >= 0)


def test_the_energy_of_a_power_law_is_the_integral_of_its_force() -> None:
    """4 N at 2 um behind a gap of 1 um, to the power 2.5: F_NS u_NS / 3.5 (u / u_NS)^3.5."""
    law, u = Potential(4.0, 2e-6, 2.5, 1e-6), np.array([0.0, 2e-6, 3e-6])
    np.testing.assert_allclose(law.stored(u), 8e-6 / 3.5 * np.array([0.0, 0.5**3.5, 1.0]), rtol=1e-13)


def test_the_hyperbolic_law_stays_finite_beyond_its_layer() -> None:
    """Up to a tenth of the length as printed; from there on a line, C1."""
    law = Hyperbolic(C, R, Polynomial(), L)
    u = np.array([0.5 * R, 0.9 * L * (1 - 1e-9), 0.9 * L * (1 + 1e-9), L, 3 * L])
    force, stiffness, *_ = map(np.asarray, derivatives(law, u))
    assert force[0] == pytest.approx(C * R * 0.09375 / (1 - 0.5 * R / L), rel=1e-14)
    assert force[1] == pytest.approx(force[2], rel=1e-7) and stiffness[1] == pytest.approx(stiffness[2], rel=1e-7)
    assert force[4] - force[3] == pytest.approx(2 * L * stiffness[3], rel=1e-12)


def test_a_measured_law_is_its_curve() -> None:
    """The same numbers in jax as in numpy, a plateau included; nothing when open."""
    points = curve([0, 2e-6, 5e-6, 9e-6, 14e-6], [0, 20, 240, 240, 2100.0])
    law, u = measured(points), np.linspace(-2e-6, 2e-5, 400)
    force, stiffness, share, *_ = map(np.asarray, derivatives(law, u))
    assert np.abs(force - points.force(u)).max() < 1e-11 * 2100
    assert np.abs(stiffness - points.stiffness(u)).max() < 1e-9 * stiffness.max()
    assert np.abs(STORED(law, u) - points.stored(u)).max() < 1e-11 * 2100 * 2e-5
    assert np.all(force[u <= 0] == 0) and np.all(share <= 1 + 1e-12)
    refused("nominal stiffness of -1 N/m", measured, points, -1.0)


def test_equal_shapes_combine_to_the_same_shape() -> None:
    """Sextro (3.3-11), (3.3-12), to rounding: both have the same nodes."""
    table, roughness = combined(Polynomial(), 3e-6, Polynomial(), 4e-6)
    assert roughness == pytest.approx(5e-6, rel=1e-15)
    x = np.linspace(0, 1.2, 200)
    assert np.abs(AREA(table, x) - AREA(as_table(Polynomial()), x)).max() < 1e-12


def test_different_shapes_combine_by_the_squares_of_their_depths() -> None:
    """At every share of the area; a smooth partner changes nothing."""
    table, roughness = combined(Linear(), 3e-6, Polynomial(), 4e-6, 1025)
    z = np.linspace(0.01, 0.99, 99)
    depth = np.interp(z, np.asarray(table.area_at), np.asarray(table.x)) * roughness
    fine = np.linspace(0, 1, 100001)
    polynomial = np.interp(z, fine**2 * (3 - 2 * fine), fine)
    assert np.abs(depth - np.hypot(3e-6 * z, 4e-6 * polynomial)).max() < 1e-5 * roughness
    alone, same = combined(Linear(), 3e-6, Smooth(), 0.0)
    assert same == 3e-6 and np.allclose(AREA(alone, z), z, atol=1e-15)


@pytest.mark.parametrize(
    ("x", "area", "sentence"),
    [
        ([0, 1, 0.5], [0, 0.5, 1], "x[2] = 0.5 lies below"),
        ([0, 0.5, 1], [0, 0.6, 0.5], "falls from 0.6 to 0.5"),
        ([0, 0.5, 1], [0, np.nan, 1], "area[1] is not a finite number"),
        ([0, 0.5, 1], [0.1, 0.5, 1], "must go from 0 to 1"),
        ([0], [0], "two or more nodes"),
    ],
)
def test_a_wrong_height_distribution_is_told_in_a_sentence(x, area, sentence) -> None:
    refused(sentence, tabulated, x, area)


def test_surfaces_without_depths_are_not_combined() -> None:
    """A distribution from minus infinity has no highest peak to measure depths from."""
    refused("x of 0 or more", combined, Exponential(), 1e-6, Linear(), 1e-6)
    assert combined(Cut(Exponential()), 1e-6, Linear(), 1e-6)[1] == pytest.approx(2**0.5 * 1e-6)
    refused("smooth surface has no table", as_table, Smooth())
    refused("lengths of 0 or more", combined, Linear(), -1e-6, Linear(), 1e-6)

"""Friction characteristics: closed forms, statistics of the random one, quadrature of the lubricated, bad tables."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refused
from scipy.integrate import quad
from scipy.interpolate import pchip_interpolate

from microslip.contact.friction import (
    EXPONENTIAL_44,
    Coulomb,
    Exponential,
    Falling,
    Heated,
    Scattered,
    StaticSliding,
    characteristic,
    creep,
    lubricated,
    peak,
    scattered,
    smoothed,
)
from microslip.contact.heights import Linear, Polynomial, tabulated

V = np.array([0.0, 1e-3, 0.02, 0.22, 1.0, 7.0])
N = np.full(V.shape, 100.0)
COEFFICIENT = jax.jit(lambda law, *given: law.coefficient(*given))
NOISE = jax.jit(lambda law, t: law.noise(t))
TABLE = ([1e-4, 1e-3, 1e-2, 1e-1], [0.5, 0.8, 0.9, 0.4])


def value(number):
    return jnp.asarray(number, dtype=float)


# closed forms --------------------------------------------------------------------------------------------------------


def test_coulomb_is_the_same_at_every_speed_and_may_differ_from_point_to_point() -> None:
    assert np.array_equal(COEFFICIENT(Coulomb(value(0.3)), V, N), np.full(len(V), 0.3))
    own = np.linspace(0.1, 0.6, len(V))
    assert np.array_equal(COEFFICIENT(Coulomb(own), V, N), own)


def test_static_and_sliding() -> None:
    assert np.array_equal(COEFFICIENT(StaticSliding(value(0.4), value(0.3)), V, N), [0.4, *[0.3] * 5])


def test_falling_has_halved_at_the_speed_1_over_p_v() -> None:
    mu = np.asarray(COEFFICIENT(Falling(value(0.28), value(1 / 0.22)), V, N))
    assert mu[0] == 0.28 and mu[3] == pytest.approx(0.14, rel=1e-14)
    assert np.all(np.diff(mu) < 0)


def test_exponential_goes_from_mu_0_to_mu_inf_with_the_slope_of_its_rate() -> None:
    for mu_0, mu_inf in ((0.4, 0.2), (0.2, 0.4)):
        law = Exponential(value(mu_0), value(mu_inf), value(50.0))
        mu = np.asarray(COEFFICIENT(law, V, N))
        assert mu[0] == pytest.approx(mu_0, rel=1e-14) and mu[-1] == pytest.approx(mu_inf, rel=1e-14)
        slope = jax.jvp(lambda v, law=law: COEFFICIENT(law, v, N), (V * 0,), (np.ones_like(V),))[1]
        assert np.allclose(slope, -50 * (mu_0 - mu_inf), rtol=1e-14)


def test_exponential_of_section_4_4_times_the_book_s_arctan() -> None:
    """a_1 (1 + a_2 exp(-b_1 v)) arctan(b_2 v) with 0.14, 1.14, 2 s/m, 100 s/m: the arctan without 2/pi."""
    printed = 0.14 * (1 + 1.14 * np.exp(-2.0 * np.asarray(V))) * np.arctan(100.0 * np.asarray(V))
    found = COEFFICIENT(EXPONENTIAL_44, V, N) * smoothed(V, 100.0)
    assert np.allclose(found, printed, rtol=1e-14, atol=0)


@given(
    mu_0=st.floats(0.01, 1.5), resistance=st.floats(1e-8, 1e-3), limit=st.floats(1, 2e3), speed=st.floats(0, 100),
    pressed=st.floats(0, 1e5), area=st.floats(1e-9, 1e-2),
)  # fmt: skip
def test_heated_friction_and_its_temperature_agree(mu_0, resistance, limit, speed, pressed, area) -> None:
    """(3.6-3) with the temperature of (3.6-5) and (3.6-14) is (3.6-15) with p_v of (3.6-16), at any pressure."""
    law = Heated(*map(value, (mu_0, resistance, limit, area)))
    v, n = np.array([speed]), np.array([pressed])
    mu, rise = float(COEFFICIENT(law, v, n)[0]), float(law.temperature(v, n)[0])
    assert rise == pytest.approx(resistance * mu * pressed / area * speed, rel=1e-13)
    assert mu == pytest.approx(mu_0 * (1 - rise / limit), rel=1e-9, abs=1e-13)  # difference of nearly equal numbers
    assert 0 <= rise <= limit
    p_v = resistance * mu_0 * (pressed / area) / limit
    assert mu == pytest.approx(float(COEFFICIENT(Falling(value(mu_0), value(p_v)), v, n)[0]), rel=1e-13)


def test_highest_bounds_every_characteristic_and_is_reached() -> None:
    """At rest where it falls from the start; elsewhere where it rises."""
    speeds = np.concatenate([np.zeros(1), np.logspace(-6, 3, 20001)])
    pressed = np.full(speeds.shape, 50.0)
    pairs = [
        (Coulomb(value(0.3)), 0.3),
        (Falling(value(0.3), value(4.0)), 0.3),
        (StaticSliding(value(0.4), value(0.3)), 0.4),
        (Exponential(value(0.2), value(0.5), value(3.0)), 0.5),
        (Exponential(value(0.5), value(0.2), value(3.0)), 0.5),
        (Heated(value(0.3), value(1e-5), value(900.0), value(1e-4)), 0.3),
        (characteristic(*TABLE), 0.9),
    ]
    for law, expected in pairs:
        assert np.allclose(law.highest(pressed), expected, rtol=1e-14)
        assert float(COEFFICIENT(law, speeds, pressed).max()) == pytest.approx(expected, rel=1e-6)
    noisy = scattered(characteristic(*TABLE), 0.2, 1e-3, seed=4)
    for t in (0.0, 0.3):
        most = COEFFICIENT(noisy, speeds, pressed, t).max()
        assert float(most) == pytest.approx(float(noisy.highest(pressed, t)[0]), rel=1e-6)


# a measured table ----------------------------------------------------------------------------------------------------


def test_a_table_is_met_in_its_entries_and_constant_outside() -> None:
    law = characteristic(*TABLE)
    at = np.array([0.0, 1e-9, *TABLE[0], 1.0, 1e5])
    expected = [0.5, 0.5, *TABLE[1], 0.4, 0.4]
    assert np.allclose(COEFFICIENT(law, at, at), expected, rtol=1e-14)


def test_a_table_is_a_spline_without_extremes_of_its_own() -> None:
    """Fritsch & Carlson's monotone cubic over log v (scipy's, but for the ends, which are flat); C1 everywhere."""
    law = characteristic(*TABLE)
    v = np.logspace(-5, 0, 2001)
    mu = np.asarray(COEFFICIENT(law, v, v))
    inside = (v > 1e-3) & (v < 1e-2)
    expected = pchip_interpolate(np.log(TABLE[0]), TABLE[1], np.log(v[inside]))
    assert np.allclose(mu[inside], expected, rtol=1e-12)
    assert np.all(np.diff(mu[v <= 1e-2]) >= 0) and np.all(np.diff(mu[v >= 1e-2]) <= 0)
    slope = np.asarray(jax.jvp(lambda v: COEFFICIENT(law, v, v), (v,), (v,))[1])  # over log v
    assert np.abs(np.diff(slope)).max() < 6 * 2.0 * np.log(v[1] / v[0])  # continuous: second derivatives below 2


def test_temperature_shifts_a_table_along_the_speed() -> None:
    """Williams-Landel-Ferry: at 313.15 K the table of 293.15 K is read at v a_T, log10 a_T = -8.86 20/121.6."""
    a = 10 ** (-8.86 * 20 / 121.6)
    cold, warm = characteristic(*TABLE), characteristic(*TABLE, temperature=313.15)
    assert float(warm.shift()) == pytest.approx(a, rel=1e-12) and a < 1
    v = np.logspace(-5, 1, 50)
    assert np.allclose(COEFFICIENT(warm, v, v), COEFFICIENT(cold, v * a, v), rtol=1e-12)
    assert float(COEFFICIENT(warm, np.array([1e-2 / a]), v[:1])[0]) == pytest.approx(0.9, rel=1e-12)


def test_shift_constants_of_the_glass_transition_are_those_50_k_above_it() -> None:
    """17.44 and 51.6 K at T_g are c_2 + 50 = 101.6 K and c_1 c_2 / (c_2 + 50) = 8.86 at T_g + 50 K: same curves."""
    shift = [
        float(characteristic(*TABLE, temperature=t, reference=r, c_1=c_1, c_2=c_2).shift())
        for t in (330.0, 293.0)
        for r, c_1, c_2 in ((243.0, 17.44, 51.6), (293.0, 8.86, 101.6))
    ]
    assert shift[0] / shift[2] == pytest.approx(shift[1] / shift[3], rel=2e-3)  # 8.857 is printed as 8.86


def test_temperature_may_differ_from_point_to_point() -> None:
    law = dataclasses.replace(characteristic(*TABLE), temperature=np.array([293.15, 313.15]))
    v = np.full(2, 1e-2)
    one = [float(COEFFICIENT(characteristic(*TABLE, temperature=t), v, v)[0]) for t in (293.15, 313.15)]
    assert np.allclose(COEFFICIENT(law, v, v), one, rtol=1e-13) and one[0] != one[1]


@pytest.mark.parametrize(
    ("speeds", "values", "shift", "said"),
    [
        ([1.0], [0.3], {}, "two or more pairs"),
        ([1.0, 2.0], [0.3], {}, "two or more pairs"),
        ([0.1, 0.2, np.nan], [0.3, 0.3, 0.3], {}, "speed 3 is not a finite number"),
        ([0.1, 0.2, 0.3], [0.3, np.inf, 0.3], {}, "coefficient 2 is not a finite number"),
        ([0.0, 0.2], [0.3, 0.2], {}, "must be positive and rise"),
        ([0.2, 0.1], [0.3, 0.2], {}, "must be positive and rise"),
        ([0.1, 0.1], [0.3, 0.2], {}, "must be positive and rise"),
        ([0.1, 0.2, 0.3], [0.3, -0.2, -0.5], {}, "coefficient 2 is negative"),
        ([0.1, 0.2], [0.3, 0.2], {"temperature": 150.0}, "no value at 150 K; it needs more than 191.55 K"),
        ([0.1, 0.2], [0.3, 0.2], {"temperature": np.nan}, "temperature: must be a finite number"),
    ],
)
def test_bad_tables_are_told_in_a_sentence(speeds, values, shift, said) -> None:
    refused(said, characteristic, speeds, values, **shift)


# random in time ------------------------------------------------------------------------------------------------------

SEEDS, TIMES = 4000, (0.0, 0.1, 0.5, 1.0, 3.0)


@pytest.fixture(scope="module")
def noise():
    """(times, seeds) of xi, memory 2 s, from one draw of 4000 independent points."""
    law = scattered(Coulomb(value(0.3)), 0.1, 2.0, seed=7, points=SEEDS)
    return np.array([NOISE(law, np.full(SEEDS, 11.0 + 2.0 * t)) for t in TIMES])


def test_mean_and_standard_deviation_are_those_asked_for(noise) -> None:
    """Four standard errors of 4000 samples: mean 1/sqrt(N), deviation 1/sqrt(2 N)."""
    assert np.abs(noise.mean(axis=1)).max() < 4 / np.sqrt(SEEDS)
    assert np.abs(noise.std(axis=1) - 1).max() < 4 / np.sqrt(2 * SEEDS)


def test_correlation_falls_exponentially_with_the_memory(noise) -> None:
    """The product of two unit Gaussians of correlation r has the variance 1 + r^2."""
    for t, later in zip(TIMES, noise, strict=True):
        r = np.exp(-t)
        assert np.mean(noise[0] * later) == pytest.approx(r, abs=4 * np.sqrt((1 + r * r) / SEEDS))


def test_scatter_is_gaussian(noise) -> None:
    """Shares within one and two deviations; 64 cosines lack 3/128 of a kurtosis of 3, less than four errors here."""
    for deviations, share in ((1, 0.6827), (2, 0.9545)):
        found = np.mean(np.abs(noise[0]) < deviations)
        assert found == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / SEEDS))


def test_along_time_one_point_has_the_same_statistics() -> None:
    """Over 4000 memories of one point: an average over T has the deviation sqrt(2 memory / T) = 0.022."""
    law = scattered(Coulomb(value(0.3)), 0.1, 1.0, seed=3, cosines=512)
    xi = np.asarray(NOISE(law, np.linspace(0, 4000, 40001)))
    assert abs(xi.mean()) < 4 * 0.022 and xi.std() == pytest.approx(1, abs=4 * 0.022)
    assert np.mean(xi[10:] * xi[:-10]) == pytest.approx(np.exp(-1), abs=4 * 0.03)


def test_the_same_seed_gives_the_same_friction_and_another_one_does_not() -> None:
    t = np.linspace(0, 1, 7)
    draws = [np.asarray(COEFFICIENT(scattered(Coulomb(value(0.3)), 0.1, 0.2, seed=s), t, t, t)) for s in (1, 1, 2)]
    assert np.array_equal(draws[0], draws[1]) and np.abs(draws[0] - draws[2]).min() > 0


def test_scatter_scales_the_mean_characteristic_and_may_depend_on_the_speed() -> None:
    """Fig. 3.6-3 gives mean and standard deviation at each speed."""
    mean = Falling(value(0.28), value(1 / 0.22))
    wide = characteristic([0.01, 1.0], [0.2, 0.05])
    law = scattered(mean, wide, 1e-2, seed=5, points=SEEDS)
    for speed, deviation in ((0.005, 0.2), (2.0, 0.05)):
        v = np.full(SEEDS, speed)
        mu = np.asarray(COEFFICIENT(law, v, v, 0.4))
        middle = 0.28 / (1 + speed / 0.22)
        assert mu.mean() == pytest.approx(middle, abs=4 * deviation * middle / np.sqrt(SEEDS))
        assert mu.std() == pytest.approx(deviation * middle, rel=4 / np.sqrt(2 * SEEDS))


def test_scatter_never_makes_friction_negative() -> None:
    law = scattered(Coulomb(value(0.3)), 3.0, 1.0, seed=0, points=500)
    mu = np.asarray(COEFFICIENT(law, np.zeros(500), np.ones(500), 0.7))
    assert mu.min() == 0 and mu.max() > 0.3


def test_bad_scatter_and_films_are_told_in_a_sentence() -> None:
    for deviation, memory, said in ((-0.1, 1.0, "deviation"), (0.1, 0.0, "memory"), (np.nan, 1.0, "deviation")):
        refused(said, scattered, Coulomb(value(0.3)), deviation, memory)
    refused("do not touch", lubricated, Polynomial(), [0.5, 0.0], [1.0], 0.1)
    refused("film", lubricated, Polynomial(), [0.5], [1.0], 0.1, 0.0)


def test_scattered_settings_are_leaves() -> None:
    assert isinstance(scattered(Coulomb(value(0.3)), 0.1, 1.0), Scattered)
    assert len(jax.tree_util.tree_leaves(scattered(Coulomb(value(0.3)), 0.1, 1.0))) == 5


# lubricated ----------------------------------------------------------------------------------------------------------


def test_the_dry_part_of_linear_heights_is_elementary() -> None:
    """Density 1, F = u^2/2: 2/u^2 (u/v - log(1 + v u)/v^2)."""
    u, v = np.array([0.2, 0.7, 1.0])[:, None], np.array([0.1, 3.0, 50.0])
    dry, _ = lubricated(Linear(), u[:, 0], v, 0.0)
    assert np.allclose(dry, 2 / u**2 * (u / v - np.log1p(v * u) / v**2), rtol=1e-11)  # cancels at v u = 0.02


def test_the_fluid_part_of_linear_heights_is_elementary() -> None:
    """Density 1: the film itself gives 1, the rest log((1 - u)/film)."""
    u, film = np.array([0.2, 0.7]), 1e-3
    fluid = lubricated(Linear(), u, [4.0], 0.05, film)[1][:, 0]
    assert np.allclose(fluid, 0.05 * 4.0 * (1 + np.log((1 - u) / film)) * 2 / u**2, rtol=1e-12)


@pytest.mark.parametrize(
    "heights",
    [Polynomial(), pytest.param(tabulated([0, 0.2, 0.5, 1.0], [0, 0.3, 0.5, 1.0]), marks=pytest.mark.slow)],
    ids=["book", "table"],
)
def test_both_parts_against_quadrature_of_the_printed_integrals(heights) -> None:
    slope = jax.jit(jax.grad(heights.area))

    def density(x):
        return float(slope(x))

    u, v, film, breaks = 0.45, 3.0, 0.02, [0.2, 0.5]
    force = float(heights.volume(jnp.asarray(u)))
    dry, fluid = lubricated(heights, [u], [v], 0.3, film)
    one = quad(lambda x: (u - x) * density(x) / (1 + v * (u - x)), 0, u, points=breaks[:1], epsabs=1e-10)[0]
    two = quad(lambda x: density(x) / max(x - u, film), u, 1, points=[u + film, *breaks[1:]], epsabs=1e-9)[0]
    assert dry[0, 0] == pytest.approx(one / force, rel=1e-8)
    assert fluid[0, 0] == pytest.approx(0.3 * v * two / force, rel=1e-7)


def test_without_speed_it_is_dry_coulomb_friction() -> None:
    dry, fluid = lubricated(Polynomial(), [0.1, 0.5, 1.0, 2.0], [0.0], 0.3)
    assert np.allclose(dry, 1, rtol=1e-13) and np.array_equal(fluid, np.zeros((4, 1)))


def test_a_compressed_surface_has_no_fluid_part() -> None:
    """u* = 1 (and beyond): no gap is left that a fluid could fill; the characteristic falls as Fig. 3.6-5 shows."""
    dry, fluid = lubricated(Polynomial(), [1.0, 1.4], np.linspace(0, 10, 11), 0.3)
    assert np.array_equal(fluid, np.zeros((2, 11))) and np.all(np.diff(dry, axis=1) < 0)


@pytest.mark.parametrize("u", [0.25, 0.5, 0.9])
def test_the_fluid_part_diverges_with_the_logarithm_of_the_film(u) -> None:
    """Its slope over log(film) is minus the density p(u) = 6 u (1 - u), times eta v / F."""
    films = np.array([1e-4, 1e-5, 1e-6, 1e-7])
    fluid = [lubricated(Polynomial(), [u], [2.0], 0.1, f)[1][0, 0] for f in films]
    slope = np.polyfit(np.log(films), fluid, 1)[0]
    exact = -0.1 * 2.0 * 6 * u * (1 - u) / (u**3 - 0.5 * u**4)
    assert slope == pytest.approx(exact, rel=3e-4)  # next term: film p'(u)


# smoothed ------------------------------------------------------------------------------------------------------------


def test_smoothed_friction_has_its_slope_at_rest_and_half_of_the_limit_at_1_over_k() -> None:
    assert float(smoothed(value(1 / 300.0), 300.0)) == pytest.approx(0.5, rel=1e-14)
    v = np.array([0.0, 1e-12, 1e-3])
    assert np.allclose(creep(v, 300.0), [2 / np.pi * 300, 2 / np.pi * 300, smoothed(1e-3, 300.0) / 1e-3], rtol=1e-14)
    assert np.all(np.isfinite(jax.vmap(jax.grad(lambda x: creep(x, 300.0)))(v)))


@pytest.mark.parametrize("k", [1e2, 1e4, 1e6, 1e8])
def test_a_smoothed_falling_characteristic_never_reaches_mu_0(k) -> None:
    """(3.7-42), p_v = 100: 1 - peak is 2 sqrt(2 p_v / (pi k)) for large k, where the peak is at sqrt(2/(pi k p_v)):
    both losses, p_v v and 2/(pi k v), are equal there."""
    top, speed = peak(Falling(value(1.0), value(100.0)), k)
    assert top < 1
    if k >= 1e6:
        lost, at = 2 * np.sqrt(200 / (np.pi * k)), np.sqrt(2 / (np.pi * k * 100))
        assert 1 - top == pytest.approx(lost, rel=lost)  # next order of the same expansion
        assert speed == pytest.approx(at, rel=lost)

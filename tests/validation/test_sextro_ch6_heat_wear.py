"""Sextro, Dynamical Contact Problems with Friction, 2nd ed., sections 6.7 and 6.8: temperature and wear.

Beside the equations the text prints the creepages (0 to .06 in steps of .003), "approximately 6 %" for the marching
rule, mu_0 = .38 and gamma_mu = 1400 of Fig. 6.7-6 and the harmonic penetration of Fig. 6.8-2. It prints neither the
contact of its figures (stiffnesses, axis ratio, penetration) nor a measured value, so their ordinates cannot be held
against numbers: what the text says of their shape is. Assumed here: a round patch of steel, a = 5 mm, penetration
.02 a as the mean of Fig. 6.8-2, mu_0 = .3, V = 30 m/s. Tractions are those of the exact half-spaces, whose slip is not
quite that of the book (errata, 6.5-16).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from microslip.data import Array
from microslip.rolling.half_space import HalfSpaceContact, steady_rolling
from microslip.rolling.half_space_influence import Grid, Pair
from microslip.rolling.temperature import Conductor, conducted, falling, heat_source, marched, settled
from microslip.rolling.wear import depth_along, revolution, strip_depth

STEEL, HEAT = Pair(82e9, 0.3), Conductor(50.0, 7850.0, 450.0)
A, V, I = 5e-3, 30.0, 1e-14
GRID = Grid.around(1.1 * A, 1.1 * A, 33, 33)
R = A / 0.02  # a^2 = R delta
DISTANCE = (GRID.x**2 + GRID.y**2) / (2 * R)
MIDDLE = 16


@cache
def rolling(creepage: float) -> HalfSpaceContact:
    """A wheel that is driven: negative creepage."""
    return steady_rolling(DISTANCE, GRID, STEEL, 0.3, approach=0.02 * A, creepages=(-creepage, 0, 0))


def source(creepage: float) -> Array:
    c = rolling(creepage)
    return heat_source(c.traction, c.slip, V)


# temperature -------------------------------------------------------------------------------------------------------


def test_fig_6_7_1_sources_are_zero_in_adhesion_and_elliptic_in_sliding() -> None:
    """At .06 the elastic part of the slip is up to a tenth: q/(mu p_n V s) is even to 11 % away from the edge."""
    c = rolling(0.003)
    q = source(0.003)
    assert c.sticking.any() and q[c.sticking].max() < 1e-4 * q.max()
    even = (source(0.06) / np.where(c.touching, 0.3 * c.pressure * V * 0.06, 1))[c.pressure > 0.3 * c.pressure.max()]
    assert not rolling(0.06).sticking.any() and even == pytest.approx(np.ones_like(even), abs=0.11)
    assert [rolling(s).sticking.any() for s in (0.003, 0.006, 0.012, 0.06)] == [True, True, False, False]


def test_fig_6_7_2_marching_is_exact_for_an_even_source_and_six_per_cent_too_hot_for_an_elliptic_one() -> None:
    """Largest against largest 5.5 %; at the trailing edge itself sqrt(3/2) (errata, 6.7-20)."""
    n = 2000
    x = (np.arange(n) - (n - 1) / 2) * 2 / n
    for q, ratio in ((np.ones(n), 1.0), (np.sqrt(1 - x**2), 1.055)):
        exact, rule = (f(q[:, None], 2 * A / n, HEAT, 0.5, V)[:, 0] for f in (conducted, marched))
        assert rule.max() / exact.max() == pytest.approx(ratio, abs=1e-3)
        assert rule.argmax() == 0
    assert x[exact.argmax()] == pytest.approx(-0.65, abs=0.005)
    assert rule[0] / exact[0] == pytest.approx(np.sqrt(1.5), abs=5e-3)


def test_ertz_and_knothe() -> None:
    """Their full sliding at 1 m/s under 100 kN: 150.3 C by the exact convolution, 158.6 C by the marching rule.

    CONTACT prints 166.8 C; nobody knows why (its grid is not the reason: piecewise sources on it give 150.3 as well).
    With the half-spaces' own slip, which is larger than 1 m/s at the rear, it is 152.3 C.
    """
    a, b = 5.88e-3, 10.54e-3
    grid = Grid(66, 48, 0.2e-3, 0.5e-3)
    for dx, close in ((2 * a / 1000, 0.05), (grid.dx, 0.2)):
        x = np.arange(-1.1 * a, 1.1 * a, dx)[:, None]
        q = 0.3 * 1.5 * 1e5 / (np.pi * a * b) * np.sqrt(np.maximum(1 - (x / a) ** 2, 0)) * 1.0
        assert conducted(q, dx, HEAT, 0.5, V).max() == pytest.approx(150.3, abs=close)
        assert marched(q, dx, HEAT, 0.5, V).max() == pytest.approx(158.6, abs=close)
    h = 1.015 * grid.x**2 + 0.4215 * grid.y**2
    c = steady_rolling(h, grid, Pair(82e9, 0.28), 0.3, force=1e5, creepages=(1 / V, 0, 0))
    assert c.pressure.max() == pytest.approx(770.6e6, rel=1e-3) and V * c.work == pytest.approx(-2.994e4, rel=1e-3)
    own = conducted(heat_source(c.traction, c.slip, V), grid.dx, HEAT, 0.5, V)
    assert own.max() == pytest.approx(152.3, abs=0.1)


def test_fig_6_7_3_temperatures_rise_from_adhesion_to_the_trailing_edge() -> None:
    """By the marching rule; across it, at large slip, as (1 - y^2/b^2)^(3/4), the book's "approximately parabolic"."""
    T = marched(source(0.003), GRID.dx, HEAT, 0.5, V)
    assert T[rolling(0.003).sticking].max() < 1e-2 * T.max()
    far = marched(source(0.06), GRID.dx, HEAT, 0.5, V)
    assert (np.diff(far[:, MIDDLE]) <= 0).all()  # x rises, the material goes the other way
    y = GRID.y[0] / A
    shape = np.maximum(1 - y**2, 0) ** 0.75
    assert far[0] / far[0].max() == pytest.approx(shape, abs=0.07)


def with_heat(creepage: float, cold: float, vanishing: float) -> tuple[float, Array]:
    """F_x/(mu_0 F_n) and temperature with friction that falls with it."""
    last: list[HalfSpaceContact] = []
    grid = Grid.around(1.1 * A, 1.1 * A, 23, 23)
    h = (grid.x**2 + grid.y**2) / (2 * R)

    def heat(mu: Array) -> Array:
        c = steady_rolling(h, grid, STEEL, mu, approach=0.02 * A, creepages=(-creepage, 0, 0))
        last.append(c)
        return heat_source(c.traction, c.slip, V)

    _, T = settled(
        heat,
        lambda q: marched(q, grid.dx, HEAT, 0.5, V),
        lambda T: falling(T, cold, vanishing),
        np.full(h.shape, cold),
        1e-5,
    )
    return float(last[-1].force[0] / (cold * last[-1].force[2])), T


def test_fig_6_7_4_and_5_forces_fall_with_creepage_the_faster_the_steeper_the_friction() -> None:
    cold, mild, steep = ([with_heat(s, 0.3, E)[0] for s in (0.006, 0.06)] for E in (1e9, 2000.0, 700.0))
    assert cold[1] == pytest.approx(1, abs=1e-4) and cold[0] < cold[1]
    assert mild[0] > mild[1] and steep[0] > steep[1]
    assert all(s < m < c for s, m, c in zip(steep, mild, cold, strict=True))


def test_fig_6_7_6_friction_at_the_printed_slope() -> None:
    """mu_0 = .38, gamma_mu = 1400, round patch: T/dT_E = gamma T*, Eqs. (6.7-17), (6.7-23), with c_N0 of Eq. (6.4-40).

    The penetration is not printed, nor the measured curve; with .02 a the force falls to .70 at .06: qualitatively the
    figure, and no number to compare with.
    """
    E = 2 * 1.3 * 82e9
    c_N0 = 2 * E * A / (3 * (1 - 0.3**2))
    unit = 0.5 * 0.38 * c_N0 / 50 * np.sqrt(2 * HEAT.diffusivity * V / A)  # T/T*, Eq. (6.7-17)
    forces = [with_heat(s, 0.38, unit / 1400)[0] for s in (0.012, 0.06)]
    assert forces[0] > forces[1] == pytest.approx(0.7, abs=0.03)


# wear --------------------------------------------------------------------------------------------------------------


def test_fig_6_8_1_depths_behave_like_temperatures_along_x_and_like_a_parabola_across() -> None:
    """Nothing in adhesion, most at the trailing edge; at full slip sum q dx ~ x_A^2, that is 1 - y^2/b^2."""
    z = depth_along(source(0.003), GRID.dx, I, V)
    assert z[rolling(0.003).sticking].max() < 1e-3 * z.max() and (np.diff(z[:, MIDDLE]) <= 0).all()
    across = strip_depth(source(0.06), GRID.dx, I, V)
    y = GRID.y[0] / A
    assert across / across.max() == pytest.approx(np.maximum(1 - y**2, 0), abs=0.05)
    assert np.all(np.diff([strip_depth(source(s), GRID.dx, I, V).max() for s in (0.003, 0.006, 0.03, 0.06)]) > 0)


@cache
def penetrated(approach: float) -> tuple[Array, HalfSpaceContact] | None:
    """Full slip of .06, or the bodies apart."""
    grid = Grid.around(1.8 * A, 1.8 * A, 30, 30)
    h = (grid.x**2 + grid.y**2) / (2 * R)
    c = steady_rolling(h, grid, STEEL, 0.3, approach=approach, creepages=(-0.06, 0, 0))
    return (heat_source(c.traction, c.slip, V), c) if c.touching.any() else None


def test_fig_6_8_2_harmonic_normal_motion_with_separation() -> None:
    """Du* = .02 + .03 sin(delta): apart for arccos(2/3)/pi = .268 of the circle; by Hertz the depth in the middle
    grows as p_0 a ~ Du and the temperature as p_0 sqrt(a) ~ Du^(3/4)."""
    n = 24
    y = np.linspace(-2 * A, 2 * A, 81)
    du = np.round(0.02 + 0.03 * np.sin(2 * np.pi * np.arange(n) / n), 12)
    found = [penetrated(float(u) * A) for u in du]
    dx = 3.6 * A / 30

    def at(k: int) -> tuple[Array, float, float] | None:
        one = found[k]
        return None if one is None else (strip_depth(one[0], dx, I, V), dx, 0.0)

    worn = revolution(at, n, y)
    apart = np.array([one is None for one in found])
    assert apart.mean() == pytest.approx(np.arccos(2 / 3) / np.pi, abs=1 / n) and not worn[apart].any()
    deep = du > 0.01
    assert worn[deep, 40] / worn[:, 40].max() == pytest.approx(du[deep] / 0.05, abs=0.04)
    hot = np.array([0 if one is None else marched(one[0], dx, HEAT, 0.5, V).max() for one in found])
    assert hot[deep] / hot.max() == pytest.approx((du[deep] / 0.05) ** 0.75, abs=0.05)
    work = sum(-one[1].work for one in found if one is not None)
    assert worn.sum() * (y[1] - y[0]) == pytest.approx(I * work, rel=1e-10)


def test_fig_6_8_3_harmonic_lateral_motion() -> None:
    """The worn strip follows the motion; what a revolution takes off is deepest where the motion turns. The amplitude
    is not printed: four half axes here."""
    n, reach = 48, 4 * A
    depth, y = strip_depth(source(0.06), GRID.dx, I, V), np.linspace(-6 * A, 6 * A, 241)
    middles = reach * np.sin(2 * np.pi * np.arange(n) / n)
    worn = revolution(lambda k: (depth, GRID.dy, middles[k]), n, y)
    assert worn @ y / worn.sum(axis=1) == pytest.approx(middles, abs=0.01 * (y[1] - y[0]))
    total = worn.sum(axis=0)
    assert abs(y[total.argmax()]) == pytest.approx(reach, abs=A) and total[120] < 0.6 * total.max()
    assert total == pytest.approx(total[::-1], rel=1e-9, abs=1e-9 * total.max())

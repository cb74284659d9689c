"""Exact half-spaces in contact: influence of a rectangle, pressing, shifting, rolling."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest
from refusals import refused

from microslip.contact.hertz import Hertz
from microslip.contact.solids import Solid
from microslip.data import Array
from microslip.errors import UserError
from microslip.rolling.half_space import (
    HalfSpaceContact,
    linear_coefficients,
    normal_contact,
    pressed,
    rolled,
    shifted,
    steady_rolling,
)
from microslip.rolling.half_space_influence import ALL, Grid, Pair, influence, influence_ahead, rectangle

STEEL = Pair(82e9, 0.28)
UNLIKE = Pair(80e9, 0.3, 0.12)
LOAD, MU = 82000.0, 0.3
CREEP = (3e-4, -4e-4, 0.4)


def ellipse(n: int = 30) -> tuple[Grid, Array]:
    """The undeformed distance of Hertz, whose patch of 16 mm x 8 mm is n/1.25 elements long and wide."""
    grid = Grid.around(10e-3, 5e-3, n, n)
    return grid, 0.8464 * grid.x**2 + 2.406 * grid.y**2


def bumpy(grid: Grid) -> Array:
    """Two patches, or more, of no regular shape."""
    return 0.85 * grid.x**2 + 2.4 * grid.y**2 + 2e-5 * np.cos(900 * grid.x + 0.3) * np.cos(1400 * grid.y - 0.2)


# influence ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("at", [(2.3, -0.4), (-0.7, 1.9)])
def test_influence_of_a_rectangle_is_the_integral_of_boussinesq_and_cerruti(at: tuple[float, float]) -> None:
    """Gauss-Legendre over the rectangle of 1/(pi G R) ((1 - nu) delta + nu x_i x_j/R^2, K x_i/R): nine components."""
    points, weights = np.polynomial.legendre.leggauss(40)
    dx, dy, G, nu, K = 1.0, 0.6, 36.0, 0.3, 0.12
    x, y = at[0] - dx / 2 * points[:, None], at[1] - dy / 2 * points[None]
    R = np.hypot(x, y)
    one, zero = np.ones_like(R), np.zeros_like(R)
    u_x = [(1 - nu) * one + nu * (x / R) ** 2, nu * x * y / R**2, -K * x / R]
    u_y = [nu * x * y / R**2, (1 - nu) * one + nu * (y / R) ** 2, -K * y / R]
    kernel = np.array([u_x, u_y, [K * x / R + zero, K * y / R + zero, (1 - nu) * one]]) / (np.pi * G * R)
    direct = np.einsum("ijxy,x,y->ij", kernel, weights, weights) * dx * dy / 4
    found = rectangle(np.array(at[0]), np.array(at[1]), dx, dy, Pair(G, nu, K))
    assert found == pytest.approx(direct, rel=1e-10, abs=1e-14 / G)


def test_convolution_is_the_sum_over_the_elements() -> None:
    """And of one step ahead: the rectangles seen from there."""
    grid = Grid(5, 7, 1.0, 0.5)
    traction = np.random.default_rng(0).normal(size=(3, 5, 7))
    for step, by in ((0.0, influence(grid, UNLIKE)), (0.4, influence_ahead(grid, UNLIKE, 0.4))):
        direct = np.zeros((3, 5, 7))
        for i, j in np.ndindex(5, 7):
            kernel = rectangle(grid.x - grid.x[i] + step, grid.y - grid.y[0, j], grid.dx, grid.dy, UNLIKE)
            direct += np.einsum("abxy,b->axy", kernel, traction[:, i, j])
        assert by(traction, ALL, ALL) == pytest.approx(direct, abs=1e-13 * np.abs(direct).max())


def test_pair_of_a_body_and_a_rigid_one_has_twice_its_modulus() -> None:
    body, rigid = Solid(2e11, 0.3), Solid(np.inf, 0.1)
    G = body.shear
    assert astuple(Pair.of(body, body)) == pytest.approx((G, 0.3, 0.0))
    assert astuple(Pair.of(rigid, body)) == pytest.approx((2 * G, 0.3, -2 * (1 - 2 * 0.3) / 4))


# normal ------------------------------------------------------------------------------------------------------------


def test_hertz() -> None:
    """Approach and largest pressure of 30 x 30 elements to 0.3 %; the error falls faster than the elements' size."""
    steel = Solid(2 * 1.28 * 82e9, 0.28)
    hertz = Hertz(steel, steel, 0.8464, 2.406)
    exact = np.array([hertz.approach(LOAD), hertz.largest_pressure(LOAD)])
    errors = []
    for n in (15, 30, 60):
        c = pressed(ellipse(n)[1], ellipse(n)[0], STEEL, force=LOAD)
        errors.append(np.abs(np.array([c.approach, c.pressure.max()]) / exact - 1))
    assert (errors[1] < 3e-3).all()
    order = np.log2(errors[0] / errors[2]) / 2
    assert (order > 1).all(), order


@pytest.mark.parametrize("pair", [STEEL, UNLIKE])
def test_nothing_overlaps_and_what_touches_has_no_gap(pair: Pair) -> None:
    """p >= 0, e >= 0, p e = 0 on several patches; the approach gives the same pressure as the force it belongs to."""
    grid = Grid.around(8.8e-3, 4.4e-3, 40, 40)
    c = steady_rolling(bumpy(grid), grid, pair, MU, force=6000.0, creepages=CREEP)
    gap = bumpy(grid) - c.approach + c.displacement[2]
    assert (c.pressure >= 0).all() and c.force[2] == pytest.approx(6000, rel=1e-9)
    assert np.abs(gap[c.touching]).max() < 1e-6 * c.approach and gap[~c.touching].min() > 0
    again = steady_rolling(bumpy(grid), grid, pair, MU, approach=c.approach, creepages=CREEP)
    assert again.pressure == pytest.approx(c.pressure, abs=1e-5 * c.pressure.max())
    assert again.traction == pytest.approx(c.traction, abs=1e-5 * c.pressure.max())


@pytest.mark.parametrize("begun", [1, 2])
def test_a_patch_spreads_from_the_elements_that_touch_first(begun: int) -> None:
    """Loading goes on from a light touch in one element, or in two alike, which no change of pressure among them tells:
    the pressure is that of a fresh start."""
    grid, h = ellipse(14)
    whole = pressed(h, grid, STEEL, force=LOAD)
    light = np.zeros(h.shape)
    light[8 - begun : 8, 7] = 1e6
    before = replace(whole, pressure=light, traction=0 * whole.traction, slip=0 * whole.slip)
    c = shifted(h, grid, STEEL, MU, force=LOAD, before=before)
    assert c.pressure == pytest.approx(whole.pressure, abs=1e-6 * whole.pressure.max())


def test_a_patch_moves_to_where_the_bodies_have_come_near() -> None:
    """Under a given approach what touched lets go and another place joins."""
    grid, h = ellipse(14)
    near = h + 2e-4 * (grid.x > 0)
    c = pressed(near, grid, STEEL, approach=5e-5)
    other = normal_contact(near[::-1], influence(grid, STEEL), grid.area, approach=5e-5, start=c.pressure)[0]
    assert other == pytest.approx(c.pressure[::-1], abs=1e-6 * c.pressure.max())


def test_bodies_apart_feel_nothing() -> None:
    grid, h = ellipse(10)
    c = steady_rolling(h + 1e-3, grid, STEEL, MU, approach=9e-4, creepages=CREEP)
    assert not c.touching.any() and not c.force.any() and c.work == 0


# tangential --------------------------------------------------------------------------------------------------------


def judged(c: HalfSpaceContact) -> None:
    """|p| <= g; no slip below it; slip against the traction at it."""
    size, slip, touching = np.hypot(*c.traction), np.hypot(*c.slip), c.touching
    assert (size <= c.bound * (1 + 1e-6) + 1e-3).all()
    assert slip[c.sticking].max(initial=0) < 1e-6 * slip.max()
    sliding = touching & ~c.sticking
    against = (c.traction * c.slip).sum(axis=0)[sliding]
    assert against == pytest.approx(-(size * slip)[sliding], abs=1e-4 * (size * slip).max())


@pytest.mark.parametrize("pair", [STEEL, UNLIKE])
def test_coulombs_law_holds_at_every_element(pair: Pair) -> None:
    """Steady, transient and shifted, irregular patches, friction that differs from place to place."""
    grid = Grid.around(8.8e-3, 4.4e-3, 34, 34)
    h, mu = bumpy(grid), 0.2 + 10 * np.abs(grid.x) + 0 * grid.y
    steady = steady_rolling(h, grid, pair, mu, force=6000.0, creepages=CREEP)
    moved = shifted(h, grid, pair, mu, force=6000.0, shift=(1e-6, 2e-6, 1e-4))
    moment = rolled(moved, h, mu, force=7000.0, creepages=CREEP, step=3e-4)
    for c in (steady, moved, moment):
        judged(c)
        assert c.sticking.any() and (c.touching & ~c.sticking).any()


@pytest.mark.parametrize("tangential", [(8000.0, None), (-3000.0, 9000.0), (0.0, -24000.0)])
def test_a_given_force_gives_the_creepage_of_that_force(tangential: tuple[float, float | None]) -> None:
    grid, h = ellipse(24)
    c = steady_rolling(h, grid, UNLIKE, MU, force=LOAD, creepages=(0, 1e-4, 0.5), tangential=tangential)
    again = steady_rolling(h, grid, UNLIKE, MU, force=LOAD, creepages=c.motion)
    assert again.force == pytest.approx(c.force, abs=1e-5 * MU * LOAD)
    for k, wanted in enumerate(tangential):
        if wanted is not None:
            assert c.force[k] == pytest.approx(wanted, abs=1e-5 * MU * LOAD)


def test_steady_rolling_is_where_transient_rolling_ends() -> None:
    """It stays there at once, and a shifted contact comes there as it rolls: the difference falls by half a length."""
    grid, h = ellipse(20)
    now = {"distance": h, "friction": MU, "force": LOAD, "creepages": CREEP}
    steady = steady_rolling(h, grid, STEEL, MU, force=LOAD, creepages=CREEP)
    assert rolled(steady, **now).traction == pytest.approx(steady.traction, abs=1e-5 * steady.pressure.max())
    c, away = shifted(h, grid, STEEL, MU, force=LOAD, tangential=(9000, 3000)), []
    for _ in range(4):
        away.append(np.linalg.norm(c.force - steady.force))
        for _ in range(10):
            c = rolled(c, **now)
    assert all(late < 0.5 * early for early, late in zip(away, away[1:], strict=False)), away


def test_mirror() -> None:
    """Left and right exchanged: lateral creepage, spin and their forces change sign, nothing else."""
    grid, h = ellipse(24)
    one = steady_rolling(h, grid, UNLIKE, MU, force=LOAD, creepages=(2e-4, 3e-4, 0.5))
    other = steady_rolling(h, grid, UNLIKE, MU, force=LOAD, creepages=(2e-4, -3e-4, -0.5))
    close = {"abs": 1e-6 * one.pressure.max()}
    assert other.traction[:, :, ::-1] == pytest.approx(one.traction * np.array([1, -1])[:, None, None], **close)


def test_turned_patch_gives_turned_forces() -> None:
    """A shift of a patch and of the same patch turned by a right angle."""
    grid, h = ellipse(21)
    one = shifted(h, grid, UNLIKE, MU, force=LOAD, shift=(4e-6, 1e-6, 1e-4))
    turned = Grid(grid.ny, grid.nx, grid.dy, grid.dx)
    other = shifted(h.T[::-1], turned, UNLIKE, MU, force=LOAD, shift=(-1e-6, 4e-6, 1e-4))
    assert other.force == pytest.approx([-one.force[1], one.force[0], one.force[2]], rel=1e-6)
    assert other.moment == pytest.approx(one.moment, rel=1e-6)


def test_friction_takes_what_the_forces_give_in_steady_rolling() -> None:
    """Power of friction = force times creepage + moment times spin; the difference falls with the elements' size
    (26, 14, 8 %) and goes to zero."""
    excess = []
    for n in (12, 24, 48):
        grid, h = ellipse(n)
        c = steady_rolling(h, grid, STEEL, MU, force=LOAD, creepages=(1.2e-3, -1.6e-3, 0.4))
        given = c.force[:2] @ c.motion[:2] + c.moment * c.motion[2]
        excess.append(1 - c.work / given)
    assert 0 < excess[2] < excess[1] < excess[0] and abs(2 * excess[2] - excess[1]) < 0.015, excess


def test_kalkers_linear_theory_as_creepage_vanishes() -> None:
    """Small creepages of a patch of Hertz that slips only at its edge; 4 % (the moment of spin:
    15 %) is the discretisation of 40 elements."""
    grid, h = ellipse(50)
    C11, C22, C23, C33 = linear_coefficients(2, 0.28, elements=20)
    G, c2 = 82e9, 8e-3 * 4e-3
    x, y, spin = (steady_rolling(h, grid, STEEL, 20.0, force=LOAD, creepages=w) for w in np.diag([1e-5, 1e-5, 1e-3]))
    assert x.force[0] == pytest.approx(-c2 * G * C11 * 1e-5, rel=0.04)
    assert y.force[1] == pytest.approx(-c2 * G * C22 * 1e-5, rel=0.04)
    assert y.moment == pytest.approx(c2**1.5 * G * C23 * 1e-5, rel=0.04)
    assert spin.force[1] == pytest.approx(-(c2**1.5) * G * C23 * 1e-3, rel=0.04)
    assert spin.moment == pytest.approx(-(c2**2) * G * C33 * 1e-3, rel=0.15)


# mistakes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "wrong"),
    [
        ("force", {"force": -1.0}),
        ("force", {}),
        ("friction", {"force": LOAD, "friction": -0.1}),
        ("tangential", {"force": LOAD, "tangential": (25000.0, None)}),
        ("grid", {"force": 40 * LOAD}),
        ("creepages", {"force": LOAD, "creepages": (0, np.nan, 0)}),
        ("creepages", {"force": LOAD, "creepages": (0, 1e-3)}),
        ("creepages", {"force": LOAD, "creepages": (0, 0, 1e9)}),
        ("friction", {"force": LOAD, "friction": np.ones(7)}),
        ("distance", {"force": LOAD, "distance": np.nan}),
        ("force", {"force": "x"}),
        ("approach", {"approach": np.nan}),
        ("creepages", {"force": LOAD, "creepages": "x"}),
        ("tangential", {"force": LOAD, "tangential": (1.0,)}),
        ("tangential", {"force": LOAD, "tangential": ["x", None]}),
    ],
)
def test_mistakes_are_named(key: str, wrong: dict) -> None:
    grid, h = ellipse(12)
    with pytest.raises(UserError, match=f"^(steady_rolling: )?{key}"):
        steady_rolling(**{"distance": h, "grid": grid, "pair": STEEL, "friction": MU} | wrong)


def test_grids_and_coefficients_of_nothing_are_refused() -> None:
    for wrong in ((10.5, 10, 1.0, 1.0), (0, 10, 1.0, 1.0), (10, 10, -1.0, 1.0)):
        refused((), Grid, *wrong)
    for ratio, poisson, elements in ((-1, 0.3, 4), (0, 0.3, 4), (1, 0.7, 4), (1, 0.3, 1)):
        refused((), linear_coefficients, ratio, poisson, elements)

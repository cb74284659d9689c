"""Wear of rolling bodies: depths, maps, profiles that are renewed (Sextro 6.8)."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refused

from microslip.errors import UserError
from microslip.rolling.half_space import pressed, steady_rolling
from microslip.rolling.half_space_influence import Grid, Pair
from microslip.rolling.temperature import heat_source
from microslip.rolling.wear import deposited, depth_along, revolution, shortest_smoothing, smoothed, strip_depth, worn

I, V = 2e-14, 30.0


def test_volume_is_the_coefficient_times_the_work_of_friction() -> None:
    """Over a lateral oscillation with the patch anywhere between the strips of the map: to 1e-10."""
    grid = Grid.around(9e-3, 6e-3, 24, 24)
    h = 0.9 * grid.x**2 + 1.6 * grid.y**2
    c = steady_rolling(h, grid, Pair(82e9, 0.28), 0.3, force=60e3, creepages=(1e-3, 2e-3, 0.3))
    source = heat_source(c.traction, c.slip, V)
    depth = strip_depth(source, grid.dx, I, V)
    n, y = 12, np.linspace(-0.03, 0.03, 81)
    worn_map = revolution(lambda k: (depth, grid.dy, 0.02 * np.sin(2 * np.pi * k / n)), n, y)
    step = 2.9 / n  # rolled from position to position
    volume = worn_map.sum() * (y[1] - y[0]) * step
    assert volume == pytest.approx(-I * c.work * n * step, rel=1e-10)
    assert depth_along(source, grid.dx, I, V).sum(axis=1)[0] == pytest.approx(depth.sum())


def test_depth_grows_from_the_leading_edge() -> None:
    """It is zero ahead of the first source and stays behind the last one."""
    source = np.zeros((6, 1))
    source[2:4] = [[2e8], [1e8]]
    depth = depth_along(source, 1e-3, I, V)[:, 0] / (I / V * 1e-3 * 1e8)
    assert depth == pytest.approx([3, 3, 3, 1, 0, 0])


def test_strips_brought_elsewhere_keep_volume_and_middle() -> None:
    """Finer and coarser strips; onto the same strips unchanged."""
    depth, y = np.array([0.0, 1, 3, 2, 0]) * 1e-9, np.linspace(-5e-3, 5e-3, 101)
    found = deposited(depth, 4e-4, 1.23e-3, y)
    own = 1.23e-3 + 4e-4 * (np.arange(5) - 2)
    assert found.sum() * 1e-4 == pytest.approx(depth.sum() * 4e-4, rel=1e-12)
    assert (found * y).sum() * 1e-4 == pytest.approx((depth * own).sum() * 4e-4, abs=1e-4**2 * depth.sum())
    assert deposited(found, 1e-4, 0.0, y) == pytest.approx(found, abs=1e-22)
    with pytest.raises(UserError, match="^y:"):
        deposited(depth, 4e-4, 4.9e-3, y)


def test_nothing_wears_where_the_bodies_are_apart() -> None:
    found = revolution(lambda k: None if k % 2 else (np.ones(3), 1e-3, 0.0), 4, np.linspace(-5e-3, 5e-3, 11))
    assert not found[1::2].any() and (found[::2].sum(axis=1) == pytest.approx(3))


def test_smoothing_keeps_the_mean_and_damps_waves() -> None:
    """exp(-(k length)^2/2) of a wave; nothing of a straight line's middle."""
    dy, length = 1e-4, 4e-4
    y = dy * np.arange(400)
    for k in (500.0, 3000.0):
        seen = smoothed(np.cos(k * y), dy, length)[100:300]
        assert seen == pytest.approx(np.exp(-((k * length) ** 2) / 2) * np.cos(k * y)[100:300], abs=2e-6)
    uneven = np.random.default_rng(0).normal(size=400)
    assert smoothed(uneven, dy, length).sum() == pytest.approx(uneven.sum(), rel=1e-10)
    assert smoothed(uneven, dy, 0.0) is uneven


GAIN, DEPTH, DY = 0.02, 2e-6, 1e-4
"""d ln(depth)/d z'', m; depth between two updates, m; width of a strip, m: dy^2 is a quarter of 4 depth gain/2."""


def by_curvature(z: np.ndarray) -> np.ndarray:
    """Wear that follows the local curvature of the distance: more where it is strongly curved."""
    second = (np.roll(z, 1) - 2 * z + np.roll(z, -1)) / DY**2
    return DEPTH * (1 + GAIN * second)


@pytest.mark.parametrize(("share", "grows"), [(0.0, True), (0.9, True), (1.1, False)])
def test_worn_curvature_amplifies_itself_at_grid_scale_unless_it_is_smoothed(share: float, grows: bool) -> None:
    """Roughness of 1 nm under 60 updates, on a ring of strips: it explodes unsmoothed and dies out beyond the
    shortest smoothing; 10 % below that one it grows."""
    length = share * shortest_smoothing(DEPTH, GAIN)
    start = 1e-9 * np.random.default_rng(3).normal(size=1024)

    def run(z: np.ndarray) -> np.ndarray:
        return by_curvature(z)

    after = worn(run, start, DY, 60, 1.0, length)
    rough = np.std(after[100:-100])  # away from the ends, where smoothing mirrors and the ring goes on
    assert (rough > 10 * np.std(start)) == grows, rough
    if not grows:
        assert rough < np.std(start) and after[100:-100].mean() == pytest.approx(60 * DEPTH, rel=1e-3)


def test_a_profile_that_wears_spreads_its_pressure() -> None:
    """Exact pressing of a worn wheel that slides: every update lowers the largest pressure, and what is worn is the
    coefficient times the work of all runs. 4 p dy/(pi E*) = 5 um at one update are too many without smoothing: a wave
    of two strips then changes its own pressure by more than twice its depth; one strip of smoothing holds 10 um."""
    grid, pair = Grid.around(9e-3, 12e-3, 20, 48), Pair(82e9, 0.28)
    h, slid, done = 0.9 * grid.x**2 + 1.2 * grid.y**2, 0.01, []

    def run(z: np.ndarray) -> np.ndarray:
        c = pressed(h + z, grid, pair, force=80e3)
        done.append((c.pressure.max(), 0.3 * c.force[2] * slid))
        return strip_depth(0.3 * c.pressure * V * slid, grid.dx, I, V)

    new = np.zeros(grid.ny)
    first = run(new).max()
    for update, length, calm in ((3e-6, 0.0, True), (10e-6, 0.0, False), (10e-6, grid.dy, True)):
        done.clear()
        repeats = update / first
        z = worn(run, new, grid.dy, 10, repeats, length)
        largest, work = np.array(done).T
        assert z.sum() * grid.dy == pytest.approx(I * repeats * work.sum(), rel=1e-10)
        assert (largest[-1] < 0.85 * largest[0] and (np.diff(largest[:6]) < 0).all()) == calm, largest


def test_wrong_speed_and_coefficient_are_named() -> None:
    refused("speed: ", strip_depth, np.ones((3, 2)), 1e-3, I, 0.0)
    refused("coefficient: ", strip_depth, np.ones((3, 2)), 1e-3, -I, V)

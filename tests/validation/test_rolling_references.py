"""Rolling contact beside published outputs of CONTACT, open-source version, revision 2707 (E.A.H. Vollebregt, J.J.
Kalker; examples of the public repository, commit d431cdb), and the Manchester wheel-rail benchmark (Shackleton and
Iwnicki 2006). Signs: `docs/rolling.md`.

Where the discretisation is the same, FASTSIM, to the last printed digit; half-space solutions bound what an elliptic
patch and a simplified theory may miss, and the tests say by how much they do.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import microslip as ms
from microslip.contact.solids import Solid
from microslip.rolling.ellipse import combined, ellipses
from microslip.rolling.half_space import steady_rolling
from microslip.rolling.half_space_influence import Grid, Pair
from microslip.rolling.wheelset import Track, across

G, NU = 82e9, 0.28
STEEL = Solid(2 * G * (1 + NU), NU)
ELASTIC = combined(STEEL, STEEL)
SPIN = {"xi": 0.0, "eta": -6.25e-4, "phi": 0.625}
PATCH = {"a": 8e-3, "b": 4e-3, "normal_force": 82e3, "friction": 0.3, "shear": G, "poisson": NU}
PROFILES = Path(__file__).with_name("profiles")


@pytest.mark.parametrize(
    ("bound", "share", "force", "moment", "pressure", "power", "sticks"),
    [
        ("parabolic", -0.6118, -1.505e4, -3.9e4, 1629, -509.3, 738),
        ("elliptic", -0.6016, -1.48e4, -4.829e4, 1223, -694.4, 618),
    ],
)
def test_fastsim_with_spin(bound, share, force, moment, pressure, power, sticks) -> None:
    """A Hertz patch 16 x 8 mm, 40 x 40 elements across it: all printed digits, and the same elements slip."""
    f, t = ms.fastsim(**SPIN, **PATCH, bound=bound)
    count = int((t.pressure > 0).sum())
    found = [f.y / 24600, f.y, 1e3 * f.moment, 1e-6 * t.pressure.max(), -30 * f.power]
    assert [float(f"{v:.4g}") for v in found] == [share, force, moment, pressure, power]
    assert (count, round(count * (1 - f.sliding))) == (1264, sticks)


def test_hertz_patch_of_the_same_example() -> None:
    """A = .8464, B = 2.406 1/m: half axes 8 and 4 mm, approach 0.09266 mm."""
    e = ellipses(0.8464, 2.406, 82e3, ELASTIC.modulus)
    np.testing.assert_allclose([e.a, e.b, e.approach], [8e-3, 4e-3, 9.266e-5], rtol=2e-4)


CURVE = {
    4e-4: (-0.2588, -0.2577, 154),
    1.2e-3: (-0.6482, -0.6281, 444),
    2e-3: (-0.8816, -0.8433, 718),
    3.2e-3: (-0.9976, -0.9770, 1092),
}
"""Longitudinal creepage: F_x/(mu F_N) of the half-space and of FASTSIM, and how many elements of the latter slide."""


def test_creep_curve_of_a_locomotive() -> None:
    """FASTSIM as printed; strips 0.015 of mu F_N from it, most of which is what FASTSIM's first element is too long,
    and 0.05 from the half-space; the non-constant distribution is 0.18 from the half-space."""
    patch = PATCH | {"a": 6.304e-3, "b": 12.61e-3, "normal_force": 106700.0, "friction": 0.33}
    held = 0.33 * 106700
    xi = np.array(list(CURVE))
    half_space, printed, slides = np.array(list(CURVE.values())).T
    for i in range(4):
        f, t = ms.fastsim(xi[i], 0.0, 0.0, **patch, elements=(48, 44))
        assert float(f"{f.x / held:.4f}") == pytest.approx(printed[i], abs=1.1e-4)
        assert round(f.sliding * (t.pressure > 0).sum()) == slides[i]
    strips = {d: ms.creep_forces(xi, 0, 0, **patch, distribution=d).x / held for d in ("constant", "non-constant")}
    assert np.abs(strips["constant"] - printed).max() < 0.015
    assert np.abs(strips["constant"] - half_space).max() < 0.05
    assert np.abs(strips["non-constant"] - half_space).max() < 0.18


def test_strips_with_spin_beside_the_half_space() -> None:
    """F_y/(mu F_N) = -0.6074 of the half-space: strips of both distributions are within 0.05, the book's spin, which
    has no C23 of its own, is 0.14 and 0.3 away."""
    found = {
        (d, s): ms.creep_forces(**SPIN, **PATCH, distribution=d, spin=s).y[0] / 24600 + 0.6074
        for d in ("constant", "non-constant") for s in ("kalker", "book")
    }  # fmt: skip
    assert all(abs(found[d, "kalker"]) < 0.05 for d in ("constant", "non-constant"))
    assert 0.1 < found["constant", "book"] < 0.15 and 0.25 < found["non-constant", "book"] < 0.32


# lateral mm, yaw mrad, roll rad, pitch rate rad/s; y_r, y_w mm, angle rad; xi, eta, phi 1/mm; F_x, F_s over mu F_n; MPa
MANCHESTER = """
0  0    0.00000000  -4.3481181 | 8.6600 -1.8726 0.0290 | -5.665e-05 0        -6.302e-05 | 9.281e-05 0.08458 | 338.3
1  2.4  -0.00005049 -4.3465752 | 5.2886 -6.2694 0.0176 | -0.0006297 0.0024   -3.848e-05 | 0.2749   -0.9592 | 423.9
3  7.2  -0.00018030 -4.3451503 | 3.2967 -10.3382 0.0110 | -0.001103 0.007197 -2.432e-05 | 0.153    -0.9881 | 498.8
6  14.4 -0.00062720 -4.3293718 | 2.5116 -14.3878 0.0084 | -0.004901 0.01437  -1.957e-05 | 0.3236   -0.9462 | 578.5
10 24   -0.01126431 -4.2436375 | 3.4351 -22.5401 0.0115 | -0.02532  0.02371  -4.883e-05 | 0.7302   -0.6832 | 744
"""
ON_THE_RAIL = {0: (0.2783, -36.24, 1e4), 1: (829.2, -3070, 1e4), 3: (460.5, -3084, 1e4), 6: (973.1, -2929, 1e4),
               10: (2196, -2169, 1e4)}  # fmt: skip
"""F_x, F_y, F_z in track axes, N."""

HEIGHT = {0: 0.1981, 1: 0.1840, 3: 0.1145, 6: -0.1957, 10: -8.2662}
"""z_ws, mm."""


@pytest.mark.parametrize("row", MANCHESTER.strip().splitlines(), ids=lambda row: f"{row.split()[0]} mm")
def test_manchester_benchmark(row: str) -> None:
    """Case A-2.2, left wheel, 10 kN: S1002 on UIC60. Forces there are on the rail, y to the right: F_x changes sign.

    Position 0.02 mm, creepages 1 %, forces 2 % of mu F_n, pressure 2 %. The pose y = 0 has a patch 17 mm wide that is
    no ellipse, whose creepage changes along it: 0.05 mm, 2 %, 0.067 and 5 %.
    """
    pose, place, creep, force, pressure = ([float(v) for v in part.split()] for part in row.split("|"))
    track = Track(ms.read_profile(PROFILES / "MBench_S1002_v3.prw"), ms.read_profile(PROFILES / "MBench_UIC60_v3.prr"),
                  0.46, 0.75, 0.7605326, ELASTIC)  # fmt: skip
    at = ms.Pose(pose[0] / 1e3, pose[1] / 1e3, pose[2], 2.0, -pose[3])
    (p,) = ms.patches(track, at, "left", 1e4, 0.3)
    f = ms.creep_forces(p.xi, p.eta, p.phi, p.a, p.b, p.normal_force, 0.3, G, NU)
    long = pose[0] == 0
    np.testing.assert_allclose([-1e3 * p.on_rail, -1e3 * p.on_wheel], place[:2], atol=0.05 if long else 0.02)
    assert p.angle == pytest.approx(place[2], abs=1e-4)
    np.testing.assert_allclose([-p.xi, p.eta, p.phi / 1e3], creep, rtol=0.02 if long else 0.01, atol=1e-9)
    found = np.array([-f.x[0], f.y[0]]) / (0.3 * p.normal_force)
    np.testing.assert_allclose(found, force, atol=0.067 if long else 0.02)
    assert 1e-6 * p.pressure == pytest.approx(pressure[0], rel=0.05 if long else 0.02)
    normal = float(EXACT.strip().splitlines()[list(ON_THE_RAIL).index(int(pose[0]))].split()[0])
    assert p.normal_force == pytest.approx(normal, rel=5e-4)
    on_wheel = p.felt(f.x[0], f.y[0], f.moment[0], np.zeros(3))
    assert on_wheel[2] == pytest.approx(-1e4, rel=1e-6)
    np.testing.assert_allclose(-on_wheel[:3], ON_THE_RAIL[int(pose[0])], atol=(0.067 if long else 0.02) * 3e3)
    assert 1e3 * (p.axle[1] + 0.46) == pytest.approx(HEIGHT[int(pose[0])], abs=0.02)


@pytest.mark.parametrize("row", MANCHESTER.strip().splitlines(), ids=lambda row: f"{row.split()[0]} mm")
def test_manchester_roll_is_that_of_equal_forces(row: str) -> None:
    """The benchmark turned the axle until both wheels carried 10 kN, friction included."""
    lateral, yaw, roll, pitch = (float(v) for v in row.split("|")[0].split())
    track = Track(ms.read_profile(PROFILES / "MBench_S1002_v3.prw"), ms.read_profile(PROFILES / "MBench_UIC60_v3.prr"),
                  0.46, 0.75, 0.7605326, ELASTIC)  # fmt: skip
    at = ms.Pose(lateral / 1e3, yaw / 1e3, 0.0, 2.0, -pitch)
    left, right, pose = ms.axle(track, at, 2e4, even=True, friction=0.3)
    assert pose.roll == pytest.approx(roll, abs=2.5e-6)
    for p in (*left, *right):
        f = ms.creep_forces(p.xi, p.eta, p.phi, p.a, p.b, p.normal_force, 0.3, G, NU)
        assert p.lifted(f.y[0]) == pytest.approx(1e4, rel=1e-5)


# F_n N, friction included; M_n N mm; touching, sticking elements; friction power W
EXACT = """
9997  4605  1291 943 -0.4677
10050 376   916  0   -14.45
10030 80.74 766  0   -43.31
10020 41.57 658  0   -90.59
10020 32.16 515  0   -205.6
"""


@pytest.mark.parametrize("row", range(5), ids=lambda i: f"{MANCHESTER.strip().splitlines()[i].split()[0]} mm")
def test_manchester_benchmark_by_exact_half_spaces(row: int) -> None:
    """On the profiles themselves and the printed elements of 0.2 mm: forces to 0.2 % of mu F_n, pressure and power to
    0.3 %, elements to 2 %, moment about the printed point to 3 N mm or 0.2 %. What is
    left is how both programs read the profiles."""
    pose, place, _, force, pressure = (
        [float(v) for v in part.split()] for part in MANCHESTER.strip().splitlines()[row].split("|")
    )
    normal, moment, touching, sticking, power = (float(v) for v in EXACT.strip().splitlines()[row].split())
    track = Track(ms.read_profile(PROFILES / "MBench_S1002_v3.prw"), ms.read_profile(PROFILES / "MBench_UIC60_v3.prr"),
                  0.46, 0.75, 0.7605326, ELASTIC)  # fmt: skip
    at = ms.Pose(pose[0] / 1e3, pose[1] / 1e3, pose[2], 2.0, -pose[3])
    (p,) = ms.patches(track, at, "left", 1e4)
    y, apart = across(track, at, "left", p)
    grid = Grid(76, 120, 2e-4, 2e-4)
    h = p.A * grid.x**2 + np.interp(grid.y - place[0] / 1e3 - p.on_rail, y, apart, left=1.0, right=1.0)
    c = steady_rolling(h, grid, Pair(G, NU), 0.3, normal, creepages=(p.xi, p.eta, p.phi))
    assert np.array([-1, 1]) * c.force[:2] / (0.3 * normal) == pytest.approx(force, abs=0.002)
    assert 1e3 * c.moment == pytest.approx(moment, rel=0.002, abs=3)
    assert (1e-6 * c.pressure.max(), p.speed * c.work) == pytest.approx((pressure[0], power), rel=0.003)
    assert (c.touching.sum(), c.sticking.sum()) == pytest.approx((touching, sticking), rel=0.02)

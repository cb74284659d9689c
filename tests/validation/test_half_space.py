"""The exact half-space solver against closed forms and against printed numbers of CONTACT.

Where the discretisation is the same the answers agree to the last printed digit: the open version of CONTACT, revision
2707 of 2025-07-23 (E.A.H. Vollebregt, J.J. Kalker), in its units mm, N, MPa, W. A closed form outranks it. Its cases
that roll towards -x are mirrored here: x, F_x and xi change sign.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from microslip.contact.hertz import Hertz
from microslip.contact.solids import Solid
from microslip.data import Array
from microslip.rolling.half_space import HalfSpaceContact, linear_coefficients, pressed, rolled, shifted, steady_rolling
from microslip.rolling.half_space_influence import Grid, Pair

STEEL = Pair(82e9, 0.28)
PEERS = Path(__file__).parents[1] / "peers"
TAMAAS = Path(__file__).parents[2] / "build" / "peers" / "tamaas" / "bin" / "python"


def prints(value: float, text: str) -> bool:
    """Whether a value is printed so: half of the last digit, and 1 % of it for both programs' rounding."""
    digits = text.lower().split("e")[0].lstrip("-").partition(".")[2]
    exponent = int(text.lower().split("e")[1]) if "e" in text.lower() else 0
    return abs(value - float(text)) <= 0.51 * 10.0 ** (exponent - len(digits))


def agrees(found: dict[str, float], printed: str) -> None:
    """All of them, in their order."""
    wrong = {k: (v, p) for (k, v), p in zip(found.items(), printed.split(), strict=True) if not prints(v, p)}
    assert not wrong, wrong


def elements(c: HalfSpaceContact) -> tuple[int, int, int]:
    """In contact, sticking, slipping."""
    stick = int(c.sticking.sum())
    return int(c.touching.sum()), stick, int(c.touching.sum()) - stick


# Carter ------------------------------------------------------------------------------------------------------------


def carter(n: int) -> tuple[HalfSpaceContact, Grid]:
    """A cylinder of 500 mm, half contact width 1 mm, stick zone .6 of it; n elements and four more; 200 mm wide."""
    dx = 2e-3 / n
    grid = Grid(n + 4, 1, dx, 0.2)
    return steady_rolling(grid.x**2, grid, STEEL, 0.3, force=35780.0, creepages=(-2.4e-4, 0, 0)), grid


def test_carter_as_printed() -> None:
    dx = 4e-5
    grid = Grid(54, 1, dx, 0.2, x0=-1.05e-3 + 26.5 * dx)
    c = steady_rolling(grid.x**2, grid, STEEL, 0.3, force=35780.0, creepages=(-2.4e-4, 0, 0))
    found = {"F_x": c.force[0] / (0.3 * 35780), "p_max": c.pressure.max() / 1e6, "power": 30 * c.work}
    agrees(found, "0.6480 113.9 -47.62")
    assert abs(c.energy - 0.1162) < 6e-5 and elements(c) == (50, 30, 20)  # 0.11625 is printed as 0.1162
    at = [2, 7, 14, 20, 22, 26, 32, 38, 44, 49, 51]
    p_n = dict(enumerate(c.pressure[at, 0] / 1e6))
    agrees(p_n, "28.2 72.7 99.3 110 112 114 111 101 80.2 47.2 13.0")
    agrees(dict(enumerate(c.traction[0, at, 0] / 1e6)), "8.47 21.8 29.8 33.1 28.3 19.5 13.8 10.0 6.77 3.79 2.09")


def test_carter_converges_to_the_closed_form() -> None:
    """F_x = .64 mu F_n and the traction of Carter; both errors are of first order (fitted: .997 to 1.017)."""
    errors = []
    for n in (50, 100, 200):
        c, grid = carter(n)
        x = grid.x[:, 0] * 1e3
        p0 = 2 * 178.9 / np.pi  # N/mm^2

        def circle(s: Array, half: float) -> Array:
            return half * np.sqrt(np.maximum(1 - (s / half) ** 2, 0))

        exact = 0.3 * p0 * 1e6 * (circle(x, 1.0) - circle(x - 0.4, 0.6))
        errors.append([c.force[0] / (0.3 * 35780) - 0.64, np.abs(c.traction[0, :, 0] - exact).mean() / (0.3e6 * p0)])
    order = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    assert order == pytest.approx(np.ones((2, 2)), abs=0.05)


def test_from_cattaneo_to_carter() -> None:
    """A shifted cylinder that begins to roll with a given force reaches Carter's creepage and traction after two
    contact widths; its trailing edge slips from the first moment."""
    n, force = 26, 0.64 * 0.3 * 35780
    grid = Grid(n + 4, 1, 2e-3 / n, 0.2)
    now = {"distance": grid.x**2, "friction": 0.3, "force": 35780.0, "tangential": (force, None)}
    c = shifted(grid=grid, pair=STEEL, **now)
    assert elements(c)[1] == pytest.approx(0.6 * n, abs=2)  # Cattaneo: |x| < sqrt(1 - .64) a sticks, in the middle
    assert not c.sticking[2] and not c.sticking[-3]
    creepages = []
    for _ in range(2 * n):
        c = rolled(c, **now)
        creepages.append(c.motion[0])
    steady = steady_rolling(grid=grid, pair=STEEL, **now)
    assert steady.motion[0] == pytest.approx(-2.4e-4, rel=0.03)
    assert creepages[-1] == pytest.approx(steady.motion[0], rel=1e-3)
    assert c.traction == pytest.approx(steady.traction, abs=1e-3 * steady.pressure.max())
    assert c.sticking[-3] and not c.sticking[2]  # it sticks from the leading edge on


ONSET = """
1 1.824E-03 422 199 1.472E-05 -1.188E-04   2 1.882E-03 420 201 1.474E-05 -1.266E-04
3 1.955E-03 416 205 1.476E-05 -1.373E-04   4 2.050E-03 406 215 1.478E-05 -1.519E-04
5 2.140E-03 405 216 1.480E-05 -1.655E-04   6 2.221E-03 395 226 1.482E-05 -1.792E-04
7 2.334E-03 390 231 1.483E-05 -1.987E-04   8 2.428E-03 382 239 1.485E-05 -2.155E-04
9 2.551E-03 375 246 1.486E-05 -2.385E-04   10 2.676E-03 365 256 1.487E-05 -2.631E-04
11 2.801E-03 352 269 1.487E-05 -2.892E-04  12 2.968E-03 346 275 1.487E-05 -3.240E-04
13 3.184E-03 323 298 1.487E-05 -3.739E-04  14 3.403E-03 319 302 1.486E-05 -4.277E-04
15 3.402E-03 330 291 1.485E-05 -4.250E-04  16 3.334E-03 328 293 1.484E-05 -4.075E-04
17 3.241E-03 341 280 1.483E-05 -3.827E-04  18 3.192E-03 341 280 1.483E-05 -3.699E-04
19 3.123E-03 343 278 1.483E-05 -3.528E-04  20 3.112E-03 348 273 1.483E-05 -3.497E-04
21 3.088E-03 348 273 1.483E-05 -3.438E-04  22 3.072E-03 350 271 1.483E-05 -3.400E-04
23 3.064E-03 350 271 1.483E-05 -3.379E-04  24 3.062E-03 350 271 1.483E-05 -3.373E-04
25 3.064E-03 348 273 1.483E-05 -3.376E-04  26 3.070E-03 348 273 1.483E-05 -3.390E-04
27 3.077E-03 348 273 1.483E-05 -3.406E-04
"""
"""Step, creepage, elements that stick and slip, elastic energy (J), power of friction (W at 1000 mm/s)."""


def test_onset_of_rolling_as_printed() -> None:
    """From the shift of Cattaneo to steady rolling, step by step of an element for a patch's length: `catt_to_cart` of
    the same program, after Kalker (1990) 5.2.2.5, Fig. 5.25. A ball, 28 elements over the patch, G = 1, F_x =
    -0.657 mu F_n all the way; the creepage overshoots by a ninth on its way."""
    grid, mu, load = Grid(35, 33, 0.25, 0.25), 0.4013, 0.4705
    now = {"distance": 0.002963 * (grid.x**2 + grid.y**2), "friction": mu, "force": load,
           "tangential": (-0.657 * mu * load, None)}  # fmt: skip
    c = shifted(grid=grid, pair=Pair(1.0, 0.28), **now)
    assert elements(c) == (621, 305, 316)
    agrees({"shift": c.motion[0], "approach": c.approach, "p_max": c.pressure.max(), "energy": 1e-3 * c.energy,
            "work": 1e-3 * c.work}, "1.774E-02 7.258E-02 1.834E-02 1.470E-05 -1.261E-07")  # fmt: skip
    for step, creepage, stick, slip, energy, power in np.reshape(ONSET.split(), (-1, 6)):
        c = rolled(c, **now)
        assert elements(c) == (621, int(stick), int(slip)), step
        agrees({"xi": c.motion[0], "energy": 1e-3 * c.energy, "power": c.work}, f"{creepage} {energy} {power}")


# Cattaneo ----------------------------------------------------------------------------------------------------------


def cattaneo(n: int, reach: float) -> HalfSpaceContact:
    """A ball of 50 mm, a = 1 mm, F_x = -7/8 mu F_n: the inner half of the radius sticks."""
    grid = Grid.around(reach, reach, n, n)
    force = -7 / 8 * 0.4 * 9.1954
    return shifted(10 * (grid.x**2 + grid.y**2), grid, Pair(200e6, 0.42), 0.4, force=9.1954, tangential=(force, None))


def test_cattaneo_as_printed() -> None:
    c = cattaneo(19, 1.26667e-3)
    found = {"shift": c.motion[0] * 1e3, "approach": c.approach * 1e3, "p_max": c.pressure.max() / 1e6}
    found |= {"F_x": c.force[0], "energy": c.energy, "work": c.work}
    agrees(found, "8.155e-3 0.01998 4.393 -3.218 8.525e-05 -2.75e-06")
    assert elements(c) == (177, 45, 132)


def test_cattaneo_converges_to_the_closed_form() -> None:
    """The traction; the closed form leaves out a small p_y and is no exact solution: 0.5 % of the shift stays."""
    errors = []
    for n in (19, 38, 76):
        c = cattaneo(n, 1.26667e-3)
        r = np.hypot(c.grid.x, c.grid.y) * 1e3
        exact = -1.756e6 * (np.sqrt(np.maximum(1 - r**2, 0)) - np.sqrt(np.maximum(0.25 - r**2, 0)))
        errors.append(np.abs(c.traction[0] - exact).mean() / 1.756e6)
    assert c.motion[0] == pytest.approx(8.17e-6, rel=5e-3)
    assert errors[-1] < 0.5 * errors[0] and errors[-1] < 0.01, errors


# Bentall and Johnson -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mu", "share", "printed", "counted"),
    [
        (0.0001, 0.0, "0.000526 0.002081 103.1 0.01645 -0.0001156", (200, 1, 199)),
        (10.0, 0.0, "0.0003591 0.00208 103.8 0.01644 0", (200, 200, 0)),
        (0.05, 0.0, "0.0004294 0.00208 103.6 0.01644 -0.009475", (200, 125, 75)),
        (0.05, 0.75, "0.0002108 0.00208 103.2 0.01647 -0.1955", (200, 36, 164)),
        (0.05, -0.75, "0.0005392 0.002081 103.3 0.01647 -0.04418", (201, 106, 95)),
    ],
)
def test_unlike_rollers_as_printed(mu: float, share: float, printed: str, counted: tuple[int, int, int]) -> None:
    """Aluminium on steel: pressing alone makes them creep, .457 kappa a/R = 5.259e-4 without friction."""
    pair = Pair.of(Solid(2 * 1.31 * 23e9, 0.31), Solid(2 * 1.28 * 82e9, 0.28))
    agrees({"G": pair.shear / 1e6, "nu": pair.poisson, "K": pair.mismatch}, "35924 0.3034 0.100")
    grid, F = Grid(216, 1, 1e-6, 1.0), 16201.9
    c = steady_rolling(20 * grid.x**2, grid, pair, mu, force=F, tangential=(-share * mu * F, None))
    found = {"xi": -c.motion[0], "approach": c.approach * 1e3, "p_max": c.pressure.max() / 1e6}
    agrees(found | {"energy": c.energy, "power": c.work}, printed)
    assert elements(c) == counted
    if mu == 0.0001:
        assert -c.motion[0] == pytest.approx(5.259e-4, rel=1e-3)


# a patch of Hertz --------------------------------------------------------------------------------------------------


def test_one_patch_with_spin_as_printed() -> None:
    grid, full = Grid.around(8.8e-3, 4.4e-3, 44, 44), 0.3 * 82000
    h = 0.8464 * grid.x**2 + 2.406 * grid.y**2
    c = steady_rolling(h, grid, STEEL, 0.3, force=82000.0, creepages=(0, -6.25e-4, 0.625))
    found = {"share": c.force[1] / full, "F_y": c.force[1], "M_z": c.moment * 1e3, "p_max": c.pressure.max() / 1e6}
    agrees(found | {"power": 30 * c.work}, "-0.6074 -1.494e4 -4.821e4 1223 -540.4")
    assert elements(c) == (1276, 356, 920)


@pytest.mark.parametrize(
    ("xi", "printed", "counted"),
    [
        (0.0004, "-0.2588 -29.67 640.7", (1384, 1182, 202)),
        (0.0012, "-0.6482 -256.1 640.7", (1384, 782, 602)),
        (0.0020, "-0.8816 -596.4 640.7", (1384, 422, 962)),
        (0.0032, "-0.9976 -1096 640.7", (1384, 32, 1352)),
    ],
)
def test_creep_curve_as_printed(xi: float, printed: str, counted: tuple[int, int, int]) -> None:
    """Eurosprinter: a/b = .5, wheel of 625 mm."""
    steel, F = Solid(2 * 1.28 * 82e9, 0.28), 106700.0

    def off(B: float) -> float:
        a, b = Hertz(steel, steel, 0.8, B).semi_axes(F)
        return float(a / b) - 0.5

    grid = Grid(48, 44, 0.2889e-3, 0.6304e-3)
    h = 0.8 * grid.x**2 + brentq(off, 0.1, 0.8) * grid.y**2
    c = steady_rolling(h, grid, STEEL, 0.33, force=F, creepages=(xi, 0, 0))
    agrees({"F_x": c.force[0] / (0.33 * F), "power": 10 * c.work, "p_max": c.pressure.max() / 1e6}, printed)
    assert elements(c) == counted


def test_creep_force_converges() -> None:
    """The patch with spin: 44 x 44 elements are 3 % of F_y below the limit, and the error halves with the elements."""
    forces = []
    for n in (22, 44, 88):
        grid = Grid.around(8.8e-3, 4.4e-3, n, n)
        h = 0.8464 * grid.x**2 + 2.406 * grid.y**2
        c = steady_rolling(h, grid, STEEL, 0.3, force=82000.0, creepages=(0, -6.25e-4, 0.625))
        forces.append(c.force[1] / (0.3 * 82000))
    first, second = np.diff(forces)
    assert np.log2(first / second) == pytest.approx(1, abs=0.35), forces
    assert forces[1] / (forces[2] + second) == pytest.approx(0.97, abs=0.01)


@pytest.mark.parametrize(
    ("ratio", "nu", "printed"),
    [
        (0.3, 0.0, (2.68, 2.68, 0.607)),
        (0.3, 0.5, (4.80, 2.81, 0.889)),
        (1.0, 0.25, (4.12, 3.67, 1.47)),
        (2.0, 0.25, (5.10, 4.90, 2.62)),
        (1 / 0.3, 0.5, (7.34, 7.51, 5.01)),
    ],
)
def test_kalkers_coefficients(ratio: float, nu: float, printed: tuple[float, float, float]) -> None:
    """Table E.3 of Kalker (1990) to 1 %: his three digits, and what is left after extrapolation from 80 elements."""
    assert linear_coefficients(ratio, nu)[:3] == pytest.approx(printed, rel=0.01)


# another program ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.skipif(not TAMAAS.is_file(), reason="tamaas is not installed: make peers")
def test_pressing_agrees_with_tamaas() -> None:
    """tamaas 2.9 on the same wavy surface and rectangles: nine digits of every pressure."""
    n, side = 64, 2.6e-3 / 64
    grid = Grid(n, n, side, side)
    h = grid.x**2 / 0.1 + grid.y**2 / 0.18 + 2e-6 * np.cos(2e4 * grid.x) * np.cos(1.5e4 * grid.y)
    c = pressed(h, grid, Pair.of(Solid(2e11, 0.3), Solid(np.inf, 0.3)), force=500.0)
    job = {"distance": h.tolist(), "side": side, "young": 2e11, "poisson": 0.3, "force": 500.0}
    command = [str(TAMAAS), str(PEERS / "pressed_half_space.py")]
    said = subprocess.run(command, input=json.dumps(job), capture_output=True, text=True, check=True, timeout=120)
    theirs = np.array(json.loads(said.stdout.splitlines()[-1])["pressure"])
    assert theirs == pytest.approx(c.pressure, abs=1e-9 * c.pressure.max())

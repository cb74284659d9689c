"""Numbers and the picture of docs/half_space.md."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from microslip.contact.hertz import Hertz
from microslip.contact.solids import Solid
from microslip.rolling.half_space import HalfSpaceContact, linear_coefficients, pressed, steady_rolling
from microslip.rolling.half_space_influence import Grid, Pair
from microslip.rolling.temperature import Conductor, conducted, heat_source, marched
from microslip.rolling.wear import smoothed, strip_depth, worn

Table = tuple[list[str], list[list[Any]]]
STEEL, LOAD, MU = Pair(82e9, 0.28), 82000.0, 0.3


def patch(n: int) -> tuple[Grid, Any]:
    """The patch of 16 mm x 8 mm on n x n elements, which reach a tenth beyond it, and its undeformed distance."""
    grid = Grid.around(8.8e-3, 4.4e-3, n, n)
    return grid, 0.8464 * grid.x**2 + 2.406 * grid.y**2


def with_spin(n: int) -> HalfSpaceContact:
    grid, h = patch(n)
    return steady_rolling(h, grid, STEEL, MU, force=LOAD, creepages=(0, -6.25e-4, 0.625))


def convergence() -> Table:
    """Errors over the number of elements; those of the force and of the power against their extrapolation."""
    steel = Solid(2 * 1.28 * 82e9, 0.28)
    hertz = Hertz(steel, steel, 0.8464, 2.406)
    found = {n: with_spin(n) for n in (22, 44, 88, 176)}
    finest, finer = found[176], found[88]
    force = 2 * finest.force[1] - finer.force[1]
    power = 2 * finest.work - finer.work
    rows = []
    for n, c in found.items():
        carter = steady_rolling(*carter_case(n), STEEL, MU, force=35780.0, creepages=(-2.4e-4, 0, 0))
        given = c.force[1] * c.motion[1] + c.moment * c.motion[2]
        errors = (
            c.approach / hertz.approach(LOAD) - 1, carter.force[0] / (0.64 * MU * 35780) - 1,
            c.force[1] / force - 1, c.work / power - 1, c.work / given - 1,
        )  # fmt: skip
        rows.append([f"{n} x {n}", *(f"{100 * e:+.2g} %" for e in errors)])
    head = ["elements", "approach, Hertz", "force, Carter (n x 1)", "force with spin", "power with spin"]
    return [*head, "power against force times creepage"], rows


def carter_case(n: int) -> tuple[Any, Grid]:
    grid = Grid(n + 4, 1, 2e-3 / n, 0.2)
    return grid.x**2, grid


def coefficients() -> Table:
    """Kalker's coefficients for three of Poisson's ratios."""
    rows = []
    for ratio in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0):
        found = np.array([linear_coefficients(ratio, nu) for nu in (0.0, 0.25, 0.5)])
        rows.append([f"{ratio:g}", *(", ".join(f"{v:.3g}" for v in column) for column in found.T)])
    return ["a/b", "C11", "C22", "C23", "C33"], rows


def worn_profiles() -> Table:
    """Largest pressure, MPa, after 12 updates of a sliding wheel's profile, smoothed as in them (and unsmoothed)."""
    grid = Grid.around(9e-3, 12e-3, 20, 48)
    h = 0.9 * grid.x**2 + 1.2 * grid.y**2

    def run(z: Any) -> Any:
        return strip_depth(MU * pressed(h + z, grid, STEEL, force=80e3).pressure, grid.dx, 1e-14, 1.0)

    first, rows = run(np.zeros(grid.ny)).max(), []
    for depth in (1e-6, 3e-6, 10e-6):
        row = [f"{1e6 * depth:g} µm"]
        for length in (0, grid.dy, 2 * grid.dy):
            z = worn(run, np.zeros(grid.ny), grid.dy, 12, depth / first, length)
            largest = [
                pressed(h + d, grid, STEEL, force=80e3).pressure.max() / 1e6 for d in (smoothed(z, grid.dy, length), z)
            ]
            row.append(" (".join(f"{p:.0f}" for p in largest) + ")" if length else f"{largest[0]:.0f}")
        rows.append(row)
    return ["worn between two updates", "unsmoothed", "over 1 strip", "over 2 strips"], rows


def timings() -> Table:
    """CPU seconds of one thread, the second call on a grid."""
    rows = []
    for n in (22, 44, 88, 124, 176):
        grid, h = patch(n)
        with_spin(n)
        start = time.process_time()
        pressed(h, grid, STEEL, force=LOAD)
        middle = time.process_time()
        count = int(with_spin(n).touching.sum())
        both = time.process_time() - middle
        each = 1e6 * both / (count * np.log2(count))
        rows.append([str(count), f"{middle - start:.3f}", f"{both:.3f}", f"{each:.0f}"])
    return ["elements in contact", "pressing, s", "steady rolling, s", "us per n log2(n)"], rows


def picture(left: Any, right: Any) -> None:
    """Left: tractions of the patch with spin, where it sticks. Right: temperatures of its middle strip."""
    c = with_spin(44)
    x, y = 1e3 * c.grid.x[:, 0], 1e3 * c.grid.y[0]
    left.contourf(x, y, c.sticking.T, levels=(0.5, 1.5), colors="#7fb0e0")
    left.contour(x, y, c.touching.T, levels=(0.5,), colors="black", linewidths=1)
    few = np.zeros_like(c.touching)
    few[1::3, 1::3] = True
    i, j = np.nonzero(few & c.touching)
    left.quiver(x[i], y[j], *(c.traction[:, i, j] / c.bound.max()), color="black", scale=16, width=0.005)
    left.set_xlabel("x in mm, rolling to the right")
    left.set_ylabel("y in mm")
    steel = Conductor(50.0, 7850.0, 450.0)
    source = heat_source(c.traction, c.slip, 30.0)
    row = c.grid.ny // 4
    for rule, style, name in ((conducted, "-", "exact"), (marched, "--", "marched")):
        T = rule(source, c.grid.dx, steel, 0.5, 30.0)[:, row]
        right.plot(x, T, style, color="black", lw=1, label=name)
    right.set_xlabel("x in mm")
    right.set_ylabel(f"K at y = {y[row]:.1f} mm")
    right.legend(frameon=False, handlelength=1.1, borderaxespad=0)

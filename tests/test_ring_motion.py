"""The whole ring of a case at a resonance: every sector's displacement, and how it is drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sector
import small

import microslip as ms
from microslip.case.assemble import Built
from microslip.data import Array
from microslip.operating.cycle import at_time
from microslip.stages.ring import ring_motion

N, ORDER = 6, 5
LAW = {"law": "smooth", "points": [2, 2], "normal_stiffness": 2e8, "tangential_stiffness": 2e8, "friction": 0.3}
RING = {"ring": {"blades": N, "engine_order": ORDER}, "harmonics": 3, "samples": 48}
DISC = RING | {
    "body": "sector", "excitation": "gas", "amplitude": 200.0, "monitor": "tip", "direction": "y",
    "contacts": [LAW | {"interface": "rim", "normal_force": 60.0}],
}  # fmt: skip
BLADE = RING | {
    "body": "small", "excitation": "shaker", "amplitude": 30.0, "monitor": "tip-probe", "direction": "x",
    "contacts": [LAW | {"interface": "right", "against": "left", "against_sector": 1, "normal_force": 60.0}],
}  # fmt: skip
CASES = [(DISC, {"sector": sector.basis()}, 4700.0), (BLADE, {"small": small.basis()}, 1100.0)]


def solved(case: dict[str, Any], bases: dict[str, Any], hertz: float, model: str) -> tuple[Built, list[Array]]:
    """The assembly, and the harmonics (H + 1, n, 3) of the displacement of its body in every sector."""
    built = ms.assemble(case | {"ring": case["ring"] | {"model": model}}, **bases)
    series = ms.harmonic_response(built, [hertz])
    assert series.converged.all()
    (moving,) = ring_motion(built, series, 0).values()
    return built, [moving(j) for j in range(N)]


def turned(a: Array, sectors: int = 1) -> Array:
    """Vectors (..., 3) turned by so many sectors about y, which carries z towards x."""
    x, y, z = np.moveaxis(a, -1, 0)
    c, s = np.cos(2 * np.pi * sectors / N), np.sin(2 * np.pi * sectors / N)
    return np.stack([c * x + s * z, y, c * z - s * x], axis=-1)


@pytest.mark.parametrize(("case", "bases", "hertz"), CASES, ids=["disc", "blades"])
def test_every_sector_of_a_ring_from_one_is_that_of_the_whole_ring(
    case: dict[str, Any], bases: dict[str, Any], hertz: float
) -> None:
    """1e-7 of the largest, every node, every harmonic: N sectors with coordinates of their own know no wave."""
    one, whole = (solved(case, bases, hertz, model)[1] for model in ("sector", "full"))
    largest = np.abs(np.array(one)[:, 1]).max()
    np.testing.assert_allclose(one, whole, rtol=0, atol=1e-7 * largest)
    assert np.abs(np.array(one)[:, 3]).max() > 1e-4 * largest  # it slides


@pytest.mark.parametrize(("case", "bases", "hertz"), CASES, ids=["disc", "blades"])
def test_the_wave_of_an_engine_order_stands_in_space(case: dict[str, Any], bases: dict[str, Any], hertz: float) -> None:
    """Turned by one sector the rotor puts sector j where j + 1 was, and there it moves as that one did: the vibration
    is omega t = 2 pi e / N further. So the wave runs against the rotation if e < N/2, with it above."""
    _, sectors = solved(case, bases, hertz, "sector")
    later = 2 * np.pi * ORDER / N
    for j in range(N - 1):
        then = turned(at_time(sectors[j], later, axis=0))
        np.testing.assert_allclose(then, at_time(sectors[j + 1], 0.0, axis=0), rtol=0, atol=1e-9 * np.abs(then).max())
    u, moment = sectors[0][1], 0.7  # one harmonic, written out
    for j in range(N):
        expected = turned((u * np.exp(1j * (moment + j * ORDER * 2 * np.pi / N))).real, j)
        found = (sectors[j][1] * np.exp(1j * moment)).real
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(u).max())

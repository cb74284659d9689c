"""The whole ring of a case at a resonance: every sector's displacement, and how it is drawn."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sector
import small

import microslip as ms
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
CASES: dict[str, tuple[dict[str, Any], Any, float]] = {
    "sector": (DISC, sector.basis, 4700.0), "small": (BLADE, small.basis, 1100.0)
}  # fmt: skip
BODIES = ["sector", pytest.param("small", marks=pytest.mark.slow)]


@cache
def solved(body: str, model: str) -> Array:
    """(N, H + 1, n, 3) harmonics of the displacement of the body of a case in every sector."""
    case, basis, hertz = CASES[body]
    built = ms.assemble(case | {"ring": case["ring"] | {"model": model}}, **{body: basis()})
    series = ms.harmonic_response(built, [hertz])
    assert series.converged.all()
    (moving,) = ring_motion(built, series, 0).values()
    return np.array([moving(j) for j in range(N)])


def turned(a: Array, sectors: int = 1) -> Array:
    """Vectors (..., 3) turned by so many sectors about y, which carries z towards x."""
    x, y, z = np.moveaxis(a, -1, 0)
    c, s = np.cos(2 * np.pi * sectors / N), np.sin(2 * np.pi * sectors / N)
    return np.stack([c * x + s * z, y, c * z - s * x], axis=-1)


@pytest.mark.parametrize("body", BODIES)
def test_every_sector_of_a_ring_from_one_is_that_of_the_whole_ring(body: str) -> None:
    """1e-7 of the largest, every node, every harmonic: N sectors with coordinates of their own know no wave."""
    one, whole = solved(body, "sector"), solved(body, "full")
    largest = np.abs(one[:, 1]).max()
    np.testing.assert_allclose(one, whole, rtol=0, atol=1e-7 * largest)
    assert np.abs(one[:, 3]).max() > 1e-4 * largest  # it slides


@pytest.mark.parametrize("body", BODIES)
def test_the_wave_of_an_engine_order_stands_in_space(body: str) -> None:
    """Turned by one sector the rotor puts sector j where j + 1 was, and there it moves as that one did: the vibration
    is omega t = 2 pi e / N further. So the wave runs against the rotation if e < N/2, with it above."""
    sectors = solved(body, "sector")
    later = 2 * np.pi * ORDER / N
    for j in range(N - 1):
        then = turned(at_time(sectors[j], later, axis=0))
        np.testing.assert_allclose(then, at_time(sectors[j + 1], 0.0, axis=0), rtol=0, atol=1e-9 * np.abs(then).max())
    u, moment = sectors[0][1], 0.7  # one harmonic, written out
    for j in range(N):
        expected = turned((u * np.exp(1j * (moment + j * ORDER * 2 * np.pi / N))).real, j)
        found = (sectors[j][1] * np.exp(1j * moment)).real
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(u).max())


@pytest.mark.slow
def test_the_ring_is_drawn_with_as_much_ahead_as_behind(tmp_path: Path) -> None:
    """One nodal diameter has two halves of opposite sign: as many red places as blue ones, to a quarter."""
    pytest.importorskip("pyvista")
    from PIL import Image

    from microslip import pictures
    from microslip.stages.ring import draw_ring

    if (reason := pictures.can_draw()) is not None:
        pytest.skip(reason)
    case, basis, hertz = CASES["sector"]
    built = ms.assemble(case, sector=basis())
    series = ms.harmonic_response(built, [hertz])
    path = draw_ring(built, series, {"frequency_Hz": hertz, "normal_force_N": 60.0}, tmp_path / "ring.png")
    assert path is not None
    seen = np.asarray(Image.open(path).convert("RGB"), dtype=int)[:-120]  # without the bar and the words
    red, blue = (((seen[..., a] - seen[..., b]) > 60).sum() for a, b in ((0, 2), (2, 0)))
    assert min(red, blue) > 500
    assert red / blue == pytest.approx(1.0, abs=0.25)

"""Stresses of a body in a response file: at the resonances, over frequency and normal force, in pictures and files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small import basis as small_basis

from microslip.assessment import (
    Resonance,
    assess,
    draw,
    families,
    has_stresses,
    over_engine_order,
    over_force,
    write_shape,
)
from microslip.operating import MaterialLimits
from microslip.operating.stress import cycle_stress
from microslip.results import Body, Response, response_of

LIMITS = MaterialLimits(fatigue_strength=300e6, tensile_strength=900e6)
GROUP = small_basis().groups[0, 0]


def resonant(damping: float) -> dict[float, dict]:
    """The first mode of the small beam under its shaker on a grid, and the point at resonance, marked."""
    points = {}
    omega, row = GROUP.omega[0], GROUP.excitations["shaker"].rows[0]
    tip = GROUP.monitors["tip-probe"].rows
    for share in (0.9, 0.95, 1.0, 1.05, 1.1):
        Omega = share * omega
        q = np.zeros((2, GROUP.n_modes), dtype=complex)
        q[1] = row / (GROUP.omega**2 - Omega**2 + 2j * damping * GROUP.omega * Omega)
        f = Omega / 2 / np.pi
        points[f] = {
            "frequency": f, "status": "converged", "peak": int(share == 1.0), "bodies/beam/q": q,
            "monitors/tip-probe": tip @ q.T,
        }  # fmt: skip
    return points


@pytest.fixture(scope="module")
def response() -> Response:
    forces = {1.0: 0.01, 10.0: 0.04, 100.0: 0.02}
    head = {
        "case": "beam",
        "bodies": {"beam": vars(Body("small", "0" * 64, "basis.h5", 0, 0.0, ((0, False), (0, False))))},
        "parameters": {f"normal force {n:g} N": {"normal_force": n} for n in forces},
    }
    return response_of(head, {f"normal force {n:g} N": resonant(d) for n, d in forces.items()})


def test_resonances_and_their_stresses(response: Response) -> None:
    """At resonance amplitude and stress go with one over the damping, 5 %: the second mode, at 1.5 times
    the frequency and pushed twice as hard, swings along."""
    assert has_stresses(small_basis(), response)
    found = assess(response, small_basis(), "tip-probe")
    a = {r.normal_force: r for r in found.resonances}
    assert sorted(a) == [1.0, 10.0, 100.0]
    assert a[1.0].frequency == pytest.approx(GROUP.frequency[0])
    assert a[1.0].worst.amplitude / a[10.0].worst.amplitude == pytest.approx(4.0, rel=0.05)
    assert a[1.0].amplitude / a[100.0].amplitude == pytest.approx(2.0, rel=0.05)
    assert found.highest is a[1.0]
    motion, cycle = found.at(a[10.0])
    assert cycle.amplitude.max() == a[10.0].worst.amplitude == cycle_stress(motion).amplitude.max()
    assert [list(row) for row in found.table()][0] == [
        "normal_force_N", "frequency_Hz", "amplitude_m", "stress_amplitude_Pa", "mean_stress_Pa", "at_mm",
    ]  # fmt: skip
    with_limits = assess(response, small_basis(), "tip-probe", limits=LIMITS).table()[0]
    assert with_limits["vibration_may_grow"] == pytest.approx(300e6 / a[1.0].worst.amplitude, rel=1e-6)


def test_pictures_and_files_of_an_assessment(response: Response, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    import meshio

    from microslip.pictures import can_draw

    found = assess(response, small_basis(), "tip-probe", limits=LIMITS)
    scenes = can_draw() is None
    drawn = draw(found, small_basis(), "beam", tmp_path, scenes)
    names = {"stress over frequency", "stress over normal force", "Haigh diagram"} | (
        {"stress at resonance"} if scenes else set()
    )
    assert set(drawn) == names and all(p.stat().st_size > 5000 for p in drawn.values())
    path = write_shape(found, small_basis(), tmp_path / "shape.vtu")
    assert path is not None
    assert meshio.read(path).point_data["stress_amplitude"].max() == pytest.approx(
        found.resonances[0].worst.amplitude, rel=1e-5
    )


def test_a_response_without_resonances(response: Response, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    points = {f: p | {"peak": 0} for f, p in resonant(0.01).items()}
    head = {"case": "beam", "bodies": {"beam": vars(response.bodies["beam"])}}
    found = assess(response_of(head, {"free": points, "none": {}}), small_basis(), "tip-probe")
    assert (
        found.highest is None and found.table() == [] and write_shape(found, small_basis(), tmp_path / "s.vtu") is None
    )
    assert set(draw(found, small_basis(), "beam", tmp_path, False)) == {"stress over frequency"}


def test_resonances_are_followed_over_the_normal_force(response: Response) -> None:
    """Two that rise by less than a quarter a step stay apart, the nearest go on; one that is there once is its own."""
    from dataclasses import replace

    found = assess(response, small_basis(), "tip-probe")
    one = found.resonances[0]
    places = {10.0: (85.0, 90.0, 200.0), 100.0: (100.0, 210.0), 1000.0: (112.0, 230.0, 500.0)}
    many = [replace(one, normal_force=n, frequency=f) for n, fs in places.items() for f in fs]
    lines = {k: [r.frequency for r in v] for k, v in families(replace(found, resonances=tuple(many))).items()}
    assert lines == {
        "near 112 Hz": [112.0, 100.0, 90.0], "near 230 Hz": [230.0, 210.0, 200.0], "near 500 Hz": [500.0],
        "near 85 Hz": [85.0],
    }  # fmt: skip


def test_the_most_stressed_resonance_is_never_left_out(response: Response) -> None:
    """One that is there at a single normal force is drawn if it is the highest there, and left out if it is not."""
    from dataclasses import replace

    found = assess(response, small_basis(), "tip-probe")
    one = found.resonances[0]

    def at(normal: float, frequency: float, stress: float) -> Resonance:
        worst = replace(one.worst, amplitude=stress)
        return replace(one, normal_force=normal, frequency=frequency, worst=worst)

    steady = [at(n, 240.0, 5e6) for n in (10.0, 100.0, 1000.0)]
    few = (*steady, at(10.0, 23.0, 8e8), at(100.0, 120.0, 1e6))
    lines = over_force(replace(found, resonances=few))
    assert lines == {"near 240 Hz": [(1000.0, 5.0), (100.0, 5.0), (10.0, 5.0)], "near 23 Hz": [(10.0, 800.0)]}
    assert over_force(replace(found, resonances=few[1:2])) == {}


def test_stress_over_engine_orders(response: Response) -> None:
    """Twice the coordinates, twice the stress and strain; the gauge at the root reads its row."""
    from dataclasses import replace

    series = tuple(
        replace(s, arrays={**s.arrays, "bodies/beam/q": 2 * s.arrays["bodies/beam/q"]}) for s in response.series
    )
    both = {3: response, 5: replace(response, series=series)}
    curves, gauge = (over_engine_order(both, small_basis(), gauge=g) for g in ("", "root"))
    assert sorted(curves) == [1.0, 10.0, 100.0]
    for found in (curves, gauge):
        orders, values = found[10.0]
        assert list(orders) == [3, 5] and values[1] == pytest.approx(2 * values[0], rel=1e-9)
    q = response.one(normal_force=1.0).arrays["bodies/beam/q"][:, 1]
    told = 1e6 * np.abs(q @ GROUP.gauges["root"].rows[0]).max()
    assert gauge[1.0][1][0] == pytest.approx(told, rel=1e-12)


def test_long_sweeps_are_drawn_by_some_of_their_points() -> None:
    """At most 400 of 5000 points and those beside a resonance; all of a short sweep."""
    from microslip.assessment import drawn_points
    from microslip.results import Series

    peak = np.zeros(5000)
    peak[1234] = 1
    chosen = drawn_points(Series("a", {}, np.arange(5000.0), ("converged",) * 5000, {"peak": peak}))
    assert 400 < len(chosen) < 445 and {0, 1214, 1234, 1254, 4999} <= set(chosen)
    short = Series("a", {}, np.arange(300.0), ("converged",) * 300, {})
    assert len(drawn_points(short)) == 300

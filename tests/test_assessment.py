"""Stresses of a body in a response file: at the resonances, over frequency and normal force, in pictures and files."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from small import basis as small_basis

from microslip.operating import MaterialLimits
from microslip.operating.stress import cycle_stress, stress_peaks
from microslip.results import Body, Response, response_of
from microslip.stages.assessment import (
    Assessment,
    _ranges,
    assess,
    draw,
    families,
    has_stresses,
    over_force,
    write_shape,
)

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
        "normal_force_N", "frequency_Hz", "amplitude_m", "stress_amplitude_Pa", "frequency_of_stress_Hz",
        "mean_stress_Pa", "location_mm", "singular_stress_amplitude_Pa", "singular_location_mm",
    ]  # fmt: skip
    with_limits = assess(response, small_basis(), "tip-probe", limits=LIMITS).table()[0]
    assert with_limits["reserve_factor"] == pytest.approx(300e6 / a[1.0].worst.amplitude, rel=1e-6)


def test_what_is_not_valid_is_no_worst_resonance_and_is_drawn_as_such(response: Response, tmp_path: Path) -> None:
    """The most stressed resonance is one of another normal force, unless all would lift off."""
    from microslip.pictures.operating import over_normal_force_plot
    from microslip.pictures.plots import save

    found = assess(response, small_basis(), "tip-probe")
    worst = found.highest
    assert worst is not None
    others = replace(found, not_valid=frozenset({worst.normal_force})).highest
    assert others is not None
    assert others.normal_force != worst.normal_force and others.worst.amplitude < worst.worst.amplitude
    every = frozenset(r.normal_force for r in found.resonances)
    assert replace(found, not_valid=every).highest == worst
    lines = {"one": [(1.0, 5.0), (2.0, 1.0), (4.0, 3.0)]}
    draws = [partial(over_normal_force_plot, lines, "y", "t", lifted=off) for off in ((), (2.0,))]
    files = [save(draw, tmp_path / f"{i}.png") for i, draw in enumerate(draws)]
    assert files[0].read_bytes() != files[1].read_bytes()


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


def along(found: Assessment, places: dict[float, dict[float, tuple[float, float]]]) -> Assessment:
    """Resonances by normal force: frequency -> the ends of its range."""
    one = found.resonances[0]
    many = [replace(one, normal_force=n, frequency=f, range=ends) for n, at in places.items() for f, ends in at.items()]
    return replace(found, resonances=tuple(many))


def test_resonances_are_followed_over_the_normal_force(response: Response) -> None:
    """Each goes on in the range of another, the nearest first, however far it moves; one in no range is its own."""
    found = along(assess(response, small_basis(), "tip-probe"), {
        1000.0: {112.0: (50.0, 160.0), 230.0: (160.0, 400.0), 500.0: (400.0, 600.0)},
        100.0: {100.0: (50.0, 150.0), 210.0: (150.0, 600.0)},
        10.0: {62.0: (50.0, 68.0), 70.0: (68.0, 120.0), 200.0: (120.0, 600.0)},
    })  # fmt: skip
    lines = {k: [r.frequency for r in v] for k, v in families(found).items()}
    assert lines == {
        "near 112 Hz": [112.0, 100.0, 70.0], "near 230 Hz": [230.0, 210.0, 200.0], "near 500 Hz": [500.0],
        "near 62 Hz": [62.0],
    }  # fmt: skip


def test_no_resonance_is_left_out_over_the_normal_force(response: Response) -> None:
    """Neither one that is there at a single normal force, nor one that a small force moves by more than a quarter, nor
    one whose frequency is another's in four digits; names rise with the frequency."""
    beside = {1000.0: {112.04: (112.03, 160.0)}, 100.0: {112.01: (50.0, 112.02)}}
    lines = families(along(assess(response, small_basis(), "tip-probe"), beside))
    assert list(lines) == ["near 112.01 Hz", "near 112.04 Hz"]
    whole, low, high = (50.0, 400.0), (50.0, 180.0), (180.0, 400.0)
    found = along(assess(response, small_basis(), "tip-probe"), {
        1000.0: {240.0: whole}, 100.0: {120.0: low, 240.0: high}, 10.0: {80.0: low, 240.0: high},
    })  # fmt: skip
    lines = over_force(found)
    assert {name: [n for n, _ in line] for name, line in lines.items()} == {
        "near 240 Hz": [1000.0, 100.0, 10.0], "near 120 Hz": [100.0, 10.0],
    }  # fmt: skip
    assert over_force(along(found, {1.0: {5.0: whole}, 2.0: {5.0: whole}})) == {}


def test_the_stress_of_a_resonance_is_the_largest_of_its_range(response: Response) -> None:
    """Two modes, of which the probe sees the first one best and the second one strains the body more, on its flank:
    the table's stress is that of the sweep's most stressed point, its frequency named, and the pictures are of it."""
    tip, q = GROUP.monitors["tip-probe"].rows, np.zeros((2, GROUP.n_modes), dtype=complex)
    first = np.abs(tip[0]).argmax()
    second = next(i for i in range(GROUP.n_modes) if i != first and abs(tip[0, i]) < 0.3 * abs(tip[0, first]))
    points = {}
    for f in [*np.arange(90.0, 131.0), 100.5]:
        a = q.copy()
        a[1, first] = 1e-4 / (1 + 1j * (f - 100.5))
        a[1, second] = 2e-4 / (1 + 1j * (f - 107))
        own = {"frequency": f, "status": "converged", "peak": int(f == 100.5)}
        points[float(f)] = own | {"bodies/beam/q": a, "monitors/tip-probe": tip @ a.T}
    head = {"case": "beam", "bodies": {"beam": vars(response.bodies["beam"])}}
    found = assess(response_of(head, {"one": points}), small_basis(), "tip-probe")
    ((series, motion, *_),) = found.sweeps.values()
    stress = stress_peaks(motion).amplitude
    (r,) = found.resonances
    assert r.frequency == 100.5 and r.stressed_at == 107.0 == series.frequency[stress.argmax()]
    assert (
        r.worst.amplitude == pytest.approx(stress.max(), rel=1e-6)
        and stress.max() > 1.5 * stress[list(series.frequency).index(100.5)]
    )
    assert found.table()[0]["frequency_of_stress_Hz"] == 107.0
    assert found.at(r)[1].amplitude.max() == pytest.approx(stress.max(), rel=1e-6)


@pytest.mark.parametrize(("between", "rows"), [(0.995, 1), (0.98, 2)])
def test_a_plateau_has_one_row(response: Response, between: float, rows: int) -> None:
    """Two peaks that were searched for, with a dip of 0.5 % or of 2 % of the lower one between them."""
    base = next(iter(resonant(0.01).values()))
    heights = {90.0: 0.5, 99.0: 1.0, 100.0: between, 101.0: 1.002, 110.0: 0.4}
    points = {
        f: base | {"frequency": f, "peak": int(a >= 1), "bodies/beam/q": a * base["bodies/beam/q"],
                   "monitors/tip-probe": a * base["monitors/tip-probe"]}
        for f, a in heights.items()
    }  # fmt: skip
    head = {"case": "beam", "bodies": {"beam": vars(response.bodies["beam"])}}
    found = assess(response_of(head, {"one": points}), small_basis(), "tip-probe").table()
    assert len(found) == rows and found[-1]["frequency_Hz"] == found[-1]["frequency_of_stress_Hz"] == 101.0


@pytest.mark.parametrize(("contacts", "said"), [(24, "1 of 24 contacts are shown"), (1, "")])
def test_a_picture_of_some_contacts_says_how_many(response: Response, tmp_path, monkeypatch, contacts, said) -> None:
    from microslip.pictures import operating

    titles: list[str] = []
    monkeypatch.setattr(operating, "contact_map_plot", lambda maps, title, figure: titles.append(title))
    found = assess(response, small_basis(), "tip-probe")
    draw(found, small_basis(), "beam", tmp_path, False, {"contacts at resonance": [object()]}, contacts)
    assert titles[0].partition("\n")[2] == said


def test_long_sweeps_are_drawn_by_some_of_their_points() -> None:
    """At most 400 of 5000 points and those beside a resonance; all of a short sweep."""
    from microslip.results import Series
    from microslip.stages.assessment import drawn_points

    peak = np.zeros(5000)
    peak[1234] = 1
    chosen = drawn_points(Series("a", {}, np.arange(5000.0), ("converged",) * 5000, {"peak": peak}))
    assert 400 < len(chosen) < 445 and {0, 1214, 1234, 1254, 4999} <= set(chosen)
    short = Series("a", {}, np.arange(300.0), ("converged",) * 300, {})
    assert len(drawn_points(short)) == 300


def test_the_stress_of_another_mode_is_not_that_of_a_resonance():
    """Two resonances, at points 2 and 9; the stress between them is lowest at 5, the read-out (not asked) near 8, where
    the second one stresses the body more than the first does anywhere. Points 4 and 7 are not drawn, 6 is not known."""
    stress = np.array([1.0, 3, 5, 3, 2, 1, 9, 4, 8, 9, 7])
    chosen, known = np.array([0, 1, 2, 3, 5, 6, 8, 9, 10]), np.arange(11) != 6
    ranges = _ranges(stress[chosen], chosen, known, np.array([2, 9]))
    assert [list(r) for r in ranges] == [[0, 1, 2, 3, 4, 5], [5, 7, 8, 9, 10]]

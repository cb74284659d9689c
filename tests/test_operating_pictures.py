"""Pictures of a steady vibration: they are made, show what they are told to, and say what does not fit on an axis."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from small import basis as small_basis

pytest.importorskip("matplotlib")

from microslip.operating import MaterialLimits, motion_of
from microslip.operating.fatigue import endurance
from microslip.operating.motion import displacement
from microslip.operating.stress import cycle_stress
from microslip.pictures import operating
from microslip.pictures.plots import figure_of, save

LIMITS = MaterialLimits(fatigue_strength=300e6, tensile_strength=900e6, yield_strength=700e6)


def motion(harmonics: int = 1):
    group = small_basis((0.0, 3000.0)).groups[1, 0]
    q = np.zeros((harmonics + 1, group.n_modes), dtype=complex)
    q[1, 0], q[1, 1], q[-1, 2] = 2e-4, 1e-4j, 1e-5
    return motion_of(900.0, q, group)


def dark(path) -> float:
    """Share of a picture that is not white."""
    from PIL import Image

    return float((np.asarray(Image.open(path).convert("L")) < 250).mean())


def test_curves(tmp_path):
    f = np.linspace(100, 200, 50)
    curves = {n: (f, np.where(f > 190, np.nan, n / (1 + (f - 150) ** 2))) for n in (1.0, 10.0, 100.0)}
    peaks = {"first": [(0.0, 9.0), (1.0, 3.0), (10.0, 1.0), (99.0, 5.0)]}
    shown = [
        save(partial(operating.over_frequency_plot, curves, "amplitude in µm", "t"), tmp_path / "a.png"),
        save(partial(operating.over_normal_force_plot, peaks, "y", "t"), tmp_path / "b.png"),
    ]
    assert all(0.01 < dark(p) < 0.6 for p in shown)


def test_a_legend_rises_and_is_read_by_rows():
    """The smallest normal force is named first; eight in two rows."""
    f = np.linspace(100, 200, 5)
    curves = {float(n): (f, n + f) for n in range(1, 9)}
    (legend,) = figure_of(partial(operating.over_frequency_plot, curves, "y", "t")).legends
    told = [int(text.get_text().split()[-2]) for text in legend.get_texts()]
    columns = [told[i : i + 2] for i in (0, 2)] + [[n] for n in told[4:]]
    assert [c[0] for c in columns] + [c[1] for c in columns if len(c) > 1] == list(range(1, 9))


def test_curves_that_coincide_are_all_seen_and_what_is_missing_is_marked():
    """Each is thinner than the one it covers; a cross for every point without a solution, told once and last."""
    f = np.linspace(100, 200, 5)
    y = np.array([1.0, np.nan, 3, 4, 5])
    curves = {1.0: (f, y), 2.0: (f, y), 3.0: (f, f)}
    figure = figure_of(partial(operating.over_frequency_plot, curves, "y", "t"))
    lines = figure.axes[0].get_lines()
    drawn = [line.get_linewidth() for line in lines if line.get_label().startswith("$F_N$")]
    assert drawn == sorted(set(drawn), reverse=True) and len(drawn) == 3
    crosses = [line.get_xydata() for line in lines if line.get_marker() == "x"]
    assert [list(c[:, 0]) for c in crosses] == [[125.0], [125.0]] and crosses[0][0, 1] != crosses[1][0, 1]
    assert [t.get_text() for t in figure.legends[0].get_texts()].count("did not converge") == 1


def test_words_beside_the_places_tell_their_range():
    cycle = cycle_stress(motion())
    share = np.linspace(0, 1, len(cycle.mean))
    low = replace(cycle, amplitude=1e6 * share, mean=1.4e6 * share - 4e5)
    figure = figure_of(partial(operating.haigh_plot, low, LIMITS, endurance(low, LIMITS), "t"))
    assert any("mean stress -0.4 to 1 MPa" in text.get_text() for text in figure.axes[0].texts)


def test_haigh_diagram(tmp_path):
    cycle = cycle_stress(motion())
    worst = endurance(cycle, LIMITS)
    assert 0.01 < dark(save(partial(operating.haigh_plot, cycle, LIMITS, worst, "t"), tmp_path / "h.png")) < 0.6
    still = replace(cycle, amplitude=0 * cycle.amplitude)
    save(partial(operating.haigh_plot, still, LIMITS, endurance(still, LIMITS), "t"), tmp_path / "h.png")


@pytest.mark.parametrize("harmonics", [1, 3])
def test_the_body_is_drawn_where_it_is_farthest_out(harmonics):
    moving = motion(harmonics)
    n = small_basis().mesh.n_points
    shape, size, _ = operating.farthest(moving, n)
    a = displacement(moving, np.arange(n))[0]
    t = 2 * np.pi * np.arange(3000) / 3000
    turn = np.exp(1j * np.multiply.outer(t, np.arange(1, harmonics + 1)))
    far = np.linalg.norm(np.tensordot(turn, a[1:], axes=1).real, axis=2).max()
    assert np.linalg.norm(shape, axis=1).max() == size == pytest.approx(far, rel=1e-2)


@pytest.mark.parametrize(
    "joules, words", [(-2.45e-5, "-24.5 µJ"), (2.45e-5, "24.5 µJ"), (-3e-9, "-3 nJ"), (0.0, "0 J")]
)
def test_energy_given_by_a_contact_is_told_in_the_unit_of_energy_lost(joules, words):
    assert operating._energy(joules) == words


def test_a_map_reaches_down_to_what_is_negative():
    """A contact that counts less work than it gives: its map has colours for all of it."""
    from matplotlib.figure import Figure

    for values, limits in (
        ([-2.0, -1.0], (-2.0, 0.0)),
        ([1.0, 2.0], (0.0, 2.0)),
        ([-1.0, 3.0], (-1.0, 3.0)),
        ([0.0, 0.0], (0.0, 1.0)),
    ):
        patch = SimpleNamespace(
            places=np.array([[0.0, 0.0], [1e-3, 0.0]]), dissipated=np.array(values),
            span=lambda _, values=values: (min(values), max(values)),
        )  # fmt: skip
        axes = Figure().subplots()
        operating._map_panel(axes, patch, "dissipated", "energy", 1.0, "J/m²", "BuPu", True, " ")
        assert axes.collections[0].get_clim() == limits


@pytest.mark.slow
def test_stressed_body_and_contact_maps(tmp_path):
    """Three tiles at speed with limits; nothing where the file has no shapes."""
    from test_operating import linear_patch, marched_map

    from microslip.pictures import can_draw

    patch, u0 = linear_patch()
    u = np.zeros((6, 3))
    u[:, 0], u[1, 1] = u0, 2e-5
    side = small_basis().groups[0, 0].interfaces["right"]
    found = marched_map(patch, side, u)
    scattered = replace(found, places=found.places + 1e-4 * np.sin(np.arange(24)).reshape(12, 2))
    draw = partial(operating.contact_map_plot, [found, scattered, found], "t")
    assert dark(save(draw, tmp_path / "m.png")) > 0.05
    if (reason := can_draw()) is not None:
        pytest.skip(reason)
    from microslip.pictures.scene import quiet_vtk
    from microslip.pictures.views import open_studio

    quiet_vtk()
    studio, moving = open_studio(small_basis((0.0, 3000.0))), motion()
    try:
        cycle = cycle_stress(moving)
        tiles = [operating.stress_picture(studio, moving, cycle, "t", limits, 3) for limits in (None, LIMITS)]
        assert tiles[0] is not None and tiles[1] is not None and tiles[1].width > 1.2 * tiles[0].width
        assert operating.stress_picture(studio, moving, replace(cycle, points=cycle.points[:5]), "t") is None
    finally:
        studio.stage.close()

"""Sextro, Dynamical Contact Problems with Friction, 2nd ed., section 5.3: the test blade, first arrangement.

Printed: uncoupled 14.1, 159.55 and 540.61 Hz (first bending, first and second torsion); coupled near 120, 320 and
470 Hz at 780 N. Dimensions are not printed; docs/blade.md says how they were identified and what is assumed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from microslip.case import load_case, run_case
from microslip.case.assemble import build
from microslip.harmonic_balance.reduced import stuck
from microslip.stages.job import open_job
from microslip.stages.meshing import load_mesh, mesh_stage
from microslip.system.assembly import stuck_modes

ROOT = Path(__file__).parents[2]
JENKINS = ["harmonics=1", *(f'contacts.{side}.law={{kind="jenkins", slides_along="t2"}}' for side in ("right", "left"))]


@pytest.fixture(scope="module")
def blade(tmp_path_factory):
    from microslip.modal.compute import modal_basis

    job = open_job(ROOT / "geometry/blade", ["output.gauss=false", "mesh.size=16"], tmp_path_factory.mktemp("blade"))
    mesh_stage(job)
    return modal_basis(load_mesh(job)[0], job.settings)


def test_uncoupled_frequencies(blade):
    """0.5 %: the default mesh is converged to 0.3 %, the printed values were met to 0.2 % by a coarser solid."""
    g = blade.groups[0, 0]
    assert g.checks["certified"] == 1
    twist = [f for f, kind in zip(g.frequency, turning(g), strict=True) if kind]
    assert g.frequency[0] == pytest.approx(14.1, rel=5e-3)
    assert twist[0] == pytest.approx(159.55, rel=5e-3)
    assert twist[1] == pytest.approx(540.61, rel=5e-3)


def turning(g):
    """Torsion modes: the two contact faces move against each other along the chord."""
    right, left = (g.interfaces[n].rotation.T @ g.interfaces[n].rows[:3] for n in ("right", "left"))
    along = np.abs(right[1] - left[1])
    return along > 0.2 * (np.abs(right).sum(axis=0) + np.abs(left).sum(axis=0))


def test_mass_is_that_of_the_drawing(blade):
    assert blade.mass == pytest.approx(7850 * (0.475 * 0.077 * 0.005 + 0.088 * 0.077 * 0.005), rel=1e-9)


def test_sticking_frequencies(blade):
    """3 %: between rigid neighbours through the book's c_N0, c_R0 without any tuning; roughness is left out."""
    settings, _ = load_case(ROOT / "pipeline/cases/blade.toml")
    pressed = build(settings, {"blade": blade}).pressed(780.0)
    sticking = stuck(pressed.joined(1), pressed.stiffness)
    for printed in (120.0, 320.0, 470.0):
        assert np.abs(sticking / printed - 1).min() < 0.035


def test_the_first_two_bend_and_the_third_twists(blade):
    """Figs. 5.3-5 and 5.3-6: 120 and 320 Hz "belong to bending and the third resonance frequency at 470 Hz belongs to
    torsional vibrations", seen where the accelerometer is: the angle Psi about the section's centre, and what is left
    of the displacement 30 mm beside it. The angle is that of the section's ends too (1 %: the section hardly warps)."""
    settings, _ = load_case(ROOT / "pipeline/cases/blade.toml")
    pressed = build(settings, {"blade": blade}).pressed(780.0)
    part, points, g = pressed.joined(1), blade.mesh.points, blade.groups[0, 0]
    values, shapes = stuck_modes(part, pressed.stiffness)
    psi, beside = (g.monitors[name].rows[0] @ shapes for name in ("twist", "accelerometer"))
    rear, front = (np.linalg.norm(points - [0.0025, y, 0.285], axis=1).argmin() for y in (-0.0385, 0.0385))
    width, ends = np.diff(points[[rear, front], 1])[0], (g.phi[rear, 0] - g.phi[front, 0]) @ shapes
    third = np.abs(np.sqrt(values) / (2 * np.pi) / 470.0 - 1).argmin()
    assert psi[third] == pytest.approx(ends[third] / width, rel=0.01)
    bends, twists = np.abs(beside + 0.03 * psi), np.abs(0.03 * psi)
    for printed, more, less in ((120.0, bends, twists), (320.0, bends, twists), (470.0, twists, bends)):
        mode = np.abs(np.sqrt(values) / (2 * np.pi) / printed - 1).argmin()
        assert less[mode] < 0.05 * more[mode]


@pytest.mark.slow
def test_friction_lowers_the_first_peak_and_its_frequency(blade):
    """Fig. 5.3-7: with falling normal force the resonance frequency falls; there is an optimum of the amplitude."""
    settings, _ = load_case(
        ROOT / "pipeline/cases/blade.toml",
        [*JENKINS, "sweep.stop=125.0", "sweep.points=71", "sweep.normal_forces=[10.0, 30.0, 780.0]"],
    )
    result = run_case(settings, blade)
    peak = {n: max((a, f) for f, a in found) for n, found in result.resonances.items()}
    assert all(r.converged.all() for r in result.responses.values())
    assert peak[10.0][1] < peak[30.0][1] < peak[780.0][1]
    assert peak[30.0][0] < 0.2 * min(peak[780.0][0], peak[10.0][0])

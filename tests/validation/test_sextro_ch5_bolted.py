"""Sextro, Dynamical Contact Problems with Friction, 2nd ed., section 5.7: two half pipes bolted together.

No number is printed. The bounds are beam theory's for the chosen pipe: torsion from about 170 Hz (open sections) to
1960 Hz (closed tube), bending below the 1480 Hz of Euler and Bernoulli in one piece.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from microslip.basis import read_basis
from microslip.case import load_case, run_case
from microslip.data import ModalBasis
from microslip.stages.job import open_job
from microslip.stages.modal import modes_stage

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs"))
import bolted_study as study  # noqa: E402


@pytest.fixture(scope="module")
def half(tmp_path_factory) -> ModalBasis:
    changes = ["output.gauss=false", "output.nodal_stress=false", "mesh.size=25"]
    return read_basis(modes_stage(open_job(ROOT / "geometry/half-pipe", changes, tmp_path_factory.mktemp("half")))[0])


@pytest.mark.slow
def test_joint_without_shear_and_rigid_joint(half: ModalBasis) -> None:
    """Without shear the halves twist as each of them alone (2 %), above the 170 Hz of thin open sections without
    flanges; the rigid joint's torsion is that of the closed tube, 5 % for its flanges. Bending stays below 930 and
    1480 Hz: real sections ovalise and shear."""
    open_, closed = study.joined(half, 1e4, ratio=1e5), study.joined(half, 1e11)
    alone = half.groups[0, 0].frequency
    assert 170.0 < open_.of("torsion")[0] == pytest.approx(alone[alone > 1.0][0], rel=0.02)
    assert closed.of("torsion")[0] == pytest.approx(1960.0, rel=0.05)
    assert open_.of("bending")[0] < 930.0 < closed.of("bending")[0] < 1480.0


def test_frequencies_rise_with_the_stiffness_and_torsion_most(half: ModalBasis) -> None:
    """Between the bounds; three times the stiffness moves torsion more than twice as far as bending."""
    soft, stiff = study.joined(half, 1e8), study.joined(half, 3e8)
    gain = {name: stiff.of(name)[0] / soft.of(name)[0] - 1 for name in ("bending", "torsion")}
    assert gain["bending"] > 0.05 and gain["torsion"] > 2 * gain["bending"]
    assert min(soft.of("bending")[1], stiff.of("bending")[1]) > 0.9


@pytest.mark.slow
def test_bending_identifies_the_stiffness_and_predicts_torsion(half: ModalBasis) -> None:
    """Of an experiment with another normal stiffness, which bending and torsion hardly feel: 0.1 % in both."""
    truth = study.joined(half, 1.85e8, ratio=4.0)
    k, found = study.fitted(half, truth.of("bending")[0])
    assert k == pytest.approx(1.85e8, rel=1e-3)
    assert found.of("torsion")[0] == pytest.approx(truth.of("torsion")[0], rel=1e-3)


@pytest.mark.slow
def test_the_case_resonates_where_the_sticking_joint_does(half: ModalBasis) -> None:
    """Twelve bolts of 10 kN do not slip under 20 N: bending resonates as in the linear system."""
    linear = study.joined(half, 1.85e8).of("bending")[0]
    band = [f"sweep.start={linear - 8:.1f}", f"sweep.stop={linear + 8:.1f}", "sweep.points=5", "samples=16"]
    settings, _ = load_case(study.CASE, band)
    few = tuple(c.model_copy(update={"points": (1, 2)}) for c in settings.contacts)
    result = run_case(settings.model_copy(update={"contacts": few}), {"upper": half, "lower": half})
    (r,) = result.responses.values()
    assert r.converged.all() and np.all(r.slipping == 0)
    assert result.resonances[1e4][0][0] == pytest.approx(linear, rel=5e-3)

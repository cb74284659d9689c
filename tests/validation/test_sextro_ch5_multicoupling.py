"""Sextro, Dynamical Contact Problems with Friction, 2nd ed., section 5.5, Fig. 5.5-9: shrouds at 800 N and a damper.

Printed: the damper lowers amplitudes by two decades, and the equivalent stress is the better measure.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from microslip.basis import read_basis
from microslip.case import load_case
from microslip.case.assemble import build
from microslip.case.problem import problem_of
from microslip.data import ModalBasis
from microslip.stages.job import open_job
from microslip.stages.modal import modes_stage

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs"))
import ring_study as study  # noqa: E402

CASE = ROOT / "pipeline/cases/multicoupling.toml"


@pytest.fixture(scope="module")
def damped(tmp_path_factory) -> ModalBasis:
    changes = ["output.gauss=false", "mesh.size=24"]
    job = open_job(ROOT / "geometry/blade/damped.toml", changes, tmp_path_factory.mktemp("damped"))
    return read_basis(modes_stage(job)[0])


def test_faces_of_the_damper(damped: ModalBasis) -> None:
    """20 x 10 mm at 285 mm on both sides, normals apart, and the blade's frequencies as without them (0.5 %)."""
    right, left = (damped.groups[0, 0].interfaces[f"damper_{side}"] for side in ("right", "left"))
    np.testing.assert_allclose(right.origin, [0.0025, 0.0, 0.285], atol=1e-9)
    np.testing.assert_allclose(right.extent, [0.020, 0.010], rtol=1e-9)
    np.testing.assert_allclose(left.rotation[0], -right.rotation[0], atol=1e-12)
    assert damped.groups[0, 0].frequency[0] == pytest.approx(14.1, rel=5e-3)


@pytest.mark.slow
def test_the_damper_lowers_amplitudes_by_decades_and_the_stress_by_less(damped: ModalBasis) -> None:
    """At 30 and 100 N, where it does not open much: less than 2 % of the amplitude without a damper, and more than 5 %
    of the stress at 100 N: the accelerometer stands at the damper, the foot does not."""
    settings, _ = load_case(CASE, ["samples=32"])
    few = {"right": (6, 2), "damper_right": (2, 2)}
    own = tuple(c.model_copy(update={"points": few[c.interface]}) for c in settings.contacts)
    built = build(settings.model_copy(update={"contacts": own}), {"blade-damped": damped})
    band = np.linspace(230.0, 280.0, 11)
    thirty, hundred = (study.highest(problem_of(built, n), damped, band) for n in (30.0, 100.0))
    ring = study.ring(damped, (6, 2), samples=32)
    without = study.highest(ring.problem(800.0), damped, np.linspace(100.0, 130.0, 13))
    assert not any(h.failed for h in (thirty, hundred, without))
    assert thirty.amplitude < hundred.amplitude < 0.02 * without.amplitude
    assert thirty.stress < hundred.stress
    assert hundred.stress > 0.05 * without.stress

"""Pictures of docs/results.md: the test blade on a rotor, its stresses at resonance, its contacts in partial slip."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from microslip.case import checkpoint, load_case
from microslip.case.assemble import build
from microslip.case.problem import problem_of
from microslip.data import ModalBasis
from microslip.harmonic_balance.checkpoint import record
from microslip.harmonic_balance.response import operating
from microslip.harmonic_balance.solver import sweep

CASES = Path(__file__).parents[1] / "pipeline" / "cases"
AT_SPEED = ("mesh.size=12", "rotation={speeds_rpm=[3000.0], point=[0.0, 0.0, -250.0]}", "output.gauss=false")
DRIVEN = """--set name=blade-at-3000-rpm --set body=blade-at-speed --set amplitude=3.0 --set sweep.start=120
    --set sweep.stop=240 --set sweep.points=31 --set sweep.normal_forces=[100.0,300.0]""".split()


def maps(basis: ModalBasis, normal: float, hertz: float) -> list[Any]:
    """Contact maps of the rough case at one frequency, reached in a few steps from below."""
    settings, _ = load_case(CASES / "blade-rough.toml", ["harmonics=3"])
    built = build(settings, {b.name: basis for b in settings.components})
    problem = problem_of(built, normal)
    point = sweep(problem, np.linspace(0.9, 1.0, 5) * hertz)[-1]
    if not point.converged:
        raise RuntimeError(point.status)
    return checkpoint.maps_at(built, normal, record(problem, point, operating(problem, point)))

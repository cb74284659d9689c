"""Pictures of docs/results.md: the test blade on a rotor, its stresses at resonance, its contacts in partial slip."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from microslip.case import checkpoint, load_case, run_case
from microslip.case.assemble import build
from microslip.case.problem import problem_of
from microslip.data import ModalBasis
from microslip.harmonic_balance.checkpoint import labels, record
from microslip.harmonic_balance.response import operating
from microslip.harmonic_balance.solver import Point, sweep
from microslip.results import response_of
from microslip.stages.assessment import Assessment, assess

CASES = Path(__file__).parents[1] / "pipeline" / "cases"
AT_SPEED = ("mesh.size=12", "rotation={speeds_rpm=[3000.0], point=[0.0, 0.0, -250.0]}", "output.gauss=false")


def assessed(basis: ModalBasis) -> Assessment:
    """The stresses of the blade case round its first resonance, driven by 3 N."""
    changes = ["sweep.start=120", "sweep.stop=240", "sweep.points=61", "amplitude=3.0"]
    settings, raw = load_case(CASES / "blade.toml", changes)
    result = run_case(settings, basis, CASES / "blade.toml")
    name = next(iter(result.built.bodies))
    head = checkpoint.head_of(result.built, raw, {name: ""}, {name: ""})
    points: dict[str, dict[float, dict[str, Any]]] = {}
    for normal, r in result.responses.items():
        problem = problem_of(result.built, normal)
        solved = [Point(2 * np.pi * f, x, s, 0.0, 0) for f, x, s in zip(r.frequency, r.x, r.status, strict=True)]
        rows = [record(problem, p, operating(problem, p)) for p in solved]
        points[checkpoint.series_name(normal)] = {row["frequency"]: row for row in rows}
    told = {"parameters": {name: {"normal_force": n} for name, n in zip(points, result.responses, strict=True)}}
    response = response_of({**head, **told, "labels": labels(problem)}, points)
    return assess(response, basis, settings.monitor or "", limits=settings.material_limits)


def maps(basis: ModalBasis, normal: float, hertz: float) -> list[Any]:
    """Contact maps of the rough case at one frequency, reached in a few steps from below."""
    settings, _ = load_case(CASES / "blade-rough.toml")
    built = build(settings, {b.name: basis for b in settings.components}, CASES / "blade-rough.toml")
    problem = problem_of(built, normal)
    point = sweep(problem, np.linspace(0.9, 1.0, 5) * hertz)[-1]
    if not point.converged:
        raise RuntimeError(point.status)
    return checkpoint.maps_at(built, normal, record(problem, point, operating(problem, point)))

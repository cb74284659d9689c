"""Whether the points of a response are stable: their largest Floquet multipliers as a table, a
picture and a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..analysis import Answer
from ..case.problem import forces_of, problem_of
from ..data import Array
from ..errors import UserError, in_its_file
from ..files import store
from ..files.tables import write_columns
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.stability import Settings, Stability, orbit, stability
from ..pictures.following import stability_plot
from ..report.response import number_tables
from ..results import Journal, read_response
from ..results.journal import once
from .answer import CaseJob, Written, made
from .stage import Stage

TABLE = "stability.csv"


@in_its_file
def stability_of_points(case: CaseJob) -> Written:
    """Of every converged point of the case's ``response.h5``; each is kept the moment it is found.

    Raises:
        UserError: a sector that stands for a ring, whose sectors may part company; the book's mode.
    """
    case = replace(case, swept=True)
    ring = case.settings.ring
    if ring is not None and ring.model == "sector":
        raise UserError(
            '"sector" cannot tell whether the sectors stay alike; write model = "full"',
            "ring.model",
        )
    if case.settings.mode == "book":
        raise UserError('"book" has no motion in time to perturb; write mode = "aft"', "mode")
    stage = Stage(
        case.folder / "multipliers.json",
        ("stages.multipliers",),
        case.force,
        case.report,
        case=case.path,
    )
    inputs = {**case.inputs, "response": store.hash_file(case.folder / "response.h5")}
    return made(
        stage, inputs, f"{case.settings.name}: stability", case.pictures, partial(_answer, case)
    )


def _answer(case: CaseJob, journal: Journal) -> Answer:
    found, rows = _found(case, journal), list[tuple[str, ...]]()
    for normal, points in found.items():
        for f, one in sorted(points.items()):
            error = one.error[0] if len(one.error) else 0.0
            cells = (
                f"{normal:g}",
                f"{f:.10g}",
                f"{one.stable:d}",
                f"{one.growth:.6g}",
                f"{error:.2g}",
                one.loss,
            )
            rows.append(cells)
    head, title = (
        ("normal_force_N", "frequency_Hz", "stable", "growth", "error", "loss"),
        case.settings.name,
    )
    columns = dict(zip(head, zip(*rows, strict=True), strict=True)) if rows else {}
    return Answer(
        [unstable(found)],
        tables=number_tables({TABLE: columns}),
        files={
            TABLE: partial(write_columns, columns or dict.fromkeys(head, ()), 10),
            "pictures/stability.png": lambda path: stability_plot(
                found, f"{title}: stability", path
            ),
        },
    )


def _found(case: CaseJob, journal: Journal) -> dict[float, dict[float, Stability]]:
    """Normal force, N -> frequency, Hz -> its stability."""
    built, response = case.built(), read_response(case.folder / "response.h5")
    found, done = dict[float, dict[float, Stability]](), 0
    count = sum(int(series.converged.sum()) for series in response.series)
    for series in response.series:
        normal = float(series.parameters["normal_force"])
        problem = problem_of(built, normal if forces_of(built) != [None] else None)
        points = found.setdefault(normal, {})
        for i in np.flatnonzero(series.converged):
            f, done = float(series.frequency[i]), done + 1
            case.report(f"{done} of {count} points' stability: {normal:g} N, {f:.6g} Hz")
            own = partial(_point, problem, series.arrays["x"][i], 2 * np.pi * f)
            row = once(journal, f"normal force {normal!r} N", f, own)
            points[f] = Stability(
                row["multipliers"], row["error"], bool(row["stable"]), row["loss"]
            )
    return found


def _point(problem: Problem, x: Array, Omega: float) -> dict[str, Any]:
    return vars(stability(orbit(problem, x, Omega), Settings(steps=256)))


def unstable(found: Mapping[float, Mapping[float, Stability]]) -> str:
    """Which points are not stable, in a sentence."""
    lost = [
        (n, f, one.loss)
        for n, points in found.items()
        for f, one in sorted(points.items())
        if not one.stable
    ]
    count = sum(len(points) for points in found.values())
    if not lost:
        return f"all {count} points are stable"
    normal, f, loss = lost[0]
    first = f"{normal:g} N, {f:.6g} Hz ({loss})"
    return f"{len(lost)} of {count} points are not stable, the first at {first}"

"""Responses whose points are kept as they are found, so that a sweep or a curve can be interrupted and goes on where it
was."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np

from .. import continuation
from ..continuation import Branch, Settings, State
from ..continuation.newton import Scaled
from ..data import Array, ComplexArray
from ..results.checks import Checks
from ..results.journal import Journal, once
from ..system.assembly import Assembly, Output
from ..system.component import Component
from .checks import forces_on, judged
from .families import Family, followed
from .forces import Cycle
from .problem import Problem
from .response import HarmonicResponse, Operating, Resonance, Solved, filled_response, highest, operating
from .solver import CONVERGED, Point, Report
from .sweeps import brackets, resonances


def resumed_response(
    problem: Problem, frequency: Array, journal: Journal, series: str, report: Report = lambda _: None
) -> tuple[HarmonicResponse, list[Resonance]]:
    """`response.filled_response` and its refined peaks; what a series of the journal holds already is not computed.

    Points of another `frequency` have no place in the series: each one was begun at its neighbours.

    Args:
        frequency: Hz. series: its name. Peaks are kept as well, with
            ``peak`` = the frequency, Hz, of the point that they were searched from, and what searches gave in a
            series of its own.

    Returns:
        The response and its resonances: of the maxima of one plateau the highest.
    """
    rows = journal.of(series)
    points = {key: restored(problem, row) for key, row in rows.items() if not row["peak"] or _same(row["peak"], key)}

    def keep(f: float, solved: Solved, added: bool) -> None:
        journal.keep(series, f, record(problem, *solved) | {"frequency": f, "added": int(added)})

    response = filled_response(problem, frequency, report, points, keep)

    def searched(bracket: tuple[int, int, int], beside: float) -> dict[str, Any]:
        report(f"peak near {beside:.6g} Hz")
        found = highest(problem, response, bracket)
        if found is None:
            return {}
        point, amplitude = found
        f, rows = point.Omega / (2 * np.pi), journal.of(series)
        f = next((key for key in rows if _same(key, f)), f)  # a point of the sweep stays what it is
        row_of_point = rows.get(f) or record(problem, point, operating(problem, point))
        journal.keep(series, f, row_of_point | {"peak": beside})
        return {"frequency": f, "amplitude": amplitude, "x": point.x}

    peaks, searches = list[Resonance](), f"{series}, searches for peaks"
    for bracket in brackets(response):
        beside = float(response.frequency[bracket[1]])
        row = once(journal, searches, beside, partial(searched, bracket, beside))
        peaks += [Resonance(**row)] if row else []
    return response, resonances(response, peaks)


def _same(frequency: float, other: float) -> bool:
    """Whether two frequencies are one but for rounding."""
    return abs(frequency - other) <= 1e-12 * other


# curves ------------------------------------------------------------------------------------------------------------

OF_THE_WAY = "curve/"
"""Names, in a point of a curve, of what it takes to go on from there."""


Spend = Callable[[float], bool]
"""Is told CPU time (s) as it is spent, and says whether there is more of it."""


def resumed_curve(
    family: Family,
    journal: Journal,
    series: str,
    report: Report = lambda _: None,
    settings: Settings | None = None,
    spend: Spend = lambda _: True,
) -> tuple[Branch, list[dict[str, Any]]]:
    """The curve of a family, from where a series of the journal ends, and its points as `points_of_curve` tells them.

    A point of a curve has beside what other points have: ``parameter`` in the family's unit, ``fold`` and ``arclength``
    (scaled); its key is its place along the curve. spend: limits it, the time of an earlier run counted, but not the
    first step of a run, which compiles.
    """
    settings = family.settings(settings)
    rows = points_of_curve(journal, series)
    more, began = spend(sum(row["curve/took"] for row in rows)), None

    def keep(state: State) -> None:
        nonlocal more, began
        now = time.process_time()
        took, began = 0.0 if began is None else now - began, now
        more = spend(took)
        last = len(state.found) - 1
        for i, p in enumerate(state.found):
            problem, Omega = family.problem(p.lam), family.Omega(p.lam)
            point = Point(Omega, p.x, CONVERGED, 0.0, p.evaluations)
            row = (
                record(problem, point, operating(problem, point))
                | {"parameter": p.lam / family.unit, "fold": int(p.kind == "fold"), "arclength": p.arclength}
                | _way(p, state, state.status if i == last else "")
                | {"curve/took": took if i == last else 0.0}
            )
            journal.keep(series, len(rows), row)
            rows.append(row)

    return followed(family, report, settings, _begun(family, rows, settings), keep, lambda: more), rows


def points_of_curve(journal: Journal, series: str) -> list[dict[str, Any]]:
    """The points of a curve that a journal holds, up to the last step that is whole."""
    rows = list(journal.of(series).values())
    while rows and not rows[-1]["curve/ended"] and rows[-1]["curve/kind"] not in ("start", "regular"):
        rows.pop()
    return rows


def _way(p: continuation.Point, state: State, ended: str) -> dict[str, Any]:
    own = {
        "lam": p.lam, "kind": p.kind, "kink": int(p.kink), "tangent": p.tangent, "orientation": state.orientation,
        "step": state.step, "sense": state.sense, "ended": ended,
    }  # fmt: skip
    return {OF_THE_WAY + name: value for name, value in own.items()}


def _begun(family: Family, rows: list[dict[str, Any]], settings: Settings) -> Branch | None:
    """The curve as far as it is known; ended because of its length, it goes on where more points are allowed."""
    if not rows:
        return None
    scaled = Scaled(family.equations)
    points = tuple(
        continuation.Point(
            r["x"], r["curve/lam"], r["curve/kind"], bool(r["curve/kink"]), r["arclength"], r["curve/tangent"],
            int(r["iterations"]),
        )
        for r in rows
    )  # fmt: skip
    steps = [(p, r) for p, r in zip(points, rows, strict=True) if p.kind in ("start", "regular")]
    (last, row), before = steps[-1], steps[-2][0] if len(steps) > 1 else None
    status = rows[-1]["curve/ended"]
    status = "" if status.startswith("points") and len(rows) < settings.points else status
    state = State(
        y=scaled.pack(last.x, last.lam), tangent=last.tangent, orientation=int(row["curve/orientation"]),
        step=row["curve/step"], before=None if before is None else scaled.pack(before.x, before.lam),
        sense=int(row["curve/sense"]), origin=scaled.pack(points[0].x, points[0].lam),
        origin_tangent=points[0].tangent, count=len(rows), arclength=last.arclength, found=(), status=status,
        before_tangent=None if before is None or last.kink else before.tangent,
    )  # fmt: skip
    return Branch(points, status, state)


# records -----------------------------------------------------------------------------------------------------------


def record(problem: Problem, point: Point, found: Operating) -> dict[str, Any]:
    """A point as a journal keeps it, judged; the names are those of docs/response_file.md."""
    kept: dict[str, Any] = {
        "frequency": point.Omega / (2 * np.pi), "status": judged(point, found.checks).status, "error": point.error,
        "iterations": point.iterations, "peak": 0.0, "added": 0, "x": point.x,
        "harmonics": problem.harmonics,
        "history": np.array(point.history), "supplied": found.supplied, "damped": found.damped,
        "exchanged": found.exchanged, "kinetic": found.kinetic,
    } | {f"checks/{name}": value for name, value in vars(found.checks).items()}  # fmt: skip
    for name, rows in _outputs(problem.assembly).items():
        kept[name] = found.outputs[list(rows.values())]
    for component in problem.assembly.components:
        kept[f"bodies/{component.name}/q"] = rectangle(found.q[component.name])
        forces = [beside(problem, component, h, found) for h in range(problem.harmonics + 1)]
        if any(len(f) for f in forces):
            kept[f"bodies/{component.name}/forces"] = rectangle(forces)
    for name, cycle in found.cycles.items():
        own: dict[str, Any] = {"displacement": found.relative[name], "force": found.force[name]}
        own |= {key: float(getattr(cycle, key).sum()) for key in SUMS}
        own |= {key: float(getattr(cycle, key).mean()) for key in MEANS}
        own["unsteady"] = float(cycle.unsteady)
        kept |= {f"contacts/{name}/{key}": value for key, value in own.items()}
    return kept


SUMS, MEANS = ("dissipated", "by_slip", "lost"), ("slipping", "open")
"""What is kept of the points of a `Cycle`: sums and means."""


def restored(problem: Problem, row: dict[str, Any]) -> tuple[Point, Operating]:
    """A point and what belongs to it, from what a journal kept; of the cycles sums and means alone.

    The point is that of the solver, before it was judged: its neighbours began at it, whatever its checks say."""
    checks = Checks(**{f.name: row[f"checks/{f.name}"] for f in fields(Checks)})
    status = CONVERGED if row["status"] == checks.failure else row["status"]
    point = Point(
        2 * np.pi * row["frequency"], row["x"], status, row["error"], int(row["iterations"]),
        history=tuple(row["history"]),
    )  # fmt: skip
    names = [c.name for c in problem.assembly.contacts]
    cycles = {}
    for name in names:
        kept: list[Any] = [np.array([row[f"contacts/{name}/{key}"]]) for key in SUMS + MEANS]
        cycles[name] = Cycle(*kept, *[row[f"contacts/{name}/unsteady"]])
    a, q = problem.assembly, {}
    for m in a.components:
        sizes = [m.at(a.index(h)).group.n_modes for h in range(problem.harmonics + 1)]
        q[m.name] = [one[:n] for one, n in zip(row[f"bodies/{m.name}/q"], sizes, strict=True)]
    motion = Operating(
        point.Omega,
        q,
        _outputs_of(problem, row),
        {name: row[f"contacts/{name}/displacement"] for name in names},
        {name: row[f"contacts/{name}/force"] for name in names},
        row["supplied"],
        row["damped"],
        row["exchanged"],
        row["kinetic"],
        cycles,
        checks,
    )
    return point, motion


def array_of(a: Assembly, w: Output) -> str:
    """Name of the array of a read-out: the component's name stands before the monitor's where there are several."""
    group = next(iter(next(m for m in a.components if m.name == w.component).groups.values()))
    rows = group.monitors.get(w.monitor)
    kind = "gauges" if rows is None else "angles" if rows.unit == "rad" else "monitors"
    return f"{kind}/" + (f"{w.component}:{w.monitor}" if len(a.components) > 1 else w.monitor)


def _outputs(a: Assembly) -> dict[str, dict[str, int]]:
    """Name of an array -> label of each of its rows -> number of the read-out in the assembly; the first one first.

    A read-out that is asked for twice is one row.
    """
    out: dict[str, dict[str, int]] = {}
    for i, w in enumerate(a.outputs):
        out.setdefault(array_of(a, w), {}).setdefault(w.label, i)
    return out


def labels(a: Assembly) -> dict[str, list[str]]:
    """Name of an array -> its rows, for the head of a journal; the first row of the first one is the first read-out."""
    return {name: list(rows) for name, rows in _outputs(a).items()}


def _outputs_of(problem: Problem, row: dict[str, Any]) -> ComplexArray:
    """(w, H + 1) the read-outs in the order of the assembly, from a kept point."""
    places, a = _outputs(problem.assembly), problem.assembly
    read = [row[of][list(places[of]).index(w.label)] for w in a.outputs for of in [array_of(a, w)]]
    return np.array(read, dtype=complex).reshape(-1, problem.harmonics + 1)


def rectangle(rows: list[ComplexArray]) -> ComplexArray:
    """(H + 1, m) of rows that may differ in length from one nodal diameter to the next."""
    out = np.zeros((len(rows), max(len(r) for r in rows)), dtype=complex)
    for to, row in zip(out, rows, strict=True):
        to[: len(row)] = row
    return out


def beside(problem: Problem, component: Component, harmonic: int, found: Operating) -> ComplexArray:
    """(r,) amplitudes of the forces on the rows of a component's residual shapes, N and N m; (0,) where it has none."""
    residual = component.at(problem.assembly.index(harmonic)).group.residual
    if residual is None:
        return np.zeros(0, dtype=complex)
    touched, loaded = forces_on(problem, component, harmonic, found, residual.labels)
    return touched + loaded

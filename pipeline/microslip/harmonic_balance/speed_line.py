"""Forced vibration along an engine-order line: rotation speed and frequency tied together, f = e n / 60.

At every speed the bodies are those of that speed, contacts are pressed by what presses them there, and the steady
loads are that speed's: a problem of its own, started from its neighbours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ..data import Array
from ..errors import UserError
from ..results.series import of_solutions
from ..system.assembly import Assembly
from . import problem as balance
from . import response
from .problem import Forces
from .response import HarmonicResponse
from .solver import Point, Report, solve

Build = Callable[[float], Assembly]
"""Rotation speed in rpm -> the assembly at that speed."""


@dataclass(frozen=True)
class SpeedResponse(HarmonicResponse):
    """`HarmonicResponse` along an engine-order line.

    Attributes:
        rpm: (s,). order: base engine order, of the first harmonic. normal: (s, contacts) mean normal forces, N.
    """

    rpm: Array
    order: int
    normal: Array

    def columns(self) -> dict[str, Array]:
        forces = {f"normal_force_{i + 1}_N": force for i, force in enumerate(self.normal.T)}
        return {"speed_rpm": self.rpm, **super().columns(), **of_solutions(forces, self.converged)}


def frequency(order: int, rpm: Array) -> Array:
    """Hz of an engine order at rotation speeds in rpm."""
    return abs(order) * np.asarray(rpm, dtype=float) / 60


def along(
    build: Build, rpm: Array, order: int | None = None, report: Report = lambda _: None,
    keep: Callable[[SpeedResponse], None] = lambda _: None,
    models: Callable[[Assembly], dict[int, Forces] | None] = lambda _: None, **settings: Any,
) -> SpeedResponse:  # fmt: skip
    """Steady vibration at every speed, each started from the one or two before it.

    Args:
        build: see `Build`; contacts that stay the same keep their `Patch`, so that nothing is compiled twice. rpm: (s,)
            in the order in which they are run through. order: base engine order, of the first harmonic; the ring's if
            None. keep: is given what there is after every speed. models: of an assembly's contacts, see `problem.of`;
            the marched laws if None. settings: others of `problem.of`.

    Raises:
        UserError: no speed, one that is not above 0, no engine order.
    """
    speeds = np.asarray(rpm, dtype=float)
    if not len(speeds) or not (speeds > 0).all():
        raise UserError("speeds: an engine-order line needs one or more speeds in rpm, all above 0")
    found: list[HarmonicResponse] = []
    normal, done = [], list[Point]()
    for i, n in enumerate(speeds):
        assembly = build(float(n))
        problem = balance.of(assembly, models=models(assembly), **settings)
        settings.setdefault("length", problem.length)  # one unit for the unknowns of all speeds
        base = _order(problem.assembly, order)
        point = solve(problem, 2 * np.pi * float(frequency(base, n)), _starts(done, float(frequency(base, n))))
        done.append(point)
        found.append(response.of_points(problem, [point], np.zeros(len(problem.assembly.contacts))))
        forces = response.operating(problem, point).force
        normal.append([float(F[0, 0]) for F in forces.values()])
        words = "" if point.converged else ", not converged"
        report(f"{i + 1} of {len(speeds)} speeds: {n:.6g} rpm, {frequency(base, n):.6g} Hz{words}")
        whole = SpeedResponse(**_together(found), rpm=speeds[: i + 1], order=base, normal=np.array(normal))
        keep(whole)
    return whole


def _order(assembly: Assembly, order: int | None) -> int:
    if order is None and assembly.ring is None:
        raise UserError("engine order: the bodies stand in no ring, which would tell it; give one")
    base = abs(assembly.ring.order if order is None and assembly.ring else order or 0)
    if not base:
        raise UserError("engine order: 0 is steady; an engine-order line needs one that vibrates")
    return base


def _starts(done: list[Point], f: float) -> list[Array]:
    good = [p for p in done[-2:] if p.converged]
    if len(good) < 2 or good[0].Omega == good[1].Omega:
        return [p.x for p in good[-1:]]
    a, b = good
    share = (2 * np.pi * f - b.Omega) / (b.Omega - a.Omega)
    return [b.x + share * (b.x - a.x), b.x]


def _together(found: list[HarmonicResponse]) -> dict[str, Any]:
    """Responses of one point each as the fields of one response."""
    out: dict[str, Any] = {}
    for f in fields(HarmonicResponse):
        values = [getattr(r, f.name) for r in found]
        if f.name in ("limit", "quantity"):
            out[f.name] = values[0]
        elif isinstance(values[0], tuple):
            out[f.name] = tuple(v for one in values for v in one)
        else:
            out[f.name] = np.concatenate(values)
    return out

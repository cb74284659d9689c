"""Limit cycles of a case that slides, over one parameter and in relief over a second: followed, checked in time, told.

What is finished stays in a journal: the cycles of one value of the second parameter, and each orbit that was checked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from .. import sliding
from ..bifurcation import mechanics
from ..bifurcation.balance import Harmonics
from ..bifurcation.cycles import PERIODS, Checked, Cycles, checked, cycles
from ..bifurcation.dynamics import Dynamics
from ..bifurcation.equilibria import Hopf
from ..data import Array
from ..errors import at
from ..progress import Report
from ..results import Journal
from ..results.journal import once
from ..settings.numbers import Model, Number, Positive
from ..system.assembly import Assembly

Under = Callable[[Mapping[str, float], str], Assembly]
"""The assembly of a case with other values of keys; the key that says so."""

KEPT = "limit cycles"
"""Series of the journal: by the number of the second parameter's value, -1 at the case's own state."""


class Over(Model):
    """A parameter of a map; two of these tables make one."""

    parameter: str
    """what its axis says"""
    unit: str = ""
    """of the parameter, on the axis"""
    keys: dict[str, Number]
    """keys of this case, dotted, that follow the parameter, each with the factor that makes its
    value"""
    start: Number
    """of the parameter"""
    stop: Number
    """above it"""
    points: Annotated[int, Field(ge=2, le=1000)] = 40
    """values of it, evenly spaced"""

    @model_validator(mode="after")
    def _somewhere(self) -> Over:
        if self.start >= self.stop:
            raise ValueError("stop: must be above start; exchange them")
        if not self.keys:
            raise ValueError("keys: name one or more keys of the case that follow the parameter, with a factor each")
        return self


class Across(Over):
    """A second parameter, at whose values limit cycles are followed as well."""

    points: Annotated[int, Field(ge=2, le=1000)] = 5
    harmonics: Annotated[int, Field(ge=1, le=200)] = 5
    """of the balance along these branches"""


class Cycle(Over):
    """A parameter over which the limit cycles born at Hopf points are followed."""

    points: Annotated[int, Field(ge=2, le=1000)] = 40
    """of a branch at most"""
    harmonics: Annotated[int, Field(ge=1, le=200)] = 7
    """of the balance along a branch"""
    accuracy: Annotated[Positive, Field(le=0.1)] = 1e-4
    """share of the amplitude to which three orbits of a branch get harmonics, that are compared
    with a motion in time and judged by their Floquet multipliers"""
    across: Across | None = None


@dataclass(frozen=True)
class Born:
    """Limit cycles of a case. Attributes: own: at its own state. relief: (value of the second parameter, cycles)."""

    own: Sequence[Cycles]
    relief: Sequence[tuple[float, Cycles]]

    @property
    def whole(self) -> bool:
        """Whether all were followed to an end."""
        return not any(c.lost for c in (*self.own, *(c for _, c in self.relief)))

    @property
    def largest(self) -> float:
        """The largest amplitude of the first read-out of all cycles, in its unit; 0 where there is none."""
        every = (*self.own, *(c for _, c in self.relief))
        tops = [c.columns[c.system.column("amplitude", 0)] for c in every if c.system.named]
        return max((float(np.max(column, initial=0.0)) for column in tops), default=0.0)

    def columns(self, across: str) -> dict[str, Array]:
        """Of the relief, a row an orbit. across: name of the second parameter."""
        parts = [{across: np.full(len(c.orbits), value)} | c.columns for value, c in self.relief]
        return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def born(under: Under, asked: Cycle, band: tuple[float, float], journal: Journal, report: Report) -> Born:
    """The limit cycles that a case asks for. band: rad/s, of their Hopf points.

    Raises:
        UserError: no equilibrium to begin with; equations that do not change smoothly.
    """
    work = _Work(under, asked, band, journal, report)
    first = work.followed(-1, {}, asked.harmonics)
    own = [work.judged(c, f"{i}", (1, 2, 3), asked.accuracy) for i, c in enumerate(first)]
    over, relief = asked.across, list[tuple[float, Cycles]]()
    for number, value in enumerate(np.linspace(over.start, over.stop, over.points).tolist() if over else []):
        assert over is not None
        report(f"{over.parameter} {value:.4g}, {number + 1} of {over.points}")
        fixed = {key: factor * value for key, factor in over.keys.items()}
        found = work.followed(number, fixed, over.harmonics)
        relief += [(value, work.judged(c, f"{number}.{i}", (1, 2, 3), None)) for i, c in enumerate(found)]
    return Born(own, relief)


@dataclass(frozen=True)
class _Work:
    under: Under
    asked: Cycle
    band: tuple[float, float]
    journal: Journal
    report: Report

    def followed(self, number: int, fixed: Mapping[str, float], harmonics: int) -> list[Cycles]:
        """The limit cycles with other values of keys; from the journal, if they are there."""
        asked, where = self.asked, "stability.cycle.keys" if number < 0 else "stability.cycle.across.keys"

        def make(p: float) -> Assembly:
            return self.under({**fixed, **{key: factor * p for key, factor in asked.keys.items()}}, where)

        self.report(f"equations over {asked.parameter}")
        system = mechanics.dynamics(make, asked.start, asked.stop)
        kept = self.journal.of(KEPT).get(number)
        if kept is not None:
            return [_unpacked(kept, f"{i}/", system) for i in range(int(kept["count"]))]
        begin = sliding.equilibrium(sliding.of(make(asked.start)))
        with at(f"stability.cycle: {asked.parameter}"):
            born = cycles(system, begin, asked.start, asked.stop, harmonics, self.band, asked.points, self.report)
        point: dict[str, Any] = {"count": len(born)}
        for i, c in enumerate(born):
            point |= _packed(c, f"{i}/")
        self.journal.keep(KEPT, number, point)
        return born

    def judged(self, c: Cycles, name: str, thirds: Sequence[int], accuracy: float | None) -> Cycles:
        """The cycles with orbits at so many thirds of the branch checked, see `bifurcation.cycles.checked`."""
        series = f"orbits checked {name}"
        for number in dict.fromkeys((len(c.orbits) - 1) * k // 3 for k in thirds):
            orbit = c.orbits[number]

            def made(orbit: Harmonics = orbit, system: Dynamics = c.system) -> dict[str, Any]:
                one = checked(system, orbit, accuracy, self.report)
                rest = {key: value for key, value in vars(one).items() if key != "orbit"}
                return {"c": one.orbit.c, "omega": one.orbit.omega, **rest}

            row = dict(once(self.journal, series, number, made))
            orbit = Harmonics(row.pop("c"), float(row.pop("omega")), orbit.p)
            c = replace(c, checked={**c.checked, number: Checked(orbit, **row)})
        return c


def _packed(c: Cycles, begin: str) -> dict[str, Any]:
    """What a journal keeps of the cycles of a Hopf point."""
    orbits = {key: np.array([getattr(o, key) for o in c.orbits]) for key in ("c", "omega", "p")}
    hopf = {f"hopf/{f.name}": getattr(c.hopf, f.name) for f in fields(Hopf)}
    return {begin + key: value for key, value in {**hopf, **orbits, "ended": c.ended}.items()}


def _unpacked(point: Mapping[str, Any], begin: str, system: Dynamics) -> Cycles:
    own = {key.removeprefix(begin): value for key, value in point.items() if key.startswith(begin)}
    at = {f.name: own[f"hopf/{f.name}"] for f in fields(Hopf)}
    hopf = Hopf(at["x"], float(at["p"]), float(at["omega"]), at["shape"], float(at["criticality"]))
    orbits = zip(own["c"], own["omega"].tolist(), own["p"].tolist(), strict=True)
    return Cycles(hopf, tuple(Harmonics(*one) for one in orbits), own["ended"], system)


def sentences_of(c: Cycles, over: Cycle) -> list[str]:
    """Where a limit cycle is born, of which kind, how far it was followed; of its checked orbits their harmonics, how
    a motion in time keeps to them, and whether they are stable."""
    unit, last = f" {over.unit}" if over.unit else "", c.orbits[-1]
    sentences = [
        f"Hopf point at {over.parameter} {c.hopf.p:.6g}{unit}, {c.hopf.omega / (2 * np.pi):.6g} Hz, {c.kind}: its "
        f"limit cycle by {over.harmonics} harmonics to {last.p:.4g}{unit}, {last.omega / (2 * np.pi):.6g} Hz",
        *([f"limit cycle {c.lost}"] if c.lost else []),
    ]
    for one in c.checked.values():
        wide = "" if one.error <= over.accuracy else f", more than the {over.accuracy:.1e} asked for"
        sentences.append(
            f"limit cycle at {one.orbit.p:.4g}{unit}: {one.orbit.count} harmonics, estimated error {one.error:.1e}"
            f"{wide}; in {PERIODS} periods a motion in time leaves it by {one.drift:.1e} of its amplitude; "
            f"{'stable' if one.stable else 'unstable'}, largest Floquet multiplier {abs(one.multipliers[0]):.4g}"
        )
    return sentences


def sentence_of_relief(found: Born, over: Cycle) -> list[str]:
    """How many limit cycles of which kind there are over the second parameter, and how motions in time keep to them."""
    if over.across is None:
        return []
    unit = f" {over.across.unit}" if over.across.unit else ""
    range_ = f"{over.across.parameter} {over.across.start:.4g} to {over.across.stop:.4g}{unit}"
    kinds = [c.kind for _, c in found.relief]
    counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds)) or "none"
    every = [one for _, c in found.relief for one in c.checked.values()]
    worst = max((one.drift for one in every), default=np.nan)
    return [
        f"limit cycles at {over.across.points} values of {range_}: {counts}; motions in time leave {len(every)} of "
        f"their orbits, by {over.across.harmonics} harmonics, by {worst:.1e} of the amplitude at most in {PERIODS} "
        "periods",
        *(f"limit cycle at {over.across.parameter} {value:.4g}{unit} {c.lost}" for value, c in found.relief if c.lost),
    ]

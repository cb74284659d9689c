"""Does a case begin to move by itself, and what then: equilibria and periodic orbits over a parameter, stable and
unstable ones, as [[bifurcation]] asks.

Every finished branch is kept; interrupted, the same command goes on where it was.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from .. import sliding
from ..analysis import Analysis, Answer, Files, Question
from ..bifurcation import branches, mechanics
from ..bifurcation.branches import SPECIAL, DiagramBranch
from ..bifurcation.diagram import Diagram, DiagramPlan, diagram
from ..bifurcation.recorded import Branches, write_bifurcation
from ..errors import NotConverged, UserError, of_file
from ..files.store import fingerprint, write_text
from ..files.tables import rows_csv
from ..pictures.bifurcation import diagram_picture, portraits_picture
from ..report.page import Piece, number, say, table
from ..settings.numbers import Model, Name, Number, Positive, _finite_vector
from ..system.assembly import Assembly
from ..units import counted

Values = Annotated[tuple[Number, ...], BeforeValidator(_finite_vector)]


class Keys(Model):
    """A diagram of equilibria and periodic orbits over a parameter, by `microslip bifurcate`."""

    name: Name
    """of the diagram's files"""
    parameter: str
    """what its axis says"""
    unit: str = ""
    """of the parameter, on the axis"""
    keys: dict[str, Number]
    """keys of this case, dotted, that follow the parameter, each with the factor that makes its
    value; `system.` begins those of a system.toml"""
    fixed: dict[str, Number] = {}
    """other keys and their values, of this diagram alone"""
    start: Number
    """of the parameter"""
    stop: Number
    """of it; may be the smaller one"""
    orbits: bool = True
    """whether the orbits born at Hopf points are followed"""
    doublings: Annotated[int, Field(ge=0, le=8)] = 1
    """how often from an orbit on to that of twice its period"""
    branches: Annotated[int, Field(ge=0, le=4)] = 0
    """how often from a curve on to those that cross it at its branch points"""
    attractors: Values = ()
    """values of the parameter at which motions from many starts are left alone, to find orbits
    that coexist"""
    starts: Annotated[int, Field(ge=1, le=10000)] = 64
    """how many"""
    seed: Annotated[int, Field(ge=0)] = 0
    """from which they are drawn"""
    deflate: Values = ()
    """values of the parameter at which orbits, stable or not, are looked for beside all that is
    known"""
    nodes: Annotated[int, Field(ge=4, le=1024)] = 32
    """of an orbit, from which it is shot; doubled with its period"""
    step: Annotated[Positive, Field(le=0.5)] = 0.08
    """the longest along a branch, a share of start to stop"""
    points: Annotated[int, Field(ge=2, le=100000)] = 400
    """of a branch at most"""
    frequency: Positive | None = None
    """[Hz] of the first harmonic of the excitations, where there are any"""

    @model_validator(mode="after")
    def _somewhere(self) -> Keys:
        if self.start == self.stop:
            raise ValueError("stop: is the start; give two different values of the parameter")
        if not self.keys:
            raise ValueError("keys: name one or more keys of the case that follow the parameter, with a factor each")
        low, high = sorted((self.start, self.stop))
        for key in ("attractors", "deflate"):
            for value in getattr(self, key):
                if not low <= value <= high:
                    raise ValueError(f"{key}: {value:g} is not between start and stop; take values of the diagram")
        return self


def solve(q: Question) -> Answer:
    """A diagram each; whole if every branch was followed to its end."""
    with of_file(q.varied.path):
        for asked in q.asked:  # what is wrong in a later one is said before the first one is made
            at(q, asked, asked.start)
            at(q, asked, asked.stop)
        found = [(asked, _diagram(q, asked)) for asked in q.asked]
    every = [b for _, one in found for b in one.branches]
    swings = [b.swing[:, 0] for b in every if not b.still and b.swing.size]
    top = max((float(np.max(swing, initial=0.0)) for swing in swings), default=0.0)
    whole = [Branches(a.name, a.parameter, a.unit, one.branches) for a, one in found]
    files: Files = {}
    for asked, one in found:
        files[f"bifurcation_{asked.name}.csv"] = partial(_table, one)
    files["bifurcation.h5"] = lambda path: write_bifurcation(path, whole)
    for asked, one in found:
        files |= _pictures(asked, one, q.built.settings.name)
    return Answer(
        [words for a, one in found for words in told(a, one)],
        tables=[say(READ_AS, tone="note"), *(_points(a, one) for a, one in found)],
        largest=top,
        whole=not any(b.lost for b in every),
        files=files,
    )


def at(q: Question, asked: Keys, p: float) -> Assembly:
    """The assembly at a value of the parameter.

    Raises:
        UserError: a key that is none of the case or the system.
    """
    values = dict(asked.fixed) | {key: factor * p for key, factor in asked.keys.items()}
    assembly: Assembly = q.varied.under(values, f"bifurcation.{asked.name}.keys")
    return assembly


def _diagram(q: Question, asked: Keys) -> Diagram:
    name, make = asked.name, partial(at, q, asked)
    inputs = fingerprint(q.inputs, asked.model_dump())
    low, high = sorted((asked.start, asked.stop))
    Omega = None if asked.frequency is None else 2 * np.pi * asked.frequency
    q.report(f"{name}: equations over {asked.parameter}")
    system = mechanics.dynamics(make, low, high, Omega)

    def file(branch: str) -> Path:
        place = f"{name}, {branch}.h5".replace(", ", "_").replace(" ", "_")
        return q.folder / "branches" / place

    given = DiagramPlan(**{key: getattr(asked, key) for key in DiagramPlan.__dataclass_fields__})
    try:
        begin = sliding.equilibrium(sliding.of(make(asked.start)))
    except NotConverged as error:
        raise UserError(str(error), f"bifurcation.{name}.start") from error
    return diagram(
        system,
        begin,
        given,
        lambda branch: None if q.fresh else branches.kept(file(branch), inputs),
        lambda branch: branches.write(file(branch.name), branch, inputs),
        lambda text: q.report(f"{name}: {text}"),
    )


def _table(found: Diagram, path: Path) -> None:
    """A row a point of every branch."""
    parts = [branches.columns(b) for b in found.branches]
    keys = list(dict.fromkeys(key for part in parts for key in part))
    empty = np.full(max(len(b) for b in found.branches), np.nan)
    rows = [row for part in parts for row in zip(*(part.get(k, empty[: len(part["kind"])]) for k in keys), strict=True)]
    write_text(path, rows_csv(keys, rows, 10))


def _pictures(asked: Keys, found: Diagram, case: str) -> Files:
    title, begins = f"{case}: {asked.parameter}", "pictures/"
    drawn: Files = {f"{begins}bifurcation_{asked.name}.png": lambda p: diagram_picture(found, p, title, _axis(asked))}
    if any(not b.still for b in found.branches):
        portraits = partial(portraits_picture, found, title=title, unit=asked.unit)
        drawn[f"{begins}orbits_{asked.name}.png"] = portraits
    return drawn


def _axis(asked: Keys) -> str:
    return f"{asked.parameter} in {asked.unit}".removesuffix(" in ")


READ_AS = (
    "Lines are stable, dashes unstable. The ordinate is half of the way from the smallest to the largest value in a "
    "period, zero for an equilibrium. The multiplier is the largest Floquet multiplier, of an equilibrium the "
    "eigenvalue farthest to the right, in 1/s."
)


def _points(asked: Keys, found: Diagram) -> Piece:
    """Where something happens."""
    head = ["branch", "what", _axis(asked), "period in s", "multiplier"]
    return table(head, [row for b in found.branches for row in _rows(b)])


def _rows(branch: DiagramBranch) -> list[list[str]]:
    return [
        [
            branch.name,
            str(branch.kind[i]),
            number(float(branch.parameter[i]), 6),
            number(float(branch.period[i]), 6) if np.isfinite(branch.period[i]) else "",
            _multiplier(branch, i),
        ]
        for i in range(len(branch))
        if str(branch.kind[i]) in SPECIAL
    ]


def _multiplier(branch: DiagramBranch, i: int) -> str:
    value = complex(branch.multipliers[i, 0])
    if abs(value.imag) <= 1e-9 * abs(value):
        return number(value.real)
    return f"{number(value.real)} ± {number(abs(value.imag))} i"


WORDS: dict[str, Callable[[str], str]] = {
    "fold": lambda at: f"fold at {at}",
    "period doubling": lambda at: f"period doubling at {at}",
    "torus": lambda at: f"torus point at {at}",
    "branch point": lambda at: f"branch point at {at}",
}


def told(asked: Keys, found: Diagram) -> list[str]:
    """A sentence a Hopf point and a branch."""
    unit = f" {asked.unit}" if asked.unit else ""
    said = []
    for point in found.hopf:
        kind = "subcritical" if point.criticality > 0 else "supercritical"
        said.append(f"{asked.name}: Hopf point at {point.p:.6g}{unit}, {point.omega:.6g} rad/s, {kind}.")
    for b in found.branches:
        passed = [WORDS[str(k)](f"{p:.6g}{unit}") for k, p in zip(b.kind, b.parameter, strict=True) if str(k) in WORDS]
        nothing = "nothing on the way" + " as far as it was followed" * b.lost
        if not b.still or passed:
            said.append(f"{asked.name}, {b.name}: born at the {b.born}; {', '.join(passed) or nothing}.")
    said += [f"{asked.name}, deflation at {p:.6g}{unit}: {beside(found, p)}." for p in asked.deflate]
    return [*said, *(f"{asked.name}, {words}" for words in found.messages)]


def beside(found: Diagram, p: float) -> str:
    """Orbits that deflation found at a value of the parameter."""
    there = [one for one in found.deflated if one.orbit.p == p]
    words = [f"{'stable' if one.stable else 'unstable'}, period {one.orbit.period:.6g} s, multiplier of the size "
             f"{np.abs(one.multipliers).max(initial=0.0):.3g}" for one in there]  # fmt: skip
    if not there:
        return "no orbit was found beside what was known, which does not mean that there is none"
    return f"{counted(len(there), 'orbit')} beside what was known: {'; '.join(words)}"


ANALYSIS = Analysis(
    "bifurcation",
    Keys,
    solve,
    lost="some branches could not be followed to their end",
    needed="keys, start and stop",
    swept=False,
    verb="bifurcate",
    several=True,
    unloaded=lambda _: True,
)

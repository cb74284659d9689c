"""Diagrams of equilibria and periodic orbits of a case: tables, all orbits in HDF5, pictures and a page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import sliding
from ..bifurcation import branches, mechanics
from ..bifurcation.diagram import Asked, Diagram, diagram
from ..bifurcation.recorded import Branches, write_bifurcation
from ..case import CaseSettings, checkpoint, headline
from ..case.questions import BifurcationOfCase
from ..errors import NotConverged, UserError, in_its_file
from ..files import store
from ..files.tables import rows_csv
from ..report.bifurcation import bifurcation_html
from ..system.assembly import Assembly
from ..units import counted
from .answer import CaseJob, Written
from .stage import Stage, hash_of_code
from .varied import Varied


@dataclass(frozen=True)
class Changed:
    """A case whose keys follow a parameter. Attributes: varied: the case. asked: the diagram."""

    varied: Varied
    asked: BifurcationOfCase

    def at(self, p: float) -> Assembly:
        """The assembly at a value of the parameter.

        Raises:
            UserError: a key that is none of the case or the system.
        """
        values = dict(self.asked.fixed) | {key: factor * p for key, factor in self.asked.keys.items()}
        return self.varied.under(values, f"bifurcation.{self.asked.name}.keys")


@in_its_file
def bifurcation_stage(case: CaseJob) -> Written:
    """The diagrams that a case asks for, whole if every branch was followed to its end; finished branches are kept.

    Raises:
        UserError: the case asks for none; a key that is none; no equilibrium to begin with.
    """
    if not case.settings.bifurcation:
        raise UserError("is missing; add [[bifurcation]] with keys, start and stop", "bifurcation")
    return case.answer("bifurcation", "stages.bifurcation", _work)


def _work(stage: Stage, case: CaseJob) -> Written:
    folder, settings = case.folder, case.settings
    changed = [Changed(Varied(case.path, case.raw, case.bases), asked) for asked in settings.bifurcation]
    own = {key: value for key, value in checkpoint.without_defaults(case.raw).items() if key != "bifurcation"}
    inputs = {**case.inputs, "case": own, "code": hash_of_code(stage.code)}
    for one in changed:  # what is wrong in a later diagram is said before the first one is made
        one.at(one.asked.start)
        one.at(one.asked.stop)
    stage.begin()
    found = [_diagram(one, folder / "branches", inputs, stage) for one in changed]
    made = [_table(folder, one.asked, drawn) for one, drawn in zip(changed, found, strict=True)]
    both = zip(settings.bifurcation, found, strict=True)
    whole = [Branches(one.name, one.parameter, one.unit, drawn.branches) for one, drawn in both]
    made.append(write_bifurcation(folder / "bifurcation.h5", whole))
    drawn = _pictures(folder / "pictures", settings, found) if case.pictures else []
    sentences = [s for asked, one in zip(settings.bifurcation, found, strict=True) for s in told(asked, one)]
    swings = [b.swing[:, 0] for one in found for b in one.branches if not b.still and b.swing.size]
    top = max((float(np.max(swing, initial=0.0)) for swing in swings), default=0.0)
    sentences += headline.doubted(case.built(), top)
    page = bifurcation_html(f"{settings.name}: bifurcations", settings.bifurcation, found, sentences, drawn)
    store.write_text(folder / "bifurcation.html", page)
    lost = any(b.lost for one in found for b in one.branches)
    return Written([folder / "bifurcation.html", *made, *drawn], sentences, not lost)


def _diagram(one: Changed, folder: Path, depends: Mapping[str, Any], stage: Stage) -> Diagram:
    asked, name = one.asked, one.asked.name
    inputs = store.hash_settings({**depends, "asked": asked.model_dump()})
    low, high = sorted((asked.start, asked.stop))
    Omega = None if asked.frequency is None else 2 * np.pi * asked.frequency
    stage.report(f"{name}: equations over {asked.parameter}")
    system = mechanics.dynamics(one.at, low, high, Omega)

    def file(branch: str) -> Path:
        return folder / f"{name}, {branch}.h5".replace(", ", "_").replace(" ", "_")

    fields = Asked.__dataclass_fields__
    given = Asked(**{key: getattr(asked, key) for key in fields})
    try:
        begin = sliding.equilibrium(sliding.of(one.at(asked.start)))
    except NotConverged as error:
        raise UserError(str(error), f"bifurcation.{name}.start") from error
    return diagram(
        system, begin, given,
        lambda branch: None if stage.force else branches.kept(file(branch), inputs),
        lambda branch: branches.write(file(branch.name), branch, inputs), lambda text: stage.report(f"{name}: {text}"),
    )  # fmt: skip


def _table(folder: Path, asked: BifurcationOfCase, found: Diagram) -> Path:
    parts = [branches.columns(b) for b in found.branches]
    keys = list(dict.fromkeys(key for part in parts for key in part))
    empty = np.full(max(len(b) for b in found.branches), np.nan)
    rows = [row for part in parts for row in zip(*(part.get(k, empty[: len(part["kind"])]) for k in keys), strict=True)]
    store.write_text(folder / f"bifurcation_{asked.name}.csv", rows_csv(keys, rows, 10))
    return folder / f"bifurcation_{asked.name}.csv"


def _pictures(folder: Path, settings: CaseSettings, found: Sequence[Diagram]) -> list[Path]:
    from ..pictures.bifurcation import diagram_picture, portraits_picture

    drawn = list[Path]()
    for asked, one in zip(settings.bifurcation, found, strict=True):
        title, axis = f"{settings.name}: {asked.parameter}", f"{asked.parameter} in {asked.unit}".removesuffix(" in ")
        drawn.append(diagram_picture(one, folder / f"bifurcation_{asked.name}.png", title, axis))
        if any(not b.still for b in one.branches):
            drawn.append(portraits_picture(one, folder / f"orbits_{asked.name}.png", title, asked.unit))
    return drawn


WORDS: dict[str, Callable[[str], str]] = {
    "fold": lambda at: f"fold at {at}",
    "period doubling": lambda at: f"period doubling at {at}",
    "torus": lambda at: f"torus point at {at}",
    "branch point": lambda at: f"branch point at {at}",
}


def told(asked: BifurcationOfCase, found: Diagram) -> list[str]:
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

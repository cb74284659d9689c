"""Responses of a case followed by arclength: over the frequency, the load, or the normal force."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from ..continuation import Settings
from ..data import Array
from ..errors import UserError, in_its_file
from ..harmonic_balance import families
from ..harmonic_balance.accuracy import Error
from ..harmonic_balance.checkpoint import Spend, labels, points_of_curve, resumed_curve
from ..harmonic_balance.envelope import largest_resonance
from ..harmonic_balance.families import Family
from ..harmonic_balance.growing import verdict
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.readout import measured
from ..results import Journal
from ..results.names import exact
from ..results.series import CONVERGED, READ, of_solutions
from ..units import METRES, Quantity
from . import headline
from .assemble import Built, build
from .contacts import swept
from .messages import CUT
from .problem import normal_forces, pressed_by, problem_of
from .questions import CurveOfCase
from .settings import CaseSettings
from .surveys import Bases, Report

Keep = Callable[[Built], AbstractContextManager["Journal"]]

OVER = ("frequency", "load", "normal_force")
"""What a response is followed over."""

UNITS = {"frequency": "Hz", "load": "of the load", "normal_force": "N"}
COLUMNS = {"frequency": "frequency_Hz", "load": "load", "normal_force": "normal_force_N"}
OF_SERIES = {"frequency": "frequency", "load": "load", "normal_force": "normal_force_N"}
"""What its series runs over, of `results.series.OVER`."""


@dataclass(frozen=True, eq=False)
class Followed:
    """A curve of motions, as far as it was followed.

    Attributes:
        over: of `OVER`. normal: N of the contacts that the sweep presses; None where it presses none, or is what
            varies. frequency: Hz at which the others vary, or None. ends: of the parameter, as asked for. name: of its
            series. rows: points in order, see `harmonic_balance.checkpoint.resumed_curve`. status: why it ended.
            quantity: what is read; m stands for its unit. legs: of the curve from the first end, where this one begins
            at the other because that one did not arrive there; None: this is the first.
    """

    over: str
    normal: float | None
    frequency: float | None
    ends: tuple[float, float]
    name: str
    rows: Sequence[Mapping[str, Any]]
    status: str
    quantity: Quantity = METRES
    legs: int | None = None

    @cached_property
    def parameter(self) -> Array:
        """(p,) Hz, share of the load, or N."""
        return np.array([row["parameter"] for row in self.rows], dtype=float)

    @cached_property
    def fold(self) -> Array:
        """(p,) bool, where the curve turns."""
        return np.array([row["fold"] for row in self.rows], dtype=bool)

    @cached_property
    def monitor(self) -> Array:
        """(p, H + 1) complex harmonics of the first read-out, m."""
        name = next((n for n in self.rows[0] if n.startswith(READ)), "") if self.rows else ""
        return np.array([row[name][0] for row in self.rows], dtype=complex) if name else np.zeros((0, 2), dtype=complex)

    @property
    def amplitude(self) -> Array:
        """(p,) m, of the first harmonic."""
        return np.abs(self.monitor[:, 1])

    @property
    def converged(self) -> Array:
        """(p,) bool, whether each point passes its checks."""
        return np.array([row.get("status", CONVERGED) == CONVERGED for row in self.rows], dtype=bool)

    @property
    def complete(self) -> bool:
        """Whether it left the range at the other end, the nearer one of its last point."""
        begin, end = self.ends
        return not self.early and abs(self.parameter[-1] - end) < abs(self.parameter[-1] - begin)

    @property
    def early(self) -> bool:
        """Whether it ended before it left the range, at whichever end."""
        return not self.status.startswith("bound")

    @property
    def leaves_out(self) -> bool:
        """Whether another curve is to be begun at the other end; one that has too few points goes on instead."""
        return self.legs is None and not self.complete and not self.status.startswith(("points", CUT))

    @property
    def turned(self) -> Followed:
        """The curve from the other end, yet to be followed."""
        legs = 1 + int(self.fold.sum()) if self.rows else 0
        return replace(self, ends=self.ends[::-1], rows=(), status="interrupted", legs=legs).named

    @property
    def named(self) -> Followed:
        """With the name of its series."""
        begin, end = self.ends
        return replace(self, name=f"{self.label_by(exact)}, {exact(begin)} to {exact(end)} {UNITS[self.over]}")

    @property
    def label(self) -> str:
        """What sets the curve apart from the others, for people."""
        begun = "" if self.legs is None else f", from {self.ends[0]:g} {UNITS[self.over]}"
        return self.label_by("{:g}".format) + begun

    def label_by(self, number: Callable[[float], str]) -> str:
        """`label` with numbers written in a way of one's own."""
        said = [] if self.normal is None else [f"F_N = {number(self.normal)} N"]
        return ", ".join(said + ([] if self.frequency is None else [f"{number(self.frequency)} Hz"])) or "as pressed"

    def columns(self) -> dict[str, Array]:
        """Name -> column, for a table; what is told of a motion is nan where a point fails its checks."""
        first = {} if self.normal is None else {"normal_force_N": self.normal}
        first |= {} if self.frequency is None else {"at_frequency_Hz": self.frequency}
        told = {
            self.quantity.column("amplitude"): self.amplitude,
            "phase_deg": np.degrees(np.angle(self.monitor[:, 1])),
            self.quantity.column("mean"): self.monitor[:, 0].real,
            "slipping": self._share("slipping"),
            "open": self._share("open"),
        }
        return {
            **{name: np.full(len(self.rows), value) for name, value in first.items()},
            COLUMNS[self.over]: self.parameter,
            **of_solutions(told, self.converged),
            "fold": self.fold.astype(float),
            "leg": 1.0 + (self.legs or 0) + np.cumsum(self.fold) - self.fold,
        }

    def _share(self, what: str) -> Array:
        """(p,) of points times cycle, over all contacts."""
        return np.array(
            [np.mean([v for n, v in row.items() if n.endswith(f"/{what}")] or [0.0]) for row in self.rows]
        )  # fmt: skip

    def sentences(self, by: tuple[float, str] | None = None) -> list[str]:
        """What was found. by: factor and name of the unit of amplitudes; their own if not given."""
        unit, begin = UNITS[self.over], self.ends[0]
        if not self.rows:
            key = "band" if self.over == "frequency" else self.over
            return [f"{self.label}: {self.status}; begin elsewhere than at {begin:.6g} {unit} (curve.{key})."]
        top, folds = int(np.argmax(np.where(self.converged, self.amplitude, 0.0))), self.parameter[self.fold]
        factor, name = by or self.quantity.shared(self.amplitude)
        said = f"{self.label}: {len(self.rows)} points, at most {factor * self.amplitude[top]:.4g} {name} at "
        said += f"{self.parameter[top]:.6g} {unit}; "
        if len(folds) > 4:
            said += f"{len(folds)} folds between {folds.min():.6g} and {folds.max():.6g} {unit}."
        else:
            said += f"folds at {', '.join(f'{f:.6g}' for f in folds)} {unit}." if len(folds) else "no fold."
        return [said] if self.complete else [said, self._missed()]

    def _missed(self) -> str:
        """Where it ended instead of at the other end, and what follows."""
        unit, (begin, end) = UNITS[self.over], self.ends
        if self.early:
            said = f"{self.label}: the curve ends at {self.parameter[-1]:.6g} {unit}, not at {end:.6g}: {self.status}"
            said += " (curve.points)" if self.status.startswith("points") else ""
        else:
            said = (
                f"{self.label}: the curve comes back to {begin:.6g} {unit}, where it began, and misses {end:.6g} {unit}"
            )
        return f"{said}; another one begins there." if self.leaves_out else f"{said}."


@in_its_file
def curves(
    settings: CaseSettings,
    bases: Bases,
    over: str,
    keep: Keep,
    report: Report,
    known: Mapping[float, Array] = MappingProxyType({}),
    spend: Spend = lambda _: True,
) -> tuple[list[Followed], bool]:
    """The curves of a case, one for each normal force of its sweep; a second one from the other end where the first
    does not arrive there.

    Args:
        over: of `OVER`. keep: opens the journal of an assembly, in which points are kept as they are found.
        known: Hz -> unknowns of a solution there, with as many harmonics or fewer, on which a curve
            over the frequency begins. spend: limits the CPU time.

    Returns:
        The curves, and whether nobody interrupted: after Ctrl-C what was found until then.

    Raises:
        UserError: ends that are missing, no resonance to begin at.
    """
    asked, built = settings.curve or CurveOfCase(), build(settings, bases)
    of = measured(built.assembly)
    ends, how = _ends(built, asked, over), Settings(points=asked.points, branch_points=False)
    found: list[Followed] = []
    with keep(built) as journal:
        for normal in _forces(built, over, ends):
            own = None if over == "normal_force" else normal
            one = Followed(over, own, None, ends, "", (), "interrupted", of)
            try:
                problem = problem_of(built, normal)
                if over != "frequency":
                    at = asked.frequency or _resonance(built, problem, normal, journal, report)
                    one = replace(one, frequency=at)
                one, pressed = one.named, pressed_by(built, problem) if normal is None else normal
                family = _family(built, problem, one)
                if over == "frequency":
                    family = replace(family, known=known.get(ends[0]))
                found.append(_followed(family, problem, one, pressed, journal, report, how, spend))
                if found[-1].leaves_out:
                    one = found[-1].turned
                    family = _family(built, problem, one)
                    found.append(_followed(family, problem, one, pressed, journal, report, how, spend))
            except KeyboardInterrupt:
                return [*found, replace(one, rows=points_of_curve(journal, one.name))], False
    return found, True


def highest(found: Sequence[Followed]) -> tuple[Followed, int] | None:
    """The curve with the largest amplitude of all points that pass their checks, and that point."""
    heights = [(one, np.where(one.converged, one.amplitude, -1.0)) for one in found if one.rows]
    tops = [(one, int(height.argmax())) for one, height in heights if one.converged.any()]
    return max(tops, key=lambda top: float(top[0].amplitude[top[1]]), default=None)


def error_of(built: Built, one: Followed, i: int) -> tuple[Error | None, list[str]]:
    """Of a point of a curve the estimated error of its amplitude, see `headline.estimated`, and whether it is stable
    where the linear part feeds motions."""
    family, row = _family(built, problem_of(built, _begun_under(built, one)), one), one.rows[i]
    at = float(row["parameter"]) * family.unit
    problem, Omega = family.problem(at), family.Omega(at)
    said = verdict(problem, row["x"], Omega, f"{one.label}: the highest motion, at {Omega / (2 * np.pi):.6g} Hz,")
    return headline.estimated(built, problem, row["x"], Omega), said


def _begun_under(built: Built, one: Followed) -> float | None:
    """Normal force (N) of the contacts at the beginning of a curve."""
    return one.ends[0] if one.over == "normal_force" else one.normal


def _followed(
    family: Family,
    problem: Problem,
    one: Followed,
    normal: float,
    journal: Journal,
    report: Report,
    how: Settings,
    spend: Spend,
) -> Followed:
    """A curve with its points, kept in a series of the journal."""
    told = {**journal.head.get("parameters", {}), one.name: {"normal_force": normal}}
    journal.say({**journal.head, "parameters": told, "labels": labels(problem.assembly), "over": OF_SERIES[one.over]})
    report(f"curve over the {one.over.replace('_', ' ')}, {one.label}")
    branch, rows = resumed_curve(family, journal, one.name, report, how, spend)
    return replace(one, rows=rows, status=branch.status or CUT)


def _ends(built: Built, asked: CurveOfCase, over: str) -> tuple[float, float]:
    """First and last value of what varies."""
    if over == "load":
        return asked.load
    if over == "frequency":
        return asked.band or (built.settings.sweep.start, built.settings.sweep.stop)
    if not any(swept(c) for c in built.contacts):
        raise UserError("the sweep's normal forces press no contact; there is nothing to change", "curve")
    for c in (built.contacts[i] for i in built.fitted):
        if c.what.of_the_force:
            raise UserError(
                f'"{c.what.kind}" holds a force given beforehand; write "smooth" for a curve over the force',
                f"contacts.{c.interface}.law",
            )
        raise UserError(
            "is missing; along a curve over its force a curved contact has one law, so give the force (N) at which it "
            "is fitted",
            f"contacts.{c.interface}.fitted_at",
        )
    forces = normal_forces(built)
    if asked.normal_force is None and len(set(forces)) < 2:
        raise UserError("give [first, last] in N; the sweep has one normal force alone", "curve.normal_force")
    return asked.normal_force or (min(forces), max(forces))


def _forces(built: Built, over: str, ends: tuple[float, float]) -> tuple[float | None, ...]:
    """Normal forces (N) of the curves; where it varies the one that they begin with."""
    return (ends[0],) if over == "normal_force" else normal_forces(built) or (None,)


def _resonance(
    built: Built, problem: Problem, normal: float | None, journal: Journal, report: Report
) -> float:  # fmt: skip
    """Hz of the highest resonance in the sweep's band, kept before or searched for now."""
    known = dict(journal.head.get("at", {}))
    s = built.settings.sweep
    key = f"{normal}, {s.start} to {s.stop} Hz by {s.points}"
    if key not in known:
        report(f"resonance between {s.start:g} and {s.stop:g} Hz")
        top = largest_resonance(problem, s.grid)
        if top.missing:
            raise UserError(f"{top.missing}; widen the sweep, or give a frequency (Hz)", "curve.frequency")
        known[key] = top.frequency
        journal.say({**journal.head, "at": known})
    return float(known[key])


def _family(built: Built, problem: Problem, one: Followed) -> Family:
    a, b = one.ends
    if one.over == "frequency":
        return families.of_frequency(problem, a, b)
    assert one.frequency is not None
    if one.over == "load":
        return families.of_load(problem, one.frequency, a, b)
    top = max(a, b)
    pressed = problem_of(built, top)
    count = len(built.contacts)
    which = frozenset(i for i in range(len(pressed.assembly.contacts)) if swept(built.contacts[i % count]))
    family = families.of_normal_force(pressed, one.frequency, a / top, b / top, which)
    return replace(family, unit=1 / top, words="N")

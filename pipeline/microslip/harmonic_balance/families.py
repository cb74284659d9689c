"""Responses followed by arclength: over frequency through its folds, over the level of the loads, over normal force.

A sweep gives one motion at each value and jumps where the curve folds; here every motion on the curve is found, in the
order in which it passes them, the unstable ones between two folds too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from .. import continuation
from ..continuation import Branch, Lost, Scaled, Settings, State
from ..continuation import Point as OnCurve
from ..continuation.curve import Kind
from ..continuation.newton import norm
from ..data import Array, ComplexArray, largest
from ..errors import UserError
from .problem import AtFrequency, Problem
from .readout import WithOutput, seen
from .reduced import sticking_and_free
from .solver import CONVERGED, OverLoad, Point, Report, led, solve
from .stability import Settings as Multipliers
from .stability import Stability, orbit, stability


@dataclass(frozen=True, eq=False)
class OverNormal:
    """The balance at one frequency over a factor on the normal forces, for `continuation`.

    Unknown are displacements from the state preloaded by the factor's forces. The stiffness about which bodies are
    eliminated stays: any gives the same answer.

    Attributes:
        problem: at the factor 1. Omega: rad/s. x_scale, lam_scale: see `continuation.Equations`. contacts: numbers of
            those whose force changes; None: all that have one. What an interference presses stays as it is.
    """

    problem: Problem
    Omega: float
    x_scale: float
    lam_scale: float = 1.0
    contacts: frozenset[int] | None = None

    def at(self, factor: float) -> Problem:
        """The balance with normal forces multiplied; by zero, if the factor is negative."""
        p, groups, contacts = self.problem, [], list(self.problem.assembly.contacts)
        for g in p.groups:
            known: dict[float, Any] = {}
            for i in g.contacts:
                c = contacts[i]
                normal = max(factor, 0.0) * float(c.preload[0])
                if c.preload[0] > 0 and (self.contacts is None or i in self.contacts):
                    alike = known[normal] = known.get(normal) or c.pressed(normal)
                    contacts[i] = replace(c, offset=alike.offset, preload=alike.preload)
            offset, preload = (np.array([getattr(contacts[i], k) for i in g.contacts]) for k in ("offset", "preload"))
            groups.append(replace(g, offset=offset, preload=preload))
        return replace(p, assembly=replace(p.assembly, contacts=tuple(contacts)), groups=tuple(groups))

    def evaluate(self, x: Array, factor: float) -> tuple[Array, Array, Array]:
        """R, dR/dx, and dR/dfactor by differences, central where there is room."""
        h = 1e-5 * max(abs(factor), 1e-3)
        ends = max(factor - h, 0.0), max(factor, 0.0) + h
        low, high = (replace(self._here, problem=self.at(end)).residual(x) for end in ends)
        R, J, _ = replace(self._here, problem=self.at(factor)).evaluate(x)
        return R, J, (high - low) / (ends[1] - ends[0])

    @cached_property
    def _here(self) -> AtFrequency:
        return self.problem.at(self.Omega)


@dataclass(frozen=True, eq=False)
class Family:
    """A balance over a parameter, to be followed from one value to another.

    Attributes:
        equations: see `continuation.Equations`. begin, end: of its lambda. unit: lambda of one unit of the parameter
            that people read. words: "Hz", ... problem, Omega: the balance and the frequency (rad/s) at a lambda.
        narrow: (m, 2) values of lambda that no step may pass unseen, and how wide what is there is.
        known: (k,) unknowns of a solution at the beginning with as many harmonics or fewer, where
            the curve begins; None: one is looked for.
    """

    equations: continuation.Equations
    begin: float
    end: float
    unit: float
    words: str
    problem: Callable[[float], Problem]
    Omega: Callable[[float], float]
    narrow: Array = field(default_factory=lambda: np.zeros((0, 2)))
    known: Array | None = None

    @property
    def turned(self) -> Family:
        """From the other end."""
        return replace(self, begin=self.end, end=self.begin, known=None)

    def reached(self, branch: Branch) -> bool:
        """Whether a curve arrived at the other end, and did not come back to where it began."""
        return branch.status.startswith("bound") and branch.points[-1].lam == self.end

    def ended(self, branch: Branch) -> str:
        """Why a branch ended, the end that it reached in the parameter that people read."""
        if not branch.status.startswith("bound"):
            return branch.status
        return f"bound: {branch.points[-1].lam / self.unit:.6g} {self.words} is reached"

    def points(self, branch: Branch) -> tuple[Point, ...]:
        """The motions of a branch."""
        return tuple(Point(self.Omega(p.lam), p.x, CONVERGED, 0.0, p.evaluations) for p in branch.points)

    def settings(self, given: Settings | Mapping[str, Any] | None = None) -> Settings:
        """How the curve is followed, between its own ends; what is narrow is hit.

        Raises:
            UserError: a setting that there is not.
        """
        given = along(replace(ALONG, targets=tuple(self.narrow[:, 0].tolist())), given)
        way = 1 if self.end > self.begin else -1
        return replace(given, low=min(self.begin, self.end), high=max(self.begin, self.end), direction=way)

    def advanced(self, equations: continuation.Equations, state: State, given: Settings) -> State:
        """The next state, by steps of half the way to what is narrow, or of its width, where a step hides it."""
        given = replace(given, step_max=_longest(state, given.step_max))
        after = continuation.advance(equations, state, given)
        if not self._hides(state, after):
            return after
        at, width = self.narrow.T
        longest = np.maximum(0.5 * np.abs(state.y[-1] * equations.lam_scale - at), width).min() / equations.lam_scale
        return continuation.advance(equations, state, replace(given, step_max=min(given.step_max, float(longest))))

    def _hides(self, before: State, after: State) -> bool:
        """Whether a step passes something narrow that is not hit, or that is higher than both of its ends."""
        low, high = sorted(float(s.y[-1]) * self.equations.lam_scale for s in (before, after))
        passed = [at for at, width in self.narrow.tolist() if low < at < high and high - low > width]
        if not passed:
            return False
        seen = HIGHER * max(largest(s.y[:-1]) for s in (before, after))
        hit = {p.lam: largest(p.x / self.equations.x_scale) for p in after.found}
        return any(hit.get(at, np.inf) > seen for at in passed)


ALONG = Settings(points=3000, branch_points=False, angle=0.5, step=0.1, step_max=0.5, contraction=0.1)
"""How curves are followed, if not told otherwise."""


def along(default: Settings, given: Settings | Mapping[str, Any] | None) -> Settings:
    """How a curve is followed: as given, or by default but for what is given.

    Raises:
        UserError: a setting that there is not.
    """
    if isinstance(given, Settings):
        return given
    if odd := set(given or ()) - {f.name for f in fields(Settings)}:
        names = ", ".join(f.name for f in fields(Settings))
        raise UserError(f"settings: there is no {', '.join(sorted(odd))}; there are {names}")
    return replace(default, **(given or {}))


def _longest(state: State, step: float) -> float:
    """The longest step from a state: as given, but for x, which may change by `STEADY` of what it is."""
    x, t = norm(state.y[:-1]), state.tangent
    return step / math.hypot(t[-1], norm(t[:-1]) / max(1.0, STEADY / step * x))


STEADY = 0.05
"""Share by which x may change in a step however large it is: friction is hardly seen where all slides by far."""

HIGHER = 1.2
"""Times the ends of a step, from which on what it passes is looked at in shorter ones."""


def of_frequency(problem: Problem, low: float, high: float) -> Family:
    """Over the frequency, Hz."""
    a, b = 2 * np.pi * low, 2 * np.pi * high
    scaled = replace(problem, lam_scale=abs(b - a) / 10)
    return Family(scaled, a, b, 2 * np.pi, "Hz", lambda _: scaled, lambda Omega: Omega, _resonances(problem))


def _resonances(problem: Problem) -> Array:
    """(m, 2) rad/s of the modes with sticking contacts and of those without, and the half-power widths of the damped
    ones; between both friction makes resonances wide."""
    modes, damping = sticking_and_free(problem.assembly)
    Omega = 2 * np.pi * modes
    return np.column_stack([Omega, 2 * Omega * damping])[damping > 0]


def of_load(problem: Problem, frequency: float, low: float, high: float) -> Family:
    """Over the share of the loads that are not steady, at a frequency (Hz)."""
    Omega = 2 * np.pi * frequency
    equations = OverLoad(problem.at(Omega), problem.x_scale, abs(high - low) / 10)
    return Family(equations, low, high, 1.0, "of the load", problem.loaded, lambda _: Omega)


def of_normal_force(
    problem: Problem, frequency: float, low: float, high: float, contacts: frozenset[int] | None = None
) -> Family:
    """Over the factor on the normal forces of all contacts, or of some, at a frequency (Hz)."""
    Omega = 2 * np.pi * frequency
    equations = OverNormal(problem, Omega, problem.x_scale, abs(high - low) / 10, contacts)
    return Family(equations, low, high, 1.0, "of the normal force", equations.at, lambda _: Omega)


def followed(
    family: Family,
    report: Report = lambda _: None,
    settings: Settings | Mapping[str, Any] | None = None,
    begun: Branch | None = None,
    keep: Callable[[State], None] = lambda _: None,
    goes_on: Callable[[], bool] = lambda: True,
) -> Branch:
    """The curve from a solution at its beginning; without one a branch that says so.

    Args:
        begun: goes on from its state. keep: told of every state as it is found, with the points that are new.
            goes_on: asked before every step; a curve that does not has no status.
    """
    settings, equations = family.settings(settings), _Noted(family)
    if begun is None or begun.state is None:
        state = _begun(family, equations, settings)
        if isinstance(state, str):
            return Branch((), f"no start: {state}", None)
        begun = Branch((), state.status, state)
        keep(state)
        points = list(state.found)
    else:
        state, points = begun.state, list(begun.points)
    far = 0
    while not state.status and goes_on():
        state = equations.told(family.advanced(equations, state, settings))
        keep(state)
        points += state.found
        if state.found:
            far = max(far, int(100 * (points[-1].lam - family.begin) / (family.end - family.begin)))
            said = f"{len(points)} points, {points[-1].lam / family.unit:.6g} {family.words}"
            report(f"{far} of 100 % of the way, {said}")
    return Branch(tuple(points), state.status, state)


def _begun(family: Family, equations: _Noted, settings: Settings) -> State | str:
    """The first state; where there is none, why. Where all is smooth the linear response leads there at once."""
    problem, Omega = family.problem(family.begin), family.Omega(family.begin)
    if equations.smooth and family.known is None:
        state = continuation.start(equations, problem.at(Omega).reference, family.begin, settings)
        if not state.status:
            return state
    first = solve(problem, Omega, []) if family.known is None else _own(problem, Omega, family.known)
    if not first.converged:
        return first.status
    return equations.told(continuation.start(equations, first.x, family.begin, settings))


def with_peaks(family: Family, branch: Branch) -> Branch:
    """A curve over the frequency with the peaks of its first read-out between its points."""
    problem = family.equations
    if not isinstance(problem, Problem) or not problem.assembly.outputs:
        return branch

    def height(x: Array, Omega: float) -> float:
        at = problem.at(Omega)
        force = at.force(x)
        return float(abs(seen(at, at.modal(x, force), force)))

    return continuation.with_peaks(WithOutput(problem), branch, height)


CRITICAL: dict[Kind, Callable[[ComplexArray], float]] = {
    "branch point": lambda values: values.real[values.imag == 0].max(initial=0.0) - 1,
    "period doubling": lambda values: -values.real[values.imag == 0].min(initial=0.0) - 1,
    "Neimark-Sacker": lambda values: np.abs(values[values.imag != 0]).max(initial=0.0) - 1,
}
"""What falls or rises through zero where a motion gains or loses stability, by its multipliers."""

LOCATED = 1e-5
"""Share of a step to which such a place is located."""

CROSSED = 1e-2
"""How near the unit circle a multiplier is there; one further away has met another one, and crosses nothing."""


def with_stability(
    family: Family, branch: Branch, report: Report = lambda _: None
) -> tuple[Branch, list[Stability]]:
    """A curve with the places between its points where a multiplier leaves or enters the unit circle, and what the
    multipliers of every point are. One that leaves at 1 beside a fold is the fold's.

    Raises:
        UserError: a sector that stands for a ring.
    """
    equations = Scaled(family.equations)

    def at(x: Array, lam: float) -> Stability:
        return stability(orbit(family.problem(lam), x, family.Omega(lam)), Multipliers(steps=256))

    def of_place(y: Array, _: Array) -> Stability:
        return at(y[:-1] * equations.x_scale, float(y[-1]) * equations.lam_scale)

    points, judged = list(branch.points), list[Stability]()
    for number, p in enumerate(points, 1):
        report(f"stability of {number} of {len(points)} points")
        judged.append(at(p.x, p.lam))
    out, told, last = list[OnCurve](), list[Stability](), -1
    for i, (p, one) in enumerate(zip(points, judged, strict=True)):
        if p.kind == "fold" or (last >= 0 and p.arclength <= points[last].arclength):
            last = last if p.kind == "fold" else i
            out, told = [*out, p], [*told, one]
            continue
        for kind, test in CRITICAL.items() if last >= 0 else ():
            before, after = test(judged[last].multipliers), test(one.multipliers)
            beside = any(q.kind == "fold" for q in points[max(last - 1, 0) : i + 2])
            beside |= points[last].tangent[-1] * p.tangent[-1] < 0  # one that was not located
            if before * after >= 0 or (kind == "branch point" and beside):
                continue
            first = points[last]
            begin, end = (equations.pack(q.x, q.lam) for q in (first, p))
            segment = continuation.Segment(begin, end, first.tangent, p.tangent, p.kink)

            def value(y: Array, t: Array, of: Callable[[ComplexArray], float] = test) -> float:
                return of(of_place(y, t).multipliers)

            try:
                y, t = continuation.root(equations, segment, ALONG, value, LOCATED)
            except Lost:
                continue
            place = of_place(y, t)
            if abs(test(place.multipliers)) > CROSSED:
                continue  # it has only ceased to be real
            x, lam = y[:-1] * equations.x_scale, float(y[-1]) * equations.lam_scale
            out.append(OnCurve(x, lam, kind, False, first.arclength + norm(y - begin), t, 0))
            told.append(place)
        out, told, last = [*out, p], [*told, one], i
    return replace(branch, points=tuple(out)), told


@dataclass(frozen=True, eq=False)
class Eased:
    """R(x) - (1 - s) R(x_0), which x_0 solves at s = 0, and what solves the balance at s = 1, for `continuation`.

    Attributes:
        at: the balance at a frequency. left: (k,) R(x_0). x_scale, lam_scale: see `continuation.Equations`.
    """

    at: AtFrequency
    left: Array
    x_scale: float
    lam_scale: float = 1.0

    def evaluate(self, x: Array, s: float) -> tuple[Array, Array, Array]:
        """R - (1 - s) R(x_0), its derivatives by x and by s."""
        R, J, _ = self.at.evaluate(x)
        return R - (1 - s) * self.left, J, self.left


def _own(problem: Problem, Omega: float, known: Array) -> Point:
    """The solution (Omega in rad/s) into which one with fewer harmonics grows: what they leave out is admitted little
    by little. From afar Newton's method comes to any of several motions, and it is the last resort."""
    at, guess = problem.at(Omega), np.concatenate([known, np.zeros(problem.size - len(known))])
    eased = Eased(at, at.residual(guess), problem.x_scale)
    branch = led(eased, guess, 1.0)
    last = branch.points[-1] if branch.points else None
    return solve(problem, Omega, [last.x, guess] if last and last.lam == 1.0 else [guess])


def from_both_ends(
    family: Family, report: Report = lambda _: None, settings: Settings | Mapping[str, Any] | None = None
) -> tuple[Branch, ...]:
    """The curve of a family, and another one from the other end where the first does not arrive there.

    One that has too few points goes on with more of them, and needs no other.
    """
    first = followed(family, report, settings)
    if family.reached(first) or first.status.startswith("points"):
        return (first,)
    report("the curve does not arrive at the other end; another one begins there")
    return first, followed(family.turned, report, settings)


class _Noted:
    """The equations of a family; where they were asked for last is kept, for whoever asks why a curve ended."""

    def __init__(self, family: Family) -> None:
        self.family, self.last = family, (np.zeros(0), 0.0)
        self.x_scale, self.lam_scale = family.equations.x_scale, family.equations.lam_scale
        self.smooth = getattr(family.equations, "smooth", False)

    def evaluate(self, x: Array, lam: float) -> tuple[Array, Array, Array]:
        self.last = x, lam
        return self.family.equations.evaluate(x, lam)

    def told(self, state: State) -> State:
        """A state; one that no step leads on from says so if that is because a law has no value."""
        x, lam = self.last
        if len(x) and state.status.startswith(("stuck", "no start")):
            at = self.family.problem(lam).at(self.family.Omega(lam))
            return replace(state, status=f"stuck: {at.undefined(x)}" if at.undefined(x) else state.status)
        return state

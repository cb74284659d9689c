"""Steady forced vibration of an assembly: sweeps over frequency and what a reader asks of their points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize

from ..contact.patch import Patch
from ..continuation import SEARCH
from ..data import Array, ComplexArray, Compliance, ModalGroup, Rows, largest
from ..results.checks import BALANCE, EXCHANGED, UNCHECKED, Checks, exchanged
from ..results.series import of_solutions, without_rounding
from ..series import amplitudes
from ..system.assembly import Assembly, ContactFace, Load, Output, preloaded_contact
from ..system.component import Component
from ..units import counted
from . import problem as balance
from . import reduced, sweeps
from .checks import checks, judged
from .forces import Cycle, Traced
from .problem import Problem
from .readout import climbed, measured
from .reduced import own_coordinates, sticking_and_free
from .solver import CONVERGED as CONVERGED
from .solver import Point as Point
from .solver import Report, solve, sweep
from .solver import newton as newton
from .sweeps import FrequencyResponse, brackets, ends, inside, resonances, still

ROUNDED = 1e-14
"""Of the energy that the loads would exchange without what the contacts take off the motion, rounding leaves this:
a stop of 1e12 N/m that a steady force keeps closed takes all but a millionth of it off, and is lossless."""


@dataclass(frozen=True)
class Operating:
    """A periodic motion of an assembly.

    Attributes:
        Omega: rad/s. q: component -> (H + 1) arrays (m,) of complex amplitudes of its coordinates; the first one is the
            mean from the preloaded state. outputs: (w, H + 1) read-outs, m. relative: contact -> (k, W) displacement as
            the law measures it. force: contact -> (k, W) forces, N and N m. supplied, damped: J per cycle.
        exchanged: J that loads and contacts would do and take were they in phase with the speed; not less than what
            the rounding of the motions they are differences of would need. kinetic: J, the largest kinetic energy of
            every harmonic by itself, added up.
        cycles: contact -> what its points do. checks: of all this.
    """

    Omega: float
    q: Mapping[str, list[ComplexArray]]
    outputs: ComplexArray
    relative: Mapping[str, Array]
    force: Mapping[str, Array]
    supplied: float
    damped: float
    exchanged: float
    kinetic: float
    cycles: Mapping[str, Cycle]
    checks: Checks = UNCHECKED


def operating(problem: Problem, point: Point) -> Operating:
    """Everything that belongs to a solution."""
    at, p = problem.at(point.Omega), problem
    v = p.displacement(point.x)
    relative = [g.relative(v) for g in p.groups]
    forces = [g.force(u, at.period) for g, u in zip(p.groups, relative, strict=True)]
    cycles = [g.point_cycles(u, at.period) for g, u in zip(p.groups, relative, strict=True)]
    beyond = at.along(forces)
    q, f = at.modal(point.x, beyond), amplitudes(beyond)
    alone = at.coordinates(0 * beyond, p.share)
    bodies, each = p.assembly.components, q
    if len(p.slices) < len(bodies):
        each = [[one[s] for s in own_coordinates(p.assembly, h)] for h, (one,) in enumerate(q)]
    outputs, work, driven = np.zeros((len(p.assembly.outputs), p.harmonics + 1), complex), np.zeros(4), 0.0
    for hs in p.waves:
        for i, s in enumerate(p.slices):
            parts, own, F = [p.parts[h][i] for h in hs], np.array([q[h][i] for h in hs]), f[hs, s]
            share = p.share if hs[0] else 1.0
            outputs[:, hs] += reduced.read(parts, own, F, share)
            if hs[0]:
                work += reduced.work(parts, at.Omega, hs, own, F, share)
                driven += reduced.work(parts, at.Omega, hs, np.array([alone[h][i] for h in hs]), 0 * F, share)[2]
    motion = Operating(
        at.Omega,
        {m.name: list(own) for m, own in zip(bodies, zip(*each, strict=True), strict=True)},
        outputs,
        _by_contact(p, relative),
        _by_contact(p, forces),
        float(work[0]),
        float(work[1]),
        max(float(work[2]) + sum(float(exchanged(F, u).sum()) for F, u in zip(forces, relative, strict=True)),
            ROUNDED / EXCHANGED / BALANCE * float(driven)),
        float(work[3]),
        _by_contact(p, cycles),
    )
    return replace(motion, checks=checks(p, motion))


def traced(problem: Problem, found: Operating) -> dict[str, Traced]:
    """Contact -> what its force model makes of its points in the cycle of a solution."""
    each = [np.stack([found.relative[problem.assembly.contacts[i].name] for i in g.contacts]) for g in problem.groups]
    period = 2 * np.pi / found.Omega
    return _by_contact(problem, [g.traced(u, period) for g, u in zip(problem.groups, each, strict=True)])


def _by_contact(p: Problem, values: Sequence[Any]) -> dict[str, Any]:
    """Contact -> its value, from values by groups."""
    return dict(zip((c.name for c in p.assembly.contacts), p.by_contact(values), strict=True))


@dataclass(frozen=True)
class HarmonicResponse(FrequencyResponse):
    """`FrequencyResponse` whose points hold all harmonics; `monitor` and `slip` are of the first one.

    Attributes:
        x: (f, k) unknowns, see `Problem`. harmonics: (f, H + 1) complex 0-peak amplitudes of the first read-out, m; the
            mean is measured from the preloaded state. outputs: (f, w, H + 1) all read-outs. contact: (f, c, 2 H + 1)
            displacements of the contacts, m and rad.
        dissipated: work done on the contacts in time. by_slip: (f,) friction force times path slid, J.
        slipping, open: (f, patches) share of points times cycle that slips, or is open; the rest sticks.
        unsteady: (f,) see `patch.Cycle`.
        status: of every point. error, iterations: (f,), see `Point`.
    """

    x: Array
    harmonics: ComplexArray
    outputs: ComplexArray
    contact: Array
    by_slip: Array
    slipping: Array
    open: Array
    unsteady: Array
    status: tuple[str, ...]
    error: Array
    iterations: Array

    def columns(self) -> dict[str, Array]:
        name, a = self.quantity.column, without_rounding(self.harmonics)
        more = {name(f"amplitude_{h}"): np.abs(a[:, h]) for h in range(2, a.shape[1])}
        table = {
            name("mean"): a[:, 0].real,
            **more,
            "slip_dissipated_J": self.by_slip,
            "slipping": self.slipping.sum(axis=1) / max(self.slipping.shape[1], 1),
            "open": self.open.sum(axis=1) / max(self.open.shape[1], 1),
        }
        return {
            **super().columns(),
            **of_solutions(table, self.converged),
            "harmonics": np.full(len(self.frequency), self.harmonics.shape[1] - 1.0),
            "iterations": self.iterations.astype(float),
        }


def harmonic_response(
    problem: Problem, frequency: Array, report: Report = lambda _: None, start: Array | None = None
) -> HarmonicResponse:
    """`sweep`, and what a reader asks of its points."""
    return of_points(problem, sweep(problem, frequency, report, start))


def of_points(
    problem: Problem, points: Sequence[Point], found: Sequence[Operating] = (), asked: Array | None = None
) -> HarmonicResponse:
    """What a reader asks of solved points, in order of their frequencies where some of them were added.

    Args:
        found: what belongs to them, if it is known. asked: Hz, the others were added; None: all were asked for.
    """
    found = found or [operating(problem, p) for p in points]
    points = [judged(p, f.checks) for p, f in zip(points, found, strict=True)]
    if asked is not None and len(points) > len(asked):
        order = np.argsort([p.Omega for p in points], kind="stable")
        points, found = [points[i] for i in order], [found[i] for i in order]
    rows = [_looked_at(problem, f) for f in found]
    parts = {key: np.array([row[key] for row in rows]) for key in rows[0]}
    frequency = np.array([p.Omega for p in points]) / (2 * np.pi)
    added = np.zeros(len(points), dtype=bool)
    if asked is not None:
        added = np.abs(frequency[:, None] - asked).min(axis=1) > 1e-12 * np.abs(asked).max()
    return HarmonicResponse(
        frequency=frequency,
        converged=np.array([p.converged for p in points]),
        x=np.array([p.x for p in points]),
        status=tuple(p.status for p in points),
        error=np.array([p.error for p in points]),
        iterations=np.array([p.iterations for p in points]),
        quantity=measured(problem.assembly),
        added=added,
        **parts,
    )


def _looked_at(problem: Problem, found: Operating) -> dict[str, Any]:
    u = list(found.relative.values())
    first = [one[:, 1] - 1j * one[:, 2] for one in u]
    harmonics = found.outputs[0] if len(found.outputs) else np.zeros(problem.harmonics + 1, dtype=complex)
    cycles = list(found.cycles.values())
    return {
        "monitor": harmonics[1],
        "harmonics": harmonics,
        "outputs": found.outputs,
        "slip": [max(d[1:3] if len(d) > 2 else d, key=abs) for d in first],
        "contact": np.vstack(u) if u else np.zeros((0, problem.coefficients)),
        "dissipated": sum(float(c.dissipated.sum()) for c in cycles),
        "by_slip": sum(float(c.by_slip.sum()) for c in cycles),
        "supplied": found.supplied,
        "damped": found.damped,
        "slipping": [float(c.slipping.mean()) for c in cycles],
        "open": [float(c.open.mean()) for c in cycles],
        "unsteady": max((c.unsteady for c in cycles), default=0.0),
        **vars(found.checks),
    }


def of_body(
    group: ModalGroup, patches: tuple[Patch, ...], normal: Array, force: Array, output: Array, **settings: Any
) -> Problem:
    """The problem of one modal group whose patches are pressed to the ground by normal forces (Sextro Eq. (5.2-5)).

    Args:
        group: in modal or any other coordinates. normal: (patches,) N. force: (m,) modal force of the first harmonic.
            output: (m,) row that is read. settings: see `problem.of`.
    """
    empty = Compliance((), np.zeros((0, 0)), np.zeros((0, 0)), False)
    named = replace(
        group,
        excitations={"force": Rows(np.asarray(force)[None], ("force",), "m", np.zeros(3))},
        monitors={"output": Rows(np.asarray(output)[None], ("u",), "m", np.zeros(3))},
        compliance=empty,
    )
    contacts = tuple(
        preloaded_contact(p.interface, p, ContactFace("body", p.interface), None, normal=float(n))
        for p, n in zip(patches, np.asarray(normal, dtype=float), strict=True)
    )
    component = Component("body", {0: named})
    loads, read = (Load("body", "force"),), (Output("body", "output", "u"),)
    return balance.of(Assembly((component,), contacts, loads, read), **settings)


class Resonance(NamedTuple):
    """A peak of the first read-out between the points of a sweep: Hz, m, and its (size,) unknowns."""

    frequency: float
    amplitude: float
    x: Array


NONE = "no resonance in the band"
"""What is said of a band whose points all have a solution and show no peak."""


NOT_FOUND = "not found"
"""How the reason begins where points have no solution, so that there may be one."""


def no_resonance(response: HarmonicResponse, folds: Sequence[Resonance] = ()) -> str:
    """Why a response has no resonance: there is `NONE`, what is read does not move, or points have no solution or the
    curve turns back, so that none was found."""
    if still(response):
        return "the read-out does not move"
    if not (lost := unsolved(response, folds)):
        return NONE
    failed = np.flatnonzero(~response.converged)
    return f"{NOT_FOUND}: {lost}" + (f": {response.status[failed[0]]}" if len(failed) else "")


def unsolved(response: HarmonicResponse, folds: Sequence[Resonance] = ()) -> str:
    """Where the curve turns back, how many points have no solution, and where the first one is; nothing where there is
    none of these."""
    failed = np.flatnonzero(~response.converged)
    parts = [f"the curve turns back at {one.frequency:.6g} Hz, at a fold" for one in folds]
    if len(failed):
        points = counted(len(response.frequency), "point")
        parts.append(f"{len(failed)} of {points} did not converge, first at {response.frequency[failed[0]]:.6g} Hz")
    return "; ".join(parts)


def parted(
    response: FrequencyResponse, peaks: Sequence[Resonance]
) -> tuple[list[Resonance], list[Resonance]]:
    """Resonances, and the folds at which the curve that a sweep follows turns back or ends (`sweeps.ends`)."""
    turns = ends(response, [(one.frequency, one.amplitude) for one in peaks])
    tops, folds = list[Resonance](), list[Resonance]()
    for peak, turn in zip(peaks, turns, strict=True):
        (folds if turn else tops).append(peak)
    return tops, folds


def refined_peaks(problem: Problem, response: HarmonicResponse) -> list[Resonance]:
    """The peaks beside the tops of a sweep; of those of one plateau the highest, see `sweeps.prominent`; none of a
    read-out that does not move."""
    if still(response):
        return []
    tops = [highest(problem, response, bracket) for bracket in brackets(response)]
    return resonances(response, [Resonance(p.Omega / (2 * np.pi), a, p.x) for p, a in filter(None, tops)])


def highest(problem: Problem, response: HarmonicResponse, bracket: tuple[int, int, int]) -> tuple[Point, float] | None:
    """The peak of the curve of solutions beside three points of a sweep and its amplitude, m, if there is one.

    It is looked for between the outer two, in fourteen steps. If these do not close in on it from both sides, because
    the curve turns back or the contacts switch, it is climbed to along the curve, which may lead beyond the three
    points but not beyond the band. Where the climb fails the highest of the points stands for it.
    """
    f, (low, top, high) = response.frequency, bracket
    begin = Point(2 * np.pi * float(f[top]), response.x[top], CONVERGED, response.error[top], 0)
    tried = [(begin, float(abs(response.monitor[top])))]

    def amplitude(at: float, start: Array = begin.x) -> float:
        point = solve(problem, 2 * np.pi * at, [start])
        found = operating(problem, point)
        point = judged(point, found.checks)
        tried.append((point, float(abs(found.outputs[0, 1])) if point.converged else 0.0))
        return tried[-1][1]

    options: Any = {"xatol": 1e-6 * float(f[high] - f[low]), "maxiter": 14}
    ends = float(f[low]), float(f[high])
    scipy.optimize.minimize_scalar(lambda at: -amplitude(at), bounds=ends, method="bounded", options=options)
    near, height = max(tried, key=lambda one: one[1])
    if not inside(response, bracket, height, amplitude):
        return None
    if _closed_in(tried):
        return near, height
    band = replace(SEARCH, low=2 * np.pi * float(f[0]), high=2 * np.pi * float(f[-1]))
    found = climbed(problem, near.x, near.Omega, band)
    if found.converged and band.low < found.lam < band.high and amplitude(found.lam / (2 * np.pi), found.x) >= height:
        return tried[-1]
    return near, height


CLOSE = 1e-3
"""Share of a peak by which the response may be lower on both sides of it for it to be the highest between them, and by
which it may fall and rise again on the way there."""


def _closed_in(tried: list[tuple[Point, float]]) -> bool:
    """Whether some points rise to the highest and fall from it, those beside it hardly lower: no fold is between them,
    and no ripple hides a higher one."""
    height = np.array([a for _, a in sorted(tried, key=lambda one: one[0].Omega)])
    i, little = int(height.argmax()), CLOSE * height.max()
    if not 0 < i < len(height) - 1 or min(height[i - 1], height[i + 1]) < height[i] - little:
        return False
    return bool((np.diff(height[: i + 1]) > -little).all() and (np.diff(height[i:]) < little).all())


# points that a sweep is not asked for ------------------------------------------------------------


Solved = tuple[Point, Operating]


def filled_response(
    problem: Problem, frequency: Array, report: Report = lambda _: None,
    known: Mapping[float, Solved] | None = None, keep: Callable[[float, Solved, bool], None] = lambda *_: None,
) -> HarmonicResponse:  # fmt: skip
    """`response.harmonic_response`, with points added where the sweep may step over a resonance (`hidden`), past a fold
    or past the last solution beside none (`last_solutions`).

    Args:
        known: Hz -> what was found before. keep: told of every other
            point as soon as it is found: Hz, what was found, and whether it is added.
    """
    asked, solved = [float(f) for f in frequency], dict(known or {})

    def take(f: float, point: Point, added: bool = False) -> None:
        point = replace(point, Omega=2 * np.pi * f, slope=None)  # as it comes back from where it is kept
        solved[f] = point, operating(problem, point)
        keep(f, solved[f], added)

    sweep(problem, frequency, report, known={f: solved[f][0] for f in asked if f in solved}, keep=take)
    more = hidden(problem, frequency)
    for f in more:
        if f not in solved:
            report(f"a point is added at {f:.6g} Hz, a mode between two of the sweep")
            take(f, between(problem, [solved[g][0] for g in asked], f), True)
    for low, high in pairwise(sorted([*asked, *more])):
        one, other = solved[low][0], solved[high][0]
        before = [f for f in solved if low < f < high]
        if len(before) < one.converged + other.converged:
            said_last = ""
            for point in last_solutions(problem, one, other):
                words = f"a point is added at {point.Omega / (2 * np.pi):.6g} Hz, where the curve ends"
                if words != said_last:  # both sides of a fold may read alike
                    report(said_last := words)
                take(point.Omega / (2 * np.pi), point, True)
    chosen = asked + [f for f in solved if f not in asked]
    points, motions = zip(*(solved[f] for f in chosen), strict=True)
    return of_points(problem, points, motions, frequency)


def hidden(problem: Problem, frequency: Array) -> list[float]:
    """Hz of resonances that a sweep may step over, see `sweeps.hidden`: of sticking contacts, and of none."""
    if not problem.assembly.loads:
        return []
    modes_and_damping = sticking_and_free(problem.assembly)
    return sweeps.hidden(np.asarray(frequency, dtype=float), *modes_and_damping)


def between(problem: Problem, points: Sequence[Point], frequency: float) -> Point:
    """The solution at a frequency (Hz), begun at the nearest of others."""
    Omega = 2 * np.pi * frequency
    good = sorted((p for p in points if p.converged), key=lambda p: abs(p.Omega - Omega))
    return solve(problem, Omega, [p.x for p in good[:1]])


HALVINGS = 12
"""Times that the distance of two points is halved to find where the curve of solutions ends between them; a resonance
that is narrower than what is left cannot be told from a fold."""

JUMP = 0.2
"""Share of the vibration by which two points may differ and be of one curve."""


def last_solutions(problem: Problem, low: Point, high: Point) -> list[Point]:
    """Where the curve of solutions through a point ends before the next one: the last solutions on either side.

    It ends at a fold, beyond which the vibration is another one, or where no solution is found. None are told if both
    points are of one curve.
    """
    ends_asked = (low.Omega, high.Omega)
    for _ in range(HALVINGS):
        both = low.converged and high.converged
        if both and _apart(problem, low.x, high.x) <= JUMP:
            return []
        low, high = (_with_slope(problem, p) for p in (low, high))
        good = [p for p in (low, high) if p.converged]
        if not good or (both and _lead_to_each_other(problem, low, high)):
            return []
        at = problem.at(0.5 * (low.Omega + high.Omega))
        middle = next((p for g in good if (p := newton(at, g.x, most=20, slope=g.slope)).converged), None)
        if middle is None and both:
            break
        if middle is None:  # the end lies on this side of the middle
            nothing = Point(at.Omega, good[0].x, "", np.inf, 0)
            low, high = (low, nothing) if low.converged else (nothing, high)
        elif _apart(problem, low.x, middle.x) < _apart(problem, middle.x, high.x) if both else low.converged:
            low = middle
        else:
            high = middle
    return [p for p in (low, high) if p.converged and p.Omega not in ends_asked]


def _with_slope(problem: Problem, point: Point) -> Point:
    """A solution with the derivative of its contact forces."""
    if not point.converged or point.slope is not None:
        return point
    return replace(point, slope=problem.at(point.Omega).forces(point.x)[1])


def _lead_to_each_other(problem: Problem, low: Point, high: Point) -> bool:
    """Whether the contacts of each point, linear as they are there, lead to the other one: between them is a resonance
    that is narrow because damping is low."""
    for a, b in ((low, high), (high, low)):
        at = problem.at(b.Omega)
        reached = a.x + at.jacobian(a.slope).solve(-at.residual(a.x))
        if not _apart(problem, reached, b.x) <= JUMP:
            return False
    return True


def _apart(problem: Problem, x: Array, y: Array) -> float:
    """Difference of two vibrations over the larger one; where their means are may be undetermined."""
    x, y = x[problem.count :], y[problem.count :]
    return largest(x - y) / max(largest(x), largest(y), 1e-300)

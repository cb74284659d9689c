"""Newton's method on the balance of an assembly, and sweeps: point after point, failures recorded."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from .. import continuation
from ..data import Array, largest
from ..errors import NotConverged, UserError
from ..interrupts import look
from ..progress import Report as Report
from ..settings.mistakes import bounded
from ..units import hertz
from . import pseudo_transient
from .forces import AFT
from .problem import AWAY, NO_NUMBER, AtFrequency, Problem

CONVERGED = "converged"
TURNS = "turns back"
FROM_ABOVE = "nor from the frequency above"


@dataclass(frozen=True)
class Point:
    """A solution at one frequency.

    Attributes:
        Omega: rad/s. x: see `Problem`. status: `CONVERGED`, or what went wrong, the cause before a colon.
        error: largest entry of R over the largest of x. iterations: Newton steps, all attempts together.
        slope: the last derivative of the contact forces. history: `error` before every Newton step,
            attempt after attempt.
    """

    Omega: float
    x: Array
    status: str = CONVERGED
    error: float = 0.0
    iterations: int = 0
    slope: Any = None
    history: tuple[float, ...] = ()

    @property
    def converged(self) -> bool:
        return self.status == CONVERGED

    @property
    def away(self) -> bool:
        """Whether a body slides away, so that there is no periodic motion to be found."""
        return AWAY in self.status

    @property
    def walked(self) -> bool:
        """Whether it was tried from the frequency above as well, without a solution."""
        return FROM_ABOVE in self.status

    @property
    def undefined(self) -> bool:
        """Whether a law had no value on the way."""
        return NO_NUMBER in self.status


ROUNDING = 4.0
"""Times the rounding of the preloads and of what contacts make of their motion, at which R counts as nothing, if that
is less than `AT_MOST` of x: forces that press a contact a million times more than anything moves it, and springs a
million times stiffer than what is taken into the bodies, leave no more of R than their last digits."""

AT_MOST = 1e-5
"""Share of x that rounding may be."""

CONTRACTION, OF_MANY = 0.1, 0.5
"""Share of |R| that a step may leave for the derivative to be used again: a new one costs three or four residuals. Of
bodies eliminated together, with many points that are marched, it costs six and a step costs next to nothing."""

RISES = 5
"""How often a step is taken whole although |R| rises: the derivatives of the pieces that it leads to find the solution
where shorter steps creep along the kinks. The vane of docs/python.md takes a fifth of the evaluations."""

SHORTEST = 0.02
"""Share of a step that is not halved any more: where contacts switch |R| rises at first however short it is, and from
there the next derivative leads on."""


def newton(
    at: AtFrequency, x: Array, tolerance: float = 1e-10, most: int = 60, slope: Any = None, rises: int = RISES,
    patience: int | None = None,
) -> Point:  # fmt: skip
    """Newton's method; derivatives of the forces are used again while they serve.

    Derivatives are those of few points where a contact has many, until a step by them leaves too much.

    The contact forces are continuous with a piecewise continuous derivative. Where a step crosses to other pieces |R|
    may rise, though the derivative beyond leads on: so steps are taken whole. Where that does not end, they are halved
    until |R| falls, from the start again.

    Args:
        x: start. tolerance: of the largest entry of R over that of x, which counts within 1e-3 and 1e3 of the
            reference's; no less than what `ROUNDING` leaves.
        slope: derivative of the forces somewhere near, to begin with. rises: how often |R| may rise. patience: steps
            that may go by before R is half of what it was; None: all.
    """
    if at.lost:
        return Point(at.Omega, np.full_like(x, np.nan), at.lost, np.nan, 0)
    start, fresh, history, left_over = x, False, list[float](), rises

    def ended(status: str, iterations: int, error: float, slope: Any = None) -> Point:
        return Point(at.Omega, x, status, error, iterations, slope, tuple(history))

    halved, last, whole = np.inf, 0, False
    R, seen = at.tried(x)
    many = any(isinstance(g.model, AFT) and g.model.many for g in at.problem.groups)
    contraction = OF_MANY if many and len(at.problem.slices) == 1 else CONTRACTION
    reference, error = largest(at.reference) or 1.0, np.inf  # where nothing drives, the length
    for count in range(most):
        look()
        size = np.clip(largest(x), 1e-3 * reference, 1e3 * reference)
        error = float(largest(R) / size)
        history.append(error)
        if not np.isfinite(error):
            return ended(at.undefined(x) or "not a number", count, error)
        if error <= max(tolerance, min(ROUNDING * (at.rounding[0] / size + at.rounding[1]), AT_MOST)):
            return ended(CONVERGED, count, error, slope)
        if error < 0.5 * halved:
            halved, last = error, count
        elif patience is not None and count - last >= patience:
            return ended(f"|R|/|x| = {halved:.1e} was not halved in {patience} steps", count, error)
        if slope is None:
            slope, fresh = at.slopes(x, whole), True
            if not all(np.isfinite(S).all() for S in slope):
                return ended(at.undefined(x) or "not a number", count, error)
        step = at.jacobian(slope).solve(-R)
        left, shown = at.tried(x + step, seen)
        before, after = np.linalg.norm(R), np.linalg.norm(left)
        if after <= contraction * before:
            slope, fresh = at.secant(slope, seen, shown), False
            x, R, seen = x + step, left, shown
            continue
        whole = whole or fresh
        if fresh and not rises:  # the longest of 1, 1/2, ... of the step that lowers |R|
            share = 1.0
            while not np.linalg.norm(left) < before and share > SHORTEST:
                share *= 0.5
                left, shown = at.tried(x + share * step, shown)
            x, R, seen = x + share * step, left, shown
        elif after < before or fresh and left_over and np.isfinite(after):
            left_over -= not after < before
            x, R, seen = x + step, left, shown
        elif fresh:
            break
        slope, fresh = None, False  # an old one that does not serve is taken anew, here or there
    if rises:
        again = newton(at, start, tolerance, most, rises=0)
        whole_way = (*history, *again.history)
        return replace(again, iterations=len(history) + again.iterations, history=whole_way)
    return ended(f"no convergence in {most} steps, |R|/|x| = {error:.1e}", most, error)


def solve(
    problem: Problem, Omega: float, starts: list[Array], slope: Any = None, along_load: bool = True,
    tolerance: float = 1e-10, report: Report = lambda _: None,
) -> Point:  # fmt: skip
    """Newton's method from one start after the other, then from the sticking contact, then from rest in
    pseudo-time, then along the load, which of many bodies takes minutes.

    Args:
        tolerance: of Newton's method from starts, see `newton`. report: is told of ways that take long.

    Raises:
        UserError: a frequency that is not positive.
    """
    bounded("frequency", Omega / (2 * np.pi), gt=0)
    at, spent, status = problem.at(Omega), 0, ""
    if at.lost:
        return newton(at, at.reference)
    history: tuple[float, ...] = ()
    for way, said in _ways(problem, at, [*starts, at.reference], slope, along_load, tolerance):
        if said:
            report(said)
        point = way()
        spent, history = spent + point.iterations, (*history, *point.history)
        if point.converged or point.away:
            break
        status = status or (point.status if point.undefined else "")
    else:
        point = replace(point, status=status or point.status)
    if not point.converged:
        point = replace(point, status=f"{_cause(at, point)}: {point.status}")
    return replace(point, iterations=spent, history=history)


def resting(problem: Problem, Omega: float) -> Point:
    """The state of rest under the steady loads, whatever the frequency (rad/s).

    Raises:
        NotConverged: none is found.
    """
    point = solve(still := problem.loaded(0.0), Omega, [np.zeros(still.size)], along_load=False)
    if not point.converged:
        raise NotConverged(f"no state of rest under the steady loads is found: {point.status}")
    return point


def _cause(at: AtFrequency, point: Point) -> str:
    """Why there is no solution, as far as its last approximation tells."""
    if point.away:
        return "no balance"
    if point.undefined or not np.isfinite(point.error):
        return "not a number"
    p, v = at.problem, at.problem.displacement(point.x)
    if p.groups and not any(np.abs(g.force(g.relative(v), at.period)).any() for g in p.groups):
        return "gaping contacts"
    return "fold" if TURNS in point.status else "iteration limit"


def _ways(
    problem: Problem, at: AtFrequency, starts: list[Array], slope: Any, along_load: bool, tolerance: float
) -> Iterator[tuple[Callable[[], Point], str]]:  # fmt: skip
    """Ways to a solution, and what is said of those that take long."""
    rises = _rises(problem)
    patient = rises or not pseudo_transient.serves(problem)
    way = partial(newton, rises=rises) if patient else among
    yield from ((partial(way, at, x, slope=slope, tolerance=tolerance), "") for x in starts)
    if not patient:
        yield from ((partial(newton, at, x, tolerance, rises=rises), "") for x in starts[:PATIENT])
    if pseudo_transient.serves(problem):
        yield partial(from_rest, problem, at.Omega), "once more from rest"
    if along_load:
        yield partial(_raised, problem, at.Omega), "once more along the load"


AMONG, PATIENCE = 20, 8
"""Steps of Newton's method at most among many bodies, where pseudo-time serves, and those without half of the residual
before: what arrives takes some five."""


def among(at: AtFrequency, x: Array, slope: Any = None, tolerance: float = 1e-10) -> Point:
    """Newton's method among many bodies."""
    return newton(at, x, tolerance, most=AMONG, slope=slope, rises=0, patience=PATIENCE)


PATIENT = 2
"""Starts from which all steps are taken before pseudo-time, which costs more: where many contacts begin to slide at
once |R| may stay what it is for twenty steps and then fall."""


def _rises(problem: Problem) -> int:
    """How often |R| may rise: of many bodies some contact always leads the wrong way."""
    return RISES if len(problem.slices) == 1 else 0


def from_rest(problem: Problem, Omega: float) -> Point:
    """The vibration that the assembly comes to from rest, in pseudo-time with steps that grow (`slow`).

    Where the place of a body remains undetermined, the one that it came to is taken, if the mean forces balance there.
    """
    at, spent, rate, rises = problem.at(Omega), 0, FIRST * Omega, _rises(problem)
    q, point = pseudo_transient.at_rest(problem), Point(Omega, np.zeros(problem.size), "", np.inf, 0)
    for count in range(SLOW):
        step = pseudo_transient.slowly(at, rate, q)
        trial = newton(step, point.x, TOLERANCE, most=20 if rises else 10, slope=point.slope, rises=rises)
        spent += trial.iterations
        if not trial.converged:
            rate, point = 4 * rate, replace(point, slope=None)
            continue
        point, q = trial, step.modal(trial.x, step.force(trial.x))
        rate *= 0.5
        if rate < LAST * Omega and count % 3 == 0:
            last = _ended(at, point, q)
            spent += last.iterations
            if last.converged or last.away:
                return replace(last, iterations=spent)
    error = float(np.abs(at.residual(point.x)).max() / max(np.abs(point.x).max(), 1e-300))
    return Point(Omega, point.x, f"no rest in {SLOW} steps of pseudo-time", error, spent)


SLOW = 60
"""Steps of pseudo-time at most."""

FIRST = 0.3
"""Rate of the first step of pseudo-time over the frequency of the vibration."""

LAST = 1e-3
"""Rate over frequency from which on Newton's method is tried."""

TOLERANCE = 1e-9
"""Of the balances on the way."""


def _ended(at: AtFrequency, point: Point, q: pseudo_transient.Places) -> Point:
    """Newton's method where pseudo-time ends; where that fails, with the place of what nothing holds left as it is."""
    rises = _rises(at.problem)
    direct = newton(at, point.x, most=20 if rises else 10, slope=point.slope, rises=rises)
    if direct.converged or not pseudo_transient.unheld(at.problem):
        return direct
    in_place = pseudo_transient.in_place(at, q)
    fixed = newton(in_place, point.x, most=20)
    spent = direct.iterations + fixed.iterations
    if not fixed.converged:
        return replace(direct, iterations=spent)
    last = newton(at, fixed.x, most=1)
    if last.converged:
        return replace(last, iterations=spent)
    force, whom = pseudo_transient.unbalanced(at, q, in_place.modal(fixed.x, in_place.force(fixed.x)))
    words = (
        f"{whom} {AWAY}: nothing balances a mean force of {force:.2g} N on it; give the body weak_springs or a spring"
    )
    return replace(last, status=words, iterations=spent)


@dataclass(frozen=True, eq=False)
class OverLoad:
    """The balance at one frequency over the share of the loads that are not steady, for `continuation`."""

    at: AtFrequency
    x_scale: float
    lam_scale: float = 1.0

    def evaluate(self, x: Array, share: float) -> tuple[Array, Array, Array]:
        """R, dR/dx, dR/dshare."""
        at = replace(self.at, problem=self.at.problem.loaded(share))
        force, slope = at.forces(x)
        return at.residual_of(x, force), at.jacobian(slope).dense(), at.load_rate()


UNFINISHED = (
    "the curve over the load is not followed to its end (more samples, softer contacts or a motion in time may lead "
    "there); it ends"
)


def led(family: continuation.Equations, x: Array, whole: float) -> continuation.Branch:
    """The curve of solutions from x (size,) at 0 to the whole of what is changed, which may turn back on its way."""
    settings = continuation.Settings(low=0.0, high=whole, points=150, step=0.05, step_max=0.3, branch_points=False)
    return continuation.trace(family, x, 0.0, settings)


def _raised(problem: Problem, Omega: float) -> Point:
    """The load from nothing to its whole size along the curve of solutions, which may turn back on its way."""
    at, whole = problem.at(Omega), problem.share
    family = OverLoad(at, max(largest(at.reference), 1e-3))
    branch = led(family, replace(at, problem=at.problem.loaded(0.0)).reference, whole)
    spent = sum(p.evaluations for p in branch.points)
    if branch.points and branch.points[-1].lam == whole:
        point = newton(at, branch.points[-1].x)
        return replace(point, iterations=spent + point.iterations)
    x = branch.points[-1].x if branch.points else at.reference
    reached = branch.points[-1].lam / whole if branch.points and whole else 0.0
    error = float(np.abs(at.residual(x)).max() / max(np.abs(x).max(), 1e-300))
    turned = sum(p.kind == "fold" for p in branch.points)
    words = f"the curve over the load {TURNS} {turned} times and ends" if turned else UNFINISHED
    return Point(Omega, x, f"{words} at {reached:.3g} of the load", error, spent)


def sweep(
    problem: Problem, frequency: Array, report: Report = lambda _: None, start: Array | None = None,
    known: Mapping[float, Point] | None = None, keep: Callable[[float, Point], None] = lambda *_: None,
) -> list[Point]:  # fmt: skip
    """Solutions at frequencies (Hz) in the given order, each started from its neighbours. A failure is recorded.

    What failed is tried again from the neighbour behind it, where that one has a solution. A point depends on what
    those before it are, and on nothing else of how they were found, so that a sweep goes on as if nobody had stopped
    it.

    Args:
        start: (k,) where the first point starts; the sticking contact if None. known: Hz -> point that was found
            before. keep: told of every other frequency and its point as soon as it is found.

    Raises:
        UserError: no frequency, or one that is not positive.
    """
    if not len(frequency):
        raise UserError("frequency: a sweep needs one or more, Hz")
    bounded("frequency", frequency, gt=0)
    done: list[Point] = []
    solved = 0
    known = known or {}
    for i, f in enumerate(frequency):
        if float(f) in known:
            done.append(known[float(f)])
            continue
        failed = sum(not p.converged for p in done)
        told = f"{i + 1} of {len(frequency)} frequencies: {hertz(f)}" + (f", {failed} not converged" if failed else "")
        report(told)
        good = _behind(done)
        starts = [] if start is None or done else [start]
        if good:
            starts = [_ahead(good, 2 * np.pi * f), good[-1].x] if len(good) > 1 else [good[-1].x]
        began = time.perf_counter()

        def also(said: str, told: str = told) -> None:
            report(f"{told}; {said}")

        point = solve(problem, 2 * np.pi * float(f), starts, report=also)
        done.append(replace(point, slope=None))
        keep(float(f), done[-1])
        solved += 1
        left, each = sum(float(f) not in known for f in frequency[i + 1 :]), time.perf_counter() - began
        if solved == TIMED and each * left > LONG:
            report(
                f"warning: {left} frequencies are left and the last one took {each:.3g} s, so they take about "
                f"{each * left / 60:.3g} minutes; fewer points, harmonics or samples of the contacts take less"
            )
    for i in range(len(done) - 2, -1, -1):  # from the other side, along which there may be a way
        if not (done[i].converged or done[i].away or done[i].walked) and done[i + 1].converged:
            report(f"{i + 1} of {len(frequency)} frequencies: {hertz(frequency[i])} once more, from above")
            done[i] = _walked(problem, done[i + 1], done[i])
            keep(float(frequency[i]), done[i])
    return done


LONG, TIMED = 600.0, 3
"""s that a sweep may take before it is told how long it will, and the point that tells it: those before it compile."""


def _walked(problem: Problem, known: Point, failed: Point) -> Point:
    """The failed point, reached from a known one in steps of frequency that are shortened where need be."""
    last, step, spent, way = known, 1.0, failed.iterations, failed.Omega - known.Omega
    while step > 1 / 64:
        Omega = last.Omega + step * way
        Omega = failed.Omega if abs(Omega - known.Omega) >= abs(way) else Omega
        point = newton(problem.at(Omega), last.x, most=30)
        spent += point.iterations
        if not point.converged:
            step *= 0.5
        elif Omega == failed.Omega:
            return replace(point, iterations=spent)
        else:
            last = point
    return replace(failed, status=f"{failed.status}, {FROM_ABOVE}", iterations=spent)


MOST = 5
"""Solved points before one that its start is told by."""


def _behind(done: list[Point]) -> list[Point]:
    """The last points of a sweep, as far as they are solved and of different frequencies."""
    good: list[Point] = []
    for p in done[: -MOST - 1 : -1]:
        if not p.converged or any(p.Omega == q.Omega for q in good):
            break
        good.insert(0, p)
    return good


def _ahead(points: list[Point], Omega: float) -> Array:
    """Solutions carried on to another frequency by the polynomial, of first order or more, that tells the last best."""
    *known, last = points
    orders = range(2, len(points))
    missed = [largest(carried(known[-n:], last.Omega) - last.x) for n in orders]
    return carried(points[-orders[int(np.argmin(missed))] :] if missed else points, Omega)


def carried(points: list[Point], Omega: float) -> Array:
    """Lagrange's polynomial through all of them."""
    at = np.array([p.Omega for p in points])
    return sum(p.x * np.prod((Omega - np.delete(at, i)) / (at[i] - np.delete(at, i))) for i, p in enumerate(points))

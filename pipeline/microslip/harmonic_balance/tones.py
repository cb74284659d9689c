"""Quasi-periodic motions solved for: starts, what belongs to a solution, and how much it leaves out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize

from ..continuation import CONVERGED, newton
from ..data import Array, largest
from ..errors import UserError
from ..progress import Report
from ..results.journal import Journal, once
from ..results.tones import TwoTones
from ..series import Torus, commensurate, differentiated, summed
from ..settings.mistakes import numbered
from ..units import hertz
from . import reduced
from .readout import measured
from .two_tone import Stacked, TwoTone

SMALLEST = 1.0 / 64
"""Share of the loads by which a solution is led from little load to the whole one at least."""

FADED = 1e-6
"""Share of the largest amplitude below which a free second tone has died out."""


class TwoTonePoint(NamedTuple):
    """A solution. first, second: rad/s. x: (n,) unknowns. status. error: see `continuation.Solution`."""

    first: float
    second: float
    x: Array
    status: str
    error: float


@dataclass(frozen=True, eq=False, repr=False)
class Solved(TwoTones):
    """`TwoTones` that were solved for here. Attributes: points. balances: (f,) of each."""

    points: tuple[TwoTonePoint, ...] = field(default=())
    balances: tuple[TwoTone, ...] = field(default=())

    def error_estimate(self, i: int = 0, readout: int = 0) -> float:
        """Three times what twice the harmonics, samples and turns change of a point's amplitudes, the largest change
        over the largest amplitude, as `harmonic_balance.accuracy` counts.

        Raises:
            UserError: a point that was not found.
        """
        numbered("i", i, len(self), "point")
        own = self.points[i]
        if own.status != CONVERGED:
            raise UserError(f"error_estimate: point {i} was not found ({own.status}); take one that was")
        finer = refined(self.balances[i]).at(own.first, own.second)
        other = solve(finer, own.first, own.second, [_spread(self.balances[i], own.x, finer)])
        if other.status != CONVERGED:
            return float("inf")
        a, b = (_amplitudes(*one)[readout] for one in ((self.balances[i], own), (finer, other)))
        by_pair = {tuple(k): v for k, v in zip(self.pairs.tolist(), a, strict=True)}
        pairs = [(0, 0), *map(tuple, finer.torus.pairs.tolist())]
        size = largest(a[1:]) or 1.0
        turn = _turned(by_pair, dict(zip(pairs, b, strict=True))) if self.balances[i].free else 0.0
        change = [by_pair.get(k, 0.0) - v * np.exp(1j * k[1] * turn) for k, v in zip(pairs, b, strict=True)]
        return float(3 * np.abs(change).max() / size)


def _turned(a: dict[Any, complex], b: dict[Any, complex]) -> float:
    """rad by which the second angle of b is behind that of a."""
    return float(np.angle(a[0, 1] / b[0, 1])) if b[0, 1] else 0.0


def refined(b: TwoTone) -> TwoTone:
    """With twice the harmonics, and one more for laws that answer odd with odd ones, twice the samples and turns."""
    torus = replace(b.torus, order=2 * b.torus.order + 1, count=4 * b.torus.count)
    contacts = tuple(one.on(torus) for one in b.contacts)
    other = replace(b, torus=torus, contacts=contacts, least=2 * b.least)
    return other if b.reference is None else replace(other, reference=_coefficients(b, b.reference, other))


def _coefficients(b: TwoTone, v: Array, other: TwoTone) -> Array:
    """(W, c) of another balance, missing ones zero."""
    out = np.zeros((other.torus.coefficients, v.shape[1]))
    at = {tuple(k): i for i, k in enumerate(b.torus.pairs.tolist())}
    out[0] = v[0]
    for j, k in enumerate(map(tuple, other.torus.pairs.tolist())):
        if k in at:
            out[2 * j + 1 : 2 * j + 3] = v[2 * at[k] + 1 : 2 * at[k] + 3]
    return out


def _spread(b: TwoTone, x: Array, other: TwoTone) -> Array:
    """Unknowns of another balance."""
    v = _coefficients(b, b.displacement(x), other) / other.problem.scale
    return np.concatenate([v.ravel(), x[b.size :]])


def solve(b: TwoTone, first: float, second: float, starts: Sequence[Array]) -> TwoTonePoint:
    """A motion at two frequencies (rad/s), from one of several starts or led there from little load."""
    solution = None
    for x in starts:
        own = replace(b, reference=b.displacement(x)) if b.free else b
        solution = newton(own, x, first)
        if solution.converged:
            break
    if solution is None or not (solution.converged or b.free):
        solution = _led(b, first) or solution or newton(b, np.zeros(b.size), first)
    status = CONVERGED if solution.converged else solution.status
    if b.free:
        second = float(solution.x[-1])
        if status == CONVERGED and not _vibrates(b, solution.x):
            status = "the second tone has died out: the motion repeats with the first one; start from another motion"
    return TwoTonePoint(first, second, solution.x, status, solution.error)


def _vibrates(b: TwoTone, x: Array) -> bool:
    """Whether there is a second tone."""
    v = b.displacement(x) / b.problem.scale
    with_second = np.repeat(b.torus.pairs[:, 1] != 0, 2)
    return largest(v[1:][with_second]) > FADED * largest(v)


def _led(b: TwoTone, first: float) -> Any:
    """The solution of the whole loads by growing shares of them; None where one is not found."""
    x, share, step, solution = np.zeros(b.size), 0.0, 0.25, None
    while share < 1.0:
        tried = min(1.0, share + step)
        solution = newton(replace(b, shares=(tried, tried)), x, first)
        if solution.converged:
            x, share, step = solution.x, tried, 1.5 * step
        elif (step := 0.5 * step) < SMALLEST:
            return None
    return solution


SERIES = "two tones"
"""Of the journal."""


def swept(
    b: TwoTone, first: Array, second: Array, start: Array | None, report: Report, kept: Journal | None = None
) -> Solved:  # fmt: skip
    """Motions at frequencies (f,), rad/s, each from its neighbours. start: (n,) unknowns of the first one. kept: holds
    those that are known from a run that did not end, and each by its number the moment it is found."""
    points, balances, solutions = list[TwoTonePoint](), list[TwoTone](), [] if start is None else [start]
    for i, (one, two) in enumerate(zip(first.tolist(), second.tolist(), strict=True)):
        here = b.at(one, solutions[-1][-1] if b.free else two)
        starts = [*solutions[::-1][:1], *([] if b.free else [np.zeros(b.size)])]
        row = once(kept, SERIES, i, lambda: solve(here, one, two, starts)._asdict())  # noqa: B023
        found = TwoTonePoint(**row)
        points.append(found)
        balances.append(here)
        if found.status == CONVERGED:
            solutions.append(found.x)
        report(f"{i + 1} of {len(first)} points, {hertz(one / (2 * np.pi))} and {hertz(found.second / (2 * np.pi))}")
    return of_points(points, balances)


def of_points(points: Sequence[TwoTonePoint], balances: Sequence[TwoTone]) -> Solved:
    """What a reader asks of solved points."""
    b, turn = balances[0], 2 * np.pi
    works = np.array([_powers(*one) for one in zip(balances, points, strict=True)])
    pairs = np.vstack([[0, 0], b.torus.pairs])
    assembly = b.problem.assembly
    units = tuple(measured(assembly, i).unit for i in range(len(assembly.outputs)))
    return Solved(
        np.array([p.first for p in points]) / turn, np.array([p.second for p in points]) / turn, pairs,
        np.array([_amplitudes(*one) for one in zip(balances, points, strict=True)]),
        tuple(f"{w.monitor} {w.label}" for w in assembly.outputs), units,
        works[:, :2], works[:, 2], works[:, 3], works[:, 4], tuple(p.status for p in points),
        np.array([p.error for p in points]), _said(points, b), points=tuple(points), balances=tuple(balances),
    )  # fmt: skip


def _said(points: Sequence[TwoTonePoint], b: TwoTone) -> tuple[str, ...]:
    """What a reader must know: common periods."""
    for p in points:
        if small := commensurate(p.first, p.second, b.torus.order):
            return (
                f"At {hertz(p.first / (2 * np.pi))} the frequencies are as {small[0]} to {small[1]}, so that there the "
                "motion repeats: what is given holds for every phase between the tones; one phase alone is found by "
                "harmonic_response with loads of these harmonics of the common frequency.",
            )
    return ()


class _Shown(NamedTuple):
    """Of the mean and every pair: parts, |k . omega|, amplitudes of bodies q and contact forces F, conjugate where the
    frequency is negative; (P + 1,) signs. force: (W, c) of the contacts."""

    parts: list[Any]
    w: Array
    q: list[Any]
    F: list[Any]
    sign: Array
    force: Array


def _shown(b: TwoTone, p: TwoTonePoint) -> _Shown:
    v = b.displacement(p.x)
    force = b.forces(v, p.first, p.second, slopes=False)[0]
    views, w = b.views(p.first, p.second), b.torus.frequencies(p.first, p.second)
    stacked = Stacked(views, w)
    F, g = stacked.complex(force), stacked.complex(force - v @ b.problem.stiffness[0].T)
    q = [one.modal - one.modal_compliance @ own for one, own in zip(views, g, strict=True)]
    parts = [b.parts[0, 0], *(b.linear(k)[0] for k in b.torus.pairs)]
    return _Shown(parts, np.append(0.0, np.abs(w)), q, list(F), stacked.sign, force)


def _amplitudes(b: TwoTone, p: TwoTonePoint) -> Array:
    """(w, P + 1) complex, of the pairs as they are named."""
    s = _shown(b, p)
    each = [reduced.monitored(part, q, F) for part, q, F in zip(s.parts, s.q, s.F, strict=True)]
    return np.array([y if sign > 0 else y.conj() for y, sign in zip(each, s.sign, strict=True)]).T


def _powers(b: TwoTone, p: TwoTonePoint) -> list[float]:
    """W: of the loads of either tone, in the bodies, into the contacts by harmonics, and by the contacts' own count."""
    s, supplied, damped = _shown(b, p), [0.0, 0.0], 0.0
    for k, part, w, q, F in zip(b.torus.pairs, s.parts[1:], s.w[1:], s.q[1:], s.F[1:], strict=True):
        if w:
            done, lost, *_ = reduced.work([part], float(w), [1], q[None], F[None])
            supplied[int(k[0] == 0)] += done * w / (2 * np.pi)
            damped += lost * w / (2 * np.pi)
    speed = differentiated(b.torus.frequencies(p.first, p.second)) @ b.displacement(p.x)
    exchanged = 0.5 * float((s.force[1:] * speed[1:]).sum())
    return [*supplied, damped, exchanged, b.lost(p.x, p.first)]


def from_time(b: TwoTone, time: Array, d: Array, first: float, around: float) -> tuple[TwoTone, Array]:
    """The balance in units of motions d (c, t) of the contacts in time, and its unknowns by them.

    The second frequency (rad/s) is looked for near `around`, where two-tone series fit the motion best.

    Raises:
        UserError: a motion that shows no second frequency there.
    """
    offset = np.zeros(b.problem.count)
    for one in b.contacts:
        offset[one.group.first] = one.group.offset
    moved = d.T - offset
    size = largest((moved - moved.mean(axis=0)) / b.problem.scale)
    b = replace(b, problem=replace(b.problem, length=b.problem.length * (0.1 * size or 1.0)))
    y = moved / b.problem.scale
    few = replace(b.torus, order=min(b.torus.order, 5))

    def fitted(second: float, torus: Torus, which: Any = slice(None)) -> tuple[Array, float]:
        E = summed(time[:, None] * torus.frequencies(first, second)[which])
        c, *_ = np.linalg.lstsq(E, y, rcond=None)
        return c, float(np.square(E @ c - y).sum())

    span = np.pi / (time[-1] - time[0])
    grid = np.arange(0.85 * around, 1.15 * around, span)
    line = (few.pairs[:, 1] == 0) | (few.pairs == [0, 1]).all(axis=1)  # the strongest line, not a combination of two
    best = grid[int(np.argmin([fitted(g, few, line)[1] for g in grid]))]
    options: Any = {"xatol": 1e-10 * around}
    bounds = (best - span, best + span)

    def missed(second: float) -> float:
        return fitted(second, few)[1]

    fit = scipy.optimize.minimize_scalar(missed, bounds=bounds, method="bounded", options=options)
    c = fitted(float(fit.x), b.torus)[0]
    x = np.append(c.ravel(), fit.x)
    if not _vibrates(b, x):
        raise UserError("second: the motion in time shows no second frequency near it; correct second, or the start")
    return b, x

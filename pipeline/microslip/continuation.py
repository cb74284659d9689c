"""Newton's method, and following the solutions of R(x, lambda) = 0 along a curve: folds, branch points, kinks.

Knows no mechanics. Inside, everything is scaled, y = (x / x_scale, lambda / lam_scale), so that arclength and angles
mean something; the same curve in other units is the same sequence of points.

Which way is forward is decided by a determinant, not by the angle to the last tangent. Let tau be the tangent with
v . tau = det [D; v] for every v, D = (dR/dx, dR/dlambda). Across a surface w . y = const on which a continuous R has
a kink, D changes by a w^T, so w . tau = det [D; w] is the same on both sides: a curve oriented by tau crosses the
surface, whatever the angle of its kink (150 degrees too, where the scalar product of the tangents turns negative).
At a branch point it is the other way round: along a smooth curve tau turns into its opposite. A step that jumps over
a narrow gap to a neighbouring branch looks the same; the two are told apart by closing in on the place.

H. B. Keller, Numerical solution of bifurcation and nonlinear eigenvalue problems, 1977 (arclength, orientation);
E. L. Allgower and K. Georg, Introduction to Numerical Continuation Methods, SIAM 2003 (piecewise linear curves).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple, Protocol

import numpy as np
import scipy.linalg.lapack
import scipy.optimize

from .data import Array

Kind = Literal["start", "regular", "fold", "branch point", "target", "bound"]

CONVERGED = "converged"


class Problem(Protocol):
    """R(x, lambda) = 0 for n unknowns and one parameter; R continuous, its derivatives may jump.

    Attributes:
        x_scale: what a large x is, a number or (n,), in the units of x. lam_scale: what a large change of lambda is.
            Length along the curve is measured in these units.
    """

    @property
    def x_scale(self) -> Array | float: ...

    @property
    def lam_scale(self) -> float: ...

    def evaluate(self, x: Array, lam: float) -> tuple[Array, Array, Array]:
        """R (n,), dR/dx (n, n) and dR/dlambda (n,) at x (n,) and lambda; not finite where R is not defined."""
        ...


@dataclass(frozen=True)
class NewtonSettings:
    """When Newton's method stops.

    Attributes:
        tolerance: error of the scaled unknowns, estimated from the last correction and its contraction.
        iterations: at most. halvings: of a step that does not reduce the residual. forced: how often the best of the
            tried steps is taken although none reduces the residual (kinks). last_resort: then try a trust region.
    """

    tolerance: float = 1e-10
    iterations: int = 40
    halvings: int = 6
    forced: int = 3
    last_resort: bool = True


@dataclass(frozen=True)
class Solution:
    """What Newton's method found.

    Attributes:
        x: (n,). lam: as given. converged. status: "converged", or what went wrong and what to try.
        iterations: linear systems solved. evaluations: of R. error: estimated error of x / x_scale.
    """

    x: Array
    lam: float
    converged: bool
    status: str
    iterations: int
    evaluations: int
    error: float


@dataclass(frozen=True)
class Settings:
    """How a curve is followed. Lengths are in scaled units, see `Problem`.

    Attributes:
        direction: +1 or -1, how lambda changes at the start. low, high: bounds of lambda. points: at most that many.
        step, step_min, step_max: length of the first, the shortest, the longest step.
        angle: radians by which the tangent may turn in a step. kink_step: a step shorter than this that still turns
            more is searched for a kink. contraction: of Newton's first two corrections that the step is chosen for.
        predictor: along the tangent, or through the last two points.
        targets: values of lambda to be hit exactly, wherever the curve passes them.
        folds, branch_points: locate them. resolution: branches nearer to each other than this count as crossing.
        newton: settings of the corrector.
    """

    direction: int = 1
    low: float = -np.inf
    high: float = np.inf
    points: int = 1000
    step: float = 0.02
    step_min: float = 1e-9
    step_max: float = 0.1
    angle: float = 0.35
    kink_step: float = 1e-2
    contraction: float = 0.05
    predictor: Literal["tangent", "secant"] = "tangent"
    targets: tuple[float, ...] = ()
    folds: bool = True
    branch_points: bool = True
    resolution: float = 1e-6
    newton: NewtonSettings = NewtonSettings(iterations=10, halvings=3, forced=2, last_resort=False)


@dataclass(frozen=True)
class Point:
    """A solution on the curve.

    Attributes:
        x: (n,). lam. kind: "fold" and "branch point" are located between steps, "target" and "bound" have exactly the
            lambda asked for. kink: the tangent jumps just before this point. arclength: scaled, from the start.
        tangent: (n + 1,) unit vector, scaled. evaluations: of R since the step before.
    """

    x: Array
    lam: float
    kind: Kind
    kink: bool
    arclength: float
    tangent: Array
    evaluations: int


@dataclass(frozen=True)
class State:
    """All that is needed to go on: a plain value that can be kept, resumed and branched.

    Attributes:
        y: (n + 1,) scaled point. tangent: (n + 1,) unit vector. orientation: sign of det [D; tangent].
        step: length to try next. before: the point before, or None. sense: last sign of lambda's change.
        origin, origin_tangent: where the curve began. count: points so far. arclength.
        found: the points of the last advance, in order. status: "" while under way, else why it ended.
    """

    y: Array
    tangent: Array
    orientation: int
    step: float
    before: Array | None
    sense: int
    origin: Array
    origin_tangent: Array
    count: int
    arclength: float
    found: tuple[Point, ...]
    status: str = ""


@dataclass(frozen=True)
class Branch:
    """A curve. Attributes: points, in order. status: why it ended. state: to go on from."""

    points: tuple[Point, ...]
    status: str
    state: State | None

    @property
    def x(self) -> Array:
        """(points, n)."""
        return np.array([p.x for p in self.points])

    @property
    def lam(self) -> Array:
        """(points,)."""
        return np.array([p.lam for p in self.points])

    def of_kind(self, kind: Kind) -> list[Point]:
        """The points of one kind, in order."""
        return [p for p in self.points if p.kind == kind]


# Newton's method -----------------------------------------------------------------------------------------------------


def newton(problem: Problem, x: Array, lam: float, settings: NewtonSettings | None = None) -> Solution:
    """Solve R(x, lam) = 0 for x, from a guess (n,): steps halved until the residual falls, kinks allowed for."""
    scaled = _Scaled(problem)
    y = scaled.pack(x, lam)
    found = _correct(scaled, y, _unit(len(y)), y[-1], settings or NewtonSettings())
    return Solution(
        found.y[:-1] * scaled.x_scale, float(lam), found.ok, found.status, found.iterations, scaled.count, found.error
    )


class _Scaled:
    """The problem in scaled coordinates; counts evaluations."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.count = problem, 0
        self.x_scale = np.asarray(problem.x_scale, dtype=float)
        self.lam_scale = float(problem.lam_scale)

    def pack(self, x: Array, lam: float) -> Array:
        return np.append(np.asarray(x, dtype=float) / self.x_scale, float(lam) / self.lam_scale)

    def __call__(self, y: Array) -> tuple[Array, Array]:
        """R (n,) and D = (dR/dx, dR/dlambda) (n, n + 1) with respect to y."""
        self.count += 1
        R, J, slope = self.problem.evaluate(y[:-1] * self.x_scale, float(y[-1]) * self.lam_scale)
        D = np.empty((len(y) - 1, len(y)))
        np.multiply(J, self.x_scale, out=D[:, :-1])
        np.multiply(slope, self.lam_scale, out=D[:, -1])
        return np.asarray(R, dtype=float), D


@dataclass(frozen=True)
class _Corrected:
    """A point on the curve, or the attempt: tangent (n + 1,) with border . tangent = 1, sign of det [D; border] and the
    pivots it is the product of, contraction of the first two corrections."""

    y: Array
    ok: bool
    status: str
    iterations: int
    error: float
    tangent: Array | None = None
    sign: int = 0
    pivots: Array | None = None
    contraction: float = 0.0


def _norm(v: Array) -> float:
    return math.sqrt(v @ v)  # numpy.linalg.norm takes ten times as long for a short vector


def _unit(size: int) -> Array:
    e = np.zeros(size)
    e[-1] = 1.0
    return e


def _weights(D: Array) -> Array:
    """What makes every row's largest derivative 1, so that residuals of different units can be compared."""
    rows = np.abs(D).max(axis=1)
    return 1.0 / np.where((rows > 0) & np.isfinite(rows), rows, 1.0)


class _Place(NamedTuple):
    """A point y with the weighted residual (R, border . y - value), its derivative B = [D; border] and its norm, which
    is infinite if anything is not finite."""

    y: Array
    residual: Array
    B: Array
    size: float


def _place(y: Array, R: Array, D: Array, weights: Array, border: Array, value: float) -> _Place:
    residual, B = np.empty(len(y)), np.empty((len(y), len(y)), order="F")
    np.multiply(R, weights, out=residual[:-1])
    residual[-1] = border @ y - value
    np.multiply(D, weights[:, None], out=B[:-1])
    B[-1] = border
    size = _norm(residual)
    return _Place(y, residual, B, size if math.isfinite(size + float(B.sum())) else math.inf)


def _factor(B: Array) -> tuple[Array, Array] | None:
    """LU of a matrix, which is overwritten; None if it is singular."""
    lu, pivots, info = scipy.linalg.lapack.dgetrf(B, overwrite_a=1)
    return None if info else (lu, pivots)


def _solve(factors: tuple[Array, Array], right: Array) -> Array:
    return scipy.linalg.lapack.dgetrs(*factors, right)[0]


def _determinant(factors: tuple[Array, Array]) -> int:
    """Sign of the determinant."""
    lu, pivots = factors
    negative = np.count_nonzero(lu.diagonal() < 0) + np.count_nonzero(pivots != np.arange(len(pivots)))
    return -1 if negative % 2 else 1


def _correct(scaled: _Scaled, y: Array, border: Array, value: float, settings: NewtonSettings) -> _Corrected:
    """Solve R = 0 with border . y = value, from y.

    The residual is weighted by the derivatives at the start, so that units do not matter. Near a kink the direction
    can be one along which the residual rises however short the step, though the full step is right (the other side's
    derivative finishes the work): then the best of the tried steps is taken.
    """
    R, D = scaled(y)
    weights = _weights(D)
    here = _place(y, R, D, weights, border, value)
    sizes: list[float] = []
    forced = 0
    for iteration in range(1, settings.iterations + 1):
        factors = _factor(here.B) if here.size < math.inf else None
        if factors is None:
            return _resort(scaled, here.y, border, value, settings, iteration, "singular derivative: start elsewhere")
        dy = -_solve(factors, here.residual)
        sizes.append(_norm(dy))
        if error := _small_enough(sizes, settings.tolerance * (1.0 + _norm(here.y))):
            return _arrived(here.y + dy, factors, iteration, error, sizes)
        here, falls = _damped(scaled, here, dy, weights, border, value, settings.halvings)
        forced += not falls
        if forced > settings.forced:
            status = "no step reduces the residual: start nearer"
            return _resort(scaled, here.y, border, value, settings, iteration, status)
    status = "iterations used up: allow more, or start nearer"
    return _resort(scaled, here.y, border, value, settings, settings.iterations, status)


def _small_enough(sizes: list[float], tolerance: float) -> float:
    """Estimated error after the last correction, 0 while it is not small enough: corrections contract at least as
    fast as before, so the next one is at most the last times the last contraction."""
    last = sizes[-1]
    if last <= tolerance:
        return max(last, 1e-300)
    contraction = last / sizes[-2] if len(sizes) > 1 else 1.0
    return last * contraction if contraction < 0.1 and last < 1e-3 and last * contraction <= 0.1 * tolerance else 0.0


def _arrived(y: Array, factors: tuple[Array, Array], n: int, error: float, sizes: list[float]) -> _Corrected:
    contraction = sizes[1] / sizes[0] if len(sizes) > 1 else 0.0
    tangent = _solve(factors, _unit(len(y)))
    return _Corrected(y, True, CONVERGED, n, error, tangent, _determinant(factors), factors[0].diagonal(), contraction)


def _damped(
    scaled: _Scaled, before: _Place, dy: Array, weights: Array, border: Array, value: float, halvings: int
) -> tuple[_Place, bool]:
    """The first of the steps 1, 1/2, 1/4, ... that reduces the residual, else the best of them and False."""
    best = before._replace(size=math.inf)
    for k in range(halvings + 1):
        share = 0.5**k
        y = before.y + share * dy
        here = _place(y, *scaled(y), weights, border, value)
        if here.size <= (1.0 - 0.1 * share) * before.size:
            return here, True
        if here.size < best.size:
            best = here
    return best, False


def _resort(
    scaled: _Scaled, y: Array, border: Array, value: float, settings: NewtonSettings, iterations: int, status: str
) -> _Corrected:
    """The trust region of MINPACK (Powell's dogleg) from where Newton's method failed, then Newton again."""
    failed = _Corrected(y, False, status, iterations, np.inf)
    if not settings.last_resort or not np.isfinite(y).all():
        return failed
    R, D = scaled(y)
    if not (np.isfinite(R).all() and np.isfinite(D).all()):
        return failed
    weights = _weights(D)

    def both(z: Array) -> tuple[Array, Array]:
        there = _place(z, *scaled(z), weights, border, value)
        return there.residual, there.B

    found = scipy.optimize.root(both, y, jac=True, method="hybr").x
    again = _correct(scaled, found, border, value, replace(settings, last_resort=False))
    return replace(again, iterations=again.iterations + iterations) if again.ok else failed


# following a curve ---------------------------------------------------------------------------------------------------


def start(problem: Problem, x: Array, lam: float, settings: Settings | None = None) -> State:
    """The first point: Newton's method at fixed lambda from a guess x (n,), then the tangent.

    A start that fails is a state without points whose `status` says what to try.
    """
    settings = settings or Settings()
    scaled = _Scaled(problem)
    y = scaled.pack(x, lam)
    found = _correct(scaled, y, _unit(len(y)), y[-1], replace(settings.newton, iterations=40, last_resort=True))
    empty = State(y, np.zeros_like(y), 1, settings.step, None, settings.direction, y, y, 0, 0.0, ())
    if not found.ok:
        return replace(empty, status=f"no start: {found.status}")
    y = found.y
    D = scaled(y)[1]
    t = _tangent(D, 1)
    if t is None:
        return replace(empty, status="no start: singular derivative: start elsewhere")
    orientation = -1 if t[-1] * settings.direction < 0 else 1
    t = t * orientation
    first = _point(scaled, y, t, "start", False, 0.0, lam)
    return State(y, t, orientation, settings.step, None, _sign(t[-1]) or settings.direction, y, t, 1, 0.0, (first,))


def follow(problem: Problem, state: State, settings: Settings | None = None) -> Iterator[State]:
    """The state given and all that follow, until one has a status. The points of each are in its `found`."""
    settings = settings or Settings()
    yield state
    while not state.status:
        state = advance(problem, state, settings)
        yield state


def trace(problem: Problem, x: Array, lam: float, settings: Settings | None = None) -> Branch:
    """The whole curve from a guess x (n,) at lambda."""
    states = list(follow(problem, start(problem, x, lam, settings), settings))
    return Branch(tuple(p for s in states for p in s.found), states[-1].status, states[-1])


@dataclass(frozen=True)
class _Trial:
    """A step that was tried. good: take it. flips: it would be good with the tangent turned round (a branch point, or
    a jump to another branch). factor: by which to shorten the next try. kink: the tangent turned much."""

    good: bool
    factor: float = 0.5
    flips: bool = False
    kink: bool = False
    y: Array = field(default_factory=lambda: np.zeros(0))
    tangent: Array = field(default_factory=lambda: np.zeros(0))
    contraction: float = 0.0


@dataclass(frozen=True)
class _Segment:
    """The curve between two of its points; bends: the tangent jumps between them."""

    a: Array
    b: Array
    ta: Array
    tb: Array
    bends: bool

    @property
    def border(self) -> Array:
        """A direction in which the curve advances from a to b, on both sides of a kink less than 180 degrees."""
        middle = self.ta + self.tb
        size = _norm(middle)
        return middle / size if size > 1e-3 else self.tb

    def guesses(self, u: float) -> list[Array]:
        """Points at the share u of the way: on Hermite's cubic, or on the two tangents if the segment bends."""
        chord = self.b - self.a
        if self.bends:
            ahead = float(self.border @ chord)
            first = self.a + u * ahead / float(self.border @ self.ta) * self.ta
            second = self.b - (1 - u) * ahead / float(self.border @ self.tb) * self.tb
            return [first, second] if u < 0.5 else [second, first]
        length = _norm(chord)
        bend = u * (1 - u) * ((1 - u) * (self.ta * length - chord) - u * (self.tb * length - chord))
        return [self.a + u * chord + bend]


def advance(problem: Problem, state: State, settings: Settings) -> State:
    """The next state: one step along the curve, with the folds, targets and branch points it passes.

    The step is shortened while the corrector fails, the tangent turns too much, or the determinant says that another
    branch was caught. A turn that stays at steps below `kink_step` is a kink, and is crossed.
    """
    if state.status:
        return state
    scaled = _Scaled(problem)
    length = min(state.step, settings.step_max)
    while length >= settings.step_min:
        trial = _tried(scaled, state, length, settings)
        if trial.flips:
            place = _branch_point(scaled, state, trial, length, settings)
            if place is not None:
                return _over(scaled, state, trial, place, length, settings)
        if trial.kink:
            trial = replace(trial, good=_is_kink(scaled, state, trial, length, settings), factor=0.5)
        elif not trial.good and length <= settings.kink_step:
            trial = _crossed(scaled, state, length, settings, trial)
        if trial.good:
            return _taken(scaled, state, trial, length, settings)
        length *= trial.factor
    return replace(state, found=(), status="stuck: no step is short enough; start from the other end, or change scales")


def _sign(value: float) -> int:
    """Of a tangent's component; what rounding leaves of zero is zero."""
    return 0 if abs(value) < 1e-12 else (1 if value > 0 else -1)


def _oriented(found: _Corrected, orientation: int) -> Array:
    assert found.tangent is not None
    return found.tangent * (orientation * found.sign / _norm(found.tangent))


def _tangent(D: Array, orientation: int) -> Array | None:
    """Unit null vector t of D with the sign of det [D; t] asked for; None where D has a larger null space."""
    if not np.isfinite(D).all():
        return None
    D = D * _weights(D)[:, None]
    t = np.linalg.svd(D)[2][-1]
    factors = _factor(np.asfortranarray(np.vstack([D, t])))
    return None if factors is None else t * (orientation * _determinant(factors))


def _angle(a: Array, b: Array) -> float:
    """Between two vectors, exact for small angles too."""
    a, b = a / _norm(a), b / _norm(b)
    return 2.0 * math.atan2(_norm(a - b), _norm(a + b))


def _tried(scaled: _Scaled, state: State, length: float, settings: Settings) -> _Trial:
    """Predict, correct, judge."""
    ahead = state.tangent
    if settings.predictor == "secant" and state.before is not None:
        secant = (state.y - state.before) / _norm(state.y - state.before)
        ahead = secant if _angle(secant, state.tangent) < settings.angle else ahead
    guess = state.y + length * ahead
    found = _correct(scaled, guess, state.tangent, float(state.tangent @ guess), settings.newton)
    if not found.ok:
        return _Trial(False, 0.5)
    return _judged(state, found, length, settings)


def _judged(state: State, found: _Corrected, length: float, settings: Settings) -> _Trial:
    t, chord = _oriented(found, state.orientation), found.y - state.y
    if _smooth(state.tangent, chord, t, settings.angle):
        return _Trial(True, 1.0, False, False, found.y, t, found.contraction)
    if _smooth(state.tangent, chord, -t, settings.angle):
        return _Trial(False, 0.5, True, False, found.y, -t, found.contraction)
    if length <= settings.kink_step and chord @ t > 0 and _norm(chord) < 10 * length:
        return _Trial(True, 1.0, False, True, found.y, t, found.contraction)
    turned = max(_angle(state.tangent, t), 2 * _angle(state.tangent, chord))
    return _Trial(False, float(np.clip(settings.angle / turned, 0.1, 0.5)))


def _smooth(ta: Array, chord: Array, tb: Array, limit: float) -> bool:
    """Does an arc lead from one tangent to the other? Its chord halves the angle; one that does not may lead to a
    neighbouring leg, parallel to this one."""
    return _angle(ta, tb) <= limit and _angle(ta + tb, chord) <= 0.15 * limit


def _crossed(scaled: _Scaled, state: State, length: float, settings: Settings, failed: _Trial) -> _Trial:
    """The far side of a kink: the tangent there is read off beyond it, then a border that advances on both sides.

    Where that fails: lambda itself as the parameter, both ways, and the direction of the last two points.
    """
    for share in (1.0, 3.0, 0.3):
        beyond = state.y + share * length * state.tangent
        t = _tangent(scaled(beyond)[1], state.orientation)
        if t is not None and _angle(t, state.tangent) > 0.05:
            border = _Segment(state.y, beyond, state.tangent, t, True).border
            if (trial := _aimed(scaled, state, state.y + 3.0 * share * length * t, border, length, settings)).good:
                return trial
    for way in (1.0, -1.0):
        guess = state.y + way * length * _unit(len(state.y))
        if (trial := _aimed(scaled, state, guess, _unit(len(guess)), length, settings)).good:
            return trial
    if state.before is not None and (chord := state.y - state.before).any():
        chord = chord / _norm(chord)
        if (trial := _aimed(scaled, state, state.y + length * chord, chord, length, settings)).good:
            return trial
    return failed


def _aimed(scaled: _Scaled, state: State, guess: Array, border: Array, length: float, settings: Settings) -> _Trial:
    """Correct a guess with a border of its own; good if the curve goes on from the new point away from the last."""
    found = _correct(scaled, guess, border, float(border @ guess), settings.newton)
    if not found.ok:
        return _Trial(False)
    t, chord = _oriented(found, state.orientation), found.y - state.y
    far = _norm(chord) > 30 * length
    if far or not chord @ t > 0 or _norm(chord) < 0.01 * length:
        return _Trial(False)
    bends = not _smooth(state.tangent, chord, t, settings.angle)
    trial = _Trial(True, 0.5, False, bends, found.y, t, found.contraction)
    return replace(trial, good=not bends or _is_kink(scaled, state, trial, length, settings))


# what lies between two points ----------------------------------------------------------------------------------------


def _between(scaled: _Scaled, segment: _Segment, u: float, settings: Settings) -> tuple | None:
    """Point, tangent, sign and pivots of the determinant at the share u of a segment, or None."""
    border = segment.border
    value = float((1 - u) * (border @ segment.a) + u * (border @ segment.b))
    for guess in segment.guesses(u):
        found = _correct(scaled, guess, border, value, settings.newton)
        if found.ok and _norm(found.y - guess) <= _norm(segment.b - segment.a):
            return found.y, _oriented(found, found.sign), found.sign, found.pivots
    return None


def _is_kink(scaled: _Scaled, state: State, trial: _Trial, length: float, settings: Settings) -> bool:
    """Do the two tangents belong to one curve that bends at one place? Halved down to `resolution`.

    If not, it is another branch that was caught (the curve is not whole), or a narrow turn that shorter steps follow.
    """
    if length <= settings.resolution:
        return True
    segment = _Segment(state.y, trial.y, state.tangent, trial.tangent, True)
    border = segment.border
    span = float(border @ (segment.b - segment.a))
    low, high = 0.0, 1.0
    before, after = (segment.a, segment.ta), (segment.b, segment.tb)
    while (high - low) * span > settings.resolution:
        middle = 0.5 * (low + high)
        here = _between(scaled, segment, middle, settings)
        if here is None or here[2] != state.orientation:
            return False  # lost, or on a leg that comes back between two kinks
        if _angle(here[1], segment.ta) < _angle(here[1], segment.tb):
            low, before = middle, here[:2]
        else:
            high, after = middle, here[:2]
        if _angle(before[1], after[1]) <= 0.5 * settings.angle:
            return False  # a smooth turn
    slowest = min(float(border @ before[1]), float(border @ after[1]))
    return _norm(after[0] - before[0]) * slowest <= 2.0 * (high - low) * span


def _branch_point(scaled: _Scaled, state: State, trial: _Trial, length: float, settings: Settings) -> Array | None:
    """Where the determinant changes its sign along a smooth curve; None if it is a jump to another branch.

    Around a branch point the curve is whole: two points a little before and after it are as near as they should be.
    """
    if length <= settings.resolution:
        return trial.y
    segment = _Segment(state.y, trial.y, state.tangent, trial.tangent, False)
    chord = _norm(trial.y - state.y)

    def test(u: float) -> float:
        here = _between(scaled, segment, u, settings)
        if here is None:
            raise _Lost
        logarithm = float(np.log(np.abs(here[3])).sum())
        reference.append(logarithm)
        return here[2] * math.exp(min(logarithm - reference[0], 50.0))

    reference: list[float] = []
    try:
        root = float(scipy.optimize.brentq(test, 0.0, 1.0, xtol=0.05 * settings.resolution / chord, rtol=1e-12))
    except (_Lost, ValueError):
        return None
    off = settings.resolution / chord
    sides = [_between(scaled, segment, root + way * off, settings) for way in (-1, 1)]
    before, after = sides
    if before is None or after is None or before[2] == after[2]:
        return None
    whole = _norm(after[0] - before[0]) <= 3 * settings.resolution
    straight = _angle(before[1], after[1]) <= settings.angle
    return 0.5 * (before[0] + after[0]) if whole and straight else None


class _Lost(Exception):
    """The corrector failed inside a segment (never leaves this module)."""


def _root(scaled: _Scaled, segment: _Segment, settings: Settings, fold: bool, value: float) -> tuple[Array, Array]:
    """Point and tangent where lambda's component of the tangent (fold) or lambda - value changes its sign.

    Raises:
        _Lost: the curve was not found again between the two points.
    """
    kept = {0.0: (segment.a, segment.ta), 1.0: (segment.b, segment.tb)}

    def test(u: float) -> float:
        if u not in kept:
            here = _between(scaled, segment, u, settings)
            if here is None:
                raise _Lost
            kept[u] = here[:2]
        y, t = kept[u]
        return float(t[-1]) if fold else float(y[-1]) - value

    if test(0.0) * test(1.0) > 0:
        raise _Lost
    root = float(scipy.optimize.brentq(test, 0.0, 1.0, xtol=1e-10, rtol=1e-12))
    test(root)
    return kept[root]


def _fold(scaled: _Scaled, segment: _Segment, settings: Settings) -> tuple[Array, Array]:
    """The fold in a segment; if the curve cannot be found between its ends, the end with the extreme lambda."""
    try:
        return _root(scaled, segment, settings, True, 0.0)
    except _Lost:
        rising = segment.ta[-1] > 0
        return (segment.a, segment.ta) if (segment.a[-1] > segment.b[-1]) == rising else (segment.b, segment.tb)


def _at(scaled: _Scaled, segment: _Segment, lam: float, settings: Settings) -> tuple[Array, Array] | None:
    """Point and tangent at a given scaled lambda in a segment along which it changes monotonically."""
    span = segment.b[-1] - segment.a[-1]
    guess = segment.guesses(float((lam - segment.a[-1]) / span))[0]
    guess[-1] = lam
    found = _correct(scaled, guess, _unit(len(guess)), lam, settings.newton)
    if found.ok and _norm(found.y - guess) <= 0.5 * _norm(segment.b - segment.a):
        t = _oriented(found, 1)
        return found.y, t if t @ segment.border > 0 else -t
    try:
        return _root(scaled, segment, settings, False, lam)
    except _Lost:
        return None


# bookkeeping of a step -----------------------------------------------------------------------------------------------


def _point(
    scaled: _Scaled, y: Array, t: Array, kind: Kind, kink: bool, arclength: float, lam: float | None = None
) -> Point:
    lam = float(y[-1]) * scaled.lam_scale if lam is None else float(lam)
    return Point(y[:-1] * scaled.x_scale, lam, kind, kink, arclength, t, scaled.count)


def _over(scaled: _Scaled, state: State, trial: _Trial, place: Array, length: float, settings: Settings) -> State:
    """A step over a branch point: the determinant has the other sign from here on."""
    point = _point(scaled, place, trial.tangent, "branch point", False, _along(state, place))
    state = replace(state, orientation=-state.orientation)
    return _taken(scaled, state, trial, length, settings, (point,) if settings.branch_points else ())


def _taken(
    scaled: _Scaled, state: State, trial: _Trial, length: float, settings: Settings, extra: tuple[Point, ...] = ()
) -> State:
    """The state after a step, with what was passed on the way."""
    sense = _sign(trial.tangent[-1]) or state.sense
    passed, bound = _passed(scaled, state, trial, sense, settings)
    found = sorted([*extra, *passed], key=lambda p: p.arclength)
    arclength = _along(state, trial.y)
    status = ""
    if bound is not None:
        found = [p for p in found if settings.low <= p.lam <= settings.high]
        status = f"bound: lambda has reached {bound:g}"
    elif _closed(state, trial.y, trial.tangent):
        last = _along(state, state.origin)
        found = [p for p in found if p.arclength <= last]
        found.append(_point(scaled, state.origin, state.origin_tangent, "start", False, last))
        status = "closed: the curve is back at its start"
    else:
        found.append(_point(scaled, trial.y, trial.tangent, "regular", trial.kink, arclength))
        if state.count + len(found) >= settings.points:
            status = f"points: {settings.points} are found; allow more to go on"
    return replace(
        state, y=trial.y, tangent=trial.tangent, step=_next_step(state, trial, length, settings), before=state.y,
        sense=sense, count=state.count + len(found), arclength=arclength, found=tuple(found), status=status,
    )  # fmt: skip


def _passed(
    scaled: _Scaled, state: State, trial: _Trial, sense: int, settings: Settings
) -> tuple[list[Point], float | None]:
    """Fold and targets between the last point and the new one, and the bound if it is reached."""
    pieces, found = [_Segment(state.y, trial.y, state.tangent, trial.tangent, trial.kink)], []
    if sense != state.sense and (settings.folds or settings.targets):
        y, t = _fold(scaled, pieces[0], settings)
        pieces = [replace(pieces[0], b=y, tb=t), replace(pieces[0], a=y, ta=t)]
        if settings.folds:
            found.append(_point(scaled, y, t, "fold", trial.kink, _along(state, y)))
    for piece in pieces:
        for lam, is_bound in _values(piece, scaled.lam_scale, settings):
            here = _at(scaled, piece, lam / scaled.lam_scale, settings)
            if here is not None:
                kind: Kind = "bound" if is_bound else "target"
                found.append(_point(scaled, *here, kind, trial.kink, _along(state, here[0]), lam))
            if is_bound:
                return found, lam
    return found, None


def _along(state: State, y: Array) -> float:
    return state.arclength + _norm(y - state.y)


def _values(piece: _Segment, scale: float, settings: Settings) -> list[tuple[float, bool]]:
    """Targets passed in a piece (its beginning excluded), in order, the bound last."""
    a, b = piece.a[-1] * scale, piece.b[-1] * scale
    low, high = min(a, b), max(a, b)
    inside = [v for v in settings.targets if low <= v <= high and v != a and settings.low <= v <= settings.high]
    passed = sorted(set(inside), reverse=bool(b < a))
    bound = settings.high if b > settings.high else settings.low if b < settings.low else None
    return [(v, False) for v in passed] + ([] if bound is None else [(bound, True)])


def _closed(state: State, y: Array, t: Array) -> bool:
    """Does the step lead through the curve's first point?"""
    before, after = (float(state.origin_tangent @ (z - state.origin)) for z in (state.y, y))
    if state.count < 4 or not before < 0 <= after or t @ state.origin_tangent <= 0:
        return False
    chord = y - state.y
    nearest = state.y + chord * (before / (before - after))
    return bool(_norm(nearest - state.origin) <= 0.2 * _norm(chord))


def _next_step(state: State, trial: _Trial, length: float, settings: Settings) -> float:
    """From the contraction (proportional to the predictor's error, the square of the step) and the turn (to the step).

    A kink says nothing about the curve beyond it: half of what was used before.
    """
    if trial.kink:
        return max(0.5 * state.step, settings.step_min)
    turned = max(_angle(state.tangent, trial.tangent), 1e-6)
    by_turn = 0.5 * settings.angle / turned
    by_newton = np.sqrt(settings.contraction / max(trial.contraction, 1e-12))
    return float(np.clip(length * np.clip(min(by_turn, by_newton), 0.5, 2.0), settings.step_min, settings.step_max))

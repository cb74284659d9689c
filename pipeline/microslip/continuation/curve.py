"""Following the solutions of R(x, lambda) = 0 along a curve: folds, branch points, kinks.

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
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import scipy.optimize

from ..data import Array
from ..settings.arguments import Count, checked_fields
from ..settings.numbers import NotNegative, Positive
from .newton import Corrected, Equations, NewtonSettings, Scaled, correct, norm, tangent, unit

TURN = 0.5
"""Share of the angle by which the tangent may turn in a step that the next step is chosen for."""

OFF = 2e-3
"""Scaled length of the first step from a branch point onto the other curve."""

REACH = 2.0
"""Length of a correction, over that of the step, beyond which the predicted point is of no use."""

Kind = Literal[
    "start", "regular", "fold", "branch point", "target", "bound", "peak", "period doubling", "Neimark-Sacker"
]


@checked_fields
@dataclass(frozen=True)
class Settings:
    """How a curve is followed. Lengths are in scaled units, see `Equations`.

    Attributes:
        direction: +1 or -1, how lambda changes at the start. low, high: bounds of lambda. points: at most that many.
        step, step_min, step_max: length of the first, the shortest, the longest step.
        angle: radians by which the tangent may turn in a step. kink_step: a step shorter than this that still turns
            more is searched for a kink. contraction: of Newton's first two corrections that the step is chosen for.
        predictor: along the tangent, or the cubic through the last two points and their tangents.
        targets: values of lambda to be hit exactly, wherever the curve passes them.
        folds, branch_points: locate them. resolution: branches nearer to each other than this count as crossing.
        newton: settings of the corrector.
    """

    direction: int = 1
    low: float = -np.inf
    high: float = np.inf
    points: Count = 1000
    step: Positive = 0.02
    step_min: Positive = 1e-9
    step_max: Positive = 0.1
    angle: Positive = 0.35
    kink_step: NotNegative = 1e-2
    contraction: Positive = 0.05
    predictor: Literal["tangent", "cubic"] = "cubic"
    targets: tuple[float, ...] = ()
    folds: bool = True
    branch_points: bool = True
    resolution: Positive = 1e-6
    newton: NewtonSettings = NewtonSettings(iterations=10, halvings=3, forced=2, last_resort=False)


@dataclass(frozen=True)
class Point:
    """A solution on the curve.

    Attributes:
        x: (n,). lam. kind: "fold" and "branch point" are located between steps, "target" and "bound" have exactly the
            lambda asked for, "peak" is what `extremum.with_peaks` adds, period doublings and Neimark-Sacker points
            are added by those who know multipliers. kink: the tangent jumps just before this point. arclength: scaled,
            from the start.
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
        step: length to try next. before, before_tangent: of the point before, or None; no tangent across a kink.
        sense: last sign of lambda's change.
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
    before_tangent: Array | None = None


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


def start(problem: Equations, x: Array, lam: float, settings: Settings | None = None) -> State:
    """The first point: Newton's method at fixed lambda from a guess x (n,), then the tangent.

    A start that fails is a state without points whose `status` says what to try.
    """
    settings = settings or Settings()
    scaled = Scaled(problem)
    y = scaled.pack(x, lam)
    corrected = _first(scaled, y, unit(len(y)), settings)
    if not corrected.ok:
        return _no_start(y, corrected.status, settings)
    t = tangent(scaled(corrected.y)[1], 1)
    if t is None:
        return _no_start(y, "singular derivative: start elsewhere", settings)
    orientation = -1 if t[-1] * settings.direction < 0 else 1
    return _started(scaled, corrected.y, t * orientation, orientation, settings, lam)


def branch_off(
    problem: Equations, x: Array, lam: float, direction: tuple[Array, float], settings: Settings | None = None
) -> State:
    """The first point on the plane across a direction, from a guess x (n,) on that plane: of a curve that leaves
    another one there, which Newton's method at fixed lambda would find instead.

    Args:
        direction: of x (n,) and of lambda, in their units, in which the curve is to be followed.
    """
    scaled = Scaled(problem)
    ahead = scaled.pack(*direction)
    return across(scaled, scaled.pack(x, lam), ahead / norm(ahead), settings or Settings())


def across(scaled: Scaled, y: Array, border: Array, settings: Settings) -> State:
    """The first point on the plane through a scaled guess y across a border, in which the curve is to be followed."""
    corrected = _first(scaled, y, border, settings)
    if not corrected.ok or corrected.tangent is None:
        return _no_start(y, corrected.status, settings)
    t = corrected.tangent / norm(corrected.tangent)  # border . tangent = 1: it goes ahead
    return _started(scaled, corrected.y, t, corrected.sign, settings)


def switched(
    problem: Equations, x: Array, lam: float, ahead: tuple[Array, float], settings: Settings, off: float = OFF
) -> list[State]:
    """The first points, both ways, of the curve that crosses another one at a branch point, (n,) and lambda.

    Both tangents lie in the null space of D, which has two dimensions there: a step `off` across the known one.

    Args:
        ahead: of x (n,) and of lambda, in their units, along the known curve.
    """
    scaled = Scaled(problem)
    y, known = scaled.pack(x, lam), scaled.pack(*ahead)
    plane = np.linalg.svd(scaled(y)[1])[2][-2:]
    along = plane @ known
    across_it = plane.T @ np.array([-along[1], along[0]]) / norm(along)
    found = [across(scaled, y + way * off * across_it, way * across_it, settings) for way in (1.0, -1.0)]
    return [state for state in found if not state.status]


def _first(scaled: Scaled, y: Array, border: Array, settings: Settings) -> Corrected:
    newton = replace(settings.newton, iterations=40, last_resort=True)
    return correct(scaled, y, border, float(border @ y), newton)


def _no_start(y: Array, why: str, settings: Settings) -> State:
    nowhere, sense = np.zeros_like(y), settings.direction
    return State(y, nowhere, 1, settings.step, None, sense, y, y, 0, 0.0, (), f"no start: {why}")


def _started(
    scaled: Scaled, y: Array, t: Array, orientation: int, settings: Settings, lam: float | None = None
) -> State:
    first, sense = _point(scaled, y, t, "start", False, 0.0, lam), _sign(t[-1]) or settings.direction
    return State(y, t, orientation, settings.step, None, sense, y, t, 1, 0.0, (first,))


def follow(problem: Equations, state: State, settings: Settings | None = None) -> Iterator[State]:
    """The state given and all that follow, until one has a status. The points of each are in its `found`."""
    settings = settings or Settings()
    yield state
    while not state.status:
        state = advance(problem, state, settings)
        yield state


def trace(problem: Equations, x: Array, lam: float, settings: Settings | None = None) -> Branch:
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
class Segment:
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
        size = norm(middle)
        return middle / size if size > 1e-3 else self.tb

    def guesses(self, u: float) -> list[Array]:
        """Points at the share u of the way: on Hermite's cubic, or on the two tangents if the segment bends."""
        chord = self.b - self.a
        if self.bends:
            ahead = float(self.border @ chord)
            first = self.a + u * ahead / float(self.border @ self.ta) * self.ta
            second = self.b - (1 - u) * ahead / float(self.border @ self.tb) * self.tb
            return [first, second] if u < 0.5 else [second, first]
        length = norm(chord)
        bend = u * (1 - u) * ((1 - u) * (self.ta * length - chord) - u * (self.tb * length - chord))
        return [self.a + u * chord + bend]


def advance(problem: Equations, state: State, settings: Settings) -> State:
    """The next state: one step along the curve, with the folds, targets and branch points it passes.

    The step is shortened while the corrector fails, the tangent turns too much, or the determinant says that another
    branch was caught. A turn that stays at steps below `kink_step` is a kink, and is crossed.
    """
    if state.status:
        return state
    scaled = Scaled(problem)
    length, guess = _within_the_angle(state, min(state.step, settings.step_max), settings)
    while length >= settings.step_min:
        trial = _tried(scaled, state, guess, length, settings)
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
        guess = predicted(state, length, settings)
    return replace(state, found=(), status="stuck: no step is short enough; start from the other end, or change scales")


def _sign(value: float) -> int:
    """Of a tangent's component; what rounding leaves of zero is zero."""
    return 0 if abs(value) < 1e-12 else (1 if value > 0 else -1)


def _oriented(found: Corrected, orientation: int) -> Array:
    assert found.tangent is not None
    return found.tangent * (orientation * found.sign / norm(found.tangent))


def _angle(a: Array, b: Array) -> float:
    """Between two vectors, within 2e-8."""
    along = float(a @ b)
    return math.atan2(math.sqrt(max(float(a @ a) * float(b @ b) - along * along, 0.0)), along)


def _tried(scaled: Scaled, state: State, guess: Array, length: float, settings: Settings) -> _Trial:
    """Correct a predicted point, judge."""
    corrected = correct(scaled, guess, state.tangent, float(state.tangent @ guess), settings.newton, REACH * length)
    if not corrected.ok:
        return _Trial(False, 0.5)
    return _judged(state, corrected, length, settings)


def predicted(state: State, length: float, settings: Settings) -> Array:
    """A guess of the point a length beyond: along the tangent, wrong by the square of the length, or by the cubic
    through the last two points and their tangents, wrong by its fourth power."""
    if settings.predictor == "tangent" or state.before is None or state.before_tangent is None:
        return state.y + length * state.tangent
    last = Segment(state.before, state.y, state.before_tangent, state.tangent, False)
    return last.guesses(1.0 + length / norm(state.y - state.before))[0]


def _within_the_angle(state: State, length: float, settings: Settings) -> tuple[float, Array]:
    """A length, shortened until the predicted point is off the tangent by half the angle at most, and that point."""
    for _ in range(10):
        guess = predicted(state, length, settings)
        if norm(guess - state.y - length * state.tangent) <= 0.5 * settings.angle * length:
            return length, guess
        length *= 0.7
    return length, predicted(state, length, settings)


def _judged(state: State, found: Corrected, length: float, settings: Settings) -> _Trial:
    t, chord = _oriented(found, state.orientation), found.y - state.y
    if _smooth(state.tangent, chord, t, settings.angle):
        return _Trial(True, 1.0, False, False, found.y, t, found.contraction)
    if _smooth(state.tangent, chord, -t, settings.angle):
        return _Trial(False, 0.5, True, False, found.y, -t, found.contraction)
    if length <= settings.kink_step and chord @ t > 0 and norm(chord) < 10 * length:
        return _Trial(True, 1.0, False, True, found.y, t, found.contraction)
    turned = max(_angle(state.tangent, t), 2 * _angle(state.tangent, chord))
    return _Trial(False, float(np.clip(settings.angle / turned, 0.1, 0.5)))


def _smooth(ta: Array, chord: Array, tb: Array, limit: float) -> bool:
    """Does an arc lead from one tangent to the other? Its chord halves the angle; one that does not may lead to a
    neighbouring leg, parallel to this one."""
    return _angle(ta, tb) <= limit and _angle(ta + tb, chord) <= 0.15 * limit


def _crossed(scaled: Scaled, state: State, length: float, settings: Settings, failed: _Trial) -> _Trial:
    """The far side of a kink: the tangent there is read off beyond it, then a border that advances on both sides.

    Where that fails: lambda itself as the parameter, both ways, and the direction of the last two points.
    """
    for share in (1.0, 3.0, 0.3):
        beyond = state.y + share * length * state.tangent
        t = tangent(scaled(beyond)[1], state.orientation)
        if t is not None and _angle(t, state.tangent) > 0.05:
            border = Segment(state.y, beyond, state.tangent, t, True).border
            if (trial := _aimed(scaled, state, state.y + 3.0 * share * length * t, border, length, settings)).good:
                return trial
    for way in (1.0, -1.0):
        guess = state.y + way * length * unit(len(state.y))
        if (trial := _aimed(scaled, state, guess, unit(len(guess)), length, settings)).good:
            return trial
    if state.before is not None and (chord := state.y - state.before).any():
        chord = chord / norm(chord)
        if (trial := _aimed(scaled, state, state.y + length * chord, chord, length, settings)).good:
            return trial
    return failed


def _aimed(scaled: Scaled, state: State, guess: Array, border: Array, length: float, settings: Settings) -> _Trial:
    """Correct a guess with a border of its own; good if the curve goes on from the new point away from the last."""
    corrected = correct(scaled, guess, border, float(border @ guess), settings.newton)
    if not corrected.ok:
        return _Trial(False)
    t, chord = _oriented(corrected, state.orientation), corrected.y - state.y
    far = norm(chord) > 30 * length
    if far or not chord @ t > 0 or norm(chord) < 0.01 * length:
        return _Trial(False)
    bends = not _smooth(state.tangent, chord, t, settings.angle)
    trial = _Trial(True, 0.5, False, bends, corrected.y, t, corrected.contraction)
    return replace(trial, good=not bends or _is_kink(scaled, state, trial, length, settings))


# what lies between two points ----------------------------------------------------------------------------------------


def _between(scaled: Scaled, segment: Segment, u: float, settings: Settings, reach: float = 0.0) -> tuple | None:
    """Point, tangent, sign and pivots of the determinant at the share u of a segment, or None: where a guess is off
    by more than the length of the segment and a reach."""
    border = segment.border
    value = float((1 - u) * (border @ segment.a) + u * (border @ segment.b))
    for guess in segment.guesses(u):
        corrected = correct(scaled, guess, border, value, settings.newton)
        if corrected.ok and norm(corrected.y - guess) <= max(norm(segment.b - segment.a), reach):
            return corrected.y, _oriented(corrected, corrected.sign), corrected.sign, corrected.pivots
    return None


def _is_kink(scaled: Scaled, state: State, trial: _Trial, length: float, settings: Settings) -> bool:
    """Do the two tangents belong to one curve that bends at one place? Halved down to `resolution`.

    If not, it is another branch that was caught (the curve is not whole), or a narrow turn that shorter steps follow.
    """
    if length <= settings.resolution:
        return True
    segment = Segment(state.y, trial.y, state.tangent, trial.tangent, True)
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
    return norm(after[0] - before[0]) * slowest <= 2.0 * (high - low) * span


def _branch_point(scaled: Scaled, state: State, trial: _Trial, length: float, settings: Settings) -> Array | None:
    """Where the determinant changes its sign along a smooth curve; None if it is a jump to another branch.

    Around a branch point the curve is whole: two points a little before and after it are as near as they should be.
    """
    if length <= settings.resolution:
        return trial.y
    segment = Segment(state.y, trial.y, state.tangent, trial.tangent, False)
    chord = norm(trial.y - state.y)

    def test(u: float) -> float:
        here = _between(scaled, segment, u, settings)
        if here is None:
            raise Lost
        logarithm = float(np.log(np.abs(here[3])).sum())
        reference.append(logarithm)
        return here[2] * math.exp(min(logarithm - reference[0], 50.0))

    reference: list[float] = []
    try:
        root = float(scipy.optimize.brentq(test, 0.0, 1.0, xtol=0.05 * settings.resolution / chord, rtol=1e-12))
    except (Lost, ValueError):
        return None
    off = settings.resolution / chord
    sides = [_between(scaled, segment, root + way * off, settings) for way in (-1, 1)]
    before, after = sides
    if before is None or after is None or before[2] == after[2]:
        return None
    whole = norm(after[0] - before[0]) <= 3 * settings.resolution
    straight = _angle(before[1], after[1]) <= settings.angle
    return 0.5 * (before[0] + after[0]) if whole and straight else None


class Lost(Exception):
    """The corrector failed inside a segment (never leaves this room)."""


def root(
    scaled: Scaled, segment: Segment, settings: Settings, test: Callable[[Array, Array], float], share: float = 1e-10
) -> tuple[Array, Array]:
    """Point and tangent in a segment where a function of both, of different sign at its ends, changes its sign, to a
    share of the segment.

    Raises:
        Lost: the curve was not found again between the two points, or the signs at its ends are the same.
    """
    kept = {0.0: (segment.a, segment.ta), 1.0: (segment.b, segment.tb)}

    def value(u: float) -> float:
        if u not in kept:
            here = _between(scaled, *_nearest(segment, kept, u), settings, norm(segment.b - segment.a))
            if here is None:
                raise Lost
            kept[u] = here[:2]
        return test(*kept[u])

    if value(0.0) * value(1.0) > 0:
        raise Lost
    place = float(scipy.optimize.brentq(value, 0.0, 1.0, xtol=share, rtol=1e-12))
    value(place)
    return kept[place]


def _nearest(segment: Segment, kept: dict[float, tuple[Array, Array]], u: float) -> tuple[Segment, float]:
    """The piece of a segment between the known points beside the share u, and the share of that piece."""
    low, high = max(k for k in kept if k < u), min(k for k in kept if k > u)
    piece = replace(segment, a=kept[low][0], ta=kept[low][1], b=kept[high][0], tb=kept[high][1])
    return piece, (u - low) / (high - low)


def _fold(scaled: Scaled, segment: Segment, settings: Settings) -> tuple[Array, Array]:
    """The fold in a segment; if the curve cannot be found between its ends, the end with the extreme lambda."""
    try:
        return root(scaled, segment, settings, lambda y, t: float(t[-1]), 1e-8)  # lambda then to the square of it
    except Lost:
        rising = segment.ta[-1] > 0
        return (segment.a, segment.ta) if (segment.a[-1] > segment.b[-1]) == rising else (segment.b, segment.tb)


def _at(scaled: Scaled, segment: Segment, lam: float, settings: Settings) -> tuple[Array, Array] | None:
    """Point and tangent at a given scaled lambda in a segment along which it changes monotonically."""
    span = segment.b[-1] - segment.a[-1]
    guess = segment.guesses(float((lam - segment.a[-1]) / span))[0]
    guess[-1] = lam
    corrected = correct(scaled, guess, unit(len(guess)), lam, settings.newton)
    if corrected.ok and norm(corrected.y - guess) <= 0.5 * norm(segment.b - segment.a):
        t = _oriented(corrected, 1)
        return corrected.y, t if t @ segment.border > 0 else -t
    try:
        return root(scaled, segment, settings, lambda y, t: float(y[-1]) - lam)
    except Lost:
        return None


# bookkeeping of a step -----------------------------------------------------------------------------------------------


def _point(
    scaled: Scaled, y: Array, t: Array, kind: Kind, kink: bool, arclength: float, lam: float | None = None
) -> Point:
    lam = float(y[-1]) * scaled.lam_scale if lam is None else float(lam)
    return Point(y[:-1] * scaled.x_scale, lam, kind, kink, arclength, t, scaled.count)


def _over(scaled: Scaled, state: State, trial: _Trial, place: Array, length: float, settings: Settings) -> State:
    """A step over a branch point: the determinant has the other sign from here on."""
    point = _point(scaled, place, trial.tangent, "branch point", False, _along(state, place))
    state = replace(state, orientation=-state.orientation)
    return _taken(scaled, state, trial, length, settings, (point,) if settings.branch_points else ())


def _taken(
    scaled: Scaled, state: State, trial: _Trial, length: float, settings: Settings, extra: tuple[Point, ...] = ()
) -> State:
    """The state after a step, with what was passed on the way."""
    sense = _sign(trial.tangent[-1]) or state.sense
    passed, bound = _passed(scaled, state, trial, sense, settings)
    points = sorted([*extra, *passed], key=lambda p: p.arclength)
    arclength = _along(state, trial.y)
    status = ""
    if bound is not None:
        points = [p for p in points if settings.low <= p.lam <= settings.high]
        status = f"bound: lambda has reached {bound:g}"
    elif _closed(state, trial.y, trial.tangent):
        last = _along(state, state.origin)
        points = [p for p in points if p.arclength <= last]
        points.append(_point(scaled, state.origin, state.origin_tangent, "start", False, last))
        status = "closed: the curve is back at its start"
    else:
        points.append(_point(scaled, trial.y, trial.tangent, "regular", trial.kink, arclength))
        if state.count + len(points) >= settings.points:
            status = f"points: {settings.points} are found; allow more to go on"
    return replace(
        state, y=trial.y, tangent=trial.tangent, step=_next_step(state, trial, length, settings), before=state.y,
        before_tangent=None if trial.kink else state.tangent, sense=sense, count=state.count + len(points),
        arclength=arclength, found=tuple(points), status=status,
    )  # fmt: skip


def _passed(
    scaled: Scaled, state: State, trial: _Trial, sense: int, settings: Settings
) -> tuple[list[Point], float | None]:
    """Fold and targets between the last point and the new one, and the bound if it is reached."""
    pieces, points = [Segment(state.y, trial.y, state.tangent, trial.tangent, trial.kink)], []
    if sense != state.sense and (settings.folds or settings.targets):
        y, t = _fold(scaled, pieces[0], settings)
        pieces = [replace(pieces[0], b=y, tb=t), replace(pieces[0], a=y, ta=t)]
        if settings.folds:
            points.append(_point(scaled, y, t, "fold", trial.kink, _along(state, y)))
    for piece in pieces:
        for lam, is_bound in _values(piece, scaled.lam_scale, settings):
            here = _at(scaled, piece, lam / scaled.lam_scale, settings)
            if here is not None:
                kind: Kind = "bound" if is_bound else "target"
                points.append(_point(scaled, *here, kind, trial.kink, _along(state, here[0]), lam))
            if is_bound:
                return points, lam
    return points, None


def _along(state: State, y: Array) -> float:
    return state.arclength + norm(y - state.y)


def _values(piece: Segment, scale: float, settings: Settings) -> list[tuple[float, bool]]:
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
    return bool(norm(nearest - state.origin) <= 0.2 * norm(chord))


def _next_step(state: State, trial: _Trial, length: float, settings: Settings) -> float:
    """From the contraction (proportional to the predictor's error, a power of the step) and the turn (to the step).

    A kink says nothing about the curve beyond it: half of what was used before.
    """
    if trial.kink:
        return max(0.5 * state.step, settings.step_min)
    turned = max(_angle(state.tangent, trial.tangent), 1e-6)
    by_turn = TURN * settings.angle / turned
    order = 2 if settings.predictor == "tangent" or state.before_tangent is None else 4
    by_newton = (settings.contraction / max(trial.contraction, 1e-12)) ** (1 / order)
    step = length * max(0.5, min(by_turn, by_newton, 2.0))
    return max(settings.step_min, min(step, settings.step_max))

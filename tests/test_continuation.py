"""Newton's method and curve following against closed forms, and on curves with kinks, gaps and crossings."""

from __future__ import annotations

import pickle
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import scipy.optimize

from microslip.continuation import CONVERGED, Branch, NewtonSettings, Settings, follow, newton, start, trace
from microslip.continuation.curve import predicted


@dataclass(frozen=True)
class Given:
    """A problem from a function of x and lambda that returns R, dR/dx, dR/dlambda (nested lists)."""

    function: object
    x_scale: object = 1.0
    lam_scale: float = 1.0

    def evaluate(self, x, lam):
        return tuple(np.array(v, dtype=float) for v in self.function(x, lam))


class Smooth(Given):
    """One whose derivatives do not jump."""

    smooth = True


def scalar(f, fx, fl, **scales) -> Given:
    return Given(lambda x, lam: ([f(x[0], lam)], [[fx(x[0], lam)]], [fl(x[0], lam)]), **scales)


CIRCLE = scalar(lambda x, p: x * x + p * p - 1, lambda x, p: 2 * x, lambda x, p: 2 * p)
CUBIC = scalar(lambda x, p: x**3 - x - p, lambda x, p: 3 * x * x - 1, lambda x, p: -1)
PITCHFORK = scalar(lambda x, p: p * x - x**3, lambda x, p: p - 3 * x * x, lambda x, p: x)


def scaled_points(branch: Branch, problem) -> np.ndarray:
    return np.column_stack([branch.x / problem.x_scale, branch.lam / problem.lam_scale])


def goes_on(branch: Branch, problem) -> bool:
    """Arclength grows, and every step leads along the tangent at its beginning or end (one of them, if a kink lies
    at the other): nothing is gone through twice."""
    y = scaled_points(branch, problem)
    tangents = np.array([p.tangent for p in branch.points])
    steps = np.diff(y, axis=0)
    along = np.maximum((steps * tangents[:-1]).sum(1), (steps * tangents[1:]).sum(1))
    return bool((np.diff([p.arclength for p in branch.points]) > 0).all() and (along > 0).all())


# Newton ---------------------------------------------------------------------------------------------------------------


def test_newton_converges_quadratically_and_says_how_well():
    problem = scalar(lambda x, p: np.exp(x) - p, lambda x, p: np.exp(x), lambda x, p: -1)
    found = newton(problem, np.array([0.0]), 2.0)
    assert found.converged and found.status == CONVERGED and found.iterations <= 6
    assert abs(found.x[0] - np.log(2.0)) < 1e-14 and found.error < 1e-10


def test_smooth_equations_need_one_evaluation_less_and_are_as_exact():
    """x^2 = 2 from 1.5: corrections 8.3e-2, 2.4e-3, 2.1e-6, 1.6e-12; the fourth is known from the two before it."""
    problem = scalar(lambda x, p: x * x - p, lambda x, p: 2 * x, lambda x, p: -1)
    plain, smooth = newton(problem, np.array([1.5]), 2.0), newton(Smooth(problem.function), np.array([1.5]), 2.0)
    assert smooth.evaluations == plain.evaluations - 1 == 3
    assert abs(smooth.x[0] - np.sqrt(2)) < 4 * smooth.error < 1e-11


def test_steps_that_overshoot_are_halved():
    problem = scalar(lambda x, p: np.arctan(x) - p, lambda x, p: 1 / (1 + x * x), lambda x, p: -1)
    assert abs(newton(problem, np.array([20.0]), 0.0).x[0]) < 1e-12  # the plain method diverges from 1.4 on


def test_a_cycle_of_the_plain_method_across_kinks_is_left():
    def f(x, p):
        return np.clip(x, -1, 1) * 9.5 + 0.5 * x - p

    problem = scalar(f, lambda x, p: 10.0 if abs(x) < 1 else 0.5, lambda x, p: -1)
    plain = newton(problem, np.array([19.0]), 0.0, NewtonSettings(halvings=0, forced=40, last_resort=False))
    assert not plain.converged  # 19, -19, 19, ...
    assert abs(newton(problem, np.array([19.0]), 0.0).x[0]) < 1e-12


def test_the_trust_region_finds_what_newton_does_not():
    """Powell's badly scaled function: the solution (1.098e-5, 9.106) from (0, 1)."""

    def f(x, p):
        a, b = x
        R = [1e4 * a * b - 1, np.exp(-a) + np.exp(-b) - 1.0001]
        return R, [[1e4 * b, 1e4 * a], [-np.exp(-a), -np.exp(-b)]], [0, 0]

    settings = NewtonSettings(iterations=4)
    problem = Given(f)
    assert not newton(problem, np.array([0.0, 1.0]), 0.0, replace(settings, last_resort=False)).converged
    found = newton(problem, np.array([0.0, 1.0]), 0.0, settings)
    assert found.converged and np.allclose(found.x, [1.0981593e-5, 9.1061467], rtol=1e-6, atol=0)


@pytest.mark.parametrize(
    "f, slope, word",
    [
        (lambda x: x * x + 1, lambda x: 2 * x, "start"),  # no solution
        (lambda x: 1.0, lambda x: 0.0, "singular"),
        (lambda x: np.nan, lambda x: 1.0, "not a number"),
    ],
)
def test_failure_is_a_result_that_says_what_to_try(f, slope, word):
    found = newton(scalar(lambda x, p: f(x), lambda x, p: slope(x), lambda x, p: 0), np.array([0.7]), 0.0)
    assert not found.converged and word in found.status and not np.isfinite(found.error)


def test_a_place_where_the_residual_is_undefined_is_stepped_back_from():
    problem = scalar(
        lambda x, p: np.log(x) + p if x > 0 else np.nan, lambda x, p: 1 / x if x > 0 else np.nan, lambda x, p: 1
    )
    assert abs(newton(problem, np.array([20.0]), 0.0).x[0] - 1) < 1e-12  # the first full step leads to x = -40


# closed forms ---------------------------------------------------------------------------------------------------------


def test_a_circle_is_closed_and_has_two_folds():
    found = trace(CIRCLE, np.array([1.1]), 0.0)
    assert found.status.startswith("closed") and goes_on(found, CIRCLE)
    assert np.abs(np.hypot(found.x[:, 0], found.lam) - 1).max() < 1e-10
    assert np.allclose([p.lam for p in found.of_kind("fold")], [1, -1], rtol=0, atol=1e-12)
    assert np.abs([p.x[0] for p in found.of_kind("fold")]).max() < 1e-9
    assert abs(found.points[-1].arclength - 2 * np.pi) < 0.01  # chords


def test_folds_of_a_cubic_are_located_and_values_hit_exactly():
    settings = Settings(low=-2, high=2, targets=(0.0, 0.2, 5.0))
    found = trace(CUBIC, np.array([-1.5]), -1.875, settings)
    folds = found.of_kind("fold")
    assert np.allclose([p.x[0] for p in folds], [-(3**-0.5), 3**-0.5], rtol=0, atol=1e-8)
    assert np.allclose([p.lam for p in folds], [2 * 3**-1.5, -2 * 3**-1.5], rtol=0, atol=1e-14)
    targets = found.of_kind("target")
    assert [p.lam for p in targets] == [0.0, 0.2, 0.2, 0.0, 0.0, 0.2]  # three passes, in order; 5 is never reached
    roots = [sorted(np.roots([1, 0, -1, -v]).real) for v in (0.0, 0.2)]
    wanted = [roots[0][0], roots[1][0], roots[1][1], roots[0][1], roots[0][2], roots[1][2]]
    assert np.allclose([p.x[0] for p in targets], wanted, rtol=0, atol=1e-10)
    assert found.points[-1].kind == "bound" and found.points[-1].lam == 2.0 and "bound" in found.status
    assert goes_on(found, CUBIC)


def test_a_target_exactly_on_a_bound_or_a_fold_does_no_harm():
    fold = 2 * 3**-1.5
    found = trace(CUBIC, np.array([-1.5]), -1.875, Settings(low=-2, high=2, targets=(2.0, fold, fold - 1e-9, -1.875)))
    assert found.points[-1].lam == 2.0 and len(found.of_kind("fold")) == 2
    near = [p for p in found.of_kind("target") if p.lam == fold - 1e-9]
    assert len(near) == 3 and abs(near[1].x[0] - near[0].x[0]) > 1e-5  # on both sides of the fold, and far beyond


def test_downwards_is_the_same_curve():
    up = trace(CUBIC, np.array([-1.5]), -1.875, Settings(low=-2, high=2))
    down = trace(CUBIC, np.array([1.5]), 1.875, Settings(low=-2, high=2, direction=-1))
    assert np.allclose([p.lam for p in up.of_kind("fold")], [p.lam for p in down.of_kind("fold")][::-1], atol=1e-12)


def test_a_pitchfork_is_passed_and_located_on_both_branches():
    trivial = trace(PITCHFORK, np.array([0.0]), -1.0, Settings(high=1))
    (place,) = trivial.of_kind("branch point")
    assert abs(place.lam) < 1e-6 and np.abs(trivial.x).max() < 1e-12 and trivial.points[-1].lam == 1.0
    bent = trace(PITCHFORK, np.array([1.0]), 1.0, Settings(high=1, direction=-1))
    (place,) = bent.of_kind("branch point")
    assert abs(place.lam) < 1e-6 and abs(place.x[0]) < 1e-6
    assert bent.points[-1].lam == 1.0 and abs(bent.points[-1].x[0] + 1) < 1e-10  # through, to the other half
    quiet = trace(PITCHFORK, np.array([0.0]), -1.0, Settings(high=1, branch_points=False))
    assert not quiet.of_kind("branch point") and np.abs(quiet.x).max() < 1e-12


@pytest.mark.parametrize("predictor, order", [("tangent", 2), ("cubic", 4)])
def test_the_predictor_is_wrong_by_a_power_of_the_step(predictor, order):
    lengths, errors = 0.08 * 0.5 ** np.arange(4), []
    for h in lengths:
        settings = Settings(step=h, step_max=h, angle=1.0, predictor=predictor, contraction=10.0)
        states = follow(CUBIC, start(CUBIC, np.array([-1.2]), -0.528, settings), settings)
        next(states)
        state = next(states)
        guess = predicted(state, h, settings)
        errors.append(np.linalg.norm(next(states).y - guess))
    slope = np.polyfit(np.log(lengths), np.log(errors), 1)[0]
    assert abs(slope - order) < 0.2


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-4, 1e-5])
def test_nearly_touching_branches_are_not_exchanged(gap):
    """lambda^2 - x^2 = gap^2: two hyperbolas, 2 gap apart; the one of negative lambda turns back."""
    problem = scalar(lambda x, p: p * p - x * x - gap**2, lambda x, p: -2 * x, lambda x, p: 2 * p)
    found = trace(problem, np.array([-1.0]), -1.0, Settings(low=-1.2, high=1.0))
    (fold,) = found.of_kind("fold")
    assert abs(fold.lam + gap) < 1e-12 and not found.of_kind("branch point")
    assert found.lam[-1] == -1.2 and found.x[-1, 0] > 0 and (found.lam < 0).all() and goes_on(found, problem)


def test_an_imperfect_pitchfork_is_followed_round_its_knee():
    for flaw in (1e-2, 1e-4, 1e-6):
        problem = scalar(
            lambda x, p, e=flaw: p * x - x**3 + e, lambda x, p: p - 3 * x * x, lambda x, p: x
        )  # the branch from below ends on the upper half
        found = trace(problem, np.array([flaw]), -1.0, Settings(high=1))
        assert (found.x > 0).all() and not found.of_kind("branch point") and not found.of_kind("fold")
        assert found.lam[-1] == 1.0 and abs(found.x[-1, 0] ** 3 - found.x[-1, 0] - flaw) < 1e-12


# kinks ----------------------------------------------------------------------------------------------------------------


def zigzag(slope: float) -> Given:
    """lambda = slope * triangle wave of x, with kinks at x = +-1/2, 3/2, ..."""

    def f(x, lam):
        k = np.floor(x[0] + 0.5)
        way = slope * (1 - 2 * (k % 2))
        return [lam - way * (x[0] - k)], [[-way]], [1.0]

    return Given(f)


@pytest.mark.parametrize("degrees", [30, 60, 90, 120, 150, 170])
def test_a_zigzag_is_followed_through_every_kink(degrees):
    slope = np.tan(np.radians(degrees / 2))
    leg = 1 / np.cos(np.radians(degrees / 2))
    problem = zigzag(slope)
    found = trace(problem, np.array([0.0]), 0.0, Settings(points=300))
    y, folds = scaled_points(found, problem), found.of_kind("fold")
    assert found.status.startswith("points") and (np.diff(y[:, 0]) > 0).all()
    assert len(folds) == int(found.x[-1, 0] + 0.5) >= 2
    assert np.allclose([p.x[0] for p in folds], 0.5 + np.arange(len(folds)), rtol=0, atol=1e-9)
    assert np.allclose(np.abs([p.lam for p in folds]), slope / 2, rtol=1e-9, atol=0)
    assert abs(found.points[-1].arclength - leg * found.x[-1, 0]) < 0.02 * len(folds)  # corners are cut by chords


def test_absolute_values_are_turned_at():
    problem = scalar(lambda x, p: abs(x) - p, lambda x, p: np.sign(x), lambda x, p: -1)  # 90 degrees
    found = trace(problem, np.array([1.0]), 1.0, Settings(direction=-1, high=1.0))
    (fold,) = found.of_kind("fold")
    assert abs(fold.x[0]) < 1e-9 and abs(fold.lam) < 1e-9 and fold.kink
    assert abs(found.x[-1, 0] + 1) < 1e-10


def test_a_flat_region_is_crossed_and_is_no_fold():
    """lambda = x without its middle: rises, stays, rises; and lambda = the same, then falls."""

    def flat(x, lam, way):
        d = x[0] - np.clip(x[0], -0.5, 0.5)
        s = 1.0 if x[0] < 0 else way
        return [s * d - lam], [[s if d else 0.0]], [-1.0]

    rises = trace(Given(lambda x, p: flat(x, p, 1)), np.array([-1.5]), -1.0, Settings(low=-1.0, high=1.0))
    assert abs(rises.x[-1, 0] - 1.5) < 1e-10 and not rises.of_kind("fold")
    falls = trace(Given(lambda x, p: flat(x, p, -1)), np.array([-1.5]), -1.0, Settings(low=-1.0, high=1.0))
    assert abs(falls.x[-1, 0] - 1.5) < 1e-10 and falls.lam[-1] == -1.0 and len(falls.of_kind("fold")) == 1


class Folded:
    """A y + B |W y + w| = b in n + 1 unknowns with random matrices: straight legs, kinks of any angle; `exact` walks
    from kink to kink."""

    x_scale, lam_scale = 1.0, 1.0

    def __init__(self, seed: int, n: int, surfaces: int, strength: float):
        random = np.random.default_rng(seed)
        self.A = random.standard_normal((n, n + 1))
        W = random.standard_normal((surfaces, n + 1))
        self.W, self.w = W / np.linalg.norm(W, axis=1)[:, None], random.standard_normal(surfaces)
        self.B = strength * random.standard_normal((n, surfaces)) / np.sqrt(surfaces)
        self.y = 0.1 * random.standard_normal(n + 1)
        self.b = self.A @ self.y + self.B @ np.abs(self.W @ self.y + self.w)

    def evaluate(self, x, lam):
        y = np.append(x, lam)
        g = self.W @ y + self.w
        D = self.A + self.B @ (np.sign(g)[:, None] * self.W)
        return self.A @ y + self.B @ np.abs(g) - self.b, D[:, :-1], D[:, -1]

    def exact(self, length: float) -> np.ndarray:
        """Corners up to a length. At a surface the leg goes on into the cell beyond, so g's sign alone decides."""
        y, side = self.y, np.sign(self.W @ self.y + self.w)
        t, corners, total, way = np.eye(len(y))[-1], [y], 0.0, 0.0
        last = None
        while total < length:
            null = np.linalg.svd(self.A + self.B @ (side[:, None] * self.W))[2][-1]
            t = null * (np.sign(null[-1]) if last is None else np.sign(way * (self.W[last] @ null)))
            with np.errstate(divide="ignore"):
                far = np.where(side * (self.W @ t) < 0, -(self.W @ y + self.w) / (self.W @ t), np.inf)
            if last is not None:
                far[last] = np.inf
            last = int(np.argmin(far))
            step = min(far[last], length - total + 1e-9)
            y, total = y + step * t, total + step
            corners.append(y)
            way = float(np.sign(self.W[last] @ t))
            side[last] *= -1
        return np.array(corners)


def along(corners: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of y from every leg, and arclength of the nearest place on it."""
    legs = np.diff(corners, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    share = np.clip(((y - corners[:-1]) * legs).sum(1) / lengths**2, 0, 1)
    distance = np.linalg.norm(corners[:-1] + share[:, None] * legs - y, axis=1)
    return distance, np.append(0, np.cumsum(lengths))[:-1] + share * lengths


@pytest.mark.parametrize(
    "n, surfaces, strength",
    [(1, 6, 1.0), (3, 10, 3.0), *(pytest.param(*p, marks=pytest.mark.slow) for p in ((10, 40, 4.0), (3, 30, 10.0)))],
)
def test_random_piecewise_linear_curves_are_never_left_or_reversed(n, surfaces, strength):
    """Against a walk from kink to kink: every point lies on it, in order, to the end. Many kinks exceed 90 degrees."""
    sharp = 0
    for seed in range(8):
        problem = Folded(seed, n, surfaces, strength)
        corners, length = problem.exact(8.0), 7.5
        settings, place = Settings(points=2000), 0.0
        for state in follow(problem, start(problem, problem.y[:-1], problem.y[-1], settings), settings):
            for p in state.found:
                distance, at = along(corners, np.append(p.x, p.lam))
                ahead = at[(distance < 1e-8) & (at >= place - 1e-6)]
                assert len(ahead), (seed, place)  # it has left the curve, or gone back on it
                place = ahead.min()
            if place > length:
                break
        assert place > length or state.status.startswith("closed"), (seed, place, state.status)
        legs = np.diff(corners, axis=0) / np.linalg.norm(np.diff(corners, axis=0), axis=1)[:, None]
        sharp += int(((legs[1:] * legs[:-1]).sum(1) < 0).sum())
    assert sharp >= 1


# oscillators ----------------------------------------------------------------------------------------------------------


def one_harmonic(stiffness, damping: float, force: float, scale: float) -> Given:
    """q'' + damping q' + harmonic stiffness(|q|) q = force cos(lambda t), one harmonic; x = (Re, Im).

    stiffness: amplitude -> complex stiffness and its derivative.
    """

    def f(x, lam):
        q, a = x[0] + 1j * x[1], np.hypot(*x)
        k, slope = stiffness(a)
        total = k - lam**2 + 1j * lam * damping
        by = [total + slope * q * (x[0] / a if a else 1.0), 1j * total + slope * q * (x[1] / a if a else 0.0)]
        R, by_lam = total * q - force, (-2 * lam + 1j * damping) * q
        return [R.real, R.imag], [[b.real for b in by], [b.imag for b in by]], [by_lam.real, by_lam.imag]

    return Given(f, x_scale=scale)


def frequencies(stiffness, damping: float, force: float, amplitude: float) -> np.ndarray:
    """Both frequencies at which the response has an amplitude (nan where it is beyond the peak), from
    (Re k - w^2)^2 + (Im k + w damping)^2 = (force / amplitude)^2 by its quartic in w."""
    k = complex(stiffness(amplitude)[0])
    quartic = [1, 0, damping**2 - 2 * k.real, 2 * damping * k.imag, abs(k) ** 2 - (force / amplitude) ** 2]
    roots = np.roots(quartic)
    return np.sort(roots[(abs(roots.imag) < 1e-7) & (roots.real > 0)].real)


def on_curve(found: Branch, stiffness, damping, force) -> float:
    return max(
        np.abs(frequencies(stiffness, damping, force, np.hypot(*p.x)) / p.lam - 1).min(initial=np.inf)
        for p in found.points
        if p.kind in ("regular", "target") and abs(p.tangent[-1]) > 1e-2 and np.hypot(*p.x) > 1e-6
    )


def test_duffing_with_one_harmonic_has_its_closed_response_and_both_folds():
    cubic, damping, force = 0.05, 0.05, 0.4

    def stiffness(a):
        return 1 + 0.75 * cubic * a * a, 1.5 * cubic * a

    problem = one_harmonic(stiffness, damping, force, 5.0)
    found = trace(problem, np.array([0.4, 0.0]), 0.3, Settings(low=0.2, high=2.5))
    assert found.lam[-1] == 2.5 and goes_on(found, problem) and on_curve(found, stiffness, damping, force) < 1e-9

    # w^2 (a) of each flank in closed form; a fold is an extremum of it
    def flank(a, way):
        k = stiffness(a)[0]
        half = k - damping**2 / 2
        return np.sqrt(half + way * np.sqrt(max(half**2 - k**2 + (force / a) ** 2, 0.0)))

    peak = scipy.optimize.brentq(lambda a: force / a - damping * np.sqrt(stiffness(a)[0] - damping**2 / 4), 3, 20)
    low = scipy.optimize.minimize_scalar(
        lambda a: flank(a, 1), bounds=(0.5, 3.5), method="bounded", options={"xatol": 1e-9}
    )
    high = scipy.optimize.minimize_scalar(
        lambda a: -flank(a, 1), bounds=(0.98 * peak, peak), method="bounded", options={"xatol": 1e-9}
    )
    assert np.allclose([p.lam for p in found.of_kind("fold")], [-high.fun, low.fun], rtol=0, atol=1e-8)


def jenkins(spring: float, limit: float):
    """First harmonic of a spring in series with a slider, and the derivative with respect to the amplitude."""
    onset = limit / spring

    def stiffness(a):
        if a <= onset:
            return 1 + spring, 0.0
        c = 1 - 2 * onset / a
        theta, s = np.arccos(c), np.sqrt(1 - c * c)
        turn = -2 * onset / a**2 / s  # d theta / d a
        k = spring / np.pi * (theta - s * c + 1j * s * s)
        return 1 + k, spring / np.pi * (2 * s * s + 2j * s * c) * turn

    return stiffness


@pytest.mark.parametrize("spring, limit", [(0.3, 0.5), (3.0, 0.5), (100.0, 0.5), (0.3, 0.15), (3.0, 2.5)])
def test_a_jenkins_oscillator_is_followed_through_the_onset_of_slip(spring, limit):
    """The tangent jumps where slip begins and ends; with 100 times the spring the curve nearly turns back there."""
    stiffness, damping, force = jenkins(spring, limit), 0.02, 0.4
    problem = one_harmonic(stiffness, damping, force, 5.0)
    top = 1.5 * np.sqrt(1 + spring)
    first = newton(problem, np.array([force / (1 + spring), 0.0]), 0.1)
    found = trace(problem, first.x, 0.1, Settings(low=0.05, high=top, step_max=0.03))
    assert found.lam[-1] == top and goes_on(found, problem) and not found.of_kind("branch point")
    assert on_curve(found, stiffness, damping, force) < 1e-8
    slips = np.hypot(*found.x.T) > limit / spring
    assert slips.any() and not slips[0]
    back = trace(problem, found.x[-1], top, Settings(low=0.1, high=top, step_max=0.03, direction=-1))
    assert back.lam[-1] == 0.1 and np.allclose(back.x[-1], first.x, rtol=0, atol=1e-8)
    assert abs(summit(found) / summit(back) - 1) < 5e-3


def summit(branch: Branch) -> float:
    """Of the parabola over the arclength through the highest point and those beside it."""
    a, s = np.hypot(*branch.x.T), np.array([p.arclength for p in branch.points])
    near = slice(a.argmax() - 1, a.argmax() + 2)
    c, b, a0 = np.polyfit(s[near] - s[near][1], a[near], 2)
    return a0 - b * b / (4 * c)


def sampled(law, harmonics: int, samples: int, damping: float, force: float, scale: float) -> Given:
    """q'' + damping q' + q + law(q) = force cos(lambda t), harmonics 0..H by a discrete transform: a kink of the curve
    wherever a sample meets a kink of the law. law: samples of q and of its derivatives -> force, its derivatives."""
    t = 2 * np.pi * np.arange(samples) / samples
    orders = np.arange(1, harmonics + 1)
    E = np.hstack([np.ones((samples, 1)), np.cos(np.outer(t, orders)), np.sin(np.outer(t, orders))])
    back = E.T / samples * np.r_[1, np.full(2 * harmonics, 2)][:, None]
    n = 2 * harmonics + 1
    h = np.r_[0, orders, orders]
    turn = np.zeros((n, n))
    turn[orders, orders + harmonics], turn[orders + harmonics, orders] = orders, -orders
    load = np.zeros(n)
    load[1] = force

    def f(x, lam):
        g, slope = law(E @ x, E)
        linear = np.diag(1 - lam**2 * h**2) + lam * damping * turn
        by_lam = (np.diag(-2 * lam * h**2) + damping * turn) @ x
        return linear @ x + back @ g - load, linear + back @ slope, by_lam

    return Given(f, x_scale=scale)


SLOW = pytest.mark.slow


@pytest.mark.parametrize("hardness", [pytest.param(0.5, marks=SLOW), 5.0, pytest.param(100.0, marks=SLOW), -0.4])
def test_an_oscillator_with_a_gap_is_the_same_curve_from_both_ends(hardness):
    """One-sided stop (or a spring that partly lets go) at q = 1, seven harmonics, 64 samples."""
    gap = 1.0

    def law(q, by):
        return hardness * np.maximum(q - gap, 0), hardness * (q > gap)[:, None] * by

    problem = sampled(law, 7, 64, 0.05, 0.3, 3.0)
    longest = 0.02 if hardness == 100.0 else 0.005  # of the other ones the shortest leg between two folds is 0.004
    ends = Settings(low=0.55, high=3.0, points=4000, step_max=longest)
    up = trace(problem, np.zeros(15), 0.55, ends)
    down = trace(problem, np.zeros(15), 3.0, replace(ends, direction=-1))
    assert up.lam[-1] == 3.0 and down.lam[-1] == 0.55 and goes_on(up, problem) and goes_on(down, problem)
    residual = max(np.abs(problem.evaluate(p.x, p.lam)[0]).max() for p in up.points)
    assert residual < 1e-8
    folds = [sorted(p.lam for p in b.of_kind("fold")) for b in (up, down)]
    assert len(folds[0]) == len(folds[1]) and np.allclose(*folds, rtol=0, atol=1e-7)
    assert up.points[-1].arclength == pytest.approx(down.points[-1].arclength, rel=1e-2)


def slider(spring: float, limit: float, press: float):
    """Spring and slider, marched three cycles; the limit is limit + press q, and where that is negative it is open."""

    def law(q, by):
        forces, slopes = np.zeros(len(q)), np.zeros_like(by)
        s, slope, before = 0.0, np.zeros(by.shape[1]), -1
        for i in list(range(len(q))) * 3:
            s, slope, most = (
                s + spring * (q[i] - q[before]),
                slope + spring * (by[i] - by[before]),
                limit + press * q[i],
            )
            if most <= 0:
                s, slope = 0.0, 0.0 * slope
            elif abs(s) > most:
                s, slope = np.sign(s) * most, np.sign(s) * press * by[i]
            forces[i], slopes[i], before = s, slope, i
        return forces, slopes

    return law


@pytest.mark.parametrize(
    "spring, limit, press, force",
    [
        (1.0, 0.5, 0.0, 0.2),
        pytest.param(10.0, 0.5, 0.0, 0.2, marks=SLOW),
        (1.0, 0.2, 0.15, 0.3),
        pytest.param(10.0, 0.3, 0.3, 0.3, marks=SLOW),
        pytest.param(3.0, 0.3, -0.6, 0.5, marks=SLOW),
    ],
)
def test_friction_with_varying_normal_load_is_the_same_curve_from_both_ends(spring, limit, press, force):
    """Three harmonics, 48 samples, sticking at both ends of the sweep or lifting off at resonance."""
    problem = sampled(slider(spring, limit, press), 3, 48, 0.02, force, 3.0)
    ends = Settings(low=0.5, high=1.6 * np.sqrt(1 + spring), points=3000)
    up = trace(problem, np.zeros(7), ends.low, ends)
    down = trace(problem, np.zeros(7), ends.high, replace(ends, direction=-1))
    assert up.lam[-1] == ends.high and down.lam[-1] == ends.low and goes_on(up, problem) and goes_on(down, problem)
    assert not up.of_kind("branch point") and not down.of_kind("branch point")
    assert any(p.kink for p in up.points) and any(p.kink for p in down.points)
    curves = [scaled_points(b, problem) for b in (up, down)]
    # chords of 0.1 that turn by 0.35 are 0.004 away from their arcs
    assert max(along(curves[0], y)[0].min() for y in curves[1]) < 0.01
    assert max(along(curves[1], y)[0].min() for y in curves[0]) < 0.01


def test_the_example_of_the_page_prints_what_it_says(capsys):
    page = (Path(__file__).resolve().parents[1] / "docs" / "continuation.md").read_text(encoding="utf-8")
    code = re.search(r"```python\n(.*?)```", page, flags=re.S).group(1)
    exec(compile(code, "continuation.md", "exec"), {})
    assert capsys.readouterr().out.splitlines() == re.findall(r"^print\(.*\) +# (.*)$", code, flags=re.M)


# units, resuming ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Rescaled:
    """Another problem in other units, with rows multiplied."""

    problem: object
    units: np.ndarray
    lam_unit: float
    rows: np.ndarray

    @property
    def x_scale(self):
        return self.problem.x_scale * self.units

    @property
    def lam_scale(self):
        return self.problem.lam_scale * self.lam_unit

    def evaluate(self, x, lam):
        R, J, slope = self.problem.evaluate(x / self.units, lam / self.lam_unit)
        return R * self.rows, self.rows[:, None] * J / self.units, self.rows * slope / self.lam_unit


@pytest.mark.parametrize("power, tolerance", [(2.0**20, 0.0), (1e6, 1e-8)])
def test_units_do_not_change_the_curve(power, tolerance):
    """Powers of two: to the last bit. Else to the corrector's tolerance, with the same number of points."""
    problem = one_harmonic(jenkins(3.0, 0.5), 0.02, 0.4, 5.0)
    units, rows = np.array([power, 1 / power]), np.array([1 / power, power])
    other = Rescaled(problem, units, power, rows)
    one = trace(problem, np.array([0.1, 0.0]), 0.1, Settings(high=3))
    two = trace(other, np.array([0.1, 0.0]) * units, 0.1 * power, Settings(high=3 * power))
    assert len(one.points) == len(two.points) > 40
    assert np.abs(two.x / units - one.x).max() <= tolerance and np.abs(two.lam / power - one.lam).max() <= tolerance


def test_a_curve_goes_on_from_a_kept_state():
    settings = Settings(high=2.0, low=-2.0)
    states = list(follow(CUBIC, start(CUBIC, np.array([-1.5]), -1.875, settings), settings))
    again = list(follow(CUBIC, pickle.loads(pickle.dumps(states[10])), settings))
    assert [p.lam for s in again for p in s.found] == [p.lam for s in states[10:] for p in s.found]
    short = trace(CUBIC, np.array([-1.5]), -1.875, replace(settings, points=20))
    assert short.status.startswith("points") and len(short.points) == 20
    rest = list(follow(CUBIC, replace(short.state, status=""), settings))
    assert rest[-1].found[-1].lam == 2.0


def test_a_start_that_fails_says_so():
    nothing = trace(scalar(lambda x, p: x * x + 1, lambda x, p: 2 * x, lambda x, p: 0), np.array([1.0]), 0.0)
    assert nothing.points == () and nothing.status.startswith("no start")
    crossing = trace(PITCHFORK, np.array([0.0]), 0.0)
    assert crossing.points == () and "singular" in crossing.status


def test_a_curve_that_ends_is_reported_stuck_at_its_end():
    """sqrt(1 - lambda) - x: there is no solution beyond lambda = 1."""
    problem = scalar(
        lambda x, p: np.sqrt(1 - p) - x if p < 1 else np.nan,
        lambda x, p: -1,
        lambda x, p: -0.5 / np.sqrt(1 - p) if p < 1 else np.nan,
    )
    found = trace(problem, np.array([1.0]), 0.0, Settings())
    assert found.status.startswith("stuck") and abs(found.lam[-1] - 1) < 1e-6

"""The point contact element without mass: normal law, tangential springs and a slider, by a return map.

Sextro, section 3.7, in the limit of a vanishing mass of the point P. Between the body's point M and P stand the
normal law and two tangential springs (with dampers, if wanted); P sticks to the other body or slides on it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero

from ..programs import seldom
from ..reduced.compliance import BULK_AND_SURFACE
from ..settings.numbers import NotNegative, Positive, PositiveLength
from .friction import Friction, StaticSliding
from .kinds import LawKind
from .law import Array, Law, Scalar, Step, bisected, norm, number, ratio, root, settings, static, value
from .normal import Hyperbolic, Normal, Preload

if TYPE_CHECKING:
    from .composed import ContactModel
    from .settings import ContactLaw


class PointState(NamedTuple):
    """State of n points: u_t (2, n) m, elastic force (2, n) N, what friction holds (n,) N, share (n,), slip (2, n) m,
    time (n,) s."""

    tangential: Array
    elastic: Array
    held: Array
    share: Array
    slipped: Array
    time: Array


class Stretch(NamedTuple):
    """Of a step of n points what does not depend on the force of their springs.

    Attributes: pressed: (n,) N. share: (n,) of the area. springs, stiffness: (2, n) N/m at its end, and what they and
        their dampers count over the step. left: (n,) share of the area before that is left. way: (2, n) N, stiffness
        times displacement. before, held: (n,) N that friction holds, at the beginning of what is left, and at the end.
    """

    pressed: Array
    share: Array
    springs: Array
    stiffness: Array
    left: Array
    way: Array
    before: Array
    held: Array


class OnNormal(Law):
    """Friction on what a normal law presses, to which a damper may add; its state tells time and path."""

    normal: Normal
    friction: Friction
    damping: Array | None

    def limit(self, force: Array, state: Any) -> Array:
        return self.friction.highest(force[:, 0], state.time) * force[:, 0]

    def slip(self, state: Any) -> Array:
        return state.slipped.T

    def _pressed(self, u: Array, v: Array) -> Array:
        force = self.normal.force(u)
        if self.damping is not None:
            force = jnp.maximum(force + self.damping * self.normal.stiffness(u) * v, 0.0)
        return force


@settings
class PointContact(OnNormal):
    """Point contact with stick, slip and separation in three dimensions.

    The printed tangential force, stiffness times displacement with a stiffness that follows the contact area
    (3.3-39, 3.7-21), creates energy: stuck, moved while pressed, moved back while lifted, it gives more than it took.
    Here area that comes into contact carries nothing yet (the force grows by increments), and area that is lost takes
    its part of the force with it (the force is rescaled). With the energy F^2 / (2 k share) every step then
    dissipates or does nothing; on a constant area both forms are one.

    With a constant coefficient, one stiffness and no damper a step is the exact one along a straight way (`dragged`),
    of second order in the samples on a curved path. Otherwise it is the return map of the step's end, of first order.

    Attributes:
        normal: normal law. friction: characteristic. stiffness_1: tangential stiffness along t1 of the full area
            (c_R0), N/m; stiffness_2: along t2, the same if None. damping: beta, s: force per rate of the normal and
            tangential springs (3.7-18), none if None. The normal force is cut at zero (3.7-30). includes: whose
            compliance the stiffnesses count, one of `series.INCLUDES`.
    """

    normal: Normal
    friction: Friction
    stiffness_1: Array = number(ge=0)
    stiffness_2: Array | None = number(ge=0, default=None)
    damping: Array | None = number(ge=0, default=None)
    includes: str = static(default=BULK_AND_SURFACE)

    def scaled(self, share: Array) -> PointContact | None:
        normal = self.normal.scaled(share)
        if normal is None or not self.friction.constant:  # a coefficient may depend on the force of the whole
            return None
        second = None if self.stiffness_2 is None else self.stiffness_2 * share
        return replace(self, normal=normal, stiffness_1=self.stiffness_1 * share, stiffness_2=second)

    def init(self, n: int) -> PointState:
        pair, one = jnp.zeros((2, n)), jnp.zeros(n)
        return PointState(pair, pair, one, jnp.ones(n), pair, one)  # the first step is taken with all of its area

    def step(self, u: Array, v: Array, dt: Scalar, state: PointState) -> tuple[Array, PointState]:
        w, time = self._stretch(u, v, dt, state), state.time + dt
        relaxed = state.elastic * w.left
        if self._straight:
            force = dragged(relaxed, w.way, w.before, w.held)
        else:
            relative = self._relative(w.stiffness)
            theta = slide(relaxed + w.way, w.stiffness, relative, self.friction, w.pressed, dt, time)
            force = (relaxed + w.way) * weight(theta, relative)
        stretched = ratio(force - relaxed, w.stiffness)
        elastic = force if self.damping is None else relaxed + w.springs * stretched
        tangential = u.T[1:]
        slipped = state.slipped + jnp.where(w.share > 0, tangential - state.tangential - stretched, 0.0)
        after = PointState(tangential, elastic, w.held, w.share, slipped, time)
        return jnp.concatenate([w.pressed[None], force]).T, after

    def way(self, u: Array, v: Array, dt: Scalar, state: PointState) -> Any:
        return self._stretch(u, v, dt, state) if self._straight else super().way(u, v, dt, state)

    def drag(self, way: Any, memory: Array) -> tuple[Array, Array]:
        if not self._straight:
            return super().drag(way, memory)
        force = dragged(memory * way.left, way.way, way.before, way.held)
        return jnp.concatenate([way.pressed[None], force]), force

    def _stretch(self, u: Array, v: Array, dt: Scalar, state: PointState) -> Stretch:
        approach, tangential = u.T[0], u.T[1:]
        share, pressed = self.normal.share(approach), self._pressed(approach, v.T[0])
        springs = self._springs(met(share, jnp.maximum(state.share, touching(self.normal, approach))))
        left = jnp.minimum(ratio(share, state.share), 1.0)
        stiffness = springs if self.damping is None else springs + self._springs(share) * self.damping / dt
        held = state.held
        if self._straight:
            held = self.friction.coefficient(jnp.zeros_like(pressed), pressed, state.time + dt) * pressed
        way = stiffness * (tangential - state.tangential)
        return Stretch(pressed, share, springs, stiffness, left, way, state.held * left, held)

    @property
    def remembers(self) -> int | None:
        """Two, of contacts of one coefficient and one stiffness."""
        return 2 if self.stiffness_2 is None and self.friction.constant else None

    @property
    def follows(self) -> float:
        return 0.0 if self.remembers is None else float(_follows(self))

    @property
    def viscous(self) -> bool:
        return self.damping is not None

    def rates(self, u: Array, v: Array, x: Array, time: Scalar, lag: float) -> tuple[Array, Array]:
        """x: tangential force of the springs, N. Friction holds them and the damper beside them, one of the
        lag where the law has none."""
        share, growth = jax.jvp(self.normal.share, (u[:, 0],), (v[:, 0],))
        pressed = self._pressed(u[:, 0], v[:, 0])
        mu = self.friction.coefficient(jnp.zeros_like(pressed), pressed, time)
        held = mu * pressed
        beta = lag if self.damping is None else self.damping
        stretching = self.stiffness_1 * share * v.T[1:]
        trial = x + beta * stretching
        beyond = jnp.maximum(1 - ratio(held, norm(trial), 1.0), 0.0) * trial
        lets_go = ratio(jnp.minimum(growth, 0.0), share) * x
        rate = jnp.where(share > 0, stretching - beyond / beta + lets_go, -x / beta)
        rate = jnp.where(mu > 0, rate, 0.0)  # without friction nothing is remembered, however long the steps are
        return jnp.concatenate([pressed[None], trial - beyond]).T, rate

    def memory(self, force: Array, state: PointState) -> Array:
        return state.elastic

    def recalled(self, state: PointState, memory: Array) -> PointState | None:
        return state._replace(elastic=memory) if self.friction.constant else None

    def stored(self, u: Array, state: PointState) -> Array:
        stretched = ratio(state.elastic**2, self._springs(state.share))
        return self.normal.stored(u[:, 0]) + 0.5 * jnp.sum(stretched, axis=0)

    def overlap(self, u: Array) -> Array:
        return u[:, 0] - self.normal.touches()

    def lost(self, step: Step) -> Array:
        before, after = step.before, step.after
        slid = norm(after.slipped - before.slipped)
        held = [self.friction.coefficient(slid / step.dt, f[:, 0], after.time) * f[:, 0]
                for f in (step.force_before, step.force)]  # fmt: skip
        if not self.friction.constant:  # friction that falls with the speed lets the contact jump from what it held
            held[0] = jnp.maximum(held[0], norm(step.force_before.T[1:]))
        stretch = [ratio(one.elastic, self._springs(one.share)) for one in (before, after)]
        changed = self._springs(jnp.abs(after.share - before.share))
        return 0.5 * (held[0] + held[1]) * slid + let_go(changed, *stretch) + self._damped(step)

    def _damped(self, step: Step) -> Array:
        """(n,) J that the dampers take."""
        if self.damping is None:
            return jnp.zeros(step.u.shape[0])
        spring = self.normal.force(step.u[:, 0])
        stretched = step.moved.T[1:] - (step.after.slipped - step.before.slipped)
        across = jnp.sum((step.force.T[1:] - step.after.elastic) * stretched, axis=0)
        return (step.force[:, 0] - spring) * step.moved[:, 0] + across

    def pressed(self, approach: Array) -> Array:
        return self._pressed(approach, jnp.zeros_like(approach))

    def _springs(self, share: Array) -> Array:
        """(2, n) tangential stiffness of the area in contact, N/m."""
        first = self.stiffness_1 * share
        return jnp.stack([first, first if self.stiffness_2 is None else self.stiffness_2 * share])

    def _relative(self, stiffness: Array) -> Array | None:
        """(2, n) stiffness over the larger of both; None where both are one by construction."""
        if self.stiffness_2 is None:
            return None
        return ratio(stiffness, jnp.max(stiffness, axis=0), 1.0)

    @property
    def _straight(self) -> bool:
        """Whether steps are those of `dragged`."""
        return self.stiffness_2 is None and self.damping is None and self.friction.constant


def met(after: Array, before: Array) -> Array:
    """What a spring's stiffness counts over a step from ``before`` to ``after``: area that comes carries from then on.

    Half of what came, on average; what goes takes its force with it, exactly as if it had been gone all the time.
    """
    return 0.5 * (after + jnp.minimum(after, before))


def let_go(springs: Array, before: Array, after: Array) -> Array:
    """(...) energy in J that springs (2, ...) N/m take with them, which open or come unstretched to others stretched by
    (2, ...) m before and after."""
    return 0.25 * jnp.sum(springs * (before**2 + after**2), axis=0)


def touching(normal: Normal, approach: Array) -> Array:
    """(n,) share of the area of contacts that barely touch: all of a smooth one, none of a rough one. What begins
    from there and what begins open are then the same in the limit."""
    return normal.share(jnp.full_like(approach, 1e-30))


@jax.custom_jvp
def dragged(force: Array, way: Array, before: Array, held: Array) -> Array:
    """The force of a spring after its slider was dragged along a straight way.

    The spring takes up the way until its force is what friction holds, R. From there its angle beta to the way obeys
    R d beta = -sin(beta) ds, because the slip has the direction of the force: tan(beta / 2) falls as exp(-s / R),
    exact whatever the length of the way, also where R goes straight from one value to another along it: from nothing,
    where a contact closes, the force has the direction of the way.

    Args:
        force: (2, ...) N before, not longer than ``before``. way: (2, ...) stiffness times displacement, N. before,
            held: (...) N, R at the beginning and at the end.

    Returns:
        (2, ...) N, not longer than ``held``.
    """
    slid = lambda: _dragged(force, way, before, held)[0]  # noqa: E731
    return jax.lax.cond(_slides(force + way, held).any(), slid, lambda: force + way)


def _slides(trial: Array, held: Array) -> Array:
    """(...) whether a slider is dragged. Where all of many stick, as they do in half of a cycle, nothing else is asked:
    their steps are then a tenth of the work."""
    return _square(trial) > held**2


class _Way(NamedTuple):
    """Of a slider's way: whether it slides; the share of it before it does; P and R then, and the root that tells it;
    length; mean of 1 / R from there on; sine of the last angle, and the share of d of the first one that is lost."""

    slides: Array
    share: Array
    on_cone: Array
    reached: Array
    found: Array
    length: Array
    softness: Array
    sine: Array
    lost: Array


def _dragged(force: Array, way: Array, before: Array, held: Array) -> tuple[Array, _Way]:
    trial, grows = force + way, held - before
    slides, longer = _slides(trial, held), _square(way)
    room = jnp.maximum(before**2 - _square(force), 0.0)
    a, b = longer - grows**2, _inner(force, way) - before * grows
    found = root(b**2 + a * room)  # where a s^2 + 2 b s = room the force reaches R
    ahead = b > 0
    share = jnp.clip(ratio(jnp.where(ahead, room, found - b), jnp.where(ahead, b + found, a)), 0.0, 1.0)
    reached, on_cone = before + share * grows, force + share * way
    # without a way the force keeps its direction; cosines and sines are times the length of what they are about
    moved = longer > 1e-300
    about, size = jnp.where(moved, way, trial), root(jnp.where(moved, longer, _square(trial)))
    length, both = jnp.where(moved, size, 0.0), size * reached
    along, across = _inner(about, on_cone), about[0] * on_cone[1] - about[1] * on_cone[0]
    softness = mean_inverse(reached, held)
    falls = -(1 - share) * length * softness
    left, ahead = jnp.exp(falls), along >= 0
    # cosine and sine of beta / 2 but for their size, without a difference of equal numbers
    cosine, first = jnp.where(ahead, both + along + _SOME, across), jnp.where(ahead, across, both - along)
    sine = first * left
    square = cosine**2 + sine**2
    over = ratio(held, square * size)
    turned = (cosine**2 - sine**2) * over * about + 2 * cosine * sine * over * _across(about)
    lost = -jnp.expm1(falls) * ratio(cosine**2 - first * sine, square)  # divided by the way, which may be rounding
    told = _Way(slides, share, on_cone, reached, found, length, softness, 2 * ratio(cosine * sine, square), lost)
    return jnp.where(slides, turned, trial), told


_SOME = 1e-100  # of a force that grows from nothing, which has the direction of the way


def _inner(a: Array, b: Array) -> Array:
    """Of two vectors along the first axis; a sum over that axis would be a loop of its own."""
    return a[0] * b[0] + a[1] * b[1]


def _across(a: Array) -> Array:
    """A vector turned by a right angle."""
    return jnp.stack([-a[1], a[0]])


def _square(a: Array) -> Array:
    return _inner(a, a)


def mean_inverse(first: Array, last: Array) -> Array:
    """Mean of 1 / R over a straight way from R = first to last, (ln last - ln first) / (last - first), without a
    difference of equal numbers where they are alike."""
    over, r = _unlike(first, last)

    def series() -> Array:
        return _power_series([1 / (2 * k + 1) for k in range(_TERMS)], r**2)

    def closed() -> Array:
        at = jnp.where(jnp.abs(r) < _NEAR, 0.5, r)
        return jnp.where(jnp.abs(r) < _NEAR, series(), jnp.log((1 + at) / (1 - at)) / (2 * at))

    return 2 * over * jax.lax.cond((jnp.abs(r) < _NEAR).all(), series, closed)  # arctanh(r) / r


def mean_slopes(first: Array, last: Array, mean: Array) -> tuple[Array, Array]:
    """Derivatives of `mean_inverse` with respect to both."""
    over, r = _unlike(first, last)
    at = jnp.where(jnp.abs(r) < _NEAR, 0.5, r)
    near = r * _power_series([2 * k / (2 * k + 1) for k in range(1, _TERMS)], r**2)
    bend = jnp.where(jnp.abs(r) < _NEAR, near, (1 / (1 - at**2) - 0.5 * mean * (first + last)) / at)
    both = 4 * bend * over**3
    return -mean * over - both * last, -mean * over + both * first


def _unlike(first: Array, last: Array) -> tuple[Array, Array]:
    """1 / (last + first), and (last - first) over it."""
    over = ratio(jnp.ones_like(first), first + last)
    return over, jnp.clip((last - first) * over, -_ALIKE, _ALIKE)


def _power_series(factors: list[float], z: Array) -> Array:
    """Of z^0, z^1, ..., by Horner's rule."""
    out = jnp.full_like(z, factors[-1])
    for factor in factors[-2::-1]:
        out = out * z + factor
    return out


_NEAR, _TERMS = 0.1, 9  # r up to which a series serves, the next term of which is rounding
_ALIKE = 1 - 1e-12  # of (last - first) / (last + first): from nothing, the angle falls to e^-28 and not to zero


@partial(dragged.defjvp, symbolic_zeros=True)
def _dragged_jvp(given: tuple[Array, ...], moved: tuple[Any, ...]) -> tuple[Array, Array]:
    known = [None if isinstance(one, SymbolicZero) else one for one in moved]
    trial = given[0] + given[1]
    straight = sum((one for one in known[:2] if one is not None), jnp.zeros_like(trial))
    slides = _slides(trial, given[3])
    return jax.lax.cond(slides.any(), lambda: _slid(given, known, straight), lambda: (trial, straight))


def _slid(given: tuple[Array, ...], moved: list[Array | None], straight: Array) -> tuple[Array, Array]:
    """With the derivatives of the last angle by hand: two thirds of the work of a chain of derivatives, and less
    where nothing but the force before changes."""
    _, way, before, held = given
    out, w = _dragged(*given)
    s, share_of, inverse = w.share, 1 - w.share, w.softness
    shorter, over_length = ratio(jnp.ones_like(held), w.reached), ratio(jnp.ones_like(held), w.length)
    turn = _across(w.on_cone) * shorter**2  # d angle of P over dP
    by_ends = mean_slopes(w.reached, held, inverse)
    at_first, at_last = (-w.sine * share_of * w.length * by for by in by_ends)  # d angle over dR
    angles = 1 - w.lost
    by_share = angles * _inner(turn, way) + w.sine * w.length * shorter
    by_excess = ratio(by_share, w.found)  # d angle over -(P . dP - R dR) where it reaches R
    by_force = angles * turn - by_excess * w.on_cone
    bend = w.lost * _across(way) * over_length**2 - w.sine * share_of * inverse * way * over_length
    by_way = s * by_force + jnp.where(w.length > 0, bend, share_of * inverse * w.reached * turn)
    by_before = share_of * (at_first + by_excess * w.reached)
    by_held = at_first * s + at_last + by_excess * w.reached * s
    of_force, of_way, of_before, of_held = moved
    angle, size = jnp.zeros_like(held), jnp.zeros_like(held)
    for by, of in ((by_force, of_force), (by_way, of_way)):
        angle = angle if of is None else angle + _inner(by, of)
    for by, change in ((by_before, of_before), (by_held, of_held)):
        angle = angle if change is None else angle + by * change
    if of_held is not None:
        size = ratio(of_held, held)
    return out, jnp.where(w.slides, size * out + angle * _across(out), straight)


def weight(theta: Array, relative: Array | None) -> Array:
    """Share of the trial force that is left, per direction: theta / (theta + (1 - theta) k / k_max).

    Friction that opposes the slip asks for force = trial - k slip with slip = lambda force (lambda >= 0): the force
    is trial / (1 + lambda k) in each direction. With unequal stiffness this is not the radial return.
    theta = 1 / (1 + lambda k_max) lies between 0 (all friction lost) and 1 (stick).
    """
    return theta if relative is None else ratio(theta, theta + (1 - theta) * relative)


def slide(
    trial: Array, stiffness: Array, relative: Array | None, friction: Friction, pressed: Array, dt: Scalar,
    time: Array,
) -> Array:  # fmt: skip
    """theta where friction holds what is left. With one coefficient and one stiffness that is the share which is held;
    else it is found without derivatives, which the implicit function theorem adds."""
    largest = jnp.max(stiffness, axis=0)
    if friction.constant:
        held = friction.coefficient(largest, pressed, time) * pressed
        if relative is None:
            size = norm(trial)
            return jnp.where(size <= held, 1.0, ratio(held, size, 1.0))

    def excess(theta: Array) -> Array:
        force = norm(trial * weight(theta, relative))
        slip = ratio((1 - theta) * force, theta * largest)
        return force - friction.coefficient(slip / dt, pressed, time) * pressed

    nothing, one = jnp.zeros(trial.shape[1]), jnp.ones(trial.shape[1])
    sticks = excess(one) <= 0
    if friction.constant and relative is not None:
        theta = _secular(trial, relative, held)
    else:
        # a characteristic that falls with the speed makes more than one root possible
        theta = bisected(excess, nothing, one, _STEPS)
    theta = jax.lax.stop_gradient(theta)
    value, slope = jax.jvp(excess, (theta,), (one,))
    slope = jnp.where(slope > 0, jax.lax.stop_gradient(slope), jnp.inf)
    theta = theta - (value - jax.lax.stop_gradient(value)) / slope
    return jnp.where(sticks, 1.0, jnp.clip(theta, 0.0, 1.0))


_STEPS = 50  # halvings of the interval of theta
_NEWTON = 8  # steps of an iteration that is exact for equal stiffness; enough for stiffnesses of a ratio of 1e-4


def _secular(trial: Array, relative: Array, held: Array) -> Array:
    """theta where the force is ``held`` (n,): Newton's method on 1/|force| over lambda, as for trust regions.

    1/|force(lambda)| is concave and nearly straight (More & Sorensen, SIAM J. Sci. Stat. Comput. 4, 1983), so the
    iteration rises monotonically from lambda = 0.
    """
    trial, relative, held = (jax.lax.stop_gradient(x) for x in (trial, relative, held))
    multiplier = jnp.zeros(trial.shape[1])
    for _ in range(_NEWTON):
        left = trial / (1 + multiplier * relative)
        square = jnp.sum(left**2, axis=0)
        fall = jnp.sum(relative * left**2 / (1 + multiplier * relative), axis=0)
        multiplier = jnp.maximum(multiplier + ratio(square, fall) * (ratio(root(square), held, jnp.inf) - 1), 0.0)
        multiplier = jnp.where(held > 0, multiplier, jnp.inf)
    return 1 / (1 + multiplier)


def opposed(
    trial: tuple[Array, Array], relative: tuple[Array, Array], held: Array
) -> tuple[tuple[Array, Array], Array]:  # fmt: skip
    """`weight` of both directions of springs behind a slider of constant friction, and whether it slides.

    Two steps of `_secular`, written out without guards. For stiffnesses of a ratio up to 2 the force is 1e-4 of
    ``held`` off at the most, 4e-6 where the trial force is a quarter above it; exact for equal ones. Where many strips
    are marched, this is all there is to do.

    Args:
        trial: along both directions, (n,) N. relative: their stiffness over the larger one. held: (n,) N, above 0.

    Returns:
        Shares of the trial forces that are left, (n,) each; (n,) bool.
    """
    a, b = relative
    x, y = trial[0] ** 2, trial[1] ** 2
    square = x + y
    slides = square > held**2
    m = (jnp.sqrt(square + _TINY) - held) * square / (held * (a * x + b * y) + _TINY)
    p, q = 1 + m * a, 1 + m * b
    x, y, both = x * q**2, y * p**2, p * q  # squares of what is left, times (p q)^2
    square = x + y
    m = m + (jnp.sqrt(square + _TINY) - both * held) * square / (held * (a * x * q + b * y * p) + _TINY)
    m = jnp.where(slides, m, 0.0)
    p, q = 1 + m * a, 1 + m * b
    inverse = 1 / (p * q)
    return (q * inverse, p * inverse), slides


_TINY = 1e-300  # keeps quotients of nothing, and their derivatives, at nothing


# the laws of a contact file ------------------------------------------------------------------------------------------


class OwnNormal(LawKind):
    """A law that may have a normal law of its own."""

    length: PositiveLength | None = None
    """l_0: the hyperbolic law of a short layer (3.4)"""

    def fits(self, contact: ContactLaw) -> None:
        if self.length is not None and contact.roughness is None:
            raise ValueError("law.length: the hyperbolic law needs a rough surface; add [roughness]")

    def normal(self, contact: ContactModel) -> Normal | None:
        if self.length is None:
            return None
        heights, roughness = contact.surface  # see `fits`
        return Hyperbolic(value(contact.normal_0), value(roughness), heights, value(self.length))


class OfPoint(OwnNormal):
    """Point contacts that stick, slide in any direction and open, without mass (3.7): ``rough`` ones (3.3) need
    [roughness], ``smooth`` ones have none."""

    kind: Literal["smooth", "rough"]
    damping: NotNegative = 0.0
    """[s] beta: force per rate of the springs (3.7-18)"""
    preload: Positive | None = None
    """[N] a constant normal force in place of a normal law"""

    def fits(self, contact: ContactLaw) -> None:
        super().fits(contact)
        if (self.kind == "rough") != (contact.roughness is not None):
            raise ValueError('roughness (R_Z, or a table) belongs to law = "rough"; give both or neither')
        if self.preload is not None and (contact.roughness is not None or contact.is_pressed):
            raise ValueError(
                "law.preload: a constant force has neither roughness nor another force beside it; remove [roughness] "
                "and the other force"
            )

    def normal(self, contact: ContactModel) -> Normal | None:
        return super().normal(contact) if self.preload is None else Preload(value(self.preload))

    def law(self, contact: ContactModel) -> Law:
        damping = value(self.damping) if self.damping else None
        return PointContact(contact.normal, contact.sliding, *contact.springs, damping)


@seldom
def _follows(law: PointContact) -> Array:
    """See `Law.follows`, of a law that is a differential equation."""
    zero = jnp.zeros_like(law.stiffness_1)
    rubs = jnp.any(law.stiffness_1 * law.friction.coefficient(zero, zero + 1, zero) != 0)
    return jnp.where(rubs, 0.0 if law.damping is None else jnp.min(law.damping), jnp.inf)


def saws(law: Law) -> bool:
    """Whether its points slip at once, and to less than they stuck by."""
    law = getattr(law, "whole", law)
    if not isinstance(law, PointContact) or not isinstance(law.friction, StaticSliding):
        return False
    return bool(np.any(np.asarray(law.friction.static) > law.friction.sliding))

"""Where a wheelset touches its rails: patches, their curvatures, and how they share the vertical force (Sextro, 6.2).

Track axes: x forward, y to the right, z down, from the middle between the rails in the plane of their tops. Both sides
are found as the right one: the left one's pose is mirrored first, and what it found is mirrored back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from ..data import Array
from ..errors import UserError
from ..settings.arguments import checked, checked_fields
from ..settings.numbers import Coefficient, Component, NotNegative, Positive
from .arguments import Angle
from .ellipse import Elastic, ellipses, half_width
from .profiles import CrossSection
from .strips import creep_forces


@checked_fields
@dataclass(frozen=True)
class Track:
    """Wheels on an axle and the rails below them.

    Attributes:
        wheel, rail: profiles of the right side. radius: of the running circle (z = 0 of the wheel's profile), m.
            wheel_at: of the wheel profile's origin from the middle of the axle, m. rail_at: of the rail profile's from
            the middle of the track, m. elastic: both bodies.
    """

    wheel: CrossSection
    rail: CrossSection
    radius: Positive
    wheel_at: Positive
    rail_at: Positive
    elastic: Elastic


@checked_fields
@dataclass(frozen=True)
class Pose:
    """Of a wheelset. Attributes: lateral: to the right, m. yaw: about z, roll: about x, rad. speed: m/s, forward.
    turning: of the axle, rad/s, positive forward; None: it rolls, at speed over the nominal radius."""

    lateral: Component = 0.0
    yaw: Angle = 0.0
    roll: Angle = 0.0
    speed: Positive = 1.0
    turning: NotNegative | None = None

    def mirrored(self) -> Pose:
        return replace(self, lateral=-self.lateral, yaw=-self.yaw, roll=-self.roll)


class RollingPatch(NamedTuple):
    """One contact of one wheel; axes of `strips`: x forward, z up out of the rail, y to the left, the wheel is body 1.

    Attributes:
        place: x, y, z in track axes, m. on_rail, on_wheel: y of the profiles, m. angle: of the rail's surface to the
            horizontal there, rad, positive where it falls to the right. A, B: half curvatures, 1/m. a, b, approach: m.
            pressure: Pa. normal_force: N. xi, eta: creepages; phi: spin, 1/m. speed: of rolling, m/s. conformal:
            whether the patch is too wide for a half-space. axle: y, z of the axle's middle, m.
    """

    place: Array
    on_rail: float
    on_wheel: float
    angle: float
    A: float
    B: float
    a: float
    b: float
    approach: float
    pressure: float
    normal_force: float
    xi: float
    eta: float
    phi: float
    speed: float
    conformal: bool
    axle: Array

    @property
    def side(self) -> str:
        """Of the track, "left" or "right"."""
        return "right" if self.place[1] > 0 else "left"

    def lifted(self, force_y: float) -> float:
        """N, upward, that the wheel feels under a tangential force across rolling (N)."""
        return float(self.normal_force * np.cos(self.angle) + force_y * np.sin(self.angle))

    def felt(self, force_x: float, force_y: float, moment: float, about: Array) -> Array:
        """(6,) force and moment about a point (m) that the wheel feels, in track axes (6.5-24 to 6.5-37); the rail
        feels the opposite.

        Args:
            force_x, force_y: tangential, N, and moment about the normal, N m, in the axes of the patch.
        """
        c, s = np.cos(self.angle), np.sin(self.angle)
        up, left = np.array([0.0, s, -c]), np.array([0.0, -c, -s])
        force = np.array([force_x, 0.0, 0.0]) + force_y * left + self.normal_force * up
        return np.concatenate([force, np.cross(self.place - about, force) + moment * up])


STEP = 2e-5
"""m, between the points of a wheel at which it is looked for a contact; the summit is found between them."""


Side = Literal["left", "right"]
SIDES = get_args(Side)
Drag = Callable[[list[RollingPatch]], Array]
"""Patches -> (k,) tangential force of each across rolling, on the wheel, in the axes of `RollingPatch`, N."""


@checked
def patches(
    track: Track, pose: Pose, side: Side, vertical: NotNegative, friction: Coefficient | Drag = 0.0
) -> list[RollingPatch]:
    """Contacts of one wheel under a vertical force, the one with the largest normal force first; none if it is 0.

    Args:
        side: "left" or "right". vertical: N, on this wheel, which normal and tangential forces carry together.
            friction: coefficient of the tangential ones, by `strips.creep_forces`; or what tells them.

    Raises:
        UserError: a side, force or friction that is none; wheel and rail lie nowhere above each other; friction drags
            the wheel down its flange whatever presses it.
    """
    if vertical == 0:
        return []
    return _carried(track, pose, (side,), vertical, _drag(track, friction), vertical).found[0]


@checked
def axle(
    track: Track, pose: Pose, vertical: NotNegative, even: bool = False, friction: Coefficient | Drag = 0.0
) -> tuple[list[RollingPatch], list[RollingPatch], Pose]:
    """Contacts of the left and of the right wheel of an axle, as `patches`, and its pose.

    Args:
        vertical: N, on both wheels together; the roll of the pose shares it, and a wheel may be off its rail. even: the
            axle rolls until both carry the same, and the roll of the pose is where the search for it begins. friction:
            see `patches`.

    Raises:
        UserError: see `patches`; no roll within 0.05 rad shares the force evenly.
    """
    drag, load = _drag(track, friction), vertical

    def at(pose: Pose) -> _Carried:
        nonlocal load
        carried = _carried(track, pose, SIDES, vertical, drag, load)
        load = carried.load
        return carried

    def uneven(roll: float) -> float:
        left, right = at(replace(pose, roll=roll)).lift
        return right - left

    if vertical == 0:
        return [], [], pose
    if even:
        near = pose.roll
        step = -1e-5 if uneven(near) > 0 else 1e-5
        while uneven(far := near + step) * step < 0:
            near, step = far, 4 * step
            if abs(far) > STEEPEST:
                raise UserError(
                    f"pose: no roll below {STEEPEST:g} rad shares the vertical force evenly; correct the pose"
                )
        pose = replace(pose, roll=brentq(uneven, near, far, xtol=1e-10))
    left, right = at(pose).found
    return left, right, pose


STEEPEST = 0.05
"""rad, of roll."""


def _seen(pose: Pose, side: str) -> Pose:
    return pose.mirrored() if side == "left" else pose


def _drag(track: Track, friction: float | Drag) -> Drag:
    if callable(friction):
        return friction
    if friction == 0:
        return lambda found: np.zeros(len(found))

    def by_strips(found: list[RollingPatch]) -> Array:
        xi, eta, phi, a, b, force, shear, poisson = states(track, found)[0]
        return creep_forces(xi, eta, phi, a, b, force, friction, shear, poisson).y

    return by_strips


def states(track: Track, found: list[RollingPatch]) -> tuple[Array, Array]:
    """(8, k) xi, eta, phi, a, b, normal force, G, nu of patches, and their speeds (k,), m/s."""
    e = track.elastic
    given = [[p.xi, p.eta, p.phi, p.a, p.b, p.normal_force, e.shear, e.poisson] for p in found]
    return np.array(given).T, np.array([p.speed for p in found])


class _Carried(NamedTuple):
    """Attributes: found: patches of each side. lift: N, upward, of all forces on each. load: N, of the normal ones on
    all together."""

    found: list[list[RollingPatch]]
    lift: list[float]
    load: float


def _carried(track: Track, pose: Pose, sides: tuple[str, ...], vertical: float, drag: Drag, near: float) -> _Carried:
    """At the height at which normal and tangential forces carry a force (N) together.

    What the normal ones carry of it is found by secants between logarithms, from a value nearby (N): their share hardly
    changes with it.
    """
    gaps = [_gap(track, _seen(pose, side)) for side in sides]
    load, before = near, (0.0, 0.0)
    for turn in range(30):
        height = _height(track, gaps, load)
        found = [_touching(track, pose, s, g, height) for s, g in zip(sides, gaps, strict=True)]
        drags = iter(drag([p for of in found for p in of]))
        lift = [sum(p.lifted(float(next(drags))) for p in of) for of in found]
        normal = sum(p.lifted(0.0) for of in found for p in of)
        if not sum(lift) > 0 or load > HELD_DOWN * vertical:
            break
        at, left = np.log(load), np.log(load / vertical * sum(lift) / normal)
        if abs(left) <= BALANCED:
            return _Carried(found, lift, load)
        slope = (left - before[1]) / (at - before[0]) if turn else 1.0
        load, before = float(np.exp(at - left / np.clip(slope, 0.2, 5.0))), (at, left)
    steep = max((p for of in found for p in of), key=lambda p: p.normal_force)
    raise UserError(
        f"pose: friction drags the wheel down its flange, {np.rad2deg(abs(steep.angle)):.3g} degrees steep, by as much "
        "as the rail lifts it, so that no height carries the vertical force; give less friction or another yaw"
    )


BALANCED = 1e-8
"""Of the vertical force."""
HELD_DOWN = 1e3
"""Times the vertical force: more is no balance."""


def _height(track: Track, gaps: list[Gap], vertical: float) -> float:
    """z of the axle's middle, below that of the nominal radius, where the normal forces of all patches carry a force
    (N), m."""
    touch = min(float(np.nanmin(g.gap)) for g in gaps)

    @cache  # the search asks for its ends again
    def missing(down: float) -> float:
        lifted = sum(p.force * np.cos(p.angle) for g in gaps for p in _pressed(track, g, touch + down))
        return float(vertical ** (2 / 3) - lifted ** (2 / 3))

    deep = 1e-4
    while missing(deep) > 0:
        deep *= 4
        if deep > 0.05:
            raise UserError("vertical_force: presses the wheel 50 mm into the rail; give it in N")
    return touch + (brentq(missing, 0.0, deep, xtol=1e-16, rtol=1e-10) if missing(0.0) > 0 else 0.0)


def _touching(track: Track, pose: Pose, side: str, gap: Gap, height: float) -> list[RollingPatch]:
    """The most loaded first."""
    found = sorted(_pressed(track, gap, height), key=lambda p: -p.force)
    middle = np.array([pose.lateral, height - track.radius])
    return [_patch(track, _seen(pose, side), gap, p, side == "left", middle) for p in found]


def across(track: Track, pose: Pose, side: str, patch: RollingPatch) -> tuple[Array, Array]:
    """(k,) places across a patch, ascending in its y, and the distances of both surfaces there along its normal, m."""
    left = side == "left"
    gap = _gap(track, _seen(pose, side))
    finite = np.isfinite(gap.gap)
    y_w, arc, opened = gap.on_wheel[finite], np.cumsum(gap.arc[finite]), gap.gap[finite]
    place = arc - np.interp(patch.on_wheel, y_w, arc)
    apart = (opened - np.interp(patch.on_wheel, y_w, opened)) * np.cos(patch.angle)
    return (place, apart) if left else (-place[::-1], apart[::-1])


class Gap(NamedTuple):
    """Above the rail, over the wheel's profile, (k,). Attributes: on_wheel: y of the profile; x, y, z: of the point of
    its circle that comes nearest to the rail, m, the axle's middle as high as the nominal radius; gap: vertical, m;
    radius: m; slope: of the gap along the surface, beyond the rail that at its end; arc, step: from point to point,
    along the surface and in y, m."""

    on_wheel: Array
    x: Array
    y: Array
    z: Array
    gap: Array
    radius: Array
    slope: Array
    arc: Array
    step: Array


def _gap(track: Track, pose: Pose) -> Gap:
    """Of the right wheel: the normal of its surface has no component along the rail at the nearest point."""
    y_w = np.arange(track.wheel.y[0], track.wheel.y[-1], STEP)
    r, slope = track.radius + track.wheel.height(y_w), track.wheel.slope(y_w)
    c, s, t = np.cos(pose.roll), np.sin(pose.roll), np.tan(pose.yaw)
    turn = np.zeros_like(r)
    for _ in range(20):  # of 0.1 rad at the most each
        before, turn = turn, np.arcsin(np.clip(-t * (slope * c + np.cos(turn) * s), -1, 1))
        if np.nanmax(np.abs(turn - before)) < 1e-12:
            break
    along, across, down = r * np.sin(turn), track.wheel_at + y_w, r * np.cos(turn)
    across, down = across * c - down * s, across * s + down * c
    x = along * np.cos(pose.yaw) - across * np.sin(pose.yaw)
    y = pose.lateral + along * np.sin(pose.yaw) + across * np.cos(pose.yaw)
    z = down - track.radius
    gap = track.rail.height(y - track.rail_at) - z
    if not np.isfinite(gap).any():
        raise UserError(
            f"wheel, rail: the profiles do not overlap: the wheel reaches from {y.min():.4g} to {y.max():.4g} m from "
            f"the track's middle, the rail from {track.rail_at + track.rail.y[0]:.4g} to "
            f"{track.rail_at + track.rail.y[-1]:.4g} m; correct the positions (at, pose.lateral)"
        )
    incline = np.arctan(np.gradient(z, y))
    step = np.gradient(y)
    arc = step / np.cos(incline)
    slope = np.gradient(gap) * np.cos(incline) / arc
    finite = np.flatnonzero(np.isfinite(slope))
    return Gap(y_w, x, y, z, gap, r, np.interp(np.arange(len(slope)), finite, slope[finite]), arc, step)


class Pressed(NamedTuple):
    """A stretch of the wheel that the undeformed rail would reach into. Attributes: at: index of its middle, not whole.
    angle: rad. A, B: 1/m, B not positive if the bodies conform. force: normal, N. a, b, approach: m. pressure: Pa."""

    at: float
    angle: float
    A: float
    B: float
    force: float
    a: float
    b: float
    approach: float
    pressure: float


def _pressed(track: Track, gap: Gap, height: float) -> list[Pressed]:
    """Stretches of the wheel, lowered by a height (m) from where its axle is as high as the nominal radius."""
    open_ = np.nan_to_num(gap.gap, nan=np.inf)
    below = np.flatnonzero(open_ < height)
    runs = np.split(below, np.flatnonzero(np.diff(below) > 1) + 1)
    return [_stretch(track, gap, run, height) for run in runs if len(run)]


def _stretch(track: Track, gap: Gap, run: Array, level: float) -> Pressed:
    """Hertz' contact of a stretch: its curvature across is the mean over the patch (6.4-3), half the change of the
    slope of the gap from one edge to the other. The middle of the patch is the centre of the squared penetration (over
    x too, hence 2.5)."""
    _, least = _summit(gap.gap, int(run[np.argmin(gap.gap[run])]))
    weight = (level - gap.gap[run]) ** 2.5 * gap.step[run]
    at = float(np.sum(weight * run) / np.sum(weight))
    y = float(np.interp(at, np.arange(len(gap.y)), gap.y))
    angle = float(np.arctan(track.rail.slope(y - track.rail_at)))
    cosine = np.cos(angle)
    approach = (level - least) * cosine
    A = cosine / (2 * float(np.interp(at, np.arange(len(gap.y)), gap.radius)))

    B = float(_curvature(gap, at, _half_width(gap, at, A, approach)))
    unit = ellipses(A, max(B, CONFORMAL * A), 1.0, track.elastic.modulus)
    grown = float(approach / unit.approach)
    axes = float(unit.a) * grown**0.5, float(unit.b) * grown**0.5
    return Pressed(at, angle, A, B, grown**1.5, *axes, approach, float(unit.pressure) * grown**0.5)


def _half_width(gap: Gap, at: float, A: float, approach: float) -> float:
    """b that the mean curvature over +-b makes, m: the smallest one, which grows from 0 without jumps."""

    def wider(b: ArrayLike) -> Array:
        return half_width(A, np.maximum(_curvature(gap, at, b), CONFORMAL * A), approach) - b

    tried = np.append(0.0, np.geomspace(0.005, 1.01, 30)) * float(half_width(A, np.array(CONFORMAL * A), approach))
    first = 2 + int(np.argmax(wider(tried[2:]) <= 0))
    least, number = tried[first - 1], cache(wider)
    return brentq(number, least, tried[first], xtol=1e-9) if number(least) > 0 else least


def _summit(gap: Array, i: int) -> tuple[float, float]:
    """Index and value of the least gap, by the parabola through three points."""
    if not 0 < i < len(gap) - 1 or not np.isfinite(gap[i - 1 : i + 2]).all():
        raise UserError(
            "wheel, rail: they touch where a profile ends, so that its shape is not known there; give a wider profile, "
            "or correct radii and positions (at, pose.lateral)"
        )
    low, middle, high = gap[i - 1 : i + 2]
    bend, lean = low - 2 * middle + high, 0.5 * (high - low)
    shift = -lean / bend if bend > 0 else 0.0
    return i + float(shift), float(middle + 0.5 * lean * shift)


def _curvature(gap: Gap, at: float, half: ArrayLike) -> Array:
    """Half the mean second derivative of the gap over +-half (m) about an index."""
    place = np.clip(at + np.multiply.outer([-1, 1], half) / gap.arc[round(at)], 0, len(gap.slope) - 1.001)
    i = place.astype(int)
    ends = gap.slope[i] + (place - i) * (gap.slope[i + 1] - gap.slope[i])
    return (ends[1] - ends[0]) / (4 * np.asarray(half))


def creepages(
    speed: Any, turning: Any, radius: Any, along: Any, yaw: Any, roll: Any, angle: Any, xp: Any = np
) -> tuple[Any, Any, Any, Any]:
    """Creepages xi, eta and spin phi (1/m) of a wheel on its rail, and the speed of rolling, m/s, axes of
    `RollingPatch`.

    The rigid velocity of the point of the wheel's surface that touches, speed x + w x r, where the axle turns by
    w = -turning (-cos(roll) sin(yaw), cos(roll) cos(yaw), sin(roll)), along the rail and along its surface across it.
    On a steep flange the contact lies well ahead of the axle, and goes down there as the wheel turns.

    Args:
        speed: m/s, forward. turning: of the axle, rad/s. radius: of the wheel there, m. along: of the contact ahead of
            the axle, in axes that yaw with it, m. yaw, roll: rad. angle: of the rail's surface, rad. xp: numpy or jax.
    """
    c, s = xp.cos(angle), xp.sin(angle)
    down, lifted = xp.sqrt(radius**2 - along**2), xp.sin(roll) * along
    back = turning * (down * xp.cos(yaw) - lifted * xp.sin(yaw))
    left = turning * (down * xp.sin(yaw) + lifted * xp.cos(yaw))
    fall = turning * xp.cos(roll) * along
    V = 0.5 * (speed + back)
    spun = turning * (xp.cos(roll) * xp.cos(yaw) * s - xp.sin(roll) * c)
    return (speed - back) / V, (c * left - s * fall) / V, -spun / V, V


def _patch(track: Track, pose: Pose, gap: Gap, p: Pressed, left: bool, axle: Array) -> RollingPatch:
    """With its creepages, in the axes of `RollingPatch`; mirrored back if it is of the left wheel."""
    index = np.arange(len(gap.y))
    y_w, x, y = (float(np.interp(p.at, index, v)) for v in (gap.on_wheel, gap.x, gap.y))
    z = float(track.rail.height(y - track.rail_at))
    turning = pose.speed / track.radius if pose.turning is None else pose.turning
    r = track.radius + float(track.wheel.height(y_w))
    along = x * np.cos(pose.yaw) + (y - pose.lateral) * np.sin(pose.yaw)
    xi, eta, phi, V = map(float, creepages(pose.speed, turning, r, along, pose.yaw, pose.roll, p.angle))
    sign = -1.0 if left else 1.0
    place = np.array([x, sign * y, z])
    conformal = p.B < CONFORMAL * p.A or p.b > track.radius * 0.1 or p.b * 2 * max(p.B, 0) > 0.3
    return RollingPatch(
        place,
        y - track.rail_at,
        y_w,
        sign * p.angle,
        p.A,
        p.B,
        p.a,
        p.b,
        p.approach,
        p.pressure,
        p.force,
        xi,
        sign * eta,
        sign * phi,
        V,
        bool(conformal),
        axle,
    )


CONFORMAL = 0.01
"""Of the half curvature along rolling: bodies that are closer to each other across do not touch in a point."""

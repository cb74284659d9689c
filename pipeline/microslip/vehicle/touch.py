"""Where a wheelset that stands on its rails touches them, over its lateral displacement, for motions in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ..errors import UserError
from ..programs import program
from ..rolling.wheelset import Pose, RollingPatch, Side, Track, patches

Array = Any
"""Of numpy; of jax in what is traced."""


class WheelTouch(NamedTuple):
    """Of both wheels, right first, arrays (2, ...) over the displacement or at one of it; axes of `rolling.wheelset`.

    Attributes:
        height: z at which the wheelset touches without load, both wheels alike, m; at their nominal height it is 0.
        roll: rad, that makes it so. arm: dz of a wheel per roll, m. slope: tan of the rail's angle, positive where it
            falls to the right. across: y of the contact from the middle of the axle, m. radius: there, from the axle,
            m. on_wheel: y of the wheel's profile, m. a, b: half axes under `load`, m. spring: of vertical force over
            approach, N/m^1.5.
    """

    height: Array
    roll: Array
    arm: Array
    slope: Array
    across: Array
    radius: Array
    on_wheel: Array
    a: Array
    b: Array
    spring: Array


@dataclass(frozen=True, eq=False)
class Touching:
    """Attributes: reach: largest displacement, m. load: vertical, on each wheel, N, of `WheelTouch.a` and `.b`.
    over: a `WheelTouch` of (2, n) arrays, on n equal steps from -reach to reach. jumps: largest move of a contact over
    the wheel within a step, m."""

    reach: float
    load: float
    over: WheelTouch

    @property
    def jumps(self) -> float:
        return float(np.abs(np.diff(self.over.on_wheel, axis=1)).max())


def touching(track: Track, load: float, reach: float, points: int = 33) -> Touching:
    """Quasi-static: at each displacement the wheelset rolls until both wheels press equally.

    Args:
        load: vertical, on each wheel, N. reach: m.

    Raises:
        UserError: a wheel that leaves the profile of its rail within the reach; in two patches under half the load.
    """
    y = np.linspace(-reach, reach, points)
    half = []
    for v in y[points // 2 :]:
        try:
            half.append(_standing(track, load, v))
        except UserError as error:
            less = "" if error.key == "running.reach" else "; or take a smaller running.reach"
            raise UserError(f"at {1e3 * v:.3g} mm of lateral displacement: {error}{less}") from error
    # what the right wheel has at y the left one has at -y, mirrored
    right = [_mirrored(one[1]) for one in half[:0:-1]] + [one[0] for one in half]
    left = [_mirrored(one) for one in right[::-1]]
    return Touching(reach, load, WheelTouch(*map(np.array, zip(*map(np.transpose, (right, left)), strict=True))))


def _mirrored(one: tuple[float, ...]) -> tuple[float, ...]:
    t = WheelTouch(*one)
    return tuple(t._replace(roll=-t.roll, arm=-t.arm, slope=-t.slope, across=-t.across))


def _standing(track: Track, load: float, y: float) -> list[tuple[float, ...]]:
    """A `WheelTouch` of numbers of each wheel, at one displacement."""
    roll = 0.0
    for _ in range(6):
        patches_of = [_one(track, load, y, roll, "right"), _one(track, load, y, roll, "left")]
        (right, _), (left, _) = patches_of
        change = (right.axle[1] - left.axle[1]) / (right.place[1] - left.place[1])
        roll += change
        if abs(change) < 1e-9:
            break
    return [_touch(track, p, roll, y) for p, _ in patches_of]


def _one(track: Track, load: float, y: float, roll: float, side: Side) -> tuple[RollingPatch, str]:
    contacts = patches(track, Pose(y, 0.0, roll), side, load)
    if len(contacts) > 1 and contacts[1].normal_force > 0.5 * contacts[0].normal_force:
        raise UserError(
            f"at {1e3 * y:.3g} mm the {side} wheel runs on two patches at once; a motion in time "
            "knows one, so take less",
            "running.reach",
        )
    return contacts[0], side


def _touch(track: Track, p: RollingPatch, roll: float, y: float) -> tuple[float, ...]:
    slope, c = float(np.tan(p.angle)), float(np.cos(p.angle))
    across, radius = float(p.place[1]) - y, track.radius + float(track.wheel.height(p.on_wheel))
    height = float(p.axle[1]) + track.radius - p.approach / c
    spring = p.normal_force * c / (p.approach / c) ** 1.5
    return tuple(WheelTouch(height, roll, across + radius * slope, slope, across, radius, p.on_wheel, p.a, p.b, spring))


def at(over: WheelTouch, reach: float, y: Array) -> WheelTouch:
    """By cubics through four neighbours (Catmull-Rom), one continuous derivative: pure, (2,) of each."""
    n = over.a.shape[1]
    place = jnp.clip((y / reach + 1) * 0.5 * (n - 1), 1.0, n - 2.0)
    i = jnp.clip(jnp.floor(place).astype(int), 1, n - 3)
    t = place - i
    weights = jnp.stack([
        ((2 - t) * t - 1) * t, (3 * t - 5) * t * t + 2, ((4 - 3 * t) * t + 1) * t, (t - 1) * t * t
    ])  # fmt: skip
    return WheelTouch(*(0.5 * jnp.asarray(v)[:, i + jnp.arange(-1, 3)] @ weights for v in over))


touched = program(at)
"""`at`, compiled."""

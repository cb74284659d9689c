"""Wheels that wear as they turn: what a turn takes off, what a contact sees of it, jumps over many turns (Sextro, 6.9).

Places are equal angles of a wheel from its mark on; fields over the tread have shape (wheels, places, strips).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..data import Array, UserError
from ..rolling.strips import creep_forces, tractions
from ..rolling.wear import deposited, smoothed
from .motion import LEAST, Contacts, Q, Turn, Vehicle, resampled, steady, steps_of_a_turn, turned
from .touch import Touch, at

STRIP = 2.5e-4
"""m, width of a strip of the tread."""


@dataclass(frozen=True, eq=False)
class Tread:
    """Attributes: y: (n,) middles of strips on the wheel's profile, m. way: from place to place over the wheel, m.
    coefficient: worn volume over frictional work, m3/J. how: as `strips.creep_forces`. sides: of the wheels, 1 right,
    -1 left."""

    y: Array
    way: float
    coefficient: float
    how: dict[str, Any]
    sides: tuple[int, ...] = (1, -1)

    def taken(self, on: Contacts, friction: float, shear: float, poisson: float) -> Array:
        """(wheels, places, n) m that passing each place once takes off (6.8-6); on: (places, wheels)."""
        t = tractions(*_flat(on), friction, shear, poisson, **self.how)
        width = t.area[..., 0] / (t.x[..., 1] - t.x[..., 0])
        depth = self.coefficient * (t.power * t.area).sum(axis=-1) / width
        middle = np.asarray(on.on_wheel).T.ravel()
        loaded = np.asarray(on.vertical).T.ravel() > 0
        outward = np.repeat(
            [-s for s in self.sides], on.xi.shape[0]
        )  # the strips' y runs to the left, the profile's to the field side
        found = [
            deposited(d[::s], w[::s], m, self.y) if touches else np.zeros_like(self.y)
            for d, w, m, s, touches in zip(depth, width, middle, outward, loaded, strict=True)
        ]
        return np.reshape(found, (len(self.sides), -1, len(self.y)))

    def work(self, on: Contacts, friction: float, shear: float, poisson: float) -> Array:
        """(wheels,) J of friction in a turn, from the forces."""
        power = creep_forces(*_flat(on), friction, shear, poisson, **self.how).power
        return np.asarray(
            (power * (np.asarray(on.vertical).T.ravel() > 0)).reshape(len(self.sides), -1).sum(axis=1) * self.way
        )

    def volume(self, depth: Array) -> Array:
        """(wheels,) m3."""
        return np.asarray(depth.sum(axis=(1, 2)) * (self.y[1] - self.y[0]) * self.way)

    def seen(self, depth: Array, on: Contacts) -> Array:
        """(places, wheels) m by which the radius is less where the contact runs: the mean weighted by its pressure.

        To first order that is how much further off the bodies are; the pressure is that of a mean place, before wear.
        """
        middle, b = (np.asarray(v).mean(axis=0)[:, None] for v in (on.on_wheel, on.b))
        weight = np.maximum(1 - ((self.y - middle) / b) ** 2, 0)
        return np.asarray(np.einsum("wy,wpy->pw", weight / weight.sum(axis=1, keepdims=True), depth))


def spread(middle: Array, half: float) -> Array:
    """(n,) middles of strips wherever contacts about these places (m), of a half width of `half` (m), can run."""
    return np.arange(middle.min() - half - STRIP, middle.max() + half + 2 * STRIP, STRIP)


def _flat(on: Contacts) -> tuple[Array, Array, Array, Array, Array, Array]:
    """States of rolling, the places of one wheel after those of the other."""
    xi, eta, phi, a, b, force = (np.asarray(v).T.ravel() for v in on[:6])
    return xi, eta, phi, a, b, force


def filtered(shape: Array, half: float, radius: float) -> Array:
    """(places, wheels) of radii as a contact of half length `half` (m) sees them: means weighted by its pressure."""
    u = np.maximum(np.arange(len(shape) // 2 + 1) * half / radius, 1e-3)
    share = 3 * (np.sin(u) - u * np.cos(u)) / u**3
    return np.fft.irfft(share[:, None] * np.fft.rfft(shape, axis=0), len(shape), axis=0)


class LeavesTheRail(Exception):
    """A motion that goes no further; its text is a sentence."""


SMOOTHING = 2 * STRIP
"""m, standard deviation by which the worn profile is smoothed for where it touches: with half axes of some mm the waves
of the strips then die out in jumps of up to 40 um, see `rolling.wear.shortest_smoothing`."""
SETTLED = np.array([1e-9] * Q + [1e-6] * Q + [1e-6])
"""By which states of one turn and the next may differ: m and rad, m/s and rad/s."""
TURNS = 40
"""Newton's steps towards a motion that comes back after each turn."""


@dataclass(frozen=True, eq=False)
class Rolling:
    """A vehicle on wheels that are out of round.

    Attributes:
        vehicle, creep, tread. shape: (places, 2) deviation of new radii, right wheel first, m. steps: of a turn.
        profile: depth (n,) m on the strips of the tread -> where wheels of such a profile touch; None: as new ones.
    """

    vehicle: Vehicle
    creep: Any
    tread: Tread
    shape: Array
    steps: int
    profile: Callable[[Array], Touch] | None = None

    @staticmethod
    def of(
        vehicle: Vehicle, creep: Any, tread: Tread, shape: Array, profile: Callable[[Array], Touch] | None = None
    ) -> Rolling:
        return Rolling(vehicle, creep, tread, shape, steps_of_a_turn(vehicle, len(shape)), profile)

    def renewed(self, depth: Array) -> Rolling:
        """With the profile across that both wheels have in the mean over their circumference.

        Raises:
            LeavesTheRail: a groove that is deeper than `deepest`; such wheels do not stay on their rails.
        """
        if self.profile is None or not depth.any():
            return self
        mean = groove(depth)
        if (most := deepest(self.vehicle)) < mean.max():
            raise LeavesTheRail(f"a groove of more than {1e3 * most:.2g} mm splits the contact")
        try:
            over = self.profile(mean)
        except UserError as error:
            raise LeavesTheRail(f"where the worn wheels touch is not known any more ({error})") from error
        return replace(self, vehicle=self.vehicle._replace(over=over))

    def turn(self, x: Array, radius: Array) -> Turn:
        """One turn from a state, on wheels of such radii (places, 2)."""
        out, rise = resampled(radius, 2 * self.steps)
        return turned(self.vehicle, self.creep, x, out, rise, self.steps // len(radius))

    def periodic(self, x: Array, radius: Array, map_: Array | None) -> tuple[Turn, Array, Array | None]:
        """The motion that comes back after a turn: that turn, its first state, and the derivative of the turn's end.

        Raises:
            LeavesTheRail: none is found, or a wheel is off its rail on the way.
        """
        one = self.turn(x, radius)
        for _ in range(TURNS):
            left = np.asarray(one.end) - x
            off = np.abs(left / SETTLED).max()
            if off < 1:
                _stays_on(one, self.vehicle)
                return one, x, map_
            if map_ is None:
                map_ = self._derivative(x, radius, np.asarray(one.end))
            before, x = x, x - np.linalg.solve(map_ - np.eye(len(x)), left)
            one = self.turn(x, radius)
            if not np.isfinite(one.end).all():
                break
            if np.abs((np.asarray(one.end) - x) / SETTLED).max() > 0.3 * off:  # the derivative is of elsewhere
                map_ = None if np.abs(x - before).max() > 0 else map_
        raise LeavesTheRail("no running that comes back after each turn was found: the wheelset hunts or derails")

    def _derivative(self, x: Array, radius: Array, end: Array) -> Array:
        columns = []
        for i, small in enumerate(1e3 * SETTLED):
            moved = x.copy()
            moved[i] += small
            columns.append((np.asarray(self.turn(moved, radius).end) - end) / small)
        return np.array(columns).T


def groove(depth: Array) -> Array:
    """(n,) m across, of depths (wheels, places, n), as `Rolling.renewed` has it."""
    return smoothed(depth.mean(axis=(0, 1)), STRIP, SMOOTHING)


def deepest(v: Vehicle) -> float:
    """m, of a groove that fills the gap which new wheels have at the edge of their contact: half of the approach (of a
    circle, Hertz). Deeper ones turn the curvature in the middle, and the contact splits."""
    return 0.5 * float((v.each / at(v.over, v.reach, 0.0).spring[0]) ** (2 / 3))


def _stays_on(one: Turn, v: Vehicle) -> None:
    off = np.asarray(one.on.vertical) <= LEAST * v.each
    for k, side in enumerate(("right", "left")):
        if off[:, k].any():
            at = 360 * int(np.argmax(off[:, k])) / len(off)
            raise LeavesTheRail(f"the {side} wheel leaves its rail {at:.0f} degrees after its mark")
    far = float(np.abs(np.asarray(one.states)[:, 0]).max())
    if not far < v.reach:
        raise LeavesTheRail(f"the wheelset moves {1e3 * far:.3g} mm to a side, beyond running.reach: it derails")


@dataclass(frozen=True, eq=False)
class Now:
    """Running at one amount of wear. Attributes: turns: so far. depth: (2, places, n) m. radius: (places, 2) deviation
    that the contacts see, m. one: a turn. taken: (2, places, n) m in it. start, map_: for the next one."""

    turns: float
    depth: Array
    radius: Array
    one: Turn
    taken: Array
    start: Array
    map_: Array | None


def running(r: Rolling, depth: Array, turns: float, near: Now | None = None) -> Now:
    """Periodic motion on worn wheels.

    Raises:
        LeavesTheRail: see `Rolling.periodic`.
    """
    r = r.renewed(depth)
    v = r.vehicle
    x, map_ = (steady(v), None) if near is None else (near.start, near.map_)
    on = r.turn(x, np.zeros_like(r.shape)).on if near is None else near.one.on
    half = float(np.mean(np.asarray(on.a)))
    told = 0.0 if r.profile is None else depth.mean(axis=(0, 1))  # by the profile already
    radius = filtered(r.shape - r.tread.seen(depth - told, on), half, float(v.over.radius.mean()))
    one, x, map_ = r.periodic(x, radius, map_)
    taken = r.tread.taken(one.on, v.friction, v.shear, v.poisson)
    return Now(turns, depth, radius, one, taken, x, map_)


@dataclass(frozen=True)
class Jump:
    """Attributes: turns: at its end. size: turns. error: of the seen radius against a first-order jump, m. volume: (2,)
    worn of each wheel, m3. work: (2,) of friction, J."""

    turns: float
    size: float
    error: float
    volume: Array
    work: Array


def jumps(
    r: Rolling, turns: float, tolerance: float, first: float, fixed: bool = False,
    known: Sequence[tuple[Now, Jump]] = (),
) -> Iterator[tuple[Now, Jump]]:  # fmt: skip
    """Wear over many turns by jumps of second order (Heun); a jump is as long as its error allows.

    Args:
        turns: in all. tolerance: of a jump, m of radius. first: size of the first, turns. fixed: all are as long.
            known: what was yielded before, with which it goes on.

    Raises:
        LeavesTheRail: see `running`; what came before was yielded.
    """
    v, t = r.vehicle, r.tread
    places, n = len(r.shape), len(t.y)
    if known:
        now, jump = known[-1]
    else:
        now, jump = running(r, np.zeros((2, places, n)), 0.0), Jump(0.0, 0.0, 0.0, np.zeros(2), np.zeros(2))
        yield now, jump
    size = min(first, turns) if fixed or not jump.size else _next(jump, tolerance)
    while now.turns < turns * (1 - 1e-12):
        size = min(size, turns - now.turns)
        then = running(r, now.depth + size * now.taken, now.turns + size, now)
        mean = 0.5 * (now.taken + then.taken)
        error = float(np.abs(t.seen(0.5 * size * (then.taken - now.taken), now.one.on)).max())
        if error > tolerance and not fixed:
            size *= max(0.2, 0.9 * (tolerance / error) ** 0.5)
            continue
        work = [size * 0.5 * t.work(one.on, v.friction, v.shear, v.poisson) for one in (now.one, then.one)]
        now = running(r, now.depth + size * mean, now.turns + size, then)
        jump = Jump(now.turns, size, error, t.volume(size * mean), work[0] + work[1])
        yield now, jump
        if not fixed:
            size = _next(jump, tolerance)


def _next(jump: Jump, tolerance: float) -> float:
    """Turns of the jump after one."""
    return jump.size * min(3.0, 0.9 * (tolerance / max(jump.error, 1e-3 * tolerance)) ** 0.5)


def point_of(now: Now, jump: Jump) -> dict[str, Any]:
    """Names -> arrays of running and the jump to it, for a journal."""
    point = {f"jump/{k}": v for k, v in vars(jump).items()}
    point |= {f"on/{k}": v for k, v in now.one.on._asdict().items()}
    point |= {f"one/{k}": v for k, v in now.one._asdict().items() if k != "on"}
    return point | {k: v for k, v in vars(now).items() if k != "one" and v is not None}


def of_point(point: Mapping[str, Any]) -> tuple[Now, Jump]:
    """What `point_of` took apart, to the last bit."""

    def part(name: str) -> dict[str, Any]:
        return {k.removeprefix(name): v for k, v in point.items() if k.startswith(name)}

    own = {k: v for k, v in point.items() if "/" not in k}
    one = Turn(on=Contacts(**part("on/")), **part("one/"))
    return Now(one=one, **{"map_": None, **own}), Jump(**part("jump/"))


def growth(r: Rolling, orders: Array, amplitude: float, wheel: int) -> Array:
    """(orders,) share by which the amplitude of each order of a wheel grows per turn, all together as small waves and
    the same with the opposite sign, so that what goes with their square drops out.

    Raises:
        LeavesTheRail: see `running`.
    """
    angle = 2 * np.pi * np.arange(len(r.shape)) / len(r.shape)
    phases = np.pi * orders * (orders - 1) / max(len(orders), 1)  # no high crest where all meet
    shape = np.zeros_like(r.shape)
    shape[:, wheel] = (amplitude * np.cos(np.outer(angle, orders) + phases)).sum(axis=1)
    near = running(replace(r, shape=np.zeros_like(shape)), np.zeros((2, len(shape), len(r.tread.y))), 0.0)
    up, down = (running(replace(r, shape=s * shape), near.depth, 0.0, near) for s in (1, -1))
    worn = r.tread.seen(0.5 * (up.taken - down.taken), near.one.on)[:, wheel]
    return -np.real(np.fft.rfft(worn)[orders] / np.fft.rfft(shape[:, wheel])[orders])


def orders_of(radius: Array, most: int) -> Array:
    """(most, wheels) amplitudes of the orders 1, 2, ... of radii (places, wheels), m."""
    return 2 * np.abs(np.fft.rfft(radius, axis=0))[1 : most + 1] / len(radius)


def tread(v: Vehicle, places: int, coefficient: float, how: dict[str, Any]) -> Tread:
    """Strips wherever a contact can run."""
    y = spread(np.asarray(v.over.on_wheel), 2 * float(v.over.b.max()))
    return Tread(y, 2 * np.pi * float(v.over.radius.mean()) / places, coefficient, how)

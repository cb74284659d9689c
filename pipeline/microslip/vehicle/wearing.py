"""Wheels that wear as they turn: what a turn takes off, what a contact sees of it, jumps over many turns (Sextro, 6.9).

Places are equal angles of a wheel from its mark on; fields over the tread have shape (wheels, places, strips).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeVar

import numpy as np

from ..data import Array
from ..errors import UserError
from ..interrupts import look
from ..progress import Report
from ..results import Journal
from ..rolling.strips import creep_forces, tractions
from ..rolling.wear import deposited, smoothed, strip_work
from .motion import LEAST, Q, Vehicle, WheelContacts, WheelTurn, resampled, steady, steps_of_a_turn, turned
from .touch import WheelTouch, touched

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

    def taken(self, on: WheelContacts, friction: float, shear: float, poisson: float) -> Array:
        """(wheels, places, n) m that passing each place once takes off (6.8-6); on: (places, wheels)."""
        t = tractions(*_flat(on), friction, shear, poisson, **self.how)
        width, work = strip_work(t)
        middle = np.asarray(on.on_wheel).T.ravel()
        loaded = np.asarray(on.vertical).T.ravel() > 0
        outward = np.repeat(
            [-s for s in self.sides], on.xi.shape[0]
        )  # the strips' y runs to the left, the profile's to the field side
        depths = [
            deposited(d[::s], w[::s], m, self.y) if touches else np.zeros_like(self.y)
            for d, w, m, s, touches in zip(self.coefficient * work, width, middle, outward, loaded, strict=True)
        ]
        return np.reshape(depths, (len(self.sides), -1, len(self.y)))

    def work(self, on: WheelContacts, friction: float, shear: float, poisson: float) -> Array:
        """(wheels,) J of friction in a turn, from the forces."""
        power = creep_forces(*_flat(on), friction, shear, poisson, **self.how).power
        return np.asarray(
            (power * (np.asarray(on.vertical).T.ravel() > 0)).reshape(len(self.sides), -1).sum(axis=1) * self.way
        )

    def volume(self, depth: Array) -> Array:
        """(wheels,) m3."""
        return np.asarray(depth.sum(axis=(1, 2)) * (self.y[1] - self.y[0]) * self.way)

    def seen(self, depth: Array, on: WheelContacts) -> Array:
        """(places, wheels) m by which the radius is less where the contact runs: the mean weighted by its pressure.

        To first order that is how much further off the bodies are; the pressure is that of a mean place, before wear.
        """
        middle, b = (np.asarray(v).mean(axis=0)[:, None] for v in (on.on_wheel, on.b))
        weight = np.maximum(1 - ((self.y - middle) / b) ** 2, 0)
        return np.asarray(np.einsum("wy,wpy->pw", weight / weight.sum(axis=1, keepdims=True), depth))


def spread(middle: Array, half: float) -> Array:
    """(n,) middles of strips wherever contacts about these places (m), of a half width of `half` (m), can run."""
    return np.arange(middle.min() - half - STRIP, middle.max() + half + 2 * STRIP, STRIP)


def _flat(on: WheelContacts) -> tuple[Array, Array, Array, Array, Array, Array]:
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
of the strips then die out in jumps of up to 40 µm, see `rolling.wear.shortest_smoothing`."""
SETTLED = np.array([1e-9] * Q + [1e-6] * Q + [1e-6])
"""By which states of one turn and the next may differ: m and rad, m/s and rad/s."""
TURNS = 40
"""Newton's steps towards a motion that comes back after each turn."""


@dataclass(frozen=True, eq=False)
class WearState:
    """What wears. Attributes: turns: so far. depth: (wheels, places, n) m. taken: in one turn, m."""

    turns: float
    depth: Array
    taken: Array

    def point(self) -> dict[str, Any]:
        """Names -> arrays, for a journal."""
        return vars(self)


@dataclass(frozen=True, eq=False)
class Running(WearState):
    """Running at one amount of wear. Attributes: radius: (places, 2) deviation that the contacts see, m. one: a turn.
    start, map_: for the next one."""

    radius: Array
    one: WheelTurn
    start: Array
    map_: Array | None

    def point(self) -> dict[str, Any]:
        """Names -> arrays, for a journal."""
        point = {f"on/{k}": v for k, v in self.one.on._asdict().items()}
        point |= {f"one/{k}": v for k, v in self.one._asdict().items() if k != "on"}
        return point | {k: v for k, v in vars(self).items() if k != "one" and v is not None}

    @staticmethod
    def of(point: Mapping[str, Any]) -> Running:
        """What `point` took apart, to the last bit."""
        own = {k: v for k, v in point.items() if "/" not in k}
        one = WheelTurn(on=WheelContacts(**part(point, "on/")), **part(point, "one/"))
        return Running(one=one, **{"map_": None, **own})


@dataclass(frozen=True, eq=False)
class RunningVehicle:
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
    profile: Callable[[Array], WheelTouch] | None = None

    @staticmethod
    def of(
        vehicle: Vehicle, creep: Any, tread: Tread, shape: Array, profile: Callable[[Array], WheelTouch] | None = None
    ) -> RunningVehicle:
        return RunningVehicle(vehicle, creep, tread, shape, steps_of_a_turn(vehicle, len(shape)), profile)

    def renewed(self, depth: Array) -> RunningVehicle:
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

    def new(self) -> Array:
        """(2, places, n) m of new wheels."""
        return np.zeros((2, len(self.shape), len(self.tread.y)))

    def at(self, depth: Array, turns: float, near: Running | None = None) -> Running:
        """Periodic motion on worn wheels.

        Raises:
            LeavesTheRail: see `periodic` and `renewed`.
        """
        r = self.renewed(depth)
        v = r.vehicle
        x, map_ = (steady(v), None) if near is None else (near.start, near.map_)
        on = r.turn(x, np.zeros_like(r.shape)).on if near is None else near.one.on
        half = float(np.mean(np.asarray(on.a)))
        told = 0.0 if r.profile is None else depth.mean(axis=(0, 1))  # by the profile already
        radius = filtered(r.shape - r.tread.seen(depth - told, on), half, float(v.over.radius.mean()))
        one, x, map_ = r.periodic(x, radius, map_)
        taken = r.tread.taken(one.on, v.friction, v.shear, v.poisson)
        return Running(turns, depth, taken, radius, one, x, map_)

    def seen(self, depth: Array, now: Running) -> Array:
        """(places, 2) m that a running sees of it."""
        return self.tread.seen(depth, now.one.on)

    def work(self, now: Running) -> Array:
        """(2,) J of friction in a turn."""
        v = self.vehicle
        return self.tread.work(now.one.on, v.friction, v.shear, v.poisson)

    def turn(self, x: Array, radius: Array) -> WheelTurn:
        """One turn from a state, on wheels of such radii (places, 2)."""
        out, rise = resampled(radius, 2 * self.steps)
        return turned(self.vehicle, self.creep, x, out, rise, self.steps // len(radius))

    def periodic(self, x: Array, radius: Array, map_: Array | None) -> tuple[WheelTurn, Array, Array | None]:
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
    """(n,) m across, of depths (wheels, places, n), as `RunningVehicle.renewed` has it."""
    return smoothed(depth.mean(axis=(0, 1)), STRIP, SMOOTHING)


def deepest(v: Vehicle) -> float:
    """m, of a groove that fills the gap which new wheels have at the edge of their contact: half of the approach (of a
    circle, Hertz). Deeper ones turn the curvature in the middle, and the contact splits."""
    return 0.5 * (v.each / float(np.asarray(touched(v.over, v.reach, 0.0).spring)[0])) ** (2 / 3)


def _stays_on(one: WheelTurn, v: Vehicle) -> None:
    off = np.asarray(one.on.vertical) <= LEAST * v.each
    for k, side in enumerate(("right", "left")):
        if off[:, k].any():
            at = 360 * int(np.argmax(off[:, k])) / len(off)
            raise LeavesTheRail(f"the {side} wheel leaves its rail {at:.0f} degrees after its mark")
    far = float(np.abs(np.asarray(one.states)[:, 0]).max())
    if not far < v.reach:
        raise LeavesTheRail(f"the wheelset moves {1e3 * far:.3g} mm to a side, beyond running.reach: it derails")


@dataclass(frozen=True)
class Jump:
    """Attributes: turns: at its end. size: turns. error: of the seen radius against a first-order jump, m. volume:
    (wheels,) worn of each, m3. work: (wheels,) of friction, J. waves: (orders, wheels) of that error's orders, m."""

    turns: float
    size: float
    error: float
    volume: Array
    work: Array
    waves: Array


S = TypeVar("S", bound=WearState)


class Wears(Protocol[S]):
    """What jumps go over: `at` an amount of wear it has a state; `seen` is depth as that state's contacts see it (m),
    `work` of friction in a turn (J). `at` may raise `LeavesTheRail`."""

    @property
    def tread(self) -> Tread: ...
    def new(self) -> Array: ...
    def at(self, depth: Array, turns: float, near: S | None = None) -> S: ...
    def seen(self, depth: Array, now: S) -> Array: ...
    def work(self, now: S) -> Array: ...


def jumps(
    r: Wears[S], turns: float, tolerance: float, first: float, fixed: bool = False,
    known: Sequence[tuple[S, Jump]] = (),
) -> Iterator[tuple[S, Jump]]:  # fmt: skip
    """Wear over many turns by jumps of second order (Heun); a jump is as long as its error allows.

    Args:
        turns: in all. tolerance: of a jump, m of radius. first: size of the first, turns. fixed: all are as long.
            known: what was yielded before, with which it goes on.

    Raises:
        LeavesTheRail: see `Wears`; what came before was yielded.
    """
    t = r.tread
    if known:
        now, jump = known[-1]
    else:
        now = r.at(r.new(), 0.0)
        none = np.zeros(len(t.sides))
        jump = Jump(0.0, 0.0, 0.0, none, none, np.zeros((now.depth.shape[1] // 2, len(none))))
        yield now, jump
    size = min(first, turns) if fixed or not jump.size else _next(jump, tolerance)
    while now.turns < turns * (1 - 1e-12):
        look()
        size = min(size, turns - now.turns)
        then = r.at(now.depth + size * now.taken, now.turns + size, now)
        mean = 0.5 * (now.taken + then.taken)
        off = r.seen(0.5 * size * (then.taken - now.taken), now)
        error = float(np.abs(off).max())
        if error > tolerance and not fixed:
            size *= max(0.2, 0.9 * (tolerance / error) ** 0.5)
            continue
        work = [size * 0.5 * r.work(state) for state in (now, then)]
        now = r.at(now.depth + size * mean, now.turns + size, then)
        waves = orders_of(off, len(off) // 2)
        jump = Jump(now.turns, size, error, t.volume(size * mean), work[0] + work[1], waves)
        yield now, jump
        if not fixed:
            size = _next(jump, tolerance)


def _next(jump: Jump, tolerance: float) -> float:
    """Turns of the jump after one."""
    return jump.size * min(3.0, 0.9 * (tolerance / max(jump.error, 1e-3 * tolerance)) ** 0.5)


FIRST = 1e3
"""Turns of the first jump, or all if they are less."""
JUMPS = "jumps"
"""Series of the journal."""


def worn(
    r: Wears[S], of: Callable[[Mapping[str, Any]], S], turns: float, tolerance: float, first: float,
    report: Report, journal: Journal | None,
) -> tuple[list[tuple[S, Jump]], str]:  # fmt: skip
    """All of `jumps`, each kept in a journal and found there, and why they end early, or nothing.

    Args:
        of: the state that its `point` was.

    Raises:
        LeavesTheRail: already of new wheels.
    """
    history = [] if journal is None else [of_point(p, of) for p in journal.of(JUMPS).values()]
    if history:
        report(f"goes on after {history[-1][0].turns:.0f} turns of a run that did not end")
    try:
        for now, jump in jumps(r, turns, tolerance, first, known=history):
            history.append((now, jump))
            if journal is not None:
                journal.keep(JUMPS, now.turns, point_of(now, jump))
            report(f"{now.turns:.0f} of {turns:.0f} turns")
    except LeavesTheRail as stop:
        if not history:
            raise
        return history, str(stop)
    return history, ""


def columns_of(history: Sequence[tuple[WearState, Jump]], way: float, wheels: Sequence[str]) -> dict[str, Array]:
    """Of a table over the jumps: what each does, and the total so far; way: of a turn, m."""
    turns = np.array([now.turns for now, _ in history])
    columns = {"total_turns": turns, "total_distance_km": 1e-3 * turns * way}
    columns["jump_turns"] = np.array([j.size for _, j in history])
    each = {"error_m": np.array([j.error for _, j in history])}
    for k, name in enumerate(wheels):
        each[f"{name}_volume_m3"] = np.array([j.volume[k] for _, j in history])
        each[f"{name}_friction_work_J"] = np.array([j.work[k] for _, j in history])
    for name, values in each.items():
        columns |= {f"jump_{name}": values, f"total_{name}": np.cumsum(values)}
    return columns


def uncertain(history: Sequence[tuple[WearState, Jump]]) -> Array:
    """(orders, wheels) by which amplitudes of what is worn may be off at the end, m: of all jumps together."""
    return np.asarray(sum(j.waves for _, j in history))


def error_of(history: Sequence[tuple[WearState, Jump]]) -> str:
    """A sentence."""
    error = sum(j.error for _, j in history)
    return (
        f"{len(history) - 1} jumps: their errors, each less than its difference to a jump of first order, "
        f"are together below {1e6 * error:.2g} µm of the radius."
    )


def part(point: Mapping[str, Any], name: str) -> dict[str, Any]:
    """What stands below a name."""
    return {k.removeprefix(name): v for k, v in point.items() if k.startswith(name)}


def point_of(now: WearState, jump: Jump) -> dict[str, Any]:
    """Names -> arrays of a state and the jump to it, for a journal."""
    return {f"jump/{k}": v for k, v in vars(jump).items()} | now.point()


def of_point(point: Mapping[str, Any], of: Callable[[Mapping[str, Any]], S]) -> tuple[S, Jump]:
    """What `point_of` took apart, to the last bit; of: the state that its `point` was."""
    return of({k: v for k, v in point.items() if not k.startswith("jump/")}), Jump(**part(point, "jump/"))


def growth(r: RunningVehicle, orders: Array, amplitude: float, wheel: int) -> Array:
    """(orders,) share by which the amplitude of each order of a wheel grows per turn, all together as small waves and
    the same with the opposite sign, so that what goes with their square drops out.

    Raises:
        LeavesTheRail: see `RunningVehicle.at`.
    """
    angle = 2 * np.pi * np.arange(len(r.shape)) / len(r.shape)
    phases = np.pi * orders * (orders - 1) / max(len(orders), 1)  # no high crest where all meet
    shape = np.zeros_like(r.shape)
    shape[:, wheel] = (amplitude * np.cos(np.outer(angle, orders) + phases)).sum(axis=1)
    near = replace(r, shape=np.zeros_like(shape)).at(r.new(), 0.0)
    up, down = (replace(r, shape=s * shape).at(near.depth, 0.0, near) for s in (1, -1))
    change = r.seen(0.5 * (up.taken - down.taken), near)[:, wheel]
    return -np.real(np.fft.rfft(change)[orders] / np.fft.rfft(shape[:, wheel])[orders])


def orders_of(radius: Array, most: int) -> Array:
    """(most, wheels) amplitudes of the orders 1, 2, ... of radii (places, wheels), m."""
    return 2 * np.abs(np.fft.rfft(radius, axis=0))[1 : most + 1] / len(radius)


def tread(v: Vehicle, places: int, coefficient: float, how: dict[str, Any]) -> Tread:
    """Strips wherever a contact can run."""
    y = spread(np.asarray(v.over.on_wheel), 2 * float(v.over.b.max()))
    return Tread(y, 2 * np.pi * float(v.over.radius.mean()) / places, coefficient, how)

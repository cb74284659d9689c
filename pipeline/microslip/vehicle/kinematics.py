"""Wear of a wheel from what another program says of its running: time, pose, creepages, normal force."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Array
from ..errors import UserError, at, in_its_file
from ..files import store
from ..progress import Report
from ..results import Journal
from ..rolling.wear import smoothed
from ..rolling.wheelset import Pose, Side, Track, patches
from ..settings.mistakes import is_number
from .motion import WheelContacts
from .settings import KinematicsCase, track_of, worn_tracks
from .wearing import (
    FIRST,
    SMOOTHING,
    STRIP,
    Jump,
    LeavesTheRail,
    Tread,
    WearState,
    columns_of,
    error_of,
    filtered,
    orders_of,
    spread,
    uncertain,
    worn,
)

NEEDED = ("time_s", "angle_rad", "speed_m_per_s", "lateral_m", "normal_force_N")
GIVEN = ("longitudinal_creepage", "lateral_creepage", "spin_1_per_m")
POSES = 61
"""Lateral places at which the contact is looked for; between them it is read straight."""
GAP = 5.0
"""Steps of time, as the median is, that are a gap."""


@dataclass(frozen=True)
class Kinematics:
    """Of one wheel, (n,) rows in time. Attributes: time: s. angle: of the wheel, rad, rising. speed: m/s. lateral: of
    the wheelset, m. normal_force: N. xi, eta, phi: creepages of the wheel on the rail, and spin, 1/m."""

    time: Array
    angle: Array
    speed: Array
    lateral: Array
    normal_force: Array
    xi: Array
    eta: Array
    phi: Array

    @property
    def turns(self) -> int:
        """Whole ones."""
        return int((self.angle[-1] - self.angle[0]) / (2 * np.pi) + 1e-9)


@in_its_file
def read_kinematics(path: Path) -> Kinematics:
    """A table with a head: ``NEEDED`` and ``GIVEN``, comma-separated, in any order.

    Raises:
        UserError: another file; a column that is missing; numbers that are none; time or angle that stand still or turn
            back, a gap in time, a jump of the pose, a wheel that leaves the rail, less than a turn.
    """
    try:
        text = store.ordinary(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise UserError("there is no such table of kinematics; correct kinematics.file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise UserError("cannot be read as a table of kinematics; correct kinematics.file") from error
    rows = list(csv.reader(text.splitlines()))
    head = [h.strip() for h in rows[0]] if rows else []
    if missing := [c for c in (*NEEDED, *GIVEN) if c not in head]:
        raise UserError(f"has no column {missing[0]}; its first line names the columns {', '.join(head) or '-'}")
    numbers = []
    for n, row in enumerate(rows[1:], 2):
        with at(f"row {n}"):
            numbers += [_numbers(row, head)] if row else []
    if len(numbers) < 8:
        raise UserError(f"has {len(numbers)} rows of numbers; give eight at the least")
    kinematics = Kinematics(*np.array(numbers).T)
    _sound(kinematics)
    return kinematics


def _numbers(row: list[str], head: list[str]) -> list[float]:
    """Of the columns that are known, in their order."""
    if len(row) != len(head):
        raise UserError(
            f"has {len(row)} cells and the first line {len(head)}; write decimal points, and commas between "
            "the columns alone"
        )
    numbers = []
    for column in (*NEEDED, *GIVEN):
        cell = row[head.index(column)].strip()
        if not (is_number(cell) and np.isfinite(float(cell))):
            raise UserError(f"{column}: '{cell}' is no finite number; leave out what is not known")
        numbers.append(float(cell))
    return numbers


def _sound(k: Kinematics) -> None:
    """Refuse what no run of a wheel can be."""
    for name, values in (("time_s", k.time), ("angle_rad", k.angle)):
        if (np.diff(values) <= 0).any():
            at = int(np.argmax(np.diff(values) <= 0)) + 2
            raise UserError(f"{name} does not rise at row {at}; sort the rows and leave out what stands still")
    step = np.diff(k.time)
    if (wide := step > GAP * np.median(step)).any():
        at = int(np.argmax(wide))
        raise UserError(f"has a gap from {k.time[at]:.6g} to {k.time[at + 1]:.6g} s; give the rows between")
    side = np.abs(np.diff(k.lateral))
    if (leap := side > np.maximum(20 * np.median(side), 1e-3)).any():
        at = int(np.argmax(leap))
        raise UserError(f"lateral_m jumps by {1e3 * side[at]:.3g} mm at {k.time[at + 1]:.6g} s; no wheelset does")
    if not (k.normal_force > 0).all():
        at = int(np.argmin(k.normal_force > 0))
        raise UserError(f"normal_force_N: the wheel leaves the rail at {k.time[at]:.6g} s; end the table there")
    if not (k.speed > 0).all():
        raise UserError("speed_m_per_s must be greater than 0")
    if k.turns < 1:
        raise UserError("is of less than a turn of the wheel; give one at the least")


class ContactPlaces:
    """Equal angles of the wheel in each whole turn of a file, from its angle 0 on, and the contacts there; arrays
    (places, turns of the file).

    Attributes: k. track. side. load: mean normal force, N. lateral: (POSES,) of the wheelset, m. y: of it, m, at every
        place. shape: (6, POSES) of new wheels: half axes, m, place on the wheel's profile, m, incline, normal force,
        approach, m.
    """

    def __init__(self, k: Kinematics, track: Track, side: Side, places: int) -> None:
        """Raises:
        UserError: the wheel leaves the profiles.
        """
        self.k, self.track, self.side, self.load = k, track, side, float(np.mean(k.normal_force))
        self.lateral = np.linspace(k.lateral.min() - 1e-6, k.lateral.max() + 1e-6, POSES)
        begun, whole = k.angle[0], 2 * np.pi
        angle = begun + (whole * np.arange(places)[:, None] / places - begun) % whole + whole * np.arange(k.turns)
        self.y, self.force, self.speed, self.xi, self.eta, self.phi = (
            np.interp(angle, k.angle, v) for v in (k.lateral, k.normal_force, k.speed, k.xi, k.eta, k.phi)
        )
        try:
            self.shape = np.array([self._patch(track, y, self.load) for y in self.lateral]).T
        except UserError as error:
            far = int(np.abs(k.lateral).argmax())
            raise UserError(
                f"kinematics.file: the {side} wheel does not stay on its rail between {k.lateral.min():.4g} and "
                f"{k.lateral.max():.4g} m of lateral_m (row {far + 2} is farthest): {error}"
            ) from error

    def _patch(self, track: Track, y: float, vertical: float) -> tuple[float, ...]:
        p = patches(track, Pose(float(y)), self.side, float(vertical))[0]
        return p.a, p.b, p.on_wheel, p.angle, p.normal_force, p.approach

    @cached_property
    def new(self) -> WheelContacts:
        """Of new wheels: read straight between lateral places, grown with the force."""
        a, b, on_wheel, incline, static, _ = (np.interp(self.y, self.lateral, v) for v in self.shape)
        grown = (self.force / static) ** (1 / 3)
        return WheelContacts(self.xi, self.eta, self.phi, a * grown, b * grown, self.force, on_wheel, self.speed,
                        self.force * np.cos(incline))  # fmt: skip

    def _own(self, tracks: Iterable[Track]) -> Array:
        """(3, places, turns of the file) half axes and place on the wheel of every single patch, m; tracks: of each
        place."""
        patches_worn = np.empty((3, *self.y.shape))
        for n, track in enumerate(tracks):
            for i, y in enumerate(self.y[n]):
                a, b, on_wheel, _, static, _ = self._patch(track, y, self.new.vertical[n, i])
                grown = (self.force[n, i] / static) ** (1 / 3)
                patches_worn[:, n, i] = a * grown, b * grown, on_wheel
        return patches_worn

    @cached_property
    def _own_new(self) -> Array:
        return self._own([self.track] * len(self.y))

    @property
    def deepest(self) -> float:
        """m, see `wearing.deepest`."""
        return 0.5 * float(self.shape[-1].min())

    def worn(self, tracks: Callable[[Array], Track], depth: Array) -> WheelContacts:
        """On a wheel of which (places, n) m are worn: by how much each patch, under its own force and on the profile
        across that its place has, differs from that of a new wheel."""
        patches_worn, new, on = self._own(tracks(d) for d in depth), self._own_new, self.new
        (a, b, _), shift = patches_worn / new, patches_worn[2] - new[2]
        return on._replace(a=a * on.a, b=b * on.b, on_wheel=on.on_wheel + shift)


@dataclass(frozen=True, eq=False)
class Passed(WearState):
    """What the turns of a file do at one amount of wear; depth: (1, places, strips), taken in their mean.

    Attributes:
        each: (turns of the file, places) m where a new wheel's contact runs, of each of them. friction: (1,) J in
            one turn, in the mean.
    """

    each: Array
    friction: Array

    @staticmethod
    def of(point: Mapping[str, Any]) -> Passed:
        return Passed(**point)


@dataclass(frozen=True, eq=False)
class GivenWheel:
    """A wheel whose running is given, which its wear changes by the profile alone. Attributes: places. tread. elastic:
    friction, shear, poisson. tracks: see `settings.worn_tracks`; None: as a new wheel."""

    places: ContactPlaces
    tread: Tread
    elastic: tuple[float, float, float]
    tracks: Callable[[Array], Track] | None

    def new(self) -> Array:
        """(1, places, strips) m of a new wheel."""
        return np.zeros((1, len(self.places.y), len(self.tread.y)))

    def at(self, depth: Array, turns: float, near: Passed | None = None) -> Passed:
        """All turns of the file on a worn wheel.

        Raises:
            LeavesTheRail: see `_contacts`.
        """
        if near is not None and self.tracks is None:
            return replace(near, turns=turns, depth=depth)
        on, taken, each, friction = self._contacts(depth), [], [], []
        for one, new in zip(_turns(on), _turns(self.places.new), strict=True):  # one after the other: memory
            taken.append(self.tread.taken(one, *self.elastic)[0])
            each.append(self.tread.seen(taken[-1][None], new)[:, 0])
            friction.append(float(self.tread.work(one, *self.elastic)[0]))
        return Passed(turns, depth, np.mean(taken, axis=0)[None], np.array(each), np.array([np.mean(friction)]))

    def _contacts(self, depth: Array) -> WheelContacts:
        """Raises:
        LeavesTheRail: a groove that is deeper than half of the approach; where the wheel touches is not known.
        """
        if self.tracks is None or not depth.any():
            return self.places.new
        half, radius = float(np.mean(self.places.new.a)), self.places.track.radius
        seen = smoothed(filtered(depth[0], half, radius), STRIP, SMOOTHING)
        if (most := self.places.deepest) < seen.max():
            raise LeavesTheRail(f"a groove of more than {1e3 * most:.2g} mm splits the contact")
        try:
            return self.places.worn(self.tracks, seen)
        except UserError as error:
            raise LeavesTheRail(f"where the worn wheel touches is not known any more ({error})") from error

    def seen(self, depth: Array, now: Passed) -> Array:
        """(places, 1) m where a new wheel's contact runs, in the mean over the turns of the file."""
        return np.mean([self.tread.seen(depth, new) for new in _turns(self.places.new)], axis=0)

    def work(self, now: Passed) -> Array:
        """(1,) J of friction in a turn."""
        return now.friction


def _turns(on: WheelContacts) -> list[WheelContacts]:
    """(places, 1) of each turn of a file."""
    return [WheelContacts(*(c[:, n : n + 1] for c in on)) for n in range(on.xi.shape[1])]


@dataclass(frozen=True)
class KinematicsAnswer:
    """Wear of a wheel by given kinematics, which it does not change.

    Attributes:
        case, wheel. history: what was passed and the jump to it, from a new wheel on. ended: why it ends early, or
            nothing.
    """

    case: KinematicsCase
    wheel: GivenWheel
    history: list[tuple[Passed, Jump]]
    ended: str

    def seen(self) -> tuple[Array, Array]:
        """(places,) m by which the radius is less where the contact runs, after all turns, and its standard error from
        how the turns of the file differ (NaN of a single one)."""
        rates = [now.each for now, _ in self.history]
        sizes = [jump.size for _, jump in self.history[1:]]
        each = sum((s * (0.5 * (a + b)) for s, a, b in zip(sizes, rates, rates[1:], strict=False)), 0 * rates[0])
        error = each.std(axis=0, ddof=1) / len(each) ** 0.5 if len(each) > 1 else np.full(each.shape[1], np.nan)
        return each.mean(axis=0), error

    def circumference(self) -> dict[str, Array]:
        """Of the table over the circumference."""
        depth, error = self.seen()
        places, deepest = self.wheel.places, self.history[-1][0].depth[0].max(axis=1)
        angle = 360 * np.arange(len(depth)) / len(depth)
        columns = {"angle_deg": angle, "depth_m": depth, "standard_error_m": error, "deepest_m": deepest}
        mean = (v.mean(axis=1) for v in (places.force, places.xi, places.eta))
        return columns | dict(zip(("normal_force_N", "longitudinal_creepage", "lateral_creepage"), mean, strict=True))

    def jumped(self) -> dict[str, Array]:
        """Of the table over the jumps."""
        tread = self.wheel.tread
        return columns_of(self.history, tread.way * self.case.kinematics.places, [self.case.kinematics.side])

    def sentences(self) -> list[str]:
        """What a reader came for."""
        (now, _), files = self.history[-1], self.wheel.places.k.turns
        depth, error = self.seen()
        volume, work = sum(np.array([(j.volume[0], j.work[0]) for _, j in self.history]))
        orders = orders_of(depth[:, None], len(depth) // 8)[:, 0]
        n = int(orders.argmax())
        sentences = [
            f"After {now.turns:.4g} turns, by {files} of the file, {1e6 * depth.mean():.4g} µm "
            f"are worn where the contact runs, {1e9 * volume:.4g} mm3 in all: the coefficient times the work of "
            f"friction, {work / now.turns if now.turns else now.friction[0]:.4g} J a turn.",
        ]
        less = max(uncertain(self.history)[n, 0], np.nan_to_num(error).max())
        if orders[n] > less:
            sentences.append(
                f"Over the circumference it differs by {1e6 * np.ptp(depth):.4g} µm; order {n + 1} is largest, "
                f"{1e6 * orders[n]:.3g} µm."
            )
        else:
            sentences.append(f"Over the circumference it differs by no more than its error, {1e6 * less:.2g} µm.")
        if self.wheel.tracks is not None:
            sentences.append(error_of(self.history))
        if files == 1:
            sentences.append(
                "warning: the file holds one whole turn, so that no error can be told of the jump over many."
            )
        else:
            sentences.append(f"Turns of the file differ: its standard error is at most {1e6 * error.max():.2g} µm.")
        return [*sentences, f"warning: it ends there: {self.ended}."] if self.ended else sentences


def recorded(
    case: KinematicsCase, folder: Path, report: Report = lambda _: None, journal: Journal | None = None
) -> KinematicsAnswer:
    """Wear of a case whose files stand in a folder.

    Args:
        journal: where finished jumps are kept, and known ones found.

    Raises:
        UserError: see `read_kinematics` and `ContactPlaces`.
    """
    k, track, asked = read_kinematics(folder / case.kinematics.file), track_of(case, folder), case.kinematics
    places, kept = ContactPlaces(k, track, asked.side, asked.places), case.wear.profile == "kept"
    y = spread(places.new.on_wheel, float(places.new.b.max()))
    if not kept:  # a groove widens the contact
        more = int(np.ceil(places.new.b.max() / STRIP))
        y = y[0] + STRIP * np.arange(-more, len(y) + more)
    way = 2 * np.pi * track.radius / asked.places
    t = Tread(y, way, case.wear.coefficient, case.model.model_dump(), (1,) if asked.side == "right" else (-1,))
    elastic = case.friction, track.elastic.shear, track.elastic.poisson
    wheel = GivenWheel(places, t, elastic, None if kept else worn_tracks(track, y))
    first = asked.turns if kept else min(FIRST, asked.turns)
    report("wear by jumps over many turns")
    history, ended = worn(wheel, Passed.of, asked.turns, case.wear.tolerance, first, report, journal)
    return KinematicsAnswer(case, wheel, history, ended)

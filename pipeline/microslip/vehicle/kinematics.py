"""Wear of a wheel from what another program says of its running: time, pose, creepages, normal force."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..data import Array, UserError
from ..files import store
from ..results import Journal
from ..rolling.wheelset import Pose, Track, patches
from .motion import Contacts
from .settings import KinematicsCase, track_of
from .wearing import Tread, orders_of, spread

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


def read_kinematics(path: Path) -> Kinematics:
    """A table with a head: ``NEEDED`` and ``GIVEN``, comma-separated, in any order.

    Raises:
        UserError: another file; a column that is missing; numbers that are none; time or angle that stand still or turn
            back, a gap in time, a jump of the pose, a wheel that leaves the rail, less than a turn.
    """
    try:
        text = store.ordinary(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise UserError(f"{path}: there is no such table of kinematics; correct kinematics.file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: cannot be read as a table of kinematics; correct kinematics.file") from error
    rows = list(csv.reader(text.splitlines()))
    head = [h.strip() for h in rows[0]] if rows else []
    if missing := [c for c in (*NEEDED, *GIVEN) if c not in head]:
        raise UserError(
            f"{path}: has no column {missing[0]}; its first line names the columns {', '.join(head) or '-'}"
        )
    numbers = [_numbers(row, head, f"{path}: row {n}") for n, row in enumerate(rows[1:], 2) if row]
    if len(numbers) < 8:
        raise UserError(f"{path}: has {len(numbers)} rows of numbers; give eight at the least")
    found = Kinematics(*np.array(numbers).T)
    _sound(found, path)
    return found


def _numbers(row: list[str], head: list[str], where: str) -> list[float]:
    """Of the columns that are known, in their order."""
    found = []
    for column in (*NEEDED, *GIVEN):
        cell = row[head.index(column)] if head.index(column) < len(row) else ""
        try:
            found.append(float(cell))
        except ValueError:
            found.append(np.nan)
        if not np.isfinite(found[-1]):
            raise UserError(f"{where}: {column}: '{cell.strip()}' is no finite number; leave out what is not known")
    return found


def _sound(k: Kinematics, path: Path) -> None:
    """Refuse what no run of a wheel can be."""
    for name, values in (("time_s", k.time), ("angle_rad", k.angle)):
        if (np.diff(values) <= 0).any():
            at = int(np.argmax(np.diff(values) <= 0)) + 2
            raise UserError(f"{path}: {name} does not rise at row {at}; sort the rows and leave out what stands still")
    step = np.diff(k.time)
    if (wide := step > GAP * np.median(step)).any():
        at = int(np.argmax(wide))
        raise UserError(f"{path}: has a gap from {k.time[at]:.6g} to {k.time[at + 1]:.6g} s; give the rows between")
    side = np.abs(np.diff(k.lateral))
    if (leap := side > np.maximum(20 * np.median(side), 1e-3)).any():
        at = int(np.argmax(leap))
        raise UserError(
            f"{path}: lateral_m jumps by {1e3 * side[at]:.3g} mm at {k.time[at + 1]:.6g} s; no wheelset does"
        )
    if not (k.normal_force > 0).all():
        at = int(np.argmin(k.normal_force > 0))
        raise UserError(f"{path}: normal_force_N: the wheel leaves the rail at {k.time[at]:.6g} s; end the table there")
    if not (k.speed > 0).all():
        raise UserError(f"{path}: speed_m_per_s must be greater than 0")
    if k.turns < 1:
        raise UserError(f"{path}: is of less than a turn of the wheel; give one at the least")


def contacts_of(k: Kinematics, track: Track, side: str, places: int) -> list[Contacts]:
    """`Contacts` at equal angles of each whole turn, arrays (places, 1); where and how large from the profiles.

    Raises:
        UserError: the wheel leaves the profiles.
    """
    load = float(np.mean(k.normal_force))
    lateral = np.linspace(k.lateral.min() - 1e-6, k.lateral.max() + 1e-6, POSES)
    try:
        poses = [patches(track, Pose(float(y)), side, load)[0] for y in lateral]
    except UserError as error:
        far = int(np.abs(k.lateral).argmax())
        raise UserError(
            f"kinematics.file: the {side} wheel does not stay on its rail between {k.lateral.min():.4g} and "
            f"{k.lateral.max():.4g} m of lateral_m (row {far + 2} is farthest): {error}"
        ) from error
    shape = np.array([[p.a, p.b, p.on_wheel, p.angle, p.normal_force] for p in poses]).T
    turns = []
    for n in range(k.turns):
        angle = k.angle[0] + 2 * np.pi * (n + np.arange(places) / places)
        y, force, speed, xi, eta, phi = (
            np.interp(angle, k.angle, v) for v in (k.lateral, k.normal_force, k.speed, k.xi, k.eta, k.phi)
        )
        a, b, on_wheel, incline, static = (np.interp(y, lateral, v) for v in shape)
        grown = (force / static) ** (1 / 3)
        columns = (xi, eta, phi, a * grown, b * grown, force, on_wheel, speed, force * np.cos(incline))
        turns.append(Contacts(*(c[:, None] for c in columns)))
    return turns


@dataclass(frozen=True)
class Recorded:
    """Wear of a wheel by given kinematics, which it does not change.

    Attributes:
        case, tread. taken: (turns, places, strips) m that each turn of the file takes off. work: (turns,) J of friction
            in each. on: `Contacts` of each.
    """

    case: KinematicsCase
    tread: Tread
    taken: Array
    work: Array
    on: list[Contacts]

    @property
    def depth(self) -> Array:
        """(places, strips) m after all turns that are asked for."""
        return self.case.kinematics.turns * self.taken.mean(axis=0)

    def seen(self) -> tuple[Array, Array]:
        """(places,) m by which the radius is less where the contact runs, after all turns, and its standard error from
        how the turns of the file differ (NaN of a single one)."""
        each = self.case.kinematics.turns * np.array(
            [self.tread.seen(t[None], on)[:, 0] for t, on in zip(self.taken, self.on, strict=True)]
        )
        error = each.std(axis=0, ddof=1) / len(each) ** 0.5 if len(each) > 1 else np.full(each.shape[1], np.nan)
        return each.mean(axis=0), error

    def circumference(self) -> dict[str, Array]:
        """Of the table over the circumference."""
        depth, error = self.seen()
        mean = {name: np.mean([np.asarray(getattr(on, name))[:, 0] for on in self.on], axis=0)
                for name in ("normal_force", "xi", "eta")}  # fmt: skip
        angle = 360 * np.arange(len(depth)) / len(depth)
        return {"angle_deg": angle, "depth_m": depth, "standard_error_m": error, "deepest_m": self.depth.max(axis=1),
                "normal_force_N": mean["normal_force"], "longitudinal_creepage": mean["xi"],
                "lateral_creepage": mean["eta"]}  # fmt: skip

    def sentences(self) -> list[str]:
        """What a reader came for."""
        depth, error = self.seen()
        volume = self.tread.volume(self.depth[None])[0]
        orders = orders_of(depth[:, None], len(depth) // 8)[:, 0]
        n = int(orders.argmax())
        told = [
            f"After {self.case.kinematics.turns:.4g} turns, by {len(self.on)} of the file, {1e6 * depth.mean():.4g} um "
            f"are worn where the contact runs, {1e9 * volume:.4g} mm3 in all: the coefficient times the work of "
            f"friction, {self.work.mean():.4g} J a turn.",
            f"Over the circumference it differs by {1e6 * np.ptp(depth):.4g} um; order {n + 1} is largest, "
            f"{1e6 * orders[n]:.3g} um.",
        ]
        if len(self.on) == 1:
            return [
                *told,
                "warning: the file holds one whole turn, so that no error can be told of the jump over many.",
            ]
        return [
            *told,
            f"Turns of the file differ: its standard error is at most {1e6 * error.max():.2g} um.",
        ]


TURNS = "turns"
"""Series of the journal."""


def recorded(
    case: KinematicsCase, folder: Path, report: Callable[[str], None] = lambda _: None, journal: Journal | None = None
) -> Recorded:
    """Wear of a case whose files stand in a folder.

    Args:
        journal: where finished turns are kept, and known ones found.

    Raises:
        UserError: see `read_kinematics` and `contacts_of`.
    """
    k, track, asked = read_kinematics(folder / case.kinematics.file), track_of(case, folder), case.kinematics
    on = contacts_of(k, track, asked.side, asked.places)
    y = spread(np.concatenate([c.on_wheel for c in on]), max(float(c.b.max()) for c in on))
    way = 2 * np.pi * track.radius / asked.places
    t = Tread(y, way, case.wear.coefficient, case.how, (1,) if asked.side == "right" else (-1,))
    elastic = case.friction, track.elastic.shear, track.elastic.poisson
    known = {} if journal is None else journal.of(TURNS)
    for n, one in enumerate(on):
        if n not in known:
            report(f"turn {n + 1} of {len(on)}")
            known[n] = {"taken": t.taken(one, *elastic)[0], "work": float(t.work(one, *elastic)[0])}
            if journal is not None:
                journal.keep(TURNS, n, known[n])
    taken, work = (np.array([known[n][name] for n in range(len(on))]) for name in ("taken", "work"))
    return Recorded(case, t, taken, work, on)

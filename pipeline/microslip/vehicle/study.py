"""What a case of a small vehicle asks: how its wheels wear over their circumference, and which orders grow."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..data import Array
from ..errors import UserError
from ..progress import Report
from ..results import Journal
from ..rolling.table import CreepTable, creep_table
from .motion import Creep, Vehicle, critical_speed, hunting, linear, of_strips, of_table, roots, steady
from .settings import VehicleCase
from .wearing import (
    FIRST,
    Jump,
    LeavesTheRail,
    Running,
    RunningVehicle,
    columns_of,
    deepest,
    error_of,
    groove,
    growth,
    orders_of,
    tread,
    uncertain,
    worn,
)

WHEELS = ("right", "left")


def _went(first: float, last: float, less: float) -> str:
    """From one amplitude to another, m, if that is more than it may be off."""
    if abs(last - first) <= max(less, 1e-9):
        return f"stays at {1e6 * first:.4g} µm: it changes by less than the error of the jumps, {1e6 * less:.2g} µm,"
    return f"goes from {1e6 * first:.4g} to {1e6 * last:.4g} µm (its error is below {1e6 * less:.2g} µm)"


SMALL = 1e-6
"""m, amplitude of each order by which growth is looked for."""
FASTEST = 200.0
"""m/s up to which a critical speed is looked for."""


@dataclass(frozen=True)
class VehicleAnswer:
    """Attributes: history: running and the jump to it, from new wheels on. ended: why it ends early, or nothing.
    speeds, grown: (n,) m/s and (n, orders) share per turn by which the waves of the wheel that is looked at grow.
    wheel: its index. critical: speed of hunting, m/s. table: of creep forces, if one was used."""

    case: VehicleCase
    vehicle: Vehicle
    rolling: RunningVehicle
    history: list[tuple[Running, Jump]]
    ended: str
    speeds: Array
    grown: Array
    wheel: int
    critical: float | None
    table: CreepTable | None

    @property
    def orders(self) -> int:
        return self.case.running.orders

    @property
    def way(self) -> float:
        """m that a turn rolls."""
        return self.rolling.tread.way * self.case.running.places

    def amplitudes(self) -> Array:
        """(jumps, orders, wheels) of the radii that the contacts see, m."""
        return np.array([orders_of(now.radius, self.orders) for now, _ in self.history])

    def circumference(self) -> dict[str, Array]:
        """Of the table over the circumference: of the first turn, and what is worn at the end."""
        first, last = self.history[0][0], self.history[-1][0]
        on, t = first.one.on, self.rolling.tread
        columns = {"angle_deg": 360 * np.arange(self.case.running.places) / self.case.running.places}
        per_km = 1e3 / self.way
        for k, name in enumerate(WHEELS):
            columns |= {
                f"{name}_radius_m": first.radius[:, k], f"{name}_radius_at_end_m": last.radius[:, k],
                f"{name}_normal_force_N": np.asarray(on.normal_force)[:, k],
                f"{name}_longitudinal_creepage": np.asarray(on.xi)[:, k],
                f"{name}_lateral_creepage": np.asarray(on.eta)[:, k],
                f"{name}_depth_m_per_km": per_km * t.seen(first.taken, on)[:, k],
                f"{name}_depth_at_end_m": t.seen(last.depth, on)[:, k],
            }  # fmt: skip
        return columns

    def growing(self) -> dict[str, Array]:
        """Of the table over the distance."""
        columns = columns_of(self.history, self.way, WHEELS)
        amplitudes = self.amplitudes()
        for k, name in enumerate(WHEELS):
            columns |= {f"{name}_order_{n + 1}_m": amplitudes[:, n, k] for n in range(self.orders)}
        return columns

    def over_speed(self) -> dict[str, Array]:
        """Of the table of growth; no columns where it is not asked."""
        if not len(self.speeds):
            return {}
        columns = {"speed_m_per_s": self.speeds}
        return columns | {f"order_{n + 1}_per_1000_km": 1e6 / self.way * self.grown[:, n] for n in range(self.orders)}

    def sentences(self) -> list[str]:
        """What a reader came for."""
        now, _ = self.history[-1]
        km = 1e-3 * now.turns * self.way
        amplitudes, off, sentences = self.amplitudes(), uncertain(self.history), []
        for k, name in enumerate(WHEELS):
            first, last, less = amplitudes[0, :, k], amplitudes[-1, :, k], off[: self.orders, k]
            if not first.max() > 1e-9:
                continue
            n = int(first.argmax())
            sentences.append(
                f"Order {n + 1} of the {name} wheel {_went(first[n], last[n], less[n])} in {km:.5g} km "
                f"({now.turns:.4g} turns)."
            )
            m = int((last - first).argmax())
            if m != n and last[m] - first[m] > max(less[m], 1e-9):
                sentences.append(f"Of the others order {m + 1} grows most, to {1e6 * last[m]:.3g} µm.")
        sentences += self._shifted()
        sentences.append(error_of(self.history))
        sentences += [self._hunts(), *self._deep()]
        if self.table is not None:
            sentences.append(
                f"Creep forces of the motion are read from a table, {100 * self.table.error[:, 0].max():.2g} % "
                "of mu F_N off in the mean; those of the wear are not."
            )
        return [s for s in [*sentences, f"warning: it ends there: {self.ended}." if self.ended else ""] if s]

    def _shifted(self) -> list[str]:
        """How the waves of what is worn lie beside those of the wheel (Fig. 6.9-1)."""
        k, now = self.wheel, self.history[0][0]
        worn = np.fft.rfft(self.rolling.tread.seen(now.taken, now.one.on)[:, k])
        shape = np.fft.rfft(now.radius[:, k])
        n = int(np.abs(shape[1:]).argmax()) + 1
        if not np.abs(shape[n]) > 1e-9:
            return []
        part, depth = 360 / n, self.rolling.tread.seen(now.taken, now.one.on)[:, k]
        crest = -np.rad2deg(np.angle(shape[n])) / n
        most = (360 * int(depth.argmax()) / len(depth) - crest + part / 2) % part - part / 2
        behind = np.rad2deg(np.angle(shape[n] / worn[n])) / n
        double = np.abs(worn[2 * n]) / np.abs(worn[n])

        def lies(angle: float) -> str:
            return f"{abs(angle):.3g} degrees {'behind' if angle > 0 else 'before'}"

        return [
            f"A new {WHEELS[k]} wheel with {n} crests wears most {lies(most)} them. Of its wear, the waves of order "
            f"{n} lie {lies(behind)} them; those of order {2 * n} are {double:.2g} times as large."
        ]

    def _deep(self) -> list[str]:
        """What is worn may be deeper than what the contacts know."""
        most, worn = deepest(self.vehicle), self.history[-1][0].depth
        renewed = self.rolling.profile is not None
        depth = float((groove(worn) if renewed else worn.mean(axis=1)).max())
        sentence = f"The groove is {1e3 * depth:.2g} mm deep; "
        if depth <= most:
            return [f"{sentence}the contact is one ellipse up to {1e3 * most:.2g} mm."]
        return [
            f"warning: {sentence.lower()}from {1e3 * most:.2g} mm on it splits the contact, and the profile across is "
            "kept: what follows from there on is a guess."
        ]

    def _hunts(self) -> str:
        root = hunting(self.vehicle)
        state = "dies out" if root.real < 0 else "grows"
        sentence = f"Lateral motion {state} by exp({root.real:.3g} t) at {self.vehicle.speed:g} m/s"
        if self.critical is None:
            return f"{sentence}; no critical speed of hunting was found up to {FASTEST:g} m/s."
        return f"{sentence}; the critical speed of hunting is {self.critical:.4g} m/s."


def study(
    case: VehicleCase, folder: Path, report: Report = lambda _: None, journal: Journal | None = None
) -> VehicleAnswer:
    """Wear of a case whose files stand in a folder.

    Args:
        journal: where finished jumps and speeds are kept, and known ones found.

    Raises:
        UserError: profiles that do not reach, a vehicle that has no running that comes back on new wheels.
    """
    report("contacts over the lateral displacement")
    v = case.made(folder)
    if roots(v)[0].real.max() > 0:
        raise UserError(
            f"running.speed: the wheelset hunts at {v.speed:g} m/s, its critical speed of hunting is "
            f"{critical_speed(v, 1.0, FASTEST) or 0:.4g} m/s; run slower or hold it by a stiffer suspension"
        )
    creep, table = _creep(case, v, report)
    t = tread(v, case.running.places, case.wear.coefficient, case.model.model_dump())
    r = RunningVehicle.of(v, creep, t, case.shape(), case.profiles(folder, t.y))
    report("wear by jumps over many turns")
    turns = case.running.turns
    try:
        history, ended = worn(r, Running.of, turns, case.wear.tolerance, min(FIRST, turns), report, journal)
    except LeavesTheRail as stop:
        raise UserError(f"running, unround: already on new wheels {stop}; run slower or give less") from stop
    wheel = int(np.abs(r.shape).max(axis=0).argmax())
    grown = _all_grown(case, r, wheel, report, journal)
    speeds = [s for s, g in zip(case.running.speeds, grown, strict=True) if g is not None]
    table_of = np.array([g for g in grown if g is not None]).reshape(len(speeds), case.running.orders)
    critical = critical_speed(v, 1.0, FASTEST)
    return VehicleAnswer(case, v, r, history, ended, np.array(speeds), table_of, wheel, critical, table)


def _creep(case: VehicleCase, v: Vehicle, report: Report) -> tuple[Creep, CreepTable | None]:
    if case.running.creep == "linear":
        return linear, None
    if case.running.creep == "strips":
        return of_strips(**case.model.model_dump()), None
    report("table of creep forces")
    how = case.model.model_dump(include={"distribution", "coefficients"})
    table = creep_table(float(v.poisson), checked=2000, **case.table.model_dump(), **how)
    return of_table(table), table


SPEEDS = "speeds"
"""Series of the journal."""


def _all_grown(
    case: VehicleCase, r: RunningVehicle, wheel: int, report: Report, journal: Journal | None
) -> list[Array | None]:
    """Of each speed (orders,) per turn; None where it does not run."""
    kept = {} if journal is None else journal.of(SPEEDS)
    grown_at = []
    for speed in case.running.speeds:
        if speed not in kept:
            grown = _grown(case, r, speed, wheel, report)
            kept[speed] = {} if grown is None else {"grown": grown}
            if journal is not None:
                journal.keep(SPEEDS, speed, kept[speed])
        grown_at.append(kept[speed].get("grown"))
    return grown_at


def _grown(case: VehicleCase, r: RunningVehicle, speed: float, wheel: int, report: Report) -> Array | None:
    """(orders,) per turn; None where it does not run."""
    report(f"growth at {speed:g} m/s")
    at = r.vehicle._replace(speed=speed)
    if roots(at)[0].real.max() > 0 or not np.isfinite(steady(at)).all():
        report(f"warning: the wheelset hunts at {speed:g} m/s, which is left out")
        return None
    try:
        r = RunningVehicle.of(at, r.creep, r.tread, np.zeros_like(r.shape), r.profile)
        return growth(r, np.arange(1, case.running.orders + 1), SMALL, wheel)
    except LeavesTheRail as stop:
        report(f"warning: at {speed:g} m/s {stop}; it is left out")
        return None

"""A small vehicle on unround wheels: its equations, hunting, balance of energy, wear by jumps, bad input."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest
from refusals import refused, refused_command

from microslip.cli import main
from microslip.files.tables import columns_csv
from microslip.programs import program
from microslip.results import Journal, open_journal, read_journal
from microslip.rolling.table import creep_table
from microslip.rolling.wheelset import Pose, patches
from microslip.vehicle import motion, wearing
from microslip.vehicle.kinematics import GivenWheel, read_kinematics, recorded
from microslip.vehicle.motion import linear, of_strips, of_table
from microslip.vehicle.settings import VehicleCase, load_kinematics, load_vehicle, track_of
from microslip.vehicle.study import VehicleAnswer, _went

CASE = Path(__file__).parents[1] / "pipeline" / "cases" / "unround-wheel.toml"
PLACES = 48


@pytest.fixture(scope="module")
def case() -> VehicleCase:
    return load_vehicle(CASE, [f"running.places={PLACES}", "running.orders=6", "running.speeds=[]"])[0]


@pytest.fixture(scope="module")
def vehicle(case: VehicleCase) -> motion.Vehicle:
    return case.made(CASE.parent)


@pytest.fixture(scope="module")
def rolling(case: VehicleCase, vehicle: motion.Vehicle) -> wearing.RunningVehicle:
    t = wearing.tread(vehicle, PLACES, case.wear.coefficient, case.model.model_dump())
    return wearing.RunningVehicle.of(vehicle, linear, t, case.shape())


def test_rails_carry_the_load_of_the_axle_whatever_the_suspension() -> None:
    """The wheelset has sunk by rail and contact where it stands, and the suspension with it."""
    for stiffness in (1e4, 1e7):
        v = load_vehicle(CASE, [f"vehicle.suspension_stiffness=[1e7, 5e6, {stiffness}]"])[0].made(CASE.parent)
        carried = jax.jit(motion.contacts)(v, motion.steady(v), np.zeros(2)).vertical
        np.testing.assert_allclose(carried, 0.5 * 1.5e5, rtol=1e-3)


@pytest.mark.slow
def test_contacts_of_the_motion_are_those_of_a_pose(case: VehicleCase, vehicle: motion.Vehicle) -> None:
    """Force, place, creepages of a turned wheelset against `rolling.wheelset.patches` under the same vertical force."""
    x = motion.steady(vehicle)
    x[0], x[3] = 2.1e-3, 4e-3
    t = motion.at(vehicle.over, vehicle.reach, x[0])
    x[2] = float(t.roll[0])
    found = motion.contacts(vehicle, x, np.zeros(2))
    track = track_of(case, CASE.parent)
    for k, side in enumerate(("right", "left")):
        pose = Pose(x[0], x[3], x[2], vehicle.speed, float(x[12]))
        p = patches(track, pose, side, float(found.vertical[k]))[0]
        assert float(found.normal_force[k]) == pytest.approx(p.normal_force, rel=1e-4)
        np.testing.assert_allclose([found.a[k], found.b[k]], [p.a, p.b], rtol=2e-3)
        np.testing.assert_allclose(found.on_wheel[k], p.on_wheel, atol=2e-5)
        np.testing.assert_allclose([found.xi[k], found.eta[k]], [p.xi, p.eta], atol=1.2e-5)  # yaw^2/2 is 8e-6
        # the place moves with the square of the yaw, by 15 um and 3e-5 rad here, which the motion leaves out
        assert float(found.phi[k]) == pytest.approx(p.phi, abs=2 * x[3] ** 2 / 0.46)


def test_a_yawed_wheel_slips_on_its_flange_by_the_velocity_of_its_contact(vehicle: motion.Vehicle) -> None:
    """56 degrees steep it touches ahead of the axle, where it goes down: omega r yaw/cos(angle), to the first order."""
    steep = motion.at(vehicle.over, vehicle.reach, 0.0)._replace(slope=np.array([-1.5, 1.5]))
    moved, yaw = np.zeros(7), 1e-3
    moved[6] = vehicle.speed / 0.46
    at = np.array([0.0, 0.0, 0.0, yaw, 0.0, 0.0])
    _, across, _ = motion._slip(moved, vehicle, at, np.zeros(2), steep)
    np.testing.assert_allclose(across, moved[6] * steep.radius * yaw * np.sqrt(1 + 1.5**2), rtol=1e-9)


def test_slow_hunting_has_the_wave_of_klingel(vehicle: motion.Vehicle) -> None:
    """Slow, without suspension across and along: omega = V sqrt(conicity/(r l)), conicity the slope of the difference
    of the rolling radii; the spin turns the wave a little."""
    free = np.array(vehicle.stiffness)
    free[[0, 2, 0, 2, 3], [0, 2, 2, 0, 3]] = 0.0
    o, step = vehicle.over, 2 * vehicle.reach / (vehicle.over.a.shape[1] - 1)
    middle = o.a.shape[1] // 2
    conicity = 0.5 * np.gradient(o.radius[0] - o.radius[1], step)[middle]
    wave = 2.0 * np.sqrt(conicity / (o.radius[0, middle] * o.across[0, middle]))
    slow = vehicle._replace(speed=2.0, stiffness=free, damping=0 * free + np.diag([0, 1e5, 0, 0, 1e5, 1e5]))
    assert motion.hunting(slow).imag == pytest.approx(wave, rel=0.05)


@pytest.fixture(autouse=True)
def there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


RATES = program(motion.rates, static_argnums=1)


@jax.jit
def _stored(v: motion.Vehicle, x: Any, out: Any, dx: Any, turned: Any) -> Any:
    """W, the change of `motion.energy`."""
    return jax.jvp(partial(motion.energy, v), (x, out), (dx, turned))[1]


def test_pull_and_torque_bring_what_is_stored_rubbed_and_damped(vehicle: motion.Vehicle) -> None:
    """At once, to rounding, of wheels out of round that slip, roll and yaw."""
    v, rng = vehicle._replace(torque=500.0), np.random.default_rng(2)
    x = motion.steady(v)
    x[:4] += np.array([5e-4, 2e-5, 2e-5, 2e-3])  # both wheels stay on their rails
    x[6:12] = 0.1 * rng.normal(size=6)
    out, rise = np.array([2e-5, -1e-5]), np.array([3e-4, -2e-4])
    dx, powers = map(np.asarray, RATES(v, linear, x, out, rise))
    brought = powers[0] + powers[1] - powers[2] - powers[3]
    stored = float(_stored(v, x, out, dx, x[12] * rise))
    assert (np.abs(powers) > 1e-6 * np.abs(powers).max()).all()
    assert stored == pytest.approx(brought, abs=1e-9 * np.abs(powers).max())


def test_an_axle_off_its_rails_keeps_its_angular_momentum(vehicle: motion.Vehicle) -> None:
    """Running forward that is -I omega along the axle, which yaw turns backward by -psi and roll
    downward by phi."""
    over, none = vehicle.over, 0 * np.array(vehicle.stiffness)
    loose = vehicle._replace(over=over._replace(spring=0 * over.spring), stiffness=none, damping=none)
    x = np.zeros(13)
    x[8], x[9], x[12] = 0.3, -0.2, 150.0
    dx = np.asarray(RATES(loose, linear, x, np.zeros(2), np.zeros(2))[0])
    spun = vehicle.spin_inertia * x[12] * np.array([x[9], -x[8]])
    np.testing.assert_allclose((vehicle.mass @ dx[6:12])[2:4], -spun, rtol=1e-12)


@pytest.mark.slow
def test_a_small_push_grows_by_the_root_above_the_critical_speed_and_dies_out_below(vehicle: motion.Vehicle) -> None:
    """Of the motion in time, by its own integration, against the roots."""
    critical = motion.critical_speed(vehicle, 20.0, 200.0)
    assert critical is not None
    for factor in (0.95, 1.05):
        v = vehicle._replace(speed=factor * critical)
        values, shapes = motion.roots(v)
        root = motion.hunting(v)
        shape = np.real(shapes[:, np.abs(values - root).argmin()])
        x = motion.steady(v)
        flat = np.zeros((2 * motion.steps_of_a_turn(v, PLACES), 2))
        at = x + 1e-5 * shape / np.abs(shape[0])
        sizes, time = [], 0.0
        for _ in range(40):
            one = motion.turned(v, linear, at, flat, flat, len(flat) // 2 // PLACES)
            sizes.append((time, at - x))
            at, time = np.asarray(one.end), time + float(one.time)
        left = np.linalg.inv(shapes)[np.abs(values - root).argmin()]
        part = np.array([np.log(np.abs(left @ d)) for _, d in sizes])
        rate = np.polyfit([t for t, _ in sizes], part, 1)[0]
        assert rate == pytest.approx(root.real, rel=2e-3) and (rate > 0) == (factor > 1)


@pytest.mark.slow
def test_energy_of_a_turn_balances(rolling: wearing.RunningVehicle) -> None:
    """What pull and torque bring is stored, rubbed and damped away; the rest falls with the step."""
    v = rolling.vehicle._replace(torque=500.0)
    x = motion.steady(v)
    off = []
    for fine in (1, 2):
        out, rise = motion.resampled(rolling.shape, 2 * fine * rolling.steps)
        one = motion.turned(v, linear, x, out, rise, fine * rolling.steps // PLACES)
        stored = float(motion.energy(v, one.end, out[0]) - motion.energy(v, x, out[0]))
        pull, torque, friction, damped = map(float, one.work)
        off.append(abs(pull + torque - friction - damped - stored) / max(friction, abs(stored)))
    assert off[0] < 1e-4 and off[1] < 0.3 * off[0] + 1e-7


@pytest.mark.slow
def test_the_table_goes_the_way_of_the_strips(rolling: wearing.RunningVehicle) -> None:
    """A turn with forces read from a table and with the strips themselves: apart by the error of the table at most."""
    how = {"elements": (8, 8)}
    table = creep_table(rolling.vehicle.poisson, points=(8, 10, 17, 17, 7), checked=2000, **how)
    x = motion.steady(rolling.vehicle)
    x[0] += 1e-3
    out, rise = motion.resampled(rolling.shape, 2 * rolling.steps)
    ends = []
    for creep in (of_strips(**how), of_table(table)):
        ends.append(motion.turned(rolling.vehicle, creep, x, out, rise, rolling.steps // PLACES))
    strips, read = (np.asarray(e.states) for e in ends)
    v, time = rolling.vehicle, float(ends[0].time)
    pushed = 2 * float(table.error[1, 2]) * v.friction * v.each  # both wheels, the largest error all the time
    assert np.abs(strips - read)[:, 0].max() < 0.5 * pushed / v.mass[0, 0] * time**2
    assert np.abs(strips[:, 0] - read[:, 0]).max() < 0.02 * np.ptp(strips[:, 0])


def test_worn_volume_is_the_coefficient_times_the_work(rolling: wearing.RunningVehicle) -> None:
    """Per jump, the work from the creep forces, the volume from the strips of the tread."""
    found = list(wearing.jumps(rolling, 1e5, 1e-9, 2e4))
    for _, jump in found[1:]:
        np.testing.assert_allclose(jump.volume, rolling.tread.coefficient * jump.work, rtol=1e-10)
    assert found[-1][0].turns == pytest.approx(1e5)


def test_jumps_of_a_journal_go_on_to_the_same_bits(rolling: wearing.RunningVehicle, tmp_path: Path) -> None:
    """Three jumps kept in a file, read again and gone on with, against jumps that nothing interrupts."""
    whole = list(wearing.jumps(rolling, 1e5, 1e-9, 2e4))
    with open_journal(tmp_path / "points", "of these", {}) as journal:
        for now, jump in whole[:3]:
            journal.keep("jumps", now.turns, wearing.point_of(now, jump))
    known = [wearing.of_point(p, wearing.Running.of) for p in read_journal(tmp_path / "points")[1]["jumps"].values()]
    rest = list(wearing.jumps(rolling, 1e5, 1e-9, 2e4, known=known))
    assert len(rest) == len(whole) - 3 > 0
    for (now, jump), (then, other) in zip(whole[3:], rest, strict=True):
        assert (jump.size, jump.error, now.turns) == (other.size, other.error, then.turns)
        assert (now.depth == then.depth).all() and (now.radius == then.radius).all() and (jump.work == other.work).all()


@pytest.mark.slow
def test_jumps_are_of_second_order(rolling: wearing.RunningVehicle) -> None:
    """Radii after as many turns, by jumps of a half, a quarter, ... of them."""
    far, ends = 4e6, []
    for count in (2, 4, 8, 32):
        *_, (last, _) = wearing.jumps(rolling, far, 1.0, far / count, fixed=True)
        ends.append(last.radius[:, 0])
    off = [np.abs(e - ends[-1]).max() for e in ends[:-1]]
    order = -np.polyfit(np.log([2, 4, 8]), np.log(off), 1)[0]
    assert order == pytest.approx(2, abs=0.35)


@pytest.mark.slow
def test_profiles_are_renewed_as_they_wear(case: VehicleCase, rolling: wearing.RunningVehicle) -> None:
    """Of an order between one and two, 0.04 um off in one jump; the volume is the coefficient times the work.

    The contact widens, so that three crests wear off faster than on wheels that touch as new ones; a groove that splits
    the contact ends it.
    """
    renewed = replace(rolling, profile=case.profiles(CASE.parent, rolling.tread.y))
    far, ends = 3e5, []
    for count in (1, 2, 4):
        *_, (last, jump) = wearing.jumps(renewed, far, 1.0, far / count, fixed=True)
        ends.append(last.radius[:, 0])
        np.testing.assert_allclose(jump.volume, rolling.tread.coefficient * jump.work, rtol=1e-10)
    off = [np.abs(e - ends[-1]).max() for e in ends[:-1]]
    assert off[0] < 1e-7 and off[0] / off[1] > 3.1  # 3 of first order, 5 of second
    *_, (kept, _) = wearing.jumps(rolling, far, 1.0, far, fixed=True)
    assert last.one.on.b.mean() > 1.1 * kept.one.on.b.mean()
    worn = [
        wearing.orders_of(rolling.shape, 3)[2, 0] - wearing.orders_of(r, 3)[2, 0] for r in (last.radius, kept.radius)
    ]
    assert worn[0] > 2 * worn[1] > 0
    depth = 1.3 * wearing.deepest(rolling.vehicle) / last.depth.max() * last.depth
    with pytest.raises(wearing.LeavesTheRail, match="groove"):
        renewed.renewed(depth)


def test_three_crests_wear_as_the_figure_says(rolling: wearing.RunningVehicle) -> None:
    """Fig. 6.9-1: wear shows three maxima, shifted against those of the wheel, and three more of the creepage."""
    now = rolling.at(rolling.new(), 0.0)
    worn = np.fft.rfft(rolling.tread.seen(now.taken, now.one.on)[:, 0])
    size = np.abs(worn[1:])
    assert set(np.argsort(-size)[:2] + 1) == {3, 6}
    shift = np.rad2deg(np.angle(worn[3] / np.fft.rfft(now.radius[:, 0])[3])) / 3
    assert 5 < abs(shift) < 60


def test_no_change_is_claimed_that_the_jumps_do_not_tell(rolling: wearing.RunningVehicle) -> None:
    """What one long jump makes of the waves is off by less than it tells, and told of only where it is more."""
    *_, (coarse, jump) = wearing.jumps(rolling, 1e6, 1.0, 1e6)
    *_, (fine, _) = wearing.jumps(rolling, 1e6, 2e-8, 1e5)
    off = np.abs(wearing.orders_of(coarse.radius, 6) - wearing.orders_of(fine.radius, 6))
    assert (off <= wearing.uncertain([(coarse, jump)])[:6] + 1e-10).all() and off.max() > 1e-10
    assert _went(3e-5, 2.992e-5, 1.9e-7).startswith("stays at 30 µm: it changes by less than the error")
    assert _went(3e-5, 2.992e-5, 1e-8).startswith("goes from 30 to 29.92 µm")


def test_a_round_wheel_stays_round(rolling: wearing.RunningVehicle) -> None:
    """And wears alike on both sides."""
    flat = replace(rolling, shape=np.zeros_like(rolling.shape))
    *_, (last, jump) = wearing.jumps(flat, 1e6, 1e-7, 1e5)
    assert np.ptp(last.radius, axis=0).max() < 1e-5 * np.abs(last.radius).max()
    assert jump.volume[0] == pytest.approx(jump.volume[1], rel=1e-6)


# --- the command line ----------------------------------------------------------------------------------------------

SHORT = ("running.places=48", "running.orders=6", "running.speeds=[]", 'running.creep="linear"', "running.turns=1e5",
         'wear.profile="kept"')  # fmt: skip


def asked(*changes: str) -> list[str]:
    return ["roll", str(CASE), *(w for c in (*SHORT, *changes) for w in ("--set", c)), "--no-pictures", "-q"]


def test_a_case_from_the_command_line(tmp_path: Path) -> None:
    assert main(asked()) == 0
    folder = tmp_path / "build" / "unround-wheel"
    rows = list(csv.DictReader((folder / "growth.csv").open()))
    assert float(rows[-1]["total_turns"]) == 1e5 and (folder / "unround.html").is_file()
    for of in ("jump", "total"):
        for row in rows[1:]:
            work = float(row[f"{of}_right_friction_work_J"])
            assert float(row[f"{of}_right_volume_m3"]) == pytest.approx(7e-13 * work, rel=1e-8)
    volumes = [float(row["jump_right_volume_m3"]) for row in rows]
    assert float(rows[-1]["total_right_volume_m3"]) == pytest.approx(sum(volumes), rel=1e-8)
    assert len(list(csv.DictReader((folder / "circumference.csv").open()))) == 48


class Stopped(Exception):
    """As a killed process."""


def stopped_after(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Journals that keep so many points more, and then stop the run."""
    kept = []

    def keep(self: Journal, *given: Any) -> None:
        if len(kept) == count:
            raise Stopped
        kept.append(None)
        real(self, *given)

    real = Journal.keep
    monkeypatch.setattr(Journal, "keep", keep)


@pytest.mark.slow
@pytest.mark.parametrize("of", ["vehicle", "kinematics"])
def test_a_run_that_is_killed_goes_on(
    of: str,
    rolling: wearing.RunningVehicle,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Stopped among the jumps, then among the speeds, or among the jumps by a file: the third run has the bytes of one
    that nothing stops, and leaves no journal."""
    name, stops, made = "given", (2, 1), ("circumference.csv", "wear.csv", "unround.html")
    given = ["roll", str(written(tmp_path, table(rolling)[0])), "--set", "kinematics.places=24", "--no-pictures"]
    if of == "vehicle":
        name, stops, made = "unround-wheel", (3, 5), ("growth.csv", "circumference.csv", "speeds.csv", "unround.html")
        given = [a for a in asked("running.speeds=[40.0,60.0]", "running.turns=2e5") if a != "-q"]
    folders = [tmp_path / "whole" / "build" / name, tmp_path / "stopped" / "build" / name]
    for folder in folders:
        folder.parents[1].mkdir()
    monkeypatch.chdir(tmp_path / "whole")
    assert main(given) == 0
    monkeypatch.chdir(tmp_path / "stopped")
    for count in stops:
        with monkeypatch.context() as patch, pytest.raises(Stopped):
            stopped_after(count, patch)
            main(given)
        assert (folders[1] / "unround.points").is_file() and not (folders[1] / made[0]).exists()
    capsys.readouterr()
    assert main(given) == 0
    assert "goes on after" in capsys.readouterr().err
    for file in made:
        assert (folders[0] / file).read_bytes() == (folders[1] / file).read_bytes()
    assert not (folders[1] / "unround.points").exists()


def test_a_groove_is_told_of_the_profile_that_touches(rolling: wearing.RunningVehicle) -> None:
    """That of both wheels in the mean where it is renewed, as what ends a run; that of the deepest where it is kept."""
    t, most = rolling.tread, wearing.deepest(rolling.vehicle)
    depth = np.array([1.1, 0.5])[:, None, None] * most * np.ones((2, PLACES, len(t.y)))
    said = {}
    for profile in (None, lambda depth: None):
        of = SimpleNamespace(vehicle=rolling.vehicle, rolling=SimpleNamespace(profile=profile))
        of.history = [(SimpleNamespace(depth=depth), None)]
        said[profile is not None] = VehicleAnswer._deep(of)[0]  # type: ignore[arg-type]
    assert said[False].startswith("warning: ") and f"{1.1e3 * most:.2g} mm" in said[False]
    assert not said[True].startswith("warning: ") and f"{0.8e3 * most:.2g} mm" in said[True]


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ("running.speed=160", "running.speed"),
        pytest.param("unround=[{order=3, amplitude=4e-3}]", "unround", marks=pytest.mark.slow),
        ("running.places=30", "running.places"),
        ("running.reach=0.04", "pose.lateral"),
        ("wear.updates=5", "wear.updates"),
    ],
)
def test_bad_input(change: str, key: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A vehicle that hunts, a wheel that leaves its rail, too few places, a reach beyond the profile, a key
    of rolling cases that wheels out of round have not: exit 2."""
    assert main(asked(change)) == 2
    assert key in capsys.readouterr().err and not list((tmp_path / "build" / "unround-wheel").glob("[!.]*"))


@pytest.mark.slow
def test_a_run_that_ends_keeps_what_it_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The wheel leaves its rail after wear has gone on for a while: exit 1, tables of what was found."""
    assert main(asked("wear.coefficient=1e-9", "wear.tolerance=1e-5", "running.turns=1e6")) == 1
    rows = list(csv.DictReader((tmp_path / "build" / "unround-wheel" / "growth.csv").open()))
    assert 1 < len(rows) and float(rows[-1]["total_turns"]) < 1e6
    assert "ended early" in capsys.readouterr().err


# --- kinematics of another program ---------------------------------------------------------------------------------


def table(rolling: wearing.RunningVehicle, turns: int = 2) -> tuple[dict[str, np.ndarray], wearing.Running]:
    """What the package's own vehicle would write of its right wheel, and that running."""
    now = rolling.at(rolling.new(), 0.0)
    on, n = now.one.on, turns * PLACES + 1
    pick = np.arange(n) % PLACES
    columns = {
        "time_s": float(now.one.time) * np.arange(n) / PLACES, "angle_rad": 2 * np.pi * np.arange(n) / PLACES,
        "speed_m_per_s": np.asarray(on.speed)[pick, 0], "lateral_m": np.asarray(now.one.states)[pick, 0],
        "normal_force_N": np.asarray(on.normal_force)[pick, 0],
        "longitudinal_creepage": np.asarray(on.xi)[pick, 0], "lateral_creepage": np.asarray(on.eta)[pick, 0],
        "spin_1_per_m": np.asarray(on.phi)[pick, 0],
    }  # fmt: skip
    return columns, now


def written(folder: Path, columns: dict[str, np.ndarray]) -> Path:
    """A case with the table beside it."""
    (folder / "run.csv").write_text(columns_csv(columns, 12))
    whole = tomllib.loads(CASE.read_text())
    parts = [f"[{name}]\n" + "\n".join(f"{k} = {v}" for k, v in whole[name].items()) for name in ("wheel", "rail")]
    (folder / "case.toml").write_text(
        'name = "given"\nfriction = 0.3\n[kinematics]\nfile = "run.csv"\nturns = 1e5\nplaces = 48\n'
        "[wear]\ncoefficient = 7e-13\n" + "\n".join(parts)
    )
    return folder / "case.toml"


def test_wear_by_a_file_is_that_of_the_vehicle_that_wrote_it(rolling: wearing.RunningVehicle, tmp_path: Path) -> None:
    """Depth where the contact runs, 1e5 turns of it, profiles kept; its volume is the coefficient times the work."""
    columns, now = table(rolling)
    case = written(tmp_path, columns)
    assert main(["roll", str(case), "--set", 'wear.profile="kept"', "--no-pictures", "-q"]) == 0
    rows = list(csv.DictReader((tmp_path / "build" / "given" / "circumference.csv").open()))
    depth = np.array([float(r["depth_m"]) for r in rows])
    own = 1e5 * rolling.tread.seen(now.taken, now.one.on)[:, 0]
    np.testing.assert_allclose(depth, own, rtol=5e-3)
    assert max(float(r["standard_error_m"]) for r in rows) < 1e-6 * depth.max()
    (row,) = list(csv.DictReader((tmp_path / "build" / "given" / "wear.csv").open()))[1:]
    assert float(row["total_right_volume_m3"]) == pytest.approx(
        7e-13 * float(row["total_right_friction_work_J"]), rel=1e-8
    )


def given(folder: Path, columns: dict[str, np.ndarray], *changes: str) -> GivenWheel:
    """The wheel of a file, not yet worn."""
    return recorded(load_kinematics(written(folder, columns), ["kinematics.turns=1", *changes])[0], folder).wheel


FEW = ("kinematics.places=24", "model.elements=[8,8]")
QUICK = (*FEW, 'wear.profile="kept"')


def swaying(first: float, side: float = 1.0) -> dict[str, np.ndarray]:
    """Two turns and a bit of a wheel, all of which hangs on its angle, from a first one on (rad). side: -1 mirrors."""
    angle = first + np.linspace(0, 4.2 * np.pi, 421)
    c, s = np.cos(angle), np.sin(angle)
    return {
        "time_s": 0.02 * (angle - first), "angle_rad": angle, "speed_m_per_s": 23 + c,
        "lateral_m": side * 1e-3 * (1 + s), "normal_force_N": 6e4 * (1 + 0.2 * s),
        "longitudinal_creepage": 1e-3 * (1 + 0.5 * c), "lateral_creepage": side * 5e-4 * s,
        "spin_1_per_m": side * 0.1 * (1 + 0.3 * c),
    }  # fmt: skip


def test_a_place_of_the_wheel_is_the_same_wherever_its_file_begins(tmp_path: Path) -> None:
    """The table over the circumference is by the angle of the wheel, not by how far it has turned in the file."""
    wheels = (given(tmp_path, swaying(first), *QUICK) for first in (0.0, 2.0))
    one, other = (wheel.at(wheel.new(), 0.0).each for wheel in wheels)
    np.testing.assert_allclose(other, one, rtol=5e-3)


def test_the_left_wheel_of_a_mirrored_file_wears_as_the_right_one(tmp_path: Path) -> None:
    left = given(tmp_path, swaying(0.0, -1.0), *QUICK, 'kinematics.side="left"')
    right = given(tmp_path, swaying(0.0), *QUICK)
    np.testing.assert_allclose(left.at(left.new(), 0.0).taken, right.at(right.new(), 0.0).taken, rtol=1e-9)


def test_a_case_of_a_vehicle_refuses_what_it_does_not_compare(
    rolling: wearing.RunningVehicle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for path in (CASE, written(tmp_path, table(rolling)[0])):
        refused_command(["roll", str(path), "-q", "--set", "model.exact=3"], capsys, "model.exact")


def depth_of(wheel: Any, far: float, count: int = 1) -> tuple[np.ndarray, Any, float]:
    """m, where a new wheel's contact runs, after so many equal jumps; the state there; what the jumps tell as error."""
    history = list(wearing.jumps(wheel, far, 1.0, far / count, fixed=True))
    first, last = history[0][0], history[-1][0]
    for _, jump in history[1:]:
        np.testing.assert_allclose(jump.volume, wheel.tread.coefficient * jump.work, rtol=1e-10)
    return wheel.seen(last.depth, first)[:, 0], last, sum(jump.error for _, jump in history)


@pytest.mark.slow
@pytest.mark.parametrize(("lobes", "off"), [(0.0, 0.03), (1.0, 0.3)])
def test_a_file_and_its_vehicle_wear_alike_as_profiles_are_renewed(
    lobes: float, off: float, case: VehicleCase, rolling: wearing.RunningVehicle, tmp_path: Path
) -> None:
    """By a share of what renewing changes: round wheels, all that differs is the running that follows the wear; with
    lobes the vehicle's wheels touch by the mean profile over the circumference, those of a file place by place."""
    shaped = replace(rolling, shape=lobes * rolling.shape)
    columns, now = table(shaped, 1)
    own, _, _ = depth_of(replace(shaped, profile=case.profiles(CASE.parent, rolling.tread.y)), 1e5)
    read, _, _ = depth_of(given(tmp_path, columns, "kinematics.places=24"), 1e5)
    kept = 1e5 * rolling.tread.seen(now.taken, now.one.on)[:, 0]
    assert np.abs(read - own[::2]).max() < off * np.abs(kept - own).max()


def test_little_wear_of_given_kinematics_is_that_of_kept_profiles(
    rolling: wearing.RunningVehicle, tmp_path: Path
) -> None:
    """What renewing changes, as a share of the depth, goes with the wear to first order."""
    wheel, off = given(tmp_path, table(rolling, 1)[0], *FEW), []
    new = wheel.at(wheel.new(), 0.0)
    for far in (1e3, 2e3, 4e3):
        depth, _, _ = depth_of(wheel, far)
        kept = far * wheel.seen(new.taken, new)[:, 0]
        off.append(np.abs(depth / kept - 1).max())
    assert off[-1] < 5e-3 and np.log2(off[2] / off[0]) / 2 == pytest.approx(1, abs=0.1)


def test_the_error_of_jumps_by_a_file_is_less_than_they_tell(rolling: wearing.RunningVehicle, tmp_path: Path) -> None:
    """Against jumps of a half."""
    wheel = given(tmp_path, table(rolling, 1)[0], *FEW)
    whole, _, told = depth_of(wheel, 1e5)
    fine, _, less = depth_of(wheel, 1e5, 2)
    assert 0 < np.abs(whole - fine).max() < told and less < told


def test_a_place_wears_as_a_wheel_that_runs_everywhere_as_there(
    rolling: wearing.RunningVehicle, tmp_path: Path
) -> None:
    """Where the force is largest, against a file in which it is as large all round."""
    columns = table(rolling, 1)[0]
    n = int(columns["normal_force_N"][:PLACES:2].argmax())  # of every second place, as the wheel of the file has them
    same = {k: v if k in ("time_s", "angle_rad") else np.full_like(v, v[2 * n]) for k, v in columns.items()}
    areas = []
    for folder, table_ in ((tmp_path / "waves", columns), (tmp_path / "same", same)):
        folder.mkdir()
        areas.append(depth_of(given(folder, table_, *FEW), 1e5)[1].depth[0, n].sum())
    assert areas[0] == pytest.approx(areas[1], rel=1e-4)


@pytest.mark.slow
def test_a_groove_that_splits_the_contact_ends_wear_by_a_file(
    rolling: wearing.RunningVehicle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit 1, and the tables of what was found."""
    case = str(written(tmp_path, table(rolling, 1)[0]))
    changes = ("kinematics.turns=1e6", "kinematics.places=24", "wear.tolerance=1e-6")
    assert main(["roll", case, *(w for c in changes for w in ("--set", c)), "--no-pictures"]) == 1
    said = capsys.readouterr()
    assert "ended early" in said.err and "groove" in said.out + said.err
    rows = list(csv.DictReader((tmp_path / "build" / "given" / "wear.csv").open()))
    assert 2 < len(rows) and 1e4 < float(rows[-1]["total_turns"]) < 1e6


def test_a_table_with_decimal_commas_is_no_kinematics(tmp_path: Path) -> None:
    """A cell would be two."""
    head = "time_s,angle_rad,speed_m_per_s,lateral_m,normal_force_N"
    head += ",longitudinal_creepage,lateral_creepage,spin_1_per_m"
    (tmp_path / "run.csv").write_text("\n".join([head] + [f"0,{n},{n},20,0,1e5,0,0,0" for n in range(9)]))
    refused("row 2: has 9 cells", read_kinematics, tmp_path / "run.csv")


def cut(columns: dict[str, np.ndarray], kind: str) -> dict[str, np.ndarray]:
    """A table that no wheel can have written."""
    keep = np.ones(len(columns["time_s"]), bool)
    changed = {k: v.copy() for k, v in columns.items()}
    if kind == "gap":
        keep[30:40] = False
    elif kind == "lateral_m":
        changed["lateral_m"][50:] += 5e-3
    elif kind == "normal_force_N":
        changed["normal_force_N"][20] = -1.0
    elif kind == "time_s":
        changed["time_s"][10] = changed["time_s"][8]
    elif kind == "column":
        del changed["spin_1_per_m"]
    elif kind == "turn":
        keep[40:] = False
    elif kind == "wheel, rail":
        changed["lateral_m"] += 0.05
    return {k: v[keep] for k, v in changed.items()}


@pytest.mark.parametrize("kind", ["gap", "lateral_m", "normal_force_N", "time_s", "column", "turn", "wheel, rail"])
def test_kinematics_that_no_wheel_has(
    kind: str, rolling: wearing.RunningVehicle, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """One sentence, exit 2, nothing written."""
    file = str(written(tmp_path, cut(table(rolling)[0], kind)))
    refused_command(["roll", file, "--no-pictures", "-q"], capsys, kind)
    assert not (tmp_path / "build" / "given" / "circumference.csv").exists()

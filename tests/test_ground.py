"""Ground that moves under a contact, and friction by the velocity alone: closed forms, energy, settings."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from refusals import refused, refused_command
from scipy.integrate import solve_ivp

import microslip as ms
from microslip.case.assemble import Built
from microslip.case.driving import SpectrumOfCase
from microslip.cli import main
from microslip.contact.friction import Coulomb, Exponential, Friction, scattered
from microslip.contact.law import Law, history, value
from microslip.contact.normal import Penalty
from microslip.contact.patch import Patch
from microslip.contact.point import PointContact
from microslip.contact.rate import RateContact
from microslip.system import Body, Contact, Force, Monitor, System
from microslip.system.assembly import Assembly, ContactFace, Load, Output, preloaded_contact
from microslip.system.component import Component
from microslip.system.ground import Ground, spectrum
from microslip.time_domain import equations, orbit
from microslip.time_domain.stepper import KINDS, Stepper

pytestmark = pytest.mark.usefixtures("undrawn")

MASS, STIFFNESS, NORMAL, V = 5.632, 5610.0, 14.0, 0.001
"""Of the friction oscillator of Sextro, section 4.3: kg, N/m, N, m/s."""

OMEGA = float(np.sqrt(STIFFNESS / MASS))

MOST = 2048
"""Samples of a motion that is let go."""


def rate(friction: Friction, slope: float = 1e6, damping: float = 0.0) -> RateContact:
    return RateContact(Penalty(value(1e6)), friction, value(slope), value(damping))


def rubbing(law: Law, ground: Ground | None = None, force: float = 0.0, points: int = 1) -> Assembly:
    """The mass of section 4.3, free along the normal x and along y, where its spring is, pressed on the ground."""
    face, push = Contact("face", "mass", (1, 0, 0), t2=(0, 0, 1)), Force("foot", "mass", (0, 1, 0))
    body = Body("mass", MASS, (0, 0, 0), free="xy")
    group = System("rub", [body], [], [face], [push], [Monitor("mass", "mass")]).basis().groups[0, 0]
    row = group.excitations["foot"].rows[0]
    group = replace(group, K_r=group.K_r + STIFFNESS * np.outer(row, row))
    places = np.stack([np.linspace(0, 0.01, points) if points > 1 else np.zeros(1), np.zeros(points)], axis=1)
    patch = Patch("face", places, np.ones(points), law)
    contact = replace(preloaded_contact("face", patch, ContactFace("mass", "face"), None, NORMAL, 0.0), ground=ground)
    outputs = tuple(Output("mass", "mass", f"u_{x}") for x in "yx")
    return Assembly((Component("mass", {0: group}),), (contact,), (Load("mass", "foot", force),), outputs)


def let_go(assembly: Assembly, at: float, Omega: float, keep: int, steps: int, samples: int = 64) -> tuple:
    """Times, y and y' of a motion that begins at rest at y = at (m)."""
    e = equations.of(assembly, Omega)
    s = Stepper(e, 2 * np.pi / Omega / steps)
    q = at * e.output[0] / (e.output[0] @ e.output[0])
    count = samples * keep
    each = np.where(np.arange(MOST) < count, steps // samples, 0)  # as many samples for all: one program a law
    _, seen, *_ = s.run(s.start(q, np.zeros_like(q)), each)
    return tuple(a[:count] for a in (seen.time, seen.q @ e.output[0], seen.q_dot @ e.output[0]))


@pytest.mark.parametrize("law", ["rate", "point"])
def test_coulomb_friction_takes_as_much_from_every_half_swing(law: str) -> None:
    """Let go from a, the turning points are a - 2 n mu F_N / k, and it sticks where the spring cannot overcome it."""
    mu, a = 0.1, 2.2e-3
    friction = Coulomb(value(mu))
    laws = {"rate": rate(friction, 1e8), "point": PointContact(Penalty(value(1e6)), friction, value(1e8))}
    _, y, _ = let_go(rubbing(laws[law]), a, OMEGA, 4, 8192)
    lost = 2 * mu * NORMAL / STIFFNESS
    for n in range(1, 5):
        turn = y[64 * n // 2 - 1]
        assert turn == pytest.approx((-1) ** n * (a - n * lost), abs=2e-6 if law == "point" else 2e-7)
    assert np.ptp(y[5 * 32 :]) < 5e-7  # rests: |k y| < mu F_N


def test_stick_slip_on_a_belt_is_its_closed_form() -> None:
    """Static 0.8 over sliding 0.55, by a characteristic that falls at once: stuck, the spring's force rises by k V;
    from mu_0 F_N it slips by half a swing of the oscillator about mu_inf F_N."""
    friction = Exponential(value(0.8), value(0.55), value(1e4))
    Omega = OMEGA / 8
    t, y, v = let_go(rubbing(rate(friction, 1e10), Ground(V)), 0.5e-3, Omega, 4, 8192, 512)
    stuck = np.abs(v - V) < 1e-6
    np.testing.assert_allclose(y[t < 1.0], 0.5e-3 + V * t[t < 1.0], atol=1e-6)
    top, middle = 0.8 * NORMAL / STIFFNESS, 0.55 * NORMAL / STIFFNESS
    size = np.hypot(top - middle, V / OMEGA)
    assert y.max() == pytest.approx(top, rel=2e-3) and v.min() == pytest.approx(-OMEGA * size, rel=2e-3)
    late = t > 1.6
    assert y[late].min() == pytest.approx(middle - (top - middle), rel=2e-3)
    slips = t[1:][stuck[:-1] & ~stuck[1:]]
    slipping = (np.pi + 2 * np.arctan2(V / OMEGA, top - middle)) / OMEGA
    period = 2 * (top - middle) / V + slipping
    assert np.diff(slips).mean() == pytest.approx(period, rel=5e-3)


def test_creep_near_the_limit_is_no_slip_and_a_slip_is_counted_once() -> None:
    """Speeds of creep that pass 6.3 / k_S, to and fro, are none; from 64 / k_S on one slip, until below 6.3 / k_S."""
    slope, dt = 1e6, 1e-3
    creeps = 10.0 + 20.0 * np.sin(np.linspace(0, 30, 100))
    slides = np.concatenate([np.linspace(30, 3000, 20), 60 + 20 * np.sin(np.linspace(0, 30, 100)), [20, 10, 7, 3, 1]])
    speed = np.concatenate([creeps, slides, creeps, slides]) / slope
    u = np.zeros((len(speed), 1, 3))
    u[:, 0, 0], u[:, 0, 1] = 1e-5, np.cumsum(speed) * dt
    moved = np.diff(np.asarray(history(rate(Coulomb(value(0.3)), slope), u, dt).slip)[:, 0, 0]) > 0
    assert (moved[1:] & ~moved[:-1]).sum() == 2
    begins = len(creeps) + int(np.argmax(slides > 64)) - 1
    assert moved.argmax() == begins and not moved[: len(creeps) - 1].any() and not moved[-2:].any()


@pytest.mark.parametrize("slope", [1e6, pytest.param(1e9, marks=pytest.mark.slow)])
def test_every_slip_of_the_closed_form_is_counted_once(slope: float) -> None:
    """Stick-slip on a belt, let go where it sticks, whatever the smoothing: as many as times at which it is fast."""
    law = rate(Exponential(value(0.8), value(0.55), value(1e4)), slope)
    Omega, keep, steps = OMEGA / 8, 4, 8192
    e = equations.of(rubbing(law, Ground(V)), Omega)
    s = Stepper(e, 2 * np.pi / Omega / steps)
    each = np.where(np.arange(MOST) < 64 * keep, steps // 64, 0)
    _, seen, listed, *_ = s.run(s.start(0 * e.omega2, 0 * e.omega2), each)
    listed = listed[listed[:, 0] > 0.1]  # the belt takes the mass along first
    slips, sticks = (listed[listed[:, 2] == KINDS.index(kind), 0] for kind in ("slips", "sticks"))
    fast = seen.q_dot[: 64 * keep] @ e.output[0] < -5 * V
    assert len(slips) == (fast[1:] & ~fast[:-1]).sum() > 3
    assert len(slips) - len(sticks) in (0, 1) and (np.diff(slips) > 0.5).all()


def test_steady_sliding_holds_the_spring_by_the_friction_at_the_belts_speed() -> None:
    """A rising characteristic damps to mu(V) F_N; the smoothing's share 2/pi arctan(k_S V) counts."""
    friction, slope = Exponential(value(0.2), value(0.5), value(10.0)), 1e5
    for angle, sign in ((0.0, 1.0), (np.pi, -1.0)):
        law = rate(friction, slope)
        assembly = rubbing(law, Ground(0.05, angle))
        e = equations.of(assembly, OMEGA)
        q, _ = orbit.begun(e, "static")
        _, y, v = let_go(assembly, sign * 1e-3, OMEGA, 32, 1024)
        mu = (0.5 - 0.3 * np.exp(-10.0 * 0.05)) * 2 / np.pi * np.arctan(slope * 0.05)
        assert y[-1] == pytest.approx(sign * mu * NORMAL / STIFFNESS, rel=1e-3) and abs(v[-1]) < 1e-5
        assert (e.output @ q)[0] in (0.0, pytest.approx(y[-1], rel=1e-3))


WAVY = Ground(0.02, 0.0, ((2e-5, 2.5e-3, 0.3), (1e-5, 1.1e-3, 1.0)))


def by_hand(pushes: bool, times: np.ndarray, Omega: float) -> np.ndarray:
    """(2, s) y and the normal x of the mass on `WAVY` ground, integrated by LSODA."""
    k, beta = 1e6, 1e-4
    u_0 = NORMAL / k

    def force(t: float, z: np.ndarray) -> list[float]:
        y, x, w, n = z
        u_r, passing = y - 0.02 * t, w - 0.02
        height = sum(a * np.sin(2 * np.pi / L * u_r + p) for a, L, p in WAVY.waves)
        slope = sum(a * 2 * np.pi / L * np.cos(2 * np.pi / L * u_r + p) for a, L, p in WAVY.waves)
        deep = u_0 + x + height
        F = max(k * deep + beta * k * (n + slope * passing), 0.0) if deep > 0 else 0.0
        mu = (0.8 - 0.55) * np.exp(-20.0 * abs(passing)) + 0.55
        T = mu * F * 2 / np.pi * np.arctan(1e4 * passing) + pushes * F * slope
        return [w, n, (3.0 * np.cos(Omega * t) - STIFFNESS * y - T) / MASS, (NORMAL - F) / MASS]

    return solve_ivp(force, (0, times[-1]), np.zeros(4), "LSODA", times, rtol=1e-10, atol=1e-13, max_step=1e-3).y[:2]


@pytest.mark.slow
@pytest.mark.parametrize("pushes", [True, False])
def test_wavy_ground_is_met_where_the_body_is(pushes: bool) -> None:
    """Against the equations by hand, with and without the push of the slope; the ground's work in the balance."""
    friction = Exponential(value(0.8), value(0.55), value(20.0))
    law = rate(friction, 1e4, 1e-4)
    e = equations.of(rubbing(law, replace(WAVY, pushes=pushes), force=3.0), 20.0)
    errors, drifts = [], []
    for steps in (2048, 8192):
        found = orbit.run(e, 0, 2, 64, steps, "rest")
        exact = by_hand(pushes, found.time, 20.0)
        errors.append(np.abs(found.y - exact).max() / np.abs(exact).max())
        drifts.append(found.drift)
        assert found.balance < 1e-10
    assert errors[1] < 1e-4 and errors[1] < 0.5 * errors[0]
    assert drifts[1] < 0.5 * drifts[0] < 1e-3


@pytest.fixture(scope="module")
def taken_along() -> orbit.Orbit:
    """Two periods of the mass on `WAVY` ground, from rest."""
    law = rate(Exponential(value(0.8), value(0.55), value(20.0)), 1e4, 1e-4)
    return orbit.run(equations.of(rubbing(law, WAVY, force=3.0), 20.0), 0, 2, 1024, 4096, "rest")


def test_what_moving_ground_gives_is_its_force_times_its_way(taken_along: orbit.Orbit) -> None:
    """Where the slope pushes, the ground's power is V times the tangential force on the body."""
    found = taken_along
    pulled = -np.cumsum(found.force[1]) * 0.02 * found.period / 1024
    given = found.energy["ground"] - found.energy["ground"][0]
    np.testing.assert_allclose(given, pulled - pulled[0], atol=5e-3 * given.max())


def test_the_picture_of_a_motion_has_the_loss_of_its_table(
    taken_along: orbit.Orbit,
) -> None:
    """On moving ground a loop's area is no loss: what stands in the picture is the table's, whatever that says. A long
    title stands in the picture with all of its letters."""
    from microslip.pictures.orbit import orbit_picture
    from microslip.pictures.plots import figure_of

    long = ", ".join(["title", *15 * ["and it does not come back"]])
    row = {"lost_in_contacts_J_per_period": 123.4}
    figure = figure_of(partial(orbit_picture, taken_along, row, title=long))
    titles = [figure.get_suptitle(), *(axes.get_title() for axes in figure.axes)]
    (said,) = [" ".join(t.split()) for t in titles if " J" in t]
    assert said == f"{long}; contacts lose 123.4 J a period"
    figure.canvas.draw()
    title = figure._suptitle.get_window_extent()
    assert 0 < title.x0 and title.x1 < figure.bbox.width
    assert any("force in N" in axes.get_ylabel() for axes in figure.axes)  # its loops are drawn


@pytest.mark.slow
def test_many_points_that_creep_together_carry_what_one_does() -> None:
    """Four points of a rigid patch, each with a quarter, on ground without waves: the turns of the braking agree."""
    friction = Exponential(value(0.8), value(0.55), value(100.0))
    quarter = RateContact(Penalty(value(2.5e5)), friction, value(1e6), value(0.0))
    one, four = (
        let_go(rubbing(law, Ground(V), points=n), 1e-3, OMEGA, 2, 2048)[1]
        for law, n in ((rate(friction), 1), (quarter, 4))
    )
    np.testing.assert_allclose(one, four, atol=1e-9)


def test_a_seed_makes_the_same_friction_whatever_the_step() -> None:
    """Equation (3.6-3): the coefficient is a function of time, so that finer steps give the same motion."""

    def moved(seed: int, steps: int) -> np.ndarray:
        law = rate(scattered(Coulomb(value(0.5)), 0.2, 0.05, seed))
        return let_go(rubbing(law, Ground(0.05)), 0.0, OMEGA, 3, steps)[1]

    one = moved(1, 8192)
    np.testing.assert_array_equal(one, moved(1, 8192))
    assert np.abs(moved(1, 2048) - one).max() < 0.02 * np.abs(moved(2, 8192) - one).max()


def test_a_spectrum_has_its_height_and_its_slope() -> None:
    """Mean square of the sum of waves; power per wave number as k^-2 between long and short ones."""
    waves = np.array(spectrum(1e-5, 0.1, 1e-3, 2.0, 200, 3))
    assert np.sqrt(0.5 * (waves[:, 0] ** 2).sum()) == pytest.approx(1e-5)
    k, a = 2 * np.pi / waves[:, 1], waves[:, 0]
    assert np.polyfit(np.log(k), np.log(a**2 / k), 1)[0] == pytest.approx(-2.0, abs=1e-6)
    assert waves[:, 1].max() <= 0.1 and waves[:, 1].min() >= 1e-3
    assert spectrum(1e-5, 0.1, 1e-3, 2.0, 5, 3) == spectrum(1e-5, 0.1, 1e-3, 2.0, 5, 3)
    with pytest.raises(ValueError, match="shortest"):
        SpectrumOfCase(height=1e-5, longest=1e-3, shortest=0.1)


CASE = """
name = "rub"
body = "rub"
monitor = "mass"
direction = "y"

[[springs]]
row = "foot"
stiffness = 5610.0
motion = 0.0005

[[contacts]]
interface = "face"
normal_force = 14.0
width = 0.01
height = 0.01
points = [1, 1]
normal_stiffness = 1e6
tangential_stiffness = 1e6
includes = "bulk+surface"
friction = { kind = "exponential", mu_0 = 0.8, mu_inf = 0.55, rate = 1000.0, deviation = 0.05, memory = 0.1 }
law = { kind = "rate", slope = 1e6 }
ground = { velocity = 0.001, waviness = [{ amplitude = 1e-5, length = 2.5e-3 }] }

[orbit]
Omega = 13.8
settle = 2
keep = 2
samples = 64
"""


@pytest.fixture
def rub(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    face, foot = Contact("face", "mass", (1, 0, 0), t2=(0, 0, 1)), Force("foot", "mass", (0, 1, 0))
    system = System("rub", [Body("mass", MASS, (0, 0, 0), free="xy")], [], [face], [foot], [Monitor("mass", "mass")])
    (tmp_path / "build" / "rub").mkdir(parents=True)
    ms.write_basis("build/rub/basis.h5", system.basis())
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path


def test_a_case_rubs_on_moving_ground(rub: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(["orbit", "case.toml", "--set", "orbit.settle=0", "--set", "orbit.keep=1"]) == 0
    assert "13.8 rad/s" in capsys.readouterr().out


@pytest.mark.parametrize(
    "change, words",
    [
        ("contacts.0.ground={}", "velocity: is missing"),
        ("contacts.0.ground.waviness.0.length=1e-8", "too few for the waviness of the ground"),
        ("contacts.0.ground.waviness.0.length=0", "length"),
        ("contacts.0.law.slope=0", "slope"),
        ("sweep={start=1.0, stop=2.0}", "only a motion in time"),
    ],
)
def test_ground_that_cannot_be_is_refused(rub: Path, capsys: pytest.CaptureFixture, change: str, words: str) -> None:
    sets = ["--set", change, "--set", "orbit.steps=4096"]
    refused_command(["orbit", "case.toml", "-q", *sets], capsys, words)


BOOK = Exponential(value(0.8), value(0.55), value(1000.0))
"""mu_0, mu_inf and lambda_e (s/m) of section 4.3."""


@pytest.mark.slow
def test_the_friction_oscillator_of_the_book_slips_in_one_size_and_on_waves_in_several() -> None:
    """Section 4.3 with what is printed, two modes: every slip is the half swing from mu_0 F_N about mu_inf F_N, within
    what the foot moves, and x ranges over that; with the printed waviness slips of several sizes follow one another,
    up to twice as fast."""
    Omega, foot = 13.8, STIFFNESS * 0.0005
    wave = Ground(V, 0.0, ((200e-6, 2.5e-3, 0.0),), pushes=False)

    def moved(ground: Ground) -> tuple[orbit.Orbit, list[float]]:
        assembly = rubbing(rate(BOOK, 1e6, 4e-6), ground, force=foot)
        found = orbit.run(equations.of(assembly, Omega), 6, 20, 512)
        v = found.v[0]
        begins = np.flatnonzero((v[:-1] > -0.25 * V) & (v[1:] <= -0.25 * V))
        ends = [b + int(np.argmax(v[b + 1 :] > 0)) for b in begins[:-1]]
        return found, [-float(v[b : e + 2].min()) for b, e in zip(begins, ends, strict=False)]

    flat, speeds = moved(Ground(V))
    drop, reach = (0.8 - 0.55) * NORMAL / STIFFNESS, foot / STIFFNESS
    assert len(speeds) >= 5 and np.ptp(speeds) < 0.3 * np.mean(speeds)
    assert np.abs(np.mean(speeds) / OMEGA - drop) < reach
    assert 2 * drop < np.ptp(flat.y[0]) < 2 * (drop + reach) + 2 * np.pi * V / Omega
    wavy, on_waves = moved(wave)
    assert np.ptp(on_waves) > 0.4 * np.mean(on_waves) and max(on_waves) > 1.3 * max(speeds)
    assert len(on_waves) > len(speeds) and np.ptp(wavy.y[0]) > np.ptp(flat.y[0])
    assert flat.balance < 1e-9 and wavy.balance < 1e-9


# from Python ---------------------------------------------------------------------------------------------------------

BRAKE = {
    "interface": "right", "normal_stiffness": 2e5, "tangential_stiffness": 4e5, "points": [1, 1],
    "includes": "bulk+surface", "friction": {"kind": "exponential", "mu_0": 0.9, "mu_inf": 0.1, "rate": 1.0},
    "law": {"kind": "rate", "slope": 1e3}, "ground": {"velocity": 1.0},
}  # fmt: skip


def braked(force: float, **more: object) -> Built:
    """The vane's tip on ground that moves, as a dict that asks for nothing and has no excitation."""
    case = {"body": "vane", "monitor": "probe", "contacts": [{**BRAKE, "normal_force": force}], **more}
    return ms.assemble(case, vane=ms.sample())


def test_moving_ground_is_assembled_from_a_dict_and_needs_no_excitation() -> None:
    for more in ({}, {"orbit": {"frequency": 100.0}}, {"stability": {"frequency": [0.0, 1e3]}}):
        assembly = braked(20.0, **more).assembly
        assert assembly.contacts[0].ground == Ground(1.0) and not assembly.loads
    pressed = ms.assemble(
        {"body": "vane", "monitor": "probe", "contacts": [BRAKE], "orbit": {"frequency": 100.0}}, vane=ms.sample(),
        normal_force=20.0,
    )  # fmt: skip
    assert pressed.assembly.contacts[0].preload[0] == pytest.approx(20.0)
    for made in (pressed, rubbing(rate(Coulomb(value(0.3))), Ground(V), 1.0)):
        refused(("harmonic balance cannot take", "microslip orbit"), ms.harmonic_response, made, [100.0])
    still = {key: value for key, value in BRAKE.items() if key not in ("ground", "law")}
    alone = {"body": "vane", "monitor": "probe", "contacts": [{**still, "normal_force": 20.0}]}
    refused("nothing drives it", ms.harmonic_response, ms.assemble(alone, vane=ms.sample()), [100.0])


def test_a_case_in_a_file_needs_an_excitation_where_no_ground_moves(tmp_path: Path) -> None:
    text = 'name = "c"\nbody = "vane"\nmonitor = "probe"\n[orbit]\nfrequency = 100.0\n'
    text += '[[contacts]]\ninterface = "right"\nnormal_force = 1.0\nnormal_stiffness = 1e6\n'
    text += "tangential_stiffness = 1e6\nfriction = 0.1\npoints = [1, 1]\n"
    (tmp_path / "c.toml").write_text(text)
    refused("excitation: give excitation", ms.assemble, "c.toml", tmp_path, vane=ms.sample())


@pytest.mark.slow
def test_roots_about_sliding_are_on_the_axis_at_the_hopf_points() -> None:
    """Of what a dict describes: `ms.bifurcate` over the normal force, and `ms.stability` there."""
    points = ms.bifurcate(braked, 1.0, 100.0, orbits=False).hopf
    assert len(points) == 2
    for point in points:
        roots = ms.stability(braked(point.p), frequency=(0, 2000))
        i = np.abs(roots.roots.s.imag - point.omega).argmin()
        assert roots.roots.s[i] == pytest.approx(1j * point.omega, abs=1e-8 * point.omega)

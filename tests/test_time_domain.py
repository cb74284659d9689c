"""Motion in time: exact flows, order of accuracy, energy, impacts, harmonic balance."""

from __future__ import annotations

import math
import re
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import h5py
import jax
import jax.numpy as jnp
import meshio
import numpy as np
import pytest
import sector
from refusals import refused, refused_command
from scipy.integrate import solve_ivp

import microslip as ms
from microslip.analyses import balanced
from microslip.cli import main
from microslip.contact.friction import Coulomb
from microslip.contact.heights import Polynomial
from microslip.contact.law import Law, settings, value
from microslip.contact.normal import Normal, Penalty, Rough
from microslip.contact.patch import Patch
from microslip.contact.point import PointContact
from microslip.data import CENTRIFUGAL, Rows, RunUp
from microslip.errors import UserError
from microslip.exchange.vtu import write_motion
from microslip.pictures.moving import whole_ring
from microslip.report.page import number, text
from microslip.system import Body, Contact, Force, Monitor, Spring, System
from microslip.system.assembly import Assembly, ContactFace, Load, Output, Ring, preloaded_contact
from microslip.system.component import Component
from microslip.time_domain import classification, equations, loop, orbit, recorded, samples, starts
from microslip.time_domain.stepper import Snapshot, Stepper

pytestmark = pytest.mark.usefixtures("undrawn")

MASS, STIFFNESS, DAMPING, FOOT = 0.092, 99.085, 0.02046, 0.00047
"""Of the impact oscillator of Sextro, section 4.2: kg, N/m, N s/m, m."""


def patch(normal: Normal, damping: float = 0.0, mu: float = 0.0, stiffness: float = 0.0) -> Patch:
    law = PointContact(normal, Coulomb(value(mu)), value(stiffness), None, value(damping) if damping else None)
    return Patch("stop", np.zeros((1, 2)), np.ones(1), law)


def hitting(touching: Patch, normal: float | None = None, push: float = STIFFNESS * FOOT) -> Assembly:
    """The mass of section 4.2 on its spring, which barely touches its stop at rest, or is pressed against it."""
    spring = Spring("ground", "mass", (STIFFNESS, 4e4, 3e4))
    faces = [Contact("stop", "mass", (1, 0, 0), t2=(0, 0, 1))]
    forces = [Force("foot", "mass", (1, 0, 0)), Force("side", "mass", (0.2, 1, 0.5))]
    basis = System("oscillator", [Body("mass", MASS, (0, 0, 0))], [spring], faces, forces, [Monitor("mass", "mass")])
    group = basis.basis().groups[0, 0]
    row = group.excitations["foot"].rows[0]
    group = replace(group, C_r=group.C_r + DAMPING * np.outer(row, row))
    contact = preloaded_contact("stop", touching, ContactFace("mass", "stop"), None, normal, 0.0)
    outputs = tuple(Output("mass", "mass", f"u_{x}") for x in "xyz")
    load = Load("mass", "foot" if normal is None else "side", push)
    return Assembly((Component("mass", {0: group}),), (contact,), (load,), outputs)


BOOK = patch(Rough(value(0.3e6), value(5.2e-6), Polynomial()), damping=6.0 / 0.3e6)


def test_bodies_alone_move_exactly_at_resonance_and_with_few_steps() -> None:
    """x'' + x = cos t from rest is t sin(t) / 2, and a body that nothing holds goes as (1 - cos t)."""
    M, K = np.diag([1.0, 2.0]), np.diag([1.0, 0.0])
    alone = ms.structure(M, K, force={0: 1.0, 1: 2.0}, output=[0, 1])
    found = ms.integrate(alone, 1.0, unit="rad/s", settle=0, keep=9, samples=64)
    t = found.time
    np.testing.assert_allclose(found.y[0], 0.5 * t * np.sin(t), atol=1e-9)
    np.testing.assert_allclose(found.y[1], 1 - np.cos(t), atol=1e-9)
    np.testing.assert_allclose(found.v[0], 0.5 * (np.sin(t) + t * np.cos(t)), atol=1e-9)
    assert found.balance < 1e-11


def test_gyroscopic_bodies_move_exactly() -> None:
    """Dampers that couple all modes: against Radau."""
    K, C = np.array([[3.0, -1.0], [-1.0, 2.0]]), np.array([[0.1, 0.7], [-0.7, 0.05]])
    found = ms.integrate(
        ms.structure(np.eye(2), K, C, force={0: 1.0}, output=[0, 1]), 1.3, unit="rad/s", settle=0, keep=3, samples=32
    )

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        return np.concatenate([z[2:], np.array([np.cos(1.3 * t), 0]) - K @ z[:2] - C @ z[2:]])

    exact = solve_ivp(rate, (0, found.time[-1]), np.zeros(4), "DOP853", found.time, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(found.y, exact.y[:2], atol=1e-9)
    assert found.balance < 1e-11


def book_force(u: float, rate: float) -> float:
    """The stop of section 4.2 by hand: Sextro Eqs. (4.1-16), (3.3-21), (3.3-24), clipped at zero; N."""
    x = min(max(u / 5.2e-6, 0.0), 1.0)
    volume, area = x**3 * (1 - 0.5 * x) + max(u / 5.2e-6 - 1, 0.0), x * x * (3 - 2 * x)
    return max(0.3e6 * 5.2e-6 * volume + 6.0 * area * rate, 0.0)


@pytest.mark.parametrize("order, steps, many, periods", [(2, 2048, 4, 3), (4, 128, 7, 12)])
def test_an_impact_oscillator_of_the_book_in_its_order(order: int, steps: int, many: int, periods: int) -> None:
    """Some periods of section 4.2 at 64.32 rad/s against an integration of the printed equations by hand: the error
    falls with a power of the step, unevenly where steps are halved, so that of fourth order it takes several
    impacts to see."""
    Omega, samples = 64.32, 64
    e = equations.of(hitting(BOOK), Omega)

    def rate(t: float, z: np.ndarray) -> list[float]:
        push = STIFFNESS * FOOT * np.cos(Omega * t) - STIFFNESS * z[0] - DAMPING * z[1]
        return [z[1], (push - book_force(z[0], z[1])) / MASS]

    times = 2 * np.pi / Omega / samples * np.arange(1, periods * samples + 1)
    exact = solve_ivp(rate, (0, times[-1]), [0, 0], "DOP853", times, rtol=1e-12, atol=1e-15, max_step=1e-4).y[0]
    size, errors = np.abs(exact).max(), []
    for each in steps * 2 ** np.arange(many) // samples:
        s = Stepper(e, 2 * np.pi / Omega / (each * samples), order=order)
        begun = now = s.start(np.zeros(3), np.zeros(3))
        q = []
        for _ in range(periods):
            now, seen, *_ = s.run(now, np.full(samples, each))
            q.append(seen.q)
        errors.append(np.abs(np.concatenate(q) @ e.output[0] - exact).max() / size)
    found = -np.polyfit(np.arange(many), np.log2(errors), 1)[0]
    assert errors[-1] < 10 ** (-1 - 2 * order) and 0.85 < found / order < 1.2
    assert jax.tree.map(jax.typeof, begun) == jax.tree.map(jax.typeof, now)  # or the loop would be compiled twice


def test_leaps_over_flights_change_nothing() -> None:
    """The same with every step taken, to rounding as the contact multiplies it; in less steps."""
    e = equations.of(hitting(BOOK), 64.32)
    found = []
    for leaps in (True, False):
        s = Stepper(e, 2 * np.pi / 64.32 / 8192)
        s.__dict__["options"] = replace(s.options, leaps=leaps)
        _, seen, *_ = s.run(s.start(np.zeros(3), np.zeros(3)), np.full(64, 256))
        found.append(np.asarray(seen.q))
    np.testing.assert_allclose(found[0], found[1], atol=1e-9 * np.abs(found[1]).max())


def test_what_parts_is_not_leapt_over_before_it_is_apart() -> None:
    """The spring still pushes a mass that leaves its stop: at the edge of the stop, and through many impacts of two
    masses with steps as fine as one likes, to what finer ones leave of the energy."""
    law = ms.stop(40.0, 0.1).law
    u, w = np.array([[0.0, 0.1 + 1e-9, 0.0], [0.0, 0.1 - 1e-9, 0.0]]), np.array([[0.0, -1.0, 0.0]] * 2)
    touching, apart = jax.jit(partial(loop._unmet, law.overlap))(u, w, np.full(2, 2.0), np.full(2, 3.0)).tolist()
    assert touching == 0.0 and apart > 0.5
    two = {"elements": [ms.stop(2000.0, 0.3, at=[1.0, -1.0])], "output": [0, 1], "damping_ratio": 0.0}
    masses = ms.structure(np.eye(2), np.diag([1.0, 4.0]), np.diag([0.01, 0.04]), force={0: 1.0}, **two)
    coarse, fine = (
        ms.integrate(masses, 1.05, unit="rad/s", settle=0, keep=4, samples=64, steps=n).y for n in (16384, 32768)
    )
    np.testing.assert_allclose(coarse, fine, atol=2e-8)


def test_energy_is_kept_to_rounding_and_what_contacts_do_with_it_to_second_order() -> None:
    """With friction, lift-off and dampers in three dimensions."""
    e = equations.of(hitting(patch(Penalty(value(2e5)), mu=0.3, stiffness=1e5), normal=0.5, push=1.5), 300.0)
    found = [orbit.run(e, 3, 2, 64, steps) for steps in (2048, 4096)]
    assert max(one.balance for one in found) < 1e-8
    assert found[0].count("slips") and found[0].count("opens")
    assert found[1].drift < 0.4 * found[0].drift < 4e-3


def test_a_viscous_contact_throws_back_what_its_closed_form_says() -> None:
    """Met by a body without other springs with 0.1 m/s: it leaves where the force ends, with exp(-D w t) of that speed,
    tan(w sqrt(1 - D^2) t) = 2 D sqrt(1 - D^2) / (2 D^2 - 1). The damper begins with a jump: first order in steps."""
    k, beta, speed = 3e5, 2e-4, 0.1
    free = replace(hitting(patch(Penalty(value(k)), damping=beta)), loads=())
    e = equations.of(free, 2 * np.pi * 10)
    e = replace(e, omega2=np.zeros(3), C=np.zeros((3, 3)))
    s = Stepper(e, 1e-7)
    along = e.D[0] / (e.D[0] @ e.D[0])
    _, seen, *_ = s.run(s.start(-1e-4 * along, speed * along), np.full(64, 2**11))
    rates = np.asarray(seen.q_dot) @ e.D[0]
    w, D = np.sqrt(k / MASS), beta * np.sqrt(k / MASS) / 2
    root = np.sqrt(1 - D**2)
    left = np.arctan2(2 * D * root, 2 * D**2 - 1) / (w * root)
    assert rates[0] == pytest.approx(speed) and rates[-1] == pytest.approx(-speed * np.exp(-D * w * left), rel=1e-4)


@pytest.mark.parametrize("frequency", [0.8, 1.0])
def test_a_steady_vibration_is_that_of_harmonic_balance(frequency: float) -> None:
    slider = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.2)])
    found = ms.integrate(slider, frequency, unit="rad/s", settle=150, keep=2, samples=64, steps=4096)
    balanced = ms.harmonic_response(slider, [frequency], harmonics=15, samples=4096, unit="rad/s").amplitude[0]
    assert 2 / 64 * abs(np.fft.rfft(found.y[0][-64:])[1]) == pytest.approx(balanced, rel=1e-4)
    assert found.repeats == 1


def test_the_impact_oscillator_of_the_book_at_its_frequencies() -> None:
    """Section 4.2: what the book calls period two at 30.84 rad/s is two impacts in one period of the excitation. At
    37.41 rad/s chaos passes after some hundred periods, how many is a matter of the last digits: a thousand settle."""
    for Omega, settle, periods, impacts in ((64.32, 100, 1, 1), (30.84, 100, 1, 2), (37.41, 1000, 2, 3)):
        found = orbit.run(equations.of(hitting(BOOK), Omega), settle, 8, 64, 1024)
        assert (found.repeats, found.impacts * found.repeats) == (periods, impacts) and found.error < 1e-4


def test_the_impact_oscillator_of_the_book_is_chaotic_and_does_not_come_to_rest() -> None:
    """Section 4.2 with a rigid arm. Fig. 4.2-2 h, 23.63 rad/s, is chaotic in the book and here. In Fig. 4.2-3, 9.845
    rad/s, the arm comes to rest at its stop; with the printed damper it does not: beta c_N0 / (2 sqrt(c_N0 m)) = 0.018
    leaves an impact exp(-0.018 pi) = 0.945 of its speed or more: the push turns before leaps end, ten in a period."""
    chaos = orbit.run(equations.of(hitting(BOOK), 23.63), 60, 40, 64)
    assert chaos.said.startswith("chaotic") and chaos.repeats == 0
    leaping = orbit.run(equations.of(hitting(BOOK), 9.845), 10, 8, 64)
    assert 8 < leaping.impacts < 12 and not classification.chatter(leaping, 0)


def test_a_motion_that_settles_from_side_to_side_comes_back_after_its_own_period() -> None:
    """With the multiplier m < 0 of two periods, after four less of the start is seen, |m^2 - 1|, than after two,
    |m - 1|."""
    k = np.arange(30)
    after = np.where(k % 2, 1.0, -1.0) + 1e-3 * (-0.85) ** (k // 2)
    assert orbit.comes_back(after[None], 1.0) == 2
    k = np.arange(61)
    slow = 1e-3 * (-0.98) ** k  # misses 2e-3 to 6e-4 after a period, and after two no more than 1e-4
    assert orbit.comes_back(slow[None], 0.5) == 1
    doubled = 1e-3 * (-1.0) ** k + slow
    assert orbit.comes_back(doubled[None], 0.5) == 2


def test_the_legend_of_a_phase_portrait_says_what_its_dots_are() -> None:
    slider = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.2)])
    legend = ms.integrate(slider, 1.0, unit="rad/s", settle=0, keep=2).plot().get_legend()
    assert legend is not None and [text.get_text() for text in legend.get_texts()] == ["after every period"]


CASE = """
name = "hammer"
body = "hammer"
monitor = "head"

[[springs]]
row = "foot"
stiffness = 99.085
damping = 0.02046
motion = 0.00047

[[contacts]]
interface = "face"
interference = 0.0
width = 0.01
height = 0.01
points = [1, 1]
normal_stiffness = 3e5
tangential_stiffness = 3e5
includes = "bulk+surface"
roughness = 5.2e-6
friction = 0.0
law = { kind = "rough", damping = 2e-5 }

[orbit]
Omega = 64.32
settle = 60
keep = 4
samples = 64
"""


@pytest.fixture
def hammer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the oscillator of section 4.2 as a system by hand, and its case."""
    monkeypatch.chdir(tmp_path)
    face, foot = Contact("face", "head", (1, 0, 0), t2=(0, 0, 1)), Force("foot", "head", (1, 0, 0))
    system = System("hammer", [Body("head", MASS, (0, 0, 0), free="x")], [], [face], [foot], [Monitor("head", "head")])
    (tmp_path / "build" / "hammer").mkdir(parents=True)
    ms.write_basis("build/hammer/basis.h5", system.basis())
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path


def test_orbit_of_a_case_says_the_same_in_table_page_and_file(hammer: Path, capsys: pytest.CaptureFixture) -> None:
    """The motion of `hitting`, by springs of the case; done once only."""
    assert main(["orbit", "case.toml"]) == 0
    assert "64.32 rad/s: comes back after 1 period, 1 impact in it" in capsys.readouterr().out
    folder = hammer / "build" / "hammer"
    head, row = (line.split(",") for line in (folder / "orbit.csv").read_text().splitlines())
    told = {name: float(cell or "nan") for name, cell in zip(head, row, strict=True)}
    by_hand = orbit.run(equations.of(hitting(BOOK), 64.32), 60, 4, 1024)
    seen, whole = by_hand.y[0, 15::16].max(), by_hand.y[0].max()
    assert 1.03 * seen < 0.99 * whole < told["largest_m"] < 1.001 * whole
    with h5py.File(folder / "orbit.h5") as file:
        group = file["motion_1"]
        assert group["displacement"][0].max() == pytest.approx(seen, rel=1e-6)
        assert len(group["event"]) == by_hand.count("closes") + by_hand.count("opens")
    page = (folder / "orbit.html").read_text(encoding="utf-8")
    assert f"<td>{number(1e3 * told['largest_m'])}</td>" in page and "periodic" in page
    assert text(number(told["lost_in_contacts_J_per_period"])) in page and page.count("<img") == 1
    made = (folder / "orbit.h5").stat().st_mtime_ns
    assert main(["orbit", "case.toml", "-q"]) == 0 and (folder / "orbit.h5").stat().st_mtime_ns == made


def test_velocities_of_what_yields_beside_the_modes() -> None:
    """A read-out that follows a contact's force at once moves as fast as that changes: second order in the samples."""
    rub = {"interface": "right", "law": "smooth", "normal_force": 20.0, "normal_stiffness": 2e5, "friction": 0.2,
           "tangential_stiffness": 4e5, "points": [1, 1], "includes": "surface"}  # fmt: skip
    case = {"body": "vane", "excitation": "magnet", "amplitude": 1.0, "monitor": "probe", "modes": 2}
    e = equations.of(ms.assemble({**case, "contacts": [rub]}, vane=ms.sample()).assembly, 1.0)
    off = []
    for n in (100, 200):
        t = np.linspace(0.0, 1.0, n)
        none, force = np.zeros((n, 2)), np.sin(5 * t)[:, None] * np.ones(6)
        seen = Snapshot(none, none, np.zeros((n, 6)), force, np.zeros((n, 6)), np.zeros(n), t)
        still = samples.of_period(e, seen._replace(force=0 * force))["velocity"][0]
        told = samples.of_period(e, seen)["velocity"][0] - still
        off.append(np.abs(told + e.output_residual[0].sum() * 5 * np.cos(5 * t))[1:-1].max())
    assert e.output_residual[0].any() and off[1] < 0.3 * off[0] < 1e-3 * np.abs(e.output_residual).max()


def test_an_angle_is_told_in_rad(hammer: Path, capsys: pytest.CaptureFixture) -> None:
    """In sentence, table, page and file, where a monitor reads one."""
    basis = ms.read_basis(file := hammer / "build" / "hammer" / "basis.h5")
    for group in basis.groups.values():
        group.monitors.update({name: replace(rows, unit="rad") for name, rows in group.monitors.items()})
    ms.write_basis(file, basis)
    assert main(["orbit", "case.toml", "--no-pictures", "--set", "orbit.settle=2"]) == 0
    said, folder = capsys.readouterr().out, file.parent
    assert re.search("swings by [0-9.]+ .?rad on either side", said)
    assert "largest_rad,largest_velocity_rad_s" in (folder / "orbit.csv").read_text()
    assert "rad/s" in (folder / "orbit.html").read_text(encoding="utf-8")
    found = ms.load(folder / "orbit.h5")
    assert found.units == ("rad",) and found.to_xarray().velocity.attrs["units"] == "rad/s"


def test_pictures_are_left_out_when_asked_and_several_motions_stand_together(hammer: Path) -> None:
    folder = hammer / "build" / "hammer"
    assert main(["orbit", "case.toml", "-q", "--no-pictures"]) == 0
    assert not (folder / "pictures").exists() and "<img" not in (folder / "orbit.html").read_text(encoding="utf-8")
    assert main(["orbit", "case.toml", "-q", "--set", "orbit.Omega=[64.32, 30.84]", "--set", "orbit.settle=20"]) == 0
    names = {"phase_portraits.png", "orbit_1.png", "orbit_2.png"}
    assert {path.name for path in (folder / "pictures").iterdir()} == names  # no mesh, nothing that moves


@pytest.mark.slow
def test_chatter_is_said_with_its_impacts_and_drawn(hammer: Path, capsys: pytest.CaptureFixture) -> None:
    """At 9.845 rad/s with a contact that takes more: it comes to rest once a period, after as many impacts as the file
    lists between the longest flight and the rest."""
    set_ = [x for pair in (
        "orbit.Omega=9.845", "orbit.settle=5", "orbit.keep=4", 'contacts.0.law={kind="rough", damping=2e-4}',
    ) for x in ("--set", pair)]  # fmt: skip
    assert main(["orbit", "case.toml", *set_]) == 0
    told = re.search(r"face comes to rest after (\d+) impacts, (\d+) times", capsys.readouterr().out)
    with h5py.File(hammer / "build" / "hammer" / "orbit.h5") as file:
        event = file["motion_1"]["event"][:]
    meets = (event[:, 2] == 0).sum() / 4
    assert told and int(told[1]) == pytest.approx(meets, abs=1) and 3 <= int(told[2]) <= 4
    assert (hammer / "build" / "hammer" / "pictures" / "chatter_1_face.png").is_file()


def test_a_moving_body_for_paraview_moves_as_its_modes_do(tmp_path: Path) -> None:
    """Files over the last period, their times in s, displacements those of the modes: the tip follows the read-out."""
    basis = ms.read_basis(Path(ms.__file__).parent / "samples" / "basis.h5")
    group = basis.groups[min(basis.groups)]
    load, tip = Load("vane", "magnet", 1.0), int(np.argmax(np.abs(group.phi[:, 0, 0])))
    seen = Rows(group.phi[tip], ("u_x", "u_y", "u_z"), "m", basis.mesh.points[tip])
    vane = Component("vane", {0: replace(group, monitors={"tip": seen})})
    found = orbit.run(equations.of(Assembly((vane,), (), (load,), (Output("vane", "tip", "u_x"),)), 900.0), 2, 2, 64)
    at = np.arange(64, 128, 8)
    moved = np.einsum("pxm,fm->fpx", group.phi, classification.of_body(found, 0, at))
    first, *files = write_motion(basis, found.time[at], moved[:, None], tmp_path / "vane.pvd")
    times = [float(x) for x in re.findall(r'timestep="([^"]+)"', first.read_text())]
    np.testing.assert_array_equal(times, found.time[at])
    for file, read in zip(files, found.y[0][at], strict=True):
        mesh = meshio.read(file)
        nearest = np.argmin(np.linalg.norm(mesh.points - basis.mesh.points[tip], axis=1))
        assert mesh.point_data["displacement"][nearest, 0] == pytest.approx(
            read, rel=1e-6, abs=1e-6 * np.abs(moved).max()
        )


def test_all_sectors_of_a_cyclic_body_move_as_their_own_read_outs_say(tmp_path: Path) -> None:
    """Six sectors in a travelling wave: shapes turned into the ring's axes and put together meet the ties between
    neighbours, and their tips move as the monitors of the sectors do; the file for ParaView has all of them."""
    N, basis = 6, sector.basis()
    groups = {k: g for (_, k), g in basis.groups.items()}
    ring = Assembly(
        (Component("sector", groups, N),), (), (Load("sector", "gas", 1.0),), (Output("sector", "tip", "u_y"),),
        Ring(N, 1),
    )  # fmt: skip
    frequency = 0.4 * min(g.omega[0] for g in groups.values())
    found = orbit.run(equations.of(ring, float(frequency)), 2, 1, 16)
    moved = whole_ring(basis, groups, classification.of_body(found, 0, np.arange(16)))
    place = groups[0].monitors["tip"].point
    tip = int(np.argmin(np.linalg.norm(basis.mesh.points - place, axis=1)))
    size = np.abs(found.y).max()
    assert np.ptp(found.y, axis=1).min() > 0.1 * size
    np.testing.assert_allclose(moved[:, :, tip, 1].T, found.y, atol=1e-4 * size)
    for left, right in sector.partners(basis.mesh, N):
        np.testing.assert_allclose(moved[:, :, right], np.roll(moved[:, :, left], -1, axis=1), atol=1e-5 * size)
    first, *files = write_motion(basis, found.time[:2], moved[:2], tmp_path / "sector.pvd")
    written = meshio.read(files[1]).point_data["displacement"]
    assert len(files) == 2 and len(written) % N == 0
    assert np.abs(written).max() == pytest.approx(np.abs(moved[1]).max(), rel=1e-5)


def rigid(folder: Path, how: dict[str, Any]) -> None:
    """The hammer's contact made rigid."""
    other = {"normal_stiffness", "tangential_stiffness", "includes", "roughness", "interference", "law"}
    kept = [line for line in CASE.splitlines() if line.split(" =")[0] not in other]
    more = "\n".join(f"{key} = {value}" for key, value in how.items())
    (folder / "case.toml").write_text("\n".join(kept).replace("friction = 0.0", f"friction = 0.0\n{more}") + "\n")


@pytest.mark.parametrize(
    "how, gap, pressed, share",
    [
        ({"interference": -1e-4}, 1e-4, 0.0, 1e-9),
        pytest.param({"normal_force": 0.02}, 0.0, 0.02, 1e-5, marks=pytest.mark.slow),
    ],
)
def test_a_rigid_contact_of_a_case_is_that_of_the_same_system_by_hand(
    hammer: Path, how: dict[str, float], gap: float, pressed: float, share: float
) -> None:
    """Behind a gap, and pressed by a force that the vibration overcomes: it presses as a weight would, but for the
    second order in the step by which a force that kicks differs from one that flows."""
    rigid(hammer, {"law": '{ kind = "set-valued", restitution = 0.6 }', **how})
    assert main(["orbit", "case.toml", "-q", "--no-pictures", "--set", "orbit.settle=20"]) == 0
    found = ms.load(hammer / "build" / "hammer" / "orbit.h5")
    drive = STIFFNESS * 0.00047
    swing = ms.structure(
        MASS, STIFFNESS, 0.02046, force={0: drive}, steady={0: pressed},
        elements=[ms.stop(math.inf, gap, restitution=0.6)],
    )  # fmt: skip
    how_long = {"settle": 20, "keep": 4, "samples": 64, "steps": int(found.steps)}
    by_hand = ms.integrate(swing, 64.32, unit="rad/s", start="rest", **how_long)
    assert found.count("closes") > 3
    np.testing.assert_allclose(found.y[0], by_hand.y[0], atol=share * np.abs(found.y).max())
    assert np.abs(found.y[0]).max() > 1e-4 and found.balance < 1e-10


@pytest.mark.parametrize(
    "change, words",
    [
        ("contacts.0.normal_stiffness=1e6", "is rigid; leave normal_stiffness out"),
        ("contacts.0.interference=1e-6", "rigid bodies cannot overlap"),
        ("contacts.0.curvature=[0.1, 0.1]", "belongs to flat patches"),
        ('contacts.0.law={kind="set-valued", restitution=1.5}', "restitution: must not be greater than 1"),
        ('contacts.0.friction={kind="coulomb", mu=0.3, deviation=0.1}', "no heat and no chance"),
        ("sweep={start=5.0, stop=12.0}", 'contacts.face: law "set-valued" has no stiffness'),
    ],
)
def test_what_a_rigid_contact_has_no_use_for_is_refused(
    hammer: Path, capsys: pytest.CaptureFixture, change: str, words: str
) -> None:
    rigid(hammer, {"law": '"set-valued"', "interference": 0.0})
    verb = "respond" if "sweep" in change else "orbit"
    refused_command([verb, "case.toml", "-q", "--set", change], capsys, words)


@pytest.mark.parametrize(
    "change, words",
    [
        ("orbit.Omega=0.0", "orbit.Omega"),
        ("orbit.frequency=10.0", "give frequency (Hz) or Omega (rad/s)"),
        ("orbit.steps=20", "take"),
        ("orbit.keep=0", "orbit.keep"),
        ('springs.0.row="nope"', "there is no excitation 'nope'"),
        ("springs.0.motion=0.0", "excitation: give excitation"),
    ],
)
def test_what_an_orbit_cannot_do_is_refused(
    hammer: Path, capsys: pytest.CaptureFixture, change: str, words: str
) -> None:
    refused_command(["orbit", "case.toml", "-q", "--set", change], capsys, words)
    assert not (hammer / "build" / "hammer" / "orbit.csv").exists()


def test_laws_without_history_and_too_few_steps_are_refused() -> None:
    """A law of another package that says what force it has and not what it remembers; how many steps are needed."""

    @settings
    class Forgetful(Law):
        def step(self, u: Any, v: Any, dt: Any, state: Any) -> tuple[Any, Any]:
            return 3.0 * u, state

    mass = ms.structure(1.0, 1.0, 0.1, force={0: 1.0}, elements=[ms.Element(Forgetful(), 0, along="n")])
    refused("Forgetful has no init, slip, stored", ms.integrate, mass, 1.2, unit="rad/s", settle=0, keep=1)
    refused("take 158 or more", orbit.run, equations.of(hitting(BOOK), 40.0), 0, 1, steps=20)


def test_a_static_start_is_the_balance_of_steady_loads_and_contact() -> None:
    """Pressed by 2 N into a penalty spring beside its own: u = F / (k + c)."""
    base = hitting(patch(Penalty(value(3e5))))
    pressed = replace(base, loads=(Load("mass", "foot", 2.0, 0),))
    q, _ = orbit.begun(equations.of(pressed, 10.0), "static")
    e = equations.of(pressed, 10.0)
    assert (e.output @ q)[0] == pytest.approx(2.0 / (3e5 + STIFFNESS), rel=1e-9)
    assert jnp.isfinite(q).all()
    wedged = ms.structure(1.0, 1.0, 0.05, force={0: 1.0}, elements=[ms.stop(0.3, -0.2)])
    q, _ = orbit.begun(equations.of(wedged, 1.3), "static")
    assert q == pytest.approx(-0.06 / 1.3, rel=1e-9)


# starts ------------------------------------------------------------------------------------------------------------


def vane() -> Any:
    rub = {"normal_stiffness": 2e6, "tangential_stiffness": 4e6, "includes": "surface", "friction": 0.2}
    rub |= {"points": [2, 1], "normal_force": 20.0}
    sides = [{"interface": side, **rub} for side in ("right", "left")]
    case = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe", "contacts": sides}
    return balanced(ms.assemble(case, vane=ms.sample()), 15, 1024)


def two() -> Any:
    K = np.array([[2.0, -1.0], [-1.0, 2.0]])
    both = [ms.jenkins(1.0, 0.1, at=1), ms.stop(4.0, 0.5)]
    return ms.structure(np.eye(2), K, 0.05 * K, force={0: 0.3}, elements=both)


SYSTEMS: dict[str, tuple[Callable[[], Any], float]] = {
    "slider": (lambda: ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.2)]), 1.0),
    "spring": (lambda: ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[ms.polynomial({3: 0.05})]), 0.9),
    "stop": (lambda: ms.structure(1.0, 1.0, 0.1, force={0: 0.3}, elements=[ms.stop(2.0, 0.2)]), 0.8),
    "two": (two, 1.1),
    "vane": (vane, 2 * np.pi * 872),
}
"""Name -> how a system is made, and rad/s."""


@cache
def system(name: str) -> tuple[Any, float]:
    make, frequency = SYSTEMS[name]
    return make(), frequency


@pytest.mark.parametrize("name", ["slider", "spring", "stop", "two", pytest.param("vane", marks=pytest.mark.slow)])
def test_a_motion_begun_on_a_balance_is_periodic_from_its_first_period(name: str) -> None:
    """Begun at rest the second period differs from the first by half of the amplitude or more."""
    asked, frequency = system(name)
    found = ms.integrate(asked, frequency, unit="rad/s", settle=0, keep=2, samples=64, steps=2048, start="balance")
    first, second = np.split(found.y, 2, axis=1)
    size = np.abs(found.y).max(axis=1, keepdims=True)
    np.testing.assert_allclose(second / size, first / size, atol=2e-4)
    assert found.repeats == 1


SLOWER = [pytest.param(name, marks=pytest.mark.slow) for name in ("slider", "spring", "two", "vane")]


@pytest.mark.parametrize("name", ["stop", *SLOWER])
def test_first_harmonics_from_rest_are_those_of_harmonic_balance(name: str) -> None:
    """To 1e-4, where 400 periods have let the start die away."""
    asked, frequency = system(name)
    steps = 2048 if name == "vane" else 4096
    found = ms.integrate(asked, frequency, unit="rad/s", settle=250 if name == "vane" else 400, keep=1, steps=steps)
    many = {} if name == "vane" else {"harmonics": 25, "samples": 1024}  # the vane has 15 of its own
    amplitude = ms.harmonic_response(asked, [frequency], unit="rad/s", **many).amplitude[0]
    assert 2 / 256 * abs(np.fft.rfft(found.y[0])[1]) == pytest.approx(amplitude, rel=1e-4)


def test_contacts_remember_the_balance_that_a_motion_begins_on() -> None:
    """A slider that has not been dragged along the balance's motion stands elsewhere, and the motion is another."""
    slider, frequency = system("slider")[0], 1.2
    e = equations.of(slider, frequency)
    start = starts.of_balance(e, balanced(slider, 25, 400))
    s = Stepper(e, 2 * np.pi / frequency / 2048)
    led, fresh = starts.begun(s, start), s.start(start.q, start.v)
    assert abs(float(led.held.force[0] - fresh.held.force[0])) > 0.05
    assert float(led.held.force[0]) == pytest.approx(found_force(slider, frequency), abs=2e-3)


def test_a_start_on_few_harmonics_says_what_they_leave_out() -> None:
    """Of a slider: one harmonic misses the motion by as much as it says, within a factor of three; nine miss little."""
    slider, w = system("slider")
    few, many = (
        ms.integrate(balanced(slider, h, 16 * h), w, unit="rad/s", settle=0, keep=1, steps=1024, start="balance")
        for h in (1, 25)
    )
    (said,) = few.messages
    assert "with 1 harmonic leaves out about" in said and not many.messages
    told = starts.of_balance(few.equations, balanced(slider, 1, 16)).beside
    off = abs(few.q[:, 0] - many.q[:, 0]).max() / abs(many.q).max()
    assert off / 3 < told < 3 * off


def test_what_reads_rounding_alone_is_zero() -> None:
    """Of two equal masses pushed alike, their difference, summed up with rounding, and the sum itself."""
    q = np.outer(np.sin(np.linspace(0, 6, 50)), [1.0, 1.0 + 1e-14])
    output = np.array([[1.0, -1.0], [1.0, 1.0]])
    found = samples.without_rounding(q @ output.T, output, q)
    assert not found[:, 0].any()
    np.testing.assert_array_equal(found[:, 1], q.sum(axis=1))


def found_force(system: object, frequency: float) -> float:
    """N, of the only contact at t = 0, by 101 harmonics."""
    motion = ms.harmonic_response(system, [frequency], harmonics=101, unit="rad/s").motion(0)
    (force,) = motion.force.values()
    return float(force[0, 0] + force[0, 1::2].sum())


def test_a_start_that_presses_contacts_deeper_than_loads_do_is_refused() -> None:
    """Two micrometres of interference between a soft spring and a stiff stop: at rest nearly all of it is gone."""
    base = hitting(patch(Penalty(value(3e5))))
    tight = preloaded_contact("stop", base.contacts[0].patch, ContactFace("mass", "stop"), None, None, 2e-6)
    e = equations.of(replace(base, contacts=(tight,)), 64.32)
    with pytest.raises(UserError, match=r"stop 2e-06 m deep, where steady loads press it 6.6\d+e-10 m"):
        orbit.run(e, 0, 1, start="rest")
    depth = orbit.run(e, 0, 1, start="static").d[0, 0] + 2e-6
    assert abs(depth) < 1e-6


def test_what_runs_first_is_compiled_once() -> None:
    """What a motion begins with has the types of what it goes on with, whatever numbers a law makes its state of."""
    e = equations.of(hitting(SLIPS, normal=0.5), 300.0)
    s = Stepper(e, 2 * np.pi / 300.0 / 1024)
    begun = s.start(np.zeros(3), np.zeros(3))
    now, seen, *_ = s.run(begun, np.full(64, 16))
    assert not any(x.weak_type for x in jax.tree_util.tree_leaves(begun))
    assert jax.tree.map(jax.typeof, begun) == jax.tree.map(jax.typeof, now)
    made = len(loop.run.made)
    fewer = s.run(begun, np.full(10, 64), rows=16)[1]  # the first six again after the last of ten
    assert len(loop.run.made) == made and len(fewer.time) == 10
    np.testing.assert_allclose(fewer.time, seen.time[27::4], rtol=1e-12)
    np.testing.assert_allclose(fewer.q, seen.q[27::4], rtol=0, atol=1e-12 * np.abs(seen.q).max())


@pytest.mark.slow
def test_a_case_begins_on_its_balance(hammer: Path) -> None:
    """One period is enough, where there is no impact."""
    words = ["orbit", "case.toml", "-q", "--set", "contacts.0.interference=-1.0", "--set", "orbit.settle=0"]
    assert main([*words, "--set", 'orbit.start="balance"', "--set", "orbit.Omega=30.0"]) == 0
    found = ms.load(hammer / "build" / "hammer" / "orbit.h5")
    assert found.repeats == 1
    size = STIFFNESS * FOOT / abs(STIFFNESS - MASS * 30.0**2 + 30.0j * DAMPING)
    assert np.abs(found.y[0]).max() == pytest.approx(size, rel=2e-3)


# run-up ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("first, last", [(0.5, 1.5), (1.5, 0.5)])
def test_a_run_up_is_that_of_a_fine_integration_in_second_order(first: float, last: float) -> None:
    """x'' + 0.05 x' + x = cos psi, psi' linear: the peak lags behind 1 rad/s and is lower than the steady one, 20."""
    one, duration, errors = ms.structure(1.0, 1.0, 0.05, force={0: 1.0}, output=0), 200.0, []
    a = (last - first) / duration

    def rate(t: float, z: np.ndarray) -> list[float]:
        s = min(t, duration)
        return [z[1], np.cos(first * s + 0.5 * a * s**2 + last * (t - s)) - z[0] - 0.05 * z[1]]

    exact = None
    for steps in (256, 512):
        found = ms.run_up(one, first, last, duration, unit="rad/s", samples=64, steps=steps)
        t = found.time
        if exact is None:
            exact = solve_ivp(rate, (0, t[-1]), [0, 0], "DOP853", t, rtol=1e-11, atol=1e-12).y
        errors.append(np.abs(found.y[0] - exact[0]).max() / np.abs(exact[0]).max())
        np.testing.assert_allclose(found.v[0], exact[1], atol=1e-4 * np.abs(exact[1]).max())
    assert errors[0] < 5e-6 and errors[1] == pytest.approx(errors[0] / 4, rel=0.02)
    assert found.balance < 1e-11 and 10 < np.abs(found.y).max() < 14
    met = 2 * np.pi * found.frequency[np.abs(found.y[0]).argmax()]
    assert (met - 1.0) * np.sign(last - first) > 0.1 and found.said.startswith("run-up" if last > first else "run-down")


def test_centrifugal_loads_follow_the_square_of_the_speed_and_bodies_feel_its_change() -> None:
    """A heavy body on a stiff spring is where the loads put it: x = row n^2 + euler n'; engine order 2."""
    e0 = hitting(patch(Penalty(value(3e5)))).components[0].groups[0]
    euler = 3.0 * e0.excitations["foot"].rows[0]
    m = len(e0.M_r)
    turning = RunUp(np.zeros((m, m)), np.zeros((m, m)), euler, np.zeros(m))
    rows = {**e0.excitations, "spin": replace(e0.excitations["foot"], unit=CENTRIFUGAL)}
    group = replace(e0, excitations=rows, run_up=turning, C_r=e0.C_r + 4 * np.eye(m))
    loads = (Load("mass", "spin", 1e4, 0),)
    free = Assembly((Component("mass", {0: group}),), (), loads, (Output("mass", "mass", "u_x"),))
    found = ms.run_up(free, 2.0, 4.0, 20.0, order=2, euler=("mass",), samples=32)
    speed = np.pi * found.frequency
    rising = 2 * np.pi * 0.1 / 2
    late = (found.time > 8.0) & (found.time < 20.0)
    np.testing.assert_allclose(found.y[0][late], (speed**2 + 3 * rising)[late] / STIFFNESS, rtol=0.02)
    without = ms.run_up(free, 2.0, 4.0, 20.0, order=2, samples=32)
    np.testing.assert_allclose((found.y - without.y)[0][late], 3 * rising / STIFFNESS, rtol=1e-3)
    refused("no body 'other'", ms.run_up, free, 2.0, 4.0, 1.0, euler=("other",))
    bare = replace(free, components=(Component("mass", {0: replace(group, run_up=None)}),))
    refused("has no Euler load", ms.run_up, bare, 2.0, 4.0, 1.0, euler=("mass",))


def test_a_case_runs_up_into_its_stop(hammer: Path, capsys: pytest.CaptureFixture) -> None:
    """What it says is in the file, with the frequency of every sample; what belongs to one frequency is refused."""
    case = hammer / "case.toml"
    case.write_text(case.read_text().split("Omega = 64.32")[0] + "run_up = { start = 3.0, stop = 8.0, time = 3.0 }\n")
    assert main(["orbit", "case.toml", "-q"]) == 0
    found = ms.load(hammer / "build" / "hammer" / "orbit.h5")
    assert found.frequency[0] == pytest.approx(3.0, abs=0.01) and found.frequency[-1] == pytest.approx(8.0, abs=1e-9)
    assert found.said in (hammer / "build" / "hammer" / "orbit.html").read_text(encoding="utf-8")
    assert found.said.startswith("run-up from 3 Hz to 8 Hz, largest at ")
    assert found.count("closes") > 5 and found.balance < 1e-8 and found.drift < 1e-2
    assert found.cycles == pytest.approx(16.5, rel=2e-3)  # by its phase, where the highest frequency has 24 periods
    assert found.impacts == found.count("closes") / found.cycles
    lost = found.energy["lost"]
    assert classification.lost(found) == pytest.approx(float(lost[-1] - lost[0]) / found.cycles)
    for change in ("orbit.keep=3", "orbit.frequency=3.0", 'orbit.start="balance"', "orbit.run_up.stop=3.0"):
        refused_command(["orbit", "case.toml", "-q", "--set", change], capsys, "orbit")


# files -------------------------------------------------------------------------------------------------------------

SLIPS = patch(Penalty(value(2e5)), mu=0.3, stiffness=1e5)
ARRAYS = ("time", "y", "v", "q", "q_dot", "d", "force", "events")


def same(a: orbit.Orbit, b: orbit.Orbit) -> None:
    """To the last bit."""
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    for name, values in a.energy.items():
        np.testing.assert_array_equal(values, b.energy[name], err_msg=name)
    for name in ("Omega", "labels", "contacts", "samples", "steps", "missed", "error", "diverged", "messages"):
        np.testing.assert_equal(getattr(a, name), getattr(b, name), err_msg=name)
    np.testing.assert_equal((a.said, a.repeats, a.drift, a.balance), (b.said, b.repeats, b.drift, b.balance))


def test_a_motion_is_saved_and_read_with_all_that_it_says(tmp_path: Path) -> None:
    found = orbit.run(equations.of(hitting(SLIPS, normal=0.5, push=1.5), 300.0), 2, 3, 64, 2048)
    loaded = ms.load(found.save(tmp_path / "motion.h5"))
    same(found, loaded)
    with pytest.raises(UserError, match="integrate the assembly again"):
        loaded.equations  # noqa: B018
    table, data = loaded.to_dataframe(), loaded.to_xarray()
    assert len(table) == 3 * 64 and table["mass u_x_m"].iloc[-1] == found.y[0, -1]
    assert data["displacement"].sel(read_out="mass u_y").values[-1] == found.y[1, -1]
    assert (data["event_kind"].values == "slips").sum() == found.count("slips") > 0
    assert data["contact_force"].attrs["units"] == "N, N m" and set(data["event_contact"].values) == {"stop"}
    np.testing.assert_allclose(loaded.plot().lines[0].get_xdata(), 1e6 * found.y[0])


def test_what_sticks_begins_no_slip_by_rounding() -> None:
    """Pressed by 0.5 N and driven so little that nothing slides: where the way turns along one of its axes, the step
    along it is smaller than what rounding leaves of the path slid."""
    found = orbit.run(equations.of(hitting(SLIPS, normal=0.5, push=0.05), 300.0), 0, 30, 64, 4096)
    assert found.energy["lost"][-1] < 1e-9 * np.ptp(found.energy["stored"])
    assert found.count("slips") == 0 and found.count("sticks") == 0


@pytest.mark.usefixtures("untried")
def test_what_is_no_whole_file_of_one_motion_is_refused(tmp_path: Path) -> None:
    path = orbit.run(equations.of(hitting(SLIPS, normal=0.5), 300.0), 0, 1, 64).save(tmp_path / "motion.h5")
    data = path.read_bytes()
    for spoilt, words in ((data[: len(data) // 2], "damaged"), (data[:-200] + data[-123:], "damaged")):
        (tmp_path / "bad.h5").write_bytes(spoilt)
        refused(words, ms.read_orbits, tmp_path / "bad.h5")
    with h5py.File(path, "r+") as file:
        del file["motion_1/energy_lost"]
    refused("incomplete", ms.load, path)
    refused("no such file", ms.read_orbits, tmp_path / "none.h5")


class Killed(Exception):
    pass


@pytest.mark.parametrize("at", [pytest.param(12, marks=pytest.mark.slow), 22, 30])
def test_a_run_that_is_ended_goes_on_with_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at: int
) -> None:
    """While it settles, while samples are kept, and after the last one; two motions in the file, one of them whole."""
    for module in (recorded, orbit):
        monkeypatch.setattr(module, "PAUSE", 0.0)
    e = equations.of(hitting(SLIPS, normal=0.5, push=1.5), 300.0)
    asked = [recorded.Integration(name, e, 16, 14, 64, 1024) for name in ("first", "second")]
    seen: list[str] = []

    def killing(text: str) -> None:
        seen.append(text)
        if text.startswith(f"{at} of 30 periods, ") and text.endswith(", second"):
            raise Killed

    with pytest.raises(Killed):
        recorded.run(tmp_path / "orbit.h5", asked, report=killing)
    assert not (tmp_path / "orbit.h5").exists()
    told: list[str] = []
    found = recorded.run(tmp_path / "orbit.h5", asked, report=told.append)
    assert not any(text.endswith("first") or text.startswith(f"{at} of ") for text in told)
    periods: list[str] = []
    whole = orbit.run(e, 16, 14, 64, 1024, report=periods.append)
    assert [text for text in told if text.startswith("30 of")] in ([], [f"{periods[-1]}, second"]), (
        "events are counted on"
    )
    for one in found:
        same(whole, one)
    assert [p.name for p in tmp_path.iterdir()] == ["orbit.h5"] and ms.read_orbits(tmp_path / "orbit.h5")[1].error > 0


def test_another_motion_is_begun_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the one that was left is of another frequency."""
    monkeypatch.setattr(recorded, "PAUSE", 0.0)
    asked = [(equations.of(hitting(SLIPS, 0.5), w), 0, 12, 64, 1024) for w in (300.0, 310.0)]
    one, other = (recorded.Integration("it", *each) for each in asked)

    def killing(text: str) -> None:
        raise Killed

    with pytest.raises(Killed):
        recorded.run(tmp_path / "orbit.h5", [one], report=killing)
    same(orbit.run(other.equations, 0, 12, 64, 1024), recorded.run(tmp_path / "orbit.h5", [other])[0])


@pytest.mark.slow
def test_a_long_motion_needs_no_more_memory_than_a_short_one(tmp_path: Path) -> None:
    """While it is computed, and for what it says of itself."""
    e, peaks = equations.of(hitting(BOOK), 64.32), []
    for keep in (4, 128):
        tracemalloc.start()
        found = recorded.run(tmp_path / f"{keep}.h5", [recorded.Integration("it", e, 0, keep, 1024, 1024)])[0]
        assert found.balance < 1e-8 and found.said
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    whole = 128 * 1024 * sum(sizes_of(e)) * 8
    assert peaks[1] < 0.5 * whole and (tmp_path / "128.h5").stat().st_size > whole


def sizes_of(e: equations.MotionEquations) -> list[int]:
    rows = samples.sizes(e)
    return [rows.get(name, 1) for name in samples.UNITS]


def test_a_motion_has_the_same_bits_however_many_periods_are_done_in_a_call() -> None:
    """How many are depends on how fast the machine is."""
    s = Stepper(equations.of(ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.2)]), 0.8), 0.01)
    ends = []
    for calls in ((5,), (1, 4), (1, 1, 3)):
        now = s.start(np.zeros(1), np.zeros(1))
        for many in calls:
            now, *_ = s.run(now, np.where(np.arange(8) < many, 785, 0))
        ends.append(jax.tree.map(np.asarray, now))
    for end in ends[1:]:
        assert jax.tree.all(jax.tree.map(np.array_equal, end, ends[0]))


def test_an_error_made_early_is_seen_at_the_end() -> None:
    """A start swings against a stop, which the steady vibration does not reach: the last periods miss nothing, and
    the estimate is about what a finer motion differs by."""
    hammer = ms.structure(1.0, 1.0, 0.1, force={0: -1.0}, elements=[ms.stop(25.0, 0.5)])
    found, exact = (
        ms.integrate(hammer, 2.0, unit="rad/s", settle=0, keep=40, samples=64, steps=n, start="rest")
        for n in (64, 2048)
    )
    closes = found.times("closes")
    assert len(closes) and closes.max() < 0.5 * found.time[-1]
    off = np.abs(found.y - exact.y).max() / np.abs(exact.y).max()
    assert off < found.error < 30 * off


KILLED = """
import sys
import numpy as np
from microslip.time_domain import equations, orbit, recorded, samples
import microslip as ms
recorded.PAUSE = orbit.PAUSE = 0.0
slider = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.2)])
asked = recorded.Integration("it", equations.of(slider, 0.8), 5, 400, 16, 512)
recorded.run(sys.argv[1], [asked], report=lambda text: print(text, flush=True))
"""


@pytest.mark.slow
def test_a_killed_process_leaves_what_the_next_one_goes_on_with(tmp_path: Path) -> None:
    """SIGKILL at two instants. Each period is reported, so that how fast the machine is decides nothing."""
    words = [sys.executable, "-c", KILLED, str(tmp_path / "orbit.h5")]
    for period in (50, 200):
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert ("goes on from" in next(process.stdout)) == (period > 50)
            assert any(text.startswith(f"{period} of ") for text in process.stdout)
            process.kill()
        assert not (tmp_path / "orbit.h5").exists()
    e, told = equations.of(system("slider")[0], 0.8), list[str]()
    recorded.run(tmp_path / "orbit.h5", [recorded.Integration("it", e, 5, 400, 16, 512)], report=told.append)
    assert "goes on from" in told[0]
    same(orbit.run(e, 5, 400, 16, 512), ms.load(tmp_path / "orbit.h5"))


def test_a_motion_that_diverges_keeps_what_was_computed_and_says_why(tmp_path: Path) -> None:
    """x'' - x' + x = cos t grows as exp(t / 2)."""
    growing = ms.structure(1.0, 1.0, -1.0, force={0: 1.0}, output=0)
    found = ms.integrate(growing, 1.0, unit="rad/s", settle=0, keep=200, file=tmp_path / "orbit.h5")
    assert 600 < found.diverged < 2 * np.log(1e155) and "its energy was" in found.messages[0]
    assert found.time[-1] == found.diverged and np.isfinite(found.y).all() and found.y.shape[1] == len(found.time)
    same(ms.integrate(growing, 1.0, unit="rad/s", settle=0, keep=200), found)


@pytest.mark.parametrize("call", [partial(ms.integrate, frequency=1.0), partial(ms.run_up, start=1, stop=2, time=9.0)])
def test_a_motion_replaces_no_file_of_another_kind(call: Callable[..., Any], tmp_path: Path) -> None:
    """It is refused before there is work."""
    notes, told = tmp_path / "notes.txt", list[str]()
    notes.write_text("mine")
    beam = ms.structure(1.0, 1.0, 0.1, force={0: 1.0}, output=0)
    refused("notes.txt: is there already and is text", call, beam, file=notes, report=told.append)
    assert notes.read_text() == "mine" and not told and [p.name for p in tmp_path.iterdir()] == ["notes.txt"]


def test_a_case_that_diverges_ends_with_exit_code_1(hammer: Path, capsys: pytest.CaptureFixture) -> None:
    """Its body takes energy from nowhere: a damper with the wrong sign."""
    basis = ms.read_basis("build/hammer/basis.h5")
    group = basis.groups[0, 0]
    ms.write_basis("build/hammer/basis.h5", replace(basis, groups={(0, 0): replace(group, C_r=group.C_r - 500.0)}))
    words = ["orbit", "case.toml", "-q", "--set", "contacts.0.interference=-1.0", "--set", "orbit.settle=0"]
    assert main([*words, "--set", "orbit.keep=30"]) == 1
    assert "diverged" in capsys.readouterr().err
    page = (hammer / "build" / "hammer" / "orbit.html").read_text(encoding="utf-8")
    assert "its energy was" in page
    assert len(ms.load(hammer / "build" / "hammer" / "orbit.h5").time) > 200


@pytest.mark.parametrize("damping", ["modal", "structural"])
def test_loss_factors_in_time_are_told(damping: str) -> None:
    """They are dampers there, that take as much at the first harmonic alone."""
    rub = {"interface": "right", "law": "smooth", "normal_force": 20.0, "normal_stiffness": 2e5, "friction": 0.2,
           "tangential_stiffness": 4e5, "points": [1, 1]}  # fmt: skip
    case = {"body": "vane", "excitation": "magnet", "amplitude": 1.0, "monitor": "probe", "modes": 2, "contacts": [rub]}
    built = ms.assemble({**case, "damping": damping}, vane=ms.sample())
    found = ms.integrate(built, 300.0, settle=0, keep=1, samples=64)
    assert any("at 300 Hz" in text for text in found.messages) == (damping == "structural")


# starts --------------------------------------------------------------------------------------------------------------


def pair() -> ms.Assembly:
    """Two masses between three springs, whose modes are 1 and sqrt 3 rad/s."""
    return ms.structure(np.eye(2), np.array([[2.0, -1.0], [-1.0, 2.0]]), output=[0, 1])


def test_a_motion_begins_at_a_displacement_a_velocity_or_in_a_mode() -> None:
    """Against the closed form in both modes."""
    how = {"unit": "rad/s", "settle": 0, "keep": 1, "samples": 64}
    found = ms.integrate(pair(), 1.0, start={"displacement": [1.0, 0.5], "velocity": {1: 0.3}}, **how)
    w, t = np.sqrt([1.0, 3.0])[:, None], found.time
    q, v = np.array([[0.75], [0.25]]), np.array([[0.15], [-0.15]])
    modes = q * np.cos(w * t) + v / w * np.sin(w * t)
    np.testing.assert_allclose(found.y, [modes[0] + modes[1], modes[0] - modes[1]], atol=1e-12)
    second = ms.integrate(pair(), 1.0, start={"mode": 2, "amplitude": 0.1}, **how)
    np.testing.assert_allclose(second.y, 0.1 * np.array([[1.0], [-1.0]]) * np.cos(w[1] * t), atol=1e-12)


@pytest.mark.parametrize(
    "start",
    [
        {"mode": 3, "amplitude": 1.0}, {"mode": 1.5, "amplitude": 1.0}, {"mode": 1}, {"place": [1.0, 1.0]},
        {"displacement": [1.0]}, {"displacement": "far"}, {"displacement": {5: 1.0}}, {"velocity": {0: "fast"}},
        {"mode": 1, "amplitude": 1.0, "velocity": [1.0, 1.0]}, {"displacement": [math.nan, 0.0]},
    ],
)  # fmt: skip
def test_a_start_that_is_none_is_refused_by_its_key(start: dict) -> None:
    refused("start: ", ms.integrate, pair(), 1.0, start=start)


def test_a_case_lets_its_bodies_go_without_an_excitation(hammer: Path, capsys: pytest.CaptureFixture) -> None:
    (hammer / "case.toml").write_text((hammer / "case.toml").read_text().replace("motion = ", "# motion = "))
    refused_command(["orbit", "case.toml", "-q"], capsys, "give excitation")
    let_go = ["--set", "orbit.release={mode=1, amplitude=-1e-5}", "--set", "orbit.settle=0", "--no-pictures", "-q"]
    assert main(["orbit", "case.toml", *let_go]) == 0
    (found,) = ms.read_orbits(hammer / "build" / "hammer" / "orbit.h5")
    assert found.y[0, 0] == pytest.approx(-1e-5, rel=0.1) and found.count("closes") > 0
    no_mode = ["--set", "orbit.release={mode=99, amplitude=1e-5}", "-q"]
    refused_command(["orbit", "case.toml", *no_mode], capsys, "release: mode")


def test_many_starts_tell_their_exponents_and_velocities() -> None:
    """Of a slider that holds: -c / 2 within the interval; read-outs are those of a motion alone."""
    held = ms.structure(1.0, 1.0, 0.1, force={0: 0.3}, elements=[ms.jenkins(1.0, 10.0)], output=0)
    how = {"unit": "rad/s", "settle": 10, "keep": 40}
    found = ms.integrate_many(held, 1.0, [[0.1], [0.4]], [[0.0], [0.2]], exponents=True, **how)
    for one in found.exponents:
        assert abs(one.value + 0.05) < 2 * one.uncertainty < 0.02 and one.sign == -1
    alone = ms.integrate(held, 1.0, start={"displacement": [0.4], "velocity": [0.2]}, steps=found.steps, **how)
    np.testing.assert_allclose(found.y[1, -1], alone.y[:, -1], atol=1e-12)
    np.testing.assert_allclose(found.y_dot[1, -1], alone.v[:, -1], atol=1e-12)
    with pytest.raises(UserError, match="exponents: take 40 periods"):
        ms.integrate_many(held, 1.0, [[0.1]], [[0.0]], settle=1, keep=2, exponents=True)


@pytest.mark.slow
def test_many_chaotic_starts_have_the_exponent_of_duffings_oscillator() -> None:
    """0.1556 1/s by its variational equation from 256 starts, of the damping 0.25 and the push 0.4."""
    duffing = ms.structure(1.0, -1.0, 0.25, force={0: 0.4}, elements=[ms.polynomial({3: 1.0})], output=0)
    x = np.random.default_rng(0).uniform(-1.0, 1.0, (12, 1))
    found = ms.integrate_many(duffing, 1.0, x, 0 * x, unit="rad/s", settle=80, keep=100, exponents=True)
    values = np.array([one.value for one in found.exponents])
    assert np.mean(values) == pytest.approx(0.1556, abs=3 * np.std(values) / np.sqrt(len(values)))
    assert all(one.sign == 1 for one in found.exponents)


def test_extremes_of_a_table_lie_between_its_samples() -> None:
    from microslip.verbs.orbit import _row

    swing = ms.structure(1.0, 1.0, 0.2, force={0: 0.2}, output=0)
    row = _row(ms.integrate(swing, 1.0, unit="rad/s", settle=40, keep=1, samples=32))
    assert row["largest_m"] == pytest.approx(1.0, abs=1e-5) and row["smallest_m"] == pytest.approx(-1.0, abs=1e-5)

"""Damping of bodies that stick together: what their own modes, their material or the stuck modes take."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusals import refused
from test_case_driving import built as ring_of

from microslip.case import load_case
from microslip.case.assemble import Built, build
from microslip.case.problem import problem_of
from microslip.cli import main
from microslip.data import Array
from microslip.harmonic_balance import response
from microslip.harmonic_balance.reduced import stuck, stuck_damping
from microslip.harmonic_balance.solver import solve
from microslip.results import read_response
from microslip.system import Body, Contact, Force, Monitor, Spring, System
from microslip.system.assembly import stuck_modes

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

N, STIFF, RATIO = 4, 1e6, 1e-3
CASE = """
name = "strips"
harmonics = 1
{more}
[[excitations]]
row = "free:push"
amplitude = 0.2
[[monitors]]
monitor = "free:end"
[[bodies]]
name = "{first}"
{each}
[[bodies]]
name = "{second}"
{each}
[[contacts]]
interface = "clamped:joint"
against = "free:joint"
law = "smooth"
normal_stiffness = {joint}
tangential_stiffness = 1.0
friction = 0.3
points = [1, 1]
includes = "surface"
width = 0.01
height = 0.01
[sweep]
start = 10.0
stop = 60.0
points = 5
normal_forces = [1e3]
"""


def strip(name: str) -> System:
    """A bar as N masses of 1 kg with springs between them, held at its left end or free; a joint, where it goes on."""
    masses = [Body(f"m{i}", 1.0, (float(i), 0, 0), free="x") for i in range(N)]
    springs = [Spring(f"m{i}", f"m{i + 1}", STIFF) for i in range(N - 1)]
    if name == "clamped":
        springs.append(Spring("ground", "m0", STIFF, axis=(1, 0, 0)))
        face = Contact("joint", f"m{N - 1}", (1, 0, 0), t2=(0, 0, 1))
    else:
        face = Contact("joint", "m0", (-1, 0, 0), t2=(0, 0, 1))
    push, end = Force("push", f"m{N - 1}", (1, 0, 0)), Monitor("end", f"m{N - 1}")
    return System(name, masses, springs, [face], [push], [end], ratio=RATIO)


BASES = {name: strip(name).basis() for name in ("clamped", "free")}


def strips(tmp_path: Path, more: str = "", joint: float = STIFF, order: tuple[str, str] = ("clamped", "free"),
           each: str = "") -> Built:  # fmt: skip
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(more=more, joint=joint, first=order[0], second=order[1], each=each))
    return build(load_case(path)[0], BASES)


def damping(b: Built, normal: float | None = 1e3) -> tuple[Array, Array]:
    a = b.pressed(normal)
    return stuck(a.joined(1), a.stiffness), stuck_damping(a.joined(1), a.stiffness)


def chain() -> tuple[Array, Array]:
    """Frequencies in Hz of the 2 N masses on a row of equal springs, and what share of the energy the joint's has."""
    n, j = 2 * N, np.arange(1, 2 * N + 1)
    angle = (2 * j - 1) * np.pi / (2 * n + 1)
    u = np.sin(angle[:, None] * np.arange(n + 1))
    stretch = np.diff(u, axis=1) ** 2
    return np.sqrt(STIFF) * 2 * np.sin(angle / 2) / (2 * np.pi), stretch[:, N] / stretch.sum(axis=1)


def test_a_clamped_and_a_free_strip_stuck_together(tmp_path: Path) -> None:
    """Structural: D times the share of the energy that is the strips' and not the joint's, all of it in a stiff joint;
    of the bodies' own modes: what the rigid motion of the free strip does not damp is lost; stuck: what was asked."""
    f, joint = chain()
    found = damping(strips(tmp_path))
    np.testing.assert_allclose(found[0], f, rtol=1e-9)
    np.testing.assert_allclose(found[1], RATIO * (1 - joint), rtol=1e-9)
    stiff = damping(strips(tmp_path, joint=1e6 * STIFF))[1]
    np.testing.assert_allclose(stiff[:-1], RATIO, rtol=1e-5)
    own = damping(strips(tmp_path, 'damping = "modal"', joint=1e6 * STIFF))[1]
    assert own[0] < 0.6 * RATIO
    asked = damping(strips(tmp_path, 'damping = "stuck"\ndamping_ratio = [0.002, 0.003]'))[1]
    np.testing.assert_allclose(asked, [0.002, *[0.003] * (2 * N - 1)], rtol=1e-9)


def test_what_the_modes_leave_out_loses_its_share_too(tmp_path: Path) -> None:
    """Two modes a bar, the rest of its compliance beside them: D times the energy that is not the joint's, 1e-9."""
    b = strips(tmp_path, each="modes = 2")
    a = b.pressed(1e3)
    part, k = a.joined(1), a.stiffness
    assert np.abs(part.residual).max() > 1e-8
    values, shapes = stuck_modes(part, k)
    d = np.linalg.solve(np.eye(len(k)) + part.residual @ k, part.rows @ shapes)
    joint = np.einsum("im,ij,jm->m", d, k, d) / values
    np.testing.assert_allclose(damping(b)[1], RATIO * (1 - joint), rtol=1e-9)


@pytest.mark.parametrize(
    ("more", "each"),
    [("", ""), ("", "modes = 2"), ('damping = "stuck"\ndamping_ratio = 0.001', ""), ('damping = "modal"', "")],
)
def test_half_power_width_of_a_computed_resonance(tmp_path: Path, more: str, each: str) -> None:
    """|Im a| / |a|^2 of the read-out is 2 D (f/f_0) k, so the two frequencies of half the power are 2 D f apart: 1e-4,
    what the other modes and D^2 leave; the loads supply what the bodies lose: 1e-9."""
    b = strips(tmp_path, more, each=each)
    f, D = (v[0] for v in damping(b))
    problem, half = problem_of(b, 1e3), f * (1 + D * np.linspace(-1.5, 1.5, 21))
    points = [solve(problem, 2 * np.pi * at, []) for at in half]
    assert all(p.converged for p in points)
    found = [response.operating(problem, p) for p in points]
    power = np.array([abs(o.outputs[0, 1]) ** 2 for o in found])
    inverse = np.polynomial.Polynomial.fit(half, 1 / power, 2)  # of one mode a parabola
    low, high = (inverse - 2 * inverse(inverse.deriv().roots()[0])).roots()
    assert high - low == pytest.approx(2 * D * f, rel=2e-3)
    np.testing.assert_allclose([o.damped for o in found], [o.supplied for o in found], rtol=1e-8)


@pytest.mark.parametrize("more", ["", 'damping = "stuck"\ndamping_ratio = 0.001', 'damping = "modal"'])
def test_the_order_of_the_bodies_says_nothing(tmp_path: Path, more: str) -> None:
    a, b = (strips(tmp_path, more, order=o) for o in (("clamped", "free"), ("free", "clamped")))
    np.testing.assert_allclose(damping(a)[1], damping(b)[1], rtol=1e-8)
    at = 2 * np.pi * float(damping(a)[0][0])
    one, other = (response.operating(p, solve(p, at, [])).outputs[0] for p in (problem_of(x, 1e3) for x in (a, b)))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * np.abs(one).max())


@pytest.mark.slow
@pytest.mark.parametrize("more", ['damping = "structural"', 'damping = "stuck"\ndamping_ratio = 0.02'])
def test_a_sector_and_the_whole_ring_are_damped_alike(tmp_path: Path, more: str) -> None:
    """Every stuck mode of the wave is one of the ring's with the same damping, 1e-9; in slip all blades answer as the
    sector does, 1e-8, whichever way the ring is eliminated."""
    load = '[[excitations]]\nrow = "gas"\namplitude = 4.0\n'
    one, whole = (ring_of(tmp_path, load, f'engine_order = 2\nmodel = "{m}"', f"{more}\n") for m in ("sector", "full"))
    small, large = (coarse(x) for x in (one, whole))
    (f, D), (F, E) = damping(one, 20.0), damping(whole, 20.0)
    for at, ratio in zip(f, D, strict=True):
        near = np.isclose(F, at, rtol=1e-9)
        assert near.any() and np.isclose(E[near], ratio, rtol=1e-6).any()
    Omega = 2 * np.pi * 60.0
    x, y = (response.operating(p, solve(p, Omega, [])) for p in (small, large))
    turned = x.outputs[0] * np.exp(2j * np.pi * np.arange(2) * 2 * np.arange(12)[:, None] / 12)
    np.testing.assert_allclose(y.outputs, turned, rtol=0, atol=1e-8 * np.abs(turned).max())
    assert y.damped == pytest.approx(12 * x.damped, rel=1e-8)


def coarse(b: Built):  # type: ignore[no-untyped-def]
    return problem_of(b, 20.0, harmonics=1, samples=40, periodicity=1e-13)


def test_bodies_that_slide_freely_keep_their_own_damping(tmp_path: Path) -> None:
    """Without friction and pressure nothing joins the strips: the free one's first elastic mode has its D, 1e-6."""
    b = strips(tmp_path)
    part = replace(b.assembly, contacts=()).joined(1)
    f, D = stuck(part, np.zeros((0, 0))), stuck_damping(part, np.zeros((0, 0)))
    np.testing.assert_allclose(D, np.where(f > 1e-3, RATIO, 0.0), rtol=1e-6, atol=1e-15)


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_what_the_command_line_says_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every stuck mode with damping and width in the summary and the response file; steps wider than a resonance of the
    stuck modes are told; mistakes end with 2."""
    from microslip.basis import write_basis

    monkeypatch.chdir(tmp_path)
    for name, basis in BASES.items():
        (tmp_path / "build" / name).mkdir(parents=True)
        write_basis(tmp_path / "build" / name / "basis.h5", basis)
    case = tmp_path / "case.toml"
    case.write_text(CASE.format(more="", joint=STIFF, first="clamped", second="free", each=""))
    assert main(["respond", "case.toml", "-q"]) == 0
    summary = json.loads((tmp_path / "build/strips/response.json").read_text())
    f, joint = chain()
    rows = summary["stuck_modes"]
    np.testing.assert_allclose([r["damping_ratio"] for r in rows], (RATIO * (1 - joint))[: len(rows)], rtol=1e-9)
    width = 2 * RATIO * (1 - joint[0]) * f[0]
    assert rows[0]["half_power_width_Hz"] == pytest.approx(width, rel=1e-9)
    assert any("half-power width" in s and f"{width:.3g} Hz" in s for s in summary["messages"])
    assert list(read_response(tmp_path / "build/strips/response.h5").stuck_modes) == rows
    for key, value in (("damping", "stuck"), ("damping", "viscous"), ("damping_ratio", "-0.1")):
        assert main(["respond", "case.toml", "--set", f"{key}={value}", "-q"]) == 2
    refused("damping_ratio", strips, tmp_path, 'damping = "stuck"')
    refused("write a number as damping_ratio", strips, tmp_path, "damping = 0.02")


def test_stuck_damping_says_what_open_contacts_make_of_it(tmp_path: Path) -> None:
    """phi^T C phi / (2 omega) of the bars without a joint, ten times what was asked for, stands in a message."""
    from microslip.case.messages import of_stuck_modes

    b = strips(tmp_path, 'damping = "stuck"\ndamping_ratio = 0.001', joint=100 * STIFF)
    part = b.pressed(1e3).joined(1)
    values, shapes = np.linalg.eigh(part.K)
    omega = np.sqrt(np.maximum(values, 0.0))
    D = np.einsum("im,ij,jm->m", shapes, part.C, shapes) / np.maximum(2 * omega, 1.0)
    most = D[(omega > 1.0) & (omega < 2 * np.pi * 60.0)].max()
    (said,) = of_stuck_modes(b, 1e3)
    assert most > 5e-3 and f"{100 * most:.3g} %" in said
    assert not of_stuck_modes(strips(tmp_path), 1e3)


@pytest.mark.parametrize("normal", [1e5, 1e7])
def test_contacts_pressed_by_a_million_times_what_moves_them(tmp_path: Path, normal: float) -> None:
    """Forces that large round to more than the 1e-10 of the answer that a balance is found to: it is linear, so that a
    large force changes nothing of it, at the resonance neither."""
    b = strips(tmp_path, joint=1e7)
    resonance = damping(b)[0][0]
    problems = [problem_of(b, one) for one in (1e3, normal)]
    for f in (10.0, resonance, 54.0):
        points = [solve(p, 2 * np.pi * f, []) for p in problems]
        assert all(one.converged for one in points)
        little, much = (p.displacement(one.x)[1:] for p, one in zip(problems, points, strict=True))
        np.testing.assert_allclose(much, little, rtol=0, atol=1e-6 * np.abs(little).max())

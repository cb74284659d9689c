"""Vibration under two frequencies: superposition, motions in time, the common period where there is one, and power."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused, refused_command

import microslip as ms
from microslip.case import load_case
from microslip.cli import main
from microslip.contact.law import Law, number, settings
from microslip.harmonic_balance import tones, two_tone
from microslip.series import closed, commensurate, pairs_of, summed

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
BOTH: dict[str, Any] = {"force": {0: 0.2}, "second_force": {0: 0.1}}


def duffing(cubic: float = 0.05) -> Any:
    return ms.structure(1.0, 1.0, 0.1, **BOTH, elements=[ms.polynomial({3: cubic})])


def slider() -> Any:
    return ms.structure(1.0, 1.0, 0.1, **BOTH, elements=[ms.jenkins(1.0, 0.15)])


@settings
class VanDerPol(Law):
    """The force mu (u^2 - 1) v along t1, which drives small motions and brakes large ones."""

    mu: Any = number()

    @property
    def remembers(self) -> int:
        return 0

    @property
    def follows(self) -> float:
        return np.inf

    def init(self, n: int) -> Any:
        return jnp.zeros((1, n))

    def rates(self, u: Any, v: Any, x: Any, time: Any, lag: float) -> Any:
        force = self.mu * (u[:, 1] ** 2 - 1) * v[:, 1]
        return jnp.stack([0 * force, force, 0 * force], axis=1), x

    def step(self, u: Any, v: Any, dt: Any, state: Any) -> Any:
        return self.rates(u, v, state, 0.0, 0.0)[0], state

    def slip(self, state: Any) -> Any:
        return jnp.zeros((state.shape[-1], 2))

    def stored(self, u: Any, state: Any) -> Any:
        return jnp.zeros(u.shape[0])


def fitted(time: Any, y: Any, first: float, second: float, order: int) -> Any:
    """(P + 1,) amplitudes of two-tone series that fit a motion in time best."""
    E = summed(time[:, None] * (pairs_of(order) @ np.array([first, second])))
    c = np.linalg.lstsq(E, y, rcond=None)[0]
    return np.append(abs(c[0]), np.hypot(c[1::2], c[2::2]))


def test_superposition() -> None:
    """Of linear springs, each tone is answered as if it were alone."""
    M, K, C = np.diag([1.0, 2.0]), np.array([[3.0, -1.0], [-1.0, 1.5]]), np.diag([0.1, 0.05])
    both = ms.structure(
        M, K, C, force={0: 1.0 + 0.5j}, second_force={1: 0.3}, output=[0, 1], elements=[ms.polynomial({1: 0.7}, at=1)]
    )
    found = ms.two_tones(both, 0.9, 0.9 * np.sqrt(2.0), harmonics=3, unit="rad/s")
    K = K + np.diag([0.0, 0.7])
    for pair, w, f in (((1, 0), 0.9, [1.0 + 0.5j, 0.0]), ((0, 1), 0.9 * np.sqrt(2.0), [0.0, 0.3])):
        exact = np.linalg.solve(K - w**2 * M + 1j * w * C, f)
        np.testing.assert_allclose([found.of(*pair, readout=i)[0] for i in (0, 1)], exact, rtol=1e-12)
    assert np.abs(np.delete(found.amplitude[0], [1, 2], axis=1)).max() < 1e-13


def test_duffing_in_time() -> None:
    """The motion in time, once it is steady, is that of the balance; the loads supply what the damper takes."""
    w = 1.3, 1.3 * GOLDEN
    found = ms.two_tones(duffing(), *w, harmonics=7, unit="rad/s")
    orbit = ms.integrate(duffing(), w[0], second=w[1], unit="rad/s", settle=80, keep=8, samples=64)
    largest = np.abs(orbit.y[0]).max()
    assert np.abs(found.motion(orbit.time) - orbit.y[0]).max() < 1e-8 * largest
    assert abs(found.balance[0]) < 1e-12 and found.supplied.sum() == pytest.approx(found.damped[0], rel=1e-12)


def test_harmonics_converge() -> None:
    """The error of a smooth spring falls with H geometrically, and the estimate covers it."""
    exact = ms.two_tones(duffing(0.4), 1.3, 0.8123, harmonics=9, unit="rad/s")
    errors, estimates = [], []
    for H in (1, 3, 5):
        found = ms.two_tones(duffing(0.4), 1.3, 0.8123, harmonics=H, unit="rad/s")
        errors.append(max(abs(found.of(*k)[0] - exact.of(*k)[0]) for k in ((1, 0), (0, 1))))
        estimates.append(found.error_estimate() * np.abs(found.amplitude).max())
    assert errors[1] < 0.1 * errors[0] and errors[2] < 0.1 * errors[1]
    assert all(e < s for e, s in zip(errors, estimates, strict=True))


def test_common_period() -> None:
    """At 3 to 2 the sums of all pairs of one frequency are the harmonics of one balance over the common period, of a
    smooth spring and of a stop to which no memory belongs."""
    base = 0.45
    system = duffing(0.2)
    loads = tuple(replace(x, harmonic=2 if x.tone == 2 else 3, tone=1) for x in system.loads)
    one = ms.harmonic_response(replace(system, loads=loads), base, harmonics=27, samples=432, unit="rad/s")
    found = ms.two_tones(system, 3 * base, 2 * base, harmonics=13, unit="rad/s")
    assert "3 to 2" in found.messages[0] or "2 to 3" in found.messages[0]
    h = found.pairs @ [3, 2]
    for n in (1, 2, 3, 4, 5):
        total = found.amplitude[0, 0, h == n].sum() + found.amplitude[0, 0, h == -n].conj().sum()
        assert abs(total - one.harmonics()[0, n]) < 1e-8 * np.abs(found.amplitude).max()


@pytest.mark.parametrize(
    ("order", "samples", "within"), [(5, 64, 1e-3), pytest.param(11, 256, 1e-4, marks=pytest.mark.slow)]
)
def test_slider_in_time(order: int, samples: int, within: float) -> None:
    """A Jenkins element: amplitudes of both tones as in time, power to what the samples of the line tell, and a line
    with more turns changes little."""
    w = 0.9, 0.9 * GOLDEN
    found = ms.two_tones(slider(), *w, harmonics=order, samples=samples, turns=40, unit="rad/s")
    orbit = ms.integrate(slider(), w[0], second=w[1], unit="rad/s", settle=30, keep=60, samples=64, steps=1024)
    seen = fitted(orbit.time, orbit.y[0], *w, 11)
    np.testing.assert_allclose(np.abs(found.amplitude[0, 0, 1:3]), seen[1:3], atol=within * seen[1])
    assert abs(found.balance[0]) < within and found.lost[0] > 0.3 * found.supplied.sum()
    other = ms.two_tones(slider(), *w, harmonics=order, samples=samples, turns=72, unit="rad/s")
    assert other.balances[0].torus.turns != found.balances[0].torus.turns
    assert abs(np.abs(other.of(1, 0)) - np.abs(found.of(1, 0)))[0] < within * seen[1]


def test_marched_as_by_hand() -> None:
    """A Jenkins element by hand and by the marching that serves every law give the same forces and slopes."""
    b = two_tone.of(slider(), 0.9, 0.9 * GOLDEN, 3, 32, 16)
    hand = b.contacts[0]
    marched = replace(hand, model=two_tone.AFT(hand.model.patch, 1, 64, 100, 1e-12, b.torus))
    u = 0.3 * np.random.default_rng(0).normal(size=(1, 1, b.torus.coefficients))
    (F, S), (other, slopes) = (one.model.forces(u, 1.0) for one in (hand, marched))
    np.testing.assert_allclose(F, other, atol=1e-12)
    np.testing.assert_allclose(S, slopes, atol=1e-10)


@pytest.mark.parametrize("make", [duffing, slider])
def test_derivatives(make: Any) -> None:
    b = two_tone.of(make(), 1.1, 1.1 * GOLDEN, 3)
    random = np.random.default_rng(1)
    x, d, h = (0.5 / b.problem.scale[0]) * random.normal(size=b.size), random.normal(size=b.size), 1e-6
    _, A, rate = b.evaluate(x, 1.1)
    difference = (b.evaluate(x + h * d, 1.1)[0] - b.evaluate(x - h * d, 1.1)[0]) / (2 * h)
    np.testing.assert_allclose(A @ d, difference, atol=1e-6 * np.abs(difference).max())
    over = (b.evaluate(x, 1.1 + h)[0] - b.evaluate(x, 1.1 - h)[0]) / (2 * h)
    np.testing.assert_allclose(rate, over, atol=1e-6 * np.abs(over).max())


def test_self_excited() -> None:
    """Van der Pol's oscillator beside a load: frequency and amplitudes of its own vibration as in time; the load, not
    the vibration, is what supplies power from outside."""
    first = 1.8
    system = ms.structure(1.0, 1.0, 0.0, force={0: 0.5}, elements=[ms.Element(VanDerPol(np.array(0.2)), 0, length=1.0)])
    orbit = ms.integrate(system, first, unit="rad/s", settle=60, keep=60, samples=32, steps=256)
    found = ms.two_tones(system, first, 1.0, free=True, harmonics=5, start=orbit, unit="rad/s")
    assert found.converged.all() and found.of(0, 1)[0] != 0
    second = 2 * np.pi * found.second[0]
    seen = fitted(orbit.time, orbit.y[0], first, second, 7)
    np.testing.assert_allclose(seen[1:3], np.abs(found.amplitude[0, 0, 1:3]), rtol=1e-4)
    assert found.error_estimate() < 1e-2
    assert found.supplied[0, 0] == pytest.approx(found.lost[0], rel=1e-10) and found.supplied[0, 1] == 0
    b = found.balances[0]
    x = found.points[0].x
    b, d, h = replace(b, reference=b.displacement(x)), np.random.default_rng(2).normal(size=len(x)), 1e-6
    difference = (b.evaluate(x + h * d, first)[0] - b.evaluate(x - h * d, first)[0]) / (2 * h)
    np.testing.assert_allclose(b.evaluate(x, first)[1] @ d, difference, atol=1e-6 * np.abs(difference).max())


@settings
class Falling(VanDerPol):
    """Friction on a belt of 1 m/s that falls with the velocity between them, mu (N), smoothed within 1 / slope."""

    slope: Any = number()

    def rates(self, u: Any, v: Any, x: Any, time: Any, lag: float) -> Any:
        w = v[:, 1] - 1.0
        force = self.mu * (0.2 + 0.2 * jnp.exp(-jnp.sqrt(w**2 + 1e-4))) * 2 / jnp.pi * jnp.arctan(self.slope * w)
        return jnp.stack([0 * force, force, 0 * force], axis=1), x


@pytest.mark.slow
def test_stick_slip_beside_a_load() -> None:
    """A mass that sticks to its belt and is let go, shaken by a load: frequency and both tones come nearer to the
    motion in time with the harmonics."""
    first, element = 1.8, ms.Element(Falling(np.array(1.0), np.array(30.0)), 0, length=1.0)
    system = ms.structure(1.0, 1.0, 0.02, force={0: 0.2}, elements=[element])
    orbit = ms.integrate(system, first, unit="rad/s", settle=150, keep=60, samples=32, steps=512)
    assert np.abs(np.diff(orbit.y[0])).max() / np.diff(orbit.time[:2])[0] > 0.99  # it does stick
    apart = []
    for harmonics in (5, 9):
        found = ms.two_tones(system, first, 1.0, free=True, harmonics=harmonics, start=orbit, unit="rad/s")
        assert found.converged.all()
        seen = fitted(orbit.time, orbit.y[0], first, 2 * np.pi * found.second[0], 11)
        apart.append(np.abs(seen[1:3] - np.abs(found.amplitude[0, 0, 1:3])).max() / seen[1:3].max())
    assert apart[1] < 5e-3 and apart[1] < apart[0]


def test_line() -> None:
    """Turns of a closed line are coprime, near the ratio, whichever tone is faster; a common period is known."""
    for first, second in ((1.0, GOLDEN), (1.0, 13.7), (3.2, 3.1)):
        q, p = closed(first, second, 32)
        assert np.gcd(q, p) == 1 and 32 <= max(p, q) <= 64
        assert abs(second / first - p / q) < 1.5 * second / first / (32 * min(p, q))
    assert commensurate(3.0, 2.0, 3) in ((2, 3), (3, 2)) and commensurate(1.0, GOLDEN, 20) is None


def test_a_point_that_was_not_found_tells_no_motion() -> None:
    """Amplitudes, powers, motion and torus of it are nan, in xarray and in the file too; others
    keep theirs."""
    found = ms.two_tones(duffing(), [1.2, 1.3], 0.8, harmonics=2, unit="rad/s")
    lost = replace(found, status=("converged", "iteration limit"))
    for values in (lost.of(1, 0), lost.balance, lost.to_xarray()["lost"].values, lost.supplied[:, 0]):
        assert np.isnan(values).tolist() == [False, True]
    assert np.isnan(lost.motion([0.3], 1)).all() and np.isnan(lost.torus(1, count=4)).all()
    assert np.abs(lost.of(1, 0))[0] == np.abs(found.of(1, 0))[0] and "1 not converged" in repr(lost)


def test_kept(tmp_path: Path) -> None:
    """A result comes back from its file, tabulates, draws and says itself; another kind of file is left."""
    found = ms.two_tones(duffing(), [1.2, 1.3], 0.8, harmonics=3, unit="rad/s")
    again = ms.load(found.save(tmp_path / "two.h5"))
    np.testing.assert_array_equal(again.amplitude, found.amplitude)
    assert "2 points, 3 harmonics; first 0.190986 Hz" in repr(again) and "first 1.2 rad/s" in repr(found)
    data = again.to_xarray()
    assert dict(data.sizes) == {"point": 2, "readout": 1, "pair": 13, "tone": 2}
    assert len(found.to_dataframe()) == 2 and found.of(-1, 2)[0] == np.conj(found.of(1, -2)[0])
    at = np.array([0.3, 0.7])
    torus = found.torus(1, count=16)
    turned = np.exp(2j * np.pi * (found.pairs @ [3 / 16, 5 / 16]))
    assert torus[3, 5] == pytest.approx((found.amplitude[1, 0] @ turned).real)
    assert found.motion(at, 1)[0] == pytest.approx(
        (found.amplitude[1, 0] @ np.exp(1j * (found.pairs @ [1.3, 0.8]) * at[0])).real
    )
    found.plot(), found.plot(point=0), found.plot_torus()
    other = tmp_path / "response.h5"
    ms.harmonic_response(ms.structure(1.0, 1.0, 0.1, force={0: 1.0}), 0.5, unit="rad/s").save(other)
    refused("response", found.save, other)


def alone() -> Any:
    return ms.structure(1.0, 1.0, 0.1, force={0: 0.2}, elements=[ms.polynomial({3: 0.05})])


@pytest.mark.parametrize(
    ("key", "ask"),
    [
        ("second", lambda: ms.two_tones(duffing(), 1.0, 1.0)),
        ("second", lambda: ms.two_tones(duffing(), 1.0, -2.0)),
        ("first", lambda: ms.two_tones(duffing(), 0.0, 1.0)),
        (("first: ", "(it is -1)"), lambda: ms.two_tones(duffing(), -1.0, 1.0)),
        ("two_tones: first: ", lambda: ms.two_tones(duffing(), "a", 1.0)),
        ("second: no load", lambda: ms.integrate(alone(), 1.0, second=0.7)),
        ("second", lambda: ms.two_tones(duffing(), [1.0, 1.1, 1.2], [2.0, 2.1])),
        ("second", lambda: ms.two_tones(alone(), 1.0, 1.4)),
        ("free", lambda: ms.two_tones(duffing(), 1.0, 1.4, free=True)),
        ("second", lambda: ms.two_tones(slider(), 1.0, 1.5)),
        ("harmonics", lambda: ms.two_tones(duffing(), 1.0, 1.4, harmonics=0)),
        ("two_tones", lambda: ms.harmonic_response(duffing(), 1.0)),
        ("two_tones", lambda: ms.integrate(duffing(), 1.0)),
        ("friction", lambda: ms.two_tones(ms.structure(1.0, 1.0, **BOTH, elements=[ms.friction(0.1)]), 1.0, 1.4)),
        ("pair", lambda: ms.two_tones(duffing(), 1.0, 1.4, harmonics=1).of(1, 1)),
    ],
)
def test_refused(key: str | tuple[str, ...], ask: Any) -> None:
    refused(key, ask)


def test_faded() -> None:
    """Where nothing drives a second tone, none is found: the sentence says so."""
    refused("second", ms.two_tones, alone(), 1.3, 0.9, free=True, unit="rad/s")


def test_page(capsys: pytest.CaptureFixture[str]) -> None:
    """The page prints what its block prints; harmonics bring a slider's amplitudes nearer to those in time."""
    text = (Path(__file__).parents[1] / "docs" / "two_tones.md").read_text()
    code, printed = re.findall(r"```python\n(.*?)```\n\n((?:    [^\n]*\n)+)", text, flags=re.S)[0]
    exec(code, {})
    assert [line.strip() for line in printed.splitlines()] == capsys.readouterr().out.splitlines()
    table = text.split("<!-- table slider -->")[1].split("<!-- end -->")[0].strip().splitlines()[2:]
    *found, exact = ([float(cell) for cell in row.split("|")[4:6]] for row in table)
    away = [max(abs(a - b) / b for a, b in zip(one, exact, strict=True)) for one in found]
    assert away[-1] < 1e-4 and away[-1] < 0.5 * away[0]


CASE = """
name = "two-masses"
body = "pair"
[[excitations]]
row = "push"
amplitude = 0.5
[[excitations]]
row = "push"
tone = 2
amplitude = 0.3
[[monitors]]
monitor = "second"
[[contacts]]
interface = "sole"
normal_force = 1.0
points = [1, 1]
normal_stiffness = 1e6
tangential_stiffness = 1.0
friction = 0.3
law = "jenkins"
[two_tones]
start = 0.14
stop = 0.15
points = 2
second = 0.1137
harmonics = 3
"""

SYSTEM = """
name = "pair"
[[masses]]
name = "second"
mass = 1.0
at = [2.0, 0.0, 0.0]
free = "x"
[[springs]]
between = ["ground", "second"]
stiffness = 1.0
[[dampers]]
between = ["ground", "second"]
damping = 0.2
[[contacts]]
name = "sole"
on = "second"
normal = [0.0, 0.0, -1.0]
t2 = [0.0, -1.0, 0.0]
[[forces]]
name = "push"
on = "second"
direction = [1.0, 0.0, 0.0]
[[monitors]]
name = "second"
on = "second"
"""


@pytest.mark.slow
def test_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """`microslip run` of a case leaves page, table and file with the same numbers; the same elements from Python give
    them too; a case without a second tone is refused, exit code 2."""
    (tmp_path / "pair").mkdir()
    (tmp_path / "pair" / "system.toml").write_text(SYSTEM)
    (tmp_path / "case.toml").write_text(CASE)
    monkeypatch.chdir(tmp_path)
    assert main(["run", "case.toml"]) == 0
    folder = tmp_path / "build" / "two-masses"
    found = ms.load(folder / "two_tones.h5")
    rows = list(csv.DictReader((folder / "two_tones.csv").open()))
    for row, one, two in zip(rows, found.of(1, 0), found.of(0, 1), strict=True):
        assert float(row["amplitude_m_1_0"]) == pytest.approx(abs(one), rel=1e-9)
        assert float(row["amplitude_m_0_1"]) == pytest.approx(abs(two), rel=1e-9)
    assert (folder / "two_tones.html").is_file() and (folder / "pictures" / "two_tones.png").is_file()
    system = ms.structure(1.0, 1.0, 0.2, force={0: 0.5}, second_force={0: 0.3}, elements=[ms.jenkins(1.0, 0.3)])
    same = ms.two_tones(system, [0.14, 0.15], 0.1137, harmonics=3)
    np.testing.assert_allclose(np.abs(found.of(1, 0)), np.abs(same.of(1, 0)), rtol=1e-6)
    refused_command(["run", "case.toml", "--set", "excitations.1.tone=1"], capsys, "two_tones: second")


@pytest.mark.slow
def test_a_killed_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None) -> None:
    """What was found before is not solved for again, and the table is that of a run without a break; another case
    begins anew; a refused one leaves nothing."""
    from microslip.stages.analysing import analysed
    from microslip.stages.answer import CaseJob
    from microslip.stages.places import modal_files

    tones_stage = partial(analysed, "two_tones")

    (tmp_path / "pair").mkdir()
    (tmp_path / "pair" / "system.toml").write_text(SYSTEM)
    case = tmp_path / "case.toml"
    case.write_text(CASE.replace("points = 2", "points = 3").replace("harmonics = 3", "harmonics = 1"))
    files = modal_files(load_case(case)[0], tmp_path, lambda _: None)
    solved, solve = [], tones.solve

    def counted(b: Any, first: float, *rest: Any) -> Any:
        solved.append(first / (2 * np.pi))
        return solve(b, first, *rest)

    def killed(said: str) -> None:
        if said.startswith("2 of"):
            raise KeyboardInterrupt

    monkeypatch.setattr(tones, "solve", counted)
    with pytest.raises(KeyboardInterrupt):
        tones_stage(CaseJob(case, files, tmp_path / "a", report=killed, pictures=False))
    assert solved == pytest.approx([0.14, 0.145]) and not (tmp_path / "a" / "two_tones.csv").exists()
    solved.clear()
    assert tones_stage(CaseJob(case, files, tmp_path / "a", pictures=False))[2]
    assert solved[0] == pytest.approx(0.15) and not (tmp_path / "a" / "two_tones.points").exists()
    tones_stage(CaseJob(case, files, tmp_path / "b", pictures=False))
    assert (tmp_path / "a" / "two_tones.csv").read_bytes() == (tmp_path / "b" / "two_tones.csv").read_bytes()
    with pytest.raises(KeyboardInterrupt):
        tones_stage(
            CaseJob(case, files, tmp_path / "a", ["excitations.0.amplitude=0.4"], report=killed, pictures=False)
        )
    solved.clear()
    tones_stage(CaseJob(case, files, tmp_path / "a", ["excitations.0.amplitude=0.45"], pictures=False))
    assert solved[0] == pytest.approx(0.14)
    alone = CaseJob(case, files, tmp_path / "c", ["excitations.1.tone=1"], pictures=False)
    refused("two_tones", tones_stage, alone)
    assert not list((tmp_path / "c").glob("two_tones*"))


@pytest.fixture
def belt(tmp_path: Path) -> Any:
    """A mass on a belt that slides under it all the time, pushed with two frequencies."""
    from microslip.case.assemble import build
    from microslip.system.settings import load_system

    (tmp_path / "system.toml").write_text(SYSTEM)
    rate = 'law = { kind = "rate", slope = 10.0 }\nground = { velocity = 1.0 }'
    (tmp_path / "case.toml").write_text(CASE.replace('law = "jenkins"', rate))
    settings, _ = load_case(tmp_path / "case.toml", ["excitations.0.amplitude=0.2", "excitations.1.amplitude=0.1"])
    return build(settings, {"pair": load_system(tmp_path / "system.toml").basis()})


def test_moving_ground_supplies_what_is_lost(belt: Any) -> None:
    """Beside the loads: what the contact exchanges with the bodies and the ground is what friction takes."""
    found = ms.two_tones(belt, 0.14, 0.1137, harmonics=3)
    assert found.lost[0] != 0
    assert abs(found.exchanged[0] - found.lost[0]) < 1e-9 * found.supplied.sum()


@pytest.mark.slow
def test_moving_ground(belt: Any) -> None:
    """As in time."""
    found = ms.two_tones(belt, 0.14, 0.1137, harmonics=9)
    orbit = ms.integrate(belt, 0.14, second=0.1137, settle=40, keep=8, samples=64, steps=512)
    largest = np.abs(orbit.y[0]).max()
    readout = [name.split()[-1] for name in found.readouts].index("u_x")
    row = [label.split()[-1] for label in orbit.labels].index("u_x")
    assert np.abs(found.motion(orbit.time, 0, readout) - orbit.y[row]).max() < orbit.error * largest < 1e-4
    assert found.lost[0] != 0 and abs(found.exchanged[0] - found.lost[0]) < 1e-9 * found.supplied.sum()

"""Wear by a vibration: closed forms of points that slide, energy, order of the jumps."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from refusals import refused_command
from test_ring_down import DAMPER, MASS, SYSTEM

import microslip as ms
from microslip.cli import main
from microslip.contact.heights import Polynomial
from microslip.contact.law import values
from microslip.data import Array
from microslip.results.dataset import Dataset
from microslip.units import METRES
from microslip.verbs import wear
from microslip.verbs.wear import HOUR, Keys, Surface, Wearing

AREA, STIFFNESS, MU, FORCE, COEFFICIENT, DRIVEN = 200e-6, 1e6, 0.3, 0.2, 1e-12, 20.0
CASE = f"""
name = "worn"
body = "mass"
excitation = "push"
amplitude = 6.0
monitor = "block"
harmonics = 3
samples = 256
[[contacts]]
interface = "sole"
interference = {FORCE / STIFFNESS}
width = 10e-3
height = 20e-3
points = [2, 1]
normal_stiffness = {STIFFNESS}
tangential_stiffness = {STIFFNESS}
friction = {MU}
[sweep]
start = 24.0
stop = 36.0
points = 61
[wear]
coefficient = {COEFFICIENT}
hours = 8
"""
PRESSED = CASE.replace(f"interference = {FORCE / STIFFNESS}", f"normal_force = {FORCE}")
ROUGH = PRESSED.replace("[sweep]", 'law = "rough"\nroughness = 4e-6\n[sweep]')


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None) -> Path:
    (tmp_path / "mass").mkdir()
    (tmp_path / "mass" / "system.toml").write_text(SYSTEM)
    (tmp_path / "case.toml").write_text(CASE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def worn(*asked: str) -> Dataset:
    assert main(["wear", "case.toml", "--quiet", *(f"--set={one}" for one in asked)]) == 0
    return ms.load("build/worn/wear.h5")


def slip(found: Dataset, force: Array) -> Array:
    """Of a point whose spring sticks first: half its way in a cycle."""
    return 2 * (found["amplitude"] - MU * force / STIFFNESS)


def integral(found: Dataset, values: Array) -> Array:
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(HOUR * found["time"])
    return np.append(0.0, np.cumsum(steps))


def test_points_under_a_force_wear_evenly(case: Path) -> None:
    """Slip and force stay, so that the depth grows with the hours: I_W mu F_N 4 s f / A."""
    (case / "case.toml").write_text(PRESSED)
    found = worn(f"wear.frequency={DRIVEN}")
    np.testing.assert_allclose(found["pressing"], FORCE, rtol=1e-9)
    np.testing.assert_allclose(np.ptp(found["amplitude"]), 0.0, atol=1e-12)
    way = 2 * slip(found, np.array([FORCE])) * DRIVEN * HOUR * found["time"]
    points = ms.load("build/worn/wear_depth.h5")
    assert points["contact"].tolist() == 2 * ["sole"] and points["area"] == pytest.approx(AREA / 2)
    exact = COEFFICIENT * MU * FORCE * way / AREA
    np.testing.assert_allclose(found["largest_depth"], exact, rtol=2e-3)


def test_points_that_overlap_lose_their_preload(case: Path) -> None:
    """dN/dt = -k_N I_W mu N 4 s f / A: an exponential if the slip stayed; here it grows."""
    found = worn(f"wear.frequency={DRIVEN}")
    force = found["pressing"]
    assert force[0] == pytest.approx(FORCE, rel=1e-6) and force[-1] < 0.3 * FORCE
    np.testing.assert_allclose(force, FORCE - STIFFNESS * found["largest_depth"], rtol=1e-6)
    rate = STIFFNESS * COEFFICIENT * MU * 2 * slip(found, force) * DRIVEN / AREA
    np.testing.assert_allclose(force, FORCE * np.exp(-integral(found, rate)), rtol=0.02)


def test_jumps_that_are_halved_leave_a_quarter_of_the_error(case: Path) -> None:
    """Heun's method, of second order; the slip grows while the preload is lost."""
    w, asked = wearing(), Keys(coefficient=COEFFICIENT, hours=4.0, tolerance=0.2)
    found = []
    for count in (4, 8, 16):
        row = begun(w, w.new)
        for _ in range(count):
            row = wear._jumped(w, asked, vibrating(w), {**row, "jump": asked.hours / count})
        found.append(float(row["depth"].max()))
    assert np.log2((found[1] - found[0]) / (found[2] - found[1])) == pytest.approx(2.0, abs=0.25)


def test_a_pressed_patch_wears_until_the_pressure_is_even(case: Path) -> None:
    """Two points under one force: k_N (depth_2 - depth_1) = N_1 - N_2 falls by the rate
    k_N I_W mu 4 s f / A of one point, and the total stays."""
    (case / "case.toml").write_text(PRESSED)
    w, asked = wearing(), Keys(coefficient=COEFFICIENT, hours=4.0)
    row = begun(w, Surface(np.array([0.0, 0.2 * FORCE / STIFFNESS]), np.zeros(0)))
    rows = [row | {"jump": 0.05}]
    while rows[-1]["time"] < asked.hours:
        rows.append(wear._jumped(w, asked, vibrating(w), rows[-1]))
    force, time = np.array([r["force"] for r in rows]), np.array([r["time"] for r in rows])
    np.testing.assert_allclose(force.sum(axis=1), FORCE, rtol=1e-9)
    uneven = force[:, 0] - force[:, 1]
    way = 4 * (rows[0]["amplitude"] - MU * FORCE / STIFFNESS) * DRIVEN
    assert uneven[0] == pytest.approx(0.1 * FORCE, rel=1e-6) and uneven[-1] < 0.6 * uneven[0]
    exact = uneven[0] * np.exp(-STIFFNESS * COEFFICIENT * MU * way * HOUR * time / AREA)
    np.testing.assert_allclose(uneven, exact, rtol=0.01)


@pytest.mark.slow
def test_a_rough_point_wears_as_the_book_has_it(case: Path) -> None:
    """Under a constant force V(u*) = F* (1 + t*), V of the new surface (3.3-21), t* by (3.9-10)."""
    (case / "case.toml").write_text(ROUGH)
    w = wearing()
    rows, roughness = [begun(w, w.new)], 4e-6
    asked = Keys(coefficient=COEFFICIENT, hours=40.0)
    while rows[-1]["time"] < asked.hours:
        rows.append(wear._jumped(w, asked, vibrating(w), rows[-1]))
    depth, u = (np.array([np.max(r[key]) for r in rows]) for key in ("depth", "approach"))
    star = FORCE / (STIFFNESS * roughness)
    times = depth * AREA / (COEFFICIENT * FORCE) * COEFFICIENT * STIFFNESS / AREA
    assert times[-1] > 1.0
    volume = values(Polynomial(), "volume", u / roughness)
    np.testing.assert_allclose(volume, star * (1 + times), rtol=2e-3)


@pytest.mark.slow
def test_a_resonance_is_followed_until_the_contact_is_lost(case: Path) -> None:
    """What is worn off is I_W times what the loads supply and the damper does not take. In the end
    the mass swings alone: closed forms of its resonance, damping and amplitude. Interrupted, it
    goes on where it was, and the page begins with what the table has."""
    asked = [
        "wear",
        "case.toml",
        "--set",
        "contacts.sole.interference=1e-5",
        "--set",
        "contacts.sole.points=[1,1]",
        "--set",
        "wear.hours=2",
    ]
    jumped, done = wear._jumped, []

    def interrupted(*given: object) -> object:
        done.append(1)
        if len(done) == 3:
            raise KeyboardInterrupt
        return jumped(*given)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(wear, "_jumped", interrupted)
        assert main(asked) == 130
        done.clear()
        patched.setattr(wear, "_jumped", lambda *given: done.append(1) or jumped(*given))
        assert main(asked) == 0
    found, depth = ms.load("build/worn/wear.h5"), ms.load("build/worn/wear_depth.h5")
    assert len(done) == len(found) - 1 - 2
    f, X = found["frequency"], found["amplitude"]
    kinetic = 0.5 * MASS * (2 * np.pi * f * X) ** 2
    supplied = 4 * np.pi * found["damping_ratio"] * kinetic
    taken = f * (supplied - np.pi * DAMPER * 2 * np.pi * f * X**2)
    volume = COEFFICIENT * integral(found, taken)
    half = volume < 0.5 * volume[-1]  # the jumps behind it are too long for the rule of the test
    np.testing.assert_allclose(found["worn_volume"][half], volume[half], rtol=1e-3)
    np.testing.assert_allclose(found["worn_volume"], volume, atol=0.02 * volume[-1])
    assert depth["contact"].tolist() == ["sole"]
    assert depth["depth"][0] * AREA == pytest.approx(found["worn_volume"][-1], rel=1e-12)
    omega = np.sqrt(3e4 / MASS)
    assert found["area"][-1] == 0 and found["area"][0] == pytest.approx(AREA)
    assert found["damping_ratio"][-1] == pytest.approx(DAMPER / (2 * MASS * omega), rel=1e-4)
    assert X[-1] == pytest.approx(6.0 / (DAMPER * omega), rel=1e-4)
    assert f[-1] == pytest.approx(omega / (2 * np.pi), rel=1e-4)
    table = np.genfromtxt(case / "build" / "worn" / "wear.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["largest_depth_m"], found["largest_depth"], rtol=1e-9)
    page = (case / "build" / "worn" / "wear.html").read_text()
    assert f"amplitude {METRES.sized(X[0])} to {METRES.sized(X[-1])}" in page
    assert f"resonance {f[0]:.6g} to {f[-1]:.6g} Hz" in page
    assert "touches no more" in page


def test_mistakes_name_their_keys(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for key, value in (("coefficient", -1e-13), ("hours", 0), ("tolerance", 0.5), ("colour", 1)):
        asked = ["wear", "case.toml", "--set", f"wear.{key}={value}"]
        refused_command(asked, capsys, f"wear.{key}")
    (case / "case.toml").write_text(CASE.replace(f"coefficient = {COEFFICIENT}\n", ""))
    refused_command(["wear", "case.toml"], capsys, "wear.coefficient")
    (case / "case.toml").write_text(CASE[: CASE.index("[wear]")])
    refused_command(["wear", "case.toml"], capsys, "wear", "coefficient (m3/J) and hours")
    assert not (case / "build" / "worn").exists()


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (CASE[CASE.index("[[contacts]]") : CASE.index("[sweep]")], "", "contacts"),
        (CASE[CASE.index("[[contacts]]") : CASE.index("[sweep]")], "contacts = []\n", "contacts"),
        ("friction = 0.3", "friction = 0.0", "friction"),
        ("height = 20e-3", "", "area"),
        ("hours = 8", "hours = 8\nnormal_force = 2.0", "wear.normal_force"),
        (f"interference = {FORCE / STIFFNESS}", 'normal_force = 1.0\nlaw = "jenkins"', "the law's"),
    ],
    ids=[
        "contacts are missing",
        "no contact",
        "no friction",
        "no area",
        "a force that presses nothing",
        "a force that is given",
    ],
)
def test_what_cannot_wear_is_refused(
    case: Path, capsys: pytest.CaptureFixture[str], before: str, after: str, words: str
) -> None:
    (case / "case.toml").write_text(CASE.replace(before, after))
    refused_command(["wear", "case.toml", "--set=wear.frequency=20.0"], capsys, words)


def wearing() -> Wearing:
    built = ms.assemble("case.toml")
    return Wearing(built.pressed(None), built.settings, COEFFICIENT)


def vibrating(w: Wearing):
    return partial(wear._vibrating, w, DRIVEN, np.zeros(0), lambda _: None)


def begun(w: Wearing, surface: Surface) -> dict:
    return vibrating(w)(surface, None) | {"time": 0.0, "jump": 0.1, "error": 0.0}

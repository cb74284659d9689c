"""A vibration that dies away: exact for an exponential, the closed form of a slider, and the nonlinear mode."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusals import refused_command
from test_bifurcation_cli import SHAKEN

import microslip as ms
from microslip.cli import main
from microslip.verbs.ring_down import measured_decay

SYSTEM = SHAKEN.replace('"shaken"', '"mass"').replace("= 1.0\n[[dampers]]", "= 3e4\n[[dampers]]").replace("0.1", "1.0")
MASS, SPRING, SLIDER, DAMPER, LIMIT = 1.0, 3e4, 1e4, 1.0, 3.0
CASE = f"""
name = "rung"
body = "mass"
excitation = "push"
amplitude = 6.0
monitor = "block"
harmonics = 3
[[contacts]]
interface = "sole"
normal_force = {LIMIT / 0.3}
points = [1, 1]
normal_stiffness = 1e6
tangential_stiffness = {SLIDER}
friction = 0.3
law = "jenkins"
[sweep]
start = 24.0
stop = 36.0
points = 61
"""


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "mass").mkdir()
    (tmp_path / "mass" / "system.toml").write_text(SYSTEM)
    (tmp_path / "case.toml").write_text(CASE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("damping", "within"), [(1e-3, 1e-4), (0.05, 2e-3)])
def test_an_exponential_beside_a_level(damping: float, within: float) -> None:
    """Frequency, damping and amplitude, though the frequency that it is told at first is 3 % lower."""
    omega, time = 2 * np.pi * 31.0, np.arange(64 * 60) / (64 * 30.0)
    y = 0.2 * np.exp(-damping * omega * time) * np.cos(omega * time + 0.4) + 0.01
    found = measured_decay(time, y, 2 * np.pi * 30.0, 1e-6, 0.2)
    large = found.amplitude > 1e-3
    exact = 0.2 * np.exp(-damping * omega * found.time)
    assert large.sum() > 5
    np.testing.assert_allclose(found.frequency[large], 31.0, rtol=within)
    np.testing.assert_allclose(found.damping[large], damping, rtol=10 * within)
    np.testing.assert_allclose(found.amplitude[large], exact[large], rtol=10 * within)


def test_a_motion_that_is_gone_within_the_window_tells_nothing() -> None:
    time = np.arange(64 * 8) / (64 * 30.0)
    found = measured_decay(time, np.exp(-100 * time), 2 * np.pi * 30.0, 0.01, 1.0)
    assert not len(found.time) and found.lost


@pytest.mark.slow
@pytest.mark.parametrize("begun", [[], ["--set", "ring_down.amplitude=8e-3"]], ids=["at the resonance", "in the mode"])
def test_a_slider_rings_down_along_its_nonlinear_mode(case: Path, begun: list[str]) -> None:
    """Sticking, frequency and damping have closed forms; sliding, they are those of the nonlinear mode. Table and file
    hold the same, and what the page says first is the first row."""
    assert main(["ring-down", "case.toml", *begun]) == 0
    folder = case / "build" / "rung"
    found = ms.load(folder / "ring_down.h5")
    table = np.genfromtxt(folder / "ring_down.csv", delimiter=",", names=True)
    for name, column in found.columns().items():
        np.testing.assert_allclose(table[name], column, rtol=1e-9)
    amplitude, omega = found["amplitude"], np.sqrt((SPRING + SLIDER) / MASS)
    stuck = amplitude < 0.8 * LIMIT / SLIDER
    np.testing.assert_allclose(found["frequency"][stuck], omega / (2 * np.pi), rtol=1e-4)
    np.testing.assert_allclose(found["damping_ratio"][stuck], DAMPER / (2 * MASS * omega), rtol=2e-3)
    slides = amplitude > 8 * LIMIT / SLIDER
    assert stuck.sum() > 10 and slides.sum() > 4
    np.testing.assert_allclose(found["frequency"][slides], found["mode_frequency"][slides], rtol=2e-3)
    np.testing.assert_allclose(found["damping_ratio"][slides], found["mode_damping_ratio"][slides], rtol=0.03)
    assert f"from {found['frequency'][0]:.6g} Hz" in (folder / "ring_down.html").read_text()


def test_mistakes_name_their_keys(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for key, value in (("down_to", 2), ("periods", 1), ("amplitude", -1.0), ("colour", 1), ("normal_force", 2.0)):
        refused_command(["ring-down", "case.toml", "--set", f"ring_down.{key}={value}"], capsys, f"ring_down.{key}")
    assert not (case / "build" / "rung").exists()

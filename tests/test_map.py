"""A map over frequency and normal force: its points are those of a response, its lowest ridge is the optimum."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusals import refused, refused_command
from test_ring_down import CASE, SYSTEM

import microslip as ms
from microslip.cli import main
from microslip.stages.answer import CaseJob
from microslip.verbs import map as of_map


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "mass").mkdir()
    (tmp_path / "mass" / "system.toml").write_text(SYSTEM)
    swept = CASE.replace("normal_force = 10.0\n", "").replace("points = 61", "points = 25\nnormal_forces = [5.0, 60.0]")
    (tmp_path / "case.toml").write_text(swept)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_harmonics_that_follow_from_an_error_are_those_of_the_response(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It took the three with which a response begins; without a response nothing is taken."""
    auto = 'harmonics="auto"'
    refused_command(["map", "case.toml", "--set", auto], capsys, "harmonics", "respond")
    made = folder / "build" / "rung"
    made.mkdir(parents=True)
    (made / "response.json").write_text('{"harmonics": 14}')
    job = CaseJob(folder / "case.toml", {}, made, [auto], swept=True)
    assert job.settings.number_of_harmonics == job.raw["harmonics"] == 14
    assert CaseJob(folder / "case.toml", {}, made, [auto]).settings.looks_for_harmonics


@pytest.mark.slow
def test_points_ridge_and_optimum(folder: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None) -> None:
    """Interrupted, it goes on where it was; a point is that of the response in Python, the lowest place of its ridge
    that of `optimum`."""
    asked, done = ["map", "case.toml", "--set", "map.forces=6"], []
    respond = of_map._responded

    def interrupted(*given: object) -> object:
        done.append(1)
        if len(done) == 3:
            raise KeyboardInterrupt
        return respond(*given)

    with monkeypatch.context() as patched:
        patched.setattr(of_map, "_responded", interrupted)
        assert main(asked) == 130
    done.clear()
    with monkeypatch.context() as patched:
        patched.setattr(of_map, "_responded", lambda *given: done.append(1) or respond(*given))
        assert main(asked) == 0
    made = folder / "build" / "rung"
    ridge, points = ms.load(made / "map.h5"), ms.load(made / "map_points.h5")
    assert len(done) == len(ridge) - 2
    force = np.unique(points["normal_force"])[3]
    own = points["normal_force"] == force
    built = ms.assemble("case.toml", normal_force=float(force))
    exact = np.abs(ms.harmonic_response(built, points["frequency"][own], harmonics=3).amplitude)
    np.testing.assert_allclose(points["amplitude"][own], exact, rtol=2e-3)  # other samples of a cycle
    assert main(["optimum", "case.toml", "--points", "6"]) == 0
    table = np.genfromtxt(made / "optimum.csv", delimiter=",", names=True)
    best = np.nanargmin(table["amplitude_m"])
    assert ridge.facts["optimal_normal_force_N"] == pytest.approx(table["normal_force_N"][best], rel=1e-6)
    assert np.nanmin(ridge["amplitude"]) == pytest.approx(table["amplitude_m"][best], rel=1e-6)


def test_an_analysis_from_python(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its datasets and sentences; nothing is written beside the case."""
    case = folder / "case.toml"
    case.write_text(case.read_text().replace("points = 25", "points = 7").replace("harmonics = 3", "harmonics = 1"))
    answer = ms.analyse("map", "case.toml", forces=3, low=20.0)
    ridge = answer.data[""]
    assert ridge["normal_force"][[0, -1]] == pytest.approx([20.0, 60.0])
    assert ridge.facts["optimal_normal_force_N"] in ridge["normal_force"] and "lowest" in answer.sentences[0]
    assert ridge.to_xarray()["amplitude"].attrs["units"] == "m"
    assert not list((folder / "build").glob("rung/*"))
    refused("ring-down", ms.analyse, "colours", "case.toml")
    refused("map.high", ms.analyse, "map", "case.toml", high=-1.0)


def test_mistakes_name_their_keys(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for key, value in (("forces", 1), ("low", -1.0), ("colour", 1)):
        refused_command(["map", "case.toml", "--set", f"map.{key}={value}"], capsys, f"map.{key}")
    refused_command(["map", "case.toml", "--set", "map.high=2.0", "--set", "map.low=3.0"], capsys, "high")
    refused_command(["map", "case.toml", "--set", "contacts.sole.normal_force=3.0"], capsys, "presses nothing")

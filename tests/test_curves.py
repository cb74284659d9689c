"""Responses followed by arclength from the command line: every point a solution; interrupted, resumed, ended early."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused_command

from microslip.basis import write_basis
from microslip.case import load_case
from microslip.case.assemble import build
from microslip.case.curves import Followed
from microslip.case.problem import problem_of
from microslip.cli import main
from microslip.continuation import Settings
from microslip.data import ModalBasis
from microslip.harmonic_balance import reduced
from microslip.harmonic_balance.families import followed, of_frequency, of_load
from microslip.harmonic_balance.response import operating
from microslip.harmonic_balance.solver import newton, solve
from microslip.results import read_response
from microslip.stages import surveying
from microslip.stages.answer import Written, case_job
from microslip.system import Body, Contact, Force, Monitor, Spring, System

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

CASE = """
name = "lifting"
body = "lifting"
excitation = "push"
amplitude = 0.25
monitor = "middle"
direction = "z"
harmonics = 1
samples = 64
[[contacts]]
interface = "sole"
law = "smooth"
normal_stiffness = 1e6
tangential_stiffness = 1e6
friction = 0.3
points = [1, 1]
[sweep]
start = 100.0
stop = 140.0
points = 13
normal_forces = [10.0]
"""
BACK = "[curve]\nband = [140.0, 100.0]\n"


def lifting() -> ModalBasis:
    """A block of 2 kg pressed on the ground and shaken along the normal: it lifts off, and its resonance leans over."""
    block = Body("block", 2.0, (0.0, 0.0, 0.0), inertia=(0.01, 0.02, 0.015))
    legs = [Spring("ground", "block", (2e5, 2e5, 2e5, 500.0, 500.0, 500.0))]
    sole = Contact("sole", "block", (0, 0, -1), t2=(0, 1, 0), at=(0, 0, -0.02))
    push, middle = Force("push", "block", (0, 0, 1)), Monitor("middle", "block")
    return System("lifting", [block], legs, [sole], [push], [middle], ratio=0.01).basis()


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_basis(tmp_path / "basis.h5", lifting())
    (tmp_path / "case.toml").write_text(CASE + BACK)
    return tmp_path / "case.toml"


def rows(name: str) -> dict[str, np.ndarray]:
    with Path(f"build/lifting/{name}").open() as file:
        table = list(csv.DictReader(file))
    return {key: np.array([float(row[key] or "nan") for row in table]) for key in table[0]}


def problem(case: Path, normal: float = 10.0) -> Any:
    return problem_of(build(load_case(case)[0], {"lifting": lifting()}), normal)


@pytest.mark.slow
def test_over_the_frequency(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The curve of `over_frequency` in the table; every point in the response file solves the balance anew."""
    assert main(["respond", "case.toml", "--over", "frequency"]) == 0
    said = capsys.readouterr()
    steps = Settings(points=3000, branch_points=False)  # shorter than from Python: a picture joins the points
    found, plain = rows("over_frequency.csv"), followed(of_frequency(problem(case), 140.0, 100.0), settings=steps)
    np.testing.assert_allclose(2 * np.pi * found["frequency_Hz"], plain.lam, rtol=1e-10)
    folds = found["frequency_Hz"][found["fold"] == 1]
    np.testing.assert_allclose(2 * np.pi * folds, [p.lam for p in plain.of_kind("fold")], rtol=1e-10)
    assert len(folds) >= 2 and "fold" in said.out and found["leg"].max() == len(folds) + 1
    assert "% of the way" in said.err or said.err.count("\n") < 5
    assert found["open"].max() > 0.1 and Path("build/lifting/pictures/over_frequency.png").stat().st_size > 10_000
    page = Path("build/lifting/over_frequency.html").read_text()
    assert "data:image/webp" in page and f"<summary>{len(found['leg'])} rows" in page
    held = read_response("build/lifting/over_frequency.h5").series[0]
    np.testing.assert_allclose(np.abs(held.monitor("middle")[:, 0, 1]), found["amplitude_m"], rtol=1e-10)
    assert not any(name.startswith("curve/") for name in held.arrays)
    for x, f in list(zip(held.arrays["x"], held.frequency, strict=True))[::9]:
        assert newton(problem(case).at(2 * np.pi * f), x).iterations <= 2
    assert main(["respond", "case.toml", "--over", "frequency"]) == 0
    assert "is up to date" in "".join(capsys.readouterr())


def survey(case: Path, *assignments: str, **how: Any) -> Written:
    return surveying.survey_stage(case_job(case, None, assignments, make=False, **how), "frequency")


@pytest.mark.slow
def test_interrupted_and_resumed(case: Path) -> None:
    """Ctrl-C leaves a table, a picture and a response file of what was found; the next call adds the rest."""

    def impatient(text: str) -> None:
        if text.startswith("20 of"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        survey(case, report=impatient)
    half = rows("over_frequency.csv")
    assert len(half["leg"]) >= 20 and not read_response("build/lifting/over_frequency.h5").finished
    assert Path("build/lifting/pictures/over_frequency.png").is_file()
    told: list[str] = []
    _, sentences, _, missing = survey(case, report=told.append)
    resumed = rows("over_frequency.csv")
    assert not missing and sentences and int([t for t in told if "% of the way" in t][0].split()[7]) > 20
    np.testing.assert_array_equal(resumed["frequency_Hz"][: len(half["leg"])], half["frequency_Hz"])
    survey(case, force=True)
    assert rows("over_frequency.csv")["frequency_Hz"] == pytest.approx(resumed["frequency_Hz"], rel=1e-6)
    assert read_response("build/lifting/over_frequency.h5").finished


def test_a_curve_that_reaches_its_end_is_not_said_to_end_early(
    case: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Points that fail their checks are another thing: a tenth of the work is missing at every point."""
    work = reduced.work
    monkeypatch.setattr(reduced, "work", lambda *given: tuple(np.array(work(*given)) * [1.1, 1.0, 1.0, 1.0]))
    assert main(["respond", "case.toml", "--over", "frequency", "--set", "curve.band=[120.0, 118.0]"]) == 1
    said = capsys.readouterr()
    count = len(rows("over_frequency.csv")["leg"])
    assert f"error: {count} points did not converge; " in said.err
    assert "early" not in said.out + said.err and rows("over_frequency.csv")["frequency_Hz"][-1] == 118.0


def test_ended_early_and_gone_on(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Too few points are said, with exit code 1; more of them go on from there. No start is said too."""
    few = ["respond", "case.toml", "--over", "frequency", "--set", "curve.points=8"]
    assert main(few) == 1
    said = capsys.readouterr()
    assert "allow more to go on (curve.points)" in said.out and "1 of 1 curve ends early" in said.err
    assert len(rows("over_frequency.csv")["leg"]) == 8
    told: list[str] = []
    survey(case, "curve.points=16", report=told.append)
    assert [int(t.split()[7]) for t in told if "% of the way" in t][0] > 8


def test_no_start_is_said(case: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    from microslip.harmonic_balance import families

    failed = newton(problem(case).at(300.0), np.full(problem(case).size, np.nan))
    monkeypatch.setattr(families, "solve", lambda *_: failed)
    assert main(["respond", "case.toml", "--over", "frequency", "-q"]) == 1
    assert main(["respond", "case.toml", "--over", "frequency"]) == 1
    assert "no start: not a number; begin elsewhere than at 140 Hz (curve.band)." in capsys.readouterr().out


@pytest.mark.slow
def test_one_that_comes_back_is_followed_by_another(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Begun among three motions, closed, the curve turns at lift-off and comes back: the one from the other end is the
    curve of `over_frequency` from there. Interrupted in the second, both go on to the same points."""
    there = ["curve.band=[103.0, 140.0]"]

    def impatient(text: str) -> None:
        begun.append(text)
        if text.startswith("20 of") and any("from 140 Hz" in t for t in begun):
            raise KeyboardInterrupt

    begun: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        survey(case, *there, report=impatient)
    assert main(["respond", "case.toml", "--over", "frequency", "--set", *there]) == 0
    said, found = capsys.readouterr().out, rows("over_frequency.csv")
    assert "comes back to 103 Hz, where it began, and misses 140 Hz; another one begins there" in said
    held = read_response("build/lifting/over_frequency.h5")
    first, second = (s.parameter for s in held.series)
    assert first[[0, -1]].tolist() == [103.0, 103.0] and second[[0, -1]].tolist() == [140.0, 103.0]
    steps = Settings(points=3000, branch_points=False)
    plain = followed(of_frequency(problem(case), 140.0, 103.0), settings=steps)
    np.testing.assert_allclose(2 * np.pi * second, plain.lam, rtol=1e-9)
    of = found["leg"] > found["leg"][len(first) - 1]
    np.testing.assert_array_equal(of, np.arange(len(of)) >= len(first))
    assert (found["leg"] == 1 + np.cumsum(found["fold"]) - found["fold"] + of).all()


@pytest.mark.parametrize(("status", "last", "complete", "leaves_out"), [
    ("bound: lambda has reached 880", 140.0, True, False), ("bound: lambda has reached 647", 103.0, False, True),
    ("stuck: no step is short enough", 120.0, False, True), ("points: 2 are found", 120.0, False, False),
])  # fmt: skip
def test_which_end_was_reached(status: str, last: float, complete: bool, leaves_out: bool) -> None:
    ends = [{"parameter": f, "fold": 0, "monitors/middle": np.ones((1, 2), dtype=complex)} for f in (103.0, last)]
    one = Followed("frequency", 10.0, None, (103.0, 140.0), "", ends, status)
    assert (one.complete, one.leaves_out) == (complete, leaves_out)
    assert not replace(one, legs=1).leaves_out and len(one.sentences()) == 2 - complete


@pytest.mark.slow
def test_over_the_load(case: Path) -> None:
    """At the resonance, if no frequency is given; the end of the curve is a motion under the whole load."""
    case.write_text(CASE + "[curve]\nload = [0.1, 1.0]\n")
    assert main(["respond", "case.toml", "--over", "load", "-q"]) == 0
    found = rows("over_load.csv")
    f = found["at_frequency_Hz"][0]
    assert 100 < f < 125 and found["load"][[0, -1]].tolist() == [0.1, 1.0]
    family = of_load(problem(case), f, 0.1, 1.0)
    last = family.points(followed(family))[-1]
    np.testing.assert_allclose(found["amplitude_m"][-1], abs(operating(problem(case), last).outputs[0, 1]), rtol=1e-6)


def test_over_the_normal_force(case: Path) -> None:
    """In newtons, from the larger to the smaller: at both ends the motion of a case pressed so."""
    case.write_text(CASE.replace("[10.0]", "[15.0, 9.0]") + "[curve]\nfrequency = 100.0\nnormal_force = [15.0, 9.0]\n")
    assert main(["respond", "case.toml", "--over", "normal-force", "-q"]) == 0
    found = rows("over_normal_force.csv")
    np.testing.assert_allclose(found["normal_force_N"][[0, -1]], [15.0, 9.0], rtol=1e-12)
    (kept,) = read_response("build/lifting/over_normal_force.h5").series
    np.testing.assert_allclose(kept.parameter, found["normal_force_N"], rtol=1e-12)
    assert kept.to_xarray().parameter.units == "N" and kept.plot().get_xlabel() == "normal force in N"
    for i, normal in ((0, 15.0), (-1, 9.0)):
        anew = problem(case, normal)
        exact = operating(anew, solve(anew, 2 * np.pi * 100.0, [])).outputs[0, 1]
        assert found["amplitude_m"][i] == pytest.approx(abs(exact), rel=1e-7)


OWN_FORCE = CASE.replace("normal_forces = [10.0]\n", "").replace("[1, 1]", "[1, 1]\nnormal_force = 10.0")


@pytest.mark.parametrize(
    ("text", "over", "words"),
    [
        (CASE + "[curve]\nband = [120.0, 120.0]", "frequency", "band: give two different values, first and last"),
        (CASE + "[curve]\nband = [120.0]", "frequency", "band"),
        (CASE + "[curve]\nload = [0.0, 1.0]", "load", "load"),
        (CASE + "[curve]\nnormal_force = [-1.0, 1.0]", "normal-force", "normal_force"),
        (CASE, "normal-force", "curve.normal_force: give [first, last] in N"),
        (CASE, "weather", "weather"),
        (OWN_FORCE, "normal-force", "press no contact"),
        (CASE.replace("smooth", "jenkins").replace("points = [1, 1]\n", ""), "normal-force", "contacts.sole.law"),
        (CASE.replace("start = 100.0", "start = 131.0"), "load", "no resonance in the band; widen the sweep"),
    ],
)
def test_mistakes_are_one_sentence(
    case: Path, capsys: pytest.CaptureFixture[str], text: str, over: str, words: str
) -> None:
    case.write_text(text)
    refused_command(["respond", "case.toml", "--over", over], capsys, words)

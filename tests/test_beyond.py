"""Where a sweep jumps, ends at a fold or leaves a gap: folds are no resonances, and motions in time say what moves."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from test_curves import CASE, lifting, problem
from test_edges import modes

import microslip as ms
from microslip.basis import read_basis, write_basis
from microslip.case import load_case
from microslip.case.assemble import build
from microslip.case.beyond import Beyond, with_curve
from microslip.case.curves import Followed
from microslip.case.messages import CUT, what_moves
from microslip.case.problem import problem_of
from microslip.cli import main
from microslip.continuation import Branch, Settings
from microslip.harmonic_balance import FrequencyResponse
from microslip.harmonic_balance.checkpoint import resumed_curve
from microslip.harmonic_balance.families import followed, of_frequency
from microslip.harmonic_balance.response import filled_response, operating
from microslip.harmonic_balance.solver import solve, sweep
from microslip.harmonic_balance.stability import Stability
from microslip.harmonic_balance.sweeps import ends, gaps
from microslip.results import Journal, open_journal, read_response
from microslip.stages.places import modal_files
from microslip.time_domain.swept import SettledMotion, Sweeps, SweptMotions, TimeIsOver, settled

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")


def swept(frequency: list[float], amplitude: list[float], lost: tuple[float, ...] = ()) -> FrequencyResponse:
    """A sweep by 10 Hz and what was added between; lost: where it has no solution."""
    f = np.array(frequency)
    r = replace(modes(f, (1e3, 0.01, 1.0)), monitor=np.array(amplitude, dtype=complex), added=f % 10 != 0)
    return replace(r, converged=~np.isin(f, lost))


FOLDED = swept([400, 410, 420, 423.166, 423.169, 430, 440], [42, 49, 60, 69, 80, 77, 73], (423.169, 430))
JUMPS = swept([110, 120, 122.091, 122.092, 130], [1, 4, 10, 11.8, 2])
SMOOTH = swept([100, 110, 113, 120], [1, 4, 9, 3])
NARROW = swept([100, 110, 110.1, 120], [1, 4, 9, 3])


@pytest.mark.parametrize(
    ("found", "peaks", "turns", "beside"),
    [
        (FOLDED, [(423.166, 69)], [True], [(423.166, 440)]),
        (JUMPS, [(114.1, 16.5), (122.091, 10.0)], [False, True], [(114.1, 122.092)]),
        (SMOOTH, [(113, 9)], [False], []),
        (NARROW, [(110.1, 9)], [False], []),
    ],
)
def test_where_a_sweep_ends_is_no_resonance(
    found: FrequencyResponse, peaks: list, turns: list[bool], beside: list
) -> None:
    """The last solution before a gap or a jump is an end; a peak that overhangs, or lies between points, is none. What
    is looked at reaches from an overhanging peak to the jump, and over all points without a solution."""
    assert ends(found, peaks) == turns
    np.testing.assert_allclose(gaps(found, [p for p, turn in zip(peaks, turns, strict=True) if not turn]), beside)


def motion(frequency: float, amplitude: float, opens: bool = False, least: float = 1.0) -> SettledMotion:
    """In µm; least: of its swings, over the largest."""
    a = 1e-6 * amplitude
    return SettledMotion(frequency, a, a, least * a, opens, None)  # type: ignore[arg-type]


def test_what_is_said_of_two_motions() -> None:
    """A joint that opens: which motion from rest, how high the other one is, where each sweep leaves its own, where it
    is irregular."""
    down = [
        motion(430, 70, True),
        motion(420, 75, True),
        motion(410, 80, True),
        motion(400, 90, True, 0.5),
        motion(390, 120, True),
        motion(380, 30),
    ]
    up = [
        motion(380, 30),
        motion(390, 38),
        motion(400, 42),
        motion(410, 49),
        motion(420, 74, True),
        motion(430, 70),
    ]
    rest = [motion(390, 38), motion(400, 88, True), motion(410, 81, True)]
    said = what_moves(Beyond(100.0, (410.0, 420.0), up, down, rest))
    assert "from 390 to 410 Hz" in said[0] and "120 µm at 390 Hz" in said[0] and "F_N = 100 N" in said[0]
    assert "lower one at 390 Hz" in said[1] and "higher one from 400 to 410 Hz" in said[1] and "88 µm" in said[1]
    assert "upwards" in said[2] and "lower one up to 410 Hz (49 µm)" in said[2] and "74 µm at 420 Hz" in said[2]
    assert "downwards" in said[3] and "down to 390 Hz (120 µm)" in said[3] and "30 µm at 380 Hz" in said[3]
    assert "irregular" in said[4] and "400 Hz" in said[4] and len(said) == 5
    (same,) = what_moves(Beyond(100.0, (410.0, 420.0), up, up[::-1]))
    assert "same motion" in same
    assert "no form in time" in what_moves(Beyond(100.0, why="no form in time"))[0]


def test_motions_in_time_beside_unstable_ones_are_told() -> None:
    """Of a curve two motions are unstable. Beside one motions in time swing as high, 4 % less in
    some periods; at the middle branch, between the two motions of the sweeps, there is none."""
    up = [motion(400, 42), motion(410, 49), motion(420, 74, least=0.96), motion(430, 70)]
    down = [motion(430, 70), motion(420, 75), motion(410, 80), motion(400, 30)]
    at = [(430.0, 70.0, True), (421.0, 75.5, False), (411.0, 62.0, False)]
    rows = [{"parameter": f, "monitors/tip": 1e-6 * np.array([[0, a]]), "fold": False} for f, a, _ in at]
    curve = Followed("frequency", 100.0, None, (430.0, 400.0), "one", rows, "bound: left")
    looked = {i: Stability(np.ones(1, complex), np.zeros(1), ok, "") for i, (*_, ok) in enumerate(at)}

    def said(some: dict[int, Stability]) -> str:
        b = Beyond(100.0, (410.0, 420.0), up, down, curves=[curve], samples=256, stability=[some])
        return what_moves(b)[-1]

    both = said(looked)
    assert "1 of 3 motions" in both and "between 411 and 421 Hz" in both
    assert "at 421 Hz" in both and "as high" in both and "up to 4 %" in both and "not reached" not in both
    middle = said({2: looked[2]})
    assert "at 411 Hz" in middle and "as high" not in middle


def test_a_motion_from_rest_is_that_of_the_balance(case: Path) -> None:
    """Of a block that does not lift off at 110 Hz: the amplitude of the harmonic balance to a per cent, regular."""
    p = problem(case)
    at_rest = settled(p.assembly, 110.0, 300)
    balanced = abs(operating(p, solve(p, 2 * np.pi * 110.0, [])).outputs[0, 1])
    assert at_rest.like(float(balanced), 0.01) and not at_rest.irregular and not at_rest.opens


def test_a_motion_ends_with_its_time_and_portions_change_nothing(case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of contacts of 1e9 N/m, whose steps are many: cut in its first periods, before any look. With all the time it
    is the same motion in portions of a period as in long ones."""
    p = problem(case)
    case.write_text(CASE.replace("1e6", "1e9"))
    stiff, began = problem(case), time.process_time()
    with pytest.raises(TimeIsOver):
        settled(stiff.assembly, 110.0, 300, patience=1e-3)
    assert time.process_time() - began < 10.0
    whole = settled(p.assembly, 110.0, 300)
    monkeypatch.setattr("microslip.time_domain.swept.PORTION", 0.0)
    assert settled(p.assembly, 110.0, 300).amplitude == whole.amplitude


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A block of 2 kg that lifts off: its resonance leans over to lower frequencies."""
    monkeypatch.chdir(tmp_path)
    write_basis(tmp_path / "basis.h5", lifting())
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path / "case.toml"


def test_motions_that_take_too_long_are_told_in_part() -> None:
    """Where they ended, and no verdict on what was not seen."""
    down = [motion(430, 70, True), motion(420, 75, True)]
    said = what_moves(Beyond(100.0, down=down, cut=("upwards", 420.0), patience=120.0))
    assert "in part" in said[0] and "75 µm at 420 Hz" in said[0]
    assert "120 s, upwards before 420 Hz" in said[1] and "sweep.patience=240" in said[1]
    assert not any("same motion" in words for words in said)


class Bistable:
    """In place of integrations, 1 s each: below 121 Hz a motion of 1 µm, above 102 Hz one of 10 µm,
    each kept while it is there."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock, self.ends, self.asked = 0.0, np.inf, list[float]()
        monkeypatch.setattr("microslip.time_domain.swept.settled", self)
        none = SimpleNamespace(converged=False)
        monkeypatch.setattr("microslip.time_domain.swept.between", lambda *_: none)
        now = SimpleNamespace(process_time=lambda: self.clock)
        monkeypatch.setattr("microslip.time_domain.swept.time", now)

    def __call__(self, _: object, f: float, *more: object) -> SettledMotion:
        if len(self.asked) == self.ends:
            raise KeyboardInterrupt
        begin = more[1]
        self.clock += 1.0
        self.asked.append(f)
        was_high = begin is not None and begin.amplitude > 5e-6 or more[2] is not None and f > 121
        a = 1e-5 if f > 102 and (was_high or f > 121) else 1e-6
        return SettledMotion(f, a, a, a, a > 5e-6, [np.array([[a, 0.0]]), np.array([True])])


def sweeps(case: Path, patience: float, journal: Journal | None = None) -> SweptMotions:
    """Of the bistable motion about a jump at 121 Hz; the balance knows the lower one below, the
    higher one above."""
    f = np.arange(90.0, 141.0, 4.0)
    p = problem(case)
    found = SimpleNamespace(
        frequency=f,
        asked=f > 0,
        converged=f > 0,
        monitor=np.where(f > 121, 1e-5, 1e-6),
        x=np.zeros((len(f), 1)),
    )
    return Sweeps(p, found, (120.9, 121.1), 10.0, lambda _: None, patience, journal).motions()


def table(motions: Sequence[SettledMotion]) -> list[tuple[float, float, bool]]:
    return [(m.frequency, m.amplitude, m.opens) for m in motions]


def test_sweeps_find_both_ends_of_a_motion(case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within an eighth of a step, from above and from below; from rest it is the lower one
    between."""
    Bistable(monkeypatch)
    m = sweeps(case, 1e3)
    high = [s.frequency for s in m.down if s.opens]
    assert m.cut is None and 102 < min(high) <= 102.5 and m.down[0].frequency == 126
    low = [s.frequency for s in m.up if not s.opens]
    assert 120.5 <= max(low) <= 121 and m.up[0].frequency == m.down[-1].frequency
    assert len(m.rest) == 4 and not any(s.opens for s in m.rest)
    said = what_moves(Beyond(10.0, (120.9, 121.1), *m[:3]))
    assert "upwards stays on the lower one" in said[2] and "10 µm at 121.5 Hz" in said[2]


@pytest.mark.parametrize("calls", [1, 7, 20])
def test_motions_in_time_are_gone_on_with(case: Path, monkeypatch: pytest.MonkeyPatch, calls: int) -> None:
    """Interrupted, or cut for want of patience: with what was kept the answer is that of one run,
    nothing twice, and the time counts that of both."""
    fake = Bistable(monkeypatch)
    whole, count = sweeps(case, 1e3), len(fake.asked)
    fake.asked, fake.ends = [], calls
    with open_journal(case.parent / "m", "same", {}) as journal, pytest.raises(KeyboardInterrupt):
        sweeps(case, 1e3, journal)
    fake.ends = np.inf
    with open_journal(case.parent / "m", "same", {}) as journal:
        part, fake.ends = sweeps(case, 10.0, journal), np.inf
        assert part.cut is not None and part.cut[0] == "downwards"
        assert len(part.down) > 4 and set(table(part.down)) <= set(table(whole.down))
        again = sweeps(case, 1e3, journal)
    assert [table(way) for way in again[:3]] == [table(way) for way in whole[:3]]
    # a sweep upwards after one that was cut begins elsewhere
    assert count <= len(fake.asked) <= count + len(part.up)


@pytest.mark.slow
def test_a_curve_begins_on_the_solution_of_the_sweep(case: Path) -> None:
    """Of the two motions at 118 Hz the one that is known, with as many harmonics or more; without it the lower one."""
    pressed = build(load_case(case)[0], {"lifting": lifting()})
    p = problem_of(pressed, 10.0)
    low = solve(p, 2 * np.pi * 118.0, [])
    high = max((low.x * c for c in (3.0, 5.0)), key=lambda x: np.abs(solve(p, low.Omega, [x]).x).max())
    high = solve(p, low.Omega, [high]).x
    assert np.abs(high).max() > 2 * np.abs(low.x).max()
    for harmonics in (1, 2):
        q = problem_of(pressed, 10.0, harmonics=harmonics)
        family = of_frequency(q, 118.0, 119.0)
        begins = {}
        for known in (None, high):
            x = followed(replace(family, known=known), settings={"points": 2}).points[0].x
            begins[known is None] = np.abs(x).max()
        assert begins[True] == pytest.approx(np.abs(low.x).max(), rel=0.1)
        assert begins[False] == pytest.approx(np.abs(high).max(), rel=0.1)


@pytest.mark.slow
def test_a_curve_with_more_harmonics_begins_on_the_motion_that_fewer_tell(case: Path) -> None:
    """At 96 Hz Newton's method leaps from the upper motion of one harmonic to the closed one, a
    thirtieth as high; admitted little by little, more harmonics change it by a few hundredths, as
    they do at 100 Hz, where Newton's method stays."""
    settings, path = load_case(case, ["amplitude=0.5"])[0], {"lifting": lifting()}
    one, more = (problem_of(build(settings, path), 10.0, harmonics=n) for n in (1, 7))
    known = {round(p.Omega / (2 * np.pi)): p for p in sweep(one, np.arange(150.0, 94.0, -2.0))}
    size = lambda x: np.abs(x).max()  # noqa: E731
    high, at = known[96].x, 2 * np.pi * 96.0
    guess = np.concatenate([high, np.zeros(more.size - len(high))])
    assert size(solve(more, at, [guess]).x) < 0.1 * size(high)
    for f in (96, 100):
        family = replace(of_frequency(more, f, f + 1.0), known=known[f].x)
        begins = followed(family, settings={"points": 2}).points[0].x
        assert size(begins) == pytest.approx(size(known[f].x), rel=0.05)


@pytest.mark.slow
def test_patience_that_ends_is_told_and_more_of_it_goes_on(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The sweep and its resonances stay, the sentence says where the motion in time was cut and what to type; with more
    time there are motions in the table."""
    table = Path("build/lifting/motions.csv")

    def run(patience: float) -> tuple[str, list[dict], dict]:
        assert main(["respond", "case.toml", "--set", f"sweep.patience={patience:g}"]) == 0
        rows = list(csv.DictReader(table.open())) if table.exists() else []
        return capsys.readouterr().err, rows, json.loads(Path("build/lifting/response.json").read_text())

    said, rows, summary = run(1e-3)
    ends = "Motions in time ended with their share of 0.001 s, downwards before "
    assert ends in said and "--set sweep.patience=0.002, which goes on from there" in said
    assert not rows and "not known" in summary["beyond"][0] and summary["resonances"]
    more, further, after = run(10.0)
    assert said.count("motion in time, ") <= 2 and more.count("motion in time, ") >= len(further) > 0
    at = [[r["frequency_Hz"] for r in s["resonances"]] for s in (summary, after)]
    assert ends not in more and at[0] == at[1]


def test_a_curve_whose_time_is_over_goes_on_with_more_of_it(case: Path) -> None:
    """Cut by what its steps really took; gone on with the time is counted from there, and all its
    points are those of one go."""
    family, steps = of_frequency(problem(case), 126.0, 122.0), Settings(points=40)

    def curve(name: str, seconds: float) -> tuple[Branch, list[dict], list[float]]:
        told = list[float]()

        def spend(took: float) -> bool:
            told.append(took)
            return sum(told) <= seconds

        with open_journal(case.parent / name, "same", {}) as journal:
            return *resumed_curve(family, journal, "one", settings=steps, spend=spend), told

    whole, rows, took = curve("whole", np.inf)
    part, some, told = curve("part", 1e-9)
    assert whole.status and not part.status and 2 <= len(some) < len(rows)
    assert took[0] == took[1] == told[1] == 0 < told[-1]  # the first step compiles
    assert curve("part", 1e-9)[2] == [sum(told)] and len(curve("part", 1e-9)[1]) == len(some)
    after, more, _ = curve("part", np.inf)
    assert after.status == whole.status
    for one, other in zip(more, rows, strict=True):  # scaled and back, which rounds
        assert one["parameter"] == pytest.approx(other["parameter"], rel=1e-12)
        np.testing.assert_allclose(one["x"], other["x"], rtol=0, atol=1e-9 * np.abs(other["x"]).max())


@pytest.mark.slow
def test_the_curve_and_its_stability_end_with_the_time_of_their_place(case: Path) -> None:
    """Motions have spent all but 10 ms: the curve from above has a few points, that from below is
    not begun, nothing is looked at, and the page says how to go on; which does."""
    settings, _ = load_case(case, [])
    lies = {"lifting": lifting()}
    f, p = np.linspace(118.0, 126.0, 5), problem(case)
    found = filled_response(p, f)
    low, high = [motion(x, 1) for x in f], [motion(x, 10) for x in f]

    @contextmanager
    def keep(_: object) -> Iterator[Journal]:
        with open_journal(case.parent / "curve.points", "same", {}) as journal:
            yield journal

    def asked(patience: float) -> Beyond:
        one = Beyond(10.0, (119.0, 125.0), low, high, patience=patience, spent=100.0)
        return with_curve(one, found, settings, lies, keep, lambda _: None)

    cut, whole = asked(100.01), asked(1e3)
    (one,) = cut.curves
    assert one.status == CUT and 0 < len(one.rows) < len(whole.curves[0].rows)
    assert cut.stability == [{}] and any(whole.stability)
    assert "sweep.patience=200.02, which goes on from there" in " ".join(what_moves(cut))
    assert not any("goes on from there" in words for words in what_moves(whole))
    np.testing.assert_array_equal(whole.curves[0].parameter[: len(one.rows)], one.parameter)


@pytest.mark.slow
def test_what_is_known_is_written_before_motions_in_time(
    case: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They take long, and may be interrupted: table and page are there, without a resonance where the sweep jumps."""

    def interrupted(*_: object) -> Beyond:
        raise KeyboardInterrupt

    monkeypatch.setattr("microslip.case.run.beyond", interrupted)
    assert main(["respond", "case.toml"]) == 130
    assert "response.html has what is known so far" in capsys.readouterr().err
    page = Path("build/lifting/response.html").read_text()
    assert "Motions in time are not on this page yet" in page
    assert not Path("build/lifting/response.json").exists()
    rows = list(csv.DictReader(Path("build/lifting/response.csv").open()))
    assert len(rows) > 10 and not Path("build/lifting/motions.csv").exists()


@pytest.mark.slow
def test_a_response_that_jumps_is_integrated_in_time(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The sweep jumps at 122 Hz; the motion that lifts off is three to thirty times as high below, and a sweep in time
    downwards follows it, one upwards and starts from rest do not: on page, terminal, table. Its amplitudes are those
    of the balance with 7 harmonics on the curve that leans over, to 2 %."""
    assert main(["respond", "case.toml"]) == 0
    told = capsys.readouterr().err
    rows = list(csv.DictReader(Path("build/lifting/motions.csv").open()))
    way = {w: {float(r["frequency_Hz"]): r for r in rows if r["way"] == w} for w in ("upwards", "downwards")}
    up, down = ({f: float(r["amplitude_m"]) for f, r in way[w].items()} for w in way)
    both = [f for f in up if f in down and 106 < f < 121]
    assert len(both) == 5 and all(down[f] > 3 * up[f] for f in both) and down[both[0]] > 25 * up[both[0]]
    at_rest = [r for r in rows if r["way"] == "from rest"]
    assert at_rest and all(
        float(r["amplitude_m"]) == pytest.approx(up[float(r["frequency_Hz"])], rel=0.02) for r in at_rest
    )
    series = read_response("build/lifting/response.h5").series[0]
    np.testing.assert_allclose([up[f] for f in both], np.interp(both, series.key, series.amplitude), rtol=0.02)
    summary, page = (
        json.loads(Path("build/lifting/response.json").read_text()),
        Path("build/lifting/response.html"),
    )
    for words in summary["beyond"]:
        assert words in told and words.split("F_N = 10 N")[-1] in page.read_text()
    assert "Motions in time" in page.read_text() and "from rest" in page.read_text()
    assert all(row["frequency_Hz"] < 121 for row in summary["resonances"])
    curve = ms.follow(
        build(load_case(case)[0], {"lifting": lifting()}).pressed(10.0),
        140.0,
        106.0,
        harmonics=7,
        samples=256,
    )
    for f in both[1:]:
        assert down[f] == pytest.approx(highest(curve.parameter, curve.amplitude, f), rel=0.02)


def highest(parameter: np.ndarray, amplitude: np.ndarray, at: float) -> float:
    """Of a curve's motions at a value of its parameter."""
    way = (parameter[:-1] - at) * (parameter[1:] - at) <= 0
    share = ((at - parameter[:-1]) / np.diff(parameter))[way]
    return float((amplitude[:-1][way] + share * np.diff(amplitude)[way]).max())


DRAW = """
import gmsh
gmsh.initialize(readConfigFiles=False, interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
for name, x, z in (("lapA", 0, 0), ("lapB", 80, 4)):
    occ.cut([(3, occ.addBox(x, 0, z, 120, 30, 4))], [(3, occ.addCylinder(100, 15, z - 1, 0, 0, 6, 4.5))])
    occ.synchronize()
    gmsh.write(name + ".step")
    gmsh.clear()
gmsh.finalize()
"""

LAP = """
name = "{name}"
length_unit = "mm"
[geometry]
cad = "../{name}.step"
[mesh]
size = 6.0
[material]
name = "steel"
density = 7850.0
young = 2.1e11
poisson = 0.3
[modes]
count = 20
[damping]
ratio = 0.001
[[geometry.faces]]
name = "meets"
touching = "../{other}.step"
[[interfaces]]
name = "meets"
face = "meets"
[[geometry.faces]]
name = "clamp"
box = [{x}, -1, -1, {x}.1, 31, 9]
[[supports]]
face = "clamp"
[[excitations]]
name = "shaker"
point = [{at}, 15, 4]
direction = [0, 0, 1]
[[monitors]]
name = "probe"
point = [{at}, 15, 4]
"""

JOINT = """
name = "joint"
excitation = "lapA:shaker"
amplitude = 20.0
monitor = "lapA:probe"
direction = "z"
bodies = [{ name = "lapA" }, { name = "lapB" }]
[[contacts]]
interface = "lapA:meets"
against = "lapB:meets"
normal_stiffness = 4.5e+08
tangential_stiffness = 2.3e+08
friction = 0.2
points = [5, 4]
[sweep]
start = 380
stop = 440
points = 7
normal_forces = [100.0]
"""


@pytest.mark.slow
def test_a_lap_joint_from_rest_stays_closed_and_opens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two beams of 120 mm, their far ends clamped, pressed by 100 N where they overlap and shaken by 20 N: two other
    integrations in time have 37.6 µm at 390 Hz, closed, and open from 400 Hz on, 83 µm there and 73 µm at 423 Hz."""
    pytest.importorskip("gmsh")
    monkeypatch.chdir(tmp_path)
    subprocess.run([sys.executable, "-c", DRAW], check=True, capture_output=True)
    for name, other, x in (("lapA", "lapB", 0), ("lapB", "lapA", 200)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "body.toml").write_text(LAP.format(name=name, other=other, x=x, at=60 + 0.4 * x))
    (tmp_path / "case.toml").write_text(JOINT)
    settings = load_case(tmp_path / "case.toml")[0]
    files = modal_files(settings, tmp_path, lambda _: None)
    bases = {name: read_basis(file) for name, file in files.items()}
    pressed = build(settings, bases).pressed(100.0)
    for f, amplitude, opens in (
        (390.0, 37.6e-6, False),
        (400.0, 83e-6, True),
        (423.0, 73e-6, True),
    ):
        one = settled(pressed, f, 640)
        assert one.amplitude == pytest.approx(amplitude, rel=0.06) and one.opens == opens and not one.irregular

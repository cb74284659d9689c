"""The book's mode of a case, and `microslip respond CASE --compare-book`."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from refusals import refused
from test_results import sweep

from microslip.case.checkpoint import series_name
from microslip.case.comparison import Pair, comparison_table, paired, sentence
from microslip.case.messages import lifting
from microslip.cli import main
from microslip.harmonic_balance.orbits import orbits
from microslip.results import read_response, response_of, response_table, write_response
from microslip.results.names import exact
from microslip.stages import response as making
from microslip.stages import running

pytest.importorskip("matplotlib")
pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")
SAMPLES = Path(running.__file__).parents[1] / "samples"

CASE = """
name = "vane"
body = "vane-eigenmodes"
excitation = "magnet"
amplitude = 2.0
monitor = "probe"
harmonics = 1
samples = 48

[[contacts]]
interface = "right"
law = "rough"
roughness = 2e-5
points = [2, 2]
normal_stiffness = 2e5
tangential_stiffness = 4e5
friction = 0.2
includes = "surface"

[sweep]
start = 315.0
stop = 355.0
points = 9
normal_forces = [50.0]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copy(SAMPLES / "basis.h5", tmp_path)
    (tmp_path / "case.toml").write_text(CASE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(making, "_can_draw", lambda: "not in this test")
    return tmp_path


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_both_modes_side_by_side(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One harmonic of both: what is left between them is the swing of the normal force, some per cent here."""
    assert main(["respond", "case.toml", "--compare-book", "--quiet"]) == 0
    build = folder / "build/vane"
    with open(build / "book.csv", newline="") as file:
        (row,) = csv.DictReader(file)
    assert abs(float(row["difference_Hz_percent"])) < 0.3 and 0 < abs(float(row["difference_m_percent"])) < 10
    assert (build / "pictures/book.png").stat().st_size > 5000
    modes = [read_response(f / "response.h5") for f in (build, build / "book")]
    assert [r.mode for r in modes] == ["aft", "book"]
    told = [json.loads((f / "response.json").read_text()) for f in (build, build / "book")]
    assert [summary["mode"] for summary in told] == ["aft", "book"]
    said = f"tables are off by at most {orbits()[1].error:.2g} of what friction holds (orbits)"
    assert any("Book mode" in message and said in message for message in modes[1].messages)
    assert modes[1].series[0].converged.all()
    capsys.readouterr()
    assert main(["respond", "case.toml", "--compare-book"]) == 0  # up to date: nothing is computed again
    out = capsys.readouterr()
    assert "of 9 frequencies" not in out.err and "F_N = 50 N: marched" in out.out


@pytest.mark.slow
@pytest.mark.parametrize("own", ["", pytest.param('mode = "book"\n', marks=pytest.mark.slow)])
def test_points_of_one_mode_serve_both_commands(folder: Path, own: str) -> None:
    """A plain response and the comparison of both modes, after one another: each point is computed once."""
    (folder / "case.toml").write_text(own + CASE)

    def told(ask: Callable[..., Any]) -> tuple[int, int]:
        said: list[str] = []
        ask(folder / "case.toml", None, ["sweep.points=4"], report=said.append)
        return sum("of 4 frequencies" in s for s in said), sum("is up to date" in s for s in said)

    assert told(running.respond) == (4, 0)
    assert told(running.compare_book) == (4, 1)
    assert told(running.respond) == (0, 1)
    assert told(running.compare_book) == (0, 2)
    files = {way: folder / "build/vane" / way / "response.h5" for way in ("", "aft" if own else "book")}
    assert [read_response(f).mode for f in files.values()] == (["book", "aft"] if own else ["aft", "book"])


@pytest.mark.slow
def test_a_case_in_the_books_mode(folder: Path) -> None:
    """`mode` and `strips` in the file: microslip takes energy where without it everything sticks."""
    sticks = ["sweep.normal_forces=[0.4]", "amplitude=0.002", "sweep.start=300.0", "sweep.points=4"]
    lost = []
    for strips in (0, 8):
        running.respond(folder / "case.toml", None, [*sticks, 'mode="book"', f"strips={strips}"])
        found = read_response(folder / "build/vane/response.h5")
        assert found.mode == "book" and found.series[0].arrays["x"].shape[1] == 18
        lost.append(found.series[0].arrays["contacts/right/dissipated"].max())
    assert lost[0] <= 1e-18 < lost[1]


@pytest.mark.parametrize(("amplitude", "told"), [(200.0, True), pytest.param(0.02, False, marks=pytest.mark.slow)])
def test_the_books_mode_says_where_contacts_would_lift_off(folder: Path, amplitude: float, told: bool) -> None:
    few = ['mode="book"', "sweep.start=325.0", "sweep.stop=345.0", "sweep.points=3", f"amplitude={amplitude}"]
    running.respond(folder / "case.toml", None, few)
    messages = json.loads((folder / "build/vane/response.json").read_text())["messages"]
    assert any("points of right would lift off" in r for r in messages) == told


def test_the_contact_of_a_whole_ring_that_lifts_off_is_named() -> None:
    """The last of four, of which the case file names the first alone."""
    contacts = [SimpleNamespace(name=f"right of {i}") for i in range(4)]
    built = SimpleNamespace(settings=SimpleNamespace(mode="book"), assembly=SimpleNamespace(contacts=contacts[:1]))
    ring = SimpleNamespace(assembly=SimpleNamespace(contacts=contacts))
    share = np.zeros((3, 4))
    share[1, 3] = 0.25
    found = SimpleNamespace(converged=np.ones(3, dtype=bool), open=share, frequency=np.array([10.0, 20.0, 30.0]))
    (said,) = lifting(built, ring, found, 5.0)
    assert "points of right of 3 would lift off, for 25 % of points and time at 20 Hz" in said


JENKINS = CASE.replace('law = "rough"\nroughness = 2e-5\npoints = [2, 2]\n', 'law = "jenkins"\n')
BEFORE, AFTER = CASE[: CASE.index("law =")], CASE[CASE.index("\n[sweep]") :]
OF_FILE = f'{BEFORE}file = "contact.toml"\nincludes = "surface"\n{AFTER}'


@pytest.mark.parametrize(
    ("text", "changes", "said"),
    [
        (CASE, ['mode="book"', 'contacts.0.law="jenkins"', "contacts.0.roughness=1"], "roughness"),
        (CASE, ["strips=4"], "strips: belong to mode"),
        (CASE, ['mode="books"'], "mode"),
        (CASE, ['mode="book"', "strips=-1"], "strips"),
        (JENKINS, [], 'case.toml: mode: "book" needs point contacts'),
        (OF_FILE, ['mode="book"'], ("case.toml: contacts.right: book mode: friction StaticSliding", "aft")),
    ],
)
def test_modes_that_are_none(folder: Path, text: str, changes: list[str], said: str | tuple[str, ...]) -> None:
    (folder / "contact.toml").write_text(
        'name = "shroud"\n[stiffness]\nkind = "given"\nnormal = 2e5\ntangential = 4e5\nincludes = "surface"\n'
        '[friction]\nkind = "static-sliding"\nstatic = 0.3\nsliding = 0.2\n'
    )
    (folder / "case.toml").write_text(text)
    run = running.respond if changes else running.compare_book
    refused(said, run, folder / "case.toml", None, changes)


def test_resonances_are_paired_by_frequency() -> None:
    def rows(*peaks: tuple[float, float, float]) -> list[dict[str, float]]:
        return [dict(zip(("normal_force_N", "frequency_Hz", "amplitude_m"), p, strict=True)) for p in peaks]

    marched = rows((10, 100, 1e-6), (10, 300, 2e-6), (20, 110, 1e-6))
    book = rows((10, 303, 3e-6), (10, 101, 1.1e-6), (20, 150, 1e-6))
    pairs = paired(marched, book)
    assert pairs[0] == Pair(10, (100, 1e-6), (101, 1.1e-6)) and pairs[1] == Pair(10, (300, 2e-6), (303, 3e-6))
    assert pairs[2:] == [Pair(20, (110, 1e-6), None), Pair(20, None, (150, 1e-6))]
    assert pairs[0].differences() == pytest.approx((0.01, 0.1))
    assert "+1 % in frequency, +10 % in amplitude" in sentence(pairs[0]) and "no resonance" in sentence(pairs[2])
    assert comparison_table(pairs).splitlines()[3] == "20,110,,,1e-06,,"


def test_the_first_read_out_is_compared(tmp_path: Path) -> None:
    """Whatever others are called: bodies with equal monitors, names that end alike, directions, gauges; by normal
    force, also those that agree in six digits."""
    labels = {"monitors/right:probe": ["u_y", "u_x"], "monitors/left:b-probe": ["u_x"], "monitors/left:probe": ["u_y"]}
    gauges = {"gauges/root": ["strain"], "monitors/probe": ["u_x"]}
    forces = [100.0, 100.00001]
    for told in (labels, gauges):
        head = {"case": "c", "labels": told, "parameters": {series_name(n): {"normal_force": n} for n in forces}}
        values = {name: 1.0 + np.arange(len(rows))[:, None] * np.ones(2) for name, rows in told.items()}
        values[next(iter(told))][0] = 0.25
        points = {
            series_name(n): {f: {"frequency": f, "status": "converged", **values} for f in (10.0, 20.0)} for n in forces
        }
        write_response(tmp_path / "response.h5", response_of(head, points))
        found = running._curves(tmp_path / "response.h5")
        assert list(found) == forces
        np.testing.assert_array_equal(found[100.0], [[10.0, 20.0], [0.25, 0.25]])


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([100.0, 0.25, 1e6, 0.0], ["100", "0.25", "1e+06", "0"]),
        ([100.0, 100.00001], ["100", "100.00001"]),
        ([1234567.0, 1234568.0], ["1234567", "1234568"]),
    ],
)
def test_normal_forces_have_names_of_their_own(values: list[float], texts: list[str]) -> None:
    """Those that differ have series and columns that differ; usual ones the names that they always had."""
    assert [series_name(v) for v in values] == [f"normal force {t} N" for t in texts]
    assert [float(exact(v)) for v in (1 / 3, np.nextafter(1.0, 2.0))] == [1 / 3, np.nextafter(1.0, 2.0)]
    heads = response_table(dict.fromkeys(values, sweep([1.0]))).splitlines()[0].split(",")
    assert len(set(heads)) == len(heads)
    assert response_table({1 / 3: sweep([1.0])}).startswith("frequency_Hz,amplitude_m_FN_0.333333_N")

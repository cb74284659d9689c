"""The response of a case from its files: interrupted, resumed, extended, failing; what stands in its folder."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from refusals import refused
from test_harmonic_balance_laws import sled

from microslip.basis import read_basis, write_basis
from microslip.case import load_case
from microslip.cli import main
from microslip.data import Rows
from microslip.errors import UserError
from microslip.files import store
from microslip.results import read_response
from microslip.stages import response as making
from microslip.stages import running
from microslip.stages.answer import CaseJob, case_job
from microslip.stages.surveying import survey_stage
from microslip.units import METRES, Quantity

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
samples = 24

[[contacts]]
interface = "right"
law = "smooth"
points = [2, 2]
normal_stiffness = 2e5
tangential_stiffness = 4e5
friction = 0.2
includes = "surface"

[sweep]
start = 300.0
stop = 380.0
points = 9
normal_forces = [50.0]

[material_limits]
fatigue_strength = 250e6
tensile_strength = 900e6
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copy(SAMPLES / "basis.h5", tmp_path)
    (tmp_path / "case.toml").write_text(CASE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(making, "_can_draw", lambda: "not in this test")
    return tmp_path


def respond(folder: Path, *changes: str, report: Any = None, **more: Any) -> tuple[list[str], bool]:
    """What was told, and whether all converged."""
    told: list[str] = []

    def tell(text: str) -> None:
        told.append(text)
        if report is not None:
            report(text)

    _, converged = running.respond(folder / "case.toml", None, list(changes), report=tell, **more)
    return told, converged


def computed(told: list[str]) -> list[str]:
    return [t for t in told if "frequencies" in t or t.startswith(("a point is added", "peak near"))]


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_interrupted_and_resumed(folder: Path) -> None:
    """Ctrl-C at the sixth point: five are kept, and readable; the next call computes four, and the peak."""

    def impatient(text: str) -> None:
        if text.startswith("6 of 9"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        respond(folder, report=impatient)
    build = folder / "build" / "vane"
    half = read_response(build / "response.h5")
    assert not half.finished and len(half.series[0].key) == 5 and not (build / "response.json").exists()
    told, converged = respond(folder)
    left = ["6", "7", "8", "9", "a", "peak"]  # a mode between them, the peak
    assert converged and [t.split()[0] for t in computed(told)] == left
    whole = read_response(build / "response.h5")
    assert whole.finished and whole.mode == "aft" and len(whole.series[0].key) == 11
    kept = np.isin(whole.series[0].key, half.series[0].key)
    np.testing.assert_array_equal(whole.series[0].arrays["x"][kept], half.series[0].arrays["x"])
    assert computed(respond(folder)[0]) == []  # up to date


QUICK = (
    CASE.replace('law = "smooth"\npoints = [2, 2]\n', 'law = "jenkins"\n').replace("points = 9", "points = 4")
    .replace("[50.0]", "[1e4]").split("[material_limits]")[0]
)  # fmt: skip
"""Linear, as it sticks, and without margins: it costs little."""


def test_a_run_that_cannot_go_on_says_what_has_changed(folder: Path) -> None:
    """Stopped at the third point; with another load the two that are kept are of another case."""
    (folder / "case.toml").write_text(QUICK)

    def stop_at(begin: str, *changes: str) -> list[str]:
        told: list[str] = []

        def tell(text: str) -> None:
            told.append(text)
            if text.startswith(begin):
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            running.respond(folder / "case.toml", None, list(changes), report=tell)
        return [text for text in told if "anew" in text]

    assert stop_at("3 of 4") == stop_at("4 of 4") == []
    said = "warning: begins anew, without 3 points of a run that did not end; changed since: the case"
    assert stop_at("2 of 4", "amplitude=2.5") == [said]


def test_every_read_out_is_drawn_and_told(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two directions share a picture, a gauge would have its own; the table tells what the others read at resonances of
    the first, as the file has it; lines end where the file's points are."""
    from microslip.pictures import response as pictures

    drawn: list[dict[str, np.ndarray]] = []

    def curves(axes: Any, result: Any, w: Any, *more: Any) -> bool:
        lifts: bool = own(axes, result, w, *more)
        drawn.append({w.name: np.nanmax(axes.get_lines()[-1].get_ydata())})
        return lifts

    own = pictures._curves
    monkeypatch.setattr(pictures, "_curves", curves)
    text = QUICK.replace('monitor = "probe"', "").replace("[sweep]", TWO + "[sweep]")
    (folder / "case.toml").write_text(text)
    respond(folder)
    build = folder / "build" / "vane"
    summary = json.loads((build / "response.json").read_text())
    series = read_response(build / "response.h5").series[0]
    assert summary["read_outs"] == ["probe, x", "probe, y"] and [*map(list, drawn)] == [["probe, x"], ["probe, y"]]
    assert summary["pictures"].keys() >= {"friction response"}
    (row,) = summary["resonances"]
    at = int(np.abs(series.frequency - row["frequency_Hz"]).argmin())
    x, y = np.abs(series.monitor("probe")[at, :, 1])
    assert (row["amplitude_m"], row["probe, y amplitude_m"]) == pytest.approx((x, y), rel=1e-12) and y != x
    for one, (name, values) in zip(drawn, (("probe, x", x), ("probe, y", y)), strict=True):
        assert one[name] >= 1e6 * values * (1 - 1e-9)
    page = (build / "response.html").read_text()
    assert "Resonances are those of probe, x" in page and "probe, y amplitude in" in page


@pytest.mark.parametrize(("harmonics", "given", "found"), [(1, None, 48), (3, None, 48), (9, None, 144), (9, 40, 40)])
def test_samples_follow_the_harmonics_where_none_are_given(
    tmp_path: Path, harmonics: int, given: int | None, found: int
) -> None:
    """Sixteen each, 48 at least; where more harmonics are looked for, they keep as many."""
    (tmp_path / "case.toml").write_text(CASE.replace("samples = 24", "" if given is None else f"samples = {given}"))
    settings, _ = load_case(tmp_path / "case.toml", [f"harmonics={harmonics}"])
    assert settings.marching["samples"] == found
    automatic, _ = load_case(tmp_path / "case.toml", ["harmonics=auto"])
    assert automatic.with_harmonics(7).marching["samples"] == (112 if given is None else 94)


TWO = """
[[monitors]]
monitor = "probe"
direction = "x"

[[monitors]]
monitor = "probe"
direction = "y"

"""


def test_read_outs_share_a_picture_where_they_are_few_and_of_one_unit() -> None:
    from microslip.case.readouts import Readout
    from microslip.pictures.response import together

    x, y, z = (Readout(i, n, "monitors/probe", i, METRES) for i, n in enumerate("xyz"))
    gauge = Readout(3, "root", "gauges/root", 0, Quantity("1"))
    assert together([x, y, gauge], 3) == [x, y] and together([x, y], 4) == [x]
    assert together([gauge, x], 1) == [gauge] and together([x, y, z, z], 1) == [x]


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_what_was_spoiled_is_made_again(folder: Path) -> None:
    """A table cut short, edited, gone; pictures, pages, HDF5 and VTU alike: the same bytes as before, and no point is
    computed twice."""
    respond(folder, "sweep.points=3")
    build = folder / "build" / "vane"
    summary = json.loads((build / "response.json").read_text())
    products = [build / n for n in summary["files"]] + [build / "pictures" / n for n in summary["pictures"].values()]
    whole = {p: p.read_bytes() for p in [*products, build / "response.json"]}
    assert {p.suffix for p in whole} == {".h5", ".csv", ".html", ".json", ".png", ".vtu"}
    for path in products:  # and the summary, which they belong to, is as it was
        path.write_bytes(whole[path][:-1] if path.suffix != ".csv" else whole[path].replace(b",1,", b",2,", 1))
    told, _ = respond(folder, "sweep.points=3")
    assert not any("up to date" in t for t in told) and computed(told) == []
    assert {p.name for p, data in whole.items() if p.read_bytes() != data} == set()
    assert any("up to date" in t for t in respond(folder, "sweep.points=3")[0])


def test_files_of_two_runs_do_not_stand_side_by_side(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With another load, ended before its first point: all of the first run stands. Ended at the third point: what is
    known of the new run, and nothing of the first but a file that somebody has changed. To its end: what the new run
    has not, a picture say, is gone."""
    (folder / "case.toml").write_text(QUICK)
    monkeypatch.setattr(making, "_assessed", lambda *_: None)
    respond(folder)
    build = folder / "build" / "vane"
    extra = build / "pictures" / "response_of_old.png"
    extra.write_bytes(b"old")
    record = build / "response.record.json"
    note = json.loads(record.read_text())
    note["files"][f"pictures/{extra.name}"] = store.hash_file(extra)
    record.write_text(json.dumps(note))
    first = {p: p.read_bytes() for p in build.rglob("*") if p.is_file()}

    def ended_at(begin: str, *changes: str) -> None:
        def tell(text: str) -> None:
            if text.startswith(begin):
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            running.respond(folder / "case.toml", None, list(changes), report=tell)

    ended_at("friction response at", "amplitude=3.0")
    changed = {p for p, data in first.items() if not p.is_file() or p.read_bytes() != data}
    assert changed <= {record, build / "response.points"}
    (build / "response.csv").write_text("mine")
    ended_at("3 of 4", "amplitude=3.0")
    left = {str(p.relative_to(build)) for p in build.rglob("*") if p.is_file()}
    assert left == {"response.points", "response.h5", "response.csv"}
    assert not read_response(build / "response.h5").finished and (build / "response.csv").read_text() == "mine"
    respond(folder)
    respond(folder, "amplitude=3.0")
    assert not extra.exists() and not list(build.glob(".*")) and record.is_file()
    assert computed(respond(folder, "amplitude=3.0")[0]) == []  # up to date


@pytest.mark.slow
def test_killed_at_any_write_by_another_case(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`respond`, `respond --set amplitude=4` killed at its first, second, ... write, `respond`: the first answer."""
    (folder / "case.toml").write_text(QUICK)
    monkeypatch.setattr(making, "_assessed", lambda *_: None)  # which takes a second, and writes more of the same
    monkeypatch.setattr("microslip.pictures.response.response_picture", lambda *_, **__: None)
    respond(folder)
    build, replaced, written = folder / "build" / "vane", os.replace, 0
    whole = {p: p.read_bytes() for p in (build / "response.csv", build / "response.h5", build / "response.json")}

    class Killed(BaseException):
        pass

    def killing(at: int) -> Any:
        def replace(*paths: Any) -> None:
            nonlocal written
            written += 1
            if written == at:
                raise Killed
            replaced(*paths)

        return replace

    for at in range(1, 100):
        written = 0
        monkeypatch.setattr(os, "replace", killing(at))
        try:
            respond(folder, "amplitude=4.0")
        except Killed:
            pass
        ended = written < at
        monkeypatch.setattr(os, "replace", replaced)
        respond(folder)
        assert {p.name for p, data in whole.items() if p.read_bytes() != data} == set(), at
        if ended:
            break
    assert at > 5  # table, picture, HDF5, page, summary, sidecar


@pytest.mark.slow
def test_killed_while_it_writes_from_the_command_line(folder: Path) -> None:
    """SIGKILL at the response file of another case, whose table is written already: `respond` gives its own again."""
    (folder / "case.toml").write_text(QUICK)
    respond(folder)
    build = folder / "build" / "vane"
    table, points = (build / "response.csv").read_bytes(), read_response(build / "response.h5").series[0].arrays
    code = (
        "import os, signal, sys; from microslip.cli import main; own = os.replace\n"
        "def kill(a, b):\n    if str(b).endswith('response.h5'): os.kill(os.getpid(), signal.SIGKILL)\n    own(a, b)\n"
        "os.replace = kill; main(['respond', '.', '--set', 'amplitude=4.0'])"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True)
    assert done.returncode == -9 and (build / "response.csv").read_bytes() != table
    assert main(["respond", "."]) == 0 and (build / "response.csv").read_bytes() == table
    found = read_response(build / "response.h5").series[0].arrays
    assert found.keys() == points.keys() and all(np.array_equal(found[n], points[n]) for n in points)


def test_what_was_run_before_changes_nothing(folder: Path) -> None:
    """A sweep, another one, and the first again: the same table and points, to the last bit."""
    build, found = folder / "build" / "vane", []
    (folder / "case.toml").write_text(QUICK.replace("[1e4]", "[50.0]"))  # it slides
    for points in (3, 4, 3):
        respond(folder, f"sweep.points={points}")
        arrays = read_response(build / "response.h5").series[0].arrays
        found.append(((build / "response.csv").read_text(), arrays))
    assert found[0][0] == found[2][0] and found[0][1].keys() == found[2][1].keys()
    assert all(np.array_equal(a, found[2][1][n]) for n, a in found[0][1].items())


@pytest.mark.slow
def test_killed_and_resumed_from_the_command_line(folder: Path) -> None:
    """SIGKILL after a few points, twice; the command then ends with the response of one go, 1e-6."""
    command = [sys.executable, "-m", "microslip", "respond", str(folder), "--set", "sweep.points=33"]
    points = folder / "build" / "vane" / "response.points"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    for more in (3, 14):
        process = subprocess.Popen(command, cwd=folder, env=environment, stderr=subprocess.DEVNULL)
        while process.poll() is None and count(points) < more:
            time.sleep(0.02)
        process.kill()
        process.wait()
        assert more <= count(points) < 34
    assert main(command[3:]) == 0
    resumed = read_response(points.with_name("response.h5")).series[0]
    respond(folder, "sweep.points=33", force=True)
    whole = read_response(points.with_name("response.h5")).series[0]
    grid = whole.arrays["peak"] == 0
    assert grid.sum() >= 33
    np.testing.assert_array_equal(resumed.key[resumed.arrays["peak"] == 0], whole.key[grid])
    a, b = (s.monitor("probe")[s.arrays["peak"] == 0] for s in (resumed, whole))
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-6 * np.abs(b).max())


def count(points: Path) -> int:
    """Points that a journal holds, whatever becomes of it."""
    try:
        return sum(len(s.key) for s in read_response(points).series)
    except UserError:
        return 0


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_another_normal_force_adds_and_another_friction_begins_anew(folder: Path) -> None:
    few = CASE.replace("points = 9", "points = 3")
    (folder / "case.toml").write_text(few)
    respond(folder)
    told, _ = respond(folder, "sweep.normal_forces=[50.0, 100.0]", "material_limits.fatigue_strength=2e8")
    assert len(computed(told)) == 5  # a mode between them, and the peak
    found = read_response(folder / "build/vane/response.h5")
    assert [s.parameters for s in found.series] == [{"normal_force": 50.0}, {"normal_force": 100.0}]
    (folder / "case.toml").write_text(few.replace("friction = 0.2", "friction = 0.21"))
    assert len(computed(respond(folder)[0])) == 5


@pytest.mark.drawn
def test_what_stands_in_the_folder(folder: Path) -> None:
    """Table, HDF5, summary, pictures, VTU, log; the coordinates in the file give what the table says."""
    respond(folder, log=True)
    build = folder / "build" / "vane"
    summary = json.loads((build / "response.json").read_text())
    (row,) = summary["resonances"]
    assert row["reserve_factor"] == pytest.approx(250e6 / row["stress_amplitude_Pa"], rel=1e-3)
    assert set(summary["pictures"]) == {
        "friction response", "stress over frequency", "Haigh diagram", "contacts at resonance",
    }  # fmt: skip
    assert all((build / "pictures" / p).stat().st_size > 5000 for p in summary["pictures"].values())
    made = {"response.h5", "response.csv", "response.html", "operating_shape.vtu", "contact_right.vtu"}
    assert made == set(summary["files"])
    page = (build / "response.html").read_text()
    assert page.count("<img") == 4 and "reserve factor" in page and "stress amplitude in MPa" in page
    log = (build / "convergence.csv").read_text().splitlines()
    assert len(log) == 12 and log[0].startswith("sweep,frequency_Hz") and ",converged," in log[5]
    found, basis = read_response(build / "response.h5"), read_basis(folder / "basis.h5")
    motion = found.motion(found.series[0], basis)
    from microslip.operating.motion import read_out

    probe = read_out(motion, "probe")[:, 1, 0]
    top = int(np.argmax(found.series[0].arrays["peak"]))
    assert abs(probe[top]) == pytest.approx(row["amplitude_m"], rel=1e-3)  # but for the bulk beside the modes
    assert found.series[0].frequency[top] == row["frequency_Hz"]


SLIDES = ("amplitude=20.0", "sweep.points=5", "sweep.normal_forces=[500.0]")


@pytest.mark.parametrize(
    "more",
    [*(pytest.param(m, marks=pytest.mark.slow) for m in (('mode="book"',), ("harmonics=3",))), ()],
)
@pytest.mark.usefixtures("unestimated")
def test_the_energy_on_a_contact_map_is_that_of_the_response(folder: Path, more: tuple[str, ...]) -> None:
    """What the mode found, whatever it leaves out: the VTU's J/m2 times areas against the file's J per cycle, single
    precision. The full law marched along the book's motion, or with other samples, takes more or less."""
    import meshio

    respond(folder, *SLIDES, *more)
    build = folder / "build" / "vane"
    data = {k: v[0] for k, v in meshio.read(build / "contact_right.vtu").cell_data.items()}
    series = read_response(build / "response.h5").series[0]
    top = int(np.flatnonzero(series.arrays["peak"])[0])
    energy = series.arrays["contacts/right/lost"][top]
    assert energy > 1e-5 and data["dissipated"] @ data["area"] == pytest.approx(energy, rel=1e-6)
    pressed = data["pressure_mean"] @ data["area"]
    assert pressed == pytest.approx(series.arrays["contacts/right/force"][top, 0, 0], rel=1e-6)


def test_no_map_is_drawn_whose_energy_is_another(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Off by a hundred thousandth: neither picture nor VTU, a message, and the response stays."""
    from microslip.case import checkpoint

    seen = checkpoint.traced

    def other(problem: Any, found: Any) -> Any:
        return {
            name: one._replace(cycle=one.cycle._replace(dissipated=1.00001 * one.cycle.dissipated))
            for name, one in seen(problem, found).items()
        }

    monkeypatch.setattr(checkpoint, "traced", other)
    told, converged = respond(folder, *SLIDES)
    summary = json.loads((folder / "build/vane/response.json").read_text())
    assert converged and "contacts at resonance" not in summary["pictures"]
    assert "contact_right.vtu" not in summary["files"] and "response.h5" in summary["files"]
    assert any("right" in message and "map" in message for message in summary["messages"])
    assert any(t.startswith("warning") and "map" in t for t in told)


def test_a_point_that_fails_is_kept_with_its_status(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sweep goes on, the table and the summary tell, and the case counts as not converged."""
    from microslip.harmonic_balance import solver

    newton = solver.newton

    def stubborn(at: Any, x: np.ndarray, *given: Any, **more: Any) -> Any:
        found = newton(at, x, *given, **more)
        return replace(found, status="no convergence") if abs(at.Omega - 2 * np.pi * 360.0) < 1e-6 else found

    monkeypatch.setattr(solver, "newton", stubborn)
    (folder / "case.toml").write_text(CASE.split("[material_limits]")[0])
    told, converged = respond(folder, "sweep.points=5")
    assert not converged and any("1 point did not converge" in t and "360 Hz" in t for t in told)
    series = read_response(folder / "build/vane/response.h5").series[0]
    (failed,) = [s for s in series.status if s != "converged"]
    assert failed.startswith("iteration limit: no convergence, ") and solver.FROM_ABOVE in failed
    summary = json.loads((folder / "build/vane/response.json").read_text())
    where = "at 360 Hz under F_N = 50 N; response.csv marks them by 0 in converged_FN_50_N"
    assert summary["failed_points"] == 1 and summary["unsolved"] == running.unsolved(folder / "build/vane")
    assert summary["unsolved"] == f"1 of {len(series)} points did not converge, {where}"
    table = np.genfromtxt(folder / "build/vane/response.csv", delimiter=",", names=True)
    assert table["frequency_Hz"][table["converged_FN_50_N"] == 0] == [360.0]
    amplitude, rows = table["amplitude_m_FN_50_N"], summary["resonances"]
    assert np.isnan(amplitude[table["frequency_Hz"] == 360.0]).all()
    assert max(r["amplitude_m"] for r in rows) == pytest.approx(np.nanmax(amplitude), rel=1e-8)
    assert (folder / "build/vane/response.html").read_text().count("did not converge, at 360 Hz under F") == 1
    monkeypatch.setattr(solver, "newton", newton)
    told, converged = respond(folder, "sweep.points=5", force=True)
    assert converged


RING = """
name = "ring"
body = "sector"
excitation = "gas"
amplitude = 200.0
monitor = "tip"
direction = "y"
harmonics = 3
samples = 48

[ring]
blades = 6
engine_order = 5

[[contacts]]
interface = "rim"
law = "smooth"
points = [3, 2]
normal_stiffness = 2e8
tangential_stiffness = 2e8
friction = 0.3

[sweep]
start = 4000.0
stop = 6000.0
points = 3
normal_forces = [60.0]
"""


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_coordinates_of_a_cyclic_sector_read_in_their_own_waves(folder: Path) -> None:
    """Engine order 5 on six sectors is nodal diameter 1 the other way round, its third harmonic 3: 1e-9 of the monitor.

    The mean and the harmonics move in groups of their own, those above N/2 with conjugate rows.
    """
    from sector import basis

    from microslip.basis import write_basis
    from microslip.operating.motion import read_out
    from microslip.operating.shape import on_sector

    write_basis(folder / "basis.h5", basis())
    (folder / "case.toml").write_text(RING)
    respond(folder)
    found = read_response(folder / "build/ring/response.h5")
    assert found.bodies["sector"].harmonics == ((0, False), (1, True), (2, True), (3, False))
    series, held = found.series[0], read_basis(folder / "basis.h5")
    motion = found.motion(series, held)
    told, read = series.monitor("tip")[:, 0], read_out(motion, "tip")[:, :, 1]
    np.testing.assert_allclose(read, told, rtol=0, atol=1e-9 * np.abs(told).max())
    assert np.abs(told[:, 3]).max() > 1e-4 * np.abs(told[:, 1]).max()  # it slides: there are higher harmonics
    here, there = (on_sector(motion, held, j) for j in (0, 2))
    np.testing.assert_allclose(np.linalg.norm(there, axis=-1), np.linalg.norm(here, axis=-1), rtol=1e-9)
    summary = json.loads((folder / "build/ring/response.json").read_text())
    assert summary["pictures"].keys() == {"friction response"}  # the file has no stress modes


def test_a_resonance_beyond_the_band_is_told_with_the_range_to_add(folder: Path) -> None:
    """Cut off below it there is no row; terminal, summary, page and a warning name a range that shows it."""
    build = folder / "build" / "vane"
    respond(folder)
    (whole,) = json.loads((build / "response.json").read_text())["resonances"]
    stop = round(whole["frequency_Hz"] - 6.0, 3)
    told, _ = respond(folder, f"sweep.stop={stop}")
    summary = json.loads((build / "response.json").read_text())
    (end,) = summary["rising_at_the_edge"]
    assert summary["resonances"] == [] and end["normal_force_N"] == 50.0 and end["frequency_Hz"] == stop
    low, high = (float(x) for x in end["add"].removesuffix(" Hz").split(" to "))
    assert low == stop and whole["frequency_Hz"] < high
    assert any(end["add"] in t and not t.startswith("warning") for t in told)
    assert any(end["add"] in t and t.startswith("warning") for t in told)
    assert (build / "response.html").read_text().count(end["add"]) == 2
    assert any(end["add"] in message for message in read_response(build / "response.h5").messages)
    respond(folder, f"sweep.stop={high}", "sweep.points=15")
    again = json.loads((build / "response.json").read_text())
    assert again["rising_at_the_edge"] == [] and len(again["resonances"]) == 1


SLED = (
    CASE.replace('name = "vane"', 'name = "sled"').replace('"vane-eigenmodes"', '"sled"').replace("magnet", "push")
    .replace('"probe"', '"middle"').replace('"right"', '"sole"').replace("[2, 2]", "[1, 1]").replace("2e5", "3e6")
    .replace("4e5", "1e6").replace("friction = 0.2", "friction = 0.3").replace("start = 300.0", "start = 80.0")
    .replace("stop = 380.0", "stop = 140.0").replace("points = 9", "points = 7").replace("[50.0]", "[20.0]")
    .replace("harmonics = 1", 'harmonics = "auto"\nharmonics_error = 4e-3').replace("samples = 24", "samples = 48")
)  # fmt: skip


@pytest.mark.slow
def test_as_many_harmonics_as_the_error_asks_for(folder: Path) -> None:
    """The sweep begins with three harmonics, and once more with those that the resonance needs. Summary, table and
    response file say how many; interrupted, the next run begins with them. What is followed takes as many."""
    write_basis(folder / "basis.h5", sled())
    (folder / "case.toml").write_text(SLED)
    begun: list[str] = []

    def impatient(text: str) -> None:
        begun.append(text)
        if any("once more with" in t for t in begun) and text.startswith("4 of"):
            raise KeyboardInterrupt

    with pytest.raises(UserError, match=r'"auto" is found by microslip respond .*; run it first, or give a number'):
        survey_stage(case_job(folder / "case.toml", make=False), "load")
    with pytest.raises(KeyboardInterrupt):
        respond(folder, report=impatient)
    (said,) = [t for t in begun if "an error of about" in t]
    told, _ = respond(folder)
    assert computed(told)[0].startswith("4 of")
    build = folder / "build" / "sled"
    summary, found = json.loads((build / "response.json").read_text()), read_response(build / "response.h5").series[0]
    H = summary["harmonics"]
    assert H > 3 and any(t.endswith(f"all once more with {H}") for t in [said, *told])
    assert summary["estimated_error_of_harmonics"] <= 4e-3
    assert (found.arrays["harmonics"] == H).all() and found.monitor("middle").shape[2] == H + 1
    assert f",{H}," in (build / "response.csv").read_text().splitlines()[1]
    assert f"<td>{H}</td>" in (build / "response.html").read_text()
    opened = CaseJob(folder / "case.toml", {"sled": folder / "basis.h5"}, build, swept=True)
    assert opened.settings.harmonics == H and opened.settings.sampled >= 8 * H


def turning_sample(folder: Path) -> None:
    """The sample body with a monitor of an angle: about y, from its probe's u_x over 50 mm."""
    basis = read_basis(folder / "basis.h5")
    group = basis.groups[0, 0]
    angle = Rows(group.monitors["probe"].rows[:1] / 0.05, ("phi",), "rad", np.zeros(3), 0.0, np.zeros(1))
    with_angle = replace(group, monitors={**group.monitors, "twist": angle})
    write_basis(folder / "basis.h5", replace(basis, groups={(0, 0): with_angle}))


@pytest.mark.usefixtures("unestimated")
@pytest.mark.parametrize(("name", "kind", "of"), [
    ("root", "gauges", Quantity("1")), pytest.param("twist", "angles", Quantity("rad"), marks=pytest.mark.slow),
])  # fmt: skip
def test_a_strain_gauge_is_strain_everywhere_and_an_angle_is_rad(
    folder: Path, name: str, kind: str, of: Quantity
) -> None:
    """What its row reads from the coordinates in the response file (2e-3: the bulk beside them); one name and one unit
    in table, CSV, terminal, page, HDF5 and xarray, and metres nowhere."""
    turning_sample(folder)
    (folder / "case.toml").write_text(CASE.replace('monitor = "probe"', f'monitor = "{name}"'))
    told, converged = respond(folder)
    build, column = folder / "build" / "vane", of.column("amplitude")
    group = read_basis(folder / "basis.h5").groups[0, 0]
    row = {**group.monitors, **group.gauges}[name].rows[0]
    with (build / "response.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    read = {float(r["frequency_Hz"]): float(r[f"{column}_FN_50_N"]) for r in table}
    assert converged and not any("_m_FN" in name for name in table[0])
    series = read_response(build / "response.h5").series[0]
    pairs = zip(series.frequency, np.abs(series.arrays["bodies/vane-eigenmodes/q"][:, 1] @ row), strict=True)
    found = [(read[float(f"{f:.9g}")], own) for f, own in pairs]
    assert len(found) == len(table) > 9 == sum(r["asked"] == "1" for r in table) and min(found)[0] > 0
    np.testing.assert_allclose(*zip(*found, strict=True), rtol=2e-3)
    (resonance,) = json.loads((build / "response.json").read_text())["resonances"]
    assert "amplitude_m" not in resonance and resonance[column] == pytest.approx(max(read.values()))
    assert any(t.endswith(of.sized(resonance[column])) for t in told)
    _, unit = of.shared([resonance[column]])
    assert f"amplitude in {unit}" in (build / "response.html").read_text()
    assert series.quantity == of and series.to_xarray()[f"{kind}.{name}"].attrs["units"] == of.unit
    with h5py.File(build / "response.h5") as file:
        assert file[f"series_0000/{kind}/{name}"].attrs["unit"] == of.unit


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_the_axis_of_a_strain_gauge_says_so(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The response's picture and the comparison with the book's mode."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    said: list[str] = []
    saved = FigureCanvasAgg.print_png

    def look(canvas: FigureCanvasAgg, *more: Any, **how: Any) -> None:
        figure = canvas.figure
        said.extend(axes.get_ylabel() for axes in figure.axes)
        said.append(getattr(figure, "_supylabel", None) and figure._supylabel.get_text() or "")
        saved(canvas, *more, **how)

    (folder / "case.toml").write_text(CASE.replace('monitor = "probe"', 'monitor = "root"'))
    monkeypatch.setattr(FigureCanvasAgg, "print_png", look)
    table, pairs, _ = running.compare_book(folder / "case.toml", None, ["sweep.points=5"])
    strains = [text for text in said if "amplitude of root" in text or "read-out" in text]
    assert len(strains) == 3 and all("µm/m" in text for text in strains)
    assert "aft_strain" in table.read_text().splitlines()[0]
    assert all(p.quantity.unit == "1" for p in pairs)


@pytest.mark.parametrize(("keys", "words"), [
    ("harmonics = 3\nharmonics_error = 0.01", 'harmonics_error: belongs to harmonics = "auto"'),
    ('harmonics = "auto"\nharmonics_error = 0.0', "harmonics_error"),
    ('harmonics = "many"', "harmonics: must be a whole number, or 'auto'"),
    ("harmonics = 0", "harmonics: must not be less than 1, or 'auto'"),
    ('harmonics = "auto"\n[ring]\nblades = 4\nmodel = "full"', 'harmonics: "auto" needs ring.model = "sector"'),
    ("speed = 3", "has one speed, number 0; correct it"),
    ("frction = 0.2", "contacts.right.frction: unknown key; did you mean 'friction'?"),
    ("normal_forces = [inf]", "sweep.normal_forces: entry 1 of the list must be a finite number"),
])  # fmt: skip
def test_mistakes_in_a_case(folder: Path, keys: str, words: str) -> None:
    key = keys.split(" =")[0]
    old = {"frction": "friction = 0.2", "normal_forces": "normal_forces = [50.0]"}
    (folder / "case.toml").write_text(CASE.replace(old.get(key, "harmonics = 1\nsamples = 24"), keys))
    refused(words, respond, folder)


@pytest.mark.parametrize("verb", [running.respond, running.run_case_file])
def test_a_modal_file_that_is_not_there(folder: Path, monkeypatch: pytest.MonkeyPatch, verb: Any) -> None:
    """What to type follows from what is there: another folder, another name, another path, or nothing at all."""
    (folder / "build/vane-eigenmodes").mkdir(parents=True)
    (folder / "basis.h5").rename(folder / "build/vane-eigenmodes/basis.h5")
    (folder / "mine").mkdir()
    (folder / "case.toml").rename(folder / "mine/vane.toml")
    several = 'bodies = [{name = "vane", file = "gone.h5"}]'

    def said(path: str, *changes: tuple[str, str]) -> str:
        text = CASE
        for old, new in changes:
            text = text.replace(old, new)
        (folder / "mine/vane.toml").write_text(text)
        return refused((), verb, Path(path), *([None] if verb is running.respond else []))

    assert "is 'vane-eigenmodes' meant?" in said("mine/vane.toml", ("vane-eigenmodes", "vane-eigenmode"))
    assert "the bodies here are vane-eigenmodes" in said("mine/vane.toml", ("vane-eigenmodes", "fan"))
    nowhere = said("mine/vane.toml", ('body = "vane-eigenmodes"', several), ('= "magnet"', '= "vane:magnet"'))
    assert "no file mine/gone.h5" in nowhere
    monkeypatch.chdir(folder / "mine")
    moved = said("vane.toml")
    assert f"cd {folder}" in moved and "mine/vane.toml" in moved and str(folder / "mine") in moved.split(";")[0]


def test_a_body_that_can_be_made_is(folder: Path) -> None:
    (folder / "basis.h5").unlink()
    (folder / "geometry/vane-eigenmodes").mkdir(parents=True)
    (folder / "geometry/vane-eigenmodes/body.toml").write_text('name = "vane-eigenmodes"\n')
    refused(("basis.h5", "microslip run", "case.toml makes it"), running.respond, folder / "case.toml", None)


def test_what_jenkins_elements_do_not_follow_is_told(folder: Path) -> None:
    """Jenkins elements under 0.05 N, which are too weakly pressed, and under 500 N, which are not."""
    text = QUICK.replace("points = 4", "points = 9").replace("[1e4]", "[0.05, 500.0]")
    (folder / "case.toml").write_text(text.replace("start = 300.0", "start = 250.0"))
    told, _ = respond(folder)
    (said,) = [t for t in told if "does not follow" in t]
    assert said.startswith("warning: At F_N = 0.05 N the contacts would lift off between") and 'law = "smooth"' in said
    (said,) = [t for t in told if "alone" in t]
    assert said.startswith("warning: At F_N = 0.05 N and ") and 'slides_along = "t2"' in said
    summary = json.loads((folder / "build/vane/response.json").read_text())
    assert any("does not follow" in message for message in summary["messages"])


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_a_coarse_sweep_is_told_where_it_matters(folder: Path) -> None:
    """A message beside a resonance in the band, none where the band has none."""
    assert any("is wide against a resonance with sticking" in t for t in respond(folder, "sweep.points=3")[0])
    assert not any("is wide" in t for t in respond(folder, "sweep.points=3", "sweep.start=370.0")[0])

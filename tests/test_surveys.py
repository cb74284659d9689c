"""Surveys from the command line: engine orders, speeds, ranges, identification; each against what it is made of."""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from refusals import refused_command
from test_assembly import blade
from test_speed_range import ranged

from microslip.basis import write_basis
from microslip.case import load_case
from microslip.case.assemble import build
from microslip.case.problem import problem_of
from microslip.cli import main
from microslip.data import ModalBasis, StressSet
from microslip.harmonic_balance import envelope, identification, response
from microslip.harmonic_balance.envelope import Envelope
from microslip.harmonic_balance.problem import Problem
from microslip.stages.answer import case_job
from microslip.stages.surveying import _ranges_sentences, survey_stage

RING = """
name = "ring"
body = "blade"
excitation = "gas"
monitor = "tip"
harmonics = 1
samples = 24
[ring]
blades = 6
[[contacts]]
interface = "right"
against = "left"
against_sector = 1
normal_stiffness = 2e6
tangential_stiffness = 1e6
friction = 0.5
points = [2, 2]
width = 0.02
height = 0.01
[sweep]
start = 150.0
stop = 600.0
points = 31
normal_forces = [10000.0]
"""


@pytest.fixture
def ring(tmp_path, monkeypatch, unjudged) -> Path:
    """A case of six blades that stick."""
    monkeypatch.chdir(tmp_path)
    write_basis(tmp_path / "basis.h5", blade())
    (tmp_path / "case.toml").write_text(RING)
    return tmp_path / "case.toml"


def rows(path: str) -> dict[str, np.ndarray]:
    with Path(path).open() as file:
        table = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in table]) for name in table[0]}


def test_identify_finds_the_stiffness_of_the_truth(ring: Path, capsys) -> None:
    """Frequencies of a ring with c_N = 3e6 N/m, c_T half of it, as if measured: found to 1e-6, the others predicted to
    1e-6; the file says which was fitted."""
    made = build(load_case(ring)[0], {"blade": blade()})
    f = identification.nodal_diagram(made.assembly, 3e6, 0.5).frequency[:, 0]
    others = "".join(
        f"[[identification.measured]]\nnodal_diameter = {k}\nfrequency = {float(f[k])!r}\n" for k in (1, 2)
    )
    fit = f"[identification.fit]\nnodal_diameter = 3\nfrequency = {float(f[3])!r}\n"
    ring.write_text(RING + "[identification]\nratio = 0.5\nstiffnesses = [1e6, 1e7]\n" + fit + others)
    assert main(["identify", "case.toml"]) == 0
    said = capsys.readouterr().out
    assert "c_N = 3e+06 N/m and c_T = 1.5e+06 N/m" in said and "identification.csv" in said
    found = rows("build/ring/identification.csv")
    assert np.abs(found["relative_error"]).max() < 1e-6 and found["fitted"].tolist() == [1, 0, 0]
    np.testing.assert_allclose(rows("build/ring/nodal_diameters.csv")["mode_1_Hz"], f, rtol=1e-6)
    assert Path("build/ring/pictures/nodal_diameters_stuck.png").stat().st_size > 10000
    assert main(["identify", "case.toml"]) == 0  # again: nothing to do, the same words
    again = capsys.readouterr()
    assert "is up to date" in again.out + again.err and "c_N = 3e+06 N/m" in again.out
    table = Path("build/ring/nodal_diameters.csv")
    whole = table.read_text()
    table.write_text(whole[:-9])
    assert main(["identify", "case.toml"]) == 0 and table.read_text() == whole
    assert "is up to date" not in capsys.readouterr().err


@pytest.mark.parametrize("given", ["", 'engine_orders = "all"', "points = 11"])
def test_all_engine_orders_are_asked_for_by_a_table_that_says_no_more(ring: Path, given: str) -> None:
    ring.write_text(f"{RING}[orders]\n{given}\n")
    case, _ = load_case(ring)
    assert case.orders is not None and case.orders.engine_orders == "all"


@pytest.mark.slow
def test_respond_over_orders(ring: Path, capsys) -> None:
    """Each order's largest resonance stands where the linear ring has it (contacts stick)."""
    ring.write_text(RING + "[orders]\nengine_orders = [1, 2]\n")
    assert main(["respond", "case.toml", "--over", "orders", "-q"]) == 0
    found = rows("build/ring/orders.csv")
    np.testing.assert_allclose(found["resonance_Hz_FN_10000_N"], found["stuck_Hz_FN_10000_N"], rtol=2e-3)
    assert found["engine_order"].tolist() == [1, 2]
    assert Path("build/ring/pictures/orders.png").is_file()
    page = Path("build/ring/orders.html").read_text()
    assert "<h1>ring: engine orders</h1>" in page and "data:image/webp" in page and page.count("<tr>") == 5


STRESS = 7e12
"""Pa of uniaxial stress per m of the tip along x."""


def stressed() -> ModalBasis:
    """The blade with one place whose stress follows the tip along x."""
    bare, place = blade(), np.zeros((1, 3))
    group = bare.groups[0, 0]
    along = np.zeros((1, 6, group.n_modes))
    along[0, 0] = STRESS * group.monitors["tip"].rows[0]
    held = StressSet("nodal-averaged", place, 0 * along, along, np.zeros((1, 6)), np.ones(1))
    return replace(bare, groups={(0, 0): replace(group, stresses={"nodes": held})})


def test_the_worst_engine_order_in_stress_and_its_best_normal_force(ring: Path) -> None:
    """Stress follows the read-out, so its largest is that of the amplitude; the worst of the orders is the largest of
    the table, and its lowest that of the forces under which no order is missing."""

    def driven(order: int, push: float) -> Problem:
        settings, _ = load_case(ring, [f"ring.engine_order={order}", f"amplitude={push}"])
        return problem_of(build(settings, {"blade": stressed()}), 1e4)

    found = [
        replace(envelope.over_orders(partial(driven, push=push), [1, 2], (200.0, 420.0), 15), normal_force=push)
        for push in (2.0, 1.0)
    ]
    for r in found:
        np.testing.assert_allclose(r.stress, STRESS * r.amplitude, rtol=1e-9)
        np.testing.assert_allclose(r.stressed_at, r.frequency, rtol=1e-12)
    rows = [row for r in found if (row := envelope.worst(r, "stress")) is not None]
    assert [row.value for row in rows] == [r.stress.max() for r in found]
    assert rows[0].value == pytest.approx(2 * rows[1].value, rel=1e-6)  # sticking: twice the load, twice the stress
    assert rows[0].order == found[0].order[found[0].stress.argmax()]
    assert envelope.lowest(rows).normal_force == 1.0
    lost = replace(found[1], stress=np.array([np.nan, found[1].stress[1]]))
    partly = envelope.worst(lost, "stress")
    assert partly is not None and (partly.known, partly.count) == (1, 2)
    assert envelope.lowest([rows[0], partly]).normal_force == 2.0
    assert envelope.worst(replace(lost, stress=np.full(2, np.nan)), "stress") is None


@pytest.mark.slow
def test_over_orders_the_worst_stress_leads(ring: Path, capsys) -> None:
    """The first sentence and the first table tell the worst stress over the engine orders, as the table of the orders
    has it."""
    write_basis(ring.with_name("basis.h5"), stressed())
    near = RING.replace("start = 150.0\nstop = 600.0", "start = 200.0\nstop = 420.0").replace("31", "45")
    ring.write_text(near.replace("[10000.0]", "[5000.0, 10000.0]") + "[orders]\nengine_orders = [1, 2]\n")
    assert main(["respond", "case.toml", "--over", "orders"]) == 0
    method, first = capsys.readouterr().out.splitlines()[:2]
    assert method.startswith("One harmonic")
    assert first.startswith("Over engine orders 1 and 2 the worst stress amplitude is lowest under F_N = ")
    orders, told = rows("build/ring/orders.csv"), rows("build/ring/orders_worst.csv")
    for force, most in zip(told["normal_force_N"], told["stress_amplitude_Pa"], strict=True):
        assert most == orders[f"stress_amplitude_Pa_FN_{force:g}_N"].max()
    assert f"{1e-6 * told['stress_amplitude_Pa'].min():.4g} MPa" in first
    assert Path("build/ring/pictures/orders_worst.png").stat().st_size > 10000
    assert first.split(":")[0] in Path("build/ring/orders.html").read_text().replace("<sub>N</sub>", "_N")


@pytest.mark.slow
def test_contacts_of_a_whole_ring_are_drawn_under_their_own_names(ring: Path, monkeypatch) -> None:
    """Four of six: the picture says so, and each has a file of its own."""
    from microslip.pictures import operating

    titles, draw = list[str](), operating.contact_map_plot
    monkeypatch.setattr(
        operating, "contact_map_plot", lambda maps, title, figure: titles.append(title) or draw(maps, title, figure)
    )
    write_basis(ring.with_name("basis.h5"), stressed())
    near = RING.replace("start = 150.0\nstop = 600.0", "start = 225.0\nstop = 235.0").replace("31", "5")
    ring.write_text(near.replace("blades = 6", 'blades = 6\nengine_order = 1\nmodel = "full"'))
    assert main(["respond", "case.toml", "-q"]) == 0
    assert titles[0].endswith("4 of 6 contacts are shown")
    files = sorted(f.name for f in Path("build/ring").glob("contact_*.vtu"))
    assert files == [f"contact_right_{j}.vtu" for j in range(4)]


@pytest.mark.slow
def test_surveys_that_are_interrupted_leave_what_was_finished(ring: Path) -> None:
    """Ctrl-C at the second engine order, combination: a table of the first, and nothing that says it is whole."""
    ring.write_text(RING + "[orders]\nengine_orders = [1, 2]\npoints = 11\n[ranges]\nload = [1.0, 2.0]\n")
    for kind, words in (("orders", "engine order 2, F_N = 10000 N, 2 of 2"), ("ranges", "combination 2 of 2")):

        def report(text: str, words: str = words) -> None:
            if text.startswith(words):
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            survey_stage(case_job(ring, None, ["sweep.points=5"], report=report, make=False), kind)
        assert not Path(f"build/ring/{kind}.json").exists()
    assert rows("build/ring/orders.csv")["engine_order"].tolist() == [1]
    assert rows("build/ring/ranges_combinations.csv")["combination"].tolist() == [1]


def test_respond_over_ranges(ring: Path) -> None:
    """Sticking contacts: twice the load, twice the amplitude; the damping of the case decides the resonance."""
    near = RING.replace("start = 150.0\nstop = 600.0", "start = 225.0\nstop = 235.0")  # a resonance that sticks
    ring.write_text(near + "[ranges]\ndamping_ratio = [0.01, 0.02]\nload = [1.0, 2.0]\nfriction = [0.5]\n")
    assert main(["respond", "case.toml", "--over", "ranges", "-q"]) == 0
    all_of = rows("build/ring/ranges_combinations.csv")
    top = {name: column[np.argmax(all_of["peak_m"])] for name, column in all_of.items()}
    said = f"largest with damping ratio {top['damping_ratio']:g}, load {top['load']:g}, friction 0.5."
    assert said in Path("build/ring/ranges.html").read_text()
    peak = {(d, x): p for d, x, p in zip(*(all_of[k] for k in ("damping_ratio", "load", "peak_m")), strict=True)}
    assert peak[0.01, 2.0] == pytest.approx(2 * peak[0.01, 1.0], rel=1e-6)
    assert peak[0.01, 1.0] > 1.5 * peak[0.02, 1.0]
    table = rows("build/ring/ranges.csv")
    settings, _ = load_case(ring)
    alone = response.harmonic_response(
        problem_of(build(settings, {"blade": blade()}), 1e4), table["frequency_Hz"]
    )
    np.testing.assert_allclose(table["combination_1_m"], np.abs(alone.monitor), rtol=1e-6)  # 1 % as in its modal file
    assert (table["high_m"] >= table["combination_3_m"]).all()


def test_a_combination_that_does_not_converge_is_told_and_counted() -> None:
    """One of three without any solution, one with a hole: neither is called the smallest, both are named."""
    a = np.array([[1.0, 3.0], [9.0, 9.0], [2.0, 9.0]], dtype=complex)
    ok = np.array([[True, True], [False, False], [True, False]])
    e = Envelope(np.array([10.0, 20.0]), ("load",), np.array([[1.0], [2.0], [3.0]]), 1e-3 * a, ok, np.ones((3, 2)))
    assert e.peaks[[0, 2]].tolist() == [3e-3, 2e-3] and np.isnan(e.peaks[1])
    first, second, third = _ranges_sentences(e)
    assert "between 2 mm and 3 mm" in first and second.endswith("load 1.") and third.startswith("2 of 3 combinations")
    assert third.endswith("of 2 points did not converge 2 with load 2; 1 with load 3.")
    none = _ranges_sentences(replace(e, converged=np.zeros((3, 2), dtype=bool)))
    assert len(none) == 1 and none[0].startswith("3 of 3 combinations")


SPEEDS = """
name = "line"
body = "{body}"
monitor = "end"
harmonics = 1
samples = 24
[[excitations]]
row = "gas"
amplitude = 1e4
engine_order = 4
[[contacts]]
interface = "tip"
law = "smooth"
normal_stiffness = 1e6
tangential_stiffness = 5e5
friction = 0.3
points = [4, 2]
[sweep]
start = 500.0
stop = 900.0
normal_forces = [20.0]
[speeds]
start_rpm = 9000
stop_rpm = 15000
points = 5
"""


@pytest.mark.slow
def test_respond_over_speeds(tmp_path, monkeypatch, capsys) -> None:
    """Normal forces as told over the square of the speed, frequencies e n / 60; one speed against a case at that
    speed and frequency, 1e-6."""
    monkeypatch.chdir(tmp_path)
    write_basis(tmp_path / "basis.h5", ranged())
    path = tmp_path / "case.toml"
    text = SPEEDS.format(body=ranged().name)
    path.write_text(text + "normal_force = [[0, 0.0], [20000, 80.0]]\n")
    assert main(["respond", "case.toml", "--over", "speeds"]) == 0
    assert "Largest amplitude" in capsys.readouterr().out
    found = rows("build/line/speeds.csv")
    np.testing.assert_allclose(found["frequency_Hz"], found["speed_rpm"] * 4 / 60, rtol=1e-10)
    np.testing.assert_allclose(found["normal_force_1_N"], 80 * (found["speed_rpm"] / 20000) ** 2, rtol=1e-2)
    settings, _ = load_case(path, ["speed_rpm=12000"])
    made = build(settings, {settings.components[0].name: ranged()})
    alone = response.harmonic_response(problem_of(made, 80 * 0.6**2), np.array([800.0]))
    assert found["amplitude_m"][2] == pytest.approx(abs(alone.monitor[0]), rel=1e-6)
    for change, words in (
        ("normal_force = [[10000, 0.0], [20000, 80.0]]", "is known from 10000 to 20000 rpm, not at 9000 rpm"),
        ("normal_force = [[10000, 0.0]]", "two or more pairs"),
        ('normal_force = "static"', "no closure on interface"),
    ):
        path.write_text(text + change)
        refused_command(["respond", "case.toml", "--over", "speeds"], capsys, words)


def test_speeds_of_a_body_without_a_range_in_the_books_mode(tmp_path, monkeypatch, capsys) -> None:
    """The normal force alone follows the speed; one speed against the book's mode at that force and frequency, 1e-6."""
    monkeypatch.chdir(tmp_path)
    write_basis(tmp_path / "basis.h5", blade())
    path = tmp_path / "case.toml"
    text = (
        SPEEDS.format(body=blade().name).replace("harmonics = 1", 'mode = "book"').replace("points = 5", "points = 2")
    )
    text = text.replace('"tip"', '"right"').replace('"end"', '"tip"')
    text = text.replace("rpm = 9000", "rpm = 3000").replace("rpm = 15000", "rpm = 3600")
    text = text.replace("points = [4, 2]", "points = [2, 2]\nwidth = 0.02\nheight = 0.01").replace("1e4", "80.0")
    path.write_text(text + "normal_force = [[0, 0.0], [20000, 800.0]]\n")
    assert main(["respond", "case.toml", "--over", "speeds"]) == 0
    said = capsys.readouterr().out
    assert "Book mode" in said and f"The same at all speeds: {blade().name}" in said
    found, (settings, _) = rows("build/line/speeds.csv"), load_case(path)
    made = build(settings, {settings.components[0].name: blade()})
    alone = response.harmonic_response(problem_of(made, 800 * 0.18**2), np.array([240.0]))
    assert alone.slipping.max() > 0
    assert found["amplitude_m"][1] == pytest.approx(abs(alone.monitor[0]), rel=1e-6)


@pytest.mark.parametrize(("change", "command", "words"), [
    ("", ["respond", "--over", "orders"], "orders: is not asked for in this case; add [orders]"),
    ("[orders]\nengine_orders = [0]", ["respond", "--over", "orders"], "other than 0"),
    ("[ranges]", ["respond", "--over", "ranges"], "give values of damping_ratio, load, friction or normal_force"),
    ("[speeds]\nstart_rpm = 10\nstop_rpm = 10", ["respond", "--over", "speeds"], "give two different speeds"),
    ("[speeds]\nstart_rpm = 10\nstop_rpm = 20", ["respond", "--over", "speeds"], "no engine order is named"),
    ("[identification.fit]\nnodal_diameter = 4\nfrequency = 100.0", ["identify"], "the ring has 0 to 3"),
    ("[identification.fit]\nnodal_diameter = 3\nfrequency = 1.0", ["identify"], "no stiffness gives the measured 1 Hz"),
    ("[identification.fit]\nnodal_diameter = 3", ["identify"], "frequency"),
])  # fmt: skip
def test_mistakes_are_one_sentence(ring: Path, capsys, change: str, command: list[str], words: str) -> None:
    ring.write_text(RING + change)
    refused_command([command[0], "case.toml", *command[1:]], capsys, words)
    assert not Path("build/ring").exists()

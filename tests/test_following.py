"""Backbones, optima and stability of a case from the command line: tables that agree with what is solved directly."""

from __future__ import annotations

import csv
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from refusals import refused, refused_command
from test_harmonic_balance_laws import CASE, sled

from microslip.analysis import Answer
from microslip.basis import write_basis
from microslip.case import load_case, run_case
from microslip.case.loaded import Loaded
from microslip.case.problem import problem_of
from microslip.cli import main
from microslip.errors import UserError
from microslip.harmonic_balance import nonlinear_modes, peak, reduced
from microslip.stages import multipliers
from microslip.stages.analysing import Varied, analysed
from microslip.stages.answer import CaseJob, written
from microslip.stages.multipliers import stability_of_points
from microslip.units import METRES
from microslip.verbs import backbone, optimum

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sled's case and its modal file."""
    folder = tmp_path_factory.mktemp("sled")
    text = CASE.replace("points = 25", "points = 12").replace("start = 35.0", "start = 60.0")
    text = text.replace("stop = 200.0", "stop = 170.0").replace("[5.0, 1e5]", "[8.0, 40.0]")
    (folder / "case.toml").write_text(text)
    write_basis(folder / "basis.h5", sled())
    return folder


@pytest.fixture(autouse=True)
def there(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


@pytest.fixture
def figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What would be drawn in an empty folder."""
    from microslip.pictures import plots as drawing

    made: list[Any] = []
    monkeypatch.setattr(drawing, "save_figure", lambda figure, path: made.append(figure) or path)
    monkeypatch.chdir(tmp_path)
    return made


def of_case(name: str, mode: str = "aft") -> Any:
    """What of a case a table and its picture need."""
    settings = SimpleNamespace(name=name, mode=mode)
    return SimpleNamespace(settings=settings, contacts=(), assembly=SimpleNamespace(outputs=()))


def page_of(answer: Answer, name: str) -> Path:
    """The files of an optimum; its page."""
    return written(answer, "optimum", Path("build") / name, name, True).files[0]


def job(*assignments: str, report: Callable[[str], None] = lambda _: None) -> CaseJob:
    """The sled's case on its way."""
    return CaseJob(Path("case.toml"), {"sled": Path("basis.h5")}, Path("build/sled"), assignments, report=report)


def table(name: str) -> list[dict[str, str]]:
    with (Path("build/sled") / name).open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_backbone(capsys: pytest.CaptureFixture[str]) -> None:
    """At the small end the frequency of the sticking contact, at the large end a lower one, much damped between."""
    assert main(["backbone", "case.toml"]) == 0
    assert "backbone.csv" in capsys.readouterr().out
    assert Path("build/sled/pictures/backbone.png").stat().st_size > 10_000
    for normal in ("8", "40"):
        rows = [r for r in table("backbone.csv") if r["normal_force_N"] == normal]
        f, d = (np.array([float(r[key]) for r in rows]) for key in ("frequency_Hz", "damping_ratio"))
        assert len(rows) > 10 and f[-1] < 0.9 * f[0] and d.max() > 5 * d[0]


def one_point(folder: Path, monkeypatch: pytest.MonkeyPatch, points: int) -> None:
    """The sled on one point, one harmonic; its case in a folder of its own."""
    monkeypatch.chdir(folder)
    write_basis(folder / "basis.h5", sled())
    one = CASE.replace("points = [4, 2]", "points = [1, 1]").replace("harmonics = 2", "harmonics = 1")
    one = one.replace("points = 25", f"points = {points}").replace("[5.0, 1e5]", "[40.0]")
    one = one.replace("samples = 32", "samples = 64")  # as in test_curves: one program
    one = one.replace("start = 35.0\nstop = 200.0", "start = 60.0\nstop = 100.0")
    (folder / "case.toml").write_text(one)


def test_backbone_of_one_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The frequency falls where it slides."""
    one_point(tmp_path, monkeypatch, points=3)
    text = Path("case.toml").read_text().replace("normal_forces = [40.0]\n", "")
    Path("case.toml").write_text(text.replace("[[contacts]]", "[[contacts]]\nnormal_force = 40.0"))
    assert main(["backbone", "case.toml", "-q"]) == 0
    assert {r["normal_force_N"] for r in table("backbone.csv")} == {"40"}  # also where it is the contact's own
    f = [float(r["frequency_Hz"]) for r in table("backbone.csv")]
    assert len(f) > 5 and f[-1] < 0.9 * f[0]


def test_a_backbone_without_normal_force_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing sticks under it: the others are followed, and their page tells lengths in units of people."""
    one_point(tmp_path, monkeypatch, points=3)
    assert main(["backbone", "case.toml", "--set", "sweep.normal_forces=[0.0,40.0]"]) == 0
    assert {r["normal_force_N"] for r in table("backbone.csv")} == {"40"}
    assert "left out" in capsys.readouterr().err
    assert "m and " in Path("build/sled/backbone.html").read_text() and "e-0" not in words_of(
        "build/sled/backbone.html"
    )


def words_of(page: str) -> str:
    """What stands on a page before its first picture."""
    return Path(page).read_text().partition("<body>")[2].partition("<img")[0]


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_stability_of_one_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A response that sticks is stable."""
    one_point(tmp_path, monkeypatch, points=3)
    assert main(["respond", "case.toml", "--stability", "-q"]) == 0
    rows = table("stability.csv")
    assert len(rows) >= 3 and all(r["stable"] == "1" and 0 < float(r["growth"]) <= 1 for r in rows)


@pytest.mark.parametrize(
    ("over", "high", "words"),
    [("contacts.friction", 0.5, "--over friction"), ("contacts.0.fricton", 0.5, "unknown"), ("friction", 9.0, "5")],
)
def test_what_is_wrong_with_an_optimum_is_said_before_a_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, over: str, high: float, words: str
) -> None:
    """A key of no contact, one that is misspelled, and a value that is wrong at the far end alone."""
    one_point(tmp_path, monkeypatch, points=3)
    told, asked = list[str](), (f"optimum.over={over}", "optimum.low=0.1", f"optimum.high={high}")
    with pytest.raises(UserError, match=f"case.toml: .*{words}"):
        analysed("optimum", job(*asked, report=told.append))
    assert not told


@pytest.mark.slow
def test_optimum_over_the_normal_force(capsys: pytest.CaptureFixture[str]) -> None:
    """Lower than at both neighbours, which are solved for themselves by another way: the sweep's refined peaks."""
    assert main(["optimum", "case.toml", "--points", "4"]) == 0
    rows = table("optimum.csv")
    best = rows[-1]
    normal, height = float(best["normal_force_N"]), float(best["amplitude_m"])
    assert 8 < normal < 15 and best["what"] == "optimum: converged"
    assert f"normal force = {normal:.4g}"[:-1] in capsys.readouterr().out
    assert Path("build/sled/pictures/optimum.png").stat().st_size > 10_000
    settings, _ = load_case(Path("case.toml"), [f"sweep.normal_forces=[{0.9 * normal}, {normal}, {1.1 * normal}]"])
    peaks = [max(a for _, a in one) for one in run_case(settings, sled()).resonances.values()]
    assert peaks[1] == pytest.approx(height, rel=1e-3) and min(peaks[0], peaks[2]) > 1.0005 * peaks[1]


@pytest.mark.slow
def test_the_error_of_a_backbone_is_what_more_harmonics_and_samples_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One harmonic and sixteen samples at the most damped point, against nine and 256: on the side that is said, and
    within the bound; what is likely is it but for a third."""
    one_point(tmp_path, monkeypatch, points=3)
    built = job().built()
    coarse, fine = (
        nonlinear_modes.about_rest(problem_of(built, 40.0, form="relative", **more))[0]
        for more in ({}, {"harmonics": 9, "samples": 256})
    )
    mode = nonlinear_modes.strongest(coarse, 2 * np.pi * 60, 2 * np.pi * 100)
    begins = nonlinear_modes.sliding_amplitude(coarse, mode)
    found = nonlinear_modes.backbone(coarse, begins / 30, 30 * begins, mode)
    at = int(found.damping.argmax())
    e = nonlinear_modes.error(coarse, found, at, mode)
    amplitude = float(found.amplitude[at])
    whole = nonlinear_modes.backbone(fine, begins / 30, 1.1 * amplitude, mode, asked=[amplitude])
    exact = float(np.interp(amplitude, whole.amplitude, whole.damping))
    off = found.damping[at] / exact - 1
    assert abs(off) < e.readout and e.likely() == pytest.approx(off, rel=0.34)
    followed = {40.0: backbone.FollowedMode(found, coarse, mode)}
    assert backbone.remarks(followed, built, print)[0].startswith("The damping ratio at ")


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_what_was_found_stays_when_it_is_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C at the second normal force, the third value, the third point: the same command goes on from there."""

    def stopped(work: Callable[[CaseJob], object], words: str, *assignments: str) -> list[str]:
        """What is said when it goes on."""

        def report(text: str) -> None:
            if text.startswith(words):
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            work(job(*assignments, report=report))
        said: list[str] = []
        work(job(*assignments, report=said.append))
        return [text for text in said if "% of the amplitudes" in text or "stability" in text or "resonance" in text]

    again = stopped(partial(analysed, "backbone"), "backbone at F_N = 40 N, 2 of 2")
    assert sum(text.startswith("100 of 100 %") for text in again) == 1
    assert {r["normal_force_N"] for r in table("backbone.csv")} == {"8", "40"}
    assert main(["respond", "case.toml", "-q"]) == 0
    found = []
    with monkeypatch.context() as counting:
        work = multipliers.stability
        counting.setattr(multipliers, "stability", lambda *given: found.append(1) or work(*given))
        stopped(stability_of_points, "3 of ")
    assert len(found) == len(table("stability.csv")) > 2
    with monkeypatch.context() as counting:
        highest, looked = peak.highest, list[object]()
        counting.setattr(peak, "highest", lambda *given: looked.append(1) or highest(*given))
        stopped(partial(analysed, "optimum"), "highest resonance at 23", "optimum.points=4")
    assert len(looked) == sum(r["what"] == "highest resonance" for r in table("optimum.csv"))


def test_optima_of_several_cases_stand_on_one_picture(figures: list[Any]) -> None:
    """Their names, values and lowest resonances; tables over another setting and missing ones are refused."""
    over = "bodies.vane.mass"
    for name, best in (("light", 1.0), ("heavy", 3.0)):
        case = of_case(name)
        heights = {mass: 1e-6 * (mass / best + best / mass) for mass in (1.0, 3.0, 9.0)}
        peaks = {mass: peak.HighestPeak(600.0, a, np.zeros(1), "converged") for mass, a in heights.items()}
        before = optimum.found_before(["light"] * (name == "heavy"), over, METRES)
        found = peak.Optimum(best, peaks[best], "converged", peaks, {})
        page = page_of(optimum.answer(found, over, case, before), name)
    heights = 1e-6 * np.array([2, 10 / 3, 82 / 9])
    np.testing.assert_allclose(before["light"], [[1, 3, 9], [300 / np.pi] * 3, heights, [1] * 3])
    assert "light: lowest at bodies.vane.mass = 1 kg, 2 µm at 95.493 Hz." in page.read_text()
    assert [t.get_text() for t in figures[-1].legends[0].get_texts()] == ["light", "heavy"] and not figures[0].legends
    assert Path("build/light/optimum.csv").read_text().startswith("bodies.vane.mass_kg,frequency_Hz,amplitude_m,what")
    Path("light").mkdir()  # a case of that name beside its products
    assert list(optimum.found_before(["light"], over, METRES)) == ["light"]
    assert list(optimum.found_before(["build/light"], over, METRES)) == ["light"]
    for other, said in (("light", "not friction, "), ("none", "type microslip optimum none")):
        refused(said, optimum.found_before, [other], "friction", METRES)


def test_an_optimum_where_contacts_would_lift_off_is_marked(figures: list[Any]) -> None:
    """In the book's mode, beyond 1 % of points and time: in the table, the sentence, the picture and beside others."""
    case = of_case("pit", "book")
    share = {1.0: 0.005, 2.0: 0.14, 3.0: 0.33}
    peaks = {
        m: peak.HighestPeak(600.0, 1e-6 / m, np.zeros(1), "converged", np.array([0.0, o])) for m, o in share.items()
    }
    found = peak.Optimum(3.0, peaks[3.0], "converged", peaks, {})
    page = page_of(optimum.answer(found, "mass", case, {}), "pit")
    what = [row["what"] for row in csv.DictReader(Path("build/pit/optimum.csv").open())]
    marked = "highest resonance; not valid: contacts would lift off"
    assert what == ["highest resonance", marked, marked, "optimum: converged"]
    assert "is lowest; not valid" in page.read_text()
    np.testing.assert_array_equal(optimum.found_before(["pit"], "mass", METRES)["pit"][3], [1, 0, 0])
    dotted, solid = figures[0].axes[0].get_lines()[:2]
    assert np.isfinite(dotted.get_ydata()).all() and list(np.isfinite(solid.get_ydata())) == [True, False, False]
    assert "doubtful or not valid, see the table" in [t.get_text() for t in figures[0].legends[0].get_texts()]


def test_what_was_not_found_stands_in_the_table_with_its_commas(figures: list[Any]) -> None:
    """And on the page, which could not be made of it; a cross stands for it in the picture."""
    said = "energy: contacts take less than their laws count, by 14 %; raise samples"
    peaks = {m: peak.HighestPeak(600.0, 1e-6 / m, np.zeros(1), s) for m, s in ((1.0, "converged"), (2.0, said))}
    found = peak.Optimum(1.0, peaks[1.0], f"lost between 1 and 2: {said}", peaks, {})
    page = page_of(optimum.answer(found, "mass", of_case("pit"), {}), "pit")
    rows = list(csv.DictReader(Path("build/pit/optimum.csv").open()))
    assert rows[1]["amplitude_m"] == rows[1]["frequency_Hz"] == ""
    crosses = [line for line in figures[0].axes[0].get_lines() if line.get_marker() == "x"]
    assert [list(line.get_xdata()) for line in crosses] == [[2.0]]
    assert "no resonance known, see the table" in [t.get_text() for t in figures[0].legends[0].get_texts()]
    what = [row["what"] for row in rows]
    assert what == ["highest resonance", said, f"lowest: lost between 1 and 2: {said}"]
    assert "raise samples</td>" in page.read_text()


def test_a_search_that_fails_does_not_say_that_there_is_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Energy out of balance at every point: the reason, empty cells and exit code 1; a curve has no frequency."""
    one_point(tmp_path, monkeypatch, points=3)
    work = reduced.work
    monkeypatch.setattr(reduced, "work", lambda *given: tuple(np.array(work(*given)) * [1.1, 1.0, 1.0, 1.0]))
    assert main(["optimum", "case.toml", "--low", "20", "--high", "30", "--points", "2"]) == 1
    why = "not found: 3 of 3 points did not converge, first at 60 Hz: energy"
    shown, error = capsys.readouterr()
    assert f"no resonance is known at any value; at 20, 30 N {why}" in shown and why in error
    rows = table("optimum.csv")
    assert [row["what"].startswith(why) for row in rows] == [True, True]
    assert [(row["frequency_Hz"], row["amplitude_m"]) for row in rows] == [("", "")] * 2
    assert why in Path("build/sled/optimum.html").read_text()
    refused_command(["respond", "case.toml", "--over", "load"], capsys, f"curve.frequency: {why}")


def test_a_lowest_place_at_an_end_is_an_answer_and_says_where_to_look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    one_point(tmp_path, monkeypatch, points=9)
    band = ["--set", "sweep.start=100", "--set", "sweep.stop=140"]
    monkeypatch.setattr(Loaded, "extent", 1e-7)  # a body so small that its motion is doubted
    asked = ["optimum", "case.toml", "--low", "20", "--high", "30", "--points", "2", *band]
    assert main(asked) == 0
    out = capsys.readouterr().out
    assert "normal force = 20 N: the highest resonance" in out
    assert "is lowest of all from 20 to 30 N" in out and "look there with --low below 20" in out
    assert " moves by " in out and " moves by " in Path("build/sled/optimum.html").read_text()
    assert [r["what"] for r in table("optimum.csv")[:2]] == ["highest resonance"] * 2


def test_an_angle_is_followed_through_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Angles in equal steps from below 0 to above it; everything else in equal ratios."""
    asked = []
    monkeypatch.setattr(peak, "optimum", lambda make, values, *_, **__: asked.append(values))
    case = job()
    built, varied = case.built(), Varied(case.path, case.raw, case.bases)

    def question(**keys: Any) -> Any:
        return SimpleNamespace(asked=optimum.Keys(**keys), built=built, varied=varied, kept=None, report=print)

    with monkeypatch.context() as turned:  # a case of one body has no key of the kind
        turned.setattr(optimum, "_with", lambda *_: None)
        optimum.search(question(over="bodies.sled.turn", low=-4.0, high=4.0, points=5))
    friction = question(over="friction", low=0.1, high=0.4, points=3)
    optimum.search(friction)
    np.testing.assert_allclose(asked[0], [-4, -2, 0, 2, 4])
    np.testing.assert_allclose(asked[1], [0.1, 0.2, 0.4])
    changed = [optimum._with(friction, value).settings.contacts for value in asked[1]]
    assert [c.coefficient for contacts in changed for c in contacts] == list(asked[1])


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_respond_with_stability(capsys: pytest.CaptureFixture[str]) -> None:
    """The response of a sliding block is stable; growth factors of every point are in the table: 1 where sliders that
    stick came to touch their limit, which keep what they are given."""
    assert main(["respond", "case.toml", "--stability"]) == 0
    rows = table("stability.csv")
    assert len(rows) >= 24 and all(r["stable"] == "1" and 0 < float(r["growth"]) <= 1 for r in rows)
    assert Path("build/sled/pictures/stability.png").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["backbone", "case.toml", "--mode", "99"], "mode: number 99"),
        (["optimum", "case.toml", "--over", "friction"], "give --low and --high, two positive numbers"),
        (["optimum", "case.toml", "--over", "bodies.sled.turn", "--low", "5", "--high", "-5"], "the first one smaller"),
        (["optimum", "case.toml", "--over", "contacts.sole.mu", "--low", "0.1", "--high", "0.5"], "mu"),
    ],
)
def test_mistakes_are_one_sentence(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    assert said in capsys.readouterr().err

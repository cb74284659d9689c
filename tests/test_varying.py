"""`--vary`: answers under several values of a key, in one table and one picture, each beside the others."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("jax")
pytest.importorskip("matplotlib")

from refusals import refused_command

import microslip as ms
from microslip.cli import main
from microslip.errors import UserError
from microslip.files.png import CURVES, text_in
from microslip.pictures.overlaid import can_overlay
from microslip.pictures.plots import figure_of, panels, save
from microslip.pictures.touch import curves_of
from microslip.results.dataset import read_dataset
from microslip.stages.answer import Written
from microslip.stages.varying import values_of, varied

ROOT = Path(__file__).resolve().parents[1]


def table(file: Path) -> dict[str, list[str]]:
    with file.open(newline="") as lines:
        head, *rows = csv.reader(lines)
    return {name: [row[i] for row in rows] for i, name in enumerate(head)}


def curves(file: Path) -> dict:
    return json.loads(text_in(file.read_bytes(), CURVES))


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("law.damping=0,0.1, 0.2", ["0", "0.1", "0.2"]),
        ("sweep.normal_forces=[1,2],[3]", ["[1,2]", "[3]"]),
        ('law.kind="point,a","b"', ['"point,a"', '"b"']),
        ("k=[[1,2],[3,4]],[[1,2],[3,5]]", ["[[1,2],[3,4]]", "[[1,2],[3,5]]"]),
        ("friction={mu=0.1,kind=1},{mu=0.2}", ["{mu=0.1,kind=1}", "{mu=0.2}"]),
    ],
)
def test_values_are_parted_at_commas_outside_brackets(text: str, values: list[str]) -> None:
    assert values_of(text) == (text.partition("=")[0], values)


@pytest.mark.parametrize("text", ["a.b", "a.b=0.1", "a.b=0.1,0.1", "=1,2", "a.b=", "k=1,,2", "name=a,b"])
def test_less_than_two_values_are_refused(text: str) -> None:
    with pytest.raises(UserError) as told:
        values_of(text)
    assert told.value.key.startswith("--vary")


def answer(assignments: Sequence[str], folder: Path, draws: bool = True) -> Written:
    """A parabola of a stiffness k, in millimetres or metres as its size is."""
    k = float(next(a for a in assignments if a.startswith("k=")).removeprefix("k="))
    force = np.linspace(0.0, 1.0, 5)
    size = (1e3, "mm") if k > 1 else (1.0, "m")

    def draw(figure) -> None:
        (axes,) = panels(figure, (5.0, 3.0))
        axes.plot(force, size[0] * force**2 / k, label="way")
        axes.axvspan(0.2, 0.4, color="#eeeeee", label="stick")
        axes.set(xlabel="force in N", ylabel=f"way in {size[1]}")

    folder.mkdir(parents=True)
    (folder / "way.csv").write_text("force_N,way_m\n" + "".join(f"{f},{f * f / k:.9g}\n" for f in force))
    drawn = [save(draw, folder / "way.png")] if draws else []
    return Written([folder / "way.csv", *drawn], [f"stiffness {k:g}"])


@pytest.fixture
def case(tmp_path: Path) -> Path:
    (tmp_path / "case.toml").write_text('name = "spring"\nk = 1.0\n')
    return tmp_path / "case.toml"


def test_tables_stand_below_each_other_and_curves_in_one_picture(case: Path) -> None:
    root = case.parent / "build"
    made = varied(case, "k=1,4", ["name=other"], answer, root)
    own = root / "other" / "k=1,4"
    assert made.said == ["k = 1: stiffness 1", "k = 4: stiffness 4"] and made.whole
    found = table(own / "contact_way.csv")
    assert found["k"] == ["1"] * 5 + ["4"] * 5
    force = np.linspace(0.0, 1.0, 5)
    np.testing.assert_allclose(np.array(found["way_m"], float), np.concatenate([force**2, force**2 / 4]), rtol=1e-8)
    kept = read_dataset(own / "contact_way.h5")
    assert kept.variables["way"].unit == "m" and kept["k"].tolist() == [1.0] * 5 + [4.0] * 5
    one, two = curves(own / "pictures" / "way.png")["data"]
    np.testing.assert_allclose(two["y"], force**2 / 4, rtol=1e-6)  # drawn in mm by itself, in m beside the other
    np.testing.assert_allclose(one["y"], force**2, rtol=1e-6)
    assert one["line"]["color"] != two["line"]["color"]


def test_a_second_question_leaves_the_first_as_it_was(case: Path) -> None:
    root, answers = case.parent / "build", partial(answer, draws=False)
    varied(case, "k=1,4", [], answers, root)
    before = {f: f.read_bytes() for f in root.rglob("*") if f.is_file()}
    varied(case, "k=2,8", [], answers, root)
    varied(case, "k=1,4", ["other=3"], answers, root)
    assert all(f.read_bytes() == was for f, was in before.items())


def test_pictures_of_other_things_are_not_laid_over_each_other() -> None:
    def of(label: str, scale: str = "linear") -> dict:
        def draw(figure) -> None:
            (axes,) = panels(figure, (4.0, 3.0))
            axes.plot([1.0, 2.0], [1.0, 2.0])
            axes.set(xlabel=label, ylabel="force", yscale=scale)

        return curves_of(figure_of(draw)) or {}

    assert can_overlay([of("way in mm"), of("way in µm")])
    assert not can_overlay([of("way in mm"), of("way in N")])
    assert not can_overlay([of("way in mm"), of("time in mm")])
    assert not can_overlay([of("way in mm"), of("way in mm", "log")])


@pytest.mark.parametrize("of", ["law.nothing=1,2", "law.damping=-1,-2", "nothing.there.at.all=1,2"])
def test_mistakes_name_the_key(
    of: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    refused_command(["contact", "3.7-5", "--vary", of], capsys, of.split(".")[0])


@pytest.mark.slow
def test_fig_3_8_4_by_one_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four roughnesses in one picture, without dimension; the smoother ones fall (R_Z* = 1.5 and 3), others do not."""
    monkeypatch.chdir(tmp_path)
    assert main(["contact", "3.8-4", "--vary", "roughness.R_Z=1.5,3,6,14.65", "--figures", "svg"]) == 0
    own = tmp_path / "build" / "fig-3.8-4" / "roughness.R_Z=1.5,3,6,14.65"
    assert (own / "pictures" / "microslip.svg").is_file()
    found = {name: np.array(values, float) for name, values in table(own / "contact_microslip.csv").items()}
    assert set(found) == {"roughness.R_Z", "approach", "normal_force", "displacement", "F_t", "coefficient",
                          "temperature_rise"}  # fmt: skip
    ends = [found["coefficient"][found["roughness.R_Z"] == r] for r in (1.5, 3.0, 6.0, 14.65)]
    assert [bool(c.max() > 1.001 * c[-1]) for c in ends] == [True, True, False, False]


@pytest.mark.slow
def test_a_wheel_under_several_frictions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    case = str(ROOT / "pipeline" / "cases" / "wheel-rail.toml")
    few = ["--set", "creep.points=11"]
    assert main(["roll", case, "--vary", "friction=0.1,0.3", *few]) == 0
    own = tmp_path / "build" / "wheel-rail"
    found = table(own / "friction=0.1,0.3+creep.points=11" / "rolling_creep.csv")
    one = table(own / "friction=0.3+creep.points=11" / "creep.csv")
    assert found["friction"] == ["0.1"] * 11 + ["0.3"] * 11
    np.testing.assert_allclose(np.array(found["F_x_forward_N"][11:], float), np.array(one["F_x_forward_N"], float))


def test_section_over_a_parameter(tmp_path: Path) -> None:
    """Of a linear oscillator: after every period it is where the phase of its steady motion says."""
    system = ms.structure(1.0, 1.0, 0.2, force={0: 1.0})
    found = ms.integrate(system, 0.5, unit="rad/s", settle=20, keep=3, samples=32)
    y, v = found.section
    expected = 1.0 / (1.0 - 0.25 + 0.1j)
    assert len(y) == 3
    np.testing.assert_allclose(y, np.full(3, expected.real), atol=2e-3)
    np.testing.assert_allclose(v, np.full(3, (0.5j * expected).real), atol=2e-3)


@pytest.mark.slow
def test_orbit_over_a_frequency_and_over_a_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A row a period of each motion; the largest value beside is that of the table of motions."""
    monkeypatch.chdir(tmp_path)
    few = ["--points", "3", "--set", "orbit.settle=2", "--set", "orbit.keep=4", "--set", "orbit.samples=32"]
    pressed = ["--set", "orbit.normal_force=100.0"]
    assert main(["orbit", "sample", "--over", "frequency", "--low", "380", "--high", "400", *few, *pressed]) == 0
    own = tmp_path / "build" / "sample"
    found, motions = table(own / "orbit_section.csv"), table(own / "orbit.csv")
    assert found["frequency_Hz"] == ["380"] * 4 + ["390"] * 4 + ["400"] * 4
    assert motions["frequency_Hz"] == ["380", "390", "400"] and motions["motion"]
    inside = np.abs(np.array(found["displacement_m"], float)).reshape(3, 4).max(axis=1)
    tops = np.abs(np.array([motions["largest_m"], motions["smallest_m"]], float)).max(axis=0)
    assert (inside <= tops).all()
    over = ["--over", "contacts.right.friction", "--low", "0.1", "--high", "0.3", "--set", "orbit.frequency=390.0"]
    assert main(["orbit", "sample", *over, *few, *pressed, "--set", "name=keyed"]) == 0
    found = table(tmp_path / "build" / "keyed" / "orbit_section.csv")
    assert sorted(set(found["contacts.right.friction"])) == ["0.1", "0.2", "0.3"]


def test_a_section_needs_its_range(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    refused_command(["orbit", "sample", "--over", "frequency", "--low", "380"], capsys, "orbit", "low and high")
    both = ["--over", "friction", "--low", "0.1", "--high", "0.2", "--set", "orbit.frequency=[1.0,2.0]"]
    refused_command(["orbit", "sample", *both], capsys, "orbit", "one frequency")

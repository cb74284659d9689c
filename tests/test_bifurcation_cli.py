"""`microslip bifurcate`: files, what is kept, what is refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from microslip.cli import main

CASES = Path(__file__).parents[1] / "pipeline" / "cases"


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None) -> Path:
    """The two masses on a belt over the load, equilibria alone."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(CASES / "masses-on-belt", tmp_path / "masses-on-belt")
    whole = (CASES / "belt.toml").read_text()
    text = whole[: whole.index("[[bifurcation]]             # Fig. 4.4-2")].replace("doublings = 2", "orbits = false")
    (tmp_path / "belt.toml").write_text(text)
    return tmp_path / "belt.toml"


@pytest.mark.slow
def test_hopf_points_in_files_and_words(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bifurcate", str(case)]) == 0
    said, folder = capsys.readouterr().out, case.parent / "build" / "belt"
    assert "7.08647" in said and str(Path("build/belt/bifurcation.html")) in said
    rows = [line.split(",") for line in (folder / "bifurcation_load.csv").read_text().splitlines()]
    hopf = [float(row[2]) for row in rows if row[1] == "Hopf"]
    assert hopf == pytest.approx([1.1834431, 7.0864749], rel=1e-6)
    with h5py.File(folder / "bifurcation.h5") as file:
        kinds = file["load/branch_0/kind"][()].astype(str)
        np.testing.assert_allclose(file["load/branch_0/parameter"][()][kinds == "Hopf"], hopf, rtol=1e-9)
    page = (folder / "bifurcation.html").read_text()
    assert page.index("<img") < page.index("Hopf point at")  # it begins with the diagram
    kept = folder / "branches" / "load_equilibria.h5"
    before = kept.stat().st_mtime_ns
    (folder / "bifurcation.json").unlink()  # as if the run had been interrupted
    assert main(["bifurcate", str(case), "--quiet"]) == 0 and kept.stat().st_mtime_ns == before
    assert main(["bifurcate", str(case), "--quiet", "--set", "bifurcation.load.points=5"]) == 1
    assert kept.stat().st_mtime_ns != before
    assert "points: 5" in "".join(capsys.readouterr()) or "points: 5" in (folder / "bifurcation.html").read_text()


@pytest.mark.parametrize(
    "text, wrong, key",
    [
        ('"contacts.sole-1.normal_force" = 1.0', '"contacts.sole-9.normal_force" = 1.0', "sole-9"),
        ('"contacts.sole-1.normal_force" = 1.0', '"contacts.sole-1.normal_farce" = 1.0', "normal_farce"),
        ('"contacts.sole-1.normal_force" = 1.0', '"system.dumpers.0.damping" = 1.0', "dumpers"),
        ("stop = 9.8", "stop = 0.2", "stop"),
        ('law = { kind = "rate", slope = 100.0 }   # b_2', 'law = "smooth"', "rate"),
        ("ground = { velocity = 1.0 }              # v_0", "ground = { velocity = 1.0, waviness = [{ amplitude = 1e-6, "
         "length = 1.0 }] }", "wavy"),
    ],
)  # fmt: skip
def test_what_cannot_be_followed_is_one_sentence(
    case: Path, capsys: pytest.CaptureFixture[str], text: str, wrong: str, key: str
) -> None:
    whole = case.read_text()
    assert text in whole
    case.write_text(whole.replace(text, wrong))
    assert main(["bifurcate", str(case), "--quiet"]) == 2
    said = capsys.readouterr().err.strip()
    assert key in said and len(said.splitlines()) == 1
    assert not (case.parent / "build" / "belt" / "bifurcation.html").exists()


def test_a_case_that_asks_for_none(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = case.read_text()
    begin = text.index("[[bifurcation]]")
    case.write_text(text[:begin].replace("ground = { velocity = 1.0 }", "") + "[sweep]\nstart = 0.1\nstop = 1.0\n"
                    'normal_forces = [1.0]\n')  # fmt: skip
    case.write_text(case.read_text().replace('body = "masses-on-belt"', 'body = "masses-on-belt"\nexcitation = "none"'))
    assert main(["bifurcate", str(case), "--quiet"]) == 2
    assert "[[bifurcation]]" in capsys.readouterr().err

"""`microslip bifurcate`: files, what is kept, what is refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from refusals import refused, refused_command

import microslip as ms
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
    again = ms.read_bifurcation(folder / "bifurcation.h5")["load"]
    np.testing.assert_allclose(again.at("Hopf")["equilibria"], hopf, rtol=1e-9)
    assert len(again.to_dataframe()) == len(rows) - 1 and "load parameter B" in repr(again)
    page = (folder / "bifurcation.html").read_text()
    assert page.index("Hopf point at") < page.index("<img") < page.index("<td>Hopf")  # the answer first
    kept = folder / "branches" / "load_equilibria.h5"
    before = kept.stat().st_mtime_ns
    (folder / "bifurcation.json").unlink()  # as if the run had been interrupted
    assert main(["bifurcate", str(case), "--quiet"]) == 0 and kept.stat().st_mtime_ns == before
    assert main(["bifurcate", str(case), "--quiet", "--set", "bifurcation.load.points=5"]) == 1
    assert kept.stat().st_mtime_ns != before
    assert "points: 5" in "".join(capsys.readouterr()) or "points: 5" in (folder / "bifurcation.html").read_text()


def test_two_diagrams_of_one_name_are_refused(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Their files would be the same ones."""
    text = case.read_text()
    case.write_text(text + text[text.index("[[bifurcation]]") :])
    refused_command(["bifurcate", str(case)], capsys, "bifurcation", "'load'")
    assert not (case.parent / "build").exists()


@pytest.mark.parametrize(
    "text, wrong, key",
    [
        ('"contacts.sole-1.normal_force" = 1.0', '"contacts.sole-9.normal_force" = 1.0', "sole-9"),
        ('"contacts.sole-1.normal_force" = 1.0', '"contacts.sole-1.normal_farce" = 1.0', "normal_farce"),
        ('"contacts.sole-1.normal_force" = 1.0', '"system.dumpers.0.damping" = 1.0', "dumpers"),
        ('= 1.0, "contacts.sole-2.normal_force" = 1.0 }\nstart = 0.2\nstop = 9.8\nattractors = [1.0, 8.5]',
         '= 0.0, "system.dampers.0.damping" = 1.0 }\nstart = 0.2\nstop = -0.1', "not negative"),
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
    refused_command(["bifurcate", str(case), "--quiet"], capsys, "[[bifurcation]]")


SHAKEN = """
name = "shaken"
[[masses]]
name = "block"
mass = 1.0
free = "x"
[[springs]]
between = ["ground", "block"]
stiffness = 1.0
[[dampers]]
between = ["ground", "block"]
damping = 0.1
[[contacts]]
name = "sole"
on = "block"
normal = [0.0, 0.0, -1.0]
t2 = [0.0, -1.0, 0.0]
[[forces]]
name = "push"
on = "block"
direction = [1.0, 0.0, 0.0]
[[monitors]]
name = "block"
on = "block"
"""

DRIVEN = """
name = "driven"
body = "shaken"
[[monitors]]
monitor = "block"
direction = "x"
[[excitations]]
row = "push"
amplitude = 0.3
[[contacts]]
interface = "sole"
normal_force = 0.5
points = [1, 1]
normal_stiffness = 1e3
tangential_stiffness = 1e3
friction = 0.3
law = { kind = "rate", slope = 3.0 }
[[bifurcation]]
name = "force"
parameter = "normal force"
unit = "N"
keys = { "contacts.sole.normal_force" = 1.0 }
start = 0.1
stop = 0.6
frequency = 0.2
nodes = 8
step = 0.5
doublings = 0
"""


@pytest.mark.slow
def test_a_driven_case_is_followed_at_its_frequency(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mass shaken at 0.2 Hz over the normal force of its friction: the period of the load, the amplitude of a
    motion in time at the end; without the frequency, or with a value outside the diagram, one sentence."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shaken").mkdir()
    (tmp_path / "shaken" / "system.toml").write_text(SHAKEN)
    (tmp_path / "driven.toml").write_text(DRIVEN)
    assert main(["bifurcate", "driven.toml", "--quiet"]) == 0
    (branch,) = ms.read_bifurcation("build/driven/bifurcation.h5")["force"].branches
    np.testing.assert_allclose(branch.period, 5.0, rtol=1e-12)
    assert branch.stable.all() and (branch.parameter.min(), branch.parameter.max()) == (0.1, 0.6)
    one = DRIVEN.replace("normal_force = 0.5", f"normal_force = {float(branch.parameter[-1])!r}")
    (tmp_path / "one.toml").write_text(one)
    orbit = ms.integrate(ms.assemble("one.toml"), 0.2, settle=30, keep=2, steps=512)
    assert branch.swing[-1, 0] == pytest.approx(np.ptp(orbit.y[0]) / 2, rel=1e-3)
    for text, key in (("", "frequency"), ("frequency = 0.2\ndeflate = [7.0]", "deflate")):
        (tmp_path / "driven.toml").write_text(DRIVEN.replace("frequency = 0.2", text))
        assert main(["bifurcate", "driven.toml", "--quiet"]) == 2
        said = capsys.readouterr().err.strip()
        assert key in said and len(said.splitlines()) == 1


@pytest.mark.usefixtures("untried")
def test_a_file_that_holds_no_diagrams_is_refused(tmp_path: Path) -> None:
    """Missing, damaged, or another program's."""
    for name, data in (("none", None), ("bad", b"no HDF5 at all")):
        if data is not None:
            (tmp_path / f"{name}.h5").write_bytes(data)
        refused(f"{name}.h5", ms.read_bifurcation, tmp_path / f"{name}.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["format"] = "another"
    refused("microslip-bifurcation", ms.read_bifurcation, tmp_path / "other.h5")

"""The small meshes of meshes/tiny: written as they stand there, read, with the frequencies that their page states."""

from __future__ import annotations

import re
import shutil
from functools import cache
from pathlib import Path

import kept
import numpy as np
import pytest
from decks import CCX

from microslip.basis import check_basis, read_basis
from microslip.cli import main
from microslip.data import Array
from microslip.mesh import read_mesh
from microslip.stages.job import open_job
from microslip.stages.modal import modes_stage

PAGE = kept.TINY.parent / "README.md"
BODY = """name = "it"
length_unit = "mm"
{more}
[geometry]
mesh = "{file}"
{face}
[material]
density = 7850.0
young = 2.1e11
poisson = 0.3
[modes]
count = 9
"""
BOX = '[[geometry.faces]]\nname = "held"\nbox = [{}]\n[[supports]]\nface = "held"'
HELD = {
    "blade": BOX.format("-1e3, -1e3, 120.0, 1e3, 1e3, 120.0"),
    "lap-a": BOX.format("0.0, 0.0, 0.0, 0.0, 30.0, 4.0"),
    "lap-b": BOX.format("200.0, 0.0, 4.0, 200.0, 30.0, 8.0"),
    "lap": BOX.format("0.0, 0.0, 0.0, 0.0, 30.0, 4.0")
    + "\n"
    + BOX.format("200.0, 0.0, 4.0, 200.0, 30.0, 8.0").replace("held", "far"),
    "sector": '[[supports]]\nface = "bore"\n[cyclic]\nsectors = 12\nnodal_diameters = [2]\n'
    "[rotation]\naxis = [0.0, 1.0, 0.0]",
}


@cache
def stated() -> dict[str, list[float]]:
    """File -> frequencies in Hz, of the page's table."""
    rows = re.findall(r"^\| `(\S+)` \|.*\| ([\d., ]+) \|$", PAGE.read_text(encoding="utf-8"), re.M)
    return {name: [float(f) for f in words.split(", ")] for name, words in rows}


def solved(name: str, folder: Path) -> Array:
    stem = Path(name).stem
    more = "" if stem in HELD else "free = true"
    shutil.copy(kept.TINY / name, folder / name)
    (folder / "body.toml").write_text(BODY.format(file=name, more=more, face=HELD.get(stem, "")))
    job = open_job(folder, root=folder)
    basis = read_basis(modes_stage(job)[0])
    assert all(c.passed for c in check_basis(basis))
    f = basis.groups[min(basis.groups)].frequency
    return f[f > 0][:3] if stem in HELD else f[6:9]


def test_the_page_names_all_and_they_stay_small() -> None:
    files = [*kept.TINY.iterdir(), PAGE]
    assert {p.name for p in kept.TINY.iterdir()} == set(stated()) == {name for name, _ in kept.files()}
    assert sum(p.stat().st_size for p in files) < 300_000


@pytest.mark.parametrize("name", [name for name, _ in kept.files()])
def test_each_is_what_is_written_and_has_its_frequencies(name: str, tmp_path: Path) -> None:
    assert (kept.TINY / name).read_text() == dict(kept.files())[name]
    np.testing.assert_allclose(solved(name, tmp_path), stated()[name], rtol=2e-6)


def test_four_formats_are_one_blade(tmp_path: Path) -> None:
    """To the digits they print: ten in a deck of Nastran."""
    found = []
    for end in ("msh", "inp", "bdf", "cdb"):
        (tmp_path / end).mkdir()
        found.append(solved(f"blade.{end}", tmp_path / end))
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=1e-9)


def test_the_plates_of_the_joint_touch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As the page shows: an overlap of 40 x 30 mm becomes a contact of a case."""
    monkeypatch.chdir(tmp_path)
    assert main(["import", str(kept.TINY / "lap-a.inp"), str(kept.TINY / "lap-b.cdb"), "lap"]) == 0
    assert "1200 mm2" in capsys.readouterr().out and (tmp_path / "lap" / "case.toml").is_file()


@pytest.mark.slow
@pytest.mark.skipif(CCX is None, reason="CalculiX is not installed")
def test_calculix_finds_the_same_blade(tmp_path: Path) -> None:
    import decks

    mesh = read_mesh(kept.TINY / "blade.inp", "mm")
    lines = (kept.TINY / "blade.inp").read_text().splitlines()
    lines += ["*BOUNDARY", "root, 1, 3", *decks.frequency_step(3)]
    assert mesh.n_points == kept.blade().n_points
    np.testing.assert_allclose(decks.run(tmp_path, "blade", lines)[:3], stated()["blade.inp"], rtol=2e-6)

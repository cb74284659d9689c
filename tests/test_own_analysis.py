"""An analysis of another package, the page's: in the help, run by its verb, with page, table and file."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import microslip as ms

PAGE = Path(__file__).parents[1] / "docs" / "own_analysis.md"
SAMPLE = Path(ms.__file__).parent / "samples"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with the page's module, installed as far as entry points are looked for."""
    code, toml = (re.findall(rf"```{of}\n(.*?)```", PAGE.read_text(), flags=re.S)[0] for of in ("python", "toml"))
    folder = tmp_path / "site"
    (folder / "my_package").mkdir(parents=True)
    (folder / "my_package" / "__init__.py").touch()
    (folder / "my_package" / "by_harmonics.py").write_text(code)
    (folder / "my_package-1.0.dist-info").mkdir()
    points = toml.replace('project.entry-points."microslip.analysis"', "microslip.analysis").replace('"', "")
    (folder / "my_package-1.0.dist-info" / "entry_points.txt").write_text(points)
    (folder / "my_package-1.0.dist-info" / "METADATA").write_text("Name: my_package\nVersion: 1.0\n")
    return folder


def typed(package: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "microslip", *words], cwd=package.parent, env=os.environ | {"PYTHONPATH": str(package)},
        capture_output=True, text=True,
    )  # fmt: skip


@pytest.mark.slow
def test_a_verb_of_another_package(package: Path) -> None:
    for file in SAMPLE.iterdir():
        shutil.copy(file, package.parent)
    assert "by-harmonics" in typed(package, "--help").stdout
    missing = typed(package, "by-harmonics", "case.toml")
    assert missing.returncode == 2 and "add [by_harmonics] with frequency (Hz)" in missing.stderr
    asked = [f"--set=by_harmonics.{key}={value}" for key, value in (("frequency", 380.0), ("most", 5))]
    asked += [f"--set=contacts.{name}.normal_force=20.0" for name in ("right", "left")]
    wrong = typed(package, "by-harmonics", "case.toml", *asked, "--set=by_harmonics.most=2")
    assert wrong.returncode == 2 and "by_harmonics.most" in wrong.stderr
    found = typed(package, "by-harmonics", "case.toml", *asked)
    assert found.returncode == 0, found.stderr
    folder = package.parent / "build" / "sample"
    data = ms.load(folder / "by_harmonics.h5")
    table = np.genfromtxt(folder / "by_harmonics.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["amplitude_m"], data["amplitude"], rtol=1e-9)
    assert f"{data['amplitude'][-1]:.6g} m with 5 harmonics" in found.stdout
    assert (folder / "by_harmonics.html").is_file() and (folder / "pictures" / "by_harmonics.png").is_file()
    module = package / "my_package" / "by_harmonics.py"
    module.write_text(module.read_text().replace("m with", "metres with"))
    assert "metres with 5" in typed(package, "by-harmonics", "case.toml", *asked).stdout


@pytest.mark.slow
def test_a_package_that_is_broken_is_left_out(package: Path) -> None:
    (package / "my_package" / "by_harmonics.py").write_text('"""Broken."""\nimport there_is_no_such_module\n')
    shutil.copy(SAMPLE / "case.toml", package.parent)
    shutil.copy(SAMPLE / "basis.h5", package.parent)
    done = typed(package, "two-tones", "case.toml")
    assert done.returncode == 2 and "by_harmonics" in done.stderr and "two_tones: is missing" in done.stderr

"""The benchmark runs from end to end on a coarse blade (its timings are not judged here)."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

pytest.importorskip("gmsh", exc_type=ImportError)


def printed(name, *more):
    command = [sys.executable, str(ROOT / "benchmarks" / name), "--quick", *map(str, more)]
    path = os.pathsep.join([str(ROOT / "pipeline"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_modal_benchmark_times_every_stage(tmp_path):
    said = printed("modal.py", "--peers", "--work", tmp_path)
    ratios = ("| certificate on top |", "| eigensolve / (factor + solves) |")
    for text in ("| microslip |", "pattern and gradients", *ratios):
        assert text in said


@pytest.mark.slow
def test_the_cyclic_benchmark_compares_the_two_ways(tmp_path):
    said = printed("cyclic.py", "--work", tmp_path)
    for text in ("| cyclic / real, CPU |", "| cyclic |", "| real |", "condensation"):
        assert text in said


@pytest.mark.slow
def test_the_ring_benchmark_certifies_its_made_up_ring(tmp_path):
    said = printed("ring.py", "--work", tmp_path)
    dof, ring_dof, modes = (int(v) for v in said.splitlines()[-1].split("|")[1:4])
    assert ring_dof == 24 * dof and modes == 288  # 12 modes at each k, counted twice but for k = 0 and 12: 12 * 24
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="needs CalculiX")
def test_the_deck_benchmark_runs_both_programs():
    assert len(printed("deck.py").splitlines()[-1].split("|")) == 6


@pytest.mark.slow
def test_the_contact_benchmark_compares_laws_that_agree():
    said = printed("contact_points.py")
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in said.splitlines() if "| 64 |" in line]
    assert {r[1] for r in rows} >= {"microslip", "numpy loop"}
    # the same law and step; two cycles are fewer, and pyHarm's step is of first order in the samples
    most = {"microslip": 0.0, "numpy loop": 1e-12, "microslip, two cycles": 0.5, "pyHarm": 0.5}
    assert all(float(r[-1]) <= most[r[1]] for r in rows)


@pytest.mark.slow
def test_the_ring_response_benchmark_sees_the_same_peak_in_all_modes():
    said = printed("ring_response.py")
    lines = [line for line in said.splitlines() if line.startswith("| ")]
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in lines]
    assert [r[0] for r in rows[1:4]] == ["book", "AFT, H = 1", "AFT, H = 3"]
    assert all(r[5] == "0" and 100 < float(r[6]) < 115 for r in rows[1:4])


@pytest.mark.slow
def test_the_benchmark_of_small_systems_follows_the_curves_that_its_peer_follows():
    said = printed("structures.py")
    folds = [float(word.strip(" ,;")) for word in said.split("folds at")[1].split("rad/s")[0].split(",")]
    assert abs(folds[0] - 1.462616482) < 1e-5 and abs(folds[1] - 1.156017684) < 1e-5  # as with 12 harmonics
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in said.splitlines() if "| pyHarm" in line]
    assert all(float(r[-1]) < 1e-7 for r in rows)  # its tolerance
    assert said.count("First curve of a process") == 1


@pytest.mark.slow
def test_the_benchmark_of_motions_in_time_reaches_its_errors_by_all_methods():
    said = printed("time_domain.py")
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in said.splitlines() if line.startswith("| 1e-")]
    assert len(rows) == 16
    assert {r[1] for r in rows} == {"microslip", "LSODA, odeint", "LSODA, solve_ivp", "Radau"}
    assert all(float(r[3]) <= float(r[0]) for r in rows)

"""A Campbell diagram of 50 speeds from one basis of the range, against 50 solves, in one run.

    python benchmarks/speeds.py                 # the shrouded blade at nodal diameter 0, two ranges, some minutes
    python benchmarks/speeds.py --quick         # a coarser blade, 6 speeds: seconds

Both ways run in the same process on one thread and the same mesh, without stress modes: equilibrium by Newton started
from the speed before, search, certificate. CPU seconds (user and system) are compared. The range is built twice, before
and after the solves, so that a machine whose load changes meanwhile tells on both; the mean counts. Its run holds
assembly, the group at rest that every file has, and the evaluations.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from microslip.data import Mesh, ModalBasis, SpeedRange
from microslip.modal.compute import modal_basis
from microslip.modal.speed_range import frequencies_over
from microslip.settings.body import BodySettings
from microslip.stages.job import open_job
from microslip.stages.meshing import load_mesh, mesh_stage

ROOT = Path(__file__).resolve().parents[1]
COARSE = "{pressure_side=7, suction_side=7, contact_left=5, contact_right=5}"
LIGHT = [
    "output.gauss=false", "output.nodal_stress=false", 'reduction="eigenmodes"', "cyclic.nodal_diameters=[0]",
    "closures=[]",
]  # fmt: skip


def timed(mesh: Mesh, settings: BodySettings) -> tuple[ModalBasis, float, float]:
    """A basis and its CPU and wall seconds."""
    cpu, wall = time.process_time(), time.perf_counter()
    basis = modal_basis(mesh, settings)
    return basis, time.process_time() - cpu, time.perf_counter() - wall


def compared(top: float, size: float, local: str, points: int, work: Path) -> str:
    """One row of the table."""

    def job(*changes: str):
        mesh = [f"mesh.size={size}", f"mesh.local={local}"]
        return open_job(ROOT / "geometry" / "shroud", ['name="bench-speeds"', *mesh, *LIGHT, *changes], work)

    span = job("rotation.speeds_rpm=[0.0]", f"rotation.range_rpm=[0.0, {top}]")
    mesh_stage(span)
    mesh = load_mesh(span)[0]
    rpm = np.linspace(0, top, points)
    every = job(f"rotation.speeds_rpm={rpm.tolist()}")
    before = ranged(mesh, span.settings, rpm)
    all_of_them, cpu_all, wall_all = timed(mesh, every.settings)
    r, omega, cpu, wall = ranged(mesh, span.settings, rpm)
    both = (before[2], cpu)
    true = np.array([all_of_them.groups[i, 0].omega[: r.count] for i in range(points)])
    error = np.abs(omega / true - 1).max()
    cells = [
        f"{3 * mesh.n_points}", f"{top:g}", f"{len(r.samples)} ({int(r.solved.sum())})",
        f"{both[0]:.1f}, {both[1]:.1f}", f"{cpu_all:.1f}", f"{2 * cpu_all / sum(both):.1f}", f"{before[3] + wall:.0f}",
        f"{wall_all:.0f}", f"{r.total_error.max():.1e}", f"{error:.1e}",
    ]  # fmt: skip
    return "| " + " | ".join(cells) + " |"


def ranged(mesh: Mesh, settings: BodySettings, rpm: np.ndarray) -> tuple[SpeedRange, np.ndarray, float, float]:
    """A range, its frequencies (rad/s) at the given speeds, and the CPU and wall seconds of both."""
    basis, cpu, wall = timed(mesh, settings)
    cpu -= time.process_time()
    wall -= time.perf_counter()
    r = basis.ranges[0]
    omega, _ = frequencies_over(r, rpm * np.pi / 30)
    return r, omega, cpu + time.process_time(), wall + time.perf_counter()


COLUMNS = (
    "dof", "range to rpm", "samples (with modes)", "range CPU s, before and after", "{n} solves CPU s", "ratio",
    "ranges wall s", "{n} solves wall s", "held-out error", "largest error",
)  # fmt: skip
HEAD = "| " + " | ".join(COLUMNS) + " |\n|" + "--:|" * len(COLUMNS)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--points", type=int, default=50)
    parser.add_argument("--fine", action="store_true", help="the body file's own mesh too")
    words = parser.parse_args()
    if os.environ.get("OMP_NUM_THREADS") != "1":  # read when numpy is loaded, so the process begins anew
        environment = {**os.environ, **{f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS")}}
        os.execve(sys.executable, [sys.executable, *sys.argv], environment)
    points = 6 if words.quick else words.points
    print(f"{platform.machine()}, load {os.getloadavg()[0]:.1f}\n\n{HEAD.format(n=points)}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for top in (4500.0,) if words.quick else (4500.0, 12000.0):
            print(compared(top, 12, COARSE, points, Path(folder)), flush=True)
        if words.fine:
            local = "{pressure_side=4.5, suction_side=4.5, contact_left=3.0, contact_right=3.0}"
            print(compared(4500.0, 10, local, points, Path(folder)), flush=True)


if __name__ == "__main__":
    main()

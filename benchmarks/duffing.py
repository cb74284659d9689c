"""Frequency response of a Duffing oscillator, both folds: microslip's continuation against pyHarm in one run.

    python benchmarks/duffing.py            # 7 harmonics, 128 samples
    python benchmarks/duffing.py --quick    # one round: seconds

q'' + 0.05 q' + q + 0.05 q^3 = 0.4 cos(Omega t), harmonics 0 to 7, force from 128 samples (exact for a cubic: no
aliasing below 29). pyHarm (an environment of its own, `sh tests/peers/setup.sh pyharm`) chooses its steps as it likes
up to the length given; its quicker solver (NewtonRaphson) and its default one (scipyroot) are both run. Every point of
it is corrected by microslip at the same Omega: how far it moves says that both follow the same curve.
Times are the least of some rounds after one that compiles; CPU of the process, one thread.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from microslip.continuation import Branch, Settings, newton, trace

ROOT = Path(__file__).resolve().parents[1]
PYHARM = ROOT / "build" / "peers" / "pyharm" / "bin" / "python"
DAMPING, CUBIC, FORCE, LOW, HIGH = 0.05, 0.05, 0.4, 0.3, 2.5


class Duffing:
    """Unknowns: constant, cosines, sines of the displacement; parameter: Omega."""

    x_scale, lam_scale = 5.0, 1.0

    def __init__(self, harmonics: int, samples: int) -> None:
        t, h = 2 * np.pi * np.arange(samples) / samples, np.arange(1, harmonics + 1)
        self.wave = np.hstack([np.ones((samples, 1)), np.cos(np.outer(t, h)), np.sin(np.outer(t, h))])
        self.back = np.ascontiguousarray(self.wave.T) * (np.r_[1, np.full(2 * harmonics, 2)][:, None] / samples)
        n = 2 * harmonics + 1
        self.mass, self.damping = np.diag(np.r_[0, h, h].astype(float) ** 2), np.zeros((n, n))
        self.damping[h, h + harmonics], self.damping[h + harmonics, h] = DAMPING * h, -DAMPING * h
        self.stiffness, self.load = np.eye(n), np.zeros(n)
        self.load[1] = FORCE

    def evaluate(self, x: np.ndarray, lam: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        q = self.wave @ x
        square = q * q
        linear = self.stiffness - lam * lam * self.mass + lam * self.damping
        R = linear @ x + self.back @ (CUBIC * square * q) - self.load
        J = linear + self.back @ ((3 * CUBIC * square)[:, None] * self.wave)
        return R, J, (self.damping - 2 * lam * self.mass) @ x


def least(run, rounds: int) -> tuple[object, float, float]:
    """Result, least wall and least CPU seconds."""
    times = []
    for _ in range(rounds + 1):
        wall, cpu = time.perf_counter(), time.process_time()
        result = run()
        times.append((time.perf_counter() - wall, time.process_time() - cpu))
    return result, min(t[0] for t in times[1:]), min(t[1] for t in times[1:])


def pyharm(solver: str, harmonics: int, samples: int, rounds: int, work: Path) -> dict:
    job = {
        "damping": DAMPING, "force": FORCE, "cubic": CUBIC, "low": LOW, "high": HIGH, "step": 0.02, "step_max": 0.2,
        "harmonics": harmonics, "samples": samples, "rounds": rounds, "solver": solver,
    }  # fmt: skip
    (work / "job.json").write_text(json.dumps(job), encoding="utf-8")
    worker = ROOT / "benchmarks" / "pyharm_duffing.py"
    alone = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    command = [PYHARM, worker, work / "job.json", work / "out.npz"]
    subprocess.run(command, check=True, env=alone, cwd=work, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return dict(np.load(work / "out.npz"))


def moved(problem: Duffing, curve: Branch, peer: dict) -> tuple[float, float]:
    """Largest correction of the peer's points (scaled), and how far they are from the curve's polygon (scaled)."""
    points = list(zip(peer["x"], peer["omega"], strict=True))
    correction = max(np.abs(newton(problem, x, w).x - x).max() / problem.x_scale for x, w in points)
    y = np.column_stack([curve.x / problem.x_scale, curve.lam / problem.lam_scale])
    legs = np.diff(y, axis=0)
    apart = 0.0
    for x, w in points:
        if w <= HIGH:
            z = np.append(x / problem.x_scale, w / problem.lam_scale)
            share = np.clip(((z - y[:-1]) * legs).sum(1) / (legs**2).sum(1), 0, 1)[:, None]
            apart = max(apart, float(np.linalg.norm(y[:-1] + share * legs - z, axis=1).min()))
    return correction, apart


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--harmonics", type=int, default=7)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--quick", action="store_true", help="one round")
    arguments = parser.parse_args(argv)
    rounds = 1 if arguments.quick else arguments.rounds
    problem = Duffing(arguments.harmonics, arguments.samples)
    settings = Settings(low=LOW, high=HIGH)
    guess = np.zeros(2 * arguments.harmonics + 1)
    curve, wall, cpu = least(lambda: trace(problem, guess, LOW, settings), rounds)
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
          f"numpy {np.__version__}, load {os.getloadavg()[0]:.1f}\n")  # fmt: skip
    folds = " and ".join(f"{p.lam:.9f}" for p in curve.of_kind("fold"))
    print(f"folds at {folds}\n")
    print("| program | points | curve, CPU ms | ms / point | CPU ms / point | CPU / microslip, a point | the curve |"
          " moved | apart |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|")  # fmt: skip
    n = len(curve.points)
    print(row("microslip", n, wall, cpu) + " 1.0 | 1.0 | | |", flush=True)
    if not PYHARM.is_file():
        print("\npyHarm is not installed: sh tests/peers/setup.sh pyharm")
        return
    with tempfile.TemporaryDirectory() as folder:
        for solver in ("NewtonRaphson", "scipyroot"):
            peer = pyharm(solver, arguments.harmonics, arguments.samples, max(1, rounds // 3), Path(folder))
            m, theirs = len(peer["omega"]), peer["cpu"].min()
            correction, apart = moved(problem, curve, peer)
            ratios = f" {theirs / m / (cpu / n):.1f} | {theirs / cpu:.1f} | {correction:.0e} | {apart:.0e} |"
            print(row(f"pyHarm, {solver}", m, peer["wall"].min(), theirs) + ratios, flush=True)


def row(name: str, points: int, wall: float, cpu: float) -> str:
    return f"| {name} | {points} | {1e3 * cpu:.0f} | {1e3 * wall / points:.3f} | {1e3 * cpu / points:.3f} |"


if __name__ == "__main__":
    sys.exit(main())

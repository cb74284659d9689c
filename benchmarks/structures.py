"""Frequency responses of small systems, as a user calls for them, against pyHarm in one run.

    python benchmarks/structures.py            # 7 harmonics, 128 samples; pyHarm takes minutes of the cantilever
    python benchmarks/structures.py --quick    # one round, pyHarm's quicker way, one first call

duffing: q'' + 0.05 q' + q + 0.05 q^3 = 0.4 cos(Omega t) from 0.3 to 2.5, over both folds. cantilever: a clamped beam of
ten elements (20 coordinates; length, bending stiffness and mass per length 1), 0.5 % of damping in every mode, pushed
at its tip, where a spring of 20 in series with a slider holds it: the tip slides at the resonance; from 2 to 12.

microslip: `ms.follow`, `ms.harmonic_response` at 100 frequencies, and for both what reading the amplitudes takes
besides (which checks every point). pyHarm (an environment of its own, `sh tests/peers/setup.sh pyharm`) chooses its
steps as it likes up to the length given; it has all displacements as unknowns, or (NLdofs) those of the element. Every
point of it is corrected by microslip at the same Omega: how far it moves says that both follow the same curve.

Times are the least of some rounds after one that compiles; CPU of the process, one thread. First calls are those of a
new process, `import` included, with the cache of compiled programs filled and without one.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import microslip as ms

ROOT = Path(__file__).resolve().parents[1]
PYHARM = ROOT / "build" / "peers" / "pyharm" / "bin" / "python"
STEPS = {"step": 0.02, "step_max": 0.2}


def beam(elements: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """M and K of a cantilever of Euler-Bernoulli elements: displacement and slope of every node but the clamped one."""
    h, n = 1.0 / elements, 2 * (elements + 1)
    K, M = np.zeros((n, n)), np.zeros((n, n))
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2], [-12, -6 * h, 12, -6 * h],
                  [6 * h, 2 * h**2, -6 * h, 4 * h**2]]) / h**3  # fmt: skip
    m = h / 420 * np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
                            [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]])  # fmt: skip
    for e in range(elements):
        at = slice(2 * e, 2 * e + 4)
        K[at, at] += k
        M[at, at] += m
    return M[2:, 2:], K[2:, 2:]


def duffing() -> tuple[Any, dict[str, Any]]:
    """The assembly, and what pyHarm is told."""
    system = ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[ms.polynomial({3: 0.05})])
    one = np.ones((1, 1))
    job = {
        "M": one,
        "K": one,
        "C": 0.05 * one,
        "at": 0,
        "force": 0.4,
        "element": "cubic",
        "stiffness": 0.05,
        "limit": 0,
    }
    return system, job | {"low": 0.3, "high": 2.5}


def cantilever() -> tuple[Any, dict[str, Any]]:
    """Likewise."""
    (M, K), tip = beam(), 18
    slider = ms.jenkins(stiffness=20.0, limit=0.25, at=tip)
    system = ms.structure(M, K, damping_ratio=0.005, force={tip: 0.1}, elements=[slider])
    C = system.components[0].groups[0].C_r
    job = {"M": M, "K": K, "C": C, "at": tip, "force": 0.1, "element": "jenkins", "stiffness": 20.0, "limit": 0.25}
    return system, job | {"low": 2.0, "high": 12.0}


def least(run: Callable[[], Any], rounds: int) -> tuple[Any, float, float]:
    """Result, least wall and least CPU seconds after a first round that compiles."""
    times = []
    for _ in range(rounds + 1):
        wall, cpu = time.perf_counter(), time.process_time()
        result = run()
        times.append((time.perf_counter() - wall, time.process_time() - cpu))
    return result, min(t[0] for t in times[1:]), min(t[1] for t in times[1:])


def pyharm(job: dict[str, Any], work: Path) -> dict[str, np.ndarray]:
    np.savez(work / "job.npz", **job)
    worker = ROOT / "benchmarks" / "pyharm_structure.py"
    alone = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    command = [PYHARM, worker, work / "job.npz", work / "out.npz"]
    subprocess.run(command, check=True, env=alone, cwd=work, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return dict(np.load(work / "out.npz"))


def moved(curve: Any, peer: dict[str, np.ndarray]) -> float:
    """Largest correction of the peer's points by Newton's method, in parts of the largest amplitude."""
    from microslip.harmonic_balance.solver import newton

    problem = curve.problem(float(curve.parameter[0]))
    x = peer["x"] / problem.scale[0]
    found = [np.abs(newton(problem.at(w), one).x - one).max() for one, w in zip(x, peer["omega"], strict=True)]
    return float(max(found) / np.abs(x).max())


def first_call(name: str) -> list[tuple[float, float]]:
    """Wall and CPU seconds of a first curve and its amplitudes in a new process: without a cache, and with it."""
    code = (
        "import sys, time; sys.path.insert(0, 'benchmarks'); wall = time.perf_counter();"
        f"import structures as s; s.curve(s.{name}()[0], s.{name}()[1], 7, 128).amplitude;"
        "print(time.perf_counter() - wall, time.process_time())"
    )
    found = []
    with tempfile.TemporaryDirectory() as cache:
        for _ in range(2):
            env = {**os.environ, "XDG_CACHE_HOME": cache}
            done = subprocess.run(
                [sys.executable, "-c", code], check=True, capture_output=True, text=True, env=env, cwd=ROOT
            )
            wall, cpu = map(float, done.stdout.split())
            found.append((wall, cpu))
    return found


def curve(system: Any, job: dict[str, Any], harmonics: int, samples: int) -> Any:
    return ms.follow(system, job["low"], job["high"], unit="rad/s", harmonics=harmonics, samples=samples)


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--harmonics", type=int, default=7)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--quick", action="store_true", help="one round, one of pyHarm's ways")
    arguments = parser.parse_args(argv)
    fine, rounds = (arguments.harmonics, arguments.samples), 1 if arguments.quick else arguments.rounds
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
          f"numpy {np.__version__}, load {os.getloadavg()[0]:.1f}")  # fmt: skip
    ways = {
        duffing: [("scipyroot", "noreductor"), ("NewtonRaphson", "noreductor")],
        cantilever: [("scipyroot", "noreductor"), ("scipyroot", "NLdofs")],
    }
    for make, peers in ways.items():
        compared(make, fine, rounds, peers[:1] if arguments.quick else peers)
        if make is duffing or not arguments.quick:
            print_first_call(make.__name__)


def compared(make: Callable[[], Any], fine: tuple[int, int], rounds: int, peers: list[tuple[str, str]]) -> None:
    """The table of one system."""
    (system, job), (harmonics, samples) = make(), fine
    grid = np.linspace(job["low"], job["high"], 100)
    found, wall, cpu = least(lambda: curve(system, job, *fine), rounds)
    _, wall_read, cpu_read = least(lambda: curve(system, job, *fine).amplitude, rounds)
    how: dict[str, Any] = {"unit": "rad/s", "harmonics": harmonics, "samples": samples}
    swept, wall_sweep, cpu_sweep = least(lambda: ms.harmonic_response(system, grid, **how), rounds)
    assert found.converged.all() and swept.converged.all(), (found, swept)
    n = len(found)
    print(f"\n## {make.__name__}\n\n{found}\n")
    print(
        "| program | points | CPU ms | CPU ms / point | wall ms / point | CPU / follow, a point | the curve | moved |"
    )
    print("|---|--:|--:|--:|--:|--:|--:|--:|")
    print(row("ms.follow", n, wall, cpu, n, cpu), "|")
    print(row("ms.follow, amplitudes read", n, wall_read, cpu_read, n, cpu), "|")
    print(row("ms.harmonic_response", len(grid), wall_sweep, cpu_sweep, n, cpu), "|", flush=True)
    for solver, reductor in peers if PYHARM.is_file() else ():
        told = {**job, **STEPS, "solver": solver, "reductor": reductor, "harmonics": harmonics, "samples": samples}
        with tempfile.TemporaryDirectory() as folder:
            peer = pyharm({**told, "rounds": max(1, rounds // 3)}, Path(folder))
        name = f"pyHarm, {solver}" + (", condensed" if reductor == "NLdofs" else "")
        line = row(name, len(peer["omega"]), peer["wall"].min(), peer["cpu"].min(), n, cpu)
        print(f"{line} {moved(found, peer):.0e} |", flush=True)
    if not PYHARM.is_file():
        print("\npyHarm is not installed: sh tests/peers/setup.sh pyharm")


def print_first_call(name: str) -> None:
    """What the first curve of a process costs."""
    empty, filled = first_call(name)
    words = f"{filled[0]:.1f} ({filled[1]:.1f}) with a filled cache, {empty[0]:.1f} ({empty[1]:.1f}) with an empty one"
    print(f"\nFirst curve of a process, wall (CPU) s: {words}.", flush=True)


def row(name: str, points: int, wall: float, cpu: float, n: int, ours: float) -> str:
    each = f"{1e3 * cpu / points:.3f} | {1e3 * wall / points:.3f} | {cpu / points / (ours / n):.1f} | {cpu / ours:.1f}"
    return f"| {name} | {points} | {1e3 * cpu:.0f} | {each} |"


if __name__ == "__main__":
    sys.exit(main())

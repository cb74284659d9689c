"""Frequency response of a cantilever of 20 modes with a Jenkins element at its tip, against pyHarm in one run.

    python benchmarks/cantilever.py            # 7 harmonics, 128 samples; pyHarm takes minutes
    python benchmarks/cantilever.py --quick    # one round, pyHarm without condensation only

A clamped beam of ten elements (length, bending stiffness and mass per length 1), damping 0.5 % in every mode, pushed at
its tip, where a spring of 20 in series with a slider holds it: the tip slides at the resonance. pyHarm (an environment
of its own, `sh tests/peers/setup.sh pyharm`) has the 20 displacements and slopes as unknowns, or condensed to those
with friction (its reductor NLdofs); it chooses its steps as it likes up to the length given. Its default solver is
used, which is quicker here than its own NewtonRaphson. Every point of it is corrected by microslip at the same Omega:
how far it moves says that both follow the same curve.
Times are the least of some rounds after one that compiles; CPU of the process, one thread.
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
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from microslip import continuation
from microslip.contact.friction import Coulomb
from microslip.contact.normal import Preload
from microslip.contact.patch import Patch
from microslip.contact.point import PointContact
from microslip.data import Compliance, Interface, ModalGroup, Rows
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.solver import newton, sweep
from microslip.system.assembly import Assembly, Contact, ContactFace, Load, Output
from microslip.system.component import Component

ROOT = Path(__file__).resolve().parents[1]
PYHARM = ROOT / "build" / "peers" / "pyharm" / "bin" / "python"
FORCE, SPRING, LIMIT, LOW, HIGH, TIP = 0.1, 20.0, 0.25, 2.0, 12.0, 18


def beam(elements: int = 10, ratio: float = 0.005) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, C, K of a cantilever of Euler-Bernoulli elements: displacement and slope of every node but the clamped one."""
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
    K, M = K[2:, 2:], M[2:, 2:]
    squares, shapes = scipy.linalg.eigh(K, M)
    C = M @ shapes @ np.diag(2 * ratio * np.sqrt(squares)) @ shapes.T @ M
    return M, C, K


def modal(M: np.ndarray, C: np.ndarray, K: np.ndarray, force: float) -> ModalGroup:
    """All modes of it, pushed and watched at the tip."""
    squares, shapes = scipy.linalg.eigh(K, M)
    m, tip, nowhere = len(squares), shapes[TIP], np.zeros(3)
    face = Interface(
        nowhere, np.eye(3), np.outer([0, 1, 0, 0, 0, 0], tip), np.zeros(m), np.zeros((0, 3)), np.zeros(0),
        np.zeros((0, 3)), np.zeros((0, 3, m)),
    )  # fmt: skip
    return ModalGroup(
        speed=0.0, omega=np.sqrt(squares), kind=("normal",) * m, damping_ratio=np.zeros(m), M_r=np.eye(m),
        K_r=np.diag(squares), C_r=shapes.T @ C @ shapes, G_r=np.zeros((m, m)), phi=np.zeros((0, 3, m)),
        interfaces={"tip": face}, excitations={"push": Rows(force * tip[None], ("push",), "m", nowhere)},
        monitors={"tip": Rows(tip[None], ("u",), "m", nowhere)}, gauges={},
        compliance=Compliance((), np.zeros((0, 0)), np.zeros((0, 0)), False), stresses={}, u_static=np.zeros((0, 3)),
        checks={},
    )  # fmt: skip


def cantilever(harmonics: int, samples: int) -> Problem:
    """One coordinate, the motion of the tip along t1: a point contact under a constant normal force of 1."""
    value, group = jnp.asarray, modal(*beam(), FORCE)
    law = PointContact(Preload(value(1.0)), Coulomb(value(LIMIT)), value(SPRING))
    along = np.zeros((1, 3, 1))
    along[0, 1, 0] = 1.0
    patch = Patch("tip", np.zeros((1, 2)), np.ones(1), law, along)
    side = ContactFace("beam", "tip", rows={0: group.interfaces["tip"].rows[1:2]})
    contact = Contact("tip", patch, side, None, np.zeros(1), np.zeros(1))
    component, push, output = Component("beam", {0: group}), Load("beam", "push"), Output("beam", "tip", "u")
    assembly = Assembly((component,), (contact,), (push,), (output,))
    return replace(balance.of(assembly, harmonics, samples, length=LIMIT / SPRING), lam_scale=2.0)


def least(run: Callable[[], Any], rounds: int) -> tuple[Any, float, float]:
    """Result, least wall and least CPU seconds after a first round that compiles."""
    times = []
    for _ in range(rounds + 1):
        wall, cpu = time.perf_counter(), time.process_time()
        result = run()
        times.append((time.perf_counter() - wall, time.process_time() - cpu))
    return result, min(t[0] for t in times[1:]), min(t[1] for t in times[1:])


def pyharm(reductor: str, harmonics: int, samples: int, rounds: int, work: Path) -> dict[str, np.ndarray]:
    M, C, K = beam()
    np.savez(
        work / "job.npz", M=M, C=C, K=K, driven=TIP, slides=TIP, force=FORCE, stiffness=SPRING, limit=LIMIT, low=LOW,
        high=HIGH, step=0.02, step_max=0.2, solver="scipyroot", reductor=reductor, harmonics=harmonics,
        samples=samples, rounds=rounds, tolerance=1e-7,
    )  # fmt: skip
    worker = ROOT / "benchmarks" / "pyharm_cantilever.py"
    alone = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    command = [PYHARM, worker, work / "job.npz", work / "out.npz"]
    subprocess.run(command, check=True, env=alone, cwd=work, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return dict(np.load(work / "out.npz"))


def moved(problem: Problem, peer: dict[str, np.ndarray]) -> float:
    """Largest correction of the peer's points by Newton's method, in parts of the largest amplitude."""
    x = peer["x"] / problem.scale[0]
    found = [np.abs(newton(problem.at(w), one).x - one).max() for one, w in zip(x, peer["omega"], strict=True)]
    return float(max(found) / np.abs(x).max())


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--harmonics", type=int, default=7)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="one round, one of pyHarm's ways")
    arguments = parser.parse_args(argv)
    rounds = 1 if arguments.quick else arguments.rounds
    problem = cantilever(arguments.harmonics, arguments.samples)
    settings = continuation.Settings(low=LOW, high=HIGH)
    start = problem.at(LOW).reference
    curve, wall, cpu = least(lambda: continuation.trace(problem, start, LOW, settings), rounds)
    grid = np.linspace(LOW, HIGH, 100) / (2 * np.pi)
    points, wall_sweep, cpu_sweep = least(lambda: sweep(problem, grid), rounds)
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, jax {jax.__version__}, "
          f"numpy {np.__version__}, load {os.getloadavg()[0]:.1f}\n")  # fmt: skip
    assert all(p.converged for p in points)
    n = len(curve.points)
    top = max(curve.points, key=lambda p: float(np.hypot(*p.x[1:3])))
    print(f"highest at Omega = {top.lam:.6g}, {np.hypot(*top.x[1:3]) * problem.scale[0]:.6g}\n")
    print("| program | points | curve, CPU ms | ms / point | CPU ms / point | CPU / microslip, a point | the curve |"
          " moved |\n|---|--:|--:|--:|--:|--:|--:|--:|")  # fmt: skip
    print(row("microslip, curve", n, wall, cpu) + " 1.0 | 1.0 | |", flush=True)
    ratios = f" {cpu_sweep / len(grid) / (cpu / n):.1f} | {cpu_sweep / cpu:.1f} | |"
    print(row("microslip, sweep", len(grid), wall_sweep, cpu_sweep) + ratios, flush=True)
    if not PYHARM.is_file():
        print("\npyHarm is not installed: sh tests/peers/setup.sh pyharm")
        return
    with tempfile.TemporaryDirectory() as folder:
        for reductor in ("noreductor",) if arguments.quick else ("noreductor", "NLdofs"):
            peer = pyharm(reductor, arguments.harmonics, arguments.samples, max(1, rounds // 3), Path(folder))
            m, theirs = len(peer["omega"]), peer["cpu"].min()
            ratios = f" {theirs / m / (cpu / n):.0f} | {theirs / cpu:.0f} | {moved(problem, peer):.0e} |"
            print(row(f"pyHarm, {reductor}", m, peer["wall"].min(), theirs) + ratios, flush=True)


def row(name: str, points: int, wall: float, cpu: float) -> str:
    return f"| {name} | {points} | {1e3 * cpu:.0f} | {1e3 * wall / points:.3f} | {1e3 * cpu / points:.3f} |"


if __name__ == "__main__":
    sys.exit(main())

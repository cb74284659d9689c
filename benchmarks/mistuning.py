"""A mistuned ring with friction, its peak found: growth with the blades, and peers beside it.

    python benchmarks/mistuning.py               # 12 to 96 blades, and all peers: a quarter of an hour
    python benchmarks/mistuning.py --quick       # 6 and 12

CPU seconds of one thread, compiled programs warm. The ring: sample vanes (6 modes, H = 3, 64 samples, one point a
gap), a wave of 30 degrees from blade to blade whatever their number, blade frequencies scattered by 1 %, 24 frequencies
and what the search for the peak adds, through `mistuning.samples`, which `ms.mistune` calls for every sample. Peers
solve the same balance on the 24 frequencies alone, Newton's method from the neighbouring point:

dense    the same compiled contact forces, the Jacobian of all coordinates as one dense matrix, LU
by hand  forces of one blade's contact after the other, sample after sample in plain Python, with derivatives by
         differences, and the dense Jacobian; at three frequencies, and as much for all
ccx      CalculiX, the whole annulus of vanes without contact in finite elements, linear: eigenmodes, then the steady
         state at the 24 frequencies
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import microslip as ms
from microslip.harmonic_balance.solver import CONVERGED, Point
from microslip.mistuning.ring import Tuned
from microslip.mistuning.samples import Asked, amplitudes, sample
from microslip.mistuning.scatter import Scatter

RUB = {"interface": "right", "against": "left", "against_sector": 1, "law": "smooth", "normal_force": 20.0,
       "normal_stiffness": 2e5, "tangential_stiffness": 4e5, "friction": 0.2, "points": [1, 1]}  # fmt: skip
FREQUENCY = np.linspace(280.0, 292.0, 24)


def asked(blades: int, stuck: bool = False) -> Asked:
    """A wave of 30 degrees from blade to blade."""
    case = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe", "modes": 6,
            "ring": {"blades": blades, "engine_order": max(blades // 12, 1)}, "contacts": [RUB]}  # fmt: skip
    tuned = Tuned(ms.assemble(case, vane=ms.sample()).assembly, {})
    return Asked(tuned, (Scatter("frequency", 0.01),), FREQUENCY, 1, {"harmonics": 3, "samples": 64}, stuck)


def compiled(at, x):
    """(W, c) forces and their derivatives, as Newton's method of the program asks for them."""
    return at.forces(x)


def by_hand(at, x):
    """The same: a linear spring that opens, Coulomb friction by a return map, contact after contact."""
    p, forces, slopes = at.problem, [], []
    W, T = p.coefficients, waves(p.coefficients, 64)
    for g in p.groups:
        U, F, S = g.relative(p.displacement(x)), [], []
        for i, u in zip(g.contacts, U, strict=True):
            contact = p.assembly.contacts[i]
            G, k = contact.patch.kinematics[0], np.diag(contact.stiffness)[:3].tolist()
            place = G @ u
            f = marched(place, k, RUB["friction"], T)
            slope = np.zeros((3, W, 3, W))
            for d in range(3):
                for w in range(W):
                    moved = place.copy()
                    moved[d, w] += 1e-10
                    slope[:, :, d, w] = (marched(moved, k, RUB["friction"], T) - f) / 1e-10
            F.append(G.T @ f)
            S.append(np.einsum("ak,awbz,bl->kwlz", G, slope, G))
        forces.append(np.array(F))
        slopes.append(np.array(S))
    return at.along(forces), slopes


def waves(W: int, samples: int) -> np.ndarray:
    """(W, samples) 1, cos, sin, cos 2, ... over a cycle."""
    t, h = 2 * np.pi * np.arange(samples) / samples, np.arange(1, W // 2 + 1)[:, None]
    return np.vstack([np.ones((1, samples)), np.stack([np.cos(h * t), np.sin(h * t)], axis=1).reshape(W - 1, samples)])


def marched(place: np.ndarray, k: list[float], mu: float, T: np.ndarray) -> np.ndarray:
    """(3, W) harmonics of the force of a point, two cycles."""
    normal, first, second = (place @ T).tolist()
    out = np.zeros((3, T.shape[1]))
    a = b = 0.0
    for cycle in range(2):
        for i, un in enumerate(normal):
            N = max(k[0] * un, 0.0)
            a += k[1] * (first[i] - first[i - 1]) if cycle or i else 0.0
            b += k[2] * (second[i] - second[i - 1]) if cycle or i else 0.0
            size = (a * a + b * b) ** 0.5
            if size > mu * N:
                a, b = a * mu * N / size, b * mu * N / size
            if cycle:
                out[0, i], out[1, i], out[2, i] = N, a, b
    weights = np.full(len(T), 2.0)
    weights[0] = 1.0
    return out @ (T.T * weights) / T.shape[1]


def dense(what: Asked, number: int, forces=compiled, frequency=FREQUENCY) -> tuple[int, float]:
    """Points with a solution, and the highest amplitude on the grid, by dense Newton steps with halving."""
    problem = what.problem(what.tuned.mistuned(what.deviations(number)))
    x, solved, top = None, 0, 0.0

    def left(at, x):
        return at.residual(x) if forces is compiled else at.residual_of(x, forces(at, x)[0])

    for f in frequency:
        at = problem.at(2 * np.pi * f)
        x = at.reference if x is None else x
        for _ in range(60):
            force, slopes = forces(at, x)
            R = at.residual_of(x, force)
            if np.abs(R).max() <= 1e-8 * np.abs(x).max():
                solved += 1
                top = max(top, float(np.abs(amplitudes(problem, Point(at.Omega, x, CONVERGED, 0.0, 0))).max()))
                break
            step, share = np.linalg.solve(at.jacobian(slopes).dense(), -R), 1.0
            while share > 0.02 and not np.linalg.norm(left(at, x + share * step)) < np.linalg.norm(R):
                share *= 0.5
            x = x + share * step
    return solved, top


def annulus(blades: int, n: tuple[int, int, int], modes: int) -> list[str]:
    """A CalculiX deck of bricks the size of the vane, clamped at one end, six modes each, driven at their tips."""
    places = np.stack(np.meshgrid(*(np.arange(m + 1) for m in n), indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(places)).reshape([m + 1 for m in n])
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = np.stack(
        [number[i : i + n[0] or None, j : j + n[1] or None, k : k + n[2] or None][: n[0], : n[1], : n[2]].ravel()
         for i, j, k in corners], axis=1)  # fmt: skip
    nodes, elements, held, tips = ["*NODE, NSET=NALL"], ["*ELEMENT, TYPE=C3D8I, ELSET=EALL"], ["*BOUNDARY"], ["*CLOAD"]
    for b in range(blades):
        first = 1 + b * len(places)
        nodes += [f"{first + i}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(places * SIZE / n + [0.1 * b, 0, 0])]
        elements += [f"{1 + b * len(cells) + i}, " + ", ".join(str(first + c) for c in one)
                     for i, one in enumerate(cells)]  # fmt: skip
        held += [f"{first + i}, 1, 3" for i in number[:, :, 0].ravel()]
        tips.append(f"{first + number[0, 0, -1]}, 1, 2.0")
    return [
        *nodes, *elements, "*MATERIAL, NAME=M", "*ELASTIC", "2.1e11, 0.3", "*DENSITY", "7850.",
        "*SOLID SECTION, ELSET=EALL, MATERIAL=M", *held, "*STEP", "*FREQUENCY, STORAGE=YES", f"{modes}", "*END STEP",
        "*STEP", "*STEADY STATE DYNAMICS", f"{FREQUENCY[0]}, {FREQUENCY[-1]}, {len(FREQUENCY)}, 1.",
        "*MODAL DAMPING", f"1, {modes}, 0.001", *tips, "*NODE PRINT, NSET=NALL, FREQUENCY=100", "U", "*END STEP",
    ]  # fmt: skip


SIZE = np.array([0.005, 0.02, 0.12])
"""m, of the bricks of CalculiX."""


def calculix(blades: int, n: tuple[int, int, int]) -> float | None:
    """CPU seconds of CalculiX; None where it is not installed, or fails."""
    if shutil.which("ccx") is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "ring.inp").write_text("\n".join(annulus(blades, n, 6 * blades)) + "\n")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(["ccx", "ring"], cwd=folder, capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if "Job finished" not in done.stdout:
            print(done.stdout[-500:])
            return None
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def timed(call, *given) -> tuple[float, object]:
    begun = time.process_time()
    found = call(*given)
    return time.process_time() - begun, found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    print(f"{'blades':>7} {'s/sample':>9} {'points':>7} {'ms/point/blade':>15} {'sticking, s':>12}", flush=True)
    for N in (6, 12) if quick else (12, 24, 48, 96):
        what, linear = asked(N), asked(N, stuck=True)
        sample(what, 0)  # with the tuned ring's solutions, from which all begin
        each = [timed(sample, what, n) for n in (1, 2)]
        points = np.mean([len(s.top.frequencies) for _, s in each])
        spent, stuck = np.mean([t for t, _ in each]), timed(sample, linear, 1)[0]
        print(f"{N:7d} {spent:9.2f} {points:7.0f} {1e3 * spent / points / N:15.2f} {stuck:12.3f}", flush=True)
    peers(6 if quick else 24)


def peers(N: int) -> None:
    """One sample by the program, and by its peers."""
    what = asked(N)
    sample(what, 0)
    own, found = timed(sample, what, 1)
    print(f"{N} blades, sample 1: {own:.2f} s with its peak, {len(found.top.frequencies)} points", flush=True)
    on_grid = float(np.nanmax(found.grid))
    for name, forces, frequency in (("dense", compiled, FREQUENCY), ("by hand", by_hand, FREQUENCY[9:12])):
        spent, (solved, top) = timed(dense, what, 1, forces, frequency)
        whole = spent * len(FREQUENCY) / len(frequency)
        same = float(np.nanmax(found.grid[np.isin(FREQUENCY, frequency)]))
        print(f"{name}: {spent:.1f} s at {len(frequency)} frequencies, {solved} solved, {whole / own:.0f} times as "
              f"long for all; highest {top / same - 1:+.1e} off", flush=True)  # fmt: skip
    print(f"highest on the grid {on_grid:.6g} m, at the peak {found.top.amplitude:.6g} m")
    for n in ((1, 2, 12), (4, 8, 40)):
        if (spent := calculix(N, n)) is not None:
            size = 3 * N * (n[0] + 1) * (n[1] + 1) * n[2]
            print(f"ccx, {size} degrees of freedom: {spent:.1f} s, {spent / own:.1f} times as long", flush=True)


if __name__ == "__main__":
    main()

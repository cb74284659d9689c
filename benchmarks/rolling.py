"""States of rolling a second: `ms.creep_forces` beside a compiled scalar FASTSIM in C, both with 20 x 20 elements.

    OMP_NUM_THREADS=1 python benchmarks/rolling.py

The peer is written here, compiled with the system's C compiler (-O3 -march=native), and marches the strips one state
after the other. CPU seconds of one thread, both in turns, the least of five; compiling is not counted. The strip model
returns forces, moment, power and what slides, the peer forces and moment.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("NPROC", "1")

import numpy as np

import microslip as ms
from microslip.rolling.kalker import creep_coefficients

SOURCE = r"""
#include <math.h>
void fastsim(int n, int nx, int ny, const double *xi, const double *eta, const double *phi, const double *a,
             const double *b, const double *held, const double *L1, const double *L2, const double *L3, double *out) {
  for (int s = 0; s < n; s++) {
    double top = 2 * held[s] / (M_PI * a[s] * b[s]), dy = 2 * b[s] / ny, fx = 0, fy = 0, mz = 0;
    for (int j = 0; j < ny; j++) {
      double y = -b[s] + (j + 0.5) * dy, e = 1 - y * y / (b[s] * b[s]), reach = a[s] * sqrt(e), dx = 2 * reach / nx;
      double px = 0, py = 0, x = reach - 0.5 * dx, tx = 0, ty = 0, tm = 0;
      double wx = dx * (xi[s] / L1[s] - phi[s] * y / L3[s]);
      for (int i = 0; i < nx; i++, x -= dx) {
        px -= wx; py -= dx * (eta[s] / L2[s] + phi[s] * x / L3[s]);
        double g = top * (e - x * x / (a[s] * a[s])), p = sqrt(px * px + py * py);
        if (p > g) { px *= g / p; py *= g / p; }
        tx += px; ty += py; tm += x * py - y * px;
      }
      fx += tx * dx * dy; fy += ty * dx * dy; mz += tm * dx * dy;
    }
    out[s] = fx; out[n + s] = fy; out[2 * n + s] = mz;
  }
}
"""
STATES, SHEAR, POISSON, FRICTION = 20_000, 82e9, 0.28, 0.3


def states() -> dict[str, np.ndarray]:
    """Creepages up to full sliding, spin, ellipses of a/b from 0.5 to 6."""
    random = np.random.default_rng(1)
    one = random.uniform(size=(6, STATES))
    return {
        "xi": 4e-3 * (one[0] - 0.5), "eta": 4e-3 * (one[1] - 0.5), "phi": one[2] - 0.5, "a": 8e-3 * (0.5 + one[3]),
        "b": 4e-3 * (0.5 + one[4]), "normal_force": 8e4 * (0.5 + one[5]),
    }  # fmt: skip


def peer(of: dict[str, np.ndarray], folder: Path) -> Callable[[], np.ndarray]:
    """The C program, with Kalker's three flexibilities."""
    (folder / "fastsim.c").write_text(SOURCE)
    words = "cc -O3 -march=native -shared -fPIC fastsim.c -o fastsim.so -lm"
    subprocess.run(words.split(), cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "fastsim.so"))
    c11, c22, c23, _ = np.asarray(creep_coefficients(of["a"] / of["b"], POISSON))
    a, b = of["a"], of["b"]
    L = [8 * a / (3 * c11 * SHEAR), 8 * a / (3 * c22 * SHEAR), np.pi * a * np.sqrt(a / b) / (4 * c23 * SHEAR)]
    given = [*(of[k] for k in ("xi", "eta", "phi", "a", "b")), FRICTION * of["normal_force"], *L]
    out = np.zeros((3, STATES))
    pointers = [v.ctypes.data_as(ctypes.c_void_p) for v in [*given, out]]

    def call() -> np.ndarray:
        library.fastsim(STATES, 20, 20, *pointers)
        return out

    return call


def main() -> None:
    of = states()
    how = {"friction": FRICTION, "shear": SHEAR, "poisson": POISSON}
    with tempfile.TemporaryDirectory() as folder:
        calls = {
            "FASTSIM in C": peer(of, Path(folder)),
            "strips, constant": lambda: ms.creep_forces(**of, **how),
            "strips, non-constant": lambda: ms.creep_forces(**of, **how, distribution="non-constant"),
        }
        found = {name: call() for name, call in calls.items()}
        least = dict.fromkeys(calls, np.inf)
        for _ in range(5):
            for name, call in calls.items():
                began = time.process_time()
                call()
                least[name] = min(least[name], time.process_time() - began)
    held = FRICTION * of["normal_force"]
    c, strips = found["FASTSIM in C"], found["strips, constant"]
    off = np.hypot(c[0] - strips.x, c[1] - strips.y) / held
    print("| what | us a state and core | states a second and core | over C |\n|---|--:|--:|--:|")
    for name, spent in least.items():
        us = 1e6 * spent / STATES
        print(f"| {name} | {us:.2f} | {1e6 / us:,.0f} | {spent / least['FASTSIM in C']:.2f} |")
    print(f"\nForces of both differ by {off.mean():.1e} of mu F_N in the mean, {off.max():.1e} at the most.")


if __name__ == "__main__":
    main()

"""A hundred speeds of the disc brake: one parametric basis against SciPy's shift-invert at every speed.

    OMP_NUM_THREADS=1 python benchmarks/stability.py [FULL]

Peers: `scipy.sparse.linalg.eigs` on the companion form of twice the size, as its documentation shows it, and the better
way, ARPACK with the quadratic problem's own factors of half that size as `OPinv`. Both are asked for the 24 roots about
the middle of the window, which is known here to cover it. CPU seconds of one thread; the peers solve FULL (5) of the
hundred speeds, evenly spread, and their sum is scaled to a hundred: with 100, nothing is.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import microslip as ms
from microslip.linalg.quadratic import Quadratic, Window
from microslip.stages.stability import question

BRAKE = Path(__file__).parents[1] / "geometry" / "disc-brake"
NEAREST = 24


def companion(Q: Quadratic, window: Window) -> np.ndarray:
    """eigs(A, k, B, sigma) on 2 n unknowns, complex so that SciPy does not take the real part of the operator."""
    eye = sp.identity(Q.n)
    A = sp.bmat([[None, eye], [-Q.K, -Q.C]], format="csc").astype(complex)
    B = sp.block_diag([eye, Q.M], format="csc").astype(complex)
    return spla.eigs(A, NEAREST, B, sigma=window.middle, v0=np.ones(2 * Q.n, complex), return_eigenvectors=False)


def condensed(Q: Quadratic, window: Window) -> np.ndarray:
    """ARPACK on the same operator by factors of n unknowns, with the ordering that suits them."""
    s, n = window.middle, Q.n
    how = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.1, "options": {"SymmetricMode": True}}
    lu, g = spla.splu(sp.csc_matrix(Q.at(s)), **how), abs(s)

    def operator(z: np.ndarray) -> np.ndarray:
        x = -lu.solve(Q.M @ (g * z[n:]) + Q.C @ z[:n] + s * (Q.M @ z[:n]))
        return np.concatenate([x, (z[:n] + s * x) / g])

    inverse = spla.LinearOperator((2 * n, 2 * n), matvec=operator, dtype=complex)
    return s + 1 / spla.eigs(inverse, NEAREST, v0=np.ones(2 * n, complex), return_eigenvectors=False)


def cpu(work: Callable[[], object]) -> tuple[float, object]:
    start = time.process_time()
    found = work()
    return time.process_time() - start, found


def main(full: int = 5) -> None:
    q = question(BRAKE, [])
    family, speeds = q.family(), np.linspace(*(q.asked.range or (1.0, 2.0)), 100)
    limits = {"frequency": q.asked.frequency, "growth": q.asked.growth, "at": q.at, "neutral": q.asked.neutral}
    whole, found = cpu(lambda: ms.stability(family, over="speed", values=speeds, **limits))
    assert isinstance(found, ms.roots.diagram.Diagram) and found.basis is not None
    apart, _ = cpu(lambda: [found.basis.at(float(v)) for v in speeds])
    print(f"one basis: {whole:.2f} s with its making, {apart:.2f} s for 100 speeds alone; {found.sentence}")
    for name, solve in (("SciPy, own factors", condensed), ("SciPy, companion form", companion)):
        each, worst, short = list[float](), 0.0, 0
        for i in np.linspace(0, len(speeds) - 1, full).astype(int):
            Q = family.at({"speed": float(speeds[i])})
            seconds, s = cpu(lambda Q=Q, solve=solve: solve(Q, q.window))
            each.append(seconds)
            inside = s[q.window.holds(s)]
            short += len(found.s[i]) - len(inside)
            worst = max([worst, *(float(np.abs(found.s[i] - v).min() / abs(v)) for v in inside)])
        hundred = 100 * sum(each) / full
        print(
            f"{name}: {min(each):.2f} to {max(each):.2f} s a speed, 100 of them {hundred:.0f} s (from {full}); the "
            f"basis is {hundred / whole:.0f} times as fast, {hundred / apart:.0f} times once it is made; largest "
            f"difference {worst:.1e}, roots that SciPy lacks {short}"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))

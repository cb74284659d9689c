"""A mistuned ring with friction, its peak found: growth with the blades, and a dense Newton method beside it.

    python benchmarks/mistuning.py               # 12 to 96 blades, minutes
    python benchmarks/mistuning.py --quick       # 6 and 12

CPU seconds of one thread, compiled programs warm. The ring: sample vanes (6 modes, H = 3, 64 samples, one point a
gap), blade frequencies scattered by 1 %, 24 frequencies and what the search for the peak adds, through
`mistuning.samples`, which `ms.mistune` calls for every sample. The peer solves the same balance at the same frequencies
as one would by hand: the same compiled contact forces, the Jacobian of all coordinates as one dense matrix, LU, from
the neighbouring point.
"""

from __future__ import annotations

import argparse
import os
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import microslip as ms
from microslip.harmonic_balance.solver import CONVERGED
from microslip.mistuning.ring import Tuned
from microslip.mistuning.samples import Asked, sample
from microslip.mistuning.scatter import Scatter

RUB = {"interface": "right", "against": "left", "against_sector": 1, "law": "smooth", "normal_force": 20.0,
       "normal_stiffness": 2e5, "tangential_stiffness": 4e5, "friction": 0.2, "points": [1, 1]}  # fmt: skip
FREQUENCY = np.linspace(280.0, 292.0, 24)


def asked(blades: int, stuck: bool = False) -> Asked:
    case = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe", "modes": 6,
            "ring": {"blades": blades, "engine_order": 2}, "contacts": [RUB]}  # fmt: skip
    tuned = Tuned(ms.assemble(case, vane=ms.sample()).assembly, {})
    return Asked(tuned, (Scatter("frequency", 0.01),), FREQUENCY, 1, {"harmonics": 3, "samples": 64}, stuck)


def dense(what: Asked, number: int) -> tuple[int, float]:
    """Points with a solution, and the highest amplitude on the grid, by dense Newton steps with halving."""
    from microslip.harmonic_balance.solver import Point
    from microslip.mistuning.samples import amplitudes

    problem = what.problem(what.tuned.mistuned(what.deviations(number)))
    x, solved, top = None, 0, 0.0
    for f in what.frequency:
        at = problem.at(2 * np.pi * f)
        x = at.reference if x is None else x
        R = at.residual(x)
        for _ in range(60):
            if np.abs(R).max() <= 1e-10 * np.abs(x).max():
                solved += 1
                top = max(top, float(np.abs(amplitudes(problem, Point(at.Omega, x, CONVERGED, 0.0, 0))).max()))
                break
            step, share = np.linalg.solve(at.jacobian(at.forces(x)[1]).dense(), -R), 1.0
            while share > 0.02 and not np.linalg.norm(at.residual(x + share * step)) < np.linalg.norm(R):
                share *= 0.5
            x = x + share * step
            R = at.residual(x)
    return solved, top


def timed(call, *given) -> tuple[float, object]:
    begun = time.process_time()
    found = call(*given)
    return time.process_time() - begun, found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    print(f"{'blades':>7} {'s/sample':>9} {'ms/point/blade':>15} {'sticking, s':>12}")
    for N in (6, 12) if quick else (12, 24, 48, 96):
        what, linear = asked(N), asked(N, stuck=True)
        sample(what, 0)  # with the tuned ring's solutions, from which all begin
        each = [timed(sample, what, n) for n in (1, 2, 3)]
        points = np.mean([len(s.top.frequencies) for _, s in each])
        spent, stuck = np.mean([t for t, _ in each]), timed(sample, linear, 1)[0]
        print(f"{N:7d} {spent:9.2f} {1e3 * spent / points / N:15.2f} {stuck:12.3f}")
    N = 6 if quick else 24
    what = asked(N)
    sample(what, 0)
    (own, found), (other, (solved, top)) = timed(sample, what, 1), timed(dense, what, 1)
    print(f"{N} blades, sample 1: {own:.2f} s with its peak ({found.top.amplitude:.6g} m)")
    print(
        f"dense Newton on the grid alone: {other:.2f} s, {solved} of {len(FREQUENCY)} points ({top:.6g} m), "
        f"{other / own:.1f} times as long"
    )


if __name__ == "__main__":
    main()

"""Vibration under two frequencies: a balance over both angles beside a motion in time, to the same accuracy.

    python benchmarks/two_tone.py            # a minute or two
    python benchmarks/two_tone.py --quick    # the smooth spring alone

One mass, or a chain of twenty, damping ratio 0.01, a cubic spring or a Jenkins element at its end; both frequencies
below the resonance, their ratio half the golden one. The balance is ms.two_tones with so many harmonics; its error is
the largest difference of the motion over 20 periods from one with more harmonics, over the largest displacement. The
motion in time is ms.integrate, from rest until over the last 20 periods it differs from that by no more than the
balance does: of periods 25, 50, 100, ... and steps a period 256, 512, 1024, ... the first that does. CPU seconds,
programs compiled before.
"""

from __future__ import annotations

import argparse
import os
import time
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import microslip as ms

FIRST = 0.7
SECOND = 0.35 * (np.sqrt(5.0) - 1.0)
KEPT = 20


def spent(run: Any) -> tuple[Any, float]:
    """Result and CPU seconds of a second run."""
    run()
    before = time.process_time()
    return run(), time.process_time() - before


def balanced(system: Any, order: int, samples: int) -> Any:
    return ms.two_tones(system, FIRST, SECOND, harmonics=order, samples=samples, unit="rad/s")


def in_time(system: Any, exact: Any, wanted: float) -> tuple[int, int, float, float]:
    """Periods, steps a period, error and CPU seconds of the cheapest motion in time that is as near."""
    best = None
    for steps in (256, 512, 1024, 2048):
        for settle in (25, 50, 100, 200, 400):

            def run(settle: int = settle, steps: int = steps) -> Any:
                return ms.integrate(
                    system, FIRST, second=SECOND, unit="rad/s", settle=settle, keep=KEPT, samples=64, steps=steps
                )

            found = run()
            error = np.abs(found.y[0] - exact.motion(found.time)).max() / np.abs(found.y[0]).max()
            if error <= wanted:
                seconds = spent(run)[1]
                best = min(best or (np.inf,), (seconds, settle, steps, error))
                break
        if best:
            break
    return (0, 0, np.nan, np.nan) if best is None else (best[1], best[2], best[3], best[0])


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    one = (np.eye(1), np.eye(1))
    chain = (np.eye(20), 400.0 * (2 * np.eye(20) - np.eye(20, k=1) - np.eye(20, k=-1) - np.diag(19 * [0.0] + [1.0])))
    spring, element = ms.polynomial({3: 0.1}, at=-1), ms.jenkins(1.0, 0.15, at=-1)
    cases = [("one mass, cubic spring", one, spring, 5, 40, 11, 88)]
    if not quick:
        cases.append(("twenty masses, cubic spring", chain, ms.polynomial({3: 2.0}, at=-1), 5, 40, 11, 88))
        cases.append(("one mass, Jenkins element", one, element, 7, 64, 15, 256))
    for name, (M, K), at_end, order, samples, more, finer in cases:
        stiff = K[-1, -1] / len(K)  # of the end
        ends = {"force": {-1: 0.2 * stiff}, "second_force": {-1: 0.1 * stiff}}
        system = ms.structure(M, K, damping_ratio=0.01, **ends, elements=[at_end])
        exact = balanced(system, more, finer)
        found, seconds = spent(lambda s=system, n=order, m=samples: balanced(s, n, m))
        t = np.linspace(0.0, 2 * np.pi * KEPT / FIRST, 64 * KEPT)
        y = exact.motion(t)
        error = float(np.abs(found.motion(t) - y).max() / np.abs(y).max())
        settle, steps, off, other = in_time(system, exact, error)
        told = (
            f"{name}: balance, {order} harmonics: error {error:.1e}, {seconds:.3f} s; motion in time, {settle} + {KEPT}"
        )
        print(f"{told} periods of {steps} steps: {off:.1e}, {other:.2f} s; ratio {other / seconds:.1f}")


if __name__ == "__main__":
    main()

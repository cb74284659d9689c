"""The two-mass diagram of Sextro section 4.4 over the load, with all its branches, beside AUTO-07p in one run.

    python benchmarks/bifurcation.py            # minutes
    python benchmarks/bifurcation.py --quick    # the first branch alone

ms.bifurcate on the assembly of pipeline/cases/belt.toml: equilibria, both branches born at Hopf points, and every orbit
that is doubled where stability changes, twice. Programs are compiled anew, and that counts. AUTO: equilibria and the
first branch up to 6.9 m, as tests/test_auto07p.py has them (gcc -O2, without the compiler's time). CPU seconds.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import jax

import microslip as ms

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))


def spent(run: Callable[[], Any], children: bool = False) -> tuple[Any, float]:
    """Result and CPU seconds, of the processes it starts if they are meant."""
    who = resource.RUSAGE_CHILDREN if children else resource.RUSAGE_SELF
    before = resource.getrusage(who)
    found = run()
    after = resource.getrusage(who)
    return found, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def by_auto(stop: float) -> tuple[int, float]:
    """Special points of the first branch and CPU seconds; none if AUTO-07p is missing."""
    import pytest
    from test_auto07p import MASSES, Auto, only

    with tempfile.TemporaryDirectory() as folder:
        try:
            auto = Auto(Path(folder), 4, MASSES, "par[0] = 0.5; u[0] = u[1] = u[2] = u[3] = 0;")
        except pytest.skip.Exception:
            return 0, float("nan")

        def run() -> list:
            label = only(auto.run(RL0=0.4, RL1=8.0, DSMAX=0.2), "Hopf", 1.2)[3]
            return auto.run(IPS=2, ICP=[1, 11], NTST=200, RL0=0.4, RL1=stop, DSMAX=0.5, NMX=500, IRS=label, DS=-0.01)

        found, seconds = spent(run, children=True)
    return len(found), seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the first branch alone")
    quick = parser.parse_args().quick
    from test_sliding import masses  # the case over the load

    jax.config.update("jax_enable_compilation_cache", False)
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, jax {jax.__version__}, load "
          f"{os.getloadavg()[0]:.1f}, {time.strftime('%Y-%m-%d')}\n")  # fmt: skip
    print("| what | branches | points | CPU s |\n|---|--:|--:|--:|")
    rows = [("equilibria and first branch", 0.5, 2.0 if quick else 6.9, 0)]
    rows += [] if quick else [("all branches", 0.2, 9.8, 2)]
    for name, start, stop, doublings in rows:
        found, seconds = spent(partial(ms.bifurcate, masses, start, stop, doublings=doublings))
        print(f"| microslip, {name} | {len(found.branches)} | {sum(map(len, found.branches))} | {seconds:.1f} |")
    count, seconds = by_auto(2.0 if quick else 6.9)
    print(f"| AUTO-07p, equilibria and first branch | 2 | {count} special | {seconds:.1f} |")


if __name__ == "__main__":
    main()

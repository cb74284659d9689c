"""AUTO-07p, a process of its own: Hopf points, folds, period doublings and periods that ours are compared with.

It solves for periodic orbits by collocation on an adapted mesh, where we shoot.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from closed_forms.oscillators import belt, brusselator

from microslip.bifurcation.diagram import DiagramPlan, diagram
from microslip.bifurcation.shooting import Shooting
from microslip.continuation import newton

AUTO = Path("/usr/lib/auto-07p/lib")
RUNTIME = [Path("/usr/lib/x86_64-linux-gnu") / name for name in ("libgfortran.so.5", "libgomp.so.1")]

FRAME = """
#include <math.h>
#include <auto_f2c.h>
int func(integer ndim, const doublereal *u, const integer *icp, const doublereal *par, integer ijac, doublereal *f,
         doublereal *dfdu, doublereal *dfdp) { %s return 0; }
int stpnt(integer ndim, doublereal t, doublereal *u, doublereal *par) { %s return 0; }
int pvls(integer ndim, const doublereal *u, doublereal *par) { return 0; }
int bcnd(integer ndim, const doublereal *par, const integer *icp, integer nbc, const doublereal *u0,
         const doublereal *u1, integer ijac, doublereal *fb, doublereal *dbc) { return 0; }
int icnd(integer ndim, const doublereal *par, const integer *icp, integer nint, const doublereal *u,
         const doublereal *uold, const doublereal *udot, const doublereal *upold, integer ijac, doublereal *fi,
         doublereal *dint) { return 0; }
int fopt(integer ndim, const doublereal *u, const integer *icp, const doublereal *par, integer ijac, doublereal *fs,
         doublereal *dfdu, doublereal *dfdp) { return 0; }
"""

KINDS = {"1": "branch point", "2": "fold", "3": "Hopf", "5": "fold", "6": "branch point", "7": "period doubling",
         "8": "torus", "-4": "target"}  # fmt: skip


class Auto:
    """A program of AUTO for x' = f, in a folder.

    Skips the test where AUTO-07p is missing.
    """

    def __init__(self, folder: Path, n: int, rate: str, begin: str) -> None:
        if not (AUTO / "main.o").is_file() or shutil.which("gcc") is None or not all(p.exists() for p in RUNTIME):
            pytest.skip("AUTO-07p is not installed (apt-get install auto-07p gcc libc6-dev libgfortran5 libgomp1)")
        self.folder, self.n = folder, n
        (folder / "eq.c").write_text(FRAME % (rate, begin))
        objects = sorted(AUTO.glob("*.o"))
        libraries = [AUTO / "libauto_c.a", *RUNTIME, "-lm"]
        subprocess.run(["gcc", "-O2", "-o", "eq", "eq.c", *objects, *libraries], cwd=folder, check=True)

    def run(self, **constants: object) -> list[tuple[str, float, list[float], int]]:
        """Kind, parameter, what else is printed, and label of every special point, in order. IRS: the label of the
        last run at which to begin."""
        told = {"NDIM": self.n, "ICP": [1], "ISP": 2, "ILP": 1, "NTST": 50, "NCOL": 4, "IAD": 3, "ISW": 1, "NMX": 400,
                "NPR": 0, "EPSL": 1e-10, "EPSU": 1e-10, "EPSS": 1e-8, "ITMX": 9, "DS": 0.01, "DSMIN": 1e-6,
                "DSMAX": 0.1, "IPS": 1, "IRS": 0} | constants  # fmt: skip
        (self.folder / "fort.2").write_text("".join(f"{k} = {v}\n" for k, v in told.items()))
        if told["IRS"]:
            (self.folder / "fort.8").rename(self.folder / "fort.3")
        done = subprocess.run(["./eq"], cwd=self.folder, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0 and "fort.7" in {p.name for p in self.folder.iterdir()}, done.stdout + done.stderr
        rows = [line.split() for line in (self.folder / "fort.7").read_text().splitlines()]
        labelled = [row for row in rows if row[0] != "0" and row[3] != "0"]
        return [(KINDS.get(row[2], row[2]), float(row[4]), [*map(float, row[5:])], int(row[3])) for row in labelled]


def only(found: list, kind: str, near: float) -> tuple:
    """The point of a kind nearest to a value."""
    return min((one for one in found if one[0] == kind), key=lambda one: abs(one[1] - near))


def test_brusselator(tmp_path: Path) -> None:
    """Hopf point, and the period at p = 2.5, to 1e-6."""
    rate = "double x = u[0], y = u[1], p = par[0]; f[0] = 1 - (p + 1) * x + x * x * y; f[1] = p * x - x * x * y;"
    auto = Auto(tmp_path, 2, rate, "par[0] = 1.5; u[0] = 1; u[1] = 1.5;")
    _, p, _, label = only(auto.run(RL0=1.4, RL1=4.0), "Hopf", 2.0)
    orbits = auto.run(IPS=2, ICP=[1, 11], IRS=label, RL0=1.4, RL1=2.51, UZR="{1: [2.5]}", DSMAX=1.0)
    *_, period = only(orbits, "target", 2.5)[2]
    found = diagram(brusselator(), np.array([1.0, 1.5]), DiagramPlan(1.5, 2.5, nodes=16, doublings=0, step=0.2))
    assert found.hopf[0].p == pytest.approx(p, rel=1e-6)
    assert found.branches[1].parameter[-1] == 2.5 and found.branches[1].period[-1] == pytest.approx(period, rel=1e-6)


MASSES = """
    double p = par[0], B = p, v = 1.0, D = 0.1, w1 = u[1] - v, w2 = u[3] - v, at = 0.14 * (1 + 1.14 * exp(-2 * v)) *
        atan(-100 * v), m1 = at - 0.14 * (1 + 1.14 * exp(-2 * fabs(w1))) * atan(100 * w1),
        m2 = at - 0.14 * (1 + 1.14 * exp(-2 * fabs(w2))) * atan(100 * w2);
    f[0] = u[1]; f[1] = (-3 * u[0] - 4 * D * u[1] + u[2] + 2 * D * u[3] + B * m1) / 2.5;
    f[2] = u[3]; f[3] = u[0] + 2 * D * u[1] - u[2] - 2 * D * u[3] + B * m2;"""


@pytest.mark.slow
def test_two_masses_on_a_belt(tmp_path: Path) -> None:
    """Both Hopf points, the fold of the first branch, its period at B = 3 m and its first period doubling, to 1e-6:
    the friction law is sharp, so that AUTO takes 200 intervals."""
    auto = Auto(tmp_path, 4, MASSES, "par[0] = 0.5; u[0] = u[1] = u[2] = u[3] = 0;")
    still = auto.run(RL0=0.4, RL1=8.0, DSMAX=0.2)
    hopf = [only(still, "Hopf", near) for near in (1.2, 7.1)]
    settings = {"IPS": 2, "ICP": [1, 11], "NTST": 200, "RL0": 0.4, "RL1": 8.3, "DSMAX": 0.5, "NMX": 500}
    orbits = auto.run(**settings, IRS=hopf[0][3], DS=-0.01, UZR="{1: [3.0]}")
    found = diagram(belt(0.5, 8.3), np.zeros(4), DiagramPlan(0.5, 8.3, doublings=0))
    assert [h.p for h in found.hopf] == pytest.approx([h[1] for h in hopf], rel=1e-6)
    branch = found["orbits 1"]
    assert branch.parameter[branch.of_kind("fold")[0]] == pytest.approx(only(orbits, "fold", 0.9)[1], rel=1e-6)
    (i,) = branch.of_kind("period doubling")
    doubling = only(orbits, "period doubling", 8.1)
    assert branch.parameter[i] == pytest.approx(doubling[1], rel=1e-6)
    assert branch.period[i] == pytest.approx(doubling[2][-1], rel=1e-6)
    at = int(np.argmin(np.abs(branch.parameter - 3.0) + 9 * ~branch.stable))
    one = branch.orbit(found.system, at)
    problem = Shooting(found.system, one, one.period)
    exact = newton(problem, problem.unknowns(one), 3.0)
    assert exact.converged and exact.x[-1] == pytest.approx(only(orbits, "target", 3.0)[2][-1], rel=1e-6)

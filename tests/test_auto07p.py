"""AUTO-07p, a process of its own: Hopf points, folds, period doublings and periods that ours are compared with.

It solves for periodic orbits by collocation on an adapted mesh, where we shoot.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

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

    def run(self, **constants: object) -> list[tuple[str, float, list[float]]]:
        """Kind, parameter, and what else is printed of every special point, in order; `restart` as the last run
        left it where IRS is given."""
        told = {"NDIM": self.n, "ICP": [1], "ISP": 2, "ILP": 1, "NTST": 50, "NCOL": 4, "IAD": 3, "ISW": 1, "NMX": 400,
                "NPR": 0, "EPSL": 1e-10, "EPSU": 1e-10, "EPSS": 1e-8, "ITMX": 9, "DS": 0.01, "DSMIN": 1e-6,
                "DSMAX": 0.1, "IPS": 1, "IRS": 0} | constants  # fmt: skip
        (self.folder / "fort.2").write_text("".join(f"{k} = {v}\n" for k, v in told.items()))
        if told["IRS"]:
            (self.folder / "fort.8").rename(self.folder / "fort.3")
        done = subprocess.run(["./eq"], cwd=self.folder, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0 and "fort.7" in {p.name for p in self.folder.iterdir()}, done.stdout + done.stderr
        rows = [line.split() for line in (self.folder / "fort.7").read_text().splitlines() if not line.startswith("   0")]
        labelled = [row for row in rows if row[3] != "0"]
        return [(KINDS.get(row[2], row[2]), float(row[4]), [*map(float, row[5:]), float(row[3])]) for row in labelled]

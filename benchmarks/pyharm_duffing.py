"""Run by pyHarm's own interpreter: the frequency response of a Duffing oscillator.

    python pyharm_duffing.py job.json out.npz

The same analysis runs once before (compilation), then `rounds` times; the points of the last run come back as
coefficients in the order constant, cosines, sines.
"""

import json
import sys
import time

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from pyHarm.Maestro import Maestro  # noqa: E402

job = json.load(open(sys.argv[1]))
one = np.ones((1, 1))


def maestro() -> Maestro:
    body = {"ndofs": 1, "nmodes": 0, "matrix": {"M": one, "C": job["damping"] * one, "K": one, "G": 0 * one}}
    connectors = {
        "force": {"type": "CosinusForcing", "connect": {"body": [0]}, "dirs": [0], "amp": job["force"]},
        "cubic": {"type": "CubicSpring", "connect": {"body": [0]}, "dirs": [0], "k": job["cubic"]},
    }
    analysis = {
        "study": "frf", "puls_inf": job["low"], "puls_sup": job["high"], "sign_ds": 1, "verbose": False,
        "ds0": job["step"], "ds_max": job["step_max"], "ds_min": 1e-6, "solver": job["solver"],
    }  # fmt: skip
    if job["solver"] == "NewtonRaphson":
        analysis["solver_options"] = {"tol_residual": 1e-9, "tol_delta_x": 1e-8}
    return Maestro(
        {
            "analysis": {"frf": analysis},
            "system": {"type": "Base", "nh": job["harmonics"], "nti": job["samples"], "adim": {"status": False}},
            "substructures": {"body": body},
            "connectors": connectors,
        }
    )


wall, cpu = [], []
for _ in range(1 + job["rounds"]):
    run = maestro()
    started = time.perf_counter(), time.process_time()
    run.operate()
    wall.append(time.perf_counter() - started[0])
    cpu.append(time.process_time() - started[1])
found = [s for s in run.nls["frf"].SolList if s.flag_accepted]
dofs = run.system.expl_dofs
order = [dofs[(dofs["harm"] == 0)].index[0]]
for part in "cs":
    chosen = dofs[(dofs["harm"] > 0) & (dofs["cs"] == part)].sort_values("harm")
    order += list(chosen.index)
np.savez(
    sys.argv[2], x=np.array([s.x[order] for s in found]), omega=np.array([s.x[-1] for s in found]), wall=wall[1:],
    cpu=cpu[1:], tried=len(run.nls["frf"].SolList),
)  # fmt: skip

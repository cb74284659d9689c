"""Run by pyHarm's own interpreter: the frequency response of a linear body with one element to the ground.

    python pyharm_structure.py job.npz out.npz

job: M, C, K of one node with as many directions, the direction of the force and that of the element. The same analysis
runs once before (compilation, which numba keeps), then `rounds` times; the points of the last run come back as
coefficients of the element's displacement: constant, cosine, sine, cosine of the second harmonic, ...
"""

import sys
import time

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from pyHarm.Maestro import Maestro  # noqa: E402

job = dict(np.load(sys.argv[1]))
n, tip = len(job["M"]), int(job["at"])
at = {"connect": {"body": [0]}}
ELEMENTS = {
    "jenkins": {"type": "Jenkins", "k": float(job["stiffness"]), "mu": 1.0, "N0": float(job["limit"])},
    "cubic": {"type": "CubicSpring", "k": float(job["stiffness"])},
}


def maestro() -> Maestro:
    matrix = {"M": job["M"], "C": job["C"], "K": job["K"], "G": np.zeros((n, n))}
    connectors = {
        "force": {"type": "CosinusForcing", **at, "dirs": [tip], "amp": float(job["force"])},
        "element": {**ELEMENTS[str(job["element"])], **at, "dirs": [tip]},
    }
    analysis = {
        "study": "frf", "puls_inf": float(job["low"]), "puls_sup": float(job["high"]), "sign_ds": 1, "verbose": False,
        "ds0": float(job["step"]), "ds_max": float(job["step_max"]), "ds_min": 1e-8, "solver": str(job["solver"]),
        "reductors": [{"type": str(job["reductor"])}],
    }  # fmt: skip
    if str(job["solver"]) == "NewtonRaphson":
        analysis["solver_options"] = {"tol_residual": 1e-9, "tol_delta_x": 1e-8}
    size = {"nh": int(job["harmonics"]), "nti": int(job["samples"])}
    return Maestro(
        {
            "analysis": {"frf": analysis},
            "system": {"type": "Base", **size, "adim": {"status": False}},
            "substructures": {"body": {"ndofs": n, "nmodes": 0, "matrix": matrix}},
            "connectors": connectors,
        }
    )


wall, cpu = [], []
for _ in range(1 + int(job["rounds"])):
    run = maestro()
    started = time.perf_counter(), time.process_time()
    run.operate()
    wall.append(time.perf_counter() - started[0])
    cpu.append(time.process_time() - started[1])
found = [s for s in run.nls["frf"].SolList if s.flag_accepted]
dofs = run.system.expl_dofs
mine = dofs[dofs["dof_num"] == tip]
order = [mine[mine["harm"] == 0].index[0]]
for h in range(1, int(job["harmonics"]) + 1):
    order += [mine[(mine["harm"] == h) & (mine["cs"] == part)].index[0] for part in "cs"]
np.savez(
    sys.argv[2], x=np.array([s.x[order] for s in found]), omega=np.array([s.x[-1] for s in found]), wall=wall[1:],
    cpu=cpu[1:],
)  # fmt: skip

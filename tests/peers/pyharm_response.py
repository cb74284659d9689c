"""Run by pyHarm's own interpreter: forced response of an exported body, one harmonic, one Jenkins element.

    python pyharm_response.py body_pyharm.mat job.json out.npz

job: force (N) on coordinate 0 of node 0, and if `stiffness` (N/m) is not 0 a Jenkins element of `limit` N between
coordinate `direction` of node 1 and the ground; angular frequencies from `low` to `high`, rad/s.
"""

import json
import sys

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from pyHarm.Maestro import Maestro  # noqa: E402
from scipy.io import loadmat  # noqa: E402

file, job, out = sys.argv[1], json.load(open(sys.argv[2])), sys.argv[3]
sizes = loadmat(file, squeeze_me=True)
body = {"filename": file, "ndofs": int(sizes["ndofs"]), "nmodes": int(sizes["nmodes"])}
connectors = {"force": {"type": "CosinusForcing", "connect": {"body": [0]}, "dirs": [0], "amp": job["force"]}}
if job["stiffness"]:
    connectors["friction"] = {
        "type": "Jenkins", "connect": {"body": [1]}, "dirs": [job["direction"]],
        "k": job["stiffness"], "mu": 1.0, "N0": job["limit"],
    }  # fmt: skip
step = (job["high"] - job["low"]) / 12
analysis = {
    "study": "frf", "puls_inf": job["low"], "puls_sup": job["high"], "ds0": step, "ds_max": step, "ds_min": step * 1e-6,
    "sign_ds": 1, "verbose": False, "solver": "NewtonRaphson",
    "solver_options": {"tol_residual": 1e-10 * job["force"], "tol_delta_x": 1e-8},
}  # fmt: skip
maestro = Maestro(
    {
        "analysis": {"frf": analysis},
        "system": {"type": "Base", "nh": 1, "nti": job["samples"], "adim": {"status": False}},
        "substructures": {"body": body},
        "connectors": connectors,
    }
)
maestro.operate()
found = [s for s in maestro.nls["frf"].SolList if s.flag_accepted]
dofs = maestro.system.expl_dofs
pick = {cs: dofs[(dofs["harm"] == 1) & (dofs["cs"] == cs)].index.to_numpy() for cs in "cs"}
x = np.array([s.x[pick["c"]] - 1j * s.x[pick["s"]] for s in found])  # Re(x exp(i w t))
np.savez(out, omega=np.array([s.x[-1] for s in found]), x=x)

"""Run by pyHarm's own interpreter: the frequency response of a whole ring, Jenkins elements among its blades.

    python pyharm_ring.py job.npz out.npz

job: M, C, K of the linear ring in coordinates of which the first `contacts` are the motions of its sliders, one an
element to the ground, and the next two those that a cosine and a sine of 1 N act on; the rest stand among the modal
ones; output: (w, m) read-outs in them. The same analysis runs once over a hundredth of the band (compilation, which
numba keeps), then over all of it, then in steps of a quarter from the point below the highest to the one above it.
"""

import sys
import time

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from pyHarm.Maestro import Maestro  # noqa: E402

job = dict(np.load(sys.argv[1]))
n, contacts = len(job["M"]), int(job["contacts"])


def maestro(low: float, high: float, step: float) -> Maestro:
    """rad/s."""
    slider = {"type": "Jenkins", "k": float(job["stiffness"]), "mu": 1.0, "N0": float(job["limit"]), "dirs": [0]}
    connectors = {f"slider_{i}": {**slider, "connect": {"ring": [i]}} for i in range(contacts)}
    for i in (0, 1):
        turned = {"dto": 0, "ho": 1, "phi": i * np.pi / 2, "amp": 1.0, "dirs": [0]}
        connectors[f"force_{i}"] = {"type": "GOForcing", **turned, "connect": {"ring": [contacts + i]}}
    matrix = {"M": job["M"], "C": job["C"], "K": job["K"], "G": np.zeros((n, n))}
    analysis = {
        "study": "frf", "puls_inf": low, "puls_sup": high, "sign_ds": 1, "verbose": False,
        "ds0": step, "ds_max": step, "ds_min": 1e-4 * step, "solver": "NewtonRaphson",
        "solver_options": {"tol_residual": 1e-6, "tol_delta_x": 1e-6, "max_iter": 30},
    }  # fmt: skip
    size = {"nh": int(job["harmonics"]), "nti": int(job["samples"])}
    body = {"ndofs": 1, "nmodes": n - contacts - 2, "nnodes": contacts + 2, "matrix": matrix}
    return Maestro(
        {
            "analysis": {"frf": analysis},
            "system": {"type": "Base", **size, "adim": {"status": False}},
            "substructures": {"ring": body},
            "connectors": connectors,
        }
    )


def answer(low: float, high: float, step: float) -> tuple[float, np.ndarray, np.ndarray, int]:
    """CPU seconds, rad/s of the points, (p, m) their first harmonics, Re(x exp(i w t)), and all steps."""
    run = maestro(low, high, step)
    started = time.process_time()
    run.operate()
    cpu = time.process_time() - started
    solved = run.nls["frf"].SolList
    found = [s for s in solved if s.flag_accepted]
    dofs = run.system.expl_dofs
    first = {cs: dofs[(dofs["harm"] == 1) & (dofs["cs"] == cs)].index.to_numpy() for cs in "cs"}
    x = np.array([s.x[first["c"]] - 1j * s.x[first["s"]] for s in found])
    return cpu, np.array([s.x[-1] for s in found]), x, sum(s.iter_numb for s in solved)


low, high, step = float(job["low"]), float(job["high"]), float(job["step"])
answer(low, low + 0.01 * (high - low), step)
coarse = answer(low, high, step)
top = coarse[1][np.abs(coarse[2] @ job["output"].T).max(axis=1).argmax()]
fine = answer(max(top - step, low), min(top + step, high), step / 4)
cpu, omega, x, steps = (
    np.hstack([a, b]) if np.ndim(a) < 2 else np.vstack([a, b]) for a, b in zip(coarse, fine, strict=True)
)
np.savez(sys.argv[2], x=x, omega=omega, cpu=cpu, steps=steps, coarse=len(coarse[1]))

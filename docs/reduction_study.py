"""Reduction methods measured: bodies on springs from soft to stiff, what they cost, the force in a sticking contact."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse.linalg as spla

from microslip.data import Array, Mesh, ModalGroup
from microslip.modal.compute import modal_basis
from microslip.settings.body import BodySettings
from microslip.stages.job import open_job
from microslip.stages.meshing import load_mesh, mesh_stage

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests"))  # the full model on springs, and the bar, are the tests' own
from meshes import STEEL, body, brick  # noqa: E402
from sprung import full_frequencies, full_model, patch_statics, reduced_frequencies  # noqa: E402

METHODS = ("eigenmodes", "macneal", "rubin", "craig-bampton", "dual-craig-bampton", "massless-boundary")
RATIOS = (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4)
LIGHT = ("output.gauss=false", "output.nodal_stress=false")
LOSS = 0.002  # hysteretic loss factor of the steel in the force response: D = 0.1 %


@dataclass(frozen=True)
class Study:
    """One body, each way of reducing it, and the seconds that took."""

    mesh: Mesh
    settings: BodySettings
    groups: dict[str, ModalGroup]
    seconds: dict[str, float]


def bar() -> tuple[Mesh, BodySettings]:
    """A steel bar on rollers, 1 m x 40 mm x 40 mm, nu = 0, held at one end, a patch on the other."""
    rollers = [{"face": "x0"}, {"face": "y0", "directions": "y"}, {"face": "z0", "directions": "z"}]
    tip = {"name": "tip", "face": "x1", "t2": [0.0, 0.0, 1.0]}
    settings = body({**STEEL, "poisson": 0.0}, supports=rollers, interfaces=[tip], modes={"count": 5})
    return brick("hexahedron20", (16, 1, 1), (1.0, 0.04, 0.04)), settings


def drawn_body(name: str, build: Path, *changes: str) -> tuple[Mesh, BodySettings]:
    """The mesh and the settings of a body of geometry/."""
    job = open_job(ROOT / "geometry" / name, [f'name="{name}-reduction"', *LIGHT, *changes], build)
    return load_mesh(job, mesh_stage(job))[0], job.settings


def studied(mesh: Mesh, settings: BodySettings) -> Study:
    groups, seconds = {}, {}
    modal_basis(mesh, settings)  # what is loaded at the first call is nobody's cost
    for method in METHODS:
        began = time.process_time()
        groups[method] = modal_basis(mesh, settings.model_copy(update={"reduction": method})).groups[0, 0]
        seconds[method] = time.process_time() - began
    return Study(mesh, settings, groups, seconds)


def soft_to_stiff(s: Study, count: int) -> tuple[Array, Array]:
    """(springs,) first frequency of the full model, Hz, and (springs, methods) error of the `count` lowest ones."""
    exact = np.array(full_frequencies(s.mesh, s.settings, patch_statics(s.groups["rubin"]), RATIOS, count))
    found = [[reduced_frequencies(s.groups[m], m, ratio, count) for m in METHODS] for ratio in RATIOS]
    return exact[:, 0] / 2 / np.pi, np.abs(np.array(found) / exact[:, None] - 1).max(axis=2)


def error_rows(exact: Array, errors: Array) -> list[list[str]]:
    """Rows of a table: spring, first frequency of the full model, error of every method."""
    return [
        [f"{ratio:g}", f"{f:.2f} Hz", *(f"{e:.0e}" for e in row)]
        for ratio, f, row in zip(RATIOS, exact, errors, strict=True)
    ]


def cost_rows(s: Study) -> list[list[str]]:
    """Coordinates, unknowns of the solver, seconds and the spectrum with every contact stuck, by method."""
    rows = []
    base = s.seconds["eigenmodes"]
    for m in METHODS:
        g = s.groups[m]
        stuck = ", ".join(f"{100 * g.checks[k]:.1g} %" for k in ("stuck_error_1", "stuck_error_2", "stuck_error_3")
                          if k in g.checks)  # fmt: skip
        rows.append([f"`{m}`", str(g.n_modes), f"{s.seconds[m] / base:.2f}", stuck or "no motion left"])
    return rows


# the force in a sticking contact -----------------------------------------------------------------------------------


def reduced_force(g: ModalGroup, k: Array, frequency: Array) -> Array:
    """(f,) complex normal force (N) in the first contact per newton at the magnet, Rubin or eigenmodes.

    Args:
        k: six springs for each contact, N/m and N m/rad. frequency: Hz.
    """
    T = np.vstack([i.rows for i in g.interfaces.values() if i.role != "load"])
    load = g.excitations["magnet"].rows[0]
    K = g.K_r * (1 + 1j * LOSS) + T.T @ (k[:, None] * T)
    out = [T[0] @ np.linalg.solve(K - (2 * np.pi * f) ** 2 * g.M_r, load) for f in frequency]
    return k[0] * np.array(out)


def full_force(mesh: Mesh, settings: BodySettings, k: Array, frequency: Array) -> Array:
    """The same of the full model: a complex factorisation at every frequency, springs by Woodbury."""
    import scipy.sparse as sp

    from microslip.modal.body_rows import body_rows

    model, pencil = full_model(mesh, settings)
    rows, dofs = body_rows(mesh, settings), model.free.free
    B = sp.vstack([rows.patches[i.name].B[:, dofs] for i in settings.interfaces]).tocsr()
    F = sp.vstack([B, rows.excitations["magnet"].B[:, dofs]]).T.toarray()
    high = pencil.k_norm / pencil.m_norm
    upper = pencil.shifted(0.0)
    mass = (upper - pencil.shifted(high)) / high
    K, M = (a + sp.triu(a, 1).T for a in (upper, mass))
    out = []
    for f in frequency:
        A = (K * (1 + 1j * LOSS) - (2 * np.pi * f) ** 2 * M).tocsc()
        lu = spla.splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        H = B @ lu.solve(F.astype(complex))
        u = np.linalg.solve(np.eye(len(k)) + H[:, :-1] * k, H[:, -1])
        out.append(k[0] * u[0])
    pencil.solver.close()
    return np.array(out)

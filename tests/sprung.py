"""Bodies whose patches stand on springs to the ground: the full model and every reduction of it.

Every translation row of every contact patch gets a spring of its own, `ratio` times the row's static stiffness
1 / C_ii, so that one number runs from open contacts to bonded ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from microslip.data import Array, Mesh, ModalGroup
from microslip.fem.discretise import discretise, free_upper
from microslip.linalg import eigen
from microslip.modal import rigid
from microslip.modal.body_rows import body_rows
from microslip.modal.boundary import fixed_dofs
from microslip.modal.equilibrium import BodyModel, make_model
from microslip.modal.prepared import inertia_of
from microslip.modal.spectrum import make_pencil, rigid_shift
from microslip.settings.body import BodySettings


class Sprung(eigen.DirectSolver):
    """A + B^T k B from a direct solver of A, by Woodbury's identity."""

    name = "sprung"

    def __init__(self, inner: eigen.DirectSolver, B: sp.csr_matrix, k: Array) -> None:
        self.inner, self.B, self.k = inner, B, k

    def factorise(self, upper: sp.csr_matrix) -> None:
        self.inner.factorise(upper)
        self.answers = self.inner.solve(self.B.T.toarray())
        self.flexibility = np.asarray(self.B @ self.answers)

    def solve(self, b: Array) -> Array:
        x = self.inner.solve(b)
        return x - self.answers @ np.linalg.solve(np.diag(1 / self.k) + self.flexibility, self.B @ x)

    def negative(self) -> int:
        """n(A) + n(-1/k - B A^-1 B^T) - rows (Haynsworth, the springs' forces as further unknowns)."""
        schur = -(np.diag(1 / self.k) + 0.5 * (self.flexibility + self.flexibility.T))
        return self.inner.negative() + int((np.linalg.eigvalsh(schur) < 0).sum()) - len(self.k)


def full_model(mesh: Mesh, settings: BodySettings) -> tuple[BodyModel, eigen.Pencil]:
    """The body at rest: its model and its pencil."""
    d, fixed = discretise(mesh), fixed_dofs(mesh, settings)
    model = make_model(
        d, settings.material.material(), free_upper(d.pattern, fixed), fixed, np.array(settings.rotation.axis),
        np.zeros(3), None, 293.15, np.zeros((mesh.n_points, 3)), True,
    )  # fmt: skip
    return model, make_pencil(model, model.K0, eigen.new_solver(settings.modes.solver))


def translation_rows(mesh: Mesh, settings: BodySettings, dofs: Array) -> sp.csr_matrix:
    """u_n, u_t1, u_t2 of every patch in the order of the settings, on the free degrees of freedom."""
    patches = body_rows(mesh, settings).patches
    return sp.vstack([patches[i.name].B[:3, dofs] for i in settings.interfaces]).tocsr()


def full_frequencies(
    mesh: Mesh, settings: BodySettings, static: Array, ratios: tuple[float, ...], count: int
) -> Array:  # fmt: skip
    """(len(ratios), count) lowest elastic angular frequencies of the full model, certified.

    Args:
        static: (3 a patch,) static compliance of the translation rows.
    """
    model, pencil = full_model(mesh, settings)
    B = translation_rows(mesh, settings, model.free.free)
    mass, centre, _ = inertia_of(model.d, [m.density for m in model.materials])
    free = rigid.free_motions(mesh.points, centre, fixed_dofs(mesh, settings)).shape[1]
    shift = rigid_shift(model) if free else 0.0
    found = []
    for ratio in ratios:
        k = ratio / static

        def stiff(x: Array, k: Array = k) -> Array:
            return pencil.K(x) + B.T @ ((B @ x).T * k).T

        held = replace(pencil, K=stiff, solver=Sprung(pencil.solver, B, k), solves=0)
        spectrum = eigen.certify(held, eigen.search(held, count, shift), shift)
        found.append(np.sqrt(spectrum.values[:count]))
    pencil.solver.close()
    return np.array(found)


def patch_statics(g: ModalGroup) -> Array:
    """(3 a patch,) static compliance of the translation rows."""
    names = [f"interface:{n}:{row}" for n, i in g.interfaces.items() if i.role != "load" for row in ROWS]
    return np.array([g.compliance.static[g.compliance.labels.index(n), g.compliance.labels.index(n)] for n in names])


ROWS = ("u_n", "u_t1", "u_t2")


def reduced_frequencies(g: ModalGroup, reduction: str, ratio: float, count: int) -> Array:
    """(count,) lowest angular frequencies of a reduced body on its springs, rad/s."""
    named = [n for n, i in g.interfaces.items() if i.role != "load"]
    T = np.vstack([g.interfaces[n].rows[:3] for n in named])
    compliance = np.diag(patch_statics(g) / ratio)
    if "interface-force" in g.kind:
        forces = [g.compliance.labels.index(f"interface:{n}:{row}") for n in named for row in ROWS]
        keep = np.r_[forces, np.flatnonzero(np.array(g.kind) != "interface-force")]
        K, M = g.K_r[np.ix_(keep, keep)].copy(), g.M_r[np.ix_(keep, keep)]
        K[: len(forces), : len(forces)] -= compliance
        values = scipy.linalg.eigh(K, M, eigvals_only=True)
        return np.sqrt(values[values > 0][:count])  # the negative ones belong to the forces
    if reduction == "macneal":
        at = [g.compliance.labels.index(f"interface:{n}:{row}") for n in named for row in ROWS]
        compliance = compliance + g.compliance.residual[np.ix_(at, at)]
    K = g.K_r + T.T @ np.linalg.solve(compliance, T)
    scale = 1 / np.sqrt(np.diag(K))
    values = scipy.linalg.eigh(g.M_r * np.outer(scale, scale), K * np.outer(scale, scale), eigvals_only=True)
    return 1 / np.sqrt(values[::-1][:count])

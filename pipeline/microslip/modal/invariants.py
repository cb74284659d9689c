"""Inertia shape integrals of a body in large rigid motion, and how the inertia forces of that motion stiffen it.

Sextro Eqs. (2.3-21) to (2.3-27) hold these integrals; they are the inertia shape integrals of Shabana, Dynamics of
Multibody Systems, 5.3 (S-bar, I-bar_kl, S-bar_kl), and the terms of Wallrapp's Standard Input Data (1994) are sums
of them. Stiffening: Wallrapp and Schwertassek, Int. J. Numer. Methods Eng. 32 (1991).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Array, Invariants, ModalGroup, RunUp
from ..errors import NotConverged
from ..fem.operators import displacement_gradient, green_strain, spin_projector, stress_stiffness
from ..frames import skew
from ..linalg.direct import DirectSolver
from . import rigid
from .equilibrium import BodyModel, StaticState, stress_of
from .spectrum import make_pencil, rigid_shift


def inertia_invariants(model: BodyModel, state: StaticState, shapes: Array, Mshapes: Array) -> Invariants:
    """The integrals about the rotation point in body axes, with the mass matrix of the finite elements.

    Args:
        shapes, Mshapes: (n, 3, m) phi and M phi.
    """
    r = model.d.mesh.points + state.u - model.point
    Mr = model.M_full @ r
    m = shapes.shape[2]
    both = np.empty((3, 3, m, m), dtype=shapes.dtype)
    for a in range(3):
        for b in range(3):
            both[a, b] = shapes[:, a].conj().T @ Mshapes[:, b]
    return Invariants(
        model.point, float(model.M_full.sum()), Mr.sum(axis=0), r.T @ Mr, Mshapes.sum(axis=0),
        np.einsum("na,nbm->abm", r, Mshapes, optimize=True), both, np.zeros((0, m, m)),
    )  # fmt: skip


def run_up_terms(model: BodyModel, state: StaticState, shapes: Array, Mshapes: Array, harmonic: int = 0) -> RunUp:
    """Circulatory and softening matrices, Euler and centrifugal load per unit, on the given shapes: what a change of
    the rotation speed does to a reduced body (Sextro Eqs. (2.1-14) to (2.1-18), (2.3-19)).

    Args:
        shapes, Mshapes: (n, 3, m) phi and M phi, real or complex. harmonic: nodal diameter of the shapes; the loads
            turn with the sectors, so only 0 feels them.
    """
    left = shapes.conj()
    N = np.einsum("nia,ij,njb->ab", left, skew(model.axis), Mshapes, optimize=True)
    P = np.einsum("nia,ij,njb->ab", left, spin_projector(model.axis), Mshapes, optimize=True)
    r = model.d.mesh.points + state.u - model.point
    euler = -np.einsum("nia,ni->a", Mshapes.conj(), np.cross(model.axis, r))
    centrifugal = np.einsum("nia,ni->a", Mshapes.conj(), r @ spin_projector(model.axis))
    if harmonic:
        euler, centrifugal = 0 * euler, 0 * centrifugal
    return RunUp(0.5 * (N - N.conj().T), 0.5 * (P + P.conj().T), euler, centrifugal)


def inertia_forces(model: BodyModel) -> Array:
    """(12, n, 3) inertia forces of unit rigid motions about the rotation point, N, in the order of `data.MOTIONS`."""
    r = model.d.mesh.points - model.point
    fields = []
    for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)):
        pull = np.zeros_like(r)
        if a == b:
            pull -= r
            pull[:, a] += r[:, a]
        else:
            pull[:, a], pull[:, b] = r[:, b], r[:, a]
        fields.append(pull)
    fields += [np.tile(np.eye(3)[a], (len(r), 1)) for a in range(3)]
    fields += [np.cross(np.eye(3)[a], r) for a in range(3)]
    return np.array([-(model.M_full @ f) for f in fields])


def stiffening_operators(model: BodyModel, solver: DirectSolver, motions: Array) -> list[Array]:
    """For each of `data.MOTIONS` the (p,) geometric stiffness that its inertia force makes, over the pattern.

    The linear answer of the unstressed body (of a free body: its elastic part), its stress, K_sigma of that stress
    (Bathe 6.2.3).

    Args:
        motions: (3n, r) rigid motions that the supports leave, see `rigid.free_motions`.

    Raises:
        NotConverged: the answer of a free body.
    """
    answers = _answers(model, solver, motions, inertia_forces(model).reshape(12, -1).T)
    out = []
    for u in answers.T:
        H = [displacement_gradient(b, u.reshape(-1, 3)) for b in model.d.blocks]
        out.append(stress_stiffness(model.d, stress_of(_cold(model), [green_strain(h, nonlinear=False) for h in H])))
    return out


def _cold(model: BodyModel) -> BodyModel:
    return replace(model, thermal_strain=None)


def _answers(model: BodyModel, solver: DirectSolver, motions: Array, forces: Array) -> Array:
    """(3n, r) displacements under forces (3n, r), inertia relief where rigid motions are left."""
    pencil = make_pencil(model, model.K0, solver)
    rest = model.free.restrict(forces)
    n = model.d.mesh.n_points
    if not motions.shape[1]:
        solver.factorise(pencil.shifted(0.0))
        return model.free.expand(solver.solve(rest), n)
    R = rigid.mass_orthonormal(model.free.unknowns_of(motions), pencil.M)
    MR, shift = pencil.M(R), rigid_shift(model)
    solver.factorise(pencil.shifted(shift))
    rest = rest - MR @ (R.T @ rest)
    u = np.zeros_like(rest)
    for _ in range(400):  # K s = rest + shift M s: what a step leaves is answered by the next
        step = solver.solve(rest)
        step -= R @ (MR.T @ step)
        u += step
        if np.abs(step).max() < 1e-10 * np.abs(u).max():
            return model.free.expand(u, n)
        rest = -shift * pencil.M(step)
        rest -= MR @ (R.T @ rest)
    raise NotConverged("output.stiffening: the free body's static answer was not found; refine or hold the body")


def with_stiffening(g: ModalGroup, model: BodyModel, operators: list[Array]) -> ModalGroup:
    """The group with the operators of `stiffening_operators` on its shapes."""
    if g.invariants is None:
        return g
    n, m = len(g.phi), g.phi.shape[2]
    flat = g.phi.reshape(n, 3 * m)
    reduced = []
    for values in operators:
        Kphi = (model.d.pattern.full(values) @ flat).reshape(3 * n, m)
        K = g.phi.reshape(3 * n, m).conj().T @ Kphi
        reduced.append(0.5 * (K + K.conj().T))
    return replace(g, invariants=replace(g.invariants, stiffening=np.array(reduced)))

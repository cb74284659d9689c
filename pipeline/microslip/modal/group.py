"""One modal group: the spectrum of a state, reduced, with its rows, stresses, damping and checks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..data import Array, Compliance, GyroscopicModes, ModalGroup, Residual, RunUp, StressSet
from ..linalg import eigen
from ..linalg.gyroscopic import Certified, gyroscopic_modes
from ..reduced.coordinates import own_stiffness
from ..reduction import Reduced
from ..settings.body import BodySettings
from .body_rows import BodyRows, reduced_gauge, reduced_interfaces, reduced_rows
from .closures import contact_states
from .equilibrium import BodyModel, StaticState
from .invariants import inertia_invariants, run_up_terms
from .prepared import Prepared
from .solution import Solution, held_compliance
from .stress import gauss_set, nodal_set


def assemble_group(b: Prepared, state: StaticState, s: Solution, harmonic: int) -> ModalGroup:
    """Everything the modal file holds of one state and nodal diameter."""
    model, settings, speed, rows = b.model, b.settings, state.speed, b.rows
    reduced, n = s.reduced, model.d.mesh.n_points
    phi = s.unknowns.expand(reduced.vectors, n)
    shapes = phi.reshape(n, 3, -1)
    ratios = settings.damping.ratios(reduced.omega)
    C = modal_damping(reduced, 2 * ratios * reduced.omega)
    if model.dashpots is not None:
        C_d = phi.conj().T @ (model.d.pattern.full(model.dashpots) @ phi)
        C = C + 0.5 * (C_d + C_d.conj().T)
        ratios = ratios_of(C, reduced)
    Mphi = (model.M_full @ phi.reshape(n, -1)).reshape(shapes.shape)
    run_up = without_massless(run_up_terms(model, state, shapes, Mphi, harmonic), reduced)
    if (settings.output.gauss or settings.output.nodal_stress) and settings.output.stress_at(harmonic):
        b.report("strain and stress modes")
    group = ModalGroup(
        **of_solution(rows, s, phi, n, state.u.reshape(-1)),
        speed=speed,
        damping_ratio=ratios,
        C_r=C,
        G_r=2 * speed * run_up.N,
        run_up=run_up,
        gyroscopic=_gyroscopic(settings, speed, reduced, run_up, s.found, s.kept),
        invariants=None if settings.cyclic else inertia_invariants(model, state, shapes, Mphi),
        gauges={k: reduced_gauge(v, phi, state) for k, v in rows.gauges.items()},
        stresses=_stress_sets(b, state, shapes, harmonic),
        u_static=state.u,
        checks={**checks_of(s), **_checks(model, state), **s.indicators},
        prestress=state.prestress if (speed or model.loaded) else "none",
        harmonic=harmonic,
        spin_softening=model.spin_softening,
        contacts=contact_states(model.d.mesh, settings, state.contacts),
        residual=_residual(b, state, s, harmonic),
    )
    return group if settings.output.shapes_at(harmonic) else _without_shapes(group)


def _without_shapes(group: ModalGroup) -> ModalGroup:
    """The group without displacements of the mesh and of the points of its patches."""
    faces = {name: replace(face, shapes=face.shapes[:0]) for name, face in group.interfaces.items()}
    residual = group.residual
    if residual is not None:
        residual = replace(residual, phi=residual.phi[:0])
    return replace(group, phi=group.phi[:0], interfaces=faces, residual=residual)


def of_solution(rows: BodyRows, s: Solution, whole: Array, n: int, u: Array | None = None) -> dict[str, Any]:
    """Fields of a group that its solution and the rows tell.

    Args:
        whole: (3 r, c) shapes of all triples of rows, those of the n points first. u: (3 n,) static displacements, m.
    """
    reduced = s.reduced
    shapes = whole.reshape(len(whole) // 3, 3, -1)
    B, labels = rows.stacked
    T = np.asarray(B @ whole) if B.shape[0] else np.zeros((0, whole.shape[1]))
    modal = held_compliance(T, reduced, labels)
    return {
        "omega": reduced.omega, "kind": reduced.kind, "M_r": reduced.M_r, "K_r": reduced.K_r,
        "to_diagonal": reduced.to_diagonal, "phi": shapes[: n if rows.settings.output.shapes else 0],
        "interfaces": reduced_interfaces(rows, whole, shapes),
        "excitations": {k: reduced_rows(v, whole, None) for k, v in rows.excitations.items()},
        "monitors": {k: reduced_rows(v, whole, u) for k, v in rows.monitors.items()},
        "compliance": Compliance(labels, s.static, modal, bool((reduced.omega == 0).any()), s.eigenmodes),
    }  # fmt: skip


def _stress_sets(b: Prepared, state: StaticState, shapes: Array, harmonic: int) -> dict[str, StressSet]:
    """The sets that the settings ask for, of shapes (n, 3, m)."""
    sets: dict[str, StressSet] = {}
    if b.settings.output.stress_at(harmonic):
        if b.settings.output.gauss:
            sets["gauss"] = gauss_set(b.model, state, shapes)
        if b.settings.output.nodal_stress:
            sets["nodes"] = nodal_set(b.model, state, shapes, harmonic, sets.get("gauss"))
    return {k: replace(s, singular=b.rows.zones.hold(s.points)) for k, s in sets.items()}


def _residual(b: Prepared, state: StaticState, s: Solution, harmonic: int) -> Residual | None:
    """Shapes, gauges, strain and stress of the residual attachment modes that the solver adds (MacNeal)."""
    if s.reduced.residual is None:
        return None
    n, r = b.model.d.mesh.n_points, s.reduced.residual.shape[1]
    whole = s.unknowns.expand(s.reduced.residual, n)
    shapes = whole.reshape(n, 3, r)
    sets = _stress_sets(b, state, shapes, harmonic) if r else {}
    return Residual(
        s.force_labels,
        shapes if b.settings.output.shapes else np.zeros((0, 3, r)),
        {k: reduced_gauge(v, whole, state).rows for k, v in b.rows.gauges.items()},
        {name: x.strain for name, x in sets.items()},
        {name: x.stress for name, x in sets.items()},
    )


def without_massless(r: RunUp, reduced: Reduced) -> RunUp:
    """The same with the inertia of the modes alone where some coordinates carry no mass."""
    if "massless-interface" not in reduced.kind or reduced.to_diagonal is None:
        return r
    onto = reduced.to_diagonal @ reduced.to_diagonal.conj().T @ reduced.M_r
    left = onto.conj().T
    return RunUp(left @ r.N @ onto, left @ r.P @ onto, left @ r.euler, left @ r.centrifugal)


def _gyroscopic(
    settings: BodySettings, speed: float, reduced: Reduced, run_up: RunUp, found: eigen.Spectrum, kept: int
) -> GyroscopicModes | None:
    """Modes with gyroscopic coupling at speed, with the bound that the certified spectrum allows."""
    if not (speed and settings.rotation.gyroscopic):
        return None
    V = np.eye(len(reduced.omega)) if reduced.to_diagonal is None else reduced.to_diagonal
    N, P = V.conj().T @ run_up.N @ V, V.conj().T @ run_up.P @ V
    values = [found.upper_shift, *found.values[kept : kept + 1]] if found.certified else [0.0]
    next_omega = float(np.sqrt(max(min(values), 0.0)))
    known = Certified(P, speed, next_omega, kept if reduced.to_diagonal is None else 0)
    K = own_stiffness(reduced.K_r, reduced.omega, reduced.to_diagonal, speed)
    own = gyroscopic_modes(np.eye(len(N)), 2 * speed * N, K, N, known)
    return replace(own, shapes=V @ own.shapes)


def modal_damping(reduced: Reduced, diagonal: Array) -> Array:
    """(c, c) damping matrix with the given diagonal in the reduced body's own modes."""
    if reduced.to_diagonal is None:
        return np.diag(diagonal)
    back = reduced.M_r @ reduced.to_diagonal  # V^-H, because V^H M_r V = 1
    return (back * diagonal) @ back.conj().T


def ratios_of(C: Array, reduced: Reduced) -> Array:
    """(c,) damping ratios of the reduced body's own modes, whatever else C (c, c) couples."""
    V = np.eye(len(C)) if reduced.to_diagonal is None else reduced.to_diagonal
    own = np.einsum("ij,ik,kj->j", V.conj(), C, V).real
    return np.divide(own, 2 * reduced.omega, out=np.zeros_like(own), where=reduced.omega > 0)


def checks_of(s: Solution) -> dict[str, float]:
    """What the search says of itself."""
    found = s.found
    return {
        "certified": float(found.certified),
        "count_below_upper_shift": float(len(found.values)),
        "upper_shift_hz": float(np.sqrt(max(found.upper_shift, 0.0)) / 2 / np.pi),
        "refound": float(found.refound),
        "orthogonality": found.orthogonality,
        "backward_error": float(found.backward_error[: s.kept].max()),
    }


def _checks(model: BodyModel, state: StaticState) -> dict[str, float]:
    total = float(model.M_full.sum())
    volume = float(sum(m.density * b.dx.sum() for m, b in zip(model.materials, model.d.blocks, strict=True)))
    volume += 0.0 if model.d.mesh.lumps is None else float(model.d.mesh.lumps.masses.sum())
    return {"mass_error": abs(total - volume) / volume, "newton_steps": float(state.iterations)}

"""One call from a mesh and a body's settings to its `ModalBasis`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from .. import eigen
from ..body import BodySettings
from ..data import (
    Array,
    Compliance,
    Mesh,
    ModalBasis,
    ModalGroup,
    StressSet,
    UserError,
)
from ..fem.discretise import Discretisation, discretise, free_upper
from ..fem.operators import skew
from ..mesh import longest_over_shortest
from ..reduction import METHODS, Problem, Reduced
from . import canonical, rigid
from .body_rows import BodyRows, body_rows, reduced_gauge, reduced_interfaces, reduced_rows
from .boundary import check_held, fixed_dofs, with_dead_loads
from .equilibrium import BodyModel, StaticState, equilibrium, make_model
from .spectrum import leading_rows, make_pencil, rigid_shift, static_answers
from .stress import gauss_set, nodal_set

Report = Callable[[str], None]


def modal_basis(
    mesh: Mesh, settings: BodySettings, temperature: Array | None = None, report: Report = lambda _: None,
    provenance: Mapping[str, str] | None = None,
) -> ModalBasis:  # fmt: skip
    """The modal basis of a body at each of its rotation speeds (Sextro section 2.4).

    Args:
        mesh: in metres. settings: in SI. temperature: (n,) K at the points, or None. report: told what is done.
        provenance: texts to carry in the file.

    Raises:
        UserError: missing faces, unheld bodies, impossible points, instability at speed.
        NotConverged: the equilibrium or the spectrum could not be found.
    """
    report(f"assembling {mesh.n_cells} cells, {3 * mesh.n_points} degrees of freedom")
    d = discretise(mesh)
    fixed = fixed_dofs(mesh, settings)
    free = free_upper(d.pattern, fixed)
    rows = body_rows(mesh, settings)
    axis, point = np.array(settings.rotation.axis), np.array(settings.rotation.point)
    model = make_model(
        d, settings.material.material(), free, fixed, axis, point, temperature, settings.temperature.reference,
        np.zeros((mesh.n_points, 3)), settings.rotation.spin_softening,
    )  # fmt: skip
    model = with_dead_loads(model, mesh, settings)
    mass, centre, inertia = inertia_of(d, model.material.density)
    motions = rigid.free_motions(mesh.points, centre, fixed)
    check_held(mesh, settings, centre, motions)
    solver = eigen.new_solver(settings.modes.solver)
    state: StaticState | None = None
    before = 0.0
    groups = {}
    try:
        for number, rpm in enumerate(settings.rotation.speeds_rpm):
            speed = rpm * np.pi / 30
            if len(settings.rotation.speeds_rpm) > 1 or speed:
                report(f"speed {number + 1} of {len(settings.rotation.speeds_rpm)}: {rpm:g} rpm")
            state = equilibrium(model, speed, settings.rotation.prestress, solver, _guess(state, before, speed), report)
            before = speed
            groups[number, 0] = _group(model, settings, state, speed, motions, rows, solver, report)
    finally:
        solver.close()
    return ModalBasis(
        settings.name, mesh, groups, mass, centre, inertia, model.axis, point, settings.damping.source,
        bool(motions.shape[1]), settings.reduction, dict(provenance or {}),
    )  # fmt: skip


def _guess(state: StaticState | None, before: float, speed: float) -> StaticState | None:
    """Start of Newton at the next speed: displacements grow about as the square of the speed."""
    if state is None or before == 0:
        return state
    return replace(state, u=state.u * (speed / before) ** 2)


def inertia_of(d: Discretisation, density: float) -> tuple[float, Array, Array]:
    """Mass (kg), centre (3,) m, inertia (3, 3) about the centre, kg m2 (Sextro Eqs. (2.3-32) to (2.3-34))."""
    points = np.concatenate([np.einsum("qk,eki->eqi", b.N, d.mesh.points[b.cells]).reshape(-1, 3) for b in d.blocks])
    dm = density * np.concatenate([b.dx.reshape(-1) for b in d.blocks])
    m = dm.sum()
    centre = dm @ points / m
    r = points - centre
    second = np.einsum("p,pi,pj->ij", dm, r, r)
    return float(m), centre, np.trace(second) * np.eye(3) - second


@dataclass(frozen=True)
class Solution:
    """Certified modes of one state and the coordinates that the reduction makes of them.

    Attributes:
        found: every mode solved for; the first `kept` were reduced. reduced: shapes on the free degrees of freedom.
        answers: (n, r) static answers to the rows B (r, 3 points), named by `labels`. static: (r, r) compliance;
            eigenmodes: (r, r) the part of it that the kept eigenmodes alone hold.
    """

    found: eigen.Spectrum
    kept: int
    reduced: Reduced
    answers: Array
    static: Array
    eigenmodes: Array
    B: sp.csr_matrix
    labels: tuple[str, ...]


def _group(
    model: BodyModel, settings: BodySettings, state: StaticState, speed: float, motions: Array, rows: BodyRows,
    solver: eigen.DirectSolver, report: Report,
) -> ModalGroup:  # fmt: skip
    pencil = make_pencil(model, state.K, solver)
    s = solution(model, settings, pencil, speed, motions, rows, report)
    phi = np.zeros((3 * model.d.mesh.n_points, len(s.reduced.kind)))
    phi[model.free.free] = s.reduced.vectors
    group = assemble_group(
        model, settings, state, speed, rows, s.found, phi, s.reduced, s.static, s.B, s.labels, s.kept, report
    )
    return replace(group, compliance=replace(group.compliance, eigenmodes=s.eigenmodes))


def solution(
    model: BodyModel, settings: BodySettings, pencil: eigen.Pencil, speed: float, motions: Array, rows: BodyRows,
    report: Report,
) -> Solution:  # fmt: skip
    """Modes, static answers and reduced coordinates of the stiffness about one state.

    Raises:
        UserError: instability, more modes than degrees of freedom. NotConverged: no certificate.
    """
    dofs = model.free.free
    R = motions[dofs]
    R = rigid.mass_orthonormal(R, pencil.M) if R.shape[1] else R
    shift = rigid_shift(model) if R.shape[1] else 0.0
    wanted = settings.modes.count
    if wanted > pencil.n - 2:
        raise UserError(
            f"modes.count: {wanted} modes asked for, but the body has only {pencil.n} degrees of freedom; "
            "ask for fewer or refine"
        )
    report(f"eigenmodes: {pencil.n} free degrees of freedom, solver {pencil.solver.name}")
    try:
        found = eigen.search(pencil, wanted, shift, rigid=R if R.shape[1] else None)
    except eigen.Unstable as error:
        raise UserError(_divergence(settings, speed, error.count, model)) from error
    B, labels = rows.stacked(settings)
    B_free = B[:, dofs] if B.shape[0] else sp.csr_matrix((0, pencil.n))
    answers = static_answers(pencil, found, B_free, R, shift)
    static = np.asarray(B_free @ answers)
    static = 0.5 * (static + static.T)
    if settings.modes.certify:
        report("certifying the spectrum by the inertia count")
        found = eigen.certify(pencil, found, shift)
    zero = R.shape[1]
    phi = np.zeros((3 * model.d.mesh.n_points, len(found.values)))
    phi[dofs] = found.vectors
    place = canonical.by_place(model.d.mesh.points)
    lead = leading_rows(rows, settings, phi, place)
    phi = canonical.turn_clusters(phi, found.values, lead(phi), zero)
    phi *= canonical.signs(lead(phi)[:6] if settings.interfaces else phi[place])
    keep = _band(found.values, settings, zero)
    exact = [i for i, label in enumerate(labels) if not label.startswith("monitor:")]
    problem = Problem(
        pencil, found.values[:keep], phi[dofs, :keep], zero, B_free[np.array(exact, dtype=int)],
        tuple(labels[i] for i in exact), answers[:, exact], settings.modes.certify,
    )  # fmt: skip
    if settings.reduction != "eigenmodes":
        report(f"reduction: {settings.reduction}")
    reduced = METHODS[settings.reduction](problem)
    plain = held_compliance(np.asarray(B_free @ problem.vectors), METHODS["eigenmodes"](problem))
    return Solution(found, keep, reduced, answers, static, plain, B, labels)


def _divergence(settings: BodySettings, speed: float, count: int, model: BodyModel) -> str:
    if not speed and not model.loaded:
        return (
            f"mesh: the stiffness has {count} negative eigenvalues although nothing loads the body: its cells are too "
            f"thin to be told from rounding (edges up to {longest_over_shortest(model.d.mesh):.0f} times as long as "
            "the shortest of the cell); refine the mesh or check length_unit"
        )
    remedy = "lower the speed"
    if settings.rotation.prestress == "none" and speed:
        remedy += ', or use rotation.prestress = "nonlinear": without the stiffening by stress frequencies fall to zero'
    elif not speed:
        remedy = "reduce the loads or the temperature change, or check the material"
    return (
        f"rotation.speeds_rpm: at {speed * 30 / np.pi:.6g} rpm {count} eigenvalue{'s are' if count > 1 else ' is'} "
        f"negative: the body diverges; {remedy}"
    )


def _band(values: Array, settings: BodySettings, zero: int) -> int:
    if settings.modes.max_frequency is None:
        return len(values)
    keep = int(np.searchsorted(values, (2 * np.pi * settings.modes.max_frequency) ** 2, side="right"))
    if keep <= zero:
        raise UserError(
            f"modes.max_frequency: no elastic mode lies below {settings.modes.max_frequency:g} Hz "
            f"(the first is at {np.sqrt(values[min(zero, len(values) - 1)]) / 2 / np.pi:.6g} Hz); raise it"
        )
    if keep == len(values):
        raise UserError(
            f"modes.count: {len(values)} modes do not reach modes.max_frequency = {settings.modes.max_frequency:g} Hz; "
            "raise modes.count"
        )
    return keep


def assemble_group(
    model: BodyModel, settings: BodySettings, state: StaticState, speed: float, rows: BodyRows, found: eigen.Spectrum,
    phi: Array, reduced: Reduced, static: Array, B: sp.csr_matrix, labels: tuple[str, ...], kept: int, report: Report,
) -> ModalGroup:  # fmt: skip
    n, m, omega = model.d.mesh.n_points, phi.shape[1], reduced.omega
    shapes = phi.reshape(n, 3, m)
    ratios = settings.damping.ratios(omega)
    T = np.asarray(B @ phi) if B.shape[0] else np.zeros((0, m))
    modal = held_compliance(T, reduced)
    Mphi = (model.M_full @ phi.reshape(n, 3 * m)).reshape(n, 3, m)
    G = 2 * speed * np.einsum("nia,ij,njb->ab", shapes.conj(), skew(model.axis), Mphi, optimize=True)
    stresses: dict[str, StressSet] = {}
    if settings.output.gauss or settings.output.nodal_stress:
        report("strain and stress modes")
        if settings.output.gauss:
            stresses["gauss"] = gauss_set(model, state, shapes)
        if settings.output.nodal_stress:
            stresses["nodes"] = nodal_set(model, state, shapes)
    u = state.u.reshape(-1)
    return ModalGroup(
        speed=speed,
        omega=omega,
        kind=reduced.kind,
        damping_ratio=ratios,
        M_r=reduced.M_r,
        K_r=reduced.K_r,
        C_r=modal_damping(reduced, 2 * ratios * omega),
        to_diagonal=reduced.to_diagonal,
        G_r=0.5 * (G - G.conj().T),
        phi=shapes if settings.output.shapes else np.zeros((0, 3, m)),
        interfaces=reduced_interfaces(rows, settings, phi, shapes),
        excitations={k: reduced_rows(v, phi, None) for k, v in rows.excitations.items()},
        monitors={k: reduced_rows(v, phi, u) for k, v in rows.monitors.items()},
        gauges={k: reduced_gauge(v, phi, state) for k, v in rows.gauges.items()},
        compliance=Compliance(labels, static, modal, "rigid" in reduced.kind),
        stresses=stresses,
        u_static=state.u,
        checks=_checks(found, model, state, kept),
        prestress=state.prestress if (speed or model.loaded) else "none",
        spin_softening=model.spin_softening,
    )


def held_compliance(T: Array, reduced: Reduced) -> Array:
    """(r, r) static compliance that the coordinates hold, for rows T (r, c): T K_r^-1 T^H without the rigid ones."""
    V = np.eye(len(reduced.kind)) if reduced.to_diagonal is None else reduced.to_diagonal
    elastic = reduced.omega > 0
    modes = (T @ V)[:, elastic]
    return (modes / reduced.omega[elastic] ** 2) @ modes.conj().T


def modal_damping(reduced: Reduced, diagonal: Array) -> Array:
    """(c, c) damping matrix with the given diagonal in the reduced body's own modes."""
    if reduced.to_diagonal is None:
        return np.diag(diagonal)
    back = reduced.M_r @ reduced.to_diagonal  # V^-H, because V^H M_r V = 1
    return (back * diagonal) @ back.conj().T


def _checks(found: eigen.Spectrum, model: BodyModel, state: StaticState, kept: int) -> dict[str, float]:
    total = float(model.M_full.sum())
    volume = model.d.volume * model.material.density
    return {
        "certified": float(found.certified),
        "count_below_upper_shift": float(len(found.values)),
        "upper_shift_hz": float(np.sqrt(max(found.upper_shift, 0.0)) / 2 / np.pi),
        "refound": float(found.refound),
        "orthogonality": found.orthogonality,
        "backward_error": float(found.backward_error[:kept].max()),
        "mass_error": abs(total - volume) / volume,
        "newton_steps": float(state.iterations),
    }

"""One call from a mesh and a body's settings to its `ModalBasis`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..data import (
    Array,
    Compliance,
    GyroscopicModes,
    Mesh,
    ModalBasis,
    ModalGroup,
    Residual,
    RunUp,
    SpeedRange,
    StressSet,
    UserError,
)
from ..fem.contact import coupled_points
from ..fem.discretise import Discretisation, discretise, free_upper
from ..fem.operators import per_block
from ..linalg import eigen
from ..linalg.gyroscopic import Certified, gyroscopic_modes
from ..reduction import Reduced
from ..settings.body import BodySettings
from ..units import from_rpm
from . import rigid
from .body_rows import BodyRows, body_rows, reduced_gauge, reduced_interfaces, reduced_rows, with_centrifugal
from .boundary import check_held, fixed_dofs, known_materials, materials_of, refuse_overlap, with_dead_loads
from .characteristic import with_characteristic
from .closures import ContactCurve, bolt_forces, contact_curve, contact_pairs, contact_states
from .equilibrium import BodyModel, StaticState, equilibrium, make_model
from .invariants import inertia_invariants, stiffening_operators, with_stiffening
from .preload import pressed_modes, pressed_state
from .run_up import run_up_terms
from .sector import Sector, cut_faces, make_sector
from .solution import Searched, Solution, held_compliance, reduced_solution, searched, with_spares, without_spares
from .spectrum import make_pencil
from .stress import gauss_set, nodal_set
from .unconstrained import refuse_unlinked_parts

Report = Callable[[str], None]


def modal_basis(
    mesh: Mesh,
    settings: BodySettings,
    temperature: Array | None = None,
    report: Report = lambda _: None,
    provenance: Mapping[str, str] | None = None,
) -> ModalBasis:
    """The modal basis of a body at each of its rotation speeds (Sextro section 2.4).

    Args:
        mesh: in metres. settings: in SI. temperature: (n,) K at the points, or None. report: told what is done.
        provenance: texts to carry in the file.

    Raises:
        UserError: missing faces, unheld bodies, impossible points, instability at speed.
        NotConverged: the equilibrium or the spectrum could not be found.
    """
    report(f"assembling {mesh.n_cells} cells, {3 * mesh.n_points} degrees of freedom")
    b = prepared(mesh, settings, temperature)
    solver = eigen.new_solver(settings.modes.solver)
    try:
        b = replace(b, rows=with_characteristic(b.rows, b.model, settings, b.motions, solver))
        groups, settled, ends = _at_speeds(b, settings, solver, report)
        groups = _stiffened(b, settings, groups, solver, report)
        ranges = _over_ranges(b, settings, settled, ends, solver, report)
    finally:
        solver.close()
        if b.sector is not None:
            b.sector.close()
    basis = ModalBasis(
        settings.name, mesh, groups, b.mass, b.centre, b.inertia, b.model.axis, b.model.point, settings.damping.source,
        bool(b.motions.shape[1]), settings.reduction, dict(provenance or {}),
        ranges=ranges,
    )  # fmt: skip
    if (cyclic := settings.cyclic) is None:
        return basis
    return replace(basis, sectors=cyclic.sectors, cyclic_faces=(cyclic.left, cyclic.right))


@dataclass(frozen=True)
class Prepared:
    """A body ready to be solved: its model, the rows on it, what floats, and the sector it may be.

    Attributes:
        motions: (3n, r) rigid motions that nothing holds. mass: kg. centre: (3,) m. inertia: (3, 3) about it, kg m2.
    """

    model: BodyModel
    rows: BodyRows
    motions: Array
    mass: float
    centre: Array
    inertia: Array
    sector: Sector | None


def prepared(mesh: Mesh, settings: BodySettings, temperature: Array | None) -> Prepared:
    """Model, rows and rigid motions of a body, with every refusal that needs no solution.

    Raises:
        UserError: missing faces, unheld bodies and parts, impossible points.
    """
    axis, point = np.array(settings.rotation.axis), np.array(settings.rotation.point)
    if settings.cyclic:  # before what relies on the number of sectors
        cut_faces(mesh, settings, axis, point)
    pairs = contact_pairs(mesh, settings, known_materials(mesh, settings))
    d = discretise(mesh, coupled=[coupled_points(p) for p in pairs])
    fixed = fixed_dofs(mesh, settings)
    sector = make_sector(d, settings, fixed, axis, point) if settings.cyclic else None
    free = free_upper(d.pattern, fixed) if sector is None else sector.static
    rows = body_rows(mesh, settings)
    model = make_model(
        d, materials_of(d, settings), free, fixed, axis, point, temperature, settings.temperature.reference,
        np.zeros((mesh.n_points, 3)), settings.rotation.spin_softening,
    )  # fmt: skip
    rows = with_centrifugal(rows, model, settings)
    model = with_dead_loads(model, mesh, settings)
    model = replace(model, contacts=pairs, dead_load=model.dead_load + bolt_forces(mesh, settings))
    mass, centre, inertia = inertia_of(d, [m.density for m in model.materials])
    motions = _floating(model, sector, centre)
    check_held(mesh, settings, centre, motions)
    refuse_unlinked_parts(model, settings)
    refuse_overlap(mesh, settings)
    return Prepared(model, rows, motions, mass, centre, inertia, sector)


def _floating(model: BodyModel, sector: Sector | None, centre: Array) -> Array:
    """(3n, r) rigid motions that the supports leave; six supports may hold a ring though each lets its sector turn."""
    points = model.d.mesh.points
    if sector is None:
        return rigid.free_motions(points, centre, model.fixed)
    cut = sector.unknowns.cut
    return rigid.free_motions_of_ring(points, model.point, model.fixed, cut.rotation, cut.sectors)


def _at_speeds(
    b: Prepared, settings: BodySettings, solver: eigen.DirectSolver, report: Report
) -> tuple[dict[tuple[int, int], ModalGroup], dict[float, StaticState], dict[float, Mapping[int, Searched]]]:
    """(number of the speed, nodal diameter) -> group; speed in rad/s -> static state, and modes at ends of a range."""
    speeds, floats = settings.rotation.speeds_rpm, settings.free and bool(settings.bolts)
    groups: dict[tuple[int, int], ModalGroup] = {}
    settled: dict[float, StaticState] = {}
    ends: dict[float, Mapping[int, Searched]] = {}
    state: StaticState | None = None
    before = 0.0
    for number, rpm in enumerate(speeds):
        speed = from_rpm(rpm)
        if len(speeds) > 1 or speed:
            report(f"speed {number + 1} of {len(speeds)}: {rpm:g} rpm")
        if floats:
            state = pressed_state(
                b.model, b.motions, b.centre, settings.rotation.prestress, settings.modes.solver, report
            )
        else:
            start = _guess(state, before, speed)
            state = equilibrium(b.model, speed, settings.rotation.prestress, solver, start, report)
        before = speed
        settled[speed] = state
        about = b.centre if floats else None
        end = rpm in (settings.rotation.range_rpm or ())  # whose basis begins with its modes and a few more
        asked = with_spares(settings) if end else settings
        found = searched_state(b.model, asked, state, speed, b.motions, b.rows, solver, b.sector, report, about)
        if end:
            ends[speed] = found
            found = {k: without_spares(s, settings.modes.count) for k, s in found.items()}
        made = _groups(b.model, settings, state, speed, b.rows, found, report)
        groups |= {(number, k): group for k, group in made.items()}
    return groups, settled, ends


def _stiffened(
    b: Prepared,
    settings: BodySettings,
    groups: dict[tuple[int, int], ModalGroup],
    solver: eigen.DirectSolver,
    report: Report,
) -> dict[tuple[int, int], ModalGroup]:
    """The groups with the stiffening by inertia forces, where it is asked for."""
    if not settings.output.stiffening or b.sector is not None:
        return groups
    report("stiffening by inertia forces")
    operators = stiffening_operators(b.model, solver, b.motions)
    return {key: with_stiffening(g, b.model, operators) for key, g in groups.items()}


def _over_ranges(
    b: Prepared, settings: BodySettings, settled: Mapping[float, StaticState],
    ends: Mapping[float, Mapping[int, Searched]], solver: eigen.DirectSolver, report: Report,
) -> dict[int, SpeedRange]:  # fmt: skip
    """Nodal diameter -> basis of the range of speeds, where one is asked for."""
    if settings.rotation.range_rpm is None:
        return {}
    from .body_range import body_ranges  # which itself calls `assemble_group`

    return body_ranges(b.model, settings, b.motions, b.rows, solver, b.sector, settled, ends, report)


def closure_curve(
    mesh: Mesh, settings: BodySettings, name: str, approaches: Array, speed: float = 0.0,
    temperature: Array | None = None, report: Report = lambda _: None,
) -> ContactCurve:  # fmt: skip
    """Force over approach of one closure of a body, see `closures.contact_curve`.

    Args:
        approaches: (k,) m, rising. speed: rad/s.

    Raises:
        UserError: no such closure, a free body, as `modal_basis`. NotConverged: no equilibrium at a level.
    """
    known = [c.name for c in settings.closures]
    if name not in known:
        raise UserError(f"closures: there is no closure '{name}'; the body has {', '.join(known) or 'none'}")
    if settings.free:
        raise UserError("free: a free body has nothing to be pressed against; hold it for the curve of a closure")
    report(f"assembling {mesh.n_cells} cells, {3 * mesh.n_points} degrees of freedom")
    b = prepared(mesh, settings, temperature)
    solver = eigen.new_solver(settings.modes.solver)
    try:
        return contact_curve(b.model, name, approaches, solver, speed, report)
    finally:
        solver.close()
        if b.sector is not None:
            b.sector.close()


def _guess(state: StaticState | None, before: float, speed: float) -> StaticState | None:
    """Start of Newton at the next speed: displacements and contact pressures grow about as the square of the speed."""
    if state is None or before == 0:
        return state
    grown = (speed / before) ** 2
    pressed = tuple(replace(g, multiplier=grown * g.multiplier) for g in state.contacts)
    return replace(state, u=grown * state.u, contacts=pressed)


def inertia_of(d: Discretisation, density: float | Sequence[float]) -> tuple[float, Array, Array]:
    """Mass (kg), centre (3,) m, inertia (3, 3) about the centre, kg m2 (Sextro Eqs. (2.3-32) to (2.3-34)).

    Args:
        density: kg/m3, one or one per block.
    """
    points = np.concatenate([np.einsum("qk,eki->eqi", b.N, d.mesh.points[b.cells]).reshape(-1, 3) for b in d.blocks])
    dm = np.concatenate([rho * b.dx.reshape(-1) for rho, b in zip(per_block(d, density), d.blocks, strict=True)])
    m = dm.sum()
    centre = dm @ points / m
    r = points - centre
    second = np.einsum("p,pi,pj->ij", dm, r, r)
    return float(m), centre, np.trace(second) * np.eye(3) - second


def searched_state(
    model: BodyModel, settings: BodySettings, state: StaticState, speed: float, motions: Array, rows: BodyRows,
    solver: eigen.DirectSolver, sector: Sector | None, report: Report, pressed: Array | None = None,
) -> dict[int, Searched]:  # fmt: skip
    """Nodal diameter -> certified modes of one state; pressed: centre of mass of a free body under its bolts."""
    if sector is not None:
        return sector.searched(model, settings, state, speed, motions, rows, report)
    pencil = make_pencil(model, state.K, solver)
    if pressed is not None:
        pencil, motions = pressed_modes(model, state, pencil, pressed)
    return {0: searched(model, settings, pencil, speed, motions, rows, report)}


def _groups(
    model: BodyModel, settings: BodySettings, state: StaticState, speed: float, rows: BodyRows,
    found: Mapping[int, Searched], report: Report,
) -> dict[int, ModalGroup]:  # fmt: skip
    """Nodal diameter -> group of one state."""
    if settings.reduction != "eigenmodes":
        report(f"reduction: {settings.reduction}")
    reduced = {k: reduced_solution(model, settings, s, rows) for k, s in found.items()}
    return {k: assemble_group(model, settings, state, speed, rows, s, k, report) for k, s in reduced.items()}


def assemble_group(
    model: BodyModel, settings: BodySettings, state: StaticState, speed: float, rows: BodyRows, s: Solution,
    harmonic: int, report: Report,
) -> ModalGroup:  # fmt: skip
    """Everything the modal file holds of one state and nodal diameter."""
    reduced = s.reduced
    phi = s.unknowns.expand(reduced.vectors, model.d.mesh.n_points)
    n, m, omega = model.d.mesh.n_points, phi.shape[1], reduced.omega
    shapes = phi.reshape(n, 3, m)
    ratios = settings.damping.ratios(omega)
    B, labels = rows.stacked(settings)
    T = np.asarray(B @ phi) if B.shape[0] else np.zeros((0, m))
    modal = held_compliance(T, reduced, labels)
    Mphi = (model.M_full @ phi.reshape(n, 3 * m)).reshape(n, 3, m)
    run_up = run_up_terms(model, state, shapes, Mphi, harmonic)
    run_up = without_massless(run_up, reduced)
    G = 2 * speed * run_up.N
    if (settings.output.gauss or settings.output.nodal_stress) and settings.output.stress_at(harmonic):
        report("strain and stress modes")
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
        G_r=G,
        run_up=run_up,
        gyroscopic=_gyroscopic(settings, speed, reduced, run_up, s.found, s.kept),
        invariants=None if settings.cyclic else inertia_invariants(model, state, shapes, Mphi),
        phi=shapes if settings.output.shapes else np.zeros((0, 3, m)),
        interfaces=reduced_interfaces(rows, settings, phi, shapes),
        excitations={k: reduced_rows(v, phi, None) for k, v in rows.excitations.items()},
        monitors={k: reduced_rows(v, phi, u) for k, v in rows.monitors.items()},
        gauges={k: reduced_gauge(v, phi, state) for k, v in rows.gauges.items()},
        compliance=Compliance(labels, s.static, modal, bool((omega == 0).any()), s.eigenmodes),
        stresses=_stress_sets(model, settings, state, shapes, harmonic),
        u_static=state.u,
        checks={**_checks(s.found, model, state, s.kept), **s.indicators},
        prestress=state.prestress if (speed or model.loaded) else "none",
        harmonic=harmonic,
        spin_softening=model.spin_softening,
        contacts=contact_states(model.d.mesh, settings, state.contacts),
        residual=_residual(model, settings, state, rows, s, harmonic),
    )


def _stress_sets(
    model: BodyModel, settings: BodySettings, state: StaticState, shapes: Array, harmonic: int
) -> dict[str, StressSet]:
    """The sets that the settings ask for, of shapes (n, 3, m)."""
    found: dict[str, StressSet] = {}
    if settings.output.stress_at(harmonic):
        if settings.output.gauss:
            found["gauss"] = gauss_set(model, state, shapes)
        if settings.output.nodal_stress:
            found["nodes"] = nodal_set(model, state, shapes, harmonic)
    return found


def _residual(
    model: BodyModel, settings: BodySettings, state: StaticState, rows: BodyRows, s: Solution, harmonic: int
) -> Residual | None:
    """Shapes, gauges, strain and stress of the residual attachment modes that the solver adds (MacNeal)."""
    if s.reduced.residual is None:
        return None
    n, r = model.d.mesh.n_points, s.reduced.residual.shape[1]
    whole = s.unknowns.expand(s.reduced.residual, n)
    shapes = whole.reshape(n, 3, r)
    sets = _stress_sets(model, settings, state, shapes, harmonic) if r else {}
    return Residual(
        s.force_labels,
        shapes if settings.output.shapes else np.zeros((0, 3, r)),
        {k: reduced_gauge(v, whole, state).rows for k, v in rows.gauges.items()},
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
    own = gyroscopic_modes(np.eye(len(N)), 2 * speed * N, np.diag(reduced.omega**2), N, known)
    return replace(own, shapes=V @ own.shapes)


def modal_damping(reduced: Reduced, diagonal: Array) -> Array:
    """(c, c) damping matrix with the given diagonal in the reduced body's own modes."""
    if reduced.to_diagonal is None:
        return np.diag(diagonal)
    back = reduced.M_r @ reduced.to_diagonal  # V^-H, because V^H M_r V = 1
    return (back * diagonal) @ back.conj().T


def _checks(found: eigen.Spectrum, model: BodyModel, state: StaticState, kept: int) -> dict[str, float]:
    total = float(model.M_full.sum())
    volume = float(sum(m.density * b.dx.sum() for m, b in zip(model.materials, model.d.blocks, strict=True)))
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

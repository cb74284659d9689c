"""One call from a mesh and a body's settings to its `ModalBasis`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..data import Array, Mesh, ModalBasis, ModalGroup, SpeedRange
from ..errors import UserError
from ..fem.contact import coupled_points
from ..fem.cyclic import CyclicUpper
from ..fem.discretise import REDUCED, discretise, whole
from ..fem.operators import spin_projector
from ..fem.tied import Tied, tied_upper
from ..linalg import eigen
from ..progress import Whole
from ..settings.body import BodySettings
from ..units import from_rpm
from . import rigid
from .body_range import body_ranges
from .body_rows import BodyRows, body_rows, with_centrifugal
from .boundary import check_held, fixed_dofs, known_materials, materials_of, refuse_overlap, with_dead_loads
from .characteristic import with_characteristic
from .closures import ContactCurve, bolt_forces, contact_curve, contact_pairs
from .equilibrium import BodyModel, StaticState, equilibrium, make_model
from .floating import balanced, refuse_floating, refuse_unbalanced
from .group import assemble_group, inertia_of, searched_state
from .invariants import stiffening_operators, with_stiffening
from .preload import pressed_state
from .sector import Sector, cut_faces, make_sector
from .solution import Searched, reduced_solution, with_spares, without_spares
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
        motions: (3n, r) rigid motions that nothing holds. coefficients: (6, r) of these (`rigid.coefficients_of`).
        mass: kg. centre: (3,) m. inertia: (3, 3) about it, kg m2.
    """

    model: BodyModel
    rows: BodyRows
    motions: Array
    coefficients: Array
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
    degree = REDUCED if settings.mesh.integration == "reduced" else None
    if degree and not set(mesh.cells) <= set(REDUCED):
        raise UserError('mesh.integration: "reduced" is of bricks of 20 nodes alone; write "full" or mesh with bricks')
    d = discretise(mesh, degree, coupled=[coupled_points(p) for p in pairs])
    held = fixed_dofs(mesh, settings)
    fixed = held[held < 3 * mesh.n_points]
    if len(fixed) == 3 * mesh.n_points:
        raise UserError("supports: hold every point of the body, so that nothing vibrates; hold fewer of its faces")
    sector = make_sector(d, settings, held, axis, point) if settings.cyclic else None
    free = tied_upper(d.pattern, held, mesh.ties) if sector is None else sector.static
    rows = body_rows(mesh, settings)
    materials = materials_of(d, settings)
    mass, centre, inertia = inertia_of(whole(d), [m.density for m in materials])
    turning = settings.free and any(settings.rotation.speeds_rpm)
    if turning and sector is None and not len(fixed):  # such a body turns about its centre of mass
        point = point + (centre - point) @ spin_projector(axis / np.linalg.norm(axis))
    model = make_model(
        d, materials, free, fixed, axis, point, temperature, settings.temperature.reference,
        np.zeros((mesh.n_points, 3)), settings.rotation.spin_softening,
    )  # fmt: skip
    rows = with_centrifugal(rows, model, settings)
    model = with_dead_loads(model, mesh, settings)
    model = replace(model, contacts=pairs, dead_load=model.dead_load + bolt_forces(mesh, settings))
    motions = _floating(model, sector, centre)
    check_held(mesh, settings, centre, motions)
    refuse_unlinked_parts(model, settings)
    refuse_overlap(mesh, settings)
    coefficients = rigid.coefficients_of(mesh.points, model.point, motions)
    if settings.free:
        refuse_floating(settings, turning)
    if turning and sector is None:  # all sectors together are balanced
        refuse_unbalanced(replace(model, point=np.array(settings.rotation.point)), motions, centre, inertia)
    return Prepared(model, rows, motions, coefficients, mass, centre, inertia, sector)


def _floating(model: BodyModel, sector: Sector | None, centre: Array) -> Array:
    """(3n, r) rigid motions that the supports leave; six supports may hold a ring though each lets its sector turn."""
    points = model.d.mesh.points
    if sector is None:
        assert not isinstance(model.free, CyclicUpper)
        return rigid.left_by(model.free, points, centre, model.fixed)
    cut, apart = sector.unknowns.cut, sector.unknowns.apart
    motions = rigid.free_motions_of_ring(points, model.point, model.fixed, cut.rotation, cut.sectors)
    if not isinstance(apart, Tied) or (left := rigid.allowed(apart, motions)).shape[1] == motions.shape[1]:
        return motions
    if left.shape[1]:
        raise UserError("supports: a reference node of a cyclic sector can be held wholly or not at all; hold a face")
    return left


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
    waves = 1 if b.sector is None else len(b.sector.harmonics)
    report = Whole(report, len(speeds) * waves, "speeds" if waves == 1 else "nodal diameters at all speeds")
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
            within = balanced(b.model, _alike(b), solver)
            state = equilibrium(b.model, speed, settings.rotation.prestress, within, start, report)
        before = speed
        settled[speed] = state
        about = b.centre if floats else None
        end = rpm in (settings.rotation.range_rpm or ())  # whose basis begins with its modes and a few more
        asked = with_spares(settings) if end else settings
        found = searched_state(b.model, asked, state, speed, b.coefficients, b.rows, solver, b.sector, report, about)
        if end:
            ends[speed] = found
            found = {k: without_spares(s, settings.modes.count) for k, s in found.items()}
        report.done = (number + 1) * waves
        made = _groups(b.model, settings, state, speed, b.rows, found, report)
        groups |= {(number, k): group for k, group in made.items()}
    return groups, settled, ends


def _alike(b: Prepared) -> Array:
    """(6, r) rigid motions that the static state could have: of a sector those of nodal diameter 0."""
    if b.sector is None:
        return b.coefficients
    cut = b.sector.unknowns.cut
    return rigid.of_nodal_diameter(b.coefficients, cut.rotation, cut.sectors, 0)


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
    return body_ranges(b.model, settings, b.coefficients, b.rows, solver, b.sector, settled, ends, report)


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


def _groups(
    model: BodyModel, settings: BodySettings, state: StaticState, speed: float, rows: BodyRows,
    found: Mapping[int, Searched], report: Report,
) -> dict[int, ModalGroup]:  # fmt: skip
    """Nodal diameter -> group of one state."""
    if settings.reduction != "eigenmodes":
        report(f"reduction: {settings.reduction}")
    reduced = {k: reduced_solution(model, settings, s, rows) for k, s in found.items()}
    return {k: assemble_group(model, settings, state, speed, rows, s, k, report) for k, s in reduced.items()}

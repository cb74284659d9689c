"""One call from a mesh and a body's settings to its `ModalBasis`, or to its matrices as finite elements have them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import scipy.sparse as sp

from ..data import Array, Mesh, ModalBasis, ModalGroup
from ..errors import UserError
from ..fem.cyclic import CyclicUpper
from ..linalg.eigen import new_solver
from ..progress import Whole
from ..settings.body import BodySettings
from ..units import from_rpm
from .body_range import body_ranges
from .characteristic import with_characteristic
from .closures import ContactCurve, contact_curve
from .equilibrium import StaticState, equilibrium
from .floating import balanced
from .group import assemble_group
from .invariants import stiffening_operators, with_stiffening
from .preload import pressed_state
from .prepared import Prepared, Report, prepared
from .solution import Searched, reduced_solution, searched_state, without_spares


def modal_basis(
    mesh: Mesh,
    settings: BodySettings,
    temperature: Array | None = None,
    report: Report = lambda _: None,
    provenance: Mapping[str, str] | None = None,
) -> ModalBasis:
    """The modal basis of a body at each of its rotation speeds (Sextro section 2.4).

    Args:
        mesh: in metres. settings: in SI. temperature: (n,) K at the points, (n, 2) with the
            stress-free one behind it, or None. report: told what is done.
        provenance: texts to carry in the file.

    Raises:
        UserError: missing faces, unheld bodies, impossible points, instability at speed.
        NotConverged: the equilibrium or the spectrum could not be found.
    """
    with prepared(mesh, settings, temperature, report) as b:
        b = replace(b, rows=with_characteristic(b))
        groups, settled, ends = _at_speeds(b)
        if settings.output.stiffening and b.sector is None:
            report("stiffening by inertia forces")
            operators = stiffening_operators(b.model, b.solver, b.motions)
            groups = {key: with_stiffening(g, b.model, operators) for key, g in groups.items()}
        ranges = {} if settings.rotation.range_rpm is None else body_ranges(b, settled, ends)
    basis = ModalBasis(
        settings.name, mesh, groups, b.mass, b.centre, b.inertia, b.model.axis, b.model.point,
        settings.damping.source if b.model.dashpots is None else "matrix",
        bool(b.motions.shape[1]), settings.reduction, dict(provenance or {}),
        ranges=ranges,
    )  # fmt: skip
    if (cyclic := settings.cyclic) is None:
        return basis
    return replace(basis, sectors=cyclic.sectors, cyclic_faces=(cyclic.left, cyclic.right))


def _at_speeds(
    b: Prepared,
) -> tuple[
    dict[tuple[int, int], ModalGroup], dict[float, StaticState], dict[float, Mapping[int, Searched]]
]:
    """(number of the speed, nodal diameter) -> group; speed in rad/s -> static state, and modes at ends of a range."""
    rotation, speeds, waves = b.settings.rotation, b.settings.rotation.speeds_rpm, len(b.harmonics)
    groups: dict[tuple[int, int], ModalGroup] = {}
    settled: dict[float, StaticState] = {}
    ends: dict[float, Mapping[int, Searched]] = {}
    state: StaticState | None = None
    report = Whole(
        b.report, len(speeds) * waves, "speeds" if waves == 1 else "nodal diameters at all speeds"
    )
    b = replace(b, report=report)
    for number, rpm in enumerate(speeds):
        speed = from_rpm(rpm)
        if len(speeds) > 1 or speed:
            report(f"speed {number + 1} of {len(speeds)}: {rpm:g} rpm")
        if b.pressed:
            state = pressed_state(
                b.model, b.motions, b.centre, rotation.prestress, b.settings.modes, report
            )
        else:
            state = _rest(b, speed, _guess(state, speed), report)
        settled[speed] = state
        end = rpm in (rotation.range_rpm or ())  # whose basis begins with its modes and a few more
        searched = searched_state(b.with_spares() if end else b, state)
        if end:
            ends[speed] = searched
            searched = {k: without_spares(s, b.settings.modes.count) for k, s in searched.items()}
        report.done = (number + 1) * waves
        if b.settings.reduction != "eigenmodes":
            report(f"reduction: {b.settings.reduction}")
        for k, s in searched.items():
            groups[number, k] = assemble_group(b, state, reduced_solution(b, s), k)
    return groups, settled, ends


def _rest(b: Prepared, speed: float, start: StaticState | None, report: Report) -> StaticState:
    """The static state at a speed, held as its step says."""
    prestress = b.settings.rotation.prestress
    if b.still is None:
        within = balanced(b.model, b.floats(0), b.solver)
        return equilibrium(b.model, speed, prestress, within, start, report)
    modes = b.settings.modes  # the other solver keeps its analysis of what the modes leave free
    solver = new_solver(modes.solver, modes.ranks)
    try:
        return equilibrium(b.still, speed, prestress, solver, start, report)
    finally:
        solver.close()


def _guess(state: StaticState | None, speed: float) -> StaticState | None:
    """Start of Newton at the next speed: displacements and contact pressures grow about as the square of the speed."""
    if state is None or state.speed == 0:
        return state
    grown = (speed / state.speed) ** 2
    pressed = tuple(replace(g, multiplier=grown * g.multiplier) for g in state.contacts)
    return replace(state, u=grown * state.u, contacts=pressed)


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
        raise UserError(
            f"closures: there is no closure '{name}'; the body has {', '.join(known) or 'none'}"
        )
    if settings.free:
        raise UserError(
            "free: a free body has nothing to be pressed against; hold it for the curve of a closure"
        )
    with prepared(mesh, settings, temperature, report) as b:
        return contact_curve(b.model, name, approaches, b.solver, speed, report)


@dataclass(frozen=True)
class Unreduced:
    """A body at rest on its n free degrees of freedom.

    Attributes:
        M, C, K: (n, n). rows: interface -> (6, n) its motion along n, t1, t2 and about them. mass: kg. congruent:
            (3p, 3p) of the mesh's p points -> (n, n).
    """

    M: sp.csr_matrix
    C: sp.csr_matrix
    K: sp.csr_matrix
    rows: Mapping[str, sp.csr_matrix]
    mesh: Mesh
    mass: float
    congruent: Callable[[sp.csr_matrix], sp.csr_matrix]


def unreduced(mesh: Mesh, settings: BodySettings) -> Unreduced:
    """The matrices of a body at rest.

    Args:
        mesh: in metres. settings: in SI.

    Raises:
        UserError: damping that is no matrix (ratios of modes); a sector; see `prepared.prepared`.
    """
    damping = settings.damping
    with prepared(mesh, settings) as b:
        if (
            damping.ratio
            or damping.table
            or b.sector is not None
            or any(settings.rotation.speeds_rpm)
        ):
            raise UserError(
                f"{settings.name}: the unreduced matrices of a body have no damping by modes, no sector and no speed; "
                "write alpha and beta in [damping]"
            )
        free = b.model.free
        assert not isinstance(free, CyclicUpper)
        M = free.congruent(sp.kron(b.model.M_full, sp.eye(3)).tocsr())
        upper = free.matrix(b.model.K0)
    K = (upper + sp.triu(upper, 1).T).tocsr()
    C = ((damping.alpha or 0.0) * M + (damping.beta or 0.0) * K).tocsr()
    if b.model.dashpots is not None:
        C = C + free.congruent(b.model.d.pattern.full(b.model.dashpots))
    rows = {name: free.rows(p.B.tocsr()) for name, p in b.rows.patches.items()}
    return Unreduced(M, C, K, rows, mesh, b.mass, free.congruent)

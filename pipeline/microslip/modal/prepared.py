"""A body ready to be solved: model, rows, rigid motions and solver, after every refusal that needs no solution."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from ..data import Array, Indices, Mesh
from ..errors import UserError
from ..fem.contact import Grip, coupled_points
from ..fem.cyclic import CyclicUpper, cyclic_upper, sector_unknowns
from ..fem.discretise import RULES, Discretisation, FreeUpper, discretise, whole
from ..fem.operators import per_block, spin_projector
from ..fem.tied import Tied, tied_upper
from ..linalg.direct import DirectSolver
from ..linalg.eigen import Pencil, new_solver
from ..progress import Report
from ..settings.body import BodySettings
from . import rigid
from .body_rows import BodyRows, body_rows, with_centrifugal
from .boundary import (
    check_held,
    fixed_dofs,
    known_materials,
    materials_of,
    refuse_other_supports,
    refuse_overlap,
    still_dofs,
    with_loads,
)
from .closures import bolt_forces, contact_pairs
from .equilibrium import BodyModel, Unknowns, make_model, with_lumps
from .floating import refuse_floating, refuse_unbalanced
from .range_basis import SPARE
from .sector import Sector, cut_faces, make_sector, sector_pencils
from .spectrum import make_pencil
from .unconstrained import refuse_unlinked_parts


@dataclass(frozen=True)
class Prepared:
    """A body ready to be solved: its model, the rows on it, what floats, and the sector it may be.

    Attributes:
        motions: (3n, r) rigid motions that nothing holds. coefficients: (6, r) of these
            (`rigid.coefficients_of`). mass: kg. centre: (3,) m. inertia: (3, 3) about it, kg m2.
        solver: of the static states, and of the modes of a body that is no sector. report: is told
            what is done. still: the model as the static step of its file holds it, where its modes
            are held otherwise.
    """

    model: BodyModel
    settings: BodySettings
    rows: BodyRows
    motions: Array
    coefficients: Array
    mass: float
    centre: Array
    inertia: Array
    sector: Sector | None
    solver: DirectSolver
    report: Report
    still: BodyModel | None = None

    @property
    def harmonics(self) -> tuple[int, ...]:
        """Nodal diameters."""
        return self.sector.harmonics if self.sector else (0,)

    @property
    def pressed(self) -> bool:
        """Whether it floats under its own bolts (`preload`)."""
        return self.settings.free and bool(self.settings.bolts)

    def unknowns(self, k: int) -> Unknowns:
        """Of a nodal diameter."""
        if self.sector is not None:
            return self.sector.harmonic(k)
        assert not isinstance(self.model.free, CyclicUpper)
        return self.model.free

    def pencils(self, K: Array, grips: Sequence[Grip] = ()) -> dict[int, Pencil]:
        """Nodal diameter -> its pencil about a state of stiffness K (p, 3, 3). grips: contacts of a sector there."""
        s = self.sector
        if s is None:
            return {0: make_pencil(self.model, K, self.solver)}
        return sector_pencils(self.model, K, s.unknowns, s.condensed, s.harmonics, grips)

    def floats(self, k: int) -> Array:
        """(6, r) rigid motions of a nodal diameter that nothing holds."""
        if self.sector is None:
            return self.coefficients
        cut = self.sector.unknowns.cut
        return rigid.of_nodal_diameter(self.coefficients, cut.ahead, cut.sectors, k)

    def with_spares(self) -> Prepared:
        """The same, asking for a few modes more: one that comes down into the band at another speed is then known."""
        modes = self.settings.modes.model_copy(update={"count": self.settings.modes.count + SPARE})
        return replace(self, settings=self.settings.model_copy(update={"modes": modes}))


@contextmanager
def prepared(
    mesh: Mesh,
    settings: BodySettings,
    temperature: Array | None = None,
    report: Report = lambda _: None,
) -> Iterator[Prepared]:
    """Model, rows, rigid motions and solver of a body, with every refusal that needs no solution.

    Raises:
        UserError: missing faces, unheld bodies and parts, impossible points.
    """
    report(f"assembling {mesh.n_cells} cells, {3 * mesh.n_points} degrees of freedom")
    b = _prepared(mesh, settings, temperature, report)
    try:
        yield b
    finally:
        b.solver.close()
        if b.sector is not None:
            b.sector.condensed.close()


def _prepared(
    mesh: Mesh, settings: BodySettings, temperature: Array | None, report: Report
) -> Prepared:
    axis, point = np.array(settings.rotation.axis), np.array(settings.rotation.point)
    if settings.cyclic:  # before what relies on the number of sectors
        cut_faces(mesh, settings, axis, point)
    pairs = contact_pairs(mesh, settings, known_materials(mesh, settings))
    rule = settings.mesh.integration
    degree = RULES[rule]
    if degree and not set(mesh.cells) & set(degree):
        raise UserError(
            f'mesh.integration: "{rule}" is of {", ".join(degree)}, which the mesh has not; write "full"'
        )
    d = discretise(mesh, degree, coupled=[coupled_points(p) for p in pairs])
    d = replace(d, one_rule=rule in ("reduced-mass", "calculix"))
    held = fixed_dofs(mesh, settings)
    fixed = held[held < 3 * mesh.n_points]
    if len(fixed) == 3 * mesh.n_points:
        raise UserError(
            "supports: hold every point of the body, so that nothing vibrates; hold fewer of its faces"
        )
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
    model = with_lumps(model)
    rows = with_centrifugal(rows, model)
    rest = still_dofs(mesh, settings)
    if rest is not None:
        model = replace(model, free=_unknowns(d, rest, sector))
        refuse_other_supports(settings)
    model = with_loads(model, mesh, settings, held if rest is None else rest)
    model = replace(model, contacts=pairs, dead_load=model.dead_load + bolt_forces(mesh, settings))
    still, model = None if rest is None else model, replace(model, free=free)
    motions = rigid.unresisted(_floating(model, sector, centre), model.springs, d.pattern)
    check_held(mesh, settings, centre, motions)
    refuse_unlinked_parts(model, settings)
    refuse_overlap(mesh, settings)
    coefficients = rigid.coefficients_of(mesh.points, model.point, motions)
    if settings.free:
        refuse_floating(settings, turning)
    if turning and sector is None:  # all sectors together are balanced
        refuse_unbalanced(
            replace(model, point=np.array(settings.rotation.point)), motions, centre, inertia
        )
    solver = new_solver(settings.modes.solver, settings.modes.ranks)
    return Prepared(
        model, settings, rows, motions, coefficients, mass, centre, inertia, sector, solver, report, still
    )  # fmt: skip


def _unknowns(
    d: Discretisation, held: Indices, sector: Sector | None
) -> FreeUpper | Tied | CyclicUpper:
    """Of a static state whose supports are not those of the modes."""
    if sector is None:
        return tied_upper(d.pattern, held, d.mesh.ties)
    unknowns = sector_unknowns(d.pattern, held, sector.unknowns.cut, d.mesh.ties)
    return cyclic_upper(unknowns, d.pattern.size)


def _floating(model: BodyModel, sector: Sector | None, centre: Array) -> Array:
    """(3n, r) rigid motions that the supports leave; six supports may hold a ring though each lets its sector turn."""
    points = model.d.mesh.points
    if sector is None:
        assert not isinstance(model.free, CyclicUpper)
        return rigid.left_by(model.free, points, centre, model.fixed)
    cut, apart = sector.unknowns.cut, sector.unknowns.apart
    motions = rigid.free_motions_of_ring(
        points, model.point, model.fixed, cut.rotation, cut.sectors
    )
    if (
        not isinstance(apart, Tied)
        or (left := rigid.allowed(apart, motions)).shape[1] == motions.shape[1]
    ):
        return motions
    if left.shape[1]:
        raise UserError(
            "supports: a reference node of a cyclic sector can be held wholly or not at all; hold a face"
        )
    return left


def inertia_of(d: Discretisation, density: float | Sequence[float]) -> tuple[float, Array, Array]:
    """Mass (kg), centre (3,) m, inertia (3, 3) about the centre, kg m2 (Sextro Eqs. (2.3-32) to (2.3-34)).

    Args:
        density: kg/m3, one or one per block.
    """
    points = np.concatenate(
        [np.einsum("qk,eki->eqi", b.N, d.mesh.points[b.cells]).reshape(-1, 3) for b in d.blocks]
    )
    dm = np.concatenate(
        [rho * b.dx.reshape(-1) for rho, b in zip(per_block(d, density), d.blocks, strict=True)]
    )
    if d.mesh.lumps is not None:
        points = np.concatenate([points, d.mesh.points[d.mesh.lumps.points]])
        dm = np.concatenate([dm, d.mesh.lumps.masses])
    m = dm.sum()
    centre = dm @ points / m
    r = points - centre
    second = np.einsum("p,pi,pj->ij", dm, r, r)
    return float(m), centre, np.trace(second) * np.eye(3) - second

"""One call from a mesh and a body's settings to its `ModalBasis`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from .. import eigen
from ..body import BodySettings, Excitation
from ..data import (
    Array,
    Compliance,
    Indices,
    Interface,
    Mesh,
    ModalBasis,
    ModalGroup,
    Rows,
    StressSet,
    UserError,
)
from ..fem.discretise import Discretisation, discretise, face_blocks, free_upper
from ..fem.loads import body_force, pressure, traction
from ..fem.operators import skew
from . import canonical, rigid
from .equilibrium import BodyModel, StaticState, equilibrium, make_model
from .rows import Locator, Patch, patch, point_rows, slope_rows
from .stress import gauss_set, nodal_set

Report = Callable[[str], None]
_AXES = {"x": 0, "y": 1, "z": 2}
_INTERFACE_LABELS = ("u_n", "u_t1", "u_t2", "phi_n", "phi_t1", "phi_t2")


@dataclass(frozen=True)
class BodyRows:
    """All rows on nodal displacements, named. Each value is (B (r, 3n), labels, unit, point, distance)."""

    patches: Mapping[str, Patch]
    excitations: Mapping[str, _Named]
    monitors: Mapping[str, _Named]
    gauges: Mapping[str, _Named]

    def stacked(self, settings: BodySettings) -> tuple[sp.csr_matrix, tuple[str, ...]]:
        """Every interface (but load faces), excitation and monitor row, for the static compliance."""
        parts: list[sp.csr_matrix] = []
        labels: list[str] = []
        for item in settings.interfaces:
            if item.role != "load":
                parts.append(self.patches[item.name].B)
                labels += [f"interface:{item.name}:{c}" for c in _INTERFACE_LABELS]
        for kind, named in (("excitation", self.excitations), ("monitor", self.monitors)):
            for name, rows in named.items():
                parts.append(rows.B)
                labels += [f"{kind}:{name}:{label}" for label in rows.labels]
        if not parts:
            return sp.csr_matrix((0, 0)), ()
        return sp.vstack(parts).tocsr(), tuple(labels)


@dataclass(frozen=True)
class _Named:
    B: sp.csr_matrix
    labels: tuple[str, ...]
    unit: str
    point: Array
    distance: float
    direction: Array | None = None  # of a gauge, whose B holds the three rows of the slope along it


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
    fixed = _fixed(mesh, settings)
    free = free_upper(d.pattern, fixed)
    rows = body_rows(mesh, settings)
    axis, point = np.array(settings.rotation.axis), np.array(settings.rotation.point)
    model = make_model(
        d, settings.material.material(), free, fixed, axis, point, temperature, settings.temperature.reference,
        np.zeros((mesh.n_points, 3)), settings.rotation.spin_softening,
    )  # fmt: skip
    model = _with_dead_loads(model, mesh, settings)
    mass, centre, inertia = inertia_of(d, model.material.density)
    motions = rigid.free_motions(mesh.points, centre, fixed)
    _check_held(mesh, settings, centre, motions)
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


def _fixed(mesh: Mesh, settings: BodySettings) -> Indices:
    fixed = [np.zeros(0, dtype=np.int64)]
    for support in settings.supports:
        _require_face(mesh, support.face, f"supports.{support.face}.face", points_suffice=True)
        nodes = mesh.face_points(support.face)
        fixed += [3 * nodes + _AXES[c] for c in support.directions]
    return np.unique(np.concatenate(fixed))


def _require_face(mesh: Mesh, face: str, key: str, points_suffice: bool = False) -> None:
    if face in mesh.faces or (points_suffice and face in mesh.point_sets):
        return
    known = sorted(mesh.faces) + (sorted(set(mesh.point_sets) - set(mesh.faces)) if points_suffice else [])
    raise UserError(f"{key}: the mesh has no face '{face}'; its faces are {', '.join(known) or 'none'}")


def _check_held(mesh: Mesh, settings: BodySettings, centre: Array, motions: Array) -> None:
    found = motions.shape[1]
    if settings.free and not found:
        raise UserError("free: true, but the supports hold the body wholly; remove one of them")
    if found and not settings.free:
        names = "; ".join(rigid.describe(mesh.points, centre, motions))
        raise UserError(
            f"supports: nothing holds the body against {names}; add supports, or write free = true if it is meant "
            "to float"
        )
    if settings.free and any(settings.rotation.speeds_rpm):
        raise UserError("rotation.speeds_rpm: a free body has no equilibrium at speed; hold it or use speed 0")
    if settings.free and settings.loads:
        raise UserError("loads: a free body has no static equilibrium under loads; hold it or remove the loads")


def _with_dead_loads(model: BodyModel, mesh: Mesh, settings: BodySettings) -> BodyModel:
    force = np.zeros((mesh.n_points, 3))
    locator = Locator(mesh) if any(load.point for load in settings.loads) else None
    for number, load in enumerate(settings.loads):
        if load.kind == "gravity":
            force += body_force(model.M_full, np.array(load.vector))
        elif load.kind == "pressure":
            _require_face(mesh, load.face or "", f"loads.{number}.face")
            force += pressure(face_blocks(mesh, load.face or ""), mesh.n_points, load.value or 0.0)
        elif load.face is not None:
            _require_face(mesh, load.face, f"loads.{number}.face")
            blocks = face_blocks(mesh, load.face)
            area = sum(np.linalg.norm(b.area, axis=2).sum() for b in blocks)
            force += traction(blocks, mesh.n_points, np.array(load.vector) / area)
        else:
            assert locator is not None
            place = locator.find(np.array(load.point), f"loads.{number}.point")
            force[place.nodes] += place.N[:, None] * np.array(load.vector)
    return replace(model, dead_load=force)


def body_rows(mesh: Mesh, settings: BodySettings) -> BodyRows:
    """Rows of all interfaces, excitations, monitors and gauges of the settings on a mesh."""
    patches = {}
    for item in settings.interfaces:
        _require_face(mesh, item.face, f"interfaces.{item.name}.face")
        patches[item.name] = patch(mesh, item.face, np.array(item.t2), item.name)
    for excitation in settings.excitations:
        if excitation.face is not None:
            _require_face(mesh, excitation.face, f"excitations.{excitation.name}.face")
            if excitation.face not in patches:
                patches[excitation.face] = _load_patch(mesh, excitation.face)
    locator = Locator(mesh)
    n = mesh.n_points
    excitations = {e.name: _excitation(mesh, locator, e) for e in settings.excitations}
    monitors, gauges = {}, {}
    for m in settings.monitors:
        place = locator.find(np.array(m.point), f"monitors.{m.name}.point")
        directions = np.eye(3)[[_AXES[c] for c in m.directions]]
        labels = tuple(f"u_{c}" for c in m.directions)
        monitors[m.name] = _Named(point_rows(n, place, directions), labels, "m", place.point, place.distance)
    for g in settings.gauges:
        place = locator.find(np.array(g.point), f"gauges.{g.name}.point")
        direction = np.array(g.direction) / np.linalg.norm(g.direction)
        slopes = slope_rows(n, place, direction)
        gauges[g.name] = _Named(slopes, ("strain",), "1", place.point, place.distance, direction)
    return BodyRows(patches, excitations, monitors, gauges)


def _load_patch(mesh: Mesh, face: str) -> Patch:
    blocks = face_blocks(mesh, face)
    mean = sum(b.area.sum(axis=(0, 1)) for b in blocks)
    hint = np.eye(3)[int(np.abs(mean).argmin())]
    return patch(mesh, face, hint, face)


def _excitation(mesh: Mesh, locator: Locator, e: Excitation) -> _Named:
    n = mesh.n_points
    if e.face is None:
        place = locator.find(np.array(e.point), f"excitations.{e.name}.point")
        direction = np.array(e.direction) / np.linalg.norm(np.array(e.direction))
        return _Named(point_rows(n, place, direction[None]), ("force",), "N", place.point, place.distance)
    blocks = face_blocks(mesh, e.face)
    sizes = [np.linalg.norm(b.area, axis=2) for b in blocks]
    total = sum(s.sum() for s in sizes)
    centre = sum(np.einsum("fq,fqi->i", s, b.points) for s, b in zip(sizes, blocks, strict=True)) / total
    if e.pressure:
        return _Named(sp.csr_matrix(pressure(blocks, n).reshape(1, -1)), ("pressure",), "Pa", centre, 0.0)
    direction = np.array(e.direction) / np.linalg.norm(np.array(e.direction))
    force = traction(blocks, n, direction / total)
    return _Named(sp.csr_matrix(force.reshape(1, -1)), ("force",), "N", centre, 0.0)


def inertia_of(d: Discretisation, density: float) -> tuple[float, Array, Array]:
    """Mass (kg), centre (3,) m, inertia (3, 3) about the centre, kg m2 (Sextro Eqs. (2.3-32) to (2.3-34))."""
    points = np.concatenate([np.einsum("qk,eki->eqi", b.N, d.mesh.points[b.cells]).reshape(-1, 3) for b in d.blocks])
    dm = density * np.concatenate([b.dx.reshape(-1) for b in d.blocks])
    m = dm.sum()
    centre = dm @ points / m
    r = points - centre
    second = np.einsum("p,pi,pj->ij", dm, r, r)
    return float(m), centre, np.trace(second) * np.eye(3) - second


def _pencil(model: BodyModel, K: Array, solver: eigen.DirectSolver) -> eigen.Pencil:
    free = model.free
    n = model.d.mesh.n_points
    K_upper = free.matrix(K)
    M_upper = free.matrix(model.M[:, None, None] * np.eye(3))
    diagonal = K_upper.diagonal()
    M_full: sp.csr_matrix = model.M_full  # type: ignore[assignment]

    def K_times(x: Array) -> Array:
        return K_upper @ x + K_upper.T @ x - (diagonal * x.T).T

    M_times = _mass_product(model)

    def shifted(s: float) -> sp.csr_matrix:
        return sp.csr_matrix((K_upper.data - s * M_upper.data, K_upper.indices, K_upper.indptr), shape=K_upper.shape)

    return eigen.Pencil(shifted, K_times, M_times, len(diagonal), _norm(K_upper), _norm(M_upper), solver)


def _mass_product(model: BodyModel) -> Callable[[Array], Array]:
    """Products of the mass matrix on the free degrees of freedom with (n_free,) or (n_free, r) arrays."""
    free, n = model.free.free, model.d.mesh.n_points
    M: sp.csr_matrix = model.M_full  # type: ignore[assignment]
    nodes = np.unique(free // 3)
    if len(free) == 3 * len(nodes):  # whole points are held or free: no scattering needed
        M_nodes = M if len(nodes) == n else M[nodes][:, nodes]
        return lambda x: (M_nodes @ x.reshape(len(nodes), -1)).reshape(x.shape)

    def product(x: Array) -> Array:
        whole = np.zeros((3 * n, *x.shape[1:]))
        whole[free] = x
        return (M @ whole.reshape(n, -1)).reshape(whole.shape)[free]

    return product


def _norm(upper: sp.csr_matrix) -> float:
    """Infinity norm of the symmetric matrix with this upper triangle (its diagonal counted twice)."""
    size = np.abs(upper.data)
    columns = np.bincount(upper.indices, size, minlength=upper.shape[0])
    return float((np.add.reduceat(size, upper.indptr[:-1]) + columns).max())


def _group(
    model: BodyModel, settings: BodySettings, state: StaticState, speed: float, motions: Array, rows: BodyRows,
    solver: eigen.DirectSolver, report: Report,
) -> ModalGroup:  # fmt: skip
    pencil = _pencil(model, state.K, solver)
    dofs = model.free.free
    R = motions[dofs]
    R = rigid.mass_orthonormal(R, pencil.M) if R.shape[1] else R
    shift = _shift(model) if R.shape[1] else 0.0
    wanted = settings.modes.count
    if wanted > pencil.n - 2:
        raise UserError(f"modes.count: {wanted} modes asked for, but the body has only {pencil.n} degrees of freedom; ask for fewer or refine")
    report(f"eigenmodes: {pencil.n} free degrees of freedom, solver {solver.name}")
    try:
        found = eigen.search(pencil, wanted, shift, rigid=R if R.shape[1] else None)
    except eigen.Unstable as error:
        raise UserError(_divergence(settings, speed, error.count)) from error
    B, labels = rows.stacked(settings)
    B_free = B[:, dofs] if B.shape[0] else sp.csr_matrix((0, pencil.n))
    static = _static_compliance(pencil, found, B_free, R, shift)
    if settings.modes.certify:
        report("certifying the spectrum by the inertia count")
        found = eigen.certify(pencil, found, shift)
    zero = R.shape[1]
    phi = np.zeros((3 * model.d.mesh.n_points, len(found.values)))
    phi[dofs] = found.vectors
    place = canonical.by_place(model.d.mesh.points)
    lead = _leading_rows(rows, settings, phi, place)
    phi = canonical.turn_clusters(phi, found.values, lead(phi), zero)
    phi *= canonical.signs(lead(phi)[:6] if settings.interfaces else phi[place])
    keep = _band(found.values, settings, zero)
    phi, values = phi[:, :keep], found.values[:keep]
    omega = np.sqrt(np.maximum(values, 0.0))
    omega[:zero] = 0.0
    return _assemble_group(model, settings, state, speed, rows, found, phi, omega, zero, static, B, labels, report)


def _shift(model: BodyModel) -> float:
    """Negative shift for bodies with rigid modes: minus the square of a twentieth of wave speed over length."""
    stiffness = np.linalg.eigvalsh(model.material.elasticity).max()
    length = np.ptp(model.d.mesh.points, axis=0).max()
    return -float(0.05**2 * stiffness / model.material.density / length**2)


def _divergence(settings: BodySettings, speed: float, count: int) -> str:
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


def _leading_rows(
    rows: BodyRows, settings: BodySettings, phi: Array, place: Indices
) -> Callable[[Array], Array]:
    """Rows that decide signs and the basis of pairs: the first interface's, else the strongest nodes' motion."""
    first = next((i.name for i in settings.interfaces), None)
    chosen = _strong(phi, place)
    if first is not None:
        B = rows.patches[first].B
        return lambda x: np.vstack([B @ x, x[chosen]])
    return lambda x: x[chosen]


def _strong(phi: Array, place: Indices) -> Indices:
    """Degrees of freedom with the largest motion over all modes, a few of them; of ties the first in `place`."""
    power = (phi[place] ** 2).sum(axis=1)
    return place[np.argsort(-np.round(power / power.max(), 6), kind="stable")[:6]]


def _static_compliance(pencil: eigen.Pencil, found: eigen.Spectrum, B: sp.csr_matrix, R: Array, shift: float) -> Array:
    """(r, r) displacement of row i under unit force on row j; inertia relief when rigid motions are free.

    With rigid motions, the part outside the modes found is solved by fixed-point iteration on the shifted
    factorisation, which contracts by |shift| / (lambda_next + |shift|) a step; a body so slender that this would
    hardly contract is factorised again, with a smaller shift.
    """
    F = np.asarray(B.T.todense())
    if not F.shape[1]:
        return np.zeros((0, 0))
    if not R.shape[1]:
        C = np.asarray(B @ pencil.solve(F))
        return 0.5 * (C + C.T)
    if -shift > 0.3 * found.upper_shift:
        shift = -0.1 * found.upper_shift
        pencil.solver.factorise(pencil.shifted(shift))
    X = found.vectors
    MX = pencil.M(X)
    elastic = found.values[R.shape[1] :]
    T = np.asarray(B @ X[:, R.shape[1] :])
    rest = F - MX @ (X.T @ F)
    u = np.zeros_like(rest)
    previous = np.inf
    for _ in range(60):
        step = pencil.solve(rest)
        step -= X @ (MX.T @ step)
        u += step
        size = np.abs(step).max() / max(np.abs(u).max(), 1e-300)
        if size < 1e-13 or (size < 1e-8 and size > 0.3 * previous):  # no further gain above rounding
            break
        previous = size
        rest = -shift * pencil.M(step)  # what K leaves of the step: K s = rest + shift M s
        rest -= MX @ (X.T @ rest)
    C = (T / elastic) @ T.T + np.asarray(B @ u)
    return 0.5 * (C + C.T)


def _assemble_group(
    model: BodyModel, settings: BodySettings, state: StaticState, speed: float, rows: BodyRows, found: eigen.Spectrum,
    phi: Array, omega: Array, zero: int, static: Array, B: sp.csr_matrix, labels: tuple[str, ...], report: Report,
) -> ModalGroup:  # fmt: skip
    n, m = model.d.mesh.n_points, len(omega)
    shapes = phi.reshape(n, 3, m)
    ratios = settings.damping.ratios(omega)
    T = np.asarray(B @ phi) if B.shape[0] else np.zeros((0, m))
    elastic = omega > 0
    modal = (T[:, elastic] / omega[elastic] ** 2) @ T[:, elastic].T
    Mphi = (model.M_full @ phi.reshape(n, 3 * m)).reshape(n, 3, m)  # type: ignore[operator]
    G = 2 * speed * np.einsum("nia,ij,njb->ab", shapes, skew(model.axis), Mphi, optimize=True)
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
        kind=tuple(["rigid"] * zero + ["normal"] * (m - zero)),
        damping_ratio=ratios,
        M_r=np.eye(m),
        K_r=np.diag(omega**2),
        C_r=np.diag(2 * ratios * omega),
        G_r=0.5 * (G - G.T),
        phi=shapes if settings.output.shapes else np.zeros((0, 3, m)),
        interfaces=_interfaces(rows, settings, phi, shapes),
        excitations={k: _reduced(v, phi, None) for k, v in rows.excitations.items()},
        monitors={k: _reduced(v, phi, u) for k, v in rows.monitors.items()},
        gauges={k: _gauge(v, phi, state) for k, v in rows.gauges.items()},
        compliance=Compliance(labels, static, modal, bool(zero)),
        stresses=stresses,
        u_static=state.u,
        checks=_checks(found, model, state, m),
        prestress=state.prestress if (speed or model.loaded) else "none",
        spin_softening=model.spin_softening,
    )


def _interfaces(rows: BodyRows, settings: BodySettings, phi: Array, shapes: Array) -> dict[str, Interface]:
    described = {i.name: i for i in settings.interfaces}
    out = {}
    for name, p in rows.patches.items():
        item = described.get(name)
        keep = settings.output.patch_shapes
        moved = (p.N @ shapes.reshape(len(shapes), -1)).reshape(len(p.points), 3, -1)
        out[name] = Interface(
            p.origin, p.rotation, np.asarray(p.B @ phi), p.fit_residual(shapes), p.points, p.areas, p.normals,
            moved if keep else np.zeros((0, 3, phi.shape[1])),
            item.role if item else "load", item.partner if item else "", item.sector_shift if item else 0,
        )  # fmt: skip
    return out


def _reduced(named: _Named, phi: Array, u: Array | None) -> Rows:
    static = np.zeros(len(named.labels)) if u is None else np.asarray(named.B @ u)
    return Rows(np.asarray(named.B @ phi), named.labels, named.unit, named.point, named.distance, static)


def _gauge(named: _Named, phi: Array, state: StaticState) -> Rows:
    """Strain along the gauge: of the static state, and its change per unit coordinate (`slope_rows`)."""
    assert named.direction is not None
    slope = np.asarray(named.B @ state.u.reshape(-1))
    along = named.direction if state.H is None else named.direction + slope
    strain = named.direction @ slope + (0.5 * slope @ slope if state.prestress == "nonlinear" else 0.0)
    row = along @ np.asarray(named.B @ phi)
    return Rows(row[None], named.labels, named.unit, named.point, named.distance, np.array([strain]))


def _checks(found: eigen.Spectrum, model: BodyModel, state: StaticState, kept: int) -> dict[str, float]:
    total = float(model.M_full.sum())  # type: ignore[attr-defined]
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

"""What a modal file claims, verified from its own content: `check_basis`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..data import (
    INTERFACE_ROWS,
    Array,
    ContactState,
    GyroscopicModes,
    Interface,
    Invariants,
    Mesh,
    ModalBasis,
    ModalGroup,
    Rows,
    RunUp,
    SpeedRange,
)
from ..files.declared import agrees, nouns, numbers
from ..linalg.gyroscopic import stability_sentence
from ..modal.range_basis import frequencies, interpolant, largest_difference
from ..reduced.coordinates import compliance_row, held, in_modes, own_stiffness
from .integrals import cell_volumes, face_mean, modal_mass
from .places import (
    Places,
    face_of,
    misfit_error,
    normals_error,
    outline_error,
    set_error,
    turning_error,
)
from .strains import allowed, stiffness_error, strain_error, stress_error

TOLERANCES = {
    "orthogonality": 1e-9,
    "backward_error": 1e-9,
    "mass_error": 1e-8,
}
"""Upper limits the solver's numbers are held to by `check_basis` (``certified`` must be 1, the rest is information)."""


SMALL = 1e-6
"""Of the largest compliance's root, below which that of a row is rounding."""


@dataclass(frozen=True)
class Check:
    """One finding of `check_basis`."""

    name: str
    value: float
    limit: float
    passed: bool
    message: str = ""


def worst_of_each(findings: Iterable[Check]) -> list[Check]:
    """Each check once over all speeds and nodal diameters: one that failed, else the nearest to its limit."""
    kinds: dict[str, list[Check]] = {}
    for c in findings:
        kinds.setdefault(re.sub(r"^(speed|range)(_\d+)?(/nd_\d+)?: ", r"\1: ", c.name), []).append(
            c
        )

    def nearness(c: Check) -> tuple[bool, float]:
        return not c.passed, c.value / c.limit if c.limit and np.isfinite(c.limit) else 0.0

    return [max(found, key=nearness) for found in kinds.values()]


def check_basis(basis: ModalBasis) -> list[Check]:
    """Verify what a modal file claims from its own content, and the numbers stored by the solver.

    Without the full K this covers: shapes and sizes; finite numbers; the mesh's volume, mass-orthogonality of the
    shapes recomputed from the mesh (a file whose shapes stand in another node order fails here), to the digits that its
    solver claims; of a body at rest their stiffness-orthogonality, with strains and stresses; ascending frequencies;
    M_r = 1 and K_r = diag(omega^2) for normal modes; C_r; skew G_r; orthonormal right-handed frames; normals and
    outlines of patches against facets; interface rows against the patch's shapes and against phi; loads, monitors and
    gauges against phi where they say they are; modal compliance against the rows; static not below modal compliance;
    the solver's certificate, orthogonality and backward error.
    """
    with np.errstate(all="ignore"):  # absurd numbers are findings, not warnings
        return _check_basis(basis)


def _check_basis(basis: ModalBasis) -> list[Check]:
    out = _judged("", _mesh_checks(basis))
    sound = all(c.passed for c in out)
    for (speed, harmonic), g in sorted(basis.groups.items()):
        out += _judged(f"speed_{speed}/nd_{harmonic}: ", _group_checks(basis, g, sound))
    for harmonic, r in sorted(basis.ranges.items()):
        out += _judged(f"range/nd_{harmonic}: ", _range_checks(basis, r, sound))
    return out


_Findings = Iterator[tuple[str, float, float, str]]
"""Name, value, its upper limit and what is said beside it."""


def _judged(where: str, findings: _Findings) -> list[Check]:
    return [
        Check(where + name, float(v), limit, bool(v <= limit), said)
        for name, v, limit, said in findings
    ]


def _mesh_checks(basis: ModalBasis) -> _Findings:
    mesh = basis.mesh
    needed = basis.source == "elements"  # foreign matrices and measurements may know points alone
    placeless = basis.source == "matrices" and not mesh.n_points  # generalised coordinates alone
    lacking = 1.0 if not (mesh.n_points or placeless) or (needed and not mesh.n_cells) else 0.0
    yield "mesh: points and cells", lacking, 0.0, f"{mesh.n_points} points, {mesh.n_cells} cells"
    tables = [*mesh.cells.values(), *(f for blocks in mesh.faces.values() for f in blocks.values())]
    highest = max((int(c.max()) for c in tables if c.size), default=-1)
    lowest = min((int(c.min()) for c in tables if c.size), default=0)
    yield (
        "mesh: cells refer to points",
        float(highest if lowest >= 0 else np.inf),
        mesh.n_points - 1,
        "",
    )
    told: list[Any] = [*numbers(mesh), *numbers(basis)]
    told += [a for m in mesh.materials for a in (m.density, m.elasticity, m.expansion)]
    yield "body: every number is finite", _not_finite(told), 0.0, ""
    unknown = 0.0 if basis.source == "measured" or placeless else 1.0  # a test does not weigh
    mass = max(-basis.mass, 0.0) if basis.mass else unknown
    yield "body: mass is positive", mass, 0.0, f"{basis.mass:.6g} kg" if basis.mass else "not known"
    yield (
        "rotation axis has unit length",
        abs(float(np.linalg.norm(basis.rotation_axis)) - 1),
        1e-9,
        "",
    )


def _not_finite(arrays: Iterable[Any]) -> float:
    return float(sum(int((~np.isfinite(a)).sum()) for a in arrays))


def _largest(values: Array) -> np.float64:
    """NumPy's own number: of Python's the square of 1e200 and the division by 0 are exceptions."""
    return np.float64(np.abs(values).max(initial=0.0))


def _extent(mesh: Mesh) -> np.float64:
    return np.maximum(np.ptp(mesh.points, axis=0).max(initial=0.0), 1e-300)


def _group_checks(basis: ModalBasis, g: ModalGroup, mesh_is_sound: bool) -> _Findings:
    fits = _shapes_agree(basis, g)
    yield "shapes of the arrays agree", 0.0 if fits else 1.0, 0.0, ""
    if not fits:
        return
    wild = _not_finite(_numbers(g))
    yield "every number is finite", wild, 0.0, ""
    if wild:
        return
    for name, c in g.contacts.items():
        yield from _contact_checks(name, c)
    yield from _compliance_checks(g)
    if _all_rows(g) is None:
        return
    kept = g
    if g.to_diagonal is not None:
        yield from _transformation_checks(g)
        g = in_modes(g)
    if g.invariants is not None:
        yield from _invariant_checks(basis, g, g.invariants)
    yield from _matrix_checks(g, coupled=basis.damping_source == "matrix")
    if g.run_up is not None:
        yield from _run_up_checks(g, g.run_up)
    if g.gyroscopic is not None:
        yield from _gyroscopic_checks(g, g.gyroscopic)
    if mesh_is_sound and g.phi.shape[0] and basis.source == "elements":
        yield from _shape_checks(basis, g, kept)
        if g.invariants is not None:
            yield from _moment_checks(basis, g, g.invariants)
        if g.run_up is not None and g.harmonic == 0:
            yield from _inertia_load_checks(basis, g, g.run_up)
        yield from _place_of_rows_checks(basis, kept)
    for name, item in g.interfaces.items():
        yield from _interface_checks(basis, g, name, item, mesh_is_sound)
    for key in ("orthogonality", "backward_error", "mass_error"):
        if key in g.checks:
            yield f"solver: {key.replace('_', ' ')}", g.checks[key], TOLERANCES[key], ""
    if "certified" in g.checks:
        message = (
            "" if g.checks["certified"] else "modes.certify was false; the spectrum may have gaps"
        )
        yield "solver: spectrum certified complete", 1.0 - g.checks["certified"], 0.0, message


def _range_checks(basis: ModalBasis, r: SpeedRange, mesh_is_sound: bool) -> _Findings:
    """The samples like groups (shapes and patches, which they share, once), and what the range claims of itself."""
    s, c, h = len(r.samples), r.samples[0].n_modes, len(r.total_error)
    fits = agrees(r, {"sample": s, "held_out": h, "mode": c}) and int(r.held.sum()) == h
    fits = fits and len(r.slopes) in (s - h, 0) and not (r.held & r.solved).any() and s - h > 1
    fits = fits and 0 < r.count <= c and 0 <= r.signs <= len(r.lead)
    fits = fits and all(g.n_modes == c for g in r.samples) and r.form in ("stiffness", "root")
    yield "shapes of the arrays agree", 0.0 if fits else 1.0, 0.0, ""
    wild = _not_finite([*numbers(r), 0.0 if r.shift is None else r.shift, r.tolerance])
    yield "every number is finite", wild, 0.0, ""
    if not fits or wild:
        return
    yield "speeds of the samples rise", float((np.diff(r.speeds) <= 0).sum()), 0.0, ""
    shift = np.square(r.speeds[0]) + (1.0 if r.shift is None else r.shift)
    yield "variable of the polynomials is real", 0.0 if shift > 0 else 1.0, 0.0, ""
    yield "interpolation error at held-out speeds is the one stated", _misstated(r), 0.0, ""
    yield "frequency error at held-out speeds", _largest(r.total_error), r.tolerance, f"{h} speeds"
    for i, g in enumerate(r.samples):
        for name, value, bound, message in _group_checks(basis, g, mesh_is_sound and i == 0):
            yield f"sample_{i}: {name}", value, bound, message


def _misstated(r: SpeedRange) -> float:
    """How many held-out speeds have another interpolation error than the file says (to a tenth, and rounding)."""
    f, wrong = interpolant(r), 0
    exact = [g.K_r for g, held_out in zip(r.samples, r.held, strict=True) if held_out]
    for speed, K, stated in zip(r.held_out, exact, r.interpolation_error, strict=True):
        error = largest_difference(f.modes(speed)[0][: r.count], frequencies(K, r.count))
        wrong += not abs(error - stated) <= 0.1 * stated + 1e-7
    return float(wrong)


def _shapes_agree(basis: ModalBasis, g: ModalGroup) -> bool:
    m, own = g.n_modes, len(g.omega)
    sizes = {"node": basis.mesh.n_points, "mode": m, "own_mode": own}
    fits = all(agrees(noun, sizes) for noun in nouns(g)) and (
        own == m if g.to_diagonal is None else own <= m
    )
    if (f := g.residual) is not None:
        k = len(f.labels)
        fits &= all(a.shape == (len(g.gauges[name].labels), k) for name, a in f.gauges.items())
        sets = [*f.strain.items(), *f.stress.items()]
        fits &= all(a.shape == (len(g.stresses[x].weights), 6, k) for x, a in sets)
    forces, motions = (
        g.kind.count("interface-force"),
        sum(c.startswith("interface:") for c in g.compliance.labels),
    )
    return forces in (0, motions) and fits


def _numbers(g: ModalGroup) -> Iterator[Any]:
    yield g.speed
    for noun in nouns(g):
        yield from numbers(noun)
    if (f := g.residual) is not None:
        yield from (*f.gauges.values(), *f.strain.values(), *f.stress.values())


def _transformation_checks(g: ModalGroup) -> _Findings:
    """The transformation to the reduced body's own modes."""
    V, top = g.to_diagonal, max(_largest(g.omega**2), 1.0)
    assert V is not None
    H = V.conj().T
    if not g.omega.any():  # rigid motions alone: what their stiffness cancels from
        top = max(_largest(np.abs(H) @ np.abs(g.K_r) @ np.abs(V)), 1.0)
    own = own_stiffness(g.K_r, g.omega, V, g.speed)
    yield (
        "to_diagonal: V^T M_r V is the identity",
        _largest(H @ g.M_r @ V - np.eye(len(g.omega))),
        1e-9,
        "",
    )
    yield "to_diagonal: V^T K_r V is diag(omega^2)", _largest(H @ g.K_r @ V - own) / top, 1e-9, ""


def _matrix_checks(g: ModalGroup, coupled: bool = False) -> _Findings:
    """coupled: whether damping may couple the modes (a foreign damping matrix)."""
    scale = max(_largest(g.omega**2), 1.0)
    yield (
        "frequencies ascend",
        float(np.maximum(-np.diff(g.omega), 0).max(initial=0.0)),
        1e-9 * _largest(g.omega),
        "",
    )
    yield "G_r is skew", _largest(g.G_r + g.G_r.conj().T), 1e-9 * max(_largest(g.G_r), 1e-12), ""
    yield "rigid modes have omega = 0", _largest(g.omega[np.array(g.kind) == "rigid"]), 0.0, ""
    C = np.diag(2 * g.damping_ratio * g.omega)
    if coupled:
        C = C + g.C_r - np.diag(np.diag(g.C_r))
    yield "M_r is the identity", _largest(g.M_r - np.eye(g.n_modes)), 1e-9, ""
    own = own_stiffness(g.K_r, g.omega, None, g.speed)
    yield "K_r is diag(omega^2)", _largest(g.K_r - own) / scale, 1e-9, ""
    yield "K_r is symmetric", _largest(g.K_r - g.K_r.conj().T) / scale, 1e-9, ""
    yield "C_r is diag(2 D omega)", _largest(g.C_r - C) / np.sqrt(scale), 1e-9, ""


def _run_up_checks(g: ModalGroup, r: RunUp) -> _Findings:
    """N turns a shape by a quarter about the axis and P takes out what moves along it, so N^H N <= P <= 1."""
    top = 2 * abs(g.speed) * max(_largest(r.N), 1e-12)
    yield "G_r is 2 Omega N", _largest(g.G_r - 2 * g.speed * r.N), 1e-9 * max(top, 1e-12), ""
    yield "run-up: N is skew", _largest(r.N + r.N.conj().T), 1e-9, ""
    yield "run-up: P is symmetric", _largest(r.P - r.P.conj().T), 1e-9, ""
    yield (
        "run-up: P is at most the mass",
        max(float(np.linalg.eigvalsh(r.P)[-1]) - 1, 0.0),
        1e-9,
        "",
    )
    yield (
        "run-up: N^T N is at most P",
        max(-float(np.linalg.eigvalsh(r.P - r.N.conj().T @ r.N)[0]), 0.0),
        1e-9,
        "",
    )


def _invariant_checks(basis: ModalBasis, g: ModalGroup, v: Invariants) -> _Findings:
    """The integrals against the rigid body's numbers, against each other and against the mass-normalised shapes."""
    size = max(_extent(basis.mesh), _largest(basis.centre - v.point))
    yield "invariants: mass", abs(np.float64(v.mass) / basis.mass - 1), 1e-9, ""
    if not g.u_static.any():  # else the body has moved
        r = basis.centre - v.point
        about = basis.inertia + basis.mass * (r @ r * np.eye(3) - np.outer(r, r))
        inertia = np.trace(v.second_moment) * np.eye(3) - v.second_moment
        yield "invariants: centre of mass", _largest(v.first_moment / v.mass - r) / size, 1e-9, ""
        yield "invariants: inertia", _largest(inertia - about) / (v.mass * size**2), 1e-9, ""
    mirrored = v.shape_shape.transpose(1, 0, 3, 2).conj()
    yield "invariants: shape_shape is symmetric", _largest(v.shape_shape - mirrored), 1e-9, ""
    whole = np.einsum("aaij->ij", v.shape_shape)
    yield "invariants: shape_shape adds up to M_r", _largest(whole - g.M_r), 1e-8, ""
    if g.run_up is not None:
        n = basis.rotation_axis
        turn = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
        N = np.einsum("ab,abij->ij", turn, v.shape_shape)
        yield "invariants: shape_shape gives N", _largest(N - g.run_up.N), 1e-9, ""
        P = np.einsum("ab,abij->ij", np.eye(3) - np.outer(n, n), v.shape_shape)
        yield "invariants: shape_shape gives P", _largest(P - g.run_up.P), 1e-8, ""


def _moment_checks(basis: ModalBasis, g: ModalGroup, v: Invariants) -> _Findings:
    """The integrals of the body in its static state, about the point named, over the file's own mesh.

    One mixture of all shapes stands for them: what is wrong in any of them is wrong in it.
    """
    w = np.cos(1.0 + np.arange(g.phi.shape[2]))
    r, mixed = basis.mesh.points + g.u_static - v.point, g.phi @ w
    fields = np.zeros((len(r), 3, 7), dtype=mixed.dtype)
    fields[:, 0, :3], fields[:, 0, 3], fields[:, 0, 4:] = r, 1.0, mixed
    gram, volume = modal_mass(basis.mesh, fields)
    mass = np.float64(basis.mass)
    gram = gram[:4] * (mass / np.float64(volume))
    size = np.sqrt(np.trace(gram[:3, :3].real) / mass) + _extent(basis.mesh)
    moving = np.sqrt(mass) * np.linalg.norm(w)
    yield (
        "invariants: first moment",
        _largest(v.first_moment - gram[:3, 3]) / (mass * size),
        1e-9,
        "",
    )
    yield (
        "invariants: second moment",
        _largest(v.second_moment - gram[:3, :3]) / (mass * size**2),
        1e-9,
        "",
    )
    yield "invariants: shape", _largest(v.shape @ w - gram[3, 4:]) / moving, 1e-9, ""
    yield (
        "invariants: position_shape",
        _largest(v.position_shape @ w - gram[:3, 4:]) / (moving * size),
        1e-9,
        "",
    )


def _inertia_load_checks(basis: ModalBasis, g: ModalGroup, run_up: RunUp) -> _Findings:
    """Euler and centrifugal loads over the file's own mesh, of one mixture of all shapes (`_moment_checks`)."""
    w, n = np.cos(1.0 + np.arange(g.phi.shape[2])), basis.rotation_axis
    r = basis.mesh.points + g.u_static - basis.rotation_point
    fields = np.stack([g.phi @ w, -np.cross(n, r), r - np.outer(r @ n, n)], axis=2)
    gram, weight = modal_mass(basis.mesh, fields)
    gram = gram * (np.float64(basis.mass) / weight)
    top = np.sqrt(np.float64(gram[0, 0].real) * max(gram[1, 1].real, gram[2, 2].real))
    loads = (("Euler", run_up.euler, gram[0, 1]), ("centrifugal", run_up.centrifugal, gram[0, 2]))
    for name, load, exact in loads:
        yield f"run-up: {name} load", abs(w @ load - exact) / top, 1e-8, ""


def _gyroscopic_checks(g: ModalGroup, y: GyroscopicModes) -> _Findings:
    """The complex modes against their own equation; a mode that grows is told, not a fault of the file."""
    s, x = y.growth + 1j * y.omega, y.shapes
    rest = s**2 * (g.M_r @ x) + s * (g.G_r @ x) + g.K_r @ x
    top = _largest(g.omega**2) + _largest(g.G_r) * _largest(g.omega) + _largest(s) ** 2
    yield (
        "gyroscopic: modes satisfy their equation",
        _largest(rest) / max(top, 1e-300),
        1e-8,
        stability_sentence(y),
    )
    yield "gyroscopic: every mode has a direction", float(len(y.direction) != len(y.omega)), 0.0, ""


def _shape_checks(basis: ModalBasis, g: ModalGroup, kept: ModalGroup) -> _Findings:
    """The shapes against the mesh they are stored with; one density is the mass over the mesh's volume. kept: the group
    in the coordinates of the file, in which strains and stresses are as precise as they stand there."""
    inner, weight = modal_mass(basis.mesh, g.phi)
    if not weight > 0:
        yield "volume of the mesh is positive", np.inf, 0.0, ""
        return
    error = _largest(inner * basis.mass / weight - np.eye(g.n_modes))
    limit = 1e-8  # of motions of a boundary, which may be nearly alike
    if basis.reduction in ("eigenmodes", "macneal"):
        limit = min(
            limit, max(1e-11, 100 * g.checks.get("orthogonality", 1.0))
        )  # what the solver claims, and rounding
    yield "shapes are mass-orthonormal on the mesh", error, limit, ""
    yield from _place_checks(basis)
    if (stiff := stiffness_error(basis, g)) is not None:
        yield "shapes are stiffness-orthogonal on the mesh", *stiff, ""
    if g.residual is not None and g.residual.phi.size:
        yield (
            "residual shapes are mass-orthogonal to the modes",
            _beside(basis, g, g.residual.phi),
            1e-6,
            "",
        )
    if basis.mesh.materials:
        yield "mass of the mesh's materials", abs(weight / basis.mass - 1), 1e-8, ""
    volume = cell_volumes(basis.mesh) if g.stresses else 0.0
    if (stressed := stress_error(basis, kept)) is not None:
        yield "stresses follow from strains", stressed, allowed(basis), ""
    for name, s in kept.stresses.items():
        if (strained := strain_error(basis, kept, s)) is not None:
            yield f"strains of {name} follow from the shapes", strained, allowed(basis), ""
        yield f"places of stress set {name}", set_error(basis.mesh, s), 1e-9, ""
        yield f"volume of stress set {name}", abs(float(s.weights.sum()) / volume - 1), 1e-9, ""


def _beside(basis: ModalBasis, g: ModalGroup, residual: Array) -> float:
    """Largest cosine between a residual shape and a mode, in the mass of the mesh."""
    inner, _ = modal_mass(basis.mesh, np.concatenate([g.phi, residual], axis=2))
    size = np.sqrt(np.maximum(np.diag(inner).real, 1e-300))
    return _largest((inner / np.outer(size, size))[: g.n_modes, g.n_modes :])


def _place_checks(basis: ModalBasis) -> _Findings:
    """Centre and inertia of the body against its mesh: one in another unit of length, or moved, fails here."""
    fields = np.zeros((basis.mesh.n_points, 3, 4))
    fields[:, 0, 0], fields[:, 0, 1:] = 1.0, basis.mesh.points
    moments, weight = modal_mass(basis.mesh, fields)
    moments *= basis.mass / weight
    centre = moments[0, 1:] / basis.mass
    second = moments[1:, 1:] - basis.mass * np.outer(centre, centre)
    inertia = np.trace(second) * np.eye(3) - second
    size = _extent(basis.mesh)
    yield "body: centre of mass is the mesh's", _largest(basis.centre - centre) / size, 1e-8, ""
    yield (
        "body: inertia is the mesh's",
        _largest(basis.inertia - inertia) / (basis.mass * size**2),
        1e-8,
        "",
    )


def _interface_checks(
    basis: ModalBasis, g: ModalGroup, name: str, item: Interface, mesh_is_sound: bool
) -> _Findings:
    R = item.rotation
    frame = float(np.abs(R @ R.T - np.eye(3)).max() + abs(np.linalg.det(R) - 1))
    yield f"interface {name}: frame is right-handed", frame, 1e-9, ""
    still = [label for label, row in zip(INTERFACE_ROWS, item.rows, strict=True) if not row.any()]
    if still:
        message = f"nothing moves it along {', '.join(still)}"
        yield f"interface {name}: rows of zeros", float(len(still)), np.inf, message
    top = max(_largest(item.rows[:3]), 1e-300)
    if len(item.areas) and item.points.shape == (len(item.areas), 3):
        centre = item.areas @ item.points / item.areas.sum()
        error = _largest(centre - item.origin) / (
            _largest(np.ptp(item.points, axis=0)) + _extent(basis.mesh)
        )
        yield f"interface {name}: origin is the centre of the patch", error, 1e-9, ""
    if item.shapes.shape[0]:
        mean = R @ np.einsum("p,pim->im", item.areas, item.shapes) / item.areas.sum()
        error = _largest(mean - item.rows[:3]) / top
        yield f"interface {name}: rows agree with the patch's shapes", error, 1e-9, ""
    if not (mesh_is_sound and len(item.areas)):
        return
    face = face_of(basis.mesh, item)
    yield f"interface {name}: normals are outward", normals_error(basis.mesh, item, face), 1e-9, ""
    yield (
        f"interface {name}: outline is that of its face",
        outline_error(basis.mesh, item, face),
        1e-8,
        "",
    )
    if face and g.phi.shape[0]:
        mean = face_mean(basis.mesh.points, face, g.phi)[2]
        error = _largest(R @ mean - item.rows[:3]) / top
        yield f"interface {name}: rows agree with phi on its face", error, 1e-8, ""


def _place_of_rows_checks(basis: ModalBasis, g: ModalGroup) -> _Findings:
    """Loads, monitors and gauges against the shapes where they stand, and what patches say of their fit."""
    places = Places(basis)

    def error(of: Callable[[ModalGroup, Rows], float], rows: Rows) -> float:
        try:
            return of(g, rows)
        except (np.linalg.LinAlgError, ValueError):  # numbers that no body has
            return np.inf

    for kind, named, of, limit in (
        ("excitation", g.excitations, places.load_error, 1e-7),
        ("monitor", g.monitors, places.monitor_error, 1e-7),
        ("gauge", g.gauges, places.gauge_error, 1e-6),
    ):
        for n, r in named.items():
            yield f"{kind} {n}: is where it says", error(of, r), limit, ""
    for n, i in g.interfaces.items():
        yield f"interface {n}: rigid fit", misfit_error(i), 1e-8, ""
        yield f"interface {n}: rotations of the fit", turning_error(i), 1e-8, ""


def _contact_checks(name: str, c: ContactState) -> _Findings:
    """A contact presses and never pulls; its force is no more than the integral of its pressure, whose centre is no
    farther than a facet from the points, and whose second moment is that of a distribution."""
    total = float(c.areas @ c.pressure)
    top = max(c.normal_force, 1e-12)  # an open contact has none
    deepest = 1e-4 * max(
        abs(c.interference), _largest(c.gap), 1e-9
    )  # m, of what the contact moves by
    resultant = abs(float(np.linalg.norm(c.force)) - c.normal_force) / top
    yield (
        f"contact {name}: no pressure is negative",
        max(-float(c.pressure.min(initial=0.0)), 0.0),
        0.0,
        "",
    )
    yield f"contact {name}: normal force is the resultant", resultant, 1e-9, ""
    yield (
        f"contact {name}: pressure adds up to the force",
        max(c.normal_force - total, 0.0) / top,
        1e-9,
        "",
    )
    yield f"contact {name}: penetration", c.penetration, deepest, ""
    yield (
        f"contact {name}: share that is closed",
        max(-c.closed_share, c.closed_share - 1.0, 0.0),
        1e-9,
        "",
    )
    yield (
        f"contact {name}: centre is on the face",
        _beyond(c),
        float(np.sqrt(c.areas.max(initial=0.0))),
        "",
    )
    if c.spread is not None:
        yield from _spread_checks(name, c.spread)


def _beyond(c: ContactState) -> float:
    """m, by which the centre of the pressure is outside the box of the face's points."""
    low, high = c.points.min(axis=0), c.points.max(axis=0)
    return float(np.maximum(low - c.centre, c.centre - high).max(initial=0.0))


def _spread_checks(name: str, spread: Array) -> _Findings:
    """A second moment is symmetric and has no negative principal value."""
    top = max(float(np.trace(spread)), 1e-300)
    least = float(np.linalg.eigvalsh((spread + spread.T) / 2)[0])
    yield f"contact {name}: spread is symmetric", _largest(spread - spread.T) / top, 1e-9, ""
    yield f"contact {name}: spread is that of a pressure", max(-least, 0.0) / top, 1e-9, ""


def _compliance_checks(g: ModalGroup) -> _Findings:
    T = _all_rows(g)
    if T is None:
        yield (
            "compliance rows are stored",
            1.0,
            0.0,
            "a label names a row that the file does not hold",
        )
    if T is None or not len(T):
        return
    modal = held(T, g.compliance.labels, g.kind, g.K_r, g.omega, g.to_diagonal)
    static = g.compliance.static
    d = np.sqrt(np.maximum(np.diag(static).real, 1e-300))
    size = np.outer(
        *[np.maximum(d, SMALL * _largest(d))] * 2
    )  # metres and radians stand side by side
    yield (
        "modal compliance follows from the rows",
        _largest((modal - g.compliance.modal) / size),
        1e-9,
        "",
    )
    yield "static compliance is symmetric", _largest((static - static.conj().T) / size), 1e-9, ""
    for part, what in (
        (g.compliance.modal, "its modal part"),
        (g.compliance.plain, "that of the eigenmodes alone"),
    ):
        scaled = (static - part) / np.outer(d, d)
        worst = float(np.linalg.eigvalsh(scaled).min()) if np.isfinite(scaled).all() else -np.inf
        yield f"static compliance is not below {what}", max(-worst, 0.0), 1e-6, ""
    if set(g.kind) <= {"rigid", "normal"}:
        error = _largest(g.compliance.plain - g.compliance.modal) / max(_largest(modal), 1e-300)
        yield "eigenmodes alone hold what they hold", error, 1e-9, ""


def _all_rows(g: ModalGroup) -> Array | None:
    """Rows in the order of the compliance labels, or None if one of them is not stored."""
    parts = []
    for label in g.compliance.labels:
        try:
            parts.append(compliance_row(g, label))
        except (ValueError, KeyError):
            return None
    return np.array(parts).reshape(len(parts), g.n_modes)

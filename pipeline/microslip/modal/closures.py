"""Closures and bolts of a body file: pairs of faces for Newton, preloads, and what the static state made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..data import Array, ContactState, Indices, Material, Mesh
from ..errors import UserError
from ..fem.contact import ContactPair, Grip, Plane, gap_at, make_pair, node_values
from ..fem.discretise import face_blocks, quadrature
from ..fem.loads import traction
from ..linalg.direct import DirectSolver
from ..progress import Report
from ..settings.body import GROUND, BodySettings, Closure
from .boundary import require_face
from .equilibrium import BodyModel, StaticState, equilibrium


def contact_pairs(mesh: Mesh, settings: BodySettings, materials: Sequence[Material]) -> tuple[ContactPair, ...]:
    """The faces that may touch.

    Raises:
        UserError: missing faces, faces that do not face each other, an unknown number of sectors.
    """
    modulus = max(float(m.elasticity.diagonal()[:3].max()) for m in materials)
    return tuple(_pair(mesh, settings, c, modulus) for c in settings.closures)


def _pair(mesh: Mesh, settings: BodySettings, c: Closure, modulus: float) -> ContactPair:
    require_face(mesh, c.face, f"closures.{c.name}.face")
    if c.against == GROUND:
        other: str | Plane = _ground(mesh, c)
    else:
        require_face(mesh, c.against, f"closures.{c.name}.against")
        other = c.against
    _refuse_absurd(mesh, c)
    axis, about = np.array(settings.rotation.axis), np.array(settings.rotation.point)
    angle = 2 * np.pi * c.sector_shift / sector_count(settings, c) if c.sector_shift else 0.0
    return make_pair(
        mesh, c.name, c.face, other, modulus, turned(axis, angle), about, c.interference, c.penalty, c.slide,
        c.modes == "closed",
    )  # fmt: skip


ROOM = 0.05
"""Interference over the body's extent beyond which nothing is solved: a strain that no elastic solid survives."""


def _refuse_absurd(mesh: Mesh, c: Closure) -> None:
    """Before Newton tries for minutes: an interference of the size of the body, or of the face, is a wrong unit."""
    body = float(np.ptp(mesh.points, axis=0).max())
    face = float(np.linalg.norm(np.ptp(mesh.points[mesh.face_points(c.face)], axis=0)))
    if c.interference > min(ROOM * body, 0.5 * face):
        raise UserError(
            f"closures.{c.name}.interference: {c.interference:.3g} m is too much for a body of {body:.3g} m and a face "
            f"of {face:.3g} m; correct it (it is in length_unit)"
        )


def _facets(mesh: Mesh, face: str) -> tuple[Array, Array, Array]:
    """Points (n, 3) of a face, m, their areas (n,), m2, and the sum (3,) of these along the outward normals."""
    blocks = face_blocks(mesh, face)
    vectors = np.concatenate([b.area.reshape(-1, 3) for b in blocks])
    points = np.concatenate([b.points.reshape(-1, 3) for b in blocks])
    return points, np.linalg.norm(vectors, axis=1), vectors.sum(axis=0)


def _ground(mesh: Mesh, c: Closure) -> Plane:
    points, areas, mean = _facets(mesh, c.face)
    if c.normal is None and np.linalg.norm(mean) < 1e-6 * areas.sum():
        raise UserError(f"closures.{c.name}: face '{c.face}' closes on itself; give the ground's normal and point")
    normal = np.array(c.normal) if c.normal is not None else -mean
    point = np.array(c.point) if c.point is not None else areas @ points / areas.sum()
    return Plane(point, normal / np.linalg.norm(normal))


def sector_count(settings: BodySettings, c: Closure) -> float:
    """N of ``[cyclic]``, or the build file's parameter ``blades``."""
    if settings.cyclic is not None:
        return settings.cyclic.sectors
    blades = settings.geometry.parameters.get("blades")
    if isinstance(blades, int | float) and blades >= 2:
        return float(blades)
    raise UserError(
        f"closures.{c.name}.sector_shift: the number of sectors is not known; give [cyclic] sectors, or the geometry "
        "parameter blades"
    )


def turned(axis: Array, angle: float) -> Array:
    """(3, 3) rotation about an axis by an angle in rad."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()


def bolt_forces(mesh: Mesh, settings: BodySettings) -> Array:
    """(n, 3) forces of the bolts' preloads, N: uniform under head and nut, along the bolt, of fixed direction.

    Raises:
        UserError: missing faces; faces under head and nut that a bolt would not press together.
    """
    force = np.zeros((mesh.n_points, 3))
    for bolt in settings.bolts:
        key = f"bolts.{bolt.name}"
        require_face(mesh, bolt.face, f"{key}.face")
        head, normal, area = _seat(mesh, bolt.face, key)
        along = -normal  # the way the head pushes
        if bolt.against != GROUND:
            require_face(mesh, bolt.against, f"{key}.against")
            nut, nut_normal, nut_area = _seat(mesh, bolt.against, key)
            along = (nut - head) / max(float(np.linalg.norm(nut - head)), 1e-300)
            if normal @ nut_normal > -0.9 or along @ normal > -0.9:
                raise UserError(
                    f"{key}: face '{bolt.face}' under the head and face '{bolt.against}' under the nut are not pressed "
                    "together by a bolt (their outward normals must point away from each other, along the bolt); "
                    "correct the faces"
                )
            force += traction(face_blocks(mesh, bolt.against), mesh.n_points, -bolt.preload / nut_area * along)
        force += traction(face_blocks(mesh, bolt.face), mesh.n_points, bolt.preload / area * along)
    return force


def _seat(mesh: Mesh, face: str, key: str) -> tuple[Array, Array, float]:
    """Area centre (3,), mean outward normal (3,), area of a face."""
    points, areas, mean = _facets(mesh, face)
    if np.linalg.norm(mean) < 0.9 * areas.sum():
        raise UserError(f"{key}: face '{face}' is not flat enough to seat a bolt; name the ring under the head")
    return areas @ points / areas.sum(), mean / np.linalg.norm(mean), float(areas.sum())


def contact_states(mesh: Mesh, settings: BodySettings, grips: tuple[Grip, ...]) -> dict[str, ContactState]:
    """What the modal file keeps of every closure, by name."""
    by_name = {c.name: c for c in settings.closures}
    of_face = {i.face: i.name for i in reversed(settings.interfaces) if i.role != "load"}
    return {g.pair.name: _state(mesh, by_name[g.pair.name], of_face, g) for g in grips}


def _state(mesh: Mesh, c: Closure, of_face: dict[str, str], g: Grip) -> ContactState:
    points, areas, _ = _facets(mesh, c.face)
    places: list[tuple[str, Indices, Array]] = [(t, f, quadrature(t)[0]) for t, f in mesh.faces[c.face].items()]
    force = g.slave_force.sum(axis=0)
    weight = g.point_weight * g.point_pressure
    total = float(weight.sum())
    pressed = np.concatenate([np.einsum("pk,pki->pi", p.N, mesh.points[p.slave]) for p in g.cut.points])
    centre = weight @ pressed / total if total > 0 else areas @ points / areas.sum()
    spread = (weight * (pressed - centre).T) @ (pressed - centre) / total if total > 0 else None
    pressure = node_values(g.pair, g.pressure, places)
    pressure *= total / (areas @ pressure) if total > 0 else 0.0  # the points' rule misses kinks inside a facet
    return ContactState(
        face=c.face, against=c.against, sector_shift=c.sector_shift, interface=of_face.get(c.face, ""),
        normal_force=float(np.linalg.norm(force)), force=force, centre=centre, points=points, areas=areas,
        pressure=pressure, gap=gap_at(g, places),
        closed_share=float(g.area[g.pressure > 0].sum() / areas.sum()), penetration=g.penetration,
        penalty=float(g.pair.penalty.max()), interference=c.interference, modes=c.modes, spread=spread,
    )  # fmt: skip


@dataclass(frozen=True)
class ContactCurve:
    """Normal force over approach of two faces, everything else held (Sextro 3.1: stiffness from a static model).

    Attributes:
        approach: (k,) m, interference of each level. force: (k,) N. closed_share: (k,) share of the area in contact.
    """

    approach: Array
    force: Array
    closed_share: Array

    @property
    def stiffness(self) -> Array:
        """(k,) N/m, dF / d approach: differences of second order between the levels."""
        return np.gradient(self.force, self.approach)

    @property
    def columns(self) -> dict[str, Array]:
        """Column -> (k,) values."""
        found = {"approach_m": self.approach, "normal_force_N": self.force, "stiffness_N_per_m": self.stiffness}
        return {**found, "closed_share": self.closed_share}


def contact_curve(
    model: BodyModel, name: str, approaches: Array, solver: DirectSolver, speed: float = 0.0,
    report: Report = lambda _: None,
) -> ContactCurve:  # fmt: skip
    """Press the contact `name` by rising interferences (k,) m, k >= 2, and record its force.

    The stiffness is that of the faces and of whatever yields between them and the supports: hold the body near the
    contact for the local part alone. Where a basis holds static compliance, that part must not be counted again.

    Raises:
        UserError: no such contact, fewer than two levels. NotConverged: no equilibrium at a level.
    """
    number = next((i for i, p in enumerate(model.contacts) if p.name == name), None)
    if number is None or len(approaches) < 2:
        raise UserError(f"closures.{name}: the curve needs a closure of that name and two or more approaches")
    force, share = [], []
    state: StaticState | None = None
    for approach in approaches:
        pairs = list(model.contacts)
        pairs[number] = replace(pairs[number], interference=float(approach))
        state = equilibrium(replace(model, contacts=tuple(pairs)), speed, "nonlinear", solver, state)
        g = state.contacts[number]
        force.append(float(np.linalg.norm(g.slave_force.sum(axis=0))))
        share.append(float(g.area[g.pressure > 0].sum() / max(g.area.sum(), 1e-300)))
        report(f"approach {approach:.4g} m: {force[-1]:.4g} N, {100 * share[-1]:.3g} % of the face in contact")
    return ContactCurve(np.asarray(approaches, dtype=float), np.array(force), np.array(share))

"""Interfaces, excitations, monitors and gauges of a body file as rows on its mesh, and reduced by its shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..data import CENTRIFUGAL, INTERFACE_ROWS, Array, Interface, Mesh, Rows
from ..errors import UserError
from ..fem.discretise import face_blocks
from ..fem.loads import centrifugal, pressure, traction
from ..settings.body import BodySettings, Excitation, InterfaceSettings, Monitor
from .boundary import AXES, require_face
from .equilibrium import BodyModel, StaticState
from .rows import Location, Locator, NodeLocator, Patch, at_node, node_patch, patch, point_rows, slope_rows, turning_row
from .singular import Zones, singular_zones


@dataclass(frozen=True)
class NamedRows:
    """Rows B (r, 3n) with their labels. distance: m, of the point from the place asked for. direction: of a gauge,
    whose B holds the three rows of the slope along it."""

    B: sp.csr_matrix
    labels: tuple[str, ...]
    unit: str
    point: Array
    distance: float = 0.0
    direction: Array | None = None


@dataclass(frozen=True)
class BodyRows:
    """All rows of a body's settings on nodal displacements, by name. zones: where the stress is a property of the
    mesh."""

    settings: BodySettings
    patches: Mapping[str, Patch]
    excitations: Mapping[str, NamedRows]
    monitors: Mapping[str, NamedRows]
    gauges: Mapping[str, NamedRows]
    zones: Zones = field(default_factory=Zones)

    @cached_property
    def stacked(self) -> tuple[sp.csr_matrix, tuple[str, ...]]:
        """Every interface (but load faces), excitation and monitor row, for the static compliance."""
        parts: list[sp.csr_matrix] = []
        labels: list[str] = []
        for item in self.settings.interfaces:
            if item.role != "load":
                parts.append(self.patches[item.name].B)
                labels += [f"interface:{item.name}:{c}" for c in INTERFACE_ROWS]
                if (more := self.patches[item.name].characteristic) is not None:
                    parts.append(more)
                    labels += [f"interface:{item.name}:c{i + 1}" for i in range(more.shape[0])]
        for kind, named in (("excitation", self.excitations), ("monitor", self.monitors)):
            for name, rows in named.items():
                parts.append(rows.B)
                labels += [f"{kind}:{name}:{label}" for label in rows.labels]
        return sp.vstack(parts).tocsr() if parts else sp.csr_matrix((0, 0)), tuple(labels)


def body_rows(mesh: Mesh, settings: BodySettings) -> BodyRows:
    """Rows of all interfaces, excitations, monitors and gauges of the settings on a mesh.

    Centrifugal excitations need the mass and are missing: see `with_centrifugal`.
    """
    patches = {item.name: _interface_patch(mesh, item) for item in settings.interfaces}
    for e in settings.excitations:
        if e.face is not None:
            require_face(mesh, e.face, f"excitations.{e.name}.face", not mesh.cells)
            if e.face not in patches and e.face in mesh.faces:
                patches[e.face] = _load_patch(mesh, e.face)
    locator = Locator(mesh) if mesh.cells else NodeLocator(mesh)
    excitations = {e.name: _excitation(mesh, locator, e) for e in settings.excitations if not e.centrifugal}
    monitors = {m.name: _monitor(mesh, locator, m) for m in settings.monitors}
    gauges = {}
    for g in settings.gauges:
        place, direction = locator.find(np.array(g.point), f"gauges.{g.name}.point"), _unit(g.direction)
        slopes = slope_rows(mesh.n_points, place, direction)
        gauges[g.name] = NamedRows(slopes, ("strain",), "1", place.point, place.distance, direction)
    return BodyRows(settings, patches, excitations, monitors, gauges, singular_zones(mesh, settings))


def _unit(direction: Sequence[float] | None) -> Array:
    vector = np.array(direction)
    return vector / np.linalg.norm(vector)


def with_centrifugal(rows: BodyRows, model: BodyModel) -> BodyRows:
    """The rows with those of centrifugal excitations: forces per (rad/s)^2 on the body as drawn."""
    asked = rows.settings.excitations
    if not any(e.centrifugal for e in asked):
        return rows
    points, M = model.d.mesh.points, model.M_full
    force = centrifugal(M, points, model.axis, model.point).reshape(1, -1)
    centre = (M @ points).sum(axis=0) / M.sum()
    whole = NamedRows(sp.csr_matrix(force), ("centrifugal",), CENTRIFUGAL, centre)
    return replace(rows, excitations={e.name: whole if e.centrifugal else rows.excitations[e.name] for e in asked})


def _interface_patch(mesh: Mesh, item: InterfaceSettings) -> Patch:
    """Of a face by its area; of a list of nodes, where the body has no elements, evenly."""
    require_face(mesh, item.face, f"interfaces.{item.name}.face", points_suffice=not mesh.cells)
    t2 = None if item.t2 is None else np.array(item.t2)
    if item.face in mesh.faces:
        return patch(mesh, item.face, t2, item.name)
    normal = None if item.normal is None else np.array(item.normal)
    return node_patch(mesh, item.face, t2, normal, item.name)


def _place(mesh: Mesh, locator: Locator | NodeLocator, item: Excitation | Monitor, key: str) -> Location:
    """Where a load or monitor acts: at a point of space, or at a node by its number."""
    if item.node is None:
        return locator.find(np.array(item.point), f"{key}.point")
    found = np.flatnonzero(mesh.node_id == item.node)
    if not len(found):
        raise UserError(f"{key}.node: the body has no node {item.node}; correct the number")
    return at_node(mesh, int(found[0]))


def _load_patch(mesh: Mesh, face: str) -> Patch:
    """The points, areas and shapes of a load face; a face that closes on itself keeps the body's axes as frame."""
    blocks = face_blocks(mesh, face)
    mean = np.sum([b.area.sum(axis=(0, 1)) for b in blocks], axis=0)
    hint = np.eye(3)[int(np.abs(mean).argmin())]
    return patch(mesh, face, hint, face, needs_frame=False)


def _monitor(mesh: Mesh, locator: Locator | NodeLocator, m: Monitor) -> NamedRows:
    n = mesh.n_points
    if m.points is not None:
        places = [locator.find(np.array(at), f"monitors.{m.name}.points") for at in m.points]
        middle, distance = np.mean([p.point for p in places], axis=0), max(p.distance for p in places)
        return NamedRows(turning_row(n, places, np.array(m.axis), m.name), ("phi",), "rad", middle, distance)
    place = _place(mesh, locator, m, f"monitors.{m.name}")
    labels = tuple(f"u_{c}" for c in m.directions)
    B = point_rows(n, place, np.eye(3)[[AXES[c] for c in m.directions]])
    return NamedRows(B, labels, "m", place.point, place.distance)


def _excitation(mesh: Mesh, locator: Locator | NodeLocator, e: Excitation) -> NamedRows:
    """A force at a point, a pressure or a force on a face, or one in equal parts on a list of nodes."""
    n = mesh.n_points
    if e.face is not None and e.face in mesh.faces:
        blocks = face_blocks(mesh, e.face)
        sizes = [np.linalg.norm(b.area, axis=2) for b in blocks]
        total = sum(s.sum() for s in sizes)
        centre = sum(np.einsum("fq,fqi->i", s, b.points) for s, b in zip(sizes, blocks, strict=True)) / total
        if e.pressure:
            return NamedRows(sp.csr_matrix(pressure(blocks, n).reshape(1, -1)), ("pressure",), "Pa", centre)
        force = traction(blocks, n, _unit(e.direction) / total)
        return NamedRows(sp.csr_matrix(force.reshape(1, -1)), ("force",), "N", centre)
    if e.face is None:
        place = _place(mesh, locator, e, f"excitations.{e.name}")
    else:
        if e.pressure:
            raise UserError(
                f"excitations.{e.name}.pressure: a list of nodes has no facets to press on; give a direction"
            )
        nodes = mesh.face_points(e.face)
        shares = np.full(len(nodes), 1 / len(nodes))
        place = Location(nodes, shares, np.zeros((3, 1)), mesh.points[nodes].mean(axis=0), 0.0)
    B = point_rows(n, place, _unit(e.direction)[None])
    return NamedRows(B, ("force",), "N", place.point, place.distance)


def reduced_interfaces(rows: BodyRows, phi: Array, shapes: Array) -> dict[str, Interface]:
    described = {i.name: i for i in rows.settings.interfaces}
    out = {}
    for name, p in rows.patches.items():
        item, none = described.get(name), np.zeros((0, phi.shape[1]))
        role = (item.role, item.partner, item.sector_shift) if item else ("load", "", 0)
        out[name] = Interface(
            p.origin, p.rotation, np.asarray(p.B @ phi), p.fit_residual(shapes), p.points, p.areas, p.normals,
            p.moved(shapes) if rows.settings.output.patch_shapes else np.zeros((0, 3, phi.shape[1])),
            *role, p.extent, p.polygon,
            none if p.characteristic is None else np.asarray(p.characteristic @ phi), p.pattern,
        )  # fmt: skip
    return out


def reduced_rows(named: NamedRows, phi: Array, u: Array | None) -> Rows:
    static = np.zeros(len(named.labels)) if u is None else np.asarray(named.B @ u)
    return Rows(np.asarray(named.B @ phi), named.labels, named.unit, named.point, named.distance, static)


def reduced_gauge(named: NamedRows, phi: Array, state: StaticState) -> Rows:
    """Strain along the gauge: of the static state, and its change per unit coordinate (`slope_rows`)."""
    assert named.direction is not None
    slope = np.asarray(named.B @ state.u.reshape(-1))
    along = named.direction if state.H is None else named.direction + slope
    strain = named.direction @ slope + (0.5 * slope @ slope if state.prestress == "nonlinear" else 0.0)
    row = along @ np.asarray(named.B @ phi)
    return Rows(row[None], named.labels, named.unit, named.point, named.distance, np.array([strain]))

"""The static step of a file: from positions, corners and numbers of the file to its mesh, in SI."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from ..data import Array, BodyLoad, FacetLoad, Indices, Mesh, NodalLoad, SpinLoad, StaticStep
from ..topology import CELL_TYPES, FACET_CORNERS
from ..units import in_si
from .raw import Numbering, RawMesh, joined

Terms = dict[tuple[str, int, int], tuple[float, str]]
"""Kind of a nodal load, number of a node and direction (0 to 5) -> amount, place in the file."""


def nodal_loads(
    raw: RawMesh, terms: Terms, axes: Mapping[int, Array], numbering: Numbering
) -> Iterator[NodalLoad]:
    """Forces and displacements of nodes by the places where they are written, along the axes of the body.

    Args:
        axes: node number -> (3, 3) rows x, y, z of its directions, where these are not the body's.

    Raises:
        Damaged: a node that is not there.
    """
    by_place: dict[tuple[str, str], list[tuple[int, int, float]]] = {}
    for (kind, node, way), (amount, where) in terms.items():
        turn = axes.get(node)
        if not amount:
            continue
        if turn is not None and kind == "displacement":
            raw.lost.append(f"{where} moves node {node} along a local direction, which is not read")
            continue
        parts = np.eye(3)[way % 3] * amount if turn is None else amount * turn[way % 3]
        into = by_place.setdefault((kind, where), [])
        into += [(node, way // 3 * 3 + int(j), float(parts[j])) for j in np.flatnonzero(parts)]
    for (kind, where), rows in by_place.items():
        nodes, ways, amounts = map(np.array, zip(*rows, strict=True))
        yield NodalLoad(where, kind, numbering.positions(nodes, f"{where} names"), ways, amounts)


def facet_loads(
    facets: Mapping[tuple[int, ...], tuple[float | Array, str]], inside: bool = False
) -> Iterator[FacetLoad]:
    """Pressures by the places where they are written.

    Args:
        facets: corners, by positions -> amount on all of the facet or at each corner, place.
        inside: see `FacetLoad`.
    """
    by_place: dict[tuple[str, int], list[tuple[tuple[int, ...], Array]]] = {}
    for corners, (amount, where) in facets.items():
        values = np.broadcast_to(amount, len(corners))
        by_place.setdefault((where, len(corners)), []).append((corners, values))
    for (where, _), sides in by_place.items():
        values = np.array([a for _, a in sides])
        yield FacetLoad(where, np.array([c for c, _ in sides]), values, inside=inside)


def state_of(
    raw: RawMesh, mesh: Mesh, number: Indices, boundary: Mapping[str, Indices], metres: float, system: str | None
) -> StaticStep | None:  # fmt: skip
    """The static step on the mesh; what of it finds no place there is added to `raw.lost`.

    Args:
        mesh: with its links. number: (n,) points of the file's nodes, -1 of those that no cell uses. boundary: facets
            of the surface. metres: of the unit of coordinates. system: of units, None if unknown.
    """
    if (step := raw.state) is None:
        return None
    if system is None:
        text = "its loads are in units that are not known; write material.units, or use m or mm"
        raw.lost.append(f"{step.where}: {text}")
        return None
    loads: list[NodalLoad | FacetLoad | BodyLoad | SpinLoad] = []
    for load in step.loads:
        if isinstance(load, NodalLoad):
            loads += _nodal(raw, mesh, load, number, metres, system)
        elif isinstance(load, FacetLoad):
            loads += _facets(raw, mesh, replace(load, facets=number[load.facets]), boundary, system)
        elif isinstance(load, BodyLoad):
            acceleration = in_si(np.asarray(load.acceleration, dtype=float), system, length=1, time=-2)
            loads.append(replace(load, acceleration=acceleration, cells=_cells(mesh, load.cells)))
        else:
            speed, point = in_si(load.speed, system, time=-1), metres * np.asarray(load.point, dtype=float)
            cells = _cells(mesh, load.cells)
            cells = None if cells is None or cells.all() else cells
            loads.append(replace(load, speed=float(speed), point=point, cells=cells))
    held = step.supports
    if held is not None:
        there = {*mesh.point_sets, *(mesh.links.sets if mesh.links else ())}
        held = {name: ways for name, ways in held.items() if name in there}
    return replace(step, loads=tuple(loads), supports=held)


def _nodal(
    raw: RawMesh, mesh: Mesh, load: NodalLoad, number: Indices, metres: float, system: str
) -> list[NodalLoad]:  # fmt: skip
    """The load on points, rotations on reference nodes, in SI."""
    nodes = number[load.nodes]
    references = {} if mesh.links is None else {int(n): j for j, n in enumerate(mesh.links.reference_id)}
    away = np.flatnonzero((nodes < 0) | (load.directions >= 3))
    for i in away:
        j = references.get(int(raw.node_id[load.nodes[i]]), -1)
        nodes[i] = -1 if j < 0 else mesh.n_points + j
    kept = nodes >= 0
    if not kept.all():
        first, what = raw.node_id[load.nodes[~kept][0]], "force" if load.kind == "force" else "displacement"
        raw.lost.append(
            f"{load.where}: a {what} acts on node {first}, which neither a solid cell nor a constraint "
            "uses: it is left out, so frequencies may differ"
        )
    turns = load.directions[kept] >= 3
    unit = np.where(turns, 1.0, metres)
    if load.kind == "force":
        unit = in_si(1.0, system, length=1, mass=1, time=-2) * np.where(turns, metres, 1.0)
    return [replace(load, nodes=nodes[kept], directions=load.directions[kept], values=load.values[kept] * unit)]


def _facets(
    raw: RawMesh, mesh: Mesh, load: FacetLoad, boundary: Mapping[str, Indices], system: str
) -> list[FacetLoad]:  # fmt: skip
    """Loads on whole facets of the surface, type by type; corner values follow their corners.

    Facets between cells are those of the cell that sees them in the other order of corners: a file
    gives a side's corners so that their normal points into its cell.
    """
    count, loads, left = load.facets.shape[1], [], np.ones(len(load.facets), dtype=bool)
    order = np.argsort(load.facets, axis=1)
    wanted = np.take_along_axis(load.facets, order, axis=1)
    values = np.broadcast_to(np.reshape(load.values, (len(wanted), -1)), wanted.shape)
    values = np.take_along_axis(values, order, axis=1) * in_si(1.0, system, length=-1, mass=1, time=-2)
    for kind, facets in boundary.items():
        if FACET_CORNERS[kind] != count:
            continue
        order = np.argsort(facets[:, :count], axis=1)
        place = {tuple(row): i for i, row in enumerate(np.take_along_axis(facets[:, :count], order, axis=1).tolist())}
        at = np.array([place.get(tuple(row), -1) for row in wanted.tolist()], dtype=np.int64)
        there = at >= 0
        if there.any():
            own = np.empty((int(there.sum()), count))
            np.put_along_axis(own, order[at[there]], values[there], axis=1)
            loads.append(replace(load, facets=facets[at[there]], values=own, kind=kind))
        left &= ~there
    if left.any() and load.inside:
        rest = np.flatnonzero(left)
        first = np.unique(np.sort(load.facets[rest], axis=1), axis=0, return_index=True)[1]
        for some in (rest[first], np.delete(rest, first)):  # of both sides one after the other
            inner = replace(load, facets=load.facets[some], values=load.values[some], inside=False)
            if len(some):
                loads += _facets(raw, mesh, inner, _seen_from_inside(mesh, inner.facets), system)
        return loads
    if left.any():
        raw.lost.append(
            f"{load.where}: {left.sum()} of {len(left)} loaded facets are not on the surface of the body: left out, so "
            "frequencies may differ"
        )
    return loads


def _seen_from_inside(mesh: Mesh, wanted: Indices) -> dict[str, Indices]:
    """Facets of cells, by type, whose corners run against those of the wanted ones (f, c)."""
    keys = {_turned_round(row[::-1]) for row in wanted.tolist()}
    found: dict[str, list[Indices]] = {}
    for kind, cells in mesh.cells.items():
        for side, name in zip(CELL_TYPES[kind].facets, CELL_TYPES[kind].facet_types, strict=True):
            count = FACET_CORNERS[name]
            corners = cells[:, list(side[:count])].tolist() if count == wanted.shape[1] else []
            chosen = [i for i, row in enumerate(corners) if _turned_round(row) in keys]
            if chosen:
                found.setdefault(name, []).append(cells[chosen][:, list(side)])
    return {name: np.concatenate(parts) for name, parts in found.items()}


def _turned_round(row: list[int]) -> tuple[int, ...]:
    """Corners from the least on, in their order."""
    first = row.index(min(row))
    return (*row[first:], *row[:first])


def _cells(mesh: Mesh, numbers: Indices | None) -> Array | None:
    """Whether each cell is chosen, type by type; None where the file names none."""
    return (
        None
        if numbers is None
        else np.isin(joined(mesh.cell_id[kind] for kind in mesh.cells), numbers)
    )

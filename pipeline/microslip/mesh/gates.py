"""What would spoil a solution: degenerate, inside-out, overlapping or unconnected cells, coincident points."""

from __future__ import annotations

from functools import partial

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..data import Array, FaceTie, Indices, Mesh
from ..topology import CELL_TYPES, FACET_CORNERS
from .raw import joined

_FIRST_ORDER = {"tetra", "hexahedron", "wedge", "pyramid"}
# corner -> its three neighbours, right-handed; of the cells with more corners than a tetrahedron
_NEIGHBOURS = {
    8: ((0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7), (4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3)),
    6: ((0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2)),
    5: ((0, 1, 3, 4), (1, 2, 0, 4), (2, 3, 1, 4), (3, 0, 2, 4)),
}


def mesh_problems(mesh: Mesh) -> tuple[list[str], list[str]]:
    """Look for what would spoil a solution: (errors, warnings), each a sentence without the file's name.

    Errors: coincident points, repeated points in a cell, inside-out cells (by their corners; curved cells are
    examined at the quadrature points when they are assembled). Warnings: a file without its end, what of it is not
    read, first-order cells, sets of facets that cannot serve as faces, parts that share no points
    (`modal.unconstrained` refuses those that nothing holds).
    """
    errors = [said for cell_type in mesh.cells if (said := _cell_problem(mesh, cell_type))]
    warnings = [
        f"first-order cells ({cell_type}) are too stiff in bending (frequencies can be tens of per cents high); use "
        "second-order ones"
        for cell_type in mesh.cells
        if cell_type in _FIRST_ORDER
    ]
    if mesh.unended:
        warnings.append(f"the file has {mesh.unended}, so it may be cut; write it again, or add that if it is whole")
    warnings += mesh.lost
    warnings += [
        f"{inside} of {count} facets of the set '{name}' are not on the surface of the volume mesh; it is no face"
        for name, (inside, count) in mesh.inner.items()
    ]
    size = np.ptp(mesh.points, axis=0).max()
    pairs = cKDTree(mesh.points).query_pairs(1e-9 * size, output_type="ndarray")
    pairs = pairs[~np.isin(pairs, _hanging(mesh)).any(axis=1)]
    pairs = pairs[np.isin(pairs, joined(c.ravel() for c in mesh.cells.values())).all(axis=1)]
    pairs = pairs[~_meant(mesh, pairs)]
    parts = part_numbers(mesh, tied=True)
    if not errors and (overlapping := _overlapping(mesh)):
        errors.append(f"{overlapping} facets belong to more than two cells, so cells overlap; remesh")
    torn = pairs[parts[pairs[:, 0]] == parts[pairs[:, 1]]]
    if len(torn):
        a, b = mesh.node_id[torn[0]]
        errors.append(
            f"{len(torn)} pairs of points coincide (first: nodes {a} and {b}), so neighbouring "
            "cells are not "
            "joined; merge duplicate nodes"
        )
    elif parts.max() > 0:
        warnings.append(_apart(mesh, parts, pairs))
    return errors, warnings


def _apart(mesh: Mesh, parts: Indices, pairs: Indices) -> str:
    """What is said of parts that share no points, and of points (p, 2) of theirs at the same
    places."""
    sizes = np.bincount(parts)
    counts = ", ".join(map(str, sizes[:6]))
    text = f"the mesh falls into {len(sizes)} parts that share no points ({counts} points)"
    if not len(pairs):
        return f"{text}; support each, press it by a closure, or join them"
    a, b = mesh.node_id[pairs[0]]
    return (
        f"{text}; where they touch ({len(pairs)} pairs of points, first: nodes {a} and {b}) they "
        "are neither welded "
        "nor in contact: merge these nodes where they should be one body, or import --apart for "
        "bodies in contact"
    )


def _cell_problem(mesh: Mesh, cell_type: str) -> str:
    """What is wrong with the cells of a type, or nothing."""
    cells, first = mesh.cells[cell_type], partial(_first, mesh, cell_type)
    repeated = (np.diff(np.sort(cells, axis=1), axis=1) == 0).any(axis=1)
    if repeated.any():
        return (
            f"{repeated.sum()} {cell_type} cells name a point twice (first: {first(repeated)}); they are "
            "degenerate, remesh"
        )
    with np.errstate(all="ignore"):  # cells of vanishing size
        volume = corner_volumes(mesh, cell_type)
    scale = np.abs(volume).mean()
    if (flat := ~(np.abs(volume) > 1e-9 * scale)).any():
        return f"{flat.sum()} {cell_type} cells have no volume (first: {first(flat)}); remesh"
    if (inverted := volume < 0).any():
        return (
            f"{inverted.sum()} of {len(cells)} {cell_type} cells are inside out (first: {first(inverted)}); "
            "the node order is not the one of the format, or the mesh is damaged"
        )
    return ""


def _overlapping(mesh: Mesh) -> int:
    """Number of facets that more than two cells share."""
    found = 0
    for corners in (3, 4):
        sides = [
            np.sort(cells[:, list(f[:corners])], axis=1)
            for cell_type, cells in mesh.cells.items()
            for f, kind in zip(CELL_TYPES[cell_type].facets, CELL_TYPES[cell_type].facet_types, strict=True)
            if FACET_CORNERS[kind] == corners
        ]
        if sides:
            found += int((np.unique(np.concatenate(sides), axis=0, return_counts=True)[1] > 2).sum())
    return found


def _first(mesh: Mesh, cell_type: str, mask: NDArray[np.bool_]) -> str:
    """The first of the chosen cells, by the file's number if it has one."""
    first = int(np.flatnonzero(mask)[0])
    return f"element {mesh.cell_id[cell_type][first]}" if cell_type in mesh.cell_id else str(first + 1)


def corner_volumes(mesh: Mesh, cell_type: str) -> Array:
    """(e,) six times the signed volume between a tetrahedron's corners, or the least such at a cell's corners."""
    p = mesh.points[mesh.cells[cell_type]]
    if CELL_TYPES[cell_type].corners == 4:
        return np.linalg.det(p[:, 1:4] - p[:, :1])
    corners = _NEIGHBOURS[CELL_TYPES[cell_type].corners]
    edges = (np.stack([p[:, j] - p[:, i] for j in others], axis=1) for i, *others in corners)
    return np.array([np.linalg.det(e) for e in edges]).min(axis=0)


def part_numbers(mesh: Mesh, tied: bool = False) -> Indices:
    """(n,) number of the connected part each point belongs to; tied: parts that ties join are one."""
    rows = np.concatenate([np.repeat(c[:, 0], c.shape[1] - 1) for c in mesh.cells.values()])
    cols = np.concatenate([c[:, 1:].ravel() for c in mesh.cells.values()])
    size = mesh.n_points
    if tied and mesh.ties is not None:
        link = mesh.ties.rows.tocoo()
        dof, n = link.col.astype(np.int64), 3 * mesh.n_points
        nodes = np.where(dof < n, dof // 3, mesh.n_points + (dof - n) // 6)
        size += len(mesh.ties.references) + link.shape[0]  # each equation joins what stands in it
        rows = np.concatenate([rows, size - link.shape[0] + link.row])
        cols = np.concatenate([cols, nodes])
    graph = sp.coo_matrix((np.ones(len(rows)), (rows, cols)), shape=(size, size))
    numbers = connected_components(graph, directed=False)[1][: mesh.n_points]
    solid = np.unique(np.concatenate([c.ravel() for c in mesh.cells.values()]))
    if mesh.lumps is not None and len(solid) < mesh.n_points:
        numbers = _with_lumps(mesh, numbers, solid)
    return np.unique(numbers, return_inverse=True)[1].astype(np.int64)


def _with_lumps(mesh: Mesh, numbers: Indices, solid: Indices) -> Indices:
    """Points without cells belong to a part that springs and links join them to, else to the first."""
    assert mesh.lumps is not None
    rows, cols = mesh.lumps.pairs.T
    size = mesh.n_points
    if mesh.ties is not None:
        link = mesh.ties.rows.tocoo()
        dof, n = link.col.astype(np.int64), 3 * size
        rows = np.concatenate([rows, np.where(dof < n, dof // 3, size + (dof - n) // 6)])
        size += len(mesh.ties.references) + link.shape[0]
        cols = np.concatenate([cols, size - link.shape[0] + link.row])
    graph = sp.coo_matrix((np.ones(len(rows)), (rows, cols)), shape=(size, size))
    group = connected_components(graph, directed=False)[1][: mesh.n_points]
    first = dict(zip(group[solid][::-1].tolist(), numbers[solid][::-1].tolist(), strict=True))
    numbers = numbers.copy()
    for point in np.setdiff1d(np.arange(mesh.n_points), solid):
        numbers[point] = first.get(int(group[point]), numbers[solid[0]])
    return numbers


def _hanging(mesh: Mesh) -> Indices:
    """Points that ties move: they may lie on others."""
    if mesh.ties is None:
        return np.zeros(0, dtype=np.int64)
    given = mesh.ties.dependent
    return np.unique(given[(given >= 0) & (given < 3 * mesh.n_points)] // 3)


def _meant(mesh: Mesh, pairs: Indices) -> NDArray[np.bool_]:
    """(p,) pairs of points that the file keeps apart: of two instances, of faces that it ties or lets touch."""
    of = np.full(mesh.n_points, -1)
    for number, points in enumerate(mesh.instances.values()):
        of[points] = number
    apart = (of[pairs] >= 0).all(axis=1) & (of[pairs[:, 0]] != of[pairs[:, 1]])
    ties = [item for item in (mesh.links.items if mesh.links else ()) if isinstance(item, FaceTie)]
    for names in [(tie.slave, tie.master) for tie in ties] + [(j.slave, j.master) for j in mesh.joints]:
        if {*names} <= {*mesh.faces, *mesh.point_sets}:
            one, other = (np.isin(pairs, mesh.set_points(name)) for name in names)
            apart |= (one & other[:, ::-1]).any(axis=1)
    return apart


def longest_over_shortest(mesh: Mesh) -> float:
    """Largest ratio, over all cells, of a cell's longest edge to its shortest."""
    worst = 1.0
    for cell_type, cells in mesh.cells.items():
        ends = mesh.points[cells[:, np.array(CELL_TYPES[cell_type].edges)]]
        length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
        worst = max(worst, float((length.max(axis=1) / np.maximum(length.min(axis=1), 1e-300)).max(initial=1.0)))
    return worst

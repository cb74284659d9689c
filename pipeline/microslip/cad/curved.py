"""Second-order elements that follow a curved surface and turn inside out on the way."""

from __future__ import annotations

import gmsh
import numpy as np

from microslip.errors import UserError

TETRA10 = 11  # gmsh's number of the element type
# corners of the edges on which gmsh's mid-side nodes 4..9 lie (the last two swapped against VTK)
EDGES = np.array([[0, 1], [1, 2], [2, 0], [3, 0], [3, 2], [3, 1]])
SMALLEST_JACOBIAN = 0.05  # of the straight-sided element; below it the mid-side nodes are straightened


def straighten(passes: int = 20) -> int:
    """Straighten the sides of second-order tetrahedra that are inverted or nearly so; returns how many.

    gmsh curves elements at the boundary without looking at their volume, and 1-2 % of them turn inside out.
    A moved node belongs to its neighbours too, hence the passes; periodic faces keep their match.
    """
    done: set[int] = set()
    partners = periodic_partners()
    for _ in range(passes):
        elements, nodes = tetrahedra()
        if not len(elements):
            return 0
        bad = np.flatnonzero(jacobian_ratio(elements, nodes) < SMALLEST_JACOBIAN)
        new = set(elements[bad].tolist())
        if new <= done:  # what is still bad has straight sides already: refuse_inverted() speaks
            break
        done |= new
        middles = set(nodes[bad, 4:].ravel().tolist())
        middles |= {q for p in middles for q in partners.get(p, ())}
        move_to_middle(middles, nodes)
    return len(done)


def tetrahedra() -> tuple[np.ndarray, np.ndarray]:
    """Tags (e,) and node tags (e, 10) of all second-order tetrahedra, gmsh's node order."""
    elements, nodes = gmsh.model.mesh.getElementsByType(TETRA10)
    return np.asarray(elements, int), np.asarray(nodes, int).reshape(-1, 10)


def node_table() -> np.ndarray:
    """Coordinates of all nodes, indexed by node tag."""
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    table = np.full((int(tags.max()) + 1, 3), np.nan)
    table[tags] = xyz.reshape(-1, 3)
    return table


def jacobian_ratio(elements: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Smallest Jacobian determinant inside each curved tetrahedron over that of the straight one, (e,)."""
    x = node_table()[nodes[:, :4]]
    straight = np.linalg.det(x[:, 1:] - x[:, :1])
    return np.asarray(gmsh.model.mesh.getElementQualities(elements, "minDetJac")) / np.abs(straight)


def move_to_middle(middles: set[int], nodes: np.ndarray) -> None:
    """Put mid-side nodes halfway between the two ends of their edge."""
    table = node_table()
    where = np.isin(nodes[:, 4:], list(middles))
    element, edge = np.nonzero(where)
    ends = nodes[element[:, None], EDGES[edge]]
    middle, first = np.unique(nodes[element, edge + 4], return_index=True)
    for tag, pair in zip(middle.tolist(), ends[first], strict=True):
        gmsh.model.mesh.setNode(tag, table[pair].mean(axis=0), [])


def periodic_partners() -> dict[int, set[int]]:
    """For each node on a periodic face the nodes that must move with it."""
    partners: dict[int, set[int]] = {}
    for dim, tag in gmsh.model.getEntities(1) + gmsh.model.getEntities(2):
        master, slaves, masters, _ = gmsh.model.mesh.getPeriodicNodes(dim, tag, includeHighOrderNodes=True)
        if master != tag:
            for a, b in zip(slaves.tolist(), masters.tolist(), strict=True):
                partners.setdefault(a, set()).add(b)
                partners.setdefault(b, set()).add(a)
    return partners


def refuse_inverted() -> None:
    """Every volume element must have a positive Jacobian at its nodes."""
    worst = 0
    for kind, elements in zip(*gmsh.model.mesh.getElements(3)[:2], strict=True):
        _, _, _, count, local, _ = gmsh.model.mesh.getElementProperties(kind)
        _, determinants, _ = gmsh.model.mesh.getJacobians(kind, np.ravel(local))
        worst += int((determinants.reshape(len(elements), count).min(axis=1) <= 0).sum())
    if worst:
        raise UserError(f"{worst} elements have no positive volume; choose a smaller mesh.size")

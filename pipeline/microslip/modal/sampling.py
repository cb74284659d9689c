"""A body seen at given points: its shapes interpolated inside its own cells, for comparisons of two meshes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..data import Array, Indices, Mesh, ModalBasis
from ..errors import UserError
from ..topology import CELL_TYPES
from .rows import Locator

MOST_POINTS = 400
"""Points at which two meshes are compared; MAC needs no more (each takes a millisecond or two to find)."""


def on_common_points(first: ModalBasis, second: ModalBasis) -> tuple[ModalBasis, ModalBasis]:
    """Both bodies at points they have in common, the shapes of one with cells interpolated there.

    Two meshes: up to `MOST_POINTS` nodes of the one with fewer. A mesh and a body that knows points only: those points,
    if they are no more and lie in the mesh (else both stay as they are, and the nearest nodes are for the comparison).

    Raises:
        UserError: one body is more than 2 % larger than the other or elsewhere; a node lies outside the other body by
            more than 2 % of its size.
    """
    if not is_solid(first) or not is_solid(second):
        return _at_points_of_the_other(first, second)
    if _same(first.mesh, second.mesh):
        return first, second
    _refuse_elsewhere(first, second)
    swapped = first.mesh.n_points > second.mesh.n_points
    few, many = (second, first) if swapped else (first, second)
    chosen = np.unique(np.linspace(0, few.mesh.n_points - 1, MOST_POINTS).round().astype(int))
    seen = at_nodes(few, chosen), at_points(many, few.mesh.points[chosen])
    return (seen[1], seen[0]) if swapped else seen


def _at_points_of_the_other(first: ModalBasis, second: ModalBasis) -> tuple[ModalBasis, ModalBasis]:
    for solid, points, order in ((first, second, 1), (second, first, -1)):
        if is_solid(solid) and not is_solid(points) and points.mesh.n_points <= MOST_POINTS:
            with suppress(UserError):
                return (at_points(solid, points.mesh.points), points)[::order]  # type: ignore[return-value]
    return first, second


def _refuse_elsewhere(first: ModalBasis, second: ModalBasis) -> None:
    boxes = [np.array([b.mesh.points.min(axis=0), b.mesh.points.max(axis=0)]) for b in (first, second)]
    if np.abs(boxes[0] - boxes[1]).max() > 0.02 * max(np.ptp(b, axis=0).max() for b in boxes):
        a, b = ("[" + " ".join(f"{x:.4g}" for x in box.ravel()) + "]" for box in boxes)
        raise UserError(
            f"'{first.name}' and '{second.name}' do not lie on each other: x y z from and to are {a} m and {b} m; "
            "give both the same frame and unit of length"
        )


def at_nodes(basis: ModalBasis, chosen: Indices) -> ModalBasis:
    """The body at some of its nodes, without cells; of its groups the shapes alone are cut."""
    numbers = basis.mesh.node_id[chosen] if len(basis.mesh.node_id) else chosen + 1
    mesh = Mesh(basis.mesh.points[chosen], {}, node_id=numbers)
    return _reshaped(basis, mesh, lambda phi: phi[chosen])


def at_points(basis: ModalBasis, points: Array) -> ModalBasis:
    """The body at points inside it (or on it, as near as two meshes of one surface come), without cells.

    Raises:
        UserError: a point lies outside by more than 2 % of the body's size.
    """
    locator = Locator(basis.mesh)
    found = [locator.find(p, f"'{basis.name}' at a node of the other body") for p in points]
    mesh = Mesh(np.array([f.point for f in found]), {}, node_id=np.arange(1, len(points) + 1))
    return _reshaped(basis, mesh, lambda phi: np.array([np.tensordot(f.N, phi[f.nodes], axes=1) for f in found]))


def _reshaped(basis: ModalBasis, mesh: Mesh, cut: Callable[[Array], Array]) -> ModalBasis:
    groups = {k: replace(g, phi=cut(g.phi) if len(g.phi) else g.phi) for k, g in basis.groups.items()}
    return replace(basis, mesh=mesh, groups=groups)


def is_solid(basis: ModalBasis) -> bool:
    """Whether it has cells, and not points alone, as measured modes have."""
    return any(kind in CELL_TYPES for kind in basis.mesh.cells)


def _same(a: Mesh, b: Mesh) -> bool:
    if a.points.shape != b.points.shape:
        return False
    return bool(np.allclose(a.points, b.points, rtol=0, atol=1e-9 * np.ptp(a.points)))

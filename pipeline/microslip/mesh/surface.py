"""The surface of a volume mesh, and the part of it that a set of facets or points picks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ..data import Indices, Mesh
from ..topology import CELL_TYPES, FACET_CORNERS


def boundary_facets(mesh: Mesh) -> dict[str, Indices]:
    """Facets that belong to one cell only, by type, in the order that makes the normal point outwards."""
    by_type: dict[str, list[Indices]] = {}
    for cell_type, cells in mesh.cells.items():
        kind = CELL_TYPES[cell_type]
        for facet, facet_type in zip(kind.facets, kind.facet_types, strict=True):
            by_type.setdefault(facet_type, []).append(cells[:, list(facet)])
    stacked = {t: np.concatenate(f) for t, f in by_type.items()}
    result = {}
    for corners in (3, 4):
        family = [t for t in stacked if FACET_CORNERS[t] == corners]
        if not family:
            continue
        keys = np.sort(np.concatenate([stacked[t][:, :corners] for t in family]), axis=1)
        _, inverse, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
        single = (count == 1)[inverse.ravel()]
        start = 0
        for t in family:
            chosen = single[start : start + len(stacked[t])]
            start += len(stacked[t])
            if chosen.any():
                result[t] = stacked[t][chosen]
    return result


def match_facets(boundary: Mapping[str, Indices], wanted: Iterable[Indices]) -> dict[str, Indices]:
    """Boundary facets whose corners are those of the wanted ones (which may be first order or turned)."""
    wanted = list(wanted)
    result = {}
    for facet_type, facets in boundary.items():
        corners = FACET_CORNERS[facet_type]
        keys = {tuple(row) for w in wanted if w.shape[1] == corners for row in np.sort(w, axis=1).tolist()}
        if not keys:
            continue
        chosen = [i for i, row in enumerate(np.sort(facets[:, :corners], axis=1).tolist()) if tuple(row) in keys]
        if chosen:
            result[facet_type] = facets[chosen]
    return result


def faces_from_points(boundary: Mapping[str, Indices], chosen: Indices, n_points: int) -> dict[str, Indices]:
    """Boundary facets that lie wholly in a set of points."""
    inside = np.zeros(n_points, dtype=bool)
    inside[chosen] = True
    result = {}
    for facet_type, facets in boundary.items():
        whole = inside[facets].all(axis=1)
        if whole.any():
            result[facet_type] = facets[whole]
    return result

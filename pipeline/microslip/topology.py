"""Cell types microslip assembles: their corner nodes, facets and node orders (all in VTK's order).

VTK's order equals meshio's, CalculiX's (C3D4, C3D6, C3D8, C3D10, C3D15, C3D20; the first triangle of a wedge looks
towards the second, as CalculiX has it) and, after a permutation found from the
reference coordinates, scikit-fem's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .data import Array

_TET_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
_HEX_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_TET_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
_HEX_CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float
)
# Corners of each facet, ordered so that the normal points out of the cell.
_TET_FACETS = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
_WEDGE_EDGES = ((0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5), (0, 3), (1, 4), (2, 5))
_WEDGE_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float)
_WEDGE_FACETS = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
_PYRAMID_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4))
_PYRAMID_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]])
_PYRAMID_FACETS = ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))
_HEX_FACETS = ((3, 0, 4, 7), (1, 2, 6, 5), (0, 1, 5, 4), (2, 3, 7, 6), (0, 3, 2, 1), (4, 5, 6, 7))


@dataclass(frozen=True)
class CellType:
    """One cell type. `reference` is (k, 3) in the unit tetrahedron, cube, wedge or pyramid; `facets`: local nodes."""

    name: str
    corners: int
    reference: Array
    edges: tuple[tuple[int, int], ...]
    facets: tuple[tuple[int, ...], ...]
    order: int

    @property
    def facet_types(self) -> tuple[str, ...]:
        """Type of each facet."""
        return tuple(_FACET_OF[len(f)] for f in self.facets)


_FACET_OF = {3: "triangle", 6: "triangle6", 4: "quad", 8: "quad8", 9: "quad9"}


def _quadratic_facets(
    facets: tuple[tuple[int, ...], ...], edges: tuple[tuple[int, int], ...], corners: int, centres: bool
) -> tuple[tuple[int, ...], ...]:
    result = []
    for number, facet in enumerate(facets):
        ring = [*facet, facet[0]]
        sides = [{a, b} for a, b in zip(ring[:-1], ring[1:], strict=True)]
        middle = tuple(corners + [set(e) for e in edges].index(side) for side in sides)
        centre = (corners + len(edges) + number,) if centres else ()
        result.append((*facet, *middle, *centre))
    return tuple(result)


def _midpoints(corners: Array, groups: tuple[tuple[int, ...], ...]) -> Array:
    return np.array([corners[list(g)].mean(axis=0) for g in groups])


def _cell_types() -> dict[str, CellType]:
    tet_mid = np.vstack([_TET_CORNERS, _midpoints(_TET_CORNERS, _TET_EDGES)])
    hex_mid = np.vstack([_HEX_CORNERS, _midpoints(_HEX_CORNERS, _HEX_EDGES)])
    hex_full = np.vstack([hex_mid, _midpoints(_HEX_CORNERS, _HEX_FACETS), [[0.5, 0.5, 0.5]]])
    tet_quad = _quadratic_facets(_TET_FACETS, _TET_EDGES, 4, False)
    hex_quad8 = _quadratic_facets(_HEX_FACETS, _HEX_EDGES, 8, False)
    hex_quad9 = _quadratic_facets(_HEX_FACETS, _HEX_EDGES, 8, True)
    wedge_mid = np.vstack([_WEDGE_CORNERS, _midpoints(_WEDGE_CORNERS, _WEDGE_EDGES)])
    wedge_quad = _quadratic_facets(_WEDGE_FACETS, _WEDGE_EDGES, 6, False)
    pyramid_mid = np.vstack([_PYRAMID_CORNERS, _midpoints(_PYRAMID_CORNERS, _PYRAMID_EDGES)])
    pyramid_quad = _quadratic_facets(_PYRAMID_FACETS, _PYRAMID_EDGES, 5, False)
    types = (
        CellType("tetra", 4, _TET_CORNERS, _TET_EDGES, _TET_FACETS, 1),
        CellType("tetra10", 4, tet_mid, _TET_EDGES, tet_quad, 2),
        CellType("hexahedron", 8, _HEX_CORNERS, _HEX_EDGES, _HEX_FACETS, 1),
        CellType("hexahedron20", 8, hex_mid, _HEX_EDGES, hex_quad8, 2),
        CellType("hexahedron27", 8, hex_full, _HEX_EDGES, hex_quad9, 2),
        CellType("wedge", 6, _WEDGE_CORNERS, _WEDGE_EDGES, _WEDGE_FACETS, 1),
        CellType("wedge15", 6, wedge_mid, _WEDGE_EDGES, wedge_quad, 2),
        CellType("pyramid", 5, _PYRAMID_CORNERS, _PYRAMID_EDGES, _PYRAMID_FACETS, 1),
        CellType("pyramid13", 5, pyramid_mid, _PYRAMID_EDGES, pyramid_quad, 2),
    )
    return {t.name: t for t in types}


CELL_TYPES = _cell_types()
"""Cell type name -> `CellType`, for every type that can be assembled."""

FACET_CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}
"""Facet type -> number of corner nodes."""

"""Any mesh file -> `Mesh`: named faces, unit of length, surface, quality gates. The only caller of meshio."""

from .gates import longest_over_shortest, mesh_problems, part_numbers
from .reading import UNITS, likely_unit, point_data, read_files, read_mesh, suffix_of, unit_of
from .surface import boundary_facets, faces_from_points

__all__ = [
    "UNITS",
    "boundary_facets",
    "faces_from_points",
    "likely_unit",
    "longest_over_shortest",
    "mesh_problems",
    "part_numbers",
    "point_data",
    "read_files",
    "read_mesh",
    "suffix_of",
    "unit_of",
]

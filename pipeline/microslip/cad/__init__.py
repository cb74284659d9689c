"""Meshing with gmsh: what every geometry/<body>/build.py shares, and the route of a user's own CAD file.

Only this package and the build files import gmsh, and they are always run as their own process:

    python geometry/blade/build.py SETTINGS OUT.msh      a body that draws itself
    python -m microslip.cad SETTINGS OUT.msh             STEP, BREP or IGES, faces picked by rules
    python -m microslip.cad --list FILE UNIT [OUT.npz]   table of solids and faces to choose from; triangles of them,
                                                         and behind OUT.npz the word coarse: fewer of them
    python -m microslip.cad --apart FILE FOLDER          every solid as a STEP file of its own
    python -m microslip.cad --touches UNIT FILE FILE...  where parts touch, as JSON

SETTINGS is a body file (.toml) or the same structure as .json. All lengths are in its `length_unit`, those of
the mesh too. A failure is one sentence on stderr and exit code 2, and leaves no file.
"""

from microslip.cad.curved import straighten
from microslip.cad.drawing import (
    boundary_surfaces,
    checked,
    finish,
    name_body,
    name_face,
    positive_size,
    run,
    surfaces_where,
    warn,
)
from microslip.cad.strips import round_section, strip_centre

__all__ = [
    "boundary_surfaces",
    "checked",
    "finish",
    "name_body",
    "name_face",
    "positive_size",
    "round_section",
    "run",
    "straighten",
    "strip_centre",
    "surfaces_where",
    "warn",
]

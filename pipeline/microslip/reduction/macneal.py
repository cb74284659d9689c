"""MacNeal's method: eigenmodes, and beside them the flexibility that they leave out.

R. H. MacNeal, Computers and Structures 1 (1971) 581. The residual attachment modes of every interface and load row
are no coordinates: with forces f on the rows the displacement is X q + W f, which makes Sextro Eq. (5.1-10) statically
exact without a new state. Their inertia is left out.
"""

from __future__ import annotations

from dataclasses import replace

from . import eigenmodes
from .problem import Reduced, Substructure


def reduce(problem: Substructure) -> Reduced:
    """The eigenmodes as they are, with the residual attachment modes beside."""
    return replace(eigenmodes.reduce(problem), residual=problem.residual(slice(None)))

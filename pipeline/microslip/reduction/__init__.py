"""Reduction methods behind one interface: which shapes, besides the lowest eigenmodes, span the motion of a body.

The book reduces with eigenmodes alone (Sextro section 2.4) and says itself that the number needed depends on the
problem. Every other method here makes the static answer to forces on the interface and load rows exact, so that
stiff contacts hold with few coordinates. A method is one file with one function ``reduce(Substructure) -> Reduced``
and one line in `METHODS`.
"""

from __future__ import annotations

from collections.abc import Callable

from . import craig_bampton, dual, eigenmodes, macneal, massless, rubin, stuck
from .problem import Reduced, Substructure

METHODS: dict[str, Callable[[Substructure], Reduced]] = {
    "eigenmodes": eigenmodes.reduce,
    "macneal": macneal.reduce,
    "rubin": rubin.reduce,
    "craig-bampton": craig_bampton.reduce,
    "dual-craig-bampton": dual.reduce,
    "massless-boundary": massless.reduce,
}
"""Method name -> function."""

__all__ = ["METHODS", "Substructure", "Reduced", "stuck"]

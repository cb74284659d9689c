"""Roots in their file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..files import hdf5
from .diagram import Diagram
from .spectrum import Spectrum


def write_roots(path: Path, found: Spectrum, over: Diagram | None, values: Mapping[str, float]) -> None:
    """Roots, their right and left vectors, and the roots over a range, as HDF5 with named dimensions.

    Raises:
        UserError: no permission, no space.
    """
    with hdf5.sealed(path) as file:
        file.attrs["format"], file.attrs["complete"] = "microslip-roots", int(found.complete)
        file.attrs["values"] = json.dumps(dict(values))
        where = file.create_group("roots")
        for name, column in found.columns.items():
            hdf5.put(where, name, np.array(column), dims=("root",))
        hdf5.put(where, "s", found.roots.s, "1/s", ("root",))
        for name, vectors in (("shape", found.roots.x), ("left", found.roots.y)):
            hdf5.put(where, name, vectors, dims=("coordinate", "root"))
        for name, column in over.columns.items() if over else ():
            hdf5.put(file.require_group("over"), name, column, dims=("row",))

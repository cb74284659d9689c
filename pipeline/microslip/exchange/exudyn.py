"""Exudyn: the .npz that its `ObjectFFRFreducedOrderInterface.LoadFromFile` reads (file version 1 of its FEM module).

The body enters a multibody system as an `ObjectFFRFreducedOrder`: elastic modes in a floating frame whose axes are
those of the mesh and whose origin is the reference point of the inertia integrals. The integrals are those of the
finite elements' mass matrix, so Exudyn needs neither mesh nor mass matrix. Damping is not in its file; the modal
ratios stand beside under ``microslip_damping_ratio``. Nothing in the file is pickled.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..data import Array, ModalBasis, ModalGroup
from ..files.store import complete_or_absent
from ..frames import skew
from ..mesh import boundary_facets
from .choice import STATEMENT, Format, body_in_motion, with_shapes
from .multibody import position_cross_shape, shape_cross_shape, tilde_tilde


def write_exudyn(basis: ModalBasis, path: Path | str) -> None:
    """Write one group at rest, complete or absent. Same basis, same bytes.

    Raises:
        UserError: see `choice.body_in_motion`; no shapes in the file, no permission, no space.
    """
    group = with_shapes(basis, body_in_motion(basis, "exudyn"), "exudyn")
    tables = exudyn_tables(basis, group)
    with complete_or_absent(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, **tables)  # numbers and texts: nothing to pickle


def exudyn_tables(basis: ModalBasis, g: ModalGroup) -> dict[str, Any]:
    """The entries of the file: Exudyn's own names, and what is ours under ``microslip_...``."""
    v = g.invariants
    assert v is not None
    m, n = g.n_modes, basis.mesh.n_points
    crossed = shape_cross_shape(v)  # (3, i, j)
    return {
        "fileVersion": 1,
        "type": "ObjectFFRFreducedOrderInterface",
        "rigidBodyNodeType": "NodeType.RotationEulerParameters",
        "infoList": np.array([m, n, 3, 4, 7, 7 + m]),
        "modeBasis": g.phi.reshape(3 * n, m),
        "xRef": (basis.mesh.points + g.u_static - v.point).ravel(),
        "trigList": _triangles(basis),
        "postProcessingModes": "",  # no stress modes; Exudyn looks for the word 'matrix' in it
        "massMatrixReduced": g.M_r,
        "stiffnessMatrixReduced": g.K_r,
        "Mtt": v.mass * np.eye(3),
        "totalMass": v.mass,
        "chiU": v.first_moment / v.mass,
        "chiUtilde": skew(v.first_moment / v.mass),
        "inertiaLocal": -tilde_tilde(v.second_moment),
        "mPsiTildePsi": -crossed.transpose(1, 0, 2).reshape(3 * m, m),
        "mPsiTildePsiTilde": _blocks(-tilde_tilde(v.shape_shape)),
        "mPhitTPsi": v.shape,
        "mPhitTPsiTilde": np.hstack([skew(s) for s in v.shape.T]),
        "mXRefTildePsi": -position_cross_shape(v),
        "mXRefTildePsiTilde": np.hstack(list(-tilde_tilde(v.position_shape))),
        "microslip_readme": f"{basis.name}: {STATEMENT}. Body frame: axes of the mesh, origin microslip_origin in it. "
        "Rows of modeBasis and xRef: x, y, z of each node in turn; phi^T M phi = 1.",
        "microslip_origin": v.point,
        "microslip_frequency": g.frequency,
        "microslip_damping_ratio": g.damping_ratio,
    }


def _blocks(A: Array) -> Array:
    """(3 m, 3 m) from (m, m, 3, 3): block (i, j) at rows 3 i, columns 3 j."""
    m = len(A)
    return A.transpose(0, 2, 1, 3).reshape(3 * m, 3 * m)


def _triangles(basis: ModalBasis) -> Array:
    """(t, 3) surface triangles by the corners of the facets, outwards."""
    found = []
    for kind, facets in boundary_facets(basis.mesh).items():
        found.append(facets[:, :3])
        if kind.startswith("quad"):
            found.append(facets[:, [0, 2, 3]])
    return np.concatenate(found) if found else np.zeros((0, 3), dtype=np.int64)


FORMATS = (Format("exudyn", "_exudyn.npz", "Exudyn", write_exudyn),)

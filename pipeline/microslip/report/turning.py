"""The modes of a body as data for a page on which they turn under the mouse and move."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from ..data import Array, Indices, Mesh, ModalBasis
from ..mesh import boundary_facets
from .page import Piece, draws_curves

MOST_MODES, MOST_VERTICES = 16, 20_000
"""Modes of a page that move, and vertices of an outside above which a page would be slow: pictures stand alone then."""

DRAWN = 0.08
"""Largest displacement of a mode as it is first shown, over the largest extent of the body."""

_FINEST = 32767
"""Coordinates are whole numbers up to this one: to 3e-5 of the largest."""


def turning_modes(basis: ModalBasis) -> Piece:
    """The first modes of the first group with elastic ones; nothing inside without cells, or without plotly.

    Args:
        basis: in modes, see `reduced.coordinates.basis_in_modes`.
    """
    group = basis.groups[min(basis.groups)]
    elastic = np.flatnonzero(group.omega > 0)[:MOST_MODES]
    if not basis.mesh.n_cells or not len(elastic) or not len(group.phi) or not draws_curves():
        return Piece("body", "")
    used, triangles, outline = outside(basis.mesh)
    if len(used) > MOST_VERTICES:
        return Piece("body", "")
    points = basis.mesh.points[used]
    modes = []
    for number in elastic.tolist():
        shape = group.phi[used, :, number]
        largest = np.linalg.norm(group.phi[:, :, number], axis=1).max()
        parts = [shape.real, shape.imag] if np.iscomplexobj(shape) and np.abs(shape.imag).max() > 0 else [shape.real]
        modes.append({
            "name": f"mode {number + 1}: {group.frequency[number]:.5g} Hz",
            "parts": [_packed(part / largest) for part in parts],
        })  # fmt: skip
    extent = float(np.ptp(points, axis=0).max())
    body: dict[str, Any] = {
        "points": _packed(points / (scale := float(np.abs(points).max()))), "scale": scale, "extent": extent,
        "triangles": _packed_numbers(triangles), "outline": _packed_numbers(outline), "modes": modes, "drawn": DRAWN,
    }  # fmt: skip
    title = f"Modes{' of a sector' if basis.sectors > 1 else ''}: turn with the mouse, choose a mode, let it move."
    return Piece("body", json.dumps(body), title)


def outside(mesh: Mesh) -> tuple[Indices, Indices, Indices]:
    """The outside of a mesh by the corners of its facets.

    Returns:
        (v,) mesh points that are its vertices; (t, 3) triangles and (s, 2) sides of elements where facets meet at a
        sharp angle, of vertices.
    """
    facets = [(nodes[:, :3] if kind.startswith("triangle") else nodes[:, :4])
              for kind, nodes in boundary_facets(mesh).items()]  # fmt: skip
    flat = [f[:, pick] for f in facets for pick in ([0, 1, 2], [0, 2, 3])[: f.shape[1] - 2]]
    used, local = np.unique(np.concatenate(flat), return_inverse=True)
    place = np.zeros(mesh.n_points, dtype=np.int64)
    place[used] = np.arange(len(used))
    sides, normals = [], []
    for f in facets:
        at = mesh.points[f]
        normal = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
        for i in range(f.shape[1]):
            sides.append(np.sort(f[:, [i, (i + 1) % f.shape[1]]], axis=1))
            normals.append(normal / np.linalg.norm(normal, axis=1, keepdims=True))
    pairs, which = np.unique(np.concatenate(sides), axis=0, return_inverse=True)
    total = np.zeros((len(pairs), 3))
    np.add.at(total, which.ravel(), np.concatenate(normals))
    sharp = np.linalg.norm(total, axis=1) < 2 * np.cos(np.radians(SHARP / 2))
    return used, local.reshape(-1, 3), place[pairs[sharp]]


SHARP = 35.0
"""Degrees between facets from which on an edge is drawn."""


def _packed(shares: Array) -> str:
    """Numbers between -1 and 1, as base64 of 16-bit integers."""
    return base64.b64encode(np.round(_FINEST * shares).astype("<i2").tobytes()).decode()


def _packed_numbers(numbers: Indices) -> str:
    return base64.b64encode(numbers.astype("<u2").tobytes()).decode()

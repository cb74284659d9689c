"""What a picture of a body carries for a page on which it turns under the mouse and moves."""

from __future__ import annotations

import base64
import json
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from ..data import Array, ComplexArray, Indices, Mesh, ModalBasis, ModalGroup
from ..mesh import boundary_facets
from ..modal.stress import von_mises
from ..units import rpm_text
from .scene import flat_triangles, sharp_edges

MOST_SHAPES, MOST_VERTICES = 16, 9_000
"""Shapes of a body, and vertices above which its outside is made coarser, so that a page stays quick."""

DRAWN = 0.08
"""Largest displacement as it is first shown, over the largest extent of the body."""

_FINEST = 32767
"""Coordinates are whole numbers up to this one: to 3e-5 of the largest."""


@dataclass(frozen=True)
class Turned:
    """A motion to be shown.

    Attributes:
        name: by which it is chosen. harmonics: (h, v, 3) of the displacement from rest at vertices, m or of any size:
            u = Re(sum of a_h exp(i h phase)), h from 1; None: those of the shape before.
        values: (v,) what colours it, else the displacement over its largest; label: of those, with their unit.
        sized: whether the harmonics are in m.
    """

    name: str
    harmonics: ComplexArray | None
    values: Array | None = None
    label: str = "displacement over its largest"
    sized: bool = False


@dataclass(frozen=True)
class Outside:
    """An outside by corners. source: (v,) mesh points, the vertices. triangles: (t, 3) and edges: (s, 2) of vertices,
    edges where facets meet at a sharp angle."""

    source: Indices
    triangles: Indices
    edges: Indices


def outside(mesh: Mesh, without: Collection[str] = ()) -> Outside:
    """The outside of a mesh, without the facets of some named faces."""
    facets = boundary_facets(mesh)
    triangles, facet = flat_triangles(facets, coarse=True)
    gone = {tuple(sorted(row)) for name in without if name in mesh.faces
            for f in mesh.faces[name].values() for row in f.tolist()}  # fmt: skip
    if gone:
        kept = [tuple(sorted(row)) not in gone for f in facets.values() for row in f.tolist()]
        triangles = triangles[np.array(kept)[facet]]
    used, local = np.unique(triangles, return_inverse=True)
    edges = np.searchsorted(used, sharp_edges(mesh.points, triangles))
    return Outside(used, local.reshape(-1, 3), edges)


def together(parts: Iterable[Outside]) -> Outside:
    """Several outsides as one; `source` then counts through them."""
    kept = list(parts)
    begins = np.cumsum([0, *(len(p.source) for p in kept)])
    triangles = [p.triangles + start for p, start in zip(kept, begins, strict=False)]
    edges = [p.edges + start for p, start in zip(kept, begins, strict=False)]
    return Outside(np.arange(begins[-1]), np.concatenate(triangles), np.concatenate(edges))


def turned(points: Array, skin: Outside, shapes: Sequence[Turned], title: str) -> str:
    """JSON for a page, see `report/templates/curves.html`; nothing without shapes.

    Args:
        points: (v, 3) of the vertices at rest, m.
    """
    if not len(shapes) or not len(points):
        return ""
    kept, triangles, edges = _coarser(points, skin)
    rest = points[kept] - points.mean(axis=0)
    extent, scale = float(np.ptp(rest, axis=0).max()), float(np.abs(rest).max())
    rows: list[dict[str, Any]] = []
    for shape in shapes:
        row: dict[str, Any] = {"name": shape.name, "label": shape.label}
        if shape.harmonics is not None:
            norms = np.linalg.norm(shape.harmonics, axis=(1, 2))
            swings = shape.harmonics[: int(np.flatnonzero(norms > 1e-3 * norms.max()).max(initial=0)) + 1]
            most = float(np.abs(swings).sum(axis=0).max()) or 1.0
            size = float(np.linalg.norm(swings[0], axis=1).max()) or most
            parts = [[_packed(part[kept] / most) for part in _real_and_imaginary(a)] for a in swings]
            row |= {"parts": parts, "most": most / size}
            row |= {"grown": DRAWN * extent / size} if shape.sized else {}
        if shape.values is not None:
            low, high = min(float(shape.values.min()), 0.0), float(shape.values.max())
            span = max(high - low, 1e-300)
            row |= {"low": low, "high": high, "values": _packed((shape.values[kept] - low) / span)}
        rows.append(row)
    body = {
        "title": escape(title),
        "points": _packed(rest / scale),
        "scale": scale,
        "extent": extent,
        "drawn": DRAWN,
        "shapes": rows,
        "triangles": _numbers(triangles),
        "outline": _numbers(edges),
        "colours": _stress_colours(),
    }
    return json.dumps(body, separators=(",", ":"))


def _stress_colours() -> list[tuple[float, str]]:
    """As in the pictures: share of the largest and colour."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [(share, to_hex(colormaps["turbo"](share))) for share in np.linspace(0, 1, 17).tolist()]


def _real_and_imaginary(a: ComplexArray) -> list[Array]:
    return [a.real, a.imag] if np.iscomplexobj(a) and a.imag.any() else [a.real]


def _coarser(points: Array, skin: Outside) -> tuple[Indices, Indices, Indices]:
    """Vertices that stay, triangles and edges of them."""
    if len(points) <= MOST_VERTICES:
        return np.arange(len(points)), skin.triangles, skin.edges
    import pyvista as pv

    data: Any = pv.PolyData.from_regular_faces(points, skin.triangles)
    data.point_data["vertex"] = np.arange(len(points))
    fewer = data.decimate_pro(1 - MOST_VERTICES / len(points), preserve_topology=True)
    at = np.asarray(fewer.point_data["vertex"], dtype=np.int64)
    kept = np.union1d(at, skin.edges.ravel()) if len(skin.edges) < MOST_VERTICES else np.unique(at)
    place = np.full(len(points), -1)
    place[kept] = np.arange(len(kept))
    edges = skin.edges[(place[skin.edges] >= 0).all(axis=1)]
    return kept, place[at[fewer.regular_faces]], place[edges]


def turning_assembly(
    parts: Sequence[tuple[Mesh, Array, ComplexArray]], names: Sequence[str], title: str
) -> str:
    """Motions of several bodies that stand together.

    Args:
        parts: mesh, where its points are (n, 3) m, and (k, n, 3) their motions. names: (k,) of these.
    """
    skins = [outside(mesh) for mesh, *_ in parts]
    points = np.concatenate([at[skin.source] for skin, (_, at, _) in zip(skins, parts, strict=True)])
    moved = np.concatenate([u[:, skin.source] for skin, (*_, u) in zip(skins, parts, strict=True)], axis=1)
    shapes = [Turned(name, u[None]) for name, u in zip(names, moved, strict=True)]
    return turned(points, together(skins), shapes, title)


def turning_modes(basis: ModalBasis, group: ModalGroup) -> str:
    """The first elastic modes of a body or of a sector; nothing where the group has no shapes.

    Args:
        basis: in modes, see `reduced.coordinates.basis_in_modes`.
    """
    elastic = np.flatnonzero(group.omega > 0)[:MOST_SHAPES]
    if not len(group.phi):
        return ""
    skin = outside(basis.mesh)
    shapes = [
        Turned(f"mode {j + 1}: {group.frequency[j]:.5g} Hz", group.phi[skin.source, :, j][None]) for j in elastic
    ]
    return turned(basis.mesh.points[skin.source], skin, shapes, f"{basis.name}: modes at {rpm_text(group.speed)}")


def stress_modes(basis: ModalBasis, group: ModalGroup, count: int) -> str:
    """The first elastic modes coloured by their stress at 1 mm largest displacement; nothing without it."""
    if "nodes" not in group.stresses or len(group.stresses["nodes"].points) != len(group.phi):
        return ""
    skin, stress, shapes = outside(basis.mesh), group.stresses["nodes"].stress, []
    for j in [j for j in range(group.n_modes) if group.kind[j] != "rigid"][:count]:
        shape = group.phi[:, :, j]
        megapascals = 1e-9 * von_mises(stress[skin.source, :, j]) / np.linalg.norm(shape, axis=1).max()
        name = f"mode {j + 1}: {group.frequency[j]:.5g} Hz"
        shapes.append(Turned(name, shape[None, skin.source], megapascals, "MPa at 1 mm largest displacement"))
    return turned(basis.mesh.points[skin.source], skin, shapes, f"{basis.name}: stress modes")


def _packed(shares: Array) -> str:
    """Numbers between -1 and 1, as base64 of 16-bit integers."""
    return base64.b64encode(np.round(_FINEST * shares).astype("<i2").tobytes()).decode()


def _numbers(numbers: Indices) -> str:
    return base64.b64encode(numbers.astype("<u2").tobytes()).decode()

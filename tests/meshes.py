"""Small structured meshes of every cell type, made without a mesher, and the settings of a body made of them.

A brick of nx x ny x nz boxes is laid on a lattice of half boxes, so that mid-side, face and centre nodes are
lattice points; a map bends it into pipes, wedges and twisted blades. Nothing here uses the code under test but
`Mesh`, the facet tables and `BodySettings`.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np

from microslip.data import Array, Indices, Mesh
from microslip.mesh import boundary_facets
from microslip.settings.body import BodySettings

QUADRATIC = ("tetra10", "hexahedron20", "hexahedron27")
LINEAR = ("tetra", "hexahedron")
CELLS = QUADRATIC + LINEAR
WEDGES = ("wedge15", "pyramid13", "wedge", "pyramid")
WEDGE_EDGES = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
PYRAMID_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4))

# Nodes of one box on its 3 x 3 x 3 half-box lattice, in VTK's order.
_CORNERS = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
_EDGES = [
    (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
    (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1),
]  # fmt: skip
_CENTRES = [(0, 1, 1), (2, 1, 1), (1, 0, 1), (1, 2, 1), (1, 1, 0), (1, 1, 2), (1, 1, 1)]


def _kuhn() -> list[list[tuple[int, int, int]]]:
    """Six tetrahedra around the diagonal of a box, each of ten lattice nodes, with positive volume."""
    cells = []
    for order in permutations(range(3)):
        path = [np.zeros(3, dtype=int)]
        for axis in order:
            path.append(path[-1] + 2 * np.eye(3, dtype=int)[axis])
        if np.linalg.det(np.array(path[1:]) - path[0]) < 0:
            path[1], path[2] = path[2], path[1]
        a, b, c, d = path
        middle = [(p + q) // 2 for p, q in ((a, b), (b, c), (a, c), (a, d), (b, d), (c, d))]
        cells.append([tuple(int(v) for v in p) for p in (*path, *middle)])
    return cells


def _wedges() -> list[list[Array]]:
    """Two wedges of a box, cut along the diagonal of its floor, each of fifteen lattice nodes."""
    floor = [np.array(c) for c in ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0))]
    up = np.array([0, 0, 2])
    cells = []
    for a, b, c in ((0, 1, 2), (0, 2, 3)):
        low = [floor[a], floor[b], floor[c]]
        corners = low + [p + up for p in low]
        cells.append(corners + [(corners[i] + corners[j]) // 2 for i, j in WEDGE_EDGES])
    return cells


def _pyramids() -> list[list[Array]]:
    """Six pyramids of a box that meet in its middle, each of thirteen nodes, in quarters of a box."""
    corner = [2 * np.array(c) for c in _CORNERS]
    faces = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
    cells = []
    for face in faces:
        corners = [*(corner[i] for i in face), np.array([2, 2, 2])]
        cells.append(corners + [(corners[i] + corners[j]) // 2 for i, j in PYRAMID_EDGES])
    return cells


def _stencils(cell_type: str) -> Array:
    """(cells per box, k, 3) offsets in half boxes, of pyramids in quarters of a box."""
    whole = {
        "wedge": [c[:6] for c in _wedges()],
        "wedge15": _wedges(),
        "pyramid": [c[:5] for c in _pyramids()],
        "pyramid13": _pyramids(),
        "hexahedron": [_CORNERS],
        "hexahedron20": [_CORNERS + _EDGES],
        "hexahedron27": [_CORNERS + _EDGES + _CENTRES],
        "tetra": [c[:4] for c in _kuhn()],
        "tetra10": _kuhn(),
    }
    return np.array(whole[cell_type])


def brick(
    cell_type: str, n: tuple[int, int, int], size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0), to: Callable[[Array], Array] | None = None,
    straight: bool = False, closed: bool = False, keep: Callable[[Array], Array] | None = None,
) -> Mesh:  # fmt: skip
    """A brick with faces ``x0 x1 y0 y1 z0 z1`` (of the brick before it is mapped).

    Args:
        n: boxes along x, y, z. size, origin: m. to: map of positions (p, 3) -> (p, 3).
        straight: True maps the corners only and puts mid nodes at the mean of their corners (not for curved maps).
        closed: True joins y = 0 and y = size (for full pipes, whose map must be periodic).
        keep: (b, 3) numbers of the boxes along x, y, z -> which of them to build; all if None.
    """
    parts = 4 if cell_type.startswith("pyramid") else 2  # of a box's edge on the lattice
    wrap = np.array([10**9, parts * n[1] if closed else 10**9, 10**9])
    boxes = np.stack(np.meshgrid(*[np.arange(k) for k in n], indexing="ij"), axis=-1).reshape(-1, 3)
    boxes = parts * (boxes if keep is None else boxes[keep(boxes)]).reshape(-1, 1, 1, 3)
    lattice = (boxes + _stencils(cell_type)[None]).reshape(-1, _stencils(cell_type).shape[1], 3)
    keys, inverse = np.unique((lattice % wrap).reshape(-1, 3), axis=0, return_inverse=True)
    cells = inverse.reshape(lattice.shape[:2]).astype(np.int64)
    points = np.array(origin) + keys / (parts * np.array(n)) * np.array(size)
    points = points if to is None else to(points)
    if straight:
        points = _straighten(points, keys, cells, lattice)
    mesh = Mesh(points, {cell_type: cells}, node_id=np.arange(1, len(points) + 1))
    return Mesh(points, mesh.cells, _faces(mesh, keys, n, closed, parts), {}, mesh.node_id)


def _straighten(points: Array, keys: Indices, cells: Indices, lattice: Indices) -> Array:
    """Every node at the mean of the corners of its cell that surround it on the lattice."""
    out = points.copy()
    corners = 4 if cells.shape[1] in (4, 10) else 8
    for local in range(corners, cells.shape[1]):
        d = np.abs(lattice[0, :corners] - lattice[0, local])
        ends = np.flatnonzero((d <= 1).all(axis=1)) if corners == 8 else _ends(lattice[0], local)
        out[cells[:, local]] = points[cells[:, ends]].mean(axis=1)
    return out


def _ends(nodes: Indices, local: int) -> Indices:
    pairs = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
    return np.array(pairs[local - 4])


def _faces(
    mesh: Mesh, keys: Indices, n: tuple[int, int, int], closed: bool, parts: int
) -> dict[str, dict[str, Indices]]:
    boundary = boundary_facets(mesh)
    faces: dict[str, dict[str, Indices]] = {}
    for axis, letter in enumerate("xyz"):
        for end, at in ((0, 0), (1, parts * n[axis])):
            if closed and axis == 1:
                continue
            on = keys[:, axis] == at
            face = {t: f[on[f].all(axis=1)] for t, f in boundary.items() if on[f].all(axis=1).any()}
            faces[f"{letter}{end}"] = face
    return faces


def pipe(
    cell_type: str,
    n: tuple[int, int, int],
    inner: float,
    outer: float,
    length: float,
    angle: float = 2 * np.pi,
) -> Mesh:
    """A pipe along z, or a sector of it: boxes n along the radius, the circumference and the axis.

    Faces: ``x0`` bore, ``x1`` outside, ``z0``, ``z1`` ends, and ``y0``, ``y1`` the cuts of a sector.
    """

    def bend(p: Array) -> Array:
        return np.column_stack([p[:, 0] * np.cos(p[:, 1]), p[:, 0] * np.sin(p[:, 1]), p[:, 2]])

    closed = bool(np.isclose(angle, 2 * np.pi))
    return brick(cell_type, n, (outer - inner, angle, length), (inner, 0, 0), bend, closed=closed)


def shaken(amount: float, seed: int = 1) -> Callable[[Array], Array]:
    """A smooth map without symmetry that moves points by about `amount` (m); nothing stays plane."""
    rng = np.random.default_rng(seed)
    waves, phases = rng.uniform(0.5, 2.0, (3, 3)), rng.uniform(0, 6, 3)
    return lambda p: p + amount * np.sin(p @ waves.T + phases)


def twisted_blade(
    cell_type: str = "tetra10", n: tuple[int, int, int] = (2, 4, 12), chord: float = 0.04, thickness: float = 0.006,
    length: float = 0.16, root: float = 0.12, stagger: float = 0.5, twist: float = 0.6,
) -> Mesh:  # fmt: skip
    """A staggered, twisted, tapered strip along z from radius `root` (m); z0 is its root. Angles in rad.

    Its rotor axis is y; the chord is along y where stagger + twist vanish.
    """

    def to(p: Array) -> Array:
        s = p[:, 2] / length
        a = stagger + twist * s
        taper = 1 - 0.3 * s
        x, y = p[:, 0] * taper, p[:, 1] * taper
        bow = 0.15 * thickness * (1 - (2 * p[:, 1] / chord) ** 2)
        x = x + bow
        return np.column_stack([x * np.cos(a) - y * np.sin(a), x * np.sin(a) + y * np.cos(a), root + p[:, 2]])

    return brick(cell_type, n, (thickness, chord, length), (-thickness / 2, -chord / 2, 0), to)


def graded(n: int, last: float, both: bool = False) -> Callable[[Array], Array]:
    """Map of [0, 1] that makes n equal boxes grow from 0 on, the end `last` times as long as the start.

    Linear within a box, so that mid-side nodes stay in the middle. both: small at 0 and 1, for even n.
    """
    at = np.linspace(0, 1, n + 1)
    s = 1 - np.abs(2 * at - 1) if both else at
    grown = s if last == 1 else np.expm1(np.log(last) * s) / (last - 1)
    knots = np.where(at > 0.5, 1 - grown / 2, grown / 2) if both else grown
    return lambda x: np.interp(x, at, knots)


def renumbered(mesh: Mesh, seed: int = 0) -> tuple[Mesh, Indices]:
    """The same body with points and cells in another order; new number of each old point."""
    rng = np.random.default_rng(seed)
    new = rng.permutation(mesh.n_points)
    points = np.empty_like(mesh.points)
    points[new] = mesh.points
    cells = {t: new[c][rng.permutation(len(c))] for t, c in mesh.cells.items()}
    faces = {k: {t: new[f] for t, f in v.items()} for k, v in mesh.faces.items()}
    sets = {k: np.sort(new[s]) for k, s in mesh.point_sets.items()}
    return Mesh(points, cells, faces, sets, np.arange(1, len(points) + 1)), new


def moved(mesh: Mesh, rotation: Array, shift: Array) -> Mesh:
    """The body after the rigid motion x -> rotation x + shift."""
    return Mesh(mesh.points @ rotation.T + shift, mesh.cells, mesh.faces, mesh.point_sets, mesh.node_id)


def with_sets(mesh: Mesh, **sets: Indices) -> Mesh:
    """The mesh with more named point sets."""
    return Mesh(mesh.points, mesh.cells, mesh.faces, {**mesh.point_sets, **sets}, mesh.node_id)


def nearest(mesh: Mesh, point: tuple[float, float, float] | Array) -> int:
    """Index of the node nearest to a point."""
    return int(np.linalg.norm(mesh.points - np.asarray(point), axis=1).argmin())


def rotation_matrix(vector: tuple[float, float, float] | Array) -> Array:
    """Rotation about a vector by its length (rad)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(np.asarray(vector, dtype=float)).as_matrix()


STEEL = {"density": 7850.0, "young": 2.1e11, "poisson": 0.3}


def body(material: dict | None = None, **settings: object) -> BodySettings:
    """Settings of a body in metres, steel unless told otherwise, without stress sets (tests ask for them)."""
    whole = {
        "name": "test", "length_unit": "m", "geometry": {"mesh": "made.inp"}, "material": material or STEEL,
        "output": {"gauss": False, "nodal_stress": False}, **settings,
    }  # fmt: skip
    return BodySettings.model_validate(whole)


def roller_box(**more: object) -> dict:
    """Supports of a brick that may slide on all six faces: its modes are sines and cosines (`reference.bars`)."""
    supports = [{"face": f"{c}{end}", "directions": c} for c in "xyz" for end in (0, 1)]
    return {"supports": supports, **more}

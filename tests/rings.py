"""Sectors of bladed discs and the full rings made of them, node by node: the oracle of cyclic symmetry.

Everything here is made from meshes and from the matrices of a body without symmetry; nothing knows how a sector is
reduced. Sector j + 1 stands at +2 pi / N about the axis from sector j, and u_(j+1) = R u_j exp(i k 2 pi / N).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from meshes import brick, graded, rotation_matrix
from scipy.spatial import cKDTree

from microslip.data import Array, Indices, Mesh
from microslip.fem.discretise import discretise, free_upper
from microslip.frames import skew
from microslip.linalg import eigen
from microslip.mesh import boundary_facets
from microslip.modal.boundary import fixed_dofs, with_loads
from microslip.modal.equilibrium import BodyModel, StaticState, equilibrium, make_model
from microslip.settings.body import BodySettings

AXIS = np.array([0.0, 1.0, 0.0])  # positive rotation carries z (radial) towards x


# ---------------------------------------------------------------- sectors


def bladed_sector(
    cell_type: str = "hexahedron20", sectors: int = 6, bore: float = 0.06, rim: float = 0.16, tip: float = 0.26,
    width: float = 0.03, spiral: float = 0.25, lean: float = 0.12, gap: float = 0.15,
) -> Mesh:  # fmt: skip
    """A disc sector with a staggered blade off its middle and a shroud that leaves a gap (share of the pitch).

    Nothing is mirror symmetric: the cyclic faces are spirals, the blade stands at one side of the rim and leans with
    the axial coordinate. Faces: bore, cyclic_left, cyclic_right, contact_left, contact_right, front (y = 0), top.
    """
    angle, z0, z1 = 2 * np.pi / sectors, 0.4, 0.8
    height = np.array([0.0, z0, (z0 + z1) / 2, z1, 1.0])
    radius = np.interp(height, [0, z0, 1], [bore, rim, tip])

    def to(p: Array) -> Array:
        z = np.interp(p[:, 2], np.linspace(0, 1, 5), height)
        above = np.clip(z - z0, 0, None) / (1 - z0)
        phi = angle * ((p[:, 0] - 0.5) * (1 - gap * above) + spiral * z) + lean * above * (2 * p[:, 1] - 0.6)
        r = np.interp(z, height, radius)
        return np.column_stack([r * np.sin(phi), width * p[:, 1] * (1 + 0.2 * (1 - z)), r * np.cos(phi)])

    def keep(box: Array) -> Array:
        disc, blade, shroud = box[:, 2] < 1, (box[:, 0] == 1), box[:, 2] == 3
        return disc | blade | shroud

    mesh = brick(cell_type, (3, 2, 4), to=to, keep=keep)
    r = np.hypot(mesh.points[:, 0], mesh.points[:, 2])

    def part(face: str, inside: Array) -> dict[str, Indices]:
        return {t: f[inside[f].all(axis=1)] for t, f in mesh.faces[face].items() if inside[f].all(axis=1).any()}

    low, high = r <= rim * (1 + 1e-9), r >= rim + 0.5 * (tip - rim)
    faces = {
        "bore": dict(mesh.faces["z0"]), "top": dict(mesh.faces["z1"]), "front": dict(mesh.faces["y0"]),
        "cyclic_left": part("x0", low), "cyclic_right": part("x1", low),
        "contact_left": part("x0", high), "contact_right": part("x1", high),
    }  # fmt: skip
    return replace(mesh, faces=faces)


def disc_sector(
    cell_type: str, sectors: int, inner: float, outer: float, thickness: float, n: tuple[int, int, int],
    last: float = 1.0,
) -> Mesh:  # fmt: skip
    """A sector of an annular plate about y: n boxes along the circumference, the axis and the radius, the
    outermost `last` times as high as the innermost.

    Faces: bore, rim, cyclic_left, cyclic_right, front, back.
    """
    angle = 2 * np.pi / sectors

    def to(p: Array) -> Array:
        phi, r = angle * (p[:, 0] - 0.5), inner + (outer - inner) * graded(n[2], last)(p[:, 2])
        return np.column_stack([r * np.sin(phi), thickness * (p[:, 1] - 0.5), r * np.cos(phi)])

    mesh = brick(cell_type, n, to=to)
    names = {"z0": "bore", "z1": "rim", "x0": "cyclic_left", "x1": "cyclic_right", "y0": "front", "y1": "back"}
    return replace(mesh, faces={name: mesh.faces[old] for old, name in names.items()})


# ---------------------------------------------------------------- the full ring


@dataclass(frozen=True)
class Ring:
    """The full ring of a sector.

    Attributes:
        mesh: of all sectors; faces ``name_j`` of sector j but the cyclic ones, and ``name`` of all sectors.
        nodes: (N, n) point of the ring that is point p of the sector, in sector j.
        turns: (N, 3, 3) rotation of sector j from sector 0. owner: (ring points, 2) sector and point of it, never one
        of the right cyclic face (of which the next sector's left one is the same point).
    """

    mesh: Mesh
    nodes: Indices
    turns: Array
    owner: Indices

    @property
    def sectors(self) -> int:
        return len(self.nodes)

    def expand(self, shape: Array, k: int) -> Array:
        """(ring points, 3, ...) field of a sector's (n, 3, ...) at nodal diameter k."""
        wave = np.exp(2j * np.pi * k * np.arange(self.sectors) / self.sectors)
        sector, point = self.owner.T
        turned = np.einsum("pij,pj...->pi...", self.turns[sector], shape[point])
        return turned * wave[sector].reshape(-1, *[1] * (shape.ndim - 1))

    def fourier(self, k: int, free: Indices) -> tuple[sp.csr_matrix, Indices]:
        """U_k on the ring's free degrees of freedom, and the sector points it stands on.

        Column 3 i + c: unit motion c of independent point i of sector 0 with all its turned, phased images.
        U_k^H A U_k / N is the sector's matrix of nodal diameter k.
        """
        points, column = np.unique(self.owner[:, 1], return_inverse=True)
        wave = np.exp(2j * np.pi * k * self.owner[:, 0] / self.sectors)
        blocks = wave[:, None, None] * self.turns[self.owner[:, 0]]
        rows = np.broadcast_to(3 * np.arange(len(column))[:, None, None] + np.arange(3)[:, None], blocks.shape)
        cols = np.broadcast_to(3 * column[:, None, None] + np.arange(3), blocks.shape)
        shape = (3 * len(column), 3 * len(points))
        U = sp.csr_matrix((blocks.ravel(), (rows.ravel(), cols.ravel())), shape=shape)[free]
        return U[:, np.flatnonzero(np.abs(U).sum(axis=0))].tocsr(), points


def full_ring(sector: Mesh, sectors: int, axis: Array = AXIS, point: Array | None = None) -> Ring:
    """Turn the sector N times and join the cyclic faces node by node.

    Raises:
        ValueError: faces that do not match.
    """
    origin = np.zeros(3) if point is None else np.asarray(point)
    unit = np.asarray(axis) / np.linalg.norm(axis)
    turns = np.array([rotation_matrix(2 * np.pi * j / sectors * unit) for j in range(sectors)])
    left, right = sector.face_points("cyclic_left"), sector.face_points("cyclic_right")
    target = (sector.points[left] - origin) @ turns[1].T + origin
    distance, mate = cKDTree(target).query(sector.points[right])
    if len(left) != len(right) or len(np.unique(mate)) != len(mate) or distance.max() > 1e-8 * np.ptp(sector.points):
        raise ValueError("the cyclic faces do not match")
    n = sector.n_points
    own = np.setdiff1d(np.arange(n), right)
    number = np.full(n, -1)
    number[own] = np.arange(len(own))
    nodes = np.array([number + j * len(own) for j in range(sectors)])
    nodes[:, right] = np.roll(nodes, -1, axis=0)[:, left[mate]]
    points = np.concatenate([(sector.points[own] - origin) @ R.T + origin for R in turns])
    owner = np.array([(j, p) for j in range(sectors) for p in own])
    return Ring(_ring_mesh(sector, nodes, points), nodes, turns, owner)


def _ring_mesh(sector: Mesh, nodes: Indices, points: Array) -> Mesh:
    cells = {t: np.concatenate([row[c] for row in nodes]) for t, c in sector.cells.items()}
    faces: dict[str, dict[str, Indices]] = {}
    for name, by_type in sector.faces.items():
        if name.startswith("cyclic"):
            continue
        faces[name] = {t: np.concatenate([row[f] for row in nodes]) for t, f in by_type.items()}
        faces |= {f"{name}_{j}": {t: row[f] for t, f in by_type.items()} for j, row in enumerate(nodes)}
    mesh = Mesh(points, cells, faces, {}, np.arange(1, len(points) + 1))
    outer = sum(len(f) for f in boundary_facets(mesh).values())
    cut = sum(len(sector.faces[f"cyclic_{s}"][t]) for s in ("left", "right") for t in sector.faces["cyclic_left"])
    whole = sum(len(f) for f in boundary_facets(sector).values())
    if outer != len(nodes) * (whole - cut):
        raise ValueError("the joined ring has gaps at its cyclic faces")
    return mesh


# ---------------------------------------------------------------- matrices of a body without symmetry


@dataclass(frozen=True)
class Matrices:
    """Full matrices on the free degrees of freedom: K at the static state, M, G_gyro (real, sparse)."""

    model: BodyModel
    state: StaticState
    K: sp.csr_matrix
    M: sp.csr_matrix
    G: sp.csr_matrix
    free: Indices

    def fourier(self, ring: Ring, k: int) -> tuple[Array, Array, Array, sp.csr_matrix]:
        """Dense K, M, G of nodal diameter k (per sector), and U_k."""
        U, _ = ring.fourier(k, self.free)
        K, M, G = (((U.conj().T @ A @ U).toarray() / ring.sectors) for A in (self.K, self.M, self.G))
        return 0.5 * (K + K.conj().T), 0.5 * (M + M.conj().T), 0.5 * (G - G.conj().T), U


def matrices(mesh: Mesh, settings: BodySettings, speed: float = 0.0) -> Matrices:
    """The matrices of a whole body at a speed (rad/s) with the settings' prestress."""
    d = discretise(mesh)
    fixed = fixed_dofs(mesh, settings)
    free = free_upper(d.pattern, fixed)
    rotation = settings.rotation
    model = make_model(
        d, settings.material.material(), free, fixed, np.array(rotation.axis), np.array(rotation.point), None, 293.15,
        np.zeros((mesh.n_points, 3)), rotation.spin_softening,
    )  # fmt: skip
    model = with_loads(model, mesh, settings, fixed)
    solver = eigen.new_solver("superlu")
    state = equilibrium(model, speed, rotation.prestress, solver)
    dofs = free.free
    G = 2 * speed * sp.kron(model.M_full, skew(model.axis)).tocsr()
    M = sp.kron(model.M_full, np.eye(3)).tocsr()
    K = d.pattern.full(state.K)
    return Matrices(model, state, *(A[dofs][:, dofs].tocsr() for A in (K, M, G)), dofs)


def spectrum(K: Array, M: Array, count: int) -> Array:
    """(count,) lowest angular frequencies, rad/s, of a Hermitian pencil.

    LAPACK's values err by eps times the largest one, some 1e7 times the first; Ritz values in its vectors do not.
    """
    _, V = scipy.linalg.eigh(K, M, subset_by_index=[0, count - 1])
    return np.sqrt(scipy.linalg.eigh(V.conj().T @ K @ V, V.conj().T @ M @ V, eigvals_only=True))


def whirl(K: Array, M: Array, G: Array, count: int) -> tuple[Array, Array]:
    """Signed real frequencies w (rad/s) nearest to 0 and shapes of (K + i w G - w^2 M) u = 0, K and M Hermitian.

    With G skew-Hermitian i G is Hermitian, and [[K, 0], [0, M]] z = w [[-i G, M], [M, 0]] z with z = (u, w u) is a
    Hermitian pencil with a definite left side: all w are real. A wave exp(i w t) with w < 0 at nodal diameter k is the
    conjugate of one with -w > 0 at -k.
    """
    n = len(K)
    zero = np.zeros_like(K)
    A = np.block([[K, zero], [zero, M]])
    B = np.block([[-1j * G, M], [M, zero]])
    inverse, vectors = scipy.linalg.eigh(B, A)  # 1 / w
    w = 1 / inverse
    order = np.argsort(np.abs(w))[:count]
    return w[order], vectors[:n, order]


def response(m: Matrices, force: Array, Omega: float, eta: float, coriolis: bool = False) -> Array:
    """(free dofs,) steady amplitude under force exp(i Omega t) with stiffness K (1 + i eta)."""
    A = (1 + 1j * eta) * m.K - Omega**2 * m.M
    if coriolis:
        A = A + 1j * Omega * m.G
    return sp.linalg.spsolve(A.tocsc(), force)

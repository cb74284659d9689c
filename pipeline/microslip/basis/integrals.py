"""Integrals over a mesh with numpy alone, so that the base install can hold a modal file against its own mesh."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache, lru_cache
from itertools import product

import numpy as np
import scipy.sparse as sp

from .. import elements
from ..data import Array, Indices, Mesh
from ..topology import CELL_TYPES, FACET_CORNERS

# exponents of the monomials each shape function is made of
_TRI: list[tuple[int, ...]] = [(i, j) for i, j in product(range(3), repeat=2) if i + j <= 2]
_TET: list[tuple[int, ...]] = [e for e in product(range(3), repeat=3) if sum(e) <= 2]
_QUAD8: list[tuple[int, ...]] = [e for e in product(range(3), repeat=2) if e != (2, 2)]
_HEX20: list[tuple[int, ...]] = [e for e in product(range(3), repeat=3) if sum(1 for k in e if k == 2) <= 1]
_EXPONENTS: dict[str, list[tuple[int, ...]]] = {
    "triangle": [(0, 0), (1, 0), (0, 1)],
    "triangle6": _TRI,
    "quad": list(product(range(2), repeat=2)),
    "quad8": _QUAD8,
    "quad9": list(product(range(3), repeat=2)),
    "tetra": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "tetra10": _TET,
    "hexahedron": list(product(range(2), repeat=3)),
    "hexahedron20": _HEX20,
    "hexahedron27": list(product(range(3), repeat=3)),
}
_TRIANGLE = [[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]]
_SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5], [0.5, 0.5]]


def _nodes(cell_type: str) -> Array:
    if cell_type in CELL_TYPES:
        return CELL_TYPES[cell_type].reference
    shape = _TRIANGLE if FACET_CORNERS[cell_type] == 3 else _SQUARE
    return np.array(shape[: len(_EXPONENTS[cell_type])], dtype=float)


def _monomials(exponents: list[tuple[int, ...]], x: Array) -> Array:
    return np.prod(x[:, None] ** np.array(exponents), axis=2)


def _slopes(exponents: list[tuple[int, ...]], x: Array) -> Array:
    """(q, d, k) derivatives of the monomials."""
    e, d = np.array(exponents), x.shape[1]
    lower = np.maximum(e - np.eye(d, dtype=int)[:, None], 0)
    return np.where(e.T > 0, e.T * np.prod(x[:, None, None] ** lower, axis=3), 0.0)


def _rule(cell_type: str) -> tuple[Array, Array]:
    """Points and weights: the 4-point rule of tetrahedra, the 6-point one of triangles, Gauss' of bricks and squares.

    These are the rules of `fem.discretise`, so that masses and patches agree to rounding.
    """
    if cell_type in ("tetra", "tetra10"):
        a, b = (5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20
        points = np.full((4, 4), a) + (b - a) * np.eye(4)
        return points[:, 1:], np.full(4, 1 / 24)
    if FACET_CORNERS.get(cell_type) == 3:
        return _triangle_rule()
    x, w = np.polynomial.legendre.leggauss(2 if cell_type in ("hexahedron", "quad") else 3)
    d = 3 if cell_type in CELL_TYPES else 2
    points = np.array(list(product((x + 1) / 2, repeat=d)))
    return points, np.array([np.prod(c) for c in product(w / 2, repeat=d)])


def _triangle_rule() -> tuple[Array, Array]:
    """Dunavant's six points of degree four on the unit triangle."""
    root, weight = np.sqrt(38 - 44 * np.sqrt(2 / 5)), np.sqrt(213125 - 53320 * np.sqrt(10))
    points, weights = [], []
    for sign in (1, -1):
        a = (8 - np.sqrt(10) + sign * root) / 18
        points += [[a, a], [1 - 2 * a, a], [a, 1 - 2 * a]]
        weights += [(620 + sign * weight) / 7440] * 3
    return np.array(points), np.array(weights)


@cache
def tables(cell_type: str) -> tuple[Array, Array, Array]:
    """Shape functions (q, k), reference gradients (q, d, k) and weights (q,) at a cell's or facet's own rule."""
    if cell_type in elements.TYPES:
        points, weights = elements.rule(cell_type)
        return *elements.shape_functions(cell_type, points), weights
    at, weights = _rule(cell_type)
    return *shape_functions(cell_type, at), weights


def shape_functions(cell_type: str, at: Array) -> tuple[Array, Array]:
    """Shape functions (q, k) and reference gradients (q, d, k) at points (q, d) of the reference cell or facet."""
    if cell_type in elements.TYPES:
        return elements.shape_functions(cell_type, at)
    exponents, coefficients = _EXPONENTS[cell_type], _coefficients(cell_type)
    return _monomials(exponents, at) @ coefficients, _slopes(exponents, at) @ coefficients


@cache
def _coefficients(cell_type: str) -> Array:
    return np.linalg.inv(_monomials(_EXPONENTS[cell_type], _nodes(cell_type)))


def modal_mass(mesh: Mesh, phi: Array) -> tuple[Array, float]:
    """(m, m) integral of rho conj(phi_i) . phi_j over the volume, and that of rho, kg; rho = 1 without materials.

    Args:
        phi: (n, 3, m) shapes.
    """
    m = phi.shape[2]
    total, mass = np.zeros((m, m), dtype=phi.dtype), 0.0
    columns = np.ascontiguousarray(phi).reshape(len(phi), -1).view(np.float64)  # complex ones as pairs
    for cell_type, cells in mesh.cells.items():
        N, dN, weights = tables(cell_type)
        size = max(1, int(2e6 / ((columns.shape[1] + 1) * len(weights))))  # cells at a time: what stays in the cache
        split = max(1, math.ceil(len(cells) / size))
        parts = (np.array_split(whole, split) for whole in (cells, _density(mesh, cell_type)))
        for chunk, rho in zip(*parts, strict=True):
            jacobian = np.einsum("qdk,eki->eqdi", dN, mesh.points[chunk], optimize=True)
            dm = rho[:, None] * weights * np.linalg.det(jacobian)
            u = np.matmul(N, columns[chunk]).view(phi.dtype).reshape(3 * dm.size, m)
            total += u.conj().T @ (np.repeat(dm.ravel(), 3)[:, None] * u)
            mass += float(dm.sum())
    return total, mass


@lru_cache(maxsize=4)
def convected(
    mesh: Mesh, axis: tuple[float, ...], point: tuple[float, ...], mass: float
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """(n, n) integrals of rho N_i N_j' and of rho N_i' N_j', where N' = w . grad N is what a field changes by per
    radian as the material turns through it: w = axis x (x - point). They act on each Cartesian component alike.

    Args:
        axis: unit vector. point: of it, m. mass: kg of the whole mesh.
    """
    n, whole = mesh.n_points, 0.0
    D, B = sp.csr_matrix((n, n)), sp.csr_matrix((n, n))
    for cell_type, cells in mesh.cells.items():
        N, dN, weights = tables(cell_type)
        x, rho = mesh.points[cells], _density(mesh, cell_type)
        d, b = np.zeros((2, *cells.shape, cells.shape[1]))
        for q, weight in enumerate(weights):
            jacobian = np.einsum("dk,eki->edi", dN[q], x)
            w = np.cross(np.array(axis), np.einsum("k,eki->ei", N[q], x) - np.array(point))
            moved = np.linalg.solve(jacobian.transpose(0, 2, 1), w[..., None])[..., 0] @ dN[q]
            dm = rho * weight * np.linalg.det(jacobian)
            whole += float(dm.sum())
            d += np.einsum("e,i,ej->eij", dm, N[q], moved)
            b += np.einsum("e,ei,ej->eij", dm, moved, moved)
        rows, columns = np.repeat(cells, cells.shape[1], axis=1), np.tile(cells, cells.shape[1])
        D, B = (
            A + sp.csr_matrix((part.ravel(), (rows.ravel(), columns.ravel())), (n, n)) for A, part in ((D, d), (B, b))
        )
    return D * (mass / whole), B * (mass / whole)


def cell_volumes(mesh: Mesh) -> float:
    """Volume of the mesh, m3."""
    total = 0.0
    for cell_type, cells in mesh.cells.items():
        _, dN, weights = tables(cell_type)
        for q, w in enumerate(weights):
            total += float(w * np.linalg.det(np.einsum("dk,eki->edi", dN[q], mesh.points[cells])).sum())
    return total


def _density(mesh: Mesh, cell_type: str) -> Array:
    """(e,) kg/m3, or 1 where the mesh brings no material."""
    if not mesh.materials:
        return np.ones(len(mesh.cells[cell_type]))
    return np.array([m.density for m in mesh.materials])[mesh.regions[cell_type]]


def face_mean(points: Array, blocks: Mapping[str, Indices], values: Array) -> tuple[float, Array, Array]:
    """Area (m2), area centre (3,) and area mean of nodal values (n, ...) of a face."""
    area, centre, mean = np.float64(0), np.zeros(3), np.zeros(values.shape[1:], dtype=values.dtype)
    for facet_type, facets in blocks.items():
        N, dN, weights = tables(facet_type)
        x = points[facets]
        for q, w in enumerate(weights):
            t = np.einsum("dk,fki->fdi", dN[q], x)
            da = w * np.linalg.norm(np.cross(t[:, 0], t[:, 1]), axis=1)
            area += da.sum()
            centre += da @ np.einsum("k,fki->fi", N[q], x)
            mean += np.tensordot(da, np.tensordot(N[q], values[facets], axes=(0, 1)), axes=(0, 0))
    return float(area), centre / area, mean / area

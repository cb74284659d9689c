"""From a `Mesh` to the arrays every operator needs: gradients at quadrature points and the sparsity pattern."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import scipy.sparse as sp

from .. import elements
from ..data import Array, Indices, Mesh
from ..errors import UserError
from ..mesh.lumps import points_of
from ..topology import CELL_TYPES

_ELEMENTS = {
    "tetra": ("ElementTetP1", 2),
    "tetra10": ("ElementTetP2", 2),
    "hexahedron": ("ElementHex1", 3),
    "hexahedron20": ("ElementHexS2", 5),
    "hexahedron27": ("ElementHex2", 5),
    "triangle": ("ElementTriP1", 4),
    "triangle6": ("ElementTriP2", 4),
    "quad": ("ElementQuad1", 3),
    "quad8": ("ElementQuadS2", 5),
    "quad9": ("ElementQuad2", 5),
}
# Degree the default rule integrates: 4 points for ten-node tetrahedra, 27 for quadratic bricks (as CalculiX).

_FACET_REFERENCE = {
    "triangle": [[0, 0], [1, 0], [0, 1]],
    "triangle6": [[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]],
    "quad": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "quad8": [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]],
    "quad9": [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5], [0.5, 0.5]],
}


def reference_nodes(cell_type: str) -> Array:
    """(k, d) reference coordinates of a cell's or facet's nodes in VTK's order."""
    if cell_type in CELL_TYPES:
        return CELL_TYPES[cell_type].reference
    return np.array(_FACET_REFERENCE[cell_type], dtype=float)


@cache
def _element(cell_type: str) -> Any:  # a scikit-fem element and the permutation to VTK's order
    import skfem

    element = getattr(skfem, _ELEMENTS[cell_type][0])()
    nodes = reference_nodes(cell_type)
    distance = np.abs(nodes[:, None, :] - np.asarray(element.doflocs)[None]).max(axis=2)
    order = distance.argmin(axis=1)
    if distance.min(axis=1).max() > 1e-12:
        raise RuntimeError(f"scikit-fem's {element} has other nodes than {cell_type}")
    return element, order


def shape_functions(cell_type: str, at: Array) -> tuple[Array, Array]:
    """Shape functions and reference gradients at points of the reference cell.

    Args:
        cell_type: meshio's name. at: (q, d) reference coordinates.

    Returns:
        N (q, k), dN (q, d, k), nodes in VTK's order.
    """
    if cell_type in elements.TYPES:
        return elements.shape_functions(cell_type, at)
    element, order = _element(cell_type)
    x = np.ascontiguousarray(at.T)
    values = [element.lbasis(x, int(i)) for i in order]
    N = np.stack([np.broadcast_to(v[0], at.shape[:1]) for v in values], axis=1)
    dN = np.stack([np.broadcast_to(v[1], at.T.shape).T for v in values], axis=2)
    return N, dN


def quadrature(cell_type: str, degree: int | None = None) -> tuple[Array, Array]:
    """Points (q, d) and weights (q,) of the rule for a cell type; default degree as in the table above.

    Pyramids have one rule each, wedges of 6 nodes another of degree 1.
    """
    if cell_type in elements.TYPES:
        return elements.rule(cell_type, degree == 1)
    from skfem.quadrature import get_quadrature

    element, _ = _element(cell_type)
    x, w = get_quadrature(element, degree or _ELEMENTS[cell_type][1])
    return np.ascontiguousarray(x.T), w


@dataclass(frozen=True)
class Block:
    """All cells of one type (and of one material, where the mesh brings several).

    Attributes:
        cell_type: meshio's name. cells: (e, k) point indices.
        at: (q, 3) reference coordinates of the quadrature points. N: (q, k) shape functions there.
        grad: (e, q, 3, k) gradients in space, 1/m. dx: (e, q) volume of each quadrature point, m3.
        region: number of the material.
    """

    cell_type: str
    cells: Indices
    at: Array
    N: Array
    grad: Array
    dx: Array
    region: int = 0


@dataclass(frozen=True)
class Pattern:
    """Pairs of points (a <= b) that share a cell: the upper triangle of every operator, sorted by (a, b).

    An operator is an array over the pairs: (p,) for scalar ones (times the 3 x 3 identity or a projector) or
    (p, 3, 3).
    """

    n: int
    row: Indices
    col: Indices

    @property
    def size(self) -> int:
        return len(self.row)

    def places(self, a: Indices, b: Indices) -> Indices:
        """Where pairs of points a <= b stand."""
        return np.searchsorted(self.row * self.n + self.col, np.asarray(a) * self.n + np.asarray(b))

    def full(self, values: Array) -> sp.csr_matrix:
        """The whole symmetric matrix, (n, n) for scalar `values` (p,), (3n, 3n) for (p, 3, 3)."""
        off = self.row != self.col
        if values.ndim == 1:
            rows = np.concatenate([self.row, self.col[off]])
            cols = np.concatenate([self.col, self.row[off]])
            data = np.concatenate([values, values[off]])
            return sp.coo_matrix((data, (rows, cols)), shape=(self.n, self.n)).tocsr()
        upper = self._blocks(values)
        mirrored = self._blocks(np.where(off[:, None, None], values, 0.0))
        return (upper + mirrored.T.tocsr()).tocsr()

    def _blocks(self, values: Array) -> sp.csr_matrix:
        indptr = np.searchsorted(self.row, np.arange(self.n + 1))
        return sp.bsr_matrix((values, self.col, indptr), shape=(3 * self.n, 3 * self.n)).tocsr()


@dataclass(frozen=True)
class FreeUpper:
    """The upper triangle over the free degrees of freedom only, ready for a sparse direct solver.

    Attributes:
        free: indices of the free degrees of freedom (3 * point + component). indptr, indices: CSR of the upper
            triangle. gather: position of each entry in the flattened (p, 3, 3) operator.
    """

    free: Indices
    indptr: Indices
    indices: Indices
    gather: Indices

    @property
    def own(self) -> Indices:
        """(m,) the degree of freedom that each unknown is."""
        return self.free

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.free)

    def congruent(self, A: sp.csr_matrix) -> sp.csr_matrix:
        """(m, m) matrix on the unknowns, from (3n, 3n)."""
        return A[self.free][:, self.free]

    def matrix(self, values: Array) -> sp.csr_matrix:
        """CSR upper triangle of an operator (p, 3, 3)."""
        n = len(self.free)
        return sp.csr_matrix((values.reshape(-1)[self.gather], self.indices, self.indptr), shape=(n, n))

    def restrict(self, forces: Array) -> Array:
        """(m,) or (m, r) forces on the unknowns, from forces (3n,) or (3n, r) on all degrees of freedom."""
        return forces[self.free]

    def unknowns_of(self, displacements: Array) -> Array:
        """(m, r) unknowns of displacements (3n, r) that the supports and the sectors allow: `expand` turned round."""
        return displacements[self.free]

    def rows(self, B: sp.csr_matrix) -> sp.csr_matrix:
        """(r, m) rows on the unknowns, from rows (r, 3n) on all degrees of freedom."""
        return B[:, self.free]

    def expand(self, unknowns: Array, n: int) -> Array:
        """(3n,) or (3n, r) displacements of n points from the unknowns (m,) or (m, r)."""
        whole = np.zeros((3 * n, *unknowns.shape[1:]), dtype=unknowns.dtype)
        whole[self.free] = unknowns
        return whole


def free_upper(pattern: Pattern, fixed: Indices) -> FreeUpper:
    """Drop the rows and columns of the fixed degrees of freedom and keep the upper triangle."""
    number = np.int32 if 9 * pattern.size < 2**31 else np.int64  # half the memory is half the time here
    csr = pattern._blocks(np.arange(9 * pattern.size, dtype=number).reshape(-1, 3, 3))
    keep_dof = np.ones(3 * pattern.n, dtype=bool)
    keep_dof[fixed] = False
    renumber = np.cumsum(keep_dof, dtype=np.int32) - 1
    rows = np.repeat(np.arange(3 * pattern.n, dtype=np.int32), np.diff(csr.indptr))
    keep = (csr.indices >= rows) & keep_dof[rows] & keep_dof[csr.indices]
    counts = np.bincount(renumber[rows[keep]], minlength=int(keep_dof.sum()))
    return FreeUpper(
        free=np.flatnonzero(keep_dof),
        indptr=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        indices=renumber[csr.indices[keep]],
        gather=csr.data[keep],
    )


@dataclass(frozen=True)
class Discretisation:
    """A mesh made ready for assembly: its blocks, the pattern, and where each cell's pairs go in it.

    `positions[i]` is (e, k, k): index into the pattern, or `pattern.size` for pairs below the diagonal. one_rule:
    masses are integrated as stiffness is.
    """

    mesh: Mesh
    blocks: tuple[Block, ...]
    pattern: Pattern
    positions: tuple[Indices, ...]
    one_rule: bool = False

    @property
    def volume(self) -> float:
        """m3."""
        return float(sum(b.dx.sum() for b in self.blocks))


def discretise(mesh: Mesh, degree: Mapping[str, int] | None = None, coupled: Sequence[Indices] = ()) -> Discretisation:
    """Shape-function gradients at every quadrature point and the sparsity pattern.

    Args:
        mesh: in metres. degree: cell type -> degree of the quadrature rule, to override the default.
        coupled: (m, 2) further pairs of points that the pattern must hold (contacts).

    Raises:
        UserError: cells that are inside out at a quadrature point.
    """
    blocks = tuple(
        _block(mesh, t, (degree or {}).get(t), region, cells)
        for t, whole in mesh.cells.items()
        for region, cells in _by_region(whole, mesh.regions.get(t))
    )
    if mesh.lumps is not None:
        coupled = [*coupled, mesh.lumps.pairs, np.repeat(points_of(mesh.lumps)[:, None], 2, axis=1)]
    pattern, positions = _pattern(mesh.n_points, [b.cells for b in blocks], coupled)
    return Discretisation(mesh, blocks, pattern, positions)


_FEW = {"tetra": 1, "wedge": 1}
RULES: dict[str, dict[str, int]] = {
    "full": {}, "reduced": {"hexahedron20": 3}, "calculix": _FEW,
    "reduced-mass": {"hexahedron20": 3, **_FEW},
}  # fmt: skip
"""`mesh.integration` -> degrees of rules: 2 x 2 x 2 points, by which a nearly incompressible brick does not lock, and
those of CalculiX in cells of first order: one point in tetrahedra, two in wedges."""


def whole(d: Discretisation) -> Discretisation:
    """The same with the default rule of each cell type, as masses need it, unless they have that of the stiffness."""
    if d.one_rule or all(len(b.at) == len(quadrature(b.cell_type)[0]) for b in d.blocks):
        return d
    return replace(d, blocks=tuple(_block(d.mesh, b.cell_type, None, b.region, b.cells) for b in d.blocks))


def _by_region(cells: Indices, region: Indices | None) -> Iterator[tuple[int, Indices]]:
    """Runs of cells of one material; the numbers ascend."""
    if region is None or not len(region):
        yield 0, cells
        return
    for number in np.unique(region):
        yield int(number), cells[region == number]


def _block(mesh: Mesh, cell_type: str, degree: int | None, region: int, cells: Indices) -> Block:
    at, weights = quadrature(cell_type, degree)
    N, dN = shape_functions(cell_type, at)
    jacobian = np.einsum("eki,qjk->eqij", mesh.points[cells], dN, optimize=True)
    det = np.einsum("...i,...i->...", jacobian[..., 0, :], np.cross(jacobian[..., 1, :], jacobian[..., 2, :]))
    if (bad := (det <= 0).any(axis=1)).any():
        first = int((mesh.cells[cell_type] == cells[bad][0]).all(axis=1).argmax())
        known = mesh.cell_id.get(cell_type)
        name = f"cell {first + 1} of its type" if known is None else f"element {known[first]}"
        raise UserError(
            f"{bad.sum()} of {len(cells)} {cell_type} cells are inside out or degenerate where they are "
            f"integrated (first: {name}); straighten their mid-side nodes or remesh"
        )
    grad = np.matmul(_inverse3(jacobian, det).transpose(0, 1, 3, 2), dN[None])
    return Block(cell_type, cells, at, N, grad, det * weights, region)


def _inverse3(J: Array, det: Array) -> Array:
    r = np.stack(
        [
            np.cross(J[..., 1, :], J[..., 2, :]),
            np.cross(J[..., 2, :], J[..., 0, :]),
            np.cross(J[..., 0, :], J[..., 1, :]),
        ],
        axis=-1,
    )
    return r / det[..., None, None]


def _pattern(
    n: int, connectivity: list[Indices], coupled: Sequence[Indices] = ()
) -> tuple[Pattern, tuple[Indices, ...]]:
    upper = [c[:, :, None] <= c[:, None, :] for c in connectivity]
    keys = [(c[:, :, None] * n + c[:, None, :])[u] for c, u in zip(connectivity, upper, strict=True)]
    further = [c.min(axis=1) * n + c.max(axis=1) for c in coupled]
    unique, inverse = np.unique(np.concatenate([*keys, *further]), return_inverse=True)
    positions, start = [], 0
    for mask, key in zip(upper, keys, strict=True):
        where = np.full(mask.shape, len(unique), dtype=np.int32)
        where[mask] = inverse[start : start + len(key)]
        start += len(key)
        positions.append(where)
    row, col = np.divmod(unique, n)
    return Pattern(n, row, col), tuple(positions)


@dataclass(frozen=True)
class FacetBlock:
    """All facets of one type on a named face.

    Attributes:
        facets: (f, k) point indices. N: (q, k). points: (f, q, 3) m. area: (f, q, 3) outward normal times the
            area of each quadrature point, m2.
    """

    facets: Indices
    N: Array
    points: Array
    area: Array


def facet_block(mesh: Mesh, facet_type: str, facets: Indices) -> FacetBlock:
    """Quadrature over facets whose node order makes the normal point outwards."""
    at, weights = quadrature(facet_type)
    N, dN = shape_functions(facet_type, at)
    x = mesh.points[facets]
    tangents = np.einsum("fki,qjk->fqji", x, dN, optimize=True)
    normal = np.cross(tangents[..., 0, :], tangents[..., 1, :])
    return FacetBlock(facets, N, np.einsum("qk,fki->fqi", N, x), normal * weights[:, None])


def face_blocks(mesh: Mesh, name: str) -> list[FacetBlock]:
    """One `FacetBlock` per facet type of a named face."""
    return [facet_block(mesh, t, f) for t, f in mesh.faces[name].items()]

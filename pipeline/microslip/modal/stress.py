"""Strain and stress of every mode (Sextro Eqs. (2.4-16), (2.4-17)) at Gauss points and smoothed to the nodes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ..data import Array, Flags, Indices, ModalGroup, StressSet
from ..elasticity import VOIGT_AXES, pushed
from ..fem.cyclic import CutFaces, CyclicUpper
from ..fem.discretise import Block
from ..topology import CELL_TYPES
from .equilibrium import BodyModel, StaticState, cauchy, thermal_stretch

_CHUNK = 250_000
"""Numbers of a gradient made at a time: it stays in the caches, and fresh memory is dear."""


def modal_strain(block: Block, phi: Array, F: Array | None, out: Array) -> None:
    """Strain of shapes (n, 3, m) about a state: the symmetric part of the gradient in the deformed body.

    Args:
        F: (e, q, 3, 3) deformation gradient of the static state, None for the reference geometry. out: (e, q, 6, m).
    """
    e, q = block.dx.shape
    k, m = block.cells.shape[1], phi.shape[2]
    size = max(_CHUNK // max(9 * q * m, 1), 1)
    for c in (slice(start, start + size) for start in range(0, e, size)):
        grad = block.grad[c] if F is None else np.matmul(np.linalg.inv(F[c]).swapaxes(-1, -2), block.grad[c])
        H = np.matmul(grad.reshape(-1, 3 * q, k), phi[block.cells[c]].reshape(-1, k, 3 * m)).reshape(-1, q, 3, 3, m)
        for i, (a, b) in enumerate(zip(*VOIGT_AXES, strict=True)):  # H_ab = du_b / dx_a
            out[c, :, i] = H[:, :, a, b] if a == b else H[:, :, a, b] + H[:, :, b, a]


def gauss_set(model: BodyModel, state: StaticState, phi: Array) -> StressSet:
    """Strain and stress at the integration points, cells in the mesh's order.

    About a nonlinear state everything is in the axes of space, for the deformed body: static Cauchy stress,
    strain and stress modes; else in the reference geometry.
    """
    blocks, m, first = model.d.blocks, phi.shape[2], 0
    strain = np.empty((sum(b.dx.size for b in blocks), 6, m), dtype=phi.dtype)
    stress = np.empty_like(strain)
    for i, block in enumerate(blocks):
        F = np.eye(3) + state.H[i] if state.H is not None and state.prestress == "nonlinear" else None
        own = slice(first, first + block.dx.size)
        part = strain[own].reshape(*block.dx.shape, 6, m)
        modal_strain(block, phi, F, part)
        _hooke(model, i, part, F, stress[own].reshape(part.shape))
        first += block.dx.size
    points = [np.einsum("qk,eki->eqi", b.N, model.d.mesh.points[b.cells]).reshape(-1, 3) for b in blocks]
    static = [cauchy(state, i).reshape(-1, 6) for i in range(len(blocks))]
    volumes = np.concatenate([b.dx.reshape(-1) for b in blocks])
    return StressSet("gauss", np.concatenate(points), strain, stress, np.concatenate(static), volumes)


def _hooke(model: BodyModel, block: int, strain: Array, F: Array | None, out: Array) -> None:
    """Stress of modal strain. About a nonlinear state with the Hooke matrix of the deformed body: the change of the
    Cauchy stress seen by the material (Truesdell's rate), which adds to the static Cauchy stress. Heat alone does not
    deform the material, so that its part in F is taken out."""
    C = model.materials[block].elasticity
    if F is not None:
        C = pushed(C, F if model.thermal_strain is None else F @ np.linalg.inv(thermal_stretch(model, block)))
    np.matmul(C, strain, out=out)
    if model.factor is not None:
        out *= model.factor[block][:, :, None, None]


def smoother(block: Block, n_points: int) -> tuple[sp.csr_matrix, Array]:
    """Extrapolation from integration points to nodes: (n, e q) matrix of volume-weighted sums, and (n,) volumes.

    In each cell a linear (tetrahedron, pyramid), bilinear (wedge) or trilinear (brick) field is fitted
    by least squares to the values at the integration points and evaluated at the nodes; nodes average their cells by
    volume.
    """
    kind = CELL_TYPES[block.cell_type]
    middle = block.at.mean(
        axis=0
    )  # from there few points leave a field constant in the directions they do not tell
    at, nodes = (_polynomials(x - middle, kind.corners) for x in (block.at, kind.reference))
    extrapolate = nodes @ np.linalg.pinv(at)  # (k, q)
    e, q = block.dx.shape
    k = len(nodes)
    volume = block.dx.sum(axis=1)
    data = volume[:, None, None] * extrapolate
    rows = np.broadcast_to(block.cells[:, :, None], (e, k, q))
    cols = np.broadcast_to((np.arange(e) * q)[:, None, None] + np.arange(q), (e, k, q))
    matrix = sp.csr_matrix((data.ravel(), (rows.ravel(), cols.ravel())), shape=(n_points, e * q))
    weights = np.bincount(block.cells.ravel(), np.repeat(volume, k), minlength=n_points)
    return matrix, weights


def _polynomials(x: Array, corners: int) -> Array:
    ones = np.ones(len(x))
    if corners in (4, 5):
        return np.column_stack([ones, x[:, 0], x[:, 1], x[:, 2]])
    a, b, c = x.T
    if corners == 6:
        return np.column_stack([ones, a, b, c, a * c, b * c])
    return np.column_stack([ones, a, b, c, a * b, b * c, a * c, a * b * c])


def nodal_set(
    model: BodyModel, state: StaticState, phi: Array, harmonic: int = 0, gauss: StressSet | None = None, batch: int = 8
) -> StressSet:
    """The set at Gauss points smoothed to the nodes (location ``nodal-averaged``), made `batch` modes at a time.

    On the cut faces of a cyclic sector that match the neighbour's cells count too, turned and in
    the phase of the nodal diameter `harmonic`.
    """
    n, m = model.d.mesh.n_points, phi.shape[2]
    smoothers = [smoother(b, n) for b in model.d.blocks]
    volumes = np.sum([w for _, w in smoothers], axis=0)
    cut = model.free.unknowns.cut if isinstance(model.free, CyclicUpper) else None
    cut = cut if cut is None or cut.share is None else None
    weights = np.where(volumes > 0, volumes, 1.0)  # of points without cells
    if cut is not None:
        weights[cut.left] = weights[cut.right] = volumes[cut.left] + volumes[cut.right]
    S = sp.hstack([matrix for matrix, _ in smoothers]).tocsr()

    def smooth(values: Array, shear: float, phase: complex | float = 1.0) -> Array:
        sums = (S @ values.reshape(len(values), -1)).reshape(n, *values.shape[1:])
        joined = sums if cut is None else _with_neighbours(sums, cut, shear, phase)
        return joined / weights.reshape(-1, *[1] * (values.ndim - 1))

    phase = 1.0 if cut is None else cut.phase(harmonic)
    strain, stress = np.empty((n, 6, m), dtype=phi.dtype), np.empty((n, 6, m), dtype=phi.dtype)
    size = m if gauss else batch
    for some in (slice(start, start + size) for start in range(0, m, size)):
        part = gauss or gauss_set(model, state, phi[:, :, some])
        strain[:, :, some], stress[:, :, some] = smooth(part.strain, 2.0, phase), smooth(part.stress, 1.0, phase)
    static = np.concatenate([cauchy(state, i).reshape(-1, 6) for i in range(len(model.d.blocks))])
    share = model.d.volume * volumes / volumes.sum()
    return StressSet("nodal-averaged", model.d.mesh.points, strain, stress, smooth(static, 1.0), share)


def turned_voigt(rotation: Array, shear: float) -> Array:
    """(6, 6) turn of stresses (shear = 1) or strains with engineering shear (shear = 2) in the order `VOIGT`."""
    i, j = VOIGT_AXES
    turn = rotation[i[:, None], i[None]] * rotation[j[:, None], j[None]]
    turn[:, 3:] += rotation[i[:, None], j[None, 3:]] * rotation[j[:, None], i[None, 3:]]
    size = np.where(np.arange(6) < 3, 1.0, shear)
    return turn * size[:, None] / size


def _with_neighbours(sums: Array, cut: CutFaces, shear: float, phase: complex | float) -> Array:
    """Sums (n, 6, ...) at the nodes, on the cut faces with the share of the cells beyond them."""
    forth, back = (turned_voigt(R, shear) for R in (cut.rotation, cut.rotation.T))
    out = sums.copy()
    out[cut.left] += np.einsum("ab,nb...->na...", back, sums[cut.right]) * np.conj(phase)
    out[cut.right] = np.einsum("ab,nb...->na...", forth, out[cut.left]) * phase
    return out


def von_mises(stress: Array) -> Array:
    """(...,) equivalent stress of (..., 6), Pa."""
    xx, yy, zz, xy, yz, xz = np.moveaxis(stress, -1, 0)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * (xy**2 + yz**2 + xz**2))


class StaticExtremes(NamedTuple):
    """Of a static state: the largest displacement, m, and the largest equivalent stress, Pa, NaN where the modal file
    holds no stress at the nodes."""

    displacement: float
    stress: float


def static_extremes(group: ModalGroup) -> StaticExtremes:
    """The largest displacement of the static state of a group, and its stress outside singular zones."""
    moved = float(np.linalg.norm(group.u_static, axis=-1).max(initial=0.0))
    stress = group.stresses.get("nodes")
    if stress is None:
        return StaticExtremes(moved, np.nan)
    values = von_mises(stress.static_stress)
    values = values[outside(stress.singular)] if len(stress.singular) else values
    return StaticExtremes(moved, float(values.max(initial=0.0)))


def outside(singular: Flags) -> Indices:
    """Numbers of the places outside the singular zones; all, where none is left."""
    singular = np.asarray(singular, dtype=bool)
    return np.flatnonzero(~singular if not singular.all() else np.ones_like(singular))

"""The eigenproblems of a cyclic sector, one for each nodal diameter, that share one interior factorisation.

With u = T_k q (`fem.cyclic`) the sector's real K and M become T_k^H K T_k and T_k^H M T_k: real for k = 0 and N/2,
Hermitian between. The travelling wave -k is the complex conjugate and is not solved for.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from .. import eigen
from ..condensed import Condensed, HarmonicSolver, as_complex, as_real, new_condensed
from ..data import Array
from ..fem.cyclic import SectorUnknowns
from .equilibrium import BodyModel
from .spectrum import pencil_parts

MatVec = Callable[[Array], Array]


def sector_solver(unknowns: SectorUnknowns, backend: str = "auto") -> Condensed:
    """The solver all nodal diameters and speeds share; it keeps its analysis."""
    return new_condensed(np.concatenate([unknowns.left, unknowns.right]), backend)


def sector_pencils(
    model: BodyModel, K: Array, unknowns: SectorUnknowns, condensed: Condensed, harmonics: tuple[int, ...]
) -> dict[int, eigen.Pencil]:
    """Nodal diameter -> its pencil on the sector's unknowns.

    Args:
        K: (p, 3, 3) stiffness over the pattern about the static state.
    """
    parts = pencil_parts(unknowns.apart, model.M, K)
    shifted = _remembered(parts.shifted)
    stay = unknowns.stay.tocsc().indices
    pencils = {}
    for k in harmonics:
        T = unknowns.transformation(k)
        solver = HarmonicSolver(condensed, unknowns.block, unknowns.cut.phase(k), T, stay)
        pencils[k] = eigen.Pencil(
            shifted, _congruent(T, parts.K), _congruent(T, parts.M), T.shape[1], parts.k_norm, parts.m_norm, solver,
            dtype=complex if np.iscomplexobj(T.data) else float,
        )  # fmt: skip
    return pencils


def _remembered(shifted: Callable[[float], sp.csr_matrix]) -> Callable[[float], sp.csr_matrix]:
    """The last matrix again where the same shift is asked for, so that it is recognised and factorised once."""
    last: dict[float, sp.csr_matrix] = {}

    def again(shift: float) -> sp.csr_matrix:
        if shift not in last:
            last.clear()
            last[shift] = shifted(shift)
        return last[shift]

    return again


def _congruent(T: sp.csr_matrix, product: MatVec) -> MatVec:
    """x -> T^H A T x from a product with the real A."""
    H = T.conj().T.tocsr()

    def congruent(x: Array) -> Array:
        moved = (T @ x).reshape(T.shape[0], -1)
        return (H @ as_complex(product(as_real(moved)), moved.dtype)).reshape(x.shape)

    return congruent


def shared_shifts(bands: list[tuple[float, float]]) -> list[float]:
    """For each band (low, high) a value inside it, as few different ones as possible (interval stabbing).

    A certificate needs one shift above the last eigenvalue kept and below the next one; nodal diameters whose gaps
    overlap are counted with one factorisation.
    """
    chosen = [0.0] * len(bands)
    waiting: list[int] = []
    low, high = -np.inf, np.inf
    for i in [*np.argsort([h for _, h in bands], kind="stable"), None]:
        if i is not None and max(low, bands[i][0]) < min(high, bands[i][1]):
            low, high = max(low, bands[i][0]), min(high, bands[i][1])
            waiting.append(i)
            continue
        for j in waiting:
            chosen[j] = 0.5 * (low + high)
        if i is not None:
            (low, high), waiting = bands[i], [i]
    return chosen

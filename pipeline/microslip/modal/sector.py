"""The eigenproblems of a cyclic sector, one for each nodal diameter, that share one interior factorisation.

With u = T_k q (`fem.cyclic`) the sector's real K and M become T_k^H K T_k and T_k^H M T_k: real for k = 0 and N/2,
Hermitian between. The travelling wave -k is the complex conjugate and is not solved for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..data import Array, Indices, Mesh
from ..fem.contact import Grip, contact_matrix
from ..fem.cyclic import (
    CutFaces,
    CyclicUpper,
    SectorUnknowns,
    cyclic_upper,
    pair_cut_faces,
    refuse_other_facets,
    sector_unknowns,
)
from ..fem.discretise import Discretisation
from ..linalg import eigen
from ..linalg.condensed import Condensed, HarmonicSolver, as_complex, as_real, new_condensed
from ..settings.body import BodySettings
from .boundary import refuse_uncyclic, require_face
from .equilibrium import BodyModel
from .spectrum import pencil_parts

MatVec = Callable[[Array], Array]


@dataclass(frozen=True)
class HarmonicUnknowns:
    """The unknowns of one nodal diameter; T is T_k (f, m)."""

    sector: SectorUnknowns
    T: sp.csr_matrix

    def rows(self, B: sp.csr_matrix) -> sp.csr_matrix:
        """(r, m) rows on the unknowns, from rows (r, 3n) on all degrees of freedom."""
        return (self.sector.apart.rows(B) @ self.T).tocsr()

    def restrict(self, forces: Array) -> Array:
        """(m, r) forces on the unknowns, from forces (3n, r) on all degrees of freedom."""
        return self.T.conj().T @ self.sector.apart.restrict(forces)

    def unknowns_of(self, displacements: Array) -> Array:
        """(m, r) unknowns of displacements (3n, r) of this nodal diameter: `expand` turned round."""
        return self.sector.stay.T @ self.sector.apart.unknowns_of(displacements)

    def expand(self, unknowns: Array, n: int) -> Array:
        """(3n, r) displacements of the sector's n points from the unknowns (m, r)."""
        return self.sector.apart.expand(self.T @ unknowns, n)


@dataclass(frozen=True)
class Sector:
    """A sector ready for its nodal diameters. static: the unknowns of the static state, alike in all sectors."""

    harmonics: tuple[int, ...]
    unknowns: SectorUnknowns
    static: CyclicUpper
    condensed: Condensed

    def harmonic(self, k: int) -> HarmonicUnknowns:
        """The unknowns of a nodal diameter."""
        return HarmonicUnknowns(self.unknowns, self.unknowns.transformation(k))


def cut_faces(mesh: Mesh, settings: BodySettings, axis: Array, point: Array) -> CutFaces:
    """The two cut faces of a sector, paired node by node.

    Raises:
        UserError: they are missing or do not match.
    """
    cyclic = settings.cyclic
    assert cyclic is not None
    for key, face in (("left", cyclic.left), ("right", cyclic.right)):
        require_face(mesh, face, f"cyclic.{key}")
    return pair_cut_faces(
        mesh, cyclic.left, cyclic.right, axis, point, cyclic.sectors, cyclic.follows
    )


def make_sector(d: Discretisation, settings: BodySettings, fixed: Indices, axis: Array, point: Array) -> Sector:
    """Pair the cut faces and prepare the solver that all nodal diameters and speeds share.

    Raises:
        UserError: cut faces that are missing or do not match, supports that hold them differently.
    """
    cut = cut_faces(d.mesh, settings, axis, point)
    assert settings.cyclic is not None
    refuse_other_facets(d.mesh, settings.cyclic.left, settings.cyclic.right, cut)
    refuse_uncyclic(d.mesh, settings)
    unknowns = sector_unknowns(d.pattern, fixed, cut, d.mesh.ties)
    boundary = np.concatenate([unknowns.boundary, _in_contact(d.mesh, settings, unknowns)])
    condensed = new_condensed(boundary, settings.modes.solver, settings.modes.ranks)
    return Sector(settings.cyclic.harmonics, unknowns, cyclic_upper(unknowns, d.pattern.size), condensed)


def _in_contact(mesh: Mesh, settings: BodySettings, unknowns: SectorUnknowns) -> Indices:
    """Positions, among the free degrees of freedom, of those on faces that neighbours keep closed, off the cut ones."""
    kept = [c for c in settings.closures if c.modes == "closed" and c.sector_shift]
    if not kept:
        return np.zeros(0, dtype=np.int64)
    points = np.unique(np.concatenate([mesh.face_points(f) for c in kept for f in (c.face, c.against)]))
    dofs = (3 * points[:, None] + np.arange(3)).ravel()
    moves = sp.csr_matrix((np.ones(len(dofs)), (np.zeros(len(dofs), dtype=int), dofs)), shape=(1, 3 * mesh.n_points))
    found = np.unique(unknowns.apart.rows(moves).indices)
    return np.setdiff1d(found, unknowns.boundary)


def contact_between(grips: Sequence[Grip], unknowns: SectorUnknowns, harmonic: int) -> sp.csr_matrix | None:
    """(f, f) stiffness of the contacts that neighbours keep closed, at a nodal diameter, N/m; None without any.

    The neighbour at +2 pi / N moves with the phase exp(+i k 2 pi / N), the one at -2 pi / N with its conjugate. Each
    contact is counted once, with the sector whose face it presses.
    """
    kept = [g for g in grips if g.pair.stays_closed and g.pair.between_sectors]
    if not kept:
        return None
    phase, apart = unknowns.cut.phase(harmonic), unknowns.apart
    phases = [phase if np.allclose(g.pair.turn, unknowns.cut.rotation) else np.conj(phase) for g in kept]
    first, *others = [apart.congruent(contact_matrix(g, phase=p)) for g, p in zip(kept, phases, strict=True)]
    return sum(others, start=first).tocsr()


def sector_pencils(
    model: BodyModel, K: Array, unknowns: SectorUnknowns, condensed: Condensed, harmonics: tuple[int, ...],
    grips: Sequence[Grip] = (),
) -> dict[int, eigen.Pencil]:  # fmt: skip
    """Nodal diameter -> its pencil on the sector's unknowns.

    Args:
        K: (p, 3, 3) stiffness over the pattern about the static state. grips: its contacts.
    """
    parts = pencil_parts(unknowns.apart, model.M, K)
    shifted = _remembered(parts.shifted)
    stay = unknowns.stay.tocsc().indices
    pencils = {}
    for k in harmonics:
        T = unknowns.transformation(k)
        between = contact_between(grips, unknowns, k)
        k_norm = parts.k_norm + (0.0 if between is None else float(abs(between).sum(axis=1).max()))
        solver = HarmonicSolver(condensed, T, stay, between)
        pencils[k] = eigen.Pencil(
            shifted, _congruent(T, parts.K, between), _congruent(T, parts.M), T.shape[1], k_norm, parts.m_norm, solver,
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


def _congruent(T: sp.csr_matrix, product: MatVec, between: sp.csr_matrix | None = None) -> MatVec:
    """x -> T^H (A + B) T x from a product with the real A and a Hermitian B."""
    H = T.conj().T.tocsr()

    def congruent(x: Array) -> Array:
        moved = (T @ x).reshape(T.shape[0], -1)
        found = as_complex(product(as_real(moved)), moved.dtype)
        return (H @ (found if between is None else found + between @ moved)).reshape(x.shape)

    return congruent

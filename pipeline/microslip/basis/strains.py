"""Strains of a modal file's shapes on its own mesh, and what they say of its stiffness, strains and stresses.

A file does not tell the Hooke matrix of a body of one material. It need not: stresses are linear in it, of which the
file has thousands, and K_ij is linear in the two numbers of an isotropic one, of which m modes say m (m + 1) / 2. What
is left when they are fitted is what shapes, stresses or K are wrong by.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..data import Array, Mesh, ModalBasis, ModalGroup, StressSet
from ..elasticity import VOIGT_AXES
from .integrals import tables

_CHUNK = 2_000_000
"""Numbers of a strain made at a time."""


def strains(mesh: Mesh, points: Array, phi: Array) -> Iterator[tuple[Array, Array, Array]]:
    """Strains (e, q, 6, m) of shapes (n, 3, m), engineering shear, volumes (e, q) m3, and materials (e,), 0 where the
    mesh brings none: cells in the mesh's order, some at a time.

    Args:
        points: (n, 3) m, of the mesh or of the deformed body.
    """
    for kind, cells in mesh.cells.items():
        _, dN, weights = tables(kind)
        material = mesh.regions[kind] if mesh.materials else np.zeros(len(cells), dtype=int)
        parts = max(1, len(cells) * len(weights) * 9 * phi.shape[2] // _CHUNK)
        for some in np.array_split(np.arange(len(cells)), parts):
            jacobian = np.einsum("qdk,eki->eqdi", dN, points[cells[some]], optimize=True)
            slopes = np.linalg.solve(jacobian, np.broadcast_to(dN, (len(some), *dN.shape)))
            H = np.einsum("eqak,ekbm->eqabm", slopes, phi[cells[some]], optimize=True)
            eps = [H[:, :, a, b] if a == b else H[:, :, a, b] + H[:, :, b, a] for a, b in zip(*VOIGT_AXES, strict=True)]
            yield np.stack(eps, axis=2), weights * np.linalg.det(jacobian), material[some]


def stiffness_error(basis: ModalBasis, g: ModalGroup) -> tuple[float, float] | None:
    """Largest entry of K_r less phi^H K phi over the largest of K_r, and what it may be (`allowed`). K is of the mesh
    with its materials, of the isotropic law that fits best, or of the law that gives the stresses; None where the file
    does not tell: loaded or spinning, at another temperature, few modes, another law and no stresses."""
    if not np.abs(g.K_r).max(initial=0.0) or not _at_rest(basis, g) or g.u_static.any():
        return None
    if basis.mesh.materials:
        return _beside(basis.mesh, g, [m.elasticity for m in basis.mesh.materials]), DOUBLE
    law = _fitted(g)[0]
    if law and _left(law[0], list(_ISOTROPIC)) > SAME_LAW:
        return _beside(basis.mesh, g, law), allowed(basis)
    error = _isotropic(basis.mesh, g) if g.n_modes > 2 else np.inf
    return (error, DOUBLE) if law or error < ISOTROPIC else None


def _beside(mesh: Mesh, g: ModalGroup, laws: list[Array]) -> float:
    """What Hooke matrices, by the number of a cell's material, leave of K_r, over its largest entry."""
    left, m = g.K_r.copy(), g.n_modes
    for eps, volume, material in strains(mesh, mesh.points, g.phi):
        weighted = eps * volume[:, :, None, None]
        stress = np.einsum("eab,eqbm->eqam", np.array(laws)[material], weighted)
        left = left - eps.reshape(-1, m).conj().T @ stress.reshape(-1, m)
    return float(np.abs(left).max() / np.abs(g.K_r).max())


def _isotropic(mesh: Mesh, g: ModalGroup) -> float:
    """The same of the isotropic law that leaves least."""
    m = g.n_modes
    products = np.zeros((6 * m, 6 * m), dtype=g.phi.dtype)
    for eps, volume, _ in strains(mesh, mesh.points, g.phi):
        products += eps.reshape(-1, 6 * m).conj().T @ (eps * volume[:, :, None, None]).reshape(-1, 6 * m)
    parts = products.reshape(6, m, 6, m).transpose(0, 2, 1, 3)
    return _left(g.K_r, [np.tensordot(law, parts) for law in _ISOTROPIC])


_ISOTROPIC = np.zeros((6, 6)), np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0])
_ISOTROPIC[0][:3, :3] = 1.0
"""Hooke matrices of Lame's two constants, engineering shear."""

SAME_LAW = 1e-4
"""Share of a law that stresses in single precision give, by which one that is isotropic may look as if it were not."""


DOUBLE, SINGLE = 1e-9, 2e-7
"""What may be left of numbers kept in double and in single precision."""


def single(values: Array) -> Array:
    """The same in single precision: what is read and drawn, and goes into no equation of motion."""
    return values.astype(np.complex64 if np.iscomplexobj(values) else np.float32)


def allowed(basis: ModalBasis) -> float:
    """What may be left where strains and stresses take part, which files keep in single precision."""
    kept = next((g.stresses for g in basis.groups.values() if g.stresses), {})
    return SINGLE if all(np.array_equal(s.strain, single(s.strain)) for s in kept.values()) else DOUBLE


ISOTROPIC = 1e-2
"""Share of K_r, beyond which what the best isotropic law leaves is taken for that of another law."""


def _at_rest(basis: ModalBasis, g: ModalGroup) -> bool:
    """Whether the stiffness is that of the material alone, and the material's that of its reference temperature."""
    warm = '"temperature"' in basis.provenance.get("settings", "")
    return g.prestress == "none" and not g.speed and not g.contacts and not warm


def _left(K: Array, terms: list[Array]) -> float:
    """Largest entry that the best combination of matrices leaves of a matrix, over its largest."""
    A, k = (np.concatenate([x.real, x.imag]) for x in (np.stack([t.ravel() for t in terms], axis=1), K.ravel()))
    size = np.maximum(np.abs(A).max(axis=0), 1e-300)
    with np.errstate(all="ignore"):
        try:
            left = A / size @ np.linalg.lstsq(A / size, k, rcond=None)[0] - k
        except np.linalg.LinAlgError:  # numbers that no body has
            return np.inf
        found = float(np.abs(left).max() / np.abs(k).max())
    return found if np.isfinite(found) else np.inf


def _fitted(g: ModalGroup) -> tuple[list[Array], float]:
    """The (6, 6) Hooke matrix that gives the stresses of all sets best, and the largest stress it does not give, over
    the largest; none without stresses."""
    if not g.stresses:
        return [], 0.0
    both = [(s.strain, s.stress) for s in g.stresses.values()]
    squares, products = (
        sum(np.tensordot(pair[0].conj(), pair[k], ((0, 2), (0, 2))).real for pair in both) for k in (0, 1)
    )
    C = np.linalg.lstsq(squares, products, rcond=1e-14)[0].T
    left = max(float(np.abs(np.matmul(C, eps) - sigma).max(initial=0.0)) for eps, sigma in both)
    return [C], left / max(max(float(np.abs(sigma).max(initial=0.0)) for _, sigma in both), 1e-300)


def strain_error(basis: ModalBasis, g: ModalGroup, s: StressSet) -> float | None:
    """Largest error of the strains of a set at Gauss points over the largest strain; None of other places."""
    if s.location != "gauss" or len(s.points) != sum(len(c) * len(tables(k)[2]) for k, c in basis.mesh.cells.items()):
        return None
    moved = basis.mesh.points + (g.u_static if g.prestress == "nonlinear" else 0.0)
    first, worst = 0, 0.0
    for eps, order in _ordered(basis.mesh, moved, g.phi, s.points):
        count = eps.shape[0] * eps.shape[1]
        stored = s.strain[first : first + count].reshape(eps.shape)
        worst, first = max(worst, float(np.abs(eps[:, order] - stored).max(initial=0.0))), first + count
    size = float(
        np.abs(g.phi).max(initial=0.0) / np.ptp(basis.mesh.points, axis=0).max()
    )  # rigid motions strain nothing
    return worst / max(float(np.abs(s.strain).max(initial=0.0)), size)


def _ordered(mesh: Mesh, points: Array, phi: Array, places: Array) -> Iterator[tuple[Array, Array]]:
    """Strains, and in what order the points of a rule stand in a set at those places: that of the first cell."""
    first, kinds = 0, iter(mesh.cells.items())
    left, order = 0, np.zeros(0, dtype=int)
    for eps, _, _ in strains(mesh, points, phi):
        if not left:
            kind, cells = next(kinds)
            own, left = tables(kind)[0] @ mesh.points[cells[0]], len(cells)
            there = places[first : first + len(own)]
            order = np.linalg.norm(there[:, None] - own[None], axis=2).argmin(axis=1)
        yield eps, order
        first, left = first + eps.shape[0] * eps.shape[1], left - eps.shape[0]


def stress_error(basis: ModalBasis, g: ModalGroup) -> float | None:
    """Largest stress of any set that the one Hooke matrix does not give which fits best to all, over the largest; None
    of a body whose material is not the same everywhere."""
    return _fitted(g)[1] if g.stresses and len(basis.mesh.materials) < 2 and _at_rest(basis, g) else None

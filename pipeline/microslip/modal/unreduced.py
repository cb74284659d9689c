"""The matrices of a body as finite elements have them, without a reduction: what reduced ones are compared with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import scipy.sparse as sp

from ..data import Mesh
from ..errors import UserError
from ..fem.cyclic import CyclicUpper
from ..settings.body import BodySettings
from .compute import prepared


@dataclass(frozen=True)
class Unreduced:
    """A body at rest on its n free degrees of freedom.

    Attributes:
        M, C, K: (n, n). rows: interface -> (6, n) its motion along n, t1, t2 and about them. mass: kg. congruent:
            (3p, 3p) of the mesh's p points -> (n, n).
    """

    M: sp.csr_matrix
    C: sp.csr_matrix
    K: sp.csr_matrix
    rows: Mapping[str, sp.csr_matrix]
    mesh: Mesh
    mass: float
    congruent: Callable[[sp.csr_matrix], sp.csr_matrix]


def unreduced(mesh: Mesh, settings: BodySettings) -> Unreduced:
    """The matrices of a body at rest.

    Args:
        mesh: in metres. settings: in SI.

    Raises:
        UserError: damping that is no matrix (ratios of modes); a sector; see `compute.prepared`.
    """
    damping, b = settings.damping, prepared(mesh, settings, None)
    if damping.ratio or damping.table or b.sector is not None or any(settings.rotation.speeds_rpm):
        raise UserError(
            f"{settings.name}: the unreduced matrices of a body have no damping by modes, no sector and no speed; "
            "write alpha and beta in [damping]"
        )
    free = b.model.free
    assert not isinstance(free, CyclicUpper)
    M = free.congruent(sp.kron(b.model.M_full, sp.eye(3)).tocsr())
    upper = free.matrix(b.model.K0)
    K = (upper + sp.triu(upper, 1).T).tocsr()
    C = ((damping.alpha or 0.0) * M + (damping.beta or 0.0) * K).tocsr()
    rows = {name: free.rows(p.B.tocsr()) for name, p in b.rows.patches.items()}
    return Unreduced(M, C, K, rows, mesh, b.mass, free.congruent)

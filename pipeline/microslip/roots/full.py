"""An assembly about sliding in unreduced matrices: bodies of finite elements, contacts as they are linearised."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..data import ComplexArray
from ..errors import UserError
from ..linalg import quadratic, winding
from ..linalg.quadratic import Quadratic, Window
from ..modal.compute import Unreduced
from ..progress import Report
from ..sliding import Tangent
from ..system.assembly import Assembly
from ..system.spin import Spin
from .spectrum import Spectrum


def full_matrices(bodies: Mapping[str, Unreduced], assembly: Assembly, contacts: Sequence[Tangent]) -> Quadratic:
    """M, C and K of all bodies with the tangents of their contacts, sparse.

    Args:
        bodies: by the names of the assembly's components, whose spins they take. contacts: in the assembly's order.

    Raises:
        UserError: patches that deform, whose coordinates are those of the reduced bodies.
    """
    names = [m.name for m in assembly.components]
    bodies = {m.name: _turned(bodies[m.name], m.spin) for m in assembly.components}
    sizes = [bodies[name].M.shape[0] for name in names]
    M, C, K = (sp.block_diag([getattr(bodies[name], key) for name in names], format="csr") for key in "MCK")
    for c, at in zip(assembly.contacts, contacts, strict=True):
        if c.patch.shapes is not None:
            raise UserError(f'contacts.{c.name}.patch: "nodal" moves as reduced bodies do; take a rigid patch')
        parts = [sp.csr_matrix((c.patch.count, n)) for n in sizes]
        for side, sign in ((c.first, 1.0), (c.second, -1.0)):
            if side is not None:
                i = names.index(side.component)
                parts[i] = parts[i] + sign * sp.csr_matrix(side.frame) @ bodies[names[i]].rows[side.interface]
        T = sp.hstack(parts).tocsr()
        C, K = C + T.T @ sp.csr_matrix(at.C) @ T, K + T.T @ sp.csr_matrix(at.K) @ T
    return Quadratic(M, C.tocsr(), K.tocsr())


def _turned(body: Unreduced, spin: Spin | None) -> Unreduced:
    """The body with its material running through its standing shape; itself without a spin."""
    if spin is None:
        return body
    D, B = (body.congruent(sp.kron(A, sp.eye(3)).tocsr()) for A in spin.matrices(body.mesh, body.mass))
    return replace(body, C=body.C + spin.rate * (D - D.T), K=body.K - spin.rate**2 * B)


def growing(Q: Quadratic, window: Window, near: ComplexArray, report: Report = lambda _: None) -> Spectrum:
    """All roots of a window, searched and counted.

    Args:
        near: (r,) about where other roots lie, as the reduced matrices have them: those outside of the window are taken
            out of the count's determinant, which is then smoother, and the count the same.

    Raises:
        NotConverged: the matrices are singular throughout.
    """
    search = quadratic.search(Q, window)
    in_window = window.holds(search.s)
    roots = quadratic.refined(Q, search.s[in_window], search.x[:, in_window])
    report(f"{len(roots)} roots of {Q.n} coordinates; counting")
    count = winding.missed(Q, window, np.concatenate([roots.s, near[~window.holds(near)]]))
    return Spectrum(roots, window, roots.rounding, count, False)


def compared(reduced: ComplexArray, full: ComplexArray) -> float:
    """Largest relative distance of roots of the reduced matrices from the nearest of the full ones; NaN where there
    are none, infinite where their number differs."""
    if len(reduced) != len(full):
        return float("inf")
    return float(max((np.abs(full - s).min() / abs(s) for s in reduced), default=np.nan))


@dataclass(frozen=True)
class Compared:
    """A state of the map in unreduced matrices: values of both parameters, number of roots that grow in the reduced and
    the full matrices, largest relative distance of the two, and whether the count proves that none is missing."""

    x: float
    y: float
    reduced: int
    full: int
    distance: float
    complete: bool

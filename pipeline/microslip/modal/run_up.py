"""What a change of the rotation speed does to a reduced body (Sextro Eqs. (2.1-14) to (2.1-18), (2.3-19))."""

from __future__ import annotations

import numpy as np

from ..data import Array, RunUp
from ..fem.operators import spin_projector
from ..frames import skew
from .equilibrium import BodyModel, StaticState


def run_up_terms(model: BodyModel, state: StaticState, shapes: Array, Mshapes: Array, harmonic: int = 0) -> RunUp:
    """Circulatory and softening matrices, Euler and centrifugal load per unit, on the given shapes.

    Args:
        shapes, Mshapes: (n, 3, m) phi and M phi, real or complex. harmonic: nodal diameter of the shapes; the loads
            turn with the sectors, so only 0 feels them.
    """
    left = shapes.conj()
    N = np.einsum("nia,ij,njb->ab", left, skew(model.axis), Mshapes, optimize=True)
    P = np.einsum("nia,ij,njb->ab", left, spin_projector(model.axis), Mshapes, optimize=True)
    r = model.d.mesh.points + state.u - model.point
    euler = -np.einsum("nia,ni->a", Mshapes.conj(), np.cross(model.axis, r))
    centrifugal = np.einsum("nia,ni->a", Mshapes.conj(), r @ spin_projector(model.axis))
    if harmonic:
        euler, centrifugal = 0 * euler, 0 * centrifugal
    return RunUp(0.5 * (N - N.conj().T), 0.5 * (P + P.conj().T), euler, centrifugal)

"""Material that runs through a body whose shape stands: a disc of revolution that spins between its pads.

The material moves with Omega w, w = n x (x - p), and a displacement u(x, t) of the shape adds u,t + Omega u' to that,
u' = w . grad u in Cartesian components. With coordinates q of shapes phi its kinetic energy brings

    Omega (D - D^H) q',  -Omega^2 B q,    D = int rho phi_i . phi_j',  B = int rho phi_i' . phi_j'

(the acceleration is u,tt + 2 Omega u,t' + Omega^2 u''). The first takes the place of the gyroscopic matrix of a frame
that turns with the body, the second that of its spin softening; the centrifugal stress stiffens alike in both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..basis.integrals import convected
from ..data import Array, Mesh, ModalGroup
from ..errors import UserError
from .component import Component

MASSLESS = ("massless-interface", "interface-force")
"""Kinds of coordinates that carry no mass."""

SYMMETRIC = 0.1
"""Largest size of D + D^H, an integral over the surface that is zero where it is one of revolution, over that of D."""


SLOW = 0.1
"""Speed over the lowest frequency of a body at rest up to which its stress by the speed does not count (1 % of K)."""


@dataclass(frozen=True)
class Spin:
    """rate: rad/s. axis: (3,) unit vector n. point: (3,) p, m; both in the body's axes."""

    rate: float
    axis: Array
    point: Array

    def same(self, other: Spin) -> bool:
        """Whether the material runs alike, along the same line."""
        apart = np.cross(self.axis, other.point - self.point)
        return bool(
            np.allclose(self.rate * self.axis, other.rate * other.axis, rtol=1e-9, atol=0)
            and np.abs(apart).max() <= 1e-9 * (1 + np.abs(self.point).max())
        )

    def matrices(self, mesh: Mesh, mass: float) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """(n, n) D and B of each Cartesian component of the nodes' motion. mass: kg of the mesh."""
        return convected(mesh, tuple(self.axis.tolist()), tuple(self.point.tolist()), mass)


def turned(component: Component, spin: Spin, mesh: Mesh, mass: float) -> Component:
    """The component with its material running through its standing shape.

    Args:
        mesh: of the component, whose mass is `mass`, kg.

    Raises:
        UserError: a mesh or shapes that are not in the modal file, a shape that is not one of revolution, coordinates
            without mass; a modal file at another speed; a free body at rest.
    """
    if not mesh.n_cells or not mass:
        raise UserError("its modal file has no mesh to integrate over, or no mass")
    return replace(component, spin=spin, groups={k: _turned(g, spin, mesh, mass) for k, g in component.groups.items()})


def _turned(g: ModalGroup, spin: Spin, mesh: Mesh, mass: float) -> ModalGroup:
    _refuse(g, spin)
    D, B = (sum(g.phi[:, i].conj().T @ (A @ g.phi[:, i]) for i in range(3)) for A in spin.matrices(mesh, mass))
    skew, symmetric = D - D.conj().T, np.linalg.norm(D + D.conj().T)
    if symmetric > SYMMETRIC * np.linalg.norm(D):
        raise UserError("it is no body of revolution about that axis, so its shape does not stand while it turns")
    softening = g.speed**2 * g.run_up.P if g.run_up and g.spin_softening else 0.0
    K = g.K_r + softening - spin.rate**2 * B
    return replace(g, G_r=spin.rate * skew, K_r=0.5 * (K + K.conj().T))


def _refuse(g: ModalGroup, spin: Spin) -> None:
    if not g.phi.size:
        raise UserError("its modal file has no shapes to integrate; write output.shapes = true in its body.toml")
    if set(g.kind) & set(MASSLESS):
        raise UserError('it is reduced to coordinates without mass; reduce it by "rubin" or "craig-bampton"')
    rpm, own = (v * 30 / np.pi for v in (abs(spin.rate), g.speed))
    if g.speed and (abs(own - rpm) > 1e-6 * rpm or g.run_up is None):
        raise UserError(
            f"its modal file is at {own:.6g} rpm, but its material turns with {rpm:.6g}; take one at that speed or rest"
        )
    if not g.speed and 0 < SLOW * g.omega.min() < abs(spin.rate):
        raise UserError(
            f"its modal file is at rest, but at {rpm:.6g} rpm the centrifugal stress stiffens it (its lowest frequency "
            f"is {g.omega.min() / (2 * np.pi):.4g} Hz); take one at that speed"
        )
    if not g.speed and (g.omega == 0).any():
        raise UserError(
            "it is free, and at rest nothing holds its tilt against its own inertia; take a modal file at "
            f"{rpm:.6g} rpm, whose centrifugal stress does"
        )

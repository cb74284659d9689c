"""Small elastic bricks with all their modes, and the same by full matrices: nothing is lost between the two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from microslip.data import Array, Compliance, Interface, Mesh, ModalGroup, Rows
from microslip.elasticity import isotropic
from microslip.fem.discretise import discretise
from microslip.fem.operators import mass, stiffness
from microslip.modal.rows import patch

YOUNG, POISSON, DENSITY = 2.1e11, 0.3, 7850.0


@dataclass(frozen=True, eq=False)
class Block:
    """A brick.

    Attributes:
        K, M: (d, d) without the held points. group: the same in its modes. phi: (d, m) of them. motion: face -> (p, 3,
            d) of its quadrature points, body axes.
    """

    K: Array
    M: Array
    group: ModalGroup
    phi: Array
    motion: dict[str, Array]


def block(
    mesh: Mesh, faces: dict[str, tuple[str, tuple[float, float, float]]], held: str = "", count: int | None = None,
    young: float = YOUNG, push: tuple[float, float, float] = (1.0, 0.5, 0.2),
) -> Block:  # fmt: skip
    """A brick with interfaces; pushed, and watched, at its point furthest from the origin.

    Args:
        faces: interface -> face, t2. held: face whose points do not move. count: of modes; None: all.
    """
    d, n = discretise(mesh), mesh.n_points
    own = np.setdiff1d(np.arange(n), mesh.face_points(held) if held else [])
    dofs = (3 * own[:, None] + np.arange(3)).ravel()
    K = d.pattern.full(stiffness(d, isotropic(young, POISSON))).toarray()[np.ix_(dofs, dofs)]
    M = d.pattern.full(mass(d, DENSITY)[:, None, None] * np.eye(3)).toarray()[np.ix_(dofs, dofs)]
    values, phi = scipy.linalg.eigh(K, M)
    values, phi = values[:count], phi[:, :count]
    omega = np.where(values > 1e-9 * values[-1] if not held else True, np.sqrt(np.abs(values)), 0.0)
    interfaces, motion, m = {}, {}, len(omega)
    for name, (face, t2) in faces.items():
        p = patch(mesh, face, np.array(t2), name)
        motion[name] = np.kron(p.N.toarray(), np.eye(3))[:, dofs].reshape(len(p.points), 3, -1)
        interfaces[name] = Interface(
            p.origin, p.rotation, p.B.toarray()[:, dofs] @ phi, np.zeros(m), p.points, p.areas, p.normals,
            motion[name] @ phi, extent=p.extent, polygon=p.polygon,
        )  # fmt: skip
    end = int(np.linalg.norm(mesh.points[own], axis=1).argmax())
    u = phi[3 * end : 3 * end + 3]
    at = mesh.points[own[end]]
    group = ModalGroup(
        speed=0.0, omega=omega, kind=tuple("normal" if w else "rigid" for w in omega), damping_ratio=np.full(m, 0.01),
        M_r=np.eye(m), K_r=np.diag(omega**2), C_r=np.diag(0.02 * omega), G_r=np.zeros((m, m)), phi=u[None],
        interfaces=interfaces, excitations={"push": Rows(np.array(push)[None] @ u, ("push",), "N", at)},
        monitors={"end": Rows(u, ("u_x", "u_y", "u_z"), "m", at, static=np.zeros(3))}, gauges={},
        compliance=Compliance((), np.zeros((0, 0)), np.zeros((0, 0)), not held), stresses={},
        u_static=np.zeros((1, 3)), checks={},
    )  # fmt: skip
    return Block(K, M, group, phi, motion)

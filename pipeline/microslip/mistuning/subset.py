"""Discs in one piece with their blades, whose sectors differ: a subset of nominal modes (Yang and Griffin, 2001).

A sector whose modulus is (1 + d_j)^2 times the nominal one adds, on the modes of the tuned ring,

    dK_mn = sum_j ((1 + d_j)^2 - 1) integral over sector j of strain_m^H stress_n dV.

The modal file holds strain and stress of every mode at the Gauss points of a sector, with their volumes, so that this
sum is the exact projection of the disc's matrices. It is not enough for what the file does not hold: a deviation of
part of a sector (its blade alone) that is not named by its points, and modes that the tuned ring's lack.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from ..data import Array, StressSet
from ..errors import UserError
from ..system.component import Component
from ..system.disc import spread, whole

GAUSS = "gauss"


def mistuned(component: Component, deviation: Array, part: Array | None = None) -> Component:
    """The whole ring of a cyclic component whose sectors differ in stiffness; its damping matrix stays.

    Args:
        component: of N sectors, every nodal diameter in its groups. deviation: (N,) d_j, shares of the frequencies
            that a sector of this stiffness alone would have. part: (places,) bool, Gauss points of a sector that the
            deviation is in, those of the blade say; None: all.

    Raises:
        UserError: a body that is not cyclic, a modal file without strain at Gauss points, a deviation too many or too
            few, or one that leaves nothing of a stiffness.
    """
    N, d = component.sectors, np.asarray(deviation, dtype=float)
    if N == 1:
        raise UserError(f"{component.name}: is not cyclic; scatter the frequencies of its modes")
    if d.shape != (N,) or not (d > -1).all():
        raise UserError(f"deviation: {component.name} needs {N} numbers above -1, one a sector")
    ring = whole(component)
    group, energy = ring.groups[0], _energies(component, part)
    added = np.zeros_like(group.K_r)
    for j, more in enumerate((1 + d) ** 2 - 1):
        T = _in_sector(component, j)
        added += more * (T.T @ energy @ T)
    K = group.K_r + 0.5 * (added + added.T)
    omega = np.sqrt(np.maximum(scipy.linalg.eigvalsh(K, group.M_r), 0.0))
    return replace(ring, groups={0: replace(group, K_r=K, omega=omega)})


def _waves(component: Component) -> list[tuple[int, StressSet]]:
    """(sign of the imaginary part, stress set) of the nodal diameters 0 to N/2."""
    found = []
    for k in range(component.sectors // 2 + 1):
        wave = component.at(k)
        points = wave.group.stresses.get(GAUSS)
        if points is None:
            raise UserError(
                f"{component.name}: its modal file has no strain at Gauss points; set output.gauss = true in its body"
            )
        found.append((-1 if wave.conjugate else 1, points))
    return found


def _energies(component: Component, part: Array | None) -> Array:
    """(2M, 2M) integrals of strain and stress over one sector, of the real parts of the M modes, then the imaginary."""
    waves = _waves(component)
    kept = slice(None) if part is None else part
    both = []
    for key in ("strain", "stress"):
        rows = [np.where(s > 0, v := getattr(p, key)[kept], v.conj()) for s, p in waves]
        every = np.concatenate(rows, axis=2)
        both.append(np.concatenate([every.real, every.imag], axis=2))
    weights = waves[0][1].weights[kept]
    strain, stress = both
    return (strain * weights[:, None, None]).reshape(-1, strain.shape[2]).T @ stress.reshape(-1, strain.shape[2])


def _in_sector(component: Component, sector: int) -> Array:
    """(2M, ring) real and imaginary parts of the modes in a sector, per unit of the ring's coordinates."""
    sizes = [p.strain.shape[2] for _, p in _waves(component)]
    M, begin, rows = sum(sizes), 0, []
    for m in sizes:
        T = np.zeros((2 * M, m), dtype=complex)
        T[begin : begin + m], T[M + begin : M + begin + m] = np.eye(m), 1j * np.eye(m)
        rows.append(T)
        begin += m
    return spread(rows, sector, component.sectors)

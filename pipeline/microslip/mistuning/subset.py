"""Discs in one piece with their blades, whose sectors differ: a subset of nominal modes (Yang and Griffin, 2001).

A sector whose modulus is (1 + d_j)^2 times the nominal one adds, on the modes of the tuned ring,

    dK_mn = sum_j ((1 + d_j)^2 - 1) integral over sector j of strain_m^H stress_n dV.

The modal file holds strain and stress of every mode at the Gauss points of a sector, with their volumes, so that this
sum is the exact projection of the disc's matrices. It is not enough for what the file does not hold: a deviation of
part of a sector (its blade alone) that is not named by its points, and modes that the tuned ring's lack.

Blades whose modes differ each by itself are told by component modes (CMM: Lim, Bladh, Castanier and Pierre, AIAA
Journal 45, 2007): on the modes u_m of a blade held where the disc begins, which are orthogonal in energy to what its
root carries along, its motion in the ring has the shares

    eta_mn = 1/omega_m^2 integral over the blade of strain_m^T stress_n dV,

and blades whose frequencies are omega_m (1 + d_jm) add sum_j sum_m ((1 + d_jm)^2 - 1) omega_m^2 eta_m^H eta_m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg
from scipy.spatial import cKDTree

from ..data import Array, ModalGroup, StressSet
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
    d = _known(component, deviation, ())
    kept = slice(None) if part is None else part
    strain, stress = (_of_sector(component, key)[kept] for key in ("strain", "stress"))
    weights = _waves(component)[0][1].weights[kept]
    energy = _energy(strain, stress, weights)
    return _stiffer(component, [more * energy for more in (1 + d) ** 2 - 1])


def of_blade_modes(component: Component, blade: ModalGroup, deviation: Array) -> Component:
    """The whole ring of a cyclic component whose blades' own modes differ, each by itself (CMM).

    Args:
        component: of N sectors. blade: modes of the blade alone, held where the disc begins, of the same cells as in
            the sector, strain at Gauss points. deviation: (N, m) of the frequencies of its first m modes.

    Raises:
        UserError: as `mistuned`; a blade whose Gauss points are none of the sector's.
    """
    m = np.shape(deviation)[1] if np.ndim(deviation) == 2 else 1
    d, points = _known(component, deviation, (m,)), blade.stresses.get(GAUSS)
    if points is None or m > len(blade.omega):
        raise UserError(f"blade: needs strain at Gauss points, and {m} modes or more")
    nominal = _waves(component)[0][1].points
    apart, at = cKDTree(nominal).query(points.points)
    if apart.max() > 1e-6 * np.ptp(nominal, axis=0).max():
        raise UserError(f"blade: its Gauss points are none of {component.name}'s; take the same cells, in their place")
    shares = _energy(points.strain[:, :, :m], _of_sector(component, "stress")[at], points.weights)
    shares /= blade.omega[:m, None]
    return _stiffer(component, [shares.T @ (more[:, None] * shares) for more in (1 + d) ** 2 - 1])


def _known(component: Component, deviation: Array, modes: tuple[int, ...]) -> Array:
    """(N, *modes) deviations."""
    N, d = component.sectors, np.asarray(deviation, dtype=float)
    if N == 1:
        raise UserError(f"{component.name}: is not cyclic; scatter the frequencies of its modes")
    if d.shape != (N, *modes) or not (d > -1).all():
        raise UserError(f"deviation: {component.name} needs {N} numbers above -1, one a sector")
    return d


def _stiffer(component: Component, added: Sequence[Array]) -> Component:
    """The ring with a (2M, 2M) stiffness added in each sector, on what `_in_sector` tells."""
    ring = whole(component)
    group, more = ring.groups[0], np.zeros_like(ring.groups[0].K_r)
    for j, one in enumerate(added):
        T = _in_sector(component, j)
        more += T.T @ one @ T
    K = group.K_r + 0.5 * (more + more.T)
    omega = np.sqrt(np.maximum(scipy.linalg.eigvalsh(K, group.M_r), 0.0))
    return replace(ring, groups={0: replace(group, K_r=K, omega=omega)})


def _waves(component: Component) -> list[tuple[int, StressSet]]:
    """(sign of the imaginary part, stress set) of the nodal diameters 0 to N/2."""
    waves = []
    for k in range(component.sectors // 2 + 1):
        wave = component.at(k)
        points = wave.group.stresses.get(GAUSS)
        if points is None:
            raise UserError(
                f"{component.name}: its modal file has no strain at Gauss points; set output.gauss = true in its body"
            )
        waves.append((-1 if wave.conjugate else 1, points))
    return waves


def _of_sector(component: Component, key: str) -> Array:
    """(places, components, 2M) strain or stress of one sector, by the real parts of the M modes, then the imaginary."""
    waves = _waves(component)
    every = np.concatenate([np.where(s > 0, v := getattr(p, key), v.conj()) for s, p in waves], axis=2)
    return np.concatenate([every.real, every.imag], axis=2)


def _energy(strain: Array, stress: Array, weights: Array) -> Array:
    """(m, n) integrals of m strains and n stresses at places, (places, components, m) and (places, components, n)."""
    return (strain * weights[:, None, None]).reshape(-1, strain.shape[2]).T @ stress.reshape(-1, stress.shape[2])


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

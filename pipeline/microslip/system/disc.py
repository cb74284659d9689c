"""The whole ring of a cyclic body as one component in real coordinates, from the groups of its nodal diameters.

Sector j moves as w_j = sum over kappa of T_kappa a_kappa exp(i j kappa 2 pi / N), each vector in the axes of its own
sector, kappa from 0 to N - 1 and a_(N - kappa) the conjugate of a_kappa. With a = (c + i s) / sqrt(2 N), and
a = c / sqrt(N) for kappa = 0 and N/2, the real c and s of all nodal diameters are the coordinates of the ring: as many
as N sectors have, with the mass of the ring.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg

from ..data import Array, Compliance, Interface, ModalGroup, Rows
from ..errors import UserError
from ..reduced.coordinates import own_shapes
from .component import Component, InWave


def at_sector(name: str, sector: int) -> str:
    """Name of an interface, an excitation or a monitor of one sector of a whole ring."""
    return f"{name}@{sector}"


def whole(component: Component) -> Component:
    """The component of N sectors that a cyclic component stands for; its rows are named ``right@0``, ``right@1``, ...

    Of what the flow adds to the two directions of a nodal diameter it has the mean; `directed` has the rest.

    Raises:
        UserError: a nodal diameter is not in the file.
    """
    N = component.sectors
    waves = [component.at(k) for k in range(N // 2 + 1)]
    if any(w.group.N_r is not None for w in waves):
        raise UserError(f"{component.name}: a whole ring has no circulatory forces (N_r); use a sector")
    M, K, C = (A.real for A in _both_ways(component))
    first = component.at(0).group
    named: Any = {
        "interfaces": _faces(first, waves, N),
        **{kind: _rows(kind, waves, N) for kind in ("excitations", "monitors", "gauges")},
    }
    group = replace(
        first, M_r=M, K_r=K, C_r=C, G_r=np.zeros_like(M), kind=("ring",) * len(M), to_diagonal=None,
        phi=np.zeros((0, 3, len(M))), stresses={}, residual=None, compliance=_compliance(first, waves, N),
        omega=np.sqrt(np.maximum(scipy.linalg.eigvalsh(K, M), 0.0)), damping_ratio=np.zeros(len(M)), **named,
    )  # fmt: skip
    residual_share = None if component.residual_share is None else np.tile(component.residual_share, N)
    H = [_real(w.loss, k, N) for k, w in enumerate(waves) if w.loss is not None]
    loss = {0: scipy.linalg.block_diag(*H)} if H else {}
    return Component(component.name, {0: group}, 1, residual_share, loss=loss, residual_loss=component.residual_loss)


def directed(component: Component) -> Flow | None:
    """What the flow adds to the ring of `whole` in a vibration, whose waves it tells apart; None where it does not."""
    N = component.sectors
    if all(component.aerodynamic.get(k) == component.aerodynamic.get(N - k) for k in range(1, (N + 1) // 2)):
        return None
    _, K, C = _both_ways(component)
    return Flow((component.name,), 1j * K.imag, 1j * C.imag)


def _both_ways(component: Component) -> tuple[Array, ...]:
    """(ring, ring) complex M, K, C of both directions of every nodal diameter."""
    N, found = component.sectors, list[list[Array]]()
    for k in range(N // 2 + 1):
        ahead, back = component.at(k).matrices, component.at((N - k) % N).matrices
        pairs = zip(ahead, back, strict=True)
        found.append([A.real if _single(k, N) else 0.5 * _turned(A, B) for A, B in pairs])
    return tuple(scipy.linalg.block_diag(*own).astype(complex) for own in zip(*found, strict=True))


def _turned(A: Array, B: Array) -> Array:
    """For the coordinates (c, s) of waves (c + i s) / sqrt 2 with A and (c - i s) / sqrt 2 with B; twice that."""
    return np.block([[A + B, 1j * (A - B)], [-1j * (A - B), A + B]])


def _single(k: int, N: int) -> bool:
    return k == 0 or 2 * k == N


def _real(A: Array, k: int, N: int) -> Array:
    """A matrix of a nodal diameter for its coordinates c, or (c, s)."""
    return A.real if _single(k, N) else np.block([[A.real, -A.imag], [A.imag, A.real]])


def spread(rows: list[Array], sector: int, N: int) -> Array:
    """(r, all) rows (r, m) of the nodal diameters, read in one sector."""
    found = []
    for k, T in enumerate(rows):
        turned = T * np.exp(2j * np.pi * ((k * sector) % N) / N)
        if _single(k, N):
            found.append(turned.real / np.sqrt(N))
        else:
            found += [turned.real * np.sqrt(2 / N), -turned.imag * np.sqrt(2 / N)]
    return np.concatenate(found, axis=-1)


def _faces(first: ModalGroup, waves: list[InWave], N: int) -> dict[str, Interface]:
    found = {}
    for name, face in first.interfaces.items():
        for j in range(N):
            rows = spread([w.interface(name) for w in waves], j, N)
            size = rows.shape[1]
            found[at_sector(name, j)] = replace(
                face, rows=rows, fit_residual=np.zeros(size), shapes=np.zeros((0, 3, size)),
                characteristic=np.zeros((0, size)), pattern=np.zeros((0, 3, 0)),
            )  # fmt: skip
    return found


def _rows(kind: str, waves: list[InWave], N: int) -> dict[str, Rows]:
    named: list[Mapping[str, Rows]] = [getattr(w.group, kind) for w in waves]
    return {
        at_sector(name, j): replace(rows, rows=spread([n[name].rows for n in named], j, N))
        for name, rows in named[0].items()
        for j in range(N)
    }


def _compliance(first: ModalGroup, waves: list[InWave], N: int) -> Compliance:
    """Among the rows of all sectors: a block circulant of the waves' compliances."""
    c = first.compliance
    labels = tuple(
        f"{kind}:{at_sector(name, j)}:{row}"
        for j in range(N)
        for kind, name, row in (label.split(":", 2) for label in c.labels)
    )
    static, modal = (_circulant([getattr(w.group.compliance, key) for w in waves], N) for key in ("static", "modal"))
    return Compliance(labels, static, modal, c.inertia_relief)


def _circulant(blocks: list[Array], N: int) -> Array:
    r, k = len(blocks[0]), np.arange(N)
    every = np.array([blocks[i] if i <= N // 2 else blocks[N - i].conj() for i in k])
    ahead = np.array([np.tensordot(np.exp(2j * np.pi * k * d / N), every, axes=1).real / N for d in range(N)])
    out = np.zeros((N * r, N * r))
    for i in range(N):
        for j in range(N):
            out[i * r : (i + 1) * r, j * r : (j + 1) * r] = ahead[(i - j) % N]
    return out


# flow through the ring: what it adds differs from wave to wave --------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Flow:
    """Attributes:
    components: names. K, C: (n, n) Hermitian, on their coordinates one after the other, in a vibration exp(i w t) of
        w > 0; the mean meets the real part of K.
    """

    components: tuple[str, ...]
    K: Array
    C: Array


def through(blades: Sequence[Component], aerodynamic: Mapping[int, complex]) -> Flow:
    """What the flow adds to the blades of a ring, in the order of their sectors, so that each feels the motion of all.

    The coefficient a_n of the wave n (`Component.aerodynamic`) adds 2 Re(a_n) omega^2 to the stiffness of a mode and
    2 Im(a_n) omega to its damping. Of the modal amplitudes q_j of N blades the wave n is

            sum over j of q_j exp(-i 2 pi n j / N) / sqrt(N)

    so that the stiffness between the blades i and j is

            2 omega_i omega_j / N  sum over n of Re(a_n) exp(i 2 pi n (i - j) / N)

    and the damping likewise: block circulants of influence coefficients. They are complex where the two directions of a
    nodal diameter differ: a vibration knows its direction, the mean does not.
    """
    groups, N = [b.groups[0] for b in blades], len(blades)
    P = [g.M_r @ own_shapes(g) for g in groups]
    a = np.array([aerodynamic.get(n, 0.0) for n in range(N)])
    waves = np.exp(2j * np.pi * np.outer(np.arange(N), np.arange(N)) / N)
    same = np.allclose(a, a[-np.arange(N)], rtol=1e-15, atol=0)

    def added(part: Array, power: float) -> Array:
        L = (waves * (2 * part / N)) @ waves.conj().T
        S = scipy.linalg.block_diag(*[p * g.omega**power for p, g in zip(P, groups, strict=True)])
        return S @ np.kron(L.real if same else L, np.eye(len(groups[0].omega))) @ S.conj().T

    return Flow(tuple(b.name for b in blades), added(a.real, 1.0), added(a.imag, 0.5))

"""The whole ring of a cyclic body as one component in real coordinates, from the groups of its nodal diameters.

Sector j moves as w_j = sum over kappa of T_kappa a_kappa exp(i j kappa 2 pi / N), each vector in the axes of its own
sector, kappa from 0 to N - 1 and a_(N - kappa) the conjugate of a_kappa. With a = (c + i s) / sqrt(2 N), and
a = c / sqrt(N) for kappa = 0 and N/2, the real c and s of all nodal diameters are the coordinates of the ring: as many
as N sectors have, with the mass of the ring.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.linalg

from ..data import Array, Compliance, Interface, ModalGroup, Rows
from ..errors import UserError
from .component import Component, InWave
from .flow import Flow


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
        "excitations": _rows(first.excitations, lambda w, name: w.group.excitations[name].rows, waves, N),
        "monitors": _rows(first.monitors, lambda w, name: w.group.monitors[name].rows, waves, N),
        "gauges": _rows(first.gauges, lambda w, name: w.group.gauges[name].rows, waves, N),
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


def _rows(
    named: Mapping[str, Rows], of: Callable[[InWave, str], Array], waves: list[InWave], N: int
) -> dict[str, Rows]:
    found = {}
    for name, rows in named.items():
        for j in range(N):
            found[at_sector(name, j)] = replace(rows, rows=spread([of(w, name) for w in waves], j, N))
    return found


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

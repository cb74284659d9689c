"""The modal part of a body eliminated exactly: what is left are the harmonics of the contact coordinates.

A body with contacts to rigid ground has, in each harmonic h of the excitation,

    S_h q = f_h - T^T (F_h - p_h),    S_h = K - (h Omega)^2 M + i h Omega (C + G_gyro)
    d_h = T q - B (F_h - p_h) + e_h

with the rows T of the contact coordinates, the contact forces F, the preload p (of harmonic 0), the static compliance
B that the modes leave out among the contacts, and e_h what it gives under the excitation. d is the displacement from
the preloaded state. With a stiffness k of the contacts taken into the left side, F - p = k d + g,

    (S_h + T^T k' T) q = f_h - T^T (k' e_h + W g),    k' = k (1 + B k)^-1,    W = (1 + k B)^-1
    d_h = d_ref,h - D_h g_h

Any k gives the same answer. That of the sticking contact keeps everything finite: at resonances of the free body,
for a body that nothing but its contacts holds, and the numbers subtracted are of the size of the result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from ..data import Array, ComplexArray, ModalGroup
from .jenkins import Residual


@dataclass(frozen=True)
class Reduced:
    """A body with c contact coordinates as seen from them.

    Attributes:
        M, K, C: (m, m); C with the gyroscopic matrix. rows: (c, m) contact coordinates T. watch: (m,) monitored row.
        load: harmonic -> (m,) complex modal force. size: harmonic -> complex force in N that `load` stands for; what
            the residual compliance is multiplied with.
        residual: what the modes leave out. stiffness: (c, c) k.
    """

    M: Array
    K: Array
    C: Array
    rows: Array
    watch: Array
    load: dict[int, ComplexArray]
    size: dict[int, complex]
    residual: Residual
    stiffness: Array

    @property
    def count(self) -> int:
        """Number of contact coordinates."""
        return len(self.rows)


@dataclass(frozen=True)
class Seen:
    """One harmonic of a `Reduced` body at one frequency, and its derivative with respect to Omega.

    Attributes:
        reference: (c,) d_ref. compliance: (c, c) D, m/N. modal: (m,) q at d_ref. modal_compliance: (m, c) what g takes
            off q. reference_rate, compliance_rate: derivatives, s.
    """

    reference: ComplexArray
    compliance: ComplexArray
    modal: ComplexArray
    modal_compliance: ComplexArray
    reference_rate: ComplexArray
    compliance_rate: ComplexArray


def of_group(
    group: ModalGroup, interfaces: list[str], stiffness: Array, force: Array, watch: Array, amplitude: float,
    residual: Residual | None,
) -> Reduced:  # fmt: skip
    """The reduced body of a modal group under one harmonic force.

    Args:
        interfaces: names, six coordinates each. stiffness: (6c, 6c) k. force: (m,) modal force of the first harmonic.
            watch: (m,). amplitude: force in N that `force` stands for. residual: see `Reduced`; none if None.
    """
    rows = np.vstack([group.interfaces[name].rows for name in interfaces])
    n = len(rows)
    none = Residual(np.zeros((n, n)), np.zeros(n), np.zeros(n), 0.0)
    load = {1: np.asarray(force, dtype=complex)}
    C = group.C_r + group.G_r
    return Reduced(
        group.M_r, group.K_r, C, rows, watch, load, {1: complex(amplitude)}, residual or none, stiffness
    )  # fmt: skip


def seen(body: Reduced, Omega: float, harmonic: int) -> Seen:
    """The body in one harmonic of Omega (rad/s)."""
    B, k, T, w = body.residual.contacts, body.stiffness, body.rows, harmonic * Omega
    P = np.linalg.inv(np.eye(body.count) + B @ k)  # (1 + B k)^-1
    held = k @ P
    size = body.size.get(harmonic, 0.0)
    e = body.residual.force_on_contacts * size
    A = body.K - w**2 * body.M + 1j * w * body.C + T.T @ held @ T
    driven = body.load.get(harmonic, np.zeros(len(body.M))) - T.T @ (held @ e)
    X = np.linalg.solve(A, np.column_stack([driven, T.T @ P.T]))
    slope = -2 * harmonic * w * body.M + 1j * harmonic * body.C
    Y = -np.linalg.solve(A, slope @ X)
    reference, D = P @ (T @ X[:, 0] + e), P @ (T @ X[:, 1:] + B)
    return Seen(reference, D, X[:, 0], X[:, 1:], P @ (T @ Y[:, 0]), P @ (T @ Y[:, 1:]))


def monitored(body: Reduced, harmonic: int, q: ComplexArray, force: ComplexArray) -> complex:
    """Displacement of the monitor under (c,) contact forces less the preload, amplitudes of one harmonic."""
    r = body.residual
    moved = r.force_on_monitor * body.size.get(harmonic, 0.0) - r.contacts_on_monitor @ force
    return complex(body.watch @ q + moved)


def work(body: Reduced, Omega: float, harmonic: int, q: ComplexArray, force: ComplexArray) -> tuple[float, float]:
    """Work of the excitation and loss in the body's own damping, J a cycle, in one harmonic that is not 0."""
    load, size = body.load.get(harmonic, np.zeros(len(q))), body.size.get(harmonic, 0.0)
    moved = load.conj() @ q - np.conj(size) * (body.residual.force_on_contacts @ force)
    lost = np.pi * harmonic * (q.conj() @ (Omega * harmonic * body.C) @ q).real
    return -np.pi * harmonic * float(moved.imag), float(lost)


def stuck(body: Reduced) -> Array:
    """(m,) eigenfrequencies in Hz with the contacts as stiff as `stiffness`, damping and gyroscopic forces left out."""
    k = body.stiffness @ np.linalg.inv(np.eye(body.count) + body.residual.contacts @ body.stiffness)
    K = body.K + body.rows.T @ k @ body.rows
    values = scipy.linalg.eigh(0.5 * (K + K.T), body.M, eigvals_only=True)
    return np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi)


def real_block(D: ComplexArray) -> Array:
    """(2c, 2c) acting on (cos, sin) parts of a vector what D does on its amplitude, cos part - i sin part."""
    return np.block([[D.real, D.imag], [-D.imag, D.real]])

"""Contact stiffness from a measured frequency: the frequencies of a coupled system over its contacts' stiffness.

Sextro section 5.4, Fig. 5.4-1: the stiffnesses are tuned so that one nodal diameter has its measured frequency, the
others are then predicted. The frequencies of bodies joined by springs rise with every spring, so that the stiffness is
the root of one monotone function, if it has one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.optimize

from ..contact.patch import Patch
from ..data import Array, Indices
from ..errors import UserError
from ..system.assembly import Assembly
from ..system.component import Ring

OPEN, RIGID = 1e-10, 1e5
"""Shares of the stiffness that the highest mode has at a contact, below and above which a contact is as good as open
and as good as rigid."""


@dataclass(frozen=True)
class MeasuredFrequency:
    """A measured frequency: mode `mode` (from 0) of the nodal diameter of an index (see `Ring.index`), Hz."""

    index: int
    frequency: float
    mode: int = 0


@dataclass(frozen=True, eq=False)
class NodalDiagram:
    """Frequencies of a coupled system over the nodal diameter.

    Attributes:
        index: (k,) of the waves. frequency: (k, m) Hz, ascending. stiffness: c_N, N/m of a contact. ratio: c_T / c_N.
    """

    index: Indices
    frequency: Array
    stiffness: float
    ratio: float

    def columns(self) -> dict[str, Array]:
        """Name -> column, for a table."""
        modes = {f"mode_{j + 1}_Hz": f for j, f in enumerate(self.frequency.T)}
        return {"nodal_diameter": self.index.astype(float), **modes}


@dataclass(frozen=True, eq=False)
class IdentifiedStiffness:
    """A contact stiffness that gives one measured frequency.

    Attributes:
        stiffness: c_N, N/m of a contact. ratio: c_T / c_N. fitted: what it was fitted to. limits: Hz, the frequency
            with open and with rigidly joined contacts. sensitivity: relative change of the frequency over that of the
            stiffness. measured: everything that is known. predicted: (n,) Hz of them.
    """

    stiffness: float
    ratio: float
    fitted: MeasuredFrequency
    limits: tuple[float, float]
    sensitivity: float
    measured: tuple[MeasuredFrequency, ...]
    predicted: Array

    @property
    def error(self) -> Array:
        """(n,) relative error of the frequencies of `measured`."""
        return self.predicted / np.array([m.frequency for m in self.measured]) - 1

    def columns(self) -> dict[str, Array]:
        """Name -> column, for a table."""
        return {
            "nodal_diameter": np.array([m.index for m in self.measured], dtype=float),
            "mode": np.array([m.mode + 1 for m in self.measured], dtype=float),
            "measured_Hz": np.array([m.frequency for m in self.measured]),
            "predicted_Hz": self.predicted,
            "relative_error": self.error,
            "fitted": np.array([float(m == self.fitted) for m in self.measured]),
        }

    def sentences(self) -> list[str]:
        """The result in words."""
        others = [abs(e) for e, m in zip(self.error, self.measured, strict=True) if m != self.fitted]
        low, high = self.limits
        out = [
            f"c_N = {self.stiffness:.6g} N/m and c_T = {self.ratio * self.stiffness:.6g} N/m give the nodal diameter "
            f"{self.fitted.index} its {self.fitted.frequency:.6g} Hz (open contacts {low:.6g} Hz, rigid ones "
            f"{high:.6g} Hz). An error of 1 % of this frequency is one of {1 / max(self.sensitivity, 1e-300):.3g} % of "
            "the stiffness."
        ]
        if others:
            out.append(f"The {len(others)} other frequencies are predicted to {100 * max(others):.3g} % or better.")
        return out


def springs(patch: Patch, normal: float, tangential: float) -> Array:
    """(k, k) stiffness of a patch that sticks, shared out evenly over its area (Sextro Eqs. (5.2-39) to (5.2-41)).

    Args:
        normal, tangential: N/m of the whole patch.
    """
    G, share = patch.kinematics, patch.areas / patch.areas.sum()
    return np.einsum("n,nia,i,nib->ab", share, G, np.array([normal, tangential, tangential]), G)


@dataclass(frozen=True, eq=False)
class Coupling:
    """An assembly in one wave whose contacts are springs: its frequencies over the springs' stiffness.

    Attributes:
        M, K: (m, m) without contacts. rows: (c, m) relative motions. residual: (c, c) m/N beside the coordinates.
        unit: (c, c) springs per N/m of normal stiffness.
    """

    M: Array
    K: Array
    rows: Array
    residual: Array
    unit: Array

    def frequencies(self, stiffness: float) -> Array:
        """(m,) Hz, ascending; damping and gyroscopic forces left out."""
        k = stiffness * self.unit
        k = k @ np.linalg.inv(np.eye(len(k)) + self.residual @ k)
        K = self.K + self.rows.conj().T @ k @ self.rows
        K = 0.5 * (K + K.conj().T)
        try:
            values = scipy.linalg.eigh(K, self.M, eigvals_only=True)
        except np.linalg.LinAlgError:  # coordinates without mass: the finite ones
            inverse = scipy.linalg.eigh(self.M, K, eigvals_only=True)
            values = 1 / inverse[inverse > 1e-14 * inverse.max()][::-1]
        return np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi)

    @property
    def scale(self) -> float:
        """N/m, what the highest mode has at a contact."""
        moved = np.einsum("am,ab,bm->m", self.rows.conj(), self.unit, self.rows).real
        return float(np.abs(np.diag(self.K)).max() / max(moved.max(initial=0.0), 1e-300))


def coupling(assembly: Assembly, index: int, ratio: float) -> Coupling:
    """The assembly in the wave of an index, all contacts alike in c_N and in c_T / c_N = ratio."""
    bare = replace(assembly, loads=(), outputs=())
    part = (replace(bare, ring=Ring(assembly.ring.blades, index)) if assembly.ring else bare).joined(1)
    unit = [springs(c.patch, 1.0, ratio) for c in assembly.contacts]
    return Coupling(part.M, part.K, part.rows, part.residual, scipy.linalg.block_diag(*unit))


def nodal_diagram(
    assembly: Assembly, stiffness: float, ratio: float, indices: Sequence[int] | None = None, modes: int = 6
) -> NodalDiagram:
    """Frequencies of the coupled system over the nodal diameter, from 0 to N/2 if not told which.

    Raises:
        UserError: a nodal diameter that the modal file does not hold.
    """
    waves = list(indices if indices is not None else range(assembly.blades // 2 + 1))
    found = [coupling(assembly, k, ratio).frequencies(stiffness)[:modes] for k in waves]
    return NodalDiagram(np.array(waves), np.array(found), stiffness, ratio)


def identify(
    assembly: Assembly, fit: MeasuredFrequency, ratio: float, measured: Sequence[MeasuredFrequency] = ()
) -> IdentifiedStiffness:
    """The contact stiffness that gives one measured frequency, and what it predicts for others.

    Args:
        assembly: whose contacts take the stiffness; their preload and law do not matter. ratio: c_T / c_N, kept.
            measured: what is to be predicted.

    Raises:
        UserError: a frequency that no stiffness gives, a ratio that is not above 0, a mode that there is not.
    """
    if not assembly.contacts:
        raise UserError("identification: the bodies have no contact whose stiffness could be found; add one")
    if not ratio > 0:
        raise UserError(f"identification: ratio: c_T / c_N = {ratio:g} must be above 0; correct it")
    f = _Mode(assembly, fit, ratio)
    lowest, highest = OPEN * f.coupling.scale, RIGID * f.coupling.scale
    low, high = f(lowest), f(highest)
    if not low < fit.frequency < high:
        raise UserError(
            f"identification: mode {fit.mode + 1} of nodal diameter {fit.index} has {low:.6g} Hz with open and "
            f"{high:.6g} Hz with rigid contacts: no stiffness gives the measured {fit.frequency:.6g} Hz; check mode, "
            "nodal diameter and the modal file"
        )
    root = scipy.optimize.brentq(
        lambda x: f(np.exp(x)) - fit.frequency, np.log(lowest), np.log(highest), xtol=1e-13, rtol=1e-15, maxiter=300
    )
    stiffness, h = float(np.exp(root)), 1e-3
    slope = float(np.log(f(stiffness * np.exp(h)) / f(stiffness * np.exp(-h))) / (2 * h))
    measured_all = tuple(measured) if fit in measured else (fit, *measured)
    predicted = np.array([_Mode(assembly, m, ratio)(stiffness) for m in measured_all])
    return IdentifiedStiffness(stiffness, ratio, fit, (low, high), slope, measured_all, predicted)


class _Mode:
    """The frequency (Hz) of one mode over the stiffness (N/m)."""

    def __init__(self, assembly: Assembly, of: MeasuredFrequency, ratio: float) -> None:
        self.coupling, self.of = coupling(assembly, of.index, ratio), of
        if of.mode >= len(self.coupling.K):
            raise UserError(
                f"identification: mode {of.mode + 1} of nodal diameter {of.index}: the bodies have only "
                f"{len(self.coupling.K)} coordinates; correct the mode or keep more of them"
            )

    def __call__(self, stiffness: float) -> float:
        return float(self.coupling.frequencies(stiffness)[self.of.mode])

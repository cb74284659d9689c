"""Measured frequency responses (data set 58) beside the identified modes: do the modes give them back?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..data import Array, ModalGroup

_RESPONSE, _FREQUENCY, _FORCE = 4, 18, 13
"""Function type of a frequency response, types of data: frequency, excitation force."""
_MOVEMENTS = {8: 0, 11: 1, 12: 2}
"""Type of data of the response -> how often the displacement is differentiated in time."""
_BAND = 0.05
"""How far a function is looked at beyond the first and the last mode, in parts of their frequencies."""
_LEAST = 8
"""Lines in that band, at least."""
_LEVEL = 3.0
"""Factor between measured and superposed level that no test explains, but a unit or a modal mass does."""


@dataclass(frozen=True)
class Fit:
    """One function against the modes. frac: 0 to 1. level: superposed over measured, root of the sums of squares."""

    label: str
    frac: float
    level: float


def fits(sets: list[dict[str, Any]], g: ModalGroup, number: Array, per_si: float) -> list[Fit]:
    """Frequency responses that the modes can give.

    Args:
        sets: data sets 58. number: (n,) of the points of phi, which is scaled by modal masses.
        per_si: the file's receptance of 1 m/N.
    """
    place = {int(n): i for i, n in enumerate(number)}
    found = []
    for s in sets:
        if s.get("func_type") != _RESPONSE or s.get("abscissa_spec_data_type", _FREQUENCY) not in (0, _FREQUENCY):
            continue
        moved, force = s.get("ordinate_spec_data_type"), s.get("orddenom_spec_data_type")
        rows = [_row(g, place, s.get(f"{end}_node"), s.get(f"{end}_dir")) for end in ("rsp", "ref")]
        if moved not in _MOVEMENTS or force not in (0, _FORCE) or rows[0] is None or rows[1] is None:
            continue
        f, H = np.asarray(s.get("x"), dtype=float), np.asarray(s.get("data"), dtype=complex)
        fit = _fit(f, H / per_si, rows[0] * rows[1], g, _MOVEMENTS[moved])
        if fit is not None:
            found.append(Fit(f"{_name(s, 'rsp')} due to {_name(s, 'ref')}", *fit))
    return found


def _name(s: dict[str, Any], end: str) -> str:
    return f"{int(s[f'{end}_node'])}{'xyz'[abs(int(s[f'{end}_dir'])) - 1]}"


def _row(g: ModalGroup, place: dict[int, int], node: Any, way: Any) -> Array | None:
    """(m,) shapes at one direction, None if it was not measured."""
    try:
        node, way = int(node), int(way)
    except (TypeError, ValueError):
        return None
    if node not in place or not 1 <= abs(way) <= 3:
        return None
    row: Array = np.sign(way) * g.phi[place[node], abs(way) - 1]
    return row if np.abs(row).max() > 0 else None


def _fit(f: Array, H: Array, residues: Array, g: ModalGroup, moved: int) -> tuple[float, float] | None:
    """FRAC and level of the superposition sum_j r_j (i Omega)^n / (omega_j^2 - Omega^2 + 2 i D_j omega_j Omega).

    Allemang 2003, Sound and Vibration 37(8), The modal assurance criterion - twenty years of use and abuse.
    """
    if f.ndim != 1 or f.shape != H.shape:
        return None
    band = (f >= (1 - _BAND) * g.frequency[0]) & (f <= (1 + _BAND) * g.frequency[-1]) & np.isfinite(H)
    if band.sum() < _LEAST:
        return None
    W, w = 2 * np.pi * f[band][:, None], g.omega
    S = (residues / (w**2 - W**2 + 2j * g.damping_ratio * w * W)).sum(axis=1) * (1j * W[:, 0]) ** moved
    M = H[band]
    a, b = float((np.abs(M) ** 2).sum()), float((np.abs(S) ** 2).sum())
    if not (0 < a < np.inf and 0 < b < np.inf):
        return None
    return float(abs(np.vdot(M, S)) ** 2 / (a * b)), float(np.sqrt(b / a))


def fit_messages(found: list[Fit], count: int) -> list[str]:
    """What to say of them."""
    if not found:
        return [
            f"{count} measured functions (data sets 58, 55) are left aside: none is a frequency response between "
            "points of the modes, at their frequencies and with modal masses"
        ]
    worst = min(found, key=lambda x: x.frac)
    level = np.array([x.level for x in found])
    lines = [
        f"{len(found)} of {count} measured functions are frequency responses that the modes give back: FRAC "
        f"{worst.frac:.3f} ({worst.label}) to {max(x.frac for x in found):.3f}, levels {level.min():.3g} to "
        f"{level.max():.3g} times the measured ones"
    ]
    middle = float(np.median(level))
    if not 1 / _LEVEL < middle < _LEVEL:
        lines.append(
            f"warning: the modes respond {middle:.3g} times as strongly as was measured; modal masses and units "
            "(data set 164) do not belong to these functions"
        )
    return lines

"""How strongly the blades of a ring are strained in the first harmonic: the worst of their nodes and gauges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import Array, ComplexArray, ModalGroup
from ..system.assembly import Assembly


def worst(ring: Assembly, q: Sequence[ComplexArray]) -> tuple[float, float]:
    """Stress amplitude (von Mises, Pa) at the worst node and strain amplitude at the worst gauge of the bodies that are
    read, 0-peak; NaN of what their modal files do not have.

    Args:
        q: amplitudes of the coordinates, component by component, in pieces of any length.
    """
    read = {w.component for w in ring.outputs}
    groups = [m.groups[0] for m in ring.components]
    own = np.split(np.concatenate(q), np.cumsum([len(g.M_r) for g in groups])[:-1])
    blades = [(g, a) for m, g, a in zip(ring.components, groups, own, strict=True) if m.name in read]
    stress, strain = (np.array([of(g, a) for g, a in blades]) for of in (_stress, _strain))
    return _largest(stress), _largest(strain)


def _largest(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.max()) if len(known) else np.nan


def _strain(group: ModalGroup, q: ComplexArray) -> float:
    return max((float(np.abs(rows.rows @ q).max()) for rows in group.gauges.values()), default=np.nan)


def _stress(group: ModalGroup, q: ComplexArray) -> float:
    """Of s = Re(a exp(i t)) the largest s^T Q s over a cycle is (a^H Q a + abs(a^T Q a)) / 2."""
    if "nodes" not in group.stresses:
        return np.nan
    a = group.stresses["nodes"].stress @ q
    b = a @ MISES
    squares = (a.conj() * b).sum(axis=1).real + np.abs((a * b).sum(axis=1))
    return float(np.sqrt(0.5 * squares.max()))


MISES = np.diag([1.5, 1.5, 1.5, 3.0, 3.0, 3.0])
"""Q of the von Mises stress s^T Q s of (xx, yy, zz, three shears)."""
MISES[:3, :3] -= 0.5

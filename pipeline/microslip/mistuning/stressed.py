"""How strongly the blades of a ring are strained in the first harmonic: the worst of their gauges, and of their nodes
outside the singular zones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data import Array, ComplexArray, ModalGroup
from ..operating.stress import counted
from ..system.assembly import Assembly


def worst(ring: Assembly, q: Sequence[ComplexArray]) -> tuple[float, float]:
    """Stress amplitude (von Mises, Pa) at the worst node and strain amplitude at the worst gauge of the bodies that are
    read, 0-peak; NaN of what their modal files do not have, or do not feel.

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
    read = [np.abs(row @ q) for gauge in group.gauges.values() for row in gauge.rows
            if np.abs(row @ q) > READS * np.linalg.norm(row) * np.linalg.norm(q)]  # fmt: skip
    return float(max(read, default=np.nan))


READS = 1e-9
"""Share of what a motion as large could make a gauge read, below which it reads rounding: by symmetry, say."""


def _stress(group: ModalGroup, q: ComplexArray) -> float:
    """Of s = Re(a exp(i t)) the largest s^T Q s over a cycle is (a^H Q a + abs(a^T Q a)) / 2."""
    if "nodes" not in group.stresses:
        return np.nan
    a = group.stresses["nodes"].stress[counted(group)] @ q
    b = a @ MISES
    squares = (a.conj() * b).sum(axis=1).real + np.abs((a * b).sum(axis=1))
    return float(np.sqrt(0.5 * squares.max()))


MISES = np.diag([1.5, 1.5, 1.5, 3.0, 3.0, 3.0])
"""Q of the von Mises stress s^T Q s of (xx, yy, zz, three shears)."""
MISES[:3, :3] -= 0.5

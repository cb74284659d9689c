"""Flow through a whole ring: what it adds differs from wave to wave, so that every blade feels the motion of all.

The coefficient a_n of the wave n (`Component.aerodynamic`) adds 2 Re(a_n) omega^2 to the stiffness of a mode and
2 Im(a_n) omega to its damping. Of the modal amplitudes q_j of N blades the wave n is

    sum over j of q_j exp(-i 2 pi n j / N) / sqrt(N)

so that the stiffness between the blades i and j is

    2 omega_i omega_j / N  sum over n of Re(a_n) exp(i 2 pi n (i - j) / N)

and the damping likewise: block circulants of influence coefficients. They are complex where the two directions of a
nodal diameter differ: a vibration knows its direction, the mean does not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from ..data import Array
from .component import Component


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
    """What the flow adds to the blades of a ring, in the order of their sectors."""
    groups, N = [b.groups[0] for b in blades], len(blades)
    V = [np.eye(len(g.M_r)) if g.to_diagonal is None else g.to_diagonal for g in groups]
    P = [g.M_r @ v for g, v in zip(groups, V, strict=True)]
    a = np.array([aerodynamic.get(n, 0.0) for n in range(N)])
    waves = np.exp(2j * np.pi * np.outer(np.arange(N), np.arange(N)) / N)
    same = np.allclose(a, a[-np.arange(N)], rtol=1e-15, atol=0)

    def added(part: Array, power: float) -> Array:
        L = (waves * (2 * part / N)) @ waves.conj().T
        S = scipy.linalg.block_diag(*[p * g.omega**power for p, g in zip(P, groups, strict=True)])
        return S @ np.kron(L.real if same else L, np.eye(len(groups[0].omega))) @ S.conj().T

    return Flow(tuple(b.name for b in blades), added(a.real, 1.0), added(a.imag, 0.5))

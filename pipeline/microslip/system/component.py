"""A body in an assembly: its modal groups, in the waves of a ring."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..data import Array, ModalGroup
from ..errors import UserError
from ..reduced.coordinates import of_modes

if TYPE_CHECKING:
    from .spin import Spin


@dataclass(frozen=True)
class Ring:
    """N equal sectors in a circle and a wave that runs round them.

    Attributes:
        blades: N. order: base engine order e; the phase from one sector to the next is exp(i h e 2 pi / N) in harmonic
            h. Negative for a pattern that runs the other way.
    """

    blades: int
    order: int = 1

    def index(self, harmonic: int) -> int:
        """h e mod N, 0 <= index < N; above N/2 the wave of N - index running the other way."""
        return (harmonic * self.order) % self.blades


@dataclass(frozen=True, eq=False)
class Component:
    """A body of an assembly.

    Attributes:
        name. groups: index of a ring (see `Ring.index`) -> group; a body that is not cyclic has one, under 0. What the
            conjugate of a stored group gives need not be there. sectors: N of a cyclic body, else 1.
        residual_share: (r,) share of each compliance label's residual that is added to the modes; None: nothing.
        aerodynamic: index of a ring -> relative frequency shift + i times damping ratio that the flow adds to every
            mode, in the travelling wave of that index.
        loss: index of a ring -> (m, m) H of a body with a loss factor, whose stiffness is K + i H in every harmonic but
            the mean (see `damping.as_loss`). residual_loss: loss factor of the compliance that `residual_share` adds.
        spin: how its material runs through its standing shape, which the groups hold already (see `spin.turned`).
    """

    name: str
    groups: Mapping[int, ModalGroup]
    sectors: int = 1
    residual_share: Array | None = None
    aerodynamic: Mapping[int, complex] = field(default_factory=dict)
    loss: Mapping[int, Array] = field(default_factory=dict)
    residual_loss: float = 0.0
    spin: Spin | None = None

    def at(self, index: int) -> InWave:
        """Matrices and rows in the wave of a ring's index.

        Raises:
            UserError: the modal file has no such nodal diameter.
        """
        if self.sectors == 1:
            return self._wave(0, False, index)
        other = (self.sectors - index) % self.sectors
        if index in self.groups:
            return self._wave(index, False, index)
        if other in self.groups:
            return self._wave(other, True, index)
        known = ", ".join(str(k) for k in sorted(self.groups))
        raise UserError(
            f"{self.name}: the nodal diameter {min(index, other)} is needed, but the modal file holds {known}; add it "
            'to cyclic.nodal_diameters of the body, or write "all"'
        )

    def _wave(self, stored: int, conjugate: bool, index: int) -> InWave:
        loss = self.loss.get(stored)
        return InWave(self.groups[stored], conjugate, self.residual_share, self.aerodynamic.get(index, 0.0), loss)


@dataclass(frozen=True)
class InWave:
    """A component in one wave: its group, or the conjugate of it. See `Component`."""

    group: ModalGroup
    conjugate: bool
    residual_share: Array | None
    aerodynamic: complex
    own_loss: Array | None = None

    def _moving(self, values: Array) -> Array:
        return values.conj() if self.conjugate else values

    @cached_property
    def matrices(self) -> tuple[Array, Array, Array]:
        """(m, m) M, K, C with the gyroscopic matrix and what the flow adds."""
        g = self.group
        M, K, C = g.M_r, g.K_r, g.C_r + g.G_r
        if self.aerodynamic:
            K = K + of_modes(g, 2 * self.aerodynamic.real * g.omega**2)
            C = C + of_modes(g, 2 * self.aerodynamic.imag * g.omega)
        return self._moving(M), self._moving(K), self._moving(C)

    @property
    def circulatory(self) -> Array:
        """(m, m) N, what the stiffness holds beside the symmetric part in `matrices`."""
        N = self.group.N_r
        return np.zeros_like(self.group.K_r) if N is None else self._moving(N)

    @property
    def loss(self) -> Array | None:
        """(m, m) H, see `Component`."""
        return None if self.own_loss is None else self._moving(self.own_loss)

    def interface(self, name: str) -> Array:
        """(6, m) rows of an interface."""
        return self._moving(self.group.interfaces[name].rows)

    def excitation(self, name: str) -> Array:
        """(m,) row of an excitation."""
        return self._moving(self.group.excitations[name].rows[0])

    def monitor(self, name: str, label: str) -> Array:
        """(m,) row of a monitor or a gauge."""
        found = self.group.monitors.get(name) or self.group.gauges[name]
        return self._moving(found.rows[found.labels.index(label)])

    def residual(self, rows: Sequence[str], columns: Sequence[str]) -> Array:
        """(rows, columns) residual compliance among labels; zero for those that the compliance does not know."""
        out = np.zeros((len(rows), len(columns)), dtype=self.group.compliance.static.dtype)
        if self.residual_share is None or not len(rows) or not len(columns):
            return out
        names = {label: i for i, label in enumerate(self.group.compliance.labels)}
        left = self.group.compliance.residual * np.outer(self.residual_share, self.residual_share)
        a = [(i, names[r]) for i, r in enumerate(rows) if r in names]
        b = [(j, names[c]) for j, c in enumerate(columns) if c in names]
        if a and b:
            (i, p), (j, q) = np.array(a).T, np.array(b).T
            out[np.ix_(i, j)] = left[np.ix_(p, q)]
        return self._moving(out)

"""Contacts while Newton looks for a static state: when faces are cut again and pressures raised."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..data import Array
from ..errors import NotConverged
from ..fem.contact import ContactPair, Cut, Grip, contact_stiffness, cut_pair, grip, has_slid
from ..fem.discretise import Pattern

NEAR = 1e-3
"""Multipliers are raised in every Newton step once a step is below this share of the displacement."""

SETTLED = 1e-6
"""They stand when they differ from the pressures by less than this share of the largest one."""


SMALL = 1e-7
"""Steps below this share of the displacement are taken whole."""


def _zero(rest: Callable[[float], float], begin: float) -> float:
    """Where a falling function, `begin` at 0, has fallen to about zero; 1 if it does not get there before.

    Regula falsi and bisection in turn; a jump is passed, so that what closes there is closed in the next step.
    """
    low, left, high, right = 0.0, begin, 1.0, rest(1.0)
    for turn in range(40):
        if right > -0.3 * begin or high - low < 1e-3 * high:
            break
        share = 0.5 * (low + high) if turn % 2 else (low * right - high * left) / (right - left)
        now = rest(share)
        if now > 0:
            low, left = share, now
        else:
            high, right = share, now
    return high


def _cut(pair: ContactPair, x: Array) -> Cut:
    made = cut_pair(pair, x)
    if not made.points:
        raise NotConverged(f"closures.{pair.name}: the faces lose each other on the way to the static state")
    return made


class Closing:
    """All contacts of a body at a share `level` of the loads; `start`: those of a neighbouring state."""

    def __init__(self, pairs: tuple[ContactPair, ...], x: Array, level: float, start: tuple[Grip, ...] = ()) -> None:
        self.pairs, self.level = pairs, level
        given = {g.pair.name: g.multiplier for g in start}
        self.multipliers = [given.get(p.name, np.zeros(len(p.nodes))) for p in pairs]
        self.cuts: list[Cut] = [_cut(p, x) for p in pairs]
        self.grips: tuple[Grip, ...] = ()
        self.bent = self.held = False

    def move(self, x: Array, step: float) -> None:
        """Evaluate at positions x (n, 3) after a Newton step of relative size `step`."""
        before = self.grips
        self.bent = self.held = False
        self._evaluate(x)
        if step >= NEAR or any((a.touching != b.touching).any() for a, b in zip(before, self.grips, strict=True)):
            return
        self.multipliers = [g.pressure for g in self.grips]
        slid = [has_slid(p, c, x) for p, c in zip(self.pairs, self.cuts, strict=True)]
        self.cuts = [_cut(p, x) if s else c for p, c, s in zip(self.pairs, self.cuts, slid, strict=True)]
        # a new cut moves the mean gaps a little: a step with the same nodes closed takes that up
        self.held = any(slid)
        self.bent = not self.held
        self._evaluate(x, [g.touching if s else None for g, s in zip(self.grips, slid, strict=True)])

    def _evaluate(self, x: Array, held: Sequence[Array | None] | None = None) -> None:
        parts = zip(self.pairs, self.cuts, self.multipliers, held or [None] * len(self.pairs), strict=True)
        self.grips = tuple(grip(p, c, x, m, self.level, h) for p, c, m, h in parts)

    @property
    def settled(self) -> bool:
        """Whether the multipliers are the pressures."""
        return all(
            np.abs(g.pressure - g.multiplier).max(initial=0.0) <= SETTLED * g.pressure.max(initial=0.0)
            for g in self.grips
        )

    def with_forces(self, force: Array) -> Array:
        """(n, 3) forces with those of the contacts, N."""
        return sum((g.force for g in self.grips), start=force)

    def share(self, x: Array, change: Array, step: float, work: float) -> float:
        """Share of a Newton step `change` (n, 3) after which the potential energy has about stopped falling.

        Closing faces stiffen so suddenly that whole steps may run to and fro between two sets of closed nodes for
        ever. work: J, of the forces out of balance on the step; that of the body falls linearly to zero over it, that
        of the contacts is evaluated.
        """
        if not self.pairs or self.held or step < SMALL or work <= 0:
            return 1.0
        at_once = self._work(x, change)
        stiff = sum(float(np.sum(change * -g.force_change(change, self.bent))) for g in self.grips)

        def rest(share: float) -> float:
            return work - share * (work - stiff) + self._work(x + share * change, change) - at_once

        return _zero(rest, work)

    def _work(self, x: Array, change: Array) -> float:
        parts = zip(self.pairs, self.cuts, self.multipliers, strict=True)
        return sum(float(np.sum(grip(p, c, x, m, self.level).force * change)) for p, c, m in parts)

    def stiffened(self, K: Array, pattern: Pattern, kept: bool = False, neighbours: bool = True) -> Array:
        """(p, 3, 3) stiffness with that of the contacts, N/m.

        Args:
            kept: of those alone that stay closed in the modes. neighbours: False leaves out those between sectors,
                whose stiffness depends on the nodal diameter.
        """
        chosen = [g for g in self.grips if g.pair.stays_closed or not kept]
        chosen = [g for g in chosen if neighbours or not g.pair.between_sectors]
        return sum((contact_stiffness(g, pattern, self.bent) for g in chosen), start=K)

"""Springs so weak that they hardly matter, for bodies that nothing holds; and whether they are."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..data import Array, ModalGroup
from ..errors import UserError
from ..harmonic_balance.reduced import stuck_modes

if TYPE_CHECKING:
    from .assemble import Built

SHIFT = 0.01
"""Share of a frequency by which weak springs raise it, from which on they are told of."""


def on_weak_springs(group: ModalGroup, frequency: float) -> ModalGroup:
    """The group on springs that give each of its rigid motions a frequency (Hz); elastic modes are left alone.

    Raises:
        UserError: the body has no rigid motion.
    """
    if not (group.omega == 0).any():
        raise UserError("the body is held already; weak_springs are for bodies with free = true, leave them out")
    return replace(group, K_r=group.K_r + _springs(group, frequency))


def _springs(group: ModalGroup, frequency: float) -> Array:
    V = np.eye(len(group.M_r)) if group.to_diagonal is None else group.to_diagonal
    P = group.M_r @ V[:, group.omega == 0]
    return (2 * np.pi * frequency) ** 2 * P @ P.conj().T


def raising(built: Built, normal: float | None) -> list[str]:
    """The mode with sticking contacts that weak springs raise most, of those that the sweep sees.

    By the energy in the springs, sum of phi^H K phi / (2 omega^2) with phi^H M phi = 1. normal: N, see `Built.pressed`.
    """
    soft = {b.name: b.weak_springs for b in built.settings.components if b.weak_springs is not None}
    if not soft or built.settings.ring:
        return []
    assembly, sweep = built.pressed(normal), built.settings.sweep
    values, shapes = stuck_modes(assembly.joined(1), assembly.stiffness)
    f, energy, at = np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi), np.zeros(len(values)), 0
    for component in assembly.components:
        group = next(iter(component.groups.values()))
        own, at = shapes[at : at + len(group.M_r)], at + len(group.M_r)
        if component.name in soft:
            energy += np.einsum("im,ij,jm->m", own.conj(), _springs(group, soft[component.name]), own).real
    seen = (f > 0.5 * sweep.start) & (f < 2 * sweep.stop)
    share = np.divide(energy, 2 * values, out=np.zeros_like(energy), where=seen)
    most = int(share.argmax())
    if not share[most] > SHIFT:
        return []
    softer = max(soft.values()) * np.sqrt(0.1 * SHIFT / share[most])
    return [
        f"The weak springs of {', '.join(soft)} raise the mode with sticking contacts at {f[most]:.5g} Hz by about "
        f"{100 * share[most]:.2g} %; give weak_springs = {softer:.1g}, or hold the body, to be rid of that."
    ]

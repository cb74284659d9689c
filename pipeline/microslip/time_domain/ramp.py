"""A run-up or run-down: loads whose frequency goes linearly from one to another.

The motion between contact forces is then none of constant coefficients. Its loads are kicks at the steps, as the
contacts' forces are: of second order, with the phase psi the integral of the frequency omega.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..data import CENTRIFUGAL, Array
from ..errors import UserError
from ..system.assembly import Assembly


@dataclass(frozen=True)
class Ramp:
    """Frequency of the first harmonic of the loads over time, and what turns with it.

    Attributes:
        first, last: rad/s. time: s, from one to the other; after it the last one stays. order: of the excitation, the
            bodies turn with omega / order. euler: names of the bodies that feel the angular acceleration of that.
    """

    first: float
    last: float
    time: float
    order: int = 1
    euler: tuple[str, ...] = ()

    @property
    def rate(self) -> float:
        """rad/s^2."""
        return (self.last - self.first) / self.time

    @property
    def periods(self) -> int:
        """Of the highest frequency, that last as long as the change."""
        return int(np.ceil(self.time * max(self.first, self.last) / (2 * np.pi) - 1e-9))

    def omega(self, time: Any, xp: Any = np) -> Any:
        """rad/s at times (s)."""
        return self.first + self.rate * xp.minimum(time, self.time)

    def driving(self, time: Any, harmonics: Sequence[int], xp: Any = np) -> Any:
        """(..., 1 + 2 H + 2) at times (s): 1, cos h psi, sin h psi, ..., the square of the rotation speed and its
        acceleration, (rad/s)^2 and rad/s^2."""
        time = xp.asarray(time)
        t = xp.minimum(time, self.time)
        psi = self.first * t + 0.5 * self.rate * t**2 + self.last * (time - t)
        waves = [wave(h * psi) for h in harmonics for wave in (xp.cos, xp.sin)]
        speed = self.omega(time, xp) / self.order
        rising = xp.where(time < self.time, self.rate / self.order, 0.0)
        return xp.stack([xp.ones_like(psi), *waves, speed**2, rising], axis=-1)


def turning_loads(assembly: Assembly, ramp: Ramp) -> tuple[Assembly, Array, Array]:
    """The assembly without the loads that follow the square of the rotation speed, and (m,) forces of its coordinates
    per (rad/s)^2 of that and per rad/s^2 of its change (`data.RunUp`).

    Raises:
        UserError: a body that is not there, or whose modal file does not say what a change of the speed does.
    """
    bodies = {c.name: c.at(0).group for c in assembly.components}
    if unknown := [name for name in ramp.euler if name not in bodies]:
        raise UserError(f"run_up.euler: there is no body '{unknown[0]}', but {', '.join(bodies)}")
    for name in ramp.euler:
        if bodies[name].run_up is None:
            raise UserError(f"run_up.euler: the modal file of '{name}' has no Euler load; leave the body out")
    follows = [bodies[x.component].excitations[x.row].unit == CENTRIFUGAL for x in assembly.loads]
    rest = replace(assembly, loads=tuple(x for x, f in zip(assembly.loads, follows, strict=True) if not f))
    square, rising = (list[Array]() for _ in range(2))
    for name, group in bodies.items():
        rows = [x.row for x, f in zip(assembly.loads, follows, strict=True) if f and x.component == name]
        square.append(sum((group.excitations[r].rows[0].real for r in dict.fromkeys(rows)), np.zeros(len(group.M_r))))
        euler = group.run_up.euler.real if name in ramp.euler and group.run_up else np.zeros(len(group.M_r))
        rising.append(euler)
    return rest, np.concatenate(square), np.concatenate(rising)

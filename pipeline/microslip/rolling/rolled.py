"""States of rolling with any friction, and the heat they make; friction and temperature converged together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from ..contact.friction import Friction
from ..data import Array
from ..interrupts import look
from .laws import RoughSurface, rolled_by_characteristic
from .strips import BLOCK, CreepForces, Tractions, creep_forces, tractions
from .temperature import Conductor, conducted, falling, heat_share, settled
from .wheelset import Drag, RollingPatch, Track, states

COLD = 20.0
"""degrees C at which a characteristic of friction holds."""


@dataclass(frozen=True)
class Heat:
    """Where the heat of friction goes.

    Attributes: bodies: wheel and rail, over which the contact moves equally fast. start: their temperatures, degrees C.
        limit: dT_E (6.7-23), rise above `COLD` at which friction would be gone, K; None: friction does not change.
    """

    bodies: tuple[Conductor, Conductor]
    start: tuple[float, float]
    limit: float | None = None

    def temperature(self, source: Array, dx: Array, speed: Array) -> Array:
        """Of both surfaces, degrees C: without friction they meet at the mean of their starts, weighted by what each
        conducts, and the friction heats both equally (6.7-11, 6.7-15).

        Args:
            source: (n, ny, nx) W/m^2. dx: (n, ny) lengths of elements, m. speed: (n,) m/s.
        """
        share = heat_share(*self.bodies, 1.0, 1.0)
        scaled = source * np.sqrt(dx / speed[:, None])[..., None]  # of a surface all goes with sqrt(dx/V)
        rise = conducted(scaled.reshape(-1, source.shape[-1]).T, 1.0, self.bodies[0], share, 1.0)
        return share * self.start[0] + (1 - share) * self.start[1] + rise.T.reshape(source.shape)


@dataclass(frozen=True)
class States:
    """Of n states. Attributes: forces: (n,). hottest: (n,) largest temperature, degrees C, if asked. tractions: of
    those that are kept."""

    forces: CreepForces
    hottest: Array | None
    tractions: Tractions


def sources(t: Tractions, speed: Array) -> tuple[Array, Array]:
    """(n, ny, nx) heat of friction per area, W/m^2, and (n, ny) lengths of elements, m, at speeds (n,) m/s."""
    return t.power * speed[:, None, None], t.x[..., 1] - t.x[..., 0]


def rolled(
    given: Array, friction: Friction, speed: Array, kept: Array, heat: Heat | None = None,
    surface: RoughSurface | None = None, **how: Any,
) -> States:  # fmt: skip
    """Forces, heat and some of the tractions.

    Args:
        given: (8, n) xi, eta, phi, a, b, normal_force, shear, poisson, as `strips.creep_forces`. speed: (n,) of
            rolling, m/s. kept: (k,) indices of states whose tractions are wanted. surface: of rough bodies. how: as
            `strips.creep_forces`.

    Raises:
        UserError: friction and temperature do not settle.
    """
    if friction.constant and heat is None and surface is None:
        of = _with_constant(given, friction)
        return States(creep_forces(*of, **how), None, tractions(*(v[kept] for v in of), **how))
    blocks = [np.arange(i, min(i + BLOCK, len(speed))) for i in range(0, len(speed), BLOCK)]
    parts, hottest, some = [], [], []
    for block in blocks:
        look()
        f, t = _rolled(given[:, block], friction, speed[block], heat, surface, how)
        parts.append(f)
        some.append([v[np.isin(block, kept)] for v in t])
        if heat is not None:
            hottest.append(heat.temperature(*sources(t, speed[block]), speed[block]).max(axis=(1, 2)))
    forces = CreepForces(*map(np.concatenate, zip(*parts, strict=True)))
    held = Tractions(*map(np.concatenate, zip(*some, strict=True)))
    return States(forces, np.concatenate(hottest) if hottest else None, held)


def drag(track: Track, friction: Friction, heat: Heat | None, surface: RoughSurface | None, **how: Any) -> Drag:
    """Of patches, as `rolled` has it, for the vertical balance of `wheelset.patches`."""
    warm = heat if heat is not None and heat.limit is not None else None

    def across(found: list[RollingPatch]) -> Array:
        given, speed = states(track, found)
        if friction.constant and warm is None and surface is None:
            return creep_forces(*_with_constant(given, friction), **how).y
        return _rolled(given, friction, speed, warm, surface, how)[0].y

    return across


def _with_constant(given: Array, friction: Friction) -> list[Array]:
    mu = np.broadcast_to(np.asarray(friction.highest(jnp.ones(1))), given.shape[1:])
    return [*given[:6], mu, *given[6:]]


def _rolled(
    given: Array, friction: Friction, speed: Array, heat: Heat | None, surface: RoughSurface | None, how: dict[str, Any]
) -> tuple[CreepForces, Tractions]:  # fmt: skip
    warm = heat is not None and heat.limit is not None
    if friction.constant and not warm and surface is None:
        of = _with_constant(given, friction)
        return creep_forces(*of, **how), tractions(*of, **how)

    def march(left: Array | None = None) -> tuple[CreepForces, Tractions]:
        return rolled_by_characteristic(*given, friction=friction, speed=speed, left=left, surface=surface, **how)

    if not warm:
        return march()
    assert heat is not None and heat.limit is not None
    dx = sources(march()[1], speed)[1]
    left, _ = settled(
        lambda left: sources(march(left)[1], speed)[0],
        lambda q: heat.temperature(q, dx, speed),
        lambda T: falling(T - COLD, 1.0, heat.limit),  # type: ignore[arg-type]
        np.ones((len(speed), *how["elements"][::-1])),
    )
    return march(left)

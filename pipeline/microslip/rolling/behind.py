"""Wheel and rail as bodies of a modal file behind the patch: their modes, and what is local, counted once (Sextro 6.4).

A body under an even traction on the face of its interface yields what its modal file tells; of that a half-space under
the same traction on the same face yields the part which depends on how the traction spreads. That part is taken out and
Hertz' patch, which spreads it otherwise, put in its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..contact.hertz import Hertz
from ..contact.solids import Solid
from ..data import Array, ModalGroup
from ..errors import UserError
from ..reduced.compliance import contact_share
from .half_space_influence import ALL, Grid, Pair, influence
from .wheelset import RollingPatch

ROWS = {"normal": "u_n", "along": "u_t2", "across": "u_t1"}
"""Directions of the patch and rows of an interface whose t2 points along rolling."""

FINE = 48
"""Elements of the face to a side; 96 change the mean by 3e-4."""


@dataclass(frozen=True)
class Behind:
    """What yields between the middle of the wheel and the foot of the rail, per force, m/N, along `ROWS`.

    Attributes:
        local: (3,) of Hertz' patch between half-spaces that stick, at its load (Hertz, Mindlin). held: (2, 3) by the
            modes of wheel and rail. rest: (2, 3) by what their files have beside: of the whole bodies, less the local
            part and the modes; negative where the modes hold of the local part.
    """

    local: Array
    held: Array
    rest: Array

    @property
    def whole(self) -> Array:
        return self.local + (self.held + self.rest).sum(axis=0)

    @property
    def beside_modes(self) -> Array:
        """(3,) N/m, of the spring that a contact between both bodies' modes must have."""
        return 1 / (self.local + self.rest.sum(axis=0))

    def columns(self) -> dict[str, Array]:
        """Of a table, (3,) along `ROWS`, nm/kN and N/m."""
        names = [f"{body}_{part}_nm_per_kN" for part in ("modes", "beyond_modes") for body in ("wheel", "rail")]
        parts = dict(zip(names, 1e12 * np.concatenate([self.held, self.rest]), strict=True))
        return {"half_spaces_nm_per_kN": 1e12 * self.local, **parts,
                "stiffness_half_spaces_N_per_m": 1 / self.local, "stiffness_N_per_m": 1 / self.whole,
                "spring_beside_modes_N_per_m": self.beside_modes}  # fmt: skip

    def sentence(self) -> str:
        shares = 1 - self.local / self.whole
        told = ", ".join(f"{1 / k:.3g} N/m {name} ({100 * s:.2g} % of it is theirs)"
                         for name, k, s in zip(ROWS, self.whole, shares, strict=True))  # fmt: skip
        return f"With wheel and rail as elastic bodies the sticking patch is as stiff as {told}."


def behind(
    patch: RollingPatch, bodies: Sequence[Solid], groups: Sequence[ModalGroup], face: str, methods: Sequence[str]
) -> Behind:  # fmt: skip
    """Of a patch.

    Args:
        bodies: wheel and rail. groups: of their modal files. face: interface of both, t2 along rolling. methods: of
            reduction.

    Raises:
        UserError: no such interface; one that the patch does not fit on.
    """
    parts = [_body(patch, face, *one) for one in zip(("wheel", "rail"), bodies, groups, methods, strict=True)]
    contact = Hertz(bodies[0], bodies[1], patch.A, patch.B)
    x, y = contact.tangential_stiffness(patch.normal_force)
    local = 1 / np.array([contact.normal_stiffness(patch.normal_force), x, y], dtype=float)
    held, rest = (np.array(part) for part in zip(*parts, strict=True))
    return Behind(local, held, rest)


def _body(
    patch: RollingPatch, face: str, name: str, solid: Solid, group: ModalGroup, method: str
) -> tuple[Array, Array]:
    """(3,) of its modes, and of what is beside them."""
    if face not in group.interfaces:
        raise UserError(
            f"elastic.{name}: its modal file has no interface '{face}'; it has {', '.join(group.interfaces)}"
        )
    across, along = group.interfaces[face].extent
    if 2 * patch.a > along or 2 * patch.b > across:
        raise UserError(
            f"elastic.{name}: the patch, {2e3 * patch.a:.3g} x {2e3 * patch.b:.3g} mm, is larger than the face of the "
            f"interface '{face}', {1e3 * along:.3g} x {1e3 * across:.3g} mm; make that larger"
        )
    shares = [contact_share(group, method, row, face) for row in ROWS.values()]
    static, held = (np.array([getattr(s, part) for s in shares]) for part in ("static", "held"))
    return held, static - held - even(solid, along, across)


def even(solid: Solid, along: float, across: float) -> Array:
    """(3,) m/N: mean displacement of a rectangle (m, m) of a half-space under an even traction on it, normal, along and
    across (Boussinesq and Cerruti, Love 1929)."""
    grid = Grid.around(along / 2, across / 2, FINE, FINE)
    of = influence(grid, Pair.of(solid, Solid(np.inf, 0.3)))
    traction = np.full((1, FINE, FINE), 1 / (along * across))
    means = [of(traction, slice(i, i + 1), slice(i, i + 1)).mean() for i in range(ALL.stop)]
    return np.array([means[2], *means[:2]])

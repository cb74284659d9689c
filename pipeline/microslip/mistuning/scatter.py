"""What differs from sector to sector: drawn from a distribution, or given; the same for a seed, whoever computes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from scipy.special import ndtr

from ..data import Array
from ..errors import UserError
from ..settings.arguments import Text, checked_fields
from ..settings.numbers import NotNegative, Number

OF_BLADES = {
    "frequency": "eigenfrequencies of a body's modes",
    "damping": "damping ratios of a body's modes",
    "mass": "mass of a body, and what it presses by its centrifugal load",
    "added_mass": "kg that sit at a monitor of a body, as screws at the tips of the blades of section 5.4",
    "modal_file": "the modal file of a body, and so its geometry",
}
"""What may differ in the bodies."""

OF_CONTACTS = {
    "normal_force": "normal force of a contact",
    "gap": "m by which the faces of a contact stand apart, more than drawn",
    "friction": "friction coefficient of a contact",
    "stiffness": "normal and tangential contact stiffness",
}
"""What may differ in the contacts."""

ABSOLUTE = "added_mass", "gap"
"""Those whose deviations are values in kg or m; of all others they are shares of the nominal value."""

MODAL = "frequency", "damping"
"""Those of which every mode of a body has its own."""


@checked_fields
@dataclass(frozen=True)
class Scatter:
    """One thing that differs from sector to sector of a ring.

    Attributes:
        of: a key of `OF_BLADES` or `OF_CONTACTS`. deviation: standard deviation, a share of the nominal value (of
            `ABSOLUTE` in kg or m). distribution: ``normal``, ``lognormal`` (median nominal) or ``uniform``.
        values: deviations that are known, sector by sector; fewer than there are sectors are repeated round the ring.
            others: sector -> what stands for the ring made with another modal file, of ``modal_file``.
        arrangement: of them, as ``given``, ``shuffled`` from sample to sample, or ``drawn`` one by one.
        component, contact: name, of an assembly with one the only one if None. at: monitor of ``added_mass``.
        together: correlation between the modes of a body: 1 all alike, 0 each alone. neighbours: correlation between a
            sector and the next one, its powers those farther away.
    """

    of: Text
    deviation: NotNegative = 0.0
    distribution: Literal["normal", "lognormal", "uniform"] = "normal"
    values: Sequence[Number] = ()
    others: Mapping[int, Any] = field(default_factory=dict)
    arrangement: Literal["given", "shuffled", "drawn"] = "given"
    component: Text | None = None
    contact: Text | None = None
    at: Text | None = None
    together: Annotated[float, Field(ge=0, le=1)] = 1.0
    neighbours: Annotated[float, Field(ge=-1, le=1)] = 0.0

    def __post_init__(self) -> None:
        known = {**OF_BLADES, **OF_CONTACTS}
        if self.of not in known:
            raise UserError(f"of: '{self.of}' is none of {', '.join(known)}")
        if (self.of == "modal_file") != bool(self.others):
            raise UserError(f"{self.of}: others belong to modal_file, which needs them")
        ways = (self.deviation > 0) + bool(self.values) + bool(self.others)
        if not ways:
            raise UserError(f"{self.of}: nothing scatters; give a deviation above zero, or values that are known")
        if ways > 1:
            raise UserError(f"{self.of}: give one of deviation, values that are known, and others")
        drawn = self.deviation > 0
        for key, name, depends in (
            ("component", "body", self.of in OF_BLADES), ("contact", "contact", self.of in OF_CONTACTS),
            ("at", "at", self.of == "added_mass"), ("together", "together", self.of in MODAL and drawn),
            ("neighbours", "neighbours", drawn), ("distribution", "distribution", drawn),
            ("arrangement", "arrangement", not drawn),
        ):  # fmt: skip
            if not depends and getattr(self, key) != type(self).__dataclass_fields__[key].default:
                how = "drawn by a deviation" if drawn else "whose values are known"
                raise UserError(f"{name}: nothing depends on it for {self.of} {how}; leave it out")

    @property
    def random(self) -> bool:
        """Whether samples differ."""
        return self.deviation > 0 or self.arrangement != "given"

    def drawn(self, sectors: int, modes: int, number: int, seed: int, sample: int) -> Array:
        """(sectors, modes) deviations of one sample.

        Args:
            modes: 1 of what has none. number: of this scatter among those of a ring: each has random numbers of its
                own, which depend on it, seed and sample alone.

        Raises:
            UserError: values that do not go round the ring.
        """
        rng = np.random.default_rng([seed, sample, number])
        if self.values or self.others:
            return np.repeat(self._known(sectors, rng)[:, None], modes, axis=1)
        return self._of(self._normal(rng, sectors, modes))

    def _known(self, sectors: int, rng: np.random.Generator) -> Array:
        known = np.array(self.values) if self.values else self._numbered(sectors)
        if self.arrangement == "drawn":
            return rng.choice(known, sectors)
        if sectors % len(known):
            raise UserError(
                f"values of {self.of}: {len(known)} do not go round a ring of {sectors} sectors; give {sectors}, or a "
                "pattern that divides it"
            )
        whole = np.tile(known, sectors // len(known))
        return rng.permutation(whole) if self.arrangement == "shuffled" else whole

    def _numbered(self, sectors: int) -> Array:
        """(sectors,) 1, 2, ... of those with another modal file, 0 of the nominal ones."""
        if not set(self.others) <= set(range(sectors)):
            raise UserError(f"others: {max(self.others)} is none of the sectors 0 to {sectors - 1}")
        known = np.zeros(sectors)
        known[list(self.others)] = 1 + np.arange(len(self.others))
        return known

    def _normal(self, rng: np.random.Generator, sectors: int, modes: int) -> Array:
        """(sectors, modes) correlated numbers of variance 1."""
        alone, common = rng.standard_normal((sectors, modes)), rng.standard_normal((sectors, 1))
        z = np.sqrt(self.together) * common + np.sqrt(1 - self.together) * alone
        if not self.neighbours:
            return z
        return np.fft.ifft(np.sqrt(self.power(sectors))[:, None] * np.fft.fft(z, axis=0), axis=0).real

    def power(self, sectors: int) -> Array:
        """(sectors,) eigenvalues of the circulant correlation round the ring.

        Raises:
            UserError: numbers cannot correlate so, as those round an odd ring that are each against the next.
        """
        apart = np.minimum(np.arange(sectors), sectors - np.arange(sectors))
        eigenvalues = np.fft.fft(self.neighbours**apart).real
        if eigenvalues.min() < -1e-9 * sectors:
            raise UserError(
                f"neighbours: {self.neighbours:g} cannot hold all round a ring of {sectors} sectors; take one nearer 0"
            )
        return np.maximum(eigenvalues, 0.0)

    def _of(self, z: Array) -> Array:
        if self.distribution == "uniform":
            return self.deviation * np.sqrt(12) * (ndtr(z) - 0.5)
        if self.distribution == "lognormal":
            return np.expm1(np.sqrt(np.log(0.5 + np.sqrt(0.25 + self.deviation**2))) * z)
        return self.deviation * z


def check(scatter: Sequence[Scatter], least: float = -1.0) -> None:
    """Raise `UserError` where known values alone make something negative."""
    for s in scatter:
        if s.of not in ABSOLUTE and s.values and min(s.values) <= least:
            raise UserError(f"values of {s.of}: {min(s.values):g} leaves nothing of it; deviations are shares of 1")

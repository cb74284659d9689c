"""Where the heights of a rough surface come from: the kinds of [roughness]."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from ..data import Array
from ..errors import UserError, of_file
from ..settings.numbers import Numbers, Positive, PositiveLength
from . import topography
from .curves import read_table
from .heights import Cut, Exponential, Gaussian, Heights, Linear, Polynomial, combined, tabulated
from .kinds import Columns, FileName, Kind, Lengths, NotNegativeLength, beside
from .law import value
from .topography import UNITS


class Roughness(Kind):
    """A distribution of heights, of the first surface and of the other one if that is rough too."""

    kind: str
    """cumulative height distribution; without [roughness] the faces are smooth"""
    R_Z_other: NotNegativeLength = 0.0
    """of the other face, with the polynomial's heights; the two are combined (3.3-10)"""

    def heights(self, path: Path, unit: float) -> tuple[Heights, float]:
        """The distribution and R_Z in m.

        Args:
            path: of the contact file. unit: of lengths in files without one of their own, m.
        """
        own, roughness = self.own(path, unit)
        if self.R_Z_other:
            return combined(own, roughness, Polynomial(), self.R_Z_other)
        return own, roughness

    def own(self, path: Path, unit: float) -> tuple[Heights, float]:
        """Of the first surface alone."""
        raise NotImplementedError


class Shape(Roughness):
    """A cumulative height distribution by its formula: polynomial (3.3-4) or linear (3.3-29)."""

    kind: Literal["polynomial", "linear"]
    R_Z: PositiveLength
    """highest peak to deepest valley of the heights"""

    def own(self, path: Path, unit: float) -> tuple[Heights, float]:
        return (Polynomial() if self.kind == "polynomial" else Linear()), self.R_Z


class ExponentialHeights(Roughness):
    """Exponential heights (3.3-34), whose peaks beyond u = 0 are cut off."""

    kind: Literal["exponential"]
    R_Z: PositiveLength
    """highest peak to deepest valley of the heights"""
    rate: Positive = 4.0
    """R_Z/sigma_S"""

    def own(self, path: Path, unit: float) -> tuple[Heights, float]:
        return Cut(Exponential(value(self.rate))), self.R_Z


class GaussianHeights(Roughness):
    """Gaussian heights (3.3-7), whose peaks beyond u = 0 are cut off."""

    kind: Literal["gaussian"]
    R_Z: PositiveLength
    """highest peak to deepest valley of the heights"""
    mean: Positive = 0.5
    """over R_Z, below the highest peak"""
    deviation: Positive = 20**-0.5
    """over R_Z"""

    def own(self, path: Path, unit: float) -> tuple[Heights, float]:
        return Cut(Gaussian(value(self.mean), value(self.deviation))), self.R_Z


class TableHeights(Roughness):
    """A table: depths below the highest peak, and the share of the area that is higher, from 0 to 1."""

    kind: Literal["table"]
    R_Z: PositiveLength | None = None
    """highest peak to deepest valley of the heights; the deepest depth if not given"""
    depth: Lengths = ()
    """below the highest peak, rising from 0"""
    share: Numbers = ()
    """of the area that lies higher, from 0 to 1"""
    file: str | None = None
    """columns of both, depth in length_unit, instead"""
    columns: Columns = (1, 2)
    """counted from 1 or by name"""

    @model_validator(mode="after")
    def _one_way(self) -> TableHeights:
        if (self.file is None) == (not self.depth):
            raise ValueError("heights of a table need either file, or depth and share; keep one of the two ways")
        if len(self.depth) != len(self.share):
            raise ValueError(f"{len(self.depth)} depths and {len(self.share)} shares; give one share a depth")
        return self

    def own(self, path: Path, unit: float) -> tuple[Heights, float]:
        if self.file is None:
            return self._table(np.array(self.depth), np.array(self.share))
        file = beside(path, self.file)
        table = read_table(file, self.columns, ("depth", "share"))
        with of_file(file):
            return self._table(table[:, 0] * unit, table[:, 1])

    def _table(self, depth: Array, share: Array) -> tuple[Heights, float]:
        if len(depth) < 2:
            raise UserError(f"{len(depth)} depths; a height distribution needs two or more")
        if depth[0] < 0:
            raise UserError(f"the first depth is {depth[0]:g} m; depths are counted from the highest peak, from 0")
        roughness = self.R_Z or float(depth[-1])
        if not roughness > 0:
            raise UserError(f"the deepest height is {depth[-1]:g} m; give depths that rise from 0")
        return tabulated(depth / roughness, share), roughness


class ProfileHeights(Roughness):
    """A measured surface profile: columns of way and height, or the file of an instrument."""

    kind: Literal["profile"]
    file: FileName
    """columns of way and height, or of an instrument"""
    unit: Literal[tuple(UNITS)] = "um"  # type: ignore[valid-type]
    """of the heights in the profile"""
    way_unit: Literal[tuple(UNITS)] | None = None  # type: ignore[valid-type]
    """of the way; that of the heights if not given"""
    columns: Columns = (1, 2)
    """counted from 1 or by name"""
    level: Annotated[int, Field(ge=0, le=10)] | Literal["none"] = 1
    """order of the polynomial that is taken off the profile, or none"""

    def own(self, path: Path, unit: float) -> tuple[Heights, float]:
        file = beside(path, self.file)
        level = None if self.level == "none" else self.level
        profile = topography.read_profile(file, (self.way_unit or self.unit, self.unit), level, self.columns)
        roughness = topography.roughness(profile).Rz
        return topography.heights(profile, roughness), roughness

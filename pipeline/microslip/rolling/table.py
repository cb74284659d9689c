"""Tables of creep forces for vehicle programs, over creepages, spin and a/b, with the error of reading between points.

Forces over mu F_N of one Poisson's ratio depend on four numbers: how large the slip is, where its pole lies, and a/b.
With xi the sign of F_x turns, with eta and phi together those of F_y and M_z, so half of the directions is enough.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import RegularGridInterpolator

from ..data import Array, UserError
from ..files import hdf5, store
from .kalker import creep_coefficients
from .strips import creep_forces

POINTS = (65, 65, 49, 21)
"""Of the size of the slip, its azimuth, its polar angle, a/b."""

WIDEST = 5.0
"""a/b and b/a of the table's ends."""

VALUES = ("F_x/(mu F_N)", "F_y/(mu F_N)", "M_z/(mu F_N sqrt(a b))")


@dataclass(frozen=True)
class CreepTable:
    """Forces over the direction and the size of the slip, read straight between points.

    Polar is the angle of (xi/b, eta/a, phi) from phi: up to 45 degrees the pole of the slip lies in the patch. Azimuth
    is that of (xi sqrt(a), eta sqrt(b)). Size is r/(1 + r), r the length of G/(mu F_N) (C11 a b xi, C22 a b eta,
    C23 (a b)^1.5 phi) with the coefficients of the table, straight over ln(a/b).

    Attributes:
        size: (n,) 0 to 1, where all slides. azimuth: (m,) -pi/2 to pi/2. polar: (k,) 0 to pi/2. ratio: (l,) a/b.
        coefficients: (3, l) C11, C22, C23. values: (3, n, m, k, l), `VALUES`. poisson: nu of both bodies combined.
        error: (3, 3) found between points, over mu F_N likewise: of each value the mean, what 95 % are below, and the
            largest. checked: at so many.
    """

    size: Array
    azimuth: Array
    polar: Array
    ratio: Array
    coefficients: Array
    values: Array
    poisson: float
    error: Array
    checked: int

    @cached_property
    def _between(self) -> RegularGridInterpolator:
        axes = self.size, self.azimuth, self.polar, np.log(self.ratio)
        return RegularGridInterpolator(axes, np.moveaxis(self.values.astype(float), 0, -1))

    def scale(self, ratio: Array) -> Array:
        """(3, ...) C11, C22, C23 by which the size of a slip is measured."""
        return np.stack([np.interp(np.log(ratio), np.log(self.ratio), c) for c in self.coefficients])

    def forces(
        self, xi: ArrayLike, eta: ArrayLike, phi: ArrayLike, a: ArrayLike, b: ArrayLike, normal_force: ArrayLike,
        friction: ArrayLike, shear: float,
    ) -> Array:  # fmt: skip
        """(3, ...) F_x, F_y in N, M_z in N m, of what `strips.creep_forces` takes; a/b beyond the table is its end."""
        given = (np.asarray(v, dtype=float) for v in (xi, eta, phi, a, b, np.multiply(friction, normal_force)))
        x, y, turn, a, b, held = np.broadcast_arrays(*given)
        ratio, area = np.clip(a / b, self.ratio[0], self.ratio[-1]), a * b
        r = shear * area / held * self.scale(ratio) * np.stack([x, y, np.sqrt(area) * turn])
        r = np.sqrt((r**2).sum(axis=0))
        forward, turned = np.where(x < 0, -1.0, 1.0), np.where(turn < 0, -1.0, 1.0)
        flat = np.hypot(x / b, y / a)
        polar = np.arctan2(flat, np.abs(turn))
        at = [r / (1 + r), np.arctan2(turned * y * np.sqrt(b), np.abs(x) * np.sqrt(a)), polar, np.log(ratio)]
        found = np.moveaxis(self._between(np.stack(at, axis=-1)), -1, 0).reshape(3, *x.shape)
        found = found * np.stack([forward, turned, turned])
        return found * held * np.stack([np.ones_like(area), np.ones_like(area), np.sqrt(area)])


def creep_table(
    poisson: float, *, points: tuple[int, int, int, int] = POINTS, checked: int = 20_000, seed: int = 0, **how: Any
) -> CreepTable:
    """A table, and its error at random places between its points.

    Args:
        poisson: of both bodies combined. points: of size, azimuth, polar angle and a/b. how: as `strips.creep_forces`
            (elements, distribution, coefficients, spin).

    Raises:
        UserError: fewer than two points on an axis.
    """
    if min(points) < 2:
        raise UserError("points: an axis of a table needs two or more; give four numbers")
    axes = (
        np.linspace(0, 1, points[0]), np.linspace(-np.pi / 2, np.pi / 2, points[1]),
        np.linspace(0, np.pi / 2, points[2]), np.geomspace(1 / WIDEST, WIDEST, points[3]),
    )  # fmt: skip
    scale = np.asarray(creep_coefficients(axes[3], poisson))[:3]
    empty = CreepTable(*axes, scale, np.zeros((3, *points), np.float32), poisson, np.full((3, 3), np.nan), checked)
    at = np.stack([v.ravel() for v in np.meshgrid(*axes, indexing="ij")])
    values = _solved(empty, at, **how)[1].reshape(3, *points).astype(np.float32)
    table = replace(empty, values=values)
    low, high = (np.array([axis[i] for axis in axes])[:, None] for i in (0, -1))
    low[3], high[3] = np.log(low[3]), np.log(high[3])
    tried = low + (high - low) * np.random.default_rng(seed).uniform(size=(4, checked))
    tried[3] = np.exp(tried[3])
    (xi, eta, phi, a, b, load, mu), exact = _solved(table, tried, **how)
    error = np.abs(table.forces(xi, eta, phi, a, b, load, mu, 1.0) - exact)
    found = np.stack([error.mean(axis=1), np.quantile(error, 0.95, axis=1), error.max(axis=1)], axis=1)
    return replace(table, error=found)


FORMAT = "microslip-creep-table"


def write_creep_table(path: Path, table: CreepTable) -> Path:
    """As HDF5: a dataset an axis, ``coefficients``, ``values`` and ``error``; complete or not at all."""
    with store.complete_or_absent(path) as temporary:
        with hdf5.create(temporary) as file:
            file.attrs.update(format=FORMAT, poisson=table.poisson, checked=table.checked, values=", ".join(VALUES),
                              error="mean, 95 % quantile, largest", axes=str(CreepTable.__doc__))  # fmt: skip
            for name in (*AXES, "coefficients", "values", "error"):
                hdf5.put(file, name, getattr(table, name))
        hdf5.seal(temporary)
    return path


def read_creep_table(path: Path | str) -> CreepTable:
    """A table that `write_creep_table` wrote.

    Raises:
        UserError: another file.
    """
    try:
        with h5py.File(store.ordinary(Path(path)), "r") as file:
            parts = {name: file[name][()] for name in (*AXES, "coefficients", "values", "error")}
            return CreepTable(**parts, poisson=float(file.attrs["poisson"]), checked=int(file.attrs["checked"]))
    except (OSError, KeyError) as error:
        raise UserError(f"{path}: is no table of creep forces ({error}); write one with [table] in a case") from error


AXES = ("size", "azimuth", "polar", "ratio")

FAR = 1e4
"""r that stands for the size 1."""


def _solved(table: CreepTable, at: Array, **how: Any) -> tuple[list[Array], Array]:
    """What `forces` takes at (4, n) coordinates, with a b, G and mu F_N of one, and (3, n) what the strips say."""
    size, azimuth, polar, ratio = at
    a, b = np.sqrt(ratio), 1 / np.sqrt(ratio)
    x, y = np.cos(azimuth) * np.sqrt(b), np.sin(azimuth) * np.sqrt(a)
    flat = np.sin(polar) / np.hypot(x / b, y / a)
    creep = np.stack([flat * x, flat * y, np.cos(polar)])
    r = np.minimum(size / np.maximum(1 - size, 1e-300), FAR)
    creep = creep * r / np.sqrt(((table.scale(ratio) * creep) ** 2).sum(axis=0))
    one = np.ones_like(ratio)
    xi, eta, phi = creep
    f = creep_forces(xi, eta, phi, a, b, one, one, 1.0, table.poisson, **how)
    return [xi, eta, phi, a, b, one, one], np.stack([f.x, f.y, f.moment])

"""Tables of creep forces for vehicle programs, over creepages, spin and a/b, with the error of reading between points.

What moves the springs of the strips, three numbers over mu F_N, makes the forces, with a/b and the ratio of the springs
across and along; Kalker's coefficients and his blending (`strips.poses`) are left to the reader, and their kinks with
them. With xi the sign of F_x turns, with eta and phi together those of F_y and M_z: half of the directions is enough.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import mul
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ..data import Array
from ..errors import UserError
from ..files import hdf5
from ..files.hostile import reading
from ..files.store import ordinary
from ..programs import program
from ..settings import arguments
from ..settings.arguments import Count, Index, wholes
from .arguments import Frictions, Poisson, Positives, Reals, Resolution, joined
from .kalker import Coefficients, creep_coefficients
from .strips import BLOCK, NAMES, SLIPPERY, CreepForces, Distribution, Poses, creep_forces, forces, grid, posed

POINTS = (19, 36, 33, 39, 13)
"""Of the size of the pull below and above 1/2, its azimuth, its polar angle, a/b."""

ELEMENTS = (40, 120)
"""Of the strips: with 20 of them narrow patches feel it when the pole of the slip goes from one strip to the next."""

WIDEST = 5.0
"""a/b and b/a of the table's ends."""

SATURATED = 32 / (3 * np.pi)
"""C G a b s/(mu F_N) from which all slides in pure creepage; C23 G a^2 b phi/(mu F_N) where pure spin lets all slide at
once: springs and bound are both a parabola then, and the forces have a ridge."""

VALUES = ("F_x/(mu F_N)", "F_y/(mu F_N)", "M_z/(mu F_N sqrt(a b))")
FINEST = 2**15 - 1
"""Steps of `values` from 0 to its largest."""


@dataclass(frozen=True)
class CreepTable:
    """Forces over size and direction of the pull, a/b and the springs, read by cubics through four points.

    The pull is (u, v, w) = G a b/(mu F_N) (C_x xi, C_y eta, C_t sqrt(a b) phi) with blended coefficients: with
    f = (1/C11, 1/C22, sqrt(a/b)/(spin_factor C23)), blend = min(1, |(xi, eta)| G a b/(3 mu F_N hypot(f0, f1))) and
    e = (xi, eta, 3 pi a phi/32), each f becomes (1 - blend) f + blend |e|^2/sum(e^2/f); C_x = 1/f0, C_y = 1/f1,
    C_t = 1/f2.
    Size is r/(1 + r), r = 3 pi/32 |(u, v, sqrt(a/b) w)|, 1 where all slides. Azimuth is the angle of (|u| sqrt(a),
    v sqrt(b)), v with the sign of w. Polar is that of (u/b, v/a, w) from w: up to 45 degrees the pole of the slip lies
    in the patch. F_x has the opposite sign of u, F_y and M_z turn with that of w. The four points of a cubic lie on one
    side of size 1/2, where the forces have a ridge; over the last axis a parabola goes through its three points.

    Attributes:
        size: (n,) 0 to 1. azimuth: (m,) -pi/2 to pi/2. polar: (k,) 0 to pi/2. ratio: (l,) a/b, read over its logarithm.
        springs: (3,) ln(C_y/C_x). kalker: (4, i) a/b, C11, C22, C23, closely. values: (3, n, m, k, l, 3), `VALUES`.
        poisson: nu of both bodies combined. how: elements, distribution, coefficients of the strips. error: (3, 3)
            found between points, over mu F_N likewise: of each value the mean, what 95 % are below, and the largest.
        checked: at so many.
    """

    size: Array
    azimuth: Array
    polar: Array
    ratio: Array
    springs: Array
    kalker: Array
    values: Array
    poisson: float
    how: dict[str, Any]
    error: Array
    checked: int

    def __repr__(self) -> str:
        return f"<CreepTable: {self.sentence()}>"

    @property
    def axes(self) -> tuple[Array, ...]:
        return self.size, self.azimuth, self.polar, np.log(self.ratio), self.springs

    @arguments.checked
    def forces(
        self, xi: Reals, eta: Reals, phi: Reals, a: Positives, b: Positives, normal_force: Positives,
        friction: Frictions, shear: Positives,
    ) -> Array:  # fmt: skip
        """(3, ...) F_x, F_y in N, M_z in N m, of what `strips.creep_forces` takes.

        Raises:
            UserError: a/b beyond the table; a value that no state of rolling has.
        """
        given = xi, eta, phi, a, b, normal_force, friction, shear
        x, y, turn, a, b, normal, mu, G = joined(**dict(zip(NAMES, given, strict=False)))
        held = np.maximum(mu, SLIPPERY) * normal
        ratio, c = a / b, np.sqrt(a * b)
        least, most = self.ratio[0] * (1 - 1e-9), self.ratio[-1] * (1 + 1e-9)
        if not ((ratio >= least) & (ratio <= most)).all():
            worst = float(ratio.ravel()[np.argmax(np.abs(np.log(ratio)))])
            raise UserError(f"a, b: a/b is {worst:.4g}, and the table goes from {least:.4g} to {most:.4g}")
        p = posed(x, y, turn, a, b, held, np.ones_like(a), G, self.poisson, **self.how)
        at, signs = placed(Poses(*map(np.asarray, p)), ratio)
        at = at.reshape(5, -1)
        values = np.concatenate([self._between(at[:, i : i + BLOCK]) for i in range(0, at.shape[1], BLOCK)], axis=1)
        return values.reshape(3, *x.shape) * signs * held * np.stack([np.ones_like(c), np.ones_like(c), c])

    def sentence(self) -> str:
        """What it is worth."""
        mean, most, largest = 100 * self.error.max(axis=0)
        return (
            f"Between the points of the table forces are off by {mean:.2g} % of mu F_N in the mean; 95 % of "
            f"{self.checked} states are below {most:.2g} %, the largest error is {largest:.2g} %."
        )

    def _between(self, at: Array) -> Array:
        """(3, n) values at (5, n) coordinates."""
        ridge = int(np.searchsorted(self.size, 0.5))
        parts = [cubic(self.axes[0], at[0], ridge)]
        parts += [cubic(axis, v) for axis, v in zip(self.axes[1:], at[1:], strict=True)]
        shape = self.values.shape[1:]
        index = np.zeros((at.shape[1], 1), int)
        for (first, weight), many in zip(parts, shape, strict=True):
            index = (index * many)[:, :, None] + (first[:, None] + np.arange(weight.shape[1]))[:, None, :]
            index = index.reshape(at.shape[1], -1)
        near = self.values.reshape(3, -1)[:, index]
        for _, weight in parts[::-1]:
            near = np.einsum("knip,np->kni", near.reshape(3, at.shape[1], -1, weight.shape[1]), weight)
        return near[..., 0]


def cubic(axis: Any, v: Any, ridge: Any = 0, xp: Any = np) -> tuple[Any, Any]:
    """Index of the first of the points about each place, on one side of a ridge, and what each of them counts (n, 4):
    Lagrange's polynomials; xp: see `placed`."""
    many = min(4, len(axis))
    i = xp.clip(xp.searchsorted(axis, v, side="right") - 1, 0, len(axis) - 2)
    low, high = xp.where(i >= ridge, ridge, 0), xp.where(i >= ridge, len(axis) - 1, ridge)
    first = xp.clip(i - (many - 1) // 2, low, xp.maximum(high - many + 1, low))
    x = axis[first[:, None] + xp.arange(many)]
    ways = v[:, None] - x
    parts = [[ways[:, k] / (x[:, j] - x[:, k]) for k in range(many) if k != j] for j in range(many)]
    return first, xp.stack([reduce(mul, part) for part in parts], axis=1)


def placed(p: Poses, ratio: Any, xp: Any = np) -> tuple[Any, Any]:
    """(5, n) size, azimuth, polar angle, ln(a/b) and springs of poses under mu F_N, and (3, n) the signs of the forces
    that are tabulated for them; ratio: a/b within the table. xp: numpy, or jax.numpy in what is traced."""
    c = xp.sqrt(p.a * p.b)
    pull = xp.stack([p.xi, p.eta * p.stiffness_y / p.stiffness_x, c * p.phi_x])
    u, v, w = pull * p.stiffness_x * c**2 / p.normal_force
    r = xp.sqrt(u**2 + v**2 + ratio * w**2) / SATURATED
    forward, turned = xp.where(u < 0, -1.0, 1.0), xp.where(w < 0, -1.0, 1.0)
    root = ratio**0.25  # sqrt(a) where a b = 1, and 1/sqrt(b)
    polar = xp.arctan2(xp.hypot(u * root**2, v / root**2), xp.abs(w))
    azimuth = xp.arctan2(turned * v / root, xp.abs(u) * root)
    at = [r / (1 + r), azimuth, polar, xp.log(ratio), xp.log(p.stiffness_y / p.stiffness_x)]
    return xp.stack(at), xp.stack([forward, turned, turned])


FAR = 1e4
"""r that stands for the size 1."""


def _pull(at: Array) -> Array:
    """(3, n) pull of (4, n) size, azimuth, polar angle and ln(a/b)."""
    size, azimuth, polar, ratio = at[0], at[1], at[2], np.exp(at[3])
    root = ratio**0.25
    u, v = np.cos(azimuth) / root, np.sin(azimuth) * root
    flat = np.sin(polar) / np.hypot(u * root**2, v / root**2)
    pull = np.stack([flat * u, flat * v, np.cos(polar)])
    r = np.minimum(size / np.maximum(1 - size, 1e-300), FAR) * SATURATED
    return pull * r / np.sqrt(pull[0] ** 2 + pull[1] ** 2 + ratio * pull[2] ** 2)


@partial(program, static_argnames=("elements", "distribution"))
def _marched(
    pull: Array, ratio: Array, springs: Array, elements: tuple[int, int], distribution: Distribution
) -> CreepForces:
    """Forces over mu F_N of springs that are pulled, with a b and mu F_N of one."""
    a, ones = ratio**0.5, ratio**0.0
    x, y = springs**-0.5, springs**0.5
    pose = Poses(pull[0] / x, pull[1] / y, pull[2] / x, pull[2] / y, a, 1 / a, ones, ones, x, y)
    return forces(pose, elements, distribution)


def _tabulated(axes: tuple[Array, ...], **how: Any) -> Array:
    """(3, ...) values over the axes, in `FINEST` steps."""
    shape = [len(axis) for axis in axes]
    n = int(np.prod(shape))
    parts = []
    for i in range(0, n, BLOCK):
        which = np.unravel_index(np.minimum(np.arange(i, i + BLOCK), n - 1), shape)
        at = np.stack([axis[k] for axis, k in zip(axes, which, strict=True)])
        f = _marched(_pull(at), np.exp(at[3]), np.exp(at[4]), **how)
        parts.append(np.stack([f.x, f.y, f.moment]))
    values = np.concatenate(parts, axis=1)[:, :n].reshape(3, *shape)
    step = np.abs(values).max() / FINEST
    return np.rint(values / step) * step


@arguments.checked
def creep_table(
    poisson: Poisson, *, points: Annotated[Any, wholes(4, 4, 4, 4, 4)] = POINTS, elements: Resolution = ELEMENTS,
    distribution: Distribution = "constant", coefficients: Coefficients = "table", checked: Count = 20_000,
    seed: Index = 0,
) -> CreepTable:  # fmt: skip
    """A table, and its error at random places between its points, of the strips with `spin` "kalker".

    Args:
        poisson: of both bodies combined. points: of the size below and above 1/2, of azimuth, polar angle and a/b. The
            rest as `strips.creep_forces`.

    Raises:
        UserError: fewer than four points on an axis, as cubics need them; what is none of a table.
    """
    closely = np.geomspace(1 / WIDEST, WIDEST, 801)
    c = np.asarray(creep_coefficients(closely, poisson, coefficients))
    springs = np.log(c[1] / c[0])  # of the blended ones as well, which are nearer to each other
    below, above, around, polar, ratios = (np.linspace(0, 1, n) for n in points)
    size = np.concatenate([0.5 * (1 - (1 - below) ** 2), 0.75 - 0.25 * np.cos(np.pi * above[1:])])
    axes = (size, np.pi * (around - 0.5), np.pi / 2 * polar**1.5, np.log(WIDEST) * (2 * ratios - 1),
            np.linspace(min(springs.min(), -NEAR), max(springs.max(), NEAR), 3))  # fmt: skip
    how: dict[str, Any] = {"elements": tuple(elements), "distribution": distribution}
    table = CreepTable(
        *axes[:3], np.exp(axes[3]), axes[4], np.vstack([closely, c[:3]]), _tabulated(axes, **how), poisson,
        how | {"coefficients": coefficients}, np.full((3, 3), np.nan), checked,
    )  # fmt: skip
    return replace(table, error=_missed(table, checked, seed))


NEAR = 0.01
"""Least range of the logarithm of the springs' ratio to both sides of 0, so that its three points are apart."""


def _missed(table: CreepTable, checked: int, seed: int) -> Array:
    """(3, 3) mean, 95 % quantile and largest error at random states, spread evenly over the axes."""
    low, high = (np.array([axis[i] for axis in table.axes[:4]])[:, None] for i in (0, -1))
    at = low + (high - low) * np.random.default_rng(seed).uniform(size=(4, checked))
    a, ones = np.exp(0.5 * at[3]), np.ones(checked)
    c = np.asarray(creep_coefficients(a**2, table.poisson, table.how["coefficients"]))
    xi, eta, phi = _pull(at) / c[:3]
    f = creep_forces(xi, eta, phi, a, 1 / a, ones, ones, 1.0, table.poisson, **table.how)
    error = np.abs(table.forces(xi, eta, phi, a, 1 / a, ones, ones, 1.0) - np.stack([f.x, f.y, f.moment]))
    return np.stack([error.mean(axis=1), np.quantile(error, 0.95, axis=1), error.max(axis=1)], axis=1)


FORMAT = "microslip-creep-table-2"
AXES = ("size", "azimuth", "polar", "ratio", "springs")


@arguments.checked
def write_creep_table(path: Path | str, table: CreepTable) -> Path:
    """As HDF5: a dataset an axis, ``kalker``, ``values`` in whole steps and ``error``; complete or not at all."""
    step = np.abs(table.values).max() / FINEST
    g = grid(tuple(table.how["elements"]), table.how["distribution"])
    arrays = {name: getattr(table, name) for name in (*AXES, "kalker", "error")}
    arrays["values"] = np.rint(table.values / step).astype(np.int16)
    return write_table(path, arrays, format=FORMAT, poisson=table.poisson, checked=table.checked,
                       values=", ".join(VALUES), step=step, spin_factor=2 * g.sprung / g.spun,
                       error="mean, 95 % quantile, largest", meaning=str(CreepTable.__doc__), **table.how)  # fmt: skip


@arguments.checked
def read_creep_table(path: Path | str) -> CreepTable:
    """A table that `write_creep_table` wrote.

    Raises:
        UserError: another file.
    """
    names = (*AXES, "kalker", "error", "values")
    arrays, told = read_table(path, names, FORMAT, "write a table of creep forces with [table] in a case")
    nx, ny = map(int, told["elements"])
    how = {"elements": (nx, ny)} | {k: str(told[k]) for k in ("distribution", "coefficients")}
    arrays["values"] = arrays["values"] * float(told["step"])
    return CreepTable(**arrays, how=how, poisson=float(told["poisson"]), checked=int(told["checked"]))


def write_table(path: Path | str, arrays: Mapping[str, Any], **told: Any) -> Path:
    """A table for vehicle programs as HDF5, complete or not at all: arrays by their names, some of them in a group
    (``group/name``), and what is told of it."""
    with hdf5.sealed(path) as file:
        file.attrs.update(told)
        groups = {name: file.create_group(name) for name in dict.fromkeys(n.rpartition("/")[0] for n in arrays) if name}
        for name, values in arrays.items():
            above, _, own = name.rpartition("/")
            hdf5.put(groups.get(above, file), own, np.asarray(values))
    return Path(path)


def read_table(
    path: Path | str, names: Iterable[str], form: str, again: str
) -> tuple[dict[str, Array], dict[str, Any]]:  # fmt: skip
    """Arrays that `write_table` wrote, and what it told.

    Raises:
        UserError: another file, of which `again` says what to do.
    """
    with reading(ordinary(Path(path)), form, "", again) as file:
        return {name: file[name][()] for name in names}, dict(file.attrs)

"""The case of a tyre whose slip or load jumps: every key, the row of contacts of its static state, the answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, model_validator
from scipy.optimize import minimize_scalar

from ..data import Array, ContactState, ModalGroup, UserError
from ..settings.body import Model, Name, NotNegative, Positive, _tuple, load_toml, override
from ..settings.mistakes import validate
from .brush import Brush, fitted, jump, reached

Slip = Annotated[float, Field(gt=0, le=1)]


class TyreOfCase(Model):
    """A wheel that stands on the ground in the static state of its modal file.

    Attributes:
        body: whose modal file is taken or made. contact: the closure by which it stands. interface: on the same face,
            t2 along rolling. friction: coefficient. stiffness: of the row along rolling, per area, Pa/m. elements: of
            the row. speed: m/s. rigid: whether the wheel is; else its mode that yields most along rolling gives way.
    """

    body: Name
    contact: Name = "ground"
    interface: Name = "patch"
    friction: Positive
    stiffness: Positive
    elements: Annotated[int, Field(ge=4, le=2000)] = 20
    speed: Positive
    rigid: bool = False


class Jumps(Model):
    """targets: slips to which it jumps from 0, and from which back to 0. loads: shares of the static load to which the
    load jumps at the slip shown. shown: slip whose jump is drawn."""

    targets: Annotated[tuple[Slip, ...], BeforeValidator(_tuple), Field(min_length=2)]
    loads: Annotated[tuple[NotNegative, ...], BeforeValidator(_tuple)] = (0.5, 1.5)
    shown: Slip = 0.05


class TyreCase(Model):
    """A tyre, and jumps."""

    name: Name
    tyre: TyreOfCase
    jumps: Jumps

    @model_validator(mode="after")
    def _rise(self) -> TyreCase:
        if list(self.jumps.targets) != sorted(set(self.jumps.targets)):
            raise ValueError("jumps.targets: must rise from one to the next")
        return self


def load_tyre(path: Path, assignments: list[str] | None = None) -> tuple[TyreCase, dict[str, Any]]:
    """Read and check a case of a tyre (SI units).

    Raises:
        UserError: with every mistake named by file and key.
    """
    raw = override(load_toml(path), assignments or [], path)
    return validate(TyreCase, raw, path), raw


@dataclass(frozen=True)
class Row:
    """The middle of the patch along rolling. Attributes: x: (k,) places, m. pressure: (k,) Pa, the mean over the width.
    smooth: (l, 2) places and the smooth pressure that fits it. share: (n,) of elements, from the leading edge on.
    length: m. force: of the patch, N. area: m2."""

    x: Array
    pressure: Array
    smooth: Array
    share: Array
    length: float
    force: float
    area: float

    @property
    def spacing(self) -> float:
        """m, the largest step from one point that is pressed to the next."""
        return float(np.diff(self.x[self.pressure > 1e-6 * self.pressure.max()]).max())


def row(state: ContactState, along: Array, elements: int) -> Row:
    """Of a static contact, pressures of points that lie side by side taken together.

    Within an element of the mesh a pressure at points swings, so the row has the smooth one that fits best: the root
    of 1 - xi^2 times a parabola, between ends that fit best, with the same force.

    Args:
        along: (3,) direction of rolling.

    Raises:
        UserError: nothing touches; the patch reaches the end of its face.
    """
    if not state.normal_force > 0:
        raise UserError("tyre.contact: the wheel does not touch the ground; give more interference")
    x, where = np.unique(np.round(state.points @ along, 7), return_inverse=True)
    areas = np.bincount(where, state.areas)
    p = np.bincount(where, state.areas * state.pressure) / areas
    near = np.flatnonzero(p > 1e-6 * p.max())
    if near[0] == 0 or near[-1] == len(x) - 1:
        raise UserError("tyre.contact: the patch reaches the end of its face and is cut off; make the face longer")
    middle = float(areas @ (x * p) / (areas @ p))
    reach = max(x[near[-1] + 1] - middle, middle - x[near[0] - 1])
    half = minimize_scalar(
        lambda a: _fitted(x - middle, p, areas, a)[1], bounds=(0.5 * reach, reach), method="bounded"
    ).x
    shape, _ = _fitted(x - middle, p, areas, half)
    fine = np.linspace(-1, 1, 200 * elements + 1)
    fit = shape(fine)
    sums = np.add.reduceat(0.5 * (fit[1:] + fit[:-1]), np.arange(0, 200 * elements, 200))
    length = 2 * float(half)
    width = float(areas.sum()) / (x[-1] - x[0])
    scale = state.normal_force / (sums.sum() / (200 * elements) * length * width)
    smooth = np.column_stack([middle + half * fine, scale * fit])
    return Row(x, p, smooth, sums[::-1] / sums.sum(), length, state.normal_force, length * width)


def _fitted(x: Array, p: Array, weight: Array, half: float) -> tuple[Callable[[Array], Array], float]:
    """Pressure over xi = x/half, and the sum of its squared errors."""
    xi = x / half
    root = np.sqrt(np.maximum(1 - xi**2, 0))
    basis = root[:, None] * xi[:, None] ** np.arange(3)
    by = np.sqrt(weight)
    found = np.linalg.lstsq(by[:, None] * basis, by * p, rcond=None)[0]
    error = float((weight * (basis @ found - p) ** 2).sum())
    return lambda t: np.maximum(np.sqrt(np.maximum(1 - t**2, 0)) * np.polyval(found[::-1], t), 0.0), error


@dataclass(frozen=True)
class Studied:
    """Attributes: row: of the static state. brush: with the structure. frequency: of its mode, Hz."""

    case: TyreCase
    row: Row
    brush: Brush
    frequency: float

    @cached_property
    def steady(self) -> tuple[Array, Array]:
        """Slips, and forces over the normal force, (n,)."""
        slips = np.linspace(0, 1.2 * max(self.case.jumps.targets), 61)[1:]
        n = 12 * len(self.brush.share)
        return slips, np.array([self.brush.carried(np.full(n, s), self.row.force)[-1] for s in slips]) / self.row.force

    @cached_property
    def constants(self) -> dict[str, Array]:
        """Of the table of jumps: time constants, s, by the exponential that fits best, and by 1 - 1/e of the change."""
        targets = np.array(self.case.jumps.targets)
        columns = {"slip": targets}
        rigid = replace(self.brush, compliance=0.0)
        for name, brush in (("", self.brush), ("rigid_", rigid)):
            for way in ("up", "down"):
                ends = [(0.0, s) if way == "up" else (s, 0.0) for s in targets]
                found = [jump(brush, first, last, self.row.force) for first, last in ends]
                columns[f"{name}{way}_fitted_s"] = np.array([fitted(*f) for f in found])
                columns[f"{name}{way}_reached_s"] = np.array([reached(*f) for f in found])
        return columns

    def loads(self) -> dict[str, Array]:
        """Of the table of load jumps at the slip shown: force before and after, N, and time constants, s."""
        b, s = self.brush, self.case.jumps.shown
        n = 12 * len(b.share)
        rows = []
        for share in self.case.jumps.loads:
            normal = self.row.force * np.concatenate([np.ones(n), np.full(n, share)])
            force = b.carried(np.full(2 * n, s), normal)[n - 1 :]
            time = b.step * np.arange(n + 1)
            moved = abs(force[-1] - force[0]) > 1e-9 * self.row.force
            rows.append([share, force[0], force[-1], reached(time, force) if moved else np.nan])
        return dict(zip(("load_share", "force_before_N", "force_after_N", "reached_s"), np.array(rows).T, strict=True))

    def sentences(self) -> list[str]:
        """What a reader came for."""
        r, b, c = self.row, self.brush, self.constants
        pass_time = b.length / b.speed
        up, down = c["up_fitted_s"], c["down_fitted_s"]
        return [
            f"The wheel stands with {r.force:.4g} N on a patch {1e3 * r.length:.3g} mm long, at most "
            f"{r.smooth[:, 1].max() / 1e3:.3g} kPa in the mean over its width; it is passed in {pass_time:.3g} s. "
            f"Points of the mesh stand up to {1e3 * r.spacing:.2g} mm apart there, which the length is known to.",
            f"After a jump of the slip from 0 the force follows with a time constant of {up[0]:.3g} s at a target of "
            f"{c['slip'][0]:g} and {up[-1]:.3g} s at {c['slip'][-1]:g}.",
            f"After a jump back to 0 it is {down.min():.3g} to {down.max():.3g} s.",
            "On a rigid wheel 1 - 1/e of the smallest jump is done after "
            f"{c['rigid_up_reached_s'][0] / pass_time:.4f} of that time (closed form for springs that all stick: "
            "1 - exp(-1/2) = 0.3935).",
            f"The mode at {self.frequency:.4g} Hz gives way by {1e6 * b.compliance:.3g} um/N along rolling and makes "
            f"the smallest jump {c['up_reached_s'][0] / c['rigid_up_reached_s'][0]:.3g} times as slow.",
        ]


def study(case: TyreCase, group: ModalGroup) -> Studied:
    """Jumps of a case whose body stands in a static state.

    Raises:
        UserError: no contact or interface of that name, a patch that is cut off.
    """
    t = case.tyre
    for what, known in (("contact", group.contacts), ("interface", group.interfaces)):
        if getattr(t, what) not in known:
            raise UserError(
                f"tyre.{what}: {getattr(t, what)} is none of the body's; it has {', '.join(known) or 'none'}"
            )
    face = group.interfaces[t.interface]
    found = row(group.contacts[t.contact], face.rotation[2], t.elements)
    yields = np.real(face.rows[2]) ** 2 / np.where(group.omega > 0, group.omega, np.inf) ** 2
    k = int(yields.argmax())
    brush = Brush(
        found.share, found.length, t.stiffness * found.area, t.friction, t.speed,
        0.0 if t.rigid else float(yields[k]), float(group.omega[k]), max(float(group.damping_ratio[k]), 0.0),
    )  # fmt: skip
    return Studied(case, found, brush, float(group.omega[k]) / (2 * np.pi))

"""A tyre whose slip or load jumps: a row of point contacts that is passed by material (unsteady rolling, Sextro, 6.10),
the case with every key, the row of the static state of its body, the answers.

Elements lie in a row along rolling; material enters at the first one. What an element remembers moves on to the next
one while the wheel rolls by its length, so the step of time is that of an element, and convection is exact. The wheel's
structure is one mode, that gives way along rolling under the force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BeforeValidator, Field, model_validator

from ..data import Array, ContactState, ModalGroup
from ..errors import UserError
from ..settings.arguments import checked, checked_fields, numbers
from ..settings.numbers import Model, Name, NotNegative, Positive, _tuple
from ..settings.toml import read_settings
from .arguments import NotNegatives, Reals, joined


@checked_fields
@dataclass(frozen=True)
class Brush:
    """Attributes:
    share: (n,) of the normal force on each element, their sum 1, from the leading edge on. length: of the row, m.
    stiffness: of all elements together, N/m. friction: coefficient. speed: of rolling, m/s. compliance: of the mode,
    m/N; frequency: of it, rad/s; damping: ratio of it. under: normal force of which share and length are, N: as in
    Hertz' line contact the length goes with the root of the force, and the pressure keeps its shape; None: both stay.

    Raises:
        UserError: a number that is none of a brush.
    """

    share: Annotated[Any, numbers(1, ge=0)]
    length: Positive
    stiffness: Positive
    friction: Positive
    speed: Positive
    compliance: NotNegative = 0.0
    frequency: Annotated[float, Field(gt=0)] = np.inf
    damping: NotNegative = 0.05
    under: Positive | None = None

    def __post_init__(self) -> None:
        if not abs(np.sum(self.share) - 1) < 1e-9:
            raise UserError(f"Brush: share: must have the sum 1, and has {np.sum(self.share):g}; correct it")

    @property
    def step(self) -> float:
        """s, in which the wheel rolls by an element."""
        return self.length / len(self.share) / self.speed

    @property
    def spring(self) -> float:
        """N/m of an element."""
        return self.stiffness / len(self.share)

    @checked
    def carried(self, slip: Reals, force: NotNegatives) -> Array:
        """(t,) tangential force after each step, N, from rest of the springs.

        Args:
            slip: (t,) slip over the speed of rolling, in each step. force: (t,) normal force, N.

        Raises:
            UserError: slip that is not finite, force that is negative.
        """
        slip, force = map(np.atleast_1d, joined(slip=slip, force=force))
        longest = max(1.0, float(self.lengthened(force).max()))
        u, mode = np.zeros(len(self.share) + 2 * self._beyond(longest)), np.zeros(3)
        out, scale, elements = np.empty(len(slip)), -1.0, self._elements(0.0, longest)
        for i, (s, normal) in enumerate(zip(slip, force, strict=True)):
            if (now := float(self.lengthened(normal))) != scale:
                scale, elements = now, self._elements(now, longest)
            share, cover, way = elements
            moved = np.concatenate([[0.0], u[:-1]])
            held = self.friction * normal * share
            limit = np.divide(held, self.spring * cover, out=np.zeros(len(u)), where=cover > 0)
            far = moved + way * s * self.speed * self.step
            mode, u = self._balanced(mode, far, way, limit, self.spring * cover)
            out[i] = self.spring * (cover @ u)
        return out

    def lengthened(self, force: ArrayLike) -> Array:
        """By how much the row is longer under a normal force, N, than `length`."""
        force = np.asarray(force, float)
        return np.ones_like(force) if self.under is None else np.sqrt(force / self.under)

    def _beyond(self, longest: float) -> int:
        """Elements before and behind the row that a longest one reaches."""
        return int(np.ceil(0.5 * len(self.share) * (longest - 1) - 1e-9))

    def _elements(self, scale: float, longest: float) -> tuple[Array, Array, Array]:
        """Of a row so many times as long: what each element carries of the normal force, how much of it lies in the
        patch, and how long the material has been in it in a step, over its length. In half lengths from -1 on it enters
        at -scale."""
        n, beyond = len(self.share), self._beyond(longest)
        edge = 2 / n * (np.arange(n + 2 * beyond + 1) - beyond) - 1
        inside = np.clip(edge, -scale, scale)
        carried = np.concatenate([[0.0], np.cumsum(self.share)])
        at = inside / scale if scale > 0 else np.ones_like(edge)
        share = np.diff(np.interp(at, np.linspace(-1, 1, n + 1), carried))
        middle = 0.5 * (edge[1:] + edge[:-1])
        return share, 0.5 * n * np.diff(inside), np.clip(0.5 * n * (middle + scale), 0.0, 1.0)

    def _balanced(self, mode: Array, far: Array, way: Array, limit: Array, spring: Array) -> tuple[Array, Array]:
        """Mode (w, its velocity and acceleration) and stretches at the end of a step: Newmark's method, and Newton's on
        the one unknown dw, as the force falls with it piecewise straight."""
        if self.compliance == 0:
            return mode, np.clip(far, -limit, limit)
        h, c = self.step, self.compliance
        w0, v0, a0 = mode
        soft = 0.0 if np.isinf(self.frequency) else 1 / self.frequency**2
        loss = 0.0 if np.isinf(self.frequency) else 2 * self.damping / self.frequency
        mass = soft * 4 / h**2 + loss * 2 / h + 1  # of w over c, by the mean acceleration
        known = soft * (4 / h * v0 + a0) + loss * v0  # of what dw = w - w0 does not change
        dw = 0.0
        for _ in range(100):
            free = far - way * dw
            u = np.clip(free, -limit, limit)
            slope = -(spring * way * (np.abs(free) < limit)).sum()
            left = mass * dw - known + w0 - c * (spring @ u)
            change = -left / (mass - c * slope)
            dw += change
            if abs(change) <= 1e-13 * max(abs(dw), 1e-9):
                break
        u = np.clip(far - way * dw, -limit, limit)
        if not soft:
            return np.array([w0 + dw, dw / h, 0.0]), u
        v = 2 / h * dw - v0
        return np.array([w0 + dw, v, 2 / h * (v - v0) - a0]), u


def parabola(elements: int) -> Array:
    """(n,) shares of a parabolic pressure (6.4-29)."""
    edge = 1 - 2 * np.arange(elements + 1) / elements
    return 0.75 * -np.diff(edge - edge**3 / 3)


def jump(brush: Brush, before: float, after: float, force: float, lengths: float = 12.0) -> tuple[Array, Array]:
    """Time after a jump of the slip (s), and the force, N, both from the moment of the jump on; steady before it."""
    n = int(np.ceil(lengths * len(brush.share)))
    slip = np.concatenate([np.full(n, before), np.full(n, after)])
    force_after = brush.carried(slip, force)[n - 1 :]
    return brush.step * np.arange(n + 1), force_after


def reached(time: Array, force: Array) -> float:
    """s after which 1 - 1/e of the change of the force is done; straight between steps."""
    done = (force - force[0]) / (force[-1] - force[0])
    i = int(np.argmax(done >= 1 - np.exp(-1)))
    low, high = done[i - 1], done[i]
    return float(time[i - 1] + (1 - np.exp(-1) - low) / (high - low) * (time[i] - time[i - 1]))


def fitted(time: Array, force: Array) -> float:
    """s, time constant of the exponential that fits the force best (Sextro Fig. 6.10-4); its ends are those of the
    force."""
    from scipy.optimize import minimize_scalar

    done = (force - force[0]) / (force[-1] - force[0])

    def error(constant: float) -> float:
        return float(((done - 1 + np.exp(-time / constant)) ** 2).sum())

    about = reached(time, force)
    return float(minimize_scalar(error, bounds=(0.2 * about, 5 * about), method="bounded").x)


Slip = Annotated[float, Field(gt=0, le=1)]
ENOUGH = 18
"""Places along the patch, three an element, from which on its length is off by less than 1 %."""


class TyreOfCase(Model):
    """A wheel that stands on the ground in the static state of its modal file."""

    body: Name
    """whose modal file is taken or made"""
    contact: Name = "ground"
    """the closure by which it stands"""
    interface: Name = "patch"
    """on the same face, t2 along rolling"""
    friction: Positive
    """coefficient"""
    stiffness: Positive
    """[Pa/m] of the row along rolling, per area"""
    elements: Annotated[int, Field(ge=4, le=2000)] = 20
    """of the row"""
    speed: Positive
    """[m/s]"""
    rigid: bool = False
    """whether the wheel is; else its mode that yields most along rolling gives way"""


class Jumps(Model):
    """Jumps of slip and load."""

    targets: Annotated[tuple[Slip, ...], BeforeValidator(_tuple), Field(min_length=2)]
    """slips to which it jumps from 0, and from which back to 0"""
    loads: Annotated[tuple[NotNegative, ...], BeforeValidator(_tuple)] = (0.5, 1.5)
    """shares of the static load to which the load jumps at the slip shown"""
    shown: Slip = 0.05
    """slip whose jump is drawn"""


class TyreCase(Model):
    """A tyre, and jumps."""

    name: Name
    """names the folder of the products, `build/NAME/`"""
    tyre: TyreOfCase
    jumps: Jumps

    @model_validator(mode="after")
    def _rise(self) -> TyreCase:
        if list(self.jumps.targets) != sorted(set(self.jumps.targets)):
            raise ValueError("jumps.targets: must rise from one to the next")
        return self


def load_tyre(path: Path | str, assignments: Sequence[str] | None = None) -> tuple[TyreCase, dict[str, Any]]:
    """A case of a tyre (SI units); see `read_settings`."""
    return read_settings(TyreCase, path, assignments)


@dataclass(frozen=True)
class PatchRow:
    """The middle of the patch along rolling. Attributes: x: (k,) places, m. pressure: (k,) Pa, the mean over the width.
    middle, length: of the half ellipse that stands for it, m. share: (n,) of elements, from the leading edge on. force:
    of the patch, N. width: m."""

    x: Array
    pressure: Array
    middle: float
    length: float
    share: Array
    force: float
    width: float

    @property
    def highest(self) -> float:
        """Pa, of the half ellipse."""
        return 4 * self.force / (np.pi * self.length * self.width)

    @property
    def places(self) -> int:
        """How many of x lie along the patch."""
        return int((np.abs(self.x - self.middle) < 0.5 * self.length).sum())


def row(state: ContactState, along: Array, elements: int) -> PatchRow:
    """Of a static contact: the half ellipse with the force, the centre and the second moment of its pressure.

    Args:
        along: (3,) direction of rolling.

    Raises:
        UserError: nothing touches; the patch reaches the end of its face.
    """
    if not state.normal_force > 0 or state.spread is None:
        raise UserError("tyre.contact: the wheel does not touch the ground; give more interference")
    x, where = np.unique(np.round(state.points @ along, 7), return_inverse=True)
    areas = np.bincount(where, state.areas)
    p = np.bincount(where, state.areas * state.pressure) / areas
    near = np.flatnonzero(p > 1e-6 * p.max())
    if near[0] == 0 or near[-1] == len(x) - 1:
        raise UserError("tyre.contact: the patch reaches the end of its face and is cut off; make the face longer")
    length = 4 * float(along @ state.spread @ along) ** 0.5
    edge = np.linspace(1, -1, elements + 1)
    share = -np.diff(np.arcsin(edge) + edge * np.sqrt(1 - edge**2)) / np.pi
    width = float(areas.sum()) / float(x[-1] - x[0])
    return PatchRow(x, p, float(state.centre @ along), length, share, state.normal_force, width)


@dataclass(frozen=True)
class TyreAnswer:
    """Attributes: row: of the static state. brush: with the structure. frequency: of its mode, Hz."""

    case: TyreCase
    row: PatchRow
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
        """Of the table of jumps, the one that is drawn among them: time constants, s, by the exponential
        that fits best, and by 1 - 1/e of the change."""
        targets = np.unique([*self.case.jumps.targets, self.case.jumps.shown])
        columns = {"slip": targets}
        rigid = replace(self.brush, compliance=0.0)
        for name, brush in (("", self.brush), ("rigid_", rigid)):
            for way in ("up", "down"):
                ends = [(0.0, s) if way == "up" else (s, 0.0) for s in targets]
                jumps = [jump(brush, first, last, self.row.force) for first, last in ends]
                columns[f"{name}{way}_fitted_s"] = np.array([fitted(*f) for f in jumps])
                columns[f"{name}{way}_reached_s"] = np.array([reached(*f) for f in jumps])
        return columns

    def loads(self) -> dict[str, Array]:
        """Of the table of load jumps at the slip shown: length of the patch after, m, force before and after, N, and
        time constants, s."""
        b, s = self.brush, self.case.jumps.shown
        rows = []
        for share in self.case.jumps.loads:
            longer = float(b.lengthened(share * self.row.force))
            n = int(np.ceil(12 * max(longer, 1.0) * len(b.share)))
            normal = self.row.force * np.concatenate([np.ones(n), np.full(n, share)])
            force = b.carried(np.full(2 * n, s), normal)[n - 1 :]
            time = b.step * np.arange(n + 1)
            changes = abs(force[-1] - force[0]) > 1e-9 * self.row.force
            rows.append([share, longer * b.length, force[0], force[-1], reached(time, force) if changes else np.nan])
        names = ("load_share", "patch_length_m", "force_before_N", "force_after_N", "reached_s")
        return dict(zip(names, np.array(rows).reshape(-1, len(names)).T, strict=True))

    def sentences(self) -> list[str]:
        """What a reader came for."""
        r, b, c = self.row, self.brush, self.constants
        pass_time = b.length / b.speed
        up, down = c["up_fitted_s"], c["down_fitted_s"]
        return [
            f"The wheel stands with {r.force:.4g} N on a patch {1e3 * r.length:.3g} mm long, at most "
            f"{r.highest / 1e3:.3g} kPa in the mean over its width; it is passed in {pass_time:.3g} s.",
            *self._coarse(),
            f"After a jump of the slip from 0 the force follows with a time constant of {up[0]:.3g} s at a target of "
            f"{c['slip'][0]:g} and {up[-1]:.3g} s at {c['slip'][-1]:g}.",
            f"After a jump back to 0 it is {down.min():.3g} to {down.max():.3g} s.",
            "On a rigid wheel 1 - 1/e of the smallest jump is done after "
            f"{c['rigid_up_reached_s'][0] / pass_time:.4f} of that time (closed form for springs that all stick: "
            "1 - exp(-1/2) = 0.3935).",
            f"The mode at {self.frequency:.4g} Hz gives way by {1e6 * b.compliance:.3g} µm/N along rolling and makes "
            f"the smallest jump {c['up_reached_s'][0] / c['rigid_up_reached_s'][0]:.3g} times as slow.",
        ]

    def _coarse(self) -> list[str]:
        """A length that the mesh does not tell."""
        if self.row.places >= ENOUGH:
            return []
        return [
            f"warning: only {self.row.places} rows of points of the mesh lie along the patch, so its length is known "
            "to a few per cent; take a smaller mesh.size of the body."
        ]


def study(case: TyreCase, group: ModalGroup) -> TyreAnswer:
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
        found.share, found.length, t.stiffness * found.length * found.width, t.friction, t.speed,
        0.0 if t.rigid else float(yields[k]), float(group.omega[k]), max(float(group.damping_ratio[k]), 0.0),
        found.force,
    )  # fmt: skip
    return TyreAnswer(case, found, brush, float(group.omega[k]) / (2 * np.pi))

"""What a case of rolling contact asks: its patches, the creep curve of the one that carries most, its tractions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from .. import plausible
from ..contact.solids import mismatch
from ..data import Array
from ..errors import UserError
from .exact import Exact, exact
from .fastsim import fastsim
from .laws import drag, rolled
from .settings import RollingCase
from .strips import CreepForces, Tractions
from .temperature import speed_parameter
from .wear import strip_work
from .wheelset import Drag, Pose, RollingPatch, Track, across, axle, patches, states

UNITS = {"longitudinal": "1", "lateral": "1", "spin": "1_per_m"}
UNLIKE = 0.02
"""Dundurs' beta from which it is told that the bodies are unlike; 0.17 pull with 0.35 mu F_N at no creepage."""

STEEPEST = 1.5
"""Coefficient of friction above which a warning is due: nothing that rolls on rails is held so well."""

BALANCED = 0.05
"""Part of the power of the creepages by which that of friction may differ without a warning."""
FAST = 5.0
"""V a/(2 kappa) from which on heat flows across the surface alone (Johnson, Contact Mechanics, 12.1)."""


ROUNDING, SETTLED = 1e-10, 1e-5
"""Of mu F_N: less is no force, of the strips and of the half-spaces, which are solved to 1e-7 at each element."""


AXES, UPRIGHT = ("x_forward", "y_left", "z_up"), np.array([1.0, -1.0, -1.0] * 2)
"""Of all tables, and what turns track axes into them."""


def _heads(x: Array, y: Array, moment: Array, held: float) -> dict[str, Array]:
    """Columns of forces on the wheel in a patch, across along the rail's surface, N and N m; held: mu F_N, N."""
    forward, left, up = AXES
    return {
        f"F_{forward}_N": x,
        f"F_{left}_N": y,
        f"M_{up}_Nm": moment,
        f"F_{forward}_over_mu_F_N": x / held,
        f"F_{left}_over_mu_F_N": y / held,
    }


def without_rounding(values: Array, least: float) -> Array:
    return np.where(np.abs(values) < least, 0.0, values)


@dataclass(frozen=True)
class RollingAnswer:
    """Attributes: patches: of the wheel, the most loaded first; none if it does not touch. creep: (3, n) xi, eta, phi
    of the curve. forces: (n,) of it. reference: some of its indices, |F|/(mu F_N) of the published FASTSIM there.
    exact: half-spaces at some states; missed: why there are none. shown: index of the state whose tractions these are.
    of_pose, pose_tractions: of the pose itself, (patches,). highest: coefficient of friction. hottest: of the patch,
    (n + patches,) degrees C, of the curve and of the pose, if asked."""

    case: RollingCase
    track: Track
    patches: list[RollingPatch]
    creep: Array
    forces: CreepForces | None
    reference: tuple[Array, Array] | None
    exact: Exact | None
    shown: int
    tractions: Tractions | None
    of_pose: CreepForces | None
    missed: str = ""
    highest: float = 0.0
    hottest: Array | None = None
    pose_tractions: Tractions | None = None

    def generalised(self) -> tuple[list[str], list[list[str | float]]]:
        """Head and rows: forces of the pose itself on wheel and rail, patch by patch, and moments about the middle of
        the axle and the origin of the rail's profile; x forward, y to the left, z up."""
        rows: list[list[str | float]] = []
        for k, p in enumerate(self.patches):
            assert self.of_pose is not None
            x, y, moment = (float(v[k]) for v in self.of_pose[:3])
            side = 1.0 if p.side == "right" else -1.0
            places = {"wheel": np.array([0.0, *p.axle]), "rail": np.array([0.0, side * self.track.rail_at, 0.0])}
            for sign, (body, about) in zip((1.0, -1.0), places.items(), strict=True):
                felt = without_rounding(sign * p.felt(x, y, moment, about), ROUNDING * p.normal_force)
                rows.append([k + 1, body, *map(float, felt * UPRIGHT + 0.0)])
        return ["patch", "body", *(f"F_{axis}_N" for axis in AXES), *(f"M_{axis}_Nm" for axis in AXES)], rows

    @property
    def over(self) -> Array:
        """(n,) what the curve runs over."""
        return self.creep[list(UNITS).index(self.case.creep.over)]

    @property
    def held(self) -> float:
        """mu F_N of the patch that carries most, N."""
        return self.highest * self.patches[0].normal_force

    def columns(self) -> dict[str, Array]:
        """Of the table of the curve."""
        m, n, p = self.held, self.creep.shape[1], self.patches[0]
        assert self.forces is not None
        x, y = (without_rounding(v, ROUNDING * m) for v in self.forces[:2])
        turn = without_rounding(self.forces.moment, ROUNDING * m * np.sqrt(p.a * p.b))
        hot = {} if self.hottest is None else {"largest_temperature_C": self.hottest[:n]}
        return {
            "longitudinal_creepage": self.creep[0], "lateral_creepage": self.creep[1], "spin_1_per_m": self.creep[2],
            **_heads(x, y, turn, m),
            "friction_power_W": self.forces.power * p.speed, "share_sliding": self.forces.sliding, **hot,
        }  # fmt: skip

    def sentences(self) -> list[str]:
        """What a reader came for."""
        if not self.patches or self.forces is None:
            return ["The wheel does not touch the rail: all forces are zero."]
        p, sentences = self.patches[0], []
        sides = sorted({q.side for q in self.patches})
        if len(self.patches) > 1:
            who = "The wheel touches the rail" if len(sides) == 1 else "The wheels touch the rails"
            where = "" if len(sides) == 1 else f", on the {p.side} rail"
            sentences.append(f"{who} in {len(self.patches)} patches; the curve is of the most loaded{where}.")
        sentences += [self._felt(side, "the wheel" if len(sides) == 1 else f"the {side} wheel") for side in sides]
        sentences.append(
            f"The patch is {2e3 * p.a:.3g} mm long and {2e3 * p.b:.3g} mm wide, under {p.normal_force:.5g} N with at "
            f"most {p.pressure / 1e6:.4g} MPa."
        )
        most = np.hypot(self.forces.x, self.forces.y) / self.held
        at = int(most.argmax())
        sentences.append(f"The largest creep force is {most[at]:.4g} mu F_N, at a {self.case.creep.over} "
                    f"{'creepage' if self.case.creep.over != 'spin' else 'value'} of {self.over[at]:.4g}.")  # fmt: skip
        if self.reference is not None:
            i, other = self.reference
            off = np.abs(np.hypot(self.forces.x, self.forces.y)[i] / self.held - other).max()
            sentences.append(
                f"FASTSIM as published, at {len(i)} points of the curve, is at most {100 * off:.2g} % of mu F_N away."
            )
        elif self.case.is_constant:
            sentences.append(
                "FASTSIM and exact half-spaces know no roughness, so that neither stands beside this curve."
            )
        else:
            sentences.append(
                f"mu is the highest coefficient, {self.highest:.4g}; FASTSIM and exact half-spaces know none that "
                "changes, so that neither stands beside this curve."
            )
        return [*sentences, *self._inclined(), *self._beside_exact(), *self._heated(), *self._worn(), *self.warnings()]

    def _felt(self, side: str, name: str) -> str:
        rows = [row for row in self.generalised()[1] if row[1] == "wheel"]
        parts = [row[2:] for row, p in zip(rows, self.patches, strict=True) if p.side == side]
        x, y, z = np.sum(np.array(parts, dtype=float), axis=0)[:3]
        along, across = ("forward", "backward")[int(x < 0)], ("right", "left")[int(y > 0)]
        return f"In its pose {name} feels {abs(x):.4g} N {along}, {abs(y):.4g} N to the {across} and {z:.5g} N upward."

    def _inclined(self) -> list[str]:
        """Where an inclined rail stands."""
        y, z = self.track.rail.moved
        if not (y or z):
            return []
        return [
            f"The rail, inclined by {1e3 * self.case.rail.inclination:.4g} mrad, stands by the point that is highest "
            f"then: rail.at is of that, which lies {1e3 * abs(y):.4g} mm to the {'field' if y > 0 else 'track'} side "
            "of the drawn profile's origin."
        ]

    def _heated(self) -> list[str]:
        if self.hottest is None:
            return []
        n = self.creep.shape[1]
        at = int(self.hottest[:n].argmax())
        return [f"The patch is at most {self.hottest[at]:.4g} degrees C hot, at {self.over[at]:.4g} of the curve, and "
                f"{self.hottest[n]:.4g} degrees C in its pose."]  # fmt: skip

    def worn(self) -> dict[str, Array]:
        """Of the table of wear: what a passage in the pose takes off wheel and rail each (6.8-6), strip by strip; no
        columns where it is not asked. y: to the left of the middle of the patch."""
        t, wear = self.pose_tractions, self.case.wear
        if t is None or wear is None:
            return {}
        width, work = strip_work(t)
        patch = np.broadcast_to(np.arange(1, len(work) + 1)[:, None], work.shape)
        columns = {"patch": patch, "y_left_m": t.y[..., 0], "width_m": width, "work_J_per_m2": work,
                   "depth_m": wear.coefficient * work}  # fmt: skip
        return {name: values.ravel() for name, values in columns.items()}

    def _worn(self) -> list[str]:
        worn = self.worn()
        if not worn:
            return []
        deepest, volume = worn["depth_m"].max(), worn["depth_m"] @ worn["width_m"]
        return [f"A passage in its pose takes at most {1e9 * deepest:.4g} nm off wheel and rail each, and "
                f"{1e12 * volume:.4g} mm3 a kilometre."]  # fmt: skip

    def _beside_exact(self) -> list[str]:
        """How far the strips are from the exact answer on this very case."""
        e, f = self.exact, self.forces
        if e is None or f is None:
            return [f"Exact half-spaces could not be had: {self.missed}."] if self.missed else []
        off = np.hypot(f.x[e.at] - e.x, f.y[e.at] - e.y) / self.held
        i = int(off.argmax())
        return [
            f"Exact half-spaces between the profiles themselves, at {len(e.at)} points of the curve, are at most "
            f"{100 * off[i]:.2g} % of mu F_N away, at {self.over[e.at[i]]:.4g} (their own error is about 1 %); their "
            f"largest pressure is {e.pressure / 1e6:.4g} MPa."
        ]

    def beside(self) -> dict[str, Array]:
        """Of the table of exact answers; none, no columns."""
        e = self.exact
        if e is None:
            return {}
        xi, eta, phi = self.creep[:, e.at]
        x, y = (without_rounding(v, self.held * SETTLED) for v in (e.x, e.y))
        given = {"longitudinal_creepage": xi, "lateral_creepage": eta, "spin_1_per_m": phi}
        return given | _heads(x, y, e.moment, self.held)

    def warnings(self) -> list[str]:
        """What a person should doubt."""
        warnings, wheel, rail = [], self.case.wheel, self.case.rail
        doubts = [plausible.modulus("wheel.young", wheel.young), plausible.modulus("rail.young", rail.young)]
        doubts.append(plausible.wheel_load(self.case.vertical_force, wheel.radius))
        doubts += [plausible.stress("The patch", q.pressure, min(wheel.young, rail.young)) for q in self.patches[:1]]
        warnings += [f"warning: {text}" for text in doubts if text]
        if self.highest > STEEPEST:
            warnings.append(f"warning: friction is {self.highest:g}; steel on steel has 0.05 to 0.6.")
        beta = mismatch(*self.case.solids)
        if abs(beta) > UNLIKE:
            warnings.append(
                f"warning: wheel and rail are unlike (Dundurs' beta {beta:.2g}): their pressure alone shears them, "
                "which strips, FASTSIM and Kalker's coefficients leave out and exact half-spaces do not."
            )
        if self.of_pose is not None and (self.case.heat or self.case.wear):
            warnings += [*self._slow(), *self._unbalanced()]
        for k, p in enumerate(self.patches):
            if p.conformal:
                warnings.append(
                    f"warning: patch {k + 1}: wheel and rail conform: it is {2e3 * p.b:.3g} mm wide, too wide for its "
                    "radii of curvature, so that neither body is a half-space and the numbers are a guess."
                )
            ends = ((p.on_wheel, self.track.wheel.y), (p.on_rail, self.track.rail.y))
            if any(not y[0] <= middle - p.b <= middle + p.b <= y[-1] for middle, y in ends):
                warnings.append(
                    f"warning: patch {k + 1}, {2e3 * p.b:.3g} mm wide, reaches beyond the end of a profile, where its "
                    "shape is not known and the patch taken for an ellipse; give a wider profile (width)."
                )
        return warnings

    def _slow(self) -> list[str]:
        """The temperatures are of sources that move fast."""
        p, bodies = self.patches[0], self.case.heat.made().bodies if self.case.heat else ()
        least = min(speed_parameter(p.speed, p.a, body) for body in bodies) if bodies else FAST
        if least >= FAST:
            return []
        return [f"warning: the heat spreads as fast as the patch moves, V a/(2 kappa) = {least:.2g} is below {FAST:g}: "
                "temperatures are too high."]  # fmt: skip

    def _unbalanced(self) -> list[str]:
        """Springs of their own for the spin, or that change along a strip, do not keep the energy."""
        f = self.of_pose
        assert f is not None
        given = -sum(f.x * [p.xi for p in self.patches] + f.y * [p.eta for p in self.patches]
                     + f.moment * [p.phi for p in self.patches])  # fmt: skip
        more = f.power.sum() / given
        if abs(more - 1) <= BALANCED:
            return []
        return [f"warning: in its pose friction takes {more:.3g} times the power of the creepages; heat and wear there "
                'are off by as much, less with model.spin = "book".']  # fmt: skip


def study(case: RollingCase, path: Path) -> RollingAnswer:
    """Patches, curve and tractions of a case; its files stand beside its own.

    Raises:
        UserError: profiles that are none, or do not overlap.
    """
    track, friction = case.track(path.parent), case.characteristic(path)
    heat = case.heat.made() if case.heat else None
    rough, how = case.surface(path), case.model.model_dump(exclude={"exact"})
    touching, pose = _touching(case, track, drag(track, friction, heat, rough, **how))
    creep = _creep(case, touching[0] if touching else None)
    if not touching:
        return RollingAnswer(case, track, touching, creep, None, None, None, 0, None, None)
    p, c = touching[0], case.creep
    highest = float(np.max(friction.highest(jnp.ones(1))))
    over = creep[list(UNITS).index(c.over)]
    shown = int(np.abs(over - (0.5 * (c.start + c.stop) if c.shown is None else c.shown)).argmin())
    given, speed = states(track, [p] * creep.shape[1] + touching)  # of the curve, and of the pose
    given[:3, : creep.shape[1]] = creep
    n = len(over)
    kept = np.array([shown, *range(n, len(speed))])
    run = rolled(given, friction, speed, kept, heat, rough, **how)
    forces, of_pose = (CreepForces(*(v[part] for v in run.forces)) for part in (slice(n), slice(n, None)))
    reference, beside, missed = None, None, ""
    if case.is_constant and rough is None:
        at = np.unique(np.linspace(0, n - 1, 13).astype(int))
        totals = [fastsim(*s[:6], highest, *s[6:])[0] for s in given[:, at].T]  # type: ignore[call-arg]
        reference = at, np.array([np.hypot(f.x, f.y) for f in totals]) / (highest * p.normal_force)
        beside, missed = _exact(case, track, pose, p, creep, np.hypot(forces.x, forces.y), highest)
    patch, of_patches = (Tractions(*(v[part] for v in run.tractions)) for part in (0, slice(1, None)))
    return RollingAnswer(
        case,
        track,
        touching,
        creep,
        forces,
        reference,
        beside,
        shown,
        patch,
        of_pose,
        missed,
        highest,
        run.hottest,
        of_patches,
    )


def _touching(case: RollingCase, track: Track, dragged: Drag) -> tuple[list[RollingPatch], Pose]:
    """Patches, the one that carries most first, and the pose; an axle rolls until both wheels carry the same."""
    pose, side, vertical = case.posed(), case.pose.side, case.vertical_force
    if side != "both":
        return patches(track, pose, side, vertical, dragged), pose
    left, right, pose = axle(track, pose, 2 * vertical, even=True, friction=dragged)
    return sorted([*left, *right], key=lambda p: -p.normal_force), pose


def _exact(
    case: RollingCase, track: Track, pose: Pose, p: RollingPatch, creep: Array, size: Array, friction: float
) -> tuple[Exact | None, str]:  # fmt: skip
    """At so many states of the curve as the case wants, in equal steps of the (n,) force; why not if there is none."""
    way = np.cumsum(np.abs(np.diff(size, prepend=size[:1])))
    at = np.unique(np.searchsorted(way, np.linspace(0, way[-1], case.model.exact)))
    if not len(at):
        return None, ""
    try:
        return exact(case.solids, p, across(track, pose, p.side, p), friction, creep, at), ""
    except UserError as error:
        return None, str(error)


def _creep(case: RollingCase, p: RollingPatch | None) -> Array:
    c = case.creep
    fixed = [c.longitudinal, c.lateral, c.spin]
    of_pose = [p.xi, p.eta, p.phi] if p else [0.0] * 3
    rows = [np.full(c.points, y if x is None else x) for x, y in zip(fixed, of_pose, strict=True)]
    rows[list(UNITS).index(c.over)] = np.linspace(c.start, c.stop, c.points)
    return np.array(rows)


def rows_of_patches(found: list[RollingPatch]) -> tuple[list[str], list[list[float | str]]]:
    """Head and a row for each patch, as in patches.csv."""
    head = [
        *(f"{axis}_m" for axis in AXES),
        "y_rail_profile_m",
        "y_wheel_profile_m",
        "falls_to_right_rad",
        "A_1_per_m",
        "B_1_per_m",
        "a_m",
        "b_m",
        "approach_m",
        "largest_pressure_Pa",
        "normal_force_N",
        "longitudinal_creepage",
        "lateral_creepage",
        "spin_1_per_m",
        "speed_m_per_s",
        "conformal",
        "side",
    ]
    return head, [[*(float(v) for v in (*p[0] * UPRIGHT[:3], *p[1:-1])), p.side] for p in found]

"""Profiles that wear across, in a case: run, take off, run on the new profiles again (Sextro, 6.8, Fig. 6.8-4)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..contact.friction import Friction
from ..data import Array
from ..errors import UserError
from ..progress import Report
from .ellipse import ellipses
from .laws import RoughSurface, drag, rolled
from .profiles import CrossSection
from .settings import WIDEST, RollingCase
from .wear import deposited, shortest_smoothing, smoothed, strip_work
from .wheelset import RollingPatch, Track, patches, states

STRIP = 1e-4
"""m, of the profiles that wear."""


class WornProfile(NamedTuple):
    """A profile that wears. Attributes: y: (n,) of its strips, m. new: (n,) z before, m. into: 1 where z points into
    the body, a rail, -1 of a wheel. depth: (n,) worn off, along z, m."""

    y: Array
    new: Array
    into: float
    depth: Array

    @staticmethod
    def of(profile: CrossSection, into: float) -> WornProfile:
        y = np.arange(profile.y[0], profile.y[-1], STRIP)
        return WornProfile(y, profile.height(y), into, np.zeros_like(y))

    def profile(self, smoothing: float) -> CrossSection:
        """As the contact sees it: the worn depth smoothed."""
        return CrossSection(self.y, self.new + self.into * smoothed(self.depth, STRIP, smoothing))

    def columns(self, smoothing: float) -> dict[str, Array]:
        """Of a table that is the profile, mm, and what is worn off."""
        return {"y_mm": 1e3 * self.y, "z_mm": 1e3 * self.profile(smoothing).z, "worn_mm": 1e3 * self.depth}


class StripWork(NamedTuple):
    """What a passage does to the strips of a patch, y to the left. Attributes: patch. width: (n,) m. work: (n,) of
    friction per area, J/m2."""

    patch: RollingPatch
    width: Array
    work: Array


class Moment(NamedTuple):
    """Attributes: passages: so far. pressure: the largest, Pa. a, b: of that patch, m. wheel, rail: deepest, m.
    volume: worn off both, m3 per m of the way."""

    passages: float
    pressure: float
    a: float
    b: float
    wheel: float
    rail: float
    volume: float


@dataclass(frozen=True)
class ProfileWear:
    """Attributes: wheel, rail: in the end. moments: before, and after every update. work: of friction between them, J
    per m of the way. smoothing: of the worn depth, m. least: with which no wave of it grows at the first update, m.
    approach: of new bodies, m."""

    wheel: WornProfile
    rail: WornProfile
    moments: list[Moment]
    work: float
    smoothing: float
    least: float
    approach: float

    def columns(self) -> dict[str, Array]:
        """Of a table over the passages."""
        names = ("passages", "largest_pressure_Pa", "a_m", "b_m", "deepest_wheel_m", "deepest_rail_m", "worn_m3_per_m")
        return dict(zip(names, np.array(self.moments).T, strict=True))

    def sentence(self) -> str:
        first, last = self.moments[0], self.moments[-1]
        return (
            f"After {last.passages:.4g} passages {1e6 * last.wheel:.3g} µm are worn off the wheel and "
            f"{1e6 * last.rail:.3g} µm off the rail at the deepest; the largest pressure went from "
            f"{first.pressure / 1e6:.4g} to {last.pressure / 1e6:.4g} MPa."
        )

    def warnings(self) -> list[str]:
        warnings, last = [], self.moments[-1]
        if self.smoothing < self.least:
            smooth = (
                f"smooth over {1e3 * self.least:.2g} mm or more (wear.smoothing), or " if self.least <= WIDEST else ""
            )
            warnings.append(
                f"warning: an update takes so much that waves of the worn profile amplify themselves: {smooth}"
                "take more updates (wear.updates)."
            )
        if last.wheel + last.rail > self.approach:
            warnings.append(
                f"warning: the grooves of wheel and rail are together {1e3 * (last.wheel + last.rail):.2g} mm deep, "
                f"more than the bodies approach each other, {1e3 * self.approach:.2g} mm: no ellipse is what touches "
                "in them, and the numbers are a guess; take fewer passages, or share them over shifts (wear.lateral)."
            )
        return warnings


def wearing(
    case: RollingCase, track: Track, friction: Friction, surface: RoughSurface | None = None,
    report: Report = lambda _: None,
) -> ProfileWear:  # fmt: skip
    """Updates of a case; wheel and rail are passed equally often.

    Raises:
        UserError: the wheel leaves the rail, or the contact wears beyond the end of a profile.
    """
    asked = case.wear
    assert asked is not None and asked.passages is not None
    bodies = [WornProfile.of(track.wheel, -1.0), WornProfile.of(track.rail, 1.0)]
    each, moments, work, least, approach = asked.passages / asked.updates, [], 0.0, 0.0, 0.0
    shifts = asked.lateral or (case.pose.lateral,)
    for k in range(asked.updates + 1):
        if k % max(1, asked.updates // 10) == 0:
            report(f"profiles that wear: {k} of {asked.updates} updates")
        wheel, rail = (body.profile(asked.smoothing) for body in bodies)
        seen = replace(track, wheel=wheel, rail=rail)
        runs = [strips for lateral in shifts for strips in _run(case, seen, friction, surface, lateral)]
        moments.append(_moment(k * each, runs, bodies))
        approach = approach or max(strips.patch.approach for strips in runs)
        if k == asked.updates:
            break
        share = each / len(shifts)
        bodies = [_worn(body, runs, asked.coefficient * share, case.pose.side) for body in bodies]
        work += share * sum(float(strips.width @ strips.work) for strips in runs)
        least = least or _shortest(runs, sum(body.depth.max() for body in bodies), track)
    return ProfileWear(bodies[0], bodies[1], moments, work, asked.smoothing, least, approach)


def _run(
    case: RollingCase, track: Track, friction: Friction, surface: RoughSurface | None, lateral: float
) -> list[StripWork]:
    """A passage in a pose."""
    heat = case.heat.made() if case.heat else None
    how = case.model.model_dump(exclude={"exact"})
    pose, vertical = replace(case.posed(), lateral=lateral), case.vertical_force
    dragged = drag(track, friction, heat, surface, **how)
    assert case.pose.side != "both"
    found = patches(track, pose, case.pose.side, vertical, dragged)
    if not found:
        raise UserError("wear: the wheel does not touch the rail, so nothing wears; correct pose or vertical_force")
    given, speed = states(track, found)
    t = rolled(given, friction, speed, np.arange(len(found)), heat, surface, **how).tractions
    return [StripWork(*each) for each in zip(found, *strip_work(t), strict=True)]


def _worn(body: WornProfile, runs: list[StripWork], coefficient: float, side: str) -> WornProfile:
    """After so many passages, of which the coefficient (m3/J) is the sum."""
    depth = body.depth.copy()
    turned = slice(None, None, -1 if side == "right" else 1)  # a profile's y runs to the field side
    for patch, width, work in runs:
        c = np.cos(patch.angle)
        middle = patch.on_rail if body.into > 0 else patch.on_wheel
        depth += deposited(coefficient * work[turned] / c, width[turned] * c, middle, body.y)
    return body._replace(depth=depth)


def _moment(passages: float, runs: list[StripWork], bodies: list[WornProfile]) -> Moment:
    p = max((strips.patch for strips in runs), key=lambda p: p.pressure)
    wheel, rail = (body.depth for body in bodies)
    worn = STRIP * float(wheel.sum() + rail.sum())
    return Moment(passages, p.pressure, p.a, p.b, float(wheel.max()), float(rail.max()), worn)


def _shortest(runs: list[StripWork], depth: float, track: Track) -> float:
    """m: `wear.shortest_smoothing` of what an update takes, as the pressure's p_0 a follows the curvature (Hertz)."""
    p = max((strips.patch for strips in runs), key=lambda p: p.pressure)
    B = max(p.B, 1e-3 * p.A) * np.array([0.99, 1.01])
    e = ellipses(p.A, B, p.normal_force, track.elastic.modulus)
    gain = float(np.diff(np.log(e.pressure * e.a))[0] / (2 * np.diff(B)[0]))
    return shortest_smoothing(depth, gain)

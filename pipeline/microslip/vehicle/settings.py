"""The case of a small vehicle on unround wheels; every key, checked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from ..contact.kinds import FileName
from ..contact.solids import Solid
from ..data import Array
from ..rolling.ellipse import combined
from ..rolling.profiles import CrossSection
from ..rolling.settings import Rail, StripKeys, TableOfCase, WearOfBody, Wheel
from ..rolling.wheelset import Track
from ..settings.numbers import Model, Name, NotNegative, Number, Positive, _tuple
from ..settings.toml import read_settings
from ..system.lumped import Body, Link, System
from .motion import Vehicle, sunk
from .touch import WheelTouch, touched, touching

Three = Annotated[tuple[NotNegative, NotNegative, NotNegative], BeforeValidator(_tuple)]
Inertia = Annotated[tuple[Positive, Positive, Positive], BeforeValidator(_tuple)]


class VehicleOfCase(Model):
    """A wheelset and its primary suspension to a frame that moves straight on."""

    load: Positive
    """[N] of the axle on both rails as it stands, its own weight included"""
    mass: Positive
    """[kg] of the wheelset"""
    inertia: Inertia
    """[kg m2] of roll, spin and yaw"""
    suspension_stiffness: Three
    """[N/m] of each side, along x, y, z"""
    suspension_damping: Three = (0.0, 0.0, 0.0)
    """[N s/m] likewise"""
    suspension_at: Positive = 1.0
    """[m] of each side from the middle"""


class TrackOfCase(Model):
    """What of each rail moves with a wheel."""

    mass: Positive
    """[kg]"""
    stiffness: Positive
    """[N/m]"""
    damping: NotNegative
    """[N s/m]"""


class RunningOfCase(Model):
    """How it runs."""

    speed: Positive
    """[m/s]"""
    turns: Annotated[Positive, Field(le=1e9)]
    """of the wheels"""
    torque: Number = 0.0
    """[N m] on the axle"""
    reach: Annotated[Positive, Field(le=0.05)] = 0.006
    """[m] lateral, for which contacts are known"""
    places: Annotated[int, Field(ge=24, le=1440)] = 180
    """over the circumference"""
    creep: Literal["table", "strips", "linear"] = "table"
    """forces of the motion, see [vehicle](unround_wheels.md#the-vehicle)"""
    speeds: Annotated[tuple[Positive, ...], BeforeValidator(_tuple)] = ()
    """[m/s] at which growth is looked for"""
    orders: Annotated[int, Field(ge=1, le=100)] = 20
    """up to which waves over the circumference are looked at"""


class Unround(Model):
    """A wave of a wheel's radius."""

    wheel: Literal["right", "left", "both"] = "both"
    """whose"""
    order: Annotated[int, Field(ge=1, le=100)]
    """waves over the circumference"""
    amplitude: Annotated[Positive, Field(le=5e-3)]
    """[m]"""
    angle: Number = 0.0
    """[rad] of the first crest after the mark"""


class WearOfTurns(WearOfBody):
    """What turns wear."""

    tolerance: Positive = 1e-7
    """[m] of the radius, of each jump over many turns"""
    profile: Literal["renewed", "kept"] = "renewed"
    """whether wheels touch by the profile that they have worn to, or by that of new ones"""


class KinematicsOfCase(Model):
    """How a wheel runs, from another program; see `kinematics.read_kinematics`."""

    file: FileName
    """what another program wrote of a wheel's running, see
    [kinematics](unround_wheels.md#kinematics-of-another-program)"""
    side: Literal["right", "left"] = "right"
    """of the wheel"""
    turns: Annotated[Positive, Field(le=1e9)]
    """over which it wears"""
    places: Annotated[int, Field(ge=24, le=1440)] = 180
    """over the circumference"""


class KinematicsCase(Model):
    """A wheel whose running is known."""

    name: Name
    """names the folder of the products, `build/NAME/`"""
    friction: Positive
    """coefficient"""
    wheel: Wheel
    rail: Rail
    kinematics: KinematicsOfCase
    wear: WearOfTurns
    model: StripKeys = StripKeys()


class VehicleCase(Model):
    """A small vehicle on unround wheels."""

    name: Name
    """names the folder of the products, `build/NAME/`"""
    friction: Positive
    """coefficient"""
    wheel: Wheel
    rail: Rail
    vehicle: VehicleOfCase
    track: TrackOfCase
    running: RunningOfCase
    unround: Annotated[tuple[Unround, ...], BeforeValidator(_tuple)] = ()
    wear: WearOfTurns
    model: StripKeys = StripKeys()
    table: TableOfCase = TableOfCase(points=(8, 10, 17, 17, 7), elements=(20, 20))

    @model_validator(mode="after")
    def _fits(self) -> VehicleCase:
        most = max((u.order for u in self.unround), default=1)
        if most > self.running.orders:
            raise ValueError(f"running.orders: {self.running.orders} leave out order {most}; give that or more")
        if self.running.places < 8 * max(most, self.running.orders):
            raise ValueError(
                f"running.places: {self.running.places} do not show waves of order {max(most, self.running.orders)}; "
                "give eight times as many at the least"
            )
        return self

    def made(self, folder: Path) -> Vehicle:
        """Of files beside the case.

        Raises:
            UserError: profiles that are none, or do not reach.
        """
        track = track_of(self, folder)
        elastic = track.elastic
        each = 0.5 * self.vehicle.load
        contacts = touching(track, each, self.running.reach)
        M, C, K = self.lumped().matrices()
        _, spin, _ = self.vehicle.inertia
        # what the suspension takes, as it has sunk
        held = K[1, 1] * sunk(touched(contacts.over, contacts.reach, 0.0), each, K)[0]
        return Vehicle(M, C, K, spin, self.vehicle.load + held, self.running.torque, self.running.speed, contacts.over,
                       contacts.reach, each, self.friction, elastic.shear, elastic.poisson)  # fmt: skip

    def profiles(self, folder: Path, y: Array) -> Callable[[Array], WheelTouch] | None:
        """Depth (n,) m on strips about y (n,) m of both wheels' profile -> where they touch; see `made`."""
        if self.wear.profile == "kept":
            return None
        each, worn = 0.5 * self.vehicle.load, worn_tracks(track_of(self, folder), y)
        return lambda depth: touching(worn(depth), each, self.running.reach).over

    def lumped(self) -> System:
        """Wheelset, suspension and rails, the coordinates those of `motion`."""
        v, t, r = self.vehicle, self.track, self.wheel.radius
        bodies = [Body("wheelset", v.mass, (0, 0, -r), v.inertia, "y z rx rz")]
        bodies += [
            Body(name, t.mass, (0, y, 0), free="z") for name, y in (("right", self.rail.at), ("left", -self.rail.at))
        ]
        k, c = v.suspension_stiffness, v.suspension_damping
        links = [Link("ground", "wheelset", k, c, at=(0, y, -r)) for y in (v.suspension_at, -v.suspension_at)]
        links += [Link("ground", name, t.stiffness, t.damping, axis=(0, 0, 1)) for name in ("right", "left")]
        return System(self.name, bodies, links)

    def shape(self) -> Array:
        """(places, 2) deviations of the new radii, right wheel first, m."""
        angle = 2 * np.pi * np.arange(self.running.places) / self.running.places
        out = np.zeros((len(angle), 2))
        for u in self.unround:
            sides = {"right": [0], "left": [1], "both": [0, 1]}[u.wheel]
            out[:, sides] += u.amplitude * np.cos(u.order * (angle - u.angle))[:, None]
        return out


def track_of(case: VehicleCase | KinematicsCase, folder: Path) -> Track:
    """Of files beside the case.

    Raises:
        UserError: profiles that are none.
    """
    elastic = combined(*(Solid(s.young, s.poisson) for s in (case.wheel, case.rail)))
    rail = case.rail.made(folder, 1.0).turned(case.rail.inclination)
    return Track(case.wheel.made(folder, -1.0), rail, case.wheel.radius, case.wheel.at, case.rail.at, elastic)


def worn_tracks(track: Track, y: Array) -> Callable[[Array], Track]:
    """Depth (n,) m on strips about y (n,) m of the wheel -> the track with wheels of such a profile."""
    fine = np.arange(track.wheel.y[0], track.wheel.y[-1], y[1] - y[0])
    new = track.wheel.height(fine)

    def worn(depth: Array) -> Track:
        height = new - np.interp(fine, y, depth, left=0.0, right=0.0)
        return replace(track, wheel=CrossSection(fine, height, track.wheel.name))

    return worn


def load_kinematics(
    path: Path | str, assignments: Sequence[str] | None = None
) -> tuple[KinematicsCase, dict[str, Any]]:
    """A case of given kinematics (SI units); see `read_settings`."""
    return read_settings(KinematicsCase, path, assignments)


def load_vehicle(path: Path | str, assignments: Sequence[str] | None = None) -> tuple[VehicleCase, dict[str, Any]]:
    """A case of a vehicle (SI units); see `read_settings`."""
    return read_settings(VehicleCase, path, assignments)

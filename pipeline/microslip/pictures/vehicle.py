"""Wheels that wear: radius, force and wear over the circumference, growth of waves over distance and speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..data import Array
from ..vehicle.kinematics import KinematicsAnswer
from ..vehicle.study import WHEELS, VehicleAnswer
from .plots import COLOURS, legend_below, panels, plain_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = 6
"""Orders that are drawn at the most: those that are largest at the end, as far as the axis shows them."""


def _over_angle(axes: Axes, angle: Array, values: Array, label: str, colour: str) -> None:
    axes.plot(angle, values, color=colour)
    axes.set(ylabel=label, xlim=(0, 360), xticks=range(0, 361, 60))


def circumference_picture(found: VehicleAnswer, figure: Figure, title: str) -> None:
    """Of the wheel that is out of round most: radius, normal force and wear of the first turn."""
    name, columns = WHEELS[found.wheel], found.circumference()
    places, angle = panels(figure, (8.0, 6.4), 3, sharex=True), columns["angle_deg"]
    shown = (
        (1e6 * columns[f"{name}_radius_m"], "radius in µm"),
        (1e-3 * columns[f"{name}_normal_force_N"], "normal force in kN"),
        (1e9 * columns[f"{name}_depth_m_per_km"], "wear in nm per km"),
    )
    for axes, curve, colour in zip(places, shown, COLOURS, strict=False):
        _over_angle(axes, angle, *curve, colour)
    mean = 1e6 * float(found.history[-1][0].radius[:, found.wheel].mean())
    worn, label = 1e6 * columns[f"{name}_radius_at_end_m"] - mean, "at the end, without its mean"
    places[0].plot(angle, worn, color="0.5", linestyle="--", label=label)
    places[0].set_title(f"{title}: {name} wheel, {found.case.running.speed:g} m/s")
    figure.legend(fontsize=9, loc="outside lower center")
    places[2].set_xlabel("angle from the mark in degrees")


def recorded_picture(found: KinematicsAnswer, figure: Figure, title: str) -> None:
    """Normal force and wear over the circumference, by given kinematics."""
    columns = found.circumference()
    force, worn = panels(figure, (8.0, 4.6), 2, sharex=True)
    angle = columns["angle_deg"]
    _over_angle(force, angle, 1e-3 * columns["normal_force_N"], "normal force in kN", COLOURS[1])
    force.set_title(f"{title}: {found.history[-1][0].turns:.4g} turns")
    _over_angle(worn, angle, 1e6 * columns["depth_m"], "worn in µm", COLOURS[2])
    worn.set_xlabel("angle from the mark in degrees")


def growth_picture(found: VehicleAnswer, figure: Figure, title: str) -> None:
    """Amplitudes of the largest orders over the distance; growth of all orders over the speed, where asked."""
    several = len(found.speeds) > 0
    figure.set_size_inches(9.6 if several else 6.4, 4.4)
    axes, *others = figure.subplots(1, 1 + several, squeeze=False)[0]
    plain_axes(axes)
    amplitudes = 1e6 * found.amplitudes()[:, :, found.wheel]
    km = found.growing()["total_distance_km"]
    low = max(1e-4, 1e-3 * float(amplitudes[-1].max()))
    largest = np.sort(np.argsort(-amplitudes[-1])[:SHOWN])
    for colour, n in zip(COLOURS, largest[amplitudes[:, largest].max(axis=0) > low], strict=False):
        axes.plot(km, amplitudes[:, n], color=colour, label=f"order {n + 1}")
    axes.set(xlabel="distance in km", ylabel="amplitude in µm", yscale="log", ylim=(low, None))
    axes.set_title(f"{title}: {WHEELS[found.wheel]} wheel")
    legend_below(figure, SHOWN)
    for place in others:
        _over_speed(found, figure, place)


def _over_speed(found: VehicleAnswer, figure: Figure, axes: Axes) -> None:
    grown = 1e6 / found.way * found.grown
    most = float(np.abs(grown).max())
    orders = np.arange(1, found.orders + 1)
    wide = 0.5 if len(found.speeds) == 1 else 0.0  # one speed has no neighbours to tell how wide its column is
    speeds = [found.speeds[0] - wide, found.speeds[0] + wide] if wide else found.speeds
    seen = np.repeat(grown, 2, axis=0) if wide else grown
    image = axes.pcolormesh(speeds, orders, seen.T, cmap="RdBu_r", vmin=-most, vmax=most, shading="nearest")
    axes.set(xlabel="speed in m/s", ylabel="order", title="growth per 1000 km")
    axes.set_yticks(orders[4::5])
    figure.colorbar(image, ax=axes)

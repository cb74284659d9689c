"""Wheels that wear: radius, force and wear over the circumference, growth of waves over distance and speed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..vehicle.kinematics import KinematicsAnswer
from ..vehicle.study import WHEELS, VehicleAnswer
from .plots import COLOURS, empty_figure, plain_axes, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = 6
"""Orders that are drawn at the most: those that are largest at the end, as far as the axis shows them."""


def circumference_picture(found: VehicleAnswer, path: Path, title: str) -> Path:
    """Of the wheel that is out of round most: radius, normal force and wear of the first turn."""
    name, columns = WHEELS[found.wheel], found.circumference()
    figure = empty_figure(8.0, 6.4)
    places = figure.subplots(3, 1, sharex=True)
    panels = (
        (1e6 * columns[f"{name}_radius_m"], "radius in µm"),
        (1e-3 * columns[f"{name}_normal_force_N"], "normal force in kN"),
        (1e9 * columns[f"{name}_depth_m_per_km"], "wear in nm per km"),
    )
    for i, (axes, (values, label)) in enumerate(zip(places, panels, strict=True)):
        plain_axes(axes)
        axes.plot(columns["angle_deg"], values, color=COLOURS[i])
        axes.set_ylabel(label)
    places[0].plot(columns["angle_deg"], 1e6 * columns[f"{name}_radius_at_end_m"] - _mean(found), color="0.5",
                   linestyle="--", label="at the end, without its mean")  # fmt: skip
    places[0].set_title(f"{title}: {name} wheel, {found.case.running.speed:g} m/s")
    figure.legend(fontsize=9, loc="outside lower center")
    places[2].set(xlabel="angle from the mark in degrees", xlim=(0, 360), xticks=range(0, 361, 60))
    return save_figure(figure, path)


def _mean(found: VehicleAnswer) -> float:
    return 1e6 * float(found.history[-1][0].radius[:, found.wheel].mean())


def recorded_picture(found: KinematicsAnswer, path: Path, title: str) -> Path:
    """Normal force and wear over the circumference, by given kinematics."""
    columns = found.circumference()
    figure = empty_figure(8.0, 4.6)
    force, worn = figure.subplots(2, 1, sharex=True)
    for axes in (force, worn):
        plain_axes(axes)
    force.plot(columns["angle_deg"], 1e-3 * columns["normal_force_N"], color=COLOURS[1])
    force.set(ylabel="normal force in kN", title=f"{title}: {found.history[-1][0].turns:.4g} turns")
    worn.plot(columns["angle_deg"], 1e6 * columns["depth_m"], color=COLOURS[2])
    worn.set(ylabel="worn in µm", xlabel="angle from the mark in degrees", xlim=(0, 360), xticks=range(0, 361, 60))
    return save_figure(figure, path)


def growth_picture(found: VehicleAnswer, path: Path, title: str) -> Path:
    """Amplitudes of the largest orders over the distance; growth of all orders over the speed, where asked."""
    figure = empty_figure(9.6 if len(found.speeds) else 6.4, 4.4)
    panels = figure.subplots(1, 2 if len(found.speeds) else 1, squeeze=False)[0]
    amplitudes = 1e6 * found.amplitudes()[:, :, found.wheel]
    km = found.growing()["total_distance_km"]
    plain_axes(panels[0])
    low = max(1e-4, 1e-3 * float(amplitudes[-1].max()))
    largest = np.sort(np.argsort(-amplitudes[-1])[:SHOWN])
    for i, n in enumerate(largest[amplitudes[:, largest].max(axis=0) > low]):
        panels[0].plot(km, amplitudes[:, n], color=COLOURS[i % len(COLOURS)], label=f"order {n + 1}")
    panels[0].set(xlabel="distance in km", ylabel="amplitude in µm", yscale="log", ylim=(low, None))
    panels[0].set_title(f"{title}: {WHEELS[found.wheel]} wheel")
    figure.legend(fontsize=9, loc="outside lower center", ncols=SHOWN)
    if len(found.speeds):
        _over_speed(found, figure, panels[1])
    return save_figure(figure, path)


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

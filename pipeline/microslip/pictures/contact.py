"""What a contact law does, drawn from the tables of `contact.study` by matplotlib: one picture a table."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array
from ..units import Quantity
from .plots import BESIDE, COLOURS, GREY, Look, in_rows, in_unit, panels, right_axes, save, shades

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..contact.study import Study

Columns = dict[str, np.ndarray]


def draw(study: Study, folder: Path) -> list[Path]:
    """A PNG for every table that has a picture."""
    return [save(partial(draw_table, name, study), folder / f"{name}.png") for name in study.tables if name in _DRAWN]


DIMENSIONLESS: ContextVar[bool] = ContextVar("numbers without dimension", default=False)
"""While a dimensionless contact is drawn."""


@contextmanager
def dimensions(study: Study, figure: Figure) -> Iterator[None]:
    """What is drawn into the figure has units, or a star instead where the file has no dimension."""
    bare = study.contact.file.dimensionless
    before = DIMENSIONLESS.set(bare)
    try:
        yield
    finally:
        DIMENSIONLESS.reset(before)
    for axes in figure.axes if bare else ():
        axes.set(xlabel=_starred(axes.get_xlabel()), ylabel=_starred(axes.get_ylabel()))


def draw_table(name: str, study: Study, figure: Figure) -> None:
    """The picture of a table."""
    with dimensions(study, figure):
        _DRAWN[name](study, figure)


def _starred(label: str) -> str:
    """A label as the book has it: a star instead of the unit."""
    what, *unit = re.split(r",? in (?=\S*$)", label)
    return f"{what[:-1]}^{{*}}$" if unit and what.endswith("$") else f"{what}*" if unit and unit != ["%"] else label


def _in_unit(of: Quantity, *values: Array) -> tuple[list[Array], str]:
    return (list(values), "") if DIMENSIONLESS.get() else in_unit(of, *values)


def _title(figure: Figure, study: Study, what: str) -> None:
    figure.suptitle(f"{study.contact.file.name}: {what}", fontweight="bold")


def _sized(table: Columns, *names: str) -> tuple[list[Array], str]:
    """Columns of a table in the unit that suits them all; theirs is what their names end with."""
    return _in_unit(Quantity(names[0].rsplit("_", 1)[1]), *(table[name] for name in names))


def _number(value: float, unit: str) -> str:
    if not unit:
        return f"{value:.3g}"
    return f"{value:.3g} {unit}" if abs(value) < 1000 else f"{value:.0f} {unit}"


# normal law --------------------------------------------------------------------------------------


def normal_figure(study: Study, figure: Figure) -> None:
    """Force over the approach, stiffness over the force, area in contact."""
    t, working = study.tables["normal"], study.working
    rough = study.contact.roughness is not None
    first, second, *third = panels(figure, (10.5 if rough else 8.0, 3.6), 1, 3 if rough else 2)
    ((u,), unit), ((force,), newton) = _sized(t, "approach_m"), _sized(t, "force_N")
    first.plot(u, force, linewidth=1.8)
    first.set(xlabel=f"approach $u_n$ in {unit}", ylabel=f"normal force in {newton}")
    if working is not None and working[1] > 0:
        factor = (u[-1] / t["approach_m"][-1], force[-1] / t["force_N"][-1])
        first.plot(working[0] * factor[0], working[1] * factor[1], "o", label="working point")
        first.legend(frameon=False, fontsize=8, loc="upper left")
    _stiffness_panel(second, t, force, newton)
    for axes in third:
        axes.plot(u, 100 * t["area_share"], color=COLOURS[2], linewidth=1.8)
        axes.set(xlabel=f"approach $u_n$ in {unit}", ylabel="share of the area in contact in %")
    _title(figure, study, "normal contact")


_STIFFNESS = {
    "normal": "normal_stiffness_N/m",
    "tangential, t1": "tangential_stiffness_t1_N/m",
    "tangential, t2": "tangential_stiffness_t2_N/m",
}


def _stiffness_panel(axes: Axes, t: Columns, force: Array, newton: str) -> None:
    names = {label: name for label, name in _STIFFNESS.items() if name in t}
    first, second = (names.get(f"tangential, t{i}") for i in (1, 2))
    if first and second and np.array_equal(t[first], t[second]):
        names = {"normal": names["normal"], "tangential": first}
    values, unit = _sized(t, *names.values())
    for label, stiffness in zip(names, values, strict=True):
        axes.plot(force, stiffness, linewidth=1.8, label=label)
    axes.set(xlabel=f"normal force in {newton}", ylabel=f"stiffness in {unit}")
    axes.set_ylim(bottom=0, top=1.25 * max(float(v.max()) for v in values))
    axes.legend(frameon=False, fontsize=8, loc="upper left", ncols=2)


# loops -------------------------------------------------------------------------------------------


def loops_figure(study: Study, figure: Figure) -> None:
    """Tangential force over displacement for several amplitudes, and the energy of a cycle over the amplitude."""
    t = study.tables["loops"]
    left, right = panels(figure, (9.6, 4.2), 1, 2, width_ratios=(3, 2))
    (u, amplitude), unit = _sized(t, "u_t1_m", "amplitude_m")
    (force,), newton = _sized(t, "F_t1_N")
    sizes, first = np.unique(amplitude, return_index=True)
    for colour, size in zip(COLOURS, sizes[::-1], strict=False):
        for part, line in ((0, ":"), (1, "-")):
            chosen = (amplitude == size) & (t["cycle"] == part)
            label = _number(size, unit) if part else None
            left.plot(u[chosen], force[chosen], line, color=colour, linewidth=1.5, label=label)
    left.set(xlabel=f"displacement $u_{{t1}}$ in {unit}", ylabel=f"tangential force $F_{{t1}}$ in {newton}")
    left.legend(title="amplitude\n(dotted: first loading)", title_fontsize=8, **BESIDE)
    (energy,), joule = _in_unit(Quantity("J"), t["dissipated_J"][first])
    right.plot(sizes, energy, "-o", linewidth=1.5, markersize=4.5)
    right.set(xlabel=f"amplitude in {unit}", ylabel=f"energy dissipated in a cycle in {joule}")
    right.set_xlim(left=0)
    right.set_ylim(bottom=0)
    _title(figure, study, "hysteresis at the working point")


# motion ------------------------------------------------------------------------------------------


_NAMES, _TINTS = ("n", "t1", "t2"), (COLOURS[2], COLOURS[0], COLOURS[1])


def motion_figure(study: Study, figure: Figure) -> None:
    """As the book's Fig. 3.7-7: orbits of M and P, displacements, forces, and the force over each displacement; of a
    contact that is driven on, as Figs. 3.7-3 and 3.7-4: phases of P, its velocity and the friction on it over time."""
    t, motion = study.tables["motion"], study.contact.file.motion
    assert motion is not None
    last = slice(None) if motion.drift else slice(len(t["time_s"]) - motion.samples - 1, None)
    t = {name: column[last] for name, column in t.items()}
    (time,), second = _in_unit(Quantity("s"), t["time_s"] - t["time_s"][0])
    u, unit = _sized(t, *(f"u_{i}_m" for i in _NAMES), "P_t1_m", "P_t2_m")
    forces, newton = _sized(t, *(f"F_{i}_N" for i in _NAMES))
    moving = [i for i in range(3) if np.ptp(u[i]) > 0]
    orbit = bool(motion.drift) or {1, 2} <= set(moving)
    of_point = [name for name in ("v_P_t1_m/s", "friction_t1_N") if motion.drift and name in t]
    count = 2 + orbit + len(of_point or moving)
    places = in_rows(figure, count, 2 if count == 4 else 3, 3.67, 3.3)
    if motion.drift:
        _phase_panel(places.pop(0), t, u, unit)
    elif orbit:
        _orbit_panel(places.pop(0), u, unit, t["state"])
    above, pressed, *loops = places
    _histories(above, time, u, moving)
    above.set(xlabel=f"time in {second}", ylabel=f"displacement in {unit}")
    for i in range(3):
        if np.ptp(forces[i]) > 0 or i == 0:
            pressed.plot(time, forces[i], color=_TINTS[i], linewidth=1.5, label=f"$F_{{{_NAMES[i]}}}$")
    pressed.set(xlabel=f"time in {second}", ylabel=f"force in {newton}")
    partly = study.contact.settings.what.partly
    _shade(pressed, time, t["state"], "stick, partly slip" if partly else "stick")
    for axes in (above, pressed):
        _legend_above(axes)
    for axes, name in zip(loops, of_point, strict=False):
        (values,), size = _sized(t, name)
        axes.plot(time, values, color=COLOURS[3], linewidth=1.4)
        word = "velocity of P" if name.startswith("v") else "friction force on P"
        axes.set(xlabel=f"time in {second}", ylabel=f"{word}, t1, in {size}")
    for axes, i in () if of_point else zip(loops, moving, strict=True):
        axes.plot(u[i], forces[i], color=_TINTS[i], linewidth=1.6)
        axes.set(xlabel=f"$u_{{{_NAMES[i]}}}$ in {unit}", ylabel=f"$F_{{{_NAMES[i]}}}$ in {newton}")
    _title(figure, study, "motion from the start" if motion.drift else "last cycle of the motion")


def _histories(axes: Axes, time: Array, u: list[Array], moving: list[int]) -> None:
    """Displacements of M, and of P where it is moved."""
    for i in moving:
        label = f"M, {_NAMES[i]}" if i else "$u_n$"
        axes.plot(time, u[i], color=_TINTS[i], linewidth=1.5, label=label)
        if i:
            axes.plot(time, u[i + 2], "--", color=_TINTS[i], linewidth=1.5, label=f"P, {_NAMES[i]}")


def _orbit_panel(axes: Axes, u: list[Array], unit: str, state: Array) -> None:
    """Paths of M and P in the contact plane; P is drawn where the contact is closed."""
    closed = np.where(state > 0, 1.0, np.nan)
    axes.plot(u[1], u[2], color=COLOURS[5], linewidth=1.5, label="M")
    axes.plot(u[3] * closed, u[4] * closed, color=COLOURS[3], linewidth=1.5, label="P, in contact")
    axes.set(xlabel=f"t1 in {unit}", ylabel=f"t2 in {unit}")
    axes.set_aspect("equal", adjustable="datalim")
    _legend_above(axes)


def _phase_panel(axes: Axes, t: Columns, u: list[Array], unit: str) -> None:
    """Velocity of P over the stretch of its spring, as the book's Fig. 3.7-3."""
    axes.plot(u[1] - u[3], t["v_P_t1_m/s"], color=COLOURS[3], linewidth=1.4)
    axes.set(xlabel=f"M less P, t1, in {unit}", ylabel=f"velocity of P in {'' if DIMENSIONLESS.get() else 'm/s'}")


def _shade(axes: Any, time: Array, state: Array, stick: str) -> None:
    """Blue-grey where the contact sticks, white where it slips, hatched where it is open. stick: word for the first."""
    styles: tuple[tuple[int, dict[str, Any]], ...] = (
        (1, {"color": "#e3e8f0", "label": stick}),
        (0, {"facecolor": "none", "edgecolor": "#c9ced8", "hatch": "///", "label": "separated"}),
    )
    for value, style in styles:
        jumps = np.diff((state == value).astype(int), prepend=0, append=0)
        for a, b in zip(np.flatnonzero(jumps == 1), np.flatnonzero(jumps == -1), strict=True):
            axes.axvspan(time[max(int(a) - 1, 0)], time[int(b) - 1], zorder=0, linewidth=0, **style)
            style["label"] = "_"


def _legend_above(axes: Axes) -> None:
    if handles := axes.get_legend_handles_labels()[0]:
        axes.legend(
            frameon=False, fontsize=8, columnspacing=1.0, handlelength=1.4, loc="lower center",
            bbox_to_anchor=(0.5, 1.0), ncols=min(len(handles), 5),
        )  # fmt: skip


# friction ----------------------------------------------------------------------------------------


def friction_figure(study: Study, figure: Figure) -> None:
    """The coefficient over the speed of sliding."""
    t = study.tables["friction"]
    (axes,) = panels(figure, (6.4, 4.0))
    speed = t["speed_m/s"]
    if "approach_m" in t:
        _fluid(axes, t)
    else:
        axes.plot(speed, t["coefficient"], linewidth=1.8, label="coefficient")
        if "mean_less_deviation" in t:
            low, high, label = t["mean_less_deviation"], t["mean_plus_deviation"], "one standard deviation"
            axes.fill_between(speed, low, high, color=COLOURS[0], alpha=0.18, linewidth=0, label=label)
        if "smoothed" in t:
            axes.plot(speed, t["smoothed"], "--", linewidth=1.5, label="smoothed")
        if "temperature_rise_K" in t:
            dots: Look = {"ls": ":", "color": COLOURS[4], "linewidth": 1.5}
            axes.plot([], [], label="rise of temperature (right)", **dots)
            warm = right_axes(axes, "rise of temperature in K")
            warm.plot(speed, t["temperature_rise_K"], **dots)
            warm.set_ylim(bottom=0)
    if speed[0] > 0 and speed[-1] / speed[0] > 50:
        axes.set_xscale("log")
    axes.set(xlabel=f"speed of sliding in {'' if DIMENSIONLESS.get() else 'm/s'}", ylabel="friction coefficient")
    axes.set_ylim(0, 1.05 * float(np.max(t.get("mean_plus_deviation", t["coefficient"]))) or 1.0)
    _legend_above(axes)
    _title(figure, study, "friction characteristic")


def _fluid(axes: Axes, t: Columns) -> None:
    (approach,), unit = _sized(t, "approach_m")
    for colour, value in zip(COLOURS, np.unique(approach), strict=False):
        chosen = approach == value
        x, label = t["speed_m/s"][chosen], f"$u_n$ = {_number(value, unit)}"
        axes.plot(x, t["coefficient"][chosen], color=colour, linewidth=1.6, label=label)
        axes.plot(x, t["dry_part"][chosen], ":", color=colour, linewidth=1.2)
    axes.plot([], [], ":", color=GREY, label="dry part alone")


# microslip, wear, yield --------------------------------------------------------------------------


def microslip_figure(study: Study, figure: Figure) -> None:
    """First loading: tangential force (friction coefficient, under given normal forces) over displacement."""
    (axes,) = panels(figure, (7.4, 4.2))
    microslip_panel(study, axes)
    _title(figure, study, "microslip, first loading")


def microslip_panel(study: Study, axes: Axes) -> None:
    """One curve an approach or a normal force."""
    t, given = study.tables["microslip"], study.contact.file.microslip
    pressed = given is not None and bool(given.normal_forces)
    ((w,), unit), ((u,), length) = _sized(t, "displacement_m"), _sized(t, "approach_m")
    ((force,), newton), ((loads,), load_unit) = _sized(t, "F_t_N"), _sized(t, "normal_force_N")
    values = np.unique(loads)[::-1]
    for colour, load in zip(shades(len(values), 0.88)[::-1], values, strict=True):
        chosen = loads == load
        at = f"$F_n$ = {_number(load, load_unit)}" if pressed else f"$u_n$ = {_number(u[chosen][0], length)}"
        axes.plot(w[chosen], (t["coefficient"] if pressed else force)[chosen], color=colour, linewidth=1.6, label=at)
    name = "friction coefficient $F_t/F_n$" if pressed else f"tangential force in {newton}"
    axes.set(xlabel=f"tangential displacement in {unit}", ylabel=name)
    axes.set_xlim(0, w.max())
    axes.set_ylim(bottom=0)
    axes.legend(**BESIDE)


def wear_figure(study: Study, figure: Figure) -> None:
    """Heights and pressure at several times; area, stiffness, pressure and roughness over the time."""
    t, h = study.tables["wear"], study.tables["wear_heights"]
    high, pressed, *histories = panels(figure, (11.0, 6.4), 2, 3)
    ((depth,), unit), ((pressure,), pascal) = _sized(h, "depth_m"), _sized(h, "pressure_Pa")
    (times,), second = _sized(h, "time_s")
    every, share = np.unique(times), 100 * h["area_share"]
    for colour, at in zip(shades(len(every), 0.88)[::-1], every, strict=True):
        chosen = times == at
        line: Look = {"color": colour, "linewidth": 1.5}
        high.plot(share[chosen], depth[chosen], **line)
        pressed.plot(share[chosen], pressure[chosen], label=_number(at, second), **line)
    high.invert_yaxis()
    high.set(xlabel="share of the area in %", ylabel=f"depth in {unit}")
    pressed.set(xlabel="share of the area in %", ylabel=f"pressure in {pascal}")
    pressed.legend(frameon=False, fontsize=8, loc="upper right")
    _wear_histories(histories, t)
    _title(figure, study, "wear at a constant normal force")


def _wear_histories(places: list[Axes], t: Columns) -> None:
    (time,), second = _sized(t, "time_s")
    (stiffness,), stiff = _sized(t, "normal_stiffness_N/m")
    (approach, height), unit = _sized(t, "approach_m", "peak_to_valley_m")
    (pressure,), pascal = _sized(t, "largest_pressure_Pa")
    shown = (
        (100 * t["area_share"], "area in contact in %"),
        (stiffness, f"normal stiffness in {stiff}"),
        (pressure, f"largest pressure in {pascal}"),
        (approach, f"length in {unit}"),
    )
    for axes, (values, name) in zip(places, shown, strict=True):
        axes.plot(time, values, linewidth=1.7, label="approach")
        axes.set(xlabel=f"time in {second}", ylabel=name)
    places[3].plot(time, height, linewidth=1.7, label="peak to valley")
    places[3].legend(frameon=False, fontsize=8)
    for axes in places:
        axes.set_ylim(bottom=0)
        axes.set_xlim(0, time[-1])


def yield_figure(study: Study, figure: Figure) -> None:
    """Mean pressure and shear of the area in contact, and the largest shear stress against the yield limit."""
    t = study.tables["yield"]
    (axes,) = panels(figure, (6.8, 4.0))
    (time,), second = _in_unit(Quantity("s"), t["time_s"] - t["time_s"][0])
    shear = np.hypot(t["shear_t1_Pa"], t["shear_t2_Pa"])
    both, pascal = _in_unit(Quantity("Pa"), t["pressure_Pa"], shear)
    axes.plot(time, both[0], color=COLOURS[2], linewidth=1.5, label="pressure")
    axes.plot(time, both[1], color=COLOURS[0], linewidth=1.5, label="shear")
    axes.plot([], [], "--", color=COLOURS[1], label="share of the yield limit (right)")
    axes.set(xlabel=f"time in {second}", ylabel=f"mean stress of the area in contact in {pascal}")
    top = 100 * float(t["share_of_yield"].max())
    right = right_axes(axes, "share of the yield limit in %")
    right.plot(time, 100 * t["share_of_yield"], "--", color=COLOURS[1], linewidth=1.5)
    if top > 40:
        right.axhline(100, color=COLOURS[1], linewidth=0.8)
    right.set_ylim(0, max(110.0, 1.1 * top) if top > 40 else 1.6 * top or 1.0)
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    _title(figure, study, "yield by Tresca")


_DRAWN: dict[str, Callable[[Study, Figure], None]] = {
    "normal": normal_figure, "loops": loops_figure, "motion": motion_figure, "friction": friction_figure,
    "microslip": microslip_figure, "wear": wear_figure, "yield": yield_figure,
}  # fmt: skip

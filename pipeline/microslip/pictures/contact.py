"""What a contact law does, drawn from the tables of `contact.study` by matplotlib: one picture a table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..units import METRES
from .plots import COLOURS, empty_figure, plain_axes, save_figure, single_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..contact.study import Study

Columns = dict[str, np.ndarray]
GREY = "#5b6270"


def draw(study: Study, folder: Path) -> list[Path]:
    """A PNG for every table that has a picture."""
    return [save_figure(_DRAWN[name](study), folder / f"{name}.png") for name in study.tables if name in _DRAWN]


def _title(study: Study, what: str) -> str:
    return f"{study.contact.file.name}: {what}"


Steps = tuple[tuple[float, float, str], ...]
"""Of a unit: value from which it is taken, what it is, its prefix."""

_NEWTON: Steps = ((1e6, 1e6, "M"), (1e4, 1e3, "k"), (0.1, 1.0, ""), (1e-4, 1e-3, "m"), (0.0, 1e-6, "µ"))
_PASCAL: Steps = ((1e9, 1e9, "G"), (1e6, 1e6, "M"), (1e3, 1e3, "k"), (0.0, 1.0, ""))
_JOULE: Steps = ((0.5, 1.0, ""), (5e-4, 1e-3, "m"), (5e-7, 1e-6, "µ"), (0.0, 1e-9, "n"))
_SECOND: Steps = ((0.5, 1.0, ""), (5e-4, 1e-3, "m"), (0.0, 1e-6, "µ"))


def _amount(values: np.ndarray, unit: str, steps: Steps) -> tuple[np.ndarray, str]:
    """Values in a unit that needs no powers of ten."""
    top = float(np.nanmax(np.abs(values), initial=0.0))
    _, scale, prefix = next(s for s in steps if top >= s[0])
    return values / scale, f"{prefix}{unit}"


def _newtons(values: np.ndarray) -> tuple[np.ndarray, str]:
    return _amount(values, "N", _NEWTON)


def _stiffness(values: np.ndarray) -> tuple[np.ndarray, str]:
    top = float(np.nanmax(np.abs(values), initial=0.0))
    return (values / 1e6, "N/µm") if top >= 1e5 else (values, "N/m")


def _pascals(values: np.ndarray) -> tuple[np.ndarray, str]:
    return _amount(values, "Pa", _PASCAL)


def _seconds(values: np.ndarray) -> tuple[np.ndarray, str]:
    return (values / 3600, "h") if values.max() >= 7200 else _amount(values, "s", _SECOND)


def _metres(*values: np.ndarray) -> tuple[list[np.ndarray], str]:
    """Several lengths in one unit."""
    scale, unit = METRES.scale(max(float(np.abs(v).max(initial=0.0)) for v in values))
    return [scale * v for v in values], unit


def _number(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}" if abs(value) < 1000 else f"{value:.0f} {unit}"


# --- normal law ----------------------------------------------------------------------------------------------------


def normal_figure(study: Study) -> Any:
    """Force over the approach, stiffness over the force, area in contact."""
    t, working = study.tables["normal"], study.working
    rough = study.contact.roughness is not None
    figure = empty_figure(10.5 if rough else 8.0, 3.6)
    panels = figure.subplots(1, 3 if rough else 2)
    (u,), unit = _metres(t["approach_m"])
    force, newton = _newtons(t["force_N"])
    for axes in panels:
        plain_axes(axes)
    panels[0].plot(u, force, color=COLOURS[0], linewidth=1.8)
    panels[0].set(xlabel=f"approach $u_n$ in {unit}", ylabel=f"normal force in {newton}")
    if working is not None and working[1] > 0:
        factor = (u[-1] / t["approach_m"][-1], force[-1] / t["force_N"][-1])
        panels[0].plot(working[0] * factor[0], working[1] * factor[1], "o", color=COLOURS[1], label="working point")
        panels[0].legend(frameon=False, fontsize=8, loc="upper left")
    _stiffness_panel(panels[1], t, force, newton)
    if rough:
        panels[2].plot(u, 100 * t["area_share"], color=COLOURS[2], linewidth=1.8)
        panels[2].set(xlabel=f"approach $u_n$ in {unit}", ylabel="share of the area in contact in %")
    figure.suptitle(_title(study, "normal contact"), fontweight="bold")
    return figure


def _stiffness_panel(axes: Axes, t: Columns, force: np.ndarray, newton: str) -> None:
    names = {
        "normal_stiffness_N/m": "normal",
        "tangential_stiffness_t1_N/m": "tangential, t1",
        "tangential_stiffness_t2_N/m": "tangential, t2",
    }
    found = {label: t[name] for name, label in names.items() if name in t}
    same = "tangential, t2" in found and np.array_equal(found["tangential, t1"], found["tangential, t2"])
    if same:
        found = {"normal": found["normal"], "tangential": found["tangential, t1"]}
    _, unit = _stiffness(np.concatenate(list(found.values())))
    scale = 1e6 if unit == "N/µm" else 1.0
    for (label, values), colour in zip(found.items(), COLOURS, strict=False):
        axes.plot(force, values / scale, color=colour, linewidth=1.8, label=label)
    axes.set(xlabel=f"normal force in {newton}", ylabel=f"stiffness in {unit}")
    axes.set_ylim(bottom=0, top=1.25 * max(float(v.max()) for v in found.values()) / scale)
    axes.legend(frameon=False, fontsize=8, loc="upper left", ncols=2)


# --- loops ---------------------------------------------------------------------------------------------------------


def loops_figure(study: Study) -> Any:
    """Tangential force over displacement for several amplitudes, and the energy of a cycle over the amplitude."""
    t = study.tables["loops"]
    figure = empty_figure(9.6, 4.2)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    (u, amplitude), unit = _metres(t["u_t1_m"], t["amplitude_m"])
    force, newton = _newtons(t["F_t1_N"])
    sizes = np.unique(amplitude)
    for colour, size in zip(COLOURS, sizes[::-1], strict=False):
        for part, line in ((0, ":"), (1, "-")):
            chosen = (amplitude == size) & (t["cycle"] == part)
            label = _number(size, unit) if part else None
            left.plot(u[chosen], force[chosen], line, color=colour, linewidth=1.5, label=label)
    left.set(xlabel=f"displacement $u_{{t1}}$ in {unit}", ylabel=f"tangential force $F_{{t1}}$ in {newton}")
    where = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5), "frameon": False}
    left.legend(title="amplitude\n(dotted: first loading)", fontsize=8, title_fontsize=8, **where)
    energy = np.array([t["dissipated_J"][amplitude == size][0] for size in sizes])
    scaled, joule = _amount(energy, "J", _JOULE)
    right.plot(sizes, scaled, "-o", color=COLOURS[0], linewidth=1.5, markersize=4.5)
    right.set(xlabel=f"amplitude in {unit}", ylabel=f"energy dissipated in a cycle in {joule}")
    right.set_xlim(left=0)
    right.set_ylim(bottom=0)
    for axes in (left, right):
        plain_axes(axes)
    figure.suptitle(_title(study, "hysteresis at the working point"), fontweight="bold")
    return figure


# --- motion --------------------------------------------------------------------------------------------------------


_NAMES, _TINTS = ("n", "t1", "t2"), (COLOURS[2], COLOURS[0], COLOURS[1])


def motion_figure(study: Study) -> Any:
    """As the book's Fig. 3.7-7: orbits of M and P, displacements, forces, and the force over each displacement."""
    t, motion = study.tables["motion"], study.contact.file.motion
    assert motion is not None
    last = slice(None) if motion.drift else slice(len(t["time_s"]) - motion.samples - 1, None)
    t = {name: column[last] for name, column in t.items()}
    time, second = _seconds(t["time_s"] - t["time_s"][0])
    u, unit = _metres(*(t[f"u_{i}_m"] for i in _NAMES), t["P_t1_m"], t["P_t2_m"])
    forces, newton = _newtons(np.stack([t[f"F_{i}_N"] for i in _NAMES]))
    moving = [i for i in range(3) if np.ptp(u[i]) > 0]
    orbit = bool(motion.drift) or {1, 2} <= set(moving)
    panels = _panels(2 + orbit + len(moving))
    figure = panels[0].figure
    if motion.drift:
        _phase_panel(panels.pop(0), t, u, unit)
    elif orbit:
        _orbit_panel(panels.pop(0), u, unit, t["state"])
    _histories(panels[0], time, u, moving)
    panels[0].set(xlabel=f"time in {second}", ylabel=f"displacement in {unit}")
    for i in range(3):
        if np.ptp(forces[i]) > 0 or i == 0:
            panels[1].plot(time, forces[i], color=_TINTS[i], linewidth=1.5, label=f"$F_{{{_NAMES[i]}}}$")
    panels[1].set(xlabel=f"time in {second}", ylabel=f"force in {newton}")
    partly = study.contact.settings.what.partly
    _shade(panels[1], time, t["state"], "stick, partly slip" if partly else "stick")
    for axes in panels[:2]:
        _legend_above(axes)
    for axes, i in zip(panels[2:], moving, strict=True):
        axes.plot(u[i], forces[i], color=_TINTS[i], linewidth=1.6)
        axes.set(xlabel=f"$u_{{{_NAMES[i]}}}$ in {unit}", ylabel=f"$F_{{{_NAMES[i]}}}$ in {newton}")
    what = "motion from the start" if motion.drift else "last cycle of the motion"
    figure.suptitle(_title(study, what), fontweight="bold")
    return figure


def _panels(count: int) -> list[Any]:
    """Axes in rows of three, of four in two rows of two."""
    columns = 2 if count == 4 else min(count, 3)
    rows = -(-count // columns)
    found = list(empty_figure(3.67 * columns, 3.3 * rows).subplots(rows, columns, squeeze=False).ravel())
    for axes in found:
        plain_axes(axes)
    for axes in found[count:]:
        axes.set_visible(False)
    return found[:count]


def _histories(axes: Axes, time: np.ndarray, u: list[np.ndarray], moving: list[int]) -> None:
    """Displacements of M, and of P where it is moved."""
    if 0 in moving:
        axes.plot(time, u[0], color=_TINTS[0], linewidth=1.5, label="$u_n$")
    for i in (1, 2):
        if i in moving:
            axes.plot(time, u[i], color=_TINTS[i], linewidth=1.5, label=f"M, {_NAMES[i]}")
            axes.plot(time, u[i + 2], "--", color=_TINTS[i], linewidth=1.5, label=f"P, {_NAMES[i]}")


def _orbit_panel(axes: Axes, u: list[np.ndarray], unit: str, state: np.ndarray) -> None:
    """Paths of M and P in the contact plane; P is drawn where the contact is closed."""
    closed = np.where(state > 0, 1.0, np.nan)
    axes.plot(u[1], u[2], color=COLOURS[5], linewidth=1.5, label="M")
    axes.plot(u[3] * closed, u[4] * closed, color=COLOURS[3], linewidth=1.5, label="P, in contact")
    axes.set(xlabel=f"t1 in {unit}", ylabel=f"t2 in {unit}")
    axes.set_aspect("equal", adjustable="datalim")
    _legend_above(axes)


def _phase_panel(axes: Axes, t: Columns, u: list[np.ndarray], unit: str) -> None:
    """Velocity of P over the stretch of its spring, as the book's Fig. 3.7-3."""
    axes.plot(u[1] - u[3], t["v_P_t1_m/s"], color=COLOURS[3], linewidth=1.4)
    axes.set(xlabel=f"M less P, t1, in {unit}", ylabel="velocity of P in m/s")


def _shade(axes: Any, time: np.ndarray, state: np.ndarray, stick: str) -> None:
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
    handles, _ = axes.get_legend_handles_labels()
    if not handles:
        return
    columns = min(len(handles), 5)
    where = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": columns}
    axes.legend(frameon=False, fontsize=8, columnspacing=1.0, handlelength=1.4, **where)


# --- friction ------------------------------------------------------------------------------------------------------


def friction_figure(study: Study) -> Any:
    """The coefficient over the speed of sliding."""
    t = study.tables["friction"]
    figure, axes = single_panel(6.4, 4.0)
    speed = t["speed_m/s"]
    if "approach_m" in t:
        _fluid(axes, t)
    else:
        axes.plot(speed, t["coefficient"], color=COLOURS[0], linewidth=1.8, label="coefficient")
        if "mean_less_deviation" in t:
            low, high, label = t["mean_less_deviation"], t["mean_plus_deviation"], "one standard deviation"
            axes.fill_between(speed, low, high, color=COLOURS[0], alpha=0.18, linewidth=0, label=label)
        if "smoothed" in t:
            axes.plot(speed, t["smoothed"], "--", color=COLOURS[1], linewidth=1.5, label="smoothed")
        _warm(axes, t)
    if speed[0] > 0 and speed[-1] / speed[0] > 50:
        axes.set_xscale("log")
    axes.set(xlabel="speed of sliding in m/s", ylabel="friction coefficient")
    axes.set_ylim(0, 1.05 * float(np.max(t.get("mean_plus_deviation", t["coefficient"]))) or 1.0)
    _legend_above(axes)
    figure.suptitle(_title(study, "friction characteristic"), fontweight="bold")
    return figure


def _warm(axes: Axes, t: Columns) -> None:
    """The rise of temperature on an axis of its own."""
    if "temperature_rise_K" not in t:
        return
    axes.plot([], [], ":", color=COLOURS[4], linewidth=1.5, label="rise of temperature (right)")
    beside = axes.twinx()
    beside.plot(t["speed_m/s"], t["temperature_rise_K"], ":", color=COLOURS[4], linewidth=1.5)
    beside.set_ylabel("rise of temperature in K")
    beside.set_ylim(bottom=0)
    beside.spines["top"].set_visible(False)


def _fluid(axes: Axes, t: Columns) -> None:
    (approach,), unit = _metres(t["approach_m"])
    for colour, value in zip(COLOURS, np.unique(approach), strict=False):
        chosen = approach == value
        x, y, label = t["speed_m/s"][chosen], t["coefficient"][chosen], f"$u_n$ = {_number(value, unit)}"
        axes.plot(x, y, color=colour, linewidth=1.6, label=label)
        axes.plot(t["speed_m/s"][chosen], t["dry_part"][chosen], ":", color=colour, linewidth=1.2)
    axes.plot([], [], ":", color=GREY, label="dry part alone")


# --- microslip, wear, yield ----------------------------------------------------------------------------------------


def microslip_figure(study: Study) -> Any:
    """First loading: tangential force (friction coefficient, under given normal forces) over displacement."""
    figure = empty_figure(7.4, 4.2)
    microslip_panel(study, figure.subplots())
    figure.suptitle(_title(study, "microslip, first loading"), fontweight="bold")
    return figure


def microslip_panel(study: Study, axes: Axes) -> None:
    """One curve an approach or a normal force."""
    t, given = study.tables["microslip"], study.contact.file.microslip
    pressed = given is not None and bool(given.normal_forces)
    plain_axes(axes)
    (w,), unit = _metres(t["displacement_m"])
    (u,), length = _metres(t["approach_m"])
    (force, newton), (loads, load_unit) = _newtons(t["F_t_N"]), _newtons(t["normal_force_N"])
    values = np.unique(loads)[::-1]
    for colour, load in zip(_shades(len(values)), values, strict=True):
        chosen = loads == load
        at = f"$F_n$ = {_number(load, load_unit)}" if pressed else f"$u_n$ = {_number(u[chosen][0], length)}"
        axes.plot(w[chosen], (t["coefficient"] if pressed else force)[chosen], color=colour, linewidth=1.6, label=at)
    name = "friction coefficient $F_t/F_n$" if pressed else f"tangential force in {newton}"
    axes.set(xlabel=f"tangential displacement in {unit}", ylabel=name)
    axes.set_xlim(0, w.max())
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _shades(count: int) -> list[Any]:
    from matplotlib import colormaps

    return [colormaps["viridis"](x) for x in np.linspace(0.05, 0.88, max(count, 1))]


def wear_figure(study: Study) -> Any:
    """Heights and pressure at several times; area, stiffness, pressure and roughness over the time."""
    t, h = study.tables["wear"], study.tables["wear_heights"]
    figure = empty_figure(11.0, 6.4)
    panels = figure.subplots(2, 3).ravel()
    for axes in panels:
        plain_axes(axes)
    (depth,), unit = _metres(h["depth_m"])
    pressure, pascal = _pascals(h["pressure_Pa"])
    times, second = _seconds(h["time_s"])
    for colour, at in zip(_shades(len(np.unique(times))), np.unique(times), strict=True):
        chosen = times == at
        panels[0].plot(100 * h["area_share"][chosen], depth[chosen], color=colour, linewidth=1.5)
        panels[1].plot(
            100 * h["area_share"][chosen], pressure[chosen], color=colour, linewidth=1.5, label=_number(at, second)
        )
    panels[0].invert_yaxis()
    panels[0].set(xlabel="share of the area in %", ylabel=f"depth in {unit}")
    panels[1].set(xlabel="share of the area in %", ylabel=f"pressure in {pascal}")
    panels[1].legend(frameon=False, fontsize=8, loc="upper right")
    _wear_histories(list(panels[2:]), t)
    figure.suptitle(_title(study, "wear at a constant normal force"), fontweight="bold")
    return figure


def _wear_histories(panels: list[Axes], t: Columns) -> None:
    time, second = _seconds(t["time_s"])
    stiffness, stiff = _stiffness(t["normal_stiffness_N/m"])
    (approach, height), unit = _metres(t["approach_m"], t["peak_to_valley_m"])
    pressure, pascal = _pascals(t["largest_pressure_Pa"])
    shown = (
        (100 * t["area_share"], "area in contact in %"),
        (stiffness, f"normal stiffness in {stiff}"),
        (pressure, f"largest pressure in {pascal}"),
    )
    for axes, (values, name) in zip(panels, shown, strict=False):
        axes.plot(time, values, color=COLOURS[0], linewidth=1.7)
        axes.set_ylabel(name)
    panels[3].plot(time, approach, color=COLOURS[0], linewidth=1.7, label="approach")
    panels[3].plot(time, height, color=COLOURS[1], linewidth=1.7, label="peak to valley")
    panels[3].set_ylabel(f"length in {unit}")
    panels[3].legend(frameon=False, fontsize=8)
    for axes in panels:
        axes.set_xlabel(f"time in {second}")
        axes.set_ylim(bottom=0)
        axes.set_xlim(0, time[-1])


def yield_figure(study: Study) -> Any:
    """Mean pressure and shear of the area in contact, and the largest shear stress against the yield limit."""
    t = study.tables["yield"]
    figure, axes = single_panel(6.8, 4.0)
    time, second = _seconds(t["time_s"] - t["time_s"][0])
    shear = np.hypot(t["shear_t1_Pa"], t["shear_t2_Pa"])
    both, pascal = _pascals(np.stack([t["pressure_Pa"], shear]))
    axes.plot(time, both[0], color=COLOURS[2], linewidth=1.5, label="pressure")
    axes.plot(time, both[1], color=COLOURS[0], linewidth=1.5, label="shear")
    axes.plot([], [], "--", color=COLOURS[1], label="share of the yield limit (right)")
    axes.set(xlabel=f"time in {second}", ylabel=f"mean stress of the area in contact in {pascal}")
    beside = axes.twinx()
    beside.plot(time, 100 * t["share_of_yield"], "--", color=COLOURS[1], linewidth=1.5)
    top = 100 * float(t["share_of_yield"].max())
    if top > 40:
        beside.axhline(100, color=COLOURS[1], linewidth=0.8)
    beside.set_ylabel("share of the yield limit in %")
    beside.set_ylim(0, max(110.0, 1.1 * top) if top > 40 else 1.6 * top or 1.0)
    beside.spines["top"].set_visible(False)
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    figure.suptitle(_title(study, "yield by Tresca"), fontweight="bold")
    return figure


_DRAWN = {
    "normal": normal_figure, "loops": loops_figure, "motion": motion_figure, "friction": friction_figure,
    "microslip": microslip_figure, "wear": wear_figure, "yield": yield_figure,
}  # fmt: skip

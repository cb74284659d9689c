"""Pictures of docs/contact.md: friction characteristics, the point contact element, loops, microslip."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from microslip.contact.friction import Coulomb, Exponential, Falling, Friction, StaticSliding, characteristic, scattered
from microslip.contact.study import Study, study
from microslip.pictures.contact import dimensions, draw_table, microslip_panel
from microslip.pictures.plots import figure_of

ROOT = Path(__file__).parents[1]
CASES = ROOT / "pipeline" / "cases" / "contact"
OWN = ROOT / "pipeline" / "microslip" / "templates" / "contact"
COLOURS = ("#0b4f9c", "#c8382c", "#26863c", "#8a4fb5", "#d98410", "#16919c")


def of_figure(number: str) -> Study:
    return study(CASES / f"fig-{number}.toml")


def friction(fig: Any, plain: Any) -> Any:
    """Left: by formula. Middle: rubber at three temperatures. Right: a coefficient that scatters in time."""
    left, middle, right = fig.subplots(1, 3)
    for axes in (left, middle, right):
        plain(axes)
        axes.set_ylabel("friction coefficient")
    speed = np.linspace(0, 1, 400)
    laws: dict[str, Friction] = {
        "coulomb": Coulomb(0.23), "static-sliding": StaticSliding(0.3, 0.2), "falling": Falling(0.3, 4.5),
        "exponential": Exponential(0.3, 0.15, 8.0), "exponential, rising": Exponential(0.1, 0.25, 5.0),
    }  # fmt: skip
    for colour, (name, law) in zip(COLOURS, laws.items(), strict=False):
        left.plot(speed, at(law, speed), color=colour, label=name)
        if name == "static-sliding":
            left.plot(0, at(law, np.zeros(1)), "o", color=colour, markersize=4)
    left.set(xlabel="speed of sliding in m/s", ylim=(0, 0.42))
    left.legend(frameon=False, fontsize=8, ncols=2, loc="upper right")
    _rubber(middle)
    law = scattered(Falling(0.28, 1 / 0.22), 0.1, 0.02, seed=1)
    time = np.linspace(0, 1, 2000)
    for colour, v in zip(COLOURS, (0.05, 0.2, 0.6), strict=False):
        mu = law.coefficient(jnp.full(len(time), v), jnp.ones(len(time)), jnp.asarray(time))
        right.plot(time, mu, color=colour, linewidth=0.9, label=f"{v:g} m/s")
    right.set(xlabel="time in s", ylim=(0, 0.36))
    right.legend(frameon=False, fontsize=8, ncols=3, loc="upper right")
    return fig


def _rubber(axes: Any) -> None:
    rows = [line.split(",") for line in (OWN / "rubber.csv").read_text().splitlines()[2:]]
    v, mu = np.array(rows, dtype=float).T
    speed = np.geomspace(1e-5, 1e2, 600)
    for colour, kelvin in zip(COLOURS, (293.0, 313.0, 333.0), strict=False):
        law = characteristic(v, mu, temperature=kelvin, reference=293.0)
        axes.semilogx(speed, at(law, speed), color=colour, label=f"{kelvin:g} K")
    axes.plot(v, mu, "o", color=COLOURS[0], markersize=3.5)
    axes.set(xlabel="speed of sliding in m/s", ylim=(0, 1.5))
    axes.legend(frameon=False, fontsize=8, ncols=3, loc="upper right")


def at(law: Friction, speed: np.ndarray) -> np.ndarray:
    return np.asarray(law.coefficient(jnp.asarray(speed), jnp.ones(len(speed))))


def element() -> Any:
    return figure_of(partial(draw_table, "motion", of_figure("3.7-7")))


def stick_slip() -> Any:
    return figure_of(partial(draw_table, "motion", of_figure("3.7-3")))


def loops() -> Any:
    found = study(OWN / "contact.toml", ["motion.amplitudes=[1.0, 2.0, 4.0, 8.0]", 'name="shroud"'])
    return figure_of(partial(draw_table, "loops", found))


def microslip(fig: Any) -> Any:
    """Fig. 3.8-2 a to d."""
    for axes, letter in zip(fig.subplots(2, 2).ravel(), "abcd", strict=True):
        found = of_figure(f"3.8-2{letter}")
        with dimensions(found, fig):
            microslip_panel(found, axes)
        axes.set_title(f"{letter})", loc="left", fontsize=10)
        if letter in "ac":
            axes.get_legend().remove()
    return fig


ELEMENTS = {
    "point": '{kind="rough"}', "strips of the rough surface": '{kind="strips", count=64}',
    "Iwan, uniform": '{kind="iwan", count=64}',
    "Segalman, chi = -0.5": '{kind="iwan", exponent=-0.5, ratio=0.2, count=64}',
}  # fmt: skip
AMPLITUDES = tuple(0.1 * 1.25**i for i in range(22))


def elements(fig: Any, plain: Any) -> Any:
    """Left: loops of one amplitude. Right: energy of a cycle over the amplitude."""
    left, right = fig.subplots(1, 2)
    for colour, (name, element) in zip(COLOURS, ELEMENTS.items(), strict=False):
        sizes = f"motion.amplitudes=[3.0, {', '.join(f'{a:.4g}' for a in AMPLITUDES)}]"
        t = study(OWN / "contact.toml", [f"law={element}", sizes, "motion.samples=1024"]).tables["loops"]
        chosen = np.isclose(t["amplitude_m"], 3e-6) & (t["cycle"] == 1)
        left.plot(1e6 * t["u_t1_m"][chosen], t["F_t1_N"][chosen], color=colour, label=name)
        size, first = np.unique(t["amplitude_m"], return_index=True)
        energy = t["dissipated_J"][first]
        right.loglog(1e6 * size[energy > 1e-12], 1e3 * energy[energy > 1e-12], color=colour)
    for axes in (left, right):
        plain(axes)
    left.set(xlabel="displacement in µm", ylabel="tangential force in N", ylim=(-330, 480))
    left.legend(frameon=False, fontsize=8, ncols=2, loc="upper left")
    right.set(xlabel="amplitude in µm", ylabel="energy of a cycle in mJ", ylim=(1e-5, 20))
    return fig

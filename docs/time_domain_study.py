"""Tables and pictures of docs/time_domain.md: the oscillators of sections 4.2 and 4.3, and balance against time."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

import microslip as ms
from microslip.case import load_case
from microslip.case.assemble import build
from microslip.data import ModalBasis
from microslip.pictures.orbit import portraits
from microslip.pictures.plots import save
from microslip.time_domain import equations, orbit
from microslip.time_domain.orbit import Orbit
from microslip.units import counted
from microslip.verbs.orbit import Keys

ROOT = Path(__file__).resolve().parents[1]
CASE = ROOT / "pipeline" / "cases" / "pendulum.toml"
WAYS = {"rigid": ["modes=1"], "1 %": ["damping_ratio=0.01"], "5 %": [], "10 %": ["damping_ratio=0.1"]}
"""How the bending is taken -> changes of the case."""


def motions(basis: ModalBasis) -> dict[str, dict[float, Orbit]]:
    """How the bending is taken -> rad/s -> motion."""
    found: dict[str, dict[float, Orbit]] = {}
    for name, changes in WAYS.items():
        driven, asked = assembled(CASE, changes, basis)
        found[name] = {e.Omega: orbit.run(e, asked.settle, asked.keep) for e in driven}
    return found


def assembled(case: Path, changes: list[str], basis: ModalBasis) -> tuple[list[equations.MotionEquations], Keys]:
    """The equations of a case of one body with changes, at each of its frequencies, and what it asks."""
    settings, _ = load_case(case, changes)
    built, asked = build(settings, {basis.name: basis}), settings.asked["orbit"]
    assert asked.Omega is not None
    return [equations.of(built.pressed(asked.normal_force), w) for w in asked.Omega], asked


def rows(found: Mapping[str, Mapping[float, Orbit]]) -> tuple[list[str], list[list[str]]]:
    """Head and rows: periods after which the motion comes back, and impacts in them, or a period."""

    def told(one: Orbit) -> str:
        p = one.repeats
        return f"{p}, {round(one.impacts * p)}" if p else f"-, {one.impacts:.3g} a period"

    head = ["rad/s", *(f"bending {name}" if "%" in name else name for name in found)]
    return head, [[f"{w:g}", *(told(way[w]) for way in found.values())] for w in next(iter(found.values()))]


def drawn(found: Mapping[str, Mapping[float, Orbit]], path: Path) -> Path:
    """Phase portraits as the case has them."""
    named = [(f"{w:g} rad/s", one) for w, one in found["5 %"].items()]
    return save(partial(portraits, named, title="Impact oscillator of section 4.2"), path)


SLIDING = ROOT / "pipeline" / "cases" / "pendulum-friction.toml"
RIGID, FLAT = "modes=2", "contacts.0.ground={velocity=0.001}"
PUSHING = "contacts.0.ground.pushes=true"
MODELS = {
    "rigid (two modes)": [RIGID, FLAT],
    "with bending, 1 %": [FLAT, "damping_ratio=0.01"],
    "with bending, 5 %": [FLAT],
    "with bending, 10 %": [FLAT, "damping_ratio=0.1"],
    "rigid, waviness, `pushes = false`": [RIGID],
    "with bending, 5 %, waviness, `pushes = false`": [],
    "rigid, waviness with its push": [RIGID, PUSHING],
}
"""Of the friction oscillator: how it is taken -> changes of the case."""

LIKE_THE_BOOK = ("rigid (two modes)", "with bending, 1 %", "rigid, waviness, `pushes = false`")
"""Drawn side by side, as Fig. 4.3-2 b) to d) are."""

KEPT, SAMPLES = 40, 512


def sliding(basis: ModalBasis) -> dict[str, Orbit]:
    """How it is taken -> motion."""
    found = {}
    for name, changes in MODELS.items():
        (e,), asked = assembled(SLIDING, changes, basis)
        found[name] = orbit.run(e, asked.settle, KEPT, SAMPLES)
    return found


def slips(found: Mapping[str, Orbit]) -> tuple[list[str], list[list[str]]]:
    """Head and rows: what the motions of the friction oscillator are."""
    head = ["model", "comes back after", f"slips in {KEPT} periods", "lift-offs a period", "x, peak to peak, mm"]
    table = []
    for name, one in found.items():
        back = counted(one.repeats, "period") if one.repeats else f"not within {KEPT // 2} periods"
        x = f"{1e3 * np.ptp(one.y[0]):.2f}"
        table.append([name, back, f"{one.count('slips')}", f"{one.count('opens') / KEPT:.2g}", x])
    return head, table


def drawn_sliding(found: Mapping[str, Orbit], path: Path) -> Path:
    """Phase portraits of the models of the book."""
    named = [(name.replace("`", ""), found[name]) for name in LIKE_THE_BOOK]
    draw = partial(portraits, named, title="Friction oscillator of section 4.3: the arm at the disc")
    return save(draw, path)


def against_balance() -> tuple[list[str], list[list[str]]]:
    """Head and rows: first harmonics of steady vibrations in time, and by harmonic balance with many harmonics."""
    table = []
    for name, system, frequency in systems():
        in_time = ms.integrate(system, frequency, unit="rad/s", settle=400, keep=1, steps=4096)
        one = 2 / in_time.samples * abs(np.fft.rfft(in_time.y[0])[1])
        balanced = ms.harmonic_response(system, [frequency], harmonics=25, samples=4096, unit="rad/s").amplitude[0]
        table.append([name, f"{frequency:g}", f"{balanced:.6g}", f"{one:.6g}", f"{abs(one / balanced - 1):.1e}"])
    return ["system", "rad/s", "harmonic balance, 25 harmonics", "in time, 4096 steps", "difference"], table


def systems() -> list[tuple[str, object, float]]:
    """Name, system, rad/s."""
    slider = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.2)])
    duffing = ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[ms.polynomial({3: 0.05})])
    stop = ms.structure(1.0, 1.0, 0.1, force={0: 0.3}, elements=[ms.stop(2.0, 0.2)])
    K = np.array([[2.0, -1.0], [-1.0, 2.0]])
    two = ms.structure(np.eye(2), K, 0.05 * K, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.1, at=1), ms.stop(4.0, 0.5)])
    rub = {"normal_stiffness": 2e6, "tangential_stiffness": 4e6, "includes": "surface", "friction": 0.2}
    rub |= {"points": [4, 2], "normal_force": 20.0}
    sides = [{"interface": side, **rub} for side in ("right", "left")]
    case = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe", "contacts": sides}
    vane = ms.assemble(case, vane=ms.sample())
    return [
        ("slider", slider, 1.0), ("hardening spring", duffing, 0.9), ("one-sided stop", stop, 0.8),
        ("two masses, slider and stop", two, 1.1), ("vane that rubs on both sides", vane, 2 * np.pi * 872),
    ]  # fmt: skip

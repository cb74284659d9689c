"""Motions in time, as a user calls for them, against SciPy's integrators on the same equations in one run.

    python benchmarks/time_domain.py            # minutes
    python benchmarks/time_domain.py --quick    # 20 periods, and 2 of a ring of 4 blades
    python benchmarks/time_domain.py --only impact batch

impact: the impact oscillator of Sextro, section 4.2, at 64.32 rad/s over 1,000 periods, and over 100 with methods that
would take minutes. SciPy integrates its one equation in scalar Python: LSODA by odeint, whose loop is compiled, and by
solve_ivp, whose loop is Python, and Radau, which solve_ivp alone has. ring: 24 vanes of three modes that rub on
their neighbours in three dimensions and lift off, with dampers in the contacts and without residual compliance, over
100 periods, Radau over 10; SciPy integrates the compiled equations with their exact Jacobian
(`tests/cvode.py`), LSODA by `solve_ivp` and by `odeint`, whose loop is compiled. batch: 1,000
starts of the impact oscillator over 120 periods by `integrate_many`, against a loop over `integrate`, of which some are
done; both with the same steps.

rub: a blade of 63,000 degrees of freedom on 60 coordinates (`geometry/pit-blade/rubbing.toml`, Craig-Bampton, made
where it is not there) rubs with 16 points of its tip on an oval casing for 50 revolutions (its case: tip-rub).

Every method is taken with its cheapest setting whose error is below the goal: the largest deviation of the read-outs in
the last period from a tight solution by LSODA, a share of the largest. Times are
CPU seconds of the process, the least of some rounds after one that compiles.
"""

from __future__ import annotations

import argparse
import math
import os
import platform
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import odeint, solve_ivp

import microslip as ms
from microslip.contact.friction import Coulomb
from microslip.contact.heights import Polynomial
from microslip.contact.law import value
from microslip.contact.normal import Rough
from microslip.contact.point import PointContact
from microslip.time_domain import equations, orbit

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

GOALS = (1e-3, 1e-5)
SAMPLES = 64
MASS, STIFFNESS, DAMPING, FOOT = 0.092, 99.085, 0.02046, 0.00047
STOP, DEPTH, STICKY = 0.3e6, 5.2e-6, 6.0
"""Of section 4.2: kg, N/m, N s/m, m; c_N0 in N/m, R_Z in m, beta c_N0 in N s/m."""

PARTS = ("impact", "batch", "ring", "rub")

Method = tuple[str, Iterable[float], Callable[[float], np.ndarray]]
"""Name, settings from the cheapest on, and what makes of one the read-outs of the last period."""


def spent(run: Callable[[], Any], rounds: int) -> tuple[Any, float]:
    """Result and least CPU seconds of some rounds."""
    times = []
    for _ in range(rounds):
        began = time.process_time()
        found = run()
        times.append(time.process_time() - began)
    return found, min(times)


def compared(exact: np.ndarray, methods: list[Method], rounds: int) -> None:
    """The table of one system."""
    print("| error below | method | setting | error | CPU s | CPU / microslip |\n|--:|---|--:|--:|--:|--:|")
    size = np.abs(exact).max()
    tried: dict[tuple[str, float], float] = {}
    for goal in GOALS:
        own = math.nan
        for name, settings, run in methods:
            for setting in settings:
                if (name, setting) not in tried:
                    found = run(setting)
                    tried[name, setting] = float(np.abs(found - exact).max() / size)
                if tried[name, setting] <= goal:
                    break
            else:
                print(f"| {goal:.0e} | {name} | | not reached | | |", flush=True)
                continue
            cpu = spent(lambda run=run, setting=setting: run(setting), rounds if name == "microslip" else 1)[1]
            own = cpu if name == "microslip" else own
            told = f"{setting:g} | {tried[name, setting]:.1e} | {cpu:.3f} | {cpu / own:.1f}"
            print(f"| {goal:.0e} | {name} | {told} |", flush=True)


def hammer() -> ms.Assembly:
    """The impact oscillator of section 4.2."""
    law = PointContact(
        Rough(value(STOP), value(DEPTH), Polynomial()), Coulomb(value(0.0)), value(0.0), None, value(STICKY / STOP)
    )
    element = ms.Element(law, 0, along="n")
    return ms.structure(MASS, STIFFNESS, DAMPING, force={0: STIFFNESS * FOOT}, elements=[element], output=0)


def impact(periods: int, rounds: int, slow: bool) -> None:
    """slow: with Radau too."""
    system, Omega = hammer(), 64.32
    T = 2 * math.pi / Omega
    times = np.append(0.0, T * (periods - 1) + T / SAMPLES * np.arange(1, SAMPLES + 1))

    def rate(t: float, z: Any) -> tuple[float, float]:
        u, v = z
        f, x = 0.0, u / DEPTH
        if x > 0:
            c = min(x, 1.0)
            f = STOP * DEPTH * (c**3 * (1 - 0.5 * c) + max(x - 1, 0.0)) + STICKY * c * c * (3 - 2 * c) * v
        push = STIFFNESS * (FOOT * math.cos(Omega * t) - u) - DAMPING * v
        return v, (push - max(f, 0.0)) / MASS

    def lsoda(tolerance: float, **more: float) -> np.ndarray:
        told = {"rtol": tolerance, "atol": 1e-5 * tolerance, "hmax": T / 8, "mxstep": 10_000_000} | more
        return odeint(rate, [0.0, 0.0], times, tfirst=True, **told)[1:, 0][None]

    def by_ivp(method: str) -> Callable[[float], np.ndarray]:
        def run(tolerance: float) -> np.ndarray:
            told = {"rtol": tolerance, "atol": 1e-5 * tolerance, "max_step": T / 8}
            return solve_ivp(rate, (0, times[-1]), [0, 0], method, times[1:], **told).y[:1]

        return run

    def own(steps: float) -> np.ndarray:
        found = ms.integrate(system, Omega, unit="rad/s", settle=periods - 1, keep=1, samples=SAMPLES,
                             steps=int(steps), start="rest")  # fmt: skip
        return found.y

    print(f"\n## Impact oscillator, {periods} periods\n")
    exact = lsoda(1e-12, atol=1e-17, hmax=T / 100)
    tolerances = 10.0 ** -np.arange(3, 11, 0.5)
    methods: list[Method] = [
        ("microslip", SAMPLES * np.array([2.0, 3, 4, 5, 6, 7, 8, 10, 12, 16, 32, 64]), own),
        ("LSODA, odeint", tolerances, lsoda),
        ("LSODA, solve_ivp", tolerances[0 if slow else 3 :], by_ivp("LSODA")),
    ]
    compared(exact, methods + [("Radau", tolerances[:10], by_ivp("Radau"))] * slow, rounds)


def ring(blades: int, periods: int, rounds: int) -> None:
    w = {"normal_stiffness": 2e6, "tangential_stiffness": 4e6, "includes": "surface", "friction": 0.2,
         "points": [2, 1], "normal_force": 20.0, "law": {"kind": "smooth", "damping": 2e-5}}  # fmt: skip
    case = {"body": "vane", "excitation": "magnet", "amplitude": 40.0, "monitor": "probe", "modes": 3, "harmonics": 1,
            "contacts": [{"interface": "right", "against": "left", "against_sector": 1, **w}],
            "ring": {"blades": blades, "engine_order": blades // 4, "model": "full"}}  # fmt: skip
    built = ms.assemble(case, vane=ms.sample()).assembly
    system = replace(built, components=tuple(replace(c, residual_share=None) for c in built.components))
    e = equations.of(system, 2 * np.pi * 600.0)
    import cvode

    rates = cvode.Rates(e)
    begin = rates.start(*orbit.begun(e, "rest"))
    each = SAMPLES // 4
    times = np.append(0.0, (periods - 1 + np.arange(1, each + 1) / each) / 600.0)

    def read(states: np.ndarray) -> np.ndarray:
        return e.output @ states[: len(e.omega2)] + e.output_given @ e.oscillators(times[1:]).T

    def told(tolerance: float) -> dict[str, Any]:
        return {"rtol": tolerance, "atol": cvode.SMALL * tolerance * rates.size}

    def own(steps: float) -> np.ndarray:
        how = {"settle": periods - 1, "keep": 1, "samples": each, "steps": int(steps)}
        return ms.integrate(system, 600.0, start="rest", **how).y

    def compiled(tolerance: float) -> np.ndarray:
        how = {"Dfun": rates.slope, "tfirst": True, "mxstep": 10_000_000}
        return read(odeint(rates.rate, begin, times, **how, **told(tolerance))[1:].T)

    def scipy(method: str) -> Callable[[float], np.ndarray]:
        def run(tolerance: float) -> np.ndarray:
            span = 0, times[-1]
            return read(solve_ivp(rates.rate, span, begin, method, times[1:], jac=rates.slope, **told(tolerance)).y)

        return run

    exact = compiled(1e-10)
    print(f"\n## Ring of {blades} blades, {periods} periods, {len(begin)} unknowns\n")
    tolerances, steps = 10.0 ** -np.arange(3, 9, 0.5), SAMPLES * np.array([0.5, 0.75, 1.0, 1.5, 2, 2.5, 3, 4, 6, 8])
    peers: list[Method] = [("LSODA, solve_ivp", tolerances, scipy("LSODA")), ("LSODA, odeint", tolerances, compiled)]
    if periods <= 10:
        peers.append(("Radau", tolerances[:6], scipy("Radau")))
    compared(exact, [("microslip", steps, own), *peers], rounds)


def rub(revolutions: int, rounds: int) -> None:
    where, body = ROOT, Path("build/pit-blade-rubbing/basis.h5")
    subprocess.run(
        [sys.executable, "-m", "microslip", "modes", "geometry/pit-blade/rubbing.toml", "-q"], cwd=where, check=True
    )
    case, blade = where / "pipeline" / "cases" / "tip-rub.toml", ms.read_basis(where / body)
    rig = ms.assemble(case, **{"pit-blade-rubbing": blade})
    Omega, steps = tomllib.loads(case.read_text())["orbit"]["Omega"], tomllib.loads(case.read_text())["orbit"]["steps"]

    def own() -> Any:
        how = {"settle": revolutions - 2, "keep": 2, "samples": SAMPLES, "steps": steps, "start": "rest"}
        return ms.integrate(rig, Omega, unit="rad/s", **how)

    began = time.process_time()
    own()
    first = time.process_time() - began
    found, cpu = spent(own, rounds)
    (contact,) = rig.assembly.contacts
    print(f"\n## Blade that rubs on a casing, {revolutions} revolutions\n")
    print(
        "| dof | coordinates | points | steps | rubs in the last two | error | first CPU s | CPU s |\n"
        + "|--:" * 8
        + "|"
    )
    told = [3 * blade.mesh.n_points, len(found.omega2), len(contact.patch.points), found.steps, found.count("closes")]
    print("| " + " | ".join([*map(str, told), f"{found.error:.1e}", f"{first:.1f}", f"{cpu:.1f}"]) + " |", flush=True)


def batch(starts: int, alone: int, rounds: int) -> None:
    system, generator = hammer(), np.random.default_rng(0)
    x, v = generator.uniform(-1.0, 0.0, (starts, 1)) * 2e-3, generator.uniform(-1.0, 1.0, (starts, 1)) * 0.05
    how = {"unit": "rad/s", "settle": 100, "keep": 20, "steps": 512}

    def many() -> Any:
        return ms.integrate_many(system, 64.32, x, v, **how)

    def one() -> Any:
        return ms.integrate(system, 64.32, samples=64, start="rest", **how)

    many(), one()
    found, together = spent(many, rounds)
    each = spent(lambda: [one() for _ in range(alone)], rounds)[1] / alone
    print(f"\n## {starts} starts, 120 periods\n\n{found}\n")
    print(f"| | CPU ms a start |\n|---|--:|\n| integrate_many | {1e3 * together / starts:.2f} |")
    print(f"| loop over integrate ({alone} of them) | {1e3 * each:.2f} |\n\n{each * starts / together:.1f} times")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS)
    asked = parser.parse_args()
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    print(f"{platform.platform()}, {os.cpu_count()} cores, load {load}; Python {platform.python_version()}")
    if "impact" in asked.only:
        for periods, rounds, slow in [(20, 1, True)] if asked.quick else [(1000, 5, False), (100, 5, True)]:
            impact(periods, rounds, slow)
    if "batch" in asked.only:
        batch(*((20, 2, 1) if asked.quick else (1000, 20, 3)))
    if "ring" in asked.only:
        for periods in (2,) if asked.quick else (10, 100):
            ring(4 if asked.quick else 24, periods, 2)
    if "rub" in asked.only and not asked.quick:  # its body takes minutes to make
        rub(50, 1)


if __name__ == "__main__":
    main()

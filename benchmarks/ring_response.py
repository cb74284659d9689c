"""Friction response of a tuned ring of blades: the book's mode, one and three harmonics, growth over the blades.

    python benchmarks/ring_response.py            # 24 blades by one sector; then 12, 24, 48, 100 blades as whole rings
    python benchmarks/ring_response.py --sector   # the sector alone
    python benchmarks/ring_response.py --quick    # the sector alone, 12 x 2 points, 16 frequencies, one round

The blade of section 5.3 with 20 eigenmodes (a coarse mesh: the sweep does not know of it), 24 in a circle, engine order
6, rough contacts of 72 x 5 points between neighbours, 30 N, 1 N at every blade, 150 frequencies about the first
resonance, where the contacts slide at half of them. Everything is compiled before; times are the least of some rounds,
wall and CPU of the process. A whole ring is given a quarter of the points a contact and an eighth of the frequencies,
and compared with the sector under the same settings.
"""

from __future__ import annotations

import argparse
import os
import platform
import time
from pathlib import Path
from typing import Any

import jax
import numpy as np

import microslip as ms
from microslip.data import ModalBasis
from microslip.harmonic_balance.problem import AtFrequency, Group
from microslip.stages.job import open_job
from microslip.stages.modal import modes_stage

ROOT = Path(__file__).resolve().parents[1]
BLADES, ORDER, FORCE, POINTS, COUNT = 24, 6, 30.0, (72, 5), 150


def blade() -> ModalBasis:
    """The test blade with 20 modes, on a coarse mesh."""
    coarse = ["mesh.size=12", "output.gauss=false", "output.nodal_stress=false", "output.shapes=false"]
    return ms.read_basis(
        modes_stage(open_job(ROOT / "geometry" / "blade", coarse, ROOT / "build" / "bench" / "ring"))[0]
    )


def case(low: float, high: float, count: int, blades: int, points: tuple[int, int], **more: object) -> dict:
    """A ring of blades that meet their neighbours, by the keys of a case.toml, and the frequencies."""
    contact = {
        "interface": "right", "against": "left", "against_sector": 1, "law": "rough", "roughness": 7.5e-6,
        "normal_stiffness": 840e6, "tangential_stiffness": 80e6, "friction": 0.2, "points": list(points),
        "includes": "bulk+surface",
    }  # fmt: skip
    keys = {
        "body": "blade", "excitation": "magnet", "monitor": "accelerometer", "contacts": [contact], "samples": 64,
        "ring": {"blades": blades, "engine_order": ORDER * blades // BLADES}, **more,
    }  # fmt: skip
    return {"case": keys, "sweep": (low, high, count)}


def run(settings: dict, basis: ModalBasis, rounds: int) -> tuple[float, float, int, int, float, float]:
    """Least wall and CPU seconds of a response after one that compiles; Newton steps, failures, Hz and m at the peak.

    The assembly is made once; the time is that of `ms.harmonic_response`.
    """
    system, (low, high, count) = ms.assemble(settings["case"], blade=basis, normal_force=FORCE), settings["sweep"]
    frequency, spent, used = np.linspace(low, high, count), [], []
    for _ in range(rounds + 1):
        began, before = time.perf_counter(), time.process_time()
        found = ms.harmonic_response(system, frequency)
        spent.append(time.perf_counter() - began)
        used.append(time.process_time() - before)
    p = found.problem(float(frequency[0]))
    motion = [abs(q.x.reshape(p.coefficients, -1)[1:3]).max() * p.length for q in found.points]
    top = int(np.argmax(motion))
    steps, failed = sum(q.iterations for q in found.points), sum(not q.converged for q in found.points)
    return min(spent[1:]), min(used[1:]), steps, failed, float(frequency[top]), float(motion[top])


def sector_rows(
    basis: ModalBasis, low: float, high: float, rounds: int, count: int, points: tuple[int, int]
) -> None:  # fmt: skip
    """The table of the ring by one sector."""
    print("| mode | wall s | CPU s | CPU / book | Newton steps a point | not converged | peak Hz | contact µm |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|")
    book, ways = 0.0, (("book", {"mode": "book"}), ("AFT, H = 1", {"harmonics": 1}), ("AFT, H = 3", {"harmonics": 3}))
    for name, more in ways:
        wall, cpu, steps, failed, top, size = run(case(low, high, count, BLADES, points, **more), basis, rounds)
        book = book or cpu
        told = f"| {name} | {wall:.2f} | {cpu:.2f} | {cpu / book:.1f} | {steps / count:.1f} | {failed} |"
        print(f"{told} {top:.1f} | {1e6 * size:.2f} |", flush=True)
    print("\n| mode | forces alone | derivatives | linear systems | the rest |\n|---|--:|--:|--:|--:|")
    for name, more in ways:
        spent = parts(case(low, high, count, BLADES, points, **more), basis)
        print(f"| {name} | {' | '.join(f'{100 * part:.0f} %' for part in spent)} |", flush=True)


def parts(settings: dict, basis: ModalBasis) -> list[float]:
    """Shares of the wall time of a response: forces alone, their derivatives, linear systems, the rest."""
    system, frequency = ms.assemble(settings["case"], blade=basis, normal_force=FORCE), np.linspace(*settings["sweep"])
    places = {"near": Group, "slopes": AtFrequency, "jacobian": AtFrequency}
    spent, kept = dict.fromkeys(places, 0.0), {name: place.__dict__[name] for name, place in places.items()}

    def timed(name: str) -> Any:
        def call(*given: Any) -> Any:
            began = time.perf_counter()
            try:
                return kept[name](*given)
            finally:
                spent[name] += time.perf_counter() - began

        return call

    try:
        for name, place in places.items():
            setattr(place, name, timed(name))
        began = time.perf_counter()
        ms.harmonic_response(system, frequency)
        whole = time.perf_counter() - began
    finally:
        for name, was in kept.items():
            setattr(places[name], name, was)
    shares = [value / whole for value in spent.values()]
    return [*shares, 1.0 - sum(shares)]


def growth_rows(basis: ModalBasis, low: float, high: float, rounds: int) -> None:
    """The table of whole rings against their sectors."""
    print("| blades | mode | sector CPU s | ring CPU s | ring / sector | over blades |")
    print("|--:|---|--:|--:|--:|--:|")
    for name, more in (("book", {"mode": "book"}), ("AFT, H = 1", {"harmonics": 1})):
        for blades in (12, 24, 48, 100):
            found = []
            for model in ("sector", "full"):
                settings = case(low, high, COUNT // 8, blades, (18, 5), **more)
                settings["case"]["ring"]["model"] = model
                found.append(run(settings, basis, rounds)[1])
            ratio = found[1] / found[0]
            print(f"| {blades} | {name} | {found[0]:.3f} | {found[1]:.2f} | {ratio:.1f} | {ratio / blades:.2f} |",
                  flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the sector alone, small, one round")
    only = parser.add_mutually_exclusive_group()
    only.add_argument("--sector", action="store_true", help="the sector alone")
    only.add_argument("--growth", action="store_true", help="whole rings alone, one round")
    parser.add_argument("--low", type=float, default=95.0)
    parser.add_argument("--high", type=float, default=125.0)
    asked = parser.parse_args()
    basis, rounds = blade(), 1 if asked.quick or asked.growth else 3
    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    print(f"{platform.platform()}, {os.cpu_count()} cores, load {load}; Python {platform.python_version()}, "
          f"numpy {np.__version__}, jax {jax.__version__}")  # fmt: skip
    if not asked.growth:
        sector_rows(basis, asked.low, asked.high, rounds, *((16, (12, 2)) if asked.quick else (COUNT, POINTS)))
    if not (asked.quick or asked.sector):
        growth_rows(basis, asked.low, asked.high, rounds)


if __name__ == "__main__":
    main()

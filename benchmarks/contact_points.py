"""Force and full derivative of three-dimensional contact points, against pyHarm and a plain numpy loop, in one run.

    python benchmarks/contact_points.py          # 360 points, 3 harmonics, 64 and 128 samples; growth to 1e5 points
    python benchmarks/contact_points.py --quick  # 40 points, no growth: seconds

pyHarm (an environment of its own, `sh tests/peers/setup.sh pyharm`) evaluates its elements one after the other. The
numpy loop goes over the samples of all points at once, with the derivative written out by hand. All three march a
penalty spring with a Coulomb cone that stays closed (pyHarm's force jumps where a contact opens). The numpy loop takes
the same straight ways and must agree; pyHarm returns radially at the end of each step, of first order in the samples,
and is that much apart.
microslip marches two cycles if not told otherwise, pyHarm always three: microslip is timed with both.
Times are the least of some rounds; wall and CPU seconds, of all threads a program takes.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from microslip.contact import EXAMPLES
from microslip.contact.friction import Coulomb
from microslip.contact.harmonics import force_harmonics
from microslip.contact.law import Law
from microslip.contact.normal import Penalty
from microslip.contact.point import PointContact, mean_inverse, mean_slopes
from microslip.series import fourier

ROOT = Path(__file__).resolve().parents[1]
PYHARM = ROOT / "build" / "peers" / "pyharm" / "bin" / "python"
NORMAL, TANGENTIAL, MU, CYCLES = 2.4e8, 0.9e8, 0.3, 3


def motion(points: int, harmonics: int, closed: bool) -> np.ndarray:
    """(n, 3, 2 H + 1) random harmonics in m that make most points slide; ``closed`` ones never lift off."""
    rng = np.random.default_rng(1)
    u = rng.normal(size=(points, 3, 2 * harmonics + 1)) * 3e-6
    u[:, 0] *= 0.2 if closed else 1.0
    u[:, 0, 0] = 1e-5
    if closed:
        lowest = u[:, 0, 0] - np.sqrt(u[:, 0, 1::2] ** 2 + u[:, 0, 2::2] ** 2).sum(axis=1)
        u[:, 0, 0] += np.maximum(0.0, 1e-6 - lowest)
    return u


def least(run: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Least wall seconds of some rounds, and least CPU seconds."""
    times = []
    for _ in range(rounds):
        wall, cpu = time.perf_counter(), time.process_time()
        run()
        times.append((time.perf_counter() - wall, time.process_time() - cpu))
    return tuple(np.min(times, axis=0))


def ours(law: Law, u: np.ndarray, samples: int, count: int, rounds: int) -> dict:
    x = jnp.asarray(u)

    def run():
        return jax.block_until_ready(force_harmonics(law, x, 0.01, samples=samples, count=count))

    started = time.perf_counter()
    force, slope = run()
    compiled = time.perf_counter() - started
    return {"force": force, "slope": slope, "time": least(run, rounds), "compiled": compiled, "cycles": count}


def numpy_loop(u: np.ndarray, samples: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Penalty spring, Coulomb cone, straight ways (`point.dragged`); tangents of all harmonics carried by hand."""
    n, _, size = u.shape
    values, transform = (np.array(x) for x in fourier(size // 2, samples))
    path = np.einsum("sh,nkh->skn", values, u)
    force, slope = np.zeros((samples, 3, n)), np.zeros((samples, 3, 3, size, n))
    tangential, before, carried = np.zeros((2, n)), np.zeros((2, n)), np.zeros((2, 3, size, n))
    limit, of_limit, row_before = np.zeros(n), np.zeros((3, size, n)), np.zeros(size)
    for step in range(count * samples):
        i = step % samples
        row, closed = values[i], path[i, 0] > 0
        normal = NORMAL * np.maximum(path[i, 0], 0.0)
        pressed, moves = np.zeros((3, size, n)), np.zeros((2, 3, size, n))
        pressed[0] = NORMAL * closed * row[:, None]
        for d in (0, 1):
            moves[d, d + 1] = (TANGENTIAL * (row - row_before))[:, None] * closed
        carried *= closed
        way = np.where(closed, TANGENTIAL * (path[i, 1:] - before), 0.0)
        given = (tangential * closed, way, limit * closed, MU * normal)
        tangential, slides, (by_force, by_way, by_before, by_held) = straight(*given)
        turned = np.einsum("dn,dkhn->khn", by_force, carried) + np.einsum("dn,dkhn->khn", by_way, moves)
        turned += by_before * of_limit * closed + by_held * MU * pressed
        slid = _over(tangential, MU * normal)[:, None, None] * MU * pressed
        slid += np.stack([-tangential[1], tangential[0]])[:, None, None] * turned
        carried = np.where(slides, slid, carried + moves)
        before, row_before, limit, of_limit = path[i, 1:], row, MU * normal, MU * pressed
        force[i] = np.vstack([normal, tangential])
        slope[i, 0], slope[i, 1:] = pressed, carried
    return np.einsum("hs,skn->nkh", transform, force), np.einsum("gs,skjhn->nkgjh", transform, slope)


def _over(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.where(b > 0, a / np.where(b > 0, b, 1.0), 0.0)


def straight(F: np.ndarray, d: np.ndarray, R0: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple]:
    """Force after a straight way d, whether it slides, and the derivatives of its angle then."""
    way, grows = np.hypot(*d), R - R0
    room = np.maximum(R0**2 - (F**2).sum(axis=0), 0.0)
    a, b = way**2 - grows**2, (F * d).sum(axis=0) - R0 * grows
    root = np.sqrt(np.maximum(b**2 + a * room, 0.0))
    s = np.clip(np.where(b > 0, _over(room, b + root), _over(root - b, a)), 0.0, 1.0)
    r, P, e = R0 + s * grows, F + s * d, _over(d, way)
    x, y = (e * P).sum(axis=0), e[0] * P[1] - e[1] * P[0]
    inverse = np.asarray(mean_inverse(r, R))
    by_first, by_last = (np.asarray(x) for x in mean_slopes(r, R, inverse))
    lag = (1 - s) * way * inverse
    c, first = np.where(x >= 0, r + x, y), np.where(x >= 0, y, r - x)
    last = first * np.exp(-lag)
    size = c**2 + last**2
    cos, sin = _over(c**2 - last**2, size), _over(2 * c * last, size)
    trial = F + d
    tried = np.hypot(*trial)
    slides = tried > R
    along = np.where(size > 0, np.stack([e[0] * cos - e[1] * sin, e[1] * cos + e[0] * sin]), _over(trial, tried))
    angles, T = _over(np.exp(-lag) * (c**2 + first**2), size), _over(np.stack([-P[1], P[0]]), r**2)
    at_first, at_last = (-sin * (1 - s) * way * by for by in (by_first, by_last))
    excess = _over(angles * (T * d).sum(axis=0) + sin * way * inverse + at_first * grows, root)
    by_force = angles * T - excess * P
    by_way = (1 - angles) * _over(np.stack([-e[1], e[0]]), way) + s * by_force - sin * (1 - s) * inverse * e
    parts = (by_force, by_way, (1 - s) * (at_first + excess * r), at_first * s + at_last + excess * r * s)
    return np.where(slides, R * along, trial), slides, parts


def pyharm(u: np.ndarray, samples: int, rounds: int, work: Path) -> dict | None:
    if not PYHARM.is_file():
        return None
    np.savez(
        work / "points.npz", u=u, samples=samples, normal=NORMAL, tangential=TANGENTIAL, mu=MU, rounds=rounds,
        preload=NORMAL * 1e-5,
    )  # fmt: skip
    worker = ROOT / "benchmarks" / "pyharm_contacts.py"
    alone = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    subprocess.run([PYHARM, worker, work / "points.npz", work / "out.npz"], check=True, env=alone, cwd=work)
    out = np.load(work / "out.npz")
    time_ = (out["wall"].min(), out["cpu"].min())
    return {**out, "time": time_, "compiled": float(out["compiled"]), "cycles": int(out["cycles"])}


def apart(a: dict, b: dict) -> float:
    """Largest difference of force and derivative, relative to the largest entry."""
    return max(float(np.abs(np.array(a[k]) - b[k]).max() / np.abs(np.array(b[k])).max()) for k in ("force", "slope"))


def compared(points: int, samples: int, rounds: int, work: Path) -> list[str]:
    u = motion(points, 3, closed=True)
    value = jnp.asarray
    law = PointContact(Penalty(value(NORMAL)), Coulomb(value(MU)), value(TANGENTIAL))
    mine = ours(law, u, samples, CYCLES, rounds)
    force, slope = numpy_loop(u, samples, CYCLES)
    loop = {"force": force, "slope": slope, "time": least(lambda: numpy_loop(u, samples, CYCLES), max(2, rounds // 3)),
            "compiled": 0.0, "cycles": CYCLES}  # fmt: skip
    peer = pyharm(u, samples, max(2, rounds // 3), work)
    usual = ours(law, u, samples, 2, rounds)
    rows = {"microslip": mine, "microslip, two cycles": usual, "numpy loop": loop} | ({"pyHarm": peer} if peer else {})
    lines = []
    for name, r in rows.items():
        wall, cpu = (1e6 * t / points for t in r["time"])
        factor = [(a / b, a / c) for a, b, c in zip(r["time"], mine["time"], usual["time"], strict=True)]
        lines.append(
            f"| {samples} | {name} | {wall:.1f} | {cpu:.1f} | {cpu / r['cycles']:.1f} |"
            f" {factor[0][0]:.1f}, {factor[0][1]:.1f} | {factor[1][0]:.1f}, {factor[1][1]:.1f} |"
            f" {r['compiled']:.1f} | {apart(r, mine):.0e} |"
        )
    return lines


def laws(points: int, samples: int, rounds: int) -> list[str]:
    """Every law of the contract tests, opening and closing, two cycles."""
    lines = []
    for name, example in EXAMPLES.items():
        u = motion(points, 3, closed=False) * (example.tangential / 8e-6)
        r = ours(example.law, u, samples, 2, rounds)
        wall, cpu = (1e6 * t / points for t in r["time"])
        lines.append(f"| {name} | {wall:.1f} | {cpu:.1f} | {cpu / 2:.1f} | {r['compiled']:.1f} |")
    return lines


def growth(sizes: list[int]) -> list[str]:
    law, lines = EXAMPLES["rough point"].law, []
    for n in sizes:
        u = motion(n, 3, closed=False)
        r = ours(law, u, 64, 2, 2)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        lines.append(f"| {n} | {r['time'][0]:.3f} | {r['time'][1]:.3f} | {1e6 * r['time'][1] / n:.1f} | {peak:.2f} |")
    return lines


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=360)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--quick", action="store_true", help="40 points, 64 samples, no growth")
    arguments = parser.parse_args(argv)
    quick = arguments.quick
    points, rounds = (40, 2) if quick else (arguments.points, arguments.rounds)
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, jax {jax.__version__}, "
          f"numpy {np.__version__}, load {os.getloadavg()[0]:.1f}\n")  # fmt: skip
    heads = [
        "samples", "program", "us / point", "CPU us / point", "CPU us / point and cycle",
        "wall / microslip (3, 2 cycles)", "CPU / microslip (3, 2 cycles)", "first call, s", "apart",
    ]  # fmt: skip
    print(f"| {' | '.join(heads)} |\n|--:|---|" + "--:|" * (len(heads) - 2))
    with tempfile.TemporaryDirectory() as folder:
        for samples in (64,) if quick else (64, 128):
            print("\n".join(compared(points, samples, rounds, Path(folder))), flush=True)
    if not PYHARM.is_file():
        print("\npyHarm is not installed: sh tests/peers/setup.sh pyharm")
    if quick:
        return
    print("\n| law | us / point | CPU us / point | CPU us / point and cycle | first call, s |\n|---|--:|--:|--:|--:|")
    print("\n".join(laws(points, 64, rounds)), flush=True)
    print("\n| points | wall s | CPU s | CPU us / point | peak GB |\n|--:|--:|--:|--:|--:|")
    print("\n".join(growth([100, 1000, 10_000, 100_000])))


if __name__ == "__main__":
    sys.exit(main())

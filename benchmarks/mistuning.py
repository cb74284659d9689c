"""A mistuned ring with friction, its peak found: growth with the blades, and peers beside it.

    python benchmarks/mistuning.py               # 12 to 96 blades, and all peers: a quarter of an hour
    python benchmarks/mistuning.py --quick       # 6 and 12
    python benchmarks/mistuning.py --scaling     # 12 to 48 blades alone, six samples each
    python benchmarks/mistuning.py --rare 40     # the 99.9 % quantile by chosen samples, so often: a quarter of an hour
    python benchmarks/mistuning.py --batch 256   # so many rings of 24 vanes with Jenkins elements together, some alone

CPU seconds of one thread, compiled programs warm. The ring: sample vanes (6 modes, H = 3, 64 samples, one point a
gap), a wave of 30 degrees from blade to blade whatever their number, blade frequencies scattered by 1 %, 24 frequencies
and what the search for the peak adds, through `mistuning.samples`, which `ms.mistune` calls for every sample. Peers
solve the same balance on the 24 frequencies alone, Newton's method from the neighbouring point:

dense    the same compiled contact forces, the Jacobian of all coordinates as one dense matrix, LU
by hand  forces of one blade's contact after the other, sample after sample in plain Python, with derivatives by
         differences, the same search and the dense Jacobian
pyHarm   (an environment of its own, `sh tests/peers/setup.sh pyharm`) the ring with Jenkins elements in the gaps,
         written anew as one body whose first coordinates are the motions of the sliders: as few unknowns as can be
ccx      CalculiX, the whole annulus of vanes without contact in finite elements, linear: eigenmodes, then the steady
         state at the 24 frequencies
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields, replace
from functools import lru_cache, partial
from multiprocessing import get_context
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import scipy.linalg

import microslip as ms
from microslip.harmonic_balance.blocks import DenseMatrix
from microslip.harmonic_balance.problem import AtFrequency, Problem
from microslip.mistuning import rare
from microslip.mistuning.ensemble import BLOCK, FIRST, several
from microslip.mistuning.linear import Beside, beside
from microslip.mistuning.peaks import Highest, highest, told_by
from microslip.mistuning.ring import Tuned
from microslip.mistuning.samples import Asked, SlidingRing, amplitudes, sample
from microslip.mistuning.scatter import Scatter
from microslip.system.assembly import Assembly

ROOT = Path(__file__).resolve().parents[1]
PYHARM = ROOT / "build" / "peers" / "pyharm" / "bin" / "python"

RUB = {"interface": "right", "against": "left", "against_sector": 1, "law": "smooth", "normal_force": 20.0,
       "normal_stiffness": 2e5, "tangential_stiffness": 4e5, "friction": 0.2, "points": [1, 1]}  # fmt: skip
FREQUENCY = np.linspace(280.0, 292.0, 24)


def asked(blades: int, stuck: bool = False, **contact: object) -> Asked:
    """A wave of 30 degrees from blade to blade."""
    case = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe", "modes": 6,
            "ring": {"blades": blades, "engine_order": max(blades // 12, 1)},
            "contacts": [{**RUB, **contact}]}  # fmt: skip
    tuned = Tuned(ms.assemble(case, vane=ms.sample()).assembly, {})
    return Asked(tuned, (Scatter("frequency", 0.01),), FREQUENCY, 1, {"harmonics": 3, "samples": 64}, stuck)


@lru_cache
def waves(W: int, samples: int) -> np.ndarray:
    """(W, samples) 1, cos, sin, cos 2, ... over a cycle."""
    t, h = 2 * np.pi * np.arange(samples) / samples, np.arange(1, W // 2 + 1)[:, None]
    return np.vstack([np.ones((1, samples)), np.stack([np.cos(h * t), np.sin(h * t)], axis=1).reshape(W - 1, samples)])


def marched(place: np.ndarray, k: tuple[float, ...], mu: float = RUB["friction"]) -> np.ndarray:
    """(3, W) harmonics of the force of a point, two cycles."""
    T = waves(place.shape[1], 64)
    normal, first, second = (place @ T).tolist()
    out = np.zeros((3, T.shape[1]))
    a = b = 0.0
    for cycle in range(2):
        for i, un in enumerate(normal):
            N = max(k[0] * un, 0.0)
            a += k[1] * (first[i] - (first[i - 1] if cycle or i else 0.0))
            b += k[2] * (second[i] - (second[i - 1] if cycle or i else 0.0))
            size = (a * a + b * b) ** 0.5
            if size > mu * N:
                a, b = a * mu * N / size, b * mu * N / size
            if cycle:
                out[0, i], out[1, i], out[2, i] = N, a, b
    weights = np.full(len(T), 2.0)
    weights[0] = 1.0
    return out @ (T.T * weights) / T.shape[1]


class Plain(AtFrequency):
    """The balance with one dense matrix in every step."""

    def jacobian(self, slopes):
        return DenseMatrix(self._of_sides(slopes).dense())


class PlainProblem(Problem):
    """Of which every frequency is a `Plain` one."""

    def at(self, Omega):
        return Plain(**own(super().at(Omega)))


def own(what) -> dict:
    """The fields of a frozen object as they are."""
    return {f.name: getattr(what, f.name) for f in fields(what)}


@dataclass(frozen=True)
class ByHand:
    """The forces of one contact in plain Python, for `Asked.models`: a linear spring that opens, Coulomb friction by a
    return map, two cycles, derivatives by differences."""

    G: np.ndarray
    k: tuple[float, ...]

    def force(self, u, period):
        return np.array([self.G.T @ marched(self.G @ one, self.k) for one in u])

    def forces(self, u, period):
        slopes = []
        for one in u:
            place = self.G @ one
            f, slope = marched(place, self.k), np.zeros((*place.shape, *place.shape))
            for at in np.ndindex(*place.shape):
                moved = place.copy()
                moved[at] += 1e-10
                slope[(..., *at)] = (marched(moved, self.k) - f) / 1e-10
            slopes.append(np.einsum("ak,awbz,bl->kwlz", self.G, slope, self.G))
        return self.force(u, period), np.array(slopes)

    def near(self, u, period, known):
        return self.force(u, period), None

    def rate(self, u, period):
        return None

    @staticmethod
    def of(ring) -> dict[int, ByHand]:
        """Contact -> its forces."""
        k = (np.diag(c.stiffness)[:3].tolist() for c in ring.contacts)
        return {i: ByHand(c.patch.kinematics[0], own) for i, (c, own) in enumerate(zip(ring.contacts, k, strict=True))}


def peaked(what: Asked, number: int, of: Asked, kind=Problem) -> Highest:
    """A sample with its peak, as `mistuning.samples` searches for it, by any kind of balance, from the tuned ring's
    solutions that another one has found."""
    problem = kind(**own(what.problem(what.tuned.mistuned(what.deviations(number)))))
    ring = SlidingRing(problem, of.tuned_points)
    return highest(ring, FREQUENCY, follow=ring.follow, at_once=ring.at_once, tells=ring.tells)


def textbook(what: Asked, number: int) -> tuple[int, float]:
    """Points with a solution, and the highest amplitude on the grid, by dense Newton steps with halving, each point
    from its neighbour, every derivative new."""
    problem = PlainProblem(**own(what.problem(what.tuned.mistuned(what.deviations(number)))))
    x, solved, top = None, 0, 0.0
    for f in FREQUENCY:
        at = problem.at(2 * np.pi * f)
        x = at.reference if x is None else x
        for _ in range(60):
            force, slopes = at.forces(x)
            R = at.residual_of(x, force)
            if np.abs(R).max() <= 1e-8 * np.abs(x).max():
                solved += 1
                top = max(top, float(np.abs(amplitudes(at, x)).max()))
                break
            step, share = at.jacobian(slopes).solve(-R), 1.0
            while share > 0.02 and not np.linalg.norm(at.residual(x + share * step)) < np.linalg.norm(R):
                share *= 0.5
            x = x + share * step
    return solved, top


def written_anew(ring: Assembly) -> tuple[dict[str, object], np.ndarray]:
    """A ring of Jenkins elements for pyHarm, whose elements connect single coordinates: what the sliders feel, what the
    cosine and the sine of the load act on, and the rest; and (w, m) its read-outs."""
    part, k, t1 = ring.joined(1), ring.stiffness.copy(), np.arange(len(ring.contacts)) * 6 + 1
    slider = k[1, 1]
    k[t1, t1] = 0.0
    K = part.K + part.rows.T @ k @ part.rows
    W = np.vstack([part.rows[t1], part.load.real, -part.load.imag])
    T = np.linalg.inv(np.vstack([W, scipy.linalg.null_space(W).T]))
    law = ring.contacts[0].patch.law
    job = {"M": T.T @ part.M @ T, "C": T.T @ part.C @ T, "K": T.T @ K @ T, "contacts": len(t1), "stiffness": slider,
           "limit": float(law.held)}  # fmt: skip
    return job, part.output @ T


@dataclass(frozen=True)
class ByPyHarm:
    """Attributes: cpu: s, of the 24 frequencies and of the finer ones about the highest. points, steps: of both
    together. grid, top: m, the highest of the 24, and of all as a parabola of 1/y^2 tells. off: by how much ours at the
    highest point differs."""

    cpu: tuple[float, float]
    points: int
    steps: int
    grid: float
    top: float
    off: float


def pyharm(what: Asked, number: int) -> ByPyHarm:
    """A sample by pyHarm, its peak looked for in finer steps."""
    ring, w = what.tuned.mistuned(what.deviations(number)), 2 * np.pi * FREQUENCY
    job, output = written_anew(ring)
    job |= {"low": w[0], "high": w[-1], "step": w[1] - w[0], "output": output, **what.balance}
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / name for name in ("job.npz", "out.npz")]
        np.savez(files[0], **job)
        alone = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
        command = [PYHARM, ROOT / "benchmarks" / "pyharm_ring.py", *files]
        subprocess.run(command, check=True, env=alone, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        found = dict(np.load(files[1]))
    y, f = np.abs(found["x"] @ output.T), found["omega"] / (2 * np.pi)
    at = int(y.max(axis=1).argmax())
    coarse = int(found["coarse"])
    told = told_by(dict(zip(f[coarse:], y[coarse:], strict=True)))
    mine = SlidingRing(what.problem(ring), what.tuned_points)(f[at])
    return ByPyHarm(tuple(found["cpu"]), len(f), int(found["steps"].sum()), float(y[:coarse].max()),
                    max(float(y.max()), told[0] if told else 0.0), float(mine.max() / y.max() - 1))  # fmt: skip


def annulus(blades: int, n: tuple[int, int, int], modes: int) -> list[str]:
    """A CalculiX deck of bricks the size of the vane, clamped at one end, each of its own modulus, a spring from tip to
    tip: all modes, then the steady state at 24 frequencies below the first of them. In a band that holds modes CalculiX
    adds as many points between any two."""
    places = np.stack(np.meshgrid(*(np.arange(m + 1) for m in n), indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(places)).reshape([m + 1 for m in n])
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = np.stack(
        [number[i : i + n[0] or None, j : j + n[1] or None, k : k + n[2] or None][: n[0], : n[1], : n[2]].ravel()
         for i, j, k in corners], axis=1)  # fmt: skip
    nodes, elements, held, tips, springs = ["*NODE, NSET=NALL"], [], ["*BOUNDARY"], ["*CLOAD"], []
    for b, modulus in enumerate(np.random.default_rng(0).normal(1.0, 0.02, blades)):
        first, after = 1 + b * len(places), 1 + (b + 1) % blades * len(places)
        nodes += [f"{first + i}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(places * SIZE / n + [0.1 * b, 0, 0])]
        elements.append(f"*ELEMENT, TYPE=C3D8I, ELSET=E{b}")
        elements += [f"{1 + b * len(cells) + i}, " + ", ".join(str(first + c) for c in one)
                     for i, one in enumerate(cells)]  # fmt: skip
        elements += [f"*MATERIAL, NAME=M{b}", "*ELASTIC", f"{2.1e11 * modulus}, 0.3", "*DENSITY", "7850.",
                     f"*SOLID SECTION, ELSET=E{b}, MATERIAL=M{b}"]  # fmt: skip
        held += [f"{first + i}, 1, 3" for i in number[:, :, 0].ravel()]
        tips.append(f"{first + number[0, 0, -1]}, 1, 2.0")
        tip = number[0, 0, -1]
        springs.append(f"{blades * len(cells) + 1 + b}, {first + tip}, {after + tip}")
    return [
        *nodes, *elements, "*ELEMENT, TYPE=SPRINGA, ELSET=S", *springs, "*SPRING, ELSET=S", "", "4.e5", *held, "*STEP",
        "*FREQUENCY, STORAGE=YES", f"{modes}", "*END STEP", "*STEP", "*STEADY STATE DYNAMICS",
        f"100., 112., {len(FREQUENCY)}, 1.", "*MODAL DAMPING", f"1, {modes}, 0.001", *tips,
        "*NODE PRINT, NSET=NALL, FREQUENCY=100", "U", "*END STEP",
    ]  # fmt: skip


SIZE = np.array([0.005, 0.02, 0.12])
"""m, of the bricks of CalculiX."""

MESHES = (1, 2, 12), (2, 4, 24), (3, 6, 30), (5, 11, 51)
"""Elements of a brick along its edges."""


def calculix(blades: int, n: tuple[int, int, int]) -> float | None:
    """CPU seconds of CalculiX; None where it is not installed, or fails."""
    if shutil.which("ccx") is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "ring.inp").write_text("\n".join(annulus(blades, n, 6 * blades)) + "\n")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(["ccx", "ring"], cwd=folder, capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if "Job finished" not in done.stdout:
            print(done.stdout[-500:])
            return None
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def timed(call, *given) -> tuple[float, object]:
    begun = time.process_time()
    found = call(*given)
    return time.process_time() - begun, found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--scaling", action="store_true")
    parser.add_argument("--rare", type=int, default=0)
    parser.add_argument("--batch", type=int, default=0)
    given = parser.parse_args()
    if given.batch:
        return together(given.batch)
    if given.rare:
        return rare_quantile(given.rare)
    scaling((12, 24, 48) if given.scaling else (6, 12) if given.quick else (12, 24, 48, 96), 6 if given.scaling else 2)
    if not given.scaling:
        jenkins(6 if given.quick else 24)
        peers(6 if given.quick else 24)


def scaling(blades: tuple[int, ...], samples: int) -> None:
    """Growth with the blades, of samples 1, 2, ..."""
    print(
        f"{'law':>8} {'blades':>7} {'s/sample':>9} {'points':>7} {'ms/point/blade':>15} {'sticking, s':>12}", flush=True
    )
    for law in ("smooth", "jenkins"):
        for N in blades:
            what, linear = asked(N, law=law), asked(N, stuck=True, law=law)
            sample(what, 0)  # with the tuned ring's solutions, from which all begin
            each = [timed(sample, what, n) for n in range(1, samples + 1)]
            points = np.mean([len(s.top.frequencies) for _, s in each])
            spent, stuck = np.mean([t for t, _ in each]), timed(sample, linear, 1)[0]
            per = 1e3 * spent / points / N
            print(f"{law:>8} {N:7d} {spent:9.2f} {points:7.0f} {per:15.2f} {stuck:12.3f}", flush=True)


ALONE = 16
"""Rings that are solved one by one too."""


def together(count: int) -> None:
    """Rings solved together beside some of them one by one, in turns, compiled programs warm."""
    what, begins = asked(24, law="jenkins"), range(0, count, BLOCK)
    several(what, range(BLOCK)), sample(what, 0)
    rings, alone, spent = [], [], np.zeros(2)
    for begin in begins:
        cpu, found = timed(several, what, range(begin, begin + BLOCK))
        rings += found
        spent[0] += cpu
        for number in range(begin, begin + -(-ALONE // len(begins))):
            cpu, one = timed(sample, what, number)
            alone.append(one)
            spent[1] += cpu
    off = [rings[one.number].top.amplitude / one.top.amplitude - 1 for one in alone]
    each = 1e3 * spent / [len(rings), len(alone)]
    asking = sum(one.alone for one in rings)
    print(f"{len(rings)} rings together: {each[0]:.0f} ms each, {asking} asked for the solver of single "
          f"rings; {len(alone)} of them alone: {each[1]:.0f} ms, {each[1] / each[0]:.1f} times; highest off by "
          f"{np.abs(off).max():.1e} at most")  # fmt: skip


def six_that_slide() -> Asked:
    """Six vanes whose Jenkins elements slide most of the time: 84 % of the peak that sticking contacts give."""
    rub = {**RUB, "law": "jenkins", "normal_force": 3.0}
    case = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe", "modes": 2,
            "ring": {"blades": 6, "engine_order": 1}, "contacts": [rub]}  # fmt: skip
    tuned = Tuned(ms.assemble(case, vane=ms.sample()).assembly, {})
    balance, band = {"harmonics": 1, "samples": 32}, np.linspace(320.0, 341.0, 11)
    return Asked(tuned, (Scatter("frequency", 0.01),), band, 1, balance)


PLAIN, CHOSEN, SHARE = 40, 50, 0.999
"""Samples that tell the correlation; those that are chosen, about; of the samples below the quantile."""


def chosen_once(
    what: Asked, linear: Beside, told: float, repeat: int
) -> tuple[rare.Rare, np.ndarray, np.ndarray, float, float]:
    """One estimate of the quantile, its amplitudes and their pi, and CPU seconds of the linear ring and of friction."""
    first = FIRST + repeat * rare.EACH * CHOSEN
    light, z = timed(lambda: np.array([linear(what.deviations(first + i)) for i in range(rare.EACH * CHOSEN)]))
    pi = rare.chances(z, CHOSEN, SHARE, told, PLAIN)
    picked = rare.chosen(pi, repeat)
    heavy, y = timed(lambda: np.array([sample(what, first + int(i)).top.amplitude for i in picked]))
    return rare.estimate(y, pi[picked], len(pi), SHARE, told), y, pi[picked], light, heavy


def rare_quantile(repeats: int) -> None:
    """The 99.9 % quantile by chosen samples, again and again, beside plain samples drawn from all that were chosen, as
    often as they were likely to be."""
    what = six_that_slide()
    linear, before = beside(what), np.array([sample(what, i).top.amplitude for i in range(PLAIN)])
    told = rare.correlation(np.array([linear(what.deviations(i)) for i in range(PLAIN)]), before)
    print(f"ranks of {PLAIN} samples correlate by {told:.3f}", flush=True)
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        found = []
        for one in pool.map(partial(chosen_once, what, linear, told), range(repeats)):
            found.append(one)
            print(f"  {one[0].quantile}, {one[0].samples} chosen, CPU {one[3]:.1f} and {one[4]:.1f} s", flush=True)
    y, weight = np.concatenate([f[1] for f in found]), np.concatenate([1 / f[2] for f in found])
    order = np.argsort(-y)
    above = np.cumsum(weight[order]) / (repeats * rare.EACH * CHOSEN)
    truth = float(y[order][np.searchsorted(above, 1 - SHARE)])
    off = np.array([f[0].quantile.value for f in found]) / truth - 1
    held = np.mean([f[0].quantile.low <= truth <= f[0].quantile.high for f in found])
    light, heavy, number = (sum(each) for each in zip(*((f[3], f[4], f[0].samples) for f in found), strict=True))
    print(f"the quantile {truth:.5g} m; chosen {number / repeats:.1f}: error {np.sqrt(np.mean(off**2)):.4f}, in the "
          f"mean {off.mean():+.4f}, {100 * held:.0f} % of the intervals hold it; plain samples for one, by the share "
          f"above, {np.median([f[0].worth / f[0].samples for f in found]):.0f}")  # fmt: skip
    equal = number / repeats * (1 + light / heavy)
    print(f"CPU: linear {light / repeats:.1f} s, friction {heavy / repeats:.1f} s, {heavy / number:.3f} s each: as "
          f"{equal:.1f} samples")  # fmt: skip
    for count in (int(round(number / repeats)), 20 * CHOSEN, round(20 * equal)):
        print(f"plain {count}: error {plain_error(y[order], np.append(0.0, above), truth, count):.4f}")


def plain_error(y: np.ndarray, above: np.ndarray, truth: float, count: int, repeats: int = 4000) -> float:
    """Root mean square error of the quantile by so many plain samples, from (n,) falling y and (n + 1,) shares above;
    all that is below the last is as high as that."""
    g = np.random.default_rng(0)
    drawn = np.append(y, y[-1])[np.searchsorted(above, g.random((repeats, count))) - 1]
    return float(np.sqrt(np.mean((np.quantile(drawn, SHARE, axis=1) / truth - 1) ** 2)))


def jenkins(N: int) -> None:
    """Samples whose gaps hold Jenkins elements, by the program and by pyHarm."""
    what = asked(N, law="jenkins")
    sample(what, 0)
    for number in SAMPLES:
        spent, found = timed(sample, what, number)
        print(f"{N} blades with Jenkins elements, sample {number}: {spent:.2f} s, {len(found.top.frequencies)} points")
        if PYHARM.is_file():
            peer = pyharm(what, number)
            grid, top = (y / found.top.amplitude - 1 for y in (peer.grid, peer.top))
            print(f"  pyHarm: {peer.cpu[0]:.1f} s on the grid, {grid:+.1e} off, {sum(peer.cpu):.1f} s with the peak, "
                  f"{top:+.1e} off, {sum(peer.cpu) / spent:.0f} times; {peer.points} points, {peer.steps} steps, from "
                  f"which ours differs by {peer.off:+.1e}", flush=True)  # fmt: skip


def peers(N: int) -> None:
    """Samples by the program, and by its peers."""
    what, linear = asked(N), asked(N, stuck=True)
    sample(what, 0)
    alike = 0.0
    for number in SAMPLES:
        spent, found = timed(sample, what, number)
        alike += spent
        print(f"{N} blades, sample {number}: {spent:.2f} s, {len(found.top.frequencies)} points", flush=True)
        plain, top = timed(peaked, what, number, what, PlainProblem)
        print(f"  the same with one dense matrix: {plain:.1f} s, {plain / spent:.1f} times; highest "
              f"{top.amplitude / found.top.amplitude - 1:+.1e} off", flush=True)  # fmt: skip
        book, (solved, top_) = timed(textbook, what, number)
        print(f"  on the grid alone, from the textbook: {book:.1f} s, {book / spent:.0f} times; {solved} of "
              f"{len(FREQUENCY)} solved, highest {top_ / found.top.amplitude - 1:+.1e} off", flush=True)  # fmt: skip
    by_hand = replace(what, models=ByHand.of)
    plain, top = timed(peaked, by_hand, number, what, PlainProblem)
    print(f"  sample {number} contact by contact in plain Python, one dense matrix: {plain:.1f} s, {plain / spent:.0f} "
          f"times; highest {top.amplitude / found.top.amplitude - 1:+.1e} off", flush=True)  # fmt: skip
    alike /= len(SAMPLES)
    stuck = np.mean([timed(sample, linear, n)[0] for n in range(4)])
    print(f"with sticking contacts: {stuck:.3f} s a sample", flush=True)
    for n in MESHES[: 1 if N < 24 else None]:
        if (spent := calculix(N, n)) is not None:
            size = 3 * N * (n[0] + 1) * (n[1] + 1) * n[2]
            print(f"ccx, {size} degrees of freedom: {spent:.1f} s, {spent / alike:.0f} times as long as with friction, "
                  f"{spent / stuck:.0f} as sticking", flush=True)  # fmt: skip


SAMPLES = 1, 2, 3
"""That peers solve too."""

if __name__ == "__main__":
    main()

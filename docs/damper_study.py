"""Damping elements, wires and underplatform dampers (Sextro 5.4, 5.5): responses of the case files and their optima."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.linalg

from microslip.case import load_case
from microslip.case.assemble import Built, build
from microslip.case.messages import OPEN
from microslip.case.problem import problem_of
from microslip.data import Array, ModalBasis
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.reduced import stuck
from microslip.harmonic_balance.response import operating
from microslip.harmonic_balance.solver import Point, solve, sweep

CASES = Path(__file__).parent.parent / "pipeline" / "cases"
Bases = Callable[[str], ModalBasis]


@dataclass(frozen=True)
class Curve:
    """A response: frequency (f,) in Hz, first harmonics (f, w) of the read-outs, nan where a point is no solution,
    which points converged (f,), and the largest share of a contact's points and time that would be open there (f,)."""

    frequency: Array
    outputs: Array
    converged: Array
    open: Array

    def largest(self, pick: Callable[[Array], Array]) -> tuple[float, float]:
        """Frequency (Hz) and value of the largest amplitude of a combination of the read-outs."""
        size = np.where(self.converged, np.abs(pick(self.outputs)), 0.0)
        top = int(size.argmax())
        return float(self.frequency[top]), float(size[top])

    def lifts(self, frequency: float) -> bool:
        """Whether contacts would lift off there, which the book's mode does not follow: not valid."""
        return bool(self.open[np.abs(self.frequency - frequency).argmin()] > OPEN)


def opened(case: str, bases: Bases, *changes: str) -> Built:
    """A case file with some settings changed, its bodies by their names."""
    path = CASES / f"{case}.toml"
    settings, _ = load_case(path, list(changes))
    files: dict[str, ModalBasis] = {}
    for b in settings.components:
        files.setdefault(b.body or b.name, bases(b.body or b.name))
    return build(settings, {b.name: files[b.body or b.name] for b in settings.components})


def followed(problem: Problem, frequency: Array, finer: int = 3) -> Curve:
    """A sweep, and points halved in where its first read-out is highest, `finer` times on both sides of the top."""
    points = sweep(problem, frequency)
    for _ in range(finer):
        points = _halved(problem, points)
    seen = [operating(problem, p) for p in points]
    solved = np.array([p.converged for p in points])
    first = np.where(solved[:, None], [o.outputs[:, 1] for o in seen], np.nan)
    lifted = np.array([max((float(c.open.mean()) for c in o.cycles.values()), default=0.0) for o in seen])
    frequency = np.array([p.Omega for p in points]) / (2 * np.pi)
    return Curve(frequency, first, solved, lifted)


def _halved(problem: Problem, points: list[Point]) -> list[Point]:
    """Two more points, half way to the neighbours of the highest."""
    size = [abs(operating(problem, p).outputs[0, 1]) if p.converged else 0.0 for p in points]
    top = int(np.argmax(size))
    out = list(points)
    for a in sorted({max(top - 1, 0), min(top, len(points) - 2)}, reverse=True):
        Omega = 0.5 * (points[a].Omega + points[a + 1].Omega)
        out.insert(a + 1, solve(problem, Omega, [points[top].x]))
    return out


def sticking(problem: Problem) -> Array:
    """Frequencies (Hz) with every contact stuck."""
    k = [c.stiffness for c in problem.assembly.contacts]
    return stuck(problem.assembly.joined(1), scipy.linalg.block_diag(*k))


def over_forces(built: Built, forces: Sequence[float], frequency: Array, finer: int = 3) -> dict[float, Curve]:
    """Normal force (N) -> response."""
    return {F: followed(problem_of(built, F), frequency, finer) for F in forces}


def optimum(curves: Mapping[float, Curve], pick: Callable[[Array], Array]) -> tuple[float, float, float]:
    """Normal force (N) whose largest amplitude is smallest, the frequency (Hz) of that and the amplitude."""
    best = min(curves, key=lambda F: curves[F].largest(pick)[1])
    return (best, *curves[best].largest(pick))


def of_order(built: Built, order: int) -> Built:
    """The ring of a case under another engine order."""
    ring = built.assembly.ring
    assert ring is not None
    return replace(built, assembly=replace(built.assembly, ring=replace(ring, order=order)))


SHAPES = ("cottage-roof", "cylinder", "asymmetric")
PRINTED = (0.0259, 0.0418, 0.117)


def under_platforms(shape: str, mass: float, bases: Bases, frequency: Array, finer: int = 3) -> tuple[float, Curve]:
    """Normal force (N) and response of the spin-pit rig with dampers of one shape and mass (kg) at the case's speed."""
    built = opened(f"spin-pit-{shape}", bases, f"bodies.damper.mass={mass}")
    return float(built.contacts[0].normal_force or 0.0), followed(problem_of(built, None), frequency, finer)


def bending(watched: Array) -> Array:
    """The first read-out."""
    return watched[:, 0]


def torsion(watched: Array) -> Array:
    """The second read-out, rad."""
    return watched[:, 1]

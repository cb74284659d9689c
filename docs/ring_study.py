"""The 24-blade ring of Sextro section 5.5: number of modes, engine orders, normal force, stress at the blade's foot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.optimize

from microslip.case import CaseSettings, load_case
from microslip.case.assemble import build
from microslip.case.problem import problem_of
from microslip.data import Array, ModalBasis
from microslip.frames import rotation
from microslip.harmonic_balance import response
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.solver import sweep
from microslip.harmonic_balance.sweeps import brackets
from microslip.operating.motion import motion_of
from microslip.operating.stress import places, stress_peaks
from microslip.system.assembly import ContactFace

CASE = Path(__file__).parents[1] / "pipeline/cases/ring.toml"
FOOT = 0.1
"""Share of the height that counts as the foot."""


@dataclass(frozen=True)
class Ring:
    """The case of the ring and its blade. points: of a contact along t1 and t2, those of the file if None."""

    basis: ModalBasis
    settings: CaseSettings

    def problem(self, normal: float, order: int = 2, modes: int | None = None, **finer: Any) -> Problem:
        """Balance at a normal force (N), an engine order, with fewer modes, or finer."""
        assert self.settings.ring is not None
        s = self.settings.model_copy(
            update={"ring": self.settings.ring.model_copy(update={"engine_order": order}), "modes": modes}
        )
        return problem_of(build(s, {"blade": self.basis}), normal, **finer)


def ring(basis: ModalBasis, points: tuple[int, int] | None = None, **changes: Any) -> Ring:
    """The ring of a blade. points: of a contact along t1 and t2, coarser than in the file. changes: of the case."""
    settings, _ = load_case(CASE)
    if points is not None:
        changes["contacts"] = tuple(c.model_copy(update={"points": points}) for c in settings.contacts)
    return Ring(basis, settings.model_copy(update=changes))


@dataclass(frozen=True)
class Highest:
    """The highest resonance of a band: Hz, m, Pa (von Mises, first harmonic, at the foot), largest share of points and
    time that are open, points without a solution."""

    frequency: float
    amplitude: float
    stress: float
    open: float
    failed: int


def frf(problem: Problem, frequency: Array) -> response.HarmonicResponse:
    """Response over frequency (Hz)."""
    return response.of_points(problem, sweep(problem, frequency))


def amplitudes(problem: Problem, frequency: Array) -> Array:
    """(f,) of the accelerometer over frequency (Hz), m; nan where a point is no solution."""
    return frf(problem, frequency).columns()["amplitude_m"]


def highest(problem: Problem, basis: ModalBasis, frequency: Array) -> Highest:
    """The resonance with the largest stress of a band; the largest amplitude belongs to the same resonance."""
    found = frf(problem, frequency)
    at, stress = [], []
    for peak in filter(None, (response.highest(problem, found, bracket) for bracket in brackets(found))):
        at.append(response.operating(problem, peak[0]))
        stress.append(foot_stress(basis, at[-1]))
    if not at:
        return Highest(float("nan"), float("nan"), float("nan"), 0.0, int((~found.converged).sum()))
    top = int(np.argmax(stress))
    operating = at[top]
    share = max(float(c.open.mean()) for c in operating.cycles.values())
    return Highest(
        operating.Omega / (2 * np.pi), float(abs(operating.outputs[0, 1])), stress[top], share,
        int((~found.converged).sum()),
    )  # fmt: skip


def foot_stress(basis: ModalBasis, operating: response.Operating) -> float:
    """Pa, the largest von Mises stress of the first harmonic in the lowest tenth of the blade."""
    group = next(iter(basis.groups.values()))
    q = np.array(next(iter(operating.q.values())))
    motion = motion_of(operating.Omega, q, group)
    height = places(motion)[:, 2]
    foot = np.flatnonzero(height <= FOOT * height.max())
    return float(stress_peaks(motion, only=foot, first_harmonic=True).amplitude[0])


def over_forces(r: Ring, forces: Sequence[float], frequency: Array, **asked: Any) -> list[Highest]:
    return [highest(r.problem(float(n), **asked), r.basis, frequency) for n in forces]


def inclined(r: Ring, degrees: float, normal: float, order: int) -> Problem:
    """The ring with its contact faces turned about the radial axis: a shroud angle beta on the same blade."""
    from microslip.harmonic_balance import problem as balance

    assert r.settings.ring is not None
    s = r.settings.model_copy(update={"ring": r.settings.ring.model_copy(update={"engine_order": order})})
    built = build(s, {"blade": r.basis})
    Q = np.kron(np.eye(2), rotation(np.array([0.0, 0.0, 1.0]), np.radians(degrees)))

    def turned(side: ContactFace) -> ContactFace:
        return replace(side, frame=Q @ side.frame)

    contacts = tuple(replace(c, first=turned(c.first), second=turned(c.second)) for c in built.assembly.contacts)
    pressed = replace(built, assembly=replace(built.assembly, contacts=contacts)).pressed(normal)
    return balance.of(pressed, harmonics=s.harmonics, samples=s.samples)


# pictures ------------------------------------------------------------------------------------------------------------

WIDE = np.linspace(10.0, 125.0, 24)
COARSE = (12, 2)


def modes_picture(r: Ring, axes: Any) -> list[list[str]]:
    """Figure 5.5-1: FRF with fewer modes; rows of largest and mean error against all stored ones."""
    f = np.linspace(10.0, 600.0, 237)
    whole = amplitudes(r.problem(780.0), f)
    rows = []
    for modes, style in ((15, "--"), (20, "-")):
        few = amplitudes(r.problem(780.0, modes=modes), f)
        axes.semilogy(f, 1e6 * few, style, lw=1.6, label=f"{modes} modes")
        error = np.abs(few / whole - 1)
        first = f < 200
        rows.append([f"{modes}", *(f"{100 * np.nanmedian(error[part]):.2g} %" for part in (first, ~first))])
    axes.semilogy(f, 1e6 * whole, color="0.3", lw=0.8, label=f"{r.basis.groups[0, 0].n_modes} modes")
    axes.set(xlabel="excitation frequency in Hz", ylabel="amplitude at the accelerometer in µm")
    axes.legend(title="780 N, engine order 2")
    return rows


def forces_picture(r: Ring, left: Any, right: Any) -> None:
    """Figure 5.5-3: FRFs over the normal force; highest amplitude and foot stress over the normal force."""
    f = np.linspace(60.0, 125.0, 105)
    for normal in (1.0, 3.5, 10.0, 30.0, 100.0, 780.0):
        left.semilogy(f, 1e6 * amplitudes(r.problem(normal), f), lw=1.6, label=f"{normal:g} N")
    left.set(xlabel="excitation frequency in Hz", ylabel="amplitude at the accelerometer in µm")
    left.legend(title="normal force")
    forces = np.geomspace(0.5, 780.0, 15)
    found = over_forces(r, forces.tolist(), WIDE)
    right.loglog(forces, [1e6 * h.amplitude for h in found], "o-", ms=4, label="amplitude")
    right.axvline(3.5, color="0.4", ls=":", label="3.5 N, printed optimum")
    right.set(xlabel="normal force in N", ylabel="highest amplitude, engine order 2, in µm")
    stress = right.twinx()
    stress.loglog(forces, [1e-6 * h.stress for h in found], "s-", ms=4, color="C1", label="stress at the foot (right)")
    stress.set(ylabel="highest stress at the foot in MPa")
    stress.legend(handles=[*right.lines, *stress.lines], loc="upper left")


def optimum(make: Any, basis: ModalBasis, low: float = 4.0, high: float = 25.0) -> tuple[float, Highest]:
    """Normal force (N) where the highest amplitude of a band is lowest, to 5 %. make: normal force -> problem."""
    band = np.linspace(70.0, 125.0, 16)

    def amplitude(log: float) -> float:
        return float(np.log(highest(make(float(np.exp(log))), basis, band).amplitude))

    best = scipy.optimize.minimize_scalar(
        amplitude, bounds=(np.log(low), np.log(high)), method="bounded", options={"xatol": 0.05}
    )
    normal = float(np.exp(best.x))
    return normal, highest(make(normal), basis, band)


def orders_picture(r: Ring, left: Any, right: Any) -> list[list[str]]:
    """Figures 5.5-2, 5.5-4 and 5.5-5: resonance and stress over the engine order; rows of the resonances at 780 N."""
    orders, forces = (0, 1, 2, 3, 4, 6, 8, 9, 10, 11, 12), (2.0, 10.0, 30.0, 100.0, 780.0)
    found = {n: [highest(r.problem(n, e), r.basis, WIDE) for e in orders] for n in forces}
    turned = [highest(inclined(r, 30.0, 780.0, e), r.basis, WIDE) for e in orders]
    left.plot(orders, [h.frequency for h in found[780.0]], "o-", label="shroud angle 0, as the case")
    left.plot(orders, [h.frequency for h in turned], "s--", ms=4, label="shroud angle 30°")
    left.set(xlabel="engine order", ylabel="resonance at 780 N in Hz", ylim=(0, None))
    left.legend()
    for n, row in found.items():
        (line,) = right.semilogy(orders, [1e-6 * h.stress for h in row], "o-", ms=4, label=f"{n:g} N")
        parted = [(e, 1e-6 * h.stress) for e, h in zip(orders, row, strict=True) if h.open > 0.01]
        right.semilogy(*zip(*parted, strict=True), "o", ms=9, mfc="none", color=line.get_color()) if parted else None
    right.set(xlabel="engine order", ylabel="stress amplitude at the foot in MPa")
    right.set_ylim(0.6, 5000)
    right.legend(title="rings: contacts separate", ncols=3, loc="upper center")
    return [
        [str(e), *(f"{h.frequency:.2f}" for h in (one, two)), f"{1e-6 * one.stress:.1f}", f"{1e-6 * two.stress:.1f}"]
        for e, one, two in zip(orders, found[780.0], turned, strict=True)
    ]


def assumptions(r: Ring, other: dict[str, ModalBasis]) -> list[list[str]]:
    """Optimal normal force with other excitation, friction, harmonics, points; other: words -> blade."""

    def changed(**updates: Any) -> Ring:
        return replace(r, settings=r.settings.model_copy(update=updates))

    def contacts(change: str) -> Ring:
        coarse = f"contacts.0.points={list(COARSE)}"
        return changed(contacts=load_case(CASE, [coarse, f"contacts.0.{change}"])[0].contacts)

    cases: list[tuple[str, Ring, dict[str, Any], float]] = [
        ("as in the case file, 12 x 2 points", r, {}, 1.0),
        ("36 x 5 points", contacts("points=[36,5]"), {}, 1.0),
        ("three harmonics, 64 samples", r, {"harmonics": 3, "samples": 64}, 1.0),
        ("excited by 0.4 N", changed(amplitude=0.4), {}, 0.4),
        ("excited by 2 N", changed(amplitude=2.0), {}, 2.0),
        ("friction coefficient 0.3", contacts("friction=0.3"), {}, 2 / 3),
        ("half of the roughness", contacts("roughness=3.75e-6"), {}, 1.0),
        *((words, replace(r, basis=b), {}, 1.0) for words, b in other.items()),
    ]
    rows = []
    for words, each, finer, scale in cases:
        normal, h = optimum(
            lambda n, each=each, finer=finer: each.problem(n, **finer), each.basis, 4.0 * scale, 25.0 * scale
        )
        rows.append(
            [words, f"{normal:.1f}", f"{h.frequency:.1f}", f"{1e6 * h.amplitude:.1f}", f"{1e-6 * h.stress:.2f}"]
        )
    return rows

"""Random small systems: drawn as numbers, made as an assembly of the program and as a dense system by hand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import dense
import jax.numpy as jnp
import numpy as np
from integrator import steady
from test_harmonic_balance_time import begun, group
from wrong_laws import Printed

from microslip.contact.friction import Coulomb
from microslip.contact.heights import Polynomial
from microslip.contact.law import Law
from microslip.contact.normal import Penalty, Preload, Rough
from microslip.contact.patch import Patch
from microslip.contact.point import PointContact
from microslip.contact.sliders import Iwan, rough_strips, uniform
from microslip.data import Rows
from microslip.harmonic_balance import accuracy, response
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.problem import Problem
from microslip.harmonic_balance.response import Operating
from microslip.harmonic_balance.solver import Point, solve
from microslip.results.checks import BALANCE, COUNTED, MOTION, Checks
from microslip.system.assembly import Assembly, Contact, ContactFace, Load, Output
from microslip.system.component import Component

Array = np.ndarray

FAMILIES = (
    (("jenkins", "penalty", "iwan"), ((1, 32), (5, 128))),
    (("jenkins", "coulomb", "rough", "strips"), ((3, 64), (7, 64))),
)
"""Kinds of contacts, harmonics and samples that are drawn together: few shapes, so that compiled programs are shared.
``jenkins`` moves along one line, ``coulomb`` and ``iwan`` along both tangents, all three under constant forces."""

AT_HOME = {"penalty": (1, 32), "iwan": (1, 32), "coulomb": (7, 64), "rough": (7, 64), "strips": (7, 64)}
"""Harmonics and samples at which all systems with such contacts share the programs that are compiled for them; sliders
on a line compile none."""

POINTS = {"penalty": 2, "iwan": 2}
"""Of a contact, if it is not one."""

MOVES = (("t1",), ("t1", "t2"), ("n", "t1"), ("n", "t1", "t2"))

SLIDERS = 4
"""Of a point of Iwan's, or strips of a rough contact."""


@dataclass(frozen=True)
class Touch:
    """A contact as it was drawn.

    Attributes:
        kind. first, second: numbers of bodies; None: the ground. rows: (3, m) motions of both along n, t1, t2 per unit
            of their coordinates. shapes: (n, 3, 3) motion of its points per unit of the contact's. offset: approach at
            rest, m. numbers: of the law.
    """

    kind: str
    first: int
    second: int | None
    rows: tuple[Array, Array | None]
    shapes: Array
    offset: float
    numbers: dict[str, Any]

    @property
    def along(self) -> list[int]:
        """Which of n, t1, t2 are its coordinates."""
        return [1] if self.kind == "jenkins" else [0, 1, 2]


@dataclass(frozen=True)
class Drawn:
    """A random system.

    Attributes:
        bodies: (m,) frequencies in rad/s, (m,) row of the excitation, (2, m) of the read-outs of each. ratio: of
            damping. touches. forces: on each body, N. Omega: rad/s. harmonics, samples: that it is solved with.
    """

    bodies: list[tuple[Array, Array, Array]]
    ratio: float
    touches: list[Touch]
    forces: list[complex]
    Omega: float
    harmonics: int
    samples: int

    @property
    def places(self) -> list[slice]:
        """Of the coordinates of each body."""
        ends = np.cumsum([0, *(len(omega) for omega, *_ in self.bodies)])
        return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]

    def relative(self, t: Touch) -> Array:
        """(3, d) motion of a contact per unit of all coordinates."""
        out = np.zeros((3, self.places[-1].stop))
        out[:, self.places[t.first]] += t.rows[0]
        if t.second is not None:
            out[:, self.places[t.second]] -= t.rows[1]
        return out


def drawn(seed: int) -> Drawn:
    """1 to 4 modes in one or two bodies, one or two contacts, from sticking to sliding all the time."""
    rng = np.random.default_rng(seed)
    kinds, grids = FAMILIES[rng.integers(2)]
    sizes = [(int(rng.integers(1, 5)),), tuple(int(m) for m in rng.integers(1, 3, 2))][rng.integers(2)]
    bodies = [(np.sort(rng.uniform(0.7, 6, m)), rng.normal(size=m), rng.normal(size=(2, m))) for m in sizes]
    pairs = [(0, 1 if len(sizes) == 2 else None), (int(rng.integers(len(sizes))), None)][: rng.integers(1, 3)]
    touches = [touch(rng, str(rng.choice(kinds)), sizes, *pair) for pair in pairs]
    ratio, (harmonics, samples) = 10 ** rng.uniform(np.log10(0.002), np.log10(0.05)), grids[rng.integers(2)]
    forces = [complex(np.exp(2j * np.pi * rng.uniform())) for _ in sizes]
    near, off, loading = rng.uniform(), rng.uniform(0.7, 1.3), 10 ** rng.uniform(-0.3, 1.0)
    return driven(Drawn(bodies, ratio, touches, forces, 1.0, harmonics, samples), near, off, loading)


@cache
def at_home(count: int) -> tuple[int, ...]:
    """Of the first seeds, those whose systems share programs, see `AT_HOME`."""

    def shares(one: Drawn) -> bool:
        grid = one.harmonics, one.samples
        return all(AT_HOME.get(t.kind, grid) == grid for t in one.touches)

    return tuple(seed for seed in range(count) if shares(drawn(seed)))


def lasts(one: Drawn) -> float:
    """Periods of the excitation in which a free vibration falls to a part in e, the slowest."""
    return one.Omega / (2 * np.pi * one.ratio * min(omega.min() for omega, *_ in one.bodies))


def touch(rng, kind: str, sizes, first: int, second: int | None) -> Touch:
    """A contact that carries about 1 N at rest."""
    along = MOVES[0 if kind == "jenkins" else rng.integers(4)]
    moves = np.array([d in along for d in ("n", "t1", "t2")])[:, None]
    moves[0] |= kind in ("penalty", "rough", "strips")
    rows = tuple(None if b is None else moves * signed(rng, 3, sizes[b]) for b in (first, second))
    n, offset = POINTS.get(kind, 1), 0.0
    shapes = np.eye(3) + (0.2 * rng.uniform(-1, 1, (n, 3, 3)) if n > 1 else np.zeros((1, 3, 3)))
    kt, mu = 10 ** rng.uniform(-0.5, 2) * rng.uniform(0.5, 1, n) / n, rng.uniform(0.1, 0.6, n)
    numbers: dict[str, Any] = {"kt": kt, "mu": mu}
    if kind in ("jenkins", "coulomb", "iwan"):
        numbers["N"] = rng.uniform(0.5, 1.5, n) / n
    if kind == "iwan":
        numbers["weakest"] = rng.uniform(0, 0.5)
    if kind == "penalty":
        offset = 10 ** rng.uniform(-1.5, 0)
        numbers |= {"kn": rng.uniform(0.5, 1.5, n) / n / offset, "gap": offset * rng.uniform(-0.3, 0.3, n)}
    if kind in ("rough", "strips"):
        offset, x = 10 ** rng.uniform(-1.5, 0), rng.uniform(0.3, 0.9)
        numbers |= {"kn": np.array([1 / (offset / x * (x**3 - 0.5 * x**4))]), "roughness": offset / x}
    return Touch(kind, first, second, rows, shapes, offset, numbers)


def signed(rng, *shape: int) -> Array:
    """Numbers of either sign, none of them small."""
    return rng.uniform(0.3, 1, shape) * rng.choice([-1, 1], shape)


def driven(one: Drawn, near: float, off: float, loading: float) -> Drawn:
    """Beside a resonance of the free or the sticking system, by loads that without any sliding would bring the point
    that is loaded most to ``loading`` times its limit."""
    s = plain(one)
    K = s.K + sum(p.rows.T @ (sticking(p)[:, None] * p.rows) for p in s.points)
    both = np.sqrt(np.concatenate([np.linalg.eigvalsh(K), np.diag(s.K)]))
    Omega = float(off * np.sort(both)[int(near * len(both))])
    q = np.linalg.solve(K - Omega**2 * s.M + 1j * Omega * s.C, s.load)
    held = [p.limits.sum() * max(p.pressed, 0.05) for p in s.points]
    used = [np.linalg.norm(p.rows[1:] @ q) * p.stiffness.sum() / limit for p, limit in zip(s.points, held, strict=True)]
    return replace(one, Omega=Omega, forces=[f * loading / max(used) for f in one.forces])


def sticking(p: dense.Point) -> Array:
    """(3,) stiffness along n, t1, t2 at rest, N/m, of all of the area."""
    ahead, back = (p.normal(p.offset[:1] + h)[0][0] for h in (1e-6, -1e-6))
    return np.array([(ahead - back) / 2e-6, p.stiffness.sum(), p.stiffness.sum()])


# by hand -----------------------------------------------------------------------------------------------------------


def plain(one: Drawn) -> dense.System:
    """The system without the program."""
    omega = np.concatenate([b[0] for b in one.bodies])
    points = [p for t in one.touches for p in points_of(one, t)]
    load = np.concatenate([f * b[1] for f, b in zip(one.forces, one.bodies, strict=True)])
    output = np.zeros((2 * len(one.bodies), len(omega)))
    for i, (at, b) in enumerate(zip(one.places, one.bodies, strict=True)):
        output[2 * i : 2 * i + 2, at] = b[2]
    C = np.diag(2 * one.ratio * omega)
    return dense.System(np.eye(len(omega)), C, np.diag(omega**2), load, output, points, one.Omega)


def points_of(one: Drawn, t: Touch) -> list[dense.Point]:
    """The points of a contact; each strip of a rough one is a point of its own at the same place."""
    found = []
    for i, G in enumerate(t.shapes):
        for normal, stiffness, limits in parts(t, i):
            u = G @ np.array([t.offset, 0, 0])
            found.append(dense.Point(G @ one.relative(t), u, float(normal(u[:1])[0][0]), normal, stiffness, limits))
    return found


def parts(t: Touch, i: int) -> list[tuple[dense.Normal, Array, Array]]:
    """Of point i: normal laws, each with stiffnesses and limits of its sliders."""
    v, kt, mu = t.numbers, t.numbers["kt"][i : i + 1], t.numbers["mu"][i : i + 1]
    if t.kind in ("jenkins", "coulomb"):
        return [(dense.constant(v["N"][i]), kt, mu)]
    if t.kind == "penalty":
        return [(dense.penalty(v["kn"][i], v["gap"][i]), kt, mu)]
    if t.kind == "rough":
        return [(dense.rough(v["kn"][i], v["roughness"]), kt, mu)]
    if t.kind == "iwan":
        edges = np.linspace(v["weakest"], 1, SLIDERS + 1)
        strength = 0.5 * (edges[1:] + edges[:-1])
        return [(dense.constant(v["N"][i]), kt / SLIDERS * np.ones(SLIDERS), mu * strength / strength.sum())]
    made: Any = law(t)  # where its strips are is a choice of the program, of which the dense system is a copy
    each = zip(np.asarray(made.at)[:, 0], np.asarray(made.shares)[:, 0], strict=True)
    return [(dense.penalty(v["kn"][i] * w, v["roughness"] * x), kt * w, mu) for x, w in each]


# by the program ----------------------------------------------------------------------------------------------------


def law(t: Touch) -> Law:
    v = {key: jnp.asarray(x, dtype=float) for key, x in t.numbers.items()}
    if t.kind == "jenkins":
        return PointContact(Preload(v["N"][0]), Coulomb(v["mu"][0]), v["kt"][0])
    if t.kind == "coulomb":
        return PointContact(Preload(v["N"]), Coulomb(v["mu"]), v["kt"])
    if t.kind == "penalty":
        return PointContact(Penalty(v["kn"], v["gap"]), Coulomb(v["mu"]), v["kt"])
    if t.kind == "rough":
        return PointContact(Rough(v["kn"], v["roughness"], Polynomial()), Coulomb(v["mu"]), v["kt"])
    if t.kind == "iwan":
        return Iwan(Preload(v["N"]), v["mu"], v["kt"], *uniform(SLIDERS, t.numbers["weakest"]))
    kn, kt, mu = (float(t.numbers[key][0]) for key in ("kn", "kt", "mu"))
    return rough_strips(kn, t.numbers["roughness"], Polynomial(), kt, mu, SLIDERS)


def assembly(one: Drawn) -> Assembly:
    names = [f"body {i}" for i in range(len(one.bodies))]
    components = tuple(Component(name, {0: body(one, *b)}) for name, b in zip(names, one.bodies, strict=True))
    contacts = tuple(contact(one, f"contact {i}", t) for i, t in enumerate(one.touches))
    loads = tuple(Load(name, "push", f) for name, f in zip(names, one.forces, strict=True))
    outputs = tuple(Output(name, "tip", label) for name in names for label in ("u", "v"))
    return Assembly(components, contacts, loads, outputs)


def body(one: Drawn, omega: Array, push: Array, watched: Array):
    made = group(omega, {"face": np.zeros((6, len(omega))), "push": push, "tip": watched[0]}, one.ratio)
    return replace(made, monitors={"tip": Rows(watched, ("u", "v"), "m", np.zeros(3))})


def contact(one: Drawn, name: str, t: Touch) -> Contact:
    """Preloaded by what its points carry at rest."""
    shapes, at = t.shapes[:, :, t.along], t.along
    patch = Patch("face", np.zeros((len(shapes), 2)), np.ones(len(shapes)), law(t), shapes)
    first, second = (None if b is None else ContactFace(f"body {b}", "face", rows={0: rows[at]})
                     for b, rows in zip((t.first, t.second), t.rows, strict=True))  # fmt: skip
    each = [p.pressed for p in points_of(one, t)]
    pressed = np.array(each).reshape(len(shapes), -1).sum(axis=1)
    return Contact(name, patch, first, second, np.array([t.offset, 0, 0])[at], pressed @ shapes[:, 0])


# compared ----------------------------------------------------------------------------------------------------------

NEAR = (7, 33)
"""Seeds whose dense solution starts from the program's: of the first the sticking system leads to another motion, whose
amplitude is 14 % larger, of the second to none."""

ROUNDING = 1e-9
"""Share of an amplitude that both solvers leave of their equations, ten times over."""

TAKEN = 0.01
"""Share of the energy by which the work on a point may be wrong beyond what the error of the amplitude makes of it, six
times what forty systems have at most: nothing estimates it."""

HARD = (43, 99, 135, 150, 179, 187)
"""Of the first two hundred that share programs, those that Newton's method does not solve, nor the curve over the load
(most of them)."""


@dataclass(frozen=True)
class Verdict:
    """What is left between the program and a dense solution.

    Attributes:
        status: of the solution. off: difference of the first read-out's amplitude, estimate: the program's of its
            error, own: the dense solution's error, all over the amplitude. taken: largest difference of the work on a
            point of a contact, over the work of the loads. checks: the program's. missing: in the dense balance.
    """

    status: str
    off: float
    estimate: float
    own: float
    taken: float
    checks: Checks
    missing: float

    @property
    def flags(self) -> set[str]:
        """What is wrong, by name."""
        limits = {
            "amplitude": self.off <= self.estimate + self.own + ROUNDING,
            "taken": self.taken <= TAKEN + 2 * (self.estimate + self.own),  # energies go with the square
            "balance": abs(self.checks.balance) <= BALANCE,
            "counted": abs(self.checks.counted) <= COUNTED,
            "motion": self.checks.motion <= MOTION,
        }
        return {name for name, fine in limits.items() if not fine}


def solved(one: Drawn, made: Assembly | None = None, samples: int = 0) -> tuple[Problem, Point, Operating]:
    """By the program, from the sticking contacts. made: another assembly; samples: another number of them."""
    problem = balance.of(made or assembly(one), one.harmonics, samples or one.samples)
    point = solve(problem, one.Omega, [])
    return problem, point, response.operating(problem, point)


@cache
def right(seed: int) -> dense.Solution:
    """By the dense balance."""
    one = drawn(seed)
    return dense.solution(plain(one), start_of(solved(one)[2]) if seed in (*NEAR, *HARD) else None)


def start_of(found: Operating) -> Array:
    """(2 H + 1, d) mean, cos, sin, ... of the coordinates of all bodies."""
    a = np.array([np.concatenate(each) for each in zip(*found.q.values(), strict=True)])
    out = np.zeros((2 * len(a) - 1, a.shape[1]))
    out[0], out[1::2], out[2::2] = a[0].real, a[1:].real, -a[1:].imag
    return out


def verdict(one: Drawn, known: dense.Solution, **other: Any) -> Verdict:
    """other: see `solved`."""
    problem, point, found = solved(one, **other)
    e = accuracy.error(problem, point.x, point.Omega)
    amplitude, ends = known.amplitude[0], np.cumsum([len(points_of(one, t)) for t in one.touches])
    taken = [np.abs(c.dissipated - work.reshape(len(c.dissipated), -1).sum(axis=1)).max()
             for c, work in zip(found.cycles.values(), np.split(known.lost, ends[:-1]), strict=True)]  # fmt: skip
    return Verdict(
        point.status, abs(abs(found.outputs[0, 1]) - amplitude) / amplitude, e.readout * e.amplitude / amplitude,
        known.error[0] / amplitude, max(taken) / abs(found.supplied), found.checks, known.missing,
    )  # fmt: skip


def compared(seed: int) -> Verdict:
    """The program against the dense balance."""
    return verdict(drawn(seed), right(seed))


def integrated(seed: int) -> tuple[float, float, float]:
    """Difference of the first read-out's amplitude to integration in time, the program's estimate of its error, and
    the integration's: what half the step changes, and what is left of how it began; all over the amplitude.

    It begins with the motion of the balance: neighbouring motions exist where points keep a mean force.
    """
    one = drawn(seed)
    problem, point, found = solved(one)
    e = accuracy.error(problem, point.x, point.Omega)
    periods = int(np.ceil(3 * lasts(one)))
    motions = steady(problem.assembly, one.Omega, ((periods, 256), (periods, 512)), begun(problem.assembly, found, 256))
    coarse, fine = (abs(m.harmonics(m.outputs, 1)[0, 1]) for m in motions)
    own = abs(fine - coarse) / fine + lasts(one) * motions[-1].change
    return abs(abs(found.outputs[0, 1]) - fine) / fine, e.readout * e.amplitude / fine, own


def totalled(seed: int, total: bool) -> Checks:
    """Of a rough system whose first contact has the tangential stiffness in its total form, if ``total``."""
    one = drawn(seed)
    made = assembly(one)
    first, right = made.contacts[0], made.contacts[0].patch.law
    wrong = Printed(right.normal, right.friction, right.stiffness_1) if total else right
    changed = replace(first, patch=replace(first.patch, law=wrong))
    return solved(one, replace(made, contacts=(changed, *made.contacts[1:])))[2].checks

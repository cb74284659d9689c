"""A diagram: equilibria over the parameter, the orbits born on them, and those born on these, branch by branch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..continuation import Lost, Scaled, Settings, advance, newton, start, switched
from ..continuation.curve import State
from ..data import Array
from ..errors import UserError
from ..process import prepare
from ..progress import Report
from ..units import counted
from . import deflation, equilibria, flow, orbits
from .basin import Attractor, attractors
from .branches import EQUILIBRIA, Collected, DiagramBranch, draw, joined, of_orbits
from .dynamics import Dynamics
from .equilibria import Hopf
from .shooting import PeriodicOrbit, Shooting

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Kept = Callable[[str], DiagramBranch | None]
"""A finished branch of a name, if there is one."""


@dataclass(frozen=True)
class DiagramPlan:
    """What a diagram is to show, see the keys of `verbs.bifurcation`."""

    start: float
    stop: float
    orbits: bool = True
    doublings: int = 1
    nodes: int = 32
    step: float = 0.08
    points: int = 400
    attractors: tuple[float, ...] = ()
    starts: int = 64
    seed: int = 0
    deflate: tuple[float, ...] = ()
    branches: int = 0

    @property
    def settings(self) -> Settings:
        low, high = sorted((self.start, self.stop))
        step = min(0.02, self.step)
        return Settings(
            direction=1 if self.stop > self.start else -1, low=low, high=high, points=self.points, step=step,
            step_max=self.step,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Diagram(Collected):
    """Branches over a parameter.

    Attributes:
        system. branches. hopf: the Hopf points. attractors: what motions from many starts came to. deflated: periodic
            orbits that deflation found beside these. messages: what a reader must know.
    """

    system: Dynamics
    branches: tuple[DiagramBranch, ...]
    hopf: tuple[Hopf, ...]
    attractors: tuple[Attractor, ...] = ()
    deflated: tuple[orbits.OrbitPoint, ...] = ()
    messages: tuple[str, ...] = ()

    def __repr__(self) -> str:
        branches = "; ".join(f"{b.name}: {counted(len(b), 'point')}" for b in self.branches)
        return f"<Diagram: {counted(len(self.hopf), 'Hopf point')}; {'; '.join([branches, *self.messages])}>"

    def plot(self, axes: Axes, label: str = "parameter", read_out: int = 0) -> None:
        """Half of the way from the smallest to the largest value of a read-out, in matplotlib's axes."""
        dots = [(a.orbit.p, float(a.swing[read_out])) for a in self.attractors]
        draw(self.branches, dots, axes, label, read_out)


@dataclass(eq=False)
class _DiagramWork:
    """A diagram on its way."""

    system: Dynamics
    asked: DiagramPlan
    kept: Kept
    keep: Callable[[DiagramBranch], None]
    report: Report
    found: list[DiagramBranch] = field(default_factory=list)
    seen: list[Attractor] = field(default_factory=list)
    deflated: list[orbits.OrbitPoint] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)

    def add(self, name: str, make: Callable[[], DiagramBranch]) -> DiagramBranch:
        """A branch, from where it is kept or made now."""
        branch = self.kept(name)
        if branch is None:
            self.report(name)
            branch = make()
            self.keep(branch)
        if branch.lost:
            where = f" at {branch.parameter[-1]:.6g}" if len(branch) else ""
            self.messages.append(f"{name}: ends{where}: {branch.ended}")
        self.found.append(branch)
        return branch


def diagram(
    system: Dynamics, x: Array, asked: DiagramPlan, kept: Kept = lambda _: None,
    keep: Callable[[DiagramBranch], None] = lambda _: None, report: Report = lambda _: None,
) -> Diagram:  # fmt: skip
    """Equilibria from x (n,) at the start, orbits from every Hopf point, doubled ones from every period doubling that
    changes stability. Of a driven system: what a motion from x comes to, and what is doubled from there.

    A branch that cannot be followed ends where it is, and the rest goes on.

    Args:
        kept, keep: finished branches of an interrupted run. report: is told what is under way.

    Raises:
        UserError: there is no equilibrium, or no orbit of a driven system, near x.
    """
    prepare()
    work = _DiagramWork(system, asked, kept, keep, report)
    points: tuple[Hopf, ...] = ()
    if system.frequency is not None:
        _doublings(work, work.add(DRIVEN, lambda: _driven(work, x)), asked.doublings)
        for p in asked.deflate:
            _beside(work, p, [np.asarray(x, dtype=float)])
    else:
        still = work.add(EQUILIBRIA, lambda: _equilibria(system, x, asked))
        _branched(work, still, asked.branches)
        for branch in [b for b in work.found if b.still]:
            begun = tuple(_hopf(system, branch, i) for i in branch.of_kind("Hopf"))
            points += begun
            if asked.orbits:
                _orbits(work, branch, begun)
    for branch in [b for b in work.found if not b.still]:
        _branched(work, branch, asked.branches)
    return Diagram(system, tuple(work.found), points, tuple(work.seen), tuple(work.deflated), tuple(work.messages))


def _branched(work: _DiagramWork, parent: DiagramBranch, levels: int) -> None:
    """The branches that cross one of equilibria or orbits at its branch points, and those that cross these."""
    system, settings = work.system, work.asked.settings
    for number, i in enumerate(parent.of_kind("branch point") if levels else [], 1):
        near = [int(np.clip(j, 0, len(parent) - 1)) for j in (i - 1, i, i + 1)]
        if parent.still:
            before, x, after = (parent.x[j, 0] for j in near)
            problem: equilibria.Still | Shooting = equilibria.Still(system)
        else:
            problem = Shooting(system, parent.orbit(system, int(i)), float(parent.period[i]))
            before, x, after = (problem.unknowns(parent.orbit(system, j)) for j in near)
        ahead = after - before, float(parent.parameter[near[2]] - parent.parameter[near[0]])
        states = switched(problem, x, float(parent.parameter[i]), ahead, settings)
        name, born = f"{parent.name} branched {number}", f"branch point at {parent.parameter[i]:.6g} of {parent.name}"

        def make(
            name: str = name, born: str = born, problem: equilibria.Still | Shooting = problem,
            states: list[State] = states,
        ) -> DiagramBranch:  # fmt: skip
            if isinstance(problem, Shooting):
                ways = [followed(name, born, problem, state, settings, work.report) for state in states]
            else:
                ways = [_still(system, name, born, state, settings) for state in states]
            return joined(ways[1], ways[0]) if len(ways) > 1 else ways[0]

        if states and not any(_same(states[0], problem, other, work) for other in work.found if other is not parent):
            _branched(work, work.add(name, make), levels - 1)


def _same(state: State, problem: equilibria.Still | Shooting, branch: DiagramBranch, work: _DiagramWork) -> bool:
    """Whether a known branch passes where another one begins."""
    point = state.found[0]
    if isinstance(problem, Shooting):
        return _passes(branch, problem.orbit(point.x, point.lam))
    if not branch.still:
        return False
    away = np.abs((branch.x[:, 0] - point.x) / work.system.scale).max(axis=1)
    return bool((away + np.abs(branch.parameter - point.lam) / work.system.parameter_scale).min() < 1e-3)


def _orbits(work: _DiagramWork, still: DiagramBranch, points: Sequence[Hopf]) -> None:
    """The branches of orbits of a free system."""
    for i, point in enumerate(points, 1):
        if not _is_known(work, point):
            _born_at(work, f"orbits {i}", point)
    for p in work.asked.attractors:
        _coexisting(work, still, p)
    for p in work.asked.deflate:
        _beside(work, p, _resting(work, still, p))


DRIVEN = "driven"
"""Name of the branch of a driven system."""

LEFT = 60
"""Periods that a driven motion is left alone before an orbit is looked for where it is."""


def _driven(work: _DiagramWork, x: Array) -> DiagramBranch:
    """The orbits of the period of what drives, from where a motion from x is after `LEFT` of them."""
    system, asked = work.system, work.asked
    assert system.frequency is not None
    period = 2 * np.pi / float(system.frequency(asked.start))
    left = np.asarray(flow.left_alone(system)(np.asarray(x, dtype=float)[None], asked.start, LEFT * period, 0.0))
    nodes = [left[0]]
    for i in range(asked.nodes - 1):
        run, angle = flow.left_alone(system), 2 * np.pi * i / asked.nodes
        nodes.append(np.asarray(run(nodes[-1][None], asked.start, period / asked.nodes, angle))[0])
    problem = Shooting(system, PeriodicOrbit(system, np.array(nodes), period, asked.start), period)
    status = "it becomes infinite"
    if np.isfinite(nodes).all():
        state = start(problem, np.array(nodes).ravel(), asked.start, asked.settings)
        status = state.status
    if status:
        raise UserError(
            f"no periodic motion is found near the start: {status}; begin at a value of the parameter where the "
            "motion is small or settles, or give another x"
        )
    return followed(DRIVEN, "start", problem, state, asked.settings, work.report)


def _coexisting(work: _DiagramWork, still: DiagramBranch, p: float) -> None:
    """The branches of attractors at p that are on none which is known."""
    system, asked = work.system, work.asked
    work.report(f"{asked.starts} motions at {p:.6g}")
    centre = still.x[int(np.argmin(np.abs(still.parameter - p))), 0]
    stable_orbits = attractors(system, centre, p, asked.starts, asked.seed, asked.nodes)
    work.seen += stable_orbits
    if (others := asked.starts - round(sum(a.share for a in stable_orbits) * asked.starts)) > 0:
        words = f"of {asked.starts} motions {others} came to rest, or to no periodic motion that was recognised"
        work.messages.append(f"at {p:.6g}: {words}")
    _new_ones(work, "attractor", [a.orbit for a in stable_orbits])


def _beside(work: _DiagramWork, p: float, still: Sequence[Array]) -> None:
    """The branches of orbits that deflation finds at p beside equilibria and attractors, and that are on none which is
    known."""
    known = [a.orbit for a in work.seen if a.orbit.p == p]
    points = deflation.coexisting(work.system, p, still, known, work.asked.nodes, work.report)
    work.deflated += points
    _new_ones(work, "orbit", [point.orbit for point in points])


def _resting(work: _DiagramWork, still: DiagramBranch, p: float) -> list[Array]:
    """The equilibria (n,) at p."""
    x, away = still.x[:, 0], still.parameter - p
    near = np.flatnonzero(away[:-1] * away[1:] <= 0)
    solutions = [newton(equilibria.Still(work.system), x[i], p) for i in near]
    unlike: list[Array] = []
    for x_new in (s.x for s in solutions if s.converged):
        if all(np.abs((x_new - y) / work.system.scale).max() > deflation.NEAR for y in unlike):
            unlike.append(x_new)
    return unlike


def _new_ones(work: _DiagramWork, what: str, found: Sequence[PeriodicOrbit]) -> None:
    """Branches through orbits that are on none which is known."""
    for number, orbit in enumerate(found, 1):
        if not any(_passes(b, orbit) for b in work.found):
            name = f"{what} {number} at {orbit.p:.6g}"
            branch = work.add(
                name, partial(_both_ways, name, f"{what} at {orbit.p:.6g}", orbit, work.asked, work.report)
            )
            _doublings(work, branch, work.asked.doublings)


def _passes(branch: DiagramBranch, orbit: PeriodicOrbit) -> bool:
    """Whether a branch passes an orbit, by its period, or twice that, and extremes between two neighbouring points."""
    if branch.still:
        return False
    y = orbit.system.seen(orbit.sampled(), orbit.p)
    extremes_of = np.concatenate([y.max(axis=0), y.min(axis=0)])
    size = float(np.ptp(y, axis=0).max())
    away = branch.parameter - orbit.p
    for i in np.flatnonzero(away[:-1] * away[1:] <= 0):
        u = away[i] / (away[i] - away[i + 1]) if away[i] != away[i + 1] else 0.0
        period = (1 - u) * branch.period[i] + u * branch.period[i + 1]
        ends = np.concatenate([branch.largest, branch.smallest], axis=1)
        apart = np.abs((1 - u) * ends[i] + u * ends[i + 1] - extremes_of).max() / size
        if abs(period / orbit.period - 1) < CLOSE and apart < CLOSE:
            return True
    return False


CLOSE = 0.02
"""Difference of periods and extremes, over their sizes, up to which an orbit is on a branch."""


def _both_ways(name: str, born: str, orbit: PeriodicOrbit, asked: DiagramPlan, report: Report) -> DiagramBranch:
    """The branch through an orbit, to both sides."""
    problem = Shooting(orbit.system, orbit, orbit.period)
    parts = []
    for way in (-1, 1):
        settings = replace(asked.settings, direction=way)
        state = start(problem, problem.unknowns(orbit), orbit.p, settings)
        parts.append(followed(name, born, problem, state, settings, report))
    return joined(*parts)


def _equilibria(system: Dynamics, x: Array, asked: DiagramPlan) -> DiagramBranch:
    settings, problem = asked.settings, equilibria.Still(system)
    state = start(problem, x, asked.start, settings)
    if state.status:
        raise UserError(
            f"no equilibrium is found near the start: {state.status}; begin at another value of the parameter, or give "
            "another x"
        )
    return _still(system, EQUILIBRIA, "the start", state, settings)


def _still(system: Dynamics, name: str, born: str, state: State, settings: Settings) -> DiagramBranch:
    """A branch of equilibria from its first state to its end."""
    problem = equilibria.Still(system)
    rows: list[tuple[Array, float, str]] = [(p.x, p.lam, p.kind) for p in state.found]
    while not state.status:
        before, state = state, advance(problem, state, settings)
        new: list[tuple[Array, float, str]] = [(p.x, p.lam, p.kind) for p in state.found]
        passed = equilibria.hopf_between(system, before, state, settings)
        new += [(h.x, h.p, "Hopf") for h in passed if settings.low <= h.p <= settings.high]
        rows += sorted(new, key=lambda r: _ahead(system, before, r[0], r[1]))
    X, P = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
    values = np.array([equilibria.eigenvalues(system, a, b) for a, b in zip(X, P, strict=True)])
    seen = np.array([system.seen(a, b) for a, b in zip(X, P, strict=True)])
    return DiagramBranch(
        name, born, state.status, 1, system.named, P, np.full(len(P), np.nan), X[:, None], seen, seen,
        values, values.real.max(axis=1) <= 0, np.array([r[2] for r in rows]),
        system.units,
    )  # fmt: skip


def _ahead(system: Dynamics, state: State, x: Array, p: float) -> float:
    """How far along the tangent of a state."""
    return float(state.tangent @ (Scaled(equilibria.Still(system)).pack(x, p) - state.y))


def _hopf(system: Dynamics, still: DiagramBranch, i: int) -> Hopf:
    """The Hopf point of a branch; of several at one place each has a pair of its own."""
    rows = still.of_kind("Hopf")
    place = np.column_stack([still.x[rows, 0] / system.scale, still.parameter[rows] / system.parameter_scale])
    here = rows[np.abs(place - place[rows == i]).max(axis=1) < equilibria.NEAR]
    pairs = still.multipliers[i][still.multipliers[i].imag > 0]
    crossing = np.sort(pairs[np.argsort(np.abs(pairs.real), kind="stable")[: len(here)]].imag)
    omega = crossing[np.flatnonzero(here == i)[0]]
    return equilibria.hopf(system, still.x[i, 0], float(still.parameter[i]), float(omega))


def _is_known(work: _DiagramWork, point: Hopf) -> bool:
    """Whether a branch of orbits has ended at the Hopf point."""
    ends = [b for b in work.found if not b.still and b.ended == orbits.COLLAPSED]
    return any(abs(b.parameter[-1] - point.p) < 1e-2 * work.system.parameter_scale
               and abs(b.period[-1] * point.omega / (2 * np.pi) - 1) < 1e-2 for b in ends)  # fmt: skip


def _born_at(work: _DiagramWork, name: str, point: Hopf) -> None:
    def make() -> DiagramBranch:
        begun = orbits.born_at(work.system, point, work.asked.nodes, work.asked.settings)
        return followed(name, f"Hopf point at {point.p:.6g}", *begun, work.asked.settings, work.report)

    _doublings(work, work.add(name, make), work.asked.doublings)


def _doublings(work: _DiagramWork, parent: DiagramBranch, levels: int) -> None:
    """The orbits of twice the period at every period doubling by which a branch gains or loses its stability, and so
    on: those of orbits that are unstable on both sides are left, they are many and nothing comes to them."""
    places = [i for i in parent.of_kind("period doubling") if parent.stable[max(i - 1, 0) : i + 2 : 2].any()]
    for number, i in enumerate(places if levels else [], 1):
        orbit = parent.orbit(work.system, int(i))
        if any(is_same(orbit, b, work.system) for b in work.found if b.x.shape[1] == 2 * parent.x.shape[1]):
            continue
        name = f"{parent.name} doubled {number}"
        born = f"period doubling at {orbit.p:.6g} of {parent.name}"

        def make(name: str = name, born: str = born, orbit: PeriodicOrbit = orbit) -> DiagramBranch:
            begun = orbits.doubled_at(orbit, work.asked.settings)
            return followed(name, born, *begun, work.asked.settings, work.report)

        _doublings(work, work.add(name, make), levels - 1)


def is_same(orbit: PeriodicOrbit, branch: DiagramBranch, system: Dynamics) -> bool:
    """Whether a branch of orbits of twice the period ends at an orbit."""
    if branch.ended != orbits.COLLAPSED:
        return False
    near = abs(branch.parameter[-1] - orbit.p) < 2e-2 * system.parameter_scale
    return bool(near and abs(branch.period[-1] / (2 * orbit.period) - 1) < 1e-2)


def followed(
    name: str, born: str, problem: Shooting, state: State, settings: Settings, report: Report = lambda _: None
) -> DiagramBranch:  # fmt: skip
    """A branch of orbits to its end."""
    points, ended = list[orbits.OrbitPoint](), ""
    try:
        for more, status in orbits.follow(problem, state, settings):
            points += more
            ended = status
            if points:
                report(f"{name}: {len(points)} of {settings.points} points, {points[-1].orbit.p:.6g}")
    except (Lost, FloatingPointError) as error:
        ended = f"stuck: {error or 'the orbit was lost'}"
    if not points:
        x = problem.reference.x
        at = orbits.OrbitPoint(problem.reference, "start")
        return of_orbits(name, born, ended or f"no start from {len(x)} nodes", [at])
    return of_orbits(name, born, ended, points)

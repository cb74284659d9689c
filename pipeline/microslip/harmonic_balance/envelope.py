"""Resonances over the engine order, and envelopes of responses over ranges of what is not known exactly; vibration
along an engine-order line.

Sextro Figs. 5.5-2 and 5.4-2. Many responses of one system: each starts where one of its neighbours ended. Along an
engine-order line speed and frequency are tied together, f = e n / 60: at every speed the bodies are those of that
speed, contacts are pressed by what presses them there, and the steady loads are that speed's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, Literal

import numpy as np

from ..data import Array, ComplexArray, Indices
from ..errors import UserError
from ..operating.motion import Motion, motion_of
from ..operating.stress import stress_peaks
from ..results.series import of_solutions
from ..system.assembly import Assembly
from ..units import METRES, Quantity
from . import problem as balance
from . import response
from .checkpoint import beside, rectangle
from .problem import Forces, Problem
from .readout import measured
from .reduced import stuck
from .response import HarmonicResponse, Operating, Solved, filled_response, of_points, operating
from .solver import Point, Report, solve

# --- resonance over engine order -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class OverOrders:
    """The largest resonance of every engine order in a band.

    Attributes:
        order: (e,) engine orders. index: (e,) of their waves. frequency: (e,) Hz and amplitude: (e,) m of the first
            read-out; NaN where none is known. stuck: (e,) Hz, the nearest mode with sticking contacts, or NaN. failed:
            (e,) points that did not converge. stress: (e,) Pa, the largest stress amplitude in the band of the body
            that is read, and stressed_at: (e,) Hz where; NaN where no peak or the modal file no stress is known.
            missing: (e,) texts, why no resonance is known (`response.no_resonance`), empty where one is. quantity:
            what is read; m stands for its unit. normal_force: N, or NaN.
    """

    order: Indices
    index: Indices
    frequency: Array
    amplitude: Array
    stuck: Array
    failed: Indices
    stress: Array
    stressed_at: Array
    _: KW_ONLY
    missing: Sequence[str] = ()
    quantity: Quantity = METRES
    normal_force: float = np.nan

    @property
    def lost(self) -> Array:
        """(e,) bool, no resonance was found though the band may hold one."""
        return np.array([why.startswith(response.NOT_FOUND) for why in self.missing], dtype=bool)

    def columns(self) -> dict[str, Array]:
        """Name -> column, for a table."""
        table = {
            "engine_order": self.order.astype(float),
            "wave": self.index.astype(float),
            "resonance_Hz": self.frequency,
            self.quantity.column("amplitude"): self.amplitude,
            "stuck_Hz": self.stuck,
            "failed_points": self.failed.astype(float),
        }
        if any(self.missing):
            table["missing"] = np.array(self.missing)
        if np.isfinite(self.stress).any():
            table |= {"stress_amplitude_Pa": self.stress, "frequency_of_stress_Hz": self.stressed_at}
        return table


@dataclass(frozen=True)
class Worst:
    """The largest amplitude or stress over the engine orders under a normal force.

    Attributes:
        normal_force: N. value: m or Pa. order: the engine order that has it, at frequency: Hz. known: engine orders
            whose resonance is known, of count; lost: those of which none was found.
    """

    normal_force: float
    value: float
    order: int
    frequency: float
    known: int
    count: int
    lost: int


def worst(one: OverOrders, of: Literal["amplitude", "stress"]) -> Worst | None:
    """The worst engine order under a normal force; None where nothing is known."""
    value, at = (one.amplitude, one.frequency) if of == "amplitude" else (one.stress, one.stressed_at)
    known = np.isfinite(value)
    if not known.any():
        return None
    i = int(np.nanargmax(value))
    counts = int(known.sum()), len(value), int(one.lost.sum())
    return Worst(one.normal_force, float(value[i]), int(one.order[i]), float(at[i]), *counts)


def lowest(rows: Sequence[Worst]) -> Worst:
    """Where the worst is lowest: among the normal forces under which most engine orders are known."""
    most = max(row.known for row in rows)
    return min((row for row in rows if row.known == most), key=lambda row: row.value)


def over_orders(
    build: Callable[[int], Problem], orders: Sequence[int], band: tuple[float, float], points: int = 41,
    report: Report = lambda _: None, under: str = "", keep: Callable[[OverOrders], None] = lambda _: None,
) -> OverOrders:  # fmt: skip
    """The largest resonance of every engine order.

    Args:
        build: engine order -> problem. band: Hz, of the frequency of the order. points: of a sweep over it, beside
            whose tops the peaks are looked for (`response.highest`), round folds too. under: words for the report,
            such as the normal force. keep: is given what there is after every engine order.
    """
    rows, whole = list[tuple[Any, ...]](), OverOrders(*8 * (np.zeros(0, dtype=int),))
    missing: list[str] = []
    for i, e in enumerate(orders):
        report(f"engine order {e}{under}, {i + 1} of {len(orders)}")
        problem = build(int(e))
        top = largest_resonance(problem, np.linspace(*band, points), report)
        f = top.frequency
        modes = stuck(problem.parts[1][0], problem.stiffness[0]) if len(problem.parts[1]) == 1 else np.zeros(0)
        near = modes[np.abs(modes - f).argmin()] if len(modes) and np.isfinite(f) else np.nan
        index, size, stress = problem.assembly.index(1), top.amplitude, (top.stress, top.stressed_at)
        rows.append((int(e), index, f, size, near, top.failed, *stress))
        columns = (np.array(column) for column in zip(*rows, strict=True))
        missing.append(top.missing)
        whole = OverOrders(*columns, missing=tuple(missing), quantity=measured(problem.assembly))
        what = f"{f:.6g} Hz, {whole.quantity.sized(top.amplitude)}"
        what += f", {1e-6 * top.stress:.4g} MPa" if np.isfinite(top.stress) else ""
        report(f"engine order {e}{under}: {top.missing or what}")
        keep(whole)
    return whole


@dataclass(frozen=True)
class Largest:
    """The largest resonance of a band: Hz and m, NaN where none is known; points that did not converge; why none is
    known (`response.no_resonance`), or nothing; the largest stress amplitude (Pa) in the band and its frequency (Hz),
    NaN where it is not known."""

    frequency: float
    amplitude: float
    failed: int
    missing: str = ""
    stress: float = np.nan
    stressed_at: float = np.nan


def largest_resonance(problem: Problem, frequency: Array, report: Report = lambda _: None) -> Largest:
    """The largest resonance of a band, looked for as a response looks for its own, and the largest stress on the
    way."""
    solved: list[Solved] = []
    swept = filled_response(problem, frequency, report, keep=lambda f, one, _: solved.append(one))
    failed = int((~swept.converged).sum())
    report("resonances between the points")
    peaks, folds = response.parted(swept, response.refined_peaks(problem, swept))
    if not peaks:
        return Largest(np.nan, np.nan, failed, response.no_resonance(swept, folds))
    motions = [motion for point, motion in solved if response.judged(point, motion.checks).converged]
    tops = [response.operating(problem, Point(2 * np.pi * p.frequency, p.x)) for p in peaks]
    motion = motion_of_read(problem, [*motions, *tops])
    top = max(peaks, key=lambda peak: peak.amplitude)
    one = Largest(top.frequency, top.amplitude, failed)
    if motion is None:
        return one
    stress = stress_peaks(motion, largest=False).amplitude
    j = int(stress.argmax())
    return replace(one, stress=float(stress[j]), stressed_at=float(motion.Omega[j]) / (2 * np.pi))


def motion_of_read(problem: Problem, found: Sequence[Operating]) -> Motion | None:
    """The motion of the body that the first read-out belongs to, in its modal coordinates; None where its modal file
    holds no stress modes at the nodes."""
    a, H = problem.assembly, range(problem.harmonics + 1)
    body = next(m for m in a.components if m.name == a.outputs[0].component)
    waves = [body.at(a.index(h)) for h in H]
    if not all("nodes" in w.group.stresses for w in waves):
        return None
    q = np.array([rectangle(one.q[body.name]) for one in found])
    forces = np.array([rectangle([beside(problem, body, h, one) for h in H]) for one in found])
    Omega = np.array([one.Omega for one in found])
    return motion_of(Omega, q, [w.group for w in waves], [w.conjugate for w in waves], forces)


# --- envelopes -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Envelope:
    """Smallest and largest amplitude over the combinations of what varies.

    Attributes:
        frequency: (f,) Hz. names: of what varies. values: (c, n) of every combination. monitor: (c, f) complex
            amplitudes of the first read-out, m. converged: (c, f). iterations: (c, f) Newton steps. quantity: what is
            read; m stands for its unit.
    """

    frequency: Array
    names: tuple[str, ...]
    values: Array
    monitor: ComplexArray
    converged: Array
    iterations: Array
    _: KW_ONLY
    quantity: Quantity = METRES

    @property
    def low(self) -> Array:
        """(f,) m; NaN where no combination converged."""
        return self._over(np.fmin)

    @property
    def high(self) -> Array:
        """(f,) m."""
        return self._over(np.fmax)

    def _over(self, pick: np.ufunc) -> Array:
        return pick.reduce(np.where(self.converged, np.abs(self.monitor), np.nan), axis=0)

    @property
    def peaks(self) -> Array:
        """(c,) m, the largest amplitude of every combination on the grid; NaN where no point converged."""
        return np.fmax.reduce(np.where(self.converged, np.abs(self.monitor), np.nan), axis=1)

    def columns(self) -> dict[str, Array]:
        """Name -> column, for a table."""
        name = self.quantity.column
        each = {
            name(f"combination_{i + 1}"): np.where(ok, np.abs(a), np.nan)
            for i, (a, ok) in enumerate(zip(self.monitor, self.converged, strict=True))
        }
        return {"frequency_Hz": self.frequency, name("low"): self.low, name("high"): self.high, **each}

    def corners(self) -> dict[str, Array]:
        """Name -> column of a table of the combinations."""
        named = dict(zip(self.names, self.values.T, strict=True))
        failed = (~self.converged).sum(axis=1).astype(float)
        return {
            "combination": 1.0 + np.arange(len(self.values)),
            **named,
            self.quantity.column("peak"): self.peaks,
            "failed_points": failed,
        }


def envelope(
    build: Callable[..., Problem],
    ranges: Mapping[str, Sequence[float]],
    frequency: Array,
    report: Report = lambda _: None,
    keep: Callable[[Envelope], None] = lambda _: None,
) -> Envelope:
    """Responses at all combinations of given values, and what encloses them.

    The combinations are run through so that neighbours differ in one value; each begins where the last one began. A
    friction-damped amplitude need not rise or fall with the friction all along a range: give values in between where
    its smallest one matters.

    Args:
        build: called with one value of each name -> problem; the same number of unknowns each time. ranges: name ->
            values. frequency: (f,) Hz. keep: is given what there is after every combination.

    Raises:
        UserError: a name without a value.
    """
    empty = [name for name, values in ranges.items() if not len(values)]
    if empty:
        raise UserError(f"envelope: {empty[0]}: give one or more values")
    values = list(_snake([list(v) for v in ranges.values()]))
    rows, start, length = [], None, None
    for i, corner in enumerate(values):
        words = ", ".join(f"{name} {value:g}" for name, value in zip(ranges, corner, strict=True))
        report(f"combination {i + 1} of {len(values)}: {words}")
        problem = build(**dict(zip(ranges, corner, strict=True)))
        length = length or problem.length
        problem = replace(problem, length=length)  # one unit for the unknowns of all combinations
        # Starts from the neighbouring combination at every frequency saved a fifth of Newton's steps and no time.
        swept = response.harmonic_response(problem, frequency, report, start)
        start = swept.x[0] if swept.converged[0] else None
        rows.append((swept.monitor, swept.converged, swept.iterations))
        columns = [np.array(column) for column in zip(*rows, strict=True)]
        done = np.array(values[: i + 1])
        whole = Envelope(np.asarray(frequency), tuple(ranges), done, *columns, quantity=swept.quantity)
        keep(whole)
    return whole


def _snake(values: list[list[float]]) -> Iterator[list[float]]:
    """All combinations, one value changed from one to the next where each list is run through to and fro."""
    if not values:
        yield []
        return
    for i, rest in enumerate(_snake(values[1:])):
        for v in values[0] if i % 2 == 0 else values[0][::-1]:
            yield [v, *rest]


# along an engine-order line ----------------------------------------------------------------------


Build = Callable[[float], Assembly]
"""Rotation speed in rpm -> the assembly at that speed."""


@dataclass(frozen=True)
class SpeedResponse(HarmonicResponse):
    """`HarmonicResponse` along an engine-order line.

    Attributes:
        rpm: (s,). order: base engine order, of the first harmonic. normal: (s, contacts) mean normal forces, N.
    """

    rpm: Array
    order: int
    normal: Array

    def columns(self) -> dict[str, Array]:
        forces = {f"normal_force_{i + 1}_N": force for i, force in enumerate(self.normal.T)}
        return {"speed_rpm": self.rpm, **super().columns(), **of_solutions(forces, self.converged)}


def frequency(order: int, rpm: Array) -> Array:
    """Hz of an engine order at rotation speeds in rpm."""
    return abs(order) * np.asarray(rpm, dtype=float) / 60


def along(
    build: Build, rpm: Array, order: int | None = None, report: Report = lambda _: None,
    keep: Callable[[SpeedResponse], None] = lambda _: None,
    models: Callable[[Assembly], dict[int, Forces] | None] = lambda _: None, **settings: Any,
) -> SpeedResponse:  # fmt: skip
    """Steady vibration at every speed, each started from the one or two before it.

    Args:
        build: see `Build`; contacts that stay the same keep their `Patch`, so that nothing is compiled twice. rpm: (s,)
            in the order in which they are run through. order: base engine order, of the first harmonic; the ring's if
            None. keep: is given what there is after every speed. models: of an assembly's contacts, see `problem.of`;
            the marched laws if None. settings: others of `problem.of`.

    Raises:
        UserError: no speed, one that is not above 0, no engine order.
    """
    speeds = np.asarray(rpm, dtype=float)
    if not len(speeds) or not (speeds > 0).all():
        raise UserError("speeds: an engine-order line needs one or more speeds in rpm, all above 0")
    motions, normal, done = list[Operating](), [], list[Point]()
    for i, n in enumerate(speeds):
        assembly = build(float(n))
        problem = balance.of(assembly, models=models(assembly), **settings)
        settings.setdefault("length", problem.length)  # one unit for the unknowns of all speeds
        base = _order(problem.assembly, order)
        f = float(frequency(base, n))
        done.append(solve(problem, 2 * np.pi * f, _starts(done, f)))
        motions.append(operating(problem, done[-1]))
        normal.append([float(F[0, 0]) for F in motions[-1].force.values()])
        words = "" if done[-1].converged else ", not converged"
        report(f"{i + 1} of {len(speeds)} speeds: {n:.6g} rpm, {f:.6g} Hz{words}")
        responded = of_points(problem, done, motions)
        whole = SpeedResponse(**vars(responded), rpm=speeds[: i + 1], order=base, normal=np.array(normal))
        keep(whole)
    return whole


def _order(assembly: Assembly, order: int | None) -> int:
    if order is None and assembly.ring is None:
        raise UserError("engine order: the bodies stand in no ring, which would tell it; give one")
    base = abs(assembly.ring.order if order is None and assembly.ring else order or 0)
    if not base:
        raise UserError("engine order: 0 is steady; an engine-order line needs one that vibrates")
    return base


def _starts(done: list[Point], f: float) -> list[Array]:
    good = [p for p in done[-2:] if p.converged]
    if len(good) < 2 or good[0].Omega == good[1].Omega:
        return [p.x for p in good[-1:]]
    a, b = good
    share = (2 * np.pi * f - b.Omega) / (b.Omega - a.Omega)
    return [b.x + share * (b.x - a.x), b.x]

"""Damped nonlinear modes: frequency and damping ratio of an assembly with contacts over the amplitude.

A periodic motion of the undriven assembly needs something that feeds its losses. The extended periodic motion concept
(M. Krack, Computers & Structures 154, 2015) takes a force in phase with the speed of every mass,

    M q'' + (C - xi M) q' + K q + T^T F(T q) = 0,

whose xi makes the motion periodic: with xi = 2 zeta omega the mode's damping ratio zeta at that amplitude. It is exact
for one degree of freedom in resonance and for a mode that keeps its shape. Small motions are the modes with sticking
contacts, large ones those with contacts that slide freely.

Unknown are the contact displacements over the amplitude, omega and xi; the logarithm of the amplitude is the parameter
that `continuation` changes. The amplitude is that of a read-out's first harmonic, which vanishes where another mode
takes over in an internal resonance, or the size of the whole motion,

    A^2 = sum of q_h^H G_h q_h over all harmonics,   Im sum of h r_h^H M q_h = 0,

with G_h = M (norm), (h omega)^2 M (energy) or M phi (M phi)^H (modal amplitude), scaled so that it is the read-out's
amplitude in the linear mode. The second equation chooses the phase that is nearest to that of the last point r.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy.linalg

from ..continuation import Point, Settings, State, follow, start
from ..data import Array, ComplexArray, largest
from ..errors import UserError
from ..results.checks import Checks
from ..results.files import Response, write_response
from ..results.series import Series, of_solutions
from ..system import assembly
from ..system.assembly import Linear
from ..units import METRES, Quantity, counted
from .accuracy import Error, Reading, changed
from .checks import checks
from .families import along
from .problem import AtFrequency, Problem
from .readout import amplitude, measured, weighted
from .reduced import untouched
from .response import Operating, operating
from .solver import CONVERGED, Report, resting
from .solver import Point as Solved

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OVER_AMPLITUDE = "amplitude"
"""What the series of a nonlinear mode runs over in its file."""
REACHED = "all amplitudes were reached"
"""Why a nonlinear mode ends that is complete."""

BEYOND = 100.0
"""Logarithm of an amplitude in m, either way, that a step of the corrector may lead to and no motion has."""

RIGID = 1e-6
"""Frequency over the highest one below which a mode is the motion of a body that nothing holds: rounding."""

HELD = 2.0
"""Stiffness that is taken into the bodies, over that of the sticking contact: with more than any motion has the body
is never in resonance by itself, which it would be with that of the sticking contact in small motions."""


Measure = Literal["readout", "norm", "energy", "modal"]
"""What a nonlinear mode runs over: see the top."""

SHARED = 0.25
"""Share of the kinetic energy from which on a higher harmonic is another mode in an internal resonance."""

FELT = 1e-10
"""Share of the kinetic energy below which a harmonic is not in the motion at all."""

NEAR = 0.03
"""Relative difference of frequencies within which one counts as near another."""


@dataclass(frozen=True, repr=False)
class Backbone:
    """A nonlinear mode.

    Attributes:
        amplitude: (k,) of the read-out's first harmonic, in the unit of `quantity`. Omega: (k,) rad/s.
            damping: (k,) ratio.
        x: (k, size), see `Problem`. stuck: rad/s, with sticking contacts. status: why it ended. checks: of its points
            (`results.checks`), of which the force that feeds the losses is the load. quantity: what the read-out
            measures. kinetic: (k, H) J, largest kinetic energy of every harmonic. passed: internal resonances that
            no motion of the curve enters, in words.
    """

    amplitude: Array
    Omega: Array
    damping: Array
    x: Array
    stuck: float
    status: str
    checks: tuple[Checks, ...]
    quantity: Quantity = METRES
    kinetic: Array | None = None
    passed: tuple[str, ...] = ()

    @property
    def frequency(self) -> Array:
        """(k,) Hz."""
        return self.Omega / (2 * np.pi)

    @property
    def energy(self) -> Array:
        """(k,) J, twice the mean kinetic energy: of a linear motion all of its energy. nan where it is not known."""
        return np.full(len(self.Omega), np.nan) if self.kinetic is None else self.kinetic.sum(axis=1)

    @property
    def resonances(self) -> list[tuple[int, float, float]]:
        """Internal resonances that the curve enters: the harmonic in which another mode moves, Hz, and the share of the
        kinetic energy that it has there at most."""
        if self.kinetic is None:
            return []
        found, share = [], self.kinetic / self.kinetic.sum(axis=1, keepdims=True)
        for h in range(1, share.shape[1]):
            entered = np.flatnonzero(share[:, h] > SHARED)
            for run in np.split(entered, np.flatnonzero(np.diff(entered) > 1) + 1) if len(entered) else ():
                top = run[share[run, h].argmax()]
                found.append((h + 1, float(self.frequency[top]), float(share[top, h])))
        return found

    def columns(self) -> dict[str, Array]:
        """Heading -> (k,) numbers; nan where a motion fails its checks."""
        column, table = self.quantity.column("amplitude"), {"frequency_Hz": self.frequency}
        passed = np.array([not c.failure for c in self.checks], dtype=bool)
        return {column: self.amplitude, **of_solutions({**table, "damping_ratio": self.damping}, passed)}

    def to_dataframe(self) -> Any:
        """The table of `columns` as a `pandas.DataFrame`."""
        import pandas

        return pandas.DataFrame(self.columns())

    def to_xarray(self) -> Any:
        """Frequency and damping ratio as an `xarray.Dataset` over the amplitude."""
        import xarray

        table = {"frequency": (self.frequency, "Hz"), "damping_ratio": (self.damping, "1")}
        if self.kinetic is not None:
            table["energy"] = self.energy, "J"
        variables = {name: ("amplitude", values, {"units": unit}) for name, (values, unit) in table.items()}
        amplitude = ("amplitude", self.amplitude, {"units": self.quantity.unit})
        return xarray.Dataset(variables, coords={"amplitude": amplitude})

    def plot(self, axes: Axes | None = None, over: Literal["amplitude", "energy"] = "amplitude", **line: Any) -> Axes:
        """Draw the frequency over the amplitude or the energy. Returns the axes, new ones if none are given."""
        if axes is None:
            import matplotlib.pyplot as plt

            axes = plt.subplots(layout="constrained")[1]
        along = f"amplitude in {self.quantity.said}" if over == "amplitude" else "energy in J"
        axes.semilogx(self.amplitude if over == "amplitude" else self.energy, self.frequency, **line)
        axes.set_xlabel(along)
        axes.set_ylabel("frequency in Hz")
        return axes

    def __repr__(self) -> str:
        if not len(self.amplitude):
            return f"<Backbone: no points; {self.status}>"
        f, a, d = (f"{v[0]:.5g} to {v[-1]:.5g}" for v in (self.frequency, self.amplitude, self.damping))
        damped = f"damping ratio {d}, at most {self.damping.max():.3g}"
        entered = [f"internal resonance 1:{h} at {f:.5g} Hz (harmonic {h} has {s:.0%})" for h, f, s in self.resonances]
        ended = "; ".join(filter(None, [self.failing, *entered[:3], *self.passed[:1], self.status]))
        return f"<Backbone: {len(self.Omega)} points, {a} {self.quantity.said}, {f} Hz, {damped}; {ended}>"

    def save(self, path: Path | str) -> Path:
        """Write a response file (``docs/response_file.md``), complete or absent; `load` reads it.

        Raises:
            UserError: a file that is no response stands there.
        """
        arrays = {"frequency": self.frequency, "parameter": self.amplitude, "damping_ratio": self.damping, "x": self.x}
        if self.kinetic is not None:
            arrays["kinetic"] = self.kinetic
        arrays |= {f"checks/{n.name}": np.array([getattr(c, n.name) for c in self.checks]) for n in fields(Checks)}
        status = tuple(c.failure or CONVERGED for c in self.checks)
        labels = {"parameter": (self.quantity.unit,)}
        parameters = {"stuck": self.stuck}
        series = Series("nonlinear mode", parameters, self.amplitude, status, arrays, labels, OVER_AMPLITUDE)
        write_response(path, Response("nonlinear mode", "aft", (series,), description=self.status, labels=labels))
        return Path(path)

    @classmethod
    def of(cls, response: Response) -> Backbone:
        """What `save` wrote."""
        (s,) = response.series
        rows = zip(*(s.arrays[f"checks/{n.name}"].tolist() for n in fields(Checks)), strict=True)
        Omega, damping, x = 2 * np.pi * s.frequency, s.arrays["damping_ratio"], s.arrays["x"]
        return cls(
            s.parameter, Omega, damping, x, s.parameters["stuck"], response.description,
            tuple(Checks(*r) for r in rows), Quantity(response.labels.get("parameter", ("m",))[0]),
            s.arrays.get("kinetic"),
        )  # fmt: skip

    @property
    def complete(self) -> bool:
        """All amplitudes asked for were reached, by motions that pass their checks."""
        return self.status == REACHED and not self.failing

    @property
    def failing(self) -> str:
        """How many motions fail their checks, and why the first of them does; nothing where all pass."""
        why = [c.failure for c in self.checks if c.failure]
        return f"{len(why)} of {counted(len(self.checks), 'point')} fail their checks ({why[0]})" if why else ""


def _in_words(status: str, points: Sequence[Point], low: float, high: float, of: Quantity) -> str:
    """Why a curve between two amplitudes ended, without the logarithm that it runs over."""
    if status.startswith("points"):
        return f"{len(points)} points do not reach {high:.4g} {of.said}; take a lower high, or allow more points"
    if not status.startswith("bound"):
        return status
    back = f"it came back to {low:.4g} {of.said} without reaching {high:.4g} {of.said}; take another low"
    return REACHED if points[-1].lam > np.log(low) else back


def stuck_modes(problem: Problem) -> tuple[Array, Array]:
    """(m,) rad/s and (m, m) shapes, columns, with sticking contacts, in the wave of the first harmonic.

    Raises:
        UserError: the problem eliminates its bodies one by one.
    """
    part, k = _only(problem), problem.stiffness[0]
    values, shapes = assembly.stuck_modes(part, k)
    return np.sqrt(np.maximum(values, 0.0)), shapes


def _only(problem: Problem) -> Linear:
    if len(problem.parts[1]) != 1:
        raise UserError('nonlinear modes: take the form "relative", in which all bodies are eliminated together')
    return problem.parts[1][0]


SETTINGS = Settings(step=0.05, step_max=0.2, resolution=1e-4, folds=False, branch_points=False)
"""Contacts of many points have a kink at every sample of each of them: these are located to 1e-4."""


def backbone(
    problem: Problem, low: float, high: float, mode: int = 0, output: int = 0, asked: Sequence[float] = (),
    settings: Settings | Mapping[str, Any] | None = None, report: Report = lambda _: None,
    measure: Measure = "readout",
) -> Backbone:  # fmt: skip
    """A nonlinear mode from a small amplitude of a read-out to a large one.

    Args:
        low, high: m, or J of the energy; at the low one the contacts should hardly slide. mode: number of the
            mode with sticking contacts, 0 the lowest. output: read-out. asked: amplitudes hit exactly. measure: what
            low, high and asked are values of.

    Raises:
        UserError: a mode that does not move the read-out or the contacts, or that there is not.
        NotConverged: no state of rest under the steady loads is found.
    """
    problem, rest = about_rest(problem)
    curve, z, omega = _Curve.of(problem, mode, output, measure, rest)
    low, high, *asked = (curve.amplitude_of(value) for value in (low, high, *asked))
    bounds = np.log([low, high])
    settings = replace(
        along(SETTINGS, settings), low=float(bounds[0]) - 1e-9, high=float(bounds[1]), targets=tuple(np.log(asked))
    )
    points, quantity = list[Point](), measured(problem.assembly, output)
    for state in follow(curve, curve.begun(z, rest, float(bounds[0]), settings), settings):
        points += state.found
        if points:
            curve.refer(points[-1])
            share = int(100 * min((points[-1].lam - bounds[0]) / (bounds[1] - bounds[0]), 1.0))
            report(f"{share} of 100 % of the amplitudes: {quantity.sized(np.exp(points[-1].lam))}")
    A = np.exp([p.lam for p in points])
    Omega, xi = (np.array([p.x[i] for p in points]) for i in (-2, -1))
    x = np.array([p.x[:-2] * curve.units(a)[0] for p, a in zip(points, A, strict=True)]).reshape(len(A), len(z) - 2)
    moves = [curve.motion(*one) for one in zip(x, Omega, xi, strict=True)]
    status = _in_words(state.status, points, low, high, quantity)
    if measure != "readout":
        A = np.array([abs(m.outputs[output, 1]) for m in moves])
    kinetic = np.array([curve.kinetic(m) for m in moves]).reshape(len(A), problem.harmonics)
    passed = curve.passed(x, Omega, kinetic / kinetic.sum(axis=1, keepdims=True)) if len(A) else ()
    return Backbone(
        A, Omega, xi / (2 * Omega) if len(A) else xi, x, omega, status, tuple(m.checks for m in moves), quantity,
        kinetic, passed,
    )  # fmt: skip


def motion(problem: Problem, found: Backbone, at: int) -> tuple[Problem, Solved]:
    """The balance that point number `at` of a nonlinear mode solves, fed as it is there, and its solution."""
    Omega, xi = float(found.Omega[at]), float(2 * found.damping[at] * found.Omega[at])
    curve = _Curve(replace(about_rest(problem)[0], share=0.0), 0)
    return curve._fed(xi), Solved(Omega, found.x[at])


def about_rest(problem: Problem) -> tuple[Problem, Array]:
    """The balance whose contacts stick as they do where the steady loads press them, and x (size,) there.

    Raises:
        NotConverged: no state of rest is found.
    """
    Omega = problem.lam_scale  # any: nothing vibrates
    x = resting(problem, Omega).x
    if not x.any() or len(problem.slices) > 1:
        return problem, x
    return replace(problem, stiffness=(_linearised(problem, x, Omega)[0],)), x


def _linearised(problem: Problem, x: Array, Omega: float) -> tuple[Array, Array]:
    """(c, c) stiffness and damping of the contacts in small vibrations about x (size,) at Omega (rad/s)."""
    k, c = np.zeros((2, problem.count, problem.count))
    for g, S in zip(problem.groups, problem.loaded(0.0).at(Omega).slopes(x, True), strict=True):
        for own, slope in zip(g.first, S, strict=True):
            k[np.ix_(own, own)], c[np.ix_(own, own)] = slope[:, 1, :, 1], slope[:, 1, :, 2] / Omega
    return 0.5 * (k + k.T), 0.5 * (c + c.T)


def _braked(part: Linear, k: Array, C: Array, Omega: float, q: ComplexArray) -> tuple[float, float, ComplexArray]:
    """Frequency (rad/s), xi (1/s) and shape (m,) of the mode of (K + k + i Omega C) q = (Omega^2 + i Omega xi) M q
    that an undamped one becomes while the damping grows from nothing."""
    K = part.K + part.rows.conj().T @ k @ np.linalg.inv(np.eye(part.count) + part.residual @ k) @ part.rows
    xi = 0.0
    for share in np.linspace(0.0, 1.0, 41)[1:] ** 2:
        for _ in range(20):
            values, shapes = scipy.linalg.eig(K + 1j * share * Omega * C, part.M)
            shapes = shapes / np.sqrt(np.einsum("im,ij,jm->m", shapes.conj(), part.M, shapes).real)
            i = int(np.abs(shapes.conj().T @ part.M @ q).argmax())
            before, Omega = Omega, float(np.sqrt(max(values[i].real, 1e-12 * Omega**2)))
            if abs(Omega - before) <= 1e-10 * Omega:
                break
        xi, q = float(values[i].imag / Omega), shapes[:, i] * np.exp(-1j * np.angle(shapes[:, i].conj() @ part.M @ q))
    return Omega, xi, q


def strongest(problem: Problem, low: float, high: float) -> int:
    """Number of the mode with sticking contacts that makes the highest resonance of the first read-out, among those
    between two frequencies (rad/s), or among all if there is none.

    With (w phi)(phi^H f) / (phi^H C phi omega) as the height of each.
    """
    part, (omega, shapes) = _only(problem), stuck_modes(problem)
    seen, driven = np.abs(part.output[0] @ shapes), np.abs(shapes.conj().T @ part.load)
    loss = np.einsum("im,ij,jm->m", shapes.conj(), 0.5 * (part.C + part.C.conj().T), shapes).real * omega
    if part.loss is not None:
        loss += np.einsum("im,ij,jm->m", shapes.conj(), part.loss, shapes).real
    height = seen * driven / np.maximum(loss, 1e-12 * omega**2)
    inside = (omega >= low) & (omega <= high)
    return int(np.argmax(np.where(inside, height, 0.0) if height[inside].any() else height))


DRIFT = 1e4
"""A mean motion may become as many times as large as the vibration before steps along the curve are shorter for it."""


def _growth(problem: Problem, mode: int) -> Array:
    """(size,) how many times as far the contacts may move when they slide as while they stick.

    Vibrations as far as in the mode without contacts that is most like a mode with sticking ones (in kinetic energy).
    Mean motions as far as the forces of sticking contacts move the bodies without contacts: a damper that hardly
    anything else holds drifts millions of times as far, up to `DRIFT` of which count: its contacts are `DRIFT` times
    as soft here.
    """
    part, k = _only(problem), problem.stiffness[0]
    held, free = (assembly.stuck_modes(*of)[1] for of in ((part, k), (untouched(part), np.zeros((0, 0)))))
    like = int(np.abs(free.conj().T @ part.M @ held[:, mode]).argmax())
    stays = np.linalg.solve(np.eye(part.count) + part.residual @ k, part.rows @ held[:, mode])
    grown = np.full(problem.size, max(1.0, float(np.abs(part.rows @ free[:, like]).max() / np.abs(stays).max())))
    (still,) = problem.parts[0]
    T, soft = still.rows, k / DRIFT
    moved = T @ np.linalg.solve(still.stiff + T.conj().T @ soft @ T, T.conj().T) + still.residual
    grown[: problem.count] *= np.maximum(1.0, np.abs(np.diag(moved @ k)))
    return grown


def sliding_amplitude(problem: Problem, mode: int) -> float:
    """About the amplitude of the first read-out, m, at which the contacts begin to slide in a mode: their largest
    motion is then `Problem.length`."""
    curve = _Curve(problem, 0)
    curve.linear(problem, mode)
    return float(problem.length / curve.x_scale[0])


def error(problem: Problem, found: Backbone, at: int, mode: int = 0) -> Error:
    """Estimated error of the damping ratio of a nonlinear mode's point number `at`, by the mode of the same amplitude
    with more samples and harmonics (see `accuracy.error`). Other arguments: as of `backbone`."""
    problem, rest = about_rest(problem)
    A = float(found.amplitude[at])

    def solved(finer: Problem, x: Array) -> Reading:
        curve = _Curve.of(finer, mode)[0]
        curve.hold(rest)
        known = [found.Omega[at], 2 * found.damping[at] * found.Omega[at]]
        state = start(curve, np.append(x / curve.units(A)[0], known), float(np.log(A)))
        if not state.found:
            return Reading(x, float(found.Omega[at]), np.nan)
        z = state.found[0].x
        return Reading(z[:-2] * curve.units(A)[0], float(z[-2]), float(z[-1] / (2 * z[-2])))

    return changed(problem, Reading(found.x[at], found.Omega[at], found.damping[at]), solved)


class _Curve:
    """The equations of `backbone` for `continuation`: z = (x / `units`, Omega, xi), lambda = ln A."""

    def __init__(self, problem: Problem, output: int, measure: Measure = "readout") -> None:
        self.problem, self.output, self.held, self.measure = problem, output, 0.0, measure
        self.x_scale: Array = np.ones(problem.size + 2)
        self.lam_scale = 1.0
        self.near: list[ComplexArray] = []  # of every harmonic from 1 on, M r_h, see the top
        self.shape, self.stuck = np.zeros(0, complex), 1.0  # of the linear mode with a read-out of 1 m, rad/s

    @classmethod
    def of(
        cls, stuck: Problem, mode: int, output: int = 0, measure: Measure = "readout",
        rest: Array | None = None,
    ) -> tuple[_Curve, Array, float]:
        """The curve of a mode, scaled, with what `linear` gives."""
        stiff = tuple(HELD * k for k in stuck.stiffness)
        curve = cls(replace(stuck, stiffness=stiff, share=0.0), output, measure)
        z, omega = curve.linear(stuck, mode, rest)
        curve.x_scale[:-2] *= _growth(stuck, mode)
        return curve, z, omega

    def amplitude_of(self, value: float) -> float:
        """m of the read-out in the linear mode, where the measure has a value."""
        if self.measure != "energy":
            return value
        return float(np.sqrt(2 * value / (self.shape.conj() @ _only(self.problem).M @ self.shape).real) / self.stuck)

    def refer(self, point: Point) -> None:
        """The phase of later points is the nearest to that of this one."""
        if self.measure != "readout":
            x = point.x[:-2] * self.units(float(np.exp(point.lam)))[0]
            at = self._at(float(point.x[-2]), float(point.x[-1]))
            q = at.modal(x, at.force(x))
            moved = [parts[0].M @ q[h][0] for h, parts in enumerate(self.problem.parts)][1:]
            size = sum(float((own.conj() @ q[h][0]).real) for h, own in enumerate(moved, 1))
            self.near = [own / np.sqrt(size * self.unit) for own in moved]

    def linear(self, stuck: Problem, mode: int, rest: Array | None = None) -> tuple[Array, float]:
        """The mode with sticking contacts as a guess, and its frequency; sets the scales. Of laws that are smooth it is
        that of their linearisation."""
        part, c = _only(stuck), np.zeros((stuck.count, stuck.count))
        if rest is not None:
            k, c = _linearised(stuck, rest, stuck.lam_scale)
            stuck = replace(stuck, stiffness=(k,)) if stuck.smooth else stuck
        omega, shapes = stuck_modes(stuck)
        if not 0 <= mode < len(omega):
            raise UserError(f"mode: number {mode + 1}; there are {len(omega)}, counted from 1")
        k, q = stuck.stiffness[0], shapes[:, mode].astype(complex)
        d = np.linalg.solve(np.eye(part.count) + part.residual @ k, part.rows @ q)
        hertz = omega / 2 / np.pi  # which say the same where modes are counted from 0 and from 1
        at = f"mode: that at {hertz[mode]:.6g} Hz"
        if omega[mode] <= RIGID * omega[-1]:
            lowest = hertz[omega > RIGID * omega[-1]].min(initial=hertz[-1])
            raise UserError(f"{at} is a motion that nothing holds; take that at {lowest:.6g} Hz or a higher one")
        moved, reach = np.abs(d), np.abs(part.rows) @ np.abs(q)
        if not (moved > 1e-9 * reach).any():
            raise UserError(f"{at} does not move the contacts, so it is linear; take another")
        seen = complex(part.output[self.output] @ q - part.output_residual[self.output] @ (k @ d))
        if abs(seen) < 1e-9 * largest(part.output[self.output]) * np.abs(q).max():
            raise UserError(f"{at} does not move the read-out; take another")
        C, Omega = part.viscous(float(omega[mode])), float(omega[mode])
        xi = float((q.conj() @ C @ q).real / (q.conj() @ part.M @ q).real)
        if c.any():
            Omega, xi, q = _braked(part, k, C + part.rows.conj().T @ c @ part.rows, Omega, q)
            d = np.linalg.solve(np.eye(part.count) + part.residual @ (k + 1j * Omega * c), part.rows @ q)
            seen = complex(part.output[self.output] @ q - part.output_residual[self.output] @ (k @ d))
        z = np.zeros((self.problem.coefficients, self.problem.count))
        z[1], z[2] = (d / seen).real, -(d / seen).imag
        z *= self.problem.length / self.problem.scale
        self.shape, self.stuck = q / seen, float(omega[mode])
        first = part.M @ self.shape / self.unit
        self.near = [first * (h == 1) for h in range(1, self.problem.harmonics + 1)]
        self.x_scale[:-2] = np.abs(z).max()
        self.x_scale[-2:] = omega[mode], max(0.1 * omega[mode], abs(xi) * c.any())
        return np.append(z.ravel(), [Omega, xi]), float(omega[mode])

    def begun(self, z: Array, rest: Array, lam: float, settings: Settings) -> State:
        """The first point, from the linear mode about x (size,) at rest, whose mean is there however small the
        amplitude is: `held` is not counted in this."""
        self.hold(rest)
        first, mean = z.copy(), slice(self.problem.count)
        first[mean] = rest[mean] / self.units(np.exp(lam))[0][mean]
        return start(self, first, lam, settings)

    def hold(self, rest: Array) -> None:
        """Set `held` by x (size,) at rest."""
        self.held = largest(rest) * self.problem.length / self.x_scale[0]

    def units(self, A: float) -> tuple[Array, Array]:
        """(n,) of x at an amplitude, and their derivatives by its logarithm: A / length, of the mean not less than of
        what is `held`."""
        unit = np.full(self.problem.size, A / self.problem.length)
        rate, mean = unit.copy(), slice(self.problem.count)
        unit[mean] = np.hypot(A, self.held) / self.problem.length
        rate[mean] = unit[mean] * (A / np.hypot(A, self.held)) ** 2
        return unit, rate

    def evaluate(self, z: Array, lam: float) -> tuple[Array, Array, Array]:
        """R over its units, amplitude / A - 1 and the phase, and their derivatives; NaN at amplitudes that no body has,
        and at negative frequencies, the mirror of the curve."""
        if not abs(lam) < BEYOND or not z[-2] > 0:
            n = len(z)
            return np.full(n, np.nan), np.full((n, n), np.nan), np.full(n, np.nan)
        A, Omega, xi = float(np.exp(lam)), float(z[-2]), float(z[-1])
        unit, rate = self.units(A)
        x, at = z[:-2] * unit, self._at(Omega, xi)
        force, slopes = at.forces(x)
        R, (y, by_x, y_rate) = at.residual_of(x, force), self._measured(at, x, force, slopes)
        J, by_x, y, y_rate = at.jacobian(slopes).dense(), by_x * unit / A, y / A, y_rate / A
        sides = [self._given(self._at(Omega, xi + way * 1e-6 * Omega), x, force, slopes) for way in (1.0, -1.0)]
        R_xi, y_xi = ((a - b) / (2e-6 * Omega) for a, b in zip(*sides, strict=True))
        n = len(x)
        D = np.zeros((n + 2, n + 2))
        D[:n, :n], D[:n, n], D[:n, n + 1] = J * unit / unit[:, None], at.rate(x, force) / unit, R_xi / unit
        D[n:, :n], D[n:, n], D[n:, n + 1] = by_x, y_rate, y_xi / A
        ahead = z[:-2] * rate / unit
        moved = (J @ (unit * ahead) - R * rate / unit) / unit
        return np.append(R / unit, y - [1.0, 0.0]), D, np.append(moved, by_x @ ahead - y)

    def _given(self, at: AtFrequency, x: Array, force: Array, slopes: list[Array]) -> tuple[Array, Array]:
        """R, and the value of `_measured`."""
        R = at.residual_of(x, force)
        if self.measure == "readout":
            return R, self._measured(at, x, force, slopes)[0]
        rows = self._rows(at, motion := [q for q, *_ in at.modal(x, force)][1:])
        squared, turned = (sum(float((a @ q).real) for a, q in zip(w, motion, strict=True)) for w in rows)
        return R, np.array([np.sqrt(squared / self.unit), turned])

    def _measured(
        self, at: AtFrequency, x: Array, force: Array, slopes: list[Array]
    ) -> tuple[Array, Array, Array]:
        """(2,) the amplitude and what vanishes in the right phase, m; their derivatives by x (2, size) and Omega."""
        if self.measure == "readout":
            y = amplitude(at, x, force, slopes, self.output)
            return _pair(y.value), np.array([y.by_x.real, y.by_x.imag]), _pair(y.rate)
        none = np.zeros(self.problem.count, complex)
        moved = [
            [weighted(at, x, force, slopes, h, [(row, none, 0.0)]) for h, row in enumerate(rows, 1)]
            for rows in self._rows(at, [q for q, *_ in at.modal(x, force)][1:])
        ]
        value, rate = (np.array([sum(getattr(y, of).real for y in own) for own in moved]) for of in ("value", "rate"))
        by_x = np.array([sum(y.by_x.real for y in own) for own in moved])
        if self.measure == "energy":
            rate[0] += value[0] / at.Omega
        value[0] = np.sqrt(value[0] / self.unit)
        slope = np.array([1 / (value[0] * self.unit) if value[0] else np.inf, 1.0])
        return value, by_x * slope[:, None], rate * slope

    def _rows(self, at: AtFrequency, motion: list[ComplexArray]) -> tuple[list[ComplexArray], list[ComplexArray]]:
        """Of every harmonic from 1 on the rows (m,) whose products with q (m,), real parts summed up, are the squared
        size of the motion and what vanishes in the right phase."""
        sizes, M = [], [parts[0].M for parts in self.problem.parts[1:]]
        for h, (mass, q) in enumerate(zip(M, motion, strict=True), 1):
            row = q.conj() @ mass
            if self.measure == "energy":
                row = row * (h * at.Omega / self.stuck) ** 2
            elif self.measure == "modal":
                mode = self.shape.conj() @ mass
                row = (mode @ q).conj() * mode / self.unit
            sizes.append(row)
        return sizes, [-1j * h * near.conj() for h, near in enumerate(self.near, 1)]

    @cached_property
    def unit(self) -> float:
        """kg, of the linear mode: of the norm squared for a read-out of 1 m."""
        return float((self.shape.conj() @ _only(self.problem).M @ self.shape).real)

    def motion(self, x: Array, Omega: float, xi: float) -> Operating:
        """Of a point of the mode, with its checks: the force that feeds the losses supplies xi v . M v."""
        fed = self._fed(xi)
        motion = operating(fed, Solved(Omega, x))
        supplied = 2 * np.pi * xi * motion.kinetic / Omega  # J per cycle; its share of `damped` is taken back
        judged = replace(motion, supplied=motion.supplied + supplied, damped=motion.damped + supplied)
        return replace(motion, checks=checks(fed, judged))

    def kinetic(self, motion: Operating) -> Array:
        """(H,) J, largest of every harmonic."""
        H = self.problem.harmonics
        every = [np.concatenate([q[h] for q in motion.q.values()]) for h in range(H + 1)]
        sizes = [(q.conj() @ self.problem.parts[h][0].M @ q).real for h, q in enumerate(every)]
        return 0.5 * (np.arange(1, H + 1) * motion.Omega) ** 2 * sizes[1:]

    def passed(self, x: Array, Omega: Array, share: Array) -> tuple[str, ...]:
        """Where a harmonic that is in the motion goes through the frequency of a mode, linearised about the motion,
        and no motion near by, in frequency, has much of it. share: (k, H) of the kinetic energy."""
        H, p, said = self.problem.harmonics, self.problem, []
        ahead = []
        for one, speed in zip(x, Omega, strict=True):
            k = np.zeros((p.count, p.count))
            for g, S in zip(p.groups, p.at(speed).slopes(one, True), strict=True):
                for own, slope in zip(g.first, S, strict=True):
                    k[np.ix_(own, own)] = slope[:, 0, :, 0]
            held = [assembly.stuck_modes(p.parts[h][0], 0.5 * (k + k.T))[0] for h in range(2, H + 1)]
            ahead.append([np.arange(2, H + 1)[i] * speed - np.sqrt(np.maximum(w, 0)) for i, w in enumerate(held)])
        sides = np.sign(np.array(ahead))  # (k, H - 1, m)
        for i, h, j in zip(*np.nonzero(sides[1:] * sides[:-1] < 0), strict=True):
            near = np.abs(Omega / Omega[i] - 1) < NEAR
            if FELT < share[near, h + 1].max() < SHARED:
                said.append(
                    f"{h + 2} times {Omega[i] / (2 * np.pi):.5g} Hz passes mode {j + 1}, of which no motion "
                    "has much; a shorter step_max in settings may enter an internal resonance there"
                )
        return tuple(said)

    def _fed(self, xi: float) -> Problem:
        parts = tuple(tuple(replace(p, C=p.C - xi * p.M) for p in one) for one in self.problem.parts)
        return replace(self.problem, parts=parts)

    def _at(self, Omega: float, xi: float) -> AtFrequency:
        problem = self._fed(xi)
        return AtFrequency(problem, Omega, problem.stacked([one.directly(Omega) for one in problem.eliminated]))


def _pair(value: complex) -> Array:
    return np.array([value.real, value.imag])

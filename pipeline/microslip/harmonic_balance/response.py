"""Steady forced vibration of a body with contacts to rigid ground, any number of harmonics and any contact law.

Unknown are the harmonics of the contact coordinates, the mean among them; the body is eliminated (`reduced`), the laws
are marched in time (`patch`). `Problem.evaluate` is R(x, Omega) with its derivatives, for Newton's method here and for
whatever follows solutions elsewhere.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import jax.numpy as jnp
import numpy as np
import scipy.linalg
import scipy.optimize

from ..data import Array, ComplexArray, ModalGroup
from . import reduced
from .jenkins import FrequencyResponse, Residual, tops
from .patch import Patch, equilibrium, needs_rate, rate, resultants, resultants_alone, stuck_stiffness, watch
from .reduced import Reduced, Seen

Report = Callable[[str], None]
CONVERGED = "converged"


@dataclass(frozen=True)
class Problem:
    """A body, its patches and how finely the balance is done.

    The unknowns x are displacements from the preloaded state over `scale`, harmonic by harmonic: (c,) means, (c,)
    cosines, (c,) sines, (c,) cosines of 2 Omega t, ...

    Attributes:
        body: the reduced body; its six rows of every patch in order. patches. offset: (c,) u_G of the preloaded state.
        preload: (c,) forces there, N, N m. harmonics: H. samples: of a cycle. cycles: marched from rest at every
            evaluation, the last one counts. length: m, about what the contacts move by; only the scaling.
        x_scale, lam_scale: what counts as a large x (1), and a large change of Omega (rad/s), where the solutions are
            followed by `continuation`.
    """

    body: Reduced
    patches: tuple[Patch, ...]
    offset: Array
    preload: Array
    harmonics: int = 3
    samples: int = 64
    cycles: int = 2
    length: float = 1e-6
    x_scale: float = 10.0
    lam_scale: float = 100.0

    @cached_property
    def scale(self) -> Array:
        """(c,) m and rad of a unit of x: rotations move the rim of the patch by as much as translations."""
        rims = [max(float(np.abs(p.points).max(initial=0.0)), 1e-3) for p in self.patches]
        return self.length * np.concatenate([[1.0, 1.0, 1.0, 1 / r, 1 / r, 1 / r] for r in rims])

    @cached_property
    def kinematics(self) -> tuple[Any, ...]:
        """(n, 3, 6) of every patch, as jax arrays."""
        return tuple(jnp.asarray(p.kinematics) for p in self.patches)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.body.count * (2 * self.harmonics + 1)

    def at(self, Omega: float) -> AtFrequency:
        """The problem at one frequency (rad/s)."""
        return AtFrequency(self, Omega, tuple(reduced.seen(self.body, Omega, h) for h in range(self.harmonics + 1)))

    def evaluate(self, x: Array, Omega: float) -> tuple[Array, Array, Array]:
        """R, dR/dx and dR/dOmega (Omega in rad/s); (k,), (k, k), (k,)."""
        return self.at(Omega).evaluate(x)

    def displacement(self, x: Array) -> Array:
        """(c, 2 H + 1) harmonics of the contact coordinates, measured as the laws do: with the preloaded state."""
        u = x.reshape(-1, self.body.count).T * self.scale[:, None]
        u[:, 0] += self.offset
        return u


@dataclass(frozen=True)
class AtFrequency:
    """The residual at one frequency.

    R = d - d_ref + D g, g = F(u) - p - k d in each harmonic, in units of `Problem.scale`; see `reduced`.
    """

    problem: Problem
    Omega: float
    seen: tuple[Seen, ...]

    @property
    def period(self) -> float:
        return 2 * np.pi / self.Omega

    @cached_property
    def reference(self) -> Array:
        """(k,) the response with contacts that stay as stiff as the reference stiffness: a first guess."""
        return self._stacked([s.reference for s in self.seen])

    def residual(self, x: Array) -> Array:
        """(k,) R alone."""
        return self._residual(x, self.force(x))

    def evaluate(self, x: Array) -> tuple[Array, Array, Array]:
        """See `Problem.evaluate`."""
        force, slope = self.forces(x)
        return self._residual(x, force), self.jacobian(slope), self._rate(x, force)

    def jacobian(self, slope: Array) -> Array:
        """(k, k) dR/dx for a derivative of the contact forces, that of `forces` or one found near by."""
        p, waves = self.problem, 2 * self.problem.harmonics + 1
        excess = slope - np.kron(np.eye(waves), p.body.stiffness)
        unit = np.tile(p.scale, waves)
        return np.eye(len(unit)) + self._compliant([s.compliance for s in self.seen], excess) * unit / unit[:, None]

    def force(self, x: Array) -> Array:
        """(k,) harmonics of the contact forces, N and N m, ordered as x."""
        p, u = self.problem, self.problem.displacement(x)
        parts = [
            resultants_alone(q.law, G, jnp.asarray(u[i : i + 6]), self.period, p.samples, p.cycles)
            for q, G, i in zip(p.patches, p.kinematics, range(0, len(u), 6), strict=True)
        ]
        return np.vstack([np.asarray(f) for f in parts]).T.ravel()

    def forces(self, x: Array) -> tuple[Array, Array]:
        """(k,) contact forces and (k, k) their derivative with respect to the displacements, not to x."""
        p, u = self.problem, self.problem.displacement(x)
        c, waves = u.shape
        force, slope = np.zeros((waves, c)), np.zeros((waves, c, waves, c))
        for q, G, i in zip(p.patches, p.kinematics, range(0, c, 6), strict=True):
            six = slice(i, i + 6)
            F, J = resultants(q.law, G, jnp.asarray(u[six]), self.period, p.samples, p.cycles)
            force[:, six], slope[:, six, :, six] = np.asarray(F).T, np.asarray(J).transpose(1, 0, 3, 2)
        return force.ravel(), slope.reshape(waves * c, waves * c)

    def _excess(self, x: Array, force: Array) -> Array:
        """(k,) g: forces less the preload and what the reference stiffness makes of the displacement."""
        p = self.problem
        g = force.reshape(-1, p.body.count) - (x.reshape(-1, p.body.count) * p.scale) @ p.body.stiffness.T
        g[0] -= p.preload
        return g.ravel()

    def _residual(self, x: Array, force: Array) -> Array:
        unit = np.tile(self.problem.scale, 2 * self.problem.harmonics + 1)
        given = self._compliant([s.compliance for s in self.seen], self._excess(x, force))
        return x - self.reference + given / unit

    def _rate(self, x: Array, force: Array) -> Array:
        """(k,) dR/dOmega."""
        unit = np.tile(self.problem.scale, 2 * self.problem.harmonics + 1)
        moved = self._compliant([s.compliance_rate for s in self.seen], self._excess(x, force))
        laws = self._compliant([s.compliance for s in self.seen], self._force_rate(x))
        return (moved + laws) / unit - self._stacked([s.reference_rate for s in self.seen])

    def _force_rate(self, x: Array) -> Array:
        """(k,) derivative of the forces with respect to Omega at the same displacements; of most laws it is zero."""
        p, u = self.problem, self.problem.displacement(x)
        found = np.zeros(u.shape)
        for q, G, i in zip(p.patches, p.kinematics, range(0, len(u), 6), strict=True):
            if needs_rate(q.law):
                six = rate(q.law, G, jnp.asarray(u[i : i + 6]), self.period, p.samples, p.cycles)
                found[i : i + 6] = -self.period / self.Omega * np.asarray(six)
        return found.T.ravel()

    def _compliant(self, D: list[ComplexArray], V: Array) -> Array:
        """(k, ...) compliances of the harmonics applied to vectors ordered as x."""
        c, out = self.problem.body.count, np.empty_like(V)
        out[:c] = D[0].real @ V[:c]
        for h, block in enumerate(D[1:]):
            at = slice((2 * h + 1) * c, (2 * h + 3) * c)
            out[at] = reduced.real_block(block) @ V[at]
        return out

    def _stacked(self, amplitudes: list[ComplexArray]) -> Array:
        """(k,) x of complex amplitudes a, which stand for Re(a exp(i h Omega t))."""
        parts = [amplitudes[0].real]
        for a in amplitudes[1:]:
            parts += [a.real, -a.imag]
        return np.concatenate([part / self.problem.scale for part in parts])

    def amplitudes(self, stacked: Array) -> list[ComplexArray]:
        """(c,) complex amplitudes of the harmonics 0 to H of a vector ordered as x, in its own units."""
        parts = stacked.reshape(-1, self.problem.body.count)
        pairs = zip(parts[1::2], parts[2::2], strict=True)
        return [parts[0].astype(complex), *(cos - 1j * sin for cos, sin in pairs)]


@dataclass(frozen=True)
class Point:
    """A solution at one frequency.

    Attributes:
        Omega: rad/s. x: see `Problem`. status: `CONVERGED`, or what went wrong. error: largest entry of R over the
            largest of x. iterations: Newton steps, all attempts together. seconds: spent. slope: the last derivative of
            the contact forces, if it is kept.
    """

    Omega: float
    x: Array
    status: str
    error: float
    iterations: int
    seconds: float = 0.0
    slope: Array | None = None

    @property
    def converged(self) -> bool:
        return self.status == CONVERGED


CONTRACTION = 0.1
"""Share of |R| that a step may leave for the derivative to be used again: it costs as much as a dozen residuals."""


def newton(at: AtFrequency, x: Array, tolerance: float = 1e-10, most: int = 60, slope: Array | None = None) -> Point:
    """Newton's method; derivatives of the forces are used again while they serve, steps halved until |R| falls.

    The contact forces are continuous with a piecewise continuous derivative; where a step crosses to other pieces |R|
    may rise, and the half of it need not.

    Args:
        x: start. tolerance: of the largest entry of R over that of x, which counts within 1e-3 and 1e3 of the
            reference's.
        slope: derivative of the forces somewhere near, to begin with.
    """
    R, fresh = at.residual(x), False
    reference, error = float(np.abs(at.reference).max(initial=1e-300)), np.inf
    for count in range(most):
        error = float(np.abs(R).max() / np.clip(np.abs(x).max(), 1e-3 * reference, 1e3 * reference))
        if not np.isfinite(error):
            return Point(at.Omega, x, "not a number", error, count)
        if error <= tolerance:
            return Point(at.Omega, x, CONVERGED, error, count, slope=slope)
        if slope is None:
            slope, fresh = at.forces(x)[1], True
        step = _solved(at.jacobian(slope), -R)
        trial, left = x + step, at.residual(x + step)
        if np.linalg.norm(left) <= CONTRACTION * np.linalg.norm(R):
            x, R, fresh = trial, left, False
            continue
        if fresh:
            x, R = _shortened(at, x, R, step, left)
        slope, fresh = None, False
    return Point(at.Omega, x, f"no convergence in {most} steps, |R|/|x| = {error:.1e}", error, most)


def _shortened(at: AtFrequency, x: Array, R: Array, step: Array, left: Array) -> tuple[Array, Array]:
    """x and R after the longest of 1, 1/2, ... 1/1024 of a step that lowers |R|, or the last of them."""
    share = 1.0
    while not np.linalg.norm(left) < np.linalg.norm(R) and share > 1e-3:
        share *= 0.5
        left = at.residual(x + share * step)
    return x + share * step, left


def _solved(J: Array, R: Array) -> Array:
    """J^-1 R; the shortest of all answers where J is singular: the mean place of a free body that slides is nowhere."""
    try:
        step = np.linalg.solve(J, R)
    except np.linalg.LinAlgError:
        step = np.full_like(R, np.inf)
    if np.abs(step).max() < 1e10 * np.abs(R).max():
        return step
    return np.linalg.lstsq(J, R, rcond=1e-10)[0]


def solve(problem: Problem, Omega: float, starts: list[Array], slope: Array | None = None) -> Point:
    """Newton's method from one start after the other, then from the sticking contact, then by raising the load."""
    began, at, spent = time.perf_counter(), problem.at(Omega), 0
    for x in [*starts, at.reference]:
        point = newton(at, x, slope=slope)
        spent += point.iterations
        if point.converged:
            break
    else:
        point = _raised(problem, Omega)
        spent += point.iterations
    return replace(point, iterations=spent, seconds=time.perf_counter() - began)


def _raised(problem: Problem, Omega: float) -> Point:
    """The load from a thousandth to its whole size, steps shortened where Newton's method fails."""
    x, reached, step, spent = np.zeros(problem.size), 0.0, 1e-3, 0
    while True:
        share = min(reached + step, 1.0)
        body = replace(
            problem.body,
            load={h: f * (share if h else 1.0) for h, f in problem.body.load.items()},
            size={h: f * (share if h else 1.0) for h, f in problem.body.size.items()},
        )
        point = newton(replace(problem, body=body).at(Omega), x * (share / reached if reached else 1.0), most=25)
        spent += point.iterations
        if point.converged:
            x, reached, step = point.x, share, 2 * step
            if share == 1.0:
                return replace(point, iterations=spent)
        elif step > 1e-3 * max(reached, 1e-3):
            step *= 0.5
        else:
            return replace(point, iterations=spent, status=f"{point.status}, at {share:.3g} of the load")


@dataclass(frozen=True)
class HarmonicResponse(FrequencyResponse):
    """`FrequencyResponse` whose points hold all harmonics; `monitor`, `slip` and `normal_swing` are of the first one.

    Attributes:
        x: (f, k) unknowns, see `Problem`. harmonics: (f, H + 1) complex 0-peak amplitudes of the monitor, m; the mean
            is measured from the preloaded state. contact: (f, c, 2 H + 1) displacements of the contacts, m and rad.
        dissipated: work done on the contacts in time. by_slip: (f,) friction force times path slid, J. supplied: (f,)
            work of the excitation, damped: (f,) loss in the body's own damping, J a cycle.
        slipping, open: (f, patches) share of points times cycle that slips, or is open; the rest sticks.
        unsteady: (f,) see `patch.Cycle`. status: of every point. error, iterations, seconds: (f,), see `Point`.
    """

    x: Array
    harmonics: ComplexArray
    contact: Array
    by_slip: Array
    supplied: Array
    damped: Array
    slipping: Array
    open: Array
    unsteady: Array
    status: tuple[str, ...]
    error: Array
    iterations: Array
    seconds: Array

    def columns(self) -> dict[str, Array]:
        more = {f"amplitude_{h}_m": np.abs(self.harmonics[:, h]) for h in range(2, self.harmonics.shape[1])}
        return {
            **super().columns(),
            "mean_m": self.harmonics[:, 0].real,
            **more,
            "slip_dissipated_J": self.by_slip,
            "supplied_J": self.supplied,
            "slipping": self.slipping.mean(axis=1),
            "open": self.open.mean(axis=1),
            "iterations": self.iterations.astype(float),
        }


def sweep(
    problem: Problem, frequency: Array, report: Report = lambda _: None, start: Array | None = None
) -> list[Point]:
    """Solutions at frequencies (Hz) in the given order, each started from its neighbours. A failure is recorded.

    What failed is tried again from the neighbour behind it, where that one has a solution.

    Args:
        start: (k,) where the first point starts; the sticking contact if None.
    """
    done: list[Point] = []
    slope: Array | None = None
    for i, f in enumerate(frequency):
        good = [p for p in done[-2:] if p.converged]
        starts = [] if start is None or done else [start]
        if good:
            starts = [_ahead(good, 2 * np.pi * f), good[-1].x] if len(good) == 2 else [good[-1].x]
        point = solve(problem, 2 * np.pi * float(f), starts, slope)
        slope = point.slope
        done.append(replace(point, slope=None))
        report(f"{i + 1} of {len(frequency)} frequencies: {f:.6g} Hz" + ("" if point.converged else ", not converged"))
    for i in range(len(done) - 2, -1, -1):  # from the other side, along which there may be a way
        if not done[i].converged and done[i + 1].converged:
            done[i] = _walked(problem, done[i + 1], done[i])
    return done


def _walked(problem: Problem, known: Point, failed: Point) -> Point:
    """The failed point, reached from a known one in steps of frequency that are shortened where need be."""
    began, last, step, spent = time.perf_counter(), known, 1.0, failed.iterations
    while step > 1 / 64:
        Omega = last.Omega + step * (failed.Omega - known.Omega)
        Omega = failed.Omega if abs(Omega - known.Omega) >= abs(failed.Omega - known.Omega) else Omega
        point = newton(problem.at(Omega), last.x, most=30)
        spent += point.iterations
        if not point.converged:
            step *= 0.5
        elif Omega == failed.Omega:
            return replace(point, iterations=spent, seconds=failed.seconds + time.perf_counter() - began)
        else:
            last = point
    return replace(failed, iterations=spent, seconds=failed.seconds + time.perf_counter() - began)


def _ahead(points: list[Point], Omega: float) -> Array:
    """The line through two solutions, at another frequency."""
    a, b = points
    share = (Omega - b.Omega) / (b.Omega - a.Omega) if b.Omega != a.Omega else 0.0
    return b.x + share * (b.x - a.x)


def harmonic_response(
    problem: Problem, frequency: Array, limit: Array, report: Report = lambda _: None, start: Array | None = None
) -> HarmonicResponse:  # fmt: skip
    """`sweep`, and what a reader asks of its points. limit: (patches,) friction limits, N, for reports."""
    points = sweep(problem, frequency, report, start)
    rows = [_looked_at(problem, p) for p in points]
    parts = {key: np.array([row[key] for row in rows]) for key in rows[0]}
    return HarmonicResponse(
        frequency=np.asarray(frequency, dtype=float),
        converged=np.array([p.converged for p in points]),
        limit=np.asarray(limit, dtype=float),
        x=np.array([p.x for p in points]),
        status=tuple(p.status for p in points),
        error=np.array([p.error for p in points]),
        iterations=np.array([p.iterations for p in points]),
        seconds=np.array([p.seconds for p in points]),
        **parts,
    )


def _looked_at(problem: Problem, point: Point) -> dict[str, Any]:
    at, x, p = problem.at(point.Omega), point.x, problem
    force = at.force(x)
    g = at.amplitudes(at._excess(x, force))
    whole = at.amplitudes(force - np.concatenate([p.preload, np.zeros(len(force) - len(p.preload))]))
    q = [s.modal - s.modal_compliance @ one for s, one in zip(at.seen, g, strict=True)]
    harmonics = [reduced.monitored(p.body, h, *pair) for h, pair in enumerate(zip(q, whole, strict=True))]
    done = np.array([reduced.work(p.body, at.Omega, h, q[h], whole[h]) for h in range(1, p.harmonics + 1)])
    u = p.displacement(x)
    cycles = [
        watch(k.law, G, u[6 * i : 6 * i + 6], at.period, p.samples, p.cycles)
        for i, (k, G) in enumerate(zip(p.patches, p.kinematics, strict=True))
    ]
    first = u[:, 1] - 1j * u[:, 2]
    tangential = np.where(np.abs(first[2::6]) > np.abs(first[1::6]), first[2::6], first[1::6])
    return {
        "monitor": harmonics[1],
        "harmonics": harmonics,
        "slip": tangential,
        "normal_swing": np.abs(whole[1][::6]),
        "contact": u,
        "dissipated": sum(float(c.dissipated.sum()) for c in cycles),
        "by_slip": sum(float(c.by_slip.sum()) for c in cycles),
        "supplied": float(done[:, 0].sum()),
        "damped": float(done[:, 1].sum()),
        "slipping": [float(c.slipping.mean()) for c in cycles],
        "open": [float(c.open.mean()) for c in cycles],
        "unsteady": max(c.unsteady for c in cycles),
    }


def of_body(
    group: ModalGroup, patches: tuple[Patch, ...], normal: Array, force: Array, watched: Array, amplitude: float = 1.0,
    residual: Residual | None = None, **settings: Any,
) -> Problem:  # fmt: skip
    """The problem of a modal group whose patches are pressed by normal forces first (Sextro Eq. (5.2-5)).

    Args:
        group: in modal or any other coordinates. normal: (patches,) N. force, watched, amplitude,
            residual: see `reduced.of_group`. settings: harmonics, samples, cycles, length of `Problem`.
    """
    offset = [equilibrium(p, float(n)) for p, n in zip(patches, normal, strict=True)]
    stiffness = [stuck_stiffness(p, u) for p, u in zip(patches, offset, strict=True)]
    preload = [np.array([n, 0.0, 0.0, 0.0, 0.0, 0.0]) for n in np.asarray(normal, dtype=float)]
    body = reduced.of_group(
        group, [p.interface for p in patches], scipy.linalg.block_diag(*stiffness), force, watched, amplitude, residual
    )
    return Problem(body, patches, np.concatenate(offset), np.concatenate(preload), **settings)


def refined_peaks(problem: Problem, response: HarmonicResponse) -> list[tuple[float, float]]:
    """(Hz, m) of every local maximum of the monitored amplitude, searched for between its neighbours on the grid.

    To a millionth of the distance between the two or in twelve steps; points that do not converge count as none.
    """
    found = []
    for i in tops(response):

        def lowered(f: float, start: Array = response.x[i]) -> float:
            point = solve(problem, 2 * np.pi * f, [start])
            return -abs(_looked_at(problem, point)["monitor"]) if point.converged else 0.0

        low, high = (float(response.frequency[j]) for j in (i - 1, i + 1))
        options: Any = {"xatol": 1e-6 * (high - low), "maxiter": 12}
        best: Any = scipy.optimize.minimize_scalar(lowered, bounds=(low, high), method="bounded", options=options)
        top = max((float(-best.fun), float(best.x)), (float(abs(response.monitor[i])), float(response.frequency[i])))
        found.append((top[1], top[0]))
    return found

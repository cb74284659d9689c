"""Integrating an assembly, and what a motion in time says of itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy.linalg

from ..data import Array, NotConverged, UserError
from ..settings.mistakes import bounded
from ..units import counted
from .equations import Equations
from .ground import steps_of_waves
from .stepper import EVENTS, KINDS, Now, Seen, Stepper, static_force

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Report = Callable[[str], None]
Start = Literal["static", "rest"]

OF_CONTACT = 150
"""Steps in a period of the fastest motion with closed contacts, if nothing is asked for."""

OF_PERIOD = 512
"""Steps in a period of the excitation at least."""

STABLE = 1.8
"""Steps times the rate of the contacts above which kicks may grow; they do above 2."""

CHUNK = 16
"""Periods between two reports."""

UNSOLVED = 1e-6
"""Share of the largest motion of the contacts that an implicit step may miss before a reader is told."""

REPEATS = 1e-3
"""Share of the size of a motion within which it counts as having come back."""


@dataclass(frozen=True, eq=False)
class Orbit:
    """A motion in time, sampled.

    Attributes:
        equations. labels: of the read-outs, ``monitor direction``. samples: of a period. steps: of a period.
        time: (s,) s. y, v: (w, s) read-outs in m and their velocities in m/s. q, q_dot: (m, s) modal coordinates of
            `Equations.shapes`. d, force: (c, s) of the contact coordinates, m and N.
        energy: name -> (s,) J: ``mechanical`` of the bodies; since the start ``given`` by loads and preloads,
            ``damped``, and ``contacts``, done on them; of that, and of what moving
            ``ground`` gave them, ``stored`` and ``lost``, nan where a law does not tell.
        events: (e, 3) time in s, number of the contact, kind (an index of `KINDS`). missed: how many are not listed.
        error: largest deviation of a read-out when the last period is done with half the step, a share of the largest
            read-out; nan if it was not looked for. diverged: time (s) at which numbers became infinite; inf: never.
    """

    equations: Equations
    labels: tuple[str, ...]
    samples: int
    steps: int
    time: Array
    y: Array
    v: Array
    q: Array
    q_dot: Array
    d: Array
    force: Array
    energy: Mapping[str, Array]
    events: Array
    missed: int = 0
    error: float = math.nan
    diverged: float = math.inf
    messages: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        w = self.equations.Omega
        return (
            f"<Orbit: {len(self.time) // self.samples} periods at {w / 2 / np.pi:.6g} Hz ({w:.6g} rad/s); {self.said}>"
        )

    @property
    def period(self) -> float:
        """s, of the excitation."""
        return 2 * np.pi / self.equations.Omega

    @cached_property
    def repeats(self) -> int:
        """After how many periods of the excitation the motion comes back within `REPEATS`; 0: it does not within half
        of the periods that are kept."""
        z = np.concatenate([np.sqrt(np.abs(self.equations.omega2))[:, None] * self.q, self.q_dot])
        stroboscopic = z[:, self.samples - 1 :: self.samples]
        size, count = np.abs(z).max(initial=0.0), stroboscopic.shape[1]
        for p in range(1, count // 2 + 1):
            if np.abs(stroboscopic[:, p:] - stroboscopic[:, :-p]).max(initial=0.0) <= REPEATS * size:
                return p
        return 0

    def count(self, kind: str, contact: int | None = None) -> int:
        """Number of events of a kind ("closes", "opens", "slips", "sticks") in the periods that are kept."""
        if kind not in KINDS:
            raise UserError(f"kind: '{kind}' is none of {', '.join(KINDS)}")
        own = self.events[:, 2] == KINDS.index(kind)
        return int((own if contact is None else own & (self.events[:, 1] == contact)).sum())

    @property
    def impacts(self) -> float:
        """Impacts of all contacts per period of the excitation."""
        return self.count("closes") / max(len(self.time) // self.samples, 1)

    @property
    def said(self) -> str:
        """What motion it is, in words."""
        if math.isfinite(self.diverged):
            return f"diverged at {self.diverged:.6g} s"
        kept, p = len(self.time) // self.samples, self.repeats
        if kept < 2:
            return "too short to say whether it repeats"
        came = f"comes back after {counted(p, 'period')}" if p else f"does not come back within {kept // 2} periods"
        hits = counted(round(self.impacts * p), "impact")
        per = (
            f"{hits} in {'them' if p > 1 else 'it'}"
            if p
            else f"{self.impacts:.4g} impact{'s' * (self.impacts != 1)} a period"
        )
        return f"{came}, {per}" if self.equations.contacts else came

    @property
    def drift(self) -> float:
        """Share of the energy that passed through the contacts by which what they store and lost differs from it."""
        E = self.energy
        if not len(self.time):
            return 0.0
        left = E["contacts"] + E["ground"] - E["stored"] - E["lost"]
        passed = max(np.ptp(E["contacts"]), np.ptp(E["ground"]))
        return float(np.abs(left - left[0]).max() / passed) if passed else 0.0

    @property
    def balance(self) -> float:
        """Largest deviation of the bodies' energy from what they got, a share of what was given or is there at most."""
        E = self.energy
        left = E["mechanical"] - E["given"] + E["damped"] + E["contacts"]
        size = max(np.abs(E["mechanical"]).max(initial=0.0), np.ptp(E["given"]) if len(self.time) else 0.0)
        return float(np.ptp(left) / size) if size else 0.0

    def plot(self, axes: Axes | None = None, read_out: int = 0) -> Axes:
        """Draw its phase portrait: velocity over displacement of a read-out, and a point after every period."""
        if axes is None:
            import matplotlib.pyplot as plt

            axes = plt.subplots(layout="constrained")[1]
        y, v, last = self.y[read_out], self.v[read_out], slice(self.samples - 1, None, self.samples)
        axes.plot(y, v, linewidth=0.8)
        axes.plot(y[last], v[last], "o", label="after every period")
        axes.set(xlabel=f"{self.labels[read_out]} in m", ylabel="velocity in m/s")
        return axes


def run(
    equations: Equations, settle: int, keep: int, samples: int = 256, steps: int | None = None,
    start: Start = "static", report: Report = lambda _: None,
) -> Orbit:  # fmt: skip
    """Motion in time from a start: see `microslip.integrate`.

    Args:
        settle: periods that are left to themselves. keep: that are kept. samples, steps: of a period.

    Raises:
        UserError: steps that are too few for the contacts' springs. NotConverged: no state of rest is found.
    """
    for name, value, least in (("settle", settle, 0), ("keep", keep, 1), ("samples", samples, 8)):
        bounded(name, value, ge=least)
    each = steps_of_a_sample(equations, samples, steps)
    stepper = Stepper(equations, 2 * np.pi / equations.Omega / (each * samples))
    now = stepper.start(*begun(equations, start))
    kept, done, missed, events = list[Seen](), 0, 0, list[Array]()
    while done < settle + keep:
        before, dense = now, done >= settle
        ahead = 1 if dense else min(CHUNK, settle - done, samples)
        rows = np.full(samples, each) if dense else np.where(np.arange(samples) < ahead, each * samples, 0)
        now, seen = stepper.run(now, rows)
        done += ahead
        if not np.isfinite(seen.mechanical[-1]):
            return _orbit(stepper, kept, events, missed, samples, each, diverged=float(before.time))
        if dense:
            kept.append(Seen._make(map(np.asarray, seen)))
            events.append(np.asarray(now.events)[: min(int(now.count), EVENTS)])
            missed += max(0, int(now.count) - EVENTS)
        if done % CHUNK == 0 or done in (settle, settle + keep):
            report(f"period {done} of {settle + keep}, {float(now.time):.6g} s")
    found = _orbit(stepper, kept, events, missed, samples, each)
    error = _error(stepper, now, samples, each)
    return replace(found, error=error, messages=_warnings(found, float(now.worst)))


def _warnings(found: Orbit, worst: float) -> tuple[str, ...]:
    """What a reader must know. worst: m, of the contacts that yield at once."""
    said = []
    if worst > UNSOLVED * np.abs(found.d).max(initial=0.0):
        said.append(f"Contacts were not solved for in every step, to {worst:.2g} m at worst; take more steps.")
    if found.missed:
        said.append(f"{counted(found.missed, 'event')} more than are listed, and counted, happened.")
    return tuple(said)


def _error(stepper: Stepper, now: Now, samples: int, each: int) -> float:
    """Deviation of one more period from the same with half the step, over the largest read-out."""
    fine = Stepper(stepper.equations, stepper.tau / 2, stepper.accounts)
    half = 0.5 * (fine.tau - stepper.tau)
    kick = np.einsum("bpc,c->bp", np.asarray(stepper.bodies.kick), np.asarray(now.force) - stepper.equations.F_0)
    p = kick.shape[1]
    finer = now._replace(y=now.y.at[:, p:].add(half * kick))
    both = [s.run(n, np.full(samples, k))[1] for s, n, k in ((stepper, now, each), (fine, finer, 2 * each))]
    y = [_read(stepper.equations, seen) for seen in both]
    size = np.abs(y[1]).max(initial=0.0)
    return float(np.abs(y[0] - y[1]).max(initial=0.0) / size * 4 / 3) if size else 0.0


def steps_of_a_sample(e: Equations, samples: int, steps: int | None) -> int:
    """Steps from one sample to the next, a power of two where nothing is asked for.

    Raises:
        UserError: so few that the contacts' springs would make the motion grow.
    """
    if steps is None:
        wanted = max(OF_PERIOD, OF_CONTACT * e.fastest / e.Omega, steps_of_waves(e.contacts, 2 * np.pi / e.Omega))
        return int(2 ** max(0, math.ceil(math.log2(wanted / samples))))
    bounded("steps", steps, ge=1)
    least = math.ceil(2 * np.pi / e.Omega * e.rate / STABLE)
    if steps < least:
        raise UserError(
            f"steps: {steps} a period are unstable with the springs of these contacts; take {least} or more"
        )
    if steps < (least := steps_of_waves(e.contacts, 2 * np.pi / e.Omega)):
        raise UserError(f"steps: {steps} a period are too few for the waviness of the ground; take {least} or more")
    return max(1, math.ceil(steps / samples))


def begun(e: Equations, start: Start) -> tuple[Array, Array]:
    """(m,) modal displacements and velocities to start from.

    Raises:
        NotConverged: Newton's method finds no rest under the steady loads. UserError: no such start.
    """
    zero = np.zeros(len(e.omega2))
    if start == "rest":
        return zero, zero
    if start != "static":
        raise UserError(f"start: '{start}' is none of static, rest")
    if not e.B[:, 0].any() and not any(c.offset[0] > 0 and not c.preload.any() for c in e.contacts):
        return zero, zero  # preloads are in balance there
    return _static(e), zero


def _static(e: Equations, most: int = 60) -> Array:
    """(m,) where steady loads and contacts that came there on a straight way are in balance, by Newton's method."""
    q, force = np.zeros(len(e.omega2)), static_force(Stepper(e, 1.0, False))
    scale = np.abs(e.B[:, 0]).max(initial=0.0) + np.abs(e.D.T @ e.F_0).max(initial=0.0)

    def missing(q: Array) -> tuple[Array, Array]:
        F, S = force(q)
        return e.omega2 * q - e.B[:, 0] + e.D.T @ (F - e.F_0), S

    R, S = missing(q)
    scale = max(scale, np.abs(R).max(initial=0.0))
    for _ in range(most):
        if np.abs(R).max(initial=0.0) <= 1e-10 * scale:
            return q
        K = np.diag(e.omega2) + e.D.T @ S @ e.D
        step = -scipy.linalg.lstsq(K, R)[0]
        share = 1.0
        for _ in range(12):
            trial, slope = missing(q + share * step)
            if np.linalg.norm(trial) < np.linalg.norm(R):
                break
            share *= 0.5
        q, R, S = q + share * step, trial, slope
    raise NotConverged('no rest under the steady loads was found; write start = "rest" to begin at q = 0')


def _orbit(
    stepper: Stepper, kept: list[Seen], events: list[Array], missed: int, samples: int, each: int,
    diverged: float = math.inf,
) -> Orbit:  # fmt: skip
    e, c = stepper.equations, len(stepper.equations.D)
    m = len(e.omega2)
    none = Seen._make([*(np.zeros((0, n)) for n in (m, m, c, c, 6)), np.zeros(0), np.zeros(0)])
    seen = Seen._make(np.concatenate(x) for x in zip(none, *kept, strict=True))
    listed = np.concatenate([np.zeros((0, 3)), *events])
    rates = seen.q_dot @ e.output.T + e.oscillators(seen.time) @ (e.output_given @ e.turning).T
    return Orbit(
        e, tuple(f"{w.monitor} {w.label}" for w in e.assembly.outputs), samples, each * samples, seen.time,
        _read(e, seen), rates.T, seen.q.T, seen.q_dot.T, seen.d.T, seen.force.T, _energies(e, seen), listed, missed,
        diverged=diverged,
    )  # fmt: skip


def _read(e: Equations, seen: Seen) -> Array:
    """(w, s) read-outs, m."""
    q, force, o = np.asarray(seen.q), np.asarray(seen.force), e.oscillators(np.asarray(seen.time))
    return (q @ e.output.T - (force - e.F_0) @ e.output_residual.T + o @ e.output_given.T).T


def _energies(e: Equations, seen: Seen) -> dict[str, Array]:
    """See `Orbit`: preloads count as loads, and what bodies hold beside their modes as theirs."""
    named = dict(zip(("given", "damped", "contacts", "lost", "stored", "ground"), seen.energy.T, strict=True))
    more, preloads = seen.force - e.F_0, seen.d @ e.F_0
    beside = 0.5 * np.einsum("sc,cd,sd->s", more, e.R, more)
    named["given"] = named["given"] + preloads
    named["contacts"] = named["contacts"] + preloads - beside
    return {"mechanical": seen.mechanical + beside, **named}

"""The equations of a motion in time by an integrator for stiff ones that chooses its own steps: what the stepper is
proved on.

With x, what the contacts' laws remember in their differential equations (`contact.law.Law.rates`),

    q' = v,  v' = B o - C v - K q - D^T (F - F_0),  x' by the laws,

and the works of loads, dampers and contacts beside them; o is known at any time. The Jacobian is exact (jax), the
integrator CVODE of SUNDIALS (A. C. Hindmarsh et al., ACM Trans. Math. Software 31, 2005), which came through sliders
where LSODA did not, and was five to ten times as fast as Radau and BDF of SciPy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from microslip.data import Array
from microslip.time_domain.contacts import joined, moved, parts
from microslip.time_domain.equations import MotionEquations
from microslip.time_domain.orbit import Orbit, Start, begun
from microslip.time_domain.samples import announced
from microslip.time_domain.stepper import Stepper

MOST = 50_000_000
"""Steps from one sample to the next at most."""

WORKS = 3
"""Beside motion and memory: given by loads, taken by dampers, done on contacts, J."""

SMALL = 1e-3
"""Absolute tolerance: share of the relative one, times the size that a coordinate has under the loads alone. Contacts
press each other in by less than bodies move."""

LAG = 1e-6
"""rad of the excitation by which friction lags where a motion turns: see `Law.rates`. Integrators get stuck at the jump
where springs begin to slide in two directions."""


@dataclass(frozen=True, eq=False)
class Rates:
    """z' of z = (q, v, x, works) as compiled functions of time and z, of laws that are differential equations
    (`Law.remembers`), on bodies that yield by their modes alone."""

    equations: MotionEquations

    @cached_property
    def stepper(self) -> Stepper:
        """Whose groups and order of contacts are taken."""
        return Stepper(self.equations, 1.0, accounts=False)

    @cached_property
    def memory(self) -> list[tuple[int, int]]:
        """(k, n) numbers and points of each group."""
        return [(g.law.remembers or 0, int(np.prod(g.G.shape[:2]))) for g in self.stepper.groups]

    @cached_property
    def size(self) -> Array:
        """(z,) about the size of every coordinate, from what the loads alone make of it."""
        e = self.equations
        fast = np.maximum(np.sqrt(np.abs(e.omega2)), e.Omega)
        push = np.abs(e.B).max(initial=0.0) or np.abs(e.D.T @ e.F_0).max(initial=0.0) or 1.0
        q, way = push / fast**2, np.abs(e.D_o[:, 1:]).max(initial=0.0)
        moved = max(float((np.abs(e.D) @ q).max(initial=0.0)), float(way)) or 1.0
        felt = push / (np.linalg.norm(e.D, axis=1).max(initial=0.0) or 1.0)
        x = [np.full(k * n, felt if k < 4 else moved) for k, n in self.memory]
        return np.concatenate([q, push / fast, *x, np.full(WORKS, felt * moved)])

    def start(self, q: Array, v: Array) -> Array:
        return np.concatenate([q, v, np.zeros(sum(k * n for k, n in self.memory) + WORKS)])

    def at(self, times: Array, z: Array) -> tuple[Array, Array]:
        """(c, s) d and force of the contacts' coordinates at times (s,) and states (s, z)."""
        _, d, force, _ = jax.vmap(self.told)(jax.device_put(times), jax.device_put(z))
        back = np.argsort(self.stepper.rows)
        return np.asarray(d).T[back], np.asarray(force).T[back]

    @cached_property
    def told(self) -> Callable[[Any, Any], tuple[Any, Any, Any, Any]]:
        """Function of time and z: z', d and force of the contacts' coordinates, overlap of each contact in m."""
        e, groups, memory = self.equations, self.stepper.groups, self.memory
        m, turning = len(e.omega2), jnp.asarray(e.turning)
        rows, order = self.stepper.rows, np.argsort(self.stepper.numbers)
        B, C, K, D, D_o, F_0 = map(jnp.asarray, (e.B, e.C, e.omega2, e.D[rows], e.D_o[rows], e.F_0[rows]))
        harmonics = jnp.asarray(e.harmonics, dtype=float)

        def rates(t: Any, z: Any) -> tuple[Any, Any, Any, Any]:
            q, v, at = z[:m], z[m : 2 * m], 2 * m
            angle = t * e.Omega * harmonics
            o = jnp.concatenate([jnp.ones(1), jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=1).reshape(-1)])
            d, moving = D @ q + D_o @ o, D @ v + D_o @ (turning @ o)
            forces, remembered, deep = list[Any](), [], [jnp.zeros(0)]
            for g, (k, n), at_d, at_v in zip(groups, memory, parts(groups, d), parts(groups, moving), strict=True):
                u, w = moved(g, at_d + g.offset), moved(g, at_v)
                f, rate = g.law.rates(u, w, z[at : at + k * n].reshape(k, n), t, LAG / e.Omega)
                forces.append(f)
                remembered.append(rate.reshape(-1))
                deep.append(jnp.max(g.law.overlap(u).reshape(len(g.G), -1), axis=1))
                at += k * n
            force = joined(groups, forces)
            push, drag, pressed = B @ o, C @ v, force - F_0
            works = jnp.stack([v @ push, v @ drag, pressed @ (D @ v)])
            change = jnp.concatenate([v, push - drag - K * q - D.T @ pressed, *remembered, works])
            return change, d, force, jnp.concatenate(deep)[order] if groups else deep[0]

        return jax.jit(rates)

    @cached_property
    def rate(self) -> Callable[[float, Array], Array]:
        told = self.told
        found = jax.jit(lambda t, z: told(t, z)[0])
        return lambda t, z: np.asarray(found(t, z))

    @cached_property
    def slope(self) -> Callable[[float, Array], Array]:
        """(z, z) Jacobian."""
        told = self.told
        found = jax.jit(jax.jacfwd(lambda z, t: told(t, z)[0]))
        return lambda t, z: np.asarray(found(z, t))

    @cached_property
    def overlap(self) -> Callable[[float, Array], Array]:
        told = self.told
        found = jax.jit(lambda t, z: told(t, z)[3])
        return lambda t, z: np.asarray(found(t, z))


def run(
    e: MotionEquations, keep: int, samples: int, start: Start = "rest", settle: int = 0, tolerance: float = 1e-9
) -> Orbit:
    """Motion in time from a start: see `orbit.run`. Impacts and separations are found as roots; slips and sticks are
    not counted. `Orbit.steps` are evaluations of a period."""
    rates, period = Rates(e), 2 * np.pi / e.Omega
    times = period * (settle + np.arange(1, samples * keep + 1) / samples)
    found = solve(rates, rates.start(*begun(e, start)), times, tolerance)
    return _orbit(rates, found, samples, round(found.nfev / (settle + keep)), times[0] - period / samples)


def solve(rates: Rates, z: Array, times: Array, tolerance: float) -> Any:
    """CVODE's result: t (1 + s,), y (1 + s, z) from time 0 on, and its events, which are roots of `Rates.overlap`."""
    from sksundae.cvode import CVODE

    def rate(t: float, z: Array, out: Array) -> None:
        out[:] = rates.rate(t, z)

    def slope(t: float, z: Array, rate: Array, out: Array) -> None:
        out[:, :] = rates.slope(t, z)

    def meet(t: float, z: Array, out: Array) -> None:
        out[:] = np.nan_to_num(rates.overlap(t, z), nan=1.0)

    count = len(rates.equations.contacts)
    meet.terminal = [False] * count  # type: ignore[attr-defined]
    watched: dict[str, Any] = {"eventsfn": meet, "num_events": count} if count else {}
    solver = CVODE(
        rate,
        jacfn=slope,
        rtol=tolerance,
        atol=SMALL * tolerance * rates.size,
        max_num_steps=MOST,
        max_conv_fails=100,
        **watched,
    )
    found = solver.solve(np.concatenate([[0.0], times]), z)
    assert found.success, f"CVODE gave up at {found.t[-1]:.6g} s"
    return found


def _orbit(rates: Rates, found: Any, samples: int, steps: int, begin: float) -> Orbit:
    e, t, z = rates.equations, found.t[1:], found.y[1:]
    m = len(e.omega2)
    q, v = z[:, :m], z[:, m : 2 * m]
    d, force = rates.at(t, z)
    o, preloads = e.oscillators(t), e.F_0 @ d
    given, damped, contacts = z[:, -WORKS:].T
    nothing = np.full(len(t), np.nan)
    arrays = {
        "time": t,
        "angular_frequency": np.full(len(t), e.Omega),
        "displacement": (q @ e.output.T + o @ e.output_given.T).T,
        "velocity": (v @ e.output.T + o @ (e.output_given @ e.turning).T).T,
        "modal_displacement": q.T,
        "modal_velocity": v.T,
        "contact_displacement": d,
        "contact_force": force,
        "event": _events(found, begin),
        "energy_mechanical": 0.5 * np.sum(v**2 + e.omega2 * q**2, axis=1),
        "energy_given": given + preloads,
        "energy_damped": damped,
        "energy_contacts": contacts + preloads,
        "energy_stored": nothing,
        "energy_lost": nothing,
        "energy_ground": nothing,
    }
    return Orbit(arrays=arrays, model=e, steps=steps, **vars(announced("by CVODE", e, samples)))


def _events(found: Any, begin: float) -> Array:
    """(e, 3) time, contact, kind, after a time: closing is 0, opening is 1 (`stepper.KINDS`)."""
    if found.t_events is None:
        return np.zeros((0, 3))
    at = [(t, i, 0.0 if way > 0 else 1.0) for t, ways in zip(found.t_events, found.i_events, strict=True)
          for i, way in enumerate(ways) if way and t > begin]  # fmt: skip
    return np.array(at, dtype=float).reshape(-1, 3)
